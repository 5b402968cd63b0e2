"""The scale of an uncalibrated picture: stated, determined by constraints, or estimated (Taylor 2000, §2 and §3)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any, Final

import numpy as np

from posekit.body import Figure
from posekit.errors import refusal
from posekit.geometry import Array
from posekit.recovery.objects import Linkage, LinkageFamily, search
from posekit.skeleton import JOINT, JOINTS, SEGMENT_NAMES, SEGMENTS
from posekit.solver import Problem

#: Square root of the projected area of a person. The projection of a convex body has on average a quarter of the body's
#: surface (Cauchy), and an adult's surface is 1.8 square metres (Du Bois & Du Bois 1916).
ROOT_AREA_METRES: Final = 0.67

#: Root mean square distance of annotators' points, in units of the root of the person's area in the picture: the
#: constants of COCO's object keypoint similarity (cocodataset.org/#keypoints-eval) for the shoulders (also used for the
#: neck), the hips (also for the pelvis), elbows, wrists, knees and ankles.
ANNOTATION_SIGMAS: Final = np.repeat([0.079, 0.107, 0.072, 0.062, 0.087, 0.089], [3, 3, 2, 2, 2, 2])

#: Standard deviation of each coordinate of a photograph's key points from the joints (14,), metres.
PHOTOGRAPH_OFFSETS: Final = ANNOTATION_SIGMAS * (ROOT_AREA_METRES / math.sqrt(2))

#: Usual depth (metres) of a joint relative to the middle of the body, and usual distance (metres) of a camera.
RELIEF_METRES, USUAL_DISTANCE_METRES = 0.25, 4.5

#: Relative standard deviation of the camera's distance: photographs of a whole person are taken from 3 to 7 m.
DISTANCE_DEVIATION: Final = 0.4

#: Relative standard deviation of a scale, by method. For `stature`, it allows for people who do not stand straight.
SCALE_DEVIATIONS: Final = {"likely": 0.08, "min": 0.08, "stature": 0.03}

#: Shortfall of a segment (metres) that contradicts a stated scale of exact points.
LONGEST_TOO_SHORT: Final = 0.3


def point_offsets(points: Array, scale: Array) -> Array:
    """Return the standard deviations (N, 14), metres, of image points (N, 14, 2) of photographs with scales (N,).

    Body parts that are nearer to the camera look larger. The distance of the camera is unknown, so the deviation grows
    with the distance of a point from the middle of the body.
    """
    metres = (points - np.nanmean(points[:, :6], axis=1, keepdims=True)) / scale[:, None, None]
    aside = np.nan_to_num(np.linalg.norm(metres, axis=2))
    relief = DISTANCE_DEVIATION * RELIEF_METRES / USUAL_DISTANCE_METRES
    return np.asarray(np.hypot(PHOTOGRAPH_OFFSETS, relief * aside))


def from_usual_distance(problem: Problem, middle: Array, scale_deviation: Array) -> Problem:
    r"""Convert a scaled orthographic problem to a problem of a perspective camera at the usual distance d.

    In a real picture, nearer parts of the body look larger. A point at depth z behind the neck has the image :math:`s
    (x, y) / (1 + z / d)`. The uncertainty of the scale becomes an uncertainty of the neck's depth.

    Parameters
    ----------
    problem : Problem
        A problem whose image points are in metres, at the depth of the person's middle.
    middle : array (F, 2)
        Middle of the person in the image, metres.
    scale_deviation : array (F,)
        Relative standard deviation of the scale.
    """
    d, out = USUAL_DISTANCE_METRES, problem.records.copy()
    out["ray"] = np.where(problem.seen_joints[..., None], (out["ray"] - middle[:, None]) / d, 0.0)
    out["image"] *= d
    out["root"] = 0.0, 0.0, d
    out["root_weight"] = 0.0
    out["root_weight"][:, 2, 2] = 1 / (d * scale_deviation)
    out["perspective"] = 1.0
    return replace(problem, records=out)


def from_near(joints: Array, middle: Array, scale: Array) -> tuple[Array, Array]:
    """Convert solutions of a problem of `from_usual_distance` to the frame of the scaled orthographic camera.

    Parameters
    ----------
    joints : array (N, 14, 3)
        Postures in the frame of the perspective camera, metres.
    middle, scale : array (N, 2), (N,)
        Middle of the person in the image at the nominal scale, metres, and the nominal scale.

    Returns
    -------
    joints, scale : array (N, 14, 3), (N,)
        Postures whose neck has depth 0, and the scale at the depth of the neck.
    """
    depth = joints[:, 0, 2]
    nearer = depth / USUAL_DISTANCE_METRES
    moved = np.concatenate([middle * nearer[:, None], -depth[:, None]], axis=1)
    return joints + moved[:, None], scale / nearer


def scales_of(
    points: Array, linkage: Linkage, how: str, weights: Mapping[str, float], stated: float, strict: bool
) -> tuple[list[float], dict[str, Any]]:
    """Return the scales of one picture, and the facts about its camera for the result."""
    family = LinkageFamily(linkage=linkage, image=points)
    bound, segment = family.minimum_scale, family.bounding_segment
    chosen = [bound if how == "min" else stated]
    if how == "constraints":
        found = search(family, weights)
        least = float(found.residual[:1].max(initial=0.0))
        chosen = np.unique(found.s[found.residual <= max(least, 1e-16)]).tolist() or [bound]
    if not all(np.isfinite(chosen)) or min(chosen) <= 0:
        raise refusal("", "scale", "no scale", "both ends of a segment in the image", "add image points")
    lost = (bound / min(chosen) - 1) * float(linkage.lengths.max())
    if strict and lost > LONGEST_TOO_SHORT:
        needs = f"at least {bound:.6g} px/m, which {segment} needs"
        raise refusal("", "scale", f"{min(chosen):.6g}", needs, "give a larger scale, or min")
    return chosen, {"scale": chosen, "how": "+".join(weights) or how, "bound": bound, "segment": segment}


@lru_cache(maxsize=8)
def figure_linkage(person: Figure) -> Linkage:
    """Return the figure as a linkage of 14 points and 17 segments: torso and hips are closed loops."""
    lengths = np.array([person.lengths[name] for name in SEGMENT_NAMES])
    return Linkage(name="figure", points=JOINTS, segments=SEGMENTS, lengths=lengths, unit=1.0)


#: Standard deviation (metres) of the depth of the middle of each of `DIMENSIONS`, relative to the middle of the body:
#: slightly less than among random postures within the limits.
DEPTH_RELIEF: Final = np.array([0.15, 0.15, 0.22, 0.22, 0.15, 0.15, 0.25, 0.25, 0.12, 0.10, 0.05])

#: Relative standard deviation of each of `DIMENSIONS` due to posture: shoulders move and the back bends.
LOOSENESS: Final = np.array([0.0] * 8 + [0.03, 0.02, 0.05])

#: Joints at the two ends of each dimension: limbs, shoulder width, hip width, and the line between their middles.
DIMENSIONS: Final = [
    ((JOINT[f"{side}_{a}"],), (JOINT[f"{side}_{b}"],))
    for a, b in (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))
    for side in ("right", "left")
] + [((1,), (2,)), ((4,), (5,)), ((1, 2), (4, 5))]

#: Cosines of the angles between evenly distributed directions and the optical axis.
COSINES: Final = (np.arange(24) + 0.5) / 24

#: Logarithms of tried scales relative to a first guess.
LOG_SCALES: Final = np.arange(-0.4, 0.6, 0.03)


def likely_scale(points: Array, person: Figure) -> tuple[Array, Array]:
    r"""Estimate the scale at which a body's segments best match their image, and the deviation of the log scale.

    Taylor's lower bound of the scale (2000, eq. 3) depends on one segment alone, but this estimate uses every segment.
    At scale s, a segment of length l and random direction has an image of length :math:`e = s\,l\,\sqrt{1 - c^2}` with
    c uniform. Errors of lengths and points are added to e.

    Parameters
    ----------
    points : array (F, 14, 2)
        Square pixels or normalised image points; unseen points are NaN. The scale of normalised image points is one
        over the depth.
    person : Figure

    Returns
    -------
    scale, deviation : array (F,)
        NaN if no segment is seen.
    """
    body = person.neutral_points
    ends = [[list(one) for one in pair] for pair in DIMENSIONS]
    length = np.array([np.linalg.norm(body[b].mean(axis=0) - body[a].mean(axis=0)) for a, b in ends])
    seen = np.stack(
        [np.linalg.norm(points[:, b].mean(1) - points[:, a].mean(1), axis=1) for a, b in ends], axis=1
    )
    offset = np.array([np.sqrt((PHOTOGRAPH_OFFSETS[[*a, *b]] ** 2).sum()) / len(a) for a, b in ends])
    near = DEPTH_RELIEF / USUAL_DISTANCE_METRES
    off = np.sqrt(LOOSENESS**2 + 0.05**2 + (offset / length) ** 2 + near**2)
    ratio = np.log(np.maximum(seen, 1e-9) / length)
    known = np.isfinite(ratio)
    ordered = np.sort(np.where(known, ratio, -np.inf), axis=1)
    first = np.where(np.isfinite(ordered[:, -2]), ordered[:, -2], ordered[:, -1]) + math.log(0.9)
    grid = np.where(np.isfinite(first), first, np.nan)[:, None] + LOG_SCALES
    away = ratio[:, :, None] - grid[:, None]
    bend = 0.5 * np.log(1 - COSINES**2)
    each = np.exp(-0.5 * ((away[..., None] - bend) / off[:, None, None]) ** 2).mean(axis=3)
    score = np.where(known[:, :, None], np.log(each + 1e-30), 0.0).sum(axis=1)
    weight = np.exp(score - score.max(axis=1, keepdims=True))
    weight /= weight.sum(axis=1, keepdims=True)
    mean = (weight * grid).sum(axis=1)
    return np.exp(mean), np.sqrt((weight * (grid - mean[:, None]) ** 2).sum(axis=1))
