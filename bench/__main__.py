"""``python -m bench``: measures and writes the tables and plots of docs/benchmarks.md.

    python -m bench                        everything; an hour on a quiet machine
    python -m bench peers cold --quick     some parts, few rounds, small sizes
    python -m bench peers --only P2,P3     some problems
    python -m bench peers --print          print the tables and leave the page as it is

Parts: ``peers`` (solves beside other tools), ``cold`` (process start to solution saved), ``evaluator`` and ``lamp``
(compiled kernels), ``mechanics`` (from a Lagrangian to compiled derivatives), ``scaling`` (growth with the frames).
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

from bench import document
from bench.peers import report, runner

SCRIPTS = ("evaluator", "lamp", "mechanics", "scaling")
PARTS = ("peers", "cold", *SCRIPTS)
ROOT = Path(__file__).resolve().parent.parent


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}; all by default")
    parser.add_argument("--quick", action="store_true", help="two rounds, n up to 1000, short limits")
    parser.add_argument("--rounds", type=int, help="processes per contender and case; default 5")
    parser.add_argument("--only", default="", help="problems, such as P2,P3")
    parser.add_argument(
        "--tools", default="", help="contenders whose name contains one of these, besides stc"
    )
    parser.add_argument("--print", action="store_true", dest="dry", help="leave docs/benchmarks.md as it is")
    options = parser.parse_args()
    if unknown := set(options.parts) - set(PARTS):
        parser.error(f"unknown part {', '.join(sorted(unknown))}; the parts are {', '.join(PARTS)}")
    parts = options.parts or PARTS
    rounds = options.rounds or (2 if options.quick else 5)
    (ROOT / "out" / "bench").mkdir(parents=True, exist_ok=True)
    if "peers" in parts:
        peers(options, rounds)
    if "cold" in parts:
        cold(options, rounds)
    for part in SCRIPTS:
        if part in parts:
            script(part, options)


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _chosen(options: argparse.Namespace) -> tuple[list[runner.Contender], list[str]]:
    present, absent = runner.available()
    wanted = [word.strip().lower() for word in options.tools.split(",") if word.strip()]
    if wanted:
        present = [one for one in present if one.name == "stc" or any(w in one.name.lower() for w in wanted)]
    return present, absent


def _cases(known: tuple[runner.Case, ...], options: argparse.Namespace) -> list[runner.Case]:
    wanted = {word.strip().upper() for word in options.only.split(",") if word.strip()}
    cases = [case for case in known if not wanted or case.problem in wanted]
    if options.quick:
        cases = [replace(case, time_limit=20.0) for case in cases if case.n <= 1000]
    return cases


def _finish(part: str, text: str, options: argparse.Namespace, picture: str = "") -> None:
    print(text)
    if not options.dry:
        document.put(part, f"{text}\n\n{picture}")


def _keep(part: str, measured: list[runner.Measured]) -> None:
    file = ROOT / "out" / "bench" / f"{part}.json"
    file.write_text(json.dumps([one.to_dict() for one in measured], indent=1) + "\n", encoding="utf-8")


def peers(options: argparse.Namespace, rounds: int) -> None:
    present, absent = _chosen(options)
    machine = document.machine()
    measured = runner.solve_only(_cases(runner.CASES, options), present, rounds, _say)
    _keep("peers", measured)
    if not options.dry:
        report.draw_solves(measured, ROOT / "docs" / "benchmarks_solve.png")
    lines = [f"{machine}; {rounds} processes each.", *absent, "", report.overview(measured)]
    _finish("overview", "\n".join(lines), options, "![Times of all tools](benchmarks_solve.png)")
    _finish("everyone", report.everyone(measured), options)


def cold(options: argparse.Namespace, rounds: int) -> None:
    present, _ = _chosen(options)
    machine = document.machine()
    measured = runner.cold(_cases(runner.COLD_CASES, options), present, rounds, _say)
    _keep("cold", measured)
    if not options.dry:
        report.draw_cold(measured, ROOT / "docs" / "benchmarks_cold.png")
    text = f"{machine}; {rounds} processes each.\n\n{report.cold_table(measured)}"
    _finish("cold", text, options, "![Cold starts](benchmarks_cold.png)")


def script(part: str, options: argparse.Namespace) -> None:
    """The scripts that stand alone print their own table."""
    arguments = {
        "evaluator": ["--markdown", *(["--rounds", "5"] if options.quick else [])],
        "lamp": ["--rounds", "5"] if options.quick else [],
        "mechanics": ["--quick", "--rounds", "2"] if options.quick else [],
        "scaling": [
            *(["--frames", "50,200,1000"] if options.quick else ["--frames", "50,1000,10000,20000,100000"]),
            *([] if options.dry else ["--plot", str(ROOT / "docs" / "benchmarks_scaling.png")]),
        ],
    }[part]
    command = [sys.executable, str(ROOT / "bench" / f"{part}.py"), *arguments]
    ended = subprocess.run(command, env=runner.environment(), capture_output=True, text=True, check=False)
    if ended.returncode:
        raise SystemExit(ended.stderr)
    picture = "![Cost over the number of frames](benchmarks_scaling.png)" if part == "scaling" else ""
    _finish(part, f"{document.machine()}.\n\n{ended.stdout}", options, picture)


if __name__ == "__main__":
    main()
