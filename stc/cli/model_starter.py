"""The spec that `stc new --model robot.xml` writes: the first of several simple specs that solves and passes
validation.

A robot that can stand is asked to stand, a mounted one to hold its pose; a model that can do neither is let go.  Which
of these is possible depends on its motors, ranges and shapes, so each spec is tried before it is written.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path

from stc import pipeline
from stc.bundled import with_text
from stc.cli.model_files import find
from stc.cli.stance import Spot, Stance
from stc.deadline import spent
from stc.errors import Source, StcError, UsageError
from stc.language.model.scope import path_of, quoted
from stc.mechanism.mechanism import Mechanism
from stc.mechanism.read import read_model
from stc.mechanism.refusals import refusals, without
from stc.records import dataclass

#: Places of contact that are this much above the lowest one, in m, stand in the same pose; if legs may bend, these.
_LEVEL, _NEAR = 1e-3, 0.1
#: Limits of a trial solve, in processor time: a page to start from is an easy one.
_ITERATIONS, _SECONDS = 200, 20.0
#: Contacts that take back slower than this what they give way by, in s, are made as stiff as this in the replay: the
#: motion is that of rigid ones.
_STIFF = 5e-4
#: Lever, in m, at which the weight makes a torque: its square weighs movement (rad^2/s^2) against squared torques.
_STILLNESS = 1.0
#: The share of friction that the page uses: within MuJoCo's pyramid of forces, and with something to spare.
_GRIP = 0.7


#: Joints by their paths, and values.
Changes = Sequence[tuple[str, float]]


@dataclass(frozen=True, slots=True)
class _Page:
    """The definition of one spec.

    Attributes
    ----------
    title
        What the model does there.
    seconds
        How long.
    feet
        Contacts that stand, and their places.
    points
        Geoms of these that resist turning and rolling, which points do not.
    changes
        Joints that differ from the model's pose, and their values.
    pinned, ends
        Whether the first frame is the pose, and whether the last one is at rest, in the same pose if that is pinned.
    raised
        How far everything is above the pose, in m.
    """

    title: str
    seconds: float = 0.5
    feet: Sequence[str] = ()
    points: Sequence[str] = ()
    changes: Changes = ()
    pinned: bool = True
    ends: bool = True
    raised: float = 0.0


def starter(name: str, path: Path) -> str:
    """A commented spec that moves a model, solves as it stands, and passes validation.

    Parameters
    ----------
    name
        The model file, or the name of a bundled model.
    path
        Where the spec is to be written.

    Raises
    ------
    UsageError
        There is no such model, or it has no joints.
    """
    mechanism = read_model(find(name))
    left = sorted({refusal.kind for refusal in refusals(mechanism)})
    mechanism = without(mechanism, left)
    if not mechanism.joints:
        raise UsageError(f"the model `{name}` has no joints: there is nothing to move")
    solved = text = ""
    for page in _pages(mechanism):
        text = _text(page, mechanism, path, name, left)
        fate = _tried(text, path)
        if not fate:
            return text
        if fate != _UNSOLVED:
            solved = solved or f"# The solve ends optimal, and the motion fails in MuJoCo: {fate}.\n{text}"
    return solved or f"# Within {_SECONDS:g} s of processor time it was not solved.\n{text}"


#: What becomes of a page that is not solved.
_UNSOLVED = "not solved"


def _tried(text: str, path: Path) -> str:
    """Solve and validate a spec: "" if it passes, otherwise the reason of the failure."""
    from stc.certification import certify

    try:
        model = pipeline.Model(with_text(Source(path.stem, text, str(path))))
        solution = model.solve(max_iterations=_ITERATIONS, callback=spent(_SECONDS))
        if solution.status != "optimal":
            return _UNSOLVED
        certificate = certify(solution, equations=False)
    except StcError:
        return _UNSOLVED
    return "" if certificate.passed else certificate.headline


def _pages(mechanism: Mechanism) -> Iterator[_Page]:
    """The specs to try, from the most to the least demanding."""
    stance = Stance(mechanism, _pose(mechanism)[1])
    inside = stance.changes()
    travels = _travels(mechanism)

    def standing(title: str, spots: Sequence[Spot], changes: Changes, pinned: bool = True) -> _Page:
        feet = [f"{spot.written}, friction = {_GRIP * spot.friction:.6g}" for spot in spots]
        points = sorted({spot.resists for spot in spots if spot.resists and spot.written.startswith("point")})
        return _Page(title, feet=feet, points=points, changes=changes, pinned=pinned)

    if travels and mechanism.actuators and "contact" not in mechanism.options.disabled:
        level = stance.lowest(_LEVEL)
        if len(level) > 1 and stance.balances(level):
            yield standing("stands still", level, inside)
        near = stance.lowest(_NEAR)
        balanced = stance.balanced(near)
        if balanced is not None:
            yield standing("stands still", near, stance.changes(balanced))
        if near:
            begin = stance.changes(stance.bent() if balanced is None else balanced)
            yield standing("stands in a pose that takes the least effort", near, begin, pinned=False)
    if not travels:
        yield _Page("holds a pose with the least effort", changes=inside)
    title = "is let go, and moves with the least effort"
    if travels:
        yield _Page(title, 0.2, ends=False, raised=0.5, changes=inside)
    yield _Page(title, 0.05, ends=False, changes=inside)


def _travels(mechanism: Mechanism) -> bool:
    """Whether a body attached to the world can move up and down."""
    return any(
        mechanism.bodies[joint.body].parent == 0
        and (joint.kind == "free" or (joint.kind == "slide" and abs(joint.axis[2]) > 1.0 - 1e-9))
        for joint in mechanism.joints
    )


def _text(page: _Page, mechanism: Mechanism, path: Path, name: str, left: Sequence[str]) -> str:
    base = _pose(mechanism)[0] + (f" + (0, 0, {page.raised:g})" if page.raised else "")
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
        f'model: "{_written(name, path)}"' + (f" without {', '.join(left)}" if left else "") + ";",
        "",
    ]
    if page.feet:
        names = [f"foot{k + 1}" for k in range(len(page.feet))]
        lines += ["contact:                  # what touches the floor, and on which frames"]
        lines += [f"  {foot} = {place};" for foot, place in zip(names, page.feet, strict=True)]
        lines += [f"  [0, n]: {' '.join(f'{foot};' for foot in names)}", ""]
    lines += ["poses:", f"  begin = {base}{' grounded' if page.feet else ''}{changes};", "", "constraints:"]
    if page.pinned:
        lines += ["  [0]: begin; rest;"]
        if page.ends:
            lines += ["  [n]: begin; rest;          # ask for more: another pose, or values of joints"]
        else:
            lines += [
                "  # [n]: ...;                # what the last frame is to be: a pose, or values of joints"
            ]
    else:
        lines += ["  [0]: rest;", "  [n]: rest;", "", "guess:", "  [0]: begin;", "  [n]: begin;"]
    if not mechanism.actuators:
        joint = path_of("joint", mechanism.joints[0].name)
        if mechanism.joints[0].kind in ("hinge", "slide"):
            lines += [
                "",
                "# The model has no actuators. A force on a joint is stated, and handed to MuJoCo, by",
            ]
            lines += [f"# variables: u;   forces: {joint}: u;   replay: apply {joint} = u;"]
    settings = []
    if page.feet and _gives_way(mechanism):
        settings += ["  # the model's contacts give way; those of this page are rigid"]
        settings += [f"  set option.solref.time = {_STIFF:g};"]
    if page.points:
        settings += ["  # the model's contacts resist turning and rolling; those of this page are points"]
    for geom in page.points:
        settings += [f"  set {geom}.friction.spin = 0; set {geom}.friction.roll = 0;"]
    lines += ["", "replay:", *settings] if settings else []
    lines += ["", "objective:"]
    lines += [f"  [0, n]: integral({'effort' if mechanism.actuators else '0'});"]
    if page.feet and page.pinned:
        weight = 9.81 * sum(body.mass for body in mechanism.bodies)
        still = (_STILLNESS * weight) ** 2
        lines += [f"  [0, n]: integral({still:.1g}*joint.*'^2);      # and with little movement"]
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


def _pose(mechanism: Mechanism) -> tuple[str, Sequence[float]]:
    """The model's first named keyframe, else the pose of the file: its path and coordinates."""
    for keyframe in mechanism.keyframes:
        if keyframe.name:
            return f"keyframe.{quoted(keyframe.name)}", keyframe.qpos
    return "keyframe.reference", mechanism.start
