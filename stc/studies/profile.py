"""The time of each part of a solve, and a lower bound for it.

The solve runs as always, with timers around its program and its linear algebra.  The lower bounds are: for
evaluations, the machine code of the kernels alone, called again as often; for factorisations and solves, the fastest
one of each program times their number; for everything else, zero.  The time before and after the solve is included; a
cold start mostly consists of the interpreter and the imports.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from stc.core.calls import Bound
from stc.records import dataclass, field
from stc.solver.evaluator import Evaluator, Scaling, evaluator_of
from stc.solver.evaluator import Part as ProgramPart

if TYPE_CHECKING:
    from stc.solution import Solution
    from stc.solver import Options, Result, Start
    from stc.solver.nlp import NLP
    from stc.solver.report import Callback

#: Repetitions from which the floor of an evaluation is taken.
REPEATS = 5


@dataclass(slots=True, eq=False)
class Watch:
    """A timer for the calls of one function: their number, the total and individual seconds, and the shortest.

    A solve may be of several programs, as one by way of fewer frames is: the shortest call is that of the last one.
    """

    calls: int = 0
    seconds: float = 0.0
    shortest: float = float("inf")
    each: list[float] = field(default_factory=list)
    _calls_before: int = 0
    _floor_before: float = 0.0

    def over(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """A function that calls ``function`` and measures its time."""

        def timed(*args: Any, **kwargs: Any) -> Any:
            begin = time.perf_counter()
            try:
                return function(*args, **kwargs)
            finally:
                self.take(time.perf_counter() - begin)

        return timed

    def take(self, seconds: float, *, whole: bool = True) -> None:
        """Count a call of this duration; one that is not ``whole`` is incomplete."""
        self.calls += 1
        self.seconds += seconds
        self.each.append(seconds)
        if whole:
            self.shortest = min(self.shortest, seconds)

    def prolong(self, seconds: float) -> None:
        """Add to the last call, which was incomplete."""
        self.seconds += seconds
        self.each[-1] += seconds

    @property
    def floor(self) -> float:
        """Total seconds if every call were as short as the shortest for the same program."""
        calls = self.calls - self._calls_before
        return self._floor_before + (calls * self.shortest if calls else 0.0)

    def begin_program(self) -> None:
        """Assign the following calls to another program."""
        self._floor_before, self._calls_before, self.shortest = self.floor, self.calls, float("inf")


class _Timed:
    """An object with some of its methods timed; all else is the object's own."""

    def __init__(self, inner: Any, **watches: Watch) -> None:
        self._inner = inner
        for name, watch in watches.items():
            setattr(self, name, watch.over(getattr(inner, name)))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)


class _TimedKKT(_Timed):
    """A factorisation, its prepared calls timed as well."""

    def __init__(self, inner: Any, factorize: Watch, backsolve: Watch, both: Watch) -> None:
        super().__init__(inner, factorize=factorize, refactor=factorize, solve=backsolve)
        self._watches = factorize, backsolve, both
        self._timed: dict[Watch, tuple[Bound, Bound]] = {}

    @property
    def attempt_call(self) -> Bound | None:
        call = self._inner.attempt_call
        return None if call is None else self._over(call, self._watches[0], self._attempt)

    def resume(self, ended: int) -> Any:
        """The continuation of an attempt, which has been counted."""
        begin = time.perf_counter()
        try:
            return self._inner.resume(ended)
        finally:
            self._watches[0].prolong(time.perf_counter() - begin)

    @property
    def solve_call(self) -> Bound:
        return self._over(self._inner.solve_call, self._watches[1])

    @property
    def solve_both_call(self) -> Bound:
        return self._over(self._inner.solve_both_call, self._watches[2])

    def _attempt(self, call: Bound) -> Callable[[], int]:
        def timed() -> int:
            begin = time.perf_counter()
            ended = int(call())
            self._watches[0].take(time.perf_counter() - begin, whole=not ended)
            return ended

        return timed

    def _over(
        self, call: Bound, watch: Watch, timed: Callable[[Bound], Callable[..., Any]] | None = None
    ) -> Bound:
        """The timed call: the same object as long as ``call`` is."""
        known = self._timed.get(watch)
        if known is None or known[0] is not call:
            known = self._timed[watch] = call, Bound.of_python((timed or watch.over)(call), ())
        return known[1]


class _TimedProgram(_Timed):
    """A program, the prepared calls of its evaluators timed as well."""

    def __init__(self, inner: Any, values: Watch, derivatives: Watch) -> None:
        super().__init__(inner, values=values, derivatives=derivatives)
        self._watches = values, derivatives

    def evaluator(self, scaling: Scaling) -> Evaluator:
        return self._over(evaluator_of(self._inner, scaling))

    def part_evaluator(self, scaling: Scaling, part: ProgramPart) -> Evaluator:
        return self._over(self._inner.part_evaluator(scaling, part))

    def _over(self, found: Evaluator) -> Evaluator:
        values, derivatives = self._watches
        return replace(
            found,
            values_call=Bound.of_python(values.over(found.values_call), ()),
            derivatives_call=Bound.of_python(derivatives.over(found.derivatives_call), ()),
        )


