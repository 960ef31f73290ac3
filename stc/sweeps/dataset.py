"""A sweep's motions as a data set for learning, in the layout of Minari (https://minari.farama.org).

Minari's Parquet storage has a folder for each motion, an *episode*: ``data/K/part-0.parquet`` with a row for each
instant, and ``data/K/metadata.json``.  ``data/metadata.json`` tells of all.  pyarrow alone writes them; Minari, or
anything that knows Parquet, reads them.  Minari's documentation, "Dataset standards", has the layout.

============================ ========== =================================================================
column                       shape      holds
============================ ========== =================================================================
``observations``             nq+nv      the solved ``qpos`` and ``qvel`` at the instant
``actions``                  nu         controls to hold until the next one
``rewards``                             1 for the last action of a motion whose replay passed, else 0
``terminations``                        True for the last action
``infos.time``                          seconds
``infos.contact``            c          whether each contact force acts: see ``contacts`` in the metadata
``infos.qfrc_applied``       nv         forces of ``apply`` lines, where the spec has any
============================ ========== =================================================================

There is one more observation than actions: the last row's action and reward say nothing.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from shutil import rmtree
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.atomic import replacing
from stc.errors import UsageError
from stc.records import dataclass
from stc.solution import Solution, read
from stc.sweeps.folder import is_good, motion_file, points_of

__all__ = ["Dataset", "dataset"]

FloatArray = NDArray[np.float64]

#: The version of Minari whose layout this is.
LAYOUT = "0.5.4"
#: A contact bears something where its force is above this share of the largest one of the motion.
BEARS = 1e-3


@dataclass(frozen=True, slots=True)
class Dataset:
    """The result of writing a data set.

    Attributes:
        folder: of the data set.
        episodes: the points of the sweep, in the order of the episodes.
        steps: of all episodes together.
        left: points that are left out, and why.
    """

    folder: Path
    episodes: list[int]
    steps: int
    left: dict[int, str]


@dataclass(slots=True)
class _Episode:
    """One motion: its arrays, what its metadata says, and between which numbers its controls may be, (nu,)."""

    arrays: dict[str, Any]
    facts: dict[str, Any]
    low: FloatArray
    high: FloatArray


def dataset(
    sweep: str | Path, folder: str | Path, *, time_step: float | None = None, unverified: bool = False
) -> Dataset:
    """Write the motions of a sweep as a data set in Minari's layout.

    Args:
        sweep: the folder of a sweep.
        folder: of the data set, new or empty.
        time_step: longest time from one instant to the next, in seconds; None takes the model's.
        unverified: whether motions are taken, too, that no replay has passed.

    Returns:
        What was written.

    Raises:
        UsageError: there is no such sweep, nothing in it to write, the folder is not empty, or pyarrow is missing.
        ModelError: a motion has no model.
    """
    if find_spec("pyarrow") is None:
        raise UsageError(
            "data sets need the library pyarrow, which is not installed", "`pip install pyarrow` installs it"
        )
    source, target = Path(sweep), Path(folder)
    about, facts = points_of(source)
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise UsageError(f"{target} is not empty", "name a new folder with -o")
    left = {index: _why_not(point, unverified) for index, point in facts.items()}
    left = {index: why for index, why in left.items() if why}
    chosen = [index for index in sorted(facts) if index not in left]
    if not chosen:
        some = next(iter(left.values()), "no point is done")
        raise UsageError(f"{source} has no motion to write: {some}")
    data, steps = target / "data", 0
    spaces: tuple[str, str] | None = None
    data.mkdir(parents=True)
    try:
        for episode, index in enumerate(chosen):
            found = _episode(read(motion_file(source, index)), facts[index], time_step)
            wide = np.full(found.arrays["observations"].shape[1], np.inf)
            here = _box(-wide, wide), _box(found.low, found.high)
            if spaces not in (None, here):
                raise UsageError(f"point {index} of {source} is about another body than the first one")
            spaces = here
            steps += len(found.arrays["actions"]) - 1
            _write(data / str(episode), episode, {"point": index, **found.facts}, found.arrays)
        assert spaces is not None
        size = sum(file.stat().st_size for file in data.rglob("*") if file.is_file())
        _write_json(
            data / "metadata.json",
            {
                "dataset_id": f"stc/{_plain(str(about.get('spec', 'motion')))}-v0",
                "minari_version": LAYOUT,
                "data_format": "parquet",
                "total_episodes": len(chosen),
                "total_steps": steps,
                "dataset_size": round(size / 1e6, 3),
                "observation_space": spaces[0],
                "action_space": spaces[1],
                "algorithm_name": f"stc {about.get('stc', '')}".strip(),
                "description": "optimal motions, each replayed in MuJoCo",
                "spec": about.get("text", ""),
            },
        )
    except BaseException:
        rmtree(data, ignore_errors=True)
        raise
    return Dataset(target, chosen, steps, left)


def _why_not(facts: Mapping[str, Any], unverified: bool) -> str:
    """Why a point is left out; nothing where it is not."""
    if facts["status"] != "optimal":
        return f"its solve is {facts['status']}"
    if unverified:
        return ""
    if not is_good(facts):
        return "its replay failed"
    return "" if facts["verdict"] else "it was not replayed"


def _episode(solution: Solution, facts: Mapping[str, Any], time_step: float | None) -> _Episode:
    from stc.validate.export.controls import played as played_by
    from stc.validate.setup import prepare

    setup = prepare(solution)
    played = played_by(setup, time_step)
    model, count = setup.compiled, len(played["ctrl"])
    if not model.nu:
        raise UsageError(f"{setup.path.name} has no actuators: a data set has no actions without")
    last, passed = np.arange(count + 1) == count - 1, facts["verdict"] == "passed"
    contact = setup.contact.at_times(solution.time[0] + played["time"])
    most = float(np.abs(contact).max(initial=0.0))
    arrays: dict[str, Any] = {
        "observations": np.hstack([played["qpos"], played["qvel"]]),
        "actions": _padded(played["ctrl"]),
        "rewards": (last & passed).astype(float),
        "terminations": last,
        "truncations": np.zeros(count + 1, bool),
        "infos": {"time": played["time"], "contact": np.abs(contact) > BEARS * most},
    }
    if "qfrc_applied" in played:
        arrays["infos"]["qfrc_applied"] = _padded(played["qfrc_applied"])
    limited = model.actuator_ctrllimited.astype(bool)
    low = np.where(limited, model.actuator_ctrlrange[:, 0], -np.inf)
    high = np.where(limited, model.actuator_ctrlrange[:, 1], np.inf)
    about = {
        "verdict": facts["verdict"],
        "margin": facts["margin"],
        "objective": facts["objective"],
        "message": facts["message"],
        "constants": dict(solution.overrides),
        "model": setup.path.name,
        "set": dict(setup.fields),
        "time_step": float(played["timestep"]),
        "contacts": [name.removeprefix("contact ") for name in setup.contact.where.names],
    }
    return _Episode(arrays, about, low, high)


def _padded(values: FloatArray) -> FloatArray:
    """The values with a row of zeros at the end, so that there are as many rows as instants."""
    return np.vstack([values, np.zeros((1, values.shape[1]))])


def _write(folder: Path, episode: int, facts: Mapping[str, Any], arrays: Mapping[str, Any]) -> None:
    import pyarrow
    import pyarrow.parquet

    folder.mkdir()
    columns = {name: _column(name, values) for name, values in arrays.items()}
    table = pyarrow.table({"episode_id": np.full(len(arrays["rewards"]), episode, np.int32), **columns})
    with replacing(folder / "part-0.parquet") as temporary:
        pyarrow.parquet.write_table(table, temporary)
    steps = len(arrays["rewards"]) - 1
    _write_json(folder / "metadata.json", {"id": episode, "total_steps": steps, **facts})


def _column(name: str, values: Any) -> Any:
    """A column of numbers, or of rows of equal length; of several of them by name where ``values`` has names."""
    import pyarrow

    if isinstance(values, dict):
        made = [(key, _column(key, part)) for key, part in values.items() if np.size(part)]
        fields = [_field(key, column, values[key]) for key, column in made]
        return pyarrow.StructArray.from_arrays([column for _, column in made], fields=fields)
    if values.ndim == 1:
        return pyarrow.array(values)
    kind = pyarrow.list_(pyarrow.from_numpy_dtype(values.dtype), values.shape[1])
    return pyarrow.FixedSizeListArray.from_arrays(pyarrow.array(values.reshape(-1)), type=kind)


def _field(name: str, column: Any, values: NDArray[Any]) -> Any:
    """A field of the table. Minari reads the shape of a row from its metadata."""
    import pyarrow

    shape = ",".join(str(size) for size in values.shape[1:])
    return pyarrow.field(name, column.type, metadata={"shape": shape} if shape else None)


def _box(low: FloatArray, high: FloatArray) -> str:
    """Gymnasium's ``Box`` as Minari writes it."""
    shape = list(high.shape)
    kind = {"type": "Box", "dtype": "float64", "shape": shape}
    return json.dumps({**kind, "low": low.tolist(), "high": high.tolist()})


def _plain(name: str) -> str:
    """A name of letters, digits and underscores."""
    return "".join(letter if letter.isalnum() else "_" for letter in name)


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
