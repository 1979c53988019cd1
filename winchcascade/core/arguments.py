"""Arguments of the calls of the library: what each kind of them may be, and one sentence about
one that is none.
"""

from __future__ import annotations

import math
import operator
import os
from collections.abc import Callable, Iterable, Mapping
from numbers import Real
from typing import Any

import msgspec

from winchcascade.core.errors import OptionError
from winchcascade.core.quantity import is_load

LONGEST_PATH = 4000
"""Longest path that the usual file systems take. [characters]"""


class Expected(msgspec.Struct, frozen=True):
    """A condition on an argument; `words` completes the sentence of a fault, "load is 0;
    expected ...". An optional argument may be None.
    """

    words: str
    holds: Callable[[Any], object]
    optional: bool = False


def is_number(value: object) -> bool:
    """Whether a value is a real number; True and False are none, though Python counts with them."""
    return isinstance(value, Real) and not isinstance(value, bool)


def is_whole(value: object, low: int) -> bool:
    """Whether a value is a whole number from a lowest one on."""
    return (
        hasattr(value, "__index__") and not isinstance(value, bool) and operator.index(value) >= low
    )


def is_path(value: object) -> bool:
    """Whether a value is a path, that some file could have."""
    text = os.fspath(value) if isinstance(value, os.PathLike) else value
    return (
        isinstance(text, str)
        and bool(text.strip())
        and "\0" not in text
        and len(text) <= LONGEST_PATH
    )


def _is_listed(value: object, kind: type) -> bool:
    """Whether a value lists values of a kind; a text lists none, though Python iterates over its
    letters.
    """
    return (
        isinstance(value, Iterable)
        and not isinstance(value, str)
        and all(isinstance(one, kind) for one in value)
    )


def _is_ohms(value: object) -> bool:
    return isinstance(value, Real) and is_number(value) and is_load(float(value))


def _is_positive(value: object) -> bool:
    return isinstance(value, Real) and is_number(value) and 0.0 < float(value) < math.inf


def _is_text(value: object) -> bool:
    return isinstance(value, str) and bool(value.strip())


MAPPING = Expected("a mapping, such as a dict", lambda value: isinstance(value, Mapping))
FLAG = Expected("True or False", lambda value: isinstance(value, bool))
NUMBER = Expected("a number", is_number)
TEXT = Expected("a text", lambda value: isinstance(value, str))
NAME = Expected("a text that is not empty", _is_text, optional=True)
LOAD = Expected("a resistance above 0 in ohms, or inf for an open circuit", _is_ohms, optional=True)
LOADS = Expected(
    "a list of resistances in ohms, such as [36.0]",
    lambda value: _is_listed(value, Real) and all(map(_is_ohms, value)),
)
CYCLES = Expected(
    "first and last cycle from 1 on, such as (1, 20)",
    lambda value: (
        len(value) == 2 and all(is_whole(end, 1) for end in value) and value[0] <= value[1]
    ),
    optional=True,
)
SHEET = Expected(
    "the name or the number of a table in the file",
    lambda value: is_whole(value, 1) or _is_text(value),
    optional=True,
)
UNITS_OF_COLUMNS = Expected(
    'the units of columns by their names, such as {"force": "kN"}',
    lambda value: isinstance(value, Mapping) and _is_listed(value.values(), str),
    optional=True,
)
NAMES = Expected('a list of names, such as ["ke_rolloff"]', lambda value: _is_listed(value, str))
PATH = Expected("a path", is_path)
PATH_OR_NONE = Expected("a path or a name", is_path, optional=True)
ON_OFF = Expected("on or off", lambda value: value in ("on", "off"))
RIG_NAME = Expected(
    "a rig file or the name of a built-in rig", lambda value: isinstance(value, str | os.PathLike)
)
PROCESSES = Expected("a number of processes from 1 on", lambda value: is_whole(value, 1))
SEED_NUMBER = Expected("a whole number from 0 on", lambda value: is_whole(value, 0))
STEP_LENGTH = Expected("a number of seconds above 0, or None", _is_positive, optional=True)
WATCH = Expected(
    "a Watch, with begin and done", lambda value: hasattr(value, "begin"), optional=True
)
RATE = Expected("a number above 0", _is_positive)


def check_arguments(call: str, *arguments: tuple[str, object, Expected]) -> None:
    """Reject an argument that is not of its kind: OptionError, with its name, its value and what
    was expected.

    Parameters
    ----------
    arguments : name, value and kind of each
    """
    for name, value, kind in arguments:
        try:
            holds = (kind.optional and value is None) or bool(kind.holds(value))
        except (
            TypeError,
            ValueError,
            OverflowError,
        ):  # of a comparison with a value of another kind
            holds = False
        if not holds:
            raise OptionError(f"{call}: {name} is {value!r:.200}; expected {kind.words}.")
