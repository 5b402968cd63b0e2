"""Collect the data of a page: bodies of each frame in a world frame with z up, findings and probabilities."""

from __future__ import annotations

import json
import re
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure, load_figure
from posekit.body.capsules import CAPSULE_AXES
from posekit.cameras import ScaledOrthographicCamera, View
from posekit.errors import refusal
from posekit.geometry import Array
from posekit.motion import Motion
from posekit.recovery import Recovery
from posekit.robots import Robot
from posekit.skeleton import JOINTS, POINTS, SEGMENTS, TREE_SEGMENTS
from posekit.validators import Report, Validator
from posekit.validators.report import quantity
from posekit.viewer import subjects as drawn

Json = dict[str, Any]

#: Largest number of frames of motion in a page; beyond it, the page has only the worst clips.
MOST_FRAMES: Final = 20_000

MOST_POSTURES: Final = 60_000
#: Largest numbers of survivors in a page and in one frame: the most probable survivors, and further representatives.
MOST_OF_FRAME: Final = 400

MOST_CLIPS: Final = 300
MOST_SPANS: Final = 40
#: Largest numbers of listed clips of a report, spans of a clip, and reasons of rejection in a frame.
MOST_REASONS: Final = 60

#: Points are stored as integers relative to the origin of their frame: code of an unknown point, largest integer, and
#: smallest step, metres.
UNKNOWN, LARGEST, FINEST = -32_768, 32_767, 1e-4

#: Radius of the lines that represent a robot's links, metres.
LINK_RADIUS: Final = 0.025

#: Height of the lowest joint above the ground, metres.
SOLE: Final = 0.03

#: Share of frames that may lie below the drawn ground, so that single wrong frames do not lower it.
LOW_SHARE: Final = 0.05

#: Unit and factor in which the margins of these checks are shown.
MARGIN_UNITS: Final = {"joint-range": ("°", 1.0), "rigid-parts": ("mm", 1e3), "collision": ("mm", 1e3)}

#: Palette of Okabe & Ito, one colour per group.
GROUP_COLOURS: Final = (0x009E73, 0xCC79A7, 0x56B4E9, 0xD55E00, 0xF0E442, 0x0072B2, 0xE69F00, 0x505050)

#: Minimum depth difference at which a joint is described as nearer or farther, metres.
CLEARLY_NEARER: Final = 0.05


def page_data(
    source: Recovery | Motion | Report,
    title: str,
    *,
    view: Any = None,
    frame: int | tuple[int, int] | None = None,
    urdf: str = "",
) -> Json:
    """Collect the data of a page; see `posekit.viewer.page.write_page`.

    Returns
    -------
    dict
        Data as lists, numbers, text. ``packed`` has arrays as base64; points are integer multiples of ``step`` metres,
        relative to the ``origin`` of their frame.
    """
    if isinstance(source, Recovery):
        return _of_result(source, title, view if isinstance(view, View) else None, frame)
    if isinstance(source, Report):
        motions = (
            [] if view is None or isinstance(view, View) else [view] if isinstance(view, Motion) else view
        )
        count = sum(len(one) for one in motions)
        if motions and count != len(source):
            raise refusal(
                "render", "view", f"{count} frames", f"{len(source)} as in the report", "give its motions"
            )
        return _of_motions(motions, source, title, urdf)
    motion = source.take(drawn.frame_rows(len(source), frame, source.source))
    return _of_motions([motion], _judged(motion, urdf), title, urdf)


def _judged(motion: Motion, urdf: str) -> Report:
    """Check a motion with the default checks. Without a joint map, check each configuration of the robot separately."""
    robot, q = drawn.configured(motion, urdf)
    if isinstance(robot, Figure):
        return Validator().check(motion)
    return Validator(robot).check(replace(motion, q=q, q_names=robot.configuration_names))


