"""The `model:` section: what a MuJoCo model brings into a spec.

``scope`` reads the model and knows its things by name, ``paths`` makes expressions of them, ``statements`` writes the
equations of motion, bounds and replay lines, ``poses`` and ``mirror`` what keyframes and their like mean.  ``schedule``
reads the `contact:` section and ``contact`` states it, with ``surfaces``, ``cones`` and ``holdings``.  ``independence``
leaves out what other rows imply, ``start`` guesses the way between poses, and ``assembly`` puts all of it together.
"""
