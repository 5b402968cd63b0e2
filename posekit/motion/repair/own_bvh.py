"""Write a repaired motion into the user's BVH file; channels that the repair does not affect stay as they are."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from posekit.body.pieces import HEAD_PIECE, HIPS_PIECE, TORSO_PIECE, TRUNK, turns_between
from posekit.formats.bvh import UNITS, Bvh, parse, positions_are_absolute, read, with_values, world_points
from posekit.formats.options import Options
from posekit.geometry import Array, Flags, Ints, turned_near
from posekit.motion.motion import Motion
from posekit.motion.repair.clip import Clip, between
from posekit.skeleton import JOINTS, LIMB_JOINTS, NAMES, SIDES

#: Largest distance at which a node of the file's hierarchy and a point of the motion count as equal, metres.
SAME_METRES: Final = 1e-6
#: Distance between repaired points and points of the file below which a frame keeps its channels: the positions of
#: joints that a layout derives depend on medians over all frames, so they are not exact.
STAYS_METRES: Final = 5e-6
#: Change of a channel below which its text stays (file's unit), and of an entry of a rotation matrix.
TINY: Final = 1e-10
#: Words for one side in names of joints.
SIDE_WORDS: Final = (("Left", "Right"), ("left", "right"), ("L", "R"), ("l", "r"))


def in_bvh(clip: Clip, document: Bvh, options: Options) -> bytes:
    """Return the BVH file with new rotations, so that its points coincide with the points of the clip.

    Each rigid part of the body is rotated so that its points in the file coincide with its points in the clip. In each
    rigid part, only the channels of its first node change. Frames with unchanged points keep all channels. In frames
    that the repair interpolated, each channel is first interpolated between the neighbouring frames.
    """
    document = _renamed(document) if clip.mirrored else document
    values = _filled(document, document.values[clip.rows], clip.filled)
    moved = with_values(document, values)
    base = read(moved, clip.motion.source, options)
    before, after = base.points(NAMES), clip.state
    changed = np.flatnonzero((np.abs(np.nan_to_num(after - before)) > STAYS_METRES).any(axis=(1, 2)))
    if changed.size:
        nodes = _landmarks(moved, base)
        values[changed] = _turned(document, values[changed], nodes, before[changed], after[changed], base)
    values = np.where(np.abs(values - document.values) < TINY, document.values, values)
    return with_values(document, values).text.encode()


def _landmarks(document: Bvh, motion: Motion) -> dict[str, int]:
    """Return the index of the node in the file for each point of the motion.

    If several nodes have the same position, the node nearest to the next joint of the limb is chosen.
    """
    sample = slice(None, None, max(1, len(motion) // 20))
    absolute = positions_are_absolute(document)
    points = world_points(document, absolute=absolute, values=document.values[sample]) * UNITS[motion.unit]
    ours = motion.points(NAMES)[sample]
    beyond = {JOINTS[limb[k]]: JOINTS[limb[k + 1]] for limb in LIMB_JOINTS for k in (0, 1)}
    found: dict[str, int] = {}
    for column, name in reversed(list(enumerate(NAMES))):
        off = np.linalg.norm(points - ours[:, column, None], axis=-1).max(axis=0)
        same = np.flatnonzero(off < SAME_METRES * max(1.0, float(np.nanmax(np.abs(ours))))).tolist()
        above = _above(document, found[beyond[name]])[1:] if beyond.get(name) in found else same
        kept = [node for node in same if node in above and not document.sites[node]] or same
        if kept:
            found[name] = kept[-1]
    return found


def _above(document: Bvh, node: int) -> list[int]:
    """Return a node and its ancestors up to the root, in this order."""
    way = [node]
    while document.parents[way[-1]] >= 0:
        way.append(document.parents[way[-1]])
    return way


def _pieces(document: Bvh, nodes: Mapping[str, int]) -> tuple[Ints, int]:
    """Return the index of each node's rigid part (P,), -1 for ancestors of the body, and the body's first node."""
    limbs = [[nodes.get(JOINTS[joint]) for joint in limb[:2]] for limb in LIMB_JOINTS]
    ways = [set(_above(document, start)[1:]) for start, _ in limbs if start is not None]
    common = set.intersection(*ways) if ways else {0}
    body = max(common, default=0)
    marks: dict[int, int] = {}
    for limb, (start, middle) in enumerate(limbs):
        if start is not None:
            part = TORSO_PIECE if limb < len(SIDES) else HIPS_PIECE
            marks |= {node: part for node in _above(document, start)[1:] if node not in marks}
            marks[start] = HEAD_PIECE + 1 + 2 * limb
        if middle is not None:
            marks[middle] = HEAD_PIECE + 2 + 2 * limb
    marks |= {**dict.fromkeys(common, -1), body: HIPS_PIECE}
    pieces = np.full(len(document.names), -1)
    for node, parent in enumerate(document.parents):
        inherited = pieces[parent] if parent >= 0 else -1
        if inherited == TORSO_PIECE and re.search("neck|head", document.names[node], re.I):
            marks.setdefault(node, HEAD_PIECE)
        pieces[node] = marks.get(node, inherited)
    return pieces, body


def _channels(document: Bvh, node: int, *, rotations: bool) -> tuple[list[int], list[int]]:
    """Return the columns of a node's rotation channels, or of its position channels, and the axis of each column."""
    start = document.columns[node].start
    own = [(start + k, axis) for k, (one, axis) in enumerate(document.channels[node]) if one == rotations]
    return [column for column, _ in own], [axis for _, axis in own]


