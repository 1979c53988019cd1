"""What a command prints and writes, and what it must not replace."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TextIO

from winchcascade.core.errors import OptionError


def show(text: str, *, file: TextIO | None = None, flush: bool = False) -> None:
    """Print lines of which neither a terminal nor a runner of GitHub obeys anything: names from files may hold any text."""
    from winchcascade.core.plain_text import lines

    print(lines(text), end="", file=file, flush=flush)


def show_commands(text: str, *, file: TextIO) -> None:
    """Print lines that a runner of GitHub is to obey; what they quote is escaped already."""
    from winchcascade.core.plain_text import printable

    print(printable(text), end="", file=file)


def write_json(target: str | None, record: dict[str, Any], *, force: bool) -> bool:
    """Write a record as JSON if that is wanted; tells whether standard output holds it, and so must hold nothing else."""
    if target is None:
        return False
    import msgspec

    from winchcascade.core.files import write_content

    content = msgspec.json.format(msgspec.json.encode(record), indent=1) + b"\n"
    if target == "-":
        from winchcascade.core.plain_text import json_without_commands

        print(json_without_commands(content).decode(), end="")
        return True
    write_content(Path(target), content.decode(), force=force)
    return False


def given_command() -> str:
    """The command as it was given, to be given again."""
    import shlex

    return shlex.join(["winchcascade", *sys.argv[1:]])


def check_outputs(
    results: Mapping[str, str | Path | None], inputs: Iterable[str | Path | None], *, force: bool
) -> None:
    """Refuse, before any work, a file that a result must not replace, and two results of one name.

    Parameters
    ----------
    results : by the option that names them; what is not wanted is None
    inputs : of the command, which no result replaces, not even with `force`

    Raises
    ------
    OptionError : a result has no name of its own
    OutputError : a file is there that must not be replaced
    """
    from winchcascade.core.files import check_replaceable

    sources = [Path(source) for source in inputs if source]
    taken: dict[Path, str] = {}
    for option, wanted in results.items():
        if not wanted:
            continue
        result = Path(wanted)
        if option == "--json" and str(result) == "-":
            continue
        if str(result) in ("-", "."):
            raise OptionError(f"{option} {result}: expected the name of a file.")
        other = taken.setdefault(Path(os.path.realpath(result)), option)
        if other != option:
            raise OptionError(f"{other} and {option} both name {result}; give each a name of its own.")
        if option == "--parquet":
            continue
        for source in sources:
            if result.exists() and source.exists() and source.samefile(result):
                raise OptionError(f"{option} {result}: is an input of this command; give the result another name.")
        check_replaceable(result, force=force)
