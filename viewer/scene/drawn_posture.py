"""A posture as a body: Pinocchio's capsules, the joints, the bones and the head."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
import pinocchio as pin

from posekit.body import Figure, with_head
from posekit.body.capsules import Capsule
from posekit.errors import ViewerError
from posekit.formats.own import Inferred
from posekit.geometry import Array, cross
from posekit.skeleton import HEAD, JOINTS, POINTS, TREE_SEGMENTS
from posekit.viewer.scene.colours import ALARM_RGB, POINT_SIDES, SIDE_RGB, Rgb, number, side
from posekit.viewer.scene.culprit import Culprit
from posekit.viewer.scene.region import add_region
from posekit.viewer.scene.scene import Scene
from posekit.viewer.scene.shapes import add_ball, add_tubes, glow, matte, smooth
from posekit.viewer.scene.world import World

SAME_POSTURE_METRES = 1e-6
"""Metres within which forward kinematics must give a posture back for its bodies to be drawn by q."""

JOINT_RADIUS, HEAD_POINT_RADIUS, BONE_RADIUS, HALO_RATIO = 0.032, 0.013, 0.010, 2.2
"""Metres; a halo is that many times the joint it surrounds."""

HEAD_OPACITY = 0.45
"""Through which nose, eyes and ears are seen: they tell where the head looks."""

FADED_OPACITY = 0.25
"""Opacity of the rest of a body, where something in it is to be pointed at."""

HOLLOW_OPACITY = 0.35
"""Opacity of joints that were not seen, and of bones that end in one."""


@dataclass(frozen=True, kw_only=True)
class Look:
    """How a body is drawn.

    Parameters
    ----------
    body : mapping of str to (r, g, b)
        Colours of capsules, by link; of the others each has its side's: right orange, left blue, torso grey.
    opacity : float
        Of the capsules; joints and bones show through those that are translucent.
    bodies, joints, bones : bool
        What is drawn of capsules, joint balls (with the head's points), and lines between joints.
    without : set of str
        What is left out: capsules by their link, balls by their joint, bones as ``bone-JOINT`` by their end.
    """

    body: Mapping[str, Rgb] = field(default_factory=dict)
    opacity: float = 0.55
    bodies: bool = True
    joints: bool = True
    bones: bool = True
    without: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        if not 0 < self.opacity <= 1:
            raise ViewerError(f"opacity is {self.opacity:g}; expected more than 0 and at most 1")


TRANSLUCENT_LOOK = Look()


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnPosture:
    """One posture that is to be drawn.

    Parameters
    ----------
    points : array (14, 3) or (19, 3)
        Joints, and the head's points where they are known; OpenCV camera frame, metres; NaN where unknown.
    q : array (nq,), optional
        The posture's configuration in the camera's frame; it is calculated where it is not given.
    culprit : Culprit
        What to point at: drawn in the alarm's colour, the joints with a halo, the rest of the body faded.
    inferred : mapping of str to Inferred
        The joints that were not seen, and where they can be.
    shift : array (3,), optional
        Moves the body in the world, metres.
    """

    points: Array
    q: Array | None = None
    culprit: Culprit = field(default_factory=Culprit)
    inferred: Mapping[str, Inferred] = field(default_factory=dict)
    shift: Array | None = None


def add_posture(
    scene: Scene,
    name: str,
    posture: DrawnPosture,
    *,
    figure: Figure,
    world: World,
    look: Look = TRANSLUCENT_LOOK,
) -> None:
    """Draw one posture below ``/meshcat/NAME``: ``bodies/LINK``, ``joints/JOINT``, ``head/POINT``, ``bones``.

    Joints that were not seen are translucent, with the box of all their positions below ``regions/JOINT``.

    The capsules are those that Pinocchio's `MeshcatVisualizer` shows at q. Where q does not give the posture
    back to 1 µm (a measured or a rejected one) they are laid along the posture's own segments, which is what
    the collision check judges. What is not known is not drawn.

    Parameters
    ----------
    scene : Scene
        What the posture is added to.
    name : str
        A path may have several parts: ``frame-0/survivor-3``.
    posture : DrawnPosture
        The posture, and what is to be shown of it.
    figure : Figure
        Whose capsules.
    world : World
        Where the posture stands.
    look : Look
        What is drawn, and in which colours.

    Raises
    ------
    ViewerError
        Where no joint is known.
    """
    points = with_head(np.asarray(posture.points, dtype=np.float64)[None])[0]
    if not np.isfinite(points[: len(JOINTS)]).all(axis=1).any():
        raise ViewerError(f"{name}: no joint of the posture is known (all are NaN); expected at least one")
    shift = np.zeros(3) if posture.shift is None else posture.shift
    links, joints, inferred = posture.culprit.links, posture.culprit.joints, posture.inferred
    placed = world.place(points) + shift
    scene.transform(f"/meshcat/{name}", np.eye(4))
    guessed = {index for index, point in enumerate(POINTS) if point in inferred}
    pointed = bool(links or joints)
    opacity = min(look.opacity, FADED_OPACITY) if pointed else look.opacity
    if look.bodies:
        colours = {
            capsule: (*ALARM_RGB, 1.0)
            if capsule.link in links
            else (
                *look.body.get(capsule.link, SIDE_RGB[side(capsule.link)]),
                min(_opacity(capsule.link, opacity), FADED_OPACITY if guessed & set(capsule.points) else 1.0),
            )
            for capsule in figure.capsules
            if capsule.link not in look.without
        }
        T_world_cam = world.T_world_cam
        T_world_cam[:3, 3] += shift
        _add_capsules(
            scene, name, points, figure=figure, colours=colours, q=posture.q, T_world_cam=T_world_cam
        )
    if look.joints:
        for index, point in enumerate(POINTS):
            if point in look.without:
                continue
            opacity = HOLLOW_OPACITY if index in guessed else 1.0
            in_head = index in HEAD
            _add_joint(
                scene, name, point, placed[index], in_head=in_head, alarm=point in joints, opacity=opacity
            )
            if point in inferred:
                path, colour = f"{name}/regions/{point}", SIDE_RGB[side(point)]
                add_region(scene, path, inferred[point], world=world, shift=shift, colour=colour)
    if look.bones:
        for hollow in (False, True):
            chosen = [
                pair
                for pair in TREE_SEGMENTS
                if f"bone-{POINTS[pair[1]]}" not in look.without and bool(guessed & set(pair)) is hollow
            ]
            _add_bones(scene, f"{name}/bones{'-inferred' if hollow else ''}", placed, chosen, hollow=hollow)


def _add_bones(
    scene: Scene, path: str, placed: Array, chosen: Sequence[tuple[int, int]], *, hollow: bool
) -> None:
    pairs = np.array(chosen, dtype=np.intp).reshape(-1, 2)
    shades = np.array([SIDE_RGB[POINT_SIDES[child]] for _, child in chosen]).reshape(-1, 3)
    starts, ends = placed[pairs[:, 0]], placed[pairs[:, 1]]
    opacity = HOLLOW_OPACITY if hollow else 1.0
    add_tubes(scene, path, starts, ends, shades, radius=BONE_RADIUS, opacity=opacity)


def _add_joint(
    scene: Scene, name: str, point: str, middle: Array, *, in_head: bool, alarm: bool, opacity: float = 1.0
) -> None:
    if not np.isfinite(middle).all():
        return
    colour = ALARM_RGB if alarm else SIDE_RGB[side(point)]
    if in_head:
        add_ball(scene, f"{name}/head/{point}", middle, HEAD_POINT_RADIUS, matte(colour))
        return
    add_ball(scene, f"{name}/joints/{point}", middle, JOINT_RADIUS, matte(colour, opacity))
    if alarm:
        add_ball(scene, f"{name}/halos/{point}", middle, HALO_RATIO * JOINT_RADIUS, glow(ALARM_RGB, 0.35))


def _add_capsules(
    scene: Scene,
    name: str,
    points: Array,
    *,
    figure: Figure,
    colours: Mapping[Capsule, tuple[float, float, float, float]],
    q: Array | None,
    T_world_cam: Array,
) -> None:
    q = figure.inverse_kinematics(points[None])[0] if q is None else np.asarray(q, dtype=np.float64)
    bodies = _bodies(figure)
    T_cam_link = bodies.display(q) if _gives_back(figure, q, points) else {}
    for capsule, colour in colours.items():
        T = T_cam_link.get(capsule.link)
        if T is None:
            T = _laid(capsule, points)
        if np.isfinite(T).all():
            path = f"/meshcat/{name}/bodies/{capsule.link}"
            scene.adopt(bodies.scene, bodies.path(capsule.link), path)
            scene.recolour(path, number(colour[:3]), colour[3])
            scene.transform(path, T_world_cam @ T)


def _opacity(link: str, opacity: float) -> float:
    return min(opacity, HEAD_OPACITY) if link == "head" else opacity


def _gives_back(figure: Figure, q: Array, points: Array) -> bool:
    if not np.isfinite(q[:7]).all():
        return False
    seen = np.isfinite(points).all(axis=1)
    gap = np.linalg.norm(figure.forward_kinematics(q[None])[0] - points, axis=1)[seen]
    return bool((gap < SAME_POSTURE_METRES).all())


def _laid(capsule: Capsule, points: Array) -> Array:
    """Lay a capsule along the posture's own points: T_cam_capsule (4, 4), its axis along z."""
    middle, axis = capsule.place(points[None, list(capsule.points)])
    T = np.eye(4)
    T[:3, 3], z = middle[0], axis[0]
    x = cross(np.eye(3)[np.argmin(np.abs(z))], z)
    x = x / np.linalg.norm(x)
    T[:3, :3] = np.stack([x, cross(z, x), z], axis=1)
    return T


class _Bodies:
    """The figure in Pinocchio's `MeshcatVisualizer`, which draws into a scene of its own."""

    def __init__(self, figure: Figure) -> None:
        # It loads all that Pinocchio can draw with, for most of a second: pages and plots need none of it.
        from pinocchio.visualize import MeshcatVisualizer

        self.scene = Scene()
        links = figure.model.frames
        self.names = {links[body.parentFrame].name: body.name for body in figure.geometry.geometryObjects}
        self.visualizer = MeshcatVisualizer(figure.model, pin.GeometryModel(), figure.geometry)
        self.visualizer.initViewer(viewer=self.scene.meshcat)
        self.visualizer.loadViewerModel(rootNodeName="body")
        for capsule in figure.capsules:
            drawn = self.scene.nodes[self.path(capsule.link)].object or {}
            smooth(self.scene.geometries[drawn["geometry"]], capsule.half_length)
            drawn["material"] |= {"type": "MeshLambertMaterial", "side": 0}

    def path(self, link: str) -> str:
        """Return where in its scene the link's capsule is."""
        return f"/meshcat/body/visuals/{self.names[link]}"

    def display(self, q: Array) -> dict[str, Array | None]:
        """Let Pinocchio place the capsules at q: T_cam_capsule (4, 4) by link; None where q is not known."""
        self.visualizer.display(q)
        nodes = {link: self.scene.nodes[self.path(link)] for link in self.names}
        return {
            link: None
            if node.properties.get("visible") is False
            else np.reshape(node.transform or (), (4, 4)).T
            for link, node in nodes.items()
        }


@lru_cache(maxsize=32)
def _bodies(figure: Figure) -> _Bodies:
    """Keep the capsules that were made: their meshes take longer than all the rest."""
    return _Bodies(figure)
