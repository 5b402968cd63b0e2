"""Trees under noise: trunks first, limbs on them, then the likeliest posture of every leaf.

Nothing is dropped that the noise can explain, what it cannot explain is rejected, what became one is merged, and every
survivor passes the checks: see `posekit.refinement` and `posekit.recovery.certified`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure
from posekit.body.angles import Limits
from posekit.cameras import Camera, PinholeCamera, ScaledOrthographicCamera
from posekit.cameras.neck.given import with_own_head
from posekit.compiled.compiling import expect
from posekit.geometry import Array
from posekit.ranking import deviation_of_noise
from posekit.recovery.body import ranges_of, suite_of
from posekit.recovery.certified import Contradiction, certified_within, certifying_checks
from posekit.recovery.fit_camera import CameraFit, fit_camera
from posekit.recovery.grower import Grower
from posekit.recovery.hypotheses import ObservedHypotheses
from posekit.recovery.leaf_search import blocks, refine_leaves
from posekit.recovery.limb_walls import LimbWalls
from posekit.recovery.listing import BodyListing
from posekit.recovery.noise import Noise, contact_under_noise
from posekit.recovery.ranked import rank_postures, up_of
from posekit.recovery.refined_completion import RefinedCompletion
from posekit.recovery.survival import LeafOutcomes, drop
from posekit.recovery.trees import Batch, FrameTrees
from posekit.refinement import ObservedFrames, Trunks, find_trunks, tolerance_of, under_noise
from posekit.refinement.tolerance import NoiseTolerance
from posekit.settings import ALLOWED_DEVIATIONS, RecoverSettings, Tolerance
from posekit.skeleton import HEAD, JOINTS, N_TRUNK_JOINTS, RIGID_SEGMENTS, segment_name
from posekit.tree import Check, InterpretationTree, Leaves, Loosening, Scope
from posekit.validators.joint_range import limited

if TYPE_CHECKING:
    from posekit.recovery.clip_body import ClipBody

NOISE_UNIT_DEGREES: Final = 1.0
"""Degrees: what `under_noise` multiplies with what the noise does to each segment."""

LOOSENED_LENGTHS: Final = 2.0
"""By how many times lengths may be farther off than is usual, in frames that have no posture otherwise."""

REFINED_FRAME_WORTH: Final = 50
"""Exact frames that take as long as a refined one."""

HYPOTHESES_AT_ONCE: Final = 1000
"""Hypotheses whose trees are grown together: each may have thousands of leaves."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Lifted:
    """Leaves of trees on trunks, before they are refined.

    Parameters
    ----------
    chosen : int array (H,)
        The hypotheses of the camera fit.
    frame : int array (H,)
        Whose frame each is, counted from 0.
    frames : int array (F,)
        The view's frames.
    seen : ObservedHypotheses
        What these hypotheses observed.
    trunks : Trunks
        Of those hypotheses.
    leaves : Leaves
        On them.
    physical : int array
        Survivors by level, before the motion model.
    """

    chosen: NDArray[np.intp]
    frame: NDArray[np.intp]
    frames: NDArray[np.intp]
    seen: ObservedHypotheses
    trunks: Trunks
    leaves: Leaves
    physical: NDArray[np.int64]

    @property
    def own(self) -> NDArray[np.intp]:
        """The hypothesis of the camera fit that each trunk was found for."""
        return self.chosen[self.trunks.frame]

    @property
    def hypothesis(self) -> NDArray[np.intp]:
        """The hypothesis of each leaf, counted from 0."""
        return self.trunks.frame[self.leaves.frame]


