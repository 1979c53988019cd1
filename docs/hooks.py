"""Hooks of the site: pages from outside this folder, and the help of each command.

MkDocs calls the functions whose names begin with `on_`; `mkdocs.yml` names this file.
"""

from __future__ import annotations

import os
import posixpath
import re
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

ROOT = Path(__file__).parent.parent

OUTSIDE = {
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "fixtures/README.md": "fixtures.md",
    "fixtures/measured/README.md": "measured.md",
}
"""Pages of the site that stand elsewhere in the repository."""

IN_THE_SITE = OUTSIDE | {"README.md": "index.md"}
"""Where a link to a file outside docs/ leads in the site."""

LINK = re.compile(r"\]\((?!https?:|#)([^)#\s]+)")
HELP = re.compile(r"^<!-- help: ([\w -]+) -->$", re.MULTILINE)
WIDTH = 80
"""Width of the printed help. [characters]"""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that stand outside docs/."""
    from mkdocs.structure.files import File

    for source, name in OUTSIDE.items():
        text = (ROOT / source).read_text(encoding="utf-8")
        files.append(File.generated(config, name, content=moved(text, posixpath.dirname(source))))
    return files


def on_page_markdown(markdown: str, *, page: Page, **_: object) -> str:
    """Put the help of commands in, and turn links that lead outside docs/ to the pages of the
    site.
    """
    text = markdown if page.file.src_uri in OUTSIDE.values() else moved(markdown, "docs")
    return HELP.sub(lambda found: help_of(found[1]), text)


def moved(text: str, folder: str) -> str:
    """A page of a folder of the repository with its links as they lead from docs/."""

    def link(found: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(folder, found[1]))
        return f"]({IN_THE_SITE.get(target, posixpath.relpath(target, 'docs'))}"

    return LINK.sub(link, text)


def help_of(command: str) -> str:
    """What a command prints for `--help`, folded."""
    called = [sys.executable, "-m", "winchcascade", *command.split(), "--help"]
    done = subprocess.run(
        called, capture_output=True, check=True, encoding="utf-8",
        env=os.environ | {"COLUMNS": str(WIDTH), "PYTHONIOENCODING": "utf-8"},
    )  # fmt: skip
    lines = "\n".join(f"    {line}".rstrip() for line in done.stdout.splitlines())
    return f'??? note "`winchcascade {command} --help`"\n\n    ```text\n{lines}\n    ```'


LOADED = re.compile(
    r"""(?:<(?:script|img|iframe)[^>]*\ssrc=|<link[^>]*\shref=|url\()["']?(https?://[^"')\s>]+)"""
)


def on_post_build(config: MkDocsConfig) -> None:
    """Reject a site that loads anything from the network."""
    from mkdocs.exceptions import PluginError

    for path in Path(config.site_dir).rglob("*"):
        if path.suffix in (".html", ".css"):
            found = LOADED.search(path.read_text(encoding="utf-8"))
            if found:
                raise PluginError(
                    f"{path.name} loads {found[1]}; the site has to work without a network"
                )
