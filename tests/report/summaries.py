"""Logs of a campaign as its record knows them, without a campaign."""

from typing import Any

import msgspec

from winchcascade.reduction.campaign_record import LogSummary
from winchcascade.reduction.efficiency import FIELDS


def run(
    name: str,
    load: float | None = None,
    eta: float | None = None,
    u: float | None = None,
    **more: Any,
) -> LogSummary:
    """A log of a summary that knows its efficiency, and a power that is the same for all."""
    nothing: dict[str, Any] = dict.fromkeys(FIELDS.values())
    power = {"power_gen_w": 500.0}
    interval = None if eta is None or u is None else [eta - 2 * u, eta + 2 * u]
    record: dict[str, Any] = {
        "name": name, "log": name, "fault": None, "result": f"runs/{name}.json", "load_ohm": load, "open_circuit": False,
        "plateau_speed_mps": 0.86,
        "table": None, "simulated": None, "rig": "ours", "cycles": 3, "complete": 3, "findings": [], "finding_count": 0,
        "removed_share": 0.0,
        "mean": nothing | power | {"eta_pto": eta}, "standard_uncertainty": nothing | {"eta_pto": u},
        "interval_95": nothing | {"eta_pto": interval}, "max_deviation_percent": nothing, "window": "auto",
        "data": {"measured": None, "origin": None},
    }  # fmt: skip
    return msgspec.convert(record | more, LogSummary)
