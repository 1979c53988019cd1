"""An audit invents nothing, and finds what a second, unlike solver says is there."""

from __future__ import annotations

import itertools
import json
import math
from pathlib import Path

import numpy as np
import pytest
from calls import call
from made_tables import PLAIN, made_table, table_text
from msgspec.structs import replace
from numpy.typing import NDArray
from scipy.optimize import least_squares

from winchcascade import audit
from winchcascade.reduction.efficiency import METRICS, RATIOS
from winchcascade.report.results.audit_record import audit_record
from winchcascade.tables.audit import Audit
from winchcascade.tables.claims import claim_verdict
from winchcascade.tables.feasible import allowed, is_feasible, mean_of_products, repeatability
from winchcascade.tables.published_table import PublishedTable, Span, TableRow
from winchcascade.tables.row_order import exchanged_rows
from winchcascade.tables.table_file import load_table, parse_table

HSU = load_table("hsu2026-table2")
HSU_TEXT = Path(HSU.path).read_text(encoding="utf-8")
ROWS_ALONE = HSU_TEXT.partition("[[claim]]")[0]

UNITS = {
    "energy": (("J", 0, 1.0), ("kJ", 3, 1e3)), "power": (("W", 0, 1.0), ("kW", 2, 1e3)),
    "eta": (("1", 3, 1.0), ("%", 1, 0.01)),
}  # fmt: skip
"""Unit, decimals and factor that a random table may print."""


def changed(*changes: tuple[str, str], text: str = HSU_TEXT) -> Audit:
    """Audit of the table of the paper with texts replaced."""
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return audit(parse_table(text, "t"))


def random_table(rng: np.random.Generator) -> PublishedTable:
    """A table of true cycles: N of them in each row, one window a row, all means rounded as
    printed.
    """
    cycles = int(rng.integers(1, 6))
    units = {m: UNITS[m.partition("_")[0]][int(rng.integers(2))] for m in METRICS}
    rows, deviations = [], np.zeros(2)
    for load in range(1, int(rng.integers(2, 4))):
        window = rng.uniform(0.5, 20.0)
        line = rng.uniform(200.0, 9000.0) * window * (1.0 + rng.uniform(-0.15, 0.15, cycles))
        trans, gen = (
            rng.uniform(0.3, 0.97) * (1.0 + rng.uniform(-0.02, 0.02, cycles)) for _ in range(2)
        )
        values = np.array([line, line * trans, line * trans * gen])
        values = np.concatenate([values, values / window, [trans, gen, trans * gen]])
        mean = values.mean(axis=1)
        away = np.abs(values / mean[:, None] - 1.0).max(axis=1)
        deviations = np.maximum(deviations, [away[:6].max(), away[6:].max()])
        rows.append({"load_ohm": float(load), **dict(zip(METRICS, mean.tolist(), strict=True))})
    energy, eta = 100.0 * deviations
    entries = f"cycles = {cycles}\ndeviation_energy_percent = {energy:.0f}\ndeviation_eta_percent = {eta:.1f}"
    return made_table(rows, units, entries)


@pytest.mark.parametrize("tables", [60, pytest.param(3000, marks=pytest.mark.slow)])
def test_no_table_of_true_cycles_is_accused_and_its_windows_are_found(tables: int) -> None:
    rng = np.random.default_rng(2026)
    for _ in range(tables):
        found = audit(random_table(rng))
        assert found.ok, found.table
        assert all(w.span is not None for w in found.windows)


def violation(
    x: NDArray[np.float64], spans: dict[str, Span], ratio: float, product: float
) -> NDArray[np.float64]:
    """How far energies and a window are from a row, relative; efficiencies are eliminated by
    intervals, not by a programme.
    """
    energy, window = (
        dict(zip(("energy_line", "energy_mech", "energy_gen"), x[:3], strict=True)),
        x[3],
    )
    out = []
    for stage in ("line", "mech", "gen"):
        value = energy[f"energy_{stage}"]
        for number, span in (
            (value, spans[f"energy_{stage}"]),
            (value / window, spans[f"power_{stage}"]),
        ):
            out += [max(0.0, span.low / number - 1.0), max(0.0, 1.0 - span.high / number)]
    left = {}
    for eta, (after, before) in RATIOS.items():
        quotient = energy[after] / energy[before]
        low = max(spans[eta].low, quotient / (1.0 + ratio))
        high = min(spans[eta].high, quotient / (1.0 - ratio), 1.0)
        out += [max(0.0, low / high - 1.0), max(0.0, quotient - 1.0)]
        left[eta] = (low, high)
    minimum = left["eta_trans"][0] * left["eta_gen"][0] * (1.0 - product)
    maximum = left["eta_trans"][1] * left["eta_gen"][1] * (1.0 + product)
    return np.array(
        [
            *out,
            max(0.0, minimum / left["eta_pto"][1] - 1.0),
            max(0.0, left["eta_pto"][0] / maximum - 1.0),
        ]
    )


