"""Scores of the families of trials: counts beside the bars, and a line for each case that missed them."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import msgspec
from trial_cases import NamedCause, Result
from trial_judge import Judgement, is_certain, judge
from trial_truth import truth_of

from winchcascade.blind.score import MAX_ALTERNATIVES


class Bar(NamedTuple):
    """A bar: its words, the shares between which it is reached, and the minimum number of cases that decide. [1]"""

    words: str
    low: float
    minimum: int
    high: float = 1.0


class Figure(NamedTuple):
    """One figure of a family: how many of how many, beside the bar if there is one."""

    what: str
    part: int
    of: int
    bar: Bar | None = None

    @property
    def line(self) -> str:
        """The line of the table."""
        share = f"{100 * self.part / self.of:.1f} %" if self.of else "-"
        bar = f"{self.bar.words:<28} {self._result(self.bar)}" if self.bar else ""
        return f"  {self.what:<58} {self.part:>4} of {self.of:<4} {share:>8}   {bar}".rstrip()

    def _result(self, bar: Bar) -> str:
        """Whether the bar is reached; too few cases decide nothing."""
        if self.of < bar.minimum:
            return f"too few: {self.of} of {bar.minimum}"
        return "reached" if bar.low <= self.part / self.of <= bar.high else "NOT reached"


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
    """The effect of a cause and the alternatives that count: all look-alikes, and the first rivals."""
    return cause.names[: 1 + len(cause.look_alikes or ()) + MAX_ALTERNATIVES]


def quiet(result: Result) -> bool:
    """Whether the diagnosis found no gap."""
    return result.found is not None and result.found.verdict == "no_gap"


def entry_named(result: Result) -> bool:
    """Whether the wrong entry is the only cause, or an alternative of one that is the same in the logs."""
    entry = result.plan.entry
    if entry is None or result.found is None or len(result.found.causes) != 1:
        return False
    cause = result.found.causes[0]
    if entry.log is not None and cause.run != f"{entry.log}.csv":
        return False
    return cause.effect == entry.effect or (cause.effect in entry.pairs and entry.effect in cause.names)


def intervals(results: Sequence[Result]) -> Iterator[tuple[bool, bool]]:
    """Whether each true number lies in its interval, and whether that is two-sided, for every injected effect that is named."""
    for result in results:
        for cause in () if result.found is None else result.found.causes:
            for name, truth in result.parameters.get(cause.effect, {}).items():
                if name in cause.parameters:
                    number = cause.parameters[name]
                    yield number.holds(truth), number.at_limit is None and not number.beyond_range


def _count(what: str, flags: Sequence[bool], bar: Bar | None = None) -> Figure:
    return Figure(what, sum(flags), len(flags), bar)


def nothing_figures(results: Sequence[Result]) -> list[Figure]:
    return [_count("no_gap", [quiet(r) for r in results], Bar("59 of 60", 59 / 60, 60))]


def single_figures(results: Sequence[Result]) -> list[Figure]:
    return [
        _count("named alone", [named_alone(r) for r in results], Bar("57 of 60", 57 / 60, 60)),
        _count("named, others beside it included", [names_all(r) for r in results]),
        *interval_figures(results),
    ]


def interval_figures(results: Sequence[Result], bar: Bar | None = None) -> list[Figure]:
    found = list(intervals(results))
    two = [holds for holds, both in found if both]
    one = [holds for holds, both in found if not both]
    return [
        _count("two-sided intervals that hold the true number", two, bar),
        _count("one-sided intervals that hold it", one),
    ]


def coverage_figures(results: Sequence[Result]) -> list[Figure]:
    named = [named_alone(r) for r in results]
    return [*interval_figures(results), _count("all effects named, and no other", named)]


def all_intervals(results: Sequence[Result]) -> list[Figure]:
    return interval_figures(results, Bar("93 to 97 % of 600 or more", 0.93, 600, 0.97))


def entries_figures(results: Sequence[Result]) -> list[Figure]:
    kinds = sorted({r.plan.entry.effect for r in results if r.plan.entry is not None})
    figures = [_count("entry named alone", [entry_named(r) for r in results], Bar("90 % of 60", 0.9, 60))]
    for kind in kinds:
        of_kind = [r for r in results if r.plan.entry is not None and r.plan.entry.effect == kind]
        figures.append(_count(f"  {kind}", [entry_named(r) for r in of_kind]))
    return figures


def shares_hold(result: Result) -> list[bool]:
    """For each load, whether the interval of the only cause's contribution to eta_pto holds the true one."""
    accounts = (
        {} if result.found is None else {a.load_ohm: a for a in result.found.contributions if a.metric == "eta_pto"}
    )
    named = named_alone(result)
    held = []
    for load, truth in result.shares.items():
        account = accounts.get(float(load)) if named else None
        parts = [] if account is None else [part for part in account.parts if part.effect is not None]
        held.append(any(p.low is not None and p.high is not None and _within(truth, p.low, p.high) for p in parts))
    return held


