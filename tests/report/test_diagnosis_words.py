"""A diagnosis in words: every number of the catalogue has a name, every verdict its sentence, digits as they are known."""

from typing import Any

import msgspec
import pytest
from diagnosed import diagnosed

from winchcascade.core.campaign_file import Origin
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import Alarm, Alternative, Experiment, Remainder, Reported, Spot
from winchcascade.diagnosis.nuisances import Nuisance
from winchcascade.report.cause_words import cause_words
from winchcascade.report.diagnosis_text import as_json, diagnosis_lines, diagnosis_text
from winchcascade.report.diagnosis_words import (
    arises_words,
    checked_words,
    closure_words,
    experiment_words,
    interval_words,
    judged_words,
    remainder_words,
    says_more,
    sure_words,
    verdict_words,
    where_words,
    word_of,
)
from winchcascade.report.gap_words import alarm_meaning, alarm_words, arises_sentence, display_of, number_words
from winchcascade.rig.effects.catalogue import EFFECTS
from winchcascade.rig.effects.effect import Display


def changed(of: ModelDiagnosis, **changes: Any) -> ModelDiagnosis:
    return msgspec.structs.replace(of, **changes)


def flat(text: str) -> str:
    return " ".join(text.split())


@pytest.mark.parametrize("effect", EFFECTS)
def test_every_number_of_the_catalogue_has_a_name_and_a_unit_of_its_own(effect: str) -> None:
    shown = display_of(effect, EFFECTS[effect].parameter)
    assert 0 < len(shown.what) <= 28  # so that the table of causes fits a terminal
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


def test_a_cause_is_reported_with_its_interval() -> None:
    found = diagnosed("copper")
    text = cause_words(found, found.causes[0])
    assert text.startswith("stator resistance +")
    assert "(95 %: " in text


# ------------------------------------------------------------------------------------------------------------ verdicts
def test_each_verdict_has_its_sentence() -> None:
    copper = diagnosed("copper")
    assert "closes more than 99 %" in verdict_words(copper)
    assert "the residual is not significant" in verdict_words(copper)
    assert "something else acts too" in verdict_words(changed(copper, verdict="partly_explained"))
    lost = changed(copper, verdict="unexplained", causes=())
    assert f"{len(copper.sets) - 1} sets of effects were fitted" in verdict_words(lost)
    assert "the cause lies outside the catalogue" in verdict_words(diagnosed("outsider"))
    assert "no cause is named" in verdict_words(diagnosed("nothing"))


def test_effects_of_the_fit_that_are_not_named_are_counted() -> None:
    copper = diagnosed("copper")
    cut = changed(copper, verdict="partly_explained", chosen=("copper_heating", "force_zero"))
    assert verdict_words(cut).startswith("A fit of 2 effects, of which the leading 1 are named, closes")
    assert "not named, though fitted: force_zero" in diagnosis_text(cut)


def test_where_no_mean_stands_out_the_strongest_sign_is_reported_instead() -> None:
    found = diagnosed("outsider")
    assert where_words(found).startswith("The gap lies in")
    quiet = tuple(msgspec.structs.replace(place, z=0.5) for place in found.places)
    alarm = Alarm("scatter", Spot("idc", "payout", within_blocks=True), 20.09, 2.2)
    text = where_words(changed(found, places=quiet, remainder=Remainder(1.0, (alarm,), alarm.about)))
    assert text.startswith("No mean over a phase deviates beyond noise and tolerances.")
    assert "Idc within blocks of payout: the scatter is 20.1 times what noise explains (limit 2.2)" in text


def test_where_a_gap_arises_is_reported_beside_where_it_shows() -> None:
    found = diagnosed("outsider")
    assert found.where is not None
    assert found.where.stage == "gearbox"
    assert arises_words(found).startswith(
        "With logged inputs to each stage, only the gearbox stage deviates: torque is under-"
    )
    assert says_more(found)
    text = flat(diagnosis_text(found))
    assert flat(arises_words(found).replace("Ω", "ohm")) in text
    assert as_json(found)["where"]["sentence"].endswith(arises_sentence(found.where.arises))


