"""Inputs that are made of the shipped logs, or without them: campaigns, profiles, tables."""

import math
import shutil
from pathlib import Path

import numpy as np
from bench_logs import write_bench_logs

CAMPAIGN = Path("fixtures", "campaign")
DAMAGED = Path("fixtures", "damaged_logs")

LABELLED = ("copper_heating_and_line_drag", "torque_gain")
"""Labelled campaigns beside the project: a pair of effects, and one in a sensor."""

WRONG_TABLE = """title = "A table with mistakes"
source = "made up"
[columns]
energy_line = { unit = "J", decimals = 0 }
energy_gen = { unit = "J", decimals = 0 }
eta_pto = { unit = "1", decimals = 3 }
[[row]]
load_ohm = 18.0
energy_line = 11500
energy_gen = 8600
eta_pto = 0.648
[[row]]
load_ohm = 36.0
energy_line = 9000
energy_gen = 4956
[[claim]]
says = "Eta_pto is above 0.7 at 18 ohm."
where = "Conclusions"
metric = "eta_pto"
load_ohm = 18.0
at_least = 0.7
unit = "1"
decimals = 1
"""

KITE_CAMPAIGN = """title = "Kite winch"
rig = "kitepower"
[[run]]
file = "ground_station_cycles_01_43.csv"
cycles = [1, 20]
"""

CORNERS = (0.0, 1.0, 2.0, 8.0, 8.5, 12.0, 13.0, 21.0, 22.0)
VELOCITIES = (0.0, 0.0, 1.0, 1.0, 0.0, 0.0, -0.7, -0.7, 0.0)
"""A profile with a payout, a hold and a haul-in: times [s] and velocities [m/s]."""

SHORT = 1000
"""Rows of a short log, which holds one cycle."""

WORN = 0.98
"""Share of the current that is left in the worn campaign."""


def write_inputs(*, shared: bool) -> None:
    """Write all inputs into the present folder, which holds the fixtures; `shared`: and the data
    beside the project.
    """
    write_bench_logs()
    Path("wrong.toml").write_text(WRONG_TABLE, encoding="utf-8")
    times = np.arange(0.0, 22.01, 0.05)
    rows = [
        f"{t:.2f},{v:.6f}"
        for t, v in zip(times, np.interp(times, CORNERS, VELOCITIES), strict=True)
    ]
    Path("profile.csv").write_text(
        "\n".join(["time_s,velocity_mps", *rows]) + "\n", encoding="utf-8"
    )
    _write_campaign(
        "two", {CAMPAIGN / "r18ohm.csv": 18.0, CAMPAIGN / "r4p5ohm.csv": 4.5}, window=5.96
    )
    damaged = {
        DAMAGED / f"{name}.csv": 36.0
        for name in ("aborted", "dropouts", "no_torque", "truncated", "units_row")
    }
    _write_campaign("damaged", {CAMPAIGN / "open_circuit.csv": math.inf, **damaged}, window=5.48)
    _write_campaign(
        "short",
        {CAMPAIGN / "open_circuit.csv": math.inf, CAMPAIGN / "r36ohm.csv": 36.0},
        window=5.48,
        rows=SHORT,
    )
    _write_worn()
    if shared:
        Path("kite", "campaign.toml").write_text(KITE_CAMPAIGN, encoding="utf-8")


def _write_campaign(
    folder: str, logs: dict[Path, float], *, window: float, rows: int | None = None
) -> None:
    """Write a campaign of copies of logs with their loads [ohm], of their first rows if so many
    are given.
    """
    Path(folder).mkdir()
    entries = [f'title = "The campaign {folder}"\n']
    for log, load in logs.items():
        lines = log.read_text(encoding="utf-8").splitlines(keepends=True)
        Path(folder, log.name).write_text("".join(lines[:rows]), encoding="utf-8")
        entries.append(f'[[run]]\nfile = "{log.name}"\nload_ohm = {load}\nwindow_s = {window}\n')
    Path(folder, "campaign.toml").write_text("\n".join(entries), encoding="utf-8")


def _write_worn() -> None:
    """Copy the campaign with another current."""
    shutil.copytree(CAMPAIGN, "worn")
    for log in sorted(Path("worn").glob("*.csv")):
        log.write_text(worn(log.read_text(encoding="utf-8")), encoding="utf-8")


def worn(log: str) -> str:
    """Give the text of a log with the current of the worn campaign."""
    head, *rows = log.splitlines()
    column = head.split(",").index("Idc (A)")
    cells = [row.split(",") for row in rows]
    for row in cells:
        row[column] = f"{WORN * float(row[column]):.4f}"
    return "\n".join([head, *map(",".join, cells)]) + "\n"
