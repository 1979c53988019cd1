"""The report of a diagnosis: one page for whoever decides, then the evidence, for every verdict, as page and as PDF."""

import io
import math
import re
from contextlib import nullcontext
from functools import cache

import msgspec
import pytest
from diagnosed import diagnosed
from pypdf import PdfReader
from undrawn import undrawn
from winchcascade.report.diagnosis import make_diagnosis_report

from winchcascade.diagnosis.diagnosis_result import Alternative, Spot
from winchcascade.report.cause_costs import COLUMNS, cost_section, lead_picture, waterfall_costs
from winchcascade.report.digits import MINUS
from winchcascade.report.publish import html_text, pdf_bytes
from winchcascade.report.sheet import Picture, Report, Table

ALL = ["copper", "rolloff", "nothing", "outsider"]


@cache
def report(name: str) -> Report:
    """The report of one of the diagnoses; one of them is drawn."""
    with nullcontext() if name == "copper" else undrawn():
        return make_diagnosis_report(diagnosed(name), command="winchcascade diagnose here")


def tables(made: Report) -> dict[str, Table]:
    return {b.id: b for s in made.sections for b in s.blocks if isinstance(b, Table)}


def pictures(made: Report) -> dict[str, Picture]:
    return {b.id: b for s in made.sections for b in s.blocks if isinstance(b, Picture)}


def points(made: Report) -> dict[str, str]:
    return {point.about: point.text for point in made.points}


def value(cell: str) -> float:
    return float(cell.replace(MINUS, "-"))


def test_the_first_page_answers_where_which_how_sure_how_far_and_what_next() -> None:
    shown = points(report("copper"))
    assert {"Verdict", "Where", "Cause", "How sure", "How far", "What next", "Residual", "Data"} <= set(shown)
    assert shown["Cause"].startswith(
        "Stator resistance (copper_heating): stator resistance lies above its stated value"
    )
    assert [tile.value for tile in report("copper").tiles] == ["Explained", "Stator resistance", "> 99 %"]
    interval = report("copper").tiles[1].interval
    assert re.fullmatch(r"copper_heating: stator resistance \+[\d.]+ % \(95 %: [\d.]+ to [\d.]+ %\)", interval)


def test_without_a_gap_the_first_page_shows_what_would_have_been_seen() -> None:
    shown = points(report("nothing"))
    assert "What was checked" in shown
    assert re.search(r"stator resistance \+\d", shown["What would show"])
    verdict, largest, tried = report("nothing").tiles
    assert (verdict.value, tried.value) == ("No gap", "4")
    assert float(largest.value) == pytest.approx(max(abs(p.z) for p in diagnosed("nothing").places), abs=0.06)
    assert "Where" not in shown


def test_what_no_suspect_explains_is_reported_as_such() -> None:
    shown = points(report("outsider"))
    assert shown["Verdict"].startswith("No cause is named") or "outside the catalogue" in shown["Verdict"]
    assert "signs of something unexplained" in shown["Residual"]
    assert report("outsider").tiles[0].interval == "no cause named"
    assert report("outsider").tiles[2].symbol == "Strongest sign"


@pytest.mark.parametrize("name", ALL)
def test_every_table_has_a_cell_under_every_head(name: str) -> None:
    for table in tables(report(name)).values():
        assert len(table.units) == len(table.head)
        assert {len(row) for row in table.rows} == {len(table.head)}
        assert max(table.text_columns) < len(table.head)


@pytest.mark.parametrize("name", ALL)
def test_every_figure_says_in_words_what_it_shows(name: str) -> None:
    for picture in pictures(report(name)).values():
        assert picture.caption.endswith(".")
        assert picture.alt.endswith(".")
        assert picture.svg.startswith("<svg")


def test_the_figures_of_the_paper_are_there_for_any_campaign() -> None:
    assert {"map", "stages", "closure-bars", "history", "errors", "speed", "numbers", "odds"} <= set(
        pictures(report("copper"))
    )
    assert "rolloff" in pictures(report("rolloff"))
    assert {"map", "history", "errors", "speed"} <= set(pictures(report("nothing")))


