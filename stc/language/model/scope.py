"""The model of a spec: its coordinates and controls as variables, its numbers as constants."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from stc import models
from stc.errors import StcError
from stc.language import syntax
from stc.language.diagnostics import Diagnostics, did_you_mean
from stc.language.name_table import Entry, NameTable
from stc.mechanism.dynamics import Dynamics
from stc.mechanism.equalities import held
from stc.mechanism.kinematics import Motion
from stc.mechanism.mechanism import Actuator, Joint, Mechanism
from stc.mechanism.numbers import Numbers
from stc.mechanism.numbers import Path as SettingPath
from stc.mechanism.read import read_model
from stc.mechanism.refusals import KINDS, refusals, without
from stc.mechanism.settings import changed, settable
from stc.model_source import ADDITIONS
from stc.problem import ConstantRef, Rotation, VariableRef
from stc.recorded_files import RecordedFile, record
from stc.records import dataclass
from stc.symbolic.expr import Expr, sym

QUATERNION = ("qw", "qx", "qy", "qz")
VELOCITY = ("wx", "wy", "wz")
_PART = re.compile(r'"[^"]*"|[^."]+')


def quoted(part: str) -> str:
    """A part of a path, in quotes if it is not an identifier."""
    return part if part.isidentifier() else f'"{part}"'


def parts_of(path: str) -> list[str]:
    """The parts of a path, without quotes."""
    return [part.strip('"') for part in _PART.findall(path)]


class PathError(Exception):
    """A path that the model does not have; ``hint`` lists existing ones."""

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message, self.hint = message, hint


def path_of(kind: str, name: str, *more: str) -> str:
    """The path of an element of the model, in the notation of the language."""
    return ".".join([kind, quoted(name), *more])


@dataclass(frozen=True, slots=True)
class Coordinates:
    """The variables of one joint.

    Attributes:
        joint: the joint.
        positions: ordinary coordinates: of a hinge, a slide, or the position of a free joint.
        rotation: orientation and angular velocity of a free or ball joint.
        friction: dry friction of each degree of freedom, where the joint has any.
    """

    joint: Joint
    positions: tuple[str, ...]
    rotation: Rotation | None
    friction: tuple[str, ...] = ()

    @property
    def pose(self) -> list[str]:
        """The position variables of the joint, in the order of ``qpos``."""
        return [*self.positions, *(() if self.rotation is None else self.rotation.quaternion)]

    @property
    def rates(self) -> list[VariableRef]:
        """The velocities, in the order of ``qvel``."""
        turning = () if self.rotation is None else self.rotation.velocity
        return [*(VariableRef(name, 1) for name in self.positions), *(VariableRef(name) for name in turning)]

    @property
    def freedoms(self) -> list[str]:
        """The name of each degree of freedom, in the order of ``qvel``."""
        return [*self.positions, *(() if self.rotation is None else self.rotation.velocity)]

    @property
    def names(self) -> list[str]:
        """All variables, in the order of ``qpos`` and then angular velocities."""
        return [*self.pose, *(() if self.rotation is None else self.rotation.velocity)]


def coordinates_of(joint: Joint) -> Coordinates:
    """The names of the variables of a joint."""
    places = {"hinge": ("",), "slide": ("",), "free": ("x", "y", "z"), "ball": ()}[joint.kind]
    turning = VELOCITY if joint.kind in ("free", "ball") else ()

    def path(*parts: str) -> str:
        return path_of("joint", joint.name, *filter(None, parts))

    positions = tuple([path(part) for part in places])
    friction = tuple([path("friction", part) for part in (*places, *turning)]) if joint.frictionloss else ()
    if not turning:
        return Coordinates(joint, positions, None, friction)
    w, x, y, z = [path(part) for part in QUATERNION]
    p, q, r = [path(part) for part in VELOCITY]
    return Coordinates(joint, positions, Rotation((w, x, y, z), (p, q, r)), friction)


def controls_of(actuator: Actuator) -> list[str]:
    """The variables of an actuator's controls; several controls have suffixes."""
    if len(actuator.controls) == 1:
        return [path_of("actuator", actuator.name)]
    inputs = actuator.inputs or [f"control{k + 1}" for k in range(len(actuator.controls))]
    return [path_of("actuator", actuator.name, each) for each in inputs]


