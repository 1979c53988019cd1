"""Reduce one run to its cycles: phases, windows, energies, efficiencies, repeatability and bins."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from msgspec.structs import replace

from winchcascade.core.arguments import CYCLES, check_arguments
from winchcascade.core.errors import LogError, OptionError
from winchcascade.core.integrate import integrals_of
from winchcascade.core.jobs import side_by_side
from winchcascade.core.log_thresholds import thresholds_finding, with_thresholds
from winchcascade.core.rig_file import Rig, WindowRule
from winchcascade.core.rig_toml import given_rig
from winchcascade.core.run import Finding, Run, Signal
from winchcascade.core.viewed import LateModule
from winchcascade.reduction.bins import Bin, bins_of
from winchcascade.reduction.checks.find_faults import find_faults
from winchcascade.reduction.checks.load import measured_load
from winchcascade.reduction.checks.phased_log import PhasedLog
from winchcascade.reduction.checks.relations import relations_of
from winchcascade.reduction.checks.sampling import sampled, thinned_changes
from winchcascade.reduction.efficiency import Metrics, metrics, together
from winchcascade.reduction.energies import (
    Energies,
    find_net_spans,
    integrate_energies,
    net_metrics,
)
from winchcascade.reduction.phase_proposal import no_cycles, other_source
from winchcascade.reduction.phase_summary import PhaseSummary, summarise
from winchcascade.reduction.phased_run import (
    PhasedRun,
    check_lengths,
    find_phases,
    find_window,
    find_windows,
)
from winchcascade.reduction.reduction_result import CycleResult, Reduction

if TYPE_CHECKING:
    import pandas as pd
else:
    pd = LateModule("pandas")


def window_rule(word: str | float) -> WindowRule:
    """Read a window rule: `auto`, `payout` or a length in seconds; OptionError for anything else.

    >>> window_rule("5.48")
    5.48
    """
    if word == "auto" or word == "payout":
        return word  # type: ignore[return-value]  # mypy does not narrow str to the literals by ==
    try:
        seconds = math.nan if isinstance(word, bool) else float(word)
    except (TypeError, ValueError):
        seconds = math.nan
    if not (0.0 < seconds < math.inf):
        raise OptionError(
            f"window {word!r}: expected auto, payout or a length in seconds above 0, such as 5.48."
        )
    return seconds


def reduce(
    run: Run | str | Path | pd.DataFrame,
    *,
    rig: Rig | None = None,
    load: float | None = None,
    window: str | float | None = None,
    cycles: tuple[int, int] | None = None,
    units: Mapping[str, str] | None = None,
) -> Reduction:
    """Reduce a run: find its cycles and integrate each one's powers over its window (Sec. 3.2).

    Parameters
    ----------
    run : of `read_run`, or the log of one, a file or a pandas DataFrame, which is read first by
        `read_run` with rig and load
    load : of a log that is not read yet: resistance at the DC link, inf for an open circuit [ohm]
    rig : in place of the one that the run was read with; the paper's, as assumed, for a run that
        was not read
    window : "auto", "payout" or a length [s]; by default that of the campaign of the run, else the
        rig's rule
    cycles : first and last cycle that count, numbered by payout; by default those of the campaign
        of the run, else all
    units : of a DataFrame alone: units of its columns by their names, such as {"force": "kN"}

    Raises
    ------
    OptionError : no run, no rig, no window rule, one longer than most payouts, or cycles of which
        the log has none; another rig than that with whose numbers a channel of the run was made; or
        load or units of a run, which has its own
    LogError : a log that is not read yet, and cannot be

    Examples
    --------
    >>> len(reduce("fixtures/campaign/r36ohm.csv").cycles)
    3
    """
    run, given = _read(run, rig, load, units), rig
    check_arguments("reduce", ("cycles", cycles, CYCLES))
    rig, rule = _fitting(run, rig, window)
    cycles = run.cycles if cycles is None else cycles
    phased = find_phases(run, rig, rule, cycles)
    windows, nets = find_windows(phased), find_net_spans(phased)
    message = f"no rig was named; drum radius ({rig.r_drum or 0.0:g} m) and accuracies of the sensors are those of {rig.name}"
    action = (
        'name yours: --rig FILE, rig = "FILE" in campaign.toml, or rig=load_rig(FILE) in Python'
    )
    assumed = [Finding("rig_assumed", message, action)] if rig.assumed else []
    read = run.findings if given is None or run.rig is None else _of_rig(run, given, rig)
    findings = [*_not_given(phased, cycles), *check_lengths(phased, windows)]

    def integrate() -> tuple[Energies, tuple[Bin, ...]]:
        energy = integrate_energies(phased, windows, nets)
        counted = [k for k, window in enumerate(energy.windows) if window.fault is None]
        return energy, bins_of(
            run, rig, [phased.cycles[k] for k in counted], [phased.plateaus[k] for k in counted]
        )

    summaries, (energy, bins) = side_by_side(
        lambda: summarise(phased), integrate, samples=run.samples
    )
    by_motion = rig.phases.by_motion
    thinned = thinned_changes(phased, energy)
    results = _results(phased, summaries, energy, findings)
    log = PhasedLog(phased, summaries, energy, thinned, results)
    relations = relations_of(log)
    findings += find_faults(log, relations)
    complete = [r.metrics for r in results if r.complete]
    duration = sum(r.window.cutoff - r.window.onset for r in results if r.complete)
    mean, deviation, total = together(
        complete, duration, open_circuit=run.open_circuit, cascade=rig.cascade
    )
    return Reduction(
        run=run,
        rig=rig,
        window=phased.rule if by_motion else "whole",
        cycles=tuple(results),
        mean=mean,
        max_deviation_percent=deviation
        if rig.phases.repeats
        else Metrics((), rig.cascade.all_metrics),
        total=total,
        bins=bins,
        quality=(*assumed, *other_source(phased, results), *read, *findings),
        bridged=energy.bridged,
        sampled=sampled(thinned, energy),
        measured_load=measured_load(log),
        relations=relations,
    )


def _read(
    given: Run | str | Path | pd.DataFrame,
    rig: Rig | None,
    load: float | None,
    units: Mapping[str, str] | None,
) -> Run:
    """The run of a call, read now where a file or a frame was given.

    Raises
    ------
    OptionError : something else, or load or units of a run that is read already
    """
    if isinstance(given, str | os.PathLike) or (
        not isinstance(given, Run) and isinstance(given, pd.DataFrame)
    ):
        from winchcascade.ingest.read import read_run  # which a call with a run does not wait for

        return read_run(
            given, rig=None if rig is None else given_rig("reduce", rig), load=load, units=units
        )
    if not isinstance(given, Run):
        raise OptionError(
            f"reduce: cannot take a {type(given).__name__}; expected a Run, the path of a log or "
            f"a pandas DataFrame."
        )
    for name, value in {"load": load, "units": units}.items():
        if value is not None:
            raise OptionError(
                f"reduce: {name} is {value!r:.100}, but {given.name} was read with its own; "
                f"expected it with a file or a "
                "frame alone. Give it to read_run."
            )
    return given


def _of_rig(run: Run, given: Rig, rig: Rig) -> list[Finding]:
    """Findings of a run where its thresholds are those of another rig, which is complete here.

    Parameters
    ----------
    given, rig : as the call gave it, and with thresholds of the run
    """
    found = thresholds_finding(given, rig)
    others = [finding for finding in run.findings if finding.kind != "thresholds_assumed"]
    return [*others, *([] if found is None else [found])]


def _fitting(run: Run, given: Rig | None, window: str | float | None) -> tuple[Rig, WindowRule]:
    """The rig of a call or of a run, with the signs that the run was read with, and the rule of its
    windows.

    Raises
    ------
    OptionError : a channel that neither this rig nor that of the run has, a velocity that was made
        with another drum radius, or a window where windows are whole
    """
    rig = given_rig("reduce", given, run.rig)
    read_with = run.rig or rig
    rig = with_thresholds(rig, [run])
    if run.signs:
        rig = replace(rig, cascade=rig.cascade.as_read(run.signs))
    known = {*rig.known_channels, *read_with.known_channels}
    unknown = [name for name in run.channels if name not in known]
    if unknown:
        raise OptionError(
            f"{run.name}: {unknown[0]!r} is no channel; expected some of {', '.join(known)}, or a "
            f"channel of your own under "
            "[channels] of the rig file."
        )
    made = any(f.kind == "derived_channel" and f.channel == "velocity" for f in run.findings)
    if made and "displacement" not in run.channels and read_with.r_drum != rig.r_drum:
        radius = "no r_drum" if rig.r_drum is None else f"{rig.r_drum:g} m"
        raise OptionError(
            f"{run.name}: its velocity was made from the speed of the shaft with the drum radius "
            f"of the rig {read_with.name}, "
            f"{read_with.r_drum:g} m, and the rig {rig.name} has {radius}; read the log again "
            f"with that rig."
        )
    window = run.window if window is None else window
    if window is not None and not rig.phases.by_motion:
        raise OptionError(
            f'{run.name}: window {window}: cycles come from "{rig.phases.source}" by [phases] of '
            f"the rig {rig.name}, and their "
            "windows are whole; leave the window out."
        )
    return rig, window_rule(rig.thresholds.window if window is None else window)


def first_metrics(run: Run, rig: Rig, window: float | None = None) -> Metrics:
    """Metrics of the first payout of a clean log by the rules of `reduce` and no more: for
    thousands of simulations.

    All are None where the log has no payout or where its window is not whole. A ratio above 1 is
    given as it is.

    Parameters
    ----------
    window : length [s]; by default the rig's rule
    """
    phased = find_phases(run, rig, window_rule(rig.thresholds.window if window is None else window))
    if phased.cycles:
        span = find_window(phased, 0)
        if span.fault is None:
            return metrics_within(run, rig, np.array([[span.onset, span.cutoff]]))[0]
    return Metrics((), rig.cascade.all_metrics)


def metrics_within(
    run: Run, rig: Rig, windows: Signal, channels: Mapping[str, Signal] | None = None
) -> list[Metrics]:
    """Metrics of a run within each of some windows, (k, 2) [s]; None where the run cannot give one.

    A ratio above 1 or below 0 is given as it is, as the error of a model with effects is to be
    known.

    Parameters
    ----------
    channels : (n,) each, those of the run by default
    """
    streams, nothing = (
        rig.cascade.streams(channels or run.channels, rig.r_drum),
        dict.fromkeys(rig.cascade.energies),
    )
    columns, known = (
        integrals_of(run.t, list(streams.values()), windows),
        [f"energy_{s}" for s in streams],
    )
    energies = [nothing | dict(zip(known, joules, strict=True)) for joules in columns.T.tolist()]
    return [
        metrics(
            energy, end - begin, open_circuit=run.open_circuit, cascade=rig.cascade, negative=True
        )
        for energy, (begin, end) in zip(energies, windows.tolist(), strict=True)
    ]


def require_payouts(reduction: Reduction) -> None:
    """Require that a log has a cycle: LogError, which proposes another source of cycles, if it
    has none.
    """
    if not reduction.cycles:
        raise LogError(no_cycles(reduction.run, reduction.rig))


def _not_given(phased: PhasedRun, chosen: tuple[int, int] | None) -> list[Finding]:
    """Why a stage has no power, one of a rig file or one although its channel is there; and a log
    that ends too early.

    Parameters
    ----------
    chosen : first and last cycle that were chosen
    """
    run, rig, found = phased.run, phased.rig, []
    for stage in rig.cascade.stages if rig.cascade.configured else ():
        if stage.power(run.channels, rig.r_drum) is None:
            lacking = [
                [name for name in power.channels if name not in run.channels]
                for power in stage.powers
            ]
            missing = min(
                zip(lacking, stage.powers, strict=True),
                key=lambda of: len(of[0]) / len(of[1].channels),
            )[0]
            lacks = f"the log has no {' and no '.join(missing)}"
            lacks = lacks if missing else f"the rig {rig.name} has no r_drum under [winch]"
            message = f"stage {stage.name} has no power ({' or '.join(p.text for p in stage.powers)}): {lacks}"
            action = "its energy and its efficiencies are null"
            found.append(
                Finding("missing_channel", message, action, missing[0] if missing else None)
            )
    alone = "torque" in run.channels and run.channels.keys().isdisjoint({"power_mech", "speed"})
    if alone and rig.r_drum is None and not rig.cascade.configured:
        message = f"torque alone gives no power: the rig {rig.name} has no drum radius (r_drum under [winch])"
        found.append(Finding("missing_channel", message, "metrics that need it are null", "torque"))
    last = phased.first + len(phased.cycles) - 1
    if chosen is not None and chosen[1] > last:
        message = (
            f"the log ends with cycle {last}, and cycles {chosen[0]} to {chosen[1]} were chosen"
        )
        found.append(Finding("incomplete_cycle", message, f"cycles {chosen[0]} to {last} count"))
    return found


def _results(
    phased: PhasedRun, summaries: Sequence[PhaseSummary], energy: Energies, findings: list[Finding]
) -> list[CycleResult]:
    """Put the cycles together; incomplete ones are added to the findings."""
    results, stages = [], phased.rig.cascade.names
    of_cycles = zip(phased.cycles, energy.windows, energy.nets, summaries, strict=True)
    for k, (cycle, window, net, summary) in enumerate(of_cycles):
        number, length = phased.first + k, window.cutoff - window.onset
        joules = {
            name: None if column is None else column[k] for name, column in energy.joules.items()
        }
        of_cycle, net = net_metrics(joules, net)
        of_cycle |= {f"energy_{stage}": joules[stage] for stage in stages}
        values = metrics(
            of_cycle, length, open_circuit=phased.run.open_circuit, cascade=phased.rig.cascade
        )
        if window.fault is not None:
            rows, message = (
                phased.rows(window.onset, window.cutoff),
                f"cycle {number} is incomplete: {window.fault}",
            )
            span = {"start": window.onset, "end": window.cutoff, "removed": rows.stop - rows.start}
            findings.append(
                Finding("incomplete_cycle", message, "listed, excluded from the mean", **span)
            )
        results.append(
            CycleResult(number, window.fault is None, cycle, window, summary, values, net)
        )
    return results
