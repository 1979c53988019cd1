"""Two loggers of one test: the difference of their clocks with its uncertainty, and one run of the
channels of both.
"""

import math
from pathlib import Path

import numpy as np
import pytest
from daily import daily
from msgspec.structs import replace

from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.errors import CampaignError, LogError
from winchcascade.core.run import Run
from winchcascade.ingest.read import read_run
from winchcascade.ingest.two_loggers import clock_difference
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.uncertainty import uncertainty

CAMPAIGN = Path(__file__).parent.parent.parent / "fixtures" / "campaign"

NOISE = 0.001
"""Standard deviation of the channels of the second logger, of their maxima."""

LIMIT = 4.0
"""Largest deviation in standard uncertainties, in as many pairs as these."""

SIZES = {"rig": (1.0, 1.0), "rig of another size": (2.2, 5.0)}
"""Times and lengths, as multiples of those of the shipped log."""

HEADERS = {
    "displacement": "Displacement (m)",
    "velocity": "Velocity (m/s)",
    "pressure": "Pressure (Pa)",
    "force": "Force (N)",
    "torque": "Torque (N.m)",
    "vdc": "Vdc (V)",
    "idc": "Idc (A)",
}


@pytest.fixture(scope="module")
def shipped() -> Run:
    return read_run(CAMPAIGN / "r36ohm.csv")


def second(run: Run, rate: float, ahead: float, seed: int) -> Run:
    """The same motion on the clock of another logger, which begins later and ends earlier."""
    random = np.random.default_rng(seed)
    t = np.arange(run.t[0] + 5.3 / rate, run.t[-1] - 3.0, 1.0 / rate)
    channels = {name: np.interp(t, run.t, x) for name, x in run.channels.items()}
    channels = {
        name: x + random.normal(0.0, NOISE * np.abs(x).max(), x.size)
        for name, x in channels.items()
    }
    return Run("b.csv", t + ahead, channels, rate, t.size)


def resized(run: Run, times: float, lengths: float) -> Run:
    """The motion of a rig of another size."""
    channels = {
        "displacement": run.channels["displacement"] * lengths,
        "velocity": run.channels["velocity"] * lengths / times,
    }
    return Run("a.csv", run.t * times, channels, run.fs / times, run.samples)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("rate", daily((10.0, 25.0, 37.0, 100.0), (10.0, 100.0)))
@pytest.mark.parametrize("channel", ["velocity", "displacement"])
def test_the_difference_of_the_clocks_is_found_within_its_uncertainty(
    shipped: Run, size: str, rate: float, channel: str
) -> None:
    run = resized(shipped, *SIZES[size])
    only = Run("a.csv", run.t, {channel: run.channels[channel]}, run.fs, run.samples)
    for seed, ahead in enumerate((3.137, -1234.5678)):
        found = clock_difference(only, second(only, rate * run.fs / shipped.fs, ahead, seed))
        assert found.channel == channel
        assert abs(found.value + ahead) < LIMIT * found.u
        assert found.u < 0.1 / run.fs


def test_dates_choose_among_the_repetitions_of_a_motion(shipped: Run) -> None:
    other = second(shipped, 25.0, 3.0, 0)
    first = clock_difference(shipped, other)
    assert first.others
    period = min(first.others, key=lambda value: abs(value - first.value)) - first.value
    dated = replace(other, started=1e9 + 5.3 / 25.0 + period)
    found = clock_difference(replace(shipped, started=1e9), dated)
    assert found.value == pytest.approx(first.value + period, abs=0.5)


def test_logs_without_a_common_motion_are_aligned_by_their_dates_alone(shipped: Run) -> None:
    power = {name: shipped.channels[name] for name in ("vdc", "idc")}
    other = Run("b.csv", shipped.t + 7.0, power, shipped.fs, shipped.samples)
    line = {name: shipped.channels[name] for name in ("velocity", "force")}
    run = Run("a.csv", shipped.t, line, shipped.fs, shipped.samples)
    with pytest.raises(LogError):
        clock_difference(run, other)
    found = clock_difference(replace(run, started=1e9), replace(other, started=1e9 + 0.25))
    assert found.value == pytest.approx(-7.0 + 0.25)
    assert math.isnan(found.u)


def test_unlike_motions_are_rejected(shipped: Run) -> None:
    random = np.random.default_rng(1)
    noise = {"velocity": random.normal(0.0, 1.0, 2000)}
    with pytest.raises(LogError):
        clock_difference(shipped, Run("b.csv", np.arange(2000) / 25.0, noise, 25.0, 2000))


def written(run: Run, path: Path, names: tuple[str, ...]) -> None:
    header = ",".join(("Time (s)", *(HEADERS[name] for name in names)))
    columns = np.column_stack([run.t, *(run.channels[name] for name in names)])
    np.savetxt(path, columns, fmt="%.9g", delimiter=",", header=header, comments="")


@pytest.fixture
def campaign(shipped: Run, tmp_path: Path) -> Path:
    """The shipped log as two loggers would have it, the second at another rate."""
    written(shipped, tmp_path / "a.csv", ("displacement", "velocity", "pressure", "force"))
    other = second(shipped, 40.0, -12.25, 3)
    written(other, tmp_path / "b.csv", ("velocity", "torque", "vdc", "idc"))
    (tmp_path / "campaign.toml").write_text(
        f'rig = "{(CAMPAIGN / "rig.toml").as_posix()}"\n[[run]]\n'
        'file = ["a.csv", "b.csv"]\nload_ohm = 36.0\nwindow_s = 5.48\n'
    )
    return tmp_path


def test_two_logs_give_the_energies_of_one(shipped: Run, campaign: Path) -> None:
    one = reduce(shipped)
    run = read_run(campaign / "a.csv")
    both = reduce(run)
    u = uncertainty(one).standard
    assert {f.kind for f in both.quality} == {f.kind for f in one.quality} | {"loggers_aligned"}
    for metric in ("energy_line_j", "energy_mech_j", "energy_gen_j", "eta_pto"):
        name = metric.removesuffix("_j")
        assert both.mean[name] == pytest.approx(one.mean[name], abs=0.5 * (u[name] or 0.0))
    assert run.rig is not None
    assert shipped.rig is not None
    assert (run.rig.sensors["vdc"].u_lag or 0.0) > 0.0
    assert run.rig.sensors["force"].u_lag == shipped.rig.sensors["force"].u_lag


def test_each_log_of_a_pair_leads_to_the_same_run(campaign: Path) -> None:
    first, other = read_run(campaign / "a.csv"), read_run(campaign / "b.csv")
    assert first.channels.keys() == other.channels.keys()
    assert len(load_campaign(campaign).runs[0].beside) == 1


def test_the_second_log_has_no_key_of_its_own(campaign: Path) -> None:
    path = campaign / "campaign.toml"
    path.write_text('[[run]]\nfile = "a.csv"\nbeside = ["b.csv"]\n')
    with pytest.raises(CampaignError):
        load_campaign(path)
    path.write_text('[[run]]\nfile = ["a.csv", 3]\n')
    with pytest.raises(CampaignError):
        load_campaign(path)
