"""Diagnose campaigns of the independent twin at any rate, noise and number of repeats, and print scores beside their bars.

python benchmarks/trials.py [--family NAME ...] [--cases N] [--first K] [--jobs J] [--out FOLDER] [--keep FOLDER] [--score]
                            [--make FOLDER] [--from FOLDER]

Results are lines of JSON in --out, one file a family; a case that is there already is not done again, so that a trial can be
interrupted. --score prints the tables of what is there. --make only makes the campaigns, each with its truth.json, in
FOLDER/family/number; trial_judge.py scores their diagnoses. --from diagnoses campaigns that --keep or --make has made before.
Every seed is fixed in trial_plans.py.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import msgspec
from measure import ROOT
from trial_cases import Order, Result, do_case
from trial_made import Made, make_case
from trial_plans import FAMILIES, plan_case
from trial_progress import Printed
from trial_scores import all_intervals, report, table
from trial_speed import speed_lines
from trial_thresholds import THRESHOLD_CASES, read_done, run_thresholds, threshold_lines

from winchcascade.core.jobs import Workers, one_thread_each, processes

SPEED, THRESHOLDS = "speed", "thresholds"
"""Families that are measured apart."""


def read_results(path: Path) -> dict[int, Result]:
    """Results of a family by the numbers of their cases; a line that was cut off is left out."""
    found = {}
    for line in path.read_bytes().splitlines() if path.is_file() else ():
        try:
            result = msgspec.json.decode(line, type=Result)
        except msgspec.DecodeError:
            continue
        found[result.plan.number] = result
    return found


def run_family(name: str, options: argparse.Namespace) -> None:
    """Do the cases of a family that are not done yet."""
    path = options.out / f"{name}.jsonl"
    done = read_results(path)
    count = options.cases or FAMILIES[name].cases
    plans = [plan_case(name, number) for number in range(options.first, options.first + count) if number not in done]
    plans.sort(key=lambda plan: -plan.repeats)
    keep = str(options.keep) if options.keep else None
    made = str(options.made) if options.made else None
    orders = {
        f"{name} {plan.number}: {plan.hidden}, {plan.settings}": Order(plan, str(path), keep, made) for plan in plans
    }
    for _ in Workers(options.jobs).run(do_case, orders, Printed()):
        pass


def make_family(name: str, options: argparse.Namespace) -> None:
    """Make the campaigns of a family that are not there yet, without diagnosing them."""
    count = options.cases or FAMILIES[name].cases
    plans = [plan_case(name, number) for number in range(options.first, options.first + count)]
    for _ in Workers(options.jobs).run(
        make_case, {f"{name} {plan.number}: {plan.hidden}": Made(plan, str(options.make)) for plan in plans}, Printed()
    ):
        pass


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    families = [*FAMILIES, THRESHOLDS, SPEED]
    parser.add_argument("--family", action="append", choices=families, help="a family; may be repeated; default all")
    parser.add_argument("--cases", type=int, help="number of cases of each family; its own number by default")
    parser.add_argument("--first", type=int, default=1, help="number of the first case, from 1 on")
    parser.add_argument("--jobs", type=int, default=processes(), help="processes")
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "trials", help="folder of the results")
    parser.add_argument("--keep", type=Path, help="keep the campaigns and diagnoses in this folder")
    parser.add_argument("--from", type=Path, dest="made", help="diagnose campaigns of --keep or --make in this folder")
    parser.add_argument("--make", type=Path, help="only make the campaigns, with their truths, in this folder")
    parser.add_argument("--score", action="store_true", help="do no cases, print the scores of those that are done")
    options = parser.parse_args()
    one_thread_each()
    asked = options.family or families
    if options.make:
        for name in asked:
            if name in FAMILIES:
                make_family(name, options)
        return
    options.out.mkdir(parents=True, exist_ok=True)
    for name in asked:
        if not options.score and name in FAMILIES:
            run_family(name, options)
    everything: list[Result] = []
    for name in FAMILIES:
        results = list(read_results(options.out / f"{name}.jsonl").values())
        everything += results
        if results and name in asked:
            print("\n" + "\n".join(report(name, results)))
    if everything:
        print("\n".join(("\nintervals of all families", *table(all_intervals(everything)))))
    if THRESHOLDS in asked:
        if not options.score:
            run_thresholds(options.out, options.first, options.cases or THRESHOLD_CASES, options.jobs)
        print("\n" + "\n".join(threshold_lines(read_done(options.out))))
    if SPEED in asked:
        print("\n" + "\n".join(speed_lines(options.out / "speed.json", measure=not options.score)))


if __name__ == "__main__":
    main()
