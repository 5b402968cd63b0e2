"""Files of objects: views whose points are a linkage's, and ``posekit.object/1``."""

import json
from dataclasses import replace

import numpy as np
import pytest

from posekit.errors import InputError
from posekit.formats.own import Family, ScaledOrthographicModel
from posekit.formats.own.object_result import (
    ObjectFrame,
    ObjectResult,
    check_object_path,
    read_object,
    write_object,
)
from posekit.formats.own.object_result_schema import ObjectFile
from posekit.formats.own.object_view import ObjectView, read_object_view, write_object_view
from posekit.linkages import Linkage
from posekit.viewer.scene.drawn_object import DrawnObject

ROD = Linkage.from_names(name="rod", segments={("a", "b"): 0.5, ("b", "c"): 0.3}, unit=1.0)
RELATIVE = Linkage.from_names(name="rod", segments={("a", "b"): 5.0, ("b", "c"): 3.0})


def document(**more):
    return {
        "schema": "posekit.view/1",
        "unit": "cm",
        "camera": {"model": "scaled-orthographic", "scale": 8.0},
        "frames": [
            {"time": 0.0, "image": {"a": [0, 0], "b": [30, 0], "c": [30, 20]}, "truth": {"a": [0, 0, 0]}},
            {"time": 0.5, "image": {"a": [1, 2], "b": [31, 2]}},
        ],
        **more,
    }


def saved(tmp_path, content):
    path = tmp_path / "view.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def result(**more):
    frame = ObjectFrame(
        time=0.25,
        judged="exact",
        levels=(("a", 1), ("b", 2), ("c", 2)),
        points=np.array(
            [[[0, 0, 0], [0.3, 0, 0.4], [0.3, 0.3, 0.4]], [[0, 0, 0], [0.3, 0, -0.4], [np.nan] * 3]]
        ),
        branches=("10", "00"),
        flips=np.array([[1, 0], [-1, 0]], dtype=np.int8),
        scales=np.array([800.0, 800.0]),
        margins={"closure": np.array([0.0, np.nan]), "nearer": np.array([0.1, 0.2])},
        q=np.array([[0.1, 0.2], [np.nan, np.nan]]),
        fk_distance=np.array([1e-9, np.nan]),
        certified=(True, False),
        reasons=("", "undecided: no configuration was asked for"),
        rejected={"closure/a-c": 2},
        family=Family(how="min", bound=790.0, segment="a-b", chosen=np.array([800.0]), mirrored=2),
    )
    settings = {"scale": "default"}
    return ObjectResult(
        **{
            "unit": "cm",
            "linkage": "rod",
            "points": ("a", "b", "c"),
            "segments": (("a", "b"), ("b", "c")),
            "lengths": np.array([0.5, 0.3]),
            "configuration_names": ("x", "y"),
            "settings": settings,
            "frames": [frame],
            **more,
        }
    )


