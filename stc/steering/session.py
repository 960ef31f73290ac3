"""A spec that is steered: changes of its numbers, the motions for them, undo and redo, and the text with the numbers.

The session knows no window.  Whoever shows it calls :meth:`Session.drag` and :meth:`Session.turn` as often as the
watcher moves something, and takes the newest motion when it is told of one.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from stc.atomic import replacing
from stc.errors import OWN_MODEL, Source, UnsolvedError, UsageError
from stc.pipeline import Model
from stc.records import dataclass, field
from stc.solution import Solution
from stc.steering.edits import difference
from stc.steering.handles import Handle, Handles, qpos_at
from stc.steering.knobs import find_knobs
from stc.steering.pose_handles import PoseHandles, standing_places
from stc.steering.posed_body import FloatArray, PosedBody
from stc.steering.stated_handles import stated_frames
from stc.validate.fields import apply_fields
from stc.validate.reference import Reference
from stc.validate.setup import Setup, prepare
from stc.validate.ties import tied_joints
from stc.viewer.constants import slider_range
from stc.viewer.tweaks import TweakSession

#: Seconds for which a solve goes on though something newer is wanted: a motion on the way is better than none.
GRACE = 1.5

#: A handle is brought no farther at once than by this share of the model's size: nearby solves are quick and certain.
#: What is farther away is reached in several motions.
STRIDE = 0.03

#: Iterations after which a change counts as too large. It is tried again with a half of it, down to this share.
_ITERATIONS, _LEAST = 100, 1.0 / 16.0

#: A handle that comes no nearer to where it is dragged than by this, in m, has come as near as it gets.
_PROGRESS = 5e-4

#: Motions that can be undone.
MOST_KEPT = 200


@dataclass(frozen=True, slots=True)
class Slider:
    """A number that has a slider.

    Attributes:
        name: of the knob.
        label: what it is called.
        note: the comment on its line.
        low, high: the range of the slider.
        structural: whether frames and ranges depend on it, so that a change takes longer.
    """

    name: str
    label: str
    note: str
    low: float
    high: float
    structural: bool


@dataclass(slots=True)
class _Pull:
    """The last request that is not reached yet.

    Attributes:
        handle, target: what is dragged, and where to, (3,) m; None where numbers are turned.
        values: the numbers that are turned.
        share: of the way that is asked for next.
        before: how far the handle was from its target when that was asked for last, in m.
    """

    handle: Handle | None = None
    target: FloatArray = field(default_factory=lambda: np.zeros(3))
    values: dict[str, float] = field(default_factory=dict)
    share: float = 1.0
    before: float = float("inf")


class Session:
    """Steers a spec.

    Attributes:
        knobs: what can be steered.
        model: the working text, of which all motions are.
        sliders: one for each number that the spec writes.
        handles: by key.
        target: the file that the spec is written to.
    """

    def __init__(
        self,
        source: Source,
        overrides: Mapping[str, float] | None = None,
        *,
        target: Path | None = None,
        told: Callable[[], None] | None = None,
        **options: Any,
    ) -> None:
        """Find what can be steered and solve the spec as it stands.

        Args:
            source: the spec.
            overrides: values of constants, as ``--set`` gives them; they are written back like what is dragged.
            target: where the text is written; the spec's own file where it is None.
            told: called from another thread whenever a change has been worked on.
            **options: of :meth:`stc.pipeline.Model.solve`.

        Raises:
            SpecError: mistakes in the spec.
            UnsolvedError: the spec has no motion to begin with.
            UsageError: it has no model to be shown with, nothing to steer, or an override that is computed.
            ModelError: the model cannot be found or does not fit the spec.
        """
        self.knobs = find_knobs(source, overrides)
        given = dict(overrides or {})
        for name in given:
            if name not in self.knobs.knobs:
                raise UsageError(self.knobs.refused.get(name, f"the spec has no constant `{name}`"))
        if not self.knobs.knobs:
            raise UsageError(f"{source.name} has no number to steer", "declare one under `constants:`")
        self.model = Model(replace(source, text=self.knobs.working))
        self.target = target if target is not None else (Path(source.path) if source.path else None)
        self._original = source.written
        self._on_disk = source.written if target is None else _text_of(target)
        problem = self.model.problem(options.get("method"), **given)
        if problem.model is None:
            raise UsageError(
                f"{source.name} has no `replay:` section that names a model to show it with",
                OWN_MODEL,
            )
        solution = self.model.solve(constants=given, **options)
        if solution.status != "optimal":
            raise UnsolvedError(
                f"{source.name} has no motion to begin with: {solution.message}",
                "steering starts from a solution; `stc solve` tells more about why there is none",
                solution.status,
            )
        self._setups = [prepare(solution, None)]
        self._problem = problem
        self._groups = self._found_handles()
        self.sliders = self._sliders(solution)
        self._past: list[Solution] = []
        self._future: list[Solution] = []
        self._in_gesture = False
        self._pull: _Pull | None = None
        self._tweaks = TweakSession(
            solution, [], told, grace=GRACE, max_iterations=_ITERATIONS, sketches=True
        )

    # ------------------------------------------------------------------- what there is

    @property
    def solution(self) -> Solution:
        """The newest motion that was found."""
        return self._tweaks.solution

    @property
    def wanted(self) -> dict[str, float]:
        """The values that are asked for of all numbers that have been turned, by the names of their knobs."""
        return self._tweaks.wants

    @property
    def generation(self) -> int:
        """Grows by one with every new motion."""
        return self._tweaks.generation

    @property
    def busy(self) -> bool:
        """Whether a change is being worked on or waits."""
        return self._tweaks.unsettled

    @property
    def message(self) -> str:
        """Why the motion on show is not the requested one; empty if it is, or if a solve is under way."""
        outcome = self._tweaks.outcome
        if outcome is None or not outcome.message or not self._tweaks.refused:
            return ""
        return outcome.message

    @property
    def handles(self) -> dict[str, Handle]:
        """The handles that can be dragged, by key."""
        return {handle.key: handle for group in self._groups for handle in group.handles}

    @property
    def can_undo(self) -> bool:
        """Whether there is an earlier motion to go back to."""
        return any(past is not self.solution for past in self._past)

    @property
    def can_redo(self) -> bool:
        """Whether something was undone."""
        return bool(self._future)

    def points(self, setup: Setup | None = None) -> dict[str, FloatArray]:
        """(3,) where each handle is in a motion, in m; in the last solution where none is given."""
        setup = setup or self._tied(self.solution)
        handles = self.handles
        found = dict.fromkeys(handles, np.zeros(3))
        for frame in {handle.frame for handle in handles.values()}:
            at = min(frame, setup.solution.n)
            stance = PosedBody(setup.compiled, qpos_at(setup, setup.solution, at))
            found.update({k: h.place.point(stance.data) for k, h in handles.items() if h.frame == frame})
        return found

    def shown(self) -> Setup:
        """The motion to be shown, tied to its model: the last solution, or an iterate that is near to the next one."""
        return self._tied(self._tweaks.sketch or self.solution)

    def _tied(self, solution: Solution) -> Setup:
        """A motion tied to its model, which is set up once, and takes on what the spec sets in it."""
        for setup in self._setups:
            if setup.solution is solution:
                return setup
        first = self._setups[0]
        fields = apply_fields(first.compiled, solution)
        ties = tied_joints(first.compiled, solution)
        reference = Reference(solution, ties)
        made = replace(first, solution=solution, fields=fields, ties=ties, reference=reference)
        self._setups = [made, *self._setups[:2]]
        return made

    # ------------------------------------------------------------------- steering

    def drag(self, key: str, target: Sequence[float]) -> None:
        """Ask for the motion in which a handle is at a place, (3,) m, or as near as it gets; returns at once.

        A place that is far away is reached in several motions: :meth:`follow` asks for the next one.

        Raises:
            UsageError: there is no such handle, or the place is none.
        """
        handle = self.handles.get(key)
        place = np.asarray(target, dtype=np.float64)
        if handle is None or place.shape != (3,) or not np.isfinite(place).all():
            raise UsageError("there is no such handle, or no such place")
        self._begin()
        self._pull = _Pull(handle=handle, target=place)
        self._bring(self._pull)

    def turn(self, values: Mapping[str, float]) -> None:
        """Ask for the motion with other numbers, by the names of their knobs; returns at once.

        Raises:
            UsageError: a name is that of no knob, or a value is no number.
        """
        for name, value in values.items():
            if name not in self.knobs.knobs:
                raise UsageError(
                    self.knobs.refused.get(name, f"the spec has no number called `{name}` to steer")
                )
            if not np.isfinite(value):
                raise UsageError(f"`{name}` needs a number, not {value!r}")
        self._begin()
        self._pull = _Pull(values=dict(values))
        self._bring(self._pull)

    def follow(self) -> None:
        """Go on toward what was asked for last, once a motion on the way there has been found, or was not.

        Whoever shows the session calls it when told that a change has been worked on.
        """
        pull = self._pull
        if pull is None or self.busy:
            return
        pull.share = 0.5 * pull.share if self._tweaks.refused else min(1.0, 2.0 * pull.share)
        if pull.share < _LEAST:
            self._pull = None
        else:
            self._bring(pull)

    def _begin(self) -> None:
        """Note where a gesture begins."""
        if not self._in_gesture:
            self._in_gesture = True
            self._past = [*self._past, self.solution][-MOST_KEPT:]
            self._future.clear()

    def _bring(self, pull: _Pull) -> None:
        """Ask for the motion in which everything is as it was asked for, or a stride nearer to that."""
        setup = self._tied(self.solution)
        constants = setup.solution.constants
        if pull.handle is not None:
            data = PosedBody(setup.compiled, qpos_at(setup, setup.solution, pull.handle.frame)).data
            here = pull.handle.place.point(data)
            group = self._group(pull.handle)
            goal, there = group.reached(pull.handle, pull.target, setup.solution, setup)
            left = float(np.linalg.norm(there - here))
            if pull.share == 1.0 and left > pull.before - _PROGRESS:
                self._pull = None
                return
            pull.before = left
            stride = STRIDE * float(setup.compiled.stat.extent)
            if left > stride:
                near = here + (there - here) * stride / left
                goal = group.reached(pull.handle, near, setup.solution, setup)[0]
        else:
            goal = pull.values
        if pull.share < 1.0 and not set(goal) & set(self._problem.structural):
            goal = {
                name: constants[name] + pull.share * (value - constants[name]) for name, value in goal.items()
            }
        if any(self._tweaks.wanted(name) != value for name, value in goal.items()):
            self._tweaks.turn(**goal)
        elif self.busy:
            return  # it is being solved for already, and there is a way to go from there
        elif self.solution is not setup.solution:  # it has been found meanwhile: the next stride begins there
            self._bring(pull)
        else:
            self._pull = None

    def release(self) -> None:
        """Tell that what was held is let go: what comes next is undone by itself."""
        self._in_gesture = False

    def undo(self) -> bool:
        """Go back to the motion before the last gesture; whether there is one."""
        self.release()
        while self._past and self._past[-1] is self.solution:
            self._past.pop()
        if not self._past:
            return False
        self._future.append(self.solution)
        self._restore(self._past.pop())
        return True

    def redo(self) -> bool:
        """Go forward again to what was undone last; whether there is anything."""
        if not self._future:
            return False
        self._past.append(self.solution)
        self._restore(self._future.pop())
        return True

    def _restore(self, solution: Solution) -> None:
        self._pull = None
        self._tweaks.restore(solution)

    def wait(self, seconds: float = 60.0) -> bool:
        """Wait until all changes are solved and dragged handles are at their targets; returns whether they are."""
        end = time.monotonic() + seconds
        while self._tweaks.wait(max(0.0, end - time.monotonic())):
            self.follow()
            if not self.busy:
                return True
        return False

    def close(self) -> None:
        """End the session."""
        self._tweaks.close()

    # ------------------------------------------------------------------- the text

    def text(self) -> str:
        """The spec's text with the numbers of the motion on show."""
        return self.knobs.written(self.solution.overrides)

    def changes(self) -> str:
        """The changes that :meth:`write` would make to the file, in the format of ``diff -u``; empty if there are
        none."""
        name = "the spec" if self.target is None else self.target.name
        return difference(self._on_disk if self._on_disk is not None else self._original, self.text(), name)

    def write(self) -> Path:
        """Write the text into its file, once it has been solved as it will stand there.

        Raises:
            UsageError: there is no file, or it has been changed by someone else since it was read or written here.
            UnsolvedError: the text does not lead to the motion on show.
            SpecError: the text would be refused.
            OSError: the file cannot be written.
        """
        if self.target is None:
            raise UsageError("the spec came as text and has no file to be written to")
        if _text_of(self.target) != self._on_disk:
            raise UsageError(
                f"{self.target} has changed on disk since it was read: nothing was written",
                "start `stc steer` anew to steer what stands there now",
            )
        text = self.text()
        self._confirm(text)
        with replacing(self.target) as temporary:
            temporary.write_text(text, encoding="utf-8")
        self._on_disk = text
        return self.target

    def _confirm(self, text: str) -> None:
        """Make sure that a text states the motion on show: it is solved from there and has to end there."""
        shown = self.solution
        found = Model(replace(self.model.source, text=text)).solve(warm_start=shown, method=shown.method)
        if found.status != "optimal":
            raise UnsolvedError(
                f"the text as it would be written does not solve: {found.message}", "", found.status
            )
        away = abs(found.objective - shown.objective)
        if away > 1e-3 * max(1.0, abs(shown.objective)):
            raise UsageError(
                f"the text as it would be written leads to another motion: objective {found.objective:.6g}, not "
                f"{shown.objective:.6g}"
            )

    # ------------------------------------------------------------------- inside

    def _found_handles(self) -> list[Handles]:
        """The handles of each frame that has any; where a pose is stated, those of the pose."""
        knobs, setup, problem = self.knobs, self._setups[0], self._problem
        poses: dict[int, Handles] = {}
        for site in knobs.poses:
            if 0 <= site.frame <= problem.n and site.frame not in poses:
                standing = standing_places(knobs, problem, setup.compiled, site.frame)
                poses[site.frame] = PoseHandles(site, knobs, setup, standing)
        stated = stated_frames(problem, knobs, setup, self.model.tree)
        return [*poses.values(), *(group for group in stated if group.frame not in poses)]

    def _group(self, handle: Handle) -> Handles:
        """The group of handles to which a handle belongs."""
        return next(group for group in self._groups if any(one.key == handle.key for one in group.handles))

    def _sliders(self, solution: Solution) -> list[Slider]:
        structural = self._problem.structural
        found = []
        for knob in self.knobs.knobs.values():
            if knob.start >= 0:
                low, high = slider_range(solution.constants[knob.name])
                found.append(Slider(knob.name, knob.label, knob.note, low, high, knob.name in structural))
        return sorted(found, key=lambda slider: slider.structural)


def _text_of(path: Path) -> str | None:
    """The text of a file; None if it cannot be read as UTF-8."""
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return None


__all__ = ["Session", "Slider"]
