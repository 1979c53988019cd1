"""Read TOML files into typed structs; whatever is wrong becomes one sentence: where, what was found, what was expected."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Mapping
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import msgspec
from msgspec import inspect

from winchcascade.core.errors import WinchcascadeError

Kind = TypeVar("Kind")
Table = dict[str, object]


def read_toml(path: Path, fault: type[WinchcascadeError]) -> str:
    """Text of a TOML file; raises a fault of the kind that is given for a file that cannot be read."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as found:
        raise fault(f"{path}: cannot be read ({found.strerror}); expected a TOML file.") from None
    except UnicodeDecodeError as found:
        raise fault(f"{path}: is no UTF-8 text ({found}); save it as UTF-8.") from None


def toml_values(text: str, where: str, fault: type[WinchcascadeError]) -> Table:
    """Values of the text of a TOML file; `where` names it in the sentence of a fault.

    >>> toml_values("a = 1", "rig.toml", WinchcascadeError)
    {'a': 1}
    """
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as found:  # a ValueError: Python reads no number of thousands of digits
        raise fault(f"{where}: not a valid TOML file: {found}.") from None


def convert(raw: object, kind: Any, place: str, fault: type[WinchcascadeError]) -> Any:
    """Convert a table or a value to a type that states its conditions by `msgspec.Meta`.

    A `description` of a `Meta` completes the sentence "... is 0; expected ..."; without one the words follow from the type and
    its limits. A ValueError of a struct, for entries that do not fit each other, becomes the sentence behind the place.

    >>> convert({"cycles": 3}, dict[str, int], "a.toml", WinchcascadeError)
    {'cycles': 3}
    """
    try:
        return msgspec.convert(raw, kind)
    except msgspec.ValidationError as found:
        what, _, path = str(found).partition(" - at `$")
        raise fault(one_line_fault(raw, kind, place, what, path.rstrip("`"))) from None


def one_line_fault(raw: object, kind: Any, place: str, what: str, path: str) -> str:
    """The sentence of a finding of msgspec: its words, and the path of what is wrong in a value that was read."""
    place, value, info = _followed(path, place, raw, inspect.type_info(kind))
    if unknown := re.fullmatch(r"Object contains unknown field `(.*)`", what, re.DOTALL):
        return unknown_key(unknown[1], [field.encode_name for field in _inner(info).fields], place)
    if missing := re.fullmatch(r"Object missing required field `(.*)`", what):
        field = next(field for field in _inner(info).fields if field.encode_name == missing[1])
        return f"{place} {missing[1]} is missing; expected {words(field.type)}."
    if not re.match(r"(Expected `|Invalid |Number out of range)", what):
        return f"{place.rstrip(':')}: {what}"
    return f"{place} is {shown(value)}; expected {words(info)}."


def _followed(path: str, place: str, value: Any, info: Any) -> tuple[str, Any, Any]:
    """Place, value and type at the end of a path of msgspec, or where a description says what the whole value is to be."""
    for name, item in re.findall(r"\.([^.\[\]]+)|\[(\d+|\.\.\.)\]", path):
        if item and _described(info):
            break
        outer = _inner(info)
        if name:
            info = next((field.type for field in outer.fields if field.encode_name == name), info)
            place, value = f"{place} {name}", value.get(name)
        elif item == "...":  # msgspec names no key of a mapping
            name = next((key for key, inner in value.items() if not _fits(inner, outer.value_type)), None)
            if name is None:
                break
            place, value, info = f"{place} {name}", value[name], outer.value_type
        else:
            info = outer.item_types[int(item)] if isinstance(outer, inspect.TupleType) else outer.item_type
            place, value = f"{place} [{item}]", value[int(item)]
    return place, value, info


def _fits(value: object, info: Any) -> bool:
    """Whether a value of a mapping is a table or a text as its type wants it."""
    if isinstance(info, inspect.UnionType):
        return any(_fits(value, kind) for kind in info.types)
    return isinstance(value, str if isinstance(info, inspect.StrType) else dict)


def unknown_key(key: str, known: Collection[str], place: str) -> str:
    """The sentence about a key that is not known, with the known key that is most like it."""
    near = get_close_matches(key, known, 1)
    return f"{place} {key} is no entry here; expected {f'{near[0]}, or another ' if near else ''}one of {', '.join(known)}."


def check_keys(raw: Mapping[str, object], known: Collection[str], place: str, fault: type[WinchcascadeError]) -> None:
    """Reject a table with a key that is not known."""
    for key in raw:
        if key not in known:
            raise fault(unknown_key(key, known, place))


def shown(value: object) -> str:
    """A value as a sentence quotes it: shortened, and also if it is a number of thousands of digits."""
    try:
        return f"{value!r:.200}"
    except ValueError:
        return "a number of thousands of digits"


def _described(info: Any) -> str:
    """Description of a type, empty where it has none."""
    return str((info.extra_json_schema or {}).get("description", "")) if isinstance(info, inspect.Metadata) else ""


def _inner(info: Any) -> Any:
    """The type below descriptions, and beside None."""
    if isinstance(info, inspect.Metadata):
        return _inner(info.type)
    if isinstance(info, inspect.UnionType):
        kinds = [kind for kind in info.types if not isinstance(kind, inspect.NoneType)]
        return _inner(kinds[0]) if len(kinds) == 1 else info
    return info


_WORDS: dict[Any, str] = {
    inspect.BoolType: "true or false",
    inspect.DateTimeType: "a date with a time, such as 2026-05-14T09:30:00",
    inspect.ListType: "a list",
    inspect.VarTupleType: "a list",
    inspect.StructType: "a table",
}
_LIMITS = {"gt": "above", "ge": "from", "lt": "below", "le": "up to"}


def words(info: Any) -> str:
    """What a type and its limits allow, for "expected ..."."""
    if described := _described(info):
        return described
    info = _inner(info)
    match info:
        case inspect.UnionType():
            return " or ".join(words(kind) for kind in info.types if not isinstance(kind, inspect.NoneType))
        case inspect.FloatType() | inspect.IntType():
            limits = [f"{word} {limit:g}" for key, word in _LIMITS.items() if _is_limit(limit := getattr(info, key))]
            return " ".join(["a number" if isinstance(info, inspect.FloatType) else "a whole number", *limits])
        case inspect.StrType():
            return "a text that is not empty" if info.min_length else "a text"
        case inspect.LiteralType():
            return f"one of {', '.join(map(str, info.values))}"
        case inspect.TupleType():
            return f"a list of {' and '.join(map(words, info.item_types))}"
        case inspect.DictType():
            return "a table that is not empty" if info.min_length else "a table"
    return _WORDS.get(type(info), "another value")


def _is_limit(limit: float | None) -> bool:
    """Whether a limit of a number is worth a word: those that only keep it finite are not."""
    return limit is not None and abs(limit) < 1e9


@cache
def struct_fields(kind: type[msgspec.Struct]) -> tuple[msgspec.structs.FieldInfo, ...]:
    """Fields of a struct; their types are evaluated once."""
    return msgspec.structs.fields(kind)
