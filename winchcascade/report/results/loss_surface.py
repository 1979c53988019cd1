"""What a loss map states: the lost power over torque and speed, its coefficients and how good they are."""

from __future__ import annotations

import math
from collections.abc import Sequence

from winchcascade.core.campaign_file import Origin, banner
from winchcascade.core.run import Signal
from winchcascade.reduction.loss_map import Coefficient, LossMap
from winchcascade.report.content import (
    PAIRS,
    Cell,
    Column,
    Link,
    Measured,
    Note,
    Picture,
    Report,
    Section,
    Span,
    known,
    picture,
    section,
    shown,
    table,
)
from winchcascade.report.results.common import data_note, provenance

COLUMN_WORDS = {
    "speed": "speed",
    "speed_squared": "speed^2",
    "torque_squared": "torque^2",
    "torque": "|torque|",
    "speed_times_torque": "speed x torque",
}
"""Columns of the surface, in words."""

MEANING = {
    "speed": "friction that does not depend on speed",
    "speed_squared": "viscous friction, iron",
    "torque_squared": "copper",
    "torque": "diodes",
    "speed_times_torque": "share of the power, as in a gear mesh",
}
"""Losses that follow these columns."""

COEFFICIENTS: tuple[Column[Coefficient], ...] = (
    Column("loss over", lambda c: COLUMN_WORDS[c.term]),
    Column("coefficient", lambda c: Measured(c.value, _half(c)), own_digits=True),
    Column("95 % interval", lambda c: _interval(c), own_digits=True),
    Column("unit", lambda c: c.unit),
    Column("such as", lambda c: MEANING[c.term], brief=False),
)
"""Coefficients of the surface."""


def loss_map_section(found: LossMap, drawn: Sequence[Picture | None] = ()) -> Section:
    """Coefficients and quality of a loss map; `drawn` are the figures of `loss_map_pictures`."""
    caption = (
        "Surface of the loss over torque and speed of the shaft: the sum of these columns times their coefficients."
    )
    return section(
        "loss-map", "Loss map", *drawn,
        table("loss-coefficients", caption, COEFFICIENTS, found.surface.coefficients),
        table("loss-quality", "Points of the loss map, and how the surface meets them.", PAIRS, _quality(found)),
    )  # fmt: skip


def loss_map_pictures(found: LossMap) -> list[Picture | None]:
    """Heat map and efficiencies as blocks. Called within the style of figures."""
    from winchcascade.report.figures.loss_map_figures import efficiency_figure, loss_figure

    into, out = found.points.stages
    return [
        picture(
            loss_figure(found), "loss-heat",
            f"Power lost from {into} to {out}, and the operating points; beyond them the map has no value.",
            "Heat map of the fitted loss with dots at the operating points; the coefficients are in the table.",
        ),
        picture(
            efficiency_figure(found.points), "loss-efficiency",
            f"Efficiency from {into} to {out} without stored energy; dashed: constant power of the shaft.",
            "Dots over speed and torque, coloured by efficiency, with lines of constant power.",
        ),
    ]  # fmt: skip


def campaign_loss_map_report(
    found: LossMap,
    title: str,
    origins: Sequence[Origin],
    drawn: Sequence[Picture | None] = (),
    links: Sequence[Link] = (),
    *,
    left_out: Sequence[str] = (),
    command: str = "",
) -> Report:
    """The loss map of a whole campaign as a report of its own.

    Parameters
    ----------
    left_out : sentences on logs without operating points
    """
    reasons = [Note(reason, "Left out", "warn") for reason in left_out]
    return Report(
        kind="Loss map of a campaign",
        title=f"{title}: loss map of {len(found.points.logs)} logs",
        points=[data_note(origins), *reasons],
        sections=[loss_map_section(found, drawn), provenance([("Logs", ", ".join(found.points.logs))], command)],
        banner=banner(origins),
        links=links,
    )


def _half(c: Coefficient) -> float | None:
    """Half the distance of a coefficient from an end of its interval, which decides its digits; None for none."""
    if c.value is None or c.low is None:
        return None
    half = (c.value - c.low) / 2.0
    return half if known(half) and half > 0.0 else None


def _interval(c: Coefficient) -> Cell:
    if c.value is None:
        return "not distinguished"
    return "unknown" if c.low is None else Span(c.low, c.high, _half(c))


def _quality(found: LossMap) -> list[tuple[str, Cell]]:
    """Number and range of the points, where the energy went, how well the surface meets them, and what is left out."""
    points, surface, mean = found.points, found.surface, float(abs(found.points.loss).mean())
    lost = Measured(found.energy, found.u_energy, both=True)
    held = surface.held_out
    contained: dict[tuple[str, ...], list[str]] = {}
    for c in surface.coefficients:
        if c.value is None:
            contained.setdefault(c.contained_in, []).append(COLUMN_WORDS[c.term])
    rows: list[tuple[str, Cell]] = [
        ("Stages", " to ".join(points.stages)),
        ("Points", points.loss.size),
        ("Logs", len(points.logs)),
        ("Torque", f"{_range(points.torque)} N.m"),
        ("Speed of the shaft", f"{_range(points.speed)} rad/s"),
        ("Energy lost", f"{shown(lost)} J" + ("" if math.isfinite(found.u_energy) else ", uncertainty unknown")),
        ("Residual, root mean square", f"{shown(surface.residual)} W"),
        (
            "Held-out points",
            "too few"
            if held is None
            else f"{shown(held)} W, {100.0 * held / mean:.1f} % of the mean loss, by {surface.held_out_by}",
        ),
        ("Condition number", surface.condition),
        ("Condition number of all five columns", surface.condition_all),
        ("Degrees of freedom", surface.freedom),
    ]
    for others, names in contained.items():
        alike = " and ".join(COLUMN_WORDS[name] for name in others)
        rows.append(("Not distinguished" + (f" from {alike}" if others else ""), ", ".join(names)))
    rows += [(f"Points left out, {reason}", count) for reason, count in points.left_out.items()]
    return rows + ([("Table", "no value: the points lie on one line")] if len(found.hull) < 3 else [])


def _range(x: Signal) -> str:
    return f"{shown(float(x.min()))} to {shown(float(x.max()))}"
