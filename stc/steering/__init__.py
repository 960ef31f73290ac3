"""Steering by hand: a handle of the picture or a number of the spec is dragged, and the motion follows.

:mod:`~stc.steering.knobs` finds the numbers of a spec that can be steered and writes them back into its text.
:mod:`~stc.steering.pose_handles` and :mod:`~stc.steering.stated_handles` find the points of the body that can be
dragged.  :mod:`~stc.steering.session` solves for what is dragged, undoes and saves, and :mod:`~stc.steering.server`
shows it in a browser.
"""
