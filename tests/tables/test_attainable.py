"""What a rig can attain of a table: tables of the model itself, with an effect injected, with
holes, and the paper's.
"""

from __future__ import annotations

import json
import math
from functools import cache
from pathlib import Path

import msgspec
import numpy as np
import pytest
from calls import call
from made_tables import made_table, table_text
from msgspec.structs import replace

from winchcascade import audit
from winchcascade.core.errors import RigError
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import built_in, parse_rig
from winchcascade.core.run import Run
from winchcascade.ingest.read import read_run
from winchcascade.reduction.efficiency import METRICS
from winchcascade.reduction.reduce import first_metrics, reduce
from winchcascade.report.content import Table
from winchcascade.report.results.attainable_sections import attainable_figure, attainable_summary
from winchcascade.report.results.audit_record import audit_record
from winchcascade.report.results.audits import audit_report
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import EFFECTS, make_effect
from winchcascade.rig.parts import Model
from winchcascade.rig.simulate import simulate
from winchcascade.tables.attainable import AttainableRanges, attainable_ranges
from winchcascade.tables.feasible import repeatability
from winchcascade.tables.payouts import Cell
from winchcascade.tables.published_table import PublishedTable
from winchcascade.tables.table_file import load_table
from winchcascade.tables.table_problem import TableProblem

RIG = built_in()
SOME = ("copper_heating", "gear_mesh_loss", "screw_friction", "torque_gain", "clutch_drag")
OF_THE_PAPER = ("gear_mesh_loss", "screw_friction")
SIZE = 0.015
"""How far a recovered value may be off: the payout that made the table is not the middle one.
[1]
"""

Rows = list[dict[str, float]]


def judged(
    table: PublishedTable, *names: str, scatter: float = 0.01, rig: Rig = RIG
) -> AttainableRanges:
    return attainable_ranges(
        table, rig, {name: EFFECTS[name] for name in names or SOME}, scatter=scatter
    )


def made_rows(model: Model) -> Rows:
    """Rows of three loads: payouts by a curve of their own, a ramp of a sine's shape over 4 s, a
    ripple of 2 %, braking.
    """
    rows = []
    t = np.arange(0.0, 13.0, 0.04)
    up, down = np.clip((t - 1.0) / 4.0, 0.0, 1.0), np.clip((t - 10.0) / 1.0, 0.0, 1.0)
    shape = 0.5 * (1.0 - np.cos(math.pi * up)) * (1.0 - down) * (1.0 + 0.02 * np.sin(3.0 * t) * up)
    for load, speed in ((45.0, 0.9), (18.0, 0.8), (4.5, 0.3)):
        v = speed * shape
        x = np.concatenate(([0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * 0.04)))
        run = Run("made", t, {"displacement": x, "velocity": v}, 25.0, t.size, load=load)
        mean = reduce(simulate(run, model).run, window=5.5).mean
        rows.append({"load_ohm": load, **{metric: mean.value(metric) for metric in METRICS}})
    return rows


@cache
def own_rows() -> tuple[dict[str, float], ...]:
    return tuple(made_rows(baseline(RIG)))


def own_table(*left_out: str) -> PublishedTable:
    return made_table(
        [{name: x for name, x in row.items() if name not in left_out} for row in own_rows()]
    )


@cache
def paper(*more: str) -> AttainableRanges:
    table = load_table("hsu2026-table2")
    return judged(table, *OF_THE_PAPER, *more, scatter=repeatability(table).eta)


def cells_of(found: AttainableRanges, metric: str) -> list[Cell]:
    return [cell for row in found.rows for cell in row.cells if cell.metric == metric]


def test_a_table_of_the_model_itself_is_within_reach_and_names_nobody() -> None:
    found = judged(own_table())
    assert [cell.gap for row in found.rows for cell in row.cells] == [0.0] * 9
    assert (found.ok, found.suspects, found.sets) == (True, (), ())
    assert [row.window for row in found.rows] == pytest.approx([5.5] * 3, rel=1e-3)
    for row, speed in zip(found.rows, (0.9, 0.8, 0.3), strict=True):
        assert row.speeds.low < speed < row.speeds.high


