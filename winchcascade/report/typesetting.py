"""Sentences of the terminal as pages set them: symbols, signs and units in place of plain letters."""

from __future__ import annotations

import re

from winchcascade.report.digits import RAISED
from winchcascade.report.wording import SYMBOL

_SET: tuple[tuple[str, str], ...] = (
    (r"(?<=\d) ohm\b", "\u00a0Ω"),
    (r"\b(N|m)\.(?=m\b|s/rad)", r"\1·"),
    (r"\bR2\b", "R²"),
    (r" \+- ", " ± "),
    (r"(?<=\d)\.\.(?=-?\d)", " to "),
    (r"(?<![\w.)\]-])-(?=\d)", "\u2212"),
    (r"`([^`]*)`", r"\1"),
)
"""What the terminal writes with plain letters, and how a page sets it."""


def page_text(text: str, kept: str = "") -> str:
    """A sentence of the terminal as a page sets it: symbols for names of metrics, signs and units, no marks of commands.

    Parameters
    ----------
    kept : name of a file in it, which stays as it is

    Examples
    --------
    >>> page_text("36 ohm: eta_pto drops by -0.01 N.m.s/rad, `diagnose` finds 1..2e-05")
    '36\\xa0Ω: η_pto drops by −0.01 N·m·s/rad, diagnose finds 1 to 2×10⁻⁵'
    >>> page_text("-5.csv gives -5", "-5.csv")
    '-5.csv gives −5'
    """
    if kept:
        return kept.join(page_text(part) for part in text.split(kept))
    for plain, shown in _SET:
        text = re.sub(plain, shown, text)
    text = _POWER_OF_TEN.sub(lambda found: f"×10{str(int(found[1])).translate(RAISED)}", text)
    return _METRICS.sub(lambda found: SYMBOL[found[0]], text)


_POWER_OF_TEN = re.compile(r"(?<=\d)e([-+]\d+)")
_METRICS = re.compile(rf"\b(?:{'|'.join(sorted(SYMBOL, key=len, reverse=True))})\b")
