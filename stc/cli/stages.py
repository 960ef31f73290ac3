"""The stages of ``stc show --stage``: one function for each stage from text to solution.

To make another stage visible, write its function and add it to :data:`STAGES`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from stc.errors import UsageError
from stc.problem import index_text

if TYPE_CHECKING:
    from stc.pipeline import Model
    from stc.transcription import Transcription

#: Prints one stage of a model under a method (None: the spec's own).
Printer = Callable[["Model", str | None], str]

_INDENT = "  "


def tokens(model: Model, method: str | None) -> str:
    """Every token with its place and kind."""
    from stc.language.show import show_tokens

    return show_tokens(model.source)


def syntax(model: Model, method: str | None) -> str:
    """The syntax tree, as a spec in canonical form."""
    from stc.language.show import show_syntax

    return show_syntax(model.tree)


def contact(model: Model, method: str | None) -> str:
    """The spec with its contact sections written out as plain statements."""
    from stc.language.contact import plain_text

    if any(section.kind == "model" for section in model.tree.sections):
        raise UsageError(
            f"{model.name} takes its contacts from a model: they are no plain statements",
            "see `--stage problem`",
        )
    return plain_text(model.tree, model.overrides).rstrip()


def problem(model: Model, method: str | None) -> str:
    """The problem of the spec, with names resolved and definitions inserted."""
    from stc.language.show import show_problem

    return show_problem(model.problem(method))


def _name(key: object) -> str:
    """A readable name of a symbol of the transcribed problem."""
    from stc.transcription.lower import DataRef

    if not isinstance(key, DataRef):
        return str(key)
    name = {"index": "i", "weight": "weight"}.get(key.kind, key.kind)
    name += str(key.item) if key.kind != "index" and key.item else ""
    here = key.scale == 1 and key.shift == 0
    return name if here else f"{name}[{index_text(key.scale, key.shift)}]"


def nlp(model: Model, method: str | None) -> str:
    """The nonlinear program: its sizes, and its statements by the nodes at which they hold."""
    from stc.symbolic.render import render

    found = model.transcription(method)[1]
    program = found.program
    degree = ("constant", "linear", "quadratic", "nonlinear")
    linear = int(program.row_linear.sum())
    lines = [
        f"{program.size} decision variables, {program.row_count} rows ({linear} linear), "
        f"{degree[program.objective_degree]} objective",
        f"{len(program.jacobian)} nonzeros in the Jacobian, "
        f"{len(program.hessian)} in the lower half of the Lagrangian's Hessian",
        f"{len(found.statements.bounds)} statements that are bounds",
    ]
    for number, group in enumerate(program.groups):
        at = group.nodes.position
        where = f"from {at.min() / 2:g} to {at.max() / 2:g}" if len(at) else "nowhere"
        nodes = "1 node" if group.size == 1 else f"{group.size} nodes"
        lines.append(f"group {number}: {nodes}, frames {where}, {len(group.unknown)} unknowns a node")
        for row, order in zip(group.rows, group.programs.degrees):
            low = "-inf" if row.lower is None else render(row.lower, _name)
            high = "inf" if row.upper is None else render(row.upper, _name)
            relation = (
                f"{low} <= {render(row.body, _name)} <= {high}"
                if low != high
                else f"{render(row.body, _name)} = {low}"
            )
            lines.append(f"{_INDENT}{degree[order]:9}  {row.label + ': ' if row.label else ''}{relation}")
        if group.objective is not None:
            lines.append(
                f"{_INDENT}{degree[group.programs.objective_degree]:9}  minimise {render(group.objective, _name)}"
            )
    return "\n".join(lines)


def operations(model: Model, method: str | None) -> str:
    """Operations of the derivatives over the whole motion: naive trees, simplified, shared."""
    from stc.transcription.operations import count_operations

    found = model.transcription(method)[1]
    counts = count_operations(found)
    both = (counts["jacobian"], counts["hessian"])
    rows = [("operations over the whole motion", ["Jacobian", "Hessian"])]
    for label, attribute in (
        ("naive trees, by every unknown of the motion", "naive_all"),
        ("naive trees, by each statement's own unknowns", "naive_own"),
        ("simplified trees", "simplified"),
        ("shared", "shared"),
    ):
        rows.append((label, [f"{getattr(count, attribute):,}" for count in both]))
    for label, attribute in (
        ("vanished, of the first", "naive_all"),
        ("vanished, of the second", "naive_own"),
    ):
        rows.append((label, [_nearly(count.vanished(getattr(count, attribute))) for count in both]))
    widths = [max(len(cells[k]) for _, cells in rows) for k in range(2)]
    return "\n".join(f"{label:46}  {a:>{widths[0]}}  {b:>{widths[1]}}" for label, (a, b) in rows)


def _nearly(share: float) -> str:
    """A share near one in percent, with enough digits to distinguish it from one."""
    digits = 2 if share in (0.0, 1.0) else max(2, 1 - math.floor(math.log10(abs(1.0 - share) * 100)))
    return f"{100 * share:.{min(digits, 12)}f} %"


def tape(model: Model, method: str | None) -> str:
    """The straight-line programs of each group of nodes: values, derivatives, and those of them that are constants."""
    found = model.transcription(method)[1]
    uniform = [_name(key) for key in found.program.uniform]
    parts = []
    for number, group in enumerate(found.program.groups):
        varying = [_name(key) for key in (*group.unknown, *group.data)]
        multipliers = [f"multiplier {r}" for r in range(len(group.rows))]
        kept = [f"kept {k}" for k in range(group.programs.kept)]
        for what, names, program in (
            ("values", varying, group.programs.values_tape),
            ("derivatives", varying + multipliers + kept, group.programs.derivatives_tape),
            ("constant derivatives", [_name(key) for key in group.data], group.programs.constants_tape),
        ):
            if not program.outputs:
                continue
            parts.append(f"# group {number}, {group.size} nodes: {what}\n{program.text(uniform, names)}")
    return "\n\n".join(parts)


def llvm(model: Model, method: str | None) -> str:
    """The kernels in LLVM's intermediate representation."""
    found = _compiled(model, method)
    assert found.kernels is not None
    return found.kernels.llvm_ir()


