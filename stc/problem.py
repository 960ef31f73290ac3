"""The problem of a spec in continuous time, before transcription.

Elaboration (:mod:`stc.language.elaborate`) makes a :class:`Problem` from a syntax tree; transcription
(:mod:`stc.transcription`) turns it into a nonlinear program.  Expressions are :class:`stc.symbolic.expr.Expr`
whose symbols carry the keys below.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

from stc.records import dataclass, field

if TYPE_CHECKING:
    from stc.data_sets import DataSet
    from stc.errors import Diagnostic, Source, Span
    from stc.recorded_files import RecordedFile
    from stc.symbolic.expr import Expr
    from stc.symbolic.tables import TableRef


@dataclass(frozen=True, slots=True)
class ConstantRef:
    """A constant by name; a run-time input of every kernel."""

    name: str

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True, slots=True)
class ParameterRef:
    """An unknown with one value for the whole motion."""

    name: str

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True, slots=True, repr=False)
class VariableRef:
    """A variable, or its time derivative of the given order, at frame ``scale*i + shift``.

    ``(1, 0)`` is the frame the statement stands on, ``(1, k)`` a relative and ``(0, k)`` an absolute index.
    ``side`` is ``"before"`` or ``"after"`` where the spec asks for one side of a jump, else empty.
    Whole numbers may be int or Fraction: both compare, hash and print alike.
    """

    name: str
    order: int = 0
    scale: Fraction | int = 1
    shift: Fraction | int = 0
    side: str = ""

    def __repr__(self) -> str:
        return f"VariableRef({self.name!r}, {self.order}, {self.scale}, {self.shift}, {self.side!r})"

    def __hash__(self) -> int:
        # Fractions take longer to hash than all the rest, and derivations hash these by the ten thousand.
        shift = self.shift
        return hash(
            (self.name, self.order, self.side, self.scale.numerator, shift.numerator, shift.denominator)
        )

    def __str__(self) -> str:
        text = self.name + "'" * self.order
        if (self.scale, self.shift) != (1, 0):
            text += f"[{index_text(self.scale, self.shift)}]"
        return f"{self.side}({text})" if self.side else text


@dataclass(frozen=True, slots=True)
class DefinitionRef:
    """A definition that stands under range headers; which piece it means depends on the frame.

    ``order`` counts primes: the total time derivative of the piece that holds.
    """

    name: str
    order: int = 0
    side: str = ""

    def __str__(self) -> str:
        text = self.name + "'" * self.order
        return f"{self.side}({text})" if self.side else text


@dataclass(frozen=True, slots=True)
class TimeRef:
    """``t``: the time of the frame the statement stands on."""

    def __str__(self) -> str:
        return "t"


@dataclass(frozen=True, slots=True)
class IndexRef:
    """``i``: the index of the frame at which a statement is evaluated (k + 1/2 at the midpoint after frame k)."""

    def __str__(self) -> str:
        return "i"


@dataclass(frozen=True, slots=True)
class CellRef:
    """A column of a data set, in a statement that stands on its rows: the number in the row at hand."""

    data: str
    column: str

    def __str__(self) -> str:
        return f"{self.data}.{self.column}"


def index_text(scale: Fraction | int, shift: Fraction | int) -> str:
    """``scale*i + shift`` as the spec language writes it: ``i + 1``, ``2*i``, ``60 - i``, ``7``."""
    if scale == 0:
        return str(shift)
    times_i = "i" if scale == 1 else "-i" if scale == -1 else f"{scale}*i"
    if shift == 0:
        return times_i
    if scale < 0 < shift:
        return f"{shift} - {times_i[1:]}"
    return f"{times_i} + {shift}" if shift > 0 else f"{times_i} - {-shift}"


@dataclass(frozen=True, slots=True)
class FrameRange:
    """The frames ``first..last``, both included; ``span`` is the header (or None for the default range)."""

    first: int
    last: int
    span: Span | None = None

    def __str__(self) -> str:
        return f"[{self.first}]" if self.first == self.last else f"[{self.first}, {self.last}]"


@dataclass(frozen=True, slots=True)
class NamedFrame:
    """A frame that the text of a spec names, in a range header or as an index such as ``x[20]``."""

    frame: int
    span: Span


@dataclass(frozen=True, slots=True)
class Relation:
    """``lower <= body <= upper`` on every frame of a range.

    ``lower`` and ``upper`` are expressions of constants, ``i`` and ``t`` alone, or None where absent
    (infinite); an equality has the very same expression on both sides.  ``a <= b`` with neither side constant
    is ``a - b <= 0``.  The value of a bound may be infinite: a constant may be given as ``inf``.
    ``coordinate`` is the variable whose equation of motion it is.  ``between`` is held against the bounds between the
    nodes where the body has unknowns that mean nothing there (``Problem.at_nodes``).
    ``on_frames`` leaves out the midpoints between the frames.
    ``complementary`` marks the product of the slacks of the two relations before it, as
    ``0 <= a complements b >= 0`` states it: at most 0.
    """

    body: Expr
    lower: Expr | None
    upper: Expr | None
    range: FrameRange
    span: Span
    text: str
    coordinate: str = ""
    between: Expr | None = None
    on_frames: bool = False
    complementary: bool = False

    @property
    def is_equality(self) -> bool:
        return self.lower is not None and self.lower is self.upper


@dataclass(frozen=True, slots=True)
class ObjectiveTerm:
    """One summand of the objective: a plain sum over the frames, or an integral over the range's time.

    With ``rows`` it is a sum over the rows of that data set instead, and the range is frame 0 alone.
    """

    body: Expr
    integral: bool
    range: FrameRange
    span: Span
    text: str
    rows: str = ""


@dataclass(frozen=True, slots=True)
class DefinitionPiece:
    """One ranged definition; of overlapping pieces the later one wins."""

    body: Expr
    range: FrameRange
    span: Span


@dataclass(frozen=True, slots=True)
class Guess:
    """A starting value for a variable (on a range) or a parameter, in constants, ``t`` and ``i``."""

    name: str
    body: Expr
    range: FrameRange
    span: Span


@dataclass(frozen=True, slots=True)
class Jump:
    """At ``frame`` the derivative of this order of a variable, and all higher ones, may be two-valued."""

    frame: int
    name: str
    order: int
    span: Span


@dataclass(frozen=True, slots=True)
class Rotation:
    """An orientation as a unit quaternion (w, x, y, z), and the angular velocity in the turned frame that changes it.

    All seven are names of variables.  The quaternion's time derivative is q (0, w) / 2 and no unknown of its own
    (:mod:`stc.time_derivatives`); the transcription ties both, and keeps the norm (:mod:`stc.transcription.rotations`).
    """

    quaternion: tuple[str, str, str, str]
    velocity: tuple[str, str, str]


@dataclass(frozen=True, slots=True)
class Correction:
    """Terms that relax the links of some variables on the steps from one frame to another.

    If functions of positions or velocities are constrained at every frame, there are more rows than unknowns.  Each
    such function adds an unknown of the step, which relaxes the links along the gradient of the function.

    Attributes:
        range: the first and the last frame of the steps.
        unknowns: variables of which each step has its own value, at the node of its links.
        shares: by variable and order of the link: gradients times unknowns, at a frame.  An orientation's link is found
            under its angular velocities, with the order -1.
    """

    range: FrameRange
    unknowns: tuple[str, ...]
    shares: Mapping[tuple[str, int], Expr]


@dataclass(frozen=True, slots=True)
class Fixture:
    """A constraint of a model that holds over some frames, which the guess should satisfy.

    Attributes:
        range: the frames.
        reference: the frame whose guess gives the place, if nothing else does.
        places: functions of the configuration that are 0; references to the next frame mean any of the frames, and
            references to the frame itself mean the reference.
        rates: their derivatives as functions of configuration and velocities.
    """

    range: FrameRange
    reference: int
    places: Sequence[Expr]
    rates: Sequence[Expr]


@dataclass(frozen=True, slots=True)
class ReplayChannel:
    """One line of ``replay:``: ``kind path = body;`` with kind joint, actuator, apply, contact, compare or set.

    A ``set`` line that comes with the spec's model has that model's number as ``usual``.  It acts only with another
    value, so that, if the replay has a model of its own, the numbers of that one are judged.
    """

    kind: str
    path: tuple[str, ...]
    body: Expr
    span: Span
    usual: float | None = None


@dataclass(frozen=True, slots=True)
class FreeContact:
    """A contact whose frames are left to the solver.

    Attributes:
        gaps: the distance of the contact point from the surface; for a sole those of its corners.
        pressure: the force of the surface along its normal.
        slip: the velocities of the contact point along the surface, and for a sole its angular velocity.
        weight: weight of the whole model in N, the scale of forces.
        span: the position of its ``free:`` line.
        sticks: whether it does not slip while it touches.
        relaxed: whether a constant relaxes its laws, which are complementary pairs otherwise.
    """

    name: str
    gaps: Sequence[Expr]
    pressure: Expr
    slip: Sequence[Expr]
    weight: float
    span: Span
    sticks: bool
    relaxed: bool


@dataclass(slots=True)
class Problem:
    """A spec with its numbers: everything that transcription needs.

    ``constants`` holds the value of each constant (overrides applied).  ``structural`` names the constants
    whose values determine this object (ranges, indices, exponents): changing one of those requires a new elaboration,
    changing any other does not.  ``step`` is the time from a frame to the next, in constants,
    parameters, ``i`` and possibly ``DefinitionRef("h")``; ``step_span`` is the place of its declaration,
    ``model_span`` that of the model's name. ``rotations`` are the orientations among the variables.  ``of_model`` says
    whether the equations of motion come from a model, ``left_out`` lists the kinds of its forces that the spec leaves
    out, ``additions`` what the spec adds to the model; for the guess, ``fixtures`` are the constraints it should
    satisfy, and ``root`` the variables that move the
    model as a whole. ``relaxation`` is the constant that bounds the products of gaps and contact forces, which should
    be zero; empty if there are none.  Several solves reduce it to its value.
    ``free_contacts`` are those that have such products.
    ``at_nodes`` are variables that are chosen node by node, without a course in time: the directions of distances.
    ``model_files`` are those of the spec's model as they were when it was read, unless the replay has another one.
    ``data`` holds the columns of numbers that the spec reads, ``tables`` the functions that it makes of them.
    ``definitions`` holds those that stand under range headers; ``macros`` the values of all
    others, which occur in no other expression by name.
    ``named`` are the frames that the text names, in its order, which does not depend on n.  Statements that contacts
    and poses stand for name none of their own.
    """

    name: str
    source: Source
    constants: Mapping[str, float]
    structural: frozenset[str]
    n: int
    method: str
    variables: Sequence[str]
    parameters: Sequence[str]
    step: Expr
    definitions: Mapping[str, Sequence[DefinitionPiece]]
    relations: Sequence[Relation]
    objective: Sequence[ObjectiveTerm]
    guesses: Sequence[Guess]
    jumps: Sequence[Jump]
    model: str | None = None
    replay: Sequence[ReplayChannel] = ()
    step_span: Span | None = None
    warnings: Sequence[Diagnostic] = field(default_factory=list)
    macros: Mapping[str, Expr] = field(default_factory=dict)
    model_span: Span | None = None
    rotations: Sequence[Rotation] = ()
    of_model: bool = False
    left_out: Sequence[str] = ()
    additions: Sequence[str] = ()
    relaxation: str = ""
    free_contacts: Sequence[FreeContact] = ()
    at_nodes: Sequence[str] = ()
    fixtures: Sequence[Fixture] = ()
    root: frozenset[str] = frozenset()
    corrections: Sequence[Correction] = ()
    data: Mapping[str, DataSet] = field(default_factory=dict)
    tables: Mapping[str, TableRef] = field(default_factory=dict)
    named: Sequence[NamedFrame] = ()
    model_files: Sequence[RecordedFile] = ()
