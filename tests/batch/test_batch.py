"""A batch: what is done is kept, what has changed is done anew, and nothing is left half-written
whatever happens.
"""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from urllib.parse import unquote

import openpyxl
import pytest
from calls import without_progress
from pyarrow import parquet
from scratches import left_scratch
from test_cli import one_sentence, winchcascade
from undrawn import undrawn

from winchcascade.batch.dataset import TABLES
from winchcascade.batch.plan import make_plan
from winchcascade.batch.run_batch import Batch, Products, run_batch
from winchcascade.core.errors import OutputError
from winchcascade.core.jobs import Nobody, Workers
from winchcascade.ingest.read import read_run
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.run_record import reduction_json

FIXTURES = Path(__file__).parents[2] / "fixtures"
LOGS = {"r36ohm.csv": (36.0, 5.48), "r9ohm.csv": (9.0, 5.96)}
COPIES = 3
"""Logs of the calls that are cut short: enough that some are done and some are not."""

EPOCH = "1767225600"
"""Reports of this time are the same whenever they are made."""

PATIENCE = 10.0
"""A process that has not ended after this never will. [s]"""

ALONE = pytest.mark.skipif(os.name == "nt", reason="ends processes as POSIX does")


class Seen(Nobody):
    """What a batch reported of itself."""

    def __init__(self) -> None:
        self.kept = self.todo = -1
        self.names: list[str] = []
        self.faults: dict[str, str] = {}

    def begin(self, kept: int, todo: int) -> None:
        self.kept, self.todo = kept, todo

    def done(self, name: str, fault: str | None) -> None:
        self.names.append(name)
        if fault is not None:
            self.faults[name] = fault


def batch(
    *targets: Path,
    out: Path,
    reports: Sequence[str] = (),
    workbook: bool = False,
    force: bool = False,
    rig: str | None = None,
) -> tuple[Batch, Seen]:
    seen = Seen()
    plan = make_plan([str(target) for target in targets], rig=rig)
    products = Products(tuple(reports), workbook)
    with undrawn():
        return run_batch(plan, out, products, workers=Workers(1), force=force, watch=seen), seen


def redone(
    *targets: Path, out: Path, reports: Sequence[str] = (), rig: str | None = None
) -> list[str]:
    """Names of the logs that a further call works on."""
    return sorted(batch(*targets, out=out, reports=reports, rig=rig)[1].names)


def files(out: Path) -> list[Path]:
    """Every file of a folder but the scratch files of calls that were cut short."""
    paths = (path for path in out.rglob("*") if path.is_file())
    return sorted(
        p for p in paths if not any(part.startswith(".") for part in p.relative_to(out).parts)
    )


def contents(out: Path) -> dict[str, bytes]:
    return {path.relative_to(out).as_posix(): path.read_bytes() for path in files(out)}


def stamps(out: Path) -> dict[str, int]:
    return {path.relative_to(out).as_posix(): path.stat().st_mtime_ns for path in files(out)}


def with_campaign(folder: Path, rig: str = "") -> Path:
    folder.mkdir(parents=True)
    for name in LOGS:
        shutil.copy(FIXTURES / "campaign" / name, folder)
    runs = [
        f'[[run]]\nfile = "{name}"\nload_ohm = {load}\nwindow_s = {w}\n'
        for name, (load, w) in LOGS.items()
    ]
    (folder / "campaign.toml").write_text(f'title = "Two loads"\n{rig}' + "".join(runs))
    return folder


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    return with_campaign(tmp_path / "mes essais 測試")


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "résultats 結果"


@pytest.fixture
def done(campaign: Path, out: Path) -> Path:
    """The folder of a batch without reports."""
    batch(campaign, out=out)
    return out


def summary(out: Path) -> dict[str, dict[str, object]]:
    return {run["name"]: run for run in json.loads((out / "campaign.json").read_bytes())["runs"]}


