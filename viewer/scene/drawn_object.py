"""A recovered object as it is drawn: its joints as balls, its rigid segments as tubes, each in its own colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import meshcat.geometry as mg
import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError, ViewerError
from posekit.formats.own.object_result import ObjectResult
from posekit.geometry import Array
from posekit.viewer.scene.colours import GROUP_RGB, rgb
from posekit.viewer.scene.compose import MAX_POSTURES_DRAWN, Composition, Style, side_by_side
from posekit.viewer.scene.drawn_subject import Shown
from posekit.viewer.scene.scene import Scene
from posekit.viewer.scene.shapes import UNIT_BALL, add_ball, add_tubes, glow, matte
from posekit.viewer.scene.stage import add_stage
from posekit.viewer.scene.world import World

LEAST_METRES, MOST_METRES = 0.3, 5.0
"""Metres across: what is smaller or larger, or in its own unit, is drawn a metre large, without the ground's grid."""

JOINT_SHARE, SEGMENT_SHARE = 0.022, 0.010
"""Radii of joints and segments, of the object's extent."""

OBJECT_JOINT_RGB: Final = rgb("#303030")


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnObject:
    """All frames of an object, and which of its points are joined.

    Parameters
    ----------
    segments : int array (S, 2)
        The points at the ends of each rigid segment.
    frames : sequence of Shown
        Points (N, P, 3) of each frame, camera frame, as large as they are drawn; those whose robot is known to reach
        them first.
    rows : sequence of int arrays (N,)
        The number in the file of each posture of each frame.
    extent : float
        How large the object is as it is drawn, metres.
    to_scale : bool
        Whether a metre of the drawing is one of the object's.
    """

    segments: NDArray[np.intp]
    frames: Sequence[Shown]
    rows: Sequence[NDArray[np.intp]]
    extent: float
    to_scale: bool
    R_cam_world: Array | None = None

    @staticmethod
    def of(result: ObjectResult) -> DrawnObject:
        """Gather what is to be drawn of a result.

        Postures of several scales are at different places of the camera's frame, which mean nothing: the middle of
        each is put where the first one's is.

        Raises
        ------
        ViewerError
            Where no frame has a posture.
        """
        rows = [
            np.argsort([verdict is not True for verdict in one.certified], kind="stable")
            for one in result.frames
        ]
        placed = [_in_place(one.points[row]) for one, row in zip(result.frames, rows, strict=True)]
        known = np.concatenate([one.reshape(-1, 3) for one in placed])
        known = known[np.isfinite(known).all(axis=1)]
        if not len(known):
            raise ViewerError(
                "there is no posture in any frame; nothing can be drawn; was everything rejected?"
            )
        extent = float(np.ptp(known, axis=0).max())
        to_scale = result.unit is not None and LEAST_METRES <= extent <= MOST_METRES
        larger = 1.0 if to_scale or extent == 0 else 1.0 / extent
        names = list(result.points)
        drawn = [ends for ends in result.segments if set(ends) <= set(names)]  # not between middles of points
        return DrawnObject(
            segments=np.array([[names.index(a), names.index(b)] for a, b in drawn], dtype=np.intp).reshape(
                -1, 2
            ),
            frames=[
                Shown(points=larger * points, time=frame.time)
                for points, frame in zip(placed, result.frames, strict=True)
            ],
            rows=rows,
            extent=extent * larger,
            to_scale=to_scale,
        )

    def chosen(self, posture: str, frame: int, most: int) -> Shown:
        """Choose postures of a frame: a list of numbers from 0, ``all``, or as many as there are, at most `most`.

        Raises
        ------
        InputError
            Where the frame has no such posture.
        """
        shown, rows = self.frames[frame], self.rows[frame].tolist()
        if posture in ("", "all"):
            return shown.chosen(range(len(shown) if posture else min(len(shown), most)))
        if posture == "likeliest":
            return shown.chosen(range(min(len(shown), 1)))
        numbers = posture.split(",")
        for number in numbers:
            if not number.isdecimal() or int(number) not in rows:
                raise InputError(
                    f"--posture: {number!r}; expected all, or numbers from 0 to {len(rows) - 1}, as frame {frame} has; "
                    "objects have no probabilities, groups or paths"
                )
        return shown.chosen([rows.index(int(number)) for number in numbers])


def add_object(scene: Scene, name: str, points: Array, subject: DrawnObject) -> None:
    """Draw an object's points (P, 3), world, metres, below ``/meshcat/NAME``."""
    colours = np.array([GROUP_RGB[k % len(GROUP_RGB)] for k in range(len(subject.segments))])
    starts, ends = points[subject.segments[:, 0]], points[subject.segments[:, 1]]
    add_tubes(scene, f"{name}/segments", starts, ends, colours, radius=SEGMENT_SHARE * subject.extent)
    for k, point in enumerate(points):
        add_ball(scene, f"{name}/joint-{k}", point, JOINT_SHARE * subject.extent, matte(OBJECT_JOINT_RGB))


def add_slot(scene: Scene, name: str, subject: DrawnObject) -> None:
    """Add balls and cylinders of the unit's size below ``/meshcat/NAME``, for a page to put in place."""
    for k in range(len(subject.segments)):
        colour = glow(GROUP_RGB[k % len(GROUP_RGB)])
        scene.meshcat[f"{name}/segment-{k}"].set_object(mg.Cylinder(1.0, 1.0), colour)
    for k in range(subject.frames[0].points.shape[1]):
        scene.meshcat[f"{name}/joint-{k}"].set_object(UNIT_BALL, matte(OBJECT_JOINT_RGB))


def compose_object(
    shown: Shown, subject: DrawnObject, *, world: World, style: Style, stage: Array | None = None
) -> Composition:
    """Draw one frame's postures, as `posekit.viewer.scene.compose.compose` does a person's.

    Raises
    ------
    ViewerError
        Where there are more than 200 postures.
    """
    if len(shown) > MAX_POSTURES_DRAWN:
        raise ViewerError(
            f"{len(shown)} postures in one picture; expected at most {MAX_POSTURES_DRAWN}; choose some, "
            "as --posture 0,5,7"
        )
    scene, placed = Scene(), world.place(shown.points)
    if style.layout == "side-by-side" and len(shown) > 1:
        placed = placed + side_by_side(placed, world, style.azimuth)[:, None]
    for k, points in enumerate(placed):
        add_object(scene, f"posture-{k}", points, subject)
    drawn = placed.reshape(-1, 3)
    ground = style.ground and subject.to_scale
    add_stage(scene, drawn if stage is None else stage, background=style.background, ground=ground)
    return Composition(scene=scene, points=drawn)


def _in_place(points: Array) -> Array:
    """Put the middle of postures (N, P, 3) where the first one's is."""
    if not len(points):
        return points
    middle = np.nanmean(points, axis=1, keepdims=True)
    return np.asarray(points - middle + middle[:1])
