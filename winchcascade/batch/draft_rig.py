"""Draft a rig.toml from what logs show: the built-in rig that fits, candidates for columns, and the numbers that are needed.

What is certain stands as an entry, all else as a comment with its reason.
"""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import chain

from winchcascade.batch.draft_campaign import comment, quoted
from winchcascade.core.campaign_settings import LogSettings
from winchcascade.core.cascade import BUILT_IN as STAGES
from winchcascade.core.channels import CHANNELS
from winchcascade.core.errors import WinchcascadeError
from winchcascade.core.log_thresholds import thresholds_text, together
from winchcascade.core.plain_text import one_line
from winchcascade.core.quantity import find_unit, read_as, unit_names
from winchcascade.core.rig_file import NUMBERS_OF
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

UNITS_MAX = 8
"""Units that are proposed for a column without one."""

FULL = ({"velocity", "displacement"}, {"force"}, {"torque", "power_mech"}, {"vdc"}, {"idc"})
"""Channels of the cascade from line to DC link: one of each set."""

SOURCES = ("waves", "steps", "rows", "whole")
"""Sources of cycles that are tried where logs have no payouts, in this order; `whole` gives every log a result."""

WAVES_MIN = 5
"""Fewer waves are no reciprocating motion."""

TRIED_MAX = 5
"""Number of logs in which cycles are sought."""

PLACES = {
    "winch": "drawing of the drum; the inertia with all that turns at its speed",
    "restoring": "data sheets of screw, piston and accumulator",
    "drivetrain": "data sheets of gear and couplings; `winchcascade calibrate OPEN_CIRCUIT_LOG --write` finds b_rotor",
    "generator": "data sheet of the machine; r_s and l_s of a phase are half of what two terminals show",
    "dc_link": "data sheets of capacitor and resistors; r_bleed is what remains connected without a load",
}
"""Where the numbers of each part of a rig are found."""

_HEAD = """\
# Drafted by winchcascade init. A line behind # is not certain or not known: check it, fill it in, and remove the #.
name = {name}
"""

_NUMBERS = """\
# Numbers that a diagnosis needs, as the rig of the paper has them: state yours. Add to each u = or u_percent = (one
# standard uncertainty) or limits = or limits_percent = (of the maker), and source = "...".
"""


def rig_text(logs: Sequence[LogFacts], name: str) -> str:
    """Text of a rig file for logs of one rig; the columns are those of most of the logs."""
    alike = _alike(logs)
    log, named = alike[0], named_loads([log.path.name for log in logs]).values()
    loads = len({one.ohm for one in named if one.certain} | {log.load for log in logs if log.load is not None}) > 1
    near = candidates(log, loads=loads)
    base, why = fitting_rig(log, near, loads=loads)
    blocks = [_HEAD.format(name=quoted(name)) + (f"based_on = {quoted(base)}{comment(why)}\n" if base else "")]
    if len(alike) < len(logs):
        blocks.append(
            one_line(f"# The columns are those of {len(alike)} of {len(logs)} logs, as {log.path.name}.") + "\n"
        )
    if not log.has_clock:
        blocks.append(f"# [log]\n# sample_rate_hz = 10{comment('no time column was found: rate of the logger')}\n")
    columns = _columns(log, near)
    blocks += ["\n".join(["[columns]", *columns]) + "\n"] if columns else []
    blocks += _phases(blocks[0], alike, near)
    blocks += _thresholds(alike)
    blocks += _numbers(log) if base == DEFAULT_RIG else _few_numbers(log, base)
    return "\n".join(blocks)


def _thresholds(logs: Sequence[LogFacts]) -> list[str]:
    """Table [thresholds] by the motion of the logs, so that all of them are read by the same ones."""
    known = [log.scales for log in logs if log.scales is not None and log.has_clock]
    text = thresholds_text(together(known), f"{len(known)} log{'s' * (len(known) > 1)}, by init") if known else ""
    return [text] if text else []


def _alike(logs: Sequence[LogFacts]) -> list[LogFacts]:
    """The logs that have the columns of most, those that can be read first."""
    heads = [tuple(column.name for column in log.columns) for log in logs]
    usual = Counter(heads).most_common(1)[0][0]
    return sorted(
        (log for log, head in zip(logs, heads, strict=True) if head == usual), key=lambda log: log.fault != ""
    )


def candidates(log: LogFacts, *, loads: bool) -> Candidates:
    """Columns that may be each channel that was not found, by name first, then by unit; a column that is constant is none.

    Where logs or their names state loads, a few columns without unit that are left over may be any channel of a cascade with
    a DC link for which nothing else is there.
    """
    taken = {column.name for column in log.columns if column.channel in (*log.channels, "time")}
    free = [column for column in log.columns if column.name not in taken and column.low < column.high]
    found: dict[str, list[ColumnFacts]] = {}
    for channel in (name for name in CHANNELS if name not in log.channels):
        called = near_channel(channel, [column.header for column in free])
        named = [one for one in free if one.channel == channel or (one.unit is None and one.name in called)]
        fitting = [one for one in free if read_as(one.unit, CHANNELS[channel].dimension) is not None]
        found[channel] = [*dict.fromkeys([*named, *fitting])]
    left = [one for one in free if one.unit is None and one.channel is None and one not in chain(*found.values())]
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
        *(channel for channel, columns in near.items() if loads or any(one.unit for one in columns)),
    }
    if all(possible & one for one in FULL):
        return DEFAULT_RIG, "the same cascade; what is not stated here, also of [sensors], is taken from that rig"
    return "", ""


