"""The model is compiled for all arrays with which simulations and diagnoses call it."""

import subprocess
import sys
from pathlib import Path

import pytest

CAMPAIGN = """
[[run]]
file = "{logs}/r36ohm.csv"
load_ohm = 36.0
window_s = 5.48
[[run]]
file = "{logs}/r9ohm.csv"
load_ohm = 9.0
window_s = 5.96
[[run]]
file = "{logs}/r4p5ohm.csv"
load_ohm = 4.5
"""

PROGRAM = """
import sys
from pathlib import Path
from numba.core.dispatcher import Dispatcher
from winchcascade.rig import bridge, kernel, readings
from winchcascade.rig.machine_code import compile_model

def compiled():
    of_modules = [one for module in (bridge, kernel, readings) for one in vars(module).values()]
    return {one.__qualname__: set(one.signatures) for one in of_modules if isinstance(one, Dispatcher)}

compile_model()
before = compiled()
names = ("run_shaft", "run_steady", "directions", "run_line", "run_readings", "_inverse")
assert all(before[name] for name in names)

from winchcascade.batch.campaign_diagnosis import diagnose_listed
from winchcascade.core.campaign_file import load_campaign
from winchcascade.report.results.drawn_reduction import drawn_report
from winchcascade.diagnosis.model_comparison import modelled
from winchcascade.reduction.uncertainty import uncertainty
from winchcascade.reduction.reduce import reduce
from winchcascade.rig.effects.catalogue import EFFECTS

found = diagnose_listed(load_campaign(Path(sys.argv[1])), EFFECTS)
reduction = reduce(found.runs[0])
drawn_report(reduction, uncertainty(reduction), model=modelled(reduction))
assert compiled() == before, (compiled(), before)
"""


@pytest.mark.slow
def test_after_compiling_nothing_is_left_to_compile(tmp_path: Path, fixtures: Path) -> None:
    (tmp_path / "campaign.toml").write_text(CAMPAIGN.format(logs=(fixtures / "campaign").as_posix()), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(tmp_path / "campaign.toml")], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
