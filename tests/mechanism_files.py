"""Small models as people write them: nested defaults, generated and attached parts, all kinds of actuators, loops.

Each is a file, with the files that it needs beside it.
"""

from __future__ import annotations

#: The files of each model by their names, ``model.xml`` first.
FILES: dict[str, dict[str, str]] = {
    "nested defaults": {
        "model.xml": """<mujoco><compiler angle="degree" autolimits="true"/>
  <default>
    <joint damping=".3" armature=".01"/><motor ctrlrange="-1 1"/>
    <default class="leg">
      <joint axis="0 1 0" range="-90 30" stiffness="4" springref="-20"/><geom type="capsule" size=".03"
  density="700"/>
      <default class="foot"><joint axis="1 0 0" damping="1" frictionloss="0"/><geom type="ellipsoid" size=".1 .05
  .02"/>
        <position kp="30" dampratio="1"/></default>
    </default>
  </default>
  <worldbody><body childclass="leg"><freejoint/><geom fromto="0 0 0 .2 0 .1"/>
    <body pos="0 0 -.1"><joint name="hip"/><geom fromto="0 0 0 0 .02 -.3"/>
      <body pos="0 .02 -.3" quat="2 0 .3 -.1"><joint name="ankle" class="foot"/><geom class="foot" mass=".4"/></body>
    </body></body></worldbody>
  <actuator><motor joint="hip" gear="30"/><position class="foot" joint="ankle" ctrlrange="-1
  1"/></actuator></mujoco>"""
    },
    "replicate, frame, mirrored axes": {
        "model.xml": """<mujoco><compiler angle="radian" eulerseq="zyx"/>
  <worldbody><site name="mark" pos="1 2 3"/>
    <frame pos=".1 0 1" euler=".3 .2 .1"><replicate count="3" euler="0 0 2.1" sep="_"><body name="arm" pos=".3 0 0">
      <joint name="j" axis="0 -3 1" pos=".01 .02 .03" ref=".2" springref=".1" stiffness="3"/>
      <geom type="box" size=".1 .02 .03" euler=".1 .5 .7"/>
      <frame axisangle="1 1 0 .5" pos=".1 0 0"><body name="tip"><joint name="s" type="slide" axis="1 0 2" ref="-.1"
        damping="2"/><geom type="cylinder" size=".02 .05"/><site name="end" zaxis="1 2 3"/></body></frame>
    </body></replicate></frame></worldbody>
  <actuator><velocity name="v" joint="j_0" kv="3" gear="-2"/><general site="end_1" refsite="mark" gear="1 2 3 .1 .2
  .3"
    gaintype="fixed" gainprm="2" biastype="affine" biasprm=".1 -.2 -.3"/></actuator></mujoco>"""
    },
    "attached": {
        "model.xml": """<mujoco><asset><model name="hand" file="hand.xml"/></asset><option gravity="3 -2 -9"/>
  <worldbody><body name="wrist"><joint type="ball" damping=".2" stiffness="3"/><geom size=".05"/>
    <frame pos="0 0 .1" quat="1 1 0 0"><attach model="hand" body="palm" prefix="L-"/></frame></body>
    <attach model="hand" prefix="R-"/></worldbody>
  <equality><joint joint1="L-finger" joint2="R-finger" polycoef="0 1 .2 0 0"/></equality></mujoco>""",
        "hand.xml": """<mujoco><compiler angle="radian"/><worldbody><body name="palm" gravcomp="1"><joint name="slip"
  type="slide" axis="1 1 0"/><geom
  type="box" size=".04 .03 .01"/><body name="f" pos=".04 0 0"><joint name="finger" axis="0 1 0" range="0 1.5"
  damping=".1"/>
  <geom type="capsule" fromto="0 0 0 .05 0 0" size=".01"/></body></body></worldbody>
  <actuator><intvelocity name="close" joint="finger" kp="5" kv=".2" actrange="0 1.5"/></actuator></mujoco>""",
    },
    "included": {
        "model.xml": """<mujoco><include file="options.xml"/><worldbody><include file="parts/leg.xml"/></worldbody>
  <include file="drives.xml"/></mujoco>""",
        "options.xml": '<mujocoinclude><option integrator="implicitfast" timestep=".004"/></mujocoinclude>',
        "parts/leg.xml": """<mujocoinclude><body name="leg"><joint name="x" type="slide"/><joint name="hinge"
  axis="1 1 0" armature=".2"/><joint name="z" type="slide" axis="0 0 1"/><geom type="capsule" size=".05"
  fromto="0 .1 0 0 .2 -1"/></body></mujocoinclude>""",
        "drives.xml": """<mujocoinclude><actuator><damper joint="x" kv="3" ctrlrange="0 2"/><cylinder joint="z"
  timeconst=".2"
  area="2" bias="1 2 3"/><general joint="hinge" dyntype="filterexact" dynprm=".3" gaintype="affine" gainprm="1 2 3"
  biastype="affine" biasprm="3 2 1"/></actuator></mujocoinclude>""",
    },
    "inertia from geoms": {
        "model.xml": """<mujoco><compiler inertiafromgeom="true" settotalmass="7" boundmass=".01"
  balanceinertia="true"
  alignfree="true"/><option integrator="implicit"/><worldbody><body name="a"><freejoint/>
  <inertial pos="1 2 3" mass="100" diaginertia="1 1 1"/><geom type="box" size=".1 .2 .3" pos=".1 .2 .3" euler="10 20
  30"/>
  <geom size=".2" group="4" density="300"/><body name="b" pos=".5 0 0"><joint type="ball" pos="-.1 0 0" range="0 40"
  limited="true" armature=".1" damping=".3"/><geom type="ellipsoid" size=".2 .1 .05" quat="1 2 3 4"
  shellinertia="true"/></body>
  </body></worldbody></mujoco>"""
    },
    "meshes and a field of heights": {
        "model.xml": """<mujoco><asset>
  <mesh name="wedge" vertex="0 0 0 .2 0 0 0 .3 0 0 0 .4" scale="1 .5 2" refpos=".1 0 0" inertia="convex"/>
  <hfield name="hills" nrow="3" ncol="3" size="2 2 .2 .1" elevation="0 0 0 0 1 0 0 0 0"/></asset>
  <worldbody><geom type="hfield" hfield="hills"/><geom type="mesh" mesh="wedge" pos="3 0 0"/>
    <body name="guide" mocap="true" pos="0 0 2"><geom size=".1" contype="0" conaffinity="0"/></body>
    <body name="a" pos="0 0 1"><freejoint/><geom type="mesh" mesh="wedge" density="500"/>
      <body name="b"><joint axis="1 2 3" pos=".1 .1 0"/><geom type="mesh" mesh="wedge" euler="0 90 0"/></body></body>
  </worldbody><contact><exclude body1="a" body2="b"/></contact></mujoco>"""
    },
    "tendons": {
        "model.xml": """<mujoco><worldbody><site name="w" pos="0 0 1"/>
  <body name="a"><joint name="p" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".02"/><site
  name="sa"/>
    <body name="b" pos=".3 0 0"><joint name="q" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .3 0 .1" size=".02"/>
      <site name="sb" pos=".2 0 0"/></body></body></worldbody>
  <tendon><fixed name="sum" range="-1 1" limited="true" stiffness="3" damping=".2" springlength=".1 .3"><joint
  joint="p"
    coef="1"/><joint joint="q" coef="-.5"/></fixed><spatial name="line" stiffness="20" springlength=".2" damping="1"
    armature=".1"><site site="w"/><site site="sb"/></spatial></tendon>
  <actuator><position name="pull" tendon="sum" kp="20" kv="2"/><motor tendon="line" gear="-3" forcerange="0
  10"/></actuator>
  <equality><tendon tendon1="sum" polycoef=".1 0 0 0 0"/></equality></mujoco>"""
    },
    "a loop": {
        "model.xml": """<mujoco><option><flag gravity="enable"/></option><worldbody>
  <body name="crank"><joint name="c" axis="0 -1 0" armature=".05"/><geom type="capsule" fromto="0 0 0 .2 0 0"
  size=".02"/>
    <body name="rod" pos=".2 0 0"><joint name="r" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .5 0 0"
  size=".02"/></body>
  </body><body name="rocker" pos=".7 0 0"><joint name="k" axis="0 1 0" damping=".1"/>
    <geom type="capsule" fromto="0 0 0 0 0 .3" size=".02"/></body></worldbody>
  <equality><weld body1="rod" body2="rocker" torquescale=".5"/><connect body1="crank" anchor="0 0 0" active="false"/>
  </equality><actuator><motor joint="c" gear="5"/></actuator></mujoco>"""
    },
    "in a medium": {
        "model.xml": """<mujoco><option density="1000" viscosity=".9" wind=".3 -.2 .1"/>
  <default><geom type="ellipsoid" fluidshape="ellipsoid"/></default><worldbody>
  <body name="fish" pos="0 0 1"><freejoint/><geom size=".1 .03 .05" quat="1 .2 0 .3"/><geom size=".02 .03 .01"
  mass="0" pos=".1 0 .02" fluidcoef=".3 .1 1 .7 .2"/>
    <body pos="-.1 0 0"><joint axis="0 .1 1" stiffness=".1"/><geom size=".06 .005 .04" pos="-.06 0 0"/>
      <body pos="-.1 0 .01"><joint type="ball" damping=".01"/><geom type="capsule" size=".01 .03" euler="0 40 9"/>
      </body></body>
    <body pos="0 .03 0"><joint axis="1 0 0"/><geom type="box" size=".02 .04 .005" pos="0 .04 0" fluidshape="none"/>
      <geom type="cylinder" fluidshape="none" size=".01 .02" pos=".02 .1 0"/></body></body>
  <body pos="0 0 3" gravcomp=".9"><joint type="slide"/><geom type="sphere" size=".1"/></body></worldbody></mujoco>"""
    },
    "slider and crank": {
        "model.xml": """<mujoco><option integrator="RK4"/><worldbody><body name="wheel"><joint name="spin" axis="0 1
  0"/>
  <geom type="cylinder" size=".2 .02" zaxis="0 1 0"/><site name="pin" pos=".15 0 0"/></body>
  <site name="slot" pos=".5 0 0" zaxis="-1 0 0"/><body name="cart" pos="0 1 0" euler="0 0 45"><joint name="push"
  type="slide" axis="1 0 0" springdamper=".2 .7"/><geom size=".1"/><body><joint name="turn" type="ball"/><geom
  type="box" size=".1 .1 .2"/></body></body></worldbody>
  <actuator><motor cranksite="pin" slidersite="slot" cranklength=".6"/><general jointinparent="turn" gear="1 2 3"
  dyntype="integrator" gainprm="2" biastype="affine" biasprm="0 -1 -.1" actlimited="true" actrange="-2 2"/>
  <position joint="push" timeconst=".1" kp="9" inheritrange="0" ctrlrange="-1 1"/></actuator></mujoco>"""
    },
    "no masses drawn": {
        "model.xml": """<mujoco><compiler angle="radian" discardvisual="true" fusestatic="true"/><worldbody>
  <body name="base"><body name="mount" pos="0 0 .5" quat="0 0 0 5"><inertial pos="0 0 .1" mass="2" fullinertia=".3 .4
  .5
  .01 .02 -.03"/><joint name="yaw" axis="0 0 1" damping=".1"/><body name="fixed" pos=".1 0 0" euler="1 0 0"><inertial
  pos=".2 0 0" mass="1" diaginertia=".1 .2 .25" quat="1 2 0 0"/><body name="end" pos="0 0 .4"><inertial pos="0 0 0"
  mass=".5"
  diaginertia=".01 .01 .01"/><joint name="pitch" axis="0 1 0"/><joint name="roll" axis="1 0 0" pos="0 0
  .1"/></body></body>
  </body></body></worldbody>
  <sensor><framepos objtype="body" objname="end"/><jointpos joint="yaw"/></sensor>
  <keyframe><key qpos=".1 .2 .3"/></keyframe></mujoco>"""
    },
}
