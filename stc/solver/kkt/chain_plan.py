"""The pivots of a chain, planned: one order, in panels, for stages that are alike.

For what a program is, see stc.solver.kkt.chain_elimination.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.arrays import distinct
from stc.records import dataclass
from stc.solver.kkt import chain_elimination as chain
from stc.solver.kkt.chain_elimination import BLOCK
from stc.solver.kkt.chain_panel_plan import Panels, join_panels, write_panels
from stc.solver.kkt.lane_program import order_pivots, own_sizes
from stc.solver.kkt.lane_values import SAMPLE, middle, reliable
from stc.solver.kkt.ordering import SMALLEST
from stc.solver.kkt.segments import ACROSS, BORDERING, INSIDE, Numbered
from stc.solver.nlp import Floats

__all__ = ["WAYS", "Chain", "ChainKind", "ChainProgram", "lay_out_chain", "plan_chain"]

Int32s = NDArray[np.int32]
Int64s = NDArray[np.int64]

#: Ways to choose pivots (see ``order_stage``: margin and compared); of 42 these lead to the fewest cycles together,
#: with chains of 5, 7 and 10 rods and a lamp.
WAYS = ((1e-3, 1.5), (1e-4, 2.0), (1e-4, 1.0), (1e-3, 2.0))
#: Below this, what a stage leaves is nothing: numbers that cancel.
NOTHING = 1e-9


@dataclass(frozen=True)
class ChainKind:
    """What stages of one kind have in common (see stc.solver.kkt.chain_elimination for U, F and B).

    Attributes:
        own, variables: unknowns of U, and how many of them, the first ones, are variables.
        following: places of F in the next stage's U, (F,).
        arrived: places of the last stage's F in U; joined: the same of a second part of the chain that ends here.
        border: how many unknowns B has; at the last stage of all they are U.
        backwards: whether they are of the part that comes from the last stage: others have the same entries with other
            signs there.
        rows, columns: of the entries, in the order of the codes: places in U, then in F, then in B.
    """

    own: int
    variables: int
    following: Int64s
    arrived: Int64s
    joined: Int64s
    border: int
    backwards: bool
    rows: Int64s
    columns: Int64s

    @property
    def outer(self) -> int:
        """Unknowns of B and F."""
        return self.border + self.following.size

    @property
    def key(self) -> bytes:
        """Equal for kinds that are the same."""
        places = self.following, self.arrived, self.joined
        sizes = np.array(
            [self.own, self.variables, self.border, self.backwards, *(place.size for place in places)]
        )
        return np.concatenate([sizes, *places, self.rows, self.columns]).tobytes()


@dataclass(frozen=True)
class Chain:
    """Stages in the order of their elimination; with a border, that is one more.

    Attributes:
        kinds: what there is; kind: of each stage, (S,).
        order: the unknowns stage by stage, B last, (N,); base: where those of each stage are, (S + 1,).
        edges: the couplings by stage, then by code, (E,); begin: where those of each stage are, (S + 1,).
        after: the stage to which each leaves something, (S,), itself where there is none.
        parts: how many stages either part has, where there are two: what they leave meets in the next stage.
    """

    kinds: list[ChainKind]
    kind: Int64s
    order: Int64s
    base: Int64s
    edges: Int64s
    begin: Int64s
    after: Int64s
    parts: tuple[int, ...]


@dataclass(frozen=True)
class ChainProgram:
    """A kind's program.

    Attributes:
        code: see chain_elimination.
        rows: where each unknown of U is among these in the window, (U,); following: see ``ChainKind``.
        entries: the order of a stage's entries, -1 for zeros between them and behind them, (E,).
        factors, matrix: numbers that a stage needs.
        operations: additions and multiplications of a stage.
    """

    code: Int32s
    rows: Int64s
    following: Int64s
    entries: Int64s
    factors: int
    matrix: int
    operations: int


def lay_out_chain(
    numbered: Numbered, variables: int, first: Int32s, second: Int32s, parts: tuple[int, ...] = ()
) -> Chain:
    """Put all stages in a row.

    Args:
        parts: how many stages come from either end (see stc.solver.kkt.folding), or none.
        variables: how many of the unknowns, the first ones, are variables.
        first, second: the two unknowns of each coupling, (E,).
    """
    stages = numbered.stages
    count = stages.pointers.size - 1
    border = stages.border
    is_border = np.zeros(stages.stage.size, dtype=bool)
    is_border[border] = True
    stage_of = np.where(is_border, count, stages.stage)
    order = np.argsort(stage_of, kind="stable")
    order[order.size - border.size :] = border
    total = count + (border.size > 0)
    base = np.concatenate([[0], np.cumsum(np.bincount(stage_of, minlength=total))]).astype(np.int64)
    place = np.empty(order.size, dtype=np.int64)
    place[order] = np.arange(order.size)
    own_place = place - base[stage_of]
    edge_stage = np.where(numbered.edge_stage < 0, count, numbered.edge_stage)
    edges = np.lexsort((numbered.edge_code, edge_stage))
    begin = np.searchsorted(edge_stage[edges], np.arange(total + 1)).astype(np.int64)

    _, alike = np.unique(numbered.features, axis=1, return_inverse=True)
    alike = alike.reshape(-1).astype(np.int64)
    irregular = np.flatnonzero(numbered.irregular)
    alike[irregular] = count + irregular
    before, after = np.arange(-1, count - 1), np.append(np.arange(1, count), -1)
    joining = -1
    if parts:
        alike[parts[0] : count - 1] += 2 * count
        alike[count - 1] = 4 * count  # like no other
        joining = count - 2
        before[[parts[0], count - 1]] = -1, parts[0] - 1
        after[parts[0] - 1] = count - 1
    padded = np.append(alike, -1)
    triples = np.stack([padded[before], alike, padded[after]])
    _, examples, group = np.unique(triples, axis=1, return_index=True, return_inverse=True)
    kinds: list[ChainKind] = []
    known: dict[bytes, int] = {}
    numbers = np.empty(examples.size, dtype=np.int64)

    def entries_of(stage: int) -> tuple[Int64s, Int64s, Int64s]:
        """Rows and columns of the entries of a stage, and its F."""
        own = edges[begin[stage] : begin[stage + 1]]
        a, b = first[own], second[own]
        codes = numbered.edge_code[own]
        types = codes // numbered.base**2
        # The unknown of this stage first: of two, either.
        swap = (stage_of[a] != stage) | ((types == INSIDE) & (a < b))
        a, b = np.where(swap, b, a), np.where(swap, a, b)
        following = distinct(own_place[b[types == ACROSS]])
        size = int(base[stage + 1] - base[stage])
        columns = own_place[b].copy()
        across, bordering = types == ACROSS, types == BORDERING
        columns[across] = size + np.searchsorted(following, columns[across])
        columns[bordering] += size + following.size
        return own_place[a], columns, following

    nothing = np.zeros(0, dtype=np.int64)
    for number, stage in enumerate(examples.tolist()):
        rows, columns, following = entries_of(stage)
        arrived = entries_of(int(before[stage]))[2] if before[stage] >= 0 else nothing
        joined = entries_of(joining)[2] if parts and stage == count - 1 else nothing
        own = order[base[stage] : base[stage + 1]]
        kind = ChainKind(
            own.size,
            int((own < variables).sum()),
            following,
            arrived,
            joined,
            border.size,
            bool(parts) and parts[0] <= stage < count - 1,
            rows,
            columns,
        )
        numbers[number] = known.setdefault(kind.key, len(kinds))
        if numbers[number] == len(kinds):
            kinds.append(kind)
    kind_of_stage = numbers[group.reshape(-1)]
    if border.size:
        rows, columns, _ = entries_of(count)
        many = int((border < variables).sum())
        kinds.append(
            ChainKind(border.size, many, nothing, np.arange(border.size), nothing, 0, False, rows, columns)
        )
        kind_of_stage = np.concatenate([kind_of_stage, [len(kinds) - 1]])
    after = np.where(after >= 0, after, np.arange(count))
    after = np.concatenate([after, np.arange(count, total)])
    return Chain(kinds, kind_of_stage, order, base, edges, begin, after, parts)


def plan_chain(
    chain: Chain, stride: int, values: Floats, diagonal: Floats, *, thorough: bool
) -> tuple[list[ChainProgram], Int64s]:
    """Programs for entries like these, in the best of all ways when ``thorough``, and which one each stage has.

    Stages of a kind have one program where the ones before them leave entries at the same places: what cancels there,
    because a horizon has only just begun, can be no pivot.

    Args:
        stride: numbers of a row of the window.
        values: of all couplings, scaled, (E,); diagonal: of all unknowns, scaled, (N,).
    """
    numbers = np.empty(chain.kind.size, dtype=np.int64)
    programs: list[ChainProgram] = []
    states = [np.zeros((0, 0))]
    known: dict[bytes, int] = {b"": 0}
    steps: dict[tuple[int, int, int], tuple[int, int]] = {}
    sizes = {}
    state = waiting = 0
    turn, end = (chain.parts[0], sum(chain.parts)) if chain.parts else (-1, -1)
    for stage, number in enumerate(chain.kind.tolist()):
        other = 0
        if stage == turn:  # the second part begins with nothing
            waiting, state = state, 0
        elif stage == end:
            state, other = waiting, state
        step = steps.get((number, state, other))
        if step is None:
            kind = chain.kinds[number]
            if number not in sizes:
                sizes[number] = _sizes(chain, np.flatnonzero(chain.kind == number), values, diagonal)
            ways = (
                _ordered(kind, *sizes[number], states[state], states[other], margin, compared)
                for margin, compared in (WAYS if thorough else WAYS[:1])
            )
            best = min(ways, key=lambda ordered: ordered.cycles)
            left = best.left
            signature = (np.abs(left) > NOTHING).tobytes() + bytes([left.shape[0] > 0])
            following = known.setdefault(signature, len(states))
            if following == len(states):
                states.append(left)
            step = steps[number, state, other] = len(programs), following
            programs.append(_program(kind, stride, best))
        numbers[stage], state = step
    return programs, numbers


def _sizes(chain: Chain, stages: Int64s, values: Floats, diagonal: Floats) -> tuple[Floats, Floats]:
    """One size for each entry of all stages of a kind, and for each unknown of U."""
    chosen = stages[:: -(-stages.size // SAMPLE)]
    first = chosen[0]
    members = chain.edges[
        chain.begin[chosen][:, None] + np.arange(chain.begin[first + 1] - chain.begin[first])
    ]
    unknowns = chain.order[chain.base[chosen][:, None] + np.arange(chain.base[first + 1] - chain.base[first])]
    return _middle(values[members]), _middle(diagonal[unknowns])


def _middle(values: Floats) -> Floats:
    """``middle`` of columns, as far as it is reliable."""
    place = np.broadcast_to(np.arange(values.shape[1]), values.shape)
    means = middle(place.reshape(-1), values.reshape(-1), values.shape[1])
    return reliable(means, np.abs(values).min(axis=0, initial=np.inf))


@dataclass(frozen=True)
class _Ordered:
    """The pivots of a kind.

    Attributes:
        kinds: of the pivots; slot: the row of the window of each unknown of U, F and B.
        panels: see ``Panels``.
        cycles: what it takes, about.
        left: sizes of what is left for the next stage, for B and F.
    """

    kinds: Int32s
    slot: Int64s
    panels: Panels
    cycles: float
    left: Floats


def _ordered(
    kind: ChainKind, entries: Floats, diagonal: Floats, left: Floats, other: Floats, margin: float, compared: float
) -> _Ordered:  # fmt: skip
    """Order the pivots for these sizes, after a stage that has left others, and one of a second part if that ends."""
    own, following, border = kind.own, kind.following.size, kind.border
    size = own + following + border
    sizes = own_sizes(kind, size, entries, diagonal)
    b = own + following + np.arange(border)
    for places, what in ((kind.arrived, left), (kind.joined, other)):
        arrived = np.concatenate([b, places]).astype(np.int64)
        if what.size:
            sizes[np.ix_(arrived, arrived)] += np.where(what == 0.0, SMALLEST, what)
    sizes[own:, own:] = 0.0
    pattern = sizes != 0.0
    np.fill_diagonal(pattern, False)
    order, kinds = order_pivots(own, sizes, margin, compared)
    slot = np.empty(size, dtype=np.int64)
    slot[own : own + following] = border + np.arange(following)
    slot[b] = np.arange(border)
    slot[order] = size - 1 - np.arange(own)
    coupled = np.zeros((size, size), dtype=np.int32)
    coupled[np.ix_(slot, slot)] = pattern
    outer = np.concatenate([b, own + np.arange(following)])
    return _Ordered(kinds, slot, *join_panels(size, kinds, coupled), sizes[np.ix_(outer, outer)])


def _blocks(high: Int64s, low: Int64s) -> tuple[Int64s, Int64s]:
    """The blocks of the window that have entries, row by row, and the order of these.

    Args:
        high, low: row and column of each entry, (E,).

    Returns:
        Of each block RECORD numbers, see chain_elimination; of each place there the entry, -1 where there is none.
    """
    order = np.lexsort((low, high))
    row, column = high[order], low[order]
    is_new = np.ones(order.size, dtype=bool)
    is_new[1:] = (np.diff(column // BLOCK) != 0) | (np.diff(row) != 0)
    begin = np.flatnonzero(is_new)
    counts = np.diff(begin, append=order.size)
    first, last = column[begin] % BLOCK, column[begin + counts - 1] % BLOCK
    spans = last - first + 1
    places = np.cumsum(spans) - spans - first
    entries = np.full(chain.padded(int(spans.sum())), -1, dtype=np.int64)
    entries[np.repeat(places, counts) + column % BLOCK] = order
    records = column[begin] - first, row[begin], (2 << last) - (1 << first), places
    return np.stack(records, axis=1), entries


def _program(kind: ChainKind, stride: int, ordered: _Ordered) -> ChainProgram:
    """Everything for a kind whose pivots are taken in this order."""
    own, following = kind.own, kind.following.size
    outer, size = kind.outer, own + kind.outer
    kinds, slot, panels = ordered.kinds, ordered.slot, ordered.panels
    blocks_of = np.arange(size) // BLOCK
    high, low = (
        np.maximum(slot[kind.rows], slot[kind.columns]),
        np.minimum(slot[kind.rows], slot[kind.columns]),
    )
    blocks_held, entries = _blocks(high, low)
    block_columns, block_rows = blocks_held[:, 0], blocks_held[:, 1]
    filled = np.zeros((size, stride // BLOCK), dtype=bool)
    carried = []
    for come, many in ((kind.arrived, True), (kind.joined, kind.joined.size > 0)):
        arrived = np.concatenate([slot[own + following :], slot[come]]) if many else come
        a, b = np.tril_indices(arrived.size)
        to_high, to_low = np.maximum(arrived[a], arrived[b]), np.minimum(arrived[a], arrived[b])
        filled[to_high, to_low // BLOCK] = True
        carried.append((arrived.size, to_high * stride + to_low))
    filled[np.arange(size), blocks_of] = True
    filled[:outer] = True  # what is left is copied as a whole
    lists = np.empty(panels.high.size * (6 + 2 * (stride // BLOCK)) + 2 * panels.rows.size, dtype=np.int32)
    places = np.empty(2 * panels.high.size, dtype=np.int32)
    marks = np.zeros(filled.size, dtype=np.int32)
    totals = np.zeros(3, dtype=np.int64)
    write_panels(
        panels.high.size, size, stride, panels.high, panels.members, panels.begin, panels.rows, kinds,
        np.empty(stride // BLOCK + 1, dtype=np.int32), lists, places, marks, totals,
    )  # fmt: skip
    listed, factors, operations = totals.tolist()
    filled |= marks.reshape(filled.shape) != 0
    filled &= np.arange(stride // BLOCK) <= blocks_of[:, None]
    filled[block_rows, block_columns // BLOCK] = False  # entries take their places
    cleared_rows, cleared_blocks = np.nonzero(filled)
    row, count = np.unique(block_rows, return_counts=True)
    header = np.zeros(chain.PROGRAM, dtype=np.int64)
    parts: list[NDArray[np.integer]] = [header]
    length = header.size

    def put(field: int, part: NDArray[np.integer]) -> None:
        nonlocal length
        header[field] = length
        parts.append(part)
        length += part.size

    header[chain.SIZE], header[chain.INSIDE], header[chain.BORDER] = size, own, kind.border
    header[chain.CLEARED], header[chain.ENTRIES] = cleared_rows.size, entries.size
    header[chain.BLOCKS], header[chain.ROWS] = block_rows.size, row.size
    (header[chain.CARRIED], carried_to), (header[chain.JOINED], joined_to) = carried
    header[chain.PANELS] = panels.high.size
    put(chain.CLEARED_AT, cleared_rows * stride + BLOCK * cleared_blocks)
    put(chain.BLOCKS_AT, blocks_held.reshape(-1))
    put(chain.ROWS_AT, np.stack([row, count], axis=1).reshape(-1))
    put(chain.CARRIED_TO, carried_to)
    put(chain.JOINED_TO, joined_to)
    put(chain.PANELS_AT, lists[:listed])
    put(chain.PLACES_AT, places)
    matrix = sum(chain.padded(count) for count in (size, own, entries.size))
    code, rows = np.concatenate(parts).astype(np.int32), slot[:own] - outer
    return ChainProgram(code, rows, kind.following, entries, factors, matrix, operations)
