"""Trials for the tests: answers sealed by hand, and diagnoses that never looked at a log."""

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import msgspec
import pytest

from winchcascade.blind.cases import (
    SEALED,
    TRIAL,
    Answer,
    Case,
    Kind,
    SealedAnswers,
    campaign_toml,
    make_campaign,
    seal,
    trial_bytes,
)
from winchcascade.blind.injected import PARTS
from winchcascade.diagnosis.suspects import Suspects


def answer(
    case: str,
    kind: Kind,
    effects: Mapping[str, float] | None = None,
    *,
    outsider: str | None = None,
    truth: Mapping[str, float] | None = None,
) -> Answer:
    """An answer without a rig; true parameters by effect, 0.5 where none is given."""
    hidden = dict(effects or {})
    parameters = {name: {PARTS[name].parameter: (truth or {}).get(name, 0.5)} for name in hidden}
    return Answer(case, kind, hidden, outsider, parameters, {}, {}, {}, {})


def sealed_trial(folder: Path, *answers: Answer) -> Path:
    """A folder with sealed answers and no logs."""
    content, trial = seal(SealedAnswers(0, answers))
    (folder / "diagnoses").mkdir(parents=True)
    (folder / SEALED).write_bytes(content)
    (folder / TRIAL).write_bytes(trial_bytes(trial))
    return folder


def cause(effect: str, *rivals: str, value: float = 0.5, half: float = 0.1) -> dict[str, Any]:
    """A cause as a diagnosis writes it, with an interval of a half-width about its value."""
    said = {PARTS[effect].parameter: {"value": value, "low": value - half, "high": value + half, "unit": "1"}}
    return {
        "effect": effect,
        "stage": PARTS[effect].stage,
        "probability": 0.9,
        "parameters": said,
        "rivals": [{"effect": rival, "probability": 0.1, "told_apart_by": ""} for rival in rivals],
    }


def say(folder: Path, case: str, verdict: str, *causes: dict[str, Any], share: float | None = None) -> None:
    """Write a case's diagnosis."""
    closure = None if share is None else {"withheld": [36.0], "channels": {}, "share_closed": share, "interval": [0, 1]}
    record = {"schema": "winchcascade/diagnosis/1", "verdict": verdict, "causes": list(causes), "closure": closure}
    (folder / "diagnoses" / f"{case}.json").write_text(json.dumps(record))


Maker = Callable[[Case], dict[str, bytes]]


@contextmanager
def cases_by(maker: Maker) -> Iterator[None]:
    """Within this context the logs of a case are made by another function, which takes less time than solving the twin."""
    with pytest.MonkeyPatch.context() as changed:
        changed.setattr("winchcascade.blind.trial.make_campaign", maker)
        yield


def once(case: Case) -> dict[str, bytes]:
    """Logs of the twin, made once for each case."""
    return _made(msgspec.json.encode(case))


@cache
def _made(case: bytes) -> dict[str, bytes]:
    return make_campaign(msgspec.json.decode(case, type=Case))


def shipped(case: Case) -> dict[str, bytes]:
    """Logs of the shipped campaign, the same for each case."""
    logs = sorted((Path(__file__).parents[2] / "fixtures" / "campaign").glob("*.csv"))
    return {"campaign.toml": campaign_toml(case.name).encode(), **{log.name: log.read_bytes() for log in logs}}


def guess(campaign_toml: Path, *, suspects: Suspects, seed: int, predictions: Path | None) -> dict[str, Any]:
    """Diagnose without thought: the first suspect, and the log itself as the prediction; tells what it could see."""
    assert predictions is not None
    for when in ("before", "after"):
        (predictions / when).mkdir()
        (predictions / when / "r36ohm.csv").write_bytes((campaign_toml.parent / "r36ohm.csv").read_bytes())
    seen = sorted(str(p.relative_to(campaign_toml.parents[1])) for p in campaign_toml.parents[1].rglob("*.*"))
    return {
        "schema": "winchcascade/diagnosis/1",
        "verdict": "explained",
        "causes": [cause(min(suspects))],
        "closure": {"share_closed": 0.5, "interval": [0.4, 0.6], "withheld": [], "channels": {}},
        "seen": seen,
        "seed": seed,
    }


def fail_on_the_second(
    campaign_toml: Path, *, suspects: Suspects, seed: int, predictions: Path | None
) -> dict[str, Any]:
    """Diagnose no case but the first."""
    if campaign_toml.parent.name == "case-0002":
        raise ValueError("this one is too hard")
    return guess(campaign_toml, suspects=suspects, seed=seed, predictions=predictions)


def find_no_room(campaign_toml: Path, *, suspects: Suspects, seed: int, predictions: Path | None) -> dict[str, Any]:
    """Diagnose nothing, as on a full disk."""
    raise OSError(28, "No space left on device")
