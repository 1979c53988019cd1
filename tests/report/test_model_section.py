"""Log and simulation in the reports: what is drawn and in the tables are the numbers of the comparison."""

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from compared import FIXTURES, LOGS, reduced
from matplotlib.patches import Rectangle
from undrawn import undrawn

from winchcascade.batch.plan import make_plan
from winchcascade.batch.run_batch import Products, run_batch
from winchcascade.diagnosis.model_account import Account, Modelled, Regression, account_of, modelled
from winchcascade.diagnosis.model_comparison import ModelComparison, compare
from winchcascade.report.content import Note, Picture, Section, Table
from winchcascade.report.figures import model_figures as figures
from winchcascade.report.figures.style import house_style
from winchcascade.report.results.model_section import PANELS, Named, campaign_section, run_section
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


def test_the_differences_in_the_table_are_those_of_the_account(
    found: dict[str, Modelled], sections: dict[str, Section]
) -> None:
    for name, section in sections.items():
        cells = table(section, "differences").cells
        differences = found[name].account.differences.values()
        assert [tuple(row[2:]) for row in cells] == [(one.bias, one.rms) for one in differences]


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


def test_a_rig_without_a_model_has_the_reason_instead_of_figures() -> None:
    reduction = msgspec.structs.replace(reduced("18 ohm"), rig=load_rig("kitepower"))
    (note,) = run_section(modelled(reduction)).blocks
    assert isinstance(note, Note)
    assert note.text.startswith("The rig file of kitepower lacks what a model needs")


@pytest.mark.parametrize("missing", ["torque", "pressure", "vdc", "displacement"])
def test_what_a_log_lacks_is_neither_drawn_nor_reported(missing: str) -> None:
    reduction = reduced("18 ohm")
    channels = {name: x for name, x in reduction.run.channels.items() if name != missing}
    found = modelled(msgspec.structs.replace(reduction, run=msgspec.structs.replace(reduction.run, channels=channels)))
    lost = {
        "torque": {"torque_nm", "loss_w", "eta_gen"},
        "pressure": {"pressure_kgcm2", "pressure_haul_in_kgcm2"},
        "vdc": {"vdc_v", "power_gen_w", "resistance_ohm", "loss_w", "eta_gen"},
        "displacement": {"pressure_kgcm2", "pressure_haul_in_kgcm2"},
    }[missing]
    assert not lost & found.account.curves.keys()
    assert missing not in found.account.differences
    with house_style():
        names = captions(run_section(found))
    assert ("model-losses" in names) == (missing not in ("torque", "vdc"))


def test_a_model_with_an_effect_says_so_in_every_caption() -> None:
    reduction = reduced("18 ohm")
    model = make_effect("gear_mesh_loss", {"efficiency_change": -0.05}).apply(baseline(reduction.rig))
    comparison = compare(reduction, model, changed="gear_mesh_loss")
    assert isinstance(comparison, ModelComparison)
    with house_style():
        section = run_section(Modelled(comparison, account_of(comparison)))
    assert all("with gear_mesh_loss" in caption for caption in captions(section).values())


def test_log_is_a_line_and_simulation_markers_of_another_colour(found: dict[str, Modelled], style: None) -> None:
    curves = found["18 ohm"].account.curves
    figure = figures.panels([figures.Drawn("", curves)], PANELS["model-generator"], word="measured", rated=2000.0)
    assert figure is not None
    for name, ax in zip(PANELS["model-generator"], figure.axes, strict=True):
        lines = [line for line in ax.lines if len(np.asarray(line.get_xdata())) == len(curves[name].x)]
        log, simulated = lines
        assert (log.get_linestyle(), log.get_marker()) == ("-", "None")
        assert (simulated.get_linestyle(), simulated.get_marker()) == ("None", "o")
        assert log.get_color() != simulated.get_markeredgecolor()
        assert tuple(np.asarray(log.get_ydata())) == curves[name].log
        assert tuple(np.asarray(simulated.get_ydata())) == curves[name].simulated
        assert ax.get_xlabel()
        assert ax.get_ylabel()


