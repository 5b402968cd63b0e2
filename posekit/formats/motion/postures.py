"""From named points to postures: the 14 joints and 5 head points, by a skeleton map; what is not there is derived.

Many files have shoulders and hips and neither the neck's joint nor the pelvis'. Both are placed as the figure's own
torso says, scaled to the person: the pelvis on the line from the middle of the shoulders to the middle of the hips, at
the figure's fraction; the neck in the frame of shoulders and pelvis. A torso so laid is never its mirror image.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from posekit.body import Figure, load_figure
from posekit.body.frames import hips_frame
from posekit.body.lengths import hips_points, torso_points
from posekit.errors import InputError
from posekit.formats.motion.motion import Motion
from posekit.formats.skeleton_maps import (
    LANDMARK_INDEX,
    SkeletonMap,
    find_by_names,
    load_skeleton_map,
    skeleton_map_names,
)
from posekit.formats.skeleton_maps.find import LIMB_LANDMARKS
from posekit.formats.skeleton_maps.skeleton_map import plain
from posekit.geometry import Array
from posekit.safe_io import cut, nearest, refusal
from posekit.skeleton import JOINT, JOINTS, POINTS

DERIVED_JOINTS = ("pelvis", "neck")
"""What can be placed from shoulders and hips."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionPostures:
    """Postures of a motion.

    Parameters
    ----------
    joints : array (T, 14, 3)
        In tree order, metres; NaN where a joint is not known.
    head : array (T, 5, 3)
        The head's points in the order of `posekit.skeleton.HEAD_POINTS`, metres.
    landmarks : array (T, 21, 3)
        As the map has them, nothing derived, in the order of `posekit.formats.skeleton_maps.LANDMARK_ORDER`, metres.
    derived : tuple of str
        The joints that no point of the file is, placed from shoulders and hips.
    layout : SkeletonMap
        The map.
    feet : array (T, 4, 3)
        Toes and heels in the order of `posekit.skeleton.FEET_POINTS`, metres; NaN where the file has none.
    """

    joints: Array
    head: Array
    landmarks: Array
    derived: tuple[str, ...]
    layout: SkeletonMap
    feet: Array

    def __post_init__(self) -> None:
        for array in (self.joints, self.head, self.landmarks, self.feet):
            array.flags.writeable = False


def postures_of(
    motion: Motion, layout: SkeletonMap | None = None, figure: Figure | None = None
) -> MotionPostures:
    """Find the joints among a motion's points.

    Parameters
    ----------
    motion : Motion
        Named points over time.
    layout : SkeletonMap, optional
        What the points are; by their names if not given, see `layout_of`.
    figure : Figure, optional
        Whose torso places neck and pelvis; the built-in one, scaled to the length of the person's spine, if not given.

    Raises
    ------
    InputError
        Where no map fits the names (the nearest one is named, and what it lacks), or two that differ fit alike.
    """
    layout = layout or layout_of(motion.names, motion.source)
    landmarks = layout.gather(motion.points, motion.names)
    if not np.isfinite(landmarks).any():
        expected = f"some of {cut(', '.join(layout.needed))}"
        remedy = "choose another map, or check the names"
        raise refusal(motion.source, "points", f"no point of the map {layout.name}", expected, remedy)
    points = landmarks[:, : len(POINTS)].copy()
    placed = {
        name
        for name, parts in layout.landmarks.items()
        if {plain(part) for part in parts} <= _plain(motion.names)
    }
    derived = tuple(name for name in DERIVED_JOINTS if name not in placed)
    if derived:
        torso = _Torso.of(figure, landmarks)
        if "pelvis" in derived:
            points[:, JOINT["pelvis"]] = torso.pelvis(landmarks)
        if "neck" in derived:
            points[:, JOINT["neck"]] = torso.neck(landmarks, points[:, JOINT["pelvis"]])
    return MotionPostures(
        joints=points[:, : len(JOINTS)],
        head=points[:, len(JOINTS) :],
        landmarks=landmarks,
        derived=derived,
        layout=layout,
        feet=layout.gather_feet(motion.points, motion.names),
    )


def layout_of(names: Sequence[str], source: str = "motion") -> SkeletonMap:
    """Find the map of a file's names.

    It is the one made for just these points; else the one whose names are the file's to the letter (``RHip`` is not
    ``r_hip``, whose neck may be another); else the one that places most landmarks, the maps of
    files that name their points before those of detectors.

    Raises
    ------
    InputError
        Where none fits, or two that take different points fit alike.
    """
    fitting = find_by_names(names)
    if not fitting:
        raise _none_fits(names, source)
    there, verbatim = _plain(names), set(names)

    def rank(one: SkeletonMap) -> tuple[bool, int, int, bool]:
        same = bool(one.points) and _plain(one.points) == there
        as_written = sum(set(one.landmarks[limb]) <= verbatim for limb in LIMB_LANDMARKS)
        return same, as_written, len(_sources(one, there)), not one.points

    best, *others = sorted(fitting, key=rank, reverse=True)
    for other in others:
        alike = rank(other) == rank(best) and not rank(best)[0]
        if alike and _sources(other, there) != _sources(best, there):
            got = f"names that fit the skeleton maps {best.name} and {other.name} alike"
            raise refusal(source, "points", got, "one of them", "say which with --skeleton")
    return best


