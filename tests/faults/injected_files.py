"""Faults of files: units, windows, loads in the header, several tables, cells, and campaigns
that list one log twice.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pandas as pd
from fault_logs import CAMPAIGN, HEADERS, Log
from injected import (
    ELECTRICAL,
    POWERS,
    Rng,
    Trial,
    either,
    fault,
    log_uniform,
    payouts,
    spot,
    times,
)
from nptdms import ChannelObject, TdmsWriter
from scipy.io import savemat

SLOW = (10.0, 25.0)
"""Rates of logs that are written as workbooks."""

Table = dict[str, pd.DataFrame]
"""Sheets, structs or groups of a file by name."""


def to_csv(frame: pd.DataFrame, folder: Path, *, head: str = "") -> Path:
    """Write a log as CSV, after some lines of a header."""
    path = folder / "log.csv"
    path.write_text(head + frame.to_csv(index=False), encoding="utf-8")
    return path


def to_excel(tables: Table, folder: Path) -> Path:
    """Write the tables as sheets of a workbook; texts stay texts."""
    path = folder / "log.xlsx"
    with pd.ExcelWriter(path, engine="xlsxwriter") as book:
        for name, frame in tables.items():
            frame.to_excel(book, sheet_name=name, index=False)
    return path


def to_matlab(tables: Table, folder: Path) -> Path:
    """Write the tables as structs of a MATLAB file."""
    path = folder / "log.mat"
    name = {
        header: header.replace(" (", "_").replace("/", "p").replace(".", "").rstrip(")")
        for header in HEADERS.values()
    }
    savemat(
        path, {key: {name[h]: frame[h].to_numpy() for h in frame} for key, frame in tables.items()}
    )
    return path


def to_tdms(tables: Table, folder: Path) -> Path:
    """Write the tables as groups of a TDMS file."""
    path = folder / "log.tdms"
    with TdmsWriter(str(path)) as writer:
        for group, frame in tables.items():
            parts = {header: header.rstrip(")").rpartition(" (") for header in frame}
            writer.write_segment(
                [
                    ChannelObject(
                        group, parts[h][0], frame[h].to_numpy(), {"unit_string": parts[h][2]}
                    )
                    for h in frame
                ]
            )
    return path


# --- units of the rig file and of the header

UNITS = {
    "force": ("kgf", "kN", "lbf"), "torque": ("kN.m", "N.mm", "lbf.ft", "kgf.m"), "vdc": ("mV", "kV"), "idc": ("mA", "kA"),
    "velocity": ("mm/s", "km/h", "m/min", "ft/s"), "displacement": ("mm", "cm", "ft"), "time": ("ms", "min"),
}  # fmt: skip
"""Units that contradict those of the headers."""


@fault("unit of the rig file", 16)
def unit_conflict(rng: Rng, k: int, log: Log) -> Trial:
    """The rig file names another unit than the header, which is right or wrong itself, or
    overrides the header.
    """
    channel = list(UNITS)[rng.integers(len(UNITS) - (k % 3 == 1))]
    unit = UNITS[channel][rng.integers(len(UNITS[channel]))]
    bare, _, right = HEADERS[channel].rstrip(")").rpartition(" (")
    entry = (
        f'name = "{HEADERS[channel]}", unit = "{unit}"{", override = true" if k % 3 == 2 else ""}'
    )
    headers, what = HEADERS, f"the rig file gives {channel} in {unit}"
    if k % 3 == 1:
        headers, entry = (
            {**HEADERS, channel: f"{bare} ({unit})"},
            f'name = "{bare}", unit = "{right}"',
        )
        what = f"the header gives {channel} in {unit}, the rig file in {right}"
    rig = f'based_on = "hsu2026"\nname = "mine"\n\n[columns]\n{channel} = {{ {entry} }}\n'
    return Trial(what, log, replace(log, rig=rig, headers=headers), frozenset({channel}))


# --- windows and loads


@fault("window", 24)
def window(rng: Rng, k: int, log: Log) -> Trial:
    """A window that ends after the payouts, has its decimal point moved, or is shorter than two
    samples.
    """
    assert isinstance(log.window, float)
    longest = max((b - a) / log.rate for a, b in payouts(log))
    chosen = [
        longest + log_uniform(rng, 1.0, 40.0), log.window * (10.0, 100.0, 1000.0)[rng.integers(3)],
        log_uniform(rng, 0.02, 1.9) / log.rate,
    ][k % 3]  # fmt: skip
    what = f"window of {chosen:.4g} s, payouts of {longest:.2f} s"
    return Trial(
        what, log, replace(log, window=round(chosen, 4)), frozenset({"window"}), always=True
    )


@fault("load in the header", 12, SLOW)
def load_property(rng: Rng, k: int, log: Log) -> Trial:
    """A load in words in the head of the file: right or wrong, it has to be read, reported or
    rejected.
    """
    load = (log.load or 1.0) * (1.0 if k % 3 else (2.0, 0.5, 1.5)[rng.integers(3)])
    words = (
        "{} ohm / 50 Hz", "{} Ohm (nominal)", "{} R", "{} ohm +/- 1 %", "approx. {} ohm", "{} ohm, cold",
        "2 x {half} ohm in series", "{milli} mOhm", "{kilo} kOhm", "resistor bank {} ohm",
    )[k % 10]  # fmt: skip
    text = words.format(
        f"{load:g}", half=f"{load / 2:g}", milli=f"{1e3 * load:g}", kilo=f"{load / 1e3:g}"
    )
    head = f"{('Load', 'R_load', 'load_ohm')[k % 3]}: {text}\n\n"
    damaged = replace(log, load=None, write=partial(to_csv, head=head))
    return Trial(
        f"{head.strip()} for {log.load} ohm", log, damaged, frozenset({"load", *ELECTRICAL})
    )


# --- several tables in one file


def second(rng: Rng, log: Log) -> tuple[Log, str]:
    """A second table that could be the log: the run smoothed, with another gain, in part, or
    without the torque.
    """
    kind = int(rng.integers(4))
    if kind == 0:
        smooth = {
            c: np.convolve(log[c], np.ones(9) / 9, "same").round(4) for c in (*POWERS, "velocity")
        }
        return log.changed(**smooth), "the run smoothed"
    if kind == 1:
        channel = POWERS[rng.integers(4)]
        gain = 1 + either(rng, 0.02, 0.3)
        return log.changed(
            **{channel: (gain * log[channel]).round(4)}
        ), f"the run with another gain of {channel}"
    if kind == 2:
        return log.rows(np.arange(payouts(log)[1][0])), "the first cycle of the run"
    return replace(log, table=log.table.drop(columns="torque")), "the run without torque"


@fault("several tables", 16, SLOW)
def several_tables(rng: Rng, k: int, log: Log) -> Trial:
    """A workbook, MATLAB or TDMS file with two tables that could each be the log."""
    other, what = second(rng, log)
    names = [("Run_1", "Run_2"), ("Data", "Data_2"), ("raw", "filtered"), ("before", "after")][
        rng.integers(4)
    ]
    frames = [log.frame(), other.frame()]
    tables = dict(zip(names, frames if rng.random() < 0.5 else frames[::-1], strict=True))
    form = (to_excel, to_matlab, to_tdms, to_excel)[k % 4]
    damaged = replace(log, write=lambda _frame, folder: form(tables, folder))
    touched = frozenset({"sheet", "table", "group", *(name.casefold() for name in names)})
    return Trial(
        f"{form.__name__}: {', '.join(names)}; one is {what}", log, damaged, touched, always=True
    )


# --- cells of a workbook


def grouped(value: float) -> str:
    """1234.5 as 1.234,500."""
    return f"{value:,.3f}".translate(str.maketrans(",.", ".,"))


FORMS: dict[str, Callable[[float], str]] = {
    "decimal commas": lambda v: repr(v).replace(".", ","), "points and a decimal comma": grouped,
    "commas and a decimal point": lambda v: f"{v:,.3f}", "texts": repr, "texts with spaces": lambda v: f" {v!r} ",
    "a no-break space": lambda v: f"{v!r}\u00a0", "an exponent": lambda v: f"{v:.5E}".replace(".", ","),
    "true minus signs": lambda v: repr(v).replace("-", "\u2212"), "commas between thousands": lambda v: f"{round(v):,}",
    "#N/A": lambda _v: "#N/A", "#DIV/0!": lambda _v: "#DIV/0!", "OVL": lambda _v: "OVL", "a dash": lambda _v: "-",
    "1e999": lambda _v: "1e999", "with a unit": lambda v: f"{v!r} V", "less than": lambda v: f"<{v!r}",
}  # fmt: skip
"""How a cell is written as a text."""


@fault("cells: texts", 24, SLOW)
def text_cells(rng: Rng, k: int, log: Log) -> Trial:
    """Numbers written as texts, or words where numbers belong, in some columns, in all rows or
    in a part of them.
    """
    form = list(FORMS)[k % len(FORMS)]
    word = FORMS[form](1.5) == FORMS[form](-2.5)
    channels = [
        ("velocity", *POWERS)[j] for j in rng.permutation(5)[: 1 if word else rng.integers(1, 5)]
    ]
    channels = ["force"] if form.startswith("commas between") else channels
    a, b = (
        spot(rng, log, log_uniform(rng, log.step, 3.0 if word else 20.0))
        if word or k % 2
        else (0, len(log.t))
    )
    table = log.table.astype(object)
    for channel in channels:
        table.loc[a : b - 1, channel] = [FORMS[form](x) for x in log[channel][a:b].tolist()]
    damaged = replace(
        log, table=table, write=lambda frame, folder: to_excel({"Data": frame}, folder)
    )
    what = f"{form} in {', '.join(channels)} at rows {a}:{b}"
    return Trial(what, log, damaged, frozenset(channels), times(log, [(a, b)]))


@fault("cells: inserted rows", 12, SLOW)
def inserted_rows(rng: Rng, k: int, log: Log) -> Trial:
    """A note, the header again, units, a row of means or empty rows inside the table or at its
    end.
    """
    columns = list(log.table)
    choices: list[list[list[object]]] = [
        [["crane stopped here"]], [[HEADERS[c] for c in columns]], [[None, "m", "m/s"]], [[None], ["Pause"], [None]],
        [["Mean", None, None, None, 3000.0, 400.0, 200.0, 10.0]], [[None]] * int(rng.integers(1, 30)),
    ]  # fmt: skip
    rows = choices[k % 6]
    added = pd.DataFrame(
        [[*row, *[None] * (len(columns) - len(row))] for row in rows], columns=columns, dtype=object
    )
    at = len(log.t) if rng.random() < 0.15 else spot(rng, log, 0.1)[0] + 1
    table = pd.concat(
        [log.table.iloc[:at].astype(object), added, log.table.iloc[at:].astype(object)]
    )
    damaged = replace(
        log, table=table, write=lambda frame, folder: to_excel({"Data": frame}, folder)
    )
    return Trial(
        f"{rows[0][0]} at row {at}", log, damaged, frozenset({"time"}), times(log, [(at - 1, at)])
    )


# --- campaigns


def campaign(folder: Path, runs: dict[str, tuple[str, float]]) -> Path:
    """Write a campaign from the text and the load [ohm] of each of its logs."""
    place = folder / "campaign"
    place.mkdir()
    entries = []
    for name, (text, load) in runs.items():
        (place / name).write_text(text, encoding="utf-8")
        entries.append(f'[[run]]\nfile = "{name}"\nload_ohm = {load}\nwindow_s = 5.48\n')
    (place / "campaign.toml").write_text(
        "\n".join([f'rig = "{CAMPAIGN / "rig.toml"}"', *entries]), encoding="utf-8"
    )
    return place


def shipped() -> dict[str, tuple[str, float]]:
    """Texts and loads of the fixture campaign. [ohm]"""
    loads = {
        "r45ohm": 45.0,
        "r36ohm": 36.0,
        "r27ohm": 27.0,
        "r18ohm": 18.0,
        "r9ohm": 9.0,
        "r4p5ohm": 4.5,
    }
    return {
        f"{name}.csv": ((CAMPAIGN / f"{name}.csv").read_text(encoding="utf-8"), load)
        for name, load in loads.items()
    }


@cache
def sound_campaign() -> Log:
    """The fixture campaign, in place of a log."""
    write = lambda _frame, folder: campaign(folder, shipped())  # noqa: E731
    return Log("campaign", 25.0, pd.DataFrame(), None, write=write)


def of_campaign(what: str, runs: dict[str, tuple[str, float]]) -> Trial:
    """A trial whose damaged log is a campaign, and whose undamaged one is that of the fixtures."""
    damaged = replace(sound_campaign(), write=lambda _frame, folder: campaign(folder, runs))
    return Trial(what, sound_campaign(), damaged, frozenset(runs), always=True)


@fault("copies: one log under two names", 25, [25.0])
def under_two_names(rng: Rng, k: int, log: Log) -> Trial:
    """A campaign that lists a copy of a log: as it is, with other separators, cut, or with a
    note in front.
    """
    runs = shipped()
    name = list(runs)[rng.integers(len(runs))]
    text, load = runs[name]
    rows = text.splitlines()
    begin = int(rng.integers(30, 200))
    forms = {
        "as it is": text,
        "with semicolons": text.replace(",", ";"),
        "cut at its end": "\n".join([*rows[:-begin], ""]),
        "cut at its beginning": "\n".join([rows[0], *rows[begin:], ""]),
        "with a note in front": f"Operator: A. Crane\n\n{text}",
    }
    form = list(forms)[k % len(forms)]
    return of_campaign(f"{name} {form}", {**runs, "repeat.csv": (forms[form], load)})


@fault("gain of one log", 8, [25.0])
def gain_between_logs(rng: Rng, k: int, log: Log) -> Trial:
    """A gain of one log in a campaign that is 6 to 40 % off that of the others, below 9 % for
    Vdc and Idc.
    """
    runs = shipped()
    name = list(runs)[rng.integers(len(runs))]
    channel = POWERS[k % 4]
    change = either(rng, 0.06, 0.09 if channel in ELECTRICAL else 0.4)
    table = pd.read_csv(CAMPAIGN / name)
    table[HEADERS[channel]] = (table[HEADERS[channel]] * (1 + change)).round(3)
    what = f"gain of {channel} {100 * change:+.1f} % in {name}"
    return of_campaign(what, {**runs, name: (table.to_csv(index=False), runs[name][1])})
