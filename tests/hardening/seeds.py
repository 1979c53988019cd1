"""Whole files of every kind that is read: what a mutation starts from, the same bytes at every
call.
"""

import datetime as dt
import io
import tempfile
import zipfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import xls
import xlsb
import xlsxwriter
from nptdms import ChannelObject, RootObject, TdmsWriter
from scipy.io import savemat

ROOT = Path(__file__).parents[2]
LOG = ROOT / "fixtures" / "campaign" / "r36ohm.csv"
LINES = LOG.read_text(encoding="utf-8").splitlines()
HEADERS = LINES[0].split(",")
ROWS = [line.split(",") for line in LINES[1:1800:2]]
"""Two cycles, at half the rate: a mutation is read in some milliseconds."""

NAMES = [header.rpartition(" (")[0] for header in HEADERS]
UNITS = [header.rpartition(" (")[2].rstrip(")") for header in HEADERS]
DATA = dict(zip(NAMES, np.array(ROWS, dtype=np.float64).T, strict=True))
STEP = 0.08

EPOCH = (1980, 1, 1, 0, 0, 0)
"""The date of every part of a zipped file, as its bytes must be the same at every call."""


def text(
    delimiter: str = ",", decimal: str = ".", end: str = "\n", rows: Sequence[Sequence[str]] = ROWS
) -> str:
    """The log as delimited text."""
    table = [delimiter.join(row).replace(".", decimal) for row in rows]
    return end.join([delimiter.join(HEADERS), *table, ""])


def stamped() -> str:
    """The log with a date and a time of day in each row."""
    clock = [f"2026-04-18 10:{int(float(r[0]) // 60):02d}:{float(r[0]) % 60:06.3f}" for r in ROWS]
    return text(rows=[[stamp, *row[1:]] for stamp, row in zip(clock, ROWS, strict=True)])


def lvm() -> str:
    """The log as LabVIEW's measurement file."""
    top = "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\nX_Columns\tOne\n"
    top += (
        "***End_of_Header***\t\n\nChannels\t7\nDelta_X"
        + f"\t{STEP}" * 7
        + "\n***End_of_Header***\n"
    )
    return (
        top
        + "\t".join(["X_Value", *HEADERS[1:], "Comment"])
        + "\n"
        + "".join("\t".join(r) + "\t\n" for r in ROWS)
    )


def delimited() -> list[bytes]:
    """The dialects of text."""
    chinese = (
        text("\t").replace("Time", "時間").replace("Vdc", "直流電壓").replace("Idc", "直流電流")
    )
    return [
        text().encode(),
        text(";", ",", "\r\n").encode("utf-16"),
        chinese.encode("cp950"),
        ("Sample rate: 12.5 Hz\nload_ohm: 36\n\n" + text(" | ")).encode(),
        text(rows=[[f'"{cell}"' for cell in row] for row in ROWS], decimal=",").encode(),
        stamped().encode(),
        (ROOT / "fixtures" / "damaged_logs" / "units_row.csv").read_bytes()[:60_000],
        b"time_s,velocity_mps\n" + b"".join(f"{r[0]},{r[2]}\n".encode() for r in ROWS),
    ]


