"""Points in space that detectors write beside, or in place of, key points in pictures: MediaPipe's and MMPose's JSON.

MediaPipe's ``pose_world_landmarks`` are metres from the middle of the hips, y down (MediaPipe, *Pose landmark
detection*). MMPose's pose lifters write ``keypoints`` of three coordinates (open-mmlab/mmpose,
demo/body3d_pose_lifter_demo.py). Several people are one clip each where the file tracks them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from posekit.formats.given_file import GivenFile
from posekit.formats.keypoints.mediapipe_json import WORLD_LANDMARKS_NAMES, frames_of_document
from posekit.formats.keypoints.mediapipe_names import LANDMARK_NAMES, TIME_NAMES, in_seconds, one_of
from posekit.formats.keypoints.mmpose import names_of_points
from posekit.formats.keypoints.mmpose_instances import is_frame
from posekit.formats.keypoints.rows import number
from posekit.formats.motion.motion import Motion
from posekit.formats.motion.motion_format import METRES_IN_UNIT
from posekit.formats.motion.motion_table import recorded_rate
from posekit.formats.motion.unnamed_points import named_points
from posekit.geometry import Array
from posekit.safe_io import refusal, shown

MOST_PEOPLE: Final = 1000


class PersonInSpace(NamedTuple):
    """A person of a frame: its number, who it is (empty where it is not tracked), and the points (P, 3)."""

    frame: int
    track: str
    points: Array


def read_detected(path: Path, format: str, unit: str | None = None) -> Motion:
    """Read a detector's points in space.

    Parameters
    ----------
    path : Path
        The file.
    format : str
        ``mediapipe``, ``mmpose`` or ``mmpose-list``.
    unit : str, optional
        Of the coordinates; metres if not given.

    Raises
    ------
    InputError
        Where it has no points in space, several people that are not tracked, or points that are none.
    """
    given = GivenFile(path)
    if given.is_folder or not given.is_json:
        got = "key points in pictures"
        raise refusal(path, "", got, "points in space", "recover them, and give the result")
    times: Array = np.empty(0)
    names: tuple[str, ...] = ()
    if format == "mediapipe":
        people, times = _world_landmarks(path, given.document)
        names = LANDMARK_NAMES
    else:
        people = _lifted(path, given.document)
        if isinstance(given.document, dict):
            names = tuple(names_of_points(path, given.document.get("meta_info")))
    if not people:
        expected = (
            "points in space: pose_world_landmarks of MediaPipe, or three coordinates a point of MMPose"
        )
        raise refusal(path, "", "key points in pictures alone", expected, "recover them, and give the result")
    return _motion(path, people, names, times, unit, up="-y" if format == "mediapipe" else "")


def _motion(
    path: Path,
    people: Sequence[PersonInSpace],
    names: tuple[str, ...],
    times: Array,
    unit: str | None,
    *,
    up: str,
) -> Motion:
    tracks = _tracks(path, people)
    frames = [sorted({one.frame for one in people if one.track == track}) for track in tracks]
    pairs = [(track, frame) for track, seen in zip(tracks, frames, strict=True) for frame in seen]
    row = {pair: k for k, pair in enumerate(pairs)}
    widths = {len(one.points) for one in people}
    if len(widths) > 1 or (names and widths != {len(names)}):
        got = f"{' and '.join(map(str, sorted(widths)))} points a person"
        raise refusal(path, "keypoints", got, f"{len(names) or 'one number'}, of all", "save the file again")
    points = np.full((len(row), widths.pop(), 3), np.nan)
    for one in people:
        points[row[one.track, one.frame]] = one.points
    clip = np.repeat(np.arange(len(tracks)), [len(one) for one in frames])
    said: tuple[str, ...] = ()
    if not names:
        names, points, word = named_points(points, str(path))
        said = (word,)
    count = np.concatenate([np.asarray(one, dtype=np.intp) for one in frames])
    time = times[count] if len(times) else np.full(len(row), np.nan)
    rates = np.array([recorded_rate(time[clip == k]) for k in range(len(tracks))])
    return Motion(
        names=names,
        points=METRES_IN_UNIT[unit or "m"] * points,
        time=time,
        rate=float(rates[0]),
        up=up,
        source=str(path),
        clip=clip,
        clips=tuple(f"person {track}" if track else "" for track in tracks),
        rates=rates,
        as_recorded=True,
        told=("unit",) if unit else (),
        said=said,
    )


def _tracks(path: Path, people: Sequence[PersonInSpace]) -> list[str]:
    """List who is in the file; refuse several people of a frame that are not told apart."""
    tracks = list(dict.fromkeys(one.track for one in people))
    seen: set[tuple[str, int]] = set()
    for one in people:
        if (one.track, one.frame) in seen:
            remedy = "track them (track_id), or keep one person a frame"
            raise refusal(path, f"frame {one.frame}", "several people", "one, or people with tracks", remedy)
        seen.add((one.track, one.frame))
    if len(tracks) > MOST_PEOPLE:
        raise refusal(path, "", f"{len(tracks)} people", f"at most {MOST_PEOPLE}", "split the file")
    return tracks


def _world_landmarks(path: Path, document: Any) -> tuple[list[PersonInSpace], Array]:
    people: list[PersonInSpace] = []
    frames = frames_of_document(document)
    times, unit = np.full(len(frames), np.nan), ""
    for index, frame in enumerate(frames):
        if not isinstance(frame, dict):
            continue
        if field := one_of(frame, TIME_NAMES):
            times[index], unit = number(frame[field]), field.lower().replace("_", "")
        field = one_of(frame, WORLD_LANDMARKS_NAMES)
        found = frame[field] if field else None
        for landmarks in _people_in(found):
            points = _points(path, f"frame {index}.{field}", landmarks)
            people.append(PersonInSpace(index, "", points))
    return people, in_seconds(times, unit)


def _people_in(found: Any) -> Iterator[Any]:
    """Yield each person's landmarks: of a list of them, of people, or of an object that holds one."""
    if isinstance(found, dict):
        found = next((value for key, value in found.items() if key.startswith("landmark")), None)
    if not isinstance(found, list) or not found:
        return
    nested = isinstance(found[0], list) and bool(found[0]) and isinstance(found[0][0], list | dict)
    yield from found if nested else [found]


