"""The optimality conditions of a problem as stated, without any scaling or barrier."""

from __future__ import annotations

import numpy as np

from stc.codegen.calls import chain
from stc.records import dataclass
from stc.solver.conditions import STATED, stated_conditions
from stc.solver.evaluator import Scaling, Stated, evaluator_of
from stc.solver.keeping import Keeper
from stc.solver.nlp import NLP, Floats
from stc.solver.options import Options
from stc.solver.passes import multiplier_scale

__all__ = ["Assessment", "Judge", "assess"]


@dataclass(frozen=True, slots=True)
class Assessment:
    """How well a point satisfies the optimality conditions.

    Attributes:
        objective: its objective.
        violation: largest violation of a row or bound, each relative to ``max(1, |bound|)``.
        optimality: largest of stationarity and complementarity, relative to the largest term in them
            and to the mean multiplier.
        bound_multipliers: what balances the Lagrangian's gradient at active bounds, (n,).
    """

    objective: float
    violation: float
    optimality: float
    bound_multipliers: Floats

    def holds(self, options: Options) -> bool:
        """Whether the point is feasible and stationary within the tolerances."""
        feasible = self.violation <= options.feasibility_tolerance
        return bool(feasible and self.optimality <= options.unscaled_tolerance)


class Judge:
    """Holds points against the conditions of one program, all in one call.

    Programs that are solved again and again have one with their keeper; nobody else may evaluate the program meanwhile.
    """

    def __init__(self, nlp: NLP) -> None:
        ev = nlp.as_stated() if isinstance(nlp, Stated) else evaluator_of(nlp, Scaling.none(nlp.n, nlp.m))
        self._evaluator = ev
        self._z, self._out = np.zeros(nlp.n), np.zeros(STATED)
        self._call = chain(
            [
                ev.values_call,
                ev.derivatives_call,
                stated_conditions.bind(
                    nlp.n, nlp.m, len(nlp.jac_rows), 0, ev.x, ev.y, self._z, ev.r, ev.gradient,
                    np.ascontiguousarray(nlp.jac_rows, np.int32), np.ascontiguousarray(nlp.jac_cols, np.int32), ev.jac,
                    _own(nlp.x_lower), _own(nlp.x_upper), _own(nlp.row_lower), _own(nlp.row_upper), np.zeros(nlp.n),
                    self._out,
                ),
            ]
        )  # fmt: skip

    def __call__(self, x: Floats, y: Floats) -> Assessment:
        """See :func:`assess`."""
        ev = self._evaluator
        ev.x[:], ev.y[:], ev.weight[0] = x, y, 1.0
        self._call()
        return _assessment(ev.x.size, ev.y.size, float(ev.f[0]), self._out, self._z.copy())


def assess(nlp: NLP, x: Floats, y: Floats, z: Floats | None = None) -> Assessment:
    """Evaluate the conditions at ``x`` (n,) with row multipliers ``y`` (m,), in the user's units.

    Without ``z`` (n,) the multipliers of the bounds are those that leave the smallest error: the negative
    gradient of the Lagrangian where it pushes against a bound nearby.
    """
    n, m = nlp.n, nlp.m
    keeper: Keeper | None = getattr(nlp, "keeper", None)
    if z is None and keeper is not None:
        return keeper.once(Judge, nlp)(x, y)
    f, r = nlp.values(x)
    gradient, jac, _ = nlp.derivatives(x, y, 1.0)
    chosen = np.zeros(n) if z is None else _own(z)
    out = np.zeros(STATED)
    stated_conditions(
        n, m, len(jac), int(z is not None), _own(x), _own(y), chosen, _own(r), _own(gradient),
        np.ascontiguousarray(nlp.jac_rows, np.int32), np.ascontiguousarray(nlp.jac_cols, np.int32), _own(jac),
        _own(nlp.x_lower), _own(nlp.x_upper), _own(nlp.row_lower), _own(nlp.row_upper), np.zeros(n), out,
    )  # fmt: skip
    return _assessment(n, m, float(f), out, chosen)


def _assessment(n: int, m: int, f: float, out: Floats, z: Floats) -> Assessment:
    stationarity, complementarity, violation, steepest, term, largest, total = out.tolist()
    size = max(1.0, steepest, term, largest, multiplier_scale(total, m + n))
    violation = violation if violation == violation else np.inf
    return Assessment(f, violation, max(stationarity, complementarity) / size, z)


def _own(values: Floats) -> Floats:
    """As compiled functions take them."""
    return np.ascontiguousarray(values, dtype=float)
