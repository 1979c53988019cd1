"""Log and simulation in the reports: what is drawn and in the tables are the numbers of the
comparison.
"""

import json
import shutil
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
from winchcascade.diagnosis.explain.model_comparison import Account, modelled
from winchcascade.report.content import Section, Table
from winchcascade.report.figures import model_figures as figures
from winchcascade.report.figures.style import house_style
from winchcascade.report.results.model_section import PANELS, run_parts


@pytest.fixture(scope="module")
def found() -> dict[str, Account]:
    return {name: modelled(reduced(name)) for name in LOGS}


@pytest.fixture(scope="module")
def sections(found: dict[str, Account]) -> dict[str, Section]:
    return {
        name: Section("model", "Model", run_parts(reduced(name), one))
        for name, one in found.items()
    }


@pytest.fixture
def style() -> Iterator[None]:
    with house_style():
        yield


def table(section: Section, name: str) -> Table[Any]:
    (one,) = (b for b in section.blocks if isinstance(b, Table) and b.id == name)
    return one


def test_the_budget_table_sums_to_the_energy_of_the_line(sections: dict[str, Section]) -> None:
    for section in sections.values():
        shown = table(section, "loss-budget")
        *parts, whole = shown.cells
        for k in (1, 2):
            assert sum(float(str(row[k])) for row in parts) == pytest.approx(
                float(str(whole[k])), rel=1e-3
            )
        assert whole[2] == pytest.approx(100.0)
        names = [row[0] for row in parts]
        wanted = [
            "stored gas",
            "screw",
            "line losses",
            "inertia",
            "mesh",
            "damper",
            "copper",
            "diodes",
            "DC link",
        ]
        assert set(wanted) <= set(names)


@pytest.mark.parametrize("missing", ["torque", "pressure", "vdc", "displacement"])
def test_what_a_log_lacks_has_no_curve(missing: str) -> None:
    reduction = reduced("18 ohm")
    channels = {name: x for name, x in reduction.run.channels.items() if name != missing}
    run = msgspec.structs.replace(reduction.run, channels=channels)
    found = modelled(msgspec.structs.replace(reduction, run=run))
    lost = {
        "torque": {"torque_nm", "loss_w", "eta_gen"},
        "pressure": {"pressure_kgcm2", "pressure_haul_in_kgcm2"},
        "vdc": {"vdc_v", "power_gen_w", "loss_w", "eta_gen"},
        "displacement": {"pressure_kgcm2", "pressure_haul_in_kgcm2"},
    }[missing]
    assert not lost & found.curves.keys()
    assert missing not in found.differences


def test_log_is_a_line_and_simulation_markers(found: dict[str, Account], style: None) -> None:
    curves = found["18 ohm"].curves
    figure = figures.panels(
        [figures.Drawn("", curves, "load1", "o")],
        PANELS["model-generator"],
        word="measured",
        rated=2000.0,
    )
    assert figure is not None
    for name, ax in zip(PANELS["model-generator"], figure.axes, strict=True):
        lines = [
            line for line in ax.lines if len(np.asarray(line.get_xdata())) == len(curves[name].x)
        ]
        log, simulated = lines
        assert (log.get_linestyle(), log.get_marker()) == ("-", "None")
        assert (simulated.get_linestyle(), simulated.get_marker()) == ("None", "o")
        assert tuple(np.asarray(log.get_ydata())) == curves[name].log
        assert tuple(np.asarray(simulated.get_ydata())) == curves[name].simulated
        assert ax.get_xlabel()
        assert ax.get_ylabel()


def test_bars_hold_seven_segments_at_most_and_sum_to_the_energy_of_the_line(
    found: dict[str, Account], style: None
) -> None:
    budgets = [b for name in LOGS if (b := found[name].budget) is not None]
    segments = figures.segments_of(budgets)
    assert len(segments) == figures.SEGMENTS
    assert [sum(column) for column in zip(*segments.values(), strict=True)] == pytest.approx(
        [100.0] * len(budgets)
    )
    (ax,) = figures.budget_bars(list(LOGS), budgets, word="log").axes
    bars = [bar for bar in ax.patches if isinstance(bar, Rectangle)]
    assert max(bar.get_x() + bar.get_width() for bar in bars) == pytest.approx(100.0, abs=0.1)
    simulated, logged, *_ = (np.asarray(line.get_xdata()) for line in ax.lines)
    log = budgets[0].log
    assert simulated[0] == pytest.approx(100.0 * budgets[0].shares["DC link"])
    assert logged[0] == pytest.approx(100.0 * log["gen"] / log["line"])


@pytest.fixture(scope="module")
def batch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A batch with pages of a load and of a log of which no load is known."""
    folder = tmp_path_factory.mktemp("campaign")
    runs = {"r18ohm.csv": "18.0", "r45ohm.csv": None}
    text = 'title = "Trials"\nmeasured = true\n'
    for name, load in runs.items():
        shutil.copy(FIXTURES / "campaign" / name, folder)
        text += f'[[run]]\nfile = "{name}"\n' + ("" if load is None else f"load_ohm = {load}\n")
    (folder / "campaign.toml").write_text(text)
    with undrawn():
        run_batch(make_plan([str(folder)]), folder / "out", Products(reports=("html",)))
    return folder / "out"


def test_a_result_keeps_its_curves_and_little_more(batch: Path) -> None:
    record = json.loads((batch / "runs" / "r18ohm.csv.json").read_bytes())
    assert len(json.dumps(record["model"])) < 16_000
    assert record["model"]["curves"]["torque_nm"]["x"]
    left_out = json.loads((batch / "runs" / "r45ohm.csv.json").read_bytes())["model"]
    assert set(left_out) <= {"why", "word"}
