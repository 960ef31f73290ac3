"""Cases of the fuzzer: a command line and the files that it finds, all from one seed and a number."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import stc
from fuzz import mutations
from stc import models, specs

#: Bundled specs that are solved within a fraction of a second with few frames.
QUICK = ("particle_waypoints", "particle_jet", "cart_pole_swing_up", "arm_reach_by_hand")

#: The file in which the corpus of a campaign is kept for its processes.
CORPUS = "corpus.pickle"

#: Stages of ``stc show`` that say more than the text.
STAGES = ("tokens", "syntax", "problem", "contact", "nlp", "sparsity", "ops", "tape", "none", "\x1b[31m")

FORMATS = ("csv", "gltf", "mujoco", "json", "\x1b]0;x\x07", "")


@dataclass(frozen=True)
class Case:
    """Files to be laid in an empty folder, and the words after ``stc``.

    Attributes:
        kind: what is spoilt.
        files: contents by name.
        words: of the command line.
        output: the file that the command may replace; all others have to stay as they are.
    """

    kind: str
    files: dict[str, bytes]
    words: list[str]
    output: str = "out.npz"


@dataclass
class Corpus:
    """What cases are made from.

    Attributes:
        specs: texts, the bundled ones and those of the tests.
        quick: texts of which each is solved quickly.
        solutions: file contents by the ending of their names, without a point.
    """

    specs: list[str]
    quick: list[str]
    solutions: dict[str, list[bytes]] = field(default_factory=dict)


def corpus(folder: Path) -> Corpus:
    """All bundled specs, those of the tests, and solutions of the quick ones, solved in ``folder``."""
    here = Path(__file__).parents[1]
    paths = [
        *sorted(here.rglob("*.stc")),
        *(Path(specs.__file__).parent / f"{name}.stc" for name in specs.names()),
    ]
    quick = [(Path(specs.__file__).parent / f"{name}.stc").read_text(encoding="utf-8") for name in QUICK]
    found = Corpus([path.read_text(encoding="utf-8") for path in paths], quick, {"npz": [], "csv": []})
    for name in QUICK[:2]:
        solution = stc.load(name).solve(n=8)
        for ending, files in found.solutions.items():
            file = folder / f"{name}.{ending}"
            solution.save(file)
            files.append(file.read_bytes())
    return found


def case(seed: int, number: int, given: Corpus) -> Case:
    """One case; the same for the same seed, number and corpus."""
    random_ = random.Random(f"{seed} {number}")
    kinds: list[Callable[[random.Random, Corpus], Case]] = [
        _spec,
        _solve,
        _solution,
        _model,
        _table,
        _data,
        _options,
    ]
    return random_.choices(kinds, [33, 9, 19, 11, 11, 7, 10])[0](random_, given)


def _plain_solve(random_: random.Random) -> list[str]:
    return ["--set", f"n={random_.choice([4, 6, 8])}", "--max-iterations", "20", "--time-limit", "2"]


def _json(random_: random.Random) -> list[str]:
    return ["--json"] if random_.random() < 0.5 else []


def _spec(random_: random.Random, given: Corpus) -> Case:
    """A spoilt spec is read."""
    short = sorted(random_.sample(given.specs, 3), key=len)
    text = random_.choice([*short[:2], random_.choice(given.quick)])
    files = {"spec.stc": mutations.text(random_, text)}
    if random_.random() < 0.3:
        return Case("spec", files, ["show", "spec.stc", "--stage", random_.choice(STAGES)])
    return Case("spec", files, ["check", "spec.stc", *_json(random_)])


def _solve(random_: random.Random, given: Corpus) -> Case:
    """A spoilt spec is solved over a solution that is there."""
    files = {
        "spec.stc": mutations.text(random_, random_.choice(given.quick)),
        "out.npz": random_.choice(given.solutions["npz"]),
    }
    command = random_.choice(["solve", "solve", "run"])
    return Case(
        "solve", files, [command, "spec.stc", "-o", "out.npz", *_plain_solve(random_), *_json(random_)]
    )


def _solution(random_: random.Random, given: Corpus) -> Case:
    """A spoilt solution is validated, drawn, exported or started from."""
    ending = random_.choice(["npz", "npz", "npz", "csv"])
    file = f"in.{ending}"
    whole = random_.choice(given.solutions[ending])
    files = {file: mutations.solution(random_, whole), "spec.stc": given.quick[0].encode()}
    words = random_.choice(
        [
            ["validate", file, *_json(random_)],
            ["validate", file, "--force", *_json(random_)],
            ["export", file, "--format", random_.choice(FORMATS), "-o", "exported"],
            [
                "solve",
                "spec.stc",
                "--warm-start",
                file,
                "-o",
                "out.npz",
                *_plain_solve(random_),
                *_json(random_),
            ],
            [
                "solve",
                "spec.stc",
                "--guess-from",
                file,
                "-o",
                "out.npz",
                *_plain_solve(random_),
                *_json(random_),
            ],
        ]
    )
    return Case("solution", files, words, "exported" if words[0] == "export" else "out.npz")


def _model(random_: random.Random, given: Corpus) -> Case:
    """A spec is read, or its motion replayed, with a spoilt model."""
    which = random_.choice([0, 2])
    name = ("particle.xml", "", "cart_pole.xml")[which]
    whole = models.locate(name)
    assert whole is not None
    text = given.quick[which].replace(f'"{name}"', '"own.xml"')
    files = {
        "spec.stc": text.encode(),
        "own.xml": mutations.model(random_, whole.read_text(encoding="utf-8")),
    }
    words = ["run", "spec.stc", "-o", "out.npz", *_plain_solve(random_), *_json(random_)]
    return Case("model", files, random_.choice([words, ["check", "spec.stc", *_json(random_)]]))


def _table(random_: random.Random, given: Corpus) -> Case:
    """A solve starts from a spoilt table."""
    names = ["x", "y", "fx", "fy"]
    files = {
        "guess.csv": mutations.table(random_, names),
        "spec.stc": random_.choice(given.quick[:2]).encode(),
        "out.npz": given.solutions["npz"][0],
    }
    words = ["solve", "spec.stc", "--guess-from", "guess.csv", "-o", "out.npz"]
    return Case("table", files, [*words, *_plain_solve(random_), *_json(random_)])


#: A page that reads a file in each way that there is: as functions, as a motion, row by row, and as a guess.
DATA = """constants: n = 8, h = 0.1; variables: x, y; parameters: a;
data: d = "d.csv"; f = table(d.time, d.x){}; g = table(d.x, d.time, d.y);
  e = (p, q): (0, 1), (1, 2*h), (3, 0); k = table(e.p, e.q);
