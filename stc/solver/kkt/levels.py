"""Other stages than frames, for many bodies of which each couples with few others, or with none.

    frames     | x1 x2 x3 ... |  then the next frame: as wide as there are bodies
    levels     | x1 of all frames |  then x2: as wide as there are frames
    parts      | x1 | of frame 0, of frame 1, ...  then x2, where nothing couples it with x1

Elimination takes any row of stages in which unknowns couple within a stage and with the next one, and about the third
power of what a stage has.  Frames are one such row.  Where a frame has many unknowns with few entries, the levels of a
breadth-first search are another one (Cuthill and McKee 1969).  It starts from one unknown of all frames, at an end of
the graph that frames have in common, so that a level is a body's whole motion rather than a wave across bodies and
frames.  Whatever nothing couples is a part of its own, with frames or levels of its own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.core.functions import function
from stc.solver.kkt.couplings import Couplings, sort_by_key
from stc.solver.kkt.segments import Numbered

__all__ = ["narrower_stages"]

Int32s = NDArray[np.int32]
Int64s = NDArray[np.int64]

#: Frames are wide that have so many unknowns, ...
WIDE = 60
#: ... and sparse that have fewer entries off the diagonal than this, for each two unknowns of a frame.
SPARSE = 0.1
#: Other stages should take less than this share of the operations.
WORTH = 0.5


def narrower_stages(couplings: Couplings, numbered: Numbered) -> Int64s | None:
    """Stages that take far fewer operations than those given, (N,), or None where there are none.

    They are told from the pattern alone; unknowns that couple with many stages are of the last one.
    """
    stages = numbered.stages
    middle = float(np.median(np.diff(stages.pointers)))
    if middle < WIDE or couplings.first.size >= SPARSE * middle * couplings.size:
        return None
    inner = np.ones(couplings.size, dtype=bool)
    inner[stages.border] = False
    kept = inner[couplings.first] & inner[couplings.second]
    first, second = couplings.first[kept], couplings.second[kept]
    graph = _graph(couplings.size, first, second)
    level, part = np.full((2, couplings.size), -1, dtype=np.int32)
    parts = _search(numbered, graph, level, part)
    by_frame = part.astype(np.int64) * (int(stages.stage.max()) + 1) + stages.stage
    frames = _operations(by_frame, part, parts, first, second)
    by_level = part.astype(np.int64) * (int(level.max()) + 1) + level
    levels = _operations(by_level, part, parts, first, second)
    given = _operations(stages.stage.astype(np.int64), np.zeros_like(part), 1, first, second)[0]
    if np.minimum(frames, levels).sum() >= WORTH * given:
        return None
    span = max(int(level.max()), int(stages.stage.max())) + 1
    found = part.astype(np.int64) * span + np.where((levels < frames)[part], level, stages.stage)
    found[stages.border] = found.max()
    return found


def _graph(size: int, first: Int32s, second: Int32s) -> tuple[Int32s, Int32s]:
    """Neighbours of each unknown: pointers (size + 1,) and neighbours (2 E,)."""
    order, pointers = sort_by_key(np.concatenate([first, second]), size)
    return pointers, np.concatenate([second, first])[order]


def _search(numbered: Numbered, graph: tuple[Int32s, Int32s], level: Int32s, part: Int32s) -> int:
    """Find the level of each unknown in its part, and its part, (N,); how many parts there are."""
    stages, base = numbered.stages, numbered.base
    _, kind, counts = np.unique(numbered.features, axis=1, return_inverse=True, return_counts=True)
    kind = kind.reshape(-1)
    usual = np.flatnonzero(kind == np.argmax(counts))
    codes = numbered.edge_code[numbered.edge_stage == usual[usual.size // 2]]
    codes = codes[codes < 2 * base * base]  # inside, and with the next one
    width = int(stages.pointers[usual[0] + 1] - stages.pointers[usual[0]])
    one, other = codes // base % base, codes % base
    pair = (one < width) & (other < width)
    local = _graph(width, one[pair].astype(np.int32), other[pair].astype(np.int32))
    begins = np.zeros(width, dtype=np.int32)
    queue = np.zeros(max(level.size, width), dtype=np.int32)
    count = _ends(width, *local, np.full(width, -1, dtype=np.int32), queue, begins)
    place = stages.pointers[usual]
    parts = 0
    for begin in [*begins[:count].tolist(), -1]:
        sources = stages.order[place + begin] if begin >= 0 else stages.order
        sources = sources[part[sources] < 0]
        if sources.size:
            parts = _levels_from(sources.size, sources, int(begin < 0), parts, *graph, level, part, queue)
    return parts


def _operations(
    stage: Int64s, part: Int32s, parts: int, first: Int32s, second: Int32s
) -> NDArray[np.float64]:
    """What the elimination of each part takes, about, (parts,)."""
    kept, stage = np.unique(stage, return_inverse=True)
    count = kept.size
    entry = stage.copy()
    np.minimum.at(entry, first, stage[second])
    np.minimum.at(entry, second, stage[first])
    width = np.bincount(stage, minlength=count)
    load = np.cumsum(np.bincount(entry, minlength=count) - np.append(0, width[:-1])).astype(np.float64)
    of_stage = np.zeros(count, dtype=np.int64)
    of_stage[stage] = part
    return np.bincount(of_stage, width * load**2, minlength=parts).astype(np.float64)


#: Begins of level structures, one for each component: far ends of a search; how many there are.
_ends = function("arranging_ends")
#: Breadth-first levels from all sources together, or from each one not reached yet; parts found so far.
_levels_from = function("arranging_levels_from")
