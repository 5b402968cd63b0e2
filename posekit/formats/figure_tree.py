r"""The figure as animation programs have it: a tree from the pelvis, y up, facing z; written as BVH.

The figure's URDF starts from the torso, whose origin is the neck. Here the tree starts from the pelvis (the hips):
torso (turning about the pelvis), neck (the head), shoulders, elbows, hips, knees; wrists, ankles and head points turn
nothing. With B from the URDF's axes (x forward, y left, z up) to these (x left, y up, z forward), a ball joint's
:math:`R_y(\alpha) R_x(\beta) R_z(\gamma)` is :math:`R_x(\alpha) R_z(\beta) R_y(\gamma)`: the angles of the joint, in
its order.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from posekit.errors import refusal
from posekit.files import write_bytes
from posekit.formats.body_checks import METRES
from posekit.formats.bvh import Bvh, holds
from posekit.formats.layout import load_layout
from posekit.formats.trc import even_step, one_recording
from posekit.geometry import Array, rotation_from_quaternion, up_vector
from posekit.geometry.rotations import coordinate_rotation, rotation_between
from posekit.skeleton import DOFS, POINT

if TYPE_CHECKING:
    from posekit.body import Figure
    from posekit.motion import Motion

#: From the URDF's axes to x left, y up, z forward.
TO_Y_UP: Final = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
#: Axes of the three angles of a joint, in their order: x, z, y.
AXIS_ORDER: Final = (0, 2, 1)


class Node(NamedTuple):
    """A joint of the tree: its name, its name in BVH, its parent's index, the link that turns with it, its points."""

    name: str
    bvh: str
    parent: int
    link: str
    points: list[str]


def _nodes() -> tuple[Node, ...]:
    rows = load_layout("bvh_posekit").fields["nodes"]
    index = {row[0]: k for k, row in enumerate(rows)}
    return tuple(Node(name, bvh, index.get(above, -1), *rest) for name, bvh, above, *rest in rows)


#: Depth first, as a file lists them.
NODES: Final = _nodes()


def figure_in_tree(motion: Motion, format: str) -> tuple[Figure, Array, Array]:
    """Return a figure with the person's lengths, and the root and angles of its tree in each frame of a recording.

    Stored configurations of the figure are used unchanged; otherwise they are computed from the joints in closed
    form. An unknown angle keeps the value of the nearest frame that has it; one that is never known stands at zero, or
    at its limit next to zero.

    Parameters
    ----------
    motion : Motion
    format : str
        Name of the format, for errors.

    Returns
    -------
    figure : Figure
    root : array (T, 3)
        The pelvis in the world, y up, metres.
    angles : array (T, 21, 3)
        Angles of each node against its parent (the first against the world), about x, z and y, radians.

    Raises
    ------
    InputError
        If there are several recordings, or a frame has no torso, to which head and limbs are attached.
    """
    from posekit.body import load_figure, scaled_to, segment_lengths

    figure = load_figure()
    if motion.joints is not None:
        one_recording(motion, format)
        joints = motion.figure_joints
        lengths = segment_lengths(joints)
        if any(abs(lengths.get(name, own) - own) > 1e-6 for name, own in figure.lengths.items()):
            figure = scaled_to(joints)
    own = motion.robot in ("figure", "stick_figure")
    if own and motion.q is not None and motion.q.shape[1] == figure.model.nq:
        q = np.array(motion.q)
    elif motion.joints is not None:
        q = np.array(figure.configurations(motion.figure_joints, motion.head).q)
    else:
        got = f"configurations of {motion.robot or 'a robot'}"
        raise refusal(motion.source, "", got, "joints, or a figure's configurations", "write csv or npz")
    lost = np.isnan(q[:, :7]).any(axis=1)
    if lost.any():
        frame = int(np.argmax(lost))
        got = f"no torso in frame {frame} ({int(lost.sum())} of {len(q)} frames)"
        raise refusal(motion.source, "joints", got, "neck, shoulders and pelvis in each", "write csv or npz")
    rest = np.clip(0.0, figure.limits.lower, figure.limits.upper)
    for k, neutral in zip(figure.angle_index, rest, strict=True):
        known = np.flatnonzero(np.isfinite(q[:, k]))
        middles = (known[1:] + known[:-1]) / 2
        q[:, k] = q[known[np.searchsorted(middles, np.arange(len(q)))], k] if len(known) else neutral
    return figure, *_placed(figure, q, motion.up)


def rest_place(figure: Figure, node: Node) -> Array:
    """Return the place (3,) of a node at the neutral configuration, metres, the URDF's axes, from the neck."""
    return np.asarray(figure.neutral_points[[POINT[point] for point in node.points]].mean(axis=0))


def offsets(figure: Figure) -> Array:
    """Return each node's place in its parent's frame (21, 3), metres; the root's is zero."""
    place = np.stack([rest_place(figure, node) for node in NODES])
    steps = [place[k] - place[one.parent] if one.parent >= 0 else np.zeros(3) for k, one in enumerate(NODES)]
    return np.asarray(np.stack(steps) @ TO_Y_UP.T)


