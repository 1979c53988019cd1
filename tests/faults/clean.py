"""Logs without a fault of every source: any finding on them is a false one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np
from fault_logs import (
    CAMPAIGN,
    ROOT,
    Finding,
    Log,
    Result,
    Signal,
    base,
    found,
    noisy,
    result,
    stroke_velocity,
    twin,
)
from injected import log_uniform
from unusual import unusual_rigs
from verdicts import moved

from winchcascade import RigError, read_run, reduce

SHARED = ROOT.parent / "shared" / "data"
RATES = (5.0, 10.0, 25.0, 50.0, 100.0)
LIMITS = {"force": 19613.3, "torque": 500.0}
"""Ends of the ranges of the sensors of the paper, in the unit of the file: a log of the twin may
exceed them.
"""

DESERVED = {
    "rig_assumed",
    "thresholds_assumed",
    "phase_source",
    "incomplete_cycle",
    "load_mismatch",
}
"""Findings that campaigns with labels deserve: some name no rig, one states no thresholds of its
rig, one has waves without a rest, one states a wrong load."""

OF_RIG = {"thresholds_assumed", "derived_channel", "missing_channel"}
"""Findings that a log of another rig deserves: its rig file states no thresholds, or it lacks a
channel."""


LATE = ("labelled/electrical_lag/", "channel_lag", "vdc")
"""Campaign whose truth is a lag of Vdc and Idc, and the finding that its logs alone deserve."""

Named = Iterator[tuple[str, Result, Result | None, Mapping[str, Signal]]]
"""Name, result, result of the same motion at a high rate if that is known, and the channels in
the units of the file.
"""


def folders(place: str) -> Callable[[], Named]:
    """Logs of campaigns, by the window of the campaign and by the two rules."""

    def named() -> Named:
        root = CAMPAIGN if place == "campaign" else SHARED / place
        for path in sorted(root.rglob("*.csv")):
            if (path.parent / "campaign.toml").is_file():
                try:
                    run = read_run(path)
                except RigError:  # a rig file with keys of long ago
                    continue
                for window in (None, "auto", "payout"):
                    yield (
                        f"{place}/{path.relative_to(root)} window {window}",
                        found(reduce(run, window=window)),
                        None,
                        run.channels,
                    )

    return named


def resampled() -> Named:
    """The fixture logs at other rates, by their own window and by the two rules."""
    for name in ("r36ohm", "r4p5ohm", "r18ohm"):
        for rate in (10.0, 50.0, 100.0, 200.0):
            log = base(name, rate)
            for window in (log.window, "auto", "payout"):
                yield (
                    f"{name} at {rate:g} Hz window {window}",
                    result(replace(log, window=window)),
                    None,
                    log.table,
                )


def twins() -> Named:
    """The motion of fixture logs in the twin, with and without noise, at five rates."""
    for name, load in (
        ("r4p5ohm", 4.5),
        ("r9ohm", 9.0),
        ("r18ohm", 18.0),
        ("r45ohm", 45.0),
        ("open_circuit", np.inf),
    ):
        run = read_run(CAMPAIGN / f"{name}.csv")
        t = np.arange(run.t[0], run.t[-1], 0.01)
        smooth = np.convolve(run.channels["velocity"], np.bartlett(9) / 4.0, "same")
        fine = twin(t, np.interp(t, run.t, smooth), load)
        for window in (5.96, "auto", "payout"):
            true = result(Log(name, 100.0, fine, load, window))
            for rate in RATES:
                for share in (0.0, 1.0):
                    table = noisy(
                        {c: fine[c].to_numpy()[:: round(100 / rate)] for c in fine},
                        np.random.default_rng(3),
                        share,
                    )
                    log = Log(name, rate, table, load, window)
                    yield (
                        f"twin of {name} at {rate:g} Hz noise {share:g} window {window}",
                        result(log),
                        true,
                        log.table,
                    )


def unusual() -> Named:
    """200 logs of the twin: 0.1 to 10 m/s2, 0.1 to 2 m/s, strokes of 2 to 9 m, 5 to 200 Hz, all
    loads.
    """
    for k in range(200):
        rng = np.random.default_rng([20261127, k])
        load = float(rng.choice([4.5, 9.0, 18.0, 27.0, 36.0, 45.0]))
        speed = log_uniform(rng, 0.1, min(2.0, 0.45 + 0.04 * load))
        acceleration, length = (
            log_uniform(rng, max(0.1, speed**2 / 1.8), 10.0),
            (2.0, 2.0, rng.uniform(2.0, 9.0))[k % 3],
        )
        rate = float(rng.choice([5.0, 10.0, 25.0, 50.0, 100.0, 200.0]))
        t, velocity = stroke_velocity(
            [(length, speed * (1 + 0.02 * rng.uniform(-1, 1)), acceleration, 0.0)] * 3, 200.0
        )
        fine = twin(t, velocity, load)
        window = ("auto", "payout")[k // 3 % 2]
        table = noisy(fine.iloc[:: round(200 / rate)], rng)
        log = Log(f"{k}", rate, table, load, window)
        what = f"{k}: {speed:.2f} m/s, {acceleration:.2f} m/s2, {length:.1f} m, {load:g} ohm, {rate:g} Hz, {window}"
        yield what, result(log), result(Log(f"{k}", 200.0, fine, load, window)), table


SOURCES: dict[str, Callable[[], Named]] = {
    **{place: folders(place) for place in ("campaign", "labelled", "harder", "own_simulation")},
    "fixtures at other rates": resampled,
    "twin": twins,
    "unusual strokes": unusual,
    "unusual rigs": unusual_rigs,
}
"""Undamaged logs by source; those beside the project are absent elsewhere."""


def false_findings(source: str) -> tuple[int, list[str]]:
    """Number of reductions of a source, and the false findings of each one that has any."""
    logs, words = 0, []
    for name, seen, true, channels in SOURCES[source]():
        logs += 1
        coarse = true is not None and bool(moved(true, seen))
        false = [
            f"{f.kind} {f.channel or ''}: {f.message}"
            for f in seen.findings
            if not deserved(f, name, true, coarse, channels)
        ]
        false += [f"rejected: {seen.rejected}"] if seen.rejected else []
        words += [f"{name}: {'; '.join(false)}"] if false else []
    return logs, words


def deserved(
    finding: Finding, name: str, true: Result | None, coarse: bool, channels: Mapping[str, Signal]
) -> bool:
    """Whether a log deserves a finding: a rate that moves a number, a sensor beyond its range, a
    line below zero tension.
    """
    if finding.kind in ("coarse_sampling", "coarse_resolution"):
        return coarse
    if finding.kind == "out_of_range" and finding.channel in LIMITS:
        return bool(np.max(channels[finding.channel]) > LIMITS[finding.channel])
    if finding.kind == "slack_line":
        return bool(np.min(channels["force"]) < 0.0)
    if finding.kind in OF_RIG and "force and voltage" in name:
        return True
    if finding.kind == "stroke_mismatch":
        return ", uneven" in name
    campaign, *late = LATE
    late_here = name.startswith(campaign) and [finding.kind, finding.channel] == late
    return true is None and (finding.kind in DESERVED or late_here)
