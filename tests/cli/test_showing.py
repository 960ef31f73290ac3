"""Commands that show a motion or pass it on: what they say of one that is old, failed, or has no model."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import stc

Stc = Callable[..., tuple[int, str, str]]


def hop(n: int = 8) -> str:
    """The text of a spec of this folder that solves at once."""
    text = stc.load("particle_waypoints").text
    assert "n = 60" in text
    return text.replace("n = 60", f"n = {n}")


@pytest.fixture
def solved(stc_: Stc) -> Stc:
    """The same with ``hop.stc`` and ``hop.npz`` in the folder."""
    Path("hop.stc").write_text(hop())
    assert stc_("solve", "hop.stc")[0] == 0
    return stc_


SHOWING = [
    pytest.param(["plot", "hop.npz", "-o", "hop.svg"], id="plot"),
    pytest.param(
        ["render", "hop.npz", "-o", "hop.png", "--tiles", "1", "--size", "32x32"],
        id="render",
        marks=pytest.mark.needs("opengl"),
    ),
    pytest.param(["export", "hop.npz", "--format", "csv"], id="export"),
]
DONE = {"plot": "drawn", "render": "drawn", "export": "exported", "validate": "replayed"}


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("words", SHOWING)
def test_a_motion_of_an_older_text_is_shown_with_a_note(words: list[str], solved: Stc) -> None:
    status, _, err = solved(*words)
    assert (status, err) == (0, "")
    Path("hop.stc").write_text(hop().replace("T = 2", "T = 2.5"))
    status, out, err = solved(*words)
    assert status == 0
    assert "written" in out
    assert err.startswith("note: hop.stc has changed since this solution was made")
    assert len(err.splitlines()) == 1


# ------------------------------------------------------------------ solves that failed


@pytest.mark.daily_every(2)
@pytest.mark.parametrize(
    "words",
    [*SHOWING, pytest.param(["validate", "hop.npz", "--robustness", "--samples", "1"], id="validate")],
)
def test_what_is_no_solution_is_shown_only_by_force(words: list[str], stc_: Stc) -> None:
    done = DONE[words[0]]
    Path("hop.stc").write_text(hop())
    assert stc_("solve", "hop.stc", "--max-iterations", "0")[0] == 1
    status, _, err = stc_(*words)
    assert status == 2
    assert f"is not {done}: its solve ended iteration_limit, not optimal" in err
    assert "--force" in err.splitlines()[-1]
    if done != "replayed":  # whether a replay of what is not a solution goes well is another matter
        assert stc_(*words, "--force")[0] == 0


@pytest.mark.parametrize("command", ["run", "validate"])
def test_a_page_that_is_not_written_is_told_of(command: str, stc_: Stc) -> None:
    Path("hop.stc").write_text(hop())
    status, _, err = stc_(command, "hop.stc", "--max-iterations", "0", "--report", "hop.html")
    assert status == 1
    assert "not validated: the solve ended iteration_limit" in err
    assert "hop.html is not written" in err
    assert not Path("hop.html").exists()


# ------------------------------------------------------------------ files that are taken for others


@pytest.mark.daily_every(5)
@pytest.mark.parametrize("command", ["solve", "run", "compare", "check"])
@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_a_solution_is_no_spec_and_a_table_no_solution(command: str, suffix: str, stc_: Stc) -> None:
    Path("hop.stc").write_text(hop())
    saved, table = f"saved{suffix}", f"table{suffix}"
    assert stc_("solve", "hop.stc", "-o", saved)[0] == 0
    assert stc_("export", "hop.stc", "--format", suffix[1:], "-o", table)[0] == 0
    status, _, err = stc_(command, saved)
    assert status == 2
    assert f"{saved} is a saved solution, not a spec" in err
    assert f"stc validate {saved}" in err
    assert f"--warm-start {saved}" in err
    status, _, err = stc_(command, table)
    assert status == 2
    assert f"{table} is a table of numbers, not a spec" in err
    for words in (["validate", table], ["solve", "hop.stc", "--warm-start", table]):
        status, _, err = stc_(*words)
        assert status == 2
        assert f"{table} is a table, as `stc export` writes it" in err
        assert f"--guess-from {table}" in err
    # What is advised works.
    assert stc_("validate", saved)[0] == 0
    assert stc_("solve", "hop.stc", "--warm-start", saved)[0] == 0
    assert stc_("solve", "hop.stc", "--guess-from", table)[0] == 0


# ------------------------------------------------------------------ motions without a model

# From rest to rest in unit time with the least squared acceleration: 3t^2 - 2t^3.
REST_TO_REST = """\
constants: n = 10, h = 1/n;
variables: x, x2;
constraints:
  [0]: x; x';
  [n]: x = 1; x';
  [0, n]: x2 = x^2;
objective: [0, n]: integral(x''^2);
method: hermite-simpson;
"""


@pytest.mark.parametrize("target", ["rest.stc", "rest.npz"])
def test_without_a_model_variables_are_drawn_and_tabled(target: str, stc_: Stc) -> None:
    Path("rest.stc").write_text(REST_TO_REST)
    assert stc_("solve", "rest.stc")[0] == 0
    assert stc_("plot", target, "-o", "rest.svg")[0] == 0
    drawn = Path("rest.svg").read_text()
    assert all(f">{word}</text>" in drawn for word in ("x", "x2", "s"))
    assert stc_("export", target, "--format", "csv")[0] == 0
    assert Path("rest_motion.csv").read_text().startswith("time,x")


@pytest.mark.parametrize("target", ["rest.stc", "rest.npz"])
@pytest.mark.parametrize(
    ("words", "why", "instead"),
    [
        (["render", "-o", "rest.png"], "no bodies to render", "stc plot"),
        (["export", "--format", "gltf"], "gltf needs the bodies and joints of a model", "--format csv"),
        (
            ["export", "--format", "controls"],
            "controls needs the bodies and joints of a model",
            "--format csv",
        ),
        (["validate"], "MuJoCo cannot replay it", "stc solve"),
    ],
    ids=["render", "gltf", "controls", "validate"],
)
def test_what_needs_a_model_says_what_for(
    target: str, words: list[str], why: str, instead: str, stc_: Stc
) -> None:
    Path("rest.stc").write_text(REST_TO_REST)
    assert stc_("solve", "rest.stc")[0] == 0
    status, _, err = stc_(words[0], target, *words[1:])
    assert status == 2
    assert why in err
    assert instead in err
    assert "docs/own_model.md" in err
