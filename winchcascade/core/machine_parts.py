"""Parts of the machine as a rig file states them, and what their numbers measure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from typing import Annotated, Any, Literal, get_args

import msgspec
from msgspec import Meta

from winchcascade.core.quantity import Quantity
from winchcascade.core.toml_file import NotNegative, Positive, ShareOfAll, struct_fields


class Measure(msgspec.Struct, frozen=True):
    """What a number of a rig file measures, as an annotation of its field, and the type of possible
    values in SI units: beyond them no rig is known, and the unit or the number is wrong.
    """

    dimension: str
    si: Any = NotNegative


@cache
def measures(kind: type[msgspec.Struct]) -> dict[str, Measure]:
    """What the numbers of a part of a rig measure, by their names."""
    return {
        f.name: note
        for f in struct_fields(kind)
        for note in get_args(f.type)
        if isinstance(note, Measure)
    }


class Winch(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The drum that the tether turns.

    `motion` is where displacement and velocity are measured: by an encoder on the drum, which
    counts radius times angle, or on the line itself. A velocity that a reduction makes of the speed
    of the shaft is of the drum in any case. `line_can_push` of a rod or a rack in its place: the
    force of the line then has both signs, and is never slack.
    """

    r_drum: Annotated[
        Quantity | None, Measure("length", Annotated[float, Meta(ge=1e-3, le=100.0)])
    ] = None
    inertia: Annotated[Quantity | None, Measure("inertia")] = None
    motion: Literal["drum", "line"] = "drum"
    line_can_push: bool = False


RestoringKind = Literal["gas_screw", "spring", "counterweight", "none"]
"""What keeps the tether taut."""

NUMBERS_OF: Mapping[RestoringKind, tuple[str, ...]] = {
    "gas_screw": (
        "lead",
        "lead_angle",
        "half_angle",
        "mu_screw",
        "area_piston",
        "p_precharge",
        "volume_gas",
    ),
    "spring": ("force", "stiffness"),
    "counterweight": ("mass",),
    "none": (),
}
"""Numbers that a model needs of each kind of restoring module."""

WITH_FRICTION: tuple[RestoringKind, ...] = ("spring", "counterweight")
"""Kinds that may state a friction; that of a screw is `mu_screw`."""


class Restoring(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What keeps the tether taut: screw, piston and gas-charged accumulator, a spring, a
    counterweight, or nothing.

    `force` of a spring at zero payout, its `stiffness` and the `friction` against the motion are
    those that the line feels.
    """

    kind: RestoringKind = "gas_screw"
    lead: Annotated[Quantity | None, Measure("lead", Positive)] = None
    lead_angle: Annotated[Quantity | None, Measure("angle")] = None
    half_angle: Annotated[Quantity | None, Measure("angle")] = None
    mu_screw: Annotated[Quantity | None, Measure("number")] = None
    area_piston: Annotated[Quantity | None, Measure("area", Positive)] = None
    p_precharge: Annotated[Quantity | None, Measure("pressure")] = None
    volume_gas: Annotated[Quantity | None, Measure("volume", Positive)] = None
    force: Annotated[Quantity | None, Measure("force")] = None
    stiffness: Annotated[Quantity | None, Measure("line_stiffness")] = None
    mass: Annotated[Quantity | None, Measure("force", Positive)] = (
        None  # by its weight: a kg is read as a kgf
    )
    friction: Annotated[Quantity | None, Measure("force")] = None

    def __post_init__(self) -> None:
        """Reject numbers of another kind: ValueError."""
        other = [
            name
            for name in measures(Restoring)
            if getattr(self, name) is not None and name not in self.own
        ]
        if other:
            raise ValueError(
                f"{', '.join(other)} of another kind of restoring module: kind is {self.kind}, "
                f"which has "
                f"{', '.join(self.own) or 'no number'}. State the kind, or remove what it does "
                f"not have."
            )

    @property
    def needed(self) -> tuple[str, ...]:
        """Numbers that a model needs."""
        return NUMBERS_OF[self.kind]

    @property
    def own(self) -> tuple[str, ...]:
        """Numbers that it may have."""
        return (*self.needed, "friction") if self.kind in WITH_FRICTION else self.needed

    @property
    def has_gas(self) -> bool:
        """Whether screw, piston and gas are there, and a pressure."""
        return self.kind == "gas_screw"


class Drivetrain(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Clutch, shaft, gear and high-speed shaft between drum and generator.

    With the gear ratio 1 the machine is on the shaft of the drum. `one_way_clutch` is None where
    the file does not state it: the model then has one, and bins hold whole payouts.
    """

    gear_ratio: Annotated[
        Quantity | None, Measure("number", Annotated[float, Meta(ge=1e-3, le=1e5)])
    ] = None
    eta_mesh: Annotated[Quantity | None, Measure("number", ShareOfAll)] = None
    b_rotor: Annotated[Quantity | None, Measure("damping")] = None
    k_shaft: Annotated[Quantity | None, Measure("stiffness")] = None
    c_shaft: Annotated[Quantity | None, Measure("damping")] = None
    inertia_rotor: Annotated[Quantity | None, Measure("inertia")] = None
    one_way_clutch: bool | None = None

    @property
    def direct(self) -> bool:
        """Whether there is no gear, so that its mesh efficiency is 1."""
        return (
            self.gear_ratio is not None and self.gear_ratio.value == 1.0 and self.eta_mesh is None
        )


class Generator(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Permanent-magnet machine and its diode bridge."""

    pole_pairs: Annotated[Quantity | None, Measure("number")] = None
    k_e: Annotated[Quantity | None, Measure("back_emf", Positive)] = None
    r_s: Annotated[Quantity | None, Measure("resistance")] = None
    l_s: Annotated[Quantity | None, Measure("inductance")] = None
    v_diode: Annotated[Quantity | None, Measure("voltage")] = None
    speed_rated: Annotated[Quantity | None, Measure("rotation")] = None
    i_rated: Annotated[Quantity | None, Measure("current")] = None


_LoadPercent = Annotated[float, Meta(ge=0.0, lt=1e9)]


class DcLink(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Capacitor, bleed resistance and load behind the bridge.

    The uncertainty of a load is one standard uncertainty or the +- limits of its maker, in percent
    of the load.
    """

    c_dc: Annotated[Quantity | None, Measure("capacitance")] = None
    r_bleed: Annotated[Quantity | None, Measure("resistance")] = None
    load_u_percent: _LoadPercent = 0.0
    load_limits_percent: _LoadPercent = 0.0

    def __post_init__(self) -> None:
        """Reject two uncertainties of a load: ValueError."""
        if self.load_u_percent and self.load_limits_percent:
            raise ValueError(
                "load_u_percent and load_limits_percent are both there; expected one of them."
            )

    @property
    def load_u(self) -> float:
        """Standard uncertainty of a load as a share of it; limits are those of a rectangular
        distribution. [1]
        """
        return (self.load_u_percent + self.load_limits_percent / math.sqrt(3.0)) / 100.0
