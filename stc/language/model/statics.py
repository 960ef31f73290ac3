"""Warnings of poses at rest that cannot be held.

`rest` says that nothing moves at an instant, not that the pose could be held.  A motion that begins or ends in a pose
that cannot be held is hard to find.  The weight, the springs and the motors within their ranges are balanced by forces
of the contacts that stand, as far as possible.  The friction of a contact is the square around its cone, and whatever
else acts may have any force, so that what is told is certain.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from stc.language.context import Context
from stc.language.model.contact import Contacts
from stc.language.model.independence import Matrix, Point
from stc.language.model.schedule import Contact
from stc.language.model.scope import ModelScope
from stc.language.model.standing import OFF_SURFACE, Pinned
from stc.language.model.statements import bounds
from stc.problem import Relation, VariableRef
from stc.symbolic.expr import evaluate_all, num, sym
from stc.symbolic.traverse import reachable

#: Forces balance to this share of the weight, with levers of 1 m.
_BALANCE = 1e-4
#: What must hold counts so much more than what should be small.
_MUST = 1e3
_ROUNDING, _TINY = 1e-12, 1e-300
#: The least range of a motor.
_LEAST = 1e-6
#: Dry friction is within its bound by so much more than motors are within their ranges.
_OWN = 1e-2
#: A centre of mass is told of that is so far beside what stands, in m, and a motor beyond its range by such a share.
_BESIDE, _BEYOND = 2e-3, 0.02
#: The corners of the square around a cone of friction, and those of a sole.
_CORNERS = np.array(((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)))


class Statics:
    """The forces that act on a model at rest, in poses of a spec.

    Parameters
    ----------
    equations
        The equation of motion of each degree of freedom.
    """

    def __init__(
        self, context: Context, scope: ModelScope, contacts: Contacts, equations: Sequence[Relation]
    ) -> None:
        self.context, self.scope, self.contacts = context, scope, contacts
        self.equations = [relation.body for relation in equations]
        self.numbers = {k: v for k, v in context.constants.values.items() if v is not None}
        self.contacts_of = list(contacts.contacts.values())

    def warn(self, pinned: Mapping[int, Pinned]) -> None:
        """Add a warning for the first and the last frame, if its pose is fixed and at rest and cannot be held."""
        bodies, known = self.scope.mechanism.bodies, set()
        roots = [one for one in self.scope.coordinates if not bodies[one.joint.body].parent]
        moved = {name for one in roots if one.joint.kind in ("free", "slide") for name in one.positions}
        for frame in sorted({0, self.context.n} & pinned.keys()):
            values, statement = pinned[frame].values, pinned[frame].statement
            if values is None or statement is None or len(pinned[frame].dofs(True)) < len(self.equations):
                continue
            numbers = {name: self.context.number(e) for name, e in values.items()}
            point = Point(self.scope, numbers, self.numbers)
            standing = self._standing(frame, point)
            # The same pose elsewhere needs the same forces.
            key = (*(c.name for c in standing), *(v for name, v in numbers.items() if name not in moved))
            if standing and key not in known:
                told = self._told(point, standing)
                if told is not None:
                    self.context.diagnostics.warning(told[0], statement.start, statement.end, told[1])
            known.add(key)

    def _standing(self, frame: int, point: Point) -> list[Contact]:
        """The contacts that touch at a frame, if any of them stands there; what has a pin is not looked at."""
        held, found = False, []
        for one in self.contacts_of:
            now = any(phase.frames.first <= frame <= phase.frames.last for phase in one.phases)
            if one.kind == "pin" and now:
                return []
            heights = list(self.contacts.heights_above(one, self.contacts.surface(one)))
            touches = one.kind != "pin" and point.numbers(heights).min() < OFF_SURFACE
            held |= now or (touches and one.free is not None)
            found += [one] if now or touches else []
        return found if held else []

    def _pushes(self, point: Point, contact: Contact) -> Matrix:
        """(forces, k) forces of a contact; it can give their sums with any factors that are not negative."""
        surface = self.contacts.surface(contact)
        friction = self.context.number(contact.options["friction"])
        ways = np.array(surface.normal) + friction * _CORNERS @ np.array(surface.tangents)
        if contact.kind == "point":
            return ways.T
        axes = self.scope.dynamics.kinematics.axes_of(contact.frame)
        turn = point.numbers([part for row in axes for part in row]).reshape(3, 3)
        arms = np.array(contact.half) * _CORNERS @ turn[:, :2].T
        return np.array([[*way, *np.cross(arm, way)] for arm in arms for way in ways]).T

    def _linear(
        self, point: Point, standing: Sequence[Contact], limits: Sequence[Relation]
    ) -> tuple[Matrix, Matrix] | None:
        """(rows, k) what is left of equations and what is limited for each of k forces, and (rows,) without forces.

        No factor of a force is negative. None if that is not linear in the forces.
        """
        bodies = [*self.equations, *(one.body for one in limits)]
        known: dict[object, object] = dict(point.known)
        known.update({key: 0.0 for one in self.scope.coordinates for key in one.rates})
        known.update({VariableRef(name): 0.0 for one in self.contacts_of for name in one.forces})
        still = {name for one in self.scope.coordinates for name in one.names}
        forces: list[tuple[Sequence[object], Matrix]] = [
            ([VariableRef(name) for name in one.forces], self._pushes(point, one)) for one in standing
        ]
        for key in {node.payload: None for node in reachable(bodies) if node.op == "sym"}:
            if isinstance(key, VariableRef) and key.name in still:
                known.setdefault(key, 0.0)
            elif key not in known:
                forces.append(([key], np.array([[1.0, -1.0]])))
        count = sum(ways.shape[1] for _, ways in forces)
        first = 1  # after a column without forces, and before one with all of them
        for names, ways in forces:
            for name, row in zip(names, ways, strict=True):
                known[name] = each = np.zeros(count + 2)
                each[first : first + len(row)], each[-1] = row, row.sum()
            first += ways.shape[1]
        values = np.array([np.broadcast_to(value, count + 2) for value in evaluate_all(bodies, known)])
        at, slopes = values[:, 0], values[:, 1:-1] - values[:, :1]
        linear = np.allclose(at + slopes.sum(axis=1), values[:, -1], 1e-6, 1e-6 * self.scope.weight)
        return (slopes, at) if linear else None

    def _told(self, point: Point, standing: Sequence[Contact]) -> tuple[str, str] | None:
        """What is in the way of holding a pose, and a remedy; None if nothing is, or if that is not certain."""
        limits = self._limits()
        found, roots = self._linear(point, standing, limits), {self._root(one) for one in standing}
        pull = self.scope.mechanism.options.gravity
        if found is None or len(roots) > 1 or pull[2] >= 0.0 or pull[0] or pull[1]:
            return None
        (root,), (slopes, at) = roots, found
        dofs = [
            dof
            for one in self.scope.coordinates
            if root in self._above(one.joint.body)
            for dof in one.joint.dofs
        ]
        bodies = enumerate(self.scope.mechanism.bodies)
        weight = -pull[2] * sum(body.mass for index, body in bodies if root in self._above(index))
        rows, right = slopes[dofs] / weight, -at[dofs] / weight
        told, off = self._weak(limits, (slopes, at), (rows, right))
        if off < _BALANCE:
            return told
        # Moved along x the weight turns the whole about y, moved along y the other way about x.
        turning = self.contacts.paths.turning(self.scope.dynamics.body(root))[0]
        moves = (np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0]]) @ point.jacobian(turning)[:, dofs]).T
        must, small = np.hstack([rows, moves, -moves]), np.eye(rows.shape[1] + 4)[rows.shape[1] :]
        factors, off = _nearest(must, right, small, np.zeros(4))
        beside = factors[-2:] - factors[-4:-2]
        away = float(np.linalg.norm(beside))
        if off > _BALANCE:
            return None
        if away < _BESIDE:
            return self._weak(limits, (slopes, at), (rows, right + moves @ beside))[0]
        x, y = (0.0 if abs(part) < 0.1 * away else round(1e3 * part) for part in beside)
        names = ", ".join(f"`{one.name}`" for one in standing)
        return (
            f"at rest in this pose the robot begins to fall: its centre of mass is {1e3 * away:.0f} mm beside what "
            f"stands ({names}), by ({x:g}, {y:g}) mm along x and y",
            "turn a joint of the legs or the trunk until `com` is above what stands",
        )

    def _weak(
        self, limits: Sequence[Relation], linear: tuple[Matrix, Matrix], balance: tuple[Matrix, Matrix]
    ) -> tuple[tuple[str, str] | None, float]:
        """The motor that is farthest beyond its range and a remedy, if not all can be within theirs, and how far forces
        are from balance, whatever motors give, as a share of the weight.
        """
        count, ends = len(self.equations), []
        for one in limits:
            bounds_of = zip((one.lower, one.upper), (-np.inf, np.inf))
            ends.append([free if end is None else self.context.number(end) for end, free in bounds_of])
        both = np.array(ends).reshape(-1, 2)
        low, high = both.T
        within, of = linear[0][count:], linear[1][count:]
        size = np.abs(np.where(np.isfinite(both), both, 0.0)).max(axis=1, initial=_LEAST)
        size *= [1.0 if one.text else _OWN for one in limits]
        upper, lower = (np.isfinite(end) & within.any(axis=1) for end in (high, low))
        soft = np.vstack([(within / size[:, None])[upper], (-within / size[:, None])[lower]])
        room = np.concatenate([((high - of) / size)[upper], ((of - low) / size)[lower]])
        must = np.hstack([balance[0], np.zeros((len(balance[0]), len(room)))])
        factors, off = _nearest(must, balance[1], np.hstack([soft, np.eye(len(room))]), room)
        asked = within @ factors[: within.shape[1]] + of
        over = np.maximum(asked - high, low - asked) / size
        over *= [bool(one.text) and bool(slope.any()) for one, slope in zip(limits, within, strict=True)]
        k = int(np.argmax(over)) if len(over) else 0
        if not len(over) or over[k] < _BEYOND:
            return None, off
        # A motor at a single joint is told of by the force there.
        column = int(np.argmax(np.abs(within[k])))
        moments = linear[0][:count, column] / within[k, column]
        acts = np.flatnonzero(np.abs(moments) > _ROUNDING)
        needs, has, unit = asked[k], high[k] if asked[k] > high[k] else low[k], ""
        if len(acts) == 1 and not of[k]:
            kinds = [one.joint.kind for one in self.scope.coordinates for _ in one.joint.dofs]
            unit = " N" if kinds[acts[0]] == "slide" else " N m"
            needs, has = abs(moments[acts[0]]) * np.array([needs, has])
        needs, has = (abs(needs), abs(has)) if needs * has > 0.0 else (needs, has)
        name = limits[k].text.removeprefix("range of ").removeprefix("the force of ")
        name = f"`{name}`" if name.startswith("actuator.") else name
        told = (
            f"{name} cannot hold this pose at rest: it needs {needs:.3g}{unit} and has {has:.3g}{unit}",
            "a pose in which less weight is beside the joint, or more of the feet stands, needs less",
        )
        return told, off

    def _limits(self) -> list[Relation]:
        """The ranges of motors, and of dry friction."""
        where, span = self.context.everywhere, self.context.span(self.scope.statement)
        rubbing = [
            Relation(sym(VariableRef(name)), num(-bound), num(bound), where, span, "")
            for one in self.scope.coordinates
            for name, bound in zip(one.friction, [one.joint.frictionloss] * 6, strict=False)
        ]
        return [*rubbing, *(one for one in bounds(self.context, self.scope) if not one.is_equality)]

    def _above(self, body: int) -> list[int]:
        """A body and its ancestors without the world."""
        found = []
        while body:
            found.append(body)
            body = self.scope.mechanism.bodies[body].parent
        return found

    def _root(self, contact: Contact) -> int:
        """The body on the world that carries a contact."""
        return self._above(self.scope.dynamics.tree.segments[contact.frame.segment].joint.body)[-1]


def _nearest(must: Matrix, right: Matrix, small: Matrix, wanted: Matrix) -> tuple[Matrix, float]:
    """The vector without negative numbers for which ``small @ x`` is nearest to ``wanted`` where ``must @ x`` is
    ``right``, and how far that is missed at most.

    Source: Lawson and Hanson, Solving Least Squares Problems, 1974, chapters 22 (by weights) and 23.
    """
    rows, target = np.vstack([_MUST * must, small]), np.append(_MUST * right, wanted)
    x = np.zeros(rows.shape[1])
    used, vain = np.zeros((2, len(x)), bool)
    size = np.maximum(np.linalg.norm(rows, axis=0), _TINY)
    for _ in range(3 * len(x)):
        pull = np.where(used | vain, 0.0, rows.T @ (target - rows @ x) / size)
        best = int(np.argmax(pull))
        if pull[best] <= _ROUNDING * np.linalg.norm(target):
            break
        used[best] = True
        while True:
            found = np.zeros(len(x))
            found[used] = np.linalg.lstsq(rows[:, used], target, rcond=None)[0]
            below = used & (found <= 0.0)
            if not below.any():
                break
            x += np.min(x[below] / (x[below] - found[below])) * (found - x)
            used &= ~(below & (x < _TINY))
            x[~used] = 0.0
        x = found
        vain[best] = not used[best]  # it depends on those in use, but for rounding
    return x, float(np.abs(must @ x - right).max(initial=0.0))
