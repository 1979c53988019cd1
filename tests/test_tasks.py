"""Jobs on processes: every job has one outcome, whatever the others do; a signal ends a process
without its scratch.
"""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from winchcascade.core.errors import LogError
from winchcascade.core.jobs import Workers, linear_algebra_on_one_thread
from winchcascade.core.outcome import Outcome

POSIX = pytest.mark.skipif(os.name == "nt", reason="ends processes as POSIX does")


class Task(NamedTuple):
    """What a job is to do: `good`, `fault`, `error`, `missing`, `kill`, `once` or `wait`."""

    does: str
    value: int = 0
    folder: Path = Path()


def work(task: Task) -> int:
    match task.does:
        case "fault":
            raise LogError("log.csv: no time column.")
        case "error":
            raise ValueError("no such thing")
        case "missing":
            (task.folder / "missing.csv").read_bytes()
        case "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        case "once":
            try:
                (task.folder / "begun").touch(exist_ok=False)
            except FileExistsError:
                return 2 * task.value
            os._exit(3)
        case "wait":
            (task.folder / "pid.part").write_text(str(os.getpid()))
            (task.folder / "pid.part").replace(task.folder / "pid")
            while not (task.folder / "go").exists():
                pass
            os._exit(3)
    return 2 * task.value


def by_place(outcomes: Iterator[Outcome[int]], jobs: int) -> list[Outcome[int]]:
    found = sorted(outcomes, key=lambda outcome: outcome.place)
    assert [outcome.place for outcome in found] == list(range(jobs))
    return found


@pytest.mark.parametrize(("jobs", "workers"), [(0, 1), (0, 2), (1, 2), (2, 1), (100, 3)])
def test_every_job_has_exactly_one_outcome(jobs: int, workers: int) -> None:
    found = by_place(Workers(workers).outcomes(work, [Task("good", k) for k in range(jobs)]), jobs)
    assert [outcome.value for outcome in found] == [2 * k for k in range(jobs)]
    assert all(outcome.fault is None for outcome in found)


@pytest.mark.parametrize("workers", [1, 2])
def test_a_job_that_fails_is_a_sentence_and_the_others_complete(
    tmp_path: Path, workers: int
) -> None:
    tasks = [
        Task(does, k, tmp_path)
        for k, does in enumerate(["good", "fault", "error", "missing", "good"])
    ]
    found = by_place(Workers(workers).outcomes(work, tasks), 5)
    assert [outcome.value for outcome in found] == [0, None, None, None, 8]
    assert [outcome.rejected for outcome in found] == [False, True, False, False, False]
    for outcome, word in zip(found[1:4], ("log.csv", "ValueError", "missing.csv"), strict=True):
        assert word in (outcome.fault or "")


@POSIX
def test_a_job_that_ends_its_process_is_a_sentence_and_the_others_complete() -> None:
    found = by_place(
        Workers(2).outcomes(work, [Task("kill" if k == 2 else "good", k) for k in range(6)]), 6
    )
    assert [outcome.value for outcome in found] == [0, 2, None, 6, 8, 10]
    assert "memory" in (found[2].fault or "")


def test_a_job_whose_process_died_once_is_tried_again(tmp_path: Path) -> None:
    tasks = [Task("once" if k == 3 else "good", k, tmp_path) for k in range(6)]
    found = by_place(Workers(2).outcomes(work, tasks), 6)
    assert [outcome.value for outcome in found] == [2 * k for k in range(6)]


def test_a_script_without_a_guard_is_told_what_to_do(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "import os\nfrom winchcascade.core.errors import OptionError\nfrom winchcascade.core.jobs "
        "import Workers\n"
        "try:\n    print(len(list(Workers(2).outcomes(os.path.basename, ['a'] * 4))), "
        "'outcomes')\n"
        "except OptionError as fault:\n    print(fault)\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    assert "no further process can be started; work with one (jobs=1, or --jobs 1)." in done.stdout
    guarded = (
        script.read_text()
        .replace("try:", "if __name__ == '__main__':\n  try:")
        .replace("\nexcept", "\n  except")
    )
    script.write_text(guarded)
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("4 outcomes\n", "")


@POSIX
def test_no_job_is_lost_if_a_process_dies_while_an_outcome_is_being_used(tmp_path: Path) -> None:
    tasks = [Task("wait" if k == 1 else "good", k, tmp_path) for k in range(8)]
    outcomes = Workers(2).outcomes(work, tasks)
    first = next(outcomes)
    while not (tmp_path / "pid").exists():
        pass
    (tmp_path / "go").touch()
    wait_for_the_end_of(int((tmp_path / "pid").read_text()))
    rest = sorted(outcome.place for outcome in outcomes)
    assert sorted([first.place, *rest]) == list(range(8))


def wait_for_the_end_of(process: int) -> None:
    while True:
        try:
            os.kill(process, 0)
        except ProcessLookupError:
            return


def test_linear_algebra_has_one_thread_within_a_diagnosis_and_as_many_as_before_after_it() -> None:
    def threads() -> set[int]:
        return {
            library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"
        }

    np.linalg.inv(np.eye(2))  # loads the library
    with threadpool_limits(2, user_api="blas"):
        with linear_algebra_on_one_thread():
            assert threads() == {1}
        assert threads() == {2}


BEGIN = """
import os, signal, sys, weakref
from pathlib import Path
from winchcascade.core.files import scratch_file, scratch_folder
from winchcascade.core.process_end import end_on_signals
end_on_signals({signal.SIGINT: "one sentence"})
here = Path(sys.argv[1])
def wait():
    print("ready", flush=True)
    while True:
        signal.pause()
"""


def ended(place: Path, script: str, by: signal.Signals) -> tuple[int, str, str]:
    """Exit code and what was printed of a script that is ended when it is ready."""
    with subprocess.Popen(  # unbuffered: what follows the first line is left to `communicate`
        [sys.executable, "-c", BEGIN + script, str(place)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        bufsize=0,
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        process.send_signal(by)
        out, err = process.communicate()
    return process.returncode, out.decode(), err.decode()


@POSIX
@pytest.mark.parametrize(
    ("by", "expected"),
    [(signal.SIGINT, "one sentence; no file was left half-written.\n"), (signal.SIGTERM, "")],
)
def test_a_process_ends_at_once_without_its_scratch(
    tmp_path: Path, by: signal.Signals, expected: str
) -> None:
    script = "with scratch_file(here), scratch_folder(here) as made:\n    (made / 'part').touch()\n    wait()"
    assert ended(tmp_path, script, by) == (128 + by, "", expected)
    assert os.listdir(tmp_path) == []


@POSIX
def test_a_process_ends_even_within_the_callback_of_a_weak_reference(tmp_path: Path) -> None:
    script = (
        "class Thing: pass\nthing = Thing()\nseen = weakref.ref(thing, lambda _: "
        "os.kill(os.getpid(), signal.SIGINT))\n"
        "print('ready', flush=True)\ndel thing\nprint('still here', flush=True)"
    )
    assert ended(tmp_path, script, signal.SIGCONT) == (
        130,
        "",
        "one sentence; no file was left half-written.\n",
    )


@POSIX
def test_a_signal_that_is_ignored_stays_ignored(tmp_path: Path) -> None:
    script = (
        "signal.signal(signal.SIGINT, signal.SIG_IGN)\nend_on_signals({})\nprint('ready', "
        "flush=True)\n"
        "os.kill(os.getpid(), signal.SIGINT)\nprint('still here', flush=True)"
    )
    assert ended(tmp_path, script, signal.SIGCONT) == (0, "still here\n", "")
