"""The report of one log: its rows and figures, made once for the page and the PDF."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial

from winchcascade.core.campaign_file import banner, origin_words
from winchcascade.core.cascade import Cascade
from winchcascade.core.run import Signal
from winchcascade.reduction.efficiency import NOTHING
from winchcascade.reduction.loss_map import LossMap
from winchcascade.reduction.montecarlo import Uncertainty
from winchcascade.reduction.reduction_result import CycleResult, Reduction
from winchcascade.reduction.wave_energies import wave_energies
from winchcascade.report import figures, tables
from winchcascade.report import sheet as content
from winchcascade.report.digits import interval_text, number, percent, places, significant, uncertain, upper
from winchcascade.report.model_section import Modelled, modelled, run_section
from winchcascade.report.style import house_style
from winchcascade.report.time_histories import readout
from winchcascade.report.wave_text import power_interval
from winchcascade.report.wording import (
    SYMBOL,
    decisive,
    load_words,
    measured_load_words,
    net_reasons,
    not_known,
    span_word,
    subscripts_of,
    symbols_section,
    unit_of,
    window_words,
)

_NAMES = {
    "eta_trans": "line to shaft",
    "eta_gen": "shaft to DC link",
    "eta_pto": "line to DC link",
    "energy_line": "energy of the line, per cycle",
    "energy_mech": "energy of the shaft, per cycle",
    "energy_gen": "energy at the DC link, per cycle",
}


def report_maker(
    reduction: Reduction, found: Uncertainty, mapped: LossMap | None = None, *, command: str = ""
) -> Callable[[], content.Report]:
    """What makes the report of one log as often as it is wanted: the log is simulated once.

    Parameters
    ----------
    mapped : loss map that the report shows too
    """
    model = modelled(reduction)

    def make() -> content.Report:
        report = make_report(reduction, found, model=model, command=command)
        if mapped is None:
            return report
        from winchcascade.report.loss_map_section import with_loss_map

        return with_loss_map(report, mapped)

    return make


@house_style()
def make_report(
    reduction: Reduction, found: Uncertainty, *, model: Modelled | None = None, command: str = ""
) -> content.Report:
    """Make the rows and figures of the report of one log.

    Parameters
    ----------
    model : the log beside its simulation; simulated here with the numbers of the rig file if not given
    """
    run = reduction.run
    n, of = len(reduction.complete), len(reduction.cycles)
    cycles = f"{n} of {of} complete; integration window: {window_words(reduction.window)}."
    parts = ", ".join(f"{SYMBOL[m]}: {100.0 * share:.0f} % {name}" for m, share, name in decisive(found.budget))
    rest = ". ".join(upper(sentence) for sentence in not_known(found.budget))
    texts = [f"What makes most of the variance: {parts}." if parts else "", f"{rest}." if rest else ""]
    text = " ".join(text for text in texts if text)
    return content.Report(
        kind="Reduction of a log",
        title=run.name,
        subtitle=" · ".join(part for part in (_about(reduction), run.about) if part),
        tiles=_tiles(reduction, found),
        points=(
            content.data_point([reduction.run.origin]),
            content.Point("Cycles", cycles, "plain" if n == of else "warn"),
            *_best_points(reduction),
            *_net_points(reduction, found),
            _log_point(reduction),
            *([content.Point("Uncertainty", text, "warn" if found.budget.unknown else "plain")] if text else []),
            *(
                [content.Point("Intervals", tables.interval_type(reduction))]
                if found.interval_95 and reduction.rig.phases.repeats
                else []
            ),
            *([content.Point("Rig", reduction.rig.note)] if reduction.rig.note else []),
        ),
        sections=_sections(reduction, found, model or modelled(reduction), command),
        traces=readout(reduction, figures.powers_of(reduction)),
        banner=banner([run.origin]),
        subscripts=subscripts_of(reduction.rig.cascade),
    )


def _about(reduction: Reduction) -> str:
    run, rig = reduction.run, reduction.rig
    load, measured = load_words(run.load, before="load ", unknown=""), measured_load_words(reduction.measured_load)
    return " · ".join(part for part in (load, measured, f"rig {rig.name}", rig.title) if part)


def _tiles(reduction: Reduction, found: Uncertainty) -> tuple[content.Tile, ...]:
    """The efficiencies with their intervals, and energies where there are fewer than three."""
    cascade = reduction.rig.cascade
    etas = (*cascade.neighbours[:2], cascade.overall) if len(cascade.stages) > 2 else tuple(cascade.ratios)
    if reduction.rig.phases.source == "waves":
        return _wave_tiles(reduction, etas)
    given = [m for m in (*etas, *cascade.energies) if reduction.mean[m] is not None][:3]
    if not reduction.rig.phases.repeats:
        return tuple(
            content.Tile(
                SYMBOL[m],
                _name(cascade, m).removesuffix(", per cycle"),
                f"{tables.whole_text(reduction, m)} {unit_of(m)}".strip(),
                "all cycles together",
            )
            for m in given
        )
    return tuple(
        content.Tile(
            SYMBOL[m],
            _name(cascade, m),
            f"{tables.mean_text(reduction, found, m)} {unit_of(m)}".strip(),
            _interval_words(found, m),
        )
        for m in given
    )


def _interval_words(found: Uncertainty, metric: str) -> str:
    """The 95 % interval of a mean, or what is known of its uncertainty in its place."""
    unit, interval, u = unit_of(metric), found.interval_95.get(metric), found.standard[metric]
    if interval is not None and u:
        return f"95 %: {interval_text(interval.low, interval.high, u)} {unit}".strip()
    scatter = found.budget.repeatability[metric]
    return f"± {f'{uncertain(scatter)} {unit}'.rstrip()} by repeatability alone" if scatter else "uncertainty unknown"


def _wave_tiles(reduction: Reduction, etas: Sequence[str]) -> tuple[content.Tile, ...]:
    """Efficiencies of all waves together, and mean powers of the record where there are fewer than three."""
    found = wave_energies(reduction)
    ratios = ((eta, found.efficiency[eta]) for eta in etas if eta in found.efficiency)
    tiles = [
        content.Tile(
            SYMBOL[eta],
            "all waves together",
            f"{ratio.value:.3f}",
            "too few waves for an interval"
            if ratio.interval is None
            else f"95 %: {ratio.interval[0]:.3f} to {ratio.interval[1]:.3f}",
        )
        for eta, ratio in ratios
        if ratio.value is not None
    ]
    powers = [
        content.Tile(
            SYMBOL[f"power_{stage}"],
            "mean of the record",
            f"{significant(watt, 4)} W",
            f"{found.record_duration:.0f} s" + (f", 95 %: {ends} W" if (ends := power_interval(found, stage)) else ""),
        )
        for stage, watt in found.record_power.items()
    ]
    return (*tiles, *powers)[:3]


def _name(cascade: Cascade, metric: str) -> str:
    """What a metric is, for a tile."""
    if metric in _NAMES:
        return _NAMES[metric]
    if metric in cascade.ratios:
        return " to ".join(cascade.between(metric))
    return f"energy of {metric.removeprefix('energy_')}, per cycle"


def best_and_worst(reduction: Reduction) -> tuple[CycleResult, CycleResult, str] | None:
    """Complete cycles of the highest and the lowest efficiency, and which; None where there are not two to compare."""
    complete = reduction.complete
    cascade = reduction.rig.cascade
    for metric in (cascade.overall, *cascade.neighbours, *cascade.energies[:1]):
        if len(complete) > 1 and reduction.mean.get(metric) is not None:
            ranked = sorted(complete, key=lambda c: c.metrics.value(metric))
            return ranked[-1], ranked[0], metric
    return None


def _best_points(reduction: Reduction) -> list[content.Point]:
    """The best and the worst cycle, with as many digits as show how they differ, four at least."""
    extremes = best_and_worst(reduction)
    if extremes is None:
        return []
    best, worst, m = extremes
    high, low = (cycle.metrics.value(m) for cycle in (best, worst))
    decimals = max(places((high - low) / 3.0) if high > low else 0, 3 - math.floor(math.log10(max(abs(high), NOTHING))))
    maximum = reduction.max_deviation_percent[m]
    deviates = "" if maximum is None else f"; the largest deviation from the mean is {maximum:.2f} %"
    text = f"Cycle {best.cycle} with {SYMBOL[m]} = {number(high, decimals)}, cycle {worst.cycle} with {number(low, decimals)}"
    return [content.Point("Best and worst", f"{text}{deviates}.")]


def _net_points(reduction: Reduction, found: Uncertainty) -> list[content.Point]:
    """The residual energy of the line once haul-in has returned its part, and what of that is delivered."""
    mean, text = reduction.mean, partial(tables.mean_text, reduction, found)
    if mean.energy_net is None:
        reasons = net_reasons(reduction.cycles) if reduction.rig.cascade.has_net else []
        return [content.Point("Whole cycles", f"No net energy; {reasons[0]}.")] if reasons else []
    sentence = (
        f"From onset to next onset E_net = {text('energy_net')} J: E_payout = {text('energy_payout')} J less "
        f"E_returned = {text('energy_returned')} J in haul-in."
    )
    ratio = "" if mean.eta_net is None else f" η_net = {text('eta_net')}."
    return [content.Point("Whole cycles", sentence + ratio)]


def _log_point(reduction: Reduction) -> content.Point:
    kinds = Counter(finding.kind for finding in reduction.quality)
    if not kinds:
        return content.Point("Log", "No fault found.", "good")
    named = ", ".join(k.replace("_", " ") + (f" ({n} times)" if n > 1 else "") for k, n in kinds.items())
    lost, total = lost_share(reduction), kinds.total()
    bridged = f", {percent(lost, 2)} % of the time bridged" if lost else ""
    return content.Point("Log", f"{total} finding{'s' * (total > 1)}{bridged}: {named}.", "warn")


def lost_share(reduction: Reduction) -> float:
    """Share of the log's time in which at least one channel was bridged. [1]"""
    run = reduction.run
    step = 1.0 / run.fs
    spans = sorted((a, b) for gaps in run.gaps.values() for a, b in gaps.tolist())
    lost, reached = 0.0, -math.inf
    for a, b in spans:
        lost += max(0.0, b - max(a, reached) - (step if a >= reached else 0.0))
        reached = max(reached, b)
    return lost / max(float(run.t[-1] - run.t[0]), step)


