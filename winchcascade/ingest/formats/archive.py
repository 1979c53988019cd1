"""Zip archives and gzip files: the one log inside is unpacked into a scratch folder and read as what its content shows."""

from __future__ import annotations

import gzip
import re
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import IO

from winchcascade.core.errors import LogError
from winchcascade.ingest.limits import MB, MEMORY_SETTING, limits_for
from winchcascade.ingest.open_log import is_zip, reader_of
from winchcascade.ingest.source import LOG_ENDINGS, LogSource, choose, damage_reported, reject_sheet

UNPACKED_SHARE, UNPACKED_PER_BYTE = 20, 100
"""Limit of what is unpacked: a share of the memory, or a number of bytes for each byte of the archive, whichever is larger.

The text of a measured log is compressed to a tenth to a third; deflate reaches a thousandth on zeros.
"""

_MAX_MEMBERS = 10_000
"""Members of a zip archive; an archive of one test has a few."""

_BLOCK = 1 << 20
_NO_LETTER = re.compile(r"[^\w.() -]")
_ASIDE = re.compile(
    r"(?:^|/)(?:__MACOSX/|\.[^/]*$|(?:readme|liesmich|lisezmoi|leeme|leggimi|licen[cs]e|lizenz|copying)[^/]*$)",
    re.IGNORECASE,
)
"""Members beside a log: what systems add, and texts about it."""


def open_archive(path: Path, *, table: str | None = None, numbered: bool = False, scratch: Path) -> LogSource:
    """Open the log in a zip archive or a gzip file.

    Parameters
    ----------
    table : the member to read where several could be the log; else the table within the log
    numbered : the rig file numbers the columns, so that the log needs no names
    scratch : folder into which the log is unpacked; no name of the archive leads out of it

    Raises
    ------
    LogError : the archive is damaged, encrypted, holds no log or several, or unpacks to too much; or the log is unusable
    """
    with (
        damage_reported(path, "archive", "copy it again or unpack the log", called="archive"),
        _member(path, table) as (name, stream, inner_table),
    ):
        log = scratch / name
        _unpack(stream, log, path)
    try:
        return _open(log, inner_table, numbered=numbered)
    except LogError as fault:
        raise LogError(f"{path.name}: {fault}") from None


@contextmanager
def _member(path: Path, table: str | None) -> Iterator[tuple[str, IO[bytes], str | None]]:
    """Name and content of the log, and the table that is still to be chosen within it."""
    with path.open("rb") as file:
        head = file.read(4)
    if not is_zip(head):
        with gzip.open(path) as stream:
            yield _safe(path.stem), stream, table  # type: ignore[misc]
        return
    with zipfile.ZipFile(path) as archive:
        if len(archive.filelist) > _MAX_MEMBERS:
            raise LogError(f"{path.name}: holds {len(archive.filelist)} members; expected one log; unpack the log.")
        names = [info.filename for info in archive.infolist() if not info.is_dir()]
        logs = _logs(names)
        if not logs:
            raise LogError(f"{path.name}: holds no file that could be a log; expected one log; add it or unpack it.")
        name = choose(logs, table if len(logs) > 1 else None, path.name, "file")
        if archive.getinfo(name).flag_bits & 1:
            raise LogError(f"{path.name}: {name} is encrypted; expected a log without a password; unpack it.")
        with archive.open(name) as member:
            yield _safe(name), member, table if len(logs) == 1 else None


def _logs(names: list[str]) -> list[str]:
    """Members that could be the log: of several those with an ending of logs."""
    files = [name for name in names if not _ASIDE.search(name)]
    ending = [name for name in files if PurePosixPath(name).suffix.lstrip(".").lower() in LOG_ENDINGS]
    return ending or files


def _safe(name: str) -> str:
    """Last part of a name with nothing that leads to another folder, or that a system keeps for itself."""
    last = _NO_LETTER.sub("_", re.split(r"[/\\]", name)[-1])[-80:].strip(". ")
    return last if "." in last else f"{last or 'log'}.log"


def _unpack(stream: IO[bytes], log: Path, path: Path) -> None:
    """Write the log, as long as it keeps to the limit of size."""
    size = path.stat().st_size
    limit = max(limits_for(size).memory // UNPACKED_SHARE, UNPACKED_PER_BYTE * size)
    written = 0
    with log.open("xb") as file:
        while block := stream.read(_BLOCK):
            written += len(block)
            if written > limit:
                raise LogError(
                    f"{path.name}: unpacks to more than {limit / MB:.0f} MB; less was expected of an archive of {size} bytes; "
                    f"unpack it, or allow more with the environment variable {MEMORY_SETTING}."
                )
            file.write(block)


def _open(log: Path, table: str | None, *, numbered: bool) -> LogSource:
    """Open the unpacked log by its first bytes."""
    reader = reader_of(log)
    if reader == "archive":
        raise LogError(f"{log.name}: is an archive within an archive; expected one log; unpack the inner one.")
    if reader == "delimited":
        reject_sheet(table, log.name)
        from winchcascade.ingest.formats.text import open_text

        return open_text(log, numbered=numbered)
    from winchcascade.ingest.isolated import opener_of

    return opener_of(reader, numbered=numbered)(log, table=table)
