"""Drafts of campaign.toml and rig.toml: what is certain, what is not, and that they can be used
as they are.
"""

import json
import math
import re
import runpy
import shutil
import sys
from pathlib import Path

import pytest
from calls import call, error_sentence
from daily import daily

from winchcascade import read_run
from winchcascade.batch.draft_folder import draft_folder, write_drafts
from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.errors import OptionError, OutputError
from winchcascade.core.rig_toml import built_in
from winchcascade.ingest.named_load import named_loads
from winchcascade.rig.baseline import load_rig, model_of
from winchcascade.rig.parts import Model, with_part

FIXTURES = Path(__file__).parents[2] / "fixtures"
OTHER = FIXTURES / "other_rig"
BENCHES = Path(__file__).parents[3] / "shared" / "data" / "benches"

LAST_DIGITS = 0.01
"""Share of the rows in which another version of numpy may round a digit differently. [1]"""

FILLED_IN = """\
force = "LC-17 [kN]"
torque = "Mw [Nm]"
r_drum = { value = 0.2, unit = "m" }
inertia = { value = 0.6, unit = "kg.m2" }
p_precharge = { value = 16, unit = "bar", u_percent = 0.1 }
volume_gas = { value = 5.0, unit = "L", u_percent = 0.3 }
gear_ratio = { value = 30, unit = "1" }
b_rotor = { value = 1.2e-3, unit = "N.m.s/rad", u_percent = 20 }
inertia_rotor = { value = 1.5e-3, unit = "kg.m2" }
pole_pairs = { value = 3, unit = "1" }
k_e = { value = 0.130, unit = "V/rpm", limits_percent = 5 }
r_s = { value = 0.90, unit = "ohm", u_percent = 0.5 }
l_s = { value = 6.0, unit = "mH", u_percent = 0.7 }"""
"""What the owner of the other rig fills in: the two columns that no reader can know, and numbers
of its data sheets.
"""


def copied(folder: Path, source: Path, **names: str) -> Path:
    """The logs of a folder in another one, some under other names."""
    folder.mkdir()
    for log in source.iterdir():
        if log.suffix in (".csv", ".tdms"):
            shutil.copy(log, folder / names.get(log.stem, log.name))
    return folder


def fill_in(rig: Path) -> None:
    """Replace the comments of a draft by the lines of its owner."""
    text = rig.read_text()
    for line in FILLED_IN.splitlines():
        drafted = re.findall(rf"(?m)^# {line.split(' =')[0]} = .*$", text)
        assert len(drafted) == 1, line
        text = text.replace(drafted[0], line)
    rig.write_text(text)


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    return copied(tmp_path / "bench", OTHER)


