"""The spec that `stc new --model robot.xml` writes: the first of several simple specs that solves and passes
validation.

A robot that can stand is asked to stand, a mounted one to hold its pose; a model that can do neither is let go.  Which
of these is possible depends on its motors, ranges and shapes, so each spec is tried before it is written.
"""

from __future__ import annotations

import math
import os
import shlex
import time
from collections.abc import Container, Iterator, Sequence
from pathlib import Path
from typing import Any

from stc import pipeline
from stc.bundled import with_text
from stc.cli.console import note
from stc.cli.model_files import find
from stc.cli.trees import groups, objects
from stc.deadline import spent, using
from stc.errors import EndedError, Source, StcError, UsageError
from stc.language.model.scope import quoted
from stc.mechanism.mechanism import Mechanism
from stc.mechanism.read import ModelFileError, read_model
from stc.mechanism.refusals import refusals, without
from stc.records import dataclass
from stc.stance import Matrix, Spot, Stance

#: Places of contact that are this much above the lowest one, in m, stand in the same pose; if legs may bend, these.
_LEVEL, _NEAR = 1e-3, 0.1
#: Limits of a trial solve, in processor time: a page to start from is an easy one.
_ITERATIONS, _SECONDS = 200, 20.0
#: The share of this for all pages together on which a model stands or holds its pose, after which it is let go; and the
#: share of what is left that is worth another trial.
_SHARE_TO_HOLD, _LEAST = 1.5, 0.1
#: Contacts that take back slower than this what they give way by, in s, are made as stiff as this in the replay: the
#: motion is that of rigid ones.
_STIFF = 5e-4
#: Lever, in m, at which the weight makes a torque: its square weighs movement (rad^2/s^2) against squared torques.
_STILLNESS = 1.0
#: The same of joints with dry friction in the air, which holds them up as they creep.
_STILLNESS_AGAINST_CREEP = 100.0
#: So much stiffer is friction than pressure where feet hardly creep.
_NO_CREEP = 100.0
#: m/s^2
_GRAVITY = 9.81
#: The share of friction that the page uses: within MuJoCo's pyramid of forces, and with something to spare.
_GRIP = 0.7


#: What is added to the URDF of a robot that stands on legs or wheels, in words of the language.
_TO_STAND = ("freejoint", "motors", "floor")

#: Joints by their paths, and values.
Changes = Sequence[tuple[str, float]]


@dataclass(frozen=True, slots=True)
class _Page:
    """The definition of one spec.

    Attributes
    ----------
    title
        What the model does there.
    pose
        In which it begins, before changes.
    seconds
        How long.
    feet
        Contacts that stand, and their places.
    points
        Geoms of these that resist turning and rolling, which points do not.
    changes
        Joints that differ from the model's pose, and their values.
    held
        Joints to be held, where others are of objects that move as they like; empty for all.
    pinned, ends
        Whether the first frame is the pose, and whether the last one is at rest, in the same pose if that is pinned.
    raised
        How far everything is above the pose, in m.
    """

    title: str
    pose: str
    seconds: float = 0.5
    feet: Sequence[str] = ()
    points: Sequence[str] = ()
    changes: Changes = ()
    held: Sequence[str] = ()
    pinned: bool = True
    ends: bool = True
    raised: float = 0.0


