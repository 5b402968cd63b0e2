"""Read and write ``posekit.view/1``: units and the 1985 camera's image plane are converted here."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.cameras.lee_chen import image_from_paper
from posekit.errors import CameraError
from posekit.formats.own.camera_model import (
    CameraModel,
    LeeChenModel,
    OpenCVModel,
    ScaledOrthographicModel,
    camera_fields,
)
from posekit.formats.own.units import PER_METRE, Unit, from_metres, to_metres
from posekit.formats.own.view import View, own_names
from posekit.formats.own.view_schema import (
    VIEW_SCHEMA,
    LeeChenCamera,
    OpenCVCamera,
    ScaledOrthographicFields,
    ViewFile,
)
from posekit.safe_io.json_file import read_json
from posekit.safe_io.refusal import refusal, shown
from posekit.safe_io.writing import json_pieces, write_text
from posekit.skeleton import HEAD_POINTS, JOINTS, POINTS
from posekit.tables.file_model import conforming, validated

Array = NDArray[np.float64]


def _refuse_objects(document: Any, path: str | Path) -> None:
    """Refuse the view of an object that is no person: none of its points is a joint."""
    frames = document.get("frames") if isinstance(document, dict) else None
    first = frames[0] if isinstance(frames, list) and frames else None
    image = first.get("image") if isinstance(first, dict) else None
    if isinstance(image, dict) and len(image) > 1 and not any(name in POINTS for name in image):
        remedy = "where it is another articulated object, recover it with --linkage"
        raise refusal(path, "frames[0].image", shown(image), "the joints of a person", remedy)


def read_view(path: str | Path) -> View:
    """Read a view.

    Parameters
    ----------
    path : path
        JSON of schema ``posekit.view/1``.

    Returns
    -------
    View
        In metres; image points in OpenCV's convention.

    Raises
    ------
    InputError
        Where the file breaks the schema: the first error, with how many more.
    """
    document = read_json(path)
    _refuse_objects(document, path)
    file = validated(ViewFile, document, path)
    frames, unit, figure = file.frames, file.unit, file.figure
    image = _gather([frame.image for frame in frames], JOINTS, 2)
    own = own_names((figure.head_points if figure else None) or ())
    head_image = _gather([frame.head_image for frame in frames], (*HEAD_POINTS, *own), 2)
    if isinstance(file.camera, LeeChenCamera):
        image = image_from_paper(to_metres(image, unit))
        head_image = image_from_paper(to_metres(head_image, unit))
    roots = [frame.root or [np.nan] * 3 for frame in frames]
    return View(
        camera=_camera(file, path),
        time=np.array([frame.time for frame in frames], dtype=np.float64),
        image=image,
        head_image=head_image[:, : len(HEAD_POINTS)],
        own_head_image=head_image[:, len(HEAD_POINTS) :],
        confidence=_gather_numbers([frame.confidence for frame in frames], POINTS),
        root=to_metres(roots, unit),
        truth=to_metres(_gather([frame.truth for frame in frames], JOINTS, 3), unit),
        lengths={
            name: float(to_metres(value, unit))
            for name, value in ((figure.lengths or {}) if figure else {}).items()
        },
        deviation=file.deviation,
        length_deviation=file.length_deviation,
        derived=tuple(file.derived or ()),
        shoulders=figure.shoulders if figure else None,
        stature=float(to_metres(figure.stature, unit)) if figure and figure.stature else None,
        head_points={name: to_metres(point, unit) for name, point in figure.head_points.items()}
        if figure and figure.head_points is not None
        else None,
        unit=unit,
    )


def write_view(path: str | Path, view: View, unit: Unit | None = None) -> None:
    """Write a view, whole or not at all.

    Parameters
    ----------
    path : path
        Where to.
    view : View
        What to write.
    unit : "m", "cm" or "mm", optional
        The file's unit of length; the view's own if not given. What is written in metres is read back to the last bit.

    Raises
    ------
    InputError
        Where the file cannot be written, or would be larger than can be read again.
    """
    unit = unit or view.unit
    plane = isinstance(view.camera, LeeChenModel)
    image = from_metres(image_from_paper(view.image), unit) if plane else view.image
    head_image = np.concatenate([view.head_image, view.own_head_image], axis=1)
    if plane:
        head_image = from_metres(image_from_paper(head_image), unit)
    truth = from_metres(view.truth, unit)
    root = from_metres(view.root, unit)
    frames = []
    for index in range(len(view)):
        frame: dict[str, Any] = {"time": float(view.time[index]), "image": _known(image[index], JOINTS)}
        if head := _known(head_image[index], (*HEAD_POINTS, *view.own_head_names)):
            frame["head_image"] = head
        if sure := _known_numbers(view.confidence[index], POINTS):
            frame["confidence"] = sure
        if not np.isnan(root[index, 0]):
            frame["root"] = root[index].tolist()
        if joints := _known(truth[index], JOINTS):
            frame["truth"] = joints
        frames.append(frame)
    head_of_file: dict[str, Any] = {
        "schema": VIEW_SCHEMA,
        "unit": unit,
        "camera": camera_fields(view.camera, unit),
    }
    if figure := _figure_fields(view, unit):
        head_of_file["figure"] = figure
    if view.deviation is not None:
        head_of_file["deviation"] = view.deviation
    if view.length_deviation is not None:
        head_of_file["length_deviation"] = view.length_deviation
    if view.derived:
        head_of_file["derived"] = list(view.derived)
    # What is written must be read again: a view made in Python may say what its schema does not allow.
    validated(ViewFile, {**head_of_file, "frames": frames}, path)
    write_text(path, json_pieces(head_of_file, "frames", frames))


def _gather(frames: list[dict[str, list[float]] | None], names: tuple[str, ...], axes: int) -> Array:
    """Make the array (F, len(names), axes) of points by name, NaN where a name is absent."""
    unknown = [np.nan] * axes
    rows = [[(points or {}).get(name, unknown) for name in names] for points in frames]
    return np.array(rows, dtype=np.float64)


def _gather_numbers(frames: list[dict[str, float] | None], names: tuple[str, ...]) -> Array:
    """Make the array (F, len(names)) of numbers by name, NaN where a name is absent."""
    rows = [[(numbers or {}).get(name, np.nan) for name in names] for numbers in frames]
    return np.array(rows, dtype=np.float64)


def _known_numbers(numbers: Array, names: tuple[str, ...]) -> dict[str, float]:
    """Return the numbers that are known, by name."""
    return {name: value for name, value in zip(names, numbers.tolist(), strict=True) if not math.isnan(value)}


def _known(points: Array, names: tuple[str, ...]) -> dict[str, list[float]]:
    """Return the points that are known, by name."""
    rows = points.tolist()
    return {name: row for name, row in zip(names, rows, strict=True) if row[0] == row[0]}


def _camera(file: ViewFile, path: str | Path) -> CameraModel:
    """Make the camera; what is finite in the file's unit may still overflow in metres."""
    try:
        return _in_metres(file.camera, file.unit)
    except CameraError as error:
        raise refusal(path, "camera", str(error), "a camera that can be", "correct it") from None


