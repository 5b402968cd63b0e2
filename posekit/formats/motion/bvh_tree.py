r"""The figure as animators have it: y up, facing z, the root at the pelvis, parts that turn about joints.

The figure's URDF starts from the torso, whose origin is the neck. Here the tree starts from the hips: pelvis (the
hips), torso (turning about the pelvis), neck (the head), shoulders, elbows, hips, knees; wrists, ankles and the head's
points turn nothing, and the head, between the ears, is a place on the way to those. With all angles at zero the figure
stands with hanging arms, as in the URDF.

With :math:`B` from the URDF's axes (x forward, y left, z up) to these (x left, y up, z forward), a ball joint's
:math:`R_y(\alpha) R_x(\beta) R_z(\gamma)` is :math:`R_x(\alpha) R_z(\beta) R_y(\gamma)`: the angles of the joint, in
its order.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure
from posekit.formats.motion.bvh_angles import euler_angles, euler_rotation
from posekit.formats.motion.motion import UP_DIRECTIONS
from posekit.formats.motion.motion_axes import up_rotation
from posekit.formats.motion.motion_checks import check_time, check_turns
from posekit.geometry import Array, rotation_from_quaternion, unit
from posekit.safe_io import refusal, shown
from posekit.skeleton import DOFS, HEAD_POINTS, POINT, SIDES

TO_Y_UP: Final = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""From the URDF's axes to x left, y up, z forward."""
FARTHEST_PERSON_METRES: Final = 1e6
"""Metres from the origin at which a person may stand."""


class BodyNode(NamedTuple):
    """A place of the tree: its name, its parent's index, the points whose mean it is, the link that turns with it."""

    name: str
    parent: int
    points: tuple[str, ...]
    link: str


def _nodes() -> tuple[BodyNode, ...]:
    nodes = [BodyNode("pelvis", -1, ("pelvis",), "hips"), BodyNode("torso", 0, ("pelvis",), "torso")]

    def add(name: str, parent: str, link: str = "", points: tuple[str, ...] = ()) -> None:
        nodes.append(BodyNode(name, [node.name for node in nodes].index(parent), points or (name,), link))

    add("neck", "torso", "head")
    add("head", "neck", points=("right_ear", "left_ear"))
    for name in HEAD_POINTS:
        add(name, "head")
    for side in SIDES:
        add(f"{side}_shoulder", "torso", f"{side}_upper_arm")
        add(f"{side}_elbow", f"{side}_shoulder", f"{side}_forearm")
        add(f"{side}_wrist", f"{side}_elbow")
    for side in SIDES:
        add(f"{side}_hip", "pelvis", f"{side}_thigh")
        add(f"{side}_knee", f"{side}_hip", f"{side}_shank")
        add(f"{side}_ankle", f"{side}_knee")
    return tuple(nodes)


BODY_NODES: Final = _nodes()
"""Depth first, as a file lists them."""
LEAF_NODES: Final = frozenset(range(len(BODY_NODES))) - {node.parent for node in BODY_NODES}
POINT_NODES: Final = tuple(
    next(k for k, node in enumerate(BODY_NODES) if node.name == name) for name in POINT
)
"""Where each of `posekit.skeleton.POINTS` stands in `BODY_NODES`."""


class PlacedBody(NamedTuple):
    """Configurations in the tree.

    Attributes
    ----------
    root : array (T, 3)
        The pelvis in the world, y up, metres.
    angles : array (T, 21, 3)
        Of each node against its parent (of the first against the world): about x, z and y, radians. NaN where q has
        NaN.
    """

    root: Array
    angles: Array


def neutral_place(figure: Figure, node: BodyNode) -> Array:
    """Return where a node is at the neutral configuration (3,): metres, the URDF's axes, from the neck."""
    return np.asarray(figure.neutral_points[[POINT[point] for point in node.points]].mean(axis=0))


def offsets(figure: Figure) -> Array:
    """Return where each node is in its parent's frame (21, 3), metres; the root's is zero."""
    place = np.stack([neutral_place(figure, node) for node in BODY_NODES])
    steps = [
        place[k] - place[node.parent] if node.parent >= 0 else np.zeros(3)
        for k, node in enumerate(BODY_NODES)
    ]
    return np.asarray(np.stack(steps) @ TO_Y_UP.T)


def checked(path: str | Path, figure: Figure, q: Array, time: Array | None = None, up: str = "+z") -> Array:
    """Return q (T, nq) as float64, or refuse what no file of motion should hold.

    Raises
    ------
    InputError
        Where shapes do not fit, the torso's place is not known, the quaternion is not of unit length, a number is
        infinite, times are not finite and ascending, or `up` is no axis.
    """
    q = np.asarray(q, dtype=np.float64)
    names = figure.configuration_names
    if q.ndim != 2 or q.shape[1] != len(names) or len(q) == 0:
        expected = f"(T, {len(names)}), one row a frame, at least one"
        raise refusal(path, "q", f"shape {q.shape}", expected, "give configurations of this figure")
    known = np.isfinite(q)
    known[:, 7:] |= np.isnan(q[:, 7:])
    if not known.all():
        frame, k = (int(i) for i in np.argwhere(~known)[0])
        raise refusal(
            path, f"q[{frame}].{names[k]}", str(q[frame, k]), "a finite number", "leave that frame out"
        )
    if not (np.abs(q[:, :3]) <= FARTHEST_PERSON_METRES).all():
        frame = int(np.argmax(np.abs(q[:, :3]).max(axis=1)))
        got = f"a torso {np.abs(q[frame, :3]).max():g} m away"
        raise refusal(path, f"q[{frame}]", got, f"{FARTHEST_PERSON_METRES:g} m at most")
    check_turns(path, q)
    if up not in UP_DIRECTIONS:
        raise refusal(path, "up", shown(up), " or ".join(UP_DIRECTIONS), "state which axis of q points up")
    if time is not None:
        check_time(path, np.asarray(time, dtype=np.float64), len(q))
    return q


