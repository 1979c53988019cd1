"""Cross-checks of a reduction: load, lags, zeros, windows and sampling, on the shipped logs with one thing wrong."""

import math
from functools import cache
from pathlib import Path

import msgspec
import numpy as np
import pytest
from synthetic import Scenario, make_log, write_csv

from winchcascade import Reduction, Run, read_run, reduce
from winchcascade.core.errors import OptionError
from winchcascade.core.rig_file import Sensor
from winchcascade.core.rig_toml import built_in, parse_rig
from winchcascade.reduction.phased_run import find_phases
from winchcascade.reduction.uncertainty import SAMPLING, uncertainty

CAMPAIGN = Path(__file__).parents[2] / "fixtures" / "campaign"
LOGS = {"r45ohm": (45.0, 5.48), "r18ohm": (18.0, 5.96), "r4p5ohm": (4.5, 5.96), "open_circuit": (math.inf, 4.0)}
"""Load [ohm] and window [s] of each log."""


@cache
def clean(name: str = "r45ohm") -> Run:
    return read_run(CAMPAIGN / f"{name}.csv", load=LOGS[name][0])


def changed(run: Run, **channels: np.ndarray) -> Run:
    return msgspec.structs.replace(run, channels={**run.channels, **channels})


def late(run: Run, seconds: float, *names: str) -> Run:
    return changed(run, **{n: np.interp(run.t - seconds, run.t, run.channels[n]) for n in names})


def messages(found: Reduction, kind: str) -> list[str]:
    return [f.message for f in found.quality if f.kind == kind]


def of(name: str, run: Run) -> Reduction:
    return reduce(run, window=LOGS[name][1])


# ------------------------------------------------------------------------------------------------ sensors
def test_the_uncertainty_of_a_sensor_is_as_stated_and_none_without_a_sensor() -> None:
    rig = msgspec.structs.replace(built_in(), sensors={"vdc": Sensor("V", u_gain=0.01, u_zero=0.5), "idc": Sensor("A")})
    phased = find_phases(clean(), rig, "auto")
    assert [phased.u_gain(name) for name in ("vdc", "idc", "force")] == [0.01, 0.0, 0.0]
    assert [phased.u_zero(name) for name in ("vdc", "idc", "force")] == [0.5, 0.0, 0.0]


# ------------------------------------------------------------------------------------------------ load
@pytest.mark.parametrize("name", ["r45ohm", "r18ohm", "r4p5ohm"])
@pytest.mark.parametrize("factor", [0.5, 0.89, 0.975, 1.025, 1.12, 3.0])
def test_a_stated_load_that_vdc_over_idc_contradicts_is_reported_with_both(name: str, factor: float) -> None:
    load = LOGS[name][0]
    (message,) = messages(of(name, msgspec.structs.replace(clean(name), load=factor * load)), "load_mismatch")
    assert f"load {factor * load:g} ohm is stated" in message
    assert float(message.rpartition("=")[2].removesuffix("ohm")) == pytest.approx(load, rel=0.01)


@pytest.mark.parametrize("factor", [0.995, 1.005])
def test_a_load_within_five_standard_uncertainties_is_no_mismatch(factor: float) -> None:
    assert not messages(of("r45ohm", msgspec.structs.replace(clean(), load=45.0 * factor)), "load_mismatch")


def test_sensors_that_are_known_badly_allow_a_larger_deviation() -> None:
    rig = built_in()
    vague = msgspec.structs.replace(rig.sensors["idc"], u_gain=0.3)
    rig = msgspec.structs.replace(rig, sensors={**rig.sensors, "idc": vague})
    run = msgspec.structs.replace(clean(), load=45.0 / 1.5)
    assert not messages(reduce(run, rig=rig, window=5.48), "load_mismatch")


def test_an_open_circuit_that_delivers_power_is_reported() -> None:
    (message,) = messages(of("r45ohm", msgspec.structs.replace(clean(), load=math.inf)), "load_mismatch")
    assert "load inf is stated" in message
    assert "44.97 ohm" in message


