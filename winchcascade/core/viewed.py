"""Results in a notebook: methods that the public functions `frame`, `plot` and `summary_html`
answer, and types of signatures that are imported late.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

import msgspec


class LateModule:
    """A module that is imported when one of its names is taken.

    `inspect.signature(..., eval_str=True)` resolves annotations among the names of a module; one
    that is imported for a type checker alone is not among them.

    >>> LateModule("fractions").Fraction(1, 2)
    Fraction(1, 2)
    """

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, name: str) -> object:
        """A name of the module."""
        return getattr(import_module(self._name), name)


if TYPE_CHECKING:
    import pandas as pd
else:
    pd = LateModule("pandas")


class Viewed(msgspec.Struct, frozen=True):
    """A result with tables and pictures, each of which has a name; the first one is given where
    none is named.
    """

    def to_pandas(self, table: str = "") -> pd.DataFrame:
        """One table as a frame with units in the names of its columns, or in a column of their
        own.
        """
        found: pd.DataFrame = import_module("winchcascade").frame(self, table)
        return found

    def plot(self, what: str = "") -> Any:
        """A picture of the report of the result, which a notebook shows; its `figure` is that of
        Matplotlib.
        """
        return import_module("winchcascade").plot(self, what)

    def _repr_html_(self) -> str:
        """The main table, for notebooks."""
        return str(import_module("winchcascade").summary_html(self))
