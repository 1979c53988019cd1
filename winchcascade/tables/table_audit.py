"""Audit of a published table of either kind in one call: by load, with the physics of a rig, or of operating points."""

from __future__ import annotations

from pathlib import Path

import msgspec

from winchcascade.core.errors import OptionError
from winchcascade.core.jobs import Watch
from winchcascade.core.published_table import PublishedTable
from winchcascade.core.rig_file import Rig
from winchcascade.tables.attainable import AttainableRanges
from winchcascade.tables.audit import Audit, audit_by_load
from winchcascade.tables.point_audit import PointAudit, audit_points
from winchcascade.tables.point_table import PointTable, open_table


def audit(
    table: PublishedTable | PointTable | str | Path,
    *,
    physics: bool = False,
    rig: Rig | str | Path | None = None,
    watch: Watch | None = None,
) -> Audit | PointAudit:
    """Check a published table and its text for contradictions, without any log.

    Parameters
    ----------
    table : a table by load or of operating points, its file, or the name of a built-in table
    physics : also compare a table by load with the model of a rig; the result is the field `physics`
    rig : of that comparison: a rig, its file, or the name of a built-in one; that of the paper if not given
    watch : called with the progress of that comparison

    Raises
    ------
    TableError : the table cannot be used
    OptionError : `physics` with a table of operating points, or a rig without `physics`
    """
    if rig is not None and not physics:
        name = rig.name if isinstance(rig, Rig) else rig
        raise OptionError(f"rig {name}: is of use with physics alone; add that, or leave the rig out.")
    opened = open_table(table) if isinstance(table, str | Path) else table
    if isinstance(opened, PublishedTable):
        found = audit_by_load(opened)
        return msgspec.structs.replace(found, physics=_physics(found, rig, watch)) if physics else found
    if physics:
        name = opened.path or opened.name
        raise OptionError(f"physics: {name} is a table of operating points; expected one of loads; leave physics out.")
    return audit_points(opened)


def _physics(found: Audit, rig: Rig | str | Path | None, watch: Watch | None) -> AttainableRanges:
    """What a rig can attain of the efficiencies of a table."""
    from winchcascade.core.rig_toml import DEFAULT_RIG
    from winchcascade.reduction.reduce import first_metrics
    from winchcascade.rig.effects.catalogue import OF_THE_RIG
    from winchcascade.rig.open_rig import load_rig
    from winchcascade.tables.attainable import attainable_ranges

    of = rig if isinstance(rig, Rig) else load_rig(rig or DEFAULT_RIG)
    return attainable_ranges(
        found.table, of, OF_THE_RIG, lambda run, window: first_metrics(run, of, window), scatter=found.known.eta, watch=watch
    )  # fmt: skip
