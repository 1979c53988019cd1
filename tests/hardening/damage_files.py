"""Corruptions of loads, tables, units, windows, campaigns and workbooks: classes 4 to 7 and 10 to 12 of the matrix."""

import contextlib
import os
import re
import shutil
import signal
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xlsxwriter
from base_logs import CAMPAIGN, DECIMALS, HEADERS, TIME, Log, base, read_table
from calls import call
from damage_signals import ELECTRICAL, GAINS, Rng, either, log_uniform, rounded, spot
from judge import Damage, Outcome, csv, moved, truth
from nptdms import ChannelObject, TdmsWriter
from reasons import campaign_reason
from scipy.io import savemat

from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.errors import WinchcascadeError
from winchcascade.ingest.read import read_run
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.rig.open_rig import load_rig

OTHER = {"r4p5ohm": "r9ohm", "r18ohm": "r27ohm", "r45ohm": "r36ohm"}
"""A log at another load, to stand beside each of the three."""

# --- 4: load

LOADS = (4.5, 9.0, 18.0, 27.0, 36.0, 45.0)


def stated_load(log: Log, rng: Rng) -> Damage:
    """A stated load that is 12 % to a factor of 3 off, one of another run, in milliohm or kilohm, or inf."""
    chance = rng.random()
    factor = log_uniform(rng, 1.12, 3.0)
    load = log.load * factor if rng.random() < 0.5 else log.load / factor
    if chance < 0.3:
        load = [ohm for ohm in LOADS if ohm != log.load][rng.integers(5)]
    elif chance < 0.4:
        load = log.load * (1e3, 1e-3)[rng.integers(2)]
    elif chance < 0.55:
        load = float("inf")
    wrong = f"load {load:.4g} stated for {log.load:g} ohm"
    return Damage(log, wrong, frozenset({"load", *ELECTRICAL}), csv(log), load=load, always=wrong)


def wrong_gain(log: Log, rng: Rng) -> Damage:
    """A gain of Vdc or Idc that is 12 % to a factor of 2 off, or 2, 5, 10 or 1000."""
    name = ELECTRICAL[rng.integers(2)]
    factor = log_uniform(rng, 1.12, 2.0) if rng.random() < 0.6 else (2.0, 5.0, 10.0, 1000.0)[rng.integers(4)]
    factor = factor if rng.random() < 0.5 else 1 / factor
    x = np.round(factor * log.columns[name], DECIMALS[name] + 3)
    return Damage(
        log, f"{name} times {factor:.4g}", frozenset({name, "load"}), csv(log.changed(**{name: x})),
        truth=truth(log),
    )  # fmt: skip


def load_property(log: Log, rng: Rng) -> Damage:
    """A load written into the head of the file in words: right or wrong, it has to be read, reported or rejected."""
    load = log.load if rng.random() < 0.7 else log.load * (2.0, 0.5, 1.5)[rng.integers(3)]
    words = (
        "{} ohm / 50 Hz",
        "{} Ohm (nominal)", "{} R", "{} ohm +/- 1 %", "approx. {} ohm", "{} ohm, cold", "2 x {half} ohm in series",
        "{milli} mOhm", "{kilo} kOhm", "resistor bank {} ohm",
    )[rng.integers(10)]  # fmt: skip
    text = words.format(f"{load:g}", half=f"{load / 2:g}", milli=f"{1e3 * load:g}", kilo=f"{load / 1e3:g}")
    key = ("Load", "R_load", "load_ohm")[rng.integers(3)]
    damage = Damage(log, f"{key}: {text} for {log.load:g} ohm", frozenset({"load", *ELECTRICAL}))

    def judge(folder: Path) -> Outcome:
        path = csv(log, preamble=f"{key}: {text}\n\n")(folder)
        try:
            run = read_run(path, rig=load_rig("hsu2026"))
            found = reduce(run, window=log.window)
        except WinchcascadeError as fault:
            return Outcome(("load",), f"rejected: {fault}")
        right = run.load is not None and abs(run.load / log.load - 1) < 0.01
        pointers = [f for f in found.quality if "load" in f"{f.kind} {f.message}".casefold()]
        said = f"load read as {run.load}"
        return Outcome(() if right else (said,), pointers[0].message if pointers else "")

    return with_judge(damage, judge)


