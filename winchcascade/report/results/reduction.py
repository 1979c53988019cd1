"""What the reduction of a log states: energies and efficiencies of its cycles, phases,
uncertainty, findings.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from functools import cache, partial
from statistics import fmean
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.core.store import fingerprint
from winchcascade.reduction.reduce import metrics_within
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.uncertainty import Uncertainty, uncertainty
from winchcascade.reduction.wave_energies import WaveEnergies, waves_of
from winchcascade.report.content import (
    Measured,
    Note,
    Picture,
    Report,
    Section,
    Span,
    Tile,
    number_text,
    section,
    shown,
)
from winchcascade.report.figures.histories import powers_of
from winchcascade.report.figures.reduction_figures import (
    overlaid,
    power_streams,
    trend,
    window_flow,
)
from winchcascade.report.glossary import metric, upper
from winchcascade.report.results.common import (
    data_note,
    histories,
    model_section,
    provenance,
    ratio_words,
    samples_row,
)
from winchcascade.report.results.reduction_tables import (
    bins_table,
    budget_table,
    cycles_table,
    directions_table,
    findings_table,
    net_table,
    phases_table,
    uncertainty_table,
)
from winchcascade.report.results.waves import wave_section, wave_tiles
from winchcascade.report.wording import (
    at_most,
    banner,
    calibration,
    decisive,
    load_words,
    mean_text,
    measured_load_words,
    net_reasons,
    not_known,
    span_word,
    window_words,
)

if TYPE_CHECKING:
    from winchcascade.diagnosis.explain.model_comparison import Account
    from winchcascade.diagnosis.stages.stage_map import LossMap
    from winchcascade.report.content import Blocks

LISTED_REASONS = 3
"""Reasons for missing net energies that are listed; the JSON holds that of each cycle."""

WINDOW_EFFECT_MIN = 0.005
"""Difference of an efficiency between window and whole payout from which both are stated: half of
the last percent that a comparison of rigs needs. [1]"""

OPEN_FINDINGS = 4
"""Findings whose table is open on a page; of more the first screen names the kinds."""


def reduction_report(
    reduction: Reduction,
    found: Uncertainty | None = None,
    mapped: LossMap | None = None,
    *,
    model: Account | None = None,
    command: str = "",
) -> Report:
    """Report of a reduction.

    Parameters
    ----------
    found : uncertainty of the reduction; made here if not given
    mapped : loss map that the report shows too
    model : what is kept of the log beside its simulation; where a page needs it, simulated with
        the numbers of the rig file if not given
    """
    run, waves, found = reduction.run, waves_of(reduction), found or uncertainty(reduction)
    payout = payout_means(reduction)
    return Report(
        kind="Reduction of a log",
        title=run.name + ("" if run.table is None else f", table {run.table!r}"),
        subtitle=_subtitle(reduction),
        tiles=_tiles(reduction, found, payout) if waves is None else wave_tiles(waves),
        points=[
            data_note([run.origin]),
            _windows_note(reduction, found, payout),
            *_outcome(reduction),
            *_accuracy(found),
            Note(reduction.rig.note, "Rig note"),
        ],
        sections=[
            *_result_sections(reduction, found, waves),
            histories(reduction),
            *([] if mapped is None else [_loss_map(mapped)]),
            *_evidence_sections(reduction),
            model_section(run.origin.word, partial(_simulated, reduction, model)),
            section(
                "uncertainty", "Uncertainty",
                uncertainty_table(reduction, found), budget_table(reduction, found), folded=True,
            ),
            provenance(_sources(reduction), command),
        ],
        banner=banner([run.origin]),
    )  # fmt: skip


# ------------------------------------------------------ parts whose modules a terminal does without
def _loss_map(mapped: LossMap) -> Section:
    from winchcascade.report.results.loss_map import loss_map_section

    return loss_map_section(mapped)


def _simulated(reduction: Reduction, model: Account | None) -> Blocks:
    from winchcascade.report.results.model_section import run_parts

    return run_parts(reduction, model)


# ------------------------------------------------------------------------------- the first screen
def _subtitle(reduction: Reduction) -> str:
    """Stated and measured load, rig and window of a log."""
    run = reduction.run
    stated = f"{load_words(run.load, 'ohm', before='load ')} ({run.load_source})"
    parts = (
        stated if run.load is not None else "load unknown" if "vdc" in run.channels else "",
        measured_load_words(reduction.measured_load, "ohm"),
        f"rig {reduction.rig.name}",
        f"window {window_words(reduction.window)}",
        run.about,
    )
    return " · ".join(filter(None, parts))


def _tiles(reduction: Reduction, found: Uncertainty, payout: Mapping[str, float]) -> list[Tile]:
    """The efficiencies with their intervals, and energies where there are fewer than three.

    Parameters
    ----------
    payout : efficiencies over the whole payouts, which are stated beside those of the windows
    """
    cascade, repeats = reduction.rig.cascade, reduction.rig.phases.repeats
    etas = (
        (*cascade.neighbours[:2], cascade.overall)
        if len(cascade.stages) > 2
        else tuple(cascade.ratios)
    )
    given = [m for m in (*etas, *cascade.energies) if reduction.mean[m] is not None][:3]
    return [
        Tile(
            m,
            ratio_words(m, cascade.pairs[m]) + ", run-up" * (m in payout)
            if m in cascade.ratios
            else metric(m).label + ", per cycle" * repeats,
            f"{stated_text(reduction, found, m)} {metric(m).unit}".strip(),
            "; ".join(
                [
                    _interval(found, m) if repeats else "all cycles together",
                    *([f"whole payout: {number_text(payout[m], 3)}"] if m in payout else []),
                ]
            ),
        )
        for m in given
    ]


def payout_means(reduction: Reduction) -> dict[str, float]:
    """Mean efficiencies over the whole payouts of the complete cycles, where these differ from
    those of windows that end soon after the run-up; empty else. [1]
    """
    counted = reduction.complete if reduction.window == "auto" else ()
    payouts = np.array([(c.window.onset, c.phases.payout_end) for c in counted]).reshape(-1, 2)
    cycles = metrics_within(reduction.run, reduction.rig, payouts)
    names = [name for name in reduction.rig.cascade.ratios if reduction.mean[name] is not None]
    means = {name: fmean(of[name] or math.nan for of in cycles) for name in names if cycles}
    return {
        name: eta
        for name, eta in means.items()
        if abs(eta - (reduction.mean[name] or 0.0)) >= WINDOW_EFFECT_MIN
    }


def _windows_note(reduction: Reduction, found: Uncertainty, payout: Mapping[str, float]) -> Note:
    """Efficiencies of the run-up beside those of the whole payout; empty where they agree."""
    stated = ", ".join(
        f"{name} {stated_text(reduction, found, name)} and {number_text(eta, 3)}"
        for name, eta in payout.items()
    )
    text = f"In the run-up, and over the whole payout (`--window payout`): {stated}."
    return Note(text if stated else "", "Windows")


def stated_text(reduction: Reduction, found: Uncertainty, name: str) -> str:
    """Mean of a metric over the cycles as it is stated, or where these do not repeat, of all
    together.
    """
    of = reduction.mean if reduction.rig.phases.repeats else reduction.total
    return mean_text(name, of[name], found.standard[name])


def _interval(found: Uncertainty, name: str) -> str:
    """The 95 % interval of a mean, or what is known of its uncertainty in its place."""
    unit, interval, u = metric(name).unit, found.interval_95.get(name), found.standard[name]
    if interval is not None and u:
        return f"95 %: {shown(Span(interval.low, interval.high, u))} {unit}".strip()
    scatter = found.budget.repeatability[name]
    if not scatter:
        return "uncertainty unknown"
    return f"+- {shown(Measured(scatter, scatter))} {unit}".rstrip() + ", by repeatability alone"


def _outcome(reduction: Reduction) -> list[Note]:
    """How many cycles are complete, which are the best and the worst, what is wrong with the
    log, and what to do next.
    """
    n, of = len(reduction.complete), len(reduction.cycles)
    kinds = Counter(finding.kind.replace("_", " ") for finding in reduction.quality)
    named = ", ".join(kind + (f" ({times})" if times > 1 else "") for kind, times in kinds.items())
    lost = f"; {100.0 * share:.2g} % of the time bridged" if (share := reduction.lost_share) else ""
    extremes = ""
    if reduction.extremes is not None:
        best, worst, name = reduction.extremes
        extremes = f"; {name} is highest in cycle {best.cycle}, lowest in cycle {worst.cycle}"
    correct = "Correct what the findings name in the log or in the rig file, and reduce it again."
    compare = "`winchcascade diagnose` on the campaign finds why log and model differ."
    return [
        Note(
            f"{n} of {of} complete{extremes}.",
            "Cycles",
            "plain" if n == of else "warn",
            brief=n < of,
        ),
        Note(f"{upper(named)}{lost}.", "Findings", "warn")
        if kinds
        else Note("None.", "Findings", "good"),
        Note(correct if kinds else compare, "Next", brief=False),
    ]


def _accuracy(found: Uncertainty) -> list[Note]:
    """Which sensors decide the uncertainties, and what is unknown of these; a note without a
    text is not shown.
    """
    parts = ", ".join(
        f"{name} {100.0 * share:.0f} % {sensor}" for name, share, sensor in decisive(found.budget)
    )
    unsure = upper("; ".join(not_known(found.budget)))
    return [
        Note(f"Most of it: {parts}." if parts else "", "Variance"),
        Note(calibration(found.budget), "Calibrate"),
        Note(
            f"{unsure}." if unsure else "", "Accuracy", "warn" if found.budget.unknown else "plain"
        ),
    ]


# ----------------------------------------------------------------------------------- the sections
def _result_sections(
    reduction: Reduction, found: Uncertainty, waves: WaveEnergies | None
) -> list[Section]:
    """Findings, waves, and the energies of windows and of whole cycles."""
    findings = reduction.quality
    texts = {
        m: stated_text(reduction, found, m) for m, x in reduction.mean.items() if x is not None
    }
    of = "mean of the" if reduction.rig.phases.repeats else "all"
    flow = Picture(
        "flow",
        f"Where the energy goes in the window, {of} complete cycles.",
        "Flow diagram of the energies, which are in the table.",
        partial(window_flow, reduction, texts),
    )
    return [
        section("findings", "Findings", findings_table(reduction.run, findings), folded=len(findings) > OPEN_FINDINGS),
        *([] if waves is None else [wave_section(waves)]),
        section(
            "results", "Energies and efficiencies",
            flow, cycles_table(reduction, found), directions_table(reduction), folded=waves is not None,
        ),
        section("whole-cycles", "Whole cycles", net_table(reduction, found), *_net_notes(reduction), folded=True),
    ]  # fmt: skip


def _evidence_sections(reduction: Reduction) -> list[Section]:
    """Phases, cycles and powers behind the results."""
    best, worst = (c.cycle for c in reduction.extremes[:2]) if reduction.extremes else (None, None)
    powers = cache(lambda: powers_of(reduction))
    means = f"; right: of all complete {span_word(reduction)}s, with means in bins"
    overlaid_cycles = Picture(
        "overlaid",
        "Cycles from their onsets on; dashed: end of the window.",
        "Line plots of the cycles laid over each other.",
        lambda: overlaid(reduction, powers(), best, worst),
    )
    streams = Picture(
        "streams",
        f"Powers of a cycle; dashed: integration window{means if reduction.bins else ''}.",
        "Line plot of the powers over time, and dots with binned means over generator speed.",
        lambda: power_streams(reduction, powers()),
    )
    drift = Picture(
        "trend",
        "Complete cycles one after the other.",
        "Dots of the efficiencies and energies over the number of the cycle; the values are in "
        "the tables.",
        partial(trend, reduction),
    )
    repeats = reduction.rig.phases.repeats
    return [
        section("phases", "Phases", phases_table(reduction), folded=True),
        section(
            "cycles", "Cycles beside each other", overlaid_cycles if repeats else None, drift,
            folded=True,
        ),
        section(
            "powers", "Power over time and generator speed", streams, bins_table(reduction),
            folded=True,
        ),
    ]  # fmt: skip


def _net_notes(reduction: Reduction) -> list[Note]:
    """Why cycles have no net energies."""
    reasons = net_reasons(reduction.cycles) if reduction.rig.cascade.net_ratios else []
    listed = at_most(reasons, LISTED_REASONS, "{} more reasons")
    return [Note(f"{reason}.", "No net energy") for reason in listed]


def _sources(reduction: Reduction) -> list[tuple[str, str | None]]:
    """Where every number comes from, so that it can be made again."""
    run, rig = reduction.run, reduction.rig
    return [
        ("Log", run.path or run.name),
        ("SHA-256 of the log", run.sha256),
        samples_row(run),
        ("Rig", f"{rig.name} ({rig.path})" if rig.path else rig.name),
        ("What the rig is", rig.title),
        ("Source of the rig's numbers", rig.source),
        ("SHA-256 of the rig file", fingerprint(rig.path)),
        ("Drum radius", "not published" if rig.r_drum is None else f"{rig.r_drum:g} m"),
    ]
