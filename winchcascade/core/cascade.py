"""The cascade of a rig: its stages in the direction in which power flows, how a rig file states
them, and their metrics.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from functools import cache, cached_property, reduce
from itertools import pairwise
from operator import add, mul
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import msgspec
from msgspec import Meta
from msgspec.structs import replace

from winchcascade.core.channels import Channel
from winchcascade.core.errors import RigError
from winchcascade.core.formula import Product, read_formula
from winchcascade.core.toml_file import Table, check_keys, convert

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Signal: TypeAlias = NDArray[np.float64]
    Index: TypeAlias = NDArray[np.intp]

Stream: TypeAlias = "Callable[[slice | NDArray[np.intp]], Signal]"
"""Gives the signal for some rows of a log."""


class Term(msgspec.Struct, frozen=True):
    """A product of channels and a constant that is a power, divided by the drum radius with
    `by_radius`.

    The constant has the unit that the channels lack: 60 of a current is a voltage of 60 V. It is
    negative where the power subtracts the term.
    """

    channels: tuple[str, ...]
    constant: float = 1.0
    by_radius: bool = False

    @property
    def text(self) -> str:
        """The term as a rig file writes it, without its sign."""
        constant = (
            () if abs(self.constant) == 1.0 and self.channels else (f"{abs(self.constant):g}",)
        )
        factors = (*constant, *self.channels)
        return " * ".join(factors) + (" / r_drum" if self.by_radius else "")

    def scale(self, r_drum: float | None) -> float:
        """Factor that turns the product of the channels into the power. [SI unit of the power
        over those of the channels]
        """
        return self.constant / r_drum if self.by_radius and r_drum is not None else self.constant

    def watts(
        self, channels: Mapping[str, Signal], r_drum: float | None, part: slice | Index
    ) -> Signal:
        """Power in some rows of a log, all of its channels being there. [W]"""
        factors: list[Any] = [channels[name][part] for name in self.channels]
        scale = self.scale(r_drum)
        if scale != 1.0 or not factors:
            factors.append(scale)
        watts: Signal = reduce(mul, factors)
        return watts


class Power(msgspec.Struct, frozen=True, dict=True):
    """A power as a sum of terms, at least one of which has a channel; what is linear in it is
    worked out term by term.
    """

    terms: tuple[Term, ...]

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """Channels of all terms."""
        return tuple(dict.fromkeys(name for term in self.terms for name in term.channels))

    @property
    def text(self) -> str:
        """The power as a rig file writes it."""
        signed = "".join(f" {'-' if term.constant < 0 else '+'} {term.text}" for term in self.terms)
        return ("" if signed.startswith(" +") else "-") + signed[len(" + ") :]

    def known(self, channels: Collection[str], r_drum: float | None) -> bool:
        """Whether log and rig have what the power needs."""
        radius = r_drum is not None or not any(term.by_radius for term in self.terms)
        return radius and all(name in channels for name in self.channels)

    def stream(self, channels: Mapping[str, Signal], r_drum: float | None) -> Stream:
        """Power as a function of the rows of the log. [W]"""
        return lambda part: reduce(add, [term.watts(channels, r_drum, part) for term in self.terms])

    def as_read(self, turned: Collection[str]) -> Power:
        """The power for channels of which some have another sign than in the log.

        The minus sign of a single term speaks of the log: where one of its channels was turned, it
        is done already.
        """
        odd = sum(name in turned for name in self.channels) % 2 == 1
        done = len(self.terms) == 1 and self.terms[0].constant < 0 and odd
        return Power((replace(self.terms[0], constant=-self.terms[0].constant),)) if done else self


class Stage(msgspec.Struct, frozen=True):
    """One stage of a cascade. Of its `powers` the first counts that log and rig have all of.

    `where` describes the place at which the power flows.
    """

    name: str
    powers: tuple[Power, ...]
    where: str = ""

    def power(self, channels: Collection[str], r_drum: float | None) -> Power | None:
        """What the power of this stage is made of, None where log or rig lack what it needs."""
        return next((power for power in self.powers if power.known(channels, r_drum)), None)

    def stream(self, channels: Mapping[str, Signal], r_drum: float | None) -> Stream | None:
        """Power as a function of the rows of the log, None where log or rig lack what it needs.
        [W]
        """
        power = self.power(channels, r_drum)
        return None if power is None else power.stream(channels, r_drum)

    def watts(self, channels: Mapping[str, Signal], r_drum: float | None) -> Signal | None:
        """Power over the whole log, (n,), None where log or rig lack what it needs. [W]"""
        stream = self.stream(channels, r_drum)
        return None if stream is None else stream(slice(None))


_SHAFT = (
    Term(("power_mech",)),
    Term(("torque", "velocity"), by_radius=True),
    Term(("torque", "speed")),
)

BUILT_IN: dict[str, Stage] = {
    name: Stage(name, tuple(Power((term,)) for term in terms), where)
    for name, where, *terms in (
        ("line", "the line (force times speed)", Term(("force", "velocity"))),
        ("mech", "the shaft", *_SHAFT),
        ("gen", "the DC link (Vdc times Idc)", Term(("vdc", "idc"))),
        ("hyd", "the hydraulic circuit (pressure times flow)", Term(("pressure", "flow"))),
        ("ac", "the AC terminals", Term(("power_ac",))),
    )
}
"""Stages that a rig file need not define."""

ELECTRICAL = ("gen", "ac")
"""Stages that deliver nothing in an open circuit."""

_PAPER_NAMES = {
    ("line", "mech"): "eta_trans",
    ("mech", "gen"): "eta_gen",
    ("line", "gen"): "eta_pto",
}
"""Names of the efficiencies of the paper (Eq. 6), by the stage that the power comes from and the
one that it goes to.
"""

_OF_THE_LINE = {
    "payout": ("line", "payout"),
    "returned": ("line", "haul_in"),
    "net": ("line", "cycle"),
    "gen_cycle": ("gen", "cycle"),
}
"""Energies of a whole cycle: the stage whose power is integrated, and the span over which."""


class Cascade(msgspec.Struct, frozen=True):
    """Stages of a rig in the direction in which power flows; `configured` if a rig file states
    them. All else follows.

    Parameters
    ----------
    names : of the stages
    channels : that the powers may be made of, and the line velocity
    parts : each energy of a cycle with the stage whose power is integrated, and the span over
        which. A whole cycle has net energies where line and DC link belong to the cascade
    pairs : each efficiency with the stages that it leads from and to; neighbours first, then the
        whole cascade
    neighbours : efficiencies from each stage to the next
    overall : efficiency from the first stage to the last; that of a single stage to itself is never
        evaluated
    ratios : each efficiency of a window with the energies that come out and go in
    net_ratios, all_ratios : the same of whole cycles, and of both
    energies : of a window
    metrics : of a window: energies [J], mean powers [W] and efficiencies [1]
    net_metrics : of a whole cycle, which do not depend on the window: line energy of the payout,
        line energy returned in haul-in, net line energy from onset to next onset, energy at the DC
        link over the same span [J], and the ratio of the last two [1]
    all_metrics : of windows and of whole cycles
    """

    stages: tuple[Stage, ...]
    configured: bool = False
    names: tuple[str, ...] = ()
    channels: tuple[str, ...] = ()
    parts: dict[str, tuple[str, str]] = {}
    pairs: dict[str, tuple[str, str]] = {}
    neighbours: tuple[str, ...] = ()
    overall: str = ""
    ratios: dict[str, tuple[str, str]] = {}
    net_ratios: dict[str, tuple[str, str]] = {}
    all_ratios: dict[str, tuple[str, str]] = {}
    energies: tuple[str, ...] = ()
    metrics: tuple[str, ...] = ()
    net_metrics: tuple[str, ...] = ()
    all_metrics: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Derive what follows from the stages; efficiencies of the paper have its names, others
        are made of both stages.
        """
        names = tuple(stage.name for stage in self.stages)
        factors = (
            name for stage in self.stages for power in stage.powers for name in power.channels
        )
        net = {"line", "gen"} <= {*names}
        pairs = {
            _PAPER_NAMES.get((into, out)) or f"eta_{into}_{out}": (into, out)
            for into, out in (
                *pairwise(names),
                *([(names[0], names[-1])] if len(names) > 2 else []),
            )
        }
        ratios = {eta: (f"energy_{out}", f"energy_{into}") for eta, (into, out) in pairs.items()}
        net_ratios = {"eta_net": ("energy_gen_cycle", "energy_net")} if net else {}
        energies = tuple(f"energy_{name}" for name in names)
        metrics = (*energies, *(f"power_{name}" for name in names), *pairs)
        net_metrics = (*(f"energy_{name}" for name in _OF_THE_LINE), "eta_net") if net else ()
        derived = {
            "names": names,
            "channels": tuple(dict.fromkeys(("velocity", *factors))),
            "parts": {name: (name, "window") for name in names} | (_OF_THE_LINE if net else {}),
            "pairs": pairs,
            "neighbours": tuple(pairs)[: len(names) - 1],
            "overall": list(pairs)[-1] if pairs else f"eta_{names[0]}_{names[0]}",
            "ratios": ratios,
            "net_ratios": net_ratios,
            "all_ratios": ratios | net_ratios,
            "energies": energies,
            "metrics": metrics,
            "net_metrics": net_metrics,
            "all_metrics": metrics + net_metrics,
        }
        for name, value in derived.items():
            msgspec.structs.force_setattr(self, name, value)

    def as_read(self, turned: Collection[str]) -> Cascade:
        """The cascade for channels of which some have another sign than in the log."""
        stages = (
            replace(stage, powers=tuple(one.as_read(turned) for one in stage.powers))
            for stage in self.stages
        )
        return replace(self, stages=tuple(stages))

    def powers(self, channels: Collection[str], r_drum: float | None) -> dict[str, Power]:
        """What the power of each stage is made of, by name, of those for which log and rig have all
        that they need."""
        found = {stage.name: stage.power(channels, r_drum) for stage in self.stages}
        return {name: power for name, power in found.items() if power is not None}

    def streams(self, channels: Mapping[str, Signal], r_drum: float | None) -> dict[str, Stream]:
        """Power of each of these stages as a function of the rows of the log. [W]"""
        powers = self.powers(channels, r_drum)
        return {name: power.stream(channels, r_drum) for name, power in powers.items()}

    def undelivered(self, efficiency: str) -> bool:
        """Whether an efficiency is not evaluated in an open circuit, as its stage delivers
        nothing there.
        """
        return self.pairs[efficiency][1] in ELECTRICAL


