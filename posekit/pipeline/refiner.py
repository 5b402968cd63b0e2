"""Trees under noise: trunks first, limbs on them, then the likeliest posture of every leaf.

Nothing is dropped that the noise can explain, what it cannot explain is rejected, and what became one is merged: see
`posekit.refinement`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array, Camera, PinholeCamera
from posekit.figure.angles import Limits
from posekit.pipeline.body import Judges
from posekit.pipeline.contact import contact_under_noise
from posekit.pipeline.fit_camera import CameraFit, fit_camera
from posekit.pipeline.grower import Grower
from posekit.pipeline.grown import Grown
from posekit.pipeline.noise import Noise, Seen
from posekit.pipeline.refined import Sifted
from posekit.pipeline.rooting import Rooting
from posekit.pipeline.tolerance import Tolerance
from posekit.pipeline.trees import Batch
from posekit.ranking import deviation_of_noise
from posekit.refinement import Sight, Trunks, find_trunks, refine, tolerance_of, under_noise
from posekit.refinement.refined import LEVEL
from posekit.refinement.sight import LIMIT_DEVIATION
from posekit.refinement.tolerance import DEVIATIONS
from posekit.skeleton import HEAD, JOINTS, RIGID_SEGMENTS, TREE_SEGMENTS, segment_name
from posekit.tree import Check, InterpretationTree, Leaves
from posekit.tree.leaves import Pruned
from posekit.validators import collision

ANGLE: Final = 1.0
"""Degrees: what `under_noise` multiplies with what the noise does to each segment."""

HOPELESS: Final = 60.0
"""A chi2 beyond which a leaf is given up unless the next step promises to halve it."""

LEAST: Final = 1e-6
"""Metres by which held lengths may be off: rounding."""

SIX: Final = 6.0
"""The root of the largest chi2 that is explained with up to 13 degrees of freedom."""

HYPOTHESES_AT_ONCE: Final = 250
"""Hypotheses whose trees are grown together: each may have thousands of leaves."""

LEAVES_AT_ONCE: Final = 60_000
"""Leaves that are refined together: each takes some kilobytes on the way."""


@dataclass(frozen=True, kw_only=True)
class Refiner:
    """Grows and refines trees over the frames of a view whose noise is known.

    Parameters
    ----------
    grower : Grower
    noise : Noise
    rooting : Rooting, optional
        How necks are placed.
    """

    grower: Grower
    noise: Noise
    rooting: Rooting | None = None

    def grow(self, frames: NDArray[np.intp]) -> dict[int, Grown]:
        """Grow the trees of some frames of the view, and refine their leaves: hypotheses are trunks, maybe none."""
        fit = self.fit
        chosen = np.flatnonzero(np.isin(fit.frame, frames) & np.isfinite(fit.root).all(axis=1))
        grown = {
            int(k): Grown(batch=None, index=0, hypotheses=1, fit=fit)
            for k in np.setdiff1d(frames, fit.frame[chosen])
        }
        for rows in _blocks(fit.frame[chosen], HYPOTHESES_AT_ONCE):
            if rows.stop > rows.start:
                grown |= self._grow(chosen[rows])
        return grown

    @cached_property
    def fit(self) -> CameraFit:
        """The necks: those that six head points told are placed anew, with what the noise makes of them."""
        given, view = self.grower.fit, self.grower.view
        if given.pose is None or not np.isnan(view.root).any():
            return given
        rooting = replace(self.rooting or Rooting(), trust_head=False)
        return fit_camera(view, self.grower.body.figure, rooting)

    @cached_property
    def judges(self) -> Judges:
        """What the checks are asked with: bodies may overlap by as much as depths are off."""
        asked = self.grower.judges
        return replace(asked, contact_margin=contact_under_noise(asked.contact_margin))

    def _measuring(self, tolerance: Tolerance) -> Sequence[Check]:
        """Return the checks that tell every margin: made once for each tolerance."""
        if tolerance not in self._suites:
            suite = self.judges.suite(self.grower.body.figure, tolerance, exact=True)
            self._suites[tolerance] = [check for check in suite if self._can_be_told(check)]
        return self._suites[tolerance]

    @cached_property
    def _suites(self) -> dict[Tolerance, Sequence[Check]]:
        return {}

    @cached_property
    def _limits(self) -> Limits:
        """The limits that refinement keeps to: those of the ranges where they are of the figure's own angles."""
        ranges, figure = self.grower.judges.ranges, self.grower.body.figure
        if ranges.kind != "configuration" or not ranges.limits:
            return figure.limits
        radians = {dof: (math.radians(low), math.radians(high)) for dof, (low, high) in ranges.limits.items()}
        return figure.with_limits(radians).limits

    @cached_property
    def _collisions(self) -> Sequence[Check]:
        if "collision" not in self.judges.checks:
            return ()
        made = collision(self.grower.body.figure, contact_margin=self.judges.contact_margin)
        return [check for check in made if self._can_be_told(check)]

    def _can_be_told(self, check: Check) -> bool:
        """Whether the noise says enough of its points: not of a detector's head, which no arm can be said to touch."""
        heads = check.name == "collision" and max(check.points) >= len(JOINTS)
        return not (heads and self.grower.view.derived)

    def _grow(self, chosen: NDArray[np.intp]) -> dict[int, Grown]:
        fit, view, figure = self.fit, self.grower.view, self.grower.body.figure
        frames, frame = np.unique(fit.frame[chosen], return_inverse=True)
        camera = _pinhole(fit.cameras(chosen))
        what = Seen.of(view, fit, chosen, camera, figure, self.noise, self._limits)
        sight, deviation = what.sight, what.deviation
        trunks = find_trunks(sight)
        seen = np.isfinite(sight.points()).all(axis=2)
        angular = deviation[:, : len(JOINTS)] / what.focal[:, None]
        worst = float(np.max(angular, where=seen, initial=0.0))
        leaves, tolerance = self._leaves(trunks, chosen, camera, worst, what.step)
        own = chosen[trunks.frame]
        if self.grower.nearer is not None:
            leaves = self.grower.nearer.prune(leaves, fit.frame[own])
        physical = leaves.counts()
        suite, _ = self.grower.suites_of(tolerance)
        leaves = self.grower.body.tree.prune(leaves, [check for check in suite if check.name == "walking"])
        leaves, completion = self.grower.complete(
            leaves, fit.cameras(own), trunks.image, suite, tolerance, fit.frame[own]
        )
        postures = leaves.postures()
        if completion is not None:
            postures = np.where(np.isnan(postures), completion.postures, postures)
        head = view.head_image[fit.frame[chosen]]
        if np.isfinite(head).any() and not view.derived:
            # Only now: the head's turn, unknown at first, would lead trunks astray. A detector's ears and eyes are no
            # points of the figure's head: in one frame of six some ear is ten deviations off.
            sight = replace(sight, head_image=head, head_deviation=deviation[:, len(JOINTS) :])
        heads = fit.head[own] + (trunks.root - fit.root[own])[:, None]
        hypothesis = trunks.frame[leaves.frame]
        sifted = _sift(sight, postures, heads[leaves.frame], hypothesis, frame[hypothesis], self._collisions)
        leaves = _rejected(leaves, sifted, self.judges.contact_margin)
        tolerance = self._tolerance(sifted)
        bounds = np.searchsorted(frame[trunks.frame], np.arange(len(frames) + 1))
        batch = Batch(
            leaves=leaves,
            physical=physical,
            checks=self._measuring(tolerance),
            body=self.grower.body,
            tolerance=tolerance,
            exact=np.zeros(leaves.n_frames, dtype=np.bool_),
            completion=None if completion is None else completion.take(sifted.kept),
            refined=sifted.survivors,
            spread=float(
                deviation_of_noise(self.noise.deviation, np.median(fit.root[chosen, 2] / what.focal))
            ),
        )
        return {
            frame: Grown(batch=batch, index=int(start), hypotheses=int(end - start), fit=fit)
            for frame, start, end in zip(frames.tolist(), bounds[:-1], bounds[1:], strict=True)
        }

    def _tolerance(self, sifted: Sifted) -> Tolerance:
        """Return by how much survivors may be off: one residual of a chi-square is no larger than its root."""
        figure = self.grower.body.figure
        worst = max(float(math.ceil(math.sqrt(sifted.survivors.chi2.max(initial=0.0)))), SIX)
        off = {name: worst * share * figure.lengths[name] for name, share in self.noise.by_segment.items()}
        return Tolerance(
            rigid=max([LEAST, *(off[segment_name(pair)] for pair in RIGID_SEGMENTS)]),
            tangent=max([LEAST, *(off[segment_name(pair)] for pair in TREE_SEGMENTS)]),
            placement=False,
            angle=worst * LIMIT_DEVIATION,
        )

    def _leaves(
        self, trunks: Trunks, chosen: NDArray[np.intp], camera: PinholeCamera, worst: float, step: float
    ) -> tuple[Leaves, Tolerance]:
        """Grow limbs on trunks, with every angle's own allowance."""
        fit, body = self.fit, self.grower.body
        depth = float(fit.root[chosen, 2].max())
        focal = float(np.min(camera.K[..., [0, 1], [0, 1]]))
        allowed = tolerance_of(
            worst * focal,
            camera,
            body.figure,
            depth,
            length_deviation=self.noise.limb,
            root_depth_deviation=step,
            trunks=True,
        )
        # Trunks were found with lengths that vary: their distances are off by as many deviations as are allowed for.
        longest = max(body.figure.lengths[segment_name(pair)] for pair in RIGID_SEGMENTS)
        rigid = max(DEVIATIONS * self.noise.rigid * longest, allowed.rigid)
        tolerance = Tolerance(rigid=rigid, tangent=allowed.tangent, placement=False, angle=ANGLE)
        tree = InterpretationTree(
            joints=body.tree.joints, parents=body.tree.parents, lengths=trunks.tree_lengths(body.figure)
        )
        own = chosen[trunks.frame]
        # Six noisy points tell a head's turn to some ten degrees: refinement weighs them, the tree does not ask.
        given = np.full((len(trunks), len(HEAD), 3), np.nan)
        with np.errstate(over="ignore"):
            leaves = tree.grow(
                fit.cameras(own),
                trunks.root,
                trunks.image,
                [
                    check
                    for check in under_noise(self.judges.suite(body.figure, tolerance), allowed.bound)
                    if check.name != "walking"
                ],
                given=given,
                tolerance=tolerance.tangent,
            )
        twin = ~trunks.carries(leaves.frame, leaves.postures())
        nothing = np.full(int(twin.sum()), np.nan)
        leaves = _drop(leaves, twin, "trunk", ("twin",), np.zeros(len(nothing), dtype=np.int8), nothing)
        return leaves, tolerance


