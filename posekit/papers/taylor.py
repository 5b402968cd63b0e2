"""Comparison with Taylor 2000: all postures of one picture, proportions (Table 1), and accuracy (§3.2)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise, product
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure, load_figure
from posekit.body.lengths import hips_points, torso_points
from posekit.cameras import PinholeCamera
from posekit.geometry import Array, rms_distance
from posekit.papers.rows import Row, printed, row
from posekit.papers.taylor_objects import joint_angles
from posekit.recovery.objects import Linkage, LinkageFamily, load_linkage
from posekit.skeleton import JOINT, SEGMENTS, SIDES, segment_name
from posekit.synthesis import default_camera, random_views

#: Height of the synthetic person, metres.
STATURE: Final = 1.75

N_BODIES, N_PICTURES = 200, 100

#: Range of camera distances in synthetic photographs, metres.
DISTANCE: Final = (3.0, 6.0)

#: Standard deviation of each coordinate of synthetic photographs, pixels.
NOISE_PIXELS: Final = 2.0

#: Joints with markers in §3.2: a chain of five segments with four angles between them.
MARKERS: Final = ("right_wrist", "right_elbow", "right_shoulder", "left_shoulder", "left_elbow", "left_wrist")

LENGTHS: Final = {"figure": "the person's own lengths", "taylor": "the proportions of Table 1"}
#: Choices of lengths and scale for the rows of §3.2.
SCALES: Final = {
    "stature": "s from the stature in pixels, raised to the bound if it is below",
    "flat": "s from the stature in pixels, too short segments flat",
    "min": "s at its lower bound",
}

#: Limb segments by their joints, and their names in Table 1.
LIMBS: Final = {
    ("shoulder", "elbow"): "upper arm",
    ("elbow", "wrist"): "forearm",
    ("hip", "knee"): "thigh",
    ("knee", "ankle"): "foreleg",
}

#: All flips of the human's 11 segments (2048, 11).
SIGNS: Final = np.array(list(product((-1, 1), repeat=11)))


def taylor_rows() -> Iterator[Row]:
    """Yield a `Row` for each comparison with Taylor's method, Table 1 and §3.2."""
    yield from _method_rows()
    yield from _family_rows()
    yield from _proportion_rows()
    yield from _accuracy_rows()
    yield row("people", "not repeated", None)


def human(figure: Figure) -> Linkage:
    """Return Taylor's human model (12 points, 11 segments, straight spine) with the lengths of a figure, metres."""
    shape, points = load_linkage("taylor_human"), figure.neutral_points
    lengths = _measured(shape, points[[JOINT[name] for name in shape.points]])
    middles = [
        points[[JOINT[f"{side}_{name}"] for side in SIDES]].mean(axis=0) for name in ("shoulder", "hip")
    ]
    spine = shape.segment_names.index("mid_shoulders-mid_hips")
    lengths[spine] = sum(np.linalg.norm(end - points[JOINT["pelvis"]]) for end in middles)
    return _with_lengths(shape, lengths)


def taylor_figure(stature: float) -> Figure:
    """Return the figure of a person with the proportions of Table 1.

    Limb lengths, shoulder width and hip width are from Table 1. Table 1 does not determine the positions of neck and
    pelvis, so the torso is that of the built-in figure, scaled. Its width follows the shoulder and hip widths. Its
    height is such that the path from mid-shoulder via pelvis to mid-hip has the length of Table 1's spine.

    Parameters
    ----------
    stature : float
        Standing height, metres.
    """
    base, unit = load_figure(), stature / 70
    table = {name: given["length"] * unit for name, given in printed()["taylor"]["lengths"].items()}
    torso, hips = torso_points(base.lengths), hips_points(base.lengths)
    across = table["shoulder girdle"] / (torso[2, 1] - torso[1, 1])
    torso *= [across, across, 1.0]
    hips *= [1.0, table["pelvic girdle"] / (hips[2, 1] - hips[1, 1]), 1.0]
    # Let f and a be the forward and the longitudinal distance from the midpoint of the shoulders to the pelvis, and b
    # the distance from the pelvis to the hips. The longitudinal scale z is the smaller root of
    # sqrt(f^2 + a^2 z^2) + b z = spine.
    above = (torso[1] + torso[2]) / 2 - torso[3]
    f, a, b = above[0], np.hypot(above[1], above[2]), np.linalg.norm((hips[1] + hips[2]) / 2)
    rest = table["spine"] ** 2 - f**2
    root = np.sqrt((b * table["spine"]) ** 2 + (a**2 - b**2) * rest)
    along = [1.0, 1.0, float(rest / (b * table["spine"] + root))]
    places = [*(torso * along), *((hips * along)[1:] + torso[3] * along)]
    lengths = {
        segment_name((start, end)): float(np.linalg.norm(places[start] - places[end]))
        for start, end in SEGMENTS
        if end < len(places)
    }
    for side in SIDES:
        for ends, name in LIMBS.items():
            lengths[f"{side}_{ends[0]}-{side}_{ends[1]}"] = table[name]
    return base.scaled(lengths, behind=False)


