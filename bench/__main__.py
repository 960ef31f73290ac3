"""``python -m bench``: measures and writes the tables and plots of docs/benchmarks.md.

    python -m bench                        everything; an hour on a quiet machine
    python -m bench peers cold --quick     some parts, few rounds, small sizes
    python -m bench peers --only P2,P3     some problems; the page keeps the other lines of its tables
    python -m bench peers --print          print the tables and leave the page as it is
    python -m bench peers cold --again     write the tables of the last run once more, without measuring

Parts: ``peers`` (solves beside other tools), ``cold`` (process start to solution saved), ``lamp`` (compiled kernels),
``tables`` (look-ups beside polynomials), ``mechanics`` (from a Lagrangian to compiled derivatives), ``scaling`` (growth
with the frames), ``kkt`` (the linear systems alone, beside MUMPS), ``threads`` (two threads beside one), ``variety``
(random motions of many kinds, beside IPOPT), ``many_frames`` (the same with many frames), ``robots`` (motions of whole
robots, each as it is and perturbed).
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from bench import document
from bench.peers import report, runner
from bench.peers.contenders import Contender
from bench.peers.task import Case

#: The parts that are measured by scripts of their own, and which: one measures two.
SCRIPTS = {
    "lamp": "lamp",
    "tables": "tables",
    "mechanics": "mechanics",
    "scaling": "scaling",
    "kkt": "kkt",
    "threads": "threads",
    "variety": "variety",
    "many_frames": "variety",
    "robots": "robots",
}
PARTS = ("peers", "cold", *SCRIPTS)
ROOT = Path(__file__).resolve().parent.parent

#: What and where was measured, in a line or two, and the measurements.
Run = tuple[str, list[runner.Measured]]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}; all by default")
    parser.add_argument("--quick", action="store_true", help="two rounds, n up to 1000, short limits")
    parser.add_argument(
        "--rounds", type=int, help="processes per contender and case, 5; of threads, rounds per case, 15"
    )
    parser.add_argument("--only", default="", help="problems, such as P2,P3")
    parser.add_argument(
        "--tools", default="", help="contenders whose name contains one of these, besides stc"
    )
    parser.add_argument("--print", action="store_true", dest="dry", help="leave docs/benchmarks.md as it is")
    parser.add_argument("--again", action="store_true", help="tables of the last run of peers and cold")
    options = parser.parse_args()
    if unknown := set(options.parts) - set(PARTS):
        parser.error(f"unknown part {', '.join(sorted(unknown))}; the parts are {', '.join(PARTS)}")
    known = {case.problem.upper() for case in (*runner.CASES, *runner.COLD_CASES)}
    if strangers := _wanted(options) - known:
        parser.error(
            f"no problem {', '.join(sorted(strangers))}; the problems are {', '.join(sorted(known))}"
        )
    parts = options.parts or PARTS
    if (options.only or options.tools) and not (options.dry or options.again):
        for part in {"peers", "cold"} & set(parts):
            if not _kept(part).exists():
                parser.error(
                    f"no run of {part} is kept in out/bench, and the page would lose all other lines of its tables; "
                    "measure all of it first, or add --print"
                )
    rounds = options.rounds or (2 if options.quick else 5)
    (ROOT / "out" / "bench").mkdir(parents=True, exist_ok=True)
    if "peers" in parts:
        peers(options, rounds)
    if "cold" in parts:
        cold(options, rounds)
    for part in SCRIPTS:
        if part in parts:
            script(part, options)


def _kept(part: str) -> Path:
    """The file that has the measurements of a part's last run."""
    return ROOT / "out" / "bench" / f"{part}.json"


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _chosen(options: argparse.Namespace) -> tuple[list[Contender], list[str]]:
    present, absent = runner.available()
    wanted = [word.strip().lower() for word in options.tools.split(",") if word.strip()]
    if wanted:
        present = [one for one in present if one.name == "stc" or any(w in one.name.lower() for w in wanted)]
    return present, absent


def _wanted(options: argparse.Namespace) -> set[str]:
    """The problems that are asked for; none where all are."""
    return {word.strip().upper() for word in options.only.split(",") if word.strip()}


