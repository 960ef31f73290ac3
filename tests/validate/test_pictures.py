"""Plots, filmstrips and videos: what is in them."""

from __future__ import annotations

import copy
import sys
from pathlib import Path

import numpy as np
import pytest
from closed_form_motions import smooth_particle, waypoint_spline

from stc import models
from stc.errors import UsageError
from stc.solution import Solution
from stc.trajectory import Channel
from stc.validate import ModelError
from stc.validate.pictures import PictureError
from stc.validate.pictures.camera import fit, usual_camera
from stc.validate.pictures.film import Look, draw, filmstrip, path_trails, slow_motion
from stc.validate.pictures.motion import paths, simulated_at, solved_at
from stc.validate.pictures.plot import figure, save_plot
from stc.validate.pictures.scenery import picture_model
from stc.validate.pictures.stage import Stage, Trail
from stc.validate.pictures.variables import sampled
from stc.validate.replay import replay
from stc.validate.setup import Setup, prepare
from stc.validate.verdict import run_replays

SMALL = Look(width=64, height=48, tiles=5, rate=6)


def solution(**more: object) -> Solution:
    x, y = waypoint_spline()
    return smooth_particle("hermite-simpson", np.linspace(0, 2, 21), x, y, **more)


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    """The particle in a coarser light, which renders ten times faster."""
    bundled = models.locate("particle")
    assert bundled is not None
    text = bundled.read_text().replace('shadowsize="4096" offsamples="8"', 'shadowsize="256" offsamples="0"')
    assert "256" in text
    folder = tmp_path_factory.mktemp("model")
    (folder / "particle.xml").write_text(text)
    return prepare(solution(directory=str(folder)))


def red(image: np.ndarray) -> tuple[float, float]:
    """Where the orange ball is: mean row and column of its pixels."""
    pixels = image.astype(int)
    rows, columns = np.nonzero((pixels[..., 0] > 120) & (pixels[..., 0] > pixels[..., 2] + 60))
    assert len(rows)
    return float(rows.mean()), float(columns.mean())


# ------------------------------------------------------------------ positions and paths


def test_positions_are_those_of_the_solved_curve(setup: Setup) -> None:
    x, y = waypoint_spline()
    times = np.array([0.0, 0.33, 1.0, 1.77, 2.0])
    np.testing.assert_allclose(
        solved_at(setup, times), np.stack([x[0](times), y[0](times)], axis=1), atol=1e-12
    )
    motion = replay(setup)
    np.testing.assert_allclose(simulated_at(motion, times), solved_at(setup, times), atol=1e-6)


def test_paths_follow_what_is_compared_or_else_the_outermost_bodies(setup: Setup) -> None:
    (path,) = paths(setup)
    x, y = waypoint_spline()
    times = np.linspace(0, 2, len(path))
    np.testing.assert_allclose(path, np.stack([x[0](times), 0 * times, y[0](times)], axis=1), atol=1e-12)


def test_short_motions_are_slowed_down() -> None:
    assert slow_motion(3.0) == 1.0
    assert slow_motion(1.9) == 0.5
    assert slow_motion(0.2) == 0.1


# ------------------------------------------------------------------ rendering


@pytest.mark.needs("opengl")
def test_the_ball_is_where_the_motion_has_it(setup: Setup) -> None:
    """From left to right, and higher in the image where it is higher in the world."""
    positions = solved_at(setup, np.linspace(0, 2, 5))
    with Stage(setup.compiled, 96, 72, frame=positions) as stage:
        images = [stage.render(position) for position in positions]
    assert images[0].shape == (72, 96, 3)
    places = np.array([red(image) for image in images])
    assert np.all(np.diff(places[:, 1]) > 4)
    assert np.argmin(places[:, 0]) == np.argmax(positions[:, 1])


