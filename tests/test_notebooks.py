"""What objects show in notebooks, their tables for other libraries, and the notebooks of the documentation."""

from __future__ import annotations

import json
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stc
from stc.certification import certify
from stc.validate import validate

NOTEBOOKS = sorted((Path(__file__).parent.parent / "docs" / "notebooks").glob("*.ipynb"))

# x = t^2 and a jump of u at the middle frame; the parameter is 3.
JUMP = """constants: n = 4, T = 2, h = T/n;
variables: x, u;
parameters: width;
constraints: x'' = 2; [0]: x; x'; [0]: width = 3; [0, 2]: u = 1; [2, n]: u = 5;
jumps: [2]: u;
method: trapezoidal;
"""


class Reader(HTMLParser):
    """The text of a page; every tag that has an end must be ended in its turn."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.text = ""
        self.frames: list[str] = []
        self.images = 0
        self.feed(page)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "img":
            self.images += 1
            return
        self.frames += [value or "" for name, value in attrs if name == "srcdoc"]
        self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += f" {data}"


@pytest.fixture(scope="module")
def solution() -> stc.Solution:
    return stc.load(JUMP).solve()


def shown(thing: Any) -> Reader:
    return Reader(thing._repr_html_())


def test_a_solution_shows_how_it_ended_and_a_plot(solution: stc.Solution) -> None:
    page = shown(solution)
    assert "optimal" in page.text and "width" in page.text and page.images == 1
    bad = shown(stc.load("variables: x; constants: n = 0; constraints: x = 1; x = 2;").solve())
    assert "infeasible" in bad.text and bad.images == 0


def test_a_spec_shows_its_text() -> None:
    model = stc.load(JUMP.replace("constants:", "constants: # <b> & so on\n"), T=3)
    page = shown(model)
    assert "# <b> & so on" in page.text and "x'' = 2" in page.text


def test_a_report_shows_its_verdict_and_every_measurement() -> None:
    report = validate("particle_waypoints")
    page = shown(report)
    assert "passed" in page.text
    assert all(metric.name in page.text and metric.subject in page.text for metric in report.metrics)


def test_a_certificate_shows_its_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "off")  # without the film
    (frame,) = shown(certify("particle_waypoints")).frames
    assert frame.startswith("<!doctype html>") and "particle_waypoints: passed" in frame


def test_a_sweep_shows_its_table_and_a_plot(tmp_path: Path) -> None:
    page = shown(stc.sweep(JUMP, {"T": [1.0, 2.0]}, tmp_path / "found", workers=1))
    assert "2 of 2 points" in page.text and page.text.count(" optimal ") == 2 and page.images == 1


def test_errors_show_their_message_alone() -> None:
    with pytest.raises(stc.SpecError) as caught:
        stc.load("variables: x; objective: integral(y^2);").solve()
    assert "\n".join(caught.value._render_traceback_()) == str(caught.value)


def test_a_data_frame_has_the_motion(solution: stc.Solution) -> None:
    pytest.importorskip("pandas")
    table = solution.to_dataframe()
    assert list(table.columns) == ["x", "x'", "x''", "u"] and table.index.name == "time"
    np.testing.assert_allclose(table["x"], table.index.to_numpy() ** 2, atol=1e-9)
    assert list(table["u"]) == [1.0, 1.0, 5.0, 5.0, 5.0]
    assert table.attrs["parameters"] == {"width": 3.0} and table.attrs["status"] == "optimal"
    between = solution.to_dataframe([0.25, 1.75])
    assert list(between.index) == [0.25, 1.75] and list(between["u"]) == [1.0, 5.0]
    with pytest.raises(stc.UsageError, match="outside of the motion"):
        solution.to_dataframe([3.0])


def test_a_data_set_has_the_motion(solution: stc.Solution) -> None:
    pytest.importorskip("xarray")
    found = solution.to_xarray()
    np.testing.assert_allclose(found["x'"], 2.0 * found["time"], atol=1e-9)
    assert float(found["width"]) == 3.0 and found["time"].attrs["units"] == "s"
    assert float(found["u"].sel(time=1.5)) == 5.0


@pytest.mark.parametrize("library", ["pandas", "xarray"])
def test_a_library_that_is_missing_is_named(
    library: str, solution: stc.Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(
        stc.UsageError, match=f"needs {library}, which is not installed: `pip install {library}`"
    ):
        solution.to_dataframe() if library == "pandas" else solution.to_xarray()


@pytest.mark.daily_every(3)
@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_notebooks_of_the_documentation_run(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    monkeypatch.setenv("JUPYTER_PLATFORM_DIRS", "1")
    notebook = nbformat.read(path, as_version=4)
    assert all(not cell.get("outputs") for cell in notebook.cells), "outputs are not kept"
    nbclient.NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
    rich = [
        output
        for cell in notebook.cells
        for output in cell.get("outputs", ())
        if "text/html" in output.get("data", {})
    ]
    assert rich
    assert not [output for cell in notebook.cells for output in cell.get("outputs", ()) if "error" in output]
    json.dumps(notebook)


@pytest.mark.slow
def test_a_notebook_shows_how_far_a_solve_and_a_sweep_have_got(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each in a line of its own that changes and is empty in the end; within a sweep solves have none."""
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    monkeypatch.setenv("JUPYTER_PLATFORM_DIRS", "1")
    (tmp_path / "jump.stc").write_text(JUMP)
    cells = [
        "import stc, stc.notebook_progress as lines\nlines.DELAY = lines.PERIOD = 0.0",
        "stc.load('cart_pole_swing_up', n=20).solve().status",
        "stc.sweep('jump.stc', {'T': [1.0, 2.0, 3.0]}, 'found', workers=1).good",
        "stc.load('jump.stc').solve(callback=lambda iterate: None).status",
    ]
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])
    lines: dict[int, list[str]] = {}

    class Client(nbclient.NotebookClient):  # type: ignore[misc, name-defined]
        def process_message(self, message: Any, cell: Any, cell_index: int) -> Any:
            html = message["content"].get("data", {}).get("text/html")
            if html is not None:
                lines.setdefault(cell_index, []).append(html)
            return super().process_message(message, cell, cell_index)

    Client(notebook, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
    assert lines.keys() == {1, 2}
    assert "cart_pole_swing_up: iteration 0, objective" in lines[1][0] and lines[1][-1] == ""
    assert len(lines[1]) > 3 and all("cart_pole_swing_up: iteration" in line for line in lines[1][:-1])
    done = [f"jump: {count} of 3 points" for count in (1, 2, 3)]
    assert [words in line for words, line in zip(done, lines[2], strict=False)] == [True] * 3
    assert "<progress value='0.6667' max='1'>" in lines[2][1] and lines[2][3:] == [""]
    assert [cell.outputs[-1]["data"]["text/plain"] for cell in notebook.cells[1:]] == [
        "'optimal'",
        "True",
        "'optimal'",
    ]
