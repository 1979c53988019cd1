"""What the logs of a diagnosis cover: loads, speeds, currents and tensions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.rig_file import Thresholds
from winchcascade.diagnosis.diagnosis_result import Judgement
from winchcascade.diagnosis.explain.planned_run import usual
from winchcascade.diagnosis.fit.block_means import PAYOUT
from winchcascade.diagnosis.fit.covariance import voltage_of_a_load
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.diagnosis.stages.stage_map import convex_hull
from winchcascade.rig.effects.run_order import lasting_heat

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.diagnose import ModelDiagnosis


class Tested(msgspec.Struct, frozen=True):
    """What the logs of a diagnosis cover, SI units, and what a prediction beyond them begins from.

    `loads` are those of the runs but open circuits [ohm]. `border` are corners of the convex region
    of line speed and DC current in payout, (k, 2) [m/s, A]. `force` is the largest line tension.
    `speed`, `length` and `ramp` are those of a usual payout with a load: its fastest plateau, its
    travel and the time of its ramp. `warm` is the DC current (rms over a cycle) that keeps the
    machine as warm as in its warmest run, repeated at the spacing of the runs; None without
    heating. `u_load` is how well Vdc is known at one load beside that at all, as a share, by the
    discrepancy of the model. The `judgement` is that of the diagnosis. `thresholds` are those by
    which its logs are reduced; others follow the scales of a motion.
    """

    title: str
    rig: str
    judgement: Judgement
    loads: tuple[float, ...]
    border: tuple[tuple[float, float], ...]
    force: float
    speed: float
    length: float
    ramp: float
    warm: float | None = None
    u_load: float = 0.0
    thresholds: dict[str, float] = {}

    @property
    def rules(self) -> Thresholds:
        """The thresholds by which a motion has payouts and plateaus."""
        return msgspec.structs.replace(Thresholds(), **self.thresholds)

    def u_ratio(self, one: Sequence[float], other: Sequence[float]) -> float:
        """Standard uncertainty of the ratio of two powers at the DC link as a share, by the
        discrepancy that each load has of its own. [1]

        Between the loads of the logs it follows the logarithm of the load by straight lines.

        Parameters
        ----------
        one, other : load of each power, or loads of its schedule, which count alike [ohm]
        """
        at = np.log(self.loads)
        shares = [
            np.mean([np.interp(np.log(loads), at, own) for own in np.eye(at.size)], axis=1)
            for loads in (one, other)
        ]
        return 2.0 * self.u_load * float(np.linalg.norm(shares[0] - shares[1]))

    def covers(self, speed: Signal, current: Signal, force: Signal) -> NDArray[np.bool_]:
        """Whether speeds [m/s], DC currents [A] and tensions [N], (n,) each, lie within what was
        tested or `NEAR` of it, (n,).

        Nothing lies within a border that is a line.
        """
        corners = np.array(self.border)
        edges = np.roll(corners, -1, axis=0) - corners
        outward = np.column_stack([edges[:, 1], -edges[:, 0]])
        beyond = np.column_stack([speed, current]) @ outward.T - np.sum(corners * outward, axis=1)
        inside = np.all(beyond <= NEAR * np.abs(outward) @ np.ptp(corners, axis=0), axis=1) & (
            len(corners) > 2
        )
        return np.asarray(inside & (force <= (1.0 + NEAR) * self.force))


NEAR = 0.02
"""Distance from the border of what was tested that still counts as within, as a share of its
extent. [1]
"""


def tested_by(found: ModelDiagnosis) -> Tested | None:
    """What the logs of a diagnosis cover, of which withheld ones do not count; None where none
    has a payout.
    """
    data, seen = found.data, usual(found.data)
    if seen is None:
        return None
    logs = [data.logs[k] for k in data.taking]
    reached = [np.zeros((1, 2))]
    for log in logs:
        payout = log.course.blocks.phase == PAYOUT
        vdc, current = (log.measured[payout, CHANNELS.index(name)] for name in ("vdc", "idc"))
        v = log.course.blocks.mean(log.run.channels["velocity"])[payout]
        reached.append(np.column_stack([v, np.where(np.isnan(current), vdc / log.load, current)]))
    points, force = np.vstack(reached), [log.measured[:, CHANNELS.index("force")] for log in logs]
    border, _ = convex_hull(points[np.isfinite(points).all(axis=1)], np.zeros((0, 2)))
    loads = tuple(sorted({log.load for log in logs if math.isfinite(log.load)}))
    return Tested(
        title=found.title,
        rig=found.rig.name,
        judgement=found.judgement,
        loads=loads,
        border=tuple((float(x), float(y)) for x, y in border),
        force=float(np.fmax.reduce(np.concatenate(force), initial=0.0)),
        speed=max(seen.fastest_at(load) for load in loads or (math.inf,)),
        length=seen.length,
        ramp=seen.ramp,
        warm=_warm(found),
        u_load=voltage_of_a_load(data, found.found),
        thresholds={
            name: value
            for name, value in msgspec.structs.asdict(data.rig.thresholds).items()
            if isinstance(value, float) and math.isfinite(value)
        },
    )


def _warm(found: ModelDiagnosis) -> float | None:
    """The `warm` current of what was tested."""
    data, fit = found.data, found.found.best
    for effect in fit.effects(found.suspects):
        if effect.effect.name == WARMS and not data.order.temperature:
            squares = [
                np.mean(log.run.channels["idc"] ** 2)
                for log in data.logs
                if "idc" in log.run.channels
            ]
            heat = lasting_heat(data.order, *effect.values[2:])
            return math.sqrt(heat * float(np.mean(squares))) if squares else None
    return None


WARMS = "heating"
"""Effect by which a machine warms from run to run."""
