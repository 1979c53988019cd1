"""Checks over phases on the shipped logs with one thing wrong, or nothing."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from rigs import calibrated_rig
from synthetic import Scenario, make_log, write_csv

from winchcascade import Reduction, Run, read_run, reduce
from winchcascade.core.errors import OptionError
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Finding
from winchcascade.reduction.checks.sampling import update_interval
from winchcascade.reduction.error_model import SAMPLING
from winchcascade.reduction.uncertainty import uncertainty

CAMPAIGN = Path(__file__).parents[2] / "fixtures" / "campaign"
LOGS = {
    "r45ohm": (45.0, 5.48), "r36ohm": (36.0, 5.48), "r18ohm": (18.0, 5.96), "r4p5ohm": (4.5, 5.96),
    "open_circuit": (math.inf, 4.0),
}  # fmt: skip
"""Load [ohm] and window [s] of each log."""

Signal = np.ndarray
Maker = Callable[[Run], dict[str, Signal]]


@cache
def clean(name: str = "r45ohm") -> Run:
    return read_run(CAMPAIGN / f"{name}.csv", rig=calibrated_rig(), load=LOGS[name][0])


def changed(run: Run, **channels: Signal) -> Run:
    return replace(run, channels={**run.channels, **channels})


def of(name: str, run: Run, rig: Rig | None = None) -> Reduction:
    return reduce(run, window=LOGS[name][1], rig=rig)


def kinds(found: Reduction) -> list[tuple[str, str | None]]:
    return [(f.kind, f.channel) for f in found.quality if f.kind != "out_of_range"]


def one(found: Reduction, kind: str) -> Finding:
    (finding,) = [f for f in found.quality if f.kind == kind]
    return finding


def late(seconds: float, *names: str) -> Maker:
    return lambda run: {n: np.interp(run.t - seconds, run.t, run.channels[n]) for n in names}


def gained(name: str, gain: float, level: float = 0.5) -> Maker:
    """A channel with another gain above a share of its largest value."""
    return lambda run: {
        name: (x := run.channels[name]) * (1.0 + gain * (x > level * x.max())),
    }


def added(name: str, value: float, under_load: float = -1.0) -> Maker:
    """A channel with an offset, from a share of its largest value on."""
    return lambda run: {name: (x := run.channels[name]) + value * (x > under_load * x.max())}


def stepped(name: str, step: float) -> Maker:
    return lambda run: {name: np.round(run.channels[name] / step) * step}


def held(name: str, every: int) -> Maker:
    return lambda run: {name: run.channels[name][np.arange(run.t.size) // every * every]}


def drifting(name: str, over: float) -> Maker:
    return lambda run: {name: run.channels[name] + over * (run.t - run.t[0]) / np.ptp(run.t)}


LAGS = [
    (late(s, c), ("channel_lag", c if s > 0 else other))
    for s in (-2.0, -0.12, 0.12, 0.6)
    for c, other in (
        ("velocity", "displacement"),
        ("idc", "vdc"),
        ("vdc", "idc"),
        ("force", "torque"),
    )
]
STEPS = [
    (gained(c, g), ("gain_step", None))
    for c in ("force", "torque", "vdc", "idc")
    for g in (-0.04, 0.06)
]
ZEROS = [
    *((added(c, s * u), ("zero_offset", c)) for c, u in (("torque", 3.6), ("idc", 0.06), ("vdc", 0.6)) for s in (-1, 1)),
    *((added("force", s * 250.0), ("zero_offset", "force")) for s in (-1, 1)),
    *((drifting("force", s * 60.0), ("zero_offset", "force")) for s in (-1, 1)),
]  # fmt: skip
SLOW = [(held("vdc", 15), ("coarse_sampling", "vdc"))]
COARSE = [
    (stepped(c, step), ("coarse_resolution", c))
    for c, step in (("velocity", 0.05), ("force", 50.0), ("torque", 4.0), ("vdc", 5.0), ("idc", 0.1), ("idc", 0.5))
]  # fmt: skip
TOGETHER = [
    (late(s, *names), ("channel_lag", names[0]))
    for s in (-0.6, -0.2, 0.2, 0.6)
    for names in (("vdc", "idc"), ("torque", "force"))
]
UNDER_LOAD = [
    (added("idc", 0.2, 0.1), ("gain_step", None)),
    (added("torque", 15.0, 0.4), ("gain_step", None)),
]


@pytest.mark.parametrize("name", list(LOGS))
def test_a_log_without_a_fault_has_no_finding(name: str) -> None:
    assert kinds(of(name, clean(name))) == []
    assert kinds(reduce(clean(name), window="payout")) == []


@pytest.mark.parametrize(
    ("maker", "expected"), [*LAGS, *TOGETHER, *STEPS, *ZEROS, *SLOW, *COARSE, *UNDER_LOAD]
)
@pytest.mark.parametrize("name", ["r45ohm", "r18ohm"])
def test_a_fault_is_found_with_its_kind_and_channel(
    name: str, maker: Maker, expected: tuple[str, str | None]
) -> None:
    found = kinds(of(name, changed(clean(name), **maker(clean(name)))))
    assert expected in found or (expected[1] is None and expected[0] in dict(found)), found


@pytest.mark.parametrize(
    "maker",
    [late(0.08, "velocity"), late(-0.08, "idc"), late(0.08, "force"), late(0.08, "vdc", "idc"), gained("force", 0.003),
     added("torque", 0.6), added("force", 40.0), drifting("force", 5.0), stepped("velocity", 0.004), stepped("idc", 0.02)],
)  # fmt: skip
def test_less_than_physics_accuracy_and_noise_allow_is_no_fault(maker: Maker) -> None:
    assert kinds(of("r45ohm", changed(clean(), **maker(clean())))) == []


# ------------------------------------------------------------------------------------------- load
@pytest.mark.parametrize(
    ("name", "load"), [(n, x) for n, (x, _) in LOGS.items() if math.isfinite(x)]
)
def test_the_measured_load_is_that_of_the_log_and_questions_a_stated_one_from_five_standard_uncertainties(
    name: str, load: float
) -> None:
    rig = calibrated_rig()
    without_bleed = replace(rig, dc_link=replace(rig.dc_link, r_bleed=None))
    measured = reduce(clean(name)).measured_load
    assert measured is not None
    assert measured.ohm == pytest.approx(load, rel=0.002)
    assert reduce(replace(clean(name), load=None)).measured_load == measured
    for times in (-6.5, -3.5, 3.5, 6.5):
        stated = measured.ohm * (1.0 + times * math.hypot(measured.u / measured.ohm, 0.001))
        found = dict(kinds(reduce(replace(clean(name), load=stated), rig=without_bleed)))
        assert ("load_mismatch" in found) == (abs(times) > 5.0)


@pytest.mark.parametrize(
    ("name", "load", "found"),
    [
        ("r45ohm", math.inf, True),
        ("open_circuit", None, True),
        ("r45ohm", None, False),
        ("r45ohm", 45.2, False),
    ],
)
def test_an_open_circuit_and_a_load_are_distinguished(
    name: str, load: float | None, found: bool
) -> None:
    assert ("load_mismatch" in dict(kinds(reduce(replace(clean(name), load=load))))) is found


@pytest.mark.parametrize("factor", [0.7, 0.95, 1.4])
def test_an_idc_computed_from_an_assumed_load_is_found_by_its_noise(factor: float) -> None:
    load = 45.0 * factor
    run = replace(changed(clean(), idc=clean().channels["vdc"] / load), load=load)
    assert one(of("r45ohm", run), "load_mismatch").channel == "idc"


# ------------------------------------------------------------------------------------------ zeros
def test_a_zero_that_steps_within_the_last_payout_is_reported_with_its_hold() -> None:
    last = of("r45ohm", clean()).cycles[-1].phases
    run = changed(clean(), torque=clean().channels["torque"] + 4.0 * (clean().t > last.onset + 2.0))
    finding = one(of("r45ohm", run), "zero_offset")
    assert last.hold is not None
    assert finding.start is not None
    assert last.hold[0] < finding.start < last.hold[1]


def test_without_pressure_the_gas_law_and_the_displacement_give_the_force() -> None:
    channels = {n: x for n, x in clean().channels.items() if n != "pressure"}
    for offset, found in ((0.0, []), (250.0, [("zero_offset", "force")])):
        run = replace(clean(), channels={**channels, "force": channels["force"] + offset})
        assert kinds(of("r45ohm", run)) == found


# ----------------------------------------------------------------------------------------- cycles
def test_a_cycle_that_was_pasted_again_is_reported_as_a_copy() -> None:
    first = of("r45ohm", clean()).cycles[0].phases
    assert first.haul_in is not None
    a, b = np.searchsorted(clean().t, (first.onset - 2.0, first.haul_in[1] + 1.5)).tolist()
    rows = np.concatenate([np.arange(a, b)] * 3)
    channels = {name: x[rows] for name, x in clean().channels.items()}
    run = replace(clean(), t=0.04 * np.arange(rows.size), channels=channels, samples=rows.size)
    found = of("r45ohm", run)
    assert one(found, "repeated_rows").count == 2
    assert found.max_deviation_percent.energy_line == pytest.approx(0.0, abs=0.1)


def strokes(folder: Path, *travels: float, stop: float = 0.0) -> Run:
    """A log of payouts of some travels; the second has a stop, where the others have none."""
    log = make_log(Scenario(payouts=tuple((x, 0.85) for x in travels)), np.random.default_rng(2))
    write_csv(log, folder / "log.csv")
    run = read_run(folder / "log.csv", load=36.0)
    if not stop:
        return run
    onset = reduce(run, window="payout").cycles[1].phases.onset + 2.5
    t = np.arange(0.0, run.t[-1] + stop, 0.04)
    rate = np.interp(t, onset + np.array([-0.5, 0.0, stop, stop + 0.5]), (1.0, 0.0, 0.0, 1.0))
    before = np.cumsum(rate) * 0.04
    moving = {"velocity", "torque", "vdc", "idc"}
    channels = {
        n: np.interp(before, run.t, x) * (rate if n in moving else 1.0)
        for n, x in run.channels.items()
    }
    return replace(run, t=t, channels=channels, samples=t.size)


@pytest.mark.parametrize(
    ("travels", "stop", "window", "odd"),
    [((9.6, 9.6, 9.6), 0.0, "payout", None), ((9.6, 4.8, 9.6), 0.0, "payout", 1), ((9.6, 9.6, 4.0, 9.6), 0.0, "payout", 2),
     ((9.6, 9.6), 0.0, 5.48, None), ((9.6, 9.6, 9.6), 1.0, 5.48, 1), ((9.6, 9.4, 9.6), 0.0, 5.48, None)],
)  # fmt: skip
def test_strokes_that_differ_are_reported_with_their_place(
    travels: tuple[float, ...], stop: float, window: float | str, odd: int | None, tmp_path: Path
) -> None:
    found = reduce(strokes(tmp_path, *travels, stop=stop), window=window)
    places = [f.start for f in found.quality if f.kind == "stroke_mismatch"]
    assert places == ([] if odd is None else [pytest.approx(found.cycles[odd].window.onset)])


# --------------------------------------------------------------------------- windows and sampling
def test_a_window_longer_than_most_payouts_is_rejected_with_the_longest_that_fits() -> None:
    with pytest.raises(OptionError, match=r"30 s.*at most 13\.4\d s"):
        reduce(clean(), window=30.0)
    assert kinds(reduce(clean(), window=13.4)) == []


@pytest.mark.parametrize("window", [5.0, "auto", "payout"])
def test_coarse_sampling_is_reported_where_the_mean_energies_err_and_nowhere_else(
    tmp_path: Path, window: float | str
) -> None:
    write_csv(
        make_log(Scenario(rate=100.0, noise=0.0), np.random.default_rng(1)), tmp_path / "log.csv"
    )
    whole = read_run(tmp_path / "log.csv", load=36.0)
    true = reduce(whole, window=window)
    for step, first in ((1, 0), (4, 3), (10, 3), (20, 19), (50, 16), (100, 0), (100, 33)):
        channels = {n: x[first::step] for n, x in whole.channels.items()}
        found = reduce(
            replace(whole, t=whole.t[first::step], channels=channels, fs=100.0 / step),
            window=window,
        )
        error = max(
            abs(found.mean.value(m) / true.mean.value(m) - 1.0)
            for m in ("energy_line", "energy_gen")
        )
        reported = "coarse_sampling" in dict(kinds(found))
        assert reported or error < 0.01, (step, first, error)
        assert not reported or error > 0.001, (step, first, error)


def test_coarse_sampling_counts_in_the_uncertainty(tmp_path: Path) -> None:
    write_csv(
        make_log(Scenario(rate=2.0, noise=0.0), np.random.default_rng(1)), tmp_path / "log.csv"
    )
    found = uncertainty(reduce(read_run(tmp_path / "log.csv", load=36.0), window=5.0))
    assert [r.source.channel for r in found.budget.rows if r.source is not None].count(
        SAMPLING
    ) == 1


def test_in_open_circuit_only_the_channels_of_eta_trans_count() -> None:
    for maker, found in (
        (stepped("vdc", 10.0), []),
        (stepped("force", 50.0), [("coarse_resolution", "force")]),
    ):
        assert (
            kinds(
                of("open_circuit", changed(clean("open_circuit"), **maker(clean("open_circuit"))))
            )
            == found
        )


@pytest.mark.parametrize("every", [2, 7])
def test_the_interval_of_a_slow_channel_is_that_of_its_updates(every: int) -> None:
    assert (
        update_interval(np.repeat(np.cumsum(np.where(np.arange(40) % 2, 1.0, -0.6)), every))
        == every
    )
    assert update_interval(np.random.default_rng(1).normal(size=300)) == 1
