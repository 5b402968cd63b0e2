"""Cameras in files: OpenCV's YAML, XML and JSON, ROS's camera_info, NPZ arrays, and TOML of Pose2Sim and Anipose.

These formats store the same values in fields of different names. One reader finds intrinsics, distortion, pose and
image size under their usual names. Pose2Sim states ``fisheye`` for every camera; its unit is metres, its z axis is up.
Anipose's unit is that of its calibration board, mostly millimetres. In Caliscope's files, ``rotation_count`` (quarter
turns of the pictures) determines which axis is up.
"""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.cameras import PinholeCamera
from posekit.errors import CameraError, InputError, cut, one_line, refusal, shown
from posekit.files import write_bytes
from posekit.formats import json_file
from posekit.formats.layout import plain
from posekit.formats.node import Node, as_numbers
from posekit.formats.options import Options
from posekit.geometry import UP_AXES, Array, rotation_from_vector, vector_from_rotation
from posekit.settings import UNITS

Fields = Mapping[str, Any]

#: Known names of each field; case and underscores are ignored.
FIELDS: Final = {
    "words for K": "camera_matrix intrinsic_matrix camera_intrinsics intrinsics matrix",
    "K": "camera_matrix intrinsic_matrix camera_intrinsics intrinsics matrix mtx k m",
    "distortion": "distortion_coefficients distortion_coeffs distortion distortions dist_coeffs dist_coefs dist_coef "
    "distcoef dist d",
    "matrix of rotation": "rotation_matrix rmat",
    "rotation": "rotation_vector rotation rot rvec r",
    "translation": "translation_vector translation tvec t",
    "size": "image_size img_size image_resolution resolution size",
    "width": "image_width width w",
    "height": "image_height height h",
    "fisheye": "fisheye_model fisheye use_fisheye_model",
    "model": "distortion_model camera_model model",
    "name": "camera_name name id",
}
#: Pattern of the name of an intrinsic matrix, with an optional suffix for one of several cameras: ``K_left``, ``M1``.
INTRINSICS: Final = re.compile(
    rf"(?:{'|'.join(FIELDS['K'].replace('_', '_?').split())})(?:[_-]+(.+)|(\d+))?", re.IGNORECASE
)
FISHEYE_MODELS: Final = ("equidistant", "fisheye", "kannala_brandt", "kannalabrandt", "opencv_fisheye")
PLAIN_MODELS: Final = ("plumb_bob", "rational_polynomial", "opencv", "pinhole", "brown", "radtan", "none", "")
#: Largest distance of a camera from the world's origin at which lengths of an unknown unit are read as metres.
METRES_UP_TO: Final = 100.0
#: Smallest such distance at which the lengths are read as millimetres; smaller distances may also be centimetres.
MILLIMETRES_FROM: Final = 1000.0
#: Minimum cosine between the world's up axis and the mean upward direction of the pictures.
LEAST_UPRIGHT: Final = 0.8


def looks_like(document: Any) -> bool:
    """Return whether a document has a field of intrinsics, at the top level or one level below."""
    if isinstance(document, list):
        return any(isinstance(one, Mapping) and _suffixes(one) for one in document[:1])
    if not isinstance(document, Mapping):
        return False
    below = [one for value in document.values() for one in (value if isinstance(value, list) else [value])]
    held = [one for one in [document, *below] if isinstance(one, Mapping)]
    return any(_suffixes(one) or isinstance(_value(one, "words for K"), list | Mapping) for one in held)


def read(document: Any, path: str | Path, options: Options) -> dict[str, PinholeCamera]:
    """Read the cameras of a calibration.

    Parameters
    ----------
    document : mapping or list
        Fields of one camera; or fields of several cameras with a suffix for each camera (``K_left``, ``M1``); or one
        object for each camera.
    path : path
        Path of the file.
    options : Options
        Options with the `unit` of translations and the world's `up` axis.

    Returns
    -------
    dict of str to PinholeCamera
        Cameras by name; lengths in metres.

    Raises
    ------
    InputError
        If there is no camera, or a camera is impossible.
    """
    fields = {"cameras": document} if isinstance(document, list) else dict(document)
    held: list[tuple[str, Mapping[str, Any], str]] = []
    if suffixes := _suffixes(fields):
        name = str(_value(fields, "name") or Path(path).name.partition(".")[0])
        held = [(suffix or name, fields, suffix) for suffix in suffixes]
    for key, entry in fields.items() if not suffixes else ():
        for number, one in enumerate(entry) if isinstance(entry, list) else [(key, entry)]:
            if isinstance(one, Mapping) and "" in _suffixes(one):
                held.append((str(_value(one, "name") or number), one, ""))
    if not held:
        there = one_line(", ".join(cut(str(key)) for key in list(fields)[:6])) or "nothing"
        expected = f"one of {', '.join(FIELDS['K'].split())}"
        got = f"no 3x3 matrix of intrinsics among {there}"
        raise refusal(path, "camera_matrix", got, expected, "give a calibration")
    metadata = fields.get("metadata")
    stated = metadata.get("up", "") if isinstance(metadata, Mapping) else fields.get("up", "")
    up = options.up or (stated if isinstance(stated, str) else "")
    entries = [one for _, one, _ in held]
    if not up and all("fisheye" in one and "matrix" in one for one in entries):
        up = "+z"
    unit = options.unit or _unit(entries, path)
    found: dict[str, PinholeCamera] = {}
    for name, entry, suffix in held:
        if name in found:
            raise refusal(path, "name", f"{shown(name)} twice", "each name once", "rename one of the two")
        own = up or entry.get("up", "")
        found[name] = _camera(entry, path, name, suffix, unit, own if own in UP_AXES else "")
    axis = "" if up else _up_of_pictures([one.get("rotation_count") for one in entries], list(found.values()))
    if not axis:
        return found
    return {name: replace(camera, up=axis) for name, camera in found.items()}


