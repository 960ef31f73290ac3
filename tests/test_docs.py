"""What the documentation shows is what happens."""

from __future__ import annotations

import math
import re
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import stc
from stc import specs
from stc.cli.main import run
from stc.validate import validate
from stc.validate.report import Report

ROOT = Path(__file__).parent.parent
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").glob("*.md"))]


def blocks(page: str, language: str = "") -> list[str]:
    """The fenced blocks of a page in a language."""
    found = re.findall(r"^```(\w*)\n(.*?)^```$", (ROOT / page).read_text(), re.MULTILINE | re.DOTALL)
    return [text for name, text in found if name == language]


def whole_specs() -> list[str]:
    """The blocks that are whole specs."""
    return [
        block
        for page in PAGES
        for block in blocks(str(page))
        if "constants:" in block and "variables:" in block
    ]


@pytest.mark.parametrize("spec", whole_specs(), ids=lambda spec: spec.strip().splitlines()[0])
def test_whole_specs_solve(spec: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    rows = [f"{k / 20},{math.exp(-0.05 * k / 20) * math.cos(3.0 * k / 20)}" for k in range(121)]
    Path("swing.csv").write_text("\n".join(["time,angle", *rows]))
    model = stc.load(spec)
    assert model.solve().status == "optimal"
    assert not model.warnings


def commands(page: str, kind: str) -> list[list[str]]:
    """The command lines of a page of a kind: those that render, those that replay often or film, or the others.

    Those that serve until Ctrl-C are left out.
    """
    lines = re.findall(r"^    stc (?!steer )(.*?)(?:  +#.*)?$", (ROOT / page).read_text(), re.MULTILINE)

    def kind_of(words: list[str]) -> str:
        if {"sweep", "--robustness", "--report"}.intersection(words):
            return "long"
        return "render" if words[0] == "render" else "other"

    found = [line.split() for line in lines if kind_of(line.split()) == kind]
    assert found
    return found


RENDER = pytest.param("render", marks=pytest.mark.needs("opengl"))


@pytest.mark.parametrize("kind", ["other", RENDER, pytest.param("long", marks=pytest.mark.nightly)])
def test_commands_of_the_readme_work(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["new", "myspec"]) == 0
    if kind == "long":
        assert run(["solve", "particle_waypoints"]) == 0
    for words in commands("README.md", kind):
        assert run(words) == 0, words


def test_python_of_the_readme_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    (block,) = blocks("README.md", "python")
    exec(block, names)
    assert names["report"].passed  # type: ignore[attr-defined]
    assert names["moon"].status == "optimal"  # type: ignore[attr-defined]


def test_the_mistake_in_the_readme_is_reported_like_that(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    head = "constants: n = 10, m = 1;\nvariables: x, fx;\nobjective: integral(fx^2);\nconstraints:\n"
    Path("hop.stc").write_text(head + "\n" * (13 - head.count("\n")) + "    m*x'' - fxx;\n")
    with pytest.raises(stc.SpecError) as caught:
        stc.load("hop.stc").solve()
    shown = [block for block in blocks("README.md") if block.startswith("hop.stc:")]
    assert shown == [f"{caught.value}\n"]


def test_the_docstring_of_the_package_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert stc.__doc__ is not None
    code = re.search(r"^    import stc\n.*?\n(?=\S)", stc.__doc__, re.MULTILINE | re.DOTALL)
    assert code is not None
    exec(textwrap.dedent(code.group()), {})


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)", page.read_text()):
        if "://" not in target:
            assert (page.parent / target).exists(), target


def test_the_limits_are_where_pages_and_certificates_say() -> None:
    texts = [*PAGES, ROOT / "validate" / "certificate" / "page.py"]
    named = {found for page in texts for found in re.findall(r"[\w/.]*limits\.py", page.read_text("utf-8"))}
    assert named == {"validate/limits.py", "../validate/limits.py"}
    assert (ROOT / "validate" / "limits.py").is_file()


def test_nothing_advises_to_install_somebody_elses_package() -> None:
    # `stc` on PyPI is not this project.
    wrong = re.compile(r"pip install (\S+ )*['\"]?stc(?![\w./-]| @ )")
    texts = [*PAGES, *ROOT.glob("stc/**/*.py"), *ROOT.glob("validate/**/*.py")]
    assert [path.name for path in texts if wrong.search(path.read_text(encoding="utf-8"))] == []


def test_every_stage_is_named_in_the_readme() -> None:
    from stc.cli.stages import STAGES

    text = (ROOT / "README.md").read_text()
    assert ", ".join(STAGES) in text


def test_the_searches_from_python_work() -> None:
    names: dict[str, object] = {}
    (block,) = blocks("docs/searches.md", "python")
    exec(block, names)
    assert names["walk"].arrived and names["finer"].reached  # type: ignore[attr-defined]
    assert names["sure"].verified and len(names["found"].optima) >= 1  # type: ignore[attr-defined]


def test_the_steering_from_python_works() -> None:
    (block,) = blocks("docs/steering.md", "python")
    names: dict[str, object] = {}
    exec(block, names)
    assert names["session"].text() == names["read_source"]("luxo_poses").text  # type: ignore


@pytest.mark.nightly
def test_the_sweep_from_python_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    (block,) = blocks("docs/sweeps.md", "python")
    exec(block, names)
    assert names["found"].good  # type: ignore[attr-defined]


#: Pages that begin with a task, each with the file that its first spec is saved as.
TASKS = {
    "install.md": "",
    "first_motion.md": "push.stc",
    "transcription.md": "",
    "failed_solves.md": "reach.stc",
    "reading_a_verdict.md": "",
}


@pytest.mark.parametrize("page", TASKS)
def test_the_commands_and_the_python_of_a_page_work(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = ROOT / "docs" / page
    if TASKS[page]:
        (spec,) = blocks(str(text)) or blocks(str(text), "text")
        Path(TASKS[page]).write_text(spec)
    for line in re.findall(r"^    stc (?!--install)(.*)$", text.read_text(), re.MULTILINE):
        assert run(line.split()) == 0, line
    names: dict[str, object] = {}
    for block in blocks(str(text), "python"):
        exec(block, names)
    if page == "first_motion.md":
        assert names["solution"].objective == pytest.approx(48.0)  # type: ignore[attr-defined]
    if page == "failed_solves.md":
        assert names["solution"].status == "infeasible"  # type: ignore[attr-defined]


def test_every_page_is_in_the_site() -> None:
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    listed = re.findall(r"^ +- [^:\n]+: (\w+\.md)$", text, re.MULTILINE)
    assert sorted(listed) == sorted(path.name for path in (ROOT / "docs").glob("*.md"))


@pytest.mark.nightly
def test_the_site_builds_without_a_warning(tmp_path: Path) -> None:
    pytest.importorskip("mkdocstrings")
    subprocess.run(["make", "tree"], cwd=ROOT, check=True, capture_output=True)
    words = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path / "site")]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    api = (tmp_path / "site" / "api.html").read_text(encoding="utf-8")
    assert all(f"{name}</span>" in api for name in ("solve", "sweep", "certify", "assert_physical"))


