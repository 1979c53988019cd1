"""Tables of a campaign as rows of texts: the paper's Table 2 with uncertainty, repeatability, logs and what is wrong."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from winchcascade.core.campaign_file import KINDS, origin_from
from winchcascade.core.plain_text import one_line
from winchcascade.reduction.efficiency import FIELDS, METRICS, NET_METRICS
from winchcascade.report.digits import number, percent, places, stated, uncertain
from winchcascade.report.report_model import Table
from winchcascade.report.tables import DECIMALS, SYMBOL, UNIT, metrics_note

Run = Mapping[str, Any]
"""One log of a campaign's summary."""

MOST_RUNS = 150
"""Logs that a table lists; of more the first and the last half of that."""


def load_of(run: Run) -> float | None:
    """Load of a run, inf for an open circuit, None for none or an unknown one. [ohm]"""
    return math.inf if run["open_circuit"] else run["load_ohm"]


def load_text(run: Run) -> str:
    """Load of a run as a text."""
    load = load_of(run)
    return "–" if load is None else "open circuit" if math.isinf(load) else f"{load:g}"


def count_of(run: Run) -> int:
    """Number of findings of a run; of a summary by version 0.1.0, which lists kinds alone, the number of kinds."""
    return int(run.get("finding_count", len(run["findings"])))


def by_load(runs: Sequence[Run]) -> list[Run]:
    """Runs in falling order of their loads, as the paper lists them; open circuit first, unknown ones last."""
    return sorted(runs, key=lambda run: -(load if (load := load_of(run)) is not None else -1.0))


def window_text(run: Run) -> str:
    """Rule of the integration window of a run: a word, or the fixed length in seconds."""
    window = run["window"]
    return window if isinstance(window, str) else f"{window:g}"


def window_rules(runs: Sequence[Run]) -> dict[str, list[Run]]:
    """Runs by the rule of their windows: auto, payout, or a fixed length."""
    found: dict[str, list[Run]] = {}
    for run in runs:
        found.setdefault(run["window"] if isinstance(run["window"], str) else "fixed length", []).append(run)
    return found


def mixed_windows(runs: Sequence[Run]) -> str:
    """Report that runs have windows of several rules; empty if they have one."""
    rules = sorted(window_rules(runs).items(), key=lambda item: -len(item[1]))
    if len(rules) < 2:
        return ""
    named = ", ".join(
        f"{rule} in {len(found)} ({one_line(found[0]['name'])}{', …' * (len(found) > 1)})" for rule, found in rules
    )
    return f"{len(rules)} rules: {named}. Energies, powers and efficiencies of different rules cannot be compared."


def comparable(runs: Sequence[Run]) -> list[list[int]]:
    """Places of the runs that may be joined by a line: those of one window rule and of one kind of data."""
    found: dict[object, list[int]] = {}
    for rule, members in window_rules(runs).items():
        for run in members:
            found.setdefault((rule, origin_from(run).measured), []).append(runs.index(run))
    return list(found.values())


def energies_table(runs: Sequence[Run]) -> Table:
    """Mean energies and powers of every run with their standard uncertainties (the layout of Table 2)."""
    metrics = [f"{kind}_{stage}" for stage in ("line", "mech", "gen") for kind in ("energy", "power")]
    given = [m for m in metrics if any(run["mean"][FIELDS[m]] is not None for run in runs)]

    def row(run: Run) -> tuple[str, ...]:
        values = (_with_uncertainty(run, m, 0) for m in given)
        return (run["name"], load_text(run), window_text(run), f"{run['complete']}", *values)

    return Table(
        id="energies",
        caption="Mean energies over the integration window and mean powers in it, ± standard uncertainty.",
        head=("Log", "Load", "Window", "Cycles", *(SYMBOL[m] for m in given)),
        units=("", "Ω", "s", "", *(UNIT[m] for m in given)),
        rows=tuple(_thinned(runs, row)),
        links=_links(runs),
        note=metrics_note(given).strip(),
    )


def efficiencies_table(runs: Sequence[Run]) -> Table:
    """Mean efficiencies of every run with their standard uncertainties and 95 % intervals."""
    given = [m for m in METRICS[6:] if any(run["mean"][FIELDS[m]] is not None for run in runs)]

    def row(run: Run) -> tuple[str, ...]:
        cells = [(_with_uncertainty(run, m, 3), _interval(run, m)) for m in given]
        return (run["name"], load_text(run), window_text(run), *(text for pair in cells for text in pair))

    return Table(
        id="efficiencies",
        caption="Efficiencies: means of the cycles' ratios, ± standard uncertainty, and 95 % intervals.",
        head=("Log", "Load", "Window", *(text for m in given for text in (SYMBOL[m], "95 % interval"))),
        units=("", "Ω", "s", *("" for _ in given for _ in range(2))),
        rows=tuple(_thinned(runs, row)),
        note=metrics_note(given)
        + "Errors of the sensors are common to all runs with the same sensors, so differences between loads are better "
        "known than each value.",
    )


