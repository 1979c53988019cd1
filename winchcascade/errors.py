"""The named faults: each is one sentence that says where, what was found, what was expected and what to do."""


class WinchcascadeError(Exception):
    """A fault of the input or of the command, told in one sentence."""


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
