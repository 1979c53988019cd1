"""The program that judges diagnoses by what an honest answer may be, and the campaigns that it is given."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

BENCHMARKS = Path(__file__).parent.parent.parent / "benchmarks"


def program(name: str, *arguments: str | Path) -> str:
    command = [sys.executable, str(BENCHMARKS / name), *map(str, arguments)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def case(folder: Path, number: int, truth: dict[str, Any], verdict: str, *causes: dict[str, Any]) -> None:
    """A campaign with its truth alone, and its diagnosis."""
    campaign = folder / "own" / "family" / f"{number:04d}"
    campaign.mkdir(parents=True)
    (campaign / "truth.json").write_text(json.dumps({"kind": "any", "what": "any", **truth}))
    (folder / f"family_{number:04d}.json").write_text(json.dumps({"verdict": verdict, "causes": causes}))


def cause(effect: str, *alike: str, probability: float = 0.99) -> dict[str, Any]:
    return {"effect": effect, "probability": probability, "look_alikes": [{"effect": name} for name in alike]}


WARM = {"may_be_certain": ["heating"], "named": [["heating"]]}


def counts(line: str) -> list[int]:
    """Numbers of a line: diagnosed, honest, certain and false, named, of how many."""
    return [int(word) for word in line.split() if word.isdigit()]


@pytest.mark.parametrize(
    ("truth", "verdict", "causes", "expected"),
    [
        (WARM, "explained", [cause("heating")], [1, 1, 0, 1, 1]),
        (WARM, "explained", [cause("ke_rolloff")], [1, 0, 1, 0, 1]),
        (WARM, "explained", [cause("ke_rolloff", "heating")], [1, 1, 0, 1, 1]),
        (WARM, "explained", [cause("ke_rolloff", probability=0.8)], [1, 1, 0, 0, 1]),
        (WARM, "unexplained", [cause("ke_rolloff")], [1, 1, 0, 0, 1]),
        (WARM | {"alone": True}, "explained", [cause("heating"), cause("precharge", "gas_loss")], [1, 1, 0, 0, 1]),
        ({"may_be_certain": [], "no_gap_is_false": True}, "no_gap", [], [1, 0, 0, 0, 0]),
        ({"may_be_certain": [], "excused_by": ["partly_explained"]}, "partly_explained", [cause("x")], [1, 1, 0, 0, 0]),
        ({"may_be_certain": [], "named": [["a", "b"]]}, "explained", [cause("a", "b")], [1, 1, 0, 1, 1]),
        ({"may_be_certain": [], "named": [["a", "b"]]}, "explained", [cause("a", "c")], [1, 1, 0, 0, 1]),
    ],
)
def test_an_answer_is_judged_by_its_certainty_and_its_declared_alternatives(
    tmp_path: Path, truth: dict[str, Any], verdict: str, causes: list[dict[str, Any]], expected: list[int]
) -> None:
    case(tmp_path, 1, truth, verdict, *causes)
    assert counts(program("trial_judge.py", tmp_path / "own", tmp_path).splitlines()[0]) == expected


def test_a_calibrated_rig_file_must_give_the_causes_of_the_plain_one(tmp_path: Path) -> None:
    plain = {"may_be_certain": ["heating", "other"]}
    case(tmp_path, 1, plain | {"same_as": "0002"}, "explained", cause("other"))
    case(tmp_path, 2, plain, "explained", cause("heating"))
    assert counts(program("trial_judge.py", tmp_path / "own", tmp_path).splitlines()[0])[:3] == [2, 1, 0]


@pytest.mark.slow
def test_campaigns_are_made_with_their_truths_and_without_a_diagnosis(tmp_path: Path) -> None:
    program("trials.py", "--family", "warming", "--first", "2", "--cases", "1", "--jobs", "1", "--make", tmp_path)
    folder = tmp_path / "warming" / "0002"
    truth = json.loads((folder / "truth.json").read_text())
    assert len(list(folder.glob("*.csv"))) == len(truth["order"]) == 7
    assert min(run["k_e"] for run in truth["runs"].values()) == pytest.approx(-truth["history"]["k_e_fall"])
    assert not (folder / "diagnosis.json").exists()
