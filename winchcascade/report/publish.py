"""A report into its files."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from winchcascade.report.report_model import Report


def publish(report: Report, *, html: Path | None, pdf: Path | None, force: bool = False) -> None:
    """Write a report as a self-contained page, as a PDF, or both; what lays out the other is not imported.

    Raises
    ------
    OutputError : a file that cannot be written, or that this tool did not write and `force` does not allow to replace
    """
    if html is not None:
        from winchcascade.report.html import write_html

        write_html(report, html, force=force)
    if pdf is not None:
        from winchcascade.report.pdf import write_pdf

        write_pdf(report, pdf, force=force)
