"""What the machine does is kept as logged: steps, ringing, snap loads, stops, an open clutch, a
chopper; no fault is found.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from loops import all_pairs, failures
from shipped_log import Signal, channels
from synthetic import SCENARIOS, make_log

from winchcascade import load_rig
from winchcascade.ingest.checks.quality import check

RIG = load_rig("hsu2026")
Log = tuple[Signal, dict[str, Signal]]
Event = Callable[[Signal, dict[str, Signal], int], None]


def logged(rate: float = 25.0, noise: float = 1.0) -> Log:
    made = make_log(replace(SCENARIOS["smooth"], rate=rate, noise=noise), np.random.default_rng(3))
    return made.t, channels(np.column_stack((made.t, *made.columns.values())))


def repaired(t: Signal, signals: dict[str, Signal]) -> list[tuple[str, str | None]]:
    copies = {name: x.copy() for name, x in signals.items()}
    found = check(t, copies, RIG, simulated=False, open_circuit=False).findings
    return [(f.kind, f.channel) for f in found if f.kind in ("spike", "stuck", "dropped_samples")]


def with_travel(t: Signal, x: dict[str, Signal], k: int) -> None:
    """Let the displacement follow a velocity that was changed."""
    x["displacement"] = np.append(0.0, np.cumsum(np.diff(t) * x["velocity"][1:]))


def ring(hertz: float) -> Event:
    def event(t: Signal, x: dict[str, Signal], k: int) -> None:
        later = np.clip(t - t[k], 0.0, None)
        x["force"] += 6000.0 * np.exp(-3.0 * later) * np.sin(2.0 * np.pi * hertz * later)

    return event


def decay(name: str, size: float) -> Event:
    def event(t: Signal, x: dict[str, Signal], k: int) -> None:
        later = t - t[k]
        x[name] += np.where(later >= 0.0, size * np.exp(-np.clip(later, 0.0, 9.0) / 0.06), 0.0)

    return event


def change(samples: int, **factors: float) -> Event:
    def event(t: Signal, x: dict[str, Signal], k: int) -> None:
        for name, factor in factors.items():
            x[name][k : k + samples] *= factor
        if "velocity" in factors:
            with_travel(t, x, k)

    return event


def chopped(t: Signal, x: dict[str, Signal], k: int) -> None:
    off = (np.arange(t.size) % 20 < 3) & (x["velocity"] > 0.3)
    for name, share in {"torque": 0.3, "vdc": 0.9, "idc": 0.0}.items():
        x[name] = np.where(off, share * x[name], x[name])


EVENTS: dict[str, Event] = {
    **{f"rings at {hertz} Hz": ring(hertz) for hertz in (1.5, 3.0, 5.7, 8.0, 11.0)},
    **{
        f"decay of {name}": decay(name, size)
        for name, size in {"torque": 150.0, "vdc": 80.0, "force": 1500.0}.items()
    },
    **{f"slack line, {n}": change(n, force=0.02, torque=0.02) for n in (2, 3, 5)},
    **{f"snap load, {n}": change(n, force=1.5, torque=1.5) for n in (2, 3, 5)},
    **{f"load off, {n}": change(n, force=0.3, torque=0.1, vdc=0.3, idc=0.3) for n in (6, 8, 20)},
    **{
        f"crane at {share} of its speed": change(
            50, velocity=share, force=0.2, torque=0.0, vdc=0.0, idc=0.0
        )
        for share in (0.0, 0.2)
    },
    "open clutch": change(25, velocity=0.6, torque=0.0, vdc=0.02, idc=0.02),
    "chopper": chopped,
}


@pytest.mark.parametrize("rate", [25.0, 100.0])
@pytest.mark.parametrize("event", EVENTS)
def test_an_event_that_the_machine_makes_is_no_fault(event: str, rate: float) -> None:
    t, signals = logged(rate)
    out = np.flatnonzero(signals["velocity"] > 0.8 * signals["velocity"].max())
    signals = {name: x.copy() for name, x in signals.items()}
    EVENTS[event](t, signals, int(out[out.size // 4]))
    assert repaired(t, signals) == []


def test_a_logger_with_coarse_steps_or_held_updates_has_no_fault() -> None:
    def coarse(steps: int, noise: float) -> None:
        t, signals = logged(noise=noise)
        rounded = {
            name: np.round(x / np.ptp(x) * steps) * np.ptp(x) / steps for name, x in signals.items()
        }
        assert repaired(t, rounded) == []

    def held(rows: int, noise: float) -> None:
        t, signals = logged(100.0, noise)
        assert (
            repaired(t, {name: x[np.arange(x.size) // rows * rows] for name, x in signals.items()})
            == []
        )

    assert failures(coarse, all_pairs([10, 30, 100], [0.0, 0.3, 1.0])) == []
    assert failures(held, all_pairs([2, 3, 5], [0.0, 0.3, 1.0])) == []
