"""Pages that a reader follows from top to bottom: files to save, lines to put in, commands and what they print.

A block of a page is a step of it:

- below "Save as `NAME`" a file, below "Append to `NAME`" more of it;
- below "Put into `NAME`" a `diff` without numbers: its context must be found once, its added lines come beside it;
- `console`: one command and what it prints;
- `sh`: commands that must succeed, whatever they print.

Other blocks are for reading alone.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"

BLOCK = re.compile(r"(?:(Save as|Append to|Put into) `([^`\n]+)`[^\n]*\n\n)?```(\w+)\n(.*?)```", re.DOTALL)
CONSOLE = re.compile(r"```console\n\$ ([^\n]*)\n(.*?)```", re.DOTALL)


class Step(NamedTuple):
    """A block of a page: what to do with which file, the kind of the block, its text."""

    verb: str
    file: str
    kind: str
    text: str

    @property
    def command(self) -> str:
        """Command of a `console` block."""
        return self.text.split("\n", 1)[0].removeprefix("$ ")

    @property
    def shown(self) -> str:
        """What a `console` block shows as printed."""
        return self.text.split("\n", 1)[1]


def steps(page: str) -> list[Step]:
    return [Step(*found.groups(default="")) for found in BLOCK.finditer((DOCS / page).read_text(encoding="utf-8"))]


def follow(page: str, place: Path) -> dict[str, str]:
    """Follow a page in a folder; what each command printed. Stops where something cannot be followed."""
    printed = {}
    for step in steps(page):
        if step.verb == "Put into":
            put_into(place / step.file, step.text)
        elif step.verb:
            save(place / step.file, step.text, more=step.verb == "Append to")
        elif step.kind == "console":
            printed[step.command] = run(step.command, place).stdout
        elif step.kind == "sh":
            done = run(f"set -e\n{step.text}", place)
            assert done.returncode == 0, f"{page}: {step.text}\n{done.stdout}"
    return printed


def shown(page: str) -> dict[str, str]:
    """What a page says that each command prints."""
    return {step.command: step.shown for step in steps(page) if step.kind == "console"}


def save(path: Path, text: str, *, more: bool) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    before = path.read_text(encoding="utf-8") if more else ""
    path.write_text(before + text, encoding="utf-8")


def put_into(path: Path, diff: str) -> None:
    """Apply a diff without numbers; hunks are parted by empty lines."""
    text = path.read_text(encoding="utf-8")
    for hunk in re.split(r"^\n", diff, flags=re.MULTILINE):
        lines = hunk.splitlines(keepends=True)
        old = "".join(line[1:] for line in lines if not line.startswith("+"))
        new = "".join(line[1:] for line in lines if not line.startswith("-"))
        assert text.count(old) == 1, f"{path.name} holds {text.count(old)} times:\n{old}"
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")


def run(command: str, place: Path) -> subprocess.CompletedProcess[str]:
    """Run a command as a reader would in a shell whose path holds this environment."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    return subprocess.run(
        ["bash", "-c", command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, cwd=place, encoding="utf-8", check=False,
        env=os.environ | {"PATH": path, "PYTHONIOENCODING": "utf-8"},
    )  # fmt: skip


def with_fixtures(place: Path) -> Path:
    """A folder that holds the shipped logs."""
    shutil.copytree(ROOT / "fixtures", place / "fixtures")
    return place


def write_outputs(page: str, printed: dict[str, str]) -> None:
    """Write what commands print into their blocks."""
    path = DOCS / page
    text = CONSOLE.sub(lambda m: f"```console\n$ {m[1]}\n{printed[m[1]]}```", path.read_text(encoding="utf-8"))
    path.write_text(text, encoding="utf-8")
