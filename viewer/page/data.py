"""What the interactive page knows: a result, its frames and survivors, in the page's own world."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from math import isnan
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure, with_head
from posekit.errors import ViewerError
from posekit.formats.held_postures import HeldPostures
from posekit.formats.own.camera_model import LeeChenModel, ScaledOrthographicModel
from posekit.formats.own.postures import Postures
from posekit.formats.own.result import Result, ResultFrame
from posekit.formats.own.view import View
from posekit.geometry import cross
from posekit.skeleton import JOINT, JOINTS, POINTS, SEGMENTS
from posekit.viewer.page.answer_page import answer_data, answer_segments, image_distances
from posekit.viewer.page.family_page import family_data, inferred_data, tree_of, walk
from posekit.viewer.page.findings_page import PageFindings
from posekit.viewer.page.hand_page import flips_of, units_of, verdicts
from posekit.viewer.page.packed import branch_bits, origins, packed, steps
from posekit.viewer.page.paths_page import paths_shown
from posekit.viewer.page.rejected_page import rejected_shown
from posekit.viewer.page.shown_survivors import postures_shown, survivors_shown
from posekit.viewer.scene.colours import ALARM_RGB, GROUP_RGB, SIDE_RGB, number, side
from posekit.viewer.scene.drawn_subject import DrawnSubject, Shown, subject_of
from posekit.viewer.scene.world import CAMERA_UPRIGHT, World, upright_world

Array = NDArray[np.float64]
Json = dict[str, Any]

MOST_REASONS: Final = 60
"""Reasons of rejection that are told of each frame, the most frequent."""

OUTLYING_SHARE: Final = 0.1
"""Share of a result's frames that may be below the ground: the likeliest posture of one frame can be wrong."""

FRAMES_THAT_TELL: Final = 10
"""From so many frames on trunks tell how a camera is tilted that does not say it."""

ALIKE_TRUNKS: Final = 0.9
"""Length of the mean of the trunks' directions, of unit length each, from which on they lean one way."""

LEVEL_COSINE: Final = 0.94
"""Trunks that lean by less than 20 degrees, on average, may do so by themselves."""

