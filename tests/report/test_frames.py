"""Frames hold the numbers of the JSON and of the Parquet tables, with the units that their names or a column state."""

import math
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pandas as pd
import pytest
from diagnosed import diagnosed

from winchcascade import Reduction, read_run, reduce
from winchcascade.core.errors import OptionError
from winchcascade.core.quantity import KGF
from winchcascade.report.frames import campaign_frame, write_parquet
from winchcascade.report.records import reduction_json, reduction_record
from winchcascade.report.results.diagnosis_record import as_json


@pytest.fixture(name="reduction", scope="module")
def _reduction() -> Reduction:
    return reduce(read_run("fixtures/campaign/r36ohm.csv", load=36.0), window=5.48)


def test_frames_of_a_reduction_are_its_parquet_tables(reduction: Reduction, tmp_path: Path) -> None:
    write_parquet(reduction, tmp_path)
    for table in ("cycles", "bins", "findings"):
        stored = pd.read_parquet(tmp_path / f"r36ohm.csv.{table}.parquet")
        pd.testing.assert_frame_equal(reduction.to_pandas(table), stored)


def test_cycles_have_the_numbers_of_the_json(reduction: Reduction) -> None:
    record: dict[str, Any] = msgspec.json.decode(reduction_json(reduction))
    frame = reduction.to_pandas("cycles")
    for number, cycle in enumerate(record["cycles"]):
        row = frame.iloc[number]
        for name in (
            "energy_line_j",
            "energy_mech_j",
            "energy_gen_j",
            "power_gen_w",
            "eta_trans",
            "eta_gen",
            "eta_pto",
        ):
            assert row[name] == cycle[name], name
        assert row["plateau_force_n"] == cycle["phase_summary"]["payout"]["plateau"]["force_n"]


def test_units_of_display_are_percent_rpm_and_kg_per_cm2(reduction: Reduction) -> None:
    plain, shown = reduction.to_pandas("cycles"), reduction.to_pandas("cycles", "display")
    assert np.allclose(shown["eta_pto_percent"], 100.0 * plain["eta_pto"], rtol=1e-15)
    assert "eta_pto" not in shown
    assert shown["energy_line_j"].equals(plain["energy_line_j"])
    run = reduction.run
    assert np.array_equal(run.to_pandas()["pressure_pa"], run.channels["pressure"])
    assert np.allclose(run.to_pandas("display")["pressure_kgcm2"] * KGF * 1e4, run.channels["pressure"], rtol=1e-15)
    fast = msgspec.structs.replace(
        run, channels={"speed": np.array([math.pi, 2.0 * math.pi])}, t=np.array([0.0, 1.0]), fs=1.0
    )
    assert fast.to_pandas("display")["speed_rpm"].tolist() == [30.0, 60.0]
    assert fast.to_pandas()["speed_radps"].tolist() == [math.pi, 2.0 * math.pi]


def test_a_frame_of_a_run_is_read_as_the_same_run(reduction: Reduction) -> None:
    again = read_run(reduction.run.to_pandas(), load=36.0)
    assert again.findings == reduction.run.findings
    for name, x in reduction.run.channels.items():
        assert np.array_equal(again.channels[name], x), name


def test_energies_follow_from_the_samples_of_a_frame(reduction: Reduction) -> None:
    samples = reduction.to_pandas("channels")
    for one in reduction.cycles:
        part = samples[(samples["cycle"] == one.cycle) & samples["in_window"]]
        assert part["time_s"].min() >= one.window.onset
        assert part["time_s"].max() <= one.window.cutoff
        assert set(part["phase"]) == {"payout"}
        energy = float(np.trapezoid(part["power_line_w"], part["time_s"]))
        assert energy == pytest.approx(one.metrics.value("energy_line"), rel=0.02)  # without the ends of the window
    spans = samples.groupby(["cycle", "phase"])["time_s"].min()
    assert spans[1, "payout"] == pytest.approx(reduction.cycles[0].phases.onset, abs=0.04)
    assert set(samples.loc[samples["cycle"].isna(), "phase"]) == {""}


def test_frames_of_a_campaign_have_the_means_of_each_run(reduction: Reduction) -> None:
    record = reduction_record(reduction)
    opened = msgspec.structs.replace(record, log=msgspec.structs.replace(record.log, load_ohm=None, open_circuit=True))
    frame = campaign_frame({"one": record, "two": opened}, "runs")
    assert frame["run"].tolist() == ["one", "two"]
    assert frame["load_ohm"].tolist() == [36.0, math.inf]
    assert frame["eta_pto"].tolist() == [record.mean["eta_pto"]] * 2
    shown = campaign_frame({"one": record}, "runs", "display")
    assert shown["eta_pto_percent_low_95"][0] == 100.0 * frame["eta_pto_low_95"][0]
    assert shown["eta_pto_max_deviation_percent"].equals(frame["eta_pto_max_deviation_percent"][:1])
    assert len(campaign_frame({"one": record, "two": opened}, "cycles")) == 2 * len(reduction.cycles)


def test_frames_of_a_diagnosis_are_its_json() -> None:
    found = diagnosed("copper")
    record = as_json(found)
    causes = found.to_pandas("causes")
    assert causes["effect"].tolist() == [c["effect"] for c in record["causes"] for _ in c["parameters"]]
    first = next(iter(record["causes"][0]["parameters"].values()))
    assert causes.loc[0, ["value", "low", "high", "unit"]].tolist() == [
        first[k] for k in ("value", "low", "high", "unit")
    ]
    places = found.to_pandas("map")
    assert places["z"].tolist() == pytest.approx([p["z"] for p in record["where"]["map"]], nan_ok=True)
    assert set(places.loc[places["channel"] == "force", "unit"]) == {"N"}
    parts = found.to_pandas("contributions")
    sums = parts.groupby(["run", "metric"]).agg({"as_given": "first", "measured": "first", "value": "sum"}).dropna()
    assert np.allclose(
        sums["measured"] - sums["as_given"], sums["value"], rtol=1e-9, atol=1e-9 * sums["measured"].abs().max()
    )
    stable = found.to_pandas("stability")
    assert len(stable) == sum(len(c.get("stability", [])) for c in record["causes"])


def test_a_diagnosis_is_displayed_in_percent() -> None:
    found = diagnosed("copper")
    plain, shown = found.to_pandas("contributions"), found.to_pandas("contributions", "display")
    ratios = plain["metric"].str.startswith("eta_")
    assert set(shown.loc[ratios, "unit"]) == {"%"}
    assert np.allclose(shown.loc[ratios, "value"].dropna(), 100.0 * plain.loc[ratios, "value"].dropna())
    assert shown.loc[~ratios & (plain["unit"] != "Pa")].equals(plain.loc[~ratios & (plain["unit"] != "Pa")])


def test_an_unknown_table_or_unit_is_reported(reduction: Reduction) -> None:
    with pytest.raises(OptionError, match=r"to_pandas\('cycle'\): no such table; expected one of 'cycles', 'bins'"):
        reduction.to_pandas("cycle")  # type: ignore[arg-type]
    with pytest.raises(OptionError, match=r"units='SI'\): no such units; expected 'si' or 'display'"):
        reduction.run.to_pandas("SI")  # type: ignore[arg-type]
