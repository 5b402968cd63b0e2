"""Sentences beside the findings: where the ground is, and remedies for defects that have a known cause."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import cross, dot, perpendicular, unit
from posekit.skeleton import both
from posekit.validators.body import Body
from posekit.validators.check import Judgement
from posekit.validators.motion.ground import BY_CHANCE, ground_of, soles, up_of
from posekit.validators.motion.timeline import known_median, norm

#: Jumping joints from which a frame is another posture, and no wrong joint.
POSTURE_JOINTS: Final = 3

#: Share of the frames in which feet slide on a treadmill, and least speed of its belt, metres a second.
BELT_SHARE, BELT_SPEED = 0.5, 0.3

#: Way of the hips on a treadmill, at most, as a share of the way of the belt.
IN_PLACE_SHARE: Final = 0.25


def hints(body: Body, found: Mapping[str, Judgement], frame: NDArray[np.intp]) -> list[str]:
    """Return sentences about a body, given what checks found by their names, and the numbers of its frames."""
    said = []
    if body.settings.ground is None and {"penetration", "floating"} & set(found):
        ground = ground_of(body)
        resting = int(ground.resting.sum())
        frames = f"{resting} frames in which the body rests" if resting >= BY_CHANCE else "its lowest frames"
        said.append(
            f"Ground estimated at {ground.low:.3f} m along up, from {frames}; state it with --ground."
        )
    if "teleport" in found:
        jumps = found["teleport"].violated
        for edge in (0, len(body) - 1):
            if jumps[edge].sum() >= POSTURE_JOINTS and jumps.any(axis=1).sum() == 1:
                said.append(
                    f"Frame {frame[edge]} is another posture than the frames beside it, as of a skeleton at rest: "
                    "cut it off with --keep DIR --keep-spans SECONDS."
                )
    slides = found["sliding"].violated if "sliding" in found else np.zeros((1, 2), dtype=np.bool_)
    if slides.any(axis=1).mean() > BELT_SHARE:
        hips, feet, up = body.joints[:, both("hip")], soles(body)[0], up_of(body)
        forward = unit(cross(-up, np.nanmedian(hips[:, 1] - hips[:, 0], axis=0)))
        backward = -dot(np.gradient(feet, body.dt, axis=0), forward)
        # Points of feet are right and left in turn.
        speed = known_median(backward[np.tile(slides, feet.shape[1] // 2)])
        middle = perpendicular(hips.mean(axis=1), up)
        travel = float(norm(np.nanmax(middle, axis=0) - np.nanmin(middle, axis=0)))
        if speed > BELT_SPEED and travel < IN_PLACE_SHARE * speed * len(body) * body.dt:
            said.append(
                f"Feet go backward at {speed:.2g} m/s under a body that stays in place, as on a treadmill: judge it "
                "by a profile without sliding (--profile FILE.toml), or add the way of the belt to all points."
            )
    return said
