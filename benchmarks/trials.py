"""Diagnose campaigns of the independent twin at any rate, noise and number of repeats, and print
scores beside their bars.

Results are lines of JSON in --out, one file a family; a case that is there already is not done
again, so that a trial can be interrupted. --score prints the tables of what is there. --make only
makes the campaigns, each with its truth.json, in FOLDER/family/number, where `winchcascade blind
score FOLDER/family` diagnoses and judges them, too. --keep keeps the campaigns of a run there.
--from diagnoses campaigns that --keep or --make has made before. Seeds and bars are fixed in
families.py.
"""

from __future__ import annotations

import argparse
import math
import os
import statistics
import subprocess
import time
from collections.abc import Iterator, Sequence
from functools import cache, partial
from itertools import pairwise
from pathlib import Path

import msgspec
from campaigns import PLAIN, Case, draw, truth_of, write_campaign
from families import ALL_COVERED, BASED, FAMILIES, Bar, Figure, plan_case, threshold_case
from owner_simulators import noise_free

from winchcascade.batch.campaign_diagnosis import diagnose_campaign
from winchcascade.blind.cases import STATED_LOADS, write_log
from winchcascade.blind.crane_motion import draw_motion
from winchcascade.blind.injected import Hidden
from winchcascade.blind.judge import CaseScore, Diagnosis, judge
from winchcascade.blind.truth import TRUTH_FILE
from winchcascade.blind.twin import Solved, Twin, solve_twin
from winchcascade.blind.twin_log import read_log
from winchcascade.core.files import json_bytes, scratch_folder
from winchcascade.core.jobs import Nobody, Workers, one_thread_each, processes
from winchcascade.ingest.read import read_run
from winchcascade.reduction.reduce import reduce

ROOT = Path(__file__).parent.parent
NEGLIGIBLE = 1e-5
"""A contribution to an efficiency below this counts as zero: the reduction of two noise-free
logs differs by as much. [1]
"""


class ModelForm(msgspec.Struct, frozen=True):
    """Stage of a difference between the owner's own simulation and the model."""

    stage: str | None = None


class Part(msgspec.Struct, frozen=True):
    """One part of the account of a metric."""

    effect: str | None
    low: float | None = None
    high: float | None = None


class Account(msgspec.Struct, frozen=True):
    """The account of one metric of one run."""

    metric: str
    load_ohm: float | str | None = None
    parts: tuple[Part, ...] = ()


class Threshold(msgspec.Struct, frozen=True):
    """The value of its parameter from which an effect alone would be named, None where no
    plausible one would be.
    """

    effect: str
    named_from: float | None = None


class Found(Diagnosis, frozen=True):
    """The part of the JSON of a diagnosis that the families compare."""

    model_form: tuple[ModelForm, ...] | None = None
    contributions: tuple[Account, ...] = ()
    thresholds: tuple[Threshold, ...] = ()


class Result(msgspec.Struct, frozen=True):
    """One line of the results: a case, the diagnosis, and the times. [s]

    Parameters
    ----------
    plain : diagnosis with the built-in rig file, where the family compares two rig files
    shares : true contribution of the effect to eta_pto by load in ohm, where the family compares it
        [1]
    processor : processor time of the diagnosis, that of child processes included
    commit : of the checkout that diagnosed it
    """

    plan: Case
    found: Found | None
    making: float
    diagnosing: float
    commit: str
    processor: float | None = None
    plain: Found | None = None
    shares: dict[str, float] = {}
    fault: str | None = None


class Printed(Nobody):
    """Prints each case as it is done."""

    def __init__(self) -> None:
        self._begin = time.perf_counter()

    def done(self, name: str, fault: str | None) -> None:
        """Print a case."""
        print(
            f"{time.perf_counter() - self._begin:7.0f} s  {name}{': ' + fault if fault else ''}",
            flush=True,
        )


# ------------------------------------------------------------------------------------ doing cases
@cache
def commit() -> str:
    """Commit of this checkout, marked where files were changed since."""
    command = ["git", "-C", str(ROOT), "describe", "--always", "--dirty", "--exclude", "*"]
    return (
        subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()
        or "unknown"
    )


def make_case(case: Case, out: Path) -> None:
    """Make the campaign of a case with its truth, unless it is there."""
    folder = out / case.family / case.name
    if not (folder / TRUTH_FILE).is_file():
        folder.mkdir(parents=True, exist_ok=True)
        write_campaign(case, folder)
        (folder / TRUTH_FILE).write_bytes(json_bytes(truth_of(case)))


