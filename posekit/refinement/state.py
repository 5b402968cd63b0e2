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

from posekit.cameras import Array
from posekit.refinement.anatomy import ARMS, END, LEGS, MIDDLE
from posekit.refinement.small import cross, dot, product, rotation, turned

Rows = NDArray[np.intp] | NDArray[np.bool_] | slice


class State(NamedTuple):
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
        See `posekit.refinement.anatomy.Anatomy`, metres.
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

    def take(self, rows: Rows) -> State:
        """Return some postures."""
        return State(*(array[..., rows] for array in self))

    def put(self, rows: Rows, other: State) -> None:
        """Overwrite some postures."""
        for mine, theirs in zip(self, other, strict=True):
            mine[..., rows] = theirs


class Step(NamedTuple):
    """A step away from N postures.

    Attributes
    ----------
    trunk : array (9, N) or (18, N)
        Shift of the root, rotation vectors of torso and hips (camera frame), then changes of the shape.
    limbs : array (4, U, N)
        Along the tangents of upper and lower direction, two each, radians; then the logarithms of their lengths.
    head : array (3, N)
        Rotation vector.
    """

    trunk: Array
    limbs: Array
    head: Array


class Joints(NamedTuple):
    """Where the joints are.

    Attributes
    ----------
    trunk : array (6, 3, N)
        From the root, camera frame, metres.
    joints : array (14, 3, N)
        Camera frame, metres.
    """

    trunk: Array
    joints: Array


def trunk_offsets(state: State) -> Array:
    """Place torso and hips relative to the root (6, 3, N)."""
    b, a, right_y, right_z, left_y, left_z, h, hip_right, hip_left = state.shape
    x, y, z = state.torso[:, 0], state.torso[:, 1], state.torso[:, 2]
    out = np.zeros((6, 3, state.root.shape[1]))
    out[1] = a * x + right_y * y + right_z * z
    out[2] = a * x + left_y * y + left_z * z
    out[3] = -b * z
    across, down = state.hips[:, 1], -h * state.hips[:, 2]
    out[4] = out[3] + hip_right * across + down
    out[5] = out[3] + hip_left * across + down
    return out


def place(state: State) -> Joints:
    """Place all joints."""
    trunk = trunk_offsets(state)
    out = np.empty((14, 3, state.root.shape[1]))
    out[:6] = state.root + trunk
    middle = out[[1, 2, 4, 5]] + state.limbs[:, 0, None] * state.directions[:, 0]
    out[list(MIDDLE)] = middle
    out[list(END)] = middle + state.limbs[:, 1, None] * state.directions[:, 1]
    return Joints(trunk, out)


def moved(state: State, step: Step, tangents: Array) -> State:
    """Take a step; `tangents` (4, 2, 2, 3, N) are the unit vectors that it counts along."""
    trunk = step.trunk
    turn = step.limbs[:, :4].reshape(4, 2, 2, -1)
    along = turn[:, :, 0, None] * tangents[:, :, 0] + turn[:, :, 1, None] * tangents[:, :, 1]
    angle = np.sqrt(dot(along, along))[:, :, None]
    safe = np.where(angle > 0, angle, 1.0)
    directions = np.cos(angle) * state.directions + np.sin(safe) / safe * along
    directions /= np.sqrt(dot(directions, directions))[:, :, None]
    lengthened = step.limbs.shape[1] > 4
    return State(
        root=state.root + trunk[:3],
        torso=product(rotation(trunk[3:6]), state.torso),
        hips=product(rotation(trunk[6:9]), state.hips),
        head=product(rotation(step.head), state.head) if step.head.size else state.head,
        directions=directions,
        shape=state.shape + trunk[9:] if len(trunk) > 9 else state.shape,
        limbs=state.limbs * np.exp(step.limbs[:, 4:]) if lengthened else state.limbs,
    )


def parents(state: State) -> Array:
    """Return the rotation of the part on which each limb hangs (4, 3, 3, N)."""
    out = np.empty((4, 3, 3, state.root.shape[1]))
    out[ARMS], out[LEGS] = state.torso, state.hips
    return out


def head_points(state: State, offsets: Array) -> Array:
    """Place the head's points relative to the root (5, 3, N)."""
    return np.stack([turned(state.head, np.broadcast_to(o[:, None], state.root.shape)) for o in offsets])


__all__ = ["Joints", "State", "Step", "cross", "head_points", "moved", "parents", "place", "trunk_offsets"]
