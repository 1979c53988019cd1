"""A real Dask cluster on the loopback: the same bytes as here, also if a worker is killed."""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import pytest
from calls import without_progress
from test_cli import one_sentence
from test_cli import started as winchcascade

CAMPAIGN = Path(__file__).parents[2] / "fixtures" / "campaign"
COPIES = 24
"""Logs of a call in which a worker is killed: enough that it has some to do still."""

WAIT = """
import sys
from distributed import Client
with Client(sys.argv[1], timeout=60) as client:
    client.wait_for_workers(2, timeout=60)
"""

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.name == "nt", reason="ends processes as POSIX does"),
]


class Cluster(NamedTuple):
    address: str
    workers: list[subprocess.Popen[bytes]]


@contextmanager
def process(*arguments: str, cwd: Path) -> Iterator[subprocess.Popen[bytes]]:
    """A process of Dask that ends with the context."""
    with (cwd / "log").open("ab") as log:
        call = subprocess.Popen([sys.executable, "-m", *arguments], cwd=cwd, stdout=log, stderr=log)
        try:
            yield call
        finally:
            call.kill()
            call.wait()


@contextmanager
def running(place: Path) -> Iterator[Cluster]:
    """A scheduler and two workers of one process each."""
    place.mkdir()
    file = place / "scheduler.json"
    with ExitStack() as stack:
        scheduler = (
            "--port",
            "0",
            "--no-dashboard",
            "--host",
            "127.0.0.1",
            "--scheduler-file",
            str(file),
        )
        call = stack.enter_context(process("distributed.cli.dask_scheduler", *scheduler, cwd=place))
        while not file.is_file() or not file.read_bytes():
            with suppress(subprocess.TimeoutExpired):
                pytest.fail(f"the scheduler ended with code {call.wait(0.01)}")
        address = json.loads(file.read_bytes())["address"]
        worker = ("--no-nanny", "--no-dashboard", "--nthreads", "1", "--host", "127.0.0.1")
        workers = [
            stack.enter_context(process("distributed.cli.dask_worker", address, *worker, cwd=place))
            for _ in range(2)
        ]
        subprocess.run([sys.executable, "-c", WAIT, address], check=True, capture_output=True)
        yield Cluster(address, workers)


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with running(tmp_path_factory.mktemp("cluster") / "place") as made:
        yield made


def contents(out: Path) -> dict[str, bytes]:
    return {
        path.relative_to(out).as_posix(): path.read_bytes()
        for path in out.rglob("*")
        if path.is_file()
    }


def test_a_cluster_gives_the_same_bytes_as_this_machine(cluster: Cluster, tmp_path: Path) -> None:
    folder = tmp_path / "logs"
    shutil.copytree(CAMPAIGN, folder)
    (folder / "campaign.toml").rename(tmp_path / "campaign.toml")
    for out, options in (("here", ["--jobs", "2"]), ("there", ["--scheduler", cluster.address])):
        done = winchcascade("batch", folder, "--out", tmp_path / out, "--reports", "none", *options)
        assert (done.returncode, without_progress(done.stderr)) == (0, "")
        assert "7 of 7 logs reduced" in done.stdout
    assert contents(tmp_path / "there") == contents(tmp_path / "here")


def test_reports_of_a_cluster_are_whole(cluster: Cluster, tmp_path: Path) -> None:
    logs = [CAMPAIGN / name for name in ("r9ohm.csv", "r36ohm.csv")]
    done = winchcascade(
        "batch",
        *logs,
        "--out",
        tmp_path / "out",
        "--reports",
        "all",
        "--scheduler",
        cluster.address,
        cwd=tmp_path,
    )
    assert (done.returncode, without_progress(done.stderr)) == (0, "")
    assert sorted(path.name for path in (tmp_path / "out" / "runs").iterdir()) == sorted(
        f"{log.name}.{ending}" for log in logs for ending in ("html", "json", "pdf")
    )
    again = winchcascade(
        "batch", *logs, "--out", tmp_path / "out", "--reports", "all", cwd=tmp_path
    )
    assert "2 of 2 logs reduced by an earlier call" in again.stdout


def test_a_log_that_fails_on_a_cluster_is_listed(cluster: Cluster, tmp_path: Path) -> None:
    bad = CAMPAIGN.parent / "damaged_logs" / "header_only.csv"
    arguments = (CAMPAIGN / "r9ohm.csv", bad, "--out", tmp_path / "out", "--reports", "none")
    done = winchcascade("batch", *arguments, "--scheduler", cluster.address)
    assert done.returncode == 1
    assert "header_only.csv: column names but no rows" in " ".join(done.stdout.split())


def test_a_killed_worker_costs_nothing_but_time(tmp_path: Path) -> None:
    (tmp_path / "logs").mkdir()
    for k in range(COPIES):
        shutil.copy(CAMPAIGN / "r36ohm.csv", tmp_path / "logs" / f"{k}.csv")
    arguments = ("batch", str(tmp_path / "logs"), "--reports", "none")
    here, there = tmp_path / "here", tmp_path / "there"
    assert winchcascade(*arguments, "--out", here).returncode == 0
    with running(tmp_path / "cluster") as cluster:
        command = [
            sys.executable,
            "-m",
            "winchcascade",
            *arguments,
            "--out",
            str(there),
            "--scheduler",
            cluster.address,
        ]
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as call:
            while call.poll() is None and not list(there.glob("runs/*.json")):
                with suppress(subprocess.TimeoutExpired):
                    call.wait(0.001)
            cluster.workers[0].send_signal(signal.SIGKILL)
            cluster.workers[0].wait()
            said, _ = call.communicate()
    assert call.returncode == 0
    assert f"{COPIES} of {COPIES} logs reduced" in said
    assert contents(there) == contents(here)


def test_a_scheduler_that_cannot_be_reached_is_reported(tmp_path: Path) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    arguments = ("--out", tmp_path / "out", "--scheduler", f"tcp://127.0.0.1:{port}")
    text = one_sentence("batch", CAMPAIGN, *arguments)
    assert "cannot be reached" in text
    assert "expected that of a running scheduler" in text


@pytest.mark.parametrize("address", ["nonsense", "nosuch://127.0.0.1:1"])
def test_an_address_that_is_none_of_a_scheduler_is_reported(tmp_path: Path, address: str) -> None:
    assert "is no address; expected that of a running scheduler" in one_sentence(
        "batch", CAMPAIGN, "--out", tmp_path / "out", "--scheduler", address
    )