def made_before(case: Case, out: Path) -> Path:
    """Folder of a campaign that --keep or --make has made."""
    found = out / case.family / case.name
    if not found.is_dir():
        found = out / f"{case.family}-{case.name}"
    if not (found / "campaign.toml").is_file():
        raise FileNotFoundError(
            2, "expected a campaign that --keep or --make of trials.py has made", str(found)
        )
    return found


def do_case(case: Case, results: Path, keep: Path | None = None, made: Path | None = None) -> None:
    """Make and diagnose one case, and add its result to the file of its family."""
    with scratch_folder() as scratch:
        start = time.perf_counter()
        if made is None:
            make_case(case, keep or scratch)
        folder = made_before(case, made or keep or scratch)
        begin, used = time.perf_counter(), sum(os.times()[:4])
        found, fault = list[Found](), None
        try:
            for name in ("campaign.toml", PLAIN) if case.calibrated else ("campaign.toml",):
                found.append(msgspec.convert(diagnose_campaign(folder / name), Found))
        except Exception as error:  # a diagnosis that fails is a result, too
            fault = f"{type(error).__name__}: {error}"
        end, used = time.perf_counter(), sum(os.times()[:4]) - used
        shares = true_shares(case, scratch) if case.family == "contributions" else {}
    first, plain = (*found, None, None)[:2]
    result = Result(case, first, begin - start, end - begin, commit(), used, plain, shares, fault)
    with results.open("ab") as lines:
        lines.write(msgspec.json.encode(result) + b"\n")


def true_shares(case: Case, folder: Path) -> dict[str, float]:
    """True contribution of the injected effects to eta_pto by stated load: the twin with and
    without them, without noise.

    Both follow the motion of the first repeat. The open circuit has no eta_pto.
    """
    _, twin, rng = draw(case)
    shares = {}
    for log, load in STATED_LOADS.items():
        motion = draw_motion(log, rng)
        solved = solve_twin(twin, log, *motion)
        read_log(
            twin, solved, rng, case.logger
        )  # draws the noise of the log, after which the next motion is drawn
        if math.isfinite(load):
            plain = msgspec.structs.replace(twin, hidden=Hidden())
            without = _eta_pto(plain, solve_twin(plain, log, *motion), load, folder)
            shares[repr(load)] = _eta_pto(twin, solved, load, folder) - without
    return shares


def _eta_pto(twin: Twin, solved: Solved, load: float, folder: Path) -> float:
    """Efficiency of the noise-free readings. [1]"""
    path = folder / "noise_free.csv"
    write_log(path, noise_free(twin, solved))
    eta = reduce(read_run(path, load=load)).mean.eta_pto
    if eta is None:
        raise ValueError(f"{path}: the reduction gives no eta_pto")
    return eta


def read_results(path: Path) -> dict[int, Result]:
    """Results of a family by the numbers of their cases; a line that was cut off is left out."""
    found = {}
    for line in path.read_bytes().splitlines() if path.is_file() else ():
        try:
            result = msgspec.json.decode(line, type=Result)
        except msgspec.DecodeError:
            continue
        family, number = result.plan.family, result.plan.number
        plan = result.plan if family == "thresholds" else plan_case(family, number)
        found[number] = msgspec.structs.replace(result, plan=plan)
    return found


def base_thresholds(base: int, out: Path) -> None:
    """Write the thresholds that the diagnosis of a campaign without an effect states, by effect."""
    with scratch_folder() as folder:
        write_campaign(Case("thresholds", base, FAMILIES["thresholds"].seed + 1), folder)
        found = msgspec.convert(diagnose_campaign(folder / "campaign.toml"), Found)
    stated = {one.effect: one.named_from for one in found.thresholds if one.named_from is not None}
    (out / f"thresholds_base_{base}.json").write_bytes(json_bytes(stated))


