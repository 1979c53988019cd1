"""The gap between logs and a simulation of the owner: causes of the logs, and what the
simulation has in another form.
"""

from functools import cache
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from planted import campaign, driven
from rigs import calibrated_rig

from winchcascade.batch.campaign_diagnosis import write_predictions
from winchcascade.core.errors import LogError
from winchcascade.core.run import Run, Signal
from winchcascade.diagnosis.diagnose import ModelDiagnosis, diagnose
from winchcascade.diagnosis.explain.gap_map import STANDS_OUT
from winchcascade.diagnosis.own_simulation import beside_own_simulation
from winchcascade.diagnosis.simulation_at_stamps import (
    VELOCITY_DIFFERENCE_MAX,
    on_the_logs,
    onto_log,
)
from winchcascade.ingest.read import read_run
from winchcascade.report.content import Table
from winchcascade.report.render.terminal import terminal_text
from winchcascade.report.results.diagnosis import diagnosis_report
from winchcascade.report.results.diagnosis_record import as_json
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import EFFECTS, SIMPLIFICATIONS, make_effect
from winchcascade.rig.effects.effect import ActiveEffect
from winchcascade.rig.parts import Model
from winchcascade.rig.simulate import simulate

SUSPECTS = {name: EFFECTS[name] for name in ("copper_heating", "sync_inductance", "line_drag")}
LINE_DRAG = {"line_drag": {"b": 0.9}}


def own(model: Model) -> list[Run]:
    return [simulate(run, model).run for run in driven()]


def tables(found: ModelDiagnosis) -> dict[str, Table[Any]]:
    return {block.id: block for block in diagnosis_report(found).blocks if isinstance(block, Table)}


@cache
def diagnosed_alone() -> ModelDiagnosis:
    """The diagnosis by the model of the rig, without an own simulation."""
    return diagnose(campaign(LINE_DRAG), calibrated_rig(), SUSPECTS)


@cache
def diagnosed(simulator: str) -> tuple[ModelDiagnosis, ModelDiagnosis]:
    """A diagnosis by the rig's model, and the same with an own simulation as its baseline."""
    model, rig = baseline(calibrated_rig()), calibrated_rig()
    if simulator == "averaged":
        model = ActiveEffect(SIMPLIFICATIONS["averaged_bridge"], (1.0,)).apply(model)
    elif simulator != "same":
        model = make_effect(simulator, {"r_s_change": 0.3}).apply(model)
    alone, cycles = diagnosed_alone(), [None] * len(driven())
    simulations = on_the_logs(own(model), alone.runs, rig, cycles)
    return alone, beside_own_simulation(alone, simulations)


@pytest.mark.slow
@pytest.mark.parametrize("simulator", ["same", "averaged", "copper_heating"])
def test_the_cause_of_the_logs_is_named_whatever_the_simulation_has(simulator: str) -> None:
    alone, found = diagnosed(simulator)
    assert [cause.effect for cause in found.causes] == ["line_drag"]
    assert (found.verdict, found.causes) == (alone.verdict, alone.causes)


def test_a_simulation_of_the_same_physics_has_no_other_form() -> None:
    _, found = diagnosed("same")
    assert (as_json(found)["baseline"], as_json(found)["model_form"]) == ("own_simulation", [])
    assert "model-form" not in tables(found)
    form = [
        one.parts[-2].value for one in found.contributions if one.metric == "eta_pto" and one.parts
    ]
    assert np.abs(form).max() < 1e-3


def test_an_averaged_bridge_is_reported_in_the_generator_stage() -> None:
    alone, found = diagnosed("averaged")
    (form,) = as_json(found)["model_form"]
    assert (form["stage"], form["likely"], form["phase"]) == (
        "generator",
        "averaged_bridge",
        "payout",
    )
    assert form["bias"] < 0.0
    assert abs(form["z"]) > STANDS_OUT
    (row,) = tables(found)["model-form"].cells
    assert row[:2] == ["averaged_bridge", "generator"]
    assert "our simulation" in terminal_text(diagnosis_report(found))
    assert "our simulation" not in terminal_text(diagnosis_report(alone))


def test_an_effect_that_the_simulation_contains_already_is_reported_with_its_number() -> None:
    _, found = diagnosed("copper_heating")
    assert found.own_simulation is not None
    assert [form.likely for form in found.own_simulation.forms] == ["copper_heating"]
    value = found.own_simulation.numbers["copper_heating"]["r_s_change"]
    assert value.low < 0.3 < value.high


@pytest.mark.parametrize(("b", "gap"), [(LINE_DRAG["line_drag"]["b"], False), (0.5, True)])
def test_a_simulation_leaves_a_gap_unless_it_has_the_cause_of_the_logs_with_the_same_number(
    b: float, gap: bool
) -> None:
    alone = diagnosed_alone()
    runs = own(make_effect("line_drag", {"b": b}).apply(baseline(calibrated_rig())))
    found = beside_own_simulation(
        alone, on_the_logs(runs, alone.runs, calibrated_rig(), [None] * len(driven()))
    )
    assert found.own_simulation is not None
    if gap:
        assert (found.verdict, [cause.effect for cause in found.causes]) == (
            alone.verdict,
            ["line_drag"],
        )
        return
    assert (found.verdict, found.causes, found.where, found.closure) == ("no_gap", (), None, None)
    assert found.own_simulation.shared == ("line_drag",)
    assert "line_drag" in next(
        note.text for note in diagnosis_report(found).notes if note.about == "Verdict"
    )
    for one in found.contributions:
        if one.parts:
            assert sum(part.value for part in one.parts) == pytest.approx(
                one.measured - one.as_given, abs=1e-9
            )
            assert "line_drag" not in {part.effect for part in one.parts}