# ----------------------------------------------------------------------------------- what is made
def test_a_result_is_that_of_reduce(campaign: Path, done: Path) -> None:
    for name in LOGS:
        record = json.loads((done / "runs" / f"{name}.json").read_bytes())
        assert record.pop("batch")["reports"] == []
        assert record == json.loads(winchcascade("reduce", campaign / name, "--json", "-").stdout)


def test_the_cycles_of_a_campaign_count(campaign: Path, out: Path) -> None:
    path = campaign / "campaign.toml"
    path.write_text(path.read_text().replace("window_s = 5.48", "window_s = 5.48\ncycles = [2, 3]"))
    found, _ = batch(campaign, out=out)
    record = json.loads(found.results["r36ohm.csv"].read_bytes())
    assert [cycle["cycle"] for cycle in record["cycles"]] == [2, 3]
    expected = json.loads(reduction_json(reduce(read_run(campaign / "r36ohm.csv"))))
    assert {k: v for k, v in record.items() if k != "batch"} == expected


def test_the_summary_has_every_log_in_the_order_of_the_campaign(done: Path) -> None:
    runs = summary(done)
    assert list(runs) == list(LOGS)
    for name, run in runs.items():
        record = json.loads((done / str(run["result"])).read_bytes())
        assert run["fault"] is None
        assert (run["load_ohm"], run["mean"]) == (LOGS[name][0], record["mean"])
        assert (run["cycles"], run["complete"]) == (3, 3)


def with_reports(place: Path, reports: str) -> Path:
    """The folder of a batch of one log, made as by a repeatable build."""
    arguments = ("--out", "out", "--reports", reports, "--jobs", "2")
    log = FIXTURES / "campaign" / "r9ohm.csv"
    with undrawn():
        assert (
            winchcascade("batch", log, *arguments, cwd=place, SOURCE_DATE_EPOCH=EPOCH).returncode
            == 0
        )
    return place / "out"


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return with_reports(tmp_path_factory.mktemp("page"), "html")


def listed(*endings: str) -> set[str]:
    names = {f"{name}.{ending}" for name in ("campaign", "runs/r9ohm.csv") for ending in endings}
    names |= {"index.html"} if "html" in endings else set()
    return names | {
        "campaign.json",
        "runs/r9ohm.csv.json",
        *(f"dataset/{table}.parquet" for table in TABLES),
    }


def test_just_the_reports_that_are_asked_for_are_written(page: Path, tmp_path: Path) -> None:
    assert set(contents(page)) == listed("html")
    assert set(contents(with_reports(tmp_path, "none"))) == listed()
    assert list(page.rglob(".*")) == []


@pytest.mark.slow
def test_all_reports_are_page_and_pdf_and_a_further_call_adds_the_pdf(
    page: Path, tmp_path: Path
) -> None:
    shutil.copytree(page, tmp_path / "out")
    assert set(contents(with_reports(tmp_path, "all"))) == listed("html", "pdf")


@pytest.mark.slow
def test_a_repeatable_build_gives_the_same_reports(page: Path, tmp_path: Path) -> None:
    assert contents(with_reports(tmp_path, "html")) == contents(page)


def test_links_of_the_page_lead_to_files(tmp_path: Path, out: Path) -> None:
    log = Path(shutil.copy(FIXTURES / "campaign" / "r9ohm.csv", tmp_path / "50 % #2 測é.csv"))
    batch(log, out=out, reports=["html"])
    links = re.findall(
        r'href="(?!#|data:)([^"]*)"', (out / "campaign.html").read_text(encoding="utf-8")
    )
    assert {unquote(link) for link in links} == {"runs/50 % #2 測é.csv.html", "index.html"}
    assert all((out / unquote(link)).is_file() for link in links)


# ------------------------------------------------------------------- what is kept, what is redone
def kept(said: str) -> int:
    """How many logs the terminal states as kept."""
    found = re.search(r"^kept +(\d+) of \d+ logs", said, re.MULTILINE)
    return 0 if found is None else int(found[1])


