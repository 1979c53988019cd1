"""Zeros, error codes and held values of any length are taken out; what the machine does stays as logged."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from shipped_log import ENERGY, NAMES, WINDOW, Signal, clean, column, row_after_onset, table, written

from winchcascade import Reduction, Run, reduce
from winchcascade.ingest.checks.dropouts import Dropout, _departure, find_dropouts
from winchcascade.ingest.checks.spikes import find_bends

LOG = "r18ohm"


@cache
def resampled(fs: int) -> Signal:
    rows = table(LOG)
    t = np.arange(0.0, rows[-1, 0], 1.0 / fs)
    return np.column_stack((t, *(np.round(np.interp(t, rows[:, 0], x), 4) for x in rows.T[1:])))


@cache
def clean_at(fs: int) -> Reduction:
    with TemporaryDirectory() as folder:
        return reduce(written(Path(folder), resampled(fs), load=18.0), window=WINDOW[LOG])


def row_at(seconds: float, fs: int) -> int:
    """Row of the resampled log at a time after the second onset."""
    return int((clean(LOG).cycles[1].window.onset + seconds) * fs)


def travelled(rows: Signal) -> Signal:
    return np.round(np.append(0.0, np.cumsum(np.diff(rows[:, 0]) * rows[1:, column("velocity")])), 4)


def reported_channels(run: Run, kind: str = "spike") -> set[str | None]:
    return {f.channel for f in run.findings if f.kind == kind}


def assert_same_energies(run: Run, same: Reduction | None = None) -> None:
    """Every cycle that is still complete has the energies of the clean log."""
    for got, true in zip(reduce(run, window=WINDOW[LOG]).cycles, (same or clean(LOG)).cycles, strict=True):
        for name in ("energy_line", "energy_mech", "energy_gen"):
            if got.complete:
                assert getattr(got.metrics, name) == pytest.approx(getattr(true.metrics, name), rel=ENERGY)


@pytest.mark.parametrize("name", ["force", "torque", "vdc", "idc"])
@pytest.mark.parametrize(("fs", "seconds"), [(10, 0.2), (10, 2.0), (25, 0.24), (25, 0.6), (100, 0.3), (100, 3.0)])
def test_zeros_on_the_plateau_are_taken_out(tmp_path: Path, name: str, fs: int, seconds: float) -> None:
    rows, k = resampled(fs).copy(), row_at(3.6, fs)
    rows[k : k + round(seconds * fs), column(name)] = 0.0
    run = written(tmp_path, rows, load=18.0)
    (finding,) = [f for f in run.findings if f.kind == "spike"]
    assert (finding.channel, finding.count) == (name, round(seconds * fs))
    assert_same_energies(run, clean_at(fs))


@pytest.mark.parametrize("lost", [("vdc", "idc"), ("torque", "vdc", "idc"), ("force", "torque", "vdc", "idc")])
def test_zeros_of_several_channels_at_once_are_taken_out(tmp_path: Path, lost: tuple[str, ...]) -> None:
    rows, k = table(LOG).copy(), row_after_onset(3.6, LOG)
    for name in lost:
        rows[k : k + 12, column(name)] = 0.0
    assert reported_channels(written(tmp_path, rows, load=18.0)) == {*lost}


@pytest.mark.parametrize("code", [-999.0, 9999.0])
@pytest.mark.parametrize("samples", [8, 25, 100])
@pytest.mark.parametrize("name", NAMES)
def test_error_codes_of_any_length_are_taken_out(tmp_path: Path, name: str, samples: int, code: float) -> None:
    rows, k = table(LOG).copy(), row_after_onset(2.0, LOG)
    rows[k : k + samples, column(name)] = code
    run = written(tmp_path, rows, load=18.0)
    assert reported_channels(run) == {name}
    assert "jump to " in run.findings[0].message
    assert_same_energies(run)


def test_a_code_that_no_sensor_gives_needs_no_other_channel_to_show_it() -> None:
    t, x = table(LOG)[:, 0], table(LOG)[:, column("force")].copy()
    x[500:520] = 1e7
    found = find_dropouts(t, {"force": x}, {"force": find_bends(x)}, open_circuit=False)
    assert [(d.before, d.after) for d in found["force"]] == [(499, 520)]


def test_zeros_of_the_voltage_on_a_ramp_at_five_hertz_are_shown_by_the_current(tmp_path: Path) -> None:
    rows, k = resampled(5).copy(), row_at(0.8, 5)
    rows[k : k + 3, column("vdc")] = 0.0
    assert reported_channels(written(tmp_path, rows, load=18.0)) == {"vdc"}


@pytest.mark.parametrize("share", [0.01, 0.05, 0.2])
@pytest.mark.parametrize("name", ["velocity", "torque", "idc"])
def test_error_codes_in_many_samples_are_taken_out(tmp_path: Path, name: str, share: float) -> None:
    rows = table(LOG).copy()
    bad = np.random.default_rng(4).random(len(rows)) < share
    rows[bad, column(name)] = -999.0
    run = written(tmp_path, rows, load=18.0)
    assert sum(f.count for f in run.findings if f.kind == "spike") == np.count_nonzero(bad)
    assert_same_energies(run)


@pytest.mark.parametrize("share", [0.1, 0.4])
def test_a_stretch_in_another_unit_and_one_of_noise_about_zero_are_taken_out(tmp_path: Path, share: float) -> None:
    rows, k = table(LOG).copy(), row_after_onset(3.6, LOG)
    rows[k : k + 20, column("vdc")] *= share
    rows[k + 200 : k + 230, column("idc")] = np.random.default_rng(1).normal(0.0, 0.02, 30)
    assert reported_channels(written(tmp_path, rows, load=18.0)) == {"vdc", "idc"}


def test_error_codes_at_the_end_of_a_log_are_taken_out(tmp_path: Path) -> None:
    rows = table(LOG)[: row_after_onset(8.0, LOG)].copy()
    rows[-30:, column("torque")] = -999.0
    assert reported_channels(written(tmp_path, rows, load=18.0)) == {"torque"}


@pytest.mark.parametrize("every", [2, 3, 5, 10])
@pytest.mark.parametrize("filler", [0.0, np.nan])
def test_rows_between_the_updates_of_a_slow_channel_are_bridged(tmp_path: Path, every: int, filler: float) -> None:
    rows = table(LOG).copy()
    for name in ("force", "idc"):
        rows[np.arange(len(rows)) % every != 0, column(name)] = filler
    run = written(tmp_path, rows, load=18.0)
    assert reported_channels(run, "not_a_number" if np.isnan(filler) else "dropped_samples") == {"force", "idc"}
    assert_same_energies(run)


def test_a_channel_that_falls_in_the_last_sample_departs_with_a_dropout_at_the_end() -> None:
    y = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 0.2])
    at_the_end = Dropout(before=2, after=y.size, value=0.0, jump=1.0, share=1.0, far=False, usual=0.1)
    assert _departure(y, at_the_end, -1.0, 0.1, idle=True) == pytest.approx(0.8)


# ----------------------------------------------------------------------------------------------------- what is kept
@pytest.mark.parametrize("fs", [5, 10, 25, 100])
@pytest.mark.parametrize("speed", [0.0, 0.2])
def test_a_crane_that_stops_makes_every_channel_fall_and_none_is_taken_out(
    tmp_path: Path, fs: int, speed: float
) -> None:
    rows, k = resampled(fs).copy(), row_at(4.0, fs)
    stop = slice(k, k + 2 * fs)
    rows[stop, column("velocity")] *= speed
    rows[:, column("displacement")] = travelled(rows)
    for name in ("torque", "vdc", "idc"):
        rows[stop, column(name)] = 0.0
    rows[stop, column("force")] *= 0.2
    assert reported_channels(written(tmp_path, rows, load=18.0)) == set()


@pytest.mark.parametrize("fs", [5, 10, 25])
def test_a_clutch_that_opens_while_vdc_and_idc_decay_is_kept(tmp_path: Path, fs: int) -> None:
    rows, k = resampled(fs).copy(), row_at(4.0, fs)
    open_ = slice(k, k + fs)
    decay = np.exp(-np.arange(fs) / fs / 0.1)
    rows[open_, column("velocity")] *= 0.6
    rows[:, column("displacement")] = travelled(rows)
    rows[open_, column("torque")] = 0.0
    for name in ("vdc", "idc"):
        rows[open_, column(name)] *= decay
    assert reported_channels(written(tmp_path, rows, load=18.0)) == set()


@pytest.mark.parametrize(("level", "faults"), [(6.0, []), (8.0, [("torque", 8.0)])])
def test_a_jump_of_three_steps_of_a_coarse_channel_is_no_fault(level: float, faults: list[tuple[str, float]]) -> None:
    """A torque in steps of 2 N m that drops to zero for a moment, after a rest so long that it shows no noise."""
    rest, moved = 20_100, 1200
    moving = np.concatenate((np.zeros(rest), np.sin(np.pi * np.arange(moved) / moved)))
    ripple = moving * (1.0 + 0.001 * np.sin(np.arange(rest + moved)))
    torque = 2.0 * np.round(0.5 * level * np.minimum(1.0, 2.0 * moving))
    torque[rest + 500 : rest + 520] = 0.0
    channels = {"velocity": 0.8 * ripple, "vdc": 200.0 * ripple, "idc": 10.0 * ripple, "torque": torque}
    bends = {name: find_bends(x) for name, x in channels.items()}
    found = find_dropouts(np.arange(0.0, 0.04 * (rest + moved) - 0.02, 0.04), channels, bends, open_circuit=False)
    assert [(name, d.jump) for name, dropouts in found.items() for d in dropouts] == faults
