"""What a model's description hands over: its measures, its meshes and its MJCF documents."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import trimesh


@dataclass(frozen=True, slots=True)
class Measure:
    """A number that a spec may take over from a model.

    Attributes:
        value: in SI units.
        unit: as text, empty for a pure number.
        meaning: in a few words.
    """

    value: float
    unit: str
    meaning: str


@dataclass(frozen=True, slots=True)
class Description:
    """A model, ready to be written.

    Attributes:
        name: by which a spec's block of measures asks for it.
        measures: by the name they carry in specs.
        documents: MJCF text by file name.
        meshes: by file name below ``meshes/``, without ending.
    """

    name: str
    measures: Mapping[str, Measure]
    documents: Mapping[str, str]
    meshes: Mapping[str, trimesh.Trimesh]
