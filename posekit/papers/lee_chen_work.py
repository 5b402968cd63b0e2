"""What `posekit reproduce` calculates of Lee & Chen 1985: each part once, when it is asked for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from posekit.geometry import Array
from posekit.papers.lee_chen_table2 import CameraEstimate, camera_estimates, exact_tables
from posekit.papers.lee_chen_tables34 import (
    SEQUENCE_CAMERAS,
    WalkCounts,
    WalkGrid,
    closest_setting,
    walk_counts,
)
from posekit.papers.lee_chen_tangent import ShoulderLevels, shoulder_levels


@dataclass(frozen=True, kw_only=True, eq=False)
class LeeChenWork:
    """The calculations over one grid of settings.

    Parameters
    ----------
    grid : WalkGrid
        The walker's settings.
    """

    grid: WalkGrid

    @cached_property
    def estimates(self) -> list[CameraEstimate]:
        """The camera, found in several ways."""
        return camera_estimates()

    @cached_property
    def tables(self) -> dict[str, Array]:
        """Table 2 from exact projections."""
        return exact_tables()

    @cached_property
    def counts(self) -> dict[str, WalkCounts]:
        """Tables 3 and 4 and §4.2 at all settings, by sequence."""
        return {name: walk_counts(name, self.grid) for name in SEQUENCE_CAMERAS}

    @cached_property
    def chosen(self) -> int:
        """The row of the setting that is closest to all cells of both sequences together."""
        return closest_setting(list(self.counts.values()))

    @property
    def setting(self) -> Array:
        """Velocity, lean and phase there (3,)."""
        values: Array = self.counts["seq1"].settings[self.chosen]
        return values

    @cached_property
    def shoulders(self) -> ShoulderLevels:
        """Why SEQ1's first levels differ."""
        return shoulder_levels(self.grid, self.counts["seq1"])
