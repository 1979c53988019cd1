"""Print what a diagnosis costs, beside simulating its campaign once, and how many blind cases a minute are done.

python benchmarks/diagnose.py [--quick] [--cases 8] [--loads 7]

One effect: a case of a trial. Seven effects: the shipped campaign. Nothing else does this work, so a trial stands alone.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

from measure import CAMPAIGN, Row, Sizes, main, timed, winchcascade
from model import campaign_seconds

from winchcascade.blind.cases import plan_cases
from winchcascade.core.campaign_file import load_campaign

SEED = 1


def rows(sizes: Sizes) -> Iterator[Row]:
    """Measure dealing a trial, a diagnosis of one effect and of seven, then diagnosing the trial."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        trial, cases = place / "trial", ("--cases", str(sizes.cases), "--seed", str(SEED))
        yield _rate("blind deal", winchcascade("blind", "deal", *cases, "--out", trial), sizes.cases)
        for name, logs in (("one effect", trial / one_effect(sizes.cases)), ("seven effects", CAMPAIGN)):
            campaign = shortened(logs, place / name, sizes.loads)
            took = timed(winchcascade("diagnose", campaign, "--json", place / f"{name}.json")).seconds
            once, _ = campaign_seconds(campaign, 3)
            yield Row(f"diagnose {name}, {sizes.loads} loads", took, once, "s", "simulating these logs once")
        yield _rate("blind diagnose", winchcascade("blind", "diagnose", trial), sizes.cases)


def _rate(what: str, command: list[str], cases: int) -> Row:
    return Row(f"{what}, cases of 7 loads", 60 * cases / timed(command).seconds, None, "a minute", "-")


def one_effect(cases: int) -> str:
    """Name the case of the trial that hides a single effect, the strongest."""
    singles = [case for case in plan_cases(cases, SEED) if case.kind == "single"]
    return max(singles, key=lambda case: max(case.effects.values())).name


def shortened(campaign: Path, folder: Path, loads: int) -> Path:
    """List some logs of a campaign in a campaign.toml of their own, the lowest loads, which say most."""
    runs = load_campaign(campaign).runs[-loads:]
    listed = [f'[[run]]\nfile = "{run.file.resolve()}"\nload_ohm = {run.load}\n' for run in runs]
    folder.mkdir()
    (folder / "campaign.toml").write_text("\n".join(listed), encoding="utf-8")
    return folder


if __name__ == "__main__":
    main("Print what a diagnosis costs.", rows)
