"""Damaged files of every kind are read or rejected in one sentence, and each class of fault that was found stays mended."""

import math
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from fuzz import MEMORY, Judged, by_weight, fuzz, memory_taken, run_orders
from fuzz import table as counts
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mutate import mutated
from nptdms import ChannelObject, TdmsWriter
from pyarrow import parquet
from seeds import DATA, HEADERS, ROWS, SEEDS, seeds

from winchcascade.batch.results import load_results
from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.errors import LogError, OptionError, WinchcascadeError
from winchcascade.core.rig_toml import parse_rig
from winchcascade.core.table_toml import load_table, parse_table
from winchcascade.ingest.clock import read_clock
from winchcascade.ingest.read import read_run
from winchcascade.report.render.terminal import terminal_text
from winchcascade.report.results.audits import audit_report
from winchcascade.rig.open_rig import load_rig
from winchcascade.tables.audit import audit_by_load as audit

MANY = 300


def faults(judged: list[Judged]) -> list[str]:
    return [f"--show {j.form} {j.seed}: {j.message}" for j in judged if j.outcome == "fault"]


@pytest.mark.slow
def test_many_damaged_files_of_every_kind_are_read_or_rejected() -> None:
    judged = fuzz(MANY, first=1_000_000)
    assert faults(judged) == []
    assert {j.form for j in judged} == set(SEEDS)
    assert counts(judged).splitlines()[-1].split()[:2] == ["all", str(MANY)]


@pytest.mark.slow
def test_memory_that_is_reserved_and_not_touched_is_no_fault() -> None:
    # A page of this file claims more than a GiB; Arrow reserves it, finds the page damaged and touches none of it.
    assert [j.outcome for j in run_orders([("parquet", 3_009_657)])] == ["rejected"]


def test_a_file_that_is_judged_alone_may_take_so_much_memory() -> None:
    rejected, starved = Judged("parquet", 1, "rejected", "why."), Judged("parquet", 1, "starved")
    assert by_weight(rejected, MEMORY) == rejected
    assert by_weight(rejected, MEMORY + 1).outcome == by_weight(starved, 0).outcome == "fault"


def test_the_most_memory_taken_is_seen_after_it_was_given_back() -> None:
    with memory_taken() as taken:
        assert np.ones(25_000_000).sum() == 25_000_000
    assert 190e6 < taken() < 400e6


@pytest.mark.parametrize("form", SEEDS)
def test_a_number_makes_the_same_file_at_every_call(form: str) -> None:
    seeds.cache_clear()
    first = [mutated(form, k) for k in range(5)]
    seeds.cache_clear()
    assert [mutated(form, k) for k in range(5)] == first


# --- any value at any place of a TOML file

PLAIN = (
    st.booleans() | st.integers(-(2**70), 2**70) | st.floats() | st.text(max_size=20)
    | st.sampled_from(["m", "mm", "s", "W", "1", "ohm", "hsu2026", "r36ohm.csv", "auto", "1979-05-27", "07:32:00"])
)  # fmt: skip
VALUES = st.recursive(
    PLAIN, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(["value", "unit", "name", "x"]), inner)
)  # fmt: skip


