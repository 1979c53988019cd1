"""Figures and tables of a report in files of their own: sizes, fonts, numbers, markup, and whose files may be replaced."""

from __future__ import annotations

import csv
import io
import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import matplotlib
import pytest
from pypdf import PdfReader

from winchcascade.core.errors import OutputError
from winchcascade.report.digits import NumberText, interval_text, number
from winchcascade.report.exports import LIST, csv_text, latex, latex_text, markdown_text, stem_of, write_report_files
from winchcascade.report.figure_files import figure_files
from winchcascade.report.report_files import ReportFiles
from winchcascade.report.sheet import (
    Limit,
    Report,
    Table,
    TableColumn,
    make_table,
    number_column,
    picture,
    rows_of,
    section,
    text_column,
)
from winchcascade.report.figures.style import house_style, label_panel, legend_above, line_entry, panel_figure, wide_figure


def _table() -> Table:
    columns = [
        text_column("Log_1 & 50 %"),
        TableColumn[object]("E_line", "J", 0),
        number_column("η_trans"),
        number_column("95 %"),
    ]
    rows = [
        ("a|b_c.csv", 7114.9497, number(0.90337, 3), interval_text(0.8949, 0.9119, 0.005)),
        ("größe #2", None, number(None, 3), interval_text(0.1, 0.2, 0.05)),
    ]
    return make_table(
        "t", "All of it: 100 % {really}.", columns, rows, below=[("mean", -1.5, number(0.9, 3), "")], note="p_q"
    )


def _report(rows: int = 3) -> Report:
    with house_style():
        figure, axes = panel_figure(2.9, 1, 2, gaps={"wspace": 0.26})
        for ax, letter in zip(axes, "ab", strict=True):
            ax.plot([0.0, 1.0], [0.0, 2.0])
            label_panel(
                ax, letter, "A title that is longer than a column of a journal is wide", x="Load (Ω)", y="Power (W)"
            )
            ax.text(0.5, 0.5, "small", fontsize=4.0)
        legend_above(figure, [line_entry(f"entry number {k}", "line") for k in range(6)])
        numbers = [TableColumn[float]("k", of=float)]
        long = make_table("long", "Many.", numbers, rows_of(numbers, [float(k) for k in range(rows)], Limit(2)))
        block = picture(figure, "loads", "Powers over the load.", "A plot.")
    return Report("kind", "Title", "", (), (), (section("s", "S", block, _table(), long),))