def with_judge(damage: Damage, judge: Callable[[Path], Outcome]) -> Damage:
    """Give a corruption a judge of its own."""
    return Damage(damage.log, damage.what, damage.touched, unseen=damage.unseen, judge=judge)


def computed_current(log: Log, rng: Rng) -> Damage:
    """An Idc column that was computed from Vdc and a stated load 15 % to a factor of 2.5 off."""
    factor = log_uniform(rng, 1.15, 2.5)
    load = log.load * factor if rng.random() < 0.5 else log.load / factor
    x = rounded("idc", log.columns["vdc"] / load)
    return Damage(
        log, f"Idc computed with {load:.4g} for {log.load:g} ohm", frozenset({"idc", "load"}),
        csv(log.changed(idc=x)), load=load, truth=truth(log),
    )  # fmt: skip


def calibrated_under_load(log: Log, rng: Rng) -> Damage:
    """`calibrate` with a log under load that is stated to be an open circuit."""
    damage = Damage(log, "calibrate with load inf", frozenset({"load"}))

    def judge(folder: Path) -> Outcome:
        path = csv(log)(folder)
        with _patience(6) as ended:
            called = call("calibrate", path, "--load-ohm", "inf")
        silent = ended or called.code != 2
        return Outcome(("calibration of no open circuit",), "" if silent else called.err)

    return with_judge(damage, judge)


class _Ended(Exception):
    """A call took longer than a rejection does."""


@contextlib.contextmanager
def _patience(seconds: float) -> Iterator[list[bool]]:
    """End a call that goes on for longer than any rejection."""
    ended: list[bool] = []

    def stop(_number: int, _frame: object) -> None:
        raise _Ended

    old = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield ended
    except _Ended:
        ended.append(True)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, old)


# --- 5: several tables in one file

Grid = Sequence[Sequence[Any]]


def grid(log: Log) -> list[list[Any]]:
    """Give the cells of a log, its headers first."""
    return [log.names(), *map(list, zip(*(x.tolist() for x in log.columns.values()), strict=True))]


def workbook(path: Path, sheets: Sequence[tuple[str, Grid, str]]) -> Path:
    """Write a workbook; each sheet has a name, its cells, and whether it is hidden."""
    with xlsxwriter.Workbook(str(path), {"constant_memory": False, "nan_inf_to_errors": True}) as book:
        for name, rows, hidden in sheets:
            sheet = book.add_worksheet(name)
            for k, row in enumerate(rows):
                for j, cell in enumerate(row):
                    if isinstance(cell, str):
                        sheet.write_string(k, j, cell)
                    elif cell is not None and cell == cell:
                        sheet.write_number(k, j, cell)
            if hidden == "hidden":
                sheet.hide()
            elif hidden:
                sheet.very_hidden()
    return path


NAMES = (
    ("Run 1", "Run 2"), ("Data", "Data (2)"), ("raw", "filtered"), ("Sheet1", "Sheet2"), ("before", "after"),
    ("18 Ohm", "27 Ohm"),
)  # fmt: skip


