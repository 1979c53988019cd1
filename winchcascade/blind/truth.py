"""What an honest answer to a campaign may be: the truth of a case, and the truth.json that any
simulator may put beside one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal, TypeVar, get_args

import msgspec

from winchcascade.core.errors import OptionError

Content = TypeVar("Content")

TRUTH_FILE = "truth.json"
"""File beside a campaign.toml that states what is injected."""

Verdict = Literal["no_gap", "explained", "partly_explained", "unexplained"]
VERDICTS: tuple[Verdict, ...] = get_args(Verdict)

UNJUDGED = "words"
"""Kind of a case whose truth is stated in words alone, so that a reader judges it."""


def decoded(path: Path, kind: type[Content], expected: str) -> Content:
    """Decode the JSON of a trial; OptionError with what was expected if that is not possible."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=kind)
    except (OSError, msgspec.DecodeError, UnicodeDecodeError, RecursionError) as fault:
        words = fault.strerror if isinstance(fault, OSError) else fault
        raise OptionError(f"{path}: cannot be read ({words}); expected {expected}.") from None


class Truth(msgspec.Struct, frozen=True):
    """What is injected in a case, and what an honest answer may be.

    Parameters
    ----------
    kind : by which cases are counted: none, single, pair, several, outsider (beyond the catalogue),
        or `words`
    what, honest : what is injected, and the honest answer, in words
    effects : strength of each effect of the catalogue [1]
    parameters : true values of the numbers that a diagnosis reports, by effect
    named : groups of effects; each must be declared by another cause, by its name or its
        alternatives
    may_be_certain : effects whose certain naming is not false
    alone : no further cause is right but those of `may_be_certain`
    verdicts : verdicts that are honest, all if empty
    excused_by : verdicts that are honest whatever is named
    run : run that a wrong load must be found in
    """

    kind: str = ""
    what: str = ""
    honest: str = ""
    effects: dict[str, float] = {}
    parameters: dict[str, dict[str, float]] = {}
    named: tuple[tuple[str, ...], ...] = ()
    may_be_certain: tuple[str, ...] = ()
    alone: bool = True
    verdicts: tuple[Verdict, ...] = ()
    excused_by: tuple[Verdict, ...] = ()
    run: str | None = None


def truth_by_effects(
    effects: Mapping[str, float],
    parameters: Mapping[str, dict[str, float]],
    *,
    beside: Sequence[str] = (),
) -> Truth:
    """The truth where effects of the catalogue, or nothing, explain the whole gap: they are named
    and nothing else is.

    Parameters
    ----------
    beside : effects that are true as well, but need not be named

    >>> truth_by_effects({}, {}).verdicts, truth_by_effects({"ke_shift": 1.0}, {}).named
    (('no_gap',), (('ke_shift',),))
    """
    words = f"{' + '.join(effects)} alone" if effects else "no_gap"
    found = Truth(
        honest=words + (f"; true as well: {', '.join(beside)}" if beside else ""),
        effects=dict(effects),
        parameters=dict(parameters),
        named=tuple((name,) for name in effects),
        may_be_certain=(*effects, *beside),
        verdicts=() if effects else ("no_gap",),
    )
    return msgspec.structs.replace(found, kind=_kind_of(found))


def _kind_of(truth: Truth) -> str:
    """Kind of a case by which it is counted: nothing injected, one or several causes of the
    catalogue, or others.
    """
    if truth.verdicts == ("no_gap",):
        return "none"
    return ("outsider", "single", "pair")[len(truth.named)] if len(truth.named) < 3 else "several"


class _Given(msgspec.Struct, frozen=True):
    """A truth.json as anybody writes it: all is optional; `truth` and `params` are other names
    of two fields.
    """

    kind: str = ""
    what: str = ""
    honest: str = ""
    effects: dict[str, float | dict[str, float]] | list[str] | None = None
    truth: list[str] = []
    parameters: dict[str, dict[str, float]] = {}
    params: dict[str, float] = {}
    named: tuple[tuple[str, ...], ...] | None = None
    may_be_certain: tuple[str, ...] | None = None
    alone: bool = True
    verdicts: tuple[Verdict, ...] | None = None
    excused_by: tuple[Verdict, ...] | None = None
    run: str | None = None


def read_truth(path: Path) -> Truth:
    """Read a truth.json. What it leaves out follows from its effects; one that has words alone
    is of the kind `words`.
    """
    given = decoded(
        path,
        _Given,
        "the truth of a campaign: effects, an object of the strengths of what is injected by name",
    )
    effects, parameters = _effects_of(given)
    found = _derived(given, effects, parameters)
    stated = {
        name: value
        for name in ("what", "honest", "named", "may_be_certain", "verdicts", "excused_by", "run")
        if (value := getattr(given, name)) not in (None, "")
    }
    found = msgspec.structs.replace(found, **{**stated, "alone": given.alone})
    return msgspec.structs.replace(
        found, kind=found.kind if found.kind == UNJUDGED else _kind_of(found)
    )


def _effects_of(given: _Given) -> tuple[dict[str, float], dict[str, dict[str, float]]]:
    """Strength of each effect that a truth states, 1 without a number, and the true values by
    effect.
    """
    parameters = {**given.parameters}
    for name, value in given.params.items():
        effect, _, parameter = name.partition(".")
        parameters[effect] = {**parameters.get(effect, {}), parameter: value}
    listed = given.effects or given.truth
    if not isinstance(listed, dict):
        return dict.fromkeys(listed, 1.0), parameters
    numbers = {name: value for name, value in listed.items() if isinstance(value, dict)}
    strengths = {name: 1.0 if isinstance(value, dict) else value for name, value in listed.items()}
    return strengths, parameters | numbers


def _derived(
    given: _Given, effects: dict[str, float], parameters: dict[str, dict[str, float]]
) -> Truth:
    """What a truth says of the honest answer: by its effects, else by its verdicts, else
    nothing.
    """
    from winchcascade.rig.effects.catalogue import EFFECTS

    if effects and set(effects) <= set(EFFECTS):
        return truth_by_effects(effects, parameters)
    words = given.honest.split(" or ")
    if set(words) <= set(VERDICTS):
        verdicts = tuple(verdict for verdict in VERDICTS if verdict in words)
        return (
            truth_by_effects({}, {})
            if verdicts == ("no_gap",)
            else Truth("outsider", verdicts=verdicts)
        )
    if effects or (given.named, given.may_be_certain, given.verdicts) != (None, None, None):
        return Truth("outsider", effects={}, parameters=parameters)
    if given.effects is not None and not (given.kind or given.honest):
        return truth_by_effects({}, {})
    return Truth(UNJUDGED)
