"""Which reader a file needs, by what its first bytes say, whatever its name ends in."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from winchcascade.errors import LogError

if TYPE_CHECKING:
    from winchcascade.ingest.source import Source


def open_log(path: Path) -> Source:
    """Open a log by what its first bytes say, whatever its name ends in."""
    if not path.exists():
        raise LogError(f"{path}: no such file; give the path of a log.")
    if not path.is_file():
        raise LogError(f"{path}: is not a file; give the path of one log.")
    try:
        with path.open("rb") as file:
            head = file.read(4096)
    except OSError as fault:
        raise LogError(f"{path.name}: cannot be read ({fault.strerror}); check its permissions.") from None
    if not head:
        raise LogError(f"{path.name}: the file is empty; expected a log with column names and rows of numbers.")
    return _reader(head, path.name)(path)


def _reader(head: bytes, where: str) -> Callable[[Path], Source]:
    """Choose the reader; each is imported only when it is needed."""
    if head.startswith(b"TDSm"):
        from winchcascade.ingest.tdms import open_tdms

        return open_tdms
    if head.startswith(b"PAR1"):
        from winchcascade.ingest.parquet import open_parquet

        return open_parquet
    if head.startswith((b"PK\x03\x04", b"\xd0\xcf\x11\xe0")):
        from winchcascade.ingest.excel import open_excel

        return open_excel
    if head.startswith((b"MATLAB ", b"\x89HDF")) or _is_mat_v4(head):
        from winchcascade.ingest.mat import open_mat

        return open_mat
    for magic, name in _NO_LOGS.items():
        if head.startswith(magic):
            raise LogError(
                f"{where}: is {name}, not a log; expected CSV, TDMS, MATLAB, Parquet or Excel. Unpack or export it first."
            )
    from winchcascade.ingest.delimited import open_delimited

    return open_delimited


def _is_mat_v4(head: bytes) -> bool:
    """Tell MATLAB v4, which has no magic bytes; no text has a zero among its first four bytes, but for UTF-16."""
    if 0 not in head[:4]:
        return False
    from winchcascade.ingest.mat_tags import is_v4

    return is_v4(head)


_NO_LOGS = {
    b"\x1f\x8b": "gzip-compressed",
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
