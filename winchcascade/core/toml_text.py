"""TOML files as checked values: whatever is wrong with one becomes a fault of one sentence."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, get_args

import msgspec

from winchcascade.core.errors import WinchcascadeError

_LARGEST = 2**63

Entries = TypeVar("Entries", bound=msgspec.Struct)


class Expected(msgspec.Struct, frozen=True):
    """What an entry must be, as the last annotation of its type: the end of the sentence of a fault, and a condition.

    A lambda has no names of its module: the annotations are evaluated without them.
    """

    words: str
    holds: Callable[[Any], object] = lambda _: True


def read_toml(path: Path, name: str, fault: type[WinchcascadeError]) -> str:
    """Text of a TOML file; `name` is what the sentence of a fault calls it."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as found:
        raise fault(f"{path}: the {name} cannot be read ({found.strerror}); check its permissions.") from None
    except UnicodeDecodeError as found:
        raise fault(f"{path}: the {name} is no UTF-8 text ({found}); save it as UTF-8.") from None


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


def check_keys(
    raw: Mapping[str, object], known: Collection[str], place: str, words: str, fault: type[WinchcascadeError]
) -> None:
    """Reject a key that is not known: the sentence of the fault is `place`, the key, "is" and `words`."""
    for key in raw:
        if key not in known:
            raise fault(f"{place}{key} is {words}.")


def entry(value: object, key: str, kind: Any, place: str, fault: type[WinchcascadeError]) -> Any:
    """Read the value of a key by an annotated type, which ends with an `Expected`; one that is absent has the value None.

    >>> from typing import Annotated
    >>> entry(3, "cycles", Annotated[int, Expected("a number above 0", lambda n: n > 0)], "t.toml", WinchcascadeError)
    3
    """
    expected: Expected = get_args(kind)[-1]
    with suppress(msgspec.ValidationError):
        found = msgspec.convert(value, kind)
        if found is None or expected.holds(found):
            return found
    raise fault(f"{place}: {key} is {value!r}; expected {expected.words}.")


def entries(raw: Mapping[str, object], kind: type[Entries], place: str, fault: type[WinchcascadeError]) -> Entries:
    """Read the entries of a table that a struct names, each by its type as `entry` does."""
    fields = _fields(kind)
    values = {f.name: raw.get(f.name, None if f.required else f.default) for f in fields}
    return kind(**{f.name: entry(values[f.name], f.name, f.type, place, fault) for f in fields})


@cache
def _fields(kind: type[msgspec.Struct]) -> tuple[msgspec.structs.FieldInfo, ...]:
    """Fields of a struct; their types are evaluated once."""
    return msgspec.structs.fields(kind)


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
