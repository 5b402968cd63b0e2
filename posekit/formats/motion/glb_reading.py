"""Read GLB: the places of a document's nodes over time, as its animation moves them.

A node's matrix is T R S, and its place in the world that of all nodes above it times its own (Khronos Group, *glTF 2.0
Specification*, 2021, §3.5.2 and §3.5.3). Metres, y up. Rotations between key frames turn evenly (Shoemake 1985), other
values lie on a line; before the first key and after the last they stay (§3.11).
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.formats.motion.glb_content import GlbContent, open_glb
from posekit.formats.motion.motion import Motion
from posekit.formats.motion.motion_format import METRES_IN_UNIT
from posekit.formats.motion.motion_table import rate_of
from posekit.geometry import (
    Array,
    quaternion_conjugate,
    quaternion_exp,
    quaternion_log,
    quaternion_product,
    rotation_from_quaternion,
    shorter_quaternion,
)
from posekit.safe_io import refusal

MAX_NODES: Final = 10_000
MAX_PLACES: Final = 50_000_000
"""Nodes times frames."""
AT_REST: Final = {"translation": (0.0, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0, 1.0, 1.0)}
"""What a node has where the document says nothing."""


def read_glb(path: str | Path, unit: str | None = None) -> Motion:
    """Read the places of the nodes that have names of their own, over the times of the file's animation.

    Parameters
    ----------
    path : path
        A GLB with one animation, or none: then there is one frame.
    unit : str, optional
        Instead of metres, in which glTF is.

    Raises
    ------
    InputError
        Where the file is damaged, has several animations, or moves nodes in ways that are not read: by a matrix, or
        along cubic splines.
    """
    glb = open_glb(Path(path))
    nodes = glb.items("nodes")
    names = [str(node.get("name", "")) for node in nodes]
    counts = Counter(names)
    named = [k for k, name in enumerate(names) if name and counts[name] == 1]
    if not named or len(nodes) > MAX_NODES:
        raise refusal(path, "nodes", f"{len(nodes)} nodes", f"1 to {MAX_NODES} with names", "name the joints")
    tracks = _tracks(glb)
    times = [keys for keys, _ in tracks.values()]
    time = np.unique(np.concatenate(times)) if times else np.zeros(1)
    if len(time) * len(nodes) > MAX_PLACES:
        raise refusal(path, "", f"{len(time)} frames of {len(nodes)} nodes", "fewer", "write fewer frames")
    places = _places(glb, nodes, tracks, time)
    return Motion(
        names=tuple(names[k] for k in named),
        points=METRES_IN_UNIT[unit or "m"] * places[:, named],
        time=time,
        rate=rate_of(time),
        up="+y",
        source=str(path),
        told=("up",),
    )


def _tracks(glb: GlbContent) -> dict[tuple[int, str], tuple[Array, Array]]:
    """Read the key frames (K,) and values (K, n) of each value that moves, by node and name."""
    animations = glb.items("animations")
    if len(animations) > 1:
        raise glb.damaged("animations", f"{len(animations)} animations", "one")
    found: dict[tuple[int, str], tuple[Array, Array]] = {}
    for animation in animations:
        samplers, channels = animation.get("samplers"), animation.get("channels")
        if not isinstance(samplers, list) or not isinstance(channels, list):
            raise glb.damaged("animations[0]", "no samplers or channels", "lists of both")
        for index, channel in enumerate(channels):
            where = f"animations[0].channels[{index}]"
            target = channel.get("target") if isinstance(channel, dict) else None
            number: Any = channel.get("sampler") if isinstance(channel, dict) else None
            known = type(number) is int and 0 <= number < len(samplers) and isinstance(samplers[number], dict)
            if not isinstance(target, dict) or not known:
                raise glb.damaged(where, "no target or sampler", "both")
            if target.get("path") not in AT_REST:
                continue  # weights of shapes move no node
            glb.item("nodes", target.get("node"), f"{where}.target.node")
            found[target["node"], target["path"]] = _keys(glb, samplers[number], where, target["path"])
    return found


def _keys(glb: GlbContent, sampler: dict[str, Any], where: str, what: str) -> tuple[Array, Array]:
    keys = glb.floats(sampler.get("input"), f"{where}: input")[:, 0]
    values = glb.floats(sampler.get("output"), f"{where}: output")
    if sampler.get("interpolation", "LINEAR") != "LINEAR":
        raise glb.damaged(f"{where}: interpolation", str(sampler.get("interpolation"))[:40], "LINEAR")
    if not len(keys) or values.shape != (len(keys), len(AT_REST[what])) or (np.diff(keys) <= 0).any():
        raise glb.damaged(where, f"{len(keys)} keys, {len(values)} values", "keys that ascend, a value each")
    return keys, values


def _places(
    glb: GlbContent,
    nodes: list[dict[str, Any]],
    tracks: dict[tuple[int, str], tuple[Array, Array]],
    time: Array,
) -> Array:
    """Return the nodes' places (T, N, 3): from the roots down, each node once."""
    parent = np.full(len(nodes), -1)
    for k, node in enumerate(nodes):
        children = node.get("children", [])
        for child in children if isinstance(children, list) else [children]:
            glb.item("nodes", child, f"nodes[{k}].children")
            if parent[child] >= 0 or child == k:
                raise glb.damaged(f"nodes[{k}].children", f"node {child} under two nodes", "a tree")
            parent[child] = k
    places = np.full((len(time), len(nodes), 3), np.nan)
    linear = np.empty((len(time), len(nodes), 3, 3))
    waiting = np.flatnonzero(parent < 0).tolist()
    while waiting:
        k = waiting.pop()
        if "matrix" in nodes[k]:
            raise glb.damaged(f"nodes[{k}].matrix", "a matrix", "translation, rotation and scale")
        step, turn, size = (_at(glb, nodes[k], k, name, tracks, time) for name in AT_REST)
        own = rotation_from_quaternion(turn) * size[:, None, :]
        above = parent[k]
        if above < 0:
            places[:, k], linear[:, k] = step, own
        else:
            places[:, k] = places[:, above] + np.einsum("tij,tj->ti", linear[:, above], step)
            linear[:, k] = linear[:, above] @ own
        waiting += np.flatnonzero(parent == k).tolist()
    if np.isnan(places).any():
        raise glb.damaged("nodes", "nodes in a circle", "a tree")
    return places


