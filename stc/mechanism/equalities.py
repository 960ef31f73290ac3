"""Equality constraints as expressions: their residuals, the rates of these, and the effect of their forces.

- A connect holds the difference of the places of two points.  Its force acts at the first one, its opposite at the
  second.
- A weld also holds the relative rotation of two frames: its residual is the axis of the remaining rotation times the
  sine of its angle, in the second frame.  Its rate and acceleration are stated as the differences of the angular
  velocities and accelerations in the world, which vanish together with the derivatives if the rotation is held.  Its
  ``torquescale`` is how stiff it is in rotation against translation, and only 0 matters: then it is a connect.
- A joint or tendon equality holds a length against a polynomial of another one.
"""

from __future__ import annotations

from collections.abc import Sequence

from stc.mechanism.dynamics import Dynamics
from stc.mechanism.forces import Forces, Transmission, Wrench
from stc.mechanism.mechanism import Equality
from stc.mechanism.transmissions import second_rate
from stc.mechanism.tree import Frame
from stc.mechanism.vectors import Matrix, Vector, minus, negative, product, scaled, transposed, vector
from stc.records import dataclass
from stc.symbolic.expr import ZERO, Expr, add, div, mul, num, sub, sum_of


@dataclass(frozen=True, slots=True)
class Held:
    """The expressions of an equality constraint.

    Attributes:
        names: names of its forces: ``fx``, ``fy``, ``fz``, for a weld also ``mx``, ``my``, ``mz``; ``f`` along a
            length.
        places, rates, accelerations: expressions that are 0, one for each force.
        ends: the frames of a connect or weld, at the connected points.
        lines: the lengths of a joint or tendon equality, with the effect of a unit force on each.
    """

    names: tuple[str, ...]
    places: tuple[Expr, ...]
    rates: tuple[Expr, ...]
    accelerations: tuple[Expr, ...]
    ends: tuple[Frame, ...] = ()
    lines: tuple[tuple[Transmission, Expr], ...] = ()

    def act(self, forces: Sequence[Expr]) -> Forces:
        """The effect of its forces on bodies and degrees of freedom.

        Parameters
        ----------
        forces
            One for each of the names: N along the world's axes, N m about them.
        """
        found = Forces()
        for line, share in self.lines:
            found.along(line, mul(share, forces[0]))
        if self.ends:
            first, second = self.ends
            force: Vector = (forces[0], forces[1], forces[2])
            found.wrenches += [Wrench(first, force), Wrench(second, negative(force))]
            if len(forces) > 3:
                torque: Vector = (forces[3], forces[4], forces[5])
                found.wrenches += [
                    Wrench(first, torque=torque),
                    Wrench(second, torque=negative(torque)),
                ]
        return found


def held(dynamics: Dynamics, equality: Equality) -> Held:
    """An equality constraint's expressions.

    Raises:
        ValueError: its kind cannot be stated.
    """
    if equality.kind in ("connect", "weld"):
        return _held_together(dynamics, equality)
    if equality.kind in ("joint", "tendon"):
        return _coupled(dynamics, equality)
    raise ValueError(f"equality {equality.name} of kind {equality.kind}")


def _held_together(dynamics: Dynamics, equality: Equality) -> Held:
    first, second = _ends(dynamics, equality)
    know = dynamics.kinematics
    places = minus(know.place_of(first), know.place_of(second))
    rates = minus(know.velocity_of(first), know.velocity_of(second))
    accelerations = minus(know.acceleration_of(first), know.acceleration_of(second))
    if equality.kind == "connect" or not equality.data[10]:  # a weld whose ``torquescale`` is 0 turns freely
        return Held(("fx", "fy", "fz"), places, rates, accelerations, (first, second))
    turn = product(transposed(know.axes_of(second)), know.axes_of(first))
    return Held(
        names=("fx", "fy", "fz", "mx", "my", "mz"),
        places=(*places, *turned_by(turn)),
        rates=(*rates, *minus(know.rate_of(first), know.rate_of(second))),
        accelerations=(*accelerations, *minus(know.turning_of(first), know.turning_of(second))),
        ends=(first, second),
    )


def turned_by(turn: Matrix) -> Vector:
    """The axis of a rotation times twice the tangent of half its angle, which is not defined for half a turn.

    It is 0 for no rotation only, as the sine of the angle is not, and Newton's step from an angle is its sine.
    """
    twist = (sub(turn[2][1], turn[1][2]), sub(turn[0][2], turn[2][0]), sub(turn[1][0], turn[0][1]))
    trace = sum_of([turn[0][0], turn[1][1], turn[2][2]])
    return scaled(div(num(2.0), add(num(1.0), trace)), twist)


def _ends(dynamics: Dynamics, equality: Equality) -> tuple[Frame, Frame]:
    """The frames that a connect or weld connects."""
    if equality.between == "site":
        return dynamics.sites[equality.first], dynamics.sites[equality.second]
    data, tree = equality.data, dynamics.tree
    if equality.kind == "connect":
        return (
            tree.frame(equality.first, vector(data[0:3])),
            tree.frame(equality.second, vector(data[3:6])),
        )
    return (
        tree.frame(equality.first, vector(data[3:6]), data[6:10]),
        tree.frame(equality.second, vector(data[0:3])),
    )


def _polynomial(coefficients: Sequence[float], x: Expr) -> tuple[Expr, Expr, Expr]:
    """c0 + c1 x + c2 x^2 + ..., its derivative and its second derivative."""
    value = slope = bend = ZERO
    for coefficient in reversed(coefficients):
        bend = add(mul(bend, x), mul(num(2.0), slope))
        slope = add(mul(slope, x), value)
        value = add(mul(value, x), num(coefficient))
    return value, slope, bend


def _coupled(dynamics: Dynamics, equality: Equality) -> Held:
    first, reference, acceleration = _line(dynamics, equality, equality.first)
    value, rate = sub(first.length, num(reference)), first.rate
    lines = [(first, num(1.0))]
    if equality.second < 0:
        value = sub(value, num(equality.data[0]))
    else:
        second, other, second_acceleration = _line(dynamics, equality, equality.second)
        wanted, slope, bend = _polynomial(equality.data[:5], sub(second.length, num(other)))
        value, rate = sub(value, wanted), sub(rate, mul(slope, second.rate))
        bent = mul(bend, mul(second.rate, second.rate))
        acceleration = sub(acceleration, add(bent, mul(slope, second_acceleration)))
        lines.append((second, sub(ZERO, slope)))
    return Held(("f",), (value,), (rate,), (acceleration,), lines=tuple(lines))


def _line(dynamics: Dynamics, equality: Equality, index: int) -> tuple[Transmission, float, Expr]:
    """A joint's or tendon's length, its reference, and its second derivative by time."""
    motion = dynamics.motion
    if equality.kind == "tendon":
        tendon, line = dynamics.mechanism.tendons[index], dynamics.tendons[index]
        return line, tendon.reference, second_rate(tendon, line, dynamics.kinematics)
    joint = dynamics.mechanism.joints[index]
    dof = joint.dof
    line = Transmission(motion.q[joint.qpos], motion.v[dof], {dof: num(1.0)})
    return line, joint.reference[0], motion.a[dof]
