"""Where the search starts: postures as states, and limbs laid on their rays again when the trunk has moved."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from posekit.body.frames import hips_frame, torso_frame
from posekit.geometry import Array, dot, fit_rotation
from posekit.refinement.figure_numbers import LIMB_ENDS, LIMB_MIDDLES, FigureNumbers
from posekit.refinement.limb_terms import Chains
from posekit.refinement.optics import Optics
from posekit.refinement.problem import RefinementProblem
from posekit.refinement.state import PostureState, parents, turned_by_spine
from posekit.skeleton import LIMB_JOINTS

TORSO_PULL_METRES = 0.01
"""Metres: the arm with which hips of which a joint is not known are pulled to the torso's frame."""

HANGING_AXIS = 2
"""The axis of a part along which its limbs hang, downward: where a limb that is not known is put."""


def state_of(anatomy: FigureNumbers, postures: Array, head: Array | None = None) -> PostureState:
    """Lay the figure's torso, hips and head onto those of postures (N, 14, 3) and heads (N, 5, 3); limbs are left open.

    What is NaN is put in its neutral place; the neck must be known.
    """
    n = len(postures)
    offsets = postures[:, :6] - postures[:, :1]
    shape = np.repeat(anatomy.shape[:, None], n, axis=1)
    b, a, right_y, right_z, left_y, left_z, h, hip_right, hip_left = anatomy.shape
    torso = torso_frame(*(postures[:, joint] for joint in range(4)))
    part = np.isnan(torso[:, 0, 0])
    if part.any():
        own = np.array([[a, right_y, right_z], [a, left_y, left_z], [0.0, 0.0, -b]])
        torso[part] = _laid(own, offsets[part, 1:4])
        torso = np.where(np.isnan(torso), np.eye(3), torso)
    pelvis, right, left = (postures[:, joint] for joint in range(3, 6))
    hips = hips_frame(pelvis, right, left, postures[:, 0] if anatomy.middle_pelvis else None)
    part = np.isnan(hips[:, 0, 0])
    if part.any():
        # What one hip leaves open is as the torso has it: a start that is turned at random may be beyond all limits.
        own = np.concatenate([[[0.0, hip_right, -h], [0.0, hip_left, -h]], TORSO_PULL_METRES * np.eye(3)])
        along = TORSO_PULL_METRES * torso[part].transpose(0, 2, 1)
        hips[part] = _laid(own, np.concatenate([offsets[part, 4:6] - offsets[part, 3:4], along], axis=1))
        hips = np.where(np.isnan(hips), torso, hips)
    turned_head = torso
    if head is not None:
        turned_head = _laid(anatomy.head, head - postures[:, :1])
        turned_head = np.where(np.isnan(turned_head), torso, turned_head)
    rotations = [_batch_last(rotation) for rotation in (torso, hips, turned_head)]
    if anatomy.middle_pelvis:
        rotations[1] = turned_by_spine(rotations[0], rotations[1])
    return PostureState(
        root=postures[:, 0].T.copy(),
        torso=rotations[0],
        hips=rotations[1],
        head=rotations[2],
        directions=np.zeros((4, 2, 3, n)),
        shape=shape,
        limbs=np.repeat(anatomy.limbs[:, :, None], n, axis=2),
    )


def measured_state(anatomy: FigureNumbers, postures: Array, head: Array) -> PostureState:
    """Return refined postures (N, 14, 3) and heads (N, 5, 3) as states with lengths of their own."""
    state = state_of(anatomy, postures, head)
    rows = np.tile(np.arange(len(postures)), (4, 1))
    own = [
        [np.linalg.norm(postures[:, b] - postures[:, a], axis=1) for a, b in pairwise(limb)]
        for limb in LIMB_JOINTS
    ]
    inside = np.einsum("jin,ikn->jkn", _batch_last(postures[:, 1:4] - postures[:, :1]), state.torso)
    hips = np.einsum("jin,ikn->jkn", _batch_last(postures[:, 4:6] - postures[:, 3:4]), state.hips)
    right, left, pelvis = inside
    shape = np.stack(
        [
            -pelvis[2],
            (right[0] + left[0]) / 2,
            *right[1:],
            *left[1:],
            -(hips[0, 2] + hips[1, 2]) / 2,
            hips[0, 1],
            hips[1, 1],
        ]
    )
    return state._replace(
        directions=limb_directions(postures, rows, state),
        limbs=np.array(own),
        shape=np.where(np.isfinite(shape), shape, state.shape),
    )


