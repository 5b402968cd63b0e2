"""What a rigid part says about the neck's distance: its plausible poses, each with a deviation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from posekit.cameras.neck.pose import MIN_POINTS, PartPoses
from posekit.geometry import Array

Part = Literal["head", "torso"]

SUFFICIENT_DEVIATION_METRES: Final[dict[Part, float]] = {"head": 0.10, "torso": 0.20}
"""Standard deviation (m) of the neck's distance up to which a rigid part tells it well enough.

The torso comes after the head, and tells it better than the search does at any noise: it may be less sure.
"""

KEPT_SIGMAS = 2.5
"""Standard deviations to both sides of a distance that are kept."""

PLAUSIBLE_COST = 9.0
"""Squared deviations by which a pose may fit worse than the best and still be the true one (3 standard deviations)."""

EXPLAINED_COST = {2: 13.82, 4: 18.47, 6: 22.46}
"""Squared deviations of a cost that one sound frame in a thousand exceeds, by degrees of freedom (chi-square)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PartSuggestion:
    """The neck's distance along its ray in F frames, by at most K poses of a part; NaN where there is none.

    Parameters
    ----------
    part : {"head", "torso"}
        The rigid part that was asked.
    distance, deviation : array (F, K)
        Metres, of plausible poses, best first.
    rms : array (F,)
        Reprojection error of the best pose, pixels.
    reasons : tuple of str
        Why a frame's is no answer to rely on; empty where it suffices.
    """

    part: Part
    distance: Array
    deviation: Array
    rms: Array
    reasons: tuple[str, ...]

    def __post_init__(self) -> None:
        for name in ("distance", "deviation", "rms"):
            getattr(self, name).flags.writeable = False

    def found(self, frame: int) -> bool:
        """Tell whether a frame has any pose."""
        return bool(np.isfinite(self.distance[frame]).any())

    def intervals(self, frame: int, sigmas: float = KEPT_SIGMAS) -> Array:
        """Return the distances (I, 2) within so many deviations of the plausible poses of a frame."""
        known = np.isfinite(self.distance[frame])
        middle, half = self.distance[frame][known], sigmas * self.deviation[frame][known]
        return np.stack([middle - half, middle + half], axis=-1)


def suggest(part: Part, poses: PartPoses, ray: Array, seen: NDArray[np.intp], bent: float) -> PartSuggestion:
    """Take the neck's distance from the poses of a part.

    The neck of a pose is the part's own; its distance is that of the point of the neck's ray nearest to it.

    Parameters
    ----------
    part : str
        The rigid part: ``head`` or ``torso``.
    poses : PartPoses
        Their origin is the neck.
    ray : array (F, 3)
        Unit vectors to the neck's image.
    seen : int array (F,)
        Points of the part that are seen.
    bent : float
        Metres by which the neck may lie elsewhere than rigidly with the part: added to the deviation.
    """
    plausible = poses.found & (poses.cost <= poses.cost[:, :1] + PLAUSIBLE_COST)
    along = np.einsum("fki,fi->fk", poses.origin, ray)
    plausible &= along > 0  # False where the neck is not seen
    deviation = np.hypot(poses.deviation(ray), bent)
    distance = np.where(plausible, along, np.nan)
    deviation = np.where(plausible, deviation, np.nan)
    reasons = []
    for k, count in enumerate(seen):
        explained = EXPLAINED_COST.get(int(poses.freedom[k]), np.inf)
        if count < MIN_POINTS:
            why = f"{count} of its points are seen, expected at least {MIN_POINTS}"
        elif not plausible[k].any():
            why = "no pose fits its image"
        elif poses.cost[k, 0] > explained:
            why = (
                f"its points miss their image by {poses.rms[k, 0]:.3g} px, more than their deviation explains"
            )
        elif not (worst := float(np.nanmax(deviation[k]))) <= SUFFICIENT_DEVIATION_METRES[part]:
            why = f"it tells the neck's depth to {worst:.2g} m, expected {SUFFICIENT_DEVIATION_METRES[part]:g} m"
        else:
            why = ""
        reasons.append(f"the {part} does not suffice: {why}" if why else "")
    return PartSuggestion(
        part=part,
        distance=distance,
        deviation=deviation,
        rms=poses.rms[:, 0].copy(),
        reasons=tuple(reasons),
    )
