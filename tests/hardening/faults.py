"""Calls that are ended, that find the disk full, or that share a folder: nothing finished is lost, nothing half is read.

`python tests/hardening/faults.py --kills 100` prints counts and returns 1 on a fault; `--only "blind deal"` disturbs that
command alone, by signals alone with `--signals`. After each disturbance every result that is there can be read, and a second
call completes, keeps what was finished, leaves what an undisturbed call leaves, and leaves no scratch. SIGINT and SIGTERM are
answered by one sentence or by none. An interrupt in the first hundredths of a second, while Python itself starts and nothing of
this program is loaded, is Python's to answer; such tries are counted apart.
"""

import argparse
import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from pyarrow import parquet
from seeds import ROOT, text

from winchcascade.blind.trial import DiagnosisMethod, diagnose
from winchcascade.diagnosis.suspects import Suspects
from winchcascade.rig.effects.catalogue import EFFECTS

COPIES = 6
"""Logs of a batch: enough that some are done and some are not when it is disturbed."""

PATIENCE = 300.0
"""A call that has not ended after this never will. [s]"""

OWN = [sys.executable, "-m", "winchcascade"]
GUESS = [sys.executable, __file__, "--guess"]
"""The diagnosis of a trial by one who only looks at the logs: what is kept and how is the same, and it takes no minutes."""


class Kind(NamedTuple):
    """A command to disturb: its name, its words, what stands in its folder before, and its folder of results."""

    name: str
    command: Sequence[str]
    prepare: Callable[[Path], None]
    out: str
    finished: str
    """Pattern of the files that tell that a part is done."""
    resumes: bool = True
    """Whether a second call keeps the parts that are done; else each file is the earlier or the new one at any moment."""


class Counts(NamedTuple):
    """How often a disturbance was tried, how many of them hit a call that was still at work, how many parts were kept."""

    name: str
    tries: int = 0
    hits: int = 0
    kept: int = 0
    faults: tuple[str, ...] = ()
    early: int = 0
    """Interrupts that came before anything of this program was loaded."""

    def and_then(self, *, hit: bool, kept: int, fault: str | None, early: bool = False) -> "Counts":
        """One more try."""
        faults = (*self.faults, fault) if fault else self.faults
        return Counts(self.name, self.tries + 1, self.hits + hit, self.kept + kept, faults, self.early + early)

    def line(self) -> str:
        """The counts as a row of the table."""
        return f"{self.name:44}{self.tries:7}{self.hits:7}{self.kept:7}{self.early:7}{len(self.faults):8}"


HEAD = f"{'disturbance':44}{'tries':>7}{'at work':>8}{'kept':>6}{'early':>7}{'faults':>8}"


def _logs(place: Path) -> None:
    (place / "logs").mkdir(parents=True)
    for k in range(COPIES):
        (place / "logs" / f"log {k}.csv").write_text(text())


ROWS = 901
"""Lines of a short log: one cycle, which a diagnosis of a second needs."""

SHORT = {"r36ohm.csv": 36.0, "r9ohm.csv": 9.0}
"""Logs of a short campaign, with their loads. [ohm]"""