def test_a_stage_that_is_that_of_the_cause_is_not_reported_twice() -> None:
    found = diagnosed("rolloff")
    assert found.where is not None
    assert found.where.stage == "generator"
    assert not says_more(found)
    assert "logged inputs" not in diagnosis_text(found)
    assert "With logged inputs to each stage, only the generator stage deviates" in as_json(found)["where"]["sentence"]
    assert says_more(changed(found, verdict="partly_explained"))
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


def test_without_a_cause_a_stage_that_is_off_is_counted() -> None:
    found = diagnosed("nothing")
    one = msgspec.structs.replace(found.stages[0], z=-5.0)
    text = checked_words(changed(found, stages=(one, *found.stages[1:])))
    assert f" Stage by stage 1 of {len(found.stages)} do. " in text


def test_a_sure_cause_without_a_rival_is_reported_as_such() -> None:
    assert sure_words(diagnosed("copper")).startswith("The cause has a probability above 0.99; no other effect")
    assert sure_words(diagnosed("nothing")).startswith("Probability of no effect of the catalogue: > 0.99")
    assert sure_words(diagnosed("outsider")) == ""


def test_a_rival_is_reported_beside_the_cause_and_never_hidden() -> None:
    found = diagnosed("copper")
    rival = Alternative("line_drag", 0.3, Spot("idc", "payout", 4.5, z=1.9))
    cause = msgspec.structs.replace(found.causes[0], probability=0.7, look_alikes=(rival,))
    unsure = changed(found, causes=(cause,))
    assert sure_words(unsure) == (
        "copper_heating has a probability of 0.70; line_drag would explain the data about as well as copper_heating. A "
        "probability is the posterior within the catalogue. Not in the catalogue: a cable between machine and bridge or "
        "before the tap of Vdc would look like copper_heating."
    )
    assert "Idc during payout at 4.5 ohm, by 1.9 standard deviations" in flat(diagnosis_text(unsure))
    better = msgspec.structs.replace(cause, look_alikes=(msgspec.structs.replace(rival, probability=0.8),))
    assert "at least as well" in sure_words(changed(found, causes=(better,)))


def test_the_share_that_is_closed_comes_with_its_interval_and_how_it_is_known() -> None:
    found = diagnosed("copper")
    assert found.closure is not None
    some = changed(found, closure=msgspec.structs.replace(found.closure, share=0.943, low=0.91, high=0.961))
    assert closure_words(some).startswith(
        "94 % of the explainable gap is closed (95 %: 91 to 96 %), judged on each log"
    )
    assert interval_words(found.closure) == "> 99 %"
    assert closure_words(diagnosed("nothing")) == ""


def test_withheld_logs_are_reported_by_their_loads() -> None:
    found = diagnosed("copper")
    assert "the causes were chosen on all logs" in judged_words(found)
    assert judged_words(diagnosed("nothing")) == "all logs took part"


@pytest.mark.parametrize(
    ("z", "expected"),
    [
        (1.3, "These logs rule out line_drag, the next suspect"),
        (22.4, "No alternative explanation remains."),
        (959.0, "They differ there by more than 100 standard deviations"),
    ],
)
def test_the_next_experiment_is_reported_with_what_it_can_do(z: float, expected: str) -> None:
    plan = Experiment("cycle", 1.1, ("copper_heating", "line_drag"), z, load=4.5, length=9.5)
    text = experiment_words(changed(diagnosed("copper"), experiment=plan))
    assert expected in text
    assert "4.5 Ω, one cycle: 1.5 s ramp to 1.10 m/s" in text


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


def test_what_no_effect_of_the_catalogue_is_and_looks_like_a_cause_is_reported() -> None:
    found = diagnosed("copper")
    assert "Not in the catalogue" not in sure_words(diagnosed("rolloff"))
    cause = msgspec.structs.replace(found.causes[0], effect="precharge")
    assert sure_words(changed(found, causes=(cause,), suspects=EFFECTS)).endswith(
        "Not in the catalogue: a gain of the pressure sensor beyond its tolerance would look like precharge."
    )


@pytest.mark.parametrize("kind", ["structure", "scatter", "ripple", "nuisance"])
def test_an_alarm_is_reported_with_its_limit_and_its_meaning(kind: Any) -> None:
    alarm = Alarm(kind, Nuisance("zero", "vdc", 0.1, "SI", log=1), 6.04, 4.5)
    text = alarm_words(alarm, ["a.csv", "b.csv"])
    assert text.startswith("Zero of Vdc in b.csv")
    assert "6.0" in text
    assert "limit 4.5" in text
    assert len(alarm_meaning(alarm)) > 20


