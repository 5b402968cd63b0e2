"""Files of ``posekit.view/1``: one camera's view of one person as JSON; unknown points are omitted."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.cameras import CameraModel, LeeChenCamera, PinholeCamera, ScaledOrthographicCamera, View
from posekit.cameras.lee_chen import image_from_paper
from posekit.cameras.view import HEAD_NAMES, is_head_name, own_names
from posekit.errors import CameraError, InputError, nearest, shown
from posekit.formats import json_file
from posekit.formats.node import MISSING, Node, known_points, points_by_name, schema_of
from posekit.formats.options import Options
from posekit.geometry import PER_METRE, Array, from_metres, to_metres
from posekit.settings import MAX_LENGTH_DEVIATION
from posekit.skeleton import HEAD_POINTS, JOINTS, POINTS, SEGMENT_NAMES

VIEW_SCHEMA: Final = "posekit.view/1"
#: Fields of a camera by its model.
CAMERA_FIELDS: Final = {
    "lee-chen": ("model", "f"),
    "opencv": ("model", "K", "distortion", "fisheye", "R", "t", "size", "up", "name", "how", "deviation"),
    "scaled-orthographic": ("model", "scale", "aspect"),
}
FIELDS: Final = ("schema", "unit", "camera", "figure", "deviation", "length_deviation", "derived", "frames")
FRAME_FIELDS: Final = ("time", "image", "head_image", "confidence", "root", "truth", "picture")
FIGURE_FIELDS: Final = ("lengths", "shoulders", "stature", "head_points")


def looks_like(document: Any) -> bool:
    """Return whether a JSON document is a view: by its schema or, without a schema, by its fields."""
    if not isinstance(document, dict):
        return False
    schema = schema_of(document)
    frames = document.get("frames")
    first = frames[0] if isinstance(frames, list) and frames else None
    unnamed = "camera" in document and isinstance(first, dict) and "image" in first
    return schema.startswith("posekit.view/") or (not schema and unnamed)


def read(document: Any, path: str | Path, options: Options) -> View:
    """Read a view.

    Returns
    -------
    View
        View with lengths in metres, and image points in OpenCV's convention.

    Raises
    ------
    InputError
        If a field is missing, unknown or invalid.
    """
    root, unit, camera, frames = _parts(document, path, MISSING)
    figure = root.at("figure", {})
    figure.object(FIGURE_FIELDS)
    for frame in frames:
        frame.object(FRAME_FIELDS)
    images = [frame.at("image") for frame in frames]
    _refuse_objects(images[0])
    head_points = _head_points(figure.at("head_points", None), unit)
    own = own_names(head_points or ())
    image = points_by_name(images, JOINTS, 2, "joint")
    head_names = (*HEAD_POINTS, *own)
    head_image = points_by_name([frame.at("head_image", {}) for frame in frames], head_names, 2, "head point")
    if np.isnan(image[..., 0]).all():
        raise frames[0].at("image").refused("a joint in at least one frame", "add one")
    if isinstance(camera, LeeChenCamera):
        image, head_image = (image_from_paper(to_metres(points, unit)) for points in (image, head_image))
    confidence = points_by_name([frame.at("confidence", {}) for frame in frames], POINTS, 0, "joint")
    truth = points_by_name([frame.at("truth", {}) for frame in frames], JOINTS, 3, "joint")
    unknown = np.full(3, np.nan)
    neck = [frame.at("root").array(3) if frame.has("root") else unknown for frame in frames]
    pictures = tuple(frame.at("picture").text() for frame in frames if frame.has("picture"))
    lengths = figure.at("lengths", {})
    remedy = "name a segment a-b, as right_elbow-right_wrist"
    length_names = lengths.object(SEGMENT_NAMES, remedy) if lengths.value else {}
    return View(
        camera=camera,
        time=np.array([frame.at("time").number() for frame in frames]),
        image=image,
        head_image=head_image[:, : len(HEAD_POINTS)],
        own_head_image=head_image[:, len(HEAD_POINTS) :],
        confidence=confidence,
        root=to_metres(neck, unit),
        truth=to_metres(truth, unit),
        lengths={name: lengths.at(name).positive() / PER_METRE[unit] for name in length_names},
        shoulders=figure.at("shoulders").text(("front", "behind")) if figure.has("shoulders") else None,  # type: ignore[arg-type]
        stature=figure.at("stature").positive() / PER_METRE[unit] if figure.has("stature") else None,
        deviation=root.at("deviation").positive() if root.has("deviation") else None,
        length_deviation=root.at("length_deviation").number(0, MAX_LENGTH_DEVIATION)
        if root.has("length_deviation")
        else None,
        derived=tuple(one.text(JOINTS) for one in root.at("derived", []).list()),
        head_points=head_points,
        unit=unit,
        source=str(path),
        pictures=pictures if len(pictures) == len(frames) else (),
    )


def _parts(document: Any, path: str | Path, unit: Any) -> tuple[Node, str, CameraModel, list[Node]]:
    """Return a document's root node, its unit of length (by default `unit`), its camera and its frames."""
    root = Node(document, path)
    check_schema(root, VIEW_SCHEMA)
    root.object(FIELDS)
    stated = root.at("unit", unit).text(PER_METRE)
    return root, stated, camera_from(root.at("camera"), stated), list(root.at("frames").list(1))


