"""Joint angles over time: they are those of the postures, between their limits, beside the truth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import posekit
from posekit.errors import ViewerError
from posekit.formats.own import Result, View
from posekit.skeleton import DOFS
from posekit.viewer.plots.angle_plot import plot_angles, plot_tracks
from posekit.viewer.plots.angle_tracks import AngleTrack, angle_names, angle_tracks, chosen_angles
from posekit.viewer.scene.drawn_subject import DrawnSubject
from posekit.viewer.scene.likeliest import likeliest_first
from tests.viewer.driving import render


@pytest.fixture(scope="module")
def tracks(subject: DrawnSubject, walk: View) -> list[AngleTrack]:
    drawn = [likeliest_first(frame, 1) for frame in subject.frames]
    names = angle_names()
    limits = {"right_knee.flexion": (0.0, 150.0)}
    return angle_tracks(subject.frames, drawn, subject.figure, names, limits=limits, truth=walk.truth)


def test_angles_are_those_of_the_configurations(
    tracks: list[AngleTrack], subject: DrawnSubject, walked: Result
) -> None:
    names = [name.replace(".", "_") for name in DOFS]
    columns = [list(walked.configuration_names).index(name) for name in names]
    by_name = {track.name: track for track in tracks}
    for k, frame in enumerate(walked.frames):
        assert frame.answer is not None
        angles = np.degrees(frame.q[:, columns])
        for column, name in enumerate(DOFS):
            track = by_name[name]
            assert track.value[k] == pytest.approx(angles[frame.answer.representatives[0], column], abs=1e-6)
            assert (track.least[k], track.most[k]) == pytest.approx(
                (angles[:, column].min(), angles[:, column].max()), abs=1e-6
            )
            assert track.least[k] <= track.lower[k] <= track.upper[k] <= track.most[k]


def test_truth_is_one_of_an_exact_views_survivors(tracks: list[AngleTrack]) -> None:
    for track in tracks:
        if track.name.startswith("neck"):
            assert np.isnan(track.truth).all()  # a view's truth has no head
            continue
        assert (track.least - 0.01 <= track.truth).all()
        assert (track.truth <= track.most + 0.01).all()


def test_survivors_without_q_have_the_same_angles(subject: DrawnSubject) -> None:
    bare = [replace(frame, q=None) for frame in subject.frames]
    names = ("right_knee.flexion", "left_elbow.flexion")
    both = [
        angle_tracks(frames, [one.chosen([0]) for one in frames], subject.figure, names, limits={})
        for frames in (subject.frames, bare)
    ]
    for ours, calculated in zip(*both, strict=True):
        np.testing.assert_allclose(ours.value, calculated.value, atol=1e-3)
        np.testing.assert_allclose(ours.least, calculated.least, atol=1e-3)


def test_half_of_the_probability_is_between_the_quartiles(subject: DrawnSubject) -> None:
    shown = subject.frames[0]
    sure = np.zeros(len(shown))
    sure[3] = 1.0
    certain = replace(shown, probability=sure)
    [track] = angle_tracks([certain], [shown.chosen([3])], subject.figure, ("left_hip.flexion",), limits={})
    assert track.lower == pytest.approx(track.value)
    assert track.upper == pytest.approx(track.value)


def test_panels_show_limits_bands_line_and_truth(tracks: list[AngleTrack]) -> None:
    figure = plot_tracks(tracks)
    panels = {panel.get_title(): panel for panel in figure.axes}
    assert len(panels) == len(tracks) == 22
    knee = panels["right knee, flexion"]
    said = [one.get_gid() for one in (*knee.lines, *knee.patches, *knee.collections)]
    assert said.count("limit") == said.count("outside") == 2
    assert {"line", "truth", "survivors", "half"} <= set(said)
    line = next(one for one in knee.lines if one.get_gid() == "line")
    track = next(track for track in tracks if track.name == "right_knee.flexion")
    np.testing.assert_array_equal(np.asarray(line.get_ydata()), track.value)


@pytest.mark.parametrize("count", [1, 2, 3, 8])
def test_the_key_stays_inside_the_picture(tracks: list[AngleTrack], count: int) -> None:
    figure = plot_tracks(tracks[:count])
    figure.canvas.draw()
    (key,) = figure.legends
    box = key.get_window_extent()
    assert 0 <= box.x0 and box.x1 <= figure.bbox.width


def test_a_result_is_plotted_with_what_it_was_judged_by_and_the_views_truth(
    walked: Result, walk: View
) -> None:
    [left, right] = plot_angles(walked, walk, angles="elbow", frames=[1, 2, 3]).axes
    assert [left.get_title(), right.get_title()] == ["right elbow, flexion", "left elbow, flexion"]
    limits = sorted(float(np.ravel(one.get_ydata())[0]) for one in left.lines if one.get_gid() == "limit")
    assert limits == sorted(walked.settings["range_limits"]["right_elbow.flexion"])
    assert any(one.get_gid() == "truth" for one in left.lines)


def test_angles_are_chosen_by_joint_side_or_name() -> None:
    assert len(chosen_angles("all")) == len(DOFS) == len(set(chosen_angles("all")))
    assert chosen_angles("knee") == ("right_knee.flexion", "left_knee.flexion")
    assert chosen_angles("left_elbow, neck.flexion") == ("neck.flexion", "left_elbow.flexion")
    assert chosen_angles("hip.abduction") == ("right_hip.abduction", "left_hip.abduction")
    with pytest.raises(
        ViewerError, match='--angles: "ankle"; expected all, or some of neck, pelvis, shoulder'
    ):
        chosen_angles("ankle")


def test_command_draws_angles_of_results_and_motion(
    walk_files: tuple[Path, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    result, view = walk_files
    assert render(monkeypatch, result, "--view", view, "--angles", "knee", "-o", tmp_path / "a.svg") == 0
    assert "limits: as the result was judged" in capsys.readouterr().out
    assert "right knee, flexion" in (tmp_path / "a.svg").read_text()
    joints = posekit.read_view(view).truth
    posekit.write_postures(tmp_path / "p.json", joints)
    words = ("--angles", "all", "-o", tmp_path / "b.png")
    assert render(monkeypatch, result, *words, "--truth", view, "--frame", "1-3") == 0
    assert render(monkeypatch, tmp_path / "p.json", *words) == 0
    for more, said in (
        (("-o", tmp_path / "c.mp4", "--angles", "knee"), "the format is .mp4; --angles expected one of .png"),
        ((*words, "--fov", 20), "--fov: means nothing beside --angles"),
        ((*words, "--truth", tmp_path / "p.json"), "expected 5"),
    ):
        capsys.readouterr()
        assert render(monkeypatch, result, *more) == 2
        error = capsys.readouterr().err
        assert said in error
        assert error.count("\n") == 1
