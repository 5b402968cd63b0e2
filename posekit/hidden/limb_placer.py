"""Placing a limb's unknown joints on a trunk: lifted where they are seen, sampled where they are hidden."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from posekit.geometry import Array, frame_along, unit
from posekit.hidden.lattices import GOLDEN_ANGLE, GOLDEN_RATIO, sphere_spacing, zone
from posekit.hidden.limb_placements import LimbPlacements
from posekit.hidden.occlusion_pattern import JointState, LimbChain, OcclusionPattern
from posekit.hidden.posture_rows import METRES_PER_RADIAN, Index, Mask, PostureRows, judge_rows
from posekit.hidden.rays import Rays
from posekit.hidden.sampling import OcclusionSampling
from posekit.hidden.trunk_placements import EXACT_WITHIN_METRES, TrunkPlacements
from posekit.tree import Check

N_BANDS, N_SECTORS = 8, 12
"""Cells of a lattice, in each of which the nearest miss is looked at more closely."""

NEAR_MISS = 3.0
"""Spacings outside a bound that count as a near miss."""

FEWEST_ON_A_TRUNK, FEWEST_TO_REACH, FEWEST_ENDS = 4, 24, 6
"""Positions tried on a measured trunk at least: of a hidden joint, of one that reaches a ray, and of an end."""

N_DESCENTS = 3
"""Steps of that closer look, each half as wide as the last."""

N_STEP_DIRECTIONS = 6
"""Directions of each step."""

ONTO_RAY = 1e-9
"""Metres beside its ray at which a point counts as on it."""

INVERSE_PLASTIC_NUMBER = 0.7548776662466927
"""1 / the plastic number: turns each lattice of ends against the last (Roberts 2018)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LimbPlacer:
    """Places one limb on H trunks.

    Parameters
    ----------
    pattern : OcclusionPattern
        Which joints are seen and hidden, and the checks that read them.
    limb : LimbChain
        The limb that is placed.
    trunks : TrunkPlacements
        The placements of the trunk that it is placed on.
    frame : int array (H,)
        The frame of each trunk: which row of the rays.
    rays : Rays
        The rays of the joints that are seen.
    lengths : (float, float)
        Of the upper and the lower segment, metres.
    tolerance : float
        Metres by which a segment may be too short for its image.
    sampling : OcclusionSampling
        How finely hidden joints are sampled.
    """

    pattern: OcclusionPattern
    limb: LimbChain
    trunks: TrunkPlacements
    frame: Index
    rays: Rays
    lengths: tuple[float, float]
    tolerance: float
    sampling: OcclusionSampling

    @property
    def states(self) -> tuple[JointState, JointState]:
        """What is known of middle and end."""
        return self.pattern.states[self.limb.middle], self.pattern.states[self.limb.end]

    def per_trunk(self) -> tuple[int, int]:
        """How many positions of a hidden middle, and of a hidden end about each middle, are tried on a trunk."""
        # Where a core has several trunks, they share the samples: the effort of a survivor stays about the same.
        crowd = self._crowd
        if self.measured:
            reached = self.states[1] == JointState.SEEN
            every = self.sampling.measured_sphere // (2 if self.both_hidden else 1)
            share = max(every // crowd, FEWEST_TO_REACH if reached else FEWEST_ON_A_TRUNK)
            return share, FEWEST_ENDS if self.both_hidden else share
        share = max(self.sampling.sphere // crowd, 16)
        if self.both_hidden:
            return max(share // 2, 16), self.sampling.ends if crowd == 1 else max(self.sampling.ends // 2, 8)
        return share, share

    @property
    def measured(self) -> bool:
        """Whether points and lengths were measured: no place is looked at more closely then."""
        return self.tolerance > EXACT_WITHIN_METRES

    @cached_property
    def _crowd(self) -> int:
        """The most trunks that a core has."""
        return int(np.bincount(self.trunks.core, minlength=1).max(initial=1))

    def spacing(self) -> Array:
        """Return the distance of neighbours on each trunk's lattice (H,), radians; 0 where nothing is sampled.

        On a measured body the trunks of a core are near each other, and their lattices lie between each other: together
        they are one. Ends about middles that are sampled themselves then fill a ball.
        """
        n_middle, n_end = self.per_trunk()
        if self.measured:
            crowd = np.bincount(self.trunks.core, minlength=1)[self.trunks.core]
            if self.both_hidden:
                ball = np.cbrt(4.0 / 3.0 * np.pi / (n_middle * crowd * n_end))
                return np.asarray(np.maximum(ball, sphere_spacing(n_middle * crowd)))
            part = self.part() if self.states[0] == JointState.HIDDEN else 1.0
            return sphere_spacing(n_middle * crowd, part)
        _, lower, upper = self._zones()
        middle = sphere_spacing(n_middle, np.clip((upper - lower) / 2.0, 0.0, 1.0))
        hidden = [state == JointState.HIDDEN for state in self.states]
        return np.asarray(
            np.where(hidden[0], middle, np.zeros(len(self.trunks)))
            + np.where(hidden[1], sphere_spacing(n_end), 0.0)
        )

    def too_short(self) -> Array:
        """Return by how much (m) the limb is at least too short for its image on each trunk (H,); below 0 it is not."""
        base = self.trunks.points[:, self.limb.base]
        short = np.full(len(base), -np.inf)
        for joint, reach in zip(self.limb.free, np.cumsum(self.lengths), strict=True):
            if self.pattern.states[joint] == JointState.SEEN:
                _, height = self.rays.foot(joint, self.frame, base)
                height = np.where(np.isfinite(height), height, np.inf)
                short = np.maximum(short, height - reach - max(self.tolerance, 0.0))
        return short

    def miss(self) -> Array:
        """Return how far each trunk (H,) is from having a place for the limb, radians.

        With hidden joints only its reach is looked at; with seen ones every lift and check is.
        """
        short = np.maximum(self.too_short() / METRES_PER_RADIAN, 0.0)
        if self.pattern.hidden(self.limb):
            return short
        rows = self._middles(1)
        alive, middle_miss = self._judge(rows, self.pattern.middle_own[self.limb])
        ends, _ = self._ends(rows.take(alive), 1)
        _, end_miss = self._judge(ends, self.pattern.end_own[self.limb])
        nearest = np.full(len(self.trunks), np.inf)
        np.minimum.at(nearest, ends.trunk, end_miss)
        np.minimum.at(nearest, rows.trunk[~alive], middle_miss[~alive])
        # Without any lift that reaches, at least one segment is too short: by more than the limb is.
        reached = np.isfinite(nearest)
        nearest[~reached] = np.maximum(short, self._gap() / METRES_PER_RADIAN)[~reached]
        return np.asarray(np.maximum(short, nearest))

    def part(self) -> Array:
        """Return the part (H,) of the whole sphere on which a hidden joint was sampled."""
        _, lower, upper = self._zones()
        return np.asarray(np.clip((upper - lower) / 2.0, 0.0, 1.0))

    def place(self) -> LimbPlacements:
        """Place the limb on every trunk in all the ways that its own checks allow, trunks in order."""
        n_middle, n_end = self.per_trunk()
        rows = self._middles(n_middle)
        alive, miss = self._judge(rows, self.pattern.middle_own[self.limb])
        every = rows.take(alive)
        ends, parent = self._ends(every, n_end)
        passed, end_miss = self._judge(ends, self.pattern.end_own[self.limb])
        placed = ends.take(passed)
        if self.measured:
            return placed
        if self.states == (JointState.HIDDEN, JointState.SEEN):
            # Near and far are two sets: each middle is looked at twice, also where it has no end.
            twice = np.tile(np.arange(len(rows.trunk)), 2)
            both = rows.take(twice)
            both.branch[:, 1] = np.repeat([0, 1], len(rows.trunk))
            least = np.tile(np.where(alive, self._beyond(rows), miss), 2)
            least[ends.branch[:, 1] * len(rows.trunk) + np.flatnonzero(alive)[parent]] = end_miss
            found = self._closer(both.with_seed(both.seed + n_middle * both.branch[:, 1]), least, n_middle)
        elif self.states[1] == JointState.HIDDEN and self.states[0] != JointState.HIDDEN:
            found = self._closer(ends, end_miss, n_end)
        else:
            return placed
        return placed.and_(found)

    @property
    def both_hidden(self) -> bool:
        """Whether middle and end are both hidden: four angles are free."""
        return self.states == (JointState.HIDDEN, JointState.HIDDEN)

    def moved(self, rows: LimbPlacements, by: Array) -> LimbPlacements:
        """Swing hidden joints: (S, 4) radians, two for the middle about its base, two for the end about it.

        Joints that are seen are lifted anew, on their branch; rows that are out of reach then are NaN.
        """
        middle, end = rows.middle, rows.end
        base = self.trunks.points[rows.trunk, self.limb.base]
        excess = rows.excess
        lower = unit(end - middle)
        if self.states[0] == JointState.HIDDEN:
            middle = base + self.lengths[0] * _swung(unit(middle - base), by[:, :2])
        if self.states[1] == JointState.HIDDEN:
            end = middle + self.lengths[1] * _swung(lower, by[:, 2:])
        elif self.states[1] == JointState.SEEN:
            lift = self.rays.lift(
                self.limb.end, self.frame[rows.trunk], middle, self.lengths[1], self.tolerance
            )
            pick = np.arange(len(middle)), rows.branch[:, 1]
            end = np.where(lift.valid[pick][:, None], lift.points[pick], np.nan)
            excess = np.maximum(lift.excess, 0.0)
        return LimbPlacements(
            trunk=rows.trunk, middle=middle, end=end, branch=rows.branch, excess=excess, seed=rows.seed
        )

    def _beyond(self, rows: LimbPlacements) -> Array:
        """Return how far the middles of rows are from reaching the end's ray (S,), radians; above 0."""
        _, height = self.rays.foot(self.limb.end, self.frame[rows.trunk], rows.middle)
        beyond = np.where(height > self.lengths[1], (height - self.lengths[1]) / METRES_PER_RADIAN, np.inf)
        return np.asarray(beyond)

    def _gap(self) -> Array:
        """Return by how much (m) a limb that is seen misses its rays on each trunk (H,), where no lift reaches both."""
        base = self.trunks.points[:, self.limb.base]
        lift = self.rays.lift(self.limb.middle, self.frame, base, self.lengths[0], self.tolerance)
        gap = np.full(len(base), np.inf)
        for branch in range(2):
            _, height = self.rays.foot(self.limb.end, self.frame, lift.points[:, branch])
            gap = np.fmin(gap, np.where(lift.valid[:, branch], height - self.lengths[1], np.inf))
        gap = np.where(lift.valid.any(axis=1), gap, np.nan_to_num(lift.excess, nan=np.inf))
        return np.asarray(np.maximum(gap, np.finfo(np.float64).tiny))

    def _middles(self, n: int) -> LimbPlacements:
        """Return every middle that is tried; ends NaN."""
        base = self.trunks.points[:, self.limb.base]
        state = self.states[0]
        if state == JointState.HIDDEN:
            axis, lower, upper = self._zones()
            reached = np.flatnonzero(lower <= upper)
            turn, phase = (0.0, 0.5)
            if self.measured:
                turn = 2.0 * np.pi * np.mod(reached * INVERSE_PLASTIC_NUMBER, 1.0)
                phase = np.mod(reached * GOLDEN_RATIO, 1.0)
            local = zone(n, lower[reached], upper[reached], turn, phase)
            d = np.einsum("hij,hnj->hni", frame_along(axis[reached]), local).reshape(-1, 3)
            trunk, seed = np.repeat(reached, n), np.tile(np.arange(n), len(reached))
            middle, excess = base[trunk] + self.lengths[0] * d, np.zeros(len(trunk))
            near = np.zeros(len(trunk), dtype=np.intp)
        elif state == JointState.SEEN:
            lift = self.rays.lift(self.limb.middle, self.frame, base, self.lengths[0], self.tolerance)
            trunk, branch = np.nonzero(lift.valid)
            middle, excess = lift.points[trunk, branch], np.maximum(lift.excess[trunk], 0.0)
            seed, near = branch, branch
        else:
            trunk = np.arange(len(base))
            middle, excess = self.trunks.points[:, self.limb.middle], np.zeros(len(base))
            seed, near = np.zeros(len(base), dtype=np.intp), np.zeros(len(base), dtype=np.intp)
        return LimbPlacements(
            trunk=trunk,
            middle=middle,
            end=np.full_like(middle, np.nan),
            branch=np.stack([near, np.zeros_like(near)], axis=1),
            excess=excess,
            seed=seed,
        )

    def _ends(self, rows: LimbPlacements, n: int) -> tuple[LimbPlacements, Index]:
        """Return every end that is tried for each middle, and which row's it is."""
        if self.states[1] == JointState.SEEN:
            lift = self.rays.lift(
                self.limb.end, self.frame[rows.trunk], rows.middle, self.lengths[1], self.tolerance
            )
            parent, far = np.nonzero(lift.valid)
            end, seed = lift.points[parent, far], rows.seed[parent]
            excess = np.maximum(rows.excess[parent], lift.excess[parent])
        else:
            axis = unit(rows.middle - self.trunks.points[rows.trunk, self.limb.base])
            whole = np.ones(len(axis))
            number = np.arange(len(axis)) if self.measured else rows.seed
            turn = 2.0 * np.pi * np.mod(number * INVERSE_PLASTIC_NUMBER, 1.0)
            local = zone(n, -whole, whole, turn, np.mod(number * GOLDEN_RATIO, 1.0) if self.measured else 0.5)
            f = np.einsum("sij,snj->sni", frame_along(axis), local).reshape(-1, 3)
            parent, k = np.repeat(np.arange(len(axis)), n), np.tile(np.arange(n), len(axis))
            end, far = rows.middle[parent] + self.lengths[1] * f, np.zeros(len(parent), dtype=np.intp)
            seed = rows.seed[parent] if self.states[0] == JointState.HIDDEN else rows.seed[parent] * n + k
            excess = rows.excess[parent]
        branch = np.stack([rows.branch[parent, 0], far], axis=1)
        placed = LimbPlacements(
            trunk=rows.trunk[parent],
            middle=rows.middle[parent],
            end=end,
            branch=branch,
            excess=np.maximum(excess, 0.0),
            seed=seed,
        )
        return placed, parent

    def _closer(self, rows: LimbPlacements, miss: Array, n: int) -> LimbPlacements:
        """Look between the samples for what a thin feasible part may hide there.

        In each cell of the lattice without a feasible sample the nearest miss goes downhill by its violation.
        """
        spacing = self.spacing()[rows.trunk]
        k, lattice = rows.seed % n, rows.seed // n
        sector = np.mod(k * GOLDEN_ANGLE / (2.0 * np.pi), 1.0) * N_SECTORS
        cell = (lattice * N_BANDS + k * N_BANDS // n) * N_SECTORS + sector.astype(np.intp)
        order = np.lexsort((miss, cell, rows.trunk))
        first = np.ones(len(order), dtype=bool)
        first[1:] = (np.diff(rows.trunk[order]) != 0) | (np.diff(cell[order]) != 0)
        best = order[first]
        best = best[(miss[best] > 0.0) & (miss[best] < NEAR_MISS * spacing[best])]
        here, least, step = rows.take(best), miss[best], spacing[best] / 2.0
        checks = [*self.pattern.middle_own[self.limb], *self.pattern.end_own[self.limb]]
        found = [rows.take(np.zeros(0, dtype=np.intp))]
        for descent in range(N_DESCENTS):
            each = np.repeat(np.arange(len(here.trunk)), N_STEP_DIRECTIONS)
            angle = (
                2.0
                * np.pi
                * (np.tile(np.arange(N_STEP_DIRECTIONS), len(here.trunk)) + descent / N_DESCENTS)
                / N_STEP_DIRECTIONS
            )
            by = step[each, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
            swung = self.moved(here.take(each), np.tile(by, 2))
            alive, violation = self._judge(swung, checks)
            reached = np.isfinite(swung.end).all(axis=1)
            violation = np.where(reached, violation, self._beyond(swung))
            alive &= reached
            found.append(swung.take(alive))
            order = np.lexsort((violation, each))
            first = np.ones(len(order), dtype=bool)
            first[1:] = np.diff(each[order]) != 0
            best = order[first]
            better = (violation[best] < least[each[best]]) & (violation[best] > 0.0)
            here = swung.take(best[better])
            least, step = violation[best[better]], step[each[best[better]]] / 2.0
        together = found[0]
        for more in found[1:]:
            together = together.and_(more)
        return together.with_seed(np.full(len(together.trunk), -1))

    def _judge(self, rows: LimbPlacements, checks: Sequence[Check]) -> tuple[Mask, Array]:
        return judge_rows(checks, self.columns(rows))

    def columns(self, rows: LimbPlacements) -> PostureRows:
        """Return the postures of rows: the limb's own joints on the trunks' points."""
        own: dict[int, tuple[Array, Index | None]] = {
            self.limb.middle: (rows.middle, None),
            self.limb.end: (rows.end, None),
        }
        return PostureRows.of(self.trunks.points, rows.trunk).with_(own)

    def _zones(self) -> tuple[Array, Array, Array]:
        r"""Return for each trunk the zone of the sphere in which its hidden middle can be.

        Where the end is seen, at height H beside the base, a middle in the direction d reaches its ray only if
        :math:`(l_1\, d \cdot \hat h - H)^2 \le l_2^2`, with :math:`\hat h` from the base to the ray's foot.

        Returns
        -------
        axis : array (H, 3)
        lower, upper : array (H,)
            Heights along the axis; the lower is above the upper where the ray is out of reach.
        """
        count = len(self.trunks)
        z = np.broadcast_to([0.0, 0.0, 1.0], (count, 3))
        if self.states != (JointState.HIDDEN, JointState.SEEN):
            return z, np.full(count, -1.0), np.full(count, 1.0)
        base = self.trunks.points[:, self.limb.base]
        foot, height = self.rays.foot(self.limb.end, self.frame, base)
        direction = self.rays.direction[self.frame, self.limb.end]
        known = np.isfinite(height)
        across = frame_along(np.where(known[:, None], direction, z))[..., 1]
        towards = (foot - base) / np.where(height > ONTO_RAY, height, 1.0)[:, None]
        axis = np.where((height > ONTO_RAY)[:, None], towards, across)
        upper, lower = self.lengths[0], self.lengths[1] + max(self.tolerance, 0.0)
        height = np.where(known, height, np.inf)
        return axis, np.maximum((height - lower) / upper, -1.0), np.minimum((height + lower) / upper, 1.0)


def _swung(direction: Array, by: Array) -> Array:
    """Swing unit vectors (S, 3) by (S, 2) radians along two directions square to them."""
    B = frame_along(direction)
    return unit(direction + np.tan(by[:, :1]) * B[..., 1] + np.tan(by[:, 1:]) * B[..., 2])
