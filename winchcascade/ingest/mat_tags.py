"""What a MATLAB file of v4 or v5 says of its own structure, checked before a parser trusts it."""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator
from math import prod
from pathlib import Path
from typing import NamedTuple

import numpy as np

from winchcascade.errors import LogError

BYTES_LOADED = 8 * 2**30
"""Most that the variables of a file may take as numbers; compressed zeros take a thousandth of that."""

DEPTH = 8
"""Deepest nesting of matrices that is followed: a struct takes one level and its fields another."""

MATRIX, COMPRESSED = 14, 15
KINDS = frozenset({*range(1, 8), 9, 12, 13, MATRIX, COMPRESSED, 16, 17, 18})
"""Data types that an element of a v5 file may have."""

LEAVES = range(4, 16)
SPARSE, OPAQUE = 5, 17
"""Classes of a v5 matrix that hold numbers or characters and nothing nested; two that have a form of their own."""

SMALL = 10**6
"""A matrix up to this size may claim more elements than it has bytes: some writers store blank texts so."""

MOPT = re.compile(r"[01]0[0-5][012]")
"""Byte order (0 little, 1 big), a zero, the precision and the kind of a v4 variable, as one decimal number."""

HEADER_4 = 20
BYTES_4 = (8, 4, 4, 2, 2, 1)
"""Bytes of the numbers before the name of a v4 variable, and of one element by its precision."""

LONGEST_NAME = 64
"""Most bytes that the name of a v4 variable takes, its closing zero included."""

_NAME_4 = re.compile(rb"[A-Za-z]\w*\0+")


def is_v4(head: bytes) -> bool:
    """Tell a v4 file, which has no magic bytes, by the header of its first variable.

    >>> is_v4(struct.pack("<5i", 0, 500, 1, 0, 2) + b"v" + bytes(1))
    True
    >>> is_v4(b"Time (s),Velocity (m/s),Pressure (bar)")
    False
    """
    try:
        return _NAME_4.fullmatch(head[HEADER_4 : HEADER_4 + _header_4(head, 0).name]) is not None
    except (ValueError, struct.error):
        return False


def refuse_bomb(path: Path, numbers: int) -> None:
    """Compare what the variables claim to hold with what is read at most.

    Raises
    ------
    LogError
        they would take more than `BYTES_LOADED`
    """
    if 8 * numbers > BYTES_LOADED:
        raise LogError(
            f"{path.name}: its variables take {8 * numbers / 2**30:.0f} GiB; at most {BYTES_LOADED / 2**30:.0f} GiB "
            "are read; save the channels alone or cut the log into shorter files."
        )


class _Header4(NamedTuple):
    """What stands before the name of a v4 variable: type, rows, columns, whether it is complex, bytes of the name."""

    mopt: int
    rows: int
    columns: int
    imaginary: int
    name: int

    @property
    def size(self) -> int:
        """Bytes from the beginning of the header to the next one."""
        return HEADER_4 + self.name + self.rows * self.columns * (1 + self.imaginary) * BYTES_4[self.mopt // 10 % 10]


def _header_4(content: bytes, at: int) -> _Header4:
    """Read the header of a v4 variable in the byte order that it names; ValueError or struct.error where there is none."""
    for order, digit in (("<", "0"), (">", "1")):
        header = _Header4(*struct.unpack_from(f"{order}5i", content, at))
        shaped = header.rows >= 0 and header.columns >= 0 and header.imaginary in (0, 1)
        typed = MOPT.fullmatch(f"{header.mopt:04d}") and f"{header.mopt:04d}".startswith(digit)
        if shaped and typed and 2 <= header.name <= LONGEST_NAME:
            return header
    raise ValueError("no header of a variable")


def check_4(content: bytes) -> None:
    """Check that the variables of a v4 file lie within it before scipy makes room for what they claim; ValueError if not."""
    at = 0
    while at < len(content):
        at += _header_4(content, at).size
    if at > len(content):
        raise ValueError(f"variables of {at} bytes in {len(content)}")


def check_5(path: Path, content: bytes) -> None:
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
    refuse_bomb(path, size // 8)
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
    if not sound or depth > DEPTH:
        raise ValueError(f"matrix of class {of_class} with parts {kinds}")
    elements = 0 if of_class in (SPARSE, OPAQUE) else prod(map(int, np.frombuffer(parts[1], f"{order}i4")))
    if not 0 <= elements <= max(len(body), SMALL):
        raise ValueError(f"matrix of {elements} elements in {len(body)} bytes")
    for part in nested:
        _check_matrix(part, order, depth + 1)
