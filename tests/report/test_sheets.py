"""Pages of calibration, check, audit and simulation: what a laboratory files, from the same rows
as terminal and JSON.
"""

from __future__ import annotations

import csv
import json
import re
from html import unescape
from pathlib import Path
from typing import Any

import pytest
from calls import call
from pypdf import PdfReader

from winchcascade import audit
from winchcascade.core.errors import OptionError


def _run(*given: str | Path, code: int = 0) -> str:
    done = call(*given)
    assert done.code == code, done.out + done.err
    return done.out


def _text(page: Path) -> str:
    """What a page shows, without its marks."""
    body = re.sub(
        r"<(style|script|svg).*?</\1>", " ", page.read_text(encoding="utf-8"), flags=re.DOTALL
    )
    return re.sub(r"\s+", " ", unescape(re.sub(r"<[^>]+>", "", body)).replace("\u00a0", " "))


def _rows(page: Path, table: str) -> list[list[str]]:
    """Cells of a table of a page, as a spreadsheet takes them when they are copied."""
    (found,) = re.findall(
        rf'<table id="table-{table}".*?</table>', page.read_text(encoding="utf-8"), flags=re.DOTALL
    )
    rows = re.findall(r"<tr>(.*?)</tr>", found, flags=re.DOTALL)
    return [
        [
            unescape(re.sub(r"<[^>]+>", "", c)).strip()
            for c in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row, re.DOTALL)
        ]
        for row in rows
    ]


def test_a_calibration_sheet_holds_what_a_laboratory_files(fixtures: Path, tmp_path: Path) -> None:
    log, page = fixtures / "campaign" / "open_circuit.csv", tmp_path / "sheet.html"
    found = json.loads(
        _run("calibrate", log, "--json", "-", "--html", page, "--pdf", tmp_path / "sheet.pdf")
    )
    assert found["log"]["sha256"] in _text(page)
    rows = _rows(page, "calibrated-numbers")[1:]
    assert [row[0] for row in rows] == [n["name"] for n in found["numbers"]]
    for row, number in zip(rows, found["numbers"], strict=True):
        assert float(row[2]) == pytest.approx(number["value"], abs=number["u"])
        low, high = map(float, row[4].split(" to "))
        assert low < float(row[2]) < high
    for figure in ("model-damper", "model-emf"):
        assert f'id="figure-{figure}"' in page.read_text(encoding="utf-8")
    pdf = " ".join(found.extract_text() for found in PdfReader(tmp_path / "sheet.pdf").pages)
    assert "Calibrated numbers of the rig." in pdf


def test_a_simulation_states_what_its_energies_cover_and_its_histories(
    fixtures: Path, tmp_path: Path
) -> None:
    log, page = fixtures / "campaign" / "r36ohm.csv", tmp_path / "page.html"
    printed = _run(
        "simulate",
        log,
        "--out",
        tmp_path / "sim.csv",
        "--with",
        "line_friction.torque=2",
        "--html",
        page,
    )
    text = _text(page)
    assert "line_friction.torque=2" in text
    assert 'id="figure-histories"' in page.read_text(encoding="utf-8")
    for name, joule, *_ in _rows(page, "ledger")[1:]:
        assert re.search(rf"^{name} +{joule} ", printed, re.MULTILINE)
    assert [row[0] for row in _rows(page, "stages")[1:]] == ["line", "shaft", "DC link"]


def test_a_simulated_line_at_rest_has_histories_without_marks(tmp_path: Path) -> None:
    profile = tmp_path / "rest.csv"
    profile.write_text("time_s,velocity_mps\n" + "".join(f"{k / 10},0.0\n" for k in range(100)))
    page = tmp_path / "rest.html"
    _run(
        "simulate",
        "--profile",
        profile,
        "--load-ohm",
        "9",
        "--out",
        tmp_path / "sim.csv",
        "--html",
        page,
    )
    assert page.is_file()


def test_an_audit_of_operating_points_lists_every_broken_cell(tmp_path: Path) -> None:
    table = tmp_path / "points.toml"
    table.write_text(
        'title = "Bench"\nsource = "made here"\ncsv = "points.csv"\nkey = ["speed"]\n'
        "[columns]\n"
        'speed = { name = "n", unit = "rpm" }\ntorque = { name = "T", unit = "N m" }\n'
        'power_shaft = { name = "P", unit = "W" }\n'
    )
    (tmp_path / "points.csv").write_text("n,T,P\n1000,10.0,1047\n2000,10.0,2094\n3000,10.0,9999\n")
    found = json.loads(_run("audit", table, "--json", "-", "--html", tmp_path / "a.html", code=1))
    rows = _rows(tmp_path / "a.html", "contradictions")[1:]
    assert len(rows) == len(found["contradictions"]) >= 1
    assert all("speed 3000 rpm" in row for row in rows)
    result = audit(table)
    assert not result.ok
    with pytest.raises(OptionError, match="table of operating points"):
        audit(table, physics=True)
    with pytest.raises(OptionError, match="of use with physics alone"):
        audit("hsu2026-table2", rig="hsu2026")


def test_a_check_gives_each_cell_its_verdict(fixtures: Path, tmp_path: Path) -> None:
    narrow = ("--tolerance", "deviation=0", "--tolerance", "uncertainty=0")
    printed = _run(
        "check", fixtures / "campaign", "--against", "hsu2026-table2", *narrow, "--json", tmp_path / "c.json",
        "--html", tmp_path / "c.html", "--tables", tmp_path / "tables", code=1,
    )  # fmt: skip
    cells: list[dict[str, Any]] = json.loads((tmp_path / "c.json").read_text())["cells"]
    for table, outcome in (("cells", "miss"), ("agreeing", "ok")):
        rows = _rows(tmp_path / "c.html", table)[1:]
        listed = [cell for cell in cells if cell["outcome"] == outcome]
        assert [float(row[3]) for row in rows] == pytest.approx(
            [cell["printed"] for cell in listed]
        )
        name = f"hsu2026-table2_check_{table}.csv"
        with (tmp_path / "tables" / name).open(encoding="utf-8", newline="") as file:
            assert [float(row["found"]) for row in csv.DictReader(file)] == [
                cell["measured"] for cell in listed
            ]
    assert printed.count("differs\n") == sum(cell["outcome"] == "miss" for cell in cells)
