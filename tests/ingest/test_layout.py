"""Layout: whatever stands around the numbers of a text log, the same numbers are found."""

from __future__ import annotations

from pathlib import Path

import pytest
from campaign_log import (
    HEAD,
    NAMES,
    ROWS,
    SAME,
    UNITS,
    clean,
    efficiencies,
    kinds,
    read,
    stamps,
    text,
)

from winchcascade import read_run
from winchcascade.core.errors import LogError
from winchcascade.ingest.formats.text import find_encoding
from winchcascade.ingest.layout import waveform

GLUED = [header.replace(" ", "") for header in HEAD]
NO_TIME = [row[1:] for row in ROWS]
PREAMBLE = "Test rig: winch 3\nOperator: Lin, Wang\nDate: 2026-04-18\nSample rate: 25 Hz\nLoad (ohm): 36\n\n"
GROUPS = ["", "Line", "Line", "Accumulator", "Line", "Shaft", "DC link", "DC link"]


def rows_of(
    *above: list[str], head: list[str] = HEAD, delimiter: str = ",", decimal: str = "."
) -> str:
    return text([*above, *ROWS], head, delimiter=delimiter, decimal=decimal)


def labview(axis: str, decimal: str, *, comment: bool, segment: int = len(ROWS)) -> str:
    """An .lvm file as LabVIEW's Write To Measurement File writes it, with a heading above each
    segment of so many rows.
    """
    n, apart = len(NAMES) - 1, "\t\t" if axis == "Multi" else "\t"
    top = [
        "LabVIEW Measurement",
        "Separator\tTab",
        f"Decimal_Separator\t{decimal}",
        f"X_Columns\t{axis}",
        "Time_Pref\tRelative",
    ]
    block = {
        "Samples": "2767",
        "Date": "2026/04/18",
        "Time": "10:00:00.1234",
        "X_Dimension": "Time",
        "X0": "0.0E+0",
        "Delta_X": "0.04",
    }
    lines = [*top, "***End_of_Header***", "\t", f"Channels\t{n}" + "\t" * n]
    lines += [f"{key}\t" + apart.join([value] * n) + "\t" for key, value in block.items()]
    lines[8:8] = ["Y_Unit_Label\t" + apart.join(UNITS[1:]) + "\t"]
    names = apart.replace("\t\t", "\tX_Value\t").join(NAMES[1:])
    lines += ["***End_of_Header***" + "\t" * (n + 1), f"X_Value\t{names}" + "\tComment" * comment]
    heading = lines[len(top) + 2 :]
    for k, (t, *values) in enumerate(ROWS):
        lines += heading if k and k % segment == 0 else []
        middle = f"\t{t}\t" if axis == "Multi" else "\t"
        lines.append(("" if axis == "No" else t) + "\t" + middle.join(values) + "\t" * comment)
    return "\r\n".join(lines).replace(".", decimal).replace("N,m", "N.m") + "\r\n"


def campbell() -> str:
    names = '"TIMESTAMP","RECORD","Disp","Velocity","Pressure","Force","Torque","Vdc","Idc"\n'
    units = '"TS","RN","m","m/s","kg/cm2","N","N.m","Volts","Amps"\n"","","Smp","Smp","Smp","Smp","Smp","Smp","Smp"\n'
    when = stamps("%Y-%m-%d %H:%M:%S.~", digits=2)
    body = "".join(
        f'"{s}",{k},{",".join(row[1:])}\n'
        for k, (s, row) in enumerate(zip(when, ROWS, strict=True))
    )
    return (
        '"TOA5","CR1000X","CR1000X","1234","CPU:winch.CR1X","5678","Fast"\n' + names + units + body
    )


