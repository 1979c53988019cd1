"""Limits of memory and time for the process that reads one file, as far as each system can enforce them."""

from __future__ import annotations

import math
import os
import signal
import sys

import msgspec

from winchcascade.core.errors import OptionError

MEMORY_SETTING = "WINCHCASCADE_READ_MEMORY_MB"
SECONDS_SETTING = "WINCHCASCADE_READ_SECONDS"
"""Environment variables that replace the two limits."""

MB = 10**6

MIN_MEMORY, MEMORY_PER_BYTE = 2000 * MB, 20
"""Limit of memory: the larger of a fixed number of bytes and a number of bytes for each byte of the file.

An .xlsx of a million rows takes 13 times its size; no other format that was measured takes more. [bytes]
"""

MIN_SECONDS, SECONDS_PER_BYTE = 60.0, 4.0 / MB
"""Limit of time: the larger of the two. An .xlsx takes 0.33 s for each megabyte, on a busy machine ten times as long. [s]"""

NUMBERS_SHARE, NUMBERS_PER_BYTE = 16, 10
"""Limit of the columns that the process sends: a share of the memory, or a number of bytes for each byte of the file.

The reduction holds some ten copies of the columns. No measured signal that is worth a file is compressed further.
"""

_ADDRESSES = 4
"""Multiple of the memory that may be reserved: Arrow reserves what a damaged page claims and never touches it."""

_LONGEST_WORDS = 1 << 20
"""Most that the process may write to any file, its messages on standard error included. [bytes]"""


class Limits(msgspec.Struct, frozen=True):
    """What the reading of one file may take: resident memory [bytes], time [s], and columns sent [bytes]."""

    memory: int
    seconds: float
    numbers: int


def limits_for(size: int) -> Limits:
    """Set the limits for a file of this size in bytes; OptionError for a setting that is no positive number."""
    memory = _setting(MEMORY_SETTING, max(MIN_MEMORY, MEMORY_PER_BYTE * size) / MB) * MB
    return Limits(
        int(memory),
        _setting(SECONDS_SETTING, max(MIN_SECONDS, SECONDS_PER_BYTE * size)),
        int(max(memory / NUMBERS_SHARE, NUMBERS_PER_BYTE * size)),
    )


def _setting(name: str, usual: float) -> float:
    text = os.environ.get(name, "").strip()
    try:
        value = float(text) if text else usual
    except ValueError:
        value = math.nan
    if not 0.0 < value < 1e9:
        raise OptionError(f"{name}={text}: expected a number above 0, such as 4000; correct or unset the variable.")
    return value


def limit_this_process(memory: int, parent: int, *, unpacks: bool = False) -> None:
    """Apply what the system itself enforces: end with the parent, reserve and write no more than needed, leave no core file.

    Parameters
    ----------
    unpacks : the process unpacks a log into a file, which may be as large as its memory
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is for the parent, which then ends this process
    if sys.platform == "win32":
        import ctypes

        ctypes.windll.kernel32.SetErrorMode(0x8003)  # no dialogs about a crash
        return
    import resource

    caps = [(resource.RLIMIT_CORE, 0), (resource.RLIMIT_FSIZE, memory if unpacks else _LONGEST_WORDS)]
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(1, 9)  # PR_SET_PDEATHSIG: SIGKILL when the parent ends
        if os.getppid() != parent:
            sys.exit()
        caps.append((resource.RLIMIT_AS, _pages(os.getpid(), 0) + _ADDRESSES * memory))
    for which, maximum in caps:
        hard = resource.getrlimit(which)[1]
        resource.setrlimit(which, (maximum if hard == resource.RLIM_INFINITY else min(maximum, hard), hard))


def _pages(pid: int, place: int) -> int:
    """Read the addresses (0) or the resident memory (1) of a process of Linux. [bytes]"""
    with open(f"/proc/{pid}/statm", encoding="ascii") as file:
        return int(file.read().split()[place]) * os.sysconf("SC_PAGE_SIZE")


if sys.platform == "darwin":

    def resident(pid: int) -> int:
        """Memory that another process holds now, compressed pages included; 0 where it has ended. [bytes]"""
        import ctypes

        record = (
            ctypes.c_uint64 * 32
        )()  # rusage_info_v0: 16 bytes of identity, then numbers, ri_phys_footprint the eighth
        failed = ctypes.CDLL("/usr/lib/libproc.dylib").proc_pid_rusage(pid, 0, record)
        return 0 if failed else int(record[9])

else:

    def resident(pid: int) -> int:
        """Memory that another process holds now; 0 where it has ended, or where a job limits it. [bytes]"""
        try:
            return _pages(pid, 1)
        except (OSError, IndexError):
            return 0


if sys.platform == "win32":
    import ctypes
    from ctypes import wintypes

    class _Basic(ctypes.Structure):
        _fields_ = [
            ("process_time", ctypes.c_int64), ("job_time", ctypes.c_int64), ("flags", wintypes.DWORD),
            ("least_set", ctypes.c_size_t), ("most_set", ctypes.c_size_t), ("processes", wintypes.DWORD),
            ("affinity", ctypes.c_size_t), ("priority", wintypes.DWORD), ("scheduling", wintypes.DWORD),
        ]  # fmt: skip

    class _Extended(ctypes.Structure):
        _fields_ = [
            ("basic", _Basic), ("counters", ctypes.c_uint64 * 6), ("process_memory", ctypes.c_size_t),
            ("job_memory", ctypes.c_size_t), ("peak_process", ctypes.c_size_t), ("peak_job", ctypes.c_size_t),
        ]  # fmt: skip

    def job_for(handle: int, memory: int) -> int | None:
        """Put a process in a job that limits its memory and ends with this process; returns the handle to keep."""
        kernel = ctypes.WinDLL("kernel32")
        kernel.CreateJobObjectW.restype = wintypes.HANDLE
        job = kernel.CreateJobObjectW(None, None)
        wanted = _Extended()
        wanted.basic.flags = 0x100 | 0x400 | 0x2000  # memory of each process, no dialog at a crash, end with the handle
        wanted.process_memory = memory
        kernel.SetInformationJobObject(wintypes.HANDLE(job), 9, ctypes.byref(wanted), ctypes.sizeof(wanted))
        kernel.AssignProcessToJobObject(wintypes.HANDLE(job), wintypes.HANDLE(handle))
        return int(job)

    def close_job(job: int | None) -> None:
        """Close the handle of a job."""
        ctypes.WinDLL("kernel32").CloseHandle(wintypes.HANDLE(job))

else:

    def job_for(handle: int, memory: int) -> int | None:  # noqa: ARG001
        """Only Windows has jobs."""
        return None

    def close_job(job: int | None) -> None:
        """Only Windows has jobs."""
