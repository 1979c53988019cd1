"""Whole files of every kind that is read: what a mutation starts from, the same bytes at every call."""

import datetime as dt
import io
import json
import tempfile
import zipfile
from collections.abc import Callable, Sequence
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

from winchcascade.core.rig_toml import built_in_text
from winchcascade.ingest.read import read_run
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.uncertainty import uncertainty
from winchcascade.report.records import reduction_json

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


def text(delimiter: str = ",", decimal: str = ".", end: str = "\n", rows: Sequence[Sequence[str]] = ROWS) -> str:
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
    top += "***End_of_Header***\t\n\nChannels\t7\nDelta_X" + f"\t{STEP}" * 7 + "\n***End_of_Header***\n"
    return top + "\t".join(["X_Value", *HEADERS[1:], "Comment"]) + "\n" + "".join("\t".join(r) + "\t\n" for r in ROWS)


def toa5() -> str:
    """The log as Campbell's loggers write it."""
    quoted = [["TIMESTAMP", "RECORD", *NAMES[1:]], ["TS", "RN", *UNITS[1:]], ["", "", *["Smp"] * 7]]
    top = '"TOA5","rig","CR1000","1","CR1000.Std","CPU:rig.CR1","1","Table1"\n'
    top += "".join(",".join(f'"{cell}"' for cell in row) + "\n" for row in quoted)
    clock = [f'"2026-04-18 10:{int(float(r[0]) // 60):02d}:{float(r[0]) % 60:05.2f}"' for r in ROWS]
    return top + "".join(
        f"{stamp},{k},{','.join(row[1:])}\n" for k, (stamp, row) in enumerate(zip(clock, ROWS, strict=True))
    )


def delimited() -> list[bytes]:
    """The dialects of text."""
    preamble = "Sample rate: 12.5 Hz\nload_ohm: 36\n\n"
    chinese = text("\t").replace("Time", "時間").replace("Vdc", "直流電壓").replace("Idc", "直流電流")
    return [
        text().encode(),
        text(";", ",", "\r\n").encode("utf-16"),
        chinese.encode("cp950"),
        (preamble + text(" | ")).encode(),
        text(rows=[[f'"{cell}"' for cell in row] for row in ROWS], decimal=",").encode(),
        stamped().encode(),
        text("   ", end="\r").encode(),
        *(
            (ROOT / "fixtures" / "damaged_logs" / name).read_bytes()[:60_000]
            for name in ("dropouts.csv", "units_row.csv")
        ),
        b"time_s,velocity_mps\n" + b"".join(f"{r[0]},{r[2]}\n".encode() for r in ROWS),
    ]


