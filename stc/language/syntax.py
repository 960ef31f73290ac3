"""The syntax tree of a text, before names are resolved.

Every node has the position of its characters (``start``, ``end``); two nodes are equal if their content is, whatever
their position.  Sums and products are held flat, as written between one pair of parentheses, so that a sum of a
thousand terms is no deeper than one of two.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import TypeAlias

from stc.errors import Source
from stc.records import dataclass, field


@dataclass(slots=True)
class Node:
    """Any piece of syntax, with the offsets of its first character and of the one after its last."""

    start: int = field(compare=False, repr=False)
    end: int = field(compare=False, repr=False)


_BLANK = re.compile(r"(?:\s|#[^\n]*)+")


def statement_text(source: Source, node: Node) -> str:
    """The characters of a node on one line, without comments."""
    text = source.text[node.start : node.end]
    return _BLANK.sub(" ", text) if "\n" in text or "#" in text or "  " in text else text


# ---------------------------------------------------------------- expressions


@dataclass(slots=True)
class Number(Node):
    """A literal."""

    value: float


@dataclass(slots=True)
class Name(Node):
    """A name: of a constant, variable, parameter or definition, a reserved one, or the path of a thing of the model.

    A path is held as it is written without blanks, with quotes only around parts that are no plain words:
    ``joint.knee``, ``joint."left/hip"``, ``joint.*``.
    """

    name: str


@dataclass(slots=True)
class Negate(Node):
    """``-e``."""

    operand: Expression


@dataclass(slots=True)
class Sum(Node):
    """Two or more terms, each with its ``+`` or ``-``; the first one's is ``+``."""

    terms: list[tuple[str, Expression]]


@dataclass(slots=True)
class Product(Node):
    """Two or more factors, each with its ``*`` or ``/`` (the first: ``*``), read from left to right."""

    factors: list[tuple[str, Expression]]


@dataclass(slots=True)
class Power(Node):
    """``base^exponent``."""

    base: Expression
    exponent: Expression


@dataclass(slots=True)
class Call(Node):
    """``function(arguments)``; also ``integral``, ``before`` and ``after``."""

    function: str
    arguments: list[Expression]


@dataclass(slots=True)
class Prime(Node):
    """``operand'``, ``operand''``, ...: ``order`` time derivatives."""

    operand: Expression
    order: int


@dataclass(slots=True)
class Index(Node):
    """``operand[index]``."""

    operand: Expression
    index: Expression


@dataclass(slots=True)
class Vector(Node):
    """``(x, y, z)``: a displacement or an axis of a pose; nothing else takes one."""

    items: list[Expression]


@dataclass(slots=True)
class Member(Node):
    """``point(body.hand, 0, 0, 0.1).vx``: a field of the object that a call names; ``fields`` holds the words after
    it.
    """

    operand: Call
    fields: list[str]


Expression: TypeAlias = (
    Number | Name | Negate | Sum | Product | Power | Call | Prime | Index | Vector | Member
)


def parts(node: Expression) -> list[Expression]:
    """The expressions that an expression is made of directly, from left to right."""
    if isinstance(node, Sum):
        return [term for _, term in node.terms]
    if isinstance(node, Product):
        return [factor for _, factor in node.factors]
    if isinstance(node, Negate | Prime | Member):
        return [node.operand]
    if isinstance(node, Power):
        return [node.base, node.exponent]
    if isinstance(node, Index):
        return [node.operand, node.index]
    if isinstance(node, Vector):
        return node.items
    return node.arguments if isinstance(node, Call) else []


def walk(node: Expression) -> Iterator[Expression]:
    """The expression and everything in it, in the order of the text (a node before its parts)."""
    stack = [node]
    while stack:
        found = stack.pop()
        yield found
        stack.extend(reversed(parts(found)))


def names(node: Expression) -> list[str]:
    """Every plain name in an expression once, in the order of the text; not the functions'."""
    return list(dict.fromkeys(found.name for found in walk(node) if isinstance(found, Name)))


# ----------------------------------------------------------------- statements


@dataclass(slots=True)
class Declaration(Node):
    """``name`` or ``name = value`` in a list of constants, variables or parameters."""

    name: Name
    value: Expression | None


@dataclass(slots=True)
class Assignment(Node):
    """``name = value;`` among definitions or guesses."""

    name: Name
    value: Expression


@dataclass(slots=True)
class Relation(Node):
    """``e``, ``a = b``, ``a <= b``, ``lo <= e <= hi``, ...: operands with the operators between them.

    ``written`` is the text of a relation that was generated from another statement; otherwise its text is in the spec.
    ``complementary`` marks the product of the two statements before it.
    """

    operands: list[Expression]
    operators: list[str]
    written: str = field(default="", compare=False, repr=False)
    complementary: bool = field(default=False, compare=False, repr=False)


