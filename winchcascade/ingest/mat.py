"""MATLAB files: v4 to v7.2 through scipy, v7.3 through h5py, both as one tree in which the columns are then found."""

from __future__ import annotations

import struct
import warnings
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.io import loadmat, whosmat
from scipy.io.matlab import MatReadWarning, matfile_version

from winchcascade.errors import LogError
from winchcascade.ingest.source import Header, Source, Table

if TYPE_CHECKING:
    from winchcascade.run import Signal

    Node = float | str | Signal | list["Node"] | dict[str, "Node"]
    Column = Signal | list[str]

BYTES_LOADED = 8 * 2**30
"""Most that the variables of a file may take as numbers; compressed zeros take a thousandth of that."""

DEPTH = 4
"""Deepest nesting that is followed: an HDF5 file may hold itself."""

NAMES = ("names", "labels", "channels", "headers", "varnames")
RATES = ("fs", "sample_rate", "samplerate", "sampling_rate")
STEPS = ("dt", "ts", "sample_time")

MATRIX, COMPRESSED = 14, 15
KINDS = frozenset({*range(1, 8), 9, 12, 13, MATRIX, COMPRESSED, 16, 17, 18})
"""Data types that an element of a v5 file may have."""

LEAVES = range(4, 16)
SPARSE, OPAQUE = 5, 17
"""Classes of a v5 matrix that hold numbers or characters and nothing nested; two that have a form of their own."""

SMALL = 10**6
"""A matrix up to this size may claim more elements than it has bytes: some writers store blank texts so."""

_HDF5 = b"\x89HDF\r\n\x1a\n"


def open_mat(path: Path) -> Source:
    """Open a MATLAB file: vectors of one length, structs of them, or a matrix with a list of names.

    Raises
    ------
    LogError
        the file is damaged, too large, needs h5py that is not installed, or holds nothing like a column
    """
    with _told(path):
        tree = _read_73(path) if _is_hdf5(path) else _read_72(path)
    columns = _matrix_columns(tree) or _vectors(tree)
    if not any(isinstance(column, np.ndarray) for column in columns.values()):
        raise LogError(
            f"{path.name}: none of the {len(tree)} variables is a vector of numbers; vectors of one length, a struct "
            "of them or a matrix with a cell array of names was expected; save the channels so."
        )
    units = _units(tree, list(columns))
    properties = _properties(tree)
    return Source(
        headers=tuple(Header(name, units.get(name) or units.get(name.rpartition(".")[2])) for name in columns),
        load=partial(_load, list(columns.values())),
        form="MATLAB",
        time_step=_time_step(properties),
        properties=properties,
    )


@contextmanager
def _told(path: Path) -> Iterator[None]:
    """Turn whatever the parsers trip over into one sentence."""
    try:
        yield
    except LogError:
        raise
    except Exception as fault:  # damage shows as nearly every exception there is
        raise LogError(
            f"{path.name}: the file is damaged or breaks off ({type(fault).__name__}); a whole MATLAB file was "
            "expected; copy or save it again."
        ) from fault


def _is_hdf5(path: Path) -> bool:
    """Look for the HDF5 signature, at the start or behind the 512 bytes that MATLAB puts before it."""
    with path.open("rb") as stream:
        start = stream.read(512 + len(_HDF5))
    return start.startswith(_HDF5) or start[512:] == _HDF5 or start.startswith(b"MATLAB 7.3 MAT-file")


def _refuse_bomb(path: Path, numbers: int) -> None:
    if 8 * numbers > BYTES_LOADED:
        raise LogError(
            f"{path.name}: its variables take {8 * numbers / 2**30:.0f} GiB; at most {BYTES_LOADED / 2**30:.0f} GiB "
            "are read; save the channels alone or cut the log into shorter files."
        )


