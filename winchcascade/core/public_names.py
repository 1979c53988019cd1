"""Where the public functions of the package are, which `winchcascade/__init__.py` states; what is below finds them by name."""

from __future__ import annotations

TYPE_CHECKING = False  # not from typing, as in `winchcascade/__init__.py`
if TYPE_CHECKING:
    from typing import Any

HOMES: dict[str, str] = {}
"""Module of each public name, within the package."""


def public(name: str) -> Any:
    """Import what has a public name, as late as it is needed."""
    from importlib import import_module

    return getattr(import_module(f"winchcascade.{HOMES[name]}"), name)
