"""Weights of an objective's terms under which a motion is optimal: inverse optimal control.

The first weights are those for which the recorded motion violates the conditions of an optimum least (Puydupin-Jamin,
Johnson & Bretl 2012; Englert, Vien & Toussaint 2017).  With the gradients g_k of the terms, the Jacobian A of the
active constraints and their multipliers y,

    minimise  | sum_k w_k g_k + A^T y |   over y,   w >= 0,   sum_k w_k = 1,

in a norm that says how far the residual would move the motion.  This needs no solve, but is sensitive to noise in the
motion.  So the weights are then improved by the distance of their own optimal motion from the recorded
one (Mombaur, Truong & Laumond 2010), here by Gauss-Newton: an optimum moves with the weights by

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

from stc.explaining.tangent import Tangent
from stc.pipeline import Model
from stc.records import dataclass
from stc.solution import Solution
from stc.studies.effort import Clock

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
#: How often the true shares are outside of their ranges, all of them together, and steps of the search for the ends.
MISSED, BISECTIONS = 0.05, 12
#: By how much a motion may become worse by leaving out a term, as a share of its distance; or this distance itself.
WORSE, CLOSE = 0.05, 5e-4


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
    clock
        The time limit of all searches together; once it is over, each returns the best that it has found.
    """

    def __init__(
        self,
        model: Model,
        constants: Sequence[str],
        names: Sequence[str],
        target: FloatArray,
        follow: Solution,
        clock: Clock,
    ) -> None:
        self.clock = clock
        self.model, self.constants, self.follow = model, list(constants), follow
        self.names, self.target = list(names), target
        self.values = np.ones(len(constants))
        self._transcription = model.transcription(None, **self._given(np.ones(len(constants))))[1]
        values = np.array([self._at(follow.x, unit, "value") for unit in np.eye(len(constants))])
        self.values = np.maximum(np.abs(values), LEAST * max(1.0, float(np.abs(values).max())))
        slots = {(name, order): before for name, order, before, _, _ in self._transcription.layout.slots()}
        self._places = np.concatenate([slots[name, 0] for name in names])

    def constants_of(self, shares: FloatArray) -> dict[str, float]:
        """The constants of some shares, the first term that has one being weighed by 1."""
        weights = shares / self.values
        return dict(zip(self.constants, (weights / weights[np.argmax(shares > 0.0)]).tolist(), strict=True))

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

        The residual is measured by where it would move the motion: by the step of Newton's method on which it leads,
        as far as that is seen in the coordinates.  What shakes the controls and hardly moves the body counts little.

        Returns
        -------
        FloatArray, float
            The shares, and how much of the gradient no multipliers make up for: 0 for an optimum, 1 at most.
        """
        x, count = self.follow.x, len(self.constants)
        gradients = self._gradients(x)
        shares = np.full(count, 1.0 / count)
        for _ in range(3):
            # Newton's matrix depends on the weights a little.
            mixed = 0.9 * shares + 0.1 / count
            tangent = self._tangent(mixed, self.follow)
            multipliers, _ = tangent.balanced(gradients @ mixed)
            moves = tangent.moves(multipliers, gradients)[self._places]
            shares = _least(moves, np.zeros(len(moves)))
        left = tangent.balanced(gradients @ shares)[1]
        whole = float(np.linalg.norm(tangent.scaled(gradients @ shares)))
        return shares, float(np.linalg.norm(left)) / max(whole, 1e-300)

    def _tangent(self, shares: FloatArray, solution: Solution) -> Tangent:
        sizes = self._sizes(solution.x)
        multipliers = solution.row_multipliers, solution.bound_multipliers
        return Tangent(self._bound(shares), solution.x, multipliers, sizes)

    def _sizes(self, x: FloatArray) -> FloatArray:
        """(unknowns,) what each unknown is of the order of, so that residuals in different units can be added."""
        sizes = np.ones(len(x))
        for _, _, before, after, middle in self._transcription.layout.slots():
            places = np.concatenate([before, after, middle])
            sizes[places] = max(float(np.sqrt(np.mean(x[places] ** 2))), 1e-6)
        return sizes

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
            if self.clock.is_over:
                break
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
        """The weights without the terms that can be left out while the motion stays about as close to the recorded
        one."""
        shares = best.shares
        allowed = max((1.0 + WORSE) * best.distance, best.distance + CLOSE)
        while np.count_nonzero(shares) > 1 and not self.clock.is_over:
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

    def ranges(self, best: Weighing, noise: FloatArray, rows: int) -> FloatArray:
        """(k, 2) between which bounds the shares of all terms are, as far as the recording tells (95 %).

        A share is likely if some shares of the other terms lead to a motion that is hardly farther from the recording,
        measured by its noise, than the best one (profile likelihood: Pawitan, In all likelihood, 2001, section 3.4).
        Motions are those that the slopes at the best one predict.

        Parameters
        ----------
        best
            The best weights.
        noise
            (len(names),) its standard deviation in each coordinate. What the best motion is off counts as noise, too.
        rows
            How often the motion was measured.
        """
        from scipy.special import chdtri

        slopes, residual = self._slopes(best), self._residual(best.solution)
        each = residual.reshape(len(self.names), -1)
        deviation = np.sqrt(np.maximum(noise**2, 0.0) + np.mean(each**2, axis=1))
        deviation = np.maximum(deviation, LEAST * max(1.0, float(np.abs(self.target).max())))
        scale = np.repeat(np.sqrt(rows / each.shape[1]) / deviation, each.shape[1])
        together = np.column_stack([slopes, slopes @ best.shares - residual]) * scale[:, None]
        # The ends are stated as the noise has them: what a straight way between others would make up for tells nothing.
        straight = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, each.shape[1]), 2))[0]
        together = together.reshape(len(self.names), each.shape[1], -1)
        together = together - np.einsum("fs,gs,ngk->nfk", straight, straight, together)
        small = np.linalg.qr(together.reshape(scale.size, -1)).R
        columns, right = small[:, :-1], small[:, -1]

        def worse(k: int, share: float) -> float:
            """By how much the squared distance grows if one term has a share, the others being the best for that."""
            others = np.arange(len(best.shares)) != k
            left = (1.0 - share) * columns[:, others]
            found = (
                _least(left, right - share * columns[:, k]) if share < 1.0 else np.zeros(int(others.sum()))
            )
            return float(np.sum((left @ found + share * columns[:, k] - right) ** 2)) - least

        likely = float(chdtri(max(1, len(best.shares) - 1), MISSED))
        least = float(np.sum((columns @ _least(columns, right) - right) ** 2))
        found = np.zeros((len(best.shares), 2))
        for k, share in enumerate(best.shares):
            for side, end in enumerate((0.0, 1.0)):
                inside, outside = float(share), end
                if worse(k, end) <= likely:
                    inside = end
                for _ in range(BISECTIONS if inside != end else 0):
                    middle = 0.5 * (inside + outside)
                    inside, outside = (middle, outside) if worse(k, middle) <= likely else (inside, middle)
                found[k, side] = inside
        return found

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
        if self.clock.is_over:
            return None
        given = {"constants": self._given(shares), **self.clock.option()}
        solution = self.model.solve(max_iterations=ITERATIONS, warm_start=near, **given)
        if solution.status != "optimal":
            return None
        return Weighing(shares, solution, float(np.sqrt(np.mean(self._residual(solution) ** 2))))

    def _residual(self, solution: Solution) -> FloatArray:
        """The differences of all coordinates at all frames between a motion and the recorded one."""
        return np.asarray(solution.x[self._places] - self.target.reshape(-1))

    def _slopes(self, best: Weighing) -> FloatArray:
        """(coordinates, k) how the optimal motion changes with the shares."""
        solution = best.solution
        tangent = self._tangent(best.shares, solution)
        return tangent.moves(solution.row_multipliers, self._gradients(solution.x))[self._places]


def _least(columns: FloatArray, right: FloatArray) -> FloatArray:
    """The shares w >= 0 with the sum 1 for which ``columns @ w`` is nearest to ``right``; small ones are none."""
    from scipy.optimize import nnls

    scale = max(float(np.abs(columns).max(initial=0.0)), float(np.abs(right).max(initial=0.0)), 1e-300)
    ones = 1e3 * scale * np.ones((1, columns.shape[1]))
    found = nnls(np.vstack([columns, ones]), np.append(right, ones[0, 0]))[0]
    found[found < NONE * found.max(initial=0.0)] = 0.0
    return np.asarray(found / max(float(found.sum()), 1e-300))
