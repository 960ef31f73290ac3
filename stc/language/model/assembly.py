"""A model's part of a problem: its equations, bounds, poses and contacts, without redundant constraints."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

from stc.language import syntax
from stc.language.context import Context
from stc.language.model.contact import Contacts
from stc.language.model.free import free_contacts, laws, loads
from stc.language.model.holdings import Equalities
from stc.language.model.pose_rows import Stated, Values
from stc.language.model.poses import REFERENCE, Poses
from stc.language.model.scope import RELAXATION, ModelScope
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
from stc.language.model.statics import Statics
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
    """The statements that a model adds to a problem."""

    def __init__(self, context: Context, scope: ModelScope) -> None:
        assert context.builder.paths is not None
        self.context, self.scope, self.paths = context, scope, context.builder.paths
        self.contacts = Contacts(context, scope, self.paths)
        self.equalities = Equalities(context, scope)
        self.pinned: dict[int, Pinned] = {}
        self.periodic: list[tuple[Stated, syntax.Pose]] = []
        self.guessed: dict[int, Values] = {}
        self.poses: Poses | None = None

    @cached_property
    def standing(self) -> Standing:
        """The held constraints, once poses and options of contacts are known."""
        return Standing(self.context, self.scope, self.equalities, self.contacts, self.pinned, self.periodic)

    def impulses(self) -> list[str]:
        """The parameters of impacts."""
        return [
            *self.contacts.landings(),
            *self.equalities.impulse_names(len(self.contacts.impact_frames())),
        ]

    def jumps(self) -> list[Jump]:
        """The jumps due to contacts."""
        return self.contacts.jumps()

    def complete(self) -> None:
        """Evaluate options of contacts and poses, once the definitions are known."""
        self.contacts.complete()
        self.poses = Poses(self.context, self.scope, self.contacts.heights)

    def pose(self, statement: syntax.Pose, where: FrameRange) -> list[Relation]:
        """The constraints of a pose under `constraints:`; those of a single frame are kept for :meth:`relations`."""
        assert self.poses is not None
        if statement.base.name == "periodic":
            rows = self.poses.rows(statement) or []
            self.periodic += [(row, statement) for row in rows]
            self.contacts.periodic = statement
            return []
        if where.first != where.last:
            return self.poses.relations(statement, where)
        pinned = self.pinned.setdefault(where.first, Pinned())
        for row in self.poses.rows(statement, where.first) or []:
            pinned.rows.append((row, statement))
        if statement.base.name != "rest":
            pinned.values = self.poses.values(statement, where.first) or pinned.values
            pinned.statement = statement
        return []

    def relations(self, given: Mapping[str, list[Expr]]) -> Iterator[Relation]:
        """All statements of the model; ``given`` are forces that the spec adds, by the coordinate's variable."""
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
        yield from laws(contacts, self.free_contacts)
        yield from self.standing.idle_forces()
        yield from self.standing.relations()
        yield from self.standing.pins()
        for row, statement in self.periodic:
            yield Relation(row.body, ZERO, ZERO, FrameRange(0, 0), context.span(statement), row.text)

    def warn_of_poses(self, relations: Sequence[Relation]) -> None:
        """Warn of poses at rest that cannot be held; ``relations`` are all of the problem."""
        freedoms = {name for one in self.scope.coordinates for name in one.freedoms}
        equations = [one for one in relations if one.coordinate in freedoms]
        Statics(self.context, self.scope, self.contacts, equations).warn(self.pinned)

    def objective(self) -> list[ObjectiveTerm]:
        """The cost of landing speeds."""
        found = []
        for body, phase in self.contacts.prices():
            where = FrameRange(phase.frames.first, phase.frames.first)
            span = self.context.span(phase.statement)
            found.append(ObjectiveTerm(body, False, where, span, "landing"))
        return found

    def guess(self, pose: syntax.Pose, where: FrameRange) -> list[Guess]:
        """A pose under `guess:`: on a range the guess there; at a single frame a pose to interpolate."""
        assert self.poses is not None
        if where.first != where.last:
            return self.poses.guesses(pose, where)
        values = self.poses.values(pose, where.first)
        if values is not None:
            self.guessed[where.first] = values
        return []

    def guesses(self, relations: Sequence[Relation]) -> Iterator[Guess]:
        """The guess between fixed and guessed poses, ballistic while nothing stands; contacts share the weight.

        Args:
            relations: those of the spec, which may fix single coordinates at a frame.
        """
        context = self.context
        known = self._known_poses(relations)
        thrown = not self.equalities.to_world and not self.contacts.free()
        flights = self.contacts.flights() if thrown else []
        yield from way_between(context, self.scope, known, flights)
        yield from self.contacts.guesses()
        yield from loads(self.contacts, self.free_contacts, known)
        yield from self.paths.distances.guesses(context.everywhere, context.span(self.scope.statement))

    @cached_property
    def free_contacts(self) -> list[FreeContact]:
        """The contacts under ``free:``, once their options are known."""
        return free_contacts(self.contacts)

    def relaxation(self) -> str:
        """The constant that relaxes the laws of free contacts; empty if none does."""
        return RELAXATION if any(found.relaxed for found in self.free_contacts) else ""

    def fixtures(self) -> list[Fixture]:
        """The held constraints, which the guess should satisfy."""
        return list(self.standing.fixtures(self._known_poses(())))

    def root(self) -> frozenset[str]:
        """The degrees of freedom of bodies attached to the world."""
        bodies = self.scope.mechanism.bodies
        first = [one for one in self.scope.coordinates if bodies[one.joint.body].parent == 0]
        return frozenset(name for one in first for name in one.freedoms)

    def _known_poses(self, relations: Sequence[Relation]) -> dict[int, Values]:
        """Poses, or parts of them, by frame; for a periodic motion also at the first and the last frame."""
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
        """The replay lines of the model and its contacts."""
        return [*replay_lines(self.context, self.scope), *self.contacts.replay_lines()]
