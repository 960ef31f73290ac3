"""What holds parts of a model in place over some frames: standing contacts, and the model's equality constraints."""

from __future__ import annotations

from collections.abc import Iterator

from stc.errors import Span
from stc.language.context import Context
from stc.language.model.scope import ModelScope, path_of
from stc.mechanism.equalities import Held, held
from stc.mechanism.forces import Forces
from stc.problem import FrameRange, VariableRef
from stc.records import dataclass, field
from stc.symbolic.expr import Expr, sym


@dataclass(frozen=True, slots=True, eq=False)
class Holding:
    """Something that is held over some frames.

    Its places and velocities are fixed where it begins; from there on its accelerations are zero.

    Attributes:
        name: what it is called in texts of statements.
        frames: on which it holds.
        span: what it is there for.
        places: what is 0 at the first frame, functions of the configuration.
        starts: what is 0 there of velocities, on the side after an impact where one begins it.
        velocities, accelerations: the same without a side, and its rates.
        whole: whether velocities are the rates of places throughout, so that all of it is fixed from the first frame
        on. at: the place in the world of what is held fixed there.
        height: the distance from the surface where a contact stands on one.
        surface: what that is called.
    """

    name: str
    frames: FrameRange
    span: Span
    places: list[Expr]
    starts: list[Expr]
    velocities: list[Expr]
    accelerations: list[Expr]
    whole: bool = False
    at: tuple[Expr, ...] = ()
    height: Expr | None = None
    surface: str = ""


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

    def forces(self) -> Forces:
        """What they do on the model."""
        total = Forces()
        for name, one in self.found:
            total.include(one.act([sym(VariableRef(path_of("equality", name, part))) for part in one.names]))
        return total

    def holdings(self) -> Iterator[Holding]:
        """Each over the whole motion."""
        span = self.context.span(self.scope.statement)
        for name, one in self.found:
            rates = list(one.rates)
            yield Holding(
                name=f"equality {name}",
                frames=self.context.everywhere,
                span=span,
                places=list(one.places),
                starts=rates,
                velocities=rates,
                accelerations=list(one.accelerations),
                whole=True,
            )
