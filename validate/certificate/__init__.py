"""The certificate of a motion: what was measured, against which limits, made by what, and how it looks.

    from stc.validate.certificate import certify

    certificate = certify("luxo_poses.npz")
    certificate.passed, certificate.headline
    certificate.write("luxo_poses.html")            # one page that needs nothing else

The terminal's table, the page and the failures of the pytest assertions are three views of the same rows
(:mod:`stc.validate.certificate.table`).  Where a motion fails, :mod:`stc.validate.certificate.blame` says in one line
which joint and which term to look at.
"""

from __future__ import annotations

from stc.validate.certificate.certificate import Certificate, ComparedEquations, certify

__all__ = ["Certificate", "ComparedEquations", "certify"]
