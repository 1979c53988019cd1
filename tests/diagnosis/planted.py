"""Small campaigns with an effect that is known: simulated along shipped logs, with noise and
zeros as a logger has them.
"""

import math
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import msgspec
import numpy as np
from rigs import calibrated_rig

from winchcascade.core.run import Run
from winchcascade.ingest.read import read_run
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import make_effect
from winchcascade.rig.simulate import simulate

CAMPAIGN = Path(__file__).parent.parent.parent / "fixtures" / "campaign"
LOGS = {"open_circuit.csv": math.inf, "r36ohm.csv": 36.0, "r9ohm.csv": 9.0}
NOISE = {
    "velocity": 0.003,
    "pressure": 980.0,
    "force": 4.5,
    "torque": 0.38,
    "vdc": 0.23,
    "idc": 0.014,
}
ZERO = {"pressure": 2942.0, "force": 2.0, "torque": 0.3, "idc": 0.005}


@cache
def driven() -> tuple[Run, ...]:
    """Logs whose motion drives the campaigns, at the loads of `LOGS`; of each, the first cycle."""
    runs = (read_run(CAMPAIGN / name, load=load) for name, load in LOGS.items())
    return tuple(_first_cycle(run) for run in runs)


def _first_cycle(run: Run) -> Run:
    last = int(np.argmax(run.t > 45.0)) or run.t.size
    return msgspec.structs.replace(
        run,
        t=run.t[:last],
        samples=last,
        channels={name: x[:last] for name, x in run.channels.items()},
    )


def campaign(effects: Mapping[str, Mapping[str, float]], seed: int = 0) -> list[Run]:
    """A campaign with some effects of the catalogue, by name and field."""
    model = baseline(calibrated_rig())
    for name, values in effects.items():
        model = make_effect(name, values).apply(model)
    rng = np.random.default_rng(seed)
    return [logged(simulate(run, model).run, rng) for run in driven()]


def logged(run: Run, rng: np.random.Generator) -> Run:
    """A simulated run as a logger has it: with noise and zeros."""
    channels = {}
    for name, x in run.channels.items():
        noise = rng.normal(0.0, NOISE[name], x.size) if name in NOISE else 0.0
        channels[name] = x + noise + rng.normal(0.0, ZERO.get(name, 0.0))
    channels["velocity"] = run.channels["velocity"] + rng.normal(0.0, NOISE["velocity"], run.t.size)
    return msgspec.structs.replace(run, channels=channels)
