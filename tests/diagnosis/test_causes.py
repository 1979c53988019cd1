"""The scatter behind the interval of a cause, and what a planned run distinguishes, against plain sums."""

import numpy as np
import pytest
from test_stability import COPPER, STEADY, fitted

from winchcascade.diagnosis import causes
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.diagnosis.solve import HUBER
from winchcascade.rig.effects.catalogue import make_effect


def test_the_scatter_is_the_sum_of_squared_scores_of_the_phases_of_cycles(monkeypatch: pytest.MonkeyPatch) -> None:
    data, fit = fitted(STEADY)
    expanded, j_nu, j_phi = causes._expanded(data, fit)
    columns = (j_phi - j_nu @ expanded.back)[:, 0]
    residual = np.clip(fit.z, -HUBER, HUBER)
    scores: list[float] = []
    for row, joined in enumerate(data.blocks.joined.tolist()):
        if not joined:
            scores.append(0.0)
        own = slice(row * len(CHANNELS), (row + 1) * len(CHANNELS))
        scores[-1] += float(residual[own] @ columns[own])
    counted = [score for score in scores if score]
    n = len(counted)
    assert n > causes.FEW
    expected = n / (n - 1) * sum(score**2 for score in counted) + float(expanded.back[:, 0] @ expanded.back[:, 0])
    assert causes._scattered(data, fit).ravel() == pytest.approx([expected])
    monkeypatch.setattr(causes, "FEW", n)
    assert causes._scattered(data, fit).ravel() == pytest.approx([expected])
    monkeypatch.setattr(causes, "FEW", n + 1)
    assert causes._scattered(data, fit).tolist() == [[0.0]]


def test_a_planned_run_does_not_distinguish_what_a_tolerance_explains() -> None:
    data, fit = fitted(STEADY)
    best, other = (data.model(fit.nu, [make_effect(COPPER, {"r_s_change": change})]) for change in (0.6, 0.0))
    run = causes._planned(9.0, 0.8, 8.0, data)

    def score(**of: object) -> float:
        both = causes._Explanations(best, other, (), (), np.zeros((0, 0)))
        return causes._score(data, both._replace(**of), run)  # type: ignore[arg-type]

    alone = score()
    assert alone > 10.0
    assert score(best=other) == pytest.approx(0.0, abs=1e-6)
    tolerance = score(tolerances=[best])
    assert tolerance == pytest.approx(alone / np.hypot(1.0, alone), rel=1e-6)  # one direction with a prior of one
    field = score(fields=[(best, 0.5)], precision=np.array([[0.25]]))
    assert field == pytest.approx(alone / np.hypot(1.0, alone / 0.25), rel=1e-6)
