"""Benches with headers, signs and machines of their own, against their noise-free truth; each
log is made here.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from calls import call
from scipy.signal import lfilter

WITHIN = 0.002
"""Share of the mean energy by which a cycle may miss the truth: noise and rounding of the log.
[1]
"""


def compared(result: Path, t: np.ndarray, powers: dict[str, np.ndarray]) -> int:
    """Compare the energies of every complete cycle with the integral of the true powers over its
    window; how many.
    """
    cycles = [c for c in json.loads(result.read_text(encoding="utf-8"))["cycles"] if c["complete"]]
    for stage, watts in powers.items():
        sums = np.concatenate(([0.0], np.cumsum(0.5 * (watts[1:] + watts[:-1]) * np.diff(t))))
        spans = np.array([(c["window"]["onset_s"], c["window"]["cutoff_s"]) for c in cycles])
        true = np.interp(spans[:, 1], t, sums) - np.interp(spans[:, 0], t, sums)
        found = np.array([c["stages"][f"energy_{stage}_j"] for c in cycles])
        assert np.abs(found - true).max() < WITHIN * np.abs(true).mean(), stage
    return len(cycles)


def written(path: Path, head: str, rows: np.ndarray, *, digits: int = 4) -> Path:
    """A log with semicolons and decimal commas."""
    lines = (";".join(f"{x:.{digits}f}" for x in row).replace(".", ",") for row in rows)
    path.write_text("\n".join([head, *lines, ""]), encoding="cp1252")
    return path


DYNO = """name = "Bench 3"
[cascade]
stages = ["mech", "gen"]
[phases]
from = "steps"
[stage.mech]
power = "-torque * speed"
"""


def test_steps_behind_a_settling_that_lies_within_the_band_are_whole(tmp_path: Path) -> None:
    rng, step = np.random.default_rng(5), 0.01
    points = [
        (0, 0, 4),
        *((n, torque, 9) for n in (12, 24, 36, 48) for torque in (150, 400, 700)),
        (0, 0, 3),
    ]
    share = step / 0.15
    rpm, torque = (
        lfilter(
            [share],
            [1.0, share - 1.0],
            np.repeat([p[k] for p in points], [100 * p[2] for p in points]),
        )
        for k in (0, 1)
    )
    t, omega = step * np.arange(rpm.size), rpm * np.pi / 30.0
    loss = 8.0 * omega + 2e-4 * torque**2 + 0.03 * torque * omega
    mech = torque * omega
    gen, volt = np.maximum(mech - loss, 0.0), 40.0 + 6.0 * rpm
    noise = rng.normal(0.0, (0.03, 1.5, 0.2, 0.02), (t.size, 4))
    rows = np.column_stack((t, np.column_stack((rpm, -torque, volt, gen / volt)) + noise))
    head = "Zeit [s];Trommeldrehzahl [U/min];Drehmoment [Nm];Zwischenkreisspannung [V];Zwischenkreisstrom [A]"
    log, rig = written(tmp_path / "dyno.csv", head, rows), tmp_path / "dyno.toml"
    rig.write_text(DYNO, encoding="utf-8")
    code, _out, err = call(
        "reduce",
        log,
        "--rig",
        rig,
        "--json",
        tmp_path / "a.json",
        "--loss-map",
        tmp_path / "map.json",
    )
    assert (code, err) == (0, "")
    assert compared(tmp_path / "a.json", t, {"mech": mech, "gen": gen}) == 12
    surface = json.loads((tmp_path / "map.json").read_text(encoding="utf-8"))
    assert (
        min(surface["points"]["torque_nm"]) > 100.0
    )  # the torque of the map counts as the rig file counts its power


@pytest.mark.parametrize("source", ["waves", "whole"])
def test_a_minus_sign_of_a_rig_file_speaks_of_the_log_also_where_a_sign_is_corrected(
    tmp_path: Path, source: str
) -> None:
    rng, t = np.random.default_rng(6), np.arange(0.0, 60.0, 2e-3)
    x = 0.3 * np.sin(2.0 * np.pi * t / 4.0) + 0.08 * np.sin(2.0 * np.pi * t / 2.7 + 1.0)
    v = np.gradient(x, t)
    force = 2500.0 * v + 200.0 * np.tanh(v / 0.05)
    line, ac = force * v, 0.83 * force * v - 5.0
    noise = rng.normal(0.0, (0.02, 2.0, 0.004, 3.0), (t.size, 4))
    rows = np.column_stack(
        (1e3 * t, np.column_stack((1e3 * x, 1e3 * v, -1e-3 * force, ac)) + noise)
    )
    log, rig = tmp_path / "linear.csv", tmp_path / "linear.toml"
    np.savetxt(
        log,
        rows,
        delimiter=",",
        header="t [ms],Position [mm],Speed [mm/s],Damper [kN],Meter [W]",
        comments="",
    )
    rig.write_text(
        f'name = "linear generator"\n[cascade]\nstages = ["line", "ac"]\n[phases]\nfrom = '
        f'"{source}"\n'
        '[stage.line]\npower = "-force * velocity"\n[columns]\nforce = "Damper [kN]"\npower_ac = '
        '"Meter [W]"\n'
    )
    code, out, err = call("reduce", log, "--rig", rig, "--json", tmp_path / "a.json")
    assert (code, err) == (0, "")
    found = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))["quality"]
    assert ("sign_flipped", "force") in [(finding["kind"], finding["channel"]) for finding in found]
    assert compared(tmp_path / "a.json", t, {"line": line, "ac": ac}) == (
        14 if source == "waves" else 1
    )
    assert ", -0 J" not in out


@pytest.mark.parametrize("rows", [2, 6])
def test_a_short_table_of_step_means_is_reduced_and_a_short_log_names_that_source(
    tmp_path: Path, rows: int
) -> None:
    speed, torque = np.linspace(200.0, 600.0, rows), np.linspace(20.0, 60.0, rows)
    log, rig = tmp_path / "means.csv", tmp_path / "rig.toml"
    np.savetxt(
        log,
        np.column_stack((speed, torque)),
        delimiter=",",
        header="Speed (rpm),Torque (N.m)",
        comments="",
    )
    text = 'name = "a"\n[cascade]\nstages = ["mech"]\n[phases]\nfrom = "rows"\n'
    rig.write_text(text)
    assert call("reduce", log, "--rig", rig, "--json", tmp_path / "a.json").code == 0
    cycles = json.loads((tmp_path / "a.json").read_text())["cycles"]
    assert [c["power_mech_w"] for c in cycles] == pytest.approx(speed * np.pi / 30.0 * torque)
    rig.write_text(text.replace('"rows"', '"whole"') + "[log]\nsample_rate_hz = 1\n")
    code, _, err = call("reduce", log, "--rig", rig)
    assert code == 2
    assert 'set from = "rows" under [phases]' in err


def bench(folder: Path, log: str, content: bytes, rig: str, *options: str) -> Path:
    """Reduce a log that has just been written; its record."""
    (folder / log).write_bytes(content)
    (folder / "rig.toml").write_text(rig, encoding="utf-8")
    called = call(
        "reduce",
        folder / log,
        "--rig",
        folder / "rig.toml",
        "--json",
        folder / "out.json",
        *options,
    )
    assert called.code == 0, called
    return folder / "out.json"


def table(head: str, rows: np.ndarray, *, digits: int = 5) -> bytes:
    """A log with semicolons, decimal commas and Windows line ends."""
    lines = (";".join(f"{x:.{digits}f}" for x in row).replace(".", ",") for row in rows)
    return "\r\n".join([head, *lines, ""]).encode("cp1252")


def found_in(result: Path) -> set[str]:
    return {
        finding["kind"] for finding in json.loads(result.read_text(encoding="utf-8"))["quality"]
    }


def test_a_motor_in_newton_centimetres_and_turns_a_minute_beside_kilowatts(tmp_path: Path) -> None:
    t = 0.05 * np.arange(960)
    step = np.minimum(t // 8.0, 5.0)
    omega = np.convolve(
        np.pad(30.0 + 20.0 * step, 10, mode="edge"), np.full(21, 1.0 / 21.0), "valid"
    )
    torque = 1.0 + step
    power = torque * omega / 0.78
    rows = np.column_stack((t, omega * 30.0 / np.pi, 100.0 * torque, power / 1e3))
    head = "Zeit;Drehzahl;Drehmoment;P_el\r\n[s];[1/min];[Ncm];[kW]"
    rig = 'name = "Motor"\n[cascade]\nstages = ["ac", "mech"]\n[phases]\nfrom = "steps"\n[columns]\npower_ac = "P_el"\n'
    result = bench(tmp_path, "motor.csv", table(head, rows, digits=7), rig)
    assert compared(result, t, {"ac": power, "mech": torque * omega}) == 6
    assert found_in(result) == set()
