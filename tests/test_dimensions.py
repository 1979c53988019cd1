"""No constant of reading and reduction has a size of its own, but for those that nature or a
file format fixes.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import winchcascade

PACKAGE = Path(winchcascade.__file__).parent
SUBPACKAGES = ("ingest", "reduction")

UNIT = re.compile(r"\[(?!1\]|characters\]|bytes\]|samples\])[^\]]*\]")
"""A unit in brackets: of a quantity of nature, not of a number, of text or of a file."""

FIXED = {
    (
        "ingest/checks/signs.py",
        "VACUUM",
    ): "nature: no pressure lies below a vacuum, and pressures do not scale with a rig",
    (
        "ingest/clock.py",
        "STAMP_MAX",
    ): "floating point: a stamp beyond the age of the universe is a wrong byte",
    ("ingest/clock.py", "RISE_MIN"): "floating point: the square of a shorter interval is 0",
    (
        "ingest/clock.py",
        "INTERVAL_MIN",
    ): "instruments: no converter of a logger samples at a gigahertz",
    ("ingest/limits.py", "SECONDS_MIN"): "a computer's time to read a file",
    ("ingest/limits.py", "SECONDS_PER_MB"): "a computer's time to read a file",
    ("ingest/log_facts.py", "ANY_RATE"): "no rate: a log without a clock is looked at, not reduced",
    ("ingest/log_clock.py", "EPOCH_SECONDS"): "file format: stamps that count from 1970 or 1904",
    (
        "ingest/log_clock.py",
        "MINUTE_STEP_MAX",
    ): "file format: digits of minutes in stamps without separators",
    (
        "ingest/phase_labels.py",
        "NEARLY",
    ): "file format: a row without a clock counts for one second",
}
"""Constants that have a dimension, by module and name, each with what fixes it."""


def constants_with_a_dimension() -> Iterator[tuple[str, str]]:
    """Module constants whose note gives a unit; types have a unit but no size."""
    for subpackage in SUBPACKAGES:
        for path in sorted((PACKAGE / subpackage).rglob("*.py")):
            body = ast.parse(path.read_text(encoding="utf-8")).body
            for statement, note in pairwise(body):
                text = note.value if isinstance(note, ast.Expr) else None
                described = isinstance(text, ast.Constant) and UNIT.search(str(text.value))
                if (
                    described
                    and isinstance(statement, ast.Assign)
                    and not isinstance(statement.value, ast.Subscript)
                ):
                    for name in ast.walk(statement.targets[0]):
                        if isinstance(name, ast.Name):
                            yield path.relative_to(PACKAGE).as_posix(), name.id


def test_every_constant_with_a_dimension_is_fixed_by_nature_or_by_a_format() -> None:
    assert sorted(constants_with_a_dimension()) == sorted(FIXED)
