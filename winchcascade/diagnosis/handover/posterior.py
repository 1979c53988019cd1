"""The rig as a diagnosis leaves it: its corrected numbers and what is not known of them, without
the errors of its sensors.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from winchcascade.core.errors import OptionError
from winchcascade.core.rig_file import Thresholds
from winchcascade.diagnosis.diagnosis_result import Judgement
from winchcascade.diagnosis.explain.planned_run import usual
from winchcascade.diagnosis.fit.block_means import PAYOUT
from winchcascade.diagnosis.fit.covariance import predictive_covariance, voltage_of_a_load
from winchcascade.diagnosis.fit.misfit import log_of
from winchcascade.diagnosis.fit.nuisances import LOAD
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.diagnosis.fit.suspects import freedom, with_values
from winchcascade.diagnosis.judge.causes import look_alikes_of
from winchcascade.diagnosis.stages.stage_map import convex_hull
from winchcascade.diagnosis.verdict_limits import LAW
from winchcascade.rig.effects.catalogue import EFFECTS, SHARED_RADIUS
from winchcascade.rig.effects.effect import ActiveEffect, Parameter
from winchcascade.rig.effects.run_order import lasting_heat
from winchcascade.rig.parts import PARTS, Model, possible

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.fit.evidence import Fit

OF_THE_RIG = ("rig", "law")
"""Kinds of nuisances that are numbers of the rig; the others concern sensors, single loads or
the comparison.
"""

IDLE = 1e-9
"""A direction of the posterior whose variance is below this share of the largest, in squares of
the tolerances, is known.
"""


class Band(msgspec.Struct, frozen=True):
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float


class RigPosterior(msgspec.Struct, frozen=True):
    """A corrected rig with the joint uncertainty of its numbers.

    `nominal` is the model of the rig file without errors of its sensors. It is changed by `numbers`
    of the rig, each by its value of `moves` in its own unit, and then by `effects`. `covariance` (n
    + k, n + k) is that of the moves and then of all fields of the effects. An effect that changes
    from run to run acts as in the run that shows it most.

    `others` are the rig as the best fits with look-alikes in place of its causes leave it; the
    `weight` of each of these and of the rig itself is its posterior probability among them.
    """

    nominal: Model
    numbers: tuple[Parameter, ...]
    moves: tuple[float, ...]
    effects: tuple[ActiveEffect, ...]
    covariance: Signal
    weight: float = 1.0
    others: tuple[RigPosterior, ...] = ()

    @property
    def members(self) -> tuple[RigPosterior, ...]:
        """The rig by the best fit and by those with look-alikes."""
        return self, *self.others

    @property
    def best(self) -> Signal:
        """Moves of the numbers, then fields of the effects, (n + k,)."""
        return np.array(
            [*self.moves, *(value for effect in self.effects for value in effect.values)]
        )

    def model(self, at: Signal | None = None, without: str = "") -> Model:
        """The corrected rig.

        Parameters
        ----------
        at : (n + k,) other moves and fields than the best ones
        without : name of an effect that is repaired
        """
        values, model = (self.best if at is None else at).tolist(), self.nominal
        place = len(self.numbers)
        for number, move in zip(self.numbers, values[:place], strict=True):
            model = number.apply(model, move)
        for effect in self.effects:
            own = np.array(values[place : place + len(effect.values)])
            place += own.size
            if effect.effect.name != without:
                free = freedom(effect.effect)
                model = with_values(effect.effect, np.clip(own, free.minimum, free.maximum)).apply(
                    model
                )
        return possible(model)

    def directions(self) -> Signal:
        """Moves and fields one standard deviation away along independent directions, (r, n + k),
        the least known first.
        """
        scale = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        known = np.where(scale > 0.0, scale, 1.0)
        variance, ways = np.linalg.eigh(self.covariance / np.outer(known, known))
        keep = np.flatnonzero(variance > IDLE * variance[-1])[::-1]
        return np.asarray((ways[:, keep] * np.sqrt(variance[keep])).T * known)

    def models(self, without: str = "") -> list[Model]:
        """The corrected rig, then the same moved along each of `directions`."""
        return [
            self.model(self.best, without),
            *(self.model(self.best + way, without) for way in self.directions()),
        ]

    def draws(self, count: int, seed: int) -> list[tuple[Model, Model]]:
        """Corrected rigs drawn from the posterior: of its `members` by their weights and of their
        numbers and fields, each for what the logs cover and for what they do not.

        What an effect does in the logs is known as the posterior has it. Beyond these logs it is
        drawn, too, how much it does by its law.
        """
        rng, members = np.random.default_rng(seed), self.members
        ends = np.cumsum([one.weight for one in members])
        places = np.searchsorted(ends, (np.arange(count) + rng.uniform()) / count * ends[-1])
        return [
            members[min(place, len(members) - 1)].draw(rng) for place in rng.permutation(places)
        ]

    def draw(self, rng: np.random.Generator) -> tuple[Model, Model]:
        """A rig drawn from this member of the posterior alone, as `draws` gives it."""
        ways = self.directions()
        at = self.best + rng.standard_normal(len(ways)) @ ways
        drawn = found = self.model(at)
        for one in self.effects:
            if one.effect.entry is None:
                found = stretched(
                    found,
                    (self.model(at, one.effect.name), drawn),
                    max(LAW, one.effect.law_u) * rng.standard_normal(),
                )
        return drawn, possible(found)


def stretched(model: Model, change: tuple[Model, Model], share: float) -> Model:
    """A model whose numbers are moved by a share of the change between two others."""
    parts = {}
    for part in PARTS:
        own, before, after = (getattr(one, part)._asdict() for one in (model, *change))
        moved = {
            name: value + share * (np.subtract(after[name], before[name]))
            for name, value in own.items()
            if after[name] != before[name]
        }
        parts[part] = getattr(model, part)._replace(
            **{name: tuple(x.tolist()) if np.ndim(x) else float(x) for name, x in moved.items()}
        )
    return msgspec.structs.replace(model, **parts)


MEMBERS = 4
"""Maximum number of fits of which a corrected rig is a mixture: each takes as long to simulate
as the best alone.
"""


def posterior_of_rig(found: ModelDiagnosis) -> RigPosterior:
    """The rig that a diagnosis leaves, by its best fit and by those with look-alikes in place of
    its causes.

    Fits in which another effect is an error of a sensor, or is none, come first, as they change the
    energies most.
    """
    best = found.found.best
    alike = {
        one.fit.names: one for several in look_alikes_of(found.found).values() for one in several
    }
    sensors = _of_sensors(found, best)
    first = sorted(
        alike.values(), key=lambda one: (_of_sensors(found, one.fit) == sensors, one.short)
    )[: MEMBERS - 1]
    odds = np.array([1.0, *(math.exp(-max(one.short, 0.0)) for one in first)])
    fits = best, *(one.fit for one in first)
    itself, *others = (
        msgspec.structs.replace(_left_by(found, fit), weight=float(weight))
        for fit, weight in zip(fits, odds / odds.sum(), strict=True)
    )
    return msgspec.structs.replace(itself, others=tuple(others))


def _of_sensors(found: ModelDiagnosis, fit: Fit) -> set[str]:
    """Effects of a fit that are errors of sensors."""
    return {name for name in fit.names if found.suspects[name].of_a_sensor}


def _left_by(found: ModelDiagnosis, fit: Fit) -> RigPosterior:
    """The rig of one fit, with every effect of it but errors of sensors and of single logs or
    loads.
    """
    data = found.data
    chosen = [j for j, n in enumerate(data.nuisances) if n.kind in OF_THE_RIG]
    kept = {
        name: effect
        for name, effect in fit.acting(found.suspects).items()
        if not effect.effect.of_a_sensor and log_of(effect) < 0 and effect.effect.path != LOAD
    }
    fields = [k for name in kept for k in range(fit.place[name].start, fit.place[name].stop)]
    places = [*(fit.x.size + j for j in chosen), *fields]
    unit = np.array([*(data.nuisances[j].sd for j in chosen), *np.ones(len(fields))])
    nominal = data.nominal
    for effect in data.stated_by_run:
        nominal = effect.apply(nominal)
    return RigPosterior(
        nominal=nominal.physics,
        numbers=tuple(data.nuisances[j] for j in chosen),
        moves=tuple(float(fit.nu[j]) * data.nuisances[j].sd for j in chosen),
        effects=tuple(kept.values()),
        covariance=predictive_covariance(data, found.found, fit)[np.ix_(places, places)]
        * np.outer(unit, unit),
    )


# -------------------------------------------------------------------------------- what was tested
class Tested(msgspec.Struct, frozen=True):
    """What the logs of a diagnosis cover, SI units, and what a prediction beyond them begins from.

    `loads` are those of the runs but open circuits [ohm]. `border` are corners of the convex region
    of line speed and DC current in payout, (k, 2) [m/s, A]. `force` is the largest line tension.
    `speed`, `length` and `ramp` are those of a usual payout with a load: its fastest plateau, its
    travel and the time of its ramp. `warm` is the DC current (rms over a cycle) that keeps the
    machine as warm as in its warmest run, repeated at the spacing of the runs; None without
    heating. `u_load` is how well Vdc is known at one load beside that at all, as a share, by the
    discrepancy of the model. The `judgement` is that of the diagnosis, `thresholds` are those by which its logs are
    reduced; what is left out follows the scales of a motion.
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


