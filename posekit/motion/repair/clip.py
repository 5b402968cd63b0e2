"""Recordings during a repair: `Clip` holds points of a person, `RobotClip` configurations of a robot."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final, Self

import numpy as np
import pinocchio as pin

from posekit.body.pieces import (
    FEET,
    HEAD_PIECE,
    HINGES,
    HIPS_PIECE,
    LIMB_PIECES,
    N_PIECES,
    PIECE_OF_POINT,
    PIECE_PARENTS,
    TORSO_PIECE,
    TRUNK,
    carried,
    moved,
    placed,
    turned,
    vectors_of,
)
from posekit.geometry import Array, Flags, Ints, align, into_bounds, smoothed, unit
from posekit.motion.motion import Motion
from posekit.skeleton import JOINTS, NAMES, POINTS
from posekit.validators.body import MADE_UP_METRES, Body
from posekit.validators.check import Check, NotAskedError, judged
from posekit.validators.judge import Validator, chosen_checks
from posekit.validators.report import Report
from posekit.validators.robot import sole_points

#: Number of bisection steps between a posture that passes the checks and a posture that fails.
HALVINGS: Final = 7
#: Largest number of bad frames at the start or end of a clip, such as a T-pose, that are extrapolated.
MOST_CONTINUED: Final = 3
#: Length that one degree counts as, metres: about the displacement of a wrist or an ankle.
METRES_A_DEGREE: Final = 0.3 * np.pi / 180
#: Distance inside its bounds to which a posture is moved, metres, because changes below 5e-6 m are not written.
INSIDE_METRES: Final = 2e-5
#: Distance inside its limits to which a robot's joint is moved, metres or radians, because files round numbers.
INSIDE_LIMITS: Final = 5e-6
#: Additional distance by which bodies of robots are separated, metres; penetration depths of meshes are exact to 1e-5.
DEPTH_METRES: Final = 5e-5


@dataclass(frozen=True, kw_only=True, eq=False)
class Clip:
    """One recording of points during a repair, with its changed frames and the remedies applied so far.

    Parameters
    ----------
    motion : Motion
        The recording before the repair.
    validator : Validator
        Checks and settings that the repair must satisfy.
    state : array (T, …)
        Points (T, P, 3) in the order of `posekit.skeleton.NAMES`, metres, or a robot's configurations (T, nq).
    time : array (T,)
        Time of each frame, seconds.
    rows : int array (T,)
        Index in `motion` of each frame; -1 for an inserted frame.
    filled : bool array (T,)
        Whether each frame was interpolated from its neighbours.
    mirrored : bool
        Whether right and left were exchanged in all frames.
    done : tuple of str
        Names of the remedies that reduced the number of findings.
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
        """Return an unchanged recording as a clip."""
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
        """Return the points (T, P, 3) of a recording in the order of `NAMES`, metres."""
        return motion.points(NAMES)

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.state)

    def following(self, first: Clip) -> Self:
        """Return this clip, which was made from the result of `first`, as a clip of the recording of `first`."""
        return replace(
            self,
            motion=first.motion,
            rows=np.where(self.rows < 0, -1, first.rows[self.own_rows]),
            filled=self.filled | first.filled[self.own_rows],
            mirrored=self.mirrored != first.mirrored,
        )

    @property
    def own_rows(self) -> Ints:
        """Index in `motion` of each frame (T,); an inserted frame has the index of the previous frame."""
        return self.rows[np.maximum.accumulate(np.where(self.rows < 0, 0, np.arange(len(self))))]

    @property
    def entries(self) -> Sequence[str]:
        """Names of the columns of `state`: points, or entries of q."""
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
        """Return the selected checks of motion if `over_time` is true, otherwise the selected checks of postures."""
        of_robot = self.validator.figure is None
        asked = chosen_checks(self.validator.settings, of_robot=of_robot, in_time=self.motion.in_time)
        return [one for one in asked if bool(getattr(one, "over_time", False)) == over_time]

    def report(self, *, over_time: bool) -> Report:
        """Return the report of `checks`, of which at least one must be selected."""
        validator = copy(self.validator)
        validator.settings = self.validator.settings.changed(checks=self.checks(over_time=over_time))
        return validator.check(self.as_motion())

    def points(self) -> Array:
        """Return the points (T, P, 3) in the order of `NAMES`, metres."""
        return self.state

    def taken(self, order: Ints, time: Array) -> Self:
        """Return the clip with its frames in the given order, at the times `time` (T,), seconds."""
        return replace(
            self, state=self.state[order], rows=self.rows[order], filled=self.filled[order], time=time
        )

    def with_gaps(self, gaps: Ints) -> Self:
        """Insert `gaps` (T,) frames before each frame, evenly in time, and interpolate them."""
        own = np.cumsum(gaps + 1) - 1
        inserted = np.ones(own[-1] + 1, dtype=np.bool_)
        inserted[own] = False
        time = np.interp(np.arange(len(inserted)), own, self.time)
        wide = self.taken(np.repeat(np.arange(len(self)), gaps + 1), time)
        return replace(wide, rows=np.where(inserted, -1, wide.rows)).interpolated(inserted)

    def interpolated(self, bad: Flags) -> Self:
        """Interpolate bad frames (T,) between good frames; extrapolate up to three bad frames at the start or end."""
        bad = bad | ~self.placed()
        rows, before, after, share = between(bad)
        near = near_good(bad)[rows]
        out, filled = self.state.copy(), self.filled.copy()
        out[rows[near]] = self.halfway(self.state[before[near]], self.state[after[near]], share[near])
        filled[rows[near]] = True
        return replace(self, state=out, filled=filled)

    def placed(self) -> Flags:
        """Return whether the trunk joints are known in each frame (T,); without them the body has no position."""
        return np.asarray(np.isfinite(self.state[:, TRUNK]).all(axis=(1, 2)))

    def carried(self, start: Array, end: Array, share: Array) -> Array:
        """Interpolate segment directions from `start` to `end` (n, P, 3) by fractions (n,) with lengths of `start`."""
        return carried(start, end, share)

    def halfway(self, start: Array, end: Array, share: Array) -> Array:
        """Interpolate states from `start` to `end` (n, …) by fractions (n,), including the segment lengths."""
        there = self.carried(start, end, share)
        back = self.carried(end, start, 1 - share)
        return there + share[:, None, None] * (back - there)

    def shifted(self, by: Array) -> Self:
        """Return the clip with the body moved by the vector `by` (T, 3) in each frame, metres."""
        return replace(self, state=self.state + by[:, None])

    def smoothed(self, loose: Flags, strength: float) -> Self:
        """Smooth each point in the frames of the mask `loose` (T, P), and move head and feet with neck and ankles."""
        loose = loose.copy()
        loose[:, len(JOINTS) :] = loose[:, PIECE_PARENTS[len(JOINTS) :]]
        loose &= np.isfinite(self.state).all(axis=(0, 2))
        return replace(self, state=smoothed(self.state, loose, strength))

    def legal(self) -> Self:
        """Return the clip with rejected postures replaced by postures that pass the checks of postures.

        Three postures are tried in turn as a goal: the rejected posture moved inside its bounds, a posture interpolated
        between the nearest valid frames, and the posture of the nearest valid frame. The rejected posture is
        interpolated toward the first goal that passes, only as far as necessary.
        """
        if not self.checks(over_time=False):
            return self
        report = self.report(over_time=False)
        bad = np.flatnonzero(report.invalid & self.placed())
        if not bad.size:
            return self
        clip = self
        for goal in (self.pushed(bad, report), *self.good(bad, ~report.invalid & self.placed())):
            left = clip.invalid(bad)
            clip = clip.eased(bad[left], goal[left]) if left.any() else clip
        return clip if self.motion.in_time else clip.restored(bad, self.state[bad])

    def pushed(self, rows: Ints, report: Report) -> Array:
        """Move the postures of some frames (n,) inside the bounds of the checks.

        First, elbows and knees that bend backward are straightened. Then joints are moved until the lengths of rigid
        segments are inside their bounds. Then limbs are rotated, and finally all parts of the body, until all other
        checks pass.
        """
        vectors, found = vectors_of(self.state), report.findings
        for row, place, value in zip(found["row"], found["place"], found["value"], strict=True):
            if value < 0 and report.places[place] in HINGES:
                middle, end = HINGES[report.places[place]]
                vectors[row, end] = np.linalg.norm(vectors[row, end]) * unit(vectors[row, middle])
        body = Body.of(self.as_motion(), self.validator.settings, base=self.validator.figure)
        every, limbs = range(3 * N_PIECES), range(3 * HEAD_PIECE, 3 * N_PIECES)
        state, joints = placed(vectors)[rows], range(3 * len(JOINTS))
        state = into_bounds(state, moved, len(joints), joints, partial(self.margins, body, rigid=True))
        for free in (limbs, every):
            state = into_bounds(state, turned, 3 * N_PIECES, free, partial(self.margins, body, rigid=False))
        return state

    def margins(self, body: Body, points: Array, *, rigid: bool) -> Array:
        """Return margins (n, K) of postures (n, P, 3), metres: of rigid lengths if `rigid`, else of all other checks.

        A margin is infinite if its check is undecided.
        """
        joints, head, feet = np.split(points, [len(JOINTS), len(POINTS)], axis=1)
        these = replace(body, joints=joints, head=head, feet=feet, motion=False)
        vars(these)["person"] = body.person  # measured in the whole clip, not in these postures
        found = [np.full((len(points), 1), np.inf)]
        for check in self.checks(over_time=False):
            if (check.name == "rigid-parts") == rigid:
                scale = METRES_A_DEGREE if check.unit == "deg" else 1.0
                with suppress(NotAskedError):
                    found.append(scale * judged(check, these).margin - INSIDE_METRES)
        every = np.concatenate(found, axis=1)
        return np.where(np.isnan(every), np.inf, every)

    def eased(self, rows: Ints, goal: Array) -> Self:
        """Move some frames (n,) toward goal states (n, …) until they pass; skip frames whose goal is rejected."""
        start = self.state[rows]
        low, high = np.zeros(len(rows)), np.full(len(rows), np.nan)
        share = np.ones(len(rows))
        for _ in range(HALVINGS):
            passes = ~self.with_rows(rows, self.halfway(start, goal, share)).invalid(rows)
            low, high = np.where(passes, low, share), np.where(passes, share, high)
            if np.isnan(high).all():
                return self
            share = (low + high) / 2
        passing = np.isfinite(high)
        return self.with_rows(rows[passing], self.halfway(start, goal, high)[passing])

    def restored(self, rows: Ints, given: Array) -> Self:
        """Restore the directions of trunk, head and limbs in `given` (n, P, 3) if all checks still pass."""
        clip = self
        for pieces in ({TORSO_PIECE, HIPS_PIECE}, {HEAD_PIECE}, *LIMB_PIECES):
            own = [k for k, piece in enumerate(PIECE_OF_POINT) if piece in pieces]
            vectors = vectors_of(clip.state[rows])
            vectors[:, own] = vectors_of(given)[:, own]
            passing = ~clip.with_rows(rows, placed(vectors)).invalid(rows)
            clip = clip.with_rows(rows[passing], placed(vectors)[passing])
        return clip

    def with_rows(self, rows: Ints, state: Array) -> Self:
        """Return the clip with new states (n, …) of some frames (n,)."""
        out = self.state.copy()
        out[rows] = state
        return replace(self, state=out)

    def invalid(self, rows: Ints) -> Flags:
        """Return whether checks of postures reject each frame of `rows` (n,); lengths are measured in all frames."""
        return self.report(over_time=False).invalid[rows]

    def good(self, rows: Ints, passing: Flags) -> tuple[Array, Array]:
        """Return two valid states for each of some frames (n,): between valid frames, and from the nearest valid frame.

        If fewer than two frames are valid, both states are the neutral posture.
        """
        if not self.motion.in_time or passing.sum() < 2:
            rest = self.laid(np.repeat(self.rest()[None], len(rows), axis=0), rows)
            return rest, rest
        at = np.searchsorted(np.flatnonzero(~passing), rows)
        _, before, after, share = (one[at] for one in between(~passing))
        found = self.halfway(self.state[before], self.state[after], np.clip(share, 0.0, 1.0))
        nearest = self.state[np.where(share < 0.5, before, after)]
        return self.laid(found, rows), self.laid(nearest, rows)

    def rest(self) -> Array:
        """Return the person's neutral posture (P, 3), metres."""
        body = Body.of(self.as_motion(), self.validator.settings, base=self.validator.figure)
        return np.concatenate([body.figure.neutral_points, np.full((len(FEET), 3), np.nan)])

    def laid(self, state: Array, rows: Ints) -> Array:
        """Return states (n, …), moved rigidly so that their trunks coincide with the trunks of some frames (n,)."""
        found = align(state[:, TRUNK], self.state[rows][:, TRUNK], scale=False)
        turned = np.einsum("nij,npj->npi", found.rotation, state)
        return np.asarray(turned + found.translation[:, None])


