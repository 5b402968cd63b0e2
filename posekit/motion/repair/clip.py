"""Clips as repair changes them: points of a measured body, or configurations of a robot, with the same operations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final, Self

import numpy as np
import pinocchio as pin
from scipy import sparse
from scipy.sparse.linalg import spsolve

from posekit.geometry import Array, Flags, Ints, align, unit
from posekit.motion.motion import NAMES, Motion
from posekit.motion.repair.pieces import (
    FEET,
    HEAD_PIECE,
    N_PIECES,
    PIECE_OF_NAME,
    PIECE_PARENTS,
    TRUNK,
    between,
    carried,
    near_good,
)
from posekit.skeleton import JOINTS, POINTS
from posekit.validators.body import Body
from posekit.validators.check import Check
from posekit.validators.judge import Validator, chosen_checks
from posekit.validators.report import Report
from posekit.validators.robot import sole_points

#: Motion whose acceleration changes evenly is not changed by smoothing.
THIRD_DIFFERENCE: Final = (-1.0, 3.0, -3.0, 1.0)
#: Weight of a frame that stays, beside that of one that is smoothed.
STAYS: Final = 1e9
#: Times that the way from a posture that passes to one that does not is halved.
HALVINGS: Final = 7
#: Distance inside its limits to which a joint of a robot is brought, radians or metres.
INSIDE_LIMITS: Final = 2e-6


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
        Points (T, P, 3) in the order of `posekit.motion.motion.NAMES`, or a robot's configurations (T, nq).
    time : array (T,)
        Seconds.
    rows : int array (T,)
        Frame of `motion` of each frame; -1 for one that was inserted.
    filled : bool array (T,)
        Frames made from their neighbours.
    mirrored : bool
        Whether right and left were exchanged in all frames.
    done : tuple of str
        Names of the remedies that helped.
    """

    motion: Motion
    validator: Validator
    state: Array
    time: Array
    rows: Ints
    filled: Flags
    mirrored: bool = False
    done: tuple[str, ...] = ()

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

    def following(self, first: Clip) -> Self:
        """Return the changes of a clip and then of this one, which was made of it."""
        return replace(
            self,
            motion=first.motion,
            rows=np.where(self.rows < 0, -1, first.rows[self.own_rows]),
            filled=self.filled | first.filled[self.own_rows],
            mirrored=self.mirrored != first.mirrored,
        )

    @property
    def own_rows(self) -> Ints:
        """Frame of `motion` that each frame (T,) comes from; an inserted frame has that of the frame before it."""
        return self.rows[np.maximum.accumulate(np.where(self.rows < 0, 0, np.arange(len(self))))]

    @property
    def entries(self) -> Sequence[str]:
        """Names of what the state of a frame consists of."""
        return NAMES

    def as_motion(self) -> Motion:
        """Return the clip as a motion with the points of the recording."""
        columns = [NAMES.index(name) for name in self.motion.joint_names]
        return self._motion(joints=self.state[:, columns], q=None, q_names=(), robot="")

    def _motion(self, **fields: Any) -> Motion:
        whole = len(self) == len(self.motion)
        frame = np.asarray(self.motion.frame) if whole else self.motion.in_time * np.arange(len(self))
        return replace(
            self.motion, time=self.time, frame=frame, clip=np.zeros(len(self), dtype=np.intp), **fields
        )

    def checks(self, *, over_time: bool) -> list[Check]:
        """Return the checks over time that are asked for, or those of postures."""
        of_robot = self.validator.robot is not None
        asked = chosen_checks(self.validator.settings, of_robot=of_robot, in_time=self.motion.in_time)
        return [one for one in asked if bool(getattr(one, "over_time", False)) == over_time]

    def report(self, *, over_time: bool) -> Report:
        """Ask the checks over time, or those of postures; there must be some."""
        validator = copy(self.validator)
        validator.settings = self.validator.settings.changed(checks=self.checks(over_time=over_time))
        return validator.check(self.as_motion())

    def points(self) -> Array:
        """Return the points (T, P, 3) in the order of `NAMES`, metres."""
        return self.state

    def taken(self, order: Ints, time: Array) -> Self:
        """Return the clip with its frames in another order, at some times."""
        return replace(
            self, state=self.state[order], rows=self.rows[order], filled=self.filled[order], time=time
        )

    def with_gaps(self, gaps: Ints) -> Self:
        """Insert frames before each frame (T,), evenly in time, and interpolate them."""
        own = np.cumsum(gaps + 1) - 1
        inserted = np.ones(own[-1] + 1, dtype=np.bool_)
        inserted[own] = False
        time = np.interp(np.arange(len(inserted)), own, self.time)
        wide = self.taken(np.repeat(np.arange(len(self)), gaps + 1), time)
        return replace(wide, rows=np.where(inserted, -1, wide.rows)).interpolated(inserted)

    def interpolated(self, bad: Flags) -> Self:
        """Put frames between the good ones around them; a few at an end of the clip continue the motion."""
        bad = bad | ~self.placed()
        rows, before, after, share = between(bad)
        near = near_good(bad)[rows]
        out, filled = self.state.copy(), self.filled.copy()
        out[rows[near]] = self.halfway(self.state[before[near]], self.state[after[near]], share[near])
        filled[rows[near]] = True
        return replace(self, state=out, filled=filled)

    def placed(self) -> Flags:
        """Return the frames (T,) in which enough is known to place a body."""
        return np.asarray(np.isfinite(self.state[:, TRUNK]).all(axis=(1, 2)))

    def carried(self, start: Array, end: Array, share: Array, loose: Flags | None = None) -> Array:
        """Move states (n, …) a share (n,) of the way to others: all, or what is loose (n, K), in its place."""
        return carried(start, end, share, loose)

    def halfway(self, start: Array, end: Array, share: Array) -> Array:
        """Return states (n, …) between others; lengths go from the ones to the others, too."""
        there = self.carried(start, end, share)
        back = self.carried(end, start, 1 - share)
        return there + share[:, None, None] * (back - there)

    def shifted(self, by: Array) -> Self:
        """Move the body by (T, 3), metres."""
        return replace(self, state=self.state + by[:, None])

    def smoothed(self, loose: Flags, strength: float) -> Self:
        """Smooth the points that are loose (T, P); head and feet move with necks and ankles."""
        loose = loose.copy()
        loose[:, len(JOINTS) :] = loose[:, PIECE_PARENTS[len(JOINTS) :]]
        loose &= np.isfinite(self.state).all(axis=(0, 2))
        return replace(self, state=smoothed(self.state, loose, strength))

    def legal(self) -> Self:
        """Return the clip with postures that checks of postures pass.

        A posture that is rejected goes toward a good one as far as it must: the parts of the body that findings name,
        else their limbs, else all. The good posture lies between the nearest ones that pass, or is the nearest of
        these; without any it is at rest.
        """
        if not self.checks(over_time=False):
            return self
        report = self.report(over_time=False)
        bad = np.flatnonzero(report.invalid & self.placed())
        if not bad.size:
            return self
        between_good, nearest_good = self.good(bad, ~report.invalid & self.placed())
        clip = self.bounded(report, bad, between_good)
        ways = [(between_good, loose) for loose in self.loose(report)]
        for goal, loose in [*ways, (nearest_good, ways[-1][1])]:
            left = clip.invalid(bad)
            if not left.any():
                break
            clip = clip.eased(bad[left], goal[left], loose[bad[left]])
        return clip

    def eased(self, rows: Ints, goal: Array, loose: Flags) -> Self:
        """Bring some frames as far toward goals (n, …), by what is loose (n, K), as checks of postures demand.

        Frames that are rejected at their goals stay as they are.
        """
        start = self.state[rows]
        low, high = np.zeros(len(rows)), np.full(len(rows), np.nan)
        share = np.ones(len(rows))
        for _ in range(HALVINGS):
            passes = ~self.with_rows(rows, self.carried(start, goal, share, loose)).invalid(rows)
            low, high = np.where(passes, low, share), np.where(passes, share, high)
            if np.isnan(high).all():
                return self
            share = (low + high) / 2
        return self.with_rows(rows, self.carried(start, goal, np.nan_to_num(high), loose))

    def with_rows(self, rows: Ints, state: Array) -> Self:
        """Return the clip with other states of some frames."""
        out = self.state.copy()
        out[rows] = state
        return replace(self, state=out)

    def invalid(self, rows: Ints) -> Flags:
        """Return which of some frames (n,) checks of postures reject; a person is measured in all frames."""
        report = self.report(over_time=False)
        return report.invalid[rows]

    def good(self, rows: Ints, passing: Flags) -> tuple[Array, Array]:
        """Return good states for some frames: between those that pass, and the nearest; else the body at rest."""
        if not self.motion.in_time or passing.sum() < 2:
            rest = self.laid(np.repeat(self.rest()[None], len(rows), axis=0), rows)
            return rest, rest
        at = np.searchsorted(np.flatnonzero(~passing), rows)
        _, before, after, share = (one[at] for one in between(~passing))
        found = self.halfway(self.state[before], self.state[after], np.clip(share, 0.0, 1.0))
        nearest = self.state[np.where(share < 0.5, before, after)]
        return self.laid(found, rows), self.laid(nearest, rows)

    def rest(self) -> Array:
        """Return the person's posture at rest (P, 3)."""
        body = Body.of(self.as_motion(), self.validator.settings, base=self.validator.figure)
        return np.concatenate([body.figure.neutral_points, np.full((len(FEET), 3), np.nan)])

    def laid(self, state: Array, rows: Ints) -> Array:
        """Lay states (n, …) on the trunks of some frames."""
        found = align(state[:, TRUNK], self.state[rows][:, TRUNK], scale=False)
        turned = np.einsum("nij,npj->npi", found.rotation, state)
        return np.asarray(turned + found.translation[:, None])

    def bounded(self, report: Report, rows: Ints, good: Array) -> Self:
        """Give the frames in which distances are wrong those of good postures; all directions stay."""
        off = rejected(report, "rigid-parts")[rows]
        return self.with_rows(rows[off], self.carried(good[off], self.state[rows[off]], np.ones(off.sum())))

    def loose(self, report: Report) -> Iterator[Flags]:
        """Yield what may move (T, 11) of frames that are rejected: named pieces, their limbs, all pieces."""
        named = np.zeros((len(self), N_PIECES), dtype=np.bool_)
        for row, place in zip(report.findings["row"], report.findings["place"], strict=True):
            named[row, [piece for name, piece in PIECE_OF_NAME.items() if name in report.places[place]]] = (
                True
            )
        yield named
        limbs = named[:, HEAD_PIECE + 1 :].reshape(len(self), -1, 2)
        named[:, HEAD_PIECE + 1 :] = np.repeat(limbs.any(axis=2), 2, axis=1)
        yield named
        yield np.ones_like(named)


