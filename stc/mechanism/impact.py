"""Impacts: instantaneous changes of velocity, and the impulses that cause them."""

from __future__ import annotations

from collections.abc import Sequence

from stc.mechanism import passive
from stc.mechanism.dynamics import Dynamics
from stc.mechanism.forces import Forces
from stc.mechanism.kinematics import Kinematics, Motion
from stc.mechanism.newton_euler import inverse_dynamics
from stc.mechanism.vectors import ORIGIN
from stc.symbolic.expr import ZERO, Expr, sub


def impact(dynamics: Dynamics, change: Sequence[Expr], impulses: Forces) -> list[Expr]:
    """The residual of every degree of freedom in an impact: M change - J^T impulses.

    These are the equations of motion at zero velocity, with the changes in place of accelerations and impulses in
    place of forces, and without springs, dampers and gravity.

    Parameters
    ----------
    change
        Velocities after the impact less those before, in the order of ``qvel``.
    impulses
        On the dynamics' own frames and degrees of freedom.
    """
    still = [ZERO] * len(change)
    kinematics = Kinematics(dynamics.tree, Motion(dynamics.motion.q, still, change), ORIGIN)
    given = Forces()
    given.include(impulses)
    gears = [gear[0] for gear in dynamics.gears]
    given.include(passive.drive_inertia(kinematics, dynamics.numbers, dynamics.tendons, gears))
    found = inverse_dynamics(kinematics, given.wrenches)
    for dof, force in given.on_dofs.items():
        found[dof] = sub(found[dof], force)
    return found
