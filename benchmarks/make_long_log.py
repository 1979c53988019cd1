"""Write a long log for timing: twenty noisy cycles and a little idling, repeated under fresh stamps at 25 Hz.

    python benchmarks/make_long_log.py OUT.csv --rows 14000000

14 million rows are 155 hours, about 0.77 GB, and take some seconds. Only the stamps differ between repetitions.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Signal = NDArray[np.float64]

RATE = 25
"""Rows a second; 40 ms are two decimals."""
CYCLES = 20
IDLE = 60.0
"""Rest after the last cycle of a block [s]."""
HEADER = "Time (s),Displacement (m),Velocity (m/s),Pressure (kg/cm2),Force (N),Torque (N.m),Vdc (V),Idc (A)\n"
R_DRUM, GEAR, LOAD = 0.13, 50.0, 36.0
GAS_FORCE, GAS_LENGTH = 204.0, 41.6
"""Absolute gas force at the line at zero payout [N], and the payout that would fill the accumulator [m]."""


def bump(t: Signal, start: float, rise: float, flat: float, fall: float) -> Signal:
    """Rise from 0 to 1 at `start`, stay and fall again, each edge by 3 u^2 - 2 u^3; times in s."""
    up = np.clip((t - start) / rise, 0, 1)
    down = np.clip((t - start - rise - flat) / fall, 0, 1)
    return np.asarray(up**2 * (3 - 2 * up) - down**2 * (3 - 2 * down))


def velocity(t: Signal, speed: float) -> Signal:
    """Pay out about 9.6 m from 5 s on, hold, haul in the same length, rest [m/s]; one cycle lasts 40 s."""
    flat = 9.6 / speed - 2.7
    out = speed * bump(t, 5.0, 4.0, flat, 1.4)
    back = 1.25 * bump(t, 5.0 + flat + 5.4 + 6.0, 1.4, 9.6 / 1.25 - 1.05, 0.7)
    return np.asarray(out - back)


def channels(t: Signal, v: Signal) -> tuple[Signal, ...]:
    """Give the columns after the stamp, without noise, in the units of the header."""
    x = np.concatenate(([0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))))
    omega = GEAR * np.maximum(v, 0) / R_DRUM
    idc = np.maximum(1.35 * 0.062 * 30 / np.pi * omega - 1.4, 0) / (LOAD + 1.22 + 0.0064 * omega)
    torque = GEAR / 0.95 * (0.8 * idc + 7.5e-4 * omega)
    gas = GAS_FORCE / (1 - x / GAS_LENGTH) - 9.7
    force = gas * (1 + 0.46 * np.tanh(v / 0.01)) + torque / R_DRUM
    return x, v, 20.5 * gas / (GAS_FORCE - 9.7), force, torque, idc * LOAD, idc


def block(rng: np.random.Generator) -> list[str]:
    """Write one block without its whole seconds: the rows from the decimals of the stamp on."""
    t = np.arange(40 * RATE) / RATE
    v = np.concatenate([velocity(t, speed) for speed in rng.uniform(0.80, 0.90, CYCLES)])
    v = np.append(v, np.zeros(round(IDLE * RATE)))
    exact = channels(np.arange(v.size) / RATE, v)
    noise = (0.0, 0.004, 0.012, 5.0, 0.4, 0.35, 0.02)
    noisy = [column + sd * rng.standard_normal(v.size) for column, sd in zip(exact, noise, strict=True)]
    row = ".%02d,%.4f,%.3f,%.3f,%.1f,%.2f,%.2f,%.3f\n"
    hundredths = np.arange(v.size) % RATE * (100 // RATE)
    return [row % values for values in zip(hundredths, *noisy, strict=True)]


def stamped(rows: list[str], first: int) -> str:
    """Put whole seconds before rows that begin with decimals, `first` [s] before the first row."""
    text = []
    for i in range(0, len(rows), RATE):
        second = str(first + i // RATE)
        text.append(second + second.join(rows[i : i + RATE]))
    return "".join(text)


def blocks(count: int, rng: np.random.Generator) -> Iterator[str]:
    """Write the text of `count` rows, block by block."""
    rows = block(rng)
    for start in range(0, count, len(rows)):
        yield stamped(rows[: count - start], start // RATE)


def main() -> None:
    parser = argparse.ArgumentParser(description="Write a long log at 25 Hz.")
    parser.add_argument("out", type=Path)
    parser.add_argument("--rows", type=int, default=14_000_000)
    parser.add_argument("--seed", type=int, default=2026)
    asked = parser.parse_args()
    with asked.out.open("w", encoding="ascii", newline="") as file:
        file.write(HEADER)
        file.writelines(blocks(asked.rows, np.random.default_rng(asked.seed)))
    print(f"{asked.out}: {asked.rows} rows, {asked.out.stat().st_size / 1e9:.2f} GB, seed {asked.seed}")


if __name__ == "__main__":
    main()
