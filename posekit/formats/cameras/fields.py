"""Cameras from named fields, however a file spells the names: OpenCV's YAML, XML, JSON and NPZ share this."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.cameras.calibrated import N_BROWN_COEFFICIENTS, CalibratedCamera
from posekit.cameras.rotation import rotation_from_given_vector, rotation_from_rounded
from posekit.errors import CameraError, InputError
from posekit.geometry import Array
from posekit.safe_io import cut, one_line, refusal, shown

MATRIX_NAMES: Final = (
    "camera_matrix",
    "intrinsic_matrix",
    "camera_intrinsics",
    "intrinsics",
    "matrix",
    "mtx",
    "k",
    "m",
)
DISTORTION_NAMES: Final = (
    "distortion_coefficients",
    "distortion_coeffs",
    "distortion",
    "distortions",
    "dist_coeffs",
    "dist_coefs",
    "dist_coef",
    "distcoef",
    "dist",
    "d",
)
ROTATION_NAMES: Final = ("rotation_matrix", "rotation_vector", "rotation", "rmat", "rot", "rvec", "r")
TRANSLATION_NAMES: Final = ("translation_vector", "translation", "tvec", "t")
SIZE_NAMES: Final = ("image_size", "img_size", "image_resolution", "resolution", "size")
WIDTH_NAMES: Final = ("image_width", "width", "w")
HEIGHT_NAMES: Final = ("image_height", "height", "h")
FISHEYE_NAMES: Final = ("fisheye_model", "fisheye", "use_fisheye_model")
MODEL_NAMES: Final = ("distortion_model", "camera_model", "model")
FISHEYE_MODELS: Final = ("equidistant", "fisheye", "kannala_brandt", "kannalabrandt", "opencv_fisheye")
PLAIN_MODELS: Final = ("plumb_bob", "rational_polynomial", "opencv", "pinhole", "brown", "radtan", "none", "")
FIELD_KINDS: Final = (
    DISTORTION_NAMES,
    ROTATION_NAMES,
    TRANSLATION_NAMES,
    SIZE_NAMES,
    WIDTH_NAMES,
    HEIGHT_NAMES,
    FISHEYE_NAMES,
    MODEL_NAMES,
)
MISSPELT_RATIO: Final = 0.9
"""How alike a field is to a name that it is not (difflib): two letters exchanged, or one more or less."""
MISSPELT_LETTERS: Final = 6
"""The shortest name that is looked for."""
CAMERA_NAMES: Final = ("camera_name", "name", "id")
METRES_IN_CAMERA_UNIT: Final[dict[str, float]] = {"m": 1.0, "cm": 0.01, "mm": 0.001}
FARTHEST_CAMERA_METRES: Final = 100.0
"""Metres from the world's origin beyond which a camera is more likely in another unit."""
MAX_CAMERAS: Final = 100_000
LONGEST_FIELD: Final = 80
MAX_SIDE: Final = 10**6
"""Rows or columns that a matrix may declare."""


def metres_of(unit: str | float) -> float:
    """Return the metres in one unit: m, cm, mm, or a number of metres.

    Raises
    ------
    InputError
        Where it is neither.
    """
    if isinstance(unit, str):
        if unit not in METRES_IN_CAMERA_UNIT:
            raise refusal(
                "",
                "unit",
                shown(unit),
                f"{', '.join(METRES_IN_CAMERA_UNIT)}, or metres as a number",
                "choose one",
            )
        return METRES_IN_CAMERA_UNIT[unit]
    if not (np.isfinite(unit) and unit > 0):
        raise refusal("", "unit", shown(unit), "a positive number of metres", "correct it")
    return float(unit)


