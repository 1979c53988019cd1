"""Files that winchcascade writes, as plain data or as text, without what only lays them out."""

import csv
import io
import json
import tomllib
from collections.abc import Callable, Sequence
from html.parser import HTMLParser
from pathlib import Path
from typing import Any


def json_content(path: Path) -> Any:
    """Read a JSON file."""
    return json.loads(path.read_text(encoding="utf-8"))


def parquet_content(path: Path) -> Any:
    """Read a Parquet file: its metadata, then type and values of each column."""
    from pyarrow import parquet

    table = parquet.read_table(path)
    about = {
        key.decode(): value.decode() for key, value in sorted((table.schema.metadata or {}).items())
    }
    columns = {
        field.name: [str(field.type), table.column(field.name).to_pylist()]
        for field in table.schema
    }
    return {"metadata": about, "rows": table.num_rows, "columns": columns}


def workbook_content(path: Path) -> Any:
    """Read a workbook: of each sheet its rows and heads; its numbers are those of the data set."""
    import openpyxl

    book = openpyxl.load_workbook(path)
    return {
        sheet.title: {"rows": sheet.max_row, "heads": [cell.value for cell in sheet[1]]}
        for sheet in book.worksheets
    }


def csv_content(path: Path) -> Any:
    """Read a CSV file: the cells of each column, numbers where they are some."""
    head, *rows = csv.reader(io.StringIO(path.read_text(encoding="utf-8")))
    columns: list[Sequence[object]] = [
        [_cell(cell) for cell in column] for column in zip(*rows, strict=True)
    ]
    return dict(zip(head, columns, strict=True))


def _cell(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def toml_content(path: Path) -> Any:
    """Read a TOML file."""
    return tomllib.loads(path.read_text(encoding="utf-8"))


def page_content(path: Path) -> str:
    """Give the text of a page: a line for each block, and for each row of a table."""
    reader = _Page()
    reader.feed(path.read_text(encoding="utf-8"))
    reader.close()
    return "".join(f"{line}\n" for line in reader.lines)


_INLINE = {
    "a",
    "b",
    "br",
    "i",
    "em",
    "strong",
    "small",
    "span",
    "sub",
    "sup",
    "code",
    "meta",
    "link",
    "input",
    "img",
}
_HIDDEN = {"svg", "style", "script"}


class _Page(HTMLParser):
    """Lines of a page without drawings, style and scripts."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []
        self._line = ""
        self._hidden = 0

    def handle_starttag(self, tag: str, _attributes: list[tuple[str, str | None]]) -> None:
        self._hidden += tag in _HIDDEN
        if tag in {"td", "th"}:
            self._line += " | " if self._line else ""
        elif tag == "sub":
            self._line += "_"
        elif tag not in _INLINE:
            self._end_line()

    def handle_endtag(self, tag: str) -> None:
        self._hidden -= tag in _HIDDEN
        if tag not in _INLINE | {"td", "th"}:
            self._end_line()

    def handle_data(self, data: str) -> None:
        if not self._hidden:
            self._line += data if data.strip() else " " * bool(self._line)

    def close(self) -> None:
        super().close()
        self._end_line()

    def _end_line(self) -> None:
        text = " ".join(self._line.split())
        self._line = ""
        if text:
            self.lines.append(text)


CONTENTS: dict[str, Callable[[Path], Any]] = {
    ".json": json_content,
    ".parquet": parquet_content,
    ".xlsx": workbook_content,
    ".csv": csv_content,
    ".toml": toml_content,
    ".html": page_content,
}
"""What reads a file, by its ending; a page is a text, all else data."""
