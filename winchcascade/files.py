"""Output files: written whole or not at all, and never over a file that this tool did not make."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from pathlib import Path

from winchcascade.errors import OutputError
from winchcascade.marks import is_marked
from winchcascade.plaintext import one_line
from winchcascade.scratch import scratch_file
from winchcascade.signals import signals_held


def write_whole(path: Path, write: Callable[[Path], None], *, force: bool = False) -> None:
    """Write a file through a temporary one beside it and rename it into place.

    Parameters
    ----------
    write : is given the temporary path and writes the whole content there
    force : replace an existing file whatever made it

    Raises
    ------
    OutputError : the folder does not exist or cannot be written, or the file is not this tool's own
    """
    path = Path(os.path.realpath(path))  # a link stays a link to what is written
    check_replaceable(path, force=force)
    try:
        with scratch_file(path.parent) as part:
            write(part)
            os.chmod(part, _usual_mode())
            os.replace(part, path)
    except OSError as fault:
        raise _not_written(path, fault) from None


def write_set(contents: Mapping[Path, bytes], *, without: Iterable[Path] = ()) -> None:
    """Write several files of one folder: all are whole before the first is put in place, in their order, and a signal that
    ends the process waits for the last. Files that are there are replaced, also links, but never what a link leads to.

    Parameters
    ----------
    without : files that the new ones make outdated; they are removed

    Raises
    ------
    OutputError : a file cannot be written; then all are as before
    """
    path = None
    try:
        with ExitStack() as stack:
            parts = {}
            for path, content in contents.items():
                parts[path] = stack.enter_context(scratch_file(path.parent))
                parts[path].write_bytes(content)
                os.chmod(parts[path], _usual_mode())
            put_in_place({part: path for path, part in parts.items()}, without=without)
    except OSError as fault:
        raise _not_written(path, fault) from None


def put_in_place(parts: Mapping[Path, Path], *, without: Iterable[Path] = ()) -> None:
    """Rename whole files into their places, the last of them once outdated ones are removed: where it is, all are as it says.

    A signal that ends the process waits for that.
    """
    *first, last = parts.items()
    with signals_held():
        for part, path in first:
            os.replace(part, path)
        for path in without:
            path.unlink(missing_ok=True)
        os.replace(*last)


def _not_written(path: object, fault: OSError) -> OutputError:
    return OutputError(f"{path}: cannot be written ({fault.strerror or fault}); free some space or choose another.")


def readable(name: str) -> str:
    """A file name as text, with a question mark for each byte of it that is none and each character that is no text."""
    return one_line(name)


def write_content(path: Path, content: bytes | str, *, force: bool = False) -> None:
    """Write bytes, or a text as UTF-8, into a file; whole or not at all. Raises as `write_whole`."""
    data = content.encode() if isinstance(content, str) else content
    write_whole(path, lambda part: _fill(part, data), force=force)


def _fill(path: Path, data: bytes) -> None:
    path.write_bytes(data)


def check_replaceable(path: Path, *, force: bool) -> None:
    """Refuse to replace what this tool did not write, and a folder; called before long work begins."""
    if path.is_dir():
        raise OutputError(f"{path}: is a folder; give the name of a file.")
    if path.exists() and not path.is_file():
        raise OutputError(f"{path}: is a device or a pipe; give the name of a file, or - for standard output.")
    if not path.parent.is_dir():
        raise OutputError(f"{path}: the folder {path.parent} does not exist; create it first.")
    if force or not path.exists():
        return
    try:
        own = is_marked(path)
    except OSError as fault:
        raise OutputError(f"{path}: exists and cannot be read ({fault.strerror}); choose another name.") from None
    if not own:
        raise OutputError(f"{path}: exists and was not written by winchcascade; choose another name or add --force.")


def _usual_mode() -> int:
    """Permissions that a plainly created file would get."""
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask
