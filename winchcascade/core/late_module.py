"""Modules that signatures name and that are imported when a signature is resolved, not before."""

from __future__ import annotations


class LateModule:
    """A module that is imported when one of its names is taken.

    `inspect.signature(..., eval_str=True)` resolves annotations among the names of a module; one that is imported for a type
    checker alone is not among them.

    >>> LateModule("fractions").Fraction(1, 2)
    Fraction(1, 2)
    """

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, name: str) -> object:
        """A name of the module."""
        from importlib import import_module

        return getattr(import_module(self._name), name)
