"""Predict, schedule, repair, validate and plan for rigs of the independent twin, and print what
held beside the bars.

Results are lines of JSON in OUT, of a case each; a case that is there already is not done again, so
that a trial can be interrupted. Kind `rigs` diagnoses a rig with one to three effects on four loads
and an open circuit, and compares what is predicted, scheduled and validated with the twin. Kind
`pairs` diagnoses a rig on one log or four, and again with the run that is proposed for two confused
effects or with a random one. --score prints the table of what is there.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

import msgspec
import numpy as np
from owner_simulators import noise_free
from scipy.interpolate import PchipInterpolator

from winchcascade.batch.campaign_diagnosis import diagnose_listed
from winchcascade.blind.cases import RIG, STATED_LOADS, campaign_toml, write_log
from winchcascade.blind.crane_motion import draw_motion
from winchcascade.blind.drive import GRID
from winchcascade.blind.injected import PARTS, draw_hidden
from winchcascade.blind.twin import Solved, Twin, draw_twin, solve_twin
from winchcascade.blind.twin_log import read_log
from winchcascade.blind.twin_numbers import CRANE_LOGGER, SENSORS
from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.files import scratch_folder
from winchcascade.core.jobs import one_thread_each
from winchcascade.core.rig_file import Rig, Thresholds
from winchcascade.core.run import Run, Signal
from winchcascade.design.corrected_rig import CorrectedRig
from winchcascade.design.design import design
from winchcascade.design.design_result import METRIC, Design
from winchcascade.design.operating import PLACE, Motion, planned_cycle
from winchcascade.design.run_plan import after, determine
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.explain.planned_run import planned
from winchcascade.diagnosis.explain.planning import CLEAR, listed, options_after
from winchcascade.diagnosis.explain.windowed import QUANTITIES, quantities_of, windowed
from winchcascade.diagnosis.handover.posterior import Band, posterior_of_rig
from winchcascade.diagnosis.handover.tested import tested_by
from winchcascade.diagnosis.judge.causes import COVERED
from winchcascade.ingest.read import read_run
from winchcascade.reduction.phased_run import find_phases
from winchcascade.rig.effects.catalogue import EFFECTS
from winchcascade.rig.simulate import simulate

SEED = 4242
CASES = {"rigs": 40, "pairs": 200}
"""Number of cases by kind; one without two confused effects does not count."""

FITTED = ("open_circuit", "r45ohm", "r27ohm", "r9ohm", "r18ohm")
SINGLE = ("r27ohm",)
"""Logs that a diagnosis of each kind has."""

WITHHELD = (36.0, 30.0, 22.0, 14.0, 11.0)
MOTIONS = ((0.3, 2.0), (0.5, 4.5), (0.65, 1.2), (0.8, 3.0), (0.95, 2.0))
"""Loads [ohm], and plateaus [m/s] with ramps [s], that are predicted."""

SEARCHED = 11
"""Number of loads among which the best is searched, evenly in their logarithm. [1]"""

RESOLVED = 1e-5
"""Energy that the twin resolves, as a share of that of a cycle. [1]"""

STRENGTHS = (0.5, 1.0)
"""Strengths of an effect of a pair."""

STATED = frozenset({"load_drift"})
"""Effects that change what is stated of a run."""

OF_SENSORS = frozenset(name for name, part in PARTS.items() if part.stage == "sensor") | STATED
"""Effects that change what is read or stated, and no prediction."""

NUMBERS = {
    "restoring": {"mu": "mu", "area": "area", "p_gas": "pressure", "v_gas": "volume"}, "dc_link": {"c_dc": "c_dc"},
    "drivetrain": {"eta_mesh": "eta_mesh", "b_rotor": "b_rotor"}, "generator": {"k_e": "k_e", "r_s": "r_s", "l_s": "l_s"},
}  # fmt: skip
"""Numbers of a model by part that a twin draws."""


class Row(msgspec.Struct, frozen=True):
    """One comparison, whether it holds, its error in standard uncertainties (regret in %, a plan
    its separation), and where.
    """

    of: str
    holds: bool
    z: float
    where: tuple[float | str, ...] = ()


class Result(msgspec.Struct, frozen=True):
    """A case with the effects that are injected and the causes that are named."""

    kind: str
    case: int
    names: list[str]
    causes: list[str]
    rows: list[Row]


BARS = {
    "p_gen_w in its band": "93 to 97 %", "eta_pto in its band": "93 to 97 %", "p_gen_w beyond the domain": "",
    "eta_pto beyond the domain": "", "regret of power under 1 %": "95 %", "regret of efficiency under 1 %": "95 %",
    "worth of a repair": "90 %", "worth of no repair": "", "model error": "93 to 97 %", "proposed run": "85 %",
    "random run": "", "proposed run, not clear": "", "random run, not clear": "", "promised u within 10 %": "all",
}  # fmt: skip
"""What is compared, with its bar."""


def interval(of: str, true: float, band: Band, resolved: float, *where: float | str) -> Row:
    """Whether a true value lies in a 95 % interval; `resolved` is the standard uncertainty of
    the true value.
    """
    error = true - band.value
    low, high = (math.hypot(end - band.value, COVERED * resolved) for end in (band.low, band.high))
    u = (high if error > 0.0 else low) / COVERED
    return Row(
        of,
        -low <= error <= high,
        error / u if u else 0.0,
        (*where, true, band.value, band.low, band.high),
    )


# ------------------------------------------------------------------------------------------- twin
def diagnosed(
    twin: Twin, rng: np.random.Generator, logs: Sequence[str], extra: Sequence[Run], folder: Path
) -> tuple[ModelDiagnosis, list[Solved]]:
    """Make and diagnose a campaign of drawn logs and of further runs, each at the load and in
    the motion of one.
    """
    at, stated = {load: log for log, load in STATED_LOADS.items()}, dict(STATED_LOADS)
    motions = [(log, draw_motion(log, rng)) for log in logs]
    for run in extra:
        load = run.load or 0.0
        log = at.setdefault(load, f"planned{len(at)}")
        stated[log] = load
        twin = msgspec.structs.replace(twin, loads={log: load} | twin.loads)
        motions.append((log, (*on_grid(run.t, run.channels["velocity"]), 0.0)))
    loads, solved = {}, [solve_twin(twin, log, *motion) for log, motion in motions]
    for k, ((log, _), one) in enumerate(zip(motions, solved, strict=True), 1):
        write_log(folder / f"run{k}_{log}.csv", read_log(twin, one, rng, CRANE_LOGGER))
        loads[f"run{k}_{log}"] = stated[log]
    (folder / "campaign.toml").write_text(campaign_toml("case", loads))
    (folder / "rig.toml").write_text('name = "case"\n' + RIG.read_text(encoding="utf-8"))
    found = diagnose_listed(load_campaign(folder), EFFECTS)
    assert isinstance(found, ModelDiagnosis)
    return found, solved


def on_grid(t: Signal, v: Signal) -> tuple[Signal, Signal]:
    """Payout and velocity of a motion on the grid of the twin, by the monotone cubic that a
    motion is laid on. [m, m/s]
    """
    fine = PchipInterpolator(t, v)(np.arange(0.0, t[-1], GRID))
    return np.concatenate([[0.0], np.cumsum(0.5 * GRID * (fine[1:] + fine[:-1]))]), fine


def without(twin: Twin, names: Collection[str]) -> Twin:
    """A twin without some of its effects."""
    effects = {name: value for name, value in twin.hidden.effects.items() if name not in names}
    laws = {} if "ke_rolloff" in names else twin.hidden.laws
    return msgspec.structs.replace(
        twin, hidden=msgspec.structs.replace(twin.hidden, effects=effects, laws=laws)
    )


def truth(twin: Twin, motion: Motion, load: float, rules: Thresholds) -> dict[str, float]:
    """Power and efficiency of a twin over the payout of a reduction, and its energies over the
    motion, at a true load.
    """
    at_load = msgspec.structs.replace(without(twin, OF_SENSORS), loads={"here": load})
    solved = solve_twin(at_load, "here", *on_grid(motion.t, motion.v), 0.0)
    speed: Signal = np.asarray(0.5 * (solved.v[1:] + solved.v[:-1]), dtype=np.float64)
    rates = np.array(
        [solved.channels["force"] * speed, solved.channels["vdc"] * solved.channels["idc"]]
    )
    t: Signal = np.linspace(0.5 * GRID, (speed.size - 0.5) * GRID, speed.size)
    run = Run("motion", t, {"velocity": speed}, 1.0 / GRID, speed.size)
    (cycle,) = find_phases(run, Rig("motion", thresholds=rules), "payout").cycles
    inside = (t > cycle.onset) & (t < cycle.payout_end)
    line, electrical = rates[:, inside].mean(axis=1).tolist()
    e_line, e_gen = (rates.sum(axis=1) * GRID).tolist()
    return {
        "p_gen_w": electrical,
        "eta_pto": electrical / line,
        "e_gen_j": e_gen,
        "e_line_j": e_line,
    }


# ------------------------------------------------------------------------------------------- rigs
def rig_case(k: int, folder: Path) -> Result:
    """Diagnose a rig, and compare all that a design and a validation state with the twin."""
    rng = np.random.default_rng([SEED, k])
    names = [str(name) for name in rng.choice(sorted(PARTS), 1 + k % 3, replace=False)]
    twin = draw_twin(draw_hidden(dict.fromkeys(names, 1.0), None, rng), rng)
    found, solved = diagnosed(twin, rng, FITTED, (), folder)
    posterior, tested = posterior_of_rig(found), tested_by(found)
    assert tested is not None
    made = design(posterior, tested)
    rows = [
        *predictions(twin, CorrectedRig(posterior, tested)),
        *regrets(twin, made),
        *repairs(twin, made),
    ]
    rows += [] if STATED & set(names) else model_errors(twin, found, solved, folder)
    return Result("rigs", k, names, [cause.effect for cause in found.causes], rows)


def payout(speed: float, length: float, ramp: float) -> Motion:
    """The way out of a planned cycle, with the rest after it."""
    cycle = planned_cycle(speed, length, ramp)
    return Motion(cycle.t[:6], cycle.v[:6], speed)


def predictions(twin: Twin, rig: CorrectedRig) -> Iterator[Row]:
    """Power and efficiency at withheld loads, speeds and ramps."""
    motions = [payout(speed, rig.tested.length, ramp) for speed, ramp in MOTIONS]
    paths = [rig.path(motion) for motion in motions]
    bands = rig.bands(paths, WITHHELD)
    covered = rig.covers(paths, bands[0])
    for i, motion in enumerate(motions):
        for j, load in enumerate(WITHHELD):
            true = truth(twin, motion, load, rig.tested.rules)
            for name in METRIC.values():
                within = "in its band" if covered[i, j] else "beyond the domain"
                of, k = f"{name} {within}", PLACE[name]
                yield interval(
                    of, true[name], Band(*bands[:, i, j, k].tolist()), 0.0, load, motion.speed
                )


def regrets(twin: Twin, made: Design) -> Iterator[Row]:
    """Share of what the best load gives that a scheduled one loses, at every second band."""
    loads = np.geomspace(min(made.tested.loads), max(made.tested.loads), SEARCHED).tolist()
    for speed in sorted({one.speed for one in made.schedule})[::2]:
        out = payout(speed, made.tested.length, made.tested.ramp)
        searched = [truth(twin, out, load, made.tested.rules) for load in loads]
        for one in made.schedule:
            if one.speed == speed and one.load is not None:
                metric = METRIC[one.criterion]
                best, here = (
                    max(found[metric] for found in searched),
                    truth(twin, out, one.load, made.tested.rules)[metric],
                )
                regret = max(1.0 - here / best, 0.0)
                yield Row(
                    f"regret of {one.criterion} under 1 %",
                    regret < 0.01,
                    100.0 * regret,
                    (speed, one.load),
                )


def repairs(twin: Twin, made: Design) -> Iterator[Row]:
    """Energy that each repair brings in a cycle; that of an effect that is not injected brings
    nothing.
    """
    cycle = planned_cycle(max(row.speed for row in made.rows), made.tested.length, made.tested.ramp)
    rules, load = made.tested.rules, made.repaired_at
    acting = truth(twin, cycle, load, rules)
    for one in made.repairs:
        repaired = truth(without(twin, {one.effect}), cycle, load, rules)
        of = f"worth of {'a' if one.effect in twin.hidden.effects else 'no'} repair"
        for metric, band, sign in (("e_gen_j", one.per_cycle, 1.0), ("e_line_j", one.saved, -1.0)):
            worth = sign * (repaired[metric] - acting[metric])
            yield interval(of, worth, band, RESOLVED * acting[metric], one.effect, metric)


def model_errors(
    twin: Twin, found: ModelDiagnosis, solved: Sequence[Solved], folder: Path
) -> Iterator[Row]:
    """Error of the model of the rig file at true inputs, by run and metric."""
    model, true = found.data.nominal.physics, []
    for part, numbers in NUMBERS.items():
        own = {there: getattr(twin.numbers, here) for here, there in numbers.items()}
        model = msgspec.structs.replace(model, **{part: getattr(model, part)._replace(**own)})
    exact = msgspec.structs.replace(without(twin, OF_SENSORS), gains=dict.fromkeys(SENSORS, 1.0))
    for k, (log, one) in enumerate(zip(FITTED, solved, strict=True)):
        write_log(folder / "exact.csv", noise_free(exact, one))
        run, window = (
            read_run(folder / "exact.csv", load=found.data.logs[k].run.load),
            windowed(found.data, k),
        )
        link = (
            {"load_change": twin.loads[log] / STATED_LOADS[log] - 1.0}
            if k
            else {"r_bleed": twin.loads[log]}
        )
        at_load = msgspec.structs.replace(model, dc_link=model.dc_link._replace(**link))
        runs = (simulate(run, at_load).run, run)
        true.append(
            np.subtract(*(quantities_of(each, window.rig, window.windows) for each in runs))
        )
    for row in found.validation:
        error = float(true[row.log][QUANTITIES.index(row.quantity)])
        before = Band(row.before.error, row.before.low, row.before.high)
        yield interval("model error", error, before, 0.0, FITTED[row.log], row.quantity)


# ------------------------------------------------------------------------------------------ pairs
def pair_case(k: int, folder: Path) -> Result:
    """Diagnose a rig, and again with the run that the diagnosis proposes and with a random one
    where it lists a pair.
    """
    rng = np.random.default_rng([SEED + 1, k])
    name = str(rng.choice(sorted(set(PARTS) - OF_SENSORS)))
    twin = draw_twin(draw_hidden({name: STRENGTHS[k % 2]}, None, rng), rng)
    logs, state, rows = (SINGLE, FITTED[1:])[k % 2], rng.bit_generator.state, []
    found, _ = diagnosed(twin, rng, logs, (), folder)
    pairs, run = listed(found.found, found.causes)[0], found.experiment
    if run is not None and run.separates in pairs:
        assert run.load is not None
        options = options_after(found.data, found.found)
        assert options is not None
        time, (_, others) = after(found).setting.time, options
        random = others[int(rng.integers(len(others)))]
        for of, load, speed in (
            ("proposed run", run.load, run.speed),
            ("random run", random.load, random.speed),
        ):
            rng.bit_generator.state = state  # the same logs again
            again, _ = diagnosed(
                twin, rng, logs, [planned(load, speed, run.length, time, 1.0 / GRID)], folder
            )
            clear = "" if run.expected_z > CLEAR else ", not clear"
            rows.append(
                Row(
                    of + clear,
                    is_apart(again, run.separates, name),
                    run.expected_z,
                    (*run.separates, f"{load:g}", speed),
                )
            )
            if load < math.inf:
                promised = determine(after(found, [load], [speed]), "eta_pto", SMALL, 1)
                left = determine(after(again, [load], [speed]), "eta_pto", SMALL, 1).before
                error = promised.expected[0] / left - 1.0
                rows.append(
                    Row(
                        "promised u within 10 %",
                        abs(error) <= PROMISED,
                        error,
                        (promised.before, left),
                    )
                )
    return Result("pairs", k, [name], [cause.effect for cause in found.causes], rows)


SMALL, PROMISED = 1e-9, 0.1
"""Uncertainty that no plan reaches, and by how much a promised one may be wrong, as a share. [1]"""


def is_apart(found: ModelDiagnosis, pair: tuple[str, str], true: str) -> bool:
    """Whether one effect of a pair is named, the true one if it is of the pair, and the other
    does not explain the logs too.
    """
    named = {
        cause.effect: {one.effect for one in cause.look_alikes}
        for cause in found.causes
        if cause.effect in pair
    }
    right = len(named) == 1 and (true in named or true not in pair)
    return right and not any(set(pair) & alike for alike in named.values())


# ----------------------------------------------------------------------------------------- scores
def score(results: Sequence[Result]) -> None:
    """Print what held beside the bars, with the numbers of comparisons and of rigs."""
    for of, bar in BARS.items():
        rows = [(one.case, row) for one in results for row in one.rows if row.of == of]
        if rows:
            share, rms = (
                np.mean([(row.holds, row.z**2) for _, row in rows], axis=0) ** (1.0, 0.5)
            ).tolist()
            cases = len({case for case, _ in rows})
            print(
                f"{of:32} {100.0 * share:5.1f} % of {len(rows):4} in {cases:2} cases  {bar:10}  "
                f"rms {rms:.2f}"
            )


def main() -> None:
    """Do the cases that are not done, or print the scores."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kind", choices=CASES)
    parser.add_argument("out", type=Path)
    parser.add_argument("--score", action="store_true")
    given = parser.parse_args()
    lines = given.out.read_bytes().splitlines() if given.out.is_file() else []
    done = [msgspec.json.decode(line, type=Result) for line in lines]
    if given.score:
        return score(done)
    one_thread_each()
    for k in sorted(set(range(CASES[given.kind])) - {one.case for one in done}):
        with scratch_folder() as folder:
            found = (rig_case if given.kind == "rigs" else pair_case)(k, folder)
        with given.out.open("ab") as out:
            out.write(msgspec.json.encode(found) + b"\n")
    return None


if __name__ == "__main__":
    main()
