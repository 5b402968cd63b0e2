"""What the page needs to lift a posture at another scale: Taylor's family of solutions, one frame at a time.

A tree is walked from its root. Each step keeps the length that its segment has in the recovered posture and which of
its ends is nearer; the image gives the rest (Taylor 2000, eq. 2). The figure's tree and that of Taylor's twelve points
are such walks; joints that the image does not show, or that are completed, follow rigidly.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own.family import Family
from posekit.formats.own.result import ResultFrame
from posekit.skeleton import JOINT, JOINTS, POINTS, TREE_SEGMENTS
from posekit.viewer.scene.drawn_subject import Shown
from posekit.viewer.scene.sight_of_view import hidden
from posekit.viewer.scene.world import World

Array = NDArray[np.float64]
Json = dict[str, Any]
Step = tuple[int, int, int]

MIDDLE_POINTS: Final = {
    "mid_shoulders": (JOINT["right_shoulder"], JOINT["left_shoulder"]),
    "mid_hips": (JOINT["right_hip"], JOINT["left_hip"]),
}
"""The two points of Taylor's tree between joints; their numbers follow those of `posekit.skeleton.POINTS`."""

MID_SHOULDERS, MID_HIPS = len(POINTS), len(POINTS) + 1

TAYLOR_SEGMENTS: Final = (
    (JOINT["right_shoulder"], MID_SHOULDERS),
    (JOINT["left_shoulder"], MID_SHOULDERS),
    (MID_SHOULDERS, MID_HIPS),
    (JOINT["right_hip"], MID_HIPS),
    (JOINT["left_hip"], MID_HIPS),
    *(
        (JOINT[f"{side}_{start}"], JOINT[f"{side}_{end}"])
        for start, end in (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))
        for side in ("right", "left")
    ),
)
"""Segments of Taylor's human (2000, Table 1), the girdles in halves."""

MOST_OF_CURVE: Final = 240
"""Points of the residual's curve in a page."""

FLAT_DEPTH_METRES: Final = 1e-9
"""Metres: a segment that is less deep than this lies in the image plane, and counts as nearer."""


def walk(names: Sequence[str]) -> list[Step]:
    """Order a tree's segments from its root: child, parent, and the joint to reflect in the parent, or -1.

    Parameters
    ----------
    names : sequence of str
        The joints of the tree's levels, the root first. With the middles of the girdles among them the tree is
        Taylor's, else the figure's.
    """
    if not set(MIDDLE_POINTS) <= set(names) or names[0] not in JOINT:
        return [(child, parent, -1) for parent, child in TREE_SEGMENTS]
    pairs = dict(zip((MID_SHOULDERS, MID_HIPS), MIDDLE_POINTS.values(), strict=True))
    placed, steps = [JOINT[names[0]]], []
    for parent in placed:
        for a, b in TAYLOR_SEGMENTS:
            child = b if a == parent else a
            if parent not in (a, b) or child in placed:
                continue
            # A girdle is straight: its second end mirrors the first, even where it lies in the image plane.
            pair = pairs.get(parent, ())
            other = next((joint for joint in pair if joint in placed and joint != child), -1)
            steps.append((child, parent, other if child in pair else -1))
            placed.append(child)
    return steps


def tree_of(names: Sequence[str]) -> Json:
    """Describe the walk for the page: its steps, and what the middles are the middles of."""
    steps = walk(names)
    return {
        "root": steps[0][1],
        "steps": [list(step) for step in steps],
        "middles": [[name, *pair] for name, pair in MIDDLE_POINTS.items()],
    }


