"""Log and simulation in the reports: tables as recomputed, captions that tell what is what, figures with units and names."""

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib
import msgspec
import numpy as np
import pytest
from compared import FIXTURES, KGCM2, LOGS, compared, reduced
from undrawn import undrawn

from winchcascade.batch.plan import make_plan
from winchcascade.batch.run_batch import Products, run_batch
from winchcascade.core.campaign_file import SIMULATED
from winchcascade.diagnosis.loss_budget import GROUPS
from winchcascade.diagnosis.model_account import Account, Modelled, Regression, account_of, modelled
from winchcascade.diagnosis.model_comparison import ModelComparison, compare
from winchcascade.reduction.campaign_record import campaign_from
from winchcascade.reduction.montecarlo import uncertainty
from winchcascade.report import model_figures as figures
from winchcascade.report.campaign import make_campaign_report
from winchcascade.report.content import Note, Picture, Section, Table
from winchcascade.report.figures.style import house_style
from winchcascade.report.model_figures import back_emf_figure, budget_bars, damper_sweep
from winchcascade.report.model_section import (
    GENERATOR,
    LOSSES,
    TETHER,
    Named,
    campaign_section,
    run_section,
)
from winchcascade.report.results.drawn_reduction import drawn_report
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.catalogue import make_effect
from winchcascade.rig.open_rig import load_rig


@pytest.fixture(scope="module")
def found() -> dict[str, Modelled]:
    return {name: modelled(reduced(name)) for name in LOGS}


@pytest.fixture(scope="module")
def sections(found: dict[str, Modelled]) -> dict[str, Section]:
    with house_style():
        return {name: run_section(one) for name, one in found.items()}


@pytest.fixture
def style() -> Iterator[None]:
    with house_style():
        yield


def table(section: Section, name: str) -> Table[Any]:
    (one,) = (b for b in section.blocks if isinstance(b, Table) and b.id == name)
    return one


def captions(section: Section) -> dict[str, str]:
    return {b.id: b.caption for b in section.blocks if isinstance(b, Picture)}


# ------------------------------------------------------------------------------------------------- the report of one log
def test_a_loaded_log_has_tether_generator_losses_and_budget(sections: dict[str, Section]) -> None:
    assert list(captions(sections["18 ohm"])) == ["model-tether", "model-generator", "model-losses", "model-budget"]
    assert sections["18 ohm"].folded


def test_an_open_circuit_has_damper_and_back_emf_instead(
    found: dict[str, Modelled], sections: dict[str, Section]
) -> None:
    names = captions(sections["open circuit"])
    assert list(names) == ["model-tether", "model-damper", "model-emf", "model-budget"]
    fit = found["open circuit"].account.regression
    assert fit is not None
    assert all(f"{x:.5f}" in names["model-emf"] for x in (fit.slope, fit.low, fit.high))


def test_the_differences_in_the_table_are_those_of_the_channels(
    found: dict[str, Modelled], sections: dict[str, Section]
) -> None:
    comparison = found["18 ohm"].comparison
    assert comparison is not None
    log, model = comparison.run.channels, comparison.simulation.run.channels
    rows = np.concatenate(
        [
            np.flatnonzero((comparison.run.t >= c.phases.onset) & (comparison.run.t <= c.phases.payout_end))
            for c in comparison.cycles
        ]
    )
    channels = {"torque": ("N·m", 1.0), "vdc": ("V", 1.0), "idc": ("A", 1.0), "pressure": ("kg/cm²", KGCM2),
                "force": ("N", 1.0)}  # fmt: skip
    cells = table(sections["18 ohm"], "differences").cells
    assert len(cells) == len(channels)
    for (_, unit, bias, rms), (channel, (named, factor)) in zip(cells, channels.items(), strict=True):
        apart = (log[channel] - model[channel])[rows] / factor
        assert unit == named
        assert bias == pytest.approx(np.mean(apart))
        assert rms == pytest.approx(np.sqrt(np.mean(apart**2)))


def test_the_budget_table_sums_to_the_energy_of_the_line(sections: dict[str, Section]) -> None:
    for section in sections.values():
        shown = table(section, "loss-budget")
        *parts, whole = shown.cells
        for k in (1, 2):
            assert sum(float(str(row[k])) for row in parts) == pytest.approx(float(str(whole[k])), rel=1e-3)
        assert whole[2] == pytest.approx(100.0)
        names = [row[0] for row in parts]
        wanted = ["stored gas", "screw", "line losses", "inertia", "mesh", "damper", "copper", "diodes", "DC link"]
        assert [name for name in names if name in wanted] == wanted


