"""The spec that is proposed: what is stated of a motion, found in its recording, and the text that says it."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from stc import models
from stc.explaining.recording import Recording
from stc.explaining.stances import Contact, contacts, put_on_floor
from stc.explaining.terms import LANDING, Term, terms_of
from stc.language.model.scope import coordinates_of, quoted
from stc.mechanism.mechanism import Mechanism
from stc.problem import VariableRef
from stc.records import dataclass, field
from stc.stance import Stance

__all__ = ["FOLLOW", "TABLE", "Draft", "draft"]

FloatArray = NDArray[np.float64]

#: Seconds of a frame, and the fewest and most frames, in tens.
STEP, FEWEST, MOST = 0.01, 4, 16
#: Poses that differ by no more than this, in m or rad, or so many times the noise, are the same.
SAME, NOISE = 0.02, 4.0
#: A speed below this share of the largest one of its kind is none.
STILL = 0.1
#: The share of the model's friction that a page states: MuJoCo's contacts creep where all of it is used.
_GRIP = 0.9
#: What the table of the recorded motion is called in a spec, and the constant that weighs the distance from it.
TABLE, FOLLOW = "recorded", "w_follow"


@dataclass(slots=True)
class Draft:
    """The statements of a spec for a recorded motion.

    Attributes
    ----------
    recording
        The motion.
    name, model
        Of the spec, and its model file as the spec writes it.
    n
        The last frame.
    touching
        What stands, and when.
    terms
        Terms of the objective that the model has.
    constants
        Lines of constants that one may want to change, each with what it is.
    poses, start, end
        Statements of the ``poses:`` section and about the first and the last frame, each with a comment.
    """

    recording: Recording
    name: str
    model: str
    n: int
    touching: list[Contact]
    terms: list[Term]
    constants: list[tuple[str, str]] = field(default_factory=list)
    poses: list[tuple[str, str]] = field(default_factory=list)
    start: list[tuple[str, str]] = field(default_factory=list)
    end: list[tuple[str, str]] = field(default_factory=list)

    def text(
        self,
        weights: Mapping[str, str],
        *,
        head: Sequence[str] = (),
        comments: Mapping[str, str] | None = None,
        constants: Sequence[tuple[str, str]] = (),
        table: str = "",
        follow: str = "",
        scale: int = 1,
    ) -> str:
        """The spec.

        Parameters
        ----------
        weights
            Of the terms, by name, as they are to be written; other terms are left out.
        head
            Lines of comment above it.
        comments
            Behind the terms, by name.
        constants
            Further ones.
        table
            The file of the recorded motion, to start from; none where nothing is said.
        follow
            The weight of the distance from the recorded motion; none where nothing is said.
        scale
            So many times the frames.
        """
        comments = comments or {}
        duration = f"{self.recording.duration:.9g}"
        lines = [*(f"# {line}".rstrip() for line in head), "", "constants:"]
        stated = [
            (f"n = {self.n * scale}", "frames are 0, 1, ..., n"),
            (f"T = {duration}, h = T/n", "s in all, and from one frame to the next"),
            *self.constants,
            *constants,
        ]
        for k, (entry, words) in enumerate(stated):
            lines.append(_commented(f"  {entry}{';' if k == len(stated) - 1 else ','}", words))
        lines += ["", f'model: "{self.model}";']
        if self.touching:
            lines += ["", "contact:"]
            landing = f", landing = {weights[LANDING]}" if LANDING in weights else ""
            for contact in self.touching:
                words = comments.get(LANDING, "") if landing else ""
                grip = f", friction = {_GRIP * contact.spot.friction:.3g}"
                lines.append(_commented(f"  {contact.name} = {contact.spot.written}{grip}{landing};", words))
            step = self.recording.duration / self.n
            for contact in self.touching:
                for first, last in contact.ranges:
                    frames = f"[{self._frame(first)}, {self._frame(last)}]"
                    words = f"it stands from {first * step:.3g} to {last * step:.3g} s"
                    lines.append(_commented(f"  {frames}: {contact.name};", words))
        if self.poses:
            lines += ["", "poses:", *(_commented(f"  {line}", words) for line, words in self.poses)]
        lines += ["", "constraints:"]
        for frame, statements in (("[0]", self.start), ("[n]", self.end)):
            for line, words in statements:
                lines.append(_commented(f"  {frame}: {line}", words))
        if table:
            lines += ["", _commented(f'data: {TABLE} = "{table}";', "the recorded motion,")]
            lines += [_commented(f"guess: {TABLE};", "from which the solve starts")]
        lines += ["", "objective:", "  [0, n]:"]
        for term in self.terms:
            if term.name in weights and term.integrand:
                body = (
                    term.integrand if weights[term.name] == "1" else f"{weights[term.name]}*{_factor(term)}"
                )
                lines.append(_commented(f"    integral({body});", comments.get(term.name, term.words)))
        if follow:
            names = self.recording.names
            distance = " + ".join(f"({name} - {TABLE}.{name})^2" for name in names)
            lines.append(
                _commented(f"    integral({follow}*({distance}));", "distance from the recorded motion")
            )
        return "\n".join(lines) + "\n"

    def _frame(self, frame: int) -> str:
        """A frame as a share of all, which it stays on as many more of them."""
        if frame in (0, self.n):
            return "0" if frame == 0 else "n"
        divisor = math.gcd(frame, self.n)
        first = "n" if frame == divisor else f"{frame // divisor}*n"
        return f"{first}/{self.n // divisor}"


def draft(recording: Recording, name: str, model: Path, folder: Path) -> Draft:
    """The statements about a recorded motion that do not depend on the weights.

    Parameters
    ----------
    recording
        The motion.
    name
        Of the spec.
    model
        The model's file.
    folder
        Where the spec will be: its model is written from there.
    """
    n = 10 * int(np.clip(round(recording.duration / STEP / 10.0), FEWEST, MOST))
    touching = contacts(recording, n)
    lands = any(first > 0 for contact in touching for first, _ in contact.ranges)
    bundled = models.locate(model.name)
    own = bundled is None or not model.exists() or not bundled.samefile(model)
    written = os.path.relpath(model, folder) if own else model.name
    made = Draft(recording, name, Path(written).as_posix(), n, touching, terms_of(recording, lands))
    _Ends(made).find()
    return made


class _Ends:
    """Finds out what is fixed at both ends of a motion."""

    def __init__(self, made: Draft) -> None:
        self.made, self.recording = made, made.recording
        self.mechanism: Mechanism = self.recording.mechanism
        ends = np.array([0.0, self.recording.duration])
        self.places = self.recording.at(ends)
        self.speeds = self.recording.velocities(ends)
        inner = self.recording.velocities(np.linspace(0.0, self.recording.duration, 201))
        straight = self._straight()
        most = np.array([np.abs(inner[:, straight == kind]).max(initial=0.0) for kind in straight])
        unsure = NOISE * self.recording.unsure_speeds()
        self.still = np.abs(self.speeds) <= np.maximum(STILL * np.maximum(most, 1e-9), unsure)
        self.digits = int(np.clip(math.ceil(-math.log10(max(1e-9, float(self.recording.noise.max())))), 2, 6))
        self.travel = _travel(self.mechanism)

    def _straight(self) -> NDArray[np.bool_]:
        """(nv,) whether a velocity is in m/s; the others are in rad/s."""
        found = []
        for joint in self.mechanism.joints:
            found += {
                "slide": [True],
                "hinge": [False],
                "ball": 3 * [False],
                "free": 3 * [True] + 3 * [False],
            }[joint.kind]
        return np.array(found)

    def find(self) -> None:
        made = self.made
        rests = self.still.all(axis=1)
        first, last = self._posed(0), self._posed(-1)
        moved = self._displacement(first, last)
        same = self._same(first, last)
        base, shift = self._keyframe(first)
        if base:
            begin = f"{base}{self._shift(shift)}"
        else:
            begin = "begin"
            made.poses.append((f"{begin} = keyframe.reference{self._changes(self._reference(), first)};", ""))
        most = np.abs(self.speeds).max(axis=0)
        if (
            not rests.any()
            and same
            and np.all(np.abs(np.diff(self.speeds, axis=0)[0]) <= 0.15 * np.maximum(most, 1e-9))
        ):
            made.end.append((f"periodic{self._constant_shift(moved)};", "the last frame is as the first one"))
            for axis, (place, _) in self.travel.items():
                if axis < 2:
                    made.start.append(
                        (f"{self.recording.names[place]} = {self._number(first[place])};", "where it begins")
                    )
            return
        made.start.append(
            (
                f"{begin};{' rest;' if rests[0] else ''}",
                "the pose in which it begins" + ", at rest" * bool(rests[0]),
            )
        )
        if not rests[0]:
            made.start += self._rates(0)
        if same:
            end, words = f"{self._added(begin, shift, moved)}", "the same pose at the end"
        else:
            base, _ = self._keyframe(last)
            if not base:
                base = "finish"
                rests_on = begin if begin == "begin" else "keyframe.reference"
                origin = first if begin == "begin" else self._reference()
                made.poses.append(
                    (f"{base} = {rests_on}{self._changes(origin, self._less(last, moved))};", "")
                )
                end = f"{base}{self._constant_shift(moved)}"
            else:
                end = f"{base}{self._constant_shift(self._displacement(self._of_keyframe(base), last))}"
            words = "the pose in which it ends"
        made.end.append((f"{end};{' rest;' if rests[-1] else ''}", words + ", at rest" * bool(rests[-1])))
        if not rests[-1]:
            made.end += self._rates(-1)

    def _posed(self, end: int) -> FloatArray:
        """The pose at an end, what stands there on the floor, (nq,)."""
        frame = 0 if end == 0 else self.made.n
        standing = [c for c in self.made.touching if any(a <= frame <= b for a, b in c.ranges)]
        found = self.places[end]
        return put_on_floor(Stance(self.mechanism, found), found, standing) if standing else found

    def _reference(self) -> FloatArray:
        return np.array(self.mechanism.start, dtype=float)

    def _of_keyframe(self, path: str) -> FloatArray:
        poses = {f"keyframe.{quoted(k.name)}": k.qpos for k in self.mechanism.keyframes}
        return np.array(poses.get(path, self.mechanism.start), dtype=float)

    def _keyframe(self, q: FloatArray) -> tuple[str, FloatArray]:
        """The keyframe that a pose is, but for its place on the floor, and by how much that differs; else nothing."""
        names = [f"keyframe.{quoted(k.name)}" for k in self.mechanism.keyframes if k.name]
        for path in [*names, "keyframe.reference"]:
            other = self._of_keyframe(path)
            if self._same(other, q):
                return path, self._displacement(other, q)
        return "", np.zeros(3)

    def _same(self, one: FloatArray, other: FloatArray) -> bool:
        """Whether two poses are the same but for a displacement along the floor."""
        gap = np.abs(self._less(other, self._displacement(one, other)) - one)
        return bool(np.all(gap <= SAME + NOISE * self.recording.noise))

    def _displacement(self, one: FloatArray, other: FloatArray) -> FloatArray:
        """(3,) how far the root is from one pose to another along the floor; 0 where it cannot move that way."""
        found = np.zeros(3)
        for axis, (place, sign) in self.travel.items():
            if axis < 2:
                by = sign * (other[place] - one[place])
                found[axis] = by if abs(by) > SAME / 4 + NOISE * self.recording.noise[place] else 0.0
        return found

    def _less(self, q: FloatArray, moved: FloatArray) -> FloatArray:
        found = q.copy()
        for axis, (place, sign) in self.travel.items():
            found[place] -= sign * moved[axis]
        return found

    def _shift(self, moved: FloatArray) -> str:
        return f" + ({', '.join(self._number(v) for v in moved)})" if moved.any() else ""

    def _constant_shift(self, moved: FloatArray) -> str:
        """A displacement by constants with names, which can be changed."""
        if not moved.any():
            return ""
        parts = []
        for value, name, way in zip(moved, ("D", "Dy", "Dz"), ("x", "y", "z"), strict=True):
            if value:
                self.made.constants.append(
                    (f"{name} = {self._number(value)}", f"m, how far it goes along {way}")
                )
            parts.append(name if value else "0")
        return f" + ({', '.join(parts)})"

    def _added(self, begin: str, shift: FloatArray, moved: FloatArray) -> str:
        """The first pose, moved by the displacement of the motion."""
        if not shift.any() or begin == "begin":
            return f"{begin}{self._constant_shift(moved)}"
        base = begin.partition(" + ")[0]
        self.made.constants.append((f"D = {self._number(moved[0])}", "m, how far it goes along x"))
        y = self._number(shift[1] + moved[1])
        return f"{base} + ({self._number(shift[0])} + D, {y}, 0)"

    def _changes(self, origin: FloatArray, q: FloatArray) -> str:
        """The coordinates that a pose has elsewhere than another one."""
        parts = []
        for joint in self.mechanism.joints:
            for k, name in enumerate(coordinates_of(joint).pose):
                value = float(q[joint.qpos + k])
                if (
                    abs(value - origin[joint.qpos + k])
                    > SAME / 20 + NOISE * self.recording.noise[joint.qpos + k]
                ):
                    turns = joint.kind == "hinge"
                    parts.append(f", {name} = {self._angle(value) if turns else self._number(value)}")
        return "".join(parts)

    def _angle(self, value: float) -> str:
        """A number, or the quarter turns that it is."""
        quarters = round(value / (0.5 * math.pi))
        if quarters and abs(value - quarters * 0.5 * math.pi) < max(
            2e-3, NOISE * float(self.recording.noise.max())
        ):
            factor = {2: "pi", -2: "-pi", 1: "pi/2", -1: "-pi/2"}.get(quarters)
            return factor or (f"{quarters // 2}*pi" if quarters % 2 == 0 else f"{quarters}*pi/2")
        return self._number(value)

    def _number(self, value: float) -> str:
        rounded = round(float(value), self.digits)
        return f"{rounded:.9g}" if rounded else "0"

    def _rates(self, end: int) -> list[tuple[str, str]]:
        """The velocities at an end that is not at rest."""
        rates: list[VariableRef] = [rate for one in self.recording.coordinates for rate in one.rates]
        found = []
        for rate, speed, still in zip(rates, self.speeds[end], self.still[end], strict=True):
            name = rate.name + "'" * rate.order
            found.append((f"{name} = {self._number(0.0 if still else speed)};", "its speed there"))
        return found


def _travel(mechanism: Mechanism) -> dict[int, tuple[int, float]]:
    """For each axis along which the root moves, the index of its coordinate in ``qpos`` and its direction."""
    found: dict[int, tuple[int, float]] = {}
    for joint in mechanism.joints:
        body = mechanism.bodies[joint.body]
        if body.parent:
            continue
        if joint.kind == "free":
            found.update({axis: (joint.qpos + axis, 1.0) for axis in range(3)})
        elif joint.kind == "slide" and abs(abs(body.quat[0]) - 1.0) < 1e-12:
            for axis in range(3):
                if abs(abs(joint.axis[axis]) - 1.0) < 1e-9:
                    found.setdefault(axis, (joint.qpos, joint.axis[axis]))
    return found


def _factor(term: Term) -> str:
    """A term's integrand as a factor of a product: in parentheses if it is a sum."""
    sums = " + " in term.integrand or " - " in term.integrand
    return f"({term.integrand})" if sums else term.integrand


def _commented(line: str, words: str) -> str:
    """A line with what it says behind it."""
    return f"{line:<60}  # {words}" if words else line