def rejected(report: Report, *checks: str, places: Sequence[str] = ()) -> Flags:
    """Return the frames (T,) that checks reject; if places are given, where (T, K), with unknown ones everywhere."""
    found = report.findings
    mine = np.isin(found["check"], [k for k, name in enumerate(report.checks) if name in checks])
    out = np.zeros((len(report), max(len(places), 1)), dtype=np.bool_)
    for row, place in zip(found["row"][mine], found["place"][mine], strict=True):
        name = report.places[place]
        out[row, places.index(name) if name in places else slice(None)] = True
    return out if places else out[:, 0]


def smoothed(values: Array, loose: Flags, strength: float) -> Array:
    r"""Smooth the columns of values (T, K, …) in the frames in which they are loose (T, K).

    Minimises :math:`|y - x|^2 + \lambda |D^3 y|^2` over the loose frames (Whittaker 1923; Eilers 2003, *A perfect
    smoother*, Anal. Chem. 75:3631), with :math:`\lambda` the strength.
    """
    count, out = len(values), values.copy()
    if count < len(THIRD_DIFFERENCE):
        return out
    difference = sparse.diags_array(THIRD_DIFFERENCE, offsets=range(4), shape=(count - 3, count))
    for k in np.flatnonzero(loose.any(axis=0)).tolist():
        weight = sparse.diags_array(np.where(loose[:, k], 1.0, STAYS))
        found = spsolve((weight + strength * difference.T @ difference).tocsc(), weight @ values[:, k])
        out[loose[:, k], k] = found[loose[:, k]]
    return out


