"""Parts that a page and a PDF share: texts that can be shown, the templates, and the time of making."""

from __future__ import annotations

import os
import re
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec

from winchcascade.report.report_model import Report

_PACKAGE = Path(__file__).parent.parent


def template_folder() -> Path:
    """Folder of the report's templates."""
    inside = _PACKAGE / "templates"
    return inside if inside.is_dir() else _PACKAGE.parent / "templates"


def made_at() -> datetime:
    """Give the time of making, or SOURCE_DATE_EPOCH where a build must be repeatable; UTC, whole seconds."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    given = epoch.isdigit() and len(epoch) <= 11
    now = datetime.fromtimestamp(int(epoch), UTC) if given else datetime.now(UTC)
    return now.replace(microsecond=0)


MOST_CHARACTERS = 1000
"""A text longer than this is cut: no cell may be taller than a page."""

_UNSHOWN = re.compile("[\x00-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]")
"""Control characters, marks of writing direction, and bytes of a name that are no text."""

_KEPT = {"svg", "traces"}
"""Fields that are no texts."""


def shown(text: str) -> str:
    """A text with the code of each character that cannot be shown, and of reasonable length.

    >>> shown("a\x07b")
    'a⟨U+0007⟩b'
    """
    text = _UNSHOWN.sub(lambda found: " " if found[0] in "\n\r\t" else f"⟨U+{ord(found[0]):04X}⟩", text)
    if len(text) > MOST_CHARACTERS:
        text = f"{text[:MOST_CHARACTERS]} … ({len(text) - MOST_CHARACTERS} characters more)"
    return text


def cleaned(report: Report) -> Report:
    """A report all of whose texts can be shown."""
    return msgspec.convert(_clean(msgspec.to_builtins(report)), Report)


def _clean(value: Any) -> Any:
    if isinstance(value, str):
        return shown(value)
    if isinstance(value, dict):
        return {key: inner if key in _KEPT else _clean(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_clean(inner) for inner in value]
    return value