def test_a_second_call_keeps_all_and_says_so(campaign: Path, out: Path) -> None:
    arguments = ("batch", campaign, "--out", out, "--reports", "none", "--excel")
    assert kept(winchcascade(*arguments).stdout) == 0
    before = stamps(out)
    again = winchcascade(*arguments)
    assert kept(again.stdout) == 2
    assert again.returncode == 0
    assert stamps(out) == before


def test_changed_content_redoes_that_log_and_the_campaign(campaign: Path, done: Path) -> None:
    log, before = campaign / "r9ohm.csv", stamps(done)
    log.write_text("\n".join(log.read_text().splitlines()[:-10]) + "\n")
    assert redone(campaign, out=done) == ["r9ohm.csv"]
    after = stamps(done)
    assert {name for name in after if after[name] == before[name]} == {"runs/r36ohm.csv.json"}
    rows = parquet.read_table(done / "dataset" / "runs_all.parquet").to_pylist()
    assert [row["samples"] for row in rows] == [2767, 3411 - 10]
    assert (
        summary(done)["r9ohm.csv"]["mean"]
        == json.loads((done / "runs" / "r9ohm.csv.json").read_bytes())["mean"]
    )


def test_a_changed_window_redoes_that_log(campaign: Path, done: Path) -> None:
    path = campaign / "campaign.toml"
    path.write_text(path.read_text().replace("5.96", "5.9"))
    assert redone(campaign, out=done) == ["r9ohm.csv"]
    assert json.loads((done / "runs" / "r9ohm.csv.json").read_bytes())["window"] == 5.9


def test_a_changed_rig_file_redoes_the_logs_on_that_rig(tmp_path: Path, out: Path) -> None:
    ours = with_campaign(tmp_path / "ours", 'rig = "rig.toml"\n')
    rig = ours / "rig.toml"
    rig.write_text('based_on = "hsu2026"\nname = "ours"\n')
    other = tmp_path / "other.csv"
    shutil.copy(FIXTURES / "campaign" / "r36ohm.csv", other)
    assert redone(ours, other, out=out) == ["other.csv", *LOGS]
    rig.write_text('based_on = "hsu2026"\nname = "ours now"\n')
    assert redone(ours, other, out=out) == list(LOGS)