NEGLIGIBLE = 1e-5
"""A contribution to an efficiency below this counts as zero: the reduction of two noise-free logs differs by as much. [1]"""

RELEVANT = 0.001
"""Contribution from which an effect counts as relevant. [1]"""


def _within(truth: float, low: float, high: float) -> bool:
    return low - NEGLIGIBLE <= truth <= high + NEGLIGIBLE


def all_shares_hold(result: Result) -> bool:
    """Whether the interval holds at every load."""
    return bool(result.shares) and all(shares_hold(result))


def contributions_figures(results: Sequence[Result]) -> list[Figure]:
    named = [r for r in results if named_alone(r)]
    felt = [r for r in named if max(map(abs, r.shares.values()), default=0.0) >= RELEVANT]
    return [
        _count(
            "interval of eta_pto holds at every load", [all_shares_hold(r) for r in results], Bar("90 % of 60", 0.9, 60)
        ),
        _count("  of those whose cause is named alone", [all_shares_hold(r) for r in named]),
        _count("  of those whose effect changes eta_pto by 0.001", [all_shares_hold(r) for r in felt]),
        _count("  loads of those named", [held for r in named for held in shares_hold(r)]),
        *interval_figures(results),
    ]


def simulation_well(result: Result) -> bool:
    """Whether a case with an own simulation has the injected causes alone, and the model form of its simulator."""
    return _causes_right(result) and _has_form(result) == (result.plan.simulator != "same")


def _causes_right(result: Result) -> bool:
    """Whether the injected causes are named alone, or none where none is injected."""
    if result.plan.effects:
        return named_alone(result)
    return result.found is not None and not result.found.causes


def _has_form(result: Result) -> bool:
    """Whether a model form is reported in the generator stage."""
    forms = () if result.found is None else result.found.model_form or ()
    return any(form.stage == "generator" for form in forms)


def simulation_figures(results: Sequence[Result]) -> list[Figure]:
    same, averaged = ([r for r in results if (r.plan.simulator == "same") is alike] for alike in (True, False))
    hidden = [[r for r in group if r.plan.effects] for group in (same, averaged)]
    nine_of_ten, every = Bar("90 %", 0.9, 18), Bar("all", 1.0, 20)
    return [
        _count("same physics: injected cause named alone", [named_alone(r) for r in hidden[0]], nine_of_ten),
        _count("same physics: no cause named falsely", [_none_false(r) for r in same], every),
        _count("same physics: no model form of the generator", [not _has_form(r) for r in same]),
        _count("averaged bridge: model form in the generator stage", [_has_form(r) for r in averaged], every),
        _count("averaged bridge: injected cause named", [names_all(r) for r in hidden[1]], nine_of_ten),
        _count("averaged bridge: no cause named falsely", [_none_false(r) for r in averaged]),
    ]


def _none_false(result: Result) -> bool:
    """Whether every cause is an injected effect or has one as its alternative."""
    causes = () if result.found is None else result.found.causes
    return all(set(counted(cause)) & set(result.plan.effects) for cause in causes)


def judged(result: Result) -> Judgement:
    """Judgement of a case by what an honest answer may be; a diagnosis that failed is not honest and names nothing."""
    truth = truth_of(result.plan)
    if result.found is None:
        return Judgement((), honest=False, named=False if truth["named"] else None)
    other = None if result.plain is None else msgspec.to_builtins(result.plain)
    return judge(truth, msgspec.to_builtins(result.found), other)


class HonestBars(NamedTuple):
    """Bars of a family whose truth the model may lack: words and shares of honest answers, and of the truth named."""

    honest: Bar | None = None
    named: Bar | None = None
    kinds: tuple[str, ...] = ()


