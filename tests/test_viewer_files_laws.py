"""Laws of grounds, animations, plots and overlays: where things are drawn, and how long pictures last."""

from __future__ import annotations

import base64
import io
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import umsgpack
from PIL import Image, ImageSequence

import posekit
from posekit.cameras import ScaledOrthographicCamera
from posekit.motion import Motion
from posekit.synthesis import random_views
from posekit.validators.report import joined
from posekit.viewer.files import encoded, stride
from posekit.viewer.page import data as data_module
from posekit.viewer.page.data import page_data
from posekit.viewer.scene import Stage
from posekit.viewer.subjects import subjects_of
from tests.test_report_laws import random_report
from tests.test_robots import joint, link, text
from tests.test_viewer_laws import paths_of

FIGURE = posekit.load_figure()


def walk(way: float, frames: int = 3) -> Motion:
    """Return a standing figure that is moved along x."""
    q = np.tile(FIGURE.neutral, (frames, 1))
    q[:, 0] = np.linspace(0.0, way, frames)
    return Motion(joints=FIGURE.points(q), time=np.arange(frames) / 30, up="+z")


def lines_of(stage: Stage, name: str) -> np.ndarray[Any, Any]:
    """Return the lines (K, 2, 3) that were sent under a name, world, metres."""
    for command in stage.recorder.taken():
        if isinstance(command, str):
            sent = umsgpack.unpackb(base64.b64decode(command))
            if sent["path"].endswith(name) and sent["type"] == "set_object":
                (geometry,) = sent["object"]["geometries"]
                held = geometry["data"]["attributes"]["position"]["array"]
                raw = held.data if hasattr(held, "data") else held
                return np.frombuffer(raw, dtype=np.float32).reshape(-1, 2, 3)
    raise AssertionError(name)


@pytest.mark.parametrize(("way", "spacing"), [(0.0, 0.5), (3.0, 0.5), (54.0, 0.5), (58.0, 1.0), (130.0, 1.5)])
def test_the_ground_is_a_grid_under_the_lowest_link(way: float, spacing: float) -> None:
    """Lines are half a metre apart, wider if there would be more than 120, and reach two cells beyond the bodies."""
    subjects, _, _ = subjects_of(walk(way), azimuth=0.0, moving=True)
    stage = Stage(subjects)
    lines = lines_of(stage, "ground")
    points = subjects[0].points.reshape(-1, 3)
    assert stage.grid == spacing
    assert lines[..., 2] == pytest.approx(points[:, 2].min() - 0.06, abs=1e-5)
    for axis in range(2):
        across = lines[lines[:, 0, axis] == lines[:, 1, axis]]
        places = across[:, 0, axis]
        assert np.diff(places) == pytest.approx(spacing, abs=1e-4) and len(places) <= 124
        assert np.abs(places / spacing - np.round(places / spacing)).max() < 1e-4
        low, high = points[:, axis].min(), points[:, axis].max()
        assert 2 * spacing <= low - places[0] + 1e-4 < 3.01 * spacing
        assert 2 * spacing <= places[-1] - high + 1e-4 < 3.01 * spacing
        ends = np.sort(across[:, :, 1 - axis], axis=1)
        assert len(np.unique(ends, axis=0)) == 1


# Animations


@pytest.mark.parametrize(
    ("suffix", "rate", "step"),
    [
        (".gif", None, 1),
        (".gif", 20.0, 1),
        (".gif", 21.0, 2),
        (".gif", 30.0, 2),
        (".gif", 60.0, 3),
        (".gif", 120.0, 6),
        (".mp4", None, 1),
        (".mp4", 60.0, 1),
        (".mp4", 61.0, 2),
        (".mp4", 120.0, 2),
        (".mp4", 240.0, 4),
        (".png", 240.0, 1),
    ],
)
def test_fast_recordings_are_thinned_out(suffix: str, rate: float | None, step: int) -> None:
    assert stride(suffix, rate) == step


