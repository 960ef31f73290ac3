"""Alters a solution file in one place after the other, as somebody would who recomputes every hash.

Arrays and claims are found by walking over the file: what is added to the layout is altered without a change here.
"""

from __future__ import annotations

import copy
import hashlib
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from stc.errors import StcError
from stc.solution import STATUSES, read
from stc.solution_claims import judge
from stc.validate.model import find_model
from stc.validate.setup import model_faults

Place = tuple[str | int, ...]

#: What nobody can recompute: a verdict shows it as the file's own word.
OWN_WORDS = {
    "name",
    "directory",
    "message",
    "iterations",
    "factorizations",
    "optimizer",
    "seconds",
    "stc_version",
}


class Forger:
    """A solution file taken apart."""

    def __init__(self, path: Path, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        with np.load(path) as archive:
            self.members = dict(archive)
        self.facts: dict[str, Any] = json.loads(self.members.pop("facts").tobytes())

    def arrays(self) -> list[str]:
        """The names of all arrays of numbers."""
        return [name for name, values in self.members.items() if values.size]

    def claims(self) -> list[Place]:
        """The places of all numbers, words and flags among the facts."""
        return list(_leaves(self.facts))

    def with_array(self, name: str) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """The file with one array altered, all of it or one number."""
        members, facts = dict(self.members), copy.deepcopy(self.facts)
        values = members[name].copy()
        where: Any = slice(None) if self.rng.random() < 0.5 else int(self.rng.integers(values.size))
        if values.dtype == np.uint8:
            values[int(self.rng.integers(values.size))] ^= 1
        else:
            unit = float(np.abs(values).max()) or 1.0
            factor = self._factor()
            values[where] = np.where(values[where] == 0.0, factor * unit, values[where] * (1.0 + factor))
        members[name] = values
        if name.startswith("files/"):
            facts["files"][int(name[6:])]["sha256"] = hashlib.sha256(values.tobytes()).hexdigest()
        return members, facts

    def with_claim(self, place: Place, other: Any = ...) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """The file with one of its facts altered, to ``other`` if that is given."""
        facts = copy.deepcopy(self.facts)
        *way, last = place
        holder: Any = facts
        for key in way:
            holder = holder[key]
        holder[last] = self._other(place, holder[last]) if other is ... else other
        return dict(self.members), facts

    def with_text(self, old: str, new: str) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """The file with another text, which its hash fits."""
        assert old in self.facts["source"]
        source = self.facts["source"].replace(old, new)
        digest = hashlib.sha256(source.encode()).hexdigest()
        return dict(self.members), {
            **copy.deepcopy(self.facts),
            "source": source,
            "sha256": digest,
            "directory": "",
        }

    def _factor(self) -> float:
        """0.1 % to 300 %, up or down."""
        return float(10.0 ** self.rng.uniform(-3.0, np.log10(3.0)) * self.rng.choice([-1.0, 1.0]))

    def _other(self, place: Place, value: Any) -> Any:
        if isinstance(value, bool):
            return not value
        if isinstance(value, int):
            return value + int(self.rng.integers(1, 4))
        if isinstance(value, float):
            return value * (1.0 + self._factor()) if value else self._factor()
        if place == ("status",):
            return str(self.rng.choice([status for status in STATUSES if status != value]))
        if place == ("method",):
            return str(
                self.rng.choice([m for m in ("central", "trapezoidal", "hermite-simpson") if m != value])
            )
        return f"{value}x"


def _leaves(facts: Any, place: Place = ()) -> Iterator[Place]:
    pairs = facts.items() if isinstance(facts, dict) else enumerate(facts)
    for key, value in pairs:
        if isinstance(value, dict | list):
            yield from _leaves(value, (*place, key))
        else:
            yield (*place, key)


def written(members: dict[str, np.ndarray], facts: dict[str, Any], path: Path) -> Path:
    """The file with these contents."""
    text = np.frombuffer(json.dumps(facts).encode(), dtype=np.uint8)
    put: Callable[..., None] = np.savez
    put(path, facts=text, **members)
    return path


def told(path: Path) -> list[str]:
    """What is said against a file: why it is not read, not judged, or what does not hold of it."""
    try:
        solution = read(path)
        if solution.status != "optimal":
            return [f"not validated: its status is {solution.status}"]
        model = find_model(str(solution.model), [solution.directory])
        return [*judge(solution).findings, *model_faults(solution, model)]
    except StcError as error:
        return [str(error)]
