"""The sparsity pattern of a matrix, drawn in characters."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Largest picture, in characters.
WIDTH, HEIGHT = 96, 48

#: How full a cell is, from empty to dense.
SHADES = " .:+#"


def picture(
    rows: NDArray[np.integer],
    columns: NDArray[np.integer],
    shape: tuple[int, int],
    size: tuple[int, int] = (HEIGHT, WIDTH),
) -> str:
    """The pattern of a matrix in a frame; for a large matrix a character stands for a block of entries.

    Args:
        rows: (nnz,) row of each entry.
        columns: (nnz,) column of each entry.
        shape: of the matrix.
        size: of the picture at most, in lines and characters.
    """
    if not all(shape):
        return "(empty)"
    block = [max(1, -(-extent // most)) for extent, most in zip(shape, size)]
    height, width = (-(-extent // edge) for extent, edge in zip(shape, block))
    filled = np.zeros((height, width), np.int64)
    np.add.at(filled, (np.asarray(rows) // block[0], np.asarray(columns) // block[1]), 1)
    # Any entry at all must show; beyond that, shades by the share of the block that is filled.
    share = filled / (block[0] * block[1])
    level = np.where(filled > 0, 1 + np.minimum((share * (len(SHADES) - 1)).astype(int), len(SHADES) - 2), 0)
    lines = ["|" + "".join(SHADES[k] for k in line) + "|" for line in level]
    edge = "+" + "-" * width + "+"
    scale = "" if block == [1, 1] else f"\na character stands for {block[0]} x {block[1]} entries"
    return "\n".join([edge, *lines, edge]) + scale
