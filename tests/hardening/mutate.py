"""Mutations: whole files made into damaged, lying and nonsensical ones, each from one number that makes it again."""

import random
import re
import struct
from collections.abc import Callable, Sequence

from seeds import SEEDS, seeds, unzipped, zipped

ZIPPED = b"PK\x03\x04"
MAX_BYTES = 400_000
"""No mutation is larger: what a size alone does is tested on its own."""

WORDS = [
    b"\0", b"\0" * 64, b'"', b"'", b",", b";", b"\t", b"|", b"\n", b"\r", b"\r\n", b"\n\n", b"-", b"e9", b"NaN", b"nan", b"inf",
    b"-inf", b"1e999", b"-1e308", b"1e308", b"9" * 20, b"9" * 400, b"0x10", b"1e-320", b"\xff", b"\xfe\xff", b"\xef\xbb\xbf",
    b"\xff\xfe", b"\x1a", b"\x1b[31m", b"OVL", b" ", b"Time (s),", b"Velocity (m/s)", b"Vdc (V),", b"(", b")", b"[", b"]", b"{",
    b"}", b"[[run]]", b"[[row]]", b"=", b" = ", b":", b"#", b"2026-01-01 00:00:00", b"24:61:61", b"31.02.2026 25:00:00",
    b"0000-00-00 00:00:00", b"9999-12-31 23:59:59.9", b"***End_of_Header***\n", b"\xa4\xa4", b"\xe2\x88\x92", b"true", b"-1",
    b"0", b"null", b"\\u0000", b"\\ud800", b"[]", b"{}", b'""', b"1979-05-27T07:32:00Z", b"07:32:00", b"1_000", b"0o7",
]  # fmt: skip
"""What readers stumble over, put in as it is."""

NUMBERS = [
    b"0", b"-0.0", b"-1", b"1e308", b"-1e308", b"1e-320", b"1e999", b"nan", b"inf", b"-inf", b"9" * 19, b"9" * 30, b"9" * 5000,
    b"1e15", b"1e40", b"0.1", b"1" + b"0" * 309, b"2147483648", b"-9223372036854775809", b"18446744073709551616", b"1e-12",
]  # fmt: skip
"""What stands in place of a number of a text."""

WHOLE = [*range(8), 127, 128, 255, 256, 0x7FFF, 0xFFFF, 0x10000, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 1 << 40, 1 << 63]
"""What stands in place of a length of a header."""

_NUMBER = re.compile(rb"(?<![\w.])-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")

Change = Callable[[bytearray, random.Random], None]


def _place(data: Sequence[int], chance: random.Random) -> int:
    """A place: anywhere, or near the beginning or the end, where headers and footers stand."""
    near = min(len(data), chance.choice((64, 400, 2000)))
    where = chance.random()
    if where < 0.45:
        return chance.randrange(len(data))
    return chance.randrange(near) if where < 0.8 else len(data) - 1 - chance.randrange(near)


def flip(data: bytearray, chance: random.Random) -> None:
    """Change one bit or one byte."""
    at = _place(data, chance)
    data[at] = data[at] ^ (1 << chance.randrange(8)) if chance.random() < 0.5 else chance.randrange(256)


def put(data: bytearray, chance: random.Random) -> None:
    """Put a word in, or over what is there."""
    at, word = _place(data, chance), chance.choice(WORDS)
    data[at : at + chance.choice((0, 0, len(word)))] = word


def cut(data: bytearray, chance: random.Random) -> None:
    """Take a span out."""
    at = _place(data, chance)
    del data[at : at + chance.choice((1, 2, 4, 8, 50, 500, 5000))]


def end(data: bytearray, chance: random.Random) -> None:
    """Cut the end off, or fill it with zeros as a loss of power does."""
    lost = chance.randrange(len(data)) if chance.random() < 0.5 else min(chance.randrange(1, 200), len(data) - 1)
    del data[len(data) - lost :]
    if chance.random() < 0.3:
        data += bytes(lost)


def again(data: bytearray, chance: random.Random) -> None:
    """Repeat a span at another place."""
    at, size = _place(data, chance), chance.choice((1, 4, 8, 40, 400, 4000, 20_000))
    data[_place(data, chance) : 0] = data[at : at + size]