def test_a_simulated_log_is_nowhere_called_measured() -> None:
    reduction = reduced("18 ohm")
    reduction = msgspec.structs.replace(reduction, run=msgspec.structs.replace(reduction.run, origin=SIMULATED))
    with house_style():
        section = run_section(modelled(reduction))
    texts = [section.heading, *captions(section).values(), *(b.text for b in section.blocks if isinstance(b, Note))]
    assert not re.search("measured", " ".join(texts), re.IGNORECASE)


def test_a_rig_without_a_model_has_the_reason_instead_of_figures() -> None:
    reduction = msgspec.structs.replace(reduced("18 ohm"), rig=load_rig("kitepower"))
    (note,) = run_section(modelled(reduction)).blocks
    assert isinstance(note, Note)
    assert note.text.startswith("the rig file of kitepower lacks what a model needs")


@pytest.mark.parametrize("missing", ["torque", "pressure", "vdc", "displacement"])
def test_what_a_log_lacks_is_neither_drawn_nor_reported(missing: str) -> None:
    reduction = reduced("18 ohm")
    channels = {name: x for name, x in reduction.run.channels.items() if name != missing}
    run = msgspec.structs.replace(reduction.run, channels=channels)
    reduction = msgspec.structs.replace(reduction, run=run)
    with house_style():
        section = run_section(modelled(reduction))
    names, shown = captions(section), [str(row[0]) for row in table(section, "differences").cells]
    if missing == "torque":
        assert "model-losses" not in names
        assert "torque of the PTO shaft" not in names["model-generator"].lower()
        assert "torque" not in shown
    elif missing in ("pressure", "displacement"):
        assert "pressure" not in names["model-tether"].lower()
        assert ("pressure" in shown) == (missing == "displacement")
    else:
        assert "power at the dc link" not in names["model-tether"].lower()


def test_a_model_with_an_effect_says_so_in_every_caption() -> None:
    reduction = reduced("18 ohm")
    model = make_effect("gear_mesh_loss", {"efficiency_change": -0.05}).apply(baseline(reduction.rig))
    comparison = compare(reduction, model, changed="gear_mesh_loss")
    assert isinstance(comparison, ModelComparison)
    with house_style():
        section = run_section(Modelled(comparison, account_of(comparison)))
    assert all("with gear_mesh_loss" in caption for caption in captions(section).values())


def test_the_section_stands_in_the_report_of_a_log() -> None:
    reduction = reduced("18 ohm")
    report = drawn_report(reduction, uncertainty(reduction))
    assert [s.folded for s in report.sections if s.id == "model"] == [True]


# ----------------------------------------------------------------------------------------------------------- the figures
def test_log_is_a_line_and_simulation_markers_of_another_colour(found: dict[str, Modelled], style: None) -> None:
    curves = found["18 ohm"].account.curves
    figure = figures.panels([figures.Drawn("", curves)], GENERATOR, word="measured", rated=2000.0)
    assert figure is not None
    for name, ax in zip(GENERATOR, figure.axes, strict=True):
        lines = [line for line in ax.lines if len(np.asarray(line.get_xdata())) == len(curves[name].x)]
        log, simulated = lines
        assert (log.get_linestyle(), log.get_marker()) == ("-", "None")
        assert (simulated.get_linestyle(), simulated.get_marker()) == ("None", "o")
        assert log.get_color() != simulated.get_markeredgecolor()
        assert tuple(np.asarray(log.get_ydata())) == curves[name].log
        assert tuple(np.asarray(simulated.get_ydata())) == curves[name].simulated
        assert re.search(r"\(.+\)", ax.get_xlabel())
        assert ax.get_ylabel()
    texts = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert texts == ["measured", "simulated", "over rated speed"]


def test_every_load_has_a_colour_and_a_marker_of_its_own(found: dict[str, Modelled], style: None) -> None:
    names = [f"{k} Ω" for k in range(7)]
    drawn = figures.styled_by_load(names, [found["18 ohm"].account.curves] * 7)
    assert len({d.log for d in drawn}) == len({d.mark for d in drawn}) == 7
    figure = figures.panels(drawn, TETHER, word="log", rated=2000.0)
    assert figure is not None
    texts = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert texts == ["log", "simulated", "over rated speed", *names]
    marks = [line for line in figure.axes[2].lines if line.get_marker() not in ("None", "")]
    assert len({line.get_marker() for line in marks}) == 7


def test_the_drum_turns_slower_than_the_generator_by_the_gear(found: dict[str, Modelled], style: None) -> None:
    drawn = [figures.Drawn("", found["18 ohm"].account.curves)]
    figure = figures.panels(drawn, GENERATOR[:1], word="log", rated=2000.0, gear=50.0)
    assert figure is not None
    figure.draw_without_rendering()
    (ax,) = figure.axes
    (above,) = ax.child_axes
    assert np.array(above.get_xlim()) * 50.0 == pytest.approx(np.array(ax.get_xlim()))
    assert above.get_xlabel() == "Drum speed (rpm)"


