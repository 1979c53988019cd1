"""Options and arguments of all commands, in their groups of the help, and the completion of
their values in a shell.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from winchcascade.cli.outputs import Outputs
from winchcascade.core.errors import OptionError
from winchcascade.report.render.terminal import QUIET

if TYPE_CHECKING:
    from typer._click import Context, HelpFormatter

INPUT, EVALUATION, OUTPUTS, OTHER = "Input", "Evaluation", "Outputs", "Other"
"""Groups of options in the help."""


# ------------------------------------------------------------------------------------- completion
def names_in(place: str) -> Callable[[str], list[str]]:
    """What completes a name by those in a collection, whose module is imported when a shell
    asks.
    """

    def starting(incomplete: str) -> list[str]:
        return [
            name for name in resolve_name(f"winchcascade.{place}") if name.startswith(incomplete)
        ]

    return starting


RIGS, TABLES = names_in("core.rig_toml:BUILT_IN"), names_in("tables.table_file:BUILT_IN")
"""What completes the names of the built-in rigs and tables."""


def effect_names(incomplete: str) -> list[tuple[str, str]]:
    """Effects that start like this, each with what is unmodelled without it."""
    from winchcascade.rig.effects.catalogue import EFFECTS

    return [
        (name, effect.summary) for name, effect in EFFECTS.items() if name.startswith(incomplete)
    ]


def effect_fields(incomplete: str) -> list[str]:
    """Fields of effects that start like this, up to their values."""
    from winchcascade.rig.effects.catalogue import EFFECTS

    fields = (
        f"{name}.{field.name}=" for name, effect in EFFECTS.items() for field in effect.fields
    )
    return [field for field in fields if field.startswith(incomplete)]


# ---------------------------------------------------------------------------------------- options
def option(
    flag: str,
    value: str,
    text: str,
    panel: str = EVALUATION,
    *,
    names: Callable[[str], Sequence[Any]] | None = None,
    minimum: float | None = None,
) -> Any:
    """An option: its flag, what the help calls its value (empty for a switch), the help and the
    group.

    Parameters
    ----------
    names : what a shell completes the value from
    """
    return typer.Option(
        flag, metavar=value or None, help=text, autocompletion=names, min=minimum, rich_help_panel=panel,
        show_default=False,
    )  # fmt: skip


def argument(name: str, text: str, names: Callable[[str], Sequence[Any]] | None = None) -> Any:
    """An argument: what the help calls it, the help, and what a shell completes it from."""
    return typer.Argument(metavar=name, help=text, show_default=False, autocompletion=names)


LOG = argument("LOG", "The log: CSV, .lvm, TDMS, MATLAB, NetCDF, Parquet or Excel.")
"""The argument of a single log."""

_TABLE = "The published table: a table file, or the built-in hsu2026-table2."

OPTIONS: dict[str, Any] = {
    "campaign": argument("CAMPAIGN", "The campaign: a campaign.toml, or the folder that holds one."),
    "targets": argument("TARGET...", "The logs: a campaign.toml, a folder, a pattern, or single "
                                     "logs."),
    "results": argument(
        "RESULTS|CAMPAIGN", "The results: a campaign, the folder of a batch, or the JSON of a "
                            "reduction."
    ),
    "table": argument("TABLE", _TABLE, TABLES),
    "a": argument("A", "The first side: a campaign, the folder of a batch, the JSON of a "
                       "reduction, or a log."),
    "b": argument("B", "The second side, of the same kinds."),
    "trial": argument("DIR", "The folder of a trial that `blind deal` has made, or of campaigns "
                             "with a truth.json each."),
    "rig": option(
        "--rig", "RIG", "Use this rig file, or the built-in rig hsu2026 (the default) or "
                        "kitepower.", INPUT, names=RIGS
    ),
    "load_ohm": option("--load-ohm", "OHM", "Set the load resistance in ohms; inf means an open "
                                            "circuit.", INPUT),
    "sheet": option(
        "--sheet", "NAME|NUMBER", "Read this sheet of a workbook, this run of a MATLAB file, or "
                                  "this TDMS group.", INPUT
    ),
    "profile": option(
        "--profile", "FILE",
        "Take the line motion from this CSV file with the columns time_s and velocity_mps instead "
        "of a log.", INPUT,
    ),
    "simulated": option(
        "--simulated", "FOLDER", "Compare the logs with your own simulation: files of the same "
                                 "names in this folder.", INPUT
    ),
    "against": option("--against", "TABLE", _TABLE, INPUT, names=TABLES),
    "repairs": option(
        "--repairs", "on|off",
        "Repair the faults of the log (on), or keep what was logged and list what would be "
        "repaired (off).",
    ),
    "window": option(
        "--window", "RULE",
        "Integrate over this window: auto, payout, or a length in seconds. By default the rule of "
        "the rig file applies.",
        names=lambda incomplete: [rule for rule in ("auto", "payout") if rule.startswith(incomplete)],
    ),
    "withhold": option(
        "--withhold", "LOAD", "Hold the logs of this load [ohm, or inf] out of choice and fit; "
                              "repeat it for several."
    ),
    "suspect": option(
        "--suspect", "EFFECT",
        "Suspect only this effect; repeat it for several. By default the whole catalogue is "
        "suspected.", names=effect_names,
    ),
    "effects": option(
        "--with", "EFFECT.FIELD=VALUE",
        "Apply an effect to the model; repeat it for several. `winchcascade effects` lists them.", names=effect_fields,
    ),
    "sensors": option("--sensors", "", "Add the errors of the sensors that the rig file states to "
                                       "what the sensors read."),
    "same_sensors": option(
        "--same-sensors", "", "Share the gains of the sensors between A and B, so that their "
                              "errors cancel."
    ),
    "max_drop": option("--max-drop", "X", "Exit with code 1 if eta_pto of a run drops by more "
                                          "than X, such as 0.01."),
    "current_limit": option("--current-limit", "A", "Largest stator current, rms [A]."),
    "speed_limit": option("--speed-limit", "RPM", "Largest speed of the generator [rpm]."),
    "tension_limit": option("--tension-limit", "N", "Largest line tension [N]."),
    "same_logs": option("--same-logs", "", "The table was made from these logs: allow rounding "
                                           "alone."),
    "tolerance": option(
        "--tolerance", "PART=FACTOR",
        "Multiply a part of the tolerance, which is rounding, deviation or uncertainty, by a "
        "factor.",
    ),
    "physics": option("--physics", "", "Also compare the table with the model of a rig; this "
                                       "takes some seconds."),
    "cases": option("--cases", "N", "Generate this number of campaigns.", minimum=1),
    "seed": option("--seed", "N", "Set the seed; the same seed gives the same result.", minimum=0),
    "jobs": option("--jobs", "N", "Work with N processes; by default with one for each processor.", minimum=1),
    "threads": option("--jobs", "N", "Work with N threads; by default with one for each processor.", minimum=1),
    "scheduler": option("--scheduler", "ADDRESS", "Send the work to this Dask scheduler, such as "
                                                  "tcp://host:8786."),
    "out": option(
        "--out", "FOLDER", "Write the results into this folder. A second call keeps the results "
                           "that are still valid.", OUTPUTS
    ),
    "json": option("--json", "FILE", "Write the result as JSON; - prints the JSON and nothing "
                                     "else.", OUTPUTS),
    "html": option("--html", "FILE", "Write the report as one self-contained page.", OUTPUTS),
    "pdf": option("--pdf", "FILE", "Write the report as PDF.", OUTPUTS),
    "figures": option(
        "--figures", "FOLDER", "Write each figure of the report into this folder as SVG, PDF and "
                               "PNG.", OUTPUTS
    ),
    "tables": option(
        "--tables", "FOLDER", "Write each table of the report into this folder as CSV, LaTeX and "
                              "Markdown.", OUTPUTS
    ),
    "parquet": option("--parquet", "FOLDER", "Write cycles, bins and findings as Parquet files "
                                             "into this folder.", OUTPUTS),
    "loss_map": option(
        "--loss-map", "FILE", "Write the loss of a stage as a map over motion and load to .csv, "
                              ".mat or .json.",
        OUTPUTS,
    ),
    "reports": option(
        "--reports", "none|html|all",
        "Write reports of each log and of the campaign: none, html (pages, the default), or all "
        "(pages and PDF).", OUTPUTS,
        names=names_in("batch.run_batch:REPORTS"),
    ),
    "excel": option("--excel", "", "Also write the tables as an Excel workbook.", OUTPUTS),
    "predictions": option(
        "--predictions", "FOLDER",
        "Write what the model predicts for the held-out logs, without and with the causes, into "
        "this folder.", OUTPUTS,
    ),
    "write": option("--write", "RIG.toml", "Write a rig file that contains the named causes as "
                                           "effects.", OUTPUTS),
    "validation": option(
        "--validation", "FILE", "Write the validation by ASME V&V 20 as a page of its own, as "
                                ".html or .pdf.", OUTPUTS
    ),
    "export": option("--export", "FILE", "Write the corrected model: its numbers as .json or "
                                         ".mat, or an .fmu.", OUTPUTS),
    "junit": option("--junit", "FILE", "Write the result as JUnit XML for a test server.", OUTPUTS),
    "github": option("--github", "", "Also print annotations for GitHub.", OUTPUTS),
    "quiet": option("--quiet", "", "Print only what fails.", OTHER),
    "force": option("--force", "", "Replace existing files, also those that another program wrote.", OUTPUTS),
}  # fmt: skip
"""What the parameters of all commands are on the command line, by their names."""


def with_options(*outputs: str, **own: Any) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give the parameters of a command their options and arguments from `OPTIONS`, by their names,
    and --quiet.

    Parameters
    ----------
    outputs : options in the place of the parameter `outputs`, besides `force`; it gets the files
        that they name
    own : what a parameter of this command is instead
    """

    def decorated(command: Callable[..., None]) -> Callable[..., None]:
        def run(**values: Any) -> None:
            QUIET.set(values.pop("quiet"))
            if outputs:
                paths = {name: path for name in outputs if (path := values.pop(name)) is not None}
                values["outputs"] = Outputs(paths, values.pop("force"))
            command(**values)

        parameters: list[inspect.Parameter] = []
        for parameter in inspect.signature(command, eval_str=True).parameters.values():
            if parameter.name == "outputs":
                parameters += [_parameter(name, Path | None, None, own) for name in outputs]
                parameters.append(_parameter("force", bool, False, own))
            else:
                parameters.append(
                    _parameter(parameter.name, parameter.annotation, parameter.default, own)
                )
        parameters.append(_parameter("quiet", bool, False, own))
        run.__doc__, run.__annotations__ = command.__doc__, {}
        run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]  # what typer reads
        return run

    return decorated


