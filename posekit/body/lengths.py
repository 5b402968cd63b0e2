r"""Segment lengths: shapes of torso and hips, nearest possible lengths, and lengths from stature.

Six distances determine the shape of the torso's four points; three distances determine the shape of the hips' three
points. Lengths close if points with these distances exist in space. Medians over frames, lengths from a tape and
rounded lengths may fail to close by a small amount. The nearest lengths that close lie on the boundary of the feasible
set, where the torso's points are in one plane or the hips' points on one line:

.. math:: \min_p \sum_i \left(\frac{\log d_i(p) - \log l_i}{\sigma_i}\right)^2

Here p are positions of the points in that plane or on that line, and :math:`d_i(p)` their distances. The given lengths
:math:`l_i` have the relative standard deviations :math:`\sigma_i`. A common error of all lengths has no effect, because
lengths that close still close after scaling.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from posekit.body.uncertainty import MEASURED_LENGTHS, LengthUncertainty
from posekit.errors import FigureError, nearest, refusal, shown
from posekit.geometry import Array, cross, known_median, unit
from posekit.skeleton import JOINT, LIMB_SHARES, SEGMENT_NAMES, SEGMENTS, SIDES, TREE_SEGMENTS, segment_name

#: Metres by segment name.
Lengths = Mapping[str, float]

#: Tolerance of negative squared depths (m^2): within it a torso counts as flat, and its lengths as rounded.
FLAT_DEPTH_SQUARED: Final = 1e-9

#: The six lengths of the torso.
TORSO_LENGTHS: Final = (
    *("neck-right_shoulder", "neck-left_shoulder", "neck-pelvis"),
    *("right_shoulder-left_shoulder", "right_shoulder-pelvis", "left_shoulder-pelvis"),
)

#: The three lengths of the hips.
HIPS_LENGTHS: Final = ("pelvis-right_hip", "pelvis-left_hip", "right_hip-left_hip")

#: Largest accepted relative change of a length when lengths are made to close.
#:
#: Adults' proportions vary with a standard deviation of 5 % (`posekit.body.uncertainty.UNKNOWN_ADULT`). A change of
#: more than four standard deviations means that the lengths are not a person's.
MAX_MOVED: Final = 0.2

#: Smallest initial distance of a shoulder from the spine, as a fraction of the shoulders' width: on the spine the
#: lengths have no sideways gradient.
MIN_WIDTH_PART: Final = 0.25

#: Width of the shoulders and of the hips, and height of the shoulders over the hips, as fractions of stature: Drillis
#: & Contini 1966 (see `posekit.skeleton.LIMB_SHARES`).
WIDTH_SHARES: Final = (0.259, 0.191)
TRUNK_SHARE: Final = 0.818 - 0.530

#: Accepted statures, metres. Nobody outside this interval is recorded; the number is probably in another unit.
STATURE_METRES: Final = (0.4, 2.8)


def check_lengths(lengths: Lengths) -> None:
    """Raise `FigureError` if a segment name is unknown, or a length is not finite or not positive."""
    for name, length in lengths.items():
        if name not in SEGMENT_NAMES:
            remedy = nearest(name, SEGMENT_NAMES)
            raise refusal("figure", "lengths", shown(name), "a segment's name", remedy, error=FigureError)
        if not (math.isfinite(length) and length > 0):
            expected = "a positive, finite length in metres"
            raise refusal("figure", f"lengths.{name}", f"{length:g}", expected, error=FigureError)


def lengths_in_frames(joints: Array) -> Array:
    """Return the lengths (17, N) of the segments of postures (N, 14, 3) or (N, 19, 3), metres."""
    by_joint = np.ascontiguousarray(np.moveaxis(joints, 0, -1))
    found = np.empty((len(SEGMENTS), len(joints)))
    for k, (start, end) in enumerate(SEGMENTS):
        x, y, z = by_joint[end] - by_joint[start]
        np.sqrt(x * x + y * y + z * z, out=found[k])
    return found


def segment_lengths(joints: Array) -> dict[str, float]:
    """Return the median length of each of the 17 segments over postures (N, 14, 3) or (N, 19, 3), metres.

    A segment is omitted if its two ends are never known in the same posture, or if its length is zero.
    """
    medians = zip(SEGMENT_NAMES, map(known_median, lengths_in_frames(joints)), strict=True)
    return {name: length for name, length in medians if length > 0}


def shoulders_are_behind(joints: Array) -> bool | None:
    """Return whether the shoulders of postures (N, 14, 3) lie behind the line from neck to pelvis; None if unknown.

    Lengths do not distinguish a torso from its mirror image.
    """
    names = ("neck", "pelvis", "right_shoulder", "left_shoulder")
    neck, pelvis, right, left = (joints[:, JOINT[name]] for name in names)
    forward = np.einsum("ni,ni->n", cross(pelvis - neck, left - right), (left + right) / 2 - neck)
    known = forward[np.isfinite(forward)]
    return bool(np.median(known) < 0) if known.size else None


def torso_points(lengths: Lengths, *, behind: bool = False) -> Array:
    r"""Compute positions of neck, right shoulder, left shoulder and pelvis from their six distances.

    The neck is at the origin, the pelvis straight below. Each shoulder lies on a circle about the line from neck to
    pelvis. The circle is :math:`h = (a^2 + b^2 - c^2) / 2b` below the neck and has the radius :math:`\sqrt{a^2 - h^2}`,
    for distances a from neck to shoulder, b from neck to pelvis, and c from shoulder to pelvis. The distance between
    the shoulders determines the angle between them about the line. The y axis is the direction from right to left
    shoulder, made perpendicular to z. The distances do not determine whether the shoulders are in front of the line or
    behind it.

    Parameters
    ----------
    lengths : mapping
        Metres, by segment name.
    behind : bool
        Whether the shoulders lie behind the line from neck to pelvis.

    Returns
    -------
    array (4, 3)
        Torso frame of the URDF (x forward, y left, z up), metres.

    Raises
    ------
    FigureError
        If no torso has these lengths: a triangle does not close, or the distance between the shoulders is too large or
        too small.
    """
    right, left, forward_squared = _torso(lengths)
    if forward_squared < -FLAT_DEPTH_SQUARED:
        (z_right, r_right), (z_left, r_left) = right[:2], left[:2]
        low = math.hypot(r_right - r_left, z_right - z_left)
        high = math.hypot(r_right + r_left, z_right - z_left)
        width, remedy = "right_shoulder-left_shoulder", "correct one of the torso's six lengths"
        expected = f"{low:g} to {high:g} m with the other torso lengths"
        got = f"{lengths[width]:g}"
        raise refusal("figure", f"lengths.{width}", got, expected, remedy, error=FigureError)
    forward = math.sqrt(max(forward_squared, 0.0)) * (-1.0 if behind else 1.0)
    shoulders = [[forward, right[2], -right[0]], [forward, left[2], -left[0]]]
    return np.array([[0.0, 0.0, 0.0], *shoulders, [0.0, 0.0, -lengths["neck-pelvis"]]])


def hips_points(lengths: Lengths) -> Array:
    """Compute positions of pelvis, right hip and left hip from their three distances.

    Returns
    -------
    array (3, 3)
        Hips frame of the URDF: origin pelvis, y from right to left hip, z up; metres.
    """
    base = lengths["right_hip-left_hip"]
    offset, height = _apex("right_hip", "pelvis", "left_hip", lengths)
    return np.array([[0.0, 0.0, 0.0], [0.0, -offset, -height], [0.0, base - offset, -height]])


def side_is_certain(lengths: Lengths, known: LengthUncertainty, *, deviations: float = 3.0) -> bool:
    r"""Return whether the torso differs from its mirror image by more than the uncertainty of its lengths.

    The shoulders lie :math:`f = \pm\sqrt{a^2 - h^2 - y^2}` in front of the line from neck to pelvis or behind it. A
    shoulder has distance a from the neck, lies h below the neck, and has the sideways position y. The standard
    deviation of f is the standard deviation of :math:`f^2` divided by :math:`2 f`.

    Parameters
    ----------
    lengths : mapping
        Metres, by segment name.
    known : LengthUncertainty
        Uncertainty of the lengths.
    deviations : float
        Number of standard deviations by which f must differ from zero.
    """
    squared = max(_torso(lengths)[2], 0.0)
    variance = 0.0
    step = 1e-6
    for name in TORSO_LENGTHS:
        ends = []
        for factor in (1 + step, 1 - step):
            try:
                ends.append(_torso({**lengths, name: lengths[name] * factor})[2])
            except FigureError:  # the changed triangle does not close: leave the length unchanged
                ends.append(_torso(lengths)[2])
        variance += (known.own[name] * (ends[0] - ends[1]) / (2 * step)) ** 2
    # f > n sd(f^2) / (2 f)
    return variance == 0 or squared > deviations * math.sqrt(variance) / 2


def closed_lengths(
    lengths: Lengths, known: LengthUncertainty = MEASURED_LENGTHS
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the nearest lengths with which torso and hips exist; possible lengths are unchanged.

    Parameters
    ----------
    lengths : mapping
        All 17, metres, by segment name.
    known : LengthUncertainty
        Uncertainty of each length. If a length of the torso is exact, all lengths of the torso have equal weights.
        Lengths of the hips follow the same rule.

    Returns
    -------
    lengths, moved : dict
        Metres, by segment name; `moved` has the new minus the given length of each changed segment.

    Raises
    ------
    FigureError
        If a length would change by more than the fraction `MAX_MOVED`.
    """
    check_lengths(lengths)
    out, moved = dict(lengths), dict[str, float]()
    for names, points in ((TORSO_LENGTHS, torso_points), (HIPS_LENGTHS, hips_points)):
        try:
            points(lengths)
        except FigureError as error:
            new = _nearest(names, lengths, known)
            worst = max(abs(new[name] / lengths[name] - 1) for name in names)
            if not worst <= MAX_MOVED:
                raise FigureError(f"{error}; the nearest body differs by {worst:.0%} in a length") from None
            points(new)
            out |= new
            moved |= {name: new[name] - lengths[name] for name in names}
    return out, moved