def test_every_load_has_a_colour_and_a_marker_of_its_own(found: dict[str, Modelled], style: None) -> None:
    names = [f"{k} Ω" for k in range(7)]
    drawn = figures.styled_by_load(names, [found["18 ohm"].account.curves] * 7)
    assert len({d.log for d in drawn}) == len({d.mark for d in drawn}) == 7
    figure = figures.panels(drawn, PANELS["model-tether"], word="log", rated=2000.0)
    assert figure is not None
    texts = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert texts == ["log", "simulated", "over rated speed", *names]
    marks = [line for line in figure.axes[2].lines if line.get_marker() not in ("None", "")]
    assert len({line.get_marker() for line in marks}) == 7


def test_the_drum_turns_slower_than_the_generator_by_the_gear(found: dict[str, Modelled], style: None) -> None:
    drawn = [figures.Drawn("", found["18 ohm"].account.curves)]
    figure = figures.panels(drawn, ["torque_nm"], word="log", rated=2000.0, gear=50.0)
    assert figure is not None
    figure.draw_without_rendering()
    (ax,) = figure.axes
    (above,) = ax.child_axes
    assert np.array(above.get_xlim()) * 50.0 == pytest.approx(np.array(ax.get_xlim()))
    assert above.get_xlabel() == "Drum speed (rpm)"


def test_bars_hold_seven_segments_at_most_and_sum_to_the_energy_of_the_line(
    found: dict[str, Modelled], style: None
) -> None:
    budgets = [b for name in LOGS if (b := found[name].account.budget) is not None]
    segments = figures.segments_of(budgets)
    assert len(segments) == figures.SEGMENTS
    assert [sum(column) for column in zip(*segments.values(), strict=True)] == pytest.approx([100.0] * len(budgets))
    (ax,) = figures.budget_bars(list(LOGS), budgets, word="log").axes
    bars = [bar for bar in ax.patches if isinstance(bar, Rectangle)]
    assert max(bar.get_x() + bar.get_width() for bar in bars) == pytest.approx(100.0, abs=0.1)
    simulated, logged, *_ = (np.asarray(line.get_xdata()) for line in ax.lines)
    log = budgets[0].log
    assert simulated[0] == pytest.approx(100.0 * budgets[0].shares["dc"])
    assert logged[0] == pytest.approx(100.0 * log["gen"] / log["line"])


def test_the_sweep_draws_the_tension_of_every_damper(found: dict[str, Modelled], style: None) -> None:
    sweep = found["open circuit"].account.sweep
    assert sweep is not None
    (ax,) = figures.damper_sweep(sweep, word="log", rated=2000.0).axes
    assert [tuple(np.asarray(line.get_ydata())) for line in ax.lines] == [sweep.log, *sweep.simulated]


def test_the_back_emf_is_drawn_with_its_slope_and_that_of_the_rig_file(style: None) -> None:
    rpm = np.linspace(1000.0, 3000.0, 20)
    v_ll, v_dc = tuple((0.062 * rpm).tolist()), tuple((0.0875 * rpm).tolist())
    fit = Regression(tuple(rpm.tolist()), v_ll, v_dc, 0.062, 0.0619, 0.0621, 0.998, rpm.size, 0.0617)
    figure = figures.back_emf_figure(fit, word="measured")
    right = figure.axes[1]
    slopes = [
        np.diff(np.asarray(line.get_ydata()))[0] / np.diff(np.asarray(line.get_xdata()))[0] for line in right.lines[:2]
    ]
    assert slopes == pytest.approx([0.0617, 0.062])


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


def test_a_campaign_shows_all_loads_in_each_figure(campaign: Section) -> None:
    drawn = {b.id: b.figure for b in campaign.blocks if isinstance(b, Picture)}
    assert {"model-tether", "model-generator", "model-losses", "model-budget"} <= drawn.keys()
    legend = [text.get_text() for one in drawn["model-losses"].legends for text in one.get_texts()]
    assert {"18 ohm", "4.5 ohm"} <= set(legend)
    assert "open circuit" not in legend


def test_a_campaign_shows_which_logs_were_not_simulated_and_why(campaign: Section) -> None:
    first = campaign.blocks[0]
    assert isinstance(first, Note)
    assert first.text.startswith("r45ohm.csv: the load of the log is not known")


def test_a_result_keeps_its_curves_and_little_more(batch: Path) -> None:
    record = json.loads((batch / "runs" / "r18ohm.csv.json").read_bytes())
    assert len(json.dumps(record["model"])) < 16_000
    assert record["model"]["curves"]["torque_nm"]["x"][0] == 150.0
    left_out = json.loads((batch / "runs" / "r45ohm.csv.json").read_bytes())["model"]
    assert set(left_out) <= {"why", "word"}


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