def test_what_is_left_is_reported_in_one_breath() -> None:
    assert remainder_words(diagnosed("copper")) == (
        "Less than 1 % of the gap stays open; it has no significant structure."
    )
    assert "signs of something unexplained" in remainder_words(diagnosed("outsider"))
    assert remainder_words(diagnosed("nothing")) == "There is no residual beyond noise."


def test_what_was_checked_counts_means_and_effects() -> None:
    found = diagnosed("nothing")
    assert checked_words(found) == (
        f"{len(found.places)} means by channel, phase and load: none deviates by more than 4 standard uncertainties. "
        "4 effects: none explains more than chance would."
    )


def test_an_effect_that_nearly_is_named_is_not_called_chance() -> None:
    found = changed(diagnosed("nothing"), sets={(): 0.01, ("current_gain",): 0.99})
    assert checked_words(found).endswith(
        "4 effects: the most probable, current_gain, has a probability of 0.99, too low to be named as a cause."
    )


# ---------------------------------------------------------------------------------------------------- what they are called
def test_simulated_logs_are_never_called_measured() -> None:
    found = diagnosed("copper")
    assert word_of(found) == "log"
    assert flat(diagnosis_text(found)).count("not measured. Made by winchcascade simulate.") == 1


def test_logs_are_called_measured_where_that_is_stated_of_all_whatever_the_title() -> None:
    found = changed(diagnosed("copper"), title="Trials rebuilt from a table")
    for origins, word in (
        ((Origin(True), Origin(True)), "measured"),
        ((Origin(True), Origin()), "log"),
        ((Origin(), Origin()), "log"),
    ):
        given = zip(found.runs, origins, strict=True)
        assert word_of(changed(found, runs=tuple(msgspec.structs.replace(r, origin=o) for r, o in given))) == word


# ------------------------------------------------------------------------------------------------------------ the page
@pytest.mark.parametrize("name", ["copper", "rolloff", "nothing", "outsider"])
def test_the_text_keeps_to_its_columns_and_shows_all_there_is(name: str) -> None:
    found = diagnosed(name)
    text = diagnosis_text(found)
    assert max(len(line) for line in text.splitlines()) <= 100
    assert "\u2212" not in text
    assert text.startswith(f"a campaign of {name}: ")
    for cause in found.causes:
        assert cause.effect in text
    names = ["verdict", *(["how sure", "how far", "what next", "residual"] if found.causes else [])]
    for entry in names:
        assert f"\n{entry} " in text


def test_every_suspect_is_named_or_said_not_to_be_needed() -> None:
    found = diagnosed("copper")
    text = flat(diagnosis_text(found))
    assert "not needed ke_rolloff, line_drag, force_zero" in text


def test_many_causes_stay_readable_one_below_the_other() -> None:
    found = diagnosed("copper")
    wide = Reported(0.1234567, 0.1234566, 0.1234568, "N.m.s/rad")
    cause = msgspec.structs.replace(
        found.causes[0], effect="a_suspect_of_somebody_else", parameters={"a_number_with_a_long_name": wide}
    )
    suspects = {cause.effect: msgspec.structs.replace(EFFECTS["rotor_viscous"], name=cause.effect)}
    text = diagnosis_text(changed(found, causes=(cause,), suspects=suspects))
    assert max(len(line) for line in text.splitlines()) <= 100
    assert "a number with a long name" in flat(text)


def test_few_lines_tell_verdict_causes_and_files() -> None:
    from pathlib import Path

    text = diagnosis_lines(as_json(diagnosed("copper")), [Path("d.html")])
    assert flat(text) == (
        "diagnosis: explained: Stator resistance (copper_heating); more than 99 % of the gap closed d.html"
    )
    assert diagnosis_lines(as_json(diagnosed("nothing")), []).split() == ["diagnosis:", "no", "gap"]


def test_the_path_of_a_file_is_never_broken() -> None:
    from pathlib import Path

    path = Path("/a long folder with blanks in it") / ("and a name " * 12)
    assert f"{path}\n" in diagnosis_text(diagnosed("nothing"), [path])
    assert f"{path}\n" in diagnosis_lines(as_json(diagnosed("nothing")), [path])
