"""Sky and light for the pictures of a model that has none; MuJoCo would leave it black."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.validate.fields import apply_fields
from stc.validate.setup import Setup

if TYPE_CHECKING:
    import mujoco

#: Light grey at the horizon, a little darker above: colours of bodies and paths stand out, and so do shadows.
_HORIZON, _ABOVE = (0.87, 0.88, 0.90), (0.62, 0.66, 0.72)

#: Pixels of a side of the sky.
_SIZE = 256

#: Where the sun's light goes: down, from behind the usual camera and its left.
_SUNSHINE = (0.3, 0.5, -0.85)

#: What comes from the sun, from the camera, and from everywhere..
_SUN, _HEADLIGHT, _AMBIENT = 0.55, 0.3, 0.35


def picture_model(setup: Setup) -> mujoco.MjModel:
    """The model of a motion to be rendered, with a neutral sky and light where its file has none.

    The model that is simulated stays as it is. It may be changed: it is the caller's own.
    """

    spec = setup.description()
    bare = not _has_sky(setup.compiled)
    if not furnish(spec, setup):
        return setup.model()
    try:
        made = spec.compile()
    except ValueError:  # whatever the reason: it compiled without sky and light
        return setup.model()
    apply_fields(made, setup.solution)
    if bare:
        # A floor without end fades into the haze, which is white unless told otherwise.
        made.vis.rgba.haze[:3] = _HORIZON
    return made


def furnish(spec: mujoco.MjSpec, setup: Setup) -> bool:
    """Add sky and light to the description of a model, each where it has none.

    A model has light where its file has a ``<light>``, or a ``<headlight>`` that differs from MuJoCo's usual one.

    Args:
        spec: of the model, maybe with more in it; is changed.
        setup: the motion, with the model as it was compiled.

    Returns:
        Whether anything was added.
    """
    import mujoco

    added = False
    if not _has_sky(setup.compiled):
        texture = spec.add_texture(
            name="stc background",
            type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
            builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
            width=_SIZE,
            height=6 * _SIZE,
        )
        texture.rgb1, texture.rgb2 = _HORIZON, _ABOVE
        added = True
    if not _has_light(setup.compiled):
        statistics = setup.compiled.stat
        spec.worldbody.add_light(
            name="stc sun",
            type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
            dir=_SUNSHINE,
            # Its place matters to the shadows, which are drawn around it.
            pos=statistics.center - 3.0 * statistics.extent * np.array(_SUNSHINE),
            diffuse=3 * [_SUN],
            castshadow=True,
        )
        headlight = spec.visual.headlight
        headlight.diffuse, headlight.ambient, headlight.specular = (
            3 * [v] for v in (_HEADLIGHT, _AMBIENT, 0.1)
        )
        added = True
    return added


def _has_sky(model: mujoco.MjModel) -> bool:
    import mujoco

    return bool(np.any(model.tex_type == int(mujoco.mjtTexture.mjTEXTURE_SKYBOX)))


def _has_light(model: mujoco.MjModel) -> bool:
    import mujoco

    usual, own = mujoco.MjSpec().visual.headlight, model.vis.headlight
    fields = ("ambient", "diffuse", "specular", "active")
    return model.nlight > 0 or any(np.any(getattr(usual, name) != getattr(own, name)) for name in fields)
