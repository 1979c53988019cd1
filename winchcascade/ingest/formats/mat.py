"""MATLAB files: columns, units and properties found in the tree of their variables.

scipy reads v4 to v7.2, h5py reads v7.3.
"""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pyarrow as pa

from winchcascade.core.errors import LogError
from winchcascade.core.extras import installation
from winchcascade.core.run import Signal
from winchcascade.ingest.headers import Header, recognise
from winchcascade.ingest.limits import require_numbers
from winchcascade.ingest.source import arrow_table, choose, damage_reported, reject_sheet

Node: TypeAlias = "float | str | Signal | list[Node] | dict[str, Node]"

DEPTH_MAX = 4
"""Deepest nesting that is followed: an HDF5 file may hold itself."""

NAMES = ("names", "labels", "channels", "headers", "varnames")
UNITS = ("units", "unit")
RATES = ("fs", "sample_rate", "samplerate", "sampling_rate")
STEPS = ("dt", "ts", "sample_time")
"""Names of variables that describe the columns, without case."""

_HDF5, _BEFORE_HDF5 = b"\x89HDF\r\n\x1a\n", 512
"""First bytes of HDF5, and how many MATLAB puts before them."""

_EXPORTS = {
    "timetable": "writetimetable({0}, '{0}.csv')",
    "table": "writetable({0}, '{0}.csv')",
    "timeseries": "s.time = {0}.Time; s.velocity = {0}.Data; save('{0}.mat', '-struct', 's')",
}
"""How MATLAB exports an object of a class so that other programs can read it."""


class _Leaf(NamedTuple):
    """A vector of numbers or texts, or a column of a matrix; its place are the names of structs
    and matrix with points.
    """

    place: str
    name: str
    column: Signal | list[str]

    @property
    def run(self) -> tuple[str, int]:
        """Where columns of one run lie: place and number of rows."""
        return self.place, len(self.column)


def read_mat(path: Path, *, table: str | None = None) -> pa.Table:
    """Read a MATLAB file: vectors of one length, structs of them, or a matrix with a list of names.

    Parameters
    ----------
    table : name or number of the run, where the file holds several

    Raises
    ------
    LogError
        the file is damaged, needs h5py that is not installed, or holds nothing like a column
    """
    with path.open("rb") as stream:
        start = stream.read(_BEFORE_HDF5 + len(_HDF5))
    is_hdf5 = start.startswith((_HDF5, b"MATLAB 7.3 MAT-file")) or start.endswith(_HDF5)
    objects: dict[str, str] = {}
    with damage_reported(path, "MATLAB file", "copy or save it again"):
        scopes = dict(
            _scopes("", _with_signals((_read_73 if is_hdf5 else _read_72)(path, objects)))
        )
        leaves = [leaf for place, nodes in scopes.items() for leaf in _leaves(place, nodes)]
    runs = _runs(leaves)
    name = choose(list(runs), table, path.name, "run") if len(runs) > 1 else None
    if name is None and table is not None:
        reject_sheet(table, path.name)
    run = runs.pop(name or next(iter(runs), ""), None)
    aside = {place for place, _ in runs.values()} - {run[0] if run else "", ""}
    scopes = {place: nodes for place, nodes in scopes.items() if place not in aside}
    columns = _columns([leaf for leaf in leaves if leaf.place not in aside], run)
    if objects and not any(recognise(Header(name)) for name in columns):
        raise LogError(_export(path.name, objects))
    if not any(isinstance(column, np.ndarray) for column in columns.values()):
        raise LogError(
            f"{path.name}: none of the {len(scopes[''])} variables is a vector of numbers; "
            f"vectors of one length, a "
            "struct of them or a matrix with a cell array of names was expected; save the "
            "channels so, or export them as CSV."
        )
    units = _units(scopes.values(), list(columns))
    named = [nodes for place, nodes in scopes.items() if not place.casefold().endswith(UNITS)]
    stated = {
        key: node for nodes in reversed(named) for key, node in nodes.items()
    }  # those of the top level win
    properties = {key: node for key, node in stated.items() if isinstance(node, float | str)}
    steps = [
        1.0 / value if key.casefold() in RATES else value
        for key, value in properties.items()
        if isinstance(value, float) and 0.0 < value < np.inf and key.casefold() in (*RATES, *STEPS)
    ]
    listed = ", ".join(f"{name} ({kind})" for name, kind in objects.items())
    return arrow_table(
        [Header(key, units.get(key) or units.get(key.rpartition(".")[2])) for key in columns],
        [pa.array(column) for column in columns.values()],
        time_step=steps[0] if steps else None,
        properties=properties,
        table=name,
        not_read=f"MATLAB objects: {listed[:200]}" if objects else None,
    )


