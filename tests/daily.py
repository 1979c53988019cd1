"""Cases of a parameter that are tried every day; `make test-all` tries the others, too."""

from collections.abc import Collection, Iterable
from typing import Any

import pytest


def daily(cases: Iterable[Any], chosen: Collection[Any], *, spread: bool = False) -> list[Any]:
    """The cases, of which those that are not chosen are slow tests; `spread` where a case holds
    the values of several names.
    """
    return [
        case
        if case in chosen
        else pytest.param(*(case if spread else [case]), marks=pytest.mark.slow)
        for case in cases
    ]
