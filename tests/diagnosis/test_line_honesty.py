"""What a diagnosis without a model states is not more certain than its data: energies, shown fits, numbers that differ."""

from functools import cache
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from daily import daily
from winchlog import CYCLE, RIG, planted, random_winch

from winchcascade.core.run import Run
from winchcascade.diagnosis.diagnosis_result import Entries
from winchcascade.diagnosis.line.line_diagnose import diagnose_line
from winchcascade.ingest.read import read_run
from winchcascade.report.results.diagnosis_record import as_json
from winchcascade.rig.effects.catalogue import EFFECTS

Record = dict[str, Any]

CERTAIN = 0.95
"""Posterior from which a cause without a look-alike counts as certain."""

MEANINGFUL = {"drum_inertia": 0.1}
"""Size above which a cause must be named: of its power, for the inertia; else `SHARE` of an energy."""

SHARE = 0.05


def record_of(run: Run, **options: Any) -> Record:
    entries = Entries([run] * len(options.get("cycles", [None])), **options)
    return as_json(diagnose_line(entries, RIG, EFFECTS))


def named(record: Record) -> dict[str, Record]:
    return {cause["effect"]: cause for cause in record["causes"]}


def number(cause: Record) -> Record:
    (found,) = cause["parameters"].values()
    assert isinstance(found, dict)
    return found


def changed(run: Run, **channels: Any) -> Run:
    return msgspec.structs.replace(run, channels={**run.channels, **channels})


def payouts(record: Record) -> list[Record]:
    return [row for row in record["energies"] if row["phase"] == "payout"]


# ------------------------------------------------------------------------------------------------------- logs with answers
@pytest.mark.parametrize(
    ("folder", "truth"),
    [
        ("winch_friction_and_drag", {"drum_inertia": 4445.6, "line_friction": 678.6, "line_drag": 150.2}),
        ("winch_drag_only", {"drum_inertia": 4203.0, "line_drag": 314.31}),
    ],
)
def test_friction_and_drag_are_separated_and_every_payout_is_predicted(
    shared: Path, folder: str, truth: dict[str, float]
) -> None:
    record = record_of(read_run(shared / "trust" / folder / "log.csv", rig=RIG))
    found = named(record)
    assert found.keys() == truth.keys()
    for effect, value in truth.items():
        assert number(found[effect])["value"] == pytest.approx(value, rel=0.05)
        assert number(found[effect])["low"] < value < number(found[effect])["high"]
    assert len(payouts(record)) >= 11
    assert all(abs(row["after_j"] / row["measured_j"] - 1.0) < 0.03 for row in payouts(record))
    assert all(abs(row["before_j"] / row["measured_j"] - 1.0) > 0.1 for row in payouts(record))


def test_the_measured_payouts_are_predicted_or_reported_as_not_explained(shared: Path) -> None:
    run = read_run(shared / "kitepower-2019-10-08" / "ground_station_cycles_01_43.csv", rig=RIG)
    record = record_of(run, cycles=[(1, 20), (21, 43)], withheld=[1])
    rows = payouts(record)
    assert [row["cycle"] for row in rows] == list(range(21, 44))
    total = sum(row["after_j"] for row in rows) / sum(row["measured_j"] for row in rows)
    assert abs(total - 1.0) < 0.05
    assert record["verdict"] != "explained"
    assert any(a["kind"] == "energy" and "payout" in a["where"] for a in record["remainder"]["alarms"])
    assert record["closure"]["kind"] == "held_out"
    assert any(trend["along"] == "order" for cause in record["causes"] for trend in cause["trends"])


@pytest.mark.parametrize("first", daily((0, 10, 20, 30), (0,)))
def test_random_winches_get_their_causes_and_no_others_with_certainty(first: int) -> None:
    false = wanted = hit = 0
    for seed in range(first, first + 10):
        winch = random_winch(seed)
        record = record_of(winch.run)
        found = named(record)
        certain = {name for name, c in found.items() if c["probability"] >= CERTAIN and not c["look_alikes"]}
        false += bool(certain - winch.numbers.keys())
        large = [name for name, size in winch.size.items() if size >= MEANINGFUL.get(name, SHARE)]
        wanted += len(large)
        hit += sum(name in found for name in large)
    assert false == 0
    assert hit >= 0.8 * wanted


# ------------------------------------------------------------------------------------------------------------- energies
@cache
def with_other(other: float) -> Record:
    return record_of(planted(0, mass=3000.0, drag=300.0, other=other))


def test_energies_of_every_cycle_and_phase_are_those_of_the_log() -> None:
    record, run = with_other(0.0), planted(0, mass=3000.0, drag=300.0)
    assert {row["stage"] for row in record["energies"]} == {"mech"}
    assert {row["run"] for row in record["energies"]} == {"planted.csv"}
    for of, power in (
        ("measured_j", run.channels["power_mech"]),
        ("before_j", run.channels["force"] * run.channels["velocity"]),
    ):
        assert sum(row[of] for row in record["energies"]) == pytest.approx(float(power.sum()) / run.fs, rel=1e-2)
    assert all(abs(row["after_j"] - row["measured_j"]) < 6.0 * row["u_j"] for row in record["energies"])
    assert record["verdict"] == "explained"


