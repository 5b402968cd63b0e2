"""Place a pruned branch again: the posture that a finding killed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from posekit.cameras import Camera
from posekit.errors import ViewerError
from posekit.formats.own import Result
from posekit.geometry import Array
from posekit.skeleton import JOINTS, TREE_SEGMENTS, segment_name
from posekit.viewer.scene.drawn_subject import DrawnSubject, Shown

TANGENT_METRES = 0.01
"""Metres by which a segment may be too short for its image, where the result does not tell."""


def rejected_of(result: Result, subject: DrawnSubject, frame: int) -> Shown:
    """Gather a frame's pruned branches, each with the finding that killed it.

    Parameters
    ----------
    result : Result
        Written with every pruned branch (``posekit recover --explain``).
    subject : DrawnSubject
        The same result's, with a camera.
    frame : int
        From 0.

    Raises
    ------
    ViewerError
        Where the result lists no pruned branches, or camera or neck are not known.
    """
    pruned = result.frames[frame].pruned
    if not pruned:
        raise ViewerError(
            f"frame {frame}: the result lists no pruned branch; recover it with --explain, and there must be some"
        )
    shown = subject.frames[frame]
    if shown.sight is None or not len(shown):
        raise ViewerError(
            f"frame {frame}: to place its pruned branches the camera and a survivor are needed; give the view "
            "that it was recovered from (--view)"
        )
    recovered = result.frames[frame]
    if recovered.family is not None and len(recovered.family.chosen) > 1:
        raise ViewerError(
            f"frame {frame}: it was recovered at {len(recovered.family.chosen)} scales, and its pruned branches do "
            "not say at which; recover it at one, with --scale VALUE"
        )
    if tuple(recovered.levels["joint"]) != JOINTS:
        raise ViewerError(
            f"frame {frame}: its tree is not of the figure's joints, so its pruned branches cannot be placed; "
            "recover it with --proportions figure"
        )
    lengths = np.array([subject.figure.lengths[segment_name(segment)] for segment in TREE_SEGMENTS])
    image = shown.sight.image[: len(JOINTS)]
    points = np.tile(shown.points[0], (len(pruned), 1, 1))  # root and head are the same in all branches
    for k, record in enumerate(pruned):
        joints = lift_branch(
            shown.sight.camera,
            points[k, 0],
            image,
            lengths,
            _bits(record),
            tolerance=_tangent(result.settings),
        )
        points[k, : len(JOINTS)] = joints
    return Shown(
        points=points,
        reasons=[str(record.get("reason", "")) for record in pruned],
        sight=shown.sight,
        time=shown.time,
    )


def one_a_reason(shown: Shown) -> Shown:
    """Keep the last pruned branch of each reason, the one that got farthest."""
    last = {reason: row for row, reason in enumerate(shown.reasons)}
    return shown.chosen(list(last.values()))


def lift_branch(
    camera: Camera, root: Array, image: Array, lengths: Array, bits: str, *, tolerance: float = TANGENT_METRES
) -> Array:
    """Place the joints of a branch (14, 3), metres; NaN beyond its last choice, and where no ray reaches.

    Parameters
    ----------
    camera : Camera
        A calibrated camera, or a scaled orthographic one.
    root : array (3,)
        The neck, camera frame, metres.
    image : array (14, 2)
        Image points of the joints, y down, in the camera's unit; NaN where not seen.
    lengths : array (13,)
        Of the segments in tree order, metres.
    bits : str
        Near (0) or far (1) at each segment; the branch may end early.
    tolerance : float
        Metres by which a segment may be too short for its image.
    """
    joints = np.full((len(JOINTS), 3), np.nan)
    joints[0] = root
    for (parent, child), length, bit in zip(TREE_SEGMENTS, lengths, bits, strict=False):
        lift = camera.lift(joints[None, parent], image[None, child], np.array([length]), tolerance=tolerance)
        if lift.valid[0, int(bit)]:
            joints[child] = lift.points[0, int(bit)]
    return joints


def _bits(record: Mapping[str, Any]) -> str:
    bits = str(record.get("branch", ""))
    if not set(bits) <= {"0", "1"} or len(bits) > len(TREE_SEGMENTS):
        raise ViewerError(
            f"pruned: branch is {bits[:40]!r}; expected up to {len(TREE_SEGMENTS)} letters 0 and 1; recover again"
        )
    return bits


def _tangent(settings: Mapping[str, Any]) -> float:
    measured = settings.get("measured")
    value = measured.get("tangent", TANGENT_METRES) if isinstance(measured, Mapping) else TANGENT_METRES
    return float(value) if isinstance(value, int | float) else TANGENT_METRES
