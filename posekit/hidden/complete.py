"""Completing survivors: every joint that was not seen gets the set of its positions, and one of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from posekit.body import Figure
from posekit.cameras import Camera
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.hidden.completion import CompletedSurvivors
from posekit.hidden.measured_cores import complete_by_core
from posekit.hidden.occlusion_pattern import JointState, OcclusionPattern
from posekit.hidden.pattern_batch import PatternBatch
from posekit.hidden.posture_rows import Index
from posekit.hidden.rays import find_rays
from posekit.hidden.sampling import OcclusionSampling
from posekit.hidden.set_descriptions import describe_sets
from posekit.hidden.trunk_placements import EXACT_WITHIN_METRES
from posekit.skeleton import JOINTS, POINTS
from posekit.tree import Check, Leaves

SAME_CORE_METRES = 0.03
"""Metres between joints that were measured, at most, that count as one."""

ROWS_AT_ONCE = 250_000
"""Placements of a limb judged together: enough to spread NumPy's overhead, few enough for the memory."""


def complete(
    leaves: Leaves,
    camera: Camera,
    image: Array,
    figure: Figure,
    checks: Sequence[Check],
    *,
    tolerance: float = 0.0,
    sampling: OcclusionSampling | None = None,
) -> CompletedSurvivors:
    """Fill in the joints of survivors that have no position: hidden ones, and seen ones beyond them.

    Parameters
    ----------
    leaves : Leaves
        Survivors of trees of the stick figure, with the head as `given` points.
    camera : Camera
        The one that they were grown with: its first axis counts the leaves' frames.
    image : array (F, 14, 2)
        The image points that they were grown with; NaN where a joint was not seen.
    figure : Figure
        Whose lengths the trees had; its rigid torso and hips are laid onto the known points.
    checks : sequence of Check
        Those that judged the trees, those of the leaves included: each that reads an unknown joint is asked now.
    tolerance : float
        Metres by which a segment may be too short for its image, as for the tree. Above 1e-6 the points were
        measured: what follows from the rigid parts is then no proof, and a torso without its pelvis may spin.
    sampling : OcclusionSampling, optional
        How finely sets are sampled.

    Returns
    -------
    CompletedSurvivors
        One row a survivor. Known joints are unchanged; with nothing hidden, nothing is changed.

    Raises
    ------
    InputError
        Where a shape is wrong, or a survivor's neck is not known: nothing hangs on anything then.
    """
    head = np.full((leaves.n_frames, len(POINTS) - len(JOINTS), 3), np.nan)
    head[:, : leaves.given.shape[1]] = leaves.given[:, : head.shape[1]]
    frame = np.asarray(leaves.frame, dtype=np.intp)
    points = np.concatenate([leaves.postures(), head[frame]], axis=1)
    return complete_points(
        points, frame, camera, image, figure, checks, tolerance=tolerance, sampling=sampling
    )


def complete_points(
    points: Array,
    frame: Index,
    camera: Camera,
    image: Array,
    figure: Figure,
    checks: Sequence[Check],
    *,
    tolerance: float = 0.0,
    sampling: OcclusionSampling | None = None,
) -> CompletedSurvivors:
    """Do what `complete` does for postures of any origin.

    Parameters
    ----------
    points : array (N, 19, 3)
        Joints and head points, camera frame, metres; NaN where they are not known.
    frame : int array (N,)
        Which row of `image` each was seen in.
    camera, image, figure, checks, tolerance, sampling
        See `complete`.
    """
    sampling = sampling or OcclusionSampling()
    if image.shape[1:] != (len(JOINTS), 2) or (len(frame) and int(frame.max()) >= len(image)):
        expected = (int(frame.max(initial=0)) + 1, len(JOINTS), 2)
        raise InputError(f"image has shape {image.shape}; expected {expected}, one row a frame of the leaves")
    done = CompletedSurvivors.of_exact(points[:, : len(JOINTS)])
    unknown = np.asarray(np.isnan(points[:, : len(JOINTS)]).any(axis=-1))
    open_ = np.flatnonzero(unknown.any(axis=1))
    if not len(open_):
        return done.frozen()
    rootless = open_[unknown[open_, 0]]
    if len(rootless):
        raise InputError(
            f"the neck of survivor {int(rootless[0])} is not known, on which all hidden joints hang; expected the "
            "root or the head of every frame with survivors"
        )
    root = np.full((len(image), 3), np.nan)
    root[frame] = points[:, 0]
    rays = find_rays(camera, root, image, reach=sum(figure.lengths.values()))
    seen = np.asarray(np.isfinite(image).all(axis=-1))[frame]
    states = np.where(unknown, np.where(seen, JointState.SEEN, JointState.HIDDEN), JointState.EXACT)
    # Which checks can be asked when depends on the pattern of seen and hidden joints alone: survivors that share one
    # are completed together.
    patterns, which = np.unique(states[open_], axis=0, return_inverse=True)
    for k, joint_states in enumerate(patterns):
        pattern = OcclusionPattern(
            states=tuple(JointState(int(state)) for state in joint_states), checks=checks
        )
        rows = open_[which.reshape(-1) == k]

        def describe(pattern: OcclusionPattern, rows: Index, coarse: OcclusionSampling | None = None) -> None:
            finely = coarse or sampling
            for part in _parts(rows, pattern, finely):
                batch = PatternBatch.of(
                    points=points[part],
                    frame=frame[part],
                    pattern=pattern,
                    figure=figure,
                    rays=rays,
                    tolerance=tolerance,
                    sampling=finely,
                )
                describe_sets(batch, done, part)

        if tolerance > EXACT_WITHIN_METRES:
            complete_by_core(
                pattern, points, frame, rows, done, describe, within=min(tolerance, SAME_CORE_METRES)
            )
        else:
            describe(pattern, rows)
    return done.frozen()


def _parts(rows: Index, pattern: OcclusionPattern, sampling: OcclusionSampling) -> list[Index]:
    """Split survivors, in order, so that what is judged together fits into the memory."""
    # Placements of one limb of one survivor: middles times ends where both are hidden, else near and far of each
    # middle; about four times as many where the trunk has several placements that share them out.
    both = any(
        all(pattern.states[joint] == JointState.HIDDEN for joint in limb.free) for limb in pattern.limbs
    )
    each = sampling.sphere * (sampling.ends // 2 if both else 2) * (4 if pattern.trunk_joints else 1)
    size = max(ROWS_AT_ONCE // each, 8)
    return [rows[first : first + size] for first in range(0, len(rows), size)]
