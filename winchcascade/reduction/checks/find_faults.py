"""The checks over phases, and the kind and the words of each fault that they find."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from winchcascade.core.run import Finding, FindingKind
from winchcascade.ingest.checks.samples import text_of
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
    pairs.in_step, at_rest.zeros, at_rest.open_clutch, at_rest.computed_current,
    at_rest.force_at_rest, at_rest.force_drift, sampling.coarse_sampling, sampling.slow_channel, cycles.uneven_strokes,
    changed_efficiencies,
)  # fmt: skip
"""Checks that need payouts which are alike, and the rests between them."""


SIGNED = ("zero", "drag", "change")
"""Values of a channel that are written with their sign."""

CHECK_ZERO = "reported and kept; energies go with it: check the zero of the sensor"
EVERY_SAMPLE = "reported and kept; log it with every sample"
LOG_FASTER = "log faster, or use the window payout"
OTHER_LOAD = "check the load, Vdc and Idc: this ratio cannot distinguish them"

FAULTS: dict[str, tuple[FindingKind, str, str]] = {
    "opposed": (
        "sign_mismatch",
        "the powers of {one} ({first}) and {other} ({second}) have opposite signs: their correlation is {share:.2f}",
        "reported and kept; check the signs of these channels, and state a minus sign under [stage] of the rig file",
    ),
    "other_load": (
        "load_mismatch",
        "load {load:g} ohm is stated, but Vdc / Idc {where} is {volt:.4g} V / {ampere:.4g} A = {ohm}",
        "reported and kept; " + OTHER_LOAD,
    ),
    "loaded_open_circuit": (
        "load_mismatch",
        "load inf is stated, but Vdc {volt:.4g} V and Idc {ampere:.4g} A {where} are {watt:.3g} W, as of a load of {ohm}",
        "reduced as open circuit, without eta_gen and eta_pto; " + OTHER_LOAD,
    ),
    "load_not_stated": (
        "load_mismatch",
        "no load is stated, and Vdc {volt:.4g} V with Idc {ampere:.4g} A {where} ({ohm}) is what an open circuit has",
        "eta_gen and eta_pto are reported as of a load; state the load: inf for an open circuit",
    ),
    "shaft_power": (
        "load_mismatch",
        "on the plateau Vdc x Idc of {given:.4g} W and the losses of the rig {rig} need {needed:.4g} W at the shaft; torque "
        "and velocity give {taken:.4g} W",
        "reported and kept; check Vdc, Idc and torque, and whether Idc was computed from a load that is not the true one",
    ),
    "computed_current": (
        "load_mismatch",
        "idc was computed: at rest it repeats the noise of vdc, divided by {ohm:.3g} ohm; Vdc / Idc cannot show the load",
        "reported and kept; E_gen is right only if that is the true load: log a measured current",
    ),
    "late": (
        "channel_lag",
        "{late} is {seconds:.2f} s behind {early} (standard uncertainty {u:.3f} s); expected less than {limit:.2g} s",
        "reported and kept; powers take both at one time: check filters and clocks of their loggers",
    ),
    "smoothed": (
        "channel_lag",
        "velocity is smoothed over {width:.2f} s beside displacement: onsets and energies move",
        "reported and kept; log the velocity without a filter, or leave its column out",
    ),
    "stepped": (
        "gain_step",
        "{channel} steps by {change} ({share:+.1%} of its largest value) where it passes {level}, while {partner} does not",
        "reported and kept; check both for a meter that changes its range, and for an offset that appears under load",
    ),
    "zero": (
        "zero_offset",
        "{channel} reads {zero} at rest, after rotor and capacitor have run down; its zero is known to {limit}",
        CHECK_ZERO,
    ),
    "zero_in_holds": (
        "zero_offset",
        "in {count} of {all} holds, but not over the whole log, {channel} reads up to {zero}; its zero is known to {limit}",
        CHECK_ZERO,
    ),
    "bench_zero": ("zero_offset", "torque reads {zero} while the shaft rests; {known}", CHECK_ZERO),
    "open_clutch": (
        "open_clutch_torque",
        "torque reads {drag} in haul-in, {beside}; its zero is known to {limit}",
        "reported and kept: drag of the open clutch{or_else}",
    ),
    "force_at_rest": (
        "zero_offset",
        "force reads {force:.0f} N at rest, where gas and friction of the screw allow {low:.0f} to {high:.0f} N",
        CHECK_ZERO + "{slack}",
    ),
    "force_drift": ("zero_offset", "force at rest changes by {over:+.0f} N over the log, beside what the gas does", CHECK_ZERO),
    "no_window": (
        "coarse_sampling",
        "{rate:.3g} Hz is too coarse for this motion: {count} of {all} windows are shorter than {shortest:g} samples",
        "no energy is computed; " + LOG_FASTER,
    ),
    "coarse_sampling": (
        "coarse_sampling",
        "{rate:.3g} Hz is too coarse for this motion: every second or third sample alone changes an energy of a cycle by up to "
        "{extreme:.1%}, so that the log itself may err by {error:.1%}",
        "reported and part of the uncertainty; " + LOG_FASTER,
    ),
    "held": (
        "coarse_sampling",
        "{channel} is updated every {every} samples ({interval:.2g} s) and held, {late:.2g} s late on average; energies of "
        "{channel} may err by {share:.1%}",
        EVERY_SAMPLE,
    ),
    "straight": (
        "coarse_sampling",
        "{channel} is straight between values that lie {every} samples ({interval:.2g} s) apart, as if interpolated from a "
        "slower log; energies of {channel} may err by {share:.1%}",
        EVERY_SAMPLE,
    ),
    "coarse_resolution": (
        "coarse_resolution",
        "{channel} is recorded in steps of {step}, {share:.1%} of its mean in the windows and more than its noise; energies of "
        "{channel} may err by {error:.1%}{moves}",
        "reported and kept; record it with more digits",
    ),
    "above_one": (
        "efficiency_above_one",
        "{name} is above 1 {where} ({value:.4f}{place}); unless its uncertainty contains 1, check units, gains and signs",
        "reported and kept",
    ),
    "below_zero": (
        "out_of_range", "{name} lies below 0 {where} ({value:.3f}{place}); check units, gains and signs", "not reported",
    ),
    "against": (
        "out_of_range",
        "{name} has no value {where}, as the energy that comes in is negative ({value:.4g} J{place}): power flows against the "
        "cascade; check the sign of {channels} and the order of the stages, or state a power of the opposite sign under "
        "[stage.{stage}] of the rig file",
        "not reported",
    ),
    "too_small": (
        "out_of_range",
        "{name} is {value:.2g} of all cycles together: check the units of what it is made of, unless nothing is delivered",
        "reported and kept",
    ),
    "copied": (
        "repeated_rows",
        "{count} of {all} cycles ({cycles}) equal earlier ones in every sample: repeatability and uncertainty are too low",
        "reported and kept; leave the copies out",
    ),
    "stopped": (
        "stroke_mismatch",
        "{count} of {all} payouts stop or slow down within their windows as the others do not: cycle {cycle} travels "
        "{value:.0%} of what its speed allows, where {usual:.0%} is usual",
        "reported and kept; choose the cycles that count",
    ),
    "other_stroke": (
        "stroke_mismatch",
        "{count} of {all} payouts travel otherwise than the others: cycle {cycle} {value:.2f} m, where {usual:.2f} m is usual",
        "reported and kept; look for half strokes and jogs, and choose the cycles that count",
    ),
    "changed_efficiency": (
        "efficiency_change",
        "{metric} {course} {one:.3f} in {in_one} and {other:.3f} in {in_other}, a change of {change:.1%}; speed, gaps, zeros "
        "and sampling explain {explained:.1%} at most",
        "kept as logged; look at {look_at}",
    ),
}  # fmt: skip
"""Kind of the finding on each fault, what it says, and the action; both are formatted with the values of the fault."""


def find_faults(log: PhasedLog) -> list[Finding]:
    """Run the checks, and word what they find; numbers of a channel get its unit."""
    checks = CHECKS + (CHECKS_OF_MOTION if log.phased.rig.phases.by_motion else ())
    return [_finding(log, fault) for check in checks for fault in check(log)]


def _finding(log: PhasedLog, fault: Fault) -> Finding:
    kind, message, action = FAULTS[fault.name]
    count = len(fault.spans) or 1
    values: dict[str, object] = {"channel": fault.channel, "count": count, **fault.values}
    for name, value in fault.read.items():
        channel = log.phased.rig.known_channels[fault.channel or ""]
        sign = "+" if name in SIGNED and value > 0.0 else ""
        values[name] = f"{sign}{text_of(channel, value, 3)} {channel.unit}"
    start, end = (min(a for a, _ in fault.spans), max(b for _, b in fault.spans)) if fault.spans else (None, None)
    places = count if fault.places is None else fault.places
    return Finding(kind, message.format(**values), action.format(**values), fault.channel, start, end, places)
