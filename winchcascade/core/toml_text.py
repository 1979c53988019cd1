"""Read TOML files as checked values: whatever is wrong with a file becomes a fault of one sentence."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Collection, Iterator, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar, get_args

import msgspec

from winchcascade.core.errors import WinchcascadeError

_MAX_INTEGER = 2**63

Entries = TypeVar("Entries", bound=msgspec.Struct)


class Expected(msgspec.Struct, frozen=True):
    """A condition on an entry of a TOML file, as an annotation of its type: `Annotated[float, Expected("ohms above 0", ...)]`.

    `words` completes the sentence of a fault, "load_ohm is 0; expected ...". The fault of a value of another type uses the
    first condition of the type. `holds` gets the converted value; as the types of a struct are evaluated outside of their
    module, a lambda in it can use built-in names only.
    """

    words: str
    holds: Callable[[Any], object] = lambda _: True


def read_toml(path: Path, name: str, fault: type[WinchcascadeError]) -> str:
    """Text of a TOML file; `name` completes the sentence of a fault, "cannot be read; expected ..."."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as found:
        raise fault(f"{path}: cannot be read ({found.strerror}); expected {name}.") from None
    except UnicodeDecodeError as found:
        raise fault(f"{path}: is no UTF-8 text ({found}); save it as UTF-8.") from None


def toml_values(text: str, where: str, fault: type[WinchcascadeError]) -> dict[str, object]:
    """Read the text of a TOML file; `where` names it in the sentence of a fault of the kind that is given.

    >>> toml_values("a = 1", "rig.toml", WinchcascadeError)
    {'a': 1}
    """
    too_large = None
    try:
        values = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as found:
        raise fault(f"{where}: not a valid TOML file: {found}.") from None
    except ValueError:  # Python turns no more than thousands of digits into a whole number
        too_large, values = "a whole number has thousands of digits", {}
    for place, number in _whole_numbers(values, ""):
        if abs(number) > _MAX_INTEGER:
            size = f"{number:.3g}" if abs(number) < 10**300 else "of hundreds of digits"
            too_large = too_large or f"{place} is the whole number {size}"
    if too_large:
        raise fault(f"{where}: {too_large}; expected at most 64 bits, as TOML has them. Correct it.")
    return values


def check_keys(
    raw: Mapping[str, object], known: Collection[str], place: str, words: str, fault: type[WinchcascadeError]
) -> None:
    """Reject an unknown key: the sentence of the fault is `place`, the key, "is" and `words`."""
    for key in raw:
        if key not in known:
            raise fault(f"{place}{key} is {words}.")


def entry(value: object, key: str, kind: Any, place: str, fault: type[WinchcascadeError]) -> Any:
    """Read the value of a key by a type that is annotated with `Expected`; the value of an absent key is None.

    >>> from typing import Annotated
    >>> entry(3, "cycles", Annotated[int, Expected("a number above 0", lambda n: n > 0)], "t.toml", WinchcascadeError)
    3
    """
    conditions = [condition for condition in get_args(kind) if isinstance(condition, Expected)]
    try:
        found = msgspec.convert(value, kind)
        broken = [one for one in conditions if found is not None and not one.holds(found)]
    except msgspec.ValidationError:
        broken = conditions
    if broken:
        given = "missing" if value is None else f"{value!r:.200}"
        raise fault(f"{place}: {key} is {given}; expected {broken[0].words}.")
    return found


@cache
def struct_fields(kind: type[msgspec.Struct]) -> tuple[msgspec.structs.FieldInfo, ...]:
    """Fields of a struct; their types are evaluated once."""
    return msgspec.structs.fields(kind)


def entries(
    raw: Mapping[str, object],
    kind: type[Entries],
    place: str,
    fault: type[WinchcascadeError],
    given: Mapping[str, object] = MappingProxyType({}),
) -> Entries:
    """Read the entries of a table that a struct names, other than the `given` fields, each by its type as `entry` does."""
    read = {
        f.name: entry(raw.get(f.encode_name, None if f.required else f.default), f.encode_name, f.type, place, fault)
        for f in struct_fields(kind)
        if f.name not in given
    }
    return kind(**given, **read)


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
