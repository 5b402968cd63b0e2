"""Left and right: whether they are the wrong way round in a file, and the exchange that puts it right."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.keypoints.keypoints import KeyPoints
from posekit.formats.keypoints.side_body import PICTURES_AROUND
from posekit.formats.keypoints.side_facing import facing, informed, order
from posekit.formats.keypoints.side_flips import LIMB_GROUPS, flips
from posekit.formats.keypoints.side_gait import gait_evidence
from posekit.formats.keypoints.tracking import track
from posekit.formats.skeleton_maps import LANDMARK_INDEX, SkeletonMap
from posekit.geometry import Array, runs
from posekit.safe_io import cut
from posekit.skeleton import other_side

SURE_EVIDENCE: Final = 1.5
"""Evidence from which something is said. Over the walks of the tests, none that is as labelled reaches it."""
FACE_SEEN: Final = 3.0
"""What faces that are seen can say."""
FACE_AWAY_EVIDENCE: Final = 0.7
"""What a face that is not seen says, against one that is."""
EXCHANGED_SHARE: Final = 0.6
"""Of the pictures in which it is clear, for a part to count as exchanged in all."""
MAX_PICTURES_LISTED: Final = 5
"""Names of pictures that are listed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SideCheck:
    """What was found about left and right.

    Parameters
    ----------
    verdict : str
        ``swapped``, ``as labelled``, or ``unknown``: of all pictures together.
    part : str
        What is swapped in all pictures: ``body``, ``arms``, ``legs``, ``arms or legs``, ``body or face``; empty else.
    strength : float
        Positive where it is swapped, negative where it is as labelled; said from `SURE_EVIDENCE` on.
    evidence : mapping
        By kind: what each says, with the same sign.
    arms, legs : bool array (D,)
        The detections whose arms or legs are the other way round than in the pictures around.
    pictures : tuple of str
        The pictures of these.
    source : str
        The file.
    """

    verdict: str
    part: str
    strength: float
    evidence: Mapping[str, float]
    arms: NDArray[np.bool_]
    legs: NDArray[np.bool_]
    pictures: tuple[str, ...]
    source: str

    def __post_init__(self) -> None:
        self.arms.flags.writeable = False
        self.legs.flags.writeable = False

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a user should read, a line each; empty where nothing is suspected."""
        lines = []
        if self.verdict == "swapped":
            why = ", ".join(f"{name} {worth:+.1f}" for name, worth in self.evidence.items() if worth > 0)
            lines.append(
                f"{self.source}: left and right look swapped ({self.part}) in all pictures: {why}; "
                "look at a picture, and exchange them with --swap-sides if so"
            )
        if self.pictures:
            both = int((self.arms & self.legs).sum())
            parts = f"{int(self.arms.sum()) - both} arms, {int(self.legs.sum()) - both} legs, {both} both"
            names = ", ".join(cut(name) for name in self.pictures[:MAX_PICTURES_LISTED])
            lines.append(
                f"{self.source}: left and right jump in {len(self.pictures)} pictures ({parts}): "
                f"{names}{', …' if len(self.pictures) > MAX_PICTURES_LISTED else ''}; leave them out, or look at them"
            )
        return tuple(lines)


def check_sides(keypoints: KeyPoints) -> SideCheck:
    """Look for left and right the wrong way round.

    Pictures whose arms or legs jump are found by `posekit.formats.keypoints.side_flips`, and put right before the
    rest is looked at. What says whether they are swapped in all pictures: parts that are against each other and faces
    that are seen (`posekit.formats.keypoints.side_facing`), and the way somebody walks
    (`posekit.formats.keypoints.side_gait`). Evidence is summed over the people. In a collection of photographs only
    single pictures are looked at, all together.

    Parameters
    ----------
    keypoints : KeyPoints
        Of one person or several; who is not told apart is tracked.

    Returns
    -------
    SideCheck
    """
    tracked = track(keypoints)
    landmarks, confidence = tracked.landmarks, tracked.landmark_confidence
    occluded = tracked.layout.gather(tracked.occluded[..., None].astype(np.float64))[..., 0] > 0
    jumps = {group: np.zeros(len(tracked), dtype=np.bool_) for group in LIMB_GROUPS}
    total: dict[str, float] = {}
    votes = _Votes(informed(landmarks, confidence))
    if not tracked.sequence:
        front = votes.look(landmarks, confidence, occluded, 0)
        return _judged(tracked, jumps, {"face": -front} if front else {}, votes)
    for person in np.unique(tracked.person):
        rows = np.flatnonzero(tracked.person == person)
        rows = rows[np.diff(tracked.frame[rows], prepend=-1) > 0]
        body, frame = landmarks[rows].copy(), tracked.frame[rows]
        for group, found in _jumps(body, frame).items():
            jumps[group][rows] = found
            body[found] = _exchanged(body[found], LIMB_GROUPS[group])
        told = gait_evidence(body, frame)
        front = votes.look(body, confidence[rows], occluded[rows])
        if front:
            told["face"] = front
        for name, worth in told.items():
            total[name] = total.get(name, 0.0) - worth
    return _judged(tracked, jumps, total, votes)


def _jumps(landmarks: Array, frame: NDArray[np.intp]) -> dict[str, NDArray[np.bool_]]:
    """Find the pictures of one person whose arms or legs jump to the other side.

    Arms or legs alone do not, where shoulders and hips agree: exchanged they would be against each other. Somebody who
    turns round between pictures looks as if they did.
    """
    ways = order(landmarks)
    found = {group: flips(landmarks, frame, parts) > 0 for group, parts in LIMB_GROUPS.items()}
    alone = found["arms"] ^ found["legs"]
    for jumped in found.values():
        for start, end in runs(jumped.copy()):
            agreement = (ways.shoulders * ways.hips * alone)[start:end]
            jumped[start:end] = agreement.sum() <= 0
    return found


def _exchanged(landmarks: Array, parts: tuple[str, ...]) -> Array:
    """Exchange left and right of some parts."""
    ends = [LANDMARK_INDEX[f"{side}_{part}"] for side in ("right", "left") for part in parts]
    others = ends[len(parts) :] + ends[: len(parts)]
    exchanged = landmarks.copy()
    exchanged[:, ends] = landmarks[:, others]
    return exchanged


@dataclass
class _Votes:
    """In how many pictures parts are against each other, in how many that is clear, and whether faces tell anything."""

    informed: bool
    twisted: int = 0
    clear: int = 0
    turned: int = 0
    faced: int = 0
    shoulders_alone: int = 0

    def look(
        self, landmarks: Array, confidence: Array, occluded: NDArray[np.bool_], around: int = PICTURES_AROUND
    ) -> float:
        """Count one person's pictures; return what seen faces say, positive where it is as labelled."""
        ways = order(landmarks, around)
        self.twisted += int(ways.twisted.sum())
        self.clear += int((ways.shoulders * ways.hips != 0).sum())
        self.turned += int(ways.turned.sum())
        self.faced += int((ways.shoulders * ways.face != 0).sum())
        self.shoulders_alone += int((ways.twisted & (ways.shoulders * ways.face < 0)).sum())
        if not self.informed:
            return 0.0
        face = facing(landmarks, confidence, occluded).astype(np.float64)
        face[face < 0] *= FACE_AWAY_EVIDENCE
        told = -(face * ways.shoulders)[(face != 0) & (ways.shoulders != 0) & ~ways.twisted]
        return FACE_SEEN * float(told.mean()) if len(told) else 0.0


