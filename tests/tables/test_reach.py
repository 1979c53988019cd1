"""What a rig can reach of a table: tables of the model itself, with an effect planted, with holes, and the paper's."""

import json
import math
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import msgspec
import numpy as np
import pandas as pd
import pytest
from calls import call
from msgspec.structs import replace

from winchcascade.core.errors import RigError
from winchcascade.core.published_table import PublishedTable, load_table, parse_table
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import built_in, parse_rig
from winchcascade.core.run import Run
from winchcascade.diagnosis.suspects import with_values
from winchcascade.ingest.read import read_run
from winchcascade.reduction.efficiency import METRICS
from winchcascade.reduction.reduce import first_metrics, reduce
from winchcascade.report.content import Table
from winchcascade.report.results.audit_record import attainable_record
from winchcascade.report.results.audits import attainable_summary, audit_report
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import EFFECTS, make_effect
from winchcascade.rig.parts import Model
from winchcascade.rig.simulate import simulate
from winchcascade.tables.attainable import AttainableRanges, attainable_ranges
from winchcascade.tables.attainable_row import Cell, row_windows, standard_error
from winchcascade.tables.audit import audit_by_load
from winchcascade.tables.effect_search import TableSimulator
from winchcascade.tables.feasible import repeatability

RIG = built_in()
SOME = ("copper_heating", "gear_mesh_loss", "screw_friction", "torque_gain", "clutch_drag")
SCATTER = 0.01
"""Largest deviation of a cycle that the tables made here would print. [1]"""

COLUMNS = "\n".join(
    f'{metric} = {{ unit = "{unit}", decimals = {decimals} }}'
    for kind, unit, decimals in (("energy", "J", 0), ("power", "W", 0), ("eta", "1", 3))
    for metric in METRICS
    if metric.startswith(kind)
)


def made_reduce(run: Run, window: float | None) -> dict[str, float | None]:
    return first_metrics(run, RIG, window)


def judged(table: PublishedTable, *names: str, scatter: float = SCATTER, rig: Rig = RIG) -> AttainableRanges:
    suspects = {name: EFFECTS[name] for name in names or SOME}
    return attainable_ranges(table, rig, suspects, made_reduce, scatter=scatter)


def a_payout(speed: float, load: float) -> Run:
    """A payout by a curve of its own: a ramp of a sine's shape over 4 s, a ripple of 2 %, braking; 8 m at 0.9 m/s."""
    t = np.arange(0.0, 13.0, 0.04)
    up, down = np.clip((t - 1.0) / 4.0, 0.0, 1.0), np.clip((t - 10.0) / 1.0, 0.0, 1.0)
    v = speed * 0.5 * (1.0 - np.cos(math.pi * up)) * (1.0 - down) * (1.0 + 0.02 * np.sin(3.0 * t) * up)
    x = np.concatenate(([0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * 0.04)))
    return Run("made", t, {"displacement": x, "velocity": v}, 25.0, t.size, load=load)


def made_rows(model: Model) -> list[dict[str, float]]:
    """Rows of three loads, as a reduction of simulated logs would print them."""
    rows = []
    for load, speed in ((45.0, 0.9), (18.0, 0.8), (4.5, 0.3)):
        mean = reduce(simulate(a_payout(speed, load), model).run, window=5.5).mean
        row = {"load_ohm": load}
        for metric in METRICS:
            value = getattr(mean, metric)
            row[metric] = round(value, 3 if metric.startswith("eta") else 0)
        rows.append(row)
    return rows


def as_table(rows: list[dict[str, float]], *left_out: str) -> PublishedTable:
    text = f'title = "made"\nsource = "none"\n[columns]\n{COLUMNS}\n'
    for row in rows:
        text += "\n[[row]]\n" + "\n".join(f"{k} = {v}" for k, v in row.items() if k not in left_out) + "\n"
    return parse_table(text, "made.toml")


@cache
def own_rows() -> tuple[dict[str, float], ...]:
    return tuple(made_rows(baseline(RIG)))


