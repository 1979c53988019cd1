"""The documents as a whole: an index that lists all, and links that lead somewhere."""

import re
from pathlib import Path

import pytest
from pages import DOCS, ROOT

PAGES = sorted([*DOCS.glob("*.md"), *ROOT.glob("*.md"), ROOT / "fixtures" / "README.md"])


def anchors(page: Path) -> set[str]:
    """Where a link may lead in a page, as GitHub and GitLab name its headings."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_to_a_file_and_a_heading(page: Path) -> None:
    text = re.sub(r"```.*?```|`[^`\n]*`", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if target.startswith(("https://", "http://")):
            continue
        name, _, place = target.partition("#")
        file = (page.parent / name).resolve() if name else page
        assert file.exists(), target
        assert not place or place in anchors(file), target


def test_the_index_lists_every_page_once() -> None:
    listed = re.findall(r"^\| \[([\w.]+)\]\(\1\) \|", (DOCS / "index.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(listed) == sorted(page.name for page in DOCS.glob("*.md") if page.name != "index.md")


def test_every_room_stands_among_the_packages_of_the_house() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    inside = [path for path in (ROOT / "winchcascade").iterdir() if not path.name.startswith("__")]
    packages = {path.name for path in inside if (path / "__init__.py").is_file()}
    assert packages == set(re.findall(r"^\| \d \| `(\w+)` \|", text, re.MULTILINE))