def activations_of(actuator: Actuator) -> list[str]:
    """The variables of an actuator's states."""
    names = ["activation"] if len(actuator.activations) == 1 else []
    names = names or [f"activation{k + 1}" for k in range(len(actuator.activations))]
    return [path_of("actuator", actuator.name, each) for each in names]


class _InPlace(Numbers):
    """Derived numbers expanded in expressions; the kernels evaluate parts without unknowns once."""

    def derive(self, e: Expr, *name: str) -> Expr:
        return e


class ModelScope:
    """A model in the name space of a spec.

    Attributes:
        statement: the statement that names it.
        path: the file.
        files: it and all that it names, as they were when it was read.
        contact_forces: the names of the forces of the spec's contacts, each with its declaration.
        relaxed: the constant that relaxes contacts under ``free:``, with its value.
        mechanism: its numbers.
        coordinates: the variables of each joint, in the model's order.
        controls, activations: the variables of actuators, in the model's order.
        tendon_friction: the variable of dry friction of each tendon that has any.
        dynamics: its mechanics as expressions of the spec's variables.
        constants: numbers that the spec can set from outside, by path: inputs of the compiled program, and those that
            have been changed in the model (``changes``).
    """

    def __init__(
        self,
        statement: syntax.ModelFile,
        path: Path,
        mechanism: Mechanism,
        contact_forces: Iterable[tuple[str, syntax.Node]] = (),
        relaxed: Mapping[str, float] | None = None,
        changes: Mapping[SettingPath, float] | None = None,
        files: Sequence[RecordedFile] = (),
    ) -> None:
        self.statement = statement
        self.files = files
        self.relaxed = relaxed or {}
        self.contact_forces = list(contact_forces)
        self.path = path
        self.mechanism = mechanism
        self.coordinates = [coordinates_of(joint) for joint in mechanism.joints]
        self.controls = [name for actuator in mechanism.actuators for name in controls_of(actuator)]
        self.activations = [name for actuator in mechanism.actuators for name in activations_of(actuator)]
        self.tendon_friction = {
            index: path_of("tendon", tendon.name, "friction")
            for index, tendon in enumerate(mechanism.tendons)
            if tendon.frictionloss
        }
        fixed = changes or {}
        inputs = {path: value for path, value in settable(mechanism).items() if value and _is_input(path)}
        numbers = _InPlace(inputs.__contains__, lambda path: sym(ConstantRef(_text(path))))
        self.dynamics = Dynamics(
            mechanism, self._motion(), _symbols(self.controls), _symbols(self.activations), numbers
        )
        self.constants = {_text(path): value for path, value in {**inputs, **fixed}.items()}
        #: Those that shape the equations: another value of one of these means deriving anew.
        self.structural = {_text(path) for path in fixed}

    def number_named(self, path: Iterable[str]) -> str | None:
        """The path of a number in the equations; None for other fields of the model."""
        text = _text(path)
        shaping = {
            _text(each) for each in settable(self.mechanism) if each[0] != "geom" or each[2] != "friction"
        }
        return text if text in self.constants or text in shaping else None

    @property
    def weight(self) -> float:
        """The weight of the whole model in N, from the model's own numbers."""
        pull = sum(part * part for part in self.mechanism.options.gravity) ** 0.5
        return pull * sum(body.mass for body in self.mechanism.bodies)

    @property
    def rotations(self) -> list[Rotation]:
        """All orientations among the coordinates."""
        return [found.rotation for found in self.coordinates if found.rotation is not None]

    def _motion(self) -> Motion:
        """The motion in terms of the spec's variables: (nq,), (nv,), (nv,)."""
        q: list[Expr] = []
        v: list[Expr] = []
        a: list[Expr] = []
        for found in self.coordinates:
            q += _symbols(found.positions)
            v += [sym(VariableRef(name, 1)) for name in found.positions]
            a += [sym(VariableRef(name, 2)) for name in found.positions]
            if found.rotation is not None:
                q += _symbols(found.rotation.quaternion)
                v += _symbols(found.rotation.velocity)
                a += [sym(VariableRef(name, 1)) for name in found.rotation.velocity]
        return Motion(q, v, a)

    def declare(self, table: NameTable) -> None:
        """Add the model's variables and constants to a table; names that the spec declares take precedence."""
        start, end = self.statement.start, self.statement.end
        named = [(name, "variable") for found in self.coordinates for name in found.names]
        named += [(name, "variable") for found in self.coordinates for name in found.friction]
        named += [(name, "variable") for name in (*self.controls, *self.activations)]
        named += [(name, "variable") for name in self.tendon_friction.values()]
        for equality in self.mechanism.equalities:
            if equality.active:
                parts = held(self.dynamics, equality).names
                named += [(path_of("equality", equality.name, part), "variable") for part in parts]
        for name, kind in named:
            table.entries.setdefault(name, Entry(name, kind, start, end, None, True))
        for name, node in self.contact_forces:
            table.entries.setdefault(name, Entry(name, "variable", node.start, node.end, None, True))
        for name, value in {**self.constants, **self.relaxed}.items():
            literal = syntax.Number(start, end, value)
            entry = table.entries.setdefault(name, Entry(name, "constant", start, end, literal, True))
            # The equations use it, be it by a number that is derived from it.
            entry.used = True

    def starred(self, star: str) -> list[str]:
        """The elements that ``joint.*`` (hinges and slides) or ``actuator.*`` stands for."""
        if star == "joint.*":
            return [found.positions[0] for found in self.coordinates if found.rotation is None]
        return self.controls if star == "actuator.*" else []