def starter(name: str, path: Path, seconds: float | None = None) -> str:
    """A commented spec that moves a model, solves as it stands, and passes validation.

    Parameters
    ----------
    name
        The model file, or the name of a bundled model.
    path
        Where the spec is to be written.
    seconds
        Processor time that each page may take; None for :data:`_SECONDS`.

    Raises
    ------
    UsageError
        There is no such model, or it has no joints; the time is not positive.
    """
    if seconds is not None and not seconds > 0.0:
        raise UsageError(f"--time-limit must be a positive number of seconds, not {seconds:g}")
    most = _SECONDS if seconds is None else seconds
    mechanism, words = _completed(find(name))
    if not mechanism.joints:
        raise UsageError(f"the model `{name}` has no joints: there is nothing to move")
    model = f'"{_written(name, path)}"{words}'
    solved = text = ""
    others: list[str] = []
    for pages, share in ((_that_hold, _SHARE_TO_HOLD), (_that_let_go, 1.0)):
        end = time.thread_time() + share * most
        for page in pages(mechanism):
            left = min(most, end - time.thread_time())
            if text and left < _LEAST * share * most:
                others.append(f"{page.title}: not tried, since the others took long")
                break
            text = _text(page, mechanism, path, name, model)
            fate = _tried(text, path, left)
            if not fate:
                return _with_others(text, others)
            others.append(f"{page.title}: {fate}")
            if fate == _LARGE and len(others) == 1:  # it had all of the time
                return solved or _LARGE.format(seconds=most) + text
            note(f"tried: {Path(name).stem} {others[-1]}")
            if fate != _LARGE and not fate.startswith(_UNSOLVED):
                solved = (
                    solved or f"# The solve ends optimal, and the motion fails in MuJoCo: {fate}.\n{text}"
                )
        if not others:
            others.append("holds a pose: none was found in which motors and ground carry it")
    unsolved = f"# Within {most:g} s of processor time it was not solved.\n"
    return solved or unsolved + _with_others(text, others[:-1])


def _with_others(text: str, others: Sequence[str]) -> str:
    """A page that says at its top what else was tried, as asking more of the model, and what became of that."""
    if not others:
        return text
    title, rest = text.split("\n", 1)
    lines = ["# More was asked of it at first:", *(f"#   {other}" for other in others)]
    return "\n".join([title, *lines, rest])


def _completed(file: Path) -> tuple[Mechanism, str]:
    """A model without what cannot be stated, and the words in which a spec says so.

    To a URDF are added motors, and where it stands on legs or wheels or cannot move else also what lets it stand.  Many
    a model of a robot leaves the floor to another file, which includes it.
    """
    plain = read_model(file)
    left = sorted({refusal.kind for refusal in refusals(plain)})
    added: tuple[str, ...] = ()
    if plain.is_urdf and _travels(plain, objects(plain)):
        added = ("motors", "floor")
    elif plain.is_urdf:
        added = _TO_STAND if not plain.joints or _stands(file) else ("motors",)
    else:
        if len(read_model(file, additions=("excludes",)).excluded) > len(plain.excluded):
            added += ("excludes",)
        falls = any(plain.options.gravity) and _travels(plain, objects(plain))
        if falls and all(geom.body for geom in plain.geoms):
            added += ("floor",)
    if any(plain.welded_to_mocap(each) for each in plain.equalities):
        added += ("mocap",)
    words = [f"with {', '.join(added)}"] if added else []
    words += [f"without {', '.join(left)}"] if left else []
    mechanism = read_model(file, additions=added) if added else plain
    return without(mechanism, left), "".join(f" {each}" for each in words)


def _stands(file: Path) -> bool:
    """Whether a model whose root is free would stand on legs or wheels."""
    try:
        free = read_model(file, additions=_TO_STAND)
    except ModelFileError:  # a root without mass is no moving body
        return False
    return Stance(free, free.start).stands(_NEAR)


#: What becomes of a page that is not solved.
_UNSOLVED = "not solved"
#: What stands above a page whose solve did not even begin; another page of the model would take as long.
_LARGE = """\
# This page was not tried: the model is large, and to derive its equations takes longer than the {seconds:g} s of
# processor time that `stc new` gives a page; `stc new --time-limit 600` gives it more.  `stc run` has no such limit.
"""


def _tried(text: str, path: Path, seconds: float) -> str:
    """Solve and validate a spec: "" if it passes, otherwise the reason of the failure.

    Parameters
    ----------
    seconds
        Of processor time, before the validation.
    """
    from stc.certification import certify

    end = spent(seconds)
    try:
        with using(seconds):
            model = pipeline.Model(with_text(Source(path.stem, text, str(path))))
            model.transcription()
    except EndedError as error:
        if error.status == "interrupted":
            raise
        return _LARGE
    except StcError as error:
        # What stands in the way is worth more than its position in a page that is not kept.
        return f"{_UNSOLVED}: {str(error).splitlines()[0].rpartition('error: ')[2]}"
    try:
        solution = model.solve(max_iterations=_ITERATIONS, callback=end)
        if solution.status != "optimal":
            return _UNSOLVED
        certificate = certify(solution, equations=False)
    except StcError:
        return _UNSOLVED
    return "" if certificate.passed else certificate.headline


