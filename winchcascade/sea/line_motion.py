"""How the line moves in waves where the rig does not change that: it follows the surface, or a
float of known response.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from winchcascade.core.errors import OptionError
from winchcascade.core.number_table import number_rows
from winchcascade.core.run import Signal
from winchcascade.core.scales import RAMP, MotionScale
from winchcascade.rig import physics
from winchcascade.rig.kernel import LineMotion
from winchcascade.rig.parts import Model
from winchcascade.rig.steps import COARSE, rate_of_the_rotor, resolving
from winchcascade.sea.wave_spectra import ComplexSignal, Waves

RESPONSE = ("frequency_hz", "amplitude", "phase_deg")
"""Columns of the response of a float: frequency [Hz], heave over wave amplitude [1], and by how
much heave leads [deg].
"""

UNKNOWN = 0.01
"""Share of the variance of the surface that may lie outside the frequencies of a response. [1]"""

TOP = 2.0
"""Top speed of a line in waves over the standard deviation of its velocity: 5 % of the time are
faster. [1]
"""

SINE_RAMP = (math.asin(RAMP[1]) - math.asin(RAMP[0])) / (2.0 * math.pi)
"""Ramp of a sine over its period. [1]"""

RESOLVED = 4.0
"""Product of a step and the fastest rate of the rotor in waves: half of the step changes mean
powers by less than 0.05 %, twice of it by 1 %. [1]"""

LEAD_IN = 5.0
"""Peak periods of waves before those that count, in which rig and float leave rest. [1]"""


class FloatResponse(NamedTuple):
    """Heave of a float over the amplitude of the waves, which the rig does not change: frequencies,
    (k,) [Hz], and complex response, (k,) [1]. Without frequencies the line follows the surface.
    """

    frequency: Signal = np.zeros(0)
    response: ComplexSignal = np.zeros(0, dtype=np.complex128)

    def at(self, waves: Waves) -> ComplexSignal:
        """Complex amplitudes of the heave in some waves, (k,) [m].

        Raises
        ------
        OptionError : more than `UNKNOWN` of the waves lies outside the frequencies
        """
        if not self.frequency.size:
            return waves.amplitude
        known = (waves.frequency >= self.frequency[0]) & (waves.frequency <= self.frequency[-1])
        power = np.abs(waves.amplitude) ** 2
        missing = float(np.sum(power[~known]) / np.sum(power))
        if missing > UNKNOWN:
            raise OptionError(
                f"--float: {100.0 * missing:.2g} % of the variance of a sea lies outside the "
                f"{self.frequency[0]:.3g} to "
                f"{self.frequency[-1]:.3g} Hz of the response; expected {100.0 * UNKNOWN:g} % at "
                f"most."
            )
        amplitude = np.interp(waves.frequency, self.frequency, np.abs(self.response))
        phase = np.interp(waves.frequency, self.frequency, np.unwrap(np.angle(self.response)))
        return np.asarray(np.where(known, amplitude * np.exp(1j * phase), 0.0) * waves.amplitude)


FOLLOWER = FloatResponse()
"""The line follows the surface, as that of the passive follower of the paper."""


def read_response(path: Path) -> FloatResponse:
    """Read the response of a float from a CSV with the columns of `RESPONSE`.

    Raises
    ------
    OptionError : it has no such columns, or frequencies that do not rise from above 0
    """
    expected = "three finite numbers, with frequencies that rise from above 0"
    rows = number_rows(path, RESPONSE, _is_finite, expected, "--float")
    frequency, amplitude, phase = np.array(rows).T
    if len(rows) < 2 or frequency[0] <= 0.0 or not np.all(np.diff(frequency) > 0.0):
        raise OptionError(
            f"--float {path}: expected two rows or more, with frequencies that rise from above 0."
        )
    return FloatResponse(frequency, amplitude * np.exp(1j * np.radians(phase)))


def _is_finite(*row: float) -> bool:
    return all(map(math.isfinite, row))


class SeaPath(NamedTuple):
    """A motion of the line in a sea, the direction of friction, (n,) [1], and the number of the
    first step that counts.
    """

    motion: LineMotion
    direction: Signal
    first: int

    def until(self, seconds: float) -> SeaPath:
        """The part up to some time after the first step that counts, or all where it is shorter.
        [s]
        """
        whole, end = (
            self.motion,
            self.first + int(min(seconds / self.motion.step, self.direction.size - self.first)),
        )
        motion = LineMotion(
            whole.t[:end], whole.x[:end], whole.v[:end], whole.a[:end], whole.step, whole.rest
        )
        return SeaPath(motion, self.direction[:end], self.first)


def scale_of_motion(waves: Waves, heave: ComplexSignal) -> MotionScale:
    """Scales of the motion of a line whose heave has some complex amplitudes, (k,) [m]."""
    omega = 2.0 * math.pi * waves.frequency
    sd, sd_speed = (float(np.linalg.norm(x)) / math.sqrt(2.0) for x in (heave, omega * heave))
    period = 2.0 * math.pi * sd / sd_speed
    return MotionScale(TOP * sd_speed, SINE_RAMP * period, 4.0 * sd)


def steps_of(model: Model, waves: Waves, scale: MotionScale) -> int:
    """Number of even steps of the duration of some waves that resolve a motion and a model."""
    from scipy.fft import next_fast_len

    resolving(model, scale)  # a rotor that is too light is rejected
    step = min(COARSE * scale.ramp, RESOLVED / rate_of_the_rotor(model, scale.speed))
    least = max(waves.duration / step, 2.0 * waves.frequency.size + 1.0)
    return int(next_fast_len(math.ceil(least), real=True))


def path_in_waves(
    model: Model, waves: Waves, body: FloatResponse, tp: float, payout: float, count: int = 0
) -> SeaPath:
    """The motion of a line that follows the surface or a float of known response, from rest at
    steps that resolve a model.

    Parameters
    ----------
    tp : peak period of the waves [s]
    payout : of the line in still water [m]
    count : number of steps of the duration; 0 for one that resolves model and motion
    """
    heave, omega = body.at(waves), 2.0 * math.pi * waves.frequency
    scale = scale_of_motion(waves, heave)
    count = count or steps_of(model, waves, scale)
    lead = min(count, math.ceil(LEAD_IN * tp / waves.duration * count))
    x, v, a = (
        np.concatenate([whole[count - lead :], whole])
        for whole in (waves.sampled((1j * omega) ** k * heave, count) for k in range(3))
    )
    step, rest = waves.duration / count, physics.REST * scale.speed
    motion = LineMotion(step * np.arange(-float(lead), count), payout + x, v, a, step, rest)
    return SeaPath(motion, physics.direction(v, rest), lead)