def _second(log: Log, rng: Rng) -> tuple[Log, str]:
    """A second table that could be the log: another run, the same one filtered or with another gain, a part, fewer channels."""
    kind = rng.integers(5)
    if kind == 0:
        other = Log(OTHER[log.name], log.rate, log.load, log.window, read_table(CAMPAIGN / f"{OTHER[log.name]}.csv"))
        return other.rows(np.arange(0, len(other.t), 1)), f"a run of {OTHER[log.name]}"
    if kind == 1:
        names = (*GAINS, "velocity")
        smooth = {n: rounded(n, np.convolve(log.columns[n], np.ones(9) / 9, "same")) for n in names}
        return log.changed(**smooth), "the same run smoothed"
    if kind == 2:
        name = GAINS[rng.integers(4)]
        scaled = rounded(name, (1 + either(rng, log_uniform(rng, 0.02, 0.3))) * log.columns[name])
        return log.changed(**{name: scaled}), f"the same run with another gain of {name}"
    if kind == 3:
        end = truth(log).complete[0].phases.haul_in
        last = int(np.searchsorted(log.t, end[1] + 2.0 if end else log.t[-1] / 2))
        return log.rows(np.arange(last)), "the first cycle of the run"
    return log.without("torque"), "the same run without torque"


def two_sheets(log: Log, rng: Rng) -> Damage:
    """A workbook of two sheets that could each be the log, either one first, either one hidden, a short or a long way."""
    second, what = _second(log, rng)
    names = NAMES[rng.integers(len(NAMES))]
    hidden = ("", "", "hidden", "very")[rng.integers(4)]
    sheets = [(names[0], grid(log), ""), (names[1], grid(second), hidden)]
    if rng.random() < 0.5:
        sheets = [(names[1], grid(second), ""), (names[0], grid(log), hidden)]
    described = f"sheets {sheets[0][0]} and {sheets[1][0]}{' (' + hidden + ')' if hidden else ''}; one is {what}"
    return _ambiguous(log, described, lambda folder: workbook(folder / "two.xlsx", sheets), [s[0] for s in sheets])


def _ambiguous(log: Log, what: str, write: Callable[[Path], Path], names: Sequence[str]) -> Damage:
    damage = Damage(log, what, frozenset({"table"}))

    def judge(folder: Path) -> Outcome:
        path = write(folder)
        try:
            run = read_run(path, load=log.load, rig=load_rig("hsu2026"))
        except WinchcascadeError as fault:
            named = all(name in str(fault) for name in names)
            return Outcome(("one of several tables",), f"rejected: {fault}" if named else "")
        messages = [f.message for f in run.findings if names and any(name in f.message for name in names)]
        return Outcome((f"one of several tables read ({run.samples} samples)",), messages[0] if messages else "")

    return with_judge(damage, judge)


def two_in_matlab(log: Log, rng: Rng) -> Damage:
    """Several runs in one MATLAB file: structs, vectors with a prefix or a number, or a struct of structs."""
    second, what = _second(log, rng)
    runs = {"run1": fields(log), "run2": fields(second)}
    form = rng.integers(3)
    variables: dict[str, Any] = runs
    if form == 1:
        variables = {"campaign": {"test_a": runs["run1"], "test_b": runs["run2"]}}
    elif form == 2:
        variables = {f"{name}_{run}": x for run, fields in runs.items() for name, x in fields.items()}
    names = (["run1", "run2"], ["test_a", "test_b"], [])[form]

    def write(folder: Path) -> Path:
        path = folder / "two.mat"
        savemat(path, variables, do_compression=bool(rng.integers(2)))
        return path

    return _ambiguous(
        log,
        f"MATLAB file with two runs, {('structs', 'a struct of structs', 'suffixes')[form]}; one is {what}",
        write,
        names,
    )


def fields(log: Log) -> dict[str, Any]:
    names = {
        TIME: "Time_s", "displacement": "Displacement_m", "velocity": "Velocity_mps", "pressure": "Pressure_kgcm2",
        "force": "Force_N",
        "torque": "Torque_Nm", "vdc": "Vdc_V", "idc": "Idc_A",
    }  # fmt: skip
    return {names[name]: x for name, x in log.columns.items()}


def bare(name: str) -> str:
    return HEADERS[name].rpartition(" (")[0]


