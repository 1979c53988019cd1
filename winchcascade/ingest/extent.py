"""How far the sheets of a workbook reach by their own words, before a reader lays them out cell by cell."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, NamedTuple
from xml.parsers import expat

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

ROWS, COLUMNS = 1 << 20, 1 << 14
"""Most rows and columns that a sheet of any spreadsheet program has."""

_PIECE = 1 << 16
"""A tag is shorter than this; what is cut off at the end of a piece is kept for the next one."""

_NAMED = re.compile(rb"""<(?:\w+:)?(?:c|row)\s[^>]*?\br\s*=\s*["']\s*\$?([A-Za-z]*)\$?(\d*)""")
_PREFIXED = re.compile(rb":(?:c|row)\s")
_LONGEST = 24
"""Letters from the beginning of a tag to the end of a name of a cell that a program writes, and more."""

_TAG = re.compile(rb"<(/?)(?:\w+:)?(table|table-row|table-cell|covered-table-cell)(\s[^>]*)?>")
_REPEATED = re.compile(rb"""number-(?:rows|columns)-repeated\s*=\s*["']\s*(\d+)""")
_SHARED_TAG = re.compile(rb"<(?:\w+:)?sst\b[^>]*")
_COUNTED = re.compile(rb"""\b(?:uniqueC|c)ount\s*=\s*["']\s*(\d+)""")
_NUMBER = struct.Struct("<I")
_SHARED_TEXTS = 0x9F
"""Type of the record that begins the shared texts: BrtBeginSst."""

_ROW_HEADER, _CELLS = 0, range(1, 12)
"""Types of records of a binary sheet: BrtRowHdr, and BrtCellBlank to BrtFmlaError."""


class Corner(NamedTuple):
    """The last row and the last column of a sheet, both counted from 1; 0 without a cell."""

    rows: int
    columns: int

    @property
    def cells(self) -> int:
        """How many cells there are up to it."""
        return self.rows * self.columns

    @property
    def possible(self) -> bool:
        """Whether a spreadsheet program can make such a sheet."""
        return self.rows <= ROWS and self.columns <= COLUMNS


def named_corner(pieces: Iterable[bytes]) -> Corner:
    """Find the last row and column that the cells of a sheet of Excel are named for; (0, 0) for another part."""
    rows = columns = 0
    for piece in _whole_tags(pieces):
        corner = _plain_corner(piece) or _corner(piece)
        rows, columns = max(rows, corner.rows), max(columns, corner.columns)
    return Corner(rows, columns)


def _corner(piece: bytes) -> Corner:
    """Find the last row and column in a text of tags, however they are written."""
    seen = set(_NAMED.findall(piece))
    rows = max((int(row or 0) for _, row in seen), default=0)
    return Corner(rows, max((_column_number(letters) for letters in {letters for letters, _ in seen}), default=0))


def _plain_corner(piece: bytes) -> Corner | None:
    """Find them as `_corner` does, some times as fast, where tags are written as programs do: <c r="AB12" and <row r="12".

    None where one is written in another way.
    """
    if _PREFIXED.search(piece):
        return None
    text = np.frombuffer(piece + bytes(_LONGEST), dtype=np.uint8)
    tags = np.flatnonzero(text[: len(piece)] == ord("<"))
    rows = columns = 0
    for begin in (b"<c ", b"<row "):
        at = tags
        for k, letter in enumerate(begin[1:-1], 1):
            at = at[text[at + k] == letter]
        at = at[text[at + len(begin) - 1] <= ord(" ")]
        for k, letter in enumerate(b' r="', len(begin) - 1):
            if not (text[at + k] == letter).all():
                return None
        named = _named_at(text, at + len(begin) + 3)
        if named is None:
            return None
        rows, columns = max(rows, named.rows), max(columns, named.columns)
    return Corner(rows, columns)


def _named_at(text: NDArray[np.uint8], at: NDArray[np.intp]) -> Corner | None:
    """Find the last row and column by the names, such as AB12", that begin at these places; None where one is no such name."""
    column, row = np.zeros(at.size, dtype=np.int64), np.zeros(at.size, dtype=np.int64)
    inside, lettered = np.ones(at.size, dtype=np.bool_), np.ones(at.size, dtype=np.bool_)
    for k in range(_LONGEST - len(b'<row r="')):
        if not inside.any():
            return Corner(int(row.max(initial=0)), int(column.max(initial=0)))
        letter = text[at + k].astype(np.int64)
        lettered &= (letter >= ord("A")) & (letter <= ord("Z"))
        digit = inside & (letter >= ord("0")) & (letter <= ord("9"))
        if (inside & ~lettered & ~digit & (letter != ord('"'))).any():
            return None
        column = np.where(lettered, 26 * column + letter - ord("A") + 1, column)
        row = np.where(digit, 10 * row + letter - ord("0"), row)
        inside &= lettered | digit
    return None