def own_table(*left_out: str) -> PublishedTable:
    return as_table([dict(row) for row in own_rows()], *left_out)


@cache
def paper() -> AttainableRanges:
    table = load_table("hsu2026-table2")
    return judged(table, "ke_rolloff", *SOME, scatter=repeatability(table).eta)


def cells_of(found: AttainableRanges, metric: str) -> list[Cell]:
    return [cell for row in found.rows for cell in row.cells if cell.metric == metric]


def test_a_table_of_the_model_itself_is_within_reach_and_names_nobody() -> None:
    found = judged(own_table())
    assert found.ok
    assert [cell.gap for row in found.rows for cell in row.cells] == [0.0] * 9
    assert (found.explanation.suspects, found.explanation.sets) == ((), ())
    assert [row.window for row in found.rows] == pytest.approx([5.5] * 3, rel=1e-3)
    for row, speed in zip(found.rows, (0.9, 0.8, 0.3), strict=True):
        assert row.speeds.low < speed < row.speeds.high
    assert attainable_summary(found) == "all 9 efficiencies can be reached"


SIZE = 0.015
"""How far the recovered mesh loss may be off: the payout that made the table is not the middle one. [1]"""


def test_a_planted_loss_is_out_of_reach_and_among_those_that_could_be_why() -> None:
    planted = make_effect("gear_mesh_loss", {"efficiency_change": -0.08}).apply(baseline(RIG))
    found = judged(as_table(made_rows(planted)))
    assert all(cell.outside and cell.gap < 0.0 for cell in cells_of(found, "eta_gen"))
    movers = {mover.effect: mover for mover in found.explanation.suspects}
    loss = movers["gear_mesh_loss"]
    assert loss.ability("eta_gen").verdict == "explains"
    assert loss.best is not None
    assert loss.best.enough
    assert loss.best.plausible
    assert loss.best.fields["gear_mesh_loss"]["efficiency_change"] == pytest.approx(-0.08, abs=SIZE)
    assert found.explanation.size == 1
    assert [list(values.fields) for values in found.explanation.sets] == [["gear_mesh_loss"]]
    assert movers["clutch_drag"].best is None
    assert movers["screw_friction"].ability("eta_gen").closed < 0.01


def test_two_planted_effects_need_a_pair() -> None:
    model = make_effect("gear_mesh_loss", {"efficiency_change": -0.08}).apply(baseline(RIG))
    model = make_effect("screw_friction", {"mu_change": -0.03}).apply(model)
    found = judged(as_table(made_rows(model))).explanation
    assert found.size == 2
    (best, *_) = [values for values in found.sets if set(values.fields) == {"gear_mesh_loss", "screw_friction"}]
    assert best.fields["gear_mesh_loss"]["efficiency_change"] == pytest.approx(-0.08, abs=SIZE)
    assert best.fields["screw_friction"]["mu_change"] == pytest.approx(-0.03, abs=SIZE)


@pytest.mark.slow
def test_the_papers_generator_efficiencies_are_seven_points_below_anything_its_constants_allow() -> None:
    gaps = [100.0 * cell.gap for cell in cells_of(paper(), "eta_gen")]
    assert len(gaps) == 6
    assert all(-10.0 < gap < -6.5 for gap in gaps)
    assert all(2.0 < 100.0 * cell.gap < 4.0 for cell in cells_of(paper(), "eta_trans"))
    assert not paper().ok


@pytest.mark.slow
def test_roll_off_explains_neither_of_the_papers_gaps() -> None:
    movers = {mover.effect: mover for mover in paper().explanation.suspects}
    rolloff = movers["ke_rolloff"]
    assert len(rolloff.fields) >= 4
    assert rolloff.ability("eta_trans").verdict == rolloff.ability("eta_gen").verdict == "no"
    assert rolloff.ability("eta_trans").closed < 0.05
    assert rolloff.ability("eta_gen").closed < 0.3
    assert movers["gear_mesh_loss"].ability("eta_gen").verdict == "explains"
    assert movers["screw_friction"].ability("eta_trans").verdict == "explains"


