"""Constraints that hold over some frames: standing contacts, and the model's equality constraints."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

from stc.errors import Span
from stc.language.context import Context
from stc.language.model.scope import ModelScope, path_of
from stc.mechanism.equalities import Held, held, turned_by
from stc.mechanism.forces import Forces
from stc.mechanism.tree import WORLD
from stc.mechanism.vectors import dot, product, transposed
from stc.problem import FrameRange, ParameterRef, VariableRef
from stc.records import dataclass, field
from stc.symbolic.expr import Expr, sub, substitute, sym, symbols


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A function of the configuration that is constant while a constraint holds.

    Attributes:
        rate: its time derivative, or another function of the velocities that vanishes with it.
        zero: expression that is 0 at every frame, if the value is known.
        change: expression that is 0 between neighbouring frames, if the value is that of the first frame.
        start: whether the value holds at the first frame alone, as for the place of a rolling ball.
    """

    rate: Expr
    zero: Expr | None = None
    change: Expr | None = None
    start: bool = False

    def known(self, pose: Mapping[str, Expr]) -> Place:
        """The same constraint with a value known from a pose, in place of that of the first frame."""
        if self.change is None:
            return self
        keys = [key for key in symbols(self.change) if isinstance(key, VariableRef)]
        at_pose = {key: pose[key.name] for key in keys if key.shift == 0}
        other = {key: sym(replace(key, shift=key.shift - 1)) for key in keys if key.shift != 0}
        return replace(self, zero=substitute(self.change, at_pose | other), change=None)


@dataclass(frozen=True, slots=True, eq=False)
class Holding:
    """A constraint over some frames: its places are constant, its velocities and accelerations zero.

    Attributes:
        name: its name in the texts of statements.
        path: its name in the names of its unknowns.
        frames: the frames on which it holds.
        span: the statement in the spec.
        places: functions that are constant.
        nearly: functions that hardly change; they are not constrained, but should be constant in the guess.
        velocities, accelerations: expressions that are 0, and their rates.
        landing: whether it begins with an impact, so that velocities are zero after it.
        at: the position in the world of a fixed point.
        height: the distance from the surface of a standing contact.
        surface: the name of that surface.
        loads: of an equality, the force along each of its rows.
    """

    name: str
    path: str
    frames: FrameRange
    span: Span
    places: list[Place]
    velocities: list[Expr]
    accelerations: list[Expr]
    landing: bool = False
    nearly: Sequence[Place] = ()
    at: tuple[Expr, ...] = ()
    height: Expr | None = None
    surface: str = ""
    loads: Sequence[Expr] = ()

    def stands(self, step: int) -> bool:
        """Whether the constraint holds over the step that begins at a frame."""
        return self.frames.first <= step < self.frames.last


def one_frame_on(e: Expr) -> Expr:
    """The value of a function of the configuration at the next frame."""
    keys = [key for key in symbols(e) if isinstance(key, VariableRef)]
    return substitute(e, {key: sym(replace(key, shift=key.shift + 1)) for key in keys})


def unchanged(e: Expr) -> Expr:
    """An expression that is 0 if a function of the configuration is the same at the next frame."""
    return sub(one_frame_on(e), e)


@dataclass(slots=True)
class Equalities:
    """The equality constraints of a model that hold from the start.

    Attributes:
        found: each with its name.
        carried: the names of welds to mocap bodies that hold a body where it is at the first frame.
    """

    context: Context
    scope: ModelScope
    found: list[tuple[str, Held]] = field(default_factory=list)
    carried: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        mechanism, words = self.scope.mechanism, [word.name for word in self.scope.statement.additions]
        for equality in mechanism.equalities:
            if equality.active:
                self.found.append((equality.name, held(self.scope.dynamics, equality)))
                if "mocap" in words and mechanism.welded_to_mocap(equality):
                    self.carried.add(equality.name)

    @property
    def to_world(self) -> bool:
        """Whether one of them connects a part of the model to the world."""
        return any(frame.segment == WORLD for _, one in self.found for frame in one.ends)

    def forces(self) -> Forces:
        """The forces by which the held constraints act on the model."""
        total = Forces()
        for name, one in self.found:
            total.include(one.act([sym(VariableRef(path_of("equality", name, part))) for part in one.names]))
        return total

    def impulses(self, impact: int) -> Forces:
        """Their impulses on the model in an impact; impacts are counted from 1."""
        total = Forces()
        for name, one in self.found:
            total.include(one.act([sym(ParameterRef(part)) for part in _impulses(name, one, impact)]))
        return total

    def impulse_names(self, impacts: int) -> list[str]:
        """The parameters of the impulses of a number of impacts."""
        return [
            part
            for impact in range(1, impacts + 1)
            for name, one in self.found
            for part in _impulses(name, one, impact)
        ]

    def holdings(self) -> Iterator[Holding]:
        """The model's equality constraints as holdings, each over all frames of the motion."""
        span = self.context.span(self.scope.statement)
        for name, one in self.found:
            rows = self._rows(one)
            # The angles of a weld are in the axes of a body as they are.
            places = [*rows(one.places[:3]), *one.places[3:]]
            rates = [self.context.builder.derivative(place, 1) for place in places]
            held_places = [Place(rate, place) for rate, place in zip(rates, places, strict=True)]
            if name in self.carried:
                held_places = self._from_start(one)
            yield Holding(
                name=f"equality {name}",
                path=path_of("equality", name),
                frames=self.context.everywhere,
                span=span,
                places=held_places,
                velocities=rows(one.rates),
                accelerations=rows(one.accelerations),
                loads=rows([sym(VariableRef(path_of("equality", name, part))) for part in one.names]),
            )

    def _from_start(self, one: Held) -> list[Place]:
        """The places of a weld to a mocap body, which are those of the first frame."""
        first = one.ends[0].segment != WORLD
        now = self.scope.dynamics.kinematics.axes_of(one.ends[not first])
        x, y, z = [(one_frame_on(row[0]), one_frame_on(row[1]), one_frame_on(row[2])) for row in now]
        turn = product((x, y, z), transposed(now)) if first else product(now, transposed((x, y, z)))
        changes = (*(unchanged(place) for place in one.places[:3]), *turned_by(turn))
        return [Place(rate, change=change) for rate, change in zip(one.rates, changes, strict=False)]

    def _rows(self, one: Held) -> Callable[[Sequence[Expr]], list[Expr]]:
        """Vectors along the axes of the first of the bodies that an equality joins, where that moves.

        A loop that moves in a plane has nothing to hold across it.  If the plane turns, the axis across it turns too.
        """
        if not one.ends or one.ends[0].segment == WORLD:
            return list
        axes = transposed(self.scope.dynamics.kinematics.axes_of(one.ends[0]))

        def turned(parts: Sequence[Expr]) -> list[Expr]:
            threes = [(parts[k], parts[k + 1], parts[k + 2]) for k in range(0, len(parts), 3)]
            return [dot(axis, three) for three in threes for axis in axes]

        return turned


def _impulses(name: str, one: Held, impact: int) -> list[str]:
    return [f"{path_of('equality', name, part)}_impact{impact}" for part in one.names]
