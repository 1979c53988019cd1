"""MATLAB files: columns, units and properties found in the tree of their variables.

scipy reads v4 to v7.2, h5py reads v7.3.
"""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.core.run import Finding, Signal
from winchcascade.ingest.dialects import Header, recognise
from winchcascade.ingest.source import LogSource, LogTable, choose, damage_reported, reject_sheet

Column: TypeAlias = "Signal | list[str]"
Node: TypeAlias = "float | str | Signal | list[Node] | dict[str, Node]"

DEPTH = 4
"""Deepest nesting that is followed: an HDF5 file may hold itself."""

_HDF5, _BEFORE_HDF5 = b"\x89HDF\r\n\x1a\n", 512
"""First bytes of HDF5, and how many MATLAB puts before them."""


def _read_72(path: Path, objects: dict[str, str]) -> dict[str, Node]:
    """Read MATLAB v4 to v7.2; `objects` receives the class of each variable that is an object."""
    from scipy.io import loadmat
    from scipy.io.matlab import MatlabOpaque, MatReadWarning

    with warnings.catch_warnings():
        # scipy turns a variable that breaks off into a warning and a text in its place.
        warnings.simplefilter("ignore")
        warnings.simplefilter("error", MatReadWarning)
        warnings.filterwarnings(
            "ignore", 'Duplicate variable name "None"'
        )  # several objects, whose names lie within them
        variables = loadmat(path, simplify_cells=True)
    for value in variables.values():
        if isinstance(value, MatlabOpaque):  # its own name and class are texts within it
            objects[_decoded(value[0]["s0"])] = _decoded(value[0]["s2"])
    variables = {name: value for name, value in variables.items() if not isinstance(value, MatlabOpaque)}
    return _nodes((name, _node_72(value)) for name, value in variables.items() if not name.startswith("__"))


def _decoded(name: object) -> str:
    return name.decode("utf-8", "replace") if isinstance(name, bytes) else str(name)


def _nodes(pairs: Iterable[tuple[Any, Node | None]]) -> dict[str, Node]:
    """Variables or fields by name, without those of which no log is made."""
    return {str(name): node for name, node in pairs if node is not None}


def _node_72(value: Any) -> Node | None:
    """Translate a variable that scipy has read; None for what no log is made of (sparse, complex, objects)."""
    if isinstance(value, str):
        return str(value)
    if isinstance(value, dict):
        return _nodes((name, _node_72(item)) for name, item in value.items())
    if isinstance(value, list):
        return ["" if node is None or (isinstance(node, list) and not node) else node for node in map(_node_72, value)]
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


def _read_73(path: Path, objects: dict[str, str]) -> dict[str, Node]:
    """Read MATLAB v7.3, which is HDF5; `objects` receives the class of each variable that is an object."""
    try:
        import h5py
    except ImportError as fault:
        raise LogError(
            f"{path.name}: a MATLAB v7.3 file was found, which takes h5py to read; h5py is not installed; run "
            "`pip install winchcascade[mat73]` or save it with `save -v7`."
        ) from fault
    with h5py.File(path, "r") as file:
        objects |= {
            str(name): _decoded(item.attrs.get("MATLAB_class", b"object"))
            for name, item in file.items()
            if "MATLAB_object_decode" in item.attrs
        }
        return _nodes_73(file, file, 0)


def _nodes_73(file: Any, group: Any, depth: int) -> dict[str, Node]:
    """Read a struct; `#refs#` and `#subsystem#` are MATLAB's own."""
    return _nodes((name, _node_73(file, group[name], depth + 1)) for name in group if not name.startswith("#"))


def _node_73(file: Any, item: Any, depth: int) -> Node | None:
    """Read one variable; HDF5 holds the dimensions in the reverse order, and characters as UTF-16, one text in a row."""
    if depth > DEPTH:
        return None
    if not hasattr(item, "dtype"):
        return _nodes_73(file, item, depth)
    if item.size is None or item.attrs.get("MATLAB_empty", 0) or "MATLAB_object_decode" in item.attrs:
        return None
    if "ref" in (item.dtype.metadata or {}):  # a cell array
        cells = (_node_73(file, file[reference], depth + 1) for reference in np.asarray(item).T.ravel())
        return ["" if cell is None else cell for cell in cells]
    array = np.asarray(item).T
    if item.attrs.get("MATLAB_class") != b"char":
        return _numbers(array)
    rows = [row.astype("<u2").tobytes().decode("utf-16-le", "replace").rstrip() for row in np.atleast_2d(array)]
    return rows[0] if len(rows) == 1 else [*rows]


NAMES = ("names", "labels", "channels", "headers", "varnames")
RATES = ("fs", "sample_rate", "samplerate", "sampling_rate")
STEPS = ("dt", "ts", "sample_time")


