"""Scores of the families of trials: counts beside the bars, and a line for each case that missed them."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from trial_cases import NamedCause, Result

from winchcascade.blind.score import MOST_RIVALS


class Figure(NamedTuple):
    """One figure of a family: how many of how many, beside the bar."""

    what: str
    part: int
    of: int
    bar: str
    low: float = 0.0
    high: float = 1.0
    least: int = 0

    @property
    def line(self) -> str:
        """The line of the table."""
        share = f"{100 * self.part / self.of:.1f} %" if self.of else "-"
        return f"  {self.what:<58} {self.part:>4} of {self.of:<4} {share:>8}   {self.bar:<28} {self.reached}".rstrip()

    @property
    def reached(self) -> str:
        """Whether the bar is reached; too few cases decide nothing."""
        if not self.bar:
            return ""
        if self.of < max(self.least, 1):
            return f"too few: {self.of} of {self.least}"
        return "reached" if self.low <= self.part / self.of <= self.high else "NOT reached"


def named_alone(result: Result) -> bool:
    """Whether the injected effects are the causes or alternatives of them, each of another, without a further cause."""
    if result.found is None or result.found.verdict not in ("explained", "partly_explained"):
        return False
    return len(result.found.causes) == len(result.plan.effects) and names_all(result)


def names_all(result: Result) -> bool:
    """Whether each injected effect is a cause or an alternative of one."""
    causes = () if result.found is None else result.found.causes
    return all(any(effect in counted(cause) for cause in causes) for effect in result.plan.effects)


def counted(cause: NamedCause) -> tuple[str, ...]:
    """The effect of a cause and the alternatives that count."""
    return cause.names[: 1 + MOST_RIVALS]


def quiet(result: Result) -> bool:
    """Whether the diagnosis found no gap."""
    return result.found is not None and result.found.verdict == "no_gap"


def entry_named(result: Result) -> bool:
    """Whether the wrong entry is the only cause, or an alternative of one that is the same in the logs."""
    entry = result.plan.entry
    if entry is None or result.found is None or len(result.found.causes) != 1:
        return False
    cause = result.found.causes[0]
    return cause.effect == entry.effect or (
        entry.effect in cause.names and (cause.effect in entry.pairs or cause.effect.endswith("_convention"))
    )


def intervals(results: Sequence[Result]) -> Iterator[tuple[bool, bool]]:
    """Whether each true number lies in its interval, and whether that is two-sided, for every injected effect that is named."""
    for result in results:
        for cause in () if result.found is None else result.found.causes:
            for name, truth in result.parameters.get(cause.effect, {}).items():
                if name in cause.parameters:
                    number = cause.parameters[name]
                    yield number.holds(truth), number.at_limit is None and not number.beyond_range


def _count(what: str, flags: Sequence[bool], bar: str = "", *, low: float = 0.0, least: int = 0) -> Figure:
    return Figure(what, sum(flags), len(flags), bar, low, least=least)


def nothing_figures(results: Sequence[Result]) -> list[Figure]:
    return [_count("no_gap", [quiet(r) for r in results], "59 of 60", low=59 / 60, least=60)]


def single_figures(results: Sequence[Result]) -> list[Figure]:
    return [
        _count("named alone", [named_alone(r) for r in results], "57 of 60", low=57 / 60, least=60),
        _count("named, others beside it included", [names_all(r) for r in results]),
        *interval_figures(results),
    ]


def interval_figures(results: Sequence[Result], bar: str = "", *, least: int = 0) -> list[Figure]:
    found = list(intervals(results))
    two = [holds for holds, both in found if both]
    one = [holds for holds, both in found if not both]
    return [
        Figure("two-sided intervals that hold the true number", sum(two), len(two), bar, 0.93, 0.97, least),
        Figure("one-sided intervals that hold it", sum(one), len(one), ""),
    ]


def coverage_figures(results: Sequence[Result]) -> list[Figure]:
    named = [named_alone(r) for r in results]
    return [*interval_figures(results), _count("all effects named, and no other", named)]


def all_intervals(results: Sequence[Result]) -> list[Figure]:
    return interval_figures(results, "93 to 97 % of 600 or more", least=600)


def entries_figures(results: Sequence[Result]) -> list[Figure]:
    kinds = sorted({r.plan.entry.effect for r in results if r.plan.entry is not None})
    figures = [_count("entry named alone", [entry_named(r) for r in results], "90 % of 60", low=0.9, least=60)]
    for kind in kinds:
        of_kind = [r for r in results if r.plan.entry is not None and r.plan.entry.effect == kind]
        figures.append(_count(f"  {kind}", [entry_named(r) for r in of_kind]))
    return figures


FIGURES = {
    "nothing": nothing_figures,
    "single": single_figures,
    "coverage": coverage_figures,
    "entries": entries_figures,
}
WELL = {"nothing": quiet, "single": named_alone, "coverage": named_alone, "entries": entry_named}
"""Figures of each family, and whether a case of it went as it should."""


def table(figures: Sequence[Figure]) -> list[str]:
    """Lines of figures beside their bars; what no case gives is left out."""
    head = f"  {'figure':<58} {'cases':>12} {'share':>8}   {'bar':<28} result"
    return [head, *(figure.line for figure in figures if figure.of or figure.bar)]


def report(family: str, results: Sequence[Result]) -> Iterator[str]:
    """Lines of the table of one family."""
    making, diagnosing = statistics.median(r.making for r in results), statistics.median(r.diagnosing for r in results)
    total = sum(r.making + r.diagnosing for r in results)
    yield (
        f"{family}: {len(results)} cases, {total / 60:.1f} min of one core; median {making:.1f} s to make, "
        f"{diagnosing:.1f} s to diagnose"
    )
    yield from table(FIGURES[family](results))
    missed = [r for r in results if not WELL[family](r)]
    if missed:
        yield f"  cases that missed, of checkout {', '.join(sorted({r.commit for r in results}))}:"
    for r in sorted(missed, key=lambda r: r.plan.number):
        yield f"  {r.plan.number:>4}  {r.plan.hidden:<34} {r.plan.settings:<38} -> {_answer(r)} ({r.diagnosing:.0f} s)"


def _answer(result: Result) -> str:
    """What the diagnosis reports, in one line."""
    found = result.found
    if found is None:
        return f"fault: {result.fault}"
    causes = []
    for cause in found.causes:
        numbers = ", ".join(f"{n.value:.3g} [{_end(n.low)}, {_end(n.high)}]" for n in cause.parameters.values())
        rivals = f" or {'/'.join(cause.names[1:])}" if cause.rivals else ""
        causes.append(f"{cause.effect}{rivals} {numbers}")
    minor = f"; minor: {', '.join(m.effect for m in found.minor)}" if found.minor else ""
    return f"{found.verdict}: {'; '.join(causes) or 'no cause'}{minor}"


def _end(value: float | None) -> str:
    return "open" if value is None else f"{value:.3g}"
