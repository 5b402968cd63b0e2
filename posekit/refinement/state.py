r"""Postures as what is varied: the root, three rotations, eight directions, and lengths.

It is the configuration in another chart. A ball joint and the hinge below it are four angles, and so are the two
directions of a limb's segments; but directions have no singular place, where a straight limb leaves its axial
rotation free and two axes of a shoulder may coincide. They are taken in the camera's frame, so that turning the trunk
only shifts a limb that the image holds. Arrays have the batch as their last axis.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, cross, perpendicular, unit
from posekit.geometry.batch_last import matrix_product, matrix_vector, step_rotation
from posekit.refinement.figure_numbers import ARM_LIMBS, LEG_LIMBS, LIMB_ENDS, LIMB_MIDDLES

Rows = NDArray[np.intp]


class PostureState(NamedTuple):
    """N postures.

    Attributes
    ----------
    root : array (3, N)
        The neck, camera frame, metres.
    torso, hips, head : array (3, 3, N)
        Rotations from the part's frame into the camera's.
    directions : array (4, 2, 3, N)
        Unit vectors of the limbs' upper and lower segments, camera frame.
    shape : array (9, N)
        See `posekit.refinement.figure_numbers.FigureNumbers`, metres.
    limbs : array (4, 2, N)
        Lengths of the limbs' segments, metres.
    """

    root: Array
    torso: Array
    hips: Array
    head: Array
    directions: Array
    shape: Array
    limbs: Array

    def take(self, rows: Rows) -> PostureState:
        """Return some postures."""
        return PostureState(*(array[..., rows] for array in self))

    def put(self, rows: Rows, other: PostureState) -> None:
        """Overwrite some postures."""
        for mine, theirs in zip(self, other, strict=True):
            mine[..., rows] = theirs

    def copy(self) -> PostureState:
        """Return a copy."""
        return PostureState(*(array.copy() for array in self))


class PostureStep(NamedTuple):
    """A step away from N postures.

    Attributes
    ----------
    trunk : array (9, N) or (18, N)
        Shift of the root, rotation vectors of torso and hips (camera frame), then changes of the shape.
    limbs : array (U, 4, N) or None
        Along the tangents of upper and lower direction, two each, radians; then the logarithms of their lengths.
    head : array (3, N) or None
        Rotation vector.
    """

    trunk: Array
    limbs: Array | None = None
    head: Array | None = None

    def take(self, rows: Rows) -> PostureStep:
        """Return the steps of some postures."""
        limbs = None if self.limbs is None else self.limbs[..., rows]
        return PostureStep(self.trunk[..., rows], limbs, None if self.head is None else self.head[..., rows])


def trunk_offsets(state: PostureState) -> Array:
    """Place torso and hips relative to the root (6, 3, N), metres."""
    out = np.zeros((6, 3, state.root.shape[1]))
    shape = state.shape
    z = state.torso[:, 2]
    forward = shape[1] * state.torso[:, 0]
    out[3] = -shape[0] * z
    across, down = state.hips[:, 1], out[3] - shape[6] * state.hips[:, 2]
    for joint in (0, 1):
        out[1 + joint] = forward + shape[2 + 2 * joint] * state.torso[:, 1] + shape[3 + 2 * joint] * z
        out[4 + joint] = down + shape[7 + joint] * across
    return out


def trunk_joints(state: PostureState) -> Array:
    """Place torso and hips (N, 6, 3), camera frame, metres."""
    return np.asarray((state.root + trunk_offsets(state)).transpose(2, 0, 1))


def place(state: PostureState, offsets: Array | None = None) -> Array:
    """Place all joints (14, 3, N), camera frame, metres."""
    out = np.empty((14, 3, state.root.shape[1]))
    out[:6] = state.root + (trunk_offsets(state) if offsets is None else offsets)
    place_limbs(out[[1, 2, 4, 5]], state.directions, state.limbs, out[6:])
    return out


def place_limbs(starts: Array, directions: Array, lengths: Array, out: Array) -> None:
    """Place middles and ends of limbs from their starts (4, 3, N), into the last eight joints (8, 3, N)."""
    middle = starts + lengths[:, 0, None] * directions[:, 0]
    out[_MIDDLE] = middle
    out[_END] = middle + lengths[:, 1, None] * directions[:, 1]


_MIDDLE, _END = ([joint - 6 for joint in joints] for joints in (LIMB_MIDDLES, LIMB_ENDS))


def moved(state: PostureState, step: PostureStep, tangents: Array | None) -> PostureState:
    """Take a step; `tangents` (4, 2, 2, 3, N) are the unit vectors along which it turns the limbs."""
    trunk = step.trunk
    directions, limbs = state.directions, state.limbs
    if step.limbs is not None and tangents is not None:
        directions, limbs = moved_limbs(directions, limbs, step.limbs, tangents)
    return PostureState(
        root=state.root + trunk[:3],
        torso=matrix_product(step_rotation(trunk[3:6]), state.torso),
        hips=matrix_product(step_rotation(trunk[6:9]), state.hips),
        head=state.head if step.head is None else matrix_product(step_rotation(step.head), state.head),
        directions=directions,
        shape=state.shape + trunk[9:] if len(trunk) > 9 else state.shape,
        limbs=limbs,
    )


def moved_limbs(directions: Array, lengths: Array, step: Array, tangents: Array) -> tuple[Array, Array]:
    """Turn and lengthen limbs by a step (U, 4, N)."""
    turn = step[:4].reshape(2, 2, *step.shape[1:])
    along = np.einsum("stln,lstin->lsin", turn, tangents)
    along += directions
    if len(step) > 4:
        # The logarithm of a length is varied: no step makes it negative.
        lengths = lengths * np.exp(step[4:]).transpose(1, 0, 2)
    return unit(along, axis=-2), lengths


def turned_by_spine(torso: Array, hips: Array) -> Array:
    """Turn hips (3, 3, N) about their own line until they are upright as the torso (3, 3, N) is.

    As `posekit.body.frames.hips_frame` does where the pelvis is between them; unturned where the line is upright.
    """
    left = hips[:, 1]
    up = unit(perpendicular(torso[:, 2], left, axis=-2), axis=-2)
    turned = np.stack([cross(left, up, axis=-2), left, up], axis=1)
    return np.asarray(np.where(np.isnan(turned), hips, turned))


def parents(state: PostureState, *, on_torso: bool = False) -> Array:
    """Return the rotation of the part by which each limb is judged (4, 3, 3, N): it hangs on it, unless `on_torso`."""
    out = np.empty((4, 3, 3, state.root.shape[1]))
    out[ARM_LIMBS], out[LEG_LIMBS] = state.torso, state.torso if on_torso else state.hips
    return out


def head_points(state: PostureState, offsets: Array) -> Array:
    """Place the head's points relative to the root (5, 3, N)."""
    return np.stack(
        [matrix_vector(state.head, np.broadcast_to(o[:, None], state.root.shape)) for o in offsets]
    )
