"""Compile the model into machine code that numba keeps beside the package, so that no later process compiles it again.

python -m winchcascade.rig.machine_code
"""

import numpy as np

from winchcascade.core.rig_toml import built_in
from winchcascade.rig.baseline import baseline
from winchcascade.rig.bridge import back_emfs, blended_table
from winchcascade.rig.effects.catalogue import SIMPLIFICATIONS
from winchcascade.rig.kernel import SHAFT, constants
from winchcascade.rig.readings import TRUE, path_of, run_readings, sensor_numbers
from winchcascade.rig.simulate import READ, even_motion, solve


def compile_model() -> None:
    """Solve a short motion, with arrays of the layouts that simulations, fits and stages use."""
    motion = even_motion(np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.5, 0.0]), 0.01)
    model = SIMPLIFICATIONS["quasi_static"].fields[0].apply(baseline(built_in()), 0.5)
    solution = solve(model, motion, 36.0)
    seen = solution[:, [SHAFT.index("clutch"), SHAFT.index("vdc")]].T.copy()
    size, sensors = motion.t.size, sensor_numbers(model, np.zeros(len(READ)), motion.step)
    true, read = np.empty((TRUE, size)), np.empty((len(READ), size))
    run_readings(path_of(motion), constants(model, 36.0), seen, sensors, true, read)
    back_emfs(motion.v, motion.v, 0.5, motion.v, blended_table(0.0, 0.0))


if __name__ == "__main__":
    compile_model()
