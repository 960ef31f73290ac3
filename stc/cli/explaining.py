"""The command ``stc explain-motion``: a short spec for a recorded motion, solved and judged."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from stc.arguments import spare
from stc.cli import console, record
from stc.cli.inputs import load
from stc.cli.live import Line
from stc.cli.options import ready_to_write
from stc.cli.statuses import BAD, GOOD
from stc.errors import UsageError

if TYPE_CHECKING:
    from stc.explaining import Explanation


def run(motion: str, model: str, output: str | None, *, search_time: float, as_json: bool) -> int:
    """Explain a motion, save the spec and its solution, and say how close it comes; good where it is explained.

    Raises
    ------
    UsageError
        The table or the model cannot be used.
    """
    from stc.certification import certify
    from stc.cli.model_files import find
    from stc.explaining import explain

    if not search_time > 0:
        raise UsageError(f"--search-time must be a positive number of seconds, not {search_time:g}")
    source, found = Path(motion), find(model)
    path = Path(output or f"{source.stem}_explained.stc")
    if path.suffix != ".stc":
        raise UsageError(f"-o {path}: a spec is saved as *.stc")
    ready_to_write(path)
    spare(path, [(source, "the motion"), (found, "the model")], "-o")
    line = Line()

    def stage(words: str) -> None:
        if line.due:
            line.show(f"{path.stem}  {words}")

    written = Path(model) if Path(model).is_file() else found
    explanation = explain(
        source, written, name=path.stem, folder=path.parent, time_limit=search_time, on_stage=stage
    )
    line.close()
    files = explanation.save(path)
    # What is judged is the spec as it was written, where it was written.
    solution = load(str(path), {}).solve()
    solution.save(path.with_suffix(".npz"))
    files.append(path.with_suffix(".npz"))
    certificate = None if solution.status != "optimal" else certify(solution, equations=False)
    good = explanation.good and certificate is not None and certificate.passed
    if as_json:
        record.write(
            {
                "status": "ok" if good else "failed",
                "name": path.stem,
                "files": [str(file) for file in files],
                "explained": explanation.explained,
                "joints_rms": explanation.joints,
                "base_rms": explanation.base,
                "noise": explanation.noise,
                "stationarity": explanation.stationarity,
                "shares": explanation.shares,
                "ranges": explanation.ranges,
                "stances": explanation.stances,
                "notes": explanation.notes,
                "validation": None if certificate is None else certificate.to_dict(),
            }
        )
        return GOOD if good else BAD
    _show(explanation, source, path)
    print(f"{', '.join(map(str, files))} written; change it and solve it again: stc run {path}")
    if certificate is None:
        console.note(f"the spec as it was written is not solved: {solution.status}. {solution.message}")
    else:
        console.show_certificate(certificate, table=False)
    return GOOD if good else BAD


def _ranges(explanation: Explanation) -> list[tuple[str, str]]:
    """The bounds of the shares: of the terms of the objective, and of others that may have one."""
    told = [
        f"{name} {100 * low:.3g} to {100 * high:.3g} %"
        for name, (low, high) in explanation.ranges.items()
        if name in explanation.shares or name in explanation.unsure
    ]
    return [("likely shares", ", ".join(told))] if told else []


def _show(explanation: Explanation, source: Path, path: Path) -> None:
    """Print how close the solution of the proposed spec comes to the recorded motion."""
    shares = ", ".join(f"{name} {100 * share:.3g} %" for name, share in explanation.shares.items())
    noise = f"noise of the recording: {explanation.noise:.1g}"
    rows = [
        ("objective", shares or "distance from the recorded motion"),
        *_ranges(explanation),
        ("explained", f"{100 * explanation.explained:.2f} % of the motion's way"),
        ("joints", f"{explanation.joints:.2g} rad or m RMS from the recorded motion; {noise}"),
    ]
    if explanation.base:
        rows.append(("base", f"{explanation.base:.2g} m RMS"))
    for name, ranges in explanation.stances.items():
        rows.append((name, "stands on " + ", ".join(f"[{first}, {last}]" for first, last in ranges)))
    console.print_table(f"{path.stem}: {source.name} as a spec", rows)
    for note in explanation.notes:
        console.note(note)
