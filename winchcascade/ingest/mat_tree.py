"""MATLAB files as a tree of variables: v4 to v7.2 through scipy, v7.3 through h5py."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from winchcascade.errors import LogError

if TYPE_CHECKING:
    from winchcascade.run import Signal

    Node = float | str | Signal | list["Node"] | dict[str, "Node"]

DEPTH = 4
"""Deepest nesting that is followed: an HDF5 file may hold itself."""

_HDF5 = b"\x89HDF\r\n\x1a\n"


def read_tree(path: Path) -> dict[str, Node]:
    """Read the variables of a file by name; whatever its parser raises, damage raises."""
    return _read_73(path) if _is_hdf5(path) else _read_72(path)


def _is_hdf5(path: Path) -> bool:
    """Look for the HDF5 signature, at the start or behind the 512 bytes that MATLAB puts before it."""
    with path.open("rb") as stream:
        start = stream.read(512 + len(_HDF5))
    return start.startswith(_HDF5) or start[512:] == _HDF5 or start.startswith(b"MATLAB 7.3 MAT-file")


def _read_72(path: Path) -> dict[str, Node]:
    """Read MATLAB v4 to v7.2."""
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadWarning

    with warnings.catch_warnings():
        # scipy turns a variable that breaks off into a warning and a text in its place.
        warnings.simplefilter("ignore")
        warnings.simplefilter("error", MatReadWarning)
        raw = loadmat(path, simplify_cells=True)
    return _nodes_72({name: value for name, value in raw.items() if not name.startswith("__")})


def _nodes_72(items: Mapping[str, Any]) -> dict[str, Node]:
    nodes = {str(name): _node_72(value) for name, value in items.items()}
    return {name: node for name, node in nodes.items() if node is not None}


def _node_72(value: Any) -> Node | None:
    """Translate what scipy hands over; None for what no log is made of (sparse, complex, objects)."""
    if isinstance(value, str):
        return str(value)
    if isinstance(value, dict):
        return _nodes_72(value)
    if isinstance(value, list):
        return ["" if node is None else node for node in map(_node_72, value)]
    array = np.asarray(value)
    if array.dtype.kind in "OU" and array.ndim == 1:
        return _node_72(array.tolist())
    return _numbers(array)


def _numbers(array: Any) -> Node | None:
    """Squeeze an array to a number, a vector or a matrix; None for one that is empty or not real."""
    if array.dtype.kind not in "biuf" or array.size == 0:
        return None
    squeezed: Signal = np.asarray(array.squeeze(), dtype=np.float64)
    return float(squeezed) if squeezed.ndim == 0 else squeezed


def _read_73(path: Path) -> dict[str, Node]:
    """Read MATLAB v7.3, which is HDF5."""
    try:
        import h5py
    except ImportError as fault:
        raise LogError(
            f"{path.name}: a MATLAB v7.3 file was found, which takes h5py to read; h5py is not installed; run "
            "`pip install winchcascade[mat73]` or save it with `save -v7`."
        ) from fault
    with h5py.File(path, "r") as file:
        return _nodes_73(file, file, 0)


def _nodes_73(file: Any, group: Any, depth: int) -> dict[str, Node]:
    """Read a struct; `#refs#` and `#subsystem#` are MATLAB's own."""
    nodes = {str(name): _node_73(file, group[name], depth + 1) for name in group if not name.startswith("#")}
    return {name: node for name, node in nodes.items() if node is not None}


def _node_73(file: Any, item: Any, depth: int) -> Node | None:
    """Read one variable; HDF5 holds the dimensions in MATLAB's order turned round."""
    if depth > DEPTH:
        return None
    if not hasattr(item, "dtype"):
        return _nodes_73(file, item, depth)
    if item.size is None or item.attrs.get("MATLAB_empty", 0):
        return None
    if "ref" in (item.dtype.metadata or {}):  # a cell array
        cells = [_node_73(file, file[reference], depth + 1) for reference in np.asarray(item).T.ravel()]
        return ["" if cell is None else cell for cell in cells]
    array = np.asarray(item).T
    return _text_73(array) if item.attrs.get("MATLAB_class") == b"char" else _numbers(array)


def _text_73(array: Any) -> Node:
    """Read UTF-16 characters: one text, or one for each row of a matrix."""
    rows = [row.astype("<u2").tobytes().decode("utf-16-le", "replace").rstrip() for row in np.atleast_2d(array)]
    return rows[0] if len(rows) == 1 else [*rows]