@pytest.mark.needs("opengl")
def test_ghosts_and_trails_are_drawn(setup: Setup) -> None:
    start, end = solved_at(setup, np.array([0.0, 2.0]))
    line = np.array([[0.5, 0.0, 0.2], [1.5, 0.0, 0.9]])
    with Stage(setup.compiled, 96, 72) as stage:
        plain = stage.render(start)
        ghosted = stage.render(start, [(end, 0.5)])
        trailed = stage.render(start, (), [Trail(line, (0.0, 1.0, 0.0, 1.0), 3.0)])
    changed = np.abs(ghosted.astype(int) - plain).max(axis=2) > 12
    assert changed.any()
    assert np.nonzero(changed)[1].mean() > red(plain)[1] + 10
    green = (
        trailed.astype(int)[..., 1]
        - trailed.astype(int)[..., 0]
        - (plain.astype(int)[..., 1] - plain[..., 0])
    )
    assert (green > 60).sum() > 10


def pixels(image: np.ndarray, colour: str) -> int:
    """How many pixels have the colour of a path: ``orange`` is the solved one's, ``blue`` the simulated one's."""
    r, b = image[..., 0].astype(int), image[..., 2].astype(int)
    return int(((b > 190) & (b > r + 60)).sum() if colour == "blue" else ((r > 190) & (r > b + 60)).sum())


@pytest.mark.needs("opengl")
def test_two_paths_in_the_same_place_are_both_seen(setup: Setup) -> None:
    """The simulated one lies on the solved one, which shows on either side of it all along."""
    motion = run_replays(setup, tracked=False).open_loop
    model = setup.model()
    with Stage(model, 240, 180, frame=solved_at(setup, setup.solution.time)) as stage:
        start = setup.reference.at("after", 0)[0]
        alone = stage.render(start, (), path_trails(setup, None))
        both = stage.render(start, (), path_trails(setup, motion))
    way = pixels(alone, "orange")
    assert pixels(alone, "blue") == 0
    assert pixels(both, "blue") > 0.5 * way
    assert pixels(both, "orange") > 0.5 * way


@pytest.mark.needs("opengl")
def test_floors_mirror_no_paths(setup: Setup) -> None:
    """A curve high above the floor changes nothing below the horizon."""
    start = setup.reference.at("after", 0)[0]
    line = np.linspace([0.2, 0, 0.8], [1.8, 0, 1.0], 20)
    with Stage(setup.compiled, 240, 180, frame=solved_at(setup, setup.solution.time)) as stage:
        high = stage.render(start, (), [Trail(line)])
        far = stage.render(start, (), [Trail(line + [0, 0, 100.0])])
    rows = np.flatnonzero((high != far).any(axis=(1, 2)))
    assert len(rows)
    assert rows.max() < 90


@pytest.mark.needs("opengl")
def test_a_model_without_a_sky_stands_before_a_neutral_background(tmp_path: Path) -> None:
    (tmp_path / "particle.xml").write_text("""
        <mujoco>
          <worldbody>
            <body name="particle">
              <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
              <geom type="sphere" size="0.1" mass="2" rgba="1 0 0 1"/>
            </body>
          </worldbody>
          <actuator><motor name="fx" joint="x"/><motor name="fz" joint="z"/></actuator>
        </mujoco>""")
    own = prepare(solution(directory=str(tmp_path)))
    model = picture_model(own)
    # What the spec sets is in the picture's model as well, and the simulated one is as it was.
    assert np.array_equal(model.body_mass, own.compiled.body_mass)
    assert own.compiled.ntex == 0
    with Stage(model, 96, 72, frame=solved_at(own, own.solution.time)) as stage:
        corners = stage.render(own.reference.at("after", 0)[0])[[0, 0, -1, -1], [0, -1, 0, -1]].astype(int)
    assert corners.min() > 120
    assert np.ptp(corners, axis=1).max() < 40


