"""The cascade of a rig: its stages in the direction in which power flows, and the metrics that follow from them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from functools import cache, cached_property, reduce
from itertools import pairwise
from operator import add, mul
from typing import TYPE_CHECKING, Any, TypeAlias

import msgspec
from msgspec.structs import replace

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Signal: TypeAlias = NDArray[np.float64]
    Index: TypeAlias = NDArray[np.intp]

Stream: TypeAlias = "Callable[[slice | NDArray[np.intp]], Signal]"
"""Gives the signal for some rows of a log."""


class Term(msgspec.Struct, frozen=True):
    """A product of channels and a constant that is a power, divided by the drum radius with `by_radius`.

    The constant has the unit that the channels lack: 60 of a current is a voltage of 60 V. It is negative where the power
    subtracts the term.
    """

    channels: tuple[str, ...]
    constant: float = 1.0
    by_radius: bool = False

    @property
    def text(self) -> str:
        """The term as a rig file writes it, without its sign."""
        factors = (
            self.channels
            if abs(self.constant) == 1.0 and self.channels
            else (f"{abs(self.constant):g}", *self.channels)
        )
        return " * ".join(factors) + (" / r_drum" if self.by_radius else "")

    def scale(self, r_drum: float | None) -> float:
        """Factor that turns the product of the channels into the power. [SI unit of the power over those of the channels]"""
        return self.constant / r_drum if self.by_radius and r_drum is not None else self.constant

    def watts(self, channels: Mapping[str, Signal], r_drum: float | None, part: slice | Index) -> Signal:
        """Power in some rows of a log, all of its channels being there. [W]"""
        factors: list[Any] = [channels[name][part] for name in self.channels]
        scale = self.scale(r_drum)
        if scale != 1.0 or not factors:
            factors.append(scale)
        watts: Signal = reduce(mul, factors)
        return watts


class Power(msgspec.Struct, frozen=True):
    """A power as a sum of terms, at least one of which has a channel; what is linear in it is worked out term by term."""

    terms: tuple[Term, ...]

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels of all terms."""
        return tuple(dict.fromkeys(name for term in self.terms for name in term.channels))

    @property
    def text(self) -> str:
        """The power as a rig file writes it."""
        signed = "".join(f" {'-' if term.constant < 0 else '+'} {term.text}" for term in self.terms)
        return signed.removeprefix(" + ") if signed.startswith(" +") else "-" + signed.removeprefix(" - ")

    def known(self, channels: Collection[str], r_drum: float | None) -> bool:
        """Whether log and rig have what the power needs."""
        radius = r_drum is not None or not any(term.by_radius for term in self.terms)
        return radius and all(name in channels for name in self.channels)

    def stream(self, channels: Mapping[str, Signal], r_drum: float | None) -> Stream:
        """Power as a function of the rows of the log. [W]"""
        return lambda part: reduce(add, [term.watts(channels, r_drum, part) for term in self.terms])

    def as_read(self, turned: Collection[str]) -> Power:
        """The power for channels of which some have another sign than in the log.

        The minus sign of a single term speaks of the log: where one of its channels was turned, it is done already.
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
        """Power as a function of the rows of the log, None where log or rig lack what it needs. [W]"""
        power = self.power(channels, r_drum)
        return None if power is None else power.stream(channels, r_drum)

    def watts(self, channels: Mapping[str, Signal], r_drum: float | None) -> Signal | None:
        """Power over the whole log, (n,), None where log or rig lack what it needs. [W]"""
        stream = self.stream(channels, r_drum)
        return None if stream is None else stream(slice(None))


def _built_in(name: str, where: str, *terms: Term) -> Stage:
    """A stage whose power may be made of any of some terms."""
    return Stage(name, tuple(Power((term,)) for term in terms), where)


_SHAFT = Term(("power_mech",)), Term(("torque", "velocity"), by_radius=True), Term(("torque", "speed"))

BUILT_IN: dict[str, Stage] = {
    stage.name: stage
    for stage in (
        _built_in("line", "the line (force times speed)", Term(("force", "velocity"))),
        _built_in("mech", "the shaft", *_SHAFT),
        _built_in("gen", "the DC link (Vdc times Idc)", Term(("vdc", "idc"))),
        _built_in("hyd", "the hydraulic circuit (pressure times flow)", Term(("pressure", "flow"))),
        _built_in("ac", "the AC terminals", Term(("power_ac",))),
    )
}
"""Stages that a rig file need not define."""

ELECTRICAL = ("gen", "ac")
"""Stages that deliver nothing in an open circuit."""

_PAPER_NAMES = {("line", "mech"): "eta_trans", ("mech", "gen"): "eta_gen", ("line", "gen"): "eta_pto"}
"""Names of the efficiencies of the paper (Eq. 6), by the stage that the power comes from and the one that it goes to."""

_OF_THE_LINE = {
    "payout": ("line", "payout"),
    "returned": ("line", "haul_in"),
    "net": ("line", "cycle"),
    "gen_cycle": ("gen", "cycle"),
}
"""Energies of a whole cycle: the stage whose power is integrated, and the span over which."""


class Cascade(msgspec.Struct, frozen=True, dict=True):
    """Stages of a rig in the direction in which power flows; `configured` if a rig file states them."""

    stages: tuple[Stage, ...]
    configured: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the stages."""
        return tuple(stage.name for stage in self.stages)

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels that the powers may be made of, and the line velocity."""
        factors = (name for stage in self.stages for power in stage.powers for name in power.channels)
        return tuple(dict.fromkeys(("velocity", *factors)))

    @cached_property
    def parts(self) -> dict[str, tuple[str, str]]:
        """Each energy of a cycle: the stage whose power is integrated, and the span over which. A whole cycle has net energies
        where line and DC link belong to the cascade.
        """
        return {name: (name, "window") for name in self.names} | (
            _OF_THE_LINE if {"line", "gen"} <= {*self.names} else {}
        )

    @cached_property
    def pairs(self) -> dict[str, tuple[str, str]]:
        """Each efficiency: the stage that it leads from and the one that it leads to; neighbours first, then the whole cascade.

        Those of the paper have its names, others are made of both stages.
        """
        names = self.names
        pairs = [*pairwise(names), *([(names[0], names[-1])] if len(names) > 2 else [])]
        return {_PAPER_NAMES.get(pair) or f"eta_{pair[0]}_{pair[1]}": pair for pair in pairs}

    @cached_property
    def ratios(self) -> dict[str, tuple[str, str]]:
        """Each efficiency of a window: the energy that comes out and the one that goes in."""
        return {eta: (f"energy_{out}", f"energy_{into}") for eta, (into, out) in self.pairs.items()}

    @property
    def neighbours(self) -> tuple[str, ...]:
        """Efficiencies from each stage to the next."""
        return tuple(self.pairs)[: len(self.stages) - 1]

    @property
    def overall(self) -> str:
        """Efficiency from the first stage to the last; that of a single stage to itself is never evaluated."""
        return (*self.pairs, f"eta_{self.names[0]}_{self.names[0]}")[max(len(self.pairs) - 1, 0)]

    @cached_property
    def net_ratios(self) -> dict[str, tuple[str, str]]:
        """Efficiency of whole cycles."""
        return {"eta_net": ("energy_gen_cycle", "energy_net")} if "net" in self.parts else {}

    @cached_property
    def all_ratios(self) -> dict[str, tuple[str, str]]:
        """Efficiencies of windows and of whole cycles."""
        return self.ratios | self.net_ratios

    @cached_property
    def energies(self) -> tuple[str, ...]:
        """Names of the energies of a window."""
        return tuple(f"energy_{name}" for name in self.names)

    @cached_property
    def metrics(self) -> tuple[str, ...]:
        """Metrics of a window: energies [J], mean powers [W] and efficiencies [1]."""
        return (*self.energies, *(f"power_{name}" for name in self.names), *self.pairs)

    @cached_property
    def net_metrics(self) -> tuple[str, ...]:
        """Metrics of a whole cycle, which do not depend on the window: line energy of the payout, line energy returned in
        haul-in, net line energy from onset to next onset, energy at the DC link over the same span [J], and the ratio of the
        last two [1]."""
        return (*(f"energy_{name}" for name in self.parts if name in _OF_THE_LINE), *self.net_ratios)

    @cached_property
    def all_metrics(self) -> tuple[str, ...]:
        """Metrics of windows and of whole cycles."""
        return self.metrics + self.net_metrics

    def as_read(self, turned: Collection[str]) -> Cascade:
        """The cascade for channels of which some have another sign than in the log."""
        return replace(
            self, stages=tuple(replace(s, powers=tuple(p.as_read(turned) for p in s.powers)) for s in self.stages)
        )

    def between(self, efficiency: str) -> tuple[str, str]:
        """Stages that an efficiency leads from and to."""
        return self.pairs[efficiency]

    def undelivered(self, efficiency: str) -> bool:
        """Whether an efficiency is not evaluated in an open circuit, as its stage delivers nothing there."""
        return self.pairs[efficiency][1] in ELECTRICAL


@cache
def field_of(metric: str) -> str:
    """Name of a metric in written files: with its unit.

    >>> field_of("energy_line"), field_of("eta_pto")
    ('energy_line_j', 'eta_pto')
    """
    return metric + _SUFFIX.get(metric.partition("_")[0], "")


_SUFFIX = {"energy": "_j", "power": "_w"}


PAPER = Cascade(tuple(BUILT_IN[name] for name in ("line", "mech", "gen")))
"""The cascade of the paper: line, shaft, DC link."""