def _through_a_file(write: Callable[[Path], object]) -> bytes:
    """What a writer that insists on a path writes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "made"
        write(path)
        return path.read_bytes()


def _tdms(path: Path, *, clock: int, segments: int) -> None:
    waves = {"wf_increment": STEP, "wf_start_offset": 0.0} if clock else {}
    with TdmsWriter(str(path)) as writer:
        for k in range(segments):
            writer.write_segment(
                [RootObject({"load_ohm": 36.0})]
                + [
                    ChannelObject("Crane", name, np.array_split(DATA[name], segments)[k], waves | {"unit_string": unit})
                    for name, unit in list(zip(NAMES, UNITS, strict=True))[clock:]
                ]
            )


def tdms() -> list[bytes]:
    """TDMS with a clock in its properties, with one as a channel, in several segments."""
    made = ((True, 1), (False, 1), (True, 4))
    return [_through_a_file(partial(_tdms, clock=clock, segments=segments)) for clock, segments in made]


def _mat(**options: Any) -> bytes:
    stream: Any = io.BytesIO()
    whole: dict[str, Any] = DATA | {"load_ohm": 36.0}
    if options.get("format") != "4":
        whole = {"log": DATA | {"units": dict(zip(NAMES, UNITS, strict=True))}, "load_ohm": 36.0}
    savemat(stream, whole, **options)
    content: bytes = stream.getvalue()
    return content if options.get("format") == "4" else b"MATLAB 5.0 MAT-file".ljust(116) + content[116:]


def _mat_named() -> bytes:
    stream: Any = io.BytesIO()
    names, units = np.array(NAMES, dtype=object), np.array(UNITS, dtype=object)
    savemat(stream, {"data": np.array(list(DATA.values())).T, "names": names, "units": units, "fs": 1 / STEP})
    content: bytes = stream.getvalue()
    return b"MATLAB 5.0 MAT-file".ljust(116) + content[116:]


def mat() -> list[bytes]:
    """MATLAB v4, v5 plain and compressed, and a matrix with a list of names."""
    return [_mat(format="4"), _mat(), _mat(do_compression=True), _mat_named()]


def _mat73(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        file.create_dataset("load_ohm", data=np.full((1, 1), 36.0)).attrs["MATLAB_class"] = np.bytes_("double")
        log = file.create_group("log")
        units = log.create_group("units")
        for name, unit in zip(NAMES, UNITS, strict=True):
            log.create_dataset(name, data=np.atleast_2d(DATA[name])).attrs["MATLAB_class"] = np.bytes_("double")
            letters = np.array([[ord(letter)] for letter in unit], dtype=np.uint16)
            units.create_dataset(name, data=letters).attrs["MATLAB_class"] = np.bytes_("char")
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + path.read_bytes()[512:])


def mat73() -> list[bytes]:
    """MATLAB v7.3, which is HDF5."""
    return [_through_a_file(_mat73)]


def _parquet(table: Any, **options: Any) -> bytes:
    stream = io.BytesIO()
    pq.write_table(table, stream, **options)
    return stream.getvalue()


def parquet() -> list[bytes]:
    """Parquet of numbers, plain and compressed in several row groups, and of texts with stamps."""
    fields = [pa.field(n, pa.float64(), metadata={"unit": unit}) for n, unit in zip(NAMES, UNITS, strict=True)]
    numbers = pa.table(list(DATA.values()), schema=pa.schema(fields, metadata={"load_ohm": "36"}))
    stamps = pa.array((DATA["Time"] * 1e3).astype(np.int64), pa.timestamp("ms"))
    texts = {header: [row[k] for row in ROWS] for k, header in enumerate(HEADERS) if k}
    mixed = pa.table({"Timestamp": stamps, **texts})
    return [
        _parquet(numbers, compression="none", use_dictionary=False),
        _parquet(numbers, compression="zstd", row_group_size=200),
        _parquet(mixed, compression="snappy"),
    ]


def _workbook(*, units: bool) -> bytes:
    stream = io.BytesIO()
    with xlsxwriter.Workbook(stream, {"in_memory": True}) as book:
        book.set_properties({"created": dt.datetime(2026, 4, 18)})
        book.add_worksheet("Notes").write_row(0, 0, ["Trial of the crane"])
        sheet = book.add_worksheet("Log")
        sheet.write_row(0, 0, NAMES if units else HEADERS)
        if units:
            sheet.write_row(1, 0, UNITS)
        for k, row in enumerate(ROWS[:500]):
            sheet.write_row(k + 1 + units, 0, [float(cell) for cell in row])
    return stream.getvalue()


def _sheet() -> list[list[Any]]:
    return [HEADERS, *([float(cell) for cell in row] for row in ROWS[:500])]


def _binary_workbook() -> bytes:
    stream = io.BytesIO()
    xlsb.write(stream, xlsb.sheet(_sheet()))
    return stream.getvalue()


def zipped(parts: dict[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """Parts as one zipped file."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as book:
        for name, content in parts.items():
            book.writestr(zipfile.ZipInfo(name, EPOCH), content, method)
    return stream.getvalue()