def pictures(count: int, size: tuple[int, int] = (33, 50)) -> np.ndarray[Any, Any]:
    """Return pictures (T, height, width, 3) of a grey ramp that moves on."""
    ramp = np.linspace(20, 230, size[1]).astype(np.uint8)
    rows = np.stack([np.roll(ramp, 5 * k) for k in range(count)])
    return np.broadcast_to(rows[:, None, :, None], (count, *size, 3)).copy()


@pytest.mark.parametrize(
    ("rate", "milliseconds"), [(None, 100), (10.0, 100), (25.0, 40), (4.0, 250), (90.0, 20)]
)
def test_pictures_of_a_gif_last_as_long_as_frames(rate: float | None, milliseconds: int) -> None:
    with Image.open(io.BytesIO(encoded(pictures(4), ".gif", rate))) as film:
        frames = [
            (one.info["duration"], np.asarray(one.convert("RGB"))) for one in ImageSequence.Iterator(film)
        ]
        assert len(frames) == 4 and film.info["loop"] == 0
    for (lasts, frame), given in zip(frames, pictures(4), strict=True):
        assert lasts == milliseconds
        assert np.abs(frame.astype(int) - given).max() <= 6


@pytest.mark.parametrize("rate", [None, 12.5, 30.0])
def test_a_film_has_every_picture_at_its_rate(rate: float | None) -> None:
    av = pytest.importorskip("av")
    with av.open(io.BytesIO(encoded(pictures(5), ".mp4", rate))) as film:
        assert float(film.streams.video[0].average_rate) == pytest.approx(rate or 10.0)
        frames = [one.to_ndarray(format="rgb24").astype(int) for one in film.decode(video=0)]
    assert len(frames) == 5
    for frame, given in zip(frames, pictures(5), strict=True):
        assert frame.shape == (32, 50, 3)  # films have even sides
        assert np.median(np.abs(frame - given[:32])) < 8


def test_a_png_is_the_first_picture() -> None:
    with Image.open(io.BytesIO(encoded(pictures(3), ".png", 30.0))) as image:
        np.testing.assert_array_equal(np.asarray(image), pictures(3)[0])


# Plots


def test_timelines_have_a_lane_a_check_under_the_longest_valid_run(tmp_path: Path) -> None:
    report = random_report(1, (60,))
    posekit.render(report, tmp_path / "lanes.svg")
    drawn = (tmp_path / "lanes.svg").read_text(encoding="utf-8")
    (clip,) = report.clips
    (good,) = paths_of(drawn, "good")
    lanes: dict[str, set[float]] = {}
    for span in clip.spans:
        for bar in paths_of(drawn, f"{span.check}/{span.place}:{span.first}-{span.last}"):
            lanes.setdefault(span.check, set()).add(round(float(bar[:, 1].mean()), 2))
            assert good[:, 1].max() < bar[:, 1].min()
            assert np.ptp(good[:, 1]) == pytest.approx(0.2 * np.ptp(bar[:, 1]), rel=0.01)
    assert list(lanes) == list(dict.fromkeys(span.check for span in clip.spans))
    heights = [height for (height,) in lanes.values()]
    assert len(heights) > 2 and heights == sorted(heights)
    assert np.diff(heights) == pytest.approx(np.diff(heights)[0], rel=0.01)


@pytest.mark.parametrize(("clips", "shown"), [(3, 3), (14, 12)])
def test_timelines_show_the_worst_clips(clips: int, shown: int, tmp_path: Path) -> None:
    report = random_report(2, (20,) * clips)
    posekit.render(report, tmp_path / "clips.svg")
    drawn = (tmp_path / "clips.svg").read_text(encoding="utf-8")
    named = [title for title in (clip.title for clip in report.clips) if f"<!-- {title}: " in drawn]
    worst = sorted(report.clips, key=lambda one: (one.decision == "keep", -one.severity))[:shown]
    assert sorted(named) == sorted(one.title for one in worst)


