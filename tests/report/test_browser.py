"""The page in a real browser: no error, no request, nothing that keeps a reader out; and it does what it offers."""

import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from diagnosed import diagnosed
from pypdf import PdfReader

from winchcascade.batch.demo import DIAGNOSIS_FILES
from winchcascade.batch.plan import make_plan
from winchcascade.batch.run_batch import Products, run_batch
from winchcascade.cli.app import command_line
from winchcascade.report.render.publish import publish
from winchcascade.report.results.diagnosis import diagnosis_report

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
    "desktop": {"viewport": {"width": 1366, "height": 768}},
    "dark": {"viewport": {"width": 1366, "height": 768}, "color_scheme": "dark"},
    "phone": {"viewport": {"width": 390, "height": 844}, "is_mobile": True, "has_touch": True},
}
LOGS = {
    "clean": ["campaign/r36ohm.csv"],
    "damaged": ["damaged_logs/dropouts.csv", "--window", "5.48"],
    "aborted": ["damaged_logs/aborted.csv"],
    "without torque": ["damaged_logs/no_torque.csv"],
    "open circuit": ["campaign/open_circuit.csv"],
}
COMMANDS = {
    "calibrate": ["calibrate", "campaign/open_circuit.csv"],
    "check": ["check", "campaign", "--against", "hsu2026-table2"],
    "audit": ["audit", "hsu2026-table2", "--physics"],
    "simulate": ["simulate", "campaign/r36ohm.csv", "--load-ohm", "36"],
    "compare": ["compare", "campaign", "campaign"],
}
"""Other commands with a page."""


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
    batch = run_batch(
        make_plan([str(root / "campaign")]), folder / "results", Products(("html",), beside=DIAGNOSIS_FILES)
    )
    made |= {name: batch.folder / f"{name}.html" for name in ("campaign", "index")}
    for name in ("rolloff", "outsider"):
        made[name] = folder / f"{name}.html"
        publish(diagnosis_report(diagnosed(name)), html=made[name])
    for name, arguments in COMMANDS.items():
        made[name] = folder / f"{name}.html"
        words = [str(root / word) if word.startswith("campaign") else word for word in arguments]
        words += ["--out", str(folder / "simulated.csv")] if name == "simulate" else []
        command_line(words[0])([*words, "--html", str(made[name])], standalone_mode=False)
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
@pytest.mark.parametrize("log", [*LOGS, "nasty", "rolloff", "outsider", "campaign", "index", *COMMANDS])
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


class Place:
    """A panel of a figure on the screen: positions of shares of its width and height, from its lower left corner."""

    def __init__(self, tab: Any, figure: str, panel: int = 0) -> None:
        self.figure, self.tab = tab.locator(f"#figure-{figure}"), tab
        self.marks = json.loads(self.figure.locator("script.marks").text_content())
        tab.evaluate("document.documentElement.style.scrollBehavior = 'auto'")
        svg = self.figure.locator("svg")
        svg.evaluate("(svg) => { svg.scrollIntoView({ block: 'start' }); scrollBy(0, -140); }")
        self.box, self.wide = svg.bounding_box(), svg.evaluate("(svg) => svg.viewBox.baseVal.width")
        self.panel = self.marks["panels"][panel]["box"]

    def at(self, across: float, up: float) -> tuple[float, float]:
        scale, (x, y, width, height) = self.box["width"] / self.wide, self.panel
        return self.box["x"] + scale * (x + across * width), self.box["y"] + scale * (y + (1.0 - up) * height)

    def drag(self, begin: tuple[float, float], end: tuple[float, float]) -> None:
        self.tab.mouse.move(*self.at(*begin))
        self.tab.mouse.down()
        self.tab.mouse.move(*self.at(*end), steps=4)
        self.tab.mouse.up()

    @property
    def ticks(self) -> list[list[float]]:
        """Ticks that are drawn for a zoomed figure: those of horizontal axes, and those of vertical ones."""
        texts = [self.figure.locator(css).all_text_contents() for css in (".tick-text:not(.level)", ".tick-text.level")]
        return [[float(text.replace("\u2212", "-")) for text in some] for some in texts]


def read_out(tab: Any) -> str:
    """What stands beside the pointer, nothing where that is hidden."""
    return tab.locator("#readout").inner_text() if tab.locator("#readout").is_visible() else ""


