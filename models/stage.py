"""The room that all described models stand in: floor, sky, light, and how it is filmed."""

from __future__ import annotations

from stc.models.mjcf import Element, Value, element


def options(time_step: float, **attributes: str | float) -> Element:
    """Runge-Kutta steps of this length, in seconds, under the Earth's gravity."""
    return element("option", timestep=time_step, integrator="RK4", gravity=(0.0, 0.0, -9.81), **attributes)


def defaults() -> Element:
    """What is seen has no say in the dynamics, what touches is not seen."""
    return element(
        "default",
        element(
            "default",
            element("geom", type="mesh", contype=0.0, conaffinity=0.0, mass=0.0, group=1.0),
            class_="seen",
        ),
        element(
            "default", element("geom", group=3.0, mass=0.0, rgba=(0.2, 0.7, 0.3, 0.5)), class_="touching"
        ),
    )


def picture(centre: tuple[float, float, float], extent: float, ambient: float = 0.25) -> list[Element]:
    """Quality and haze of the picture; ``centre`` and ``extent`` (m) are what a free camera looks at."""
    haze = (0.20, 0.25, 0.33, 1.0)
    return [
        element(
            "visual",
            element("global", azimuth=120.0, elevation=-12.0, fovy=35.0, offwidth=1920.0, offheight=1080.0),
            element(
                "headlight",
                ambient=(ambient,) * 3,
                diffuse=(0.18, 0.18, 0.20),
                specular=(0.05, 0.05, 0.05),
            ),
            element("quality", shadowsize=4096.0, offsamples=8.0),
            element(
                "map", znear=0.005, zfar=12.0, fogstart=4.0, fogend=12.0, shadowclip=1.5, shadowscale=0.9
            ),
            element("rgba", haze=haze, fog=haze),
        ),
        element("statistic", center=centre, extent=extent),
    ]


def assets() -> list[Element]:
    """The assets of sky and floor, which all models share."""
    return [
        element(
            "texture",
            name="sky",
            type="skybox",
            builtin="gradient",
            rgb1=(0.24, 0.30, 0.40),
            rgb2=(0.05, 0.07, 0.12),
            width=256.0,
            height=1536.0,
        ),
        element(
            "texture",
            name="checker",
            type="2d",
            builtin="checker",
            rgb1=(0.50, 0.48, 0.46),
            rgb2=(0.42, 0.405, 0.39),
            mark="edge",
            markrgb=(0.35, 0.335, 0.32),
            width=512.0,
            height=512.0,
        ),
        element(
            "material",
            name="floor",
            texture="checker",
            texrepeat=(2.5, 2.5),
            texuniform=True,
            reflectance=0.08,
            specular=0.3,
            shininess=0.3,
        ),
    ]


def sun(towards: tuple[float, float, float] = (0.35, 0.55, -0.9)) -> Element:
    """A soft light from the side of the camera, from above."""
    return element(
        "light",
        name="sun",
        type="directional",
        pos=(-1.5, -2.5, 4.0),
        dir=towards,
        diffuse=(0.42, 0.43, 0.48),
        specular=(0.25, 0.25, 0.25),
        castshadow=True,
    )


def lamp(pos: tuple[float, float, float], towards: tuple[float, float, float]) -> Element:
    """A warm spotlight that stands in the room."""
    return element(
        "light",
        name="lamp",
        type="spot",
        pos=pos,
        dir=towards,
        cutoff=38.0,
        exponent=3.0,
        diffuse=(0.95, 0.78, 0.52),
        specular=(0.3, 0.26, 0.18),
        castshadow=False,
    )


def floor(height: float = 0.0, **attributes: Value) -> Element:
    """The checkered floor; nothing touches it unless ``attributes`` say so.

    The last of its sizes is the mesh that light is computed on: fine, or else a spotlight leaves no round pool.
    """
    contact: dict[str, Value] = {"contype": 0.0, "conaffinity": 0.0}
    return element(
        "geom",
        name="floor",
        type="plane",
        pos=(0.0, 0.0, height),
        size=(0.0, 0.0, 0.02),
        material="floor",
        **(contact | attributes),
    )


def camera(
    name: str, pos: tuple[float, float, float], look: tuple[float, float, float], fovy: float
) -> Element:
    """A camera at ``pos`` (m) that looks along ``look``, its picture level."""
    x, y, _ = look
    return element(
        "camera",
        name=name,
        pos=pos,
        xyaxes=(y, -x, 0.0, *_up(look)),
        fovy=fovy,
    )


def _up(look: tuple[float, float, float]) -> tuple[float, float, float]:
    """The picture's upward axis: across the view and across its level axis."""
    x, y, z = look
    return (-x * z, -y * z, x * x + y * y)
