"""When a report is made: now, or the moment that a repeatable build asks for."""

from __future__ import annotations

import os
from datetime import UTC, datetime


def made_at() -> datetime:
    """Give the time of making, or SOURCE_DATE_EPOCH where a build must be repeatable; UTC, whole seconds."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    given = epoch.isdigit() and len(epoch) <= 11
    now = datetime.fromtimestamp(int(epoch), UTC) if given else datetime.now(UTC)
    return now.replace(microsecond=0)
