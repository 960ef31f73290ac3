"""The `model:` section: what a MuJoCo model brings into a spec.

``scope`` reads the model and knows its things by name, ``paths`` makes expressions of them, ``statements`` writes the
equations of motion, bounds and replay lines, ``poses`` what keyframes and their like mean, ``contact`` what its feet
do.
"""
