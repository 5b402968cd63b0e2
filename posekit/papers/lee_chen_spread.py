"""Where the printed counts of Tables 3 and 4 and of §4.2 lie among those of all settings of the walker."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from posekit.formats.markdown import table_lines
from posekit.geometry import Array
from posekit.papers import lee_chen_printed as printed
from posekit.papers.lee_chen_tables34 import WalkCounts, cell_names
from posekit.skeleton import JOINTS

SPREAD_PERCENTILES = (5.0, 50.0, 95.0)


@dataclass(frozen=True, kw_only=True)
class CellSpread:
    """One printed count beside the counts of S settings.

    Parameters
    ----------
    constraints : str
        What was applied.
    frame : int
        The printed frame, from 1.
    joint : str
        The joint of the level.
    printed : int
        The print.
    percentiles : tuple of float
        5, 50 and 95 % of the settings have at most these.
    shares : tuple of (int, float)
        Every count that occurs, and the share of the settings that have it.
    """

    constraints: str
    frame: int
    joint: str
    printed: int
    percentiles: tuple[float, ...]
    shares: tuple[tuple[int, float], ...]

    @property
    def below(self) -> float:
        """The share of the settings whose count is below the print."""
        return sum(share for count, share in self.shares if count < self.printed)

    @property
    def equal(self) -> float:
        """The share of the settings whose count is the print."""
        return sum(share for count, share in self.shares if count == self.printed)

    @property
    def inside(self) -> bool:
        """Whether the print lies between the smallest and the largest count."""
        return self.shares[0][0] <= self.printed <= self.shares[-1][0]

    def cell(self) -> str:
        """Write print, median, 5 to 95 %, and the shares below and equal."""
        low, middle, high = self.percentiles
        return f"{self.printed}: {middle:g} ({low:g} to {high:g}), {self.below:.0%} below, {self.equal:.0%} equal"

    def plain(self) -> dict[str, object]:
        """Return what JSON has of it."""
        return {
            "constraints": self.constraints,
            "frame": self.frame,
            "joint": self.joint,
            "printed": self.printed,
            "percentiles_5_50_95": list(self.percentiles),
            "below": self.below,
            "equal": self.equal,
            "counts": [count for count, _ in self.shares],
            "shares": [share for _, share in self.shares],
        }


def cell_spreads(counts: WalkCounts) -> list[CellSpread]:
    """Spread every printed count of a sequence over the settings."""
    spreads = []
    for (constraints, frame, joint), print_, column in zip(
        cell_names(), counts.printed_cells.tolist(), counts.cells.T, strict=True
    ):
        values, numbers = np.unique(column, return_counts=True)
        spreads.append(
            CellSpread(
                constraints=constraints,
                frame=frame,
                joint=joint,
                printed=print_,
                percentiles=tuple(
                    np.percentile(column, SPREAD_PERCENTILES, method="inverted_cdf").astype(float).tolist()
                ),
                shares=tuple(zip(values.tolist(), (numbers / len(column)).tolist(), strict=True)),
            )
        )
    return spreads


def spread_lines(counts: WalkCounts) -> list[str]:
    """Lay a sequence's spreads out in Markdown, a line a level."""
    spreads = {(one.constraints, one.frame, one.joint): one for one in cell_spreads(counts)}
    lines = []
    for constraints, title in (
        ("physical", "After the physical checks"),
        ("rules 1-2", "After Rules 1 and 2 too"),
    ):
        head = ("level", "joint", *(f"frame {frame}" for frame in printed.PRINTED_FRAMES))
        rows = [
            (level, joint, *(spreads[constraints, frame, joint].cell() for frame in printed.PRINTED_FRAMES))
            for level, joint in enumerate(JOINTS)
        ]
        lines += [
            f"{title}; print: median of the settings (5 to 95 %), share below the print, equal to it:",
            "",
            *table_lines(head, rows),
        ]
    n = len(spreads)
    nearest = int(counts.distance.argmin())
    inside = sum(one.inside for one in spreads.values())
    return [
        *lines,
        f"The print lies between the smallest and the largest count in {inside} of {n} cells, §4.2's two among them. "
        f"In the median setting the sum of |log2(here / print)| is {np.median(counts.distance):.1f}, in the nearest "
        f"for this table alone {counts.distance[nearest]:.1f} ({setting_words(counts.settings[nearest])}).",
        "",
    ]


def final_spread_lines(counts: Sequence[WalkCounts], chosen: int) -> list[str]:
    """Lay out §4.2: print, the closest setting, and all settings."""
    rows = []
    for one in counts:
        spreads = {(spread.constraints, spread.frame, spread.joint): spread for spread in cell_spreads(one)}
        steps = (
            ("Rules 1-2", spreads["rules 1-2", 1, JOINTS[-1]], one.motion[chosen, 0, -1]),
            ("grouped", spreads["grouped", 1, "all"], one.grouped[chosen]),
            ("Rules 3-5, groups", spreads["rules 3-5", 1, "all"], one.final[chosen, 0]),
        )
        rows += [(one.name.upper(), step, spread.cell(), str(ours)) for step, spread, ours in steps]
        rows.append(
            (
                one.name.upper(),
                "input among them",
                f"yes: {one.truth.mean():.0%} of the settings",
                "yes" if one.truth[chosen] else "no",
            )
        )
    return table_lines(
        ("", "after", "print: median (5 to 95 %), share below, equal", "closest setting"), rows
    )


def setting_words(setting: Array) -> str:
    """Say a setting in words."""
    velocity, lean, phase = setting
    return f"{velocity:g} leg lengths/s, leaning by {lean:g} degrees, phase {phase:.2f}"