def limb_directions(postures: Array, rows: NDArray[np.intp], state: PostureState) -> Array:
    """Return the directions of limbs (4, 2, 3, M): of each kind those of some postures (4, M), on trunks (M).

    A segment whose ends are not known hangs along its part.
    """
    out = np.empty((4, 2, 3, rows.shape[1]))
    hanging = -parents(state)[:, :, HANGING_AXIS]
    for limb, joints in enumerate(LIMB_JOINTS):
        for segment in range(2):
            along = (postures[rows[limb], joints[segment + 1]] - postures[rows[limb], joints[segment]]).T
            far = np.sqrt(dot(along, along, axis=-2))
            known = far > 0
            out[limb, segment] = np.where(known, along / np.where(known, far, 1.0), hanging[limb])
    return out


def _laid(own: Array, seen: Array) -> Array:
    """Lay a part's points (P, 3) onto seen ones (N, P, 3), the unknown left out; NaN where none is known."""
    known = np.asarray(np.isfinite(seen).all(axis=2))
    rotation = fit_rotation(own, np.where(known[..., None], seen, 0.0))
    rotation[~known.any(axis=1)] = np.nan
    return rotation


def _batch_last(array: Array) -> Array:
    return np.ascontiguousarray(np.moveaxis(array, 0, -1))


def sides(optics: Optics, chains: Chains) -> NDArray[np.bool_]:
    """Return whether limbs' segments (4, 2, N) point away from the camera: their ends lie behind the ray's middle."""
    if not optics.perspective:
        return np.asarray(chains.directions[:, :, 2] > 0)
    middle = chains.start + chains.lengths[:, 0, None] * chains.directions[:, 0]
    end = middle + chains.lengths[:, 1, None] * chains.directions[:, 1]
    return np.asarray(dot(chains.directions, np.stack([middle, end], axis=1), axis=-2) > 0)


def relift(problem: RefinementProblem, chains: Chains, far: NDArray[np.bool_]) -> Chains:
    """Lay limbs on their rays, each segment to its side `far` (4, 2, N).

    Where the ray is out of reach, the segment points to the nearest place on it. Where a joint was not seen, or its
    ray is behind, the segment keeps its direction.
    """
    directions = chains.directions.copy()
    start = chains.start
    for segment, ends in enumerate((LIMB_MIDDLES, LIMB_ENDS)):
        seen = problem.weight[list(ends)] > 0
        length = chains.lengths[:, segment]
        along = _lifted(problem.optics, problem.image[list(ends)], start, length, far[:, segment])
        good = seen & np.isfinite(along).all(axis=1)
        directions[:, segment] = np.where(good[:, None], along, directions[:, segment])
        start = start + length[:, None] * directions[:, segment]
    return chains._replace(directions=directions)


def _lifted(optics: Optics, image: Array, start: Array, length: Array, far: NDArray[np.bool_]) -> Array:
    """Return the directions (4, 3, N) from starts (4, 3, N) to where rays meet the segments' spheres."""
    ray, foot = optics.rays(image, start)
    apart = foot - start
    # Half the chord that the ray cuts from the sphere; zero where the ray passes it by.
    half = np.sqrt(np.maximum(length * length - dot(apart, apart, axis=-2), 0.0))
    along = apart + np.where(far, half, -half)[:, None] * ray
    return np.asarray(along / np.sqrt(dot(along, along, axis=-2))[:, None])