def _written(
    folder: Path, make: Callable[[], Report] = _report, *, figures: bool = False, of: str = "", force: bool = False
) -> None:
    files = ReportFiles(figures=folder if figures else None, tables=folder)
    write_report_files(make, files, "r36ohm", of=of, force=force)


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with figures and tables of a report."""
    folder = tmp_path_factory.mktemp("drawn")
    _written(folder, figures=True)
    return folder


def test_a_figure_is_written_in_three_formats_and_two_widths(drawn: Path) -> None:
    names = {path.name for path in drawn.iterdir() if "mm" in path.name}
    stem = "r36ohm_powers-and-efficiencies-over-load"
    assert names == {f"{stem}_{w}mm.{e}" for w in (90, 190) for e in ("svg", "pdf", "png")}
    for width in (90, 190):
        page = PdfReader(drawn / f"{stem}_{width}mm.pdf").pages[0]
        assert float(page.mediabox.width) / 72.0 * 25.4 == pytest.approx(width, abs=0.1)
        head = (drawn / f"{stem}_{width}mm.png").read_bytes()[16:20]
        assert int.from_bytes(head, "big") / 600.0 * 25.4 == pytest.approx(width, abs=0.1)


@pytest.mark.parametrize("width", [90, 190])
def test_the_texts_of_a_figure_are_text_of_seven_to_nine_points_in_embedded_fonts(drawn: Path, width: int) -> None:
    (svg,) = drawn.glob(f"*_{width}mm.svg")
    root = ElementTree.parse(svg).getroot()
    texts = [item for item in root.iter() if item.tag.endswith("}text")]
    assert {"small", "Load (Ω)", "entry number 5"} <= {"".join(item.itertext()) for item in texts}
    sizes = {float(size) for size in re.findall(r"font-size: ([\d.]+)px", svg.read_text())}
    assert sizes
    assert min(sizes) >= 7.0
    assert max(sizes) <= 9.0
    assert "@font-face{font-family:'DejaVu Sans'" in svg.read_text()
    (pdf,) = drawn.glob(f"*_{width}mm.pdf")
    page = PdfReader(pdf).pages[0]
    assert "entry number 5" in page.extract_text()
    for font in page["/Resources"]["/Font"].values():  # type: ignore[index]
        inner = font.get_object()
        inner = inner["/DescendantFonts"][0].get_object() if "/DescendantFonts" in inner else inner
        assert "/FontFile2" in inner["/FontDescriptor"]


def test_no_text_of_a_narrow_figure_lies_outside_of_it_or_on_another(tmp_path: Path) -> None:
    from winchcascade.report.exports import _drawn

    boxes: list[list[float]] = []

    def look(make: Callable[[], Report]) -> None:
        from winchcascade.report import figure_files

        def kept(figure: object) -> dict[str, bytes]:
            from matplotlib.figure import Figure

            assert isinstance(figure, Figure)
            figure.draw_without_rendering()
            width, height = figure.bbox.width, figure.bbox.height
            titles = [ax.title if ax.get_title() else ax._left_title for ax in figure.axes]  # type: ignore[attr-defined]
            for item in (*figure.legends, *titles):
                box = item.get_window_extent()
                boxes.append([box.x0, box.y0, width - box.x1, height - box.y1, box.y1])
            return {}

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(figure_files, "figure_files", kept)
            _drawn(make, 90)

    look(_report)
    assert len(boxes) == 3
    for box in boxes:
        assert min(box[:4]) > -1.0
    legend, first, second = boxes
    assert first[4] <= legend[1]
    assert second[4] < first[1]


def test_a_table_is_written_with_all_its_rows(tmp_path: Path) -> None:
    _written(tmp_path, lambda: _report(50))
    assert len((tmp_path / "r36ohm_long.csv").read_text().splitlines()) == 51


def test_a_csv_has_numbers_in_full_and_units_in_its_head() -> None:
    rows = list(csv.DictReader(io.StringIO(csv_text(_table()))))
    assert list(rows[0]) == ["Log_1 & 50 %", "E_line (J)", "η_trans", "95 %, low", "95 %, high"]
    assert [float(rows[0][name]) for name in list(rows[0])[1:]] == [7114.9497, 0.90337, 0.8949, 0.9119]
    assert rows[1]["E_line (J)"] == rows[1]["η_trans"] == ""
    assert rows[2]["E_line (J)"] == "-1.5"


@pytest.mark.parametrize("text", ["=1+1.csv", "+SUM(A1).csv", "-2+3", "@now", "\t=1", '=HYPERLINK("x")', "- a"])
def test_no_text_of_a_csv_is_taken_for_a_formula(text: str) -> None:
    columns = [text_column(text), text_column("Remark"), number_column("P", "W")]
    table = make_table("t", "c", columns, [(text, "r36.csv", number(-1.5, 1)), ("-1.5", "-", number(None, 0))])
    head, *rows = csv.reader(io.StringIO(csv_text(table)))
    assert (head[0], rows[0]) == (f"'{text}", [f"'{text}", "r36.csv", "-1.5"])
    assert rows[1] == ["-1.5", "-", ""]


def test_columns_of_one_name_are_told_apart_and_a_sign_is_named_after_its_number() -> None:
    columns = [number_column("P", "W"), number_column("±", "W"), number_column("P", "W")]
    table = make_table("t", "c", columns, [(number(1.0, 0), number(0.1, 1), NumberText("2 W", 2.0, unit="W"))])
    assert csv_text(table) == 'P (W),P ± (W),"P (W), 2","P (W), unit"\n1.0,0.1,2.0,W\n'


def test_a_latex_table_has_rules_units_and_no_character_that_latex_would_interpret() -> None:
    text = latex_text(_table(), "r36 ohm_t")
    for line in (r"\toprule", r"\midrule", r"\bottomrule", r"\label{tab:r36-ohm-t}", r"\begin{tabular}{lrrr}"):
        assert line in text
    assert r"Log\_1 \& 50 \% & $E_{\mathrm{line}}$ & $\eta_{\mathrm{trans}}$ & 95 \% \\" in text
    assert r" & (J) &  &  \\" in text
    assert r"a\textbar{}b\_c.csv & 7115 & 0.903 & 0.8949 to 0.9119 \\" in text
    assert r"größe \#2 & -- & -- & 0.1000 to 0.2000 \\" in text
    assert r"100 \% \{really\}" in text
    assert "$-$2 &" in text or "$-$1" in text
    rows = [line for line in text.splitlines() if line.endswith(r"\\")]
    assert {len(re.findall(r"(?<!\\)&", row)) for row in rows} == {3}
    assert text.count(r"\midrule") == 2  # below the head, and above the row that summarises


@pytest.mark.parametrize("special", list("\\{}$&#%_~^"))
def test_every_special_character_of_latex_is_escaped(special: str) -> None:
    assert latex(f"a{special}b") != f"a{special}b"
    assert (
        re.search(
            r"(?<!\\)[$&#%_^~]", re.sub(r"\\(textasciitilde|textasciicircum|textbackslash)\{\}", "", latex(special))
        )
        is None
    )


def test_a_markdown_table_keeps_its_columns_whatever_the_cells_hold() -> None:
    lines = [line for line in markdown_text(_table()).splitlines() if line.startswith("|")]
    assert lines[1] == "| :--- | ---: | ---: | ---: |"
    assert {len(re.findall(r"(?<!\\)\|", line)) for line in lines} == {5}


def test_a_second_call_replaces_its_own_files_and_removes_outdated_ones(drawn: Path, tmp_path: Path) -> None:
    shutil.copytree(drawn, tmp_path, dirs_exist_ok=True)
    before = {path.name for path in tmp_path.iterdir()}
    (tmp_path / "mine.csv").write_text("mine")
    report = _report()
    kept = section("s", "S", *[b for b in report.sections[0].blocks if getattr(b, "id", "") != "long"])
    _written(tmp_path, lambda: Report("kind", "Title", "", (), (), (kept,)), figures=True)
    after = {path.name for path in tmp_path.iterdir()}
    assert before - after == {f"r36ohm_long.{e}" for e in ("csv", "tex", "md")} | {n for n in before if "mm." in n}
    assert (tmp_path / "mine.csv").read_text() == "mine"
    assert "r36ohm_long.csv" not in json.loads((tmp_path / LIST).read_text())["files"]


@pytest.mark.parametrize("fault", ["foreign", "changed", "other"])
def test_a_file_of_another_origin_is_not_replaced_without_force(tmp_path: Path, fault: str) -> None:
    if fault != "foreign":
        _written(tmp_path, of="one.csv")
    if fault != "other":
        (tmp_path / "r36ohm_t.tex").write_text("mine")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    words = {
        "foreign": "was not written by",
        "changed": "was changed since",
        "other": "belongs to the tables of one.csv",
    }
    with pytest.raises(OutputError, match=words[fault]):
        write_report_files(
            _report, ReportFiles(tables=tmp_path), "r36ohm", of="one.csv" if fault != "other" else "two.csv"
        )
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    _written(tmp_path, of="one.csv", force=True)
    assert (tmp_path / "r36ohm_t.tex").read_text() != "mine"


def test_a_list_that_is_not_ours_is_rejected(tmp_path: Path) -> None:
    (tmp_path / LIST).write_text("{}")
    with pytest.raises(OutputError, match="is no list of the files"):
        _written(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [LIST]


def test_names_of_files_hold_no_blanks_and_keep_letters_of_every_script() -> None:
    assert stem_of("Kran Versuch (Ω) 日本.1") == "Kran-Versuch-Ω-日本.1"
    assert stem_of("../../etc/passwd") == "etc-passwd"


def test_letters_that_the_font_lacks_are_set_in_a_font_of_the_system(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from fontTools.ttLib import TTFont

    other = tmp_path / "other.ttf"
    with TTFont(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf") as font:
        for table in font["cmap"].tables:
            table.cmap = {0x6E2C: "A", 0x8A66: "B"}
        for record in font["name"].names:
            if record.nameID in (1, 4, 6, 16):
                record.string = "OtherLetters"
        font.save(other)

    def files(found: list[tuple[str, set[str]]]) -> dict[str, bytes]:
        monkeypatch.setattr("winchcascade.report.figure_files.fonts_for", lambda _: found)
        with house_style():
            figure = wide_figure(1.0)
            figure.text(0.1, 0.5, "log 測試")
            figure.text(0.6, 0.5, "plain")
            return figure_files(figure)

    boxes, letters = files([]), files([(str(other), {"測", "試"})])
    assert b"OtherLetters" in letters["pdf"]
    assert b"OtherLetters" in letters["svg"]
    assert b"OtherLetters" not in boxes["pdf"]
    assert letters["png"] != boxes["png"]
