"""A diagnosis names what was planted, stays silent where nothing was, and says so where nothing
in its catalogue fits.
"""

import math
from functools import cache
from pathlib import Path

import msgspec
import numpy as np
import pytest
from daily import daily
from planted import LOGS, campaign
from rigs import calibrated_rig

from winchcascade.batch.campaign_diagnosis import diagnose_campaign, diagnose_listed
from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.errors import CampaignError, LogError, OptionError
from winchcascade.diagnosis.campaign_entries import withheld_numbers
from winchcascade.diagnosis.diagnose import ModelDiagnosis, diagnose, judged
from winchcascade.diagnosis.diagnosis_result import Spot
from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.diagnosis.judge.alarms import improbable
from winchcascade.diagnosis.judge.closure import by_cycles, predicted_together
from winchcascade.report.diagnosis_names import about_words
from winchcascade.report.results.diagnosis_record import as_json
from winchcascade.report.results.diagnosis_sentences import place_sentence
from winchcascade.rig.effects.catalogue import EFFECTS

PLANTED = {
    "copper_heating": {"r_s_change": 0.35},
    "torque_gain": {"gain_error": 0.03},
    "gas_volume": {"volume_extra": 6e-4},
    "line_drag": {"b": 0.9},
}


AMONG = {name: EFFECTS[name] for name in dict.fromkeys((*PLANTED, "diode_drop", *[*EFFECTS][::4]))}
"""Suspects of a campaign with an effect: a third of the catalogue, which other tests search whole."""


@cache
def diagnosed(*names: str) -> ModelDiagnosis:
    runs = campaign({name: PLANTED[name] for name in names})
    return diagnose(runs, calibrated_rig(), AMONG if names else EFFECTS)


DAILY = ("copper_heating",)
"""Effects that are diagnosed by themselves every day."""


@pytest.mark.parametrize("name", daily(PLANTED, DAILY))
def test_a_planted_effect_is_named_with_its_size(name: str) -> None:
    found = diagnosed(name)
    assert [cause.effect for cause in found.causes] == [name]
    assert found.verdict == "explained"
    (number,) = found.causes[0].parameters.values()
    (planted,) = PLANTED[name].values()
    half = 0.5 * (number.high - number.low)
    assert abs(number.value - planted) < 2.0 * half
    assert half < 0.3 * abs(planted)
    assert found.closure is not None
    assert found.closure.share > 0.9
    assert found.closure.low <= found.closure.share <= found.closure.high


def test_the_closure_subtracts_the_noise_of_the_logs_whatever_the_model_may_deviate() -> None:
    found = diagnosed("copper_heating")
    assert found.closure is not None
    judged = found.data.seen & np.isfinite(found.closure.residual)
    for k, name in enumerate(CHANNELS):
        own = found.data.logged_noise[judged[:, k], k]
        assert found.closure.channels[name].noise == pytest.approx(np.sqrt(np.mean(own**2)))
    rig = calibrated_rig()
    loose = msgspec.structs.replace(
        rig, model=msgspec.structs.replace(rig.model, discrepancy=10.0 * rig.model.discrepancy)
    )
    data = Fitted(found.runs, loose)
    assert data.logged_noise.tolist() == found.data.logged_noise.tolist()
    assert np.all(data.noise >= found.data.noise)
    assert np.median(data.noise / found.data.noise) > 2.0


def test_no_verdict_is_explained_with_a_cause_that_is_likely_another() -> None:
    found = diagnosed("copper_heating")
    assert found.verdict == "explained"
    causes = tuple(msgspec.structs.replace(one, probability=0.3) for one in found.causes)
    doubted = judged(msgspec.structs.replace(found, causes=causes), lambda _: None)
    assert doubted.verdict == "partly_explained"
    assert doubted.remainder is not None
    assert [(alarm.kind, alarm.size, alarm.limit) for alarm in doubted.remainder.alarms] == [
        ("improbable", 0.7, 0.5)
    ]
    assert all(one.size <= one.limit for one in improbable(found.causes))
    assert len(found.singles) == 3
    assert found.singles[0].effect in {"copper_heating", "diode_drop"}
    assert found.singles[0].closure > 0.9


@pytest.mark.slow
def test_two_effects_are_named_together() -> None:
    found = diagnosed("copper_heating", "line_drag")
    assert {cause.effect for cause in found.causes} == {"copper_heating", "line_drag"}


