"""Commands that show a motion or pass it on: what they say of one that is old, failed, or has no model."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import stc
from stc.cli import run

Stc = Callable[..., tuple[int, str, str]]


@pytest.fixture
def stc_(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Stc:
    """Runs a command line in an empty folder; gives exit status, standard output, standard error."""
    monkeypatch.chdir(tmp_path)

    def call(*words: str) -> tuple[int, str, str]:
        capsys.readouterr()
        status = run(words)
        out, err = capsys.readouterr()
        return status, out, err

    return call


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
    ["plot", "hop.npz", "-o", "hop.svg"],
    ["render", "hop.npz", "-o", "hop.png", "--tiles", "1", "--size", "32x32"],
    ["export", "hop.npz", "--format", "csv"],
]


@pytest.mark.parametrize("words", SHOWING, ids=lambda words: words[0])
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


@pytest.mark.parametrize(
    ("words", "done"),
    [
        *zip(SHOWING, ["drawn", "drawn", "exported"], strict=True),
        (["validate", "hop.npz", "--robustness", "--samples", "1"], "replayed"),
    ],
    ids=lambda words: words[0],
)
def test_what_is_no_solution_is_shown_only_by_force(words: list[str], done: str, stc_: Stc) -> None:
    Path("hop.stc").write_text(hop())
    assert stc_("solve", "hop.stc", "--max-iterations", "0")[0] == 1
    status, _, err = stc_(*words)
    assert status == 2
    assert f"is not {done}: its solve ended iteration_limit, not optimal" in err
    assert "--force" in err.splitlines()[-1]
    if done != "replayed":  # whether a replay of what is no solution goes well is another matter
        assert stc_(*words, "--force")[0] == 0


@pytest.mark.parametrize("command", ["run", "validate"])
def test_a_page_that_is_not_written_is_told_of(command: str, stc_: Stc) -> None:
    Path("hop.stc").write_text(hop())
    status, _, err = stc_(command, "hop.stc", "--max-iterations", "0", "--report", "hop.html")
    assert status == 1
    assert "not validated: the solve ended iteration_limit" in err
    assert "hop.html is not written" in err
    assert not Path("hop.html").exists()
