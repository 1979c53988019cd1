"""A command in a process of its own, and the time and memory that it took."""

import json
import subprocess
import sys
from typing import NamedTuple

PATIENCE = 300.0
"""A process that has not ended after this never will. [s]"""

_STARTER = """
import json, resource, subprocess, sys
done = subprocess.run(sys.argv[2:], capture_output=True, text=True, timeout=float(sys.argv[1]))
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps([done.returncode, done.stdout, done.stderr, used.ru_utime + used.ru_stime, used.ru_maxrss / 1e3]))
"""
"""Starts the command from a small process: a process begins with the peak of memory of the one
that starts it.
"""


class Ended(NamedTuple):
    """Exit code and output of a process, its processor time [s], and the most memory that it or
    its children held. [MB]
    """

    code: int
    out: str
    err: str
    seconds: float
    memory: float


def run_alone(*arguments: str, patience: float = PATIENCE) -> Ended:
    """Run Python with some arguments to its end, at most so long. [s]"""
    command = [sys.executable, "-c", _STARTER, str(patience), sys.executable, *arguments]
    return Ended(
        *json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    )
