"""A calibration as JSON, schema `winchcascade/calibration/1`."""

from __future__ import annotations

from winchcascade.core.campaign_file import origin_record
from winchcascade.core.version import __version__
from winchcascade.diagnosis.calibrate import Calibration

SCHEMA = "winchcascade/calibration/1"

NUMBER = ("section", "name", "unit", "before", "u_before", "value", "low", "high", "u", "how", "new")
"""Fields of a number; one that the rig file does not state is not finite, which JSON has as null."""


def calibration_record(calibration: Calibration) -> dict[str, object]:
    """The calibration as nested records, numbers in their `unit`."""
    run, regression = calibration.run, calibration.regression
    return {
        "schema": SCHEMA,
        "version": __version__,
        "data": origin_record(run.origin),
        "log": {"path": run.path, "sha256": run.sha256, "samples": run.samples},
        "rig": calibration.rig.name,
        "numbers": [{name: getattr(number, name) for name in NUMBER} for number in calibration.numbers],
        "regression": {
            **{name: getattr(regression, name) for name in ("k_e", "low", "high", "r2")},
            "samples": int(regression.rpm.size),
            "eq8": regression.eq8,
            "lag_s": regression.lag,
            "u_lag_s": regression.u_lag,
        },
        "together": list(calibration.together),
        "misfit": calibration.misfit,
        "settled": calibration.settled,
        "strained": [{"name": strain.name, "tolerances": strain.by} for strain in calibration.strained],
    }
