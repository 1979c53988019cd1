"""Records as MATLAB files."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from winchcascade.core.version import GENERATOR

HEADER_BYTES = 116
"""Length of the text at the beginning of a MATLAB file. [bytes]"""


def matlab_bytes(name: str, record: dict[str, Any]) -> bytes:
    """A MATLAB file (level 5) with one struct; its header names this tool in place of the time,
    which would differ.
    """
    from scipy.io import savemat

    file: Any = io.BytesIO()
    savemat(file, {name: _matlab(record)}, oned_as="column", long_field_names=True)
    header = f"MATLAB 5.0 MAT-file, written by {GENERATOR}".encode().ljust(HEADER_BYTES)
    content: bytes = file.getvalue()
    return header + content[HEADER_BYTES:]


def _matlab(value: Any) -> Any:
    """A value as MATLAB holds it: lists of texts as cells, lists of numbers as columns, nothing
    as an empty array.
    """
    if isinstance(value, dict):
        return {name: _matlab(inner) for name, inner in value.items()}
    if isinstance(value, list):
        return np.array(
            value, dtype=object if any(isinstance(x, str) for x in value) else np.float64
        )
    return np.zeros((0, 0)) if value is None else value
