"""The page in a real browser: no error, no request, nothing that keeps a reader out; and it does what it offers."""

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from diagnosed import diagnosed
from pypdf import PdfReader

from winchcascade.cli.app import command_line
from winchcascade.report.diagnosis import write_diagnosis_reports

CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None
)
REQUIRED = "WINCHCASCADE_BROWSER" in os.environ
"""Set by `make test-browser`, which alone runs these tests."""

if not REQUIRED:
    pytest.skip("run by make test-browser", allow_module_level=True)

from axe_playwright_python.sync_playwright import Axe  # noqa: E402
from playwright.sync_api import sync_playwright  # noqa: E402

SCREENS: dict[str, dict[str, Any]] = {
    "desktop": {"viewport": {"width": 1200, "height": 900}},
    "dark": {"viewport": {"width": 1200, "height": 900}, "color_scheme": "dark"},
    "phone": {"viewport": {"width": 375, "height": 700}, "is_mobile": True, "has_touch": True},
}
LOGS = {
    "clean": ["campaign/r36ohm.csv"],
    "damaged": ["damaged_logs/dropouts.csv", "--window", "5.48"],
    "aborted": ["damaged_logs/aborted.csv"],
    "without torque": ["damaged_logs/no_torque.csv"],
    "open circuit": ["campaign/open_circuit.csv"],
}


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield running
        running.close()


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pages")
    root = Path(__file__).parent.parent.parent / "fixtures"
    made = {}
    for name, (log, *options) in LOGS.items():
        made[name] = folder / f"{name}.html"
        command_line("reduce")(["reduce", str(root / log), *options, "--html", str(made[name])], standalone_mode=False)
    nasty = folder / 'a <b>log <script>alert(1)<i> & "quotes" {{ 7*7 }} 測試.csv'
    shutil.copy(root / "campaign" / "r36ohm.csv", nasty)
    made["nasty"] = folder / "nasty.html"
    command_line("reduce")(["reduce", str(nasty), "--html", str(made["nasty"])], standalone_mode=False)
    for name in ("rolloff", "outsider"):
        made[name] = folder / f"{name}.html"
        write_diagnosis_reports(diagnosed(name), html=made[name], pdf=None)
    return made


def opened(browser: Any, page: Path, screen: str) -> tuple[Any, list[str], list[str]]:
    """A page on a screen, what it wrote to the console, and what it asked for besides itself."""
    tab = browser.new_context(**SCREENS[screen]).new_page()
    said: list[str] = []
    asked: list[str] = []
    tab.on("console", lambda message: said.append(message.text))
    tab.on("pageerror", lambda fault: said.append(str(fault)))
    tab.on("request", lambda request: asked.append(request.url))
    tab.goto(page.as_uri())
    return tab, said, [url for url in asked if url != page.as_uri() and not url.startswith("data:")]


@pytest.mark.parametrize("screen", SCREENS)
@pytest.mark.parametrize("log", [*LOGS, "nasty", "rolloff", "outsider"])
def test_a_page_makes_no_error_no_request_and_keeps_nobody_out(
    browser: Any, pages: dict[str, Path], log: str, screen: str
) -> None:
    tab, said, asked = opened(browser, pages[log], screen)
    violations = Axe().run(tab).response["violations"]
    wide = tab.evaluate("document.documentElement.scrollWidth - window.innerWidth")
    tab.context.close()
    assert said == []
    assert asked == []
    assert [(v["id"], [n["html"] for n in v["nodes"]]) for v in violations] == []
    assert wide <= 0


def test_texts_of_a_log_are_shown_and_never_run(browser: Any, pages: dict[str, Path]) -> None:
    tab, _, _ = opened(browser, pages["nasty"], "desktop")
    assert tab.inner_text("h1") == 'a <b>log <script>alert(1)<i> & "quotes" {{ 7*7 }} 測試.csv'
    assert tab.locator("h1 b").count() == 0
    tab.context.close()


def test_the_warning_stands_on_every_printed_page_and_hides_no_heading(
    browser: Any, pages: dict[str, Path], tmp_path: Path
) -> None:
    tab, _, _ = opened(browser, pages["clean"], "desktop")
    tab.evaluate("document.documentElement.style.scrollBehavior = 'auto'")
    tab.locator("nav a").nth(3).click()
    bottom = tab.evaluate("document.querySelector('.banner').getBoundingClientRect().bottom")
    heading = tab.evaluate("document.querySelector(location.hash + ' h2').getBoundingClientRect().top")
    tab.pdf(path=tmp_path / "printed.pdf", format="A4", print_background=True)
    tab.context.close()
    printed = [page.extract_text() for page in PdfReader(tmp_path / "printed.pdf").pages]
    assert heading > bottom
    assert len(printed) > 5
    assert all("Not measured: Rebuilt from Table 2" in " ".join(text.split()) for text in printed)


def test_the_chosen_cycle_fills_the_time_axis_and_its_values_are_read_out(browser: Any, pages: dict[str, Path]) -> None:
    tab, said, _ = opened(browser, pages["clean"], "desktop")
    tab.select_option("#span", index=2)
    ticks = [float(text) for text in tab.locator(".tick-text").all_text_contents() if text != "Time (s)"]
    drawing = tab.locator("figure.interactive .drawing")
    drawing.focus()
    for _ in range(30):
        tab.keyboard.press("ArrowRight")
    read = tab.inner_text("#readout")
    tab.keyboard.press("Home")
    left = tab.locator(".tick-text").count()
    tab.context.close()
    assert said == []
    assert min(ticks) >= 39.0  # the second cycle begins at 40.07 s
    assert max(ticks) <= 70.0
    assert "Line tension" in read
    assert " N " in read
    assert left == 0  # the whole log again, with the axis that was drawn


def test_dragging_zooms_and_a_double_click_shows_all_again(browser: Any, pages: dict[str, Path]) -> None:
    tab, said, _ = opened(browser, pages["clean"], "desktop")
    drawing = tab.locator("figure.interactive svg")
    drawing.scroll_into_view_if_needed()
    box = drawing.bounding_box()
    height = max(box["y"], 0.0) + 60.0
    tab.mouse.move(box["x"] + 0.3 * box["width"], height)
    tab.mouse.down()
    tab.mouse.move(box["x"] + 0.5 * box["width"], height, steps=4)
    tab.mouse.up()
    zoomed = tab.locator(".tick-text").count()
    tab.mouse.dblclick(box["x"] + 0.4 * box["width"], height)
    whole = tab.locator(".tick-text").count()
    tab.context.close()
    assert said == []
    assert zoomed > 3
    assert whole == 0
