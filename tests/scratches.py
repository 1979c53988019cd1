"""Scratch as a process leaves it that was killed."""

import uuid
from pathlib import Path


def left_scratch(folder: Path, *, as_folder: bool = False) -> Path:
    """Make scratch in a folder."""
    path = folder / f".winchcascade-{uuid.uuid4().hex}.part"
    if as_folder:
        path.mkdir()
        (path / "runs.parquet").touch()
    else:
        path.touch()
    return path
