"""The posterior of a rig: its record, its repairs, and directions that have its covariance."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
import pytest
from calls import call
from diagnosed import PLANTED, made_logs
from rigs import calibrated_rig

from winchcascade.core.errors import OptionError
from winchcascade.diagnosis.diagnose import diagnose
from winchcascade.diagnosis.handover.posterior_record import posterior_from, posterior_record
from winchcascade.report.results.diagnosis_record import as_json
from winchcascade.rig.effects.catalogue import EFFECTS
from winchcascade.rig.effects.run_order import RunOrder, lasting_heat, warming

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from winchcascade.core.run import Mask, Signal
    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.handover.posterior import RigPosterior
    from winchcascade.diagnosis.handover.tested import Tested

SHARE = 1e-8
"""Variance along directions that count as known, as a share of that of each number. [1]"""


def test_a_posterior_is_read_as_it_was_written(
    fitted: RigPosterior, tested: Tested, record: Path
) -> None:
    read, covered = posterior_from(json.loads(record.read_text())["posterior"], "here")
    assert covered == tested
    assert read.model() == fitted.model()
    np.testing.assert_array_equal(read.best, fitted.best)
    np.testing.assert_array_equal(read.covariance, fitted.covariance)
    assert read.models("copper_heating") == fitted.models("copper_heating")


def test_the_corrected_rig_has_the_known_effect(
    copper: ModelDiagnosis, fitted: RigPosterior
) -> None:
    u = math.sqrt(fitted.covariance[-1, -1])
    assert fitted.best[-1] == pytest.approx(0.4, abs=3.0 * u)
    assert 0.0 < u < 0.05
    stated = copper.data.nominal.physics.generator.r_s
    assert fitted.model().generator.r_s == pytest.approx(1.4 * stated, rel=0.02)
    assert fitted.model(without="copper_heating").generator.r_s == pytest.approx(stated, rel=0.02)


def test_a_repair_takes_its_effect_alone_away(small: RigPosterior) -> None:
    bare = msgspec.structs.replace(small, effects=(), covariance=small.covariance[:2, :2]).model()
    copper, drag = small.effects
    assert small.model() == drag.apply(copper.apply(bare))
    assert small.model(without="copper_heating") == drag.apply(bare)
    assert small.model(without="line_drag") == copper.apply(bare)


def test_directions_have_the_covariance(small: RigPosterior, fitted: RigPosterior) -> None:
    for one in (small, fitted):
        ways, scale = one.directions(), np.sqrt(np.diag(one.covariance))
        unit = np.where(scale > 0.0, scale, 1.0)
        assert ways.T @ ways / np.outer(unit, unit) == pytest.approx(
            one.covariance / np.outer(unit, unit), abs=SHARE
        )
        assert len(one.models()) == 1 + len(ways)


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("covariance", lambda _: [[1.0]]),
        ("nominal", lambda parts: {name: parts[name] for name in list(parts)[1:]}),
        ("effects", lambda found: [{**found[0], "effect": "an effect of another version"}]),
        ("numbers", lambda found: found[1:]),
        ("tested", lambda found: {**found, "loads": "nine"}),
        ("tested", lambda found: {**found, "border": []}),
        ("covariance", lambda found: [[None, *found[0][1:]], *found[1:]]),
        ("covariance", lambda found: [[-x for x in row] for row in found]),
        ("nominal", lambda parts: parts | {"winch": [1.0]}),
        ("numbers", lambda found: [{**found[0], "path": "winch.nothing"}, *found[1:]]),
    ],
)
def test_a_damaged_posterior_is_rejected(
    fitted: RigPosterior, tested: Tested, name: str, wrong: Callable[[Any], Any]
) -> None:
    record = json.loads(json.dumps(posterior_record(fitted, tested)))
    with pytest.raises(OptionError, match=r"old\.json"):
        posterior_from({**record, name: wrong(record[name])}, "old.json")


def test_a_diagnosis_of_an_older_version_is_rejected(record: Path, tmp_path: Path) -> None:
    old = tmp_path / "old.json"
    older = {
        name: value for name, value in json.loads(record.read_text()).items() if name != "posterior"
    }
    old.write_text(json.dumps(older), encoding="utf-8")
    done = call("design", old)
    assert (done.code, done.out) == (2, "")
    assert "old.json" in done.err


@pytest.mark.parametrize("time_constant", [0.3, 3.0, 30.0])
@pytest.mark.parametrize("heats", [(0.2, 1.0, 1.8), (1.8, 1.0, 0.2)])
def test_a_lasting_heat_keeps_the_machine_as_warm_as_its_warmest_run(
    time_constant: float, heats: tuple[float, ...]
) -> None:
    runs = len(heats)
    heat = lasting_heat(RunOrder(tuple(map(float, range(runs))), heats), time_constant, 1.0)
    later = tuple(float(k) for k in range(1000, 1400))
    rises = warming(
        RunOrder((*map(float, range(runs)), *later), (*heats, *(heat for _ in later))),
        time_constant,
        1.0,
    )
    assert rises[-1] == pytest.approx(max(rises[:runs]), rel=1e-4)


def test_what_was_tested_covers_its_logs_and_nothing_far_from_them(tested: Tested) -> None:
    corners = np.array(tested.border)
    shares = np.random.default_rng(1).dirichlet(np.ones(len(corners)), 100)
    middle, force = corners.mean(axis=0), np.array(tested.force)

    def covered(places: Signal, force: Signal = force) -> Mask:
        return np.asarray(tested.covers(places[:, 0], places[:, 1], force), dtype=bool)

    assert covered(corners).all()
    assert covered(shares @ corners).all()
    assert not covered(shares @ corners, 1.1 * force).any()
    assert not covered(middle + 1.2 * (corners - middle)).any()


@pytest.mark.parametrize("idc", [None, 0.0])
def test_logs_without_a_current_are_diagnosed_and_recorded(idc: float | None) -> None:
    runs = []
    for one in made_logs(PLANTED["nothing"], 40.0):
        channels = {name: x for name, x in one.run.channels.items() if name != "idc"}
        dead = {} if idc is None else {"idc": np.full(one.run.t.size, idc)}
        runs.append(msgspec.structs.replace(one.run, channels=channels | dead))
    found = diagnose(
        runs, calibrated_rig(), {"line_drag": EFFECTS["line_drag"]}, title="no current", seed=1
    )
    assert (
        len(
            json.loads(json.dumps(as_json(found), allow_nan=False))["posterior"]["tested"]["border"]
        )
        > 1
    )


def test_powers_of_one_load_have_no_discrepancy_of_their_own(tested: Tested) -> None:
    known = msgspec.structs.replace(tested, loads=(9.0, 18.0, 36.0), u_load=1e-3)
    assert known.u_ratio([12.0], [12.0]) == 0.0
    assert known.u_ratio([9.0], [36.0]) == pytest.approx(2.0 * math.sqrt(2.0) * 1e-3)
    assert known.u_ratio([9.0, 36.0], [18.0]) == pytest.approx(2.0 * math.sqrt(1.5) * 1e-3)
    assert 0.0 < known.u_ratio([9.0], [10.0]) < known.u_ratio([9.0], [12.0])
    assert 0.0 < tested.u_load < 2e-3  # less than the rig file allows
