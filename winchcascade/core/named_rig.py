"""Which rig counts: the one that was named, else that of the paper, which is marked as assumed."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

from msgspec.structs import replace

from winchcascade.core.errors import check_type
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import built_in, read_rig


@cache
def assumed_rig() -> Rig:
    """The rig of the paper, marked as taken because none was named."""
    return replace(built_in(), assumed=True)


def first_named(*names: str | Path | None, read: Callable[[str | Path], Rig] = read_rig) -> Rig:
    """Read the first rig that is named; that of the paper, as assumed, if none is. Raises RigError as `read`.

    >>> first_named(None, "kitepower").name, first_named(None).assumed
    ('kitepower', True)
    """
    return next((read(name) for name in names if name is not None), None) or assumed_rig()


def given_rig(call: str, rig: Rig | None, usual: Rig | None = None) -> Rig:
    """The rig that a call of the library was given, else the usual one, else that of the paper, as assumed.

    Parameters
    ----------
    usual : rig of the run that the call works on, if it has one

    Raises
    ------
    OptionError : something else than a rig was given
    """
    found = rig if rig is not None else usual if usual is not None else assumed_rig()
    check_type(f"{call}, rig", found, Rig, "load_rig(name)")
    return found
