"""The version of the package, and the time at which it makes a file."""

from __future__ import annotations

import os
from datetime import UTC, datetime

__version__ = "0.1.0"

GENERATOR = f"winchcascade/{__version__}"
"""What a written file names as the program that made it."""


def made_at() -> datetime:
    """Give the time of making, or SOURCE_DATE_EPOCH where a build must be repeatable; UTC, whole
    seconds.
    """
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    given = epoch.isdigit() and len(epoch) <= 11
    now = datetime.fromtimestamp(int(epoch), UTC) if given else datetime.now(UTC)
    return now.replace(microsecond=0)
