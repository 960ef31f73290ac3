"""The speed comparison: one module per family of tools, all stating the same problems.

:mod:`.problems` holds the numbers and equations, :mod:`.task` what every module offers, :mod:`.contenders` who
takes part, :mod:`.worker` is the fresh process of one measurement, :mod:`.runner` starts them in turn and
:mod:`.report` writes tables and plots.
"""
