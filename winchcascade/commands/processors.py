"""How much of the computer a command uses."""

from __future__ import annotations

import os


def one_thread_each() -> None:
    """Keep linear algebra on one thread, before it is imported: its matrices are small, and threads make each solve slower."""
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")


def use_threads(jobs: int | None) -> None:
    """Let a diagnosis work on so many threads, one for each processor by default."""
    from winchcascade.fit import campaign
    from winchcascade.tasks import processes

    campaign.THREADS = jobs or processes()