def unit_of(name: str) -> str:
    return HEADERS[name].rpartition(" (")[2].rstrip(")")


def two_groups(log: Log, rng: Rng) -> Damage:
    """A TDMS file with two groups of the same channels."""
    second, what = _second(log, rng)
    pairs = [("Run 1", log), ("Run 2", second)]

    def write(folder: Path) -> Path:
        path = folder / "two.tdms"
        with TdmsWriter(str(path)) as writer:
            for group, table in pairs:
                writer.write_segment([
                    ChannelObject(group, bare(n), x, {"unit_string": unit_of(n)})
                    for n, x in table.columns.items()
                ])  # fmt: skip
        return path

    return _ambiguous(log, f"TDMS file with two groups; one is {what}", write, ["Run 1", "Run 2"])


# --- 6: units of the rig file

UNITS = {
    "force": ("kgf", "kN", "lbf"), "torque": ("kN.m", "N.mm", "lbf.ft", "kgf.m"), "vdc": ("mV", "kV"), "idc": ("mA", "kA"),
    "velocity": ("mm/s", "km/h", "m/min", "ft/s"), "displacement": ("mm", "cm", "ft"), TIME: ("ms", "min"),
}  # fmt: skip
"""Units of a rig file that contradict those of the headers."""


def unit_conflict(log: Log, rng: Rng) -> Damage:
    """A rig file that names another unit for a column than the header, for one or two columns."""
    names = [list(UNITS)[k] for k in rng.permutation(len(UNITS))[: rng.integers(1, 3)]]
    chosen = {name: UNITS[name][rng.integers(len(UNITS[name]))] for name in names}
    bare = rng.random() < 0.5
    lines = []
    for name, unit in chosen.items():
        column = HEADERS[name].rpartition(" (")[0] if bare else HEADERS[name]
        lines.append(f'{name} = {{ name = "{column}", unit = "{unit}" }}')
    rig = 'based_on = "hsu2026"\nname = "mine"\n\n[columns]\n' + "\n".join(lines) + "\n"
    return Damage(
        log, f"rig file gives {chosen}", frozenset(chosen), csv(log), rig=rig, truth=truth(log),
        always="" if set(chosen) - {"displacement"} else "unit of the displacement",
    )  # fmt: skip


def wrong_header_unit(log: Log, rng: Rng) -> Damage:
    """A header that names another unit than the values have, where the rig file names the right one."""
    name = list(UNITS)[rng.integers(len(UNITS) - 1)]
    unit = UNITS[name][rng.integers(len(UNITS[name]))]
    right = HEADERS[name].rpartition(" (")[2].rstrip(")")
    bare = HEADERS[name].rpartition(" (")[0]
    damaged = Log(log.name, log.rate, log.load, log.window, log.columns, {**HEADERS, name: f"{bare} ({unit})"})
    rig = f'based_on = "hsu2026"\nname = "mine"\n\n[columns]\n{name} = {{ name = "{bare}", unit = "{right}" }}\n'
    return Damage(
        log, f"header gives {name} in {unit}, the rig file in {right}", frozenset({name}), csv(damaged), rig=rig,
        truth=truth(log), always="unit of the displacement" if name == "displacement" else "",
    )  # fmt: skip


def overridden(log: Log, rng: Rng) -> Damage:
    """A rig file whose unit wins over that of the header by `override = true`, with values in the header's unit or its own."""
    names = list(UNITS)
    name = names[rng.integers(len(names) - 1)]
    unit = UNITS[name][rng.integers(len(UNITS[name]))]
    column = f'{name} = {{ name = "{HEADERS[name]}", unit = "{unit}", override = true }}'
    rig = f'based_on = "hsu2026"\nname = "mine"\n\n[columns]\n{column}\n'
    return Damage(
        log, f"rig file overrides the unit of {name} by {unit}", frozenset({name}), csv(log), rig=rig, truth=truth(log),
        always="unit of the displacement" if name == "displacement" else "",
    )  # fmt: skip


