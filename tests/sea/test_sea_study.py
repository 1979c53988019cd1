"""A corrected rig in several seas: bands, energy of a year, loads, limits, domain, Froude's law,
files and what is refused.
"""

import json
import math
from pathlib import Path

import h5py
import msgspec
import numpy as np
import pytest
from calls import call

from winchcascade.batch.seas_given import seas_of
from winchcascade.core.errors import OptionError
from winchcascade.design import operating
from winchcascade.diagnosis.diagnosis_result import Judgement
from winchcascade.diagnosis.handover.posterior import RigPosterior
from winchcascade.diagnosis.handover.posterior_record import posterior_record
from winchcascade.diagnosis.handover.tested import Tested as Covered
from winchcascade.ingest.read import read_run
from winchcascade.sea.hydrodynamics import Hydrodynamics, read_float
from winchcascade.sea.sea_study import Seas, SeaStudy, sea_study
from winchcascade.sea.wave_spectra import SeaState

SEAS = Seas((SeaState(0.3, 5.0), SeaState(0.6, 5.0)), (100.0, 50.0), minutes=1.0)


@pytest.fixture(scope="module")
def covered() -> Covered:
    return Covered(
        title="drawn", rig="hsu2026", judgement=Judgement("explained", ("copper_heating",)), loads=(9.0, 36.0),
        border=((0.0, 0.0), (1.0, 0.0), (1.0, 15.0), (0.0, 15.0)), force=5000.0, speed=0.9, length=9.6, ramp=2.0,
    )  # fmt: skip


@pytest.fixture(scope="module")
def found(small: RigPosterior, covered: Covered) -> SeaStudy:
    return sea_study(small, covered, SEAS, compare=True, draws=10, limits={"current": 5.0})


def test_a_year_is_the_hours_times_the_powers(found: SeaStudy) -> None:
    assert found.year is not None
    watt_hours = sum(row.hours * row.values["p_gen_w"].value for row in found.rows)
    assert found.year.value == pytest.approx(1e-6 * watt_hours)
    assert found.year.low < found.year.value < found.year.high


def test_the_best_load_of_a_sea_gives_no_less_than_that_of_all(found: SeaStudy) -> None:
    for row in found.rows:
        assert row.gain["best_over_fixed"].value > -1e-3
        assert row.power["best"].value >= 0.999 * row.values["p_gen_w"].value
        assert sum(row.lost.values()) + row.values["p_gen_w"].value == pytest.approx(
            row.values["p_line_w"].value, rel=0.02
        )


def test_a_sea_over_a_limit_and_one_beyond_the_logs_are_flagged(
    small: RigPosterior, covered: Covered
) -> None:
    rough = Seas((SeaState(0.3, 5.0), SeaState(2.0, 5.0)), (1.0, 1.0), minutes=1.0)
    calm, high = sea_study(small, covered, rough, load=9.0, draws=0, limits={"speed": 2000.0}).rows
    assert (calm.exceeds, high.exceeds) == ((), ("speed",))
    assert calm.outside < 0.05 < 0.3 < high.outside


def test_a_sea_without_room_has_a_reason_and_no_share_of_the_year(
    small: RigPosterior, covered: Covered
) -> None:
    huge = Seas((SeaState(0.3, 5.0), SeaState(200.0, 20.0)), (1.0, 1.0), minutes=1.0)
    found = sea_study(small, covered, huge, load=9.0, draws=0)
    assert not found.rows[0].reason
    assert found.rows[1].reason
    assert found.hours == 1.0


def test_froude_scales_powers_of_the_same_waves(small: RigPosterior, covered: Covered) -> None:
    large = Seas(
        (SeaState(3.0, 5.0 * math.sqrt(10.0)),), (1.0,), froude=10.0, minutes=math.sqrt(10.0)
    )
    (scaled,) = sea_study(small, covered, large, load=9.0, draws=0).rows
    (own,) = sea_study(
        small, covered, Seas((SeaState(0.3, 5.0),), (1.0,), minutes=1.0), load=9.0, draws=0
    ).rows
    assert scaled.values["p_gen_w"].value == pytest.approx(
        10.0**3.5 * own.values["p_gen_w"].value, rel=1e-6
    )
    assert scaled.values["i_s_a"].value == pytest.approx(own.values["i_s_a"].value, rel=1e-6)


