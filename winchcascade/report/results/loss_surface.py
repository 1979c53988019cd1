"""What a loss map states: the lost power over torque and speed, its coefficients and how good they are."""

from __future__ import annotations

import math
from collections.abc import Sequence

from winchcascade.core.campaign_file import Origin
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
from winchcascade.report.wording import banner

TERMS = {
    "speed": ("speed", "friction that does not depend on speed"),
    "speed_squared": ("speed^2", "viscous friction, iron"),
    "torque_squared": ("torque^2", "copper"),
    "torque": ("|torque|", "diodes"),
    "speed_times_torque": ("speed x torque", "share of the power, as in a gear mesh"),
}
"""Columns of the surface in words, and losses that follow them."""

COEFFICIENTS: tuple[Column[Coefficient], ...] = (
    Column("loss over", lambda c: TERMS[c.term][0]),
    Column("coefficient", lambda c: Measured(c.value, _half(c)), own_digits=True),
    Column("95 % interval", lambda c: _interval(c), own_digits=True),
    Column("unit", lambda c: c.unit),
    Column("such as", lambda c: TERMS[c.term][1], brief=False),
)


def loss_map_section(found: LossMap, drawn: Sequence[Picture | None] = ()) -> Section:
    """Coefficients and quality of a loss map; `drawn` are the figures of `loss_map_pictures`."""
    caption = "Loss over torque and speed of the shaft: the sum of these columns times their coefficients."
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
    points, surface, held = found.points, found.surface, found.surface.held_out
    lost = Measured(found.energy, found.u_energy, both=True)
    share = 0.0 if held is None else 100.0 * held / float(abs(points.loss).mean())
    contained: dict[str, list[str]] = {}
    for c in surface.coefficients:
        if c.value is None:
            others = " and ".join(TERMS[name][0] for name in c.contained_in)
            contained.setdefault(f"Not distinguished{' from ' * bool(others)}{others}", []).append(TERMS[c.term][0])
    return [
        ("Stages", " to ".join(points.stages)),
        ("Points", f"{points.loss.size} of {len(points.logs)} log{'s' * (len(points.logs) > 1)}"),
        ("Torque (N.m)", Span(float(points.torque.min()), float(points.torque.max()))),
        ("Speed of the shaft (rad/s)", Span(float(points.speed.min()), float(points.speed.max()))),
        ("Energy lost", f"{shown(lost)} J" + ("" if math.isfinite(found.u_energy) else ", uncertainty unknown")),
        ("Residual, root mean square (W)", surface.residual),
        (
            "Held-out points",
            "too few" if held is None else f"{shown(held)} W, {share:.1f} % of the mean loss, by {surface.held_out_by}",
        ),
        ("Condition number, of all five columns", f"{shown(surface.condition)}, {shown(surface.condition_all)}"),
        ("Degrees of freedom", surface.freedom),
        *((others, ", ".join(names)) for others, names in contained.items()),
        *((f"Points left out, {reason}", count) for reason, count in points.left_out.items()),
        *([("Table", "no value: the points lie on one line")] if len(found.hull) < 3 else []),
    ]  # fmt: skip
