"""Zip archives and gzip files: the one log inside is unpacked into a folder and read as what its
content shows.
"""

from __future__ import annotations

import gzip
import re
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import IO

from winchcascade.core.errors import LogError
from winchcascade.ingest.limits import require_unpacked
from winchcascade.ingest.source import LOG_ENDINGS, choose, damage_reported

GZIP = b"\x1f\x8b"
"""How a gzip file begins."""

MEMBERS_MAX = 10_000
"""Members of a zip archive; an archive of one test has a few."""

_UNPACKED_BYTES = 1 << 20
_NO_LETTER = re.compile(r"[^\w.() -]")
_ASIDE = re.compile(
    r"(?:^|/)(?:__MACOSX/|\.[^/]*$|(?:readme|liesmich|lisezmoi|leeme|leggimi|licen[cs]e|lizenz|copying)[^/]*$)",
    re.IGNORECASE,
)
"""Members beside a log: what systems add, and texts about it."""


def unpack(path: Path, table: str | None, folder: Path) -> tuple[Path, str | None]:
    """Unpack the log of a zip archive or a gzip file into a folder; no name of the archive leads
    out of it.

    Parameters
    ----------
    table : the member to read where several could be the log; else the table within the log

    Returns
    -------
    the unpacked log, and the table that is still to be chosen within it

    Raises
    ------
    LogError : the archive is damaged, encrypted, holds no log or several, or unpacks to too much
    """
    with (
        damage_reported(path, "archive", "copy it again or unpack the log"),
        _member(path, table) as (name, stream, inner),
    ):
        log = folder / (
            _NO_LETTER.sub("_", re.split(r"[/\\]", name)[-1])[-80:].strip(". ") or "log"
        )
        with log.open("xb") as file:
            while block := stream.read(_UNPACKED_BYTES):
                require_unpacked(path, file.tell() + len(block))
                file.write(block)
    return log, inner


@contextmanager
def _member(path: Path, table: str | None) -> Iterator[tuple[str, IO[bytes], str | None]]:
    """Name and content of the log, and the table that is still to be chosen within it."""
    with path.open("rb") as file:
        packed = file.read(len(GZIP)) == GZIP
    if packed:
        with gzip.open(path) as stream:
            yield path.stem, stream, table  # type: ignore[misc]
        return
    with zipfile.ZipFile(path) as archive:
        if len(archive.filelist) > MEMBERS_MAX:
            raise LogError(
                f"{path.name}: holds {len(archive.filelist)} members; expected one log; unpack "
                f"the log."
            )
        files = [
            info.filename
            for info in archive.infolist()
            if not info.is_dir() and not _ASIDE.search(info.filename)
        ]
        # Of several files those with an ending of logs.
        logs = [
            name for name in files if PurePosixPath(name).suffix.lstrip(".").lower() in LOG_ENDINGS
        ] or files
        if not logs:
            raise LogError(
                f"{path.name}: holds no file that could be a log; expected one log; add it or "
                f"unpack it."
            )
        name = choose(logs, table if len(logs) > 1 else None, path.name, "file")
        if archive.getinfo(name).flag_bits & 1:
            raise LogError(
                f"{path.name}: {name} is encrypted; expected a log without a password; unpack it."
            )
        with archive.open(name) as member:
            yield name, member, table if len(logs) == 1 else None