def unzipped(content: bytes) -> dict[str, bytes]:
    """The parts of a zipped file."""
    with zipfile.ZipFile(io.BytesIO(content)) as book:
        return {name: book.read(name) for name in book.namelist()}


def _ods() -> bytes:
    def row(cells: Sequence[str]) -> str:
        words = "<table:table-cell office:value-type='string'><text:p>{0}</text:p></table:table-cell>"
        numbers = "<table:table-cell office:value-type='float' office:value='{0}'/>"
        inner = "".join((words if cell[0].isalpha() else numbers).format(cell) for cell in cells)
        return f"<table:table-row>{inner}</table:table-row>"

    spaces = " ".join(f"xmlns:{x}='urn:oasis:names:tc:opendocument:xmlns:{x}:1.0'" for x in ("office", "table", "text"))
    sheet = f"<table:table table:name='Log'>{''.join(map(row, [HEADERS, *ROWS[:500]]))}</table:table>"
    body = f"<office:body><office:spreadsheet>{sheet}</office:spreadsheet></office:body>"
    return zipped(
        {
            "mimetype": b"application/vnd.oasis.opendocument.spreadsheet",
            "META-INF/manifest.xml": b"<manifest/>",
            "content.xml": f"<office:document-content {spaces}>{body}</office:document-content>".encode(),
        }
    )


def excel() -> list[bytes]:
    """Workbooks of Excel, zipped XML and zipped records, and of LibreOffice."""
    return [_workbook(units=False), _workbook(units=True), _ods(), _binary_workbook()]


def old_excel() -> list[bytes]:
    """A workbook of Excel 97."""
    return [xls.book(_sheet())]


def campaign() -> list[bytes]:
    """The shipped campaign, and one that uses every entry."""
    full = 'title = "Two loads"\nrig = "hsu2026"\n[[run]]\nfile = "r36ohm.csv"\nload_ohm = 36\nwindow_s = 5.48\n'
    full += 'cycles = [1, 2]\nwithheld = true\n[[run]]\nfile = "open_circuit.csv"\nload_ohm = inf\n'
    return [(ROOT / "fixtures" / "campaign" / "campaign.toml").read_bytes(), full.encode()]


def rig() -> list[bytes]:
    """The built-in rigs, and one that is based on another."""
    based = 'name = "mine"\nbased_on = "hsu2026"\n[winch]\nr_drum = { value = 140, unit = "mm" }\n[columns]\n'
    based += (
        'velocity = { name = "Velocity (m/s)", unit = "m/s" }\n[log]\nsample_rate_hz = 25\n[thresholds]\nwindow = 5.0\n'
    )
    return [*(built_in_text(name).encode() for name in ("hsu2026", "kitepower")), based.encode()]


def table() -> list[bytes]:
    """The built-in published table."""
    return [(ROOT / "winchcascade" / "published" / "hsu2026-table2.toml").read_bytes()]


@cache
def _reduction() -> bytes:
    reduction = reduce(read_run(LOG, load=36.0))
    return reduction_json(reduction, uncertainty(reduction))


def result() -> list[bytes]:
    """A reduction as `reduce` writes it, and what a batch says of its logs."""
    runs = [{"name": "r36ohm.csv", "fault": None, "result": "runs/r36ohm.csv.json"}]
    return [_reduction(), json.dumps({"schema": "winchcascade/campaign/1", "runs": runs}).encode()]


SEEDS: dict[str, Callable[[], list[bytes]]] = {
    "text": delimited,
    "lvm": lambda: [lvm().encode()],
    "toa5": lambda: [toa5().encode()],
    "tdms": tdms,
    "mat": mat,
    "mat73": mat73,
    "parquet": parquet,
    "excel": excel,
    "xls": old_excel,
    "rig": rig,
    "campaign": campaign,
    "table": table,
    "result": result,
}
"""By the kind of file, the whole ones to start from."""


@cache
def seeds(form: str) -> tuple[bytes, ...]:
    """The whole files of a kind, made once."""
    return tuple(SEEDS[form]())
