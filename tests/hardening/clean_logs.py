"""Undamaged logs of every source: any finding on them is a false one."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from base_logs import (
    CAMPAIGN,
    NOISE,
    RATES,
    ROOT,
    STEPS,
    TIME,
    Log,
    Signal,
    base,
    bases,
    quantised,
    read_table,
    resampled,
)
from calls import call
from damage_files import Grid, bare, fields, grid, workbook
from judge import csv, moved, scratch, truth
from scipy.io import savemat

from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.run import Finding
from winchcascade.ingest.read import read_run
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.rig.open_rig import load_rig

SHARED = ROOT.parent / "shared" / "data"
SIMULATED_RATES = (5, 10, 25, 50, 100)
SIMULATED_LOADS = {"r4p5ohm": 4.5, "r9ohm": 9.0, "r18ohm": 18.0, "r45ohm": 45.0, "open_circuit": float("inf")}

TRUE_OF_THE_KITE = {"repeated_stamp", "incomplete_cycle", "unknown_column"}
"""Findings that the kite log deserves: joined cycles, repeated stamps, columns of the kite itself."""


class Case(NamedTuple):
    """One undamaged log as it was reduced; `true` is the same motion at 100 Hz where that is known."""

    name: str
    found: Reduction
    true: Reduction | None = None


def campaigns() -> Iterator[Case]:
    """Reduce each log of the fixture campaign and of the shared ones, by its own window and by the two rules."""
    places = [CAMPAIGN, SHARED / "campaign", *sorted((SHARED / "labelled").glob("*"))]
    for place in places:
        if not (place / "campaign.toml").is_file():
            continue
        campaign = load_campaign(place)
        rig = load_rig(campaign.rig or "hsu2026")
        for entry in campaign.runs:
            run = read_run(entry.file, rig=rig, load=entry.load)
            rules = dict.fromkeys((entry.window or "auto", "auto", "payout"))
            for rule in rules:
                found = reduce(run, rig=rig, window=rule, cycles=entry.cycles)
                yield Case(f"{place.name}/{entry.file.name} window {rule}", found)


def kite() -> Iterator[Case]:
    """Reduce the kite's logs."""
    rig = load_rig("kitepower")
    for path in sorted((SHARED / "kitepower-2019-10-08").glob("*.csv")):
        if "summary" not in path.name:
            yield Case(path.name, reduce(read_run(path, rig=rig), rig=rig))


def rates(folder: Path) -> Iterator[Case]:
    """Reduce the base logs of the matrix at their three rates."""
    for log in bases(RATES):
        run = read_run(csv(log)(folder), load=log.load, rig=load_rig("hsu2026"))
        shortest = min(c.phases.payout_end - c.phases.onset for c in truth(log).complete)
        for rule in (log.window, "auto", "payout", round(0.97 * shortest, 2)):
            yield Case(f"{log!r} window {rule}", reduce(run, window=rule))


def files(folder: Path) -> Iterator[Case]:
    """Reduce logs in files with other tables that are no logs, and with rig files whose units mean those of the headers."""
    log = base("r18ohm", 25)
    small: dict[str, Grid] = {
        "Notes": [["Operator", "A. Crane"], ["Remark", "line wet"]],
        "Summary": [["Metric", "Value"], ["eta_trans", 0.94], ["eta_gen", 0.77]],
        "Calibration": [["Load (kg)", "Bridge (mV)"], *[[10.0 * k, 0.2 * k] for k in range(20)]],
        "Empty": [],
        "Sensors": [["Channel", "Unit", "Range"], ["Force", "N", 20000.0], ["Torque", "N.m", 500.0]],
    }
    for title, rows in small.items():
        for first in (False, True):
            sheets: list[tuple[str, Grid, str]] = [("Log", grid(log), ""), (title, rows, "")]
            path = workbook(folder / "one.xlsx", sheets[::-1] if first else sheets)
            yield Case(f"workbook with a sheet {title}{' in front' if first else ''}", _reduced(path, log))
    others: list[dict[str, Any]] = [{"info": {"gain": 2.0}}, {"x": 1.0, "fs": 25.0}, {"cal": {"load": np.arange(20.0)}}]
    for k, beside in enumerate(others):
        savemat(folder / "one.mat", {"log": fields(log), **beside})
        yield Case(f"MATLAB file with other variables, form {k}", _reduced(folder / "one.mat", log))
    for name, unit in (
        ("torque", "Nm"),
        ("torque", "N*m"),
        ("velocity", "m s-1"),
        ("idc", "A"),
        ("force", "newton"),
        (TIME, "sec"),
    ):
        rig = folder / "same.toml"
        column = f'{name} = {{ name = "{bare(name)}", unit = "{unit}" }}'
        rig.write_text(f'based_on = "hsu2026"\nname = "mine"\n\n[columns]\n{column}\n')
        yield Case(f"rig file with {unit} for {name}", _reduced(csv(log)(folder), log, rig))