def _camera(fields: Fields, path: str | Path, name: str, suffix: str, unit: str, up: str) -> PinholeCamera:
    """Make one camera from fields; the fields of one of several cameras have a suffix."""
    place = f"{cut(name)}."
    K = _numbers(_value(fields, "K", suffix), path, f"{place}K", 9).reshape(3, 3)
    given = _value(fields, "distortion", suffix)
    distortion = np.empty(0) if given is None else _numbers(given, path, f"{place}distortion")
    fisheye = _is_fisheye(fields, path, place, suffix)
    if not fisheye and 0 < len(distortion) < 4:  # some programs omit coefficients that are 0
        distortion = np.pad(distortion, (0, 4 - len(distortion)))
    R, t = _pose(fields, path, place, suffix)
    guess: dict[str, Any] = {
        name: kind(fields[name])
        for name, kind, accepted in (("how", str, str), ("deviation", float, int | float))
        if isinstance(fields.get(name), accepted)
    }
    try:
        return PinholeCamera(
            name=name,
            K=K,
            distortion=distortion,
            fisheye=fisheye,
            size=_size(fields, path, place, suffix),
            R=R,
            t=None if t is None else t / UNITS[unit],
            up=up if R is not None else "",
            **guess,
        )
    except CameraError as error:
        raise InputError(one_line(f"{path}: {error}")) from None


def _unit(entries: list[Mapping[str, Any]], path: str | Path) -> str:
    """Find the unit of the cameras' positions from their distances from the origin."""
    poses = [as_numbers(_value(one, "translation")) for one in entries]
    farthest = max((float(np.linalg.norm(t)) for t in poses if t is not None and t.size == 3), default=0.0)
    if farthest <= METRES_UP_TO or not np.isfinite(farthest):
        return "m"
    if farthest < MILLIMETRES_FROM:
        got = f"a camera {farthest:.0f} from the origin, in no stated unit"
        expected = f"metres, up to {METRES_UP_TO:.0f}"
        raise refusal(path, "translation", got, expected, "give the unit with --unit cm or mm")
    warnings.warn(
        f"{path}: cameras up to {farthest:,.0f} from the origin: translations are read as millimetres; "
        "give another unit with --unit",
        UserWarning,
        stacklevel=2,
    )
    return "mm"


def _pose(fields: Fields, path: str | Path, place: str, suffix: str) -> tuple[Array | None, Array | None]:
    """Return rotation R and translation t; None for both if t is missing, because ROS's sole R is a rectification."""
    t = _value(fields, "translation", suffix)
    given = [_value(fields, name, suffix) for name in ("matrix of rotation", "rotation")]
    arrays = [_numbers(one, path, f"{place}R") for one in given if one is not None]
    R = next((array for array in arrays if array.size in (3, 9)), None)
    if t is None or R is None:
        return None, None
    return R.reshape(3, 3) if R.size == 9 else rotation_from_vector(R), _numbers(t, path, f"{place}t", 3)


def _size(fields: Fields, path: str | Path, place: str, suffix: str) -> tuple[int, int] | None:
    """Return width and height in pixels; None if they are absent or zero, as in ROS for an unknown size."""
    sides = [_value(fields, name, suffix, "") for name in ("width", "height")]
    if (pair := _value(fields, "size", suffix, "")) is not None:
        pair = pair.get("data") if isinstance(pair, Mapping) else pair
        sides = np.ravel(np.asarray(pair, dtype=object)).tolist()
    if sides == [None, None]:
        return None
    pixels = as_numbers(sides)
    if pixels is None or len(pixels) != 2 or (pixels % 1 != 0).any() or (pixels < 0).any():
        raise refusal(path, f"{place}size", shown(sides), "width and height in pixels")
    return (int(pixels[0]), int(pixels[1])) if pixels.all() else None


def _is_fisheye(fields: Fields, path: str | Path, place: str, suffix: str) -> bool:
    flag, model = (_value(fields, name, suffix, "") for name in ("fisheye", "model"))
    if flag is not None and str(flag).casefold() not in ("0", "1", "true", "false"):
        raise refusal(path, f"{place}fisheye", shown(flag), "true or false")
    word = model.casefold() if isinstance(model, str) else ""
    if word not in FISHEYE_MODELS + PLAIN_MODELS:
        known = ", ".join(one for one in FISHEYE_MODELS + PLAIN_MODELS if one)
        raise refusal(path, f"{place}distortion_model", shown(model), known, "undistort the pictures first")
    return str(flag).casefold() in ("1", "true") or word in FISHEYE_MODELS