@dataclass(frozen=True, kw_only=True)
class Refiner:
    """Grows and refines trees over the frames of a view whose noise is known.

    Parameters
    ----------
    grower : Grower
        What grows the trees of the view.
    noise : Noise
        How far image points and lengths may be off.
    clip : ClipBody, optional
        The one body that was found for all frames, whose lengths these are.
    """

    grower: Grower
    noise: Noise
    clip: ClipBody | None = None

    def grow(self, frames: NDArray[np.intp]) -> dict[int, FrameTrees]:
        """Grow the trees of some frames of the view, and refine their leaves: hypotheses are trunks, maybe none."""
        fit = self.fit
        expect(REFINED_FRAME_WORTH * len(frames))
        chosen = np.flatnonzero(np.isin(fit.frame, frames) & np.isfinite(fit.root).all(axis=1))
        trees = {
            int(k): FrameTrees(batch=None, index=0, hypotheses=1, fit=fit)
            for k in np.setdiff1d(frames, fit.frame[chosen])
        }
        for rows in blocks(fit.frame[chosen], HYPOTHESES_AT_ONCE):
            if rows.stop > rows.start:
                lifted = self.lift(chosen[rows])
                trees |= self._trees(lifted, self.refine(lifted))
        return trees

    @cached_property
    def fit(self) -> CameraFit:
        """The necks: those that six head points told are placed anew, with what the noise makes of them."""
        given, view = self.grower.fit, self.grower.view
        if given.pose is None or not np.isnan(view.root).any():
            return given
        rooting = replace(self.grower.settings.rooting, trust_head=False)
        return fit_camera(view, self.grower.body.figure, rooting, uncertainty=self.noise.lengths)

    def less_sure(self) -> Refiner:
        """Return the same for a body of which less is known: of frames that nothing explains otherwise."""
        return replace(self, noise=replace(self.noise, lengths=self.noise.lengths.widened(LOOSENED_LENGTHS)))

    @cached_property
    def settings(self) -> RecoverSettings:
        """What the checks are asked with: bodies may overlap by as much as depths are off."""
        asked = self.grower.settings
        return asked.changed(contact_margin=contact_under_noise(asked.contact_margin, self.noise.overlap))

    @cached_property
    def _figure(self) -> Figure:
        """The person's figure as it is judged by: lengths that are off may leave the side of its shoulders open."""
        return self.grower.body.figure.with_side_within(self.noise.lengths)

    @cached_property
    def _lifting(self) -> RecoverSettings:
        """The same for leaves: what is lifted is off by as much again as what is refined."""
        lifted = contact_under_noise(self.settings.contact_margin, self.noise.overlap)
        return self.settings.changed(contact_margin=lifted)

    @cached_property
    def tolerance(self) -> Tolerance:
        """By how much survivors may be off."""
        return certified_within(self.noise, self.grower.body.figure)

    @cached_property
    def certifying(self) -> Sequence[Check]:
        """The checks that every survivor passes."""
        made = certifying_checks(self._figure, self.settings, self.tolerance)
        return [check for check in made if self._can_be_told(check)]

    @cached_property
    def _measuring(self) -> Sequence[Check]:
        """The checks that tell every margin."""
        suite = suite_of(self.settings, self._figure, self.tolerance, exact=True)
        return [check for check in suite if self._can_be_told(check)]

    @cached_property
    def _limits(self) -> Limits:
        """The limits that refinement keeps to: those of the ranges where they are of the figure's own angles."""
        figure = self.grower.body.figure
        ranges = ranges_of(self.grower.settings).of(figure)
        if ranges.kind != "configuration" or not ranges.limits:
            return figure.ik.limits
        return limited(figure, ranges).limits

    @cached_property
    def _walls(self) -> LimbWalls | None:
        """The limits of limbs that no box of angles can say."""
        figure, settings = self.grower.body.figure, self.grower.settings
        suite = suite_of(settings, figure, replace(self.tolerance, angle=NOISE_UNIT_DEGREES))
        return LimbWalls.of(figure, suite, NOISE_UNIT_DEGREES)

    def _can_be_told(self, check: Check) -> bool:
        """Whether the noise says enough of its points: not of a detector's head, which no arm can be said to touch."""
        return not (check.needs_head and self.grower.view.derived)

    def lift(self, chosen: NDArray[np.intp]) -> Lifted:
        """Find the trunks of some hypotheses of the fit, and put limbs on them."""
        fit = self.fit
        frames, frame = np.unique(fit.frame[chosen], return_inverse=True)
        camera = fit.cameras(chosen)
        seen = self.observe(chosen, camera)
        trunks = find_trunks(seen.sight)
        own = chosen[trunks.frame]
        tree, tolerance, pruning = self._limb_tree(trunks, chosen, camera, seen)
        with np.errstate(over="ignore"):
            leaves = tree.grow(
                fit.cameras(own),
                trunks.root,
                trunks.image,
                pruning,
                # Six noisy points tell a head's turn to some ten degrees: refinement weighs them, the tree asks none.
                given=np.full((len(trunks), len(HEAD), 3), np.nan),
                tolerance=tolerance.tangent,
            )
        leaves = _without_twins(leaves, trunks)
        if self.grower.nearer is not None:
            leaves = self.grower.nearer.prune(leaves, fit.frame[own])
        physical = leaves.counts()
        suite = [
            check for check in self.grower.suites_of(tolerance)[0] if check.noise is not Loosening.REFINED
        ]
        motion = [check for check in suite if check.scope is Scope.MOTION]
        leaves = self.grower.body.tree.prune(leaves, self.grower.in_motion(motion, own))
        return Lifted(
            chosen=chosen,
            frame=frame.reshape(-1),
            frames=frames,
            seen=seen,
            trunks=trunks,
            leaves=leaves,
            physical=physical,
        )

    def observe(self, chosen: NDArray[np.intp], camera: Camera) -> ObservedHypotheses:
        """Gather what some hypotheses saw, and how well."""
        if not isinstance(camera, PinholeCamera):
            raise TypeError(
                "a view without a calibrated camera is a photograph (posekit.recovery.photograph)"
            )
        figure = self.grower.body.figure
        return ObservedHypotheses.of(
            self.grower.view, self.fit, chosen, camera, figure, self.noise, self._limits, self._walls
        )

    def to_complete(self, chosen: NDArray[np.intp]) -> Array:
        """Return image points (H, 14, 2) of some hypotheses of the fit, NaN where a joint is to be completed."""
        return self.grower.view.image[self.fit.frame[chosen]]

    def refine(self, lifted: Lifted) -> LeafOutcomes:
        """Refine leaves, reject and merge."""
        heads = self.fit.head[lifted.own] + (lifted.trunks.root - self.fit.root[lifted.own])[:, None]
        return refine_leaves(
            self._with_heads(lifted),
            lifted.leaves.postures(),
            heads[lifted.leaves.frame],
            lifted.hypothesis,
            lifted.frame[lifted.hypothesis],
            self.certifying,
            self.listing(lifted),
            self.hopeless,
        )

    def listing(self, lifted: Lifted) -> BodyListing:
        """Say how much is listed, and how likely postures are."""
        lengths, spread = self.grower.body.figure.lengths, self.spread(lifted)
        up = up_of(self.grower.view.camera)

        def score(joints: Array, chi2: Array, frame: NDArray[np.intp]) -> Array:
            off = np.full(len(lifted.frames), spread)
            ranking = rank_postures(joints, lengths, frame, None, chi2, off, up)
            return np.asarray(np.sum(list(ranking.terms.values()), axis=0))

        return BodyListing(coverage=self.grower.settings.coverage, score=score)

    @property
    def hopeless(self) -> float | None:
        """The chi2 beyond which a leaf may be given up, where it is not what is usual."""
        return None

    def untold(self, lifted: Lifted) -> NDArray[np.bool_] | None:
        """Return which joints of leaves (N, 14) are not told by the image, though the leaves have them."""
        return None

    def _with_heads(self, lifted: Lifted) -> ObservedFrames:
        """Return what was seen, with the head.

        Only now: the head's turn, unknown at first, would lead trunks astray. A detector's ears and eyes are no points
        of the figure's head: in one frame of six some ear is ten deviations off.
        """
        view, seen = self.grower.view, lifted.seen
        head = np.concatenate([view.head_image, view.own_head_image], axis=1)[self.fit.frame[lifted.chosen]]
        if not np.isfinite(head).any() or view.derived:
            return seen.sight
        own = view.own_head()
        return replace(
            seen.sight,
            head_image=head,
            head_deviation=with_own_head(seen.deviation[:, len(JOINTS) :], len(own)),
            own_head=own,
        )

    def _trees(self, lifted: Lifted, outcomes: LeafOutcomes) -> dict[int, FrameTrees]:
        """Gather what is left of each frame."""
        leaves, fit = outcomes.prune(lifted.leaves), self.fit
        completing = RefinedCompletion(
            grower=self.grower, noise=self.noise, tolerance=self.tolerance, checks=self._can_be_told
        )
        batch = Batch(
            leaves=leaves,
            physical=lifted.physical,
            checks=self._measuring,
            body=self.grower.body,
            tolerance=self.tolerance,
            judged="refined",
            exact=np.zeros(leaves.n_frames, dtype=np.bool_),
            completion=completing.complete(
                outcomes.survivors,
                lifted.hypothesis[outcomes.kept],
                fit.cameras(lifted.chosen),
                self.to_complete(lifted.chosen),
                fit.frame[lifted.chosen],
            ),
            refined=outcomes.survivors,
            spread=self.spread(lifted),
            untold=None if (untold := self.untold(lifted)) is None else untold[outcomes.kept],
        )
        count = len(lifted.frames)
        bounds = np.searchsorted(lifted.frame[lifted.trunks.frame], np.arange(count + 1))
        of_leaf = lifted.frame[lifted.hypothesis]
        unlisted = np.bincount(of_leaf, outcomes.unlisted, count)
        missing = np.bincount(of_leaf, np.where(outcomes.unlisted, outcomes.share, 0.0), count)
        return {
            int(frame): FrameTrees(
                batch=batch,
                index=int(bounds[k]),
                hypotheses=int(bounds[k + 1] - bounds[k]),
                fit=fit,
                unlisted=int(unlisted[k]),
                unlisted_probability=float(missing[k]),
                posture_set=partial(outcomes.posture_set, k),
            )
            for k, frame in enumerate(lifted.frames)
        }

    def spread(self, lifted: Lifted) -> float:
        """Say how far off survivors are, metres."""
        depth = np.median(self.fit.root[lifted.chosen, 2] / lifted.seen.focal)
        return float(deviation_of_noise(self.noise.deviation, depth, self.noise.limb))

    def allowed(self, chosen: NDArray[np.intp], camera: Camera, seen: ObservedHypotheses) -> NoiseTolerance:
        """Return what the tree of the limbs is allowed, on trunks that were found."""
        focal = 1.0
        if isinstance(camera, PinholeCamera):
            focal = float(np.min(camera.K[..., [0, 1], [0, 1]]))
        else:  # what is off is metres, whatever the scales of the frames
            camera = ScaledOrthographicCamera(scale=1.0)
        return tolerance_of(
            seen.worst * focal,
            camera,
            self.grower.body.figure,
            float(self.fit.root[chosen, 2].max()),
            length_deviation=math.hypot(self.noise.limb, self.noise.scale),
            root_depth_deviation=seen.step,
            trunks=True,
        )

    def _limb_tree(
        self, trunks: Trunks, chosen: NDArray[np.intp], camera: Camera, seen: ObservedHypotheses
    ) -> tuple[InterpretationTree, Tolerance, list[Check]]:
        """Return the tree of the limbs on trunks, its tolerance, and its checks with every angle's own allowance."""
        body = self.grower.body
        allowed = self.allowed(chosen, camera, seen)
        # Trunks were found with lengths that vary: their distances are off by as many deviations as are allowed for.
        longest = max(body.figure.lengths[segment_name(pair)] for pair in RIGID_SEGMENTS)
        rigid = max(ALLOWED_DEVIATIONS * self.noise.rigid * longest, allowed.rigid)
        tolerance = Tolerance(rigid=rigid, tangent=allowed.tangent, placement=False, angle=NOISE_UNIT_DEGREES)
        suite = under_noise(
            suite_of(self._lifting, self._figure, tolerance),
            allowed.bound,
            perspective=isinstance(camera, PinholeCamera),
            stretch=allowed.stretch,
        )
        tree = InterpretationTree(
            joints=body.tree.joints, parents=body.tree.parents, lengths=trunks.tree_lengths(body.figure)
        )
        return tree, tolerance, [check for check in suite if check.scope is not Scope.MOTION]


def _without_twins(leaves: Leaves, trunks: Trunks) -> Leaves:
    """Drop the leaves whose trunk is another than the one that was found: its twin in the same image."""
    # Leaves are sorted by frame and code, and the trunk's joints are a code's first bits: one of a run tells of all.
    prefix = leaves.code >> max(leaves.level - (N_TRUNK_JOINTS - 1), 0)
    begins = np.ones(len(prefix), dtype=np.bool_)
    begins[1:] = (prefix[1:] != prefix[:-1]) | (leaves.frame[1:] != leaves.frame[:-1])
    one = np.flatnonzero(begins)
    carried = trunks.carries(leaves.frame[one], leaves.positions(range(N_TRUNK_JOINTS), one))
    twin = ~carried[np.cumsum(begins) - 1]
    row = np.flatnonzero(twin)
    nothing = np.full(len(row), np.nan)
    why = Contradiction(
        check="trunk",
        where=("twin",),
        unit=("",),
        row=row,
        place=np.zeros(len(row), dtype=np.int8),
        value=nothing,
        lower=np.full(len(row), -np.inf),
        upper=np.full(len(row), np.inf),
    )
    return drop(leaves, twin, why)
