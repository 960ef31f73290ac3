"""Equations of motion as tables of terms, and the comparison of two tables entry by entry.

Written for joint j as ``sum_i M_ji a_i + (static) + (products of velocities) + (damping) - (forces) = 0``, the
equations of motion at one position are a table: a row per joint, a column per term.  A spec may write its rows
in another order, scaled, or combined (solved for the accelerations, say), which multiplies its table from the
left by some matrix.  :func:`matched` looks for the matrix that leaves the fewest entries different from the
model's; what then remains is where the two disagree.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from stc.records import dataclass

FloatArray = NDArray[np.float64]

#: Entries of the two tables that differ by less than this share of their kind's largest count as equal.
TOLERANCE = 1e-9

#: Random selections of columns that are tried as a basis where rows are combined.
_TRIALS = 200

MASS, STATIC, PRODUCT, DAMPING, FORCE = "mass matrix", "static force", "velocity product", "damping", "force"

#: Instead of the three in the middle, where these cannot be told apart.
TOGETHER = "static force and what velocities add"


@dataclass(frozen=True, slots=True)
class Term:
    """A column of the table: its kind, and the words that name it."""

    kind: str
    words: str
    joint: str = ""

    def of(self, joint: str) -> str:
        """The name of the entry in a joint's row."""
        return f"mass matrix entry ({joint}, {self.joint})" if self.kind == MASS else self.words


@dataclass(frozen=True, slots=True)
class Difference:
    """An entry in which spec and model differ.

    Attributes:
        joint: whose row it is in.
        term: the name of the entry.
        kind: of the term.
        spec: value according to the spec, at the state where the difference is largest.
        model: value according to the model.
        share: the difference as a share of the largest entry of the kind.
    """

    joint: str
    term: str
    kind: str
    spec: float
    model: float
    share: float

    def __str__(self) -> str:
        size = max(abs(self.spec), abs(self.model))
        gap = abs(self.spec - self.model) / size if size > 0.0 else 1.0
        digits = int(np.clip(3 - np.floor(np.log10(max(gap, 1e-14))), 3, 16))
        numbers = f"spec {self.spec:.{digits}g}, model {self.model:.{digits}g}"
        return f"joint {self.joint}: {self.term}: {numbers}"


def differences(
    spec: FloatArray, model: FloatArray, terms: Sequence[Term], joints: Sequence[str]
) -> list[Difference]:
    """The entries in which two tables differ; first the one with the largest difference relative to its kind in its
    row.

    A wrong inertia somewhere in a chain adds the same to the rows of all joints before it; it weighs most in the
    row of the joint that carries least.

    Args:
        spec: (S, k, C) the spec's table at S states, its rows in the order of the joints.
        model: (S, k, C) the model's.
        terms: the columns.
        joints: names of the rows.
    """
    gaps = np.abs(spec - model)
    shares = gaps / scales(model, spec, terms)[:, None, :]
    found = []
    for row, joint in enumerate(joints):
        for column, term in enumerate(terms):
            at = int(np.argmax(shares[:, row, column]))
            share = float(shares[at, row, column])
            if not share <= TOLERANCE:
                kind = [c for c, other in enumerate(terms) if other.kind == term.kind]
                size = float(np.abs(model[:, row, kind]).max())
                weight = float(gaps[at, row, column]) / size if size > 0.0 else share
                values = float(spec[at, row, column]), float(model[at, row, column])
                found.append((weight, Difference(joint, term.of(joint), term.kind, *values, share)))
    return [difference for _, difference in sorted(found, key=lambda pair: -pair[0])]


def scales(model: FloatArray, spec: FloatArray, terms: Sequence[Term]) -> FloatArray:
    """(S, C) the scale of each column: the largest entry of its kind, in the model if there is any."""
    groups: dict[object, list[int]] = {}
    for column, term in enumerate(terms):
        # Static forces and those of unit velocities are of one order; each outer force has its own.
        key = (term.kind, column) if term.kind == FORCE else (term.kind == MASS)
        groups.setdefault(key, []).append(column)
    found = np.ones((len(model), len(terms)))
    for columns in groups.values():
        largest = np.abs(model[:, :, columns]).max(axis=(1, 2))
        other = np.abs(spec[:, :, columns]).max(axis=(1, 2))
        largest = np.where(largest > 0.0, largest, np.where(other > 0.0, other, 1.0))
        found[:, columns] = largest[:, None]
    return found


