"""Scratch files and folders: named after the process that makes them, and removed by it or else by a later call."""

from __future__ import annotations

import os
import re
import shutil
import stat
import sys
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import cache
from pathlib import Path

SUFFIX = ".part"

_NAME = re.compile(r"\.winchcascade-([0-9a-f]{8})-([0-9]{1,10})-[0-9a-z_]{8}\.part")
"""Machine, process and random letters. No other file is ever removed as scratch."""

_STALE = 86400.0
"""Scratch of another machine, whose processes cannot be seen, counts as left behind after a day. [s]"""

_live: dict[str, str] = {}
"""Scratch that this process uses now: its path by its name."""

_cleared: set[str] = set()
"""Folders from which this process has removed what killed processes left."""


def scratch_file(folder: Path) -> AbstractContextManager[Path]:
    """An empty file in a folder, removed at the end unless it was renamed; clears the folder of left scratch before."""
    return _scratch(folder, lambda path: path.touch(exist_ok=False))


def scratch_folder(folder: Path | None = None) -> AbstractContextManager[Path]:
    """A folder within another one, by default within that of the system; removed at the end unless it was renamed."""
    import tempfile

    return _scratch(folder or Path(tempfile.gettempdir()), lambda path: path.mkdir(0o700))


@contextmanager
def _scratch(folder: Path, make: Callable[[Path], object]) -> Iterator[Path]:
    clear_once(folder)
    path = folder / f".winchcascade-{_machine()}-{os.getpid()}-{os.urandom(4).hex()}{SUFFIX}"
    with removed_at_end(path):  # which notes its name before it exists, so that nobody takes it for left behind
        make(path)
        yield path


@contextmanager
def removed_at_end(path: Path) -> Iterator[None]:
    """Remove a file or folder at the end of the context, also where a signal ends the process."""
    _live[path.name] = str(path)
    try:
        yield
    finally:
        _remove(str(path))
        _live.pop(path.name, None)


def clear_once(folder: Path) -> None:
    """Remove what killed processes left in a folder, where this process has not done so before."""
    place = os.path.abspath(folder)
    if place not in _cleared:
        clear(folder)
        _cleared.add(place)


def clear(folder: Path) -> None:
    """Remove the scratch that killed processes left in a folder; that of processes at work and all other files stay."""
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            named = _NAME.fullmatch(entry.name)
            if named is not None and _is_left(entry, named[1], int(named[2])):
                _remove(entry.path)


def is_scratch(name: str) -> bool:
    """Whether a file name is that of scratch.

    >>> is_scratch(".winchcascade-00c0ffee-4711-ab12cd_3.part"), is_scratch(".backup.part")
    (True, False)
    """
    return _NAME.fullmatch(name) is not None


def clear_own() -> None:
    """Remove the scratch that this process uses now; for a process that ends by a signal."""
    for path in tuple(_live.values()):
        _remove(path)


@cache
def _machine() -> str:
    """Name of this machine and of its table of processes, which each container has for itself; as eight digits."""
    name = os.uname().nodename if hasattr(os, "uname") else os.environ.get("COMPUTERNAME", "")
    with suppress(OSError):
        name += os.readlink("/proc/self/ns/pid")
    return f"{zlib.crc32(name.encode('utf-8', 'replace')):08x}"


def _is_left(entry: os.DirEntry[str], machine: str, process: int) -> bool:
    """Whether scratch has no owner any more; a link, and what belongs to another user, is not removed."""
    try:
        about = entry.stat(follow_symlinks=False)
    except OSError:
        return False
    if stat.S_ISLNK(about.st_mode) or (hasattr(os, "geteuid") and about.st_uid != os.geteuid()):
        return False
    if machine != _machine() or time.time() - about.st_mtime > _STALE:
        return time.time() - about.st_mtime > _STALE
    if process == os.getpid():
        return entry.name not in _live  # of an earlier process of the same number
    return not _is_running(process)


if sys.platform == "win32":

    def _is_running(process: int) -> bool:
        import ctypes

        kernel, code = ctypes.windll.kernel32, ctypes.c_ulong()
        handle = kernel.OpenProcess(0x1000, False, process)  # with the right to ask for its exit code
        if not handle:
            return bool(kernel.GetLastError() == 5)  # access denied: it exists
        kernel.GetExitCodeProcess(handle, ctypes.byref(code))
        kernel.CloseHandle(handle)
        return code.value == 259  # still active
else:

    def _is_running(process: int) -> bool:
        try:
            os.kill(process, 0)
        except (ProcessLookupError, OverflowError):
            return False
        except PermissionError:  # of another user
            return True
        with suppress(OSError):  # one that has ended and whose parent has not looked answers, too
            return Path(f"/proc/{process}/stat").read_bytes().rpartition(b")")[2].split()[0] not in (b"Z", b"X")
        return True


def _remove(path: str) -> None:
    with suppress(OSError):  # another call was faster, or it was renamed
        if os.path.isdir(path) and not os.path.islink(path):
            shutil.rmtree(path)
        else:
            os.unlink(path)