def _compiled(model: Model, method: str | None) -> Transcription:
    found = model.transcription(method)[1]
    if found.kernels is None:
        found.compile()
    return found


def sparsity(model: Model, method: str | None) -> str:
    """The patterns of the Jacobian and of the Lagrangian's Hessian, as pictures."""
    from stc.cli.sparsity import picture

    found = model.transcription(method)[1]
    program = found.program
    shape = (program.row_count, program.size)
    jacobian = picture(program.jacobian.rows, program.jacobian.cols, shape)
    hessian = picture(program.hessian.rows, program.hessian.cols, (program.size, program.size))
    return (
        f"Jacobian, {shape[0]} rows x {shape[1]} decision variables, {len(program.jacobian)} nonzeros\n"
        f"{jacobian}\n\n"
        f"Hessian of the Lagrangian, lower half, {len(program.hessian)} nonzeros\n{hessian}"
    )


#: The stages in the order of the walk.
STAGES: dict[str, Printer] = {
    "tokens": tokens,
    "syntax": syntax,
    "contact": contact,
    "problem": problem,
    "nlp": nlp,
    "sparsity": sparsity,
    "ops": operations,
    "tape": tape,
    "llvm": llvm,
}


def find(stage: str) -> Printer:
    """The printer of a stage.

    Raises:
        UsageError: there is no such stage; the hint offers the nearest one, or all.
    """
    if stage in STAGES:
        return STAGES[stage]
    from difflib import get_close_matches

    near = get_close_matches(stage, STAGES, n=1)
    hint = f"did you mean `{near[0]}`?" if near else f"the stages are {', '.join(STAGES)}"
    raise UsageError(f"--stage: there is no stage `{stage}`", hint)
