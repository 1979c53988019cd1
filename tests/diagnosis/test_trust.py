"""Campaigns on which a confident diagnosis is wrong, by simulators that share nothing with the
model; skipped where absent.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import pytest

from winchcascade.batch.campaign_diagnosis import diagnose_campaign
from winchcascade.rig.effects.catalogue import EFFECTS

SHARED = Path(__file__).parent.parent.parent.parent / "shared" / "data"

CERTAIN = 0.95
"""Posterior from which a cause without a look-alike is named with certainty."""

ANSWERS: dict[str, tuple[set[str], set[str]]] = {
    "trust/warming_shuffled": ({"heating"}, {"explained"}),
    "trust/warming_in_load_order": ({"heating"}, {"explained"}),
    "trust/rolloff_shuffled": ({"ke_rolloff"}, {"explained"}),
    "trust/rope_loss": ({"load_proportional_loss"}, {"explained"}),
    "peer/null_si1": (set(), {"no_gap"}),
    "peer/o_magnet_warms": ({"heating"}, {"explained"}),
    "peer/s_clutch": ({"clutch_drag"}, {"explained"}),
    "peer/s_diode": ({"diode_drop"}, {"explained"}),
    "peer/s_gear": ({"gear_mesh_loss"}, {"explained"}),
}
"""Causes and verdicts of campaigns whose cause is in the catalogue."""

OPEN = ("peer/o_gear_load", "peer/o_dead_diode", "peer/o_torque_drift")
"""Campaigns whose cause is not."""

LOOK_ALIKES = {
    "trust/rope_loss": ("load_proportional_loss", "force_gain"),
    "peer/o_cable": ("copper_heating", "diode_drop"),
}
"""A cause and what these logs cannot distinguish from it."""

TOLD_APART = {
    "trust/warming_in_load_order": ("heating", "ke_rolloff"),
    "trust/rolloff_shuffled": ("ke_rolloff", "heating"),
}
"""A cause and what would look like it but for the exact course of both over the runs."""


@cache
def diagnosed(name: str) -> dict[str, Any]:
    """The diagnosis of a campaign as JSON."""
    if not (SHARED / name).is_dir():
        pytest.skip(f"{name} is not beside the project")
    return diagnose_campaign(SHARED / name / "campaign.toml", suspects=EFFECTS)


def certain(record: dict[str, Any]) -> set[str]:
    """Effects that are named with certainty."""
    return {
        c["effect"]
        for c in record["causes"]
        if c["probability"] >= CERTAIN and not c["look_alikes"]
    }


@pytest.mark.slow
@pytest.mark.parametrize("name", ANSWERS)
def test_the_cause_is_named_alone(name: str) -> None:
    causes, verdicts = ANSWERS[name]
    record = diagnosed(name)
    assert {c["effect"] for c in record["causes"]} == causes
    assert record["verdict"] in verdicts


@pytest.mark.slow
@pytest.mark.parametrize("name", OPEN)
def test_a_cause_outside_the_catalogue_is_never_explained_nor_certain(name: str) -> None:
    record = diagnosed(name)
    assert record["verdict"] in ("partly_explained", "unexplained")
    assert not certain(record)
    assert record["remainder"]["alarms"]


@pytest.mark.slow
@pytest.mark.parametrize("name", LOOK_ALIKES)
def test_a_look_alike_is_declared_and_nothing_is_certain_beside_it(name: str) -> None:
    effect, other = LOOK_ALIKES[name]
    record = diagnosed(name)
    cause = next(c for c in record["causes"] if c["effect"] == effect)
    assert other in {one["effect"] for one in cause["look_alikes"]}
    assert effect not in certain(record)


@pytest.mark.slow
@pytest.mark.parametrize("name", TOLD_APART)
def test_what_the_logs_distinguish_is_no_look_alike(name: str) -> None:
    effect, other = TOLD_APART[name]
    (cause,) = diagnosed(name)["causes"]
    assert cause["effect"] == effect
    assert other not in {one["effect"] for one in cause["look_alikes"]}
