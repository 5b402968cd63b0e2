"""What to tell whoever recovered frames and found no posture in them."""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.cameras import PinholeCamera
from posekit.errors import PosekitError
from posekit.files import OpenCVModel
from posekit.pipeline.admitting import least_violation
from posekit.pipeline.grower import Grower
from posekit.pipeline.noise import Noise, Seen
from posekit.pipeline.recovery import Recovery
from posekit.pipeline.tolerance import MEASURED
from posekit.refinement import diagnose
from posekit.skeleton import SEGMENT_NAMES

NAMED: Final = 3
"""Empty frames of which the least violation is told."""

DOUBTED_WITH: Final = 12
"""Empty frames, spread over all, in which wrong lengths are looked for."""

TOLD: Final = 3
"""Lengths that are doubted aloud."""

ALIKE: Final = 1.2
"""Factors that differ by no more than this are one."""

PIXELS: Final = 2.0
"""Standard deviation of image points of which nobody says it."""


def advice_lines(recovery: Recovery) -> list[str]:
    """Say of frames without a posture what would admit one, and which lengths the picture does not bear out.

    Of the first few frames the least violation (`posekit.pipeline.admitting`); where most of the frames have none, the
    lengths that would have to be others (`posekit.refinement.diagnose`).
    """
    grower = recovery.grower
    if grower is None:
        return []
    empty = [k for k, frame in enumerate(recovery.frames) if not len(frame) and not frame.reason]
    lines = []
    for k in empty[:NAMED]:
        frame = recovery.frames[k]
        allowed = MEASURED if frame.judged in ("exact", "measured") else frame.tolerance
        found = least_violation(grower, k, allowed)
        if found is not None and found.excesses:
            lines.append(f"frame {k + 1}: the least that would admit a posture: {found}")
        elif found is not None and frame.refined is not None:
            lines.append(
                f"frame {k + 1}: every posture is less likely than 1 in 1000 by chi-square: give a larger --deviation"
            )
    if len(empty) > NAMED and lines:
        lines.append(f"and {len(empty) - NAMED} more frames without a posture")
    if len(empty) > len(recovery.frames) / 2:
        lines += _doubts(recovery, grower, empty)
    return lines


def _doubts(recovery: Recovery, grower: Grower, empty: list[int]) -> list[str]:
    """Name lengths that cannot be right, where the camera is known."""
    view, fit = grower.view, grower.fit
    if not isinstance(view.camera, OpenCVModel):
        return []
    chosen = np.array(empty)[np.linspace(0, len(empty) - 1, min(DOUBTED_WITH, len(empty))).astype(np.intp)]
    rows = np.flatnonzero(np.isin(fit.frame, chosen) & np.isfinite(fit.root).all(axis=1))
    rows = rows[np.flatnonzero(np.diff(fit.frame[rows], prepend=-1))]
    camera = fit.cameras(rows)
    if not len(rows) or not isinstance(camera, PinholeCamera):
        return []
    said = recovery.settings.get("noise")
    noise = (
        Noise(deviation=PIXELS)
        if said is None
        else Noise(deviation=said["deviation"], offset=said["offset"], lengths=said["lengths"])
    )
    try:
        doubts = diagnose(Seen.of(view, fit, rows, camera, recovery.figure, noise).sight)
    except PosekitError:
        return []
    factors = [doubt.needed / doubt.stated for doubt in doubts]
    if len(doubts) > len(SEGMENT_NAMES) / 2 and max(factors) < ALIKE * min(factors):
        return [
            f"all lengths look stated at {1 / float(np.median(factors)):.2f} of what the pictures need: check unit, "
            "stature and root"
        ]
    return [str(doubt) for doubt in doubts[:TOLD]]
