"""How the help lists commands and groups options; it is plain text, as markup would take [ohm]
out of a sentence.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from typer.core import TyperCommand, TyperGroup

from winchcascade.cli.options import EVALUATION, INPUT, OUTPUTS

if TYPE_CHECKING:
    from typer._click import Context, HelpFormatter


class CommandList(TyperGroup):
    """Commands whose list in the help shows the first sentence of each, whole."""

    def format_commands(self, ctx: Context, formatter: HelpFormatter) -> None:
        """Write names and sentences."""
        found = {name: self.get_command(ctx, name) for name in self.list_commands(ctx)}
        helps = {
            name: " ".join((command.help or "").split())
            for name, command in found.items()
            if command is not None
        }
        with formatter.section("Commands"):
            formatter.write_dl(
                [(name, f"{text.split('. ')[0].rstrip('.')}.") for name, text in helps.items()]
            )


class GroupedCommand(TyperCommand):
    """A command whose help lists its options in their groups."""

    def format_options(self, ctx: Context, formatter: HelpFormatter) -> None:
        """Write arguments and options with their helps, group by group."""
        groups: dict[str, list[tuple[str, str]]] = {
            name: [] for name in ("Arguments", INPUT, EVALUATION, OUTPUTS, "Other")
        }
        for parameter in self.get_params(ctx):
            row = parameter.get_help_record(ctx)
            if row is not None:
                other = "Arguments" if parameter.param_type_name == "argument" else "Other"
                groups[getattr(parameter, "rich_help_panel", None) or other].append(row)
        for name, rows in groups.items():
            if rows:
                with formatter.section(name):
                    formatter.write_dl(rows)
