"""Small models, each about one thing that a mechanism may have."""

from __future__ import annotations

import re

#: Bodies with masses off their joints and turned inertias; {joint} stands where their joints go.
BODY = '<inertial pos=".1 .05 -.2" mass="{mass}" fullinertia=".03 .05 .04 .01 -.005 .008"/>'


def chain(*joints: str, rest: str = "", options: str = "", extra: str = "") -> str:
    """A chain of bodies, each with the given joints, and what else belongs to the model."""
    opened = "".join(
        f'<body name="b{k}" pos=".2 -.1 .3" euler="20 {30 * k} 50">{each}{BODY.format(mass=1 + k)}'
        f'<site name="s{k}" pos=".1 .2 -.1" euler="10 20 30"/>{extra}'
        for k, each in enumerate(joints)
    )
    return (
        f'<mujoco><option {options}/><worldbody><site name="s" pos=".3 .1 .2" euler="5 6 7"/>{opened}'
        f"{'</body>' * len(joints)}</worldbody>{rest}</mujoco>"
    )


def hinge(name: str, axis: str = "1 2 -1", more: str = "") -> str:
    return f'<joint name="{name}" axis="{axis}" pos=".05 -.02 .1" {more}/>'


BALL = '<joint name="{0}" type="ball" pos=".05 0 .1" {1}/>'
SLIDE = '<joint name="{0}" type="slide" axis="1 -1 2" {1}/>'
FREE = '<joint name="{0}" type="free" {1}/>'
TWO = (hinge("a"), hinge("b", "0 0 1"))
ON_ALL = (FREE.format("root", ""), BALL.format("ball", ""), hinge("a"), SLIDE.format("way", ""))


def on(*actuators: str) -> str:
    return f"<actuator>{''.join(actuators)}</actuator>"


