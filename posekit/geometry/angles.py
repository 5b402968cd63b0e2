"""Angles that say the same: full turns more, and the other branch of three successive rotations."""

from __future__ import annotations

import numpy as np

from posekit.geometry.arrays import Array


def turned_near(angles: Array, middle: Array | float, *, half_turn: float = np.pi) -> Array:
    """Add full turns so that angles lie within half a turn of a middle.

    Parameters
    ----------
    angles : array (...)
        Radians, or what `half_turn` is in.
    middle : array (...) or float
        Where they are to be near; broadcast.
    half_turn : float
        Half a turn in their unit: 180 where they are degrees.

    Returns
    -------
    array (...)
        From half a turn below the middle to half a turn above it.
    """
    # Whole turns by `floor`, which costs a fraction of `mod`; the end above belongs to the next turn.
    turns = np.floor((angles - middle + half_turn) / (2 * half_turn))
    return np.asarray(angles - 2 * half_turn * turns)


def other_branch(angles: Array, *, half_turn: float = np.pi) -> Array:
    r"""Return the angles of the same rotation with the second on the other side of a quarter turn.

    :math:`(\alpha, \beta, \gamma) \to (\alpha + \pi, \pi - \beta, \gamma + \pi)` for rotations about three axes that
    are square to each other (Diebel 2006, *Representing Attitude*, §5.6). Of the first two alone it gives the third
    axis the same direction; a hinge that follows the three keeps its angle.

    Parameters
    ----------
    angles : array (..., K)
        Two, three or four angles: radians, or what `half_turn` is in.
    half_turn : float
        Half a turn in their unit.

    Returns
    -------
    array (..., K)
    """
    a, b = angles[..., 0] + half_turn, half_turn - angles[..., 1]
    rest = angles[..., 2:].copy()
    rest[..., :1] += half_turn
    return np.concatenate([np.stack([a, b], axis=-1), rest], axis=-1)


def other_hinge(angles: Array, *, half_turn: float = np.pi) -> Array:
    r"""Return the angles of a limb that is bent to the other side after half a turn about itself.

    :math:`(\gamma, \varepsilon) \to (\gamma + \pi, -\varepsilon)` gives the lower segment the same direction.

    Parameters
    ----------
    angles : array (..., 4)
        Three of a ball joint and one of the hinge below it: radians, or what `half_turn` is in.
    half_turn : float
        Half a turn in their unit.

    Returns
    -------
    array (..., 4)
    """
    found = angles.copy()
    found[..., 2] += half_turn
    found[..., 3] *= -1.0
    return found
