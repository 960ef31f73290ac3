"""Transcription: from the problem in continuous time to a nonlinear program, and back.

The steps, one file each:

==============  ====================================================================
grid            frames, midpoints, sides of jumps; which piece of a definition holds
steps           steps and times over their basis
layout          positions in the decision vector
schemes         stencils, links and quadrature weights as data
lower           expressions of the spec as expressions of decision variables
statements      relations into rows and bounds, the objective into weighted sums
stated          the problem on its frames: all of the above
assemble        groups, kernels' tapes, index tables, sparsity
guess           the starting point
bind            the nonlinear program with its numbers
recover         decision vectors as node values
==============  ====================================================================
"""

from __future__ import annotations

from stc.transcription.transcription import Transcription, transcribe

__all__ = ["Transcription", "transcribe"]
