"""Print what a batch costs and how it scales: processes, a second call, a Dask cluster on this machine.

python benchmarks/batch.py [--quick] [--logs 1000]

No reports are drawn. The script with pandas finds means alone: no uncertainty, nothing that is kept.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from measure import Row, Sizes, Used, main, script, timed, winchcascade

WARM = "import winchcascade.batch.run_batch"
"""What the workers of a cluster that has been up for a while have imported."""


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
        client.run(exec, WARM)


def rows(sizes: Sizes) -> Iterator[Row]:
    """Measure one campaign of many short logs in every way, and a tenth of it."""
    with tempfile.TemporaryDirectory() as folder:
        place, logs = Path(folder), sizes.logs
        for name, count in (("campaign", logs), ("tenth", logs // 10)):
            subprocess.run(script("make_campaign.py", place / name, "--logs", str(count)), check=True)

        def batch(campaign: str, out: str, *options: str) -> Used:
            return timed(winchcascade("batch", place / campaign, "--out", place / out, "--reports", "none", *options))

        def pandas(jobs: int) -> float:
            table = ("--out", place / "table.csv", "--jobs", str(jobs))
            return timed(script("with_pandas.py", place / "campaign", *table)).seconds

        one, plain = batch("campaign", "one", "--jobs", "1"), pandas(1)
        yield Row(f"{logs} logs, one process", one.seconds, plain, "s", "pandas, one process")
        two, plain_two = batch("campaign", "two", "--jobs", "2"), pandas(2)
        yield Row(f"{logs} logs, two processes", two.seconds, plain_two, "s", "pandas, two processes")
        yield Row(f"{logs} logs, two processes", two.seconds, one.seconds, "s", "ours, one process")
        with cluster(2) as address:
            dask = batch("campaign", "dask", "--scheduler", address)
        yield Row(f"{logs} logs, Dask with two workers", dask.seconds, two.seconds, "s", "ours, two processes")
        again = batch("campaign", "two", "--jobs", "2")
        yield Row("second call of the batch", again.seconds, plain_two, "s", "pandas, two processes, once more")
        beyond = again.seconds - timed(winchcascade("batch", "--help")).seconds
        yield Row("second call, beyond start-up", 1e3 * beyond / logs, None, "ms a log", "-")
        tenth = batch("tenth", "tenth-out", "--jobs", "1")
        yield Row(f"memory of {logs} logs", one.memory, tenth.memory, "MB", f"ours, {logs // 10} logs")


if __name__ == "__main__":
    main("Print what a batch costs and how it scales.", rows)