# --- 7: windows


def long_window(log: Log, rng: Rng) -> Damage:
    """A window that ends 0.3 to 40 s after the payout of most cycles, or after the shortest payout alone."""
    true = truth(log)
    lengths = sorted(c.phases.payout_end - c.phases.onset for c in true.complete)
    if rng.random() < 0.25:
        window = rng.uniform(lengths[0] + 0.3 * (lengths[1] - lengths[0]), lengths[1])
    else:
        window = float(np.median(lengths)) + log_uniform(rng, 0.3, 40.0)
    window = round(float(window), 2)
    damage = Damage(
        log, f"window of {window:g} s, payouts of {lengths[0]:.2f} to {lengths[-1]:.2f} s", frozenset({"window"})
    )

    def judge(folder: Path) -> Outcome:
        path = csv(log)(folder)
        run = read_run(path, load=log.load, rig=load_rig("hsu2026"))
        try:
            found = reduce(run, window=window)
        except WinchcascadeError as fault:
            return Outcome(("window",), f"rejected: {fault}")
        beyond, lost = moved(_clipped(run, window, true), found)
        findings = [f"{f.kind}: {f.message}" for f in found.quality if f.kind == "window_beyond_payout"]
        if findings:
            return Outcome(beyond, findings[0])
        return Outcome(beyond, next(iter(lost)) if beyond and set(beyond) <= lost else "")

    return with_judge(damage, judge)


def _clipped(run: Any, window: float, true: Reduction) -> Reduction:
    """Reduce each cycle with the window cut at the end of its payout."""
    from msgspec.structs import replace

    cycles = []
    for cycle in true.complete:
        length = min(window, cycle.phases.payout_end - cycle.phases.onset - 1e-6)
        other = reduce(run, window=length).cycles
        cycles.append(replace(other[cycle.cycle - 1], complete=True))
    return replace(true, cycles=tuple(cycles))


def slipped_window(log: Log, rng: Rng) -> Damage:
    """A window with its decimal point moved, or in milliseconds."""
    window = log.window * (10.0, 100.0, 1000.0)[rng.integers(3)]
    return Damage(
        log,
        f"window of {window:g} s for {log.window:g} s",
        frozenset({"window"}),
        csv(log),
        window=window,
        truth=truth(log),
    )


# --- 10 and 11: campaigns

_CLEAN: dict[str, set[str]] = {}


def _campaign(folder: Path) -> Path:
    place = folder / "campaign"
    if not place.exists():
        shutil.copytree(CAMPAIGN, place)
    return place


def _words(text: str) -> set[str]:
    """The words of an output, without its numbers."""
    return set(re.sub(r"[-+]?[\d.,]+(e[-+]?\d+)?", " ", text).split())


def _batch(folder: Path, name: str, log: Log | None) -> tuple[set[str], str]:
    """Call `batch` on the campaign with one log replaced: words of the output, and the row of that log with its findings.

    The results of all other logs are kept from the call before.
    """
    place = _campaign(folder)
    if log is not None:
        (place / f"{name}.csv").write_text(log.text(), encoding="utf-8")
    try:
        called = call("batch", place, "--out", folder / "results", "--reports", "none", "--jobs", "1", "--force")
    finally:
        shutil.copy(CAMPAIGN / f"{name}.csv", place / f"{name}.csv")
    row = next((line for line in called.out.splitlines() if line.lstrip().startswith(f"{name}.csv")), "")
    findings = re.search(r"^findings .*?(?=^\S|^$)", called.out, re.MULTILINE | re.DOTALL)
    named = f"{name}.csv" in (findings[0] if findings else "")
    return _words(called.out + called.err), re.sub(r"\d", "0", row) + (" with findings" if named else "")


