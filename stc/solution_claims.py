"""Check the figures that a solution states: the problem is built again from its text, and everything is recomputed.

The text, the given constants, the method, the unknowns and the multipliers of a solution are the inputs of this check;
all else is recomputed.  The computation shares the language with the solver, but none of its kernels, derivatives or
scaling (:mod:`stc.transcription.point`).
"""

from __future__ import annotations

import math
from pathlib import Path

from stc.errors import Span, StcError
from stc.language.parser import parse
from stc.language.syntax import Declaration
from stc.problem import Problem
from stc.recorded_files import changed
from stc.solution import Solution
from stc.solution_restated import stated_again
from stc.transcription.point import Found, Miss, Point
from stc.validate import limits
from stc.validate.claims import Claim, Claims

__all__ = ["judge"]


def judge(solution: Solution) -> Claims:
    """Compare the figures of a solution with values recomputed from its text and numbers.

    Args:
        solution: a solution. One that was made by hand and whose text is not a spec has no figures to check.
    """
    words = _words(solution)
    try:
        stated = stated_again(solution)
        if not (
            len(solution.x) == stated.layout.size == len(solution.bound_multipliers)
            and len(solution.row_multipliers) == stated.row_count
        ):
            raise StcError("its text states other unknowns or rows than it has")
        point = Point(stated, solution.x, solution.row_multipliers, solution.bound_multipliers)
        found = point.found()
    except StcError as error:
        reason = str(error).splitlines()[0]
        return Claims(words=words, notes=[f"the figures that the solution states are not checked: {reason}"])
    problem = stated.problem
    claims = [_objective(problem, solution, found), *_constants(problem, solution)]
    contradictory = bool(
        point.bounds.contradictions
    )  # no solve has begun, and errors are those of the statements
    errors = [
        ("constraint violation", solution.violation, found.violation, _missed(problem, found)),
        ("KKT residual", solution.optimality, found.optimality, _worst(found)),
    ]
    for name, claimed, recomputed, place in errors:
        larger = max(abs(claimed), abs(recomputed)) if math.isfinite(claimed + recomputed) else 0.0
        tolerance = limits.CLAIMED_ERROR + limits.CLAIMED_ERROR_SHARE * larger
        if (math.isfinite(claimed) and not contradictory) or solution.status == "optimal":
            claims.append(Claim(name, claimed, recomputed, tolerance, place))
    return Claims(
        claims=claims,
        faults=_faults(problem, solution, found),
        violation=found.violation,
        missed=_missed(problem, found) if found.violation > limits.VIOLATION else "",
        optimality=found.optimality,
        words=words,
        notes=[*_left_out(problem), *_other_data(solution)],
    )


def _other_data(solution: Solution) -> list[str]:
    """Data files of the motion that differ from those beside the spec now."""
    if not solution.directory:
        return []
    return [
        f"{path} has changed since this motion was solved: it is judged with the data stored in its file"
        for path in changed(solution.data, Path(solution.directory) / "spec")
        if (Path(solution.directory) / path).is_file()
    ]


def _objective(problem: Problem, solution: Solution, found: Found) -> Claim:
    terms = problem.objective
    place = f"{terms[0].span.location}: `{terms[0].text}`" if terms else ""
    tolerance = limits.CLAIMED_OBJECTIVE * found.objective_size + limits.CLAIMED_OBJECTIVE_FLOOR
    return Claim("objective", solution.objective, found.objective, tolerance, place)


def _constants(problem: Problem, solution: Solution) -> list[Claim]:
    """Constants that differ from those computed from the text and the given ones."""
    wrong = []
    for name in dict.fromkeys([*problem.constants, *solution.constants]):
        claimed, stated = solution.constants.get(name, math.nan), problem.constants.get(name, math.nan)
        tolerance = limits.CLAIMED_CONSTANT * abs(stated) if math.isfinite(stated) else 0.0
        if claimed != stated and not abs(claimed - stated) <= tolerance:
            wrong.append(Claim(f"constant {name}", claimed, stated, tolerance, _declared(problem, name)))
    return wrong


