"""How many flips of a robot survive, and how many survivors have a configuration: random postures, exact views."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.objects.articulated import ArticulatedObject
from posekit.objects.drawn_views import draw_view
from posekit.objects.object_recovery import recover_object
from posekit.settings.scale import Scale

FOUND_DISTANCE = 1e-5
"""Metres, of the object's longest segment, within which a survivor is the truth."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ObjectStudy:
    """What became of N views.

    Parameters
    ----------
    flips : int
        Leaves of the tree before pruning, at one scale.
    survivors, certified, mirrored : int array (N,)
        Postures, those with a configuration, and those whose mirror image is among them.
    found, sure : bool array (N,)
        Whether the truth is among the survivors, and among the certified.
    """

    flips: int
    survivors: NDArray[np.int64]
    certified: NDArray[np.int64]
    mirrored: NDArray[np.int64]
    found: NDArray[np.bool_]
    sure: NDArray[np.bool_]


def study_object(
    thing: ArticulatedObject, *, count: int = 200, seed: int = 0, scale: Scale | None = None
) -> ObjectStudy:
    """Recover random configurations within the limits of a robot, seen from random directions.

    Parameters
    ----------
    thing : ArticulatedObject
        With a robot.
    count, seed : int
    scale : Scale, optional
        How the scale is found; known unless told otherwise.

    Raises
    ------
    InputError
        Where the object has no robot.
    """
    view = draw_view(thing, count, np.random.default_rng(seed))
    truth = view.truth
    result = recover_object(view, thing, scale=scale)
    depth = truth[:, :1] * np.array([0.0, 0.0, 1.0])
    near = FOUND_DISTANCE * float(thing.working.lengths.max())
    right = [
        np.linalg.norm(frame.points - goal, axis=-1).max(axis=1, initial=0.0) <= near
        for frame, goal in zip(result.frames, truth - depth, strict=True)
    ]
    sure = [np.array(frame.certified, dtype=bool) for frame in result.frames]
    return ObjectStudy(
        flips=1 << (len(thing.linkage.points) - 1),
        survivors=np.array([len(frame) for frame in result.frames]),
        certified=np.array([verdicts.sum() for verdicts in sure]),
        mirrored=np.array([frame.family.mirrored if frame.family else 0 for frame in result.frames]),
        found=np.array([hits.any() for hits in right]),
        sure=np.array([(hits & verdicts).any() for hits, verdicts in zip(right, sure, strict=True)]),
    )


def study_lines(name: str, study: ObjectStudy) -> list[str]:
    """Write a study as rows of a Markdown table: name, flips, survivors, truth, certified, mirror pairs."""
    N = len(study.survivors)
    share = study.certified.sum() / max(study.survivors.sum(), 1)
    return [
        f"| {name} | {study.flips:,} | {np.median(study.survivors):g} | {np.percentile(study.survivors, 95):g} "
        f"| {study.survivors.max()} | {study.found.sum()} of {N} | {study.sure.sum()} of {N} | {100 * share:.1f} % "
        f"| {(study.mirrored > 0).sum()} of {N} |"
    ]