def _clean_words(folder: Path, command: str) -> set[str]:
    """The words that `batch` and `check` print for the undamaged campaign, with and without results of an earlier call."""
    if not _CLEAN:
        _CLEAN["batch"] = set.union(*(_batch(folder, "r18ohm", None)[0] for _ in range(2)))
        clean = call("check", folder / "results", "--against", "hsu2026-table2")
        assert clean.code == 0, clean
        _CLEAN["check"] = _words(clean.out)
    return _CLEAN[command]


def between_logs(log: Log, rng: Rng) -> Damage:
    """A gain of one log in a campaign of seven that is 6 to 40 % off that of the others."""
    log = base(log.name, 25)
    name = GAINS[rng.integers(4)]
    change = either(rng, log_uniform(rng, 0.06, 0.4))
    if name in ELECTRICAL and abs(change) >= 0.1:  # a mismatch of the load; keep to what the ratio cannot show
        change *= 0.09 / abs(change)
    damaged = log.changed(**{name: rounded(name, (1 + change) * log.columns[name])})
    damage = Damage(log, f"campaign: gain of {name} {100 * change:+.1f} % in one log", frozenset({name}))

    def judge(folder: Path) -> Outcome:
        known = _clean_words(folder, "batch")
        path = csv(damaged)(folder)
        beyond, _ = moved(truth(log), reduce(read_run(path, load=log.load, rig=load_rig("hsu2026")), window=log.window))
        new = sorted(_batch(folder, log.name, damaged)[0] - known)
        reason = campaign_reason(log.name, folder / "results") if not new else None
        return Outcome(beyond, "new words: " + " ".join(new) if new else "", reason)

    return with_judge(damage, judge)


def listed_twice(log: Log, rng: Rng) -> Damage:
    """A campaign that lists a log twice, one of them withheld: one path, another spelling, a link, a copy, or shared cycles."""
    form = rng.integers(6)
    names = [f"{name}.csv" for name in ("open_circuit", "r45ohm", "r36ohm", "r27ohm", "r18ohm", "r9ohm", "r4p5ohm")]
    twice = f"{log.name}.csv"
    window = (f"\nwindow_s = {log.window}", "")[rng.integers(2)]
    second = (twice, f"./{twice}", f"../campaign/{twice}", f"link {twice}", f"copy {twice}", twice)[form]
    cycles = ("\ncycles = [1, 2]", "\ncycles = [2, 3]") if form == 5 else ("", "")
    damage = Damage(
        log,
        f"campaign lists {twice} and {second}, one withheld{' (cycles 1-2 and 2-3)' if form == 5 else ''}",
        frozenset({"campaign"}),
    )
    order = rng.integers(2)

    def judge(folder: Path) -> Outcome:
        place = folder / "twice" / "campaign"
        shutil.rmtree(place.parent, ignore_errors=True)
        shutil.copytree(CAMPAIGN, place)
        if form == 3:
            os.symlink(place / twice, place / second)
        elif form == 4:
            shutil.copy(place / twice, place / second)
        text = (place / "campaign.toml").read_text()
        entry = f'\n[[run]]\nfile = "{second}"\nload_ohm = {log.load}{window}{cycles[1]}\n'
        text = text.replace(f'file = "{twice}"', f'file = "{twice}"{cycles[0]}')
        if order:
            text += entry + "withheld = true\n"
        else:
            text = text.replace(f'file = "{twice}"', f'file = "{twice}"\nwithheld = true') + entry
        (place / "campaign.toml").write_text(text)
        assert all(name in text for name in names)
        try:
            load_campaign(place / "campaign.toml")
        except WinchcascadeError as fault:
            return Outcome(("a withheld log takes part in the fit",), f"rejected: {fault}")
        with _patience(2) as ended:
            called = call("diagnose", place, "--jobs", "1")
        rejected = not ended and called.code == 2
        return Outcome(("a withheld log takes part in the fit",), called.err if rejected else "")

    return with_judge(damage, judge)


