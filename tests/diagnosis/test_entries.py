"""Wrong entries: suspects of every diagnosis, chosen only where they explain clearly more, and
their alternatives.
"""

import math
from functools import cache

import msgspec
import numpy as np
import pytest
from planted import campaign
from rigs import calibrated_rig, suspects_on

from winchcascade.diagnosis.diagnose import ModelDiagnosis, diagnose
from winchcascade.diagnosis.fit.entries import price_of, same_in_logs
from winchcascade.diagnosis.fit.evidence import usual_gain
from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.diagnosis.fit.suspects import freedom, with_values
from winchcascade.diagnosis.handover.rig_text import corrections
from winchcascade.diagnosis.verdict_limits import RARER
from winchcascade.report.render.terminal import terminal_text
from winchcascade.report.results.diagnosis import diagnosis_report
from winchcascade.report.results.diagnosis_record import as_json
from winchcascade.report.results.diagnosis_sentences import place_sentence
from winchcascade.rig.effects.catalogue import EFFECTS, ENTRIES

RIG = calibrated_rig()
LOAD = "load_entry(r9ohm.csv)"


@cache
def found(name: str, value: float) -> ModelDiagnosis:
    return diagnose(campaign({name: {EFFECTS[name].fields[0].name: value}}), RIG, EFFECTS)


@cache
def misstated() -> ModelDiagnosis:
    """The load of one run is stated a third too small."""
    runs = campaign({})
    stated = [msgspec.structs.replace(run, load=6.0) if run.load == 9.0 else run for run in runs]
    return diagnose(stated, RIG, EFFECTS)


@pytest.mark.parametrize(
    ("name", "value", "truth"),
    [
        (
            "drum_radius",
            0.06,
            0.1378,
        ),
        pytest.param(
            "gear_ratio",
            -0.08,
            46.0,
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "k_e_convention",
            math.sqrt(3.0) - 1.0,
            math.sqrt(3.0),
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_wrong_entry_is_named_alone_with_its_number(
    name: str, value: float, truth: float
) -> None:
    result = found(name, value)
    (cause,) = result.causes
    assert (cause.effect, cause.stage, result.verdict) == (name, "entry", "explained")
    number, *product = cause.parameters.values()
    assert number.value == pytest.approx(truth, rel=0.01)
    assert list(cause.parameters)[1:] == ([] if name == "drum_radius" else ["k_e_x_gear_ratio"])
    k_e, gear = (truth * 0.062, 50.0) if name == "k_e_convention" else (0.062, truth)
    assert all(known.value == pytest.approx(k_e * gear, rel=0.01) for known in product)
    assert "check the entry" in " ".join(terminal_text(diagnosis_report(result)).split())


def test_an_entry_is_not_claimed_to_be_wrong_where_something_else_acts_too() -> None:
    result = msgspec.structs.replace(found("drum_radius", 0.06), verdict="partly_explained")
    text = " ".join(terminal_text(diagnosis_report(result)).split())
    assert "is most like that of a wrong entry" in place_sentence(result)
    assert "comes from a wrong entry" not in text


@pytest.mark.slow
def test_the_wrong_load_of_one_run_is_named_with_its_run() -> None:
    record = as_json(misstated())["causes"][0]
    assert (record["effect"], record["run"], record["load_ohm"]) == ("load_entry", "r9ohm.csv", 6.0)
    assert record["label"] == "Load of 6 ohm"
    assert record["parameters"]["load_ohm"]["value"] == pytest.approx(9.0, rel=0.01)
    parts = [part for account in as_json(misstated())["contributions"] for part in account["parts"]]
    assert {part["effect"] for part in parts if part["kind"] == "entry"} == {"load_entry"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "value", "other"),
    [
        ("sync_inductance", 0.2, "pole_pairs"),
        ("piston_area", -0.07, "screw_lead"),
        ("force_gain", 0.04, "drum_radius"),
    ],
)
def test_an_effect_of_the_rig_is_named_and_the_entry_that_looks_the_same_is_its_alternative(
    name: str, value: float, other: str
) -> None:
    (cause,) = as_json(found(name, value))["causes"]
    assert cause["effect"] == name
    assert other in [rival["effect"] for rival in cause["rivals"]]


@pytest.mark.slow
def test_a_usual_multiple_of_the_pole_pairs_is_named_before_the_inductance() -> None:
    (cause,) = as_json(found("pole_pairs", 1.0))["causes"]
    assert cause["effect"] in ("pole_pairs", "l_s_convention")
    assert {cause["effect"], *(rival["effect"] for rival in cause["rivals"])} >= {
        "pole_pairs",
        "l_s_convention",
    }


def test_an_entry_is_rarer_than_an_effect_of_the_rig() -> None:
    assert price_of("gear_ratio") == pytest.approx(price_of("ke_shift") + RARER)
    assert price_of(LOAD) == price_of("gear_ratio")


def test_a_usual_multiple_has_a_higher_prior_and_a_convention_no_other() -> None:
    def gain(name: str, value: float) -> float:
        return usual_gain(
            EFFECTS, (name,), np.array([value]), freedom(EFFECTS[name]).sd, np.array([[1e6]])
        )

    assert gain("pole_pairs", 0.5) > 0.0 > gain("pole_pairs", 0.3) > -1.0
    assert gain("k_e_convention", math.sqrt(2.0) - 1.0) > 0.0
    assert gain("k_e_convention", 0.1) < -10.0
    assert gain("ke_shift", 0.1) == 0.0


def test_entries_are_suspects_without_tolerances_and_loads_where_vdc_and_idc_contradict_them() -> (
    None
):
    runs = campaign({})
    suspects = suspects_on(RIG, runs)
    of_other_parts = {"spring_force", "spring_stiffness", "counterweight"}
    assert set(ENTRIES) - {effect.name for effect in suspects.values()} == {
        "load_entry",
        *of_other_parts,
    }
    stated = [msgspec.structs.replace(run, load=6.0) if run.load == 9.0 else run for run in runs]
    assert [name for name in suspects_on(RIG, stated) if name.startswith("load_entry")] == [LOAD]
    assert same_in_logs("sync_inductance", "pole_pairs")
    assert not same_in_logs("ke_shift", "screw_lead")


def test_an_entry_of_one_log_moves_no_other() -> None:
    stated = [
        msgspec.structs.replace(run, load=6.0) if run.load == 9.0 else run for run in campaign({})
    ]
    data, suspects = Fitted(stated, RIG), suspects_on(RIG, stated)
    nothing = np.zeros(len(data.nuisances))
    column = data.predict(nothing, [with_values(suspects[LOAD], np.array([0.1]))]) - data.predict(
        nothing, []
    )
    log = [run.load for run in stated].index(6.0)
    others = np.ones(column.shape[0], dtype=bool)
    others[data.rows[log]] = False
    assert np.abs(column[others]).max() == 0.0
    assert np.abs(column[data.rows[log]]).max() > 0.0


def test_wrong_entries_are_not_written_as_effects_of_the_rig() -> None:
    assert corrections(found("drum_radius", 0.06))[0] == {}  # the radius itself is corrected


@pytest.mark.slow
def test_a_wrong_load_corrects_nothing_of_the_rig() -> None:
    assert corrections(misstated()) == ({}, {})