STEEP_SINE: Final = 0.995
"""A camera that looks straight down does not see how tall anybody stands."""

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
    findings: PageFindings | None = None,
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
    findings : PageFindings, optional
        What checks found in postures that are no result's.

    Returns
    -------
    dict
        Positions in whole steps from each frame's origin, in a world whose z is up: ``step`` says their metres.

    Raises
    ------
    ViewerError
        Where there is no posture in any frame, or the view has other frames.
    """
    if isinstance(given, Result):
        return _result_data(given, view, title, frames)
    shown = postures_shown(given)
    subject = subject_of(shown)
    chosen = _chosen(len(subject.frames), frames)
    picked = [subject.frames[index] for index in chosen]
    bodies = [one.aligned_points for one in picked]
    _check_count(bodies)
    world = _world(bodies, subject.R_cam_world, outlying=0.0)
    numbers = findings.numbers() if findings is not None else {}
    of_frame = _numbers_in_frames(shown, chosen)
    step, arrays, starts = _packed_bodies([world.place(body) for body in bodies])
    arrays["number"] = packed(np.concatenate(of_frame).astype(np.uint32))
    counts = [len(body) for body in bodies]
    return {
        **_of_figure(subject.figure, world, title),
        "kind": "motion" if len(chosen) > 1 and max(counts) == 1 else "postures",
        "judged": findings is not None,
        "findings": [] if findings is None else findings.described(),
        "left": len(_joints(given)) - len(_joints(shown)),
        **_recordings(shown),
        "step": step,
        "packed": arrays,
        "frames": [
            {
                "number": index,
                "count": count,
                "held": count,
                **starts[k],
                **({} if isnan(picked[k].time) else {"time": picked[k].time}),
                **_findings_of(numbers, rows),
                **_recording_of(shown, rows),
            }
            for k, (index, count, rows) in enumerate(zip(chosen, counts, of_frame, strict=True))
        ],
    }


def _result_data(given: Result, view: View | None, title: str, frames: Sequence[int] | None) -> Json:
    chosen = _chosen(len(given.frames), frames)
    kept = survivors_shown(given, chosen)
    result = kept.result
    if not any(len(rows) for rows in kept.rows):
        raise ViewerError("there is no posture in any frame; nothing can be shown; was everything rejected?")
    subject = subject_of(result, view)
    shown = [subject.frames[index] for index in chosen]
    bodies = [one.aligned_points for one in shown]
    paths = paths_shown(given.paths, chosen, kept.rows, bodies, [one.alignment for one in shown])
    likeliest = [body[:1] for body in bodies] if paths is None else list(paths.points[0][:, None])
    R_cam_world = _upright(likeliest, subject.R_cam_world)
    world = _world(likeliest, R_cam_world, outlying=OUTLYING_SHARE)
    truth = None if view is None else _truth(result, view, subject, chosen)
    rejected = [rejected_shown(result, subject, index, world) for index in chosen]
    placed = [world.place(body) for body in bodies]
    extra = [
        [each.points for each in rejected],
        [] if truth is None else [world.place(truth[k : k + 1]) for k in range(len(chosen))],
        [] if paths is None else [world.place(paths.points[:, k]) for k in range(len(chosen))],
    ]
    step, arrays, starts = _packed_bodies(placed, extra)
    arrays |= _packed_columns([result.frames[index] for index in chosen], kept.rows)
    told: Json = {}
    if paths is not None:
        arrays["pathSurvivor"] = packed(np.ascontiguousarray(paths.survivor.T))
        arrays["pathBridged"] = packed(np.ascontiguousarray(_bits(paths.bridged).T))
        told["paths"] = {"probability": _numbers(paths.probability), "words": paths.words}
    reasons: dict[str, int] = {}
    for index in chosen:
        for reason in given.frames[index].rejected:
            reasons.setdefault(reason, len(reasons))
    whole = [given.frames[index] for index in chosen]
    pruned, judged = verdicts(whole, reasons)
    arrays |= pruned
    units = units_of(whole)
    levels = result.frames[0].levels["joint"]
    return {
        **_of_figure(subject.figure, world, title),
        **told,
        "kind": "result",
        "judged": False,
        "findings": [],
        "left": sum(kept.counts) - sum(len(row) for row in kept.rows),
        "refined": any(given.frames[index].refined is not None for index in chosen),
        "deviation": _deviation(given.settings),
        "tree": tree_of(levels),
        "flips": flips_of(walk(levels), levels) | {"frames": len(given.frames)},
        "upright": "" if subject.R_cam_world is not None else "level" if R_cam_world is None else "trunks",
        "camera": _camera(world) | {"parallel": any(given.frames[k].family is not None for k in chosen)},
        "margins": _margins(result.frames[0]),
        "settings": _settings(given.settings),
        "reasons": [[*reason.partition("/")[::2], units.get(reason, "")] for reason in reasons],
        "answerSegments": answer_segments(),
        "step": step,
        "packed": arrays,
        "frames": [
            {
                "number": index,
                "count": kept.counts[k],
                "held": len(kept.rows[k]),
                **starts[k],
                **_frame(given.frames[index], kept.rows[k], reasons),
                **judged[k],
                **_uncalibrated(result.frames[index], shown[k], world),
                **_image(result.frames[index], shown[k], view, index),
                **({"picture": given.pictures[index]} if given.pictures else {}),
                "examples": [reasons.get(reason, -1) for reason in rejected[k].reasons],
            }
            for k, index in enumerate(chosen)
        ],
    }


def _of_figure(figure: Figure, world: World, title: str) -> Json:
    return {
        "title": title,
        "points": list(POINTS),
        "joints": len(JOINTS),
        "colours": {name or "middle": number(colour) for name, colour in SIDE_RGB.items()}
        | {"alarm": number(ALARM_RGB)},
        "groupColours": [number(colour) for colour in GROUP_RGB],
        "pointSides": [side(name) or "middle" for name in POINTS],
        "segments": [[a, b, _segment_side(a, b)] for a, b in SEGMENTS],
        "capsules": _capsules(figure),
        "tree": None,
        "upright": "",
        "camera": _camera(world) | {"parallel": False},
        "margins": [],
        "settings": [],
        "reasons": [],
        "paths": None,
    }


def _camera(world: World) -> Json:
    axes = {"right": 0, "down": 1, "forward": 2}
    placed = {name: world.R_world_cam[:, k].tolist() for name, k in axes.items()}
    return {"position": world.t_world_cam.tolist(), **placed}


def _world(bodies: Sequence[Array], R_cam_world: Array | None, *, outlying: float) -> World:
    """Stand the world on the likeliest postures, but for those that are lower than the rest."""
    R = CAMERA_UPRIGHT if R_cam_world is None else R_cam_world.T
    joints = [body[:, : len(JOINTS)] for body in bodies]
    lowest = np.array([_least((one @ R.T)[..., 2]) for one in joints])
    if outlying and np.isfinite(lowest).sum() > 1:
        least = np.nanquantile(lowest, outlying)
        joints = [one for one, low in zip(joints, lowest.tolist(), strict=True) if low >= least]
    return upright_world(np.concatenate(joints), R_cam_world)


def _upright(bodies: Sequence[Array], R_cam_world: Array | None) -> Array | None:
    """Return the rotation from a world whose z is up: the view's, else by the trunks where they all lean one way."""
    if R_cam_world is not None or len(bodies) < FRAMES_THAT_TELL:
        return R_cam_world
    trunks = np.concatenate([body[:, JOINT["neck"]] - body[:, JOINT["pelvis"]] for body in bodies])
    trunks = trunks[np.isfinite(trunks).all(axis=1)]
    if len(trunks) < FRAMES_THAT_TELL:
        return None
    mean = (trunks / np.linalg.norm(trunks, axis=1, keepdims=True)).mean(axis=0)
    alike = float(np.linalg.norm(mean))
    up = mean / alike
    if alike < ALIKE_TRUNKS or -up[1] > LEVEL_COSINE or abs(up[2]) > STEEP_SINE:
        return None
    ahead = np.array([0.0, 0.0, 1.0]) - up[2] * up
    ahead /= np.linalg.norm(ahead)
    return np.array([ahead, cross(up, ahead), up]).T


