"""A diagnosis in words: every number of the catalogue has a name, digits as they are known,
names of what is stated.
"""

from typing import Any

import msgspec
import pytest
from diagnosed import diagnosed

from winchcascade.core.campaign_file import Origin
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import Alternative, Experiment, Reported
from winchcascade.diagnosis.fit.nuisances import ABSENT, Nuisance
from winchcascade.report.diagnosis_names import (
    LAWS,
    display_of,
    nuisance_words,
    number_words,
    word_of,
)
from winchcascade.report.results.diagnosis_record import as_json
from winchcascade.report.results.diagnosis_words import (
    action_of,
    certainty_words,
)
from winchcascade.rig.effects.catalogue import EFFECTS
from winchcascade.rig.effects.effect import Display


def changed(of: ModelDiagnosis, **changes: Any) -> ModelDiagnosis:
    return msgspec.structs.replace(of, **changes)


@pytest.mark.parametrize("effect", EFFECTS)
def test_every_number_of_the_catalogue_has_a_name_and_a_unit_of_its_own(effect: str) -> None:
    shown = display_of(effect, EFFECTS[effect].parameter)
    assert 0 < len(shown.what) <= 28  # so that the table of causes fits a page
    assert shown.factor > 0.0


def test_a_number_of_no_effect_of_the_catalogue_is_shown_by_its_own_name_and_unit() -> None:
    assert display_of("draught", "at_10_m", "N") == Display("at 10 m", 1.0, "N", signed=False)


@pytest.mark.parametrize(
    ("low", "value", "high", "texts"),
    [
        (0.372, 0.3996, 0.427, ("+40.0 %", "37.2 to 42.7 %")),
        (0.36, 0.4, 0.44, ("+40.0 %", "36.0 to 44.0 %")),
        (-0.3, -0.1, 0.1, ("-10 %", "-30 to 10 %")),
        (0.1, 0.1, 0.1, ("+10.00 %", "10.00 to 10.00 %")),
    ],
)
def test_a_number_has_the_digits_that_its_interval_allows(
    low: float, value: float, high: float, texts: tuple[str, str]
) -> None:
    assert (
        number_words(
            display_of("copper_heating", "r_s_change"), Reported(value, low, high, "relative")
        )
        == texts
    )


def test_a_number_that_is_no_change_has_no_sign() -> None:
    value = Reported(0.8829, 0.8807, 0.8851, "1")
    assert number_words(display_of("ke_rolloff", "k_e_ratio_at_10_a"), value)[0] == "88.29 %"


def test_the_record_holds_the_stages_beside_the_map() -> None:
    found = diagnosed("outsider")
    rows = as_json(found)["where"]["stages"]
    assert len(rows) == len(found.stages)
    fields = {
        "stage", "channel", "inputs", "phase", "file", "load_ohm", "blocks", "bias", "rms", "noise", "u_noise", "u_repeat",
        "u_tolerance", "z",
    }  # fmt: skip
    assert all(set(row) == fields for row in rows)
    worst = max(rows, key=lambda row: abs(row["z"]))
    assert (worst["stage"], worst["channel"], worst["inputs"]) == (
        "gearbox",
        "torque",
        ["velocity", "vdc", "idc"],
    )


def test_the_first_screen_names_the_effects_that_the_logs_do_not_distinguish_from_a_cause() -> None:
    found = diagnosed("copper")
    (cause,) = found.causes
    alike = msgspec.structs.replace(cause, look_alikes=(Alternative("line_drag", 0.3, None),))
    named = [
        "line_drag" in certainty_words(changed(found, causes=(one,))) for one in (cause, alike)
    ]
    assert named == [False, True]


def test_what_to_do_follows_from_kind_look_alikes_next_run_and_verdict() -> None:
    found = diagnosed("copper")
    (cause,) = found.causes
    sensor = msgspec.structs.replace(cause, effect="force_zero", stage="sensor")
    alike = msgspec.structs.replace(cause, look_alikes=(Alternative("line_drag", 0.3, None),))
    plan = Experiment("cycle", 1.1, ("copper_heating", "line_drag"), 22.4, load=4.5, length=9.5)
    weak = msgspec.structs.replace(plan, expected_z=1.3)
    done = [
        action_of(found, cause).what,
        action_of(found, sensor).what,
        action_of(changed(found, experiment=plan), alike).what,
        action_of(changed(found, experiment=weak), alike).what,
        action_of(changed(found, verdict="partly_explained"), cause).what,
    ]
    assert len({*done}) == len(done)
    assert ["force cell" in text for text in done].index(True) == 1
    assert ["r_s" in text for text in done].index(True) == 3


def test_a_law_that_the_rig_file_does_not_state_has_a_name_of_its_own() -> None:
    laws = [
        Nuisance(name, unit, kind="law", sd=sd, section=part)
        for (part, name), (sd, _, unit) in ABSENT.items()
    ]
    assert {str(law) for law in laws} == set(LAWS)
    assert "_" not in " ".join(nuisance_words(law, []) for law in laws)


def test_logs_are_called_measured_where_that_is_stated_of_all_whatever_the_title() -> None:
    found = changed(diagnosed("copper"), title="Trials rebuilt from a table")
    assert word_of(found) == "log"
    for origins, word in (
        ((Origin(True), Origin(True)), "measured"),
        ((Origin(True), Origin()), "log"),
        ((Origin(), Origin()), "log"),
    ):
        given = zip(found.runs, origins, strict=True)
        assert (
            word_of(
                changed(found, runs=tuple(msgspec.structs.replace(r, origin=o) for r, o in given))
            )
            == word
        )
