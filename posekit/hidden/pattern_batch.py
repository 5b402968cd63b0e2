"""Survivors with one pattern of hidden joints: their trunks, and the feasible placements of their limbs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from posekit.body import Figure
from posekit.geometry import Array
from posekit.hidden.completion import PositionKind
from posekit.hidden.grouped_rows import pairs
from posekit.hidden.limb_placements import LimbPlacements
from posekit.hidden.limb_placer import LimbPlacer
from posekit.hidden.measured_trunk import MeasuredTrunkPlacer, thinned_between_ends
from posekit.hidden.occlusion_pattern import LimbChain, OcclusionPattern
from posekit.hidden.position_kinds import position_kinds
from posekit.hidden.posture_rows import Index, Mask, PostureRows, judge_rows
from posekit.hidden.rays import Rays
from posekit.hidden.sampling import OcclusionSampling
from posekit.hidden.set_extremes import N_WALK_GOALS, seek_extremes
from posekit.hidden.trunk_placements import EXACT_WITHIN_METRES, TrunkPlacements
from posekit.hidden.trunk_placer import TrunkPlacer
from posekit.hidden.trunk_subdivision import subdivided, thinned
from posekit.skeleton import PARENTS, segment_name


@dataclass(frozen=True, kw_only=True, eq=False)
class LimbSets:
    """The feasible placements of one limb: each survivor's, among those of its core.

    Parameters
    ----------
    placer : LimbPlacer
        Places the limb on the trunks of the batch.
    survivor : int array (S,)
        In order.
    rows : LimbPlacements
        The placements (S), each on a trunk of its survivor's core.
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

    def keep(self, alive: Mask) -> LimbSets:
        """Keep some placements."""
        return replace(self, survivor=self.survivor[alive], rows=self.rows.take(alive))

    def position(self, joint: int) -> Array:
        """Return where a joint of the limb is in each placement (S, 3)."""
        return self.rows.middle if joint == self.limb.middle else self.rows.end


