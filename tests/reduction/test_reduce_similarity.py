"""Reading and reduction know no size: a log in other units of nature gives the same findings,
and energies in these units.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shipped_log import NAMES, Signal, column, table
from similar import Nature, scaled_log, scaled_rig

from winchcascade import Reduction, read_run, reduce
from winchcascade.core.channels import CHANNELS
from winchcascade.core.quantity import find_unit
from winchcascade.core.rig_toml import built_in

LOAD = 36.0
"""Of the shipped log. [ohm]"""

ROUNDING = 1e-9
"""Relative difference of efficiencies and energies by the rounding of some thousand products."""

HERE = Nature(1.0, 1.0, 1.0, 1.0)

UNITS = {
    "displacement": "m",
    "velocity": "m/s",
    "pressure": "Pa",
    "force": "N",
    "torque": "N.m",
    "vdc": "V",
    "idc": "A",
}


def spikes(t: Signal, x: dict[str, Signal]) -> None:
    x["torque"][[400, 900, 1500]] *= 3.0


def zeros(t: Signal, x: dict[str, Signal]) -> None:
    x["vdc"][420:432] = 0.0


def held(t: Signal, x: dict[str, Signal]) -> None:
    x["velocity"][1300:1325] = x["velocity"][1300]


def late(t: Signal, x: dict[str, Signal]) -> None:
    x["torque"][:] = np.roll(x["torque"], 9)


def machine_late(t: Signal, x: dict[str, Signal]) -> None:
    for name in ("vdc", "idc"):
        x[name][:] = np.roll(x[name], 13)


def offset(t: Signal, x: dict[str, Signal]) -> None:
    x["torque"] += 0.02 * x["torque"].max()


def turned(t: Signal, x: dict[str, Signal]) -> None:
    x["force"] *= -1.0


def lost_rows(t: Signal, x: dict[str, Signal]) -> None:
    for y in x.values():
        y[1200:-60] = y[1260:].copy()


def zero_of_velocity(t: Signal, x: dict[str, Signal]) -> None:
    x["velocity"] += 0.02 * x["velocity"].max()


def gap(t: Signal, x: dict[str, Signal]) -> None:
    t[700:] += 1.4 * (t[40] - t[0])


DAMAGES: list[Callable[[Signal, dict[str, Signal]], None]] = [
    spikes, zeros, held, late, machine_late, offset, turned, lost_rows, zero_of_velocity, gap,
]  # fmt: skip


def reduced(
    damages: tuple[int, ...], left_out: frozenset[str], nature: Nature, *, stated: bool
) -> Reduction:
    """The reduction of the shipped log in some units, after some damages and without some
    channels.
    """
    rows = table()
    units = [find_unit(CHANNELS[name].unit) for name in NAMES]
    channels = {
        name: rows[:, column(name)] * unit.factor
        for name, unit in zip(NAMES, units, strict=True)
        if unit
    }
    t = rows[:, 0].copy()
    for k in damages:
        DAMAGES[k](t, channels)
    t, channels = scaled_log(
        t, {name: x for name, x in channels.items() if name not in left_out}, nature
    )
    frame = pd.DataFrame(
        {"Time (s)": t} | {f"{name} ({UNITS[name]})": x for name, x in channels.items()}
    )
    rig = scaled_rig(built_in(), nature, stated=stated)
    return reduce(read_run(frame, rig=rig, load=LOAD * nature.of("resistance")))


def findings(found: Reduction) -> Counter[tuple[str, str | None, int]]:
    return Counter((one.kind, one.channel, one.count) for one in found.quality)


def check(
    nature: Nature, damages: tuple[int, ...], left_out: frozenset[str], *, stated: bool
) -> None:
    """Require the same findings, the same efficiencies, and energies in proportion."""
    here = reduced(damages, left_out, HERE, stated=stated)
    there = reduced(damages, left_out, nature, stated=stated)
    assert findings(there) == findings(here)
    assert [cycle.complete for cycle in there.cycles] == [cycle.complete for cycle in here.cycles]
    for name, value in here.mean.items():
        other = there.mean[name]
        factor = (
            nature.of("energy")
            if name.startswith("energy")
            else nature.power
            if name.startswith("power")
            else 1.0
        )
        assert other == (None if value is None else pytest.approx(value * factor, rel=ROUNDING)), (
            name
        )


FACTOR = st.floats(-4.0, 4.0).map(np.exp)
"""Factors from 1/55 to 55."""


@settings(max_examples=6, deadline=None)
@given(
    nature=st.builds(Nature, FACTOR, FACTOR, FACTOR, FACTOR),
    damages=st.sets(st.integers(0, len(DAMAGES) - 1), max_size=2).map(
        lambda some: tuple(sorted(some))
    ),
    left_out=st.sampled_from([frozenset(), frozenset({"velocity"}), frozenset({"displacement"})]),
    stated=st.booleans(),
)
def test_a_log_in_other_units_of_nature_is_reduced_alike(
    nature: Nature, damages: tuple[int, ...], left_out: frozenset[str], stated: bool
) -> None:
    check(nature, damages, left_out, stated=stated)


@pytest.mark.slow
@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize("k", range(len(DAMAGES)))
def test_each_damage_is_found_alike_in_the_units_of_a_wave_tank_and_of_a_large_winch(
    k: int, stated: bool
) -> None:
    for nature in (Nature(0.1, 0.35, 0.01, 0.3), Nature(4.0, 20.0, 2000.0, 6.0)):
        check(nature, (k,), frozenset(), stated=stated)
