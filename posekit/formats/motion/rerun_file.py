"""RRD: recordings for Rerun's viewer (rerun.io), with a timeline in frames and one in seconds.

Entities: ``world/NAME`` with the points or the likeliest posture as a skeleton, ``world/NAME/others`` with what else it
can be, the fainter the less likely, ``world/camera`` with its intrinsics, what it saw and the picture, ``findings``.
Right limbs are orange and left ones blue. Written by the extra ``rerun``; the viewer is the command ``rerun FILE``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from posekit.formats.motion.motion import Motion
from posekit.formats.motion.motion_checks import the_one_clip
from posekit.formats.motion.motion_format import MotionFormat
from posekit.geometry import Array
from posekit.safe_io import extra, refusal, replacing
from posekit.skeleton import JOINTS, TREE_SEGMENTS

if TYPE_CHECKING:
    from posekit.formats.own import View

WRITTEN_BY_RERUN: Final = ("rerun", "rerun", "writing .rrd")
RRD_MAGIC: Final = b"RRF"
"""How such a file begins."""
MAX_OTHERS: Final = 60
"""Postures of a frame beside the likeliest: more cannot be told apart."""
FRAME_TIMELINE, SECONDS_TIMELINE = "frame", "seconds"
LATEST_SECONDS: Final = 9.2e9
"""Rerun counts nanoseconds in 64 bits."""
RIGHT_RGB, LEFT_RGB, MIDDLE_RGB = (230, 159, 0), (0, 114, 178), (154, 154, 154)
"""Okabe & Ito's, which the colour-blind tell apart."""
LINE_METRES, FAINT_LINE_METRES, POINT_METRES = 0.012, 0.004, 0.015
FAINTEST_ALPHA, MOST_ALPHA = 16, 110
"""Of postures that are not the likeliest, of 255."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedFrame:
    """What is recorded of one frame.

    Parameters
    ----------
    time : float
        Seconds.
    postures : array (K, 14, 3)
        The likeliest first, metres; NaN where a joint is not known.
    probability : array (K,), optional
        Of each; all the same if empty.
    says : str
        What is said of the frame.
    picture : bytes
        The photograph that it came from, JPEG; none if empty.
    """

    time: float
    postures: Array
    probability: Array = field(default_factory=lambda: np.empty(0))
    says: str = ""
    picture: bytes = b""


def write_rerun(path: str | Path, motion: Motion) -> None:
    """Write points that move: joints of the figure as a skeleton, others as points.

    Parameters
    ----------
    path : path
        The file.
    motion : Motion
        One clip.

    Raises
    ------
    InputError
        Where there are several clips, the extra is not installed, or the file cannot be written.
    """
    motion = the_one_clip(path, motion, "RRD")
    rr, recording = _begin()
    recording.log("world", _axes(rr, motion.up or "+z"), static=True)
    joints = [motion.names.index(name) for name in JOINTS] if set(JOINTS) <= set(motion.names) else None
    for k, (second, points) in enumerate(zip(motion.time.tolist(), motion.points, strict=True)):
        _at(recording, path, k, second)
        known = np.isfinite(points).all(axis=1)
        labels = [name for name, one in zip(motion.names, known.tolist(), strict=True) if one]
        recording.log(
            "world/person/points",
            rr.Points3D(points[known], radii=POINT_METRES, labels=labels, show_labels=False),
        )
        if joints is not None:
            _skeleton(rr, recording, "world/person", points[joints])
    _save(path, recording)


def write_rerun_recording(
    path: str | Path, frames: Sequence[RecordedFrame], *, name: str = "person", view: View | None = None
) -> None:
    """Write postures of one person, frame by frame, in the camera's frame (x right, y down, z away).

    Parameters
    ----------
    path : path
        The file.
    frames : sequence of RecordedFrame
        In order of time.
    name : str
        Of the person, in the names of entities.
    view : View, optional
        What was seen: its camera, and where the joints are in its pictures.

    Raises
    ------
    InputError
        Where the extra is not installed, the view has other frames, or the file cannot be written.
    """
    if view is not None and len(view) != len(frames):
        raise refusal(
            "--view", "", f"{len(view)} frames", f"{len(frames)}, as the result has", "give its own view"
        )
    rr, recording = _begin()
    recording.log("world", _axes(rr, "-y"), static=True)
    camera = None if view is None else _camera(rr, recording, view)
    for k, frame in enumerate(frames):
        _at(recording, path, k, frame.time)
        recording.log("findings", rr.TextLog(frame.says))
        if frame.picture:
            photograph = rr.EncodedImage(contents=frame.picture, media_type="image/jpeg")
            recording.log(f"{camera or 'world/camera'}/picture", photograph)
        if not len(frame.postures):
            recording.log(f"world/{name}", rr.Clear(recursive=True))
            continue
        _skeleton(rr, recording, f"world/{name}", frame.postures[0])
        known = np.isfinite(frame.postures[0]).all(axis=1)
        labels = [joint for joint, one in zip(JOINTS, known.tolist(), strict=True) if one]
        recording.log(
            f"world/{name}/joints",
            rr.Points3D(frame.postures[0][known], radii=POINT_METRES, labels=labels, show_labels=False),
        )
        _others(rr, recording, f"world/{name}/others", frame)
        if camera is not None and view is not None:
            seen = view.image[k][np.isfinite(view.image[k]).all(axis=1)]
            recording.log(f"{camera}/seen", rr.Points2D(seen, radii=3.0))
    _save(path, recording)


def _begin() -> tuple[Any, Any]:
    rr = extra(*WRITTEN_BY_RERUN)
    recording = rr.RecordingStream("posekit")
    rr.set_log_time_enabled(False, recording=recording)
    return rr, recording


def _save(path: str | Path, recording: Any) -> None:
    stream = recording.memory_recording()
    with replacing(path) as file:
        file.write(stream.drain_as_bytes())


def _at(recording: Any, path: str | Path, frame: int, second: float) -> None:
    if abs(second) > LATEST_SECONDS:
        expected = f"at most {LATEST_SECONDS:g} s, as Rerun counts nanoseconds"
        raise refusal(
            path, f"frame {frame}", f"{second:g} s", expected, "count its times from the first frame"
        )
    recording.set_time(FRAME_TIMELINE, sequence=frame)
    recording.set_time(SECONDS_TIMELINE, duration=second)


def _axes(rr: Any, up: str) -> Any:
    if up == "-y":
        return rr.ViewCoordinates.RDF
    sign = "HAND_" + up[1].upper() + "_" + ("UP" if up[0] == "+" else "DOWN")
    return getattr(rr.ViewCoordinates, f"RIGHT_{sign}")


def _camera(rr: Any, recording: Any, view: View) -> str | None:
    """Record a calibrated camera, at the origin of its own frame; another has no place among metres."""
    K = getattr(view.camera, "K", None)
    if K is None:
        return None
    size = getattr(view.camera, "size", None) or np.nanmax(view.image, axis=(0, 1)).tolist()
    lens = rr.Pinhole(image_from_camera=K, resolution=size, camera_xyz=rr.ViewCoordinates.RDF)
    recording.log("world/camera", lens, static=True)
    return "world/camera"


def _colours() -> list[tuple[int, int, int]]:
    sides = {"right": RIGHT_RGB, "left": LEFT_RGB}
    return [sides.get(JOINTS[end].partition("_")[0], MIDDLE_RGB) for _, end in TREE_SEGMENTS]


def _skeleton(rr: Any, recording: Any, entity: str, posture: Array) -> None:
    """Record a posture (14, 3) as lines between its known joints."""
    lines, colours = [], []
    for (start, end), colour in zip(TREE_SEGMENTS, _colours(), strict=True):
        if np.isfinite(posture[[start, end]]).all():
            lines.append(posture[[start, end]])
            colours.append(colour)
    recording.log(entity, rr.LineStrips3D(lines, colors=colours, radii=LINE_METRES))


def _others(rr: Any, recording: Any, entity: str, frame: RecordedFrame) -> None:
    """Record the other postures of a frame as thin lines, the fainter the less likely."""
    others = frame.postures[1 : 1 + MAX_OTHERS]
    weight = frame.probability if len(frame.probability) else np.ones(len(frame.postures))
    share = np.clip(weight[1 : 1 + MAX_OTHERS] / max(float(weight[0]), 1e-12), 0.0, 1.0)
    lines, colours = [], []
    for posture, one in zip(others, share.tolist(), strict=True):
        alpha = round(FAINTEST_ALPHA + one * (MOST_ALPHA - FAINTEST_ALPHA))
        for (start, end), colour in zip(TREE_SEGMENTS, _colours(), strict=True):
            if np.isfinite(posture[[start, end]]).all():
                lines.append(posture[[start, end]])
                colours.append((*colour, alpha))
    recording.log(entity, rr.LineStrips3D(lines, colors=colours, radii=FAINT_LINE_METRES))


RERUN_FORMAT: Final = MotionFormat(
    name="rerun",
    title="RRD, a recording for Rerun's viewer",
    suffixes=(".rrd",),
    write_points=write_rerun,
    written_by=WRITTEN_BY_RERUN,
    looks_like=lambda given: given.start.startswith(RRD_MAGIC),
)
"""Written, and not read: a recording is for eyes."""