def _one_cycle_damaged(log: Log, rng: Rng) -> tuple[Log, str]:
    """Damage in one cycle that makes the cycles differ: a gain, zeros, or a gap too short to leave the cycle out."""
    cycles = truth(log).complete
    cycle = cycles[rng.integers(len(cycles))]
    inside = (log.t >= cycle.window.onset - 1.0) & (log.t < cycle.phases.payout_end + 1.0)
    name = GAINS[rng.integers(4)]
    x = log.columns[name].copy()
    if rng.random() < 0.5:
        gain = 1 + either(rng, log_uniform(rng, 0.05, 0.5))
        x[inside] = rounded(name, gain * x[inside])
        what = f"gain of {name} times {gain:.3f}"
    else:
        a = int(np.searchsorted(log.t, rng.uniform(cycle.window.onset + 1.0, cycle.window.cutoff - 0.5)))
        b = a + round(log_uniform(rng, 0.5, 3.0) * log.rate)
        x[a:b] = 0.0
        what = f"zeros of {name} at rows {a}:{b}"
    return log.changed(**{name: x}), f"{what}, cycle {cycle.cycle}"


def widened(log: Log, rng: Rng) -> Damage:
    """`check` with a log of which one cycle is damaged: it has to miss a cell or print the finding."""
    log = base(log.name, 25)
    damaged, what = _one_cycle_damaged(log, rng)
    damage = Damage(log, f"check: {what}", frozenset({"check"}))

    def judge(folder: Path) -> Outcome:
        path = csv(damaged)(folder)
        found = reduce(read_run(path, load=log.load, rig=load_rig("hsu2026")), window=log.window)
        beyond, _ = moved(truth(log), found)
        known = _clean_words(folder, "check")
        _batch(folder, log.name, damaged)
        called = call("check", folder / "results", "--against", "hsu2026-table2")
        new = sorted(_words(called.out + called.err) - known)
        if called.code:
            return Outcome(beyond, f"exit code {called.code}")
        return Outcome(beyond, "new words: " + " ".join(new) if new else "")

    return with_judge(damage, judge)


def unmarked(log: Log, rng: Rng) -> Damage:
    """The output of `batch` for a log with a finding: it has to name the log among those with findings."""
    log = base(log.name, 25)
    a, b = spot(rng, log, log_uniform(rng, 0.08, 0.6))
    name = GAINS[rng.integers(4)]
    x = log.columns[name].copy()
    x[a:b] = np.nan
    damaged = log.changed(**{name: x})
    damage = Damage(log, f"batch: {name} empty at rows {a}:{b}", frozenset({"batch"}))

    def judge(folder: Path) -> Outcome:
        _, clean = _batch(folder, log.name, None)
        _, row = _batch(folder, log.name, damaged)
        if not reduce(
            read_run(csv(damaged)(folder), load=log.load, rig=load_rig("hsu2026")), window=log.window
        ).quality:
            return Outcome((), "")
        marked = row != clean
        return Outcome(("a row with findings",), "marked" if marked else "")

    return with_judge(damage, judge)


# --- 12: workbooks


def _as_text(log: Log, write: Callable[[float], str], names: Sequence[str], rows: slice) -> list[list[Any]]:
    cells = grid(log)
    for name in names:
        j = list(log.columns).index(name)
        for row in cells[1:][rows]:
            row[j] = write(row[j])
    return cells


def _comma(value: float) -> str:
    return repr(value).replace(".", ",")


def _grouped(value: float) -> str:
    """1234.5 as 1.234,5."""
    whole, _, part = f"{value:,.3f}".partition(".")
    return f"{whole.replace(',', '.')},{part}"


def _english(value: float) -> str:
    """1234.5 as 1,234.5."""
    return f"{value:,.3f}"


