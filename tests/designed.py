"""A diagnosed campaign of two loads with a known cause, and a posterior of few numbers, which is
quick to design with.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from diagnosed import diagnosed

from winchcascade.core.rig_toml import built_in
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.handover.posterior import RigPosterior, posterior_of_rig
from winchcascade.diagnosis.handover.tested import Tested, tested_by
from winchcascade.report.results.diagnosis_record import as_json
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import make_effect
from winchcascade.rig.effects.effect import Parameter


@pytest.fixture(scope="session")
def copper() -> ModelDiagnosis:
    """Stator resistance 40 % above its stated value, fitted."""
    return diagnosed("copper")


@pytest.fixture(scope="session")
def fitted(copper: ModelDiagnosis) -> RigPosterior:
    return posterior_of_rig(copper)


@pytest.fixture(scope="session")
def tested(copper: ModelDiagnosis) -> Tested:
    covered = tested_by(copper)
    assert covered is not None
    return covered


@pytest.fixture(scope="session")
def record(copper: ModelDiagnosis, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The JSON of the diagnosis."""
    path = tmp_path_factory.mktemp("diagnosis") / "diagnosis.json"
    path.write_text(json.dumps(as_json(copper), allow_nan=False), encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def small() -> RigPosterior:
    """Two numbers and two effects of the rig of the paper, of which the first number and the
    first effect are correlated.
    """
    numbers = tuple(
        Parameter(name, path=f"generator.{name}", operation="scale") for name in ("r_s", "k_e")
    )
    effects = (
        make_effect("copper_heating", {"r_s_change": 0.4}),
        make_effect("line_drag", {"b": 0.9}),
    )
    sd = np.array([0.03, 0.004, 0.05, 0.1])
    covariance = np.diag(sd**2)
    covariance[0, 2] = covariance[2, 0] = -0.8 * sd[0] * sd[2]
    return RigPosterior(baseline(built_in()), numbers, (0.01, -0.002), effects, covariance)