def check_schema(root: Node, *schemas: str) -> str:
    """Return the schema that a document states; refuse a document with another schema or version."""
    if not isinstance(root.value, dict):
        raise root.refused(f"an object of schema {schemas[0]}", "check that it is such a file")
    stated = schema_of(root.value)
    if stated in schemas:
        return stated
    kind = schemas[0].rpartition("/")[0]
    remedy = f'write "schema": "{schemas[0]}" if it is such a file'
    if stated.startswith(f"{kind}/"):
        remedy = "the file is of another version: write it again"
    expected = " or ".join(map(shown, schemas))
    raise root.wrong("schema", stated or None, expected, remedy, "" if stated else "nothing")


def camera_from(node: Node, unit: str) -> CameraModel:
    """Make a camera from its JSON fields in a view, a result or the header of a stream of key points.

    Raises
    ------
    InputError
        If the fields do not describe a camera.
    """
    model = node.at("model").text(CAMERA_FIELDS)
    node.object(CAMERA_FIELDS[model])
    if model == "opencv":
        pixels = node.at("size").array(2).tolist() if node.has("size") else None
        given: dict[str, Any] = {
            "K": node.at("K").array(3, 3),
            "distortion": node.at("distortion").array(None) if node.has("distortion") else None,
            "fisheye": node.at("fisheye", False).value is True,
            "R": node.at("R").array(3, 3) if node.has("R") else None,
            "t": to_metres(node.at("t").array(3), unit) if node.has("t") else None,
            "size": pixels,
            **{name: node.at(name).text() for name in ("up", "name", "how") if node.has(name)},
            "deviation": node.at("deviation", 0.0).number(0, 1),
        }
        make: type[CameraModel] = PinholeCamera
    else:
        name, power = ("f", -1) if model == "lee-chen" else ("scale", 1)
        make, value = (LeeChenCamera if model == "lee-chen" else ScaledOrthographicCamera), None
        if name not in node.object():
            raise node.at(name).refused("this field, null if it is not known", "add it")
        if node.has(name):
            many = isinstance(node.at(name).value, list)
            scaled = node.at(name).array(None) if many else node.at(name).positive()
            value = scaled * PER_METRE[unit] if power > 0 else scaled / PER_METRE[unit]
        given = {name: value}
        if node.has("aspect"):
            given["aspect"] = node.at("aspect").positive()
    try:
        return make(**given)
    except CameraError as error:
        reason = str(error).partition(": ")[2]  # without the camera's name
        raise InputError(f"{node.source}: {node.place}.{reason}") from None