@dataclass(frozen=True, kw_only=True, eq=False)
class PatternBatch:
    """N survivors with one pattern, and the places of their trunks.

    Parameters
    ----------
    pattern : OcclusionPattern
        The pattern of seen and hidden joints that all N have.
    figure : Figure
        The person: lengths and the shapes of the rigid parts.
    rays : Rays
        The rays of the joints that are seen, by frame.
    tolerance : float
        Metres by which a segment may be too short for its image.
    sampling : OcclusionSampling
        How finely hidden joints are sampled.
    points : array (N, P, 3)
        NaN where unknown.
    frame : int array (N,)
        The frame of each survivor: which row of the rays.
    core : int array (N,)
        Survivors that agree in the pattern's core joints share one.
    core_frame : int array (C,)
        The frame of each core.
    trunks : TrunkPlacements
        Of the cores.
    placers : sequence of LimbPlacer
        One for each open limb, on all trunks.
    """

    pattern: OcclusionPattern
    figure: Figure
    rays: Rays
    tolerance: float
    sampling: OcclusionSampling
    points: Array
    frame: Index
    core: Index
    core_frame: Index
    trunks: TrunkPlacements
    placers: Sequence[LimbPlacer]

    @staticmethod
    def of(
        *,
        pattern: OcclusionPattern,
        figure: Figure,
        rays: Rays,
        tolerance: float,
        sampling: OcclusionSampling,
        points: Array,
        frame: Index,
    ) -> PatternBatch:
        """Find the cores of survivors and place their trunks."""
        # Survivors of a frame that agree in all joints that the hidden ones depend on are placed once.
        key = np.concatenate([frame[:, None], points[:, list(pattern.core)].reshape(len(points), -1)], axis=1)
        _, first, core = np.unique(key, axis=0, return_index=True, return_inverse=True)
        core_frame = frame[first]

        def placer(limb: LimbChain, trunks: TrunkPlacements) -> LimbPlacer:
            return LimbPlacer(
                pattern=pattern,
                limb=limb,
                trunks=trunks,
                frame=core_frame[trunks.core],
                rays=rays,
                lengths=(_length(figure, limb.middle), _length(figure, limb.end)),
                tolerance=tolerance,
                sampling=sampling,
            )

        measured = tolerance > EXACT_WITHIN_METRES
        trunk_placer = (MeasuredTrunkPlacer if measured else TrunkPlacer)(
            pattern=pattern,
            figure=figure,
            rays=rays,
            frame=core_frame,
            tolerance=tolerance,
            sampling=sampling,
        )
        trunks = subdivided(pattern, trunk_placer.place(points[first]), placer)
        if measured:
            trunks = thinned_between_ends(trunks, pattern.trunk_joints, sampling.trunks)
        elif any(pattern.hidden(limb) for limb in pattern.limbs):
            trunks = thinned(trunks, sampling.trunks)
        return PatternBatch(
            pattern=pattern,
            figure=figure,
            rays=rays,
            tolerance=tolerance,
            sampling=sampling,
            points=points,
            frame=frame,
            core=core.reshape(-1),
            core_frame=core_frame,
            trunks=trunks,
            placers=[placer(limb, trunks) for limb in pattern.limbs],
        )

    def __len__(self) -> int:
        """Count the survivors."""
        return len(self.points)

    def kind(self, joint: int) -> PositionKind:
        """Return the kind of an unknown joint's set."""
        return position_kinds(self.pattern, measured=self.measured)[joint]

    @property
    def measured(self) -> bool:
        """Whether points and lengths were measured: then regions are described to a margin, and nothing is proven."""
        return self.tolerance > EXACT_WITHIN_METRES

    @cached_property
    def even(self) -> Mask:
        """Which trunks (H,) fractions and middles are counted on: the even sample, or all where none of it is left."""
        cores = len(self.core_frame)
        some = np.bincount(self.trunks.core[self.trunks.even], minlength=cores) > 0
        return np.asarray(self.trunks.even | ~some[self.trunks.core])

    @cached_property
    def limb_sets(self) -> list[LimbSets]:
        """The feasible placements of each open limb by itself, before trunks are compared."""
        return [self._limb_set(placer) for placer in self.placers]

    @cached_property
    def allowed(self) -> Mask:
        """Which trunks (N, H) each survivor can have.

        Where a limb has a few positions by lifts and none of them passes, its trunk is impossible. That no sample
        of a hidden limb passes proves nothing: such a trunk remains, and is only not chosen.
        """
        n, h = len(self), len(self.trunks)
        allowed = self.core[:, None] == self.trunks.core[None, :]
        checks = self.pattern.trunk_cross
        if checks:
            who, trunk = np.nonzero(allowed)
            passed, _ = judge_rows(checks, self._columns(who, trunk))
            allowed[who[~passed], trunk[~passed]] = False
        for limb_set in self.limb_sets:
            if not self.pattern.hidden(limb_set.limb):
                some = np.zeros((n, h), dtype=bool)
                some[limb_set.survivor, limb_set.rows.trunk] = True
                allowed &= some
        return np.asarray(allowed)

    @cached_property
    def allowed_sets(self) -> list[LimbSets]:
        """The feasible placements of each open limb, on allowed trunks."""
        return [
            limb_set.keep(self.allowed[limb_set.survivor, limb_set.rows.trunk]) for limb_set in self.limb_sets
        ]

    def _limb_set(self, placer: LimbPlacer) -> LimbSets:
        placed = placer.place()
        cores = len(self.core_frame)
        reach = np.full((2, cores, N_WALK_GOALS), -np.inf)
        if self.pattern.hidden(placer.limb) and not self.measured:
            # Most of the ends of a survivor's sets are those of its core's: they are sought once.
            wanted = np.zeros(reach.shape, dtype=bool)
            wanted[
                [joint in self.pattern.free(placer.limb) for joint in placer.limb.free], :, : N_WALK_GOALS - 1
            ] = True
            ends = seek_extremes(
                placer,
                self.trunks.core[placed.trunk],
                placed,
                np.full((2, cores, 3), np.nan),
                lambda _, rows: self._passes_own(placer, rows),
                wanted,
            )
            reach, placed = ends.reach, placed.and_(ends.rows)
        survivor, row = pairs(self.trunks.core[placed.trunk], self.core, len(self))
        limb_set = LimbSets(placer=placer, survivor=survivor, rows=placed.take(row), reach=reach)
        checks = self.pattern.limb_cross[placer.limb]
        if not checks:
            return limb_set
        passed, _ = judge_rows(checks, self._limb_columns(placer, survivor, limb_set.rows))
        return limb_set.keep(passed)

    def _columns(self, survivor: Index, trunk: Index) -> PostureRows:
        """Return postures of survivors on trunks."""
        columns = {joint: (self.trunks.points[:, joint], trunk) for joint in self.pattern.trunk_joints}
        return PostureRows.of(self.points, survivor).with_(columns)

    def _limb_columns(self, placer: LimbPlacer, survivor: Index, rows: LimbPlacements) -> PostureRows:
        own: dict[int, tuple[Array, Index | None]] = {
            placer.limb.middle: (rows.middle, None),
            placer.limb.end: (rows.end, None),
        }
        return self._columns(survivor, rows.trunk).with_(own)

    def length(self, joint: int) -> float:
        """Return the length (m) of the segment that ends at a joint."""
        return _length(self.figure, joint)

    def passes(self, placer: LimbPlacer, survivor: Index, rows: LimbPlacements) -> Mask:
        """Judge placements by all checks of their limb."""
        passed = self._passes_own(placer, rows)
        own = np.flatnonzero(passed)
        checks = self.pattern.limb_cross[placer.limb]
        passed[own], _ = judge_rows(checks, self._limb_columns(placer, survivor[own], rows.take(own)))
        return passed

    def _passes_own(self, placer: LimbPlacer, rows: LimbPlacements) -> Mask:
        """Judge placements by the checks that read nothing but the core; what is out of reach does not pass."""
        passed = np.asarray(np.isfinite(rows.end).all(axis=1)).copy()
        reached = np.flatnonzero(passed)
        checks = [*self.pattern.middle_own[placer.limb], *self.pattern.end_own[placer.limb]]
        passed[reached], _ = judge_rows(checks, placer.columns(rows.take(reached)))
        return passed


def _length(figure: Figure, joint: int) -> float:
    return figure.lengths[segment_name((PARENTS[joint], joint))]
