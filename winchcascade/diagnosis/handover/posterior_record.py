"""A posterior of a rig as JSON, and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec
import numpy as np

from winchcascade.core.errors import OptionError
from winchcascade.diagnosis.handover.posterior import RigPosterior
from winchcascade.diagnosis.handover.tested import Tested
from winchcascade.rig.effects.catalogue import EFFECTS, SHARED_RADIUS
from winchcascade.rig.effects.effect import ActiveEffect, Parameter
from winchcascade.rig.parts import PARTS, Model

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
