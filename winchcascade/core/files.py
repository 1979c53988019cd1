"""Output files: written whole or not at all, never over a file that this tool did not make, and
without scratch that stays.

Each kind of file has its mark at one place; nothing else counts as a mark. Scratch is removed by
the process that makes it, or in a folder of results by the next call.
"""

from __future__ import annotations

import os
import re
import shutil
import tempfile
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path

import msgspec

from winchcascade.core.errors import OptionError, OutputError

_SCRATCH = re.compile(r"\.winchcascade-[0-9a-f]{32}\.part")
"""Name of scratch. No other file is ever removed as scratch."""

_live: set[str] = set()
"""Paths that this process removes at its end."""


def scratch_file(folder: Path) -> AbstractContextManager[Path]:
    """An empty file in a folder, removed at the end unless it was renamed."""
    return _scratch(folder, partial(Path.touch, exist_ok=False))


def scratch_folder(folder: Path | None = None) -> AbstractContextManager[Path]:
    """A folder within another one, by default within that of the system; removed at the end
    unless it was renamed.
    """
    return _scratch(folder or Path(tempfile.gettempdir()), partial(Path.mkdir, mode=0o700))


@contextmanager
def _scratch(folder: Path, make: Callable[[Path], object]) -> Iterator[Path]:
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


def clear(folder: Path) -> None:
    """Remove what killed calls left in a folder that no other call uses now; all other files
    stay.
    """
    for path in [path for path in folder.rglob(".winchcascade-*.part") if is_scratch(path.name)]:
        _remove(str(path))


def is_scratch(name: str) -> bool:
    """Whether a file name is that of scratch."""
    return _SCRATCH.fullmatch(name) is not None


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


LOOK = 1 << 16
"""Bytes at either end of a file among which its mark is sought."""

_SCHEMA = rb"winchcascade/[a-z_]+/\d+"
_VERSION = rb"winchcascade/\d[\w.+-]*"

_HEADS = (
    rb"\A(?:"
    rb'\{\s*"schema":\s*"' + _SCHEMA + rb'"'
    rb'|<!doctype html>\s*<html lang="en">\s*<head>\s*<meta charset="utf-8">\s*<meta name="generator" content="' + _VERSION
    + rb'"|<\?xml version="1\.0" encoding="utf-8"\?>\s*<testsuites name="winchcascade check"[^<>]*>\s*<testsuite [^<>]*>\s*'
    rb'<properties>\s*<property name="generator" value="' + _VERSION
    + rb'"|# (?:Calibrated|Corrected|Loss map) by ' + _VERSION
    + rb" from |Time \(s\),[^\n\"'#;]*Generator speed \(rpm\),Stator current \(A rms\),Air-gap torque \(N\.m\)"
    rb"(?:,Load \(ohm\))?\r?\n"
    rb"|MATLAB 5\.0 MAT-file, written by " + _VERSION
    + rb"|Time \(s\),Cycle,Predicted (?:mechanical power|power of [A-Za-z0-9]+) \(W\)\r?\n)"
)  # fmt: skip
"""How files begin: JSON with its schema first, page, JUnit, calibrated or corrected rig file, loss
map, simulated log, exported model, predictions."""

_WORKBOOK = rb"(?s)PK\x05\x06.{16}(?P<size>..)" + _VERSION + rb"\Z"
"""How a workbook ends: the comment of its archive."""

_PDF = rb"/Author\s*\(" + _VERSION + rb"\)\s*/Creator\s*\(Typst "
"""Author and program in the properties of a PDF."""


def is_marked(path: Path) -> bool:
    """Whether a file carries this tool's mark where this tool writes it, or is empty; OSError if
    it cannot be read.
    """
    with path.open("rb") as file:
        head = file.read(LOOK)
        file.seek(max(0, file.seek(0, 2) - LOOK))
        tail = file.read(LOOK)
    if not head or re.match(_HEADS, head) is not None:
        return True
    if head.startswith(b"PK\x03\x04"):
        return re.search(_WORKBOOK, tail) is not None
    if head.startswith(b"%PDF-"):
        return re.search(_PDF, tail) is not None
    return (
        head.startswith((b"PAR1", b"{"))
        and re.fullmatch(_SCHEMA, _schema_of(path, head)) is not None
    )


