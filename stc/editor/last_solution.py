"""The last solution beside a spec: what values its names had there."""

from __future__ import annotations

from pathlib import Path

from stc.errors import StcError
from stc.solution import Solution, read

__all__ = ["LastSolution"]


class LastSolution:
    """The newest of the files that ``stc solve`` and ``make run`` write for a spec, read once for each change."""

    def __init__(self) -> None:
        self._read: dict[Path, tuple[int, Solution | None]] = {}

    def of(self, spec: Path) -> tuple[Path, Solution] | None:
        """The solution of a spec and its file: ``NAME.npz``, beside the spec or in ``out/`` there; None without one."""
        name = f"{spec.stem}.npz"
        files = [file for file in (spec.parent / name, spec.parent / "out" / name) if file.is_file()]
        if not files:
            return None
        newest = max(files, key=lambda file: file.stat().st_mtime_ns)
        changed = newest.stat().st_mtime_ns
        if self._read.get(newest, (None,))[0] != changed:
            try:
                self._read[newest] = changed, read(newest)
            except (StcError, OSError):  # it is something else, or damaged: nothing is said of it
                self._read[newest] = changed, None
        solution = self._read[newest][1]
        return None if solution is None else (newest, solution)


def values_in(solution: Solution, name: str) -> list[str]:
    """The value of a constant or parameter, or the ranges of a variable and its derivatives, one a line."""
    if name in solution.parameters:
        return [f"`{name}` = {solution.parameters[name]:.6g}"]
    if name in solution.constants:
        return [f"`{name}` = {solution.constants[name]:.6g}"]
    found = []
    for (variable, order), channel in sorted(solution.trajectories.items(), key=lambda item: item[0][1]):
        if variable == name:
            low = min(channel.before.min(), channel.after.min())
            high = max(channel.before.max(), channel.after.max())
            found.append(f"`{name}{order * chr(39)}` from {low:.4g} to {high:.4g}")
    return found
