"""The documents as a whole: their size, the site that holds each page once, and links that lead
somewhere.
"""

import importlib.util
import re
import unicodedata
from pathlib import Path
from types import ModuleType

import pytest
from pages import DOCS, ROOT, read

OWN = sorted(DOCS.glob("*.md"))
OUTSIDE = sorted([*ROOT.glob("*.md"), *ROOT.glob("fixtures/**/README.md")])


MAX_PAGE = 2_500
"""Words of one page."""


def words(page: Path) -> int:
    return len(read(page).split())


def without_code(text: str) -> str:
    return re.sub(r"```.*?```", "", text, flags=re.DOTALL)


def github_anchor(heading: str) -> str:
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def site_anchor(heading: str) -> str:
    plain = unicodedata.normalize("NFKD", heading).encode("ascii", "ignore").decode()
    return re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", plain).strip().lower())


def anchors(page: Path) -> set[str]:
    """Where a link may lead in a page, both on GitHub and in the site."""
    headings = re.findall(r"^#+ (.*)$", without_code(read(page)), re.MULTILINE)
    named = [
        re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "") for heading in headings
    ]
    return {github_anchor(name) for name in named} & {site_anchor(name) for name in named}


def links(page: Path) -> list[str]:
    """Targets of the links of a page that stay in the project."""
    text = re.sub(r"`[^`\n]*`", "", without_code(read(page)))
    return [
        target
        for target in re.findall(r"\]\(([^)\s]+)\)", text)
        if not target.startswith(("https:", "http:"))
    ]


@pytest.mark.parametrize("page", [*OWN, *OUTSIDE], ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_to_a_file_and_a_heading(page: Path) -> None:
    for target in links(page):
        name, _, place = target.partition("#")
        file = (page.parent / name).resolve() if name else page
        assert file.exists(), target
        assert not place or place in anchors(file), target


def hooks() -> ModuleType:
    about = importlib.util.spec_from_file_location("hooks", DOCS / "hooks.py")
    assert about is not None
    assert about.loader is not None
    module = importlib.util.module_from_spec(about)
    about.loader.exec_module(module)
    return module


def test_the_site_holds_every_page_once() -> None:
    listed = re.findall(r"^ +- (\w+\.md)$", read(ROOT / "mkdocs.yml"), re.MULTILINE)
    assert sorted(listed) == sorted([*(page.name for page in OWN), *hooks().OUTSIDE.values()])


def test_pages_of_the_site_link_to_pages_of_the_site() -> None:
    site = [*OWN, *(ROOT / name for name in hooks().OUTSIDE)]
    files = {
        (page.parent / target.partition("#")[0]).resolve()
        for page in site
        for target in links(page)
    }
    outside = {file.relative_to(ROOT).as_posix() for file in files if not file.is_relative_to(DOCS)}
    assert outside <= set(hooks().IN_THE_SITE) | {"."}


def test_the_index_leads_to_every_page() -> None:
    listed = {target.partition("#")[0] for target in links(DOCS / "index.md")}
    assert {page.name for page in OWN} - {"index.md"} <= listed


def test_no_page_is_long() -> None:
    assert {page.name: words(page) for page in [*OWN, *OUTSIDE] if words(page) >= MAX_PAGE} == {}


def test_contributing_lists_every_package() -> None:
    inside = [path for path in (ROOT / "winchcascade").iterdir() if not path.name.startswith("__")]
    packages = {path.name for path in inside if (path / "__init__.py").is_file()}
    assert packages == set(
        re.findall(r"^\| \d \| `(\w+)` \|", read(ROOT / "CONTRIBUTING.md"), re.MULTILINE)
    )