def matched(
    spec: FloatArray, model: FloatArray, terms: Sequence[Term], joint_maps: FloatArray | None
) -> FloatArray:
    """The spec's table with its rows sorted, scaled or combined so that the fewest entries differ.

    Rows that belong to coordinates are balances of generalised forces on them, which ``joint_maps`` alone turns into
    those on the joints: if they could be scaled, a wrong mass could not be distinguished from a wrong force.

    Args:
        spec: (S, k, C) table at S states, rows as the spec writes them.
        model: (S, k, C) the model's table.
        terms: the columns; the first k are the mass matrix.
        joint_maps: (S, k, k) dq/dx where the spec's rows belong to its coordinates x one by one, or None.

    Returns:
        (S, k, C) the table to compare with the model's.
    """
    if joint_maps is not None:  # generalised forces: nothing is left to choose
        return np.asarray(np.linalg.solve(joint_maps.transpose(0, 2, 1), spec))
    best = _sorted_and_scaled(spec, model, terms)
    wrong = _mismatches(best, model, terms)
    if wrong == 0:
        return best
    # With more freedom a few more entries can always be made to agree: it has to be many.
    others = [_combined(spec, model, terms), _solved(spec, model)]
    other = min(others, key=lambda table: _mismatches(table, model, terms))
    return other if _mismatches(other, model, terms) <= wrong / 2 else best


def _mismatches(table: FloatArray, model: FloatArray, terms: Sequence[Term]) -> float:
    """Average number of entries that differ at a state."""
    if not np.all(np.isfinite(table)):
        return np.inf
    differ = ~(np.abs(table - model) <= TOLERANCE * scales(model, table, terms)[:, None, :])
    return float(differ.sum(axis=(1, 2)).mean())


def _sorted_and_scaled(spec: FloatArray, model: FloatArray, terms: Sequence[Term]) -> FloatArray:
    """Every row of the spec given to one joint and scaled, so that most entries agree."""
    from scipy.optimize import linear_sum_assignment

    states, k, _ = model.shape
    scale = scales(model, spec, terms)
    agree = np.zeros((states, k, k))
    factor = np.ones((states, k, k))
    with np.errstate(all="ignore"):
        for row in range(k):
            for joint in range(k):
                agree[:, row, joint], factor[:, row, joint] = _best_factor(
                    spec[:, row], model[:, joint], scale
                )
    rows, joints = linear_sum_assignment(-agree.sum(axis=0))
    table = np.zeros_like(model)
    for row, joint in zip(rows, joints):
        table[:, joint] = factor[:, row, joint, None] * spec[:, row]
    return table


def _best_factor(row: FloatArray, target: FloatArray, scale: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Per state the factor that makes most entries of ``row`` (S, C) those of ``target``, and the agreement.

    A mistake in one constant may change most entries of a row and leave them proportional, so that another
    scale would make a few more agree.  Most rows are written as a balance of forces: 1 and -1
    have the advantage of an entry more for each that the row has.
    """
    ratios = target / row
    ratios[~np.isfinite(ratios) | (ratios == 0.0)] = 1.0
    ones = np.ones((len(row), 1))
    candidates = np.concatenate([ones, -ones, ratios], axis=1)
    scaled = candidates[:, :, None] * row[:, None, :]
    involved = (np.abs(target) > TOLERANCE * scale)[:, None, :] | (
        np.abs(scaled) > TOLERANCE * scale[:, None, :]
    )
    equal = np.abs(scaled - target[:, None, :]) <= TOLERANCE * scale[:, None, :]
    # An entry that agrees counts for, one that differs counts against.
    score = (involved & equal).sum(axis=2) - (involved & ~equal).sum(axis=2).astype(np.float64)
    score[:, :2] += involved[:, :2].sum(axis=2)
    score[:, 1] -= 0.125
    best = np.argmax(score, axis=1)
    at = np.arange(len(row))
    return score[at, best], candidates[at, best]


def _solved(spec: FloatArray, model: FloatArray) -> FloatArray:
    """The rows combined so that the mass matrix is the model's: for rows solved for the accelerations."""
    k = model.shape[1]
    try:
        combine = model[:, :, :k] @ np.linalg.inv(spec[:, :, :k])
    except np.linalg.LinAlgError:
        return np.full_like(model, np.nan)
    return np.asarray(combine @ spec)


def _combined(spec: FloatArray, model: FloatArray, terms: Sequence[Term]) -> FloatArray:
    """The rows combined at random, keeping for each joint what makes most entries agree.

    A combination is determined by the columns in which it is exact; those that hold a mistake make it a bad
    one, and among many selections some avoid them (Fischler and Bolles 1981, random sample consensus).
    """
    states, k, _ = model.shape
    scale = scales(model, spec, terms)
    rng = np.random.default_rng(0)
    table = np.full_like(model, np.nan)
    best = np.full((states, k), -1)
    used = np.flatnonzero((np.abs(spec).max(axis=(0, 1)) > 0) | (np.abs(model).max(axis=(0, 1)) > 0))
    if len(used) < k:
        return table
    for _ in range(_TRIALS):
        chosen = rng.choice(used, k, replace=False)
        basis = spec[:, :, chosen]
        good = np.linalg.cond(basis) < 1e6
        if not good.any():
            continue
        combine = np.zeros((states, k, k))
        combine[good] = model[good][:, :, chosen] @ np.linalg.inv(basis[good])
        trial = combine @ spec
        agree = (np.abs(trial - model) <= TOLERANCE * scale[:, None, :]).sum(axis=2)
        better = good[:, None] & (agree > best)
        best = np.where(better, agree, best)
        table = np.where(better[:, :, None], trial, table)
    return table
