"""Legal states: the least change of postures or configurations that all checks pass, alike in neighbouring frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Final

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.body.frames import hips_frame, torso_frame
from posekit.geometry import Array, unit
from posekit.motion.repair.nearest import NEAR, differences, nearest
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
#: Distance inside its limits to which a joint of a robot is brought, radians or metres.
INSIDE_LIMITS: Final = 2e-6
#: Distance beyond their margin to which bodies are moved apart; depths of meshes are known to 1e-5.
KEPT_APART_METRES: Final = 5e-5
#: Distance up to which a pair of bodies is watched.
WATCHED_METRES: Final = 0.02
#: Step by which margins are differentiated, radians or metres.
DIFFERENCE: Final = 1e-6
#: Margin from which a bound is met, metres: it is still inside the bound itself.
MET: Final = -2e-6
#: Weight of a head point: all five together weigh as much as a joint.
HEAD_WEIGHT: Final = 0.2
#: States of a batch.
AT_ONCE: Final = 256
#: Shares of the way to rest of other starts: a limb that bends the wrong way in its own plane gives no hint to which
#: side it is better turned, and bodies deep in each other have no way out.
TOWARD_REST: Final = (0.25, 0.5, 1.0)
#: Bend of elbows and knees of hanging limbs, radians: inside all ranges.
REST_BEND: Final = np.radians(20.0)
#: Ratio of costs below which another start is preferred.
BETTER_COST: Final = 0.999
#: Weight of the squared difference between the changes of neighbouring frames, beside that of the change itself.
TIE_WEIGHT: Final = 1.0
#: Times that each frame is sought again with the changes of its neighbours.
TIED_SWEEPS: Final = 3

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

    def margins(self, points: Array, *, rigid: bool) -> Array:
        """Return margins (N, K) of lengths, or of all else, as metres; infinite where undecided.

        An axial rotation whose tolerance is wider, because the limb is almost straight, counts less.
        """
        joints, head, feet = np.split(points, [len(JOINTS), len(POINTS)], axis=1)
        body = replace(self.like, joints=joints, head=head, feet=feet, motion=False)
        vars(body)["person"] = self.like.person  # that of the whole clip, not of these postures
        found = [np.full((len(points), 0), np.inf)]
        for check in self.checks:
            if (check.name == "rigid-parts") != rigid:
                continue
            try:
                one = judged(check, body)
            except NotAskedError:
                continue
            tolerance = np.broadcast_to(np.asarray(one.tolerance, dtype=np.float64), one.value.shape)
            least = tolerance.min(axis=1, keepdims=True)
            wide = (tolerance > least) & (not rigid)
            share = np.divide(least, tolerance, out=np.ones_like(one.value), where=wide)
            margin = one.margin * share - INSIDE_BOUNDS.get(check.unit, 0.0)
            found.append(margin * (METRES_A_DEGREE if check.unit == "deg" else 1.0))
        every = np.concatenate(found, axis=1)
        return np.where(np.isnan(every), np.inf, every)


class Postures:
    """Postures (N, P, 3) that are sought near targets; `posekit.motion.repair.nearest.Problem`.

    The pieces of head and limbs turn, or all pieces; or, where lengths are wrong, each point moves by itself. The
    penalty, in square metres a metre, is more than the change of all joints together that one bound can demand.
    """

    penalty, settled, met = 20.0, 1e-6, MET

    def __init__(self, target: Array, bounds: PostureBounds, move: str) -> None:
        self.target, self.bounds, self.rigid = target, bounds, move == "points"
        self.first = columns_of(HEAD_PIECE).start if move == "limbs" else 0
        self.size = 3 * len(JOINTS) if self.rigid else N_UNKNOWNS - self.first

    def moved(self, state: Array, step: Array) -> Array:
        """Return postures after steps (N, size)."""
        if not self.rigid:
            return moved(state, np.hstack([np.zeros((len(step), self.first)), step]))
        out = state.copy()
        out[:, : len(JOINTS)] += step.reshape(-1, len(JOINTS), 3)
        return out

    def residuals(self, rows: NDArray[np.intp], state: Array) -> tuple[Array, Array]:
        """Return weighted distances from the targets, and their derivatives."""
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
        """Return the margins of the checks."""
        return self.bounds.margins(state, rigid=self.rigid)

    def slopes(self, state: Array, value: Array, chosen: NDArray[np.intp]) -> Array:
        """Differentiate the margins numerically."""
        return differences(self, DIFFERENCE, state, value, chosen)

    def toward_rest(self, points: Array, share: float) -> Array:
        """Bring limbs nearer to hanging: the directions of their segments, lengths as they are."""
        out = points.copy()
        pelvis, right, left = (points[:, JOINT[name]] for name in HIPS)
        hips = hips_frame(pelvis, right, left, points[:, JOINT["neck"]])
        torso = torso_frame(*(points[:, JOINT[name]] for name in TORSO))
        for limb, joints in enumerate(LIMB_JOINTS):
            R, forward = (torso, 1) if limb < len(SIDES) else (hips, -1)
            down = -R[:, :, 2]
            bent = forward * np.sin(REST_BEND) * R[:, :, 0] + np.cos(REST_BEND) * down
            for start, end, hanging in zip(joints[:-1], joints[1:], (down, bent), strict=True):
                vector = points[:, end] - points[:, start]
                length = np.linalg.norm(vector, axis=-1, keepdims=True)
                out[:, end] = out[:, start] + length * unit((1 - share) * vector / length + share * hanging)
        return _along(points, out)


class Configurations:
    """Configurations (N, nq) within limits and apart; `posekit.motion.repair.nearest.Problem`. The root stays."""

    penalty, settled, met = 1e3, 1e-4, -KEPT_APART_METRES / 2

    def __init__(self, robot: Any, found: dict[str, tuple[Check, Judgement]], margin: float) -> None:
        self.robot, self.model, self.margin = robot, robot.model, margin
        self.root = 6 if robot.free_flyer else 0
        self.size, self.still = robot.model.nv - self.root, np.zeros((6, robot.model.nv))
        self.lower, self.upper = (np.full(robot.model.nq, sign * np.inf) for sign in (-1, 1))
        names = list(robot.configuration_names)
        for name, factor in (("joint-range", float(np.degrees(1.0))), ("joint-travel", 1.0)):
            if name in found:
                one = found[name][1]
                at = [names.index(place) for place in one.places]
                self.lower[at] = np.broadcast_to(one.lower, one.value.shape)[0] / factor + INSIDE_LIMITS
                self.upper[at] = np.broadcast_to(one.upper, one.value.shape)[0] / factor - INSIDE_LIMITS
        self.pairs = len(robot.collision_pairs) if "collision" in found else 0
        self.target = np.zeros((0, robot.model.nq))
        self.hulls = _hulls(robot.geometry) if self.pairs else None

    def inside(self, q: Array) -> Array:
        """Bring configurations within the limits."""
        return np.asarray(self.robot.with_mimics(np.clip(q, self.lower, self.upper)))

    def moved(self, state: Array, step: Array) -> Array:
        """Return configurations after steps (N, size), within the limits."""
        whole = np.hstack([np.zeros((len(step), self.root)), step])
        out = [pin.integrate(self.model, q, d) for q, d in zip(state, whole, strict=True)]
        return self.inside(np.array(out))

    def residuals(self, rows: NDArray[np.intp], state: Array) -> tuple[Array, Array]:
        """Return the steps from the targets, and their derivatives."""
        steps = [pin.difference(self.model, a, b) for a, b in zip(self.target[rows], state, strict=True)]
        return np.array(steps)[:, self.root :], np.tile(np.eye(self.size), (len(state), 1, 1))

    def margins(self, state: Array) -> Array:
        """Return the distances of pairs of bodies beyond their margin."""
        out = np.full((len(state), self.pairs), np.inf)
        if self.pairs:
            found = self.robot.collisions(state, margin=max(self.margin, 0.0) + WATCHED_METRES)
            out[found.frame, found.pair] = found.distance - self.margin - KEPT_APART_METRES
        return out

    def slopes(self, state: Array, value: Array, chosen: NDArray[np.intp]) -> Array:
        """Differentiate distances: each end moves by its joint's Jacobian, and only along the normal of the hulls."""
        slope = np.zeros((*value.shape, self.size))
        if self.hulls is None:
            return slope
        model, hulls, data, placed = self.model, self.hulls, self.model.createData(), self.hulls.createData()
        for row, q in enumerate(state):
            pin.computeJointJacobians(model, data, q)
            pin.updateGeometryPlacements(model, data, hulls, placed)
            for k in np.flatnonzero(value[row] < NEAR).tolist():
                pair = hulls.collisionPairs[int(chosen[row, k])]
                found = pin.computeDistance(hulls, placed, int(chosen[row, k]))
                ends = []
                for body, point in (
                    (pair.first, found.getNearestPoint1()),
                    (pair.second, found.getNearestPoint2()),
                ):
                    joint = hulls.geometryObjects[body].parentJoint  # 0 is fixed to the world
                    J = (
                        pin.getJointJacobian(model, data, joint, pin.LOCAL_WORLD_ALIGNED)
                        if joint
                        else self.still
                    )
                    ends.append(J[:3] - pin.skew(np.asarray(point) - data.oMi[joint].translation) @ J[3:])
                slope[row, k] = np.nan_to_num(np.asarray(found.normal) @ (ends[1] - ends[0]))[self.root :]
        return slope

    def toward_rest(self, q: Array, share: float) -> Array:
        """Bring configurations nearer to the neutral one."""
        step = [pin.difference(self.model, one, self.robot.neutral)[self.root :] for one in q]
        return self.moved(q, share * np.array(step))

    def nearest(self, target: Array, start: Array | None) -> Array:
        """Return the nearest configurations within all bounds; a start is within them."""
        self.target = np.array([pin.normalize(self.model, q) for q in target])
        begin = self.inside(target if start is None else start)
        return nearest(self, begin)[0] if start is not None else _from_starts(self, begin)


