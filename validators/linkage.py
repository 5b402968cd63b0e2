"""Any articulated object: loops that close, midpoints in the middle, ends that were said to be nearer (Taylor 2000)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from posekit.cameras.camera import COINCIDENT_METRES
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.linkages import SpanningTree
from posekit.linkages.naming import meant
from posekit.safe_io.refusal import shown
from posekit.tree import Check, Findings, Place


def closure(spanned: SpanningTree, *, tolerance: float = 1e-6) -> list[Check]:
    """Make the checks that close a linkage's loops and hold its midpoints in the middle.

    Parameters
    ----------
    spanned : SpanningTree
        Points of the checks are joints of its tree.
    tolerance : float
        How far a chord's length may be off, in the linkage's unit of length.

    Returns
    -------
    list of Check
        One for each midpoint in the tree and for each chord; none for a chain or a tree without midpoints.
    """
    linkage = spanned.linkage
    checks: list[Check] = []
    for number, midpoint in enumerate(linkage.midpoints):
        node = len(linkage.points) + number
        if node in spanned.nodes:
            joints = (spanned.joint(node), *(spanned.joint(end) for end in midpoint.ends))
            whole = linkage.segment("-".join(linkage.nodes[end] for end in midpoint.ends))
            place = Place(name=midpoint.name)
            checks.append(MiddleOfEnds(places=(place,), points=joints, length=float(linkage.lengths[whole])))
    for chord in spanned.chords:
        a, b = linkage.segments[chord]
        checks.append(
            Chord(
                places=(Place(segment=linkage.segment_names[chord]),),
                points=(spanned.joint(a), spanned.joint(b)),
                length=float(linkage.lengths[chord]),
                tolerance=tolerance,
            )
        )
    return checks


def nearer(
    choices: Mapping[str, str],
    *,
    joints: Sequence[str],
    segments: Sequence[str],
    nothing: float = COINCIDENT_METRES,
) -> list[Check]:
    """Make the checks of flips that were given by hand: which end of a segment is nearer to the camera.

    Parameters
    ----------
    choices : mapping
        Name of a segment, ``a-b`` or ``b-a``, to its nearer end, a or b.
    joints : sequence of str
        Names of the tree's joints.
    segments : sequence of str
        Names of the object's segments.
    nothing : float
        Difference in depth up to which neither end is nearer: the choice is undecided.

    Raises
    ------
    InputError
        Where a segment or its end is not known.
    """
    checks: list[Check] = []
    for name, end in choices.items():
        pair = _ends(name, joints, segments)
        if end not in pair:
            raise InputError(
                f"nearer {name}: {shown(end)} is not one of its ends; expected {pair[0]} or {pair[1]}"
            )
        other = pair[1] if end == pair[0] else pair[0]
        points = joints.index(end), joints.index(other)
        checks.append(NearerEnd(places=(Place(segment=name),), points=points, nothing=nothing))
    return checks


def _ends(name: str, joints: Sequence[str], segments: Sequence[str]) -> tuple[str, str]:
    """Return the two ends of a segment given by name, either way round."""
    parts = name.split("-")
    for k in range(1, len(parts)):
        a, b = "-".join(parts[:k]), "-".join(parts[k:])
        if f"{a}-{b}" in segments or f"{b}-{a}" in segments:
            for end in (a, b):
                if end not in joints:
                    raise InputError(f"nearer {shown(name)}: {shown(end)} is no joint of the tree")
            return a, b
    raise InputError(f"nearer {shown(name)}: there is no such segment; {meant(name, segments)}")


@dataclass(frozen=True, kw_only=True)
class Chord(Check):
    """The length of a segment that lifts nothing: its loop closes where it is right."""

    places: tuple[Place, ...]
    points: tuple[int, ...]
    length: float
    tolerance: float
    name: str = "closure"
    unit: str = "m"

    def judge(self, points: Array) -> Findings:
        """Compare the distance with the segment's length; see `posekit.tree.Check`."""
        value = np.linalg.norm(points[:, 0] - points[:, 1], axis=-1)[:, None]
        return Findings(
            value=value,
            lower=np.array([self.length]),
            upper=np.array([self.length]),
            tolerance=self.tolerance,
        )


@dataclass(frozen=True, kw_only=True)
class MiddleOfEnds(Check):
    """The distance of a midpoint from the middle of its ends.

    The image of the midpoint is the middle of theirs, so that only the depth can be off: not at all, or by the whole
    foreshortening where the two halves were flipped apart.
    """

    places: tuple[Place, ...]
    points: tuple[int, ...]
    length: float
    name: str = "midpoint"
    unit: str = "m"

    def judge(self, points: Array) -> Findings:
        """Compare the midpoint with the middle; see `posekit.tree.Check`."""
        middle, a, b = np.moveaxis(points, 1, 0)
        value = np.linalg.norm(middle - (a + b) / 2, axis=-1)[:, None]
        # A half whose two ends coincide counts once where the whole may still be two, about this much apart.
        upper = 10 * COINCIDENT_METRES * max(1.0, self.length)
        return Findings(value=value, lower=np.array([-np.inf]), upper=np.array([upper]))


@dataclass(frozen=True, kw_only=True)
class NearerEnd(Check):
    """How much nearer the end is that was said to be nearer."""

    places: tuple[Place, ...]
    points: tuple[int, ...]
    nothing: float
    name: str = "nearer"
    unit: str = "m"

    def judge(self, points: Array) -> Findings:
        """Compare the depths of the two ends; see `posekit.tree.Check`."""
        depth = points[:, 1, 2:] - points[:, 0, 2:]
        value = np.where(np.abs(depth) > self.nothing, depth, np.nan)
        return Findings(value=value, lower=np.array([0.0]), upper=np.array([np.inf]))
