"""NLopt's algorithms, and the kinds of problems that each can solve.

An optimizer is called ``nlopt:NAME``, or ``nlopt:NAME:LOCAL`` for those that hand subproblems to a second
algorithm: ``nlopt:slsqp``, ``nlopt:auglag:tnewton``, ``nlopt:mlsl``.
"""

from __future__ import annotations

import numpy as np

from stc.errors import UsageError
from stc.records import dataclass
from stc.solver.nlp import NLP

__all__ = ["ALGORITHMS", "LARGE", "Algorithm", "Choice", "caution", "choose", "has_long_steps", "require"]

LARGE = 500
"""Number of variables above which a warning about dense algebra is given."""


@dataclass(frozen=True, slots=True)
class Algorithm:
    """The properties of an algorithm of NLopt.

    Attributes:
        constant: its name in NLopt.
        summary: a description, with the author.
        gradient: uses derivatives.
        equalities, inequalities: accepts rows of that kind.
        box: needs two finite bounds on every variable.
        dense: keeps matrices of the size of the problem.
        local: the algorithm for subproblems when none is named, "" where there are no subproblems.
        search: looks at the whole box; its best point is then finished by SLSQP.
        most: largest number of variables, 0 for any.
        row_by_row: takes inequalities one at a time only.
    """

    constant: str
    summary: str
    gradient: bool = True
    equalities: bool = False
    inequalities: bool = False
    box: bool = False
    dense: bool = False
    local: str = ""
    search: bool = False
    most: int = 0
    row_by_row: bool = False


def _free(constant: str, summary: str, rows: bool = False) -> Algorithm:
    """An algorithm without derivatives."""
    return Algorithm(constant, summary, False, rows, rows, dense=True)


def _search(
    constant: str,
    summary: str,
    gradient: bool = False,
    equalities: bool = False,
    inequalities: bool = False,
    local: str = "",
    most: int = 0,
    row_by_row: bool = False,
) -> Algorithm:
    """An algorithm that looks at a whole box."""
    return Algorithm(
        constant, summary, gradient, equalities, inequalities, True, True, local, True, most, row_by_row
    )


ALGORITHMS: dict[str, Algorithm] = {
    "slsqp": Algorithm(
        "LD_SLSQP",
        "sequential least-squares quadratic programming (Kraft)",
        equalities=True,
        inequalities=True,
        dense=True,
    ),
    "auglag": Algorithm(
        "AUGLAG",
        "augmented Lagrangian of all rows (Conn, Gould, Toint; Birgin, Martinez)",
        equalities=True,
        inequalities=True,
        local="lbfgs",
    ),
    "auglag_eq": Algorithm(
        "AUGLAG_EQ",
        "augmented Lagrangian of equations, inequalities to the local algorithm",
        equalities=True,
        inequalities=True,
        local="slsqp",
    ),
    "mma": Algorithm("LD_MMA", "method of moving asymptotes (Svanberg)", inequalities=True),
    "ccsaq": Algorithm("LD_CCSAQ", "conservative convex separable quadratics (Svanberg)", inequalities=True),
    "lbfgs": Algorithm("LD_LBFGS", "limited-memory BFGS (Nocedal; Luksan)"),
    "tnewton": Algorithm("LD_TNEWTON_PRECOND_RESTART", "truncated Newton (Dembo, Steihaug; Luksan)"),
    "var1": Algorithm("LD_VAR1", "limited-memory variable metric, rank 1 (Vlcek, Luksan)"),
    "var2": Algorithm("LD_VAR2", "limited-memory variable metric, rank 2 (Vlcek, Luksan)"),
    "cobyla": _free("LN_COBYLA", "linear interpolation (Powell)", rows=True),
    "bobyqa": _free("LN_BOBYQA", "quadratic interpolation (Powell)"),
    "neldermead": _free("LN_NELDERMEAD", "simplex (Nelder, Mead; Box)"),
    "sbplx": _free("LN_SBPLX", "simplex on subspaces (Rowan)"),
    "direct": _search("GN_DIRECT_L", "dividing rectangles, locally biased (Jones; Gablonsky, Kelley)"),
    "crs2": _search("GN_CRS2_LM", "controlled random search with local mutation (Price; Kaelo, Ali)"),
    "isres": _search(
        "GN_ISRES", "evolution with stochastic ranking (Runarsson, Yao)", equalities=True, inequalities=True
    ),
    "esch": _search("GN_ESCH", "evolution (Silva Santos)"),
    "mlsl": _search("G_MLSL_LDS", "multi-level single linkage (Rinnooy Kan, Timmer)", local="lbfgs"),
    "stogo": _search("GD_STOGO", "branch and bound with gradients (Madsen, Zertchaninov)", gradient=True),
    "ags": _search(
        "GN_AGS", "space-filling curve (Strongin, Sergeyev)", inequalities=True, most=10, row_by_row=True
    ),
}


