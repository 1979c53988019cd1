"""The shipped logs as rows of numbers: changed, written, and read again."""

from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from synthetic import SENSORS

from winchcascade import Reduction, Run, read_run, reduce

Signal = NDArray[np.float64]

CAMPAIGN = Path(__file__).parent.parent / "fixtures" / "campaign"
NAMES = tuple(SENSORS)
HEADERS = ("Time (s)", *(sensor.header for sensor in SENSORS.values()))
WINDOW = {"r36ohm": 5.48, "r18ohm": 5.96}
"""Length of the integration window. [s]"""

ENERGY = 0.005
"""A complete cycle's energy is within this share of the clean log's: the rule by which bridging
makes it incomplete.
"""


@cache
def table(log: str = "r36ohm") -> Signal:
    rows: Signal = np.loadtxt(CAMPAIGN / f"{log}.csv", delimiter=",", skiprows=1)
    rows.flags.writeable = False
    return rows


@cache
def clean(log: str = "r36ohm") -> Reduction:
    return reduce(read_run(CAMPAIGN / f"{log}.csv"), window=WINDOW[log])


def column(name: str) -> int:
    return 1 + NAMES.index(name)


def channels(rows: Signal) -> dict[str, Signal]:
    """Channels of some rows, SI units."""
    return {name: rows[:, column(name)] * sensor.unit for name, sensor in SENSORS.items()}


def row_after_onset(seconds: float, log: str = "r36ohm", cycle: int = 1) -> int:
    """Row at a time after the onset of a cycle, which is counted from 0."""
    return int(np.searchsorted(table(log)[:, 0], clean(log).cycles[cycle].window.onset + seconds))


def written(
    folder: Path,
    rows: Signal,
    *,
    without: str | None = None,
    headers: tuple[str, ...] = HEADERS,
    load: float | None = None,
) -> Run:
    """Write rows as a log, perhaps without a column, and read it."""
    keep = [k for k in range(len(HEADERS)) if without is None or k != column(without)]
    path = folder / "log.csv"
    np.savetxt(
        path, rows[:, keep], "%.9g", ",", header=",".join(HEADERS[k] for k in keep), comments=""
    )
    return read_run(path, load=load)