def placed(family: LinkageFamily, s: float, signs: NDArray[Any]) -> Array:
    """Return postures (..., P, 3) at scale `s` with given signs of segment depths; a too short segment has depth 0."""
    lengths = family.linkage.lengths
    depth = np.sqrt(np.maximum(lengths**2 - (family.extent / s) ** 2, 0.0))
    nodes = (signs * depth) @ family.incidence.depth.T
    return family.placed(s, nodes)


def _with_lengths(shape: Linkage, lengths: Array) -> Linkage:
    """Return a linkage with the points of `shape` and the given segment lengths, metres."""
    return replace(shape, lengths=lengths, unit=1.0, height=None)


def _measured(shape: Linkage, points: Array) -> Array:
    """Return the lengths (..., S) of the segments of `shape` in postures (..., P, 3)."""
    nodes, ends = shape.place_nodes(points), np.array(shape.segments)
    return np.asarray(np.linalg.norm(nodes[..., ends[:, 1], :] - nodes[..., ends[:, 0], :], axis=-1))


def _method_rows() -> Iterator[Row]:
    points = random_views(N_BODIES, np.random.default_rng(3)).truth
    s, ends = 100.0, np.array(SEGMENTS)
    apart = points[:, ends[:, 1]] - points[:, ends[:, 0]]
    seen, length = s * np.linalg.norm(apart[..., :2], axis=-1), np.linalg.norm(apart, axis=-1)
    depth = np.sqrt(np.maximum(length**2 - (seen / s) ** 2, 0))
    off = float(np.abs(depth - np.abs(apart[..., 2])).max())
    yield row("depth", f"{off:.0e} m off at most", off < 1e-6, n=length.size, postures=N_BODIES)
    holds = (s >= (1 - 1e-12) * seen / length).mean()
    here = f"s >= sqrt(du^2 + dv^2) / l holds for {holds:.0%} of the segments; as printed, the units do not agree"
    yield row("bound", here, False)
    shape = load_linkage("taylor_human")
    twelve = points[:N_PICTURES, [JOINT[name] for name in shape.points]]
    numbers = []
    for body in twelve:
        family = LinkageFamily(
            linkage=_with_lengths(shape, _measured(shape, body)), image=300.0 * body[:, :2]
        )
        numbers.append(len(np.unique(placed(family, 300.0, SIGNS)[..., 2].round(9), axis=0)))
    here = f"{np.mean(numbers):g} in each of {len(numbers)} pictures"
    yield row("flips", here, set(numbers) == {2048})


def _family_rows() -> Iterator[Row]:
    shape = load_linkage("taylor_human")
    unknowns, measurements = 2 + 2 * len(shape.segments) + 1, 2 * len(shape.points)
    yield row("unknowns", f"{unknowns} and {measurements}", (unknowns, measurements) == (25, 24))
    points = np.random.default_rng(2000).normal(size=(12, 3))
    lengths = _measured(shape, points)
    family = LinkageFamily(linkage=_with_lengths(shape, lengths), image=100.0 * points[:, :2])
    postures = family.points(1.2 * family.minimum_scale, SIGNS)
    different, off = _different(postures), float(np.abs(_measured(shape, postures) - lengths).max())
    here = f"{different} different, lengths {off:.0e} off at most"
    yield row("solutions", here, different == 2048 and off < 1e-9)
    chain = np.random.default_rng(3).normal(size=(4, 3))
    steps = np.linalg.norm(np.diff(chain, axis=0), axis=1)
    three = Linkage.from_names(
        name="chain", segments=dict(zip(pairwise("abcd"), steps.tolist(), strict=True))
    )
    found = LinkageFamily(linkage=three, image=100.0 * chain[:, :2]).points(
        100.0, np.array(list(product((-1, 1), repeat=3)))
    )
    different, off = _different(found), float(np.abs(_measured(three, found) - steps).max())
    yield row("chain", f"{different} different, lengths {off:.0e} off at most", different == 8 and off < 1e-9)
    scales = np.array(printed()["taylor"]["scales"])
    picture = LinkageFamily(linkage=shape, image=points[:, :2])
    deeper = np.diff(picture.foreshortening(picture.minimum_scale * scales / scales[0]), axis=0) > 0
    here = f"{deeper.all(axis=0).sum()} of {deeper.shape[1]} segments grow deeper at each step"
    yield row("scales", here, bool(deeper.all()))


