"""The logic of the viewer, independent of the window.

A window calls :meth:`Player.frame` for each picture, shows the result, and passes the user's input on
to :attr:`Player.timeline`, :attr:`Player.options`, :attr:`Player.tweaks` and :attr:`Player.live`.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from stc.errors import StcError
from stc.records import dataclass, field
from stc.solution import Solution
from stc.viewer.live import LiveSolve
from stc.viewer.motion import Motion
from stc.viewer.physics import Recording, State
from stc.viewer.scene import Scene, make_scene
from stc.viewer.shapes import FloatArray, Shape
from stc.viewer.timeline import Timeline
from stc.viewer.tweaks import TweakSession, session_for

#: The ghost stands aside by this share of the model's extent at first: where both agree they would cover each other.
ASIDE = 0.4

#: On a slow computer time runs slowly rather than in leaps of more than this, in seconds.
_LEAP = 0.1


@dataclass(slots=True)
class Options:
    """Display options.

    Attributes:
        ghost: the solved motion as a translucent copy.
        aside: distance of the ghost from the body, in m, along y.
        physics: MuJoCo's run of the motion as the opaque body; without it that body is the solved one.
        tracked: with feedback, or open loop.
        forces: arrows and arcs for the solved forces.
        contacts: arrows for the forces of MuJoCo's contacts.
        paths: of feet and end effectors, with a ball at each frame.
    """

    ghost: bool = True
    aside: float = 0.0
    physics: bool = True
    tracked: bool = False
    forces: bool = True
    contacts: bool = True
    paths: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """The content of one picture.

    Attributes:
        time: of the motion, in seconds.
        body: the opaque model's state.
        ghost: the ghost's state.
        offset: (3,) of the ghost, in m.
        shapes: the shapes that are drawn in addition.
        simulated: whether the body is where MuJoCo's physics has it; else it is the solved motion's.
        generation: of the motion; see :attr:`Player.generation`.
    """

    time: float
    body: State
    ghost: State
    offset: FloatArray
    shapes: Sequence[Shape]
    simulated: bool
    generation: int


@dataclass(slots=True)
class Player:
    """A displayed motion.

    Attributes:
        motion: what is shown.
        scene: the model that shows it.
        timeline: which instant, and how fast.
        options: what of it.
        tweaks: the session that changes constants; None if the spec is not solved again.
        live: the solve in progress; None if there is none.
        beside: folders to search for the model.
        generation: number of the motion, increased with every new one.
        scene_generation: number of the scene, increased with every new one.
        message: the error of the last motion; empty if there was none.
    """

    motion: Motion
    scene: Scene
    timeline: Timeline = field(default_factory=Timeline)
    options: Options = field(default_factory=Options)
    tweaks: TweakSession | None = None
    live: LiveSolve | None = None
    beside: tuple[Path, ...] = ()
    generation: int = 0
    scene_generation: int = 0
    message: str = ""
    _recordings: dict[bool, Recording] = field(default_factory=dict)
    _seen_tweak: int = 0
    _seen_iterate: int = 0
    _asked_for_tweaks: bool = False
    _lock: threading.RLock = field(default_factory=threading.RLock)

    @staticmethod
    def of(solution: Solution, beside: Sequence[Path] = (), options: Options | None = None) -> Player:
        """A player of a solution.

        Args:
            solution: the motion to show first.
            beside: folders to look for its model in, besides the spec's own.
            options: what is shown; by default everything, the ghost aside.

        Raises:
            ModelError, SolutionError: as :class:`stc.viewer.motion.Motion`.
        """
        motion = Motion(solution, beside)
        chosen = options or Options(aside=ASIDE * motion.extent)
        player = Player(motion, make_scene(motion), options=chosen, beside=tuple(beside))
        player.timeline = Timeline(motion.start, motion.end, motion.start)
        return player

    @property
    def solution(self) -> Solution:
        """The solution on show."""
        return self.motion.solution

    @property
    def recording(self) -> Recording | None:
        """The physics that is shown, open loop or tracked; None while the motion is not a solution yet."""
        return self._recordings.get(self.options.tracked)

    @property
    def frame_step(self) -> float:
        """The mean duration of a step between two frames, in seconds: the time step of a key."""
        return self.timeline.duration / max(1, self.solution.n)

    @property
    def solving(self) -> bool:
        """Whether a solve is running, for which other background work pauses."""
        return (self.live is not None and self.live.running) or (
            self.tweaks is not None and self.tweaks.unsettled
        )

    def frame(self, seconds: float = 0.0) -> Frame:
        """Advance by ``seconds`` of real time and return the content of the picture."""
        with self._lock:
            self._take_news()
            self._start_physics()
            self.timeline.advance(min(seconds, _LEAP))
            return self._frame()

    def close(self) -> None:
        """Stop all background work; a solve in progress returns its best iterate."""
        self._forget_physics()
        if self.tweaks is not None:
            self.tweaks.close()
        if self.live is not None:
            self.live.stop()

    def _frame(self) -> Frame:
        options, motion, now = self.options, self.motion, self.timeline.now
        offset = np.array([0.0, options.aside, 0.0])
        ghost = motion.state(now)
        recording = self.recording if options.physics else None
        state = None if recording is None else recording.at(now)
        shapes: list[Shape] = []
        if options.paths:
            shapes += motion.paths(offset)
            if recording is not None:
                shapes += motion.found_paths(recording)
        if options.forces:
            shapes += motion.solved_forces(now, offset)
        if options.contacts and state is not None:
            shapes += motion.found_forces(state)
        body = ghost if state is None else state
        return Frame(now, body, ghost, offset, shapes, state is not None, self.generation)

    def _take_news(self) -> None:
        """Show the newest iterate, or the newest motion for changed constants, if there is one."""
        live, tweaks = self.live, self.tweaks
        if live is not None and live.generation != self._seen_iterate:
            self._seen_iterate = live.generation
            if live.iterate is not None:
                self.show(live.iterate)
        if live is not None and live.solution is not None and tweaks is None and not self._asked_for_tweaks:
            self._asked_for_tweaks = True
            try:
                tweaks = self.tweaks = session_for(live.solution)
            except StcError as error:
                self.message = str(error)
        if tweaks is not None and tweaks.generation != self._seen_tweak:
            self._seen_tweak = tweaks.generation
            self.show(tweaks.solution)

    def show(self, solution: Solution) -> None:
        """Show another motion of the same spec; if it cannot be shown, the old one remains, with a message."""
        with self._lock:
            try:
                motion = Motion(solution, self.beside)
                scene = self.scene
                if motion.shape_key != scene.shape_key:
                    scene = make_scene(motion)
            except StcError as error:
                self.message = str(error)
                return
            self._forget_physics()
            if scene is not self.scene:
                self.scene_generation += 1
            self.motion, self.scene, self.message = motion, scene, ""
            self.timeline.cover(motion.start, motion.end)
            self.generation += 1

    def _start_physics(self) -> None:
        """Start the displayed replay, unless it is running, or the motion is only an iterate."""
        tracked = self.options.tracked
        if tracked in self._recordings or not self.options.physics:
            return
        if self.live is not None and self.live.running:
            return
        self._recordings[tracked] = Recording(self.motion.setup, tracked, busy=lambda: self.solving)
        self._recordings[tracked].start()

    def _forget_physics(self) -> None:
        for recording in self._recordings.values():
            recording.cancel()
        self._recordings.clear()