def test_the_bleed_resistance_is_no_load() -> None:
    assert not messages(of("open_circuit", clean("open_circuit")), "load_mismatch")


def test_a_current_that_never_flows_contradicts_a_load() -> None:
    (message, *_) = messages(of("r45ohm", changed(clean(), idc=0.0 * clean().t)), "load_mismatch")
    assert "no load" in message


@pytest.mark.parametrize("factor", [0.7, 1.4])
def test_an_idc_computed_from_a_wrong_load_is_found_by_torque_and_by_noise(factor: float) -> None:
    load = 45.0 * factor
    run = msgspec.structs.replace(changed(clean(), idc=clean().channels["vdc"] / load), load=load)
    by_torque, by_noise = messages(of("r45ohm", run), "load_mismatch")
    assert "torque and velocity give" in by_torque
    assert f"divided by {load:.3g} ohm" in by_noise


def test_an_idc_computed_from_a_load_just_beside_is_found_by_its_noise() -> None:
    run = msgspec.structs.replace(changed(clean(), idc=clean().channels["vdc"] / 42.0), load=42.0)
    (message,) = messages(of("r45ohm", run), "load_mismatch")
    assert "idc was computed" in message


# ------------------------------------------------------------------------------------------------ slower channels
def test_a_channel_that_is_held_between_slower_updates_is_reported_with_its_mean_delay() -> None:
    every = 15
    held = clean().channels["vdc"][np.arange(clean().t.size) // every * every]
    found = messages(of("r45ohm", changed(clean(), vdc=held)), "coarse_sampling")
    assert any(
        "vdc is updated every 15 samples (0.6 s) and held in between, so that it is 0.28 s late" in m for m in found
    )


# ------------------------------------------------------------------------------------------------ lags
@pytest.mark.parametrize("name", ["r45ohm", "r4p5ohm"])
@pytest.mark.parametrize("seconds", [-1.0, -0.12, 0.12, 0.6])
@pytest.mark.parametrize(
    ("channel", "other"), [("velocity", "displacement"), ("idc", "vdc"), ("vdc", "idc"), ("force", "torque")]
)
def test_a_channel_that_was_recorded_late_is_reported(name: str, seconds: float, channel: str, other: str) -> None:
    found = messages(of(name, late(clean(name), seconds, channel)), "channel_lag")
    first, second = (channel, other) if seconds > 0 else (other, channel)
    sentences = [m for m in found if m.startswith(first) and f"behind {second}" in m]
    assert sentences
    measured = float(sentences[0].split(" s behind")[0].split()[-1])
    assert measured == pytest.approx(abs(seconds), abs=0.03)


def test_a_voltage_and_a_current_that_lag_together_are_behind_the_velocity() -> None:
    found = of("r45ohm", late(clean(), 1.0, "vdc", "idc")).quality
    (finding,) = [f for f in found if f.kind == "channel_lag" and "behind velocity" in f.message]
    assert (finding.channel, finding.message.split()[0]) == ("vdc", "vdc")


@pytest.mark.parametrize("channel", ["velocity", "displacement", "idc", "vdc", "torque", "force"])
@pytest.mark.parametrize("seconds", [-2.0, 2.0])
def test_a_lag_longer_than_a_ramp_is_reported_too(channel: str, seconds: float) -> None:
    assert messages(of("r18ohm", late(clean("r18ohm"), seconds, channel)), "channel_lag")


@pytest.mark.parametrize("channel", ["velocity", "idc", "force"])
@pytest.mark.parametrize("seconds", [-0.08, 0.08])
def test_less_than_a_tenth_of_a_second_is_no_lag(channel: str, seconds: float) -> None:
    assert not messages(of("r45ohm", late(clean(), seconds, channel)), "channel_lag")


def test_the_electrical_channels_may_lag_by_what_rotor_and_capacitor_do() -> None:
    assert not messages(of("r45ohm", late(clean(), 0.2, "vdc", "idc")), "channel_lag")
    (message, *_) = messages(of("r45ohm", late(clean(), 0.4, "vdc", "idc")), "channel_lag")
    assert message.startswith("Vdc x Idc is 0.4")


def test_a_lag_of_one_payout_is_reported_with_its_place() -> None:
    last = of("r45ohm", clean()).cycles[-1].phases
    shifted = np.where(clean().t > last.onset - 3.0, late(clean(), 0.5, "idc").channels["idc"], clean().channels["idc"])
    found = of("r45ohm", changed(clean(), idc=shifted)).quality
    (finding,) = [f for f in found if f.kind == "channel_lag" and f.channel == "idc"]
    assert finding.count == 1
    assert finding.start == pytest.approx(last.onset)


# ------------------------------------------------------------------------------------------------ zeros
ZEROS = {"torque": 0.3, "idc": 0.005, "vdc": 0.05}


@pytest.mark.parametrize("channel", ZEROS)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_zero_beyond_five_standard_uncertainties_is_reported(channel: str, sign: float) -> None:
    run = changed(clean(), **{channel: clean().channels[channel] + 12.0 * sign * ZEROS[channel]})
    (finding,) = [f for f in of("r45ohm", run).quality if f.kind == "zero_offset"]
    assert finding.channel == channel
    assert ("+" if sign > 0 else "-") in finding.message


@pytest.mark.parametrize("name", ["r45ohm", "r18ohm"])
@pytest.mark.parametrize("offset", [-4.0, 4.0])
def test_a_zero_that_steps_within_the_last_payout_is_reported_with_its_hold(name: str, offset: float) -> None:
    last = of(name, clean(name)).cycles[-1].phases
    after = clean(name).t > last.onset + 2.0
    run = changed(clean(name), torque=clean(name).channels["torque"] + offset * after)
    (finding,) = [f for f in of(name, run).quality if f.kind == "zero_offset"]
    assert finding.message.startswith("in 1 of 3 holds, but not over the whole log, torque reads up to ")
    assert last.hold is not None
    assert finding.start is not None
    assert last.hold[0] < finding.start < last.hold[1]


@pytest.mark.parametrize("drag", [-2.5, 2.5])
def test_a_torque_in_haul_in_alone_is_one_of_the_open_clutch(drag: float) -> None:
    cycles = of("r45ohm", clean()).cycles
    spans = [c.phases.haul_in for c in cycles if c.phases.haul_in is not None]
    inside = sum(((clean().t > a) & (clean().t < b)) * 1.0 for a, b in spans)
    for zero in (0.0, 0.5):
        run = changed(clean(), torque=clean().channels["torque"] + zero + drag * inside)
        (finding,) = [f for f in of("r45ohm", run).quality if f.kind in ("zero_offset", "open_clutch_torque")]
        assert (finding.kind, finding.channel, finding.count) == ("open_clutch_torque", "torque", len(spans))
        assert finding.start == pytest.approx(spans[0][0], abs=1.0)
        assert finding.end == pytest.approx(spans[-1][1], abs=1.0)
        assert f"{drag:+.1f}"[:3] in finding.message


def test_a_zero_that_haul_in_and_rests_share_is_no_torque_of_the_clutch() -> None:
    run = changed(clean(), torque=clean().channels["torque"] + 3.0)
    assert [f.kind for f in of("r45ohm", run).quality if f.channel == "torque"] == ["zero_offset"]


def test_without_a_stated_one_way_clutch_haul_in_has_no_known_torque() -> None:
    rig = parse_rig('based_on = "hsu2026"\n[drivetrain]\none_way_clutch = false\n', "rig.toml")
    run = changed(clean(), torque=clean().channels["torque"] + 10.0 * (clean().channels["velocity"] < 0.0))
    assert not messages(reduce(run, rig=rig, window=5.48), "open_clutch_torque")


def test_in_open_circuit_vdc_and_idc_have_no_known_zero() -> None:
    run = clean("open_circuit")
    run = changed(run, vdc=run.channels["vdc"] + 1.0)
    assert not messages(of("open_circuit", run), "zero_offset")


def test_a_sensor_without_a_stated_zero_is_not_evaluated() -> None:
    rig = built_in()
    rig = msgspec.structs.replace(rig, sensors={n: s for n, s in rig.sensors.items() if n != "torque"})
    run = changed(clean(), torque=clean().channels["torque"] + 10.0)
    assert not messages(reduce(run, rig=rig, window=5.48), "zero_offset")


@pytest.mark.parametrize(("offset", "reported"), [(-40.0, False), (40.0, False), (-250.0, True), (250.0, True)])
def test_the_force_at_rest_is_held_against_what_friction_allows(offset: float, reported: bool) -> None:
    found = messages(of("r45ohm", changed(clean(), force=clean().channels["force"] + offset)), "zero_offset")
    assert [m.startswith("force reads") for m in found] == [True] * reported


def test_without_pressure_the_gas_law_and_the_displacement_give_the_force() -> None:
    channels = {n: x for n, x in clean().channels.items() if n != "pressure"}
    for offset, reported in ((0.0, False), (250.0, True)):
        run = msgspec.structs.replace(clean(), channels={**channels, "force": channels["force"] + offset})
        assert bool(messages(of("r45ohm", run), "zero_offset")) is reported


def test_one_payout_alone_or_cut_is_checked_too() -> None:
    phases = of("r45ohm", clean()).cycles[0].phases
    torque = clean().channels["torque"] + 5.0
    for begin, end in ((0.0, phases.payout_end + 6.0), (phases.onset + 4.0, clean().t[-1])):
        rows = (clean().t >= begin) & (clean().t <= end)
        channels = {n: x[rows] for n, x in clean().channels.items()} | {"torque": torque[rows]}
        run = msgspec.structs.replace(clean(), t=clean().t[rows], channels=channels, samples=int(rows.sum()))
        assert [m.startswith("torque reads") for m in messages(of("r45ohm", run), "zero_offset")] == [True]


# ------------------------------------------------------------------------------------------------ windows
def test_a_window_longer_than_most_payouts_is_rejected_with_the_longest_that_fits() -> None:
    with pytest.raises(OptionError, match=r"3 of 3 payouts end before their window of 30 s.*at most 13\.4\d s"):
        reduce(clean(), window=30.0)


def test_a_window_that_fits_is_accepted_and_reported_nowhere() -> None:
    assert not messages(reduce(clean(), window=13.4), "window_beyond_payout")


def test_a_window_that_few_payouts_do_not_hold_is_reported() -> None:
    lengths = [c.phases.payout_end - c.phases.onset for c in of("r45ohm", clean()).cycles]
    between = sum(sorted(lengths)[:2]) / 2.0
    rig = parse_rig('based_on = "hsu2026"\nname = "sharp"\n[thresholds]\nsmoothing = 0.1\n', "a test")
    found = reduce(clean(), rig=rig, window=round(between, 2))
    (message,) = messages(found, "window_beyond_payout")
    assert message.startswith("1 of 3 payouts end before")
    assert len(found.complete) == 2


# ------------------------------------------------------------------------------------------------ sampling
def at_rate(folder: Path, rate: float, noise: float = 0.0) -> Run:
    path = folder / "log.csv"
    write_csv(make_log(Scenario(rate=rate, noise=noise), np.random.default_rng(1)), path)
    return read_run(path, load=36.0)


TRUE_RATE = 100.0
BAR = 0.005
"""Error of an energy from which a log is to be reported as too coarse."""


@pytest.mark.parametrize("window", [5.0, "auto", "payout"])
def test_coarse_sampling_is_reported_where_the_energies_err_and_nowhere_else(
    tmp_path: Path, window: float | str
) -> None:
    whole = at_rate(tmp_path, TRUE_RATE)
    true = reduce(whole, window=window)
    for step in (1, 2, 4, 10, 20, 50, 100):
        for first in {0, step // 3, step - 1}:
            channels = {n: x[first::step] for n, x in whole.channels.items()}
            run = msgspec.structs.replace(whole, t=whole.t[first::step], channels=channels, fs=TRUE_RATE / step)
            found = reduce(run, window=window)
            errors = [
                abs((getattr(a.metrics, m) or 0.0) / (getattr(b.metrics, m) or 1.0) - 1.0)
                for a, b in zip(found.complete, true.complete, strict=True)
                for m in ("energy_line", "energy_mech", "energy_gen")
            ]
            reported = bool(messages(found, "coarse_sampling"))
            assert max(errors) > BAR or not reported, (step, first)
            assert max(errors) < 2.0 * BAR or reported, (step, first)


def thinned(run: Run, step: int, first: int) -> Run:
    channels = {n: x[first::step] for n, x in run.channels.items()}
    return msgspec.structs.replace(run, t=run.t[first::step], channels=channels, fs=run.fs / step)


@pytest.mark.parametrize("name", ["r45ohm", "r18ohm", "r4p5ohm"])
@pytest.mark.parametrize("step", [6, 7, 8])
def test_below_5_hz_the_error_of_the_onset_is_reported(name: str, step: int) -> None:
    for first in range(step):
        assert messages(of(name, thinned(clean(name), step, first)), "coarse_sampling"), first


def test_a_log_with_no_window_of_two_samples_is_reported_as_coarse() -> None:
    found = of("r18ohm", thinned(clean("r18ohm"), 111, 6))
    assert not found.complete
    (message,) = messages(found, "coarse_sampling")
    assert message.startswith("0.225 Hz is too coarse for this motion: ")
    assert "windows are shorter than 2 sampling intervals" in message


def test_a_window_that_is_short_is_no_coarse_sampling() -> None:
    assert not messages(reduce(clean(), window=0.05), "coarse_sampling")


@pytest.mark.parametrize("name", ["r45ohm", "r18ohm", "r4p5ohm"])
@pytest.mark.parametrize(
    ("channel", "seconds"), [("velocity", 0.48), ("velocity", 1.0), ("force", 1.0), ("torque", 1.0)]
)
def test_a_channel_that_was_interpolated_from_slower_values_is_reported(
    name: str, channel: str, seconds: float
) -> None:
    run = clean(name)
    slow = np.arange(0.0, run.t[-1], seconds)
    values = np.interp(slow, run.t, run.channels[channel])
    (message,) = messages(of(name, changed(run, **{channel: np.interp(run.t, slow, values)})), "coarse_sampling")
    assert message.startswith(f"{channel} is straight between values that lie {round(25 * seconds)} samples")


def test_coarse_sampling_counts_in_the_uncertainty(tmp_path: Path) -> None:
    fine, coarse = (reduce(at_rate(tmp_path, rate), window=5.0) for rate in (25.0, 2.0))
    found = uncertainty(coarse)
    (row,) = [r for r in found.budget.rows if r.source is not None and r.source.channel == SAMPLING]
    assert row.source is not None
    assert row.source.limit is not None
    assert row.source.u == pytest.approx(row.source.limit / math.sqrt(3.0))
    assert row.of.energy_line == pytest.approx((coarse.mean.energy_line or 0.0) * row.source.u, rel=0.1)
    assert (row.of.eta_trans or 1.0) < 0.2 * row.source.u  # a window that moves changes both energies alike
    assert all(r.source is None or r.source.channel != SAMPLING for r in uncertainty(fine).budget.rows)
    true = reduce(at_rate(tmp_path, TRUE_RATE), window=5.0).mean.energy_line or 0.0
    ends = found.interval_95["energy_line"]
    assert ends.low < true < ends.high