NEAR = 1e-3
"""Between its simulated nodes a curve may be this far from a simulation. [1]"""


@pytest.mark.slow
def test_the_value_that_a_row_needs_brings_it_within_reach() -> None:
    simulator = TableSimulator(paper().rows, baseline(RIG), made_reduce)
    for mover in paper().explanation.suspects:
        for ability in mover.abilities:
            for row, value in enumerate(ability.needed):
                if value is not None and mover.effect in ("gear_mesh_loss", "screw_friction"):
                    there = simulator.efficiencies(
                        [with_values(EFFECTS[mover.effect], np.array([value]))], simulator.speeds
                    )
                    assert there is not None
                    k = ("eta_trans", "eta_gen", "eta_pto").index(ability.metric)
                    assert simulator.excess(there[0])[row, k] < NEAR


def test_every_named_set_is_enough_when_it_is_simulated() -> None:
    simulator = TableSimulator(paper().rows, baseline(RIG), made_reduce)
    assert paper().explanation.sets
    for values in paper().explanation.sets:
        effects = [make_effect(name, fields) for name, fields in values.fields.items()]
        there = simulator.efficiencies(effects, simulator.speeds)
        assert there is not None
        eta, _ = there
        assert simulator.excess_by_metric(eta).sum() == 0.0
        product = eta[:, 0] * eta[:, 1]
        assert eta[:, 2] == pytest.approx(product, rel=1e-6)


def test_energies_alone_give_the_efficiencies() -> None:
    found = judged(own_table("eta_trans", "eta_gen", "eta_pto", "power_mech", "power_gen"))
    assert found.ok
    assert all(cell.derived for row in found.rows for cell in row.cells)
    assert sum(len(row.cells) for row in found.rows) == 9


def test_rows_without_powers_are_judged_by_their_energies_and_without_both_at_the_rated_speed() -> None:
    energies = judged(own_table("power_line", "power_mech", "power_gen"))
    assert energies.ok
    assert energies.notes == ("no window follows from the table: the rig's own rule is taken, after ramps of 1 to 6 s",)
    efficiencies = judged(own_table(*METRICS[:6]))
    assert [row.target for row in efficiencies.rows] == [None] * 3
    assert efficiencies.rows[0].speeds.high == pytest.approx(3.0 * efficiencies.rows[0].speeds.low)


def test_what_cannot_be_judged_is_reported_with_the_reason() -> None:
    rows = [dict(row) for row in own_rows()]
    rows[0] = {"load_ohm": 45.0, "energy_line": rows[0]["energy_line"]}
    rows[1] = {"load_ohm": 18.0, "power_line": 5_000_000.0, "eta_gen": 0.8}
    rows.append({"load_ohm": math.inf, "eta_trans": 0.3, "eta_gen": 0.4, "power_line": 300.0, "power_mech": 90.0})
    found = judged(as_table(rows))
    reasons = {item.load: item.reason for item in found.not_judged}
    assert reasons == {
        45.0: "it prints no efficiency, nor two energies or powers to make one of",
        18.0: "no payout of this rig gives the printed power_line of 5e+06 W, whatever its speed",
    }
    assert [row.load for row in found.rows] == [4.5, math.inf]
    assert [cell.metric for cell in found.rows[1].cells] == ["eta_trans"]
    (note,) = found.notes
    assert note.startswith("no window follows for 45 ohm, 18 ohm, open circuit")


@pytest.mark.parametrize("power", [2.0, 1e6])
def test_a_window_that_no_payout_has_is_reported(power: float) -> None:
    rows = [dict(row) | {"power_line": power} for row in own_rows()]
    found = judged(as_table(rows, "power_mech", "power_gen"))
    assert found.rows == ()
    assert all("which is no payout's" in item.reason for item in found.not_judged)


