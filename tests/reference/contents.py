"""Files that winchcascade writes, as text: values and structure without what only lays them out."""

import csv
import hashlib
import io
import json
from collections.abc import Iterator, Sequence
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

from numerals import WIDE, digest, layout, rounded

DIGITS = 9
"""Digits of computed numbers: fewer than processors agree on, more than any reader needs."""

FITTED = 5
"""Digits of fitted numbers and of what is drawn: a fit ends where its steps become small, not at a point."""

WRITTEN = 6
"""Digits of numbers that are written with few digits, whose last one may differ."""


def json_text(path: Path, digits: int = DIGITS) -> str:
    """Lay out the content of a JSON file."""
    return layout(json.loads(path.read_text(encoding="utf-8")), digits).strip("\n")


def parquet_text(path: Path) -> str:
    """Describe a Parquet file: its metadata, then name, type and values of each column."""
    from pyarrow import parquet

    table = parquet.read_table(path)
    about = table.schema.metadata or {}
    lines = [f"{key.decode()}: {value.decode()}" for key, value in sorted(about.items())]
    lines += [f"{table.num_rows} rows"]
    for field in table.schema:
        kind = f"{field.type}{'' if field.nullable else ' not null'}"
        lines.append(f"{field.name} ({kind}): {digest(table.column(field.name).to_pylist(), DIGITS)}")
    return "\n".join(lines)


def workbook_text(path: Path) -> str:
    """Describe a workbook: of each sheet the columns with their cells."""
    import openpyxl

    book = openpyxl.load_workbook(path)
    lines = [f"comments: {book.properties.description}"]
    for sheet in book.worksheets:
        lines.append(f"sheet {sheet.title}: {sheet.max_row} rows, frozen at {sheet.freeze_panes}")
        lines += [f"{head}: {digest(cells, DIGITS)}" for head, *cells in sheet.iter_cols(values_only=True)]
    return "\n".join(lines)


def log_text(path: Path) -> str:
    """Describe a log: of each column its name and the digest of its numbers."""
    head, *rows = csv.reader(io.StringIO(path.read_text(encoding="utf-8")))
    columns: list[Sequence[object]] = [[_cell(cell) for cell in column] for column in zip(*rows, strict=True)]
    return "\n".join(f"{name}: {digest(column, WRITTEN)}" for name, column in zip(head, columns, strict=True))


