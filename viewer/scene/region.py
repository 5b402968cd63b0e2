"""Where a joint that was not seen can be: the box around all its positions."""

from __future__ import annotations

import meshcat.geometry as mg
import numpy as np

from posekit.formats.own import Inferred
from posekit.geometry import Array
from posekit.viewer.scene.colours import Rgb
from posekit.viewer.scene.scene import Scene
from posekit.viewer.scene.shapes import add_tubes, glow
from posekit.viewer.scene.world import World

UNIT_BOX = mg.Box([1.0, 1.0, 1.0])

MIN_WIDTH_METRES = 0.003
"""Metres that a box is wide at least, half of it on each side: an interval of depth would not be seen."""

SAME_POSITION_METRES = 1e-4
"""Metres: a joint whose positions are no farther apart has one."""

FACE_OPACITY, EDGE_OPACITY, EDGE_RADIUS = 0.08, 0.8, 0.0025
"""Opacity of the box's faces and of its edges, and their radius, metres."""


CORNER_SIGNS: Array = np.array(
    [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64
)


def corners_of(inferred: Inferred, world: World) -> Array:
    """Return the corners (8, 3) of the box that holds all positions of a joint, world, metres."""
    middle, half = (inferred.upper + inferred.lower) / 2, (inferred.upper - inferred.lower) / 2
    return world.place(middle + CORNER_SIGNS * half)


def add_region(
    scene: Scene, path: str, inferred: Inferred, *, world: World, shift: Array, colour: Rgb
) -> None:
    """Draw the box that holds all positions of a joint: ``PATH/faces`` and ``PATH/edges``; nothing of a single point.

    Parameters
    ----------
    scene : Scene
        What the box is added to.
    path : str
        Below ``/meshcat``.
    inferred : Inferred
        Its box lies along the camera's axes.
    world : World
        The frame in which the box stands.
    shift : array (3,)
        Moves the box in the world, metres.
    colour : (r, g, b)
        Of faces and edges, each 0 to 1.
    """
    if np.max(inferred.upper - inferred.lower) < SAME_POSITION_METRES:
        return
    middle = world.place((inferred.upper + inferred.lower) / 2) + shift
    half = np.maximum((inferred.upper - inferred.lower) / 2, MIN_WIDTH_METRES / 2)
    box = np.eye(4)
    box[:3, :3], box[:3, 3] = world.R_world_cam * (2 * half), middle
    scene.meshcat[f"{path}/faces"].set_object(mg.Mesh(UNIT_BOX, glow(colour, FACE_OPACITY)))
    scene.transform(f"/meshcat/{path}/faces", box)
    corners = middle + (CORNER_SIGNS * half) @ world.R_world_cam.T
    pairs = [
        (a, b) for a in range(8) for b in range(a) if np.count_nonzero(CORNER_SIGNS[a] - CORNER_SIGNS[b]) == 1
    ]
    starts, ends = (corners[[pair[k] for pair in pairs]] for k in (0, 1))
    colours = np.tile(np.array(colour), (len(pairs), 1))
    add_tubes(scene, f"{path}/edges", starts, ends, colours, radius=EDGE_RADIUS, opacity=EDGE_OPACITY)
