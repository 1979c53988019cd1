"""Wrong entries as suspects: bound to the numbers that a rig file states and to the runs of a
campaign, and their prior.
"""

from __future__ import annotations

import math
from functools import cache, partial
from typing import TYPE_CHECKING

import msgspec

from winchcascade.diagnosis.fit.nuisances import quantity_of
from winchcascade.diagnosis.verdict_limits import AGREES, MIN_RUNS, RARER
from winchcascade.rig.baseline import missing_part
from winchcascade.rig.effects.catalogue import CLASSES, ENTRIES, OF_THE_RIG, SHARED_RADIUS
from winchcascade.rig.effects.effect import Effect, LookAlikes, Stated, Values

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run
    from winchcascade.core.scales import Scales
    from winchcascade.diagnosis.fit.suspects import Suspects

LOAD, RADIUS = "load_entry", "drum_radius"
"""Entries that have several forms: one for each run, and one for each place of the encoder."""


def effect_name(suspect: str) -> str:
    """Name in the catalogue of a suspect; entries that concern one run add its name in brackets.

    >>> effect_name("load_entry(r27ohm.csv)"), effect_name("ke_shift")
    ('load_entry', 'ke_shift')
    """
    return suspect.partition("(")[0]


def is_entry(suspect: str) -> bool:
    """Whether a suspect is a wrong entry."""
    return effect_name(suspect) in ENTRIES


# ----------------------------------------------------------------------------------- the suspects
def bound_to(suspects: Suspects, rig: Rig, runs: Sequence[Run], scales: Scales) -> Suspects:
    """Suspects of a diagnosis: wrong entries report the numbers of the rig file, and each run has
    its own wrong load.

    A drum radius is suspected twice: the logged motion may be true, or computed with the same
    radius. Effects of parts that the rig has not are left out, and ranges are those of the scales
    of the campaign.
    """
    found: dict[str, Effect] = {}
    own = {name: effect.at(scales) for name, effect in suspects.items() if has_part(effect, rig)}
    for name, effect in own.items():
        if effect.over_runs is not None and len(runs) < MIN_RUNS:
            continue
        if effect.entry is None or effect.entry.log >= 0:
            found[name] = effect
        elif name == LOAD:
            found |= _of_each_run(effect, runs)
        else:
            found[name] = _of_the_rig(effect, rig)
    if RADIUS in suspects:
        shared = SHARED_RADIUS
        found[f"{RADIUS}(shared)"] = _of_the_rig(shared, rig)
    return found


def has_part(effect: Effect, rig: Rig) -> bool:
    """Whether a rig has the part that an effect acts on, and its file can state the number of a
    wrong entry.
    """
    if missing_part(effect, rig):
        return False
    return (
        effect.entry is None
        or not effect.number
        or quantity_of(rig, *effect.number.split(".")) is not None
    )


def _multiple(stated: float, values: Values) -> float:
    return stated * (1.0 + values[0])


def _of_the_rig(effect: Effect, rig: Rig) -> Effect:
    """An entry that reports the number of the rig file; one that is reported as a ratio knows it
    too.
    """
    number = quantity_of(rig, *effect.number.split(".")) if effect.number else None
    if number is None:
        return effect
    bound = msgspec.structs.replace(effect, entry=Stated(number.value, number.unit))
    if effect.reported_from is not None:
        return bound
    return msgspec.structs.replace(bound, reported_from=partial(_multiple, number.value))


def _of_each_run(effect: Effect, runs: Sequence[Run]) -> dict[str, Effect]:
    """A wrong load of each run whose Vdc over Idc does not agree with the stated one."""
    found: dict[str, Effect] = {}
    for log, run in enumerate(runs):
        if (
            run.load is None
            or not math.isfinite(run.load)
            or abs(_load_ratio(run, run.load) - 1.0) < AGREES
        ):
            continue
        name = f"{effect.name}({run.name})"
        name = name if name not in found else f"{effect.name}({run.name}, run {log + 1})"
        entry = Stated(run.load, log=log, source=run.name)
        found[name] = msgspec.structs.replace(
            effect,
            label=f"Load of {run.load:g} ohm",
            entry=entry,
            reported_from=partial(_multiple, run.load),
        )
    return found


def _load_ratio(run: Run, load: float) -> float:
    """Vdc over Idc of a run, by least squares, over its stated load [1]; NaN where one of the
    two is not logged.
    """
    if "vdc" not in run.channels or "idc" not in run.channels:
        return math.nan
    vdc, idc = run.channels["vdc"], run.channels["idc"]
    power = float(vdc @ idc)
    return float(vdc @ vdc) / power / load if power > 0.0 else math.nan


# -------------------------------------------------------------------------------------- the prior
@cache
def price_of(suspect: str) -> float:
    """Logarithm of the prior odds against a cause [1].

    All effects of the rig are as likely, also where only a few of them are suspects; a wrong entry
    is rarer.
    """
    return math.log(len(OF_THE_RIG)) + (RARER if is_entry(suspect) else 0.0)


def class_of(suspect: str, alike: Collection[str]) -> LookAlikes | None:
    """The class of look-alikes of a suspect: that of those that explain the logs as well, or one
    of what no catalogue holds.
    """
    own = [one for one in CLASSES if suspect in one.members]
    shared = (one for one in own if not set(alike).isdisjoint(one.members))
    return next(shared, None) or next((one for one in own if one.beyond), None)


def same_in_logs(one: str, other: str) -> bool:
    """Whether the logs hardly distinguish two suspects, as their laws are the same or nearly so."""
    return any({one, other} <= set(those.members) for those in CLASSES)
