"""What a loss map states: the lost power over motion and load, its laws and how good they are."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from winchcascade.core.campaign_file import Origin
from winchcascade.diagnosis.stages.stage_map import LossMap, MappedLaw
from winchcascade.report.content import (
    PAIRS,
    Cell,
    Column,
    Link,
    Measured,
    Picture,
    Report,
    Section,
    Span,
    section,
    shown,
    table,
)
from winchcascade.report.figures.loss_map_figures import loss_figure
from winchcascade.report.glossary import upper
from winchcascade.report.results.common import data_note, provenance
from winchcascade.report.results.diagnosis_sentences import AXES
from winchcascade.report.wording import banner

LAWS: tuple[Column[MappedLaw], ...] = (
    Column("law", lambda one: one.name),
    Column("number", lambda one: Measured(one.number.value, _half(one))),
    Column(
        "95 % interval",
        lambda one: Span(one.number.low, one.number.high, _half(one)),
    ),
    Column("unit", lambda one: one.number.unit),
    Column("what it is", lambda one: one.label, brief=False),
    Column("or", lambda one: ", ".join(one.alternatives)),
)


def loss_map_section(found: LossMap) -> Section:
    """Heat map of the loss and of its band, laws and quality of a loss map."""
    motion, load = (AXES[name][0] for name in found.axes)
    labels = tuple(f"{upper(name)} ({unit})" for name, unit in (AXES[axis] for axis in found.axes))
    caption = f"Loss over {motion} and {load}: the sum of these laws. After `or`, laws that explain the points as well."
    return section(
        "loss-map", "Loss map",
        Picture(
            "loss-heat",
            f"Power lost from {found.path.into.name} to {found.path.out.name}, its 95 % band, and "
            f"the operating points; hatched: no data.",
            "Heat maps of the loss and its band with dots at the operating points; the laws are "
            "in the table.",
            partial(loss_figure, found, labels),
        ),
        table("loss-laws", caption, LAWS, found.laws),
        table("loss-quality", "Points of the loss map, and how the laws meet them.", PAIRS, _quality(found)),
    )  # fmt: skip


def campaign_loss_map_report(
    found: LossMap,
    title: str,
    origins: Sequence[Origin],
    links: Sequence[Link] = (),
    *,
    command: str = "",
) -> Report:
    """The loss map of a whole campaign as a report of its own."""
    names = [part.run.name for part in found.data.parts]
    return Report(
        kind="Loss map of a campaign",
        title=f"{title}: loss map of {len(names)} logs",
        points=[data_note(origins)],
        sections=[
            loss_map_section(found),
            provenance([("Logs", ", ".join(names))], command),
        ],
        banner=banner(origins),
        links=links,
    )


def _half(one: MappedLaw) -> float | None:
    """Half the width of an interval, which decides its digits; None for one that is not
    determined.
    """
    half = (one.number.high - one.number.low) / 2.0
    return half if math.isfinite(half) and half > 0.0 else None


def _quality(found: LossMap) -> list[tuple[str, Cell]]:
    """Number and range of the points, how much is lost, and how well the laws meet points that took
    no part in the fit.
    """
    parts = found.data.parts
    share = 100.0 * found.held_out / max(float(np.mean(np.abs(found.lost))), 1e-300)
    ranges = [
        (f"{upper(AXES[name][0])} ({AXES[name][1]})", Span(float(x.min()), float(x.max())))
        for name, x in zip(found.axes, found.points[:, :2].T, strict=True)
    ]
    return [
        ("Stages", f"{found.path.into.name} to {found.path.out.name}"),
        ("Points", f"{len(found.points)} of {len(parts)} log{'s' * (len(parts) > 1)}"),
        *ranges,
        ("Energy lost", f"{shown(found.energy)} J"),
        (
            "Held-out points, root mean square",
            f"{shown(found.held_out)} W, {share:.1f} % of the mean loss",
        ),
        *([("Table", "no value: the points lie on one line")] if len(found.hull) < 3 else []),
    ]