def _judged(
    tracked: KeyPoints, jumps: dict[str, NDArray[np.bool_]], total: dict[str, float], votes: _Votes
) -> SideCheck:
    strength, part = sum(total.values()), "body"
    if votes.twisted > EXCHANGED_SHARE * votes.clear:
        part = "arms or legs" if not votes.faced else "arms" if votes.shoulders_alone else "legs"
        strength = total["shoulders against hips"] = 3.0 * votes.twisted / votes.clear
    elif votes.turned > EXCHANGED_SHARE * votes.faced:
        part = "body" if strength > SURE_EVIDENCE else "body or face"
        total["face against body"] = 3.0 * votes.turned / votes.faced
        strength = max(strength, total["face against body"])
    verdict = (
        "swapped" if strength > SURE_EVIDENCE else "as labelled" if strength < -SURE_EVIDENCE else "unknown"
    )
    suspected = np.flatnonzero(jumps["arms"] | jumps["legs"])
    return SideCheck(
        verdict=verdict,
        part=part if verdict == "swapped" else "",
        strength=float(strength),
        evidence=MappingProxyType(dict(sorted(total.items(), key=lambda one: -abs(one[1])))),
        arms=jumps["arms"],
        legs=jumps["legs"],
        pictures=tuple(tracked.pictures[int(k)] for k in np.unique(tracked.frame[suspected])),
        source=tracked.source,
    )


def swap(keypoints: KeyPoints) -> KeyPoints:
    """Exchange left and right.

    Points change places, so that whatever is written afterwards has them right: each landmark's with those of the other
    side (`SkeletonMap.swapped`), and points that are no landmark by their names (``left_heel``, ``LHeel``).

    Returns
    -------
    KeyPoints
        Twice exchanged is as before.
    """
    partner = _partners(keypoints.layout)
    if partner is None:
        return replace(keypoints, layout=keypoints.layout.swapped())
    return replace(
        keypoints,
        points=keypoints.points[:, partner],
        confidence=keypoints.confidence[:, partner],
        occluded=keypoints.occluded[:, partner],
    )


def _partners(layout: SkeletonMap) -> NDArray[np.intp] | None:
    """Return for each point the place of its opposite; None where the sides have not as many points."""
    place = {name: k for k, name in enumerate(layout.points)}
    partner: NDArray[np.intp] = np.arange(len(layout.points))
    for name, k in place.items():
        opposite = _opposite(name)
        if opposite in place:
            partner[k] = place[opposite]
    swapped = layout.swapped().landmarks
    for landmark, parts in layout.landmarks.items():
        others = swapped.get(landmark, ())
        if other_side(landmark) != landmark and len(parts) != len(others):
            return None
        if other_side(landmark) != landmark:
            for part, other in zip(parts, others, strict=True):
                partner[place[part]] = place[other]
    return partner if (partner[partner] == np.arange(len(partner))).all() else None


def _opposite(name: str) -> str:
    """Name a point's opposite by the ways in which formats write sides; the name itself where it has none."""
    exchanged = re.sub(
        r"left|right|Left|Right|LEFT|RIGHT",
        lambda side: {
            "left": "right",
            "right": "left",
            "Left": "Right",
            "Right": "Left",
            "LEFT": "RIGHT",
            "RIGHT": "LEFT",
        }[side[0]],
        name,
    )
    if exchanged == name and re.match(r"[LR][A-Z]|[lr]_", name):
        return {"L": "R", "R": "L", "l": "r", "r": "l"}[name[0]] + name[1:]
    return exchanged
