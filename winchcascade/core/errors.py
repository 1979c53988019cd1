"""The named faults: each is one sentence that says where, what was found, what was expected and what to do."""

from winchcascade.core.plain_text import one_line

_LONGEST, _END = 2000, 500
"""Letters of the longest sentence, and those of its end, which says what to do."""


class WinchcascadeError(Exception):
    """A fault of the input or of the command, told in one sentence.

    A sentence may quote names and values from a file, which may hold anything: as text it is one line of a length to be
    read, which no terminal obeys.
    """

    def __str__(self) -> str:
        """The sentence, with a question mark for each character that cannot be printed, the middle left out of a long one."""
        said = super().__str__()
        if len(said) > _LONGEST:
            said = f"{said[: _LONGEST - _END - 5]} ... {said[-_END:]}"
        return one_line(said)


class LogError(WinchcascadeError):
    """A log that cannot be used."""


class RigError(WinchcascadeError):
    """A rig file that cannot be used."""


class CampaignError(WinchcascadeError):
    """A campaign file that cannot be used."""


class OptionError(WinchcascadeError):
    """An option with a value that cannot be used."""


class OutputError(WinchcascadeError):
    """A result that cannot be written where it was asked for."""