def _of_motions(motions: Sequence[Motion], report: Report, title: str, urdf: str) -> Json:
    """Collect motions and their report; the rows of the report are the frames of the motions, clip by clip."""
    summary = _summary(report)
    if not motions:
        return {"kind": "report", "title": title, "frames": [], **summary}
    bodies = [drawn.configured(motion, urdf) for motion in motions]
    robot = bodies[0][0]
    alike = len({tuple(one.model.names) for one, _ in bodies}) == 1
    parts: list[Array] = []
    for motion, (one, q) in zip(motions, bodies, strict=True):
        R = drawn.facing(one, q, drawn.upright(motion))
        order = np.argsort(np.asarray(motion.clip), kind="stable")
        # The 14 joints are common to people and all robots.
        parts.append((_points(motion, one, q) if alike else _joints(one, q))[order] @ R.T)
    points, skeleton = np.concatenate(parts), _skeleton(robot if alike else load_figure())
    rows = _kept(report)
    # Alternative postures of a frame are consecutive rows.
    changes = (np.diff(report.clip[rows]) != 0) | (np.diff(report.frame[rows]) != 0)
    groups = np.split(rows, np.flatnonzero(changes) + 1)
    frames: list[Json] = []
    for group in groups:
        frames.append(
            {"number": int(report.frame[group[0]]), "clip": int(report.clip[group[0]]), "count": len(group)}
        )
        frames[-1]["held"] = len(group)
        if np.isfinite(report.time[group[0]]):
            frames[-1]["time"] = round(float(report.time[group[0]]), 6)
    places = _add_findings(frames, groups, report, skeleton["points"])
    kept = {(one["clip"], one["number"]): k for k, one in reversed(list(enumerate(frames)))}
    for clip in summary["clips"]:
        for span in clip["spans"]:
            span["index"] = kept.get((clip["clip"], span["worst"]), -1)
    return {
        "kind": "motion" if 1 < len(frames) == len(rows) else "postures",
        "title": title,
        "front": -np.pi / 2,
        "left": len(points) - len(rows),
        "places": places,
        **skeleton,
        **_packed(_grounded([points[group] for group in groups])[0], frames),
        **summary,
    }


def _kept(report: Report) -> NDArray[np.intp]:
    """Return the rows to store in the page: all rows, or the rows of the worst clips."""
    if len(report) <= MOST_FRAMES:
        return np.arange(len(report))
    order = np.argsort([-one.severity for one in report.clips], kind="stable")
    counts = np.cumsum(np.bincount(report.clip, minlength=len(order))[order])
    kept = np.flatnonzero(np.isin(report.clip, order[counts <= MOST_FRAMES]))
    return kept if len(kept) else np.arange(MOST_FRAMES)


def _points(motion: Motion, robot: Robot, q: Array) -> Array:
    """Return the points (T, P, 3) to draw: joints and head points of a figure, or links of a robot."""
    if isinstance(robot, Figure):
        if motion.joints is None:
            return robot.forward_kinematics(q)
        return np.concatenate([motion.figure_joints, motion.head], axis=1)
    return drawn.link_places(robot, q)


def _joints(robot: Robot, q: Array) -> Array:
    """Return the joints of a body as points (T, 19, 3); head points and missing joints are NaN."""
    known = np.isfinite(q).all(axis=1)
    joints = np.full((len(q), len(JOINTS), 3), np.nan)
    joints[known] = robot.points(q[known])[:, : len(JOINTS)]
    return _with_head(joints)


