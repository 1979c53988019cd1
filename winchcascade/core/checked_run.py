"""Checks of a run that was not read but made: what a reader of logs grants, and the rest of the
program relies on.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NoReturn, TypeAlias

import numpy as np

from winchcascade.core.errors import OptionError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Signal: TypeAlias = NDArray[np.float64]


NUMBERS = "biufO"
"""Kinds of arrays that may hold numbers; dates, texts and complex numbers are none, though numpy
converts them.
"""


OTHER_RATE = 2.0
"""Ratio of the rate of the stamps to the stated one from which they are not of the same samples:
clocks drift by far less, and stamps that count samples are off by the rate itself. [1]"""


class SealedChannels(dict[str, "Signal"]):
    """Channels that are checked: finite arrays of one length. Neither they nor their samples can be
    replaced.

    `clock` are stamps and rate that they were checked with; with others they are to be checked
    again.
    """

    clock: tuple[Signal, float] | None = None

    def fits(self, t: Signal, fs: float) -> bool:
        """Whether they were checked with these stamps [s] and this rate [Hz]."""
        return self.clock is not None and self.clock[0] is t and self.clock[1] == fs

    def __setitem__(self, name: str, signal: object) -> NoReturn:
        """Reject another array: OptionError."""
        raise OptionError(
            f"channel {name!r} of a run cannot be replaced; make another run by "
            f"msgspec.structs.replace."
        )

    def __reduce__(self) -> tuple[type, tuple[dict[str, Signal]]]:
        """Another process gets them whole."""
        return type(self), (dict(self),)


def sealed(signal: Signal) -> Signal:
    """A signal that cannot be written to; the array itself stays as it is."""
    view = signal.view()
    view.flags.writeable = False
    return view


def sealed_channels(channels: Mapping[str, Signal], t: Signal, fs: float) -> SealedChannels:
    """Channels of arrays that are known to be good with their stamps [s] and rate [Hz], as those
    of a reader.
    """
    found = SealedChannels({name: sealed(x) for name, x in channels.items()})
    found.clock = t, fs
    return found


def checked_arrays(
    name: str, t: Signal, channels: Mapping[str, Signal], labels: Signal | None, fs: float
) -> dict[str, object]:
    """Stamps and channels of a run of a name, as arrays that cannot be written to.

    Raises
    ------
    OptionError : stamps that do not rise, or at another rate; no channel, or an array of another
        length or with a value that is no finite number
    """
    call = f"Run({name!r:.60})"
    if not isinstance(channels, Mapping) or not channels:
        raise OptionError(
            f"{call}: channels is {channels!r:.100}; expected arrays by name, such as "
            f'{{"velocity": v}}.'
        )
    t = _array(t, f"{call}: t")
    if t.size == 0 or not (np.diff(t) > 0.0).all():
        raise OptionError(
            f"{call}: t is {t!r:.100}; expected the times of the samples in their order, which "
            f"rise."
        )
    step = float(np.median(np.diff(t))) if t.size > 1 else 1.0 / fs
    if not 1.0 / OTHER_RATE < step * fs < OTHER_RATE:
        raise OptionError(
            f"{call}: t has a sample each {step:.4g} s, and fs is {fs:g} Hz; expected t in "
            f"seconds and fs of the same samples."
        )
    arrays = {f"channel {name!r}": x for name, x in channels.items()} | (
        {} if labels is None else {"labels": labels}
    )
    signals = [_array(x, f"{call}: {name}", t.size) for name, x in arrays.items()]
    return {"t": t, "channels": sealed_channels(dict(zip(channels, signals, strict=False)), t, fs)}


def _array(given: object, place: str, size: int | None = None) -> Signal:
    """Array of finite numbers, of a size if one is given."""
    try:
        raw = np.asarray(given)
        found = raw.astype(np.float64, copy=False) if raw.dtype.kind in NUMBERS else None
    except (TypeError, ValueError):
        found = None
    if found is None:
        raise OptionError(
            f"{place} is {given!r:.100}; expected an array of numbers; dates and texts are none."
        )
    if found.ndim != 1 or size not in (None, found.size):
        raise OptionError(
            f"{place} has the shape {found.shape}; expected {'n' if size is None else size} "
            f"numbers."
        )
    if lost := np.count_nonzero(~np.isfinite(found)):
        raise OptionError(
            f"{place} has {lost} values that are no finite number; expected none. Leave these "
            f"rows out, or give read_run a "
            "DataFrame, which bridges them."
        )
    return sealed(found)
