"""Caps on what one file may claim before it is read: numbers in its table, and size when
unpacked.
"""

from __future__ import annotations

import math
import os
from pathlib import Path

from winchcascade.core.errors import LogError, OptionError

MEMORY_SETTING = "WINCHCASCADE_READ_MEMORY_MB"
SECONDS_SETTING = "WINCHCASCADE_READ_SECONDS"
"""Environment variables that replace the limits of memory and time."""

MB = 10**6

MEMORY_MIN, MEMORY_PER_BYTE = 2000, 20
"""Limit of memory: the larger of a number of MB and a number of bytes for each byte of the file.

An .xlsx of a million rows takes 13 times its size; no other format that was measured takes more.
"""

SECONDS_MIN, SECONDS_PER_MB = 60.0, 4.0
"""Limit of time: the larger of the two. An .xlsx takes 0.33 s for each megabyte, on a busy
machine ten times as long. [s]
"""

NUMBERS_SHARE, NUMBERS_PER_BYTE = 16, 10
"""Limit of the numbers of a table: a share of the memory, or a number of bytes for each byte of the
file.

The reduction holds some ten copies of the columns. No measured signal that is worth a file is
compressed further.
"""

UNPACKED_SHARE, UNPACKED_PER_BYTE = 20, 100
"""Limit of what is unpacked: a share of the memory, or a number of bytes for each byte of the file,
whichever is larger.

The text of a measured log is compressed to a tenth to a third; deflate reaches a thousandth on
zeros.
"""


def limits_of(path: Path) -> tuple[int, float]:
    """Memory [bytes] and time [s] that the reading of a file may take; OptionError for a setting
    that is no number above 0.
    """
    size = path.stat().st_size / MB
    memory = _setting(MEMORY_SETTING, max(MEMORY_MIN, MEMORY_PER_BYTE * size))
    return int(memory * MB), _setting(SECONDS_SETTING, max(SECONDS_MIN, SECONDS_PER_MB * size))


def _setting(name: str, usual: float) -> float:
    text = os.environ.get(name, "").strip()
    try:
        value = float(text) if text else usual
    except ValueError:
        value = math.nan
    if not 0.0 < value < 1e9:
        raise OptionError(
            f"{name}={text}: expected a number above 0, such as 4000; correct or unset the "
            f"variable."
        )
    return value


def require_numbers(path: Path, rows: int, columns: int = 1) -> None:
    """Reject a table that claims more numbers than its file can hold, before anything of that
    size is made: LogError.
    """
    limit = max(limits_of(path)[0] // NUMBERS_SHARE, NUMBERS_PER_BYTE * path.stat().st_size)
    if 8 * rows * columns > limit:
        raise LogError(
            f"{path.name}: claims {rows} rows in {columns} columns, which take "
            f"{8 * rows * columns / MB:.0f} MB as numbers; at "
            f"most {limit / MB:.0f} MB were expected of a file of this size; cut the log into "
            f"shorter files or allow more with "
            f"the environment variable {MEMORY_SETTING}."
        )


def require_unpacked(path: Path, size: int) -> None:
    """Reject a file that unpacks to more than its size lets expect: LogError."""
    limit = max(limits_of(path)[0] // UNPACKED_SHARE, UNPACKED_PER_BYTE * path.stat().st_size)
    if size > limit:
        raise LogError(
            f"{path.name}: unpacks to more than {limit / MB:.0f} MB; less was expected of a file "
            f"of "
            f"{path.stat().st_size} bytes; unpack it, or allow more with the environment variable "
            f"{MEMORY_SETTING}."
        )