def test_without_a_curve_there_is_no_figure(style: None) -> None:
    assert figures.panels([figures.Drawn("", {})], LOSSES, word="log", rated=None) is None


def test_bars_end_at_a_hundred_percent_and_the_points_are_shares_of_the_log(
    found: dict[str, Modelled], style: None
) -> None:
    budgets = [found[name].account.budget for name in LOGS]
    given = [b for b in budgets if b is not None]
    figure = budget_bars(list(LOGS), given, word="measured")
    (ax,) = figure.axes
    bars = [p for p in ax.patches if isinstance(p, matplotlib.patches.Rectangle)]
    for row, budget in zip((1.0, 0.0), given, strict=True):
        mine = [b for b in bars if b.get_y() < row < b.get_y() + b.get_height()]
        assert sum(b.get_width() for b in mine) == pytest.approx(100.0, abs=0.1)
        assert max(b.get_x() + b.get_width() for b in mine) == pytest.approx(100.0, abs=0.1)
        points = [
            float(np.asarray(line.get_xdata()).item()) for line in ax.lines
            if line.get_marker() in ("D", "s") and abs(float(np.asarray(line.get_ydata()).item()) - row) < 0.5
        ]  # fmt: skip
        log = budget.log
        assert points == pytest.approx([100.0 * log[s] / log["line"] for s in ("gen", "mech") if s in log])
    texts = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert {"DC link", "copper", "stored gas", "DC link, measured", "shaft, measured", "shaft, simulated"} <= set(texts)
    assert len([row for row in GROUPS if GROUPS[row].name in texts]) == len(texts) - 3


def test_the_sweep_names_every_damper(found: dict[str, Modelled], style: None) -> None:
    sweep = found["open circuit"].account.sweep
    assert sweep is not None
    figure = damper_sweep(sweep, word="log", rated=2000.0)
    texts = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert texts == ["log", "no damper", "0.5 ×", "as in the rig file", "1.5 ×", "2 ×", "over rated speed"]
    (ax,) = figure.axes
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Generator speed (rpm)", "Line tension (N)")


def test_the_back_emf_is_drawn_with_its_slope_and_that_of_the_rig_file(style: None) -> None:
    rpm = np.linspace(1000.0, 3000.0, 20)
    v_ll, v_dc = tuple((0.062 * rpm).tolist()), tuple((0.0875 * rpm).tolist())
    fit = Regression(tuple(rpm.tolist()), v_ll, v_dc, 0.062, 0.0619, 0.0621, 0.998, rpm.size, 0.0617)
    figure = back_emf_figure(fit, word="measured")
    right = figure.axes[1]
    slopes = [
        np.diff(np.asarray(line.get_ydata()))[0] / np.diff(np.asarray(line.get_xdata()))[0] for line in right.lines[:2]
    ]
    assert slopes == pytest.approx([0.0617, 0.062])
    (text,) = right.texts
    assert text.get_text() == "0.06200 V/rpm\n95 %: 0.06190 to 0.06210\nR² = 0.9980"


