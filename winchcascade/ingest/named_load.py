"""The load that the names of logs state: a number beside a word for a resistance, or the only
number that varies.
"""

from __future__ import annotations

import re
import unicodedata
from collections import defaultdict
from collections.abc import Mapping, Sequence

import msgspec

_OPEN_CIRCUIT = re.compile(
    r"open[\W_]*circuit|no[\W_]*load|un[\W_]*loaded|leerlauf|ohne[\W_]*last|vac[ií]o|vide|vuoto"
    r"|(?<![^\W\d_])(?:oc|open|inf)(?![^\W\d_])"
)
"""Words for an open circuit, in names of small letters."""

_NUMBER = r"(?P<number>\d+(?:[.,pr]\d+)?)"
_PREFIX = {"m": 1e-3, "k": 1e3, "": 1.0}
_BY_UNIT = re.compile(rf"(?<![\d.,]){_NUMBER}[\W_]*(?P<prefix>[km]?)(?:ohms?|ω)(?![^\W\d_])")
_BY_SYMBOL = re.compile(
    rf"(?<![^\W\d_])(?:rl?|r[\W_]?load|resist(?:ance|or)|widerstand|ohm)[\W_]*{_NUMBER}(?![^\W_])"
)
_BY_WORD = re.compile(
    rf"(?<![^\W\d_])(?:load|last|charge|carga|carico|belasting)[\W_]*{_NUMBER}(?![^\W_])"
)
_ANY = re.compile(_NUMBER)


class NamedLoad(msgspec.Struct, frozen=True):
    """Load that a name states, inf for an open circuit [ohm], and how the name states it;
    `certain` with a unit or a symbol.
    """

    ohm: float
    how: str
    certain: bool


def named_loads(names: Sequence[str]) -> dict[str, NamedLoad]:
    """Loads by the names of logs, without those whose names state none.

    The only number that varies between names that are alike otherwise may be the load; so may a
    number behind a word such as `load`, which may be a share or the number of a test, and R1, R2,
    R3 may number the runs. None of these is certain.

    >>> [one.ohm for one in named_loads(["R=4,5 Ohm.csv", "run03_R018.csv", "4p5_ohm.csv", "Leerlauf.csv"]).values()]
    [4.5, 18.0, 4.5, inf]
    """
    folded = {
        name: unicodedata.normalize("NFKC", name).casefold().rsplit(".", 1)[0] for name in names
    }
    found: dict[str, NamedLoad] = {}
    for name, text in folded.items():
        stated = _stated(text)
        if stated is not None:
            found[name] = stated
    symbols = sorted(one.ohm for one in found.values() if one.how == "symbol")
    if len(symbols) > 1 and symbols == [float(k) for k in range(1, len(symbols) + 1)]:
        found = {
            name: msgspec.structs.replace(one, certain=one.how != "symbol")
            for name, one in found.items()
        }
    return found | _varying({name: text for name, text in folded.items() if name not in found})


def _stated(text: str) -> NamedLoad | None:
    """Load that a name states by a word for an open circuit, a unit, a symbol or another word."""
    for pattern, how in ((_BY_UNIT, "unit"), (_BY_SYMBOL, "symbol")):
        match = pattern.search(text)
        if match is not None:
            prefix = _PREFIX[match.groupdict().get("prefix") or ""]
            return NamedLoad(_value(match["number"]) * prefix, how, certain=True)
    if _OPEN_CIRCUIT.search(text):
        return NamedLoad(float("inf"), "open circuit", certain=True)
    match = _BY_WORD.search(text)
    return None if match is None else NamedLoad(_value(match["number"]), "word", certain=False)


def _varying(texts: Mapping[str, str]) -> dict[str, NamedLoad]:
    """The only number that differs between names that have the same words."""
    alike: dict[str, list[str]] = defaultdict(list)
    for name, text in texts.items():
        alike[_ANY.sub("#", text)].append(name)
    found: dict[str, NamedLoad] = {}
    for group in alike.values():
        numbers = [
            [_value(match["number"]) for match in _ANY.finditer(texts[name])] for name in group
        ]
        varying = [k for k, column in enumerate(zip(*numbers, strict=True)) if len(set(column)) > 1]
        if len(varying) == 1:
            found |= {
                name: NamedLoad(own[varying[0]], "only number that varies", certain=False)
                for name, own in zip(group, numbers, strict=True)
                if own[varying[0]] > 0.0
            }
    return found


def _value(number: str) -> float:
    """Value of a number with any decimal sign, also that of 4p5 and 4r5."""
    return float(re.sub("[,pr]", ".", number))
