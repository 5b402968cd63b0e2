"""Other values of a robot's joints for the same placement: whole turns, and the second solution of three hinges."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.robots.configuration_space import HINGE_MODELS
from posekit.validators.robot.subject import Subject

SAME_METRES = 1e-9
"""Metres, and entries of rotations, within which two placements are one."""

TRIED_CONFIGURATIONS = 3
"""Configurations at which a second solution is tried before it is believed."""


class BallRotations(NamedTuple):
    """Three hinges in one place, by where they stand in q; the second solution turns the middle one to `half` - q."""

    first: int
    middle: int
    last: int
    half: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Branches:
    """The other configurations of a subject that place every body alike.

    Three hinges through one point reach each orientation twice: with the first and the last half a turn on, and
    the middle one mirrored (Diebel 2006, Representing Attitude, §5.6). A numerical solver finds one of the two.
    """

    subject: Subject

    def nearest_to_limits(self, q: Array) -> Array:
        """Return, of all branches of configurations (N, nq), those that are least outside the limits."""
        q = self._unwound(q)
        for ball in self.balls:
            columns = [ball.first, ball.middle, ball.last]
            other = q.copy()
            other[:, columns] = np.stack(
                [q[:, ball.first] + np.pi, ball.half - q[:, ball.middle], q[:, ball.last] + np.pi], axis=1
            )
            other = self._unwound(other)
            better = self._outside(other, columns) < self._outside(q, columns) - SAME_METRES
            q[better] = other[better]
        return q

    @cached_property
    def balls(self) -> tuple[BallRotations, ...]:
        """Every three hinges that have a second solution: found by their axes, and tried."""
        model = self.subject.model
        found: list[BallRotations] = []
        taken: set[int] = set()
        for last in range(1, model.njoints):
            middle = model.parents[last]
            first = model.parents[middle]
            chain = (first, middle, last)
            if 0 in chain or taken & set(chain) or not all(self._is_hinge(joint) for joint in chain):
                continue
            apart = (model.jointPlacements[joint].translation for joint in (middle, last))
            if any(np.abs(translation).max() > SAME_METRES for translation in apart):
                continue
            ball = self._second_solution(chain)
            if ball is not None:
                found.append(ball)
                taken |= set(chain)
        return tuple(found)

    def _is_hinge(self, joint: int) -> bool:
        return self.subject.model.joints[joint].shortname() in HINGE_MODELS

    def _second_solution(self, chain: tuple[int, int, int]) -> BallRotations | None:
        model = self.subject.model
        at = [int(model.idx_qs[joint]) for joint in chain]
        rng = np.random.default_rng(0)
        for half in (np.pi, 0.0):
            for _ in range(TRIED_CONFIGURATIONS):
                q = pin.neutral(model)
                q[at] = rng.uniform(-1.0, 1.0, 3)
                other = q.copy()
                other[at] = q[at[0]] + np.pi, half - q[at[1]], q[at[2]] + np.pi
                if np.abs(self._rotation(q, chain[2]) - self._rotation(other, chain[2])).max() > SAME_METRES:
                    break
            else:
                return BallRotations(at[0], at[1], at[2], half)
        return None

    def _rotation(self, q: Array, joint: int) -> Array:
        model = self.subject.model
        data = model.createData()
        pin.forwardKinematics(model, data, q)
        return np.asarray(data.oMi[joint].rotation).copy()

    def _unwound(self, q: Array) -> Array:
        """Turn the hinges that are outside their limits by whole turns to where they are least outside."""
        q = q.copy()
        subject, turn = self.subject, 2 * np.pi
        at = subject.index[~subject.slides]
        value, lower, upper = q[:, at], subject.lower[at], subject.upper[at]
        above = lower + np.mod(value - lower, turn)
        below = above - turn
        nearer = np.where(above - upper <= lower - below, above, below)
        outside = (value < lower) | (value > upper)
        q[:, at] = np.where(outside & np.isfinite(nearer), nearer, value)
        return q

    def _outside(self, q: Array, columns: list[int]) -> Array:
        """Return the largest angle outside the limits (N,) among some entries of q."""
        value = q[:, columns]
        lower, upper = self.subject.lower[columns], self.subject.upper[columns]
        outside: NDArray[np.float64] = np.maximum(np.maximum(lower - value, value - upper), 0.0)
        return np.asarray(outside.max(axis=1))