def _different(postures: Array) -> int:
    return len(np.unique(postures.round(6).reshape(len(postures), -1), axis=0))


def _proportion_rows() -> Iterator[Row]:
    """Compare Table 1 with the segment lengths of `taylor_figure`, which is made from it."""
    points = taylor_figure(STATURE).neutral_points
    for segment, given in printed()["taylor"]["lengths"].items():
        ends = [points[[JOINT[joint] for joint in joints]].mean(axis=0) for joints in given["chain"]]
        found = sum(float(np.linalg.norm(b - a)) for a, b in pairwise(ends)) * 70 / STATURE
        fits = abs(found - given["length"]) < 1e-9
        yield row(
            "proportion", f"{found:.6g}", fits, segment=segment, length=given["length"], stature=STATURE
        )


def _accuracy_rows() -> Iterator[Row]:
    """Measure the errors of six joints as in §3.2, with true signs of depths and after similarity alignment."""
    figure = load_figure().scaled(stature=STATURE)
    camera = default_camera()
    rng = np.random.default_rng(0)
    view = random_views(N_PICTURES, rng, figure=figure, camera=camera, distance=DISTANCE, ranges="urdf")
    shape = load_linkage("taylor_human")
    columns = [JOINT[name] for name in shape.points]
    truth, image = view.truth[:, columns], view.image[:, columns]
    six = [shape.points.index(name) for name in MARKERS]
    triples = [(k, k + 1, k + 2) for k in range(4)]
    errors = printed()["taylor"]["errors"]
    for lengths, scale in product(LENGTHS, SCALES):
        own = human(figure) if lengths == "figure" else _with_lengths(shape, shape.lengths * STATURE / 70)
        found = _by_hand(own, camera, truth, image, scale)[:, six]
        angles = np.abs(joint_angles(found, triples) - joint_angles(truth[:, six], triples))
        values = {"rms": 100 * rms_distance(found, truth[:, six]), "angle": angles}
        for measure, name, unit in (("rms", "RMS", "cm"), ("angle", "difference of angles", "degrees")):
            mean, median = errors[measure]
            yield row(
                "accuracy",
                f"mean {values[measure].mean():.2f}, median {np.median(values[measure]):.2f} {unit}",
                None,
                measure=name,
                lengths=LENGTHS[lengths],
                scale=SCALES[scale],
                mean=mean,
                median=median,
                unit=unit,
                n=N_PICTURES,
            )


def _by_hand(linkage: Linkage, camera: PinholeCamera, truth: Array, image: Array, scale: str) -> Array:
    """Return postures (F, 12, 3) recovered from noisy image points, with the true signs of all segments' depths."""
    rng = np.random.default_rng(0)
    noisy = image + NOISE_PIXELS * rng.standard_normal(image.shape)
    # The image of the stature is at the mean depth of the points, with noise at both ends.
    pixels = camera.K[1, 1] * STATURE / truth[..., 2].mean(axis=1)
    stated = (pixels + NOISE_PIXELS * np.sqrt(2.0) * rng.standard_normal(len(truth))) / STATURE
    found = []
    for points, picture, s in zip(truth, noisy, stated.tolist(), strict=True):
        family = LinkageFamily(linkage=linkage, image=picture)
        bound = family.minimum_scale
        chosen = {"stature": max(s, bound), "flat": s, "min": bound}[scale]
        found.append(placed(family, chosen, family.flips_of(points)))
    return np.array(found)
