"""How large the person is: the scale of the lengths under which a sequence moves best."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from posekit.errors import InputError
from posekit.following.beam import Beam
from posekit.following.best_paths import best_paths
from posekit.following.motion_model import MotionModel
from posekit.following.survivor_frame import SurvivorFrame
from posekit.following.survivor_paths import Paths
from posekit.geometry import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class ScaleChoice:
    """Scales of lengths, and what the best path under each costs.

    Parameters
    ----------
    scales : array (S,)
        Ascending.
    cost : array (S,)
        Of the cheapest path under each scale.
    paths : tuple of Paths (S,)
        The paths under each scale.
    """

    scales: Array
    cost: Array
    paths: tuple[Paths, ...]

    @property
    def best(self) -> int:
        """The place of the cheapest scale."""
        return int(np.argmin(self.cost))

    @property
    def scale(self) -> float:
        """The cheapest of the scales."""
        return float(self.scales[self.best])

    @property
    def between(self) -> float:
        """The minimum of the parabola through the cheapest scale and its neighbours; at the ends the scale itself."""
        return self._minimum()[0]

    @property
    def deviation(self) -> float:
        """Standard deviation of that, as costs tell it: far too small where frames are not independent."""
        return self._minimum()[1]

    def _minimum(self) -> tuple[float, float]:
        at = self.best
        if not 0 < at < len(self.scales) - 1:
            gap = np.abs(np.delete(self.scales, at) - self.scale).min(initial=np.inf)
            return self.scale, float(gap)
        # The cost is minus a log-likelihood: near its minimum c (x - m)^2 with c = 1 / (2 deviation^2).
        x, y = self.scales[at - 1 : at + 2] - self.scales[at], self.cost[at - 1 : at + 2]
        curvature, slope, _ = np.polyfit(x, y, 2)
        if not curvature > 0:
            return self.scale, float(np.abs(x).max())
        found = float(np.clip(-slope / (2 * curvature), x[0], x[2]) + self.scales[at])
        return found, float(1 / math.sqrt(2 * curvature))


def choose_scale(
    sets: Mapping[float, Sequence[SurvivorFrame]],
    *,
    model: MotionModel | None = None,
    beam: Beam | None = None,
) -> ScaleChoice:
    """Choose among sequences that were recovered with lengths of several scales the one whose best path is cheapest.

    Too small a body has frames without survivors; one that is too large never lies in the image plane, and its limbs
    would have to jump through it.

    Parameters
    ----------
    sets : mapping
        The scale to the frames, the same times in all.
    model : MotionModel, optional
        How bodies move: what steps and turns cost.
    beam : Beam, optional
        Which paths are followed while searching.

    Raises
    ------
    InputError
        Where there is no set, a scale is not positive, or times differ.
    """
    if not sets:
        raise InputError("sets: no scale was given; expected one or more")
    scales = sorted(sets)
    for scale in scales:
        if not (math.isfinite(scale) and scale > 0):
            raise InputError(f"sets: the scale {scale!r} is impossible; expected a positive number")
        if [frame.time for frame in sets[scale]] != [frame.time for frame in sets[scales[0]]]:
            raise InputError(
                f"sets: scale {scale:g} has other frames than {scales[0]:g}; expected the same times"
            )
    paths = tuple(best_paths(sets[scale], model=model, beam=beam) for scale in scales)
    return ScaleChoice(
        scales=np.array(scales), cost=np.array([float(one.cost[0]) for one in paths]), paths=paths
    )
