"""Write every described model anew: ``python -m stc.models.build``.

From the descriptions (``luxo.py``, ``arm.py``, ``cart_pole.py``) come the MJCF files and their meshes, and in the
specs the blocks of constants that name a model.  All of it is committed, and a test compares it with a rebuild: a
spec, its model and the geometry cannot disagree.  ``--check`` compares and changes nothing; ``--list MODEL``
prints a model's measures in the form in which a spec states them.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import trimesh

from stc import models, specs
from stc.models import arm, arm7, cart_pole, cat, gymnast, humanoid, luxo, luxo3d, quadruped
from stc.models.description import Description
from stc.models.measures import rewrite, table

MODELS = Path(models.__file__).resolve().parent
SPECS = Path(specs.__file__).resolve().parent


def descriptions() -> list[Description]:
    """All described models."""
    return [
        luxo.describe(),
        luxo3d.describe(),
        arm.describe(),
        arm7.describe(),
        cart_pole.describe(),
        quadruped.describe(),
        humanoid.describe(),
        gymnast.describe(),
        cat.describe(),
    ]


def outputs(described: Sequence[Description]) -> Iterator[tuple[Path, bytes]]:
    """What has to be in the model folder: path below it and content."""
    for description in described:
        for name, text in description.documents.items():
            yield Path(name), text.encode()
        for name, mesh in description.meshes.items():
            yield Path("meshes", f"{name}.stl"), stl(mesh)


def stl(mesh: trimesh.Trimesh) -> bytes:
    """A mesh as a binary STL file, to the nanometre: rounding that differs between machines does not show."""
    rounded = trimesh.Trimesh(np.round(mesh.vertices, 9) + 0.0, mesh.faces, process=False)
    rounded.face_normals = np.round(rounded.face_normals, 5) + 0.0
    return bytes(trimesh.exchange.stl.export_stl(rounded))


def rebuild(model_folder: Path = MODELS, spec_folder: Path = SPECS, *, check: bool = False) -> list[Path]:
    """Bring both folders up to date.

    Args:
        model_folder: receives the MJCF files, and below ``meshes/`` the meshes.
        spec_folder: whose specs' blocks of measures are rewritten.
        check: only look.

    Returns:
        The files that differed.

    Raises:
        MeasureError: a spec's block asks for what its model does not have.
    """
    described = descriptions()
    wanted = {model_folder / path: content for path, content in outputs(described)}
    known = {description.name: description.measures for description in described}
    for path in sorted(spec_folder.glob("*.stc")):
        wanted[path] = rewrite(path.read_text(encoding="utf-8"), known, path.name).encode()
    changed = [path for path, content in wanted.items() if not path.is_file() or path.read_bytes() != content]
    if not check:
        for path in changed:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(wanted[path])
    return changed


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m stc.models.build", description=__doc__)
    parser.add_argument(
        "--check", action="store_true", help="only say what differs; exit code 1 if anything does"
    )
    parser.add_argument("--list", metavar="MODEL", help="print a model's measures")
    options = parser.parse_args(arguments)
    if options.list is not None:
        found = {description.name: description for description in descriptions()}
        if options.list not in found:
            parser.error(f"no described model {options.list}; there are {', '.join(found)}")
        sys.stdout.write(table(options.list, found[options.list].measures))
        return 0
    changed = rebuild(check=options.check)
    for path in changed:
        sys.stdout.write(f"{'differs' if options.check else 'written'}: {path}\n")
    return int(options.check and bool(changed))


if __name__ == "__main__":
    sys.exit(main())