def _columns(log: LogFacts, near: Candidates) -> list[str]:
    """Entries of [columns] as comments: channels that were found without a unit, and candidates for those that were not."""
    lines = []
    for channel in log.without_unit:
        column = next((one for one in log.columns if one.channel == channel), None)
        if column is not None and channel in CHANNELS:
            lines.append(
                _column(channel, column, f"names no unit; taken as {CHANNELS[channel].unit}{_beyond(channel, column)}")
            )
    for channel, columns in near.items():
        more = f"; {len(columns) - CANDIDATES_MAX} more fit" if len(columns) > CANDIDATES_MAX else ""
        lines += [_column(channel, one, f"not found; a candidate{more}") for one in columns[:CANDIDATES_MAX]]
    if len(near.get("idc", ())) > 1:
        lines.append(
            '# Currents at one voltage add up: [channels.NAME], and power = "vdc * a + vdc * b" under [stage.NAME].'
        )
    return lines


def _column(channel: str, column: ColumnFacts, reason: str) -> str:
    """An entry of [columns] as a comment, with a unit to be checked where the log names none."""
    keys = [f"name = {quoted(column.name)}"]
    keys += [] if column.unit is not None else [f"unit = {quoted(CHANNELS[channel].unit)}"]
    keys += ['side = "shaft"'] if channel == "speed" else []
    values = f"{column.low:.4g} to {column.high:.4g} {column.header.unit or ''}".rstrip()
    if column.unit is None:
        values += f"; {', '.join([*unit_names(CHANNELS[channel].dimension).values()][:UNITS_MAX])} ...?"
    return f"# {channel} = {{ {', '.join(keys)} }}" + comment(f"{reason}; {values}")


def _beyond(channel: str, column: ColumnFacts) -> str:
    """A remark on values that exceed the range of the sensor of the paper in the unit that is assumed."""
    sensor, unit = built_in(DEFAULT_RIG).sensors.get(channel), find_unit(CHANNELS[channel].unit)
    if sensor is None or sensor.high is None or unit is None or column.high * unit.factor <= sensor.high:
        return ""
    return (
        f", which is implausible: beyond {sensor.high / unit.factor:.3g} {CHANNELS[channel].unit} of the paper's sensor"
    )


def _phases(head: str, logs: Sequence[LogFacts], near: Candidates) -> list[str]:
    """Source of cycles, by trial, where most logs have no payouts: a comment where candidates or a rate were taken for it."""
    sure, assumed, used = not logs[0].fault and logs[0].has_clock, head, set[str]()
    if not sure:
        assumed += "\n[log]\nsample_rate_hz = 10\n[columns]\n"
        for channel, columns in near.items():
            column = next((one for one in columns if one.name not in used), None)
            if column is not None:
                used.add(column.name)
                assumed += _column(channel, column, "").removeprefix("# ") + "\n"
    tried = logs[:TRIED_MAX]
    if 2 * sum(_cycles(assumed, log, "") > 0 for log in tried) >= len(tried):  # damaged logs have no payouts either
        return []
    found = {source: sum(_cycles(assumed, log, source) > 0 for log in tried) for source in SOURCES}
    best = max(found, key=found.__getitem__)
    if not found[best]:
        return []
    mark, where = ("", f"{found[best]} of {len(tried)} logs") if sure else ("# ", "the first candidates above")
    return [f'{mark}[phases]\n{mark}from = "{best}"{comment(f"no payouts were found; gives cycles with {where}")}\n']


def _cycles(text: str, log: LogFacts, source: str) -> int:
    """Number of complete cycles of a log with the text of a rig file and a source; 0 where it cannot be reduced so."""
    phases = f'\n[phases]\nfrom = "{source}"\n' if source else ""
    try:
        run = read_by(log.path, LogSettings(parse_rig(text + phases, "draft")))
        if source == "rows" and run.samples > FEW_ROWS:
            return 0
        found = reduce(run)
    except WinchcascadeError:
        return 0
    other = any(finding.kind == "phase_source" for finding in found.quality)
    disordered = any(finding.kind == "backward_stamp" for finding in run.findings) and source not in ("rows", "whole")
    count = sum(cycle.complete for cycle in found.cycles)
    return 0 if other or disordered or (source == "waves" and count < WAVES_MIN) else count


def _numbers(log: LogFacts) -> list[str]:
    """All numbers that a model needs, as comments with those of the paper."""
    paper, blocks = tomllib.loads(built_in_text(DEFAULT_RIG)), [_NUMBERS]
    for section in PARTS:
        lines = [f"[{section}]" + comment(PLACES[section])]
        if section == "restoring":
            lines += [f"# kind = {quoted(kind)}{comment(_instead(names))}" for kind, names in NUMBERS_OF.items()][1:]
        own = {name: number for number, name in in_rig_file(section).items()}
        for name in needed(built_in(DEFAULT_RIG), section):
            stated, about = paper[section][name], numbers_of(section)[own[name]]
            what = about.what.replace("absolute pressure", "gauge pressure") if about.unit == "Pa" else about.what
            what += _turn(log) if name == "r_drum" else ""
            value = f"value = {stated['value']}, unit = {quoted(stated['unit'])}"
            lines.append(f"# {name} = {{ {value} }}" + comment(what))
        blocks.append("\n".join(lines) + "\n")
    return blocks


def _turn(log: LogFacts) -> str:
    """What a speed of rotation and the speed of the line show of radius and gear."""
    if log.turn is None:
        return ""
    return (
        f"; rotation over line speed is {log.turn:.4g} rad/m: 1 / r_drum of a drum, gear_ratio / r_drum of a generator"
    )


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
    stages = [quoted(name) for name, stage in STAGES.items() if stage.power(log.channels, 1.0) is not None]
    if stages and not base:
        order = comment("what the log has; put the stages in the order in which power flows")
        blocks.append(f"# [cascade]\n# stages = [{', '.join(stages)}]{order}\n")
    return blocks