@pytest.mark.parametrize(
    "light", [pytest.param("", marks=pytest.mark.needs("opengl")), '<light pos="0 -1 3"/>']
)
def test_a_model_without_light_is_lit_in_pictures_and_others_are_left_alone(
    tmp_path: Path, light: str
) -> None:
    (tmp_path / "particle.xml").write_text(f"""
        <mujoco>
          <worldbody>
            {light}
            <geom type="plane" size="3 3 0.1" pos="0 0 -1" contype="0" conaffinity="0"/>
            <body name="particle">
              <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
              <geom type="sphere" size="0.1" mass="2"/>
            </body>
          </worldbody>
          <actuator><motor name="fx" joint="x"/><motor name="fz" joint="z"/></actuator>
        </mujoco>""")
    own = prepare(solution(directory=str(tmp_path)))
    model = picture_model(own)
    assert own.compiled.nlight == (1 if light else 0)
    if light:
        assert model.nlight == 1
        assert np.array_equal(model.vis.headlight.diffuse, own.compiled.vis.headlight.diffuse)
        return
    with Stage(model, 96, 72, frame=solved_at(own, own.solution.time)) as stage:
        lit = stage.render(own.reference.at("after", 0)[0]).astype(int)
    with Stage(own.model(), 96, 72, frame=solved_at(own, own.solution.time)) as stage:
        unlit = stage.render(own.reference.at("after", 0)[0]).astype(int)
    floor = lit[-1]  # the floor's colour is half of white
    assert np.median(floor) > 60 > 2 * np.median(unlit[-1])


@pytest.mark.needs("opengl")
def test_the_whole_motion_is_framed_however_few_tiles_there_are(setup: Setup) -> None:
    """The ball is highest between first and last frame: its path must not leave the image."""
    look = Look(width=240, height=180, tiles=2, captions=False)
    strip = np.asarray(filmstrip(setup, look))[:, :240]
    assert pixels(strip, "orange") > 50
    assert pixels(strip[:8], "orange") == 0


@pytest.mark.needs("opengl")
def test_a_filmstrip_has_its_tiles(setup: Setup) -> None:
    told = []
    strip = filmstrip(setup, SMALL, None, lambda done, total: told.append((done, total)))
    assert told == [(k + 1, 5) for k in range(5)]
    assert strip.size == (5 * 66 - 2, 48)
    four = filmstrip(setup, Look(width=64, height=48, tiles=4, columns=2))
    assert four.size == (2 * 66 - 2, 2 * 50 - 2)


@pytest.mark.needs("opengl")
@pytest.mark.parametrize("ending", ["png", "jpg", "webp", "gif"])
def test_pictures_are_written(setup: Setup, tmp_path: Path, ending: str) -> None:
    from PIL import Image

    file = tmp_path / f"motion.{ending}"
    draw(setup, file, SMALL)
    with Image.open(file) as image:
        if ending in ("webp", "gif"):
            assert image.size == (64, 48)
            assert image.n_frames == 13
            assert image.info["loop"] == 0
        else:
            assert image.size == (5 * 66 - 2, 48)


@pytest.mark.needs("opengl")
def test_a_video_is_h264(setup: Setup, tmp_path: Path) -> None:
    import av

    file = tmp_path / "motion.mp4"
    draw(setup, file, Look(width=65, height=49, rate=5, speed=1.0), replay(setup))
    with av.open(str(file)) as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.width, stream.height) == ("h264", 64, 48)
        frames = sum(1 for _ in container.decode(video=0))
    assert frames == 11 + 4  # two seconds, and a pause at the end


def test_what_cannot_be_drawn_is_said(setup: Setup, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"\.png, \.jpg, \.jpeg are filmstrips"):
        draw(setup, tmp_path / "motion.bmp", SMALL)
    with pytest.raises(ModelError, match="the model has no camera top; known: side"):
        draw(setup, tmp_path / "motion.png", Look(camera="top"))
    with pytest.raises(UsageError, match="speed and rate of a video must be positive"):
        draw(setup, tmp_path / "motion.gif", Look(speed=0.0))
    with pytest.raises(UsageError, match=r"a plot is saved as \.png, \.svg, \.pdf"):
        save_plot(run_replays(setup), tmp_path / "motion.gif")


def test_an_mp4_without_its_library_is_explained(
    setup: Setup, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(PictureError, match="pip install av"):
        draw(setup, tmp_path / "motion.mp4", SMALL)


def test_the_camera_holds_the_whole_motion(setup: Setup) -> None:
    """Every corner of every box, projected by hand, lies inside the image, and some near its edge."""
    model = copy.copy(setup.compiled)
    camera = usual_camera(model)
    aspect = 4 / 3
    positions = solved_at(setup, np.linspace(0, 2, 25))
    fit(model, camera, positions, aspect)
    azimuth, elevation = np.radians(camera.azimuth), np.radians(camera.elevation)
    ahead = np.array(
        [np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)]
    )
    right = np.cross(ahead, [0, 0, 1]) / np.linalg.norm(np.cross(ahead, [0, 0, 1]))
    up = np.cross(right, ahead)
    eye = camera.lookat - camera.distance * ahead
    half = np.tan(np.radians(model.vis.global_.fovy) / 2)
    extent = 0.0
    for x, z in positions:
        for corner in 0.07 * np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8).T:
            ray = np.array([x, 0, z]) + corner - eye
            depth = ray @ ahead
            extent = max(extent, abs(ray @ right) / (depth * half * aspect), abs(ray @ up) / (depth * half))
    assert 0.75 < extent <= 0.81


