"""The pivots of a stage, planned for eight segments at once: one order, in panels, for all stages of a kind."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from stc.arrays import distinct
from stc.records import dataclass
from stc.solver.kkt.lane_panel import PANEL, panel_vectors
from stc.solver.kkt.ordering import MARGIN, SECOND, SETS, SMALLEST, order_stage
from stc.solver.kkt.segments import ACROSS, BORDERING, INSIDE, Segmentation
from stc.solver.kkt.slot_sets import words_of
from stc.solver.nlp import Floats

__all__ = [
    "WAYS",
    "Kind",
    "Program",
    "effort_of",
    "kind_of",
    "order_pivots",
    "own_sizes",
    "plan_panels",
    "triangle",
]

Int32s = NDArray[np.int32]
Int64s = NDArray[np.int64]

#: Rounds of planning: what a stage leaves to the next is known when that has been planned once.
ROUNDS = 1
#: What may be left by another stage where nothing is known yet.
UNKNOWN = 1e-2
#: Pivots of about equal cost that are compared.
CANDIDATES = 500
#: Ways to choose pivots (see ``order_stage``: margin and compared). An order is found greedily, and no way leads to the
#: fewest operations with all stages; of 50 ways these do best together with 67 stages of bundled motions, of chains and
#: of those of bench/kinds.py, within 2.4 % of the best of all in the mean. The first one is to be sure: those that
#: expect smaller pivots take less, but twice as many matrices of a beginning are refused.
WAYS = (
    (0.1 * MARGIN, 1.5),
    (0.01 * MARGIN, 3.0),
    (0.01 * MARGIN, 1.2),
    (0.1 * MARGIN, 2.5),
    (100.0 * MARGIN, 2.0),
)
#: Cycles that a panel takes for each row besides its products, and for each product by members.
ROW_CYCLES = 5.0
PRODUCT_CYCLES = (0.0, 1.3, 1.6, 1.9, 2.2)


@dataclass(frozen=True)
class Kind:
    """What stages of one kind have in common (see stc.solver.kkt.lanes for U, F, L and B).

    Attributes:
        own, variables: unknowns of U, and how many of them, the first ones, are variables.
        following: places of F in the next stage, (F,); each of them, in a segment's first stage, couples with one of L;
            border: numbers of B among the border, (B,).
        rows, columns: places of the entries of a stage in the triangle, in the order of the codes.
    """

    own: int
    variables: int
    following: Int64s
    border: Int64s
    rows: Int64s
    columns: Int64s

    @property
    def near(self) -> int:
        """Unknowns of U and F."""
        return self.own + self.following.size

    @property
    def size(self) -> int:
        """Rows of the triangle."""
        return self.near + self.following.size + self.border.size

    @property
    def first_rows(self) -> Int64s:
        """Where L is in the triangle, (F,): its entries are in these rows and the columns ``following``."""
        return self.near + np.arange(self.following.size)

    @property
    def carried(self) -> Int64s:
        """Where F, L and B of a step are at the next one."""
        return np.concatenate([self.following, np.arange(self.near, self.size)])

    @property
    def moved(self) -> tuple[Int64s, Int64s]:
        """Places of the triangle in which a step leaves something for the next one, and where it is there."""
        a, b = np.tril_indices(self.size - self.own)
        moving = b < self.following.size
        carried = self.carried
        return triangle(self.own + a, self.own + b)[moving], triangle(carried[a], carried[b])[moving]

    @property
    def order(self) -> tuple[Int64s, int]:
        """In which entries are loaded, (entries,): first those that are added to something carried over, so many."""
        is_carried = np.zeros(self.size * (self.size + 1) // 2, dtype=bool)
        is_carried[self.moved[1]] = True
        added = is_carried[triangle(self.rows, self.columns)]
        return np.argsort(~added, kind="stable"), int(added.sum())


class HasEntries(Protocol):
    """A kind of stages: see ``Kind`` and ``stc.solver.kkt.chain_plan.ChainKind``."""

    @property
    def own(self) -> int: ...

    @property
    def variables(self) -> int: ...

    @property
    def rows(self) -> Int64s: ...

    @property
    def columns(self) -> Int64s: ...


@dataclass(frozen=True)
class Program:
    """Panels of a kind.

    Attributes:
        panels: each as in ``stc.solver.kkt.lanes``.
        used: which places of the triangle the panels touch.
        vectors: how many vectors the factors of a step have.
        operations: additions and multiplications of a stage.
    """

    panels: list[Int32s]
    used: NDArray[np.bool_]
    vectors: int
    operations: int


def triangle(rows: Int64s, columns: Int64s) -> Int64s:
    """Places in the triangle."""
    high, low = np.maximum(rows, columns), np.minimum(rows, columns)
    return high * (high + 1) // 2 + low


def kind_of(found: Segmentation, number: int, variables: int) -> Kind:
    """Lay out the triangle; ``variables`` of the stage's unknowns are variables."""
    codes, base, example = found.codes[number], found.base, found.example[number]
    pointers = found.stages.pointers
    own = int(pointers[example + 1] - pointers[example])
    types, i, j = codes // base**2, codes // base % base, codes % base
    across, bordering = types == ACROSS, types == BORDERING
    following, border = distinct(j[across]), distinct(j[bordering])
    near = own + following.size
    rows = np.where(types == INSIDE, i, 0)
    columns = np.where(types == INSIDE, j, i)
    rows[across] = own + np.searchsorted(following, j[across])
    rows[bordering] = near + following.size + np.searchsorted(border, j[bordering])
    return Kind(own, variables, following, border, rows, columns)


