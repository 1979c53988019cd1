"""Small files that claim or unpack to much: each must be read or rejected within the limits of memory and time."""

import gzip
import io
import struct
import zlib
from collections.abc import Callable, Iterator
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import xls
import xlsb
from pyarrow import parquet
from seeds import DATA, seeds, text, unzipped, workbook, zipped
from seeds import ods as sound_ods

MEGA = 1 << 20

_SHEET = "xl/worksheets/sheet2.xml"
_MAIN = "xmlns='http://schemas.openxmlformats.org/spreadsheetml/2006/main'"
_CELL = b"<table:table-row><table:table-cell office:value-type='float' office:value='1'/></table:table-row>"


def xlsx(rows: str, shared: str | None = None) -> bytes:
    """A workbook of Excel whose second sheet has these rows."""
    parts = unzipped(workbook()) | {_SHEET: f"<worksheet {_MAIN}><sheetData>{rows}</sheetData></worksheet>".encode()}
    return zipped(parts | ({} if shared is None else {"xl/sharedStrings.xml": shared.encode()}))


def ods(rows: bytes) -> bytes:
    """A workbook of LibreOffice whose sheet has these rows."""
    parts = unzipped(sound_ods())
    content = parts["content.xml"]
    begin, end = content.index(b"<table:table-row>"), content.index(b"</table:table>")
    return zipped(parts | {"content.xml": content[:begin] + rows + content[end:]})


def _repeated(rows: int, columns: int) -> bytes:
    cell = _CELL.replace(b"-cell ", f"-cell table:number-columns-repeated='{columns}' ".encode())
    return cell.replace(b"<table:table-row>", f"<table:table-row table:number-rows-repeated='{rows}'>".encode())


def _stray(row: int, column: str) -> bytes:
    return xlsx(f"<row r='1'><c r='A1'><v>1</v></c></row><row r='{row}'><c r='{column}{row}'><v>1</v></c></row>")


def _many_sheets() -> bytes:
    """Every sheet is the same part, and each stretches over a million rows."""
    parts = unzipped(_stray(1 << 20, "P"))
    book = parts["xl/workbook.xml"].decode()
    sheets = "".join(f'<sheet name="s{k}" sheetId="{k + 3}" r:id="rId2"/>' for k in range(2000))
    return zipped(parts | {"xl/workbook.xml": book.replace("</sheets>", f"{sheets}</sheets>").encode()})


def _table(columns: dict[str, Any], **options: Any) -> bytes:
    stream = io.BytesIO()
    parquet.write_table(pa.table(columns), stream, compression="zstd", **options)
    return stream.getvalue()


