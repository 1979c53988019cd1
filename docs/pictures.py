"""Draw the pictures of the documents from the shipped data.

`python docs/pictures.py [NAME ...]` writes docs/pictures/: the cascade, the terminal, the drawings
of `drawings.py`, figures that a command writes, and photographs of reports by Chromium, also of
those that the tutorial writes. `sources.json` holds the data behind each picture; a test compares
them with the present results.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Sequence
from functools import cache
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import drawings

ROOT = Path(__file__).parent.parent
PICTURES = Path(__file__).parent / "pictures"
SOURCES = PICTURES / "sources.json"
LOG = "fixtures/campaign/r36ohm.csv"
TABLE = "hsu2026-table2"

INK, SOFT, PAPER, FAINT = "#1b1e23", "#5c6470", "#ffffff", "#eef1f5"
STAGES = {"line": "#12355b", "mech": "#b8432f", "gen": "#2f8f7b"}

Source = Any
"""Data behind a picture, as JSON holds them."""


# ---------------------------------------------------------------------------------------- cascade
def cascade_source() -> Source:
    """Mean energies and efficiencies of a log, as they are printed."""
    from winchcascade import read_run, reduce

    mean = reduce(read_run(ROOT / LOG, load=36.0), window=5.48).mean
    energies = {stage: f"{mean[f'energy_{stage}']:.0f} J" for stage in STAGES}
    return energies | {name: f"{mean[name]:.3f}" for name in ("eta_trans", "eta_gen", "eta_pto")}


PARTS = (
    (16, 124, ("Crane or buoy", "pulls the tether")), (228, 134, ("Drum and", "restoring module")),
    (450, 134, ("Clutch, gear,", "generator")), (672, 112, ("Rectifier,", "DC link, load")),
)  # fmt: skip
"""Left edge and width of the boxes of the cascade, with their texts. [px]"""

PLACES = {
    "line": (184, "Line", "force × velocity"), "mech": (406, "PTO shaft", "torque × speed"),
    "gen": (628, "DC link", "Vdc × Idc"),
}  # fmt: skip
"""Where each energy is measured: centre [px], name, and what its power is the product of."""

RATIOS = (
    ("eta_trans", "line", "mech", 208),
    ("eta_gen", "mech", "gen", 208),
    ("eta_pto", "line", "gen", 244),
)
"""Efficiencies, the places that they compare, and the height of their brackets. [px]"""


def cascade(found: Source) -> str:
    """The energy cascade with the energies of one log."""
    lines = [
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 800 262" font-family="Helvetica, '
        'Arial, sans-serif" '
        'font-size="14">',
        "<title>Energy cascade of a winch-driven power take-off, with the energies of one "
        "simulated run</title>",
        f'<rect width="800" height="262" rx="8" fill="{PAPER}"/>',
        f'<line x1="30" y1="75" x2="720" y2="75" stroke="{SOFT}" stroke-width="3"/>',
    ]
    for x, width, texts in PARTS:
        lines.append(
            f'<rect x="{x}" y="46" width="{width}" height="58" rx="6" fill="{FAINT}" '
            f'stroke="{INK}"/>'
        )
        lines += [_text(x + width / 2, 70 + 19 * k, text, INK) for k, text in enumerate(texts)]
    for stage, (x, name, product) in PLACES.items():
        colour = STAGES[stage]
        lines += [
            f'<path d="M {x - 8} 67 l 16 8 l -16 8 z" fill="{colour}"/>',
            f'<line x1="{x}" y1="88" x2="{x}" y2="128" stroke="{colour}" stroke-dasharray="3 3"/>',
            _text(x, 34, name, colour, bold=True), _text(x, 148, f"E_{stage} = {found[stage]}", colour, bold=True),
            _text(x, 168, product, SOFT),
        ]  # fmt: skip
    for name, first, last, y in RATIOS:
        begin, end = PLACES[first][0] + 5, PLACES[last][0] - 5
        lines += [
            f'<path d="M {begin} {y - 26} v 6 H {end} v -6" fill="none" stroke="{SOFT}"/>',
            _text((begin + end) / 2, y - 4, f"{name.replace('eta', 'η')} = {found[name]}", INK),
        ]
    return "\n".join([*lines, "</svg>"]) + "\n"


def _text(x: float, y: float, text: str, colour: str, *, bold: bool = False) -> str:
    """A centred text; what follows an underscore in its first word is set low."""
    weight = ' font-weight="bold"' if bold else ""
    head, _, rest = text.partition(" = ")
    symbol, _, low = head.partition("_")
    shown = (
        f'{symbol}<tspan dy="4" font-size="10">{low}</tspan><tspan dy="-4"> = {rest}</tspan>'
        if low
        else escape(text)
    )
    return f'<text x="{x:g}" y="{y:g}" text-anchor="middle" fill="{colour}"{weight}>{shown}</text>'


# --------------------------------------------------------------------------------------- terminal
def terminal_source() -> Source:
    """What `winchcascade audit` prints in a terminal of 84 columns, with its colours."""
    from winchcascade.core.plain_text import lines
    from winchcascade.report.render.terminal import PIPE, Screen, painted, terminal_text, use_screen
    from winchcascade.report.results.audits import audit_report
    from winchcascade.tables.audit import audit

    use_screen(Screen(84, colour=True))
    try:
        printed = painted(terminal_text(audit_report(audit(TABLE))), lines)
    finally:
        use_screen(PIPE)
    return [f"$ winchcascade audit {TABLE}", *printed.rstrip("\n").split("\n")]


PLAIN = "#d7dce2"

COLOURS = {"32": "#4ec96b", "33": "#e0b341", "31": "#f2665c"}
"""Colours of a terminal by their codes."""

CODE = re.compile(r"\x1b\[([\d;]*)m")
"""What sets colour and weight of the text behind it, or takes both back."""

CELL, ROW = 7.83, 17
"""Width of a character and height of a line. [px]"""


def terminal(lines: Source) -> str:
    """Printed lines as they look in a terminal."""
    width, height = round(86 * CELL), ROW * len(lines) + 48
    drawn = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        'font-family="DejaVu Sans Mono, Menlo, Consolas, monospace" font-size="13">',
        "<title>What winchcascade audit prints in a terminal</title>",
        f'<rect width="{width}" height="{height}" rx="8" fill="#15181d"/>',
        *(f'<circle cx="{18 + 18 * k}" cy="15" r="5" fill="#3b414a"/>' for k in range(3)),
    ]
    for k, line in enumerate(lines):
        parts = _spans(line)
        if parts:
            place = f'x="{CELL:g}" y="{44 + ROW * k}" textLength="{len(CODE.sub("", line)) * CELL:.5g}" lengthAdjust="spacing"'
            drawn.append(f'<text {place} fill="{PLAIN}" xml:space="preserve">{parts}</text>')
    return "\n".join([*drawn, "</svg>"]) + "\n"


def _spans(line: str) -> str:
    """A line as escaped text, coloured and bold parts in elements of their own."""
    parts, style = [], ""
    for k, part in enumerate(CODE.split(line)):
        if k % 2:
            style = _style(part.split(";"))
        elif part:
            text = escape(part, quote=False)
            parts.append(f"<tspan{style}>{text}</tspan>" if style else text)
    return "".join(parts)


def _style(codes: list[str]) -> str:
    colours = [f' fill="{COLOURS[code]}"' for code in codes if code in COLOURS]
    return "".join([*colours, ' font-weight="bold"' if "1" in codes else ""])


# -------------------------------------------------------------------------- what a command writes
class Written(NamedTuple):
    """A picture that one command writes: the command, its record as JSON, the data taken of it,
    and the file of the picture.
    """

    command: str
    record: str
    data: Callable[[Any], Source]
    file: str


def diagnosed(record: Any) -> Source:
    """Numbers of each cause of a diagnosis, and the gap of each channel in its standard
    uncertainties.
    """
    causes = {
        f"{cause['effect']}.{name}": _rounded(parameter["value"])
        for cause in record["causes"]
        for name, parameter in cause["parameters"].items()
    }
    gaps = {
        f"{gap['channel']} {gap['phase']} {gap['load_ohm']}": _rounded(gap["z"])
        for gap in record["where"]["map"]
    }
    return {"causes": causes, "gaps": gaps}


def reduced(record: Any) -> Source:
    """Means of a reduced log."""
    return {name: _rounded(value) for name, value in record["mean"].items()}


def of_campaign(record: Any) -> Source:
    """Means of each log of a campaign."""
    return {run["name"]: reduced(run) for run in record["runs"]}


def mapped(record: Any) -> Source:
    """Numbers of the laws of a loss map."""
    return {name: _rounded(law["value"]) for name, law in record["laws"].items()}


def _rounded(value: float | None) -> str | None:
    return None if value is None else f"{value:.3g}"


def designed(record: Any) -> Source:
    """Power at each operating point, and which of them are flagged."""
    rows = record["rows"]
    return [
        f"{_rounded(row['p_gen_w']['value'])} {row['within_domain']} {row['over_limit']}"
        for row in rows
    ]


def at_sea(record: Any) -> Source:
    """Mean power of each sea."""
    return {
        f"{row['hs_m']:g} m, {row['tp_s']:g} s": _rounded(row["p_gen_w"]["value"])
        for row in record["rows"]
    }


LOG_FIGURES = f"winchcascade reduce {LOG} --json log.json --figures figures"
CAMPAIGN_PAGE = "winchcascade batch fixtures/campaign --out results"
DIAGNOSIS_FIGURES = (
    "winchcascade diagnose fixtures/campaign --html diagnosis.html --json diagnosis.json "
    "--figures figures"
)
DESIGN_FIGURES = (
    "winchcascade design fixtures/campaign --current-limit 11 --json design.json --figures figures"
)
SEA_FIGURES = (
    "winchcascade sea fixtures/campaign --hs 0.25,0.5,0.75,1 --tp 5,6,7,8,9,10 --load 9 --minutes "
    "5 --json sea.json "
    "--figures figures"
)
BENCH_FIGURES = (
    "winchcascade reduce dyno.csv --rig bench.toml --loss-map dyno_loss.json --figures figures"
)

WRITTEN = {
    "histories.svg": Written(LOG_FIGURES, "log.json", reduced, "figures/r36ohm_histories.svg"),
    "campaign.png": Written(
        CAMPAIGN_PAGE, "results/campaign.json", of_campaign, "results/campaign.html"
    ),
    "diagnosis.png": Written(DIAGNOSIS_FIGURES, "diagnosis.json", diagnosed, "diagnosis.html"),
    "report.png": Written(DIAGNOSIS_FIGURES, "diagnosis.json", diagnosed, "diagnosis.html"),
    "map.svg": Written(DIAGNOSIS_FIGURES, "diagnosis.json", diagnosed, "figures/diagnosis_map.svg"),
    "waterfall.svg": Written(
        DIAGNOSIS_FIGURES, "diagnosis.json", diagnosed, "figures/diagnosis_waterfall.svg"
    ),
    "design.svg": Written(DESIGN_FIGURES, "design.json", designed, "figures/design_map.svg"),
    "sea.svg": Written(SEA_FIGURES, "sea.json", at_sea, "figures/sea_power.svg"),
    "loss_map.svg": Written(BENCH_FIGURES, "dyno_loss.json", mapped, "figures/dyno_loss-heat.svg"),
}


class Followed(NamedTuple):
    """A photograph of a report that the tutorial writes: its file, the data taken of the folder in
    which the tutorial was followed, and the height of the photograph [px].
    """

    file: str
    data: Callable[[Path], Source]
    height: int


def recorded(file: str, data: Callable[[Any], Source]) -> Callable[[Path], Source]:
    """Data taken of a JSON file in a folder."""
    return lambda place: data(json.loads((place / file).read_text(encoding="utf-8")))


def calibrated(place: Path) -> Source:
    """Numbers of the calibrated rig file of the tutorial."""
    rig = tomllib.loads((place / "testday/calibrated.toml").read_text(encoding="utf-8"))
    return {
        key: _rounded(number["value"])
        for part in rig.values()
        if isinstance(part, dict)
        for key, number in part.items()
        if isinstance(number, dict) and "calibrated" in number
    }


TUTORIAL = ROOT / "docs" / "first_hour.md"

FOLLOWED = {
    "tutorial_log.png": Followed(
        "lauf2.html", recorded("results/runs/lauf2_40ohm.csv.json", reduced), 900
    ),
    "tutorial_calibration.png": Followed("calibration.html", calibrated, 900),
    "tutorial_campaign.png": Followed(
        "results/campaign.html", recorded("results/campaign.json", of_campaign), 900
    ),
    "tutorial_diagnosis.png": Followed(
        "results/diagnosis.html", recorded("diagnosis.json", diagnosed), 900
    ),
}


@cache
def tutorial() -> Path:
    """Folder in which the tutorial has been followed from its first to its last command."""
    sys.path.insert(0, str(ROOT / "tests"))
    import pages

    place = Path(tempfile.mkdtemp())
    pages.follow(TUTORIAL, pages.place_of(TUTORIAL, place))
    return place


@cache
def done(command: str) -> Path:
    """Folder with the shipped logs and the bench of the page on loss maps, in which a command
    has been run.
    """
    place = Path(tempfile.mkdtemp())
    shutil.copytree(ROOT / "fixtures", place / "fixtures")
    page = (ROOT / "docs" / "loss_map.md").read_text(encoding="utf-8")
    for name, text in re.findall(r"Save as `([^`]+)`[^\n]*\n\n```\w+\n(.*?)```", page, re.DOTALL):
        (place / name).write_text(text, encoding="utf-8")
    if "dyno.csv" in command:
        subprocess.run([sys.executable, "make_log.py"], cwd=place, check=True)
    called = [sys.executable, "-m", *command.split()]
    subprocess.run(called, cwd=place, check=True, capture_output=True)
    return place


def source_of(written: Written) -> Source:
    """The data behind a picture, from the record of its command."""
    return written.data(
        json.loads((done(written.command) / written.record).read_text(encoding="utf-8"))
    )


HEIGHTS = {"diagnosis.png": 540, "report.png": 1560}
"""Heights of photographs that show less or more of a page than the first screen. [px]"""


def drawing_of(name: str) -> str | bytes:
    """The picture that a command writes: a figure on white paper, or a photograph of a page."""
    file = done(WRITTEN[name].command) / WRITTEN[name].file
    if file.suffix == ".html":
        marks = MARKS if name == "report.png" else ()
        return photograph(file, height=HEIGHTS.get(name, 1200), marks=marks)
    svg = file.read_text(encoding="utf-8")
    svg = svg[svg.index("<svg") :]
    begin = svg.index(">") + 1
    return f'{svg[:begin]}<rect width="100%" height="100%" fill="{PAPER}"/>{svg[begin:]}'


Marks = Sequence[tuple[str, str]]
"""Numbers on a page, and the selector of the element that each stands at."""

MARKS: Marks = (
    ("1", "aside.banner"), ("2", "main header"), ("3", ".tiles li:nth-child(1)"), ("4", ".tiles li:nth-child(2)"),
    ("5", ".tiles li:nth-child(3)"), ("6", "#summary figure"), ("7", ".points"), ("8", "#causes"),
    ("9", "#next"), ("10", "#costs"), ("11", "details"), ("12", "nav ul"),
)  # fmt: skip
"""Places of the page of a diagnosis that the annotated report explains."""

BADGES = """
for (const [number, place] of MARKS) {
  const box = document.querySelector(place).getBoundingClientRect();
  const badge = document.createElement("b");
  badge.textContent = number;
  badge.style = `position:absolute;left:${Math.min(box.right - 13, innerWidth - 28)}px;top:${box.top + 4}px;` +
    "width:26px;line-height:26px;border-radius:13px;background:#b8432f;color:white;" +
    "text-align:center;font-size:15px;z-index:9";
  document.body.append(badge);
}
"""
"""Script that puts the numbers on a page before it is photographed."""

COLOURS_OF_A_PHOTOGRAPH = 128
"""Number of colours of a photograph: a page has few, and the file is a fourth of the size."""


def photograph(page: Path, *, height: int = 1200, marks: Marks = ()) -> bytes:
    """The first screen of a page, with numbers at some of its places."""
    from PIL import Image

    browser = next(
        filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
    )
    if browser is None:
        raise SystemExit(
            f"{page.name}: expected Chromium on the path; install it, or name the other pictures."
        )
    if marks:
        script = BADGES.replace("MARKS", json.dumps(list(marks)))
        text = page.read_text(encoding="utf-8")
        page = page.with_stem(f"{page.stem}_marked")
        page.write_text(
            text.replace("</body>", f"<script>{script}</script></body>"), encoding="utf-8"
        )
    picture = page.with_suffix(".png")
    subprocess.run(
        [browser, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", f"--window-size=1180,{height}",
         f"--screenshot={picture}", page.as_uri()],
        check=True, capture_output=True, timeout=120,
    )  # fmt: skip
    Image.open(picture).convert("RGB").quantize(COLOURS_OF_A_PHOTOGRAPH).save(
        picture, optimize=True
    )
    return picture.read_bytes()


DRAWN: dict[str, tuple[Callable[[], Source], Callable[[Source], str]]] = {
    "cascade.svg": (cascade_source, cascade),
    "terminal.svg": (terminal_source, terminal),
    **drawings.DRAWN,
}
"""Pictures that are drawn here: their data, and how they are drawn of them."""


NAMES = (*DRAWN, *WRITTEN, *FOLLOWED)


def data_of(name: str) -> Source:
    """The present data behind a picture."""
    if name in FOLLOWED:
        return FOLLOWED[name].data(tutorial())
    return source_of(WRITTEN[name]) if name in WRITTEN else DRAWN[name][0]()


def picture_of(name: str, data: Source) -> str | bytes:
    """A picture of some data."""
    if name in FOLLOWED:
        return photograph(tutorial() / FOLLOWED[name].file, height=FOLLOWED[name].height)
    if name in WRITTEN:
        return drawing_of(name)
    return DRAWN[name][1](data)


def draw(names: Sequence[str]) -> None:
    """Draw some pictures, and store the data behind them."""
    stored = json.loads(SOURCES.read_text(encoding="utf-8"))
    for name in names:
        stored[name] = data_of(name)
        content = picture_of(name, stored[name])
        (PICTURES / name).write_bytes(content.encode() if isinstance(content, str) else content)
    kept = {name: stored[name] for name in sorted(NAMES) if name in stored}
    SOURCES.write_text(f"{json.dumps(kept, indent=1, ensure_ascii=False)}\n", encoding="utf-8")


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    draw(sys.argv[1:] or NAMES)
