"""One case of a trial: make its campaign with the twin, diagnose it as a user would, and keep what is needed for the score."""

from __future__ import annotations

import math
import os
import re
import subprocess
import time
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from measure import ROOT
from trial_plans import FAMILIES, Plan
from trial_simulators import noise_free, simulated_log

from winchcascade import load_rig, read_run, reduce
from winchcascade.blind.cases import STATED_LOADS, campaign_toml, log_text
from winchcascade.blind.history import in_run, run_changes
from winchcascade.blind.injected import Hidden, draw_hidden
from winchcascade.blind.twin import FIXED, Solved, Twin, draw_motion, draw_twin, read_log, solve_twin
from winchcascade.blind.twin_numbers import SCATTER, Numbers
from winchcascade.core.files import scratch_folder
from winchcascade.core.rig_toml import DEFAULT_RIG
from winchcascade.core.run import Signal
from winchcascade.diagnosis.calibrate import calibrate
from winchcascade.diagnosis.rig_text import calibrated_text

RIG_FILE = ROOT / "winchcascade" / "rigfiles" / "hsu2026.toml"


class Number(msgspec.Struct, frozen=True):
    """A number of a cause as it was diagnosed; `at_limit` marks a one-sided interval, whose open end may be missing."""

    value: float
    low: float | None = None
    high: float | None = None
    at_limit: str | None = None
    beyond_range: bool = False

    def holds(self, truth: float) -> bool:
        """Whether the interval contains the truth."""
        return (self.low is None or self.low <= truth) and (self.high is None or truth <= self.high)


class Alternative(msgspec.Struct, frozen=True):
    """An alternative explanation of a cause."""

    effect: str


