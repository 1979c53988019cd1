"""Compile loops over numbers with numba, which the extra `fast` installs; without it the same functions run as plain Python.

Plain Python gives the same numbers but for their last digits, and a step of a simulation takes about 70 times as long.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

import numpy as np

try:
    from numba import njit as _njit
    from numba.extending import register_jitable as _register_jitable
except ImportError:
    COMPILED = False
else:
    COMPILED = True

Function = TypeVar("Function", bound=Callable[..., Any])


def njit(**options: Any) -> Callable[[Function], Function]:
    """Compile a function of numbers, with numba's options; without numba the function as it is."""
    return _njit(**options) if COMPILED else lambda function: function


def register_jitable(**options: Any) -> Callable[[Function], Function]:
    """Make a function part of the compiled code that calls it; without numba the function as it is."""
    return _register_jitable(**options) if COMPILED else lambda function: function


def njit_loop(**options: Any) -> Callable[[Function], Function]:
    """Compile a loop over arrays, with numba's options.

    Without numba the loop gets its arrays as memory views: their elements are Python's own numbers, with which plain Python
    computes three times as fast as with those of numpy. So the loop may only index its arrays and take their `len`.
    """
    return _njit(**options) if COMPILED else _over_views


def _over_views(function: Function) -> Function:
    @wraps(function)
    def viewed(*arguments: object, **numbers: float) -> Any:
        return function(*map(_view, arguments), **numbers)

    return viewed  # type: ignore[return-value]


def _view(argument: Any) -> Any:
    """An array as a memory view, also within a named tuple; all else as it is."""
    if isinstance(argument, np.ndarray):
        return argument.data
    if isinstance(argument, tuple) and any(isinstance(item, np.ndarray) for item in argument):
        return type(argument)(*map(_view, argument))
    return argument