# ------------------------------------------------------------------------------------ as a record
RADIUS = "shared_radius"
"""Name in a record of the second form of the drum radius."""


def posterior_record(posterior: RigPosterior, tested: Tested) -> dict[str, Any]:
    """A posterior as JSON: numbers of the nominal model by part, what changes them, their
    covariance, and what was `tested`.

    `others` are the same numbers and their effects by the fits with look-alikes.
    """
    return {
        "tested": msgspec.to_builtins(tested),
        "nominal": {part: getattr(posterior.nominal, part)._asdict() for part in PARTS},
        "numbers": [
            {"name": n.name, "path": n.path, "operation": n.operation, "per": n.per, "move": move}
            for n, move in zip(posterior.numbers, posterior.moves, strict=True)
        ],
        **_member_record(posterior),
        "others": [
            {"moves": list(other.moves)} | _member_record(other) for other in posterior.others
        ],
    }


def _member_record(posterior: RigPosterior) -> dict[str, Any]:
    """What one fit makes of a rig, as JSON."""
    return {
        "effects": [
            {
                "effect": RADIUS if one.effect.law is SHARED_RADIUS.law else one.effect.name,
                "values": list(one.values),
            }
            for one in posterior.effects
        ],
        "covariance": posterior.covariance.tolist(),
        "weight": posterior.weight,
    }


