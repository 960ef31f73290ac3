"""How long the factorisations of whole solves take: those here, and those of MUMPS inside IPOPT.

    python bench/in_solve.py [--frames 1000] [--rounds 3]

Each solve has a process of its own, in turn.  Here it is the second solve in it, since MUMPS' analyses are not counted
either.  Unlike one matrix that is factorised again and again, these find the caches as evaluation and the rest of an
iteration leave them, and those of an active set, or without a plan that suits them, count as well.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "STC_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse  # noqa: E402 (threads are counted when NumPy is imported)
import gc  # noqa: E402
import json  # noqa: E402
import statistics  # noqa: E402
import subprocess  # noqa: E402
import sys  # noqa: E402
from pathlib import Path  # noqa: E402

from mumps import Times, times_inside, unavailable  # noqa: E402

sys.path.append(str(Path(__file__).resolve().parent.parent))
from bench.peers.problems import constants_of, spec_of  # noqa: E402
from bench.peers.task import Case  # noqa: E402


def in_solves(cases: list[Case], rounds: int) -> list[str]:
    """A table: mean, median and least time of the factorisations of a solve; of all that the medians of the rounds."""
    lines = [
        "| problem | n | MUMPS in IPOPT: factorisations | mean, ms | median | least | here: factorisations | mean, ms "
        "| median | least | times, means | times, medians | times, least |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    names = "mean", "median", "least"
    for case in cases:
        both = [(_of_ipopt(case), _of_ours(case)) for _ in range(rounds)]
        cells = []
        for runs in zip(*both, strict=True):
            cells.append(f"{runs[0].calls}")
            cells += [f"{1e3 * statistics.median(getattr(run, name) for run in runs):.2f}" for name in names]
        for name in names:
            ratio = statistics.median(getattr(ipopt, name) / getattr(ours, name) for ipopt, ours in both)
            cells.append(f"{ratio:.1f}")
        lines.append(f"| {case.problem} | {case.n} | {' | '.join(cells)} |")
    return lines


def _command(case: Case, whose: str) -> list[str]:
    text = json.dumps({"problem": case.problem, "n": case.n, "rods": case.rods})
    return [sys.executable, __file__, "--solve", whose, "--case", text]


def _of_ipopt(case: Case) -> Times:
    return times_inside(_command(case, "ipopt"))


def _of_ours(case: Case) -> Times:
    done = subprocess.run(_command(case, "ours"), check=True, capture_output=True, text=True)
    return Times.of(json.loads(done.stdout.splitlines()[-1]))


def _solve(case: Case, whose: str) -> None:
    """What the process of a solve does."""
    if whose == "ipopt":
        from bench.peers import casadi_ipopt

        casadi_ipopt.build(case, "expanded").solve()
        return
    import stc
    from stc.studies.profile import Profile

    model = stc.load(spec_of(case.problem, case.rods))
    for _ in range(2):
        profile = Profile()
        gc.collect()  # lest the first one keeps what it has planned
        model.solve(minimizer=profile.minimize, fewer_first=False, **constants_of(case.problem, case.n))
    print(json.dumps(profile.factorize.each))


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--frames", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--solve", choices=("ipopt", "ours"), help=argparse.SUPPRESS)
    parser.add_argument("--case", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.solve:
        _solve(Case(**json.loads(options.case)), options.solve)
        return
    if missing := unavailable():
        print(f"Without MUMPS: {missing}.")
        return
    lamp = max(options.frames // 15, 1) * 15
    print("\n".join(in_solves([Case("P3", options.frames, 5), Case("P5", lamp)], options.rounds)))


if __name__ == "__main__":
    main()
