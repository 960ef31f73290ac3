"""Grips: connects of the model that are off at its start and on while the solved motion holds on.

A hand that grasps a bar holds in every direction, which contact between geoms cannot do.  A model states it with
``<connect active="false">`` between two sites, one of which a ``contact`` line of the spec names.  In a replay the
connect is on in the frame steps in which that line's solved force is not zero, and MuJoCo computes its force.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass

if TYPE_CHECKING:
    import mujoco

    from stc.validate.metrics import FloatArray
    from stc.validate.setup import Setup

#: Forces below this share of the largest solved one are none.
_NOTHING = 1e-9


@dataclass(frozen=True, slots=True)
class Grip:
    """A connect between two sites that can be switched on and off.

    Attributes:
        equality: its index in the model.
        sites: the two; its force acts on the first one, and the opposite on the second.
        on: (n,) whether it holds in each frame step.
    """

    equality: int
    sites: tuple[int, int]
    on: np.ndarray

    def force(self, data: mujoco.MjData) -> FloatArray:
        """(3,) the present force on its first site, along the world's axes; zero if it is off."""
        import mujoco

        rows = (data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)) & (data.efc_id == self.equality)
        found = data.efc_force[rows]
        return np.asarray(found if len(found) else np.zeros(3))


def grips(setup: Setup) -> list[Grip]:
    """All connects of a model that a motion switches on and off."""
    import mujoco

    model, kinds = setup.compiled, mujoco.mjtEq
    found = []
    for index in range(model.neq):
        if (
            model.eq_active0[index]
            or int(model.eq_type[index]) != int(kinds.mjEQ_CONNECT)
            or int(model.eq_objtype[index]) != int(mujoco.mjtObj.mjOBJ_SITE)
        ):
            continue
        sites = int(model.eq_obj1id[index]), int(model.eq_obj2id[index])
        lines = [
            channel
            for channel, place in zip(setup.contact.channels, setup.contact.where.places)
            if place is not None and place.kind == "site" and place.index in sites
        ]
        if lines:
            sizes = [(np.abs(line.after[:-1]), np.abs(line.before[1:])) for line in lines]
            either = np.max(sizes, axis=(0, 1))
            found.append(Grip(index, sites, either > _NOTHING * either.max(initial=0.0)))
    return found
