"""The result of a solve: a :class:`Solution` can be inspected, replayed, resampled and used as a starting point.

A :class:`Solution` is complete: it contains the text of its spec, the constants, the node values of every variable and
derivative, the multipliers, and the inputs of a replay.  It holds numbers only and no expressions.

:meth:`Solution.save` and :func:`read` keep it in a file (see :mod:`stc.solution_file` for the layout).
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from hashlib import sha256
from importlib import import_module
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from stc.errors import SolutionError, StcError, UsageError
from stc.recorded_files import RecordedFile
from stc.records import dataclass, field
from stc.trajectory import METHODS, Channel, FloatArray, IntArray, Places, places, places_by_index, sample
from stc.version import __version__

Side = Literal["before", "after"]
Path = str | os.PathLike[str]

STATUSES = (
    "optimal",
    "infeasible",
    "unbounded",
    "iteration_limit",
    "time_limit",
    "interrupted",
    "failed",
)


class UnknownNameError(StcError, KeyError):
    """A name that the solution does not have; the message suggests the closest one."""

    def __str__(self) -> str:
        return str(self.args[0])


@dataclass(frozen=True, slots=True, eq=False)
class ReplayChannel:
    """One line of the spec's ``replay:`` section with its expression evaluated at the nodes.

    Attributes
    ----------
    kind : str
        ``joint``, ``actuator``, ``apply``, ``contact``, ``compare`` or ``set``.
    path : tuple[str, ...]
        The dotted name on the left of the line, such as ``("body", "particle", "mass")``.
    value : Channel
        Node values.
    rate : Channel | None
        Node values of the first time derivative (joints: the velocity), where it is known.
    acceleration : Channel | None
        Node values of the second time derivative, where it is known.
    """

    kind: str
    path: tuple[str, ...]
    value: Channel
    rate: Channel | None = None
    acceleration: Channel | None = None

    @property
    def name(self) -> str:
        """The path as it is written, with dots."""
        return ".".join(self.path)


@dataclass(frozen=True, slots=True, eq=False)
class MultiplierBlock:
    """The multipliers of one statement of the spec, or of one link between a variable and its derivative.

    Attributes
    ----------
    kind : str
        ``row`` (a constraint), ``link`` (a defect of the transcription) or ``bound``.
    label : str
        The statement's text, or for bounds and links the name with its primes.
    nodes : FloatArray
        (k,) frame index of each instance, a half more at midpoints.
    sides : npt.NDArray[np.int8]
        (k,) -1 for the value before a jump, 1 for the one after it, 0 where nothing jumps.
    values : FloatArray
        (k,) multipliers: positive where an upper bound holds the solution back, negative at a lower.
    """

    kind: str
    label: str
    nodes: FloatArray
    sides: npt.NDArray[np.int8]
    values: FloatArray


def _no_numbers() -> FloatArray:
    return np.zeros(0)


@dataclass(slots=True, eq=False, kw_only=True, repr=False)
class Solution:
    """A motion: the node values of a solved spec, and how they were found.

    Shapes are for n steps, that is n+1 frames; N unknowns and M rows are those of the nonlinear program.

    Attributes
    ----------
    name : str
        Name of the spec.
    source : str
        The spec's whole text.
    directory : str
        Folder that the spec was read from (where its model is looked up), or "" if there is none.
    constants : Mapping[str, float]
        Value of every constant, overrides applied.
    overrides : Mapping[str, float]
        The constants given by the caller.
    method : str
        ``central``, ``trapezoidal``, ``hermite-simpson`` or ``stepping``.
    time : FloatArray
        (n+1,) time of each frame, in seconds.
    trajectories : Mapping[tuple[str, int], Channel]
        Node values per (variable, order of the derivative); orders of one variable start at 0
        and have no gap.  Under ``central`` a derivative whose stencil does not fit at a frame holds the
        value of the nearest frame where it does.
    derived : frozenset[tuple[str, int]]
        The trajectories that are computed from others (the rates of quaternions), besides all derivatives
        under ``central``.
    parameters : Mapping[str, float]
        Value of every parameter.
    status : str
        How the solve ended, one of :data:`STATUSES`.
    message : str
        The same in words.
    objective : float
        Value of the objective.
    violation : float
        Largest violation of a row or bound, each divided by max(1, |bound|).
    optimality : float
        The first-order optimality error that the solver stopped with.
    iterations : int
        Number of iterations.
    factorizations : int
        Number of factorised KKT systems, inner loops included.
    strategy : str
        The last strategy of the solver, which found the answer if there is one; empty after reading a file.
    optimizer : str
        Name of the optimizer.
    seconds : Mapping[str, float]
        Wall time by stage (``parse``, ``derive``, ``compile``, ``solve``, ``total``), and ``processor``: the
        processor time of the thread that solved, both in seconds.
    x : FloatArray
        (N,) the unknowns as the solver ordered them.
    row_multipliers : FloatArray
        (M,) multipliers of the rows in the solver's order.
    bound_multipliers : FloatArray
        (N,) multipliers of the bounds in the solver's order.
    multipliers : Sequence[MultiplierBlock]
        The same multipliers by statement.
    model : str | None
        File name of the MuJoCo model as the spec writes it, or None.
    additions : Sequence[str]
        What the spec adds to the model, in words of :data:`stc.model_source.ADDITIONS`.
    replay : Sequence[ReplayChannel]
        The evaluated ``replay:`` section.
    force_frames : tuple[int, int] | None
        First and last frame at which the equations of motion hold; at other frames a replay uses the
        forces of the nearest of them.  Found from the equations of the spec; by default all frames, and for
        ``central`` with second or higher derivatives the frames where the widest stencil fits.
    files : Sequence[RecordedFile]
        The files of the model as they were when the motion was solved; those of a model that only the replay has
        are added when the solution is saved.
    data : Sequence[RecordedFile]
        The complete data files that the spec reads, as they were when it was solved.
    outside : Sequence[str]
        A note for each table that the motion uses outside of its numbers; computed.
    sha256 : str
        Hash of ``source`` (hexadecimal); computed.
    stc_version : str
        Version of stc that solved the motion.
    origin : Any
        The :class:`stc.pipeline.Model` that solved it; None after reading a file.

    Raises
    ------
    SolutionError
        Shapes, method or status contradict each other.
    """

    name: str
    source: str
    constants: Mapping[str, float]
    method: str
    time: FloatArray
    trajectories: Mapping[tuple[str, int], Channel]
    status: str
    directory: str = ""
    overrides: Mapping[str, float] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    message: str = ""
    objective: float = float("nan")
    violation: float = float("nan")
    optimality: float = float("nan")
    iterations: int = 0
    factorizations: int = 0
    optimizer: str = "sqp"
    seconds: Mapping[str, float] = field(default_factory=dict)
    x: FloatArray = field(default_factory=_no_numbers)
    row_multipliers: FloatArray = field(default_factory=_no_numbers)
    bound_multipliers: FloatArray = field(default_factory=_no_numbers)
    multipliers: Sequence[MultiplierBlock] = ()
    model: str | None = None
    additions: Sequence[str] = ()
    replay: Sequence[ReplayChannel] = ()
    strategy: str = ""
    force_frames: tuple[int, int] | None = None
    files: Sequence[RecordedFile] = ()
    data: Sequence[RecordedFile] = ()
    outside: Sequence[str] = ()
    derived: frozenset[tuple[str, int]] = frozenset()
    sha256: str = ""
    stc_version: str = ""
    origin: Any = None

    @property
    def is_sketch(self) -> bool:
        """Whether the motion was found by time stepping, which is of first order and shows the order of contacts."""
        return self.method == "stepping"

    @property
    def unknowns(self) -> list[tuple[str, int]]:
        """The keys of the trajectories that were unknowns of the program."""
        central = self.method == "central"
        return [key for key in self.trajectories if not (key in self.derived or (central and key[1]))]

    def __post_init__(self) -> None:
        self.time = np.array(self.time, dtype=np.float64)
        if self.time.ndim != 1 or not len(self.time):
            raise SolutionError("the times of the frames must be a list of at least one number")
        if self.method not in METHODS:
            raise SolutionError(f"unknown method {self.method!r}; known are {', '.join(METHODS)}")
        if self.status not in STATUSES:
            raise SolutionError(f"unknown status {self.status!r}; known are {', '.join(STATUSES)}")
        for (variable, order), channel in self.trajectories.items():
            self._check_channel(variable + "'" * order, channel)
            if order and (variable, order - 1) not in self.trajectories:
                raise SolutionError(f"{variable}{chr(39) * order} is given without the derivative below it")
        for line in self.replay:
            for part in (line.value, line.rate, line.acceleration):
                if part is not None:
                    self._check_channel(f"{line.kind} {line.name}", part)
        for key in ("constants", "overrides", "parameters", "seconds"):
            setattr(self, key, {name: float(value) for name, value in getattr(self, key).items()})
        for key in ("objective", "violation", "optimality"):
            setattr(self, key, float(getattr(self, key)))
        for key in ("x", "row_multipliers", "bound_multipliers"):
            setattr(self, key, np.array(getattr(self, key), dtype=np.float64))
        self.iterations, self.factorizations = int(self.iterations), int(self.factorizations)
        self.sha256 = sha256(self.source.encode()).hexdigest()
        if not self.stc_version:
            self.stc_version = __version__
        if self.force_frames is None:
            self.force_frames = self._frames_with_forces()

    def __getstate__(self) -> tuple[None, dict[str, Any]]:
        """The state for a copy or another process: everything except the model, whose compiled code stays in this
        process.

        :meth:`resolve` reads the spec again there, as for a solution from a file.
        """
        kept = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return None, {**kept, "origin": None}

    def __repr__(self) -> str:
        return (
            f"<Solution of {self.name}: {self.status}, {self.method}, n = {self.n}, {self.duration:.6g} s, "
            f"objective {self.objective:.9g}>"
        )

    def _check_channel(self, label: str, channel: Channel) -> None:
        frames = (self.n + 1,)
        if channel.before.shape != frames or channel.after.shape != frames:
            raise SolutionError(f"{label} has {channel.before.shape} values on {self.n + 1} frames")
        if channel.mid is None and self.method == "hermite-simpson" and self.n:
            raise SolutionError(f"{label} has no values at the midpoints, which {self.method} needs")
        if channel.mid is not None and self.method != "hermite-simpson":
            raise SolutionError(f"{label} has values at midpoints, which {self.method} does not know")
        if channel.mid is not None and channel.mid.shape != (self.n,):
            raise SolutionError(f"{label} has {channel.mid.shape} values at {self.n} midpoints")

    def _frames_with_forces(self) -> tuple[int, int]:
        highest = max((order for _, order in self.trajectories), default=0)
        reach = (highest + 1) // 2 if self.method == "central" and highest > 1 else 0
        reach = min(reach, self.n // 2)
        return reach, self.n - reach

    @property
    def n(self) -> int:
        """Index of the last frame: the number of steps."""
        return len(self.time) - 1

    @property
    def duration(self) -> float:
        """Time from the first frame to the last, in seconds."""
        return float(self.time[-1] - self.time[0])

    @property
    def variables(self) -> list[str]:
        """The variables' names in the order of the spec."""
        return [name for name, order in self.trajectories if order == 0]

    @property
    def names(self) -> list[str]:
        """All names that ``solution[name]`` accepts: variables, their derivatives, parameters."""
        return [v + "'" * order for v, order in self.trajectories] + list(self.parameters)

    def __getitem__(self, name: str) -> Any:
        """A parameter's value, or (n+1,) values of a variable or derivative (``"x''"``) at the frames, in the units of
        the spec.

        At a jump this is the value after it; see :attr:`before`.

        Raises
        ------
        UnknownNameError
            The solution has no such name.
        """
        if name in self.parameters:
            return self.parameters[name]
        return self.channel(name).after

    def __contains__(self, name: object) -> bool:
        return name in self.parameters or _key(name) in self.trajectories

    def channel(self, name: str) -> Channel:
        """All node values of a variable or derivative: before and after every frame, and at the midpoints.

        Parameters
        ----------
        name : str
            Such as ``"x"`` or ``"x'"``.

        Returns
        -------
        Channel
            ``before`` and ``after``, (n+1,) each, and ``mid``, (n,) for hermite-simpson and otherwise None.

        Raises
        ------
        UnknownNameError
            The solution has no such name.
        """
        key = _key(name)
        if key in self.trajectories:
            return self.trajectories[key]
        raise UnknownNameError(self._unknown(name))

    def _unknown(self, name: object) -> str:
        name = str(name)
        base = name.rstrip("'")
        orders = [order for variable, order in self.trajectories if variable == base]
        if orders:
            known = ", ".join(base + "'" * order for order in sorted(orders))
            return f"the solution of {self.name} has no {name}: no such derivative is used (it has {known})"
        if base in self.parameters:
            return f"{base} is a parameter of {self.name}; it has no derivative"
        from difflib import get_close_matches

        names = [*self.variables, *self.parameters]
        near = get_close_matches(base, names, n=1)
        primes = name[len(base) :] if near and near[0] not in self.parameters else ""
        hint = f"did you mean {near[0]}{primes}?" if near else f"it has {', '.join(names) or 'no names'}"
        return f"the solution of {self.name} has no {name}; {hint}"

    @property
    def before(self) -> Mapping[str, FloatArray]:
        """Values at the frames, (n+1,) each; at a jump, the value before it."""
        return _SideView(self, "before")

    @property
    def after(self) -> Mapping[str, FloatArray]:
        """Values at the frames, (n+1,) each; at a jump, the value after it."""
        return _SideView(self, "after")

    def at(self, t: npt.ArrayLike, side: Side = "after") -> dict[str, Any]:
        """The motion at any time, by the method's own polynomials (see :mod:`stc.trajectory`).

        Parameters
        ----------
        t : npt.ArrayLike
            A time within the motion, in seconds, or an array of times.
        side : Side
            ``"before"`` or ``"after"``: the value to take at a jump.

        Returns
        -------
        dict[str, Any]
            The value of every variable, derivative and parameter by name: a float for a scalar ``t``, otherwise an
            array of the shape of ``t`` (parameters are always floats).

        Raises
        ------
        UsageError
            A time is outside of the motion, or not a number.
        SolutionError
            The times do not increase (a solve that failed with a free duration).
        """
        self.require_increasing_times()
        instants = _as_numbers(t, "a time is a number of seconds")
        flat = instants.reshape(-1)
        first, last = float(self.time[0]), float(self.time[-1])
        slack = 1e-9 * max(1.0, self.duration)
        outside = ~((flat >= first - slack) & (flat <= last + slack))
        if np.any(outside):
            raise UsageError(f"time {flat[outside][0]:g} s is outside of the motion, {first:g} to {last:g} s")
        where = places(self.time, np.clip(flat, first, last), _checked(side))
        return self._sample(where, instants.shape, side)

    def at_frame(self, index: npt.ArrayLike, side: Side = "after") -> dict[str, Any]:
        """The motion at a frame index, which may be fractional (2.5: halfway in step 2).

        Use this to resample a motion to another number of frames: phases and jumps keep their share of the frames even
        if the durations of the steps differ.

        Parameters
        ----------
        index : npt.ArrayLike
            Between 0 and n, or an array of such numbers.
        side : Side
            ``"before"`` or ``"after"``: the value to take at a jump.

        Returns
        -------
        dict[str, Any]
            As :meth:`at`.

        Raises
        ------
        UsageError
            An index outside 0..n, or not a number.
        """
        indices = _as_numbers(index, "a frame is given by its index")
        flat = indices.reshape(-1)
        outside = ~((flat >= -1e-9) & (flat <= self.n + 1e-9))
        if np.any(outside):
            raise UsageError(f"frame {flat[outside][0]:g} is outside of the motion, 0 to {self.n}")
        where = places_by_index(self.n, np.clip(flat, 0, self.n), _checked(side))
        return self._sample(where, indices.shape, side)

    def require_increasing_times(self) -> None:
        """Raise a :class:`SolutionError` unless every step takes a positive time."""
        steps = np.diff(self.time)
        if not np.all(steps > 0.0):
            first = int(np.flatnonzero(~(steps > 0.0))[0])
            raise SolutionError(
                f"the time does not increase along the solution of {self.name} (status {self.status}): "
                f"step {first} takes {steps[first]:g} s"
            )

    def _sample(self, where: Places, shape: tuple[int, ...], side: Side) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for variable in self.variables:
            for order, values in sample(self.method, self._orders(variable), self.time, where, side).items():
                found[variable + "'" * order] = values.reshape(shape) if shape else float(values[0])
        found.update(self.parameters)
        return found

    def _orders(self, variable: str) -> dict[int, Channel]:
        return {order: channel for (name, order), channel in self.trajectories.items() if name == variable}

    def frames_that_jump(self) -> IntArray:
        """Indices of the frames at which a variable or derivative has two different values."""
        mask = np.zeros(self.n + 1, dtype=bool)
        for channel in self.trajectories.values():
            mask |= channel.before != channel.after
        return np.flatnonzero(mask)

    def resolve(self, **changes: Any) -> Solution:
        """Solve the same spec again with other constants, starting from this solution and its multipliers.

        If only numbers change, nothing is parsed, differentiated or compiled again.  If the number of frames or the
        method changes, the motion and its multipliers are resampled.  For a solution from a file, the spec is parsed
        once from the text in the file.

        Parameters
        ----------
        **changes : Any
            Values of constants such as ``g=1.62``, and other arguments of :meth:`stc.pipeline.Model.solve`.

        Returns
        -------
        Solution
            The new solution, whatever its status is.

        Raises
        ------
        SpecError, UsageError
            As :meth:`stc.pipeline.Model.solve`.
        """
        # By name: nothing here is imported from the layers above.
        return import_module("stc.solution_origin").resolve(self, **changes)

    def grid_error(self) -> Any:
        """The estimated discretisation error; see :func:`stc.studies.grid_error.grid_error`."""
        # By name: nothing here is imported from the layers above.
        return import_module("stc.studies.grid_error").grid_error(self)

    def ringing(self) -> Any:
        """The controls that alternate from node to node; see :func:`stc.studies.ringing.ringing`."""
        return import_module("stc.studies.ringing").ringing(self)

    def complementarity(self) -> Any:
        """How well complementary pairs are met, and the kind of stationary point; see
        :func:`stc.studies.complementarity.complementarity`.
        """
        return import_module("stc.studies.complementarity").complementarity(self)

    def uncertainty(self) -> Any:
        """The standard errors of estimated parameters: a :class:`stc.studies.uncertainty.Uncertainty`.

        Raises
        ------
        UsageError
            The solution is not optimal, or the objective is not a sum of squares over rows of data.
        """
        # By name: nothing here is imported from the layers above.
        return import_module("stc.studies.uncertainty").of_solution(self)

    def to_dataframe(self, times: npt.ArrayLike | None = None) -> Any:
        """The motion as a pandas data frame: a row for each time, a column for each variable and derivative.

        Parameters
        ----------
        times : npt.ArrayLike | None
            In seconds; the frames where none are given (at a jump, the values after it).

        Returns
        -------
        Any
            A ``pandas.DataFrame`` with the index ``time``; spec, status, objective and parameters are in its ``attrs``.

        Raises
        ------
        UsageError
            Pandas is not installed, or a time is outside of the motion.
        """
        # By name: nothing here is imported from the layers above.
        return import_module("stc.notebooks").dataframe(self, times)

    def to_xarray(self, times: npt.ArrayLike | None = None) -> Any:
        """The motion as an xarray data set along ``time``; parameters are scalars in it.

        Parameters
        ----------
        times : npt.ArrayLike | None
            In seconds; the frames where none are given (at a jump, the values after it).

        Returns
        -------
        Any
            An ``xarray.Dataset``; spec, status and objective are in its ``attrs``.

        Raises
        ------
        UsageError
            Xarray is not installed, or a time is outside of the motion.
        """
        return import_module("stc.notebooks").dataset(self, times)

    def _repr_html_(self) -> str:
        return str(import_module("stc.notebooks").of_solution(self))

    def save(self, path: Path) -> None:
        """Write the solution to a file, ``.npz`` (NumPy arrays) or ``.csv`` (text), both complete.

        The file is written under another name and then renamed, so that a reader never sees a partial file.

        Parameters
        ----------
        path : Path
            The file; its suffix selects the format.

        Raises
        ------
        UsageError
            Another suffix.
        OSError
            The file cannot be written.
        """
        import_module("stc.solution_file").write(self, path)


