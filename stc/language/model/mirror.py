"""Periodic motions with left and right swapped: relations between the first and the last frame.

The mirror is the plane y = 0.  Joints whose names differ by left and right (or ``L`` and ``R``, ``l`` and ``r``) are
exchanged; the others are their own mirror images.  Whether a coordinate keeps its sign follows from the axes: in the
mirror a direction turns (x, y, z) into (x, -y, z), and an axis of rotation into (-x, y, -z).
"""

from __future__ import annotations

import re

import numpy as np

from stc.language import syntax
from stc.language.context import Context
from stc.language.model.pose_rows import Stated, Values, turn_between
from stc.language.model.scope import Coordinates, ModelScope
from stc.mechanism.tree import drawn_pose
from stc.problem import VariableRef
from stc.symbolic.expr import ZERO, Expr, mul, neg, num, sub, sym

_SIDES = (("left", "right"), ("Left", "Right"), ("LEFT", "RIGHT"), ("L", "R"), ("l", "r"))
#: A name of something on one side; a letter only where it stands by itself.
_SIDED = re.compile("left|right|LEFT|RIGHT|Left|Right|(?<![A-Za-z])[LRlr](?![A-Za-z])")


def mirrored_rows(
    context: Context, scope: ModelScope, pose: syntax.Pose, moves: Values
) -> list[Stated] | None:
    """The last frame equals the first with left and right swapped, apart from a displacement; None after a mistake."""
    n = context.n
    others = {one.joint.name: one for one in scope.coordinates}
    found: list[Stated] = []

    def at(key: VariableRef, frame: int) -> Expr:
        return sym(VariableRef(key.name, key.order, 0, frame))

    for one in scope.coordinates:
        other = others.get(other_side(one.joint.name, set(others)), one)
        if other is one and _SIDED.search(one.joint.name):
            message = (
                f"joint `{one.joint.name}` has no counterpart on the other side, and is its own mirror image"
            )
            hint = "joints are exchanged if their names differ by left and right, L and R, or l and r alone"
            context.diagnostics.warning(message, pose.start, pose.end, hint)
        signs = _signs(scope, one, other)
        if signs is None:
            hint = "its axis and that of its mirror image do not fit; state what repeats by itself"
            context.error(pose, f"joint `{one.joint.name}` has no mirror image", hint)
            return None
        for k, name in enumerate(one.positions):
            image = mul(num(signs[k]), at(VariableRef(other.positions[k]), 0))
            body = sub(sub(at(VariableRef(name), n), image), moves.get(name, ZERO))
            found.append(Stated(one.joint.dof + k, False, body, f"{name} periodic and mirrored"))
        if one.rotation is not None and other.rotation is not None:
            w, x, y, z = [at(VariableRef(name), 0) for name in other.rotation.quaternion]
            end = [at(VariableRef(name), n) for name in one.rotation.quaternion]
            first = one.joint.dof + len(one.positions)
            for k, body in enumerate(turn_between([w, neg(x), y, neg(z)], end)):
                found.append(
                    Stated(first + k, False, body, f"orientation of {one.joint.name} periodic and mirrored")
                )
        for k, (rate, image_rate) in enumerate(zip(one.rates, other.rates, strict=True)):
            body = sub(at(rate, n), mul(num(signs[k]), at(image_rate, 0)))
            found.append(Stated(one.joint.dof + k, True, body, f"{rate} periodic and mirrored"))
    return found


def mirror_image(scope: ModelScope, values: Values) -> Values:
    """A pose with left and right swapped; coordinates without a mirror image stay as they are."""
    others = {one.joint.name: one for one in scope.coordinates}
    found = dict(values)
    for one in scope.coordinates:
        other = others[other_side(one.joint.name, set(others))]
        signs = _signs(scope, one, other)
        if signs is None:
            continue
        for name, image, sign in zip(one.positions, other.positions, signs, strict=False):
            found[name] = mul(num(sign), values[image])
        if one.rotation is not None and other.rotation is not None:
            w, x, y, z = [values[name] for name in other.rotation.quaternion]
            found.update(zip(one.rotation.quaternion, (w, neg(x), y, neg(z)), strict=True))
    return found


def other_side(name: str, known: set[str]) -> str:
    """The name of a joint, or of a contact, on the other side; its own if there is none."""
    for left, right in _SIDES:
        for here, there in ((left, right), (right, left)):
            # A single letter stands by itself: at an end, or beside something that is no letter of its case.
            pattern = (
                re.escape(here) if len(here) > 1 else rf"(?<![a-zA-Z]){here}(?![a-z])|(?<![a-zA-Z]){here}$"
            )
            for match in re.finditer(pattern, name):
                image = name[: match.start()] + there + name[match.end() :]
                if image in known:
                    return image
            if len(here) == 1:
                for position, letter in enumerate(name):
                    image = name[:position] + there + name[position + 1 :]
                    if letter == here and image in known:
                        return image
    return name


def _signs(scope: ModelScope, one: Coordinates, other: Coordinates) -> list[float] | None:
    """The sign of the mirror image of each degree of freedom; None if two joints are not mirror images."""
    if one.joint.kind != other.joint.kind:
        return None
    if one.joint.kind in ("free", "ball"):
        places = [1.0, -1.0, 1.0] if one.joint.kind == "free" else []
        return [*places, -1.0, 1.0, -1.0]
    mirror = np.array([-1.0, 1.0, -1.0] if one.joint.kind == "hinge" else [1.0, -1.0, 1.0])
    here, there = _axis(scope, one) * mirror, _axis(scope, other)
    along = float(here @ there)
    return [1.0 if along > 0 else -1.0] if abs(abs(along) - 1.0) < 1e-6 else None


def _axis(scope: ModelScope, one: Coordinates) -> np.ndarray:
    """The axis of a joint in the world, in the pose of the model file."""
    turn, _ = drawn_pose(scope.mechanism, one.joint.body)
    return turn @ np.array(one.joint.axis)
