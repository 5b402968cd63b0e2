"""Clips as repair changes them: points of a measured body, or configurations of a robot, with the same operations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final, Self

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import spsolve

from posekit.geometry import Array, unit
from posekit.motion.motion import NAMES, Motion
from posekit.motion.repair.legal import (
    TIED_SWEEPS,
    Configurations,
    PostureBounds,
    nearest_valid,
    straightened,
    tied,
)
from posekit.motion.repair.pieces import between, interpolated
from posekit.skeleton import JOINTS, POINTS
from posekit.validators.body import Body
from posekit.validators.check import Check, Judgement, NotAskedError, judged
from posekit.validators.judge import Validator, chosen_checks
from posekit.validators.robot import sole_points

Bools = NDArray[np.bool_]

#: Motion whose acceleration changes evenly is not changed by smoothing.
THIRD_DIFFERENCE: Final = (-1.0, 3.0, -3.0, 1.0)
#: Weight of a frame that stays, beside that of one that is smoothed.
STAYS: Final = 1e9
#: Times that postures are sought again: the person's lengths may be those of the repaired postures.
ROUNDS: Final = 3


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

    def points(self) -> Array:
        """Return the points (T, P, 3) in the order of `NAMES`, metres."""
        return self.state

    def taken(self, order: NDArray[np.intp], time: Array) -> Self:
        """Return the clip with its frames in another order, at some times."""
        return replace(
            self, state=self.state[order], rows=self.rows[order], filled=self.filled[order], time=time
        )

    def with_gaps(self, gaps: NDArray[np.intp]) -> Self:
        """Insert frames before each frame (T,), evenly in time, and interpolate them."""
        own = np.cumsum(gaps + 1) - 1
        inserted = np.ones(own[-1] + 1, dtype=np.bool_)
        inserted[own] = False
        wide = self.taken(
            np.repeat(np.arange(len(self)), gaps + 1), np.interp(np.arange(len(inserted)), own, self.time)
        )
        return replace(wide, rows=np.where(inserted, -1, wide.rows)).interpolated(inserted)

    def interpolated(self, bad: Bools) -> Self:
        """Put frames between the good ones around them; a few at an end of the clip continue the motion."""
        return replace(self, state=interpolated(self.state, bad), filled=self._filled(bad))

    def _filled(self, bad: Bools) -> Bools:
        filled = self.filled.copy()
        filled[between(bad)[0]] = True
        return filled

    def shifted(self, by: Array) -> Self:
        """Move the body by (T, 3), metres."""
        return replace(self, state=self.state + by[:, None])

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
        return replace(self, state=out)

    def legal(self) -> Self:
        """Return the clip with the nearest postures that the checks of postures pass, tied over time."""
        given, out = self.state, self.state.copy()
        for _ in range(ROUNDS):
            now = replace(self, state=out)
            found = now.judged(over_time=False)
            bad = np.flatnonzero(rejected(one for _, one in found.values()))
            if not bad.size:
                break
            bounds = PostureBounds([check for check, _ in found.values()], now.body())
            changed = np.flatnonzero((np.nan_to_num(out - given) != 0).any(axis=(1, 2)))
            ranges = found.get("joint-range")
            out = tied(
                partial(nearest_valid, bounds),
                given if ranges is None else straightened(given, ranges[1]),
                np.union1d(bad, changed),
                TIED_SWEEPS if self.motion.in_time else 0,
            )
        return replace(self, state=out)


def rejected(judgements: Any) -> Bools:
    """Return the frames that some judgement rejects (T,)."""
    return np.asarray(np.logical_or.reduce([one.violated.any(axis=1) for one in judgements]))


def smoothed(values: Array, loose: Bools, strength: float) -> Array:
    r"""Smooth columns (T, K) where they may move.

    Minimises :math:`|y - x|^2 + \lambda |D^3 y|^2` over the loose frames (Whittaker 1923; Eilers 2003, *A perfect
    smoother*, Anal. Chem. 75:3631), with :math:`\lambda` the strength.
    """
    count = len(values)
    if count < len(THIRD_DIFFERENCE):
        return values
    difference = sparse.diags_array(THIRD_DIFFERENCE, offsets=range(4), shape=(count - 3, count))
    weight = sparse.diags_array(np.where(loose, 1.0, STAYS))
    found = spsolve((weight + strength * difference.T @ difference).tocsc(), weight @ values)
    return np.where(loose[:, None], found.reshape(values.shape), values)


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
        out = self.state.copy()
        for row, before, after, share in zip(*between(bad), strict=True):
            out[row] = pin.interpolate(self.robot.model, out[before], out[after], share[0])
        return replace(self, state=out, filled=self._filled(bad))

    def shifted(self, by: Array) -> Self:
        """Move the root by (T, 3), metres; a robot with a fixed root stays."""
        out = self.state.copy()
        if self.robot.free_flyer:
            out[:, :3] += by
        return replace(self, state=out)

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
        return replace(self, state=np.where(rows[:, None], out, self.state))

    def legal(self) -> Self:
        """Return the clip with the nearest configurations inside their limits whose bodies keep apart."""
        found = self.judged(over_time=False)
        bad = np.flatnonzero(rejected(one for _, one in found.values()))
        if not bad.size:
            return self
        problem = Configurations(self.robot, found, self.validator.settings.contact_margin)
        sweeps = TIED_SWEEPS if self.motion.in_time else 0
        return replace(self, state=tied(problem.nearest, self.state, bad, sweeps))