def test_draws_have_the_spread_of_the_posterior(small: RigPosterior) -> None:
    own = np.array([model.generator.k_e for model, _ in small.draws(400, 1)])
    assert float(np.std(own) / np.mean(own)) == pytest.approx(0.004, rel=0.15)
    assert small.draws(3, 1) == small.draws(3, 1)


def test_beyond_the_logs_draws_have_the_laws_of_the_effects_too(small: RigPosterior) -> None:
    known = msgspec.structs.replace(small, covariance=np.zeros_like(small.covariance), others=())
    given = known.model()
    for within, beyond in known.draws(3, 1):
        assert within == given
        assert beyond.generator.r_s != given.generator.r_s
        assert beyond.generator.r_s == pytest.approx(given.generator.r_s, rel=0.02)


def test_the_best_fixed_load_is_within_the_limits_and_the_logs(
    small: RigPosterior, covered: Covered, found: SeaStudy
) -> None:
    free = sea_study(small, covered, SEAS, compare=True, draws=0)
    assert all(9.0 <= row.best_load <= 36.0 for row in free.rows)
    largest = max(row.values["i_s_a"].value for row in free.rows)
    limits = {"current": 0.8 * largest}
    held = sea_study(small, covered, SEAS, compare=True, draws=0, limits=limits)
    assert held.load > free.load
    assert not any(row.exceeds for row in held.rows)
    with pytest.raises(OptionError, match="limits"):
        sea_study(small, covered, SEAS, draws=0, limits={"speed": 1.0})


def test_a_gain_of_a_load_that_the_logs_do_not_cover_is_flagged(
    small: RigPosterior, covered: Covered
) -> None:
    narrow = msgspec.structs.replace(
        covered, border=((0.0, 0.0), (1.0, 0.0), (1.0, 4.0), (0.0, 4.0))
    )
    (row,) = sea_study(
        small, narrow, Seas(SEAS.states[1:], (1.0,), minutes=1.0), load=36.0, compare=True, draws=0
    ).rows
    assert row.covered()
    assert not row.covered("best_over_fixed")


def test_rows_of_a_scatter_table_are_put_into_bins(tmp_path: Path) -> None:
    table = tmp_path / "scatter.csv"
    table.write_text("hs_m,tp_s,hours_per_year\n0.4,5.8,10\n0.6,6.2,5\n1.1,8.2,3\n")
    seas = seas_of(table, None, (), (), gamma=1.0, minutes=20.0, seed=0)
    assert [(sea.hs, sea.tp) for sea in seas.states] == [(0.5, 6.0), (1.0, 8.0)]
    assert seas.hours == (15.0, 3.0)
    table.write_text("hs_m,tp_s,hours_per_year\n0.05,1.2,10\n")
    with pytest.raises(OptionError, match="--bins"):
        seas_of(table, None, (), (), gamma=1.0, minutes=20.0, seed=0)


def written(folder: Path, small: RigPosterior, covered: Covered, verdict: str) -> Path:
    """The JSON of a diagnosis with a verdict."""
    record = posterior_record(small, covered)
    record["tested"]["judgement"]["verdict"] = verdict
    path = folder / "diagnosis.json"
    path.write_text(json.dumps({"schema": "winchcascade/diagnosis/1", "posterior": record}))
    return path


