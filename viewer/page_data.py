"""What the interactive page knows: plain JSON of a result, its frames and survivors, in the page's own world."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import ViewerError
from posekit.figure import Figure, load_figure
from posekit.files.camera_model import OpenCVModel
from posekit.files.postures import Postures
from posekit.files.result import Result, ResultFrame
from posekit.files.view import View
from posekit.skeleton import HEAD_POINTS, JOINTS, PARENTS, POINTS, SEGMENTS
from posekit.viewer.colours import GROUPS, SIDES, number, side
from posekit.viewer.world import World, upright_world

Array = NDArray[np.float64]
Json = dict[str, Any]

STEPS: Final = 10_000
"""Steps a metre: positions are whole numbers of 0.1 mm, a third of the text that full ones would take."""
MOST_POSTURES: Final = 25_000
"""In one page: about 8 MB of positions."""
MARGIN_UNITS: Final = {
    "joint_range": ("°", 1.0),
    "rigid_parts": ("mm", 1000.0),
    "collision": ("mm", 1000.0),
}
"""How the margins of these checks are shown; those of others as they are."""
UNIT_LENGTH: Final = 1e-6
"""How far a quaternion may be from unit length for forward kinematics to place the head by it."""


def page_data(
    given: Result | Postures,
    view: View | None = None,
    *,
    title: str = "posekit",
    frames: Sequence[int] | None = None,
) -> Json:
    """Gather what the page shows.

    Parameters
    ----------
    given : Result or Postures
        Postures are shown as the survivors of a single frame, without margins or a tree.
    view : View, optional
        What the result was recovered from: the page then shows the image and, where it is known, the truth.
    title : str
        Shown as it is, whatever it holds.
    frames : sequence of int, optional
        Which of the result's frames, from 0; all by default.

    Returns
    -------
    dict
        Positions in whole 0.1 mm of a world whose z is up; None where a point is not known.

    Raises
    ------
    ViewerError
        Where there is no posture in any frame, too many for one page, or the view has other frames.
    """
    result = given if isinstance(given, Result) else None
    chosen = _chosen(1 if result is None else len(result.frames), frames)
    if result is not None and view is not None and len(view) != len(result.frames):
        raise ViewerError(
            f"the view has {len(view)} frames, the result {len(result.frames)}; give the view that it was "
            "recovered from"
        )
    figure = load_figure()
    if result is not None:
        bodies = [_with_head(result.frames[index], figure) for index in chosen]
    else:
        assert isinstance(given, Postures)  # noqa: S101 - narrows the type for the checker
        head = np.full((len(given.joints), len(HEAD_POINTS), 3), np.nan) if given.head is None else given.head
        bodies = [np.concatenate([given.joints, head], axis=1)]
    _check_count(bodies)
    truth = None if view is None else view.truth[chosen]
    world = upright_world(np.concatenate([body[:, : len(JOINTS)] for body in bodies]), _tilt(view))
    return {
        "title": title,
        "kind": "postures" if result is None else "result",
        "points": list(POINTS),
        "joints": len(JOINTS),
        "parents": list(PARENTS),
        "steps": STEPS,
        "colours": {name or "middle": number(colour) for name, colour in SIDES.items()},
        "groupColours": [number(colour) for colour in GROUPS],
        "pointSides": [side(name) or "middle" for name in POINTS],
        "segments": [[a, b, _segment_side(a, b)] for a, b in SEGMENTS],
        "capsules": _capsules(figure),
        "camera": {
            "position": world.t_world_cam.tolist(),
            "forward": world.R_world_cam[:, 2].tolist(),
            "right": world.R_world_cam[:, 0].tolist(),
            "down": world.R_world_cam[:, 1].tolist(),
            "pixels": view is not None and isinstance(view.camera, OpenCVModel),
        },
        "margins": [] if result is None else _margins(result.frames[0]),
        "settings": [] if result is None else _settings(result.settings),
        "frames": [
            {
                "number": index + 1,
                "points": _steps(world.place(body)),
                **({} if result is None else _frame(result.frames[index])),
                "image": None if view is None else _rows(view.image[index]),
                "headImage": None if view is None else _rows(view.head_image[index]),
                "truth": None if truth is None or np.isnan(truth[k]).all() else _steps(world.place(truth[k : k + 1]))[0],
            }
            for k, (index, body) in enumerate(zip(chosen, bodies, strict=True))
        ],
    }


def _frame(frame: ResultFrame) -> Json:
    camera = {
        name: value.tolist() if isinstance(value, np.ndarray) else value
        for name, value in frame.camera.items()
        if value is not None and name != "rotation"
    }
    reasons = sorted(frame.rejected.items(), key=lambda item: (-item[1], item[0]))
    return {
        "time": frame.time,
        "camera": camera,
        "levels": {name: list(frame.levels[name]) for name in ("joint", "physical", "motion")},
        "branches": list(frame.branches),
        "groups": None if frame.groups is None else frame.groups.tolist(),
        "margins": {name: _numbers(values) for name, values in frame.margins.items()},
        "rejected": [[*reason.partition("/")[::2], leaves] for reason, leaves in reasons],
    }


def _chosen(count: int, frames: Sequence[int] | None) -> list[int]:
    chosen = list(range(count) if frames is None else frames)
    outside = [index for index in chosen if not 0 <= index < count]
    if outside or not chosen:
        got = f"frame {outside[0]}" if outside else "none"
        raise ViewerError(f"frames: got {got}; expected some of 0 to {count - 1}")
    return chosen


def _check_count(bodies: Sequence[Array]) -> None:
    total = sum(len(body) for body in bodies)
    if total == 0:
        raise ViewerError("there is no posture in any frame; nothing can be shown; was everything rejected?")
    if total > MOST_POSTURES:
        raise ViewerError(
            f"got {total:,} postures; expected at most {MOST_POSTURES:,} in one page; choose some of the frames"
        )


def _with_head(frame: ResultFrame, figure: Figure) -> Array:
    """Return the survivors with the head (N, 19, 3): files hold the joints, and the head's turn in q."""
    points = np.full((len(frame.joints), len(POINTS), 3), np.nan)
    points[:, : len(JOINTS)] = frame.joints
    if frame.q.shape[1] != figure.model.nq:
        return points
    sound = np.isfinite(frame.q[:, :7]).all(axis=1)
    sound &= np.abs(np.linalg.norm(frame.q[:, 3:7], axis=1) - 1) < UNIT_LENGTH
    if sound.any():
        # The head hangs on the torso alone: other lengths of the limbs, or unknown angles, do not move it.
        q = np.where(np.isnan(frame.q[sound]), 0.0, frame.q[sound])
        points[sound, len(JOINTS) :] = figure.forward_kinematics(q)[:, len(JOINTS) :]
    return points