def model_of(
    tree: syntax.SpecTree, overrides: Mapping[str, float], diagnostics: Diagnostics
) -> ModelScope | None:
    """The model that a spec names, read once; None without a model, or after a mistake, which is added.

    Args:
        overrides: values given by the caller.  Values for numbers that are not inputs of the compiled program, mainly
            zeros, are set in the model itself.
    """
    if None not in tree.models:
        tree.models[None] = _read(tree, diagnostics)
    plain = tree.models[None]
    if not isinstance(plain, ModelScope):
        return None
    known = {_text(path): path for path in settable(plain.mechanism)}
    given = {
        name: value for name, value in overrides.items() if name in known and name not in plain.constants
    }
    if not given:
        return plain
    key = frozenset(given.items())
    if key not in tree.models:
        changes = {known[name]: float(value) for name, value in given.items()}
        mechanism = changed(plain.mechanism, changes)
        tree.models[key] = ModelScope(
            plain.statement, plain.path, mechanism, plain.contact_forces, plain.relaxed, changes, plain.files
        )
    found = tree.models[key]
    return found if isinstance(found, ModelScope) else None


def _read(tree: syntax.SpecTree, diagnostics: Diagnostics) -> ModelScope | None:
    statements = [
        s for block in tree.blocks("model") for s in block.statements if isinstance(s, syntax.ModelFile)
    ]
    if not statements:
        return None
    first = statements[0]
    for other in statements[1:]:
        line = tree.source.position(first.start)[0]
        diagnostics.error(f'the model is "{first.path}" already, on line {line}', other.start, other.end)
    path = _find(first, tree, diagnostics)
    if path is None:
        return None
    added = _known_words(first.additions, ADDITIONS, "added to a model", diagnostics)
    left = _known_words(first.without, KINDS, "left out of a model", diagnostics)
    files = record(path)
    try:
        mechanism = read_model(path, additions=added)
    except StcError as error:
        diagnostics.error(str(error), first.start, first.end)
        return None
    if mechanism.changes:
        told = "; ".join(mechanism.changes[:_TOLD])
        more = len(mechanism.changes) - _TOLD
        told += f"; and {more} more, which `stc show {path.name}` lists" if more > 0 else ""
        diagnostics.warning(
            f"of {path.name} something is left out or changed: {told}", first.start, first.end
        )
    for doubt in mechanism.warnings:
        diagnostics.warning(f"{path.name}: {doubt}", first.start, first.end)
    mechanism = without(mechanism, left)
    stated = refusals(mechanism)
    for refusal in stated:
        hint = f'leave it out knowingly with `model: "{first.path}" without {refusal.kind};`; the verdict will say so'
        diagnostics.error(f"this model cannot be stated exactly: {refusal}", first.start, first.end, hint)
    if stated:
        return None
    return ModelScope(first, path, mechanism, list(declared_names(tree)), _relaxed(tree), files=files)