@pytest.mark.parametrize("name", ALL)
def test_simulated_logs_are_called_measured_nowhere(name: str) -> None:
    made = report(name)
    words = " ".join([b.caption for s in made.sections for b in s.blocks if isinstance(b, (Table, Picture))])
    assert "easured" not in words


def test_the_table_of_the_closure_holds_the_root_mean_squares() -> None:
    found = diagnosed("copper")
    assert found.closure is not None
    rows = {row[0]: row for row in tables(report("copper"))["closure"].rows}
    for name, shown in (("torque", "torque"), ("vdc", "Vdc"), ("idc", "Idc"), ("force", "line tension")):
        x = found.closure.channels[name]
        for cell, number in zip(rows[shown][2:5], (x.before, x.after, x.noise), strict=True):
            assert value(cell) == pytest.approx(number, rel=0.06)


def test_the_places_are_reported_worst_first_with_their_yardsticks() -> None:
    rows = tables(report("copper"))["places"].rows
    z = [abs(value(row[-1])) for row in rows]
    assert z == sorted(z, reverse=True)
    assert all(value(cell) >= 0.0 for row in rows for cell in row[5:8] if cell != "–")


def test_each_stage_and_phase_is_reported_at_its_worst_load() -> None:
    found = diagnosed("outsider")
    rows = tables(report("outsider"))["stages"].rows
    assert rows[0][:3] == ("gearbox: torque (N·m)", "Vdc, Idc", "payout")
    z = [abs(value(row[-1])) for row in rows]
    assert z == sorted(z, reverse=True)
    assert z[0] == pytest.approx(max(abs(place.z) for place in found.stages), rel=0.03)
    assert "Stage by stage" in pictures(report("outsider"))["stages"].caption


def test_suspects_that_are_not_needed_are_listed_with_their_odds() -> None:
    rows = tables(report("copper"))["suspects"].rows
    assert {row[0] for row in rows} == {"ke_rolloff", "line_drag", "force_zero"}
    assert all(" : " in row[-1] for row in rows)
    assert "thresholds" not in tables(report("copper"))


def test_without_a_cause_every_suspect_has_its_threshold() -> None:
    for name in ("nothing", "outsider"):
        assert {row[0] for row in tables(report(name))["thresholds"].rows} == set(diagnosed(name).suspects)
        assert "suspects" not in tables(report(name))


def test_alarms_and_nuisances_are_reported_with_limit_and_unit() -> None:
    made = tables(report("outsider"))
    assert all(value(row[3]) > value(row[4]) for row in made["alarms"].rows)
    names = {row[0] for row in made["nuisances"].rows}
    assert "mesh efficiency" in names
    assert "alarms" not in tables(report("copper"))


def test_a_nuisance_of_the_rig_is_reported_in_the_unit_of_its_file() -> None:
    from winchcascade.report.diagnosis_tables import _nuisance_row

    from winchcascade.diagnosis.nuisances import Nuisance

    row = _nuisance_row(Nuisance("rig", "l_s", 5e-5, "mH", section="generator"), 2.0, [])
    assert row == ("phase inductance", "0.10", "0.050", "mH", "+2.0")


def test_rivals_stand_in_the_tables_with_what_distinguishes_them() -> None:
    found = diagnosed("copper")
    rival = Alternative("line_drag", 0.3, Spot("torque", "payout", math.inf, z=1.9))
    cause = msgspec.structs.replace(found.causes[0], probability=0.7, look_alikes=(rival,))
    made = make_diagnosis_report(msgspec.structs.replace(found, causes=(cause,)))
    assert tables(made)["rivals"].rows == (
        (
            "Stator resistance (copper_heating)",
            "Line drag (line_drag)",
            "0.30",
            "Drag between line and torque sensor in proportion to speed.",
            "torque during payout at open circuit, by 1.9 standard deviations",
        ),
    )
    assert "table of alternatives" in tables(made)["causes"].note
    assert "Or in its place line_drag." in points(made)["Cause"]


