"""Versions of the packages that a bug report should name."""

from __future__ import annotations

MATTERING = ("numpy", "scipy", "numba", "pyarrow", "matplotlib", "typst")
"""Packages whose version may change a result or the look of a report."""


def versions() -> str:
    """This program's version, Python's, the platform's, and those of the packages that matter; none of them is imported."""
    import platform
    from importlib.metadata import PackageNotFoundError, version

    from winchcascade.core.version import __version__

    lines = [f"winchcascade {__version__} (Python {platform.python_version()}, {platform.platform()})"]
    for package in MATTERING:
        try:
            found = version(package)
        except PackageNotFoundError:
            found = "not installed"
        lines.append(f"{package} {found}")
    return "\n".join(lines) + "\n"