def cameras_of(
    fields: Mapping[str, Any], source: str | Path, name: str, unit: str | float | None
) -> dict[str, CalibratedCamera]:
    """Make cameras of a file's top level.

    A file may have one camera's fields, several cameras' with the camera in the field's name (``K_left``, ``M1``), an
    object a camera, or a list of such objects.

    Parameters
    ----------
    fields : mapping
        Values are numbers, texts, lists, arrays, and mappings of such.
    source : path
        The file, for errors.
    name : str
        What to call a camera that has no name.
    unit : str or float, optional
        What translations are in; metres if not given, and then none is farther than 100.

    Raises
    ------
    InputError
        Where there is no camera, or one that is impossible.
    """
    found: dict[str, CalibratedCamera] = {}
    suffixes = _suffixes(fields)
    if suffixes:
        plain = str(_value(fields, CAMERA_NAMES, "") or name)
        for suffix in suffixes:
            _add(found, camera_of(fields, source, suffix or plain, unit, suffix), source)
        return found
    for key, entry in fields.items():
        if isinstance(entry, Mapping) and _suffixes(entry) == [""]:
            _add(found, camera_of(entry, source, str(_value(entry, CAMERA_NAMES, "") or key), unit), source)
        elif isinstance(entry, list) and len(entry) <= MAX_CAMERAS:
            inner = [
                (k, one) for k, one in enumerate(entry) if isinstance(one, Mapping) and "" in _suffixes(one)
            ]
            for k, one in inner:
                _add(found, camera_of(one, source, str(_value(one, CAMERA_NAMES, "") or k), unit), source)
    if not found:
        there = ", ".join(cut(str(key)) for key in list(fields)[:6]) or "nothing"
        raise refusal(
            source,
            "camera_matrix",
            f"no 3x3 matrix of intrinsics; there is {one_line(there)}",
            f"one of {', '.join(MATRIX_NAMES)}",
            "check that it is a camera's file",
        )
    return found


def camera_of(
    fields: Mapping[str, Any], source: str | Path, name: str, unit: str | float | None, suffix: str = ""
) -> CalibratedCamera:
    """Make one camera of its fields; those of several cameras have its `suffix`."""
    place = f"{cut(name)}."
    refuse_misspelt(fields, FIELD_KINDS, f"{source}: {one_line(cut(name))}")
    K = numbers(_value(fields, MATRIX_NAMES, suffix), source, f"{place}K").reshape(3, 3)
    given = _value(fields, DISTORTION_NAMES, suffix)
    distortion = np.empty(0) if given is None else numbers(given, source, f"{place}distortion").ravel()
    fisheye = _is_fisheye(fields, source, place, suffix)
    R, t = _pose(fields, source, place, suffix, unit)
    return made(
        source,
        name,
        K=K,
        distortion=fitted(distortion, fisheye),
        fisheye=fisheye,
        size=_size(fields, suffix, source, place),
        R=R,
        t=t,
    )


def refuse_misspelt(
    fields: Mapping[str, Any],
    kinds: Sequence[Sequence[str]],
    source: str,
    *,
    ratio: float = MISSPELT_RATIO,
    letters: int = MISSPELT_LETTERS,
) -> None:
    """Refuse a field that is all but one of the names of some kind, where there is none of that kind.

    Raises
    ------
    InputError
        With the field: left out in silence, the camera would be another.
    """
    ends = [*_suffixes(fields), ""]
    known = {spelling for kind in kinds for name in kind for spelling in (name, name.replace("_", ""))}
    keys = [key for key in (str(key).casefold() for key in fields) if key not in known]
    for kind in kinds:
        if any(_value(fields, tuple(kind), end) is not None for end in ends):
            continue
        long = [name for name in kind if len(name) >= letters]
        for key in keys:
            if near := difflib.get_close_matches(key[:LONGEST_FIELD], long, n=1, cutoff=ratio):
                raise refusal(
                    source, cut(key), "a field that is not read", near[0], "correct its name, or remove it"
                )


def made(source: str | Path, name: str, **parameters: Any) -> CalibratedCamera:
    """Make a camera; what it is refused for names the file."""
    try:
        return CalibratedCamera(name=name, **parameters)
    except CameraError as error:
        raise InputError(one_line(f"{source}: {error}; correct the file")) from None


