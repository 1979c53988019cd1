"""Public names of the package, which are imported as late as they are needed."""

from __future__ import annotations

TYPE_CHECKING = False  # not from typing, as in `winchcascade/__init__.py`
if TYPE_CHECKING:
    from typing import Any

HOMES: dict[str, str] = {}
"""Module of each public name, within the package, as `winchcascade/__init__.py` states them."""


def public(name: str) -> Any:
    """Import what has a public name."""
    from importlib import import_module

    return getattr(import_module(f"winchcascade.{HOMES[name]}"), name)
