"""Where derivatives go does not depend on how many of them are looked at together."""

from __future__ import annotations

import numpy as np
import pytest

import stc
from stc.transcription import assemble
from stc.transcription.assemble import Sparsity

MOTION = """
constants: n = 13;
variables: x, y, u;
parameters: T;
definitions: [0, 5]: h = T/n; [6, n]: h = 2*T/n;
method: {method};
jumps: [6]: u;
constraints:
  1 <= T <= 3;
  [0, n]: x'' = u*y; y' = x*sin(y) + u[0]; x*u <= 4;
  [1, n]: x*x[i - 1] + y^2 <= 9;
  [0]: x; x'; y = 1;
  [n]: x = 1;
objective: [0, n]: integral(u^2 + x*y); [0, n]: x^2;
"""


def sparsities(method: str) -> list[Sparsity]:
    _, transcription = stc.load(MOTION.format(method=method)).transcription()
    program = transcription.program
    return [program.gradient, program.jacobian, program.hessian]


@pytest.mark.parametrize("method", ["trapezoidal", "hermite-simpson"])
@pytest.mark.parametrize("at_once", [1, 40])
def test_few_at_once(monkeypatch: pytest.MonkeyPatch, method: str, at_once: int) -> None:
    together = sparsities(method)
    monkeypatch.setattr(assemble, "AT_ONCE", at_once)
    for one, other in zip(sparsities(method), together, strict=True):
        assert len(one) > 0
        for name in ("rows", "cols", "first"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
        for folding in ("folding", "constant_folding"):
            for name in getattr(one, folding).__dataclass_fields__:
                np.testing.assert_array_equal(
                    getattr(getattr(one, folding), name), getattr(getattr(other, folding), name)
                )
