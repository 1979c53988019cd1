"""Trials for the tests: answers sealed by hand, and diagnoses that never looked at a log."""

import json
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from winchcascade.blind.cases import DealtCase, campaign_toml
from winchcascade.blind.injected import PARTS
from winchcascade.blind.trial import DIAGNOSES, SEALED, TRIAL, Answer, SealedAnswers, seal
from winchcascade.core.files import json_bytes

FIXTURES = Path(__file__).parents[2] / "fixtures" / "campaign"


def answer(case: str, *effects: str, strength: float = 1.0, outsider: str | None = None) -> Answer:
    """An answer without a rig; true parameters are 0.5."""
    kind = "outsider" if outsider else ("none", "single", "pair")[len(effects)]
    parameters = {name: {PARTS[name].parameter: 0.5} for name in effects}
    return Answer(case, kind, dict.fromkeys(effects, strength), outsider, parameters)


def sealed_trial(folder: Path, *answers: Answer) -> Path:
    """A folder with sealed answers and no logs."""
    content, trial = seal(SealedAnswers(0, answers))
    (folder / DIAGNOSES).mkdir(parents=True)
    (folder / SEALED).write_bytes(content)
    (folder / TRIAL).write_bytes(json_bytes(trial))
    return folder


def cause(
    effect: str, *rivals: str, value: float = 0.5, half: float = 0.1, **further: Any
) -> dict[str, Any]:
    """A cause as a diagnosis writes it, with an interval of a half-width about its value."""
    said = {"value": value, "low": value - half, "high": value + half, "unit": "1"}
    parameters = {PARTS[effect].parameter: said} if effect in PARTS else {}
    others = [{"effect": rival, "probability": 0.1} for rival in rivals]
    return {
        "effect": effect,
        "probability": 0.99,
        "parameters": parameters,
        "rivals": others,
        **further,
    }


def say(
    folder: Path, case: str, verdict: str, *causes: dict[str, Any], share: float | None = None
) -> None:
    """Write a case's diagnosis."""
    closure = None if share is None else {"share_closed": share}
    record = {
        "schema": "winchcascade/diagnosis/1",
        "verdict": verdict,
        "causes": list(causes),
        "closure": closure,
    }
    (folder / DIAGNOSES).mkdir(exist_ok=True)
    (folder / DIAGNOSES / f"{case}.json").write_text(json.dumps(record))


@contextmanager
def cases_by(maker: Callable[[DealtCase, Path], None]) -> Iterator[None]:
    """Within this context the campaign of a case is written by another function, which takes
    less time than the twin.
    """
    with pytest.MonkeyPatch.context() as changed:
        changed.setattr("winchcascade.blind.trial.write_campaign", maker)
        yield


def shipped(case: DealtCase, folder: Path) -> None:
    """Write the logs of the shipped campaign, the same for each case."""
    for file in (*FIXTURES.glob("*.csv"), FIXTURES / "rig.toml"):
        shutil.copyfile(file, folder / file.name)
    (folder / "campaign.toml").write_text(campaign_toml(case.name))


def guess(campaign_toml: Path) -> Mapping[str, object]:
    """Diagnose without thought, and report what could be seen."""
    place = campaign_toml.parents[1]
    seen = sorted(str(path.relative_to(place)) for path in place.rglob("*") if path.is_file())
    causes = [cause("ke_shift")]
    return {
        "schema": "winchcascade/diagnosis/1",
        "verdict": "explained",
        "causes": causes,
        "seen": seen,
    }


def fail_on_the_second(campaign_toml: Path) -> Mapping[str, object]:
    """Diagnose no case but the first."""
    if campaign_toml.parent.name == "case-0002":
        raise ValueError("this one is too hard")
    return guess(campaign_toml)


def find_no_room(campaign_toml: Path) -> Mapping[str, object]:
    """Diagnose nothing, as on a full disk."""
    raise OSError(28, "No space left on device", str(campaign_toml))
