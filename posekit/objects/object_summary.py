"""What the command line prints of an object's recovery."""

from __future__ import annotations

from collections import Counter

import numpy as np

from posekit.display.check_words import check_words
from posekit.display.plural import plural
from posekit.formats.own.object_result import ObjectFrame, ObjectResult

MAX_SHOWN = 4
"""How many reasons, and how many frames at each end of a long sequence, are printed."""


def object_lines(result: ObjectResult) -> list[str]:
    """Describe each frame's survivors and losses, the scales, and which mirror images survive."""
    lines = [f"{'frame':>5} {'time':>8} {'postures':>8} {'certified':>9} {'judged as':>9}  rejected most by"]
    frames = result.frames
    cut = len(frames) - 2 * MAX_SHOWN
    for k, frame in enumerate(frames):
        if cut > 1 and MAX_SHOWN <= k < len(frames) - MAX_SHOWN:
            if k == MAX_SHOWN:
                lines.append(f"{'…':>5} {plural(cut, 'frame')} between")
            continue
        lines.append(_frame_line(k, frame))
    counts = [len(frame) for frame in frames]
    lines.append(
        f"{plural(sum(counts), 'posture')} of {result.linkage} in {plural(len(counts), 'frame')}: median "
        f"{np.median(counts):g}, most {max(counts)}, none in {counts.count(0)}"
    )
    undecided = sum(verdict is False for frame in frames for verdict in frame.certified)
    if undecided:
        lines.append(
            f"{plural(undecided, 'posture')} are undecided: nothing excludes them, but no configuration "
            f"within limits was found{_other_scale(result)}"
        )
    return lines + _scale_lines(result)


def _other_scale(result: ObjectResult) -> str:
    """Say what to try where the scale is only the least that the image allows."""
    least = any(frame.family is not None and frame.family.how == "min" for frame in result.frames)
    return "; the scale is the least that the image allows, try --scale closure" if least else ""


def _frame_line(k: int, frame: ObjectFrame) -> str:
    certified = [verdict for verdict in frame.certified if verdict is not None]
    sure = str(sum(certified)) if certified else "-"
    most = ", ".join(
        f"{check_words(reason)} {count}" for reason, count in Counter(frame.rejected).most_common(MAX_SHOWN)
    )
    return f"{k:>5} {frame.time:>8.3f} {len(frame):>8} {sure:>9} {frame.judged or '-':>9}  {frame.reason or most}"


def _scale_lines(result: ObjectResult) -> list[str]:
    families = [frame.family for frame in result.frames if frame.family is not None and len(frame)]
    if not families:
        return []
    s = np.concatenate([frame.scales for frame in result.frames])
    per = "unit of length" if result.unit is None else "metre"
    segment, count = Counter(family.segment for family in families).most_common(1)[0]
    mirrored = sum(family.mirrored > 0 for family in families)
    return [
        f"scale by {families[0].how}: {s.min():.6g} to {s.max():.6g} pixels a {per}; the bound is set by {segment} in "
        f"{count} of {plural(len(families), 'frame')}",
        f"mirror images told apart in {len(families) - mirrored} of {plural(len(families), 'frame')}"
        + (f"; in {mirrored} a posture and its mirror image both survive" if mirrored else ""),
    ]
