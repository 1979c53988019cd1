"""A rig and its motion in other units of nature behave alike: every number is the same times its
factor.
"""

from functools import cache

import numpy as np
import pytest
from daily import daily
from hypothesis import example, given, settings
from openlog import motion_run
from own_rigs import own_rig
from rigs import scale_of, scales_on
from units_of_nature import BENCH, EXACTLY, Nature, factors_of, motion_in, natures, rig_in, run_in

from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Run
from winchcascade.core.scales import motion_of_runs
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import EFFECTS
from winchcascade.rig.effects.effect import ActiveEffect, Effect
from winchcascade.rig.simulate import Simulation, simulate

FEW = settings(max_examples=max(settings().max_examples // 16, 2))
"""A simulation takes some tenths of a second: fewer examples than of other laws."""

ROUNDING = 1e-9
"""Relative difference where no step is taken. [1]"""

KINDS = ("gas_screw", "spring", "counterweight")

PART = 0.4
"""How far effects go from absent to the end of their range. [1]"""


@cache
def rig_of(kind: str) -> Rig:
    return built_in() if kind == "gas_screw" else own_rig(kind)


def kind_of(effect: str) -> str:
    """Restoring module that an effect acts on; that of the paper for all others."""
    return {
        "spring_force": "spring",
        "spring_stiffness": "spring",
        "counterweight": "counterweight",
    }.get(effect, KINDS[0])


@cache
def log(load: float) -> Run:
    return motion_run(cycles=1, load=load)


def at(effect: Effect, rig: Rig, run: Run) -> ActiveEffect:
    """An effect partly at the end of its range on a rig."""
    own = effect.at(scales_on(rig, [run]))
    ends = [field.high if field.high > field.absent else field.low for field in own.fields]
    values = (f.absent + PART * (end - f.absent) for f, end in zip(own.fields, ends, strict=True))
    return ActiveEffect(own, tuple(values))


def assert_alike(nature: Nature, one: Simulation, other: Simulation) -> None:
    """What sensors read, what none reads and where the energy goes, each against its largest
    value.
    """
    expected, found = run_in(nature, one.run).channels, other.run.channels
    unlogged = {
        "rpm_gen": nature.rotor,
        "i_s": nature.ampere,
        "torque_em": nature.torque / nature.gear,
    }
    pairs = {name: (expected[name], found[name]) for name in expected}
    pairs |= {
        name: (getattr(one, name) * by, getattr(other, name)) for name, by in unlogged.items()
    }
    pairs |= {
        name: (joule * nature.torque, other.energy[name]) for name, joule in one.energy.items()
    }
    for name, (x, y) in pairs.items():
        assert np.max(np.abs(y - x)) <= EXACTLY * np.max(np.abs(x)), name


@example(BENCH)
@given(natures())
def test_the_scales_of_a_motion_are_those_of_its_units(nature: Nature) -> None:
    run = log(18.0)
    found, expected = motion_of_runs([run_in(nature, run)]), motion_in(nature, scale_of(run))
    assert [found.speed, found.ramp, found.stroke] == pytest.approx(
        [expected.speed, expected.ramp, expected.stroke], rel=ROUNDING
    )


@pytest.mark.parametrize("load", [np.inf, 18.0, 4.5])
@FEW
@example(BENCH)
@given(natures())
def test_a_simulation_is_that_of_the_rig_of_the_paper_times_the_units(
    load: float, nature: Nature
) -> None:
    rig = rig_of(KINDS[0])
    one, other = (
        simulate(log(load), baseline(rig)),
        simulate(run_in(nature, log(load)), baseline(rig_in(nature, rig))),
    )
    assert_alike(nature, one, other)


@FEW
@example(BENCH)
@given(natures())
def test_so_is_that_of_a_spring(nature: Nature) -> None:
    rig = rig_of("spring")
    one, other = (
        simulate(log(18.0), baseline(rig)),
        simulate(run_in(nature, log(18.0)), baseline(rig_in(nature, rig))),
    )
    assert_alike(nature, one, other)


@FEW
@example(BENCH)
@given(natures(with_weights=True))
def test_so_is_that_of_a_counterweight_where_gravity_stays(nature: Nature) -> None:
    rig = rig_of("counterweight")
    one, other = (
        simulate(log(18.0), baseline(rig)),
        simulate(run_in(nature, log(18.0)), baseline(rig_in(nature, rig))),
    )
    assert_alike(nature, one, other)


@pytest.mark.parametrize("name", EFFECTS)
@FEW
@example(BENCH)
@given(natures())
def test_the_range_of_an_effect_has_the_unit_of_its_field(name: str, nature: Nature) -> None:
    rig, run = rig_of(kind_of(name)), log(18.0)
    one = EFFECTS[name].at(scales_on(rig, [run]))
    other = EFFECTS[name].at(scales_on(rig_in(nature, rig), [run_in(nature, run)]))
    for field, own, factor in zip(one.fields, other.fields, factors_of(nature, one), strict=True):
        ends = np.array([field.low, field.high, *field.possible, field.absent])
        assert [own.low, own.high, *own.possible, own.absent] == pytest.approx(
            list(factor * ends), rel=ROUNDING
        ), field.name
        assert own.share == field.share


@pytest.mark.parametrize("name", daily(EFFECTS, [*EFFECTS][::5]))
@settings(max_examples=max(settings().max_examples // 100, 1))
@example(BENCH)
@given(natures(with_weights=True))
def test_an_effect_acts_alike(name: str, nature: Nature) -> None:
    rig, run = rig_of(kind_of(name)), log(4.5)
    there, thus = rig_in(nature, rig), run_in(nature, run)
    one = simulate(run, at(EFFECTS[name], rig, run).apply(baseline(rig)))
    other = simulate(thus, at(EFFECTS[name], there, thus).apply(baseline(there)))
    assert_alike(nature, one, other)
    assert at(EFFECTS[name], there, thus).values == pytest.approx(
        factors_of(nature, EFFECTS[name]) * at(EFFECTS[name], rig, run).values, rel=ROUNDING
    )
