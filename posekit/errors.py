"""Error classes, and one-line error messages: source, field, value, expected values, remedy."""

from __future__ import annotations

import difflib
import inspect
import json
import math
from collections.abc import Callable, Collection, Iterable
from functools import wraps
from os import PathLike
from typing import Final, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")

#: Largest number of characters of a value or a name in a message.
MAX_SHOWN_CHARACTERS: Final = 60

#: Largest number of characters of a message; the middle of a longer message is cut.
MAX_LINE_CHARACTERS: Final = 500

#: Words of other programs, and posekit's names of the same options, arguments, fields and commands.
MEANT: Final = {
    **dict.fromkeys(("fps", "framerate", "frame_rate", "frequency", "hz"), ("rate",)),
    **dict.fromkeys(("skeleton", "format", "joint_names", "keypoint_names"), ("layout",)),
    **dict.fromkeys(("robot", "model"), ("urdf", "figure")),
    **dict.fromkeys(("intrinsics", "calibration", "k"), ("camera",)),
    **dict.fromkeys(("noise_px", "sigma", "noise"), ("deviation",)),
    **dict.fromkeys(("units", "unit_of_length"), ("unit",)),
    **dict.fromkeys(("out", "path", "filename"), ("output", "target")),
    **dict.fromkeys(("check", "judge"), ("checks", "validate")),
    **dict.fromkeys(("draw", "plot"), ("render",)),
    "openpose": ("body_25",),
    "height": ("stature",),
    "floor": ("ground",),
    "limits": ("ranges",),
    "resolution": ("size",),
    "info": ("inspect",),
}


class PosekitError(Exception):
    """Base class of all errors that posekit raises on purpose.

    Examples
    --------
    >>> try:
    ...     raise InputError("walk.bvh: MOTION: got text; expected numbers; correct it")
    ... except PosekitError as error:
    ...     print(error)
    walk.bvh: MOTION: got text; expected numbers; correct it
    """


class InputError(PosekitError):
    """A file or an argument violates its schema.

    Examples
    --------
    >>> raise refusal("walk.bvh", "Frame Time", "0", "seconds above 0", "give --rate")
    Traceback (most recent call last):
    posekit.errors.InputError: walk.bvh: Frame Time: got 0; expected seconds above 0; give --rate
    """


class TooLargeError(InputError):
    """A file or an array is larger than the largest size that posekit reads and writes."""


class FigureError(InputError):
    """Segment lengths or a URDF do not describe a possible human figure."""


class HeadError(InputError):
    """The head points, or their image points, do not determine the pose of the head in the camera frame."""


class CameraError(InputError):
    """A parameter of a camera, such as its focal length, is missing or impossible."""


class ViewerError(PosekitError):
    """A picture, a plot or a page cannot be made."""


def refusal(
    source: str | PathLike[str],
    field: str,
    got: str,
    expected: str,
    remedy: str = "correct it",
    *,
    error: type[InputError] = InputError,
) -> InputError:
    """Build an error with the one-line message ``SOURCE: FIELD: got VALUE; expected …; REMEDY``.

    Parameters
    ----------
    source : path or str
        The file, or another origin of the value; empty if the origin is unknown.
    field : str
        Path of the value in the source, such as ``frames[3].image.left_elbow``; empty if the whole source is refused.
    got : str
        The value, as `shown` writes it.
    expected : str
        The values that are accepted.
    remedy : str
        The user's next step.
    error : type, default `InputError`
        Class of the error.

    Examples
    --------
    >>> print(refusal("view.json", "camera.f", shown(-1.0), "a positive number", "give it in metres"))
    view.json: camera.f: got -1.0; expected a positive number; give it in metres
    """
    places = [str(place) for place in (source, field) if str(place)]
    return error(bounded(one_line(": ".join([*places, f"got {got}; expected {expected}; {remedy}"]))))


def one_line(text: str) -> str:
    """Escape unprintable characters, including line ends."""
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in text)


def bounded(text: str) -> str:
    """Cut a long message in its middle, so that source and field at its start, and remedy at its end, remain."""
    half = MAX_LINE_CHARACTERS // 2
    return text if len(text) <= MAX_LINE_CHARACTERS else f"{text[:half]} … {text[3 - half :]}"


def shown(value: object) -> str:
    """Write a value as JSON does, cut to a readable length, on one line."""
    if isinstance(value, dict):
        names = [cut(json.dumps(str(key))) for key in list(value)[:3]]
        return f"an object of {len(value)} entries ({', '.join(names)}{', …' if len(value) > 3 else ''})"
    if isinstance(value, list | tuple):
        if len(value) <= 6 and not any(isinstance(entry, list | tuple | dict) for entry in value):
            return "[" + ", ".join(shown(entry) for entry in value) + "]"
        return f"a list of {len(value)} entries"
    if isinstance(value, str):
        return cut(json.dumps(value[: MAX_SHOWN_CHARACTERS + 1]))
    if value is None or isinstance(value, bool) or (isinstance(value, float) and not math.isfinite(value)):
        return json.dumps(value)
    return cut(str(value))


def cut(text: str) -> str:
    """Shorten a text to `MAX_SHOWN_CHARACTERS`."""
    return text if len(text) <= MAX_SHOWN_CHARACTERS else text[: MAX_SHOWN_CHARACTERS - 1] + "…"


def nearest(name: str, names: Iterable[str], otherwise: str = "", mark: str = "") -> str:
    """Suggest valid names for an unknown name: names with similar spelling, or synonyms (`MEANT`).

    If no valid name is similar, return `otherwise`; if `otherwise` is empty, return a list of all valid names.
    `mark` stands before each suggestion, as ``--`` before options.
    """
    valid = list(names)
    given = name[:MAX_SHOWN_CHARACTERS]
    parts = given.lower().replace("-", "_").split("_")
    words = {word: [one for one in ours if one in valid] for word, ours in MEANT.items()}
    words = {word: ours for word, ours in words.items() if ours} | {one: [one] for one in valid}
    near = (
        words.get("_".join(parts))
        or [one for one in valid if one == "-".join(reversed(parts))]
        or [one for one in valid if one in parts]
        or dict.fromkeys(
            one for word in difflib.get_close_matches(given.lower(), words) for one in words[word]
        )
    )
    if near:
        return f"did you mean {' or '.join(mark + one for one in near)}?"
    return otherwise or f"valid names are {', '.join(valid)}"


def check_names(
    owner: str, given: Iterable[str], known: Collection[str], *, kind: str, expected: str
) -> None:
    """Raise an error that suggests the right name if a given name is not known."""
    for name in given:
        if name not in known:
            raise refusal(owner, name, f"an unknown {kind}", expected, nearest(name, known))


def names_checked(function: Callable[P, T]) -> Callable[P, T]:
    """Decorate a public function, so that an unknown keyword argument raises an error that suggests the right name."""
    known = [name for name in inspect.signature(function).parameters if name != "self"]
    public = function.__qualname__.removesuffix(".__init__")

    @wraps(function)
    def called(*args: P.args, **kwargs: P.kwargs) -> T:
        check_names(public, kwargs, known, kind="argument", expected="a known argument")
        return function(*args, **kwargs)

    return called
