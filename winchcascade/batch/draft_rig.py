"""Draft a rig.toml from what logs show: the built-in rig that fits, candidates for columns, and the
numbers that are needed.

What is certain stands as an entry, all else as a comment with its reason.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from itertools import chain, zip_longest

from winchcascade.batch.draft_campaign import comment, quoted
from winchcascade.core.campaign_settings import LogSettings
from winchcascade.core.cascade import BUILT_IN as STAGES
from winchcascade.core.channels import CHANNELS
from winchcascade.core.errors import WinchcascadeError
from winchcascade.core.log_thresholds import thresholds_text, together
from winchcascade.core.machine_parts import NUMBERS_OF
from winchcascade.core.plain_text import first_of, one_line
from winchcascade.core.quantity import find_unit, read_as, unit_names
from winchcascade.core.rig_toml import BUILT_IN, DEFAULT_RIG, built_in, built_in_text, parse_rig
from winchcascade.ingest.assign import has_columns, near_channel
from winchcascade.ingest.log_facts import ColumnFacts, LogFacts
from winchcascade.ingest.named_load import named_loads
from winchcascade.ingest.read import read_by
from winchcascade.reduction.phase_proposal import FEW_ROWS
from winchcascade.reduction.reduce import reduce
from winchcascade.rig.baseline import needed
from winchcascade.rig.parts import PARTS, in_rig_file, numbers_of

Candidates = Mapping[str, Sequence[ColumnFacts]]
"""Columns that may be a channel, by its name."""

CANDIDATES_MAX = 4
"""Candidates that are listed for one channel: a logger may have twenty columns of pressure."""

KINDS_MAX = 12
"""Kinds of logs that are listed."""

UNITS_MAX = 8
"""Units that are proposed for a column without one."""

FULL = ({"velocity", "displacement"}, {"force"}, {"torque", "power_mech"}, {"vdc"}, {"idc"})
"""Channels of the cascade from line to DC link: one of each set."""

SOURCES = ("waves", "steps", "rows", "whole")
"""Sources of cycles that are tried where logs have no payouts, in this order; `whole` gives
every log a result.
"""

WAVES_MIN = 5
"""Fewer waves are no reciprocating motion."""

TRIED_MAX = 5
"""Number of logs in which cycles are sought."""

PLACES = {
    "winch": "drawing of the drum; the inertia with all that turns at its speed",
    "restoring": "data sheets of screw, piston and accumulator",
    "drivetrain": "data sheets of gear and couplings; `winchcascade calibrate OPEN_CIRCUIT_LOG "
    "--write` finds b_rotor",
    "generator": "data sheet of the machine; r_s and l_s of a phase are half of what two "
    "terminals show",
    "dc_link": "data sheets of capacitor and resistors; r_bleed is what remains connected without "
    "a load",
}
"""Where the numbers of each part of a rig are found."""

_HEAD = """\
# Drafted by winchcascade init. Lines that start with # are guesses or placeholders: check each, fill it in, and remove the #.
name = {name}
"""

_NUMBERS = """\
# Numbers that a diagnosis needs, as the rig of the paper has them: state yours. Add to each u = or u_percent = (one
# standard uncertainty) or limits = or limits_percent = (of the maker), and source = "...".
"""


def rig_text(logs: Sequence[LogFacts], name: str) -> str:
    """Text of a rig file for logs of one rig.

    Cycles and numbers are drafted by the kind that most of the logs are of.
    """
    kinds = _kinds(logs)
    log, named = kinds[0][0], named_loads([log.path.name for log in logs]).values()
    loads = (
        len(
            {one.ohm for one in named if one.certain}
            | {log.load for log in logs if log.load is not None}
        )
        > 1
    )
    each = [(kind[0], candidates(kind[0], loads=loads)) for kind in kinds]
    near = each[0][1]
    base, why = fitting_rig(log, near, loads=loads)
    blocks = [
        _HEAD.format(name=quoted(name))
        + (f"based_on = {quoted(base)}{comment(why)}\n" if base else "")
    ]
    if len(kinds) > 1:
        kind_names = [f"{kind[0].path.name} ({len(kind)})" for kind in kinds]
        blocks.append(
            one_line(f"# Kinds of logs by their columns: {first_of(kind_names, KINDS_MAX)}.") + "\n"
        )
    if not all(one.has_clock for one, _ in each):
        blocks.append(
            f"# [log]\n# sample_rate_hz = "
            f"10{comment('no clock that can be read: rate of the logger')}\n"
        )
    columns = _columns(each)
    blocks += ["\n".join(["[columns]", *columns]) + "\n"] if columns else []
    blocks += _phases(blocks[0], kinds[0], near)
    blocks += _thresholds(logs)
    blocks += _numbers(log) if base == DEFAULT_RIG else _few_numbers(log, base)
    return "\n".join(blocks)


def _thresholds(logs: Sequence[LogFacts]) -> list[str]:
    """Table [thresholds] by the motion of the logs, so that all of them are read by the same
    ones.
    """
    known = [log.scales for log in logs if log.scales is not None and log.has_clock]
    text = (
        thresholds_text(together(known), f"{len(known)} log{'s' * (len(known) > 1)}, by init")
        if known
        else ""
    )
    return [text] if text else []


def _kinds(logs: Sequence[LogFacts]) -> list[list[LogFacts]]:
    """The logs by their columns; the most frequent kind comes first, and in it logs that can be
    read.
    """
    kinds: dict[tuple[str, ...], list[LogFacts]] = {}
    for log in sorted(logs, key=lambda log: log.fault != ""):
        kinds.setdefault(tuple(column.name for column in log.columns), []).append(log)
    return sorted(kinds.values(), key=len, reverse=True)


def candidates(log: LogFacts, *, loads: bool) -> Candidates:
    """Columns that may be each channel that was not found, by name first, then by unit; a column
    that is constant is none.

    For a log that cannot be read yet, columns that have the name and the unit of a channel are no
    candidates: they are found later. Where logs or their names state loads, a few columns without
    unit that are left over may be any channel of a cascade with a DC link for which nothing else is
    there.
    """
    taken = {column.name for column in log.columns if column.channel in (*log.channels, "time")}
    free = [
        column for column in log.columns if column.name not in taken and column.low < column.high
    ]
    found: dict[str, list[ColumnFacts]] = {}
    later = [one.channel for one in log.columns if log.fault and one.unit is not None]
    for channel in (
        name for name in CHANNELS if name not in log.channels and later.count(name) != 1
    ):
        called = near_channel(channel, [column.header for column in free])
        named = [
            one
            for one in free
            if one.channel == channel or (one.unit is None and one.name in called)
        ]
        fitting = [
            one for one in free if read_as(one.unit, CHANNELS[channel].dimension) is not None
        ]
        found[channel] = [*dict.fromkeys([*named, *fitting])]
    left = [
        one
        for one in free
        if one.unit is None and one.channel is None and one not in chain(*found.values())
    ]
    there = {*log.channels, *(channel for channel, columns in found.items() if columns)}
    if loads and len(left) <= CANDIDATES_MAX:
        found |= {channel: left for one in FULL if not one & there for channel in sorted(one)}
    return {channel: columns for channel, columns in found.items() if columns}


def fitting_rig(log: LogFacts, near: Candidates, *, loads: bool) -> tuple[str, str]:
    """Name of the built-in rig that fits a log, and why; empty for none.

    Parameters
    ----------
    loads : logs or their names state loads, so that candidates without a unit count too
    """
    headers = [column.header for column in log.columns]
    for name in BUILT_IN:
        if has_columns(headers, built_in(name)):
            return name, "the logs have the columns of this rig"
    possible = {
        *log.channels,
        *(
            channel
            for channel, columns in near.items()
            if loads or any(one.unit for one in columns)
        ),
    }
    if all(possible & one for one in FULL):
        return (
            DEFAULT_RIG,
            "the same cascade; what is not stated here, also of [sensors], is taken from that rig",
        )
    return "", ""


def _columns(each: Sequence[tuple[LogFacts, Candidates]]) -> list[str]:
    """Entries of [columns] as comments: channels without a unit, and candidates for those not
    found.

    Where logs are of several kinds, an entry has one column of each.
    """
    lines = []
    several = len(each) > 1
    for channel in dict.fromkeys(chain(*(log.without_unit for log, _ in each))):
        logs = [log for log, _ in each if channel in log.without_unit]
        found = [column for log in logs for column in log.columns if column.channel == channel]
        if found and channel in CHANNELS:
            beyond = next(filter(None, (_beyond(channel, one) for one in found)), "")
            reason = f"names no unit; taken as {CHANNELS[channel].unit}{beyond}"
            lines.append(_column(channel, found if several else found[:1], reason, several=several))
    for channel in CHANNELS:
        rows = [*zip_longest(*(near.get(channel, ()) for _, near in each))]
        more = f"; {len(rows) - CANDIDATES_MAX} more fit" if len(rows) > CANDIDATES_MAX else ""
        for row in rows[:CANDIDATES_MAX]:
            columns = [one for one in row if one is not None]
            lines.append(
                _column(channel, columns, f"not found; a candidate{more}", several=several)
            )
    if any(len(near.get("idc", ())) > 1 for _, near in each):
        lines.append(
            '# Currents at one voltage add up: [channels.NAME], and power = "vdc * a + vdc * b" '
            "under [stage.NAME]."
        )
    return lines


def _column(
    channel: str, columns: Sequence[ColumnFacts], reason: str, *, several: bool = False
) -> str:
    """An entry of [columns] as a comment, with a unit to be checked where a log names none.

    `several` makes its name a list.
    """
    columns = [*{column.name: column for column in columns}.values()]
    names = ", ".join(quoted(column.name) for column in columns)
    unitless = any(column.unit is None for column in columns)
    keys = [f"name = [{names}]" if several else f"name = {names}"]
    keys += [f"unit = {quoted(CHANNELS[channel].unit)}"] if unitless else []
    keys += ['side = "shaft"'] if channel == "speed" else []
    values = "; ".join(
        f"{c.low:.4g} to {c.high:.4g} {c.header.unit or ''}".rstrip() for c in columns
    )
    if unitless:
        values += (
            f"; {', '.join([*unit_names(CHANNELS[channel].dimension).values()][:UNITS_MAX])} ...?"
        )
    return f"# {channel} = {{ {', '.join(keys)} }}" + comment(f"{reason}; {values}")


def _beyond(channel: str, column: ColumnFacts) -> str:
    """A remark on values that exceed the range of the sensor of the paper in the unit that is
    assumed.
    """
    sensor, unit = built_in(DEFAULT_RIG).sensors.get(channel), find_unit(CHANNELS[channel].unit)
    if (
        sensor is None
        or sensor.high is None
        or unit is None
        or column.high * unit.factor <= sensor.high
    ):
        return ""
    return f", which is implausible: beyond {sensor.high / unit.factor:.3g} {CHANNELS[channel].unit} of the paper's sensor"


def _phases(head: str, logs: Sequence[LogFacts], near: Candidates) -> list[str]:
    """Source of cycles, by trial, where most logs have no payouts: a comment where candidates or
    a rate were taken for it.
    """
    sure, assumed, used = not logs[0].fault and logs[0].has_clock, head, set[str]()
    if not sure:
        assumed += "\n[log]\nsample_rate_hz = 10\n[columns]\n"
        for channel, columns in near.items():
            column = next((one for one in columns if one.name not in used), None)
            if column is not None:
                used.add(column.name)
                assumed += _column(channel, [column], "").removeprefix("# ") + "\n"
    tried = logs[:TRIED_MAX]
    if 2 * sum(_cycles(assumed, log, "") > 0 for log in tried) >= len(
        tried
    ):  # damaged logs have no payouts either
        return []
    found = {source: sum(_cycles(assumed, log, source) > 0 for log in tried) for source in SOURCES}
    best = max(found, key=found.__getitem__)
    if not found[best]:
        return []
    mark, where = (
        ("", f"{found[best]} of {len(tried)} logs")
        if sure
        else ("# ", "the first candidates above")
    )
    return [
        f"{mark}[phases]\n{mark}from = "
        f'"{best}"{comment(f"no payouts were found; gives cycles with {where}")}\n'
    ]


def _cycles(text: str, log: LogFacts, source: str) -> int:
    """Number of complete cycles of a log with the text of a rig file and a source; 0 where it
    cannot be reduced so.
    """
    phases = f'\n[phases]\nfrom = "{source}"\n' if source else ""
    try:
        run = read_by(log.path, LogSettings(parse_rig(text + phases, "draft")))
        if source == "rows" and run.samples > FEW_ROWS:
            return 0
        found = reduce(run)
    except WinchcascadeError:
        return 0
    other = any(finding.kind == "phase_source" for finding in found.quality)
    disordered = any(
        finding.kind == "backward_stamp" for finding in run.findings
    ) and source not in ("rows", "whole")
    count = sum(cycle.complete for cycle in found.cycles)
    return 0 if other or disordered or (source == "waves" and count < WAVES_MIN) else count


def _numbers(log: LogFacts) -> list[str]:
    """All numbers that a model needs, as comments with those of the paper."""
    paper, blocks = tomllib.loads(built_in_text(DEFAULT_RIG)), [_NUMBERS]
    for section in PARTS:
        lines = [f"[{section}]" + comment(PLACES[section])]
        if section == "restoring":
            lines += [
                f"# kind = {quoted(kind)}{comment(_instead(names))}"
                for kind, names in NUMBERS_OF.items()
            ][1:]
        own = {name: number for number, name in in_rig_file(section).items()}
        for name in needed(built_in(DEFAULT_RIG), section):
            stated, about = paper[section][name], numbers_of(section)[own[name]]
            what = (
                about.what.replace("absolute pressure", "gauge pressure")
                if about.unit == "Pa"
                else about.what
            )
            what += _turn(log) if name == "r_drum" else ""
            value = f"value = {stated['value']}, unit = {quoted(stated['unit'])}"
            lines.append(f"# {name} = {{ {value} }}" + comment(what))
        blocks.append("\n".join(lines) + "\n")
    return blocks


def _turn(log: LogFacts) -> str:
    """What a speed of rotation and the speed of the line show of radius and gear."""
    if log.turn is None:
        return ""
    return f"; rotation over line speed is {log.turn:.4g} rad/m: 1 / r_drum of a drum, gear_ratio / r_drum of a generator"


def _instead(names: Sequence[str]) -> str:
    """Which numbers another kind of restoring module has."""
    return f"in place of all below: {', '.join(names) or 'no number'}"


def _few_numbers(log: LogFacts, base: str) -> list[str]:
    """Drum radius, gear ratio and stages, as comments, for logs that are no whole cascade."""
    radius = comment(f"radius of the drum{_turn(log)}")
    gear = comment("generator speed over drum speed")
    blocks = [
        f'[winch]\n# r_drum = {{ value = 0.2, unit = "m" }}{radius}\n',
        f'[drivetrain]\n# gear_ratio = {{ value = 1, unit = "1" }}{gear}\n',
    ]
    stages = [
        quoted(name) for name, stage in STAGES.items() if stage.power(log.channels, 1.0) is not None
    ]
    if stages and not base:
        order = comment("what the log has; put the stages in the order in which power flows")
        blocks.append(f"# [cascade]\n# stages = [{', '.join(stages)}]{order}\n")
    return blocks
