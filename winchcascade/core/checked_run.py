"""Checks of a run that was not read but made: what a reader of logs grants, and the rest of the program relies on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NoReturn, TypeAlias

import numpy as np

from winchcascade.core.arguments import COUNT, CYCLES, FLAG, NAME, RATE, TEXT, Expected, check_arguments, is_number
from winchcascade.core.campaign_file import Origin
from winchcascade.core.errors import OptionError
from winchcascade.core.rig_file import Rig

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Signal: TypeAlias = NDArray[np.float64]

ANOTHER_RATE = 2.0
"""Factor between the stated rate and the stamps from which on the rate is wrong: clocks with lost rows stay below it."""

_FIRST = 1000
"""Number of steps of the clock that show its rate."""


class SealedChannels(dict[str, "Signal"]):
    """Channels that are checked: finite arrays of one length. Neither they nor their samples can be replaced."""

    def __setitem__(self, name: str, signal: object) -> NoReturn:
        """Reject another array: OptionError."""
        raise OptionError(f"channel {name!r} of a run cannot be replaced; make another run by msgspec.structs.replace.")

    def __reduce__(self) -> tuple[type, tuple[dict[str, Signal]]]:
        """Another process gets them whole."""
        return type(self), (dict(self),)


def sealed(signal: Signal) -> Signal:
    """A signal that cannot be written to; the array itself stays as it is."""
    if not signal.flags.writeable:
        return signal
    view = signal.view()
    view.flags.writeable = False
    return view


def sealed_channels(channels: Mapping[str, Signal]) -> SealedChannels:
    """Channels of arrays that are known to be good, as those of a reader."""
    return SealedChannels({name: sealed(x) for name, x in channels.items()})


_FIELDS = {
    "name": TEXT,
    "channels": Expected(
        'arrays by the names of channels, such as {"velocity": v}', lambda value: isinstance(value, Mapping) and value
    ),
    "fs": RATE,
    "samples": COUNT,
    "gaps": Expected("stamps around what was bridged, by channel", lambda value: isinstance(value, Mapping)),
    **dict.fromkeys(("load_source", "path", "sha256", "about", "first_stamp"), TEXT),
    "findings": Expected(
        "a tuple of findings", lambda value: isinstance(value, tuple) and all(hasattr(one, "kind") for one in value)
    ),
    "simulated": FLAG,
    "origin": Expected("an Origin", lambda value: isinstance(value, Origin)),
    "table": NAME,
    **dict.fromkeys(("started", "temperature"), Expected("a number", lambda value: value is None or is_number(value))),
    "rig": Expected("a Rig, as load_rig(name) gives it", lambda value: isinstance(value, Rig | None)),
    "cycles": CYCLES,
}
"""Kinds of the fields of a run besides its arrays; its load is checked always, its window by `reduce`."""


def checked_fields(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Stamps, channels and gaps of a run with these fields, as arrays that cannot be written to.

    Raises
    ------
    OptionError : stamps that do not rise, no channel, one of another length or with a value that is no number, another rate
        than that of the stamps, or a field of another type
    """
    call = f"Run({fields['name']!r:.60})"
    check_arguments(call, *((name, fields[name], kind) for name, kind in _FIELDS.items()))
    t = _array(fields["t"], call, "t", (None,))
    if t.size == 0 or not (np.diff(t) > 0.0).all():
        _reject(call, "t", t, "the times of the samples in their order, which rise")
    _check_rate(call, t, fields["fs"])
    if fields["labels"] is not None:
        _array(fields["labels"], call, "labels", t.shape)
    channels = {name: _array(x, call, f"channel {name!r}", t.shape) for name, x in fields["channels"].items()}
    gaps = {name: _array(gap, call, f"gaps of {name!r}", (None, 2)) for name, gap in fields["gaps"].items()}
    return {"t": t, "channels": SealedChannels(channels), "gaps": gaps}


def _check_rate(call: str, t: Signal, fs: float) -> None:
    """Reject a sampling rate [Hz] with which the stamps do not agree."""
    step = np.sort(np.diff(t[: _FIRST + 1]))
    usual = 1.0 / float(step[step.size // 2]) if step.size else fs
    if not usual / ANOTHER_RATE < fs < usual * ANOTHER_RATE:
        raise OptionError(f"{call}: fs is {fs:g} Hz, but the stamps t have {usual:.4g} Hz; expected the rate of t.")


def _array(given: object, call: str, what: str, shape: tuple[int | None, ...]) -> Signal:
    """Array of finite numbers of a shape, in which None is any length."""
    try:
        found = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        _reject(call, what, given, "an array of numbers")
    if found.ndim != len(shape) or any(m not in (None, n) for n, m in zip(found.shape, shape, strict=True)):
        words = " x ".join("n" if length is None else str(length) for length in shape)
        raise OptionError(f"{call}: {what} has the shape {found.shape}; expected {words} numbers.")
    lost = 0 if np.isfinite(found.sum()) else found.size - np.count_nonzero(np.isfinite(found))
    if lost:
        raise OptionError(
            f"{call}: {what} has {lost} values that are no finite number; expected none. Leave these rows out, or give "
            "read_run a DataFrame, which bridges them."
        )
    return sealed(found)


def _reject(call: str, what: str, given: object, expected: str) -> NoReturn:
    raise OptionError(f"{call}: {what} is {given!r:.100}; expected {expected}.")
