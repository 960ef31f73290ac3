"""How a solve can end, in words."""

from __future__ import annotations

from enum import StrEnum

__all__ = [
    "FIXED_ROWS_MISSED", "FLAT_BUT_FOR_ROUNDING", "MET_BUT_FOR_ROUNDING", "NO_MINIMUM", "STILL_FALLING", "UNPAIRED",
    "Status", "advice", "sentence",
]  # fmt: skip


class Status(StrEnum):
    """Outcome of a solve.  The value is the word that users see."""

    OPTIMAL = "optimal"
    INFEASIBLE = "infeasible"
    UNBOUNDED = "unbounded"
    ITERATION_LIMIT = "iteration_limit"
    TIME_LIMIT = "time_limit"
    INTERRUPTED = "interrupted"
    FAILED = "failed"


_SENTENCES = {
    Status.OPTIMAL: "A point that satisfies the optimality conditions within the tolerance was found.",
    Status.INFEASIBLE: "The constraints cannot be met near the point returned: their violation is stationary there.",
    Status.UNBOUNDED: "The objective decreases without limit along feasible points.",
    Status.ITERATION_LIMIT: "The iteration limit was reached before the tolerance.",
    Status.TIME_LIMIT: "The time limit was reached before the tolerance.",
    Status.INTERRUPTED: "The solve was interrupted; the best iterate so far is returned.",
    Status.FAILED: "No further progress was possible and the tolerance was not reached.",
}

_ADVICE = {
    Status.OPTIMAL: "",
    Status.INFEASIBLE: "Look at the rows with the largest violation; if they can be met, start nearer to such a point.",
    Status.UNBOUNDED: "Bound the variables that grow, or check the sign of the objective.",
    Status.ITERATION_LIMIT: "Raise the limit, or start from a better guess.",
    Status.TIME_LIMIT: "Raise the limit, or start from a coarser solution.",
    Status.INTERRUPTED: "Go on from there with --warm-start FILE, or warm_start in Python.",
    Status.FAILED: "Check for undefined functions, dependent rows and bad scaling near the returned point.",
}


#: What is added where a row of large terms is as near to its bound as numbers can be written.
MET_BUT_FOR_ROUNDING = (
    "Rows are met as far as rounding allows: units in which their terms are smaller let them be met better."
)
#: What is said of a stationary point that is no minimum.
NO_MINIMUM = (
    "The point satisfies the first-order conditions, but it is no minimum: the Lagrangian bends downwards along the "
    "constraints there. Start elsewhere."
)
#: What is said where all but complementarity holds; with the largest of the smaller sides.
UNPAIRED = (
    "All statements hold but `complements`: somewhere the smaller side is still {:.2g}, and nothing nearby makes it "
    "smaller. Start elsewhere."
)
FIXED_ROWS_MISSED = "A row is violated that holds fixed variables alone."
FLAT_BUT_FOR_ROUNDING = (
    "Slopes are as small as rounding allows: units in which variables are larger let them be smaller."
)
#: What is added where an attempt ended with an objective that was falling all the while, to this.
STILL_FALLING = (
    "The objective went on falling, to {:.4g}: perhaps nothing bounds it. Bound the variables that grow, or check "
    "its sign."
)


def sentence(status: Status) -> str:
    """One sentence that says what a status means."""
    return _SENTENCES[status]


def advice(status: Status) -> str:
    """Advice on the next step; empty for an optimal result."""
    return _ADVICE[status]
