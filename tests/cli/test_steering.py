"""What `stc steer` says where it cannot begin: one message, exit status 2 or 1, and nothing written."""

import socket
from contextlib import ExitStack

import pytest

from stc.cli.main import run as command

PUSH = """
constants: n = 10, T = 1, h = T/n, D = 1, most = 9;
variables: x, u;
constraints:
  [0, n]: x'' = u; -most <= u <= most;
  [0]: x; x';
  [n]: x = D; x';
objective: [0, n]: integral(u^2);
replay: model = "particle.xml"; joint x = x; actuator fx = u;
"""


@pytest.fixture
def said(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "push.stc").write_text(PUSH)

    def run(*words):
        status = command(["steer", *words])
        return status, capsys.readouterr().err

    return run


def test_a_spec_that_does_not_solve(said):
    status, text = said("push.stc", "--set", "most=0.1")
    assert status == 1
    assert "push.stc has no motion to begin with" in text


def test_a_port_that_is_in_use(said):
    with ExitStack() as stack:
        taken = stack.enter_context(socket.socket())
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        status, text = said("push.stc", "--port", str(taken.getsockname()[1]))
    assert status == 2
    assert "--port" in text
    assert "in use" in text
    assert said("push.stc", "--port", "70000")[0] == 2


def test_what_is_no_spec_to_steer(said, tmp_path):
    assert said("push.npz")[0] == 2
    status, text = said("push.stc", "--set", "h=0.2")
    assert (status, "`h` is computed" in text) == (2, True)
    (tmp_path / "bare.stc").write_text(PUSH.partition("replay:")[0])
    status, text = said("bare.stc")
    assert (status, "no `replay:` section" in text) == (2, True)
    (tmp_path / "wrong.stc").write_text(PUSH.replace("x'' = u", "x'' = v"))
    status, text = said("wrong.stc")
    assert (status, "`v` is not declared" in text) == (2, True)


def test_a_file_that_holds_something_else_is_not_written_over(said, tmp_path):
    (tmp_path / "other.stc").write_text("# mine\n")
    status, text = said("push.stc", "-o", "other.stc")
    assert (status, "other.stc is there already and holds another text" in text) == (2, True)
    assert said("push.stc", "-o", "nowhere/push.stc")[0] == 2
    assert (tmp_path / "other.stc").read_text() == "# mine\n"


def test_a_window_needs_a_display(said, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    status, text = said("push.stc", "--native")
    assert (status, "there is no display" in text) == (2, True)