class TestView:
    def test_is_read_in_metres(self, tmp_path):
        view = read_object_view(saved(tmp_path, document()), ROD)
        assert view.points == ("a", "b", "c") and len(view) == 2 and view.unit == "cm"
        assert view.camera.scale == 800.0
        np.testing.assert_array_equal(view.image[0], [[0, 0], [30, 0], [30, 20]])
        assert np.isnan(view.image[1, 2]).all() and np.isnan(view.truth[0, 1]).all()

    @pytest.mark.parametrize("unit", ["m", "cm", "mm"])
    def test_is_read_back_as_it_was_written(self, tmp_path, unit):
        view = replace(read_object_view(saved(tmp_path, document()), ROD), unit=unit)
        write_object_view(tmp_path / "again.json", view)
        again = read_object_view(tmp_path / "again.json", ROD)
        np.testing.assert_array_equal(again.image, view.image)
        np.testing.assert_allclose(again.truth, view.truth)
        assert again.unit == unit and again.camera.scale == pytest.approx(800.0)

    def test_of_relative_lengths_has_no_unit(self, tmp_path):
        relative = document(unit=None)
        view = read_object_view(saved(tmp_path, relative), RELATIVE)
        assert view.unit is None and view.camera.scale == 8.0
        write_object_view(tmp_path / "again.json", view)
        assert json.loads((tmp_path / "again.json").read_text())["unit"] is None
        with pytest.raises(
            InputError, match=r'unit: got "cm"; expected null: .*relative lengths; give camera.scale'
        ):
            read_object_view(saved(tmp_path, document()), RELATIVE)
        with pytest.raises(InputError, match="unit: got null; expected m, cm or mm"):
            read_object_view(saved(tmp_path, relative), ROD)

    def test_without_scale_and_truth_the_unit_does_not_matter(self, tmp_path):
        frames = [{"time": 0.0, "image": {"a": [0, 0], "b": [3, 4]}}]
        camera = {"model": "scaled-orthographic", "scale": None, "aspect": 1.5}
        path = saved(tmp_path, document(camera=camera, frames=frames))
        assert read_object_view(path, RELATIVE).unit is None
        assert read_object_view(path, ROD).camera.aspect == 1.5

    @pytest.mark.parametrize(
        ("change", "match"),
        [
            (
                {"frames": [{"time": 0, "image": {"aa": [1, 2]}}]},
                r'frames\[0\].image: got "aa"; expected a point',
            ),
            (
                {"frames": [{"time": 0, "image": {}, "truth": {"z": [1, 2, 3]}}]},
                r'frames\[0\].truth: got "z"',
            ),
            ({"frames": [{"time": 0, "image": {"a": [1, 2, 3]}}]}, r"frames\[0\].image.a"),
            ({"frames": [{"time": 0, "image": {"a": ["1", 2]}}]}, r"expected a number"),
            ({"frames": []}, "a view has at least one frame"),
            ({"frames": [{"time": 0, "image": {}, "head_image": {}}]}, "head_image"),
            ({"camera": {"model": "opencv", "K": []}}, "scaled-orthographic"),
            ({"camera": {"model": "scaled-orthographic", "scale": -1.0}}, "greater than 0"),
            ({"schema": "posekit.result/1"}, "posekit.view/1"),
        ],
    )
    def test_what_is_wrong_is_one_line(self, tmp_path, change, match):
        path = saved(tmp_path, document(**change))
        with pytest.raises(InputError, match=match) as caught:
            read_object_view(path, ROD)
        assert "\n" not in str(caught.value) and str(path) in str(caught.value)

    def test_points_that_are_not_finite(self, tmp_path):
        path = tmp_path / "view.json"
        path.write_text(json.dumps(document()).replace("[30, 20]", "[NaN, 20]"), encoding="utf-8")
        with pytest.raises(InputError, match=r"image\.c"):
            read_object_view(path, ROD)

        def view(frames, image):
            camera = ScaledOrthographicModel(scale=None)
            return ObjectView(points=("a",), camera=camera, time=np.zeros(frames), image=np.array(image))

        for image in ([[[np.inf, 0.0]]], [[[np.nan, 0.0]]]):
            with pytest.raises(InputError, match=r"frames\[0\].image.a: got .* expected finite numbers"):
                view(1, image)
        with pytest.raises(InputError, match="shape"):
            view(1, np.zeros((1, 2, 2)))
        with pytest.raises(InputError, match="at least one"):
            view(0, np.zeros((0, 1, 2)))


