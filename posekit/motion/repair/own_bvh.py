"""Repaired motion in the user's own BVH file: only the rotations that move."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import (
    Array,
    coordinate_rotation,
    rotation_from_vector,
    turned_near,
    vector_from_rotation,
)
from posekit.motion.motion import NAMES, Motion
from posekit.motion.repair.clip import Clip
from posekit.motion.repair.pieces import HEAD_PIECE, HIPS_PIECE, TORSO_PIECE, TRUNK, between, turns_between
from posekit.skeleton import JOINTS, LIMB_JOINTS, other_side

if TYPE_CHECKING:
    from posekit.formats.bvh import Bvh
    from posekit.formats.options import Options

#: Distance below which a node of a hierarchy is a joint of ours.
SAME_METRES: Final = 1e-6
#: Distance by which the points of a frame may be off that keeps its channels.
STAYS_METRES: Final = 1e-7
#: Change of a channel below which its text stays, file's unit.
TINY: Final = 1e-10


def in_bvh(clip: Clip, document: Bvh, options: Options) -> Motion:
    """Turn the joints of a BVH file as a clip's points are turned.

    The pieces of the body turn by the rotations that bring the points of the file to those of the clip. Nodes of one
    piece keep their channels, except the first; frames whose points stay keep all of them. Frames that were made from
    their neighbours are interpolated channel by channel first.

    Returns
    -------
    Motion
        The file's motion as it is read again, with the changed document.
    """
    from posekit.formats.bvh import read, with_values

    source = clip.motion.source
    if clip.mirrored:
        document = _renamed(document, _landmarks(document, clip.motion))
    values = _filled(document, document.values[clip.rows], clip.filled)
    moved = with_values(document, values)
    base = read(moved, source, options)
    before, after = base.points(NAMES), clip.state
    changed = np.flatnonzero((np.abs(np.nan_to_num(after - before)) > STAYS_METRES).any(axis=(1, 2)))
    if changed.size:
        nodes = _landmarks(moved, base)
        values[changed] = _turned(document, values[changed], nodes, before[changed], after[changed], base)
    values = np.where(np.abs(values - document.values) < TINY, document.values, values)
    return read(with_values(document, values), source, options)


def _metres(motion: Motion) -> float:
    from posekit.formats.bvh import UNITS

    return float(UNITS[motion.unit])


def _landmarks(document: Bvh, motion: Motion) -> dict[str, int]:
    """Return the node at each point of the motion; of several in one place the nearest to the next joint."""
    from posekit.formats.bvh import positions_are_absolute, world_points

    sample = slice(None, None, max(1, len(motion) // 20))
    absolute = positions_are_absolute(document)
    points = world_points(document, absolute=absolute, values=document.values[sample]) * _metres(motion)
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
    """Return a node and those that it hangs on, up to a root."""
    way = [node]
    while document.parents[way[-1]] >= 0:
        way.append(document.parents[way[-1]])
    return way


def _pieces(document: Bvh, nodes: Mapping[str, int]) -> tuple[NDArray[np.intp], int]:
    """Return the piece that each node turns with (P,), -1 above the body, and the node on which the body hangs."""
    starts = [nodes[JOINTS[limb[0]]] for limb in LIMB_JOINTS if JOINTS[limb[0]] in nodes]
    ways = [_above(document, start)[1:] for start in starts]
    common = set.intersection(*map(set, ways)) if ways else {0}
    body = max(common, default=0)
    marks = {body: HIPS_PIECE}
    for limb, (start, middle, _) in enumerate(LIMB_JOINTS):
        if JOINTS[start] in nodes:
            part = TORSO_PIECE if limb < 2 else HIPS_PIECE
            for node in _above(document, nodes[JOINTS[start]])[1:]:
                if node not in common:
                    marks.setdefault(node, part)
            marks[nodes[JOINTS[start]]] = HEAD_PIECE + 1 + 2 * limb
        if JOINTS[middle] in nodes:
            marks[nodes[JOINTS[middle]]] = HEAD_PIECE + 2 + 2 * limb
    pieces = np.full(len(document.names), -1)
    for node, parent in enumerate(document.parents):
        inherited = pieces[parent] if parent >= 0 else -1
        if inherited == TORSO_PIECE and re.search("neck|head", document.names[node], re.I):
            marks.setdefault(node, HEAD_PIECE)
        pieces[node] = marks.get(node, inherited)
    return pieces, body


def _rotations_of(document: Bvh, node: int) -> tuple[list[int], list[int]]:
    """Return the columns of a node's rotations, and their axes."""
    start = document.columns[node].start
    own = [(start + k, axis) for k, (rotates, axis) in enumerate(document.channels[node]) if rotates]
    return [column for column, _ in own], [axis for _, axis in own]


def _local_rotations(document: Bvh, values: Array, node: int) -> Array:
    """Return a node's rotations in its parent (T, 3, 3)."""
    R = np.tile(np.eye(3), (len(values), 1, 1))
    for column, axis in zip(*_rotations_of(document, node), strict=True):
        R = R @ coordinate_rotation(axis, np.radians(values[:, column]))
    return R