def net_table(runs: Sequence[Run]) -> Table | None:
    """Net energies of whole cycles of every run, means with their standard uncertainties; None where no run has any."""
    given = [m for m in NET_METRICS if any(run["mean"][FIELDS[m]] is not None for run in runs)]
    if not given:
        return None

    def row(run: Run) -> tuple[str, ...]:
        return (run["name"], load_text(run), *(_with_uncertainty(run, m, DECIMALS[m]) for m in given))

    return Table(
        id="net",
        caption="Whole cycles: line energy of the payout, line energy returned in haul-in, and net line energy from onset to "
        "next onset, ± standard uncertainty.",
        head=("Log", "Load", *(SYMBOL[m] for m in given)),
        units=("", "Ω", *(UNIT[m] for m in given)),
        rows=tuple(_thinned(runs, row)),
        note="These energies do not depend on the integration window. "
        + ("η_net = E_gen, cycle / E_net. " if "eta_net" in given else "")
        + "The report of each log states why it has none; in open circuit they are not evaluated.",
    )


def repeatability_table(runs: Sequence[Run]) -> Table | None:
    """Largest deviation of any cycle from the mean, for every run; None where no run has two cycles."""
    several = [run for run in runs if run["complete"] > 1]
    given = [m for m in METRICS if any(run["max_deviation_percent"][FIELDS[m]] is not None for run in several)]
    if not given:
        return None

    def row(run: Run) -> tuple[str, ...]:
        deviations = (number(run["max_deviation_percent"][FIELDS[m]], 2) for m in given)
        return (run["name"], load_text(run), f"{run['complete']}", *deviations)

    return Table(
        id="repeatability",
        caption="Repeatability: largest deviation of any cycle from the mean of its run, in percent of the mean.",
        head=("Log", "Load", "Cycles", *(SYMBOL[m] for m in given)),
        units=("", "Ω", "", *("%" for _ in given)),
        rows=tuple(_thinned(several, row)),
    )


def logs_table(runs: Sequence[Run]) -> Table:
    """Every log: its cycles, and what was found wrong with it."""

    def row(run: Run) -> tuple[str, ...]:
        kinds = ", ".join(kind.replace("_", " ") for kind in run["findings"])
        found = f"{count_of(run)}: {kinds}" if kinds else "none"
        return (
            run["name"],
            load_text(run),
            window_text(run),
            KINDS[origin_from(run).measured],
            f"{run['complete']} of {run['cycles']}",
            percent(run["removed_share"], 2),
            found,
        )

    return Table(
        id="logs",
        caption="Logs: complete cycles, share of the samples that findings took out, number and kinds of findings.",
        head=("Log", "Load", "Window", "Data", "Complete cycles", "Data lost", "Findings"),
        units=("", "Ω", "s", "", "", "%", ""),
        rows=tuple(_thinned(runs, row)),
        text_columns=(0, 3, 6),
        links=_links(runs),
    )


def between_table(found: Sequence[Run]) -> Table | None:
    """Findings that a log has beside the others; None if there is none."""
    if not found:
        return None
    return Table(
        id="between",
        caption="Logs that lie apart from the others. The data are kept; the operator decides.",
        head=("Log", "Finding", "What to do"),
        units=("", "", ""),
        rows=tuple(
            (one["run"], f"{one['kind'].replace('_', ' ')}: {one['message']}", one["action"])
            for one in found[:MOST_RUNS]
        ),
        text_columns=(0, 1, 2),
    )


def faults_table(failed: Sequence[Run]) -> Table | None:
    """Logs that could not be used, each with its sentence; None if there is none."""
    if not failed:
        return None
    return Table(
        id="faults",
        caption="Logs that could not be used.",
        head=("Log", "Why"),
        units=("", ""),
        rows=tuple((run["name"], run["fault"]) for run in failed[:MOST_RUNS]),
        text_columns=(0, 1),
    )


def _with_uncertainty(run: Run, metric: str, otherwise: int) -> str:
    value, u = run["mean"][FIELDS[metric]], run["standard_uncertainty"][FIELDS[metric]]
    text = stated(value, u, otherwise)
    return text if value is None or not u else f"{text} ± {uncertain(u)}"


def _interval(run: Run, metric: str) -> str:
    ends, u = run["interval_95"][FIELDS[metric]], run["standard_uncertainty"][FIELDS[metric]]
    return "–" if ends is None or not u else f"{number(ends[0], places(u))} to {number(ends[1], places(u))}"


def _thinned(runs: Sequence[Run], row: Callable[[Run], tuple[str, ...]]) -> list[tuple[str, ...]]:
    if len(runs) <= MOST_RUNS:
        return [row(run) for run in runs]
    half = MOST_RUNS // 2
    first, last = [row(run) for run in runs[:half]], [row(run) for run in runs[-half:]]
    return [*first, (f"… {len(runs) - MOST_RUNS} more, in the dataset", *[""] * (len(first[0]) - 1)), *last]


def _links(runs: Sequence[Run]) -> tuple[str, ...]:
    """Addresses of the logs' own reports, none where there are too many rows to keep them apart."""
    from urllib.parse import quote

    if len(runs) > MOST_RUNS:
        return ()
    return tuple(f"runs/{quote(run['name'])}.html" for run in runs)
