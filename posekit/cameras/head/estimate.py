"""From starts to the best placement of each head, and what is wrong with those that have none."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import PinholeCamera
from posekit.cameras.head.dlt import BEHIND_CAMERA
from posekit.cameras.head.fit import HeadFit, fit
from posekit.cameras.head.misfit import misfits, spread
from posekit.cameras.head.perspective import HeadPlacement, Heads, look
from posekit.cameras.head.points import HeadPoints
from posekit.cameras.head.sighting import HeadSighting
from posekit.cameras.head.starts import affine_start, direct_start, reversed_start
from posekit.geometry import Array
from posekit.least_squares import scaled_equations

CLEARLY_SIGMAS = 5.0
"""Standard deviations by which the perspective must be reversed to be called so, not merely unseen."""

BETTER_BEHIND = 1e-4
"""Chance below which a head behind the camera fits better for a reason."""

COARSE_ERROR = 0.2
"""Error, as a fraction of the head's size in the image, from which the reversed head is tried.

Of 2,000 heads of 20 to 150 pixels each, the two starts missed the best minimum known in none at 1 pixel of
noise, in one at 2 and in 13 at 5, all with an error above this; with the third start in none, none and 2.
"""

DETERMINED_EIGENVALUE = 1e-12
"""Smallest eigenvalue of the normal equations, scaled to a unit diagonal, that determines all unknowns."""


class HeadEstimate(NamedTuple):
    """The poses of F heads: what `posekit.cameras.head.HeadPose` is made of; NaN where there is a reason."""

    reasons: list[str]
    R: Array
    t: Array
    f: Array
    f_deviation: Array
    residuals: Array
    cost: Array
    misfit: NDArray[np.intp]
    cost_without: Array
    chance: Array


def estimate(
    head: HeadPoints, sighting: HeadSighting, known: tuple[PinholeCamera, Array] | None
) -> HeadEstimate:
    """Place the head in every frame.

    Parameters
    ----------
    head : HeadPoints
        The head, in its own frame.
    sighting : HeadSighting
        What each frame shows of it.
    known : (PinholeCamera, array (F, P, 2)), optional
        The camera and the normalised image points; without it f is free.
    """
    reasons = list(sighting.reasons)
    total, count = sighting.seen.shape
    result = HeadEstimate(
        reasons,
        R=np.full((total, 3, 3), np.nan),
        t=np.full((total, 3), np.nan),
        f=np.full(total, np.nan),
        f_deviation=np.full(total, np.nan),
        residuals=np.full((total, count), np.nan),
        cost=np.full(total, np.nan),
        misfit=np.full(total, -1),
        cost_without=np.full(total, np.nan),
        chance=np.ones(total),
    )
    usable = np.flatnonzero([not reason for reason in reasons])
    if not usable.size:
        return result
    seen = sighting.seen[usable]
    centre, size, points = _centred(head.points, seen)
    K = None if known is None else np.broadcast_to(known[0].K, (total, 3, 3))[usable]
    distortion = None if known is None else known[0].distortion
    image, ones = sighting.image[usable], np.ones(len(usable))
    heads = Heads(points, image, seen.astype(np.float64), K, distortion, ones)
    plane = image if known is None else known[1][usable]
    fitted, wrong = _best(heads, plane)
    f, f_deviation, undetermined = _focal_length(heads, fitted)
    ended = np.flatnonzero(fitted.settled)
    accused = misfits(heads.take(ended), plane[ended], fitted.take(ended))
    for target, values in zip((result.misfit, result.cost_without, result.chance), accused, strict=True):
        target[usable[ended]] = values
    result.cost[usable[ended]] = fitted.cost[ended]
    residual = look(heads, fitted.placement)[0].reshape(-1, 2, count)
    result.residuals[usable[ended]] = np.hypot(residual[:, 0], residual[:, 1])[ended]
    for frame, near, far in zip(usable, wrong, undetermined, strict=True):
        reasons[frame] = near or far
        if reasons[frame] and result.misfit[frame] >= 0:
            name = head.names[result.misfit[frame]]
            reasons[frame] += f"; check head point {name} first, which does not fit the others"
    good = np.array([not reasons[frame] for frame in usable], dtype=np.bool_)
    frames = usable[good]
    placement, f = fitted.placement.take(good), f[good]
    lens = f if K is None else np.ones(len(f))
    z = lens * size[good] / placement.scale
    centre_cam = np.concatenate([placement.shift * (z / lens)[:, None], z[:, None]], axis=1)
    result.R[frames] = placement.R
    result.t[frames] = centre_cam - np.einsum("fij,fj->fi", placement.R, centre[good])
    result.f[frames], result.f_deviation[frames] = f, f_deviation[good]
    return result


def _centred(points: Array, seen: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
    """Return each frame's centre (F, 3) and size (F,) of the seen points, and the points in them."""
    weight = seen / seen.sum(axis=-1, keepdims=True)
    centre = weight @ points
    offset = np.where(seen[..., None], points - centre[:, None], 0.0)
    size = np.sqrt((weight[..., None] * offset**2).sum(axis=(1, 2)))
    return centre, size, offset / size[:, None, None]


