"""LDL^T of a sparse symmetric matrix in a window that slides over the stages, with threshold pivoting.

At each stage the rows of its unknowns are added to the window, and the unknowns are taken out in the planned
order by 1x1 and 2x2 pivots:

    1x1   d = a_pp                 accepted when  |d| >= u max_j |a_pj|
    2x2   D = [a_pp a_pq]          accepted when  |D^-1| [max_j |a_pj|] <= 1/u  (in each row)
              [a_pq a_qq]                                [max_j |a_qj|]

(Duff and Reid 1983), so no factor exceeds 1/u.  What is not accepted is tried again after the others, then delayed
to the next stage; at the last one, pivots are chosen by size alone (Bunch and Parlett 1971).  The entries are
expected equilibrated, near 1.

Columns are gathered along the planned lists of slots; what to do where not all goes to plan is found in
stc.solver.kkt.unplanned.
"""

from __future__ import annotations

from stc.core.functions import function

__all__ = ["FACTORS_FULL", "HOPELESS", "WINDOW_FULL", "factorize"]

#: Results of ``factorize``.
FACTORS_FULL = 1
WINDOW_FULL = 2
HOPELESS = 3


#: Factorise; the window must be zero and is left so when the result is 0.
factorize = function("elimination_factorize")
