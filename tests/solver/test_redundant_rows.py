"""Rows stated twice: as good as zero beside large pivots, they are to give way more, and nothing is to be shifted."""

from __future__ import annotations

import pytest

import stc

AGAIN = {
    "doubled": "2*a'' = 2*u - 19.62*sin(a);",
    "turned": "a'' - u = -9.81*sin(a);",
    "twice": "2*a'' = 2*u - 19.62*sin(a); a'' - u = -9.81*sin(a); e = a + u; e - a = u;",
    "at the ends": "2*a'' = 2*u - 19.62*sin(a); u + 1 <= 31; [0]: a = 0; [n]: 2*a = 2*pi; a >= pi; a <= pi;",
}


def spec(rule: str, again: str) -> str:
    return f"""
    constants: n = 60, T = 2.438, h = T/n;
    variables: a, u{", e" if "e =" in again else ""};
    method: {rule};
    guess: a = pi*t/T;
    constraints:
      [0, n]: a'' = u - 9.81*sin(a); -30 <= u <= 30; {again}
      [0]: a; a'; [n]: a = pi; a';
    objective: [0, n]: integral(u^2);
    """


@pytest.mark.daily_every(5)
@pytest.mark.parametrize("rule", ["central", "trapezoidal", "hermite-simpson"])
@pytest.mark.parametrize("again", AGAIN.values(), ids=AGAIN.keys())
@pytest.mark.parametrize("n", [40, 60, 100, 200])
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_the_motion_is_found_as_if_stated_once(rule: str, again: str, n: int) -> None:
    once = stc.load(spec(rule, ""), n=n).solve()
    twice = stc.load(spec(rule, again), n=n).solve(max_iterations=150)
    assert once.status == twice.status == "optimal"
    assert twice.objective == pytest.approx(once.objective, rel=1e-6)
