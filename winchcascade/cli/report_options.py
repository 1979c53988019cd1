"""Options that name the files of a report: one parameter of a command holds all of them."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

from winchcascade.cli.options import valued_option
from winchcascade.report.report_files import ReportFiles

NO_REPORT = ReportFiles()
"""The value of the parameter `report` where no file of a report is wanted."""

_OPTIONS: dict[str, Any] = {
    "html": Annotated[Path | None, valued_option("--html", "FILE", "Write the report as one self-contained page.")],
    "pdf": Annotated[Path | None, valued_option("--pdf", "FILE", "Write the report as PDF.")],
    "figures": Annotated[
        Path | None,
        valued_option(
            "--figures",
            "FOLDER",
            "Write each figure of the report into this folder as SVG, PDF and PNG, 90 mm and 190 mm wide.",
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
