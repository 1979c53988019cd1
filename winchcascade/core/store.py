"""Folders of results that a later call completes: one call at a time, a digest for each result,
and nothing outside of them.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

import msgspec

from winchcascade.core.errors import OutputError
from winchcascade.core.files import clear, is_scratch, removed_at_end

INDEX = "index.html"
"""Page that lists what a folder of results holds."""

CAMPAIGN_RECORD, CAMPAIGN_PAGE, CAMPAIGN_WORKBOOK = (
    "campaign.json",
    "campaign.html",
    "campaign.xlsx",
)
"""Record, report and tables of a whole campaign."""

CAMPAIGN_FILES = (CAMPAIGN_RECORD, CAMPAIGN_PAGE, "campaign.pdf", CAMPAIGN_WORKBOOK)
"""Files of a whole campaign, beside its dataset."""

LOG_FILES = ("html", "pdf", "json")
"""Endings of the files of one log; a JSON means that the others are there."""

DIAGNOSIS_RECORD = "diagnosis.json"
"""Record of the diagnosis of a campaign; it states how the other files were made, and is written
last.
"""

DIAGNOSIS_FILES = ("diagnosis.html", "diagnosis.pdf", DIAGNOSIS_RECORD)
"""Files of a diagnosis."""

LOCK = ".winchcascade.lock"
"""File that a call locks while it works in a folder."""

State = Literal["kept", "altered", "other"]
"""State of a result: an earlier call made it from the same input with the same options; it did, but
the content does not match the digest; neither."""

_SILENT = 10.0
"""A call that waits longer than this reports it. [s]"""


class Kept(msgspec.Struct, frozen=True):
    """How an earlier call made an output: by which key, and the digest of each file made with its
    record, by its name.

    The key is a digest of all that the output depends on: inputs, options and version.
    """

    key: str = ""
    files: dict[str, str] = {}


class Output(msgspec.Struct, frozen=True):
    """An output in a folder of results: a record, which is JSON, and the files that are wanted with
    it.

    The last `entry` of the record states how it was made; `key` is that of the output as it would
    be made now. The entry names files without the `prefix` that their names have in the folder.
    """

    record: str
    entry: str
    key: str
    files: tuple[str, ...] = ()
    prefix: str = ""


class Present(msgspec.Struct, frozen=True):
    """What is there of an output: whether all of it is as it would be made now, its unchanged files
    with their digests, and the names of wanted ones that were changed after an earlier call had
    made them.
    """

    kept: bool = False
    files: Mapping[str, str] = {}
    altered: tuple[str, ...] = ()


@contextmanager
def locked(folder: Path, waiting: Callable[[Path], None]) -> Iterator[None]:
    """Keep every other call out of a folder until the context ends; the lock ends with the process,
    however that ends. What killed calls left there is removed.

    `waiting` is called with the folder if this call waits for another one for some time.
    OutputError if it cannot be locked.
    """
    from filelock import FileLock, Timeout

    lock = FileLock(folder / LOCK, fallback_to_soft=False)
    try:
        try:
            lock.acquire(timeout=_SILENT)
        except Timeout:
            waiting(folder)
            lock.acquire()
    except OSError as fault:
        raise OutputError(
            f"{folder}: cannot be locked against other calls ({fault.strerror or fault}); choose "
            f"a folder that can be "
            "written and, if this one is on a network, one on a disk of this machine."
        ) from None
    try:
        with removed_at_end(
            folder / LOCK
        ):  # whoever waits for it sees that it is gone and makes a new one
            clear(folder)
            yield
    finally:
        lock.release()


def foreign(folder: Path) -> list[str]:
    """Names in a folder other than the lock and scratch files, sorted; none if there is no
    folder.
    """
    if not folder.is_dir():
        return []
    return sorted(name for name in os.listdir(folder) if name != LOCK and not is_scratch(name))


def make_folder(folder: Path, *, ours: bool, what: str, force: bool) -> None:
    """Make a folder of results; OutputError for one that holds something else, unless it is `ours`
    from an earlier call or has the lock of a call that has begun. `what` it is a folder of is for
    the message.
    """
    if not force and not ours and not (folder / LOCK).exists() and foreign(folder):
        raise not_empty(folder, what)
    make_one(folder)


def not_empty(folder: Path, what: str) -> OutputError:
    """The fault of a folder that holds something else than results."""
    return OutputError(
        f"{folder}: is not empty and no folder of {what}; give --out a new folder or add --force."
    )


def make_one(folder: Path) -> None:
    """Make a folder if it does not exist; OutputError if that is not possible."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise OutputError(
            f"{folder}: the folder cannot be made ({fault.strerror}); choose another."
        ) from None


