"""What the figures of a diagnosis show is what was computed: recomputed here block by block."""

import math
from collections.abc import Iterator

import msgspec
import numpy as np
import pytest
from diagnosed import PLANTED, SUSPECTS, diagnosed, made_logs

from winchcascade.diagnosis.diagnose import ModelDiagnosis, diagnose
from winchcascade.diagnosis.gap_map import STANDS_OUT
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.diagnosis.stator_current import by_load, loaded, rated_dc_current, stator_current
from winchcascade.report.cause_costs import load_costs, waterfall_figure
from winchcascade.report.diagnosis_causes import (
    cause_rows,
    numbers_figure,
    profile_figure,
    profile_of,
    tolerance_of,
)
from winchcascade.report.diagnosis_figures import (
    BIN,
    OUT,
    blocks_before_braking,
    error_figure,
    error_panels,
    gap_map,
    history,
    means_over_speed,
    most_telling,
    over_speed_figure,
    representative,
    series,
    sides,
    stage_map,
)
from winchcascade.report.figures.style import house_style
from winchcascade.report.gap_words import signed
from winchcascade.rig.effects.catalogue import EFFECTS
from winchcascade.rig.open_rig import load_rig

ALL = ["copper", "rolloff", "nothing", "outsider"]


@pytest.fixture(autouse=True)
def style() -> Iterator[None]:
    with house_style():
        yield


# ------------------------------------------------------------------------------------------------------------ the data
@pytest.mark.parametrize("name", ALL)
def test_after_is_there_where_effects_were_fitted(name: str) -> None:
    found = diagnosed(name)
    assert (sides(found).after is None) == (not found.causes)


def test_after_comes_from_fits_that_did_not_know_the_log() -> None:
    found = diagnosed("copper")
    assert found.closure is not None
    both = sides(found)
    assert both.after is not None
    left = found.closure.residual
    fresh = np.isfinite(left[:, 0])
    assert np.allclose((both.logged - both.after)[fresh], left[fresh])


def test_zeros_are_taken_off_before_as_in_the_closure() -> None:
    found = diagnosed("copper")
    assert found.closure is not None
    both = sides(found)
    for k, channel in enumerate(CHANNELS):
        squares, count = 0.0, 0
        for log in found.closure.withheld:
            seen = found.data.logs[log].noise.seen[:, k]
            squares += float(np.sum((both.logged - both.before)[found.data.rows[log], k][seen] ** 2))
            count += int(seen.sum())
        assert math.sqrt(squares / count) == pytest.approx(found.closure.channels[channel].before)


def test_logs_stand_in_the_order_of_their_loads() -> None:
    found = diagnosed("copper")
    loads = [found.data.logs[k].load for k in by_load(found)]
    assert loads == sorted(loads, reverse=True)
    assert loaded(found) == by_load(found)
    assert representative(found) == by_load(found)
    assert most_telling(found) in loaded(found)


def test_means_over_speed_are_those_of_the_blocks_before_braking() -> None:
    found = diagnosed("copper")
    one = series(found, sides(found), 0, "idc")
    rpm, logged, before, _ = means_over_speed(one)
    here = blocks_before_braking(one)
    bins: dict[int, list[int]] = {}
    for k in np.flatnonzero(here & np.isfinite(one.logged) & (one.rpm > 0)):
        bins.setdefault(math.floor(one.rpm[k] / BIN), []).append(int(k))
    for n, rows in enumerate(bins[key] for key in sorted(bins)):
        assert rpm[n] == pytest.approx(np.mean(one.rpm[rows]))
        assert logged[n] == pytest.approx(np.mean(one.logged[rows]))
        assert before[n] == pytest.approx(np.mean(one.before[rows]))
    assert len(bins) == rpm.size


def test_braking_is_left_out_of_means_over_speed() -> None:
    one = series(diagnosed("copper"), sides(diagnosed("copper")), 0, "idc")
    out, kept = one.phase == OUT, blocks_before_braking(one)
    assert not np.any(kept & ~out)
    dropped = out & ~kept
    assert np.any(dropped)
    assert np.max(one.rpm[dropped]) < 0.9 * np.max(one.rpm[out])


