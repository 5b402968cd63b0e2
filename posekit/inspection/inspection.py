"""What is in a file: which format, who, which joints are missing, how sure."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from posekit.cameras.calibrated import CalibratedCamera
from posekit.display.plural import plural
from posekit.errors import InputError
from posekit.formats import own as files
from posekit.formats.cameras import read_cameras
from posekit.formats.format import Content
from posekit.formats.held_postures import configurations_of
from posekit.formats.keypoints import KeyPoints, check_sides, choose, list_people
from posekit.formats.markdown import table_lines
from posekit.formats.motion import Motion, guess_up, motion_format, postures_of, read_motion, read_survivors
from posekit.formats.own import OpenCVModel, ScaledOrthographicModel, View
from posekit.formats.recognising import recognise
from posekit.formats.skeleton_maps import LANDMARK_ORDER, load_skeleton_map
from posekit.geometry import Array
from posekit.skeleton import JOINTS, POINTS
from posekit.views.opening import read_detections
from posekit.views.source import Source

MOST_PEOPLE = 12
"""People that are listed."""


def inspect(path: Path, source: Source, *, unit: str = "") -> list[str]:
    """Describe a file in some lines; results, batches and reports: `posekit.inspection`.

    Raises
    ------
    InputError
        Where it cannot be read, or is of no format that is known.
    """
    what = recognise(path, source.format)
    lines = [f"{path}: {what.title}"]
    if what.holds is Content.KEY_POINTS:
        return lines + _key_points(read_detections(path, source))
    if what.holds is Content.MOTION:
        if what.names and motion_format(what.names[0]).read is None:
            return [*lines, f"{motion_format(what.names[0]).title}: written, and not read by itself"]
        named = what.names[0] if what.names else None
        if named == "amass":
            return [
                *lines,
                "angles of a body model; posekit validate --body-model FILE.npz places its joints",
            ]
        motion = read_motion(path, named, unit=unit or None, as_recorded=True)
        return lines + _motion(motion, source.skeleton)
    if what.holds is Content.CAMERAS:
        return lines + [_camera(camera) for camera in read_cameras(path).values()]
    if what.holds is Content.VIEW:
        return lines + _view(files.read_view(path))
    if what.holds is Content.POSTURES:
        return lines + _postures(files.read_postures(path).joints)
    if what.holds is Content.SURVIVORS:
        table = read_survivors(path)
        return [*lines, plural(len(np.unique(table.frame)), "frame"), *_postures(table.joints)]
    if what.holds is Content.ROBOT:
        from posekit.robots import load_robot

        robot = load_robot(path)
        can = (
            f"{plural(len(robot.collision_pairs), 'pair')} of which"
            if robot.collision_pairs
            else "no pair of which"
        )
        return [
            *lines,
            f"{plural(robot.model.njoints - 1, 'joint')}, {robot.model.nq} numbers in a configuration, "
            f"{plural(len(robot.body_names), 'collision body')}, {can} can collide",
        ]
    if what.holds is Content.CONFIGURATIONS:
        found = configurations_of(path, what)
        variables = f" of {_listed(found.names)}" if found.names else ""
        return [*lines, f"{plural(len(found), 'configuration')}{variables}", *found.said]
    return lines


def _key_points(found: KeyPoints) -> list[str]:
    pictures, counts = len(found.pictures), np.bincount(found.frame, minlength=len(found.pictures))
    sizes = np.unique(found.size, axis=0)
    size = (
        f"{sizes[0, 0]:.0f}x{sizes[0, 1]:.0f} pixels"
        if len(sizes) == 1 and np.isfinite(sizes).all()
        else "of unknown size"
        if np.isnan(sizes).all()
        else "of different sizes"
    )
    fewest, most = (int(counts.min()), int(counts.max())) if pictures else (0, 0)
    lines = [
        f"{plural(pictures, 'picture')} {size}, {plural(len(found), 'detection')}, {fewest} to {most} a "
        f"picture; {plural(len(found.layout.points), 'point')}: {found.layout.name}"
    ]
    if found.normalised:
        lines.append("points are fractions of the picture: --size WIDTHxHEIGHT makes them pixels")
    if not len(found):
        return lines
    people = list_people(found)
    head = ("person", "pictures", "from", "to", "confidence", "landmarks seen", "size")
    rows = [
        (
            one.person,
            one.pictures,
            one.first,
            one.last,
            "-" if np.isnan(one.confidence) else f"{one.confidence:.2f}",
            f"{one.seen * 100:.0f} %",
            f"{one.height:.0f} px" if not found.normalised else f"{one.height:.2f}",
        )
        for one in people[:MOST_PEOPLE]
    ]
    lines += ["", *table_lines(head, rows)]
    if len(people) > MOST_PEOPLE:
        lines += [f"and {len(people) - MOST_PEOPLE} more people", ""]
    one = choose(found, "largest")
    same = len(np.unique(one.person)) == 1
    lines += [f"person {int(one.person[0])} (the largest):" if same else "the largest in each picture:", ""]
    lines += _seen(one.landmarks, one.landmark_confidence)
    return lines + [line.partition(": ")[2] for line in check_sides(one).warnings]


def _seen(landmarks: Array, sure: Array) -> list[str]:
    rows = []
    for k, name in enumerate(LANDMARK_ORDER):
        there = np.isfinite(landmarks[:, k, 0])
        known = sure[there, k]
        known = known[np.isfinite(known)]
        quantiles = "-"
        if len(known):
            quantiles = " / ".join(f"{value:.2f}" for value in np.quantile(known, (0.05, 0.5)))
        rows.append((name, f"{there.mean() * 100:.0f} %", quantiles))
    return table_lines(("landmark", "seen", "confidence, 5 % / median"), rows)


def _motion(motion: Motion, skeleton: str) -> list[str]:
    spans = [np.ptp(motion.time[motion.clip == k]) for k in np.unique(motion.clip)]
    seconds = float(sum(spans))
    clips = f" in {plural(len(motion.clips), 'clip')}" if len(motion.clips) > 1 else ""
    up = f"{motion.up} up" if motion.up else "which way is up is not said"
    rate = f"{motion.rate:g} a second ({seconds:.2f} s)" if np.isfinite(seconds) else "no rate that is known"
    lines = [
        f"{plural(len(motion), 'frame')}{clips} at {rate}, {plural(len(motion.names), 'point')}, {up}",
        *motion.said,
        f"points: {_listed(motion.names)}",
    ]
    try:
        found = postures_of(motion, load_skeleton_map(skeleton) if skeleton else None)
    except InputError as error:
        return [*lines, f"no posture: {error}"]
    derived = f"; {' and '.join(found.derived)} placed from shoulders and hips" if found.derived else ""
    lines.append(f"skeleton map {found.layout.name}{derived}")
    if not motion.up:
        try:
            lines.append(f"{guess_up(found.joints, motion.source)} is up by where heads and ankles are")
        except InputError as error:
            lines.append(str(error))
    return lines + _postures(found.joints)


def _postures(joints: Array) -> list[str]:
    missing = np.isnan(joints[..., 0]).mean(axis=0)
    absent = [
        f"{name} ({share * 100:.0f} %)" for name, share in zip(JOINTS, missing, strict=True) if share > 0
    ]
    return [f"{plural(len(joints), 'posture')}; missing joints: {', '.join(absent) or 'none'}"]


def _camera(camera: CalibratedCamera) -> str:
    size = "" if camera.size is None else f", {camera.size[0]}x{camera.size[1]} pixels"
    lens = (
        "fisheye"
        if camera.fisheye
        else f"{plural(int(np.count_nonzero(camera.distortion)), 'coefficient')} of distortion"
    )
    place = "placed in a world" if camera.t is not None else "in no world"
    f = f"f {camera.K[0, 0]:.1f} x {camera.K[1, 1]:.1f} px"
    guess = f" ({camera.deviation * 100:.0f} % uncertain)" if camera.deviation else ""
    return f"{camera.name}: {camera.how}, {f}{guess}{size}, {lens}, {place}"


def _view(view: View) -> list[str]:
    kind = {OpenCVModel: "opencv", ScaledOrthographicModel: "scaled-orthographic"}.get(
        type(view.camera), "lee-chen"
    )
    seen = np.isfinite(np.concatenate([view.image, view.head_image, view.own_head_image], axis=1)[..., 0])
    points = (*POINTS, *view.own_head_names)
    missing = [name for name, there in zip(points, seen.any(axis=0).tolist(), strict=True) if not there]
    known = {
        "root": np.isfinite(view.root[:, 0]).sum(),
        "truth": np.isfinite(view.truth).any(axis=(1, 2)).sum(),
        "confidence": np.isfinite(view.confidence).any(axis=1).sum(),
    }
    rows = [
        (name, f"{share * 100:.0f} %") for name, share in zip(points, seen.mean(axis=0).tolist(), strict=True)
    ]
    more = ", ".join(f"{name} in {count}" for name, count in known.items())
    derived = f"; placed from other points: {', '.join(view.derived)}" if view.derived else ""
    return [
        f"{plural(len(view), 'frame')}, camera {kind}; {more}",
        f"never seen: {', '.join(missing) or 'nothing'}{derived}",
        "",
        *table_lines(("point", "seen"), rows),
    ]


def _listed(names: Sequence[str], most: int = 30) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
