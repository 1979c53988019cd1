"""The command line: its commands, in the order in which the help lists them, and how it lists
them.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Annotated

import typer

from winchcascade.cli.options import GroupedCommand
from winchcascade.cli.outputs import show
from winchcascade.report.render.terminal import line_width

if TYPE_CHECKING:
    from collections.abc import Callable

    from typer._click import Command

_COMMANDS = {
    "init": "init_command",
    "reduce": "reduce_command",
    "batch": "batch_command",
    "check": "table_commands",
    "compare": "compare_command",
    "audit": "table_commands",
    "demo": "batch_command",
    "simulate": "model_commands",
    "calibrate": "model_commands",
    "diagnose": "diagnose_command",
    "design": "design_command",
    "sea": "sea_command",
    "plan": "design_command",
    "effects": "model_commands",
    "rig": "model_commands",
    "blind": "blind_command",
}
"""Each command's module, where its name ends in `_command`, in the order in which the help lists
them.
"""


SUMMARY = "Turn test logs of a winch-driven power take-off into energies and efficiencies, and find why model and logs differ."

HELP = 80
"""Columns of a help text in a pipe. [characters]"""


def command_line(first: str | None) -> Command:
    """The command line with the command that `first` names, or with all where it names none.

    Typer evaluates the annotations of every command that it is given, which takes longer than the
    reduction of a short log.
    """
    app = typer.Typer(
        help=SUMMARY,
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,  # markup would take [ohm] out of a text
        context_settings={
            "help_option_names": ["-h", "--help"],
            "terminal_width": line_width(HELP),
        },
    )
    app.callback()(winchcascade)
    for name in [first] if first in _COMMANDS else _COMMANDS:
        module = import_module(f"winchcascade.cli.{_COMMANDS[name]}")
        command: Callable[..., None] | typer.Typer = getattr(module, f"{name}_command")
        if isinstance(command, typer.Typer):
            app.add_typer(command, name=name)
        else:
            app.command(name, cls=GroupedCommand)(command)
    return typer.main.get_command(app)


MATTERING = ("numpy", "scipy", "numba", "pyarrow", "matplotlib", "typst")
"""Packages whose version may change a result or the look of a report."""


def versions() -> str:
    """This program's version, Python's, the platform's, and those of the packages that matter;
    none of them is imported.
    """
    import platform
    from importlib.metadata import version

    from winchcascade.core.version import __version__

    lines = [
        f"winchcascade {__version__} (Python {platform.python_version()}, {platform.platform()})"
    ]
    lines += [f"{package} {version(package)}" for package in MATTERING]
    return "\n".join(lines) + "\n"


def _version(wanted: bool) -> None:
    if wanted:
        show(versions())
        raise typer.Exit


def winchcascade(
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            callback=_version,
            is_eager=True,
            help="Print the versions of winchcascade, Python and the packages that may change a "
            "result.",
        ),
    ] = False,
) -> None:
    """Parse the options that stand before a command."""
