"""A published table held against a rig's constants: what no plausible payout can reach, and which suspects could move it."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import msgspec

from winchcascade.reach.bench import Bench
from winchcascade.reach.explain import Explanation, explain
from winchcascade.reach.rows import Cell, NotJudged, RowReach, bounds_of_row, windows_of
from winchcascade.rig.model import baseline
from winchcascade.rigfile import Rig
from winchcascade.table import load_text
from winchcascade.tasks import Nobody, Watch

if TYPE_CHECKING:
    from winchcascade.reach.curves import Catalogue
    from winchcascade.reach.payouts import Reduce
    from winchcascade.table import Table


class Reach(msgspec.Struct, frozen=True):
    """What a rig can reach of a table, and which suspects could move it to what is printed.

    `not_judged` holds rows that cannot be held against the rig, `notes` say what was assumed. `scatter` is the largest
    deviation of a cycle's efficiency that counts [1].
    """

    rig: Rig
    scatter: float
    rows: tuple[RowReach, ...]
    not_judged: tuple[NotJudged, ...]
    notes: tuple[str, ...]
    explanation: Explanation

    @property
    def outside(self) -> tuple[tuple[RowReach, Cell], ...]:
        """The cells that the rig cannot reach."""
        return tuple((row, cell) for row in self.rows for cell in row.cells if cell.outside)

    @property
    def ok(self) -> bool:
        """Whether all that could be judged is within reach."""
        return not self.outside


def reach(
    table: Table,
    rig: Rig,
    suspects: Catalogue,
    reduce: Reduce,
    *,
    scatter: float,
    watch: Watch | None = None,
) -> Reach:
    """Hold a published table against what a rig's constants allow, and name the suspects that could make up the difference.

    Parameters
    ----------
    suspects : effects by name, as a catalogue lists them
    reduce : turns a simulated log into metrics, by the rules of any log
    scatter : largest deviation of a cycle's efficiency from the mean that the table prints or is taken to have [1]

    Raises
    ------
    RigError : the rig file lacks numbers that a model needs
    """
    model = baseline(rig)
    windows, notes = windows_of(table)
    watch = watch or Nobody()
    watch.begin(0, len(table.rows) + len(suspects))
    tell = partial(watch.done, fault=None)

    rows: list[RowReach] = []
    not_judged: list[NotJudged] = []
    for row in table.rows:
        found = bounds_of_row(table, row, windows[row.load], rig, reduce, scatter)
        if isinstance(found, NotJudged):
            not_judged.append(found)
        else:
            rows.append(found)
        tell(load_text(row.load))
    explanation = Explanation(())
    if any(cell.outside for judged in rows for cell in judged.cells):
        explanation = explain(Bench(rows, model, reduce), suspects, tell)
    return Reach(rig, scatter, tuple(rows), tuple(not_judged), notes, explanation)
