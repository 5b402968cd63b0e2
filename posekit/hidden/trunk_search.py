"""What torso and hips are placed by, whether a body is rigid or was measured: rays, lengths, and what is seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from posekit.body import Figure
from posekit.hidden.occlusion_pattern import OcclusionPattern
from posekit.hidden.posture_rows import Index
from posekit.hidden.rays import Rays
from posekit.hidden.sampling import OcclusionSampling
from posekit.hidden.trunk_placements import TrunkPlacements


@dataclass(frozen=True, kw_only=True, eq=False)
class TrunkSearch:
    """Where the unknown joints of torso and hips are looked for.

    Parameters
    ----------
    pattern : OcclusionPattern
        Which joints are seen and hidden, and the checks that read them.
    figure : Figure
        The person.
    rays : Rays
        The rays of the joints that are seen.
    frame : int array (C,)
        The frame of each core: which row of the rays.
    tolerance : float
        Metres by which a segment may be too short for its image.
    sampling : OcclusionSampling
        How finely spheres, circles and the turns of a rigid part are sampled.
    """

    pattern: OcclusionPattern
    figure: Figure
    rays: Rays
    frame: Index
    tolerance: float
    sampling: OcclusionSampling

    def lifted_from(
        self, trunks: TrunkPlacements, parent: int, joint: int, length: float
    ) -> tuple[TrunkPlacements, Index]:
        """Lift a joint that was seen from its parent; return its places, and the trunk of each."""
        start = trunks.points[:, parent]
        lift = self.rays.lift(joint, self.frame[trunks.core], start, length, self.tolerance)
        row, branch = np.nonzero(lift.valid)
        placed = trunks.take(row)
        placed.points[:, joint] = lift.points[row, branch]
        return placed, row