def _read_72(path: Path, objects: dict[str, str]) -> dict[str, Node]:
    """Read MATLAB v4 to v7.2; `objects` receives the class of each variable that is an object."""
    from scipy.io import loadmat
    from scipy.io.matlab import MatlabOpaque, MatReadWarning

    with warnings.catch_warnings():
        # scipy turns a variable that breaks off into a warning and a text in its place.
        warnings.simplefilter("ignore")
        warnings.simplefilter("error", MatReadWarning)
        # Several objects have their names within them.
        warnings.filterwarnings("ignore", 'Duplicate variable name "None"')
        variables = loadmat(path, simplify_cells=True)
    for value in variables.values():
        if isinstance(value, MatlabOpaque):
            objects[_decoded(value[0]["s0"])] = _decoded(value[0]["s2"])
    return _nodes(
        (name, _node_72(value)) for name, value in variables.items() if not name.startswith("__")
    )


def _decoded(name: object) -> str:
    return name.decode("utf-8", "replace") if isinstance(name, bytes) else str(name)


def _nodes(pairs: Iterable[tuple[Any, Node | None]]) -> dict[str, Node]:
    """Variables or fields by name, without those of which no log is made."""
    return {str(name): node for name, node in pairs if node is not None}


def _node_72(value: Any) -> Node | None:
    """Translate a variable that scipy has read; None for what no log is made of (sparse,
    complex, objects).
    """
    if isinstance(value, str):
        return str(value)
    if isinstance(value, dict):
        return _nodes((name, _node_72(item)) for name, item in value.items())
    if isinstance(value, list):
        return [
            "" if node is None or (isinstance(node, list) and not node) else node
            for node in map(_node_72, value)
        ]
    array = np.asarray(value)
    if array.dtype.kind in "OU" and array.ndim == 1:
        return _node_72(array.tolist())
    return _numbers(array)


def _numbers(array: Any) -> Node | None:
    """Squeeze an array to a number, a vector or a matrix; None for one that is empty or not
    real.
    """
    if array.dtype.kind not in "biuf" or array.size == 0:
        return None
    squeezed: Signal = np.asarray(array.squeeze(), dtype=np.float64)
    return float(squeezed) if squeezed.ndim == 0 else squeezed


def _read_73(path: Path, objects: dict[str, str]) -> dict[str, Node]:
    """Read MATLAB v7.3, which is HDF5; `objects` receives the class of each variable that is an
    object.
    """
    try:
        import h5py
    except ImportError as fault:
        raise LogError(
            f"{path.name}: a MATLAB v7.3 file was found, which takes h5py to read; h5py is not "
            f"installed; run "
            f"{installation('h5py')} or save the file with `save -v7`."
        ) from fault
    with h5py.File(path, "r") as file:
        objects |= {
            str(name): _decoded(item.attrs.get("MATLAB_class", b"object"))
            for name, item in file.items()
            if "MATLAB_object_decode" in item.attrs
        }
        return _nodes_73(path, file, file, 0)


def _nodes_73(path: Path, file: Any, group: Any, depth: int) -> dict[str, Node]:
    """Read a struct; `#refs#` and `#subsystem#` are MATLAB's own."""
    return _nodes(
        (name, _node_73(path, file, group[name], depth + 1))
        for name in group
        if not name.startswith("#")
    )


def _node_73(path: Path, file: Any, item: Any, depth: int) -> Node | None:
    """Read one variable; HDF5 holds the dimensions in the reverse order, and characters as
    UTF-16, one text in a row.
    """
    if depth > DEPTH_MAX:
        return None
    if not hasattr(item, "dtype"):
        return _nodes_73(path, file, item, depth)
    if (
        item.size is None
        or item.attrs.get("MATLAB_empty", 0)
        or "MATLAB_object_decode" in item.attrs
    ):
        return None
    require_numbers(path, item.size)
    if "ref" in (item.dtype.metadata or {}):  # a cell array
        cells = (
            _node_73(path, file, file[reference], depth + 1)
            for reference in np.asarray(item).T.ravel()
        )
        return ["" if cell is None else cell for cell in cells]
    array = np.asarray(item).T
    if item.attrs.get("MATLAB_class") != b"char":
        return _numbers(array)
    rows = [
        row.astype("<u2").tobytes().decode("utf-16-le", "replace").rstrip()
        for row in np.atleast_2d(array)
    ]
    return rows[0] if len(rows) == 1 else [*rows]


def _with_signals(tree: Mapping[str, Node]) -> dict[str, Node]:
    """The tree with the signals of Simulink, and with time and data of time series saved as
    structs, as named vectors.

    Each element of an array of structs is a struct of its own, counted from 1 as in MATLAB.
    """
    whole: dict[str, Node] = {}
    for name, node in tree.items():
        parts = (
            {key.casefold(): item for key, item in node.items()} if isinstance(node, dict) else {}
        )
        signals, time, data = parts.get("signals"), parts.get("time"), parts.get("data")
        structs = [
            item
            for item in (signals if isinstance(signals, list) else [signals])
            if isinstance(item, dict)
        ]
        if isinstance(time, np.ndarray) and structs:
            labelled: dict[str, Node] = {"time": time}
            labelled |= {
                str(item.get("label") or name): item["values"]
                for item in structs
                if "values" in item
            }
            whole[name] = labelled
        elif isinstance(time, np.ndarray) and isinstance(data, np.ndarray) and data.ndim == 1:
            whole |= {"time": whole.get("time", time), name: data}
        elif isinstance(node, list) and any(isinstance(item, dict) for item in node):
            whole |= {
                f"{name}({k})": item for k, item in enumerate(node, 1) if isinstance(item, dict)
            }
        else:
            whole[name] = node
    return whole