def _with_rotation(document: Bvh, values: Array, node: int, R: Array) -> Array:
    """Return channels (T, C) with rotations (T, 3, 3) of a node, by the angles nearest to those that are there.

    A node with fewer than three rotations keeps the part that they can express.
    """
    from scipy.spatial.transform import Rotation

    at, axes = _rotations_of(document, node)
    order = axes + [axis for axis in range(3) if axis not in axes]
    first = Rotation.from_matrix(R).as_euler("".join("XYZ"[axis] for axis in order), degrees=True)
    second = np.stack([first[:, 0] + 180.0, 180.0 - first[:, 1], first[:, 2] + 180.0], axis=1)
    near, out = values[:, at], values.copy()
    tried = [turned_near(one[:, : len(at)], near, half_turn=180.0) for one in (first, second)]
    off = [np.abs(one - near).sum(axis=1) for one in tried]
    out[:, at] = np.where((off[0] <= off[1])[:, None], *tried)
    return out


def _turned(
    document: Bvh, values: Array, nodes: Mapping[str, int], before: Array, after: Array, base: Motion
) -> Array:
    """Return channels (n, C) of frames whose points (n, P, 3) go from one place to another."""
    from posekit.formats.bvh import positions_are_absolute, world_points

    values = values.copy()
    pieces, body = _pieces(document, nodes)
    turn = turns_between(before, after)
    old: list[Array] = []
    new: list[Array] = []
    for node, parent in enumerate(document.parents):
        local = _local_rotations(document, values, node)
        old.append(local if parent < 0 else old[parent] @ local)
        piece = pieces[node]
        if piece < 0 or not _rotations_of(document, node)[0]:
            new.append(old[node] if parent < 0 else new[parent] @ local)
            continue
        above = new[parent] if parent >= 0 else np.eye(3)
        new.append(turn[:, piece] @ old[node])
        wanted = above.swapaxes(-1, -2) @ new[node]
        rows = np.flatnonzero(np.abs(wanted - local).max(axis=(1, 2)) > 1e-12)
        if rows.size:
            values[rows] = _with_rotation(document, values[rows], node, wanted[rows])
            new[node] = above @ _local_rotations(document, values, node)
    points = world_points(document, absolute=positions_are_absolute(document), values=values)
    trunk = [k for k in TRUNK if JOINTS[k] in nodes]
    shift = after[:, trunk] / _metres(base) - points[:, [nodes[JOINTS[k]] for k in trunk]]
    shift = np.nanmean(shift, axis=1)
    shift[np.linalg.norm(shift, axis=1) < SAME_METRES * 1e-2] = 0.0
    for carrier in _above(document, body):
        places = [
            (document.columns[carrier].start + k, axis)
            for k, (rotates, axis) in enumerate(document.channels[carrier])
            if not rotates
        ]
        if len(places) == 3:
            parent = document.parents[carrier]
            shift = np.einsum("tji,tj->ti", new[parent], shift) if parent >= 0 else shift
            for column, axis in places:
                values[:, column] += shift[:, axis]
            break
    return values


def _filled(document: Bvh, values: Array, filled: NDArray[np.bool_]) -> Array:
    """Interpolate the channels of frames between those around them."""
    values = values.copy()
    rows, before, after, share = between(filled)
    start, end = values[before], values[after]
    values[rows] = start + share * (end - start)
    for node, channels in enumerate(document.channels):
        if rows.size and sum(rotates for rotates, _ in channels) == 3:
            first, last = (_local_rotations(document, one, node) for one in (start, end))
            turn = share * vector_from_rotation(first.swapaxes(1, 2) @ last)
            values[rows] = _with_rotation(document, values[rows], node, first @ rotation_from_vector(turn))
    return values


def _renamed(document: Bvh, nodes: Mapping[str, int]) -> Bvh:
    """Return the file with the names of right and left exchanged: of points, and of all that hangs on limbs."""
    from posekit.formats.bvh import parse

    other: dict[str, str] = {}
    for name, node in nodes.items():
        twin = nodes.get(other_side(name), node)
        ways = _above(document, node), _above(document, twin)
        tops = [[one for one in way if one not in ways[1 - k]][-1:] for k, way in enumerate(ways)]
        below = [
            [k for k, site in enumerate(document.sites) if not site and set(top) & set(_above(document, k))]
            for top in tops
        ]
        other |= {document.names[a]: document.names[b] for a, b in zip(*below, strict=False)}
    head, mark, rest = re.split(r"(^[ \t]*MOTION)", document.text, maxsplit=1, flags=re.M | re.I)
    head = re.sub(
        r"((?:ROOT|JOINT)[ \t]+)([^{}\r\n]*?)(?=[ \t]*[\r\n{])",
        lambda match: match[1] + other.get(" ".join(match[2].split()), match[2]),
        head,
        flags=re.I,
    )
    return replace(parse((head + mark + rest).encode(), ""), values=document.values)
