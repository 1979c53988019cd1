"""What a fit leaves: whether it is more than noise, and where."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.white_noise import white_noise
from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.diagnosis_result import Alarm, Spot
from winchcascade.diagnosis.noise import restless
from winchcascade.diagnosis.predict import CHANNELS, Course

if TYPE_CHECKING:
    from winchcascade.core.run import Run, Signal
    from winchcascade.diagnosis.evidence import Fit
    from winchcascade.diagnosis.misfit import Fitted
    from winchcascade.diagnosis.suspects import Suspects

ROUGH = 2.5
"""Root mean square of whitened blocks, of one channel in one phase over all logs, beyond which they keep a structure. Where the
model is right it stays below 1.7, and below 2.4 behind a large lag, as the blocks' noise is told by their own differences."""

RESTLESS = 2.2
"""Scatter within blocks over what noise alone explains, beyond which something moves that the model does not know."""

UNSTEADY = 6.0
"""Scatter of the blocks about a smooth course over what noise alone explains, the median of the logs, beyond which something
comes and goes that the model does not know: an eccentric drum, teeth. Ringing, gusts and a model that is right stay below 3."""

PULLED = 5.0
"""A nuisance pulled beyond this many of its tolerances is none."""


def alarms_of(data: Fitted, suspects: Suspects, fit: Fit) -> tuple[Alarm, ...]:
    """Every sign that a fit leaves more than noise, worst first."""
    found = [
        *_rough(data, fit), *_restless(data, suspects, fit), *_unsteady(data, suspects, fit), *_pulled(data, fit)
    ]  # fmt: skip
    return tuple(sorted(found, key=lambda alarm: -alarm.size / alarm.limit))


def block_rms(data: Fitted, z: Signal) -> dict[tuple[str, str], float]:
    """Root mean square of whitened blocks by channel and phase, over all logs that take part."""
    table = z.reshape(-1, len(CHANNELS))
    phase = np.concatenate([log.course.blocks.phase for log in data.logs])
    found = {}
    for k, channel in enumerate(CHANNELS):
        for p, name in enumerate(PHASES):
            here = table[phase == p, k]
            here = here[here != 0.0]
            if here.size >= FEW:
                found[channel, name] = float(np.sqrt(np.mean(np.minimum(np.abs(here), FAR) ** 2)))
    return found


FEW, FAR = 30, 8.0
"""Fewer blocks tell no rms; single blocks count as this far off at most."""


def _rough(data: Fitted, fit: Fit) -> list[Alarm]:
    return [
        Alarm("structure", Spot(channel, phase), rms, ROUGH)
        for (channel, phase), rms in block_rms(data, fit.z).items()
        if rms > ROUGH
    ]


def scatter(data: Fitted, suspects: Suspects, fit: Fit, seed: int = 0) -> dict[str, float]:
    """Scatter within blocks of payout over what the sensors' and the velocity's noise explain, the worst log, by channel.

    What the velocity's noise does is found by adding as much of it again and simulating. The force is left out: its tether
    rings. A ripple that the means of blocks do not show stands out here.
    """
    models, skew = data.models(fit.nu, fit.effects(suspects)), data.skew(fit.nu)
    rng = np.random.default_rng(seed)
    noisy = [_with_noise(log.run, rng) for log in data.logs]
    found: dict[str, float] = {}
    for number, (log, model) in enumerate(zip(data.logs, models, strict=True)):
        blocks, t = log.course.blocks, log.run.t
        payout = blocks.phase == PHASES.index("payout")
        if number in data.withheld or np.count_nonzero(payout) < FEW // 2:
            continue
        grid = log.course.on_grid(model, skew=skew)
        again = Course(noisy[number], blocks).on_grid(model, skew=skew) - grid
        for k, channel in enumerate(CHANNELS):
            if channel == "force" or not np.any(log.noise.seen[payout, k]):
                continue
            here = payout & log.noise.seen[:, k]
            left = log.run.channels[channel] - np.interp(t, log.course.coarse.t, grid[:, k])
            moved = np.interp(t, log.course.coarse.t, again[:, k])
            floor = np.hypot(white_noise(log.run.channels[channel]), blocks.scatter(moved)[here])
            ratio = float(np.sqrt(np.mean(blocks.scatter(left)[here] ** 2) / np.mean(floor**2)))
            found[channel] = max(found.get(channel, 0.0), ratio)
    return found


def _with_noise(run: Run, rng: np.random.Generator) -> Run:
    v = run.channels["velocity"]
    noisy = v + rng.normal(0.0, max(white_noise(v), 1e-12), v.size)
    return msgspec.structs.replace(run, channels={**run.channels, "velocity": noisy})


def _restless(data: Fitted, suspects: Suspects, fit: Fit) -> list[Alarm]:
    return [
        Alarm("scatter", Spot(channel, "payout", within_blocks=True), ratio, RESTLESS)
        for channel, ratio in scatter(data, suspects, fit).items()
        if ratio > RESTLESS
    ]


def unsteadiness(data: Fitted, suspects: Suspects, fit: Fit) -> dict[tuple[str, str], float]:
    """Scatter of blocks about a smooth course over what noise explains, the median of the logs, by channel and phase.

    The noise that a fit reckons with holds whatever scatters from block to block, so that no z tells of it.
    """
    residual = data.measured - data.predict(fit.nu, fit.effects(suspects))
    tables = [
        restless(log.noise, log.course.blocks, residual[rows])
        for number, (log, rows) in enumerate(zip(data.logs, data.rows, strict=True))
        if number not in data.withheld
    ]
    found, expected = np.moveaxis(np.array(tables), -1, 0)
    ratio = np.divide(found, expected, out=np.full_like(found, np.nan), where=expected > 0.0)
    return {
        (channel, name): float(np.nanmedian(ratio[:, p, k]))
        for p, name in enumerate(PHASES)
        for k, channel in enumerate(CHANNELS)
        if np.isfinite(ratio[:, p, k]).any()
    }


def _unsteady(data: Fitted, suspects: Suspects, fit: Fit) -> list[Alarm]:
    return [
        Alarm("ripple", Spot(channel, phase), ratio, UNSTEADY)
        for (channel, phase), ratio in unsteadiness(data, suspects, fit).items()
        if ratio > UNSTEADY
    ]


def _pulled(data: Fitted, fit: Fit) -> list[Alarm]:
    return [
        Alarm("nuisance", n, abs(float(x)), PULLED)
        for n, x in zip(data.nuisances, fit.nu, strict=True)
        if abs(x) > PULLED
    ]
