r"""The figure as a joint tree of animation programs: the root is the pelvis, y is up, z is forward. BVH is written.

The root of the figure's URDF is the torso, whose origin is the neck. Here the root is the pelvis, followed by torso,
neck, shoulders, elbows, hips and knees. Wrists, ankles and head points are leaves without rotation. The URDF's axes are
x forward, y left, z up; here they are x left, y up, z forward. Therefore the rotation
:math:`R_y(\alpha) R_x(\beta) R_z(\gamma)` of a ball joint becomes :math:`R_x(\alpha) R_z(\beta) R_y(\gamma)`, with the
same angles in the same order.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from posekit.errors import refusal
from posekit.files import write_bytes
from posekit.formats.body_checks import METRES
from posekit.formats.bvh import Bvh, holds
from posekit.formats.layout import load_layout
from posekit.formats.trc import even_step, one_recording
from posekit.geometry import UNIT_WORDS, Array, rotation_from_quaternion, up_vector
from posekit.geometry.rotations import coordinate_rotation, rotation_between
from posekit.skeleton import DOFS, POINT

if TYPE_CHECKING:
    from posekit.body import Figure
    from posekit.motion import Motion

#: Rotation from the URDF's axes to x left, y up, z forward.
TO_Y_UP: Final = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
#: Axes of the three angles of a joint, in the order of rotation: x, z, y.
AXIS_ORDER: Final = (0, 2, 1)


class Node(NamedTuple):
    """A joint of the tree: name, name in BVH, index of the parent, link that rotates with it, points of that link."""

    name: str
    bvh: str
    parent: int
    link: str
    points: list[str]


def _nodes() -> tuple[Node, ...]:
    rows = load_layout("bvh_posekit").fields["nodes"]
    index = {row[0]: k for k, row in enumerate(rows)}
    return tuple(Node(name, bvh, index.get(above, -1), *rest) for name, bvh, above, *rest in rows)


#: Joints of the tree in depth-first order, as in files.
NODES: Final = _nodes()


def figure_in_tree(motion: Motion, format: str) -> tuple[Figure, Array, Array]:
    """Return a figure with the person's segment lengths, and its root position and joint angles in each frame.

    Stored configurations of the figure are used unchanged; otherwise closed-form inverse kinematics computes them from
    the joints. An unknown angle has the value of the nearest frame in which it is known. An angle that is unknown in
    all frames is zero, or the limit nearest to zero.

    Parameters
    ----------
    motion : Motion
        One recording.
    format : str
        Name of the file format, for error messages.

    Returns
    -------
    figure : Figure
    root : array (T, 3)
        Position of the pelvis in a world with y up, metres.
    angles : array (T, 21, 3)
        Angles of each node relative to its parent (of the root relative to the world), about x, z and y, radians.

    Raises
    ------
    InputError
        If there are several recordings, or the torso is unknown in a frame.
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
        raise refusal(motion.source, "joints", got, "neck, shoulders and pelvis in all", "write csv or npz")
    rest = np.clip(0.0, figure.limits.lower, figure.limits.upper)
    for k, neutral in zip(figure.angle_index, rest, strict=True):
        known = np.flatnonzero(np.isfinite(q[:, k]))
        middles = (known[1:] + known[:-1]) / 2
        q[:, k] = q[known[np.searchsorted(middles, np.arange(len(q)))], k] if len(known) else neutral
    return figure, *_placed(figure, q, motion.up)


def rest_place(figure: Figure, node: Node) -> Array:
    """Return a node's position (3,) relative to the neck in the neutral configuration, metres, in the URDF's axes."""
    return np.asarray(figure.neutral_points[[POINT[point] for point in node.points]].mean(axis=0))


def offsets(figure: Figure) -> Array:
    """Return each node's position in its parent's frame (21, 3), metres; zero for the root."""
    place = np.stack([rest_place(figure, node) for node in NODES])
    steps = [place[k] - place[one.parent] if one.parent >= 0 else np.zeros(3) for k, one in enumerate(NODES)]
    return np.asarray(np.stack(steps) @ TO_Y_UP.T)


def _placed(figure: Figure, q: Array, up: str) -> tuple[Array, Array]:
    """Convert configurations (T, nq) to the root (T, 3) and the angles (T, 21, 3) of `figure_in_tree`."""
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
    # In the URDF the hips rotate relative to the torso; here the torso rotates relative to the hips, the root.
    R_hips = euler_rotation(angles[:, 0])
    angles[:, 1] = euler_angles(R_hips.transpose(0, 2, 1))
    angles[:, 0] = euler_angles(R_torso @ R_hips)
    return q[:, :3] @ W.T + R_torso @ pelvis, angles


def euler_rotation(angles: Array) -> Array:
    """Return rotation matrices (..., 3, 3) from Euler angles (..., 3) about the axes of `AXIS_ORDER`, radians."""
    x, z, y = (coordinate_rotation(axis, angles[..., k]) for k, axis in enumerate(AXIS_ORDER))
    return np.asarray(x @ z @ y)


def euler_angles(R: Array) -> Array:
    """Return Euler angles (..., 3) of rotation matrices (..., 3, 3), radians; the second is in [-π/2, π/2].

    The third angle is computed after the rotation by the first angle is removed. At gimbal lock (the second angle is a
    quarter turn) the first angle is arbitrary, and the third angle compensates for it.
    """
    from posekit.body.angles import ball_branch

    flat = (TO_Y_UP.T @ R @ TO_Y_UP).reshape(-1, 3, 3)
    return ball_branch(flat).reshape(R.shape[:-1])


def write_bvh(path: str | Path, motion: Motion, *, unit: str | None = None) -> None:
    """Write one recording as BVH, y up; a motion read from BVH keeps its hierarchy, names and channels.

    Joints of the figure have the channels Xrotation Zrotation Yrotation: flexion, abduction (or bending) and rotation.
    Angles and positions have 6 decimals.

    Raises
    ------
    InputError
        If the motion has several recordings, uneven times, or no body.
    """
    if unit is None and isinstance(motion.document, Bvh) and holds(motion.document, motion):
        write_bytes(path, motion.document.text.encode())
        return
    metres = METRES.get(UNIT_WORDS.get(str(unit or "cm").lower(), ""))
    if metres is None:
        raise refusal(path, "unit", repr(unit), f"one of {', '.join(METRES)}", "state one of them")
    from posekit.body.angles import continuous

    figure, root, angles = figure_in_tree(motion, "BVH")
    scale = 1.0 / metres
    values = np.hstack([root * scale, np.degrees(continuous(angles)).reshape(len(root), -1)])
    values = np.round(values, 6) + 0.0  # no -0.000000
    hierarchy = "".join(_block(0, offsets(figure) * scale, 0))
    head = f"HIERARCHY\n{hierarchy}MOTION\nFrames: {len(root)}\nFrame Time: {even_step(motion, 'BVH'):.10f}\n"
    row = " ".join("%.6f" if column.any() else "%d" for column in values.T) + "\n"
    write_bytes(path, (head + "".join(row % tuple(one) for one in values.tolist())).encode("ascii"))


def _block(k: int, steps: Array, depth: int) -> list[str]:
    """Return the lines of BVH of a node and its descendants."""
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
    if not children:  # readers expect an End Site; its offset is zero, as the figure has no hands and no feet
        lines.append(f"{tab}\tEnd Site\n{tab}\t{{\n{tab}\t\tOFFSET 0.0 0.0 0.0\n{tab}\t}}\n")
    for child in children:
        lines += _block(child, steps, depth + 1)
    return [*lines, f"{tab}}}\n"]
