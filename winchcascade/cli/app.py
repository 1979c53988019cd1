"""The command line put together: its commands in the order in which the help lists them."""

from __future__ import annotations

from typing import Annotated

import typer

from winchcascade.cli.batch_command import batch_command, demo_command
from winchcascade.cli.blind_command import blind
from winchcascade.cli.diagnose_command import diagnose_command
from winchcascade.cli.model_commands import calibrate_command, effects_command, rig_command, simulate_command
from winchcascade.cli.outputs import show
from winchcascade.cli.reduce_command import reduce_command
from winchcascade.cli.table_commands import audit_command, check_command

app = typer.Typer(
    help="Energies and efficiencies from the log of a winch-driven power take-off.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        from winchcascade.cli.versions import versions

        show(versions())
        raise typer.Exit


@app.callback()
def winchcascade(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Energies and efficiencies from the log of a winch-driven power take-off."""


app.command("reduce")(reduce_command)
app.command("batch")(batch_command)
app.command("check")(check_command)
app.command("audit")(audit_command)
app.command("demo")(demo_command)
app.command("simulate")(simulate_command)
app.command("calibrate")(calibrate_command)
app.command("diagnose")(diagnose_command)
app.command("effects")(effects_command)
app.command("rig")(rig_command)
app.add_typer(blind, name="blind")
