"""The cascade of a rig: its stages in the direction in which power flows, and the metrics that follow from them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from functools import cache, cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, TypeAlias

import msgspec
from msgspec.structs import replace

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Signal: TypeAlias = NDArray[np.float64]

Stream: TypeAlias = "Callable[[slice | NDArray[np.intp]], Signal]"
"""Gives the signal for some rows of a log."""


class Product(msgspec.Struct, frozen=True):
    """A power as one logged power or as the product of two channels, divided by the drum radius with `by_radius`.

    `sign` is -1 where the log counts the power against the direction of the cascade.
    """

    channels: tuple[str, ...]
    by_radius: bool = False
    sign: float = 1.0

    def as_read(self, turned: Collection[str]) -> Product:
        """The product for channels of which some have another sign than in the log."""
        odd = sum(name in turned for name in self.channels) % 2 == 1
        return replace(self, sign=1.0) if self.sign < 0 and odd else self

    @property
    def text(self) -> str:
        """The product as a rig file writes it."""
        return "-" * (self.sign < 0) + " * ".join(self.channels) + (" / r_drum" if self.by_radius else "")

    def scale(self, r_drum: float | None) -> float:
        """Factor that turns the product of the channels into the power. [1, or 1/m with the drum radius]"""
        return self.sign / r_drum if self.by_radius and r_drum is not None else self.sign


class Stage(msgspec.Struct, frozen=True):
    """One stage of a cascade. Of its `powers` the first counts whose channels the log has.

    `where` describes the place at which the power flows.
    """

    name: str
    powers: tuple[Product, ...]
    where: str = ""

    def power(self, channels: Mapping[str, Signal], r_drum: float | None) -> Product | None:
        """Product that gives the power of this stage, None where log or rig lack what it needs."""
        for product in self.powers:
            if all(name in channels for name in product.channels) and not (product.by_radius and r_drum is None):
                return product
        return None

    def stream(self, channels: Mapping[str, Signal], r_drum: float | None) -> Stream | None:
        """Power as a function of the rows of the log, None where log or rig lack what it needs. [W]"""
        product = self.power(channels, r_drum)
        if product is None:
            return None
        sign, (x, *others) = product.sign, (channels[name] for name in product.channels)
        if not others:
            return x.__getitem__ if sign > 0 else lambda part: -x[part]
        y = others[0]
        if product.by_radius and r_drum is not None:
            signed = sign * r_drum
            return lambda part: x[part] * (y[part] / signed)
        return (lambda part: x[part] * y[part]) if sign > 0 else lambda part: -x[part] * y[part]

    def watts(self, channels: Mapping[str, Signal], r_drum: float | None) -> Signal | None:
        """Power over the whole log, (n,), None where log or rig lack what it needs. [W]"""
        stream = self.stream(channels, r_drum)
        return None if stream is None else stream(slice(None))


BUILT_IN: dict[str, Stage] = {
    stage.name: stage
    for stage in (
        Stage("line", (Product(("force", "velocity")),), "the line (force times speed)"),
        Stage(
            "mech",
            (Product(("power_mech",)), Product(("torque", "velocity"), by_radius=True), Product(("torque", "speed"))),
            "the shaft",
        ),
        Stage("gen", (Product(("vdc", "idc")),), "the DC link (Vdc times Idc)"),
        Stage("hyd", (Product(("pressure", "flow")),), "the hydraulic circuit (pressure times flow)"),
        Stage("ac", (Product(("power_ac",)),), "the AC terminals"),
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
        factors = (name for stage in self.stages for product in stage.powers for name in product.channels)
        return tuple(dict.fromkeys(("velocity", *factors)))

    @property
    def has_net(self) -> bool:
        """Whether line and DC link belong to the cascade, so that a whole cycle has net energies."""
        return {"line", "gen"} <= set(self.names)

    @cached_property
    def parts(self) -> dict[str, tuple[str, str]]:
        """Each energy of a cycle: the stage whose power is integrated, and the span over which."""
        return {name: (name, "window") for name in self.names} | (_OF_THE_LINE if self.has_net else {})

    @cached_property
    def ratios(self) -> dict[str, tuple[str, str]]:
        """Each efficiency: the energy that comes out and the one that goes in; neighbours first, then the whole cascade."""
        names = self.names
        pairs = [*pairwise(names), *([(names[0], names[-1])] if len(names) > 2 else [])]
        return {efficiency_name(*pair): (f"energy_{pair[1]}", f"energy_{pair[0]}") for pair in pairs}

    @property
    def neighbours(self) -> tuple[str, ...]:
        """Efficiencies from each stage to the next."""
        return tuple(self.ratios)[: len(self.stages) - 1]

    @property
    def overall(self) -> str:
        """Efficiency from the first stage to the last; that of a single stage to itself is never evaluated."""
        return efficiency_name(self.names[0], self.names[-1])

    @cached_property
    def net_ratios(self) -> dict[str, tuple[str, str]]:
        """Efficiency of whole cycles."""
        return {"eta_net": ("energy_gen_cycle", "energy_net")} if self.has_net else {}

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
        return (*self.energies, *(f"power_{name}" for name in self.names), *self.ratios)

    @cached_property
    def net_metrics(self) -> tuple[str, ...]:
        """Metrics of a whole cycle, which do not depend on the window: line energy of the payout, line energy returned in
        haul-in, net line energy from onset to next onset, energy at the DC link over the same span [J], and the ratio of the
        last two [1]."""
        return (*(f"energy_{name}" for name in _OF_THE_LINE), "eta_net") if self.has_net else ()

    @cached_property
    def all_metrics(self) -> tuple[str, ...]:
        """Metrics of windows and of whole cycles."""
        return self.metrics + self.net_metrics

    def as_read(self, turned: Collection[str]) -> Cascade:
        """The cascade for channels of which some have another sign than in the log.

        A minus sign of a rig file speaks of the log: where a channel of the product was turned, the minus sign is done already.
        """
        stages = tuple(replace(stage, powers=tuple(p.as_read(turned) for p in stage.powers)) for stage in self.stages)
        return self if stages == self.stages else replace(self, stages=stages)

    def between(self, efficiency: str) -> tuple[str, str]:
        """Stages that an efficiency leads from and to."""
        out, into = self.ratios[efficiency]
        return into.removeprefix("energy_"), out.removeprefix("energy_")

    def undelivered(self, efficiency: str) -> bool:
        """Whether an efficiency is not evaluated in an open circuit, as its stage delivers nothing there."""
        return self.between(efficiency)[1] in ELECTRICAL


def efficiency_name(into: str, out: str) -> str:
    """Name of the efficiency from one stage to another: that of the paper, else made of both names.

    >>> efficiency_name("mech", "gen"), efficiency_name("gen", "mech")
    ('eta_gen', 'eta_gen_mech')
    """
    return _PAPER_NAMES.get((into, out)) or f"eta_{into}_{out}"


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