#: Half differences of squared lengths, m^2: below the first `lay` has converged, above the second it has failed.
LAID_SQUARE_METRES, UNLAID_SQUARE_METRES = 1e-8, 1e-4


def lay(joints: Array, lengths: Array) -> Array:
    r"""Move postures (F, 14, 3) to the nearest postures with given segment lengths (F, 17).

    Newton steps minimise the squared displacement :math:`|x - x_0|^2` of all joints subject to :math:`|x_a - x_b|^2 =
    l^2` for each segment from a to b. They may fail to converge, e.g. if a segment has length zero. Joints are then
    placed one by one from the neck outward, along the given segment directions. Segments with an unknown end are
    ignored.
    """
    a, b = np.array(SEGMENTS).T
    x, known = np.nan_to_num(joints), np.isfinite(joints[:, :, 0])
    use = known[:, a] & known[:, b]
    J = np.zeros((len(x), len(SEGMENTS), *x.shape[1:]))
    rows = np.arange(len(SEGMENTS))
    for _ in range(30):
        apart = np.where(use[..., None], x[:, b] - x[:, a], 0.0)
        gap = np.where(use, 0.5 * ((apart**2).sum(axis=2) - lengths**2), 0.0)
        left = np.abs(gap).max(axis=1) >= LAID_SQUARE_METRES
        if not left.any():
            break
        J[:, rows, b], J[:, rows, a] = apart, -apart
        flat = J.reshape(len(x), len(SEGMENTS), -1)
        # A small damping keeps triangles that lie in a plane solvable.
        normal = flat @ flat.transpose(0, 2, 1) + 1e-9 * np.eye(len(SEGMENTS))
        step = np.einsum("fsk,fs->fk", flat, np.linalg.solve(normal, gap[..., None])[..., 0]).reshape(x.shape)
        share = left * np.minimum(1.0, 0.1 / np.maximum(np.abs(step).max(axis=(1, 2)), 1e-12))
        x = x - step * share[:, None, None]
    for k in np.flatnonzero(np.abs(gap).max(axis=1) > UNLAID_SQUARE_METRES).tolist():
        x[k] = np.nan_to_num(joints[k])
        for index, (start, end) in enumerate(TREE_SEGMENTS):
            direction = unit(np.nan_to_num(joints[k, end] - joints[k, start]) + 1e-12)
            x[k, end] = x[k, start] + lengths[k, index] * direction
    return np.where(known[..., None], x, np.nan)


