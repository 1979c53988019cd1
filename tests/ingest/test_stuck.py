"""Stuck channels are recognised by physics and by the noise that they lack; an encoder at rest is not stuck."""

from collections.abc import Sequence
from functools import cache
from itertools import product

import numpy as np
import pytest
from loops import all_pairs, failures
from shipped_log import NAMES, Signal, channels
from synthetic import SCENARIOS, make_log, truth

from winchcascade import load_rig
from winchcascade.ingest.checks.quality import Checked, check
from winchcascade.ingest.checks.stuck import motion

RIG = load_rig("hsu2026")
NOISY = tuple(name for name in NAMES if name != "displacement")


@cache
def log(name: str) -> tuple[Signal, dict[str, Signal]]:
    made = make_log(SCENARIOS[name], np.random.default_rng(3))
    return made.t, channels(np.column_stack((made.t, *made.columns.values())))


@cache
def places(name: str) -> dict[str, float]:
    """Instants in the second cycle [s]."""
    cycle = truth(SCENARIOS[name]).cycles[1]
    assert cycle.hold is not None
    assert cycle.haul_in is not None
    return {
        "rest": cycle.onset - 4.0,
        "ramp": cycle.onset + 0.8,
        "plateau": cycle.onset + 5.0,
        "braking": cycle.payout[1] - 1.2,
        "hold": cycle.hold[0] + 1.08,  # where no torque happens to read 0, which is what a stage gives out at rest
        "haul_in": cycle.haul_in[0] + 1.0,
    }


def freeze(name: str, which: Sequence[str], start: float, seconds: float, value: float | None = None) -> Checked:
    t, signals = log(name)
    inside = (t >= start - 1e-9) & (t <= start + seconds + 1e-9)
    copies = {n: x.copy() for n, x in signals.items()}
    for n in which:
        copies[n][inside] = copies[n][inside][0] if value is None else value
    return check(t, copies, RIG, simulated=False, open_circuit=False)


HELD = ("stuck", "dead_channel")
"""Kinds of findings on a channel that holds a value, the second one on one that is zero throughout."""


def stuck(found: Checked) -> set[str | None]:
    others = {(f.kind, f.channel) for f in found.findings if f.kind not in (*HELD, "derived_channel")}
    assert others <= {("out_of_range", "torque")}  # which the heavy load really has
    return {f.channel for f in found.findings if f.kind in HELD}


def is_stuck(name: str, channel: str, where: str, seconds: float) -> Checked:
    """A channel is frozen for some seconds, and it alone is found to be stuck."""
    found = freeze(name, [channel], places(name)[where], seconds)
    assert stuck(found) == {channel}
    return found


def test_a_noisy_channel_that_holds_one_value_for_a_second_is_stuck() -> None:
    def check(name: str, channel: str, where: str, seconds: float) -> None:
        (finding,) = is_stuck(name, channel, where, seconds).findings
        assert finding.start == pytest.approx(places(name)[where], abs=0.1)
        assert finding.count == pytest.approx(seconds * SCENARIOS[name].rate, abs=2)

    where = ["rest", "ramp", "plateau", "braking", "hold", "haul_in"]
    assert failures(check, all_pairs(["smooth", "hundred_hertz"], NOISY, where, [1.0, 3.0, 10.0])) == []


def test_a_value_beyond_the_range_of_its_sensor_is_not_stuck() -> None:
    t, signals = log("smooth")
    high = RIG.sensors["torque"].high
    assert high is not None
    clipped = signals | {"torque": np.minimum(4.0 * signals["torque"], 1.01 * high)}
    found = check(t, {n: x.copy() for n, x in clipped.items()}, RIG, simulated=False, open_circuit=False)
    kinds = {f.kind for f in found.findings if f.channel == "torque"}
    assert "out_of_range" in kinds
    assert "stuck" not in kinds


def test_ten_samples_of_one_value_are_enough_where_noise_never_repeats() -> None:
    channels, where = ["force", "torque", "vdc", "idc"], ["ramp", "plateau", "braking"]
    assert failures(is_stuck, product(["smooth"], channels, where, [0.4])) == []


