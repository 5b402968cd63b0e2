"""Read motion capture from an NPZ, checked."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.errors import InputError
from posekit.intake import open_npz
from posekit.skeleton import JOINTS, POINTS
from posekit.synthesis.capture import Capture

MAX_BYTES = 1_000_000_000
"""What the arrays of one file may take, unpacked."""

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
UPS = {
    f"{name}{axis}": sign * np.eye(3)[k]
    for k, axis in enumerate("xyz")
    for name, sign in (("+", 1.0), ("-", -1.0))
}
KEYS = ("joints", "joint_names", "clip", "clip_names", "clip_action", "clip_fps", "up", "unit")


def read_capture(path: str | Path) -> Capture:
    """Read motion capture from an NPZ.

    Its keys are ``joints`` (T, J, 3), floats, NaN where a joint is absent; ``joint_names`` (J,), among them
    the 14 joints as posekit names them or with ``r_`` and ``l_``; ``clip_fps``, one a clip or one for all;
    and optionally ``clip`` (T,), ``clip_names`` and ``clip_action`` (C,), ``up`` (``+y``), ``unit`` (``m``).
    Other joints are left out.

    Parameters
    ----------
    path : path

    Raises
    ------
    InputError
        Where the file cannot be read, holds pickles, or a key is not as said.
    """
    arrays = _load(path)
    refuse = _Refusal(str(path))
    joints, names = _required(arrays, "joints", refuse), _words(arrays, "joint_names", refuse)
    if joints.dtype.kind != "f" or joints.ndim != 3 or joints.shape[2] != 3 or len(joints) == 0:
        raise refuse("joints", _kind(joints), "floats (T, J, 3), T of one or more")
    if joints.shape[1] != len(names):
        raise refuse("joint_names", f"{len(names)} names", f"{joints.shape[1]}, one a joint of joints")
    if np.isinf(joints).any():
        where = [int(k) for k in np.argwhere(np.isinf(joints))[0]]
        raise refuse(f"joints{where}", "an infinite number", "finite numbers, or NaN where a joint is absent")
    unit = _word(arrays, "unit", "m", tuple(UNITS), refuse)
    up = _word(arrays, "up", "+y", tuple(UPS), refuse)
    points = np.full((len(joints), len(POINTS), 3), np.nan)
    for k, column in enumerate(_columns(names, refuse)):
        if column >= 0:
            points[:, k] = UNITS[unit] * joints[:, column].astype(np.float64)
    points[np.isnan(points).any(axis=-1)] = np.nan
    return _with_clips(arrays, points, UPS[up].copy(), refuse)


def _with_clips(arrays: Mapping[str, NDArray[Any]], points: Array, up: Array, refuse: _Refusal) -> Capture:
    clip = arrays.get("clip", np.zeros(len(points), dtype=np.intp))
    if clip.dtype.kind not in "iu" or clip.shape != (len(points),):
        raise refuse("clip", _kind(clip), f"whole numbers ({len(points)},)")
    first, last = int(clip.min()), int(clip.max())
    names = tuple(str(k) for k in range(last + 1))
    if "clip_names" in arrays:
        names = _words(arrays, "clip_names", refuse)
    actions = _words(arrays, "clip_action", refuse) if "clip_action" in arrays else ("",) * len(names)
    if len(set(names)) != len(names):
        raise refuse("clip_names", "a name twice", "each clip named once")
    if len(actions) != len(names):
        raise refuse("clip_action", f"{len(actions)} for {len(names)} clips", "one a clip")
    if first < 0 or last >= len(names):
        raise refuse("clip", f"clips {first} to {last}", f"0 to {len(names) - 1}, as clip_names counts")
    fps = _required(arrays, "clip_fps", refuse)
    if fps.dtype.kind not in "fiu" or fps.shape not in {(), (1,), (len(names),)}:
        raise refuse("clip_fps", _kind(fps), f"numbers ({len(names)},), one a clip")
    rates = np.broadcast_to(fps.astype(np.float64), (len(names),)).copy()
    if not (np.isfinite(rates) & (rates > 0)).all():
        raise refuse("clip_fps", str(rates.tolist()[:5]), "positive, finite frames a second")
    return Capture(
        points=points,
        clip=clip.astype(np.intp),
        names=names,
        actions=actions,
        fps=rates,
        up=up,
        source=refuse.source,
    )


class _Refusal:
    """Words the refusal of one file's keys."""

    def __init__(self, source: str) -> None:
        self.source = source

    def __call__(self, key: str, got: str, expected: str) -> InputError:
        return InputError(f"{self.source}: {key}: got {got}; expected {expected}; correct the file")


def _load(path: str | Path) -> dict[str, NDArray[Any]]:
    """Read the arrays we know of, without pickles, and no more of them than they may declare."""
    with open_npz(path, limit=MAX_BYTES) as archive:
        return {key: archive.array(key, "iufU", None) for key in KEYS if key in archive.names}


def _required(arrays: Mapping[str, NDArray[Any]], key: str, refuse: _Refusal) -> NDArray[Any]:
    if key not in arrays:
        raise refuse(key, "nothing", f"an array; the file has {', '.join(arrays) or 'no key that is known'}")
    return arrays[key]


def _words(arrays: Mapping[str, NDArray[Any]], key: str, refuse: _Refusal) -> tuple[str, ...]:
    """Return a 1-D array of text."""
    words = _required(arrays, key, refuse)
    if words.dtype.kind != "U" or words.ndim != 1:
        raise refuse(key, _kind(words), "text of shape (K,)")
    return tuple(str(word) for word in words)


def _word(
    arrays: Mapping[str, NDArray[Any]], key: str, default: str, known: tuple[str, ...], refuse: _Refusal
) -> str:
    """Return one word of those known."""
    value = arrays.get(key, np.array(default))
    word = str(value.reshape(-1)[0]) if value.size == 1 else f"shape {value.shape}"
    word = f"+{word}" if key == "up" and f"+{word}" in known else word
    if word not in known:
        raise refuse(key, repr(word[:40]), f"one of {', '.join(known)}")
    return word


def _columns(names: tuple[str, ...], refuse: _Refusal) -> list[int]:
    """Find the column of each of posekit's points; -1 for a head point that the file has not."""
    columns = {_posekit_name(name): k for k, name in reversed(list(enumerate(names)))}
    missing = [joint for joint in JOINTS if joint not in columns]
    if missing:
        near = get_close_matches(missing[0], names, n=1)
        hint = f" (is it {near[0]!r}?)" if near else ""
        expected = f"all of {', '.join(JOINTS)}, or r_ and l_"
        raise refuse("joint_names", f"no {', no '.join(missing)}{hint}", expected)
    return [columns.get(point, -1) for point in POINTS]


def _kind(array: NDArray[Any]) -> str:
    return f"{array.dtype} of shape {array.shape}"


def _posekit_name(name: str) -> str:
    side, _, part = name.partition("_")
    return {"r": "right_", "l": "left_"}.get(side, f"{side}_") + part if part else name
