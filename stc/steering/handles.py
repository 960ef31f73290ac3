"""A point of the picture that can be dragged."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from stc.records import dataclass
from stc.solution import Solution
from stc.steering.posed_body import FloatArray, Place

if TYPE_CHECKING:
    from stc.validate.setup import Setup

#: Decimals of lengths and angles that dragging writes.
DECIMALS = 4


@dataclass(frozen=True, slots=True)
class Handle:
    """A point that can be dragged.

    Attributes:
        key: tells it from others.
        label: what it is, in words.
        kind: ``place`` (everything moves along), ``pose`` (a part of the body) or ``foot``.
        frame: at which the body is there.
        body: index of the body in the model.
        place: the point of it.
        knobs: the numbers that move it.
    """

    key: str
    label: str
    kind: str
    frame: int
    body: int
    place: Place
    knobs: tuple[str, ...]


def body_name(model: Any, body: int) -> str:
    """The name of a body."""
    return str(model.body(body).name) or f"body {body}"


class Handles(Protocol):
    """The handles of a frame."""

    @property
    def handles(self) -> Sequence[Handle]:
        """The handles of the frame, in the order in which they are shown."""

    def reached(
        self, handle: Handle, target: FloatArray, solution: Solution, setup: Setup
    ) -> tuple[dict[str, float], FloatArray]:
        """The numbers that bring a handle to a target, (3,) m, or as near as it gets, and where it is then.

        Args:
            handle: one of those.
            target: where to.
            solution: the motion on show.
            setup: the same, tied to its model.
        """


def qpos_at(setup: Setup, solution: Solution, frame: int) -> FloatArray:
    """(nq,) the model's pose at a frame of a motion; at a jump, the pose after it."""
    found: FloatArray = np.array(setup.compiled.qpos0)
    found[setup.reference.positions] = setup.reference.at("after", frame)[0]
    return found
