"""Read TOML files into typed structs; whatever is wrong becomes one sentence: where, what was
found, what was expected.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin

import msgspec
from msgspec import Meta

from winchcascade.core.errors import WinchcascadeError

Table = dict[str, object]

NotNegative = Annotated[float, Meta(ge=0.0, le=1e15)]
Positive = Annotated[float, Meta(gt=0.0, le=1e15)]
ShareOfAll = Annotated[float, Meta(gt=0.0, le=1.0)]
Finite = Annotated[float, Meta(ge=-1e15, le=1e15)]
Share = Annotated[float, Meta(ge=0.0, le=1.0)]

_KINDS = {
    "float": "a number", "int": "a whole number", "str": "a text", "bool": "true or false", "array": "a list",
    "object": "a table", "Path": "the name of a file", "datetime": "a date with a time, such as "
                                                                   "2026-05-14T09:30:00",
}  # fmt: skip
"""Words for the types of msgspec."""


def read_toml(path: Path, fault: type[WinchcascadeError]) -> str:
    """Text of a TOML file; raises a fault of the kind that is given for a file that cannot be
    read.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as found:
        raise fault(f"{path}: cannot be read ({found.strerror}); expected a TOML file.") from None
    except UnicodeDecodeError as found:
        raise fault(
            _no_toml(str(path)) or f"{path}: is no UTF-8 text ({found}); save it as UTF-8."
        ) from None


def toml_values(text: str, where: str, fault: type[WinchcascadeError]) -> Table:
    """Values of the text of a TOML file; `where` names it in the sentence of a fault.

    >>> toml_values("a = 1", "rig.toml", WinchcascadeError)
    {'a': 1}
    """
    try:
        values = tomllib.loads(text)
    except (
        ValueError,
        RecursionError,
    ) as found:  # a ValueError: Python reads no number of thousands of digits
        stated = f"{where}: not a valid TOML file: {found}.{_hint(text, str(found))}"
        raise fault(_no_toml(where) or stated) from None
    if not values and _no_toml(where):
        raise fault(_no_toml(where))
    return values


def _no_toml(where: str) -> str:
    """Sentence for a file that is no TOML file by its name either; empty for any other."""
    if where.endswith(".toml"):
        return ""
    expected = "expected one such as rig.toml or table.toml. `winchcascade reduce` reads logs."
    return f"{where}: is no TOML file; {expected}"


_PLACE = re.compile(r"at line (\d+)")
_DECIMAL_COMMA = re.compile(r"""^[^"'#]*=\s*[-+]?(\d+,\d+)""")


def _hint(text: str, found: str) -> str:
    """What to write in a line with a decimal comma, with a blank before it; empty for any other
    line.
    """
    line = _PLACE.search(found)
    comma = _DECIMAL_COMMA.match(text.splitlines()[int(line[1]) - 1]) if line else None
    return (
        f" Write {comma[1].replace(',', '.')} for {comma[1]}: TOML has decimal points."
        if comma
        else ""
    )


def convert(raw: object, kind: Any, place: str, fault: type[WinchcascadeError]) -> Any:
    """Convert a table or a value to a type that states its conditions by `msgspec.Meta`.

    A ValueError of a struct, for entries that do not fit each other, becomes the sentence behind
    the place.

    >>> convert({"cycles": 3}, dict[str, int], "a.toml", WinchcascadeError)
    {'cycles': 3}
    """
    try:
        return msgspec.convert(raw, kind)
    except msgspec.ValidationError as found:
        what, _, path = (
            str(found).replace(r" matching regex '\\S'", " that is not empty").partition(" - at `$")
        )
    names = re.findall(r"\.\.\.|[^.\[\]`]+", path)
    for name in names:
        if name == "..." and isinstance(raw, dict):  # msgspec names no key of a mapping
            name = next(
                (key for key, value in raw.items() if not isinstance(value, dict | str)), name
            )
        raw = (
            raw[int(name)]
            if isinstance(raw, list | tuple)
            else raw.get(name, raw)
            if isinstance(raw, dict)
            else raw
        )
        place += f" {name}"
    if unknown := re.fullmatch(r"Object contains unknown field `(.*)`", what, re.DOTALL):
        check_keys([unknown[1]], getattr(kind, "__struct_encode_fields__", ()), place, fault)
    if missing := re.fullmatch(r"Object missing required field `(.*)`", what):
        raise fault(f"{place} {missing[1]} is missing; add it.")
    if what.startswith("Invalid enum value"):
        kinds = (
            [field.type for field in struct_fields(kind) if field.encode_name == names[0]]
            if names
            else [kind]
        )
        what = (
            f"Expected one of {', '.join(str(value) for one in kinds for value in _choices(one))}"
        )
    for finding, name in (("Invalid RFC3339", "datetime"), ("Number out of range", "float")):
        what = f"Expected `{name}`" if what.startswith(finding) else what
    if not re.match("Expected `|Expected one of", what):
        raise fault(f"{place.rstrip(':')}: {what}")
    expected = re.sub(
        r"`([\w| ]+)`(, got .*)?", lambda named: _in_words(named[1]), what.removeprefix("Expected ")
    )
    raise fault(f"{place} is {shown(raw)}; expected {expected}.")


def _in_words(types: str) -> str:
    """Types as msgspec lists them, in words."""
    return " or ".join(_KINDS.get(name, name) for name in types.split(" | ") if name != "null")


def _choices(kind: Any) -> list[object]:
    """Values that a type with literals allows."""
    if kind is float or get_origin(kind) is Literal:
        return list(get_args(kind)) or ["a number"]
    return [value for one in get_args(kind) for value in _choices(one)]


def check_keys(
    raw: Collection[str], known: Collection[str], place: str, fault: type[WinchcascadeError]
) -> None:
    """Reject a key that is not known, with the known key that is most like it."""
    for key in raw:
        if key not in known:
            near = "".join(f"{name}, or another " for name in get_close_matches(key, known, 1))
            raise fault(
                f"{place} {key} is no entry here; expected {near}one of {', '.join(known)}."
            )


def shown(value: object) -> str:
    """A value as a sentence quotes it: shortened, and also if it is a number of thousands of
    digits.
    """
    try:
        return f"{value!r:.200}"
    except ValueError:
        return "a number of thousands of digits"


@cache
def struct_fields(kind: type[msgspec.Struct]) -> tuple[msgspec.structs.FieldInfo, ...]:
    """Fields of a struct; their types are evaluated once."""
    return msgspec.structs.fields(kind)