def place(figure: Figure, q: Array, up: str = "+z") -> PlacedBody:
    """Put configurations (T, nq) into the tree.

    Parameters
    ----------
    figure : Figure
        The figure whose configurations they are.
    q : array (T, nq)
        Finite but for angles, see `checked`.
    up : str
        The axis of q's world that points up; it becomes y.
    """
    W = up_rotation(up, "+y")
    R_torso = W @ rotation_from_quaternion(unit(q[:, 3:7])) @ TO_Y_UP.T
    pelvis = TO_Y_UP @ figure.neutral_points[POINT["pelvis"]]
    own = dict(zip(DOFS, (q[:, figure.angle_index] * figure.limits.sign).T, strict=True))
    angles = np.zeros((len(q), len(BODY_NODES), 3))
    for k, node in enumerate(BODY_NODES):
        for dof in (f"{node.name}.{turn}" for turn in ("flexion", "bending", "abduction", "rotation")):
            if dof in own:
                angles[:, k, _COLUMN[dof.partition(".")[2]]] = own[dof]
    # The URDF turns the hips against the torso; here the torso turns against the hips, and the hips are the root.
    R_hips = euler_rotation(angles[:, 0])
    angles[:, 1] = euler_angles(R_hips.transpose(0, 2, 1))
    angles[:, 0] = euler_angles(R_torso @ R_hips)
    return PlacedBody(q[:, :3] @ W.T + R_torso @ pelvis, angles)


_COLUMN: Final = {"flexion": 0, "bending": 1, "abduction": 1, "rotation": 2}


def filled(path: str | Path, figure: Figure, q: Array, unknown: str) -> Array:
    """Return q without NaN: as `unknown` says, refuse it, or hold what is known.

    Parameters
    ----------
    path : path
        What to call it in errors.
    figure : Figure
        The figure whose configurations they are.
    q : array (T, nq)
        NaN in angles that are not known.
    unknown : str
        ``refuse``; or ``hold``: an angle keeps the value of the nearest frame where it is known, and stands at zero
        (or its limit next to zero) where it never is.
    """
    missing = np.isnan(q)
    if not missing.any():
        return q
    if unknown != "hold":
        frame, k = (int(i) for i in np.argwhere(missing)[0])
        name, count = figure.configuration_names[k], int(missing.any(axis=1).sum())
        got = f"no value for {name} in frame {frame} ({count} such frames)"
        expected = "every angle, for the format marks none as missing"
        raise refusal(path, "q", got, expected, "write csv or npz, or fill it")
    q = q.copy()
    rest = np.clip(0.0, figure.limits.lower, figure.limits.upper)
    for k, neutral in zip(figure.angle_index, rest, strict=True):
        known = np.flatnonzero(~missing[:, k])
        q[:, k] = q[known[nearest_known(known, len(q))], k] if len(known) else neutral
    return q


def nearest_known(known: NDArray[np.intp], count: int) -> NDArray[np.intp]:
    """Return for each of the frames 0 … count - 1 which of the known frames (ascending) is nearest."""
    middles = (known[1:] + known[:-1]) / 2
    return np.searchsorted(middles, np.arange(count))


def known_nodes(figure: Figure, q: Array) -> NDArray[np.int8]:
    """Tell what is known of each node in q (N, nq): 0 nothing, 1 its place, 2 what hangs on it too; (N, 21).

    The torso's place and rotation in the world are in q itself, whether those of the hips are known or not.
    """
    column = dict(zip(figure.configuration_names, q.T, strict=True))
    known = np.zeros((len(q), len(BODY_NODES)), dtype=np.int8)
    turned = np.ones((len(q), len(BODY_NODES)), dtype=bool)
    for k, node in enumerate(BODY_NODES):
        angles = np.array([column[name] for name in column if name.rpartition("_")[0] == node.name])
        free = node.name in ("pelvis", "torso")
        above = np.full(len(q), 2) if free else known[:, node.parent]
        before = turned[:, k] if free else turned[:, node.parent]
        turned[:, k] = before & np.isfinite(angles).all(axis=0)
        # The last of three turns a limb about its own line: the joint at its end is known without it.
        aimed = before & np.isfinite(angles[:2] if node.name.endswith(("shoulder", "hip")) else angles).all(
            axis=0
        )
        known[:, k] = np.where(above == 2, np.where(aimed, 2, 1), 0)
    return known