def _at(
    glb: GlbContent,
    node: dict[str, Any],
    index: int,
    name: str,
    tracks: dict[tuple[int, str], tuple[Array, Array]],
    time: Array,
) -> Array:
    """Return a node's translation, rotation or scale at every time (T, n)."""
    if (index, name) in tracks:
        keys, values = tracks[index, name]
        return _turned(keys, values, time) if name == "rotation" else _between(keys, values, time)
    given = node.get(name, AT_REST[name])
    numbers = isinstance(given, list | tuple) and all(type(value) in (int, float) for value in given)
    if not numbers or len(given) != len(AT_REST[name]):
        raise glb.damaged(f"nodes[{index}].{name}", str(given)[:60], f"{len(AT_REST[name])} numbers")
    if name == "rotation":
        return np.broadcast_to(_unit(np.array([given], dtype=np.float64)), (len(time), 4))
    return np.broadcast_to(np.array(given, dtype=np.float64), (len(time), len(given)))


def _between(keys: Array, values: Array, time: Array) -> Array:
    return np.stack([np.interp(time, keys, column) for column in values.T], axis=1)


def _unit(turns: Array) -> Array:
    length = np.linalg.norm(turns, axis=1, keepdims=True)
    return np.where(length > 0, turns / np.maximum(length, 1e-30), [0.0, 0.0, 0.0, 1.0])


def _turned(keys: Array, values: Array, time: Array) -> Array:
    """Turn evenly from key to key, the shorter way (Shoemake 1985)."""
    turns = _unit(values)
    last = np.maximum(np.searchsorted(keys, time, side="right") - 1, 0)
    following = np.minimum(last + 1, len(keys) - 1)
    span = np.where(following > last, keys[following] - keys[last], 1.0)
    share = np.clip((time - keys[last]) / span, 0.0, 1.0)[:, None]
    step = shorter_quaternion(quaternion_product(quaternion_conjugate(turns[last]), turns[following]))
    return quaternion_product(turns[last], quaternion_exp(share * quaternion_log(step)))
