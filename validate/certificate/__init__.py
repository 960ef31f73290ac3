"""The certificate of a motion: its measurements with their limits, what produced them, and their presentation.

    from stc.validate.certificate import certify

    certificate = certify("luxo_poses.npz")
    certificate.passed, certificate.headline
    certificate.write("luxo_poses.html")            # one page that needs nothing else

The table in the terminal, the page and the failures of the pytest assertions show the same rows
(:mod:`stc.validate.certificate.table`).  If a motion fails, :mod:`stc.validate.certificate.blame` names the joint and
the term that are most likely wrong, in one line.
"""

from __future__ import annotations

from stc.validate.certificate.certificate import Certificate, ComparedEquations, certify

__all__ = ["Certificate", "ComparedEquations", "certify"]