def _that_hold(mechanism: Mechanism) -> Iterator[_Page]:
    """Pages on which the model stands, or holds its pose, from the most to the least that can be asked of it."""
    for pose, q in _poses(mechanism).items():
        yield from _Pages(mechanism, pose, q).that_hold()


def _that_let_go(mechanism: Mechanism) -> Iterator[_Page]:
    """Pages on which the model is left to itself."""
    for pose, q in _poses(mechanism).items():
        yield from _Pages(mechanism, pose, q).that_let_go()


class _Pages:
    """The pages that begin in one pose, (nq,)."""

    def __init__(self, mechanism: Mechanism, pose: str, q: Sequence[float]) -> None:
        loose = objects(mechanism)
        self.mechanism, self.pose = mechanism, pose
        self.stance = Stance(mechanism, q, loose)
        self.stance.start = self._closed(self.stance.fit.regular(self.stance.start))
        self.driven = self.stance.driven()
        self.held = self.driven if any(joint.body in loose for joint in mechanism.joints) else []
        # No stop of a range takes part in a page, so that what moves by itself begins far from it.
        self.within = self.stance.changes(self._closed(self.stance.bent(0.5)))
        self.travels = _travels(mechanism, loose)
        things = Stance(mechanism, q, frozenset(range(len(mechanism.bodies))) - loose)
        self.lying = things.lowest(_LEVEL) if abs(things.height()) < _LEVEL else []
        # What falls is left to itself for as long as it touches nothing; what is drawn in the floor slides along it.
        falls = things.height() > _LEVEL
        self.most = 0.9 * math.sqrt(2.0 * things.height() / _GRAVITY) if falls else math.inf

    def _closed(self, q: Matrix) -> Matrix:
        """A pose, (nq,), after its loops are closed, if they can be."""
        fit = self.stance.fit
        found = None if fit.holds(q) else fit.pose(q)
        return q if found is None else found

    def _page(self, title: str, seconds: float = 0.5, **more: Any) -> _Page:
        seconds = seconds if seconds < self.most else float(f"{self.most:.1g}")
        more = {"changes": self.stance.changes(), "held": self.held, **more}
        return _Page(title, self.pose, seconds, **more)

    def _standing(self, title: str, spots: Sequence[Spot], changes: Changes, pinned: bool = True) -> _Page:
        spots = [*spots, *self.lying]
        feet = [f"{spot.written}, friction = {_GRIP * spot.friction:.6g}" for spot in spots]
        points = sorted({spot.resists for spot in spots if spot.resists and spot.written.startswith("point")})
        return self._page(title, feet=feet, points=points, changes=changes, pinned=pinned)

    def that_hold(self) -> Iterator[_Page]:
        """Pages on which the model stands, or holds its pose."""
        stance, mechanism, inside = self.stance, self.mechanism, self.stance.changes()
        if not self.travels:
            # What is loose is held by nothing.  A servo pushes a joint at the end of its range one way only, and the
            # harder, the farther from there the joint is.
            tries = (stance.start, self._closed(stance.bent()), self._closed(stance.bent(0.5)))
            poses = [q for q in tries if self.held or stance.holds(q, [])][:1]
            for q in poses:
                yield self._standing("holds a pose with the least effort", [], stance.changes(q))
            if self.held:  # what falls may fall on something
                yield self._page("holds a pose with the least effort", 0.1, changes=self.within)
            elif any(each.active for each in mechanism.equalities) or (mechanism.actuators and not poses):
                # The pose in the file may not fit what ties its parts, or be more than its motors can hold.
                yield self._page("holds a pose that takes the least effort", pinned=False)
            if not poses and self.driven:
                title = "holds the joints that its motors move"
                yield self._page(title, 0.05, changes=self.within, held=self.driven)
        elif (
            mechanism.actuators
            and any(mechanism.options.gravity)
            and "contact" not in mechanism.options.disabled
        ):
            # A chassis that carries wheels may stand on them alone, or on a caster as well.
            for whole in (False, True):
                level = stance.lowest(_LEVEL, whole)
                if level and stance.balances(level) and stance.holds(stance.start, level):
                    yield self._standing("stands still", level, inside)
                    break
            balanced, near = self._balanced()
            if balanced is not None and stance.holds(balanced, near):
                yield self._standing("stands still", near, stance.changes(balanced))
            if near and not self.held:
                begin = stance.changes(stance.bent() if balanced is None else balanced)
                yield self._standing(
                    "stands in a pose that takes the least effort", near, begin, pinned=False
                )
        if self.travels and mechanism.actuators and stance.holds(stance.start, []):  # it flies
            yield self._page("holds a pose with the least effort")

    def _balanced(self) -> tuple[Matrix | None, Sequence[Spot]]:
        """A pose that balances, (nq,), and what stands: toes, or whole feet if the motors only hold it on those."""
        found = self.stance.standing(_NEAR)
        for q, spots in (found, self.stance.standing(_NEAR, whole=True)):
            if q is not None and self.stance.holds(q, spots):
                return q, spots
        return found

    def that_let_go(self) -> Iterator[_Page]:
        """Pages on which the model is left to itself for a moment."""
        title = "is let go, and moves with the least effort"
        if self.travels:
            up = round(0.5 - min(0.0, self.stance.height()), 2)
            yield self._page(title, 0.2, changes=self.within, ends=False, raised=up)
        yield self._page(title, 0.05, changes=self.within, ends=False)