# ------------------------------------------------------------------------------------------------ the report of a campaign
@pytest.fixture(scope="module")
def batch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A batch with pages of two loads, an open circuit, and a log of which no load is known."""
    folder = tmp_path_factory.mktemp("campaign")
    runs = {"open_circuit.csv": "inf", "r18ohm.csv": "18.0", "r4p5ohm.csv": "4.5", "r45ohm.csv": None}
    text = 'title = "Trials"\nmeasured = true\n'
    for name, load in runs.items():
        shutil.copy(FIXTURES / "campaign" / name, folder)
        text += f'[[run]]\nfile = "{name}"\n' + ("" if load is None else f"load_ohm = {load}\n")
    (folder / "campaign.toml").write_text(text)
    with undrawn():
        run_batch(make_plan([str(folder)]), folder / "out", Products(reports=("html",)))
    return folder / "out"


@pytest.fixture(scope="module")
def campaign(batch: Path) -> Section:
    loads = {
        "open_circuit.csv": "open circuit",
        "r18ohm.csv": "18 ohm",
        "r4p5ohm.csv": "4.5 ohm",
        "r45ohm.csv": "r45ohm.csv",
    }
    accounts = {name: json.loads((batch / "runs" / f"{name}.json").read_bytes())["model"] for name in loads}
    logs = [Named(name, load, msgspec.convert(accounts[name], Account)) for name, load in loads.items()]
    with house_style():
        section = campaign_section(logs, "measured")
    assert section is not None
    return section


def test_a_campaign_shows_all_loads_in_each_figure(batch: Path, campaign: Section) -> None:
    assert list(captions(campaign)) == [
        "model-tether", "model-torque", "model-generator", "model-losses", "model-damper", "model-emf", "model-budget",
    ]  # fmt: skip
    drawn = {b.id: b.figure for b in campaign.blocks if isinstance(b, Picture)}
    legend = [text.get_text() for one in drawn["model-torque"].legends for text in one.get_texts()]
    assert {"18 ohm", "4.5 ohm"} <= set(legend)
    assert "open circuit" not in legend
    report = make_campaign_report(campaign_from(json.loads((batch / "campaign.json").read_bytes())), batch)
    (model,) = (one for one in report.sections if one.id == "model")
    assert len(model.blocks) == len(campaign.blocks)


def test_a_campaign_shows_which_logs_were_not_simulated_and_why(campaign: Section) -> None:
    first = campaign.blocks[0]
    assert isinstance(first, Note)
    assert first.text.startswith("r45ohm.csv: the load of the log is not known")


def test_the_tables_of_a_campaign_hold_the_numbers_of_its_logs(campaign: Section) -> None:
    shown = table(campaign, "differences")
    at = [column.name for column in shown.columns].index("τ bias")
    rows = {row[0]: row for row in shown.cells}
    assert list(rows) == ["open_circuit.csv", "r18ohm.csv", "r4p5ohm.csv"]
    assert {row[0]: row[at] for row in shown.texts}["open_circuit.csv"] == "-"
    c = compared(reduced("18 ohm"))
    apart = (c.run.channels["torque"] - c.simulation.run.channels["torque"])[c.payout]
    assert rows["r18ohm.csv"][at] == pytest.approx(np.mean(apart), abs=0.001)
    for row in table(campaign, "loss-budget").cells:
        assert sum(float(str(cell)) for cell in row[2:]) == pytest.approx(float(str(row[1])), rel=2e-3)


def test_a_result_keeps_its_curves_and_little_more(batch: Path) -> None:
    record = json.loads((batch / "runs" / "r18ohm.csv.json").read_bytes())
    assert len(json.dumps(record["model"])) < 16_000
    assert record["model"]["curves"]["torque_nm"]["x"][0] == 150.0
    left_out = json.loads((batch / "runs" / "r45ohm.csv.json").read_bytes())["model"]
    assert set(left_out) <= {"why", "word"}


def test_a_campaign_that_names_itself_rebuilt_is_not_called_measured(found: dict[str, Modelled]) -> None:
    logs = [Named(name, name, one.account) for name, one in found.items()]
    with house_style():
        section = campaign_section(logs, "log")
    assert section is not None
    assert section.heading == "Log and simulation"
    assert not re.search("measured", " ".join(captions(section).values()), re.IGNORECASE)


def test_results_without_simulations_make_no_section(batch: Path, tmp_path: Path) -> None:
    summary = campaign_from(json.loads((batch / "campaign.json").read_bytes()))
    shutil.copytree(batch / "dataset", tmp_path / "dataset")
    report = make_campaign_report(summary, tmp_path)
    assert "model" not in [s.id for s in report.sections]


def test_logs_of_a_rig_without_a_model_leave_one_sentence(found: dict[str, Modelled]) -> None:
    none = modelled(msgspec.structs.replace(reduced("18 ohm"), rig=load_rig("kitepower"))).account
    section = campaign_section([Named("a", "–", none), Named("b", "–", none)], "measured")
    assert section is not None
    (note,) = section.blocks
    assert isinstance(note, Note)
    assert note.text.startswith("a, b: the rig file of kitepower lacks")


# ------------------------------------------------------------------------------------------ what is not to be simulated
def modules_after(*arguments: str) -> set[str]:
    code = (
        "import sys\nfrom winchcascade.cli.entry import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "sys.stderr.write('\\nMODULES ' + ' '.join(sys.modules))\n"
    )
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=True)
    return set(done.stderr.split("MODULES ")[1].split())


def test_without_a_report_nothing_is_simulated_or_drawn(tmp_path: Path) -> None:
    log = str(FIXTURES / "campaign" / "r18ohm.csv")
    out = tmp_path / "out"
    for arguments in (
        ["reduce", log, "--json", "-"],
        ["batch", log, "--out", str(out), "--reports", "none", "--jobs", "1"],
    ):
        assert not {"numba", "matplotlib"} & modules_after(*arguments)
    (result,) = (out / "runs").glob("*.json")
    assert "model" not in json.loads(result.read_bytes())