class TestResult:
    @pytest.mark.parametrize("unit", ["m", "cm", "mm", None])
    def test_is_read_back_as_it_was_written(self, tmp_path, unit):
        path = tmp_path / "object.json"
        wrote = result(unit=unit)
        write_object(path, wrote)
        read = read_object(path)
        assert (read.unit, read.linkage, read.points, read.segments) == (
            unit,
            "rod",
            wrote.points,
            wrote.segments,
        )
        np.testing.assert_allclose(read.lengths, wrote.lengths)
        a, b = wrote.frames[0], read.frames[0]
        for name in ("points", "flips", "scales", "q", "fk_distance"):
            np.testing.assert_allclose(getattr(b, name), getattr(a, name))
        for name in ("time", "judged", "levels", "branches", "certified", "reasons"):
            assert getattr(b, name) == getattr(a, name)
        assert dict(b.rejected) == dict(a.rejected) and b.family is not None
        np.testing.assert_allclose(b.margins["closure"], a.margins["closure"])
        assert b.family.mirrored == 2 and b.family.bound == pytest.approx(790.0)

    def test_says_flips_by_name_and_unknown_as_null(self, tmp_path):
        write_object(tmp_path / "object.json", result())
        file = json.loads((tmp_path / "object.json").read_text())
        first, second = file["frames"][0]["postures"]
        assert first["flips"] == {"a-b": "a", "b-c": None} and second["flips"]["a-b"] == "b"
        assert second["points"][2] == [None, None, None] and second["q"] is None
        assert first["points"][1] == [30.0, 0.0, 40.0] and first["scale"] == 8.0
        assert file["lengths"] == [50.0, 30.0]
        pytest.importorskip("jsonschema").validate(file, ObjectFile.model_json_schema())

    def test_a_frame_with_nothing(self, tmp_path):
        empty = ObjectFrame(
            time=0.0, judged=None, reason="b is not seen", levels=(), points=np.empty((0, 3, 3)), branches=(),
            flips=np.empty((0, 2), dtype=np.int8), scales=np.empty(0), margins={}, certified=(), reasons=(),
            rejected={},
        )  # fmt: skip
        write_object(tmp_path / "object.json", result(frames=[empty]))
        frame = read_object(tmp_path / "object.json").frames[0]
        assert frame.reason == "b is not seen" and len(frame) == 0 and frame.points.shape == (0, 3, 3)

    def test_arrays_of_two_lengths_are_refused(self):
        with pytest.raises(InputError, match="branches"):
            replace(result().frames[0], branches=("1",))
        with pytest.raises(InputError, match="q"):
            replace(result().frames[0], q=np.zeros((3, 2)))

    @pytest.mark.parametrize(
        ("change", "match"),
        [
            (lambda f: f["frames"][0]["postures"][0]["points"].pop(), r"postures\[0\].points: got 2 entries"),
            (lambda f: f["frames"][0]["postures"][0]["q"].pop(), r"postures\[0\].q: got 1 entries"),
            (lambda f: f["lengths"].pop(), "lengths: got 1 entries"),
            (lambda f: f["frames"][0]["levels"]["point"].pop(), "levels"),
            (lambda f: f["frames"][0]["postures"][0].pop("certified"), "certified"),
            (lambda f: f.pop("points"), "points"),
            (lambda f: f.update(more=1), "no field of this name"),
        ],
    )
    def test_what_is_wrong_is_one_line(self, tmp_path, change, match):
        path = tmp_path / "object.json"
        write_object(path, result())
        file = json.loads(path.read_text())
        change(file)
        path.write_text(json.dumps(file), encoding="utf-8")
        with pytest.raises(InputError, match=match) as caught:
            read_object(path)
        assert "\n" not in str(caught.value)

    def test_a_segment_between_middles_is_read_and_not_drawn(self, tmp_path):
        write_object(tmp_path / "object.json", result(segments=(("a", "b"), ("mid_a", "c"))))
        assert DrawnObject.of(read_object(tmp_path / "object.json")).segments.tolist() == [[0, 1]]

    def test_names_are_checked_before_the_work(self, tmp_path):
        check_object_path(tmp_path / "good.json")
        for name in ("bad.npz", "bad", "none/there.json"):
            with pytest.raises(InputError):
                check_object_path(tmp_path / name)
