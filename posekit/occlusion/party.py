"""Survivors with one pattern of hidden joints, completed together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from posekit.cameras import Array
from posekit.figure import Figure
from posekit.occlusion.asking import Index, Mask, Rows, ask
from posekit.occlusion.completion import Completion, Kind, Outcome
from posekit.occlusion.groups import box, distinct, largest, mean, pairs
from posekit.occlusion.hosts import Hosts
from posekit.occlusion.kinds import kinds
from posekit.occlusion.limb import LimbPlacer
from posekit.occlusion.narrow import narrowed, thinned
from posekit.occlusion.placed import Placed
from posekit.occlusion.plan import HIP_JOINTS, TORSO_JOINTS, Limb, Plan, State
from posekit.occlusion.rays import Rays
from posekit.occlusion.refine import GOALS, reaches, seek_ends
from posekit.occlusion.settings import Sampling
from posekit.occlusion.together import choose
from posekit.occlusion.trunk import TrunkPlacer
from posekit.skeleton import PARENTS, segment_name

HOSTS_TRIED = 8
"""Places of the trunk on which limbs are sought that pass together, the middle one first."""

SAME = 1e-6
"""Metres between two ends that count as one."""

ATTAINED, ATTAINED_IN_FOUR, ATTAINED_IN_CROWD = 0.125, 0.02, 0.1
"""Of a step on the lattice: how near the ends of a box are found, with two angles free, with four, and on many hosts.

