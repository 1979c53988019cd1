"""Energies of irregular waves against the noise-free truth of the model and of the twin; the
bootstrap against known series.
"""

import json
from pathlib import Path

import msgspec
import numpy as np
import pytest
from calls import call
from daily import daily

from winchcascade import baseline, load_rig, read_run, reduce, simulate
from winchcascade.core.integrate import integrals
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Run
from winchcascade.reduction.wave_bootstrap import block_length, ratio_of_sums
from winchcascade.reduction.wave_energies import WaveEnergies, joined_waves, wave_energies
from winchcascade.report.content import Note
from winchcascade.report.results.waves import wave_section
from winchcascade.rig.kernel import COLUMNS

R_DRUM, SECONDS = 0.13, 180.0
STAGES = ("line", "mech", "gen")
HEADERS = {
    "time": "Time (s)", "displacement": "Displacement (m)", "velocity": "Velocity (m/s)", "pressure": "Pressure (kg/cm2)",
    "force": "Force (N)", "torque": "Torque (N.m)", "vdc": "Vdc (V)", "idc": "Idc (A)",
}  # fmt: skip


def waves_rig(folder: Path) -> Rig:
    """The built-in rig with waves for cycles."""
    (folder / "waves.toml").write_text(
        f'{command("rig", "hsu2026")}\n[phases]\nfrom = "waves"\n', encoding="utf-8"
    )
    return load_rig(folder / "waves.toml")


