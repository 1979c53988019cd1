"""Contents as they are stored: numbers rounded, long lists thinned, sentences left out; and how
two contents differ.
"""

import difflib
import json
import math
from collections.abc import Iterator, Mapping
from typing import Any

LONG = 12
"""A list of more numbers or texts than this is stored as a digest."""

MANY = 2
"""More records or rows than this are stored column by column."""

WORDS = 3
"""A text of more words than this is a sentence, which is stored as `SENTENCE`: wording is no
part of the contract.
"""

SENTENCE = "(text)"

WIDE = 200
"""A record that fits into a line of this length is not broken. [characters]"""

NUMBERS = "numbers: sum, size, some"
"""What a digest of numbers holds: their sum, that of their magnitudes, and the first, the middle
and the last one.
"""

DIGITS = 11
"""Significant digits of stored numbers."""

NOTHING = 1e-9
"""Two numbers that differ by less than this are the same: the rounding of a zero."""


def thin(value: Any) -> Any:
    """Give the content as it is stored: records as columns, and a digest of a long column.

    >>> thin({"x": 2.0 / 3.0, "says": "eta is too large here"})
    {'x': 0.66666666667, 'says': '(text)'}
    >>> thin([0.5, -1.5] * 10)
    ['20 numbers: sum, size, some', -10.0, 20.0, 0.5, -1.5, -1.5]
    >>> thin([None] * 5)
    ['5 times', None]
    """
    if isinstance(value, Mapping):
        parts = list(value.values())
        if len(parts) > MANY and all(
            isinstance(part, Mapping) and part.keys() == parts[0].keys() for part in parts
        ):
            return {"of": [str(key) for key in value], **_thin_list(parts)}
        return {str(key): thin(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return _thin_list(list(value))
    if isinstance(value, str):
        return SENTENCE if len(value.split()) > WORDS else value
    if isinstance(value, float) and math.isfinite(value):
        return float(f"{value:.{DIGITS}g}")
    return value if value is None or isinstance(value, bool | int | float) else str(value)


def _thin_list(values: list[Any]) -> Any:
    records = [part for part in values if isinstance(part, Mapping)]
    rows = [part for part in values if isinstance(part, list | tuple)]
    absent = values.count(None)
    if len(records) > MANY and len(records) + absent == len(values):
        names = list(dict.fromkeys(name for record in records for name in record))
        columns = {
            str(name): thin([record[name] for record in records if name in record])
            for name in names
        }
        return {"records": len(records), **columns}
    if len(rows) > MANY and len(rows) + absent == len(values):
        width = max(map(len, rows))
        return [
            f"{len(rows)} rows",
            *(thin([row[k] for row in rows if k < len(row)]) for k in range(width)),
        ]
    found = [thin(part) for part in values]
    if any(isinstance(part, dict | list) for part in found):
        return found
    kinds = list(dict.fromkeys(found))
    if len(found) > MANY and len(kinds) == 1:
        return [f"{len(found)} times", found[0]]
    if len(found) <= LONG:
        return found
    known = [part for part in found if isinstance(part, int | float) and math.isfinite(part)]
    if any(isinstance(part, str | bool) for part in found) or not known:
        return [f"{len(found)} texts of {len(kinds)} kinds, the first", *kinds[:LONG]]
    some = [known[k * (len(known) - 1) // 2] for k in range(3)]
    missing = f", {len(found) - len(known)} missing" if len(known) < len(found) else ""
    sums = (thin(math.fsum(known)), thin(math.fsum(map(abs, known))))
    return [f"{len(known)} {NUMBERS}{missing}", *sums, *some]


def layout(value: Any, indent: str = "") -> str:
    """Lay out JSON with as many parts in a line as fit."""
    line = json.dumps(value, ensure_ascii=False)
    if len(line) + len(indent) <= WIDE or not isinstance(value, dict | list) or not value:
        return line
    inner = f"{indent} "
    if isinstance(value, dict):
        parts = [
            f"{json.dumps(key, ensure_ascii=False)}: {layout(part, inner)}"
            for key, part in value.items()
        ]
    else:
        parts = [layout(part, inner) for part in value]
    lines: list[str] = []
    for part in parts:
        if (
            lines
            and "\n" not in lines[-1] + part
            and len(indent) + len(lines[-1]) + len(part) + 3 <= WIDE
        ):
            lines[-1] += f", {part}"
        else:
            lines.append(part)
    first, last = "{}" if isinstance(value, dict) else "[]"
    return f"{first}\n{inner}" + f",\n{inner}".join(lines) + f"\n{indent}{last}"


def data_differences(stored: Any, present: Any, accuracy: float, place: str = "") -> Iterator[str]:
    """Tell where data differ by more than a relative accuracy, a line each."""
    if isinstance(stored, dict) and isinstance(present, dict):
        for key in [*stored, *(key for key in present if key not in stored)]:
            where = f"{place}.{key}" if place else key
            if key not in present:
                yield f"{where}: is missing"
            elif key not in stored:
                yield f"{where}: is new, {json.dumps(present[key], ensure_ascii=False)[:WIDE]}"
            else:
                yield from data_differences(stored[key], present[key], accuracy, where)
    elif isinstance(stored, list) and isinstance(present, list) and len(stored) == len(present):
        digest = bool(stored) and isinstance(stored[0], str) and NUMBERS in stored[0]
        for k, (one, other) in enumerate(zip(stored, present, strict=True)):
            # A sum about zero is as certain as its terms are.
            if not (
                digest
                and k == 1
                and stored[0] == present[0]
                and abs(one - other) <= accuracy * stored[2]
            ):
                yield from data_differences(one, other, accuracy, f"{place}[{k}]")
    elif not _same(stored, present, accuracy):
        texts = [json.dumps(value, ensure_ascii=False)[:WIDE] for value in (stored, present)]
        yield f"{place}: {' -> '.join(texts)}"


def _same(one: Any, other: Any, accuracy: float) -> bool:
    """Whether two scalars are the same within a relative accuracy.

    >>> _same(1.0, 1.0 + 1e-10, 1e-9), _same(1.0, 1.0 + 1e-8, 1e-9), _same(True, 1, 1e-9)
    (True, False, False)
    """
    numbers = [
        value
        for value in (one, other)
        if isinstance(value, int | float) and not isinstance(value, bool)
    ]
    if len(numbers) < 2:
        return type(one) is type(other) and bool(one == other)
    return math.isclose(*numbers, rel_tol=accuracy, abs_tol=NOTHING) or all(
        map(math.isnan, numbers)
    )


def text_differences(stored: str, present: str) -> Iterator[str]:
    """Tell which lines of two texts differ."""
    lines = difflib.unified_diff(stored.splitlines(), present.splitlines(), n=0, lineterm="")
    return (line for line in lines if not line.startswith(("---", "+++")))
