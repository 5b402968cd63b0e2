"""Trees of some frames of one view, grown together with one tolerance."""

from __future__ import annotations

import warnings
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Camera, ScaledOrthographicCamera
from posekit.display.short_repr import ShortRepr
from posekit.formats.own import View
from posekit.geometry import Array
from posekit.recovery.body import FigureBody, LiftedBody, suite_of
from posekit.recovery.fit_camera import CameraFit
from posekit.recovery.heading import headings
from posekit.recovery.trees import Batch
from posekit.settings import EXACT_TOLERANCE, Judged, RecoverSettings, Tolerance
from posekit.skeleton import HIPS, JOINT, RIGID_SEGMENTS, TORSO
from posekit.tree import Check, InterpretationTree, Leaves, Scope

if TYPE_CHECKING:
    from posekit.hidden import CompletedSurvivors
    from posekit.objects.nearer_ends import NearerEnds

MOST_HIDDEN = 1000
"""Hidden joints, over all survivors of a frame, that are inferred: each costs some ten milliseconds or more."""

MOST_HIDDEN_MEASURED = 20_000
"""The same where points were measured, and survivors that are as good as one share what is inferred."""

WORTH_ASKING = 64
"""Hypotheses from which it is asked whether torsos close before trees are grown, of half as many at first: where points
are called noisy any number is."""

SPINE_SEGMENTS = tuple(
    segment for segment in RIGID_SEGMENTS if JOINT["pelvis"] in segment and min(segment) > 0
)
"""From the shoulders to the pelvis: the distances that a bending spine changes."""

TRUNK_JOINTS = tuple(JOINT[name] for name in TORSO[1:])


