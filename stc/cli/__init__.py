"""The command line: ``stc solve``, ``run``, ``validate``, ``check``, ``show``, ``list``, ``new``.

:mod:`stc.cli.main` starts and ends the process and turns errors into a message and an exit status
(:mod:`stc.cli.statuses`, :mod:`stc.cli.messages`), :mod:`stc.cli.app` declares the commands and their options,
:mod:`stc.cli.jobs` carries them out, :mod:`stc.cli.console` shows results to people, :mod:`stc.cli.record` to programs.
"""
