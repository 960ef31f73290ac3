"""The problems and transcriptions of a spec; the last ones are kept.

Problems that differ only in constants that are inputs of the compiled program share a transcription.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from stc.language.constant_values import ConstantValues
from stc.language.elaborate import elaborate
from stc.problem import Problem
from stc.transcription import Transcription, transcribe

if TYPE_CHECKING:
    from stc.language.syntax import SpecTree

#: Sets of constants for which the problem is kept.
RECENT = 8
#: Transcriptions that are kept: those of several numbers of frames, and on fewer of each.
KEPT = 24


class KeptTranscriptions:
    """Problems of one spec, with their shared transcriptions."""

    def __init__(self, tree: SpecTree) -> None:
        self._tree, self._values = tree, ConstantValues(tree)
        self._kept: dict[object, Transcription] = {}  # by method and structural constants
        self._own_method = ""  # the spec's, once it is known
        self._recent: dict[object, tuple[Problem, Transcription]] = {}  # by the constants given last
        self._problems: dict[object, Problem] = {}  # elaborated last, by method and the constants given

    def __len__(self) -> int:
        return len(self._kept)

    def problem(self, method: str | None, given: Mapping[str, float]) -> Problem:
        """The problem with some constants; it is elaborated once for consecutive requests.

        Args:
            method: that of transcription; None for that of the spec.
            given: values of constants, in place of the spec's.

        Raises:
            SpecError: mistakes in the spec, all of them.
            UsageError: an unknown constant.
        """
        numbers = tuple(sorted(given.items()))
        known = self._problems.get((method or self._own_method, numbers))
        if known is not None:
            return known
        problem = elaborate(self._tree, given, method)
        if method is None:
            self._own_method = problem.method
        if len(self._problems) >= RECENT:
            del self._problems[next(iter(self._problems))]
        self._problems[problem.method, numbers] = problem
        return problem

    def of(self, method: str | None, given: Mapping[str, float]) -> tuple[Problem, Transcription]:
        """The problem with some constants and its transcription, an earlier one where only numbers have changed.

        Args:
            method: that of transcription; None for that of the spec.
            given: values of constants, in place of the spec's.

        Raises:
            SpecError: mistakes in the spec, all of them.
            UsageError: an unknown constant.
        """
        known = self.known(method, given)
        if known is not None:
            return known
        problem = self.problem(method, given)
        key = (problem.method, tuple((name, problem.constants[name]) for name in sorted(problem.structural)))
        # What is asked for comes last, what has not been for long goes.
        known_before = key in self._kept
        self._kept[key] = self._kept.pop(key) if known_before else transcribe(problem)
        if len(self._kept) > KEPT:
            del self._kept[next(iter(self._kept))]
        return problem, self._kept[key]

    def known(self, method: str | None, given: Mapping[str, float]) -> tuple[Problem, Transcription] | None:
        """As :meth:`of` if a fitting transcription is found without elaborating the spec; else None."""
        wanted = method or self._own_method
        numbers = wanted, tuple(sorted(given.items()))
        if numbers in self._recent:
            return self._recent[numbers]
        if not any(kept.problem.method == wanted for kept in self._kept.values()):
            return None
        values = self._values(given)
        for kept in self._kept.values():
            problem = kept.problem
            fits = problem.method == wanted and values.keys() == problem.constants.keys()
            # Steps that are not positive are a mistake that elaboration explains.
            if (
                fits
                and all(values[k] == problem.constants[k] for k in problem.structural)
                and kept.steps_fit(values)
            ):
                if len(self._recent) >= RECENT:
                    del self._recent[next(iter(self._recent))]
                self._recent[numbers] = replace(problem, constants=values), kept
                return self._recent[numbers]
        return None
