"""Put rigs of the independent twin under drawn seas, and print how many bands of `sea` hold beside
the bars.

Each case diagnoses a rig with one to three effects on four loads and an open circuit of a crane,
draws a sea, and compares mean power, efficiency and peaks with the twin in the same waves. Within a
limit of the current it compares the gain of the best fixed load, and that of the schedule of a
design over the best of fifty fixed loads. Results are lines of JSON in OUT; a case that is there
already is not done again. --score prints the table of what is there.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
from design_trials import FITTED, OF_SENSORS, Result, Row, diagnosed, interval, without
from scipy.interpolate import CubicHermiteSpline

from winchcascade.blind.drive import GRID
from winchcascade.blind.injected import PARTS, draw_hidden
from winchcascade.blind.twin import Twin, draw_twin, solve_twin
from winchcascade.core.files import scratch_folder
from winchcascade.core.jobs import one_thread_each
from winchcascade.core.run import Signal
from winchcascade.design.design import design
from winchcascade.design.design_result import Limits
from winchcascade.diagnosis.handover.posterior import RigPosterior, posterior_of_rig
from winchcascade.diagnosis.handover.tested import Tested, tested_by
from winchcascade.sea.in_sea import Control, fixed, scheduled
from winchcascade.sea.line_motion import LEAD_IN
from winchcascade.sea.sea_study import Seas, sea_study
from winchcascade.sea.wave_spectra import SeaState, Waves, realised

SEED, CASES = 5151, 40

MINUTES = 2.0
"""Length of each sea: the twin takes long. [min]"""

PERIODS, SPEEDS = (4.0, 12.0), (0.12, 0.26)
"""Ranges of peak periods [s], and of the standard deviation of the line velocity [m/s], so that
peaks stay in the domain.
"""

FIXED_LOADS = 50
"""Number of fixed loads, evenly in their logarithm between those of the logs, that the schedule is
compared with. [1]
"""

LIMIT = (0.5, 0.8)
"""Range of the limit of the stator current, over the largest one in the sea at the smallest load of
the logs: without a limit this load is the best at every speed. [1]
"""

PAID_OUT = 30.0
"""Time in which the line is paid out before the waves come. [s]"""

BARS = {
    "p_gen_w": "93 to 98 %", "p_line_w": "93 to 98 %", "eta_pto": "93 to 98 %", "peaks": "93 to 98 %", "beyond the domain": "",
    "best over fixed": "90 %", "schedule over best": "90 %", "gains beyond": "",
}  # fmt: skip


def sea_case(k: int, folder: Path) -> Result:
    """Diagnose a rig, and compare its sea with the twin."""
    rng = np.random.default_rng([SEED, k])
    names = [str(name) for name in rng.choice(sorted(PARTS), 1 + k % 3, replace=False)]
    twin = draw_twin(draw_hidden(dict.fromkeys(names, 1.0), None, rng), rng)
    found, _ = diagnosed(twin, rng, FITTED, (), folder)
    posterior, tested = posterior_of_rig(found), tested_by(found)
    assert tested is not None
    tp, load = (
        float(rng.uniform(*PERIODS)),
        float(np.exp(rng.uniform(*np.log([min(tested.loads), max(tested.loads)])))),
    )
    unit = realised(SeaState(1.0, tp), 60.0 * MINUTES, k)
    per_height = float(np.linalg.norm(2.0 * math.pi * unit.frequency * unit.amplitude)) / math.sqrt(
        2.0
    )
    sea = SeaState(float(rng.uniform(*SPEEDS)) / per_height, tp)
    seas = Seas((sea,), (math.nan,), minutes=MINUTES, seed=k)
    (most,) = sea_study(posterior, tested, seas, load=min(tested.loads), draws=0).rows
    limits = {"current": float(rng.uniform(*LIMIT)) * most.values["i_s_a"].value}
    schedule = schedule_of(posterior, tested, limits)
    made = sea_study(
        posterior, tested, seas, load=load, schedule=schedule, compare=True, limits=limits
    )
    (row,) = made.rows

    def given(control: Control) -> dict[str, float]:
        return in_waves(twin, realised(sea, 60.0 * MINUTES, k), tp, made.payout, control)

    true = given(fixed(load))
    rows = []
    for name in ("p_gen_w", "p_line_w", "eta_pto", "force_n", "i_dc_rms_a", "vdc_v"):
        kind = "peaks" if name in ("force_n", "i_dc_rms_a", "vdc_v") else name
        rows.append(
            interval(
                kind if row.covered() else "beyond the domain",
                true[name],
                row.values[name],
                0.0,
                name,
                load,
            )
        )
    best = given(fixed(row.best_load))["p_gen_w"]
    loads = np.geomspace(min(tested.loads), max(tested.loads), FIXED_LOADS)
    within = loads[loads >= row.best_load]  # smaller ones exceed the limit, or give less
    largest = largest_of(lambda at: given(fixed(at))["p_gen_w"], within)
    gains = {
        "best_over_fixed": best / true["p_gen_w"] - 1.0,
        "schedule_over_best": given(schedule)["p_gen_w"] / max(largest, best) - 1.0,
    }
    for name, gain in gains.items():
        of = name.replace("_", " ") if row.covered(name) else "gains beyond"
        rows.append(interval(of, gain, row.gain[name], 0.0, name, row.best_load, load))
    where = (sea.hs, tp, row.outside, row.beyond["best"], row.beyond["schedule"])
    rows = [msgspec.structs.replace(one, where=(*one.where, *where)) for one in rows]
    return Result("seas", k, names, [cause.effect for cause in found.causes], rows)


def schedule_of(posterior: RigPosterior, tested: Tested, limits: dict[str, float]) -> Control:
    """The schedule of a design for most power within limits."""
    rows = [
        (one.rpm_low, one.rpm_high, one.load)
        for one in design(posterior, tested, limits=Limits(**limits)).schedule
        if one.criterion == "power" and one.load is not None
    ]
    return scheduled(rows, "design")


def largest_of(power: Callable[[float], float], loads: Signal) -> float:
    """The largest power at any of some loads that rise: over the load it has one maximum, so it
    rises up to that.
    """
    largest = -math.inf
    for load in loads.tolist():
        found = power(load)
        if found < largest:
            break
        largest = found
    return largest


def in_waves(
    twin: Twin, waves: Waves, tp: float, payout: float, control: Control
) -> dict[str, float]:
    """What a twin gives in some waves at a true load or by a schedule."""
    count, lead = round(waves.duration / GRID), math.ceil(LEAD_IN * tp / GRID)
    omega = 2.0 * math.pi * waves.frequency
    x, v = (waves.sampled((1j * omega) ** k * waves.amplitude, count) for k in range(2))
    x, v = (np.concatenate([one[count - lead :], one]) for one in (payout + x, v))
    way = CubicHermiteSpline(
        [0.0, PAID_OUT], [0.0, x[0]], [0.0, v[0]]
    )  # the twin has its precharge where it begins
    before = np.arange(0.0, PAID_OUT, GRID)
    x, v, lead = np.append(way(before), x), np.append(way(before, 1), v), lead + before.size
    speeds = tuple(rpm * math.pi / 30.0 for rpm in control.rpm)
    at_load = msgspec.structs.replace(
        without(twin, OF_SENSORS), loads={"here": 1.0}, schedule=(speeds, control.loads)
    )
    solved = solve_twin(at_load, "here", x, v, 0.0)
    speed = np.asarray(0.5 * (solved.v[1:] + solved.v[:-1]), dtype=np.float64)[lead:]
    force, vdc, idc, omega_gen = (
        solved.channels[name][lead:] for name in ("force", "vdc", "idc", "omega")
    )
    turn = round(2.0 * math.pi / (twin.fixed.pole_pairs * float(omega_gen[np.argmax(vdc)])) / GRID)
    size = min(speed.size, force.size)
    rate, electrical = force[:size] * speed[:size], vdc * idc
    return {
        "p_line_w": float(rate.mean()),
        "p_gen_w": float(electrical.mean()),
        "eta_pto": float(
            electrical.mean() / np.maximum(rate, 0.0)[speed[:size] > 0.0].sum() * size
        ),
        "force_n": float(force.max()),
        "vdc_v": float(np.convolve(vdc, np.full(turn, 1.0 / turn), "valid").max()),
        "i_dc_rms_a": float(np.sqrt(np.mean(idc**2))),
    }


def score(results: list[Result]) -> None:
    """Print what held beside the bars."""
    for of, bar in BARS.items():
        rows: list[Row] = [row for one in results for row in one.rows if row.of == of]
        if rows:
            share, rms = (
                100.0 * np.mean([row.holds for row in rows]),
                np.sqrt(np.mean([row.z**2 for row in rows])),
            )
            print(f"{of:20} {share:5.1f} % of {len(rows):3}  {bar:10}  rms {rms:.2f}")


def main() -> None:
    """Do the cases that are not done, or print the scores."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--cases", type=int, default=CASES)
    parser.add_argument("--score", action="store_true")
    given = parser.parse_args()
    lines = given.out.read_bytes().splitlines() if given.out.is_file() else []
    done = [msgspec.json.decode(line, type=Result) for line in lines]
    if given.score:
        return score(done)
    one_thread_each()
    for k in sorted(set(range(given.cases)) - {one.case for one in done}):
        with scratch_folder() as folder:
            found = sea_case(k, folder)
        with given.out.open("ab") as out:
            out.write(msgspec.json.encode(found) + b"\n")
    return None


if __name__ == "__main__":
    main()
