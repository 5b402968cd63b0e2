"""Clips as repair changes them: points of a measured body, or configurations of a robot, with the same operations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, runs, unit
from posekit.motion.motion import NAMES, Motion
from posekit.motion.repair.nearest import nearest
from posekit.motion.repair.pieces import interpolated
from posekit.motion.repair.postures import TIED_SWEEPS, PostureBounds, nearest_valid, straightened, tied
from posekit.skeleton import JOINTS, POINTS
from posekit.validators.body import Body
from posekit.validators.check import Check, Judgement, NotAskedError, judged
from posekit.validators.judge import Validator, chosen_checks
from posekit.validators.robot import sole_points

Bools = NDArray[np.bool_]

#: Frames that are smoothed at once.
BLOCK_FRAMES: Final = 240
#: Motion whose acceleration changes evenly is not changed by smoothing.
THIRD_DIFFERENCE: Final = np.array([1.0, -3.0, 3.0, -1.0])
#: Times that postures are sought again: the person's lengths may be those of the repaired postures.
ROUNDS: Final = 3
#: Distance inside its limits to which a joint is brought, radians or metres.
INSIDE_LIMITS: Final = 2e-6
#: Distance beyond their margin to which bodies are moved apart; depths of meshes are known to 1e-5.
KEPT_APART_METRES: Final = 5e-5
#: Distance up to which a pair of bodies is watched.
WATCHED_METRES: Final = 0.02
#: Shares of the way to the neutral configuration of other starts: bodies deep in each other have no way out.
TOWARD_NEUTRAL: Final = (0.25, 0.5, 1.0)
#: Configurations of a batch.
ROBOTS_AT_ONCE: Final = 64


@dataclass(frozen=True, kw_only=True, eq=False)
class Clip:
    """One recording of points, and the changes that were made.

    Parameters
    ----------
    motion : Motion
        The recording as it was given.
    validator : Validator
        The judge.
    state : array (T, …)
        Points (T, P, 3) in the order of `posekit.motion.motion.NAMES`; of a robot configurations (T, nq).
    time : array (T,)
        Seconds.
    rows : int array (T,)
        Frame of `motion` of each frame; -1 for one that was inserted.
    filled : bool array (T,)
        Frames made from their neighbours.
    mirrored : bool
        Whether right and left were exchanged in all frames.
    """

    motion: Motion
    validator: Validator
    state: Array
    time: Array
    rows: NDArray[np.intp]
    filled: Bools
    mirrored: bool = False

    @classmethod
    def of(cls, motion: Motion, validator: Validator) -> Self:
        """Return a recording before any change."""
        count = len(motion)
        return cls(
            motion=motion,
            validator=validator,
            state=cls.state_of(motion),
            time=np.array(motion.time),
            rows=np.arange(count),
            filled=np.zeros(count, dtype=np.bool_),
        )

    @staticmethod
    def state_of(motion: Motion) -> Array:
        """Return the state of a recording."""
        return motion.points(NAMES)

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.state)

    def with_state(self, state: Array, **changes: Any) -> Self:
        """Return the clip with another state."""
        return replace(self, state=state, **changes)

    def as_motion(self) -> Motion:
        """Return the clip as a motion with the points of the recording."""
        columns = [NAMES.index(name) for name in self.motion.joint_names]
        return self._motion(joints=self.state[:, columns], q=None, q_names=())

    def _motion(self, **fields: Any) -> Motion:
        whole = len(self) == len(self.motion)
        frame = np.asarray(self.motion.frame) if whole else np.arange(len(self))
        return replace(
            self.motion, time=self.time, frame=frame, clip=np.zeros(len(self), dtype=np.intp), **fields
        )

    def body(self) -> Body:
        """Return the clip as checks see it."""
        return Body.of(self.as_motion(), self.validator.settings, base=self.validator.figure)

    def judged(self, *, over_time: bool) -> dict[str, tuple[Check, Judgement]]:
        """Ask the checks over time, or those of postures."""
        body, found = self.body(), {}
        of_robot = body.robot is not None
        for check in chosen_checks(self.validator.settings, of_robot=of_robot, in_time=body.motion):
            if bool(getattr(check, "over_time", False)) == over_time:
                try:
                    found[check.name] = check, judged(check, body)
                except NotAskedError:
                    continue
        return found

    @property
    def sweeps(self) -> int:
        """Times that neighbouring frames are tied."""
        return TIED_SWEEPS if self.motion.in_time else 0

    def points(self) -> Array:
        """Return the points (T, P, 3) in the order of `NAMES`, metres."""
        return self.state

    def taken(self, order: NDArray[np.intp], time: Array) -> Self:
        """Return the clip with its frames in another order, at some times."""
        return self.with_state(self.state[order], rows=self.rows[order], filled=self.filled[order], time=time)

    def with_gaps(self, gaps: NDArray[np.intp], step: float) -> Self:
        """Insert frames before each frame (T,), and interpolate them."""
        before = np.maximum(np.repeat(np.arange(len(self)), gaps + 1) - 1, 0)
        own = np.cumsum(gaps + 1) - 1
        before[own] = np.arange(len(self))
        inserted = np.ones(len(before), dtype=np.bool_)
        inserted[own] = False
        time = self.time[before].copy()
        for first, stop in runs(inserted):
            time[first:stop] = time[first - 1] + step * np.arange(1, stop - first + 1)
        wide = self.with_state(
            self.state[before],
            time=time,
            rows=np.where(inserted, -1, self.rows[before]),
            filled=self.filled[before],
        )
        return wide.interpolated(inserted)

    def interpolated(self, bad: Bools) -> Self:
        """Put frames between the good ones around them."""
        return self.with_state(interpolated(self.state, bad), filled=self.filled | bad)

    def shifted(self, by: Array) -> Self:
        """Move the body by (T, 3), metres."""
        return self.with_state(self.state + by[:, None])

    def smoothed(self, loose: Bools, places: Sequence[str], strength: float) -> Self:
        """Smooth the points that `places` name, where they are loose (T, K)."""
        out = self.state.copy()
        every = bool(set(JOINTS) <= set(places)) and bool(loose.all(axis=1).any())
        for column, name in enumerate(NAMES):
            if name in places:
                rows = loose[:, places.index(name)]
            elif every:
                rows = np.asarray(loose.any(axis=1))
            else:
                continue
            if rows.any() and np.isfinite(out[:, column]).all():
                out[:, column] = smoothed(out[:, column], rows, strength)
        return self.with_state(out)

    def legal(self) -> Self:
        """Return the clip with the nearest postures that the checks of postures pass, tied over time."""
        given, out = self.state, self.state.copy()
        for _ in range(ROUNDS):
            now = self.with_state(out)
            found = now.judged(over_time=False)
            bad = np.flatnonzero(rejected(one for _, one in found.values()))
            if not bad.size:
                break
            target = given
            if "joint-range" in found:
                target = straightened(given, found["joint-range"][1])
            bounds = PostureBounds([check for check, _ in found.values()], now.body())
            changed = np.flatnonzero((np.nan_to_num(out - given) != 0).any(axis=(1, 2)))
            out = tied(
                lambda aim, start, bounds=bounds: nearest_valid(aim, bounds, start),
                target,
                np.union1d(bad, changed),
                self.sweeps,
            )
        return self.with_state(out)


def rejected(judgements: Any) -> Bools:
    """Return the frames that some judgement rejects (T,)."""
    return np.asarray(np.logical_or.reduce([one.violated.any(axis=1) for one in judgements]))


def smoothed(values: Array, loose: Bools, strength: float) -> Array:
    r"""Smooth columns (T, K) where they may move.

    Minimises :math:`|y - x|^2 + \lambda |D^3 y|^2` over the loose frames (Whittaker 1923; Eilers 2003, *A perfect
    smoother*, Anal. Chem. 75:3631), with :math:`\lambda` the strength.
    """
    out, width = values.copy(), len(THIRD_DIFFERENCE)
    every = np.flatnonzero(loose)
    for shift in (0, BLOCK_FRAMES // 2):
        for rows in np.split(every, np.searchsorted(every, np.arange(shift, len(values), BLOCK_FRAMES))):
            if not rows.size:
                continue
            low, high = max(rows[0] - width + 1, 0), min(rows[-1] + width, len(out))
            if high - low < width:
                continue
            window, count = out[low:high].copy(), high - low
            window[rows - low] = 0.0
            difference = np.zeros((count - width + 1, count))
            for k, factor in enumerate(THIRD_DIFFERENCE):
                difference[np.arange(count - width + 1), np.arange(count - width + 1) + k] = factor
            own = difference[:, rows - low]
            normal = np.eye(len(rows)) + strength * own.T @ own
            out[rows] = np.linalg.solve(normal, values[rows] - strength * own.T @ (difference @ window))
    return out


@dataclass(frozen=True, kw_only=True, eq=False)
class RobotClip(Clip):
    """One recording of a robot's configurations, and the changes that were made; the fields of `Clip`."""

    @staticmethod
    def state_of(motion: Motion) -> Array:
        """Return the configurations."""
        return np.array(motion.q)

    @property
    def robot(self) -> Any:
        """The robot, or the figure, whose configurations these are."""
        return self.validator.robot or self.validator.figure

    def as_motion(self) -> Motion:
        """Return the clip as a motion of configurations."""
        return self._motion(q=self.state, joints=None)

    def body(self) -> Body:
        """Return the clip as checks see it, with the ends of the soles as feet."""
        placed = self.motion.in_time  # arms have no joints of a body, and single postures need none
        body = Body.of(self.as_motion(), self.validator.settings, robot=self.robot, placed=placed)
        return replace(body, feet=sole_points(self.robot, self.state)) if body.motion else body

    def points(self) -> Array:
        """Return the points (T, P, 3) in the order of `NAMES`, metres."""
        body = self.body()
        return np.concatenate(
            [body.joints, np.full((len(self), len(POINTS) - len(JOINTS), 3), np.nan), body.feet], axis=1
        )

    def interpolated(self, bad: Bools) -> Self:
        """Put frames between the good ones around them, along the geodesic of the configurations."""
        import pinocchio as pin

        out = self.state.copy()
        for first, stop in runs(bad):
            if first > 0 and stop < len(out):
                for row in range(first, stop):
                    share = (row - first + 1) / (stop - first + 1)
                    out[row] = pin.interpolate(self.robot.model, out[first - 1], out[stop], share)
        return self.with_state(out, filled=self.filled | bad)

    def shifted(self, by: Array) -> Self:
        """Move the root by (T, 3), metres; a robot with a fixed root stays."""
        out = self.state.copy()
        if self.robot.free_flyer:
            out[:, :3] += by
        return self.with_state(out)

    def smoothed(self, loose: Bools, places: Sequence[str], strength: float) -> Self:
        """Smooth all joints, and the root, in the frames in which something is loose (T, K)."""
        out, names = self.state.copy(), list(self.robot.configuration_names)
        at = [k for k, name in enumerate(names) if name in places] or list(range(len(names)))
        if self.robot.free_flyer:  # quaternions of one sign can be smoothed as numbers
            turn = out[:, 3:7]
            turn[1:] *= np.cumprod(np.where((turn[1:] * turn[:-1]).sum(axis=1) < 0, -1.0, 1.0))[:, None]
        rows = np.asarray(loose.any(axis=1))
        out[:, at] = smoothed(out[:, at], rows, strength)
        if self.robot.free_flyer:
            out[rows, 3:7] = unit(out[rows, 3:7])
        return self.with_state(np.where(rows[:, None], out, self.state))

    def legal(self) -> Self:
        """Return the clip with the nearest configurations inside their limits whose bodies keep apart."""
        found = self.judged(over_time=False)
        bad = np.flatnonzero(rejected(one for _, one in found.values()))
        if not bad.size:
            return self
        problem_of = _Limits(self.robot, found, self.validator.settings.contact_margin)
        return self.with_state(tied(problem_of.nearest, self.state, bad, self.sweeps))


