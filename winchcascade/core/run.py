"""Run: one log or one simulation, with its channels and the findings on it."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import msgspec

from winchcascade.core.arguments import CYCLES, LOAD, MAPPING, RATE, TEXT, Expected, check_arguments
from winchcascade.core.campaign_file import Cycles, Origin
from winchcascade.core.channels import CHANNELS
from winchcascade.core.errors import OptionError
from winchcascade.core.extras import is_installed
from winchcascade.core.quantity import si_unit
from winchcascade.core.rig_file import Rig
from winchcascade.core.viewed import Viewed

LOAD_HEADER = "Load (ohm)"
"""Last column of a simulated log: the load of its run in every row, inf for an open circuit."""

SIMULATED_HEADERS = ("Generator speed (rpm)", "Stator current (A rms)", "Air-gap torque (N.m)")
"""Columns that all together mark a log as simulated: a rig may measure one of them, as the speed
of its generator.
"""

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Signal: TypeAlias = NDArray[np.float64]
    Index: TypeAlias = NDArray[np.intp]
    Mask: TypeAlias = NDArray[np.bool_]
else:

    class Signal:
        """Array of numbers, numpy.float64; a name alone, so that a module that imports it does
        not import numpy.
        """

    class Index:
        """Array of places, numpy.intp."""

    class Mask:
        """Array of truth values, numpy.bool_."""


FindingKind = Literal[
    "rig_assumed", "missing_channel", "derived_channel", "dropped_samples", "not_a_number", "repeated_stamp", "backward_stamp",
    "repeated_rows", "clock_jitter", "out_of_range", "stuck", "spike", "truncated", "unit_assumed", "sign_flipped",
    "slack_line", "incomplete_cycle", "unknown_column", "ambiguous_column", "load_mismatch", "coarse_sampling",
    "coarse_resolution", "clock_mismatch", "channel_lag", "zero_offset", "gain_step", "gain_mismatch", "stroke_mismatch",
    "repeated_log",
    "window_beyond_payout", "phase_source", "unit_conflict", "speed_mismatch", "efficiency_change",
    "efficiency_above_one", "origin_conflict", "dead_channel", "sign_mismatch", "listed_in_parts", "loggers_aligned",
    "thresholds_assumed",
]  # fmt: skip

CLOCK = "clock"
"""Key in `Run.gaps` of the gaps that concern every channel: rows that were never logged or could
not be kept.
"""

Repairs = Literal["on", "off"]
"""Whether faults of a log are repaired; `off` keeps what was logged and lists what would be
repaired.
"""


class Repair(msgspec.Struct, frozen=True):
    """What a finding changed of a log, or would change: how, how many samples (0: none was taken
    out), the first and the last time of each place [s], and whether it was done.
    """

    what: str
    samples: int
    spans: tuple[tuple[float, float], ...] = ()
    applied: bool = True


class Finding(msgspec.Struct, frozen=True):
    """One thing that is wrong with a log: where, how much, and what was done about it.

    `start` and `end` are times on the log's clock [s]; `removed` counts the samples that the
    finding took out of the measurement (bridged, left out or never logged), 0 where the data were
    kept as they are. `columns` are the names of columns that are no channel. `repair` is what was
    changed of the log, where the action alone does not describe it.
    """

    kind: FindingKind
    message: str
    action: str
    channel: str | None = None
    start: float | None = None
    end: float | None = None
    count: int = 1
    removed: int = 0
    columns: tuple[str, ...] = ()
    repair: Repair | None = None

    @property
    def repaired(self) -> Repair | None:
        """What was changed of the log, or would be; None for a finding that changes none of it.

        >>> Finding("truncated", "the log ends within a row", "1 row left out", removed=1).repaired
        Repair(what='1 row left out', samples=1, spans=(), applied=True)
        """
        if self.repair is not None or not self.removed or self.kind == "incomplete_cycle":
            return self.repair
        spans = () if self.start is None or self.end is None else ((self.start, self.end),)
        return Repair(self.action, self.removed, spans)

    def at_times(self, t: Signal, other: Signal) -> Finding:
        """The finding on another clock: `other` has the times of the samples that `t` has on
        this one, (n,) each. [s]
        """
        import numpy as np

        if self.start is None or self.end is None:
            return self
        start, end = np.interp([self.start, self.end], t, other).tolist()
        repair = self.repair
        if repair is not None and repair.spans:
            spans = tuple((a, b) for a, b in np.interp(np.array(repair.spans), t, other).tolist())
            repair = msgspec.structs.replace(repair, spans=spans)
        return msgspec.structs.replace(self, start=start, end=end, repair=repair)

    def lost_share(self, samples: int) -> float:
        """Share of the samples that it removed from a log with this number of rows; rows that were
        never logged count, too.

        >>> Finding("dropped_samples", "", "", removed=30).lost_share(10), Finding("spike", "", "", removed=1).lost_share(10)
        (0.75, 0.1)
        """
        whole = samples + (self.removed if self.kind == "dropped_samples" else 0)
        return self.removed / whole if whole else 0.0


FINDINGS = Expected("a tuple of findings", lambda value: isinstance(value, tuple))
RIG = Expected(
    "a rig, as load_rig(name) gives it, or None",
    lambda value: isinstance(value, Rig),
    optional=True,
)


class Run(Viewed, frozen=True):
    """One log, checked when it was read: stamps rise, every channel is finite, and what was bridged
    is known.

    Parameters
    ----------
    name : file name, for messages
    t : (n,) stamps on the log's own clock, for stamped logs since the first sample [s]
    channels : (n,) each, by the names of `CHANNELS` and of the rig's own channels, SI units, payout
        positive; pressure is gauge [Pa], `speed` is that of the shaft with the torque sensor
        [rad/s]; any of them may be absent, the velocity too
    gaps : (k, 2) each, by channel or `CLOCK`: last good and first good stamp around what was
        bridged [s]
    fs : sampling rate without the gaps [Hz]
    samples : rows of the log, before any was left out
    about : title of its campaign
    table : name of the sheet, variable or group that was read, None for a file that is one table
    simulated : carries the columns by which `simulate` marks its logs; a log without that mark may
        be simulated too
    origin : whether the data are measured, as the campaign states it or the mark of `simulate`, and
        where they come from
    labels : (n,) 1 in payout, -1 in haul-in, 0 elsewhere, where the rig file names a column of
        phases
    signs : -1 for each channel that is logged with the opposite sign, and was turned
    first_stamp : date and time of the first sample as the log writes it, where its stamps are texts
    load : resistance at the DC link; inf is an open circuit, None unknown or no load at all [ohm]
    started : when the run began, on a clock that the runs of a campaign share: since 1970, of local
        times as if they were UTC; None where neither the campaign nor the stamps state a date [s]
    temperature : of winding or housing, one number for the run, None where it is unknown [K]
    rig : with which the log was read, marked as assumed where none was named; None for a run that
        was not read
    window, cycles : rule or length [s] of the integration windows, first and last cycle that count,
        as the campaign that lists the log states them; `reduce` uses them where it is given no
        others
    repairs : "off" where the channels are as they were logged, and the findings list what would be
        repaired
    """

    name: str
    t: Signal
    channels: Mapping[str, Signal]
    fs: float
    samples: int
    gaps: Mapping[str, Signal] = msgspec.field(default_factory=dict)
    labels: Signal | None = None
    signs: Mapping[str, float] = msgspec.field(default_factory=dict)
    load: float | None = None
    load_source: str = "unknown"
    path: str = ""
    sha256: str = ""
    findings: tuple[Finding, ...] = ()
    simulated: bool = False
    about: str = ""
    origin: Origin = Origin()
    table: str | None = None
    first_stamp: str = ""
    started: float | None = None
    temperature: float | None = None
    rig: Rig | None = None
    window: str | float | None = None
    cycles: Cycles | None = None
    repairs: Repairs = "on"

    def __post_init__(self) -> None:
        """Check a run that was not read by this program. Raises OptionError as `checked_arrays`."""
        from winchcascade.core.checked_run import SealedChannels, checked_arrays

        check_arguments(
            "Run", ("name", self.name, TEXT), ("load", self.load, LOAD), ("fs", self.fs, RATE), ("gaps", self.gaps, MAPPING),
            ("findings", self.findings, FINDINGS), ("cycles", self.cycles, CYCLES), ("rig", self.rig, RIG),
        )  # fmt: skip
        if not isinstance(self.channels, SealedChannels) or not self.channels.fits(self.t, self.fs):
            for name, value in checked_arrays(
                self.name, self.t, self.channels, self.labels, self.fs
            ).items():
                msgspec.structs.force_setattr(self, name, value)

    def __repr__(self) -> str:
        """One line instead of the arrays."""
        return f"Run({self.name!r}, {self.samples} samples at {self.fs:g} Hz, channels {', '.join(self.channels)})"

    def to_xarray(self) -> Any:
        """Channels over `time` as a Dataset of xarray, with SI units as attributes `units`.

        OptionError if xarray is not installed, which winchcascade does not need.
        """
        if not is_installed("xarray"):
            raise OptionError(
                "to_xarray needs xarray, which is not installed; install it with pip install "
                "xarray."
            )
        known = CHANNELS if self.rig is None else self.rig.known_channels
        units = {
            name: si_unit(known[name].dimension) if name in known else "1" for name in self.channels
        }
        channels = {name: ("time", x, {"units": units[name]}) for name, x in self.channels.items()}
        time = {"time": ("time", self.t, {"units": "s"})}
        return import_module("xarray").Dataset(channels, time, {"name": self.name})

    @property
    def open_circuit(self) -> bool:
        """Whether the DC link carries no load."""
        return self.load is not None and self.load == float("inf")
