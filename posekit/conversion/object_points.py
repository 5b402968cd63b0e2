"""Recovered objects as points that move: one posture a frame, in formats that carry points of any name."""

from __future__ import annotations

import numpy as np

from posekit.conversion.motion_output import MotionOutput, carries_points, write_points
from posekit.display.plural import plural
from posekit.formats.motion import Motion, motion_formats
from posekit.formats.own import ObjectResult
from posekit.recovery.result_sequence import ASSUMED_RATE, CAMERA_UP, LIKELIEST_WORDS
from posekit.safe_io import refusal, shown


def write_object_points(
    output: MotionOutput, result: ObjectResult, source: str, *, posture: str = "", up: str = ""
) -> list[str]:
    """Write one posture of each frame of recovered objects, and say what was written.

    Parameters
    ----------
    output : MotionOutput
        What is to be written.
    result : ObjectResult
        What was recovered.
    source : str
        How errors call it.
    posture : str
        Which: a number from 0; if empty the first that the object's robot is known to reach, else the first.
    up : str
        The axis that points up in the camera's frame; as if it were held level if empty.

    Raises
    ------
    InputError
        Where the format holds a person and nothing else, no frame has such a posture, or it cannot be written.
    """
    if not carries_points(output.to):
        known = ", ".join(one.name for one in motion_formats().values() if one.write_points is not None)
        raise refusal(
            source,
            "--to",
            f"{output.to}, of objects",
            f"a format of points: {known}",
            "choose one of them: this one holds a person's body",
        )
    if posture not in LIKELIEST_WORDS and not posture.isdecimal():
        raise refusal(
            "--posture", "", shown(posture), "a number from 0", "objects have no probabilities or paths"
        )
    rows = {}
    for k, frame in enumerate(result.frames):
        reached = [row for row, verdict in enumerate(frame.certified) if verdict]
        row = int(posture) if posture.isdecimal() else (reached or [0])[0]
        if row < len(frame):
            rows[k] = row
    if not rows:
        most = max(map(len, result.frames), default=0)
        raise refusal(
            source, "--posture", f"{posture or 'objects'}, and {most} postures a frame at most", "more"
        )
    time = np.array([result.frames[k].time for k in rows])
    steps = np.diff(time)
    motion = Motion(
        names=result.points,
        points=np.stack([result.frames[k].points[row] for k, row in rows.items()]),
        time=time,
        rate=float(1 / np.median(steps)) if len(steps) else ASSUMED_RATE,
        up=up or CAMERA_UP,
        source=str(output.path),
    )
    lost = len(result.frames) - len(rows)
    says = [f"{lost} of {plural(len(result.frames), 'frame')} without a posture are left out"] if lost else []
    if not posture:
        many = np.median([len(result.frames[k]) for k in rows])
        says.append(
            f"one posture of {many:g} in each frame (median): none is known to be likelier than others"
        )
    if result.unit is None:
        says.append("lengths are in the linkage's own unit, not in metres")
    return [*says, *write_points(output, motion)]