def fitted(distortion: Array, fisheye: bool) -> Array:
    """Fill up coefficients to the next number that OpenCV has: MATLAB writes two, some files one."""
    count = len(distortion)
    if fisheye or count == 0 or count > N_BROWN_COEFFICIENTS:
        return distortion
    return np.pad(distortion, (0, 4 - count)) if count < 4 else distortion


def numbers(value: Any, source: str | Path, field: str) -> Array:
    """Take a value as numbers: a list, nested lists, or OpenCV's object with rows, cols and data.

    Raises
    ------
    InputError
        Where it holds anything else, a number that is not finite, or fewer than it declares.
    """
    shape: tuple[int, ...] | None = None
    if isinstance(value, Mapping):
        rows, cols, data = value.get("rows"), value.get("cols"), value.get("data")
        if not (
            isinstance(rows, int) and isinstance(cols, int) and 0 < rows < MAX_SIDE and 0 < cols < MAX_SIDE
        ):
            raise refusal(
                source, field, shown(dict(value)), "a matrix with rows, cols and data", "correct it"
            )
        value, shape = data, (rows, cols)
    try:
        array = np.asarray(value)
        if array.dtype.kind not in "iuf":
            raise ValueError
        array = array.astype(np.float64)
    except (ValueError, TypeError, OverflowError):
        raise refusal(source, field, shown(value), "numbers", "correct it") from None
    if shape is not None and array.size != shape[0] * shape[1]:
        got = f"{array.size} numbers for {shape[0]} rows and {shape[1]} columns"
        raise refusal(source, field, got, "as many as declared", "write the file again")
    if not np.isfinite(array).all():
        raise refusal(source, field, "a number that is not finite", "finite numbers", "calibrate again")
    return array if shape is None else array.reshape(shape)


def translation(t: Array, source: str | Path, field: str, unit: str | float | None) -> Array:
    """Turn a translation into metres, and refuse one that looks like another unit where none was given."""
    metres = t * metres_of("m" if unit is None else unit)
    if unit is None and not np.abs(metres).max() <= FARTHEST_CAMERA_METRES:
        raise refusal(
            source,
            field,
            f"a camera {np.abs(metres).max():,.0f} from the origin",
            f"metres, at most {FARTHEST_CAMERA_METRES:.0f}",
            "say the unit, as mm",
        )
    return metres


def _suffixes(fields: Mapping[str, Any]) -> list[str]:
    """List what follows the names of 3x3 matrices of intrinsics, in the file's order."""
    found = []
    for key, value in fields.items():
        low = str(key).casefold()
        for alias in MATRIX_NAMES:
            suffix = _suffix(low, alias)
            if suffix is not None and _is_intrinsic(value):
                found.append(str(key)[len(str(key)) - len(suffix) :] if suffix else "")
                break
    return list(dict.fromkeys(found))


def _suffix(key: str, alias: str) -> str | None:
    """Return what follows an alias in a key: nothing, a number, or a word after an underscore; None otherwise."""
    for spelling in (alias, alias.replace("_", "")):
        if key == spelling:
            return ""
        rest = key.removeprefix(spelling)
        if rest != key and (rest[0] in "_-" or rest.isdecimal()):
            return rest.lstrip("_-")
    return None


def _value(fields: Mapping[str, Any], aliases: tuple[str, ...], suffix: str) -> Any:
    """Return the first field of some aliases with a suffix; None where there is none."""
    by_key = {str(key).casefold(): value for key, value in fields.items()}
    for alias in aliases:
        for spelling in (alias, alias.replace("_", "")):
            for key in (spelling,) if not suffix else (f"{spelling}_{suffix}", f"{spelling}{suffix}"):
                if key.casefold() in by_key:
                    return by_key[key.casefold()]
    return None