def _skeleton(robot: Robot) -> Json:
    """Return the segments between points, and the capsules, with sizes relative to their segment lengths."""
    colours = {name: red << 16 | green << 8 | blue for name, (red, green, blue) in drawn.COLOURS.items()}
    shared: Json = {"colours": {**colours, "alarm": 0xD4006A}, "groupColours": GROUP_COLOURS}
    if isinstance(robot, Figure):
        neutral, bodies = robot.neutral_points, []
        for one in robot.capsules:
            start, end = (neutral[list(points)].mean(axis=0) for points in (one.start, one.end))
            length = float(np.linalg.norm(end - start))
            bodies.append(
                {
                    "start": one.start,
                    "end": one.end,
                    "center": round(one.center / length, 6),
                    "half": round(one.half_length / length, 6),
                    "radius": one.radius,
                    "side": drawn.side(one.link),
                }
            )
        limbs = ("elbow", "wrist", "knee", "ankle")
        segments = [
            [a, b, drawn.side(JOINTS[b]) if JOINTS[max(a, b)].endswith(limbs) else "middle"]
            for a, b in SEGMENTS
        ]
        names, count = list(POINTS), len(JOINTS)
    else:
        frames, model = drawn.link_frames(robot), robot.model
        names, segments = [model.frames[k].name for k in frames], []
        count = len(names)
        for child, k in enumerate(frames):
            above = model.frames[k].parentFrame
            while above and above not in frames:
                above = model.frames[above].parentFrame
            if above in frames and above != k:
                segments.append([frames.index(above), child, drawn.side(names[child])])
        usual = drawn.link_places(robot, robot.neutral[None])[0]
        bodies = [
            {"start": [a], "end": [b], "center": 0.5, "half": 0.5, "radius": LINK_RADIUS, "side": side}
            for a, b, side in segments
            if np.linalg.norm(usual[a] - usual[b]) > LINK_RADIUS
        ]
    return {
        **shared,
        "points": names,
        "joints": count,
        "figure": isinstance(robot, Figure),
        "pointSides": [drawn.side(name) for name in names],
        "segments": segments,
        "capsules": bodies,
    }


def _grounded(bodies: Sequence[Array]) -> tuple[list[Array], Array]:
    """Move bodies onto z = 0 with the first known body above x = y = 0; return them and the displacement (3,)."""
    low = [float(np.nanmin(one[:1, :, 2])) for one in bodies if np.isfinite(one[:1, :, 2]).any()]
    if not low:
        raise refusal("render", "", "no known joint in any frame", "at least one", "give a known posture")
    first = next(one for one in bodies if np.isfinite(one).any())
    shift = np.array([*-np.nanmean(first[0], axis=0)[:2], SOLE - float(np.quantile(low, LOW_SHARE))])
    return [one + shift for one in bodies], shift


def _packed(
    bodies: Sequence[Array], frames: Sequence[Json], extra: Mapping[str, Sequence[Array]] | None = None
) -> Json:
    """Pack points (H, P, 3) of each frame, and the points `extra`, as integers relative to the origin of the frame."""
    origins, widest, first = [], 0.0, 0
    for k, body in enumerate(bodies):
        both = np.concatenate([body, *(one[k] for one in (extra or {}).values())]).reshape(-1, 3)
        known = both[np.isfinite(both).all(axis=1)]
        low, high = (known.min(axis=0), known.max(axis=0)) if len(known) else (np.zeros(3), np.zeros(3))
        origins.append(np.round((low + high) / 2, 6))
        widest = max(widest, float((high - low).max()) / 2)
        frames[k].update(origin=origins[k].tolist(), first=first)
        first += len(body)
    step = max(FINEST, widest / LARGEST)

    def whole(parts: Sequence[Array]) -> Json:
        counted = [
            np.where(np.isfinite(one).all(axis=-1, keepdims=True), np.rint((one - origin) / step), UNKNOWN)
            for one, origin in zip(parts, origins, strict=True)
        ]
        return packed(np.concatenate(counted).astype(np.int16))

    arrays = {"points": whole(bodies), **{name: whole(parts) for name, parts in (extra or {}).items()}}
    return {"step": step, "packed": arrays, "frames": list(frames)}


def packed(values: NDArray[Any]) -> Json:
    """Pack an array as little-endian base64 and the name of its type."""
    plain = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
    return {"type": values.dtype.name, "base64": b64encode(plain.tobytes()).decode("ascii")}


