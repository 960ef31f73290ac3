"""The figures that a solution states about itself, compared with values recomputed from its text and numbers.

The validation knows no expressions.  A module that can build the problem from the text (:mod:`stc.solution_claims`)
evaluates it and passes on the :class:`Claims`; here they become measurements and lines of the verdict.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from stc.records import dataclass, field
from stc.validate import limits
from stc.validate.metrics import Metric


@dataclass(frozen=True, slots=True)
class Claim:
    """A number that a solution states, with the value recomputed from its text, constants and unknowns.

    Attributes:
        name: name of the quantity.
        claimed: value stated by the solution.
        recomputed: value computed from the text.
        tolerance: largest accepted difference of the two.
        place: position and text of the statement that it belongs to; "" if there is none.
    """

    name: str
    claimed: float
    recomputed: float
    tolerance: float
    place: str = ""

    @property
    def holds(self) -> bool:
        """Whether the number that the solution states agrees with the recomputed one."""
        return self.claimed == self.recomputed or abs(self.claimed - self.recomputed) <= self.tolerance

    def __str__(self) -> str:
        """The disagreement, in one line."""
        text = (
            f"{self.name}: the solution says {self.claimed:.9g}, its text and numbers give {self.recomputed:.9g} "
            f"(tolerance {self.tolerance:.2g})"
        )
        return f"{text}: {self.place}" if self.place else text


@dataclass(slots=True, kw_only=True)
class Claims:
    """All figures that a solution states.

    Attributes:
        claims: the figures that could be recomputed.
        faults: other faults, one line each, the most important first: violated statements, a status that does not
            agree with the numbers.
        violation: largest violation, relative to max(1, the bound), recomputed; ``missed`` says of which statement.
        optimality: first-order error, recomputed.
        words: figures that cannot be recomputed, as pairs of label and text.
        notes: notes for the reader.
    """

    claims: Sequence[Claim] = ()
    faults: Sequence[str] = ()
    violation: float = math.nan
    missed: str = ""
    optimality: float = math.nan
    words: Sequence[tuple[str, str]] = ()
    notes: Sequence[str] = field(default_factory=list)

    @property
    def told(self) -> str:
        """The figures of the solution that cannot be recomputed, in one line."""
        return "; ".join(f"{label}: {text}" for label, text in self.words)

    @property
    def findings(self) -> list[str]:
        """The disagreements, one line each; the first one becomes the headline of the verdict."""
        return [*self.faults, *(str(claim) for claim in self.claims if not claim.holds)]

    @property
    def metrics(self) -> list[Metric]:
        """The recomputed errors with their limits, and the differences of the figures that agree."""
        if math.isnan(self.violation) and math.isnan(self.optimality):
            return []
        subject = self.missed or "rows and bounds, scaled"
        return [
            Metric("KKT residual", "solution, recomputed", self.optimality, "", limits.KKT_RESIDUAL),
            Metric("constraint violation", subject, self.violation, "", limits.VIOLATION),
            *(
                Metric(
                    "claim against recomputed",
                    claim.name,
                    abs(claim.claimed - claim.recomputed),
                    "",
                    claim.tolerance,
                )
                for claim in self.claims
                if claim.holds and math.isfinite(claim.claimed)
            ),
        ]
