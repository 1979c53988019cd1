"""The checks over phases, and the kind and the words of each fault that they find."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

from winchcascade.core.run import Finding, FindingKind
from winchcascade.ingest.checks.channel_findings import text_of
from winchcascade.reduction.checks import at_rest, cycles, load, pairs, sampling
from winchcascade.reduction.checks.phased_log import Fault, PhasedLog
from winchcascade.reduction.efficiency_changes import changed_efficiencies

Check = Callable[[PhasedLog], Iterable[Fault]]

CHECKS: tuple[Check, ...] = (
    cycles.opposed_powers, load.other_load, load.shaft_power, at_rest.bench_zero, sampling.coarse_resolution,
    cycles.odd_ratios, cycles.copied_cycles,
)  # fmt: skip
"""Checks of any log with cycles."""

CHECKS_OF_MOTION: tuple[Check, ...] = (
    pairs.late, pairs.smoothed, pairs.stepped, at_rest.zeros, at_rest.open_clutch, at_rest.computed_current, at_rest.force_at_rest,
    at_rest.force_drift, sampling.coarse_sampling, sampling.slow_channel, cycles.uneven_strokes, changed_efficiencies,
)  # fmt: skip
"""Checks that need payouts which are alike, and the rests between them."""


class Words(NamedTuple):
    """Kind of a finding, what it says, and the action; both are formatted with the values of the fault."""

    kind: FindingKind
    message: str
    action: str


CHECK_ZERO = "reported and kept; energies go with it: check the zero of the sensor"

FAULTS = {
    "opposed": Words(
        "sign_mismatch",
        "the powers of {one} ({first}) and {other} ({second}) have opposite signs: their correlation over the log is {share:.2f}",
        "reported and kept; check the signs of these channels, and state a minus sign under [stage] of the rig file",
    ),
    "other_load": Words(
        "load_mismatch",
        "load {load:g} ohm is stated, but Vdc / Idc {where} is {volt:.4g} V / {ampere:.4g} A = {ohm}",
        "reported and kept; check the load, Vdc and Idc: this ratio cannot distinguish them",
    ),
    "loaded_open_circuit": Words(
        "load_mismatch",
        "load inf is stated, but Vdc {volt:.4g} V and Idc {ampere:.4g} A {where} are {watt:.3g} W, as of a load of {ohm}",
        "the log is reduced as open circuit, without eta_gen and eta_pto; state its load, or check Vdc and Idc: this ratio cannot "
        "distinguish them",
    ),
    "load_not_stated": Words(
        "load_mismatch",
        "no load is stated, and Vdc {volt:.4g} V with Idc {ampere:.4g} A {where} ({ohm}) is what an open circuit has",
        "eta_gen and eta_pto are reported as of a load; state the load: inf for an open circuit",
    ),
    "shaft_power": Words(
        "load_mismatch",
        "on the plateau Vdc x Idc is {given:.4g} W, which with the losses of the rig {rig} needs {needed:.4g} W at the shaft; "
        "torque and velocity give {taken:.4g} W",
        "reported and kept; check Vdc, Idc and torque, and whether Idc was computed from a load that is not the true one",
    ),
    "computed_current": Words(
        "load_mismatch",
        "idc was computed: at rest it repeats the noise of vdc, divided by {ohm:.3g} ohm; Vdc / Idc cannot show the load",
        "reported and kept; E_gen is right only if that is the true load: log a measured current",
    ),
    "late": Words(
        "channel_lag",
        "{late} is {seconds:.2f} s behind {early} (standard uncertainty {u:.3f} s); expected less than {limit:.2g} s",
        "reported and kept; powers take both at one time: check filters and clocks of their loggers",
    ),
    "smoothed": Words(
        "channel_lag",
        "velocity is smoothed over {width:.2f} s beside displacement: onsets and energies move",
        "reported and kept; log the velocity without a filter, or leave its column out",
    ),
    "stepped": Words(
        "gain_step",
        "{channel} steps by {step} ({share:+.1%} of its largest value) where it passes {level}, while {partner} does not",
        "reported and kept; check both channels for a meter that changes its range, and for an offset that appears under load",
    ),
    "zero": Words(
        "zero_offset",
        "{channel} reads {zero} at rest, after rotor and capacitor have run down; its zero is known to {limit}",
        CHECK_ZERO,
    ),
    "zero_in_holds": Words(
        "zero_offset",
        "in {some} of {all} holds, but not over the whole log, {channel} reads up to {zero} at rest, after rotor and capacitor have "
        "run down; its zero is known to {limit}",
        CHECK_ZERO,
    ),
    "bench_zero": Words("zero_offset", "torque reads {zero} while the shaft rests; {known}", CHECK_ZERO),
    "open_clutch": Words(
        "open_clutch_torque",
        "torque reads {drag} in haul-in, {beside}; its zero is known to {limit}",
        "reported and kept: drag of the open clutch{or_else}",
    ),
    "force_at_rest": Words(
        "zero_offset",
        "force reads {force:.0f} N at rest, where gas and friction of the screw allow {low:.0f} to {high:.0f} N",
        CHECK_ZERO + "{slack}",
    ),
    "force_drift": Words(
        "zero_offset", "force at rest changes by {over:+.0f} N over the log, beside what the gas does", CHECK_ZERO
    ),
    "no_window": Words(
        "coarse_sampling",
        "{rate:.3g} Hz is too coarse for this motion: {count} of {all} windows are shorter than {shortest:g} sampling intervals, and "
        "payouts may lie between two samples",
        "no energy is computed; log faster, or use the window payout",
    ),
    "coarse_sampling": Words(
        "coarse_sampling",
        "{rate:.3g} Hz is too coarse for this motion: every second or third sample alone changes an energy of a cycle by up to "
        "{extreme:.1%}, so that the log itself may err by {error:.1%}",
        "reported and part of the uncertainty; log faster, or use the window payout",
    ),
    "held": Words(
        "coarse_sampling",
        "{channel} is updated every {every} samples ({interval:.2g} s) and held in between, so that it is {late:.2g} s late on "
        "average; energies of {channel} may err by {share:.1%}",
        "reported and kept; log it with every sample",
    ),
    "straight": Words(
        "coarse_sampling",
        "{channel} is straight between values that lie {every} samples ({interval:.2g} s) apart, as if interpolated from a slower "
        "log, which has the effect of up to {late:.2g} s; energies of {channel} may err by {share:.1%}",
        "reported and kept; log it with every sample",
    ),
    "coarse_resolution": Words(
        "coarse_resolution",
        "{channel} is recorded in steps of {step}, {share:.1%} of its mean in the windows, beside which its noise is small; energies "
        "of {channel} may err by {error:.1%}{moves}",
        "reported and kept; record it with more digits",
    ),
    "above_one": Words(
        "efficiency_above_one",
        "{name} is above 1 {where} ({value:.4f}{place}); unless its uncertainty contains 1, check unit, gain and sign of what it is "
        "made of",
        "reported and kept",
    ),
    "below_zero": Words(
        "out_of_range",
        "{name} lies below 0 {where} ({value:.3f}{place}); check unit, gain and sign of what it is made of",
        "not reported",
    ),
    "against": Words(
        "out_of_range",
        "{name} has no value {where}, as the energy that comes in is negative ({value:.4g} J{place}): power flows against the "
        "cascade; check the sign of {channels} and the order of the stages, or state a power of the opposite sign under "
        "[stage.{stage}] of the rig file",
        "not reported",
    ),
    "too_small": Words(
        "out_of_range",
        "{name} is {value:.2g} of all cycles together: check the units of what it is made of, unless the machine runs without a load",
        "reported and kept",
    ),
    "copied": Words(
        "repeated_rows",
        "{some} of {all} cycles ({cycles}) equal earlier ones in every sample: they are copies, and repeatability and uncertainty are "
        "too small",
        "reported and kept; leave the copies out",
    ),
    "stopped": Words(
        "stroke_mismatch",
        "{count} of {all} payouts stop or slow down within their windows as the others do not: for {value:.1f} s in cycle {cycle}",
        "reported and kept; choose the cycles that count",
    ),
    "other_stroke": Words(
        "stroke_mismatch",
        "{count} of {all} payouts travel otherwise than the others: {value:.2f} m in cycle {cycle}, where {usual:.2f} m is usual",
        "reported and kept; look for half strokes and jogs, and choose the cycles that count",
    ),
    "changed_efficiency": Words(
        "efficiency_change",
        "{metric} {course} {one:.3f} in {in_one} and {other:.3f} in {in_other}, a change of {change:.1%}; speed, gaps, zeros and "
        "sampling explain {explained:.1%} at most",
        "kept as logged; look at {look_at}",
    ),
}  # fmt: skip
"""Kind and words of each fault."""


def find_faults(log: PhasedLog) -> list[Finding]:
    """Run the checks, and word what they find; numbers of a channel get its unit."""
    checks = CHECKS + (CHECKS_OF_MOTION if log.phased.rig.phases.by_motion else ())
    return [_finding(log, fault) for check in checks for fault in check(log)]


def _finding(log: PhasedLog, fault: Fault) -> Finding:
    words, count = FAULTS[fault.name], len(fault.spans) or 1
    values: dict[str, object] = {"channel": fault.channel, "count": count, **fault.values}
    for name, value in fault.read.items():
        channel = log.phased.rig.known_channels[fault.channel or ""]
        values[name] = f"{text_of(channel, value, 3)} {channel.unit}"
    message, action = words.message.format(**values), words.action.format(**values)
    start, end = (min(a for a, _ in fault.spans), max(b for _, b in fault.spans)) if fault.spans else (None, None)
    return Finding(
        words.kind, message, action, fault.channel, start, end, count if fault.places is None else fault.places
    )
