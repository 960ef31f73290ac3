"""Sweeps, starts and perturbed replays on clusters of several processes on this machine, of which one is killed.

What is found is what one process finds alone.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stc
from stc.studies.multistart import multistart
from stc.studies.perturbed import robustness

joblib = pytest.importorskip("joblib")

PUSH = """constants: n = 20, T = 1, h = T/n, m = 1, D = 1;
variables: x, u;
constraints: m*x'' = u; -24*m <= u <= 24*m; [0]: x; x'; [n]: x = D; x';
objective: integral(u^2);
method: hermite-simpson;
"""


@contextmanager
def dask() -> Iterator[None]:
    """A Dask cluster of two processes."""
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster),
        joblib.parallel_config(backend="dask"),
    ):
        yield


@contextmanager
def ray() -> Iterator[None]:
    """A Ray cluster of two processes."""
    cluster = pytest.importorskip("ray")
    from ray.util.joblib import register_ray

    cluster.init(num_cpus=2, include_dashboard=False, object_store_memory=100 * 2**20, logging_level="error")
    register_ray()
    try:
        with joblib.parallel_config(backend="ray"):
            yield
    finally:
        cluster.shutdown()


def descendants(process: int) -> set[int]:
    """The processes that a process has started, and those that they have."""
    parents = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            parents[int(folder.name)] = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
        except OSError:  # it has ended
            continue
    found, new = set[int](), {process}
    while new:
        new = {one for one, parent in parents.items() if parent in new} - found
        found |= new
    return found


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore")  # those of the clusters' libraries are their own
@pytest.mark.parametrize("cluster", [dask, ray], ids=["dask", "ray"])
def test_a_cluster_that_loses_a_worker_finds_the_same(cluster: Any, tmp_path: Path) -> None:
    spec = tmp_path / "push.stc"
    spec.write_text(PUSH)
    axes = {"D": np.linspace(0.2, 2.0, 31), "m": [1.0, 2.0]}
    alone = stc.sweep(spec, axes, tmp_path / "alone", workers=1)
    hop = stc.load("particle_waypoints").solve()
    optima = multistart(stc.load("cart_pole_swing_up", n=20), 5, 1, max_iterations=200)
    replays = robustness(hop, samples=3, seed=5)
    killed: list[int] = []

    def kill_one(found: Any, one: Any) -> None:
        if len(found.facts) >= 10 and not killed:
            workers = [process for process in descendants(os.getpid()) if works(process)]
            assert len(workers) >= 2, "the work is not shared"
            killed.append(min(workers))
            os.kill(killed[0], signal.SIGKILL)

    with cluster():
        shared = stc.sweep(spec, axes, tmp_path / "shared", on_point=kill_one, workers=None)
        assert killed and shared.good and shared.facts == alone.facts
        table = (tmp_path / "alone" / "table.csv").read_bytes()
        assert (tmp_path / "shared" / "table.csv").read_bytes() == table
        other = multistart(stc.load("cart_pole_swing_up", n=20), 5, 1, max_iterations=200, workers=None)
        assert other.to_dict() == optima.to_dict()
        again = robustness(hop, samples=3, seed=5, workers=None)
        assert again.to_dict()["kinds"] == replays.to_dict()["kinds"]


def works(process: int) -> bool:
    """Whether a process is one of a cluster's workers: a Dask worker, or an actor of Ray's pool."""
    try:
        words = (Path("/proc") / str(process) / "cmdline").read_bytes()
    except OSError:
        return False
    return b"spawn_main" in words or b"ray::PoolActor" in words


@pytest.mark.nightly
@pytest.mark.slow
def test_two_processes_find_what_one_finds() -> None:
    model = stc.load("cart_pole_swing_up", n=20)
    told: list[int] = []
    alone = multistart(model, 5, 1, max_iterations=200)
    both = multistart(model, 5, 1, max_iterations=200, workers=2, on_start=lambda one: told.append(one.start))
    assert both.to_dict() == alone.to_dict() and told == list(range(5))
    for one, other in zip(alone.optima, both.optima):
        np.testing.assert_array_equal(one.solution.x, other.solution.x)
    cut = multistart(model, 4000, 1, workers=2, time_limit=1.0)
    assert cut.message.startswith("the time limit of 1 s came first") and 1 <= len(cut.starts) < 4000
    hop = stc.load("particle_waypoints").solve()
    kinds = [robustness(hop, 3, 5, workers=count).to_dict()["kinds"] for count in (1, 2)]
    assert kinds[0] == kinds[1]