def _read_72(path: Path) -> dict[str, Node]:
    """Read MATLAB v4 to v7.2."""
    with warnings.catch_warnings():
        # scipy turns a variable that breaks off into a warning and a text in its place.
        warnings.simplefilter("ignore")
        warnings.simplefilter("error", MatReadWarning)
        if matfile_version(path)[0] == 1:
            _check_5(path, path.read_bytes())
        _refuse_bomb(path, sum(prod(map(int, shape)) for _, shape, _ in whosmat(path)))
        raw = loadmat(path, simplify_cells=True)
    return _nodes_72({name: value for name, value in raw.items() if not name.startswith("__")})


def _check_5(path: Path, content: bytes) -> None:
    """Check the structure of a v5 file before scipy trusts it: a wrong tag there ends the whole process."""
    order = "<" if content[126:128] == b"IM" else ">"
    for kind, body in _elements(memoryview(content)[128:], order):
        whole = _inflated(path, body, order) if kind == COMPRESSED else [(kind, body)]
        for inner_kind, inner in whole:
            if inner_kind != MATRIX:
                raise ValueError(f"variable of type {inner_kind}")
            _check_matrix(inner, order, 0)


def _inflated(path: Path, body: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Unpack a compressed variable, as far as the size goes that it states."""
    inflate = zlib.decompressobj()
    head = inflate.decompress(body, 8)
    _, size = struct.unpack(f"{order}II", head)
    _refuse_bomb(path, size // 8)
    return _elements(memoryview(head + inflate.decompress(inflate.unconsumed_tail, size)), order)


def _elements(data: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Yield type and content of the elements that follow one another, each behind a tag of 8 bytes."""
    at = 0
    while at < len(data):
        kind, size = struct.unpack(f"{order}II", data[at : at + 8])
        start = at + 8
        if kind >> 16:  # up to 4 bytes stand in the tag itself
            kind, size, start = kind & 0xFFFF, kind >> 16, at + 4
        if kind not in KINDS or size > len(data) - start or (start == at + 4 and size > 4):
            raise ValueError(f"element of type {kind} and {size} bytes")
        yield kind, data[start : start + size]
        at = at + 8 if start == at + 4 else start + size + (0 if kind == COMPRESSED else -size % 8)


def _check_matrix(body: memoryview, order: str, depth: int) -> None:
    """Check that a matrix has the parts that its class needs, and no more elements than bytes."""
    kinds, parts = [], []
    for kind, part in _elements(body, order):
        kinds.append(kind)
        parts.append(part)
    if not parts:
        return
    flags = struct.unpack_from(f"{order}I", parts[0])[0]
    of_class = flags & 0xFF
    nested = [part for kind, part in zip(kinds, parts, strict=True) if kind in (MATRIX, COMPRESSED)]
    needed = 4 + bool(flags & 0x800) + 2 * (of_class == SPARSE) if of_class in LEAVES else 3
    shaped = kinds[:2] in ([6, 5], [6, 6]) and len(parts[1]) >= 8 and len(parts) >= needed
    sound = of_class == OPAQUE or (shaped and not (nested and of_class in LEAVES))
    if not sound or depth > 2 * DEPTH:
        raise ValueError(f"matrix of class {of_class} with parts {kinds}")
    elements = 0 if of_class in (SPARSE, OPAQUE) else prod(map(int, np.frombuffer(parts[1], f"{order}i4")))
    if not 0 <= elements <= max(len(body), SMALL):
        raise ValueError(f"matrix of {elements} elements in {len(body)} bytes")
    for part in nested:
        _check_matrix(part, order, depth + 1)


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
        sizes: list[int] = []
        file.visititems(lambda _, item: sizes.append(getattr(item, "size", None) or 0))
        _refuse_bomb(path, sum(sizes))
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


def _texts(node: Node | None) -> list[str]:
    """Take a list of texts; nothing for any other node."""
    if not isinstance(node, list):
        return []
    texts = [item.strip() for item in node if isinstance(item, str)]
    return texts if len(texts) == len(node) else []


def _scopes(tree: Mapping[str, Node]) -> Iterator[tuple[str, Mapping[str, Node]]]:
    """Yield the top level, its structs and the structs in those."""
    yield "", tree
    for name, node in tree.items():
        if isinstance(node, dict):
            yield name, node
            yield from ((f"{name}.{inner}", deeper) for inner, deeper in node.items() if isinstance(deeper, dict))


def _named(scope: Mapping[str, Node], keys: Sequence[str]) -> Iterator[Node]:
    """Yield what stands under one of the keys, in any case."""
    return (node for name, node in scope.items() if name.casefold() in keys)


def _matrix_columns(tree: Mapping[str, Node]) -> dict[str, Column]:
    """Take the columns of a matrix that a list of names fits; its rows where only these fit."""
    for _, scope in _scopes(tree):
        matrices = [node for node in scope.values() if isinstance(node, np.ndarray) and node.ndim == 2]
        for names in map(_texts, _named(scope, NAMES)):
            for matrix in matrices:
                if len(names) in matrix.shape:
                    return dict(zip(names, matrix.T if matrix.shape[1] == len(names) else matrix, strict=True))
    return {}


def _vectors(tree: Mapping[str, Node]) -> dict[str, Column]:
    """Take the vectors, and lists of texts, that have the length most vectors have, the longer one of two alike."""
    found = [(prefix, name, _column(name, node)) for prefix, scope in _scopes(tree) for name, node in scope.items()]
    lengths = Counter(len(column) for _, _, column in found if isinstance(column, np.ndarray))
    length = max(lengths, key=lambda n: (lengths[n], n), default=0)
    kept = [(prefix, name, column) for prefix, name, column in found if column is not None and len(column) == length]
    times = Counter(name for _, name, _ in kept)
    return {f"{prefix}.{name}" if prefix and times[name] > 1 else name: column for prefix, name, column in kept}


def _column(name: str, node: Node) -> Column | None:
    if isinstance(node, np.ndarray):
        return node if node.ndim == 1 else None
    return None if name.casefold() in (*NAMES, "units", "unit") else _texts(node) or None


def _units(tree: Mapping[str, Node], columns: Sequence[str]) -> dict[str, str]:
    """Find the units: a struct with the columns' names, or a list parallel to the names or to the columns."""
    units: dict[str, str] = {}
    for _, scope in _scopes(tree):
        names = next((texts for texts in map(_texts, _named(scope, NAMES)) if texts), list(columns))
        for node in _named(scope, ("units", "unit")):
            if isinstance(node, dict):
                units |= {name: unit for name, unit in node.items() if isinstance(unit, str)}
            elif len(_texts(node)) == len(names):
                units |= dict(zip(names, _texts(node), strict=True))
    return {name: unit for name, unit in units.items() if unit}


def _properties(tree: Mapping[str, Node]) -> dict[str, str | float]:
    """Take the numbers and texts that stand alone; those of the top level win over those in structs."""
    properties: dict[str, str | float] = {}
    for prefix, scope in _scopes(tree):
        if prefix.rpartition(".")[2].casefold() not in ("units", "unit"):
            properties = {name: node for name, node in scope.items() if isinstance(node, float | str)} | properties
    return properties


def _time_step(properties: Mapping[str, str | float]) -> float | None:
    """Find the sampling interval among the properties, from a rate or a step. [s]"""
    for name, value in properties.items():
        if isinstance(value, float) and 0.0 < value < np.inf and name.casefold() in (*RATES, *STEPS):
            return 1.0 / value if name.casefold() in RATES else value
    return None


def _load(columns: Sequence[Column], wanted: Sequence[int], time: int | None) -> Table:
    """Hand over the wanted columns, texts as NaN, and the time column as it is."""
    values = {
        i: column if isinstance(column := columns[i], np.ndarray) else np.full(len(column), np.nan) for i in wanted
    }
    return Table(values, stamps=None if time is None else columns[time])