def _points(path: Path, field: str, found: Any) -> Array:
    """Read points (P, 3) as [x, y, z, …] or {x, y, z}; null, or no number, is a missing one."""
    if not isinstance(found, list) or len(found) > MOST_PEOPLE:
        raise refusal(path, field, shown(found), "a list of points [x, y, z] or {x, y, z}", "save it again")
    points = np.full((len(found), 3), np.nan)
    for k, entry in enumerate(found):
        values = [entry.get(axis) for axis in "xyz"] if isinstance(entry, Mapping) else entry
        if entry is None:
            continue
        if not isinstance(values, list) or len(values) < 3:
            raise refusal(path, f"{field}[{k}]", shown(entry), "[x, y, z] or {x, y, z}", "save it again")
        points[k] = [number(value) for value in values[:3]]
    if np.isinf(points).any():
        raise refusal(path, field, "an infinite number", "finite numbers", "save it again")
    points[np.isnan(points).any(axis=1)] = np.nan
    return points


def _lifted(path: Path, document: Any) -> list[PersonInSpace]:
    """Read MMPose's people whose points have three coordinates."""
    frames = document.get("instance_info") if isinstance(document, dict) else document
    if not isinstance(frames, list):
        raise refusal(path, "instance_info", shown(frames), "a list", "save it with --save-predictions")
    people: list[PersonInSpace] = []
    for index, frame in enumerate(frames if frames and is_frame(frames[0]) else [{"instances": frames}]):
        instances = frame.get("instances") if isinstance(frame, dict) else None
        if not isinstance(instances, list):
            raise refusal(
                path, f"[{index}]", shown(frame), "a picture {frame_id, instances}", "save it again"
            )
        for place, instance in enumerate(instances):
            found = instance.get("keypoints") if isinstance(instance, dict) else None
            if isinstance(found, list) and len(found) == 1 and _is_nested(found[0]):
                found = found[0]
            if not (isinstance(found, list) and found and isinstance(found[0], list) and len(found[0]) == 3):
                continue
            track = instance.get("track_id")
            field = f"[{index}].instances[{place}].keypoints"
            people.append(
                PersonInSpace(index, "" if track is None else str(track)[:40], _points(path, field, found))
            )
    return people


def _is_nested(found: Any) -> bool:
    return isinstance(found, list) and bool(found) and isinstance(found[0], list)
