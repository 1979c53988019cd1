"""Print how a batch scales, each ratio measured in this one run: processes, a second call, a Dask cluster on this machine.

python benchmarks/batch.py [--logs 1000]
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from run import ROOT, timed, winchcascade


@contextmanager
def cluster(workers: int) -> Iterator[str]:
    """A Dask scheduler and some workers of one thread each on this machine; gives the scheduler's address."""
    dask = [sys.executable, "-m", "dask"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with tempfile.TemporaryDirectory() as folder:
        scheduler_file = Path(folder) / "scheduler.json"
        options = ["--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", str(scheduler_file)]
        running = [subprocess.Popen([*dask, "scheduler", "--port", "0", *options], cwd=folder, **quiet)]  # type: ignore[call-overload]
        try:
            while not scheduler_file.exists() or not scheduler_file.read_text():
                time.sleep(0.1)
            found = re.search(r"tcp://[0-9.:]+", scheduler_file.read_text())
            assert found is not None
            worker = [*dask, "worker", found[0], "--nthreads", "1", "--host", "127.0.0.1", "--no-dashboard"]
            running += [subprocess.Popen(worker, cwd=folder, **quiet) for _ in range(workers)]  # type: ignore[call-overload]
            _wait_for(found[0], workers)
            yield found[0]
        finally:
            for process in reversed(running):
                process.terminate()
            for process in running:
                process.wait()


def _wait_for(address: str, workers: int) -> None:
    from distributed import Client

    with Client(address, set_as_default=False) as client:  # type: ignore[no-untyped-call]
        client.wait_for_workers(workers, timeout=60)
        client.run(_warm)


def _warm() -> None:
    """Import what the work needs, as in a cluster that has been up for a while."""
    import winchcascade.batch.work  # noqa: F401


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--logs", type=int, default=1000)
    logs = parser.parse_args().logs
    subprocess.run([sys.executable, "-m", "compileall", "-q", str(ROOT / "winchcascade")], check=True)
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        maker = [sys.executable, str(ROOT / "benchmarks" / "make_campaign.py")]
        for name, count in (("campaign", logs), ("tenth", logs // 10)):
            subprocess.run([*maker, str(place / name), "--logs", str(count)], check=True)

        def batch(campaign: str, out: str, *options: str) -> tuple[float, float]:
            return timed(winchcascade("batch", place / campaign, "--out", place / out, "--reports", "none", *options))

        start = timed(winchcascade("batch", "--help"))[0]
        one, memory = batch("campaign", "one", "--jobs", "1")
        _, memory_tenth = batch("tenth", "tenth-out", "--jobs", "1")
        two, _ = batch("campaign", "two", "--jobs", "2")
        again, _ = batch("campaign", "two", "--jobs", "2")
        with cluster(2) as address:
            dask, _ = batch("campaign", "dask", "--scheduler", address)
        rows = [
            (f"{logs} logs, one process", one, "", ""),
            ("two processes", two, f"{one / two:.2f} times as fast", "at least 1.7"),
            (
                "second call, beyond start-up",
                again - start,
                f"{1e3 * (again - start) / logs:.2f} ms a log",
                "at most 1",
            ),
            ("Dask, two workers", dask, f"{dask / two:.2f} times the two processes", "at most 1.6"),
        ]
        for name, seconds, ratio, goal in rows:
            print(f"{name:<30} {seconds:7.2f} s   {ratio:<30} {goal}")
        print(f"memory of {logs} and of {logs // 10} logs: {memory:.0f} and {memory_tenth:.0f} MB")


if __name__ == "__main__":
    main()
