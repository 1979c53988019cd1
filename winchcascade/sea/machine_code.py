"""Compile the model into machine code that numba keeps beside the package, so that no later process
compiles it again.

python -m winchcascade.sea.machine_code
"""

import numpy as np

from winchcascade.core.rig_toml import built_in
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import SIMPLIFICATIONS
from winchcascade.rig.simulate import even_motion, solve
from winchcascade.rig.stepped_rig import SteppedRig
from winchcascade.sea.coupled import float_in_waves
from winchcascade.sea.hydrodynamics import Hydrodynamics
from winchcascade.sea.in_sea import fixed, run
from winchcascade.sea.wave_spectra import SeaState, realised


def compile_model() -> None:
    """Solve a short motion, with arrays of the layouts that simulations, fits, stages, seas and
    FMUs use.
    """
    motion = even_motion(np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.5, 0.0]), 0.01, 0.005)
    rig = baseline(built_in())
    solve(SIMPLIFICATIONS["quasi_static"].fields[0].apply(rig, 0.5), motion, 36.0)
    SteppedRig(rig.physics, 0.01, 0.005).advance(0.1, 0.01, 36.0)
    omega = np.linspace(0.1, 10.0, 20)
    body = Hydrodynamics(
        omega, 400.0 + 0.0 * omega, omega, (9e3 + 0.0 * omega).astype(np.complex128), 900.0, 9e3
    )
    path, _ = float_in_waves(
        rig.physics, realised(SeaState(0.1, 4.0), 8.0, 0), body, 4.0, 1.0, fixed(36.0)
    )
    run(rig.physics, path, fixed(36.0))


if __name__ == "__main__":
    compile_model()