def test_energies_that_no_suspect_explains_forbid_the_verdict_explained() -> None:
    record = with_other(1500.0)
    assert record["verdict"] != "explained"
    phases = {row["phase"] for row in record["energies"]}
    assert phases >= {"payout", "haul_in"}
    assert any(alarm["kind"] == "energy" for alarm in record["remainder"]["alarms"])


def test_hours_of_rest_change_neither_the_causes_nor_their_numbers() -> None:
    run = planted(3, mass=3000.0, friction=300.0, drag=150.0)
    rest = np.zeros(72000)
    rng = np.random.default_rng(0)
    still = {
        "velocity": rng.normal(0.0, 0.002, rest.size),
        "force": rest + 500.0,
        "power_mech": rng.normal(0.0, 20.0, rest.size),
    }
    channels = {name: np.concatenate([run.channels[name], still[name]]) for name in still}
    t = np.arange(channels["force"].size) / run.fs
    short = named(record_of(run))
    long = named(record_of(msgspec.structs.replace(run, t=t, channels=channels, samples=t.size)))
    assert short.keys() == long.keys() == {"drum_inertia", "line_friction", "line_drag"}
    for name, cause in short.items():
        assert number(long[name])["value"] == pytest.approx(number(cause)["value"], rel=0.03)


# ------------------------------------------------------------------------------------------------- what is fitted is shown
def test_a_force_gain_that_nine_of_eleven_cycles_want_is_shown_with_its_number_and_differs() -> None:
    run = planted(1, cycles=11, mass=5000.0, drag=300.0)
    wrong = np.where(run.t < 9.0 * CYCLE, 1.15, 1.0)
    record = record_of(changed(run, force=run.channels["force"] * wrong))
    (gain,) = (one for one in record["fitted"] if one["effect"] == "force_gain")
    assert 0.08 < number(gain)["value"] < 0.16
    assert record["verdict"] != "explained"
    if gain["named"]:
        assert named(record)["force_gain"]["trends"]


def test_every_effect_of_the_final_fit_is_listed_also_where_no_cause_is_named() -> None:
    rng = np.random.default_rng(0)
    run = planted(0, mass=1000.0)
    lost = rng.uniform(0.2, 1.5, 11)[(run.t / CYCLE).astype(int)] * 2500.0
    record = record_of(changed(run, power_mech=run.channels["power_mech"] - lost * np.sin(run.t) - lost))
    assert record["verdict"] == "unexplained"
    assert record["causes"] == []
    assert record["fitted"]
    assert not any(one["named"] for one in record["fitted"])


# -------------------------------------------------------------------------------------- numbers that differ between cycles
def test_a_drag_that_grows_over_the_cycles_has_a_trend_of_its_size() -> None:
    run = planted(0, cycles=12, mass=3000.0, drag=200.0)
    v = run.channels["velocity"]
    record = record_of(changed(run, power_mech=run.channels["power_mech"] - 150.0 * run.t / run.t[-1] * v**2))
    drag = named(record)["line_drag"]
    assert [one["run"] for one in drag["stability"]] == [f"cycle {k} of planted.csv" for k in range(1, 13)]
    (trend,) = drag["trends"]
    assert trend["along"] == "order"
    assert trend["change"] == pytest.approx(150.0 * 11.0 / 12.0, rel=0.2)


@pytest.mark.parametrize("seed", range(3))
def test_a_number_that_is_the_same_in_every_cycle_has_no_trend(seed: int) -> None:
    record = record_of(planted(seed, cycles=12, mass=3000.0, drag=300.0))
    for cause in record["causes"]:
        assert cause["trends"] == []
        joint = number(cause)["value"]
        inside = [one["low"] < joint < one["high"] for one in cause["stability"] if one["value"] is not None]
        assert np.mean(inside) > 0.7


# ------------------------------------------------------------------------------------------------------------ probability
def test_a_loss_over_tension_and_a_gain_look_alike_where_haul_in_has_little_tension() -> None:
    run = planted(0, mass=2000.0)
    force = np.where(run.channels["velocity"] < 0.0, 20.0, run.channels["force"])
    power = run.channels["power_mech"] - run.channels["velocity"] * (run.channels["force"] - force)
    record = record_of(changed(run, force=force * 1.06, power_mech=power))
    found = named(record)
    pair = {"force_gain", "load_proportional_loss"}
    (one,) = pair & found.keys()
    (other,) = pair - {one}
    cause = found[one]
    assert other in [alike["effect"] for alike in cause["look_alikes"]]
    assert cause["rivals"] == cause["look_alikes"][:2]
    assert cause["probability"] <= 0.95


def test_probabilities_are_those_of_the_sets_and_ablation_is_the_share_closed_without_the_cause() -> None:
    record = with_other(0.0)
    sets = {tuple(one["effects"]): one for one in record["sets"]}
    assert sum(one["probability"] for one in sets.values()) == pytest.approx(1.0, abs=1e-4)
    chosen = tuple(one["effect"] for one in record["fitted"] if one["in_final_fit"])
    assert record["closure"]["kind"] == "leave_one_out"
    for cause in record["causes"]:
        together = sum(one["probability"] for names, one in sets.items() if cause["effect"] in names)
        assert cause["probability"] == pytest.approx(together, abs=1e-4)
        without = tuple(name for name in chosen if name != cause["effect"])
        assert cause["ablation"] == pytest.approx(1.0 - sets[without]["error"], abs=1e-4)
        assert cause["ablation"] < record["closure"]["share_closed"]
