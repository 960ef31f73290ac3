"""Poses: `keyframe.stand`, `rest` and `periodic` as relations between coordinates and as guesses.

A pose gives every coordinate a value: an expression of constants, so that a displacement may be a constant of the spec.
An orientation r is stated by three rows, those of the vector part of conj(r) q: q and -q are the same pose, and the
norm of q has a row already.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from stc.language import syntax
from stc.language.context import Context
from stc.language.diagnostics import did_you_mean
from stc.language.model.independence import Point
from stc.language.model.mirror import mirror_image, mirrored_rows
from stc.language.model.pose_rows import Stated, Values, turn_between
from stc.language.model.scope import ModelScope, quoted
from stc.language.words import KEYFRAME
from stc.problem import FrameRange, Guess, Relation, VariableRef
from stc.symbolic.expr import ZERO, Expr, call, mul, neg, num, sub, sym
from stc.time_derivatives import quaternion_product

#: The name of the pose that the model file draws.
REFERENCE = f"{KEYFRAME}.reference"


class Poses:
    """The poses that a spec can name: keyframes of the model, and those of its `poses:` section.

    Attributes:
        heights: function that returns how far each contact point is above its surface at a frame, or above the floor.
    """

    def __init__(
        self, context: Context, scope: ModelScope, heights: Callable[[int | None], list[Expr]]
    ) -> None:
        self.context = context
        self.scope = scope
        self.heights = heights
        #: The pose that the model file draws has a name, too.
        self.named: dict[str, Values] = {
            REFERENCE: self._of_coordinates([num(value) for value in scope.mechanism.start])
        }
        for keyframe in scope.mechanism.keyframes:
            if keyframe.name:
                path = f"{KEYFRAME}.{quoted(keyframe.name)}"
                self.named[path] = self._of_coordinates([num(value) for value in keyframe.qpos])
        for block in context.tree.blocks("poses"):
            for statement in block.statements:
                if isinstance(statement, syntax.PoseDefinition):
                    self._define(statement)

    def _of_coordinates(self, q: Sequence[Expr]) -> Values:
        found: Values = {}
        for one in self.scope.coordinates:
            names = one.pose
            found.update(zip(names, q[one.joint.qpos : one.joint.qpos + len(names)], strict=True))
        return found

    def _define(self, statement: syntax.PoseDefinition) -> None:
        found = self.values(replace(statement.pose, grounded=False))
        if found is None:
            return
        values = dict(found)
        for change in statement.changes:
            name = change.name.name
            if name not in values:
                hint = (
                    did_you_mean(name, list(values))
                    or "a pose gives values to coordinates, as in `joint.knee`"
                )
                self.context.error(change.name, f"`{name}` is not a coordinate of the model", hint)
                continue
            self.context.builder.poisoned = False
            value = self.context.builder.build(change.value)
            if self.context.builder.poisoned:
                continue
            if not self.context.is_fixed(value):
                self.context.error(change.value, "a pose is made of constants")
                continue
            values[name] = value
        if statement.pose.grounded:
            grounded = self._grounded(values, statement.pose)
            if grounded is None:
                return
            values = grounded
        self.named[statement.name.name] = values
        self.named[f"{KEYFRAME}.{statement.name.name}"] = values

    # ------------------------------------------------------------------ values

    def values(self, pose: syntax.Pose, frame: int | None = None) -> Values | None:
        """The value of every coordinate in a pose, at a frame; None after a mistake, which is added."""
        values = self.named.get(pose.base.name)
        if values is None:
            known = list(self.named)
            hint = did_you_mean(pose.base.name, known) or (
                f"there are {', '.join(f'`{name}`' for name in known)}"
                if known
                else "the model has no keyframes"
            )
            self.context.error(pose.base, f"there is no pose `{pose.base.name}`", hint)
            return None
        if pose.mirrored:
            self.context.error(pose, "only `periodic` can be mirrored")
            return None
        if pose.shift is not None:
            values = self._moved(values, pose.shift)
        if values is not None and pose.angle is not None:
            values = self._turned(values, pose)
        if values is not None and pose.grounded:
            values = self._grounded(values, pose, frame)
        return values

    def _grounded(self, values: Values, pose: syntax.Pose, frame: int | None = None) -> Values | None:
        """Values with the root moved up or down until the lowest contact place touches."""
        constants = {
            name: value for name, value in self.context.constants.values.items() if value is not None
        }
        numbers = {name: self.context.number(body) for name, body in values.items()}
        heights = self.heights(frame)
        if not heights:
            self.context.error(
                pose, "no contact of this spec touches the floor", "declare contacts under `contact:`"
            )
            return None
        lowest = float(Point(self.scope, numbers, constants).numbers(heights).min())
        at = self.context.source.position(pose.start)[0]
        root = self.scope.coordinates[0] if self.scope.coordinates else None
        if root is not None and root.joint.kind == "free":
            name, sign = root.positions[2], 1.0
        else:
            slide = self._root_slide(2)
            if slide is None:
                self.context.error(
                    pose, f"`grounded` moves the root up or down, and no joint of it does (line {at})"
                )
                return None
            name, sign = slide
        return {**values, name: sub(values[name], num(sign * lowest))}

    def _moved(self, values: Values, shift: syntax.Vector) -> Values | None:
        """Values with the root moved by a vector."""
        moves = self.displacement(shift)
        return (
            None if moves is None else {**values, **{name: values[name] + by for name, by in moves.items()}}
        )

    def displacement(self, shift: syntax.Vector) -> Values | None:
        """The change of each coordinate of the root when the whole model is moved by a vector; None after a mistake."""
        if len(shift.items) != 3:
            self.context.error(shift, f"a displacement has three components, not {len(shift.items)}")
            return None
        along = []
        for item in shift.items:
            self.context.builder.poisoned = False
            along.append(self.context.builder.build(item))
            if self.context.builder.poisoned:
                return None
        root = self.scope.coordinates[0] if self.scope.coordinates else None
        if root is not None and root.joint.kind == "free":
            return dict(zip(root.positions, along, strict=True))
        moves: Values = {}
        for axis, by in zip(range(3), along, strict=True):
            if by is ZERO:
                continue
            slide = self._root_slide(axis)
            if slide is None:
                hint = "its root has neither a free joint nor a slide along that axis"
                self.context.error(shift, f"the model cannot be moved along {'xyz'[axis]}", hint)
                return None
            name, sign = slide
            moves[name] = by if sign > 0 else neg(by)
        return moves

    def _root_slide(self, axis: int) -> tuple[str, float] | None:
        """The root's slide along an axis of the world, and its direction."""
        for one in self.scope.coordinates:
            body = self.scope.mechanism.bodies[one.joint.body]
            upright = abs(abs(body.quat[0]) - 1.0) < 1e-12
            if one.joint.kind == "slide" and body.parent == 0 and upright:
                along = one.joint.axis[axis]
                if abs(abs(along) - 1.0) < 1e-9:
                    return one.positions[0], along
        return None

    def _turned(self, values: Values, pose: syntax.Pose) -> Values | None:
        """Values with the root's orientation turned about an axis of the world."""
        assert pose.angle is not None
        assert pose.axis is not None
        root = self.scope.coordinates[0] if self.scope.coordinates else None
        if root is None or root.rotation is None:
            self.context.error(pose, "only a model with a free or ball joint at its root can be turned")
            return None
        self.context.builder.poisoned = False
        angle = self.context.builder.build(pose.angle)
        axis = self._axis(pose.axis)
        if self.context.builder.poisoned or axis is None:
            return None
        half = mul(num(0.5), angle)
        turn = [call("cos", half), *(mul(call("sin", half), num(part)) for part in axis)]
        names = root.rotation.quaternion
        turned = quaternion_product(turn, [values[name] for name in names])
        return {**values, **dict(zip(names, turned, strict=True))}

    def _axis(self, node: syntax.Expression) -> list[float] | None:
        if isinstance(node, syntax.Name) and node.name in ("x", "y", "z"):
            return [float(node.name == axis) for axis in "xyz"]
        numbers = (
            [self.context.constants.value_of(item) for item in node.items]
            if isinstance(node, syntax.Vector)
            else []
        )
        parts = [number for number in numbers if number is not None]
        length = sum(part**2 for part in parts) ** 0.5
        if len(parts) != 3 or not length:
            self.context.error(node, "an axis is `x`, `y`, `z` or three constants, as in `(0, 1, 1)`")
            return None
        return [part / length for part in parts]

    def usual(self) -> Values:
        """The default initial pose: the model's first keyframe, else the pose of the file."""
        poses = list(self.named.values())
        return poses[min(1, len(poses) - 1)]

    def repeated(self, values: Values, periodic: syntax.Pose) -> Values:
        """Values at the end of a period: moved by the displacement per period, and mirrored if required."""
        if periodic.mirrored:
            values = mirror_image(self.scope, values)
        moved = values if periodic.shift is None else self._moved(values, periodic.shift)
        return values if moved is None else moved

    # --------------------------------------------------------------- relations

    def rows(self, pose: syntax.Pose, frame: int | None = None) -> list[Stated] | None:
        """The constraints of a pose, or of `rest`, at a frame; None after a mistake, which is added."""
        if pose.base.name == "rest":
            return list(self.at_rest())
        if pose.base.name == "periodic":
            return self._periodic(pose)
        values = self.values(pose, frame)
        return None if values is None else list(self.at(values))

    def at(self, values: Values) -> Iterator[Stated]:
        """Equations that hold in a pose: one for each coordinate, three for each orientation."""
        for one in self.scope.coordinates:
            for k, name in enumerate(one.positions):
                yield Stated(
                    one.joint.dof + k, False, sub(sym(VariableRef(name)), values[name]), f"{name} of the pose"
                )
            if one.rotation is not None:
                reference = [values[name] for name in one.rotation.quaternion]
                turned = turn_between(reference, [sym(VariableRef(name)) for name in one.rotation.quaternion])
                first = one.joint.dof + len(one.positions)
                for k, body in enumerate(turned):
                    yield Stated(first + k, False, body, f"orientation of joint {one.joint.name} of the pose")

    def at_rest(self) -> Iterator[Stated]:
        """The rows of zero velocity."""
        for one in self.scope.coordinates:
            for k, velocity in enumerate(one.rates):
                yield Stated(one.joint.dof + k, True, sym(velocity), f"{velocity} = 0")

    def _periodic(self, pose: syntax.Pose) -> list[Stated] | None:
        """The last frame equals the first, apart from a displacement."""
        moves: Values | None = {}
        if pose.shift is not None:
            moves = self.displacement(pose.shift)
        if moves is None:
            return None
        if pose.mirrored:
            return mirrored_rows(self.context, self.scope, pose, moves)
        n = self.context.n
        found = []
        for one in self.scope.coordinates:
            for k, name in enumerate(one.positions):
                change = sub(sym(VariableRef(name, 0, 0, n)), sym(VariableRef(name, 0, 0, 0)))
                found.append(
                    Stated(one.joint.dof + k, False, sub(change, moves.get(name, ZERO)), f"{name} periodic")
                )
            if one.rotation is not None:
                names = one.rotation.quaternion
                start, end = ([sym(VariableRef(name, 0, 0, at)) for name in names] for at in (0, n))
                first = one.joint.dof + len(one.positions)
                for k, body in enumerate(turn_between(start, end)):
                    found.append(
                        Stated(first + k, False, body, f"orientation of joint {one.joint.name} periodic")
                    )
            for k, velocity in enumerate(one.rates):
                before, after = (sym(replace(velocity, scale=0, shift=at)) for at in (0, n))
                found.append(Stated(one.joint.dof + k, True, sub(after, before), f"{velocity} periodic"))
        return found

    def guesses(self, pose: syntax.Pose, where: FrameRange) -> list[Guess]:
        """A pose as the starting values of all coordinates on some frames."""
        values = self.values(pose, where.first)
        if values is None:
            return []
        span = self.context.span(pose)
        return [Guess(name, value, where, span) for name, value in values.items()]

    def relations(self, pose: syntax.Pose, where: FrameRange) -> list[Relation]:
        """As :meth:`rows`, as relations of the problem."""
        rows = self.rows(pose, where.first)
        span = self.context.span(pose)
        return [Relation(row.body, ZERO, ZERO, where, span, row.text) for row in rows or []]


__all__ = ["REFERENCE", "Poses"]