def test_the_command_writes_its_files_and_refuses_an_unexplained_gap(
    small: RigPosterior, covered: Covered, tmp_path: Path
) -> None:
    options = ["--hs", "0.3", "--tp", "4,5", "--minutes", "1", "--draws", "4", "--load", "9"]
    source = str(written(tmp_path, small, covered, "explained"))
    made = call(
        "sea", source, *options, "--json", f"{tmp_path}/sea.json", "--csv", f"{tmp_path}/sea.csv"
    )
    assert made.code == 0
    record = json.loads((tmp_path / "sea.json").read_text())
    assert (record["schema"], record["verdict"], record["seed"]) == (
        "winchcascade/sea/1",
        "explained",
        0,
    )
    assert [row["tp_s"] for row in record["rows"]] == [4.0, 5.0]
    assert (tmp_path / "sea.csv").read_text().splitlines()[1].endswith(",explained")
    source = str(written(tmp_path, small, covered, "unexplained"))
    assert call("sea", source, *options).code == 2
    forced = call("sea", source, *options, "--csv", f"{tmp_path}/sea.csv", "--force")
    assert forced.code == 0
    assert (tmp_path / "sea.csv").read_text().splitlines()[1].endswith(",unexplained")


def test_a_float_is_read_from_what_bemio_and_capytaine_write(tmp_path: Path) -> None:
    omega = np.linspace(0.1, 6.0, 40)
    added, damping = 300.0 + 0.0 * omega, 40.0 * omega * np.exp(-omega)
    force = 5000.0 * np.exp(-0.3 * omega) * np.exp(1j * 0.2 * omega)
    rho, g = 1000.0, 9.81
    with h5py.File(tmp_path / "bemio.h5", "w") as file:
        file["simulation_parameters/w"], file["simulation_parameters/rho"] = omega, rho
        file["simulation_parameters/g"], file["body1/properties/disp_vol"] = g, 1.2
        one = np.zeros((6, 6, omega.size))
        one[2, 2] = added / rho
        file["body1/hydro_coeffs/added_mass/all"] = one
        one[2, 2] = damping / rho / omega
        file["body1/hydro_coeffs/radiation_damping/all"] = one
        stiff = np.zeros((6, 6))
        stiff[2, 2] = 6600.0 / rho / g
        file["body1/hydro_coeffs/linear_restoring_stiffness"] = stiff
        for part, values in (("re", force.real), ("im", force.imag)):
            six = np.zeros((6, 1, omega.size))
            six[2, 0] = values / rho / g
            file[f"body1/hydro_coeffs/excitation/{part}"] = six
    with h5py.File(tmp_path / "capytaine.nc", "w") as file:
        dimensions = {
            "omega": omega,
            "complex": np.array([b"re", b"im"]),
            "wave_direction": np.zeros(1),
        }
        dimensions |= {name: np.array([b"Heave"]) for name in ("radiating_dof", "influenced_dof")}
        for name, values in dimensions.items():
            file[name] = values
            file[name].make_scale(name)
        pair = ("influenced_dof", "radiating_dof")
        named = {
            "added_mass": (added[:, None, None], ("omega", "radiating_dof", "influenced_dof")),
            "radiation_damping": (
                damping[:, None, None],
                ("omega", "radiating_dof", "influenced_dof"),
            ),
            "inertia_matrix": (np.array([[1200.0]]), pair),
            "hydrostatic_stiffness": (np.array([[6600.0]]), pair),
            "excitation_force": (
                np.stack([force.real, -force.imag])[:, :, None, None],
                ("complex", "omega", "wave_direction", "influenced_dof"),
            ),
        }
        for name, (values, along) in named.items():
            file[name] = values
            for k, dimension in enumerate(along):
                file[name].dims[k].attach_scale(file[dimension])
    for name in ("bemio.h5", "capytaine.nc"):
        body = read_float(tmp_path / name)
        assert isinstance(body, Hydrodynamics)
        assert (body.mass, body.stiffness) == pytest.approx((1200.0, 6600.0))
        for own, expected in (
            (body.added, added),
            (body.damping, damping),
            (body.excitation, force),
        ):
            assert np.allclose(own, expected)