def family_data(frame: ResultFrame, shown: Shown, world: World, steps: Sequence[Step]) -> Json | None:
    """Gather a frame's family; None where there is none, nobody survived, or the root was not seen.

    Image points count from the middle of the image, in square pixels; `anchor` is where that middle is in the world.
    """
    family = frame.family
    if family is None or frame.scales is None or not len(frame.joints) or shown.sight is None:
        return None
    scales, at = np.unique(frame.scales, return_inverse=True)
    image = frame.joints[0, :, :2] * frame.scales[0]
    image[[JOINT[name] for name in hidden(frame)]] = np.nan
    nodes = _nodes(frame.joints)
    exact = _exact(frame, image)
    root = steps[0][1]
    if not exact[root]:
        return None
    middle = shown.sight.middle
    lengths, signs = _steps(nodes, exact, steps)
    return {
        "how": family.how,
        "bound": family.bound,
        "segment": family.segment,
        "minima": _minima(family),
        "curve": _curve(family),
        "scales": scales.tolist(),
        "at": at.reshape(-1).tolist(),
        "middle": middle.tolist(),
        "anchor": world.place(np.array([*(middle / frame.scales[0]), 0.0])).tolist(),
        "image": [None if np.isnan(point).any() else (point - middle).tolist() for point in image],
        "roots": [round(depth, 9) for depth in nodes[:, root, 2].tolist()],
        "lengths": lengths,
        "signs": signs,
    }


def inferred_data(frame: ResultFrame) -> list[Json]:
    """List for each survivor the joints that were not seen: boxes count from the joint, camera axes, metres."""
    found = []
    for joints, one in zip(frame.joints, frame.inferred or (), strict=False):
        found.append(
            {
                str(JOINT[name]): {
                    "kind": region.kind,
                    "lower": np.round(region.lower - joints[JOINT[name]], 4).tolist(),
                    "upper": np.round(region.upper - joints[JOINT[name]], 4).tolist(),
                    "radius": round(region.radius, 4),
                    "fraction": float(f"{region.fraction:.3g}"),
                }
                for name, region in one.items()
                if np.isfinite(joints[JOINT[name]]).all()
            }
        )
    return found


def _nodes(joints: Array) -> Array:
    """Append to joints (N, 14, 3) an unknown head and the girdles' middles: (N, 21, 3)."""
    head = np.full((len(joints), len(POINTS) - len(JOINTS), 3), np.nan)
    middles = [joints[:, pair].mean(axis=1, keepdims=True) for pair in map(list, MIDDLE_POINTS.values())]
    return np.concatenate([joints, head, *middles], axis=1)


def _exact(frame: ResultFrame, image: Array) -> list[bool]:
    """Tell of each node whether its image point is there and its position follows from it alone."""
    guessed = {name for joints in frame.inferred or () for name in joints}
    exact = [
        name not in guessed and bool(np.isfinite(point).all())
        for name, point in zip(JOINTS, image, strict=True)
    ]
    return [
        *exact,
        *[False] * (len(POINTS) - len(JOINTS)),
        *(exact[a] and exact[b] for a, b in MIDDLE_POINTS.values()),
    ]


def _steps(
    nodes: Array, exact: Sequence[bool], steps: Sequence[Step]
) -> tuple[list[float | None], list[str]]:
    """Return the length of each step, metres, and each survivor's choices: 0 near, 1 far, r moves rigidly."""
    lengths: list[float | None] = []
    columns = []
    for child, parent, _ in steps:
        apart = nodes[:, child] - nodes[:, parent]
        lifted = exact[child] and exact[parent]
        # Where a tolerance let one be too short for its image, it is longer at that scale than it is.
        lengths.append(float(np.linalg.norm(apart, axis=1).min()) if lifted else None)
        columns.append(
            np.where(apart[:, 2] > FLAT_DEPTH_METRES, "1", "0") if lifted else np.full(len(nodes), "r")
        )
    return lengths, ["".join(row) for row in zip(*columns, strict=True)]


def _minima(family: Family) -> list[list[float]]:
    """Return scale and residual of each minimum, best first; flips that share one count once."""
    found: dict[float, list[float]] = {}
    for s, residual in zip(family.minima_s.tolist(), family.minima_residual.tolist(), strict=True):
        found.setdefault(float(f"{s:.6g}"), [s, residual])
    return list(found.values())


def _curve(family: Family) -> list[list[float]]:
    """Return scale and residual along the curve, the lowest of every few samples."""
    s, residual = family.curve_s, family.curve_residual
    every = max(1, -(-len(s) // MOST_OF_CURVE))
    rows = [start + int(np.argmin(residual[start : start + every])) for start in range(0, len(s), every)]
    return [[float(f"{s[row]:.9g}"), float(f"{residual[row]:.4g}")] for row in rows]
