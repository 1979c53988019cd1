"""Compile the model into machine code that numba keeps beside the package, so that no later process compiles it again.

python -m winchcascade.rig.machine_code
"""

from __future__ import annotations

import numpy as np

from winchcascade.core.rig_toml import built_in
from winchcascade.rig.baseline import baseline
from winchcascade.rig.bridge import back_emfs, blended_table
from winchcascade.rig.kernel import (
    LINE,
    SHAFT,
    constants,
    directions,
    driven_shaft,
    run_line,
    run_steady,
    solve_shaft,
)
from winchcascade.rig.readings import TRUE, path_of, run_readings, sensor_numbers
from winchcascade.rig.simulate import READ, even_motion


def compile_model() -> None:
    """Solve a short motion, with arrays of the layouts that simulations, fits and stages use."""
    motion = even_motion(np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.5, 0.0]), 0.01)
    model = baseline(built_in())
    numbers, table = constants(model, 36.0), blended_table(0.0, 0.0)
    shaft = solve_shaft(motion.v, motion.step, numbers)
    run_steady(driven_shaft(motion.v, motion.step, numbers), 0.0, 1, np.empty_like(shaft))
    run_line(motion, directions(motion.v), numbers, shaft[:, 0].copy(), np.empty((motion.t.size, len(LINE))))
    solved = shaft[:, [SHAFT.index("clutch"), SHAFT.index("vdc")]].T.copy()
    sensors = sensor_numbers(model, np.zeros(len(READ)), motion.step)
    run_readings(
        path_of(motion), numbers, solved, sensors, np.empty((TRUE, motion.t.size)), np.empty((len(READ), motion.t.size))
    )
    back_emfs(motion.v, motion.v, 0.5, motion.v, table)


if __name__ == "__main__":
    compile_model()
