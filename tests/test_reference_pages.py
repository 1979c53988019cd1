"""The pages of reference list what the code declares: each command, kind of finding, key of a
file and schema once.
"""

import re
import tomllib
from typing import Any, get_args

import msgspec
import pytest
from calls import call
from pages import DOCS, ROOT, read

import winchcascade
from winchcascade.blind.truth import Truth
from winchcascade.core.campaign_file import CampaignRun
from winchcascade.core.channels import CHANNELS
from winchcascade.core.machine_parts import measures
from winchcascade.core.phase_rule import PhaseSource
from winchcascade.core.quantity import find_unit, read_as
from winchcascade.core.rig_file import PARTS, Sensor
from winchcascade.core.rig_toml import parse_rig
from winchcascade.core.run import FindingKind
from winchcascade.core.toml_file import struct_fields
from winchcascade.tables.table_file import _TableFile, parse_table

FILES = DOCS / "files.md"


def section(heading: str) -> str:
    """A section of the page of files, up to the next one."""
    return read(FILES).split(f"\n## {heading}\n")[1].split("\n## ")[0]


def rows(text: str) -> list[tuple[str, str]]:
    """Rows of tables whose first cell is code: that cell, and what follows it."""
    return re.findall(r"^\|((?:`[^`|]+`(?:, )?)+)\|(.*)\|$", text, re.MULTILINE)


def listed(text: str) -> list[str]:
    """Names in the first column of the tables of a text."""
    return sorted(name for first, _ in rows(text) for name in re.findall(r"`([^`]+)`", first))


def table(text: str, head: str) -> str:
    """The table of a text whose head begins so."""
    return text.split(f"|{head}|")[1].split("\n\n")[0]


def keys(kind: type[msgspec.Struct]) -> list[str]:
    """Keys of a table of a file, as it writes them."""
    return sorted(field.encode_name for field in struct_fields(kind))


def test_the_page_of_commands_has_a_section_with_the_help_of_each() -> None:
    page = read(DOCS / "commands.md")
    commands = sorted(re.findall(r"^  ([a-z]+) {2,}", call("--help").out, re.MULTILINE))
    assert sorted(re.findall(r"^## ([a-z]+)$", page, re.MULTILINE)) == commands
    assert sorted(re.findall(r"^<!-- help: ([a-z]+) -->$", page, re.MULTILINE)) == commands


def test_the_page_of_findings_lists_each_kind_once() -> None:
    assert listed(read(DOCS / "findings.md")) == sorted(get_args(FindingKind))


@pytest.mark.parametrize("name", PARTS)
def test_a_table_of_a_rig_file_is_listed_with_its_keys_units_and_defaults(name: str) -> None:
    row = dict(rows(table(section("Rig file"), "table")))[f"`{name}`"]
    stated = {
        key: (value, unit)
        for key, value, unit in re.findall(r"`(\w+)(?: = ([^`]+))?`(?: ([\w./]+))?", row)
    }
    assert sorted(stated) == keys(PARTS[name])
    for field in struct_fields(PARTS[name]):
        value, unit = stated[field.encode_name]
        assert not value or tomllib.loads(f"stated = {value}")["stated"] == field.default
        if (measure := measures(PARTS[name]).get(field.name)) is not None:
            known = find_unit(unit)
            assert known is not None
            assert read_as(known, measure.dimension) is not None


LISTED: dict[str, tuple[str, str, Any]] = {
    "channels": ("Logs", "channel", list(CHANNELS)),
    "sources of cycles": ("Rig file", "`from`", get_args(PhaseSource)),
    "keys of a run": (
        "campaign.toml",
        "key of a run",
        [key for key in keys(CampaignRun) if key != "beside"],  # the further names under `file`
    ),
    "keys of a table file": ("Table file", "key", keys(_TableFile)),
    "keys of a truth": ("truth.json", "key", keys(Truth)),
}
"""Section of the page of files, head of the table in it, and what its first column lists."""


@pytest.mark.parametrize("what", LISTED)
def test_the_page_of_files_lists_what_the_code_declares(what: str) -> None:
    heading, head, declared = LISTED[what]
    assert listed(table(section(heading), head)) == sorted(declared)


def test_the_page_of_files_lists_the_keys_of_a_sensor() -> None:
    (row,) = (text for first, text in rows(section("Rig file")) if first == "`sensors.CHANNEL`")
    assert sorted(re.findall(r"`(\w+)`", row)) == keys(Sensor)


def test_the_page_of_files_lists_each_schema_once() -> None:
    code = [path.read_text(encoding="utf-8") for path in (ROOT / "winchcascade").rglob("*.py")]
    schemas = {name for text in code for name in re.findall(r"winchcascade/[\w-]+/\d", text)}
    assert listed(table(section("Results"), "schema")) == sorted(schemas)


def test_the_examples_of_the_page_of_files_can_be_read() -> None:
    rig, campaign, printed = re.findall(r"```toml\n(.*?)```", read(FILES), re.DOTALL)
    assert parse_rig(rig, "rig.toml").columns["force"].name == "LC-17"
    assert tomllib.loads(campaign)["run"][0]["load_ohm"] == float("inf")
    assert parse_table(printed, "table.toml").claims[0].loads == (18.0,)


def test_the_page_of_python_has_each_public_name_once() -> None:
    named = re.findall(r"^::: winchcascade\.(\w+)$", read(DOCS / "api.md"), re.MULTILINE)
    assert sorted(named) == sorted(set(winchcascade.__all__) - {"__version__"})
