"""Picture files, and `posekit render`: what is written, and what is refused."""

from __future__ import annotations

import itertools
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import posekit
from posekit.answers.wording import percent
from posekit.conversion.chosen_postures import chosen_frames, chosen_postures
from posekit.errors import InputError, ViewerError
from posekit.formats.held_postures import HeldPostures, held_postures
from posekit.formats.own import Postures, Result, View
from posekit.formats.recognising import Recognised
from posekit.skeleton import JOINTS
from posekit.viewer.moving import real_time
from posekit.viewer.pictures import Shot, check_picture, write_picture
from posekit.viewer.scene.beside_truth import BESIDE_METRES, beside_truth
from posekit.viewer.scene.compose import Style
from posekit.viewer.scene.drawn_subject import DrawnSubject, subject_of
from posekit.viewer.scene.likeliest import MAX_BESIDE, likeliest_first
from posekit.viewer.video import Video
from tests.viewer.driving import render

SMALL = Shot(size=(200, 150), supersample=1)


def refused(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *words: object) -> str:
    assert render(monkeypatch, *words) == 2
    error = capsys.readouterr().err
    assert error.startswith("posekit: error: ")
    assert error.count("\n") == 1
    return error


def test_sequence_becomes_a_gif_that_moves(subject: DrawnSubject, tmp_path: Path) -> None:
    film = tmp_path / "walk.gif"
    frames = [frame.chosen([0]) for frame in subject.frames]
    done: list[int] = []
    assert write_picture(film, subject, frames, shot=SMALL, progress=done.append) == 5
    assert done == [1] * 5
    with Image.open(film) as gif:
        assert gif.size == (200, 150)
        assert getattr(gif, "n_frames", 1) == 5
        assert gif.info["duration"] == 100
        pictures = []
        for k in range(5):
            gif.seek(k)
            pictures.append(np.asarray(gif.convert("RGB")).astype(int))
    assert all((np.abs(a - b).max(axis=-1) > 30).sum() > 50 for a, b in itertools.pairwise(pictures))


def test_what_moves_is_as_fast_as_it_was() -> None:
    assert real_time([1.0, 1.2, 1.4]) == pytest.approx(5)
    assert real_time([0.0, 1 / 240]) == 100  # no player shows more
    for unknown in ([0.0], [2.0, 2.0], [float("nan")] * 3):
        assert real_time(unknown) == 10


def test_turntable_goes_around(subject: DrawnSubject, tmp_path: Path) -> None:
    film = tmp_path / "turn.gif"
    shot = Shot(size=(200, 150), supersample=1, turntable=4, fps=50)
    style = Style(camera=False)
    assert write_picture(film, subject, [subject.frames[0].chosen([0])], style=style, shot=shot) == 4
    with Image.open(film) as gif:
        assert getattr(gif, "n_frames", 1) == 4
        assert gif.info["duration"] == 20


def test_mp4_is_a_video_that_moves_with_even_sides(subject: DrawnSubject, tmp_path: Path) -> None:
    film = tmp_path / "walk.mp4"
    frames = [frame.chosen([0]) for frame in subject.frames[:3]]
    shot = Shot(size=(201, 151), supersample=1, fps=12.5)
    assert write_picture(film, subject, frames, shot=shot) == 3
    video = Video.opened(film)
    assert (video.size, video.rate, video.count) == ((202, 152), 12.5, 3)
    pictures = [picture.astype(int) for picture in video.pictures([0, 1, 2])]
    assert all((np.abs(a - b).max(axis=-1) > 30).sum() > 50 for a, b in itertools.pairwise(pictures))


def test_mp4_without_its_package_is_refused_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(InputError, match=r"writing \.mp4 needs av.*pip install 'posekit\[video\]'"):
        check_picture(tmp_path / "walk.mp4", SMALL)


