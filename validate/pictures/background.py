"""What stands behind a model that brings no sky of its own: MuJoCo would leave it black."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.validate.fields import apply_fields
from stc.validate.model import as_bytes
from stc.validate.setup import Setup

if TYPE_CHECKING:
    import mujoco

#: Light grey at the horizon, a little darker above: colours of bodies and paths stand out, and so do shadows.
_HORIZON, _ABOVE = (0.87, 0.88, 0.90), (0.62, 0.66, 0.72)

#: Pixels of a side of the sky.
_SIZE = 256


def picture_model(setup: Setup) -> mujoco.MjModel:
    """The model of a motion to be rendered, with a neutral sky where its file has none.

    The model that is simulated stays as it is. It may be changed: it is the caller's own.
    """
    import mujoco

    sky = int(mujoco.mjtTexture.mjTEXTURE_SKYBOX)
    if np.any(setup.compiled.tex_type == sky):
        return setup.model()
    spec = mujoco.MjSpec.from_file(as_bytes(setup.path))
    texture = spec.add_texture(
        name="stc background",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        width=_SIZE,
        height=6 * _SIZE,
    )
    texture.rgb1, texture.rgb2 = _HORIZON, _ABOVE
    try:
        made = spec.compile()
    except ValueError:  # whatever the reason: it compiled without a sky
        return setup.model()
    apply_fields(made, setup.solution)
    # A floor without end fades into the haze, which is white unless told otherwise.
    made.vis.rgba.haze[:3] = _HORIZON
    return made
