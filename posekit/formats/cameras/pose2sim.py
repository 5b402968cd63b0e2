"""Pose2Sim's, Anipose's and Caliscope's calibration: TOML, a table a camera.

``[cam_0]`` has ``name``, ``size`` (width, height), ``matrix``, ``distortions``, ``rotation`` (Rodrigues vector, of
Caliscope a matrix, world to camera) and ``translation``; ``[metadata]`` follows (aniposelib, `Camera.get_dict` and
`CameraGroup.dump`; Pose2Sim's documentation, "Calibration"). Pose2Sim gives every camera ``fisheye``, its
translations are in metres and its world's z points up; Anipose writes ``fisheye`` for fisheye cameras alone, and its
unit is that of the calibration board, mostly millimetres.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.cameras.calibrated import SAYS_CALIBRATED, UP_AXES, CalibratedCamera
from posekit.cameras.rotation import rotation_from_given_vector, rotation_from_rounded
from posekit.errors import CameraError, InputError
from posekit.formats.cameras.camera_format import CameraFormat
from posekit.formats.cameras.fields import fitted, made, numbers, refuse_misspelt, translation
from posekit.geometry import Array, vector_from_rotation
from posekit.safe_io import cut, one_line, read_toml, refusal, shown, write_text

MAX_BYTES: Final = 10_000_000
ANIPOSE_UNIT: Final = "mm"
TABLE_FIELDS: Final = ("size", "matrix", "distortions", "rotation", "translation", "fisheye")
NO_CAMERAS: Final = ("metadata", "capture_volume", "charuco", "checkerboard")
"""Tables that Pose2Sim and Caliscope write beside the cameras."""
LEAST_UPRIGHT: Final = 0.8
"""Cosine between an axis of the world and what is up in the pictures, in the mean, from which the axis is up."""


def read_pose2sim(path: Path, unit: str | float | None = None) -> dict[str, CalibratedCamera]:
    """Read the cameras of a TOML file; see `posekit.formats.cameras.read_cameras`."""
    tables = read_toml(path, limit=MAX_BYTES)
    metadata = tables.get("metadata")
    cameras = {
        key: table
        for key, table in tables.items()
        if key not in NO_CAMERAS and isinstance(table, dict) and table
    }
    if not any("matrix" in table for table in cameras.values()):
        there = ", ".join(cut(key) for key in list(tables)[:6]) or "nothing"
        raise refusal(
            path, "", f"no camera; there is {one_line(there)}", "tables with a matrix", "name a calibration"
        )
    up = ""
    if isinstance(metadata, dict) and metadata.get("up") in UP_AXES:
        up = metadata["up"]
    elif all("fisheye" in table for table in cameras.values()):
        up = "+z"
    found: dict[str, CalibratedCamera] = {}
    for key, table in cameras.items():
        camera = _camera(table, path, key, unit, up)
        if camera.name in found:
            raise refusal(
                path, f"{cut(key)}.name", f"{shown(camera.name)} twice", "each name once", "rename one"
            )
        found[camera.name] = camera
    turned = [table.get("rotation_count") for table in cameras.values()]
    if not up and (axis := _up_of_pictures(turned, [camera.R for camera in found.values()])):
        return {name: replace(camera, up=axis) for name, camera in found.items()}
    return found


def _up_of_pictures(turned: Sequence[Any], rotations: Sequence[Array | None]) -> str:
    """Return the axis of the world that points up in pictures which are upright after some quarter turns.

    Caliscope's ``rotation_count``, clockwise, says how pictures are turned before a person is looked for in them.
    """
    if not all(isinstance(count, int) for count in turned) or any(R is None for R in rotations):
        return ""
    of_camera = np.array([[0, -1, 0], [-1, 0, 0], [0, 1, 0], [1, 0, 0]], dtype=np.float64)
    ups = [of_camera[count % 4] @ R for count, R in zip(turned, rotations, strict=True) if R is not None]
    mean = np.mean(ups, axis=0) if ups else np.zeros(3)
    along = int(np.argmax(np.abs(mean)))
    if abs(mean[along]) < LEAST_UPRIGHT:
        return ""
    return ("+" if mean[along] > 0 else "-") + "xyz"[along]


def _camera(
    table: dict[str, Any], path: Path, key: str, unit: str | float | None, up: str
) -> CalibratedCamera:
    place = cut(key)
    refuse_misspelt(
        table, [(one,) for one in TABLE_FIELDS], f"{path}: {one_line(place)}", ratio=0.75, letters=4
    )
    name = table.get("name", key)
    if not isinstance(name, str | int) or isinstance(name, bool) or not str(name):
        raise refusal(path, f"{place}.name", shown(name), "a name", "correct it")
    if "matrix" not in table:
        raise refusal(path, f"{place}.matrix", "nothing", "three rows of three numbers", "add it")
    fisheye = table.get("fisheye", False)
    if not isinstance(fisheye, bool):
        raise refusal(path, f"{place}.fisheye", shown(fisheye), "true or false", "correct it")
    distortion = numbers(table.get("distortions", []) or np.empty(0), path, f"{place}.distortions").ravel()
    R, t = table.get("rotation"), table.get("translation")
    if (R is None) != (t is None):
        lost = "rotation" if R is None else "translation"
        raise refusal(path, f"{place}.{lost}", "nothing", "three numbers", "give both, or neither")
    how, deviation = table.get("how", SAYS_CALIBRATED), table.get("deviation", 0.0)
    if not isinstance(how, str) or isinstance(deviation, bool) or not isinstance(deviation, int | float):
        raise refusal(path, f"{place}.how", shown([how, deviation]), "a text and a number", "correct it")
    return made(
        path,
        str(name),
        K=numbers(table["matrix"], path, f"{place}.matrix"),
        distortion=fitted(distortion, fisheye),
        fisheye=fisheye,
        size=_size(table.get("size"), path, f"{place}.size"),
        R=None if R is None else _rotation(R, path, f"{place}.rotation"),
        t=None
        if t is None
        else translation(_three(t, path, f"{place}.translation"), path, f"{place}.translation", unit),
        up=up,
        how=how,
        deviation=float(deviation),
    )


def _three(value: Any, path: Path, field: str) -> np.ndarray:
    values = numbers(value, path, field).ravel()
    if len(values) != 3:
        raise refusal(path, field, f"{len(values)} numbers", "three", "correct it")
    return values


def _rotation(value: Any, path: Path, field: str) -> np.ndarray:
    values = numbers(value, path, field)
    try:
        if values.shape == (3, 3):  # as Caliscope has it
            return rotation_from_rounded(values)
        return rotation_from_given_vector(_three(value, path, field))
    except CameraError as error:
        raise InputError(f"{path}: {field}: {error}; correct the file") from None


def _size(value: Any, path: Path, field: str) -> tuple[int, int] | None:
    if value is None:
        return None
    sides = numbers(value, path, field).ravel()
    if len(sides) != 2 or not all(side > 0 and float(side).is_integer() for side in sides):
        raise refusal(path, field, shown(value), "width and height in pixels", "correct it, or leave it out")
    return int(sides[0]), int(sides[1])


def write_pose2sim(path: Path, cameras: Mapping[str, CalibratedCamera]) -> None:
    """Write cameras as Pose2Sim reads them, metres.

    A camera without a pose has no ``rotation`` and ``translation``, which Pose2Sim itself needs. What was guessed says
    so in ``how`` and ``deviation``, which other tools pass over.

    Raises
    ------
    InputError
        Where the file cannot be written, or the cameras' worlds point up differently: the file has room for one.
    """
    ups = {camera.up for camera in cameras.values()}
    if len(ups) > 1:
        raise InputError(
            f"{path}: the cameras' worlds point up along {', '.join(map(shown, sorted(ups)))}; expected one"
        )
    lines: list[str] = []
    for number, camera in enumerate(cameras.values(), start=1):
        lines += [f"[cam_{number:02d}]", f"name = {_text(camera.name)}"]
        if camera.size is not None:
            lines.append(f"size = {_listed(camera.size)}")
        rows = ", ".join(_listed(row) for row in camera.K)
        lines += [f"matrix = [ {rows}]", f"distortions = {_listed(camera.distortion)}"]
        if camera.R is not None and camera.t is not None:
            lines.append(f"rotation = {_listed(vector_from_rotation(camera.R))}")
            lines.append(f"translation = {_listed(camera.t)}")
        lines.append(f"fisheye = {'true' if camera.fisheye else 'false'}")
        if camera.guessed:
            lines += [
                f"how = {_text(camera.how)}",
                f"deviation = {camera.deviation!r}",
            ]
        lines.append("")
    lines += ["[metadata]", "adjusted = false", "error = 0.0"]
    if (up := next(iter(ups), "")) != "+z":
        lines.append(f'up = "{up}"')
    write_text(path, (f"{line}\n" for line in lines))


def _text(text: str) -> str:
    """Spell a text as TOML, which has JSON's escapes but not its pairs of surrogates."""
    if one_line(text) != text:
        raise InputError(f"camera {shown(text)}: characters that do not print; rename it to write it")
    return json.dumps(text, ensure_ascii=False)


def _listed(values: Any) -> str:
    return "[ " + ", ".join(repr(float(value)) for value in values) + "]"


def read_anipose(path: Path, unit: str | float | None = None) -> dict[str, CalibratedCamera]:
    """Read the cameras of a TOML file of Anipose, whose translations are millimetres unless `unit` says otherwise."""
    return read_pose2sim(path, ANIPOSE_UNIT if unit is None else unit)


POSE2SIM_FORMAT: Final = CameraFormat(
    name="pose2sim",
    title="Pose2Sim's calibration: TOML, a table a camera, metres",
    suffixes=(".toml",),
    looks_like=lambda given: True,
    read=read_pose2sim,
    write=write_pose2sim,
    write_suffixes=(".toml",),
)
ANIPOSE_FORMAT: Final = CameraFormat(
    name="anipose",
    title="Anipose's calibration: Pose2Sim's tables in millimetres; taken where it is named",
    looks_like=lambda given: False,
    read=read_anipose,
)
