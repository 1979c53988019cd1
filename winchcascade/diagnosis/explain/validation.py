"""Validation of a model by its logs in the words of ASME V&V 20-2009: comparison error, its
uncertainties, model error.

The comparison error E = S - D is what a simulation S deviates from the reduced data D. With the
uncertainties of the numerical solution, of the inputs of the model and of the data, u_val^2 =
u_num^2 + u_input^2 + u_D^2, the error of the model lies in E - k u_val to E + k u_val; k is 1.96
for 95 %.

Errors of sensors that the diagnosis found belong to the data: D is corrected by them, and their
uncertainty is a part of u_D in place of the accuracies of these sensors. S contains none.
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np

from winchcascade.core.jobs import all_at_once
from winchcascade.diagnosis.explain.contributions import INPUTS, MOVED
from winchcascade.diagnosis.explain.windowed import QUANTITIES, WindowedLog, quantities_of
from winchcascade.diagnosis.fit.covariance import predictive_covariance
from winchcascade.diagnosis.fit.nuisances import SKEW
from winchcascade.diagnosis.fit.predict import CHANNELS, without_sensors
from winchcascade.diagnosis.fit.suspects import varied
from winchcascade.diagnosis.judge.causes import COVERED
from winchcascade.reduction.efficiency import METRICS
from winchcascade.reduction.uncertainty import budget

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from winchcascade.core.accuracy import ErrorSource
    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.fit.evidence import Fit
    from winchcascade.diagnosis.fit.misfit import Fitted
    from winchcascade.diagnosis.fit.search import Found
    from winchcascade.rig.effects.effect import ActiveEffect


class Compared(msgspec.Struct, frozen=True):
    """A simulation S of one quantity, the uncertainty of its inputs, the validation uncertainty,
    the comparison error E = S - D, and the ends `low` and `high` of the 95 % interval of the model
    error.
    """

    simulated: float
    u_input: float
    u_val: float
    error: float
    low: float
    high: float


class Validated(msgspec.Struct, frozen=True):
    """One quantity of one run, a mean over its integration windows: `measured` D with its
    uncertainty `u_d`, that of the numerical solution `u_num`, its change where the step is 2.5
    times as long, and the simulations: `before` by the rig file within its tolerances, `after` by
    the corrected rig, of a fit without the logs of this load where it is `held_out`; None without a
    cause. `speed` is the mean of the plateaus, None without one. SI units.
    """

    log: int
    load: float | None
    speed: float | None
    quantity: str
    measured: float
    u_d: float
    u_num: float
    before: Compared
    after: Compared | None
    held_out: bool

    @property
    def worse(self) -> bool:
        """Whether the corrected rig deviates from the data by more than that of the rig file,
        beyond the uncertainty.
        """
        after = self.after
        return after is not None and after.error**2 - self.before.error**2 > after.u_val**2


def validation_of(
    data: Fitted,
    found: Found,
    held_out: Mapping[int, Fit],
    inputs: Signal,
    logs: Sequence[WindowedLog],
) -> tuple[Validated, ...]:
    """Compare every metric of every run with the model of the rig file and with the corrected one.

    Parameters
    ----------
    held_out : by number of a log, the fit without the logs of its load
    inputs : (L, 2, 14) standard uncertainty of each of `QUANTITIES` of each run by the inputs of
        the model, within the tolerances of the rig file and as the fit leaves them, SI units
    logs : all of them with their windows
    """
    sensors = {name for name in found.best.names if found.problem.suspects[name].of_a_sensor}
    covariance = predictive_covariance(data, found) if sensors else None

    def of_run(one: WindowedLog) -> list[Validated]:
        fit = held_out.get(one.number)
        read = _read(data, found, fit or found.best, one, covariance)
        return _of_run(data, found, fit, one, inputs[one.number], read)

    jobs = [partial(of_run, one) for one in logs]
    return tuple(one for own in all_at_once(jobs, data.sizes) for one in own)


class Read(NamedTuple):
    """Quantities of a log without the errors of its sensors that are known, (14,), the standard
    uncertainty of this correction, (14,), and the channels with the parts of their errors that it
    takes the place of.
    """

    quantities: Signal
    u: Signal
    parts: frozenset[tuple[str, str]]


def _read(
    data: Fitted, found: Found, fit: Fit, one: WindowedLog, covariance: Signal | None
) -> Read:
    """What a log gives without the errors of its sensors that a fit found, and that the rig file
    states.

    Parameters
    ----------
    covariance : (p + n, p + n) of the fields of the fit and then of its nuisances; None where it
        has no error of a sensor
    """
    run, suspects, nothing = one.log.run, found.problem.suspects, np.zeros(len(data.nuisances))
    errors = {
        name: effect for name, effect in fit.acting(suspects).items() if effect.effect.of_a_sensor
    }

    def without(effects: Iterable[ActiveEffect], nu: Signal) -> Signal:
        sensors, zeros = data.models(nu, [*effects])[one.number].sensors, data.zeros(nu)[one.number]
        channels = {
            name: sensors.corrected(
                name, run.t, x - (zeros[CHANNELS.index(name)] if name in CHANNELS else 0.0)
            )
            for name, x in run.channels.items()
        }
        return quantities_of(run, one.rig, one.windows, channels)

    quantities = without(errors.values(), nothing)
    if covariance is None or not errors:
        return Read(quantities, np.zeros_like(quantities), frozenset())
    slopes = np.zeros((covariance.shape[0], len(QUANTITIES)))
    for name in errors:
        own = fit.place[name]
        for place, (moved, step) in enumerate(varied(suspects[name], fit.x[own], MOVED), own.start):
            slopes[place] = (
                without((errors | {name: moved}).values(), nothing) - quantities
            ) / step
    paths = (effect.effect.path.split(".") for effect in errors.values())
    parts = frozenset((path[2], path[1]) for path in paths if len(path) > 2)
    for j, n in enumerate(data.nuisances):
        if (n.name, n.kind) in parts and n.log in (-1, one.number):
            slopes[j - nothing.size] = (
                without(errors.values(), np.eye(nothing.size)[j]) - quantities
            )
    slopes = np.nan_to_num(slopes)
    return Read(
        quantities, np.sqrt(np.maximum(np.sum(slopes * (covariance @ slopes), axis=0), 0.0)), parts
    )


def _of_run(
    data: Fitted,
    found: Found,
    held_out: Fit | None,
    one: WindowedLog,
    inputs: Signal,
    read: Read,
) -> list[Validated]:
    """Every metric of one run that the log gives."""
    nothing, k, fit = np.zeros(len(data.nuisances)), one.number, held_out or found.best
    no_skew = no_zero = np.zeros(len(CHANNELS))
    measured = read.quantities
    as_given = without_sensors(data.models(nothing, [])[k])
    finely = one.log.at_stamps(as_given, no_skew, no_zero)
    before, coarsely = (one.quantities(x) for x in (finely, finely - one.log.offset_at_stamps))
    of_inputs = np.where([n.kind in INPUTS for n in data.nuisances], fit.nu, 0.0)
    corrected = without_sensors(data.models(of_inputs, fit.effects(found.problem.suspects))[k])
    after = one.simulated(corrected, no_skew, no_zero) if fit.names else None
    u_d, u_num = _of_the_data(one, read), np.abs(before - coarsely)
    rows = []
    for name in METRICS:
        q = QUANTITIES.index(name)
        if not math.isfinite(measured[q]) or name not in u_d:
            continue

        def compared(simulated: Signal, u_input: float, q: int = q, name: str = name) -> Compared:
            u_val, error = (
                math.hypot(u_num[q], u_input, u_d[name]),
                float(simulated[q] - measured[q]),
            )
            return Compared(
                float(simulated[q]),
                u_input,
                u_val,
                error,
                error - COVERED * u_val,
                error + COVERED * u_val,
            )

        rows.append(
            Validated(
                log=k,
                load=one.log.run.load,
                speed=one.plateau_speed,
                quantity=name,
                measured=float(measured[q]),
                u_d=u_d[name],
                u_num=float(u_num[q]),
                before=compared(before, float(inputs[0, q])),
                after=None if after is None else compared(after, float(inputs[1, q])),
                held_out=held_out is not None,
            )
        )
    return rows


def _of_the_data(one: WindowedLog, read: Read) -> dict[str, float]:
    """Standard uncertainty of the reduced mean of each metric by sensors and gaps; metrics without
    a known one are left out.

    The scatter of the cycles is none: the model is driven by the motion of each of them.
    """
    if one.reduction is None:
        return {}
    made = budget(one.reduction)
    kept = [
        (row, _of_a_lag(row.source, one.log.run.fs))
        for row in made.rows
        if row.source is None or (row.source.channel, row.source.part) not in read.parts
    ]
    return {
        name: math.hypot(
            float(read.u[QUANTITIES.index(name)]),
            *(share * (row.of[name] or 0.0) for row, share in kept),
        )
        for name in METRICS
        if made.sensors[name] is not None
    }


def _of_a_lag(source: ErrorSource | None, fs: float) -> float:
    """Share of an uncertainty that remains beside a fit. [1]

    A fit takes the channels of a logger as read within `SKEW` of a sample of each other, and names
    a larger lag as an effect; a log alone leaves more open.
    """
    if source is None or source.basis != "relation":
        return 1.0
    return min(math.sqrt(2.0) * SKEW / (fs * source.u), 1.0)
