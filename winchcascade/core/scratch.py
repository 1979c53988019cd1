"""Scratch files and folders: removed by the process that makes them, or else by a later call once they are old."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import cache, partial
from pathlib import Path

_NAME = re.compile(r"\.winchcascade-[0-9a-f]{32}\.part")
"""Name of scratch. No other file is ever removed as scratch."""

_STALE = 3600.0
"""Age from which scratch counts as left behind by a killed process: nothing is written for so long. [s]"""

_live: set[str] = set()
"""Paths that this process removes at its end."""


def scratch_file(folder: Path) -> AbstractContextManager[Path]:
    """An empty file in a folder, removed at the end unless it was renamed."""
    return _scratch(folder, partial(Path.touch, exist_ok=False))


def scratch_folder(folder: Path | None = None) -> AbstractContextManager[Path]:
    """A folder within another one, by default within that of the system; removed at the end unless it was renamed."""
    return _scratch(folder or Path(tempfile.gettempdir()), partial(Path.mkdir, mode=0o700))


@contextmanager
def _scratch(folder: Path, make: Callable[[Path], object]) -> Iterator[Path]:
    clear_once(os.path.abspath(folder))
    path = folder / f".winchcascade-{uuid.uuid4().hex}.part"
    with removed_at_end(path):
        make(path)
        yield path


@contextmanager
def removed_at_end(path: Path) -> Iterator[None]:
    """Remove a file or folder at the end of the context, also where a signal ends the process."""
    _live.add(str(path))
    try:
        yield
    finally:
        _remove(str(path))
        _live.discard(str(path))


@cache
def clear_once(folder: str) -> None:
    """Remove what killed processes left in a folder, where this process has not done so before."""
    clear(Path(folder))


def clear(folder: Path) -> None:
    """Remove the old scratch in a folder; that of processes at work and all other files stay."""
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if is_scratch(entry.name) and time.time() - entry.stat(follow_symlinks=False).st_mtime > _STALE:
                _remove(entry.path)


def is_scratch(name: str) -> bool:
    """Whether a file name is that of scratch.

    >>> is_scratch(f".winchcascade-{32 * '0'}.part"), is_scratch(".backup.part")
    (True, False)
    """
    return _NAME.fullmatch(name) is not None


def clear_own() -> None:
    """Remove the scratch that this process uses now; for a process that ends by a signal."""
    for path in tuple(_live):
        _remove(path)


def _remove(path: str) -> None:
    with suppress(OSError):  # another call was faster, or it was renamed
        if os.path.isdir(path) and not os.path.islink(path):
            shutil.rmtree(path)
        else:
            os.unlink(path)