def test_the_rated_current_of_the_stator_is_a_larger_one_of_the_dc_link() -> None:
    found = diagnosed("rolloff")
    rated = found.rig.generator.i_rated
    direct = rated_dc_current(found)
    assert rated is not None
    assert direct is not None
    assert 0.72 < rated.value / direct < 0.85  # a bridge with a capacitor: 0.75 to 0.83 over the loads
    stator, dc = stator_current(found)
    assert stator.shape == dc.shape


# ------------------------------------------------------------------------------------------------------------- the map
@pytest.mark.parametrize("name", ALL)
def test_the_maps_have_a_number_for_every_place(name: str) -> None:
    found = diagnosed(name)
    places, stages = gap_map(found), stage_map(found)
    assert places is not None
    assert stages is not None
    for figure, shown in ((places, found.places), (stages, found.stages)):
        texts = [text.get_text() for text in figure.axes[0].texts]
        assert sorted(texts) == sorted(signed(place.z) for place in shown)
    bold = sum(text.get_fontweight() == "bold" for text in places.axes[0].texts)
    assert bold == sum(abs(place.z) > STANDS_OUT for place in found.places)
    names = [text.get_text() for text in stages.axes[0].get_yticklabels()]
    assert names[0] == "restoring: pressure, payout"
    assert len(names) == len({(place.stage, place.phase) for place in found.stages})


# ------------------------------------------------------------------------------------------------- time, speed, current
@pytest.mark.parametrize("name", ALL)
def test_every_figure_has_units_on_its_axes(name: str) -> None:
    found = diagnosed(name)
    both = sides(found)
    for figure in (
        history(found, both, 0, "log"),
        over_speed_figure(found, both, "log"),
        error_figure(found, both, "log"),
    ):
        assert figure is not None
        labels = " ".join(ax.get_xlabel() + ax.get_ylabel() for ax in figure.axes)
        assert "(s)" in labels or "(rpm)" in labels or "(A)" in labels
        assert all(ax.get_ylabel() for ax in figure.axes)


def test_the_history_draws_logged_minus_simulated() -> None:
    found = diagnosed("copper")
    both = sides(found)
    figure = history(found, both, 1, "log")
    assert figure is not None
    one = series(found, both, 1, "vdc")
    ax = figure.axes[CHANNELS.index("vdc")]
    assert both.after is not None
    assert one.after is not None
    before, after = ax.lines
    assert np.allclose(before.get_ydata(), one.logged - one.before, equal_nan=True)
    assert np.allclose(after.get_ydata(), one.logged - one.after, equal_nan=True)


def test_the_labels_of_the_history_stay_on_the_figure() -> None:
    found = diagnosed("copper")
    figure = history(found, sides(found), 1, "log")
    assert figure is not None
    figure.draw_without_rendering()
    assert all(ax.yaxis.label.get_window_extent().x0 > 0.0 for ax in figure.axes)


def test_errors_are_drawn_over_current_and_over_what_the_gap_depends_on() -> None:
    assert error_panels(diagnosed("copper")) == ["idc", "vdc"]
    assert error_panels(diagnosed("nothing")) == ["idc"]


# ------------------------------------------------------------------------------------------------------------ the laws
UNKNOWN = {
    "ke_rolloff", "rotor_windage", "line_drag", "drum_layering", "gas_polytropic", "electrical_lag", "drum_radius",
    "gear_ratio", "pole_pairs", "screw_lead", "encoder_scale", "stribeck", "heating", "diode_drop", "clutch_drag",
    "load_proportional_loss",
}  # fmt: skip
"""Effects that change nothing of which a tolerance is known, or several numbers by a law."""


@pytest.mark.parametrize("effect", EFFECTS)
def test_the_tolerance_of_what_an_effect_changes_is_found(effect: str) -> None:
    assert (tolerance_of(diagnosed("nothing"), EFFECTS[effect]) == 0.0) == (effect in UNKNOWN)


