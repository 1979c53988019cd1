"""The notebook page: its cells run from top to bottom, and each shows what the page shows.

`python tests/test_notebook.py` writes the present output into the page; `python tests/test_notebook.py --kernel` runs its cells
in a kernel of Jupyter, which needs nbclient and ipykernel.
"""

import ast
import os
import re
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib as mpl
import pytest
from pages import DOCS, ROOT, with_fixtures

PAGE = DOCS / "notebook.md"
CELL = re.compile(r"```python\n(.*?)```\n\n```text\n(.*?)```", re.DOTALL)


def cells() -> list[tuple[str, str]]:
    """Code of each cell, and what the page shows below it."""
    return CELL.findall(PAGE.read_text(encoding="utf-8"))


def outputs() -> list[str]:
    """What each cell shows, run one after the other."""
    mpl.use("Agg")
    names: dict[str, object] = {}
    found = []
    for code, _ in cells():
        tree = ast.parse(code)
        *before, last = tree.body
        assert isinstance(last, ast.Expr), code
        exec(compile(ast.Module(before, []), str(PAGE), "exec"), names)
        value = eval(compile(ast.Expression(last.value), str(PAGE), "eval"), names)
        found.append("\n".join(line.rstrip() for line in repr(value).splitlines()) + "\n")
    return found


@pytest.mark.slow
def test_every_cell_shows_what_the_page_shows(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(with_fixtures(tmp_path))
    assert len(cells()) == 10
    assert outputs() == [shown for _, shown in cells()]


def test_the_page_names_only_what_exists() -> None:
    import winchcascade

    names = set(re.findall(r"\bwc\.(\w+)", PAGE.read_text(encoding="utf-8")))
    assert {
        "read_run",
        "load_rig",
        "reduce",
        "open_campaign",
        "audit",
        "compare",
        "frame",
        "plot",
        "write_report",
    } <= names
    assert names <= set(winchcascade.__all__)


def write_page() -> None:
    """Write the present output into the page."""
    found = iter(outputs())
    text = CELL.sub(lambda m: f"```python\n{m[1]}```\n\n```text\n{next(found)}```", PAGE.read_text(encoding="utf-8"))
    PAGE.write_text(text, encoding="utf-8")


def run_kernel() -> None:
    """Run the cells in a kernel of Jupyter; a cell that fails ends the run, a result must show a table of its own."""
    import nbformat
    from nbclient import NotebookClient

    code = [code for code, _ in cells()]
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(c) for c in [*code, "reduction", "found"]])
    NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(Path.cwd())}}).execute()
    for cell in notebook.cells[-2:]:
        assert "<table" in cell.outputs[-1].data["text/html"]
    plotted = next(cell for cell in notebook.cells if '.plot("speed")' in cell.source)
    assert any("image/png" in output.get("data", {}) for output in plotted.outputs), "the plot is not shown"


if __name__ == "__main__":
    with TemporaryDirectory() as place:
        os.chdir(with_fixtures(Path(place)))
        if sys.argv[1:] == ["--kernel"]:
            run_kernel()
        else:
            write_page()
        os.chdir(ROOT)
