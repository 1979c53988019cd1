"""Tables `[cascade]` and `[stage.NAME]` of a rig file: stages of your own and their order."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

import msgspec

from winchcascade.core.cascade import BUILT_IN, PAPER, Cascade, Power, Stage, Term
from winchcascade.core.channels import Channel
from winchcascade.core.errors import RigError

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9]*")
"""A name of a stage: without underscores, as it is a part of names such as `energy_hyd_j` and `eta_mech_hyd`."""

_RESERVED = ("payout", "returned", "net", "trans", "pto")
"""Names that metrics of whole cycles and of the paper have."""

_FACTORS = (
    {"force", "velocity"},
    {"torque", "rotation"},
    {"voltage", "current"},
    {"pressure", "flow"},
)
"""Dimensions of two channels whose product is a power."""

_FACTOR = r"\s*([A-Za-z]\w*|\d+(\.\d*)?([eE][+-]?\d+)?)\s*"

_TERM = re.compile(rf"\s*(?P<sign>[+-]?)(?P<factors>{_FACTOR}(\*{_FACTOR})*)")
"""One term of a power: its sign, and its factors, which are names of channels and numbers."""


class CascadeTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Table [cascade]: stages in the direction in which power flows."""

    stages: tuple[str, ...]


class StageTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Table [stage.NAME]: power as `read_power` reads it, and the place where it flows."""

    power: str
    where: str = ""


def read_cascade(
    table: CascadeTable | None, own: Mapping[str, StageTable], known: Mapping[str, Channel], rig: str
) -> Cascade:
    """Read the cascade of a rig file.

    Parameters
    ----------
    table, own : tables [cascade] and [stage.NAME]
    known : channels by name
    rig : path of the file, for messages

    Raises
    ------
    RigError : an unknown stage or channel, a stage that is listed twice, a product that is no power
    """
    stages = BUILT_IN | {name: _stage(name, stage, known, f"{rig}: [stage.{name}]") for name, stage in own.items()}
    if table is None:
        return PAPER if not own else Cascade(tuple(stages[stage.name] for stage in PAPER.stages), configured=True)
    names = table.stages
    unknown = [f"{name!r} is no stage" for name in names if name not in stages]
    if unknown or not names:
        raise RigError(
            f"{rig}: [cascade] stages: {unknown[0] if unknown else 'the list is empty'}; expected names among "
            f'{", ".join(stages)}. Define another one as [stage.NAME] with power = "...".'
        )
    if len(set(names)) < len(names):
        raise RigError(f"{rig}: [cascade] stages: {', '.join(names)}; expected each stage once.")
    return Cascade(tuple(stages[name] for name in names), configured=True)


def _stage(name: str, table: StageTable, known: Mapping[str, Channel], place: str) -> Stage:
    """The stage of a table [stage.NAME]."""
    if _NAME.fullmatch(name) is None or name in _RESERVED:
        raise RigError(
            f"{place}: expected a name of letters and digits that is none of {', '.join(_RESERVED)}, such as hyd."
        )
    power = read_power(table.power, known, f"{place}: power = {table.power!r}")
    return Stage(name, (power,), table.where or (BUILT_IN[name].where if name in BUILT_IN else power.text))


def read_power(text: str, known: Mapping[str, Channel], place: str) -> Power:
    """Read a power: terms joined by + and -, each a product of channels and constants.

    Parameters
    ----------
    known : channels by name
    place : of the text in the rig file, for messages

    Raises
    ------
    RigError : another text, an unknown channel, or a term that is no power

    Examples
    --------
    >>> from winchcascade.core.channels import CHANNELS
    >>> read_power("vdc * idc - 60 * idc", CHANNELS, "rig.toml").terms[1]
    Term(channels=('idc',), constant=-60.0, by_radius=False)
    """
    terms: list[Term] = []
    end = 0
    while end < len(text) or not terms:
        found = _TERM.match(text, end)
        if found is None or (terms and not found["sign"]):
            raise RigError(
                f"{place}: {text[end:].strip()[:40]!r} is no term of a power; expected products of channels and constants, "
                'joined by + and -, such as "vdc * idc + 60 * charge".'
            )
        terms.append(_term(found["sign"] == "-", found["factors"], known, place))
        end = found.end()
    if not any(term.channels for term in terms):
        raise RigError(f"{place} is no power; expected at least one channel.")
    return Power(tuple(terms))


def _term(negative: bool, text: str, known: Mapping[str, Channel], place: str) -> Term:
    """One term of a power; RigError for an unknown channel and for a product that is no power."""
    factors = [factor.strip() for factor in text.split("*")]
    channels = tuple(factor for factor in factors if not factor[0].isdigit())
    constant = math.prod(float(factor) for factor in factors if factor[0].isdigit())
    for channel in channels:
        if channel not in known:
            raise RigError(
                f"{place} needs a channel {channel!r}, which is unknown; expected one of {', '.join(known)}. Define your own "
                'as [channels.NAME] with unit = "...".'
            )
    by_radius = set(channels) == {"torque", "velocity"} and len(channels) == 2
    dimensions = [known[channel].dimension for channel in channels]
    if (
        not (by_radius or _is_power(dimensions, with_constant=len(factors) > len(channels)))
        or not 0.0 < constant < math.inf
    ):
        raise RigError(
            f"{place}: {text.strip()!r} is no power; expected a channel in W, force * velocity, torque * speed, a voltage "
            "times a current, or a pressure times a flow, one of which may be a constant in SI units."
        )
    return Term(channels, -constant if negative else constant, by_radius)


def _is_power(dimensions: Sequence[str], *, with_constant: bool) -> bool:
    """Whether channels of these dimensions give a power, also with a constant in place of all or of one of two."""
    if with_constant and len(dimensions) < 2:
        return not dimensions or dimensions[0] in {"power"}.union(*_FACTORS)
    return list(dimensions) == ["power"] or (len(dimensions) == 2 and set(dimensions) in _FACTORS)