def test_a_tolerance_is_reported_in_the_unit_of_its_effect() -> None:
    found = diagnosed("nothing")
    rig = found.rig
    sd = {(n.section, n.name): n.sd for n in found.data.nuisances}
    assert rig.generator.k_e is not None
    assert rig.restoring.p_precharge is not None
    assert tolerance_of(found, EFFECTS["ke_shift"]) == pytest.approx(sd["generator", "k_e"] / rig.generator.k_e.value)
    absolute = rig.restoring.p_precharge.value + 101325.0
    assert tolerance_of(found, EFFECTS["precharge"]) == pytest.approx(sd["restoring", "p_precharge"] / absolute)
    assert tolerance_of(found, EFFECTS["gear_mesh_loss"]) == pytest.approx(sd["drivetrain", "eta_mesh"])
    assert tolerance_of(found, EFFECTS["torque_gain"]) == pytest.approx(0.001)
    assert tolerance_of(found, EFFECTS["rotor_windage"]) == 0.0


def test_each_number_stands_within_what_is_plausible() -> None:
    (row,) = cause_rows(diagnosed("copper"))
    assert row.low <= row.found.value <= row.high
    assert row.absent == 0.0
    assert numbers_figure(diagnosed("copper")) is not None
    assert numbers_figure(diagnosed("nothing")) is None


def test_the_roll_off_never_rises_lies_in_its_band_and_is_the_one_reported() -> None:
    found = diagnosed("rolloff")
    profile = profile_of(found)
    assert profile is not None
    assert profile.left[0] == 1.0
    assert np.all(np.diff(profile.left) <= 1e-12)
    assert np.all(profile.low <= profile.left + 2e-3)
    assert np.all(profile.high >= profile.left - 2e-3)
    reported = found.causes[0].parameters["k_e_ratio_at_10_a"].value
    if profile.current[-1] > 10.0:
        assert np.interp(10.0, profile.current, profile.left) == pytest.approx(reported, abs=1e-4)
    assert profile_figure(found) is not None
    assert profile_figure(diagnosed("copper")) is None


# ---------------------------------------------------------------------------------------------------------- the costs
def test_runs_of_one_load_are_averaged() -> None:
    found = diagnosed("copper")
    twice = msgspec.structs.replace(found, contributions=(*found.contributions, *found.contributions))
    for two, one in zip(load_costs(twice, "eta_pto"), load_costs(found, "eta_pto"), strict=True):
        assert (two.load, two.as_given) == pytest.approx((one.load, one.as_given))
        assert two.parts[0].value == pytest.approx(one.parts[0].value)


def test_the_waterfall_shows_three_loads_at_most_with_their_intervals() -> None:
    found = diagnosed("copper")
    more = [msgspec.structs.replace(c, load=(c.load or 0.0) + 100.0 * k) for k in range(3) for c in found.contributions]
    for one, loads in ((found, 2), (msgspec.structs.replace(found, contributions=tuple(more)), 3)):
        figure = waterfall_figure(one)
        assert figure is not None
        shown = [ax for ax in figure.axes if ax.get_visible()]
        assert len(shown) == loads
        for ax in shown:
            low, high = ax.get_xlim()
            assert all(low <= x <= high for line in ax.lines for x in np.asarray(line.get_xdata()).tolist())


def test_a_larger_effect_would_be_named_and_a_smaller_one_would_not() -> None:
    found = diagnosed("nothing")
    named = {one.effect: one.value for one in found.thresholds}
    assert set(named) == set(SUSPECTS)
    assert named["copper_heating"] is not None
    assert (
        tolerance_of(found, EFFECTS["copper_heating"])
        < named["copper_heating"]
        < PLANTED["copper"]["copper_heating"]["r_s_change"]
    )
    assert named["ke_rolloff"] is not None
    assert 0.8 < named["ke_rolloff"] < 1.0


@pytest.mark.slow
@pytest.mark.parametrize(("times", "named"), [(2.0, True), (0.4, False)])
def test_what_is_said_of_the_smallest_effect_holds_in_logs(times: float, named: bool) -> None:
    (minimum,) = (one.value for one in diagnosed("nothing").thresholds if one.effect == "copper_heating")
    assert minimum is not None
    runs = [one.run for one in made_logs({"copper_heating": {"r_s_change": times * minimum}})]
    found: ModelDiagnosis = diagnose(runs, load_rig("hsu2026"), {suspect: EFFECTS[suspect] for suspect in SUSPECTS})
    assert [cause.effect for cause in found.causes] == (["copper_heating"] if named else [])