SAME, APART = 1e-9, 1e-5
"""Violation below which the search has a consistent set, and from which on it says that there is
none.
"""


def distance(table: PublishedTable, row: TableRow) -> float:
    """Smallest violation that a search over energies and the window finds, from several starts;
    0 is a consistent set.
    """
    spans, known = row.spans, repeatability(table)
    middle = {name: 0.5 * (span.low + span.high) for name, span in spans.items()}
    best = math.inf
    for stage in ("line", "mech", "gen"):
        window = middle[f"energy_{stage}"] / middle[f"power_{stage}"]
        for kind, scale in (("energy", 1.0), ("power", window)):
            start = np.array(
                [*(middle[f"{kind}_{s}"] * scale for s in ("line", "mech", "gen")), window]
            )

            def relative(
                u: NDArray[np.float64], start: NDArray[np.float64] = start
            ) -> NDArray[np.float64]:
                return violation(start * u, spans, known.ratio, known.product)

            found = least_squares(
                relative,
                np.ones(4),
                bounds=(0.2, 5.0),
                xtol=1e-12,
                ftol=1e-12,
                gtol=1e-14,
                max_nfev=40,
            )
            best = min(best, float(np.max(relative(found.x))))
            if best < SAME:
                return best
    return best


def with_another_digit(
    table: PublishedTable, rng: np.random.Generator
) -> tuple[PublishedTable, TableRow, str]:
    """A table with one digit of one cell changed, the row, and the metric."""
    k, metric = int(rng.integers(len(table.rows))), METRICS[int(rng.integers(len(METRICS)))]
    row = table.rows[k]
    cell = row.cells[metric]
    digits = cell.fixed(cell.value)
    place = int(rng.choice([i for i, c in enumerate(digits) if c.isdigit()]))
    other = str((int(digits[place]) + int(rng.integers(1, 10))) % 10)
    wrong = replace(cell, value=float(digits[:place] + other + digits[place + 1 :]))
    row = replace(row, cells={**row.cells, metric: wrong})
    return replace(table, rows=(*table.rows[:k], row, *table.rows[k + 1 :])), row, metric


@pytest.mark.parametrize("tables", [24, pytest.param(250, marks=pytest.mark.slow)])
def test_a_changed_digit_is_found_where_another_solver_finds_no_consistent_values(
    tables: int,
) -> None:
    rng = np.random.default_rng(11)
    found = there = clean = named = 0
    for _ in range(tables):
        true = random_table(rng)
        table, row, metric = with_another_digit(true, rng)
        if min(cell.value for cell in row.cells.values()) == 0.0:
            continue
        feasible, apart = is_feasible(row.spans, repeatability(table)), distance(table, row)
        if apart < SAME:
            clean += 1
            assert feasible, table  # the search holds a consistent set in its hands
        elif apart > APART:
            there += 1
            found += not feasible
        if not feasible and named < 8:  # the true number is among what mends the row
            named += 1
            original = true.rows[row.number - 1].cells[metric].value
            (repair,) = [
                r
                for item in audit(table).contradictions
                for r in item.repairs
                if r.metric == metric
            ]
            assert repair.low * (1.0 - 1e-12) <= original <= repair.high * (1.0 + 1e-12)
    assert there > 0.4 * tables
    assert clean > 0.04 * tables
    assert found >= 0.95 * there


@pytest.mark.parametrize("cycles", range(1, 8))
def test_the_bound_on_means_of_products_is_reached(cycles: int) -> None:
    bound = mean_of_products(0.18, 0.025, cycles)
    half = cycles // 2
    worst = np.array([1.0] * half + [0.0] * (cycles % 2) + [-1.0] * half)
    assert float(worst @ worst) / cycles * 0.18 * 0.025 == pytest.approx(bound)


@pytest.fixture(scope="module")
def hsu() -> Audit:
    return audit(HSU)


def test_the_27_ohm_row_contradicts_itself_and_no_other(hsu: Audit) -> None:
    (item,) = hsu.contradictions
    assert (item.row.load, item.metric, item.printed.value) == (27.0, "eta_pto", 0.707)
    assert set(item.cells) == {"energy_line", "energy_gen", "eta_pto"}
    assert item.allowed.low == pytest.approx(6118.5 / 8616.5 / 1.003145, rel=1e-6)
    assert item.missed_by == pytest.approx(item.allowed.low - 0.7075, rel=1e-6)
    assert {r.metric: (r.low, r.high) for r in item.repairs} == {
        "eta_pto": pytest.approx((0.708, 0.708)),
        "energy_line": (8621.0, 8623.0),
    }
    assert HSU_TEXT.splitlines()[(item.printed.line or 0) - 1] == "eta_pto = 0.707"