def posterior_from(record: Mapping[str, Any] | None, place: str) -> tuple[RigPosterior, Tested]:
    """Read a posterior, and what was tested, from the JSON of a diagnosis.

    Raises
    ------
    OptionError : the record is not one of this version
    """
    try:
        if record is None:
            raise ValueError("it has none")
        parts = {part: kind(**_tuples(record["nominal"][part])) for part, kind in PARTS.items()}
        numbers = [
            Parameter(n["name"], path=n["path"], operation=n["operation"], per=n["per"])
            for n in record["numbers"]
        ]
        moves, tested = (
            [n["move"] for n in record["numbers"]],
            msgspec.convert(record["tested"], Tested),
        )
        nominal = RigPosterior(Model(**parts), tuple(numbers), (), (), np.zeros((0, 0)))
        others = tuple(_member_from(one, one["moves"], nominal) for one in record["others"])
        posterior = msgspec.structs.replace(_member_from(record, moves, nominal), others=others)
        if not tested.border:
            raise ValueError("no border of what was tested")
        return posterior, tested
    except (AttributeError, KeyError, TypeError, ValueError, np.linalg.LinAlgError) as fault:
        raise OptionError(
            f"{place}: its posterior cannot be read ({fault}); expected the JSON that "
            f"`winchcascade diagnose CAMPAIGN --json "
            "FILE` of this version writes. Diagnose the campaign again."
        ) from None


def _member_from(
    record: Mapping[str, Any], moves: Sequence[float], nominal: RigPosterior
) -> RigPosterior:
    """What one fit makes of a rig, of which the nominal model and its numbers are known;
    ValueError where it is damaged.
    """
    known = EFFECTS | {RADIUS: SHARED_RADIUS}
    effects = (
        ActiveEffect(known[one["effect"]], tuple(map(float, one["values"])))
        for one in record["effects"]
    )
    found = msgspec.structs.replace(
        nominal,
        moves=tuple(map(float, moves)),
        effects=tuple(effects),
        covariance=np.array(record["covariance"], dtype=np.float64),
        weight=float(record["weight"]),
    )
    fits = found.covariance.shape == 2 * (found.best.size,) and len(found.moves) == len(
        found.numbers
    )
    if not (fits and np.isfinite(found.covariance).all()) or np.any(
        np.diag(found.covariance) < 0.0
    ):
        raise ValueError(f"no covariance of {found.best.size} numbers")
    if not 0.0 < found.weight <= 1.0:
        raise ValueError(f"a weight of {found.weight:g}")
    found.models()
    return found


def _tuples(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers of a part from JSON, where a sequence is a list."""
    return {
        name: tuple(value) if isinstance(value, list) else value for name, value in numbers.items()
    }