def _in_metres(camera: LeeChenCamera | OpenCVCamera | ScaledOrthographicFields, unit: Unit) -> CameraModel:
    if isinstance(camera, LeeChenCamera):
        return LeeChenModel(f=None if camera.f is None else float(to_metres(camera.f, unit)))
    if isinstance(camera, OpenCVCamera):
        return OpenCVModel(
            K=np.array(camera.K, dtype=np.float64),
            distortion=None if camera.distortion is None else np.array(camera.distortion, dtype=np.float64),
            R=None if camera.R is None else np.array(camera.R, dtype=np.float64),
            t=None if camera.t is None else to_metres(camera.t, unit),
            size=None if camera.size is None else (camera.size[0], camera.size[1]),
            up=camera.up or "",
        )
    scale = camera.scale
    return ScaledOrthographicModel(
        scale=None if scale is None else scale * PER_METRE[unit], aspect=camera.aspect
    )


def camera_of(settings: Mapping[str, Any]) -> OpenCVModel | None:
    """Return the calibrated camera that a result's settings hold; None where they hold none.

    Parameters
    ----------
    settings : mapping
        Of a result: its ``camera`` is as `camera_fields` spells it, in metres.

    Raises
    ------
    InputError
        Where it is no camera.
    """
    fields = settings.get("camera")
    if fields is None:
        return None
    where = "settings.camera of the result"
    try:
        model = _in_metres(conforming(OpenCVCamera, fields, where), "m")
    except CameraError as error:
        raise refusal(where, "", str(error), "a camera that can be", "recover it again") from None
    return model if isinstance(model, OpenCVModel) else None


def _figure_fields(view: View, unit: Unit) -> dict[str, Any]:
    fields: dict[str, Any] = {}
    if view.lengths:
        fields["lengths"] = {name: float(from_metres(value, unit)) for name, value in view.lengths.items()}
    if view.shoulders is not None:
        fields["shoulders"] = view.shoulders
    if view.stature is not None:
        fields["stature"] = float(from_metres(view.stature, unit))
    if view.head_points is not None:
        fields["head_points"] = {name: from_metres(p, unit).tolist() for name, p in view.head_points.items()}
    return fields
