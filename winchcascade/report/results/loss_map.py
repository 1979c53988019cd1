"""A loss map: what it states of the lost power over motion and load, its figure, and its files for
look-up tables, CSV, MATLAB or JSON.

Rows of the table follow the breakpoints of the load, columns those of the motion. Outside of the
hull of the points a cell of the table is NaN, in JSON null. The grid has a row for each cell, with
the uncertainty, and also where no data lie.
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from winchcascade.core.campaign_file import Origin
from winchcascade.core.files import check_ending, json_bytes, write_content
from winchcascade.core.matlab_file import matlab_bytes
from winchcascade.core.run import Signal
from winchcascade.core.version import GENERATOR
from winchcascade.diagnosis.judge.causes import COVERED
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
from winchcascade.report.figures.style import COLOURS, evenly, label_panel, panel_figure
from winchcascade.report.glossary import upper
from winchcascade.report.results.common import data_note, provenance
from winchcascade.report.results.diagnosis_sentences import AXES
from winchcascade.report.wording import banner

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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


DOTS = 1500
"""Points that are drawn at most; of more, an even selection."""

LEVELS = 12
"""Steps of colour at most."""

HEAT = ("#fff3d6", "#f2a65a", "#b8432f", "#4a1230")
"""Colours of a loss, from none to the largest."""


def loss_figure(found: LossMap, labels: Sequence[str]) -> Figure:
    """Loss, and half the width of its 95 % interval, with the points; hatched outside their
    hull.
    """
    from matplotlib.colors import LinearSegmentedColormap

    figure, panels = panel_figure(3.1, 1, 2, share="xy")
    heat_map = LinearSegmentedColormap.from_list("loss", HEAT)
    outside = np.where(found.inside, np.nan, 1.0)
    points = found.points[evenly(range(len(found.points)), DOTS), :2].T
    shown = (("a", "Loss (W)", found.loss), ("b", "95 % band, +- (W)", COVERED * found.u_loss))
    for ax, (letter, title, values) in zip(panels, shown, strict=True):
        if np.ptp(found.motion) > 0.0 and np.ptp(found.load) > 0.0:
            heat = ax.contourf(found.motion, found.load, values, LEVELS, cmap=heat_map)
            figure.colorbar(heat, ax=ax)
            ax.contourf(
                found.motion,
                found.load,
                outside,
                levels=[0.0, 2.0],
                colors="none",
                hatches=["////"],
            )
        ax.plot(*points, "o", ms=2.2, mew=0.4, mfc="none", mec=COLOURS["ink"])
        label_panel(ax, letter, title, x=labels[0])
    panels[0].set_ylabel(labels[1])
    return figure


SCHEMA = "winchcascade/loss_map/2"

ENDINGS = (".csv", ".mat", ".json")
"""Endings of the formats of a loss map."""

FIELDS = {
    "speed": "speed_rad_s", "torque": "torque_nm", "velocity": "velocity_m_s", "force": "force_n", "flow": "flow_m3_s",
    "pressure": "pressure_pa", "voltage": "voltage_v", "current": "current_a",
}  # fmt: skip
"""Names of the axes in files."""


def write_loss_map(found: LossMap, path: Path, source: str, *, force: bool = False) -> None:
    """Write a loss map in the format that the ending of the file names; beside a CSV its grid,
    `NAME_grid.csv`.

    Parameters
    ----------
    source : log or campaign that the map was made from

    Raises
    ------
    OptionError : an ending that names no format
    OutputError : the file cannot be written, or is not this tool's own and `force` does not allow
    to replace it
    """
    check_ending(path, ENDINGS, "--loss-map")
    record, ending = _record(found, source), path.suffix.casefold()
    if ending == ".csv":
        table, grid = _csv(record, found)
        write_content(path.with_name(f"{path.stem}_grid.csv"), grid, force=force)
        write_content(path, table, force=force)
    elif ending == ".mat":
        write_content(path, matlab_bytes("loss_map", record), force=force)
    else:
        write_content(
            path, json_bytes(msgspec.to_builtins(record, enc_hook=np.ndarray.tolist)), force=force
        )


def _record(found: LossMap, source: str) -> dict[str, Any]:
    """The map with the names of the interface."""
    motion, load = (FIELDS[name] for name in found.axes)
    rows, parts = found.data.rows, found.data.parts
    moves = rows.axes[:, 0] != 0.0
    x, y, power_in, power_out, stored, duration = found.points.T
    return {
        "schema": SCHEMA,
        "written_by": GENERATOR,
        "source": source,
        "stage_in": found.path.into.name,
        "stage_out": found.path.out.name,
        load: found.load,
        motion: found.motion,
        "loss_w": np.where(found.inside, found.loss, np.nan),
        "loss_standard_uncertainty_w": np.where(found.inside, found.u_loss, np.nan),
        "grid": {
            "loss_w": found.loss,
            "loss_standard_uncertainty_w": found.u_loss,
            "inside": found.inside * 1.0,
        },
        "hull": {motion: found.hull[:, 0], load: found.hull[:, 1]},
        "laws": {
            one.name.partition("(")[0]: {
                name: getattr(one.number, name) for name in ("value", "low", "high", "unit")
            }
            | {"alternatives": list(one.alternatives)}
            for one in found.laws
        },
        "held_out_w": found.held_out,
        "energy_lost_j": found.energy,
        "points": {
            "log": [parts[k].run.name for k in rows.part[moves]],
            load: y,
            motion: x,
            "power_in_w": power_in,
            "power_out_w": power_out,
            "stored_w": stored,
            "loss_w": found.lost,
            "duration_s": duration,
        },
    }


def _csv(record: dict[str, Any], found: LossMap) -> tuple[bytes, bytes]:
    """The table under its breakpoints of the motion, after lines of comment with source and laws;
    and the grid.
    """
    motion, load = (FIELDS[name] for name in found.axes)
    laws = ", ".join(
        f"{name} {one['value']:.6g} {one['unit']}" for name, one in record["laws"].items()
    )
    head = (
        f"# Loss map by {GENERATOR} from "
        f"{' '.join(str(record['source']).replace(',', ';').split())}\n"
        f"# loss in W from {record['stage_in']} to {record['stage_out']}\n"
        f"# laws: {laws or 'none'}\n"
    )
    x, y = np.meshgrid(found.motion, found.load)
    above = ",".join([f"{load}\\{motion}", *(f"{speed:.9g}" for speed in found.motion)])
    grid = [one.ravel() for one in (x, y, found.loss, found.u_loss, found.inside)]
    return (
        _written(
            f"{head}# rows: {load}, columns: {motion}\n{above}",
            np.column_stack([found.load, record["loss_w"]]),
        ),
        _written(
            f"{head}{motion},{load},loss_w,loss_standard_uncertainty_w,inside",
            np.column_stack(grid),
        ),
    )


def _written(header: str, rows: Signal) -> bytes:
    """Rows under a header as CSV."""
    file = io.BytesIO()
    np.savetxt(file, rows, fmt="%.9g", delimiter=",", header=header, comments="")
    return file.getvalue()
