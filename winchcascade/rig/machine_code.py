"""Compile the model into machine code that numba keeps beside the package, so that no later process compiles it again.

python -m winchcascade.rig.machine_code
"""

import numpy as np

from winchcascade.core.rig_toml import built_in
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import SIMPLIFICATIONS
from winchcascade.rig.simulate import even_motion, solve


def compile_model() -> None:
    """Solve a short motion, with arrays of the layouts that simulations, fits and stages use."""
    motion = even_motion(np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.5, 0.0]), 0.01, 0.005)
    solve(SIMPLIFICATIONS["quasi_static"].fields[0].apply(baseline(built_in()), 0.5), motion, 36.0)


if __name__ == "__main__":
    compile_model()
