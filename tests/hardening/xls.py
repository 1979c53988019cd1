"""A workbook of Excel 97 by its specification ([MS-XLS]): the libraries that wrote one are no
longer kept.
"""

import struct
from collections.abc import Sequence
from typing import Any

SECTOR = 4096
_FREE, _END, _TABLE = 0xFFFFFFFF, 0xFFFFFFFE, 0xFFFFFFFD
"""Entries of the table of sectors: unused, last of a chain, part of the table itself."""


def record(kind: int, body: bytes = b"") -> bytes:
    """A record: its type, its size, its body."""
    return struct.pack("<HH", kind, len(body)) + body


def _begin(kind: int) -> bytes:
    return record(0x809, struct.pack("<HHHHII", 0x600, kind, 0x1234, 1996, 0, 6))


def texts(shared: Sequence[str], claimed: int | None = None) -> bytes:
    """The shared texts, which may claim to be more than they are."""
    number = len(shared) if claimed is None else claimed
    entries = b"".join(
        struct.pack("<HB", len(text), 1) + text.encode("utf-16-le") for text in shared
    )
    return record(0xFC, struct.pack("<II", number, number) + entries)


def number(row: int, column: int, value: float) -> bytes:
    return record(0x203, struct.pack("<HHHd", row, column, 0, value))


def book(
    rows: Sequence[Sequence[Any]],
    *,
    claimed: int | None = None,
    top: bytes = b"",
    further: bytes = b"",
) -> bytes:
    """A whole file of one sheet; `top` records come after the first, `further` ones last in the
    sheet.
    """
    shared = sorted({cell for row in rows for cell in row if isinstance(cell, str)})
    cells = b"".join(
        record(0xFD, struct.pack("<HHHI", k, j, 0, shared.index(cell)))
        if isinstance(cell, str)
        else number(k, j, cell)
        for k, row in enumerate(rows)
        for j, cell in enumerate(row)
    )
    size = record(0x200, struct.pack("<IIHHH", 0, len(rows), 0, len(rows[0]), 0))
    sheet = _begin(0x10) + size + cells + further + record(0x0A)
    top, bottom = (
        _begin(5) + top + record(0x42, struct.pack("<H", 1200)),
        texts(shared, claimed) + record(0x0A),
    )
    begins = len(top) + len(record(0x85, bytes(6 + 2 + 6))) + len(bottom)
    listed = record(0x85, struct.pack("<IBBBB", begins, 0, 0, 3, 1) + "log".encode("utf-16-le"))
    return compound(top + listed + bottom + sheet)


def compound(stream: bytes) -> bytes:
    """Make a compound file whose only stream is a workbook: header, stream, directory, an empty
    sector, table of sectors.

    The empty sector is for small streams, of which there are none: the reader asks for a place of
    theirs all the same.
    """
    stream += bytes(-len(stream) % SECTOR or SECTOR * (not stream))
    used, entries = len(stream) // SECTOR, SECTOR // 4
    tables = -(-(used + 2) // (entries - 1))
    chain = [*range(1, used), _END, _END, _END, *[_TABLE] * tables]
    chain += [_FREE] * (tables * entries - len(chain))
    places = [used + 2 + k for k in range(tables)]
    header = (
        bytes.fromhex("d0cf11e0a1b11ae1")
        + bytes(16)
        + struct.pack("<HHHHH6x", 0x3E, 4, 0xFFFE, 12, 6)
    )
    header += struct.pack("<IIIIIIIII", 1, tables, used, 0, SECTOR, _END, 0, _END, 0)
    header += struct.pack("<109I", *places, *[_FREE] * (109 - tables))
    root = _entry("Root Entry", 5, child=1, begins=used + 1)
    directory = root + _entry("Workbook", 2, size=len(stream)) + _entry("", 0) * (SECTOR // 128 - 2)
    table = struct.pack(f"<{len(chain)}I", *chain)
    return b"".join([header.ljust(SECTOR, b"\0"), stream, directory, bytes(SECTOR), table])


def _entry(name: str, kind: int, *, child: int = _FREE, begins: int = 0, size: int = 0) -> bytes:
    """An entry of the directory, 128 bytes."""
    letters = name.encode("utf-16-le")
    name_size = len(letters) + 2 if name else 0
    head = letters.ljust(64, b"\0") + struct.pack(
        "<HBBIII", name_size, kind, 1, _FREE, _FREE, child
    )
    return head + bytes(36) + struct.pack("<IQ", begins, size)
