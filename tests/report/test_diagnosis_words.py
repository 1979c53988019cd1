"""A diagnosis in words: every number of the catalogue has a name, digits as they are known, names of what is stated."""

from pathlib import Path
from typing import Any

import msgspec
import pytest
from diagnosed import diagnosed

from winchcascade.core.campaign_file import Origin
from winchcascade.diagnosis import causes, closure, evidence, nuisances
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import Alarm, Alternative, Experiment, Remainder, Reported, Spot
from winchcascade.diagnosis.nuisances import ABSENT, Nuisance
from winchcascade.report.diagnosis_words import (
    arises_words,
    checked_words,
    closure_words,
    experiment_words,
    interval_words,
    says_more,
    sure_words,
    verdict_words,
    where_words,
    word_of,
)
from winchcascade.report.gap_words import (
    _LAWS,
    SIGNS,
    alarm_place,
    display_of,
    kind_words,
    nuisance_words,
    number_words,
)
from winchcascade.report.results.diagnosis import no_energy_words
from winchcascade.report.results.diagnosis_lines import diagnosis_lines
from winchcascade.report.results.diagnosis_record import as_json
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
        (-0.3, -0.1, 0.1, ("−10 %", "−30 to 10 %")),
        (0.1, 0.1, 0.1, ("+10.000 %", "10.000 to 10.000 %")),
    ],
)
def test_a_number_has_the_digits_that_its_interval_allows(
    low: float, value: float, high: float, texts: tuple[str, str]
) -> None:
    assert number_words(display_of("copper_heating", "r_s_change"), Reported(value, low, high, "relative")) == texts


def test_a_number_that_is_no_change_has_no_sign() -> None:
    value = Reported(0.8829, 0.8807, 0.8851, "1")
    assert number_words(display_of("ke_rolloff", "k_e_ratio_at_10_a"), value)[0] == "88.29 %"


# ---------------------------------------------------------------------------------------------------------- what is said
def test_verdicts_differ_and_state_the_share() -> None:
    copper = diagnosed("copper")
    lost = changed(copper, verdict="unexplained", causes=())
    partly, more = (
        changed(copper, verdict="partly_explained", **x) for x in ({}, {"chosen": ("copper_heating", "force_zero")})
    )
    said = [verdict_words(found) for found in (copper, partly, more, lost, diagnosed("outsider"), diagnosed("nothing"))]
    assert len(set(said)) == len(said)
    assert all("99 %" in text for text in said[:4])
    assert str(len(copper.sets) - 1) in said[3]


def test_where_no_mean_stands_out_the_strongest_sign_is_reported_instead() -> None:
    found = diagnosed("outsider")
    quiet = tuple(msgspec.structs.replace(place, z=0.5) for place in found.places)
    alarm = Alarm("scatter", Spot("idc", "payout", within_blocks=True), 20.09, 2.2)
    assert "gearbox" in where_words(found)
    text = where_words(changed(found, places=quiet, remainder=Remainder(1.0, (alarm,), alarm.about)))
    assert alarm_place(alarm, []) in text
    assert "gearbox" not in text


def test_where_a_gap_arises_is_said_where_it_is_another_stage_than_that_of_the_cause() -> None:
    outsider, rolloff = diagnosed("outsider"), diagnosed("rolloff")
    assert says_more(outsider)
    assert "gearbox" in arises_words(outsider)
    assert as_json(outsider)["where"]["sentence"].endswith(arises_words(outsider))
    assert not says_more(rolloff)
    assert says_more(changed(rolloff, verdict="partly_explained"))
    assert arises_words(diagnosed("nothing")) == ""


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
    assert (worst["stage"], worst["channel"], worst["inputs"]) == ("gearbox", "torque", ["velocity", "vdc", "idc"])


def test_what_was_checked_counts_means_stages_and_the_likeliest_effect() -> None:
    found = diagnosed("nothing")
    assert checked_words(found).startswith(f"{len(found.places)} means")
    one = msgspec.structs.replace(found.stages[0], z=-5.0)
    assert f"1 of {len(found.stages)}" in checked_words(changed(found, stages=(one, *found.stages[1:])))
    likely = checked_words(changed(found, sets={(): 0.01, ("current_gain",): 0.99}))
    assert "current_gain" in likely
    assert "0.99" in likely


def test_how_sure_a_cause_is_names_its_look_alikes_and_what_the_catalogue_lacks() -> None:
    found = diagnosed("copper")
    cause = msgspec.structs.replace(
        found.causes[0],
        probability=0.7,
        look_alikes=(Alternative("line_drag", 0.3, Spot("idc", "payout", 4.5, z=1.9)),),
    )
    unsure = sure_words(changed(found, causes=(cause,)))
    assert {"0.70", "line_drag"} <= {word.strip(".;,") for word in unsure.split()}
    assert str(found.suspects["copper_heating"].unlisted) in unsure
    assert "above 0.99" in sure_words(found)
    assert "line_drag" not in sure_words(found)
    assert sure_words(diagnosed("outsider")) == ""


