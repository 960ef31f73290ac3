"""A motion on the screen: MuJoCo's viewers, with the solved motion as a ghost beside its physics.

The logic (:mod:`~stc.viewer.player`) does not depend on a window; :mod:`~stc.viewer.windows` opens one of
MuJoCo's: Studio on the desktop or in a browser, or the older passive viewer.
"""
