"""The pages of the method state the numbers that the code uses."""

import re
import sys
from functools import cache
from typing import get_args

import numpy as np
import pytest
from calls import call
from pages import DOCS, ROOT, read, shown
from rigs import scale_of

from winchcascade import baseline, read_run, simulate
from winchcascade.blind.score import count
from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.channels import CHANNELS
from winchcascade.core.machine_parts import measures
from winchcascade.core.rig_file import PARTS
from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import FindingKind
from winchcascade.rig.effects.catalogue import EFFECTS
from winchcascade.rig.simulate import READ, Simulation
from winchcascade.rig.steps import COARSE, STEP


def text_of(page: str, part: str = "") -> str:
    """A page on one line, or the part below one of its headings."""
    text = read(DOCS / f"{page}.md")
    if part:
        text = re.split(r"^#+ ", text.split(f"# {part}", 1)[1], flags=re.MULTILINE)[0]
    return " ".join(text.split())


PERCENT = 100.0


def test_the_checks_of_the_method_are_kinds_of_findings() -> None:
    rows = re.findall(r"^\| (`[^|]*) \|", read(DOCS / "method.md"), re.MULTILINE)
    assert set(re.findall(r"`(\w+)`", " ".join(rows))) <= set(get_args(FindingKind))


def test_what_is_not_distinguished_are_effects_and_numbers_of_a_rig_file() -> None:
    numbers = {name for part in PARTS.values() for name in measures(part)}
    assert (
        set(re.findall(r"`(\w+)`", read(DOCS / "not_distinguished.md"))) <= numbers | EFFECTS.keys()
    )


OF_RESULTS = {"u", "z", "low", "high", "hs_m", "tp_s"}
"""Keys of a number of the rig file, of the map of a gap, of an interval and of a sea."""


def test_the_symbols_of_the_glossary_are_names_in_files() -> None:
    table = read(DOCS / "glossary.md").split("## Symbols")[1].split("\n## ")[0]
    named = re.findall(r"^\| [^|]+ \| ([^|]+) \|", table, re.MULTILINE)
    log = ROOT / "fixtures" / "campaign" / "r36ohm.csv"
    printed = call("reduce", log, "--json", "-").out
    numbers = {name for part in PARTS.values() for name in measures(part)} | CHANNELS.keys()
    for name in re.findall(r"`(\w+)`", " ".join(named)):
        assert name in numbers | OF_RESULTS or f'"{name}"' in printed, name


def test_the_allowance_of_an_audit_follows_from_the_printed_deviations() -> None:
    energy, eta, k = (
        0.185,
        0.0255,
        2.0 / 3.0,
    )  # the largest that round to 18 % and 2.5 %; three cycles
    percent = (f"{PERCENT * energy * eta * k:.2f} %", f"{PERCENT * eta**2 * k:.2f} %")
    assert " and ".join(percent) in text_of("uncertainty", "A published cell")


def test_the_intervals_of_the_trials_follow_from_their_counts() -> None:
    rows = re.findall(r"\| (\d+) of (\d+) \| (\d+) to (\d+) % \|", read(DOCS / "trials.md"))
    assert len(rows) > 5
    for row in rows:
        good, cases, low, high = map(int, row)
        ends = count([True] * good + [False] * (cases - good)).interval_95
        assert [round(PERCENT * end) for end in ends] == [low, high], row


def test_the_trials_have_as_many_campaigns_as_their_families(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    families = pytest.importorskip("families").FAMILIES
    sys.modules.pop("families")
    assert f"diagnoses {sum(family.cases for family in families.values())} campaigns" in text_of(
        "trials", "Families"
    )


# -------------------------------------------------------------------------------------- the model
@cache
def simulated(share: float) -> tuple[Simulation, ...]:
    """Simulations along the shipped logs, in steps of a share of their ramps."""
    model = baseline(built_in())
    runs = [
        read_run(run.file, load=run.load)
        for run in load_campaign(ROOT / "fixtures" / "campaign").runs
    ]
    return tuple(simulate(run, model, step=share * scale_of(run).ramp) for run in runs)


def largest_change(one: float, other: float) -> float:
    """Of any channel along any shipped log, as a share of its largest value."""
    return max(
        float(
            np.abs(a.run.channels[name] - b.run.channels[name]).max()
            / np.abs(a.run.channels[name]).max()
        )
        for a, b in zip(simulated(one), simulated(other), strict=True)
        for name in READ
    )


@pytest.mark.slow
def test_the_steps_of_the_model_are_as_exact_as_its_page_states() -> None:
    text = text_of("model", "Integration")
    ((half, balance, coarse),) = (
        map(float, numbers)
        for numbers in re.findall(r"more than (\S+) %.* within (\S+)\. .* most (\S+) %", text)
    )
    assert re.findall(r"1/(\d+) of the ramp", text) == [f"{1.0 / STEP:g}", f"{1.0 / COARSE:g}"]
    assert PERCENT * largest_change(STEP, 0.5 * STEP) < half
    assert PERCENT * largest_change(STEP, COARSE) < coarse
    for done in simulated(STEP):
        joule = {name: entry[-1] for name, entry in done.energy.items()}
        assert sum(joule.values()) - joule["line"] == pytest.approx(joule["line"], rel=balance)


def test_the_efficiencies_of_the_screw_are_those_of_the_paper() -> None:
    gas, text = baseline(built_in()).restoring, text_of("model", "Restoring module")
    assert f"= {gas.eta_forward:.3f}`" in text
    assert f"= {gas.eta_reverse:.3f}`" in text


# ------------------------------------------------------------------------------- adding an effect
LABELLED = r"^\+\[\w+\.(\w+)\](?:\n\+.*)*?\n\+label = \"(.+)\""
"""Name and label of an effect that a page adds to the catalogue, over several lines."""


def test_the_added_effects_are_found_with_the_numbers_that_were_simulated() -> None:
    page = DOCS / "adding_an_effect.md"
    given = {
        name: float(value) for name, value in re.findall(r"--with (\w+)\.\w+=(\S+)", read(page))
    }
    shown_by = re.findall(
        r"^\+\[\w+\.(\w+)\](?:\n\+.*)*factor = ([\d.e]+)", read(page), re.MULTILINE
    )
    given |= {name: float(factor) * given[name] for name, factor in shown_by}
    (printed,) = shown(page).values()
    rows = re.findall(r"^(\w[\w ]*?)  +[+-]\S+ .*?(\S+) to (\S+) ", printed, re.MULTILINE)
    labels = {label: name for name, label in re.findall(LABELLED, read(page), re.MULTILINE)}
    found = {labels[label]: (float(low), float(high)) for label, low, high in rows}
    assert found.keys() == given.keys()
    assert all(low <= given[name] <= high for name, (low, high) in found.items())