def test_the_windows_are_recovered_and_shared(hsu: Audit) -> None:
    assert [(g.loads, g.shortest) for g in hsu.shared] == [
        ((45.0, 36.0), 5.48),
        ((27.0, 18.0, 9.0, 4.5), 5.96),
    ]
    for w in hsu.windows:
        assert w.span is not None
        assert w.span.low < (5.48 if w.load >= 36 else 5.96) < w.span.high < w.span.low + 0.007


def test_two_claims_are_contradicted_and_every_law_holds_in_every_row(hsu: Audit) -> None:
    assert [c.verdict for c in hsu.claims].count("confirmed") == 12
    watts, share = hsu.contradicted
    assert "903 W is consistent with the rest of the row" in watts.sentence
    assert "69 % is eta_pto" in share.sentence
    assert {use.rows for use in hsu.uses} == {6}


SAID = '[[claim]]\nsays = "so"\nwhere = "made"\n'
"""A claim without what it states."""


@pytest.mark.parametrize(
    ("old", "new", "words", "expected"),
    [
        ("value = 982", "value = 903", "states 903 W", "confirmed"),
        ("power_gen = 903", "power_gen = 850", "neither is consistent", "contradicted"),
        ("power_gen = 903\n", "", "the row allows 902.4 to 903.2 W", "contradicted"),
        ("value = 69\n", "value = 77\n", "77 %", "confirmed"),
        ("largest_at_ohm = 18.0\n", "largest_at_ohm = 27.0\n", "at 27 ohm; the table prints "
                                                               "eta_pto", "contradicted"),
        ("largest_at_ohm = [27.0, 18.0]", "largest_at_ohm = [9.0, 18.0]", "eta_pto 0.707 at 27 ohm", "contradicted"),
        ("largest_at_ohm = [27.0, 18.0]", "largest_at_ohm = 17.0", "largest at 17 ohm", "not_checkable"),
        ("to_ohm = 4.5\n", "to_ohm = 4.0\n", "to 4 ohm", "not_checkable"),
        ('"eta_gen"\nrises_from_ohm = 4.5\nto_ohm = 18.0', '"eta_gen"\nrises_from_ohm = '
                                                           '18.0\nto_ohm = 4.5',
         "rising from 18 ohm to 4.5 ohm", "contradicted"),
        ("at_least = 1\n", "at_least = 2\n", "at least 2 kW", "contradicted"),
        ("at_most = 18\n", "at_most = 15\n", "at most 15 %", "contradicted"),
        ("load_ohm = 36.0\nvalue = 982", "load_ohm = 35.0\nvalue = 982", "no row of this load", "not_checkable"),
        ("[[claim]]", f'{SAID}metric = "power_line"\nload_ohm = 36.0\nvalue = 1.3\nunit = '
                      f'"kW"\ndecimals = 1\n[[claim]]',
         "states 1.3 kW", "confirmed"),
        ("[[claim]]", f'{SAID}metric = "energy_line"\nload_ohm = 36.0\nvalue = 7125\nunit = '
                      f'"J"\n[[claim]]',
         "both are consistent with the rest", "contradicted"),
        ("[[claim]]", f'{SAID}part = "energy_gen"\nof = "energy_line"\nload_ohm = 27.0\nunit = '
                      f'"%"\nvalue = 71\n[[claim]]',
         "states 71 % at 27", "confirmed"),
        ("[[claim]]", f'{SAID}part = "energy_gen"\nof = "energy_line"\nload_ohm = 36.0\nunit = '
                      f'"%"\ndecimals = 1\n'
         "value = 69.5\n[[claim]]", "the row allows 69.4", "confirmed"),
        ("eta_pto = 0.730", "eta_pto = 0.707", "eta_pto: the text states largest at 18 ohm; "
                                               "eta_pto 0.707 at 27",
         "not_checkable"),
    ],
)  # fmt: skip
def test_a_changed_claim_or_cell_changes_the_verdict(
    old: str, new: str, words: str, expected: str
) -> None:
    head, _, tail = HSU_TEXT.partition(old)
    assert tail
    tail = tail if old == "[[claim]]" else tail.replace(old, new)
    table = parse_table(head + new + tail, "t")
    verdicts = (claim_verdict(one, table, repeatability(table)) for one in table.claims)
    (verdict,) = (one for one in verdicts if words in one.sentence)
    assert verdict.verdict == expected