def _shorten(source: Path, folder: Path) -> None:
    """Make a campaign of two short logs of those in another folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in SHORT:
        lines = (source / name).read_text(encoding="utf-8").splitlines(keepends=True)
        (folder / name).write_text("".join(lines[:ROWS]), encoding="utf-8")
    runs = [f'[[run]]\nfile = "{name}"\nload_ohm = {load}\n' for name, load in SHORT.items()]
    (folder / "campaign.toml").write_text("\n".join(['title = "short"\n', *runs]), encoding="utf-8")


def _short(place: Path) -> None:
    _shorten(ROOT / "fixtures" / "campaign", place / "logs")


def _with_earlier(*words: str) -> Callable[[Path], None]:
    """Short logs, and the results of an earlier call with other options, made once beside the places of all tries."""

    def prepare(place: Path) -> None:
        once = place.parent / "earlier"
        if not once.exists():
            _short(once)
            (once / "out").mkdir()
            subprocess.run([*OWN, *words], cwd=once, check=True, capture_output=True)
        shutil.copytree(once, place)

    return prepare


def _dealt(place: Path) -> None:
    """A copy of a trial that is dealt once, beside the places of all tries."""
    once = place.parent / "dealt"
    if not once.exists():
        once.mkdir(parents=True)
        command = [*OWN, "blind", "deal", *CASES, "--out", "out", "--jobs", "1"]
        subprocess.run(command, cwd=once, check=True, capture_output=True)
    shutil.copytree(once, place)


def _dealt_short(place: Path) -> None:
    """A copy of a trial whose cases have two short logs each."""
    once = place.parent / "short"
    if not once.exists():
        _dealt(once)
        for case in sorted((once / "out").glob("case-*")):
            shutil.move(case, once / "long")
            _shorten(once / "long", case)
            shutil.rmtree(once / "long")
    shutil.copytree(once, place)


CASES = ["--cases", "2", "--seed", "7"]
BATCH = Kind("batch", [*OWN, "batch", "logs", "--out", "out", "--reports", "none"], _logs, "out", "runs/*.json")
DEAL = Kind(
    "blind deal",
    [*OWN, "blind", "deal", *CASES, "--out", "out"],
    lambda place: place.mkdir(parents=True),
    "out",
    "case-*",
)
GUESSED = Kind("blind diagnose, by a guess", [*GUESS, "out"], _dealt, "out", "diagnoses/*.json")
DIAGNOSED = Kind("blind diagnose", [*OWN, "blind", "diagnose", "out"], _dealt_short, "out", "diagnoses/*.json")
_DIAGNOSE = ("diagnose", "logs", "--suspect", "ke_shift", "--json", "out/d.json", "--predictions", "out/predicted")
DIAGNOSE = Kind(
    "diagnose", [*OWN, *_DIAGNOSE, "--seed", "1"], _with_earlier(*_DIAGNOSE), "out", "d.json", resumes=False
)
_REDUCE = ("reduce", "logs/r36ohm.csv", "--json", "out/r.json", "--parquet", "out/tables")
REDUCE = Kind(
    "reduce", [*OWN, *_REDUCE, "--window", "5"], _with_earlier(*_REDUCE), "out", "r.json", resumes=False
)  # fmt: skip
KINDS = (BATCH, DEAL, GUESSED)
ENDED = (BATCH, DEAL, DIAGNOSED, DIAGNOSE, REDUCE)
"""Commands that are ended by signals."""
SIZES = {BATCH.name: [1 << k for k in range(10, 18)], DEAL.name: [1 << k for k in range(10, 18, 2)]}
"""Of commands that make a folder of results: sizes beyond which no file may grow. [bytes]"""

DISKS = {
    BATCH.name: [40_000, 60_000, 80_000, 120_000],
    DEAL.name: [20_000, 200_000, 900_000],
    GUESSED.name: [20_000, 400_000, 1_000_000],
}
"""Sizes of disks that are too small. [bytes]"""


def guess(campaign_toml: Path, *, suspects: Suspects, seed: int, predictions: Path | None) -> dict[str, Any]:
    """Diagnose a campaign by a glance at its logs, with predictions of some size."""
    logs = sorted(campaign_toml.parent.glob("*.csv"))
    for log in logs:
        assert predictions is not None
        (predictions / log.name).write_bytes(log.read_bytes())
    seen = [hashlib.sha256(log.read_bytes()).hexdigest() for log in logs]
    return {"schema": "winchcascade/diagnosis/1", "seen": seen, "suspects": len(suspects), "seed": seed}


# --- what is looked at


def content(out: Path) -> dict[str, bytes]:
    """Every file but the scratch files of calls that were cut short, and what it holds."""
    found = (path.relative_to(out) for path in sorted(out.rglob("*")) if path.is_file())
    return {str(name): (out / name).read_bytes() for name in found if not any(p.startswith(".") for p in name.parts)}


def half(out: Path) -> str | None:
    """A file that stands under its own name and cannot be read whole; None if there is none."""
    for name, data in content(out).items():
        try:
            if name.endswith(".json"):
                json.loads(data)
            if name.endswith(".parquet"):
                parquet.read_table(out / name)
        except Exception as fault:
            return f"{name} is half-written ({type(fault).__name__})"
        if not data:
            return f"{name} is empty"
    return None


def stamps(out: Path, kind: Kind) -> dict[str, int]:
    """When each finished part was written."""
    return {str(path.relative_to(out)): path.stat().st_mtime_ns for path in out.glob(kind.finished)}


def call(kind: Kind, place: Path, *, jobs: int = 1, limit: int | None = None) -> "subprocess.Popen[str]":
    """Begin a call in a folder, in a group of processes of its own, with a limit on the size of each file [bytes]."""
    (place / "tmp").mkdir(exist_ok=True)
    words = [] if kind.name == REDUCE.name else ["--jobs", str(jobs)]
    return subprocess.Popen(
        [*_limited(limit), *kind.command, *words], cwd=place, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, start_new_session=True, env=os.environ | {"TMPDIR": str(place / "tmp")},
    )  # fmt: skip


def _limited(limit: int | None) -> list[str]:
    """What goes before a command that may write files of so many blocks of 1024 bytes at most."""
    return [] if limit is None else ["bash", "-c", f'ulimit -f {max(1, limit // 1024)}; exec "$0" "$@"']


def complete(kind: Kind, place: Path, undisturbed: Mapping[str, bytes], *, jobs: int = 1) -> tuple[int, str | None]:
    """Call once more; how many parts were kept, and what is wrong with what is there after it, if anything is."""
    out = place / kind.out
    broken, kept = half(out), stamps(out, kind)
    if broken:
        return len(kept), broken
    printed, err = (again := call(kind, place, jobs=jobs)).communicate(timeout=PATIENCE)
    if again.returncode or "Traceback" in err:
        return len(kept), f"the second call ended with {again.returncode}: {err[-300:]} {printed[-300:]}"
    after = stamps(out, kind)
    if kind.resumes and {name: after.get(name) for name in kept} != kept:
        return len(kept), "what was finished was made anew"
    left = [str(path.relative_to(place)) for path in (*out.rglob(".*"), *(place / "tmp").rglob(".*"))]
    if left:
        return len(kept), f"scratch is left: {', '.join(left[:5])}"
    found = content(out)
    if found != undisturbed:
        odd = sorted(name for name in {*found, *undisturbed} if found.get(name) != undisturbed.get(name))
        return len(kept), f"other content in {', '.join(odd[:5])}"
    return len(kept), None


def undisturbed(kind: Kind, place: Path) -> tuple[dict[str, bytes], float]:
    """What a call leaves that nobody disturbs, and how long it takes. [s]"""
    kind.prepare(place)
    begun = time.perf_counter()
    one = call(kind, place)
    _, err = one.communicate(timeout=PATIENCE)
    assert one.returncode == 0, err
    return content(place / kind.out), time.perf_counter() - begun


# --- disturbances


def kills(kind: Kind, folder: Path, number: int, rng: random.Random) -> Counts:
    """End a call at a random moment by each signal in turn, alone or with all its processes, then complete."""
    whole, seconds = undisturbed(kind, folder / "undisturbed")
    kind.prepare(folder / "before")
    before = content(folder / "before" / kind.out)
    counts = Counts(f"{kind.name}: SIGINT, SIGTERM, SIGKILL")
    for k, place in _places(kind, folder, range(number)):
        jobs, by, to_all = 1 + k % 2, SIGNALS[k % len(SIGNALS)], k // 2 % 2 == 0
        one = call(kind, place, jobs=jobs)
        with suppress(subprocess.TimeoutExpired):
            one.wait(rng.uniform(0.0, seconds))
        hit = one.poll() is None
        with suppress(ProcessLookupError):
            (os.killpg if to_all or by == signal.SIGKILL else os.kill)(one.pid, by)
        printed, err = one.communicate(timeout=PATIENCE)
        early = hit and "Traceback" in err and "winchcascade/" not in err.replace(str(ROOT), "")
        wrong = None if early or not hit else _badly_ended(one.returncode, printed, err, by)
        if not kind.resumes:
            wrong = wrong or _neither(content(place / kind.out), before, whole)
        kept, fault = complete(kind, place, whole, jobs=jobs)
        fault = wrong or fault
        counts = counts.and_then(hit=hit, kept=kept, fault=fault and f"{place.name} by {by.name}: {fault}", early=early)
    return counts


SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)


def _badly_ended(code: int, printed: str, err: str, by: signal.Signals) -> str | None:
    """What is wrong with how a call answered a signal: one sentence or nothing, and the code of the signal or of success."""
    sentence = err == "" or (err.startswith("winchcascade: ") and err.count("\n") == 1)
    if sentence and code in (0, -by, 128 + by):
        return None
    return f"ended with {code} and printed {(err or printed)[-600:]!r}"


def _neither(found: Mapping[str, bytes], before: Mapping[str, bytes], after: Mapping[str, bytes]) -> str | None:
    """A file that was lost, or is neither the one of before nor the new one."""
    for name in before:
        if found.get(name) not in (before[name], after.get(name)):
            return f"{name} is {'lost' if name not in found else 'neither old nor new'}"
    return None


def both_at_once(kind: Kind, folder: Path, number: int, rng: random.Random) -> Counts:
    """Have two calls work on one folder, the second one begun a little later."""
    whole, seconds = undisturbed(kind, folder / "undisturbed")
    counts = Counts(f"{kind.name}: two calls on one folder")
    for k, place in _places(kind, folder, range(number)):
        one = call(kind, place)
        with suppress(subprocess.TimeoutExpired):
            one.wait(rng.uniform(0.0, 0.5 * seconds))
        hit = one.poll() is None
        other = call(kind, place, jobs=1 + k % 2)
        ended = [(each.communicate(timeout=PATIENCE)[1], each.returncode) for each in (one, other)]
        failed = [f"a call ended with {code}: {printed[-300:]}" for printed, code in ended if code]
        kept, fault = complete(kind, place, whole)
        counts = counts.and_then(hit=hit, kept=kept, fault=next(iter(failed), fault))
    return counts


def _places(kind: Kind, folder: Path, numbers: Sequence[int]) -> Iterator[tuple[int, Path]]:
    """Prepare a folder for each number, and remove it after its use."""
    for number in numbers:
        place = folder / f"place {number}"
        kind.prepare(place)
        yield number, place
        shutil.rmtree(place)


def too_large(kind: Kind, folder: Path, sizes: Sequence[int]) -> Counts:
    """Let no file grow beyond a size, as on a full disk, then complete."""
    whole, _ = undisturbed(kind, folder / "undisturbed")
    counts = Counts(f"{kind.name}: no room for a file")
    for size, place in _places(kind, folder, sizes):
        one = call(kind, place, limit=size)
        printed, err = one.communicate(timeout=PATIENCE)
        kept, fault = complete(kind, place, whole)
        counts = counts.and_then(
            hit=one.returncode != 0, kept=kept, fault=_badly_reported(err, printed, one.returncode) or fault
        )
    return counts


def _badly_reported(err: str, printed: str, code: int) -> str | None:
    """What is wrong with how a call reported that it could not go on."""
    if code == 0 or ("Traceback" not in err and (err + printed).strip() and code in (1, 2)):
        return None
    return f"ended with {code} and printed {(err or printed)[-300:]!r}"


@contextmanager
def small_disk(folder: Path, size: int) -> Iterator[Path | None]:
    """A file system of so many bytes; None where none may be mounted. [bytes]"""
    folder.mkdir(parents=True)
    made = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={size}", "none", str(folder)], capture_output=True, check=False
    )
    try:
        yield folder if made.returncode == 0 else None
    finally:
        if made.returncode == 0:
            subprocess.run(["umount", str(folder)], check=True)


def full_disk(kind: Kind, folder: Path, sizes: Sequence[int]) -> Counts:
    """Write to a file system that is too small, then complete after it has grown."""
    whole, _ = undisturbed(kind, folder / "undisturbed")
    counts = Counts(f"{kind.name}: a full disk")
    for size, place in _places(kind, folder, sizes):
        kept_apart = place / kind.out
        before = content(kept_apart)
        shutil.rmtree(kept_apart, ignore_errors=True)
        with small_disk(kept_apart, size + sum(4096 * (2 + len(data) // 4096) for data in before.values())) as disk:
            if disk is None:
                return counts
            for name, data in before.items():
                (disk / name).parent.mkdir(parents=True, exist_ok=True)
                (disk / name).write_bytes(data)
            one = call(kind, place)
            printed, err = one.communicate(timeout=PATIENCE)
            wrong = _badly_reported(err, printed, one.returncode) or half(disk)
            subprocess.run(["mount", "-o", "remount,size=1G", str(disk)], check=True)
            kept, fault = complete(kind, place, whole)
            counts = counts.and_then(hit=one.returncode != 0, kept=kept, fault=wrong or fault)
    return counts


NOWHERE = ("logs/log 0.csv/out", "/proc/out", "/sys/out", "/dev/null/out", "/dev/full")


def nowhere(kind: Kind, folder: Path) -> Counts:
    """Name folders of results that cannot be made: each is one sentence."""
    counts = Counts(f"{kind.name}: a folder that cannot be made")
    place = folder / "nowhere"
    _logs(place)
    for out in NOWHERE:
        command = [str(place / out) if word == "out" else word for word in kind.command]
        one = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False, timeout=PATIENCE)
        good = one.returncode == 2 and one.stderr.startswith("winchcascade: ") and one.stderr.count("\n") == 1
        counts = counts.and_then(
            hit=True, kept=0, fault=None if good else f"{out}: {one.returncode} {one.stderr[-300:]}"
        )
    shutil.rmtree(place)
    return counts


def lost_worker() -> Counts:
    """The test of a cluster whose worker is killed, as it stands beside the other tests of clusters."""
    test = ROOT / "tests" / "batch" / "test_cluster.py"
    command = [sys.executable, "-m", "pytest", "-q", str(test), "-k", "killed_worker"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    fault = None if done.returncode == 0 else done.stdout[-300:]
    return Counts("batch: a worker of a cluster is lost").and_then(hit=True, kept=0, fault=fault)


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=100, help="of each command")
    names = list(dict.fromkeys(kind.name for kind in (*KINDS, *ENDED)))
    parser.add_argument("--only", choices=names, help="disturb this command alone")
    parser.add_argument("--signals", action="store_true", help="end calls by signals, and disturb them by nothing else")
    parser.add_argument("--seed", type=int, default=1, help="of the moments of the kills")
    parser.add_argument("--guess", metavar="TRIAL", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--jobs", type=int, default=1, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.guess:
        done = diagnose(given.guess, DiagnosisMethod(guess, EFFECTS))
        print(*done.faults.values(), sep="\n")
        return 1 if done.faults else 0
    rng = random.Random(given.seed)
    kinds = [kind for kind in KINDS if given.only in (None, kind.name) and not given.signals]
    ended = [kind for kind in ENDED if given.only in (None, kind.name)]
    found: list[str] = []
    print(HEAD)
    with tempfile.TemporaryDirectory(prefix="faults-") as scratch:
        for number, disturbance in enumerate(_disturbances(kinds, ended, given.kills, rng)):
            counts = disturbance(Path(scratch) / str(number))
            print(counts.line(), *counts.faults, sep="\n", flush=True)
            found += counts.faults
    print(f"seed {given.seed}")
    return 1 if found else 0


def _disturbances(
    kinds: Sequence[Kind], ended: Sequence[Kind], number: int, rng: random.Random
) -> Iterator[Callable[[Path], Counts]]:
    for kind in ended:
        yield partial(kills, kind, number=number, rng=rng)
    for kind in kinds:
        if kind.name in SIZES:
            yield partial(both_at_once, kind, number=max(1, number // 10), rng=rng)
            yield partial(too_large, kind, sizes=SIZES[kind.name])
            yield partial(nowhere, kind)
        yield partial(full_disk, kind, sizes=DISKS[kind.name])
    if BATCH in kinds:
        yield lambda folder: lost_worker()  # noqa: ARG005


if __name__ == "__main__":
    sys.exit(main())
