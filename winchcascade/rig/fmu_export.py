"""Write a rig as an FMU for co-simulation (FMI 2.0), which other simulators load."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from pathlib import Path

from winchcascade.core.errors import RigError
from winchcascade.core.extras import require
from winchcascade.core.files import check_ending, json_bytes, scratch_folder, write_content
from winchcascade.core.rig_file import Rig
from winchcascade.core.scales import MotionScale
from winchcascade.rig import physics
from winchcascade.rig.baseline import baseline
from winchcascade.rig.parts import (
    IN_RIG,
    PARTS,
    Model,
    every_number,
    in_rig_file,
    number_of,
    numbers_by_part,
)
from winchcascade.rig.steps import RESOLVED, STEP, rate_of_the_rotor, resolving

SCRIPT = '''"""The class that pythonfmu looks for."""

from winchcascade.rig.fmu_slave import RigSlave


class {name}(RigSlave):
    """A rig."""
'''
"""Module of an FMU."""

SLAVE = "WinchRig"
"""Class of an FMU, which simulators show as its name."""

SLOWEST_RAMP = RESOLVED / STEP
"""Ramp over the fastest time of a rotor that takes no shorter steps than that does. [1]"""

STATE = {"canGetAndSetFMUstate": True, "canSerializeFMUstate": True}
"""What simulators may do with the state of an FMU."""


def write_fmu(
    model: Model,
    path: Path,
    scale: MotionScale,
    load: float,
    about: str,
    u: Mapping[str, float],
    *,
    force: bool = False,
) -> None:
    """Write a model as an FMU.

    Parameters
    ----------
    scale : scales of the motion, which its step resolves
    load : that an FMU begins with [ohm]
    about : its description
    u : standard uncertainties of numbers by their paths, where they are known

    Raises
    ------
    OptionError : pythonfmu is not installed
    RigError : no step resolves the model
    OutputError : the file cannot be written, or is not this tool's own and `force` does not allow
        to replace it
    """
    require("pythonfmu", f"--export {path}")
    from pythonfmu.builder import FmuBuilder

    from winchcascade.rig.fmu_slave import RESOURCE

    numbers = {
        path: (number.unit, number.what, u.get(path))
        for path, number in every_number().items()
        if math.isfinite(number_of(model, path))
    }
    stated = {
        "model": numbers_by_part(model),
        "numbers": numbers,
        "description": about,
        "step": resolving(model, scale),
        "rest": physics.REST * scale.speed,
        "load": load,
    }
    with scratch_folder() as folder:
        script, resource, made = (
            folder / f"{SLAVE.lower()}.py",
            folder / RESOURCE,
            folder / "made.fmu",
        )
        script.write_text(SCRIPT.format(name=SLAVE), encoding="utf-8")
        resource.write_bytes(json_bytes(stated))
        before = list(sys.path)
        try:
            FmuBuilder.build_FMU(script, dest=made, project_files=[resource], **STATE)
        finally:
            sys.path[:] = before
            sys.modules.pop(script.stem, None)
        write_content(path, made.read_bytes(), force=force)


def write_rig(rig: Rig, path: Path, *, force: bool = False) -> None:
    """Write the model of a rig file as an FMU, for motions up to the rated speed of its machine.

    Raises
    ------
    OptionError : the name has another ending, or pythonfmu is not installed
    RigError : no model can be made of the rig, its rated speed is not stated, or no step resolves
        it
    OutputError : as `write_fmu`
    """
    check_ending(path, (".fmu",), "--export")
    model, rated = baseline(rig).physics, rig.generator.speed_rated
    if rated is None:
        raise RigError(
            f"rig {rig.name}: no speed_rated under [generator]; --export needs it, as it sets the "
            f"step of the FMU."
        )
    speed = rated.value / model.drivetrain.gear * model.winch.r_drum
    scale = MotionScale(speed, SLOWEST_RAMP / rate_of_the_rotor(model, speed), 1.0)
    u = {}
    for part in PARTS:
        for name, in_rig in in_rig_file(part).items():
            number = getattr(getattr(rig, part), in_rig)
            if number is not None and number.u is not None:
                u[f"{part}.{name}"] = number.u / IN_RIG.get(f"{part}.{name}", 1.0)
    load = rig.dc_link.r_bleed.value if rig.dc_link.r_bleed is not None else model.dc_link.r_bleed
    write_fmu(
        model,
        path,
        scale,
        load,
        f"rig {rig.name} as its file states it, not compared with logs",
        u,
        force=force,
    )