def rejected(report: Report, *checks: str, places: Sequence[str] = ()) -> Flags:
    """Return whether checks reject each frame (T,), or each frame at each of K places (T, K) if places are given.

    A finding at a place that is not among `places` counts at every place.
    """
    found = report.findings
    mine = np.isin(found["check"], [k for k, name in enumerate(report.checks) if name in checks])
    out = np.zeros((len(report), max(len(places), 1)), dtype=np.bool_)
    for row, place in zip(found["row"][mine], found["place"][mine], strict=True):
        name = report.places[place]
        out[row, places.index(name) if name in places else slice(None)] = True
    return out if places else out[:, 0]


def between(bad: Flags) -> tuple[Ints, Ints, Ints, Array]:
    """Return the n bad frames, the good frames around each, and the position (n,) of each between them, 0 to 1.

    At the start or end of the clip the two nearest good frames are used, with positions below 0 or above 1. With fewer
    than two good frames the result is empty.
    """
    good, rows = np.flatnonzero(~bad), np.flatnonzero(bad)
    if len(good) < 2:
        return rows[:0], rows[:0], rows[:0], np.empty(0)
    place = np.clip(np.searchsorted(good, rows), 1, len(good) - 1)
    before, after = good[place - 1], good[place]
    return rows, before, after, (rows - before) / (after - before)


