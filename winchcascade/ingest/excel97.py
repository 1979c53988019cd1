"""Workbooks of Excel 97 (.xls): how far their sheets reach, and a sound file around their records.

The reader of workbooks makes room for what a damaged file claims, and follows chains of sectors that are damaged into circles
without end. What it is given claims no more than it holds, and has no circles.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator

from olefile import OleFileIO, isOleFile

from winchcascade.ingest.extent import Corner

SECTOR = 4096
_FREE, _END, _TABLE = 0xFFFFFFFF, 0xFFFFFFFE, 0xFFFFFFFD
"""Entries of the table of sectors: unused, last of a chain, part of the table itself."""

_PARTS = ("Workbook", "Book")
"""Streams of a workbook of Excel 97, and of Excel 95."""

_ENCIPHERED = "EncryptedPackage"
"""Stream of a workbook of any later Excel that is locked with a password."""

_RECORD, _POSITION = struct.Struct("<HH"), struct.Struct("<I")
_ENDS, _LOCKED, _SHEET, _SIZE = 0x0A, 0x2F, 0x85, 0x200
"""Types of records: EOF, FilePass, BoundSheet8, Dimensions."""

_PLACE, _LAST = struct.Struct("<HH"), struct.Struct("<H")
_SEVERAL = frozenset({0xBD, 0xBE})
"""Types of records of several cells of a row, MulRk and MulBlank, which the last column ends."""

_CELLS = _SEVERAL | {0x06, 0xD6, 0xFD, 0x201, 0x203, 0x204, 0x205, 0x206, 0x27E, 0x406}
"""Types of records that the row and the column of a cell begin: those, and from Formula to RK."""

_SIZES = {10: struct.Struct("<HHHH"), 14: struct.Struct("<IIHH")}
"""Rows and columns of a sheet, the first and one after the last of each, by the length of the record."""

_WRAPS = 1 << 32
"""A size that ends before it begins is taken for what is left of this."""


class Locked(Exception):
    """The file holds a workbook that is locked with a password."""


def is_compound(content: bytes) -> bool:
    """Whether a file begins as a compound file does."""
    return bool(isOleFile(io.BytesIO(content)))


def workbook_stream(content: bytes) -> bytes:
    """Take the stream of the workbook out of a compound file.

    Raises
    ------
    Locked : what it holds is enciphered
    OSError : it is damaged or holds no workbook
    """
    with OleFileIO(io.BytesIO(content)) as file:
        if file.exists(_ENCIPHERED):
            raise Locked
        name = next((name for name in _PARTS if file.exists(name)), _PARTS[0])
        if max(file.get_size(name), file.root.size) > len(content):
            raise OSError("a stream claims to be larger than the file")
        stream: bytes = file.openstream(name).read()
        return stream


def corners(stream: bytes) -> list[Corner]:
    """Find the last row and column of each sheet of a workbook, by its cells or the size that it claims.

    A stream is records of a type, a size and a body ([MS-XLS] 2.1.4); those at its beginning tell where the sheets begin.

    Raises
    ------
    Locked : the records are enciphered
    """
    sheets: list[int] = []
    for kind, body in _records(stream, 0):
        if kind == _LOCKED:
            raise Locked
        if kind == _SHEET and len(body) >= _POSITION.size:
            sheets += _POSITION.unpack_from(body)
    found = {at: _corner(stream, at) for at in set(sheets)}
    return [found[at] for at in sheets]


def _corner(stream: bytes, at: int) -> Corner:
    """Find the last row and column of the sheet that begins there."""
    rows = columns = 0
    for kind, body in _records(stream, at):
        if kind in _CELLS and len(body) >= _PLACE.size:
            row, column = _PLACE.unpack_from(body)
            if kind in _SEVERAL:
                column = max(column, *_LAST.unpack_from(body, len(body) - _LAST.size))
            rows, columns = max(rows, row + 1), max(columns, column + 1)
        elif kind == _SIZE and len(body) in _SIZES:
            first, row, left, column = _SIZES[len(body)].unpack_from(body)
            rows, columns = max(rows, row, (row - first) % _WRAPS), max(columns, column, (column - left) % _WRAPS)
    return Corner(rows, columns)


def _records(stream: bytes, at: int) -> Iterator[tuple[int, bytes]]:
    """Yield type and body of each record from a place on, up to the one that ends a part of the workbook."""
    while at + _RECORD.size <= len(stream):
        kind, size = _RECORD.unpack_from(stream, at)
        if kind == _ENDS:
            return
        at += _RECORD.size
        yield kind, stream[at : at + size]
        at += size


def compound(stream: bytes) -> bytes:
    """Make a compound file whose only stream is a workbook: header, stream, directory, an empty sector, table of sectors.

    The empty sector is for small streams, of which there are none: the reader asks for a place of theirs all the same.
    """
    stream += bytes(-len(stream) % SECTOR or SECTOR * (not stream))
    used, entries = len(stream) // SECTOR, SECTOR // 4
    tables = -(-(used + 2) // (entries - 1))
    chain = [*range(1, used), _END, _END, _END, *[_TABLE] * tables]
    chain += [_FREE] * (tables * entries - len(chain))
    places = [used + 2 + k for k in range(tables)]
    header = bytes.fromhex("d0cf11e0a1b11ae1") + bytes(16) + struct.pack("<HHHHH6x", 0x3E, 4, 0xFFFE, 12, 6)
    header += struct.pack("<IIIIIIIII", 1, tables, used, 0, SECTOR, _END, 0, _END, 0)
    header += struct.pack("<109I", *places, *[_FREE] * (109 - tables))
    root = _entry("Root Entry", 5, child=1, begins=used + 1)
    directory = root + _entry(_PARTS[0], 2, size=len(stream)) + _entry("", 0) * (SECTOR // 128 - 2)
    table = struct.pack(f"<{len(chain)}I", *chain)
    return b"".join([header.ljust(SECTOR, b"\0"), stream, directory, bytes(SECTOR), table])


def _entry(name: str, kind: int, *, child: int = _FREE, begins: int = 0, size: int = 0) -> bytes:
    """An entry of the directory, 128 bytes."""
    letters = name.encode("utf-16-le")
    told = len(letters) + 2 if name else 0
    head = letters.ljust(64, b"\0") + struct.pack("<HBBIII", told, kind, 1, _FREE, _FREE, child)
    return head + bytes(36) + struct.pack("<IQ", begins, size)