@dataclass(slots=True)
class JumpList(Node):
    """``x', tau;``: quantities with two values at the frames of the range header."""

    quantities: list[Expression]


@dataclass(slots=True)
class MethodChoice(Node):
    """``central;``."""

    name: str


@dataclass(slots=True)
class ModelFile(Node):
    """``model = "file.xml";`` in `replay:`; as a section, ``"file.xml" with floor without fluid, muscles;``."""

    path: str
    without: list[Name] = field(default_factory=list)
    additions: list[Name] = field(default_factory=list)


@dataclass(slots=True)
class Pose(Node):
    """``keyframe.stand + (D, 0, 0);``, ``periodic mirrored;``, ``keyframe.land turned 2*pi about z;``.

    ``base`` is a pose's name, `rest` or `periodic`; ``shift`` the translation; ``angle`` and ``axis`` a turn.
    """

    base: Name
    mirrored: bool = False
    grounded: bool = False
    shift: Vector | None = None
    angle: Expression | None = None
    axis: Expression | None = None


@dataclass(slots=True)
class PoseDefinition(Node):
    """``crouch = keyframe.stand, joint.knee = 1.9;`` in `poses:`."""

    name: Name
    pose: Pose
    changes: list[Assignment]


@dataclass(slots=True)
class Channel(Node):
    """``kind path = value;`` in `replay:`."""

    kind: str
    path: tuple[str, ...]
    value: Expression


@dataclass(slots=True)
class ContactDeclaration(Node):
    """``sole = foot(x, z, th), half = 0.1, soft;`` in `contact:`; an option may lack a value."""

    name: Name
    kind: Name
    pose: list[Expression]
    options: list[tuple[Name, Expression | None]]


@dataclass(slots=True)
class ContactPlace(Node):
    """``sole at x, z, angle;`` in `contact:`; any number of them may be given, from the left.

    ``on`` is the path of the surface in ``FL on geom.box at x, y;``, ``slides`` the word after ``slides`` in
    ``box slides forward;``.
    """

    name: Name
    at: list[Expression]
    on: Name | None = None
    slides: Name | None = None


@dataclass(slots=True)
class DataFile(Node):
    """A file under `data:`: ``polar = "polar.csv";``, perhaps with ``, unwrap angle`` or ``, unwrap angle = 360``."""

    name: Name
    path: str
    unwrapped: list[tuple[Name, Expression | None]]


@dataclass(slots=True)
class DataKeyframes(Node):
    """``walk = keyframes;`` in `data:`: the keyframes of the model, at their times."""

    name: Name


@dataclass(slots=True)
class DataRows(Node):
    """``thrust = (speed, force): (0, 10), (5, 4);`` in `data:`; a row has an expression for each column."""

    name: Name
    columns: list[Name]
    rows: list[list[Expression]]


@dataclass(slots=True)
class TableDefinition(Node):
    """``CL = table(polar.alpha, polar.cl), monotone, outside = hold;`` in `data:`; an option may lack a value."""

    name: Name
    columns: list[Name]
    options: list[tuple[Name, Name | None]]


@dataclass(slots=True)
class GuessFrom(Node):
    """``walk;`` in `guess:`: the solver starts from the columns of a data set."""

    name: Name


@dataclass(slots=True)
class RangeHeader(Node):
    """``[first, last]:``; ``last`` is None in ``[k]:``."""

    first: Expression
    last: Expression | None


Statement: TypeAlias = (
    Declaration
    | Assignment
    | Relation
    | JumpList
    | MethodChoice
    | ModelFile
    | Channel
    | ContactDeclaration
    | ContactPlace
    | Pose
    | PoseDefinition
    | DataFile
    | DataKeyframes
    | DataRows
    | TableDefinition
    | GuessFrom
)


@dataclass(slots=True)
class Block(Node):
    """The statements under one range header (None: those before any header, or a section without ranges).

    ``free`` is set of those under ``free:`` in `contact:`, whose frames are left to the solver.
    """

    header: RangeHeader | None
    statements: list[Statement]
    free: bool = False


@dataclass(slots=True)
class Section(Node):
    """One section; ``start`` to ``end`` is its head."""

    kind: str
    blocks: list[Block]


@dataclass(slots=True)
class SpecTree:
    """The syntax tree of a whole file.

    ``damaged`` holds the names in declarations that could not be read, so that their uses are not reported as
    undeclared.  ``models`` is for :func:`stc.language.model.scope.model_of`, which reads a model once.
    """

    source: Source
    sections: list[Section]
    damaged: frozenset[str] = frozenset()
    models: dict[object, object] = field(default_factory=dict, compare=False, repr=False)

    def blocks(self, kind: str) -> Iterator[Block]:
        """The blocks of all sections of a kind, in file order."""
        for section in self.sections:
            if section.kind == kind:
                yield from section.blocks