def _reduced(path: Path, log: Log, rig_file: Path | None = None) -> Reduction:
    return reduce(read_run(path, load=log.load, rig=load_rig(rig_file or "hsu2026")), window=log.window)


def simulated(folder: Path) -> Iterator[Case]:
    """Simulate logs at 100 Hz, and thin them out to five rates, with and without noise of the sensors."""
    for name, load in SIMULATED_LOADS.items():
        motion = resampled(read_table(CAMPAIGN / f"{name}.csv"), 100.0, seed=1, noise=False)
        driven = folder / f"motion {name}.csv"
        _write(driven, {"time": motion[TIME], "velocity": motion["velocity"]}, ["time_s", "velocity_mps"])
        made = folder / f"simulated {name}.csv"
        called = call("simulate", "--profile", driven, "--load-ohm", f"{load:g}", "--out", made, "--force")
        assert called.code == 0, called
        headers = made.read_text(encoding="utf-8").splitlines()[0].split(",")
        table = np.genfromtxt(made, delimiter=",", skip_header=1)
        true: dict[float | str, Reduction] = {}
        for noisy in (False, True):
            for rate in sorted(SIMULATED_RATES, reverse=True):
                columns = dict(zip(headers, table[:: 100 // rate].T, strict=True))
                path = folder / f"{name} {rate} Hz.csv"
                _write(path, _noisy(columns, rate) if noisy else columns, headers)
                run = read_run(path, load=load, rig=load_rig("hsu2026"))
                for rule in (5.96, "auto", "payout"):
                    found = reduce(run, window=rule)
                    true.setdefault(rule, found)
                    what = "with noise" if noisy else "without noise"
                    yield Case(f"simulated {name} at {rate} Hz {what} window {rule}", found, true[rule])


def _noisy(columns: Mapping[str, Signal], seed: int) -> dict[str, Signal]:
    """Add the noise of the sensors and round as the logger does."""
    rng = np.random.default_rng(seed)
    found = dict(columns)
    for header, x in columns.items():
        name = header.split(" ")[0].casefold()
        if name in STEPS:
            noisy = x + NOISE.get(name, 0.0) * rng.standard_normal(len(x))
            found[header] = quantised({name: noisy})[name]
    return found


def _write(path: Path, columns: Mapping[str, Signal], headers: list[str]) -> None:
    rows = [",".join(map(repr, row)) for row in np.column_stack(list(columns.values())).tolist()]
    path.write_text("\n".join([",".join(headers), *rows, ""]), encoding="utf-8")


def false_findings(case: Case) -> list[str]:
    """List the findings that the log should not have; one on coarse sampling is right where the error is beyond the bar."""
    coarse = case.true is not None and bool(moved(case.true, case.found)[0])
    return [
        f"{f.kind} {f.channel or ''}: {f.message}"
        for f in case.found.quality
        if not (f.kind == "coarse_sampling" and coarse) and not _is_true(f, case.found)
    ]


def _is_true(finding: Finding, found: Reduction) -> bool:
    """Whether a log deserves a finding: one of the kite, or a sensor that did leave its range."""
    sensor = found.rig.sensors.get(finding.channel or "")
    if finding.kind == "out_of_range" and sensor is not None and sensor.high is not None:
        return float(found.run.channels[finding.channel or ""].max()) > sensor.high
    return found.rig.name == "kitepower" and finding.kind in TRUE_OF_THE_KITE


def print_findings(folder: Path, *, unreported_too: bool) -> int:
    """Print each false finding and their number; 1 if there is one."""
    cases = false = unreported = 0
    scratch(folder)
    for source in (campaigns(), kite(), rates(folder), files(folder), simulated(folder)):
        for case in source:
            cases += 1
            for text in false_findings(case):
                false += 1
                print(f"{case.name}: {text}", flush=True)
            if case.true is not None and moved(case.true, case.found)[0]:
                reported = any(f.kind == "coarse_sampling" for f in case.found.quality)
                unreported += not reported
                if not reported and unreported_too:
                    print(f"  (not reported: {case.name}: {'; '.join(moved(case.true, case.found)[0][:3])})")
    print(
        f"{cases} reductions of undamaged logs, {false} false findings, {unreported} coarse ones beyond the bar unreported"
    )
    return 1 if false else 0
