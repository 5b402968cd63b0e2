"""What the interactive page knows: plain JSON of a result, its frames and survivors, in the page's own world."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from math import isnan
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.answers import written_answer
from posekit.answers.wording import answer_lines
from posekit.body import Figure
from posekit.errors import ViewerError
from posekit.formats.held_postures import HeldPostures
from posekit.formats.own.camera_model import ScaledOrthographicModel
from posekit.formats.own.postures import Postures
from posekit.formats.own.result import Result, ResultFrame
from posekit.formats.own.view import View
from posekit.ranking import deviation_of_tolerance
from posekit.skeleton import JOINT, JOINTS, POINTS, SEGMENTS
from posekit.viewer.page.family_page import family_data, inferred_data, tree_of, walk
from posekit.viewer.scene.colours import GROUP_RGB, SIDE_RGB, number, side
from posekit.viewer.scene.drawn_subject import DrawnSubject, Shown, subject_of
from posekit.viewer.scene.world import World, upright_world

Array = NDArray[np.float64]
Json = dict[str, Any]

STEPS_PER_METRE: Final = 10_000
"""Steps a metre: positions are whole numbers of 0.1 mm, a third of the text that full ones would take."""
MOST_POSTURES: Final = 25_000
"""In one page: about 8 MB of positions."""
MARGIN_UNITS: Final = {
    "joint_range": ("°", 1.0),
    "rigid_parts": ("mm", 1000.0),
    "collision": ("mm", 1000.0),
}
"""How the margins of these checks are shown; those of others as they are."""


def page_data(
    given: Result | Postures | HeldPostures,
    view: View | None = None,
    *,
    title: str = "posekit",
    frames: Sequence[int] | None = None,
) -> Json:
    """Gather what the page shows.

    Parameters
    ----------
    given : Result, Postures or HeldPostures
        Postures are shown as the survivors of a single frame, or of their frames, without margins or a tree.
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
    subject = subject_of(given, view)
    chosen = _chosen(len(subject.frames), frames)
    bodies = [subject.frames[index].aligned_points for index in chosen]
    _check_count(bodies)
    truth = None if view is None else _truth(result, view, subject, chosen)
    world = upright_world(np.concatenate([body[:, : len(JOINTS)] for body in bodies]), subject.R_cam_world)
    return {
        "title": title,
        "kind": "postures" if result is None else "result",
        "points": list(POINTS),
        "joints": len(JOINTS),
        "steps": STEPS_PER_METRE,
        "colours": {name or "middle": number(colour) for name, colour in SIDE_RGB.items()},
        "groupColours": [number(colour) for colour in GROUP_RGB],
        "pointSides": [side(name) or "middle" for name in POINTS],
        "segments": [[a, b, _segment_side(a, b)] for a, b in SEGMENTS],
        "capsules": _capsules(subject.figure),
        "tree": None if result is None else tree_of(result.frames[0].levels["joint"]),
        "level": result is not None and subject.R_cam_world is None,
        "camera": {
            "parallel": result is not None and any(frame.family is not None for frame in result.frames),
            "position": world.t_world_cam.tolist(),
            "forward": world.R_world_cam[:, 2].tolist(),
            "right": world.R_world_cam[:, 0].tolist(),
            "down": world.R_world_cam[:, 1].tolist(),
        },
        "margins": [] if result is None else _margins(result.frames[0]),
        "settings": [] if result is None else _settings(result.settings),
        "frames": [
            {
                "number": index,
                **(_time(subject.frames[index]) if isinstance(given, HeldPostures) else {}),
                "points": _steps(world.place(body)),
                **({} if result is None else _frame(result.frames[index])),
                **(
                    {}
                    if result is None
                    else _uncalibrated(result.frames[index], subject.frames[index], world)
                ),
                "image": _image(subject.frames[index], view, index),
                "truth": None if truth is None else _steps(world.place(truth[k : k + 1]))[0],
            }
            for k, (index, body) in enumerate(zip(chosen, bodies, strict=True))
        ],
    }


