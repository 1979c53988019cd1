"""What texts and records of a published table share: its title and its loads."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from winchcascade.report.text_table import wrapped

if TYPE_CHECKING:
    from winchcascade.core.published_table import Table


def title_lines(table: Table) -> list[str]:
    """Name, title and source of a table."""
    return wrapped(f"{table.name}: {table.title}") + wrapped(f"source: {table.source}")


def table_record(table: Table) -> dict[str, Any]:
    """Which table it is, as records have it."""
    return {"name": table.name, "title": table.title, "source": table.source, "path": table.path}


def load_record(load: float) -> dict[str, Any]:
    """A load as records have it: null ohms for an open circuit."""
    return {"load_ohm": finite(load), "open_circuit": math.isinf(load)}


def finite(value: float) -> float | None:
    """None for what JSON has no number for."""
    return value if math.isfinite(value) else None
