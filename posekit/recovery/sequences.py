"""One person through a recovered sequence: the survivors of its frames that a body can have moved along."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from posekit.errors import InputError
from posekit.following import (
    PATH_SEPARATION_METRES,
    Beam,
    Following,
    MotionModel,
    Paths,
    SurvivorFrame,
    best_paths,
)
from posekit.following.survivor_paths import joints_of
from posekit.geometry import Array
from posekit.recovery.recovery import FrameRecovery, Recovery
from posekit.skeleton import JOINT, JOINTS

PLACED_NECK_METRES: Final = 0.06
"""Metres that a survivor's neck is off where it had to be placed: so far apart are the places that are tried."""

KNOWN_RADIUS_METRES: Final = 0.02
"""Metres: a joint that was not seen and can be elsewhere by more is not known to the paths."""

MAX_DEVIATION_METRES: Final = 1.0
"""Metres beyond which it does not matter how far off a joint is."""


def follow(
    recovery: Recovery,
    *,
    k: int = 2,
    log_probability: Sequence[ArrayLike] | None = None,
    model: MotionModel | None = None,
    beam: Beam | None = None,
    apart: float = PATH_SEPARATION_METRES,
    progress: Callable[[int, int], None] | None = None,
) -> Following:
    """Follow the person through the frames of a recovery, whose survivors cost what they are ranked.

    All frames are known: it is what `posekit recover --follow K` does. The command `posekit follow` is live, a picture
    at a time: that is `posekit.Tracker`.

    Parameters
    ----------
    recovery : Recovery
        Of a sequence.
    k : int
        How many paths: two or more tell how sure the first is. Fewer come back where there are not so many.
    log_probability : sequence of array (N,), optional
        Of the survivors of each frame, natural logarithm, -inf for impossible ones; that of `Recovery.probability` if
        not given.
    model : MotionModel, optional
        What motion costs; that of a person who walks if not given.
    beam : Beam, optional
        Which paths are followed while searching.
    apart : float
        Metres by which some joint has to be elsewhere in some frame for a path to be another one.
    progress : callable, optional
        Told after every frame how many were searched, and how many will be at most: K times the frames.

    Returns
    -------
    Following

    Raises
    ------
    InputError
        Where no frame has a survivor, times do not ascend, or a number is impossible.

    Examples
    --------
    >>> import posekit
    >>> from posekit.recovery import follow
    >>> following = follow(posekit.recover(posekit.builtin_view("seq1")))
    >>> following.survivor.shape
    (2, 5)
    """
    if log_probability is None:
        log_probability = _logarithms(recovery)
    return follow_frames(
        recovery.frames,
        log_probability=log_probability,
        k=k,
        model=model,
        beam=beam,
        apart=apart,
        progress=progress,
    )


def follow_frames(
    frames: Sequence[FrameRecovery],
    *,
    log_probability: Sequence[ArrayLike] | None = None,
    k: int = 2,
    model: MotionModel | None = None,
    beam: Beam | None = None,
    apart: float = PATH_SEPARATION_METRES,
    progress: Callable[[int, int], None] | None = None,
) -> Following:
    """Follow the person through recovered frames, whose survivors cost nothing unless their probabilities are given.

    In an uncalibrated view postures are followed as they move about their neck, which the picture places only up to
    the scale of each frame, with feet that need not rest. Where frames have several scales the path chooses among them.
    Parameters are those of `follow`.

    Raises
    ------
    InputError
        Where no frame has a survivor, times do not ascend, or a number is impossible.
    """
    if isinstance(k, bool) or not isinstance(k, int) or k < 1:
        raise InputError(f"--follow: {k!r} paths; expected a whole number, one or more")
    if not any(map(len, frames)):
        raise InputError(
            f"--follow: none of {len(frames)} frames has a posture; expected some; correct the view, or allow more"
        )
    given = survivor_frames(frames, log_probability)
    searched = given
    if any(frame.family is not None for frame in frames):
        searched = [_about_neck(frame) for frame in given]
    paths = best_paths(searched, k=k, model=model, beam=beam, apart=apart, progress=progress)
    return _following(frames, given, paths, k, apart)


def ranked_frames(recovery: Recovery) -> list[SurvivorFrame]:
    """Make the frames of a recovery ready for paths, as `survivor_frames` does, with what they are ranked."""
    return survivor_frames(recovery.frames, _logarithms(recovery))


def _logarithms(recovery: Recovery) -> list[Array]:
    with np.errstate(divide="ignore"):
        return [np.log(each) for each in recovery.probability]