def _up_of_pictures(turns: list[Any], cameras: list[PinholeCamera]) -> str:
    """Return the world's axis that points up in the pictures, after their rotation by quarter turns (`turns`)."""
    if not all(isinstance(turn, int) for turn in turns) or any(camera.R is None for camera in cameras):
        return ""
    in_camera = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    ups = [in_camera[turn % 4] @ camera.R for turn, camera in zip(turns, cameras, strict=True)]
    mean = np.mean(ups, axis=0)
    along = int(np.argmax(np.abs(mean)))
    return "" if abs(mean[along]) < LEAST_UPRIGHT else ("+" if mean[along] > 0 else "-") + "xyz"[along]


def _numbers(value: Any, path: str | Path, field: str, count: int | None = None) -> Array:
    """Return the numbers of a list, an array or OpenCV's object with rows, cols and data as a 1D array."""
    data = value.get("data") if isinstance(value, Mapping) else value
    array = Node(data, path, field).array().ravel()
    declared = array.size
    if isinstance(value, Mapping):
        rows, cols = value.get("rows"), value.get("cols")
        declared = rows * cols if isinstance(rows, int) and isinstance(cols, int) else -1
    if array.size != declared or count not in (None, array.size):
        expected = str(count) if count is not None else "as many as rows and cols say"
        raise refusal(path, field, f"{array.size} numbers", expected, "write the file again")
    return array


def _suffixes(fields: Fields) -> list[str]:
    """List the suffixes of fields with 3x3 intrinsics: empty, a number, or a word after an underscore."""
    found = []
    for key, value in fields.items():
        match = INTRINSICS.fullmatch(str(key))
        if match is not None and _is_intrinsic(value):
            found.append(match[1] or match[2] or "")
    return list(dict.fromkeys(found))


def _is_intrinsic(value: Any) -> bool:
    """Return whether a value is a 3x3 matrix of intrinsics: the last row is 0, 0, 1, unlike in a rotation."""
    array = as_numbers(value.get("data") if isinstance(value, Mapping) else value)
    return array is not None and array.size == 9 and bool((array.ravel()[6:] == [0, 0, 1]).all())


def _value(fields: Fields, field: str, *suffixes: str) -> Any:
    """Return the value under the first known name of a field, with one of the suffixes; None if it is absent."""
    by_key = {plain(str(key)): value for key, value in fields.items()}
    named = (plain(alias + suffix) for suffix in suffixes or ("",) for alias in FIELDS[field].split())
    value = next((by_key[name] for name in named if name in by_key), None)
    return value.item() if isinstance(value, np.ndarray) and value.size == 1 else value


def write_json(path: str | Path, cameras: Mapping[str, PinholeCamera]) -> None:
    """Write cameras as JSON with one object for each camera; lengths in metres."""
    json_file.write(path, {name: camera.fields() for name, camera in cameras.items()})


def write_toml(path: str | Path, cameras: Mapping[str, PinholeCamera]) -> None:
    """Write cameras as TOML for Pose2Sim; lengths in metres.

    For a guessed focal length the fields ``how`` and ``deviation`` state the reason and the standard deviation.

    Raises
    ------
    InputError
        If the cameras have different up axes.
    """
    ups = {camera.up for camera in cameras.values()}
    if len(ups) > 1:
        got = f"worlds that point up along {', '.join(map(shown, sorted(ups)))}"
        raise refusal(path, "up", got, "the same up axis for all", "write one file per axis")
    tables: dict[str, dict[str, Any]] = {}
    for number, (name, camera) in enumerate(cameras.items(), start=1):
        if one_line(name) != name:
            raise refusal("camera", "name", shown(name), "printable characters", "rename it")
        table = tables[f"cam_{number:02d}"] = {"name": name}
        if camera.size is not None:
            table["size"] = [float(side) for side in camera.size]
        lens = np.zeros(4) if camera.distortion is None else camera.distortion
        table |= {"matrix": camera.K.tolist(), "distortions": lens.tolist()}
        if camera.R is not None and camera.t is not None:
            table |= {"rotation": vector_from_rotation(camera.R).tolist(), "translation": camera.t.tolist()}
        table["fisheye"] = camera.fisheye
        if camera.deviation:
            table |= {"how": camera.how, "deviation": camera.deviation}
    tables["metadata"] = {"adjusted": False, "error": 0.0}
    if ups - {"", "+z"}:
        tables["metadata"]["up"] = ups.pop()
    lines = []
    for title, table in tables.items():
        # TOML spells these values as JSON does.
        entries = (f"{key} = {json.dumps(value, ensure_ascii=False)}\n" for key, value in table.items())
        lines.append(f"[{title}]\n{''.join(entries)}")
    write_bytes(path, "\n".join(lines).encode())
