"""Output files: written whole or not at all, and never over a file that this tool did not make."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path

from winchcascade.errors import OutputError
from winchcascade.plaintext import one_line

_MARKS = re.compile(
    rb"winchcascade/(?:[a-z]+/)?\d"
    rb"|Generator speed \(rpm\),Stator current \(A rms\),Air-gap torque \(N\.m\)"
    rb"|Time \(s\),Cycle,Predicted mechanical power \(W\)"
)
"""By what this tool knows its own files: a schema or the version that made it, heads of simulated logs and of predictions."""

_LOOK = 1 << 16

_writing = 0
"""Files that this process is writing now."""

_end_wanted = False
"""Whether this process was told to end while it wrote."""


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
    global _writing
    _writing += 1
    try:
        _write_beside(path, write, force=force)
    finally:
        _writing -= 1
        if _end_wanted and not _writing:
            raise SystemExit(1)


def _write_beside(path: Path, write: Callable[[Path], None], *, force: bool) -> None:
    import tempfile

    path = Path(os.path.realpath(path))  # a link stays a link to what is written
    check_replaceable(path, force=force)
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
    except OSError as fault:
        raise OutputError(
            f"{path}: cannot be written ({fault.strerror}); choose a folder that can be written."
        ) from None
    os.close(handle)
    part = Path(name)
    try:
        write(part)
        os.chmod(part, _usual_mode())
        os.replace(part, path)
    except OSError as fault:
        raise OutputError(
            f"{path}: cannot be written ({fault.strerror or fault}); free some space or choose another."
        ) from None
    finally:
        part.unlink(missing_ok=True)


def end_between_files() -> None:
    """End this process: at once, or by SystemExit when the file that it is writing is whole. For a handler of a signal.

    At once means past Python, which drops a SystemExit that is raised while it collects garbage.
    """
    global _end_wanted
    if _writing:
        _end_wanted = True
    else:
        os._exit(1)


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
        with path.open("rb") as file:
            head = file.read(_LOOK)
            file.seek(max(0, path.stat().st_size - _LOOK))
            head += file.read(_LOOK)
    except OSError as fault:
        raise OutputError(f"{path}: exists and cannot be read ({fault.strerror}); choose another name.") from None
    if head and _MARKS.search(head) is None:
        raise OutputError(f"{path}: exists and was not written by winchcascade; choose another name or add --force.")


def _usual_mode() -> int:
    """Permissions that a plainly created file would get."""
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask
