"""MuJoCo's simulation of a motion, recorded in the background and available while it is computed."""

from __future__ import annotations

import threading
import time
from bisect import bisect_right
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from stc.records import dataclass
from stc.validate.replay import replay, stepping_for
from stc.validate.verdict import steering

if TYPE_CHECKING:
    import mujoco

    from stc.validate.setup import Setup
    from stc.validate.tracking import Feedback

FloatArray = npt.NDArray[np.float64]

#: States closer than this, in seconds, are not kept: no screen shows them apart.
_CLOSE = 5e-4

#: While something more urgent runs the recording looks up after so long, in seconds.
_NAP = 0.005


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """The simulation at an instant.

    Attributes:
        time: in seconds.
        qpos, qvel, act, ctrl, qfrc_applied: MuJoCo's arrays of these names.
    """

    time: float
    qpos: FloatArray
    qvel: FloatArray
    act: FloatArray
    ctrl: FloatArray
    qfrc_applied: FloatArray

    @staticmethod
    def of(data: mujoco.MjData) -> State:
        """A copy of the state of ``data``."""
        return State(
            float(data.time),
            data.qpos.copy(),
            data.qvel.copy(),
            data.act.copy(),
            data.ctrl.copy(),
            data.qfrc_applied.copy(),
        )

    def put(self, data: mujoco.MjData) -> None:
        """Write it into the first coordinates of ``data``, whose model may have further ones behind."""
        data.time = self.time
        for name in ("qpos", "qvel", "act", "ctrl", "qfrc_applied"):
            values = getattr(self, name)
            getattr(data, name)[: len(values)] = values


class Recording:
    """A replay in progress, or finished.

    Attributes:
        tracked: whether a feedback controller keeps the simulation near the solved motion.
        law: the controller of a tracked replay, ``LQR`` or ``PD``, once it is known.
        error: why the replay failed; empty otherwise.
        broke_at: time at which the simulation diverged, or None.
    """

    def __init__(self, setup: Setup, tracked: bool = False, busy: Callable[[], bool] | None = None) -> None:
        """Prepare, without starting.

        Args:
            setup: the motion and its model.
            tracked: whether feedback is to hold it on the solved motion.
            busy: function that says whether more urgent work is running, for which the recording waits.
        """
        self.tracked = tracked
        self.law = ""
        self.error = ""
        self.broke_at: float | None = None
        self._setup = setup
        self._busy = busy or (lambda: False)
        # Appended to by one thread and read by others: a list's append and its length are atomic.
        self._times: list[float] = []
        self._states: list[State] = []
        self._stop = threading.Event()
        self._done = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Simulate in a separate thread."""
        self._thread = threading.Thread(target=self.run, name="replay", daemon=True)
        self._thread.start()

    def run(self) -> None:
        """Simulate in this thread."""
        try:
            self._record()
        except Exception as error:  # it ends up on the watcher's screen: a thread has nobody else to tell
            self.error = " ".join(str(error).split()) or type(error).__name__
        finally:
            self._done.set()

    def cancel(self) -> None:
        """Ask it to end; it does within a time step."""
        self._stop.set()

    def wait(self, seconds: float | None = None) -> bool:
        """Wait until it has ended; returns whether it has."""
        return self._done.wait(seconds)

    @property
    def done(self) -> bool:
        """Whether the simulation has ended."""
        return self._done.is_set()

    @property
    def share(self) -> float:
        """The simulated share of the motion, 0 to 1."""
        times = self._times
        if not times:
            return 0.0
        length = self._setup.solution.duration
        return 1.0 if length <= 0.0 else min(1.0, (times[-1] - times[0]) / length)

    def at(self, instant: float) -> State | None:
        """The last state before an instant, or None if the simulation has not reached it."""
        count = len(self._times)
        k = bisect_right(self._times, instant + 1e-12, 0, count) - 1
        if k < 0:
            return None
        if k == count - 1 and instant > self._times[k] + 2.0 * _CLOSE and self.share < 1.0:
            return None
        return self._states[k]

    def positions(self, instants: FloatArray) -> FloatArray:
        """The simulated joint positions at given times, (k, nq); NaN for times that are not simulated yet."""
        found = np.full((len(instants), self._setup.compiled.nq), np.nan)
        for k, instant in enumerate(instants):
            state = self.at(float(instant))
            if state is not None:
                found[k] = state.qpos
        return found

    def _record(self) -> None:
        feedback: Feedback | None = None
        if self.tracked:
            laws = steering(self._setup)[1]
            if not laws:
                self.error = "the motion cannot be tracked: no actuator moves a single joint"
                return
            feedback, self.law = laws[0], laws[0].kind
        step, _, integrator = stepping_for(self._setup)
        done = replay(self._setup, step, integrator, feedback=feedback, watcher=self._keep)
        self.broke_at = done.broke_at

    def _keep(self, data: mujoco.MjData) -> bool:
        while self._busy() and not self._stop.is_set():
            time.sleep(_NAP)
        end = float(self._setup.solution.time[-1])
        if not self._times or data.time >= min(self._times[-1] + _CLOSE, end) - 1e-9:
            if np.all(np.isfinite(data.qpos)):
                self._states.append(State.of(data))
                self._times.append(float(data.time))
        return self._stop.is_set()