def _best(heads: Heads, plane: Array) -> tuple[HeadFit, list[str]]:
    """HeadFit from both starts, take the better, and say where a head behind the camera fits better still.

    Coarse image points have a second minimum, the head with its depths reversed: there it is tried as well.
    """
    seen = heads.seen > 0
    direct, behind = direct_start(heads.points, plane, seen)
    affine = affine_start(heads.points, plane, seen, heads.K is not None)
    if heads.K is not None:
        direct = direct._replace(slope=direct.scale.copy())
    number = np.arange(len(plane))
    both = fit(
        heads.take(np.concatenate([number, number])),
        HeadPlacement(*(np.concatenate(pair) for pair in zip(direct, affine, strict=True))),
    )
    second = both.cost[len(plane) :] < both.cost[: len(plane)]
    choice = np.where(second, number + len(plane), number)
    best = both.take(choice)
    coarse = np.flatnonzero(np.isfinite(best.cost) & (best.cost > COARSE_ERROR**2 * spread(heads)))
    if coarse.size:
        some = heads.take(coarse)
        turned = fit(some, reversed_start(some.points, best.placement.take(coarse)))
        better = turned.cost < best.cost[coarse]
        best.placement.put(coarse[better], turned.placement.take(better))
        best.cost[coarse[better]] = turned.cost[better]
        best.settled[coarse[better]] = turned.settled[better]
    reasons = [
        "" if settled else "no pose was found from either start: check the image points and the focal length"
        for settled in best.settled
    ]
    if heads.K is not None and behind.any():
        frames = np.flatnonzero(behind)
        back = heads.take(frames)._replace(side=-np.ones(len(frames)))
        mirrored = fit(back, direct.take(frames)._replace(slope=-direct.scale[frames]))
        freedom = 2 * back.seen.sum(axis=-1) - back.unknowns
        chance = (mirrored.cost / best.cost[frames]) ** (freedom / 2)
        for frame in frames[chance < BETTER_BEHIND]:
            reasons[frame] = BEHIND_CAMERA
    return best, reasons


def _focal_length(heads: Heads, fitted: HeadFit) -> tuple[Array, Array, list[str]]:
    """Return f, its standard deviation, and why it is not determined; K's own where K is known."""
    count = len(fitted.cost)
    if heads.K is not None:
        return heads.K[:, 0, 0], np.zeros(count), [""] * count
    residual, jacobian, _ = look(heads, fitted.placement)
    normal, _, unit = scaled_equations(residual, jacobian)
    normal[~fitted.settled] = np.eye(heads.unknowns)
    values, vectors = np.linalg.eigh(normal)
    freedom = 2 * heads.seen.sum(axis=-1) - heads.unknowns
    variance = (vectors[:, -1] ** 2 / np.maximum(values, np.finfo(np.float64).tiny)).sum(axis=-1)
    deviation = np.sqrt(fitted.cost / freedom * variance) / unit[:, -1]
    slope = fitted.placement.slope
    reasons = []
    for settled, least, d, sigma in zip(fitted.settled, values[:, 0], slope, deviation, strict=True):
        if not settled:
            reasons.append("")  # there is a better reason
        elif least <= DETERMINED_EIGENVALUE:
            reasons.append("the image does not determine f: other cameras give the same; give f")
        elif d <= -CLEARLY_SIGMAS * sigma:
            reasons.append(BEHIND_CAMERA)
        elif d <= 0:
            reasons.append("the perspective is too weak to determine f (the head is far away); give f")
        else:
            reasons.append("")
    f = fitted.placement.scale / slope
    return f, np.abs(f / slope) * deviation, reasons
