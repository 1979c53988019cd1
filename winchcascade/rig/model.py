"""The rig as a model: its parts, filled from a rig file."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec

from winchcascade.errors import RigError
from winchcascade.quantity import ATMOSPHERE, Quantity
from winchcascade.rig.drivetrain import Drivetrain
from winchcascade.rig.generator import DcLink, Generator
from winchcascade.rig.restoring import Restoring
from winchcascade.rig.sensors import Sensors
from winchcascade.rig.winch import Winch

if TYPE_CHECKING:
    from winchcascade.rigfile import Rig


class Model(msgspec.Struct, frozen=True):
    """A rig to be simulated: parts with numbers in SI units; laws that a rig file does not know are absent."""

    winch: Winch
    restoring: Restoring
    drivetrain: Drivetrain
    generator: Generator
    dc_link: DcLink
    sensors: Sensors = Sensors()


def baseline(rig: Rig) -> Model:
    """Fill the parts from a rig file: the model that a diagnosis starts from.

    Raises
    ------
    RigError : the rig file lacks numbers that a part needs, all of them named, or the rig has no one-way clutch
    """
    missing: list[str] = []

    def number(section: str, name: str) -> float:
        value: Quantity | None = getattr(getattr(rig, section), name)
        if value is None:
            missing.append(f"{name} under [{section}]")
            return math.nan
        return value.value

    model = Model(
        winch=Winch(number("winch", "r_drum"), number("winch", "inertia")),
        restoring=Restoring(
            lead=number("restoring", "lead") / (2.0 * math.pi),
            lead_angle=number("restoring", "lead_angle"),
            half_angle=number("restoring", "half_angle"),
            mu=number("restoring", "mu_screw"),
            area=number("restoring", "area_piston"),
            pressure=number("restoring", "p_precharge") + ATMOSPHERE,
            volume=number("restoring", "volume_gas"),
        ),
        drivetrain=Drivetrain(
            gear=number("drivetrain", "gear_ratio"),
            eta_mesh=number("drivetrain", "eta_mesh"),
            b_rotor=number("drivetrain", "b_rotor"),
            k_shaft=number("drivetrain", "k_shaft"),
            c_shaft=number("drivetrain", "c_shaft"),
            inertia_rotor=number("drivetrain", "inertia_rotor"),
        ),
        generator=Generator(
            pole_pairs=number("generator", "pole_pairs"),
            k_e=number("generator", "k_e"),
            r_s=number("generator", "r_s"),
            l_s=number("generator", "l_s"),
            v_diode=number("generator", "v_diode"),
        ),
        dc_link=DcLink(number("dc_link", "c_dc"), number("dc_link", "r_bleed")),
    )
    if missing:
        raise RigError(
            f"rig {rig.name}: no model can be made, as it lacks {', '.join(missing)}; add them to the rig file "
            "(`winchcascade rig hsu2026` shows how)."
        )
    if rig.drivetrain.one_way_clutch is False:
        raise RigError(
            f"rig {rig.name}: no model can be made, as one_way_clutch under [drivetrain] is false, and the generator of the "
            "model is driven in payout alone."
        )
    return model


def possible(model: Model) -> Model:
    """The nearest model that a rig can have: no friction that drives, no gear that gives more than it takes.

    What moves a number from several sides, an effect and what is not known of the rig, may together pass such a limit.
    """
    mu, eta_mesh = model.restoring.mu, model.drivetrain.eta_mesh
    if mu >= 0.0 and eta_mesh <= 1.0:
        return model
    return msgspec.structs.replace(
        model,
        restoring=msgspec.structs.replace(model.restoring, mu=max(mu, 0.0)),
        drivetrain=msgspec.structs.replace(model.drivetrain, eta_mesh=min(eta_mesh, 1.0)),
    )
