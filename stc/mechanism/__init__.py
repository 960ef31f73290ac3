"""Mechanisms: a MuJoCo model as plain data, and its equations of motion as expressions.

``read`` turns a file into the data of ``mechanism``; ``refusals`` lists what of it cannot be stated; ``dynamics`` makes
expressions of it: places, velocities, momenta, energies, forces, and the rows that are 0 where a motion obeys the
equations of motion.  ``equalities`` does so for constraints that the model itself has.
"""
