"""Draft a campaign.toml from what logs show: runs in the order of their clocks, loads by file, name
and currents.

What is certain stands as an entry, all else as a comment with its reason.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from datetime import UTC, datetime

import tomlkit

from winchcascade.core.plain_text import one_line
from winchcascade.ingest.log_facts import LogFacts
from winchcascade.ingest.named_load import NamedLoad, named_loads

AGREES = 0.1
"""Deviation of Vdc over Idc up to which it confirms a nominal load: resistors warm, and the loads
of a campaign differ by more. [1]"""

NO_CURRENT = 0.03
"""Share of the current of the other logs below which a log is an open circuit: a bleed resistor
takes 1 %. [1]
"""

CONSTANT = 0.01
"""Relative range of a column of resistance that is one load in all rows. [1]"""

FAULT_LENGTH = 160
"""Letters of the reason why a log cannot be read yet: `reduce` prints all of it."""

_DATE = re.compile(r"(20\d\d)\D?(\d\d)\D?(\d\d)(?:\D{0,2}(\d\d)\D?(\d\d)(?:\D?(\d\d))?)?")
_TIME = "%Y-%m-%dT%H:%M:%S"
_HEAD = """\
# Drafted by winchcascade init. Lines that start with # are guesses: check each, fill it in, and remove the #.
title = {title}
rig = {rig}
# measured = true  # true: measured; false: simulated or rebuilt
# origin = "who measured what, where and when"

# {order}
"""


def quoted(text: str) -> str:
    """A text as TOML quotes it; with a question mark for what is no letter of UTF-8.

    >>> quoted('say "a"')
    '"say \\\\"a\\\\""'
    """
    return str(tomlkit.string(text.encode(errors="replace").decode()).as_string())


def comment(text: str) -> str:
    """A text as a comment behind an entry; it may quote what a file holds."""
    return f"  # {one_line(text)}"


def campaign_text(logs: Sequence[LogFacts], title: str, rig: str) -> str:
    """Text of a campaign.toml that lists every log.

    Parameters
    ----------
    rig : name of the rig file beside it, or of a built-in rig
    """
    ordered, order = in_order(logs)
    named = named_loads([log.path.name for log in ordered])
    blocks = [_HEAD.format(title=quoted(title), rig=quoted(rig), order=order)]
    for log in ordered:
        others = [
            other.top_current
            for other in ordered
            if other is not log and other.top_current is not None
        ]
        started = log.started
        lines = [
            "[[run]]",
            f"file = {quoted(log.path.name)}",
            f"# not readable yet: {one_line(log.fault)[:FAULT_LENGTH]}" if log.fault else "",
            load_line(log, named.get(log.path.name), max(others, default=None)),
            "" if started is None else f"started = {datetime.fromtimestamp(started, UTC):{_TIME}}",
            "measured = false" if log.simulated else "",
        ]
        blocks.append("\n".join(filter(None, lines)) + "\n")
    return "\n".join(blocks)


def in_order(logs: Sequence[LogFacts]) -> tuple[list[LogFacts], str]:
    """Logs in the order in which they were made, as far as it is known, and a sentence on what
    it was taken from.
    """
    starts = [log.started for log in logs]
    if len(set(starts)) == len(logs) and None not in starts:
        return sorted(
            logs, key=lambda log: log.started or 0.0
        ), "The runs stand in the order of the clocks of the logs."
    dates = {log.path: match.group(0) for log in logs if (match := _DATE.search(log.path.name))}
    if len(set(dates.values())) == len(logs):
        by_date = sorted(logs, key=lambda log: re.sub(r"\D", "", dates[log.path]))
        return (
            by_date,
            "The runs stand in the order of the dates in the file names, as the logs have none.",
        )
    by_name = sorted(
        logs,
        key=lambda log: [int(n) if n.isdigit() else n for n in re.split(r"(\d+)", log.path.name)],
    )
    return (
        by_name,
        "The runs stand in the order of their names, as the logs have no dates: put them in the "
        "order of the tests.",
    )


def load_line(log: LogFacts, named: NamedLoad | None, other_current: float | None) -> str:
    """Line of the load of one run, as an entry or as a comment; empty where nothing shows a load.

    Parameters
    ----------
    other_current : largest current among the other logs, None where they have none [A]
    """
    if log.load is not None:
        return _entry(log.load, log.load_source)
    for column in log.columns:
        unit, width = column.unit, column.high - column.low
        if unit is None or unit.dimension != "resistance" or column.low <= 0.0:
            continue
        if width <= CONSTANT * column.high:
            return _entry(unit.factor * column.high, f"column {column.name}")
    idle = log.top_current is not None and log.top_current < NO_CURRENT * (other_current or 0.0)
    currents = (
        f"Idc stays at {log.top_current:.3g} A, and reaches {other_current:.3g} A in another log"
        if idle
        else ""
    )
    if named is not None:
        shown = named.certain or any(column.electrical for column in log.columns)
        return _named_line(log, named, currents) if shown else ""
    if idle:
        return _entry(math.inf, currents)
    if log.ratio is None:
        return ""
    guess = "Vdc / Idc; where the load is a resistor, state its nominal value"
    return _entry(float(f"{log.ratio:.3g}"), guess, sure=False)


def _named_line(log: LogFacts, named: NamedLoad, currents: str) -> str:
    """Line of a load that the name states, with what the currents say of it; `currents`
    describes those of an open circuit.
    """
    states = "file name" if named.certain else f"a number in the file name ({named.how})"
    if math.isinf(named.ohm):
        carries = log.ratio is not None and not currents and log.ratio < 1e3
        against = f"but Vdc / Idc is {log.ratio:.4g} ohm" if carries else currents
        reason = "; ".join(filter(None, (states, against)))
        return _entry(named.ohm, reason, sure=not carries)
    if currents:
        reason = f"{states}, but {currents}: check which is right"
        return _entry(named.ohm, reason, sure=False)
    if log.ratio is None:
        unsure = "" if named.certain else "; no Vdc / Idc confirms it"
        return _entry(named.ohm, states + unsure, sure=named.certain)
    shown = f"Vdc / Idc is {log.ratio:.4g} ohm"
    if abs(log.ratio / named.ohm - 1.0) < AGREES:
        return _entry(named.ohm, f"{states}; {shown}")
    return _entry(named.ohm, f"{states}; but {shown}: check which is right", sure=False)


def _entry(ohm: float, reason: str, *, sure: bool = True) -> str:
    return ("" if sure else "# ") + f"load_ohm = {ohm:.12g}" + comment(reason)
