"""The fresh process of one measurement: ``python -m bench.peers.worker CONTENDER CASE MODE [FILE]``.

``CASE`` is JSON.  In mode ``cold`` it sets up, solves once, saves to FILE and ends: whoever started it takes the
time.  In mode ``solve`` it sets up, solves again and again from the same guess, and prints one JSON line.
"""

from __future__ import annotations

import sys

#: Seconds of repeated solving after the first one, and how often at most: short solves, too, are to last longer than a
#: moment in which somebody else is at work.
BUDGET, REPEATS = 1.5, 400


def used() -> float:
    """Seconds of processor time of this process and its children: compilers run as such."""
    import resource

    whose = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return sum(sum(resource.getrusage(one)[:2]) for one in whose)


def main() -> None:
    import json

    from bench.peers.contenders import module_of
    from bench.peers.task import Case

    name, case_text, mode, *rest = sys.argv[1:]
    case = Case(**json.loads(case_text))
    module, variant = module_of(name)
    if mode == "cold":
        task = module.build(case, variant)
        outcome = task.solve()
        if task.save is not None:
            task.save(outcome, rest[0])
        else:
            import numpy as np

            np.savez(rest[0], x=np.asarray(outcome.x), objective=outcome.objective)
        return
    import time

    began = used()
    task = module.build(case, variant)
    built = used() - began
    samples: list[float] = []
    walls: list[float] = []
    outcome = None
    while not samples or (len(samples) < REPEATS and sum(samples) < BUDGET):
        wall, cpu = time.perf_counter(), time.process_time()
        outcome = task.solve()
        samples.append(time.process_time() - cpu)
        walls.append(time.perf_counter() - wall)
    assert outcome is not None
    print(
        json.dumps(
            {
                "build": built,
                "cpu": samples,
                "wall": walls,
                "iterations": outcome.iterations,
                "objective": outcome.objective,
                "solved": outcome.solved,
                "status": outcome.status,
                "note": task.note,
            }
        )
    )


if __name__ == "__main__":
    main()