def test_provenance_names_logs_hashes_seed_and_command() -> None:
    made = tables(report("copper"))
    assert [row[0] for row in made["logs"].rows] == ["r18ohm.csv", "r4p5ohm.csv"]
    rows = {row[0]: row[1] for row in made["provenance"].rows}
    assert rows["Seed of the resampled cycles"] == "1"
    assert rows["Command"] == "winchcascade diagnose here"
    assert "ke_rolloff" in rows["Suspects"]


@pytest.mark.parametrize("name", ALL)
def test_page_and_pdf_hold_the_same_verdict(name: str) -> None:
    made = report(name)
    page = html_text(made)
    assert "<script" not in page.replace("<script>", "<script", 1).split("</head>")[0]
    pages = PdfReader(io.BytesIO(pdf_bytes(made))).pages
    first = pages[0].extract_text()
    assert made.tiles[0].value in page
    assert made.tiles[0].value.replace(" ", "") in first.replace(" ", "").replace("\n", "")
    assert len(pages) >= 4


def test_a_title_from_a_file_is_never_markup() -> None:
    found = msgspec.structs.replace(diagnosed("nothing"), title="<b>bold</b> #[typst] $x$")
    made = make_diagnosis_report(found)
    assert "<b>bold</b>" not in html_text(made)
    assert "#[typst]" in PdfReader(io.BytesIO(pdf_bytes(made))).pages[0].extract_text()


def test_the_documentation_states_the_numbers_of_the_code() -> None:
    from pathlib import Path

    from winchcascade.diagnosis import causes, closure, evidence, nuisances

    text = " ".join((Path(__file__).parents[2] / "docs" / "diagnosis.md").read_text(encoding="utf-8").split())
    assert f"over all logs | {closure.ROUGH:g} |" in text
    assert f"rings) | {closure.RESTLESS:g} |" in text
    assert f"in its standard uncertainties | {closure.PULLED:g} |" in text
    assert f"costs less than {evidence.CLEARLY:g}" in text
    assert f"falls short by less than {causes.AS_GOOD:g}" in text
    assert f"from {closure.DRAWS} sets of cycles" in text
    for sd, _ in nuisances.ABSENT.values():
        assert f"{sd:g} N" in text
    for share in nuisances.OF_THE_MODEL.values():
        assert f"{100 * share:g} %" in text


def test_a_law_that_the_rig_file_does_not_state_has_a_name_of_its_own() -> None:
    from winchcascade.diagnosis.nuisances import ABSENT, Nuisance
    from winchcascade.report.gap_words import _LAWS, nuisance_words

    laws = [Nuisance("law", name, sd, unit, section=part) for (part, name), (sd, unit) in ABSENT.items()]
    assert {str(law) for law in laws} == set(_LAWS)
    assert "_" not in " ".join(nuisance_words(law, []) for law in laws)


def test_the_waterfalls_of_few_loads_stand_at_the_head_of_the_page_alone() -> None:
    found = diagnosed("copper")
    table = found.contributions
    more = tuple(
        msgspec.structs.replace(one, load=(one.load or 0.0) + 100.0 * k) for k in range(COLUMNS) for one in table
    )
    for one, drawn in ((found, False), (msgspec.structs.replace(found, contributions=more), True)):
        assert (len(waterfall_costs(one)) > COLUMNS) == drawn
        blocks = cost_section(one).blocks
        assert any(isinstance(block, Picture) for block in blocks) == drawn
        assert lead_picture(one) is not None


def test_each_cause_is_explained_in_the_table_of_causes_alone() -> None:
    found = diagnosed("rolloff")
    meaning = found.suspects["ke_rolloff"].summary
    cells = [cell for table in tables(report("rolloff")).values() for row in table.rows for cell in row]
    assert cells.count(meaning) == 1