def _parameter(name: str, kind: Any, default: object, own: Mapping[str, Any]) -> inspect.Parameter:
    annotation = Annotated[kind, own.get(name) or OPTIONS[name]]
    return inspect.Parameter(
        name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation
    )


# ------------------------------------------------------------------------------------------- help
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


# ----------------------------------------------------------------------------------------- values
def check_load(load_ohm: float | None) -> None:
    """Reject a load that is no resistance; OptionError describes what is expected."""
    if load_ohm is not None and not load_ohm > 0:
        raise OptionError(
            f"--load-ohm {load_ohm:g}: expected a number of ohms above 0, or inf for an open "
            f"circuit."
        )


def named_number(option: str) -> tuple[str, float]:
    """Name and number of an option NAME=NUMBER; NaN without a number."""
    name, _, number = option.partition("=")
    try:
        return name.strip(), float(number)
    except ValueError:
        return name.strip(), math.nan


def numbers(flag: str, text: str | None) -> Sequence[float]:
    """Numbers of an option that are separated by commas; OptionError, before long work begins,
    for one that is not above 0.
    """
    try:
        found = [float(number) for number in text.split(",")] if text is not None else []
    except ValueError:
        found = [math.nan]
    if not all(number > 0.0 for number in found):
        raise OptionError(
            f"{flag} {text}: expected numbers above 0 separated by commas, such as 9,18,36."
        )
    return found
