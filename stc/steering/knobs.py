"""The numbers of a spec that can be steered, and the texts with other numbers in their places.

Three kinds of numbers are found: constants that the spec declares as plain numbers; numbers that stand in statements
at a single frame (``[n/2]: x = 1.1;``, ``keyframe.stand + (0.5, 0, 0);``), at places of contacts (``foot at 0.4;``) or
in the spec's own poses; and the coordinates of keyframes of the model that are stated at a frame.

The *working text* is the spec with a constant in the place of each of these, so that another value of any of them is
solved for without deriving anything again.  :meth:`Knobs.written` is the spec as it was written, comments and layout
included, with other numbers at the places of the old ones.  There a keyframe of the model that has been changed becomes
a pose of the spec.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace

from stc.errors import Source, Span, SpecError, UsageError
from stc.language import syntax
from stc.language.constants import Constants
from stc.language.diagnostics import Diagnostics
from stc.language.model.scope import ModelScope, model_of, parts_of
from stc.language.names import collect_names
from stc.language.parser import parse
from stc.records import dataclass, field
from stc.steering.edits import Edit, edited, number, replaced

#: Lines of a pose that is written are no longer than this.
_WIDTH = 100

_WORD = re.compile(r"[A-Za-z_]\w*")


@dataclass(frozen=True, slots=True)
class Knob:
    """A number that can be steered.

    Attributes:
        name: of the constant that it is in the working text.
        label: what it is called on the screen.
        value: as the spec has it.
        note: the comment on its line.
        start, end: the characters of the number in the spec; equal where the spec does not write it yet.
        declared: whether the spec declares it as a constant.
    """

    name: str
    label: str
    value: float
    note: str = ""
    start: int = -1
    end: int = -1
    declared: bool = False


@dataclass(slots=True)
class PoseSite:
    """A pose that the spec states at a frame, with the knobs of its coordinates.

    Attributes:
        frame: the frame.
        label: its range header, as it is written.
        coordinates: the knob's name of each coordinate that can be steered, by path.
        shift: of each of the axes x, y, z the knob's name of what the pose is moved by, or None.
        turned: whether the pose is turned as a whole, so that its root is not where its coordinates say.
        base: the model's pose that it is made of, as it is written.
        start, end: of that name in the spec.
        name: what the pose is called once it is one of the spec's.
        insert: where the spec's own pose takes further coordinates; -1 for a keyframe of the model.
    """

    frame: int
    label: str
    coordinates: dict[str, str]
    shift: tuple[str | None, str | None, str | None]
    turned: bool
    base: str
    start: int
    end: int
    name: str
    insert: int = -1


@dataclass(slots=True)
class Knobs:
    """The constants, poses and targets of a spec that can be steered.

    Attributes:
        source: the spec.
        tree: its syntax.
        knobs: by name.
        poses: those stated at single frames.
        refused: why a constant cannot be steered, by its name.
        working: the spec with a constant for every knob.
        scope: the model; None where the spec names none.
    """

    source: Source
    tree: syntax.SpecTree
    knobs: dict[str, Knob] = field(default_factory=dict)
    poses: list[PoseSite] = field(default_factory=list)
    refused: dict[str, str] = field(default_factory=dict)
    working: str = ""
    scope: ModelScope | None = None

    def written(self, values: Mapping[str, float]) -> str:
        """The spec's text with other values of knobs.

        Args:
            values: by name of the knob; those that are not named stay.

        Raises:
            UsageError: a name is that of no knob, or of a constant that is no plain number.
        """
        changed = {name: value for name, value in values.items() if self._knob(name).value != value}
        text = self.source.written
        places = {
            (knob.start, knob.end): number(changed[name])
            for name, knob in self.knobs.items()
            if name in changed
        }
        edits = [
            edit
            for place, digits in places.items()
            if place[0] >= 0
            for edit in replaced(text, *place, digits)
        ]
        made: list[str] = []
        appended: set[str] = set()
        for site in self.poses:
            items = self._changes(site, changed)
            if not items:
                continue
            if site.insert >= 0:
                if site.name not in appended:
                    edits.append(Edit(site.insert, site.insert, "".join(f", {item}" for item in items)))
                appended.add(site.name)
                continue
            edits.append(Edit(site.start, site.end, site.name))
            made.append(_pose_line(site.name, [site.base, *items]))
        if made:
            edits.append(self._new_poses(made))
        return edited(text, edits)

    def _knob(self, name: str) -> Knob:
        knob = self.knobs.get(name)
        if knob is None:
            reason = self.refused.get(name, f"the spec has no number called `{name}` to steer")
            raise UsageError(reason)
        return knob

    def _changes(self, site: PoseSite, changed: Mapping[str, float]) -> list[str]:
        """The coordinates of a pose that the spec has to tell and does not yet, as ``path = number``."""
        names = {path: name for path, name in site.coordinates.items() if self.knobs[name].start < 0}
        moved = [path for path, name in names.items() if name in changed]
        # A quaternion has one meaning as a whole.
        turned = {path.rpartition(".")[0] for path in moved if _is_quaternion(path)}
        told = [
            path
            for path in names
            if path in moved or (_is_quaternion(path) and path.rpartition(".")[0] in turned)
        ]
        return [
            f"{path} = {number(changed.get(names[path], self.knobs[names[path]].value))}" for path in told
        ]

    def _new_poses(self, lines: list[str]) -> Edit:
        """Poses of the spec: after those that it has, or in a section of their own above the constraints."""
        text = self.source.written
        for section in reversed(self.tree.sections):
            last = [s for block in section.blocks for s in block.statements]
            if section.kind == "poses" and last:
                end = self.source.place(last[-1].start, last[-1].end)[1]
                at = text.find(";", end) + 1
                return Edit(at, at, "".join(f"\n  {line}" for line in lines))
        section = next(section for section in self.tree.sections if section.kind == "constraints")
        at = text.rfind("\n", 0, self.source.place(section.start, section.end)[0]) + 1
        while at and text[:at].rstrip(" \t").endswith("\n") and _is_comment(text, at):
            at = text.rfind("\n", 0, at - 1) + 1
        return Edit(at, at, "poses:\n" + "".join(f"  {line}\n" for line in lines) + "\n")


def _is_comment(text: str, at: int) -> bool:
    """Whether the line before the one that begins at a character is a comment alone."""
    return text[text.rfind("\n", 0, at - 1) + 1 : at].lstrip().startswith("#")


def _is_quaternion(path: str) -> bool:
    return path.rpartition(".")[2] in ("qw", "qx", "qy", "qz")


def _pose_line(name: str, items: list[str]) -> str:
    """``name = base, joint.a = 1, ...;`` on as many lines as it needs."""
    line, lines = f"{name} = {items[0]}", []
    for item in items[1:]:
        if len(line) + len(item) + 3 > _WIDTH:
            lines.append(f"{line},")
            line = f"    {item}"
        else:
            line = f"{line}, {item}"
    return "\n  ".join([*lines, f"{line};"])


def find_knobs(source: Source, overrides: Mapping[str, float] | None = None) -> Knobs:
    """The numbers of a spec that can be steered.

    Args:
        source: the spec.
        overrides: values of constants given from outside, which its frames may depend on.

    Raises:
        SpecError: mistakes in the syntax, or constants without a value.
        UsageError: an override that the spec does not have.
    """
    return _Finder(source, dict(overrides or {})).found


class _Finder:
    """Goes through the syntax of a spec and collects its knobs and the edits of the working text."""

    def __init__(self, source: Source, overrides: Mapping[str, float]) -> None:
        tree = parse(source)
        self.source = source
        self.found = Knobs(source, tree)
        self.diagnostics = Diagnostics(tree.source)
        self.table = collect_names(tree, self.diagnostics, overrides)
        self.constants = Constants(self.table, overrides, self.diagnostics, tree.damaged)
        if self.diagnostics.error_count:
            raise SpecError(self.diagnostics.errors())
        self.found.scope = model_of(tree, overrides, self.diagnostics)
        self.text = tree.source.written
        self.expanded = tree.source
        self.words = set(_WORD.findall(self.text))
        self.edits: list[Edit] = []
        self.declared: list[str] = []
        self.appended: list[str] = []
        self._of_constants()
        self._of_poses()
        self._of_statements()
        self.found.working = self._working()

    # ------------------------------------------------------------------- the parts of a spec

    def _of_constants(self) -> None:
        for block in self.found.tree.blocks("constants"):
            for statement in block.statements:
                if isinstance(statement, syntax.Declaration) and statement.value is not None:
                    self._constant(statement.name.name, statement.value, statement.end)

    def _constant(self, name: str, value: syntax.Expression, end: int) -> None:
        literal = _literal(value)
        place = self._place(value)
        if place is None:
            self.found.refused[name] = f"`{name}` is one of several constants that are written once"
        elif literal is None:
            if syntax.names(value):
                written = self.text[place[0] : place[1]]
                self.found.refused[name] = (
                    f"`{name}` is computed, `{written}`: steer what it is made of, or write a number there"
                )
                return
            # Numbers alone, as in 2*0.25: one number says the same.
            computed = self.constants.value_of(value)
            if computed is not None:
                self.found.knobs[name] = Knob(name, name, computed, self._note(end), *place, True)
        else:
            self.found.knobs[name] = Knob(name, name, literal, self._note(end), *place, True)

    def _of_poses(self) -> None:
        for block in self.found.tree.blocks("poses"):
            for statement in block.statements:
                if isinstance(statement, syntax.PoseDefinition):
                    for change in statement.changes:
                        self._number(change.value, f"{change.name.name} of {statement.name.name}")

    def _of_statements(self) -> None:
        for kind in ("constraints", "contact"):
            for block in self.found.tree.blocks(kind):
                for statement in block.statements:
                    if isinstance(statement, syntax.ContactPlace):
                        for item, axis in zip(statement.at, "xyz"):
                            self._number(item, f"{axis} of {statement.name.name} {self._where(block)}")
                    elif block.header is None or block.header.last is not None:
                        continue
                    elif isinstance(statement, syntax.Relation):
                        self._relation(statement, block)
                    elif isinstance(statement, syntax.Pose) and statement.base.name not in (
                        "rest",
                        "periodic",
                    ):
                        self._pose(statement, block)

    def _relation(self, statement: syntax.Relation, block: syntax.Block) -> None:
        """``x = 1.1``, or a bound: what is stated is the other side."""
        if len(statement.operands) != 2:
            return
        for this, other in (statement.operands, reversed(statement.operands)):
            if _literal(other) is None and syntax.names(other):
                self._number(this, f"{self._written(other)} {self._where(block)}")

    def _pose(self, statement: syntax.Pose, block: syntax.Block) -> None:
        """A pose at a frame: its coordinates, and by how much it is moved."""
        header = block.header
        assert header is not None
        value = self.constants.value_of(header.first)
        place = self._place(statement.base)
        if value is None or place is None or self.found.scope is None:
            return
        label = self._where(block)
        shift = [self._shift(item, f"{axis} {label}") for item, axis in zip(_items(statement.shift), "xyz")]
        site = PoseSite(
            frame=round(value), label=label, coordinates={},
            shift=(shift[0], shift[1], shift[2]), turned=statement.angle is not None,
            base=statement.base.name, start=place[0], end=place[1], name=statement.base.name,
        )  # fmt: skip
        definition = self._definition(statement.base.name)
        if definition is not None:
            self._own_pose(site, definition)
        else:
            self._keyframe(site, header)
        self.found.poses.append(site)

    def _shift(self, item: syntax.Expression | None, label: str) -> str | None:
        """The knob of a component of a displacement: its constant, or its number unless that is 0."""
        if item is None or _literal(item) == 0.0:
            return None
        if isinstance(item, syntax.Name):
            return item.name if item.name in self.found.knobs else None
        return self._number(item, label)

    def _definition(self, name: str) -> syntax.PoseDefinition | None:
        for block in self.found.tree.blocks("poses"):
            for statement in block.statements:
                if isinstance(statement, syntax.PoseDefinition) and statement.name.name == name:
                    return statement
        return None

    def _own_pose(self, site: PoseSite, definition: syntax.PoseDefinition) -> None:
        """A pose of the spec: the coordinates that it lists, and those of the keyframe that it is made of."""
        for change in definition.changes:
            place = self._place(change.value)
            value = change.value
            named = value.name if isinstance(value, syntax.Name) and value.name in self.found.knobs else None
            knob = named or next(
                (k.name for k in self.found.knobs.values() if (k.start, k.end) == place), None
            )
            if knob is not None:
                site.coordinates[change.name.name] = knob
        base = definition.pose
        place = self._place(definition)
        plain = base.shift is None and base.angle is None and not base.grounded
        numbers = self._of_model(base.base.name)
        if not plain or place is None or numbers is None:
            return
        site.insert = place[1]
        listed = {change.name.name for change in definition.changes}
        fresh = not any(other.name == site.name for other in self.found.poses)
        for path, given in numbers.items():
            if path not in listed:
                site.coordinates[path] = self._coordinate(path, given, definition.name.name, fresh)
        if fresh:
            added = "".join(f", {path} = {site.coordinates[path]}" for path in numbers if path not in listed)
            self.edits.append(Edit(site.insert, site.insert, added))

    def _keyframe(self, site: PoseSite, header: syntax.RangeHeader) -> None:
        """Replace a keyframe of the model in the working text by a pose of the spec whose numbers are constants."""
        numbers = self._of_model(site.base)
        if numbers is None:
            return
        word = parts_of(site.base)[-1] if site.base else ""
        where = re.sub(r"\W+", "_", self._written(header.first)).strip("_")
        site.name = self._fresh(f"{word if word.isidentifier() else 'pose'}_{where}")
        for path, value in numbers.items():
            site.coordinates[path] = self._coordinate(path, value, site.label)
        items = [f"{path} = {name}" for path, name in site.coordinates.items()]
        self.appended.append(f"poses: {site.name} = {', '.join([site.base, *items])};")
        self.edits.append(Edit(site.start, site.end, site.name))

    def _of_model(self, name: str) -> dict[str, float] | None:
        """The coordinates of a keyframe of the model, by path."""
        scope = self.found.scope
        if scope is None:
            return None
        kind, *rest = parts_of(name)
        if kind != "keyframe" or len(rest) != 1:
            return None
        frames = {keyframe.name: keyframe.qpos for keyframe in scope.mechanism.keyframes}
        qpos = frames.get(rest[0], scope.mechanism.start if rest[0] == "reference" else None)
        if qpos is None:
            return None
        return {
            path: float(qpos[one.joint.qpos + k])
            for one in scope.coordinates
            for k, path in enumerate(one.pose)
        }

    # ------------------------------------------------------------------- one knob

    def _coordinate(self, path: str, value: float, label: str, fresh: bool = True) -> str:
        """A knob for a coordinate that the spec does not write; the existing one if it is not ``fresh``."""
        title = f"{path} {label}"
        if not fresh:
            return next(knob.name for knob in self.found.knobs.values() if knob.label == title)
        return self._new(Knob("", title, value))

    def _number(self, value: syntax.Expression, label: str) -> str | None:
        """A knob for a number that stands in a statement; None where there is none, or it is repeated."""
        literal, place = _literal(value), self._place(value)
        if literal is None or place is None:
            return None
        name = self._new(Knob("", label, literal, self._note(value.end), *place))
        self.edits.append(Edit(*place, name))
        return name

    def _new(self, knob: Knob) -> str:
        name = self._fresh(f"steered{len(self.declared) + 1}")
        self.found.knobs[name] = replace(knob, name=name)
        self.declared.append(f"{name} = {number(knob.value)}")
        return name

    def _fresh(self, name: str) -> str:
        while name in self.words:
            name += "_"
        self.words.add(name)
        return name

    # ------------------------------------------------------------------- the text

    def _place(self, node: syntax.Node) -> tuple[int, int] | None:
        """The characters of the spec that a node is written with; None where they are repeated for several."""
        if Span(self.expanded, node.start, node.end).repeated:
            return None
        return self.expanded.place(node.start, node.end)

    def _written(self, node: syntax.Node) -> str:
        return " ".join(self.expanded.text[node.start : node.end].split())

    def _where(self, block: syntax.Block) -> str:
        header = block.header
        if header is None:
            return ""
        last = "" if header.last is None else f", {self._written(header.last)}"
        return f"at [{self._written(header.first)}{last}]"

    def _note(self, end: int) -> str:
        """The comment behind a character on its line; none where something else comes first."""
        at = self.expanded.place(max(0, end - 1), end)[1]
        line = self.text[at:].partition("\n")[0]
        before, hash_, comment = line.partition("#")
        return comment.strip() if hash_ and not before.strip(" ,;\t") else ""

    def _working(self) -> str:
        text = edited(self.text, self.edits)
        end = "" if text.endswith("\n") or not self.declared else "\n"
        if self.declared:
            self.appended.insert(0, f"constants: {', '.join(self.declared)};")
        return text + end + "".join(f"{line}\n" for line in self.appended)


def _literal(node: syntax.Expression | None) -> float | None:
    """The value of a plain number, perhaps with a minus; None of everything else."""
    if isinstance(node, syntax.Negate) and isinstance(node.operand, syntax.Number):
        return -node.operand.value
    return node.value if isinstance(node, syntax.Number) else None


def _items(shift: syntax.Vector | None) -> Iterator[syntax.Expression | None]:
    items = [] if shift is None else shift.items
    yield from (items[k] if k < len(items) else None for k in range(3))
