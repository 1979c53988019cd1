"""Contents as they are stored: numbers rounded, long lists thinned, sentences left out; and how two contents differ."""

import difflib
import json
import math
from collections.abc import Iterator, Mapping
from typing import Any

LONG = 24
"""A list of more numbers or texts than this is stored as a digest."""

MANY = 8
"""A list of more records or rows than this is stored column by column."""

WORDS = 3
"""A text of more words than this is a sentence, which is stored as `SENTENCE`: wording is no part of the contract."""

SENTENCE = "(text)"

WIDE = 180
"""A record that fits into a line of this length is not broken. [characters]"""

DIGITS = 12
"""Significant digits of stored numbers."""

NOTHING = 1e-9
"""Two numbers that differ by less than this are the same: the rounding of a zero."""


def thin(value: Any) -> Any:
    """Give the content as it is stored.

    >>> thin({"x": 2.0 / 3.0, "says": "eta is too large here"})
    {'x': 0.666666666667, 'says': '(text)'}
    >>> thin([0.5] * 30)
    {'numbers': 30, 'sum': 15.0, 'min': 0.5, 'max': 0.5, 'some': [0.5, 0.5, 0.5, 0.5, 0.5]}
    """
    if isinstance(value, Mapping):
        return {str(key): thin(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return _thin_list(list(value))
    if isinstance(value, str):
        return SENTENCE if len(value.split()) > WORDS else value
    if isinstance(value, float) and math.isfinite(value):
        return float(f"{value:.{DIGITS}g}")
    return value if value is None or isinstance(value, bool | int | float) else str(value)


def _thin_list(values: list[Any]) -> Any:
    if len(values) > MANY and all(isinstance(part, Mapping) for part in values):
        names = list(dict.fromkeys(name for record in values for name in record))
        return {"records": len(values), "columns": {name: thin([part.get(name) for part in values]) for name in names}}
    if len(values) > MANY and all(isinstance(part, list | tuple) for part in values):
        width = max(map(len, values))
        columns = [[row[k] if k < len(row) else None for row in values] for k in range(width)]
        return {"rows": len(values), "columns": [thin(column) for column in columns]}
    if len(values) <= LONG or any(isinstance(part, Mapping | list | tuple) for part in values):
        return [thin(part) for part in values]
    known = [part for part in values if isinstance(part, int | float) and math.isfinite(part)]
    if any(isinstance(part, str | bool) for part in values) or not known:
        kinds = list(dict.fromkeys(map(thin, values)))
        return {"texts": len(values), "kinds": len(kinds), "some": kinds[:LONG]}
    some = [known[k * (len(known) - 1) // 4] for k in range(5)]
    found = {"numbers": len(known), "sum": math.fsum(known), "min": min(known), "max": max(known), "some": some}
    return {**({"missing": len(values) - len(known)} if len(known) < len(values) else {}), **thin(found)}


def layout(value: Any, indent: str = "") -> str:
    """Lay out JSON with as many parts in a line as fit."""
    line = json.dumps(value, ensure_ascii=False)
    if len(line) + len(indent) <= WIDE or not isinstance(value, dict | list) or not value:
        return line
    inner = f"{indent} "
    if isinstance(value, dict):
        parts = [f"{json.dumps(key, ensure_ascii=False)}: {layout(part, inner)}" for key, part in value.items()]
    else:
        parts = [layout(part, inner) for part in value]
    lines: list[str] = []
    for part in parts:
        if lines and "\n" not in lines[-1] + part and len(indent) + len(lines[-1]) + len(part) + 3 <= WIDE:
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
            elif key == "sum" and {"min", "max", "numbers"} <= stored.keys():
                size = max(abs(stored["min"]), abs(stored["max"]))
                if abs(stored["sum"] - present["sum"]) > accuracy * stored["numbers"] * size:
                    yield f"{where}: {stored['sum']} -> {present['sum']}"
            else:
                yield from data_differences(stored[key], present[key], accuracy, where)
    elif isinstance(stored, list) and isinstance(present, list) and len(stored) == len(present):
        for k, (one, other) in enumerate(zip(stored, present, strict=True)):
            yield from data_differences(one, other, accuracy, f"{place}[{k}]")
    elif not _same(stored, present, accuracy):
        texts = [json.dumps(value, ensure_ascii=False)[:WIDE] for value in (stored, present)]
        yield f"{place}: {' -> '.join(texts)}"


def _same(one: Any, other: Any, accuracy: float) -> bool:
    """Whether two scalars are the same within a relative accuracy.

    >>> _same(1.0, 1.0 + 1e-10, 1e-9), _same(1.0, 1.0 + 1e-8, 1e-9), _same(True, 1, 1e-9)
    (True, False, False)
    """
    numbers = [value for value in (one, other) if isinstance(value, int | float) and not isinstance(value, bool)]
    if len(numbers) < 2:
        return type(one) is type(other) and bool(one == other)
    return math.isclose(*numbers, rel_tol=accuracy, abs_tol=NOTHING) or all(map(math.isnan, numbers))


def text_differences(stored: str, present: str) -> Iterator[str]:
    """Tell which lines of two texts differ."""
    lines = difflib.unified_diff(stored.splitlines(), present.splitlines(), n=0, lineterm="")
    return (line for line in lines if not line.startswith(("---", "+++")))
