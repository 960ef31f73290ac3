"""Paths of model elements as expressions: ``body.torso.x``, ``site.foot.vz``, ``com.torso.x`` and others."""

from __future__ import annotations

from collections.abc import Sequence

from stc.language import syntax
from stc.language.diagnostics import did_you_mean
from stc.language.model.distances import Distances
from stc.language.model.scope import ModelScope, PathError, parts_of, quoted
from stc.mechanism.mechanism import index_of
from stc.mechanism.tree import Frame
from stc.mechanism.vectors import Vector
from stc.problem import ConstantRef, ParameterRef
from stc.symbolic.expr import Expr, mul, sum_of, symbols

_AXES = {"x": 0, "y": 1, "z": 2}

#: What the paths of places end with, besides the axes.
PLACE_FIELDS = ("x", "y", "z", "vx", "vy", "vz", "wx", "wy", "wz", "xaxis", "yaxis", "zaxis")
#: Words that stand alone.
WORDS = ("effort", "power")
#: First words of paths that are no variables.
KINDS = ("body", "site", "geom")


class Paths:
    """Turns paths into expressions.

    Attributes:
        derivatives: time derivatives of the requested positions and velocities, from recursions along the tree, which
            need fewer operations than the chain rule.
    """

    def __init__(self, scope: ModelScope, derivatives: dict[Expr, Expr]) -> None:
        self.scope = scope
        self.derivatives = derivatives
        self.distances = Distances(scope)
        self._known: dict[str, Expr] = {}

    def is_word(self, name: str) -> bool:
        """Whether a plain name has a meaning in a spec with a model."""
        return name in WORDS

    def is_orientation(self, name: str) -> bool:
        """Whether a variable is a component of a quaternion."""
        return any(name in rotation.quaternion for rotation in self.scope.rotations)

    def resolve(self, path: str) -> Expr:
        """The expression of a path that is not a variable.

        Raises:
            PathError: there is no such thing, or it has no such field.
        """
        if path not in self._known:
            kind, *rest = parts_of(path)
            self._known[path] = self._quantity(path, kind, rest)
        return self._known[path]

    def _quantity(self, path: str, kind: str, rest: Sequence[str]) -> Expr:
        dynamics = self.scope.dynamics
        if kind in WORDS and not rest:
            return self._word(kind)
        if kind == "actuator" and len(rest) == 2 and rest[1] == "force":
            return self._actuator_force(rest[0])
        if kind == "com" and len(rest) in (1, 2):
            body = self._body(rest[0]) if len(rest) == 2 else 0
            return self._centre(path, body, rest[-1])
        if kind in ("momentum", "angular") and len(rest) in (1, 2) and rest[-1] in _AXES:
            body = self._body(rest[0]) if len(rest) == 2 else 0
            whole = dynamics.momentum if kind == "momentum" else dynamics.angular_momentum
            return whole(body)[_AXES[rest[-1]]]
        if kind == "energy" and len(rest) == 1 and rest[0] in ("kinetic", "potential"):
            return dynamics.kinetic_energy() if rest[0] == "kinetic" else dynamics.potential_energy()
        if kind not in KINDS or not rest:
            raise PathError(f"`{path}` is not a name of the model", self._what_there_is(kind))
        return self._field(path, self.frame(kind, rest[0]), rest[1:])

    def _body(self, name: str) -> int:
        self.frame("body", name)  # tells of a name that is not there
        return index_of(self.scope.mechanism.bodies, name) or 0

    def _centre(self, path: str, body: int, field: str) -> Expr:
        """A field of the centre of mass of a body with all its descendants."""
        dynamics = self.scope.dynamics
        at, velocity = dynamics.centre_of_mass(body), dynamics.centre_velocity(body)
        for e, rate in zip(at, velocity, strict=True):
            if e.args:
                self.derivatives.setdefault(e, rate)
        if field in _AXES:
            return at[_AXES[field]]
        if field[:1] == "v" and field[1:] in _AXES:
            return velocity[_AXES[field[1:]]]
        raise PathError(
            f"`{path}` has no field `{field}`", "a centre of mass has `.x .y .z` and `.vx .vy .vz`"
        )

    def frame(self, kind: str, name: str) -> Frame:
        """The frame of a body, site or geom.

        Raises:
            PathError: there is none of that name.
        """
        mechanism, dynamics = self.scope.mechanism, self.scope.dynamics
        things: dict[str, list[str]] = {
            "body": [body.name for body in mechanism.bodies],
            "site": [site.name for site in mechanism.sites],
            "geom": [geom.name for geom in mechanism.geoms],
        }
        index = things[kind].index(name) if name in things[kind] else None
        if index is None:
            names = [one for one in things[kind] if one]
            hint = (
                did_you_mean(name, names) or f"its {kind}s are {', '.join(quoted(one) for one in names[:12])}"
            )
            raise PathError(f"the model has no {kind} `{name}`", hint)
        frames = {"body": dynamics.tree.frames, "site": dynamics.sites, "geom": dynamics.geoms}[kind]
        return frames[index]

    def call(self, call: syntax.Call) -> Expr:
        """The expression of ``distance(geom.A, geom.B)``.

        Raises:
            PathError: it is none.
        """
        if call.function == "distance":
            return self.distances.of(call)
        hint = f"write one of {', '.join(f'`.{one}`' for one in PLACE_FIELDS[:9])} after it"
        raise PathError("a point is not a number", hint)

    def point(self, call: syntax.Call, at: Sequence[Expr]) -> tuple[Frame, str]:
        """The frame of ``point(body.NAME, x, y, z)``, and the name of the body.

        Args:
            call: that.
            at: x, y and z.

        Raises:
            PathError: the call has another form, or x, y and z are not constant over a motion.
        """
        hint = "a point in a body is `point(body.NAME, x, y, z)`"
        body = call.arguments[0] if call.arguments else None
        kind, *rest = parts_of(body.name) if isinstance(body, syntax.Name) else ("",)
        if call.function != "point" or len(at) != 3:
            raise PathError(hint, "x, y and z are constants or parameters")
        if kind != "body" or len(rest) != 1:
            raise PathError(f"`{body.name if isinstance(body, syntax.Name) else 'this'}` is not a body", hint)
        if not all(isinstance(key, ConstantRef | ParameterRef) for part in at for key in symbols(part)):
            raise PathError("the coordinates of a point in a body must be constant", hint)
        self.frame(kind, rest[0])  # tells of a name that is not there
        index = index_of(self.scope.mechanism.bodies, rest[0])
        assert index is not None
        x, y, z = at
        return self.scope.dynamics.tree.frame(index, (x, y, z)), rest[0]

    def of_point(self, call: syntax.Call, at: Sequence[Expr], fields: Sequence[str]) -> Expr:
        """A field of ``point(body.NAME, x, y, z)``.

        Raises:
            PathError: there is no such point, or it has no such field.
        """
        return self._field("point(...)", self.point(call, at)[0], fields)

    def place(self, frame: Frame) -> tuple[Vector, Vector, Vector]:
        """Position, velocity and acceleration of a frame's origin in the world; each is the derivative of the one
        before.
        """
        kinematics = self.scope.dynamics.kinematics
        at, velocity = kinematics.place_of(frame), kinematics.velocity_of(frame)
        acceleration = kinematics.acceleration_of(frame)
        for lower, higher in ((at, velocity), (velocity, acceleration)):
            for e, rate in zip(lower, higher, strict=True):
                if e.args:
                    self.derivatives.setdefault(e, rate)
        return at, velocity, acceleration

    def turning(self, frame: Frame) -> tuple[Vector, Vector]:
        """Angular velocity and acceleration of a frame, in the world."""
        kinematics = self.scope.dynamics.kinematics
        rate, acceleration = kinematics.rate_of(frame), kinematics.turning_of(frame)
        for e, change in zip(rate, acceleration, strict=True):
            if e.args:
                self.derivatives.setdefault(e, change)
        return rate, acceleration

    def _field(self, path: str, frame: Frame, rest: Sequence[str]) -> Expr:
        field = rest[0] if rest else ""
        if len(rest) == 1 and field in _AXES:
            return self.place(frame)[0][_AXES[field]]
        if len(rest) == 1 and field[:1] == "v" and field[1:] in _AXES:
            return self.place(frame)[1][_AXES[field[1:]]]
        if len(rest) == 1 and field[:1] == "w" and field[1:] in _AXES:
            return self.turning(frame)[0][_AXES[field[1:]]]
        if len(rest) == 2 and field in ("xaxis", "yaxis", "zaxis") and rest[1] in _AXES:
            axes = self.scope.dynamics.kinematics.axes_of(frame)
            return axes[_AXES[rest[1]]][_AXES[field[0]]]
        what = f"`{path}` has no field `{'.'.join(rest)}`" if rest else f"`{path}` is not a number"
        if field in PLACE_FIELDS[-3:]:
            raise PathError(what, f"an axis is a vector, with `.{field}.x`, `.{field}.y` and `.{field}.z`")
        hint = did_you_mean(field, PLACE_FIELDS) if rest else ""
        raise PathError(
            what, hint or f"write one of {', '.join(f'`.{one}`' for one in PLACE_FIELDS[:9])} after it"
        )

    def _word(self, word: str) -> Expr:
        """`effort`: the sum of the squared forces of actuators on joints; `power`: the sum of these times velocity."""
        dynamics = self.scope.dynamics
        given = dynamics.actuation()
        others = given if word == "effort" else dynamics.motion.v
        return sum_of([mul(one, other) for one, other in zip(given, others, strict=True)])

    def _actuator_force(self, name: str) -> Expr:
        index = index_of(self.scope.mechanism.actuators, name)
        if index is None:
            raise PathError(f"the model has no actuator `{name}`", self._what_there_is("actuator"))
        return self.scope.dynamics.actuator_forces[index]

    def _what_there_is(self, kind: str) -> str:
        known = [*KINDS, "com", "momentum", "angular", "energy", "joint", "actuator", "keyframe"]
        if kind == "joint":
            names = [name for found in self.scope.coordinates for name in found.names]
        elif kind == "actuator":
            names = self.scope.controls
        elif any(name.startswith(f"{kind}_f") for name, _ in self.scope.contact_forces):
            return (
                f"`{kind}` is a contact: its place is that of the geom, site or body that it names, such as "
                f"`geom.NAME.x`; its forces are `{kind}_fx`, `{kind}_fz`"
            )
        else:
            if kind == "energy":
                return "write `energy.kinetic` or `energy.potential`"
            return did_you_mean(kind, known) or f"paths begin with {', '.join(f'`{one}.`' for one in known)}"
        return f"it has {', '.join(f'`{name}`' for name in names[:12])}" if names else f"it has no {kind}s"


__all__ = ["KINDS", "PathError", "Paths", "parts_of"]