def _least(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(known.min()) if len(known) else float("nan")


def _packed_bodies(
    bodies: Sequence[Array], extra: Sequence[Sequence[Array]] = ()
) -> tuple[float, Json, list[Json]]:
    """Pack points in the world, with those of rejected branches, of the truth and of paths."""
    together = [
        np.concatenate([body, *(one[k] for one in extra if len(one))]) for k, body in enumerate(bodies)
    ]
    found, step = origins(together)

    def text(parts: Sequence[Array]) -> dict[str, str]:
        return packed(np.concatenate([steps(part, found[k], step) for k, part in enumerate(parts)]))

    arrays: Json = {"points": text(bodies)}
    for name, parts in zip(("rejected", "truth", "paths"), extra, strict=False):
        if len(parts) and sum(map(len, parts)):
            arrays[name] = text(parts)
    starts = []
    first = examples = 0
    for k, body in enumerate(bodies):
        starts.append(
            {
                "origin": [round(value, 6) for value in found[k].tolist()],
                "first": first,
                "firstExample": examples,
            }
        )
        first += len(body)
        examples += len(extra[0][k]) if extra and extra[0] else 0
    return step, arrays, starts


def _packed_columns(frames: Sequence[ResultFrame], rows: Sequence[NDArray[np.intp]]) -> Json:
    """Pack what is known of each survivor: frame after frame."""
    arrays: Json = {
        "number": packed(np.concatenate(rows).astype(np.uint32)),
        "branches": packed(np.concatenate([branch_bits(frame.branches) for frame in frames])),
    }
    for name, kind in (("groups", np.uint32), ("probability", np.float32)):
        if getattr(frames[0], name) is not None:
            arrays[name] = packed(np.concatenate([getattr(frame, name) for frame in frames]).astype(kind))
    for k, name in enumerate(frames[0].margins):
        arrays[f"margin{k}"] = packed(
            np.concatenate([frame.margins[name] for frame in frames]).astype(np.float32)
        )
    return arrays


def _frame(frame: ResultFrame, rows: NDArray[np.intp], reasons: Mapping[str, int]) -> Json:
    rejected = sorted(frame.rejecting.items(), key=lambda item: (-item[1], item[0]))
    return {
        "time": frame.time,
        "levels": {name: list(frame.levels[name]) for name in ("joint", "physical", "motion")},
        "answer": answer_data(frame, rows),
        "unlisted": float(f"{frame.unlisted_probability:.3g}"),
        "rejected": [[reasons[reason], leaves] for reason, leaves in rejected[:MOST_REASONS]],
        "notListed": sum(frame.rejected.values()) - sum(frame.rejecting.values()),
        "rejectedMore": sum(leaves for _, leaves in rejected[MOST_REASONS:]),
    }


def _findings_of(findings: Mapping[int, list[list[float]]], rows: NDArray[np.intp]) -> Json:
    found = {str(k): findings[row] for k, row in enumerate(rows.tolist()) if row in findings}
    return {"findings": found} if found else {}


def _recordings(given: Postures | HeldPostures) -> Json:
    """Return the names of a file's recordings, where it has several."""
    if isinstance(given, HeldPostures) and len(given.clips) > 1:
        return {"clips": list(given.clips)}
    return {}


def _recording_of(given: Postures | HeldPostures, rows: NDArray[np.intp]) -> Json:
    if isinstance(given, Postures) or len(given.clips) < 2 or not len(rows):
        return {}
    return {"clip": int(given.clip[rows[0]])}


def _joints(given: Postures | HeldPostures) -> Array:
    return given.joints if isinstance(given, Postures) else given.postures.joints


def _numbers_in_frames(given: Postures | HeldPostures, frames: Sequence[int]) -> list[NDArray[np.intp]]:
    """Return the number of each posture in its file, frame by frame."""
    if isinstance(given, Postures):
        return [np.arange(len(given.joints))]
    return [np.flatnonzero(given.frame == index) for index in frames]


def _deviation(settings: Mapping[str, Any]) -> float | None:
    """Return the noise of the image points that a result was recovered with, in the image's unit."""
    noise = settings.get("noise")
    value = noise.get("deviation") if isinstance(noise, Mapping) else None
    return float(value) if isinstance(value, int | float) else None


def _bits(flags: NDArray[np.bool_]) -> NDArray[np.uint16]:
    """Return flags (..., 14) as bits, the first the lowest."""
    return np.asarray((flags * (1 << np.arange(flags.shape[-1]))).sum(axis=-1), dtype=np.uint16)


def _uncalibrated(frame: ResultFrame, shown: Shown, world: World) -> Json:
    """Return what a frame has where its camera is not calibrated, or where joints were not seen."""
    found: Json = {}
    family = family_data(frame, shown, world, walk(frame.levels["joint"]))
    if family is not None:
        found["family"] = family
    if frame.inferred is not None:
        found["inferred"] = inferred_data(frame)
    return found


def _truth(result: Result, view: View, subject: DrawnSubject, chosen: Sequence[int]) -> Array:
    """Return the true postures; of an uncalibrated view they are moved to where the survivors are drawn."""
    truth = with_head(np.array(view.truth[list(chosen)]))
    for row, index in enumerate(chosen):
        shown = subject.frames[index]
        if result.frames[index].family is None or not len(shown):
            continue
        # Depth is relative, and so is the place in a picture whose scale is another one.
        moves = shown.points[0, : len(JOINTS)] - truth[row, : len(JOINTS)]
        known = np.asarray(np.isfinite(moves).all(axis=1))
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
    if not any(len(body) for body in bodies):
        raise ViewerError("there is no posture in any frame; nothing can be shown; was everything rejected?")


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


def _image(frame: ResultFrame, shown: Shown, view: View | None, index: int) -> Json:
    """Return the image points, as wide as the view's pixels, and how far the likeliest posture's image is off."""
    if view is None:
        return {} if shown.sight is None else {"image": _rows(shown.sight.image)}
    width = view.camera.aspect if isinstance(view.camera, ScaledOrthographicModel) else 1.0
    points = np.concatenate([view.image[index], view.head_image[index], view.own_head_image[index]])
    found: Json = {"image": _rows(points * [width, 1.0])}
    if len(frame.joints) and not isinstance(view.camera, LeeChenModel):
        away = image_distances(frame.joints[0], shown.sight)
        if np.isfinite(away).any():
            found["off"] = [float(f"{of(away):.3g}") for of in (np.nanmedian, np.nanmax)]
    return found


def _rows(points: Array) -> list[list[float] | None]:
    return [None if np.isnan(point).any() else [float(f"{value:.6g}") for value in point] for point in points]


def _numbers(values: Array) -> list[float | None]:
    return [None if isnan(value) else float(f"{value:.6g}") for value in values.tolist()]
