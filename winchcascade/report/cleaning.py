"""Texts of a report without what a page or a PDF must not hold, whatever a log, a file name or a rig file brought in."""

from __future__ import annotations

import re
from typing import Any

import msgspec

from winchcascade.report.report_model import Report

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
