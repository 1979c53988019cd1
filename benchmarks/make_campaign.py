"""Write many short logs for timing: three cycles of about 2,700 rows each, every log with a motion and noise of its own.

python benchmarks/make_campaign.py FOLDER --logs 1000
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from make_long_log import HEADER, LOAD, RATE, channels, velocity

ROWS = 2700
NOISE = (1e-3, 4e-3, 0.01, 6.0, 0.4, 0.3, 0.02)
"""Standard deviation of each column after the stamp, in the units of the header."""


def write_log(path: Path, rng: np.random.Generator) -> None:
    cycle = np.arange(36 * RATE) / RATE
    v = np.concatenate([velocity(cycle, speed) for speed in rng.uniform(0.82, 0.90, 3)])[:ROWS]
    t = np.arange(v.size) / RATE
    columns = [x + rng.normal(0.0, s, t.size) for x, s in zip(channels(t, v), NOISE, strict=True)]
    np.savetxt(
        path,
        np.column_stack((t, *columns)),
        fmt=["%.2f"] + ["%.5g"] * 7,
        delimiter=",",
        header=HEADER.strip(),
        comments="",
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--logs", type=int, default=1000)
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    runs = []
    for k in range(options.logs):
        name = f"run_{k:05d}.csv"
        write_log(options.folder / name, np.random.default_rng(k))
        runs.append(f'[[run]]\nfile = "{name}"\nload_ohm = {LOAD}\n')
    (options.folder / "campaign.toml").write_text(f'title = "{options.logs} logs"\n\n' + "\n".join(runs))


if __name__ == "__main__":
    main()