constraints: [0, n]: x' = a*k(f(t)) + k'(x); [2]: y = d.y;
objective: [d]: (x - d.x)^2; [0, n]: integral((y - d.y)^2 + y''^2 + x^2*{});
guess: d; method: {};"""


def _data(random_: random.Random, given: Corpus) -> Case:
    """A page of data, with a spoilt file or spoilt itself."""
    options = ["", ", monotone", ", linear", ", outside = hold", ", outside = error", ", monotone linear"]
    weights = ["0", "1", "f'(x)", "g(x, y)", "d.x'", "d.zz", "f", "d.x[n]", "sum(k in 1..3: d.x*{k})"]
    methods = ["central", "trapezoidal", "hermite-simpson"]
    text = DATA.format(*(random_.choice(words) for words in (options, weights, methods)))
    if random_.random() < 0.5:  # without the table of two arguments, which wants a grid
        text = text.replace(" g = table(d.x, d.time, d.y);", "")
    whole = "time,x,y\n" + "\n".join(f"{k / 10},{k * k},{k % 3 or ''}" for k in range(9))
    content = random_.choice([whole.encode(), mutations.table(random_, ["time", "x", "y"])])
    if random_.random() < 0.2:
        content = mutations.data(random_, content)
    files = {"d.csv": content, "spec.stc": text.encode()}
    if random_.random() < 0.3:
        files["spec.stc"] = mutations.text(random_, text)
    words = random_.choice(
        [
            ["check", "spec.stc", *_json(random_)],
            ["show", "spec.stc", "--stage", random_.choice(STAGES)],
            ["solve", "spec.stc", "-o", "out.npz", *_plain_solve(random_), *_json(random_)],
        ]
    )
    return Case("data", files, words)


def _options(random_: random.Random, given: Corpus) -> Case:
    """Words that do not belong together, values that are none."""
    value = lambda: random_.choice(
        [*mutations.NUMBERS, *mutations.CHARACTERS, "spec.stc", "in.npz", "none.npz"]
    )
    option = lambda: random_.choice(
        [
            ["--set", f"{random_.choice(['n', 'h', 'm', 'T', 'none', '', chr(27)])}={value()}"],
            ["--method", random_.choice(["central", "trapezoidal", value()])],
            ["--max-iterations", value()],
            ["--tolerance", value()],
            ["--optimizer", random_.choice(["sqp", "witkin-kass", "nlopt:slsqp", "nlopt:none", value()])],
            ["--warm-start", random_.choice(["in.npz", "in.csv", "spec.stc", value()])],
            ["--guess-from", random_.choice(["in.npz", "in.csv", "spec.stc", value()])],
            ["--continue", random_.choice(["g=0:9.8:2", "g=0", "n=1:2:3", "g=0:1:1e9", value()])],
            ["--starts", random_.choice(["2", "0", "-3", value()])],
            ["--seed", value()],
            ["--refine", random_.choice(["1", "0", value()])],
            ["--threads", value()],
            [
                "-o",
                random_.choice(["new/out.npz", "out.txt", ".", "spec.stc", "in.npz/x.npz", "a\x1b[31m.npz"]),
            ],
            ["--explain"],
            ["--profile"],
            ["--direct"],
            ["--json"],
            [f"--{value()}"],
            [value()],
        ]
    )
    command = random_.choice(
        [
            "solve",
            "solve",
            "run",
            "check",
            "show",
            "validate",
            "compare",
            "export",
            "plot",
            "list",
            "new",
            value(),
        ]
    )
    target = random_.choice(["spec.stc", "spec.stc", "in.npz", "in.csv", "particle_waypoints", value()])
    words = [command, target] if command not in ("list", "new") else [command]
    for _ in range(random_.choice([0, 1, 1, 2, 3])):
        words += option()
    if command in ("solve", "run", "validate", "compare"):  # no case is to take long for what it asks
        words += ["--max-iterations", "20", "--time-limit", "2"]
        if target != "in.npz":
            words += ["--set", "n=6"]
    files = {
        "spec.stc": given.quick[0].encode(),
        "in.npz": given.solutions["npz"][0],
        "in.csv": given.solutions["csv"][0],
    }
    return Case("options", files, words, "")
