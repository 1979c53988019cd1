"""The model is compiled for all arrays with which simulations and diagnoses call it."""

import subprocess
import sys
from pathlib import Path

import pytest

CAMPAIGN = "".join(
    f'[[run]]\nfile = "{{logs}}/{name}.csv"\nload_ohm = {load}\n'
    for name, load in (("r36ohm", 36.0), ("r9ohm", 9.0), ("r4p5ohm", 4.5))
)

PROGRAM = """
import sys
from pathlib import Path
from numba.core.dispatcher import Dispatcher
from winchcascade.rig import bridge, kernel
from winchcascade.rig.machine_code import compile_model

def compiled():
    of_modules = [one for module in (bridge, kernel) for one in vars(module).values()]
    return {one.__qualname__: set(one.signatures) for one in of_modules if isinstance(one, Dispatcher)}

compile_model()
before = compiled()
assert all(before[name] for name in ("run_shaft", "run_steady", "run_line", "_inverse"))

from winchcascade.batch.campaign_diagnosis import diagnose_listed
from winchcascade.core.campaign_file import load_campaign
from winchcascade.diagnosis.model_comparison import modelled
from winchcascade.reduction.reduce import reduce
from winchcascade.rig.effects.catalogue import EFFECTS

found = diagnose_listed(load_campaign(Path(sys.argv[1])), EFFECTS)
modelled(reduce(found.runs[0]))
assert compiled() == before, (compiled(), before)
"""


@pytest.mark.slow
def test_after_compiling_nothing_is_left_to_compile(tmp_path: Path, fixtures: Path) -> None:
    campaign = tmp_path / "campaign.toml"
    campaign.write_text(CAMPAIGN.format(logs=(fixtures / "campaign").as_posix()), encoding="utf-8")
    done = subprocess.run([sys.executable, "-c", PROGRAM, str(campaign)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
