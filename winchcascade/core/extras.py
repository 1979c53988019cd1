"""Optional packages, which the extras of winchcascade install: whether one is there, and how to
get it.
"""

from importlib.util import find_spec

from winchcascade.core.errors import OptionError

EXTRAS = {"h5py": "mat73", "distributed": "cluster", "pythonfmu": "fmu"}
"""The extra that installs each optional package."""


def is_installed(package: str) -> bool:
    """Whether a package can be imported, without importing it."""
    return find_spec(package) is not None


def installation(package: str) -> str:
    """The command that installs an optional package.

    >>> installation("h5py")
    'pip install "winchcascade[mat73]"'
    """
    return f'pip install "winchcascade[{EXTRAS[package]}]"'


def require(package: str, wanted: str) -> None:
    """Reject, before any work, what an optional package makes where that is absent: OptionError.

    Parameters
    ----------
    wanted : what was asked for, with which the sentence begins
    """
    if not is_installed(package):
        raise OptionError(
            f"{wanted} needs {package}, which is not installed; install it with "
            f"{installation(package)}."
        )
