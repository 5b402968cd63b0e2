"""A result as a recording for Rerun: every frame with its likeliest postures, and what is said of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from posekit.display.plural import plural
from posekit.formats.motion.rerun_file import RecordedFrame, write_rerun_recording
from posekit.formats.own import Result, ResultFrame, View

MAX_REASONS = 4
"""Of a frame's rejections, those that are told."""


def write_rerun_result(path: Path, result: Result, view: View | None) -> list[str]:
    """Write a result with all survivors, the likeliest first, and say what was written.

    Parameters
    ----------
    path : Path
        The file, ``.rrd``.
    result : Result
        What was recovered.
    view : View, optional
        What it was recovered from: its camera and image points are recorded, too.

    Raises
    ------
    InputError
        Where the extra is not installed, the view has other frames, or the file cannot be written.
    """
    frames = [_recorded(k, frame) for k, frame in enumerate(result.frames)]
    write_rerun_recording(path, frames, view=view)
    count = sum(len(frame.postures) for frame in frames)
    seen = "" if view is None else ", with the camera and what it saw"
    return [f"{plural(len(frames), 'frame')}, {plural(count, 'posture')}{seen}; look at them: rerun {path}"]


def _recorded(k: int, frame: ResultFrame) -> RecordedFrame:
    """Lay out a frame: its postures by probability, and its findings in a line."""
    p = frame.probability
    order = np.arange(len(frame.joints)) if p is None else np.argsort(-np.asarray(p), kind="stable")
    lost = sorted(frame.rejected.items(), key=lambda pair: -pair[1])[:MAX_REASONS]
    why = ", ".join(f"{reason} {count}" for reason, count in lost)
    return RecordedFrame(
        time=frame.time,
        postures=frame.joints[order],
        probability=np.empty(0) if p is None else np.asarray(p)[order],
        says=f"frame {k}: {plural(len(frame.joints), 'posture')}; rejected by {why or 'nothing'}",
    )