def test_a_rig_without_a_rated_speed_cannot_tell_the_speed_of_a_row_without_powers() -> None:
    plain = msgspec.structs.replace(RIG, generator=msgspec.structs.replace(RIG.generator, speed_rated=None))
    found = judged(own_table(*METRICS[:6]), rig=plain)
    assert found.rows == ()
    assert found.ok
    assert {item.reason for item in found.not_judged} == {
        "it prints no power or energy, and the rig file no speed_rated, so the line's speed is unknown"
    }
    assert attainable_summary(found) == "no row could be judged"


def test_a_rig_without_a_model_is_rejected() -> None:
    with pytest.raises(RigError, match="rig kitepower: no model can be made"):
        judged(own_table(), rig=built_in("kitepower"))


def test_tolerances_of_the_rig_widen_what_can_be_reached() -> None:
    loose = parse_rig(
        'based_on = "hsu2026"\nname = "loose"\n[drivetrain]\n'
        'eta_mesh = { value = 0.95, unit = "1", u = 0.02, source = "assumed" }\n',
        "loose.toml",
    )
    sharp, wide = cells_of(judged(own_table()), "eta_gen"), cells_of(judged(own_table(), rig=loose), "eta_gen")
    for one, other in zip(sharp, wide, strict=True):
        assert other.u > 5.0 * one.u > 0.0
        assert other.low < one.low
        assert other.high > one.high


def test_more_cycles_tell_a_mean_better() -> None:
    assert standard_error(0.02, None) == standard_error(0.02, 1) == 0.01
    assert standard_error(0.02, 4) == 0.005


def test_a_row_without_a_window_takes_that_of_the_others() -> None:
    rows = [dict(row) for row in own_rows()]
    for metric in ("energy_line", "energy_mech", "energy_gen"):
        del rows[1][metric]
    windows, notes = row_windows(as_table(rows))
    assert windows[18.0] == pytest.approx(5.5, rel=1e-3)
    assert notes == (f"no window follows for 18 ohm: {windows[18.0]:.4g} s is taken, as in the other rows",)


@pytest.mark.parametrize("window", [5.48, None])
def test_the_short_reduction_is_the_whole_one(fixtures: Path, window: float | None) -> None:
    run = read_run(fixtures / "campaign" / "r36ohm.csv", load=36.0, campaign=False)
    whole, short = reduce(run, window=window).cycles[0].metrics, first_metrics(run, RIG, window)
    for metric in METRICS:
        assert short[metric] == pytest.approx(getattr(whole, metric), rel=1e-12)


def test_a_log_without_a_payout_has_no_metrics(fixtures: Path) -> None:
    run = read_run(fixtures / "campaign" / "r36ohm.csv", load=36.0)
    still = {name: np.zeros(run.t.size) for name in run.channels}
    found = first_metrics(msgspec.structs.replace(run, channels=still), RIG)
    assert [found[metric] for metric in METRICS] == [None] * len(METRICS)


def tables_of(found: AttainableRanges) -> dict[str, pd.DataFrame]:
    """Tables of the report of an audit with these ranges."""
    report = audit_report(replace(audit_by_load("hsu2026-table2"), physics=found))
    return {block.id: block.frame() for block in report.blocks if isinstance(block, Table)}


def test_the_report_lists_each_efficiency_and_each_effect_that_helps() -> None:
    tables, found = tables_of(paper()), paper().explanation
    assert len(tables["attainable"]) == 18
    assert set(tables["attainable"]["verdict"]) == {"outside"}
    effects = tables["effects"]
    explaining = effects[effects["alone"] == "explains"]
    for metric in ("eta_trans", "eta_gen"):
        able = {one.effect for one in found.suspects if one.ability(metric).verdict == "explains"}
        assert set(explaining[explaining["efficiency"] == metric]["effect"]) == able
    assert len(tables["sets"]) == len(found.sets)


