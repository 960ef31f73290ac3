"""Weights of an objective's terms under which a motion is optimal: inverse optimal control.

First those that leave least of the stationarity condition at the motion itself (Puydupin-Jamin, Johnson & Bretl 2012;
Englert, Vien & Toussaint 2017): with the gradients g_k of the terms and A of what is active of the rows,

    minimise  | sum_k w_k g_k + A^T y |^2   over y,   w >= 0,   sum_k w_k = 1.

That asks for no solve, but noise in the motion is in its residual as well.  So the weights are then improved by the
distance of their own optimal motion from the recorded one (Mombaur, Truong & Laumond 2010), here by Gauss-Newton: an
optimum moves with the weights by

    | H  A^T | | dx |       | g_k |
    | A   0  | | dy |  =  - |  0  |  dw_k

with the Hessian H of the Lagrangian (Fiacco 1983), so that each round takes one solve and one factorisation.

Weights are shares: each term is divided by what it comes to in the motion, which makes them comparable.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.pipeline import Model
from stc.records import dataclass
from stc.solution import Solution
from stc.studies.uncertainty import held

__all__ = ["Inverse", "Weighing"]

FloatArray = NDArray[np.float64]

#: Rounds of Gauss-Newton, halvings of a step, and the relative gain below which there is no further one.
ROUNDS, HALVINGS, GAIN = 12, 5, 1e-3
#: Iterations within which a neighbouring motion is found or given up.
ITERATIONS = 200
#: Terms that come to less than this share of the largest one's typical value weigh as if they came to that.
LEAST = 1e-9
#: A share below this is none.
NONE = 1e-3
#: Of the Hessian's diagonal and of the rows: what keeps the system regular where unknowns or rows are idle.
REGULAR = 1e-9
#: By how much a motion may become worse by leaving out a term, as a share of its distance; or this distance itself.
WORSE, CLOSE = 0.05, 1e-4


@dataclass(slots=True)
class Weighing:
    """Weights, and the motion that is optimal under them.

    Attributes
    ----------
    shares
        Of each term, (k,); they sum to 1.
    solution
        The motion.
    distance
        Root mean square of its distance from the recorded one, in rad and m.
    """

    shares: FloatArray
    solution: Solution
    distance: float


class Inverse:
    """Looks for weights.

    Parameters
    ----------
    model
        A spec whose constants weigh the terms.
    constants
        Names of these constants.
    names
        Variables whose distance counts.
    target
        (len(names), n+1) where the recorded motion has them at the frames.
    follow
        A motion that follows the recorded one; a solution of the same spec.
    """

    def __init__(
        self,
        model: Model,
        constants: Sequence[str],
        names: Sequence[str],
        target: FloatArray,
        follow: Solution,
    ) -> None:
        self.model, self.constants, self.follow = model, list(constants), follow
        self.names, self.target = list(names), target
        self.values = np.ones(len(constants))
        self._transcription = model.transcription(None, **self._given(np.ones(len(constants))))[1]
        values = np.array([self._at(follow.x, unit, "value") for unit in np.eye(len(constants))])
        self.values = np.maximum(np.abs(values), LEAST * max(1.0, float(np.abs(values).max())))
        slots = {(name, order): before for name, order, before, _, _ in self._transcription.layout.slots()}
        self._places = np.concatenate([slots[name, 0] for name in names])

    def constants_of(self, shares: FloatArray) -> dict[str, float]:
        """The constants of some shares, the largest one's term being weighed by 1."""
        weights = shares / self.values
        return dict(zip(self.constants, (weights / weights[np.argmax(shares)]).tolist(), strict=True))

    def _given(self, shares: FloatArray) -> dict[str, float]:
        return dict(zip(self.constants, (shares / self.values).tolist(), strict=True))

    def _bound(self, shares: FloatArray) -> Any:
        problem, transcription = self.model.transcription(None, **self._given(shares))
        return transcription.bind(problem.constants, start=self.follow.x, check=False)

    def _at(self, x: FloatArray, shares: FloatArray, what: str) -> Any:
        bound = self._bound(shares)
        if what == "value":
            return float(bound.values(x)[0])
        return bound.derivatives(x, np.zeros(bound.m), 1.0)[0].copy()

    def _gradients(self, x: FloatArray) -> FloatArray:
        """(unknowns, k) of the terms, each divided by its value."""
        return np.stack([self._at(x, unit, "gradient") for unit in np.eye(len(self.constants))], axis=1)

    # ------------------------------------------------------------------ stationarity

    def by_stationarity(self) -> tuple[FloatArray, float]:
        """The shares under which the motion that follows the recorded one is nearest to stationary.

        Returns
        -------
        FloatArray, float
            The shares, and what is left of the gradient: 0 for an optimum, at most 1.
        """
        solution = self.follow
        gradients = self._gradients(solution.x)
        bound = self._bound(np.zeros(len(self.constants)))
        _, jacobian, _ = bound.derivatives(solution.x, np.zeros(bound.m), 1.0)
        free, active = self._active(bound, solution)
        sizes = self._sizes(solution.x)
        matrix = self._rows(bound, jacobian, free, active, sizes)
        columns = (sizes[:, None] * gradients)[free]
        lengths = np.linalg.norm(columns, axis=0)
        # By the lengths of gradients: else a term counts as optimal that hardly changes with the motion.
        scaled = columns / np.where(lengths > 0.0, lengths, 1.0)
        left = _beside(matrix, scaled)
        shares = _least(left, np.zeros(len(left))) / np.where(lengths > 0.0, lengths, np.inf)
        shares /= max(float(shares.sum()), 1e-300)
        whole = float(np.linalg.norm(columns @ shares))
        left = left * lengths
        return shares, float(np.linalg.norm(left @ shares)) / whole if whole else 0.0

    def _sizes(self, x: FloatArray) -> FloatArray:
        """(unknowns,) what each unknown is of the order of, so that residuals in different units can be added."""
        sizes = np.ones(len(x))
        for _, _, before, after, middle in self._transcription.layout.slots():
            places = np.concatenate([before, after, middle])
            sizes[places] = max(float(np.sqrt(np.mean(x[places] ** 2))), 1e-6)
        return sizes

    def _active(self, bound: Any, solution: Solution) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """The unknowns that no bound holds, and the rows that hold."""
        x = solution.x
        free = np.flatnonzero(~held(x, bound.x_lower, bound.x_upper, solution.bound_multipliers))
        values = bound.values(x)[1].copy()
        return free, np.flatnonzero(held(values, bound.row_lower, bound.row_upper, solution.row_multipliers))

    @staticmethod
    def _rows(
        bound: Any, jacobian: FloatArray, free: NDArray[np.intp], active: NDArray[np.intp], sizes: FloatArray
    ) -> Any:
        from scipy.sparse import coo_array, diags_array

        whole = coo_array((jacobian, (bound.jac_rows, bound.jac_cols)), (bound.m, bound.n)).tocsr()
        rows = (whole[active] @ diags_array(sizes)).tocsc()[:, free]
        norms = np.sqrt(np.asarray((rows * rows).sum(axis=1)).reshape(-1))
        return (diags_array(1.0 / np.where(norms > 0.0, norms, 1.0)) @ rows).tocsc()

    # ------------------------------------------------------------------ distance

    def weighed(self, shares: FloatArray) -> Weighing | None:
        """The motion that is optimal under some shares, (k,); None where it is not found."""
        return self._solved(np.maximum(shares, 0.0), None)

    def by_distance(self, best: Weighing, on_round: Callable[[float], None] | None = None) -> Weighing:
        """The shares whose optimal motion is nearest to the recorded one.

        Parameters
        ----------
        best
            Where the search begins.
        on_round
            Called with the distance after each round.
        """
        damping = 1e-3
        for _ in range(ROUNDS):
            wanted = self._improved(best, damping)
            found, step = None, 1.0
            for _ in range(HALVINGS):
                trial = self._solved(best.shares + step * (wanted - best.shares), best.solution)
                if trial is not None and trial.distance < best.distance:
                    found = trial
                    break
                step *= 0.3
            if found is None:
                if damping > 0.1:
                    break
                damping *= 30.0
                continue
            gain = 1.0 - found.distance / best.distance
            best, damping = found, max(1e-6, damping * (0.3 if step == 1.0 else 3.0))
            if on_round is not None:
                on_round(best.distance)
            if gain < GAIN:
                break
        return best

    def shortened(self, best: Weighing) -> Weighing:
        """The same with fewer terms, as long as the motion stays about as near to the recorded one."""
        shares = best.shares
        allowed = max((1.0 + WORSE) * best.distance, best.distance + CLOSE)
        while np.count_nonzero(shares) > 1:
            slopes, residual = self._slopes(best), self._residual(best.solution)
            trials = []
            for k in np.flatnonzero(shares):
                others = np.flatnonzero((shares > 0.0) & (np.arange(len(shares)) != k))
                found = np.zeros(len(shares))
                found[others] = _least(slopes[:, others], slopes @ shares - residual)
                left = residual + slopes @ (found - shares)
                trials.append((float(np.linalg.norm(left)), found))
            trials.sort(key=lambda pair: pair[0])
            shorter = None
            for _, found in trials[:2]:
                kept = found > 0.0
                if not kept.any():
                    continue
                trial = self._restricted(found, best)
                if trial is not None and trial.distance <= allowed:
                    shorter = trial
                    break
            if shorter is None:
                break
            best, shares = shorter, shorter.shares
        return best

    def _restricted(self, shares: FloatArray, best: Weighing) -> Weighing | None:
        """The best weights of the terms that have a share: two rounds."""
        found = self._solved(shares, best.solution)
        for _ in range(2):
            if found is None or np.count_nonzero(found.shares) < 2:
                break
            trial = self._solved(self._improved(found, 1e-4), found.solution)
            if trial is None or trial.distance >= found.distance:
                break
            found = trial
        return found

    def _improved(self, best: Weighing, damping: float) -> FloatArray:
        """Shares that bring the motion nearer, by its slopes; terms without a share stay without."""
        slopes, residual = self._slopes(best), self._residual(best.solution)
        kept = (
            np.flatnonzero(best.shares > 0.0) if np.any(best.shares == 0.0) else np.arange(len(best.shares))
        )
        scale = float(np.linalg.norm(slopes[:, kept], axis=0).max(initial=0.0)) or 1.0
        damped = np.sqrt(damping) * scale * np.eye(len(kept))
        left = np.vstack([slopes[:, kept], damped])
        right = np.concatenate([slopes @ best.shares - residual, damped @ best.shares[kept]])
        found = np.zeros(len(best.shares))
        found[kept] = _least(left, right)
        return found

    def _solved(self, shares: FloatArray, near: Solution | None) -> Weighing | None:
        shares = shares / max(float(shares.sum()), 1e-300)
        near = self.follow if near is None else near
        solution = self.model.solve(max_iterations=ITERATIONS, warm_start=near, constants=self._given(shares))
        if solution.status != "optimal":
            return None
        return Weighing(shares, solution, float(np.sqrt(np.mean(self._residual(solution) ** 2))))

    def _residual(self, solution: Solution) -> FloatArray:
        """How far a motion is from the recorded one, coordinate by coordinate at the frames."""
        return np.asarray(solution.x[self._places] - self.target.reshape(-1))

    def _slopes(self, best: Weighing) -> FloatArray:
        """(coordinates, k) how the optimal motion changes with the shares."""
        from scipy.sparse import block_array, coo_array, diags_array
        from scipy.sparse.linalg import splu

        solution = best.solution
        gradients = self._gradients(solution.x)
        bound = self._bound(best.shares)
        _, jacobian, hessian = bound.derivatives(solution.x, solution.row_multipliers, 1.0)
        jacobian, hessian = jacobian.copy(), hessian.copy()
        free, active = self._active(bound, solution)
        sizes = self._sizes(solution.x)
        rows = self._rows(bound, jacobian, free, active, sizes)
        lower = coo_array((hessian, (bound.hess_rows, bound.hess_cols)), (bound.n, bound.n)).tocsc()
        scaled = diags_array(sizes) @ lower @ diags_array(sizes)
        whole = (scaled + scaled.T - diags_array(scaled.diagonal())).tocsc()[free][:, free]
        typical = float(np.median(np.abs(whole.diagonal()))) or 1.0
        system = block_array(
            [
                [whole + diags_array(np.full(len(free), REGULAR * typical)), rows.T],
                [rows, diags_array(np.full(len(active), -REGULAR / typical))],
            ]
        ).tocsc()
        right = np.vstack([-(sizes[:, None] * gradients)[free], np.zeros((len(active), gradients.shape[1]))])
        moves = np.zeros((len(solution.x), gradients.shape[1]))
        moves[free] = sizes[free, None] * splu(system).solve(right)[: len(free)]
        return moves[self._places]


def _beside(rows: Any, columns: FloatArray) -> FloatArray:
    """What of some columns (n, k) no combination of the rows (m, n) can make up for."""
    from scipy.sparse import block_array, diags_array
    from scipy.sparse.linalg import splu

    count, size = rows.shape
    system = block_array(
        [[diags_array(np.ones(size)), rows.T], [rows, diags_array(np.full(count, -REGULAR))]]
    ).tocsc()
    return splu(system).solve(np.vstack([columns, np.zeros((count, columns.shape[1]))]))[:size]


def _least(columns: FloatArray, right: FloatArray) -> FloatArray:
    """The shares w >= 0 with the sum 1 for which ``columns @ w`` is nearest to ``right``; small ones are none."""
    from scipy.optimize import nnls

    scale = max(float(np.abs(columns).max(initial=0.0)), float(np.abs(right).max(initial=0.0)), 1e-300)
    ones = 1e3 * scale * np.ones((1, columns.shape[1]))
    found = nnls(np.vstack([columns, ones]), np.append(right, ones[0, 0]))[0]
    found[found < NONE * found.max(initial=0.0)] = 0.0
    return np.asarray(found / max(float(found.sum()), 1e-300))