def _summary(report: Report) -> Json:
    """Collect the decision, the numbers of rejected frames by check, and the clips, the worst first."""
    checks = []
    for name, one in report.by_check().items():
        checks.append({"name": name, **one, "message": str(report.messages.get(name, ""))})
    every = report.clips
    order = sorted(range(len(every)), key=lambda k: (every[k].decision == "keep", -every[k].severity))
    clips = []
    for k in order[:MOST_CLIPS]:
        clip = every[k]
        spans = [
            {name: getattr(span, name) for name in ("check", "first", "last", "verdict")}
            | {"text": str(span), "worst": span.worst_frame, "index": -1}
            for span in clip.spans[:MOST_SPANS]
        ]
        name = " ".join(part for part in (_short(clip.file), clip.name) if part)
        clips.append(
            {field: getattr(clip, field) for field in ("decision", "reason", "frames", "good")}
            | {"clip": k, "name": name, "path": clip.title, "bad": clip.invalid + clip.undecided}
            | {"spans": spans, "more": len(clip.spans) - len(spans)}
        )
    lines = [f"warning: {one}" for one in report.warnings] + list(report.notes)
    lines += [f"unreadable: {one}" for one in report.refused]
    for why in dict.fromkeys(report.not_asked.values()):
        names = [name for name, one in report.not_asked.items() if one == why]
        lines.append(f"not asked: {', '.join(names)}: {why}")
    return {
        "judged": True,
        "decision": report.decision,
        "valid": int(report.ok.sum()),
        "asked": len(report),
        "checks": checks,
        "clips": clips,
        "moreClips": max(len(report.clips) - MOST_CLIPS, 0),
        "notes": lines,
        "settings": _settings(report.settings),
    }


def _short(file: str) -> str:
    """Return the last two parts of a path, which distinguish clips in a list."""
    return "/".join(file.replace("\\", "/").split("/")[-2:])


def _add_findings(
    frames: Sequence[Json], rows: Sequence[NDArray[np.intp]], report: Report, names: Sequence[str]
) -> list[Json]:
    """Add the findings of each posture as (place number, value, bound); return the list of places."""
    found = report.findings
    places: dict[tuple[int, str], tuple[int, Json]] = {}
    starts = np.searchsorted(found["row"], np.arange(len(report) + 1))
    for one, mine in zip(frames, rows, strict=True):
        for k, row in enumerate(mine.tolist()):
            for cell in range(starts[row], starts[row + 1]):
                check, place = int(found["check"][cell]), report.places[found["place"][cell]]
                if (check, place) not in places:
                    entry = {"check": report.checks[check], "where": place, "joints": joints_of(place, names)}
                    places[check, place] = (len(places), entry)
                value, low, high = (float(found[name][cell]) for name in ("value", "lower", "upper"))
                numbers = (value, low if value < low else high)
                text = [quantity(x, report.units[check]) if np.isfinite(x) else "" for x in numbers]
                mine_of = one.setdefault("findings", {}).setdefault(str(k), [])
                mine_of.append([places[check, place][0], *text])
    return [entry for _, entry in places.values()]


def joints_of(place: str, names: Sequence[str]) -> list[int]:
    """Return the numbers of the points at the place of a finding: joints, segment ends, or links of a robot.

    Examples
    --------
    >>> from posekit.skeleton import POINTS
    >>> joints_of("right_elbow.flexion", POINTS), joints_of("left_forearm-torso", POINTS)
    ([6], [0, 3, 7, 9])
    """
    found: set[int] = set()
    for word in re.split(r"[.\-/ ]+", place):
        if word in names:
            found.add(names.index(word))
        elif word in CAPSULE_AXES and "neck" in names:
            found.update(k for ends in CAPSULE_AXES[word] for k in ends if k < len(JOINTS))
    return sorted(found)


def _settings(settings: Mapping[str, Any]) -> list[list[str]]:
    plain = ((name, one) for name, one in settings.items() if one is not None)
    return [[str(name), one if isinstance(one, str) else json.dumps(one, default=str)] for name, one in plain]


