"""Headers of columns: name and unit read apart, and the channel that the words of
`column_names.toml` recognise in a name.
"""

from __future__ import annotations

import re
import tomllib
import unicodedata
from functools import cache, lru_cache
from pathlib import Path

import msgspec

from winchcascade.core.channels import CHANNELS
from winchcascade.core.quantity import Unit, find_unit, read_as


class Header(msgspec.Struct, frozen=True):
    """One column as the file names it; the unit is None where the file keeps none apart from the
    name.
    """

    name: str
    unit: str | None = None


DIMENSION = {"time": "time"} | {name: channel.dimension for name, channel in CHANNELS.items()}
"""What each channel, and the time, measures."""

_HEADERS = 500
"""Number of headers whose reading is kept: a log needs each several times, and the logs of a
campaign have the same ones.
"""

_NAME_LENGTH = 120
"""Length up to which a name is read; a longer text is no name. [characters]"""

_SYMBOL_LENGTH = 2
"""Length up to which a name is a symbol, which is a channel only without further words: T_motor
is no torque. [characters]
"""

_NUMBERED_LENGTH = 5
"""Length from which a word stays a name with a number behind it, as `force2`; p1 is one of
several. [characters]
"""


class ChannelNames(msgspec.Struct, frozen=True):
    """Names of one channel as letters alone, as sets of words by one of these, and the words
    that may stand beside them.
    """

    letters: frozenset[str]
    by_word: dict[str, list[frozenset[str]]]
    beside: frozenset[str]

    def within(self, words: frozenset[str]) -> list[frozenset[str]]:
        """Names of which a header holds every word."""
        return [name for word in words for name in self.by_word.get(word, ()) if name <= words]


class ColumnNames(msgspec.Struct, frozen=True):
    """The table `column_names.toml`."""

    channels: dict[str, ChannelNames]
    anywhere: frozenset[str]
    dates: frozenset[str]
    counts: frozenset[str]
    either: frozenset[str]
    unit_decides: frozenset[str]
    at_machine: frozenset[str]
    at_drum: frozenset[str]
    warm_parts: frozenset[str]
    unit_of_name: dict[str, str]
    capitals: dict[str, str]


@cache
def column_names() -> ColumnNames:
    """Read the table of names that is shipped beside this module."""
    raw = tomllib.loads((Path(__file__).parent / "column_names.toml").read_text(encoding="utf-8"))

    def folded(text: str) -> frozenset[str]:
        return frozenset(map(letters_of, text.split()))

    channels = {}
    for channel in DIMENSION:
        by_word: dict[str, list[frozenset[str]]] = {}
        for name in raw[channel]["names"].split():
            words = [letters_of(word) for word in name.split("_")]
            by_word.setdefault(words[0], []).append(frozenset(words))
        names, beside = (folded(raw[channel][key]) for key in ("names", "beside"))
        channels[channel] = ChannelNames(names, by_word, beside)
    units = {letters_of(name): unit for name, unit in raw["unit_of_name"].items()}
    lists = {
        key: folded(words)
        for key, words in raw.items()
        if isinstance(words, str) and key != "unit_decides"
    }
    decides = frozenset(raw["unit_decides"].split())
    return ColumnNames(
        channels, unit_decides=decides, unit_of_name=units, capitals=raw["capitals"], **lists
    )


@lru_cache(_HEADERS)
def letters_of(text: str) -> str:
    """Letters and digits of a name without case and accents, by which names are compared."""
    if text.isascii():
        return "".join(c for c in text.casefold() if c.isalnum())
    return "".join(
        c for c in unicodedata.normalize("NFKD", text).casefold() if c.isalnum()
    ).replace("ı", "i")


@lru_cache(_HEADERS)
def words_of(text: str) -> frozenset[str]:
    """Words of a name, also of camelCase, without those that hold a digit: places such as AI3,
    models such as PA1.

    >>> sorted(words_of("PA1_TestMachineForce2"))
    ['force', 'machine', 'test']
    """
    spaced = _CAMEL.sub(" ", _NUMBERED.sub(" ", text))
    words = (letters_of(word) for word in re.split(r"[\W_]+", spaced))
    return frozenset(word for word in words if word and not _WITH_DIGIT.search(word))


_CAMEL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
_NUMBERED = re.compile(rf"(?<=[^\W\d_]{{{_NUMBERED_LENGTH}}})(?=\d)")
_WITH_DIGIT = re.compile(r"\d")
_NO_NAME = re.compile(r"(?:index|indexlevel0|unnamed0|column\d+)?")


