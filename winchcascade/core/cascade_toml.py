"""Tables `[cascade]` and `[stage.NAME]` of a rig file: stages of your own and their order."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Annotated

import msgspec
from msgspec import Meta

from winchcascade.core.cascade import BUILT_IN, PAPER, Cascade, Power, Stage, Term
from winchcascade.core.channels import Channel
from winchcascade.core.errors import RigError
from winchcascade.core.toml_file import Table, check_keys, convert

_RESERVED = ("payout", "returned", "net", "trans", "pto")
"""Names that metrics of whole cycles and of the paper have."""

_PRODUCTS = ({"force", "velocity"}, {"torque", "rotation"}, {"voltage", "current"}, {"pressure", "flow"})
"""Dimensions of two channels whose product is a power; a constant may stand for one of them."""

_FACTOR = r"\s*([A-Za-z]\w*|\d+(\.\d*)?([eE][+-]?\d+)?)\s*"

_TERM = re.compile(rf"\s*(?P<sign>[+-]?)(?P<factors>{_FACTOR}(\*{_FACTOR})*)")
"""One term of a power: its sign, and its factors, which are names of channels and numbers."""


class _Order(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Table [cascade]: stages in the direction in which power flows."""

    stages: Annotated[tuple[str, ...], Meta(min_length=1)]


class _Stage(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Table [stage.NAME]: power as `read_power` reads it, and the place where it flows."""

    power: str
    where: str = ""


def read_cascade(table: object, own: Mapping[str, Table], known: Mapping[str, Channel], rig: str) -> Cascade:
    """Read table [cascade], None without one, and tables [stage.NAME] of a rig file; the cascade of the paper without any.

    RigError for an unknown stage or channel, a stage that is listed twice, and a product that is no power.
    """
    if table is None and not own:
        return PAPER
    stages = BUILT_IN | {name: _read_stage(name, stage, known, f"{rig}: [stage.{name}]") for name, stage in own.items()}
    order = PAPER.names if table is None else convert(table, _Order, f"{rig}: [cascade]", RigError).stages
    check_keys(order, stages, f"{rig}: [cascade] stages:", RigError)
    if len(set(order)) < len(order):
        raise RigError(f"{rig}: [cascade] stages: {', '.join(order)}; expected each stage once.")
    return Cascade(tuple(stages[name] for name in order), configured=True)


def _read_stage(name: str, raw: Table, known: Mapping[str, Channel], place: str) -> Stage:
    """The stage of a table [stage.NAME]; its name is a part of names such as `energy_hyd_j` and `eta_mech_hyd`."""
    table: _Stage = convert(raw, _Stage, place, RigError)
    if re.fullmatch(r"[A-Za-z][A-Za-z0-9]*", name) is None or name in _RESERVED:
        raise RigError(
            f"{place}: expected a name of letters and digits that is none of {', '.join(_RESERVED)}, such as hyd."
        )
    power = read_power(table.power, known, f"{place}: power = {table.power!r}")
    return Stage(name, (power,), table.where or (BUILT_IN[name].where if name in BUILT_IN else power.text))


def read_power(text: str, known: Mapping[str, Channel], place: str) -> Power:
    """Read a power: terms joined by + and -, each a product of channels and constants.

    RigError, with the place of the text, for another text, an unknown channel, or a term that is no power.

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
    check_keys(channels, known, f"{place}: channel", RigError)
    by_radius = set(channels) == {"torque", "velocity"} and len(channels) == 2
    dimensions = [known[channel].dimension for channel in channels]
    is_power = by_radius or dimensions == ["power"] or (len(channels) == 2 and set(dimensions) in _PRODUCTS)
    if len(factors) > len(channels) and len(channels) < 2:
        is_power = not channels or dimensions[0] in {"power"}.union(*_PRODUCTS)
    if not is_power or not 0.0 < constant < math.inf:
        raise RigError(
            f"{place}: {text.strip()!r} is no power; expected a channel in W, force * velocity, torque * speed, a voltage "
            "times a current, or a pressure times a flow, one of which may be a constant in SI units."
        )
    return Term(channels, -constant if negative else constant, by_radius)