def test_nothing_is_named_where_nothing_was_planted() -> None:
    record = as_json(diagnosed())
    assert record["verdict"] == "no_gap"
    assert record["causes"] == []
    assert record["where"] is record["closure"] is record["next_experiment"] is None


def test_the_stage_of_a_gap_is_that_of_its_cause() -> None:
    found = diagnosed("copper_heating")
    where = found.where
    assert where is not None
    assert where.stage == "generator"
    assert where.worst.channel in ("vdc", "idc")
    assert "dc is over-predicted" in place_sentence(found)


@pytest.mark.slow
def test_what_no_suspect_explains_is_not_given_the_nearest_name() -> None:
    without = {
        name: kind
        for name, kind in EFFECTS.items()
        if name not in ("gas_volume", "precharge", "piston_area")
    }
    runs = campaign({"gas_volume": {"volume_extra": 6e-4}})
    swinging = [
        msgspec.structs.replace(
            run,
            channels={
                **run.channels,
                "pressure": run.channels["pressure"]
                + 4e4 * np.sin(2.0 * run.channels["displacement"]),
            },
        )
        for run in runs
    ]
    found = diagnose(swinging, calibrated_rig(), without)
    assert found.verdict in ("unexplained", "partly_explained")
    assert len(found.causes) <= 2
    assert found.remainder is not None
    assert found.remainder.worst is not None
    assert "pressure" in about_words(found.remainder.worst, [])


@pytest.mark.slow
def test_an_eccentric_drum_is_no_noise() -> None:
    drum = 0.13
    swinging = [
        msgspec.structs.replace(
            run,
            channels={
                **run.channels,
                "torque": run.channels["torque"]
                + 4.0
                * np.sin(run.channels["displacement"] / drum)
                * (run.channels["velocity"] > 0.05),
            },
        )
        for run in campaign({})
    ]
    found = diagnose(swinging, calibrated_rig(), EFFECTS)
    assert found.verdict == "unexplained"
    assert found.remainder is not None
    worst = found.remainder.alarms[0]
    assert (worst.kind, worst.about) == ("ripple", Spot("torque", "payout"))


def test_the_cycles_of_the_only_load_are_held_out_in_turn() -> None:
    open_circuit, _, loaded = campaign({})
    data = Fitted([open_circuit, loaded], calibrated_rig())
    parts = [blocks for _, blocks in predicted_together(data, [1])]
    assert by_cycles(data, [1])
    assert np.concatenate(parts).tolist() == list(range(data.rows[1].start, data.rows[1].stop))
    cycles = [set(data.blocks.cycle[part].tolist()) for part in parts]
    assert len(cycles) > 1
    assert not set.intersection(*cycles)
    whole = Fitted(campaign({}), calibrated_rig())
    assert [
        (logs, int(blocks[0]), int(blocks[-1]) + 1)
        for logs, blocks in predicted_together(whole, [1, 2])
    ] == [([k], whole.rows[k].start, whole.rows[k].stop) for k in (1, 2)]
    assert not by_cycles(whole, [1, 2])


@pytest.mark.slow
def test_a_tether_that_moves_also_at_rest_is_noise() -> None:
    rng = np.random.default_rng(3)
    moved = [
        msgspec.structs.replace(
            run,
            channels={
                **run.channels,
                "force": run.channels["force"]
                + 40.0
                * np.interp(
                    run.t,
                    np.arange(0.0, run.t[-1] + 0.5, 0.3),
                    rng.normal(size=int(run.t[-1] / 0.3) + 2),
                ),
            },
        )
        for run in campaign({})
    ]
    assert diagnose(moved, calibrated_rig(), EFFECTS).verdict == "no_gap"


def test_logs_without_a_channel_of_the_model_are_rejected_and_not_called_sound() -> None:
    bare = [
        msgspec.structs.replace(run, channels={"velocity": run.channels["velocity"]})
        for run in campaign({})
    ]
    with pytest.raises(
        LogError, match="no log that takes part has pressure, force, torque, vdc or idc"
    ):
        diagnose(bare, calibrated_rig(), EFFECTS)


def test_cycles_that_a_log_has_not_are_rejected() -> None:
    with pytest.raises(OptionError, match="cycles 5 to 6 were chosen, but it has 2"):
        diagnose(campaign({}), calibrated_rig(), EFFECTS, cycles=[None, (5, 6), None])


@pytest.mark.slow
def test_the_same_seed_gives_the_same_answer_to_the_digit() -> None:
    few = {name: EFFECTS[name] for name in PLANTED}
    one, again = (
        diagnose(campaign({"torque_gain": PLANTED["torque_gain"]}), calibrated_rig(), few)
        for _ in range(2)
    )
    assert one.closure is not None
    assert as_json(one) == as_json(again)


