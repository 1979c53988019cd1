"""Drawings of the documents that no command writes: one cycle with its phases, and the rig with
the names of its numbers. `pictures.py` stores and compares the data behind them.
"""

from collections.abc import Callable, Iterable
from html import escape
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
LOG = "fixtures/campaign/r36ohm.csv"

INK, SOFT, PAPER, FAINT = "#1b1e23", "#5c6470", "#ffffff", "#eef1f5"
PHASES = {"payout": "#dbe7f3", "hold": "#eef1f5", "haul_in": "#f6e4dd"}
LINE, WINDOW = "#12355b", "#2f8f7b"

Source = Any
"""Data behind a drawing, as JSON holds them."""


def svg(width: int, height: int, title: str, parts: Iterable[str]) -> str:
    """A drawing on white paper."""
    return "\n".join([
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        'font-family="Helvetica, Arial, sans-serif" font-size="13">',
        f"<title>{escape(title)}</title>",
        f'<rect width="{width}" height="{height}" rx="8" fill="{PAPER}"/>',
        *parts,
        "</svg>\n",
    ])  # fmt: skip


def text(
    x: float, y: float, words: str, colour: str = INK, *, anchor: str = "middle", bold: bool = False
) -> str:
    """A line of text about a point."""
    weight = ' font-weight="bold"' if bold else ""
    place = f'x="{x:.4g}" y="{y:.4g}" text-anchor="{anchor}"'
    return f'<text {place} fill="{colour}"{weight}>{escape(words)}</text>'


# ------------------------------------------------------------------------------------------ cycle
def cycle_source() -> Source:
    """Velocity and phases of the first cycle of a log."""
    from winchcascade import read_run, reduce

    run = read_run(ROOT / LOG, load=36.0)
    first, second = reduce(run, window=5.48).cycles[:2]
    begin, end = first.window.onset - 3.0, second.window.onset
    here = (run.t >= begin) & (run.t <= end)
    plateau = first.summary.payout.plateau
    return {
        "t": [round(float(t - begin), 2) for t in run.t[here]][::4],
        "v": [round(float(v), 3) for v in run.channels["velocity"][here]][::4],
        "phases": {
            "payout": [round(t - begin, 2) for t in (first.window.onset, first.phases.payout_end)],
            "hold": [round(t - begin, 2) for t in first.phases.hold],
            "haul_in": [round(t - begin, 2) for t in first.phases.haul_in],
        },
        "plateau": [round(plateau.begin - begin, 2), round(plateau.braking - begin, 2)],
        "speed": round(plateau.speed, 3),
        "cutoff": round(first.window.cutoff - begin, 2),
        "next": round(end - begin, 2),
    }


def cycle(found: Source) -> str:
    """The line velocity over one cycle, with the names of its parts."""
    left, top, width, height = 62, 46, 708, 190
    low, high = min(found["v"]) - 0.1, max(found["v"]) + 0.1

    def x(t: float) -> float:
        return left + width * t / found["next"]

    def y(v: float) -> float:
        return top + height * (high - v) / (high - low)

    parts = []
    for phase, (begin, end) in found["phases"].items():
        parts += [
            f'<rect x="{x(begin):.4g}" y="{top}" width="{x(end) - x(begin):.4g}" '
            f'height="{height}" fill="{PHASES[phase]}"/>',
            text((x(begin) + x(end)) / 2, top + height + 20, phase.replace("_", "-"), bold=True),
        ]
    onset = found["phases"]["payout"][0]
    course = " ".join(f"{x(t):.1f},{y(v):.1f}" for t, v in zip(found["t"], found["v"], strict=True))
    parts += [
        f'<line x1="{left}" y1="{y(0):.4g}" x2="{left + width}" y2="{y(0):.4g}" stroke="{SOFT}"/>',
        f'<polyline points="{course}" fill="none" stroke="{LINE}" stroke-width="2"/>',
        *(text(left - 8, y(v) + 4, f"{v:g}", SOFT, anchor="end") for v in (-1, -0.5, 0, 0.5)),
        text(left - 8, 24, "v (m/s)", SOFT, anchor="end"),
        *_span(x(onset), x(found["cutoff"]), 36, "integration window", WINDOW),
        *_span(*map(x, found["plateau"]), y(found["speed"]) + 26, "plateau", INK),
        *_span(x(onset), x(found["next"]), top + height + 44, "whole cycle: onset to onset", SOFT),
        text(x(onset) - 5, y(0) - 8, "onset", INK, anchor="end"),
    ]
    return svg(800, 316, "Line velocity over one cycle of a simulated run", parts)


def _span(begin: float, end: float, y: float, name: str, colour: str) -> list[str]:
    """A line between two instants with ticks at both and its name below or above it."""
    above = y < 40
    return [
        f'<path d="M {begin:.4g} {y - 5:.4g} v 10 M {begin:.4g} {y:.4g} H {end:.4g} m 0 -5 v 10" '
        f'fill="none" stroke="{colour}" stroke-width="1.5"/>',
        text((begin + end) / 2, y - 8 if above else y + 18, name, colour),
    ]


# -------------------------------------------------------------------------------- numbers of a rig
BOXES = {
    "winch": (16, 60, "Drum", "displacement, velocity, force"),
    "restoring": (16, 232, "Restoring module", "pressure"),
    "drivetrain": (214, 60, "PTO shaft, clutch, gear", "torque"),
    "generator": (412, 60, "Generator and bridge", "speed"),
    "dc_link": (610, 60, "DC link", "vdc, idc"),
}
"""Table of the rig file: place of its box [px], name of the part, channels that a log has of it."""

BOX = 174
"""Width of a box. [px]"""


def rig_source() -> Source:
    """Numbers of each part of a rig file that a diagnosis uses."""
    from winchcascade.core.rig_file import PARTS, measures

    return {name: list(measures(PARTS[name])) for name in BOXES}


def rig(numbers: Source) -> str:
    """The parts of a rig with the keys of its numbers in the rig file, and the channels of a
    log.
    """
    parts = [
        f'<path d="M 190 84 H 610 M 150 84 V 240" stroke="{SOFT}" stroke-width="3"/>',
        text(16, 28, "In bold: table of the rig file, with its keys. Green: channels of the log.",
             SOFT, anchor="start"),
    ]  # fmt: skip
    for name, (x, y, part, channels) in BOXES.items():
        rows = numbers[name]
        parts += [
            f'<rect x="{x}" y="{y}" width="{BOX}" height="{52 + 17 * len(rows)}" rx="6" '
            f'fill="{FAINT}" stroke="{INK}"/>',
            text(x + 10, y + 20, part, anchor="start"),
            text(x + 10, y + 40, f"[{name}]", LINE, anchor="start", bold=True),
            *(text(x + 10, y + 58 + 17 * k, key, anchor="start") for k, key in enumerate(rows)),
            text(x + 10, y - 8, channels, WINDOW, anchor="start"),
        ]
    bottom = max(y + 52 + 17 * len(numbers[name]) for name, (_, y, *_) in BOXES.items())
    return svg(800, bottom + 16, "Parts of a rig and the names of their numbers", parts)


DRAWN: dict[str, tuple[Callable[[], Source], Callable[[Source], str]]] = {
    "cycle.svg": (cycle_source, cycle),
    "rig_numbers.svg": (rig_source, rig),
}
"""Drawings: their data, and how they are drawn of them."""