# ------------------------------------------------------------------ plots


def test_a_plot_has_every_joint_and_control(setup: Setup) -> None:
    made = figure(run_replays(setup))
    shown = [axes for axes in made.axes if axes.get_visible()]
    titles = [axes.get_title(loc="left") for axes in shown]
    assert titles[:4] == ["joint x", "joint z", "actuator fx", "actuator fz"]
    assert titles[4].startswith("path")
    x, _ = waypoint_spline()
    solved, replayed, tracked = shown[0].get_lines()
    np.testing.assert_allclose(solved.get_ydata(), x[0](np.asarray(solved.get_xdata())), atol=1e-9)
    np.testing.assert_allclose(replayed.get_ydata(), solved.get_ydata(), atol=1e-9)
    np.testing.assert_allclose(tracked.get_ydata(), solved.get_ydata(), atol=1e-9)
    (legend,) = made.legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "solved",
        "replayed by MuJoCo, forces alone",
        "replayed with feedback (LQR)",
    ]


def test_plots_are_written_and_an_svg_is_the_same_each_time(setup: Setup, tmp_path: Path) -> None:
    replays = run_replays(setup)
    for ending in ("png", "pdf"):
        save_plot(replays, tmp_path / f"plot.{ending}")
        assert (tmp_path / f"plot.{ending}").stat().st_size > 5000
    save_plot(replays, tmp_path / "a.svg")
    save_plot(replays, tmp_path / "b.svg")
    text = (tmp_path / "a.svg").read_text()
    assert text == (tmp_path / "b.svg").read_text()
    assert "joint x" in text


def test_a_replay_that_runs_away_does_not_flatten_the_plot() -> None:
    wild = solution()
    wild.replay[2].value.after[:] += 1e4
    made = figure(run_replays(prepare(wild)))
    low, high = made.axes[0].get_ylim()
    assert high - low < 10


def test_variables_are_sampled_on_their_own_curve_with_upright_jumps() -> None:
    solved = solution()
    time, curves = sampled(solved)
    assert np.all(np.diff(time) >= 0.0)
    assert (time[0], time[-1]) == (0.0, 2.0)
    assert np.allclose(curves["x"], solved.at(time)["x"], atol=1e-12)
    jump = copy.copy(solved)
    fx = solved.trajectories["fx", 0]
    after = fx.after.copy()
    after[7] += 5.0
    jump.trajectories = {**solved.trajectories, ("fx", 0): Channel(fx.before, after, fx.mid)}
    time, curves = sampled(jump)
    (at,) = np.flatnonzero((np.diff(time) == 0.0) & (np.abs(np.diff(curves["fx"])) > 4.0))
    assert time[at] == solved.time[7]
    assert (curves["fx"][at], curves["fx"][at + 1]) == (fx.before[7], after[7])


@pytest.mark.parametrize(
    ("name", "look"),
    [
        ("a.png", Look(tiles=1000)),
        ("a.gif", Look(rate=1_000_000)),
        ("a.webp", Look(width=4096, height=4096)),
        ("a.mp4", Look(speed=1e-9)),
    ],
)
def test_pictures_out_of_proportion_are_refused_before_the_work(
    name: str, look: Look, setup: Setup, tmp_path: Path
) -> None:
    def progress(done: int, total: int) -> None:
        raise AssertionError("an image was drawn")

    if name.endswith(".mp4"):
        pytest.importorskip("av")
    with pytest.raises(UsageError, match="at most"):
        draw(setup, tmp_path / name, look, progress=progress)
    assert not list(tmp_path.iterdir())
