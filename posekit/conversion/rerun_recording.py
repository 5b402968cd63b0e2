"""A result as a recording for Rerun: every frame with its likeliest postures, and what is said of it."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from posekit.display.check_words import check_words
from posekit.display.plural import plural
from posekit.formats.motion.rerun_file import RecordedFrame, write_rerun_recording
from posekit.formats.own import Result, ResultFrame, View
from posekit.formats.own.frame_answer import likeliest_order

if TYPE_CHECKING:
    from PIL import Image

JPEG_QUALITY: Final = 85

MAX_REASONS = 4
"""Of a frame's rejections, those that are told."""


def write_rerun_result(path: Path, result: Result, view: View | None, over: Path | None = None) -> list[str]:
    """Write a result with all survivors, the likeliest first, and say what was written.

    Parameters
    ----------
    path : Path
        The file, ``.rrd``.
    result : Result
        What was recovered.
    view : View, optional
        What it was recovered from: its camera and image points are recorded, too.
    over : Path, optional
        The photograph, folder of photographs or video that the frames came from, recorded as the camera's picture.

    Raises
    ------
    InputError
        Where the extra is not installed, the view has other frames, pictures are missing, or the file cannot be
        written.
    """
    frames = [_recorded(k, frame) for k, frame in enumerate(result.frames)]
    said: list[str] = []
    if over is not None:
        pictures, said = _pictures(over, result, view)
        frames = [replace(frame, picture=one) for frame, one in zip(frames, pictures, strict=True)]
    write_rerun_recording(path, frames, view=view)
    count = sum(len(frame.postures) for frame in frames)
    seen = "" if view is None else ", with the camera and what it saw"
    seen += "" if over is None else " and the pictures"
    told = f"{plural(len(frames), 'frame')}, {plural(count, 'posture')}{seen}; look at them: rerun {path}"
    return [*said, told]


def _pictures(over: Path, result: Result, view: View | None) -> tuple[Iterator[bytes], list[str]]:
    """Encode the picture of each frame, as large as the view's camera has it; say how they were matched."""
    from posekit.viewer.overlay.frame_pictures import frame_pictures, matched

    source = frame_pictures(over)
    times = np.array([frame.time for frame in result.frames])
    match = matched(source, times, result.pictures)
    size = None if view is None else getattr(view.camera, "size", None)
    return (_jpeg(image, size) for image in source.images(match.pictures)), [match.said] if match.said else []


def _jpeg(image: Image.Image, size: tuple[int, int] | None) -> bytes:
    image = image.convert("RGB")
    if size is not None and image.size != tuple(size):
        image = image.resize(size)
    with io.BytesIO() as stream:
        image.save(stream, "JPEG", quality=JPEG_QUALITY)
        return stream.getvalue()


def _recorded(k: int, frame: ResultFrame) -> RecordedFrame:
    """Lay out a frame: its postures by probability, and its findings in a line."""
    p = frame.probability
    order = np.arange(len(frame.joints)) if p is None else likeliest_order(np.asarray(p), frame.answer)
    lost = sorted(frame.rejecting.items(), key=lambda pair: -pair[1])[:MAX_REASONS]
    why = ", ".join(f"{check_words(reason)} {count}" for reason, count in lost)
    return RecordedFrame(
        time=frame.time,
        postures=frame.joints[order],
        probability=np.empty(0) if p is None else np.asarray(p)[order],
        says=f"frame {k}: {plural(len(frame.joints), 'posture')}; rejected by {why or 'nothing'}",
    )
