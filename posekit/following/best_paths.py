"""The likeliest motion through a sequence, and what else it can have been."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.following.beam import Beam
from posekit.following.expected_path import ExpectedPath, expected_path
from posekit.following.motion_model import MotionModel
from posekit.following.survivor_frame import SurvivorFrame, check_frames
from posekit.following.survivor_paths import Paths
from posekit.following.trellis import Trellis
from posekit.geometry import Array

PATH_SEPARATION_METRES = 0.25
"""Metres by which a joint must differ for a path to be another one, unless told otherwise."""

LEAST_SHARE: Final = 1e-6
"""The least probability that another path has in the frame in which it differs most."""


def best_paths(
    frames: Sequence[SurvivorFrame],
    *,
    k: int = 1,
    model: MotionModel | None = None,
    beam: Beam | None = None,
    apart: float = PATH_SEPARATION_METRES,
    progress: Callable[[int, int], None] | None = None,
) -> Paths:
    """Find the likeliest motion through the survivors of a sequence.

    All paths are weighed at once: a path takes a survivor in each frame, or passes it over, and is as likely as its
    cost says (`MotionModel`). That gives the probability of each survivor given all frames, and the first path is what
    is expected under these (`expected_path`): in each frame the survivor that is nearest to it, and the posture itself.

    Each further path is what is expected if in one frame the body is elsewhere: in that frame, with that survivor, of
    all that have a joint more than `apart` from where every path before has it, that is the likeliest.

    Parameters
    ----------
    frames : sequence of SurvivorFrame
        Times ascending, at any rate, even or not.
    k : int
        How many paths; fewer are returned where there are not so many.
    model : MotionModel, optional
        How bodies move: what steps cost.
    beam : Beam, optional
        What is looked at while searching.
    apart : float
        Metres.
    progress : callable, optional
        Told after every frame how many there were so far, and how many there are.

    Returns
    -------
    Paths

    Raises
    ------
    InputError
        Where there is no frame, times do not ascend, or a number is impossible.

    Examples
    --------
    >>> import numpy as np
    >>> standing = np.zeros((1, 14, 3)) + [0.0, 0.0, 4.0]
    >>> moved = np.concatenate([standing + [0.3, 0.0, 0.0], standing + [0.01, 0.0, 0.0]])
    >>> best_paths([SurvivorFrame(time=0, joints=standing), SurvivorFrame(time=0.03, joints=moved)]).survivor.tolist()
    [[0, 1]]
    """
    check_frames(frames)
    if isinstance(k, bool) or not isinstance(k, int) or k < 1:
        raise InputError(f"k is {k!r}; expected how many paths, one or more")
    if not (math.isfinite(apart) and apart >= 0):
        raise InputError(f"apart is {apart!r} m; expected zero or a positive length")
    model, beam = model or MotionModel(), beam or Beam()
    trellis = Trellis(model, beam)
    for number, frame in enumerate(frames):
        trellis.push(frame)
        if progress is not None:
            progress(number + 1, len(frames))
    cost, cheapest = trellis.path()
    survivors = [stage.survivor for stage in trellis.stages]
    marginals = trellis.marginals()
    found = [expected_path(frames, survivors, marginals, model)]
    odds = [1.0]
    while len(found) < k:
        other = _elsewhere(frames, survivors, marginals, found, apart)
        if other is None:
            break
        at, among, ratio = other
        found.append(expected_path(frames, survivors, trellis.marginals(at, among), model))
        odds.append(ratio)
    order = np.argsort([-each for each in odds], kind="stable").tolist()
    share = np.array(odds)[order]
    return Paths(
        time=np.array([frame.time for frame in frames]),
        cost=cost - np.log(share),
        share=share / share.sum(),
        cheapest=cheapest,
        survivor=np.stack([found[one].survivor for one in order]),
        joints=np.stack([found[one].joints for one in order]),
        deviation=np.stack([found[one].deviation for one in order]),
        confidence=np.stack([found[one].confidence for one in order]),
        interpolated=np.stack([found[one].interpolated for one in order]),
        codes=tuple(_codes(frames, found[one].survivor) for one in order),
        # Nothing that was dropped could have become cheaper, as no cost is negative.
        exact=trellis.dropped >= cost and all((frame.cost >= 0).all() for frame in frames),
    )


def _elsewhere(
    frames: Sequence[SurvivorFrame],
    survivors: Sequence[NDArray[np.int32]],
    marginals: Sequence[Array],
    found: Sequence[ExpectedPath],
    apart: float,
) -> tuple[int, NDArray[np.bool_], float] | None:
    """Find where the body is likeliest elsewhere than on the paths found: frame, ends there, odds against the first."""
    best: tuple[float, int] = (LEAST_SHARE, -1)
    away: list[NDArray[np.bool_]] = []
    for at, (frame, chosen, share) in enumerate(zip(frames, survivors, marginals, strict=True)):
        away.append(chosen >= 0)
        joints = _at(frame, chosen)
        for path in found:
            away[at] &= _apart(joints, path.survivors[at]) > apart
        best = max(best, (float(share[away[at]].max(initial=0.0)), at), key=lambda each: each[0])
    at = best[1]
    if at < 0:
        return None
    share, joints = marginals[at], _at(frames[at], survivors[at])
    one = int(np.argmax(np.where(away[at], share, -1.0)))
    among = away[at] & (_apart(joints, joints[one]) <= apart)
    near = (survivors[at] < 0) | (_apart(joints, found[0].survivors[at]) <= apart)
    return at, among, float(min(share[among].sum() / max(share[near].sum(), LEAST_SHARE), 1.0))


def _at(frame: SurvivorFrame, chosen: NDArray[np.int32]) -> Array:
    """Return the joints (S, 14, 3) of ends at some survivors; NaN where the frame is passed over."""
    joints = np.full((len(chosen), 14, 3), np.nan)
    joints[chosen >= 0] = frame.joints[chosen[chosen >= 0]]
    return joints


def _apart(joints: Array, other: Array) -> Array:
    """Return by how much the farthest joint of postures (N, 14, 3) is elsewhere in another."""
    return np.asarray(np.fmax.reduce(np.linalg.norm(joints - other, axis=-1), axis=1, initial=0.0))


def _codes(frames: Sequence[SurvivorFrame], path: NDArray[np.intp]) -> tuple[str, ...]:
    return tuple(
        frame.branches[one] if one >= 0 and frame.branches else ""
        for frame, one in zip(frames, path.tolist(), strict=True)
    )