def honest_figures(results: Sequence[Result], bars: HonestBars) -> list[Figure]:
    """Honest answers and named truths; `bars.kinds` are the kinds of cases whose truth must be named, all if empty."""
    found = [(r.plan.kind, judged(r)) for r in results]
    wanted = [j for kind, j in found if j.named is not None and (not bars.kinds or kind in bars.kinds)]
    figures = [
        _count("honest", [j.honest for _, j in found], bars.honest),
        _count("no cause named falsely with certainty", [not j.false for _, j in found]),
        _count("truth named, or a declared alternative of it", [bool(j.named) for j in wanted], bars.named),
    ]
    for kind in sorted({kind for kind, _ in found if kind}):
        figures.append(_count(f"  {kind}: honest", [j.honest for name, j in found if name == kind]))
        figures.append(_count(f"  {kind}: named", [j.named for n, j in found if n == kind and j.named is not None]))
    return figures


def honest_and_named(result: Result) -> bool:
    """Whether a case is honest and its truth is named where the catalogue has it."""
    judgement = judged(result)
    return judgement.honest and judgement.named is not False


HONEST = {
    "wide": HonestBars(Bar("no false certainty, 38 of 40", 38 / 40, 40), Bar("90 % of 40", 0.9, 40)),
    "biased": HonestBars(Bar("no false certainty, 19 of 20", 19 / 20, 20), Bar("90 % of 20", 0.9, 20)),
    "calibrated": HonestBars(Bar("same causes in 14 of 15", 14 / 15, 15), Bar("90 % of 15", 0.9, 15)),
    "warming": HonestBars(
        Bar("39 of 40", 39 / 40, 40),
        Bar("90 % of those shuffled", 0.9, 20),
        ("warming shuffled", "warming magnets shuffled"),
    ),
    "rolloff_order": HonestBars(Bar("all", 1.0, 20), Bar("90 % of those shuffled", 0.9, 10), ("rolloff shuffled",)),
    "rope": HonestBars(Bar("all", 1.0, 20), Bar("90 % of 20", 0.9, 20)),
    "leak": HonestBars(Bar("all", 1.0, 20), Bar("90 % of 20", 0.9, 20)),
    "other_physics": HonestBars(Bar("57 of 60", 57 / 60, 60), Bar("80 % of 30", 0.8, 30)),
}
"""Bars of the families whose rigs or physics differ from the model of the diagnosis."""

FIGURES: dict[str, Callable[[Sequence[Result]], list[Figure]]] = {
    "nothing": nothing_figures,
    "single": single_figures,
    "coverage": coverage_figures,
    "entries": entries_figures,
    "contributions": contributions_figures,
    "own_simulation": simulation_figures,
    **{family: partial(honest_figures, bars=bars) for family, bars in HONEST.items()},
}
WELL = {
    "nothing": quiet,
    "single": named_alone,
    "coverage": named_alone,
    "entries": entry_named,
    "contributions": all_shares_hold,
    "own_simulation": simulation_well,
    **dict.fromkeys(HONEST, honest_and_named),
}
"""Figures of each family, and whether a case of it went as it should."""


def table(figures: Sequence[Figure]) -> list[str]:
    """Lines of figures beside their bars; what no case gives is left out."""
    head = f"  {'figure':<58} {'cases':>12} {'share':>8}   {'bar':<28} result"
    return [head, *(figure.line for figure in figures if figure.of or figure.bar)]


def report(family: str, results: Sequence[Result]) -> Iterator[str]:
    """Lines of the table of one family."""
    making, diagnosing = statistics.median(r.making for r in results), statistics.median(r.diagnosing for r in results)
    total = sum(r.making + r.diagnosing for r in results)
    used = [r.processor for r in results if r.processor is not None]
    yield (
        f"{family}: {len(results)} cases, {total / 60:.1f} min of one core; median {making:.1f} s to make, "
        f"{diagnosing:.1f} s to diagnose"
        + (f"; processor {statistics.median(used):.1f} s, in all {sum(used):.0f} s" if used else "")
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
        rivals = f" or {'/'.join(cause.names[1:])}" if cause.names[1:] else ""
        sure = "!" if is_certain(msgspec.to_builtins(cause), found.verdict) else ""
        causes.append(f"{cause.effect}{sure}{rivals} {numbers}")
    minor = f"; minor: {', '.join(m.effect for m in found.minor)}" if found.minor else ""
    return f"{found.verdict}: {'; '.join(causes) or 'no cause'}{minor}"


def _end(value: float | None) -> str:
    return "open" if value is None else f"{value:.3g}"