@dataclass(frozen=True, slots=True)
class Part:
    """One line of the profile.

    Attributes:
        name: of the part of the work.
        seconds: wall time.
        calls: number of calls, 0 if that does not apply.
        floor: lower bound in seconds for the present program; None if it is not known.
    """

    name: str
    seconds: float
    calls: int = 0
    floor: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """For ``--json``."""
        return {"part": self.name, "seconds": self.seconds, "calls": self.calls, "floor": self.floor}


@dataclass(slots=True)
class Profile:
    """Timers around one solve (or the sum of several in a row).

    Pass :meth:`minimize` as the minimiser of :meth:`stc.pipeline.Model.solve`, then ask for :meth:`parts`.
    ``analyse`` is the symbolic analysis of a KKT system before its first factorisation; plans made from its
    values count as factorising.
    """

    values: Watch = field(default_factory=Watch)
    derivatives: Watch = field(default_factory=Watch)
    analyse: Watch = field(default_factory=Watch)
    factorize: Watch = field(default_factory=Watch)
    backsolve: Watch = field(default_factory=Watch)
    both: Watch = field(default_factory=Watch)
    seconds: float = 0.0
    before: float = 0.0
    loading: float = 0.0
    saving: Watch = field(default_factory=Watch)

    def begin(self, whole_process: bool) -> None:
        """Record the time up to here, and load the solver's machine code now, so that it is not counted at its first
        use.

        Args:
            whole_process: whether the process was started for this solve alone.
        """
        from stc.core.library import library

        self.before = time.process_time() if whole_process else 0.0
        begin = time.perf_counter()
        library()
        self.loading = time.perf_counter() - begin

    def minimize(
        self,
        nlp: NLP,
        options: Options | None = None,
        callback: Callback | None = None,
        start: Start | None = None,
    ) -> Result:
        """:func:`stc.solver.sqp.minimize` with everything timed."""
        from stc.solver.kkt import structured_kkt
        from stc.solver.sqp import minimize

        def new_kkt(*args: Any, **kwargs: Any) -> Any:
            system = self.analyse.over(structured_kkt)(*args, **kwargs)
            return _TimedKKT(system, self.factorize, self.backsolve, self.both)

        for _, watch in self._parts_of_a_solve():
            watch.begin_program()
        program: Any = _TimedProgram(nlp, self.values, self.derivatives)
        begin = time.perf_counter()
        result = minimize(program, options, callback, start, new_kkt)
        self.seconds += time.perf_counter() - begin
        # Afterwards, lest it counts; at the solution, where all functions are defined.
        multipliers = np.ones(nlp.m)
        kernels: tuple[tuple[Watch, Callable[[], Any]], ...] = (
            (self.values, lambda: nlp.values(result.x)),
            (self.derivatives, lambda: nlp.derivatives(result.x, multipliers, 1.0)),
        )
        for watch, call in kernels:
            again = Watch()
            repeat = again.over(call)
            for _ in range(REPEATS):
                repeat()
            watch.shortest = again.shortest
        return result

    def _parts_of_a_solve(self) -> list[tuple[str, Watch]]:
        """The watches whose calls are of one program each, and their names."""
        return [
            ("values", self.values),
            ("derivatives", self.derivatives),
            ("factorise", self.factorize),
            ("solve", self.backsolve),
            ("solve for two", self.both),
        ]

    def parts(self, solution: Solution) -> list[Part]:
        """The rows of the profile, those of the start first; ``solution`` is the result of the solve."""
        watched = self._parts_of_a_solve()
        known = dict(solution.seconds)
        first = [name for name in ("parse", "derive", "compile") if name in known]
        lines = [Part("start, imports", self.before)] if self.before else []
        lines += [Part("load the solver's code", self.loading)] if self.loading else []
        lines += [Part(name, known[name]) for name in first]
        lines.append(Part("analyse", self.analyse.seconds, self.analyse.calls))
        lines += [Part(name, watch.seconds, watch.calls, watch.floor) for name, watch in watched]
        rest = self.seconds - self.analyse.seconds - sum(watch.seconds for _, watch in watched)
        lines.append(Part("line search, tests and steps between", max(0.0, rest), solution.iterations, 0.0))
        around = known.get("total", 0.0) - self.seconds - sum(known[name] for name in first)
        lines.append(Part("bind, collect", max(0.0, around)))
        if self.saving.calls:
            lines.append(Part("save", self.saving.seconds, self.saving.calls))
        return lines
