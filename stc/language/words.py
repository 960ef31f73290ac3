"""The fixed vocabulary of the spec language: sections, methods, reserved names, and common slips.

Adding a section means one line in :data:`SECTIONS` and a statement parser of that name in
:mod:`stc.language.parser`.
"""

from __future__ import annotations

from stc.records import dataclass


@dataclass(frozen=True, slots=True)
class SectionKind:
    """The contents of a section, and whether range headers (`[a, b]:`) are allowed in it."""

    holds: str
    ranged: bool = False
    declares: bool = False
    supported: bool = True


SECTIONS: dict[str, SectionKind] = {
    "constants": SectionKind("`name` or `name = expression`, separated by `,`", declares=True),
    "variables": SectionKind("names, separated by `,`", declares=True),
    "parameters": SectionKind("names, separated by `,`", declares=True),
    "definitions": SectionKind("`name = expression;`", ranged=True, declares=True),
    "guess": SectionKind("`name = expression;`", ranged=True),
    "constraints": SectionKind("equalities and inequalities", ranged=True),
    "objective": SectionKind("expressions whose sum is minimised", ranged=True),
    "jumps": SectionKind("variables and derivatives, separated by `,`", ranged=True),
    "method": SectionKind("the name of a method"),
    "replay": SectionKind("lines that tie the spec to a MuJoCo model"),
    "lagrangian": SectionKind("one expression", ranged=True),
    "forces": SectionKind("`name: expression;`", ranged=True),
    "model": SectionKind('the name of a MuJoCo model, as in `"robot.xml";`'),
    "poses": SectionKind("`name = keyframe.stand, joint.knee = 1.9;`", declares=True),
    "contact": SectionKind("what touches the ground, and when", ranged=True),
    "data": SectionKind('`name = "file.csv";`, rows of numbers, and tables made of columns', declares=True),
}

#: What other tools call the sections.
SECTION_SYNONYMS = {
    "minimize": "objective",
    "minimise": "objective",
    "cost": "objective",
    "objectives": "objective",
    "bounds": "constraints",
    "equations": "constraints",
    "dynamics": "constraints",
    "states": "variables",
    "controls": "variables",
    "unknowns": "variables",
    "params": "parameters",
    "initial": "guess",
    "start": "guess",
    "guesses": "guess",
    "methods": "method",
    "transcription": "method",
    "macros": "definitions",
}

#: What joins two inequalities of which one is an equality.
COMPLEMENTS = "complements"

#: Kinds of line in `replay:` besides `model = "file.xml";`.
REPLAY_KINDS = ("joint", "actuator", "apply", "contact", "compare", "set")

#: What a pose may be besides the name of one, and what its names begin with.
POSE_WORDS = ("rest", "periodic")
KEYFRAME = "keyframe"

#: Words that look like functions but belong to the language.
OPERATORS = {"integral": 1, "before": 1, "after": 1}

#: Names that a spec may not declare, with what they mean.
RESERVED = {
    "t": "the time of the frame",
    "i": "the index of the frame",
    "pi": "the number 3.14159...",
    "inf": "infinity, for bounds",
    "integral": "the integral of an objective term",
    "before": "the value before a jump",
    "after": "the value after a jump",
}

#: What other tools call the frames at the two ends of a motion.
FRAMES_MEANT = {
    **dict.fromkeys(
        ("last", "end", "final", "finish", "stop", "tf", "t_f", "nn", "n_end"), "`[n]` is the last frame"
    ),
    **dict.fromkeys(
        ("first", "begin", "beginning", "start", "initial", "t0", "t_0"), "`[0]` is the first frame"
    ),
}

#: What paths of a model begin with.
PATH_WORDS = frozenset(
    [
        "body",
        "site",
        "geom",
        "com",
        "momentum",
        "angular",
        "energy",
        "joint",
        "actuator",
        "equality",
        "option",
        "keyframe",
    ]
)

#: What people write after numbers, and where angles are no radians.
UNITS = frozenset(
    ("g", "kg", "m", "mm", "cm", "km", "s", "ms", "min", "N", "kN", "Nm", "J", "W", "Hz", "rad")
)
DEGREES = frozenset(("deg", "degree", "degrees"))

#: Ways to ask for the largest value of what is minimised.
MAXIMISING = frozenset(("max", "maximize", "maximise", "maximum"))
MINIMISING = frozenset(("min", "minimize", "minimise", "minimum"))

#: What people write to choose one of two values.
CONDITIONALS = frozenset(("if", "ifelse", "if_else", "iif", "where", "cond", "piecewise"))

_TABLES = (
    "make a function of columns under `data:`, as in `f = table(polar.alpha, polar.cl);`, "
    "and write `f(alpha)` here"
)
#: What people write in expressions for a table.
TABLE_ADVICE = dict.fromkeys(
    ("table", "interp", "interp1", "interp1d", "interp2", "interpolate", "lookup", "spline", "pchip"), _TABLES
)

#: What people write for functions that the language calls otherwise or does not have.
FUNCTION_ADVICE = {
    "ln": "the natural logarithm is `log`",
    "log10": "write `log(x)/log(10)`",
    "log2": "write `log(x)/log(2)`",
    "arcsin": "it is called `asin`",
    "arccos": "it is called `acos`",
    "arctan": "it is called `atan`",
    "arctan2": "it is called `atan2`",
    "pow": "write `x^y`",
    "power": "write `x^y`",
    "sqr": "write `x^2`",
    "square": "write `x^2`",
    "cbrt": "write `x^(1/3)`",
    "norm": "write `sqrt(x^2 + y^2)`",
    "dot": "the time derivative of `x` is written `x'`",
    "der": "the time derivative of `x` is written `x'`",
    "diff": "the time derivative of `x` is written `x'`",
    "ddot": "the second time derivative of `x` is written `x''`",
    "sum": "an objective is summed over its frames already; of like things it is `sum(k in 1..3: m{k}*q{k})`",
    "int": "the integral of an objective term is written `integral(e)`",
    "maximize": "what stands under `objective:` is minimised: for the largest `e`, write `-(e)`",
    "maximise": "what stands under `objective:` is minimised: for the largest `e`, write `-(e)`",
    "minimize": "what stands under `objective:` is minimised: write it alone",
    "minimise": "what stands under `objective:` is minimised: write it alone",
    "sec": "write `1/cos(x)`",
    "csc": "write `1/sin(x)`",
    "cot": "write `1/tan(x)`",
}
