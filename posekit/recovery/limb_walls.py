"""Checks of limbs as soft limits for refinement: ranges that no box of the figure's angles can say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Final

import numpy as np

from posekit.body import Figure
from posekit.body.frames import hips_frame, torso_frame
from posekit.compiled import posture_kernels
from posekit.compiled.compiling import compiled, is_installed
from posekit.compiled.screen_kinds import OF_ANATOMICAL_LIMB
from posekit.geometry import Array
from posekit.refinement.figure_numbers import LEG_LIMBS
from posekit.skeleton import HEAD, HIPS, JOINT, JOINTS, LIMB_JOINTS, TORSO
from posekit.tree import Check

MAX_ANGLES: Final = 4
"""The most angles of a limb that are judged."""

TORSO_POINTS: Final = [JOINT[name] for name in TORSO]
HIPS_POINTS: Final = [JOINT[name] for name in HIPS]


@dataclass(frozen=True, kw_only=True, eq=False)
class LimbWalls:
    """What checks of joint ranges say of limbs: `posekit.refinement.walls.Walls`.

    Each limb is put onto the figure standing in its neutral posture, and judged as part of that.

    Parameters
    ----------
    figure : Figure
        The person's, whose neutral posture limbs are put onto.
    checks : mapping
        Those that judge each limb, with the same tolerance; of those that judge an angle again, the last counts.
    balls : mapping
        That of ``pelvis`` and ``neck``, where it judges no angles of the figure.
    tolerance : float
        Theirs, degrees.
    on_torso : bool
        Whether legs are judged in the torso's frame.
    """

    figure: Figure
    checks: Mapping[int, Sequence[Check]]
    balls: Mapping[str, Check]
    tolerance: float
    on_torso: bool

    @staticmethod
    def of(figure: Figure, checks: Sequence[Check], tolerance: float) -> LimbWalls | None:
        """Gather those of some checks that refinement keeps to; None where there are none."""
        pulling = [check for check in checks if check.pulls]
        mine = {
            limb: _last([check for check in pulling if joints[1] in check.points])
            for limb, joints in enumerate(LIMB_JOINTS)
        }
        if not any(mine.values()):
            return None
        balls = {
            check.places[0].joint: check for check in pulling if check.places[0].joint in ("pelvis", "neck")
        }
        on_torso = any(
            JOINT["right_shoulder"] in check.points
            for limb in range(len(LIMB_JOINTS))[LEG_LIMBS]
            for check in mine[limb]
        )
        return LimbWalls(figure=figure, checks=mine, balls=balls, tolerance=tolerance, on_torso=on_torso)

    def beyond(
        self, limb: int, upper: Array, lower: Array, beside: tuple[Array, Array] | None = None
    ) -> tuple[Array, Array]:
        """Say how far limbs are beyond their limits; see `posekit.refinement.walls.Walls`."""
        found = self.looped(limb, upper, lower, beside) if is_installed() else None
        return self.judged(limb, upper, lower) if found is None else found

    def looped(
        self, limb: int, upper: Array, lower: Array, beside: tuple[Array, Array] | None = None
    ) -> tuple[Array, Array] | None:
        """Say it by a compiled loop; None where none knows the checks."""
        numbers = self._numbers[limb]
        if numbers is None:
            return None
        above, below = np.full((2, len(upper), MAX_ANGLES), -np.inf)
        writing = np.full(len(upper), -1)
        run = partial(compiled(posture_kernels).limbs_beyond, ends=self._ends[limb], numbers=numbers)
        if beside is not None and len(upper):
            own = np.full(len(beside[0]), -1)
            run(*map(np.ascontiguousarray, beside), above=above, below=below, writing=own)
            writing = np.tile(own, len(upper) // len(own))
        run(*map(np.ascontiguousarray, (upper, lower)), above=above, below=below, writing=writing)
        rows = np.flatnonzero(writing < 0)
        if rows.size:
            above[rows], below[rows] = (each.T for each in self.judged(limb, upper[rows], lower[rows]))
        return above.T, below.T

    def judged(self, limb: int, upper: Array, lower: Array) -> tuple[Array, Array]:
        """Say it by the checks themselves."""
        start, middle, end = LIMB_JOINTS[limb]
        part = self._torso if limb < LEG_LIMBS.start or self.on_torso else self._hips
        points = np.repeat(self.figure.neutral_points[None, : len(JOINTS)], len(upper), axis=0)
        points[:, middle] = points[:, start] + upper @ part.T
        points[:, end] = points[:, middle] + lower @ part.T
        above, below = np.full((2, MAX_ANGLES, len(upper)), -np.inf)
        rows: dict[str, int] = {}
        for check in self.checks[limb]:
            findings = check.judge(points[:, list(check.points)])
            # A rotation of an almost straight limb has its tolerance over the sine of the bend: its weight is that.
            weight = np.radians(self.tolerance / np.broadcast_to(findings.tolerance, findings.value.shape))
            for k, where in enumerate(check.where):
                row = rows.setdefault(where, len(rows))
                value = findings.value[:, k]
                lower_, upper_ = (
                    np.broadcast_to(limit, findings.value.shape)[:, k]
                    for limit in (findings.lower, findings.upper)
                )
                known = np.isfinite(value)
                above[row, known] = ((value - upper_) * weight[:, k])[known]
                below[row, known] = ((lower_ - value) * weight[:, k])[known]
        return above, below

    def ball(self, part: str, turn: Array) -> tuple[Array, Array] | None:
        """Say how far hips or heads are beyond their limits; see `posekit.refinement.walls.Walls`."""
        check = self.balls.get(part)
        if check is None:
            return None
        points = np.repeat(self.figure.neutral_points[None], len(turn), axis=0)
        joint, ends = (JOINT["pelvis"], HIPS_POINTS[1:]) if part == "pelvis" else (JOINT["neck"], list(HEAD))
        own = points[0, ends] - points[0, joint]
        points[:, ends] = points[:, [joint]] + np.einsum("ij,njk,pk->npi", self._torso, turn, own)
        findings = check.judge(points[:, list(check.points)])
        value = findings.value
        known = np.isfinite(value)
        above, below = (
            np.where(known, np.radians(off), -np.inf).T
            for off in (value - findings.upper, findings.lower - value)
        )
        return above, below

    @cached_property
    def loops(self) -> tuple[Array, Array] | None:
        """What compiled loops take of all limbs; None where one has other checks, or a ball of the trunk has any."""
        if self.balls or any(numbers is None for numbers in self._numbers):
            return None
        known = [numbers for numbers in self._numbers if numbers is not None]
        out = np.zeros((len(known), max(map(len, known))))
        for row, numbers in zip(out, known, strict=True):
            row[: len(numbers)] = numbers
        return self._ends, out

    @cached_property
    def _numbers(self) -> list[Array | None]:
        """What loops take for each limb, where a single check with anatomical ranges judges it whole."""
        rules = [checks[0].rule if len(checks) == 1 else None for checks in self.checks.values()]
        whole = [rule is not None and rule.kind == OF_ANATOMICAL_LIMB for rule in rules]
        return [rule.numbers if rule and one else None for rule, one in zip(rules, whole, strict=True)]

    @cached_property
    def _ends(self) -> Array:
        """The figure's own limits of limbs (4, 4, 2), degrees: of ways to write a limb they choose the first."""
        limits, firsts = self.figure.ik.limits, range(6, 22, 4)
        both = np.degrees(np.stack([limits.lower, limits.upper], axis=-1))
        return np.stack([both[first : first + 4] for first in firsts])

    @cached_property
    def _torso(self) -> Array:
        """The torso's frame of the figure standing."""
        return np.asarray(
            torso_frame(*(self.figure.neutral_points[None, joint] for joint in TORSO_POINTS))[0]
        )

    @cached_property
    def _hips(self) -> Array:
        """That of the hips."""
        joints = self.figure.ik.hips_joints
        return np.asarray(hips_frame(*(self.figure.neutral_points[None, joint] for joint in joints))[0])


def _last(checks: Sequence[Check]) -> Sequence[Check]:
    """Leave out checks all of whose places a later one judges again."""
    return [
        check
        for k, check in enumerate(checks)
        if not any(set(check.where) <= set(later.where) for later in checks[k + 1 :])
    ]
