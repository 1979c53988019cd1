"""A folder with the shipped logs in which commands are called, and what they print and write as text."""

import hashlib
import os
import platform
import re
import shutil
import tarfile
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from unittest import mock

import numpy
from calls import call
from contents import figure_text, html_text, json_text, log_text, parquet_text, pdf_text, toml_text, workbook_text

from winchcascade import __version__
from winchcascade.cli.app import MATTERING

ROOT = Path(__file__).parent.parent.parent
SHARED = ROOT.parent / "shared" / "data"
"""Data beside the project, which users do not have."""

HERE = Path(__file__).parent
KEPT = HERE / "versions"
"""Results and trials that earlier versions made, one folder for each version."""

EPOCH = "1767225600"
ENVIRONMENT = {"SOURCE_DATE_EPOCH": EPOCH, "TERM": "dumb", "NO_COLOR": "1", "LANG": "C.UTF-8"}
UNWANTED = ("COLUMNS", "TERMINAL_WIDTH", "FORCE_COLOR", "GITHUB_ACTIONS", "PY_COLORS", "_TYPER_FORCE_DISABLE_TERMINAL")
"""Variables that change how lines are laid out."""

LABELLED = ("ke_rolloff", "torque_gain", "copper_heating_and_line_drag", "none")
"""Labelled campaigns: one effect in the generator, one in a sensor, a pair of effects, and none."""

KITE = "kitepower-2019-10-08"

PATIENCE = 1200
"""A command that has not ended after this never will, however busy the machine is. [s]"""

_DIGEST = re.compile(r"\b[0-9a-f]{64}\b")
_ROWS_OF_A_SHORT_LOG = 1000


class Workplace:
    """A folder that holds copies of the logs under relative names; the present folder while it is open.

    `shared` tells whether the data beside the project are there; `figures` are those that were drawn last, as texts.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.shared = SHARED.is_dir()
        self.figures: list[str] = []
        self._inputs: dict[str, str] = {}

    def lay_out(self) -> None:
        """Copy the logs into the folder."""
        shutil.copytree(ROOT / "fixtures", self.folder / "fixtures")
        if self.shared:
            for name in LABELLED:
                shutil.copytree(SHARED / "labelled" / name, self.folder / "labelled" / name)
            shutil.copytree(SHARED / KITE, self.folder / "kite")
        for path in sorted(self.folder.rglob("*")):
            if path.is_file():
                self._inputs[hashlib.sha256(path.read_bytes()).hexdigest()] = str(path.relative_to(self.folder))

    def run(self, *words: str | Path, columns: int | None = None, terminal: bool = False) -> str:
        """Call a command in this process; the command, what it prints, and its exit code.

        `columns` are those of a line; with `terminal`, both streams are terminals.
        """
        width = {} if columns is None else {"COLUMNS": str(columns)}
        try:
            with mock.patch.dict(os.environ, width):
                code, out, err = call(*words, patience=PATIENCE, terminal=terminal)
        except Exception as fault:
            code, out, err = 1, "", f"TRACEBACK {type(fault).__name__}: {fault}\n"
        parts = [f"$ winchcascade {' '.join(map(str, words))}\n{out}"]
        parts += [f"--- stderr\n{err}"] if err else []
        parts += [f"--- exit code {code}\n"] if code else []
        return self.plain("".join(part if part.endswith("\n") else f"{part}\n" for part in parts))

    def show(self, *names: str | Path, digits: int | None = None) -> str:
        """Show files that a command wrote, each by its kind; `digits` of the numbers of a JSON file."""
        return "".join(f"--- file {name}\n{self.plain(self._content(Path(name), digits))}\n" for name in names)

    def _content(self, path: Path, digits: int | None) -> str:
        if not path.is_file():
            return "(not written)"
        if path.suffix == ".json" and digits is not None:
            return json_text(path, digits)
        return _SHOWN[path.suffix](path)

    def plain(self, text: str) -> str:
        """Replace what differs between machines: folders, versions, digests of computed content."""
        text = text.replace(str(self.folder), "<folder>").replace(str(ROOT), "<checkout>")
        text = text.replace(
            f"Python {platform.python_version()}, {platform.platform()}", "Python <version>, <platform>"
        )
        text = text.replace(f"Python {platform.python_version()}", "Python <version>")
        text = text.replace(f"numpy {numpy.__version__}", "numpy <version>")
        for package in MATTERING:
            text = text.replace(f"\n{package} {version(package)}", f"\n{package} <version>")
        text = re.sub(rf"(winchcascade[ /-]|version: ){re.escape(__version__)}\b", r"\1<version>", text)
        text = _DIGEST.sub(lambda found: f"<{self._inputs.get(found[0], 'digest')}>", text)
        return re.sub(r"[ \t]+$", "", text, flags=re.MULTILINE)

    def files(self, folder: str) -> str:
        """List the files of a folder."""
        found = sorted(str(path) for path in Path(folder).rglob("*") if path.is_file())
        return "".join(f"{name}\n" for name in [f"--- files of {folder}", *found])

    @contextmanager
    def drawn(self) -> Iterator[None]:
        """Collect the arrays behind every figure that is drawn within."""
        from matplotlib.figure import Figure

        from winchcascade.report import svg_drawing

        self.figures = []
        usual = svg_drawing.svg_text

        def svg_text(figure: Figure, name: str) -> str:
            text = usual(figure, name)
            lines = figure_text(len(self.figures) + 1, figure)
            self.figures.append(self.plain("".join(f"{line}\n" for line in lines)))
            return text

        svg_drawing.svg_text = svg_text
        try:
            yield
        finally:
            svg_drawing.svg_text = usual

    def short_campaign(self) -> str:
        """Make a campaign of two short logs, of one cycle each, and give its folder."""
        folder = Path("short")
        folder.mkdir()
        for name in ("open_circuit.csv", "r36ohm.csv"):
            rows = Path("fixtures", "campaign", name).read_text(encoding="utf-8").splitlines(keepends=True)
            (folder / name).write_text("".join(rows[:_ROWS_OF_A_SHORT_LOG]), encoding="utf-8")
        runs = [("open_circuit.csv", "inf", ""), ("r36ohm.csv", "36.0", "window_s = 5.48\n")]
        text = [f'[[run]]\nfile = "{name}"\nload_ohm = {load}\n{window}' for name, load, window in runs]
        (folder / "campaign.toml").write_text("\n".join(['title = "Two short logs"\n', *text]), encoding="utf-8")
        return str(folder)


_SHOWN: dict[str, Callable[[Path], str]] = {
    ".json": json_text,
    ".html": html_text,
    ".pdf": pdf_text,
    ".parquet": parquet_text,
    ".xlsx": workbook_text,
    ".csv": log_text,
    ".toml": toml_text,
    **dict.fromkeys((".xml", ".tex", ".md"), lambda path: path.read_text(encoding="utf-8").rstrip("\n")),
}


def unpack(archive: Path) -> None:
    """Unpack what an earlier version made into the present folder."""
    with tarfile.open(archive) as file:
        file.extractall(filter="data")


@contextmanager
def workplace() -> Iterator[Workplace]:
    """Open a folder for commands, with an environment in which they print the same everywhere."""
    before, kept = Path.cwd(), dict(os.environ)
    os.environ.update(ENVIRONMENT)
    for name in UNWANTED:
        os.environ.pop(name, None)
    with tempfile.TemporaryDirectory(prefix="reference-") as name:
        place = Workplace(Path(name).resolve())
        place.lay_out()
        os.chdir(place.folder)
        try:
            yield place
        finally:
            os.chdir(before)
            os.environ.clear()
            os.environ.update(kept)
