"""Postures drawn over the pictures they came from: what is drawn is where the camera saw it, or it is refused."""

from __future__ import annotations

import struct
import sys
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import posekit
from posekit.body import load_figure
from posekit.cameras import PinholeCamera
from posekit.cli.main import main
from posekit.errors import InputError, ViewerError
from posekit.formats.own import OpenCVModel, ScaledOrthographicModel, View
from posekit.skeleton import JOINTS
from posekit.synthesis import random_views
from posekit.viewer.browser.studio import Studio
from posekit.viewer.overlay import (
    DrawnPerson,
    OverlaidPerson,
    Overlay,
    frame_pictures,
    overlaid_person,
    paint,
    write_overlay,
    write_photographs,
)
from posekit.viewer.overlay.figure_painter import outlines
from posekit.viewer.overlay.frame_pictures import matched
from posekit.viewer.overlay.image_file import read_image
from posekit.viewer.scene.compose import Style, compose
from posekit.viewer.scene.drawn_subject import subject_of
from posekit.viewer.scene.framing import view_eye
from posekit.viewer.scene.world import upright_world
from posekit.viewer.video import Video, write_mp4
from posekit.views import forget_camera, view_of
from tests.detector_files import view_keypoints, write_keypoints
from tests.viewer.driving import render

SIZE = (480, 270)
K = np.array([[375.0, 0.0, 239.5], [0.0, 375.0, 134.5], [0.0, 0.0, 1.0]])
BROWN = np.array([-0.2, 0.05, 0.002, -0.001, 0.0])


def seen_by(view: View, distortion: np.ndarray | None) -> View:
    """Return the postures of a view in another camera's pictures."""
    camera = PinholeCamera(K=K, distortion=distortion)
    return replace(
        view,
        camera=OpenCVModel(K=K, distortion=distortion, size=SIZE),
        image=camera.project(view.truth),
        head_image=np.full((len(view), 5, 2), np.nan),
        time=np.arange(len(view)) / 10,
    )


@pytest.fixture(scope="module")
def random_view() -> View:
    return view_of(random_views(load_figure(), 3, np.random.default_rng(3)))


@pytest.fixture(scope="module")
def view(random_view: View) -> View:
    return seen_by(random_view, BROWN)


@pytest.fixture(scope="module")
def person(view: View) -> OverlaidPerson:
    subject = subject_of(posekit.result_of(posekit.recover(view)), view)
    frames = [frame.chosen([0]) for frame in subject.frames]
    return OverlaidPerson(name="result", frames=frames, figure=subject.figure, size=SIZE)


