"""Whether effects are named from the thresholds that a diagnosis states: above them nearly always, below them at most half.

The diagnosis of a campaign without any effect states from which size each effect alone would have been named. The model of
the rig then simulates the same motions with one effect of 1.2 times (odd numbers) and 0.6 times (even numbers) that size.
Numbers of the rig, loads, gains, zeros and noise are drawn anew for each case, within their stated uncertainties.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
from measure import CAMPAIGN
from trial_cases import Found, commit
from trial_progress import Printed
from trial_scores import Bar, Figure, counted, table

from winchcascade.batch.campaign_diagnosis import diagnose_campaign
from winchcascade.blind.cases import campaign_toml, log_text
from winchcascade.blind.drive import GRID
from winchcascade.blind.injected import INJECTED
from winchcascade.blind.twin import TETHER_NOISE, TETHER_WIDTH, smooth_noise
from winchcascade.blind.twin_numbers import LOAD_SCATTER, LOADS, SENSORS
from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.files import scratch_folder
from winchcascade.core.jobs import Workers
from winchcascade.core.quantity import Quantity
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Run, Signal
from winchcascade.diagnosis.diagnose import diagnose
from winchcascade.diagnosis.nuisances import SECTIONS, shifted
from winchcascade.diagnosis.suspects import freedom, with_values
from winchcascade.ingest.read import read_run
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import EFFECTS
from winchcascade.rig.effects.effect import ActiveEffect
from winchcascade.rig.simulate import simulate

SEED = 18_020
FACTORS = (1.2, 0.6)
"""Size of an effect over its threshold, in turn. [1]"""

RESULTS = "thresholds.jsonl"

THRESHOLD_CASES, BASE_CASES = 80, 20
"""Number of cases, and of those that share the thresholds of one campaign without an effect."""


class Stated(msgspec.Struct, frozen=True):
    """Thresholds by effect that the diagnosis of one campaign states, as reported values; effects without one are left out."""

    base: int
    verdict: str
    values: dict[str, float]


class ThresholdResult(msgspec.Struct, frozen=True):
    """One case: its effect, its size over the threshold [1], the reported value that was injected, and the diagnosis."""

    number: int
    effect: str
    factor: float
    value: float
    found: Found
    commit: str


class ThresholdOrder(msgspec.Struct, frozen=True):
    """One campaign to simulate and diagnose: its case, 0 for one without an effect, its base, and the folder of the results."""

    number: int
    base: int
    out: str


def drawn_rig(rig: Rig, rng: np.random.Generator) -> Rig:
    """Draw the numbers of a rig within the uncertainties that its file states."""
    numbers = {
        (section, name): getattr(getattr(rig, section), name)
        for section in SECTIONS
        for name in getattr(rig, section).__struct_fields__
    }
    return shifted(rig, {key: rng.normal(0.0, q.u or 0.0) for key, q in numbers.items() if isinstance(q, Quantity)})


def write_simulated_campaign(folder: Path, effects: list[ActiveEffect], rng: np.random.Generator) -> None:
    """Simulate the motions of the shipped campaign by the model of the rig, and write what sensors would have logged."""
    model = baseline(drawn_rig(built_in(), rng))
    for effect in effects:
        model = effect.apply(model)
    gains, loads = {name: rng.normal(1.0, LOAD_SCATTER) for name in SENSORS}, {}
    for entry in load_campaign(CAMPAIGN).runs:
        log = entry.file.stem
        run = read_run(entry.file, load=entry.load)
        true_load = LOADS[log] * (1.0 if log == "open_circuit" else rng.normal(1.0, LOAD_SCATTER))
        solved = simulate(msgspec.structs.replace(run, load=true_load), model).run
        (folder / f"{log}.csv").write_text(log_text(readings(solved, gains, rng)), encoding="utf-8")
        loads[log] = math.inf if log == "open_circuit" else LOADS[log]
    (folder / "campaign.toml").write_text(campaign_toml("thresholds", loads), encoding="utf-8")


def readings(run: Run, gains: dict[str, float], rng: np.random.Generator) -> dict[str, Signal]:
    """Readings of the sensors, by channel in the units of the log, with gains, zeros and noise."""
    grid = np.arange(run.t[0], run.t[-1] + GRID, GRID)
    columns = {"time": run.t, "displacement": run.channels["displacement"], "velocity": run.channels["velocity"]}
    for name, sensor in SENSORS.items():
        zero, noise = rng.normal(0.0, sensor.zero), rng.normal(0.0, sensor.noise, run.t.size)
        sway = TETHER_NOISE * smooth_noise(grid.size, TETHER_WIDTH, rng) if name == "force" else np.zeros(grid.size)
        value = run.channels[name] / sensor.unit * gains[name] + zero + noise + np.interp(run.t, grid, sway)
        columns[name] = np.round(np.round(value / sensor.step) * sensor.step, sensor.decimals)
    return {name: np.round(value, 6) for name, value in columns.items()}


def sized(name: str, value: float) -> ActiveEffect:
    """An effect whose reported parameter has a value, on the way from its absence to the far end of its range."""
    effect = EFFECTS[name]
    free = freedom(effect)
    way = np.where(free.high - free.absent >= free.absent - free.low, free.high, free.low) - free.absent
    shares = np.linspace(0.0, 1.5, 3001)
    reported = [with_values(effect, free.absent + share * way).reported for share in shares]
    best = int(np.argmin(np.abs(np.asarray(reported) - value)))
    return with_values(effect, free.absent + shares[best] * way)


def do_base(order: ThresholdOrder) -> str:
    """Write the thresholds that the diagnosis of a campaign without an effect states."""
    with scratch_folder() as scratch:
        folder = scratch / "base"
        folder.mkdir()
        write_simulated_campaign(folder, [], np.random.default_rng([SEED, 0, order.base]))
        runs = [read_run(entry.file, load=entry.load) for entry in load_campaign(folder).runs]
        found = diagnose(runs, built_in(), EFFECTS)
    values = {one.effect: one.value for one in found.thresholds if one.value is not None}
    stated = Stated(order.base, found.verdict, values)
    _base_path(order).write_bytes(msgspec.json.encode(stated))
    return str(order.base)


def _base_path(order: ThresholdOrder) -> Path:
    return Path(order.out) / f"thresholds_base_{order.base}.json"


def do_threshold_case(order: ThresholdOrder) -> str:
    """Simulate and diagnose one case, and add its result."""
    stated = msgspec.json.decode(_base_path(order).read_bytes(), type=Stated)
    names = np.random.default_rng([SEED, 1]).permutation([name for name in INJECTED if name in stated.values])
    name, factor = str(names[(order.number - 1) // 2 % len(names)]), FACTORS[(order.number - 1) % 2]
    absent = with_values(EFFECTS[name], freedom(EFFECTS[name]).absent).reported
    value = absent + factor * (stated.values[name] - absent)
    with scratch_folder() as scratch:
        folder = scratch / "case"
        folder.mkdir()
        write_simulated_campaign(folder, [sized(name, value)], np.random.default_rng([SEED, 2, order.number]))
        record = diagnose_campaign(folder / "campaign.toml", suspects=EFFECTS, seed=0, predictions=None)
    result = ThresholdResult(order.number, name, factor, value, msgspec.convert(record, Found), commit())
    with (Path(order.out) / RESULTS).open("ab") as lines:
        lines.write(msgspec.json.encode(result) + b"\n")
    return name


def is_named(result: ThresholdResult) -> bool:
    """Whether the effect is a cause, or a declared alternative of one."""
    return any(result.effect in counted(cause) for cause in result.found.causes)


def threshold_lines(results: list[ThresholdResult]) -> Iterator[str]:
    """Lines of the table, and of the cases that missed."""
    above, below = ([r for r in results if r.factor == factor] for factor in FACTORS)
    yield from table(
        [
            Figure(
                "named at 1.2 times the threshold", sum(map(is_named, above)), len(above), Bar("90 % of 40", 0.9, 40)
            ),
            Figure(
                "named at 0.6 times the threshold",
                sum(map(is_named, below)),
                len(below),
                Bar("half of 40", 0.0, 40, 0.5),
            ),
        ]
    )
    for r in sorted(results, key=lambda r: r.number):
        if is_named(r) != (r.factor > 1.0):
            causes = ", ".join(cause.effect for cause in r.found.causes) or "no cause"
            yield f"  {r.number:>4}  {r.effect:<18} x {r.factor:g} = {r.value:<10.4g} -> {r.found.verdict}: {causes}"


def read_done(out: Path) -> list[ThresholdResult]:
    """Results that are there."""
    path = out / RESULTS
    lines = path.read_bytes().splitlines() if path.is_file() else []
    return [msgspec.json.decode(line, type=ThresholdResult) for line in lines]


def run_thresholds(out: Path, first: int, count: int, jobs: int) -> None:
    """Do the cases that are not done yet, after the campaigns without an effect that state their thresholds."""
    done = {result.number for result in read_done(out)}
    orders = [ThresholdOrder(n, (n - 1) // BASE_CASES, str(out)) for n in range(first, first + count) if n not in done]
    bases = {order.base: order for order in orders if not _base_path(order).is_file()}
    for work, named in (
        (do_base, {f"thresholds of campaign {base}": order for base, order in bases.items()}),
        (do_threshold_case, {f"thresholds {order.number}": order for order in orders}),
    ):
        for _ in Workers(jobs).run(work, named, Printed()):
            pass
