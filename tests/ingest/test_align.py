"""Channels with clocks of their own meet at common stamps, or are rejected in a sentence."""

from pathlib import Path

import pytest

from winchcascade.core.errors import LogError
from winchcascade.ingest.formats.tdms import Waveform, common_stamps


def test_a_clock_that_ends_beyond_all_time_is_rejected() -> None:
    clock = Waveform(0.04, 0.0)
    t, _ = common_stamps(Path("log.tdms"), clock, [(clock, 100), (Waveform(1.0, 0.0), 100)])
    assert t.size == 100
    for step in (1e308, 1e307):  # the end, or the number of samples up to it, is no number
        with pytest.raises(LogError, match="times that a clock can have were expected"):
            common_stamps(Path("log.tdms"), clock, [(Waveform(step, 0.0), 10 if step < 1e308 else 100)])
