"""Write logs for timing, of the rows of the shipped campaign: one long log, or a campaign of many
short ones.

python benchmarks/make_logs.py OUT.csv --rows 14000000     155 hours, about 0.8 GB; only the stamps
differ between repetitions python benchmarks/make_logs.py FOLDER --logs 1000          each log with
noise of its own
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

LOG = Path(__file__).parent.parent / "fixtures" / "campaign" / "r36ohm.csv"
RATE, ROWS = 25, 2700
"""Rows a second, and of a short log."""

NOISE = (0.0, 1e-3, 4e-3, 0.01, 6.0, 0.4, 0.3, 0.02)
"""Standard deviation that is added to each column of a short log, in the units of the header."""


def blocks(rows: int) -> Iterator[str]:
    """The rows of the log, whole seconds of them, again and again under fresh stamps."""
    lines = LOG.read_text(encoding="utf-8").splitlines(keepends=True)[1:]
    rests = [f".{line.split('.', 1)[1]}" for line in lines[: len(lines) // RATE * RATE]]
    for start in range(0, rows, len(rests)):
        stamped = (f"{(start + k) // RATE}{rest}" for k, rest in enumerate(rests[: rows - start]))
        yield "".join(stamped)


def write_campaign(folder: Path, logs: int) -> None:
    """Write short logs and their campaign.toml."""
    folder.mkdir(parents=True, exist_ok=True)
    header, table = (
        LOG.read_text(encoding="utf-8").splitlines()[0],
        np.loadtxt(LOG, delimiter=",", skiprows=1)[:ROWS],
    )
    runs = []
    for k in range(logs):
        noisy = table + np.random.default_rng(k).normal(0.0, NOISE, table.shape)
        name = f"run_{k:05d}.csv"
        np.savetxt(
            folder / name,
            noisy,
            fmt=["%.2f"] + ["%.5g"] * 7,
            delimiter=",",
            header=header,
            comments="",
        )
        runs.append(f'[[run]]\nfile = "{name}"\nload_ohm = 36.0\n')
    (folder / "campaign.toml").write_text(
        f'title = "{logs} logs"\n\n' + "\n".join(runs), encoding="utf-8"
    )


def main() -> None:
    """Write what is asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--rows", type=int, help="of one long log")
    parser.add_argument("--logs", type=int, help="number of short logs")
    asked = parser.parse_args()
    if asked.logs is not None:
        write_campaign(asked.out, asked.logs)
        return
    with asked.out.open("w", encoding="utf-8", newline="") as file:
        file.write(LOG.read_text(encoding="utf-8").splitlines()[0] + "\n")
        file.writelines(blocks(asked.rows))


if __name__ == "__main__":
    main()