def effort_of(ways: int, size: int) -> int:
    """As many operations as can be made while so many orders of a window's rows are tried and one is written down.

    Measured on a machine of 2022 with chains and segments of 20 to 180 rows.
    """
    return ways * (6 * size**3 + 4_000_000) + 6_000_000


def plan_panels(kind: Kind, entries: Floats, diagonal: Floats, *, thorough: bool) -> list[Program]:
    """Order the pivots for entries and diagonal (own,) like these, in one way, or, when ``thorough``, in all ways.

    Returns:
        Those with different numbers of operations, the fewest first.
    """
    programs = [_planned(kind, entries, diagonal, *way) for way in (WAYS if thorough else WAYS[:1])]
    different = {program.operations: program for program in reversed(programs)}
    return [different[operations] for operations in sorted(different)]


def _planned(kind: Kind, entries: Floats, diagonal: Floats, margin: float, compared: float) -> Program:
    """The same in one way."""
    size, own = kind.size, kind.own
    stage = own_sizes(kind, size, entries, diagonal)
    carried = kind.carried
    left = np.zeros((carried.size, carried.size))
    ends = np.arange(kind.following.size, carried.size)
    left[: kind.following.size, ends] = UNKNOWN
    left[ends, : kind.following.size] = UNKNOWN
    for _ in range(ROUNDS):
        sizes = stage.copy()
        sizes[np.ix_(carried, carried)] += np.where(left == 0.0, SMALLEST, left)
        sizes[own:, own:] = 0.0
        before = sizes.copy()
        order, kinds = order_pivots(own, sizes, margin, compared)
        left = sizes[own:, own:]
    pattern = before != 0.0
    np.fill_diagonal(pattern, False)
    pattern[own:, own:] = False
    return _panels(kind, order, kinds, pattern)


def own_sizes(kind: HasEntries, size: int, entries: Floats, diagonal: Floats) -> Floats:
    """What a stage brings along, (size, size): its entries and the diagonal of its own unknowns."""
    stage = np.zeros((size, size))
    sizes = np.copysign(np.maximum(np.abs(entries), SMALLEST), entries)
    stage[kind.rows, kind.columns] = sizes
    stage[kind.columns, kind.rows] = sizes
    inner = np.arange(kind.own)
    # Every unknown may have a diagonal entry, if a tiny one, and rows a negative one.
    sign = np.where(inner < kind.variables, 1.0, -1.0)
    stage[inner, inner] = np.where(np.abs(diagonal) > SMALLEST, diagonal, sign * SMALLEST)
    return stage