class NamedCause(msgspec.Struct, frozen=True):
    """A cause that the diagnosis names; of a wrong load with its run.

    `look_alikes` is None where the diagnosis does not write them. `trends` and `ablation` are kept as they are written.
    """

    effect: str
    probability: float = 1.0
    run: str | None = None
    look_alikes: tuple[Alternative, ...] | None = None
    trends: object = None
    ablation: object = None
    parameters: dict[str, Number] = {}
    rivals: tuple[Alternative, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The effect and its alternatives: look-alikes, then rivals."""
        others = (*(self.look_alikes or ()), *self.rivals)
        return tuple(dict.fromkeys((self.effect, *(other.effect for other in others))))


class Minor(msgspec.Struct, frozen=True):
    """An effect that is significant but not relevant."""

    effect: str


class ModelForm(msgspec.Struct, frozen=True):
    """A difference between the owner's own simulation and the model."""

    stage: str | None = None
    likely: str | None = None


class Part(msgspec.Struct, frozen=True):
    """One part of the account of a metric."""

    effect: str | None
    kind: str
    value: float | None = None
    low: float | None = None
    high: float | None = None


class Account(msgspec.Struct, frozen=True):
    """The account of one metric of one run."""

    metric: str
    load_ohm: float | str | None = None
    parts: tuple[Part, ...] = ()


class Claimed(msgspec.Struct, frozen=True):
    """Kind and size of the share of the gap that the causes close."""

    kind: str | None = None
    share_closed: float | None = None


class Found(msgspec.Struct, frozen=True):
    """The part of a diagnosis that the trials score."""

    verdict: str
    closure: Claimed | None = None
    fitted: object = None
    causes: tuple[NamedCause, ...] = ()
    minor: tuple[Minor, ...] = ()
    model_form: tuple[ModelForm, ...] | None = None
    contributions: tuple[Account, ...] = ()


class Result(msgspec.Struct, frozen=True):
    """One line of the results: a case, the true numbers of its effects, the diagnosis, and the times. [s]

    Parameters
    ----------
    shares : true contribution of the effect to eta_pto by load in ohm, where the family compares it [1]
    plain : diagnosis with the built-in rig file, where the family compares two rig files
    commit : of the checkout that diagnosed it
    processor : processor time of the diagnosis, that of child processes included [s]
    """

    plan: Plan
    parameters: dict[str, dict[str, float]]
    found: Found | None
    making: float
    diagnosing: float
    commit: str
    shares: dict[str, float] = {}
    fault: str | None = None
    plain: Found | None = None
    processor: float | None = None


def processor_time() -> float:
    """Processor time of this process and of its children that have ended. [s]"""
    return sum(os.times()[:4])


@cache
def commit() -> str:
    """Commit of this checkout, marked where files were changed since."""
    command = ["git", "-C", str(ROOT), "describe", "--always", "--dirty", "--exclude", "*"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stdout.strip() or "unknown"


def draw(plan: Plan) -> tuple[Hidden, Twin, np.random.Generator]:
    """Injected values and the twin of a case, and the generator from which the logs are drawn next."""
    rng = np.random.default_rng([FAMILIES[plan.family].seed, plan.number])
    hidden = msgspec.structs.replace(draw_hidden(plan.effects, None, rng), physics=plan.physics)
    return hidden, draw_twin(hidden, rng, plan.scatter), rng


def write_campaign(plan: Plan, folder: Path) -> None:
    """Write the logs of a case, its campaign.toml, and its rig file where that is not the built-in one."""
    _, twin, rng = draw(plan)
    stated, entry = dict(STATED_LOADS), plan.entry
    if entry is not None and entry.log is not None:
        stated[entry.log] = round(stated[entry.log] * entry.factor, 3)
    loads, order = {}, (plan.order or tuple(stated)) * plan.repeats
    for k, (log, change) in enumerate(zip(order, run_changes(plan.history, order), strict=True)):
        name = log if plan.repeats == 1 else f"{log}_{k // len(stated) + 1:02d}"
        x, v, resting = draw_motion(log, rng)
        here = in_run(twin, change)
        columns = read_log(here, solve_twin(here, log, x, v, resting), rng, plan.logger)
        if entry is not None and entry.shared:
            columns |= {key: np.round(columns[key] * entry.factor, 4) for key in ("displacement", "velocity")}
        _write_log(folder / f"{name}.csv", columns)
        if plan.simulator is not None:
            _write_log(folder / SIMULATED / f"{name}.csv", simulated_log(plan.simulator, log, x, v))
        loads[name] = stated[log]
    text = campaign_toml(f"{plan.family} {plan.number}", loads)
    if plan.simulator is not None:
        text = re.sub(r'(?m)^file = "(.*)"$', rf'file = "\1"\nsimulated = "{SIMULATED}/\1"', text)
    rig = _rig_file(plan, folder)
    if rig is not None:
        (folder / PLAIN).write_text(text, encoding="utf-8")
        (folder / "rig.toml").write_text(rig, encoding="utf-8")
        text = text.replace(f'rig = "{DEFAULT_RIG}"', 'rig = "rig.toml"', 1)
    (folder / "campaign.toml").write_text(text, encoding="utf-8")


PLAIN = "plain.toml"
"""The same campaign with the built-in rig file."""


def _rig_file(plan: Plan, folder: Path) -> str | None:
    """The rig file of a campaign whose logs are written, None for the built-in one."""
    if plan.calibrated:
        rig = load_rig("hsu2026")
        return calibrated_text(calibrate(read_run(folder / "open_circuit.csv", load=math.inf), rig))
    if plan.bias:
        return rig_text({BIASED_KEYS[name]: 1.0 + by * _stated_share(name) for name, by in plan.bias.items()})
    if plan.entry is not None and plan.entry.log is None:
        return rig_text({ENTRIES[plan.entry.effect].key: plan.entry.factor})
    return None


BIASED_KEYS = {"k_e": "k_e", "b_rotor": "b_rotor", "mu": "mu_screw", "eta_mesh": "eta_mesh"}
"""Entry of the rig file for a number of the twin."""


def _stated_share(name: str) -> float:
    """Stated uncertainty of a number as a share of it. [1]"""
    u, value = (float(getattr(numbers, name)) for numbers in (SCATTER, NOMINAL))
    return u / value


SIMULATED = "simulated"
"""Folder of the owner's own simulation."""


def _write_log(path: Path, columns: dict[str, Signal]) -> None:
    path.parent.mkdir(exist_ok=True)
    path.write_text(log_text(columns), encoding="utf-8")


def true_shares(plan: Plan, folder: Path) -> dict[str, float]:
    """True contribution of the injected effects to eta_pto by stated load: the twin with and without them, without noise.

    Both follow the motion of the first repeat. The open circuit has no eta_pto.
    """
    _, twin, rng = draw(plan)
    shares = {}
    for log, load in STATED_LOADS.items():
        motion = draw_motion(log, rng)
        solved = solve_twin(twin, log, *motion)
        read_log(
            twin, solved, rng, plan.logger
        )  # draws the noise of the campaign, after which the next motion is drawn
        if math.isfinite(load):
            plain = msgspec.structs.replace(twin, hidden=Hidden())
            etas = (
                _eta_pto(twin, solved, load, folder),
                _eta_pto(plain, solve_twin(plain, log, *motion), load, folder),
            )
            shares[repr(load)] = etas[0] - etas[1]
    return shares


def _eta_pto(twin: Twin, solved: Solved, load: float, folder: Path) -> float:
    """Efficiency of the noise-free readings. [1]"""
    path = folder / "noise_free.csv"
    _write_log(path, noise_free(twin, solved))
    eta = reduce(read_run(path, load=load)).mean.eta_pto
    if eta is None:
        raise ValueError(f"{path}: the reduction gives no eta_pto")
    return eta


class RigEntry(NamedTuple):
    """An entry of the rig file: its key, the number that a diagnosis reports of it, and the true one of a twin.

    `truth` takes the numbers of the twin and the stated value over the nominal one.
    """

    key: str
    parameter: str
    truth: Callable[[Numbers, float], float]


NOMINAL = Numbers()
ENTRIES = {
    "drum_radius": RigEntry("r_drum", "r_drum", lambda _n, _factor: FIXED.r_drum),
    "gear_ratio": RigEntry("gear_ratio", "gear_ratio", lambda _n, _factor: FIXED.gear),
    "k_e_convention": RigEntry("k_e", "k_e_ratio", lambda n, factor: n.k_e / (NOMINAL.k_e * factor)),
    "r_s_convention": RigEntry("r_s", "r_s_ratio", lambda n, factor: n.r_s / (NOMINAL.r_s * factor)),
    "l_s_convention": RigEntry("l_s", "l_s_ratio", lambda n, factor: n.l_s / (NOMINAL.l_s * factor)),
}
"""Entry of the rig file that a suspect describes."""


def true_numbers(plan: Plan) -> dict[str, dict[str, float]]:
    """True value of each number that a diagnosis reports, by effect."""
    hidden, twin, _ = draw(plan)
    entry = plan.entry
    if entry is None:
        return hidden.reported()
    if entry.log is not None:
        return {entry.effect: {"load_ohm": twin.loads[entry.log]}}
    stated = ENTRIES[entry.effect]
    return {entry.effect: {stated.parameter: stated.truth(twin.numbers, entry.factor)}}


def rig_text(factors: Mapping[str, float]) -> str:
    """The built-in rig file with wrong values: factor on each, by key."""
    text = RIG_FILE.read_text(encoding="utf-8")
    for key, factor in factors.items():
        entries = re.findall(rf"(?m)^{key} = {{ value = [0-9.e+-]+", text)
        if len(entries) != 1:
            raise SystemExit(f"{RIG_FILE}: expected one entry {key}, found {len(entries)}")
        start, value = entries[0].rsplit(" ", 1)
        text = text.replace(entries[0], f"{start} {float(value) * factor:.6g}")
    return text


class Order(msgspec.Struct, frozen=True):
    """One case to do, the file that its result is added to, a folder in which campaigns are kept, and one of campaigns that
    were made before, if any.
    """

    plan: Plan
    results: str
    keep: str | None = None
    made: str | None = None


def do_case(order: Order) -> str:
    """Make and diagnose one case, and add its result to the file of its family."""
    plan = order.plan
    with scratch_folder() as scratch:
        folder = scratch / f"{plan.family}-{plan.number:04d}"
        if order.keep is not None:
            folder = Path(order.keep) / folder.name
        folder.mkdir(parents=True, exist_ok=True)
        begin = time.perf_counter()
        campaigns = _made_before(plan, Path(order.made)) if order.made else _campaigns(plan, folder)
        result = _result(plan, campaigns, folder, time.perf_counter() - begin)
    with Path(order.results).open("ab") as lines:
        lines.write(msgspec.json.encode(result) + b"\n")
    return plan.family


def _campaigns(plan: Plan, folder: Path) -> list[Path]:
    """Make the campaign of a case; where two rig files are compared, the second is that with the built-in one."""
    write_campaign(plan, folder)
    return [folder / "campaign.toml", *([folder / PLAIN] if plan.calibrated else [])]


def _made_before(plan: Plan, made: Path) -> list[Path]:
    """The campaigns of a case in a folder that `--keep` or `--make` filled."""
    kept, other = made / f"{plan.family}-{plan.number:04d}", made / plan.family / f"{plan.number:04d}"
    found = kept if kept.is_dir() else other
    plain = found / PLAIN if found is kept else found.with_name(f"{found.name}-plain") / "campaign.toml"
    campaigns = [found / "campaign.toml", *([plain] if plan.calibrated else [])]
    missing = next((path for path in campaigns if not path.is_file()), None)
    if missing is not None:
        raise FileNotFoundError(f"{missing}: expected a campaign that --keep or --make of trials.py has made")
    return campaigns


def _result(plan: Plan, campaigns: list[Path], scratch: Path, making: float) -> Result:
    from winchcascade.batch.campaign_diagnosis import diagnose_campaign
    from winchcascade.rig.effects.catalogue import EFFECTS

    begin, used = time.perf_counter(), processor_time()
    found: list[Found] = []
    fault = None
    try:
        for campaign in campaigns:
            record = diagnose_campaign(campaign, suspects=EFFECTS, seed=0, predictions=None)
            found.append(msgspec.convert(record, Found))
            if campaign.parent == scratch and campaign.name != PLAIN:
                (scratch / "diagnosis.json").write_bytes(msgspec.json.encode(record))
    except Exception as error:  # a diagnosis that fails is a result, too
        fault = f"{type(error).__name__}: {error}"
    diagnosing, used = time.perf_counter() - begin, processor_time() - used
    shares = true_shares(plan, scratch) if plan.family == "contributions" else {}
    first, plain = (*found, None, None)[:2]
    return Result(plan, true_numbers(plan), first, making, diagnosing, commit(), shares, fault, plain, used)
