"""How the logs of two campaigns compare as signals: noise, resolution, wobble of the crane, phases; no model takes part.

`python tests/blind/likeness.py FOLDER OTHER` prints the numbers of two campaigns side by side.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np

CHANNELS = ("displacement", "velocity", "pressure", "force", "torque", "vdc", "idc")


def moving_parts(x: Any, t: Any) -> tuple[Any, list[tuple[int, int]], list[tuple[int, int]]]:
    """Speed of the line and the ranges of its payouts and haul-ins."""
    kernel = np.hanning(11) / np.hanning(11).sum()
    v = np.convolve(np.gradient(x, t), kernel, "same")

    def ranges(mask: Any) -> list[tuple[int, int]]:
        edges = np.flatnonzero(np.diff(np.r_[0, mask.astype(int), 0]))
        return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a > 25]

    return v, ranges(v > 0.004), ranges(v < -0.004)


def white(x: Any) -> float:
    """Standard deviation of what is left of a signal in its fourth differences."""
    return float(np.sqrt(np.mean(np.diff(x, 4) ** 2) / 70.0))


def likeness(folder: Path) -> dict[str, float]:
    """Numbers of a campaign's logs by name; means over logs and cycles."""
    found: dict[str, list[float]] = {}
    for path in sorted(folder.glob("*.csv")):
        t, *signals = np.loadtxt(path, delimiter=",", skiprows=1).T
        log = dict(zip(CHANNELS, signals, strict=True))
        v, payouts, hauls = moving_parts(log["displacement"], t)
        row: dict[str, float] = {}
        rest = slice(10, payouts[0][0] - 12)
        for name in CHANNELS[1:]:
            row[f"noise of {name}"] = white(log[name][rest])
        row["force at rest, slow"] = float(np.std(np.convolve(log["force"][rest], np.ones(8) / 8, "valid")))
        for (a, b), (h0, h1) in zip(payouts, hauls, strict=True):
            top = float(np.median(v[a:b][v[a:b] > 0.9 * np.percentile(v[a:b], 99)]))
            fast = a + np.flatnonzero(v[a:b] > 0.99 * top)
            flat = v[fast[0] + 8 : fast[-1] - 16] / top
            along = np.arange(flat.size)
            row["wobble of the plateau"] = float(np.std(flat - np.polyval(np.polyfit(along, flat, 2), along)))
            row["ramp"] = t[fast[0]] - t[a]
            row["brake"] = t[b - 1] - t[fast[-1]]
            row["hold"] = t[h0] - t[b]
            row["travel"] = float(log["displacement"][b + 5] - log["displacement"][a - 5])
            row["haul-in speed"] = float(np.median(v[h0:h1][v[h0:h1] < 0.9 * v[h0:h1].min()]))
            row[f"plateau {path.stem}"] = top
            for name, value in row.items():
                found.setdefault(name, []).append(value)
    return {name: float(np.mean(values)) for name, values in found.items()}


if __name__ == "__main__":
    one, other = (likeness(Path(folder)) for folder in sys.argv[1:3])
    for name in one:
        sys.stdout.write(f"{name:24} {one[name]:10.4f} {other[name]:10.4f}\n")
