"""The corruption matrix: plausible damage of twelve classes, and how much of it moves a number without a finding.

`python tests/hardening/corruption.py --seed 1 --number 27` prints the table, `--list` each silent corruption, and
`--only CLASS --first K --number 1` repeats one. `--clean` looks for findings on undamaged logs instead.
"""

import argparse
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import damage_files as files
import damage_signals as signals
import numpy as np
from base_logs import LOGS, RATES, Log, base
from judge import Damage, Outcome, judged, scratch
from reasons import by_reason

Draw = Callable[[Log, np.random.Generator], Damage]


class Kind(NamedTuple):
    """One class: its title, the ways to damage a log (a way that counts twice is listed twice), and rates of the logs."""

    title: str
    ways: Sequence[Draw]
    rates: Sequence[int] = RATES


CLASSES = {
    1: Kind("time axis", (
        signals.wrong_unit, signals.nominal_rate, signals.lost_rows, signals.short_window, signals.reset, signals.lost_rows,
        signals.repeated_block, signals.counter_reset, signals.coarse_stamps,
    )),
    2: Kind("zeros and codes", (
        signals.zeros, signals.codes, signals.slow_channel, signals.zeros, signals.codes, signals.small_codes,
        signals.last_value, signals.unplugged, signals.clipped, signals.other_range, signals.scattered, signals.filled_in,
    ), (5, 10, 25, 100, 200)),
    3: Kind("coarse sampling", (
        signals.picked, signals.averaged, signals.picked, signals.held, signals.coarse_steps,
    )),
    4: Kind("load", (
        files.stated_load, files.wrong_gain, files.load_property, files.stated_load, files.wrong_gain, files.computed_current,
        files.stated_load, files.load_property, files.calibrated_under_load,
    )),
    5: Kind("several tables", (files.two_sheets, files.two_sheets, files.two_in_matlab, files.two_groups), (10, 25)),
    6: Kind("unit conflicts", (files.unit_conflict, files.unit_conflict, files.wrong_header_unit, files.overridden)),
    7: Kind("windows", (files.long_window, files.long_window, files.long_window, files.slipped_window)),
    8: Kind("lag", (
        signals.motion_lag, signals.current_lag, signals.torque_lag, signals.force_lag, signals.slipped, signals.second_clock,
        signals.filtered, signals.motion_lag, signals.current_lag, signals.two_loggers,
    )),
    9: Kind("zero offsets", (
        signals.torque_zero, signals.current_zero, signals.voltage_zero, signals.force_zero, signals.drifting_zero,
        signals.speed_zero,
    )),
    10: Kind("changing efficiency", (signals.gain_step, signals.one_cycle, signals.drift, files.between_logs)),
    11: Kind("campaigns", (files.listed_twice, files.widened, files.unmarked), (25,)),
    12: Kind("workbook cells", (files.text_cells, files.error_cells, files.inserted_rows), (10, 25)),
}  # fmt: skip
"""Classes by their number in the table; sizes are drawn from the ranges that stand beside each way."""


class Result(NamedTuple):
    """One corruption and what became of it."""

    kind: int
    number: int
    damage: Damage
    outcome: Outcome
    fault: str = ""


def draw(kind: int, number: int, seed: int) -> Damage:
    """Make one corruption from its class, its number and the seed."""
    rng = np.random.default_rng([seed, kind, number])
    chosen = CLASSES[kind]
    log = base(list(LOGS)[rng.integers(len(LOGS))], chosen.rates[int(rng.integers(len(chosen.rates)))])
    return chosen.ways[number % len(chosen.ways)](log, rng)


def run(kinds: Sequence[int], numbers: Sequence[int], seed: int, folder: Path) -> Iterator[Result]:
    """Judge corruptions of some classes."""
    scratch(folder)
    for kind in kinds:
        for number in numbers:
            damage = draw(kind, number, seed)
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    outcome, fault = judged(damage, folder), ""
            except Exception:
                outcome, fault = Outcome(("fault",), ""), traceback.format_exc()
            yield Result(kind, number, damage, outcome, fault)


HEAD = (
    f"{'class':24}{'corruptions':>12}{'beyond':>8}{'rejected':>10}{'silent':>8}{'share':>8}"
    f"{'one log cannot show':>21}{'share of the others':>21}"
)


def table(results: Sequence[Result]) -> str:
    """Count by class."""
    lines = [HEAD]
    for kind in sorted({r.kind for r in results}):
        lines += [_line(f"{kind:2} {CLASSES[kind].title}", [r for r in results if r.kind == kind])]
    lines.append(_line("all", results))
    return "\n".join(lines)


def silent_share(results: Sequence[Result]) -> float:
    """Share of the silent corruptions among those that moved a number beyond the bar."""
    beyond = [r for r in results if r.outcome.beyond]
    return sum(r.outcome.silent for r in beyond) / max(1, len(beyond))


def _line(title: str, results: Sequence[Result]) -> str:
    beyond = [r for r in results if r.outcome.beyond]
    silent = [r for r in beyond if r.outcome.silent]
    unseen = [r for r in silent if r.outcome.reason]
    shown = len(beyond) - len(unseen)
    rejected = sum(r.outcome.reported.startswith("rejected") for r in results)
    rest = (len(silent) - len(unseen)) / max(1, shown)
    counts = f"{len(results):12}{len(beyond):8}{rejected:10}{len(silent):8}{silent_share(results):8.1%}"
    return f"{title:24}{counts}{len(unseen):21}{rest:21.1%}"


def reasons(results: Sequence[Result]) -> str:
    """Count the silent corruptions by the reason why one log cannot show them."""
    found = [(r.kind, r.outcome.reason) for r in results if r.outcome.silent]
    return f"class count  reason why one log cannot show it\n{by_reason(found)}" if found else ""


def describe(result: Result, *, seed: int, reported: bool = False) -> str:
    """Describe one corruption so that it can be repeated."""
    beyond = "; ".join(result.outcome.beyond[:4]) + (" ..." if len(result.outcome.beyond) > 4 else "")
    text = f"class {result.kind} number {result.number} seed {seed}: {result.damage.log!r}: {result.damage.what}"
    text += f"\n    moved: {beyond}"
    if result.outcome.silent:
        reason = result.outcome.reason
        text += f"\n    one log cannot show it: {': '.join(reason)}" if reason else "\n    no reason known"
    if reported:
        text += f"\n    reported: {result.outcome.reported or '-'}"
    return text + (f"\n{result.fault}" if result.fault else "")


def main() -> int:
    """Run the program."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--number", type=int, default=27, help="corruptions of each class")
    parser.add_argument("--first", type=int, default=0, help="number of the first one")
    parser.add_argument("--only", type=int, action="append", choices=list(CLASSES), metavar="CLASS")
    parser.add_argument("--list", action="store_true", help="print each silent corruption")
    parser.add_argument("--all", action="store_true", help="print every corruption")
    parser.add_argument(
        "--clean", action="store_true", help="look for findings on undamaged logs; with --list coarse ones too"
    )
    given = parser.parse_args()
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        if given.clean:
            from clean_logs import print_findings

            return print_findings(Path(folder), unreported_too=given.list)
        kinds = given.only or list(CLASSES)
        numbers = range(given.first, given.first + given.number)
        results = []
        for result in run(kinds, numbers, given.seed, Path(folder)):
            results.append(result)
            if given.all or result.fault or (given.list and result.outcome.silent):
                print(describe(result, seed=given.seed, reported=given.all), flush=True)
    print(table(results), reasons(results), sep="\n\n")
    print(f"\nseed {given.seed}, {given.number} corruptions of each class, {time.perf_counter() - begun:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
