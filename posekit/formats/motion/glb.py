"""GLB: the figure's bodies, standing or moving, as glTF 2.0 in one binary file.

Khronos Group, *glTF 2.0 Specification* (2021). Metres, y up, right-handed. One node a joint, with the joint's name and
its place; the capsule of its link hangs on it. A motion is one animation with a rotation for each node that turns and
a translation for the pelvis, linear between frames. Written for what opens glTF: Blender, browsers, game engines.

Numbers of an animation are float32. So that they stay exact to 1e-6 m far from the origin, the whole hangs on a node
at whole metres near the person, and what is animated is the way from there.
"""

from __future__ import annotations

import colorsys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure
from posekit.formats.motion.bvh_angles import euler_rotation
from posekit.formats.motion.bvh_tree import (
    BODY_NODES,
    TO_Y_UP,
    PlacedBody,
    checked,
    filled,
    known_nodes,
    neutral_place,
    offsets,
    place,
)
from posekit.formats.motion.glb_capsule import capsule_mesh
from posekit.formats.motion.glb_file import INDEX_TARGET, UINT16_TYPE, VERTEX_TARGET, GlbFile
from posekit.formats.motion.glb_reading import read_glb
from posekit.formats.motion.motion_format import MotionFormat
from posekit.geometry import Array, quaternion_from_rotation
from posekit.safe_io import refusal, shown

MAX_BODIES: Final = 1000
"""Postures in one file: each is a body of 22 nodes."""
MAX_NAME: Final = 200
SIDE_COLOURS: Final = {"right": (0.90, 0.45, 0.13), "left": (0.16, 0.42, 0.78), "": (0.55, 0.57, 0.60)}
"""Colours of one body: right orange, left blue, the trunk grey."""
GOLDEN_TURN: Final = 0.6180339887498949
"""Turn of the hue from one body to the next, so that neighbours differ however many there are."""


def write_glb(
    path: str | Path, figure: Figure, q: Array, time: Array, *, up: str = "+z", unknown: str = "refuse"
) -> None:
    """Write one body that moves, whole or not at all.

    Parameters
    ----------
    path : path
        The file to write, whole or not at all.
    figure : Figure
        The figure whose configurations they are.
    q : array (T, nq)
        In Pinocchio's order, free-flyer first: metres, unit quaternion, radians.
    time : array (T,)
        Seconds; the file counts from the first. With one frame the body stands.
    up : str
        The axis of q's world that points up; in the file y does.
    unknown : str
        ``refuse`` or ``hold`` angles that are not known: see `posekit.formats.motion.bvh_tree.filled`.

    Raises
    ------
    InputError
        Where q or time are not what is said above, or the file cannot be written.
    """
    q = checked(path, figure, q, time, up)
    placed = place(figure, filled(path, figure, q, unknown), up)
    glb = GlbFile()
    origin = np.round((placed.root.min(axis=0) + placed.root.max(axis=0)) / 2)
    world = _world(glb, origin)
    colour = {side: _material(glb, side or "trunk", rgb) for side, rgb in SIDE_COLOURS.items()}
    meshes = {
        link: _mesh(glb, link, shape, colour[link.split("_")[0] if "_" in link else ""])
        for link, shape in _shapes(glb, figure).items()
    }
    turns, away = quaternions_along_time(placed), placed.root - origin
    first = _body(glb, world, offsets(figure), away[0], turns[0], meshes)
    if len(q) > 1:
        _animate(glb, path, first, away, turns, np.asarray(time, dtype=np.float64))
    glb.write(path)


def write_postures_glb(
    path: str | Path,
    figure: Figure,
    q: Array,
    *,
    up: str = "+z",
    names: Sequence[str] | None = None,
    colours: Array | None = None,
) -> None:
    """Write several postures of one frame, one standing body each, whole or not at all.

    Parameters
    ----------
    path : path
        The file to write, whole or not at all.
    figure : Figure
        The figure whose configurations they are.
    q : array (N, nq)
        See `write_glb`; at most 1000. Where an angle is NaN, what hangs on its joint is left out of that body; an
        axial rotation alone that is not known is left at zero.
    up : str
        The axis of q's world that points up.
    names : sequence of str (N,), optional
        Of the bodies; ``survivor_0`` … if not given. The nodes of a body are called ``survivor_0.right_elbow``.
    colours : array (N, 3), optional
        Red, green, blue, 0 to 1.

    Raises
    ------
    InputError
        Where they are not what is said above, or the file cannot be written.
    """
    q = checked(path, figure, q, up=up)
    if len(q) > MAX_BODIES:
        raise refusal(
            path, "q", f"{len(q)} postures", f"at most {MAX_BODIES}", "choose the first of the ranking"
        )
    labels = _labels(path, names, len(q))
    rgb = _colours(path, colours, len(q))
    known = known_nodes(figure, q)
    placed = place(figure, np.where(np.isnan(q), 0.0, q), up)
    glb = GlbFile()
    origin = np.round((placed.root.min(axis=0) + placed.root.max(axis=0)) / 2)
    world = _world(glb, origin)
    steps, turns, shapes = offsets(figure), quaternions_along_time(placed), _shapes(glb, figure)
    for k, label in enumerate(labels):
        material = _material(glb, label, tuple(rgb[k].tolist()))
        meshes = {link: _mesh(glb, f"{label}.{link}", shape, material) for link, shape in shapes.items()}
        _body(glb, world, steps, placed.root[k] - origin, turns[k], meshes, label, known[k])
    glb.write(path)


