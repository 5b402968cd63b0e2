"""Postures: the least change of their joints that every check of postures passes, alike in neighbouring frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.body.frames import hips_frame, torso_frame
from posekit.geometry import Array, rotation_about, unit
from posekit.motion.repair.nearest import differences, nearest
from posekit.motion.repair.pieces import (
    FEET,
    HEAD_PIECE,
    N_UNKNOWNS,
    PIECE_PARENTS,
    TRUNK,
    columns_of,
    jacobian_of,
    moved,
)
from posekit.skeleton import HEAD, HIPS, JOINT, JOINTS, LIMB_JOINTS, POINTS, SIDES, TORSO
from posekit.validators.body import Body
from posekit.validators.check import Check, Judgement, NotAskedError, judged
from posekit.validators.joint_range import STRAIGHT_DEGREES, JointRange

#: Metres that a degree counts as: about the way of a limb's end.
METRES_A_DEGREE: Final = 0.3 * np.pi / 180
#: Distance inside its bounds to which a posture is brought, so that rounding does not reject it.
INSIDE_BOUNDS: Final = {"m": 5e-6, "deg": 1e-3}
#: Step by which margins are differentiated, radians or metres.
DIFFERENCE: Final = 1e-6
#: Margin from which a bound is met, metres: it is still inside the bound itself.
MET: Final = -2e-6
#: Square metres a metre: more than the change of all joints together that one bound can demand.
BOUND_PENALTY: Final = 20.0
#: Weight of a head point: all five together weigh as much as a joint.
HEAD_WEIGHT: Final = 0.2
#: Postures of a batch.
AT_ONCE: Final = 256
#: Radians by which the lower segments of other starts are turned outward: a limb that bends the wrong way in its own
#: plane gives no hint to which side it is better turned.
SIDEWAYS: Final = (0.4, -0.4)
#: Share of the way to hanging limbs of the last starts.
TOWARD_REST: Final = (0.5, 1.0)
#: Bend of elbows and knees of hanging limbs, radians: inside all ranges.
REST_BEND: Final = np.radians(20.0)
#: Ratio of costs below which another start is preferred.
BETTER_COST: Final = 0.999
#: Weight of the squared difference between the changes of neighbouring frames, beside that of the change itself.
TIE_WEIGHT: Final = 1.0
#: Times that each frame is sought again with the changes of its neighbours.
TIED_SWEEPS: Final = 3
#: Words of places that belong to arms and to legs.
LIMB_WORDS: Final = (("shoulder", "elbow", "arm"), ("hip.", "knee", "thigh", "shank"))

#: Weights of squared distances of `posekit.motion.motion.NAMES`.
WEIGHTS: Final = np.array([1.0] * len(JOINTS) + [HEAD_WEIGHT] * len(HEAD) + [0.0] * len(FEET))


class PostureBounds:
    """Margins of postures of one person.

    Parameters
    ----------
    checks : sequence of Check
        Checks of postures.
    like : Body
        A body with the figure, the settings and the person by whom postures are judged.
    """

    def __init__(self, checks: Sequence[Check], like: Body) -> None:
        # A repaired limb does not end at the bend at which its rotation becomes decided: rounding would decide it.
        self.checks = [
            replace(one, straight_degrees=STRAIGHT_DEGREES - 1.0) if isinstance(one, JointRange) else one
            for one in checks
        ]
        self.like = like

    def judgements(self, points: Array, *, rigid: bool) -> Iterator[tuple[Check, Judgement]]:
        """Judge postures (N, P, 3) by the checks of lengths, or by the others."""
        joints, head, feet = np.split(points, [len(JOINTS), len(POINTS)], axis=1)
        body = replace(self.like, joints=joints, head=head, feet=feet, motion=False)
        vars(body)["person"] = self.like.person  # that of the whole clip, not of these postures
        for check in self.checks:
            if (check.name == "rigid-parts") == rigid:
                try:
                    yield check, judged(check, body)
                except NotAskedError:
                    continue

    def margins(self, points: Array, *, rigid: bool) -> Array:
        """Return margins (N, K) as metres; infinite where undecided.

        An axial rotation whose tolerance is wider, because the limb is almost straight, counts less.
        """
        found = [np.full((len(points), 0), np.inf)]
        for check, one in self.judgements(points, rigid=rigid):
            tolerance = np.broadcast_to(np.asarray(one.tolerance, dtype=np.float64), one.value.shape)
            least = tolerance.min(axis=1, keepdims=True)
            share = np.divide(least, tolerance, out=np.ones_like(one.value), where=tolerance > least)
            share = np.ones_like(share) if rigid else share
            margin = one.margin * share - INSIDE_BOUNDS.get(check.unit, 0.0)
            found.append(margin * (METRES_A_DEGREE if check.unit == "deg" else 1.0))
        every = np.concatenate(found, axis=1)
        return np.where(np.isnan(every), np.inf, every)

    def limbs(self, points: Array) -> NDArray[np.bool_]:
        """Return which of `LIMB_JOINTS` some check rejects (N, 4)."""
        found = np.zeros((len(points), len(LIMB_JOINTS)), dtype=np.bool_)
        for _, one in self.judgements(points, rigid=False):
            for column, place in enumerate(one.places):
                for limb in range(len(LIMB_JOINTS)):
                    if SIDES[limb % 2] in place and any(word in place for word in LIMB_WORDS[limb // 2]):
                        found[:, limb] |= one.violated[:, column]
        return found


class _Postures:
    """Postures (N, P, 3) that are sought near targets; `posekit.motion.repair.nearest.Problem`.

    The pieces of head and limbs turn, or all pieces; or, where lengths are wrong, each point moves by itself.
    """

    penalty, settled = BOUND_PENALTY, 1e-6

    def __init__(self, target: Array, bounds: PostureBounds, move: str) -> None:
        self.target, self.bounds, self.rigid = target, bounds, move == "points"
        self.first = columns_of(HEAD_PIECE).start if move == "limbs" else 0
        self.size = 3 * len(JOINTS) if self.rigid else N_UNKNOWNS - self.first

    def moved(self, state: Array, step: Array) -> Array:
        if not self.rigid:
            return moved(state, np.hstack([np.zeros((len(step), self.first)), step]))
        out = state.copy()
        out[:, : len(JOINTS)] += step.reshape(-1, len(JOINTS), 3)
        return out

    def residuals(self, rows: NDArray[np.intp], state: Array) -> tuple[Array, Array]:
        if self.rigid:
            jacobian = np.zeros((*state.shape, self.size))
            jacobian[:, : len(JOINTS)] = np.eye(self.size).reshape(len(JOINTS), 3, self.size)
        else:
            jacobian = jacobian_of(state)[..., self.first :]
        gap = state - self.target[rows]
        root = np.where(np.isfinite(gap), np.sqrt(WEIGHTS)[:, None], 0.0)
        residual = (np.nan_to_num(gap) * root).reshape(len(state), -1)
        return residual, (jacobian * root[..., None]).reshape(len(state), residual.shape[1], self.size)

    def margins(self, state: Array) -> Array:
        return self.bounds.margins(state, rigid=self.rigid)

    def slopes(self, state: Array, value: Array, chosen: NDArray[np.intp]) -> Array:
        return differences(self, DIFFERENCE, state, value, chosen)


def nearest_valid(target: Array, bounds: PostureBounds, start: Array | None = None) -> Array:
    """Find the nearest postures that all checks pass, as far as they can be found.

    Wrong distances are first brought within their bounds by the least change of the joints. Then all lengths stay, and
    head and limbs turn; torso and hips only where that does not suffice.

    Parameters
    ----------
    target : array (N, P, 3)
        Metres; NaN where unknown.
    bounds : PostureBounds
    start : array (N, P, 3), optional
        Legal postures from which alone the search starts, and whose lengths count.

    Returns
    -------
    array (N, P, 3)
        Postures without torso or hips stay as they are.
    """
    out = (target if start is None else start).copy()
    placed = np.flatnonzero(np.isfinite(out[:, list(TRUNK)]).all(axis=(1, 2)))
    for first in range(0, len(placed), AT_ONCE):
        rows = placed[first : first + AT_ONCE]
        if start is None:
            out[rows] = _of_batch(target[rows], bounds)
        else:
            out[rows], _ = nearest(_Postures(target[rows], bounds, "limbs"), out[rows])
    return out


def _of_batch(target: Array, bounds: PostureBounds) -> Array:
    out = target.copy()
    off = np.flatnonzero((bounds.margins(out, rigid=True) < 0).any(axis=1))
    if off.size:
        found, _ = nearest(_Postures(target[off], bounds, "points"), out[off])
        out[off] = along(out[off], found)
    bad = np.flatnonzero((bounds.margins(out, rigid=False) < 0).any(axis=1))
    if not bad.size:
        return out
    begin, limbs = out[bad], bounds.limbs(out[bad])
    best, cost = begin.copy(), np.full(len(bad), np.inf)
    left = np.arange(len(bad))
    ways = ((_sideways, SIDEWAYS), (_toward_rest, TOWARD_REST))
    for move, (other_start, amounts) in product(("limbs", "all"), ways):
        own = begin[left]
        starts = [other_start(own, limbs[left], amount) for amount in amounts]
        starts = [own, *starts] if other_start is _sideways else starts
        found, other = _best_of(starts, target[bad[left]], bounds, move)
        better = other < cost[left]
        best[left[better]], cost[left[better]] = found[better], other[better]
        left = left[(bounds.margins(best[left], rigid=False) < MET).any(axis=1)]
        if not left.size:
            break
    out[bad] = best
    return out


def along(before: Array, after: Array) -> Array:
    """Move head points with the neck, and toes and heels with the ankles: `after` (N, P, 3) is changed."""
    for point in (*HEAD, *FEET):
        parent = PIECE_PARENTS[point]
        after[:, point] = before[:, point] + after[:, parent] - before[:, parent]
    return after


def straightened(points: Array, judgement: Judgement) -> Array:
    """Straighten elbows and knees that bend backward in some frames of a clip, as a judgement of joint ranges says.

    The nearest legal bend of such a hinge is none. A single posture does not show it: neighbouring frames do.
    """
    out = points.copy()
    for limb, (start, middle, end) in enumerate(LIMB_JOINTS):
        place = f"{SIDES[limb % 2]}_{'elbow' if limb < len(SIDES) else 'knee'}.flexion"
        if place not in judgement.places:
            continue
        column = judgement.places.index(place)
        rows = np.flatnonzero(judgement.violated[:, column] & (judgement.value[:, column] < 0))
        lower = points[rows, end] - points[rows, middle]
        length = np.linalg.norm(lower, axis=-1, keepdims=True)
        out[rows, end] = points[rows, middle] + length * unit(points[rows, middle] - points[rows, start])
    return along(points, out)


def _best_of(starts: Sequence[Array], target: Array, bounds: PostureBounds, move: str) -> tuple[Array, Array]:
    """Search from several postures each; return the first that costs hardly more than the least."""
    ways, count = len(starts), len(target)
    problem = _Postures(np.tile(target, (ways, 1, 1)), bounds, move)
    found, cost = nearest(problem, np.concatenate(starts))
    found, cost = found.reshape(ways, *target.shape), cost.reshape(ways, count)
    first = np.argmax(cost * BETTER_COST <= cost.min(axis=0), axis=0)
    return found[first, np.arange(count)], cost[first, np.arange(count)]


def _sideways(points: Array, limbs: NDArray[np.bool_], angle: float) -> Array:
    """Turn the lower segments of limbs (N, 4) outward by an angle, radians."""
    out = points.copy()
    for limb, (_, middle, end) in enumerate(LIMB_JOINTS):
        rows = np.flatnonzero(limbs[:, limb])
        outward = angle if limb % 2 else -angle
        turn = rotation_about(_part_frame(points[rows], limb)[:, :, 0], np.full(len(rows), outward))
        lower = points[rows, end] - points[rows, middle]
        out[rows, end] = points[rows, middle] + (turn @ lower[..., None])[..., 0]
    return along(points, out)


def _toward_rest(points: Array, limbs: NDArray[np.bool_], share: float) -> Array:
    """Bring limbs (N, 4) nearer to hanging: the directions of their segments, lengths as they are."""
    out = points.copy()
    for limb, joints in enumerate(LIMB_JOINTS):
        rows = np.flatnonzero(limbs[:, limb])
        R = _part_frame(points[rows], limb)
        forward = np.sin(REST_BEND) * (1 if limb < len(SIDES) else -1)
        rest = (-R[:, :, 2], forward * R[:, :, 0] - np.cos(REST_BEND) * R[:, :, 2])
        for start, end, hanging in zip(joints[:-1], joints[1:], rest, strict=True):
            vector = points[rows, end] - points[rows, start]
            length = np.linalg.norm(vector, axis=-1, keepdims=True)
            out[rows, end] = out[rows, start] + length * unit((1 - share) * vector / length + share * hanging)
    return along(points, out)


def _part_frame(points: Array, limb: int) -> Array:
    """Return the frames (N, 3, 3) of the parts on which a limb hangs."""
    if limb < len(SIDES):
        return torso_frame(*(points[:, JOINT[name]] for name in TORSO))
    pelvis, right, left = (points[:, JOINT[name]] for name in HIPS)
    return hips_frame(pelvis, right, left, points[:, JOINT["neck"]])


def tied(found: Any, given: Array, bad: NDArray[np.intp], sweeps: int = TIED_SWEEPS) -> Array:
    r"""Find legal states of some frames whose changes are alike in neighbouring frames.

    With changes :math:`\delta_t`, :math:`|\delta_t|^2 + \mu |\delta_t - \delta_{t-1}|^2 + \mu |\delta_t -
    \delta_{t+1}|^2` is least where a frame is sought near its own state moved by
    :math:`\mu (\delta_{t-1} + \delta_{t+1}) / (1 + 2 \mu)`. Frames that are legal stay, with no change.

    Parameters
    ----------
    found : callable
        ``found(target, start)``: the nearest legal states (n, …) to targets, from where the search starts, or None.
    given : array (T, …)
    bad : int array
        Frames that are changed.
    sweeps : int
        Times that frames are tied; 0 for postures that are not in time.
    """
    out = given.copy()
    out[bad] = found(given[bad], None)
    inside = np.zeros(len(given), dtype=np.bool_)
    inside[bad] = True
    beside = bad[(np.r_[False, inside[:-1]] | np.r_[inside[1:], False])[bad]]
    for _ in range(sweeps if beside.size else 0):
        change = np.nan_to_num(out - given)
        around = np.zeros_like(change)
        around[1:] += change[:-1]
        around[:-1] += change[1:]
        aim = given[beside] + TIE_WEIGHT / (1 + 2 * TIE_WEIGHT) * around[beside]
        out[beside] = found(aim, out[beside])
    return out