def _local(document: Bvh, values: Array, node: int) -> Array:
    """Return the rotation matrices (T, 3, 3) of a node in the frame of its parent."""
    at, axes = _channels(document, node, rotations=True)
    if not at:
        return np.tile(np.eye(3), (len(values), 1, 1))
    order = "".join("XYZ"[axis] for axis in axes)
    return np.asarray(Rotation.from_euler(order, values[:, at], degrees=True).as_matrix())


def _with_rotation(document: Bvh, values: Array, node: int, R: Array) -> Array:
    """Return channels (T, C) with new rotations R (T, 3, 3) of a node.

    Among equivalent Euler angles the ones nearest to the present angles are chosen. A node with fewer than three
    rotation channels gets the part of R that these channels can represent.
    """
    at, axes = _channels(document, node, rotations=True)
    order = "".join("XYZ"[axis] for axis in [*axes, *({0, 1, 2} - set(axes))])
    first = Rotation.from_matrix(R).as_euler(order, degrees=True)
    second = first * [1, -1, 1] + 180.0
    near, out = values[:, at], values.copy()
    tried = [turned_near(one[:, : len(at)], near, half_turn=180.0) for one in (first, second)]
    off = [np.abs(one - near).sum(axis=1) for one in tried]
    out[:, at] = np.where((off[0] <= off[1])[:, None], *tried)
    return out


def _turned(
    document: Bvh, values: Array, nodes: Mapping[str, int], before: Array, after: Array, base: Motion
) -> Array:
    """Return channels (n, C) that move the points of n frames from `before` to `after` (n, P, 3), metres."""
    values = values.copy()
    pieces, body = _pieces(document, nodes)
    turn = turns_between(before, after)
    world = np.eye(3)[None]
    old: list[Array] = []
    new: list[Array] = []
    for node, parent in enumerate(document.parents):
        local = _local(document, values, node)
        old.append((old[parent] if parent >= 0 else world) @ local)
        above = new[parent] if parent >= 0 else world
        if pieces[node] >= 0 and _channels(document, node, rotations=True)[0]:
            wanted = above.swapaxes(-1, -2) @ turn[:, pieces[node]] @ old[node]
            rows = np.flatnonzero(np.abs(wanted - local).max(axis=(1, 2)) > TINY)
            values[rows] = _with_rotation(document, values[rows], node, wanted[rows])
            local = _local(document, values, node)
        new.append(above @ local)
    points = world_points(document, absolute=positions_are_absolute(document), values=values)
    trunk = [k for k in TRUNK if JOINTS[k] in nodes]
    shift = after[:, trunk] / UNITS[base.unit] - points[:, [nodes[JOINTS[k]] for k in trunk]]
    shift = np.nanmean(shift, axis=1)
    shift[np.linalg.norm(shift, axis=1) < SAME_METRES * 1e-2] = 0.0
    carrier = next(
        (k for k in _above(document, body) if len(_channels(document, k, rotations=False)[0]) == 3), None
    )
    if carrier is not None:
        at, axes = _channels(document, carrier, rotations=False)
        parent = document.parents[carrier]
        values[:, at] += np.einsum("tji,tj->ti", new[parent] if parent >= 0 else world, shift)[:, axes]
    return values


def _filled(document: Bvh, values: Array, filled: Flags) -> Array:
    """Return channels (T, C) with the frames `filled` (T,) interpolated between the other frames."""
    values = values.copy()
    rows, before, after, share = between(filled)
    start, end = values[before], values[after]
    values[rows] = start + share[:, None] * (end - start)
    for node in range(len(document.names) if rows.size else 0):
        if len(_channels(document, node, rotations=True)[0]) == 3:
            first, last = (_local(document, one, node) for one in (start, end))
            turn = Rotation.from_matrix(first.swapaxes(1, 2) @ last).as_rotvec()
            turned = first @ Rotation.from_rotvec(share[:, None] * turn).as_matrix()
            values[rows] = _with_rotation(document, values[rows], node, turned)
    return values


def _renamed(document: Bvh) -> Bvh:
    """Return the file with the names of right and left joints exchanged."""
    head, mark, rest = re.split(r"(^[ \t]*MOTION)", document.text, maxsplit=1, flags=re.M | re.I)
    other = {name: _twin(name, document.names) for name in document.names}
    head = re.sub(
        r"((?:ROOT|JOINT)[ \t]+)([^{}\r\n]*?)(?=[ \t]*[\r\n{])",
        lambda match: match[1] + other.get(" ".join(match[2].split()), match[2]),
        head,
        flags=re.I,
    )
    return replace(parse((head + mark + rest).encode(), ""), values=document.values)


def _twin(name: str, names: tuple[str, ...]) -> str:
    """Return the name of the joint on the other side of the body; for a joint without a side, the same name."""
    for words in SIDE_WORDS:
        for one, other in (words, words[::-1]):
            for match in re.finditer(one, name):
                twin = name[: match.start()] + other + name[match.end() :]
                if twin in names:
                    return twin
    return name