def quaternions_along_time(placed: PlacedBody) -> Array:
    """Return each node's rotation as a quaternion (T, 21, 4), x, y, z, w, with no change of sign along time."""
    R = euler_rotation(placed.angles)
    turns = quaternion_from_rotation(R)
    back = np.einsum("tji,tji->tj", turns[1:], turns[:-1]) < 0
    turns[1:] *= np.where(np.cumsum(back, axis=0) % 2 == 1, -1.0, 1.0)[..., None]
    return np.asarray(turns)


def _world(glb: GlbFile, origin: Array) -> int:
    world = glb.append("nodes", {"name": "origin", "translation": (origin + 0.0).tolist(), "children": []})
    glb.document["scenes"][0]["nodes"] = [world]
    return world


def _material(glb: GlbFile, name: str, rgb: tuple[float, ...]) -> int:
    surface = {"baseColorFactor": [*rgb, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.8}
    return glb.append("materials", {"name": name, "pbrMetallicRoughness": surface})


def _shapes(glb: GlbFile, figure: Figure) -> dict[str, dict[str, Any]]:
    """Add the capsules' triangles, each in its link's frame, and return what a mesh says of them."""
    at = {node.link: neutral_place(figure, node) for node in BODY_NODES if node.link}
    shapes = {}
    for capsule in figure.capsules:
        own = figure.neutral_points - at[capsule.link]
        middle, axis = (row[0] @ TO_Y_UP.T for row in capsule.place(own[None, list(capsule.points)]))
        half = capsule.half_length * axis
        mesh = capsule_mesh(middle - half, middle + half, capsule.radius)
        shapes[capsule.link] = {
            "attributes": {
                "POSITION": glb.accessor(mesh.vertices, target=VERTEX_TARGET, bounds=True),
                "NORMAL": glb.accessor(mesh.normals, target=VERTEX_TARGET),
            },
            "indices": glb.accessor(mesh.faces.ravel(), UINT16_TYPE, target=INDEX_TARGET),
        }
    return shapes


def _mesh(glb: GlbFile, name: str, shape: dict[str, Any], material: int) -> int:
    return glb.append("meshes", {"name": name, "primitives": [{**shape, "material": material}]})


def _body(
    glb: GlbFile,
    world: int,
    steps: Array,
    root: Array,
    turns: Array,
    meshes: dict[str, int],
    label: str = "",
    known: NDArray[np.int8] | None = None,
) -> int:
    """Add a body's nodes under the world and return the first; those of a named body hang on a node of that name."""
    nodes = glb.document["nodes"]
    if label:
        nodes[world]["children"].append(len(nodes))
        world = glb.append("nodes", {"name": label, "children": []})
    place_in_file: dict[int, int] = {-1: world}
    for k, node in enumerate(BODY_NODES):
        if known is not None and known[k] == 0:
            continue
        where = (root if node.parent < 0 else steps[k]) + 0.0
        entry: dict[str, Any] = {"name": f"{label}.{node.name}" if label else node.name}
        if where.any():
            entry["translation"] = where.tolist()
        if node.link:
            entry["rotation"] = turns[k].tolist()
        if node.link and (known is None or known[k] == 2):
            entry["mesh"] = meshes[node.link]
        place_in_file[k] = glb.append("nodes", entry)
        nodes[place_in_file[node.parent]].setdefault("children", []).append(place_in_file[k])
    return place_in_file[0]


def _animate(glb: GlbFile, path: str | Path, first: int, away: Array, turns: Array, time: Array) -> None:
    """Add the key frames of a body whose nodes are all there, in the order of `BODY_NODES`."""
    seconds = (time - time[0]).astype(np.float32)
    if not (np.diff(seconds) > 0).all():
        got = f"frames {float(np.diff(time).min()):g} s apart over {time[-1] - time[0]:g} s"
        raise refusal(path, "time", got, "times that differ in float32", "split the motion")
    keys = glb.accessor(seconds, bounds=True)
    tracks = [(0, "translation", away)]
    tracks += [(k, "rotation", turns[:, k]) for k, node in enumerate(BODY_NODES) if node.link]
    channels, samplers = [], []
    for k, what, values in tracks:
        samplers.append({"input": keys, "interpolation": "LINEAR", "output": glb.accessor(values)})
        channels.append({"sampler": len(samplers) - 1, "target": {"node": first + k, "path": what}})
    glb.append("animations", {"name": "motion", "channels": channels, "samplers": samplers})


def _labels(path: str | Path, names: Sequence[str] | None, count: int) -> tuple[str, ...]:
    labels = tuple(names) if names is not None else tuple(f"survivor_{k}" for k in range(count))
    good = all(isinstance(name, str) and 0 < len(name) <= MAX_NAME and name.isprintable() for name in labels)
    if len(labels) != count or len(set(labels)) != count or not good:
        expected = f"{count} different names of 1 to {MAX_NAME} characters"
        raise refusal(path, "names", shown(list(labels)), expected, "name each posture once")
    return labels


def _colours(path: str | Path, colours: Array | None, count: int) -> Array:
    if colours is None:
        return np.array(
            [colorsys.hsv_to_rgb((0.58 + GOLDEN_TURN * k) % 1.0, 0.65, 0.85) for k in range(count)]
        )
    rgb = np.asarray(colours, dtype=np.float64)
    if rgb.shape != (count, 3) or not ((rgb >= 0) & (rgb <= 1)).all():
        raise refusal(
            path, "colours", f"shape {rgb.shape}", f"({count}, 3), numbers from 0 to 1", "correct them"
        )
    return rgb


GLB_FORMAT: Final = MotionFormat(
    name="glb",
    title="GLB: the moving body as glTF 2.0, for Blender, browsers and game engines",
    suffixes=(".glb",),
    looks_like=lambda given: given.start.startswith(b"glTF"),
    read=read_glb,
    write_configurations=write_glb,
)