def planned(name: str, numbers: Sequence[int], options: argparse.Namespace) -> list[Case]:
    """Plan cases of a family; those of `thresholds` after the campaigns that state them."""
    if name != "thresholds":
        return [plan_case(name, number) for number in numbers]
    bases = {number: (number - 1) // BASED for number in numbers}
    paths = {base: options.out / f"thresholds_base_{base}.json" for base in set(bases.values())}
    orders = {
        f"thresholds of campaign {base}": base for base, path in paths.items() if not path.is_file()
    }
    for _ in Workers(options.jobs).run(
        partial(base_thresholds, out=options.out), orders, Printed()
    ):
        pass
    stated = {
        base: msgspec.json.decode(path.read_bytes(), type=dict[str, float])
        for base, path in paths.items()
    }
    return [threshold_case(number, stated[base]) for number, base in bases.items()]


def run_family(name: str, options: argparse.Namespace) -> None:
    """Make the campaigns of a family, or do the cases that are not done yet, the longest first."""
    path = options.out / f"{name}.jsonl"
    done = {} if options.make else read_results(path)
    numbers = range(options.first, options.first + (options.cases or FAMILIES[name].cases))
    plans = planned(name, [number for number in numbers if number not in done], options)
    orders = {f"{name} {p.number}: {p.text}": p for p in sorted(plans, key=lambda p: -p.repeats)}
    work = partial(do_case, results=path, keep=options.keep, made=options.made)
    if options.make:
        work = partial(make_case, out=options.make)
    for _ in Workers(options.jobs).run(work, orders, Printed()):
        pass


# ----------------------------------------------------------------------------------------- scores
def figures(result: Result, score: CaseScore) -> dict[Figure, list[bool]]:
    """What a case gives for each figure; a diagnosis that failed is not honest and names
    nothing.
    """
    causes = [
        sorted(cause.effect for cause in found.causes)
        for found in (result.found, result.plain)
        if found
    ]
    same = result.plain is None or causes[0] == causes[-1]
    found = {Figure.HONEST: [bool(score.honest) and same], Figure.CERTAIN: [not score.false]}
    if truth_of(result.plan).named:
        found[Figure.NAMED] = [bool(score.named)]
    for what, two_sided in ((Figure.COVERED, True), (Figure.ONE_SIDED, False)):
        found[what] = [
            p.covered for p in score.parameters if p.value is not None and p.two_sided is two_sided
        ]
    if result.shares:
        found[Figure.SHARES] = [score.named is True and all(shares_hold(result))]
    if result.plan.simulator is not None:
        forms = () if result.found is None else result.found.model_form or ()
        found[Figure.FORM] = [
            any(form.stage == "generator" for form in forms) == (result.plan.simulator != "same")
        ]
    return found


def shares_hold(result: Result) -> Iterator[bool]:
    """For each load, whether the interval of a cause's contribution to eta_pto holds the true
    one.
    """
    accounts = () if result.found is None else result.found.contributions
    parts = {
        a.load_ohm: [part for part in a.parts if part.effect]
        for a in accounts
        if a.metric == "eta_pto"
    }
    for load, truth in result.shares.items():
        ends = [
            (p.low, p.high)
            for p in parts.get(float(load), [])
            if p.low is not None and p.high is not None
        ]
        yield any(low - NEGLIGIBLE <= truth <= high + NEGLIGIBLE for low, high in ends)


BINS = (0.0, 0.5, 0.8, 0.9, 0.95, 0.98, 1.0)
"""Ends of the ranges of probability in which causes are compared with the truth."""


def calibration(results: Sequence[Result]) -> list[str]:
    """Lines on how often the causes of each range of probability are true, beside the mean that
    the diagnoses state.
    """
    rows = []
    for r in results:
        truth = truth_of(r.plan)
        true = {*truth.may_be_certain, *(name for group in truth.named for name in group)}
        causes = () if r.found is None else r.found.causes
        rows += [(cause.probability, cause.effect in true) for cause in causes]
    lines = []
    for low, high in pairwise(BINS):
        own = [row for row in rows if low <= row[0] and (row[0] < high or high == 1.0)]
        if own:
            stated = 100.0 * statistics.mean(p for p, _ in own)
            what = f"causes with {low:g} to {high:g}, stated {stated:.1f} %"
            lines.append(line(what, [hit for _, hit in own]))
    return lines


def line(what: str, flags: Sequence[bool], bar: Bar | None = None) -> str:
    """A line of the table: how many of how many, beside the bar if there is one."""
    part, of = sum(flags), len(flags)
    share = f"{100 * part / of:.1f} %" if of else "-"
    return f"  {what:<58} {part:>4} of {of:<4} {share:>8}   {bar.result(part, of) if bar else ''}".rstrip()


def report(name: str, results: Sequence[Result]) -> tuple[list[str], list[bool]]:
    """Lines of the table of one family, and whether each of its two-sided intervals holds."""
    family, scores = (
        FAMILIES[name],
        [judge(r.plan.name, truth_of(r.plan), r.found) for r in results],
    )
    found = [figures(r, score) for r, score in zip(results, scores, strict=True)]
    used = [math.nan if r.processor is None else r.processor for r in results]
    lines = [
        f"{name}: {len(results)} cases; median {statistics.median(r.making for r in results):.1f} "
        f"s to make, "
        f"{statistics.median(r.diagnosing for r in results):.1f} s to diagnose; processor time of "
        f"the diagnoses "
        f"{sum(used):.0f} s, median {statistics.median(used):.1f} s"
    ]

    def flags(figure: Figure, kinds: Sequence[str]) -> list[bool]:
        pairs = zip(results, found, strict=True)
        return [
            flag
            for r, f in pairs
            if not kinds or r.plan.kind in kinds
            for flag in f.get(figure, ())
        ]

    barred = {figure for figure, _ in family.bars}
    lines += [
        line(", ".join((figure, *bar.kinds))[:58], flags(figure, bar.kinds), bar)
        for figure, bar in family.bars
    ]
    further = [
        figure
        for figure in (
            Figure.NAMED,
            Figure.HONEST,
            Figure.CERTAIN,
            Figure.COVERED,
            Figure.ONE_SIDED,
        )
        if figure not in barred
    ]
    lines += [line(figure, flags(figure, ())) for figure in further if flags(figure, ())]
    kinds = sorted({r.plan.kind for r in results})
    for kind in kinds if len(kinds) > 1 else ():
        lines += [
            line(f"  {kind}: {what}", flags(what, [kind]))
            for what in (Figure.HONEST, Figure.NAMED)
            if flags(what, [kind])
        ]
    wanted = [(figure, bar.kinds) for figure, bar in family.bars if bar.low > 0.5] or [
        (Figure.NAMED, ())
    ]
    for r, score, given in sorted(
        zip(results, scores, found, strict=True), key=lambda row: row[0].plan.number
    ):
        counted = [
            f
            for figure, kinds in wanted
            if not kinds or r.plan.kind in kinds
            for f in given.get(figure, ())
        ]
        if not all(counted):
            answer = score.text if r.fault is None else f"fault: {r.fault}"
            lines.append(
                f"  missed {r.plan.number:>4}  {r.plan.text} -> {answer} ({r.diagnosing:.0f} s, "
                f"{r.commit})"
            )
    return lines, flags(Figure.COVERED, ())


def main() -> None:
    """Do what the options ask for, and print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--family", action="append", choices=FAMILIES, help="a family; may be repeated; default all"
    )
    parser.add_argument(
        "--cases", type=int, help="number of cases of each family; its own number by default"
    )
    parser.add_argument("--first", type=int, default=1, help="number of the first case, from 1 on")
    parser.add_argument("--jobs", type=int, default=processes(), help="processes")
    parser.add_argument(
        "--out", type=Path, default=ROOT / "build" / "trials", help="folder of the results"
    )
    parser.add_argument("--keep", type=Path, help="keep the campaigns in this folder")
    parser.add_argument(
        "--from",
        type=Path,
        dest="made",
        help="diagnose campaigns of --keep or --make in this folder",
    )
    parser.add_argument(
        "--make", type=Path, help="only make the campaigns, with their truths, in this folder"
    )
    parser.add_argument(
        "--score", action="store_true", help="do no cases, print the scores of those that are done"
    )
    options = parser.parse_args()
    one_thread_each()
    options.out.mkdir(parents=True, exist_ok=True)
    for name in [] if options.score else options.family or FAMILIES:
        run_family(name, options)
    covered: list[bool] = []
    every: list[Result] = []
    for name in [] if options.make else FAMILIES:
        results = list(read_results(options.out / f"{name}.jsonl").values())
        lines, held = report(name, results) if results else ([], [])
        covered += held
        every += results
        if lines and name in (options.family or FAMILIES):
            print("\n" + "\n".join(lines))
    if covered:
        print(f"\nall families\n{line(Figure.COVERED, covered, ALL_COVERED)}")
        print("\n".join(calibration(every)))


if __name__ == "__main__":
    main()