def test_the_chosen_cycle_fills_the_time_axis_and_its_values_are_read_out(browser: Any, pages: dict[str, Path]) -> None:
    tab, said, _ = opened(browser, pages["clean"], "desktop")
    tab.select_option("#span", index=2)
    place = Place(tab, "histories")
    seconds, _ = place.ticks
    tab.locator("figure.interactive .drawing").focus()
    for _ in range(30):
        tab.keyboard.press("ArrowRight")
    read = read_out(tab)
    tab.keyboard.press("Home")
    again = place.ticks
    tab.context.close()
    assert said == []
    assert min(seconds) >= 39.0  # the second cycle begins at 40.07 s
    assert max(seconds) <= 70.0
    assert "Line tension" in read
    assert "\u00a0N" in read
    assert again == [[], []]  # the whole log again, with the axes that were drawn


def test_values_stand_beside_the_pointer_within_the_screen(browser: Any, pages: dict[str, Path]) -> None:
    tab, said, _ = opened(browser, pages["clean"], "desktop")
    for figure, panel, name, unit in (
        ("histories", 2, "Line tension", "N"),
        ("streams", 0, "gen", "W"),
        ("budget", 0, "", "%"),
    ):
        place = Place(tab, figure, panel)
        point = place.at(0.5, 0.5)
        tab.mouse.move(*point)
        box, text = tab.locator("#readout").bounding_box(), read_out(tab)
        assert name in text, figure
        assert f"\u00a0{unit}" in text, figure
        assert 0 <= box["x"] <= 1366 - box["width"]
        assert 0 <= box["y"] <= 768 - box["height"]
        assert abs(box["y"] + box["height"] / 2 - point[1]) < 0.5 * box["height"] + 20
    tab.mouse.move(2, 2)
    hidden = read_out(tab)
    tab.context.close()
    assert said == []
    assert hidden == ""


def test_a_dragged_rectangle_zooms_both_axes_and_a_double_click_or_the_button_shows_all_again(
    browser: Any, pages: dict[str, Path]
) -> None:
    tab, said, _ = opened(browser, pages["clean"], "desktop")
    for figure, panel in (("histories", 1), ("streams", 1), ("model-generator", 1)):
        place = Place(tab, figure, panel)
        marks = place.marks["panels"][panel]
        place.drag((0.25, 0.3), (0.6, 0.8))
        zoomed = place.ticks
        for axis, ticks, low, high in zip("xy", zoomed, (0.25, 0.3), (0.6, 0.8), strict=True):
            a, b = marks[axis]["low"], marks[axis]["high"]
            slack = 0.02 * (b - a)
            assert ticks, (figure, axis)
            assert min(ticks) >= a + low * (b - a) - slack, (figure, axis)
            assert max(ticks) <= a + high * (b - a) + slack, (figure, axis)
        if figure == "streams":
            place.figure.get_by_text("Show all again").click()
        else:
            tab.mouse.dblclick(*place.at(0.4, 0.5))
        assert place.ticks == [[], []], figure
    tab.context.close()
    assert said == []


def test_the_wheel_zooms_with_a_key_alone(browser: Any, pages: dict[str, Path]) -> None:
    tab, said, _ = opened(browser, pages["clean"], "desktop")
    place = Place(tab, "streams")
    tab.mouse.move(*place.at(0.5, 0.5))
    counts = []
    for key in ("", "Shift", "Control"):
        if key:
            tab.keyboard.down(key)
        tab.mouse.wheel(0, -240)
        if key:
            tab.keyboard.up(key)
        tab.wait_for_timeout(100)
        counts.append([len(ticks) > 0 for ticks in place.ticks])
        if not key:
            place = Place(tab, "streams")
            tab.mouse.move(*place.at(0.5, 0.5))
    tab.context.close()
    assert said == []
    assert counts == [[False, False], [True, False], [True, True]]


def test_two_fingers_zoom_and_one_reads(browser: Any, pages: dict[str, Path]) -> None:
    tab, said, _ = opened(browser, pages["clean"], "phone")
    place = Place(tab, "streams")
    tab.touchscreen.tap(*place.at(0.3, 0.5))
    text = read_out(tab)
    touch = tab.context.new_cdp_session(tab)
    for kind, apart in (("Start", 0.05), ("Move", 0.1), ("Move", 0.2), ("End", 0.0)):
        ends = [place.at(0.4 - apart, 0.5 - apart), place.at(0.4 + apart, 0.5 + apart)] if apart else []
        points = [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(ends)]
        touch.send("Input.dispatchTouchEvent", {"type": f"touch{kind}", "touchPoints": points})
    across, up = place.ticks
    tab.context.close()
    assert said == []
    assert "W" in text
    assert across
    assert up