@pytest.mark.slow
def test_a_figure_has_every_printed_efficiency_over_its_range() -> None:
    found = paper()
    figure = attainable_figure(found)
    assert figure is not None
    for ax, metric in zip(figure.axes, ("eta_trans", "eta_gen", "eta_pto"), strict=True):
        cells = cells_of(found, metric)
        spans = [(bar.get_y(), bar.get_y() + bar.get_height()) for bar in ax.patches]  # type: ignore[attr-defined]
        assert spans == [pytest.approx((cell.low, cell.high)) for cell in cells]
        full, hollow = (np.asarray(line.get_ydata()).tolist() for line in ax.lines)
        assert full == [cell.printed for cell in cells if cell.outside]
        assert hollow == [cell.printed for cell in cells if not cell.outside]


def test_an_injected_loss_is_out_of_reach_and_among_those_that_could_be_why() -> None:
    injected = make_effect("gear_mesh_loss", {"efficiency_change": -0.08}).apply(baseline(RIG))
    found = judged(made_table(made_rows(injected)))
    assert all(cell.outside and cell.gap < 0.0 for cell in cells_of(found, "eta_gen"))
    suspects = {one.effect: one for one in found.suspects}
    loss = suspects["gear_mesh_loss"]
    assert loss.ability("eta_gen").verdict == "explains"
    assert loss.best is not None
    assert loss.best.enough
    assert loss.best.plausible
    assert loss.best.fields["gear_mesh_loss"]["efficiency_change"] == pytest.approx(-0.08, abs=SIZE)
    assert [list(values.fields) for values in found.sets] == [["gear_mesh_loss"]]
    assert suspects["clutch_drag"].best is None
    assert suspects["screw_friction"].ability("eta_gen").closed < 0.01


@pytest.mark.slow
def test_two_injected_effects_need_a_pair() -> None:
    model = make_effect("gear_mesh_loss", {"efficiency_change": -0.08}).apply(baseline(RIG))
    model = make_effect("screw_friction", {"mu_change": -0.03}).apply(model)
    found = judged(made_table(made_rows(model)))
    (best,) = [
        values
        for values in found.sets
        if set(values.fields) == {"gear_mesh_loss", "screw_friction"}
    ]
    assert best.fields["gear_mesh_loss"]["efficiency_change"] == pytest.approx(-0.08, abs=SIZE)
    assert best.fields["screw_friction"]["mu_change"] == pytest.approx(-0.03, abs=SIZE)
    assert {len(values.fields) for values in found.sets} == {2}


@pytest.mark.slow
def test_roll_off_explains_neither_efficiency_of_the_paper() -> None:
    (rolloff,) = [one for one in paper("ke_rolloff").suspects if one.effect == "ke_rolloff"]
    assert rolloff.ability("eta_trans").verdict == rolloff.ability("eta_gen").verdict == "no"
    assert rolloff.ability("eta_trans").closed < 0.05
    assert rolloff.ability("eta_gen").closed < 0.5


@pytest.mark.slow
def test_the_efficiencies_of_the_paper_are_beyond_its_constants() -> None:
    assert all(-10.0 < 100.0 * cell.gap < -6.5 for cell in cells_of(paper(), "eta_gen"))
    assert all(1.9 < 100.0 * cell.gap < 4.0 for cell in cells_of(paper(), "eta_trans"))
    suspects = {one.effect: one for one in paper().suspects}
    assert suspects["gear_mesh_loss"].ability("eta_gen").verdict == "explains"
    assert suspects["screw_friction"].ability("eta_trans").verdict == "explains"


