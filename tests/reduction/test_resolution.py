"""Channels that are recorded in coarse steps, on the shipped logs."""

import math
from collections.abc import Callable
from functools import cache
from pathlib import Path

import msgspec
import numpy as np
import pytest

from winchcascade import Run, read_run, reduce
from winchcascade.core.run import Finding
from winchcascade.reduction.checks.sampling import _straight_interval

CAMPAIGN = Path(__file__).parents[2] / "fixtures" / "campaign"
LOGS = {"r45ohm": (45.0, 5.48), "r36ohm": (36.0, 5.48), "r4p5ohm": (4.5, 5.96), "open_circuit": (math.inf, 4.0)}
"""Load [ohm] and window [s] of each log."""

Signal = np.ndarray
Writer = Callable[[Signal], Signal]


@cache
def clean(name: str) -> Run:
    return read_run(CAMPAIGN / f"{name}.csv", load=LOGS[name][0])


def stepped(name: str, channel: str, step: float, how: Writer) -> Run:
    run = clean(name)
    return msgspec.structs.replace(run, channels={**run.channels, channel: how(run.channels[channel] / step) * step})


def found(name: str, run: Run) -> list[Finding]:
    return [f for f in reduce(run, window=LOGS[name][1]).quality if f.kind == "coarse_resolution"]


@pytest.mark.parametrize("name", list(LOGS))
def test_the_logs_as_they_are_have_no_coarse_channel(name: str) -> None:
    assert found(name, clean(name)) == []


@pytest.mark.parametrize("how", [np.round, np.trunc, np.floor])
@pytest.mark.parametrize(
    ("channel", "step"),
    [("velocity", 0.05), ("force", 50.0), ("torque", 4.0), ("vdc", 5.0), ("idc", 0.1), ("idc", 0.5)],
)
def test_a_coarse_step_is_reported_with_its_size(channel: str, step: float, how: Writer) -> None:
    (finding,) = found("r36ohm", stepped("r36ohm", channel, step, how))
    assert finding.channel == channel
    assert finding.message.startswith(f"{channel} is recorded in steps of {step:.3g} ")
    assert ("the onset moves too" in finding.message) == (channel == "velocity")


def test_the_share_is_what_truncation_takes_from_the_energy() -> None:
    energy = [
        reduce(run, window=5.48).mean.energy_gen or 0.0
        for run in (clean("r36ohm"), stepped("r36ohm", "idc", 0.1, np.trunc))
    ]
    (finding,) = found("r36ohm", stepped("r36ohm", "idc", 0.1, np.trunc))
    said = float(finding.message.rpartition("up to ")[2].partition("%")[0])
    assert said == pytest.approx(100.0 * (1.0 - energy[1] / energy[0]), abs=0.1)


def test_in_open_circuit_only_the_channels_of_eta_trans_count() -> None:
    for channel, step in (("vdc", 10.0), ("idc", 0.05)):
        assert found("open_circuit", stepped("open_circuit", channel, step, np.trunc)) == []
    assert found("open_circuit", stepped("open_circuit", "force", 50.0, np.trunc))


def test_rounded_digits_of_the_steps_and_bridged_samples_do_not_hide_them() -> None:
    run = stepped("r36ohm", "idc", 0.0977, np.trunc)  # 10 bit of 100 A
    idc = np.round(run.channels["idc"], 2)
    gaps = []
    for at in np.flatnonzero(run.t > 6.0)[:60:3]:
        idc[at] = 0.5 * (idc[at - 1] + idc[at + 1]) + 0.003
        gaps.append((run.t[at - 1], run.t[at + 1]))
    run = msgspec.structs.replace(run, channels={**run.channels, "idc": idc}, gaps={"idc": np.array(gaps)})
    (finding,) = found("r36ohm", run)
    assert finding.message.startswith("idc is recorded in steps of 0.09")


def test_noise_without_steps_and_a_constant_have_none() -> None:
    run = clean("r36ohm")
    noise = np.random.default_rng(1).normal(0.0, 1.0, run.t.size)
    assert (
        found("r36ohm", msgspec.structs.replace(run, channels={**run.channels, "idc": run.channels["idc"] + noise}))
        == []
    )
    assert found("r36ohm", msgspec.structs.replace(run, channels={**run.channels, "idc": 0.0 * noise + 6.5})) == []


def test_a_straight_ramp_without_noise_is_no_step() -> None:
    run = clean("r36ohm")
    ramp = np.interp((run.t - 5.0) % 30.0, [0.0, 1.5, 10.0, 11.5, 30.0], [0.0, 0.8, 0.8, 0.0, 0.0])
    channels = {"velocity": ramp, "force": 2000.0 + 500.0 * ramp}
    assert found("r36ohm", msgspec.structs.replace(run, channels=channels)) == []


@pytest.mark.parametrize("step", [0.015, 0.02, 0.0213])
def test_a_step_as_large_as_the_change_on_a_ramp_is_found(step: float) -> None:
    assert found("r36ohm", stepped("r36ohm", "velocity", step, np.round))


@pytest.mark.parametrize(("every", "values", "found"), [(4, 6, 4), (6, 6, 6), (3, 30, 1), (4, 30, 4), (6, 5, 1)])
def test_a_line_between_values_is_shown_by_four_stretches_of_four_samples(every: int, values: int, found: int) -> None:
    """So many intervals between values on a zigzag; each value but those at the ends bends the course."""
    zigzag = np.cumsum(np.where(np.arange(values + 1) % 2, 1.0, -0.6))
    x = np.interp(np.arange(every * values + 1), every * np.arange(values + 1), zigzag)
    assert _straight_interval(x) == found


def test_a_few_smaller_changes_are_not_taken_for_the_step() -> None:
    run = stepped("r36ohm", "idc", 0.1, np.round)
    idc = run.channels["idc"].copy()
    rest = np.flatnonzero(
        (run.t > 8.0) & (run.t < 15.0) & (np.diff(idc, append=0.0) == 0.0) & (np.diff(idc, prepend=0.0) == 0.0)
    )
    idc[rest[[2, 6, 10]]] += 0.013
    (finding,) = found("r36ohm", msgspec.structs.replace(run, channels={**run.channels, "idc": idc}))
    assert finding.message.startswith("idc is recorded in steps of 0.1 A")