def _time(shown: Shown) -> Json:
    """Return when postures of a file are, where it says that."""
    return {} if isnan(shown.time) else {"time": shown.time}


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
        "probability": None if frame.probability is None else _numbers(frame.probability),
        "answer": _answer(frame),
        "margins": {name: _numbers(values) for name, values in frame.margins.items()},
        "rejected": [[*reason.partition("/")[::2], leaves] for reason, leaves in reasons],
    }


def _answer(frame: ResultFrame) -> list[str]:
    """Tell the frame's answer: the likeliest posture, how sure it is, and what else it can be."""
    if frame.probability is None:
        return []
    return answer_lines([written_answer(frame, float(deviation_of_tolerance(0.0)))])


def _uncalibrated(frame: ResultFrame, shown: Shown, world: World) -> Json:
    """Return what a frame has where its camera is not calibrated, or where joints were not seen."""
    found: Json = {}
    family = family_data(frame, shown, world, walk(frame.levels["joint"]))
    if family is not None:
        found["family"] = family
    if frame.inferred is not None:
        found["inferred"] = inferred_data(frame)
    return found


def _truth(result: Result | None, view: View, subject: DrawnSubject, chosen: Sequence[int]) -> Array:
    """Return the true postures; of an uncalibrated view they are moved to where the survivors are drawn."""
    truth = np.array(view.truth[chosen])
    for row, index in enumerate(chosen):
        shown = subject.frames[index]
        if result is None or result.frames[index].family is None or not len(shown):
            continue
        # Depth is relative, and so is the place in a picture whose scale is another one.
        moves = shown.points[0, : len(JOINTS)] - truth[row]
        known = np.isfinite(moves).all(axis=1)
        if known.any():
            root = JOINT.get(result.frames[index].levels["joint"][0], 0)
            root = root if known[root] else int(np.argmax(known))
            truth[row] += [*moves[known, :2].mean(axis=0), moves[root, 2]]
    return truth


def _chosen(count: int, frames: Sequence[int] | None) -> list[int]:
    wanted: Sequence[int] = range(count) if frames is None else frames
    if not 0 < len(wanted) <= count or min(wanted) < 0 or max(wanted) >= count:
        raise ViewerError(
            f"frames: got some that do not exist, or none; there are {count}; choose among them"
        )
    return list(wanted)


def _check_count(bodies: Sequence[Array]) -> None:
    total = sum(len(body) for body in bodies)
    if total == 0:
        raise ViewerError("there is no posture in any frame; nothing can be shown; was everything rejected?")
    if total > MOST_POSTURES:
        raise ViewerError(
            f"got {total:,} postures; expected at most {MOST_POSTURES:,} in one page; choose some of the frames"
        )


def _segment_side(a: int, b: int) -> str:
    """Return the limb's side; the trunk, whose segments have no child in a limb, is in the middle."""
    name = JOINTS[max(a, b)]
    limb = any(part in name for part in ("elbow", "wrist", "knee", "ankle"))
    return side(name) if limb else "middle"


def _capsules(figure: Figure) -> list[Json]:
    """Describe the bodies relative to the distance of the points that place them: a measured limb may differ."""
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
    steps = np.rint(points * STEPS_PER_METRE).reshape(len(points), 3 * points.shape[1])
    return [[None if isnan(value) else int(value) for value in row] for row in steps.tolist()]


def _image(shown: Shown, view: View | None, index: int) -> list[list[float] | None] | None:
    """Return the 19 image points, as wide as the view's pixels: the view's, or those of the result's own camera."""
    if view is not None:
        width = view.camera.aspect if isinstance(view.camera, ScaledOrthographicModel) else 1.0
        return _rows(np.concatenate([view.image[index], view.head_image[index]]) * [width, 1.0])
    return None if shown.sight is None else _rows(shown.sight.image)


def _rows(points: Array) -> list[list[float] | None]:
    return [None if np.isnan(point).any() else [float(f"{value:.6g}") for value in point] for point in points]


def _numbers(values: Array) -> list[float | None]:
    return [None if isnan(value) else float(f"{value:.6g}") for value in values.tolist()]