def _known_words(
    words: Iterable[syntax.Name], known: Mapping[str, object], what: str, diagnostics: Diagnostics
) -> list[str]:
    """The words that are known; each other one is reported as a mistake."""
    for word in words:
        if word.name not in known:
            hint = did_you_mean(word.name, known) or f"what can be {what} is {', '.join(known)}"
            diagnostics.error(f"`{word.name}` cannot be {what}", word.start, word.end, hint)
    return [word.name for word in words if word.name in known]


#: What the forces of each kind of contact are called.
FORCES = {
    "point": ("fx", "fy", "fz"),
    "pin": ("fx", "fy", "fz"),
    "foot": ("fx", "fy", "fz", "mx", "my", "mz"),
}


#: Of so many things that are left out or changed each is told.
_TOLD = 3

#: What ends the names of the variables for how fast free contacts slide.
SLIP = "slip"

#: The constant that tells how far free contacts may be from touching and sliding by their laws.
RELAXATION = "contact.relaxation"

#: Its value in a solution: the weight of everything at so many m above the surface.
RELAXED = 1e-5


def declared_names(tree: syntax.SpecTree) -> Iterator[tuple[str, syntax.Node]]:
    """The names of all variables of contacts, each with its declaration."""
    for block in tree.blocks("contact"):
        for statement in block.statements:
            if isinstance(statement, syntax.ContactDeclaration):
                for part in FORCES.get(statement.kind.name, ()):
                    yield f"{statement.name.name}_{part}", statement
                if any(option.name == "slides" for option, _ in statement.options):
                    yield f"{statement.name.name}_{SLIP}", statement


def _relaxed(tree: syntax.SpecTree) -> dict[str, float]:
    """The constant of free contacts with its value; None if no contact is free."""
    free = any(block.free and block.statements for block in tree.blocks("contact"))
    return {RELAXATION: RELAXED} if free else {}


def _find(statement: syntax.ModelFile, tree: syntax.SpecTree, diagnostics: Diagnostics) -> Path | None:
    """The file of a model: an absolute path, one beside the spec, or a bundled model."""
    known_file, name = tree.source.model_file, Path(statement.path).name
    if known_file is not None and Path(known_file).name in (
        name,
        f"{name}.xml",
    ):  # not the replay's, if that is another
        return Path(known_file)
    folder = Path(tree.source.path).parent if tree.source.path else Path()
    beside = folder / statement.path
    if beside.is_file():
        return beside
    bundled = models.locate(statement.path)
    if bundled is not None:
        return bundled
    known = [file.name for file in sorted(folder.glob("*.xml"))] + list(models.names())
    hint = (
        did_you_mean(statement.path, known) or "it is looked for beside the spec and among the bundled ones"
    )
    diagnostics.error(f"there is no model `{statement.path}`", statement.start, statement.end, hint)
    return None


def _symbols(names: Iterable[str]) -> list[Expr]:
    return [sym(VariableRef(name)) for name in names]


#: Fields whose numbers stay inputs of the compiled program where they are not zero.
_INPUTS = (
    "mass",
    "inertia",
    "damping",
    "armature",
    "stiffness",
    "gear",
    "gravity",
    "density",
    "viscosity",
)


def _is_input(path: SettingPath) -> bool:
    return (path[1] if path[0] == "option" else path[2]) in _INPUTS


def _text(path: Iterable[str]) -> str:
    kind, name, *more = path
    return ".".join([kind, quoted(name), *more])


__all__ = [
    "Coordinates",
    "ModelScope",
    "PathError",
    "coordinates_of",
    "model_of",
    "parts_of",
    "path_of",
    "quoted",
]
