"""The commands ``stc export`` and ``stc schedule``."""

from __future__ import annotations

from pathlib import Path

from stc.cli import jobs, record
from stc.cli.options import SolveOptions, ready_to_write
from stc.cli.statuses import GOOD
from stc.errors import UsageError

#: Help for the option that names the format.
HELP = "csv, npz, keyframes, controls, gltf, usd, joints or ros; by default what the suffix of -o says."


def export(
    target: str,
    kind: str | None,
    output: str | None,
    options: SolveOptions,
    *,
    rate: float | None,
    time_step: float | None,
    force: bool,
    as_json: bool,
) -> int:
    """Write a motion in another format."""
    from stc.solution import Solution
    from stc.validate.export import FORMATS, TABLES, check_format, format_of
    from stc.validate.export import export as write

    if kind is None and output is None:
        formats = ", ".join(FORMATS)
        raise UsageError(
            "--format, or -o FILE by its suffix, says what to write", f"the formats are {formats}"
        )
    kind = kind or format_of(output or "")
    check_format(kind, rate, time_step)
    if output is not None:
        ready_to_write(Path(output))
    outcome, motion = jobs.to_show(
        target,
        options,
        as_json,
        "" if kind in TABLES else f"{kind} needs the bodies and joints of a model",
        "--format csv and npz write the variables over time",
    )
    jobs.require_optimal(outcome.solution, "exported", force)
    # A file is handed on as such: the model may lie beside it.
    subject: Solution | Path = motion
    file = write(subject, kind, output, rate=rate, time_step=time_step)
    if as_json:
        record.write({"status": "ok", "name": outcome.solution.name, "format": kind, "file": str(file)})
    else:
        print(f"{file} written")
    return GOOD


def schedule(target: str, output: str | None, options: SolveOptions, *, force: bool, as_json: bool) -> int:
    """Write a spec with the contacts of a motion as ranges of frames."""
    from stc.scheduling import write_schedule

    if output is not None and not output.endswith(".stc"):
        raise UsageError(f"-o {output}: a spec is saved as *.stc")
    outcome, _ = jobs.to_show(target, options, as_json)
    solution = outcome.solution
    jobs.require_optimal(solution, "scheduled", force)
    path = ready_to_write(Path(output or f"{solution.name}_scheduled.stc"))
    ranges, table = write_schedule(solution, path)
    if as_json:
        facts = {
            "status": "ok",
            "name": solution.name,
            "file": str(path),
            "guess": str(table),
            "ranges": ranges,
        }
        record.write(facts)
        return GOOD
    for name, frames in ranges.items():
        listed = ", ".join(f"[{first}, {last}]{f' sliding {way}' * bool(way)}" for first, last, way in frames)
        print(f"{name:<12} stands on {listed}" if frames else f"{name:<12} never stands")
    finer = {**solution.overrides, "n": 2.0 * solution.n}  # steps are coarser than an exact motion needs
    settings = "".join(f" --set {name}={value:.12g}" for name, value in finer.items())
    print(f"{path} written, with {table} to start from; judge it with: stc run {path}{settings}")
    return GOOD
