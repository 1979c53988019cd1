"""Cycles over time: the values of the log and of the model, packed for the page without loss that a reader could see."""

import base64
import json
import re
from typing import Any

import numpy as np
import pytest
from diagnosed import diagnosed

from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.report import cycle_histories as histories
from winchcascade.report.cycle_histories import (
    AXES,
    chosen_cycles,
    cycle_gaps,
    cycle_histories,
    histories_figure,
    histories_json,
    zeros_words,
)
from winchcascade.report.diagnosis import make_diagnosis_report
from winchcascade.report.publish import html_text
from winchcascade.report.style import house_style

VDC, FORCE = CHANNELS.index("vdc"), CHANNELS.index("force")


def unpacked(packed: dict[str, Any]) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    rows = [np.frombuffer(base64.b64decode(text), dtype="<u2") for text in packed["values"]]
    return np.asarray(packed["low"] + np.array(rows) / histories.LEVELS * (packed["high"] - packed["low"]))


def page(name: str) -> dict[str, Any]:
    found = diagnosed(name)
    items, first = cycle_histories(found)
    text: dict[str, Any] = json.loads(histories_json(found, items, first, "logged"))
    return text


@pytest.mark.slow
def test_every_cycle_of_every_run_can_be_chosen() -> None:
    items, first = cycle_histories(diagnosed("copper"))
    assert {(item.log, item.cycle) for item in items} == set(cycle_gaps(diagnosed("copper")))
    assert items[first].log == 1  # copper shows most at the smallest resistance


def test_logged_values_are_those_of_the_run_without_the_zeros_of_its_sensors() -> None:
    found = diagnosed("copper")
    item = cycle_histories(found)[0][0]
    run = found.data.logs[0].run
    onset = run.t[found.data.logs[0].course.blocks.start[found.data.logs[0].course.blocks.phase == 0][0]]
    rows = np.searchsorted(run.t, onset + item.t - 1e-6)
    np.testing.assert_allclose(item.logged[:, FORCE] + item.zeros[FORCE], run.channels["force"][rows])
    assert item.zeros[VDC] == 0.0


def test_the_fitted_effects_bring_the_simulation_to_the_log() -> None:
    item = cycle_histories(diagnosed("copper"))[0][-1]
    assert item.caused is not None
    out = (item.t > 2.0) & (item.t < item.payout_end - 1.0)
    before, after = (np.sqrt(np.mean((item.logged - x)[out, VDC] ** 2)) for x in (item.given, item.caused))
    assert after < 0.3 * before


def test_without_a_cause_there_are_two_curves() -> None:
    items, _ = cycle_histories(diagnosed("nothing"))
    assert all(len(item.sides) == 2 for item in items)


def test_packed_values_are_the_histories_in_shown_units() -> None:
    found, record = diagnosed("copper"), page("copper")
    item = cycle_histories(found)[0][0]
    names = [panel["name"] for panel in record["panels"]]
    assert names == [AXES[name][0] for name in CHANNELS]
    given = unpacked(record["sets"][0]["traces"][FORCE])[1]
    span = np.ptp([side[:, FORCE] for side in item.sides])
    np.testing.assert_allclose(given, item.given[:, FORCE], atol=1e-4 * span)
    np.testing.assert_allclose(unpacked(record["sets"][0]["times"])[0], item.t, atol=1e-2)


def test_a_channel_that_a_run_lacks_has_no_curve() -> None:
    found = diagnosed("copper")
    items, _ = cycle_histories(found)
    logged = items[0].logged.copy()
    logged[:, FORCE] = np.nan
    record = json.loads(histories_json(found, [items[0]._replace(logged=logged)], 0, "logged"))
    assert [trace is None for trace in record["sets"][0]["traces"]] == [k == FORCE for k in range(len(CHANNELS))]


def test_of_many_cycles_a_page_holds_some_of_every_load_and_the_worst(monkeypatch: pytest.MonkeyPatch) -> None:
    found = diagnosed("copper")
    monkeypatch.setattr(histories, "MAX_CYCLES", 4)
    gaps = {(log, cycle): 1.0 for log in (0, 1) for cycle in range(1, 21)} | {(1, 7): 9.0}
    assert chosen_cycles(found, gaps) == [(0, 1), (0, 20), (1, 1), (1, 7), (1, 20)]


def test_fast_logs_are_averaged_to_few_instants() -> None:
    assert histories._averaged(np.arange(7.0), 3).tolist() == [1.0, 4.0]


def test_the_zeros_that_are_taken_off_are_stated() -> None:
    found = diagnosed("copper")
    item = cycle_histories(found)[0][0]
    zeros = np.zeros(len(CHANNELS))
    assert zeros_words(found, item._replace(zeros=zeros)) == ""
    zeros[FORCE] = -3.46
    text = zeros_words(found, item._replace(zeros=zeros))
    assert text == "Zeros of the sensors, by the joint fit, are taken off the logged values: line tension −3.5 N."


def test_every_part_that_the_page_exchanges_is_in_the_drawing() -> None:
    report = make_diagnosis_report(diagnosed("copper"))
    text = html_text(report)
    for panel in range(2 * len(CHANNELS)):
        lines = (1, 2) if panel % 2 else (0, 1, 2)
        for part in (*(f"trace-{panel}-{line}" for line in lines), f"span-{panel}", f"xaxis-{panel}", f"yaxis-{panel}"):
            assert len(re.findall(rf'id="histories-{part}"', text)) == 1, part
    assert json.loads(report.traces)["sets"]


def test_the_figure_of_a_channel_has_its_residual_below() -> None:
    found = diagnosed("copper")
    items, first = cycle_histories(found)
    with house_style():
        figure = histories_figure(found, items[first], "logged")
    assert len(figure.axes) == 2 * len(CHANNELS)
    above, below = figure.axes[:2]
    curves = {line.get_gid(): np.asarray(line.get_ydata()) for ax in (above, below) for line in ax.lines}
    np.testing.assert_allclose(curves["trace-1-2"], curves["trace-0-0"] - curves["trace-0-2"])


def test_repaired_stretches_and_phases_of_a_cycle_are_stated_since_its_onset() -> None:
    found = diagnosed("copper")
    item, *_ = cycle_histories(found)[0]
    assert item.repaired["force"] == []
    assert item.haul_in is not None
    assert item.payout_end <= item.haul_in[0] < item.haul_in[1] <= item.t[-1]
    marked = item._replace(repaired={"force": [(2.0, 2.5)]})
    data = json.loads(histories_json(found, [marked], 0, "logged"))
    panel = [one["name"] for one in data["panels"]].index("Line tension")
    assert data["sets"][0]["repaired"][panel] == [[2.0, 2.5]]
    assert [name for name, *_ in data["sets"][0]["spans"]] == ["payout", "haul-in"]


def test_seven_runs_of_three_cycles_stay_small() -> None:
    found = diagnosed("copper")
    one = cycle_histories(found)[0][0]
    points, maximum = 850, 1_500_000  # 34 s at 25 Hz; characters
    logged, given, caused = (np.resize(x, (points, len(CHANNELS))) for x in one.sides)
    longer = one._replace(t=np.resize(one.t, points), logged=logged, given=given, caused=caused)
    assert len(histories_json(found, [longer] * 21, 0, "logged")) < maximum
