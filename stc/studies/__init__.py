"""Analyses that need several solves, or a spec and its model side by side.

:mod:`stc.studies.equations` compares a spec's equations of motion with its model's, :mod:`stc.studies.order`
observes how fast replays converge as frames are added, :mod:`stc.studies.statements` looks at a spec's own
statements between the frames of a solution.
"""