#: Models by the term that they are about.
TERMS = {
    "several joints on a body": chain(
        hinge("a") + SLIDE.format("b", "") + hinge("c", "0 -1 0") + hinge("d", "0 0 1"),
        BALL.format("e", "") + SLIDE.format("f", ""),
    ),
    "positions that the file does not draw at zero": chain(
        hinge("a", more='ref="25" springref="-10" stiffness="3"'), SLIDE.format("b", 'ref=".4" stiffness="2"')
    ),
    "axes that are nearly those of the parent": re.sub(
        ' euler="[^"]*"',
        "",
        chain(
            *[
                hinge(f"j{k}", axis)
                for k, axis in enumerate(("1 3e-8 0", "0 -1 1e-7", "1e-13 0 1", "0 1 1e-15"))
            ]
        ),
    ),
    "free, ball, hinge and slide": chain(*ON_ALL),
    "springs of ball and free joints": chain(
        FREE.format("root", 'stiffness="7"'), BALL.format("ball", 'stiffness="5"')
    ),
    "damping and armature of all joints": chain(
        FREE.format("root", 'damping=".3" armature=".2"'),
        BALL.format("ball", 'damping=".2" armature=".1"'),
        hinge("a", more='damping=".1" armature=".3"'),
    ),
    "polynomial damping": chain(
        hinge("a", more='damping=".3 .2 .1"'),
        SLIDE.format("b", 'damping="0 .5"'),
        BALL.format("c", 'damping=".1 .2"'),
    ),
    "polynomial stiffness": chain(
        hinge("a", more='stiffness="3 2 1" springref="20"'),
        SLIDE.format("b", 'stiffness="0 0 4"'),
        BALL.format("c", 'stiffness="5 2 1"'),
    ),
    "polynomial stiffness of a free joint": chain(FREE.format("a", 'stiffness="5 .2 .1"')),
    "compensated weight": chain(*TWO).replace('name="b1"', 'name="b1" gravcomp=".7"'),
    "compensated weight by actuators": chain(
        hinge("a", more='actuatorgravcomp="true"'),
        hinge("b", "0 0 1"),
        BALL.format("c", 'actuatorgravcomp="true"'),
    ).replace("<body ", '<body gravcomp=".6" '),
    "a fixed tendon": chain(
        *TWO,
        rest='<tendon><fixed stiffness="20 3 2" damping="3 1 2" armature=".2"><joint joint="a" coef=".7"/>'
        '<joint joint="b" coef="-1.2"/></fixed></tendon>',
    ),
    "a tendon that is slack in a range": chain(
        *TWO,
        rest='<tendon><fixed stiffness="20 3 2" springlength="-.3 .4"><joint joint="a" coef=".7"/>'
        '<joint joint="b" coef="-1.2"/></fixed></tendon>',
    ),
    "a tendon in space": chain(
        *ON_ALL,
        rest='<tendon><spatial stiffness="20" springlength=".1" damping="3" armature=".2"><site site="s"/>'
        '<site site="s1"/><site site="s3"/><pulley divisor="2"/><site site="s0"/><site site="s2"/></spatial></tendon>',
    ),
    "no gravity, springs": chain(*TWO, hinge("c", more='stiffness="3" damping="2"'), options="").replace(
        "<option />", '<option><flag gravity="disable" spring="disable"/></option>'
    ),
    "no dampers": chain(*TWO, hinge("c", more='stiffness="3" damping="2"')).replace(
        "<option />", '<option><flag damper="disable"/></option>'
    ),
    "neither springs nor dampers": chain(*TWO, hinge("c", more='stiffness="3" damping="2"'))
    .replace("<body ", '<body gravcomp=".6" ')
    .replace("<option />", '<option><flag damper="disable" spring="disable"/></option>'),
    "gravity in any direction": chain(*ON_ALL, options='gravity="1 2 -3"'),
    "bodies fixed to bodies": chain(
        *ON_ALL,
        extra=f'<body pos=".1 .1 .2" euler="30 0 10">{BODY.format(mass=2)}<body pos=".1 0 0">'
        f"{BODY.format(mass=1)}</body></body>",
    ),
    "motors on all joints": chain(
        *ON_ALL,
        rest=on(
            *[f'<motor joint="root" gear="{gear}"/>' for gear in ("1 2 3 4 5 6", "0 0 0 1")],
            '<motor joint="ball" gear="1 -2 3"/>',
            '<motor jointinparent="ball" gear="2 1 -1"/>',
            '<motor jointinparent="root" gear="1 2 3 -1 2 1"/>',
            '<motor joint="a" gear="30"/><motor joint="way" gear="-2"/>',
        ),
    ),
    "servos": chain(
        *TWO,
        SLIDE.format("c", ""),
        rest=on(
            '<position joint="a" kp="20" kv="2" gear="3"/>',
            '<velocity joint="b" kv="4" gear="2"/>',
            '<intvelocity joint="c" kp="9" kv="1"/>',
            '<damper joint="a" kv="3" ctrlrange="0 2"/>',
            '<cylinder joint="b" timeconst=".3" area="2" bias="1 2 3"/>',
            '<position joint="b" kp="5" timeconst=".1"/>',
            '<position joint="c" kp="5" dampratio="1" inheritrange="0"/>',
        ),
    ),
    "general actuators": chain(
        *TWO,
        rest=on(
            '<general joint="a" gainprm="3 2 1" gaintype="affine" biastype="affine" biasprm="1 2 3" gear="2"/>',
            '<general joint="b" dyntype="integrator" gainprm="3"/>',
            '<general joint="b" dyntype="filter" dynprm=".2" gainprm="3"/>',
            '<general joint="a" dyntype="filterexact" dynprm=".3" gainprm="2" biastype="affine" biasprm="0 0 -1"/>',
        ),
    ),
    "controllers": chain(
        *TWO,
        BALL.format("ball", ""),
        rest=on(
            '<pid joint="a" kp="3" kv="1" gear="2"/>',
            '<pid joint="b" kp="3" kv="1" ki="2" input="pos vel ff"/>',
            '<pid joint="b" kp="3" input="pos"/>',
            '<pid joint="ball" kp="3" kv=".5" ki="2" gear="1 -1 2"/>',
        ),
    ),
    "electric motors": chain(
        *TWO,
        rest=on(
            '<dcmotor joint="a" motorconst=".5" resistance="2" gear="3"/>',
            '<dcmotor joint="b" motorconst=".5" resistance="2" inductance=".1 0" cogging=".3 4 .5"/>',
            '<dcmotor joint="b" motorconst=".5" resistance="2" input="pos vel ff" controller="3 2 1"/>',
            '<dcmotor joint="a" motorconst=".5" resistance="2" input="pos" inductance=".1 0" controller="3 2 1"/>',
            '<dcmotor joint="a" motorconst=".5" resistance="2" input="none"/>',
        ),
    ),
    "servos of ball joints": chain(
        BALL.format("ball", ""),
        rest=on(
            '<position joint="ball" kp="20" kv="2" gear="1 2 -1"/>',
            '<position jointinparent="ball" kp="20" gear="0 1 0"/>',
            '<intvelocity joint="ball" kp="20" gear="0 0 2"/>',
        ),
    ),
    "drives with damping and armature": chain(
        *TWO,
        BALL.format("c", ""),
        rest='<tendon><fixed name="t"><joint joint="a" coef=".7"/></fixed></tendon>'
        + on(
            '<motor joint="a" gear="3" damping=".2 .1 .3" armature=".05"/>',
            '<motor joint="a" gear="2" damping=".2" armature=".02"/>',
            '<motor joint="c" gear="2 1 0" damping=".1" armature=".01"/>',
            '<motor tendon="t" gear="2" damping=".1 .2" armature=".03"/>',
        ),
    ),
    "actuators on tendons": chain(
        *TWO,
        rest='<tendon><fixed name="t"><joint joint="a" coef=".7"/><joint joint="b" coef="2"/></fixed>'
        '<spatial name="w"><site site="s"/><site site="s1"/></spatial></tendon>'
        + on(
            '<position tendon="t" kp="3" kv="1" gear="2"/>', '<position tendon="w" kp="3" kv="1" gear="2"/>'
        ),
    ),
    "actuators on sites": chain(
        *ON_ALL,
        rest=on(
            '<motor site="s2" gear="1 2 3 4 5 6"/>',
            '<general site="s3" gear="1 0 0 0 0 0" gainprm="2" biastype="affine" biasprm="1 2 3"/>',
        ),
    ),
    "actuators between sites": chain(
        *ON_ALL,
        rest=on(
            '<position site="s3" refsite="s1" kp="3" kv="1" gear="1 2 3 0 0 0"/>',
            '<position site="s2" refsite="s3" kp="3" kv="1" gear="0 0 0 1 -1 2"/>',
            '<position site="s2" refsite="s" kp="3" kv="1" gear="1 2 3 2 1 0"/>',
            '<motor site="s1" refsite="s1" gear="1 2 3 2 1 0"/>',
        ),
    ),
    "a slider and a crank": chain(
        hinge("a"),
        rest=on('<position cranksite="s0" slidersite="s" cranklength="3" kp="4" kv="1" gear="2"/>'),
    ),
    "switched-off actuators": chain(
        *TWO,
        rest=on('<motor joint="a" group="2"/>', '<motor joint="b"/>'),
        options='actuatorgroupdisable="2"',
    ),
    "no actuation": chain(hinge("a", more='actuatorgravcomp="true"'), rest=on('<motor joint="a"/>'))
    .replace("<body ", '<body gravcomp=".6" ')
    .replace("<option />", '<option><flag actuation="disable"/></option>'),
}

#: Models by what their bodies hang on.
TREES = {
    "on a free body": chain(
        *ON_ALL, extra='<geom type="box" size=".1 .2 .3" pos=".1 .2 .3" euler="10 20 30" mass="0"/>'
    ),
    "on the world": chain(
        hinge("a") + SLIDE.format("b", ""),
        BALL.format("c", ""),
        extra='<geom type="box" size=".1 .2 .3" pos=".1 .2 .3" euler="10 20 30" mass="0"/>',
    ),
    "two free bodies": chain(FREE.format("a", ""), hinge("b")).replace(
        "</worldbody>",
        f'<body name="other" pos="1 2 3">{FREE.format("c", "")}<geom size=".1" pos=".1 .1 0"/></body></worldbody>',
    ),
}
