"""What posekit returns prints as one short line, and shows itself in a notebook as a small picture."""

from collections.abc import Mapping
from xml.etree import ElementTree

import numpy as np
import pytest

import posekit
from posekit.display.short_repr import MAX_REPR, ShortRepr, short
from posekit.display.stick_drawing import body_axes, image_drawing, points_drawing, posture_drawing
from posekit.formats.motion.motion import Motion
from posekit.samples import write_samples
from posekit.skeleton import JOINT, JOINTS

MOST = 300
UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def returned(tmp_path_factory) -> Mapping[str, object]:
    """One of each kind of object that functions of posekit return."""
    folder = tmp_path_factory.mktemp("files")
    view = posekit.builtin_view("seq1")
    recovery = posekit.recover(view)
    standing = np.repeat(posekit.load_figure().neutral_points[None, :14], 20, axis=0)
    motion = Motion(names=JOINTS, points=standing, time=np.arange(20) / 30, rate=30.0, up="+z")
    tracker = posekit.Tracker(size=(640, 480), stature=1.75, deviation=2.0)
    posekit.write_result(folder / "found.npz", posekit.result_of(recovery))
    posekit.write_view(folder / "view.json", view)
    return {
        "view": view,
        "recovery": recovery,
        "frame": recovery.frames[0],
        "fit": recovery.fit,
        "batch": recovery.frames[0].batch,
        "posture set": recovery.frames[0].posture_set,
        "answer": recovery.answers[0],
        "regions": recovery.answers[0].regions,
        "bodies": recovery.answers[0].bodies,
        "ranking": recovery.ranking,
        "grower": recovery.grower,
        "figure": recovery.figure,
        "up": recovery.up,
        "following": posekit.follow(recovery),
        "result": posekit.open(folder / "found.npz"),
        "opened view": posekit.open(folder / "view.json"),
        "postures": posekit.open(folder / "found.npz", "postures"),
        "motion": motion,
        "validator": posekit.Validator(),
        "judged": posekit.Validator().check(standing),
        "report": posekit.validate(standing, rate=30, up="+z"),
        "posture report": posekit.validate(standing).postures[0],
        "repaired": posekit.repair(standing),
        "tracker": tracker,
        "tracked": tracker.update(np.full((14, 2), np.nan), time=0.0),
        "settings": posekit.RecoverSettings(),
        "settings of validate": posekit.ValidateSettings(),
        "source": posekit.Source(),
    }


def test_whatever_is_returned_prints_as_one_short_line(returned):
    long = {
        name: len(repr(one)) for name, one in returned.items() if len(repr(one)) > MOST or "\n" in repr(one)
    }
    assert long == {}


def test_a_line_begins_with_the_name_of_the_class(returned):
    assert [
        name for name, one in returned.items() if not repr(one).startswith(type(one).__name__ + "(")
    ] == []


def test_what_counts_is_said(returned):
    assert repr(returned["recovery"]) == "Recovery(5 frames, 128 postures, ranges='anatomical')"
    assert repr(returned["frame"]) == "FrameRecovery(frame 0, 0 s, 32 postures, judged exact)"
    assert repr(returned["result"]) == "Result(5 frames, 128 postures, unit='m')"
    assert "20 valid, 0 invalid" in repr(returned["report"])


@pytest.mark.parametrize(
    "name", ["recovery", "frame", "answer", "view", "motion", "report", "result", "postures"]
)
def test_a_notebook_shows_a_drawing_and_the_line(returned, name):
    shown = returned[name]._repr_html_()
    assert "<script" not in shown and "href" not in shown and "src=" not in shown
    root = ElementTree.fromstring(shown.replace("<br>", "<br/>"))
    drawing = next(root.iter("{http://www.w3.org/2000/svg}svg"))
    assert len(list(drawing.iter())) > 2
    assert root.findtext("code") == repr(returned[name])


def test_the_drawing_is_from_the_front_and_from_the_right_side():
    standing = posekit.load_figure().neutral_points[:14]
    right, forward, up = body_axes(standing, UP)
    assert np.allclose([right, forward, up], [[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    turned = standing @ np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    assert posture_drawing(turned[None], UP) == posture_drawing(standing[None], UP)


def test_a_joint_that_is_not_known_costs_its_segments_alone():
    standing = posekit.load_figure().neutral_points[:14].copy()
    whole = posture_drawing(standing[None], UP).count("<line")
    standing[JOINT["left_wrist"]] = np.nan
    assert posture_drawing(standing[None], UP).count("<line") == whole - 2
    assert posture_drawing(np.full((1, 14, 3), np.nan), UP) == ""


def test_points_that_are_known_in_part_are_not_drawn():
    for shape, draw in (
        ((1, 14, 3), lambda points: posture_drawing(points, UP)),
        ((14, 3), lambda points: points_drawing(points, UP)),
        ((14, 2), image_drawing),
    ):
        points = np.full(shape, np.nan)
        points[..., 3, 0] = 1.0
        assert draw(points) == ""


def test_nothing_that_is_held_makes_a_line_long():
    class Holder(ShortRepr):
        def _facts(self) -> list[str]:
            return [
                short("x" * 10_000),
                short([1.0] * 10_000),
                short({k: k for k in range(1000)}),
                "y" * 1000,
            ]

    assert len(repr(Holder())) <= MAX_REPR + len("Holder()")


def test_a_frame_shows_the_likeliest_first(returned):
    recovery = returned["recovery"]
    for frame, p in zip(recovery.frames, recovery.probability, strict=True):
        np.testing.assert_array_equal(frame.likeliest_first[0], frame.joints[p.argmax()])
        assert len(frame.likeliest_first) == len(frame)


def test_whatever_a_file_holds_prints_as_one_short_line(tmp_path):
    """Every sample, and what is converted from it."""
    write_samples(tmp_path)
    recovery = posekit.recover(posekit.builtin_view("seq1"))
    posekit.convert(recovery, tmp_path / "survivors.csv", posture="all")
    for suffix in ("bvh", "glb"):
        posekit.convert(tmp_path / "walk.npz", tmp_path / f"walk.{suffix}")
    files = [path for path in sorted(tmp_path.iterdir()) if path.name != "gripper.json"]
    assert len(files) > 8
    for path in files:
        held = posekit.open(path)
        for one in held.values() if isinstance(held, dict) else [held]:
            assert len(repr(one)) <= MOST and "\n" not in repr(one), path.name