def through_a_file(write: Callable[[Path], object]) -> bytes:
    """What a writer that insists on a path writes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "made"
        write(path)
        return path.read_bytes()


def tdms() -> list[bytes]:
    """TDMS with a clock in its properties, with one as a channel, in several segments."""

    def write(path: Path, clock: int, segments: int) -> None:
        waves = {"wf_increment": STEP, "wf_start_offset": 0.0} if clock else {}
        columns = list(zip(NAMES, UNITS, strict=True))[clock:]
        with TdmsWriter(str(path)) as writer:
            for k in range(segments):
                parts = {name: np.array_split(DATA[name], segments)[k] for name, _ in columns}
                channels = [
                    ChannelObject("Crane", n, parts[n], waves | {"unit_string": unit})
                    for n, unit in columns
                ]
                writer.write_segment([RootObject({"load_ohm": 36.0}), *channels])

    made = ((1, 1), (0, 1), (1, 4))
    return [
        through_a_file(partial(write, clock=clock, segments=segments)) for clock, segments in made
    ]


def mat() -> list[bytes]:
    """MATLAB v4, v5 plain and compressed."""

    def saved(variables: dict[str, Any], **options: Any) -> bytes:
        stream: Any = io.BytesIO()
        savemat(stream, variables, **options)
        return bytes(stream.getvalue())

    log = {"log": DATA | {"units": dict(zip(NAMES, UNITS, strict=True))}, "load_ohm": 36.0}
    later = [saved(log), saved(log, do_compression=True)]
    head = b"MATLAB 5.0 MAT-file".ljust(
        116
    )  # without the date, so that the bytes are the same at every call
    return [
        saved(DATA | {"load_ohm": 36.0}, format="4"),
        *(head + content[116:] for content in later),
    ]


def mat73() -> list[bytes]:
    """MATLAB v7.3, which is HDF5."""

    def write(path: Path) -> None:
        with h5py.File(path, "w", userblock_size=512) as file:
            log = file.create_group("log")
            units = log.create_group("units")
            for name, unit in zip(NAMES, UNITS, strict=True):
                log.create_dataset(name, data=np.atleast_2d(DATA[name])).attrs["MATLAB_class"] = (
                    np.bytes_("double")
                )
                letters = np.array([[ord(letter)] for letter in unit], dtype=np.uint16)
                units.create_dataset(name, data=letters).attrs["MATLAB_class"] = np.bytes_("char")
        path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + path.read_bytes()[512:])

    return [through_a_file(write)]


def parquet() -> list[bytes]:
    """Parquet of numbers, plain and compressed in several row groups, and of texts with stamps."""

    def saved(table: Any, **options: Any) -> bytes:
        stream = io.BytesIO()
        pq.write_table(table, stream, **options)
        return stream.getvalue()

    fields = [
        pa.field(n, pa.float64(), metadata={"unit": unit})
        for n, unit in zip(NAMES, UNITS, strict=True)
    ]
    numbers = pa.table(list(DATA.values()), schema=pa.schema(fields, metadata={"load_ohm": "36"}))
    stamps = pa.array((DATA["Time"] * 1e3).astype(np.int64), pa.timestamp("ms"))
    texts = {header: [row[k] for row in ROWS] for k, header in enumerate(HEADERS) if k}
    return [
        saved(numbers, compression="none", use_dictionary=False),
        saved(numbers, compression="zstd", row_group_size=200),
        saved(pa.table({"Timestamp": stamps, **texts}), compression="snappy"),
    ]


def sheet() -> list[list[Any]]:
    """The cells of a short log."""
    return [HEADERS, *([float(cell) for cell in row] for row in ROWS[:500])]


def workbook() -> bytes:
    """A workbook of Excel with a sheet of notes before the log."""
    stream = io.BytesIO()
    with xlsxwriter.Workbook(stream, {"in_memory": True}) as book:
        book.set_properties({"created": dt.datetime(2026, 4, 18)})
        book.add_worksheet("Notes").write_row(0, 0, ["Trial of the crane"])
        log = book.add_worksheet("Log")
        for k, row in enumerate(sheet()):
            log.write_row(k, 0, row)
    return stream.getvalue()


def zipped(parts: Mapping[str, bytes | Iterable[bytes]]) -> bytes:
    """Parts, each whole or in pieces, as one zipped file."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as book:
        for name, content in parts.items():
            info = zipfile.ZipInfo(name, EPOCH)
            info.compress_type = zipfile.ZIP_DEFLATED
            with book.open(info, "w") as part:
                part.writelines([content] if isinstance(content, bytes) else content)
    return stream.getvalue()


def unzipped(content: bytes) -> dict[str, bytes]:
    """The parts of a zipped file."""
    with zipfile.ZipFile(io.BytesIO(content)) as book:
        return {name: book.read(name) for name in book.namelist()}


def ods() -> bytes:
    """A workbook of LibreOffice."""
    words = "<table:table-cell office:value-type='string'><text:p>{0}</text:p></table:table-cell>"
    numbers = "<table:table-cell office:value-type='float' office:value='{0}'/>"
    rows = [
        "".join((words if isinstance(cell, str) else numbers).format(cell) for cell in row)
        for row in sheet()
    ]
    spaces = " ".join(
        f"xmlns:{x}='urn:oasis:names:tc:opendocument:xmlns:{x}:1.0'"
        for x in ("office", "table", "text")
    )
    table = "".join(f"<table:table-row>{row}</table:table-row>" for row in rows)
    body = f"<office:spreadsheet><table:table table:name='Log'>{table}</table:table></office:spreadsheet>"
    content = f"<office:document-content {spaces}><office:body>{body}</office:body></office:document-content>"
    kind = b"application/vnd.oasis.opendocument.spreadsheet"
    return zipped(
        {"mimetype": kind, "META-INF/manifest.xml": b"<manifest/>", "content.xml": content.encode()}
    )


def binary_workbook() -> bytes:
    """A workbook of Excel of zipped records."""
    stream = io.BytesIO()
    xlsb.write(stream, xlsb.sheet(sheet()))
    return stream.getvalue()


def toml(*places: str) -> list[bytes]:
    """Shipped files of TOML."""
    return [(ROOT / place).read_bytes() for place in places]


SEEDS: dict[str, Callable[[], list[bytes]]] = {
    "text": delimited,
    "lvm": lambda: [lvm().encode()],
    "tdms": tdms,
    "mat": mat,
    "mat73": mat73,
    "parquet": parquet,
    "excel": lambda: [workbook(), ods(), binary_workbook()],
    "xls": lambda: [xls.book(sheet())],
    "rig": lambda: toml(
        "winchcascade/rigfiles/hsu2026.toml", "winchcascade/rigfiles/kitepower.toml"
    ),
    "campaign": lambda: toml("fixtures/campaign/campaign.toml", "fixtures/measured/campaign.toml"),
    "table": lambda: toml("winchcascade/published/hsu2026-table2.toml"),
}
"""By the kind of file, the whole ones to start from."""


@cache
def seeds(form: str) -> tuple[bytes, ...]:
    """The whole files of a kind, made once."""
    return tuple(SEEDS[form]())