def stature_from_lengths(lengths: Lengths) -> float:
    """Estimate stature (m) as the limbs' total length divided by its fraction of stature (Drillis & Contini 1966)."""
    total = sum(lengths[f"{side}_{a}-{side}_{b}"] for side in SIDES for a, b in LIMB_SHARES)
    return total / (2 * sum(LIMB_SHARES.values()))


def lengths_from_stature(stature: float, reference: Lengths) -> dict[str, float]:
    """Estimate the 17 lengths of a person of a given stature.

    Limb lengths and the widths of shoulders and hips are fractions of stature. Neck and pelvis have the reference
    figure's proportions. Their sideways offsets scale with the widths of shoulders and hips. Their heights scale with
    the height of the shoulders above the hips.

    Parameters
    ----------
    stature : float
        Standing height, metres.
    reference : mapping
        The reference figure's lengths, metres.

    Returns
    -------
    dict
        Lengths, metres, by segment name.

    Raises
    ------
    FigureError
        If the stature is outside `STATURE_METRES`.
    """
    low, high = STATURE_METRES
    if not low <= stature <= high:
        expected, remedy = f"{low} to {high} m", "check its unit"
        raise refusal("figure", "stature", f"{stature:g} m", expected, remedy, error=FigureError)
    torso, hips = torso_points(reference), hips_points(reference)
    across = WIDTH_SHARES[0] * stature / (torso[2, 1] - torso[1, 1])
    height = (torso[1, 2] + torso[2, 2]) / 2 - (torso[3, 2] + (hips[1, 2] + hips[2, 2]) / 2)
    along = TRUNK_SHARE * stature / height
    torso *= [across, across, along]
    hips *= [1.0, WIDTH_SHARES[1] * stature / (hips[2, 1] - hips[1, 1]), along]
    place = {**dict(enumerate(torso)), 4: hips[1] + torso[3], 5: hips[2] + torso[3]}
    trunk = [(a, b) for a, b in SEGMENTS if a in place and b in place]
    lengths = {segment_name((a, b)): float(np.linalg.norm(place[a] - place[b])) for a, b in trunk}
    for (a, b), share in LIMB_SHARES.items():
        lengths |= {f"{side}_{a}-{side}_{b}": share * stature for side in SIDES}
    return lengths