def read(path: Path) -> Solution:
    """Read a solution that :meth:`Solution.save` wrote.

    The file holds the unknowns; times, curves and the inputs of a replay are computed from them and the spec's text.

    Parameters
    ----------
    path : Path
        An ``.npz`` or ``.csv`` file.

    Returns
    -------
    Solution
        The solution, with the files of its model in ``files``.

    Raises
    ------
    UsageError
        No such file, or a suffix other than ``.npz`` and ``.csv``.
    SolutionError
        The file is damaged, is not a solution, comes from a newer version, or contradicts its own text.
    """
    # By name: nothing here is imported from the layers above.
    found: Solution = import_module("stc.solution_restated").read(path)
    return found


class _SideView(Mapping[str, FloatArray]):
    """The frame values of one side, by name."""

    def __init__(self, solution: Solution, side: Side) -> None:
        self._solution = solution
        self._side = side

    def __getitem__(self, name: str) -> FloatArray:
        channel = self._solution.channel(name)
        return channel.before if self._side == "before" else channel.after

    def __iter__(self) -> Iterator[str]:
        return (variable + "'" * order for variable, order in self._solution.trajectories)

    def __len__(self) -> int:
        return len(self._solution.trajectories)


def _checked(side: Side) -> Side:
    if side not in ("before", "after"):
        raise UsageError(f"side must be 'before' or 'after', not {side!r}")
    return side


def _as_numbers(given: npt.ArrayLike, wanted: str) -> FloatArray:
    try:
        return np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise UsageError(f"{wanted}, or an array, not {given!r}") from None


def _key(name: object) -> tuple[str, int]:
    text = str(name)
    base = text.rstrip("'")
    return base, len(text) - len(base)