def test_the_gallery_shows_every_motion_or_says_that_it_is_missing() -> None:
    text = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    shown = re.findall(r"^!\[(\w+)\]\(gallery/(\w+)\.webp\)$", text, re.MULTILINE)
    missing = re.findall(r"^Not filmed yet: (.*)\.$", text, re.MULTILINE)
    names = [name for name, film in shown if name == film]
    assert sorted([*names, *(missing[0].split(", ") if missing else [])]) == sorted(specs.names())
    assert all((ROOT / "docs" / "gallery" / f"{name}.webp").stat().st_size <= 200_000 for name in names)
    assert len(re.findall(r"^\*\*(passed|failed)\*\*: ", text, re.MULTILINE)) == len(shown)


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("kind", ["other", RENDER])
def test_the_model_of_ones_own_is_what_its_spec_says(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (model,) = blocks("docs/own_model.md", "xml")
    (spec,) = blocks("docs/own_model.md")
    (tmp_path / "rod.xml").write_text(model)
    (tmp_path / "rod.stc").write_text(spec)
    (shortest,) = blocks("docs/own_model.md", "text")
    (tmp_path / "up.stc").write_text(shortest)
    assert run(["run", "up.stc"]) == 0
    for words in commands("docs/own_model.md", kind):
        assert run(words) == 0, words


@pytest.mark.nightly
def test_the_two_legs_hop_on_the_floor_that_the_page_recommends_and_on_no_usual_one(tmp_path: Path) -> None:
    page, model = (ROOT / "docs/own_model.md").read_text(), (ROOT / "docs/two_legs.xml").read_text()
    recipe = re.findall(r"^    (<.*>)$", page.split("## Floors")[1], re.MULTILINE)
    assert len(recipe) == 3 and all(line in model for line in recipe)
    usual = re.sub(r'<option.*?/>| friction="[^"]*"| solref="[^"]*"', "", model)
    (tmp_path / "usual.xml").write_text(usual)
    hop = stc.load(ROOT / "docs/two_legs.stc").solve()
    assert hop.status == "optimal"

    def share(report: Report) -> float:
        return max(metric.value for metric in report.metrics if metric.name == "feedback share")

    report = validate(hop)
    assert report.passed, report
    assert share(validate(hop, tmp_path / "usual.xml")) > 4.0 * share(report)
