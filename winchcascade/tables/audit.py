"""A published table held against itself, without any log.

Every row: is there a set of unrounded values behind the printed ones (`feasible`)? Every sum, every claim of the text.
And the windows that the table does not print.
"""

from __future__ import annotations

import msgspec

from winchcascade.core.published_table import Table
from winchcascade.tables.claims import ClaimVerdict, claim_verdict
from winchcascade.tables.ratio_of_means import Repeatability, repeatability
from winchcascade.tables.row_audit import Contradiction, row_contradictions, total_contradictions
from winchcascade.tables.window_recovery import RecoveredWindow, SharedWindow, shared_windows, windows


class Audit(msgspec.Struct, frozen=True):
    """What a table says against itself, and what it tells without printing it.

    `contradictions` are of rows, columns and sums; `claims` holds a verdict for every claim of the text.
    """

    table: Table
    known: Repeatability
    contradictions: tuple[Contradiction, ...]
    claims: tuple[ClaimVerdict, ...]
    windows: tuple[RecoveredWindow, ...]
    shared: tuple[SharedWindow, ...]

    @property
    def contradicted(self) -> tuple[ClaimVerdict, ...]:
        """The claims that the rows contradict."""
        return tuple(claim for claim in self.claims if claim.verdict == "contradicted")

    @property
    def ok(self) -> bool:
        """Whether nothing was found."""
        return not self.contradictions and not self.contradicted


def audit(table: Table) -> Audit:
    """Hold a table and its claims against themselves.

    >>> from winchcascade.core.table_toml import load_table
    >>> found = audit(load_table("hsu2026-table2"))
    >>> [(item.load, item.cells) for item in found.contradictions], len(found.contradicted)
    ([(27.0, ('energy_line', 'energy_gen', 'eta_pto'))], 2)
    """
    known = repeatability(table)
    recovered = windows(table)
    return Audit(
        table=table,
        known=known,
        contradictions=row_contradictions(table, known) + total_contradictions(table),
        claims=tuple(claim_verdict(claim, table, known) for claim in table.claims),
        windows=recovered,
        shared=shared_windows(recovered),
    )