Measured against rejection sampling: see the documentation.
"""


@dataclass(frozen=True, kw_only=True, eq=False)
class Way:
    """The feasible placements of one limb: each survivor's, among those of its core.

    Parameters
    ----------
    placer : LimbPlacer
    survivor : int array (S,)
        In order.
    rows : Placed
    reach : array (2, C, 7)
        How far the sets of the cores reach, known limbs apart.
    """

    placer: LimbPlacer
    survivor: Index
    rows: Placed
    reach: Array

    @property
    def limb(self) -> Limb:
        """The limb."""
        return self.placer.limb

    def keep(self, alive: Mask) -> Way:
        """Keep some placements."""
        return replace(self, survivor=self.survivor[alive], rows=self.rows.take(alive))

    def position(self, joint: int) -> Array:
        """Return where a joint of the limb is in each placement (S, 3)."""
        return self.rows.middle if joint == self.limb.middle else self.rows.end


@dataclass(frozen=True, kw_only=True, eq=False)
class Party:
    """N survivors with one plan, and the places of their trunks.

    Parameters
    ----------
    plan : Plan
    figure : Figure
    rays : Rays
    sampling : Sampling
    points : array (N, P, 3)
        NaN where unknown.
    frame : int array (N,)
    core : int array (N,)
        Survivors that agree in the plan's core joints share one.
    core_frame : int array (C,)
    hosts : Hosts
        Of the cores.
    placers : sequence of LimbPlacer
        One for each open limb, on all hosts.
    """

    plan: Plan
    figure: Figure
    rays: Rays
    sampling: Sampling
    points: Array
    frame: Index
    core: Index
    core_frame: Index
    hosts: Hosts
    placers: Sequence[LimbPlacer]

    @staticmethod
    def of(
        *,
        plan: Plan,
        figure: Figure,
        rays: Rays,
        tolerance: float,
        sampling: Sampling,
        points: Array,
        frame: Index,
    ) -> Party:
        """Find the cores of survivors and place their trunks."""
        key = np.concatenate([frame[:, None], points[:, list(plan.core)].reshape(len(points), -1)], axis=1)
        _, first, core = np.unique(key, axis=0, return_index=True, return_inverse=True)
        core_frame = frame[first]

        def placer(limb: Limb, hosts: Hosts) -> LimbPlacer:
            return LimbPlacer(
                plan=plan,
                limb=limb,
                hosts=hosts,
                frame=core_frame[hosts.core],
                rays=rays,
                lengths=(_length(figure, limb.middle), _length(figure, limb.end)),
                tolerance=tolerance,
                sampling=sampling,
            )

        trunk = TrunkPlacer(
            plan=plan, figure=figure, rays=rays, frame=core_frame, tolerance=tolerance, sampling=sampling
        )
        hosts = narrowed(plan, trunk.place(points[first]), placer)
        if any(plan.hidden(limb) for limb in plan.limbs):
            hosts = thinned(hosts, sampling.hosts)
        return Party(
            plan=plan,
            figure=figure,
            rays=rays,
            sampling=sampling,
            points=points,
            frame=frame,
            core=core.reshape(-1),
            core_frame=core_frame,
            hosts=hosts,
            placers=[placer(limb, hosts) for limb in plan.limbs],
        )

    def __len__(self) -> int:
        """Count the survivors."""
        return len(self.points)

    @cached_property
    def kinds(self) -> dict[int, Kind]:
        """The kind of each unknown joint's set."""
        return kinds(self.plan)

    @cached_property
    def ways(self) -> list[Way]:
        """The feasible placements of each open limb by itself, before hosts are compared."""
        return [self._way(placer) for placer in self.placers]

    @cached_property
    def allowed(self) -> Mask:
        """Which hosts (N, H) each survivor can have.

        Where a limb has a few positions by lifts and none of them passes, its host is impossible. That no sample
        of a hidden limb passes proves nothing: such a host remains, and is only not chosen.
        """
        n, h = len(self), len(self.hosts)
        allowed = self.core[:, None] == self.hosts.core[None, :]
        checks = self.plan.trunk_cross
        if checks:
            who, host = np.nonzero(allowed)
            passed, _ = ask(checks, self._columns(who, host))
            allowed[who[~passed], host[~passed]] = False
        for way in self.ways:
            if not self.plan.hidden(way.limb):
                some = np.zeros((n, h), dtype=bool)
                some[way.survivor, way.rows.host] = True
                allowed &= some
        return np.asarray(allowed)

    @cached_property
    def sets(self) -> list[Way]:
        """The feasible placements of each open limb, on allowed hosts."""
        return [way.keep(self.allowed[way.survivor, way.rows.host]) for way in self.ways]

    def write(self, done: Completion, part: Index) -> None:
        """Complete the survivors and write them into rows `part` of a completion."""
        postures, found = self._representatives()
        done.outcome[part] = np.where(found, Outcome.COMPLETED, Outcome.UNDECIDED)
        self._blame(done, part, found)
        for joint in self.plan.unknown:
            done.kind[part, joint] = self.kinds[joint]
            done.postures[part, joint] = np.where(found[:, None], postures[:, joint], np.nan)
        middle = np.where(found[:, None, None], postures, np.nan)
        for joint in self.plan.trunk:
            self._describe_trunk(done, part, joint, middle[:, joint])
        for way in self.sets:
            ends = self._ends(way, middle)
            for joint in self.plan.free(way.limb):
                self._describe_limb(done, part, way, joint, ends[int(joint == way.limb.end)])
        lone = (done.kind[part] == Kind.DEPTH_INTERVAL) & (done.lower[part] == done.upper[part]).all(axis=-1)
        done.kind[part] = np.where(lone, Kind.POINT, done.kind[part])
        done.fraction[part] = np.where(lone, 1.0, done.fraction[part])

    def _way(self, placer: LimbPlacer) -> Way:
        placed = placer.place()
        cores = len(self.core_frame)
        reach = np.full((2, cores, GOALS), -np.inf)
        if self.plan.hidden(placer.limb):
            # Most of the ends of a survivor's sets are those of its core's: they are sought once.
            wanted = np.zeros(reach.shape, dtype=bool)
            wanted[[joint in self.plan.free(placer.limb) for joint in placer.limb.free], :, : GOALS - 1] = (
                True
            )
            ends = seek_ends(
                placer,
                self.hosts.core[placed.host],
                placed,
                np.full((2, cores, 3), np.nan),
                lambda _, rows: self._passes_own(placer, rows),
                wanted,
            )
            reach, placed = ends.reach, placed.and_(ends.rows)
        survivor, row = pairs(self.hosts.core[placed.host], self.core, len(self))
        way = Way(placer=placer, survivor=survivor, rows=placed.take(row), reach=reach)
        checks = self.plan.limb_cross[placer.limb]
        if not checks:
            return way
        passed, _ = ask(checks, self._limb_columns(placer, survivor, way.rows))
        return way.keep(passed)

    def _columns(self, survivor: Index, host: Index) -> Rows:
        """Return postures of survivors on hosts."""
        trunk = {joint: (self.hosts.points[:, joint], host) for joint in self.plan.trunk}
        return Rows.of(self.points, survivor).with_(trunk)

    def _limb_columns(self, placer: LimbPlacer, survivor: Index, rows: Placed) -> Rows:
        own: dict[int, tuple[Array, Index | None]] = {
            placer.limb.middle: (rows.middle, None),
            placer.limb.end: (rows.end, None),
        }
        return self._columns(survivor, rows.host).with_(own)

    def _length(self, joint: int) -> float:
        return _length(self.figure, joint)

    def _representatives(self) -> tuple[Array, Mask]:
        """Choose one host and one placement of each limb for every survivor, near the middle of the sets."""
        n, h = len(self), len(self.hosts)
        postures = self.points.copy()
        found = np.zeros(n, dtype=bool)
        if not h:
            return postures, found
        usable = self.allowed.copy()
        for way in self.sets:
            some = np.zeros((n, h), dtype=bool)
            some[way.survivor, way.rows.host] = True
            usable &= some
        cost = np.where(usable, self._trunk_cost(), np.inf)
        order = np.argsort(cost, axis=1, kind="stable")
        costs = [self._limb_cost(way) for way in self.sets]
        for attempt in range(min(HOSTS_TRIED, h)):
            # Evenly down the list: the middle one, then others, the last one far from it.
            place = attempt * np.maximum(usable.sum(axis=1) - 1, 0) // max(min(HOSTS_TRIED, h) - 1, 1)
            host = order[np.arange(n), place]
            left = np.flatnonzero(~found & usable[np.arange(n), host])
            if not len(left):
                continue
            index = np.full(n, -1)
            index[left] = np.arange(len(left))
            limbs, rows = [], []
            for way, far in zip(self.sets, costs, strict=True):
                here = np.flatnonzero((index[way.survivor] >= 0) & (way.rows.host == host[way.survivor]))
                limbs.append((index[way.survivor[here]], way.rows.take(here), far[here]))
                rows.append(here)
            base = self.points[left].copy()
            base[:, list(self.plan.trunk)] = self.hosts.points[host[left]][:, list(self.plan.trunk)]
            chosen, ok = choose(self.plan, base, limbs)
            for way, here, row in zip(self.sets, rows, chosen, strict=True):
                for joint in self.plan.free(way.limb):
                    base[ok, joint] = way.position(joint)[here[row[ok]]]
            passed, _ = ask(self.plan.asked, Rows.of(base[ok]))
            good = np.flatnonzero(ok)[passed]
            postures[left[good]] = base[good]
            found[left[good]] = True
        return postures, found

    def _trunk_cost(self) -> Array:
        """Return how far each host's trunk is from the middle of the survivor's (N, H), square metres."""
        cost = np.zeros(self.allowed.shape)
        count = np.maximum(self.allowed.sum(axis=1), 1)[:, None]
        for joint in self.plan.trunk:
            position = self.hosts.points[:, joint]
            middle = self.allowed @ position / count
            cost += ((position[None] - middle[:, None]) ** 2).sum(axis=-1)
        return cost

    def _limb_cost(self, way: Way) -> Array:
        """Return how far each placement is from the middle of its set, square metres.

        The mean square distance to all others is that to their mean plus a constant, so the least is the medoid.
        Placements found by a closer look, or drawn out by the tolerance, are not counted as long as there are others.
        """
        even = (way.rows.seed >= 0) & self.hosts.even[way.rows.host]
        cost = np.zeros(len(way.survivor))
        for joint in self.plan.free(way.limb):
            position = way.position(joint)
            middle = mean(way.survivor[even], len(self), position[even])
            lone = mean(way.survivor, len(self), position)
            middle = np.where(np.isnan(middle), lone, middle)
            cost += ((position - middle[way.survivor]) ** 2).sum(axis=1)
        return np.asarray(cost + np.where(way.rows.excess > 0.0, 1e6 * (1.0 + way.rows.excess), 0.0))

    def _blame(self, done: Completion, part: Index, found: Mask) -> None:
        """Name the joint without a position, and tell where that is proven."""
        without = ~self.allowed.any(axis=1)
        sure = without & self.hosts.sure[self.core]
        blamed = np.where(without, self.plan.trunk[0] if self.plan.trunk else self.plan.unknown[0], -1)
        for way in self.ways:
            first = self.plan.free(way.limb)[0]
            none = np.bincount(way.survivor, minlength=len(self)) == 0
            if not self.plan.hidden(way.limb):
                proven = none & self.hosts.sure[self.core]
            else:
                reached = np.bincount(
                    self.hosts.core[way.placer.too_short() <= 0.0], minlength=len(self.core_frame)
                )
                proven = none & self.hosts.sure[self.core] & (reached[self.core] == 0)
            sure |= proven
            blamed = np.where(none & (blamed < 0), first, blamed)
        blamed = np.where(blamed < 0, self.plan.unknown[0], blamed)
        done.miss[part] = np.where(without, self.hosts.miss[self.core], 0.0)
        done.blamed[part] = np.where(found, -1, blamed)
        done.outcome[part[sure & ~found]] = Outcome.IMPOSSIBLE

    def _describe_trunk(self, done: Completion, part: Index, joint: int, middle: Array) -> None:
        """Describe where a joint of the trunk can be."""
        who, host = np.nonzero(self.allowed)
        position = self.hosts.points[host, joint]
        done.lower[part, joint], done.upper[part, joint] = box(who, len(self), position)
        apart = np.linalg.norm(position - middle[who], axis=1)
        _, radius = largest(who, len(self), apart)
        done.radius[part, joint] = np.where(np.isfinite(radius), radius, np.nan)
        count = np.bincount(who, minlength=len(self))
        even = np.bincount(who[self.hosts.even[host]], minlength=len(self))
        tried = np.maximum(self.hosts.tried[self.core], 1)
        pivot = TORSO_JOINTS[0] if joint in TORSO_JOINTS else HIP_JOINTS[0]
        length = self.figure.lengths[segment_name((pivot, joint))]
        spacing = self.hosts.spacing[self.core]
        reach = done.upper[part, joint] - done.lower[part, joint]
        fraction = (
            np.linalg.norm(reach, axis=1) / self._depths(joint, length)
            if self.plan.states[joint] == State.SEEN
            else even / tried
        )
        done.samples[part, joint] = count
        done.fraction[part, joint] = np.where(spacing > 0.0, np.minimum(fraction, 1.0), 1.0)
        done.spacing[part, joint] = spacing
        done.accuracy[part, joint] = self._unsettled() * length

    def _ends(self, way: Way, middle: Array) -> Array:
        """Return the ends of the boxes and the radii (2, N, 7) of a limb's joints; NaN where a set is empty."""
        representatives = np.stack([middle[:, joint] for joint in way.limb.free])
        table = reaches(way.placer, way.rows, way.survivor, representatives)
        reach = np.full((2, len(self), GOALS), -np.inf)
        for joint, goal in np.ndindex(2, GOALS):
            reach[joint, :, goal] = largest(
                way.survivor, len(self), np.nan_to_num(table[joint, goal], nan=-np.inf)
            )[1]
        if self.plan.hidden(way.limb):
            # Where an end of the core's set is not among them, a known limb or the trunk cut it off: it is sought anew.
            wanted = reach < way.reach[:, self.core] - SAME
            wanted[:, :, -1] = True
            wanted &= np.array([joint in self.plan.free(way.limb) for joint in way.limb.free])[:, None, None]
            ends = seek_ends(
                way.placer,
                way.survivor,
                way.rows,
                representatives,
                lambda survivor, rows: self._passes(way.placer, survivor, rows),
                wanted,
            )
            reach = np.maximum(reach, ends.reach)
        return np.where(np.isfinite(reach), reach, np.nan)

    def _describe_limb(self, done: Completion, part: Index, way: Way, joint: int, ends: Array) -> None:
        """Describe where a joint of a limb can be."""
        n, placer, rows, who = len(self), way.placer, way.rows, way.survivor
        done.lower[part, joint], done.upper[part, joint] = -ends[:, :3], ends[:, 3:6]
        done.radius[part, joint] = ends[:, 6]
        lattice = placer.spacing()[rows.host]
        done.samples[part, joint] = np.bincount(who, minlength=n)
        done.fraction[part, joint] = self._fraction(done, part, way, joint)
        trunk = self.hosts.spacing[self.core]
        spacing = np.zeros(n)
        spacing[who] = lattice
        done.spacing[part, joint] = spacing + trunk
        lever = self._length(way.limb.middle) + (self._length(way.limb.end) if joint == way.limb.end else 0.0)
        crowd = np.bincount(self.hosts.core, minlength=len(self.core_frame))[self.core] > 1
        attained = np.where(
            crowd, ATTAINED_IN_CROWD, ATTAINED_IN_FOUR if way.placer.both_hidden else ATTAINED
        )
        done.accuracy[part, joint] = spacing * attained * lever + trunk * (
            lever + self._length(way.limb.base)
        )

    def _unsettled(self) -> Array:
        """Return how far the trunk may turn on beyond what was found (N,), radians: rotations have corners."""
        turn = self.hosts.turn
        return self.hosts.spacing[self.core] * (2.0 if turn is None or turn.about is None else 1.0)

    def _passes(self, placer: LimbPlacer, survivor: Index, rows: Placed) -> Mask:
        """Judge placements by all checks of their limb."""
        passed = self._passes_own(placer, rows)
        own = np.flatnonzero(passed)
        checks = self.plan.limb_cross[placer.limb]
        passed[own], _ = ask(checks, self._limb_columns(placer, survivor[own], rows.take(own)))
        return passed

    def _passes_own(self, placer: LimbPlacer, rows: Placed) -> Mask:
        """Judge placements by the checks that read nothing but the core; what is out of reach does not pass."""
        passed = np.asarray(np.isfinite(rows.end).all(axis=1)).copy()
        reached = np.flatnonzero(passed)
        checks = [*self.plan.middle_own[placer.limb], *self.plan.end_own[placer.limb]]
        passed[reached], _ = ask(checks, placer.columns(rows.take(reached)))
        return passed

    def _fraction(self, done: Completion, part: Index, way: Way, joint: int) -> Array:
        n, who, rows = len(self), way.survivor, way.rows
        if self.plan.states[joint] == State.SEEN:
            length = np.linalg.norm(done.upper[part, joint] - done.lower[part, joint], axis=1)
            reach = self._length(way.limb.middle) + (
                self._length(way.limb.end) if joint == way.limb.end else 0.0
            )
            base = way.limb.base
            return np.asarray(np.minimum(length / self._depths(joint, reach, base), 1.0))
        n_middle, n_end = way.placer.per_host()
        hosts = np.maximum((self.allowed & self.hosts.even).sum(axis=1), 1)
        even = (rows.seed >= 0) & self.hosts.even[rows.host]
        label = np.where(even, rows.host * (n_middle * max(n_end, 1) * 2) + rows.seed, -1)
        if joint == way.limb.middle or self.plan.states[way.limb.middle] != State.HIDDEN:
            tried = n_middle if joint == way.limb.middle else n_end
            lattices = 1 if self.plan.states[way.limb.middle] != State.SEEN else 2
            part_of = np.zeros(n)
            part_of[who] = way.placer.part()[rows.host]
            return np.asarray(distinct(who, n, label) / (tried * hosts * lattices) * part_of)
        return np.asarray(np.bincount(who[even], minlength=n) / (n_middle * n_end * hosts))

    def _depths(self, joint: int, reach: float, base: int | None = None) -> Array:
        """Return how long the part of a seen joint's ray is (N,) that lengths alone allow, metres."""
        base = PARENTS[joint] if base is None else base
        frame = self.core_frame[self.hosts.core]
        foot, height = self.rays.foot(joint, frame, self.hosts.points[:, base])
        half = np.sqrt(np.maximum(reach**2 - height**2, 0.0))
        along = np.einsum(
            "hi,hi->h", foot - self.rays.origin[frame, joint], self.rays.direction[frame, joint]
        )
        cores = len(self.core_frame)
        low, high = np.full(cores, np.inf), np.full(cores, -np.inf)
        np.minimum.at(low, self.hosts.core, along - half)
        np.maximum.at(high, self.hosts.core, along + half)
        length = (high - low)[self.core]
        return np.asarray(np.where(length > 0.0, length, 1.0))


def _length(figure: Figure, joint: int) -> float:
    return figure.lengths[segment_name((PARENTS[joint], joint))]
