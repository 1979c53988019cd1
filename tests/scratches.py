"""Scratch as a process leaves it that was killed."""

import os
import uuid
from pathlib import Path


def left_scratch(folder: Path, *, as_folder: bool = False) -> Path:
    """Make scratch in a folder that is so old that its owner must have been killed."""
    path = folder / f".winchcascade-{uuid.uuid4().hex}.part"
    if as_folder:
        path.mkdir()
        (path / "runs.parquet").touch()
    else:
        path.touch()
    os.utime(path, (0.0, 0.0))
    return path
