"""What is a cause and what a candidate, and what travels with the numbers of a rig whose gap is
judged.
"""

import pytest
from diagnosed import diagnosed

from winchcascade import OptionError
from winchcascade.diagnosis.diagnosis_result import (
    Alarm,
    Judgement,
    NamedCause,
    Spot,
    Stability,
    Trend,
    Verdict,
)
from winchcascade.diagnosis.fit.entries import class_of, effect_name, same_in_logs
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.diagnosis.judge.causes import COVERED
from winchcascade.diagnosis.judge.conclusion import is_within_law
from winchcascade.diagnosis.judge.relevance import moved_by, share_of_plateau
from winchcascade.diagnosis.judge.verdict import parted
from winchcascade.diagnosis.verdict_limits import LAW, MARGIN, MOSTLY, OPEN, STRUCTURED
from winchcascade.rig.effects.catalogue import CLASSES, EFFECTS, LAWS

DRIFT = Stability((), (Trend("order", 1.0, 0.1, 1e-6),))


def cause(name: str, stability: Stability | None = None) -> NamedCause:
    return NamedCause(name, "gearbox", 1.0, {}, (), 1.0, stability=stability)


def sign(times: float) -> Alarm:
    return Alarm("structure", Spot("vdc", "payout"), times * STRUCTURED, STRUCTURED)


@pytest.mark.parametrize(
    ("signs", "share", "causes"),
    [
        ([], MOSTLY, ["ke_shift", "line_drag"]),
        ([sign(MARGIN)], MOSTLY, ["ke_shift", "line_drag"]),
        ([sign(MARGIN), sign(1.01 * MARGIN)], 1.0, []),
        ([sign(1.1)], 0.99 * MOSTLY, []),
        ([Alarm("range", Spot(effects=("ke_shift",)), 1.0, 0.0)], 1.0, ["ke_shift", "line_drag"]),
        (
            [Alarm("cancelling", Spot("force", effects=("ke_shift", "other")), 6.0, 5.0)],
            1.0,
            ["line_drag"],
        ),
    ],
)
def test_a_name_is_a_cause_where_little_is_left(
    signs: list[Alarm], share: float, causes: list[str]
) -> None:
    named, listed = parted([cause("ke_shift"), cause("line_drag")], signs, share)
    assert [one.effect for one in named] == causes
    assert sorted(one.effect for one in (*named, *listed)) == ["ke_shift", "line_drag"]
    assert all(one.probability == OPEN for one in (*named, *listed))


def test_what_differs_from_run_to_run_is_a_candidate() -> None:
    named, listed = parted([cause("ke_shift", DRIFT), cause("line_drag")], [sign(1.1)], 1.0)
    assert ([one.effect for one in named], [one.effect for one in listed]) == (
        ["line_drag"],
        ["ke_shift"],
    )


@pytest.mark.parametrize("verdict", ["no_gap", "explained", "partly_explained", "unexplained"])
@pytest.mark.parametrize("force", [False, True])
def test_a_rig_whose_gap_is_unexplained_is_refused_unless_forced(
    verdict: Verdict, force: bool
) -> None:
    judgement = Judgement(verdict)
    if verdict == "unexplained" and not force:
        with pytest.raises(OptionError, match="design") as raised:
            judgement.check("design", force=force)
        assert "--force" in str(raised.value)
    else:
        judgement.check("design", force=force)


# ---------------------------------------------------------------------------------------- classes
def test_a_class_of_look_alikes_has_two_of_a_kind_and_what_distinguishes_them() -> None:
    for one in CLASSES:
        assert {effect_name(name) for name in one.members} <= EFFECTS.keys() | LAWS.keys(), one.name
        assert len(one.members) + len(one.beyond) > 1, one.name
        assert one.broken_by, one.name


def test_every_pair_of_a_class_is_the_same_in_logs_and_no_other_is() -> None:
    pairs = {frozenset((a, b)) for one in CLASSES for a in one.members for b in one.members}
    for a in EFFECTS:
        for b in EFFECTS:
            assert same_in_logs(a, b) == (frozenset((a, b)) in pairs)


def test_the_class_of_a_cause_is_that_of_its_look_alike_or_one_with_something_beyond_the_catalogue() -> (
    None
):
    shared, beyond = class_of("heating", ["copper_heating"]), class_of("precharge", [])
    assert shared is not None
    assert beyond is not None
    assert (shared.name, beyond.name) == ("series_resistance", "gas_pressure")
    assert class_of("rotor_windage", ["rotor_friction"]) is None


# -------------------------------------------------------------------------------------- imitators
@pytest.mark.parametrize(("share", "within"), [(0.5, True), (1.5, False)])
def test_a_cause_that_moves_no_more_than_the_law_of_another_leaves_open_is_within_it(
    share: float, within: bool
) -> None:
    found = diagnosed("copper")
    data, (name,) = found.data, found.found.best.names
    whole = moved_by(data, found.suspects, found.found.best)[name]
    small = share * COVERED * LAW * whole
    moved = {name: share_of_plateau(data, whole), "small": share_of_plateau(data, small)}
    assert moved[name][CHANNELS.index("vdc")] > moved[name][CHANNELS.index("pressure")] == 0.0
    assert is_within_law(moved, "small") == within
    assert not is_within_law(moved, name)
