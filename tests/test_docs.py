"""The documents as a whole: an index that lists all, links that lead somewhere, and the page of the model."""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from pages import DOCS, ROOT

from winchcascade import baseline, read_run, simulate
from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.rig_toml import built_in
from winchcascade.diagnosis.predict import COARSE
from winchcascade.rig.simulate import READ, STEP, Simulation

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


@cache
def simulated(step: float) -> tuple[Simulation, ...]:
    model = baseline(built_in())
    runs = [read_run(run.file, load=run.load) for run in load_campaign(ROOT / "fixtures" / "campaign").runs]
    return tuple(simulate(run, model, step=step) for run in runs)


def largest_change(one: float, other: float) -> float:
    """Of any channel along any shipped log, as a share of its largest value."""
    return max(
        float(np.abs(a.run.channels[name] - b.run.channels[name]).max() / np.abs(a.run.channels[name]).max())
        for a, b in zip(simulated(one), simulated(other), strict=True)
        for name in READ
    )


@pytest.mark.slow
def test_the_steps_of_the_model_are_as_exact_as_its_page_says() -> None:
    page = " ".join((DOCS / "model.md").read_text(encoding="utf-8").split())
    assert f"takes steps of {1e3 * STEP:g} ms" in page
    assert f"take {1e3 * COARSE:g} ms" in page
    assert "half the step changes no channel by more than 0.02 %" in page
    assert largest_change(STEP, 0.5 * STEP) < 2e-4
    assert "at most 0.05 % of a channel's largest value away" in page
    assert largest_change(STEP, COARSE) < 5e-4
    assert "within 2e-7 of it" in page
    for done in simulated(STEP):
        joule = {name: entry[-1] for name, entry in done.energy.items()}
        assert sum(joule.values()) - joule["line"] == pytest.approx(joule["line"], rel=2e-7)