WRITTEN: dict[str, str] = {
    "semicolon": text(delimiter=";"),
    "semicolon, decimal comma": text(delimiter=";", decimal=","),
    "tab, decimal comma": text(delimiter="\t", decimal=","),
    "bar": text(delimiter=" | "),
    "bars around a table": "".join(f"| {' | '.join(row)} |\n" for row in [HEAD, *ROWS]),
    "comma and blank": text(delimiter=", "),
    "blanks": text(head=GLUED, delimiter="   "),
    "blanks, decimal comma": text(head=GLUED, delimiter=" ", decimal=","),
    "blanks, blanks in names": text(delimiter="   "),
    "fixed width": "".join("".join(f"{cell:>20}" for cell in row) + "\n" for row in [HEAD, *ROWS]),
    "one blank, blanks in names": text(head=[*HEAD[:2], "Line speed (m/s)", *HEAD[3:]], delimiter=" "),
    "quoted": text([[f'"{c}"' for c in row] for row in ROWS], [f'"{c}"' for c in HEAD]),
    "quoted, decimal comma": text([[f'"{c}"' for c in row] for row in ROWS], decimal=","),
    "quoted names": text(head=[f'"{c}"' for c in HEAD]),
    "single quotes": text([[f"'{c}'" for c in row] for row in ROWS]),
    "carriage returns": text(end="\r\n"),
    "lone carriage returns": text(end="\r"),
    "two carriage returns": text(end="\r\r\n"),
    "blank lines": text(end="\n\n"),
    "blank lines first": "\n\n" + text(),
    "no line end at the end": text().rstrip("\n"),
    "no line end at the end, bare carriage returns": text(end="\r").rstrip("\r"),
    "control-Z at the end": text() + "\x1a",
    "separator hint": "sep=;\n" + text(delimiter=";"),
    "preamble": PREAMBLE + text(),
    "preamble, semicolons": PREAMBLE + text(delimiter=";", decimal=","),
    "comments": "# rig 3\n# load_ohm = 36\n# " + text(),
    "names apart by commas, rows by blanks": f"#{','.join(GLUED)}\n{text(head=None, delimiter=' ')}",
    "percent": "% " + text(delimiter="\t"),
    "units row": rows_of(UNITS, head=NAMES),
    "units row in brackets": rows_of([f"[{unit}]" for unit in UNITS], head=NAMES),
    "units row, blank line": rows_of(UNITS, [""], head=NAMES),
    "units row, dashes": rows_of(UNITS, ["---"] * 8, head=NAMES),
    "units above names": rows_of(NAMES, head=UNITS),
    "groups above names": rows_of(HEAD, head=GROUPS),
    "groups, names, units": rows_of(NAMES, UNITS, head=GROUPS),
    "delimiter after each row": "".join(",".join(row) + ",\n" for row in [HEAD, *ROWS]),
    "delimiter after each row of data": ",".join(HEAD) + "\n" + "".join(",".join(row) + ",\n" for row in ROWS),
    "three delimiters after each row of data": ";".join(HEAD) + "\n" + "".join(";".join(r) + ";;;\n" for r in ROWS),
    "delimiter after the names": ",".join(HEAD) + ",\n" + text(head=None),
    "names repeated": text(ROWS[:1000]) + text(ROWS[1000:2000]) + text(ROWS[2000:]),
    "preamble repeated": PREAMBLE + text(ROWS[:1000]) + PREAMBLE + text(ROWS[1000:]),
    "footer": text() + "\nEnd of log\nTotal samples: 2767\n",
    "row numbers of R": " ".join(f'"{h}"' for h in HEAD) + "\n" + "".join(f'"{k}" {" ".join(r)}\n' for k, r in enumerate(ROWS)),
    "row numbers without a name": ",".join(HEAD) + "\n" + "".join(f"{k},{','.join(r)}\n" for k, r in enumerate(ROWS)),
    "Campbell TOA5": campbell(),
} | {
    f"LabVIEW, X_Columns {axis}, {decimal}{' with comments' * comment}": labview(axis, decimal, comment=comment)
    for axis in ("One", "Multi", "No")
    for decimal in ".,"
    for comment in (True, False)
}  # fmt: skip


@pytest.mark.parametrize("way", WRITTEN)
def test_a_clean_log_reads_the_same_however_it_is_written(way: str, tmp_path: Path) -> None:
    run = read(tmp_path, WRITTEN[way])
    assert kinds(run) == set()
    assert run.samples == len(ROWS)
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


UNICODE = ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32"]


@pytest.mark.parametrize("encoding", UNICODE)
def test_unicode_reads_the_same_with_and_without_a_mark(encoding: str, tmp_path: Path) -> None:
    run = read(tmp_path, text(delimiter=";", decimal=",", end="\r\n"), encoding)
    assert kinds(run) == set()
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


@pytest.mark.parametrize(
    ("word", "encoding"), [("Größe", "cp1252"), ("直流電壓", "cp950"), ("張力", "utf-8")]
)
def test_the_encoding_is_the_one_in_which_the_names_read_best(word: str, encoding: str) -> None:
    assert find_encoding(f"Time (s);{word} (V)\n0,0;1,0\n".encode(encoding)) == encoding


@pytest.mark.parametrize(
    "line",
    [
        "Sample rate: 25 Hz", "Sample Rate (Hz),25", "Sampling interval [ms]: 40", "dt = 0.04", "# fs = 25",
        "Sample interval,0.04,s", "Sampling rate;25,0 Hz", "Sample Rate:\t25", "Abtastrate: 25 Hz", "取樣頻率: 25 Hz",
        "採樣頻率(Hz),25", "Sampling frequency (kHz): 0.025", "Sample Period: 40 ms", "Sample interval: 40000 us",
        "Scan rate: 25 S/s", "Rate (Hz): 25", "Sample rate: 1500 samples/min", "Sample rate: "
                                                                               "0.025 kS/s",
    ],
)  # fmt: skip
def test_a_sampling_rate_in_the_preamble_stands_in_for_a_time_column(
    line: str, tmp_path: Path
) -> None:
    run = read(tmp_path, f"{line}\n{text(NO_TIME, HEAD[1:])}")
    assert run.fs == pytest.approx(25.0)
    assert kinds(run) == set()
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