def test_a_pulled_float_gives_less_than_a_follower(small: RigPosterior, covered: Covered) -> None:
    omega = np.linspace(0.1, 8.0, 80)
    damping = 100.0 * omega * np.exp(-omega)
    body = Hydrodynamics(
        omega,
        400.0 + 0.0 * omega,
        damping,
        (9000.0 * np.exp(-0.1 * omega)).astype(np.complex128),
        900.0,
        9000.0,
    )
    one = Seas((SeaState(0.4, 6.0),), (1.0,), minutes=1.0)
    pulled = sea_study(small, covered, one, body=body, load=5.0, draws=2).rows[0]
    free = sea_study(small, covered, one, load=5.0, draws=2).rows[0]
    assert 0.0 < pulled.values["p_gen_w"].value < free.values["p_gen_w"].value


def wave_log(path: Path, drift: float = 0.0) -> Path:
    """A log of waves that begin and end, about a level that may rise. [m]"""
    t = np.arange(0.0, 160.0, 0.05)
    share = np.clip((t - 25.0) / 10.0, 0.0, 1.0) * np.clip((135.0 - t) / 10.0, 0.0, 1.0)
    x = np.sum(
        [0.12 * np.sin(2.0 * np.pi * f * t + 9.0 * f) for f in (0.15, 0.18, 0.21, 0.25)], axis=0
    )
    rows = zip(
        t, x * share**2 * (3.0 - 2.0 * share) + drift * share.cumsum() / share.sum(), strict=True
    )
    path.write_text(
        "time_s,displacement_m\n" + "".join(f"{now:.2f},{here:.6f}\n" for now, here in rows)
    )
    return path


def test_a_log_of_waves_gives_what_a_design_gives_along_it(
    small: RigPosterior, covered: Covered, tmp_path: Path
) -> None:
    path, model = wave_log(tmp_path / "wave.csv"), small.model()
    motion = operating.motion_of_run(read_run(path, campaign=False))
    designed = operating.point(model, operating.path_of(motion, model), 20.0)
    expected = dict(zip(operating.QUANTITIES, designed, strict=True))
    seas = seas_of(None, path, (), (), gamma=3.3, minutes=20.0, seed=0)
    found = sea_study(small, covered, seas, load=20.0, draws=0, payout=0.0).rows[0].values
    for power, energy in (("p_gen_w", "e_gen_j"), ("p_line_w", "e_line_j")):
        assert found[power].value * 60.0 * seas.minutes == pytest.approx(
            motion.cycles * expected[energy], rel=2e-3
        )
    for name in ("rpm", "i_s_a", "force_n", "torque_nm"):
        assert found[name].value == pytest.approx(expected[name], rel=1e-3)


def test_a_log_that_does_not_return_and_two_kinds_of_seas_are_rejected(tmp_path: Path) -> None:
    path = wave_log(tmp_path / "wave.csv", drift=5.0)
    with pytest.raises(OptionError, match="from where it begins"):
        seas_of(None, path, (), (), gamma=3.3, minutes=20.0, seed=0)
    with pytest.raises(OptionError, match="--motion"):
        seas_of(None, path, (0.3,), (5.0,), gamma=3.3, minutes=20.0, seed=0)


@pytest.mark.slow
def test_the_command_compares_a_schedule_within_limits_along_a_log(
    small: RigPosterior, covered: Covered, tmp_path: Path
) -> None:
    source, path = written(tmp_path, small, covered, "explained"), wave_log(tmp_path / "wave.csv")
    out, options = tmp_path / "sea.json", ["--load", "20", "--draws", "0", "--compare", "--json"]
    surface, loads = np.loadtxt(path, delimiter=",", skiprows=1)[:, 1], []
    for limit in ([], ["--current-limit", "5"]):
        assert call("sea", source, "--motion", path, *options, out, *limit, "--force").code == 0
        record = json.loads(out.read_text())
        loads.append([row["load_ohm"] for row in record["schedule"]])
        assert record["spectrum"]["gamma"] is None
        assert record["rows"][0]["hs_m"] == pytest.approx(4.0 * np.std(surface), rel=0.01)
    assert min(loads[1]) > min(loads[0])
