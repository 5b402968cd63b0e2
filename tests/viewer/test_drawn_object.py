"""Recovered objects in pictures and pages: as they are, as large as they are, and no others than the file's."""

from __future__ import annotations

import json
import re
import shlex
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import posekit
from posekit.errors import InputError, ViewerError
from posekit.formats.own import read_object, write_object
from posekit.samples import write_samples
from posekit.viewer.object_page import object_page
from posekit.viewer.scene.compose import Style
from posekit.viewer.scene.drawn_object import DrawnObject, compose_object
from posekit.viewer.scene.world import upright_world
from tests.viewer.driving import wait_until

NODE_AT = """let node = viewer.scene_tree; for (const name of path.split("/")) node = node.children[name];"""
VISIBLE_NODE = f"(path) => {{ {NODE_AT} return node.object.visible; }}"
MATRIX_OF_NODE = f"(path) => {{ {NODE_AT} node.object.updateMatrix(); return node.object.matrix.elements; }}"


@pytest.fixture(scope="module")
def arm(tmp_path_factory, command):
    """Return what is recovered of the samples' arm: two postures of a frame, twice."""
    folder = tmp_path_factory.mktemp("arm")
    write_samples(folder)
    path = folder / "arm.json"
    done = command("recover", folder / "gripper.json", "-o", path, "--linkage", "panda", "--scale", "closure")
    assert done.code == 0, done.err
    result = read_object(path)
    return path, replace(result, frames=[result.frames[0], replace(result.frames[0], time=0.5)])


def test_segments_are_drawn_as_long_as_they_are(arm):
    _, result = arm
    subject = DrawnObject.of(result)
    assert subject.to_scale
    ends = subject.frames[0].points[:, subject.segments]
    lengths = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=-1)
    np.testing.assert_allclose(lengths, np.broadcast_to(result.lengths, lengths.shape), atol=1e-6)


def test_what_has_its_own_unit_is_drawn_a_metre_large_without_a_grid(arm):
    _, result = arm
    frames = [replace(one, points=1000.0 * one.points) for one in result.frames]
    subject = DrawnObject.of(replace(result, frames=frames, unit=None))
    assert np.nanmax(np.ptp(subject.frames[0].points, axis=(0, 1))) == pytest.approx(1.0)
    world = upright_world(subject.frames[0].points)
    drawn = compose_object(subject.frames[0], subject, world=world, style=Style())
    assert "/meshcat/ground" not in drawn.scene.nodes
    assert {f"/meshcat/posture-{k}/segments" for k in range(2)} <= drawn.scene.nodes.keys()


def test_what_its_robot_reaches_comes_first(arm):
    _, result = arm
    frame = replace(result.frames[0], certified=(False, True))
    subject = DrawnObject.of(replace(result, frames=[frame]))
    assert subject.rows[0].tolist() == [1, 0]
    first = subject.chosen("", 0, 1).points
    np.testing.assert_array_equal(first, subject.chosen("1", 0, 6).points)
    np.testing.assert_allclose(np.diff(first, axis=1), np.diff(frame.points[1:], axis=1), atol=1e-12)
    with pytest.raises(InputError, match="expected all, or numbers from 0 to 1"):
        subject.chosen("2", 0, 6)