def _sources(one: SkeletonMap, there: set[str]) -> dict[str, frozenset[str]]:
    placed = {**one.landmarks, **one.feet}
    found = {name: frozenset(plain(part) for part in parts) for name, parts in placed.items()}
    return {name: parts for name, parts in found.items() if parts <= there}


def _none_fits(names: Sequence[str], source: str) -> InputError:
    """Name the map that lacks least, and what it lacks."""
    there = _plain(names)
    best: tuple[SkeletonMap, list[str]] | None = None
    for one in map(load_skeleton_map, skeleton_map_names()):
        lacking = [
            name
            for name in LIMB_LANDMARKS
            if not {plain(part) for part in one.landmarks.get(name, ("\0",))} <= there
        ]
        if best is None or len(lacking) < len(best[1]):
            best = one, lacking
    if best is None or len(best[1]) == len(LIMB_LANDMARKS):
        maps = ", ".join(skeleton_map_names())
        remedy = "write a map and name it (--skeleton)"
        return refusal(source, "points", cut(", ".join(names)), f"names of one of the maps {maps}", remedy)
    layout, lacking = best
    part = layout.landmarks[lacking[0]][0]
    near = nearest(part, names)
    hint = f"; {near}" if near.startswith("did") else ""
    got = f"no {', no '.join(lacking)} by the map {layout.name}, which has most of the names{hint}"
    expected = f"{cut(', '.join(layout.landmarks[lacking[0]]))} for {lacking[0]}, and so on"
    remedy = "rename the points, or name a map of your own (--skeleton)"
    return refusal(source, "points", got, expected, remedy)


def _plain(names: Sequence[str]) -> set[str]:
    return {plain(name) for name in names}


@dataclass(frozen=True, kw_only=True, eq=False)
class _Torso:
    """Where a figure's torso has pelvis and neck, seen from its shoulders and hips."""

    fraction: float
    """Where the pelvis lies on the spine: 0 at the shoulders, 1 at the hips."""
    offset: Array
    """The neck (3,) from the middle of the shoulders, in the frame of shoulders and pelvis, metres."""

    @classmethod
    def of(cls, figure: Figure | None, landmarks: Array) -> _Torso:
        """Take a figure's torso, or the built-in one's in the size of the person's spine."""
        lengths = (figure or load_figure()).lengths
        neck, right, left, pelvis = torso_points(lengths)
        origin, right_hip, left_hip = hips_points(lengths)
        above = float(np.linalg.norm((right + left) / 2 - pelvis))
        below = float(np.linalg.norm((right_hip + left_hip) / 2 - origin))
        frame = hips_frame(pelvis, right, left)
        offset = frame.T @ (neck - (right + left) / 2)
        scale = 1.0
        if figure is None:
            spine = np.linalg.norm(_at(landmarks, "mid_shoulders") - _at(landmarks, "mid_hips"), axis=-1)
            known = spine[np.isfinite(spine)]
            scale = float(np.median(known)) / (above + below) if len(known) else 1.0
        return cls(fraction=above / (above + below), offset=scale * offset)

    def pelvis(self, landmarks: Array) -> Array:
        """Place the pelvis (T, 3)."""
        shoulders, hips = _at(landmarks, "mid_shoulders"), _at(landmarks, "mid_hips")
        return np.asarray(shoulders + self.fraction * (hips - shoulders))

    def neck(self, landmarks: Array, pelvis: Array) -> Array:
        """Place the neck (T, 3) above a pelvis (T, 3)."""
        frame = hips_frame(pelvis, _at(landmarks, "right_shoulder"), _at(landmarks, "left_shoulder"))
        return np.asarray(_at(landmarks, "mid_shoulders") + np.einsum("nij,j->ni", frame, self.offset))


def _at(landmarks: Array, name: str) -> Array:
    """Return a landmark (T, 3); a girdle's middle from its two joints, where they are known."""
    if name not in ("mid_shoulders", "mid_hips"):
        return landmarks[:, LANDMARK_INDEX[name]]
    joint = name.removeprefix("mid_").removesuffix("s")
    middle = (
        landmarks[:, LANDMARK_INDEX[f"right_{joint}"]] + landmarks[:, LANDMARK_INDEX[f"left_{joint}"]]
    ) / 2
    return np.where(np.isnan(middle), landmarks[:, LANDMARK_INDEX[name]], middle)
