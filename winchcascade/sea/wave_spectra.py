"""Irregular waves: spectra, realisations of them whose phases follow from a seed, and waves of a
log.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from winchcascade.core.errors import OptionError
from winchcascade.core.run import Signal

ComplexSignal = NDArray[np.complex128]

JONSWAP, PIERSON_MOSKOWITZ = 3.3, 1.0
"""Peak enhancement of the mean JONSWAP spectrum, and that of a fully developed sea (Hasselmann
et al. 1973). [1]
"""

WIDTHS = (0.07, 0.09)
"""Widths of the peak of JONSWAP below and above its frequency, as shares of it. [1]"""

HIGHEST = 5.0
"""Highest frequency of a realisation over that of the peak: it leaves out 0.2 % of the variance
of the surface. [1]
"""


SHARPEST = 4.0
"""Highest frequency of a log times the ramp of its motion: what is faster was noise, which its
smoothing has removed. [1]
"""

PEAKEDNESS = 4.0
"""Power of a spectrum by which frequencies are weighted for that of its peak (Young 1995). [1]"""


class SeaState(msgspec.Struct, frozen=True):
    """A sea: significant wave height [m], peak period [s], peak enhancement of the spectrum [1];
    1 is Pierson-Moskowitz.
    """

    hs: float
    tp: float
    gamma: float = JONSWAP


class Waves(NamedTuple):
    """A realisation of a sea that repeats after its `duration` [s]: frequencies, (k,) [Hz], and the
    complex amplitudes of the surface elevation, (k,) [m], the real part of whose sum over exp(2 pi
    i f t) it is.
    """

    frequency: Signal
    amplitude: ComplexSignal
    duration: float

    def sampled(self, response: ComplexSignal, count: int) -> Signal:
        """A response at even instants of the duration, (count,).

        Parameters
        ----------
        response : complex amplitudes at the frequencies, (k,)
        """
        whole = np.zeros(count // 2 + 1, dtype=np.complex128)
        whole[np.rint(self.frequency * self.duration).astype(np.intp)] = 0.5 * count * response
        return np.asarray(np.fft.irfft(whole, count))


def spectrum(sea: SeaState, frequency: Signal) -> Signal:
    """JONSWAP spectrum of the surface at even frequencies, (k,) [m2/Hz] (Hasselmann et al. 1973).

    It is scaled so that its sum over the frequencies times their distance is Hs^2 / 16.

    Parameters
    ----------
    frequency : (k,) above 0 at even distances [Hz]

    Examples
    --------
    >>> f = np.arange(0.001, 2.0, 0.001)
    >>> round(4.0 * math.sqrt(float(np.sum(spectrum(SeaState(2.0, 8.0), f))) * 0.001), 6)
    2.0
    """
    over_peak = frequency * sea.tp
    width = np.where(over_peak <= 1.0, *WIDTHS)
    peak = np.exp(-((over_peak - 1.0) ** 2) / (2.0 * width**2))
    shape = over_peak**-5.0 * np.exp(-1.25 * over_peak**-4.0) * sea.gamma**peak
    step = float(frequency[0]) if frequency.size == 1 else float(frequency[1] - frequency[0])
    return np.asarray(shape * sea.hs**2 / 16.0 / (np.sum(shape) * step))


def realised(sea: SeaState, duration: float, seed: int) -> Waves:
    """Realise a sea: at each multiple of the inverse duration the amplitude of its spectrum, and a
    random phase.

    Parameters
    ----------
    duration : after which the waves repeat [s]
    seed : from which the phases follow
    """
    count = max(1, math.floor(HIGHEST / sea.tp * duration))
    frequency = np.arange(1.0, count + 1.0) / duration
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * math.pi, count)
    heights = np.sqrt(2.0 * spectrum(sea, frequency) / duration)
    return Waves(frequency, heights * np.exp(1j * phases), duration)


def logged(t: Signal, v: Signal, ramp: float) -> tuple[SeaState, Waves]:
    """The sea of a log, without a peak enhancement, and its waves: the log is repeated, so at both
    ends it comes to rest.

    Parameters
    ----------
    t, v : (n,) stamps that rise [s] and smoothed rates of the surface or the line [m/s]
    ramp : time in which the motion speeds up, and in which it comes to rest [s]

    Raises
    ------
    OptionError : the log is too short, or does not return to where it begins
    """
    duration = float(t[-1] - t[0])
    count = math.floor(SHARPEST / ramp * duration)
    if count < 2:
        raise OptionError(
            f"a log of {duration:.3g} s with ramps of {ramp:.3g} s; expected several waves."
        )
    even = duration / (4 * count) * np.arange(4.0 * count)
    near = np.minimum(even, duration - even) / ramp
    speed = np.interp(even, t - t[0], v) * (0.5 - 0.5 * np.cos(np.pi * np.minimum(near, 1.0)))
    frequency = np.arange(1.0, count + 1.0) / duration
    amplitude = np.fft.rfft(speed)[1 : count + 1] / (2.0 * count) / (2j * math.pi * frequency)
    drift, height = (
        float(np.mean(speed)) * duration,
        4.0 * float(np.linalg.norm(amplitude)) / math.sqrt(2.0),
    )
    if not abs(drift) < height:
        raise OptionError(
            f"a log that ends {drift:.3g} m from where it begins; expected waves, or cycles of a "
            f"line."
        )
    weight = np.abs(amplitude) ** (2.0 * PEAKEDNESS)
    tp = float(np.sum(weight) / np.sum(weight * frequency))
    return SeaState(height, tp, math.nan), Waves(frequency, amplitude, duration)
