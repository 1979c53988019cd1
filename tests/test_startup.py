"""What `reduce` of a plain log must not import: each of these takes longer than the reduction."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

SLOW = (
    "numba",
    "pandas",
    "matplotlib",
    "pyarrow.compute",
    "pyarrow.parquet",
    "rich",
    "nptdms",
    "h5py",
    "jinja2",
    "typst",
    "winchcascade.ingest.isolated",
)


def modules_after(arguments: list[str]) -> set[str]:
    """Modules that a command line leaves imported, seen in a process of its own."""
    code = (
        "import sys\n"
        "from winchcascade.cli.entry import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "sys.stderr.write('\\nMODULES ' + ' '.join(sys.modules))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=True
    )
    return set(done.stderr.split("MODULES ")[1].split())


@pytest.mark.parametrize("options", [[], ["--json", "-"]], ids=["table", "json"])
def test_reduce_of_a_csv_log_imports_nothing_slow(fixtures: Path, options: list[str]) -> None:
    loaded = modules_after(["reduce", str(fixtures / "campaign" / "r36ohm.csv"), *options])
    assert not {name for name in SLOW if name in loaded} - (
        {"rich"} if not options else set()
    )  # lays out the tables


def test_a_page_of_a_log_imports_no_frames_and_no_search(fixtures: Path, tmp_path: Path) -> None:
    page = ["--html", str(tmp_path / "page.html")]
    loaded = modules_after(["reduce", str(fixtures / "campaign" / "r36ohm.csv"), *page])
    assert "matplotlib" in loaded
    unused = {"pandas", "typst", "winchcascade.diagnosis.fit.search"}
    assert not unused & loaded


def test_a_batch_without_reports_imports_nothing_that_simulates_or_draws(
    fixtures: Path, tmp_path: Path
) -> None:
    log = str(fixtures / "campaign" / "r36ohm.csv")
    loaded = modules_after(
        ["batch", log, "--out", str(tmp_path / "out"), "--reports", "none", "--jobs", "1"]
    )
    assert not {"numba", "matplotlib", "jinja2", "typst"} & loaded
    (result,) = (tmp_path / "out" / "runs").glob("*.json")
    assert "model" not in json.loads(result.read_bytes())


def test_help_imports_no_arrays() -> None:
    assert not {"numpy", "pyarrow"} & modules_after(["--help"])


def test_the_json_of_a_diagnosis_imports_no_figures() -> None:
    modules = "batch.campaign_diagnosis report.results.diagnosis_record cli.diagnose_command diagnosis.handover.model_export"
    imports = "; ".join(f"import winchcascade.{name}" for name in modules.split())
    code = f"import sys; {imports}; sys.stdout.write(' '.join(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"matplotlib", "jinja2", "typst", "pandas"} & set(done.stdout.split())