def _tilt(view: View | None) -> Array | None:
    return view.camera.R if view is not None and isinstance(view.camera, OpenCVModel) else None


def _segment_side(a: int, b: int) -> str:
    """Return the limb's side; the trunk, whose segments have no child in a limb, is in the middle."""
    name = JOINTS[max(a, b)]
    limb = any(part in name for part in ("elbow", "wrist", "knee", "ankle"))
    return side(name) if limb else "middle"


def _capsules(figure: Figure) -> list[Json]:
    """Describe the bodies relative to the distance of the points that place them: lengths differ by person."""
    neutral = figure.neutral_points
    found = []
    for capsule in figure.capsules:
        start, end = (neutral[list(points)].mean(axis=0) for points in (capsule.start, capsule.end))
        length = float(np.linalg.norm(end - start))
        found.append(
            {
                "start": list(capsule.start),
                "end": list(capsule.end),
                "center": round(capsule.center / length, 6),
                "half": round(capsule.half_length / length, 6),
                "radius": capsule.radius,
                "side": side(capsule.link) or "middle",
            }
        )
    return found


def _margins(frame: ResultFrame) -> list[Json]:
    found = []
    for name in frame.margins:
        unit, scale = MARGIN_UNITS.get(name, ("", 1.0))
        found.append({"name": name, "unit": unit, "scale": scale})
    return found


def _settings(settings: Mapping[str, Any]) -> list[list[str]]:
    def text(value: Any) -> str:
        return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False, default=str)

    return [[str(name), text(value)] for name, value in settings.items()]


def _steps(points: Array) -> list[list[int | None]]:
    """Return points (N, K, 3) as N rows of 3 K whole 0.1 mm; None where unknown."""
    steps = np.rint(points * STEPS).reshape(len(points), -1)
    return [[None if value != value else int(value) for value in row] for row in steps.tolist()]


def _rows(points: Array) -> list[list[float] | None]:
    return [None if np.isnan(point).any() else [float(f"{value:.6g}") for value in point] for point in points]


def _numbers(values: Array) -> list[float | None]:
    return [None if value != value else float(f"{value:.6g}") for value in values.tolist()]


__all__ = ["MARGIN_UNITS", "MOST_POSTURES", "STEPS", "Json", "World", "page_data"]
