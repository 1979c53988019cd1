"""The list of commands in a help text."""

from __future__ import annotations

from typing import TYPE_CHECKING

from typer.core import TyperGroup

if TYPE_CHECKING:
    from typer._click import Context, HelpFormatter


class CommandList(TyperGroup):
    """Commands whose list in the help shows the first sentence of each, whole."""

    def format_commands(self, ctx: Context, formatter: HelpFormatter) -> None:
        """Write names and sentences."""
        found = {name: self.get_command(ctx, name) for name in self.list_commands(ctx)}
        helps = {name: " ".join((command.help or "").split()) for name, command in found.items() if command is not None}
        with formatter.section("Commands"):
            formatter.write_dl([(name, f"{text.split('. ')[0].rstrip('.')}.") for name, text in helps.items()])
