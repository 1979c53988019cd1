"""Figures and tables of a report as files: each once, all or none, never over a file from
elsewhere.
"""

import shutil
import subprocess
from pathlib import Path

import pandas as pd
import pytest
from pypdf import PdfReader

from winchcascade.core.errors import OutputError
from winchcascade.report.content import Column, Measured, Picture, Report, Table, section
from winchcascade.report.figures.style import (
    WIDTH,
    house_style,
    label_panel,
    legend_above,
    line_entry,
    panel_figure,
)
from winchcascade.report.render.report_files import latex, latex_text, write_figures, write_tables

NAME, ENERGY, SHARE = "η_pto of {a_b} & c", 7114.9, 0.123456789

TABLE: Table[tuple[str, float]] = Table(
    "energies",
    "Means of 50 % & more.",
    [
        Column("run", lambda row: row[0]),
        Column("E_line", lambda row: Measured(row[1], 116.0, both=True), "J"),
        Column("share", lambda _: SHARE, "%", 1),
    ],
    [(NAME, ENERGY), ("=1+1", -1.0)],
    limit=1,
)


@pytest.fixture(name="report", scope="module")
def _report() -> Report:
    """A report of a table and a figure."""
    with house_style():
        figure, (ax,) = panel_figure(2.0)
        ax.plot([1.0, 2.0], [3.0, 4.0])
        label_panel(ax, "a", "Power", x="Load (Ω)", y="Power (W)")
        legend_above(figure, [line_entry(f"entry {k}") for k in range(3)])
    return Report(
        "kind",
        "Title",
        sections=[section("s", "S", TABLE, Picture("loads", "Powers.", "A plot.", lambda: figure))],
    )


def test_a_figure_is_written_once_in_three_formats(report: Report, tmp_path: Path) -> None:
    write_figures(report, tmp_path / "new", "r36 ohm")
    written = {path.name: path.read_bytes() for path in (tmp_path / "new").iterdir()}
    assert set(written) == {f"r36-ohm_loads.{ending}" for ending in ("svg", "pdf", "png")}
    page = PdfReader(tmp_path / "new" / "r36-ohm_loads.pdf").pages[0]
    assert float(page.mediabox.width) == pytest.approx(72.0 * WIDTH, abs=0.1)
    assert "entry 2" in page.extract_text()
    fonts = [font.get_object()["/BaseFont"] for font in page["/Resources"]["/Font"].values()]  # type: ignore[index]
    assert all("DejaVuSans" in font for font in fonts)
    write_figures(report, tmp_path / "new", "r36 ohm")
    assert {path.name: path.read_bytes() for path in (tmp_path / "new").iterdir()} == written


def test_a_table_in_a_file_has_all_rows_with_numbers_in_full(
    report: Report, tmp_path: Path
) -> None:
    write_tables(report, tmp_path, "log")
    assert {path.suffix for path in tmp_path.iterdir()} == {".csv", ".tex", ".md"}
    found = pd.read_csv(tmp_path / "log_energies.csv")
    assert found["E_line (J)"].tolist() == [ENERGY, -1.0]
    assert found["E_line (J), standard uncertainty"].tolist() == [116.0, 116.0]
    assert found["share (%)"].tolist() == [SHARE, SHARE]
    assert found["run"].tolist() == [NAME, "'=1+1"]


def test_special_characters_are_escaped(report: Report, tmp_path: Path) -> None:
    write_tables(report, tmp_path, "log")
    assert latex(NAME) == r"$\eta$$_{\mathrm{pto}}$ of \{a\_b\} \& c"
    assert r"\_pto of \{a\_b\} & c" in (tmp_path / "log_energies.md").read_text(encoding="utf-8")


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="no LaTeX on this system")
def test_a_table_for_latex_is_typeset(tmp_path: Path) -> None:
    page = rf"\documentclass{{article}}\usepackage{{booktabs}}\begin{{document}}{latex_text(TABLE)}\end{{document}}"
    (tmp_path / "page.tex").write_text(page, encoding="utf-8")
    subprocess.run(
        ["pdflatex", "-halt-on-error", "page.tex"], cwd=tmp_path, check=True, capture_output=True
    )


@pytest.mark.parametrize("write", [write_figures, write_tables])
def test_a_file_from_elsewhere_is_never_replaced_without_force(
    report: Report, tmp_path: Path, write: object
) -> None:
    assert callable(write)
    write(report, tmp_path, "log")
    names = sorted(path.name for path in tmp_path.iterdir())
    foreign = tmp_path / next(name for name in names if name.endswith((".md", ".png")))
    foreign.write_text("mine", encoding="utf-8")
    with pytest.raises(OutputError, match="--force"):
        write(report, tmp_path, "log")
    assert foreign.read_text(encoding="utf-8") == "mine"
    write(report, tmp_path, "log", force=True)
    assert foreign.read_bytes() != b"mine"
