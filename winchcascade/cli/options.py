"""Options that several commands share, the completion of their values in a shell, and the files of a report as options."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from winchcascade.core.errors import OptionError
from winchcascade.core.run import Repairs
from winchcascade.report.report_files import ReportFiles


def rig_names(incomplete: str) -> list[str]:
    """Built-in rigs that start like this."""
    from winchcascade.core.rig_toml import BUILT_IN

    return _starting(BUILT_IN, incomplete)


def table_names(incomplete: str) -> list[str]:
    """Built-in tables that start like this."""
    from winchcascade.core.table_toml import BUILT_IN

    return _starting(BUILT_IN, incomplete)


def effect_names(incomplete: str) -> list[tuple[str, str]]:
    """Effects that start like this, each with what is unmodelled without it."""
    from winchcascade.rig.effects.catalogue import EFFECTS

    return [(name, effect.summary) for name, effect in EFFECTS.items() if name.startswith(incomplete)]


def report_choices(incomplete: str) -> list[str]:
    """Choices of `--reports` that start like this."""
    from winchcascade.batch.run_batch import REPORTS

    return _starting(REPORTS, incomplete)


def _starting(names: Iterable[str], incomplete: str) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]


def valued_option(flag: str, value: str, text: str, names: Callable[[str], Sequence[Any]] | None = None) -> Any:
    """An option with a value: its flag, what the help calls the value, the help, and what a shell completes the value from."""
    return typer.Option(flag, metavar=value, help=text, autocompletion=names)


RigOption = Annotated[
    str | None,
    valued_option(
        "--rig", "RIG", "Use this rig file, or the built-in rig hsu2026 (the default) or kitepower.", rig_names
    ),
]
WindowOption = Annotated[
    str | None,
    valued_option(
        "--window",
        "RULE",
        "Integrate over this window: auto, payout, or a length in seconds. By default the rule of the rig file applies.",
    ),
]
LoadOption = Annotated[
    float | None,
    valued_option("--load-ohm", "OHM", "Set the load resistance in ohms; inf means an open circuit."),
]
SheetOption = Annotated[
    str | None,
    valued_option(
        "--sheet", "NAME|NUMBER", "Read this sheet of a workbook, this run of a MATLAB file, or this TDMS group."
    ),
]
RepairsOption = Annotated[
    Repairs,
    typer.Option(
        "--repairs",
        help="Repair the faults of the log (on), or keep what was logged and list what would be repaired (off).",
    ),
]
JsonOption = Annotated[
    str | None,
    valued_option("--json", "FILE", "Write the result as JSON; - prints the JSON and nothing else."),
]
ParquetOption = Annotated[
    Path | None,
    valued_option("--parquet", "FOLDER", "Write cycles, bins and findings as Parquet files into this folder."),
]
LossMapOption = Annotated[
    Path | None,
    valued_option(
        "--loss-map",
        "FILE",
        "Write the loss from shaft to DC link as a map over torque and speed, as .csv, .mat or .json.",
    ),
]
JobsOption = Annotated[
    int | None,
    typer.Option("--jobs", metavar="N", min=1, help="Work with N processes; by default with one for each processor."),
]
SchedulerOption = Annotated[
    str | None,
    valued_option("--scheduler", "ADDRESS", "Send the work to this Dask scheduler, such as tcp://host:8786."),
]
ForceOption = Annotated[
    bool, typer.Option("--force", help="Replace existing files, also those that another program wrote.")
]
ThreadsOption = Annotated[
    int | None,
    typer.Option("--jobs", metavar="N", min=1, help="Work with N threads; by default with one for each processor."),
]
CampaignArgument = Annotated[
    Path,
    typer.Argument(
        metavar="CAMPAIGN", help="The campaign: a campaign.toml, or the folder that holds one.", show_default=False
    ),
]


def name_argument(text: str, names: Callable[[str], Sequence[Any]]) -> Any:
    """An argument that may be left out, of which a shell completes the names."""
    return typer.Argument(metavar="[NAME]", help=text, show_default=False, autocompletion=names)


def check_load(load_ohm: float | None) -> None:
    """Reject a load that is no resistance; OptionError describes what is expected."""
    if load_ohm is not None and not load_ohm > 0:
        raise OptionError(f"--load-ohm {load_ohm:g}: expected a number of ohms above 0, or inf for an open circuit.")


def named_number(option: str) -> tuple[str, float]:
    """Name and number of an option NAME=NUMBER; NaN without a number."""
    name, _, number = option.partition("=")
    try:
        return name.strip(), float(number)
    except ValueError:
        return name.strip(), math.nan


NO_REPORT = ReportFiles()
"""The value of the parameter `report` where no file of a report is wanted."""

_OPTIONS: dict[str, object] = {
    "html": Annotated[Path | None, valued_option("--html", "FILE", "Write the report as one self-contained page.")],
    "pdf": Annotated[Path | None, valued_option("--pdf", "FILE", "Write the report as PDF.")],
    "figures": Annotated[
        Path | None,
        valued_option(
            "--figures",
            "FOLDER",
            "Write each figure of the report into this folder as SVG, PDF and PNG.",
        ),
    ],
    "tables": Annotated[
        Path | None,
        valued_option(
            "--tables", "FOLDER", "Write each table of the report into this folder as CSV, LaTeX and Markdown."
        ),
    ],
}


def report_options(*names: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command these options in the place of its parameter `report`, which gets their values as `ReportFiles`."""

    def with_options(command: Callable[..., None]) -> Callable[..., None]:
        def run(**values: Any) -> None:
            command(report=ReportFiles(**{name: values.pop(name) for name in names}), **values)

        options = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=_OPTIONS[name])
            for name in names
        ]
        parameters: list[inspect.Parameter] = []
        for parameter in inspect.signature(command, eval_str=True).parameters.values():
            own = parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY)
            parameters += options if parameter.name == "report" else [own]
        run.__doc__, run.__annotations__ = command.__doc__, {}
        run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]  # what typer reads
        return run

    return with_options
