"""Values as text that is equal on every processor: rounded numbers, short tables, digests of long arrays."""

import difflib
import re
from collections.abc import Mapping, Sequence

import numpy as np

LONG = 40
"""A list of more numbers than this is stored as a digest."""

WIDE = 150
"""A record that fits into a line of this length is not broken. [characters]"""

NOTHING = 1e-9
"""A number below this is the rounding of a zero."""

STAMPS = (1e9, 1e10)
"""Where seconds of an epoch lie, which are stored in hundredths. [s]"""

EXACT = 9
"""From so many digits on a number may be a stamp: fits and drawings have fewer."""

_NUMBER = re.compile(r"(?<![\w.])-?\d+\.?\d*(?:e[-+]?\d+)?")

_CERTAIN = 5
"""Two numbers with fewer digits than this are equal only if their texts are."""


def number(value: object, digits: int) -> str:
    """Round a floating-point number; any other scalar is shown as JSON shows it.

    >>> number(2.0 / 3.0, 4), number(3, 4), number(None, 4), number(1e-17, 4), number("a b", 4)
    ('0.6667', '3', 'null', '0.0', 'a b')
    """
    if value is None or isinstance(value, bool | np.bool_):
        return {None: "null", True: "true", False: "false"}[None if value is None else bool(value)]
    if not isinstance(value, float | np.floating):
        return str(value)
    known = float(value)
    if digits >= EXACT and STAMPS[0] <= known < STAMPS[1]:
        return f"{known:.2f}"
    text = f"{0.0 if abs(known) < NOTHING else known:.{digits}g}"
    return text if re.search(r"[.en]", text) else f"{text}.0"


def digest(values: Sequence[object], digits: int) -> str:
    """Describe a column: its values where they are few, else their count, sum, range, and five of them."""
    if len(values) <= LONG:
        return " ".join(number(value, digits) for value in values)
    if not all(isinstance(value, int | float | np.number) and not isinstance(value, bool) for value in values):
        kinds = list(dict.fromkeys(number(value, digits) for value in values))
        return f"{len(values)} values, {len(kinds)} different: {' '.join(kinds[:LONG])}"
    x = np.array(values, dtype=float)
    known = x[np.isfinite(x)]
    if not known.size:
        return f"{x.size} values, none finite"
    some = [x[k * (x.size - 1) // 4] for k in range(5)]
    # A sum about zero is as large as the rounding of its terms, so it is rounded to the digits of the sum of magnitudes.
    total, scale = float(known.sum()), float(np.abs(known).sum())
    places = digits - 1 - int(np.floor(np.log10(scale))) if scale > NOTHING else 0
    shown = [("sum", round(total, places)), ("min", float(known.min())), ("max", float(known.max()))]
    gaps = f", {x.size - known.size} not finite" if known.size < x.size else ""
    parts = "; ".join(f"{name} {number(value, digits)}" for name, value in shown)
    return f"{x.size} values{gaps}; {parts}; some {' '.join(number(value, digits) for value in some)}"


def layout(value: object, digits: int, indent: str = "") -> str:
    """Lay out nested records: what is short in one line, equal records as a table, long lists as digests."""
    if isinstance(value, Mapping):
        short = _short(value, digits)
        if len(short) <= WIDE:
            return short
        inner = indent + " "
        return "".join(f"\n{inner}{key}: {layout(part, digits, inner)}" for key, part in value.items())
    if isinstance(value, list | tuple):
        return _list(value, digits, indent)
    return number(value, digits)


def _list(value: Sequence[object], digits: int, indent: str) -> str:
    if len(value) > LONG and not any(isinstance(part, Mapping | list | tuple) for part in value):
        return f"<{digest(value, digits)}>"
    short = _short(value, digits)
    if len(short) <= WIDE:
        return short
    inner = indent + " "
    if len(value) > LONG and all(isinstance(part, list | tuple) for part in value):
        columns = zip(*(part for part in value if isinstance(part, list | tuple)), strict=False)
        return "".join(f"\n{inner}- <{digest(column, digits)}>" for column in columns)
    records = [part for part in value if isinstance(part, Mapping)]
    heads = {tuple(part) for part in records}
    if len(records) == len(value) > 1 and len(heads) == 1:
        rows = [[_short(part, digits) for part in record.values()] for record in records]
        if max(len("  ".join(row)) for row in rows) <= 2 * WIDE:
            return "".join(f"\n{inner}{'  '.join(row)}" for row in [list(heads.pop()), *rows])
    return "".join(f"\n{inner}- {layout(part, digits, inner)}" for part in value)


def _short(value: object, digits: int) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_short(part, digits)}" for key, part in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_short(part, digits) for part in value) + "]"
    return number(value, digits)


def rounded(text: str, digits: int) -> str:
    """Round the numbers of a text that have more digits than given."""

    def fewer(found: re.Match[str]) -> str:
        return number(float(found[0]), digits) if _digits(found[0]) > digits and "." in found[0] else found[0]

    return _NUMBER.sub(fewer, text)


def _digits(text: str) -> int:
    """Count the significant digits of a number."""
    return len(re.sub(r"e.*|\D", "", text).lstrip("0"))


def same(one: str, other: str) -> bool:
    """Whether two lines differ in nothing but the last digit of numbers with many.

    >>> same("E 7028.25 J", "E 7028.26 J"), same("E 7028.25 J", "E 7028.27 J"), same("eta 0.90", "eta 0.91")
    (True, False, False)
    """
    if one == other:
        return True
    if _NUMBER.sub("#", one) != _NUMBER.sub("#", other):
        return False
    pairs = zip(_NUMBER.findall(one), _NUMBER.findall(other), strict=True)
    return all(a == b or _last_digit(a, b) for a, b in pairs)


def _last_digit(one: str, other: str) -> bool:
    digits = max(_digits(one), _digits(other))
    if digits < _CERTAIN or "." not in one + other:
        return False
    largest = max(abs(float(one)), abs(float(other)))
    unit = 10.0 ** (np.floor(np.log10(largest)) - digits + 1)
    return bool(abs(float(one) - float(other)) <= 1.01 * unit)


def settled(stored: str, present: str) -> str:
    """Give the present text with the stored lines wherever they are the same."""
    old, new = stored.splitlines(), present.splitlines()
    found: list[str] = []
    for _, a0, a1, b0, b1 in difflib.SequenceMatcher(None, old, new, autojunk=False).get_opcodes():
        if a1 - a0 == b1 - b0:
            found += [a if same(a, b) else b for a, b in zip(old[a0:a1], new[b0:b1], strict=True)]
        else:
            found += new[b0:b1]
    return "\n".join(found) + "\n"


def difference(stored: str, present: str, name: str) -> str:
    """Show what differs between a stored text and the present one; nothing if they are the same."""
    old, new = stored.splitlines(), settled(stored, present).splitlines()
    if old == new:
        return ""
    lines = [f"=== {name}"]
    for group in difflib.SequenceMatcher(None, old, new, autojunk=False).get_grouped_opcodes(1):
        lines.append(f"@@ line {group[0][1] + 1}")
        for kind, a0, a1, b0, b1 in group:
            lines += [f"{' ' if kind == 'equal' else '-'}{line}" for line in old[a0:a1]]
            lines += [f"+{line}" for line in new[b0:b1] if kind != "equal"]
    return "\n".join(lines)