def nameless(header: Header) -> bool:
    """Whether a column has no name of its own, or one that a program gave it for want of a name.

    >>> [nameless(Header(name)) for name in ("", "Unnamed: 0", "__index_level_0__", "Force")]
    [True, True, True, False]
    """
    return _NO_NAME.fullmatch(letters_of(header.name[:_NAME_LENGTH])) is not None


class ReadHeader(msgspec.Struct, frozen=True):
    """A header read apart: the name without its unit, the unit, and the bracket that is no known
    unit.
    """

    name: str
    unit: Unit | None
    unknown_unit: str | None


_BRACKETS = re.compile(r"[(\[{<]([^()\[\]{}<>]*(?:\([^()]*\))?[^()\[\]{}<>]*)[)\]}>]")
_BEFORE_UNIT = re.compile(
    r"(?<=\S)(?:\s+in\s+|\s*[/,;:_.\s]\s*|(?<=[a-z])(?=[A-Z][A-Za-z]*$))(?=\S)"
)


@lru_cache(_HEADERS)
def read_header(header: Header) -> ReadHeader:
    """Read name and unit apart: `Force [kgf]`, `Kraft / N`, `Vdc, V`, `force_kN`, `forceKn`, or
    a row of units below names.
    """
    name = (
        unicodedata.normalize("NFKC", header.name[:_NAME_LENGTH])
        .strip()
        .lstrip("#%")
        .strip()
        .strip("\"'")
    )
    bare = _BRACKETS.sub(" ", name).strip()
    if header.unit is not None and header.unit.strip():
        unit = find_unit(header.unit.strip().strip("()[]"))
        return ReadHeader(bare, unit, None if unit else header.unit.strip())
    inside = [bracket.group(1).strip() for bracket in _BRACKETS.finditer(name)]
    splits = [(bare, end) for end in inside]
    splits += [
        (n[: m.start()], n[m.end() :])
        for n in dict.fromkeys((name, bare))
        for m in _BEFORE_UNIT.finditer(n)
    ]
    units = [(start, end, unit) for start, end in splits if (unit := find_unit(end)) is not None]
    for start, _, own in units:
        if any(read_as(own, DIMENSION[channel]) for channel in candidates(start)):
            return ReadHeader(start, own, None)
    # A unit that no channel has, behind the name of one, as in `T / °F`; a lone letter, as in
    # `Force/F`, may be a name.
    measured = set(DIMENSION.values())
    foreign = (
        u for n, end, u in units if len(end) > 1 and u.dimension not in measured and candidates(n)
    )
    unit = next(filter(None, map(find_unit, inside)), None) or next(foreign, None)
    if unit is None and not inside:
        unit = next(
            (
                find_unit(u)
                for n, u in column_names().unit_of_name.items()
                if n in words_of(bare) | {letters_of(bare)}
            ),
            None,
        )
    return ReadHeader(bare, unit, None if unit or not inside else inside[-1] or None)


@lru_cache(_HEADERS)
def candidates(name: str) -> tuple[str, ...]:
    """Channels that a name may mean, with and without the words that describe where it was
    measured.

    Groups before a slash that hold a digit are places, as in `cDAQ1Mod1/Force`; other groups count
    as words, as in `/winch/tension`, so that `/wind/speed` is none.
    """
    *groups, last = re.split(r"[/\\]", name)
    if groups and find_unit(name) is not None:  # m/s is no s in a group m
        return ()
    return _named(" ".join([*(group for group in groups if not _WITH_DIGIT.search(group)), last]))


def _named(text: str) -> tuple[str, ...]:
    """Channels of which the words of a text are a name and words that may stand beside it."""
    table, words, letters = column_names(), words_of(text), letters_of(text)

    def fits(names: ChannelNames) -> bool:
        return letters in names.letters or any(
            words - name
            <= table.anywhere | (names.beside if sum(map(len, name)) > _SYMBOL_LENGTH else set())
            for name in names.within(words)
        )

    return tuple(channel for channel, names in table.channels.items() if fits(names))


@lru_cache(_HEADERS)
def recognise(header: Header) -> str | None:
    """Channel (or `time`) that a header names, None for a column that is none.

    >>> [recognise(Header(n)) for n in ("V_DC (V)", "直流電壓", "Line velocity", "Speed (rpm)", "Tension (V)")]
    ['vdc', 'vdc', 'velocity', 'speed', 'vdc']
    """
    read, table = read_header(header), column_names()
    found = candidates(read.name)
    if read.unit is not None:
        found = tuple(channel for channel in found if read_as(read.unit, DIMENSION[channel]))
    elif letters_of(read.name) in table.counts | table.either or table.unit_decides.issuperset(
        found
    ):
        return None
    elif read.name.strip() in table.capitals:
        return table.capitals[read.name.strip()]
    return found[0] if found else None
