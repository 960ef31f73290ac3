"""Tables and plots of the comparison."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from bench.peers.contenders import CONTENDERS, contender
from bench.peers.runner import COLD_CONTENDERS, Measured
from bench.peers.task import Case

#: How many times faster than the best of the others the solve is to be (per iteration for P4).
GOALS: dict[tuple[str, int], float] = {
    ("P1", 1000): 6.5,
    ("P1", 10_000): 7.3,
    ("P2", 50): 5.0,
    ("P2", 1000): 10.0,
    ("P2", 10_000): 30.0,
    ("P3", 50): 8.0,
    ("P3", 1000): 21.0,
    ("P3s", 50): 8.0,
    ("P4, 10 rods", 50): 10.0,
    ("P5", 120): 10.0,
    ("P6", 120): 10.0,
}

#: How many times the time of CasADi + IPOPT from Python a cold start may take: (first time, again).
COLD_GOALS = {50: (2.5, 1.5), 1000: (1.0, 1 / 1.3), 10_000: (1 / 5, 1 / 10)}

#: Relative difference of objectives within which two tools found the same optimum.
SAME = 1e-6


def _cases(measured: Iterable[Measured]) -> list[Case]:
    return list(dict.fromkeys(one.case for one in measured))


def _milliseconds(seconds: float) -> str:
    return f"{1e3 * seconds:.3g}" if seconds < 1.0 else f"{1e3 * seconds:.0f}"


def _per_iteration(one: Measured) -> float:
    return one.least / one.iterations if one.iterations else float("inf")


def same_optimum(one: Measured, ours: Measured) -> bool:
    """Whether two ended at the same objective."""
    return abs(one.objective - ours.objective) <= SAME * max(1.0, abs(ours.objective))


def _best(rows: Sequence[Measured], ours: Measured, per_iteration: bool) -> Measured | None:
    """The fastest of the others that solves the very same program and, if that matters, found the same optimum."""
    rivals = [one for one in rows if one is not ours and one.cpu and contender(one.contender).same]
    if per_iteration:
        return min((one for one in rivals if one.iterations), key=_per_iteration, default=None)
    rivals = [one for one in rivals if one.solved and same_optimum(one, ours)]
    return min(rivals, key=lambda one: one.least, default=None)


def _fastest_elsewhere(rows: Sequence[Measured], ours: Measured) -> Measured | None:
    """The fastest of the others that found an optimum of the same program, whichever."""
    rivals = [one for one in rows if one is not ours and one.solved and contender(one.contender).same]
    return min((one for one in rivals if one.cpu), key=lambda one: one.least, default=None)


def overview(measured: Sequence[Measured]) -> str:
    """One line per problem and size: this project beside the best of the others."""
    lines = [
        "| problem | n | stc, ms | iterations | best of the others | ms | iterations | times faster | goal |",
        "| --- | ---: | ---: | ---: | --- | ---: | ---: | ---: | ---: |",
    ]
    for case in _cases(measured):
        rows = [one for one in measured if one.case == case]
        ours = next((one for one in rows if one.contender == "stc"), None)
        if ours is None:
            continue
        each = case.problem == "P4"
        best = _best(rows, ours, each)
        cost = _per_iteration if each else (lambda one: one.least)
        goal = GOALS.get((case.label, case.n))
        cells = [case.label + (", per iteration" if each else ""), f"{case.n:,}"]
        cells += [_milliseconds(cost(ours)) if ours.cpu else ours.failure, str(ours.iterations) + _mark(ours)]
        elsewhere = _fastest_elsewhere(rows, ours) if best is None else None
        if best is None and elsewhere is None:
            rivals = [one for one in rows if one is not ours and contender(one.contender).same]
            why = dict.fromkeys(one.failure for one in rivals if one.failure)
            cells += ["; ".join(why) or "none", "", "", ""]
        elif elsewhere is not None:
            cells += [f"{elsewhere.contender} (another optimum)", _milliseconds(elsewhere.least)]
            cells += [str(elsewhere.iterations), f"({elsewhere.least / ours.least:.2g})" if ours.cpu else ""]
        elif best is not None:
            cells += [best.contender, _milliseconds(cost(best)), str(best.iterations) + _mark(best)]
            cells.append(f"{cost(best) / cost(ours):.2g}")
        cells.append("" if goal is None else f"{goal:g}")
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def missed(measured: Sequence[Measured]) -> str:
    """The goals of :func:`overview` that were not reached, in a sentence."""
    words = []
    for case in _cases(measured):
        goal = GOALS.get((case.label, case.n))
        rows = [one for one in measured if one.case == case]
        ours = next((one for one in rows if one.contender == "stc"), None)
        if goal is None or ours is None:
            continue
        name = f"{case.label}, n = {case.n:,}"
        each = case.problem == "P4"
        if not ours.cpu or not (ours.solved or each):
            words.append(f"{name} (not solved: {ours.status or ours.failure})")
            continue
        best = _best(rows, ours, each)
        if best is None:
            words.append(f"{name} (nobody else found the same optimum: see the objectives below)")
            continue
        ratio = _per_iteration(best) / _per_iteration(ours) if each else best.least / ours.least
        if ratio < goal:
            words.append(f"{name} ({ratio:.2g} of {goal:g} times)")
    return f"Goals missed: {'; '.join(words)}." if words else "All goals are reached."


def missed_cold(measured: Sequence[Measured]) -> str:
    """The goals of :func:`cold_table` that were not reached."""
    words = []
    for case in _cases(measured):
        rows = [one for one in measured if one.case == case and one.cpu]
        base = min((one.least for one in rows if one.contender.startswith("IPOPT")), default=float("nan"))
        for one in rows:
            if one.contender.startswith("stc solve") and case.n in COLD_GOALS:
                first, again = COLD_GOALS[case.n]
                goal = again if one.contender.endswith("again") else first
                if one.least / base > goal:
                    words.append(
                        f"n = {case.n:,}, {one.contender[11:]} ({one.least / base:.2g} of {goal:.2g})"
                    )
    return f"Goals missed: {'; '.join(words)}." if words else "All goals are reached."


def _mark(one: Measured) -> str:
    return "" if one.solved else " (not solved)"


def everyone(measured: Sequence[Measured]) -> str:
    """Every contender on every case."""
    lines = [
        "| problem | n | tool | min, ms | median | spread | iterations | objective | remarks |",
        "| --- | ---: | --- | ---: | ---: | ---: | ---: | ---: | --- |",
    ]
    for case in _cases(measured):
        rows = [one for one in measured if one.case == case]
        ours = next((one for one in rows if one.contender == "stc"), None)
        for one in rows:
            start = f"| {case.label} | {case.n:,} | {one.contender} |"
            if not one.cpu:
                lines.append(f"{start} | | | | | {one.failure} |")
                continue
            remarks = [one.note, one.failure, "" if one.solved else f"not solved ({one.status})"]
            if (
                ours is not None
                and one.solved
                and contender(one.contender).same
                and not same_optimum(one, ours)
            ):
                remarks.append("another optimum")
            lines.append(
                f"{start} {_milliseconds(one.least)} | {_milliseconds(one.median)} | {100 * one.spread:.0f} % | "
                f"{one.iterations or ''} | {one.objective:.9g} | {'; '.join(filter(None, remarks))} |"
            )
    return "\n".join(lines)


def cold_table(measured: Sequence[Measured]) -> str:
    """From process start to solution saved, and how that compares with CasADi + IPOPT."""
    lines = [
        "| n | | processor time, s: min | median | spread | clock, s: min | times CasADi + IPOPT | goal |",
        "| ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    for case in _cases(measured):
        rows = [one for one in measured if one.case == case and one.cpu]
        peers = [one for one in rows if one.contender.startswith("IPOPT")]
        base = min((one.least for one in peers), default=float("nan"))
        for one in rows:
            goal = ""
            if one.contender.startswith("stc solve") and case.n in COLD_GOALS:
                first, again = COLD_GOALS[case.n]
                goal = f"{again if one.contender.endswith('again') else first:.2g}"
            lines.append(
                f"| {case.n:,} | {one.contender} | {one.least:.3f} | {one.median:.3f} | {100 * one.spread:.0f} % | "
                f"{min(one.wall):.3f} | {one.least / base:.2f} | {goal} |"
            )
    return "\n".join(lines)


def draw_solves(measured: Sequence[Measured], path: Path) -> None:
    """Times of all tools that solve the same program, one group per case, logarithmic."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    cases = _cases(measured)
    tools = list(dict.fromkeys(one.tool for one in CONTENDERS if one.same))
    figure, axis = plt.subplots(figsize=(11, 4.2), layout="constrained")
    width = 0.8 / len(tools)
    for k, tool in enumerate(tools):
        names = {one.name for one in CONTENDERS if one.tool == tool}
        places, heights = [], []
        for position, case in enumerate(cases):
            rows = [one for one in measured if one.case == case and one.contender in names and one.cpu]
            each = case.problem == "P4"
            costs = [_per_iteration(one) if each else one.least for one in rows if each or one.solved]
            if costs:
                places.append(position + (k - len(tools) / 2 + 0.5) * width)
                heights.append(1e3 * min(costs))
        if places:
            axis.bar(places, heights, width, label=tool, color="black" if tool == "stc" else None)
    axis.set_yscale("log")
    axis.set_ylabel("processor time, ms (P4: per iteration)")
    labels = [f"{case.label}\nn = {case.n:,}" for case in cases]
    axis.set_xticks(range(len(cases)), labels, fontsize=8)
    axis.grid(True, axis="y", alpha=0.3)
    axis.legend(fontsize=8, ncols=4)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def draw_cold(measured: Sequence[Measured], path: Path) -> None:
    """Process start to solution saved over the number of intervals."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(6.5, 4.2), layout="constrained")
    for name in dict.fromkeys(one.contender for one in measured):
        rows = [one for one in measured if one.contender == name and one.cpu]
        ours = name not in COLD_CONTENDERS
        axis.loglog(
            [one.case.n for one in rows], [one.least for one in rows], "o-" if ours else "s--", label=name
        )
    axis.set_xlabel("intervals")
    axis.set_ylabel("processor time, s")
    axis.set_title("process start to solution saved, cart-pole swing-up")
    axis.grid(True, which="both", alpha=0.3)
    axis.legend(fontsize=8)
    figure.savefig(path, dpi=130)
    plt.close(figure)