def _of_result(
    recovery: Recovery, title: str, view: View | None, frame: int | tuple[int, int] | None
) -> Json:
    drawn.frame_with_postures(recovery, None)
    chosen: list[int] = drawn.frame_rows(len(recovery), frame, recovery.source).tolist()
    if view is not None and len(view) != len(recovery):
        expected = f"{len(recovery)} as in the result"
        raise refusal("render", "--view", f"{len(view)} frames", expected, "give the view of the result")
    table, answer = recovery.survivors, recovery.answer
    most = min(MOST_OF_FRAME, max(20, MOST_POSTURES // len(chosen)))
    points = np.concatenate([table.joints, np.asarray(table.head)], axis=1)
    R = drawn.upright_camera(view)
    kept: list[NDArray[np.intp]] = []
    frames: list[Json] = []
    reasons: dict[str, int] = {}
    survivor = np.asarray(answer.survivor)
    for k in chosen:
        start, stop = recovery.rows(k).start, recovery.rows(k).stop
        best = [int(survivor[k])] if survivor[k] >= 0 else []
        standing = np.array([*answer.representatives[k], *best], dtype=np.intp)
        rows = np.unique(np.concatenate([np.arange(start, min(stop, start + most)), standing]))
        kept.append(rows)
        frames.append(_frame(recovery, k, rows, reasons))
        if view is not None:
            frames[-1]["image"] = _image(view, k)
    bodies, shift = _grounded([points[rows] @ R.T for rows in kept])
    every = np.concatenate(kept)
    extra: dict[str, list[Array]] = {}
    if view is not None and np.isfinite(view.truth).any():
        truth = np.array(view.truth)[chosen]
        if not view.camera.perspective:  # depth and scale are relative: the truth is moved onto the answer
            truth += np.nanmean(answer.joints[chosen] - truth, axis=1, keepdims=True)
        extra["truth"] = [_with_head(one[None]) @ R.T + shift for one in truth]
    paths = recovery.path
    if paths is not None and len(paths):
        extra["paths"] = [_with_head(paths.joints[:, k]) @ R.T + shift for k in chosen]
    data = _packed(bodies, frames, extra)
    start_of = np.array([recovery.rows(k).start for k in chosen])
    data["packed"] |= {
        "number": packed((every - np.repeat(start_of, [len(rows) for rows in kept])).astype(np.uint32)),
        "probability": packed(np.asarray(table.probability)[every].astype(np.float32)),
        "inferred": packed(
            (np.asarray(table.inferred)[every] * (1 << np.arange(len(JOINTS)))).sum(axis=1).astype(np.uint16)
        ),
        "radius": packed(
            np.clip(np.nan_to_num(np.asarray(table.radius)[every]) * 1000, 0, 65535).astype(np.uint16)
        ),
        **{
            f"margin{k}": packed(one[every].astype(np.float32))
            for k, one in enumerate(table.margins.values())
        },
    }
    groups = np.asarray(table.group)[every]
    if (groups >= 0).any():
        data["packed"]["groups"] = packed(groups.astype(np.int32))
    parallel = recovery.camera.get("type", "") == "scaled-orthographic" or (
        view is not None and isinstance(view.camera, ScaledOrthographicCamera)
    )
    axes = dict(zip(("right", "down", "forward"), R.T.tolist(), strict=True))
    return {
        "kind": "result",
        "title": title,
        **_skeleton(load_figure().scaled(recovery.lengths)),
        "front": -np.pi / 2,
        "camera": {"position": shift.tolist(), **axes, "parallel": bool(parallel)},
        "margins": [_margin(name) for name in table.margins],
        "treeSegments": TREE_SEGMENTS,
        "settings": _settings(recovery.settings),
        "reasons": [reason.partition("/")[::2] for reason in reasons],
        "paths": None
        if "paths" not in extra
        else {
            "probability": [float(f"{p:.4g}") for p in paths.probability],  # type: ignore[union-attr]
            "survivor": [[int(row) for row in paths.survivor[:, k]] for k in chosen],  # type: ignore[union-attr]
        },
        "judged": False,
        "left": sum(int(recovery.rows(k).stop) - int(recovery.rows(k).start) for k in chosen) - len(every),
        **data,
    }


def _margin(name: str) -> Json:
    unit, scale = MARGIN_UNITS.get(name, ("", 1.0))
    return {"name": name, "unit": unit, "scale": scale}


def _with_head(joints: Array) -> Array:
    """Append NaN head points to joints (H, 14, 3)."""
    return np.concatenate([joints, np.full((len(joints), len(POINTS) - len(JOINTS), 3), np.nan)], axis=1)


def _frame(recovery: Recovery, k: int, rows: NDArray[np.intp], reasons: dict[str, int]) -> Json:
    """Collect the data of one frame; `rows` are the survivors that the page stores."""
    seen, answer, one = recovery.frames, recovery.answer, recovery[k]
    place = {row: number for number, row in enumerate(rows.tolist())}
    rejected = sorted(seen.rejected[k].items(), key=lambda item: (-item[1], item[0]))
    time = float(seen.time[k])
    found: Json = {
        "number": k,
        "count": len(one),
        "held": len(rows),
        "unlisted": float(f"{np.asarray(seen.unlisted_probability)[k]:.3g}"),
        "unlistedCount": int(np.asarray(seen.unlisted)[k]),
        "reason": seen.reason[k],
        "levels": list(seen.levels[k]),
        "rejected": [
            [reasons.setdefault(name, len(reasons)), int(count)] for name, count in rejected[:MOST_REASONS]
        ],
        "rejectedMore": int(sum(count for _, count in rejected[MOST_REASONS:])),
    }
    if np.isfinite(time):
        found["time"] = round(time, 6)
    if seen.pictures:
        found["picture"] = str(seen.pictures[k])
    if not len(rows):
        return found
    best = int(np.asarray(answer.survivor)[k])
    found["best"] = place.get(best, 0)
    sure, nearer_sure = float(answer.sure[k]), np.asarray(answer.nearer_sure)[k]
    if np.isfinite(sure):
        found |= {"sure": float(f"{sure:.4g}"), "sureOf": answer.sure_of[k]}
    found["nearer"] = np.asarray(answer.nearer)[k].tolist()
    found["nearerSure"] = [None if np.isnan(p) else round(float(p), 3) for p in nearer_sure]
    stands = answer.representatives[k].tolist()
    joints = recovery.survivors.joints
    found["representatives"] = [
        {"at": place[row], "p": float(f"{p:.4g}"), "how": _difference(joints[stands[0]], joints[row])}
        for row, p in zip(stands[:6], np.asarray(answer.represented[k])[:6], strict=False)
    ]
    found["moreRepresentatives"] = max(len(stands) - 6, 0)
    return found


def _difference(first: Array, other: Array) -> str:
    """Describe which joints of a posture (14, 3) are nearer to the camera, or farther, than in the first posture."""
    depths = [np.array([one[b, 2] - one[a, 2] for a, b in TREE_SEGMENTS]) for one in (first, other)]
    change = np.nan_to_num(depths[1] - depths[0])
    order = [int(k) for k in np.argsort(-np.abs(change)) if abs(change[k]) > CLEARLY_NEARER][:2]
    words = [f"{JOINTS[TREE_SEGMENTS[k][1]]} {'farther' if change[k] > 0 else 'nearer'}" for k in order]
    return ", ".join(words).replace("_", " ")


def _image(view: View, k: int) -> list[list[float] | None]:
    """Return the image points of a frame, scaled to square pixels."""
    aspect = view.camera.aspect if isinstance(view.camera, ScaledOrthographicCamera) else 1.0
    points = np.concatenate([view.image[k], view.head_image[k]]) * [aspect, 1.0]
    return [None if np.isnan(one).any() else [float(f"{value:.6g}") for value in one] for one in points]