def _pinhole(camera: Camera) -> PinholeCamera:
    if not isinstance(camera, PinholeCamera):
        raise TypeError("only views of a calibrated camera are refined")
    return camera


def _sift(
    sight: Sight,
    postures: Array,
    head: Array,
    hypothesis: NDArray[np.intp],
    frame: NDArray[np.intp],
    collisions: Sequence[Check],
) -> Sifted:
    """Refine leaves as their hypotheses were seen; reject and merge frame by frame."""
    parts = []
    for rows in _blocks(frame, LEAVES_AT_ONCE):
        start = postures[rows]
        refined = refine(sight, start, frame=hypothesis[rows], head=head[rows], hopeless=HOPELESS)
        refined = replace(refined, frame=frame[rows])
        parts.append(Sifted.of(refined, np.asarray(np.isfinite(start).all(axis=2)), collisions))
    return Sifted.joined(parts)


def _blocks(frame: NDArray[np.intp], most: int) -> Iterator[slice]:
    """Yield runs of whole frames with no more rows than are treated together, or one frame; at least one."""
    starts = np.flatnonzero(np.diff(frame, prepend=-1))
    ends = [*starts[1:].tolist(), len(frame)]
    begin = 0
    for k, end in enumerate(ends):
        if k + 1 == len(ends) or ends[k + 1] - begin > most:
            yield slice(begin, end)
            begin = end