def inside(folder: Path, name: str) -> Path:
    """Place of a file or folder within a folder of results, by its name there; OutputError if it
    or a link leads elsewhere.
    """
    path = folder / name
    real = Path(
        os.path.realpath(path)
    )  # unlike Path.resolve, it raises nothing for a link to itself
    if not name or not real.is_relative_to(os.path.realpath(folder)):
        raise OutputError(
            f"{folder}: {name!r} leads out of this folder, in which alone results are read and "
            f"written. Remove the link, or "
            "make the results again."
        )
    return path


def files_within(folder: Path) -> dict[str, Path]:
    """Files of a folder and of those in it, by their name there. Raises as `inside`."""
    names = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*"))
    return {name: path for name in names if not (path := inside(folder, name)).is_dir()}


def digest_of(content: bytes) -> str:
    """SHA-256 of some bytes, in hexadecimal."""
    return hashlib.sha256(content).hexdigest()


def fingerprint(path: str | Path) -> str:
    """SHA-256 of the content of a file; empty for one that cannot be read, and for a pipe or a
    folder.
    """
    try:
        if not Path(path).is_file():  # a pipe would keep its reader waiting
            return ""
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""


def joint_digest(digests: Sequence[str]) -> str:
    """Digest of several files together, by those of each; that of a single file is its own."""
    return digests[0] if len(digests) == 1 else digest_of(" ".join(digests).encode())


def altered(folder: Path, digests: Mapping[str, str]) -> list[str]:
    """Names of the files whose content is not that of their digest; one that is missing is among
    them.
    """
    return [name for name, digest in digests.items() if fingerprint(inside(folder, name)) != digest]


def with_digest(
    record: Mapping[str, object], entry: str, about: Mapping[str, object], *, indent: int = 0
) -> bytes:
    """A record as JSON with a last entry that ends in the digest of all before it.

    >>> digest_in(with_digest({"mean": 1.0}, "batch", {"key": "a"}))
    'kept'
    >>> digest_in(with_digest({"mean": 1.0}, "batch", {"key": "a"}).replace(b"1.0", b"1.1"))
    'altered'
    """
    content = msgspec.json.encode({**record, entry: about})
    # The digest is the last of the last entry, before the two braces that end the text.
    content = content[:-2] + f',"sha256":"{digest_of(content)}"}}}}'.encode()
    return (msgspec.json.format(content, indent=indent) if indent else content) + b"\n"


def digest_in(content: bytes) -> State:
    """Whether a record holds what was written, by the digest within its last entry; "other" for
    one without a digest.
    """
    try:
        record = msgspec.json.decode(content)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return "altered"
    about = list(record.values())[-1] if isinstance(record, dict) and record else None
    if not isinstance(about, dict) or "sha256" not in about:
        return "other"
    digest = about.pop("sha256")
    earlier = content.replace(
        str(digest).encode(), b"0" * 64
    )  # a digest of the bytes, with zeros in its place
    return (
        "kept"
        if digest in (digest_of(msgspec.json.encode(record)), digest_of(earlier))
        else "altered"
    )


def kept(record: Path, entry: str) -> Kept | Literal["altered", "other"]:
    """Read how an earlier call made a record; "other" if it does not state that, "altered" if it
    was changed since.
    """
    try:
        content = record.read_bytes()
    except OSError:
        return "other"
    state = digest_in(content)
    try:
        return (
            msgspec.convert(msgspec.json.decode(content).get(entry, {}), Kept)
            if state == "kept"
            else state
        )
    except msgspec.ValidationError:
        return "altered"


def state_of(folder: Path, output: Output) -> Present:
    """Find what an earlier call made of an output. Raises as `inside`."""
    found = kept(inside(folder, output.record), output.entry)
    if not isinstance(found, Kept) or found.key != output.key:
        return Present(altered=(output.record,) if found == "altered" else ())
    intact = {
        name: digest
        for name, digest in found.files.items()
        if not altered(folder, {output.prefix + name: digest})
    }
    lost = [
        output.prefix + name for name in output.files if name in found.files and name not in intact
    ]
    return Present(
        set(output.files) <= set(intact),
        intact,
        tuple(name for name in lost if (folder / name).exists()),
    )
