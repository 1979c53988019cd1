"""Small logs of invented benches, computed without random numbers, and their rig files: what the
group `benches` reads.
"""

from pathlib import Path

import numpy as np

SENSORS = """[sensors.torque]
unit = "N.m"
high = 200
accuracy_full_scale = 0.001
[sensors.speed]
unit = "rpm"
accuracy = 0.1
[sensors.force]
unit = "N"
accuracy_reading = 0.002
[sensors.vdc]
unit = "V"
accuracy_reading = 0.002
[sensors.idc]
unit = "A"
accuracy_reading = 0.003
coverage = 2.0
"""
TABLE = """title = "Generator at six operating points"
source = "made for the reference outputs"
key = ["n", "torque"]
[columns]
n = { unit = "rpm", measured = "speed" }
torque = { unit = "N.m" }
power_mech = { unit = "W", is = "n * torque" }
power_gen = { unit = "W" }
eta_gen = { unit = "%", is = "power_gen / power_mech" }
"""
POINTS = [(n, torque) for n in (200.0, 600.0) for torque in (20.0, 60.0, 120.0)]


def _ripple(n: int, size: float, phase: float = 0.0) -> np.ndarray:
    """Numbers that scatter as noise does, from sines of periods that no other has."""
    k = np.arange(n)
    waves: np.ndarray = np.sum([np.sin(k * step + phase) for step in (1.234, 2.718, 0.777)], axis=0)
    return size * waves


def _powers(n: np.ndarray, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    omega = n * np.pi / 30.0
    return torque * omega, torque * omega - 2.0 * omega - 0.012 * torque**2


def _write(path: Path, head: str, *columns: np.ndarray) -> None:
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=head, comments="", fmt="%.5f")


def _rig(path: Path, stages: str, source: str, more: str = "") -> None:
    path.write_text(
        f'name = "{path.stem}"\n{more}[cascade]\nstages = {stages}\n[phases]\nfrom = '
        f'"{source}"\n{SENSORS}',
        encoding="utf-8",
    )


def write_bench_logs() -> None:
    """Write `dyno.csv`, `motor.csv`, `sea_1.csv`, `sea_2.csv`, `points.toml` and rig files into
    the present folder.
    """
    n, torque = (np.repeat([point[k] for point in POINTS], 60) for k in (0, 1))
    mech, gen = _powers(n, torque)
    t = 0.1 * np.arange(n.size)
    head = "Time (s),Speed (rpm),Torque (N.m),Vdc (V),Idc (A)"
    _write(Path("dyno.csv"), head, t, n, torque + _ripple(n.size, 0.1), 0.5 * n, gen / (0.5 * n))
    _rig(Path("dyno.toml"), '["mech", "gen"]', "steps")
    _rig(Path("whole.toml"), '["mech", "gen"]', "whole")
    first = slice(None, None, 60)
    _write(
        Path("motor.csv"),
        head,
        t[first],
        n[first],
        torque[first],
        0.5 * n[first],
        (mech + 40.0)[first] / (0.5 * n[first]),
    )
    _rig(Path("motor.toml"), '["gen", "mech"]', "rows")
    rows = [(a, b, *map(float, _powers(np.array(a), np.array(b)))) for a, b in POINTS]
    cells = (
        "n = {:.0f}\ntorque = {:.0f}\npower_mech = {:.0f}\npower_gen = {:.0f}\neta_gen = {:.1f}\n",
    )
    points = [cells[0].format(*row, 100.0 * row[3] / row[2]) for row in rows]
    points[2] = points[2].replace("power_gen = ", "power_gen = 1")
    Path("points.toml").write_text(
        TABLE + "".join(f"[[point]]\n{point}" for point in points), encoding="utf-8"
    )
    drum = '[winch]\nr_drum = { value = 0.13, unit = "m", source = "invented" }\n'
    _rig(Path("waves.toml"), '["line", "mech", "gen"]', "waves", drum)
    for k, period in enumerate((6.0, 8.0), 1):
        t = 0.05 * np.arange(2600)
        v = 0.5 * np.sin(2.0 * np.pi * t / period) + 0.2 * np.sin(
            2.0 * np.pi * t / (1.37 * period) + k
        )
        x = np.concatenate(([0.0], np.cumsum(0.025 * (v[1:] + v[:-1]))))
        shaft = np.maximum(v, 0.0)
        force, torque = 900.0 + 1500.0 * shaft + _ripple(t.size, 2.0, k), 150.0 * shaft
        vdc = 20.0 + 150.0 * shaft
        names = "Time (s),Displacement (m),Velocity (m/s),Force (N),Torque (N.m),Vdc (V),Idc (A)"
        _write(
            Path(f"sea_{k}.csv"),
            names,
            t,
            x,
            v,
            force,
            torque,
            vdc,
            0.8 * torque * shaft / 0.13 / vdc,
        )
    runs = "".join(f'[[run]]\nfile = "sea_{k}.csv"\nload_ohm = 36\n' for k in (1, 2))
    Path("sea.toml").write_text(
        f'title = "Two sea states"\nrig = "waves.toml"\nmeasured = false\n{runs}', encoding="utf-8"
    )