def sea(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Times and speed of an irregular sea of 6 s; it begins at rest."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, SECONDS, 0.04)
    hertz = np.linspace(0.08, 0.35, 40)
    size = np.sqrt(hertz**-5 * np.exp(-1.25 * (6.0 * hertz) ** -4.0))  # Bretschneider
    parts = size[:, None] * np.cos(2.0 * np.pi * (hertz[:, None] * t + rng.random((40, 1))))
    v = (hertz[:, None] * parts).sum(axis=0)
    return t, v * 0.45 / v.std() * np.clip(t / 8.0, 0.0, 1.0)


SMALL = 0.25
"""Waves with less than this share of the mean energy are compared with the mean: zeros of
sensors decide their own. [1]
"""


def test_energies_of_simulated_waves_are_within_one_per_cent_of_the_truth(tmp_path: Path) -> None:
    rig, rng = waves_rig(tmp_path), np.random.default_rng(1)
    stamps, v = sea(1)
    profile = Run("sea.csv", stamps, {"velocity": v}, 25.0, stamps.size, load=36.0)
    done = simulate(profile, baseline(rig))
    noise = {"velocity": 0.003, "force": 4.0, "torque": 0.4, "vdc": 0.25, "idc": 0.015}
    channels = {
        n: x + rng.normal(0.0, noise[n], x.size) if n in noise else x
        for n, x in done.run.channels.items()
    }
    noisy = msgspec.structs.replace(done.run, channels=channels)
    reduction, exact, line = (
        reduce(noisy, rig=rig),
        dict(zip(COLUMNS, done.solution.T, strict=True)),
        done.motion,
    )
    torque = exact["torque"] / R_DRUM
    powers = {
        "line": exact["force"] * line.v,
        "mech": torque * line.v,
        "gen": exact["vdc"] ** 2 / 36.0,
    }
    found, spans = (
        wave_energies(reduction),
        np.array([(c.window.onset, c.window.cutoff) for c in reduction.complete]),
    )
    assert found.waves > 35
    for stage, watts in powers.items():
        true = integrals(line.t, watts.__getitem__, spans)
        error = (found.energy[stage] - true) / np.where(
            true < SMALL * true.mean(), true.mean(), true
        )
        assert np.abs(error).max() < 0.01, stage
        whole = float(integrals(line.t, watts.__getitem__, np.array([[0.0, stamps[-1]]]))[0])
        assert found.record_energy[stage] == pytest.approx(whole, rel=0.003)


def reciprocating(tmp_path: Path, waves: int) -> tuple[Path, Path]:
    """A short sea of sines of two heights, as a log, and its rig file."""
    t = np.arange(0.0, 6.0 * waves + 3.0, 0.05)
    v = np.where(np.floor((t + 1.5) / 6.0) % 2.0 == 0.0, 0.4, 0.8) * np.sin(
        2.0 * np.pi * (t - 1.5) / 6.0
    )
    x = np.concatenate(([0.0], np.cumsum(0.5 * np.diff(t) * (v[1:] + v[:-1]))))
    torque = np.where(v > 0.0, 100.0 * v, 0.0)
    power, vdc = 0.8 * torque * v / R_DRUM, 20.0 + 100.0 * np.abs(v)
    rows = np.column_stack((t, x, v, 900.0 + 800.0 * v, torque, vdc, power / vdc))
    path = tmp_path / "sines.csv"
    head = ",".join(
        HEADERS[name]
        for name in ("time", "displacement", "velocity", "force", "torque", "vdc", "idc")
    )
    np.savetxt(path, rows, delimiter=",", header=head, comments="", fmt="%.6f")
    waves_rig(tmp_path)
    return path, tmp_path / "waves.toml"


def test_record_and_efficiency_add_up_to_the_waves(tmp_path: Path) -> None:
    log, path = reciprocating(tmp_path, 12)
    rig = load_rig(path)
    found = wave_energies(reduce(read_run(log, rig=rig, load=36.0), rig=rig))
    assert found.waves >= 11
    assert found.column("period_s") == pytest.approx(np.full(found.waves, 6.0), abs=0.05)
    assert found.efficiency["eta_gen"].value == pytest.approx(0.8, abs=1e-4)
    for stage in STAGES:
        assert found.record_power[stage] * found.record_duration == pytest.approx(
            found.record_energy[stage]
        )
    assert found.errors
    alone = tuple(msgspec.structs.replace(error, shared=False) for error in found.errors)
    for waves, times in (
        (found, 2.0),
        (msgspec.structs.replace(found, errors=alone), 2.0**0.5),
    ):  # two logs of it
        joined = joined_waves([waves, waves])
        assert joined.column("period_s").tolist() == 2 * found.column("period_s").tolist()
        for one, both in zip(found.errors, joined.errors, strict=True):
            assert [abs(x) for x in both.energy.values()] == pytest.approx(
                [times * abs(x) for x in one.energy.values()]
            )
    assert msgspec.json.decode(msgspec.json.encode(found), type=WaveEnergies) == found


def command(*words: str | Path) -> str:
    done = call(*words)
    assert done.code == 0, done.err
    return done.out


def correlated(rng: np.random.Generator, n: int, memory: float) -> np.ndarray:
    x = rng.normal(size=n + 50)
    for k in range(1, x.size):
        x[k] += memory * x[k - 1]
    return x[50:]


def test_blocks_are_longer_for_waves_that_come_in_groups() -> None:
    rng = np.random.default_rng(8)
    assert np.median([block_length(rng.normal(size=300)) for _ in range(20)]) <= 2
    assert np.median([block_length(correlated(rng, 300, 0.7)) for _ in range(20)]) >= 5


def waves_by(folder: Path, **sensors: str) -> tuple[WaveEnergies, Run]:
    """Waves of a log whose rig file states these lines of its sensors alone."""
    log, path = reciprocating(folder, 40)
    text, units = path.read_text(encoding="utf-8"), {"torque": "N.m", "vdc": "V", "idc": "A"}
    tables = "".join(
        f'[sensors.{n}]\nunit = "{units[n]}"\ncoverage = 2.0\n{line}\n'
        for n, line in sensors.items()
    )
    path.write_text(
        text[: text.index("[sensors.")] + tables + '[phases]\nfrom = "waves"\n', encoding="utf-8"
    )
    rig = load_rig(path)
    run = read_run(log, rig=rig, load=36.0)
    return wave_energies(reduce(run, rig=rig)), run


def test_sensors_widen_the_intervals_by_their_budget_and_an_unknown_accuracy_is_named(
    tmp_path: Path,
) -> None:
    gains = {
        name: f"accuracy_reading = {x}"
        for name, x in (("torque", 0.004), ("vdc", 0.003), ("idc", 0.006))
    }
    known = waves_by(tmp_path, **gains)[0].efficiency["eta_gen"]
    relative = np.hypot(np.hypot(0.002, 0.0015), 0.003)  # normal distributions
    assert known.u_sensors == pytest.approx(0.8 * relative, rel=1e-3)
    low, high = known.interval or (0.0, 0.0)
    assert high - low == pytest.approx(
        2 * 1.96 * np.hypot(known.u_sensors or 0.0, known.u_waves or 0.0), rel=0.08
    )
    found, run = waves_by(tmp_path, torque="accuracy = 1.0")
    mech, gen = found.power["mech"], found.power["gen"]
    assert mech.value == pytest.approx(found.record_power["mech"])
    mean_speed = (
        float(np.trapezoid(run.channels["velocity"], run.t)) / found.record_duration / R_DRUM
    )
    assert mech.u_sensors == pytest.approx(
        0.5 * abs(mean_speed), rel=1e-6
    )  # a zero of the torque of 0.5 N m
    assert (gen.u_sensors, found.efficiency["eta_gen"].u_sensors) == (None, None)
    assert mech.u_waves == pytest.approx(
        1.25 * (gen.u_waves or 0.0), rel=1e-3
    )  # the same waves, of which 0.8 arrive
    assert any(
        "idc, vdc" in block.text for block in wave_section(found).blocks if isinstance(block, Note)
    )


WAVES = ((10, 0.0, 0.90), (40, 0.0, 0.92), (120, 0.6, 0.87))
"""Number of waves, their memory [1], and the least share of intervals that hold. [1]"""


@pytest.mark.parametrize(
    ("waves", "memory", "minimum"),
    daily(WAVES, WAVES[:1], spread=True),
)
def test_intervals_of_mean_powers_hold_the_truth(waves: int, memory: float, minimum: float) -> None:
    """Waves alone or in groups, between which the machine rests for a tenth of the record; 95 %
    is meant.
    """
    rng, held, number = np.random.default_rng(11), 0, 200
    for _ in range(number):
        period = 6.0 + 0.5 * correlated(rng, waves, 0.5)
        joules = 500.0 * period * (1.0 + 0.24 * correlated(rng, waves, memory))
        watts = float(joules.sum() / period.sum()) * 0.9
        low, high = ratio_of_sums(watts, period, joules, share=0.9).interval or (0.0, 0.0)
        held += low <= 450.0 <= high
    assert minimum <= held / number <= 0.985


def test_a_campaign_combines_the_waves_of_its_logs(tmp_path: Path, fixtures: Path) -> None:
    assert "waves" not in json.loads(
        command("reduce", fixtures / "campaign" / "r36ohm.csv", "--json", "-")
    )
    for name, waves in (("a", 14), ("b", 25)):
        (tmp_path / name).mkdir()
        reciprocating(tmp_path / name, waves)
    waves_rig(tmp_path)
    runs = "".join(
        f'[[run]]\nfile = "{n}/sines.csv"\nload_ohm = {load}\n'
        for n, load in (("a", 36), ("b", 36), ("a", "inf"))
    )
    (tmp_path / "campaign.toml").write_text(
        f'title = "sea"\nrig = "waves.toml"\n{runs}', encoding="utf-8"
    )
    command("batch", tmp_path / "campaign.toml", "--out", tmp_path / "out", "--reports", "none")
    record = json.loads((tmp_path / "out" / "campaign.json").read_text(encoding="utf-8"))
    names, together = (
        {run["result"] for run in record["runs"] if not run["open_circuit"]},
        record["waves"],
    )
    single = [
        json.loads((tmp_path / "out" / name).read_text(encoding="utf-8"))["waves"] for name in names
    ]
    for key in ("energy_line_j", "energy_gen_j", "duration_s"):
        assert together["record"][key] == pytest.approx(sum(of["record"][key] for of in single))
    line, gen = (
        sum(wave[f"energy_{s}_j"] for of in single for wave in of["each"]) for s in ("line", "gen")
    )
    eta = together["efficiency"]["eta_pto"]
    assert eta["value"] == pytest.approx(gen / line)
    for found in (eta, together["mean_power"]["mech"]):
        assert found["interval_95"][0] < found["value"] < found["interval_95"][1]
    alone = [of["efficiency"]["eta_pto"]["standard_uncertainty_sensors"] for of in single]
    assert eta["standard_uncertainty_sensors"] == pytest.approx(
        float(np.mean(alone)), rel=0.05
    )  # do not average out
    assert (together["waves"], len(together["logs"])) == (sum(together["waves_of_logs"]), 3)
    assert "open circuit" in together["left_out"][0]
