"""What the report of a diagnosis shows: every cause, alarm and look-alike, with the numbers that
were computed.
"""

from functools import cache
from typing import Any

import msgspec
import pytest
from diagnosed import SUSPECTS, diagnosed

from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.report.content import Cell, Measured, Note, Picture, Report, Span, Table
from winchcascade.report.glossary import CHANNELS
from winchcascade.report.results.diagnosis import diagnosis_report
from winchcascade.report.results.diagnosis_record import as_json
from winchcascade.report.results.effects import called
from winchcascade.rig.effects.catalogue import EFFECTS


@cache
def report(name: str) -> Report:
    return diagnosis_report(diagnosed(name), command="winchcascade diagnose here")


def tables(made: Report) -> dict[str, Table[Any]]:
    return {block.id: block for block in made.blocks if isinstance(block, Table)}


def pictures(made: Report) -> dict[str, Picture]:
    return {block.id: block for block in made.blocks if isinstance(block, Picture)}


def rows(table: Table[Any]) -> list[dict[str, Cell]]:
    return [
        dict(zip((column.name for column in table.columns), row, strict=True))
        for row in table.cells
    ]


def value(cell: Cell) -> float:
    number = cell.value if isinstance(cell, Measured) else cell
    assert isinstance(number, float)
    return number


def notes(made: Report) -> list[Note]:
    return [*made.notes, *(block for block in made.blocks if isinstance(block, Note))]


def said(made: Report) -> str:
    """Everything that a reader reads but the cells of tables."""
    shown = [block.caption for block in made.blocks if isinstance(block, Table | Picture)]
    return " ".join(
        [
            made.title,
            *(tile.value for tile in made.tiles),
            *(note.text for note in notes(made)),
            *shown,
        ]
    )


def changed(**changes: Any) -> ModelDiagnosis:
    """The diagnosis with one cause, with something else in that cause."""
    found = diagnosed("copper")
    return msgspec.structs.replace(
        found, causes=(msgspec.structs.replace(found.causes[0], **changes),)
    )


# ------------------------------------------------------------------------------------- the causes
@pytest.mark.parametrize("name", ["copper", "rolloff"])
def test_every_cause_stands_in_the_table_with_its_number_and_interval(name: str) -> None:
    found = diagnosed(name)
    shown = rows(tables(report(name))["causes"])
    assert [row["effect"] for row in shown if row["effect"]] == [
        called(cause.effect) for cause in found.causes
    ]
    number, interval = next(iter(found.causes[0].parameters.values())), shown[0]["95 %"]
    factor = value(shown[0]["found"]) / number.value
    assert isinstance(interval, Span)
    assert interval[:2] == pytest.approx((number.low * factor, number.high * factor))
    assert report(name).tiles[0].value == "Explained"
    assert [
        suspect for suspect in SUSPECTS if EFFECTS[suspect].label not in said(report(name))
    ] == []  # cause, or not needed


def test_a_number_at_the_end_of_its_range_is_marked() -> None:
    (number,) = diagnosed("copper").causes[0].parameters.values()
    found = changed(parameters={"r_s_change": msgspec.structs.replace(number, at_limit="high")})
    assert "upper" in str(rows(tables(diagnosis_report(found))["causes"])[0]["range"])
    assert "range" not in [
        column.name for column in tables(report("copper"))["causes"].used().columns
    ]


@pytest.mark.parametrize("name", ["nothing", "outsider"])
def test_without_an_explanation_no_cause_is_named_and_every_suspect_has_its_threshold(
    name: str,
) -> None:
    made, found = report(name), diagnosed(name)
    assert "causes" not in tables(made)
    assert made.tiles[0].beside == "no cause named"
    assert {row["effect"] for row in rows(tables(made)["thresholds"])} == {
        called(name) for name in found.suspects
    }
    assert not {row["part"] for row in rows(tables(made)["costs-eta-pto"])} & set(found.suspects)
    if name == "outsider":
        assert not [effect for effect in found.suspects if effect in said(made)]


# -------------------------------------------------------------------------------------- the costs
def test_costs_by_load_are_those_of_the_json_and_add_up() -> None:
    found = diagnosed("copper")
    record = [
        one
        for one in as_json(found)["contributions"]
        if one["metric"] == "eta_pto" and one["load_ohm"] != "inf"
    ]
    shown = tables(report("copper"))["costs-eta-pto"]
    for one in record:
        assert sum(part["value"] for part in one["parts"]) == pytest.approx(
            one["measured"] - one["as_given"], rel=1e-9
        )
        column = [row[f"{one['load_ohm']:g} ohm"] for row in rows(shown)]
        expected = [one["as_given"], *(part["value"] for part in one["parts"]), one["measured"]]
        assert [value(cell) for cell in column] == pytest.approx(
            [100.0 * share for share in expected], rel=1e-9
        )
    other = next(section for section in report("copper").sections if section.id == "other-costs")
    assert other.folded
    assert len(other.blocks) == 2


def test_without_an_efficiency_nothing_costs() -> None:
    made = diagnosis_report(msgspec.structs.replace(diagnosed("copper"), contributions=()))
    assert made.lead is None
    assert not [name for name in tables(made) if name.startswith("costs")]


# ----------------------------------------------------------------------------------- the evidence
def test_every_alarm_is_listed_beyond_its_limit_and_its_kind_is_explained() -> None:
    found, made = diagnosed("outsider"), report("outsider")
    assert found.remainder is not None
    shown = rows(tables(made)["alarms"])
    assert [row["kind"] for row in shown] == [alarm.kind for alarm in found.remainder.alarms]
    assert [(value(row["size"]), value(row["limit"])) for row in shown] == [
        (alarm.size, alarm.limit) for alarm in found.remainder.alarms
    ]
    assert {alarm.kind.capitalize() for alarm in found.remainder.alarms} <= {
        note.about for note in notes(made)
    }
    assert "alarms" not in tables(report("copper"))


def test_the_closure_holds_the_root_mean_squares() -> None:
    found = diagnosed("copper")
    assert found.closure is not None
    for row, (name, x) in zip(
        rows(tables(report("copper"))["closure"]), found.closure.channels.items(), strict=True
    ):
        shown = [value(row[of]) for of in ("before", "after", "noise")]
        assert shown == pytest.approx(
            [rms * CHANNELS[name].factor for rms in (x.before, x.after, x.noise)]
        )


# ------------------------------------------------------------------------------ page and terminal
