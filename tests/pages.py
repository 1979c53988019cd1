"""Pages that a reader follows from top to bottom: files to save, lines to put in, commands and what
they print.

A block of a page is a step of it:

- below "Save as `NAME`" a file, below "Append to `NAME`" more of it;
- below "Put into `NAME`" a `diff` without numbers: its context must be found once, its added lines come beside it;
- `console`: one command and what it prints;
- `sh`: commands that must succeed, whatever they print;
- `pycon`: a session of Python, whose names live until the end of the page.

Blocks of other kinds (`bash`, `toml`, `text`, ...) are for reading alone.
"""

import doctest
import os
import re
import shutil
import subprocess
import sys
from contextlib import chdir
from pathlib import Path
from typing import Any, NamedTuple

from calls import without_progress

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
BENCHES = ROOT.parent / "shared" / "data" / "benches"
"""Measured logs of other people's benches, which only the project's own machines have."""

BLOCK = re.compile(
    r"(?:(?P<verb>Save as|Append to|Put into) "
    r"`(?P<file>[^`\n]+)`[^\n]*\n\n)?^```(?P<kind>\w+)\n(?P<text>.*?)^```$",
    re.DOTALL | re.MULTILINE,
)


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

    @property
    def executed(self) -> str:
        """Commands and Python of the block, without what they print."""
        if self.verb or self.kind == "sh":
            return self.text
        if self.kind == "console":
            return self.command
        return self.text if self.kind == "pycon" else ""


def read(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def steps(page: Path) -> list[Step]:
    return [Step(*found.groups(default="")) for found in BLOCK.finditer(read(page))]


def shown(page: Path) -> dict[str, str]:
    """What a page says that each command prints."""
    return {step.command: step.shown for step in steps(page) if step.kind == "console"}


def follow(page: Path, place: Path) -> str:
    """Follow a page in a folder; the page with what its blocks print now. Stops where something
    cannot be followed.
    """
    page_text, names = read(page), dict[str, Any]()

    def followed(found: re.Match[str]) -> str:
        step = Step(*found.groups(default=""))
        start, end = found.span("text")
        return (
            page_text[found.start() : start]
            + text_of(step, place, names)
            + page_text[end : found.end()]
        )

    return BLOCK.sub(followed, page_text)


def text_of(step: Step, place: Path, names: dict[str, Any]) -> str:
    """Do what a step says in a folder; the text of its block with what it prints now."""
    if step.verb == "Put into":
        put_into(place / step.file, step.text)
    elif step.verb:
        save(place / step.file, step.text, more=step.verb == "Append to")
    elif step.kind == "console":
        printed = without_progress(run(step.command, place).stdout)
        assert "command not found" not in printed, printed
        return f"$ {step.command}\n{printed}"
    elif step.kind == "sh":
        done = run(f"set -e\n{step.text}", place)
        assert done.returncode == 0, f"{step.text}\n{done.stdout}"
    elif step.kind == "pycon":
        with chdir(place):
            return Session(names).follow(step.text)
    return step.text


class Session(doctest.DocTestRunner):
    """A session of Python that collects what each line prints."""

    def __init__(self, names: dict[str, Any]) -> None:
        super().__init__(verbose=False)
        self.names = names
        self.printed: list[str] = []

    def follow(self, text: str) -> str:
        """Run the lines of a block; the block with what they print now."""
        parser = doctest.DocTestParser()
        test = parser.get_doctest(text, self.names, "page", None, 0)
        self.run(test, out=lambda _: None, clear_globs=False)
        self.names.update(test.globs)
        printed = iter(self.printed)
        return "".join(
            part if isinstance(part, str) else prompted(part.source) + next(printed)
            for part in parser.parse(text)
        )

    def report_success(self, out: object, test: object, example: doctest.Example, got: str) -> None:  # noqa: ARG002
        self.printed.append(example.want)

    def report_failure(self, out: object, test: object, example: doctest.Example, got: str) -> None:  # noqa: ARG002
        self.printed.append(re.sub(r"^$\n", "<BLANKLINE>\n", got, flags=re.MULTILINE))

    def report_unexpected_exception(
        self,
        out: object,  # noqa: ARG002
        test: object,  # noqa: ARG002
        example: doctest.Example,
        exc_info: Any,
    ) -> None:
        raise AssertionError(example.source) from exc_info[1]


def prompted(source: str) -> str:
    """Lines of Python behind the prompts of a session."""
    first, *others = source.splitlines()
    return "".join([f">>> {first}\n", *(f"... {line}".rstrip() + "\n" for line in others)])


def save(path: Path, text: str, *, more: bool) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    before = read(path) if more else ""
    path.write_text(before + text, encoding="utf-8")


def put_into(path: Path, diff: str) -> None:
    """Apply a diff without numbers; hunks are parted by empty lines."""
    text = read(path)
    for hunk in re.split(r"^\n", diff, flags=re.MULTILINE):
        lines = hunk.splitlines(keepends=True)
        old = "".join(line[1:] for line in lines if not line.startswith("+"))
        new = "".join(line[1:] for line in lines if not line.startswith("-"))
        assert text.count(old) == 1, f"{path.name} holds {text.count(old)} times:\n{old}"
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")


def run(command: str, place: Path) -> subprocess.CompletedProcess[str]:
    """Run a command as a reader would in a shell whose path holds this environment; a copy of
    the project comes first.
    """
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    project = {"PYTHONPATH": str(place)} if (place / "winchcascade").is_dir() else {}
    return subprocess.run(
        ["bash", "-c", command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, cwd=place, encoding="utf-8", check=False,
        env=os.environ | project | {"PATH": path, "PYTHONIOENCODING": "utf-8", "MPLBACKEND": "Agg"},
    )  # fmt: skip


def with_fixtures(place: Path) -> Path:
    """A folder that holds the shipped logs."""
    shutil.copytree(ROOT / "fixtures", place / "fixtures")
    return place


def place_of(page: Path, folder: Path) -> Path:
    """Make of an empty folder the one in which a page is followed: what its steps use is there."""
    place = with_fixtures(folder)
    used = [step for step in steps(page) if step.executed]
    if any(step.file.startswith("winchcascade/") for step in used):
        for name in ("winchcascade", "templates", "tests", "docs"):
            shutil.copytree(ROOT / name, place / name, ignore=shutil.ignore_patterns("*.nb[ic]"))
        shutil.copy(ROOT / "pyproject.toml", place)
    if uses_benches(page):
        (place / "benches").symlink_to(BENCHES, target_is_directory=True)
    return place


def uses_benches(page: Path) -> bool:
    """Whether a page reads logs that only the project's own machines have."""
    return any(re.search(r"(?<![\w/])benches/", step.executed) for step in steps(page))