@pytest.fixture(scope="module")
def folder(view: View, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pictures") / "drawn"
    assert write_photographs(path, view) == 3
    return path


@pytest.fixture(scope="module")
def film(view: View, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("film") / "film.mp4"
    assert write_photographs(path, view) == 3
    return path


def middle_of(changed: np.ndarray) -> np.ndarray:
    rows, columns = np.nonzero(changed)
    return np.array([columns.mean(), rows.mean()])


@pytest.mark.parametrize("distortion", [None, BROWN], ids=["pinhole", "lens"])
def test_joints_of_survivors_are_drawn_where_the_camera_saw_them(
    random_view: View, distortion: np.ndarray | None
) -> None:
    view = seen_by(random_view, distortion)
    result = posekit.result_of(posekit.recover(view))
    subject = subject_of(result, view)
    black = Image.new("RGB", SIZE)
    for k, shown in enumerate(subject.frames):
        assert len(shown)
        drawn = DrawnPerson(shown=shown, figure=subject.figure, points=False)
        for row in range(len(shown)):
            np.testing.assert_allclose(drawn.seen(row)[: len(JOINTS)], view.image[k], atol=0.01)
        # A wrist alone, painted: the middle of what changed is its image point.
        wrist = np.full_like(shown.points[:1], np.nan)
        wrist[0, 8] = shown.points[0, 8]
        alone = replace(shown.chosen([0]), points=wrist, inferred=())
        painted = np.asarray(paint(black, [replace(drawn, shown=alone)])).sum(axis=2)
        assert np.abs(middle_of(painted > 40) - view.image[k, 8]).max() < 1.0


def test_bodies_are_drawn_over_those_of_the_photograph(
    view: View, person: OverlaidPerson, folder: Path
) -> None:
    for k, shown in enumerate(person.frames):
        photograph = read_image(folder / f"{k:06}.png")
        empty = np.asarray(Image.new("RGB", SIZE, photograph.getpixel((0, 0))))
        sky = (np.asarray(photograph) == empty).all(axis=2)[: int(K[1, 2]) - 2]
        painted = paint(photograph, [DrawnPerson(shown=shown, figure=person.figure, points=False)])
        changed = (np.asarray(painted) != np.asarray(photograph)).any(axis=2)[: len(sky)]
        body = ~sky
        assert body.sum() > 100
        assert (
            changed & body
        ).sum() > 0.8 * body.sum()  # a mirrored limb is wider or narrower, and at no other place


def test_outline_of_a_sphere_is_where_its_tangent_rays_are(person: OverlaidPerson, view: View) -> None:
    drawn = DrawnPerson(shown=person.frames[0], figure=person.figure)
    capsules = {one.link: one for one in person.figure.capsules}
    for _, link, corners in outlines(drawn):
        capsule = capsules[link]
        middle, axis = capsule.place(person.frames[0].points[:1, list(capsule.points)])
        assert isinstance(view.camera, OpenCVModel)
        rays = PinholeCamera(K=K, distortion=BROWN).normalize(corners)
        rays = np.concatenate([rays, np.ones((len(rays), 1))], axis=1)
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        ends = np.concatenate([middle - capsule.half_length * axis, middle + capsule.half_length * axis])
        beside = np.linalg.norm(np.cross(ends[:, None], rays), axis=2).min(axis=0)
        np.testing.assert_allclose(beside, capsule.radius, rtol=1e-6)


def test_painted_bodies_cover_what_a_browser_draws(random_view: View, studio: Studio) -> None:
    view = seen_by(random_view, None)
    subject = subject_of(posekit.result_of(posekit.recover(view)), view)
    shown = subject.frames[0].chosen([0])
    painted = paint(
        Image.new("RGB", SIZE, "white"), [DrawnPerson(shown=shown, figure=subject.figure, points=False)]
    )
    ours = np.asarray(painted).min(axis=2) < 250
    world = upright_world(shown.points.reshape(-1, 3), None)
    style = Style(camera=False, ground=False, layout="superposed")
    composition = compose(shown, figure=subject.figure, world=world, style=style)
    drawn = studio.draw(composition.scene, view_eye(shown.sight, world, SIZE), size=SIZE, supersample=1)
    theirs = drawn[..., :3].min(axis=2) < 250
    # Joints are balls there and dots here: thin rims differ.
    assert (ours & theirs).sum() > 0.85 * (ours | theirs).sum()
    assert np.abs(middle_of(ours) - middle_of(theirs)).max() < 1.0


def test_video_in_video_out(person: OverlaidPerson, film: Path, tmp_path: Path) -> None:
    out = tmp_path / "over.mp4"
    count, said = write_overlay(out, [person], frame_pictures(film))
    assert count == 3
    assert said == ["pictures and frames are matched by their order"]
    video = Video.opened(out)
    assert (video.size, video.count, video.rate) == (SIZE, 3, 10.0)
    for k, (before, after) in enumerate(
        zip(Video.opened(film).pictures([0, 1, 2]), video.pictures([0, 1, 2]), strict=True)
    ):
        changed = np.abs(after.astype(int) - before).max(axis=2) > 60
        changed[:40, :200] = False  # the caption
        seen = person.frames[k].sight
        assert seen is not None
        known = seen.image[np.isfinite(seen.image).all(axis=1)]
        columns = np.nonzero(changed)[1]
        assert known[:, 0].min() - 40 < columns.min()
        assert columns.max() < known[:, 0].max() + 40


def test_folder_in_folder_out_each_by_its_name(person: OverlaidPerson, folder: Path, tmp_path: Path) -> None:
    assert write_overlay(tmp_path / "over", [person], frame_pictures(folder))[0] == 3
    assert sorted(one.name for one in (tmp_path / "over").iterdir()) == [f"{k:06}.png" for k in range(3)]


def test_several_people_are_all_drawn(person: OverlaidPerson, folder: Path, tmp_path: Path) -> None:
    aside = [replace(one, points=one.points + np.array([0.8, 0.0, 0.0])) for one in person.frames]
    other = replace(person, frames=aside)
    for name, people in (("one", [person]), ("two", [person, other])):
        write_overlay(
            tmp_path / f"{name}.png", people, frame_pictures(folder), Overlay(captions=False, points=False)
        )
    before, one, two = (
        np.asarray(read_image(path)).astype(int)
        for path in (folder / "000000.png", tmp_path / "one.png", tmp_path / "two.png")
    )
    added = (one != before).any(axis=2), (two != one).any(axis=2)
    assert added[1].sum() > 200
    assert middle_of(added[1])[0] > middle_of(added[0])[0] + 20


def test_names_tell_which_picture_is_whose(folder: Path) -> None:
    source = frame_pictures(folder)
    times = np.zeros(2)
    assert matched(source, times, ["a/000002.jpg", "000001.png"]).pictures == (2, 1)
    assert matched(source, times, ["a/000001", "000000.png"]).pictures == (1, 0)
    assert matched(source, np.zeros(3), ["cam.000000", "cam.000001", "cam.000002"]).pictures == (
        0,
        1,
        2,
    )  # by order
    with pytest.raises(InputError, match=r"no file x\.jpg, which frame 1 was detected in"):
        matched(source, times, ["000001.png", "x.jpg"])


def test_frames_of_a_longer_video_are_found_by_their_time(film: Path) -> None:
    source = frame_pictures(film)
    assert matched(source, np.array([0.0, 0.2])).pictures == (0, 2)
    for times in ([0.0, 0.15], [0.0, 0.3], [0.1, 0.1]):
        with pytest.raises(InputError, match="got 3 pictures; expected 2, one a frame"):
            matched(source, np.array(times))


def test_numbers_in_names_count_as_numbers(tmp_path: Path) -> None:
    for name in ("f10.png", "f9.png", "f1.png"):
        Image.new("RGB", (8, 8)).save(tmp_path / name)
    source = frame_pictures(tmp_path)
    assert [file.name for file in source.files] == ["f1.png", "f9.png", "f10.png"]  # type: ignore[union-attr]


def test_a_picture_scaled_whole_is_drawn_over_and_said(
    person: OverlaidPerson, folder: Path, tmp_path: Path
) -> None:
    large = tmp_path / "large.png"
    read_image(folder / "000001.png").resize((960, 540)).save(large)
    out = tmp_path / "over.png"
    _, said = write_overlay(out, [person], frame_pictures(large), Overlay(frames=[1]))
    assert said == ["pictures are the view's, 2 times as large"]
    with Image.open(out) as drawn:
        assert drawn.size == (960, 540)


def test_upright_as_its_exif_says(tmp_path: Path) -> None:
    picture = Image.new("RGB", (40, 20))
    exif = picture.getexif()
    exif[0x0112] = 6
    picture.save(tmp_path / "phone.jpg", exif=exif)
    assert read_image(tmp_path / "phone.jpg").size == (20, 40)
    assert frame_pictures(tmp_path / "phone.jpg").size(0) == (20, 40)


def test_a_video_stands_upright_as_its_camera_noted(tmp_path: Path) -> None:
    corner = np.zeros((64, 128, 3), np.uint8)
    corner[:20, :20] = 255
    held = tmp_path / "held.mp4"
    with held.open("w+b") as file:
        assert write_mp4(file, [corner, corner], fps=10) == 2
    content = bytearray(held.read_bytes())
    matrix = content.index(b"tkhd") + 44  # of ISO/IEC 14496-12's track header: a quarter turn clockwise
    one = 0x10000
    content[matrix : matrix + 36] = struct.pack(">9i", 0, one, 0, -one, 0, 0, 64 * one, 0, 0x40000000)
    held.write_bytes(content)
    video = Video.opened(held)
    assert video.size == (64, 128)
    [upright] = video.pictures([0])
    assert upright.shape == (128, 64, 3)
    assert (upright[5, -5] > 200).all()
    assert max(upright[5, 5].max(), upright[-5, 5].max(), upright[-5, -5].max()) < 50


def bomb(path: Path) -> Path:
    """Write a PNG of a few bytes that claims 900 million pixels."""
    head = struct.pack(">IIBBBBB", 30000, 30000, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", head), (b"IDAT", zlib.compress(bytes(100))), (b"IEND", b""))
    written = [
        struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
        for kind, content in chunks
    ]
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(written))
    return path


def test_hostile_pictures_are_refused_in_a_line(
    person: OverlaidPerson, film: Path, folder: Path, tmp_path: Path
) -> None:
    broken = tmp_path / "broken.jpg"
    read_image(folder / "000000.png").save(broken)
    broken.write_bytes(broken.read_bytes()[:1500])
    noise = tmp_path / "noise.mp4"
    noise.write_bytes(bytes(range(256)) * 8)
    playlist = tmp_path / "list.mp4"
    playlist.write_text("#EXTM3U\n#EXTINF:1,\n/etc/hostname\n")
    cut = tmp_path / "cut.mp4"
    cut.write_bytes(film.read_bytes()[:900])
    text = tmp_path / "text.png"
    text.write_text("no picture")
    empty = tmp_path / "empty"
    empty.mkdir()
    bad = {
        broken: "truncated",
        noise: "Invalid data",
        playlist: "Invalid data",
        cut: "Invalid data",
        text: "another kind of file",
        bomb(tmp_path / "bomb.png"): "pixels",
        empty: "a folder with 0",
        tmp_path / "nowhere.png": "No such file",
    }
    for path, said in bad.items():
        with pytest.raises(InputError, match=said) as refused:
            write_overlay(tmp_path / "out.png", [person], frame_pictures(path), Overlay(frames=[0]))
        assert "\n" not in str(refused.value)
        assert path.name in str(refused.value)
    assert not (tmp_path / "out.png").exists()


def test_pictures_of_something_else_are_refused(person: OverlaidPerson, folder: Path, tmp_path: Path) -> None:
    square = tmp_path / "square.png"
    Image.new("RGB", (300, 300)).save(square)
    with pytest.raises(InputError, match=r"the picture is 300x300, the view's camera 480x270 pixels"):
        write_overlay(tmp_path / "out.png", [person], frame_pictures(square), Overlay(frames=[0]))
    unsized = replace(person, size=None)
    Image.new("RGB", (100, 60)).save(square)
    with pytest.raises(InputError, match=r"frame 0's image points are at .* the picture is 100x60"):
        write_overlay(tmp_path / "out.png", [unsized], frame_pictures(square), Overlay(frames=[0]))
    with pytest.raises(InputError, match="got 1 picture; expected 3, one a frame; choose one with --frame"):
        write_overlay(tmp_path / "out.png", [person], frame_pictures(square))
    fewer = tmp_path / "fewer"
    fewer.mkdir()
    for k in range(2):
        read_image(folder / f"{k:06}.png").save(fewer / f"{k}.png")
    with pytest.raises(InputError, match="got 2 pictures; expected 3, one a frame"):
        write_overlay(tmp_path / "out.mp4", [person], frame_pictures(fewer))
    read_image(folder / "000000.png").resize((240, 135)).save(fewer / "2.png")
    with pytest.raises(ViewerError, match="make no film"):
        write_overlay(tmp_path / "out.mp4", [person], frame_pictures(fewer))
    assert not (tmp_path / "out.mp4").exists()


def test_uncalibrated_survivors_of_any_scale_meet_the_image(random_view: View, tmp_path: Path) -> None:
    points = random_view.truth[:1, :, :2] * 150.0
    image = points - np.nanmin(points, axis=1, keepdims=True) + 20
    flat = View(camera=ScaledOrthographicModel(scale=None), time=np.zeros(1), image=image)
    result = posekit.result_of(posekit.recover(flat, scale="min"))
    subject = subject_of(result, flat)
    drawn = DrawnPerson(shown=subject.frames[0], figure=subject.figure)
    for row in range(len(subject.frames[0])):
        np.testing.assert_allclose(drawn.seen(row)[: len(JOINTS)], image[0], atol=0.5)


def test_command_draws_a_view_over_its_film_and_refuses_what_means_nothing(
    view: View,
    film: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    posekit.write_view(tmp_path / "view.json", view)
    result = tmp_path / "result.npz"
    posekit.write_result(result, posekit.result_of(posekit.recover(view)))
    words = [result, "--view", tmp_path / "view.json", "--over", film]
    assert render(monkeypatch, *words, "-o", tmp_path / "over.gif") == 0
    assert capsys.readouterr().out.endswith("over.gif (3 pictures)\n")
    assert render(monkeypatch, *words, "-o", tmp_path / "over.png", "--frame", "1", "--posture", "all") == 0
    for more, said in (
        (["--azimuth", "3"], "--azimuth: means nothing beside --over"),
        (["--posture", "path"], "the result has no path"),
        (["--frame", "7"], "expected a number from 0 to 2"),
        (["--size", "99999x99999"], "99999x99999"),
    ):
        capsys.readouterr()
        assert render(monkeypatch, *words, "-o", tmp_path / "no.png", *more) == 2
        error = capsys.readouterr().err
        assert said in error
        assert error.count("\n") == 1
    assert render(monkeypatch, result, "--over", film, "-o", tmp_path / "held.png", "--frame", "1") == 0
    held = posekit.read_result(result)
    settings = {name: value for name, value in held.settings.items() if name != "camera"}
    posekit.write_result(result, replace(held, settings=settings))
    capsys.readouterr()
    assert render(monkeypatch, result, "--over", film, "-o", tmp_path / "no.png") == 2
    assert "--view VIEW" in capsys.readouterr().err
    assert not (tmp_path / "no.png").exists()
    posekit.write_view(tmp_path / "view.json", view)
    photographs = tmp_path / "photographs"
    write_photographs(photographs, view)
    words = [result, "--view", tmp_path / "view.json", "--over", photographs, "-o"]
    assert render(monkeypatch, *words, photographs / "over.png", "--frame", 0) == 2
    assert "is in the folder of the photographs" in capsys.readouterr().err


def test_a_result_says_which_pictures_a_detector_read(
    view: View,
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    keypoints = view_keypoints(view, "coco", "coco_17")
    named = replace(keypoints, pictures=("000002.jpg", "000000.jpg", "000001.jpg"))
    write_keypoints(tmp_path / "detected.json", named, "coco")
    monkeypatch.setattr(
        sys, "argv", ["posekit", "recover", str(tmp_path / "detected.json"), "-o", str(tmp_path / "r.npz")]
    )
    with pytest.raises(SystemExit) as ended:
        main()
    assert not ended.value.code, capsys.readouterr().err
    result = posekit.read_result(tmp_path / "r.npz")
    assert result.settings["pictures"] == list(named.pictures)
    person = overlaid_person(result)
    assert tuple(person.files) == named.pictures
    assert not person.detected  # no view was given that has the points
    assert overlaid_person(result, replace(forget_camera(view), time=view.time)).detected
    shuffled = tmp_path / "shuffled"
    shuffled.mkdir()
    for name, frame in zip(named.pictures, range(3), strict=True):
        read_image(folder / f"{frame:06}.png").save(shuffled / name)
    assert render(monkeypatch, tmp_path / "r.npz", "--over", shuffled, "-o", tmp_path / "over") == 0
    assert "by file names" in capsys.readouterr().out
    assert sorted(file.name for file in (tmp_path / "over").iterdir()) == [f"00000{k}.png" for k in range(3)]


@pytest.mark.parametrize(
    ("degrees", "horizon"), [(0.0, 134.5), (10.0, 68.4), (-10.0, 200.6), (80.0, -np.inf)]
)
def test_a_photographs_horizon_is_where_the_camera_sees_it(
    degrees: float, horizon: float, walk: View, tmp_path: Path
) -> None:
    """A camera that looks down by an angle has it above the middle, by the focal length times its tangent."""
    tilt = np.radians(degrees)
    R = np.array([[1, 0, 0], [0, -np.sin(tilt), -np.cos(tilt)], [0, np.cos(tilt), -np.sin(tilt)]])
    view = seen_by(walk, None)
    camera = OpenCVModel(K=K, size=SIZE, R=R, t=np.zeros(3), up="+z")
    nobody = replace(view, camera=camera)
    write_photographs(tmp_path / "pictures", nobody)
    column = np.asarray(Image.open(tmp_path / "pictures/000000.png"))[:, 0].astype(int)
    rows = np.arange(SIZE[1])
    sky = column[:, 2] > column[:, 0]
    np.testing.assert_array_equal(sky, rows < horizon)
