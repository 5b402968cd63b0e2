"""What a BVH file does not say: its unit and which axis is up, told by the body in it."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from posekit.formats.motion.bvh_file import BvhFile
from posekit.formats.motion.motion_format import METRES_IN_UNIT
from posekit.formats.skeleton_maps import LANDMARK_INDEX, find_by_names
from posekit.geometry import Array
from posekit.safe_io import refusal

CMU_UNIT_METRES: Final = 0.0254 / 0.45
"""Metres in a unit of the CMU database, inches times 0.45 (mocap.cs.cmu.edu, FAQs): also in its BVH conversions."""
METRES_IN_BVH_UNIT: Final = {**METRES_IN_UNIT, "0.45 in": CMU_UNIT_METRES}
BODY_METRES: Final = 2.0
"""Metres along the bones from a hand to a foot, or between the two ends of the body that are farthest: what the
figure of Lee & Chen 1985 has; skeletons of CMU, LaFAN1 and Bandai-Namco have 1.9 to 2.3."""
SMALLEST_BODY_METRES, LARGEST_BODY_METRES = 0.9, 4.5
"""Metres along the bones of a small child, and of a giant."""
FRAMES_SAMPLED: Final = 200
"""Frames that are looked at."""
UPRIGHT_COSINE, LEANING_COSINE = 0.8, 0.3
"""Cosines between the body and an axis, as a mean over frames, for it to be up in place of y."""


class BvhUnit(NamedTuple):
    """A unit: its name, the metres in it, and how it is known."""

    name: str
    metres: float
    why: str


def sampled(points: Array) -> Array:
    """Return at most `FRAMES_SAMPLED` frames of many, evenly spread."""
    return points[:: max(1, len(points) // FRAMES_SAMPLED)]


def guessed_unit(file: BvhFile, points: Array) -> BvhUnit:
    """Tell the unit by the length of the body's longest chain of bones, which no posture changes.

    Raises
    ------
    InputError
        Where it is a body's in no unit.
    """
    length = longest_chain(sampled(points), file.hierarchy.parents)
    ratio = {name: length * scale / BODY_METRES for name, scale in METRES_IN_BVH_UNIT.items()}
    name = min(METRES_IN_BVH_UNIT, key=lambda unit: abs(np.log(max(ratio[unit], 1e-300))))
    metres = length * METRES_IN_BVH_UNIT[name]
    if not SMALLEST_BODY_METRES <= metres <= LARGEST_BODY_METRES:
        got = f"a skeleton whose longest chain of bones has {length:.4g} units"
        expected = f"about {BODY_METRES:g} m in {', '.join(METRES_IN_BVH_UNIT)}"
        raise refusal(file.path, "unit", got, expected, "state the unit")
    return BvhUnit(
        name, METRES_IN_BVH_UNIT[name], f"its longest chain of bones has {length:.4g} units, {metres:.2f} m"
    )


def longest_chain(points: Array, parents: tuple[int, ...]) -> float:
    """Return the longest way along the bones between two ends of the tree, the median over frames.

    A root that has one child alone is a place in the world and no part of the body.
    """
    count = len(parents)
    children = np.bincount([parent for parent in parents if parent >= 0], minlength=count)
    bone = np.zeros(count)
    outside = set()
    for k, parent in enumerate(parents):
        if parent < 0 or parent in outside:
            if children[k] == 1:
                outside.add(k)
        else:
            bone[k] = np.median(np.linalg.norm(points[:, k] - points[:, parent], axis=-1))
    deepest, longest = np.zeros(count), 0.0
    for k in range(count - 1, -1, -1):
        parent = parents[k]
        if parent >= 0:
            way = deepest[k] + bone[k]
            longest = max(longest, deepest[parent] + way)
            deepest[parent] = max(deepest[parent], way)
    return float(longest)


def guessed_up(points: Array, names: tuple[str, ...]) -> str:
    """Tell which axis is up: y, as is customary, unless the body stands along another in most of the file.

    Parameters
    ----------
    points : array (T, P, 3)
        The joints over time, in any unit.
    names : tuple of str (P,)
        The names of the joints.

    Returns
    -------
    str
        ``+y``; another where a skeleton map knows the names and shoulders stand above ankles along that one.
    """
    maps = find_by_names(names)
    if not maps:
        return "+y"
    body = maps[0].gather(sampled(points), names)
    ankles = (body[:, LANDMARK_INDEX["right_ankle"]] + body[:, LANDMARK_INDEX["left_ankle"]]) / 2
    shoulders = (body[:, LANDMARK_INDEX["right_shoulder"]] + body[:, LANDMARK_INDEX["left_shoulder"]]) / 2
    way = shoulders - ankles
    length = np.linalg.norm(way, axis=-1)
    if not (length > 0).all():
        return "+y"
    mean = (way / length[:, None]).mean(axis=0)
    axis = int(np.argmax(np.abs(mean)))
    if abs(mean[axis]) < UPRIGHT_COSINE or (axis != 1 and abs(mean[1]) > LEANING_COSINE):
        return "+y"
    return f"{'+' if mean[axis] > 0 else '-'}{'xyz'[axis]}"