def order_pivots(own: int, sizes: Floats, margin: float, compared: float) -> tuple[Int32s, Int32s]:
    """Order and kinds of the pivots; ``sizes`` is left as they leave it."""
    size = len(sizes)
    waiting = np.arange(own, dtype=np.int32)
    degree, row_p, row_q = (np.empty(size, dtype=np.int32) for _ in range(3))
    order, kinds = np.empty(own, dtype=np.int32), np.empty(own, dtype=np.int32)
    starts = np.empty(own + 1, dtype=np.int32)
    lists = np.empty((own + 1) * size, dtype=np.int32)
    first, second = np.empty(CANDIDATES, dtype=np.int32), np.empty(CANDIDATES, dtype=np.int32)
    order_stage(
        size, own, waiting, margin, compared, 1, sizes.reshape(-1), degree, np.empty(size), row_p, row_q,
        np.empty((size + SETS) * words_of(size), dtype=np.int64),
        first.size, first, second, np.empty(first.size), order, kinds, starts, lists.size, lists,
    )  # fmt: skip
    return order, kinds


def _cycles(members: int, rows: int) -> float:
    products = 0.5 * rows * (rows + 1) * PRODUCT_CYCLES[members] + members * (members + 2 * rows)
    return ROW_CYCLES * rows + products


def _panels(kind: Kind, order: Int32s, kinds: Int32s, pattern: NDArray[np.bool_]) -> Program:
    """Join consecutive pivots to panels where that is cheaper; sets of unknowns are the bits of a number."""
    size = kind.size
    coupled = [int.from_bytes(np.packbits(row, bitorder="little").tobytes(), "little") for row in pattern]
    pivots: list[tuple[list[int], list[int]]] = []
    for p, kind_of_pivot in zip(order.tolist(), kinds.tolist(), strict=True):
        if kind_of_pivot == SECOND:
            pivots[-1][0].append(p)
            pivots[-1][1].append(SECOND)
        else:
            pivots.append(([p], [2 if kind_of_pivot == 2 else 1]))
    panels: list[Int32s] = []
    used = np.zeros(size * (size + 1) // 2, dtype=bool)
    vectors = operations = 0
    k = 0
    while k < len(pivots):
        members, member_kinds = list(pivots[k][0]), list(pivots[k][1])
        rows = _union(coupled, members)
        k += 1
        while k < len(pivots) and len(members) + len(pivots[k][0]) <= PANEL:
            more = pivots[k][0]
            alone = _union(coupled, more)
            if any(rows >> p & 1 for p in more):
                alone |= rows
            alone &= ~_bits([*members, *more])
            together = (rows | alone) & ~_bits(more)
            apart = _cycles(len(members), rows.bit_count()) + _cycles(len(more), alone.bit_count())
            if _cycles(len(members) + len(more), together.bit_count()) > apart:
                break
            members += more
            member_kinds += pivots[k][1]
            rows = together
            k += 1
        gone = ~_bits(members)
        listed = _listed(rows)
        for r in listed:
            coupled[r] = (coupled[r] | rows) & ~(1 << r) & gone
        row_array, who = np.array(listed, dtype=np.int64), np.array(members, dtype=np.int64)
        sources = triangle(who[:, None], np.concatenate([who, row_array])[None, :])
        used[sources] = True
        used[triangle(row_array[:, None], row_array[None, :])] = True
        panels.append(
            np.concatenate(
                [[len(members), len(listed)], member_kinds, members, listed, sources.reshape(-1)]
            ).astype(np.int32)
        )
        vectors += panel_vectors(len(members), len(listed))
        operations += who.size * row_array.size * (row_array.size + 1 + who.size)
    return Program(panels, used, vectors, operations)


def _bits(members: list[int]) -> int:
    return sum(1 << p for p in members)


def _union(coupled: list[int], members: list[int]) -> int:
    rows = 0
    for p in members:
        rows |= coupled[p]
    return rows & ~_bits(members)


def _listed(rows: int) -> list[int]:
    found = []
    while rows:
        low = rows & -rows
        found.append(low.bit_length() - 1)
        rows ^= low
    return found
