"""Solve until MuJoCo agrees: solve, replay, add frames where the replay disagrees, and repeat.

Every round is judged by the drift of the replay: open loop, or with feedback if small errors grow along the motion.
Motions on the ground are judged by the replay in which the solved contact forces act, and then by the one with the
simulator's own contacts: tracked, or open loop where small errors hardly grow or no feedback can act.  To find the
steps with the largest errors, each step is simulated alone from the solved state (:mod:`stc.validate.steps`).

More frames do not correct every error.  Wrong equations of motion are detected after the first solve; other reasons
(contacts softer than rigid ones, a drift that does not decrease, no more frames or time) are given in the message.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from stc.arguments import number, whole
from stc.errors import StcError, UsageError
from stc.pipeline import Model
from stc.records import dataclass, field
from stc.solution import Solution
from stc.studies.effort import Clock, Effort
from stc.studies.finer import solve_finer
from stc.studies.frames import SAFETY, Spread, growth_for, in_shares, observed_order
from stc.validate import limits
from stc.validate.certificate.causes import beyond_limits
from stc.validate.inverse import inverse_dynamics
from stc.validate.metrics import drift as drift_of
from stc.validate.replay import Replay
from stc.validate.steps import step_errors
from stc.validate.verdict import Replays, open_setup, run_replays

if TYPE_CHECKING:
    from stc.studies.equation_report import EquationReport
    from stc.validate.setup import Setup

__all__ = ["Round", "Verification", "solve_until_verified"]

MOST_ROUNDS = 10
MOST_FRAMES = 20_000
NO_FALL = 0.7
"""The search stops if, with more frames, the drift is not below this share of the last one."""
SURELY_WRONG = 1e-6
"""An inverse-dynamics residual above this share is not a rounding error, even if the equations agree."""
SOLVER_SHARE, LOOSEST, TIGHTEST = 1e-4, 1e-8, 1e-12
"""The solver's tolerance as a share of the drift's, and the range that it is kept in."""


@dataclass(frozen=True, slots=True)
class Round:
    """One solve and its replay.

    Attributes
    ----------
    n : int
        Number of steps.
    phases : list[int]
        Number of steps in each phase with a frame count of its own.
    status, objective, iterations, factorizations
        Results of the solve.
    judged_by : str
        ``open loop``, ``tracked`` or ``contact forces`` (solved ones in place of the simulator's contacts);
        empty without a replay.
    drift : float
        Largest distance of a joint or output from the solved one over the frames, in m or rad.
    subject : str
        The joint or output with this distance.
    step_error : float
        The sum of the errors of all steps, each simulated alone, in m and rad.
    seconds : float
        Wall time of the solve.
    """

    n: int
    phases: list[int]
    status: str
    objective: float
    iterations: int
    factorizations: int
    judged_by: str
    drift: float
    subject: str
    step_error: float
    seconds: float


@dataclass(slots=True)
class Verification:
    """The result of :func:`solve_until_verified`.

    Attributes
    ----------
    tolerance : float
        Tolerance of the drift, in m and rad.
    rounds : list[Round]
        The rounds in order.
    solution : Solution | None
        The last optimal solution (that of the first solve if it was not optimal).
    equations : EquationReport | None
        The comparison of the equations of motion, if it was made.
    effort : Effort
        Totals of all solves.
    message : str
        Why the tolerance was not reached; empty if it was.
    """

    tolerance: float
    rounds: list[Round] = field(default_factory=list)
    solution: Solution | None = None
    equations: EquationReport | None = None
    effort: Effort = field(default_factory=Effort)
    message: str = ""

    @property
    def verified(self) -> bool:
        """Whether MuJoCo's motion is the solved one within the tolerance."""
        return not self.message

    def to_dict(self) -> dict[str, Any]:
        """The result for JSON."""
        return {
            "tolerance": self.tolerance,
            "verified": self.verified,
            "solves": self.effort.solves,
            "rounds": [asdict(one) for one in self.rounds],
        }


def solve_until_verified(
    model: Model,
    drift: float,
    *,
    solve: Callable[..., Solution] | None = None,
    on_round: Callable[[Round], None] | None = None,
    start: Solution | None = None,
    most_frames: int = MOST_FRAMES,
    **options: Any,
) -> Verification:
    """Add frames until the replay's drift is below a tolerance, or report why that is not possible.

    Parameters
    ----------
    model : Model
        The spec, with a ``replay:`` section; its n is that of the first solve.
    drift : float
        Tolerance of the replay's drift, in m and rad.
    solve : Callable[..., Solution] | None
        Function to use in place of ``model.solve``, with the same arguments (to watch it).
    on_round : Callable[[Round], None] | None
        Called with the record of every round.
    start : Solution | None
        A solution of the first problem, if there is one already; it is not solved again.
    most_frames : int
        Largest number of frames.
    **options : Any
        Arguments of :meth:`stc.pipeline.Model.solve`; a time limit applies to all solves and replays
        together.

    Returns
    -------
    Verification
        The rounds, with the last optimal solution.

    Raises
    ------
    UsageError
        A tolerance that is not positive, a motion of one frame, or a spec that names no model.
    ModelError
        The model is missing, or a replay line does not fit it.
    SpecError, EvaluationError
        Mistakes in the spec, or a start where a function is undefined.
    """
    drift, most_frames = number(drift, "the drift"), whole(most_frames, "most_frames")
    if not drift > 0:
        raise UsageError(f"the tolerance for the drift must be positive, not {drift:g}")
    if solve is None:
        model = in_shares(model, options.get("method"), **options.get("constants", {}))
        solve = model.solve
    constants = dict(options.pop("constants", {}))
    clock = Clock(options.pop("time_limit", None))
    if options.get("tolerance") is None:
        options["tolerance"] = min(LOOSEST, max(TIGHTEST, SOLVER_SHARE * drift))
    method = options.get("method")
    spread = Spread.of(model, method, constants)
    if spread.problem.model is None:
        raise UsageError(
            f"{spread.problem.name} names no model", "a `replay:` section ties a spec to its model"
        )
    found = Verification(drift)
    factors = np.ones(len(spread.ends), int)
    overrides: dict[str, float] = {}
    while True:
        given = {**options, "constants": {**constants, **overrides}}
        if found.solution is not None:
            solution = solve_finer(solve, found.solution, given, clock, found.effort)
        elif start is not None:
            solution = start
        else:
            solution = solve(**given, **clock.option())
            found.effort.add(solution)
        counts = factors * np.array(spread.lengths)
        good = solution.status == "optimal"
        judged = _Judged.of(solution) if good else None
        found.rounds.append(_round(solution, counts, judged))
        if good or found.solution is None:
            found.solution = solution
        if on_round is not None:
            on_round(found.rounds[-1])
        if judged is None:
            found.message = f"with n = {solution.n} the solve ended {solution.status}"
            return found
        if len(found.rounds) == 1:
            found.message = _wrong_physics(found, solution, judged)
            if found.message:
                return found
        found.message = _in_the_way(found, judged, clock)
        if found.message or judged.drift <= drift:
            return found
        wanted = _wanted(found, counts, factors, judged, solution.method)
        if int(wanted @ spread.lengths) > most_frames:
            state = _state(found.rounds[-1])
            found.message = f"a drift of {drift:g} would take more than {most_frames} frames; {state}"
            return found
        try:
            overrides = spread.finer([int(k) for k in wanted])
        except UsageError as reason:
            found.message = f"{_state(found.rounds[-1])}, and {reason}"
            return found
        factors = np.array(spread.counts(overrides)) // np.array(spread.lengths)


@dataclass(frozen=True, slots=True)
class _Judged:
    """The judgement of a solution by MuJoCo.

    Attributes:
        replays: the simulations.
        by: the one that is decisive.
        drift, subject: the largest drift in it, and its joint or output.
        ground: the largest drift with the simulator's own contacts, its subject, and whether feedback was used (if
            small errors grow and actuators can steer); None without contacts.
        steps: (n,) error of each step alone.
    """

    replays: Replays
    by: str
    drift: float
    subject: str
    ground: tuple[float, str, bool] | None
    steps: np.ndarray

    @classmethod
    def of(cls, solution: Solution) -> _Judged:
        setup = open_setup(solution)
        replays = run_replays(setup)
        by, motion = "open loop", replays.open_loop
        ground = None
        if replays.external is not None:
            by, motion = "contact forces", replays.external
            # Feedback hides what the contacts do not give; where errors hardly grow the open loop tells it.
            steady = replays.growth is not None and replays.growth < limits.UNSTABLE_GROWTH
            steered = None if steady else replays.tracked
            ground = (*_largest(setup, steered or replays.open_loop), steered is not None)
        elif (replays.growth or 1.0) >= limits.UNSTABLE_GROWTH and replays.tracked is not None:
            by, motion = "tracked", replays.tracked
        return cls(replays, by, *_largest(setup, motion), ground, step_errors(setup))


def _largest(setup: Setup, motion: Replay) -> tuple[float, str]:
    """The largest drift of a replay, and its subject."""
    drifts = {f"joint {tie.name}": drift_of(tie.distances(motion.positions))[0] for tie in setup.ties}
    for k, output in enumerate(setup.outputs):
        drifts[f"output {output.line.name}"] = drift_of(output.distances(motion.outputs[:, k]))[0]
    subject = max(drifts, key=lambda name: drifts[name])
    return drifts[subject], subject


def _round(solution: Solution, counts: np.ndarray, judged: _Judged | None) -> Round:
    return Round(
        n=solution.n,
        phases=[int(k) for k in counts],
        status=solution.status,
        objective=solution.objective,
        iterations=solution.iterations,
        factorizations=solution.factorizations,
        judged_by=judged.by if judged else "",
        drift=judged.drift if judged else math.nan,
        subject=judged.subject if judged else "",
        step_error=float(judged.steps.sum()) if judged else math.nan,
        seconds=solution.seconds.get("total", 0.0),
    )


def _wrong_physics(found: Verification, solution: Solution, judged: _Judged) -> str:
    """Why more frames would not help, in words, or "".

    The solved forces have to give the solved accelerations in MuJoCo, instant by instant.  Where they do not, or where
    that cannot be said, the equations of motion are compared term by term.
    """
    setup = judged.replays.setup
    beyond = beyond_limits(setup)
    if beyond and judged.drift > found.tolerance:
        return f"{beyond[0]}, which more frames cannot correct"
    inverse = inverse_dynamics(setup)
    shares = None if inverse is None else inverse.share(inverse.at_nodes)
    if inverse is not None and shares is not None and np.all(shares <= inverse.limits(solution.method)):
        return ""
    from stc.studies.along import equations_along

    try:
        found.equations = equations_along(solution, str(setup.path))
    except StcError:  # the spec's rows are no equations of motion at random states: the drift has to tell
        found.equations = None
    if found.equations is not None and found.equations.findings:
        return (
            "the equations of motion differ from the model's, which more frames cannot correct: "
            f"{found.equations.findings[0]}"
        )
    if shares is not None and float(shares.max()) > SURELY_WRONG:
        worst = setup.reference.dofs[int(shares.argmax())]
        return (
            f"the solved forces do not give the solved accelerations in the model: at joint {worst} "
            f"{float(shares.max()):.2g} of the largest force is missing, which more frames cannot correct; compare the "
            "lines of the replay section with the model"
        )
    return ""


def _in_the_way(found: Verification, judged: _Judged, clock: Clock) -> str:
    """Why the drift is above the tolerance, as far as the rounds show."""
    now = found.rounds[-1]
    if judged.drift <= found.tolerance:
        if judged.ground is not None and judged.ground[0] > found.tolerance:
            drift, subject, steered = judged.ground
            how = ", with feedback," if steered else ""
            return (
                f"with MuJoCo's own contacts{how} {subject} is {drift:.2g} away; with the solved contact "
                f"forces in their place it is {judged.drift:.2g}. The rest is due to the model's contact (its "
                "softness, friction and time step), which more frames cannot correct"
            )
        return ""
    if clock.is_over:
        return f"the time limit of {clock.limit:g} s came first; {_state(now)}"
    if len(found.rounds) == 1:
        return ""
    before = found.rounds[-2]
    # While errors grow large they do so beyond all order: what each step adds tells better whether frames help.
    if now.drift <= NO_FALL * before.drift or now.step_error <= NO_FALL * before.step_error:
        return (
            f"not reached in {MOST_ROUNDS} rounds; {_state(now)}" if len(found.rounds) == MOST_ROUNDS else ""
        )
    growth = judged.replays.growth
    grows = "" if growth is None else f"; small errors grow up to {growth:.3g} times along the motion"
    return (
        f"more frames no longer reduce the drift: {_state(now)}, after {before.drift:.2g} with n = {before.n}; "
        f"the errors of all single steps add up to {now.step_error:.2g}{grows}"
    )


def _state(now: Round) -> str:
    return f"{now.subject} is {now.drift:.2g} away ({now.judged_by}) with n = {now.n}"


def _wanted(
    found: Verification, counts: np.ndarray, factors: np.ndarray, judged: _Judged, method: str
) -> np.ndarray:
    """The growth factor of each phase relative to the first round; more than now somewhere."""
    ends = np.concatenate([[0], np.cumsum(counts)])
    errors = np.array([float(judged.steps[a:b].sum()) for a, b in pairwise(ends)])
    grids = [(one.n, one.drift) for one in found.rounds[-2:]]
    order = observed_order(method, grids[0], grids[-1])
    share = SAFETY * found.tolerance / judged.drift if math.isfinite(judged.drift) else 0.0
    growth = growth_for(errors, counts, order, share)
    wanted = np.ceil(growth * factors - 1e-9).astype(int)
    return np.asarray(wanted if (wanted > factors).any() else factors + 1)
