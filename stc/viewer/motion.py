"""A solved motion prepared for display: the state of the model at any instant, and the forces."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from stc.solution import Solution
from stc.validate.pictures.motion import follow, solved_at, usual_places
from stc.validate.setup import Setup, prepare
from stc.viewer.physics import Recording, State
from stc.viewer.shapes import (
    FOUND,
    FRAME,
    JUMP,
    SOLVED,
    TORQUE,
    FloatArray,
    Shape,
    balls,
    force_arrow,
    line_of_action,
    polyline,
    torque_arc,
)

#: All paths together have at most so many points, and so many balls for frames.
_PATH_POINTS, _FRAME_BALLS = 120, 60

#: Sizes as shares of the model's extent: the longest force arrow, a torque's arc, a frame's ball, a path's radius.
_ARROW, _ARC, _BALL, _PATH = 0.6, 0.11, 0.008, 0.0025


class Motion:
    """A solution with its model.

    Attributes:
        solution: the motion.
        setup: the motion tied to its model.
        places: the points whose paths are drawn, as MuJoCo's array and the index in it.
        extent: the size of the model, in m.
    """

    def __init__(self, solution: Solution, beside: Iterable[str | Path] = ()) -> None:
        """Find the model and tie the motion to it.

        Raises:
            ModelError: there is no model, or a replay line does not fit it.
            SolutionError: time does not increase along the motion.
        """
        import mujoco

        self.solution = solution
        self.setup: Setup = prepare(solution, None, beside)
        self.extent = float(self.setup.compiled.stat.extent)
        self.places = _places(self.setup)
        self._forces = self.setup.all_forces
        self._model = self.setup.model()
        self._data = mujoco.MjData(self._model)
        self._wrench_scale = self._scale_of_forces()
        self._largest_torque = max(
            (
                float(np.max(np.abs(values)))
                for channel in self.setup.controls.channels
                for values in (channel.before, channel.after)
            ),
            default=0.0,
        )
        self._paths: tuple[FloatArray, list[Shape]] | None = None
        self._found_paths: tuple[Recording, float, list[Shape]] | None = None

    @property
    def start(self) -> float:
        """Time of the first frame, in seconds."""
        return float(self.solution.time[0])

    @property
    def end(self) -> float:
        """Time of the last frame, in seconds."""
        return float(self.solution.time[-1])

    @property
    def shape_key(self) -> tuple[tuple[str, float], ...]:
        """The fields set by the spec that change the appearance of the model: motions with the same key look alike."""
        seen = {path: value for path, value in self.setup.fields.items() if ".pos." in path}
        return tuple(sorted(seen.items()))

    def state(self, instant: float) -> State:
        """The solved motion at an instant; joints that are not tied stay where the model has them."""
        import mujoco

        setup, data = self.setup, mujoco.MjData(self._model)
        data.time = instant
        if self.solution.n:
            step, share = self._place(instant)
            at = np.array([share])
            setup.reference.put(data, [values[0] for values in setup.reference.in_step(step, at)[:2]])
            data.ctrl[setup.controls.addresses] = setup.controls.in_step(step, at)[0]
        else:
            setup.reference.put(data, setup.reference.at("after", 0)[:2])
        return State.of(data)

    def paths(self, offset: FloatArray) -> list[Shape]:
        """The solved paths with a ball at each frame (at every other, third ... one where there are many).

        Args:
            offset: (3,) displacement of the ghost, which follows them, in m.
        """
        if self._paths is None or not np.array_equal(self._paths[0], offset):
            self._paths = (offset, self._solved_paths(offset))
        return self._paths[1]

    def found_paths(self, recording: Recording) -> list[Shape]:
        """The simulated part of the paths."""
        known = self._found_paths
        share = recording.share
        if (
            known is None
            or known[0] is not recording
            or (share - known[1] >= 0.1)
            or (known[1] < share == 1.0)
        ):
            instants = np.linspace(self.start, self.end, self._points())
            positions = recording.positions(instants)
            reached = positions[np.isfinite(positions).all(axis=1)]
            shapes = [
                line
                for points in follow(self.setup, reached, self.places)
                for line in polyline(points, FOUND, _PATH * self.extent)
            ]
            known = self._found_paths = (recording, share, shapes)
        return known[2]

    def solved_forces(self, instant: float, offset: FloatArray) -> list[Shape]:
        """Torques and forces of the solution at an instant.

        Args:
            instant: seconds.
            offset: (3,) displacement of the ghost, on which they act, in m.
        """
        import mujoco

        if not self.solution.n:
            return []
        data = self._data
        self.state(instant).put(data)
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)
        step, share = self._place(instant)
        at = np.array([share])
        shapes: list[Shape] = []
        controls = self.setup.controls.in_step(step, at)[0]
        for actuator, value in zip(self.setup.controls.actuators, controls):
            shapes += self._actuator(actuator, float(value), offset)
        for place, wrench in self._forces.wrenches(self._forces.in_step(step, at)[0]):
            point = place.point(self._model, data) + offset
            tail = line_of_action(point, wrench[:3], wrench[3:])
            # Where hardly any force acts its line is far away: what is drawn stays at the body.
            if np.linalg.norm(tail - point) > 0.5 * self.extent:
                tail = point
            shapes += force_arrow(tail, wrench[:3], self._wrench_scale, self._longest, SOLVED)
        return shapes

    def found_forces(self, state: State) -> list[Shape]:
        """The forces of MuJoCo's contacts in a simulated state: one arrow per body, at the centre of pressure."""
        import mujoco

        model, data = self._model, self._data
        state.put(data)
        mujoco.mj_forward(model, data)
        acting: dict[int, tuple[FloatArray, FloatArray, float]] = {}
        local = np.zeros(6)
        for number in range(data.ncon):
            contact = data.contact[number]
            mujoco.mj_contactForce(model, data, number, local)
            force = local[:3] @ np.array(contact.frame).reshape(3, 3)
            for geom, sign in ((contact.geom[0], -1.0), (contact.geom[1], 1.0)):
                body = int(model.geom_bodyid[geom])
                if body:
                    total, moment, weight = acting.get(body, (np.zeros(3), np.zeros(3), 0.0))
                    size = float(np.linalg.norm(force))
                    acting[body] = (
                        total + sign * force,
                        moment + size * np.array(contact.pos),
                        weight + size,
                    )
        shapes: list[Shape] = []
        for total, moment, weight in acting.values():
            if weight > 0.0:
                shapes += force_arrow(moment / weight, total, self._wrench_scale, self._longest, FOUND)
        return shapes

    @property
    def _longest(self) -> float:
        return _ARROW * self.extent

    def _place(self, instant: float) -> tuple[int, float]:
        """The step that contains an instant, and the elapsed share of it."""
        time = self.solution.time
        step = int(np.clip(np.searchsorted(time, instant, side="right") - 1, 0, self.solution.n - 1))
        return step, float(np.clip((instant - time[step]) / (time[step + 1] - time[step]), 0.0, 1.0))

    def _points(self) -> int:
        return max(2, _PATH_POINTS // max(1, len(self.places)))

    def _solved_paths(self, offset: FloatArray) -> list[Shape]:
        solution, setup = self.solution, self.setup
        shapes: list[Shape] = []
        instants = np.linspace(self.start, self.end, self._points())
        for points in follow(setup, solved_at(setup, instants), self.places):
            shapes += polyline(points + offset, SOLVED, _PATH * self.extent)
        every = -(-(solution.n + 1) * len(self.places) // _FRAME_BALLS)
        frames = np.arange(0, solution.n + 1, max(1, every))
        jumps = set(solution.frames_that_jump().tolist())
        radius = _BALL * self.extent
        at_frames = follow(setup, solved_at(setup, solution.time[frames]), self.places)
        at_jumps = follow(setup, solved_at(setup, solution.time[sorted(jumps)]), self.places) if jumps else []
        for points in at_frames:
            shapes += balls(points + offset, FRAME, radius)
        for points in at_jumps:
            shapes += balls(points + offset, JUMP, 1.8 * radius)
        return shapes

    def _actuator(self, actuator: int, value: float, offset: FloatArray) -> list[Shape]:
        """A motor's torque as an arc around its hinge, its force as an arrow along its slide."""
        import mujoco

        model, data = self._model, self._data
        transmissions = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
        if model.actuator_trntype[actuator] not in transmissions or not self._largest_torque > 0.0:
            return []
        joint = int(model.actuator_trnid[actuator, 0])
        share = value / self._largest_torque
        anchor, axis = data.xanchor[joint] + offset, data.xaxis[joint]
        body, kinds = int(model.jnt_bodyid[joint]), mujoco.mjtJoint
        if model.jnt_type[joint] in (int(kinds.mjJNT_BALL), int(kinds.mjJNT_FREE)):
            return self._turning(actuator, anchor, data.xmat[body].reshape(3, 3), share)
        if model.jnt_type[joint] == kinds.mjJNT_HINGE:
            return list(torque_arc(anchor, axis, share, _ARC * self.extent, TORQUE))
        return force_arrow(data.xipos[body] + offset, axis * share, self._longest, self._longest, TORQUE)

    def _turning(self, actuator: int, anchor: FloatArray, frame: FloatArray, share: float) -> list[Shape]:
        """The torque of a motor on a ball or free joint about the axis of its gear, its force along it."""
        import mujoco

        model, gear = self._model, self._model.actuator_gear[actuator]
        joint = int(model.actuator_trnid[actuator, 0])
        free = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE
        force, torque = (gear[:3], gear[3:6]) if free else (np.zeros(3), gear[:3])
        if model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_JOINTINPARENT and not free:
            parent = int(model.body_parentid[model.jnt_bodyid[joint]])
            frame = self._data.xmat[parent].reshape(3, 3)
        shapes: list[Shape] = []
        if torque.any():
            axis = frame @ (torque / np.linalg.norm(torque))
            shapes += torque_arc(anchor, axis, share, _ARC * self.extent, TORQUE)
        if force.any():
            way = share * force / np.linalg.norm(force)
            shapes += force_arrow(anchor, way, self._longest, self._longest, TORQUE)
        return shapes

    def _scale_of_forces(self) -> float:
        """Metres of arrow per newton: the largest force of the motion gets the longest arrow."""
        largest = 0.0
        for part in ("before", "after"):
            for frame in range(self.solution.n + 1):
                for _, wrench in self._forces.wrenches(self._forces.at(part, frame)):
                    largest = max(largest, float(np.linalg.norm(wrench[:3])))
        if largest > 0.0:
            return self._longest / largest
        weight = float(np.sum(self._model.body_mass)) * float(np.linalg.norm(self._model.opt.gravity))
        return self._longest / (2.0 * weight) if weight > 0.0 else 0.0


def _places(setup: Setup) -> list[tuple[str, int]]:
    """The points that the spec compares, or else the outermost bodies, and those that touch the ground or are
    pushed.
    """
    found = dict.fromkeys(usual_places(setup))
    forces = setup.all_forces
    for place, _ in forces.wrenches(np.zeros(len(forces))):
        found.setdefault((place.array, place.index))
    return list(found)
