"""Fixtures of all tests: the shipped logs, and the data beside the project, which users do not
have.
"""

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

os.environ.setdefault(
    "OPENBLAS_NUM_THREADS", "1"
)  # as commands set it: the matrices are small, and the workers many
os.environ.pop(
    "COLUMNS", None
)  # set in the workers: commands would lay out for a terminal of that width

settings.register_profile(
    "fast", deadline=None, derandomize=True, max_examples=50
)  # a busy machine is no fault
settings.register_profile(
    "thorough", settings.get_profile("fast"), max_examples=200
)  # of make test-all
settings.load_profile("fast")

if (
    signal.getsignal(signal.SIGINT) is signal.SIG_IGN
):  # begun in the background: tests of interrupts would wait forever
    signal.signal(signal.SIGINT, signal.default_int_handler)

pytest_plugins = ("designed",)

ROOT = Path(__file__).parent.parent

TOGETHER = {
    f"tests/{name}.py": group
    for group, names in {
        "diagnoses": (
            "report/test_laws",
            "report/test_diagnosis_words",
            "report/test_diagnosis_content",
            "report/test_diagnosis_figures",
            "report/test_stability_report",
            "report/test_views",
            "report/test_one_name",
            "diagnosis/test_alarms",
            "diagnosis/test_beside_model",
            "diagnosis/test_figure_data",
            "diagnosis/test_judgement",
            "diagnosis/test_phase_energies",
            "diagnosis/test_validation",
            "design/test_design",
            "design/test_plan_of_runs",
            "design/test_posterior",
        ),
        "twin": (
            "blind/test_benchmark_trials",
            "blind/test_machine",
            "blind/test_trial",
            "blind/test_twin",
        ),
    }.items()
    for name in names
}
"""Files that use results of one another, or that compile the twin: one worker takes them all, and
makes each result once.
"""

ALONE = {
    f"tests/{name}.py"
    for name in (
        "test_reference",
        "test_pages",
        "comparison/test_coverage",
        "diagnosis/test_calibrated_rig",
    )
}
"""Files of long tests that share nothing: each test may be done by another worker."""

FIRST = tuple(
    f"tests/{name}"
    for name in (
        "design/test_design.py",
        "diagnosis/test_trust.py",
        "test_pictures.py",
        "test_determinism.py",
        "test_reference.py",
        "diagnosis/test_calibrated_rig.py",
        "diagnosis/test_diagnosis.py",
        "test_pages.py",
        "comparison/test_coverage.py",
        "faults",
        "hardening",
        "report",
        "batch",
        "diagnosis",
        "blind",
    )
)
"""Files with long tests, the longest of all first and the group of the first one before them:
begun first, so that no worker has one left when the others are done.
"""


def place_in_order(item: pytest.Item) -> int:
    return next(
        (place for place, start in enumerate(FIRST) if item.nodeid.startswith(start)), len(FIRST)
    )


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=place_in_order)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Give a worker a whole file, a whole group of `TOGETHER` or one test of `ALONE`, in the
    order of collection.
    """
    from xdist.scheduler import LoadFileScheduling

    config.option.loadscopereorder = False
    scheduler = LoadFileScheduling(config, log)
    file_of = scheduler._split_scope

    def unit(nodeid: str) -> str:
        file: str = file_of(nodeid)
        return nodeid if file in ALONE else TOGETHER.get(file, file)

    scheduler._split_scope = unit
    return scheduler


@pytest.fixture(autouse=True)
def _own_signals() -> Iterator[None]:
    """Restore the handlers of signals, which a command that a test calls in this process
    replaces.
    """
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture
def fixtures() -> Path:
    return ROOT / "fixtures"


@pytest.fixture
def shared() -> Path:
    """Data beside the project; a test that needs it is skipped where it is absent."""
    folder = ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("needs ../shared/data, which only the project's own machines have")
    return folder
