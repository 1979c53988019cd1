"""Efficiencies that change within a log or between logs: what is found, and what clean logs must
not give.
"""

import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from winchcascade import read_run, reduce
from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.run import Finding, Run
from winchcascade.reduction.efficiency_between_runs import LogEfficiency, logs_apart

FIXTURES = Path(__file__).parents[2] / "fixtures" / "campaign"
LOADED = load_campaign(FIXTURES).runs[1:]


@cache
def log(k: int) -> Run:
    return read_run(LOADED[k].file, load=LOADED[k].load)


def changes(run: Run, k: int) -> list[Finding]:
    quality = reduce(run, window=LOADED[k].window).quality
    return [finding for finding in quality if finding.kind == "efficiency_change"]


def with_gain(run: Run, channel: str, gain: Sequence[float]) -> Run:
    """A gain error of a channel that changes linearly over equal parts of the log."""
    at = np.linspace(run.t[0], run.t[-1], len(gain))
    channels = {**run.channels, channel: run.channels[channel] * (1.0 + np.interp(run.t, at, gain))}
    return msgspec.structs.replace(run, channels=channels)


DRIFT, STEP, ONE = (0.0, 1.0), (0.0,) * 60 + (1.0,) * 40, (0.0,) * 35 + (1.0,) * 27 + (0.0,) * 38


@pytest.mark.parametrize("course", [DRIFT, STEP, ONE], ids=["drift", "step", "one cycle"])
@pytest.mark.parametrize("gain", [-0.06, 0.08])
@pytest.mark.parametrize("channel", ["force", "torque", "idc"])
@pytest.mark.parametrize("k", [1, 4])
def test_a_gain_that_changes_within_a_log_is_found(
    k: int, channel: str, gain: float, course: tuple[float, ...]
) -> None:
    size = gain * (1.4 if course == DRIFT else 0.6 if gain < 0 else 1.0)
    found = changes(with_gain(log(k), channel, [size * x for x in course]), k)
    expected = {"force": {"eta_trans"}, "torque": {"eta_trans", "eta_gen"}}.get(
        channel, {"eta_gen"}
    )
    assert {finding.message.split()[0] for finding in found} & expected
    assert {finding.message.split()[0] for finding in found} <= expected
    assert all(
        finding.removed == 0 and finding.action.startswith("kept as logged; look at")
        for finding in found
    )


@pytest.mark.parametrize("k", range(len(LOADED)))
def test_a_constant_gain_is_no_change_within_a_log(k: int) -> None:
    for channel in ("force", "torque", "vdc"):
        assert changes(with_gain(log(k), channel, (-0.1, -0.1)), k) == []


def test_an_open_circuit_has_no_efficiency_that_could_change() -> None:
    for load in (math.inf, None):
        run = read_run(FIXTURES / "open_circuit.csv", load=load)
        hurt = with_gain(run, "torque", [0.3 * x for x in STEP])
        assert [f for f in reduce(hurt).quality if f.kind == "efficiency_change"] == []


