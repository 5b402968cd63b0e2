"""Compose a picture: postures side by side or superposed, the camera, the ground."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from posekit.body import Figure
from posekit.errors import ViewerError
from posekit.geometry import Array
from posekit.skeleton import JOINT, PARENTS, POINTS
from posekit.viewer.scene.colours import GROUP_RGB
from posekit.viewer.scene.culprit import Culprit, culprit
from posekit.viewer.scene.drawn_posture import DrawnPosture, Look, add_posture
from posekit.viewer.scene.drawn_subject import Shown
from posekit.viewer.scene.framing import sight_axes
from posekit.viewer.scene.image_sight import add_sight
from posekit.viewer.scene.region import corners_of
from posekit.viewer.scene.scene import Scene
from posekit.viewer.scene.stage import add_mat, add_stage
from posekit.viewer.scene.superposed import superposed_looks
from posekit.viewer.scene.world import World

SCENE_LAYOUTS: Final = ("side-by-side", "superposed")
MAX_POSTURES_DRAWN: Final = 200
"""Postures in one picture: more are neither drawn quickly nor told apart."""

BODY_GAP_METRES = 0.25
"""Metres between two bodies side by side."""

ROW_GAP, ONE_ROW = 1.3, 7
"""Metres between two rows, and how many stand in one."""

NEAR_CAMERA = 7.0
"""Metres: a camera that is farther from the postures is left out of the picture's frame."""


@dataclass(frozen=True, kw_only=True)
class Style:
    """How a picture is composed.

    Parameters
    ----------
    layout : {"side-by-side", "superposed"}
        Whether several postures stand beside each other or in each other.
    look : Look, optional
        Of the bodies; by default translucent.
    background : str
        See `posekit.viewer.scene.stage.background_colour`.
    azimuth : float
        Degrees: those side by side stand in rows across the sight of one who looks from there.
    camera, ground : bool
        Whether the camera with its rays, and the ground's grid, are drawn. Side by side there is no camera:
        its rays go to one place.
    """

    layout: str = "side-by-side"
    look: Look | None = None
    background: str = "white"
    azimuth: float = 0.0
    camera: bool = True
    ground: bool = True

    def __post_init__(self) -> None:
        if self.layout not in SCENE_LAYOUTS:
            raise ViewerError(f"layout: {self.layout!r}; expected {' or '.join(SCENE_LAYOUTS)}")


@dataclass(frozen=True, kw_only=True, eq=False)
class Composition:
    """A scene, and the points (M, 3), world, metres, that should be in its picture."""

    scene: Scene
    points: Array


def compose(
    shown: Shown, *, figure: Figure, world: World, style: Style, stage: Array | None = None
) -> Composition:
    """Draw one frame's postures.

    Parameters
    ----------
    shown : Shown
        One posture or more; those without any known joint are left out.
    figure : Figure
        Whose capsules are drawn.
    world : World
        The frame in which they stand.
    style : Style
        What superposed bodies have in common is drawn once. Where they are of several groups, what is one
        group's alone has its colour and what several share is grey; else all has its side's colour. Side by
        side each stands on a mat of its group's colour.
    stage : array (M, 3), optional
        Points, world, that the ground shall reach under: a sequence keeps its ground.

    Raises
    ------
    ViewerError
        Where nothing is known of any posture, or there are more than 200.
    """
    if len(shown) > MAX_POSTURES_DRAWN:
        raise ViewerError(
            f"{len(shown)} postures in one picture; expected at most {MAX_POSTURES_DRAWN}; choose some, "
            "as --posture 0,5,7 or --posture groups"
        )
    known = [k for k in range(len(shown)) if np.isfinite(shown.points[k]).all(axis=1).any()]
    if not known:
        raise ViewerError(
            "no joint of the postures is known (all are NaN); expected at least one posture to draw"
        )
    scene = Scene()
    apart = style.layout == "side-by-side" and len(known) > 1
    drawn_ones = shown.chosen(known)
    shifts = drawn_ones.alignment @ world.R_world_cam.T
    if apart:
        shifts = shifts + side_by_side(world.place(drawn_ones.aligned_points), world, style.azimuth)
    together = len(known) > 1 and not apart and style.look is None
    looks = superposed_looks(drawn_ones, figure) if together else [style.look or Look()] * len(known)
    drawn = []
    for k, shift, look in zip(known, shifts, looks, strict=True):
        points = shown.points[k]
        found = _visible(culprit(shown.reasons[k]), points) if shown.reasons else Culprit()
        add_posture(
            scene,
            f"posture-{k}",
            DrawnPosture(
                points=points,
                q=None if shown.q is None else shown.q[k],
                culprit=found,
                inferred=shown.inferred[k] if shown.inferred else {},
                shift=shift,
            ),
            figure=figure,
            world=world,
            look=look,
        )
        body = world.place(points) + shift
        regions = shown.inferred[k].values() if shown.inferred else ()
        drawn += [body, *(corners_of(one, world) + shift for one in regions)]
        if apart and shown.groups is not None:
            mat = add_mat(scene, f"posture-{k}/mat", body, GROUP_RGB[int(shown.groups[k]) % len(GROUP_RGB)])
            drawn.append(mat)
    bodies = np.concatenate(drawn)
    points = bodies
    if style.camera and drawn_ones.sight is not None and not apart:
        camera = add_sight(scene, drawn_ones.sight, world=world, points=drawn_ones.points)
        if np.nanmin(np.linalg.norm(bodies[:, None] - camera, axis=-1)) < NEAR_CAMERA:
            points = np.concatenate([bodies, camera])
    add_stage(scene, points if stage is None else stage, background=style.background, ground=style.ground)
    return Composition(scene=scene, points=points)


def _visible(found: Culprit, points: Array) -> Culprit:
    """Point at the parent of a joint that has no place: no ray reaches it, or the branch ended before."""
    joints = []
    for name in found.joints:
        joint = JOINT[name]
        while joint > 0 and not np.isfinite(points[joint]).all():
            joint = PARENTS[joint]
        joints.append(POINTS[joint])
    return Culprit(links=found.links, joints=tuple(dict.fromkeys(joints)))


def side_by_side(placed: Array, world: World, azimuth: float) -> Array:
    """Return where the postures (N, K, 3) go side by side (N, 3): in rows, from the left, from the front."""
    count = len(placed)
    right, ahead = sight_axes(world, azimuth)
    rows = row_count(count)
    columns = int(np.ceil(count / rows))
    widest, deepest = (
        _extent(placed @ axis) + gap for axis, gap in ((right, BODY_GAP_METRES), (ahead, ROW_GAP))
    )
    k = np.arange(count)
    across = (k % columns - (columns - 1) / 2) * widest
    back = (k // columns - (rows - 1) / 2) * deepest
    return np.asarray(across[:, None] * right + back[:, None] * ahead)


def row_count(count: int) -> int:
    """Return in how many rows that many postures stand side by side."""
    return 1 if count <= ONE_ROW else int(np.ceil(count / np.ceil(np.sqrt(2.2 * count))))


def _extent(values: Iterable[Array]) -> float:
    """Return the largest extent of any posture along an axis, from values (N, K), metres."""
    return max(float(np.nanmax(row) - np.nanmin(row)) for row in values if np.isfinite(row).any())
