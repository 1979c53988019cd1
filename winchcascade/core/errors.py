"""Exceptions of the package: each message states in one sentence where, what was found, what was
expected and what to do.
"""

from collections.abc import Iterable, Sequence
from typing import NoReturn

from winchcascade.core.plain_text import one_line

_LONGEST, _END = 2000, 500
"""Letters of the longest sentence, and those of its end, which contains what to do."""


class WinchcascadeError(Exception):
    """A fault of the input or of the command, described in one sentence.

    A sentence may quote names and values from a file, which may hold anything: as text it is one
    short line without control characters.
    """

    def __init__(self, sentence: str = "") -> None:
        super().__init__(sentence)

    def __str__(self) -> str:
        """The sentence, with a question mark for each character that cannot be printed, the
        middle left out of a long one.
        """
        sentence = super().__str__()
        if len(sentence) > _LONGEST:
            sentence = f"{sentence[: _LONGEST - _END - 5]} ... {sentence[-_END:]}"
        return one_line(sentence)


class LogError(WinchcascadeError):
    """A log that cannot be used."""


class RigError(WinchcascadeError):
    """A rig file that cannot be used."""


class CampaignError(WinchcascadeError):
    """A campaign file that cannot be used."""


class OptionError(WinchcascadeError):
    """An option with a value that cannot be used."""


class OutputError(WinchcascadeError):
    """A result that cannot be written at the place that was given."""


def check_choice(call: str, given: str, known: Sequence[str], kind: str) -> None:
    """Reject what a call of the library does not know by that name: OptionError."""
    if given not in known:
        raise OptionError(
            f"{call}({given!r}): no such {kind}; expected one of {', '.join(map(repr, known))}."
        )


def check_type(call: str, given: object, expected: type | tuple[type, ...], makers: str) -> None:
    """Reject what a call of the library cannot work with: OptionError, which says what makes the
    right thing.
    """
    if not isinstance(given, expected):
        kinds = " or ".join(
            kind.__name__ for kind in (expected if isinstance(expected, tuple) else (expected,))
        )
        raise OptionError(
            f"{call}: cannot take a {type(given).__name__}; expected {kinds}, as {makers} gives it."
        )


def reject_result(call: str, what: str, given: object, kinds: Iterable[type]) -> NoReturn:
    """Reject a value that has no such view, as a plot or a report: OptionError, which names the
    results that have one.
    """
    names = ", ".join(sorted(kind.__name__ for kind in kinds if kind is not object))
    raise OptionError(
        f"{call}: {type(given).__name__} has no {what}; expected a result that has one: {names}."
    )


def first_line(fault: BaseException | None) -> str:
    """First line of the text of an exception, or its kind where it has no text."""
    return (str(fault).splitlines() or [""])[0] or type(fault).__name__
