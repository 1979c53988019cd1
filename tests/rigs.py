"""Rigs of the labelled campaigns: the baseline with a campaign's own numbers."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from winchcascade.core.quantity import KGF
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Run
from winchcascade.core.scales import MotionScale, Scales, motion_of_runs, scales_of
from winchcascade.diagnosis.fit.block_means import Blocks, blocks_of
from winchcascade.diagnosis.fit.entries import bound_to
from winchcascade.diagnosis.fit.predict import Course
from winchcascade.diagnosis.fit.suspects import Suspects
from winchcascade.rig.baseline import baseline, load_rig
from winchcascade.rig.effects.catalogue import EFFECTS
from winchcascade.rig.kernel import COLUMNS, LineMotion
from winchcascade.rig.parts import Model, with_part
from winchcascade.rig.simulate import motion_of, solve
from winchcascade.rig.stages import StageOutput, along, outputs_along
from winchcascade.rig.steps import COARSE, resolving

LOADS = {
    "open_circuit": math.inf, "r45ohm": 45.0, "r36ohm": 36.0, "r27ohm": 27.0, "r18ohm": 18.0, "r9ohm": 9.0, "r4p5ohm": 4.5,
}  # fmt: skip


@cache
def calibrated_rig() -> Rig:
    """The rig of the rebuilt campaign: that of the paper, whose sensors are calibrated in place."""
    return load_rig(Path(__file__).parent.parent / "fixtures" / "campaign" / "rig.toml")


def own_model(truth: dict[str, Any]) -> Model:
    """The model of a labelled campaign without its hidden effect."""
    number, model = truth["rig"], baseline(built_in()).physics
    gas = {
        "mu": number["mu_screw"],
        "area": number["area"],
        "pressure": number["p0"],
        "volume": number["v_gas"],
    }
    model = with_part(model, "restoring", **gas)
    model = with_part(model, "drivetrain", eta_mesh=number["eta_gear"], b_rotor=number["b_visc"])
    model = with_part(model, "generator", k_e=number["ke_ll"], r_s=number["rs"], l_s=number["ls"])
    return with_part(model, "dc_link", c_dc=number["c_dc"])


def truth_of(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "truth.json").read_text())  # type: ignore[no-any-return]


def scale_of(run: Run) -> MotionScale:
    """Scales of the motion of one log."""
    return motion_of_runs([run])


def scales_on(rig: Rig, runs: Sequence[Run]) -> Scales:
    """Scales of some logs on a rig."""
    return scales_of(rig, motion_of_runs(runs))


def motion_along(run: Run, step: float) -> LineMotion:
    """The motion of one log at even steps. [s]"""
    return motion_of(run, step, scale_of(run))


def blocks_on(run: Run, rig: Rig, cycles: tuple[int, int] | None = None) -> Blocks:
    """One log in blocks."""
    return blocks_of(run, rig, scale_of(run).ramp, cycles)


def course_of(run: Run, rig: Rig, cycles: tuple[int, int] | None = None) -> Course:
    """The motion of one log, as a fit to it alone has it."""
    scale = scale_of(run)
    return Course(run, blocks_on(run, rig, cycles), resolving(baseline(rig), scale, COARSE), scale)


def suspects_on(rig: Rig, runs: Sequence[Run]) -> Suspects:
    """The suspects of a diagnosis of some logs."""
    return bound_to(EFFECTS, rig, runs, scales_on(rig, runs))


def stage_outputs(run: Run, model: Model) -> tuple[StageOutput, ...]:
    """What each stage makes of its own inputs, the clutch as the model has it along the motion."""
    scale = scale_of(run)
    motion = motion_along(run, resolving(model, scale))
    clutch = solve(model, motion, math.inf if run.load is None else run.load)[
        :, COLUMNS.index("clutch")
    ]
    return outputs_along(run, model, along(run, motion, scale.ramp, clutch))


SENSORS = ("pressure", "force", "torque", "vdc", "idc")

PLATEAU_SHARE = {"torque": 0.015, "vdc": 0.01, "idc": 0.01}
ABSOLUTE = {"pressure": 0.1 * KGF * 1e4, "force": 20.0}
"""Largest rms difference during payout: shares of the plateau; 0.1 kg/cm2; 20 N, which the
tether's ringing sets.
"""


def assert_followed(run: Run, simulated: Run, gains: Mapping[str, float]) -> None:
    """A simulation follows the sensors of a log, whose gains are known, in payout."""
    motion = motion_along(run, 1e-3)
    speed = np.interp(run.t, motion.t, motion.v)
    payout, plateau = speed > 0.03, speed > 0.95 * speed.max()
    for name in ("pressure", "force", "vdc") if run.open_circuit else SENSORS:
        measured = run.channels[name] / gains[name]
        rms = float(np.sqrt(np.mean((simulated.channels[name] - measured)[payout] ** 2)))
        maximum = ABSOLUTE.get(name) or PLATEAU_SHARE[name] * float(np.mean(measured[plateau]))
        assert rms < maximum, (run.path, name)


def logs_of(folder: Path) -> Iterator[tuple[Path, float]]:
    for name, load in LOADS.items():
        yield folder / f"{name}.csv", load
