"""The `model:` section: the variables and statements that a MuJoCo model adds to a spec.

``scope`` reads the model and names its elements, ``paths`` turns paths into expressions, ``stars`` repeats statements
for paths with a star, ``statements`` has the equations of motion, bounds and replay lines, ``poses`` and ``mirror`` the
meaning of keyframes and other poses.  ``schedule`` reads the `contact:` section and ``contact`` states it, with
``surfaces``, ``cones`` and ``holdings``.  ``independence`` removes redundant constraints, ``start`` has the guess
between poses, and ``assembly`` combines all parts.
"""
