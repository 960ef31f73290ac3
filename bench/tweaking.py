"""How long it takes from turning a constant until the new motion is on the screen.

    python -m bench.tweaking                     # gravity and the target of luxo_jump, 40 small turns
    python -m bench.tweaking --web               # with a page served, as the watcher has it, and drawn by Studio

Each turn moves one constant by up to 3 %, from the motion at hand.  Told apart are the solve, what follows until the
first picture of the new motion is handed over (the model set up again, paths and forces worked out), and the replay in
MuJoCo, which the picture does not wait for: the solved motion is shown at once, the physics as it arrives.
"""

from __future__ import annotations

import argparse
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stc.pipeline import load
from stc.viewer.player import Player
from stc.viewer.tweaks import session_for

#: The window asks for pictures so often, in seconds.
_PERIOD = 1.0 / 60.0

#: A solve that takes longer than this, in seconds, is given up.
_LONGEST = 30.0


@dataclass(frozen=True, slots=True)
class Turn:
    """One turn of one constant; seconds from the turn on, of which ``worked`` the processor's until it is shown."""

    name: str
    value: float
    status: str
    iterations: int
    solved: float
    shown: float
    worked: float
    replayed: float


def measure(player: Player, turns: Sequence[tuple[str, float]], pictures: bool) -> list[Turn]:
    """Turn constants one after another, each once the last one's physics has arrived.

    Args:
        player: what is shown.
        turns: names and values.
        pictures: whether to ask for pictures here; False where a window does.
    """
    assert player.tweaks is not None
    found = []
    for name, value in turns:
        generation, begin, worked = player.generation, time.perf_counter(), time.process_time()
        player.tweaks.turn(**{name: value})

        def picture() -> float:
            time.sleep(_PERIOD)
            if pictures:
                player.frame(_PERIOD)
            return time.perf_counter() - begin  # noqa: B023 (used before the next turn)

        shown = 0.0
        while player.generation == generation and shown < _LONGEST:
            shown = picture()
            if player.tweaks.refused:
                break
        replayed, worked = shown, time.process_time() - worked
        while player.generation != generation and replayed < _LONGEST:
            replayed = picture()
            if player.recording is not None and player.recording.done:
                break
        outcome = player.tweaks.outcome
        assert outcome is not None
        times = (outcome.took, shown, worked, replayed)
        found.append(Turn(name, value, outcome.status, outcome.iterations, *times))
        if outcome.status != "optimal":
            player.tweaks.give_up()
    return found


def walk(start: dict[str, float], count: int, seed: int = 1) -> list[tuple[str, float]]:
    """Small turns of the constants in turn, each staying within a tenth of where it began."""
    random = np.random.default_rng(seed)
    now = dict(start)
    turns = []
    for k in range(count):
        name = list(start)[k % len(start)]
        wanted = now[name] + start[name] * random.uniform(-0.03, 0.03)
        now[name] = float(np.clip(wanted, 0.9 * start[name], 1.1 * start[name]))
        turns.append((name, round(now[name], 4)))
    return turns


def report(turns: Sequence[Turn]) -> None:
    """A line per turn, then medians, in milliseconds."""
    print("constant    value  iterations   solve    shown   replay")
    for turn in turns:
        times = "".join(f"{1000 * t:8.0f}" for t in (turn.solved, turn.shown, turn.worked, turn.replayed))
        note = "" if turn.status == "optimal" else f"  {turn.status}"
        print(f"{turn.name:10s} {turn.value:6.4g}  {turn.iterations:10d} {times}{note}")
    for name in [None, *dict.fromkeys(turn.name for turn in turns)]:
        chosen = [turn for turn in turns if name in (None, turn.name)]
        columns = [[turn.solved, turn.shown, turn.worked, turn.replayed] for turn in chosen]
        middle, most = 1000 * np.median(columns, axis=0), 1000 * np.quantile(columns, 0.9, axis=0)
        print(
            f"{name or 'all':10s} median: solve {middle[0]:.0f} ms, shown {middle[1]:.0f} ms (the processor "
            f"worked for {middle[2]:.0f} ms), replayed {middle[3]:.0f} ms; nine in ten shown within {most[1]:.0f} ms"
        )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--spec", default="luxo_jump")
    parser.add_argument("--constants", default="g,D", help="names, separated by commas")
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--web", action="store_true", help="serve a page meanwhile")
    options = parser.parse_args()
    solution = load(options.spec).solve()
    player = Player.of(solution)
    player.tweaks = session_for(solution)
    turns = walk({name: solution.constants[name] for name in options.constants.split(",")}, options.count)
    if not options.web:
        player.frame()
        report(measure(player, turns, pictures=True))
        player.close()
        return
    from stc.viewer.panel import Panel
    from stc.viewer.windows import open_web

    def run() -> None:
        report(measure(player, turns, pictures=False))
        threading.Event().wait(0.1)
        import _thread

        _thread.interrupt_main()

    open_web(
        player, Panel(player), "tweaking", ready=lambda _: threading.Thread(target=run, daemon=True).start()
    )
    player.close()


if __name__ == "__main__":
    main()