FORMS: dict[str, Callable[[float], str]] = {
    "decimal commas": _comma, "points and a decimal comma": _grouped, "commas and a decimal point": _english,
    "plain texts": repr,
    "texts with spaces": lambda v: f" {v!r} ", "texts with a no-break space": lambda v: f"{v!r}\u00a0",
    "a comma and an exponent": lambda v: f"{v:.5E}".replace(".", ","),
    "true minus signs": lambda v: repr(v).replace("-", "\u2212"),
    "three decimals after a comma": lambda v: f"{v:.3f}".replace(".", ","),
    "no decimals, commas between thousands": lambda v: f"{round(v):,}",
}  # fmt: skip


def text_cells(log: Log, rng: Rng) -> Damage:
    """Numbers written as texts, in all columns, in one to three, in all rows or in a part of them."""
    word = list(FORMS)[rng.integers(len(FORMS))]
    names = [n for n in log.columns if n not in (TIME, "pressure")]
    if rng.random() < 0.6 or word.startswith("no decimals"):
        names = [names[k] for k in rng.permutation(len(names))[: rng.integers(1, 4)]]
    elif rng.random() < 0.5:
        names.append(TIME)
    if word.startswith("no decimals"):
        names = ["force"]
    rows, part = slice(None), "all rows"
    if rng.random() < 0.4:
        a, b = spot(rng, log, log_uniform(rng, 0.5, 20.0))
        rows, part = slice(a, b), f"rows {a}:{b}"
    cells = _as_text(log, FORMS[word], names, rows)
    return Damage(
        log,
        f"{word} in {', '.join(names)}, {part}",
        frozenset(names),
        lambda folder: workbook(folder / "log.xlsx", [("Data", cells, "")]),
    )


def error_cells(log: Log, rng: Rng) -> Damage:
    """Words where numbers belong: #N/A, OVL, a dash, n/a, or a number with its unit, for one sample to 3 s."""
    name = ("velocity", *GAINS)[rng.integers(5)]
    a, b = spot(rng, log, log_uniform(rng, log.step, 3.0))
    word = ("#N/A", "#DIV/0!", "OVL", "-", "n/a", "1e999", "{} V", "<{}", "{}*")[rng.integers(9)]
    cells = _as_text(log, lambda v: word.format(repr(v)), [name], slice(a, b))
    return Damage(
        log, f"{word} in {name} at rows {a}:{b}", frozenset({name}),
        lambda folder: workbook(folder / "log.xlsx", [("Data", cells, "")]),
        spans=[(float(log.t[a]), float(log.t[b - 1]))],
    )  # fmt: skip


def inserted_rows(log: Log, rng: Rng) -> Damage:
    """A note, a repeated header, units, empty rows or a summary inside the table or at its end."""
    cells = grid(log)
    kind = rng.integers(6)
    blank: list[Any] = [None] * len(HEADERS)
    note: list[Any] = [
        ("crane stopped here", "Pause", "--- cycle 2 ---", "Operator: line wet")[rng.integers(4)],
        *blank[1:],
    ]
    added: list[list[Any]] = {
        0: [note], 1: [list(HEADERS.values())], 2: [list(HEADERS.values()), [None, "m", "m/s", *blank[3:]]],
        3: [blank, blank, note, blank],
        4: [["Mean", *blank[1:4], 3000.0, 400.0, 200.0, 10.0]], 5: [blank] * int(rng.integers(1, 30)),
    }[int(kind)]  # fmt: skip
    at = len(cells) if rng.random() < 0.15 else spot(rng, log, 0.1)[0] + 1
    cells[at:at] = added
    what = (
        "a note",
        "the header again",
        "header and units again",
        "empty rows and a note",
        "a row of means",
        "empty rows",
    )[kind]
    return Damage(
        log, f"{what} at row {at}", frozenset({TIME}), lambda folder: workbook(folder / "log.xlsx", [("Data", cells, "")]),
        spans=[(float(log.t[min(at, len(log.t)) - 1]),) * 2],
    )  # fmt: skip
