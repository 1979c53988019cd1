"""A small campaign with a known cause and its diagnosis, as several tests of the report use
them.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np
from rigs import calibrated_rig

from winchcascade.diagnosis.diagnose import ModelDiagnosis, diagnose
from winchcascade.ingest.read import read_run
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import EFFECTS, make_effect
from winchcascade.rig.simulate import simulate, write_log

if TYPE_CHECKING:
    from winchcascade.core.run import Run
    from winchcascade.rig.simulate import Simulation

FIXTURES = Path(__file__).parents[1] / "fixtures" / "campaign"
LOGS = {"r18ohm.csv": 18.0, "r4p5ohm.csv": 4.5}
NOISE = {"pressure": 1500.0, "force": 8.0, "torque": 0.5, "vdc": 0.15, "idc": 0.012}
"""Standard deviation of the noise of a sample, SI units."""

SUSPECTS = ("ke_rolloff", "copper_heating", "line_drag", "force_zero")

Planted = dict[str, dict[str, float]]

PLANTED: dict[str, Planted] = {
    "copper": {"copper_heating": {"r_s_change": 0.4}},
    "rolloff": {"ke_rolloff": {"lost_to_1p4": 0.04, "lost_to_1p8": 0.08}},
    "nothing": {},
    "outsider": {"gear_mesh_loss": {"efficiency_change": -0.06}},
    "drags": {"rotor_viscous": {"b_extra": 0.0008}, "clutch_drag": {"torque": 3.0}},
}
"""What a campaign hides; the last two are not among the suspects."""


def made_logs(effects: Planted, seconds: float = 75.0) -> list[Simulation]:
    """Logs of a rig with some effects, along motions of the packaged campaign, with noise of
    their own.
    """
    rng = np.random.default_rng(7)
    model = baseline(calibrated_rig())
    for name, fields in effects.items():
        model = make_effect(name, fields).apply(model)
    made = [simulate(_part(file, load, seconds), model) for file, load in LOGS.items()]
    return [msgspec.structs.replace(one, run=_noisy(one.run, rng)) for one in made]


def _part(file: str, load: float, seconds: float) -> Run:
    run = read_run(FIXTURES / file, load=load)
    own = run.t <= run.t[0] + seconds
    channels = {name: x[own] for name, x in run.channels.items()}
    return msgspec.structs.replace(
        run, t=run.t[own], channels=channels, samples=int(own.sum()), gaps={}, findings=()
    )


def _noisy(run: Run, rng: np.random.Generator) -> Run:
    noisy = {
        name: run.channels[name] + rng.normal(0.0, sd, run.t.size) for name, sd in NOISE.items()
    }
    return msgspec.structs.replace(run, channels={**run.channels, **noisy}, simulated=True)


def write_campaign(
    folder: Path, effects: Planted, *, more: str = "", seconds: float = 75.0
) -> Path:
    """Write such logs with their campaign.toml; `more` stands in the entry of the last."""
    lines = ['title = "a campaign of two loads"']
    for one, (name, load) in zip(made_logs(effects, seconds), LOGS.items(), strict=True):
        write_log(one, folder / name)
        lines += ["[[run]]", f'file = "{name}"', f"load_ohm = {load}"]
    (folder / "campaign.toml").write_text("\n".join([*lines, more]) + "\n", encoding="utf-8")
    return folder


@cache
def diagnosed(name: str) -> ModelDiagnosis:
    """The diagnosis of one of `PLANTED`, with few suspects."""
    suspects = {suspect: EFFECTS[suspect] for suspect in SUSPECTS}
    runs = [one.run for one in made_logs(PLANTED[name])]
    return diagnose(runs, calibrated_rig(), suspects, title=f"a campaign of {name}", seed=1)
