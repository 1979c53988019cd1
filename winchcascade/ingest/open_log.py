"""Choose the reader of a file by its first bytes, not by the ending of its name."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

from winchcascade.core.errors import LogError
from winchcascade.ingest.source import LogSource, reject_sheet

_ISOLATED = {
    b"TDSm": "tdms",
    b"PAR1": "parquet",
    b"\x1f\x8b": "archive",
    b"\xd0\xcf\x11\xe0": "excel",
    b"MATLAB ": "mat",
    b"\x89HDF": "mat",
}
"""By first bytes, readers that run in a process of their own, as `isolated` names them."""


def open_log(path: Path, table: str | None = None, *, numbered: bool = False) -> LogSource:
    """Open a log by its first bytes, whatever its name ends in; each reader is imported only when it is needed.

    Parameters
    ----------
    table : name or number of the sheet, variable or group to read, where the file holds several
    numbered : the rig file numbers the columns, so that a text log or a sheet needs no names
    """
    if not path.exists():
        raise LogError(f"{path}: no such file; give the path of a log.")
    if not path.is_file():
        raise LogError(f"{path}: is not a file; give the path of one log.")
    reader = reader_of(path)
    if reader != "delimited":
        from winchcascade.ingest.isolated import open_isolated

        return open_isolated(reader, path, table=table, numbered=numbered)
    reject_sheet(table, path.name)
    from winchcascade.ingest.formats.text import open_text

    return open_text(path, numbered=numbered)


def reader_of(path: Path) -> str:
    """Choose the reader of a file by its first bytes: `delimited`, or a name that `isolated` lists.

    Raises
    ------
    LogError : the file cannot be read, is empty or is certain to be no log
    """
    try:
        with path.open("rb") as file:
            head = file.read(4096)
    except OSError as fault:
        raise LogError(f"{path.name}: cannot be read ({fault.strerror}); check its permissions.") from None
    if not head:
        raise LogError(f"{path.name}: the file is empty; expected a log with column names and rows of numbers.")
    for magic, name in _NO_LOGS.items():
        if head.startswith(magic):
            raise LogError(
                f"{path.name}: is {name}, not a log; expected CSV, TDMS, MATLAB, Parquet or Excel. Unpack or export it first."
            )
    if is_zip(head):
        return "excel" if _WORKBOOK.match(head, _ZIP_NAME) else "archive"
    reader = next((name for magic, name in _ISOLATED.items() if head.startswith(magic)), None)
    return reader or ("mat" if is_mat_v4(head) else "delimited")


def is_zip(head: bytes) -> bool:
    """Whether a file begins as a zip archive does, an empty one included."""
    return head.startswith((b"PK\x03\x04", b"PK\x05\x06"))


_ZIP_NAME = 30
"""Place of the name of the first member in a zip archive."""

_WORKBOOK = re.compile(
    rb"\[Content_Types\]|_rels/|docProps/|xl/|customXml/|mimetype|META-INF/|(?:content|styles|meta|settings)\.xml"
)
"""How the names of the members of a workbook begin."""


_V4_TYPE = re.compile(r"[01]0[0-5][012]")
"""Byte order (0 little, 1 big), a zero, the precision and the kind of a variable of MATLAB v4, as one decimal number."""

_V4_HEADER, _V4_LONGEST_NAME = 20, 64
"""Bytes of the numbers before the name of such a variable, and most bytes of the name, its closing zero included."""

_V4_ORDERS: tuple[tuple[Literal["little", "big"], str], ...] = (("little", "0"), ("big", "1"))
_V4_NAME = re.compile(rb"[A-Za-z]\w*\0+")


def is_mat_v4(head: bytes) -> bool:
    """Recognise MATLAB v4, which has no magic bytes, by the header of its first variable.

    No text has a zero among its first four bytes, except in UTF-16.

    >>> import struct
    >>> is_mat_v4(struct.pack("<5i", 0, 500, 1, 0, 2) + b"v" + bytes(1))
    True
    >>> is_mat_v4(b"Time (s),Velocity (m/s),Pressure (bar)")
    False
    """
    if 0 not in head[:4] or len(head) < _V4_HEADER:
        return False
    for order, digit in _V4_ORDERS:
        kind, rows, columns, imaginary, name = (
            int.from_bytes(head[k : k + 4], order, signed=True) for k in range(0, _V4_HEADER, 4)
        )
        typed = _V4_TYPE.fullmatch(f"{kind:04d}") and f"{kind:04d}".startswith(digit)
        shaped = rows >= 0 and columns >= 0 and imaginary in (0, 1) and 2 <= name <= _V4_LONGEST_NAME
        if typed and shaped:
            return _V4_NAME.fullmatch(head[_V4_HEADER : _V4_HEADER + name]) is not None
    return False


_NO_LOGS = {
    b"BZh": "bzip2-compressed",
    b"\xfd7zXZ": "xz-compressed",
    b"\x28\xb5\x2f\xfd": "zstd-compressed",
    b"7z\xbc\xaf": "a 7z archive",
    b"Rar!": "a RAR archive",
    b"%PDF": "a PDF document",
    b"\x89PNG": "a PNG picture",
    b"\xff\xd8\xff": "a JPEG picture",
    b"\x7fELF": "a program",
    b"MZ": "a program",
    b"SQLite format 3": "an SQLite database",
}
