"""Mechanisms: a MuJoCo model as plain data, and its equations of motion as expressions.

``read`` turns a file into the data of ``mechanism``; ``refusals`` lists its unsupported elements; ``dynamics`` has its
expressions: positions, velocities, momenta, energies, forces, and the residuals of the equations of motion.
``equalities`` has those of the model's own constraints.
"""
