"""A binary workbook by its specification ([MS-XLSB]): no library writes one."""

import struct
import zipfile
from collections.abc import Iterable, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, TypeVar

PARTS = {
    "[Content_Types].xml": '<?xml version="1.0"?><Types '
    'xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
    '<Default Extension="bin" '
    'ContentType="application/vnd.ms-excel.sheet.binary.macroEnabled.main"/>'
    '<Default Extension="rels" '
    'ContentType="application/vnd.openxmlformats-package.relationships+xml"/></Types>',
    "xl/_rels/workbook.bin.rels": '<?xml version="1.0"?><Relationships '
    'xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Id="rId1" '
    'Type="http://schemas.openxmlformats.org/officeDocument/2006/relationships/worksheet" '
    'Target="worksheets/sheet1.bin"/></Relationships>',
}


def record(kind: int, body: bytes = b"") -> bytes:
    """A record: its type and its size in groups of seven bits, then its body."""
    return _seven(kind) + _seven(len(body)) + body


def _seven(value: int) -> bytes:
    groups = [value & 0x7F]
    while value := value >> 7:
        groups[-1] |= 0x80
        groups.append(value & 0x7F)
    return bytes(groups)


def _text(text: str, letters: int | None = None) -> bytes:
    return struct.pack("<I", len(text) if letters is None else letters) + text.encode("utf-16-le")


def cell(column: int, value: object) -> bytes:
    where = struct.pack("<II", column, 0)
    return (
        record(6, where + _text(value))
        if isinstance(value, str)
        else record(5, where + struct.pack("<d", value))
    )


def row(number: int, cells: Iterable[bytes]) -> bytes:
    return record(0, struct.pack("<IIHBBBI", number, 0, 300, 0, 0, 0, 0)) + b"".join(cells)


def sheet(rows: Sequence[Any], further: bytes = b"") -> bytes:
    """The part of one sheet; `further` rows come last."""
    sheet_rows = b"".join(
        row(k, (cell(j, value) for j, value in enumerate(values))) for k, values in enumerate(rows)
    )
    size = struct.pack("<IIII", 0, len(rows) - 1, 0, len(rows[0]) - 1)
    return (
        record(0x81)
        + record(0x94, size)
        + record(0x91)
        + sheet_rows
        + further
        + record(0x92)
        + record(0x82)
    )


T = TypeVar("T", Path, BytesIO)


def write(path: T, part: bytes, *, name_letters: int | None = None) -> T:
    """Write a workbook of one sheet, whose name may lie about its length."""
    listed = record(0x9C, struct.pack("<II", 0, 1) + _text("rId1", name_letters) + _text("log"))
    book = (
        record(0x83) + record(0x99, bytes(12)) + record(0x8F) + listed + record(0x90) + record(0x84)
    )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as parts:
        for name, text in PARTS.items():
            parts.writestr(name, text)
        parts.writestr("xl/workbook.bin", book)
        parts.writestr("xl/worksheets/sheet1.bin", part)
    return path
