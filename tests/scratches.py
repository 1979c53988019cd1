"""Scratch as a process leaves it that was killed."""

import subprocess
import sys
from pathlib import Path

_MAKE = """
import os, sys
from pathlib import Path
from winchcascade.core.scratch import scratch_file
with scratch_file(Path(sys.argv[1])) as path:
    print(path.name)
    sys.stdout.flush()
    os.remove(path)
    os._exit(9)
"""


def left_scratch(folder: Path) -> Path:
    """Path of scratch in a folder whose owner has ended without removing it; the scratch itself is not made."""
    done = subprocess.run([sys.executable, "-c", _MAKE, str(folder)], capture_output=True, text=True, check=False)
    assert done.returncode == 9, done.stderr
    return folder / done.stdout.strip()
