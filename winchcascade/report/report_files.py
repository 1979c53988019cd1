"""Where the files of a report are written."""

from __future__ import annotations

from pathlib import Path

import msgspec


class ReportFiles(msgspec.Struct, frozen=True):
    """Files of a report: the page, the PDF, and folders for its figures and its tables; None for what is not wanted."""

    html: Path | None = None
    pdf: Path | None = None
    figures: Path | None = None
    tables: Path | None = None

    @property
    def by_option(self) -> dict[str, Path | None]:
        """The files by the options of the command line that name them."""
        return {f"--{name}": path for name, path in msgspec.structs.asdict(self).items()}

    @property
    def wanted(self) -> bool:
        """Whether anything is to be written."""
        return any(path is not None for path in self.by_option.values())