def test_the_share_that_is_closed_comes_with_its_interval() -> None:
    found = diagnosed("copper")
    assert found.closure is not None
    some = changed(found, closure=msgspec.structs.replace(found.closure, share=0.943, low=0.91, high=0.961))
    assert [text in closure_words(some) for text in ("94 %", "91 to 96 %")] == [True, True]
    assert interval_words(found.closure) == "> 99 %"
    assert closure_words(diagnosed("nothing")) == ""


@pytest.mark.parametrize(("z", "expected"), [(1.3, "1.3"), (22.4, "22"), (959.0, "more than 100")])
def test_the_next_experiment_is_reported_with_what_it_can_do(z: float, expected: str) -> None:
    plan = Experiment("cycle", 1.1, ("copper_heating", "line_drag"), z, load=4.5, length=9.5)
    text = experiment_words(changed(diagnosed("copper"), experiment=plan))
    assert [part in text for part in (f"{expected} standard deviations", "1.10 m/s", "4.5", "line_drag")] == [True] * 4


def test_a_rival_that_no_run_distinguishes_from_the_cause_is_to_be_measured() -> None:
    found = diagnosed("copper")
    plan = Experiment("cycle", 1.1, ("copper_heating", "line_drag"), 1.3, load=4.5, length=9.5)
    cause = msgspec.structs.replace(found.causes[0], look_alikes=(Alternative("line_drag", 0.3, None),))
    assert experiment_words(changed(found, causes=(cause,), experiment=plan)).startswith(
        "None of the runs that were considered distinguishes copper_heating from line_drag"
    )


@pytest.mark.parametrize("z", [1.3, 22.4])
def test_a_rival_that_is_the_same_in_these_logs_is_named_beside_a_run_that_tests_another(z: float) -> None:
    found = diagnosed("copper")
    plan = Experiment("cycle", 1.1, ("copper_heating", "line_drag"), z, load=4.5, length=9.5)
    cause = msgspec.structs.replace(found.causes[0], look_alikes=(Alternative("diode_drop", 0.05, None),))
    alone, beside = (
        experiment_words(changed(found, causes=causes, experiment=plan)) for causes in (found.causes, (cause,))
    )
    assert ("No alternative" in alone, "No alternative" in beside) == (True, False)
    assert "copper_heating from diode_drop" in beside


@pytest.mark.parametrize("kind", SIGNS)
def test_every_kind_of_alarm_is_explained(kind: Any) -> None:
    alarm = Alarm(kind, Nuisance("zero", "vdc", 0.1, "SI", log=1), 6.04, 4.5)
    assert alarm_place(alarm, ["a.csv", "b.csv"]) == "zero of Vdc in b.csv"
    assert SIGNS[kind].size in kind_words([alarm])[kind]
    assert alarm_place(msgspec.structs.replace(alarm, about=Spot("eta_gen", load=45.0)), []) == "eta_gen at 45 ohm"


def test_a_sensor_is_said_to_cost_no_energy() -> None:
    found = diagnosed("copper")
    cause = msgspec.structs.replace(found.causes[0], effect="force_zero", stage="sensor")
    assert no_energy_words(changed(found, causes=(cause,))).startswith("Force cell zero")
    assert no_energy_words(found) == ""


def test_a_law_that_the_rig_file_does_not_state_has_a_name_of_its_own() -> None:
    laws = [Nuisance("law", name, sd, unit, section=part) for (part, name), (sd, unit) in ABSENT.items()]
    assert {str(law) for law in laws} == set(_LAWS)
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
        assert word_of(changed(found, runs=tuple(msgspec.structs.replace(r, origin=o) for r, o in given))) == word


def test_few_lines_tell_verdict_causes_and_files() -> None:
    path = Path("/a long folder with blanks in it") / f"{'and a name ' * 12}.html"
    text = diagnosis_lines(as_json(diagnosed("copper")), [path])
    assert [word in text for word in ("explained", "copper_heating", "99 %", f"{path}\n")] == [True] * 4
    assert diagnosis_lines(as_json(diagnosed("nothing")), []).split() == ["diagnosis:", "no", "gap"]


def test_the_documentation_states_the_numbers_of_the_code() -> None:
    text = " ".join((Path(__file__).parents[2] / "docs" / "diagnosis.md").read_text(encoding="utf-8").split())
    assert f"over all logs | {closure.ROUGH:g} |" in text
    assert f"rings) | {closure.RESTLESS:g} |" in text
    assert f"in its standard uncertainties | {closure.PULLED:g} |" in text
    assert f"costs less than {evidence.CLEARLY:g}" in text
    assert f"falls short by less than {causes.AS_GOOD:g}" in text
    assert f"from {closure.DRAWS} sets of cycles" in text
    assert all(f"{sd:g} N" in text for sd, _ in nuisances.ABSENT.values())
    assert all(f"{100 * share:g} %" in text for share in nuisances.OF_THE_MODEL.values())
