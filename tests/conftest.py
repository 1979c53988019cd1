"""What the tests share: the shipped fixtures, and the data beside the project, which users do not have."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as commands set it: the matrices are small, and the workers many

settings.register_profile("steady", deadline=None, derandomize=True)  # a busy machine is no fault of the code
settings.load_profile("steady")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # begun in the background: tests of interrupts would wait forever
    signal.signal(signal.SIGINT, signal.default_int_handler)

ROOT = Path(__file__).parent.parent


@pytest.fixture(autouse=True)
def _own_signals() -> Iterator[None]:
    """A command that a test calls in this process ends it at a signal; the tests after it get their interrupts."""
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
