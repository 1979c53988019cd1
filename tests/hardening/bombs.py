"""Small files that claim or unpack to much: each must be read or rejected within the limits of
memory and time.
"""

import gzip
import io
import itertools
import struct
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import xls
import xlsb
from pyarrow import parquet
from scipy.io import savemat
from seeds import DATA, seeds, text, unzipped, workbook, zipped
from seeds import ods as sound_ods

MEGA = 1 << 20

_SHEET = "xl/worksheets/sheet2.xml"
_MAIN = "xmlns='http://schemas.openxmlformats.org/spreadsheetml/2006/main'"


def xlsx(rows: Iterable[str], texts: Iterable[str] | None = None, claimed: str = "") -> bytes:
    """A workbook of Excel whose second sheet has these rows, and which has these texts, perhaps
    a claim of their number.
    """
    parts: dict[str, bytes | Iterable[bytes]] = dict(unzipped(workbook()))
    parts[_SHEET] = map(
        str.encode, (f"<worksheet {_MAIN}><sheetData>", *rows, "</sheetData></worksheet>")
    )
    if texts is not None:
        parts["xl/sharedStrings.xml"] = map(
            str.encode, (f"<sst {_MAIN}{claimed}>", *texts, "</sst>")
        )
    return zipped(parts)


def many(part: str, count: int) -> Iterator[str]:
    """A part so many times in pieces, which do not fill the memory of the process that makes a
    bomb.
    """
    return itertools.repeat(part * 10_000, count // 10_000)


def ods(rows: bytes) -> bytes:
    """A workbook of LibreOffice whose sheet has these rows."""
    parts = unzipped(sound_ods())
    content = parts["content.xml"]
    begin, end = content.index(b"<table:table-row>"), content.index(b"</table:table>")
    return zipped(parts | {"content.xml": content[:begin] + rows + content[end:]})


def _repeated(rows: int, columns: int) -> bytes:
    """A row of ODS that stands for many, of cells that stand for many."""
    cell = f"<table:table-cell table:number-columns-repeated='{columns}' office:value-type='float' office:value='1'/>"
    return ods(
        f"<table:table-row table:number-rows-repeated='{rows}'>{cell}</table:table-row>".encode()
    )


def _stray(row: int, column: str) -> bytes:
    """A cell far from the others."""
    return xlsx(
        [
            f"<row r='1'><c r='A1'><v>1</v></c></row><row r='{row}'><c "
            f"r='{column}{row}'><v>1</v></c></row>"
        ]
    )


def _many_sheets() -> bytes:
    """Every sheet is the same part, and each stretches over a million rows."""
    parts = unzipped(_stray(1 << 20, "P"))
    book = parts["xl/workbook.xml"].decode()
    sheets = "".join(f'<sheet name="s{k}" sheetId="{k + 3}" r:id="rId2"/>' for k in range(2000))
    return zipped(
        parts | {"xl/workbook.xml": book.replace("</sheets>", f"{sheets}</sheets>").encode()}
    )


def _table(columns: dict[str, Any], **options: Any) -> bytes:
    stream = io.BytesIO()
    parquet.write_table(pa.table(columns), stream, compression="zstd", **options)
    return stream.getvalue()


def _parquet_texts(rows: int, length: int) -> bytes:
    """One long text in every row."""
    stamp = pa.DictionaryArray.from_arrays(
        pa.array(np.zeros(rows, np.int32)), pa.array(["10:00:00" + " " * length])
    )
    return _table({"Time": stamp, "Velocity (m/s)": np.zeros(rows)}, store_schema=False)


def _parquet_lists(rows: int) -> bytes:
    """One cell with a long list."""
    lists = pa.ListArray.from_arrays(pa.array([0, rows], pa.int32()), pa.array(np.zeros(rows)))
    return _table({"Time (s)": [0.0], "Velocity (m/s)": lists})


def _mat(variables: dict[str, Any], old: bytes = b"", new: bytes = b"", **options: Any) -> bytes:
    """A MATLAB file, with some bytes of its headers replaced."""
    stream: Any = io.BytesIO()
    savemat(stream, variables, **options)
    return bytes(stream.getvalue()).replace(old, new, 1) if old else bytes(stream.getvalue())


def _mat_nested(depth: int) -> bytes:
    """Cells in cells."""

    def element(kind: int, body: bytes) -> bytes:
        return struct.pack("<II", kind, len(body)) + body + bytes(-len(body) % 8)

    head = (
        element(6, struct.pack("<II", 1, 0))
        + element(5, struct.pack("<ii", 1, 1))
        + element(1, b"v")
    )
    body = b""
    for _ in range(depth):
        body = element(14, head + body)
    return _mat({"x": 1.0})[:128] + body


def _mat73(**options: Any) -> bytes:
    """A vector of HDF5 that is much larger than what is stored of it."""
    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        for name in ("time", "velocity"):
            file.create_dataset(name, **options).attrs["MATLAB_class"] = np.bytes_("double")
    return stream.getvalue()


def _mat73_cells(cells: int) -> bytes:
    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        long = file.create_dataset(
            "#refs#/a", shape=(1, 1 << 24), dtype="u2", chunks=(1, 1 << 20), compression="gzip"
        )
        long.attrs["MATLAB_class"] = np.bytes_("char")
        file.create_dataset("time", data=[[long.ref]] * cells, dtype=h5py.ref_dtype)
    return stream.getvalue()


def _xlsb_stray() -> bytes:
    stream: Any = io.BytesIO()
    xlsb.write(
        stream, xlsb.sheet([["v"], [1.0]], xlsb.row((1 << 20) - 1, [xlsb.cell((1 << 14) - 1, 1.0)]))
    )
    return bytes(stream.getvalue())


def _xls_size() -> bytes:
    return xls.book(
        [["v"], [1.0]], further=xls.record(0x200, struct.pack("<IIHHH", 0, 2**32 - 1, 0, 300, 0))
    )


def _tdms_segments(channels: int, segments: int) -> bytes:
    """Many segments, each of which repeats all channels in 28 bytes."""
    paths = [f"/'g'/'{k:x}'".encode() for k in range(channels)]
    index = struct.pack("<IIIQI", 20, 10, 1, 0, 0)
    objects = b"".join(struct.pack("<I", len(path)) + path + index for path in paths)
    first = struct.pack("<I", channels) + objects
    head = [
        b"TDSm" + struct.pack("<IIQQ", kind, 4713, size, size)
        for kind, size in ((2 | 4 | 8, len(first)), (8, 0))
    ]
    return head[0] + first + segments * head[1]


def _tdms_lie() -> bytes:
    """A channel that claims more samples than the file has bytes."""
    head, velocity, rest = seeds("tdms")[0].partition(b"Velocity")
    return (
        head
        + velocity
        + rest.replace(
            DATA["Velocity"].size.to_bytes(8, "little"), (2**40).to_bytes(8, "little"), 1
        )
    )


BOMBS: dict[str, Callable[[], bytes]] = {
    "zip, a line": lambda: zipped({"log.csv": b"t,v\n" + bytes(200 * MEGA)}),
    "zip, members": lambda: zipped({f"{k}": b"" for k in range(11_000)}),
    "gzip, a line": lambda: gzip.compress(b"t,v\n" + bytes(200 * MEGA)),
    "gzip, a million columns": lambda: gzip.compress(
        b"Time (s)" + b",Velocity (m/s)" * 10**6 + b"\n" + b"0.5," * 10**6
    ),
    "gzip, a quoted cell": lambda: gzip.compress(
        text().encode() + b'9,"' + b"x\n" * (50 * MEGA) + b'"\n'
    ),
    "xlsx, a cell in the last corner": lambda: _stray(1 << 20, "XFD"),
    "xlsx, a cell in the last row": lambda: _stray(1 << 20, "BP"),
    "xlsx, sheets that share a part": _many_sheets,
    "xlsx, claimed texts": lambda: xlsx([], ["<si><t>v</t></si>"], " uniqueCount='4000000000'"),
    "xlsx, texts": lambda: xlsx([], many("<si><t>v</t></si>", 20_000_000)),
    "xlsx, cells": lambda: xlsx(["<row r='1'>", *many("<c><v>1</v></c>", 30_000_000), "</row>"]),
    "xlsb, a cell in the last corner": _xlsb_stray,
    "xls, a claimed size": _xls_size,
    "xls, a cell in the last corner": lambda: xls.book(
        [["v"], [1.0]], further=xls.number(65_535, 65_535, 1.0)
    ),
    "ods, repeated rows": lambda: _repeated(1_000_000_000, 1),
    "ods, repeated rows and columns": lambda: _repeated(1 << 20, 90),
    "parquet, zeros": lambda: _table(
        {name: pa.chunked_array([np.zeros(MEGA)] * 60) for name in ("Time (s)", "Velocity (m/s)")}
    ),
    "parquet, long texts": lambda: _parquet_texts(100_000, 5_000_000),
    "parquet, a long list": lambda: _parquet_lists(40 * MEGA),
    "parquet, columns": lambda: _table({f"Velocity {k} (m/s)": [0.0] for k in range(2500)}),
    "tdms, segments": lambda: _tdms_segments(8000, 12_000),
    "tdms, claimed samples": _tdms_lie,
    "mat, zeros": lambda: _mat(
        {n: np.zeros(38 * MEGA) for n in ("time", "velocity")}, do_compression=True
    ),
    "mat, a claimed length": lambda: _mat(
        {"velocity": np.zeros((7, 1))}, struct.pack("<ii", 7, 1), struct.pack("<ii", 2**31 - 1, 1)
    ),
    "mat4, a claimed length": lambda: _mat(
        {"velocity": np.zeros((7, 7))},
        struct.pack("<ii", 7, 7),
        b"\xff\xff\xff\x7f" * 2,
        format="4",
    ),
    "mat, nested": lambda: _mat_nested(10_000),
    "mat73, not stored": lambda: _mat73(shape=(1, 10**12), dtype="f8", chunks=(1, 10**6)),
    "mat73, cells": lambda: _mat73_cells(2000),
}
"""By name, files of less than a megabyte."""
