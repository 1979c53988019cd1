"""The cycle with the largest gap over time: the values of the log and of the model, for the page and for print."""

import json
from typing import Any

import numpy as np
import pytest
from diagnosed import diagnosed

from winchcascade.diagnosis.model_account import COMPARED
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.diagnosis.simulated_cycle import LEAD, SimulatedCycle, cycle_gaps, largest_gap
from winchcascade.report.content import Picture
from winchcascade.report.cycle_histories import cycle_picture, histories_json
from winchcascade.report.figures.style import house_style

VDC, FORCE = CHANNELS.index("vdc"), CHANNELS.index("force")


def shown(name: str) -> SimulatedCycle:
    item = largest_gap(diagnosed(name))
    assert item is not None
    return item


def page(name: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(histories_json(diagnosed(name), shown(name), "log"))
    return found


def test_the_cycle_with_the_largest_gap_is_shown() -> None:
    gaps = cycle_gaps(diagnosed("copper"))
    item = shown("copper")
    assert len(gaps) > 2
    assert gaps[item.log, item.cycle] == max(gaps.values())
    assert item.log == 1  # copper shows most at the smallest resistance


def test_logged_values_are_those_of_the_run_without_the_zeros_of_its_sensors() -> None:
    found, item = diagnosed("copper"), shown("copper")
    run = found.data.logs[item.log].run
    rows = np.searchsorted(run.t, item.onset + item.t - 1e-6)
    zeros = run.channels["force"][rows] - item.logged[:, FORCE]
    assert zeros == pytest.approx(found.data.zeros(found.found.best.nu)[item.log][FORCE])
    np.testing.assert_allclose(item.logged[:, VDC], run.channels["vdc"][rows])
    assert -LEAD <= item.t[0] < 0.0 < item.payout_end < item.t[-1]


def test_the_fitted_effects_bring_the_simulation_to_the_log() -> None:
    item = shown("copper")
    assert item.caused is not None
    out = (item.t > 2.0) & (item.t < item.payout_end - 1.0)
    before, after = (np.sqrt(np.mean((item.logged - x)[out, VDC] ** 2)) for x in (item.given, item.caused))
    assert after < 0.3 * before
    assert shown("nothing").caused is None


@pytest.mark.parametrize(("name", "sides"), [("copper", 3), ("nothing", 2)])
def test_the_page_gets_every_channel_of_the_run_with_its_unit_and_the_payout(name: str, sides: int) -> None:
    item, record = shown(name), page(name)
    assert [row["label"] for row in record["rows"]] == [COMPARED[channel][0] for channel in CHANNELS]
    for k, (channel, row) in enumerate(zip(CHANNELS, record["rows"], strict=True)):
        assert len(row["series"]) == sides
        for series, side in zip(row["series"], item.sides, strict=True):
            np.testing.assert_allclose(series["values"], side[:, k] * COMPARED[channel][1], rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(record["t"], item.t, atol=1e-4)
    assert record["spans"] == [{"from": 0.0, "to": item.payout_end, "colour": "payout"}]


def test_repaired_stretches_of_the_cycle_are_marked_since_its_onset(monkeypatch: pytest.MonkeyPatch) -> None:
    found, item = diagnosed("copper"), shown("copper")
    gaps = item.onset + np.array([[2.0, 2.5], [1e4, 1e4 + 1.0]])
    monkeypatch.setattr("winchcascade.report.time_histories.all_gaps", lambda *_: gaps)
    spans = json.loads(histories_json(found, item, "log"))["spans"]
    (repaired,) = [(span["from"], span["to"]) for span in spans if span["colour"] == "repaired"]
    assert repaired == pytest.approx((2.0, 2.5))


def test_print_shows_a_panel_for_each_channel() -> None:
    with house_style():
        picture = cycle_picture(diagnosed("copper"), "log")
    assert isinstance(picture, Picture)
    assert json.loads(picture.histories)["rows"]
    labels = [ax.get_ylabel() for ax in picture.figure.axes]
    assert [f"({COMPARED[channel][0]})" in label for channel, label in zip(CHANNELS, labels, strict=True)] == [True] * 5
