"""Write a report into its files: one page without external files or requests, and a PDF from the
same content.
"""

from __future__ import annotations

from pathlib import Path

from winchcascade.core.files import write_content
from winchcascade.report.content import Report

ENDINGS = (".html", ".pdf")
"""Endings of the files of a report."""


def publish(
    report: Report, *, html: Path | None = None, pdf: Path | None = None, force: bool = False
) -> None:
    """Write a report as a self-contained page, as a PDF, or both, each whole or not at all.

    Raises
    ------
    OutputError : a file that cannot be written, or that this tool did not write and `force` does
        not allow to replace
    """
    from winchcascade.report.render.page import page_text
    from winchcascade.report.render.pdf import pdf_bytes

    if html is not None:
        write_content(html, page_text(report), force=force)
    if pdf is not None:
        write_content(pdf, pdf_bytes(report), force=force)
