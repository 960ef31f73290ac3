"""The command ``stc sweep``: solve and judge a spec for all combinations of values of some constants."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from stc.cli import console, guard, record
from stc.cli.inputs import load, names_a_constant, number
from stc.cli.live import Line, Watch
from stc.cli.options import SolveOptions
from stc.cli.statuses import BAD, GOOD
from stc.errors import EndedError, UsageError

if TYPE_CHECKING:
    from stc.sweeps import Sweep
    from stc.sweeps.point import Found

#: So many points that are not good are told of; the table has all.
_MOST = 5


def run(
    spec: str,
    settings: Sequence[str] | None,
    output: str | None,
    options: SolveOptions,
    *,
    workers: int | None,
    replay: bool,
    as_json: bool,
) -> int:
    """Sweep and print the results; the exit status is good if every point has an optimum that did not fail in a replay.

    Raises:
        UsageError, SpecError: as :func:`stc.sweeps.sweep`.
    """
    from stc.sweeps import sweep
    from stc.workers import WorkerError, can_share

    axes = dict(axis(setting) for setting in settings or ())
    if not axes:
        raise UsageError("--set names the constants and their values", "for example: --set D=0.2:0.4:21")
    model = load(spec, {})
    folder = Path(output or f"{model.name}_sweep")
    if workers is None and not can_share():
        console.note("joblib is not installed, so that one process does it all; `pip install joblib`")
    line = Line()
    last: list[Sweep] = []

    def done(found: Sweep, point: Found) -> None:
        last[:] = [found]
        if line.due:
            line.show(f"{model.name}  {len(found.facts)} of {len(found.grid)} points")
        if watch.stopped and not found.complete:
            raise EndedError("the sweep was interrupted", "interrupted")

    def told(why: str) -> int:
        line.close()
        return _told(last[0] if last else None, model.name, folder, why, as_json)

    why = ""
    with Watch(model.name, saves=True) as watch, guard.on_end(told), suppress(KeyboardInterrupt):
        try:
            last[:] = [
                sweep(
                    model,
                    axes,
                    folder,
                    workers=workers,
                    replay=replay,
                    method=options.method,
                    tolerance=options.tolerance,
                    max_iterations=options.max_iterations,
                    on_point=done,
                )
            ]
        except (EndedError, WorkerError) as error:
            why = str(error)
        if watch.stopped and not (last and last[0].complete):
            why = "the sweep was interrupted"
    if last and last[0].complete:
        from stc.sweeps.picture import save_picture

        save_picture(last[0])
    return told(why)


def _told(found: Sweep | None, name: str, folder: Path, why: str, as_json: bool) -> int:
    """Print the results, and ``why`` they are incomplete if they are."""
    from stc.sweeps.folder import is_good

    facts = {} if found is None else found.facts
    count = None if found is None else len(found.grid)
    if why:
        so_far = "" if found is None else f"; {len(facts)} of {count} points are done"
        why = f"{why}{so_far}; the same command goes on from there"
    good = found is not None and found.good and not why
    verdicts = Counter(
        f"{one['status']}{', ' if one['verdict'] else ''}{one['verdict']}" for one in facts.values()
    )
    if as_json:
        known = {"status": "ok" if good else "failed", "message": why, "name": name, "folder": str(folder)}
        record.write({**known, "points": count, "done": len(facts), "found": dict(verdicts)})
        return GOOD if good else BAD
    if found is not None:
        rows = [(status, str(many)) for status, many in sorted(verdicts.items())]
        console.print_table(f"{name}: {len(facts)} of {count} points", rows)
        bad = [index for index in sorted(facts) if not is_good(facts[index])]
        for index in bad[:_MOST]:
            at = ", ".join(f"{key} = {value:.9g}" for key, value in found.grid.constants(index).items())
            console.note(f"point {index}, {at}: {facts[index]['message']}")
        if len(bad) > _MOST:
            console.note(f"{len(bad) - _MOST} more points are not good; the table has all")
        # Of a sweep that was interrupted while it was drawn there is none.
        drawn = found.complete and (folder / "plot.png").is_file()
        print(f"table: {folder / 'table.csv'}{'; plot: ' + str(folder / 'plot.png') if drawn else ''}")
    if why:
        console.note(why)
    return GOOD if good else BAD


def dataset(
    folder: str, output: str | None, *, time_step: float | None, unverified: bool, as_json: bool
) -> int:
    """Write the motions of a sweep as a data set.

    Raises:
        UsageError: as :func:`stc.sweeps.dataset.dataset`.
    """
    from stc.sweeps.dataset import dataset as write

    made = write(folder, output or f"{Path(folder).name}_dataset", time_step=time_step, unverified=unverified)
    if as_json:
        record.write(
            {
                "status": "ok",
                "folder": str(made.folder),
                "episodes": made.episodes,
                "steps": made.steps,
                "left_out": {str(index): why for index, why in made.left.items()},
            }
        )
        return GOOD
    for index, why in list(made.left.items())[:_MOST]:
        console.note(f"point {index} is left out: {why}")
    if len(made.left) > _MOST:
        console.note(f"{len(made.left) - _MOST} more points are left out")
    print(f"{made.folder} written: {len(made.episodes)} motions, {made.steps} steps")
    return GOOD


def axis(setting: str) -> tuple[str, list[float]]:
    """Read ``NAME=FIRST:LAST:COUNT``, ``NAME=VALUE,VALUE,...`` or ``NAME=VALUE``.

    Raises:
        UsageError: it is something else.
    """
    name, equals, text = setting.partition("=")
    name, where = name.strip(), f"--set {setting}"
    parts = text.split(":")
    if not equals or not names_a_constant(name) or len(parts) not in (1, 3) or not all(map(str.strip, parts)):
        raise UsageError(
            f"--set wants NAME=FIRST:LAST:COUNT or NAME=VALUE,VALUE,..., not `{setting}`",
            "for example: --set g=1:20:200 --set D=0.2,0.4",
        )
    if len(parts) == 1:
        return name, [number(part, where) for part in text.split(",")]
    first, last, count = (number(part, where) for part in parts)
    if not count.is_integer() or count < 2:
        raise UsageError(f"{where}: the number of values must be a whole number, 2 or more")
    steps = int(count) - 1
    return name, [last if k == steps else first + k * (last - first) / steps for k in range(steps + 1)]
