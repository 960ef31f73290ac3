"""What is committed is what the descriptions say: MJCF, meshes, and the constants of the specs."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from stc.models import build
from stc.models.description import Measure
from stc.models.measures import MeasureError, rewrite, table

LAMP = {
    "m1": Measure(0.25, "kg", "mass of the arm"),
    "d1": Measure(0.1 + 0.2, "m", "from joint to centre"),
    "A1": Measure(-1.0, "rad", "pose"),
}


@pytest.fixture(scope="module")
def rebuilt(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A rebuild from nothing but the descriptions and copies of the specs."""
    folder = tmp_path_factory.mktemp("rebuilt")
    shutil.copytree(build.SPECS, folder / "specs", ignore=shutil.ignore_patterns("*.py", "__pycache__"))
    build.rebuild(folder / "models", folder / "specs")
    return folder


def test_a_rebuild_gives_the_committed_models(rebuilt: Path) -> None:
    written = sorted(path.relative_to(rebuilt / "models") for path in (rebuilt / "models").rglob("*.*"))
    assert len(written) > 20
    for path in written:
        assert (rebuilt / "models" / path).read_bytes() == (build.MODELS / path).read_bytes(), path


def test_a_rebuild_gives_the_committed_specs(rebuilt: Path) -> None:
    for path in sorted(build.SPECS.glob("*.stc")):
        assert (rebuilt / "specs" / path.name).read_bytes() == path.read_bytes(), path.name


def test_no_mesh_is_left_over(rebuilt: Path) -> None:
    wanted = {path.name for path in (rebuilt / "models" / "meshes").iterdir()}
    assert {path.name for path in (build.MODELS / "meshes").iterdir()} == wanted


def test_a_model_that_was_edited_by_hand_is_noticed(rebuilt: Path, tmp_path: Path) -> None:
    shutil.copytree(rebuilt, tmp_path / "edited")
    models, specs = tmp_path / "edited" / "models", tmp_path / "edited" / "specs"
    assert build.rebuild(models, specs, check=True) == []
    lamp, poses = models / "luxo.xml", specs / "luxo_poses.stc"
    for path in (lamp, poses):
        path.write_text(path.read_text().replace("0.07155771905424202", "0.0715577190542420"))
    assert set(build.rebuild(models, specs, check=True)) == {lamp, poses}
    assert set(build.rebuild(models, specs)) == {lamp, poses}
    assert build.rebuild(models, specs, check=True) == []


def test_the_command_line_lists_measures(capsys: pytest.CaptureFixture[str]) -> None:
    assert build.main(["--list", "cart_pole"]) == 0
    text = capsys.readouterr().out
    assert "  l = 0.5," in text
    assert text.startswith("# measures of cart_pole")
    with pytest.raises(SystemExit):
        build.main(["--list", "teapot"])
    assert "there are luxo, " in capsys.readouterr().err


def test_a_block_is_filled_in_from_its_names() -> None:
    text = "# a spec\n# measures of lamp\nconstants: d1, m1\n= 7;\n# end of measures\nvariables: x;\n"
    filled = rewrite(text, {"lamp": LAMP}, "a.stc")
    assert filled == (
        "# a spec\n"
        "# measures of lamp, from `python -m stc.models.build`\n"
        "constants:\n"
        "  m1 = 0.25,                    # kg, mass of the arm\n"
        "  d1 = 0.30000000000000004;     # m, from joint to centre\n"
        "# end of measures\n"
        "variables: x;\n"
    )
    assert rewrite(filled, {"lamp": LAMP}, "a.stc") == filled


def test_a_text_without_blocks_stays_as_it_is() -> None:
    text = "# measured by hand\nconstants: m = 1;\n"
    assert rewrite(text, {"lamp": LAMP}, "a.stc") == text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "# measures of lump\nconstants: m1;\n# end of measures\n",
            "no described model lump; there are lamp",
        ),
        ("# measures of lamp\nconstants: m7;\n# end of measures\n", "has no m7; its measures are m1, d1, A1"),
        ("# measures of lamp\nconstants:\n# end of measures\n", "asked for nothing"),
        ("# measures of lamp\nconstants: m1;\n", "needs the line `# end of measures`"),
    ],
)
def test_mistakes_in_a_block_are_told(text: str, message: str) -> None:
    with pytest.raises(MeasureError, match=message):
        rewrite(text, {"lamp": LAMP}, "a.stc")


def test_a_whole_table_reads_back_as_the_same_numbers() -> None:
    for description in build.descriptions():
        lines = table(description.name, description.measures).splitlines()[2:-1]
        read = {
            line.split("=")[0].strip(): float(line.split("=")[1].split("#")[0].strip(" ,;")) for line in lines
        }
        assert read == {name: measure.value for name, measure in description.measures.items()}
