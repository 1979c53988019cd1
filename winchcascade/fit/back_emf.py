"""The back-EMF constant of an open circuit, with what the rig file leaves open of the machine and of its DC link."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec

from winchcascade.fit.nuisances import nuisances, sensor_errors, shifted
from winchcascade.rig.backemf import COVERED, BackEmf, back_emf
from winchcascade.rig.model import baseline

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.rigfile import Rig
    from winchcascade.run import Run


def back_emf_of(run: Run, rig: Rig, payouts: Sequence[tuple[float, float]]) -> BackEmf:
    """The regression of the back-EMF, its uncertainties with what the rig file leaves open of machine and DC link.

    The capacitor above all: on a ramp it takes a current whose drop in the bridge looks like a lag of Vdc.

    Raises
    ------
    LogError : no Vdc, or too few samples above 1000 rpm with a conducting bridge
    """
    gain, _ = sensor_errors(rig.sensors.get("vdc"))
    found = back_emf(run, baseline(rig), payouts, u_gain=gain)
    k_e = lag = 0.0
    for n in nuisances(rig, [run]):
        if n.kind == "rig" and n.section in ("generator", "dc_link") and n.name != "k_e":
            moved = back_emf(run, baseline(shifted(rig, {(n.section, n.name): n.sd})), payouts)
            k_e, lag = math.hypot(k_e, moved.k_e - found.k_e), math.hypot(lag, moved.lag - found.lag)
    u = math.hypot(found.u_fit, found.u_sensor, k_e)
    return msgspec.structs.replace(
        found, low=found.k_e - COVERED * u, high=found.k_e + COVERED * u, u_lag=math.hypot(found.u_lag, lag)
    )
