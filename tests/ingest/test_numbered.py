"""Logs without names: the rig file numbers their columns."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from campaign_log import HEAD, ROWS, SAME, UNITS, clean, efficiencies, kinds, read
from openpyxl import Workbook
from paper_rules import PAPER_RULES
from read_here import readers_here
from seeds import zipped

from winchcascade.core.errors import LogError
from winchcascade.core.rig_toml import parse_rig

CHANNELS = ["time", "displacement", "velocity", "pressure", "force", "torque", "vdc", "idc"]
NUMBERED = "".join(
    f'{name} = {{ number = {k}, unit = "{unit}" }}\n'
    for k, (name, unit) in enumerate(zip(CHANNELS, UNITS, strict=True), 1)
)
BARE = "".join(",".join(row) + "\n" for row in ROWS)
NUMBERS = [[float(cell) for cell in row] for row in ROWS]


def workbook(*rows: Sequence[object]) -> bytes:
    """The bytes of a workbook with one sheet."""
    book, stream = Workbook(write_only=True), io.BytesIO()
    sheet = book.create_sheet()
    for row in rows:
        sheet.append(list(row))
    book.save(stream)
    return stream.getvalue()


def rig(columns: str) -> str:
    return f'based_on = "hsu2026"\nname = "numbered"\n[columns]\n{columns}'


@pytest.mark.parametrize(
    "content",
    [
        lambda: BARE.encode(),
        lambda: zipped({"run.csv": BARE.replace(",", ";").replace(".", ",").encode("utf-16")}),
        lambda: workbook(["a", *[None] * 7], UNITS, *NUMBERS),
    ],
    ids=["text", "zip, decimal commas", "sheet, units"],
)
def test_a_log_without_names_is_read_by_the_numbers_of_its_columns(
    content: Callable[[], bytes], tmp_path: Path
) -> None:
    with readers_here():
        run = read(tmp_path, content(), rig=parse_rig(rig(NUMBERED) + PAPER_RULES, "rig.toml"))
    assert kinds(run) == set()
    assert efficiencies(run) == pytest.approx(clean(), abs=SAME)


def test_a_log_without_numbers_or_with_one_beyond_its_columns_is_rejected_with_the_remedy(
    tmp_path: Path,
) -> None:
    for content in (BARE, workbook(*NUMBERS)):
        with (
            readers_here(),
            pytest.raises(
                LogError, match=r"number the columns in a rig file: \[columns\] velocity ="
            ),
        ):
            read(tmp_path, content)
    with pytest.raises(
        LogError, match="no column 9, which the rig numbered names for idc; the log has 8 columns"
    ):
        read(
            tmp_path,
            BARE,
            rig=parse_rig(rig(NUMBERED.replace("number = 8", "number = 9")), "rig.toml"),
        )


def test_columns_of_a_sheet_are_numbered_from_its_first_one(tmp_path: Path) -> None:
    """The velocity stands in column D, whether or not the columns before it have names."""
    for head in ([], [[None, None, "Zeit", None, *HEAD[3:]]]):
        rows = [[None, None, row[0], row[2], *row[3:]] for row in NUMBERS]
        numbers = 'time = { number = 3, unit = "s" }\nvelocity = { number = 4, unit = "m/s" }\n'
        with readers_here():
            run = read(tmp_path, workbook(*head, *rows), rig=parse_rig(rig(numbers), "rig.toml"))
        assert run.channels["velocity"].tolist() == [row[2] for row in NUMBERS]
        assert run.t[-1] == NUMBERS[-1][0]
