"""What to tell whoever recovered frames and found no posture in them."""

from __future__ import annotations

from typing import Final

from posekit.body import LengthUncertainty
from posekit.recovery.recovery import Recovery
from posekit.settings import MEASURED_TOLERANCE

MAX_FRAMES_EXPLAINED: Final = 3
"""Empty frames of which the least violation is told."""


def advice_lines(recovery: Recovery) -> list[str]:
    """Say of frames without a posture how near one comes to the limits, and which lengths contradict the pictures.

    Of the first few frames the least violation (`posekit.recovery.least_violation`); where most of them have none,
    the lengths that would have to be others (`posekit.refinement.diagnose`).
    """
    grower = recovery.grower
    if grower is None:
        return []
    lines = [*_of_one_body(recovery), *_of_outliers(recovery)]
    empty = [k for k, frame in enumerate(recovery.frames) if not len(frame) and not frame.reason]
    if empty:
        from posekit.recovery.least_violation import least_violation
    photographs = None
    if empty and recovery.frames[empty[0]].family is not None:
        from posekit.recovery.photograph_advice import photograph_line, photographs_of

        photographs = photographs_of(recovery)
    for k in empty[:MAX_FRAMES_EXPLAINED]:
        frame = recovery.frames[k]
        if photographs is not None and frame.judged == "refined":
            lines.append(f"frame {k}: no posture; {photograph_line(photographs, frame.number)}")
            continue
        allowed = MEASURED_TOLERANCE if frame.judged in ("exact", "measured") else frame.tolerance
        found = least_violation(grower, frame.number, allowed)
        if found is not None and found.excesses:
            lines.append(f"frame {k}: no posture; the one nearest to the limits breaks {found}")
        elif found is not None and frame.refined is not None:
            lines.append(
                f"frame {k}: every posture is less likely than 1 in 1000 by chi-square: give a larger --deviation"
            )
    if len(empty) > MAX_FRAMES_EXPLAINED and lines:
        lines.append(f"and {len(empty) - MAX_FRAMES_EXPLAINED} more frames without a posture")
    # Frames whose neck could not be placed say as much of lengths as those with one: often a limb is what forbids it.
    lost = [
        frame.number
        for frame in recovery.frames
        if not len(frame) and (not frame.reason or frame.placement is not None)
    ]
    if len(lost) > len(recovery.frames) / 2:
        from posekit.recovery.length_diagnosis import length_diagnosis_lines

        lines += length_diagnosis_lines(recovery, grower, lost)
    return lines


def _of_outliers(recovery: Recovery) -> list[str]:
    """Name the points that were not believed."""
    said = recovery.settings.get("outliers", {})
    lines = [
        f"frame {k}: {' and '.join(names)} taken for not seen: where detected, it jumps or leaves no posture"
        for k, names in said.items()
    ]
    more = [f"and outliers in {len(lines) - MAX_FRAMES_EXPLAINED} more frames"]
    return lines[:MAX_FRAMES_EXPLAINED] + (more if len(lines) > MAX_FRAMES_EXPLAINED else [])


def _of_one_body(recovery: Recovery) -> list[str]:
    """Name the lengths of a clip that were found to be others than they were stated."""
    said = recovery.settings.get("one_body")
    if said is None:
        return []
    from posekit.recovery.clip_body import MAX_LENGTHS_NAMED, changed_lengths

    known = LengthUncertainty(common=said["size_deviation"], own=said["deviation"])
    lines = changed_lengths(said["start"], said["lengths"], known, sized=said["sized"])
    return [f"lengths: {line}" for line in lines[:MAX_LENGTHS_NAMED]]
