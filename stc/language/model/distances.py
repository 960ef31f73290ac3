"""``distance(geom.A, geom.B)`` in a spec with a model.

As an expression it is a smooth lower bound of the distance.  A relation with a lower bound, ``distance(...) >= d``, is
stated exactly: there is a direction along which the gap is that large, and this direction is an unknown
(:mod:`stc.mechanism.separation`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from stc.errors import Span
from stc.language import syntax
from stc.language.model.scope import ModelScope, PathError, parts_of, quoted
from stc.language.name_table import Entry, NameTable
from stc.mechanism.mechanism import index_of
from stc.mechanism.separation import SHAPES, Separation, separation
from stc.mechanism.vectors import dot
from stc.problem import FrameRange, Guess, Relation, VariableRef
from stc.records import dataclass, field
from stc.symbolic.differentiate import derivative
from stc.symbolic.expr import ONE, ZERO, Expr, add, call, mul, num, reachable, sub, substitute, sym

#: Besides its share in the size of a segment, what the guess of how much of it a direction sees is above that.
_MARGIN = 0.05


@dataclass(frozen=True, slots=True)
class Pair:
    """Two geoms whose distance a spec uses.

    Attributes:
        name: beginning of the names of the pair's unknowns.
        apart: the separation of the two.
        bound: the smooth lower bound.
    """

    name: str
    apart: Separation
    bound: Expr

    @property
    def direction(self) -> list[str]:
        """The names of the direction's components."""
        return [f"{self.name}.n{axis}" for axis in "xyz"]

    @property
    def widths(self) -> list[str]:
        """The names of the unknowns that bound the extent of the half segments along the direction; the first has
        none.
        """
        return [f"{self.name}.w{k}" for k in range(1, len(self.apart.halves))]


