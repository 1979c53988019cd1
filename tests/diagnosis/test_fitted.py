"""Logs of one rig as one fit: residuals whitened, nuisances in their columns, zeros in their
logs.
"""

import math

import msgspec
import numpy as np
import pytest
from openlog import made_log, motion_run
from rigs import calibrated_rig

from winchcascade import simulate
from winchcascade.core.rig_file import ModelAccuracy
from winchcascade.diagnosis.fit.block_means import PHASES
from winchcascade.diagnosis.fit.fitted_log import OF_A_BLOCK, RHO, TOP
from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.diagnosis.fit.nearby import Slope, foreseen_of
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import make_effect

RIG = calibrated_rig()

PART = 0.02
"""Share of a tolerance by which a difference is taken."""

FAR, SHARE = ("c_dc", "friction of the drivetrain"), 0.2
"""Nuisances that are far from linear, and the share of their tolerance by which they are
differenced.
"""

LINEAR = 0.02
"""Share by which a column may miss the difference, in root mean squares. The column of a gain is
its share of the prediction, the offset of a coarse step included; where the clutch lets go a
derivative is none."""


@pytest.fixture(scope="module")
def data() -> Fitted:
    loaded = simulate(motion_run(load=18.0, cycles=2), baseline(RIG)).run
    return Fitted([made_log(seed=1, cycles=2), loaded], RIG)


