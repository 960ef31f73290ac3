"""What holds parts of a model in place over some frames: standing contacts, and the model's equality constraints."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from stc.errors import Span
from stc.language.context import Context
from stc.language.model.scope import ModelScope, path_of
from stc.mechanism.equalities import Held, held
from stc.mechanism.forces import Forces
from stc.mechanism.tree import WORLD
from stc.problem import FrameRange, ParameterRef, VariableRef
from stc.records import dataclass, field
from stc.symbolic.expr import Expr, sub, substitute, sym, symbols


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A function of the configuration that does not change while something is held.

    Attributes:
        rate: its time derivative, or another function of the velocities that vanishes with it.
        zero: what is 0 at every frame, where the value is known.
        change: what is 0 from a frame to the next one, where the value is that of the first frame, whatever it is.
        start: whether the value holds at the first frame alone, as the place of a ball that rolls on from there.
    """

    rate: Expr
    zero: Expr | None = None
    change: Expr | None = None
    start: bool = False

    def known(self, pose: Mapping[str, Expr]) -> Place:
        """The same where a pose says what the value is: joined to that, and not each frame to the next one."""
        if self.change is None:
            return self
        keys = [key for key in symbols(self.change) if isinstance(key, VariableRef)]
        at_pose = {key: pose[key.name] for key in keys if key.shift == 0}
        other = {key: sym(replace(key, shift=key.shift - 1)) for key in keys if key.shift != 0}
        return replace(self, zero=substitute(self.change, at_pose | other), change=None)


@dataclass(frozen=True, slots=True, eq=False)
class Holding:
    """Something that is held over some frames: its places, velocities and accelerations stay what they are.

    Attributes:
        name: what it is called in texts of statements.
        path: the same for the names of its unknowns.
        frames: on which it holds.
        span: what it is there for.
        places: what of it does not change.
        nearly: what of it hardly changes: it is no row, but a guess in which it does not is a good one.
        velocities, accelerations: what is 0, and its rates.
        landing: whether an impact begins it, so that velocities are held from after that on.
        at: the place in the world of what is held fixed there.
        height: the distance from the surface where a contact stands on one.
        surface: what that is called.
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

    def stands(self, step: int) -> bool:
        """Whether it holds over the step that begins at a frame."""
        return self.frames.first <= step < self.frames.last


def one_frame_on(e: Expr) -> Expr:
    """The value of a function of the configuration at the next frame."""
    keys = [key for key in symbols(e) if isinstance(key, VariableRef)]
    return substitute(e, {key: sym(replace(key, shift=key.shift + 1)) for key in keys})


def unchanged(e: Expr) -> Expr:
    """What is 0 where a function of the configuration is the same at the next frame."""
    return sub(one_frame_on(e), e)


@dataclass(slots=True)
class Equalities:
    """The equality constraints of a model that hold from the start."""

    context: Context
    scope: ModelScope
    found: list[tuple[str, Held]] = field(default_factory=list)

    def __post_init__(self) -> None:
        for equality in self.scope.mechanism.equalities:
            if equality.active:
                self.found.append((equality.name, held(self.scope.dynamics, equality)))

    @property
    def to_world(self) -> bool:
        """Whether one of them holds a part of the model to what nothing moves."""
        return any(frame.segment == WORLD for _, one in self.found for frame in one.ends)

    def forces(self) -> Forces:
        """What they do on the model."""
        total = Forces()
        for name, one in self.found:
            total.include(one.act([sym(VariableRef(path_of("equality", name, part))) for part in one.names]))
        return total

    def impulses(self, impact: int) -> Forces:
        """What they do on the model in an impact; these are counted from 1."""
        total = Forces()
        for name, one in self.found:
            total.include(one.act([sym(ParameterRef(part)) for part in _impulses(name, one, impact)]))
        return total

    def impulse_names(self, impacts: int) -> list[str]:
        """The parameters of the impulses in so many impacts."""
        return [
            part
            for impact in range(1, impacts + 1)
            for name, one in self.found
            for part in _impulses(name, one, impact)
        ]

    def holdings(self) -> Iterator[Holding]:
        """Each over the whole motion."""
        span = self.context.span(self.scope.statement)
        for name, one in self.found:
            rates = [self.context.builder.derivative(place, 1) for place in one.places]
            yield Holding(
                name=f"equality {name}",
                path=path_of("equality", name),
                frames=self.context.everywhere,
                span=span,
                places=[Place(rate, place) for rate, place in zip(rates, one.places, strict=True)],
                velocities=list(one.rates),
                accelerations=list(one.accelerations),
            )


def _impulses(name: str, one: Held, impact: int) -> list[str]:
    return [f"{path_of('equality', name, part)}_impact{impact}" for part in one.names]
