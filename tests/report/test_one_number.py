"""One mean has one text on every page of a folder of results, whatever the size of the rig: with
the digits of its own uncertainty.
"""

from __future__ import annotations

import math
from collections import defaultdict
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest
from made_tables import made_table
from msgspec.structs import replace
from similar import Nature, scaled_log, scaled_rig
from stated import rows

from winchcascade.core.cascade import field_of
from winchcascade.core.rig_toml import built_in
from winchcascade.ingest.read import read_run
from winchcascade.reduction.campaign_record import CampaignRecord, log_summary
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.run_record import RunRecord, reduction_record
from winchcascade.report.content import Measured, Report, shown
from winchcascade.report.glossary import metric, short
from winchcascade.report.results.campaign import campaign_report
from winchcascade.report.results.campaign_index import results_index
from winchcascade.report.results.checks import check_report
from winchcascade.report.results.reduction import reduction_report
from winchcascade.tables.check import check
from winchcascade.tables.measured import measured

FIXTURES = Path(__file__).parents[2] / "fixtures" / "campaign"
LOGS = {"r36ohm.csv": 36.0, "r9ohm.csv": 9.0, "open_circuit.csv": math.inf}

SIZES = {
    "paper": (1.0, 1.0, 1.0),
    "bench": (0.3, 0.6, 0.05),
    "winch": (4.0, 2.0, 20.0),
    "tank": (0.1, 0.35, 0.01),
}
"""Rigs by their scales of length, time and force; that of the voltage keeps the loads."""

RIGS = [*SIZES, "unknown accuracies"]

METRICS = ("energy_line", "energy_mech", "energy_gen", "power_gen", "eta_trans", "eta_pto")


class Pages(NamedTuple):
    """What the reports of a folder of results state: of each log, of all together, and of the
    folder.
    """

    logs: dict[str, Report]
    campaign: Report
    folder: Report
    records: dict[str, RunRecord]


def _reduced(name: str, log: str) -> Reduction:
    """A log in the units of a rig of another size, or of one whose sensors are not known."""
    length, time, force = SIZES.get(name, SIZES["paper"])
    nature = Nature(length, time, force, math.sqrt(force * length / time))
    run, rig = (
        read_run(FIXTURES / log, load=LOGS[log]),
        scaled_rig(built_in("hsu2026"), nature, stated=True),
    )
    if name not in SIZES:
        rig = replace(rig, sensors={})
    t, channels = scaled_log(run.t, run.channels, nature)
    return reduce(
        replace(run, t=t, channels=channels, fs=run.fs / time, rig=rig), window=5.48 * time
    )


@cache
def pages(name: str) -> Pages:
    reductions = {log: _reduced(name, log) for log in LOGS}
    records = {log: reduction_record(reduction) for log, reduction in reductions.items()}
    runs = tuple(log_summary(log, log, record) for log, record in records.items())
    campaign = CampaignRecord("Made up", "", runs)
    return Pages(
        {log: reduction_report(reduction) for log, reduction in reductions.items()},
        campaign_report(campaign, linked=True),
        results_index(campaign, ["campaign.html"], ["html"]),
        records,
    )


def means(made: Pages) -> dict[tuple[str, str], dict[str, str]]:
    """Texts of the means by log and metric, with the place of each."""
    heads = {short(name): name for name in METRICS}
    found: dict[tuple[str, str], dict[str, str]] = defaultdict(dict)
    for log, report in made.logs.items():
        for row in rows(report, "cycles"):
            if row["cycle"].startswith("mean"):
                found |= {
                    (log, name): {**found[log, name], "cycles": row[head]}
                    for head, name in heads.items()
                    if row.get(head, "-") != "-"
                }
        for tile in report.tiles:
            if tile.name in METRICS:
                found[log, tile.name]["tile"] = tile.value.partition(" ")[0]
    for report, table in ((made.campaign, "budget"), (made.folder, "logs")):
        for row in rows(report, table):
            for head, name in heads.items():
                if row.get(head, "-") != "-":
                    found[row["log"], name][f"{report.kind}, {table}"] = row[head]
    return found


@pytest.mark.parametrize("name", RIGS)
def test_one_mean_has_one_text_on_all_pages(name: str) -> None:
    found = means(pages(name))
    assert {log for log, _ in found} == set(LOGS)
    assert {
        (log, m): texts for (log, m), texts in found.items() if len({*texts.values()}) > 1
    } == {}
    assert min(len(texts) for texts in found.values()) > 1


@pytest.mark.parametrize("name", RIGS)
def test_the_digits_of_a_mean_are_those_of_its_own_uncertainty(name: str) -> None:
    made = pages(name)
    for (log, m), texts in means(made).items():
        record, field = made.records[log], field_of(m)
        mean = Measured(record.mean[field], record.standard_uncertainty[field])
        assert texts["cycles"] == shown(mean, metric(m).decimals)


@pytest.mark.parametrize("name", RIGS)
def test_tiles_and_verdict_of_a_campaign_state_means_of_its_logs(name: str) -> None:
    made = pages(name)
    stated = {text for texts in means(made).values() for text in texts.values()}
    numbers = [t.value.partition(" ")[0] for t in made.campaign.tiles if t.name in METRICS]
    assert numbers
    assert {*numbers} <= stated
    verdict = next((note.text for note in made.campaign.notes if note.about == "Verdict"), "")
    parts = [part.split()[0].strip(".,;") for part in verdict.split("eta_pto = ")[1:]]
    assert {*parts} <= stated


@pytest.mark.parametrize("name", SIZES)
def test_a_check_states_the_means_of_the_pages(name: str) -> None:
    made = pages(name)
    columns = ("energy_line", "energy_gen", "eta_pto")
    logs = [log for log, load in LOGS.items() if math.isfinite(load)]
    printed = [
        {"load_ohm": LOGS[log]} | {m: made.records[log].mean[field_of(m)] or 0.0 for m in columns}
        for log in logs
    ]
    table = made_table(printed)
    results = [measured(made.records[log], log, table)[0] for log in logs]
    known = means(made)
    report = check_report(check(results, table))
    found = {(row["log"], row["cell"]): row["found"] for row in rows(report, "agreeing")}
    assert len(found) == 2 * len(columns)
    for log in logs:
        for m in columns:
            assert found[log, short(m)] == known[log, m]["cycles"]