def survivor_frames(
    frames: Sequence[FrameRecovery], log_probability: Sequence[ArrayLike] | None = None
) -> list[SurvivorFrame]:
    """Make recovered frames ready for `posekit.following`: `best_paths`, or `Follower` live.

    Joints that were not seen are not known to the paths unless seen ones leave them one place; what noise and a placed
    neck leave open is the survivors' deviation.

    Parameters
    ----------
    frames : sequence of FrameRecovery
        In the order of time.
    log_probability : sequence of array (N,), optional
        By frame; survivors cost nothing if not given.

    Raises
    ------
    InputError
        Where there are other numbers of them.
    """
    if log_probability is not None and len(log_probability) != len(frames):
        raise InputError(
            f"log_probability has {len(log_probability)} frames; expected one array for each of {len(frames)}"
        )
    made = []
    for number, frame in enumerate(frames):
        cost = np.zeros(len(frame))
        if log_probability is not None:
            cost = -np.asarray(log_probability[number], dtype=np.float64)
            if cost.shape != (len(frame),) or not (cost >= -1e-9).all():
                raise InputError(
                    f"log_probability of frame {number} is not {len(frame)} numbers of at most zero; expected the "
                    "natural logarithm of each survivor's probability"
                )
        made.append(
            SurvivorFrame(
                time=frame.time,
                joints=_seen(frame),
                cost=np.maximum(cost, 0.0),
                **_off(frame),
                branches=frame.branches,
            )
        )
    return made


def _seen(frame: FrameRecovery) -> Array:
    """Return survivors (N, 14, 3) without the joints that were completed and may be elsewhere."""
    inferred = frame.inferred
    if not inferred:
        return frame.joints
    joints = frame.joints.copy()
    open_ones = {
        name for one in inferred for name, region in one.items() if not region.radius <= KNOWN_RADIUS_METRES
    }
    joints[:, [JOINT[name] for name in open_ones]] = np.nan
    return joints


def _off(frame: FrameRecovery) -> dict[str, Array]:
    """Return how far off the joints of survivors are: covariances (N, 14, 3, 3) or deviations (N, 14)."""
    if frame.refined is not None:
        covariance = frame.refined.covariance
        size = np.trace(covariance, axis1=2, axis2=3)
        with np.errstate(invalid="ignore", divide="ignore"):
            most = np.minimum(MAX_DEVIATION_METRES**2 / size, 1.0)
        return {
            "covariance": np.where(
                np.isfinite(size * most)[..., None, None], covariance * most[..., None, None], 0.0
            )
        }
    off = 0.0 if frame.judged in (None, "exact") else frame.spread
    return {"deviation": np.full((len(frame), len(JOINTS)), np.hypot(off, _neck_deviation(frame)))}


def _neck_deviation(frame: FrameRecovery) -> float:
    """Return how far off a neck is that had to be placed, metres."""
    placement = frame.placement
    if placement is None or placement.method in ("given", "none"):
        return 0.0
    told = len(placement.necks) == 1 and np.isfinite(placement.deviation)
    return min(placement.deviation, PLACED_NECK_METRES) if told else PLACED_NECK_METRES


def _about_neck(frame: SurvivorFrame) -> SurvivorFrame:
    """Take each survivor's joints from its neck."""
    return replace(frame, joints=frame.joints - frame.joints[:, :1])


def _following(
    frames: Sequence[FrameRecovery], given: Sequence[SurvivorFrame], paths: Paths, k: int, apart: float
) -> Following:
    """Put the first K paths together, in the places where the survivors are."""
    uncalibrated = any(frame.family is not None for frame in frames)
    joints, deviation = paths.joints.copy(), np.where(paths.interpolated, np.inf, paths.deviation)
    if uncalibrated:
        joints = np.stack([joints_of(given, one)[0] for one in paths.survivor])
    scale = np.full(joints.shape[:2], np.nan) if uncalibrated else None
    for path, at in zip(*np.nonzero(paths.survivor >= 0), strict=True):
        frame, chosen = frames[at], int(paths.survivor[path, at])
        # What no frame shows is where this survivor's completion has it.
        lost = np.isnan(joints[path, at, :, 0])
        joints[path, at, lost] = frame.joints[chosen, lost]
        if scale is not None and frame.scales is not None:
            scale[path, at] = frame.scales[chosen]
    return Following(
        time=paths.time,
        survivor=paths.survivor,
        joints=joints,
        interpolated=paths.interpolated,
        deviation=deviation,
        cost=paths.cost,
        confidence=paths.confidence,
        lead=float(paths.cost[1] - paths.cost[0]) if len(paths) > 1 else math.nan if k == 1 else math.inf,
        share=paths.share,
        branches=paths.codes,
        scale=scale,
        exact=paths.exact,
        apart=apart,
        unlisted=np.array([frame.unlisted_probability for frame in frames]),
    )
