"""A folder with the shipped logs in which commands are called."""

import hashlib
import os
import platform
import re
import shutil
import tarfile
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any
from unittest import mock

import numpy
from calls import call
from contents import CONTENTS
from inputs import LABELLED, write_inputs
from stored import thin

from winchcascade import __version__
from winchcascade.cli.app import MATTERING

ROOT = Path(__file__).parent.parent.parent
SHARED = ROOT.parent / "shared" / "data"
"""Data beside the project, which users do not have."""

KEPT = Path(__file__).parent / "versions"
"""Results and trials that earlier versions made, one folder for each version."""

KITE = "kitepower-2019-10-08"
ENVIRONMENT = {
    "SOURCE_DATE_EPOCH": "1767225600",
    "TERM": "dumb",
    "NO_COLOR": "1",
    "LANG": "C.UTF-8",
}
UNWANTED = (
    "COLUMNS",
    "TERMINAL_WIDTH",
    "FORCE_COLOR",
    "GITHUB_ACTIONS",
    "PY_COLORS",
    "_TYPER_FORCE_DISABLE_TERMINAL",
)
"""Variables that change how lines are laid out."""

PATIENCE = 1200
"""A command that has not ended after this never will, however busy the machine is. [s]"""

_DIGEST = re.compile(r"\b[0-9a-f]{64}\b")


class Workplace:
    """A folder that holds copies of the logs under relative names; the present folder while it is
    open.

    `shared` is whether the data beside the project exist.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.shared = SHARED.is_dir()
        self._inputs: dict[str, str] = {}
        running = f"Python {platform.python_version()}"
        self._differing = {
            str(folder): "<folder>",
            str(ROOT): "<checkout>",
            f"{running}, {platform.platform()}": "Python <version>, <platform>",
            running: "Python <version>",
            f"numpy {numpy.__version__}": "numpy <version>",
            **{
                f"\n{package} {version(package)}": f"\n{package} <version>" for package in MATTERING
            },
        }

    def lay_out(self) -> None:
        """Copy the logs into the folder, and write the inputs that are made of them."""
        shutil.copytree(ROOT / "fixtures", "fixtures")
        if self.shared:
            for name in LABELLED:
                shutil.copytree(SHARED / "labelled" / name, Path("labelled", name))
            shutil.copytree(SHARED / KITE, "kite")
        write_inputs(shared=self.shared)
        for kept in sorted(KEPT.glob("*/*.tar.xz")):
            with tarfile.open(kept) as file:
                file.extractall(Path("kept", kept.parent.name), filter="data")
        for path in sorted(Path().rglob("*")):
            if path.is_file():
                self._inputs[hashlib.sha256(path.read_bytes()).hexdigest()] = str(path)

    def run(self, *words: str) -> tuple[int, str]:
        """Call a command in this process; its exit code, and what it prints.

        A fault of the program is given as a text, so that the other outputs are still made.
        """
        try:
            with mock.patch.dict(os.environ):
                code, out, err = call(*words, patience=PATIENCE)
        except Exception as fault:
            code, out, err = 1, "", f"TRACEBACK {type(fault).__name__}: {fault}\n"
        return code, self.plain(out + (f"--- stderr\n{err}" if err else ""))

    def content(self, path: Path) -> Any:
        """Give the content of a file that a command wrote: a text, or thinned data; None where
        it wrote none.
        """
        if not path.is_file():
            return None
        found = CONTENTS[path.suffix](path)
        return self.plain(found) if path.suffix == ".html" else thin(self._plain_data(found))

    def _plain_data(self, value: Any) -> Any:
        if isinstance(value, dict):
            return {self.plain(str(key)): self._plain_data(part) for key, part in value.items()}
        if isinstance(value, list | tuple):
            return [self._plain_data(part) for part in value]
        return self.plain(value) if isinstance(value, str) else value

    def plain(self, text: str) -> str:
        """Replace what differs between machines: folders, versions, digests of computed content."""
        for differing, same in self._differing.items():
            text = text.replace(differing, same)
        text = re.sub(
            rf"(winchcascade[ /-]|version: ){re.escape(__version__)}\b", r"\1<version>", text
        )
        return _DIGEST.sub(lambda found: f"<{self._inputs.get(found[0], 'digest')}>", text)


@contextmanager
def workplace() -> Iterator[Workplace]:
    """Open a folder for commands, with an environment in which they print the same everywhere."""
    before, kept = Path.cwd(), dict(os.environ)
    os.environ.update(ENVIRONMENT)
    for name in UNWANTED:
        os.environ.pop(name, None)
    with tempfile.TemporaryDirectory(prefix="reference-") as name:
        place = Workplace(Path(name).resolve())
        os.chdir(place.folder)
        try:
            place.lay_out()
            yield place
        finally:
            os.chdir(before)
            os.environ.clear()
            os.environ.update(kept)