def _rejected(leaves: Leaves, sifted: Sifted, contact: float) -> Leaves:
    """Drop the leaves that noise cannot explain, those whose bodies overlap, and those that became another."""
    overlaps = sifted.overlaps
    through = overlaps.place >= 0
    leaves = _drop(
        leaves,
        through,
        "collision",
        overlaps.where,
        overlaps.place[through],
        overlaps.distance[through],
        lower=contact,
        unit="m",
    )
    rest = ~through
    gone = ~sifted.kept[rest]
    place = np.where(sifted.explained[rest][gone], 1, 0).astype(np.int8)
    return _drop(leaves, gone, "noise", ("unlikely", "merged"), place, sifted.p[rest][gone], lower=LEVEL)


def _drop(
    leaves: Leaves,
    gone: NDArray[np.bool_],
    check: str,
    where: tuple[str, ...],
    place: NDArray[np.int8],
    value: Array,
    lower: float = -np.inf,
    unit: str = "",
) -> Leaves:
    if not gone.any():
        return leaves
    count = int(gone.sum())
    pruned = Pruned(
        level=leaves.level,
        frame=leaves.frame[gone],
        code=leaves.code[gone],
        check=check,
        where=where,
        unit=unit,
        place=place,
        value=value,
        lower=np.full(count, lower),
        upper=np.full(count, np.inf),
    )
    return leaves.keep(~gone, leaves.frame, leaves.code, leaves.level, (*leaves.pruned, pruned))