@pytest.mark.parametrize(
    ("name", "shot", "match"),
    [
        ("a.bmp", Shot(), "format is .bmp; expected one of .png"),
        ("a", Shot(), "format is none"),
        ("a.png", Shot(turntable=12), "a turntable moves"),
        ("a.gif", Shot(fps=0), "0 pictures a second"),
        ("a.gif", Shot(fps=float("nan")), "nan pictures a second"),
        ("a.png", Shot(size=(0, 10)), "picture of 0x10"),
        ("a.png", Shot(size=(5000, 10), supersample=4), "drawn 4 times larger"),
    ],
)
def test_what_cannot_be_drawn_is_refused_first(name: str, shot: Shot, match: str) -> None:
    with pytest.raises(ViewerError, match=match):
        check_picture(name, shot)


def test_nothing_is_written_where_nothing_is_drawn(
    subject: DrawnSubject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(ViewerError, match="no posture in these frames"):
        write_picture(tmp_path / "a.png", subject, [subject.frames[0].chosen([])])
    with pytest.raises(InputError, match="directory that does not exist"):
        write_picture(tmp_path / "none" / "a.png", subject, [subject.frames[0]])
    unknown = subject_of(Postures(joints=np.full((1, 14, 3), np.nan)))
    with pytest.raises(ViewerError, match="all are NaN"):
        write_picture(tmp_path / "a.html", unknown)
    with pytest.raises(ViewerError, match="camera is not known"):
        standing = posekit.load_figure().neutral_points[None, :14]
        write_picture(tmp_path / "a.png", subject_of(Postures(joints=standing)), shot=Shot(through_view=True))
    monkeypatch.setenv("POSEKIT_BROWSER", "/bin/false")
    with pytest.raises(ViewerError, match="/bin/false: it ended"):
        write_picture(tmp_path / "a.png", subject, [subject.frames[0]])
    assert list(tmp_path.iterdir()) == []


def test_page_needs_no_browser(
    subject: DrawnSubject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("POSEKIT_BROWSER", "/bin/false")
    page = tmp_path / "a.html"
    assert write_picture(page, subject, [subject.frames[0]], title="36 <postures>") == 1
    text = page.read_text(encoding="utf-8")
    assert "<title>36 &lt;postures&gt;</title>" in text
    assert text.count("set_object") > 100


# --- the command ----------------------------------------------------------------------------------------


def test_render_draws_chosen_postures(
    walk_files: tuple[Path, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    result, view = walk_files
    picture = tmp_path / "a.png"
    words = (result, "--view", view, "-o", picture, "--frame", 1, "--posture", "0,2", "--size", "320x200")
    assert render(monkeypatch, *words) == 0
    assert capsys.readouterr().out == f"written: {picture}\n"
    with Image.open(picture) as drawn:
        assert drawn.size == (320, 200)
    film = tmp_path / "a.gif"
    small = ("--size", "160x120", "--supersample", 1)
    assert render(monkeypatch, result, "-o", film, "--frame", "1-3", "--posture", 0, *small) == 0
    assert capsys.readouterr().out == f"written: {film} (3 pictures)\n"
    assert render(monkeypatch, result, "-o", film, "--posture", "likeliest", *small) == 0
    assert render(monkeypatch, result, "-o", picture, "--rejected", *small) == 0
    assert render(monkeypatch, view, "-o", tmp_path / "page.html") == 0
    assert render(monkeypatch, result, "-o", tmp_path / "scene.html", "--layout", "superposed") == 0


def test_render_draws_what_is_known_of_postures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    standing = np.array(posekit.load_figure().neutral_points[:14]) @ [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
    two = np.stack([standing, np.full((14, 3), np.nan)])
    two[0, 8] = np.nan
    posekit.write_postures(tmp_path / "p.json", two)
    small = ("--size", "160x120", "--supersample", 1)
    assert render(monkeypatch, tmp_path / "p.json", "-o", tmp_path / "a.png", *small) == 0
    capsys.readouterr()
    text = refused(monkeypatch, capsys, tmp_path / "p.json", "-o", tmp_path / "b.png", "--posture", 1, *small)
    assert "all are NaN" in text
    assert not (tmp_path / "b.png").exists()
    words = (tmp_path / "p.json", "-o", tmp_path / "b.png", "--posture", "likeliest")
    assert "nothing says how likely the postures are" in refused(monkeypatch, capsys, *words)


def test_the_likeliest_posture_is_chosen(subject: DrawnSubject, walked: Result) -> None:
    for shown, frame in zip(subject.frames, walked.frames, strict=True):
        assert frame.probability is not None
        assert frame.answer is not None
        likeliest = int(frame.answer.representatives[0])
        chosen = chosen_postures(shown, "likeliest", 0)
        np.testing.assert_array_equal(chosen.points, shown.points[likeliest][None])
        assert chosen.probability == pytest.approx(frame.answer.probability[:1])
        told = percent(float(frame.answer.probability[0]))
        assert chosen.caption == f"likeliest: {told} ({len(shown)} postures)"
        unsaid = chosen_postures(replace(shown, answer=None), "likeliest", 0)
        np.testing.assert_array_equal(unsaid.points[0], shown.points[frame.probability.argmax()])
        assert len(chosen_postures(shown.chosen([]), "likeliest", 0)) == 0
    firsts = [int(np.argmax(np.asarray(frame.probability))) for frame in walked.frames]
    assert any(firsts)  # not always the first


def test_a_picture_opens_on_the_likeliest_and_what_else_it_can_be(
    subject: DrawnSubject, walked: Result
) -> None:
    answer = walked.frames[0].answer
    assert answer is not None
    [still] = chosen_frames(subject, walked, "", [0], moving=False)
    rows = answer.representatives[:MAX_BESIDE]
    assert 1 < len(rows) < len(subject.frames[0])
    np.testing.assert_array_equal(still.points, subject.frames[0].points[rows])
    assert still.caption.startswith(f"likeliest: {percent(float(answer.probability[0]))}; then ")
    moving = chosen_frames(subject, walked, "", range(5), moving=True)
    assert [len(frame) for frame in moving] == [1] * 5
    [everything] = chosen_frames(subject, walked, "all", [0], moving=False)
    assert len(everything) == len(subject.frames[0])
    with pytest.raises(InputError, match="the result has no path; recover it with --follow 1"):
        chosen_frames(subject, walked, "path", [0], moving=False)


def test_what_moves_goes_along_the_likeliest_path(walk: View) -> None:
    recovery = posekit.recover(walk)
    result = posekit.result_of(recovery, following=posekit.follow(recovery, k=2))
    assert result.paths is not None
    shown = chosen_frames(subject_of(result, walk), result, "", range(len(walk)), moving=True)
    for k, frame in enumerate(shown):
        known = np.isnan(result.paths.smoothed[0, k])
        joints = np.where(known, result.paths.joints[0, k], result.paths.smoothed[0, k])
        np.testing.assert_allclose(frame.points[0, :14], joints, atol=1e-9)
        assert np.isfinite(frame.points[0, 14:]).all()


def test_truth_stands_beside_the_likeliest(subject: DrawnSubject, walk: View) -> None:
    for shown, joints in zip(subject.frames, walk.truth, strict=True):
        both = beside_truth(likeliest_first(shown, 1), joints)
        assert len(both) == 2
        np.testing.assert_array_equal(both.points[:1], likeliest_first(shown, 1).points)
        step = both.points[1, :14] - joints
        np.testing.assert_allclose(step, np.broadcast_to([BESIDE_METRES, 0, 0], (14, 3)), atol=1e-12)
        assert both.caption.endswith("right: truth")
        assert len(beside_truth(shown, np.full((14, 3), np.nan))) == len(shown)


def test_truth_of_an_uncalibrated_view_is_where_the_survivor_is(flat: Result) -> None:
    shown = subject_of(flat).frames[0].chosen([0])
    away = shown.points[0, :14] + np.array([3.0, -2.0, 40.0])
    both = beside_truth(shown, away)
    np.testing.assert_allclose(
        both.points[1, :14] - both.points[0, :14], [[BESIDE_METRES, 0, 0]] * 14, atol=1e-9
    )


def test_command_draws_truth_beside_and_refuses_what_is_none(
    walk_files: tuple[Path, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    result, view = walk_files
    small = ("--size", "160x120", "--supersample", 1)
    assert render(monkeypatch, result, "--truth", view, "-o", tmp_path / "a.html") == 0
    motion = tmp_path / "truth.json"
    posekit.write_postures(motion, np.asarray(posekit.read_view(view).truth))
    for words, said in (
        ((result, "--truth", motion), "expected 5"),
        ((view, "--truth", view, "--rejected"), "expected a result, without --rejected"),
        ((motion, "--truth", view), "expected a result"),
    ):
        capsys.readouterr()
        assert said in refused(monkeypatch, capsys, *words, "-o", tmp_path / "b.png", *small)


def test_motion_that_a_view_does_not_place_is_read_once(
    walk: View,
    walk_files: tuple[Path, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    read: list[Path] = []

    def reading(path: Path, found: Recognised) -> HeldPostures:
        read.append(path)
        return held_postures(path, found)

    monkeypatch.setattr("posekit.formats.held_postures.held_postures", reading)
    (result, view), motion = walk_files, tmp_path / "truth.npz"
    np.savez(motion, joints=walk.truth, joint_names=JOINTS, time=walk.time)
    said = refused(monkeypatch, capsys, result, "--view", view, "--truth", motion, "-o", tmp_path / "a.png")
    assert "the camera's place in the world is not known" in said
    assert read == [motion]


def test_render_refuses(
    walk_files: tuple[Path, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    result, view = walk_files
    picture = tmp_path / "a.png"
    empty = tmp_path / "empty.json"
    posekit.write_postures(empty, np.empty((0, 14, 3)))
    for words, expected in (
        ((result, "-o", tmp_path / "a.bmp"), "the format is .bmp"),
        ((result, "-o", picture, "--frame", "9"), "--frame: '9'; expected a number from 0 to 4"),
        ((result, "-o", picture, "--frame", "3-2"), "the first frame before the last"),
        ((result, "-o", picture, "--posture", "99999"), "expected a number from 0 to"),
        ((result, "-o", picture, "--posture", ","), "expected numbers from 0 with commas"),
        ((result, "-o", picture, "--size", "1e9x2"), "--size: '1e9x2'"),
        ((result, "-o", picture, "--eye", "1,2"), "--eye: '1,2'; expected 3 numbers"),
        ((result, "-o", picture, "--fov", "0"), "field of view is 0 degrees"),
        ((result, "-o", picture, "--elevation", "95"), "elevation 95 degrees"),
        ((result, "-o", picture, "--background", "blurple"), "background: 'blurple'"),
        ((view, "-o", picture, "--view", view), "--view: the file is a view itself"),
        ((empty, "-o", picture), "empty.json: there is no posture in any frame"),
        ((empty, "-o", picture, "--view", view), "--view: the file holds no result"),
        ((result, "-o", tmp_path / "no" / "a.png"), "a directory that does not exist"),
        ((result, "-o", tmp_path / "a.png", "--eye", "90,90,1", "--target", "99,99,1"), "picture is flat"),
    ):
        assert expected in refused(monkeypatch, capsys, *words)
    monkeypatch.setenv("POSEKIT_BROWSER", "no-such-browser")
    assert "'no-such-browser' is no program" in refused(monkeypatch, capsys, result, "-o", picture)
    assert [entry.name for entry in tmp_path.iterdir()] == ["empty.json"]


def test_render_draws_uncalibrated_results(
    flat: Result,
    scales: Result,
    flat_view: View,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    result, several, view = (tmp_path / name for name in ("result.json", "several.npz", "view.json"))
    posekit.write_result(result, flat)
    posekit.write_result(several, scales)
    posekit.write_view(view, flat_view)
    small = ("--size", "160x120", "--supersample", 1)
    out = tmp_path / "a.png"
    for words in (
        (result, "--view", view, "--layout", "superposed"),
        (result, "--rejected"),
        (several, "--posture", 2, "--through-view"),
    ):
        assert render(monkeypatch, *words, "-o", out, *small) == 0
    assert render(monkeypatch, several, "--view", view, "-o", tmp_path / "page.html") == 0
    assert render(monkeypatch, view, "-o", tmp_path / "recovered.html") == 0
    capsys.readouterr()
    error = refused(monkeypatch, capsys, several, "-o", tmp_path / "b.png", "--through-view", *small)
    assert "have 3 scales; expected one to look through the view's camera" in error
    assert "--posture 0,1\n" in error