def splice(data: bytearray, chance: random.Random) -> None:
    """Put a span of another file in, of any kind; now and then the second half of it."""
    other = chance.choice(seeds(chance.choice(list(SEEDS))))
    at = chance.randrange(len(other))
    if chance.random() < 0.3:
        data[_place(data, chance) :] = other[at:]
    else:
        data[_place(data, chance) : 0] = other[at : at + chance.choice((8, 100, 2000))]


def number(data: bytearray, chance: random.Random) -> None:
    """Put another number in place of one of the text."""
    low = chance.randrange(max(1, len(data) - 4000)) if chance.random() < 0.6 else 0
    found = list(_NUMBER.finditer(bytes(data[low : low + 4000])))
    if found:
        place = chance.choice(found)
        data[low + place.start() : low + place.end()] = chance.choice(NUMBERS)


def whole(data: bytearray, chance: random.Random) -> None:
    """Put another whole number of 2, 4 or 8 bytes in, of either byte order, or add to the one that is there."""
    form = chance.choice(("<H", "<I", "<I", "<Q", ">I", "<d"))
    size = struct.calcsize(form)
    at = _place(data, chance) // chance.choice((1, size)) * 1
    if at + size > len(data):
        return
    if form == "<d":
        struct.pack_into(form, data, at, chance.choice((0.0, -1.0, 1e308, -1e308, float("nan"), float("inf"), 1e-320)))
        return
    top = 1 << (8 * size)
    old = struct.unpack_from(form, data, at)[0]
    value = chance.choice(WHOLE) if chance.random() < 0.6 else old + chance.choice((-8, -1, 1, 8, 1000, len(data)))
    struct.pack_into(form, data, at, value % top)


def lines(data: bytearray, chance: random.Random) -> None:
    """Move a line, repeat it, take it out, or join it to the next."""
    rows = bytes(data).split(b"\n")
    at, kind = chance.randrange(len(rows)) if chance.random() < 0.5 else 0, chance.randrange(4)
    row = rows.pop(min(at, len(rows) - 1))
    if kind < 2:
        rows.insert(chance.randrange(len(rows) + 1), row)
    if kind == 1:
        rows.insert(chance.randrange(len(rows) + 1), row)
    if kind == 3 and rows:
        rows[min(at, len(rows) - 1)] = row + rows[min(at, len(rows) - 1)]
    data[:] = b"\n".join(rows)


def sign(data: bytearray, chance: random.Random) -> None:
    """Exchange one sign for another in all the file."""
    old, new = chance.sample((b",", b";", b"\t", b".", b" ", b"-", b"(", b'"', b"=", b"[", b"1", b"0", b":"), 2)
    data[:] = bytes(data).replace(old, new)


BYTES: tuple[Change, ...] = (flip, flip, put, cut, end, again, splice, whole, whole, whole)
TEXT: tuple[Change, ...] = (flip, put, put, cut, end, again, splice, number, number, lines, lines, sign, sign)
TOML: tuple[Change, ...] = (flip, put, cut, end, again, splice, *[number] * 5, lines, lines, sign)
CHANGES = dict.fromkeys(("tdms", "mat", "mat73", "parquet", "excel", "xls"), BYTES)
CHANGES |= dict.fromkeys(("rig", "campaign", "table"), TOML)
"""By the kind of file, what is done to it; to text where nothing is said."""


def mutated(form: str, seed: int) -> bytes:
    """The file of a kind that a number makes; the same one at every call."""
    chance = random.Random(f"{form} {seed}")
    start = chance.choice(seeds(form))
    if start.startswith(ZIPPED) and chance.random() < 0.7:
        return _changed_inside(start, chance)
    return _changed(start, CHANGES.get(form, TEXT), chance)


def _changed(start: bytes, changes: Sequence[Change], chance: random.Random) -> bytes:
    data = bytearray(start)
    for _ in range(chance.choice((1, 1, 1, 2, 3, 5, 20))):
        chance.choice(changes)(data, chance)
        del data[MAX_BYTES:]
        data = data or bytearray(b"x")
    return bytes(data)


def _changed_inside(start: bytes, chance: random.Random) -> bytes:
    """A zipped file with one part changed and whole checksums, so that the damage comes through to the reader."""
    parts = unzipped(start)
    name = max(parts, key=lambda part: len(parts[part])) if chance.random() < 0.6 else chance.choice(list(parts))
    if chance.random() < 0.1:
        del parts[name]
    else:
        parts[name] = _changed(parts[name], TEXT, chance)
    return zipped(parts)
