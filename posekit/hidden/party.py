"""Survivors with one pattern of hidden joints: their trunks, and the feasible placements of their limbs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure
from posekit.geometry import Array
from posekit.hidden.asking import Index, Mask, PostureRows, ask
from posekit.hidden.groups import pairs
from posekit.hidden.hosts import Hosts
from posekit.hidden.kinds import kinds
from posekit.hidden.limb import LimbPlacer
from posekit.hidden.narrow import narrowed, thinned
from posekit.hidden.placed import LimbPlacements
from posekit.hidden.plan import LimbChain, OcclusionPattern
from posekit.hidden.rays import Rays
from posekit.hidden.refine import N_WALK_GOALS, seek_ends
from posekit.hidden.settings import OcclusionSampling
from posekit.hidden.trunk import TrunkPlacer
from posekit.skeleton import PARENTS, segment_name


@dataclass(frozen=True, kw_only=True, eq=False)
class Way:
    """The feasible placements of one limb: each survivor's, among those of its core.

    Parameters
    ----------
    placer : LimbPlacer
    survivor : int array (S,)
        In order.
    rows : LimbPlacements
    reach : array (2, C, 7)
        How far the sets of the cores reach, known limbs apart.
    """

    placer: LimbPlacer
    survivor: Index
    rows: LimbPlacements
    reach: Array

    @property
    def limb(self) -> LimbChain:
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
    plan : OcclusionPattern
    figure : Figure
    rays : Rays
    sampling : OcclusionSampling
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

    plan: OcclusionPattern
    figure: Figure
    rays: Rays
    sampling: OcclusionSampling
    points: Array
    frame: Index
    core: Index
    core_frame: Index
    hosts: Hosts
    placers: Sequence[LimbPlacer]

    @staticmethod
    def of(
        *,
        plan: OcclusionPattern,
        figure: Figure,
        rays: Rays,
        tolerance: float,
        sampling: OcclusionSampling,
        points: Array,
        frame: Index,
    ) -> Party:
        """Find the cores of survivors and place their trunks."""
        key = np.concatenate([frame[:, None], points[:, list(plan.core)].reshape(len(points), -1)], axis=1)
        _, first, core = np.unique(key, axis=0, return_index=True, return_inverse=True)
        core_frame = frame[first]

        def placer(limb: LimbChain, hosts: Hosts) -> LimbPlacer:
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

    def kind(self, joint: int) -> NDArray[np.int8]:
        """Return the kind of an unknown joint's set, by survivor (N,)."""
        table = np.array([kinds(self.plan, spins=spins)[joint] for spins in (False, True)], dtype=np.int8)
        return table[self.hosts.spins[self.core].astype(np.intp)]

    @cached_property
    def even(self) -> Mask:
        """Which hosts (H,) fractions and middles are counted on: the even sample, or all where none of it is left."""
        cores = len(self.core_frame)
        some = np.bincount(self.hosts.core[self.hosts.even], minlength=cores) > 0
        return np.asarray(self.hosts.even | ~some[self.hosts.core])

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

    def _way(self, placer: LimbPlacer) -> Way:
        placed = placer.place()
        cores = len(self.core_frame)
        reach = np.full((2, cores, N_WALK_GOALS), -np.inf)
        if self.plan.hidden(placer.limb):
            # Most of the ends of a survivor's sets are those of its core's: they are sought once.
            wanted = np.zeros(reach.shape, dtype=bool)
            wanted[
                [joint in self.plan.free(placer.limb) for joint in placer.limb.free], :, : N_WALK_GOALS - 1
            ] = True
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

    def _columns(self, survivor: Index, host: Index) -> PostureRows:
        """Return postures of survivors on hosts."""
        trunk = {joint: (self.hosts.points[:, joint], host) for joint in self.plan.trunk}
        return PostureRows.of(self.points, survivor).with_(trunk)

    def _limb_columns(self, placer: LimbPlacer, survivor: Index, rows: LimbPlacements) -> PostureRows:
        own: dict[int, tuple[Array, Index | None]] = {
            placer.limb.middle: (rows.middle, None),
            placer.limb.end: (rows.end, None),
        }
        return self._columns(survivor, rows.host).with_(own)

    def length(self, joint: int) -> float:
        """Return the length (m) of the segment that ends at a joint."""
        return _length(self.figure, joint)

    def passes(self, placer: LimbPlacer, survivor: Index, rows: LimbPlacements) -> Mask:
        """Judge placements by all checks of their limb."""
        passed = self._passes_own(placer, rows)
        own = np.flatnonzero(passed)
        checks = self.plan.limb_cross[placer.limb]
        passed[own], _ = ask(checks, self._limb_columns(placer, survivor[own], rows.take(own)))
        return passed

    def _passes_own(self, placer: LimbPlacer, rows: LimbPlacements) -> Mask:
        """Judge placements by the checks that read nothing but the core; what is out of reach does not pass."""
        passed = np.asarray(np.isfinite(rows.end).all(axis=1)).copy()
        reached = np.flatnonzero(passed)
        checks = [*self.plan.middle_own[placer.limb], *self.plan.end_own[placer.limb]]
        passed[reached], _ = ask(checks, placer.columns(rows.take(reached)))
        return passed


def _length(figure: Figure, joint: int) -> float:
    return figure.lengths[segment_name((PARENTS[joint], joint))]
