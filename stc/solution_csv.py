"""Solutions as text: the facts as JSON in a comment, the node values as a table; see :mod:`stc.solution_file`."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import IO, Any

import numpy as np

from stc.errors import SolutionError
from stc.solution_content import Stored, check_facts


def write_csv(stored: Stored, stream: IO[bytes]) -> None:
    """Write the content of a solution as a table."""
    import csv

    members, n = dict(stored.members), int(stored.facts["n"])
    names = [unknown["name"] for unknown in stored.facts["unknowns"]]
    split = np.zeros(n + 1, dtype=bool)
    columns = []
    for unknown in stored.facts["unknowns"]:
        place = f"unknowns/{unknown['name']}"
        before, mid = members.pop(place), members.pop(f"{place}/mid", None)
        after = before
        if unknown["after"]:
            after = before.copy()
            after[unknown["after"]] = members.pop(f"{place}/after")
            split[unknown["after"]] = True
        columns.append((before, after, mid))
    rows = io.StringIO()
    table = csv.writer(rows, lineterminator="\n")
    table.writerow(["node", *names])
    has_mid = any(mid is not None for _, _, mid in columns)
    for k in range(n + 1):
        for side in ("before", "after") if split[k] else ("frame",):
            values = [after if side == "after" else before for before, after, _ in columns]
            table.writerow([side, *(repr(float(each[k])) for each in values)])
        if has_mid and k < n:
            table.writerow(["mid", *(repr(float(mid[k])) for _, _, mid in columns if mid is not None)])
    content = rows.getvalue()
    head = [f"# facts {json.dumps({**stored.facts, 'rows': content.count(chr(10)) - 1})}\n"]
    head += [f"# {name} {json.dumps(values.tolist())}\n" for name, values in members.items()]
    stream.write(("".join(head) + content).encode())


def read_csv(path: Path) -> Stored:
    """Read the content of a solution from a table."""
    import csv

    facts: Any = None
    members: dict[str, np.ndarray] = {}
    text = path.read_text()
    lines = text.splitlines()
    start = 0
    while start < len(lines) and lines[start].startswith("#"):
        place, _, content = lines[start][1:].strip().partition(" ")
        if place == "facts":
            facts = json.loads(content)
        else:
            members[place] = np.array(json.loads(content), dtype=np.float64)
        start += 1
    facts = check_facts(facts)
    rows = list(csv.reader(lines[start:]))
    if not rows or rows[0][:1] != ["node"]:
        raise SolutionError("the file is damaged: its table has no heading")
    # A number that lost its last digits is a number still: only the end of its line tells that it is whole.
    if "rows" in facts and (len(rows) - 1 != facts["rows"] or not text.endswith("\n")):
        raise SolutionError(
            "the file is damaged: rows are missing from its table, or the last one was cut off"
        )
    kinds = np.array([row[0] for row in rows[1:]])
    numbers = np.array([[float(v) for v in row[1:]] for row in rows[1:]]).reshape(len(kinds), -1)
    before, after = np.isin(kinds, ("frame", "before")), np.isin(kinds, ("frame", "after"))
    frames = int(facts["n"]) + 1
    if np.sum(before) != frames or np.sum(after) != frames:
        raise SolutionError("the file is damaged: rows are missing from its table")
    mid = kinds == "mid" if facts["method"] == "hermite-simpson" and frames > 1 else None
    places = [(f"unknowns/{unknown['name']}", unknown["after"]) for unknown in facts["unknowns"]]
    if numbers.shape[1] != len(places):
        raise SolutionError("the file is damaged: its table does not have the columns that its facts list")
    for (place, apart), column in zip(places, numbers.T):
        members[place] = column[before]
        if apart:
            members[f"{place}/after"] = column[after][apart]
        if mid is not None:
            members[f"{place}/mid"] = column[mid]
        rest = np.setdiff1d(np.arange(frames), apart)
        if not np.array_equal(column[before][rest], column[after][rest], equal_nan=True):
            raise SolutionError(
                f"the file was altered: {place} has two values at a frame that it does not list"
            )
    return Stored(facts, members)