@pytest.mark.slow
def test_what_is_named_brings_the_paper_within_reach_when_it_is_simulated() -> None:
    problem = TableProblem(paper().rows, RIG, EFFECTS)
    assert paper().sets
    for values in paper().sets:
        effects = [make_effect(name, fields) for name, fields in values.fields.items()]
        eta = problem.efficiencies(effects)
        assert problem.by_metric(eta).sum() == 0.0
        assert np.sum(problem.residuals([effects], np.zeros(0)) ** 2) == pytest.approx(
            values.misfit, rel=1e-6
        )
        assert eta[:, 2] == pytest.approx(eta[:, 0] * eta[:, 1], rel=1e-6)
    for name, k in (("screw_friction", 0), ("gear_mesh_loss", 1)):
        (needed,) = [one.abilities[k].needed for one in paper().suspects if one.effect == name]
        for row in (0, 5):
            excess = problem.excess(
                problem.efficiencies(problem.active([name], np.array([needed[row]])))
            )
            assert excess[row, k] < 1e-3  # between its nodes a curve is near a simulation


@pytest.mark.parametrize(
    ("left_out", "derived"),
    [
        (("eta_trans", "eta_gen", "eta_pto", "power_mech"), True),
        (("power_line", "power_mech", "power_gen"), False),
    ],
)
def test_energies_give_efficiencies_and_speeds_where_others_are_not_printed(
    left_out: tuple[str, ...], derived: bool
) -> None:
    found = judged(own_table(*left_out))
    assert (found.ok, {cell.derived for row in found.rows for cell in row.cells}) == (
        True,
        {derived},
    )
    assert bool(found.notes) is not derived


def test_what_cannot_be_judged_is_reported_with_the_reason() -> None:
    rows: Rows = [{"load_ohm": 45.0, "energy_line": own_rows()[0]["energy_line"]},
            {"load_ohm": 18.0, "power_line": 5e6, "eta_gen": 0.8}, {"load_ohm": 9.0, "eta_gen": 0.8},
            {"load_ohm": 5.0, "power_line": 2.0, "energy_line": 5000.0, "eta_gen": 0.8}, own_rows()[2],
            {"load_ohm": math.inf, "eta_trans": 0.3, "eta_gen": 0.4, "power_line": 300.0, "power_mech": 90.0}]  # fmt: skip
    found = judged(made_table(rows))
    reasons = {item.load: item.reason for item in found.not_judged}
    words = {
        45.0: "no efficiency",
        18.0: "power_line of 5e+06",
        9.0: "speed of the line is unknown",
        5.0: "window of 2.5e+03 s",
    }
    assert set(reasons) == set(words)
    assert all(text in reasons[load] for load, text in words.items())
    assert [[cell.metric for cell in row.cells] for row in found.rows] == [
        [*METRICS[6:]],
        ["eta_trans"],
    ]
    assert found.notes[0].startswith("no window follows for 45 ohm, 18 ohm, 9 ohm, open circuit")
    assert attainable_summary(judged(made_table(rows[2:3]))) == "no row could be judged"


@pytest.mark.slow
def test_tolerances_of_the_rig_and_few_cycles_widen_what_can_be_reached() -> None:
    loose = parse_rig(
        'based_on = "hsu2026"\nname = "loose"\n[drivetrain]\n'
        'eta_mesh = { value = 0.95, unit = "1", u = 0.02, source = "assumed" }\n',
        "loose.toml",
    )
    sharp, wide = (
        cells_of(judged(own_table()), "eta_gen"),
        cells_of(judged(own_table(), rig=loose), "eta_gen"),
    )
    for one, other in zip(sharp, wide, strict=True):
        assert other.u > 3.0 * one.u > 0.0
        assert other.low < one.low < one.high < other.high
    single, four = (
        cells_of(judged(replace(own_table(), cycles=n)), "eta_gen")[0] for n in (None, 4)
    )
    assert single.allowed - four.allowed == pytest.approx(0.5 * 0.01 * single.printed)
    with pytest.raises(RigError, match="rig kitepower: no model can be made"):
        judged(own_table(), rig=built_in("kitepower"))


