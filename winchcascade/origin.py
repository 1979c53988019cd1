"""Where the data of a log come from: measured or not, as the campaign states it, and one sentence on their origin."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

KINDS = {True: "measured", False: "not measured", None: "not stated"}
"""What is said of whether data are measured."""

BANNER = 160
"""Longest origin in a banner: two lines at the top of a page. The summary of the report has the whole. [characters]"""


class Origin(msgspec.Struct, frozen=True):
    """Whether data are measured, None where nobody states it, and one sentence on where they come from."""

    measured: bool | None = None
    sentence: str = ""

    @property
    def word(self) -> str:
        """What the data are called beside a simulation: `measured` where that is stated, else `log`."""
        return "measured" if self.measured else "log"


SIMULATED = Origin(False, "Made by winchcascade simulate")
"""Of a log that carries the mark of `simulate`, whatever its campaign states."""


def origin_record(origin: Origin) -> dict[str, Any]:
    """The origin of data as written files hold it."""
    return {"measured": origin.measured, "origin": origin.sentence or None}


def origin_from(record: Mapping[str, Any]) -> Origin:
    """Read the origin of data from a written result; one of an earlier version states nothing."""
    data = record.get("data")
    if not isinstance(data, dict):
        return Origin()
    measured, sentence = data.get("measured"), data.get("origin")
    return Origin(measured if isinstance(measured, bool) else None, sentence if isinstance(sentence, str) else "")


def joint_origin(origins: Sequence[Origin]) -> Origin:
    """The origin of several logs together: what all of them state alike, and every sentence once.

    >>> joint_origin([Origin(True, "Tank test"), Origin(True, "Tank test")])
    Origin(measured=True, sentence='Tank test')
    """
    measured = {origin.measured for origin in origins}
    sentences = dict.fromkeys(origin.sentence.rstrip(". ") for origin in origins if origin.sentence)
    return Origin(measured.pop() if len(measured) == 1 else None, "; ".join(sentences))


def origin_words(origins: Sequence[Origin]) -> str:
    """State of one or several logs whether they are measured, and where they come from.

    >>> origin_words([Origin(False, "Rebuilt from Table 2"), Origin()])
    '1 not measured, 1 not stated. Rebuilt from Table 2.'
    """
    counts = Counter(origin.measured for origin in origins)
    kinds = [KINDS[kind] if len(counts) == 1 else f"{counts[kind]} {KINDS[kind]}" for kind in KINDS if kind in counts]
    sentence = joint_origin(origins).sentence
    text = ", ".join(kinds) if kinds else KINDS[None]
    return f"{text}. {sentence}." if sentence else text


def banner(origins: Sequence[Origin]) -> str:
    """Warning for every page of a report on logs that are not measured; empty if there is none.

    >>> banner([Origin(False, "Rebuilt from Table 2")])
    'Not measured: Rebuilt from Table 2.'
    """
    made = [origin for origin in origins if origin.measured is False]
    if not made:
        return ""
    sentence = joint_origin(made).sentence
    who = "Not measured" if len(made) == len(origins) else f"{len(made)} of {len(origins)} logs are not measured"
    if len(sentence) > BANNER:
        return f"{who}: {textwrap.shorten(sentence, BANNER, placeholder=' …')}"
    return f"{who}: {sentence}." if sentence else f"{who}."
