"""From a recorded motion to a short spec whose solution is close to it: ``stc explain-motion``.

    recording -> stances, ends (draft) -> a motion that follows it -> weights -> the spec, solved

:func:`explain` does all of that; :mod:`stc.explaining.recording` reads tables, :mod:`stc.explaining.stances` finds when
what touches the floor, :mod:`stc.explaining.draft` what is fixed at both ends, and :mod:`stc.explaining.weights` the
weights of the terms in :mod:`stc.explaining.terms` under which the motion is optimal.
"""

from stc.explaining.explanation import Explanation, explain

__all__ = ["Explanation", "explain"]
