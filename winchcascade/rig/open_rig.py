"""Read rig files with the effects that they state."""

from __future__ import annotations

from pathlib import Path

from winchcascade.core.arguments import RIG_NAME, check_arguments
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import read_rig


def load_rig(rig: str | Path) -> Rig:
    """Read a rig file, or the built-in rig of that name where no such file exists.

    Raises
    ------
    OptionError : this is no path and no name
    RigError : an entry of the file is wrong, or an effect that it states is not one of the catalogue; names which
    """
    check_arguments("load_rig", ("rig", rig, RIG_NAME))
    found = read_rig(rig)
    if found.effects:  # the catalogue takes longer to import than a plain rig file to read
        from winchcascade.rig.baseline import stated_effects

        stated_effects(found)
    return found
