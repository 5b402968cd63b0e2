r"""Forward kinematics of a BVH hierarchy, over all frames at once.

A joint's frame in its parent's is the translation by its offset and position channels, then the rotations in the order
in which its channels stand, each about the axes that the one before has turned (Meredith & Maddock 2001, *Motion
Capture File Formats Explained*, University of Sheffield CS-01-11): :math:`T = T(o) R_a R_b R_c`.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posekit.formats.motion.bvh_file import BvhFile
from posekit.geometry import Array, coordinate_rotation

_CHUNK: Final = 2_000_000
"""Numbers in the rotations that are held at a time."""
SMALL_OFFSET_SHARE: Final = 1e-3
"""Fraction of the largest offset below which an offset says nothing about its position channels."""


def points_of(file: BvhFile, *, absolute: bool) -> Array:
    """Place the joints and End Sites of every frame.

    Parameters
    ----------
    file : BvhFile
        The joints and the frames of a BVH file.
    absolute : bool
        Whether position channels stand in place of the offset, or are added to it: see `positions_are_absolute`.

    Returns
    -------
    array (T, P, 3)
        The file's unit and axes.
    """
    count = len(file.hierarchy.names)
    points = np.empty((len(file.values), count, 3))
    step = max(1, _CHUNK // (9 * count))
    for start in range(0, len(points), step):
        piece = slice(start, start + step)
        _place(file, file.values[piece], points[piece], absolute)
    return points


def _place(file: BvhFile, values: Array, points: Array, absolute: bool) -> None:
    tree = file.hierarchy
    rotations: list[Array | None] = []
    column = 0
    for k, (parent, channels) in enumerate(zip(tree.parents, tree.channels, strict=True)):
        local = np.tile(tree.offsets[k], (len(values), 1))
        turn = None if parent < 0 else rotations[parent]
        R = turn
        for channel in channels:
            value = values[:, column]
            column += 1
            if channel.rotates:
                one = coordinate_rotation(channel.axis, np.radians(value))
                R = one if R is None else R @ one
            elif absolute:
                local[:, channel.axis] = value
            else:
                local[:, channel.axis] += value
        if turn is not None:
            local = np.einsum("tij,tj->ti", turn, local)
        points[:, k] = local if parent < 0 else points[:, parent] + local
        rotations.append(R)


def positions_are_absolute(file: BvhFile) -> bool:
    """Tell whether position channels stand in place of the offsets, or are added to them.

    The notes on the format add the two; MotionBuilder, Blender and the data sets made with them (LaFAN1,
    Bandai-Namco) write the joint's whole place into its position channels, beside the same offset. A joint's channels
    that keep near its offset are taken as its place. Joints below a root decide; a root alone would only stand
    elsewhere.
    """
    tree, column = file.hierarchy, 0
    small = SMALL_OFFSET_SHARE * float(np.abs(tree.offsets).max(initial=0.0))
    votes: dict[bool, list[bool]] = {True: [], False: []}
    for k, channels in enumerate(tree.channels):
        near = []
        for channel in channels:
            offset = tree.offsets[k, channel.axis]
            if not channel.rotates and abs(offset) > small:
                middle = np.median(file.values[:, column])
                near.append(bool(abs(middle - offset) < 0.5 * abs(offset)))
            column += 1
        if near:
            votes[tree.parents[k] < 0].append(any(near))
    decisive = votes[False] or votes[True]
    return bool(decisive) and 2 * sum(decisive) >= len(decisive)
