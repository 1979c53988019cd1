"""Tables `[cascade]` and `[stage.NAME]` of a rig file: stages of your own and their order."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import msgspec

from winchcascade.core.cascade import BUILT_IN, PAPER, Cascade, Product, Stage
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


class CascadeTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Table [cascade]: stages in the direction in which power flows."""

    stages: tuple[str, ...]


class StageTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Table [stage.NAME]: power as a channel or a product of two, and the place where it flows."""

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
    if _NAME.fullmatch(name) is None or name in _RESERVED:
        raise RigError(
            f"{place}: expected a name of letters and digits that is none of {', '.join(_RESERVED)}, such as hyd."
        )
    text, sign = table.power.strip(), 1.0
    if text.startswith("-"):
        text, sign = text[1:].strip(), -1.0
    channels = tuple(part.strip() for part in text.split("*"))
    for channel in channels:
        if channel not in known:
            raise RigError(
                f"{place}: power = {table.power!r} needs a channel {channel!r}, which is unknown; expected one of "
                f'{", ".join(known)}. Define your own as [channels.NAME] with unit = "...".'
            )
    product = Product(channels, by_radius=set(channels) == {"torque", "velocity"}, sign=sign)
    if not _is_power([known[channel].dimension for channel in channels]) and not product.by_radius:
        raise RigError(
            f"{place}: power = {table.power!r} is no power; expected a channel in W, or force * velocity, torque * speed, a "
            "voltage times a current, or a pressure times a flow."
        )
    return Stage(name, (product,), table.where or (BUILT_IN[name].where if name in BUILT_IN else product.text))


def _is_power(dimensions: Sequence[str]) -> bool:
    """Whether channels of these dimensions give a power."""
    return list(dimensions) == ["power"] or (len(dimensions) == 2 and set(dimensions) in _FACTORS)
