"""Where all attempts end nowhere, the best feasible point that any of them came by is the start of one more."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import stc
from stc.solver import Options, minimize
from stc.solver.attempts import Attempts
from stc.solver.outcome import End, Outcome, Tactics
from stc.solver.rescaling import Rescalings
from stc.solver.scaled_problem import ScaledProblem

#: Least at (1, 1), or at the bounds of x or y.
SPEC = """
constants: n = 0;
variables: x, y;
constraints: [0]: x + y^2 = 2; 0 <= x <= 1.5; y >= 0;
objective: [0]: exp(x) - exp(1)*x + (y - 1)^4;
"""
FEASIBLE = np.array([0.5, np.sqrt(1.5)])


def test_the_last_attempt_starts_from_the_best_feasible_point(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, transcription = stc.load(SPEC).transcription()
    nlp = transcription.bind(problem.constants)
    barrier = Attempts.barrier
    starts: list[np.ndarray[Any, Any]] = []

    def lost(self: Attempts, form: ScaledProblem, x0: Any, tactics: Tactics, **more: Any) -> Outcome:
        if np.array_equal(x0, FEASIBLE):
            starts.append(x0)
            return barrier(self, form, x0, tactics, **more)
        self.monitor.best = 0.0, nlp.values(FEASIBLE)[0], FEASIBLE, np.zeros(nlp.m)
        return Outcome(End.STUCK, form, np.array([9.0, 9.0]), np.zeros(nlp.m), 1.0)

    monkeypatch.setattr(Attempts, "barrier", lost)
    monkeypatch.setattr(Attempts, "feasible_first", lambda self, form, x0: lost(self, form, x0, Tactics()))
    monkeypatch.setattr(Rescalings, "from_least_violation", lambda *_: None)
    result = minimize(nlp, Options(presolve=False))
    assert len(starts) == 1
    np.testing.assert_array_equal(starts[0], FEASIBLE)
    assert result.status == "optimal"
    np.testing.assert_allclose(result.x, [1.0, 1.0], atol=1e-4)
