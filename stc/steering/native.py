"""Steering in MuJoCo's own viewer: handles are balls that are moved like any body that nothing else moves.

A ball is selected by a double click and moved with the control key held down and the right mouse button, as the viewer
moves mocap bodies.  The motion follows while it is moved.  What has no mouse gesture there has a key; see :data:`KEYS`.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from stc.errors import StcError
from stc.records import dataclass, field
from stc.steering.handles import Handle
from stc.steering.posed_body import FloatArray
from stc.steering.session import Session
from stc.validate.fields import apply_fields
from stc.validate.model import as_bytes
from stc.validate.pictures.motion import solved_at
from stc.validate.pictures.scenery import furnish
from stc.viewer.timeline import Timeline
from stc.viewer.windows import require_display, restore_flags

if TYPE_CHECKING:
    import mujoco

KEYS = (
    "double click on a ball, then Ctrl and the right mouse button: drag   space: play or pause   "
    "N: next frame with handles   Z: undo   Y: redo   P: print what would be written   F: write into the file"
)
#: Letters among these; the viewer switches parts of its pictures by the same ones.
_LETTERS = "NZYPF"

#: Radius of a ball as a share of the model's size, and colours by kind.
_RADIUS = 0.018
_COLOURS = {
    "place": (0.85, 0.28, 0.06, 0.9),
    "pose": (0.12, 0.44, 0.92, 0.9),
    "foot": (0.17, 0.54, 0.24, 0.9),
}

#: Where balls are that are not shown, in m: below everything.
_AWAY = (0.0, 0.0, -1000.0)

#: A ball has been moved where it is farther than this from where it was put, in m.
_MOVED = 1e-5

#: Seconds without a move after which a ball counts as let go.
_LET_GO = 0.4

_RATE = 60.0


def model_with_balls(session: Session) -> mujoco.MjModel:
    """The model of a session with a mocap body for each handle, in their order, behind all bodies of its own."""
    import mujoco

    setup = session.shown()
    spec = mujoco.MjSpec.from_file(as_bytes(setup.path))
    furnish(spec, setup)
    for k, handle in enumerate(session.handles.values()):
        body = spec.worldbody.add_body(name=f"handle {k}: {handle.label}", mocap=True, pos=_AWAY)
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[_RADIUS * float(setup.compiled.stat.extent), 0.0, 0.0],
            rgba=_COLOURS[handle.kind],
            contype=0,
            conaffinity=0,
            mass=0.0,
        )
    model = spec.compile()
    apply_fields(model, setup.solution)
    model.stat.extent, model.stat.center = setup.compiled.stat.extent, setup.compiled.stat.center
    return model


@dataclass(slots=True)
class Balls:
    """The balls of a window, and what its watcher does with them.

    Attributes:
        session: what is steered.
        timeline: which instant is shown.
        frame: whose handles are shown.
        held: the handle that is being moved, or None.
        message: what the watcher is told.
    """

    session: Session
    timeline: Timeline = field(default_factory=Timeline)
    frame: int = 0
    held: Handle | None = None
    message: str = ""
    _put: dict[int, FloatArray] = field(default_factory=dict)
    _moved: float = 0.0

    def __post_init__(self) -> None:
        handles = list(self.session.handles.values())
        self.frame = next((one.frame for one in reversed(handles) if one.kind == "place"), handles[-1].frame)
        solution = self.session.solution
        self.timeline.cover(float(solution.time[0]), float(solution.time[-1]))

    def look(self, data: mujoco.MjData, now: float, passed: float) -> None:
        """Read which balls the user has moved, and place the bodies and balls for the next picture.

        Args:
            data: of the model with the balls.
            now: the watcher's time, in seconds.
            passed: how much of it has passed since the last call.
        """
        self._take(data, now)
        self.session.follow()
        setup = self.session.shown()
        solution = setup.solution
        self.timeline.cover(float(solution.time[0]), float(solution.time[-1]))
        self.timeline.advance(passed)
        at = self.timeline.now
        if self.held is not None:
            at = float(solution.time[min(self.held.frame, solution.n)])
        data.qpos[:] = solved_at(setup, np.array([at]))[0]
        points = self.session.points(setup)
        for k, (key, handle) in enumerate(self.session.handles.items()):
            if handle is self.held or (self.held is not None and key == self.held.key):
                continue
            place = points[key] if handle.frame == self.frame else np.array(_AWAY)
            data.mocap_pos[self._first(data) + k] = place
            self._put[k] = np.array(place)

    def press(self, code: int) -> None:
        """Do what a key stands for; ``code`` as GLFW has it."""
        session = self.session
        self.message = ""
        if code == ord(" "):
            self.timeline.toggle()
        elif code == ord("N"):
            frames = sorted({handle.frame for handle in session.handles.values()})
            self.frame = frames[(frames.index(self.frame) + 1) % len(frames)]
            self.timeline.seek(float(session.solution.time[min(self.frame, session.solution.n)]))
        elif code == ord("Z"):
            session.undo()
        elif code == ord("Y"):
            session.redo()
        elif code == ord("P"):
            print(session.changes() or "nothing has changed", flush=True)
        elif code == ord("F"):
            try:
                self.message = f"written to {session.write()}"
            except (StcError, OSError) as error:
                self.message = str(error)
            print(self.message, flush=True)

    def state(self) -> str:
        """The status line of the window."""
        session = self.session
        words = "solving" if session.busy else "solved"
        if not session.busy and session.message:
            words = f"not as asked: {session.message}"
        return " | ".join(part for part in (words, self.message) if part)

    def _take(self, data: mujoco.MjData, now: float) -> None:
        """Notice which ball has been moved, or let go."""
        first = self._first(data)
        for k, handle in enumerate(self.session.handles.values()):
            place = np.array(data.mocap_pos[first + k])
            known = self._put.get(k)
            if known is not None and float(np.linalg.norm(place - known)) > _MOVED:
                self._put[k], self.held, self._moved = place, handle, now
                self.session.drag(handle.key, place.tolist())
        if self.held is not None and now - self._moved > _LET_GO:
            self.held = None
            self.session.release()

    def _first(self, data: mujoco.MjData) -> int:
        """The index of the first ball among the mocap bodies: those of the model itself come before."""
        return len(data.mocap_pos) - len(self.session.handles)


def open_window(session: Session) -> None:
    """Steer in MuJoCo's passive viewer until that is closed.

    Raises:
        DisplayError: there is no display.
    """
    require_display()
    import mujoco
    import mujoco.viewer

    model = model_with_balls(session)
    data = mujoco.MjData(model)
    balls = Balls(session)
    print(KEYS, flush=True)
    options = {"show_left_ui": False, "show_right_ui": False}
    with mujoco.viewer.launch_passive(model, data, key_callback=balls.press, **options) as window:
        last = time.perf_counter()
        while window.is_running():
            now = time.perf_counter()
            draw(window, model, data, balls, now - last)
            last = now
            time.sleep(max(0.001, now + 1.0 / _RATE - time.perf_counter()))


def draw(window: Any, model: mujoco.MjModel, data: mujoco.MjData, balls: Balls, passed: float) -> None:
    """Hand the next picture to a window of ``mujoco.viewer``, which moves the balls meanwhile."""
    import mujoco

    with window.lock():
        balls.look(data, time.perf_counter(), passed)
        restore_flags(window.opt.flags, _LETTERS)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
    font, corner = mujoco.mjtFontScale.mjFONTSCALE_150, mujoco.mjtGridPos.mjGRID_TOPLEFT
    window.set_texts((font, corner, balls.state(), ""))
    window.sync()