@dataclass(slots=True)
class Distances:
    """The distances that a spec uses.

    Attributes:
        pairs: by their smooth bounds.
        stated: those with a direction among the unknowns, by name.
        overlapping: the names of those whose cores may touch or overlap.
    """

    scope: ModelScope
    pairs: dict[Expr, Pair] = field(default_factory=dict)
    stated: dict[str, Pair] = field(default_factory=dict)
    overlapping: set[str] = field(default_factory=set)

    def of(self, call: syntax.Call) -> Expr:
        """The smooth lower bound of ``distance(geom.A, geom.B)``.

        Raises:
            PathError: the distance is not defined.
        """
        if len(call.arguments) != 2:
            raise PathError(
                f"`distance` takes 2 geoms, not {len(call.arguments)}",
                "as in `distance(geom.left, geom.right)`",
            )
        first, second = [self._geom(argument) for argument in call.arguments]
        if first == second:
            raise PathError("a geom and itself have no distance", "as in `distance(geom.left, geom.right)`")
        names = [self.scope.mechanism.geoms[index].name for index in (first, second)]
        try:
            apart = separation(self.scope.dynamics, first, second)
        except ValueError as error:
            place = next(
                (
                    g.place
                    for g in (self.scope.mechanism.geoms[k] for k in (first, second))
                    if g.kind not in SHAPES
                ),
                None,
            )
            hint = "distances are known of spheres, capsules, boxes, and of these from planes"
            raise PathError(f"{error}{f' ({place})' if place else ''}, and has no distance", hint) from None
        pair = Pair(".".join(["distance", *map(quoted, names)]), apart, apart.lower_bound())
        self.pairs.setdefault(pair.bound, pair)
        return pair.bound

    def _geom(self, node: syntax.Expression) -> int:
        hint = "as in `distance(geom.left, geom.right)`"
        kind, *rest = parts_of(node.name) if isinstance(node, syntax.Name) else ("",)
        if kind != "geom" or len(rest) != 1:
            raise PathError("`distance` takes two geoms", hint)
        geoms = self.scope.mechanism.geoms
        index = index_of(geoms, rest[0])
        if index is None:
            names = [quoted(geom.name) for geom in geoms if geom.name]
            raise PathError(f"the model has no geom `{rest[0]}`", f"its geoms are {', '.join(names[:12])}")
        return index

    def exact(self, relation: Relation, value: Callable[[Expr], float | None]) -> list[Relation]:
        """A relation with its lower bounds on distances stated exactly; other relations unchanged.

        Args:
            value: function that evaluates an expression of constants, which then becomes structural; None for others.
        """
        found: list[Relation] = []
        for lower, upper, sign in ((relation.lower, None, 1.0), (None, relation.upper, -1.0)):
            if (relation.lower if sign > 0 else relation.upper) is None:
                continue
            bodies, between = [relation.body], relation.body
            for bound, pair in () if relation.is_equality else self._within(relation.body):
                share = sign * _share(relation.body, bound)
                if share > 0.0:
                    asked = lower if sign > 0.0 else upper
                    assert asked is not None
                    if pair.apart.has_direction and not self._is_apart(
                        pair, relation.body is bound, asked, value
                    ):
                        self.overlapping.add(pair.name)
                    bodies = [
                        substitute(body, {}, {bound: gap}) for body in bodies for gap in self._gaps(pair)
                    ]
                    between = substitute(between, {}, {bound: pair.apart.value()})
            one = replace(relation, lower=lower, upper=upper, between=between)
            found += [replace(one, body=body) for body in bodies]
        return found if any(one.body is not relation.body for one in found) else [relation]

    @staticmethod
    def _is_apart(pair: Pair, alone: bool, asked: Expr, value: Callable[[Expr], float | None]) -> bool:
        """Whether the required distance keeps the cores of a pair apart, so that its direction may be shorter than 1.

        Cores with radii around them are apart at any distance that people ask for; boxes where it is above 0.
        """
        if pair.apart.radii:
            return True
        number = value(asked) if alone else None
        return number is not None and number > 0.0

    def _within(self, body: Expr) -> list[tuple[Expr, Pair]]:
        if not self.pairs:
            return []
        return [(node, self.pairs[node]) for node in reachable([body]) if node in self.pairs]

    def _gaps(self, pair: Pair) -> list[Expr]:
        """Expressions whose minimum is the distance, for the best values of the pair's unknowns."""
        if pair.apart.is_smooth:
            return [pair.bound]
        if not pair.apart.has_direction:
            return pair.apart.corners()
        self.stated.setdefault(pair.name, pair)
        return pair.apart.gaps(_symbols(pair.direction), _symbols(pair.widths))

    def unknowns(self) -> list[str]:
        """The additional variables of exact relations."""
        return [name for pair in self.stated.values() for name in (*pair.direction, *pair.widths)]

    def declare(self, table: NameTable) -> None:
        """Declare the directions that relations need as variables."""
        at = self.scope.statement
        for name in self.unknowns():
            table.entries.setdefault(name, Entry(name, "variable", at.start, at.end, None, True))

    def relations(self, where: FrameRange, span: Span) -> Iterator[Relation]:
        """Constraints on directions: length 1, and upper bounds on the extent of every half segment.

        A shorter direction gives a smaller gap, so that it need not be excluded if there is a gap; a solve that starts
        with overlapping geoms then converges faster.
        """
        for pair in self.stated.values():
            n = _symbols(pair.direction)
            least = ONE if pair.name in self.overlapping else None
            yield Relation(dot(n, n), least, ONE, where, span, f"the direction of {pair.name} has length 1")
            for name, width in zip(pair.widths, pair.apart.widths(n)[1:], strict=True):
                for body in (sub(sym(VariableRef(name)), width), add(sym(VariableRef(name)), width)):
                    yield Relation(
                        body, ZERO, None, where, span, f"{name} is what {pair.name} sees of a side"
                    )

    def guesses(self, where: FrameRange, span: Span) -> Iterator[Guess]:
        """Guesses of the unknown directions: along the lines between the points that are about nearest in the guess."""
        for pair in self.stated.values():
            direction = pair.apart.direction()
            for name, body in zip(pair.direction, direction, strict=True):
                yield Guess(name, body, where, span)
            sizes = pair.apart.halves[1:]
            for name, width, (e, _) in zip(pair.widths, pair.apart.widths(direction)[1:], sizes, strict=True):
                yield Guess(name, call("sqrt", add(mul(width, width), num((_MARGIN * e) ** 2))), where, span)


def _share(body: Expr, part: Expr) -> float:
    """The factor of a part in a sum; 0 if it is inside another expression."""
    key = sym(VariableRef("?"))
    slope = derivative(substitute(body, {}, {part: key}), VariableRef("?"))
    return float(slope.payload) if slope.op == "num" else 0.0


def _symbols(names: Sequence[str]) -> list[Expr]:
    return [sym(VariableRef(name)) for name in names]


__all__ = ["Distances", "Pair"]