def test_another_rig_by_option_redoes_all(campaign: Path, done: Path, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text('based_on = "hsu2026"\nname = "mine"\n')
    assert redone(campaign, out=done, rig=str(tmp_path / "mine.toml")) == list(LOGS)


def test_results_of_a_log_listed_twice_are_replaced_and_those_of_another_call_stay(
    tmp_path: Path, out: Path
) -> None:
    ours = with_campaign(tmp_path / "ours", 'rig = "rig.toml"\n')
    path, rig = ours / "campaign.toml", ours / "rig.toml"
    twice = "".join(
        f'[[run]]\nfile = "r9ohm.csv"\nload_ohm = 9.0\ncycles = {c}\n' for c in ("[1, 2]", "[2, 3]")
    )
    path.write_text(f'rig = "rig.toml"\n{twice}')
    logs = ["r9ohm.csv-cycles-1-2", "r9ohm.csv-cycles-2-3"]
    for name in ("ours", "ours now"):
        rig.write_text(f'based_on = "hsu2026"\nname = "{name}"\n')
        assert redone(ours, out=out) == logs
    assert sorted(file.name for file in (out / "runs").iterdir()) == [f"{log}.json" for log in logs]
    assert redone(ours / "r36ohm.csv", out=out) == ["r36ohm.csv"]
    assert redone(ours, out=out) == []
    assert list(summary(out)) == logs


def test_a_new_date_or_the_same_content_again_redoes_nothing(campaign: Path, done: Path) -> None:
    before = stamps(done)
    for name in LOGS:
        content = (campaign / name).read_bytes()
        (campaign / name).unlink()
        (campaign / name).write_bytes(content)
        os.utime(campaign / name, (0.0, 0.0))
    os.utime(campaign / "campaign.toml", (0.0, 0.0))
    assert redone(campaign, out=done) == []
    assert stamps(done) == before


def test_more_logs_redo_nothing_that_is_there(campaign: Path, out: Path) -> None:
    batch(campaign / "r9ohm.csv", out=out)
    found, seen = batch(campaign / "r9ohm.csv", campaign / "r36ohm.csv", out=out)
    assert (seen.names, seen.kept, found.kept) == (["r36ohm.csv"], 1, 1)
    assert list(summary(out)) == ["r9ohm.csv", "r36ohm.csv"]


@pytest.mark.slow
def test_more_reports_redo_the_logs_that_lack_them(campaign: Path, done: Path) -> None:
    log, out = campaign / "r9ohm.csv", done
    before = contents(out)
    assert redone(log, out=out, reports=["html"]) == ["r9ohm.csv"]
    (out / "runs" / "r9ohm.csv.html").unlink()
    assert redone(log, out=out, reports=["html"]) == ["r9ohm.csv"]
    assert redone(log, out=out, reports=["html"]) == []
    assert redone(campaign, out=out) == []  # fewer reports ask for nothing
    after = contents(out)
    assert after["runs/r36ohm.csv.json"] == before["runs/r36ohm.csv.json"]
    mean = [json.loads(state["runs/r9ohm.csv.json"])["mean"] for state in (before, after)]
    assert mean[0] == mean[1]


@pytest.mark.parametrize("lost", ["campaign.json", "dataset/bins.parquet"])
def test_what_is_lost_of_the_campaign_is_made_again(campaign: Path, done: Path, lost: str) -> None:
    before = contents(done)
    (done / lost).unlink()
    assert redone(campaign, out=done) == []
    assert contents(done) == before


def test_a_damaged_result_is_made_again(campaign: Path, done: Path) -> None:
    before = contents(done)
    path = done / "runs" / "r9ohm.csv.json"
    path.write_bytes(path.read_bytes()[:1000])
    assert redone(campaign, out=done) == ["r9ohm.csv"]
    assert contents(done) == before


@pytest.mark.slow
def test_what_a_call_in_between_did_not_ask_for_is_not_left_of_another_log(
    tmp_path: Path, out: Path
) -> None:
    """With a report and a workbook, then changed and without, then with: what is there is of the
    log as it is now.
    """
    log = tmp_path / "log.csv"
    samples, tiles = [], []
    for name, asked in (("r36ohm.csv", True), ("r9ohm.csv", False), ("r9ohm.csv", True)):
        shutil.copy(FIXTURES / "campaign" / name, log)
        batch(log, out=out, reports=["html"] if asked else [], workbook=asked)
        if asked:
            tiles.append(
                re.findall(
                    r'<span class="value">([^<]*)',
                    (out / "campaign.html").read_text(encoding="utf-8"),
                )
            )
            head, _, row = openpyxl.load_workbook(out / "campaign.xlsx")["runs_all"].values
            samples.append(row[head.index("samples")])
    assert samples == [2767, 3411]
    assert tiles[0] != tiles[1]


def test_no_report_is_left_beside_a_result_of_other_content(tmp_path: Path, out: Path) -> None:
    log = Path(shutil.copy(FIXTURES / "campaign" / "r36ohm.csv", tmp_path / "log.csv"))
    batch(log, out=out, reports=["html"])
    shutil.copy(FIXTURES / "campaign" / "r9ohm.csv", log)
    batch(log, out=out)
    assert [path.name for path in files(out / "runs")] == ["log.csv.json"]


# --------------------------------------------------------------------------------- logs that fail
FAILING = ("not_a_log.csv", "header_only.csv", "missing.csv")


def test_logs_that_fail_are_listed_and_the_others_go_on(campaign: Path, out: Path) -> None:
    for name in FAILING[:2]:
        shutil.copy(FIXTURES / "damaged_logs" / name, campaign)
    with (campaign / "campaign.toml").open("a") as file:
        file.writelines(f'[[run]]\nfile = "{name}"\n' for name in FAILING)
    done = winchcascade("batch", campaign, "--out", out, "--reports", "none", "--jobs", "2")
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    faults = [str(summary(out)[name]["fault"]) for name in FAILING]
    for name, fault in zip(FAILING, faults, strict=True):
        assert fault in " ".join(done.stdout.split())  # its sentence names the log
        assert name in fault
        assert fault.endswith(".")
    assert len(set(faults)) == len(FAILING)
    assert [path.name for path in files(out / "runs")] == [f"{log}.json" for log in LOGS]
    assert (
        winchcascade("batch", campaign, "--out", out, "--reports", "none").returncode == 1
    )  # it is tried again


def test_a_log_that_fails_now_leaves_no_older_result(campaign: Path, out: Path) -> None:
    batch(campaign / "r9ohm.csv", out=out, reports=["html"])
    batch(campaign, out=out)
    shutil.copy(FIXTURES / "damaged_logs" / "not_a_log.csv", campaign / "r9ohm.csv")
    found, seen = batch(campaign, out=out)
    assert list(found.faults) == list(seen.faults) == seen.names == ["r9ohm.csv"]
    assert [path.name for path in files(out / "runs")] == ["r36ohm.csv.json"]
    assert parquet.read_table(out / "dataset" / "runs.parquet")["run"].to_pylist() == ["r36ohm.csv"]


def test_a_campaign_of_which_every_log_fails_still_has_a_report(tmp_path: Path, out: Path) -> None:
    log = FIXTURES / "damaged_logs" / "header_only.csv"
    done = winchcascade("batch", log, "--out", out, "--reports", "html", "--excel")
    assert done.returncode == 1
    assert done.stderr.startswith("failed: ")
    assert "header_only.csv" in (out / "campaign.html").read_text(encoding="utf-8")
    assert parquet.read_table(out / "dataset" / "runs.parquet").num_rows == 0


@pytest.mark.skipif(
    sys.platform != "linux", reason="needs a file system that takes any name of 255 bytes"
)
@pytest.mark.parametrize(
    "name", ["測" * 80 + ".csv", "x" * 251 + ".csv"], ids=["letters of three bytes", "ascii"]
)
def test_a_log_with_the_longest_name_is_reduced(tmp_path: Path, out: Path, name: str) -> None:
    shutil.copy(FIXTURES / "campaign" / "r9ohm.csv", tmp_path / name)
    assert batch(tmp_path / name, out=out)[0].faults == {}


@pytest.mark.skipif(
    sys.platform != "linux", reason="needs a file system that takes any bytes as a name"
)
def test_a_log_whose_name_is_no_unicode_is_reduced(tmp_path: Path, out: Path) -> None:
    log = tmp_path / os.fsdecode(b"log \xff.csv")
    shutil.copy(FIXTURES / "campaign" / "r9ohm.csv", log)
    found, _ = batch(log, out=out)
    assert found.faults == {}
    assert len(files(out / "runs")) == 1


# --------------------------------------------------------------------- no room, and other options
@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
def test_reports_that_find_no_room_leave_the_results_that_are_finished(
    campaign: Path, done: Path, jobs: int
) -> None:
    """A page has 1 MB, a result 40 kB: no file may grow beyond 200 kB."""
    before = contents(done)
    log = str(campaign / "r9ohm.csv")
    command = [
        sys.executable,
        "-m",
        "winchcascade",
        "batch",
        log,
        "--out",
        str(done),
        "--jobs",
        str(jobs),
    ]
    full = ["bash", "-c", 'ulimit -f 200; exec "$0" "$@"', *command]
    ended = subprocess.run(full, capture_output=True, text=True, check=False)
    assert ended.returncode in (1, 2)
    assert "Traceback" not in ended.stderr
    assert "cannot be written" in ended.stdout + ended.stderr
    assert {
        name: content for name, content in contents(done).items() if name.startswith("runs/")
    } == {name: content for name, content in before.items() if name.startswith("runs/")}
    assert list(done.rglob(".*")) == []
    assert redone(campaign, out=done) == []
    assert contents(done).keys() == before.keys()


def test_a_log_that_cannot_be_read_now_leaves_the_result_that_is_finished(
    campaign: Path, done: Path
) -> None:
    before = (done / "runs" / "r9ohm.csv.json").read_bytes()
    (campaign / "r9ohm.csv").rename(campaign / "elsewhere")
    assert list(batch(campaign, out=done)[0].faults) == ["r9ohm.csv"]
    (campaign / "elsewhere").rename(campaign / "r9ohm.csv")
    assert redone(campaign, out=done) == []
    assert (done / "runs" / "r9ohm.csv.json").read_bytes() == before


@ALONE
def test_two_calls_with_different_options_on_one_folder_leave_what_the_last_one_leaves(
    place: Path,
) -> None:
    windows = ("5", "4")
    calls = [begin(place, "--jobs", "1", "--window", window) for window in windows]
    ended = [call.communicate() for call in calls]
    assert [call.returncode for call in calls] == [0, 0], ended
    found = {
        json.loads(path.read_bytes())["window"] for path in (place / "out" / "runs").glob("*.json")
    }
    assert len(found) == 1
    (window,) = found
    rows = parquet.read_table(place / "out" / "dataset" / "cycles.parquet").to_pylist()
    assert {round(row["duration_s"], 6) for row in rows} == {window}
    before = contents(place / "out")
    with begin(place, "--jobs", "1", "--window", f"{window:g}") as again:
        said, _ = again.communicate()
    assert kept(said) == COPIES
    assert contents(place / "out") == before


@ALONE
def test_a_call_waits_for_another_one_and_says_so(
    campaign: Path, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("winchcascade.core.store._SILENT", 0.05)
    out.mkdir()
    script = (
        "import sys\nfrom pathlib import Path\nfrom winchcascade.core.store import locked\n"
        "with locked(Path(sys.argv[1]), print):\n    print('held', flush=True)\n    "
        "sys.stdin.readline()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script, str(out)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as other:
        assert other.stdout is not None
        assert other.stdin is not None
        assert other.stdout.readline() == "held\n"
        held: list[Path] = []

        class Waits(Seen):
            def waiting(self, folder: Path) -> None:
                held.append(folder)
                assert other.stdin is not None
                other.stdin.write("\n")
                other.stdin.flush()

        found = run_batch(make_plan([str(campaign / "r9ohm.csv")]), out, watch=Waits())
    assert held == [out]
    assert found.faults == {}
    assert list(out.rglob(".*")) == []


@ALONE
def test_the_lock_of_a_killed_call_holds_nobody(campaign: Path, out: Path) -> None:
    out.mkdir()
    script = (
        "import os, sys\nfrom pathlib import Path\nfrom winchcascade.core.store import locked\n"
        "with locked(Path(sys.argv[1]), print):\n    os.kill(os.getpid(), 9)\n"
    )
    subprocess.run([sys.executable, "-c", script, str(out)], check=False)
    assert [path.name for path in out.iterdir()] == [".winchcascade.lock"]
    assert batch(campaign, out=out)[0].faults == {}
    assert list(out.rglob(".*")) == []


def test_a_folder_that_cannot_be_locked_is_one_sentence(campaign: Path, out: Path) -> None:
    (out / ".winchcascade.lock").mkdir(parents=True)
    with pytest.raises(
        OutputError,
        match=r"cannot be locked against other calls .* choose a folder that can be written",
    ):
        batch(campaign, out=out)


# --------------------------------------------------------------------------------- the out folder
def test_a_folder_that_holds_something_else_is_rejected_and_used_with_force(
    campaign: Path, out: Path
) -> None:
    out.mkdir()
    (out / "thesis.txt").write_text("mine")
    with pytest.raises(
        OutputError,
        match="is not empty and no folder of a batch; give --out a new folder or add --fo",
    ):
        batch(campaign, out=out)
    assert os.listdir(out) == ["thesis.txt"]
    found, _ = batch(campaign, out=out, force=True)
    assert len(found.results) == 2
    assert (out / "thesis.txt").read_text() == "mine"


@pytest.mark.parametrize(
    "name", ["campaign.json", "index.html", "campaign.html", "campaign.xlsx", "runs/r9ohm.csv.json"]
)
def test_a_file_that_this_tool_did_not_write_is_not_replaced(
    campaign: Path, out: Path, name: str
) -> None:
    (out / "runs").mkdir(parents=True)  # a name that other people give their folders too
    (out / name).write_text("mine")
    with suppress(OutputError):
        batch(campaign / "r9ohm.csv", out=out, reports=["html"], workbook=True)
    assert (out / name).read_text() == "mine"


def test_an_out_that_is_a_file_is_rejected(campaign: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    assert "the folder cannot be made" in one_sentence(
        "batch", campaign, "--out", tmp_path / "file"
    )
    assert (tmp_path / "file").read_text() == "mine"


def test_scratch_of_killed_calls_is_removed_and_no_other_file(campaign: Path, done: Path) -> None:
    left = [
        left_scratch(done, as_folder=True),
        *(left_scratch(done / place) for place in ("runs", "dataset")),
    ]
    others = [
        done / "runs" / ".winchcascade-notes.part",
        done / "runs" / ".a.json.x.part",
        done / "download.part",
    ]
    for path in others:
        path.touch()
    batch(campaign, out=done)
    assert [path.exists() for path in (*left, *others)] == [False] * 3 + [True] * 3


# ----------------------------------------------------------------------- calls that are cut short
def begin(place: Path, *arguments: str) -> subprocess.Popen[str]:
    """A call in a folder that holds logs, in a group of processes of its own."""
    command = [
        sys.executable,
        "-m",
        "winchcascade",
        "batch",
        "logs",
        "--out",
        "out",
        "--reports",
        "none",
        *arguments,
    ]
    return subprocess.Popen(
        command,
        cwd=place,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def wait_for(call: subprocess.Popen[str], place: Path, pattern: str, number: int) -> None:
    """Wait until so many files are there, or the call has ended."""
    while call.poll() is None and len(list((place / "out").glob(pattern))) < number:
        with suppress(subprocess.TimeoutExpired):
            call.wait(0.001)


def with_logs(place: Path) -> Path:
    (place / "logs").mkdir(parents=True)
    for k in range(COPIES):
        shutil.copy(FIXTURES / "campaign" / "r36ohm.csv", place / "logs" / f"log {k}.csv")
    return place


@pytest.fixture
def place(tmp_path: Path) -> Path:
    return with_logs(tmp_path / "place")


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Files of a call that nobody cut short."""
    place = with_logs(tmp_path_factory.mktemp("undisturbed"))
    with begin(place, "--jobs", "2") as call:
        assert call.wait() == 0
    found = contents(place / "out")
    assert len(found) == COPIES + 1 + len(TABLES)
    return found


def whole(out: Path) -> dict[str, int]:
    """Dates of the results; every one can be read."""
    for path in files(out):
        if path.suffix == ".json":
            json.loads(path.read_bytes())
        if path.suffix == ".parquet":
            parquet.read_table(path)
    return {name: stamp for name, stamp in stamps(out).items() if name.startswith("runs/")}


def assert_completed(place: Path, undisturbed: dict[str, bytes], done: dict[str, int]) -> None:
    """A further call keeps what was finished and gives what an undisturbed one gives."""
    with begin(place, "--jobs", "2") as call:
        said, _ = call.communicate()
    assert call.returncode == 0
    assert f"{COPIES} of {COPIES} logs reduced" in said
    assert kept(said) == len(done)
    assert contents(place / "out") == undisturbed
    after = stamps(place / "out")
    assert {name: after[name] for name in done} == done


@ALONE
@pytest.mark.parametrize(
    ("pattern", "number", "jobs"),
    [
        pytest.param("runs", 1, "2", marks=pytest.mark.slow),
        pytest.param("runs/*.json", 1, "1", marks=pytest.mark.slow),
        ("runs/*.json", 2, "2"),
        pytest.param("runs/.*.part", 1, "1", marks=pytest.mark.slow),
        pytest.param("dataset", 1, "2", marks=pytest.mark.slow),
    ],
)
def test_a_killed_call_loses_nothing_that_was_finished(
    place: Path, undisturbed: dict[str, bytes], pattern: str, number: int, jobs: str
) -> None:
    with begin(place, "--jobs", jobs) as call:
        wait_for(call, place, pattern, number)
        with suppress(ProcessLookupError):
            os.killpg(call.pid, signal.SIGKILL)
        call.communicate()
    finished = whole(place / "out")
    assert len(finished) >= number * (pattern == "runs/*.json")
    assert_completed(place, undisturbed, finished)


@ALONE
@pytest.mark.parametrize(
    "by",
    [signal.SIGKILL, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)],
    ids=["kill", "term"],
)
def test_a_killed_call_leaves_no_process_behind(place: Path, by: signal.Signals) -> None:
    """Its processes hold its standard output; where one stays, that never ends."""
    with begin(place, "--jobs", "2") as call:
        wait_for(call, place, "runs/*.json", 1)
        call.send_signal(by)
        try:
            call.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            os.killpg(call.pid, signal.SIGKILL)
            pytest.fail("processes of the call are still there")


@ALONE
@pytest.mark.slow
@pytest.mark.parametrize(
    ("jobs", "to"),
    [("2", "all its processes"), ("1", "the call"), ("2", "the call")],
)
def test_an_interrupt_is_one_sentence_and_loses_nothing(
    place: Path, undisturbed: dict[str, bytes], jobs: str, to: str
) -> None:
    with begin(place, "--jobs", jobs) as call:
        wait_for(call, place, "runs/*.json", 1)
        (os.kill if to == "the call" else os.killpg)(call.pid, signal.SIGINT)
        out, err = call.communicate()
    assert call.returncode == 130
    assert out == ""
    assert list((place / "out").rglob(".*")) == []
    assert_completed(place, undisturbed, whole(place / "out"))
    err = without_progress(err)
    assert err.startswith("winchcascade: interrupted; ")
    assert err.count("\n") == 1
    assert int(err.split()[2]) <= len(list((place / "out").glob("runs/*.json")))


@ALONE
def test_an_interrupt_before_the_first_result_is_one_sentence(place: Path) -> None:
    with begin(place, "--jobs", "2") as call:
        wait_for(call, place, "runs", 1)
        os.killpg(call.pid, signal.SIGINT)
        _, err = call.communicate()
    assert call.returncode == 130
    assert without_progress(err).startswith("winchcascade: interrupted; ")
    assert err.endswith("no file was left half-written.\n")


@pytest.mark.slow
def test_two_calls_at_once_on_one_folder_leave_what_one_leaves(
    place: Path, undisturbed: dict[str, bytes]
) -> None:
    with begin(place, "--jobs", "1") as one, begin(place, "--jobs", "2") as other:
        ended = [call.communicate() for call in (one, other)]
    assert [
        (call.returncode, without_progress(err))
        for call, (_, err) in zip((one, other), ended, strict=True)
    ] == [
        (0, ""),
        (0, ""),
    ]
    assert contents(place / "out") == undisturbed
    assert list((place / "out").rglob(".*")) == []