class _Marked(msgspec.Struct):
    """What is needed of a JSON file."""

    schema: str


def _schema_of(path: Path, head: bytes) -> bytes:
    """Schema that a Parquet or JSON file states, empty for none and for a damaged file."""
    if head.startswith(b"{"):
        try:
            return msgspec.json.decode(path.read_bytes(), type=_Marked).schema.encode(
                "utf-8", "replace"
            )
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            return b""
    import pyarrow as pa
    from pyarrow import parquet

    try:
        return bytes((parquet.read_metadata(path).metadata or {}).get(b"schema", b""))
    except pa.ArrowException:
        return b""


def write_whole(path: Path, write: Callable[[Path], object], *, force: bool = False) -> None:
    """Write a file by a function that is given a temporary path beside it, and rename it into
    place.

    OutputError if the folder does not exist or cannot be written, or, without `force`, if a file
    that is there is not this tool's own.
    """
    path = Path(os.path.realpath(path))  # a link stays a link to what is written
    check_replaceable(path, force=force)
    try:
        with scratch_file(path.parent) as part:
            write(part)
            os.replace(part, path)
    except OSError as fault:
        raise _not_written(path, fault) from None


def write_set(contents: Mapping[Path, bytes], *, without: Iterable[Path] = ()) -> None:
    """Write several files of one folder: all are whole before the first is put in place, in their
    order. Files that are there are replaced, also links, but never what a link leads to.

    Outdated files, `without` which the set is whole, are removed. OutputError if one cannot be
    written; all are then as before.
    """
    path = None
    try:
        with ExitStack() as stack:
            parts = {}
            for path, content in contents.items():
                write = partial(Path.write_bytes, data=content)
                parts[path] = stack.enter_context(_scratch(path.parent, write))
            put_in_place({part: path for path, part in parts.items()}, without=without)
    except OSError as fault:
        raise _not_written(path, fault) from None


def put_in_place(parts: Mapping[Path, Path], *, without: Iterable[Path] = ()) -> None:
    """Rename whole files into their places, and remove outdated ones before the last, which
    states the digests of all.
    """
    *first, last = parts.items()
    for part, path in first:
        os.replace(part, path)
    for path in without:
        path.unlink(missing_ok=True)
    os.replace(*last)


def _not_written(path: object, fault: OSError) -> OutputError:
    return OutputError(
        f"{path}: cannot be written ({fault.strerror or fault}); free some space or choose another."
    )


def write_content(path: Path, content: bytes | str, *, force: bool = False) -> None:
    """Write bytes, or a text as UTF-8, into a file; whole or not at all. Raises as
    `write_whole`.
    """
    write_whole(
        path,
        lambda p: p.write_bytes(content.encode() if isinstance(content, str) else content),
        force=force,
    )


def json_bytes(record: object) -> bytes:
    """A record as the content of a JSON file, indented."""
    return msgspec.json.format(msgspec.json.encode(record), indent=1) + b"\n"


def check_ending(path: Path | None, endings: Sequence[str], option: str = "") -> None:
    """Reject, before any work, a name of a file whose ending names none of some formats:
    OptionError.
    """
    if path is not None and path.suffix.casefold() not in endings:
        raise OptionError(
            f"{f'{option} {path}'.lstrip()}: expected a name that ends in {' or '.join(endings)}."
        )


def check_replaceable(path: Path, *, force: bool) -> None:
    """Reject to replace what this tool did not write, and a folder; called before long work
    begins.
    """
    if path.is_dir():
        raise OutputError(f"{path}: is a folder; give the name of a file.")
    if path.exists() and not path.is_file():
        raise OutputError(
            f"{path}: is a device or a pipe; give the name of a file, or - for standard output."
        )
    if not path.parent.is_dir():
        raise OutputError(f"{path}: the folder {path.parent} does not exist; create it first.")
    if force or not path.exists():
        return
    try:
        if not is_marked(path):
            raise OutputError(
                f"{path}: exists and was not written by winchcascade; choose another name or add "
                f"--force."
            )
    except OSError as fault:
        raise OutputError(
            f"{path}: exists and cannot be read ({fault.strerror}); choose another name."
        ) from None
