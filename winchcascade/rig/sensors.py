"""What the sensors make of the rig: gains, zeros and a lag."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import msgspec
import numpy as np

if TYPE_CHECKING:
    from winchcascade.run import Signal


class Sensors(msgspec.Struct, frozen=True):
    """Errors of the sensors by channel, absent by default: relative `gain`, `zero` in SI units, and the time by which Vdc
    and Idc are recorded late, `electrical_lag` [s].
    """

    gain: Mapping[str, float] = msgspec.field(default_factory=dict)
    zero: Mapping[str, float] = msgspec.field(default_factory=dict)
    electrical_lag: float = 0.0

    def read(self, name: str, x: Signal) -> Signal:
        """What a sensor reads of a channel, (n,) in its unit."""
        reading: Signal = x * (1.0 + self.gain.get(name, 0.0)) + self.zero.get(name, 0.0)
        return reading

    def late(self, t: Signal) -> Signal:
        """Times at which Vdc and Idc were what is recorded at some stamps, (n,) [s]."""
        stamps: Signal = np.maximum(t - self.electrical_lag, t[0])
        return stamps

    def with_gain(self, name: str, error: float) -> Sensors:
        """Sensors of which one reads a further share too much [1]; gains multiply, so that their order does not matter."""
        if not error:
            return self
        gain = (1.0 + self.gain.get(name, 0.0)) * (1.0 + error) - 1.0
        return msgspec.structs.replace(self, gain={**self.gain, name: gain})