def _head_points(node: Node, unit: str) -> dict[str, Array] | None:
    if node.value is None:
        return None
    found = {}
    for name in node.object():
        if not is_head_name(name):
            raise node.wrong(name, name, "the name of a head point", nearest(name, HEAD_NAMES))
        found[name] = to_metres(node.at(name).array(3), unit)
    return found


def _refuse_objects(image: Node) -> None:
    """Refuse image points without any joint of a person: they belong to another object."""
    names = image.object()
    if len(names) > 1 and not any(name in POINTS for name in names):
        raise image.refused("the joints of a person", "recover another articulated object with --linkage")


def write(path: str | Path, view: View, unit: str | None = None) -> None:
    """Write a view as JSON. If writing fails, no incomplete file remains.

    Parameters
    ----------
    path : path
        Path that ends in ``.json`` or ``.json.gz``.
    view : View
        The view.
    unit : "m", "cm" or "mm", optional
        Unit of length in the file; by default that of the view.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    unit = unit or view.unit
    head_image, image = np.concatenate([view.head_image, view.own_head_image], axis=1), view.image
    if isinstance(view.camera, LeeChenCamera):
        image, head_image = (from_metres(image_from_paper(points), unit) for points in (image, head_image))
    truth, neck = from_metres(view.truth, unit), from_metres(view.root, unit)
    frames = []
    for k in range(len(view)):
        frame: dict[str, Any] = {"time": float(view.time[k]), "image": known_points(image[k], JOINTS)}
        parts = {
            "head_image": known_points(head_image[k], (*HEAD_POINTS, *view.own_head_names)),
            "confidence": known_points(view.confidence[k], POINTS),
            "root": neck[k].tolist() if np.isfinite(neck[k]).all() else None,
            "truth": known_points(truth[k], JOINTS),
            "picture": view.pictures[k] if view.pictures else "",
        }
        frames.append({**frame, **{name: value for name, value in parts.items() if value}})
    figure = {
        "lengths": {name: value * PER_METRE[unit] for name, value in view.lengths.items()},
        "shoulders": view.shoulders,
        "stature": None if view.stature is None else view.stature * PER_METRE[unit],
        "head_points": {name: from_metres(p, unit).tolist() for name, p in (view.head_points or {}).items()},
    }
    head = {
        "schema": VIEW_SCHEMA,
        "unit": unit,
        "camera": view.camera.fields(unit),
        "figure": {name: value for name, value in figure.items() if value},
        "deviation": view.deviation,
        "length_deviation": view.length_deviation,
        "derived": list(view.derived),
    }
    kept = {name: value for name, value in head.items() if value not in (None, {}, [])}
    json_file.write(path, kept, "frames", frames)


def read_object(document: Any, path: str | Path, points: Sequence[str]) -> dict[str, Any]:
    """Read the view of an articulated object that is not a person.

    Parameters
    ----------
    document : dict
        JSON of ``posekit.view/1`` with a scaled orthographic camera and images of the object's points.
    path : path
        Path of the file.
    points : sequence of P str
        Names of the object's points.

    Returns
    -------
    dict
        ``image`` (F, P, 2) in pixels; ``truth`` (F, P, 3), the true positions; ``time`` (F,) in seconds; ``aspect``,
        the ratio of a pixel's width to its height; ``scale`` in pixels per metre, None if unknown. Lengths are in
        metres, or in the object's own unit if the file's ``unit`` is null.

    Raises
    ------
    InputError
        If a field is missing or invalid, or a point does not belong to the object.
    """
    root, unit, camera, frames = _parts(document, path, "m")
    if not isinstance(camera, ScaledOrthographicCamera):
        remedy = "another object than a person is recovered from uncalibrated views"
        raise root.at("camera").at("model").refused('"scaled-orthographic"', remedy)
    truth = points_by_name([frame.at("truth", {}) for frame in frames], points, 3, "point of the object")
    return {
        "image": points_by_name([frame.at("image") for frame in frames], points, 2, "point of the object"),
        "truth": to_metres(truth, unit),
        "time": np.array([frame.at("time").number() for frame in frames]),
        "scale": camera.scale,
        "aspect": camera.aspect,
    }