@dataclass(frozen=True, kw_only=True, eq=False)
class RobotClip(Clip):
    """One recording of a robot's configurations, and the changes that were made; the fields of `Clip`."""

    @staticmethod
    def state_of(motion: Motion) -> Array:
        """Return the configurations."""
        return np.array(motion.q)

    @cached_property
    def robot(self) -> Any:
        """The robot, or the figure, whose configurations these are."""
        return self.validator.robot or self.validator.figure

    @property
    def entries(self) -> Sequence[str]:
        """Names of the entries of q."""
        return tuple(self.robot.configuration_names)

    def as_motion(self) -> Motion:
        """Return the clip as a motion of configurations."""
        return self._motion(q=self.state, joints=None)

    def points(self) -> Array:
        """Return the points (T, P, 3) in the order of `NAMES`, metres; feet are the ends of the soles."""
        head = np.full((len(self), len(POINTS) - len(JOINTS), 3), np.nan)
        return np.concatenate(
            [self.robot.points(self.state), head, sole_points(self.robot, self.state)], axis=1
        )

    def placed(self) -> Flags:
        """Return the frames (T,) whose configuration is known."""
        return np.asarray(np.isfinite(self.state).all(axis=1))

    def carried(self, start: Array, end: Array, share: Array, loose: Flags | None = None) -> Array:
        """Move configurations along the geodesics to others: all entries of v, or those that are loose (n, nv)."""
        model = self.robot.model
        steps = [pin.difference(model, a, b) for a, b in zip(start, end, strict=True)]
        steps = share[:, None] * np.array(steps).reshape(len(start), model.nv)
        steps = steps if loose is None else steps * loose
        out = [pin.integrate(model, q, step) for q, step in zip(start, steps, strict=True)]
        return np.asarray(self.robot.with_mimics(np.array(out).reshape(start.shape)))

    def halfway(self, start: Array, end: Array, share: Array) -> Array:
        """Return configurations between others."""
        return self.carried(start, end, share)

    def shifted(self, by: Array) -> Self:
        """Move the root by (T, 3), metres; a robot with a fixed root stays."""
        out = self.state.copy()
        if self.robot.free_flyer:
            out[:, :3] += by
        return replace(self, state=out)

    def smoothed(self, loose: Flags, strength: float) -> Self:
        """Smooth the entries of q that are loose (T, nq)."""
        out = self.state.copy()
        if self.robot.free_flyer:  # quaternions of one sign can be smoothed as numbers
            turn = out[:, 3:7]
            turn[1:] *= np.cumprod(np.where((turn[1:] * turn[:-1]).sum(axis=1) < 0, -1.0, 1.0))[:, None]
        out = smoothed(out, loose, strength)
        if self.robot.free_flyer:
            out[:, 3:7] = unit(out[:, 3:7])
        return replace(self, state=np.where(loose.any(axis=1, keepdims=True), out, self.state))

    def invalid(self, rows: Ints) -> Flags:
        """Return which of some frames (n,) checks of postures reject: each is judged by itself."""
        return super(RobotClip, self.taken(rows, self.time[rows])).invalid(np.arange(len(rows)))

    def rest(self) -> Array:
        """Return the neutral configuration (nq,)."""
        return np.asarray(self.robot.neutral)

    def laid(self, state: Array, rows: Ints) -> Array:
        """Return states as they are: the root of a configuration is not moved."""
        return state

    def bounded(self, report: Report, rows: Ints, good: Array) -> Self:
        """Bring joints within the limits of the URDF, and mimicking joints to their targets."""
        lower, upper = self.robot.lower + INSIDE_LIMITS, self.robot.upper - INSIDE_LIMITS
        return self.with_rows(rows, self.robot.with_mimics(np.clip(self.state[rows], lower, upper)))

    def loose(self, report: Report) -> Iterator[Flags]:
        """Yield what may move (T, nv) of frames that are rejected: joints between bodies that touch, then all."""
        model, named = self.robot.model, np.zeros((len(self), self.robot.model.nv), dtype=np.bool_)
        between_bodies = self._joints_between()
        for row, place in zip(report.findings["row"], report.findings["place"], strict=True):
            for joint in between_bodies.get(report.places[place], ()):
                named[row, model.idx_vs[joint] : model.idx_vs[joint] + model.nvs[joint]] = True
        yield named
        every = np.ones_like(named)
        every[:, : 6 if self.robot.free_flyer else 0] = False
        yield every

    def _joints_between(self) -> dict[str, set[int]]:
        """Return the joints on the way from one body of each pair to the other, by the pair's place in findings."""
        found: dict[str, set[int]] = {}
        bodies = () if self.robot.geometry is None else self.robot.geometry.geometryObjects
        on_the_way = {body.name: set(self.robot.model.supports[body.parentJoint]) for body in bodies}
        links = dict(zip(self.robot.body_names, self.robot.body_links, strict=True))
        for one, other in self.robot.collision_pairs:
            found[f"{links[one]}-{links[other]}"] = on_the_way[one] ^ on_the_way[other]
        return found
