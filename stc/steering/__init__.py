"""Steering by hand: a handle of the picture or a number of the spec is dragged, and the motion follows.

:mod:`~stc.steering.knobs` finds the numbers of a spec that can be steered and writes them back into its text,
:mod:`~stc.steering.handles` the points of the body that can be dragged, and :mod:`~stc.steering.session` solves for what
is dragged, undoes and saves.  :mod:`~stc.steering.server` shows it in a browser.
"""
