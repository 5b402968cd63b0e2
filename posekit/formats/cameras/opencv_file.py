"""Cameras in OpenCV's FileStorage (YAML, XML, JSON), ROS's camera_info YAML, plain JSON, and posekit's own views.

FileStorage writes a matrix as an object of ``rows``, ``cols``, ``dt`` and ``data`` (OpenCV documentation, "XML/YAML/
JSON file storages"); the names are the writer's own, mostly those of OpenCV's calibration sample.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

import numpy as np

from posekit.cameras.calibrated import CalibratedCamera
from posekit.errors import InputError
from posekit.formats.cameras.camera_format import CameraFormat, has_intrinsics
from posekit.formats.cameras.fields import METRES_IN_CAMERA_UNIT, cameras_of, made, numbers
from posekit.formats.given_file import GivenFile
from posekit.safe_io import one_line, read_json, read_text, read_xml, refusal, shown, write_text
from posekit.safe_io.yaml_file import parse_yaml

MAX_BYTES: Final = 10_000_000


def read_opencv(path: Path, unit: str | float | None = None) -> dict[str, CalibratedCamera]:
    """Read the cameras of a YAML, XML or JSON file; see `posekit.formats.cameras.read_cameras`."""
    suffix = path.suffix.lower()
    if suffix == ".xml":
        fields = _xml_fields(read_xml(path, limit=MAX_BYTES), path)
    elif suffix == ".json":
        fields = read_json(path)
        if isinstance(fields, dict) and str(fields.get("schema", "")).startswith("posekit.view/"):
            return _of_view(fields, path)
    else:
        fields = parse_yaml(read_text(path, limit=MAX_BYTES, too_large="name a camera's file"), path)
    if isinstance(fields, list):
        fields = {"cameras": fields}
    if not isinstance(fields, dict):
        raise refusal(path, "", shown(fields), "named fields", "check that it is a camera's file")
    return cameras_of(fields, path, path.stem, unit)


def _xml_fields(root: ElementTree.Element, path: Path) -> dict[str, Any]:
    if root.tag != "opencv_storage":
        raise refusal(
            path, "", f"the root element <{root.tag[:40]}>", "<opencv_storage>", "name a camera's file"
        )
    return {element.tag: _xml_value(element) for element in root}


def _xml_value(element: ElementTree.Element) -> Any:
    """Turn an element into a mapping, a list of numbers, a number or a text; its depth is bounded by the intake."""
    if len(element):
        inner = {child.tag: _xml_value(child) for child in element}
        if "data" in inner:
            return {
                name: value[0] if isinstance(value, list) and value and name != "data" else value
                for name, value in inner.items()
            }
        if set(inner) == {"_"}:
            return [_xml_value(child) for child in element]
        return inner
    words = (element.text or "").split()
    try:
        values = [
            int(word) if word.lstrip("+-").isdecimal() and len(word) < 19 else float(word) for word in words
        ]
    except ValueError:
        return (element.text or "").strip().strip('"')
    if "_" in "".join(words):  # what Python takes for a number, and nobody else does
        return (element.text or "").strip()
    return values[0] if len(values) == 1 and element.tag != "data" else values


def _of_view(fields: dict[str, Any], path: Path) -> dict[str, CalibratedCamera]:
    """Take the camera of a ``posekit.view/1`` file."""
    camera = fields.get("camera")
    if not isinstance(camera, dict) or camera.get("model") != "opencv":
        got = shown(camera.get("model") if isinstance(camera, dict) else camera)
        raise refusal(path, "camera.model", got, '"opencv"', "give a view with a calibrated camera")
    if fields.get("unit") not in METRES_IN_CAMERA_UNIT:
        raise refusal(path, "unit", shown(fields.get("unit")), ", ".join(METRES_IN_CAMERA_UNIT), "name it")
    parameters: dict[str, Any] = {"K": numbers(camera.get("K"), path, "camera.K")}
    for name in ("distortion", "R", "t"):
        if camera.get(name) is not None:
            parameters[name] = numbers(camera[name], path, f"camera.{name}")
    if "t" in parameters:
        parameters["t"] = parameters["t"] * METRES_IN_CAMERA_UNIT[fields["unit"]]
    if camera.get("size") is not None:
        sides = numbers(camera["size"], path, "camera.size").ravel()
        parameters["size"] = tuple(int(side) for side in sides)
    return {path.stem: made(path, path.stem, **parameters)}


def write_opencv(path: Path, camera: CalibratedCamera) -> None:
    """Write one camera as OpenCV's YAML, which `cv2.FileStorage` opens.

    The pose goes in as ``R`` and ``T`` (metres). What was guessed stays as a text, ``how``, with ``deviation``.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    lines = ["%YAML:1.0", "---", f'camera_name: "{_text(camera.name)}"']
    if camera.size is not None:
        lines += [f"image_width: {camera.size[0]}", f"image_height: {camera.size[1]}"]
    lines += [f"fisheye_model: {int(camera.fisheye)}"]
    lines += _matrix("camera_matrix", camera.K)
    if len(camera.distortion):
        lines += _matrix("distortion_coefficients", camera.distortion[:, None])
    if camera.R is not None and camera.t is not None:
        lines += [*_matrix("R", camera.R), *_matrix("T", camera.t[:, None])]
    if camera.guessed:
        lines += [f'how: "{_text(camera.how)}"', f"deviation: {camera.deviation!r}"]
    if camera.up:
        lines += [f'up: "{camera.up}"']
    write_text(path, (f"{line}\n" for line in lines))


def _matrix(name: str, values: np.ndarray) -> list[str]:
    listed = ", ".join(repr(float(value)) for value in values.ravel())
    rows, cols = values.shape
    return [
        f"{name}: !!opencv-matrix",
        f"   rows: {rows}",
        f"   cols: {cols}",
        "   dt: d",
        f"   data: [ {listed} ]",
    ]


def _text(text: str) -> str:
    if '"' in text or "\\" in text or one_line(text) != text:
        raise InputError(
            f"camera {shown(text)}: a quote, a backslash or a line end in it; rename it to write it"
        )
    return text


def _looks_like(given: GivenFile) -> bool:
    return given.suffix != ".json" or has_intrinsics(given.document)


def _write_one(path: Path, cameras: Mapping[str, CalibratedCamera]) -> None:
    if len(cameras) > 1:
        raise refusal(path, "", f"{len(cameras)} cameras", "one a YAML file", "write one each, or a .toml")
    write_opencv(path, next(iter(cameras.values())))


OPENCV_FORMAT: Final = CameraFormat(
    name="opencv",
    title="OpenCV's FileStorage (YAML, XML, JSON), ROS's camera_info, plain JSON of a camera",
    suffixes=(".yaml", ".yml", ".xml", ".json"),
    looks_like=_looks_like,
    read=read_opencv,
    write=_write_one,
    write_suffixes=(".yaml", ".yml"),
)
