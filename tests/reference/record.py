"""Record what every command prints and writes, as small texts, so that each change of an output is seen in a diff.

python tests/reference/record.py [--only GROUP ...] [--check]

Without options it writes the present outputs of all groups into tests/reference/outputs. `--check` compares and writes nothing.
"""

import argparse
import os
import sys
import tarfile
import time
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent.parent), str(HERE), str(HERE.parent / "hardening")]

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # as in the processes of users: commands set it before they import numpy

from groups import GROUPS  # noqa: E402
from numerals import difference, settled  # noqa: E402
from workplace import KEPT, Workplace, workplace  # noqa: E402

OUTPUTS = HERE / "outputs"

NEEDS_SHARED = "shared"
"""How names begin of outputs that need the data beside the project."""

PREDICTED = "r36ohm.csv"
"""Predictions of one log are kept of a trial: those of all logs are four times as large as everything else."""


def present(group: str) -> tuple[dict[str, str], bool]:
    """Make the outputs of a group, and tell whether the data beside the project were there."""
    with workplace() as place:
        return {f"{name}.txt": text for name, text in GROUPS[group](place)}, place.shared


def stored(group: str) -> dict[str, str]:
    """Read the stored outputs of a group."""
    return {path.name: path.read_text(encoding="utf-8") for path in sorted((OUTPUTS / group).glob("*.txt"))}


def differences(group: str, *, write: bool) -> list[str]:
    """Compare the present outputs of a group with the stored ones, and store them if wanted; what differs."""
    now, shared = present(group)
    before = {name: text for name, text in stored(group).items() if shared or not name.startswith(NEEDS_SHARED)}
    found = []
    for name in sorted({*now, *before}):
        text = difference(before.get(name, ""), now.get(name, ""), f"{group}/{name}")
        if text:
            found.append(text)
    if write:
        (OUTPUTS / group).mkdir(parents=True, exist_ok=True)
        for name in before.keys() - now.keys():
            (OUTPUTS / group / name).unlink()
        for name, text in now.items():
            (OUTPUTS / group / name).write_text(settled(before.get(name, ""), text), encoding="utf-8")
    return found


def keep_version() -> None:
    """Store a result folder and a trial of the present version, to be opened again by later ones."""
    from winchcascade import __version__

    folder = KEPT / __version__
    folder.mkdir(parents=True, exist_ok=True)
    with workplace() as place:
        short = place.short_campaign()
        for words in (
            ("batch", short, "--out", "results", "--jobs", "1", "--reports", "none", "--excel"),
            ("blind", "deal", "--cases", "1", "--seed", "3", "--out", "trial", "--jobs", "1"),
            ("blind", "diagnose", "trial", "--jobs", "1"),
        ):
            print(place.run(*words))
        for predicted in Path("trial", "predictions").rglob("*.csv"):
            if predicted.name != PREDICTED:
                predicted.unlink()
        for name in ("results", "trial"):
            _pack(place, name, folder / f"{name}.tar.xz")


def _pack(place: Workplace, name: str, archive: Path) -> None:
    with tarfile.open(archive, "w:xz", preset=9) as file:
        file.add(place.folder / name, name)


def main() -> int:
    """Record or compare the groups that are named; the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--only", nargs="+", choices=list(GROUPS), metavar="GROUP", help=f"Of {', '.join(GROUPS)}.")
    parser.add_argument("--check", action="store_true", help="Compare, and write nothing.")
    parser.add_argument("--keep-version", action="store_true", help="Store results and a trial of the present version.")
    options = parser.parse_args()
    if options.keep_version:
        keep_version()
        return 0
    found: list[str] = []
    for group in options.only or GROUPS:
        began = time.monotonic()
        found += differences(group, write=not options.check)
        print(f"{group}: {time.monotonic() - began:.0f} s", file=sys.stderr)
    if found:
        print("\n".join(found))
        again = " ".join(options.only or GROUPS)
        if options.check:
            print(f"\nIf every difference is meant: python tests/reference/record.py --only {again}")
    return 1 if found and options.check else 0


if __name__ == "__main__":
    sys.exit(main())
