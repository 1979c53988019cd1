"""The numbers of every shipped log, as a table that a change of the numbers must change.

`python tests/test_regression.py` writes the present numbers into `tests/regression`; what has changed is then seen in a diff.
"""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from winchcascade import Reduction, WinchcascadeError, read_run, reduce
from winchcascade.campaign import campaign_beside
from winchcascade.cascade.efficiency import METRICS

ROOT = Path(__file__).parent.parent
TABLES = Path(__file__).parent / "regression"
FOLDERS = ("campaign", "damaged_logs")
NO_LOGS = {".toml", ".json", ".md"}

WINDOW, LOAD = 5.48, 36.0
"""Of the damaged logs, all of which come from the same log: window [s] and load [ohm]."""

PLAIN = 0.01
"""What a plain script may differ by in an efficiency: its smoothing and its windows' ends are other ones."""


def reduced(log: Path) -> Reduction:
    """Reduce a shipped log by the load and the window of its campaign, a damaged one by those of its origin."""
    listed = campaign_beside(log)
    if listed is None:
        return reduce(read_run(log, load=LOAD), window=WINDOW)
    _, entry = listed
    return reduce(read_run(log, load=entry.load), window=entry.window)


def lines(log: Path) -> Iterator[str]:
    """Write the nine metrics of each cycle at six digits, an incomplete cycle in brackets; or why there are none."""
    try:
        found = reduced(log)
    except WinchcascadeError as fault:
        yield str(fault).replace(str(log), log.name)
        return
    for number, cycle in enumerate(found.cycles, 1):
        shown = f"{number}" if cycle.complete else f"({number})"
        yield f"{log.name:<20} {shown:>5} " + " ".join(_digits(getattr(cycle.metrics, name)) for name in METRICS)


def _digits(value: float | None) -> str:
    return f"{'-' if value is None else format(value, '#.6g'):>11}"


def table(folder: str) -> str:
    """Write the table of a folder of fixtures: energies [J], powers [W], efficiencies [1]."""
    logs = sorted(path for path in (ROOT / "fixtures" / folder).iterdir() if path.suffix not in NO_LOGS)
    head = f"{'log':<20} {'cycle':>5} " + " ".join(f"{name:>11}" for name in METRICS)
    return "\n".join([head, *(line for log in logs for line in lines(log))]) + "\n"


@pytest.mark.parametrize("folder", FOLDERS)
def test_the_numbers_of_every_shipped_log_are_those_on_record(folder: str) -> None:
    assert table(folder) == (TABLES / f"{folder}.txt").read_text(encoding="utf-8")


def test_every_folder_of_shipped_logs_is_on_record() -> None:
    assert sorted(path.name for path in (ROOT / "fixtures").iterdir() if path.is_dir()) == sorted(FOLDERS)
    assert sorted(path.stem for path in TABLES.iterdir()) == sorted(FOLDERS)


@pytest.mark.parametrize("window", [5.48, 5.96])
def test_a_plain_script_with_pandas_finds_the_same_efficiencies(window: float, tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    logs = [log for log in (ROOT / "fixtures" / "campaign").glob("r*.csv") if reduced_window(log) == window]
    script, out = ROOT / "benchmarks" / "with_pandas.py", tmp_path / "table.csv"
    subprocess.run([sys.executable, script, *logs, "--window", str(window), "--out", out], check=True)
    plain = pandas.read_csv(out).groupby("log").eta_pto.mean()
    assert set(plain.index) == {log.name for log in logs}
    for log in logs:
        assert plain[log.name] == pytest.approx(reduced(log).mean.eta_pto, abs=PLAIN)


def reduced_window(log: Path) -> float | None:
    """Window of a log by its campaign. [s]"""
    listed = campaign_beside(log)
    return None if listed is None else listed[1].window


if __name__ == "__main__":
    for name in FOLDERS:
        (TABLES / f"{name}.txt").write_text(table(name), encoding="utf-8")
