"""Signs that the causes are not the whole truth: each rings where its fault is, and is silent
where nothing is wrong.
"""

import math
from collections.abc import Callable
from copy import copy
from typing import get_args

import msgspec
import numpy as np
import pytest
from diagnosed import diagnosed

from winchcascade.diagnosis.diagnosis_result import (
    AlarmKind,
    Contribution,
    ContributionPart,
    NamedCause,
    Reported,
    Shrunk,
    Stability,
    Trend,
)
from winchcascade.diagnosis.fit.fit_set import located
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.diagnosis.fit.rig_problem import RigProblem
from winchcascade.diagnosis.judge.alarms import SIGNS, Judged, ringing
from winchcascade.diagnosis.judge.closure import ModelClosure
from winchcascade.rig.effects.catalogue import EFFECTS

VDC = CHANNELS.index("vdc")
EVERY = {sign.kind: sign for group in SIGNS for sign in group}

PERIOD = 7.0
"""Samples of a period of a ripple: several blocks hold many of them, and noise of the sensor
does not hide it. [1]
"""

ALTERNATING = 50.0
"""Deviation of every second block, in its noise. [1]"""


def nothing() -> Judged:
    """What was found where nothing is wrong."""
    return diagnosed("nothing").judged


def cause(**fields: object) -> NamedCause:
    return msgspec.structs.replace(
        NamedCause("copper_heating", "generator", 1.0, {}, (), 1.0), **fields
    )


def with_causes(one: NamedCause) -> Judged:
    return msgspec.structs.replace(nothing(), fitted=(one,), causes=(one,))


def structure() -> Judged:
    judged = nothing()
    return msgspec.structs.replace(
        judged, fit=msgspec.structs.replace(judged.fit, z=10.0 * judged.fit.z)
    )


def scatter() -> Judged:
    """Vdc ripples faster than a block, by a share that no noise of the log has."""
    judged = nothing()
    data = copy(judged.data)
    log = data.logs[0]
    vdc = log.run.channels["vdc"]
    rippled = vdc * (1.0 + 0.05 * np.sin(2.0 * math.pi / PERIOD * np.arange(vdc.size)))
    run = msgspec.structs.replace(log.run, channels={**log.run.channels, "vdc": rippled})
    data.logs = [msgspec.structs.replace(log, run=run), *data.logs[1:]]
    return msgspec.structs.replace(judged, data=data)


def ripple() -> Judged:
    """Vdc deviates from block to block, in turn up and down."""
    judged = nothing()
    data = copy(judged.data)
    data.measured = data.measured.copy()
    sign = np.where(np.arange(len(data.measured)) % 2, 1.0, -1.0)
    data.measured[:, VDC] += ALTERNATING * sign * data.noise[:, VDC]
    return msgspec.structs.replace(judged, data=data)


def nuisance() -> Judged:
    judged = nothing()
    pulled = np.eye(judged.fit.nu.size)[0] * 9.0
    return msgspec.structs.replace(judged, fit=msgspec.structs.replace(judged.fit, nu=pulled))


def cancelling() -> Judged:
    """A back-EMF that is larger, and a sensor of Vdc that reads as much less."""
    judged, names = nothing(), ("ke_shift", "voltage_gain")
    problem = RigProblem(judged.data, {name: EFFECTS[name] for name in names})
    fit = located(problem, diagnosed("nothing").found.marginal, names, np.array([0.05, -0.05]))
    return msgspec.structs.replace(judged, suspects=problem.suspects, fit=fit)


def worse() -> Judged:
    judged = nothing()
    closure = diagnosed("copper").closure
    assert isinstance(closure, ModelClosure)
    noise = float(np.max(judged.data.noise[:, VDC]))
    grown = msgspec.structs.replace(closure, channels={"vdc": Shrunk(noise, 10.0 * noise, noise)})
    return msgspec.structs.replace(judged, closure=grown)


def energy() -> Judged:
    judged = nothing()
    first, *others = judged.energies
    lost = msgspec.structs.replace(first, after=first.measured + 100.0 * first.u)
    return msgspec.structs.replace(judged, energies=(lost, *others))


def residual() -> Judged:
    judged = nothing()
    part = ContributionPart(None, "residual", 0.2, math.nan, math.nan)
    of = next(one for one in judged.contributions if one.metric == "eta_gen")
    return msgspec.structs.replace(
        judged,
        contributions=(
            *judged.contributions,
            Contribution(of.log, of.load, "eta_gen", 0.5, 0.5, (part,)),
        ),
    )


RINGS: dict[AlarmKind, Callable[[], Judged]] = {
    "structure": structure,
    "scatter": scatter,
    "ripple": ripple,
    "nuisance": nuisance,
    "drift": lambda: with_causes(cause(stability=Stability((), (Trend("order", 1.0, 0.1, 1e-6),)))),
    "range": lambda: with_causes(
        cause(parameters={"r_s_change": Reported(9.0, 8.0, 10.0, "1", beyond_range=True)})
    ),
    "improbable": lambda: with_causes(cause(probability=0.3)),
    "cancelling": cancelling,
    "worse": worse,
    "energy": energy,
    "residual": residual,
}


def test_every_kind_of_sign_has_one_row_and_one_fault_here() -> None:
    assert EVERY.keys() == RINGS.keys() == set(get_args(AlarmKind))


def test_signs_together_ring_in_no_more_than_a_twentieth_of_right_models() -> None:
    assert sum(sign.rate for sign in EVERY.values()) == pytest.approx(0.05)
    assert all(sign.detects >= 0.0 for sign in EVERY.values())


@pytest.mark.parametrize("kind", RINGS)
def test_a_sign_rings_at_its_fault_and_not_where_nothing_is_wrong(kind: AlarmKind) -> None:
    assert {alarm.kind for alarm in ringing(RINGS[kind](), [EVERY[kind]])} == {kind}
    assert ringing(nothing(), [EVERY[kind]]) == ()


@pytest.mark.parametrize(
    "kind", ["structure", "scatter", "ripple", "nuisance", "energy", "residual"]
)
def test_what_a_sign_compares_is_there_although_nothing_is_wrong(kind: AlarmKind) -> None:
    assert len(list(EVERY[kind].of(nothing()))) >= 2
