"""A model's part of a problem: its equations, bounds, poses and contacts, without rows that others imply."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from stc.language import syntax
from stc.language.context import Context
from stc.language.model.contact import Contacts
from stc.language.model.free import free_contacts, is_relaxed, laws
from stc.language.model.holdings import Equalities
from stc.language.model.pose_rows import Stated, Values
from stc.language.model.poses import REFERENCE, Poses
from stc.language.model.scope import ModelScope
from stc.language.model.standing import Pinned, Standing
from stc.language.model.start import fixed_coordinates, way_between
from stc.language.model.statements import (
    activations,
    bounds,
    equations_of_motion,
    friction_of_tendons,
    own_forces,
    replay_lines,
)
from stc.problem import (
    Fixture,
    FrameRange,
    FreeContact,
    Guess,
    Jump,
    ObjectiveTerm,
    Relation,
    ReplayChannel,
)
from stc.symbolic.expr import ZERO, Expr


class ModelStatements:
    """What a model brings to a problem under way."""

    def __init__(self, context: Context, scope: ModelScope) -> None:
        assert context.builder.paths is not None
        self.context, self.scope, self.paths = context, scope, context.builder.paths
        self.contacts = Contacts(context, scope, self.paths)
        self.equalities = Equalities(context, scope)
        self.pinned: dict[int, Pinned] = {}
        self.periodic: list[tuple[Stated, syntax.Pose]] = []
        self.guessed: dict[int, Values] = {}
        self.poses: Poses | None = None
        self._standing: Standing | None = None

    @property
    def standing(self) -> Standing:
        """What is held, once poses and options of contacts are known."""
        if self._standing is None:
            self._standing = Standing(
                self.context, self.scope, self.equalities, self.contacts, self.pinned, self.periodic
            )
        return self._standing

    def impulses(self) -> list[str]:
        """The parameters that impacts bring."""
        return [
            *self.contacts.landings(),
            *self.equalities.impulse_names(len(self.contacts.impact_frames())),
        ]

    def jumps(self) -> list[Jump]:
        """What contacts let jump."""
        return self.contacts.jumps()

    def complete(self) -> None:
        """Once the definitions are known: options of contacts, poses."""
        self.contacts.complete()
        self.poses = Poses(self.context, self.scope, self.contacts.heights)

    def pose(self, statement: syntax.Pose, where: FrameRange) -> list[Relation]:
        """The rows of a pose under `constraints:`; those of a single frame wait for :meth:`relations`."""
        assert self.poses is not None
        if statement.base.name == "periodic":
            rows = self.poses.rows(statement) or []
            self.periodic += [(row, statement) for row in rows]
            return []
        if where.first != where.last:
            return self.poses.relations(statement, where)
        pinned = self.pinned.setdefault(where.first, Pinned())
        for row in self.poses.rows(statement) or []:
            pinned.rows.append((row, statement))
        if statement.base.name != "rest":
            pinned.values = self.poses.values(statement) or pinned.values
            pinned.statement = statement
        return []

    def relations(self, given: Mapping[str, list[Expr]]) -> Iterator[Relation]:
        """Everything that the model states; ``given`` are forces that the spec adds, by the coordinate's variable."""
        context, contacts = self.context, self.contacts
        forces = self.equalities.forces()
        forces.wrenches += contacts.wrenches()
        for dof, force in own_forces(self.scope, given):
            forces.push(dof, force)
        forces.include(friction_of_tendons(self.scope))
        yield from equations_of_motion(context, self.scope, forces)
        yield from activations(context, self.scope)
        yield from bounds(context, self.scope)
        yield from self.paths.distances.relations(context.everywhere, context.span(self.scope.statement))
        yield from contacts.relations()
        yield from contacts.impacts(self.equalities)
        yield from laws(contacts)
        yield from self.standing.idle_forces()
        yield from self.standing.relations()
        yield from self.standing.pins()
        for row, statement in self.periodic:
            yield Relation(row.body, ZERO, ZERO, FrameRange(0, 0), context.span(statement), row.text)

    def objective(self) -> list[ObjectiveTerm]:
        """What the speed of landings costs."""
        found = []
        for body, phase in self.contacts.prices():
            where = FrameRange(phase.frames.first, phase.frames.first)
            span = self.context.span(phase.statement)
            found.append(ObjectiveTerm(body, False, where, span, "landing"))
        return found

    def guess(self, pose: syntax.Pose, where: FrameRange) -> list[Guess]:
        """A pose under `guess:`: as it stands on a range; at a single frame the way between poses leads through it."""
        assert self.poses is not None
        if where.first != where.last:
            return self.poses.guesses(pose, where)
        values = self.poses.values(pose)
        if values is not None:
            self.guessed[where.first] = values
        return []

    def guesses(self, relations: Sequence[Relation]) -> Iterator[Guess]:
        """From pose to pose, pinned or guessed, thrown up where nothing stands; contacts that bear the weight.

        Args:
            relations: those of the spec, which may fix single coordinates at a frame.
        """
        context = self.context
        known = self._known_poses(relations)
        thrown = not self.equalities.to_world and not self.contacts.free()
        flights = self.contacts.flights() if thrown else []
        yield from way_between(context, self.scope, known, flights)
        yield from self.contacts.guesses()
        yield from self.paths.distances.guesses(context.everywhere, context.span(self.scope.statement))

    def free_contacts(self) -> list[FreeContact]:
        """The contacts whose frames are left to the solver."""
        return free_contacts(self.contacts)

    def is_relaxed(self) -> bool:
        """Whether contacts may be off their laws by as much as a constant."""
        return is_relaxed(self.contacts)

    def fixtures(self) -> list[Fixture]:
        """What is held, to which the way between poses is brought."""
        return list(self.standing.fixtures(self._known_poses(())))

    def root(self) -> frozenset[str]:
        """The freedoms of bodies that hang on nothing but the world."""
        bodies = self.scope.mechanism.bodies
        first = [one for one in self.scope.coordinates if bodies[one.joint.body].parent == 0]
        return frozenset(name for one in first for name in one.freedoms)

    def _known_poses(self, relations: Sequence[Relation]) -> dict[int, Values]:
        """Poses, or parts of them, by frame; in a periodic motion the first and the last frame have some."""
        pinned = {frame: one.values for frame, one in self.pinned.items() if one.values is not None}
        known = self.guessed | pinned
        assert self.poses is not None
        for _, statement in self.periodic[:1]:
            known.setdefault(0, self.poses.usual())
            known.setdefault(self.context.n, self.poses.repeated(known[0], statement))
        known = known or {0: self.poses.named[REFERENCE]}
        for frame, values in fixed_coordinates(self.scope, relations).items():
            known[frame] = values | known.get(frame, {})
        return known

    def replay(self) -> list[ReplayChannel]:
        """The lines of the replay that the model and its contacts bring."""
        return [*replay_lines(self.context, self.scope), *self.contacts.replay_lines()]