def near_good(bad: Flags) -> Flags:
    """Return which bad frames (T,) can be interpolated; at the start and the end of the clip, at most three frames."""
    good = np.flatnonzero(~bad)
    found = bad.copy()
    if len(good) and good[0] > MOST_CONTINUED:
        found[: good[0]] = False
    if len(good) and len(bad) - 1 - good[-1] > MOST_CONTINUED:
        found[good[-1] :] = False
    return found


@dataclass(frozen=True, kw_only=True, eq=False)
class RobotClip(Clip):
    """One recording of a robot's configurations; the fields are those of `Clip`."""

    @staticmethod
    def state_of(motion: Motion) -> Array:
        """Return the configurations (T, nq) of a recording."""
        return np.array(motion.q)

    @property
    def entries(self) -> Sequence[str]:
        """Names of the entries of q."""
        return tuple(self.validator.robot.configuration_names)

    def as_motion(self) -> Motion:
        """Return the clip as a motion of configurations."""
        return self._motion(q=self.state, joints=None)

    def points(self) -> Array:
        """Return the points (T, P, 3) in the order of `NAMES`, metres; toes and heels lie on the soles."""
        head = np.full((len(self), len(POINTS) - len(JOINTS), 3), np.nan)
        robot = self.validator.robot
        return np.concatenate([robot.points(self.state), head, sole_points(robot, self.state)], axis=1)

    def placed(self) -> Flags:
        """Return whether the configuration of each frame (T,) is known."""
        return np.asarray(np.isfinite(self.state).all(axis=1))

    def carried(self, start: Array, end: Array, share: Array) -> Array:
        """Interpolate configurations from `start` to `end` (n, nq) along geodesics by fractions (n,)."""
        model = self.validator.robot.model
        steps = [pin.difference(model, a, b) for a, b in zip(start, end, strict=True)]
        steps = share[:, None] * np.array(steps).reshape(len(start), model.nv)
        out = [pin.integrate(model, q, step) for q, step in zip(start, steps, strict=True)]
        return np.asarray(self.validator.robot.with_mimics(np.array(out).reshape(start.shape)))

    def halfway(self, start: Array, end: Array, share: Array) -> Array:
        """Interpolate configurations from `start` to `end` (n, nq) by fractions (n,)."""
        return self.carried(start, end, share)

    def restored(self, rows: Ints, given: Array) -> Self:
        """Return the clip unchanged, because `pushed` moves only joints that checks reject."""
        return self

    def shifted(self, by: Array) -> Self:
        """Return the clip with the root moved by the vector `by` (T, 3), metres; a fixed root does not move."""
        out = self.state.copy()
        if self.validator.robot.free_flyer:
            out[:, :3] += by
        return replace(self, state=out)

    def smoothed(self, loose: Flags, strength: float) -> Self:
        """Smooth each entry of q in the frames that the mask `loose` (T, nq) selects."""
        out = self.state.copy()
        # Quaternions whose signs agree can be smoothed component by component.
        if self.validator.robot.free_flyer:
            turn = out[:, 3:7]
            turn[1:] *= np.cumprod(np.where((turn[1:] * turn[:-1]).sum(axis=1) < 0, -1.0, 1.0))[:, None]
        out = smoothed(out, loose, strength)
        if self.validator.robot.free_flyer:
            out[:, 3:7] = unit(out[:, 3:7])
        return replace(self, state=np.where(loose.any(axis=1, keepdims=True), out, self.state))

    def invalid(self, rows: Ints) -> Flags:
        """Return whether checks of postures reject each frame of `rows` (n,); no other frames are judged."""
        return super(RobotClip, self.taken(rows, self.time[rows])).invalid(np.arange(len(rows)))

    def rest(self) -> Array:
        """Return the neutral configuration (nq,)."""
        return np.asarray(self.validator.robot.neutral)

    def laid(self, state: Array, rows: Ints) -> Array:
        """Return configurations (n, nq) with the root replaced by the root of some frames (n,)."""
        root = 7 if self.validator.robot.free_flyer else 0
        return np.concatenate([self.state[rows, :root], state[:, root:]], axis=1)

    def pushed(self, rows: Ints, report: Report) -> Array:
        """Move joints inside the limits of the URDF, and separate bodies that penetrate each other.

        The root does not change. Joints that never move in the recording do not change either, because the file may
        have no column for them.
        """
        robot, model = self.validator.robot, self.validator.robot.model
        lower, upper = robot.lower + INSIDE_LIMITS, robot.upper - INSIDE_LIMITS
        settings = self.validator.settings
        made_up = MADE_UP_METRES if robot.bodies == "capsules" and not settings.strict else 0.0
        margin = settings.contact_margin - made_up

        def moved(state: Array, step: Array) -> Array:
            out = [pin.integrate(model, q, one) for q, one in zip(state, step, strict=True)]
            return np.asarray(robot.with_mimics(np.clip(np.array(out).reshape(state.shape), lower, upper)))

        def margins(state: Array) -> Array:
            out = np.full((len(state), max(len(robot.collision_pairs), 1)), np.inf)
            found = robot.collisions(state, margin=max(margin, 0.0))
            out[found.frame, found.pair] = found.distance - margin - DEPTH_METRES - INSIDE_METRES
            return out

        moving = np.ptp(self.state[self.placed()], axis=0) > 0 if self.motion.in_time else np.ones(model.nq)
        used = [
            joint
            for joint in range(2 if robot.free_flyer else 1, model.njoints)
            if moving[model.idx_qs[joint] : model.idx_qs[joint] + model.nqs[joint]].any()
        ]
        free = [model.idx_vs[joint] + k for joint in used for k in range(model.nvs[joint])]
        state = moved(self.state[rows], np.zeros((len(rows), model.nv)))
        return into_bounds(state, moved, model.nv, free, margins)