REJECTED: dict[str, tuple[str | bytes, str]] = {
    "empty": (b"", "the file is empty"),
    "names only": (",".join(HEAD) + "\n", "column names but no rows of numbers"),
    "names without a line end": (",".join(HEAD), "column names but no rows of numbers"),
    "two rows": (text(ROWS[:2]), "the log has 2 rows"),
    "no names": (text(head=None), "rows of 8 numbers but no column names"),
    "one column": ("\n".join(row[2] for row in ROWS), "no table of numbers"),
    "comma inside a name": (
        text(head=[*HEAD[:4], "Force, line (N)", *HEAD[5:]]),
        "9 column names above rows of 8 cells",
    ),
    "decimal commas between commas": (text(decimal=","), "8 column names above rows of 16 cells"),
    "prose": (
        "It was the best of times, it was the worst of times.\n" * 300,
        "no table of numbers",
    ),
    "blank": ("   \n" * 100, "no table of numbers"),
    "HTML": ("<!DOCTYPE html><table><tr><td>1</td></tr></table>\n" * 9, "no table of numbers"),
    "JSON": ('{"time": [0, 1, 2],\n "velocity": [0, 1, 2]}\n', "no table of numbers"),
    "PNG": (b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 9, "is a PNG picture"),
    "NUL bytes": (bytes(5000), "is a binary file"),
    "junk": (
        bytes(i * i % 251 for i in range(99_999)),
        "is a binary file|no table|lines of more than",
    ),
    "junk without line ends": (
        bytes(128 + i * i % 97 for i in range(300_000)),
        "lines of more than 64 kB",
    ),
    "20 MB in one line": (b"1.5," * (5 << 20), "lines of more than 64 kB"),
    "20 MB in one line of brackets": (b"(" * (20 << 20), "lines of more than 64 kB"),
    "100 000 columns": ((",".join(["1.5"] * 100_000) + "\n") * 12, "lines of more than 64 kB"),
}


@pytest.mark.parametrize("what", REJECTED)
def test_what_is_no_log_is_rejected_in_one_sentence(what: str, tmp_path: Path) -> None:
    content, words = REJECTED[what]
    with pytest.raises(LogError, match=words) as caught:
        read(tmp_path, content)
    message = str(caught.value)
    assert message.startswith("log.csv: ")
    assert message.endswith(".")
    assert "\n" not in message


def test_a_folder_and_a_missing_file_are_no_logs(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "none.csv"):
        with pytest.raises(LogError, match="give the path of"):
            read_run(path)


LETTERS = ["t", "x", "v", "p", "F", "M", "U", "I"]


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " "])
def test_names_of_single_letters_are_names_though_some_are_units_too(
    delimiter: str, tmp_path: Path
) -> None:
    run = read(tmp_path, rows_of(head=LETTERS, delimiter=delimiter))
    assert kinds(run) == {"unit_assumed"}
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


@pytest.mark.parametrize(
    ("above", "columns"), [([], (0, 1, 2)), ([["Operator", "Lin", "", ""]], (0, 2, 4, 5))]
)
def test_a_line_of_letters_is_the_names_where_no_other_line_is(
    above: list[list[str]], columns: tuple[int, ...], tmp_path: Path
) -> None:
    head, *rows = [[line[k] for k in columns] for line in (LETTERS, *ROWS)]
    run = read(tmp_path, text([*above, head, *rows], None))
    assert set(run.channels) >= {"velocity"}
    assert run.samples == len(ROWS)


def test_units_without_names_above_them_are_reported(tmp_path: Path) -> None:
    rows = [row[:3] for row in ROWS]
    with pytest.raises(LogError, match=r"no column names above them \(they hold s, m, m/s\)"):
        read(tmp_path, text(rows, UNITS[:3]))


@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("axis", ["One", "Multi", "No"])
def test_headings_that_labview_repeats_are_no_rows(axis: str, decimal: str, tmp_path: Path) -> None:
    run = read(tmp_path, labview(axis, decimal, comment=True, segment=500))
    assert kinds(run) == set()
    assert run.samples == len(ROWS)
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


RATES = """40 ms|0.04 s|40000 us|25 Hz|0.025 kHz|25000 mHz|25 S/s|0.025 kS/s|25 Sa/s|25 sps|25 samples/s|1500 samples/min|25 /s
25 samples per second|1500 1/min|25 1/s|25 per second|40 milliseconds|25 Hz nominal|0.000025 MHz""".replace(
    "\n", "|"
).split("|")


@pytest.mark.parametrize("key", ["Sample rate", "Sampling interval"])
@pytest.mark.parametrize("value", RATES)
def test_the_unit_decides_whether_a_preamble_states_a_period_or_a_rate(
    key: str, value: str
) -> None:
    assert waveform({key: value}) == pytest.approx((0.04, 0.0))
    number, _, unit = value.partition(" ")
    assert waveform({f"{key} ({unit})": number}) == pytest.approx((0.04, 0.0))


@pytest.mark.parametrize("value", ["25 N", "0.5 mm/s", "115200 baud", "25 furlongs"])
def test_a_rate_in_a_unit_that_is_none_of_time_or_frequency_is_no_rate_of_samples(
    value: str,
) -> None:
    assert waveform({"Rate": value}) == (None, 0.0)