def repeated_corner(pieces: Iterable[bytes]) -> Corner:
    """Find the last row and column with something in them of the sheets of LibreOffice, which repeat rows and cells.

    Raises
    ------
    ExpatError : the part is no well-formed XML; a reader would wait for the end of its table for ever
    """
    most = Corner(0, 0)
    row = column = filled = wide = times = 0
    for tag, opens, attributes in _tags(_well_formed(pieces)):
        if tag == b"table" and opens:
            row = 0
        elif tag == b"table-row" and opens:
            column = filled = 0
            times = _times(attributes)
            if attributes.endswith(b"/"):
                row += times
        elif tag == b"table-row":
            row += times
            wide = max(wide, filled)
            most = Corner(max(most.rows, row), wide) if filled else most
        elif opens:
            column += _times(attributes)
            filled = filled if attributes.endswith(b"/") and b"value" not in attributes else column
    return most


def _well_formed(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """Hand XML on piece by piece; ExpatError where it is not well-formed."""
    parser = expat.ParserCreate()
    for piece in pieces:
        parser.Parse(piece)
        yield piece
    parser.Parse(b"", True)


def binary_corner(pieces: Iterable[bytes]) -> Corner:
    """Find the last row and column with a cell of a sheet of a binary workbook ([MS-XLSB] 2.1.4 and 2.5: records of a type, a
    size and a body; a row's number begins its header, a column's its cells).

    Raises
    ------
    IndexError, struct.error : the part breaks off within a record
    ValueError : a record is too short for what it holds; a reader would take the rest from the one before
    """
    data = b"".join(pieces)
    row = rows = columns = at = 0
    while at < len(data):
        kind, at = _seven_bits(data, at, most=2)
        size, at = _seven_bits(data, at, most=4)
        if size < _NUMBER.size and (kind == _ROW_HEADER or kind in _CELLS):
            raise ValueError(f"record {kind} of {size} bytes")
        if kind == _ROW_HEADER:
            (row,) = _NUMBER.unpack_from(data, at)
        elif kind in _CELLS:
            (column,) = _NUMBER.unpack_from(data, at)
            rows, columns = max(rows, row + 1), max(columns, column + 1)
        at += size
    return Corner(rows, columns)


def texts_claimed(part: bytes) -> int:
    """How many texts the beginning of a workbook's shared texts says that they are, XML or records (BrtBeginSst); 0 if nothing.

    A reader makes room for so many before it has read one.
    """
    if part.lstrip().startswith(b"<"):
        tag = _SHARED_TAG.search(part)
        return max((int(number) for number in _COUNTED.findall(tag[0])), default=0) if tag else 0
    try:
        kind, at = _seven_bits(part, 0, most=2)
        _, at = _seven_bits(part, at, most=4)
        return max(struct.unpack_from("<II", part, at)) if kind == _SHARED_TEXTS else 0
    except (IndexError, struct.error):
        return 0


def _seven_bits(data: bytes, at: int, *, most: int) -> tuple[int, int]:
    """Read a number in groups of seven bits, the lowest first, of which all but the last are marked; and the place after it."""
    value = 0
    for k in range(most):
        value |= (data[at + k] & 0x7F) << (7 * k)
        if data[at + k] < 0x80:
            return value, at + k + 1
    return value, at + most


def _tags(pieces: Iterable[bytes]) -> Iterator[tuple[bytes, bool, bytes]]:
    """Yield the tags of tables, rows and cells: which, whether it opens one, and its attributes."""
    for piece in _whole_tags(pieces):
        for closing, tag, attributes in _TAG.findall(piece):
            yield tag.removeprefix(b"covered-"), not closing, attributes.rstrip()


def _times(attributes: bytes) -> int:
    found = _REPEATED.search(attributes)
    return int(found[1]) if found else 1


def _whole_tags(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """Yield the text of a part in pieces that end where tags end."""
    rest = b""
    for piece in pieces:
        text = rest + piece
        end = text.rfind(b">") + 1
        rest = text[end:][-_PIECE:]
        yield text[:end]
    yield rest


def _column_number(letters: bytes) -> int:
    """Count the columns up to one that is named by letters, A being 1.

    >>> _column_number(b"A"), _column_number(b"xfd")
    (1, 16384)
    """
    number = 0
    for letter in letters.upper():
        number = 26 * number + letter - 64
    return number
