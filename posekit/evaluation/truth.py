"""True joints from motion capture, matched to the pictures in time, and to the axes of the camera's world."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations, product
from typing import Any, Final

import numpy as np

from posekit.cameras import PinholeCamera, View
from posekit.errors import refusal
from posekit.formats.node import Node
from posekit.formats.view_file import camera_from
from posekit.geometry import Array
from posekit.motion import Motion
from posekit.recovery import Recovery
from posekit.skeleton import JOINTS

#: Largest median distance between projected truth and image points, as a share of the person's height in the image;
#: beyond it the truth belongs to another person, camera or time.
REFUSED_SHARE: Final = 0.2

#: The 24 rotations (24, 3, 3) that permute the coordinate axes.
AXIS_TURNS: Final = np.array(
    [
        turn
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
        if np.linalg.det(turn := np.eye(3)[list(order)] * signs) > 0
    ]
)


def with_truth(view: View, motion: Motion) -> tuple[View, str]:
    """Add true joints to a view, from motion capture of the same person at the same times.

    Parameters
    ----------
    view : View
        A view whose camera has a pose in the world.
    motion : Motion
        Joints in metres; its axes may differ from the axes of the camera's world.

    Returns
    -------
    view, note : View, str
        The view with `truth`, and a sentence about the matched frames and axes.

    Raises
    ------
    InputError
        If the camera has no pose, no frame matches, or the projected truth is far from the image points.
    """
    truth, note = _placed(view.camera, view.image, view.time, motion)
    return replace(view, truth=truth), note


def truth_of(result: Recovery, given: Array | View | Motion) -> tuple[Array, str]:
    """Return true joints (F, 14, 3) of a result's frames, camera frame, metres, and a sentence about the matching.

    Parameters
    ----------
    result : Recovery
        Result of F frames. If the truth is a motion, the camera must have a pose in the world.
    given : array (F, 14, 3), View or Motion
        True joints in the camera's frame, a view with truth, or motion capture at the same times.

    Raises
    ------
    InputError
        If the frames of truth and result differ, or the motion does not match the image.
    """
    if isinstance(given, Motion):
        camera = camera_from(Node(result.camera, result.source), result.unit) if result.camera else None
        image = np.full((len(result), len(JOINTS), 2), np.nan)
        if isinstance(camera, PinholeCamera):
            for k in range(len(result)):
                if len(result[k]):
                    image[k] = camera.project(result[k].joints[0])
        return _placed(camera, image, np.asarray(result.frames.time), given)
    given = given.truth if isinstance(given, View) else given
    if not isinstance(given, np.ndarray | list | tuple):
        expected = "a view with truth, or motion of the same seconds"
        raise refusal(result.source, "truth", f"a {type(given).__name__}", expected, "give another file")
    truth = np.asarray(given, dtype=np.float64)
    if truth.shape != (len(result), len(JOINTS), 3) or not np.isfinite(truth).any():
        expected = f"known joints of shape ({len(result)}, {len(JOINTS)}, 3)"
        raise refusal(result.source, "truth", f"shape {truth.shape}", expected, "give all frames' joints")
    return truth, ""


def _placed(camera: Any, image: Array, time: Array, motion: Motion) -> tuple[Array, str]:
    """Match motion frames to pictures; choose the matching and the axis permutation with the least image error."""
    source = motion.source or "truth"
    if not isinstance(camera, PinholeCamera) or camera.R is None or camera.t is None:
        raise refusal(source, "truth", "a camera without a pose", "R and t", "give a calibration")
    found = []
    for how, joints in _matched(motion, time):
        turned = np.einsum("kij,fpj->kfpi", AXIS_TURNS, joints) @ camera.R.T + camera.t
        away = np.linalg.norm(camera.project(turned) - image, axis=-1).reshape(len(AXIS_TURNS), -1)
        seen = np.isfinite(away).sum(axis=1)
        for k in np.flatnonzero(seen == seen.max() if seen.max() else seen):
            found.append((float(np.nanmedian(away[k])), turned[k], f"{how}, axes {_axes(AXIS_TURNS[k])}"))
    if not found:
        raise refusal(source, "truth", "no frame at a picture's time", "the same seconds", "state the rate")
    error, truth, how = min(found, key=lambda one: one[0])
    v = image[np.isfinite(image[..., 1]).any(axis=1), :, 1]
    height = float(np.median(np.nanmax(v, axis=1) - np.nanmin(v, axis=1)))
    if error > REFUSED_SHARE * height:
        got = f"{error:.3g} px from the image (median) with all axes"
        remedy = "check --person, --camera and --rate"
        raise refusal(source, "truth", got, "the same person, camera and seconds", remedy)
    frames = int(np.isfinite(truth).any(axis=(1, 2)).sum())
    return truth, f"truth of {frames} of {len(time)} frames {how}; {error:.1f} px from the image (median)"


def _matched(motion: Motion, time: Array) -> list[tuple[str, Array]]:
    """Return the joints (F, 14, 3) of each picture by three matchings: frame number, time, time since the start."""
    joints, count = motion.figure_joints, len(time)
    by_number = np.full((count, *joints.shape[1:]), np.nan)
    by_number[: min(count, len(joints))] = joints[:count]
    found = [("by number", by_number)]
    since = np.asarray(motion.time) - np.asarray(motion.time)[0]
    timed = np.isfinite(since).all() and np.isfinite(time).all()
    if not timed and len(joints) != count:
        got = f"{len(joints)} frames for {count} pictures, and not the times of both"
        remedy = "state the rate of the pictures: posekit recover --rate"
        raise refusal(motion.source or "truth", "truth", got, "times, or one frame per picture", remedy)
    if timed and len(since) > 1:
        for how, seconds in (("by time", time), ("by time from the first picture", time - time[0])):
            nearest = np.abs(since[None] - seconds[:, None]).argmin(axis=1)
            near = np.abs(since[nearest] - seconds) <= 0.51 * np.median(np.diff(since))
            found.append((how, np.where(near[:, None, None], joints[nearest], np.nan)))
    return found


def _axes(turn: Array) -> str:
    """Write an axis permutation as text: the motion's axes that are x, y, z of the camera's world, as ``(z, x, y)``."""
    largest = np.abs(turn).argmax(axis=1)
    signs = ["-" if row[k] < 0 else "" for row, k in zip(turn, largest, strict=True)]
    return f"({', '.join(sign + 'xyz'[k] for sign, k in zip(signs, largest, strict=True))})"
