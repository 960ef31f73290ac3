"""The result of a command that solves: shown, recorded and saved, also if the command is ended early."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stc.cli import console, guard, reasons, record
from stc.cli.messages import ended
from stc.cli.searches import Found
from stc.cli.statuses import BAD
from stc.deadline import unlimited
from stc.errors import Diagnostic
from stc.records import dataclass

if TYPE_CHECKING:
    from stc.cli.live import Watch
    from stc.solution import Solution
    from stc.studies.blame import Blame
    from stc.studies.complementarity import Complementarity
    from stc.studies.explain import Explanation
    from stc.studies.grid_error import GridError
    from stc.studies.profile import Part
    from stc.studies.ringing import Ringing
    from stc.studies.uncertainty import Uncertainty

#: So many controls that ring are told of.
MOST_RINGING = 3

__all__ = ["Ending", "Outcome", "keep_solution"]


@dataclass(frozen=True, slots=True)
class Outcome:
    """A solution with its file (None if it is not saved), the warnings about its spec, the reasons and the grid's
    error.

    ``unsaved`` is the reason why it could not be saved; ``was_read`` says that the file existed already, and
    ``brief`` that a line is enough for the figures of the solve.
    """

    solution: Solution
    file: Path | None
    warnings: Sequence[Diagnostic] = ()
    blame: Blame | None = None
    explanation: Explanation | None = None
    grid: GridError | None = None
    ringing: Sequence[Ringing] = ()
    complementarity: Complementarity | None = None
    uncertainty: Uncertainty | None = None
    found: Found | None = None
    profile: Sequence[Part] = ()
    unsaved: str = ""
    was_read: bool = False
    brief: bool = False

    @property
    def status(self) -> str:
        """The status of the solve; not optimal if a search did not reach its goal."""
        return self.solution.status if self.found is None else self.found.status

    @property
    def good(self) -> bool:
        """Whether the solve and the search reached their goals."""
        found = self.status == "optimal" if self.found is None else self.found.good
        return found and not self.unsaved

    @property
    def next_step(self) -> str:
        """The sentence that refers the user of a time-stepping solve to ``stc schedule``."""
        import shlex

        file = shlex.quote(str(self.file or f"{self.solution.name}.npz"))
        return f"`stc schedule {file}` writes its contacts as ranges of frames, to be solved and validated"

    def record(self) -> record.Record:
        """The JSON object of the command: the solution and what was found out about it."""
        known = record.of_solution(
            self.solution, None if self.file is None else str(self.file), self.warnings
        )
        known["grid"] = None if self.grid is None else self.grid.to_dict()
        known["ringing"] = (
            [one.to_dict() for one in self.ringing] if self.solution.status == "optimal" else None
        )
        known["complementarity"] = None if self.complementarity is None else self.complementarity.to_dict()
        known["blame"] = None if self.blame is None else self.blame.to_dict()
        known.update({} if self.explanation is None else self.explanation.to_dict())
        if self.uncertainty is not None:
            known["estimation"] = self.uncertainty.to_dict()
        if self.profile:
            known["profile"] = [part.to_dict() for part in self.profile]
        if self.unsaved:
            known["message"] = f"{known['message']} {self.unsaved}"
        return known if self.found is None else self.found.added_to(known)

    def show(self) -> None:
        """Print the solution with its file, standard errors and grid error."""
        if self.brief and self.uncertainty is None:
            console.show_briefly(self.solution, self.file, self.was_read)
        else:
            console.show_solution(self.solution, self.file, self.was_read, self.uncertainty, self.grid)
        if (
            self.solution.message
            and self.status != "optimal"
            and (self.blame is None or self.status != "infeasible")
        ):
            print(self.solution.message)
        if self.found is not None and (in_all := self.found.in_all()):
            print(in_all)
        if self.found is not None and self.found.message:
            console.note(self.found.message)
        if self.found is not None and self.found.remark:
            console.note(self.found.remark)
        if self.grid is not None and self.grid.warning:
            console.note(self.grid.warning)
        if self.solution.is_sketch and self.solution.status == "optimal":
            console.note(f"the motion was found by time stepping, which is of first order: {self.next_step}")
        for one in self.ringing[:MOST_RINGING]:
            console.note(str(one))
        if self.complementarity is not None:
            print(self.complementarity)
        for told in self.solution.outside:
            console.note(told)
        if self.blame is not None:
            print(self.blame)
        if self.explanation is not None:
            reasons.show_explanation(self.explanation)
        if self.profile:
            console.show_profile(self.profile)
        if self.unsaved:
            console.note(self.unsaved)


class Ending:
    """The output of a command that is ended by :mod:`stc.cli.guard` or between two steps of a search.

    Args:
        watch: the progress line to remove.
        file: file for the motion; None if it is not saved.
        as_json: whether a record is printed.

    Attributes:
        outcome: the result of the command; None while it solves.
    """

    def __init__(self, watch: Watch, file: Path | None, as_json: bool) -> None:
        self.outcome: Outcome | None = None
        self._watch, self._file, self._as_json = watch, file, as_json
        self._solved: Solution | None = None

    def noting(self, solve: Callable[..., Solution]) -> Callable[..., Solution]:
        """A wrapper of a solve that keeps the last optimal solution (else the first one) in case the search is
        stopped.
        """

        def noted(**options: Any) -> Solution:
            solution = solve(**options)
            if solution.status == "optimal" or self._solved is None:
                self._solved = solution
            return solution

        return noted

    def found(self, status: str) -> Found | None:
        """The last solution of a search, else the best iterate of the current solve, else None."""
        from stc.solver.status import Status, sentence
        from stc.solving import in_progress

        solution = self._solved
        if solution is not None and solution.status == "optimal":
            message = f"{sentence(Status(status))} This is the last solution that the search had found."
            return Found(solution, status, message)
        under_way = in_progress.current
        if under_way is not None:
            solution = under_way.solution(Status(status)) or solution
        return None if solution is None else Found(solution, status)

    def __call__(self, status: str) -> int:
        """End the command; returns its exit status."""
        self._watch.clear()
        outcome = self.outcome
        if outcome is None:
            found = self.found(status)
            if found is None:
                return ended(status)
            unsaved = "" if self._file is None else keep_solution(found.solution, self._file)
            kept = None if unsaved else self._file
            outcome = Outcome(found.solution, kept, found=found, unsaved=unsaved, brief=True)
        guard.settle()
        if self._as_json:
            record.write({**outcome.record(), "status": status})
        else:
            outcome.show()
            console.note(f"ended: {status}")
        return BAD


def keep_solution(solution: Solution, file: Path, keep: Callable[[Path], object] | None = None) -> str:
    """Save a solution, in a new folder for temporary files if it cannot be saved where it should be.

    Returns:
        The reason, with the place where it is saved instead; "" if there is nothing to report.
    """
    write = keep or solution.save
    try:
        if solution.status != "optimal":
            from stc.cli.keeping import keep_optimal

            keep_optimal(file, solution.status)
        with unlimited():
            write(file)
    except OSError as error:
        if error.errno is None:
            raise
        return f"{file}: {error.strerror or error}: {_rescued(file.name, write)}"
    return ""


def _rescued(name: str, write: Callable[[Path], object]) -> str:
    """Save a solution in a new folder for temporary files; returns what became of it."""
    import shutil
    import tempfile

    try:
        place = Path(tempfile.mkdtemp(prefix="stc-")) / name
    except OSError:
        return "the solution is not saved"
    try:
        with unlimited():
            write(place)
    except OSError:
        shutil.rmtree(place.parent, ignore_errors=True)
        return "the solution is not saved"
    return f"the solution is saved as {place} instead"