def test_withheld_logs_take_no_part_in_the_choice() -> None:
    runs = campaign({"copper_heating": PLANTED["copper_heating"]})
    spoiled = msgspec.structs.replace(
        runs[2], channels={**runs[2].channels, "vdc": 2.0 * runs[2].channels["vdc"]}
    )
    suspects = {name: EFFECTS[name] for name in ("copper_heating", "ke_shift", "voltage_gain")}
    found = diagnose([*runs[:2], spoiled], calibrated_rig(), suspects, withheld=[2])
    assert found.closure is None or found.closure.withheld == (2,)
    assert "voltage_gain" not in [cause.effect for cause in found.causes]


def test_a_copy_of_a_withheld_log_must_not_take_part_in_the_fit() -> None:
    runs = [
        msgspec.structs.replace(run, sha256=digest)
        for run, digest in zip(campaign({}), "aba", strict=True)
    ]
    with pytest.raises(
        CampaignError,
        match=r"copies: runs 1 \(.*\) and 3 \(.*\) are the same log, and run 3 is withheld",
    ):
        diagnose(runs, calibrated_rig(), EFFECTS, title="copies", withheld=[2])


def test_loads_are_withheld_by_number() -> None:
    runs = campaign({})
    assert withheld_numbers([36], runs, [False] * 3) == [1]
    assert withheld_numbers([math.inf, 9.0], runs, [False] * 3) == [0, 2]
    assert withheld_numbers([], runs, [False, True, False]) == [1]
    with pytest.raises(
        OptionError,
        match=r"--withhold 18: no run of the campaign has this load; it has inf, 36, 9 ohm",
    ):
        withheld_numbers([18.0], runs, [False] * 3)


def test_a_campaign_of_which_everything_is_withheld_is_rejected() -> None:
    with pytest.raises(CampaignError, match="every run is withheld"):
        diagnose(campaign({}), calibrated_rig(), EFFECTS, withheld=range(len(LOGS)))


SHARED = [
    "copper_heating", "copper_heating_and_line_drag", "electrical_lag", "gas_polytropic", "gear_mesh_loss", "ke_rolloff",
    "ke_rolloff_and_gear_mesh_loss", "line_friction", "none_2", "outside_the_catalogue", "precharge", "rotor_inertia",
    "rotor_viscous", "torque_gain",
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("case", SHARED)
def test_a_labelled_campaign_is_diagnosed(shared: Path, case: str) -> None:
    record = diagnose_campaign(shared / "labelled" / case, suspects=EFFECTS)
    if case == "outside_the_catalogue":
        assert record["verdict"] not in ("explained", "no_gap")
        return
    hidden = set() if case.startswith("none") else set(case.split("_and_"))
    causes = msgspec.convert(record["causes"], list[dict[str, object]])
    assert {cause["effect"] for cause in causes} == hidden
    assert record["verdict"] == ("explained" if hidden else "no_gap")


@pytest.mark.slow
@pytest.mark.parametrize("effect", ["diode_drop", "seal_friction"])
def test_an_effect_beyond_its_plausible_range_is_not_hidden_by_another(
    shared: Path, effect: str
) -> None:
    """Its number costs evidence, but these logs follow from it at least as well."""
    folder = shared / "harder" / f"beyond_range_{effect}"
    found = diagnose_listed(load_campaign(folder), EFFECTS)
    assert isinstance(found, ModelDiagnosis)
    (cause,) = found.causes
    assert effect in {cause.effect, *(other.effect for other in cause.look_alikes)}
    assert cause.effect == effect or cause.probability < 0.96
    numbers = {other.effect: other.number for other in cause.look_alikes}
    number = numbers.get(effect, next(iter(cause.parameters.values())))
    assert number is not None
    assert number.beyond_range


@pytest.mark.slow
def test_the_seven_effects_of_the_rebuilt_campaign_are_found(fixtures: Path) -> None:
    found = diagnose_listed(load_campaign(fixtures / "campaign"), EFFECTS)
    assert isinstance(found, ModelDiagnosis)
    assert {cause.effect for cause in found.causes} == {
        "ke_rolloff", "rotor_friction", "copper_heating", "gas_volume", "screw_friction", "line_drag", "torque_gain",
    }  # fmt: skip
    assert found.closure is not None
    assert found.closure.share >= 0.95
