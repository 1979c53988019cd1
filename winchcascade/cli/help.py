"""How the help lists commands and groups options; it is plain text, as markup would take [ohm]
out of a sentence.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from typer.core import TyperCommand

from winchcascade.cli.options import EVALUATION, INPUT, OTHER, OUTPUTS

if TYPE_CHECKING:
    from typer._click import Context, HelpFormatter


LONGEST_SENTENCE = 1000
"""Characters of a sentence that a list of commands shows: none is as long."""


class GroupedCommand(TyperCommand):
    """A command whose help lists its options in their groups, and which a list of commands
    describes by its first sentence.
    """

    def get_short_help_str(self, limit: int = LONGEST_SENTENCE) -> str:
        """The first sentence, whole."""
        return super().get_short_help_str(max(limit, LONGEST_SENTENCE))

    def format_options(self, ctx: Context, formatter: HelpFormatter) -> None:
        """Write arguments and options with their helps, group by group."""
        groups: dict[str, list[tuple[str, str]]] = {
            name: [] for name in ("Arguments", INPUT, EVALUATION, OUTPUTS, OTHER)
        }
        for parameter in self.get_params(ctx):
            row = parameter.get_help_record(ctx)
            if row is not None:
                other = "Arguments" if parameter.param_type_name == "argument" else OTHER
                groups[getattr(parameter, "rich_help_panel", None) or other].append(row)
        for name, rows in groups.items():
            if rows:
                with formatter.section(name):
                    formatter.write_dl(rows)
