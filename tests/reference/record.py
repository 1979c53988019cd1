"""Record what every command prints and writes, so that each change of an output is seen in a diff.

python tests/reference/record.py [--only GROUP ...] [--check]

Without options it writes the present outputs of all groups into tests/reference/outputs, and prints
what has changed. Data within their accuracy of the stored ones stay as they are stored. `--check`
prints the same and writes nothing.
"""

import argparse
import json
import os
import shlex
import sys
import tarfile
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent.parent), str(HERE), str(HERE.parent)]

os.environ["OPENBLAS_NUM_THREADS"] = (
    "1"  # as in the processes of users: commands set it before they import numpy
)

from commands import GROUPS, STORED, Group  # noqa: E402
from stored import data_differences, layout, text_differences  # noqa: E402
from workplace import KEPT, Workplace, workplace  # noqa: E402

OUTPUTS = HERE / "outputs"


def present(group: Group) -> dict[str, Any] | None:
    """Make the outputs of a group, texts and data by name; None if it needs data that are not
    there.
    """
    with workplace() as place:
        if group.shared and not place.shared:
            return None
        found: dict[str, Any] = {"codes.txt": ""}
        for line in filter(None, group.lines.splitlines()):
            for name, content in _outputs(place, line):
                if content is not None:
                    found[name] = (
                        found.get(name, "") + content if isinstance(content, str) else content
                    )
        return found


def _outputs(place: Workplace, line: str) -> Iterator[tuple[str, Any]]:
    """Follow a line of a group: names and contents of what is stored."""
    command, _, printed = line.partition(" > ")
    words = shlex.split(command)
    if words[0] == "show":
        yield from (_named(place, file) for file in words[1:])
        return
    if words[0] == "list":
        files = sorted(str(path) for path in Path(words[1]).rglob("*") if path.is_file())
        yield f"{words[1]}-files.txt", "".join(f"{file}\n" for file in files)
        return
    code, text = place.run(*words)
    yield "codes.txt", f"{code} {command}\n"
    if printed:
        yield f"{printed}.txt", f"$ winchcascade {command}\n{text}"
    yield from (_named(place, file) for option, file in pairwise(words) if option in STORED)


def _named(place: Workplace, file: str) -> tuple[str, Any]:
    """Name of a stored output, and the content of its file."""
    content, name = place.content(Path(file)), file.replace("/", "-")
    return (
        f"{name}{'.txt' if isinstance(content, str) else '' if name.endswith('.json') else '.json'}",
        content,
    )


def differences(name: str, *, write: bool) -> list[str]:
    """Compare the present outputs of a group with the stored ones, and store them if wanted;
    what differs.
    """
    group, folder = GROUPS[name], OUTPUTS / name
    now = present(group)
    if now is None:
        return []
    before = {path.name: path.read_text(encoding="utf-8") for path in folder.glob("*")}
    found: list[str] = []
    for file in sorted({*now, *before}):
        if file not in now:
            changes = ["is not made any more"]
        elif file not in before:
            changes = ["is new"]
        elif file.endswith(".json"):
            # What is read again from its text is what was stored: a tuple is a list, a key is a
            # text.
            changes = list(
                data_differences(
                    json.loads(before[file]), json.loads(layout(now[file])), group.accuracy
                )
            )
        else:
            changes = list(text_differences(before[file], now[file]))
        if changes:
            found += [f"=== {name}/{file}", *changes]
            if write:
                _store(folder / file, now.get(file))
    return found


def _store(path: Path, content: Any) -> None:
    """Write an output, or delete it if it is not made any more."""
    if content is None:
        path.unlink()
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(
        content if isinstance(content, str) else f"{layout(content)}\n", encoding="utf-8"
    )


def keep_version() -> None:
    """Store a result folder and a trial of the present version, to be opened again by later
    ones.
    """
    from winchcascade import __version__

    folder = KEPT / __version__
    folder.mkdir(parents=True, exist_ok=True)
    with workplace() as place:
        for line in (
            "batch short --out results --jobs 1 --reports none --excel",
            "blind deal --cases 1 --seed 3 --out trial --jobs 1",
            "blind diagnose trial --jobs 1",
        ):
            print(place.run(*line.split()))
        for name in ("results", "trial"):
            with tarfile.open(folder / f"{name}.tar.xz", "w:xz", preset=9) as file:
                file.add(place.folder / name, name)


def main() -> int:
    """Record or compare the groups that are named; the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument(
        "--only", nargs="+", choices=list(GROUPS), metavar="GROUP", help=f"Of {', '.join(GROUPS)}."
    )
    parser.add_argument("--check", action="store_true", help="Compare, and write nothing.")
    parser.add_argument(
        "--keep-version",
        action="store_true",
        help="Store results and a trial of the present version.",
    )
    options = parser.parse_args()
    if options.keep_version:
        keep_version()
        return 0
    found: list[str] = []
    for group in options.only or GROUPS:
        began = time.monotonic()
        found += differences(group, write=not options.check)
        print(f"{group}: {time.monotonic() - began:.0f} s", file=sys.stderr)
    if found:
        print("\n".join(found))
        if options.check:
            again = " ".join(options.only or GROUPS)
            print(
                f"\nIf every difference is meant: python tests/reference/record.py --only {again}"
            )
    return 1 if found and options.check else 0


if __name__ == "__main__":
    sys.exit(main())