def test_a_legend_switches_its_series_off_and_on(browser: Any, pages: dict[str, Path]) -> None:
    tab, said, _ = opened(browser, pages["clean"], "desktop")
    figures = tab.locator("figure:has(script.marks)")
    switched = 0
    for k in range(figures.count()):
        name = figures.nth(k).get_attribute("id").removeprefix("figure-")
        place = Place(tab, name)
        for series in place.marks["series"]:
            parts = [tab.locator(f"[id='{name}-{one}']") for one in series["ids"]]
            key = tab.locator(f"[id='{name}-{series['keys'][1]}']").bounding_box()
            if key["y"] < 60 or key["y"] > 740:
                continue
            middle = key["x"] + key["width"] / 2, key["y"] + key["height"] / 2
            tab.mouse.click(*middle)
            assert [part.evaluate("(e) => e.style.display") for part in parts] == ["none"] * len(parts), (name, series)
            tab.mouse.click(*middle)
            assert [part.evaluate("(e) => e.style.display") for part in parts] == [""] * len(parts), (name, series)
            switched += 1
    box = tab.locator("#figure-streams .tools")
    box.locator("summary").click()
    box.get_by_label("Pgen").uncheck()
    left = Place(tab, "streams")
    tab.mouse.move(*left.at(0.5, 0.5))
    read = read_out(tab)
    tab.context.close()
    assert said == []
    assert switched > 15
    assert "Pgen" not in read.replace("\n", "")
    assert "Pline" in read.replace("\n", "")


def test_time_histories_of_a_folded_section_get_the_width_of_the_page_and_read_out(
    browser: Any, pages: dict[str, Path]
) -> None:
    tab, said, _ = opened(browser, pages["rolloff"], "desktop")
    tab.locator("#time-histories summary").click()
    plots = tab.locator("#time-histories .uplot")
    widths = [plots.nth(k).bounding_box()["width"] for k in range(plots.count())]
    room = tab.locator("#time-histories .histories").bounding_box()["width"]
    tab.locator("#time-histories .u-over").first.hover()
    read = tab.locator("#time-histories .u-value").all_text_contents()
    tab.context.close()
    assert said == []
    assert widths == pytest.approx([room] * 5, abs=1.0)
    assert len([value for value in read if value not in ("", "--")]) == 20


def test_links_lead_from_a_log_to_its_campaign_to_the_diagnosis_and_to_all_results(
    browser: Any, pages: dict[str, Path]
) -> None:
    tab, said, _ = opened(browser, pages["index"], "desktop")
    tab.get_by_role("link", name="r36ohm.csv").click()
    headings = [tab.inner_text("h1")]
    for name in ("Campaign", "All results", "Campaign"):
        tab.get_by_role("navigation").get_by_role("link", name=name, exact=True).click()
        headings.append(tab.inner_text(".kind"))
    diagnosis = tab.get_by_role("navigation").get_by_role("link", name="Diagnosis", exact=True).get_attribute("href")
    tab.get_by_role("link", name="r9ohm.csv").first.click()
    headings.append(tab.inner_text("h1"))
    of_a_log = tab.get_by_role("navigation").get_by_role("link", name="Diagnosis", exact=True).get_attribute("href")
    tab.context.close()
    assert said == []
    assert [text.lower() for text in headings] == ["r36ohm.csv", "campaign", "results", "campaign", "r9ohm.csv"]
    assert diagnosis == "diagnosis.html"
    assert of_a_log == "../diagnosis.html"


@pytest.mark.parametrize("screen", SCREENS)
def test_the_contents_stay_in_sight_and_mark_the_section_that_is_read(
    browser: Any, pages: dict[str, Path], screen: str
) -> None:
    tab, said, _ = opened(browser, pages["clean"], screen)
    tab.evaluate("document.documentElement.style.scrollBehavior = 'auto'")
    for entry in tab.locator("nav a").all():
        entry.evaluate("(link) => link.click()")
        tab.wait_for_timeout(150)
        hidden = tab.evaluate("document.querySelector('.top').getBoundingClientRect().bottom")
        box = entry.bounding_box()
        assert 0 <= box["y"] <= hidden - box["height"]
        assert tab.evaluate("document.querySelector(location.hash + ' h2').getBoundingClientRect().top") > hidden - 2
    current = tab.locator("nav a[aria-current]").count()
    tab.context.close()
    assert said == []
    assert current == 1


def test_the_first_screen_of_a_diagnosis_holds_verdict_tiles_and_waterfall(
    browser: Any, pages: dict[str, Path]
) -> None:
    tab, _, _ = opened(browser, pages["rolloff"], "desktop")
    ends = [tab.locator(part).bounding_box() for part in (".tiles", "#figure-waterfall .drawing")]
    tiles = tab.locator(".tiles li").count()
    tab.context.close()
    assert tiles == 3
    assert [box["y"] + box["height"] < 768 for box in ends] == [True, True]