def _cases(known: tuple[Case, ...], options: argparse.Namespace) -> list[Case]:
    wanted = _wanted(options)
    cases = [case for case in known if not wanted or case.problem.upper() in wanted]
    if options.quick:
        cases = [replace(case, time_limit=20.0) for case in cases if case.n <= 1000]
    return cases


def _finish(part: str, text: str, options: argparse.Namespace, picture: str = "") -> None:
    print(text)
    if not options.dry:
        document.put(part, f"{text}\n\n{picture}")


def _measured(part: str, options: argparse.Namespace, measure: Callable[[], Run]) -> Run:
    """A run, kept in out/bench; with ``--again`` the one that is kept there."""
    file = _kept(part)
    if options.again:
        saved = json.loads(file.read_text(encoding="utf-8"))
        return saved["about"], [runner.Measured.from_dict(one) for one in saved["measured"]]
    about, measured = measure()
    if (options.only or options.tools) and file.exists():  # a part of the table: the rest stays
        saved = json.loads(file.read_text(encoding="utf-8"))["measured"]
        measured = runner.merged([runner.Measured.from_dict(one) for one in saved], measured)
    kept = {"about": about, "measured": [one.to_dict() for one in measured]}
    file.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    return about, measured


def peers(options: argparse.Namespace, rounds: int) -> None:
    present, absent = _chosen(options)

    def measure() -> Run:
        about = "\n".join([f"{document.machine()}; {rounds} processes each.", *absent])
        return about, runner.solve_only(_cases(runner.CASES, options), present, rounds, _say)

    about, measured = _measured("peers", options, measure)
    if not options.dry:
        report.draw_solves(measured, ROOT / "docs" / "benchmarks_solve.png")
    text = "\n\n".join([about, report.overview(measured), report.missed(measured)])
    _finish("overview", text, options, "![Times of all tools](benchmarks_solve.png)")
    _finish("everyone", report.everyone(measured), options)


def cold(options: argparse.Namespace, rounds: int) -> None:
    present, _ = _chosen(options)

    def measure() -> Run:
        about = f"{document.machine()}; {rounds} processes each."
        return about, runner.cold(_cases(runner.COLD_CASES, options), present, rounds, _say)

    about, measured = _measured("cold", options, measure)
    if not options.dry:
        report.draw_cold(measured, ROOT / "docs" / "benchmarks_cold.png")
    text = "\n\n".join([about, report.cold_table(measured), report.missed_cold(measured)])
    _finish("cold", text, options, "![Cold starts](benchmarks_cold.png)")


def script(part: str, options: argparse.Namespace) -> None:
    """The scripts that stand alone print their own table."""
    arguments = {
        "lamp": ["--rounds", "5"] if options.quick else [],
        "tables": ["--rounds", "5"] if options.quick else [],
        "kkt": ["--quick"] if options.quick else [],
        "threads": [
            *(["--quick"] if options.quick else []),
            *(["--rounds", str(options.rounds)] if options.rounds else []),
        ],
        "mechanics": ["--quick", "--rounds", "2"] if options.quick else [],
        "variety": ["--each", "2"] if options.quick else [],
        "robots": ["--each", "2"] if options.quick else [],
        "many_frames": ["--frames", "800", "--each", "1" if options.quick else "3", "--time-limit", "10"],
        "scaling": [
            *(["--frames", "50,1000,10000"] if options.quick else []),
            *([] if options.dry else ["--plot", str(ROOT / "docs" / "benchmarks_scaling.png")]),
        ],
    }[part]
    command = [sys.executable, str(ROOT / "bench" / f"{SCRIPTS[part]}.py"), *arguments]
    ended = subprocess.run(command, env=runner.environment(), capture_output=True, text=True, check=False)
    if ended.returncode:
        raise SystemExit(ended.stderr)
    picture = "![Cost over the number of frames](benchmarks_scaling.png)" if part == "scaling" else ""
    _finish(part, f"{document.machine()}.\n\n{ended.stdout}", options, picture)


if __name__ == "__main__":
    main()
