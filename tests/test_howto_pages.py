"""What the pages of tasks show is true of the logs that they use: injected numbers, computed
losses, laws of physics.

`test_pages.py` holds that the commands print what is shown.
"""

import json
import re

import pytest
from pages import DOCS, ROOT, shown

from winchcascade.rig.effects.catalogue import EFFECTS

NUMBER = r"[+-]?\d+(?:\.\d+)?"


def printed(page: str, command: str) -> str:
    """What a page shows of its only command that contains a text."""
    (text,) = [text for line, text in shown(DOCS / page).items() if command in line]
    return text


def interval(text: str, row: str) -> tuple[float, float]:
    """Interval in the only row that begins with a cell, or with the label of an effect."""
    first = EFFECTS[row].label if row in EFFECTS else row
    (line,) = re.findall(rf"^(?:[^()\n]* \()?{re.escape(first)}\)?  .*$", text, re.MULTILINE)
    low, high = re.search(rf"({NUMBER}) to ({NUMBER})", line).groups()  # type: ignore[union-attr]
    return float(low), float(high)


def injected(fixture: str) -> dict[str, float]:
    """What was injected into the logs of a fixture."""
    origin = json.loads((ROOT / "fixtures" / fixture / "ORIGIN.json").read_text(encoding="utf-8"))
    hidden: dict[str, float] = origin["hidden"]
    return hidden


@pytest.mark.parametrize(
    ("effect", "key", "factor"),
    [
        ("rotor_friction", "rotor_coulomb", 1.0),
        ("copper_heating", "rs_extra", 100.0),
        ("screw_friction", "mu_extra", 1.0),
        ("line_drag", "line_visc", 1.0),
        ("gas_volume", "gas_volume", 1000.0),
        ("torque_gain", "torque_gain", 100.0),
    ],
)
def test_the_intervals_of_the_diagnosis_hold_the_injected_numbers(
    effect: str, key: str, factor: float
) -> None:
    low, high = interval(printed("diagnosis.md", "diagnose fixtures/campaign --html"), effect)
    assert low <= factor * injected("campaign")[key] <= high


def test_the_corrected_model_gives_the_efficiencies_of_the_log_within_their_intervals() -> None:
    text = printed("diagnosis.md", "winchcascade compare")
    for metric in ("eta_trans", "eta_gen", "eta_pto", "eta_net"):
        low, high = interval(text, metric)
        assert low < 0.0 < high


def test_the_own_simulation_lacks_what_its_script_leaves_out_and_the_rig_has_what_was_injected() -> (
    None
):
    text = printed("worked_example.md", "--simulated own")
    low, high = interval(text, "copper_heating")
    assert low <= 100.0 * injected("other_rig")["copper_heating"]["r_s_change"] <= high  # type: ignore[index]
    form = text.partition("Your simulation\n")[2]
    assert re.findall(r"^(\w+) +\w+ .* share", form, re.MULTILINE) == ["uncommutated_bridge"]


def test_a_current_that_is_2_percent_smaller_lowers_eta_pto_by_2_percent() -> None:
    text = printed("compare.md", "| grep")
    (before, after) = map(
        float, re.findall(NUMBER, re.findall(r"^eta_pto .*$", text, re.MULTILINE)[0])[1:3]
    )
    assert after / before == pytest.approx(0.98, abs=1e-4)
    low, high = interval(text, "eta_pto")
    assert low <= -0.02 * before <= high


@pytest.mark.parametrize(
    ("row", "true"),
    [
        ("shaft_friction", 2.0),
        ("shaft_viscous", 0.01),
        ("copper_torque", 0.012),
        ("junction_torque", 0.4),
        ("power_share", 0.02),
    ],
)
def test_the_loss_map_holds_the_losses_that_the_log_was_made_with(row: str, true: float) -> None:
    low, high = interval(printed("loss_map.md", "reduce dyno.csv"), row)
    assert low <= true <= high


def test_a_counterweight_stores_its_weight_times_the_payout() -> None:
    (stored,) = re.findall(
        rf"^pull +({NUMBER})", printed("own_rig.md", "--rig direct.toml"), re.MULTILINE
    )
    assert float(stored) == pytest.approx(120.0 * 9.81 * 6.01, rel=1e-3)
