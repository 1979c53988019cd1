"""Every page in a real browser: no error, no request, nothing cut or covered, nothing that keeps
a reader out.
"""

import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from calls import call
from every_report import KINDS, KITE, made
from pypdf import PdfReader

CHROMIUM = next(
    (
        path
        for name in ("chromium", "chromium-browser", "google-chrome")
        if (path := shutil.which(name))
    ),
    None,
)
if (
    "WINCHCASCADE_BROWSER" not in os.environ
):  # set by `make test-browser`, which alone runs these tests
    pytest.skip("run by make test-browser", allow_module_level=True)

from axe_playwright_python.sync_playwright import Axe  # noqa: E402
from playwright.sync_api import sync_playwright  # noqa: E402

SCREENS: dict[str, dict[str, Any]] = {
    "desktop": {"viewport": {"width": 1366, "height": 768}},
    "wide": {"viewport": {"width": 1920, "height": 1080}},
    "dark": {"viewport": {"width": 1366, "height": 768}, "color_scheme": "dark"},
    "print": {"viewport": {"width": 718, "height": 1000}, "media": "print"},
    "phone": {"viewport": {"width": 390, "height": 844}, "is_mobile": True, "has_touch": True},
}
"""Screens, and the width of an A4 page without its margins. A page is opened anew on a phone
alone.
"""

ONLY_FAULTS = {"resultTypes": ["violations"]}
AXE: dict[str, dict[str, Any]] = {
    "desktop": ONLY_FAULTS,
    "dark": ONLY_FAULTS | {"runOnly": ["color-contrast"]},
    "phone": ONLY_FAULTS
    | {
        "runOnly": ["target-size", "scrollable-region-focusable", "meta-viewport", "color-contrast"]
    },
}
"""Screens on which rules of accessibility are tried, with those that are."""

MOST_SCREENS = 4
"""Screens of a page of a log or of a diagnosis before the reader opens what is folded."""

CUT = """() => [...document.querySelectorAll("td, th")].filter((cell) => cell.scrollWidth > cell.clientWidth + 1)
  .map((cell) => cell.textContent)"""
"""Cells whose text is wider than they are."""

COVERED = """() => [...document.querySelectorAll("svg")].flatMap((svg) => {
  const boxes = [...svg.querySelectorAll("text, g[id*='text_']")].filter((one) => one.querySelector("text") === null)
    .map((one) => [one.textContent.trim() || one.id, one.getBoundingClientRect()]).filter(([, box]) => box.width > 0);
  return boxes.flatMap(([text, a], k) => boxes.slice(k + 1).filter(([, b]) =>
    Math.min(a.right, b.right) - Math.max(a.left, b.left) > 2 && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 4
  ).map(([other]) => `${svg.closest("figure")?.id}: ${text} / ${other}`));
})"""
"""Labels of figures that lie over one another by more than the space about their letters.
[pixels]
"""

OPEN_ALL = 'document.querySelectorAll("details").forEach((one) => { one.open = true; })'


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield running
        running.close()


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], list[Path]]:
    """Files of the pages of a kind, one of those of logs of a folder; each kind made once."""
    known: dict[str, list[Path]] = {}

    def give(kind: str) -> list[Path]:
        if kind == "line" and not KITE.is_dir():
            pytest.skip("needs ../shared/data, which only the project's own machines have")
        if kind not in known:
            folder = tmp_path_factory.mktemp("kind")
            made(kind, folder)
            logs = sorted(folder.rglob("runs/*.html"))
            known[kind] = [page for page in sorted(folder.rglob("*.html")) if page not in logs[1:]]
            assert known[kind], f"{kind} has no page"
        return known[kind]

    return give


def opened(browser: Any, page: Path, screen: str) -> tuple[Any, list[str], list[str]]:
    """A page on a screen, what it wrote to the console, and what it asked for besides itself."""
    tab = browser.new_context(**SCREENS[screen]).new_page()
    said: list[str] = []
    asked: list[str] = []
    tab.on("console", lambda message: said.append(message.text))
    tab.on("pageerror", lambda fault: said.append(str(fault)))
    tab.on("request", lambda request: asked.append(request.url))
    tab.goto(page.as_uri())
    tab.evaluate("document.documentElement.style.scrollBehavior = 'auto'")
    return tab, said, [url for url in asked if url != page.as_uri() and not url.startswith("data:")]