def open_mat(path: Path, *, table: str | None = None) -> LogSource:
    """Open a MATLAB file: vectors of one length, structs of them, or a matrix with a list of names.

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
    with damage_reported(path, "MATLAB file", "copy or save it again"):
        objects: dict[str, str] = {}
        tree = _with_elements(_with_signals((_read_73 if is_hdf5 else _read_72)(path, objects)))
    runs = _runs(tree)
    name = choose(list(runs), table, path.name, "run") if runs else None
    if name is None:
        reject_sheet(table, path.name)
    else:
        tree = runs[name]
    columns = _matrix_columns(tree) or _vectors(tree)
    if objects and not any(recognise(Header(name)) for name in columns):
        raise LogError(_export(path.name, objects))
    if not any(isinstance(column, np.ndarray) for column in columns.values()):
        raise LogError(
            f"{path.name}: none of the {len(tree)} variables is a vector of numbers; vectors of one length, a struct "
            "of them or a matrix with a cell array of names was expected; save the channels so."
        )
    units = _units(tree, list(columns))
    properties = _properties(tree)
    steps = (
        1.0 / value if name.casefold() in RATES else value
        for name, value in properties.items()
        if isinstance(value, float) and 0.0 < value < np.inf and name.casefold() in (*RATES, *STEPS)
    )
    return LogSource(
        headers=tuple(Header(name, units.get(name) or units.get(name.rpartition(".")[2])) for name in columns),
        load=partial(_load, list(columns.values()), objects),
        time_step=next(steps, None),
        properties=properties,
        table=name,
    )


def _runs(tree: Mapping[str, Node]) -> dict[str, dict[str, Node]]:
    """The runs of a file that holds several: each name with the tree without the others; nothing where there is but one.

    Runs are structs, matrices with the same names, or vectors of several lengths, in two of which the same motion is found.
    """
    motions: dict[str | None, dict[tuple[str, str, int], str]] = {"velocity": {}, "displacement": {}}
    seen: list[dict[str, Column]] = []
    for prefix, scope in _scopes(tree):
        columns = {name: column for name, node in scope.items() if (column := _column(name, node)) is not None}
        if columns and any(
            columns.keys() == one.keys() and all(np.array_equal(columns[name], one[name]) for name in columns)
            for one in seen
        ):
            continue  # a copy is no other run: an HDF5 file may hold itself
        seen.append(columns)
        names = next(_lists_of_names(scope), [])
        channels = {recognise(Header(name)) for name in names}
        for name, node in scope.items():
            if name in columns:
                motion = recognise(Header(name))
                if motion in motions:
                    motions[motion].setdefault((prefix, "", len(columns[name])), prefix or name)
            elif isinstance(node, np.ndarray) and node.ndim == 2 and len(names) in node.shape:
                for motion in channels & motions.keys():
                    motions[motion].setdefault((prefix, name, node.size), f"{prefix}.{name}".strip("."))
    found = max(motions.values(), key=len)
    times = Counter(found.values())
    return {
        label if times[label] == 1 else f"{label} ({key[2]} rows)": _without(tree, "", key, list(found))
        for key, label in found.items()
        if len(found) > 1
    }


def _without(
    tree: Mapping[str, Node], prefix: str, kept: tuple[str, str, int], runs: Sequence[tuple[str, str, int]]
) -> dict[str, Node]:
    """The tree without the structs, matrices and vectors of the other runs."""
    pruned: dict[str, Node] = {}
    for name, node in tree.items():
        place = f"{prefix}.{name}".strip(".")
        if isinstance(node, dict):
            inside = [run for run in runs if f"{run[0]}.".startswith(f"{place}.")]
            if not inside or kept in inside:
                pruned[name] = _without(node, place, kept, runs)
            continue
        rows = None if (column := _column(name, node)) is None else len(column)
        others = [run for run in runs if run[0] == prefix and run != kept]
        own = kept == (prefix, "", rows)
        if own or not any(run[1] == name if run[1] else run[2] == rows for run in others):
            pruned[name] = node
    return pruned


def _with_elements(tree: Mapping[str, Node]) -> dict[str, Node]:
    """The tree with each element of an array of structs as a struct of its own, counted from 1 as in MATLAB."""
    whole: dict[str, Node] = {}
    for name, node in tree.items():
        if isinstance(node, list) and any(isinstance(item, dict) for item in node):
            whole |= {f"{name}({k})": item for k, item in enumerate(node, 1) if isinstance(item, dict)}
        else:
            whole[name] = node
    return whole


def _texts(node: Node | None) -> list[str]:
    """Take a list of texts; nothing for any other node."""
    if not isinstance(node, list) or not all(isinstance(item, str) for item in node):
        return []
    return [str(item).strip() for item in node]


def _scopes(tree: Mapping[str, Node]) -> Iterator[tuple[str, Mapping[str, Node]]]:
    """Yield the top level, its structs and the structs in those."""
    yield "", tree
    for name, node in tree.items():
        if isinstance(node, dict):
            yield name, node
            yield from ((f"{name}.{inner}", deeper) for inner, deeper in node.items() if isinstance(deeper, dict))


def _named(scope: Mapping[str, Node], keys: Sequence[str]) -> Iterator[Node]:
    """Yield the nodes under one of the keys, in any case."""
    return (node for name, node in scope.items() if name.casefold() in keys)


def _lists_of_names(scope: Mapping[str, Node]) -> Iterator[list[str]]:
    """Yield the lists of names in a scope."""
    return filter(None, map(_texts, _named(scope, NAMES)))


def _matrix_columns(tree: Mapping[str, Node]) -> dict[str, Column]:
    """Take the columns of a matrix that a list of names fits; its rows where only these fit."""
    fitting = (
        dict(zip(names, matrix.T if matrix.shape[1] == len(names) else matrix, strict=True))
        for _, scope in _scopes(tree)
        for names in _lists_of_names(scope)
        for matrix in scope.values()
        if isinstance(matrix, np.ndarray) and matrix.ndim == 2 and len(names) in matrix.shape
    )
    return next(fitting, {})


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
        names = next(_lists_of_names(scope), list(columns))
        for node in _named(scope, ("units", "unit")):
            if isinstance(node, dict):
                units |= {name: unit for name, unit in node.items() if isinstance(unit, str)}
            elif len(_texts(node)) == len(names):
                units |= dict(zip(names, _texts(node), strict=True))
    return {name: unit for name, unit in units.items() if unit}


def _properties(tree: Mapping[str, Node]) -> dict[str, str | float]:
    """Take the numbers and texts that stand alone; those of the top level win over those in structs."""
    return {
        name: node
        for prefix, scope in reversed([*_scopes(tree)])
        if prefix.rpartition(".")[2].casefold() not in ("units", "unit")
        for name, node in scope.items()
        if isinstance(node, float | str)
    }


_EXPORTS = {
    "timetable": "writetimetable({0}, '{0}.csv')",
    "table": "writetable({0}, '{0}.csv')",
    "timeseries": "s.time = {0}.Time; s.velocity = {0}.Data; save('{0}.mat', '-struct', 's')",
}
"""How MATLAB exports an object of a class so that other programs can read it."""


def _export(where: str, objects: Mapping[str, str]) -> str:
    """Explain how to export the first of some MATLAB objects."""
    name, kind = next(iter(objects.items()))
    usual = "save('run.mat', '-struct', 's') with a struct s of vectors"
    export = _EXPORTS.get(kind, usual).format(name)
    more = f" and {len(objects) - 1} more objects" if len(objects) > 1 else ""
    return (
        f"{where}: holds {name!r}, a {kind}{more}, which only MATLAB can read; expected vectors of one length or a struct of "
        f"them; export it in MATLAB by {export}."
    )


def _with_signals(tree: Mapping[str, Node]) -> dict[str, Node]:
    """The tree with the signals of Simulink, and with time and data of time series saved as structs, as named vectors."""
    whole: dict[str, Node] = {}
    for name, node in tree.items():
        parts = {key.casefold(): item for key, item in node.items()} if isinstance(node, dict) else {}
        signals, time = parts.get("signals"), parts.get("time")
        if isinstance(time, np.ndarray) and signals is not None:
            listed = [
                signal for signal in (signals if isinstance(signals, list) else [signals]) if isinstance(signal, dict)
            ]
            named = {
                str(signal.get("label") or f"signal {k}"): signal.get("values") for k, signal in enumerate(listed, 1)
            }
            columns: dict[str, Node] = {"time": time}
            columns |= {label: values for label, values in named.items() if values is not None}
            whole[name] = columns
        elif isinstance(time, np.ndarray) and isinstance(data := parts.get("data"), np.ndarray) and data.ndim == 1:
            whole.setdefault("time", time)
            whole[name] = data
        else:
            whole[name] = node
    return whole


def _load(columns: Sequence[Column], objects: Mapping[str, str], wanted: Sequence[int], time: int | None) -> LogTable:
    """Give the wanted columns, texts as NaN, and the time column as it is; report the objects."""
    findings: tuple[Finding, ...] = ()
    if objects:
        listed = ", ".join(f"{name} ({kind})" for name, kind in objects.items())
        findings = (Finding("unknown_column", f"MATLAB objects: {listed[:200]}", "not read", count=len(objects)),)
    return LogTable(
        {i: x if isinstance(x := columns[i], np.ndarray) else np.full(len(x), np.nan) for i in wanted},
        stamps=None if time is None else columns[time],
        findings=findings,
    )
