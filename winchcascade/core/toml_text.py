"""The text of a TOML file as plain values, whatever is wrong with it told in one sentence."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from typing import Any

from winchcascade.core.errors import WinchcascadeError

_LARGEST = 2**63


def toml_values(text: str, where: str, fault: type[WinchcascadeError]) -> dict[str, Any]:
    """Read the text of a TOML file; `where` names it in the sentence of a fault of the kind that is given.

    >>> toml_values("a = 1", "rig.toml", WinchcascadeError)
    {'a': 1}
    """
    try:
        values = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as found:
        raise fault(f"{where}: not a valid TOML file: {found}.") from None
    except ValueError:  # Python turns no more than thousands of digits into a whole number
        raise _too_large(where, "a whole number has thousands of digits", fault) from None
    for place, number in _whole_numbers(values, ""):
        if abs(number) > _LARGEST:
            size = f"{number:.3g}" if abs(number) < 10**300 else "of hundreds of digits"
            raise _too_large(where, f"{place} is the whole number {size}", fault)
    return values


def _whole_numbers(value: object, place: str) -> Iterator[tuple[str, int]]:
    """Yield the whole numbers of a value, however deep they lie, each with the names that lead to it."""
    if isinstance(value, int):
        yield place, value
    elif isinstance(value, dict):
        for name, inner in value.items():
            yield from _whole_numbers(inner, f"{place} {name}".lstrip())
    elif isinstance(value, list):
        for inner in value:
            yield from _whole_numbers(inner, place)


def _too_large(where: str, found: str, fault: type[WinchcascadeError]) -> WinchcascadeError:
    return fault(f"{where}: {found}; expected at most 64 bits, as TOML has them. Correct it.")