@dataclass(frozen=True, kw_only=True, eq=False)
class Grower(ShortRepr):
    """Grows trees over hypotheses of a view: its frames, or its frames at several scales.

    Parameters
    ----------
    view : View
        What was seen.
    fit : CameraFit
        The hypotheses: where the camera sees the root in each.
    body : Body
        What the points are lifted into.
    settings : RecoverSettings
        What is asked
    nearer : NearerEnds, optional
        Flips given by hand.
    """

    view: View
    fit: CameraFit
    body: LiftedBody
    settings: RecoverSettings
    nearer: NearerEnds | None = None

    @cached_property
    def _headings(self) -> Array:
        """Where the body goes in each hypothesis; nothing is known where depths are not."""
        if isinstance(self.fit.camera, ScaledOrthographicCamera):
            return np.full(self.fit.root.shape, np.nan)
        return headings(self.view.time, self.fit.frame, self.fit.root)

    def in_motion(self, checks: Sequence[Check], hypotheses: NDArray[np.intp]) -> list[Check]:
        """Tell checks of motion where the body goes in some hypotheses, the frames that they are asked about."""
        return [check.moving(self._headings[hypotheses]) for check in checks]

    def grow(self, chosen: NDArray[np.intp], tolerance: Tolerance, judged: Judged = "given") -> Batch:
        """Grow the trees of some hypotheses: physical checks on the way, the motion model on the leaves."""
        suite, measured = self.suites_of(tolerance)
        image = self.body.image(self.view.image[self.fit.frame[chosen]])
        tree = self.body.tree
        camera = self.fit.cameras(chosen)
        motion = [check for check in suite if check.scope is Scope.MOTION]
        with np.errstate(over="ignore"):  # nothing reaches the ray of an image point at 1e300
            leaves = tree.grow(
                camera,
                self.fit.root[chosen],
                image,
                [check for check in suite if check.scope is not Scope.MOTION],
                given=self.fit.head[chosen],
                tolerance=tolerance.tangent,
            )
        exact = np.zeros(leaves.n_frames, dtype=np.bool_)
        told = np.ones(leaves.n_frames, dtype=np.bool_)
        hidden = np.asarray(np.isnan(image).any(axis=2))
        if judged == "exact":
            judged_by = {check.name for check in suite if not check.rigid}
            exact = is_exact(
                leaves, self.body, judged_by, fitted=self.fit.closed, hidden=np.asarray(hidden.any(axis=1))
            )
            told = exact | self._told_by_hips(hidden)
        if self.nearer is not None:
            leaves = self.nearer.prune(leaves, self.fit.frame[chosen])
        physical = leaves.counts() if motion else None  # a joint without a position is no matter of motion
        leaves = tree.prune(leaves, self.in_motion(motion, chosen))
        wanted = told if self.settings.infer else told & ~exact & (judged == "exact")
        left, completion = self.complete(
            leaves, camera, image, suite, tolerance, self.fit.frame[chosen], wanted
        )
        if judged == "exact" and completion is not None:
            exact = _confirmed(exact, leaves.frame, left, completion, told & ~exact, self.body)
        leaves, completion = (left, completion) if self.settings.infer else (leaves, None)
        return Batch(
            leaves=leaves,
            physical=physical,
            checks=measured,
            body=self.body,
            tolerance=tolerance,
            judged=judged,
            exact=exact,
            completion=completion,
        )

    def _told_by_hips(self, hidden: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Say which hypotheses, of joints `hidden` (H, 14), are exact if the hips of a torso laid on them close."""
        if not (isinstance(self.body, FigureBody) and self.body.evidence):
            return np.zeros(len(hidden), dtype=np.bool_)
        others = [JOINT[name] for name in (*TORSO[1:-1], *HIPS[1:])]
        return np.asarray(hidden[:, JOINT["pelvis"]] & ~hidden[:, others].any(axis=1))

    def closing(self, chosen: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return those of some hypotheses that may be exact: of frames whose torso closes to rounding, or may.

        A torso that does not close in any branch, as those of measured points do not, is evidence enough: nothing is
        left then of which `is_exact` could be true, and the tree need not be grown to see it. Of points that nobody
        calls noisy few frames are not asked, and many only where some are found not to close.
        """
        if not self.body.evidence:
            return chosen[:0]
        noisy = self.view.deviation is not None
        if not isinstance(self.body, FigureBody) or not (noisy or len(chosen) >= WORTH_ASKING):
            return chosen
        some = chosen[:: max(len(chosen) // (WORTH_ASKING // 2), 1)]
        closed = self._closed(some)
        if closed.all():
            return chosen
        if len(some) < len(chosen):
            closed = self._closed(chosen)
        frame = self.fit.frame[chosen]
        return chosen[np.isin(frame, frame[closed])]

    def _closed(self, chosen: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Say of which hypotheses (H,) some branch closes the torso exactly, or does not show it."""
        tree, n = self.body.tree, JOINT["left_hip"]
        stem = InterpretationTree(joints=tree.joints[:n], parents=tree.parents[:n], lengths=tree.lengths[:n])
        suite, _ = self.suites_of(EXACT_TOLERANCE)
        with np.errstate(over="ignore"):
            leaves = stem.grow(
                self.fit.cameras(chosen),
                self.fit.root[chosen],
                self.body.image(self.view.image[self.fit.frame[chosen]])[:, :n],
                [check for check in suite if check.rigid and max(check.points) < n],
                tolerance=EXACT_TOLERANCE.tangent,
            )
        return np.bincount(leaves.frame, minlength=len(chosen)) > 0

    def complete(
        self,
        leaves: Leaves,
        camera: Camera,
        image: Array,
        suite: Sequence[Check],
        tolerance: Tolerance,
        frame: NDArray[np.intp],
        wanted: NDArray[np.bool_] | None = None,
    ) -> tuple[Leaves, CompletedSurvivors | None]:
        """Complete survivors by the joints that were not seen, and drop those that cannot be.

        `frame` is the view's frame of each hypothesis, and `wanted` says which hypotheses are completed at all; if not
        given all, where that was asked for.

        Where less than two of shoulders and pelvis are seen, the trunk could be nearly anywhere: nothing is said. Nor
        where too much is hidden in too many survivors (`MOST_HIDDEN`), which is warned of.
        """
        worth = self.worth_completing(leaves.frame, image, frame, tolerance, wanted)
        if not worth.any():
            return leaves, None
        from posekit.hidden import complete, reject

        part = leaves.keep(worth, leaves.frame, leaves.code, leaves.level, leaves.pruned)
        done = complete(part, camera, image, self.body.figure, suite, tolerance=tolerance.tangent)
        return reject(leaves, done.among(leaves.postures(), worth))

    def worth_completing(
        self,
        hypothesis: NDArray[np.integer],
        image: Array,
        frame: NDArray[np.intp],
        tolerance: Tolerance,
        wanted: NDArray[np.bool_] | None = None,
    ) -> NDArray[np.bool_]:
        """Tell which survivors (N,), of these hypotheses, are completed by joints that were not seen.

        See `complete`.
        """
        asked = wanted if wanted is not None else np.full(len(image), self.settings.infer)
        unseen = np.asarray(np.isnan(image).any(axis=2))
        measured = tolerance.tangent > EXACT_TOLERANCE.tangent
        placed = ((~unseen[:, TRUNK_JOINTS]).sum(axis=1) >= 2) | measured
        hidden = np.bincount(hypothesis, minlength=len(image)) * unseen.sum(axis=1)
        too_many = np.bincount(frame, hidden)[frame] > (MOST_HIDDEN_MEASURED if measured else MOST_HIDDEN)
        self._warn_of(frame[too_many & placed])
        worth = unseen.any(axis=1) & placed & ~too_many & asked & isinstance(self.body, FigureBody)
        return np.asarray(worth[hypothesis])

    def _warn_of(self, frames: NDArray[np.intp]) -> None:
        """Say of which frames nothing is inferred."""
        if self.settings.infer and isinstance(self.body, FigureBody) and len(frames):
            named = ", ".join(f"frames[{k}]" for k in np.unique(frames)[:3].tolist())
            warnings.warn(
                f"{named}: too many survivors and hidden joints to infer ({MOST_HIDDEN} in a frame at most): "
                "those joints stay unknown",
                UserWarning,
                stacklevel=4,
            )

    def suites_of(self, tolerance: Tolerance) -> tuple[Sequence[Check], Sequence[Check]]:
        """Return the checks that prune, and those that tell every margin: made once for each tolerance."""
        if tolerance not in self._suites:
            exact = suite_of(self.settings, self.body.figure, tolerance, exact=True)
            self._suites[tolerance] = (self.body.checks(self.settings, tolerance), exact)
        return self._suites[tolerance]

    @cached_property
    def _suites(self) -> dict[Tolerance, tuple[Sequence[Check], Sequence[Check]]]:
        return {}


def _confirmed(
    exact: NDArray[np.bool_],
    before: NDArray[np.integer],
    leaves: Leaves,
    completion: CompletedSurvivors,
    told: NDArray[np.bool_],
    body: LiftedBody,
) -> NDArray[np.bool_]:
    """Say once more which hypotheses (H,) are exact, now that hidden joints are where exact points would have them.

    Those are not in which nothing is left of the survivors `before` (frames). Of those that the hips have `told`, which
    a pelvis that was laid on carries, those are whose hips are as far apart as they must be.
    """
    lost = np.zeros(len(exact), dtype=np.bool_)
    lost[before] = True
    lost[leaves.frame] = False
    (a, b), length = body.evidence[-1]
    apart = np.linalg.norm(completion.postures[:, a] - completion.postures[:, b], axis=1)
    closed = np.zeros(len(exact), dtype=np.bool_)
    closed[leaves.frame[np.abs(apart - length) <= EXACT_TOLERANCE.rigid]] = True
    return np.asarray((exact & ~lost) | (told & closed))


def is_exact(
    leaves: Leaves,
    body: LiftedBody,
    judged_by: Collection[str],
    *,
    fitted: bool = False,
    hidden: NDArray[np.bool_] | None = None,
) -> NDArray[np.bool_]:
    """Find hypotheses (H,) whose image points are exact: there is evidence that rounding is all that is off.

    Some distances are not used to lift anything: four inside torso and hips. That they come out right to 1e-8 m
    is no accident: in a survivor, or in a branch whose pelvis or limbs were then `judged_by` other checks (their names)
    than those of rigid parts. Where none is visible
    there is no evidence, and a branch that happens to reach its rays must not stand for the truth. Where the scale was
    `fitted` to close them, one of them alone is no evidence either.

    Where some joint is `hidden` (H,), what is left must say that the spine is rigid too: shoulders and hips are in many
    skeletons whose spines bend. One distance from a shoulder to the pelvis says so. And something must survive: that
    nothing does says that the frame is none.
    """
    if not body.evidence:
        return np.zeros(leaves.n_frames, dtype=bool)
    partly = np.zeros(leaves.n_frames, dtype=bool) if hidden is None else hidden
    # Many leaves share a trunk, and stand together: one of them tells.
    depth = max(max(segment) for segment, _ in body.evidence)
    trunk = leaves.code >> (leaves.level - depth)
    first = np.ones(len(trunk), dtype=bool)
    first[1:] = (trunk[1:] != trunk[:-1]) | (leaves.frame[1:] != leaves.frame[:-1])
    nodes = np.flatnonzero(first)
    fits = np.ones(len(nodes), dtype=bool)
    seen, spine = np.zeros(len(nodes), dtype=np.int8), np.zeros(len(nodes), dtype=bool)
    for segment, length in body.evidence:
        ends = leaves.positions(segment, nodes)
        known_length = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=-1)
        known = np.isfinite(known_length)
        fits &= ~known | (np.abs(known_length - length) <= EXACT_TOLERANCE.rigid)
        seen += known
        spine |= known & (segment in SPINE_SEGMENTS)
    exact = np.zeros(leaves.n_frames, dtype=bool)
    exact[leaves.frame[nodes[fits & (seen > int(fitted)) & (spine | ~partly[leaves.frame[nodes]])]]] = True
    empty = np.bincount(leaves.frame, minlength=leaves.n_frames) == 0
    for group in leaves.pruned:
        if group.level >= JOINT["left_hip"] and group.check in judged_by:
            exact[group.frame[(empty & ~partly)[group.frame]]] = True
    return exact
