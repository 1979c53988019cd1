"""The checks over phases, and the kind and the words of each fault that they find."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from winchcascade.core.run import Finding, FindingKind
from winchcascade.ingest.checks.samples import text_of
from winchcascade.reduction.checks import at_rest, bounds, cycles, gain_steps, gains, load, sampling
from winchcascade.reduction.checks.phased_log import Fault, PhasedLog
from winchcascade.reduction.checks.relations import late
from winchcascade.reduction.efficiency_changes import changed_efficiencies
from winchcascade.reduction.reduction_result import Relation

Check = Callable[[PhasedLog], Iterable[Fault]]

CHECKS: tuple[Check, ...] = (
    cycles.opposed_powers, load.other_load, at_rest.bench_zero, sampling.coarse_resolution, cycles.odd_ratios,
    cycles.copied_cycles, gains.of_velocity, gains.of_shaft,
)  # fmt: skip
"""Checks of any log with cycles."""

CHECKS_OF_MOTION: tuple[Check, ...] = (
    gain_steps.stepped, at_rest.zeros, load.computed_current, at_rest.force_at_rest, sampling.coarse_sampling,
    sampling.held_channels, bounds.exceeded, cycles.uneven_strokes, changed_efficiencies,
)  # fmt: skip
"""Checks that need payouts which are alike, and the rests between them."""

READ = ("zero", "limit", "change", "level", "step", "reads", "drift")
"""Values of the channel in its SI unit, which are written in the unit of the log."""

KEPT = "reported and kept"
CHECK_ZERO = KEPT + "; energies go with it: check the zero of the sensor"
LOG_FASTER = KEPT + " and part of the uncertainty; log faster, or use the window payout"
OTHER_LOAD = "check the load, Vdc and Idc: this ratio cannot distinguish them"
READS = "Vdc {volt:.4g} V and Idc {ampere:.4g} A, a load of {ohm:.4g} ohm"

FAULTS: dict[str, tuple[FindingKind, str, str]] = {
    "opposed": (
        "sign_mismatch",
        "the powers of {one} ({first}) and {other} ({second}) have opposite signs: their "
        "correlation is {share:.2f}",
        KEPT + "; check the signs of these channels, and state a minus sign under [stage] of the rig file",
    ),
    "other_load": ("load_mismatch", "load {load:g} ohm is stated, and the log has " + READS, KEPT + "; " + OTHER_LOAD),
    "loaded_open_circuit": (
        "load_mismatch", "load inf is stated, and the log has " + READS,
        "reduced as open circuit, without eta_gen and eta_pto; " + OTHER_LOAD,
    ),
    "load_not_stated": (
        "load_mismatch", "no load is stated, and the log has " + READS + ", as an open circuit",
        "eta_gen and eta_pto are reported as of a load; state the load: inf for an open circuit",
    ),
    "computed_current": (
        "load_mismatch",
        "idc was computed: at rest it repeats the noise of vdc, divided by {ohm:.3g} ohm; Vdc / "
        "Idc cannot show the load",
        KEPT + "; E_gen is right only if that is the true load: log a measured current",
    ),
    "late": (
        "channel_lag",
        "lag of {group}: {seconds:.2f} s {side} {early} (95 % interval {low:.2f} to {high:.2f} "
        "s); expected less than "
        "{least:.2g} s",
        KEPT + "; powers take both at one time: check filters and clocks of their loggers",
    ),
    "zero_of_velocity": (
        "out_of_range", "velocity reads {zero} while the displacement rests",
        KEPT + "; energies deviate with it, and rest may pass for motion: check its zero",
    ),
    "velocity_or_drift": (
        "out_of_range",
        "velocity reads {reads} where the displacement moves by {drift}: one of the two drifts",
        KEPT + "; check the zero of both",
    ),
    "gain_of_velocity": (
        "out_of_range", "velocity integrates to {gain:#.4g} times the travel of the displacement",
        KEPT + "; energies are proportional to the velocity: check unit and gain of both, and the "
        "radius at which each is taken",
    ),
    "smoothed": (
        "channel_lag",
        "velocity is smoother than the displacement, as if averaged over {seconds:.2g} s",
        KEPT + "; onsets, windows and energies deviate: record it with a faster filter, or leave it "
        "out and derive it",
    ),
    "gain_of_power": (
        "out_of_range", "power_mech is {gain:#.4g} times torque x {of}",
        KEPT + "; E_mech is the integral of power_mech: check sign, unit and shaft of all of them, "
        "and r_drum",
    ),
    "gain_of_speed": (
        "speed_mismatch",
        "speed is {gain:#.4g} times velocity / r_drum while the clutch is engaged, with {radius:g} m "
        "of the rig",
        KEPT + "; the line or the clutch slips, or an entry is wrong: check r_drum, the gear ratio, "
        "and unit and side of the speed",
    ),
    "stepped": (
        "gain_step",
        "{channel} steps by {change} ({share:+.1%} of its largest value) where it passes {level}, "
        "while {partner} does not",
        KEPT + "; check both for a meter that changes its range, and for an offset that appears under load",
    ),
    "more_than_line": (
        "gain_mismatch",
        "on the plateau the torque is {ratio:.3f} times what the line gives beyond its tension at "
        "rest (95 % interval "
        "{low:.3f} to {high:.3f}), and no drum gives more than it takes",
        KEPT + "; the torque reads too much, or the force too little: check their gains and r_drum",
    ),
    "more_than_shaft": (
        "gain_mismatch",
        "on the plateau P_gen and the losses of the rig file are {ratio:.3f} times the power of "
        "the shaft (95 % interval "
        "{low:.3f} to {high:.3f}), and no machine gives more than it takes",
        KEPT + "; torque or velocity read too little, or Vdc or Idc too much: check their gains, r_drum and the gear ratio",
    ),
    "more_than_emf": (
        "gain_mismatch",
        "on the plateau Vdc is {ratio:.3f} times the peak of the back-EMF at this speed (95 % "
        "interval {low:.3f} to "
        "{high:.3f})",
        KEPT + "; the velocity reads too little, or Vdc too much: check their gains, k_e, r_drum and the gear ratio",
    ),
    "zero": (
        "zero_offset",
        "{channel} reads {zero} {where}; its zero has a standard uncertainty of {limit}",
        CHECK_ZERO,
    ),
    "zero_of_unknown_sensor": (
        "zero_offset", "{channel} reads {zero} {where}; the rig file states no accuracy of the "
                       "sensor", CHECK_ZERO,
    ),
    "force_at_rest": (
        "zero_offset", "force reads {force:.0f} N at rest, where gas and friction of the screw "
                       "allow {low:.0f} to {high:.0f} N",
        CHECK_ZERO + ", and whether the line was slack",
    ),
    "force_drift": ("zero_offset", "force at rest changes by {over:+.0f} N over the log, beside "
                                   "what the gas does", CHECK_ZERO),
    "coarse_sampling": (
        "coarse_sampling",
        "{rate:.3g} Hz is too coarse for this motion: by every second and third sample, a mean "
        "energy errs by {error:.1%}",
        LOG_FASTER,
    ),
    "held": (
        "coarse_sampling",
        "{channel} is updated every {every} samples ({interval:.2g} s) and held, {late:.2g} s "
        "late on average; its energies "
        "may err by {error:.1%}",
        KEPT + "; log it with every sample",
    ),
    "coarse_resolution": (
        "coarse_resolution",
        "{channel} is recorded in steps of {step}, more than its noise; its energies may err by "
        "{error:.1%}",
        KEPT + "; record it with more digits",
    ),
    "above_one": (
        "efficiency_above_one",
        "{name} is above 1 ({value:.4f} in {place}); unless its uncertainty contains 1, check "
        "units, gains and signs",
        KEPT,
    ),
    "below_zero": (
        "out_of_range", "{name} lies below 0 ({value:.3f} in {place}); check units, gains and "
                        "signs", "not reported",
    ),
    "against": (
        "out_of_range",
        "{name} has no value in {place}, as the energy that comes in is negative ({put:.4g} J): "
        "power flows against the "
        "cascade; check the sign of {channels} and the order of the stages, or state a power of "
        "the opposite sign under "
        "[stage.{stage}] of the rig file",
        "not reported",
    ),
    "too_small": (
        "out_of_range",
        "{name} is {value:.2g} of all cycles together: check the units of what it is made of, "
        "unless nothing is delivered",
        KEPT,
    ),
    "copied": (
        "repeated_rows",
        "{count} of {all} cycles ({cycles}) equal earlier ones in every sample: repeatability and "
        "uncertainty are too low",
        KEPT + "; leave the copies out",
    ),
    "stopped": (
        "stroke_mismatch",
        "{count} of {all} payouts stop or slow down within their windows as the others do not: "
        "cycle {cycle} travels "
        "{value:.0%} of what its speed allows, where {usual:.0%} is usual",
        KEPT + "; choose the cycles that count",
    ),
    "other_stroke": (
        "stroke_mismatch",
        "{count} of {all} payouts travel otherwise than the others: cycle {cycle} {value:.2f} m, "
        "where {usual:.2f} m is usual",
        KEPT + "; look for half strokes and jogs, and choose the cycles that count",
    ),
    "changed_efficiency": (
        "efficiency_change",
        "{metric} {course} {one:.3f} in {in_one} and {other:.3f} in {in_other}, a change of "
        "{change:.1%}; speed, gaps, zeros "
        "and sampling explain {explained:.1%} at most",
        "kept as logged; look at {look_at}",
    ),
}  # fmt: skip
"""Kind of the finding on each fault, what it says, and the action; both are formatted with the
values of the fault.
"""


def find_faults(log: PhasedLog, relations: Sequence[Relation]) -> list[Finding]:
    """Run the checks, and word what they find; what a channel reads gets its unit."""
    checks = CHECKS + (CHECKS_OF_MOTION if log.rig.phases.by_motion else ())
    faults = [*late(log, relations), *(fault for check in checks for fault in check(log))]
    return [_finding(log, fault) for fault in faults]


def _finding(log: PhasedLog, fault: Fault) -> Finding:
    kind, message, action = FAULTS[fault.name]
    count = len(fault.spans) or 1
    values: dict[str, object] = {"channel": fault.channel, "count": count, **fault.values}
    channel = log.rig.known_channels.get(fault.channel or "")
    for name, value in fault.values.items():
        if name in READ and channel is not None and isinstance(value, float):
            values[name] = f"{text_of(channel, value, 3)} {channel.unit}"
    start, end = (
        (min(a for a, _ in fault.spans), max(b for _, b in fault.spans))
        if fault.spans
        else (None, None)
    )
    places = count if fault.places is None else fault.places
    return Finding(
        kind, message.format(**values), action.format(**values), fault.channel, start, end, places
    )