def test_map_and_closure_are_those_of_log_minus_simulation() -> None:
    alone, found = diagnosed("averaged")
    assert found.own_simulation is not None
    assert found.closure is not None
    assert alone.closure is not None
    simulations = found.own_simulation.runs
    vdc = np.concatenate(
        [
            log.course.blocks.mean(run.channels["vdc"])
            for log, run in zip(found.data.logs, simulations, strict=True)
        ]
    )
    assert np.allclose(found.predicted[:, 3], vdc)
    assert found.closure.channels["vdc"].before > 2.0 * alone.closure.channels["vdc"].before
    assert found.closure.channels["vdc"].after == pytest.approx(alone.closure.channels["vdc"].after)


def test_contributions_lead_from_the_own_simulation_to_the_logs() -> None:
    alone, found = diagnosed("averaged")
    for before, one in zip(alone.contributions, found.contributions, strict=True):
        assert [part.kind for part in one.parts] in (
            [],
            ["physical", "tolerances", "model_form", "residual"],
        )
        if one.parts:
            form = one.parts[-2]
            size = max(abs(one.measured), abs(one.as_given))
            assert sum(part.value for part in one.parts) == pytest.approx(
                one.measured - one.as_given, abs=1e-9 * size
            )
            assert form.value == pytest.approx(before.as_given - one.as_given)
            assert one.parts[0] == before.parts[0]


def test_predictions_before_are_those_of_the_own_simulation(tmp_path: Path) -> None:
    _, found = diagnosed("averaged")
    assert found.closure is not None
    assert found.own_simulation is not None
    write_predictions(found, tmp_path)
    write_predictions(found, tmp_path)  # its own files are replaced
    for k in found.closure.predictions:
        run, own_run = found.runs[k], found.own_simulation.runs[k]
        before = read_run(
            tmp_path / "before" / f"{run.name.rpartition('.')[0] or run.name}.csv", load=run.load
        )
        np.testing.assert_allclose(
            before.channels["vdc"], own_run.channels["vdc"], rtol=1e-6, atol=1e-6
        )


# ---------------------------------------------------------------------- at the stamps of the logs
WHOLE = slice(None)

INTERPOLATED = 0.003
"""Share of the maximum of a channel by which straight lines between samples at 25 Hz may
deviate.
"""


@pytest.fixture(scope="module")
def simulation() -> Run:
    """A simulation of the second log of the campaign."""
    return simulate(driven()[1], baseline(calibrated_rig())).run


def moved(run: Run, t: Signal, *, late: float = 0.0) -> Run:
    """A run at other stamps, on a clock that is ahead by so much."""
    channels = {name: np.interp(t, run.t, x) for name, x in run.channels.items()}
    return msgspec.structs.replace(
        run, t=t + late, channels=channels, samples=t.size, fs=1.0 / float(t[1] - t[0])
    )


def faster(run: Run, by: float) -> Run:
    return msgspec.structs.replace(
        run, channels={**run.channels, "velocity": (1.0 + by) * run.channels["velocity"]}
    )


@pytest.mark.parametrize(
    ("rate", "late"), [(None, 0.0), (10.0, 0.0), (25.0, 7.31), (200.0, -3.7), (60.0, 1e5)]
)
def test_any_rate_and_clock_are_brought_to_the_log(
    simulation: Run, rate: float | None, late: float
) -> None:
    log = driven()[1]
    t = simulation.t if rate is None else np.arange(simulation.t[0], simulation.t[-1], 1.0 / rate)
    found = onto_log(moved(simulation, t, late=late), log, WHOLE)
    assert found.simulated
    assert np.array_equal(found.t, log.t)
    inside, allowed = log.t < t[-1], 0.0 if rate is None else INTERPOLATED
    for name in ("pressure", "torque", "vdc"):
        x = simulation.channels[name]
        assert np.sqrt(np.mean((found.channels[name] - x)[inside] ** 2)) <= allowed * np.max(
            np.abs(x)
        )


def test_another_motion_is_rejected_with_its_difference(simulation: Run) -> None:
    with pytest.raises(
        LogError, match=r"differ by 3 % rms after a shift of 0 s; expected 1 % at most"
    ):
        onto_log(faster(simulation, 0.03), driven()[1], WHOLE)
    assert onto_log(faster(simulation, 0.8 * VELOCITY_DIFFERENCE_MAX), driven()[1], WHOLE).samples


def test_a_simulation_that_ends_before_the_log_is_rejected_unless_those_cycles_do_not_count(
    simulation: Run,
) -> None:
    log, short = driven()[1], simulation.t[simulation.t < 12.0]
    with pytest.raises(LogError, match="another line motion"):
        onto_log(moved(simulation, short), log, WHOLE)
    assert onto_log(moved(simulation, short), log, slice(0, short.size - 10)).samples == log.samples


def test_a_channel_that_only_the_log_has_is_named(simulation: Run) -> None:
    fewer = {name: x for name, x in simulation.channels.items() if name != "torque"}
    with pytest.raises(LogError, match=r"no column for torque, which the log r36ohm.csv has"):
        onto_log(msgspec.structs.replace(simulation, channels=fewer), driven()[1], WHOLE)