@pytest.mark.parametrize(("frames", "timed"), [(39, True), (40, False)])
def test_plots_of_few_frames_mark_each(frames: int, timed: bool, tmp_path: Path) -> None:
    motion = walk(1.0, frames)
    if not timed:
        motion = Motion(joints=motion.joints, up="+z")
    posekit.render(motion, tmp_path / "angles.svg", which="angles")
    drawn = (tmp_path / "angles.svg").read_text(encoding="utf-8")
    first = re.search(r'<g id="angle">(.*?)<g id="', drawn, re.DOTALL)
    assert first is not None and (first[1].count("<use ") == frames) is (frames < 40)
    assert f"<!-- {'seconds' if timed else 'frame'} -->" in drawn


TREE = text(
    *map(link, "abcd"),
    joint("left_hinge", "a", "b"),
    joint("waist", "a", "c"),
    joint("right_slide", "a", "d", "prismatic", axis="0 0 1"),
)


def test_angles_of_a_robot_are_to_scale_in_the_colours_of_their_sides(tmp_path: Path) -> None:
    (tmp_path / "tree.urdf").write_text(TREE)
    robot = posekit.load_robot(tmp_path / "tree.urdf")
    q = np.tile(robot.neutral, (50, 1))
    q[:, -3:] += 0.9 * np.sin(np.arange(50) / 8)[:, None] * np.array([0.3, 1.0, -0.6])
    motion = Motion(q=q, q_names=robot.configuration_names, robot=str(tmp_path / "tree.urdf"))
    posekit.render(motion, tmp_path / "robot.svg", which="angles")
    drawn = (tmp_path / "robot.svg").read_text(encoding="utf-8")
    lines, outside = paths_of(drawn, "angle"), paths_of(drawn, "outside")
    assert len(lines) == 3 and list(robot.configuration_names[-3:]) == ["left_hinge", "right_slide", "waist"]
    for k, line in enumerate(lines):
        low, high = outside[2 * k][:, 1].min(), outside[2 * k + 1][:, 1].max()
        degrees = np.degrees(-1 + (line[:, 1] - low) / (high - low) * 3)
        expected = np.interp(line[:, 0], np.linspace(line[0, 0], line[-1, 0], 50), np.degrees(q[:, k - 3]))
        np.testing.assert_allclose(degrees, expected, atol=0.6)
    colours = re.findall(r'<g id="angle">\s*<path [^>]*style="[^"]*stroke: (#[0-9a-f]+)', drawn)
    assert colours == ["#0072b2", "#d55e00", "#333333"]


# Overlays


@pytest.fixture
def seen() -> posekit.View:
    joints = random_views(3, np.random.default_rng(8)).truth
    joints = joints - joints.mean(axis=1, keepdims=True) + np.array([0.8, 0.6, 0.0])
    camera = ScaledOrthographicCamera(scale=200.0)
    return posekit.View(camera=camera, image=camera.project(joints), truth=joints, time=np.arange(3) / 10)


def test_a_longer_film_is_matched_by_time(seen: posekit.View, tmp_path: Path) -> None:
    """The film has three pictures for each frame of the view; every third one is drawn over."""
    pytest.importorskip("av")
    shades = np.linspace(40, 220, 9).astype(np.uint8)
    film = np.broadcast_to(shades[:, None, None, None], (9, 240, 320, 3)).copy()
    (tmp_path / "long.mp4").write_bytes(encoded(film, ".mp4", 30.0))
    for k in range(3):
        posekit.render(seen, tmp_path / "over.png", over=tmp_path / "long.mp4", frame=k)
        picture = np.asarray(Image.open(tmp_path / "over.png")).astype(int)
        assert abs(np.median(picture[:5]) - shades[3 * k]) < 8


