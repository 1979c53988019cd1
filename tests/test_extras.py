"""An installation without numba and typst: the same numbers, and one sentence for what it cannot make."""

import subprocess
import sys
from pathlib import Path

import msgspec
import numpy as np
import pytest

HIDDEN = "import sys; sys.modules.update(numba=None, typst=None); from winchcascade.cli.entry import main; main()"
WHOLE = "from winchcascade.cli.entry import main; main()"

SAME = 1e-6
"""Relative difference of numbers that plain Python and compiled code may give: those of a fit end where a step is small."""

ONE_CYCLE = 31.0
"""End of the first cycle of the log of 36 ohm. [s]"""


def ran(code: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """A command line in a process of its own, with every warning an error."""
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", code, *map(str, arguments)], capture_output=True, text=True, check=False
    )


@pytest.fixture
def one_cycle(fixtures: Path, tmp_path: Path) -> Path:
    """The log of 36 ohm until the end of its first cycle: plain Python takes long for more."""
    header, *rows = (fixtures / "campaign" / "r36ohm.csv").read_text().splitlines()
    first = [row for row in rows if float(row.split(",")[0]) < ONE_CYCLE]
    log = tmp_path / "r36ohm.csv"
    log.write_text("\n".join([header, *first, ""]))
    return log


def numbers_in(record: object) -> list[float]:
    """All numbers of a record, in its order."""
    if isinstance(record, dict):
        return [number for value in record.values() for number in numbers_in(value)]
    if isinstance(record, list):
        return [number for value in record for number in numbers_in(value)]
    return [float(record)] if isinstance(record, int | float) else []


@pytest.mark.slow
def test_a_simulation_without_numba_gives_the_same_numbers(one_cycle: Path, tmp_path: Path) -> None:
    log, effects, tables = one_cycle, ("--with", "ke_rolloff.lost_to_1p8=0.05"), []
    for name, code in (("plain", HIDDEN), ("compiled", WHOLE)):
        done = ran(code, "simulate", log, "--load-ohm", 4.5, *effects, "--out", tmp_path / f"{name}.csv")
        assert done.returncode == 0, done.stderr
        assert ("winchcascade[fast]" in done.stderr) == (name == "plain")
        tables.append(np.loadtxt(tmp_path / f"{name}.csv", delimiter=",", skiprows=1))
    np.testing.assert_allclose(tables[0], tables[1], rtol=SAME, atol=SAME)


@pytest.mark.slow
def test_a_diagnosis_without_numba_gives_the_same_numbers(one_cycle: Path, tmp_path: Path) -> None:
    entry = f'[[run]]\nfile = "{one_cycle.name}"\nload_ohm = 36\n'
    (tmp_path / "campaign.toml").write_text(f'title = "one cycle"\n{entry}')
    found = []
    for name, code in (("plain", HIDDEN), ("compiled", WHOLE)):
        record = tmp_path / f"{name}.json"
        done = ran(code, "diagnose", tmp_path, "--suspect", "gear_mesh_loss", "--json", record)
        assert done.returncode == 0, done.stderr
        found.append(numbers_in(msgspec.json.decode(record.read_bytes())))
    np.testing.assert_allclose(found[0], found[1], rtol=SAME, atol=SAME)


def test_a_pdf_without_typst_is_rejected_before_any_work(fixtures: Path, tmp_path: Path) -> None:
    log, pdf = fixtures / "campaign" / "r36ohm.csv", tmp_path / "r36ohm.pdf"
    done = ran(HIDDEN, "reduce", log, "--json", tmp_path / "r36ohm.json", "--pdf", pdf)
    assert (done.returncode, done.stdout) == (2, "")
    assert 'pip install "winchcascade[pdf]"' in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_batch_without_typst_writes_its_pages_and_names_what_is_left_out(one_cycle: Path, tmp_path: Path) -> None:
    done = ran(HIDDEN, "batch", one_cycle, "--out", tmp_path / "out", "--reports", "all", "--jobs", "1")
    assert done.returncode == 0, done.stderr
    assert 'pip install "winchcascade[pdf]"' in " ".join(done.stdout.split())
    pages = {path.name for path in (tmp_path / "out").rglob("*.html")}
    assert pages == {"campaign.html", "index.html", "r36ohm.csv.html"}
    assert list((tmp_path / "out").rglob("*.pdf")) == []
