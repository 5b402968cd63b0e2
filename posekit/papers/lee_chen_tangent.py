r"""Why SEQ1 has fewer shoulders here than in Table 3: an untrue shoulder leaves the elbow out of reach.

The elbow lies on its ray :math:`d`, an upper arm :math:`l` from the shoulder :math:`S`. Where the ray passes
:math:`S` farther away than that, by :math:`|S - (S \cdot d) d| - l > 0`, there is no elbow at all.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from posekit.formats.markdown import table_lines
from posekit.geometry import Array
from posekit.papers import lee_chen_printed as printed
from posekit.papers.lee_chen_tables34 import (
    PAPER_TOLERANCE,
    SEQUENCE_CAMERAS,
    WalkCounts,
    WalkGrid,
    walk_counts,
)
from posekit.skeleton import JOINT, SIDES
from posekit.synthesis import Walker, walker_scene

LOOSE_METRES = 0.01
"""Metres that a segment may be too short for its image in the other count: 1 mm is allowed in the tables."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ShoulderLevels:
    """SEQ1's first two levels, and how far the elbows' rays pass out of reach.

    Parameters
    ----------
    beyond : array (S, 2)
        Metres beyond the upper arm's length at which the right and the left elbow's ray passes the untrue shoulder in
        frame 1; negative where it is within reach.
    tight, loose : WalkCounts
        Counts with 1 mm allowed, and with 1 cm.
    """

    beyond: Array
    tight: WalkCounts
    loose: WalkCounts


def shoulder_levels(grid: WalkGrid, tight: WalkCounts) -> ShoulderLevels:
    """Measure SEQ1 at the settings of a grid.

    Parameters
    ----------
    grid : WalkGrid
        The settings.
    tight : WalkCounts
        SEQ1's counts there.
    """
    return ShoulderLevels(
        beyond=np.array([_beyond(*setting) for setting in tight.settings]),
        tight=tight,
        loose=walk_counts("seq1", grid, replace(PAPER_TOLERANCE, tangent=LOOSE_METRES)),
    )


def shoulder_lines(found: ShoulderLevels) -> list[str]:
    """Lay out in Markdown how often each count of the shoulders' levels occurs, and why."""
    rows = []
    for allowed, counts in ((PAPER_TOLERANCE.tangent, found.tight), (LOOSE_METRES, found.loose)):
        for k, frame in enumerate(printed.PRINTED_FRAMES):
            print_ = tuple(printed.PRINTED_PHYSICAL["seq1"][k][1:3])
            pairs, numbers = np.unique(counts.physical[:, k, 1:3], axis=0, return_counts=True)
            said = ", ".join(
                f"{right}/{left} {number / len(counts.physical):.0%}"
                for (right, left), number in zip(pairs.tolist(), numbers.tolist(), strict=True)
            )
            rows.append((f"{allowed * 1000:g} mm", frame, f"{print_[0]}/{print_[1]}", said))
    millimetres = found.beyond * 1000
    upright = found.loose.physical[found.loose.settings[:, 1] == 0, 0, 1:3]
    doubled = (upright == printed.PRINTED_PHYSICAL["seq1"][0][1:3]).all(axis=1)
    return [
        "## SEQ1's first levels: the right and the left shoulder",
        "",
        *table_lines(("a segment may be too short by", "frame", "print", "share of the settings"), rows),
        "The shoulder that is not the input's leaves the elbow out of reach: from it the elbow's ray passes up to "
        f"{millimetres.max():.1f} mm beyond the upper arm's length (median {np.median(millimetres):.1f} mm; "
        f"in {(millimetres > PAPER_TOLERANCE.tangent * 1000).mean():.0%} of the arms of frame 1 more than the "
        f"{PAPER_TOLERANCE.tangent * 1000:g} mm that is allowed, in {(millimetres > LOOSE_METRES * 1000).mean():.0%} "
        f"more than {LOOSE_METRES * 1000:g} mm). The arm hangs nearly square to its ray, and a shoulder that is "
        "farther from the camera by some centimetres is too far from the ray. With 1 cm allowed, "
        f"{doubled.mean():.0%} of the settings without lean besides have 2/4 in frame 1. The paper, whose shoulders "
        "double, must allow more than 1 mm, and does not say how much.",
        "",
    ]


def _beyond(velocity: float, lean: float, phase: float) -> Array:
    """Return by how much the elbows' rays pass the untrue shoulders out of reach (2,), metres."""
    walker = Walker(velocity=velocity, lean=float(np.radians(lean)))
    scene = walker_scene(walker, camera=SEQUENCE_CAMERAS["seq1"], frames=1, phase0=phase)
    points = scene.joints_cam[0]
    beyond = []
    for side in SIDES:
        shoulder, elbow = points[JOINT[f"{side}_shoulder"]], points[JOINT[f"{side}_elbow"]]
        ray = shoulder / np.linalg.norm(shoulder)
        # Both shoulders lie on one ray, symmetric about the foot of the neck's perpendicular.
        other = (2 * (points[JOINT["neck"]] @ ray) - shoulder @ ray) * ray
        line = elbow / np.linalg.norm(elbow)
        beyond.append(np.linalg.norm(other - (other @ line) * line) - np.linalg.norm(elbow - shoulder))
    return np.array(beyond)