def _torso(lengths: Lengths) -> tuple[tuple[float, float, float], tuple[float, float, float], float]:
    """Return the positions of right and left shoulder, metres, and the square of their forward position, m^2.

    Each position has the distance below the neck, the distance from the line through neck and pelvis, and the leftward
    coordinate. The square is negative if the six distances are impossible.
    """
    right = _apex("neck", "right_shoulder", "pelvis", lengths)
    left = _apex("neck", "left_shoulder", "pelvis", lengths)
    width = lengths["right_shoulder-left_shoulder"]
    across_squared = width**2 - (right[0] - left[0]) ** 2
    if across_squared <= 0:
        expected = f"more than {abs(right[0] - left[0]):g} m, by which the shoulders' heights differ"
        remedy, field = "lengthen it or make both sides more alike", "lengths.right_shoulder-left_shoulder"
        raise refusal("figure", field, f"{width:g}", expected, remedy, error=FigureError)
    across = math.sqrt(across_squared)
    middle = (left[1] ** 2 - right[1] ** 2) / across
    y_left, y_right = (middle + across) / 2, (middle - across) / 2
    return (*right, y_right), (*left, y_left), right[1] ** 2 - y_right**2


def _apex(start: str, apex: str, end: str, lengths: Lengths) -> tuple[float, float]:
    """Return the position of a triangle's apex along the line from start to end, and its distance from that line."""
    base, near, far = (
        lengths[f"{a}-{b}"] if f"{a}-{b}" in lengths else lengths[f"{b}-{a}"]
        for a, b in ((start, end), (start, apex), (apex, end))
    )
    along = (base**2 + near**2 - far**2) / (2 * base)
    squared = near**2 - along**2
    if squared < -FLAT_DEPTH_SQUARED:
        field, got = f"lengths of the triangle {start}, {apex}, {end}", f"{base:g}, {near:g} and {far:g} m"
        raise refusal("figure", field, got, "each length at most the sum of the other two", error=FigureError)
    return along, math.sqrt(max(squared, 0.0))