def _travels(mechanism: Mechanism, loose: Container[int]) -> bool:
    """Whether a body that hangs on the world, and is none of the loose ones, can go up and down without a motor that
    lifts it, and no equality constraint joins it to what is mounted.
    """
    driven = {
        actuator.target
        for actuator in mechanism.actuators
        if actuator.enabled and actuator.transmission in ("joint", "jointinparent")
    }
    group = groups(mechanism)
    roots = [
        body for body, each in enumerate(mechanism.bodies) if body and not each.parent and body not in loose
    ]
    rising = {
        joint.body
        for index, joint in enumerate(mechanism.joints)
        if joint.kind == "free"
        or (joint.kind == "slide" and abs(joint.axis[2]) > 1.0 - 1e-9 and index not in driven)
    }
    mounted = {group[body] for body in roots if body not in rising}
    return any(body in rising and group[body] not in mounted for body in roots)


def _text(page: _Page, mechanism: Mechanism, path: Path, name: str, model: str) -> str:
    base = page.pose + (f" + (0, 0, {page.raised:g})" if page.raised else "")
    changes = "".join(f", {joint} = {value:.9g}" for joint, value in page.changes)
    lines = [
        f"# {path.stem}: {Path(name).stem} {page.title}.  A page to start from.",
        "#",
        f"#     stc run {shlex.quote(str(path))}    solve it, then let MuJoCo replay it",
        f"#     stc show {shlex.quote(name)}    what the model's joints, actuators, sites and poses are called",
        "",
        "constants:",
        "  n = 20,                 # frames are 0, 1, ..., n",
        f"  T = {page.seconds:g}, h = T/n;       # seconds in all, and from one frame to the next",
        "",
        f"model: {model};",
        "",
    ]
    if page.feet:
        names = [f"foot{k + 1}" for k in range(len(page.feet))]
        lines += ["contact:                  # what touches the floor, and on which frames"]
        lines += [f"  {foot} = {place};" for foot, place in zip(names, page.feet, strict=True)]
        lines += [f"  [0, n]: {' '.join(f'{foot};' for foot in names)}", ""]
    # What is mounted has no root to be set down; objects on the floor lie on it as they are.
    grounded = " grounded" if page.feet and _travels(mechanism, objects(mechanism)) else ""
    lines += ["poses:", f"  begin = {base}{grounded}{changes};", "", "constraints:"]
    if page.pinned:
        lines += ["  [0]: begin; rest;"]
        if page.ends and page.held:
            lines += ["  # what nothing drives moves as it likes; the others end as they began"]
            lines += [f"  for j in {', '.join(page.held)}: {{ [n]: {{j}} = {{j}}[0]; {{j}}'; }}"]
        elif page.ends:
            lines += ["  [n]: begin; rest;          # ask for more: another pose, or values of joints"]
        else:
            lines += [
                "  # [n]: ...;                # what the last frame is to be: a pose, or values of joints"
            ]
    else:
        lines += ["  [0]: rest;", "  [n]: rest;", "", "guess:", "  [0]: begin;", "  [n]: begin;"]
    if not mechanism.actuators:
        lines += [
            "",
            "# The model has no actuators: `with motors` after its name adds one for each hinge and slide.",
        ]
    settings = []
    links = any(equality.active for equality in mechanism.equalities)
    if links or (page.feet and _gives_way(mechanism)):
        settings += ["  # contacts and links of the model give way; those of this page are rigid"]
        settings += [f"  set option.solref.time = {_STIFF:g};"]
    if page.feet and mechanism.options.impratio < _NO_CREEP:
        settings += ["  # feet of the model creep; those of this page stand"]
        settings += [f"  set option.impratio = {_NO_CREEP:g};"]
    if page.points:
        settings += ["  # the model's contacts resist turning and rolling; those of this page are points"]
    for geom in page.points:
        settings += [f"  set {geom}.friction.spin = 0; set {geom}.friction.roll = 0;"]
    lines += ["", "replay:", *settings] if settings else []
    lines += ["", "objective:"]
    lines += [f"  [0, n]: integral({'effort' if mechanism.actuators else '0'});"]
    if page.ends:
        weight = _GRAVITY * sum(body.mass for body in mechanism.bodies)
        rubs = any(joint.frictionloss for joint in mechanism.joints)
        creeps = rubs and not page.feet
        torque = float(f"{(_STILLNESS_AGAINST_CREEP if creeps else _STILLNESS) * weight:.1g}")
        why = "; so much, lest dry friction lets it creep" if creeps else ""
        each = f"for j in {', '.join(page.held)}: " if page.held else ""
        joint = "{j}" if page.held else "joint.*"
        # Dry friction depends on the acceleration, too, which may else alternate between frames and middles of steps.
        moves = f"({torque:g}*{joint}')^2" + (f" + ({torque:g}*h*{joint}'')^2" if rubs else "")
        lines += [
            f"  # and with little movement: 1 rad/s (or 1 m/s) of a joint costs as much as {torque:g} N m (or N){why}",
            f"  {each}[0, n]: integral({moves});",
        ]
    return "\n".join(lines) + "\n"


def _gives_way(mechanism: Mechanism) -> bool:
    """Whether the contacts of the model are as compliant as MuJoCo's default."""
    touching = [geom for geom in mechanism.geoms if geom.contype or geom.conaffinity]
    return any(geom.solref[0] > _STIFF for geom in touching)


def _written(name: str, path: Path) -> str:
    """The name of a model in a spec at ``path``: files are looked up beside the spec, then among the bundled ones."""
    if not Path(name).is_file() or Path(name).is_absolute():
        return name
    return Path(os.path.relpath(name, path.parent)).as_posix()


def _poses(mechanism: Mechanism) -> dict[str, Sequence[float]]:
    """The model's first keyframe with a name, and the pose that the file draws: paths and coordinates, (nq,)."""
    named = [keyframe for keyframe in mechanism.keyframes if keyframe.name][:1]
    poses: dict[str, Sequence[float]] = {f"keyframe.{quoted(each.name)}": each.qpos for each in named}
    poses["keyframe.reference"] = mechanism.start
    return poses
