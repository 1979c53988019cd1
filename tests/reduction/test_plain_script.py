"""Efficiencies held against those of a plain script with pandas, which shares no code with the
package.
"""

import subprocess
import sys
from pathlib import Path

import pytest
from daily import daily

from winchcascade import read_run, reduce
from winchcascade.core.campaign_file import load_campaign

ROOT = Path(__file__).parent.parent.parent

PLAIN = 0.01
"""What a plain script may differ by in an efficiency: its smoothing and its windows' ends are
other ones.
"""


@pytest.mark.parametrize("window", daily([5.48, 5.96], [5.48]))
def test_a_plain_script_with_pandas_finds_the_same_efficiencies(
    window: float, tmp_path: Path
) -> None:
    pandas = pytest.importorskip("pandas")
    runs = [
        run for run in load_campaign(ROOT / "fixtures" / "campaign").runs if run.window == window
    ]
    script, out = ROOT / "benchmarks" / "with_pandas.py", tmp_path / "table.csv"
    logs = [run.file for run in runs]
    subprocess.run(
        [sys.executable, script, *logs, "--window", str(window), "--out", out], check=True
    )
    plain = pandas.read_csv(out).groupby("log").eta_pto.mean()
    assert set(plain.index) == {log.name for log in logs}
    for run in runs:
        found = reduce(read_run(run.file, load=run.load), window=run.window).mean.eta_pto
        assert plain[run.file.name] == pytest.approx(found, abs=PLAIN)