def _declared(problem: Problem, name: str) -> str:
    """The position at which a constant is declared; "" if it is not."""
    for section in parse(problem.source).sections:
        for block in section.blocks if section.kind == "constants" else ():
            for declared in block.statements:
                if isinstance(declared, Declaration) and declared.name.name == name:
                    return Span(problem.source, declared.start, declared.end).location
    return ""


def _left_out(problem: Problem) -> list[str]:
    """Notes on parts of the model that the spec leaves out."""
    notes = []
    if problem.left_out:
        what = f"parts of its model that MuJoCo simulates: {', '.join(problem.left_out)}"
        notes.append(f"the spec leaves out {what}; what differs by these alone is no mistake")
    if "release" in problem.additions:
        notes.append(
            "the spec, and MuJoCo with it, leaves out what the model welds or connects to mocap bodies"
        )
    return notes


def _faults(problem: Problem, solution: Solution, found: Found) -> list[str]:
    """Contradictions between the numbers of a solution."""
    faults = []
    if solution.status == "optimal":
        for miss in found.misses:
            if not miss.share <= limits.VIOLATION:
                faults.append(_told(problem, miss))
        if found.violation > limits.VIOLATION and not faults:
            faults.append(f"a bound is violated by {found.violation:.3g}, relative to max(1, the bound)")
        if not found.unpaired <= limits.COMPLEMENTARITY:
            name, frame = found.loosest_pair
            faults.append(
                f"{name} is not complementary at {_frame(frame)}: the smaller side is {found.unpaired:.3g}, "
                f"relative to max(1, the larger one) (limit {limits.COMPLEMENTARITY:g})"
            )
        if not found.optimality <= limits.KKT_RESIDUAL:
            faults.append(
                f"the solution says that it is optimal, and the KKT residual of its numbers is {found.optimality:.3g} "
                f"(limit {limits.KKT_RESIDUAL:g}), {_worst(found)}"
            )
    elif solution.status == "infeasible" and found.violation <= limits.VIOLATION:
        faults.append(
            "the solution says that it is infeasible, and its numbers keep every statement within "
            f"{found.violation:.3g}"
        )
    return faults


def _worst(found: Found) -> str:
    """The place at which the optimality conditions are violated most, in words."""
    if found.stationarity >= found.complementarity:
        what, place, amount = (
            "the derivative of the Lagrangian with respect to",
            found.steepest,
            found.stationarity,
        )
    else:
        what, place, amount = (
            "the product of multiplier and distance to the bound of",
            found.loosest,
            found.complementarity,
        )
    name, frame = place
    return f"{what} {name} at {_frame(frame)} being {amount:.3g}, relative to terms of up to {found.size:.3g}"


def _told(problem: Problem, miss: Miss) -> str:
    return (
        f"{_statement(problem, miss)} is missed by {miss.amount:.6g}: {miss.value:.9g} where {miss.bound:.9g} is the "
        "bound, in its own units"
    )


def _statement(problem: Problem, miss: Miss) -> str:
    if miss.relation < 0:
        return f"the {miss.label} at {_frame(miss.frame)}"
    relation = problem.relations[miss.relation]
    return f"{relation.span.location}: `{relation.text}` at {_frame(miss.frame)}"


def _missed(problem: Problem, found: Found) -> str:
    return _statement(problem, found.misses[0]) if found.misses else ""


def _frame(frame: float) -> str:
    return "no frame" if frame < 0 else f"frame {frame:g}"


def _words(solution: Solution) -> list[tuple[str, str]]:
    """The figures that cannot be recomputed, as pairs of label and text."""
    seconds = solution.seconds.get("total", math.nan)
    words = [
        ("optimizer", solution.optimizer),
        ("iterations", f"{solution.iterations}, with {solution.factorizations} factorizations"),
        ("wall time", f"{seconds:.3g} s" if math.isfinite(seconds) else "not told"),
        ("made by", f"stc {solution.stc_version}"),
        ("folder", solution.directory or "none"),
    ]
    return [*words, ("message", " ".join(solution.message.split()))] if solution.message else words
