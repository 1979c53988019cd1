"""Choose the reader of a file by its first bytes, not by the ending of its name."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from pkgutil import resolve_name

from msgspec.structs import replace

from winchcascade.core.errors import LogError
from winchcascade.core.files import scratch_folder
from winchcascade.ingest.source import LogSource, reject_sheet

_READERS = {
    b"TDSm": "tdms",
    b"PAR1": "parquet",
    b"\x1f\x8b": "archive",
    b"\xd0\xcf\x11\xe0": "excel",
    b"MATLAB ": "mat",
    b"\x89HDF": "netcdf",
    b"CDF\x01": "netcdf",
    b"CDF\x02": "netcdf",
}
"""Readers by first bytes: a module `formats.NAME` with a function `open_NAME`, or `read_NAME`
where it is isolated.
"""

_ISOLATED = {"excel", "mat", "netcdf"}
"""Readers that run in a process of their own."""

_SEVERAL_TABLES = {"excel", "mat", "netcdf", "tdms"}
_NAMELESS = {"excel", "text"}
"""Readers of files that may hold several tables, and of columns without names where the rig file
numbers them.
"""

_FEATHER = ("a Feather file", "by `pandas.read_feather(...).to_parquet(...)`")
_UNREADABLE = {
    b"CDF\x05": ("a NetCDF file of 64 bit data", "by `nccopy -k nc4`, which makes NetCDF 4"),
    b"MDF ": ("an MDF measurement (MF4)", "by `asammdf.MDF(...).export('csv')`"),
    b"ARROW1": _FEATHER,
    b"FEA1": _FEATHER,
    b"#ROSBAG": ("a ROS bag", "by `rostopic echo -b FILE -p TOPIC`, which prints CSV"),
    b"BZh": ("bzip2-compressed", "by unpacking it"),
    b"\xfd7zXZ": ("xz-compressed", "by unpacking it"),
    b"\x28\xb5\x2f\xfd": ("zstd-compressed", "by unpacking it"),
    b"7z\xbc\xaf": ("a 7z archive", "by unpacking it"),
    b"Rar!": ("a RAR archive", "by unpacking it"),
    b"SQLite format 3": ("an SQLite database", "as CSV"),
    b"%PDF": ("a PDF document", "as CSV"),
    b"\x89PNG": ("a PNG picture", "as CSV"),
    b"\xff\xd8\xff": ("a JPEG picture", "as CSV"),
    b"\x7fELF": ("a program", "as CSV"),
}
"""What else first bytes show, and how its log is exported."""

_ZIP_NAME = 30
"""Place of the name of the first member in a zip archive."""

_WORKBOOK = re.compile(
    rb"\[Content_Types\]|_rels/|docProps/|xl/|customXml/|mimetype|META-INF/|(?:content|styles|meta|settings)\.xml"
)
"""How the names of the members of a workbook begin."""


def open_log(path: Path, table: str | None = None, *, numbered: bool = False) -> LogSource:
    """Open a log by its first bytes, whatever its name ends in; each reader is imported only when
    it is needed.

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
    if reader == "archive":
        return _open_archive(path, table, numbered=numbered)
    if table is not None and reader not in _SEVERAL_TABLES:
        reject_sheet(table, path.name)
    options: dict[str, str | bool | None] = {"table": table} if reader in _SEVERAL_TABLES else {}
    options |= {"numbered": numbered} if reader in _NAMELESS else {}
    place = f"winchcascade.ingest.formats.{reader}"
    if reader in _ISOLATED:
        from winchcascade.ingest.isolated import read_isolated

        return read_isolated(f"{place}:read_{reader}", path, **options)
    opener: Callable[..., LogSource] = resolve_name(f"{place}:open_{reader}")
    return opener(path, **options)


def _open_archive(path: Path, table: str | None, *, numbered: bool) -> LogSource:
    """Open the log in an archive, which stays unpacked in a temporary folder until the source is
    closed.
    """
    from winchcascade.ingest.formats.archive import unpack

    with ExitStack() as opened:
        log, inner = unpack(path, table, opened.enter_context(scratch_folder()))
        try:
            if reader_of(log) == "archive":
                raise LogError(
                    f"{log.name}: is an archive within an archive; expected one log; unpack the "
                    f"inner one."
                )
            source = open_log(log, inner, numbered=numbered)
        except LogError as fault:
            raise LogError(f"{path.name}: {fault}") from None
        return replace(source, close=opened.pop_all().close)


def reader_of(path: Path) -> str:
    """Choose the reader of a file by its first bytes.

    Raises
    ------
    LogError : the file cannot be read, is empty or is certain to be no log
    """
    try:
        with path.open("rb") as file:
            head = file.read(4096)
    except OSError as fault:
        raise LogError(
            f"{path.name}: cannot be read ({fault.strerror}); check its permissions."
        ) from None
    if not head:
        raise LogError(
            f"{path.name}: the file is empty; expected a log with column names and rows of numbers."
        )
    for magic, (what, export) in _UNREADABLE.items():
        if head.startswith(magic):
            raise LogError(
                f"{path.name}: is {what}, not a log; expected CSV, TDMS, MATLAB, NetCDF, "
                f"Parquet or Excel; export the log {export}."
            )
    if head.startswith((b"PK\x03\x04", b"PK\x05\x06")):  # also an empty one
        return "excel" if _WORKBOOK.match(head, _ZIP_NAME) else "archive"
    reader = next((name for magic, name in _READERS.items() if head.startswith(magic)), None)
    return reader or ("mat" if 0 in head[:4] and is_mat_v4(head) else "text")


def is_mat_v4(head: bytes) -> bool:
    """Recognise MATLAB v4, which has no magic bytes, by the header of its first variable.

    No text has a zero among its first four bytes, except in UTF-16.

    >>> is_mat_v4(struct.pack("<5i", 0, 500, 1, 0, 2) + b"v" + bytes(1))
    True
    >>> is_mat_v4(b"Time (s),Velocity (m/s),Pressure (bar)")
    False
    """
    if len(head) < 20:
        return False
    for order, digit in ("<0", ">1"):
        kind, rows, columns, imaginary, length = struct.unpack(f"{order}5i", head[:20])
        # Byte order, a zero, the precision and the kind of the variable, as one decimal number.
        typed = re.fullmatch(rf"{digit}0[0-5][012]", f"{kind:04d}") is not None
        if typed and rows >= 0 and columns >= 0 and imaginary in (0, 1) and 2 <= length <= 64:
            return re.fullmatch(rb"[A-Za-z]\w*\0+", head[20 : 20 + length]) is not None
    return False