def _scopes(place: str, nodes: Mapping[str, Node]) -> Iterator[tuple[str, Mapping[str, Node]]]:
    """Yield place and content of the top level, its structs and the structs in those."""
    yield place, nodes
    for name, node in nodes.items():
        if isinstance(node, dict) and place.count(".") < 1:
            yield from _scopes(f"{place}.{name}".strip("."), node)


def _named(nodes: Mapping[str, Node], keys: Sequence[str]) -> Iterator[Node]:
    """Yield the nodes under one of the keys, in any case."""
    return (node for name, node in nodes.items() if name.casefold() in keys)


def _texts(node: Node) -> list[str]:
    """Take a list of texts; nothing for any other node."""
    texts = (
        [item.strip() for item in node if isinstance(item, str)] if isinstance(node, list) else []
    )
    return texts if isinstance(node, list) and len(texts) == len(node) else []


def _leaves(place: str, nodes: Mapping[str, Node]) -> Iterator[_Leaf]:
    """Yield vectors, lists of texts, and the columns of matrices that a list names; their rows
    where only these fit.
    """
    names = next(filter(None, map(_texts, _named(nodes, NAMES))), [])
    for name, node in nodes.items():
        if isinstance(node, np.ndarray) and node.ndim == 2 and len(names) in node.shape:
            rows = node.T if node.shape[1] == len(names) else node
            matrix = f"{place}.{name}".strip(".")
            yield from (
                _Leaf(matrix, key, np.ascontiguousarray(row))
                for key, row in zip(names, rows, strict=True)
            )
        elif isinstance(node, np.ndarray) and node.ndim == 1:
            yield _Leaf(place, name, node)
        elif name.casefold() not in (*NAMES, *UNITS) and (texts := _texts(node)):
            yield _Leaf(place, name, texts)


def _runs(leaves: Sequence[_Leaf]) -> dict[str, tuple[str, int]]:
    """Place and number of rows of each run, by its name: those that hold the velocity, or else
    the displacement.
    """
    runs = [
        {leaf.run: leaf.name for leaf in reversed(leaves) if recognise(Header(leaf.name)) == motion}
        for motion in ("velocity", "displacement")
    ]
    found = dict(reversed(max(runs, key=len).items()))
    labels = [place or name for (place, _), name in found.items()]
    return {
        label if labels.count(label) == 1 else f"{label} ({run[1]} rows)": run
        for label, run in zip(labels, found, strict=True)
    }


def _columns(leaves: Sequence[_Leaf], run: tuple[str, int] | None) -> dict[str, Signal | list[str]]:
    """Take the columns as long as those of the run, or as most vectors; their place comes before
    names that stand twice.
    """
    counts = Counter(len(leaf.column) for leaf in leaves if isinstance(leaf.column, np.ndarray))
    rows = run[1] if run is not None else max(counts, key=lambda n: (counts[n], n), default=0)
    kept = [leaf for leaf in leaves if len(leaf.column) == rows]
    times = Counter(leaf.name for leaf in kept)
    return {
        f"{leaf.place}.{leaf.name}"
        if leaf.place and times[leaf.name] > 1
        else leaf.name: leaf.column
        for leaf in kept
    }


def _units(scopes: Iterable[Mapping[str, Node]], columns: Sequence[str]) -> dict[str, str]:
    """Find the units: a struct with the columns' names, or a list parallel to the names or to
    the columns.
    """
    units: dict[str, str] = {}
    for nodes in scopes:
        names = next(filter(None, map(_texts, _named(nodes, NAMES))), list(columns))
        for node in _named(nodes, UNITS):
            if isinstance(node, dict):
                units |= {name: unit for name, unit in node.items() if isinstance(unit, str)}
            elif len(_texts(node)) == len(names):
                units |= dict(zip(names, _texts(node), strict=True))
    return {name: unit for name, unit in units.items() if unit}


def _export(where: str, objects: Mapping[str, str]) -> str:
    """Explain how to export the first of some MATLAB objects."""
    name, kind = next(iter(objects.items()))
    usual = "save('run.mat', '-struct', 's') with a struct s of vectors"
    more = f" and {len(objects) - 1} more objects" if len(objects) > 1 else ""
    return (
        f"{where}: holds {name!r}, a {kind}{more}, which only MATLAB can read; expected vectors "
        f"of one length or a struct of "
        f"them; export it in MATLAB by {_EXPORTS.get(kind, usual).format(name)}."
    )
