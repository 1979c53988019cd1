"""Addresses of logs: a path, or a place in an object store that pyarrow or fsspec can open."""

from __future__ import annotations

import hashlib
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from winchcascade.core.errors import LogError, first_line
from winchcascade.core.scratch import scratch_folder

_REMOTE = re.compile(r"^[A-Za-z][A-Za-z0-9+.-]+://")


def is_remote(target: str) -> bool:
    """Whether a target is an address such as s3://bucket/log.csv and not a path.

    >>> is_remote("s3://bucket/log.csv"), is_remote("C:\\\\logs\\\\log.csv")
    (True, False)
    """
    return _REMOTE.match(target) is not None


def is_local(address: str) -> bool:
    """Whether an address is of this machine's own files."""
    return not is_remote(local_path(address))


@contextmanager
def local_copy(address: str) -> Iterator[Path]:
    """A log as a file of this machine: itself, or a copy for as long as the context lasts.

    Raises
    ------
    LogError : the address cannot be opened
    """
    if is_local(address):
        yield Path(local_path(address))
        return
    with scratch_folder() as folder:
        path = folder / address.rstrip("/").rsplit("/", 1)[-1]
        with _opened(address) as source, path.open("wb") as copy:
            shutil.copyfileobj(source, copy, 1 << 20)
        yield path


def fingerprint(address: str) -> str:
    """SHA-256 of the content of a log; empty for one that this machine cannot open, and for a pipe or a folder."""
    try:
        if not is_local(address):
            with _opened(address) as source:
                return hashlib.file_digest(source, "sha256").hexdigest()
        if Path(local_path(address)).is_file():  # a pipe would keep its reader waiting
            with open(local_path(address), "rb") as file:
                return hashlib.file_digest(file, "sha256").hexdigest()
        return ""
    except (OSError, LogError):
        return ""


def expand(address: str) -> list[str]:
    """Files that a remote address names: a pattern or a folder becomes its files, in order of their names."""
    try:
        import fsspec

        system, path = fsspec.core.url_to_fs(local_path(address))
        if any(c in path for c in "*?["):
            found = system.glob(path)
        elif system.isdir(path):
            found = [entry for entry in system.ls(path, detail=False) if system.isfile(entry)]
        else:
            found = [path]
    except (ImportError, OSError, ValueError) as fault:
        raise _not_opened(address, fault) from None
    return sorted(found if is_local(address) else (system.unstrip_protocol(entry) for entry in found))


@contextmanager
def _opened(address: str) -> Iterator[Any]:
    """A remote file to read from: by pyarrow if it supports the protocol, else by fsspec."""
    import pyarrow as pa
    from pyarrow import fs

    try:
        try:
            system, path = fs.FileSystem.from_uri(address)
            source: Any = system.open_input_stream(path)
        except (pa.ArrowInvalid, pa.ArrowNotImplementedError):
            import fsspec

            source = fsspec.open(address, "rb").open()
    except (ImportError, OSError, ValueError) as fault:
        raise _not_opened(address, fault) from None
    with source:
        yield source


def local_path(target: str) -> str:
    """A target as a path where it is an address of this machine, such as file:///data/log.csv; else as it is.

    >>> local_path("file:///data/a%20log.csv"), local_path("data/a%20log.csv")
    ('/data/a log.csv', 'data/a%20log.csv')
    """
    if not target.startswith("file://"):
        return target
    from urllib.parse import urlsplit
    from urllib.request import url2pathname

    return url2pathname(urlsplit(target).path)


def _not_opened(address: str, fault: Exception) -> LogError:
    if isinstance(fault, ImportError):
        return LogError(
            f'{address}: needs a package for such addresses ({fault}); pip install "winchcascade[cluster]".'
        )
    return LogError(
        f"{address}: cannot be opened ({first_line(fault)}); check the address and the rights of the machine that reads it."
    )
