"""Print and write the results of a command, and protect its inputs and the files of others."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import msgspec

from winchcascade.core.errors import OptionError
from winchcascade.core.files import check_replaceable, write_content
from winchcascade.core.plain_text import json_without_commands, lines, printable
from winchcascade.core.store import make_one
from winchcascade.report.screen import QUIET, painted
from winchcascade.report.text_table import file_lines

if TYPE_CHECKING:
    from winchcascade.report.content import Report as Stated
    from winchcascade.report.report_files import ReportFiles
    from winchcascade.report.sheet import Report

Results = Mapping[str, str | Path | None]
"""Files and folders that a command writes, by the option that names each."""


def show(text: str, *, failures: str = "", file: TextIO | None = None, flush: bool = False) -> None:
    """Print lines without control characters and commands to a runner of GitHub: names from files may hold any text.

    Parameters
    ----------
    failures : what is printed instead with --quiet
    """
    print(painted(failures if QUIET.get() else text, lines), end="", file=file, flush=flush)


def show_commands(text: str, *, file: TextIO) -> None:
    """Print commands to a runner of GitHub; what they quote is escaped already."""
    print(printable(text), end="", file=file)


class Printed(msgspec.Struct, frozen=True):
    """What a command prints: a text, or with --quiet the `failures` alone.

    Files that are wanted are listed below the text, or above its last line where that is a `verdict`; `files` holds them by the
    option that names each.
    """

    text: Callable[[], str]
    files: Results = {}
    failures: Callable[[], str] = str
    verdict: bool = False


def deliver(json: str | None, content: Callable[[], bytes], printed: Printed, *, force: bool) -> None:
    """Write the content of a JSON file if that is wanted, and print the text unless standard output holds the JSON."""
    if json == "-":
        sys.stdout.buffer.write(json_without_commands(content()))
        return
    if json is not None:
        write_content(Path(json), content(), force=force)
    if QUIET.get():
        show("", failures=printed.failures())
    else:
        shown, files = printed.text(), written(printed.files)
        end = shown.rstrip("\n").rfind("\n") + 1 if printed.verdict else len(shown)
        show(shown[:end] + files + shown[end:])


def write_reports(
    make: Callable[[], Report | Stated],
    files: ReportFiles,
    name: str,
    *,
    of: str = "",  # noqa: ARG001
    force: bool,
) -> None:
    """Write a report as page and PDF, and its figures and tables, as far as they are wanted.

    Parameters
    ----------
    make : makes the report, with what it must import for that
    name, of : as of `write_report_files`
    """
    if files.wanted:
        from winchcascade.report.render.folders import write_report_files

        write_report_files(make, files, name, force=force)


def report_maker_of(result: object) -> Callable[[], Report | Stated]:
    """What makes the report of a result of a command, with the command."""
    from winchcascade.report.views import report_of

    return partial(report_of, result, command=given_command())


def written(results: Results) -> str:
    """The lines that list what was written; none for nothing."""
    return file_lines("files:", [result for result in results.values() if result])


def given_command() -> str:
    """The command as it was given, to be given again."""
    import shlex

    return shlex.join(["winchcascade", *sys.argv[1:]])


_TOGETHER = {"--figures", "--tables"}
"""Folders that may be one and the same, and may hold other files: each file is checked as it is written."""


def check_outputs(results: Results, inputs: Iterable[str | Path | None], *, force: bool) -> None:
    """Reject, before any work, a file that a result must not replace, and two results of one name.

    Parameters
    ----------
    results : by the option that names them; what is not wanted is None
    inputs : of the command, which no result replaces, not even with `force`

    Raises
    ------
    OptionError : a result has no name of its own
    OutputError : a file is there that must not be replaced
    """
    sources = [Path(source) for source in inputs if source]
    taken: dict[Path, str] = {}
    for option, wanted in results.items():
        if not wanted or (option == "--json" and str(wanted) == "-"):
            continue
        result = Path(wanted)
        if str(result) in ("-", "."):
            raise OptionError(f"{option} {result}: expected the name of a file.")
        other = taken.setdefault(Path(os.path.realpath(result)), option)
        if other != option and not {option, other} <= _TOGETHER:
            raise OptionError(f"{other} and {option} both name {result}; give each a name of its own.")
        if option in _TOGETHER:
            make_one(result, "another")
        elif option != "--parquet":
            if result.exists() and any(source.exists() and source.samefile(result) for source in sources):
                raise OptionError(f"{option} {result}: is an input of this command; give the result another name.")
            check_replaceable(result, force=force)