@cache
def field_of(metric: str) -> str:
    """Name of a metric in written files: with its unit.

    >>> field_of("energy_line"), field_of("eta_pto")
    ('energy_line_j', 'eta_pto')
    """
    return metric + {"energy": "_j", "power": "_w"}.get(metric.partition("_")[0], "")


PAPER = Cascade(tuple(BUILT_IN[name] for name in ("line", "mech", "gen")))
"""The cascade of the paper: line, shaft, DC link."""


_RESERVED = ("payout", "returned", "net", "trans", "pto")
"""Names that metrics of whole cycles and of the paper have."""

_PRODUCTS = (
    {"force", "velocity"},
    {"torque", "rotation"},
    {"voltage", "current"},
    {"pressure", "flow"},
)
"""Dimensions of two channels whose product is a power; a constant may stand for one of them."""


class _Order(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Table [cascade]: stages in the direction in which power flows."""

    stages: Annotated[tuple[str, ...], Meta(min_length=1)]


class _Stage(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Table [stage.NAME]: power as `read_power` reads it, and the place where it flows."""

    power: str
    where: str = ""


def read_cascade(
    table: object, own: Mapping[str, Table], known: Mapping[str, Channel], rig: str
) -> Cascade:
    """Read table [cascade], None without one, and tables [stage.NAME] of a rig file; the cascade of
    the paper without any.

    RigError for an unknown stage or channel, a stage that is listed twice, and a product that is no
    power.
    """
    if table is None and not own:
        return PAPER
    stages = BUILT_IN | {
        name: _read_stage(name, stage, known, f"{rig}: [stage.{name}]")
        for name, stage in own.items()
    }
    order = (
        PAPER.names
        if table is None
        else convert(table, _Order, f"{rig}: [cascade]", RigError).stages
    )
    check_keys(order, stages, f"{rig}: [cascade] stages:", RigError)
    if len(set(order)) < len(order):
        raise RigError(f"{rig}: [cascade] stages: {', '.join(order)}; expected each stage once.")
    return Cascade(tuple(stages[name] for name in order), configured=True)


def _read_stage(name: str, raw: Table, known: Mapping[str, Channel], place: str) -> Stage:
    """The stage of a table [stage.NAME]; its name is a part of names such as `energy_hyd_j` and
    `eta_mech_hyd`.
    """
    table: _Stage = convert(raw, _Stage, place, RigError)
    if re.fullmatch(r"[A-Za-z][A-Za-z0-9]*", name) is None or name in _RESERVED:
        raise RigError(
            f"{place}: expected a name of letters and digits that is none of "
            f"{', '.join(_RESERVED)}, such as hyd."
        )
    power = read_power(table.power, known, f"{place}: power = {table.power!r}")
    return Stage(
        name, (power,), table.where or (BUILT_IN[name].where if name in BUILT_IN else power.text)
    )


def read_power(text: str, known: Mapping[str, Channel], place: str) -> Power:
    """Read a power: a formula whose terms are products of channels and constants.

    RigError, with the place of the text, for another text, an unknown channel, or a term that is no
    power.

    >>> from winchcascade.core.channels import CHANNELS
    >>> read_power("vdc * idc - 60 V * idc", CHANNELS, "rig.toml").terms[1]
    Term(channels=('idc',), constant=-60.0, by_radius=False)
    """
    power = Power(
        tuple(
            _term(term, known, place) for term in read_formula(text, known, place, RigError).terms
        )
    )
    if not power.channels:
        raise RigError(f"{place} is no power; expected at least one channel.")
    return power


def _term(term: Product, known: Mapping[str, Channel], place: str) -> Term:
    """One term of a power; RigError for a term that is no power."""
    by_radius = set(term.times) == {"torque", "velocity"} and len(term.times) == 2
    dimensions = [known[channel].dimension for channel in term.times]
    is_power = (
        by_radius
        or dimensions == ["power"]
        or (len(dimensions) == 2 and set(dimensions) in _PRODUCTS)
    )
    if term.scaled and len(dimensions) < 2:
        is_power = not dimensions or dimensions[0] in {"power"}.union(*_PRODUCTS)
    if not is_power or term.over:
        raise RigError(
            f"{place}: {' * '.join(term.times) or term.constant} is no power; expected a channel "
            f"in W, force * velocity, "
            "torque * speed, a voltage times a current, or a pressure times a flow, one of which "
            "may be a constant."
        )
    return Term(term.times, term.constant, by_radius)
