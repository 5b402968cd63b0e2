"""A meshcat scene without a server: commands are collected, to be drawn by any browser later.

`Scene` stands where meshcat has its window (`meshcat.Visualizer(window=scene)`), so everything that can
draw to meshcat, Pinocchio's `MeshcatVisualizer` among it, fills it. Its `document` is plain JSON that
``player.js`` hands on to meshcat's viewer, in a standalone page or in a headless browser.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import meshcat
import numpy as np
import umsgpack

from posekit.geometry import Array

Json = dict[str, Any]

ARRAY_TYPES = {0x12: "Uint8Array", 0x15: "Int32Array", 0x16: "Uint32Array", 0x17: "Float32Array"}
"""The MessagePack extension codes by which meshcat sends arrays."""


@dataclass(kw_only=True)
class SceneNode:
    """What is at one path: an object, where it is, and its properties."""

    object: Json | None = None
    transform: tuple[float, ...] | None = None
    properties: Json = field(default_factory=dict)


class Scene:
    """A tree of nodes by path, filled by meshcat's commands.

    Paths are meshcat's: what a `meshcat.Visualizer` draws is below ``/meshcat``, and ``/Background``,
    ``/Grid``, ``/Lights`` are the viewer's own. The same content gives the same document, byte for byte.

    Examples
    --------
    >>> import meshcat.geometry as mg
    >>> scene = Scene()
    >>> scene.meshcat["ball"].set_object(mg.Sphere(0.1))
    >>> list(scene.nodes)
    ['/meshcat/ball']
    """

    def __init__(self) -> None:
        self.nodes: dict[str, SceneNode] = {}
        self.geometries: dict[str, Json] = {}

    @property
    def meshcat(self) -> meshcat.Visualizer:
        """A visualizer that draws into this scene."""
        return meshcat.Visualizer(window=self)

    def send(self, command: Any) -> None:
        """Take a meshcat command, as meshcat's own window does.

        A transform that is not finite (an unknown joint) leaves its node invisible.
        """
        data = command.lower()
        kind, path = data["type"], data["path"]
        if kind == "delete":
            self.remove(path)
            return
        node = self.nodes.setdefault(path, SceneNode())
        if kind == "set_object":
            node.object = self._object(data["object"])
            node.properties = {}
        elif kind == "set_transform":
            self.transform(path, np.reshape(data["matrix"], (4, 4)).T)
        elif kind == "set_property":
            node.properties[data["property"]] = _plain(data["value"])

    def transform(self, path: str, matrix: Array) -> None:
        """Place the node at `path` by a transform (4, 4); one that is not finite hides it."""
        node = self.nodes.setdefault(path, SceneNode())
        if np.isfinite(matrix).all():
            node.transform = tuple(np.round(np.asarray(matrix, dtype=np.float64).T.ravel(), 9).tolist())
            node.properties.pop("visible", None)
        else:
            node.properties["visible"] = False

    def recolour(self, path: str, colour: int, opacity: float) -> None:
        """Give the object at `path` another colour (0xrrggbb) and opacity.

        What is translucent does not hide what is behind it.
        """
        node = self.nodes[path]
        if node.object is not None:
            solid = opacity >= 1
            material = {"color": colour, "opacity": opacity, "transparent": not solid, "depthWrite": solid}
            node.object = {**node.object, "material": {**node.object["material"], **material}}

    def show(self, path: str, visible: bool) -> None:
        """Show or hide the node at `path` with all below it."""
        self.nodes.setdefault(path, SceneNode()).properties["visible"] = visible

    def remove(self, path: str) -> None:
        """Remove the node at `path` with all below it."""
        for name in [name for name in self.nodes if name == path or name.startswith(f"{path}/")]:
            del self.nodes[name]

    def adopt(self, other: Scene, path: str, target: str) -> None:
        """Copy the nodes of another scene at and below `path` to `target`."""
        for name, node in other.nodes.items():
            if name == path or name.startswith(f"{path}/"):
                self.nodes[target + name[len(path) :]] = SceneNode(
                    object=node.object, transform=node.transform, properties=dict(node.properties)
                )
        self.geometries.update(other.geometries)

    def copy(self) -> Scene:
        """Return a scene of the same nodes, which may be changed without changing this one."""
        twin = Scene()
        twin.geometries = dict(self.geometries)
        for path, node in self.nodes.items():
            twin.nodes[path] = SceneNode(
                object=node.object, transform=node.transform, properties=dict(node.properties)
            )
        return twin

    def document(self, since: Scene | None = None, known: set[str] | None = None) -> Json:
        """Return what draws this scene: ``{"geometries": {...}, "commands": [...]}``, plain JSON.

        Parameters
        ----------
        since : Scene, optional
            What is drawn already: only the difference is returned.
        known : set of str, optional
            Geometries that the drawer holds already; those that are returned are added to it.
        """
        before: Mapping[str, SceneNode] = {} if since is None else since.nodes
        commands: list[Json] = [
            {"type": "delete", "path": path} for path in before if path not in self.nodes and path != "/"
        ]
        for path, node in self.nodes.items():
            commands += _difference(path, before.get(path), node)
        needed = {
            command["object"]["geometry"]
            for command in commands
            if command["type"] == "set_object" and "geometry" in command["object"]
        }
        fresh = sorted(needed - (known or set()))
        if known is not None:
            known.update(fresh)
        return {"geometries": {key: self.geometries[key] for key in fresh}, "commands": commands}

    def _object(self, lowered: Json) -> Json:
        """Split a meshcat object into shared geometry, material and the rest; random ids are left out."""
        data = _plain(lowered)
        own: Json = {key: value for key, value in data["object"].items() if key not in ("uuid", "material")}
        if data.get("geometries"):
            geometry = {key: value for key, value in data["geometries"][0].items() if key != "uuid"}
            key = hashlib.sha256(json.dumps(geometry, sort_keys=True).encode()).hexdigest()[:16]
            self.geometries[key] = geometry
            own["geometry"] = key
        if data.get("materials"):
            own["material"] = {key: value for key, value in data["materials"][0].items() if key != "uuid"}
        return own


def _difference(path: str, old: SceneNode | None, new: SceneNode) -> Iterator[Json]:
    if new.object is not None and (old is None or old.object != new.object):
        yield {"type": "set_object", "path": path, "object": new.object}
        old = None if old is None else SceneNode(transform=old.transform)
    if new.transform is not None and (old is None or old.transform != new.transform):
        yield {"type": "set_transform", "path": path, "matrix": list(new.transform)}
    before = {} if old is None else old.properties
    for name, value in new.properties.items():
        if name not in before or before[name] != value:
            yield {"type": "set_property", "path": path, "property": name, "value": value}
    if before.get("visible") is False and "visible" not in new.properties:
        yield {"type": "set_property", "path": path, "property": "visible", "value": True}


def _plain(value: Any) -> Any:
    """Turn what meshcat sends into plain JSON; arrays become base64."""
    if isinstance(value, umsgpack.Ext):
        return {"type": ARRAY_TYPES[value.type], "base64": base64.b64encode(value.data).decode("ascii")}
    if isinstance(value, dict):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return value