def many_cycles(seed: int, scatter: float, cycles: int, step: float = 0.0) -> list[Finding]:
    """The plateau of one log again and again, its force with a random gain each time and a step
    in the middle.
    """
    run, rng = log(4), np.random.default_rng(seed)
    span = run.t[-1] - run.t[0] + 1.0 / run.fs
    repeats = -(-cycles // 3)
    gains = 1.0 + scatter * rng.standard_normal(3 * repeats)
    edges = np.linspace(run.t[0], run.t[-1], 4)
    t = np.concatenate([run.t + k * span for k in range(repeats)])
    channels = {
        name: np.tile(x, repeats) for name, x in run.channels.items() if name != "displacement"
    }
    which = np.clip(np.searchsorted(edges, np.tile(run.t, repeats), side="right") - 1, 0, 2)
    cycle = which + 3 * np.repeat(np.arange(repeats), run.t.size)
    channels["force"] = (
        channels["force"] * gains[cycle] * np.where(cycle >= 3 * repeats // 2, 1.0 + step, 1.0)
    )
    return changes(msgspec.structs.replace(run, t=t, channels=channels, samples=t.size, gaps={}), 4)


@pytest.mark.parametrize("seed", range(4))
def test_cycles_that_scatter_are_no_change_however_many(seed: int) -> None:
    """Their own scatter decides where there are many; a twentieth of it is what a mean of these
    would move by.
    """
    assert many_cycles(seed, 0.01, 60) == []
    assert many_cycles(seed, 0.01, 60, step=0.03) != []


# ----------------------------------------------------------------------------------- between logs
LOADS = (45.0, 36.0, 27.0, 18.0, 9.0, 4.5)


def made(
    load: float | None,
    name: str = "",
    *,
    v: float = 0.8,
    gen: float = 1.0,
    trans: float = 1.0,
    seed: int = 0,
) -> LogEfficiency:
    """A log with copper loss, friction and a constant line tension; `gen` and `trans` are errors
    of its efficiencies.
    """
    rng = np.random.default_rng([seed, int(1000 * (load or 1.0)), int(1e4 * v)])
    ohm = load or 20.0
    power = 1500.0 * v * v * 27.0 / (ohm + 4.0)
    eta_gen = (
        gen / (1.15 + 1.8 / ohm + 0.003 * ohm * 0.8 / v) * (1.0 + 0.002 * rng.standard_normal())
    )
    eta_trans = trans / (1.02 + 110.0 * v / power) * (1.0 + 0.002 * rng.standard_normal())
    eta = {"eta_trans": eta_trans, "eta_gen": eta_gen, "eta_pto": eta_gen * eta_trans}
    return LogEfficiency(name or f"{load}", "rig", load, v, power, eta, dict.fromkeys(eta, 0.002))


def names(logs: Sequence[LogEfficiency], metric: str | None = None) -> set[str]:
    return {apart.name for apart in logs_apart(logs) if metric in (None, apart.metric)}


@pytest.mark.parametrize("seed", range(10))
def test_a_sound_campaign_has_no_log_apart(seed: int) -> None:
    assert names([made(load, seed=seed) for load in LOADS]) == set()
    assert (
        names([made(load, f"{load} {k}", seed=seed + k) for load in LOADS for k in range(3)])
        == set()
    )
    sweep = [
        made(load, f"{load} {v}", v=v, seed=seed)
        for load in (36.0, 9.0)
        for v in (0.3, 0.5, 0.7, 0.9)
    ]
    assert names(sweep) == set()


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("error", [-0.08, 0.08])
@pytest.mark.parametrize("load", [36.0, 27.0, 18.0])
def test_a_log_with_a_wrong_gain_lies_apart_from_its_neighbours(
    load: float, error: float, seed: int
) -> None:
    for which in ("gen", "trans"):
        logs = [made(x, seed=seed, **{which: 1.0 + error * (x == load)}) for x in LOADS]  # type: ignore[arg-type]
        (apart,) = logs_apart(logs)
        assert (apart.name, apart.metric) == (f"{load}", f"eta_{which}")
        sound = made(load, seed=seed).eta[f"eta_{which}"]
        assert apart.expected == pytest.approx(sound, abs=0.02)


def test_one_of_three_logs_at_one_load_lies_apart_and_one_of_two_may_be_either() -> None:
    three = [
        made(9.0, name, seed=k, gen=1.0 - 0.07 * (name == "b")) for k, name in enumerate("abc")
    ]
    (apart,) = logs_apart(three)
    assert (apart.name, apart.metric, apart.or_else) == ("b", "eta_gen", ())
    (apart,) = logs_apart(three[:2])
    assert {apart.name, *apart.or_else} == {"a", "b"}


def test_logs_of_other_kinds_of_unknown_loads_and_open_circuits_are_not_compared() -> None:
    wrong = made(27.0, "wrong", gen=0.9)
    sound = [made(load) for load in LOADS if load != 27.0]
    assert names([*sound, wrong]) == {"wrong"}
    assert names([*sound, msgspec.structs.replace(wrong, kind="another rig")]) == set()
    assert names([*sound, msgspec.structs.replace(wrong, load=None)], "eta_gen") == set()
    assert names([*sound, msgspec.structs.replace(wrong, load=math.inf)]) == set()
    assert logs_apart([]) == []


@given(
    st.lists(
        st.tuples(
            st.sampled_from([None, math.inf, 1e-9, 4.5, 9.0, 1e12]),
            st.floats(0.0, 1.0, exclude_min=True),
            st.one_of(st.none(), st.floats(0.0, 1.0)),
            st.one_of(st.none(), st.floats(-10.0, 1e6)),
        ),
        max_size=9,
    )
)
def test_whatever_the_logs_say_is_borne(
    rows: list[tuple[float | None, float, float | None, float | None]],
) -> None:
    logs = [
        LogEfficiency(
            f"{k}",
            "rig",
            load,
            v,
            power,
            {"eta_trans": eta, "eta_gen": v, "eta_pto": eta},
            {"eta_gen": v},
        )
        for k, (load, v, eta, power) in enumerate(rows)
    ]
    for apart in logs_apart(logs):
        assert math.isfinite(apart.expected)


def noisy_current(seed: int, sd: float) -> Run:
    """One log with noise of the current."""
    noise = sd * np.random.default_rng(seed).standard_normal(log(4).t.size)
    return msgspec.structs.replace(
        log(4), channels={**log(4).channels, "idc": log(4).channels["idc"] + noise}
    )


def test_noise_of_a_sensor_is_no_change() -> None:
    found = [changes(noisy_current(seed, 1.0), 4) for seed in range(40)]
    assert sum(map(bool, found)) <= 1