def test_without_a_set_the_report_has_the_closest_one() -> None:
    found = paper()
    closest = replace(found.explanation.sets[0], out_of_reach=0.0421)
    none = replace(found, explanation=replace(found.explanation, sets=(), size=3, closest=closest))
    (row,) = tables_of(none)["sets"].to_dict("records")
    assert row["outside in all (points)"] == pytest.approx(4.21)


def test_the_record_is_json() -> None:
    record = json.loads(msgspec.json.encode(attainable_record(paper())))
    assert record["ok"] is False
    assert [row["load_ohm"] for row in record["rows"]] == [45.0, 36.0, 27.0, 18.0, 9.0, 4.5]
    cell = record["rows"][0]["efficiencies"]["eta_gen"]
    assert cell["printed"] - cell["reach"][0] == pytest.approx(cell["off"])
    effects = {entry["effect"]: entry for entry in record["effects"]}
    assert set(effects) == {"ke_rolloff", *SOME}
    assert effects["gear_mesh_loss"]["can"]["eta_gen"]["verdict"] == "explains"
    assert len(effects["gear_mesh_loss"]["can"]["eta_gen"]["needed"]) == 6
    assert effects["ke_rolloff"]["can"]["eta_gen"]["needed"] is None
    assert record["sets"][0]["enough"] is True


def written(table: Mapping[str, float], path: Path) -> str:
    rows = "\n".join(f"{key} = {value}" for key, value in table.items())
    path.write_text(f'title = "made"\nsource = "none"\n[columns]\n{COLUMNS}\n\n[[row]]\n{rows}\n', encoding="utf-8")
    return str(path)


def test_the_command_adds_the_physics_to_text_and_json(tmp_path: Path) -> None:
    table = written(own_rows()[0], tmp_path / "one.toml")
    plain, physics = call("audit", table), call("audit", table, "--physics")
    assert plain.code == physics.code == 0
    assert plain.out.endswith("Nothing contradicts itself.\n")
    assert physics.out.endswith("Nothing contradicts itself; all 3 efficiencies can be reached.\n")
    record = json.loads(call("audit", table, "--physics", "--json", "-").out)
    assert record["schema"] == "winchcascade/audit/1"
    assert record["physics"]["ok"] is True
    assert "physics" not in json.loads(call("audit", table, "--json", "-").out)


def test_one_column_and_one_row_are_enough_to_be_judged() -> None:
    row = own_rows()[0]
    only = {"load_ohm": 45.0, "power_gen": row["power_gen"], "eta_pto": round(row["eta_pto"] - 0.1, 3)}
    found = judged(as_table([only, {"load_ohm": math.inf, "eta_pto": 0.1}]))
    assert [item.reason for item in found.not_judged] == ["it prints no eta_trans, all that is an efficiency there"]
    ((cell,),) = (row.cells for row in found.rows)
    assert cell.outside
    assert cell.gap < -0.05
    movers = {mover.effect: mover for mover in found.explanation.suspects}
    assert movers["gear_mesh_loss"].ability("eta_pto").verdict == "explains"
    assert all(list(values.left_rms) == ["eta_pto"] for values in found.explanation.sets)


def test_a_table_out_of_reach_ends_with_exit_code_1(tmp_path: Path) -> None:
    off = dict(own_rows()[0])
    off = {key: off[key] for key in ("load_ohm", "energy_line", "power_line", "eta_gen")} | {"eta_gen": 0.6}
    done = call("audit", written(off, tmp_path / "off.toml"), "--physics")
    assert done.code == 1
    assert "1 of 1 rows below what the rig can reach" in done.out


def test_the_command_rejects_a_rig_that_it_cannot_use(tmp_path: Path) -> None:
    table = written(own_rows()[0], tmp_path / "one.toml")
    without, unmodelled = (
        call("audit", table, "--rig", "hsu2026"),
        call("audit", table, "--physics", "--rig", "kitepower"),
    )
    assert without.code == unmodelled.code == 2
    assert "--rig hsu2026: is of use with --physics alone" in without.err
    assert "rig kitepower: no model can be made" in unmodelled.err
