"""Trees that were grown together, and what their leaves are as postures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from posekit.body.closed_form import Alike
from posekit.display.short_repr import ShortRepr
from posekit.geometry import Array
from posekit.objects.mirror import mirrored
from posekit.settings import Judged, Tolerance
from posekit.skeleton import JOINTS, SEGMENTS, segment_name
from posekit.tree import Check, Leaves
from posekit.validators import worst_margins

if TYPE_CHECKING:
    from posekit.body import Configurations
    from posekit.formats.own.posture_set import PostureSet
    from posekit.hidden import CompletedSurvivors
    from posekit.recovery.body import LiftedBody
    from posekit.recovery.fit_camera import CameraFit
    from posekit.recovery.refined import RefinedSurvivors

LEVEL_METRES = 5e-10
"""Metres of depth up to which neither end of a segment is nearer: rounding."""


@dataclass(frozen=True, kw_only=True)
class Batch(ShortRepr):
    """Frames whose trees were grown together.

    Parameters
    ----------
    leaves : Leaves
        What survived all checks.
    physical : int array (F, 14), optional
        Survivors by level before the motion model, where one was asked.
    checks : sequence of Check
        The checks that judged them, every distance measured, for margins.
    body : Body
        What the trees are of.
    tolerance : Tolerance
        What may be off.
    judged : str
        How its frames were judged: `posekit.settings.Judged`.
    exact : bool array (F,)
        Where there is evidence that the image points are exact, of frames that were judged so.
    completion : CompletedSurvivors, optional
        The survivors' joints that were not seen; of the leaves before the motion model.
    refined : RefinedSurvivors, optional
        The likeliest postures near the leaves, where the noise is known.
    spread : float
        How far off these are, metres (`posekit.ranking.deviation_of_noise`).
    untold : bool array (N, 14), optional
        Refined joints that were not seen, and are where their neighbours leave them.
    """

    leaves: Leaves
    physical: NDArray[np.int64] | None
    checks: Sequence[Check]
    body: LiftedBody
    tolerance: Tolerance
    judged: Judged
    exact: NDArray[np.bool_]
    completion: CompletedSurvivors | None = None
    refined: RefinedSurvivors | None = None
    spread: float = 0.0
    untold: NDArray[np.bool_] | None = None

    @cached_property
    def points(self) -> Array:
        """All survivors with their heads (N, 19, 3), camera frame, metres."""
        if self.refined is not None:
            points = np.concatenate([self.refined.joints, self.refined.head], axis=1)
        else:
            points = self.body.points(self.leaves)
        if self.completion is not None:
            filled = self.completion.postures
            joints = points[:, : len(JOINTS)]
            points[:, : len(JOINTS)] = np.where(np.isnan(joints), filled, joints)
        return points

    @cached_property
    def configurations(self) -> Configurations:
        """The configurations of all survivors."""
        return self.body.figure.configurations(self.points, self._alike)

    @property
    def q(self) -> Array:
        """Those as arrays (N, nq) in Pinocchio's order."""
        return self.configurations.q

    @property
    def fk_distance(self) -> Array:
        """How far the joints of each configuration are from the posture's (N,), metres."""
        return self.configurations.distance

    @cached_property
    def margins(self) -> dict[str, Array]:
        """The worst margin of each survivor (N,), by validator: degrees or metres."""
        return worst_margins(self.checks, self.points, self._alike)

    @property
    def _alike(self) -> Alike | None:
        """Survivors that share limbs: those of one tree, until they are refined or completed one by one."""
        shared = self.refined is None and self.completion is None and self.leaves.joints == JOINTS
        return self.leaves.alike if shared else None

    @cached_property
    def units(self) -> dict[str, str]:
        """The unit of each validator's margins."""
        return {check.name: check.unit for check in self.checks}

    @cached_property
    def mirrored(self) -> NDArray[np.bool_]:
        """Survivors (N,) whose mirror image survives too: the same picture with near and far exchanged throughout."""
        leaves = self.leaves
        return mirrored(leaves.postures()[..., 2], leaves.parents, leaves.frame, level=LEVEL_METRES)

    @cached_property
    def motion(self) -> NDArray[np.int64]:
        """Survivors by level after the motion model (F, 14)."""
        return self.leaves.counts()

    @cached_property
    def rejected(self) -> list[dict[str, int]]:
        """Lost leaves by frame and reason."""
        return self.leaves.rejected()

    @cached_property
    def offsets(self) -> NDArray[np.int64]:
        """Where each frame's survivors start and the last ends (F + 1,)."""
        return self.leaves.offsets()

    @cached_property
    def length_residual(self) -> Array:
        """How much too short each survivor's worst segment was (N,), metres: what refinement lengthened it by."""
        if self.refined is None:
            return self.leaves.length_residual()
        lengths = self.body.figure.lengths
        longer = [
            np.linalg.norm(self.refined.joints[:, a] - self.refined.joints[:, b], axis=1)
            - lengths[segment_name((a, b))]
            for a, b in SEGMENTS
        ]
        return np.asarray(np.fmax.reduce([np.zeros(len(self.refined)), *longer]))


@dataclass(frozen=True, kw_only=True)
class FrameTrees(ShortRepr):
    """Where the trees of one frame are.

    Parameters
    ----------
    batch : Batch or None
        What they were grown in; None where nothing was grown.
    index, hypotheses : int
        The place in the batch of the frame's first hypothesis, and how many there are.
    fit : CameraFit
        Where the necks came from.
    unlisted : int
        How many postures are not listed for being too unlikely.
    unlisted_probability : float
        Which share of the frame's probability they have.
    posture_set : callable, optional
        Returns the trunks and limbs of which all that may be are made, where not every posture is listed.
    outliers : tuple of str
        Joints that are taken for not seen, as their points are no joint's (`posekit.recovery.outliers`).
    """

    batch: Batch | None
    index: int
    hypotheses: int
    fit: CameraFit
    unlisted: int = 0
    unlisted_probability: float = 0.0
    posture_set: Callable[[], PostureSet] | None = None
    outliers: tuple[str, ...] = ()

    @property
    def rows(self) -> slice:
        """Which of the batch's postures are left of the frame."""
        if self.batch is None:
            return slice(0, 0)
        offsets = self.batch.offsets
        return slice(int(offsets[self.index]), int(offsets[self.index + self.hypotheses]))

    @property
    def survivors(self) -> int:
        """Count the postures that are left, those apart of whose hidden joints no place was found."""
        if self.batch is not None and self.batch.completion is not None:
            return int(self.batch.completion.decided[self.rows].sum())
        rows = self.rows
        return int(rows.stop) - int(rows.start)

    @property
    def undecided(self) -> bool:
        """Whether nothing survives, and the image points are not known to be exact."""
        own = slice(self.index, self.index + self.hypotheses)
        return not self.survivors and (self.batch is None or not self.batch.exact[own].any())


def trees_of(batch: Batch, fit: CameraFit, rows: NDArray[np.intp]) -> dict[int, FrameTrees]:
    """Say for each frame of a batch, which was grown of some hypotheses, where its own trees are."""
    frames, first, count = np.unique(fit.frame[rows], return_index=True, return_counts=True)
    return {
        frame: FrameTrees(batch=batch, index=index, hypotheses=hypotheses, fit=fit)
        for frame, index, hypotheses in zip(frames.tolist(), first.tolist(), count.tolist(), strict=True)
    }