@dataclass(frozen=True, slots=True)
class Choice:
    """An algorithm, and the algorithm for its subproblems (None if it has none)."""

    name: str
    algorithm: Algorithm
    local: Algorithm | None = None
    local_name: str = ""

    @property
    def gradient(self) -> bool:
        """Whether any derivative is asked for."""
        return self.algorithm.gradient if self.local is None else self.local.gradient


def choose(name: str) -> Choice:
    """The algorithm named by ``nlopt:NAME`` or ``nlopt:NAME:LOCAL``.

    Raises:
        UsageError: the algorithm does not exist, or does not use a local one.
    """
    _, _, rest = name.partition(":")
    main, _, local = rest.partition(":")
    algorithm = _named(main, name)
    if not algorithm.local:
        if local:
            raise UsageError(f"{name}: `{main}` does not use another algorithm")
        return Choice(name, algorithm)
    second = local or algorithm.local
    found = _named(second, name)
    if found.search or found.local:
        raise UsageError(f"{name}: `{second}` is not a local algorithm", f"for example: nlopt:{main}:lbfgs")
    return Choice(name, algorithm, found, second)


def _named(name: str, whole: str) -> Algorithm:
    if name in ALGORITHMS:
        return ALGORITHMS[name]
    from difflib import get_close_matches

    near = get_close_matches(name, ALGORITHMS, n=1)
    known = f"NLopt's algorithms are {', '.join(ALGORITHMS)}"
    raise UsageError(
        f"there is no optimizer `{whole}`", f"did you mean `nlopt:{near[0]}`? {known}" if near else known
    )


def require(choice: Choice, nlp: NLP) -> None:
    """Refuse a problem that an algorithm cannot solve.

    Raises:
        UsageError: with the reason, and the algorithms that can solve the problem.
    """
    algorithm = choice.algorithm
    fixed = nlp.x_lower == nlp.x_upper
    unknowns = int((~fixed).sum())
    equal = nlp.row_lower == nlp.row_upper
    bounded = np.isfinite(nlp.row_lower) | np.isfinite(nlp.row_upper)
    equalities, inequalities = int((equal & bounded).sum()), int((~equal & bounded).sum())
    inner = choice.local
    takes_inequalities = algorithm.inequalities
    if choice.algorithm.constant == "AUGLAG_EQ" and inner is not None:
        takes_inequalities = inner.inequalities
    if equalities and not algorithm.equalities:
        raise UsageError(
            f"{choice.name} takes no equations, and this problem has {equalities}",
            f"these do: {_who(lambda a: a.equalities)}",
        )
    if inequalities and not takes_inequalities:
        raise UsageError(
            f"{choice.name} takes no inequalities in several unknowns, and this problem has {inequalities}",
            f"these do: {_who(lambda a: a.inequalities)}",
        )
    if equalities > unknowns and algorithm.constant != "AUGLAG":
        raise UsageError(
            f"{choice.name} takes no more equations than unknowns, and here {equalities} equations stand "
            f"against {unknowns} unknowns",
            "nlopt:auglag and sqp do",
        )
    open_ = int((~fixed & ~(np.isfinite(nlp.x_lower) & np.isfinite(nlp.x_upper))).sum())
    if algorithm.box and open_:
        raise UsageError(
            f"{choice.name} searches a box: every unknown needs two finite bounds, and {open_} of {unknowns} "
            "have not",
            "bound each unknown on both sides, such as -10 <= x <= 10",
        )
    if algorithm.most and unknowns > algorithm.most:
        raise UsageError(
            f"{choice.name} takes {algorithm.most} unknowns at most, and this problem has {unknowns}"
        )


def _who(can: object) -> str:
    assert callable(can)
    return ", ".join(f"nlopt:{name}" for name, algorithm in ALGORITHMS.items() if can(algorithm)) + ", sqp"


def caution(choice: Choice, nlp: NLP) -> str:
    """A warning before a solve, or ""."""
    unknowns = _unknowns(nlp)
    if unknowns <= LARGE:
        return ""
    if choice.algorithm.search or not choice.gradient:
        return (
            f"{choice.name} is meant for a handful of unknowns, and this problem has {unknowns:,}: "
            "expect no answer in any useful time; sqp is meant for such a size"
        )
    dense = _is_dense(choice)
    if not dense and not nlp.m:
        return ""
    size = 8.0 * unknowns * (nlp.m + (unknowns if dense else 0)) / 1e9
    power = "the cube" if dense else "the square"
    return (
        f"{choice.name} keeps dense matrices: {unknowns:,} unknowns and {nlp.m:,} rows take {size:.2g} GB or "
        f"more, and a time that grows with {power} of their number, for each step; "
        "sqp uses the sparsity"
    )


def has_long_steps(choice: Choice, nlp: NLP) -> bool:
    """Whether single steps take time that grows with the cube of so large a problem."""
    return _is_dense(choice) and _unknowns(nlp) > LARGE


def _is_dense(choice: Choice) -> bool:
    return choice.algorithm.dense or (choice.local is not None and choice.local.dense)


def _unknowns(nlp: NLP) -> int:
    """The number of variables that are not fixed."""
    return int((nlp.x_lower != nlp.x_upper).sum())
