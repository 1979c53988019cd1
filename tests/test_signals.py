"""A process that a signal ends: at once, with one sentence or none, and without its scratch."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(os.name == "nt", reason="ends processes as POSIX does")

BEGIN = """
import os, signal, sys, weakref
from pathlib import Path
from winchcascade.core.files import scratch_file, scratch_folder
from winchcascade.core.jobs import end_on_signals
end_on_signals({signal.SIGINT: "one sentence."})
here = Path(sys.argv[1])
def wait():
    print("ready", flush=True)
    while True:
        signal.pause()
"""


def ended(place: Path, script: str, by: signal.Signals) -> tuple[int, str, str]:
    """Exit code and what was printed of a script that is ended when it is ready."""
    with subprocess.Popen(  # unbuffered: what follows the first line is left to `communicate`
        [sys.executable, "-c", BEGIN + script, str(place)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, bufsize=0
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        process.send_signal(by)
        out, err = process.communicate()
    return process.returncode, out.decode(), err.decode()


@pytest.mark.parametrize(("by", "expected"), [(signal.SIGINT, "one sentence.\n"), (signal.SIGTERM, "")])
def test_a_process_ends_at_once_without_its_scratch(tmp_path: Path, by: signal.Signals, expected: str) -> None:
    script = "with scratch_file(here), scratch_folder(here) as made:\n    (made / 'part').touch()\n    wait()"
    assert ended(tmp_path, script, by) == (128 + by, "", expected)
    assert os.listdir(tmp_path) == []


def test_a_process_ends_even_within_the_callback_of_a_weak_reference(tmp_path: Path) -> None:
    script = (
        "class Thing: pass\nthing = Thing()\nseen = weakref.ref(thing, lambda _: os.kill(os.getpid(), signal.SIGINT))\n"
        "print('ready', flush=True)\ndel thing\nprint('still here', flush=True)"
    )
    assert ended(tmp_path, script, signal.SIGCONT) == (130, "", "one sentence.\n")


def test_a_signal_that_is_ignored_stays_ignored(tmp_path: Path) -> None:
    script = (
        "signal.signal(signal.SIGINT, signal.SIG_IGN)\nend_on_signals({})\nprint('ready', flush=True)\n"
        "os.kill(os.getpid(), signal.SIGINT)\nprint('still here', flush=True)"
    )
    assert ended(tmp_path, script, signal.SIGCONT) == (0, "still here\n", "")
