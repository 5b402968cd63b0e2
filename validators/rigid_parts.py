"""Rigid parts: the lengths of bones and the shapes of torso and hips are constant (Lee & Chen 1985, §3.2.B)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from posekit.body.frames import torso_frame
from posekit.geometry import Array, dot
from posekit.skeleton import JOINT, JOINTS, RIGID_SEGMENTS, SEGMENTS, TORSO, segment_name
from posekit.tree.steps import DISTANCE, Step, step
from posekit.tree.steps import TORSO as TORSO_STEP
from posekit.validators.body import Body
from posekit.validators.check import Judgement

TORSO_POINTS: Final = [JOINT[name] for name in TORSO]

#: Smallest divisor of margins, metres, for tolerances near zero.
LEAST_SCALE: Final = 1e-3

#: Factors of the torso's coordinates that mirror it, so that front and back are exchanged.
MIRROR: Final = np.array([-1.0, 1.0, 1.0])


@dataclass(frozen=True, kw_only=True, eq=False)
class RigidParts:
    """A bone does not have its length, or torso and hips do not have their shape.

    Parameters
    ----------
    segments : tuple of (int, int)
        Pairs of joints; the check judges their distances.
    torso : bool
        Whether to judge the shape of the torso too. For exact postures the check aligns the figure's torso with the
        posture's torso, as the closed-form inverse kinematics does, and judges the distances between corresponding
        joints. For other postures it compares only the side on which the shoulders lie: in front of or behind the line
        from neck to pelvis. Segment lengths do not determine this side.
    """

    name = "rigid-parts"
    unit = "m"
    reads = ("joints",)

    segments: tuple[tuple[int, int], ...] = SEGMENTS
    torso: bool = True

    @cached_property
    def points(self) -> tuple[str, ...]:
        """Names of the joints that the check reads."""
        read = {joint for segment in self.segments for joint in segment}
        return tuple(JOINTS[joint] for joint in sorted(read | set(TORSO_POINTS if self.torso else ())))

    @cached_property
    def parts(self) -> list[RigidParts]:
        """Return one check for each rigid segment of trunk and hips, and one for the shape of the torso."""
        torso = RigidParts(segments=(), torso=True)
        return [*(replace(torso, segments=(segment,), torso=False) for segment in RIGID_SEGMENTS), torso]

    def steps(self, body: Body) -> list[Step] | None:
        """Return the check for the C++ tree search; None if postures are not exact."""
        if body.tolerance is None or not body.tolerance.exact:
            return None
        found = [
            step(
                DISTANCE,
                [segment_name(segment)],
                points=segment,
                tolerance=body.rigid_tolerance(segment),
                numbers=[body.lengths[segment_name(segment)]],
            )
            for segment in self.segments
        ]
        if self.torso:
            torso = [*body.figure.neutral_points[TORSO_POINTS].ravel(), float(not body.figure.side_known)]
            tolerance = body.rigid_tolerance(RIGID_SEGMENTS[0])
            found.append(step(TORSO_STEP, ["torso"], points=TORSO_POINTS, tolerance=tolerance, numbers=torso))
        return found

    def judge(self, body: Body) -> Judgement:
        """Compare segment lengths and the shape of the torso with the figure's."""
        names = [segment_name(segment) for segment in self.segments]
        length = np.array([body.lengths[name] for name in names])
        value = body.segment_lengths[[SEGMENTS.index(segment) for segment in self.segments]].T
        tolerance = np.array([body.rigid_tolerance(segment) for segment in self.segments])
        bones = Judgement(names, value, length, length, tolerance, np.maximum(tolerance, LEAST_SCALE))
        if not self.torso:
            return bones
        exact = body.tolerance is not None and body.tolerance.exact
        torso, lower, upper = (self._placement if exact else self._side)(body)
        scale = max(body.rigid_tolerance(RIGID_SEGMENTS[0]), LEAST_SCALE)
        return Judgement.stacked([bones, Judgement(["torso"], torso, lower, upper, scale=scale)])

    @staticmethod
    def _side(body: Body) -> tuple[Array, float, float]:
        """Return a shoulder's distance from the neck-pelvis line, positive on the figure's side (N,), and its bounds.

        The side is front or back. The distance is NaN if the figure's side is unknown.
        """
        figure = body.figure
        offset = figure.shoulder_offset if figure.shoulder_side != "undecided" else np.nan
        tolerance = body.rigid_tolerance(RIGID_SEGMENTS[0])
        value = np.full(len(body), np.nan)
        if 2 * abs(offset) > tolerance:
            R = torso_frame(*np.moveaxis(body.joints[:, TORSO_POINTS], 1, 0))
            value = np.copysign(1.0, offset) * dot(R[:, :, 0], body.joints[:, 1] - body.joints[:, 0])
        return value, min(abs(offset) - tolerance, 0.0), np.inf

    @staticmethod
    def _placement(body: Body) -> tuple[Array, float, float]:
        """Return the largest distance (N,) of a torso joint from the same joint of the figure, and its bounds."""
        figure, points = body.figure, body.joints[:, TORSO_POINTS]
        R = torso_frame(*np.moveaxis(points, 1, 0))

        def apart(torso: Array) -> Array:
            placed = points[:, :1] + np.einsum("nij,pj->npi", R, torso)
            return np.asarray(np.linalg.norm(placed - points, axis=-1).max(axis=1))

        torso, tolerance = figure.neutral_points[TORSO_POINTS], body.rigid_tolerance(RIGID_SEGMENTS[0])
        value = apart(torso)
        if not figure.side_known:  # a torso that fits only the mirror image is undecided
            value = np.where((value > tolerance) & (apart(torso * MIRROR) <= tolerance), np.nan, value)
        return value, -np.inf, tolerance