def _parquet_zeros(rows: int) -> bytes:
    zeros = pa.chunked_array([pa.array(np.zeros(MEGA))] * (rows // MEGA))
    return _table({"Time (s)": zeros, "Velocity (m/s)": zeros})


def _parquet_texts(rows: int, length: int) -> bytes:
    """One long text in every row."""
    stamp = pa.DictionaryArray.from_arrays(pa.array(np.zeros(rows, np.int32)), pa.array(["10:00:00" + " " * length]))
    return _table({"Time": stamp, "Velocity (m/s)": np.zeros(rows)}, store_schema=False)


def _parquet_lists(rows: int) -> bytes:
    lists = pa.ListArray.from_arrays(pa.array([0, rows], pa.int32()), pa.array(np.zeros(rows)))
    return _table({"Time (s)": [0.0], "Velocity (m/s)": lists})


def _parquet_columns(columns: int) -> bytes:
    return _table({f"Velocity {k} (m/s)": [0.0] for k in range(columns)})


def _mat_element(kind: int, body: bytes) -> bytes:
    return struct.pack("<II", kind, len(body)) + body + bytes(-len(body) % 8)


def _mat_head(rows: int, name: bytes, bytes_: int) -> bytes:
    """A v5 variable up to the tag of its numbers."""
    parts = (
        _mat_element(6, struct.pack("<II", 6, 0)) + _mat_element(5, struct.pack("<ii", rows, 1)) + _mat_element(1, name)
    )
    parts += struct.pack("<II", 9, bytes_)
    return struct.pack("<II", 14, len(parts) + bytes_) + parts


def _squeezed(pieces: Iterator[bytes]) -> bytes:
    squeeze = zlib.compressobj(9)
    content = b"".join(squeeze.compress(piece) for piece in pieces) + squeeze.flush()
    return struct.pack("<II", 15, len(content)) + content


_MAT = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<HH", 0x0100, 0x4D49)


def _mat_zeros(megas: int, names: tuple[bytes, ...]) -> bytes:
    """Vectors of zeros, compressed."""

    def pieces(name: bytes) -> Iterator[bytes]:
        yield _mat_head(megas * MEGA // 8, name, megas * MEGA)
        yield from [bytes(MEGA)] * megas

    return _MAT + b"".join(_squeezed(pieces(name)) for name in names)


def _mat_lie(rows: int) -> bytes:
    return _MAT + _mat_head(rows, b"velocity", 64) + bytes(64)


def _mat4_lie() -> bytes:
    return struct.pack("<5i", 0, 2**31 - 1, 2**31 - 1, 0, 9) + b"velocity\0" + bytes(64)


def _mat_nested(depth: int) -> bytes:
    """Cells in cells."""
    body = b""
    for _ in range(depth):
        parts = (
            _mat_element(6, struct.pack("<II", 1, 0))
            + _mat_element(5, struct.pack("<ii", 1, 1))
            + _mat_element(1, b"v")
        )
        body = _mat_element(14, parts + body)
    return _MAT + body


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
        long = file.create_dataset("#refs#/a", shape=(1, 1 << 24), dtype="u2", chunks=(1, 1 << 20), compression="gzip")
        long.attrs["MATLAB_class"] = np.bytes_("char")
        file.create_dataset("time", data=[[long.ref]] * cells, dtype=h5py.ref_dtype)
    return stream.getvalue()


def _xlsb_stray() -> bytes:
    stream: Any = io.BytesIO()
    xlsb.write(stream, xlsb.sheet([["v"], [1.0]], xlsb.row((1 << 20) - 1, [xlsb.cell((1 << 14) - 1, 1.0)])))
    return bytes(stream.getvalue())


def _xls_size() -> bytes:
    return xls.book([["v"], [1.0]], further=xls.record(0x200, struct.pack("<IIHHH", 0, 2**32 - 1, 0, 300, 0)))


def _tdms_text(text: str) -> bytes:
    return struct.pack("<I", len(text)) + text.encode()


def _tdms_segment(kind: int, metadata: bytes, samples: bytes = b"") -> bytes:
    size = len(metadata) + len(samples)
    return b"TDSm" + struct.pack("<IIQQ", kind, 4713, size, len(metadata)) + metadata + samples


def _tdms_channels(paths: list[str], samples: int) -> bytes:
    index = struct.pack("<IIIQI", 20, 10, 1, samples, 0)
    return struct.pack("<I", len(paths)) + b"".join(_tdms_text(path) + index for path in paths)


def _tdms_segments(channels: int, segments: int) -> bytes:
    """Many segments, each of which repeats all channels in 28 bytes."""
    paths = [f"/'g'/'{k:x}'" for k in range(channels)]
    return _tdms_segment(2 | 4 | 8, _tdms_channels(paths, 0)) + segments * _tdms_segment(8, b"")


def _tdms_lie() -> bytes:
    """A channel that claims more samples than the file has bytes."""
    content = seeds("tdms")[0]
    size = (DATA["Velocity"].size).to_bytes(8, "little")
    at = content.index(size, content.index(b"Velocity"))
    return content[:at] + (2**40).to_bytes(8, "little") + content[at + 8 :]


BOMBS: dict[str, Callable[[], bytes]] = {
    "zip, a line": lambda: zipped({"log.csv": b"t,v\n" + bytes(200 * MEGA)}),
    "zip, members": lambda: zipped({f"{k}": b"" for k in range(11_000)}),
    "gzip, a line": lambda: gzip.compress(b"t,v\n" + bytes(200 * MEGA)),
    "gzip, a million columns": lambda: gzip.compress(
        b"Time (s)" + b",Velocity (m/s)" * 10**6 + b"\n" + b"0.5," * 10**6
    ),
    "gzip, a quoted cell": lambda: gzip.compress(text().encode() + b'9,"' + b"x\n" * (50 * MEGA) + b'"\n'),
    "xlsx, a cell in the last corner": lambda: _stray(1 << 20, "XFD"),
    "xlsx, a cell in the last row": lambda: _stray(1 << 20, "BP"),
    "xlsx, sheets that share a part": _many_sheets,
    "xlsx, claimed texts": lambda: xlsx("", f"<sst {_MAIN} uniqueCount='4000000000'><si><t>v</t></si></sst>"),
    "xlsx, texts": lambda: xlsx("", f"<sst {_MAIN}>{'<si><t>v</t></si>' * 20_000_000}</sst>"),
    "xlsx, cells": lambda: xlsx(f"<row r='1'>{'<c><v>1</v></c>' * 30_000_000}</row>"),
    "xlsb, a cell in the last corner": _xlsb_stray,
    "xls, a claimed size": _xls_size,
    "xls, a cell in the last corner": lambda: xls.book([["v"], [1.0]], further=xls.number(65_535, 65_535, 1.0)),
    "ods, repeated rows": lambda: ods(_repeated(1_000_000_000, 1)),
    "ods, repeated rows and columns": lambda: ods(_repeated(1 << 20, 90)),
    "parquet, zeros": lambda: _parquet_zeros(60 * MEGA),
    "parquet, long texts": lambda: _parquet_texts(100_000, 5_000_000),
    "parquet, a long list": lambda: _parquet_lists(100 * MEGA),
    "parquet, columns": lambda: _parquet_columns(2500),
    "tdms, segments": lambda: _tdms_segments(8000, 12_000),
    "tdms, claimed samples": _tdms_lie,
    "mat, zeros": lambda: _mat_zeros(300, (b"time", b"velocity")),
    "mat, a claimed length": lambda: _mat_lie(2**31 - 1),
    "mat4, a claimed length": _mat4_lie,
    "mat, nested": lambda: _mat_nested(10_000),
    "mat73, not stored": lambda: _mat73(shape=(1, 10**12), dtype="f8", chunks=(1, 10**6)),
    "mat73, cells": lambda: _mat73_cells(2000),
}
"""By name, files of less than a megabyte."""