@pytest.mark.parametrize("channel", ["torque", "vdc", "idc"])
def test_at_ten_hertz_six_samples_of_one_value_are_enough(channel: str) -> None:
    t, signals = log("hundred_hertz")
    copies = {n: x[::10].copy() for n, x in signals.items()}
    first = int(np.searchsorted(t[::10], places("hundred_hertz")["plateau"]))
    copies[channel][first : first + 6] = copies[channel][first]
    found = check(t[::10], copies, RIG, simulated=False, open_circuit=False)
    assert [(f.channel, f.count) for f in found.findings if f.kind == "stuck"] == [(channel, 5)]


def test_a_noise_free_channel_is_stuck_where_speed_or_travel_should_change_it() -> None:
    assert failures(is_stuck, product(["exact"], NAMES, ["ramp", "braking"], [1.0, 3.0])) == []


def test_a_displacement_that_stops_while_the_line_moves_is_stuck() -> None:
    where = ["ramp", "plateau", "braking", "haul_in"]
    assert failures(is_stuck, product(["smooth"], ["displacement"], where, [0.4, 1.0, 3.0, 10.0])) == []


@pytest.mark.parametrize("name", ["smooth", "exact", "creep_for_hours", "idle_for_hours"])
def test_an_encoder_at_rest_is_not_stuck(name: str) -> None:
    t, signals = log(name)
    assert check(t, dict(signals), RIG, simulated=False, open_circuit=False).findings == ()


@pytest.mark.parametrize("where", ["ramp", "plateau", "braking"])
def test_an_encoder_that_stops_counting_is_found_by_the_torque(where: str) -> None:
    t, signals = log("smooth")
    inside = (t >= places("smooth")[where]) & (t <= places("smooth")[where] + 3.0)
    copies = {n: x.copy() for n, x in signals.items()}
    copies["velocity"][inside] = 0.0
    copies["displacement"][inside] = copies["displacement"][inside][0]
    found = check(t, copies, RIG, simulated=False, open_circuit=False).findings
    assert any(f.channel == "velocity" and f.kind in ("stuck", "spike") for f in found)


def test_a_channel_that_is_one_value_throughout_is_left_out() -> None:
    def check(name: str, channel: str, value: float | None) -> None:
        t, signals = log(name)
        found = freeze(name, [channel], t[0], t[-1], value)
        assert stuck(found) == {channel}
        assert channel not in found.channels
        (finding,) = [f for f in found.findings if f.kind in HELD]
        assert finding.kind == ("dead_channel" if value == 0.0 or signals[channel][0] == 0.0 else "stuck")
        assert (finding.start, finding.end, finding.count) == (t[0], t[-1], t.size)

    channels = [n for n in NAMES if n not in ("velocity", "displacement")]
    assert failures(check, all_pairs(["smooth", "exact", "heavy_load"], channels, [None, 0.0])) == []


@pytest.mark.parametrize("name", ["smooth", "exact"])
def test_a_dead_displacement_is_left_out_and_a_dead_velocity_derived_from_it(name: str) -> None:
    t, _ = log(name)
    assert "displacement" not in freeze(name, ["displacement"], t[0], t[-1]).channels
    derived = freeze(name, ["velocity"], t[0], t[-1])
    assert stuck(derived) == {"velocity"}
    assert [f.channel for f in derived.findings if f.kind == "derived_channel"] == ["velocity"]
    assert np.ptp(derived.channels["velocity"]) > 1


def test_no_current_is_not_stuck_in_open_circuit() -> None:
    t, signals = log("open_circuit")
    copies = {n: x.copy() for n, x in signals.items()} | {"idc": np.zeros(t.size)}
    assert check(t, dict(copies), RIG, simulated=False, open_circuit=True).findings == ()


def test_a_torque_that_hangs_does_not_blame_the_encoder_at_rest() -> None:
    start = places("smooth")["plateau"]
    assert stuck(freeze("smooth", ["torque"], start, 14.0)) == {"torque"}


def test_the_position_of_the_line_is_the_integral_of_its_velocity() -> None:
    t = np.cumsum([0.0, 0.1, 0.3, 0.1, 0.2])
    assert motion(t, 2.0 * t, 0.03).position() == pytest.approx(t**2)
