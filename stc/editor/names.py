"""The meaning of the names of a spec and of the paths of its model, and the places where they are declared."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from stc.editor.reading import Reading
from stc.errors import Source
from stc.language import syntax
from stc.language.data import Data
from stc.language.model.paths import PLACE_FIELDS
from stc.language.model.scope import ModelScope, parts_of, quoted
from stc.language.names import KINDS
from stc.mechanism.mechanism import Place
from stc.records import dataclass, field

__all__ = ["Known", "names_of"]

_AXES = ("x", "y", "z")
_FIELDS = {
    **dict.fromkeys(_AXES, "m, place in the world"),
    **{f"v{axis}": "m/s, velocity in the world" for axis in _AXES},
    **{f"w{axis}": "rad/s, angular velocity" for axis in _AXES},
    **dict.fromkeys(("qw", "qx", "qy", "qz"), "component of the unit quaternion"),
    "mass": "kg",
}
#: The kinds of things of a model: where its list is, and what its paths mean.
_THINGS = {
    "body": "bodies", "joint": "joints", "site": "sites", "geom": "geoms", "actuator": "actuators",
    "tendon": "tendons", "equality": "equalities", "keyframe": "keyframes",
}  # fmt: skip


@dataclass(slots=True, eq=False)
class Known:
    """A name or path, and what it stands for.

    Attributes:
        name: as it is written, without blanks.
        kind: ``constant``, ``variable``, ``parameter``, ``definition``, ``data set``, ``table``, ``pose``, ``contact``,
            or ``path`` of a thing of the model.
        about: its unit and meaning: what the comment on the line of its declaration says, or the model.
        value: of a constant, where it has one.
        written: the statements that declare it.
        places: where these are in the text, each from its first character to its end.
        place: where the thing is in the model's file, for what the model brings.
    """

    name: str
    kind: str
    about: str = ""
    value: float | None = None
    written: list[str] = field(default_factory=list)
    places: list[tuple[int, int]] = field(default_factory=list)
    place: Place | None = None


def names_of(reading: Reading) -> dict[str, Known]:
    """All names that a text declares and its model brings; empty where nothing could be read."""
    if reading.tree is None:
        return {}
    found: dict[str, Known] = {}
    for section in reading.tree.sections:
        for block in section.blocks:
            for statement in block.statements:
                _declare(found, reading, reading.tree.source, section.kind, block, statement)
    context = reading.context
    if context is None:
        return found
    source = context.source
    for name, entry in context.table.entries.items():
        if name not in found:
            found[name] = Known(name, entry.kind, places=[source.place(entry.start, entry.end)])
        found[name].value = context.constants.values.get(name)
    for name, data in {} if context.data is None else _columns(context.data):
        found.setdefault(name, Known(name, "path", f"column of `{data}`", places=found[data].places))
    if context.table.model is not None:
        _describe(found, context.table.model)
    return found


def _declare(
    found: dict[str, Known],
    reading: Reading,
    source: Source,
    section: str,
    block: syntax.Block,
    statement: syntax.Statement,
) -> None:
    """Note what a statement declares, if it does."""
    kind = KINDS.get(section, "")
    if isinstance(statement, syntax.PoseDefinition):
        kind = "pose"
    elif isinstance(statement, syntax.ContactDeclaration):
        kind = "contact"
    elif isinstance(statement, syntax.DataFile | syntax.DataKeyframes | syntax.DataRows):
        kind = "data set"
    elif isinstance(statement, syntax.TableDefinition):
        kind = "table"
    elif not kind or not isinstance(statement, syntax.Declaration | syntax.Assignment):
        return
    name = statement.name
    known = found.setdefault(name.name, Known(name.name, kind))
    header = "" if block.header is None else f"{source.text[block.header.start : block.header.end]} "
    text = " ".join((header + source.text[statement.start : statement.end]).split())
    if text not in known.written:
        known.written.append(text)
        known.places.append(source.place(name.start, name.end))
        known.about = known.about or reading.comment_at(source.place(statement.start, statement.end)[1] - 1)


def _columns(data: Data) -> Iterator[tuple[str, str]]:
    """The paths of the columns of all data sets, each with the set."""
    for name, one in data.sets.items():
        for column in one.columns:
            yield f"{name}.{column if '.' in column else quoted(column)}", name


def _describe(found: dict[str, Known], model: ModelScope) -> None:
    """Add the elements of the model, each with its kind and its place in the model's file, to the known names."""
    things: dict[tuple[str, str], tuple[str, Place | None]] = {}
    for kind, attribute in _THINGS.items():
        for thing in getattr(model.mechanism, attribute):
            if thing.name:
                shape = "" if kind == "actuator" else getattr(thing, "kind", "")
                about = f"{kind} `{thing.name}`{f', {shape}' if shape else ''}"
                things[kind, thing.name] = about, getattr(thing, "place", None)
    joints = {joint.name: joint for joint in model.mechanism.joints}
    for path in _paths(model, things):
        known = found.setdefault(path, Known(path, "path"))
        kind, *rest = parts_of(path)
        owner = "body" if kind in ("com", "momentum", "angular") else kind
        about, known.place = things.get((owner, rest[0] if rest else ""), ("", None))
        if known.place is None:  # no thing of its own, or one without a place: the file
            known.place = Place(str(model.path), 1)
        unit = _FIELDS.get(rest[-1], "") if rest else ""
        if kind == "joint" and len(rest) == 1 and rest[0] in joints:
            joint = joints[rest[0]]
            unit = "m" if joint.kind == "slide" else "rad"
            if joint.limited:
                unit += f", from {joint.bounds[0]:.4g} to {joint.bounds[1]:.4g}"
        if kind in ("momentum", "angular", "energy", "com") and not about:
            about = "of the whole model"
        known.about = "; ".join(filter(None, [unit, about]))


def _paths(model: ModelScope, things: dict[tuple[str, str], tuple[str, Place | None]]) -> Iterator[str]:
    """The paths of everything that the model has, its variables and numbers included."""
    yield from (name for found in model.coordinates for name in (*found.names, *found.friction))
    yield from (*model.controls, *model.activations, *model.tendon_friction.values(), *model.constants)
    yield "keyframe.reference"
    for kind, name in things:
        path = f"{kind}.{quoted(name)}"
        if kind == "keyframe":
            yield path
        elif kind == "actuator":
            yield f"{path}.force"
        elif kind in ("body", "site", "geom"):
            for one in PLACE_FIELDS:
                yield from (
                    [f"{path}.{one}.{axis}" for axis in _AXES] if one.endswith("axis") else [f"{path}.{one}"]
                )
    bodies = ["", *(f"{quoted(name)}." for kind, name in things if kind == "body")]
    for body in bodies:
        yield from (f"com.{body}{one}{axis}" for one in ("", "v") for axis in _AXES)
        yield from (f"{whole}.{body}{axis}" for whole in ("momentum", "angular") for axis in _AXES)
    yield from ("energy.kinetic", "energy.potential")


def file_of(reading: Reading, path: str) -> Path | None:
    """The file that a text in quotes names: a model, beside the spec or bundled, or data; None if there is none."""
    from stc import models

    beside = reading.folder / path
    try:
        return beside.resolve() if beside.is_file() else models.locate(path)
    except (OSError, ValueError):  # no name of a file at all
        return None
