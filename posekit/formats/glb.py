"""GLB: the figure's body, standing or moving, as glTF 2.0 in one binary file. GLB files are written, but not read.

The format is that of Khronos Group, *glTF 2.0 Specification* (2021), in metres, with y up. Each joint is a node with
its name and position; the capsule of its link is a child of the node. A motion is one animation: rotations of nodes and
the translation of the pelvis, interpolated linearly between frames. Numbers of an animation are 32-bit floats.
Positions are relative to a root node at whole metres near the person, so they are exact to 1e-6 m far from the origin.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from posekit.errors import refusal
from posekit.files import write_bytes
from posekit.formats.figure_tree import NODES, TO_Y_UP, euler_rotation, figure_in_tree, offsets, rest_place
from posekit.formats.trc import seconds
from posekit.geometry import Array, Ints, cross, quaternion_from_rotation

if TYPE_CHECKING:
    from posekit.body import Figure
    from posekit.motion import Motion

#: Colours (RGB) of a body: right orange, left blue, trunk grey.
SIDE_COLOURS: Final = {"right": (0.90, 0.45, 0.13), "left": (0.16, 0.42, 0.78), "": (0.55, 0.57, 0.60)}
#: Numbers of corners of a capsule's rings and of rings of a half sphere. The mesh deviates from the capsule by less
#: than 1 % of the radius.
RING_CORNERS, HALF_SPHERE_RINGS = 24, 6
_FLOAT, _UINT16 = 5126, 5123


class _Glb:
    """A glTF document and its buffer of numbers, to which a body is appended."""

    def __init__(self) -> None:
        self.document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "posekit"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
        }
        self.data = bytearray()

    def append(self, kind: str, item: dict[str, Any]) -> int:
        items: list[dict[str, Any]] = self.document.setdefault(kind, [])
        items.append(item)
        return len(items) - 1

    def accessor(self, values: NDArray[Any]) -> int:
        """Add an array (N,), (N, 3) or (N, 4) and return the index of its accessor; integer arrays are indices."""
        kind, spelt = (_UINT16, "<u2") if values.dtype.kind == "i" else (_FLOAT, "<f4")
        data = np.ascontiguousarray(values, dtype=spelt)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": data.nbytes}
        table = data.reshape(len(data), -1)
        accessor = {
            "bufferView": self.append("bufferViews", view),
            "componentType": kind,
            "count": len(data),
            "type": {1: "SCALAR", 3: "VEC3", 4: "VEC4"}[table.shape[1]],
            "min": table.min(axis=0).tolist(),
            "max": table.max(axis=0).tolist(),
        }
        self.data += data.tobytes() + bytes(-data.nbytes % 4)
        return self.append("accessors", accessor)

    def packed(self) -> bytes:
        """Return the bytes of the file: a chunk of JSON and a chunk of numbers, both padded to 4 bytes."""
        document = {**self.document, "buffers": [{"byteLength": len(self.data)}]}
        text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode("ascii")
        text += b" " * (-len(text) % 4)
        head = struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(self.data))
        chunks = struct.pack("<I4s", len(text), b"JSON") + text, struct.pack("<I4s", len(self.data), b"BIN\0")
        return head + b"".join(chunks) + bytes(self.data)


def write(path: str | Path, motion: Motion) -> None:
    """Write one recording as GLB: a body of capsules, and its animation.

    Raises
    ------
    InputError
        If the motion has no body, several recordings, or alternative postures of a frame.
    """
    figure, root, angles = figure_in_tree(motion, "GLB")
    glb = _Glb()
    origin = np.round((root.min(axis=0) + root.max(axis=0)) / 2)
    world = glb.append("nodes", {"name": "origin", "translation": (origin + 0.0).tolist(), "children": [1]})
    glb.document["scenes"][0]["nodes"] = [world]
    turns, away = _turns(angles), root - origin
    _body(glb, figure, away[0], turns[0])
    if len(root) > 1:
        _animate(glb, path, away, turns, seconds(motion))
    write_bytes(path, glb.packed())


def _turns(angles: Array) -> Array:
    """Return each node's rotation as quaternions (T, 21, 4), x, y, z, w, with continuous signs over time."""
    turns = quaternion_from_rotation(euler_rotation(angles))
    back = np.einsum("tji,tji->tj", turns[1:], turns[:-1]) < 0
    turns[1:] *= np.where(np.cumsum(back, axis=0) % 2 == 1, -1.0, 1.0)[..., None]
    return np.asarray(turns)


