"""Print what a log costs, beside a script with pandas: start-up, one log, its reports, a log of many hours.

python benchmarks/logs.py [--quick] [--rows 14000000] [--pairs 3]

Both sides of a ratio run in turn as processes of their own; the median of the pairs' ratios is printed.
"""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

from measure import LOG, Row, Sizes, in_turn, main, python, script, winchcascade

IMPORTS = python("import typer, numpy, pyarrow.csv")
READ_CSV = "import sys, pyarrow.csv; pyarrow.csv.read_csv(sys.argv[1])"
WINDOW = ("--window", "5.48")


def rows(sizes: Sizes) -> Iterator[Row]:
    """Measure start-up and one log, then the reports, then the long log."""
    yield from _start(sizes)
    with tempfile.TemporaryDirectory() as folder:
        yield from _reports(sizes, Path(folder))
        yield from _long(sizes, Path(folder))


def _start(sizes: Sizes) -> Iterator[Row]:
    one, pandas = winchcascade("reduce", LOG), script("with_pandas.py", LOG, *WINDOW)
    yield in_turn(winchcascade("--help"), IMPORTS, sizes.starts).row("--help", "imports of typer, numpy, Arrow's CSV")
    yield in_turn(winchcascade("--help"), script("with_pandas.py", "--help"), sizes.starts).row(
        "--help", "pandas --help"
    )
    yield in_turn(one, IMPORTS, sizes.starts).row("reduce one log", "those imports")
    yield in_turn(one, pandas, sizes.starts).row("reduce one log", "pandas")
    record = winchcascade("reduce", LOG, "--json", "-")
    yield in_turn(record, pandas, sizes.starts).row("reduce one log, uncertainty, JSON", "pandas")


def _reports(sizes: Sizes, folder: Path) -> Iterator[Row]:
    for report, figure in (("html", "svg"), ("pdf", "pdf")):
        ours = winchcascade("reduce", LOG, f"--{report}", folder / f"report.{report}")
        other = script("with_pandas.py", LOG, *WINDOW, "--plot", folder / f"figure.{figure}")
        yield in_turn(ours, other, sizes.pairs).row(
            f"report of one log, {report.upper()}", "pandas, matplotlib: one figure"
        )


def _long(sizes: Sizes, folder: Path) -> Iterator[Row]:
    log = folder / "long.csv"
    subprocess.run(script("make_long_log.py", log, "--rows", str(sizes.rows)), check=True, stdout=subprocess.DEVNULL)
    what = f"reduce {sizes.rows / 1e6:g} million rows, {log.stat().st_size / 1e9:.2f} GB"
    ours, count = winchcascade("reduce", log), sizes.pairs
    pandas = in_turn(ours, script("with_pandas.py", log), count)
    yield pandas.row(what, "pandas")
    yield pandas.memory("the same, memory", "pandas")
    yield in_turn(ours, python(READ_CSV, log), count).row(what, "Arrow's read_csv alone")


if __name__ == "__main__":
    main("Print what a log costs.", rows)
