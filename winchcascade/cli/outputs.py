"""Files that a command writes, and the one function that presents its result: terminal text,
JSON, report, list of files.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import msgspec

from winchcascade.cli.progress import status_line
from winchcascade.core.errors import OptionError
from winchcascade.core.files import check_replaceable, json_bytes, write_content
from winchcascade.core.plain_text import json_without_commands, lines, printable
from winchcascade.core.store import make_one
from winchcascade.report.render.terminal import QUIET, painted

if TYPE_CHECKING:
    from winchcascade.report.content import Report

REPORT = ("html", "pdf", "figures", "tables")
"""Options of the files of a report."""

STDOUT = Path("-")
"""Standard output, as the file of `--json`."""

_FOLDERS = {"parquet", "predictions"}
"""Options that name a folder whose files are checked one by one."""

_TOGETHER = {"figures", "tables"}
"""Folders that may be one and the same, and may hold other files: each file is checked as it is
written.
"""


class Outputs(msgspec.Struct, frozen=True):
    """Files and folders that a command writes, by the names of their options; only those that
    are wanted.
    """

    paths: dict[str, Path] = {}
    force: bool = False

    def __getitem__(self, name: str) -> Path | None:
        """The file that an option names, None where it is not wanted."""
        return self.paths.get(name)

    @property
    def files(self) -> list[Path]:
        """What is listed as written, each once."""
        return list(dict.fromkeys(path for path in self.paths.values() if path != STDOUT))

    def without(self, *names: str) -> Outputs:
        """These files but those of some options."""
        kept = {name: path for name, path in self.paths.items() if name not in names}
        return Outputs(kept, self.force)

    def check(self, inputs: Iterable[str | Path | None], more: Mapping[str, Path] = {}) -> None:
        """Reject, before any work, a file that a result must not replace, and two results of one
        name.

        Parameters
        ----------
        inputs : of the command, which no result replaces, not even with `force`
        more : further files of the command, by the options that name them

        Raises
        ------
        OptionError : a result has no name of its own
        OutputError : a file is there that must not be replaced
        """
        sources = [Path(source) for source in inputs if source and Path(source).exists()]
        taken: dict[Path, str] = {}
        for name, path in (self.paths | dict(more)).items():
            option = f"--{name.replace('_', '-')}"
            if name == "json" and path == STDOUT:
                continue
            if str(path) in ("-", "."):
                raise OptionError(f"{option} {path}: expected the name of a file.")
            other = taken.setdefault(Path(os.path.realpath(path)), name)
            if other != name and not {name, other} <= _TOGETHER:
                raise OptionError(
                    f"--{other} and {option} both name {path}; give each a name of its own."
                )
            if name in _TOGETHER:
                make_one(path)
            elif name not in _FOLDERS:
                if path.exists() and any(source.samefile(path) for source in sources):
                    raise OptionError(
                        f"{option} {path}: is an input of this command; give the result another "
                        f"name."
                    )
                check_replaceable(path, force=self.force)


NO_OUTPUTS = Outputs()
"""The value of a command's parameter `outputs` where no file is wanted."""


def present(
    make: Callable[[], Report],
    outputs: Outputs,
    *,
    record: Callable[[], object] = dict,
    texts: Mapping[str, Callable[[], str]] = {},
    name: str = "report",
    failed: Callable[[], Report] | None = None,
    notes: Iterable[str | Path] = (),
) -> None:
    """Write the report, the JSON and other texts of a result as far as they are wanted, print its
    text, and list the files.

    With JSON on standard output nothing else is printed; with --quiet only what failed.

    Parameters
    ----------
    make : makes the report of the result, of which a page, a PDF or files draw the figures
    record : makes the content of the JSON, or its bytes
    texts : make the contents of other files, by the options that name these
    name : with which the names of figures and tables begin
    failed : makes the report of what failed; None where nothing did
    notes : listed below the files
    """
    from winchcascade.report.render.terminal import terminal_text

    for option, text in texts.items():
        path = outputs[option]
        if path is not None:
            write_content(path, text(), force=outputs.force)
    written = _write_report_files(make, outputs, name)
    if outputs["json"] is not None:
        found = record()
        content = found if isinstance(found, bytes) else json_bytes(found)
        if outputs["json"] == STDOUT:
            sys.stdout.buffer.write(json_without_commands(content))
            return
        write_content(outputs["json"], content, force=outputs.force)
    if QUIET.get():
        show("", failures="" if failed is None else terminal_text(failed()))
    else:
        files = list(dict.fromkeys([*outputs.files, *notes]))
        show(terminal_text(written or make(), files))


def _write_report_files(make: Callable[[], Report], outputs: Outputs, name: str) -> Report | None:
    """Write the page, the PDF, the figures and the tables of a report as far as they are wanted,
    and give the report.
    """
    if outputs.paths.keys().isdisjoint(REPORT):
        return None
    from winchcascade.report.render.report_files import publish, write_figures, write_tables

    with status_line(f"report of {name}") as on_progress:
        on_progress(f"{name}: drawing figures")
        report = make()
        for ending in ("html", "pdf"):
            if ending in outputs.paths:
                on_progress(f"writing {outputs.paths[ending].name}")
                publish(report, **{ending: outputs.paths[ending]}, force=outputs.force)
        for folder, write in (
            (outputs["figures"], write_figures),
            (outputs["tables"], write_tables),
        ):
            if folder is not None:
                on_progress(f"writing files into {folder.name}")
                write(report, folder, name, force=outputs.force)
    return report


def show(text: str, *, failures: str = "", file: TextIO | None = None) -> None:
    """Print lines without control characters and commands to a runner of GitHub: names from files
    may hold any text.

    Parameters
    ----------
    failures : what is printed instead with --quiet
    """
    print(painted(failures if QUIET.get() else text, lines), end="", file=file, flush=True)


def show_commands(text: str, *, file: TextIO) -> None:
    """Print commands to a runner of GitHub; what they quote is escaped already."""
    print(printable(text), end="", file=file)


def given_command() -> str:
    """The command as it was given, to be given again."""
    import shlex

    return shlex.join(["winchcascade", *sys.argv[1:]])