def _nearest(names: tuple[str, ...], lengths: Lengths, known: LengthUncertainty) -> dict[str, float]:
    """Return the lengths of a flat torso, or of hips on one line, that are nearest to the given lengths, metres."""
    from scipy.optimize import least_squares

    own = np.array([known.own[name] for name in names])
    weight = 1.0 / own if own.all() else np.ones(len(own))
    wanted = np.log([lengths[name] for name in names])
    if names == TORSO_LENGTHS:
        ends = np.array([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)])
        start, free = _torso_start(lengths), np.array([(1, 0), (1, 1), (2, 0), (2, 1), (3, 1)])
    else:
        ends = np.array([(0, 1), (0, 2), (1, 2)])
        start, free = _hips_start(lengths), np.array([(1, 0), (2, 0)])

    def gaps(unknowns: Array) -> Array:
        points = np.zeros((4, 2))
        points[tuple(free.T)] = unknowns
        return np.asarray(points[ends[:, 1]] - points[ends[:, 0]])

    def residual(unknowns: Array) -> Array:
        return np.asarray(weight * (np.log(np.linalg.norm(gaps(unknowns), axis=1)) - wanted))

    def jacobian(unknowns: Array) -> Array:
        gap = gaps(unknowns)
        per_point = weight[:, None] * gap / np.sum(gap**2, axis=1, keepdims=True)
        J = np.zeros((len(ends), 4, 2))
        J[range(len(ends)), ends[:, 1]] += per_point
        J[range(len(ends)), ends[:, 0]] -= per_point
        return np.asarray(J[:, free[:, 0], free[:, 1]])

    found = least_squares(residual, start, jac=jacobian, method="lm", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return dict(zip(names, np.linalg.norm(gaps(found.x), axis=1).tolist(), strict=True))


def _torso_start(lengths: Lengths) -> Array:
    """Return initial coordinates (5,) for `_nearest`: two of each shoulder, and the height of the pelvis."""
    down, width = lengths["neck-pelvis"], lengths["right_shoulder-left_shoulder"]
    start = []
    for side, sign in (("right", -1.0), ("left", 1.0)):
        near, far = lengths[f"neck-{side}_shoulder"], lengths[f"{side}_shoulder-pelvis"]
        along = (down**2 + near**2 - far**2) / (2 * down)
        beside = math.sqrt(max(near**2 - along**2, 0.0))
        start += [sign * max(beside, MIN_WIDTH_PART * width), -along]
    return np.array([*start, -down])


def _hips_start(lengths: Lengths) -> Array:
    """Return initial hip positions (2,) for `_nearest`: on both sides of the pelvis, or on one side if nearer."""
    right, left, width = (lengths[name] for name in HIPS_LENGTHS)
    if width >= max(right, left):
        return np.array([-right, left])
    return np.array([-right, -left]) if right > left else np.array([right, left])
