"""The way from a recording to an explanation."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from stc.atomic import replacing
from stc.bundled import with_text
from stc.errors import Source, SpecError, StcError, UsageError
from stc.explaining.draft import FOLLOW, TABLE, Draft, draft
from stc.explaining.recording import Recording, read_recording
from stc.explaining.weights import Inverse, Weighing
from stc.mechanism.read import read_model
from stc.mechanism.refusals import refusals
from stc.pipeline import Model
from stc.records import dataclass, field
from stc.solution import Solution
from stc.studies.effort import Clock

__all__ = ["Explanation", "explain"]

FloatArray = NDArray[np.float64]

#: A motion is explained if its terms leave no more of its way than this share unexplained.
UNEXPLAINED = 0.1
#: A share that may be larger or smaller by this factor is unsure, and so is that of a term that was left out and may
#: have more than the second number.
UNSURE, NEGLIGIBLE = 1.5, 0.05
#: Weights of the effort beside the distance of a motion that follows the recorded one, one after the other.
_LITTLE = (1e-3, 1e-5, 1e-7)
_ITERATIONS, _FEW = 500, 100
#: A motion of the model that is this near to the recorded one, in rad and m, follows it.
_NEAR = 2e-4
#: Two motions nearer than this share of the motion's distance from the recorded one are the same.
_ALIKE = 0.2


@dataclass(slots=True)
class Explanation:
    """A spec that is proposed for a recorded motion, and how close its solution comes.

    Attributes
    ----------
    text
        The spec.
    table
        What the file ``recorded.csv`` that the spec names has to hold; nothing where it names none.
    solution
        Of the spec.
    shares
        By the name of each term that has a weight, its share of the objective.
    ranges
        By the name of each term that was tried, the bounds of its share as far as the recording tells: shares between
        them lead, with others of the other terms, to motions that differ by less than the noise.
    stationarity
        What is left of the gradient at the motion that follows the recorded one, under the weights that leave least: 0
        for an optimum of the terms, 1 for a motion that none of them explains.
    explained
        The share of the motion's way (its deviation from the straight way between its ends, squared) that the
        solution explains: 1 less what is left.
    joints, base
        Root mean square of the distance between the solution and the recorded motion: of joints in rad (slides in m),
        and of the base's place in m; 0 where nothing is a base.
    noise
        Standard deviation of the recording's noise, in rad or m.
    follows
        The same distance, over all coordinates, of the motion of the model that follows the recorded one best.
    stances
        By contact, the frames on which it stands.
    notes
        What a reader should know.
    """

    text: str
    table: str
    solution: Solution
    shares: dict[str, float]
    stationarity: float
    explained: float
    joints: float
    base: float
    noise: float
    follows: float
    stances: dict[str, list[tuple[int, int]]]
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    @property
    def unsure(self) -> list[str]:
        """The terms whose share the recording does not tell: it may be off by a factor, or that of one left out."""
        found = []
        for name, (low, high) in self.ranges.items():
            share = self.shares.get(name, 0.0)
            if high > max(UNSURE * share, NEGLIGIBLE) or low < share / UNSURE:
                found.append(name)
        return found

    @property
    def good(self) -> bool:
        """Whether a few terms explain the motion."""
        return self.solution.status == "optimal" and self.explained >= 1.0 - UNEXPLAINED

    def save(self, path: Path) -> list[Path]:
        """Write the spec, and beside it the table that it starts from where it names one; which files there are."""
        files = [path]
        text = self.text
        if self.table:
            beside = path.with_name(f"{path.stem}_{TABLE}.csv")
            text = text.replace(f'"{TABLE}.csv"', f'"{beside.name}"')
            with replacing(beside) as temporary:
                temporary.write_text(self.table, encoding="utf-8")
            files.append(beside)
        with replacing(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
        return files


def explain(
    motion: str | Path,
    model: str | Path,
    *,
    name: str = "explained",
    folder: str | Path = ".",
    time_limit: float | None = None,
    on_stage: Callable[[str], None] | None = None,
) -> Explanation:
    """Propose a short spec for a recorded motion.

    Parameters
    ----------
    motion
        A table of the motion, see :mod:`stc.explaining.recording`.
    model
        The model's file.
    name, folder
        What the spec will be called, and where it will be.
    time_limit
        Seconds for the search for weights, after which the best ones so far are used, with a note; None for no limit.
    on_stage
        Called with words for what is being done.

    Raises
    ------
    UsageError
        The table or the model cannot be used, or the model cannot follow the motion at all.
    """
    tell = on_stage or (lambda words: None)
    mechanism = read_model(Path(model))
    refused = refusals(mechanism)
    if refused:
        raise UsageError(f"{Path(model).name} cannot be stated: {refused[0]}")
    recording = read_recording(Path(motion), mechanism)
    made = draft(recording, name, Path(model), Path(folder))
    with TemporaryDirectory(prefix="stc-explain-") as place:
        stages = _Explaining(made, Path(motion).name, Path(model).resolve(), Path(place), tell)
        return stages.explanation(time_limit)


class _Explaining:
    """The stages, in a folder of their own.

    Attributes
    ----------
    follow
        The motion of the model that follows the recorded one, once it is known.
    stationarity
        What is left of the gradient there.
    """

    follow: Solution
    stationarity: float

    def __init__(
        self, made: Draft, motion: str, model: Path, place: Path, tell: Callable[[str], None]
    ) -> None:
        self.made, self.recording, self.place, self.tell = made, made.recording, place, tell
        self.motion = motion
        self.written, made.model = made.model, model.as_posix()
        times = np.linspace(0.0, self.recording.duration, made.n + 1)
        self.target = self.recording.at(times).T
        self.table = _table(self.recording, made.n)
        (place / f"{TABLE}.csv").write_text(self.table, encoding="utf-8")

    def explanation(self, time_limit: float | None) -> Explanation:
        """Carry out all stages; the search for weights ends after ``time_limit`` seconds."""
        made = self.made
        self.tell("follows the recorded motion")
        wanted = {term.name: f"w_{term.name}" for term in made.terms}
        model = self._candidate(wanted)
        self.follow = self._followed(model, wanted)
        clock = Clock(time_limit)
        inverse = Inverse(model, list(wanted.values()), self.recording.names, self.target, self.follow, clock)
        self.tell("looks for weights: stationarity")
        shares, self.stationarity = inverse.by_stationarity()
        self.tell("looks for weights: distance")
        weighed, ranges = self._weighed(inverse, shares), {}
        if weighed is not None:
            self.tell("leaves out terms")
            every, weighed = weighed, inverse.shortened(weighed)
            # Slopes change with the weights: both ends of the way are asked.
            bounds = [
                inverse.ranges(one, self.recording.noise, len(self.recording.time))
                for one in (every, weighed)
            ]
            low, high = np.minimum(*bounds)[:, 0], np.maximum(*bounds)[:, 1]
            ranges = dict(zip(wanted, zip(low.tolist(), high.tolist(), strict=True), strict=True))
        cut = clock.is_over
        explained = 0.0 if weighed is None else self._explained(weighed.solution)
        if weighed is None or explained < 1.0 - UNEXPLAINED:
            found = self._unexplained(weighed, explained)
        else:
            self.tell("solves the spec")
            found = self._explanation(inverse, weighed)
            found.ranges = ranges
            if found.unsure:
                found.notes.append(
                    "the noise of the recording hides how much "
                    + ", ".join(found.unsure)
                    + " counts: weights within the ranges lead to motions that differ by less than the noise"
                )
        if cut:
            found.notes.append(
                f"the search for weights ended at its time limit of {time_limit:g} s; with more (--search-time) the "
                "solution may come closer to the recorded motion, and the objective may have fewer terms"
            )
        return found

    def _model(self, text: str) -> Model:
        path = str(self.place / f"{self.made.name}.stc")
        return Model(with_text(Source(self.made.name, text, path)))

    def _candidate(self, wanted: Mapping[str, str]) -> Model:
        """The spec with all terms, each weighed by a constant, and the distance from the recorded motion."""
        constants = [(f"{weight} = 0", "") for weight in [FOLLOW, *wanted.values()]]
        return self._model(self.made.text(wanted, constants=constants, table=f"{TABLE}.csv", follow=FOLLOW))

    def _followed(self, model: Model, wanted: Mapping[str, str]) -> Solution:
        """The motion of the model nearest to the recorded one, with what the proposal states."""
        quiet = wanted["effort" if "effort" in wanted else "acceleration"]
        found: Solution | None = None
        for little in _LITTLE:
            # From coarse to fine: what is hardly weighed at all takes long from afar.
            try:
                most = _ITERATIONS if found is None else _FEW
                trial = model.solve(
                    max_iterations=most, warm_start=found, constants={FOLLOW: 1.0, quiet: little}
                )
            except SpecError as error:
                first = error.diagnostics[0].message
                raise UsageError(f"what the recorded motion seems to be cannot be stated: {first}") from error
            if trial.status != "optimal":
                break
            found = trial
            if self._distance(found) < max(_NEAR, self._noise):
                break
        if found is None:
            raise UsageError(
                f"no motion of the model was found that follows the recorded one: {trial.status}",
                "its contacts or ends may be others than they seem: compare the recording with the model's floor, "
                "masses and ranges",
            )
        return found

    def _weighed(self, inverse: Inverse, shares: FloatArray) -> Weighing | None:
        """The best weights, searched from those of stationarity, from effort alone nearly, and from all terms alike."""
        count = len(self.made.terms)
        alike = np.full(count, 1.0 / count)
        first = np.eye(count)[0]
        starts = [0.9 * shares + 0.1 * alike, 0.9 * first + 0.1 * alike, alike]
        trials = [trial for start in starts if (trial := inverse.weighed(start)) is not None]
        found: Weighing | None = None
        for start in sorted(trials, key=lambda trial: trial.distance)[:2]:
            trial = inverse.by_distance(start, self._on_round)
            if found is None or trial.distance < found.distance:
                found = trial
            if self._explained(found.solution) > 0.99:
                break
        return found

    def _on_round(self, distance: float) -> None:
        self.tell(f"looks for weights: {distance:.2g} rad (m) RMS from the recorded motion")

    @property
    def _noise(self) -> float:
        return float(np.sqrt(np.mean(self.recording.noise**2)))

    def _places(self, solution: Solution) -> FloatArray:
        """(nq, n+1) a motion at the frames of the draft."""
        times = np.linspace(0.0, self.recording.duration, self.made.n + 1)
        found = solution.at(np.minimum(solution.time[0] + times, solution.time[-1]))
        return np.array([found[name] for name in self.recording.names])

    def _explained(self, solution: Solution) -> float:
        """The share of the motion's way that a solution explains."""
        share = np.linspace(0.0, 1.0, self.made.n + 1)
        straight = self.target[:, :1] + (self.target[:, -1:] - self.target[:, :1]) * share
        way = float(np.sum((self.target - straight) ** 2))
        return 1.0 - float(np.sum((self._places(solution) - self.target) ** 2)) / max(way, 1e-300)

    def _explanation(self, inverse: Inverse, weighed: Weighing) -> Explanation:
        """The spec with the terms that have a weight, solved as it stands."""
        kept = [
            (term, float(share)) for term, share in zip(self.made.terms, weighed.shares, strict=True) if share
        ]
        numbers = inverse.constants_of(weighed.shares)
        weights = {term.name: f"{numbers[f'w_{term.name}']:.3g}" for term, _ in kept}
        shares = {term.name: share for term, share in kept}
        comments = {term.name: f"{_percent(share)}: {term.words}" for term, share in kept}
        head = [
            f"{self.made.name}: explains {self.motion}.  Written by `stc explain-motion`; every line may be changed.",
            "",
            "The objective has the terms under which the recorded motion is nearly optimal, each with its share.",
        ]
        for table, scale in (("", 1), (f"{TABLE}.csv", 1), ("", 2), (f"{TABLE}.csv", 2)):
            text = self.made.text(weights, head=head, comments=comments, table=table, scale=scale)
            solution = self._solved(text)
            if solution is None:
                continue
            gap = self._distance(solution)
            if gap > (1.0 + _ALIKE) * weighed.distance + 1e-4:
                continue
            if scale == 1 and not self._verified(solution):
                continue
            return self._made(text, table, solution, shares)
        # The last resort is the motion that was found, on frames that are too coarse for MuJoCo perhaps.
        text = self.made.text(weights, head=head, comments=comments, table=f"{TABLE}.csv")
        solution = self._solved(text) or weighed.solution
        return self._made(text, f"{TABLE}.csv", solution, shares)

    def _unexplained(self, weighed: Weighing | None, explained: float) -> Explanation:
        """A spec that follows the recording, for a motion that no term explains."""
        named = ", ".join(term.name for term in self.made.terms)
        note = (
            f"no weights of {named} lead to this motion: "
            + ("none was solved" if weighed is None else f"the best explain {_percent(explained)} of its way")
            + ".  The spec follows the recording instead.  If the motion had to pass places at certain times, state "
            "those under `constraints:`"
        )
        effort = "effort" if any(term.name == "effort" for term in self.made.terms) else "acceleration"
        head = [
            f"{self.made.name}: follows {self.motion}.  Written by `stc explain-motion`; every line may be changed.",
            "",
            "No weights of the terms that were tried explain this motion, so that the objective is its distance from",
            "the recorded one.",
        ]
        text = self.made.text({effort: f"{_LITTLE[1]:g}"}, head=head, table=f"{TABLE}.csv", follow="1")
        solution = self._solved(text) or self.follow
        made = self._made(text, f"{TABLE}.csv", solution, {})
        made.notes.append(note)
        made.explained = max(0.0, explained)
        return made

    def _solved(self, text: str) -> Solution | None:
        try:
            found = self._model(text).solve(max_iterations=_ITERATIONS)
        except StcError:
            return None
        return found if found.status == "optimal" else None

    def _verified(self, solution: Solution) -> bool:
        """Whether MuJoCo agrees with a motion."""
        from stc.certification import certify

        try:
            return certify(solution, equations=False).passed
        except StcError:
            return False

    def _distance(self, solution: Solution) -> float:
        return float(np.sqrt(np.mean((self._places(solution) - self.target) ** 2)))

    def _made(self, text: str, table: str, solution: Solution, shares: dict[str, float]) -> Explanation:
        gaps = self._places(solution) - self.target
        base = np.zeros(len(gaps), bool)
        for joint in self.recording.mechanism.joints:
            if self.recording.mechanism.bodies[joint.body].parent == 0:
                if joint.kind == "free":
                    base[joint.qpos : joint.qpos + 3] = True
                elif joint.kind == "slide":
                    base[joint.qpos] = True
        return Explanation(
            text.replace(f'model: "{self.made.model}"', f'model: "{self.written}"'),
            self.table if table else "",
            solution,
            shares,
            self.stationarity,
            self._explained(solution),
            _rms(gaps[~base]),
            _rms(gaps[base]),
            self._noise,
            self._distance(self.follow),
            {contact.name: contact.ranges for contact in self.made.touching},
        )


def _rms(gaps: FloatArray) -> float:
    return float(np.sqrt(np.mean(gaps**2))) if gaps.size else 0.0


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %"


def _table(recording: Recording, n: int) -> str:
    """The smoothed motion as a table at the frames and midpoints."""
    times = np.linspace(0.0, recording.duration, 2 * n + 1)
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    # A path in a spec names a column without the quotes about a part of it.
    writer.writerow(["time", *(name.replace('"', "") for name in recording.names)])
    for time, row in zip(times, recording.at(times), strict=True):
        writer.writerow([f"{time:.9g}", *(f"{value:.9g}" for value in row)])
    return stream.getvalue()