def _hulls(geometry: Any) -> Any:
    """Return the bodies with the convex hulls of meshes: meshes themselves have no depth."""
    hulls = geometry.copy()
    for body in hulls.geometryObjects:
        if isinstance(body.geometry, coal.BVHModelBase):
            try:
                body.geometry.buildConvexHull(True, "Qt")
            except RuntimeError:  # a flat mesh has no hull
                continue
            body.geometry = body.geometry.convex or body.geometry
    return hulls


def _from_starts(problem: Any, start: Array) -> Array:
    """Search from states, and where bounds are not met from others on the way to rest; return the cheapest."""
    out, cost = nearest(problem, start)
    target = problem.target
    for share in TOWARD_REST:
        left = np.flatnonzero((problem.margins(out) < problem.met).any(axis=1))
        if not left.size:
            break
        problem.target = target[left]
        found, other = nearest(problem, problem.toward_rest(start[left], share))
        problem.target = target
        better = other < BETTER_COST * cost[left]
        out[left[better]], cost[left[better]] = found[better], other[better]
    return out


def nearest_valid(bounds: PostureBounds, target: Array, start: Array | None = None) -> Array:
    """Find the nearest postures that all checks pass, as far as they can be found.

    Wrong distances are first brought within their bounds by the least change of the joints. Then all lengths stay, and
    head and limbs turn; torso and hips only where that does not suffice.

    Parameters
    ----------
    bounds : PostureBounds
    target : array (N, P, 3)
        Metres; NaN where unknown.
    start : array (N, P, 3), optional
        Legal postures from which alone the search starts, and whose lengths count.

    Returns
    -------
    array (N, P, 3)
        Postures without torso or hips stay as they are.
    """
    out = (target if start is None else start).copy()
    placed = np.flatnonzero(np.isfinite(out[:, list(TRUNK)]).all(axis=(1, 2)))
    for rows in np.split(placed, range(AT_ONCE, len(placed), AT_ONCE)):
        if start is not None:
            out[rows], _ = nearest(Postures(target[rows], bounds, "limbs"), out[rows])
            continue
        off = rows[(bounds.margins(out[rows], rigid=True) < 0).any(axis=1)]
        if off.size:
            found, _ = nearest(Postures(target[off], bounds, "points"), out[off])
            out[off] = _along(out[off], found)
        begin = out.copy()
        bad = rows[(bounds.margins(out[rows], rigid=False) < 0).any(axis=1)]
        for move in ("limbs", "all"):
            if bad.size:
                out[bad] = _from_starts(Postures(target[bad], bounds, move), begin[bad])
                bad = bad[(bounds.margins(out[bad], rigid=False) < MET).any(axis=1)]
    return out


def _along(before: Array, after: Array) -> Array:
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
        if place in judgement.places:
            column = judgement.places.index(place)
            rows = np.flatnonzero(judgement.violated[:, column] & (judgement.value[:, column] < 0))
            length = np.linalg.norm(points[rows, end] - points[rows, middle], axis=-1, keepdims=True)
            out[rows, end] = points[rows, middle] + length * unit(points[rows, middle] - points[rows, start])
    return _along(points, out)


def tied(
    found: Callable[[Array, Array | None], Array],
    given: Array,
    bad: NDArray[np.intp],
    sweeps: int = TIED_SWEEPS,
) -> Array:
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