def _is_intrinsic(value: Any) -> bool:
    data = value.get("data") if isinstance(value, Mapping) else value
    try:
        array = np.asarray(data)
    except ValueError:
        return False
    # A projection matrix, a rotation or a table is not meant; one that is damaged is, and is refused later.
    return array.size == 9 and array.dtype.kind in "iuf" and bool((array.ravel()[6:] == [0, 0, 1]).all())


def _is_fisheye(fields: Mapping[str, Any], source: str | Path, place: str, suffix: str) -> bool:
    flag = _value(fields, FISHEYE_NAMES, suffix)
    if flag is None:
        flag = _value(fields, FISHEYE_NAMES, "")
    if flag is not None and str(flag).casefold() not in ("0", "1", "true", "false"):
        raise refusal(source, f"{place}fisheye", shown(flag), "0 or 1", "correct it")
    model = _value(fields, MODEL_NAMES, suffix) or _value(fields, MODEL_NAMES, "")
    word = model.casefold() if isinstance(model, str) else ""
    if word not in FISHEYE_MODELS + PLAIN_MODELS:
        known = ", ".join(one for one in FISHEYE_MODELS + PLAIN_MODELS if one)
        raise refusal(source, f"{place}distortion_model", shown(model), known, "undistort the pictures first")
    return str(flag).casefold() in ("1", "true") or word in FISHEYE_MODELS


def _pose(
    fields: Mapping[str, Any], source: str | Path, place: str, suffix: str, unit: str | float | None
) -> tuple[Array | None, Array | None]:
    """Return R and t; neither where the file has not both: ROS calls its rectification R."""
    given_t = _value(fields, TRANSLATION_NAMES, suffix)
    rotations = [
        array
        for alias in ROTATION_NAMES
        if (value := _value(fields, (alias,), suffix)) is not None
        and (array := numbers(value, source, f"{place}R")).size in (3, 9)
    ]
    if given_t is None or not rotations:
        return None, None
    t = numbers(given_t, source, f"{place}t").ravel()
    if len(t) != 3:
        raise refusal(source, f"{place}t", f"{len(t)} numbers", "three", "correct it")
    # A matrix says what a vector says, and cannot be misread.
    chosen = max(rotations, key=lambda array: array.size)
    try:
        R = (
            rotation_from_rounded(chosen.reshape(3, 3))
            if chosen.size == 9
            else rotation_from_given_vector(chosen)
        )
    except CameraError as error:
        raise InputError(f"{source}: {one_line(place)}R: {error}; correct the file") from None
    return R, translation(t, source, f"{place}t", unit)


def _size(fields: Mapping[str, Any], suffix: str, source: str | Path, place: str) -> tuple[int, int] | None:
    """Return width and height; None where the file says neither, or zero, as ROS does of a size that is not known."""
    for end in (suffix, ""):
        pair = [_value(fields, aliases, end) for aliases in (WIDTH_NAMES, HEIGHT_NAMES)]
        given = _value(fields, SIZE_NAMES, end)
        if given is not None:
            given = given.get("data") if isinstance(given, Mapping) else given
            values = np.ravel(np.asarray(given, dtype=object))
            pair = values.tolist() if len(values) == 2 else pair
        width, height = (_side(one) for one in pair)
        if width and height:
            return width, height
        if any(one is not None for one in pair) and not width == height == 0:
            got = " and ".join("nothing" if one is None else shown(one) for one in pair)
            raise refusal(
                source, f"{place}size", got, "width and height in pixels", "correct it, or leave it out"
            )
    return None


def _side(value: Any) -> int | None:
    array = np.asarray(value)
    if array.size != 1 or array.dtype.kind not in "iuf":
        return None
    number = float(array.ravel()[0])
    return int(number) if np.isfinite(number) and number >= 0 and number.is_integer() else None


def _add(found: dict[str, CalibratedCamera], camera: CalibratedCamera, source: str | Path) -> None:
    if camera.name in found:
        raise refusal(
            source, "name", f"{shown(camera.name)} twice", "each name once", "rename one of the two"
        )
    found[camera.name] = camera
