"""Mutations: whole files made into damaged, lying and nonsensical ones, each from one number
that makes it again.
"""

import random
import re
from collections.abc import Callable

from seeds import SEEDS, seeds, unzipped, zipped

MAX_BYTES = 400_000
"""No mutation is larger: what a size alone does is tested on its own."""

WORDS = [
    b"\0", b"\0" * 64, b'"', b"'", b",", b";", b"\t", b"|", b"\n", b"\r", b"\r\n", b"\n\n", b"NaN", b"\xff", b"\xfe\xff",
    b"\xef\xbb\xbf", b"\x1a", b"\x1b[31m", b"OVL", b" ", b"Time (s),", b"Velocity (m/s)", b"Vdc (V),", b"(", b")", b"[", b"]",
    b"[[run]]", b"[[row]]", b" = ", b":", b"#", b"2026-01-01 00:00:00", b"24:61:61", b"0000-00-00 "
                                                                                     b"00:00:00", b"\xa4\xa4",
    b"9999-12-31 23:59:59.9", b"***End_of_Header***\n", b"\xe2\x88\x92", b"true", b"\\ud800", b"{}", b'""', b"07:32:00", b"0o7",
]  # fmt: skip
"""What readers stumble over, put in as it is."""

NUMBERS = [
    b"0", b"-0.0", b"-1", b"1e308", b"-1e308", b"1e-320", b"1e999", b"nan", b"inf", b"-inf", b"9" * 19, b"9" * 30, b"9" * 5000,
    b"1e15", b"0.1", b"1" + b"0" * 309, b"2147483648", b"-9223372036854775809", b"18446744073709551616", b"1e-12",
]  # fmt: skip
"""What stands in place of a number of a text."""

WHOLE = [
    *range(8),
    127,
    128,
    255,
    256,
    0x7FFF,
    0xFFFF,
    0x7FFFFFFF,
    0x80000000,
    0xFFFFFFFF,
    1 << 40,
    1 << 63,
]
"""What stands in place of a length of a header."""

NUMBER = re.compile(rb"(?<![\w.])-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


def place(data: bytearray, chance: random.Random) -> int:
    """A place: anywhere, or near the beginning or the end, where headers and footers stand."""
    near = min(len(data), chance.choice((64, 400, 2000)))
    return chance.choice(
        (
            chance.randrange(len(data)),
            chance.randrange(near),
            len(data) - 1 - chance.randrange(near),
        )
    )


def flip(data: bytearray, chance: random.Random) -> None:
    """Change one bit or one byte."""
    at = place(data, chance)
    data[at] = (
        data[at] ^ (1 << chance.randrange(8)) if chance.random() < 0.5 else chance.randrange(256)
    )


def put(data: bytearray, chance: random.Random) -> None:
    """Put a word in, or over what is there."""
    at, word = place(data, chance), chance.choice(WORDS)
    data[at : at + chance.choice((0, len(word)))] = word


def cut(data: bytearray, chance: random.Random) -> None:
    """Take a span out, or all that follows."""
    at = place(data, chance)
    del data[at : at + chance.choice((1, 4, 8, 500, 5000, len(data)))]


def splice(data: bytearray, chance: random.Random) -> None:
    """Put a span of this file or of another one in, of any kind."""
    other = data if chance.random() < 0.5 else chance.choice(seeds(chance.choice(list(SEEDS))))
    at = chance.randrange(len(other))
    data[place(data, chance) : 0] = other[at : at + chance.choice((4, 100, 2000, 20_000))]


def number(data: bytearray, chance: random.Random) -> None:
    """Put another number in place of one of the text."""
    low = chance.randrange(max(1, len(data) - 4000)) if chance.random() < 0.6 else 0
    found = list(NUMBER.finditer(bytes(data[low : low + 4000])))
    if found:
        chosen = chance.choice(found)
        data[low + chosen.start() : low + chosen.end()] = chance.choice(NUMBERS)


def whole(data: bytearray, chance: random.Random) -> None:
    """Put another whole number of 2, 4 or 8 bytes in, or add to the one that is there."""
    size = chance.choice((2, 4, 4, 8))
    at = place(data, chance)
    old = int.from_bytes(data[at : at + size], "little")
    new = (
        chance.choice(WHOLE)
        if chance.random() < 0.6
        else old + chance.choice((-8, -1, 1, 8, 1000, len(data)))
    )
    data[at : at + size] = (new % (1 << 8 * size)).to_bytes(size, chance.choice(("little", "big")))


def lines(data: bytearray, chance: random.Random) -> None:
    """Repeat a line elsewhere, take it out, or change the line ends."""
    rows = bytes(data).split(b"\n")
    at = chance.randrange(len(rows))
    row = rows.pop(at) if chance.random() < 0.7 else rows[at]
    rows[chance.randrange(len(rows) + 1) : 0] = [row] if chance.random() < 0.7 else []
    data[:] = chance.choice((b"\n", b"\n", b"\r\n")).join(rows)


def sign(data: bytearray, chance: random.Random) -> None:
    """Exchange one sign for another in all the file."""
    old, new = chance.sample(
        (b",", b";", b"\t", b".", b" ", b"-", b"(", b'"', b"=", b"[", b"1", b"0", b":"), 2
    )
    data[:] = bytes(data).replace(old, new)


Change = Callable[[bytearray, random.Random], None]

BYTES: tuple[Change, ...] = (flip, flip, put, cut, splice, whole, whole, whole)
TEXT: tuple[Change, ...] = (flip, put, put, cut, splice, number, number, number, lines, lines, sign)
BINARY = ("tdms", "mat", "mat73", "parquet", "excel", "xls")


def mutated(form: str, seed: int) -> bytes:
    """The file of a kind that a number makes; the same one at every call."""
    chance = random.Random(f"{form} {seed}")
    start = chance.choice(seeds(form))
    if (
        start.startswith(b"PK\x03\x04") and chance.random() < 0.7
    ):  # one part alone, so that the damage comes to the reader
        parts = unzipped(start)
        name = (
            max(parts, key=lambda part: len(parts[part]))
            if chance.random() < 0.6
            else chance.choice(list(parts))
        )
        return zipped({**parts, name: changed(parts[name], TEXT, chance)})
    return changed(start, BYTES if form in BINARY else TEXT, chance)


def changed(start: bytes, changes: tuple[Change, ...], chance: random.Random) -> bytes:
    """Apply one to twenty changes."""
    data = bytearray(start)
    for _ in range(chance.choice((1, 1, 1, 2, 3, 5, 20))):
        chance.choice(changes)(data, chance)
        del data[MAX_BYTES:]
        data = data or bytearray(b"x")
    return bytes(data)