@pytest.fixture(scope="module")
def drafted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The logs of the other rig with their drafts, which tests of one file leave as they are."""
    folder = copied(tmp_path_factory.mktemp("drafted") / "bench", OTHER)
    write_drafts(draft_folder(folder), folder)
    return folder


@pytest.mark.parametrize(
    ("name", "ohm"),
    [
        ("r36ohm", 36.0), ("36_ohm", 36.0), ("R=4,5 Ohm", 4.5), ("4p5 Ohm", 4.5), ("4R5ohm", 4.5), ("run03_R018", 18.0),
        ("test 2 kOhm", 2000.0), ("lauf5_8p5ohm", 8.5), ("2026-05-14_r_load_27", 27.0), ("36Ω", 36.0),
        ("open_circuit", math.inf), ("Leerlauf", math.inf), ("run1_oc", math.inf), ("no load 2", math.inf),
    ],
)  # fmt: skip
def test_a_name_with_a_unit_or_a_symbol_states_its_load(name: str, ohm: float) -> None:
    stated = named_loads([f"{name}.csv"])[f"{name}.csv"]
    assert (stated.ohm, stated.certain) == (ohm, True)


@pytest.mark.parametrize("names", [["Last36", "Last18"], ["36", "18"], ["t2_36", "t2_18"]])
def test_a_number_without_a_unit_may_be_the_load_but_is_not_certain(names: list[str]) -> None:
    stated = named_loads(names)
    assert [(stated[name].ohm, stated[name].certain) for name in names] == [
        (36.0, False),
        (18.0, False),
    ]


@pytest.mark.parametrize(
    "names",
    [
        ["2025-04-16_13-48-06.csv", "2025-04-16_14-54-05.csv"],
        ["voc_level.csv", "record.csv"],
        ["run_a.csv", "run_b.csv"],
    ],
)
def test_dates_and_words_that_contain_others_state_no_load(names: list[str]) -> None:
    assert named_loads(names) == {}


def test_the_names_r1_to_r3_may_number_the_runs() -> None:
    assert not any(one.certain for one in named_loads(["r1.csv", "r2.csv", "r3.csv"]).values())


def test_the_campaign_of_another_rig_has_its_loads_in_the_order_of_the_clocks(
    drafted: Path,
) -> None:
    runs = load_campaign(drafted).runs
    truth = json.loads((OTHER / "ORIGIN.json").read_text())["loads_ohm"]
    stated = {run.file.stem: "open circuit" if run.load == math.inf else run.load for run in runs}
    assert stated == truth
    assert [run.started for run in runs] == sorted(run.started for run in runs if run.started)


def test_without_names_the_currents_show_the_open_circuit_and_loads_are_comments(
    tmp_path: Path,
) -> None:
    nameless = {
        log.stem: f"{letter}.csv"
        for letter, log in zip("gfedcba", sorted(OTHER.glob("*.csv")), strict=True)
    }
    folder = copied(tmp_path / "nameless", OTHER, **nameless)
    text = draft_folder(folder).texts["campaign.toml"]
    assert re.findall(r'"(\w)\.csv"\nload_ohm = inf', text) == ["g"]
    guessed = [float(ohm) for ohm in re.findall(r"(?m)^# load_ohm = (\S+)", text)]
    assert guessed == pytest.approx([40, 15, 90, 8.5, 60, 25], rel=0.01)


def test_a_name_that_the_currents_contradict_is_a_comment(tmp_path: Path) -> None:
    folder = copied(
        tmp_path / "wrong", OTHER, lauf2_40ohm="lauf2_20ohm.csv", lauf1_leerlauf="lauf1_70ohm.csv"
    )
    text = draft_folder(folder).texts["campaign.toml"]
    assert re.findall(r'"(\w+)\.csv"\n# load_ohm = (\d+)', text) == [
        ("lauf1_70ohm", "70"),
        ("lauf2_20ohm", "20"),
    ]


def test_the_rig_of_a_whole_cascade_is_based_on_the_papers_and_names_both_candidates(
    drafted: Path,
) -> None:
    text = (drafted / "rig.toml").read_text()
    assert 'based_on = "hsu2026"' in text
    assert [re.findall(rf'(?m)^# {c} = {{ name = "(.*?)"', text) for c in ("force", "torque")] == [
        ["LC-17 [kN]"],
        ["Mw [Nm]"],
    ]


def test_every_number_of_the_model_is_drafted_with_unit_and_value_of_the_paper(
    drafted: Path, tmp_path: Path
) -> None:
    draft, rig = (drafted / "rig.toml").read_text(), tmp_path / "rig.toml"
    numbers = re.findall(r"(?m)^# (\w+ = \{ value = .*?\})", draft)
    assert len(numbers) >= 20
    text = draft.replace('based_on = "hsu2026"', "")
    rig.write_text(re.sub(r"(?m)^# (\w+ = \{ value = )", r"\1", text))
    model = model_of(load_rig(rig))
    assert isinstance(model, Model)
    paper = model_of(built_in("hsu2026"))
    assert isinstance(paper, Model)
    # these follow from machine and motion, where the file states neither
    model = with_part(model, "generator", i_rated=paper.generator.i_rated)
    assert with_part(model, "winch", stribeck_speed=paper.winch.stribeck_speed) == paper


def test_thirteen_lines_turn_the_draft_into_a_rig_that_gives_every_efficiency(
    drafted: Path, tmp_path: Path
) -> None:
    for name in ("campaign.toml", "rig.toml", "lauf2_40ohm.csv"):
        shutil.copy(drafted / name, tmp_path)
    fill_in(tmp_path / "rig.toml")
    found = json.loads(call("reduce", tmp_path / "lauf2_40ohm.csv", "--json", "-").out)
    assert found["log"]["load_ohm"] == 40.0
    assert found["quality"] == []
    assert found["mean"]["eta_pto"] == pytest.approx(0.729, abs=0.002)


@pytest.mark.slow
def test_the_logs_of_the_other_rig_are_those_of_their_script(tmp_path: Path) -> None:
    runpy.run_path(str(OTHER / "make.py"))["main"](tmp_path)
    for made in tmp_path.iterdir():
        pairs = zip(
            made.read_text().splitlines(), (OTHER / made.name).read_text().splitlines(), strict=True
        )
        differing = sum(one != other for one, other in pairs)
        assert differing <= LAST_DIGITS * 3000, made.name


@pytest.mark.slow
def test_from_the_folder_to_the_hidden_effect(bench: Path) -> None:
    write_drafts(draft_folder(bench), bench)
    fill_in(bench / "rig.toml")
    calibrated = bench / "calibrated.toml"
    call("calibrate", bench / "lauf1_leerlauf.csv", "--write", calibrated)
    found = json.loads(call("diagnose", bench, "--rig", calibrated, "--json", "-").out)
    (cause,) = found["causes"]
    rise = cause["parameters"]["r_s_change"]
    assert cause["effect"] == "copper_heating"
    assert rise["low"] < 0.35 < rise["high"]


FOLDERS = [
    folder
    for folder in (*FIXTURES.glob("*"), *FIXTURES.glob("measured/*"), *BENCHES.glob("*"))
    if folder.is_dir()
]


@pytest.mark.parametrize("source", daily(FOLDERS, FOLDERS[::8]), ids=lambda folder: folder.name)
def test_drafts_of_any_folder_can_be_used_as_they_are(source: Path, tmp_path: Path) -> None:
    folder = tmp_path / 'a "folder" – ä'
    shutil.copytree(source, folder, copy_function=shutil.copyfile)
    folder.chmod(0o755)
    for there in folder.glob("*.toml"):
        there.unlink()
    drafts = draft_folder(folder)
    write_drafts(drafts, folder)
    listed = {run.file.name for run in load_campaign(folder).runs}
    assert load_rig(folder / "rig.toml").name == folder.name
    assert listed.isdisjoint(drafts.skipped)
    files = {path.name for path in source.iterdir() if path.is_file() and path.suffix != ".toml"}
    assert listed | drafts.skipped.keys() == files


def test_a_log_without_payouts_gets_the_source_of_cycles_that_it_has(tmp_path: Path) -> None:
    folder = copied(tmp_path / "steps", FIXTURES / "measured")
    text = draft_folder(folder).texts["rig.toml"]
    assert re.search(r"(?m)^# from = ", text)
    assert re.search(r"(?m)^# sample_rate_hz = ", text)


def test_a_speed_of_rotation_shows_gear_over_radius(tmp_path: Path) -> None:
    speeds = [abs(k % 100 - 50) / 50 for k in range(400)]
    rows = "".join(
        f"{0.04 * k:.2f},{v},{v / 0.2 * 30 / math.pi},{50 + 9 * v}\n" for k, v in enumerate(speeds)
    )
    (tmp_path / "a.csv").write_text(
        "Time (s),Velocity (m/s),Shaft speed (rpm),Torque (N.m)\n" + rows
    )
    assert re.search(r"(?m)^# r_drum = .* 5 rad/m", draft_folder(tmp_path).texts["rig.toml"])


def test_columns_that_no_name_explains_are_candidates_of_what_is_missing(tmp_path: Path) -> None:
    folder = tmp_path / "plain"
    folder.mkdir()
    rows = "".join(
        f"{0.04 * k:.2f},{k % 50},{k % 7},{300 + k % 9},{k % 11},{k % 13},{k % 17}\n"
        for k in range(200)
    )
    for name in ("R060.csv", "R040.csv"):
        (folder / name).write_text("time_ms,line speed (ft/s),LC1,P_acc,Tq,DC bus,I_load\n" + rows)
    text = draft_folder(folder).texts["rig.toml"]
    assert 'based_on = "hsu2026"' in text
    assert [re.findall(rf'(?m)^# {c} = {{ name = "(.*?)"', text) for c in ("force", "vdc")] == [
        ["LC1", "DC bus"]
    ] * 2
    assert len(re.findall(r"(?m)^# pressure = .* beyond 204 kg/cm2", text)) == 1


SPANISH = {
    "Zeit": "Fecha y hora", "Weg": "Recorrido", "Seilgeschwindigkeit": "Velocidad cable", "Speicherdruck": "Presión gas",
    "LC-17": "Celda 3", "Mw": "TQ2", "Zwischenkreisspannung": "Tensión bus CC", "Zwischenkreisstrom": "Corriente bus",
}  # fmt: skip
"""Headers of the other rig as a second logger writes them."""


def test_a_folder_of_several_kinds_of_logs_gets_one_entry_for_each_channel(bench: Path) -> None:
    for log in ("lauf2_40ohm", "lauf4_90ohm"):
        head, _, rows = (bench / f"{log}.csv").read_text(encoding="utf-8").partition("\n")
        for german, spanish in SPANISH.items():
            head = head.replace(german, spanish)
        (bench / f"{log}.csv").write_text(f"{head}\n{rows}", encoding="utf-8")
    write_drafts(draft_folder(bench), bench)
    rig = bench / "rig.toml"
    drafted = re.sub(r"(?m)^# (force|torque) = ", r"\1 = ", rig.read_text(encoding="utf-8"))
    rig.write_text(drafted, encoding="utf-8")
    assert load_rig(rig).columns["force"].names == ("LC-17 [kN]", "Celda 3 [kN]")
    for log in ("lauf2_40ohm", "lauf3_15ohm"):
        run = read_run(bench / f"{log}.csv")
        assert [finding.kind for finding in run.findings] == []
        assert run.channels.keys() >= {
            "displacement",
            "velocity",
            "pressure",
            "force",
            "torque",
            "vdc",
            "idc",
        }


@pytest.mark.parametrize("name", ["Time", "Mark"])
def test_a_clock_that_reduce_rejects_is_reported_by_the_draft(name: str, tmp_path: Path) -> None:
    rows = "".join(f"mark {k},{abs(k % 100 - 50) / 50},{50 + k % 7},{k % 9}\n" for k in range(400))
    log = tmp_path / "a_27ohm.csv"
    log.write_text(f"{name},Velocity (m/s),Force (N),Torque (N.m)\n{rows}")
    texts = draft_folder(tmp_path).texts
    (fault,) = re.findall(r"(?m)^# not readable yet: (.*)$", texts["campaign.toml"])
    assert " ".join(fault.split()[1:9]) in error_sentence(["reduce", log, "--load-ohm", "27"])
    assert ("# sample_rate_hz = " in texts["rig.toml"]) == (name == "Mark")


def test_files_that_are_there_stay_and_their_columns_are_used(bench: Path) -> None:
    own = 'name = "mine"\n[columns]\nforce = "LC-17"\ntorque = "Mw"\n'
    (bench / "rig.toml").write_text(own)
    drafts = draft_folder(bench)
    assert drafts.texts.keys() == {"campaign.toml"}
    write_drafts(drafts, bench)
    assert (bench / "rig.toml").read_text() == own
    with pytest.raises(OutputError):
        write_drafts(drafts, bench)


def test_a_built_in_rig_by_name_replaces_the_draft(tmp_path: Path) -> None:
    folder = copied(tmp_path / "logs", FIXTURES / "campaign")
    drafts = draft_folder(folder, "hsu2026")
    write_drafts(drafts, folder)
    assert [*drafts.texts] == ["campaign.toml"]
    assert load_campaign(folder).rig == "hsu2026"


@pytest.mark.parametrize("kind", ["nothing", "file", "empty", "no log"])
def test_a_folder_without_logs_is_rejected(tmp_path: Path, kind: str) -> None:
    folder = tmp_path / "logs"
    if kind == "file":
        folder.write_text("Time (s)\n")
    elif kind != "nothing":
        folder.mkdir()
    if kind == "no log":
        (folder / "notes.txt").write_text("")
    with pytest.raises(OptionError, match="logs"):
        draft_folder(folder)
    assert str(folder) in error_sentence(["init", folder])


@pytest.mark.skipif(sys.platform != "linux", reason="other systems allow no such names")
def test_names_of_any_kind_are_listed_and_one_that_is_no_text_is_named(tmp_path: Path) -> None:
    odd = ['a\n27 ohm # "x".csv', "b'36 ohm'.csv"]
    for name in [*odd, "\udcff_18ohm.csv"]:
        shutil.copy(FIXTURES / "campaign" / "r36ohm.csv", tmp_path / name)
    drafts = draft_folder(tmp_path)
    write_drafts(drafts, tmp_path)
    assert sorted(run.file.name for run in load_campaign(tmp_path).runs) == odd
    assert [*drafts.skipped] == ["\udcff_18ohm.csv"]


def test_results_of_this_tool_are_no_logs(bench: Path) -> None:
    for log in bench.glob("lauf[2-9]*.csv"):
        log.unlink()
    call("reduce", bench / "lauf1_leerlauf.csv", "--json", bench / "lauf1.json")
    (bench / "map.csv").write_text(
        "# Loss map by winchcascade/0.1.0 from other\nspeed,torque\n" + "1,2\n" * 20
    )
    assert {"lauf1.json", "map.csv"} <= draft_folder(bench).skipped.keys()