class _Limits:
    """Configurations (N, nq) within limits and apart; `posekit.motion.repair.nearest.Problem`. The root stays."""

    penalty, settled = 1e3, 1e-4

    def __init__(self, robot: Any, found: dict[str, tuple[Check, Judgement]], margin: float) -> None:
        self.robot, self.margin = robot, margin
        self.root = 6 if robot.free_flyer else 0
        self.size = robot.model.nv - self.root
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
        self.data = robot.model.createData()
        self.hulls: Any = None if robot.geometry is None else _hulls(robot.geometry)

    def nearest(self, target: Array, start: Array | None) -> Array:
        """Return the nearest configurations."""
        import pinocchio as pin

        out = self._inside(target if start is None else start)
        for first in range(0, len(out), ROBOTS_AT_ONCE):
            rows = slice(first, first + ROBOTS_AT_ONCE)
            self.target = np.array([pin.normalize(self.robot.model, q) for q in target[rows]])
            found, _ = nearest(self, out[rows])
            every = self.target
            for share in TOWARD_NEUTRAL:
                left = np.flatnonzero((self.margins(found) < -KEPT_APART_METRES / 2).any(axis=1))
                if not left.size:
                    break
                step = [pin.difference(self.robot.model, q, self.robot.neutral) for q in found[left]]
                begin = self.moved(found[left], share * np.array(step)[:, self.root :])
                self.target = every[left]
                found[left], _ = nearest(self, begin)
            out[rows] = found
        return out

    def _inside(self, q: Array) -> Array:
        q = np.clip(q, self.lower, self.upper)
        return np.asarray(self.robot.with_mimics(q) if getattr(self.robot, "mimics", ()) else q)

    def moved(self, state: Array, step: Array) -> Array:
        import pinocchio as pin

        whole = np.hstack([np.zeros((len(step), self.root)), step])
        out = [pin.integrate(self.robot.model, q, d) for q, d in zip(state, whole, strict=True)]
        return self._inside(np.array(out))

    def residuals(self, rows: NDArray[np.intp], state: Array) -> tuple[Array, Array]:
        import pinocchio as pin

        model = self.robot.model
        gap = [pin.difference(model, a, b) for a, b in zip(self.target[rows], state, strict=True)]
        residual = np.array(gap)[:, self.root :]
        return residual, np.tile(np.eye(self.size), (len(state), 1, 1))

    def margins(self, state: Array) -> Array:
        out = np.full((len(state), self.pairs), np.inf)
        if self.pairs:
            found = self.robot.collisions(state, margin=max(self.margin, 0.0) + WATCHED_METRES)
            out[found.frame, found.pair] = found.distance - self.margin - KEPT_APART_METRES
        return out

    def slopes(self, state: Array, value: Array, chosen: NDArray[np.intp]) -> Array:
        """Differentiate distances: each end moves by its joint's Jacobian, and only along the normal of the hulls."""
        import pinocchio as pin

        slope = np.zeros((*value.shape, self.size))
        if not self.pairs:
            return slope
        model, data, hulls = self.robot.model, self.data, self.hulls
        placed = hulls.createData()
        for row, q in enumerate(state):
            pin.computeJointJacobians(model, data, q)
            pin.updateGeometryPlacements(model, data, hulls, placed)
            for k in np.flatnonzero(np.isfinite(value[row])).tolist():
                pair = hulls.collisionPairs[int(chosen[row, k])]
                found = pin.computeDistance(hulls, placed, int(chosen[row, k]))
                points = found.getNearestPoint1(), found.getNearestPoint2()
                ends = []
                for body, point in zip((pair.first, pair.second), points, strict=True):
                    joint = hulls.geometryObjects[body].parentJoint
                    J = np.zeros((6, model.nv))  # of what is fixed to the world
                    if joint:
                        J = pin.getJointJacobian(model, data, joint, pin.LOCAL_WORLD_ALIGNED)
                    ends.append(J[:3] - pin.skew(np.asarray(point) - data.oMi[joint].translation) @ J[3:])
                slope[row, k] = np.nan_to_num(np.asarray(found.normal) @ (ends[1] - ends[0]))[self.root :]
        return slope


def _hulls(geometry: Any) -> Any:
    """Return the bodies with the convex hulls of meshes: meshes themselves have no depth."""
    import coal

    hulls = geometry.copy()
    for body in hulls.geometryObjects:
        if isinstance(body.geometry, coal.BVHModelBase):
            try:
                body.geometry.buildConvexHull(True, "Qt")
            except RuntimeError:  # a flat mesh has no hull
                continue
            body.geometry = body.geometry.convex or body.geometry
    return hulls
