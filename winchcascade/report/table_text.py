"""What texts and records of a published table share: its title, its loads, sentences in lines."""

from __future__ import annotations

import math
import textwrap
from typing import TYPE_CHECKING, Any

from winchcascade.core.plain_text import one_line

if TYPE_CHECKING:
    from winchcascade.core.published_table import Table

_WIDTH = 100


def title_lines(table: Table) -> list[str]:
    """Name, title and source of a table."""
    return wrapped(f"{table.name}: {table.title}") + wrapped(f"source: {table.source}")


def wrapped(text: str, indent: str = "") -> list[str]:
    """A sentence in lines of 100 columns at most."""
    whole = one_line(text).replace(" %", "\N{NO-BREAK SPACE}%")  # a number and its percent sign stay on one line
    lines = textwrap.wrap(whole, _WIDTH, initial_indent=indent, subsequent_indent=f"{indent}  ", break_on_hyphens=False)
    return [line.replace("\N{NO-BREAK SPACE}", " ") for line in lines]


def indented(text: str) -> list[str]:
    """A sentence in lines two columns in."""
    return wrapped(text, indent="  ")


def table_record(table: Table) -> dict[str, Any]:
    """Which table it is, as records have it."""
    return {"name": table.name, "title": table.title, "source": table.source, "path": table.path}


def load_record(load: float) -> dict[str, Any]:
    """A load as records have it: null ohms for an open circuit."""
    return {"load_ohm": finite(load), "open_circuit": math.isinf(load)}


def finite(value: float) -> float | None:
    """None for what JSON has no number for."""
    return value if math.isfinite(value) else None
