"""Injected faults are found as they were recorded, and logs without a fault have no more false
findings.
"""

import contradictions  # noqa: F401  registers its faults
import injected_files  # noqa: F401  registers its faults
import pytest
import whole_channels  # noqa: F401  registers its faults
from clean import SHARED, SOURCES, false_findings
from gate import is_worse, recorded
from injected import FAULTS
from verdicts import letters

FAULTS_BEFORE, CLEAN_BEFORE = recorded()

FAST = 1
"""Trials of each fault in the normal test run."""

FAST_SOURCES = ("campaign",)


@pytest.mark.parametrize("name", list(FAULTS))
def test_the_first_trials_of_a_fault_are_found_as_recorded(name: str) -> None:
    assert not is_worse(found := letters(name, range(FAST)), before := FAULTS_BEFORE[name]), (
        found,
        before,
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", list(FAULTS))
def test_all_trials_of_a_fault_are_found_as_recorded(name: str) -> None:
    found, before = letters(name, range(FAULTS[name][1])), FAULTS_BEFORE[name]
    assert not is_worse(found, before), (
        f"found {found}, recorded {before}; python tests/faults/gate.py --worse --only '{name}'"
    )


@pytest.mark.parametrize(
    "source",
    [pytest.param(s, marks=() if s in FAST_SOURCES else pytest.mark.slow) for s in SOURCES],
)
def test_logs_without_a_fault_have_no_more_false_findings(source: str) -> None:
    if source in ("labelled", "harder", "own_simulation") and not SHARED.is_dir():
        pytest.skip("needs ../shared/data")
    logs, words = false_findings(source)
    assert logs > 0
    assert len(words) <= CLEAN_BEFORE[source], words
