"""The pendulum on a cart: one description of its solids, from which come meshes, inertias, MJCF and constants.

The cart slides along x on a rail; the pole hangs from it, its angle zero when the bob is straight below and positive
towards +x.  A force on the cart is the only motor.  The numbers are those of Kelly (2017), but the pole's mass is a
bob with a size: its moment of inertia is a quarter of a per cent of what its mass has about the hinge.  With the
moment set to zero the problem is Kelly's to the letter.
"""

from __future__ import annotations

import trimesh
from trimesh import creation

from stc.models import stage
from stc.models.description import Description, Measure
from stc.models.mjcf import Element, document, element, hinge, inertial, material, meshes, motors, seen, slide
from stc.models.shapes import ball, knob, rod, slab, together
from stc.models.solids import Inertia, Solid, inertia_of

CART = (0.30, 0.16, 0.12)
"""Length, width and height of the cart, m."""

POLE, BOB_RADIUS = 0.5, 0.04
"""From the hinge to the middle of the bob and the bob's radius, m; the rod in between weighs nothing."""

CART_MASS, BOB_MASS = 1.0, 0.3
"""kg."""

HEIGHT, TRAVEL = 0.9, 2.0
"""Height of the hinge above the floor, and how far the cart may go to either side, m."""


def bodies() -> tuple[Inertia, Inertia]:
    """Weigh cart and pole, each in its own frame."""
    cart = Solid(creation.box(CART), CART_MASS)
    bob = Solid(ball(BOB_RADIUS, (0.0, 0.0, 0.0)), BOB_MASS, (0.0, 0.0, -POLE))
    return inertia_of([cart]), inertia_of([bob])


def measures(cart: Inertia, pole: Inertia) -> dict[str, Measure]:
    """The constants of the specs, by the names they have there."""
    return {
        "m1": Measure(cart.mass, "kg", "mass of the cart"),
        "m2": Measure(pole.mass, "kg", "of the bob"),
        "I2": Measure(pole.moments[1], "kg m^2", "moment of inertia of the bob about its middle"),
        "l": Measure(-pole.centre[2], "m", "from the hinge to the bob's middle"),
        "dmax": Measure(TRAVEL, "m", "how far the cart may go to either side"),
    }


def shapes() -> dict[str, trimesh.Trimesh]:
    """What is seen, by name; each in the frame of its body."""
    length, width, height = CART
    reach, side, below = TRAVEL + 0.25, 0.055, -height / 2 - 0.014
    hub = -width / 2 - 0.03
    wheels = [(x, y, below) for x in (-0.1, 0.1) for y in (-side, side)]
    legs = [((x, 0.0, below - 0.01), (x, 0.0, -HEIGHT)) for x in (-reach + 0.05, reach - 0.05)]
    return {
        "cart_pole_cart": slab((length, width, height), 0.03, 0.02, (0.0, 0.0, -height / 2)),
        "cart_pole_wheels": together(*(knob(0.022, 0.016, at, 0.002, 24) for at in wheels)),
        "cart_pole_rail": together(
            *(rod(0.01, (-reach, y, below - 0.03), (reach, y, below - 0.03), 20) for y in (-side, side)),
            *(rod(0.016, *leg, 24) for leg in legs),
            *(knob(0.02, 0.17, (leg[0][0], 0.0, below - 0.03), 0.003) for leg in legs),
            *(slab((0.3, 0.3, 0.02), 0.06, 0.006, leg[1]) for leg in legs),
        ),
        "cart_pole_hub": knob(0.03, 0.06, (0.0, hub + 0.02, 0.0), 0.004, 36),
        "cart_pole_pole": together(
            rod(0.008, (0.0, hub, 0.0), (0.0, hub, -POLE + BOB_RADIUS / 2), 20),
            knob(0.022, 0.02, (0.0, hub - 0.006, 0.0), 0.003, 32),
        ),
        "cart_pole_bob": ball(BOB_RADIUS, (0.0, hub, -POLE)),
    }


MATERIALS = [
    material("enamel", (0.16, 0.37, 0.62), 0.8, 0.8),
    material("iron", (0.27, 0.29, 0.33), 0.4, 0.4),
    material("rubber", (0.08, 0.08, 0.09), 0.1, 0.1),
    material("steel", (0.74, 0.76, 0.79), 0.9, 0.8),
    material("brass", (0.87, 0.66, 0.28), 0.9, 0.9),
]


def _cart(cart: Inertia, pole: Inertia) -> Element:
    hanging = element(
        "body",
        inertial(pole),
        hinge("pole", axis=(0.0, -1.0, 0.0)),
        seen("cart_pole_pole", "steel"),
        seen("cart_pole_bob", "brass"),
        element("site", name="bob", pos=pole.centre, size=(0.01,), rgba=(0.0, 0.0, 0.0, 0.0)),
        name="pole",
    )
    return element(
        "body",
        inertial(cart),
        slide("cart", axis=(1.0, 0.0, 0.0), range=(-TRAVEL, TRAVEL), limited=False),
        seen("cart_pole_cart", "enamel"),
        seen("cart_pole_wheels", "rubber"),
        seen("cart_pole_hub", "iron"),
        hanging,
        name="cart",
        pos=(0.0, 0.0, HEIGHT),
    )


def describe() -> Description:
    """The cart with its pole as ``cart_pole.xml``."""
    cart, pole = bodies()
    world = element(
        "worldbody",
        stage.sun(),
        stage.lamp((0.9, -1.6, 2.8), (-0.16, 0.55, -0.82)),
        stage.camera("side", (0.5, -3.3, 1.3), (0.0, 1.0, -0.14), 36.0),
        stage.camera("portrait", (1.9, -2.6, 1.5), (-0.50, 0.84, -0.22), 38.0),
        stage.floor(),
        seen("cart_pole_rail", "iron", pos=(0.0, 0.0, HEIGHT)),
        _cart(cart, pole),
    )
    text = document(
        "cart_pole",
        "A pendulum on a cart.\n"
        "Written by `python -m stc.models.build` from models/cart_pole.py: change that file and run it again.",
        element("compiler", angle="radian", meshdir="meshes", autolimits=False),
        stage.options(1e-3),
        *stage.picture((0.5, 0.0, 0.8), 2.0),
        stage.defaults(),
        element("asset", *stage.assets(), *MATERIALS, *meshes(shapes())),
        world,
        motors("cart"),
    )
    return Description("cart_pole", measures(cart, pole), {"cart_pole.xml": text}, shapes())
