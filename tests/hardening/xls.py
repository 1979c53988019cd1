"""A workbook of Excel 97 by its specification ([MS-XLS]): the libraries that wrote one are no longer kept."""

import struct
from collections.abc import Sequence
from typing import Any

from winchcascade.ingest.excel97 import compound


def record(kind: int, body: bytes = b"") -> bytes:
    """A record: its type, its size, its body."""
    return struct.pack("<HH", kind, len(body)) + body


def _begin(kind: int) -> bytes:
    return record(0x809, struct.pack("<HHHHII", 0x600, kind, 0x1234, 1996, 0, 6))


def texts(shared: Sequence[str], claimed: int | None = None) -> bytes:
    """The shared texts, which may claim to be more than they are."""
    number = len(shared) if claimed is None else claimed
    told = b"".join(struct.pack("<HB", len(text), 1) + text.encode("utf-16-le") for text in shared)
    return record(0xFC, struct.pack("<II", number, number) + told)


def number(row: int, column: int, value: float) -> bytes:
    return record(0x203, struct.pack("<HHHd", row, column, 0, value))


def book(rows: Sequence[Sequence[Any]], *, claimed: int | None = None, top: bytes = b"", further: bytes = b"") -> bytes:
    """A whole file of one sheet; `top` records come after the first, `further` ones last in the sheet."""
    shared = sorted({cell for row in rows for cell in row if isinstance(cell, str)})
    cells = b"".join(
        record(0xFD, struct.pack("<HHHI", k, j, 0, shared.index(cell))) if isinstance(cell, str) else number(k, j, cell)
        for k, row in enumerate(rows)
        for j, cell in enumerate(row)
    )
    size = record(0x200, struct.pack("<IIHHH", 0, len(rows), 0, len(rows[0]), 0))
    sheet = _begin(0x10) + size + cells + further + record(0x0A)
    top, bottom = _begin(5) + top + record(0x42, struct.pack("<H", 1200)), texts(shared, claimed) + record(0x0A)
    begins = len(top) + len(record(0x85, bytes(6 + 2 + 6))) + len(bottom)
    listed = record(0x85, struct.pack("<IBBBB", begins, 0, 0, 3, 1) + "log".encode("utf-16-le"))
    return compound(top + listed + bottom + sheet)