@pytest.mark.parametrize(
    ("lost", "old", "new", "cells"),
    [
        ((), "energy_mech = 5222", "energy_mech = 6222", {"energy_line", "energy_mech"}),
        ((), "eta_trans = 0.879", "eta_trans = 1.079", {"eta_trans"}),
        (
            ("eta",),
            "power_mech = 953",
            "power_mech = 963",
            {"energy_gen", "energy_mech", "power_gen", "power_mech"},
        ),
        (("energy", "power"), "eta_pto = 0.600", "eta_pto = 0.604", set(RATIOS)),
    ],
)
def test_cells_that_break_one_law_are_a_smallest_set(
    lost: tuple[str, ...], old: str, new: str, cells: set[str]
) -> None:
    rows = "\n".join(
        line for line in ROWS_ALONE.splitlines() if not lost or not line.startswith(lost)
    )
    item = changed((old, new), text=rows).contradictions[0]
    assert len(item.cells) == len(cells)
    assert cells - {"energy_mech", "energy_gen", "power_gen"} <= set(item.cells)


def test_a_column_in_the_wrong_unit_is_one_finding_and_hides_no_other(tmp_path: Path) -> None:
    (tmp_path / "t.toml").write_text(
        HSU_TEXT.replace('energy_gen = { unit = "J"', 'energy_gen = { unit = "kJ"')
    )
    found = audit(tmp_path / "t.toml")
    (fault,) = found.faults
    assert (fault.kind, fault.columns, fault.unit) == ("unit", ("energy_gen",), "")
    assert fault.factor == pytest.approx(1e-3)
    assert [(item.row.load, item.metric) for item in found.contradictions] == [(27.0, "eta_pto")]
    assert [item["kind"] for item in audit_record(found)["contradictions"]] == ["column", "row"]


def test_a_table_that_does_not_print_its_repeatability_is_held_to_an_assumed_one() -> None:
    found = changed(("cycles = 3", ""), ("deviation_eta_percent = 2.5", ""))
    assert found.known.assumed == ("deviation_eta_percent", "cycles")
    assert found.known.ratio == pytest.approx(0.185 * 0.03)
    assert not found.contradictions


def test_cells_of_zero_are_no_contradiction_and_nothing_confines_a_value_without_cells() -> None:
    cells = {
        "load_ohm": math.inf,
        "energy_line": 800.0,
        "energy_gen": 0.0,
        "power_line": 100.0,
        "power_gen": 0.0,
    }
    found = audit(made_table([cells]))
    assert found.ok
    assert found.windows[0].span is not None
    assert allowed({}, repeatability(HSU), "power_line") == Span(0.0, math.inf)


@pytest.mark.parametrize(
    ("cells", "ok", "laws"),
    [
        ({"energy_gen": 4956.0}, False, set()),
        ({"energy_line": 7115.0, "power_gen": 904.0}, False, set()),
        ({"energy_line": 7115.0, "energy_gen": 4956.0, "eta_pto": 0.697}, True,
         {"eta_pto = energy_gen / energy_line", "no stage delivers more than its input"}),
    ],
)  # fmt: skip
def test_a_table_of_which_nothing_was_evaluated_is_not_consistent(
    tmp_path: Path, cells: dict[str, float], ok: bool, laws: set[str]
) -> None:
    (tmp_path / "t.toml").write_text(table_text([{"load_ohm": 36.0, **cells}], PLAIN))
    called = call("audit", tmp_path / "t.toml", "--json", "-")
    record = json.loads(called.out)
    assert (called.code, record["ok"], record["evaluated"]) == (0 if ok else 1, ok, ok)
    assert {use["law"] for use in record["laws"] if use["rows_evaluated"]} == laws


def test_two_rows_that_are_exchanged_are_found_and_no_table_with_scatter_is_accused() -> None:
    table = load_table("hsu2026-table2")
    known = repeatability(table)
    assert exchanged_rows(table, known) is None
    for one, other in itertools.combinations(range(len(table.rows)), 2):
        rows = list(table.rows)
        rows[one], rows[other] = (
            replace(here, cells={**there.cells, "load_ohm": here.cells["load_ohm"]})
            for here, there in ((rows[one], rows[other]), (rows[other], rows[one]))
        )
        fault = exchanged_rows(exchanged := replace(table, rows=tuple(rows)), known)
        assert fault is not None
        assert set(fault.columns) == {rows[one].name, rows[other].name}
    assert fault in audit(exchanged).faults
    rng = np.random.default_rng(1)
    for _ in range(50):
        rows = [
            replace(
                row,
                cells={
                    m: replace(c, value=c.value * (1.0 + rng.normal(0.0, 0.007)))
                    for m, c in row.cells.items()
                },
            )
            for row in table.rows
        ]
        assert exchanged_rows(replace(table, rows=tuple(rows)), known) is None