def _placed(figure: Figure, q: Array, up: str) -> tuple[Array, Array]:
    """Put configurations (T, nq) into the tree: the root (T, 3) and the angles (T, 21, 3) of `figure_in_tree`."""
    W = rotation_between(up_vector(up or "+z"), up_vector("+y"))
    R_torso = W @ rotation_from_quaternion(q[:, 3:7]) @ TO_Y_UP.T
    pelvis = TO_Y_UP @ figure.neutral_points[POINT["pelvis"]]
    own = dict(zip(DOFS, (q[:, figure.angle_index] * figure.limits.sign).T, strict=True))
    column = {"flexion": 0, "bending": 1, "abduction": 1, "rotation": 2}
    angles = np.zeros((len(q), len(NODES), 3))
    for k, node in enumerate(NODES):
        for turn, place in column.items():
            if f"{node.name}.{turn}" in own:
                angles[:, k, place] = own[f"{node.name}.{turn}"]
    # The URDF turns the hips against the torso; here the torso turns against the hips, and the hips are the root.
    R_hips = euler_rotation(angles[:, 0])
    angles[:, 1] = euler_angles(R_hips.transpose(0, 2, 1))
    angles[:, 0] = euler_angles(R_torso @ R_hips)
    return q[:, :3] @ W.T + R_torso @ pelvis, angles


def euler_rotation(angles: Array) -> Array:
    """Return the rotations (..., 3, 3) of angles (..., 3), radians, in the order of `AXIS_ORDER`."""
    x, z, y = (coordinate_rotation(axis, angles[..., k]) for k, axis in enumerate(AXIS_ORDER))
    return np.asarray(x @ z @ y)


def euler_angles(R: Array) -> Array:
    """Return the angles (..., 3) of rotations (..., 3, 3), radians, the middle one within a quarter turn.

    The first is taken out of the rotation before the last is read: where the middle one is a quarter turn the first is
    arbitrary, and the last makes up for it.
    """
    from posekit.body.angles import ball_branch

    flat = (TO_Y_UP.T @ R @ TO_Y_UP).reshape(-1, 3, 3)
    return ball_branch(flat).reshape(R.shape[:-1])


def write_bvh(path: str | Path, motion: Motion, *, unit: str = "cm", **_: Any) -> None:
    """Write one recording as BVH, y up; a motion that came from BVH keeps its hierarchy, names and channels.

    Joints of the figure have the channels Xrotation Zrotation Yrotation: flexion, abduction (or bending) and rotation.
    Angles and places have 6 decimals.

    Raises
    ------
    InputError
        If the motion has several recordings, uneven times, or no body.
    """
    if isinstance(motion.document, Bvh) and holds(motion.document, motion):
        write_bytes(path, motion.document.text.encode())
        return
    if unit not in METRES:
        raise refusal(path, "unit", repr(unit), f"one of {', '.join(METRES)}", "state one of them")
    from posekit.body.angles import continuous

    figure, root, angles = figure_in_tree(motion, "BVH")
    scale = 1.0 / METRES[unit]
    values = np.hstack([root * scale, np.degrees(continuous(angles)).reshape(len(root), -1)])
    values = np.round(values, 6) + 0.0  # no -0.000000
    hierarchy = "".join(_block(0, offsets(figure) * scale, 0))
    head = f"HIERARCHY\n{hierarchy}MOTION\nFrames: {len(root)}\nFrame Time: {even_step(motion, 'BVH'):.10f}\n"
    row = " ".join("%.6f" if column.any() else "%d" for column in values.T) + "\n"
    write_bytes(path, (head + "".join(row % tuple(one) for one in values.tolist())).encode("ascii"))


def _block(k: int, steps: Array, depth: int) -> list[str]:
    """Write a node and its descendants as lines of BVH; the tree is 6 levels deep."""
    tab, node = "\t" * depth, NODES[k]
    x, y, z = np.round(steps[k], 8) + 0.0
    turns = " ".join(f"{'XYZ'[axis]}rotation" for axis in AXIS_ORDER)
    moves = "Xposition Yposition Zposition "
    lines = [
        f"{tab}{'JOINT' if depth else 'ROOT'} {node.bvh}\n{tab}{{\n",
        f"{tab}\tOFFSET {x:.8f} {y:.8f} {z:.8f}\n",
        f"{tab}\tCHANNELS {3 if depth else 6} {'' if depth else moves}{turns}\n",
    ]
    children = [child for child, other in enumerate(NODES) if other.parent == k]
    if not children:  # a reader expects an end; the figure has no hands and no feet, so it has no length
        lines.append(f"{tab}\tEnd Site\n{tab}\t{{\n{tab}\t\tOFFSET 0.0 0.0 0.0\n{tab}\t}}\n")
    for child in children:
        lines += _block(child, steps, depth + 1)
    return [*lines, f"{tab}}}\n"]