def test_image_points_are_ringed_where_they_are(seen: posekit.View, tmp_path: Path) -> None:
    Image.new("RGB", (320, 240), (90, 90, 90)).save(tmp_path / "grey.png")
    alone = posekit.View(camera=seen.camera, image=seen.image[:1], truth=seen.truth[:1], time=np.zeros(1))
    posekit.render(alone, tmp_path / "over.png", over=tmp_path / "grey.png")
    picture = np.asarray(Image.open(tmp_path / "over.png")).astype(int)
    image, grid = alone.image[0], np.stack(np.meshgrid(np.arange(320), np.arange(240)), axis=-1)
    apart = np.linalg.norm(image[:, None] - image[None], axis=-1) + 100 * np.eye(14)
    lonely = image[apart.min(axis=1) > 12]
    assert len(lonely) > 8
    off, radii = [], []
    for point in lonely:
        away = grid[(picture.min(axis=2) > 190) & (np.linalg.norm(grid - point, axis=-1) < 6)] - point
        if len(away) > 8:  # limbs do not hide it
            off.append(away.mean(axis=0))
            radii.append(np.median(np.linalg.norm(away, axis=1)))
    assert len(off) > 5 and np.abs(np.median(off, axis=0)).max() < 0.3
    assert 2.0 < min(radii) and max(radii) < 3.5


# Pages that leave something out


def test_a_page_lists_the_worst_three_hundred_clips(tmp_path: Path) -> None:
    report = random_report(7, (2,) * 301)
    data = page_data(report, "x")
    assert (len(data["clips"]), data["moreClips"]) == (300, 1)
    left = set(range(301)) - {one["clip"] for one in data["clips"]}
    order = [(one.decision == "keep", -one.severity) for one in report.clips]
    assert [order[k] for k in left] == [max(order)]


@pytest.mark.parametrize("most", [20, 45, 75, 90])
def test_a_page_holds_the_worst_clips_that_have_room(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    motions = [walk(1.0, frames) for frames in (30, 25, 35)]
    joints = [np.array(motion.joints) for motion in motions]
    for k, bend in ((0, 0.3), (1, 0.5), (2, 0.1)):
        joints[k][10, 8] += [0.0, bend, 0.0]
    motions = [
        Motion(joints=one, time=motion.time, up="+z") for one, motion in zip(joints, motions, strict=True)
    ]
    report = joined([posekit.validate(motion) for motion in motions])
    monkeypatch.setattr(data_module, "MOST_FRAMES", most)
    data = page_data(report, "x", view=motions)
    worst = sorted(range(3), key=lambda k: -report.clips[k].severity)
    assert worst == [1, 0, 2]
    shown, room = [], most
    for k in worst:
        room -= len(motions[k])
        shown += [k] * (room >= 0)
    expected = [(k, frame) for k in sorted(shown) for frame in range(len(motions[k]))]
    if most < 25:  # the worst clip alone has no room: the first frames
        expected = [(0, frame) for frame in range(most)]
    assert [(one["clip"], one["number"]) for one in data["frames"]] == expected
    assert data["left"] == 90 - len(expected)


def test_a_page_holds_the_likeliest_postures_and_all_representatives(monkeypatch: pytest.MonkeyPatch) -> None:
    found = posekit.recover(posekit.builtin_view("seq2"), checks=["collision"])
    monkeypatch.setattr(data_module, "MOST_OF_FRAME", 5)
    monkeypatch.setattr(data_module, "MOST_REASONS", 2)
    data = page_data(found, "x")
    for k, one in enumerate(data["frames"]):
        rows = found.rows(k)
        named = {*found.answer.representatives[k].tolist(), int(found.answer.survivor[k])}
        kept = {*range(rows.start, min(rows.start + 5, rows.stop)), *named}
        assert (one["held"], one["count"]) == (len(kept), rows.stop - rows.start)
        rejected = sorted(found.frames.rejected[k].values(), reverse=True)
        assert [count for _, count in one["rejected"]] == rejected[:2]
        assert one["rejectedMore"] == sum(rejected[2:])
    assert {one["unit"]: one["scale"] for one in data["margins"]} == {"mm": 1000.0}


def test_margins_of_a_page_are_in_millimetres_or_degrees() -> None:
    data = page_data(posekit.recover(posekit.builtin_view("seq1")), "x")
    units = {one["name"]: (one["unit"], one["scale"]) for one in data["margins"]}
    assert units == {"rigid-parts": ("mm", 1000.0), "joint-range": ("°", 1.0), "collision": ("mm", 1000.0)}