def faults(tab: Any, screen: str) -> dict[str, Any]:
    """What is wrong with an open page on its screen."""
    tab.wait_for_timeout(100)
    axe = Axe().run(tab, options=AXE[screen]).response["violations"] if screen in AXE else []
    wide = tab.evaluate("document.documentElement.scrollWidth - window.innerWidth")
    return {
        "axe": [(one["id"], [node["html"][:200] for node in one["nodes"]][:3]) for one in axe],
        "cut": tab.evaluate(CUT),
        "covered": tab.evaluate(COVERED),
        "wide": max(0, wide) * (screen != "print"),
    }


@pytest.mark.parametrize("kind", KINDS)
def test_a_page_makes_no_error_cuts_and_covers_nothing_and_keeps_nobody_out(
    browser: Any, pages: Callable[[str], list[Path]], kind: str
) -> None:
    found: dict[tuple[str, str, str], Any] = {}
    for page in pages(kind):
        for first, others in (("desktop", ["wide", "dark", "print"]), ("phone", [])):
            tab, said, asked = opened(browser, page, first)
            tab.evaluate(OPEN_ALL)
            for screen in (first, *others):
                as_shown = SCREENS[screen]
                tab.set_viewport_size(as_shown["viewport"])
                tab.emulate_media(
                    media=as_shown.get("media"), color_scheme=as_shown.get("color_scheme")
                )
                found |= {
                    (page.name, screen, name): one for name, one in faults(tab, screen).items()
                }
            found |= {(page.name, first, "said"): said, (page.name, first, "asked"): asked}
            tab.context.close()
    assert {where: one for where, one in found.items() if one} == {}


@pytest.mark.parametrize("kind", ["log", "diagnosis", "line"])
def test_what_is_open_has_room_on_a_few_screens(
    browser: Any, pages: Callable[[str], list[Path]], kind: str
) -> None:
    (page,) = pages(kind)
    tab, _, _ = opened(browser, page, "desktop")
    screens = tab.evaluate("document.documentElement.scrollHeight / window.innerHeight")
    tab.context.close()
    assert screens <= MOST_SCREENS


def test_the_first_screen_of_a_diagnosis_holds_verdict_tiles_and_waterfall(
    browser: Any, pages: Callable[[str], list[Path]]
) -> None:
    (page,) = pages("diagnosis")
    tab, _, _ = opened(browser, page, "desktop")
    boxes = [tab.locator(part).first.bounding_box() for part in (".tiles", "#summary figure")]
    tab.context.close()
    assert [box["y"] + box["height"] <= 768 for box in boxes] == [True, True]


def test_the_warning_stands_on_every_printed_page(
    browser: Any, fixtures: Path, tmp_path: Path
) -> None:
    call("reduce", fixtures / "campaign" / "r36ohm.csv", "--html", tmp_path / "page.html")
    tab, _, _ = opened(browser, tmp_path / "page.html", "desktop")
    tab.pdf(path=tmp_path / "printed.pdf", format="A4", print_background=True)
    tab.context.close()
    printed = [page.extract_text() for page in PdfReader(tmp_path / "printed.pdf").pages]
    assert len(printed) > 3
    assert all("Not measured." in " ".join(text.split()) for text in printed)


def test_time_histories_get_the_width_of_the_page_and_read_out(
    browser: Any, pages: Callable[[str], list[Path]]
) -> None:
    for kind in ("log", "simulate", "diagnosis"):
        (page,) = pages(kind)
        tab, said, _ = opened(browser, page, "desktop")
        tab.evaluate(OPEN_ALL)
        tab.wait_for_timeout(200)
        plots = tab.locator(".uplot")
        widths = [plots.nth(k).bounding_box()["width"] for k in range(plots.count())]
        width = tab.locator(".histories").first.bounding_box()["width"]
        tab.locator(".u-over").first.hover()
        read = [
            value
            for value in tab.locator(".u-value").all_text_contents()
            if value not in ("", "--")
        ]
        tab.context.close()
        assert said == [], kind
        assert widths == pytest.approx([width] * len(widths), abs=1.0)
        assert len(widths) >= 4
        assert len(read) >= len(widths)


def test_links_lead_from_the_index_to_a_log_to_its_campaign_and_back(
    browser: Any, pages: Callable[[str], list[Path]]
) -> None:
    (index,) = (page for page in pages("campaign") if page.name == "index.html")
    tab, said, _ = opened(browser, index, "desktop")
    tab.locator("a[href*='r36ohm']").first.click()
    kinds = [tab.inner_text(".kind")]
    for name in ("campaign.html", "index.html"):
        tab.locator(f"nav a[href$='{name}']").first.click()
        kinds.append(tab.inner_text(".kind"))
    tab.context.close()
    assert said == []
    assert len(set(kinds)) == 3