def _sections(reduction: Reduction, found: Uncertainty, model: Modelled, command: str) -> tuple[content.Section, ...]:
    powers = figures.powers_of(reduction)
    return content.filled(
        _results(reduction, found),
        histories_section(reduction),
        _powers(reduction, powers),
        *_waves(reduction),
        _cycles(reduction, powers),
        run_section(model),
        _repeatability(reduction, found),
        content.section(
            "findings", "Findings", tables.findings_table(reduction) or content.Note("No fault was found in the log.")
        ),
        symbols_section(reduction.rig.cascade),
        _provenance(reduction, found, command),
    )  # fmt: skip


def histories_section(reduction: Reduction) -> content.Section:
    """Channels and powers over the whole log, with the marks of phases, windows and repairs."""
    return content.section(
        "histories", "Time histories",
        content.picture(
            figures.time_histories(reduction, figures.powers_of(reduction)), "histories",
            "Channels and powers over the whole log. "
            + (_NOT_SHADED if len(reduction.cycles) > figures.SHADED_CYCLES else _shaded(reduction))
            + (_REPAIRED if reduction.run.gaps else ""),
            "Line plots of every channel over time; the values are in the log, means of the phases in the tables.",
            interactive=True,
        ),
    )  # fmt: skip


def _waves(reduction: Reduction) -> tuple[content.Section, ...]:
    """Energies of waves where cycles are waves by the rig file."""
    if reduction.rig.phases.source != "waves":
        return ()
    from winchcascade.report.wave_section import wave_section

    return (wave_section(reduction),)


