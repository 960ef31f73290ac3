"""What a solution says of itself, held against what its own text and numbers give.

The validation knows no expressions.  Whoever can state the problem again from the text (:mod:`stc.judging`) evaluates
it and hands over the :class:`Claims`; here they become measurements and lines of the verdict.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from stc.records import dataclass, field
from stc.validate import limits
from stc.validate.metrics import Metric


@dataclass(frozen=True, slots=True)
class Claim:
    """A number that a solution claims, with what it is by its text, constants and unknowns.

    Attributes:
        name: of the quantity.
        claimed: by the solution.
        recomputed: from the text.
        tolerance: how far apart the two may be.
        place: where the statement behind it stands, with its text; "" where there is none.
    """

    name: str
    claimed: float
    recomputed: float
    tolerance: float
    place: str = ""

    @property
    def holds(self) -> bool:
        """Whether the two agree."""
        return self.claimed == self.recomputed or abs(self.claimed - self.recomputed) <= self.tolerance

    def __str__(self) -> str:
        """The claim that does not hold, in one line."""
        text = (
            f"{self.name}: the solution says {self.claimed:.9g}, its text and numbers give {self.recomputed:.9g} "
            f"(tolerance {self.tolerance:.2g})"
        )
        return f"{text}: {self.place}" if self.place else text


@dataclass(slots=True, kw_only=True)
class Claims:
    """Everything that a solution says of itself.

    Attributes:
        claims: those that could be recomputed.
        faults: what is wrong besides, one line each, the most telling first: statements that are missed, a status that
            the numbers do not bear out.
        violation: largest violation, relative to max(1, the bound), recomputed; ``missed`` says of which statement.
        optimality: first-order error, recomputed.
        words: what cannot be recomputed, as the solution says it: label and text.
        notes: what a reader should know.
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
        """What does not hold, one line each: a verdict's headline is the first."""
        return [*self.faults, *(str(claim) for claim in self.claims if not claim.holds)]

    @property
    def metrics(self) -> list[Metric]:
        """The recomputed errors with their limits, and how far off the claims are that hold."""
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