def coloured(data: Fitted, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """White numbers (M, 5), and residuals with the covariance and the memory that the fit takes
    noise to have.
    """
    white = rng.normal(size=data.measured.shape)
    kept = white.copy()
    for k in np.flatnonzero(data.blocks.joined).tolist():
        kept[k] = RHO * kept[k - 1] + math.sqrt(1.0 - RHO**2) * white[k]
    own = np.concatenate([log.noise.own_total for log in data.logs])
    drive = np.concatenate([log.noise.drive for log in data.logs])
    seen = np.concatenate([log.noise.seen for log in data.logs])
    residual = np.zeros_like(kept)
    for k in range(kept.shape[0]):
        s = np.flatnonzero(seen[k])
        covariance = np.outer(drive[k, s], drive[k, s]) + np.diag(own[k, s] ** 2)
        residual[k, s] = np.linalg.cholesky(covariance) @ kept[k, s]
    return white, residual


def test_noise_as_the_fit_takes_it_is_whitened_to_unit_variance(data: Fitted) -> None:
    rng = np.random.default_rng(8)
    seen = np.concatenate([log.noise.seen for log in data.logs])
    always = seen.all(axis=0)
    drawn = np.stack([data.whiten(coloured(data, rng)[1]).reshape(seen.shape) for _ in range(40)])
    for k in range(len(CHANNELS)):
        assert np.std(drawn[:, seen[:, k], k]) == pytest.approx(1.0, abs=0.03), CHANNELS[k]
    joined = np.flatnonzero(data.blocks.joined)
    before = np.mean(drawn[:, joined][:, :, always] * drawn[:, joined - 1][:, :, always])
    assert before == pytest.approx(0.0, abs=0.02)
    pressure, force, torque = drawn[:, seen.all(axis=1), :3].reshape(-1, 3).T
    assert np.corrcoef([pressure, force, torque]) == pytest.approx(np.eye(3), abs=0.05)


def test_the_run_down_of_the_generator_is_known_no_better_than_its_run(data: Fitted) -> None:
    log, vdc = data.logs[1], CHANNELS.index("vdc")
    phase = log.course.blocks.phase
    run = np.quantile(np.abs(log.measured[phase == PHASES.index("payout"), vdc]), TOP)
    minimum = RIG.model.discrepancy * OF_A_BLOCK * run
    assert np.all(log.noise.model[phase == PHASES.index("hold"), vdc] >= 0.99 * minimum)


def test_a_channel_that_says_nothing_gives_zeros(data: Fitted) -> None:
    seen = np.concatenate([log.noise.seen for log in data.logs])
    z = data.whiten(np.ones(seen.shape)).reshape(seen.shape)
    quiet = ~seen
    quiet[1:] &= ~seen[:-1]
    assert not seen.all()
    assert np.all(z[quiet] == 0.0)


def test_the_nominal_model_leaves_noise_alone() -> None:
    """The noise of a log is never taken as less than it is, and as little more."""
    exact = msgspec.structs.replace(RIG, model=ModelAccuracy(discrepancy=0.0))
    logs = [Fitted([made_log(seed=seed, cycles=2)], exact) for seed in (1, 2, 3, 4)]
    z = np.concatenate([log.residual(np.zeros(len(log.nuisances)), []) for log in logs])
    assert 0.75 < np.mean(z[z != 0.0] ** 2) < 1.05


def test_a_column_is_what_a_tolerance_moves(data: Fitted) -> None:
    nothing = np.zeros(len(data.nuisances))
    at, columns = data.predict(nothing, []), data.columns(nothing, [])
    for j, n in enumerate(data.nuisances):
        one = np.eye(nothing.size)[j]
        if str(n) in FAR:
            actual = data.whiten(data.predict(SHARE * one, []) - at) / SHARE
        else:
            actual = data.whiten(data.predict(PART * one, []) - data.predict(-PART * one, [])) / (
                2.0 * PART
            )
        assert np.linalg.norm(columns @ one - actual) <= LINEAR * np.linalg.norm(actual) + 1e-30, (
            str(n)
        )


def test_a_zero_moves_its_own_log_and_a_load_its_own_runs(data: Fitted) -> None:
    columns = data.columns(np.zeros(len(data.nuisances)), [])
    for j, n in enumerate(data.nuisances):
        first, second = np.split(
            columns @ np.eye(len(data.nuisances))[j], [len(CHANNELS) * data.sizes[0]]
        )
        if n.kind == "zero":
            assert not (second if n.log == 0 else first).any()
        if n.kind == "load":
            assert not first.any()
            assert second.any()
        if n.kind == "discrepancy":
            assert first.any() <= (math.isnan(n.load) or n.load == data.logs[0].load)


def test_the_discrepancy_of_the_model_is_a_share_of_the_plateau_of_its_log(data: Fitted) -> None:
    spread, first = np.sqrt(np.sum(data.discrepancies() ** 2, axis=2)), data.logs[0]
    torque, pressure = (CHANNELS.index(name) for name in ("torque", "pressure"))
    payout = first.course.blocks.phase == 0
    share = spread[data.rows[0]][payout, torque].max() / np.quantile(
        first.measured[payout, torque], 0.9
    )
    assert share == pytest.approx(RIG.model.discrepancy, rel=0.02)
    swing = np.ptp(first.measured[:, pressure])
    assert spread[data.rows[0], pressure].max() == pytest.approx(
        RIG.model.discrepancy * swing, rel=0.02
    )
    haul_in = first.course.blocks.phase == 2
    assert not spread[data.rows[0]][
        haul_in, torque
    ].any()  # the clutch is open: zero is no share of a plateau


def test_a_deviation_of_the_model_within_blocks_is_the_same_in_repeats() -> None:
    run = made_log(seed=1, cycles=3)
    once, twice = Fitted([run], RIG), Fitted([run, run], RIG)
    single, repeated = once.logs[0].noise, twice.logs[0].noise
    deviation = single.model
    assert deviation.any()
    extra = repeated.own_total**2 - single.own_total**2
    np.testing.assert_allclose(extra, deviation**2, atol=1e-9 * float(np.max(single.own_total**2)))


def test_only_the_cycles_that_count_are_fitted() -> None:
    run = made_log(seed=1, cycles=3)
    whole, one = Fitted([run], RIG), Fitted([run], RIG, [(2, 2)])
    assert one.sizes[0] < 0.5 * whole.sizes[0]
    assert set(one.logs[0].course.blocks.cycle.tolist()) == {2}


def test_a_missing_channel_is_left_out_of_the_fit() -> None:
    run = made_log(seed=1, cycles=1)
    bare = msgspec.structs.replace(
        run, channels={k: x for k, x in run.channels.items() if k != "torque"}
    )
    data = Fitted([bare], RIG)
    assert not data.logs[0].noise.seen[:, CHANNELS.index("torque")].any()
    assert not any(n.name == "torque" for n in data.nuisances)


def test_a_number_and_an_effect_together_make_no_rig_that_cannot_be(data: Fitted) -> None:
    names = [(n.section, n.name) for n in data.nuisances]
    for effect, name, limit in (
        (make_effect("screw_friction", {"mu_change": -0.04}), ("restoring", "mu_screw"), -2.0),
        (
            make_effect("gear_mesh_loss", {"efficiency_change": 0.0}),
            ("drivetrain", "eta_mesh"),
            50.0,
        ),
    ):
        nu = np.zeros(len(data.nuisances))
        nu[names.index(name)] = limit
        found = data.models(nu, [effect])[0]
        assert (found.restoring.mu, found.drivetrain.eta_mesh).count(
            0.0 if limit < 0.0 else 1.0
        ) == 1
        assert simulate(motion_run(load=18.0, cycles=1), found).run.t.size > 0


def test_derivatives_serve_near_to_where_they_were_taken(data: Fitted) -> None:
    nothing, place = np.zeros(len(data.nuisances)), np.zeros(len(data.nuisances))
    of_the_rig = [j for j, n in enumerate(data.nuisances) if n.kind == "rig"]
    place[of_the_rig] = 0.1
    taken, serving = (data.tolerances(nu, [])[:, :, of_the_rig] for nu in (nothing, place))
    assert serving == pytest.approx(taken, rel=1e-9, abs=1e-12)
    own = data.tolerances(place, [], serves=-1.0)[:, :, of_the_rig]
    missed = data.whiten(own - taken)
    assert 0.0 < np.linalg.norm(missed) < LINEAR * np.linalg.norm(data.whiten(taken))


def test_derivatives_that_miss_the_way_to_a_place_do_not_serve_there(data: Fitted) -> None:
    nothing = np.zeros(len(data.nuisances))
    slightly, weak = ([make_effect("ke_shift", {"k_e_change": by})] for by in (-0.05, -0.4))
    data.tolerances(nothing, slightly)
    lent, served, own = (data.tolerances(nothing, weak, way) for way in (math.inf, 0.0, -1.0))
    assert np.any(lent != own)
    assert served == pytest.approx(own, rel=1e-9, abs=1e-12)


def test_what_newly_acts_has_derivatives_of_its_own(data: Fitted) -> None:
    """What the cooling of a gas moves depends on whether it heats."""
    nothing = np.zeros(len(data.nuisances))
    absent, here, there = (
        [make_effect("gas_polytropic", {"n": n, "cooling": cooling})]
        for n, cooling in ((1.0, 3.0), (1.01, 2.0), (1.01, 3.0))
    )
    data.predictions_near((nothing, []), [(nothing, absent)])
    near = data.predictions_near((nothing, here), [(nothing, there)])[:, :, 0]
    assert near == pytest.approx(data.predict(nothing, there), rel=1e-9)
    assert np.any(near != data.predict(nothing, here))


def test_what_rounding_leaves_of_a_change_has_no_derivative() -> None:
    """Shares of a roll-off are products of those before them, and cancel but for rounding."""
    rng, lost = np.random.default_rng(0), np.array([0.001, 0.0006, 0.0, 0.013, 0.03, 0.07, 5e-11])

    def change(way: np.ndarray) -> dict[str, float]:
        moved = np.cumprod(1.0 - lost - way) - np.cumprod(1.0 - lost)
        return {f"{k}": by for k, by in enumerate(moved.tolist()) if by}

    ways = 0.003 * np.eye(lost.size)[:-1]
    slopes = {f"{k}": Slope(change(way), np.full((1, 5), float(k))) for k, way in enumerate(ways)}
    for size in rng.uniform(-0.002, 0.002, (200, lost.size)):
        foreseen, left = foreseen_of(slopes, change(np.append(size[:-1], -lost[-1])), 0.0)
        expected = size[:-1] / 0.003 @ np.arange(lost.size - 1.0)
        assert not left
        assert foreseen == pytest.approx(expected, abs=0.2)
