"""Time a sweep over jumps of the lamp on one worker and on two, the latter killed twice; compare what they find.

    python bench/sweep.py                 500 jumps, without replays
    python bench/sweep.py --points 40     fewer

Times mean something on a machine with two processors that has nothing else to do.  Each run takes a process of its own,
and the time of a run that is killed counts up to its end.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

#: The constants and their ranges: how far the lamp jumps, and what it weighs at its base.
DISTANCES, MASSES = (0.30, 0.40), (0.9, 1.1)


def command(folder: Path, points: int, workers: int) -> list[str]:
    """The command line of a sweep over ``points`` jumps into ``folder``."""
    rows = max(2, round((points / 20) ** 0.5) * 5)
    columns = max(2, points // rows)
    words = ["sweep", "luxo_jump", "--set", f"D={DISTANCES[0]}:{DISTANCES[1]}:{columns}"]
    words += ["--set", f"m0={MASSES[0]}:{MASSES[1]}:{rows}", "--solve-only", "-o", str(folder)]
    return [sys.executable, "-m", "stc", *words, "--workers", str(workers)]


def run(words: list[str], folder: Path, kill_at: int | None = None) -> float:
    """Run a sweep, to its end or until it has so many points; the seconds it took."""
    began = time.perf_counter()
    environment = {**os.environ, "STC_THREADS": "1"}
    with subprocess.Popen(words, stdout=subprocess.DEVNULL, env=environment) as process:
        while kill_at is not None and process.poll() is None:
            if len(list((folder / "points").glob("[0-9]*.json"))) >= kill_at:
                process.kill()
            time.sleep(0.05)
    return time.perf_counter() - began


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--points", type=int, default=500)
    points = parser.parse_args().points
    with tempfile.TemporaryDirectory() as folder:
        warm, one, two, killed = (Path(folder) / name for name in ("warm", "one", "two", "killed"))
        run(command(warm, 4, 1), warm)  # compiles what is kept in the cache
        alone = run(command(one, points, 1), one)
        shared = run(command(two, points, 2), two)
        for share in (3, 1.5):
            run(command(killed, points, 2), killed, kill_at=int(points / share))
        run(command(killed, points, 2), killed)
        tables = [(path / "table.csv").read_bytes() for path in (one, two, killed)]
        count = tables[0].count(b"\n") - 1
        optimal = tables[0].count(b",optimal,")
        print(f"{count} points, {optimal} optimal")
        print(f"one worker {alone:.1f} s, two workers {shared:.1f} s: {alone / shared:.2f} times faster")
        print("tables identical" if len(set(tables)) == 1 else "TABLES DIFFER")


if __name__ == "__main__":
    main()
