"""A sequence of postures of whatever moves: a result, the truth of a view, motion, postures one after another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from posekit.body import load_figure, with_head
from posekit.body.anthropometry import lengths_from_postures
from posekit.errors import InputError
from posekit.formats.held_postures import HeldPostures
from posekit.formats.motion import Motion, postures_of
from posekit.formats.own import OpenCVModel, Postures, Result, View
from posekit.formats.skeleton_maps import SkeletonMap, load_skeleton_map
from posekit.geometry import Array
from posekit.recovery.result_sequence import (
    ASSUMED_RATE,
    CAMERA_UP,
    PostureSequence,
    guessed_up,
    in_world,
    sequence_of_result,
)
from posekit.robots.stretching import shoulders_are_behind


def one_clip(motion: Motion) -> Motion:
    """Refuse several clips, where one is needed.

    Raises
    ------
    InputError
        Where there are several: they are named.
    """
    if len(motion.clips) > 1:
        names = ", ".join(motion.clips[:8]) + (", …" if len(motion.clips) > 8 else "")
        raise InputError(
            f"{motion.source}: {len(motion.clips)} clips ({names}); expected one; choose with --clip"
        )
    return motion


def sequence_of(
    held: Result | View | Motion | Postures | HeldPostures,
    source: str,
    *,
    posture: str = "",
    view: View | None = None,
    skeleton: str = "",
    up: str = "",
) -> PostureSequence:
    """Make a sequence of what moves: of a result, the truth of a view, motion, or postures one after another.

    Parameters
    ----------
    held : Result, View, Motion, Postures or HeldPostures
        What moves.
    source : str
        How errors call it.
    posture, view
        Of a result: as `posekit.recovery.result_sequence.sequence_of_result` takes them.
    skeleton : str
        Of motion capture: a skeleton map by name or file.
    up : str
        The axis that points up, where it is not known or is wrong; of a result, that of the camera's frame, or of its
        world where there is a view. Motion says it itself.

    Raises
    ------
    InputError
        Where nothing in it moves.
    """
    if isinstance(held, Result):
        return sequence_of_result(held, posture=posture, view=view, up=up)
    if isinstance(held, View):
        return _of_truth(held, source, up)
    if isinstance(held, Motion):
        return _of_motion(one_clip(held), load_skeleton_map(skeleton) if skeleton else None)
    known, given = ("", held) if isinstance(held, Postures) else (held.up, held.postures)
    points = given.joints if given.head is None else np.concatenate([given.joints, given.head], axis=1)
    up = up or known or guessed_up(given.joints, source)
    return _recorded(with_head(points), np.arange(len(points)) / ASSUMED_RATE, up)


def _of_truth(view: View, source: str, stated: str) -> PostureSequence:
    known = np.isfinite(view.truth).any(axis=(1, 2))
    if not known.any():
        raise InputError(
            f"{source}: a view without truth: pictures do not move in space; expected a result; recover it first"
        )
    points = with_head(view.truth[known])
    up = stated or CAMERA_UP
    if isinstance(view.camera, OpenCVModel) and view.camera.R is not None and view.camera.t is not None:
        points = in_world(points, view.camera)
        up = stated or view.camera.up or guessed_up(points[:, :14], source)
    return _recorded(points, view.time[known], up)


def _of_motion(motion: Motion, layout: SkeletonMap | None) -> PostureSequence:
    found = postures_of(motion, layout)
    points = np.concatenate([found.joints, found.head], axis=1)
    says = [f"skeleton map {found.layout.name}"]
    if found.derived:
        says.append(f"{' and '.join(found.derived)} placed from shoulders and hips")
    up = motion.up or guessed_up(found.joints, motion.source)
    if not motion.up:
        says.append(f"{up} is taken as up, along which heads are above ankles")
    return _recorded(points, motion.time, up, says)


def _recorded(points: Array, time: Array, up: str, says: Sequence[str] = ()) -> PostureSequence:
    """Make it of postures that were measured, with a figure of their own lengths."""
    return PostureSequence(
        points=points,
        time=time,
        frame=np.arange(len(points)),
        survivor=np.zeros(len(points), dtype=np.intp),
        up=up,
        figure=load_figure().scaled(
            lengths_from_postures(points[:, :14]).lengths.lengths, behind=shoulders_are_behind(points)
        ),
        says=tuple(says),
        values={},
    )
