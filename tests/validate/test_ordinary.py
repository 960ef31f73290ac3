"""Models that ask for more than a machine has are refused in time; ordinary ones are compiled at once."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from stc import models
from stc.validate import ordinary
from stc.validate.fields import set_fields
from stc.validate.model import ModelError, load_model

BALL = '<body><freejoint/><geom size=".1"/></body>'


def _written(folder: Path, inside: str) -> Path:
    file = folder / "own.xml"
    file.write_text(f"<mujoco>{inside}</mujoco>", encoding="utf-8")
    return file


@pytest.mark.parametrize("name", models.names())
def test_bundled_models_are_ordinary_wherever_they_lie(name: str) -> None:
    file = models.locate(name)
    assert file is not None and ordinary._usual(file)


@pytest.mark.parametrize(
    "inside",
    [
        '<asset><hfield name="q" nrow="100000" ncol="100000" size="1 1 1 1"/></asset><worldbody/>',
        f'<worldbody><replicate count="10000000" offset="1 0 0">{BALL}</replicate></worldbody>',
        f'<worldbody><replicate count="100"><replicate count="100">{BALL}</replicate></replicate></worldbody>',
        '<worldbody><flexcomp name="f" type="grid" count="99 99 99" spacing="1 1 1"/></worldbody>',
        '<asset><texture name="t" type="2d" builtin="flat" width="99999" height="99999"/></asset><worldbody/>',
        '<size nkey="1000000000"/><worldbody/>',
        "<worldbody>" + "<frame>" * 600 + "</frame>" * 600 + "</worldbody>",
        "<worldbody>",
    ],
)
def test_what_asks_for_much_is_not_ordinary(inside: str, tmp_path: Path) -> None:
    assert not ordinary.is_ordinary(_written(tmp_path, inside))


def test_included_files_count(tmp_path: Path) -> None:
    (tmp_path / "many.xml").write_text(
        f'<mujoco><worldbody><replicate count="9999">{BALL}</replicate></worldbody></mujoco>',
        encoding="utf-8",
    )
    assert not ordinary.is_ordinary(_written(tmp_path, '<include file="many.xml"/>'))
    (tmp_path / "many.xml").write_text(f"<mujoco><worldbody>{BALL}</worldbody></mujoco>", encoding="utf-8")
    assert ordinary.is_ordinary(_written(tmp_path, '<include file="many.xml"/>'))


def test_a_small_file_of_a_large_picture_is_not_ordinary(tmp_path: Path) -> None:
    (tmp_path / "sky.png").write_bytes(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + struct.pack(">II", 99999, 99999))
    inside = '<asset><texture name="t" type="2d" file="sky.png"/></asset><worldbody/>'
    assert not ordinary.is_ordinary(_written(tmp_path, inside))


def test_a_model_that_takes_too_long_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ordinary, "TIME", 2.0)
    inside = f'<worldbody><replicate count="10000000" offset="1 0 0">{BALL}</replicate></worldbody>'
    with pytest.raises(ModelError, match=r"own.xml: to compile it takes MuJoCo more than 2 s"):
        load_model(_written(tmp_path, inside))


def test_a_model_that_takes_too_much_memory_is_refused(tmp_path: Path) -> None:
    inside = '<asset><hfield name="q" nrow="1000000" ncol="1000000" size="1 1 1 1"/></asset><worldbody/>'
    with pytest.raises(ModelError, match="more than 4 GB of memory"):
        load_model(_written(tmp_path, inside))


def test_a_large_model_that_can_be_compiled_is(tmp_path: Path) -> None:
    inside = '<asset><hfield name="q" nrow="4000" ncol="4000" size="1 1 1 1"/></asset><worldbody/>'
    file = _written(tmp_path, inside)
    assert not ordinary.is_ordinary(file)
    assert load_model(file).nhfielddata == 16_000_000


def test_what_mujoco_says_of_a_large_model_is_told(tmp_path: Path) -> None:
    large = '<asset><hfield name="q" nrow="4000" ncol="4000" size="1 1 1 1"/></asset>'
    inside = f'{large}<worldbody><geom size="1" material="none"/></worldbody>'
    with pytest.raises(ModelError, match="material"):
        load_model(_written(tmp_path, inside))


def test_values_that_mujoco_cannot_take_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # where MuJoCo leaves its log
    file = models.locate("particle.xml")
    assert file is not None
    with pytest.raises(
        ModelError, match=r"does not accept what is set in the model .*body.particle.mass = 0"
    ):
        set_fields(load_model(file), {("body", "particle", "mass"): 0.0})