def _results(reduction: Reduction, found: Uncertainty) -> content.Section:
    given = [m for m, value in reduction.mean.items() if m.startswith("energy") and value is not None]
    cascade, repeats = reduction.rig.cascade, reduction.rig.phases.repeats
    means = {m: tables.mean_text(reduction, found, m) if repeats else tables.whole_text(reduction, m) for m in given}
    words = ", ".join(f"{SYMBOL[m]} {text} J" for m, text in means.items())
    ratios = "means of the cycles' ratios" if repeats else "ratios of the sums"
    over = "as a mean over the complete cycles" if repeats else "all complete cycles together"
    whose = "the line" if cascade.names[0] == "line" else f"stage {cascade.names[0]}"
    net = " b: over the whole cycle the stored energy is returned, so that only losses remain."
    return content.section(
        "results", "Energies and efficiencies",
        content.picture(
            figures.energy_flow(reduction, means), "flow",
            f"Where the energy of {whose} goes, {over}: heights are energies. a: in the "
            "integration window, stage by stage; grey does not reach the next stage within the window, as it is lost, or "
            f"stored and returned or delivered later.{net if 'energy_net' in given else ''} η are {ratios}.",
            f"Flow diagram: {words}.",
        ),
        tables.cycles_table(reduction, found),
        tables.powers_table(reduction, found),
        tables.net_table(reduction, found),
    )  # fmt: skip