def _cell(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def toml_text(path: Path) -> str:
    """Give a TOML file with its long numbers rounded."""
    return rounded(path.read_text(encoding="utf-8"), WRITTEN).rstrip("\n")


def pdf_text(path: Path) -> str:
    """Give the text of a PDF page by page."""
    import pypdf

    pages = pypdf.PdfReader(path).pages
    lines = []
    for k, page in enumerate(pages, 1):
        lines.append(f"page {k} of {len(pages)}")
        lines += [" ".join(line.split()) for line in page.extract_text().splitlines() if line.strip()]
    return "\n".join(lines)


def html_text(path: Path) -> str:
    """Give the text and the structure of a page without its drawings; style and script as digests."""
    reader = _Page()
    reader.feed(path.read_text(encoding="utf-8"))
    reader.close()
    return "\n".join(reader.lines)


_INLINE = {"a", "b", "br", "i", "em", "strong", "small", "span", "sub", "sup", "code"}
_CELLS = {"td", "th"}
_VOID = {"meta", "link", "br", "input", "img", "hr"}
_HIDDEN = {"svg", "style", "script"}


class _Page(HTMLParser):
    """Lines of a page: each block with its attributes and text, each row of a table in one line."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []
        self._hidden: list[str] = []
        self._data = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if self._hidden:
            self._hidden += [tag] * (tag == self._hidden[0])
            return
        shown = "".join(f' {name}="{value}"' for name, value in attrs)
        if tag in _HIDDEN:
            self._hidden, self._data = [tag], ""
            self.lines.append(f"{tag}{shown if tag == 'script' else ''}: ")
        elif tag == "sub":
            self._add("_")
        elif tag in _CELLS:
            self._add(f" |{shown if tag == 'th' else ''} ")
        elif tag in _INLINE:
            self._add(f"<{tag}{shown}>" if shown else "")
        else:
            self.lines.append(f"{tag}{shown}: ")

    def handle_endtag(self, tag: str) -> None:
        if self._hidden and tag == self._hidden[0]:
            self._hidden.pop()
            if not self._hidden and tag != "svg":
                self._add(_payload(self._data))
        elif not self._hidden and tag not in _INLINE | _CELLS | _VOID:
            self.lines.append("")  # text after a block is not the block's

    def handle_data(self, data: str) -> None:
        if self._hidden:
            self._data += data
        elif data.strip():
            if not self.lines or not self.lines[-1]:
                self.lines.append("text: ")
            self._add(" " * data[0].isspace() + " ".join(data.split()) + " " * data[-1].isspace())

    def _add(self, text: str) -> None:
        if not self.lines:
            self.lines.append("")
        self.lines[-1] += text

    def close(self) -> None:
        super().close()
        self.lines = [" ".join(line.split()) for line in self.lines if line.strip()]


def _payload(text: str) -> str:
    """Describe what a script or a style holds: JSON by its content, all else by a digest."""
    try:
        content: Any = json.loads(text)
    except ValueError:
        return f"{len(text.splitlines())} lines, SHA-256 {hashlib.sha256(text.encode()).hexdigest()[:12]}"
    return layout(_without_packed(content), FITTED)


PACKED = 300
"""A text of JSON without a blank that is longer than this holds packed values. [characters]"""


def _without_packed(content: Any) -> Any:
    """JSON with the length of packed values in their place: their last bits depend on the machine."""
    if isinstance(content, str):
        return f"{len(content)} packed characters" if len(content) > PACKED and " " not in content else content
    if isinstance(content, dict):
        return {name: _without_packed(inner) for name, inner in content.items()}
    return [_without_packed(inner) for inner in content] if isinstance(content, list) else content


def figure_text(number: int, figure: Any) -> Iterator[str]:
    """Describe a matplotlib Figure: of each axes its words, and the arrays behind what is drawn."""
    yield f"figure {number}: {len(figure.axes)} axes, {number_pair(figure.get_size_inches())} in"
    for k, axes in enumerate(figure.axes):
        yield f" axes {k}: {' | '.join(filter(None, (axes.get_title(loc=side) for side in ('left', 'center', 'right'))))}"
        for side in ("x", "y"):
            label, scale = getattr(axes, f"get_{side}label")(), getattr(axes, f"get_{side}scale")()
            ticks = [text for tick in getattr(axes, f"get_{side}ticklabels")() if (text := tick.get_text())]
            yield f"  {side}: {label}; {scale}; {digest(list(getattr(axes, f'get_{side}lim')()), FITTED)}; {' '.join(ticks)}"
        legend = axes.get_legend()
        if legend is not None:
            yield f"  legend: {' | '.join(text.get_text() for text in legend.get_texts())}"
        for line in axes.lines:
            name = line.get_label() if str(line.get_gid()).startswith("item-") else line.get_gid() or line.get_label()
            yield from _columns(f"line {name}", line.get_xdata(), line.get_ydata())
        for collection in axes.collections:
            kind = type(collection).__name__
            points = [point for path in collection.get_paths() for point in path.vertices.tolist()]
            yield from _columns(f"{kind} offsets", *collection.get_offsets().T)
            yield from _columns(f"{kind} outlines", *zip(*points, strict=True))
            if collection.get_array() is not None:
                yield from _columns(f"{kind} values", collection.get_array().ravel())
        for image in axes.images:
            yield from _columns(f"image {image.get_array().shape}", image.get_array().ravel())
        corners: dict[str, list[Sequence[float]]] = {}
        for patch in axes.patches:
            box = patch.get_path().transformed(patch.get_patch_transform()).get_extents()
            corners.setdefault(type(patch).__name__, []).append(box.extents.tolist())
        for kind, boxes in corners.items():
            yield from _columns(f"{len(boxes)} {kind}, from x, y to x, y", *zip(*boxes, strict=True))
        for text in axes.texts:
            yield f"  text at {number_pair(text.get_position())}: {' / '.join(text.get_text().splitlines())}"


def _columns(name: str, *columns: Any) -> Iterator[str]:
    """Describe the columns of one drawn thing, each in a line of its own where they are long."""
    import numpy as np

    shown = [digest(np.ma.filled(np.ma.asarray(column).astype(float), np.nan).tolist(), FITTED) for column in columns]
    if sum(map(len, shown)) <= WIDE:
        yield f"  {name}: {'; '.join(shown)}"
    else:
        yield from (f"  {name}", *(f"   {text}" for text in shown))


def number_pair(values: Any) -> str:
    """Show a position."""
    return digest([float(value) for value in values], FITTED)
