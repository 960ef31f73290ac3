"""The elastic form of a problem and its linear system, compiled (see :mod:`stc.solver.elastic`).

The method and its code are in ``stc/core/iteration/elastic.c``.
"""

from __future__ import annotations

from stc.core.functions import function

#: The calls of an attempt to factorise: what comes before, and the attempt of the problem's own system.
ELIMINATE, ATTEMPT, CALLS = 0, 1, 2

#: The elastic objective and rows, from the problem's own.
values = function("elastic_values")
#: The elastic gradient and Jacobian, but for the parts of p and q, which are constant.
derivatives = function("elastic_derivatives")
#: Note the problem's own objective in the user's terms.
state = function("elastic_state")
#: Hand on a matrix without p and q, whose diagonal is inverted, (2 * m,).
eliminate = function("elastic_eliminate")
#: Factorise where all goes as it did before; what the problem's own system says of it.
attempt = function("elastic_attempt")
#: The right-hand side without p and q.
hand_on = function("elastic_hand_on")
#: The solution with p and q.
complete = function("elastic_complete")