def _material(glb: _Glb, name: str, rgb: tuple[float, ...]) -> int:
    surface = {"baseColorFactor": [*rgb, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.8}
    return glb.append("materials", {"name": name, "pbrMetallicRoughness": surface})


def _shapes(glb: _Glb, figure: Figure) -> dict[str, dict[str, Any]]:
    """Add the triangles of each link's capsules, in the link's frame."""
    at = {node.link: rest_place(figure, node) for node in NODES if node.link}
    shapes = {}
    for capsule in figure.capsules:
        place = (figure.neutral_points - at[capsule.link])[None]
        middle, axis = (row[0] @ TO_Y_UP.T for row in capsule.place(place))
        half = capsule.half_length * axis
        vertices, normals, faces = _capsule(middle - half, middle + half, capsule.radius)
        shapes[capsule.link] = {
            "attributes": {"POSITION": glb.accessor(vertices), "NORMAL": glb.accessor(normals)},
            "indices": glb.accessor(faces.ravel()),
        }
    return shapes


def _body(glb: _Glb, figure: Figure, root: Array, turns: Array) -> None:
    """Append the nodes of the body after the root node, parents first."""
    nodes, shapes, steps = glb.document["nodes"], _shapes(glb, figure), offsets(figure)
    colours = {side: _material(glb, side or "trunk", rgb) for side, rgb in SIDE_COLOURS.items()}
    for k, node in enumerate(NODES):
        place = root if node.parent < 0 else steps[k]
        entry: dict[str, Any] = {"name": node.name, "translation": (place + 0.0).tolist()}
        if node.link:
            entry["rotation"] = turns[k].tolist()
        if node.link in shapes:
            side = node.link.split("_")[0] if "_" in node.link else ""
            primitive = {**shapes[node.link], "material": colours[side]}
            entry["mesh"] = glb.append("meshes", {"name": node.name, "primitives": [primitive]})
        index = glb.append("nodes", entry)
        if node.parent >= 0:
            nodes[1 + node.parent].setdefault("children", []).append(index)


def _animate(glb: _Glb, path: str | Path, away: Array, turns: Array, time: Array) -> None:
    """Add the key frames of a body."""
    keys = (time - time[0]).astype(np.float32)
    if not (np.diff(keys) > 0).all():
        got = f"frames {float(np.diff(time).min()):g} s apart"
        raise refusal(path, "time", got, "times that differ in 32-bit floats", "cut the motion")
    inputs = glb.accessor(keys)
    rotations = [(k, "rotation", turns[:, k]) for k, node in enumerate(NODES) if node.link]
    tracks = [(0, "translation", away), *rotations]
    channels, samplers = [], []
    for k, what, values in tracks:
        samplers.append({"input": inputs, "interpolation": "LINEAR", "output": glb.accessor(values)})
        channels.append({"sampler": len(samplers) - 1, "target": {"node": 1 + k, "path": what}})
    glb.append("animations", {"name": "motion", "channels": channels, "samplers": samplers})


def _capsule(start: Array, end: Array, radius: float) -> tuple[Array, Array, Ints]:
    """Mesh a capsule: vertices (V, 3), outward normals (V, 3), faces (F, 3) counter-clockwise from outside."""
    axis = (end - start) / np.linalg.norm(end - start)
    across = cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    turn = 2 * np.pi * np.arange(RING_CORNERS) / RING_CORNERS
    ring = np.outer(np.cos(turn), across) + np.outer(np.sin(turn), cross(axis, across))
    lift = np.pi / 2 * np.arange(HALF_SPHERE_RINGS) / HALF_SPHERE_RINGS
    half = np.cos(lift)[:, None, None] * ring + np.sin(lift)[:, None, None] * axis  # from the equator up
    below = half - 2 * np.sin(lift)[:, None, None] * axis
    normals = np.concatenate([-axis[None], *below[::-1], *half, axis[None]])
    centres = np.where(np.arange(len(normals))[:, None] < len(normals) // 2, start, end)
    vertices = centres + radius * normals
    hull = ConvexHull(vertices)
    faces, corners = hull.simplices.astype(np.intp), vertices[hull.simplices]
    outward = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    turned = (outward * hull.equations[:, :3]).sum(axis=1) < 0
    faces[turned] = faces[turned, ::-1]
    return vertices, normals, faces