@pytest.mark.parametrize("window", [5.48, None])
def test_the_short_reduction_is_the_whole_one(fixtures: Path, window: float | None) -> None:
    run = read_run(fixtures / "campaign" / "r36ohm.csv", load=36.0, campaign=False)
    whole, short = reduce(run, window=window).cycles[0].metrics, first_metrics(run, RIG, window)
    for metric in METRICS:
        assert short[metric] == pytest.approx(getattr(whole, metric), rel=1e-12)
    still = {name: np.zeros(run.t.size) for name in run.channels}
    assert {
        first_metrics(msgspec.structs.replace(run, channels=still), RIG)[metric]
        for metric in METRICS
    } == {None}


@pytest.mark.slow
def test_report_and_record_list_each_efficiency_and_each_effect() -> None:
    found = replace(audit("hsu2026-table2"), physics=paper())
    tables = {
        block.id: block.frame() for block in audit_report(found).blocks if isinstance(block, Table)
    }
    assert (len(tables["attainable"]), set(tables["attainable"]["verdict"])) == (18, {"outside"})
    assert len(tables["sets"]) == len(paper().sets)
    record = json.loads(msgspec.json.encode(audit_record(found)))["physics"]
    assert [row["load_ohm"] for row in record["rows"]] == [45.0, 36.0, 27.0, 18.0, 9.0, 4.5]
    cell = record["rows"][0]["efficiencies"]["eta_gen"]
    assert cell["printed"] - cell["reach"][0] == pytest.approx(cell["off"])
    effects = {entry["effect"]: entry for entry in record["effects"]}
    assert set(effects) == {*OF_THE_PAPER}
    assert effects["gear_mesh_loss"]["can"]["eta_gen"]["verdict"] == "explains"
    assert len(effects["gear_mesh_loss"]["can"]["eta_gen"]["needed"]) == 6
    assert (record["ok"], record["sets"][0]["enough"], record["closest"]) == (False, True, None)


@pytest.mark.slow
def test_the_command_adds_the_physics(tmp_path: Path) -> None:
    path = tmp_path / "off.toml"
    path.write_text(
        table_text(
            [
                {
                    **{n: own_rows()[0][n] for n in ("load_ohm", "energy_line", "power_line")},
                    "eta_gen": 0.6,
                }
            ]
        )
    )
    written = tmp_path / "audit.json"
    called, record = (
        call("audit", path, "--physics", "--json", written),
        json.loads(written.read_text()),
    )
    assert (called.code, record["schema"], record["physics"]["ok"]) == (
        1,
        "winchcascade/audit/1",
        False,
    )
    assert "1 of 1 rows below what the rig can attain" in called.out
    assert "physics" not in json.loads(call("audit", path, "--json", "-").out)


def test_the_command_rejects_a_rig_without_a_model_or_without_use(tmp_path: Path) -> None:
    path = tmp_path / "one.toml"
    path.write_text(table_text([{"load_ohm": 45.0, "energy_line": 7115.0}]))
    unmodelled, unused = (
        call("audit", path, "--physics", "--rig", "kitepower"),
        call("audit", path, "--rig", "hsu2026"),
    )
    assert (unmodelled.code, "rig kitepower: no model can be made" in unmodelled.err) == (2, True)
    assert (unused.code, "--rig hsu2026: is of use with --physics alone" in unused.err) == (2, True)


@pytest.mark.slow
def test_values_with_which_the_model_gives_no_printed_power_explain_nothing() -> None:
    rows = [replace(row, target=("power_gen", 1e7)) for row in paper().rows]
    problem = TableProblem(rows, RIG, EFFECTS)
    eta = problem.efficiencies([])
    assert problem.by_metric(eta).min() > 6.0