def test_nothing_is_no_picture(arm):
    _, result = arm
    empty = replace(
        result.frames[0],
        **{name: getattr(result.frames[0], name)[:0] for name in ("points", "branches", "flips", "scales")},
        **{
            name: getattr(result.frames[0], name)[:0] for name in ("certified", "reasons", "q", "fk_distance")
        },
        margins={},
    )
    with pytest.raises(ViewerError, match="no posture in any frame"):
        object_page(replace(result, frames=[empty]))
    assert "no posture is left" in object_page(replace(result, frames=[*result.frames, empty]))
    with pytest.raises(ViewerError, match="expected numbers from 0 to 1"):
        object_page(result, frames=range(3))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("render", "-o", "a.png", "--angles", "all"), "--angles: are a person's"),
        (("render", "-o", "a.png", "--rejected"), "--rejected, --truth: are of persons"),
        (("render", "-o", "a.png", "--posture", "groups"), "objects have no probabilities"),
        (("view", "--viser"), "--viser: shows persons"),
    ],
)
def test_what_is_a_person_s_is_refused_in_one_line(words, said, arm, command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = command(words[0], arm[0], *words[1:])
    assert (done.code, done.err.count("\n")) == (2, 1)
    assert said in done.err
    assert list(tmp_path.iterdir()) == []


def test_configurations_are_judged_by_the_robot_that_they_are_of(arm, command):
    path, result = arm
    done = command("validate", path)
    assert done.code == 0, done.err
    assert "2 postures: 2 valid" in done.out
    assert "joint-range" in done.out
    beyond = result.frames[0].q.copy()
    beyond[1, result.configuration_names.index("panda_joint4")] = 1.0  # its range ends at -0.07
    frame = replace(result.frames[0], q=beyond)
    write_object(path.with_name("beyond.json"), replace(result, frames=[frame]))
    done = command("validate", path.with_name("beyond.json"))
    assert done.code == 1
    assert "joint-range/panda_joint4 1" in done.out
    one, none = (replace(result.frames[0], certified=(k, False)) for k in (True, False))
    for name, given in (("one.json", one), ("none.json", none)):
        write_object(path.with_name(name), replace(result, frames=[given]))
    done = command("validate", path.with_name("one.json"))
    assert "1 posture without a configuration within limits left out" in done.out
    done = command("validate", path.with_name("none.json"))
    assert (done.code, done.err.count("\n")) == (2, 1)
    assert "none of which a configuration within limits is known" in done.err


def test_a_page_of_many_postures_stays_small_and_says_how_many_it_holds(arm, monkeypatch):
    _, result = arm
    one = result.frames[0]
    pick = np.resize([0, 1], 9000)
    many = replace(
        one,
        **{name: getattr(one, name)[pick] for name in ("points", "flips", "scales", "q", "fk_distance")},
        **{name: tuple(getattr(one, name)[k] for k in pick) for name in ("branches", "certified", "reasons")},
        margins={},
    )
    page = object_page(replace(result, frames=[many] * 10))
    assert len(page.encode()) < 10e6
    data = json.loads(re.findall(r"const OBJECT = (.*);\n", page)[0])
    assert {frame["count"] for frame in data["frames"]} == {9000}
    assert {len(frame["postures"]) for frame in data["frames"]} == {2162}


def test_a_picture_has_every_segment(arm, tmp_path):
    _, result = arm
    assert posekit.render(result, tmp_path / "arm.png") == 1
    pixels = np.asarray(Image.open(tmp_path / "arm.png").convert("RGB")).reshape(-1, 3).astype(int)
    for colour in ((0, 158, 115), (240, 228, 66), (0, 114, 178)):
        assert (np.abs(pixels - colour).max(axis=1) < 3).sum() > 100
    assert posekit.render(result, tmp_path / "arm.gif") == 2


def test_the_page_shows_one_posture_or_all(arm, chromium, tmp_path):
    _, result = arm
    path = tmp_path / "arm.html"
    posekit.render(result, path)
    wrong = list[str]()
    tab = chromium.new_page(viewport={"width": 420, "height": 800})
    tab.on("pageerror", lambda error: wrong.append(str(error)))
    tab.on(
        "request", lambda one: wrong.append(one.url) if one.url[:4] not in ("file", "blob", "data") else None
    )
    tab.goto(path.as_uri())
    wait_until(tab, "typeof objectPage === 'object'")
    assert "4 postures of panda in 2 frames" in tab.inner_text("#object")
    assert "posture 0: its robot reaches it; 500 pixels a metre" in tab.inner_text("#posture-said")
    # A cylinder stands where its segment is, and is as long.
    subject = DrawnObject.of(result)
    world = upright_world(np.concatenate([one.points.reshape(-1, 3) for one in subject.frames]))
    for number in (0, 1):
        ends = world.place(subject.frames[0].points[number])[subject.segments]
        for k, (start, end) in enumerate(ends):
            node = f"meshcat/slot-0/segment-{k}"
            matrix = np.reshape(tab.evaluate(MATRIX_OF_NODE, node), (4, 4)).T
            np.testing.assert_allclose(matrix[:3, 3], (start + end) / 2, atol=2e-4)
            np.testing.assert_allclose(matrix[:3, 1], end - start, atol=2e-4)
            assert np.linalg.det(matrix[:3, :3]) > 0
        tab.focus("#posture")
        tab.keyboard.press("ArrowRight")
    assert "posture 1: " in tab.inner_text("#posture-said")
    shown = [f"meshcat/slot-{k}" for k in (0, 1)]
    assert [tab.evaluate(VISIBLE_NODE, one) for one in shown] == [True, False]
    tab.focus("#all")
    tab.keyboard.press("Enter")
    assert [tab.evaluate(VISIBLE_NODE, one) for one in shown] == [True, True]
    tab.focus("#frame")
    tab.keyboard.press("ArrowRight")
    assert "1 (0.500 s)" in tab.inner_text("#frame-row")
    assert tab.evaluate("document.documentElement.scrollWidth") <= 420
    tab.close()
    assert wrong == []


def test_the_commands_that_recover_names_next_run(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_samples(tmp_path)
    words = ("--linkage", "panda", "--scale", "closure")
    done = command("recover", "gripper.json", "-o", "arm.out.json", *words)
    told = [shlex.split(line)[1:] for line in done.out.partition("look further:\n")[2].splitlines()]
    assert [one[0] for one in told] == ["view", "render", "convert"]
    for one in told[1:]:
        ended = command(*one)
        assert ended.code == 0, ended.err
    assert {"arm.out.png", "arm.out.trc"} <= {path.name for path in tmp_path.iterdir()}