def literal(value: Any) -> str:
    """A value as TOML writes it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"
    if isinstance(value, str):
        return '"' + "".join(c if c.isalnum() and c.isascii() else f"\\U{ord(c):08X}" for c in value) + '"'
    if isinstance(value, list):
        return f"[{', '.join(map(literal, value))}]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {literal(inner)}" for key, inner in value.items()) + "}"
    return repr(value)


@settings(suppress_health_check=list(HealthCheck))
@given(value=VALUES, place=st.integers(0, 2**32))
@pytest.mark.parametrize("form", ["rig", "campaign", "table"])
def test_any_value_in_place_of_any_other_is_taken_or_told_in_one_line(
    form: str, value: Any, place: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    chance = random.Random(place)
    lines = chance.choice(seeds(form)).decode().splitlines()
    at = chance.choice([k for k, line in enumerate(lines) if "=" in line and not line.startswith("#")])
    lines[at] = f"{lines[at].partition('=')[0]}= {literal(value)}"
    path = tmp_path_factory.getbasetemp() / "any.toml"
    path.write_text("\n".join(lines), encoding="utf-8")
    loaders: dict[str, Callable[[Path], object]] = {"rig": load_rig, "campaign": load_campaign, "table": load_table}
    try:
        loaders[form](path)
        message = "read."
    except WinchcascadeError as fault:
        message = str(fault)
    assert message.isprintable()


# --- what was found and mended

NUMBERS = ["9" * 5000, "-" + "9" * 400, "9223372036854775809", "[[1, {a = 99999999999999999999}]]"]


@pytest.mark.parametrize("number", NUMBERS)
@pytest.mark.parametrize("read", [parse_rig, parse_table], ids=["rig", "table"])
def test_a_whole_number_beyond_64_bits_is_one_sentence(read: Callable[[str, str], object], number: str) -> None:
    with pytest.raises(WinchcascadeError, match=r"^a\.toml: ") as caught:
        read(f"name = {number}", "a.toml")
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    "content", [b'{"schema": "\xff"}', b"[" * 100_000, b'{"a": ' * 100_000], ids=["bytes", "lists", "deep"]
)
def test_json_that_is_no_text_or_too_deep_is_no_result(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "result.json"
    path.write_bytes(content)
    with pytest.raises(OptionError, match="is no JSON of a reduction"):
        load_results(path)


@pytest.mark.parametrize("old", ["value = 1300", "power_line = 1083", "energy_line = 5937"])
def test_an_audit_of_zeros_divides_by_none(old: str) -> None:
    text = seeds("table")[0].decode()
    assert old in text
    table = parse_table(text.replace(old, f"{old.partition('=')[0]}= 0"), "a.toml")
    assert terminal_text(audit_report(audit(table)))


def test_a_name_with_control_characters_is_reported_without_them(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("Time (s),Col\x1b[31m\x07our\n" + "".join(f"{k},1\n" for k in range(20)))
    with pytest.raises(LogError) as caught:
        read_run(path)
    assert str(caught.value).isprintable()
    assert "Col?[31m?our" in str(caught.value)


def test_a_fault_is_one_line_whatever_it_quotes() -> None:
    assert str(LogError("a\nb\tc\x1b[2J\u202e\ud800")) == "a b c?[2J??"


def test_a_fault_is_of_a_length_to_be_read_and_ends_in_what_to_do() -> None:
    said = str(LogError(f"a.csv: {'9' * 10_000}; expected less. Correct it."))
    assert said.startswith("a.csv: 999")
    assert said.endswith("9; expected less. Correct it.")
    assert len(said) < 2100


def test_a_signalling_nan_is_a_hole_like_any_other(tmp_path: Path) -> None:
    """Warnings are faults in these tests."""
    columns = {header: DATA[name].copy() for header, name in zip(HEADERS, DATA, strict=True)}
    for header in HEADERS:
        columns[header].view(np.uint64)[100] = 0x7FF0_0000_0000_0001
    path = tmp_path / "log.parquet"
    parquet.write_table(pa.table(columns), path)
    assert {f.kind for f in read_run(path).findings} >= {"not_a_number"}


@pytest.mark.parametrize("start", [1e17, -1e17])
def test_a_clock_that_begins_aeons_away_is_one_sentence(start: float, tmp_path: Path) -> None:
    waves = [
        ChannelObject("Crane", n, DATA[n], {"wf_increment": 0.08, "wf_start_offset": start}) for n in list(DATA)[1:]
    ]
    path = tmp_path / "log.tdms"
    with TdmsWriter(str(path)) as writer:
        writer.write_segment(waves)
    with pytest.raises(LogError, match="lie too far from zero to be distinguished; expected stamps that rise"):
        read_run(path)


def test_stamps_that_are_mended_rise_or_are_one_sentence() -> None:
    """A log whose later stamps are of wrong bytes, a few of them equal beyond what a number can tell."""
    messages: list[str] = []
    for seed in range(40):
        stamps = 0.08 * np.arange(899, dtype=np.float64)
        stamps[270:] = np.frombuffer(np.random.default_rng(seed).bytes(8 * 629))
        with np.errstate(invalid="ignore"):  # as where a log is read
            try:
                assert np.all(np.diff(read_clock(stamps, "log").t) > 0.0)
            except LogError as fault:
                messages.append(str(fault))
    assert 0 < len(messages) < 40
    assert all("be distinguished" in sentence for sentence in messages)


def test_a_time_without_a_unit_beside_numbers_of_any_size_is_read(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    rows = [f"{k},{(k % 2) * 1e-300!r},1e300\n" for k in range(1, 30)]
    path.write_text("Time,Displacement (m),Velocity (m/s)\n" + "".join(rows))
    assert read_run(path).samples == 29


def test_a_mat4_variable_that_claims_more_than_the_file_takes_no_memory(tmp_path: Path) -> None:
    content = seeds("mat")[0]
    second = 20 + len(b"Time\0") + 8 * len(ROWS)  # a wrong first header would not be recognised as MATLAB
    for place, value in ((16, 2**31 - 1), (4, 2**31 - 1), (8, 2**30)):
        at = second + place
        path = tmp_path / "log.mat"
        path.write_bytes(content[:at] + value.to_bytes(4, "little") + content[at + 4 :])
        with pytest.raises(LogError, match=r"damaged or breaks off \(ValueError\)|takes more than 2000 MB of memory"):
            read_run(path)


def test_a_tdms_text_that_claims_gigabytes_takes_no_memory(tmp_path: Path) -> None:
    content = seeds("tdms")[0]
    at = content.index(b"load_ohm") - 4
    path = tmp_path / "log.tdms"
    path.write_bytes(content[:at] + (2**32 - 1).to_bytes(4, "little") + content[at + 4 :])
    with pytest.raises(LogError, match="damaged or breaks off") as caught:
        read_run(path)
    assert not isinstance(caught.value.__cause__, MemoryError)
