"""The course of a solve, around the optimizer: which problems are solved, from which starts, and what results.

:mod:`~stc.solving.solve` begins here: it solves a transcription directly, or first on fewer frames
(:mod:`~stc.solving.fewer_frames`), with products that are reduced to zero (:mod:`~stc.solving.complementarity`), or
reaching for the last frame (:mod:`~stc.solving.free_end`).  :mod:`~stc.solving.collect` makes a solution of the result.
"""
