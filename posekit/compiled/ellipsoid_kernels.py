"""Postures in the ellipsoids of a likelier one as a plain loop, for `posekit.refinement.ellipsoids`."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from posekit.geometry import Array


def is_within(joints: Array, information: Array, first: int, other: int, square: Any) -> Any:
    """Say whether all joints of one posture are within the ellipsoids of those of another."""
    for joint in range(joints.shape[1]):
        off = 0.0
        for i in range(3):
            apart = joints[other, joint, i] - joints[first, joint, i]
            for j in range(3):
                off += (
                    apart
                    * information[first, joint, i, j]
                    * (joints[other, joint, j] - joints[first, joint, j])
                )
        if not off < square:
            return False
    return True


def take_in(
    joints: Array,
    information: Array,
    known: NDArray[Any],
    waiting: NDArray[Any],
    taken_by: NDArray[Any],
    square: float,
) -> Any:
    """Let the first that waits take in those within its ellipsoids, then the next, up to one without an ellipsoid.

    Parameters
    ----------
    joints, information : array (N, 14, 3), (N, 14, 3, 3)
        Metres, and the inverses of covariances.
    known : bool array (N,)
        Which covariances are known.
    waiting : int array (K,)
        Postures of one frame, the best first; those that still wait are written to its front.
    taken_by : int array (N,)
        To be written where one is taken in.
    square : float
        Squared Mahalanobis distance.

    Returns
    -------
    int
        How many still wait.
    """
    begin, count = 0, len(waiting)
    while count - begin > 1 and known[waiting[begin]]:
        first = waiting[begin]
        begin += 1
        to = begin
        for k in range(begin, count):
            other = waiting[k]
            if is_within(joints, information, first, other, square):
                taken_by[other] = first
            else:
                waiting[to] = other
                to += 1
        count = to
    for k in range(begin, count):
        waiting[k - begin] = waiting[k]
    return count - begin


COMPILED_TYPES = {
    "is_within": "",
    "take_in": "(f8[:,:,::1], f8[:,:,:,::1], b1[::1], i8[::1], i8[::1], f8)",
}
"""The kernels, in the order in which they need each other, with the types of those that are called."""