def _powers(reduction: Reduction, powers: dict[str, Signal]) -> content.Section:
    """Powers over time and, where it is known, over the speed of the generator."""
    cycle = figures.representative(reduction).cycle if reduction.cycles else 0
    heading, more, alt = "Power over time", "", ""
    if reduction.bins:
        heading += " and over generator speed"
        more = f" Right: powers of all complete {span_word(reduction)}s over generator speed, with means in bins."
        alt = ", and dots with binned means over generator speed; the means are in the table of bins"
    return content.section(
        "powers", heading,
        content.picture(
            figures.power_streams(reduction, powers), "streams",
            f"{'Left: p' if more else 'P'}owers of cycle {cycle} over time; between the dashed lines lies the integration "
            "window. What lies between two curves is lost between the stages, or stored and returned or delivered "
            f"later.{_REPAIRED if reduction.run.gaps else ''}{more}",
            f"Line plot of the powers over time{alt}.",
        ),
        tables.bins_table(reduction),
    )  # fmt: skip


def _cycles(reduction: Reduction, powers: dict[str, Signal]) -> content.Section:
    """Cycles laid over each other and one after the other."""
    holds = tables.holds_table(reduction)
    extremes = best_and_worst(reduction)
    best, worst, by = (None, None, "")
    if extremes is not None:
        best, worst, by = extremes[0].cycle, extremes[1].cycle, f" Best and worst by {SYMBOL[extremes[2]]}."
    many = len(reduction.cycles)
    caption = "Cycles on a common clock that starts at each onset: where the curves part, the cycles did not repeat."
    if many == 1:
        caption = "The cycle on a clock that starts at its onset."
    some = f" {figures.OVERLAID} of {many} cycles, evenly chosen." if many > figures.OVERLAID else ""
    return content.section(
        "cycles-and-phases", "Cycles and phases",
        content.picture(
            figures.overlaid(reduction, powers, best, worst) if reduction.rig.phases.repeats else None, "overlaid",
            f"{caption} Dashed: end of the window.{by}{some}",
            "Line plots of the cycles laid over each other.",
        ),
        content.picture(
            figures.trend(reduction), "trend", "Complete cycles one after the other: a slope would be a drift.",
            "Dots of the efficiencies and energies over the number of the cycle; the values are in the tables.",
        ),
        tables.payouts_table(reduction),
        holds if len(holds.head) > 1 else None,
    )  # fmt: skip


def _repeatability(reduction: Reduction, found: Uncertainty) -> content.Section:
    unknown = tables.unknown_words(found)
    return content.section(
        "uncertainty", "Repeatability and uncertainty",
        tables.repeatability_table(reduction, found),
        tables.uncertainty_table(reduction, found) if reduction.complete else None,
        content.Note(unknown) if unknown else None,
        content.picture(
            figures.uncertainty_bars(found.budget), "budget",
            "What makes the uncertainty of each mean: the longest part of a bar is the sensor to improve first, or the scatter "
            "of the cycles (repeatability).",
            "Bars of the shares of the variance; the numbers are in the uncertainty budget.",
        ),
        tables.budget_table(found, reduction.rig),
        tables.sensors_table(reduction),
    )  # fmt: skip


def _shaded(reduction: Reduction) -> str:
    if not reduction.cycles:
        return "No payout was found."
    word = span_word(reduction)
    what = "Payouts and holds" if word == "payout" else f"{word.capitalize()}s"
    return f"{what} are shaded, the dashed lines bound the integration windows."


_REPAIRED = " Marks at the lower edge: samples of a channel that is shown were replaced there; the findings list why."

_NOT_SHADED = "Phases are not shaded: they would be too narrow to see."


def _provenance(reduction: Reduction, found: Uncertainty, command: str) -> content.Section:
    """Where every number comes from, so that it can be made again."""
    run, rig = reduction.run, reduction.rig
    load, measured = load_words(run.load, unknown="unknown"), reduction.measured_load
    return content.provenance_section(
        [
            ("Log", run.path or run.name),
            ("Table in the log", run.table or ""),
            ("SHA-256 of the log", run.sha256 or "–"),
            ("Samples", f"{run.samples} at {run.fs:.6g} Hz, {float(run.t[-1] - run.t[0]):.1f} s"),
            ("Campaign", run.about),
            ("Data", origin_words([run.origin])),
            ("Load", f"{load} ({run.load_source})" if run.load is not None else load),
            ("Vdc / Idc", "" if measured is None else f"{measured.ohm:.4g} Ω ± {uncertain(measured.u)} Ω"),
            ("Rig", f"{rig.name} ({rig.path})" if rig.path else rig.name),
            ("Source of the rig's numbers", rig.source),
            ("SHA-256 of the rig file", content.file_digest(rig.path)),
            ("Drum radius", "not published" if rig.r_drum is None else f"{rig.r_drum:g} m"),
            (
                "Integration window",
                reduction.window if isinstance(reduction.window, str) else f"{reduction.window:g} s",
            ),
            ("Monte Carlo", f"{found.draws} draws, seed {found.seed}"),
        ],
        command,
    )
