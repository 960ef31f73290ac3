"""From the text of a spec to a :class:`stc.problem.Problem`."""
