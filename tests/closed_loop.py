"""A bar that hangs by two rods: the loop that they make is closed by an equality of the model."""

#: What is in the model: the rods and the bar with their joints, what closes the loop, a motor at one of the rods.
PARALLELOGRAM = """\
  <worldbody>
    <body name="left">
      <inertial pos="0 0 -0.2" mass="1" diaginertia="0.02 0.02 0.02"/>
      <joint name="left" axis="0 -1 0"/>
      <body name="bar" pos="0 0 -0.4">
        <inertial pos="0.3 0 0" mass="3" diaginertia="0.1 0.1 0.1"/>
        <joint name="bar" axis="0 -1 0"/>
      </body>
    </body>
    <body name="right" pos="0.6 0 0">
      <inertial pos="0 0 -0.2" mass="1" diaginertia="0.02 0.02 0.02"/>
      <joint name="right" axis="0 -1 0"/>
    </body>
  </worldbody>
  <equality><connect body1="bar" body2="right" anchor="0.6 0 0"/></equality>
  <actuator><motor name="torque" joint="left"/></actuator>
"""
