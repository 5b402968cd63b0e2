"""Views of real motion for `benchmarks/torso.py`: every torso that their trees hold, and how near the truth it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from posekit.body.frames import torso_frame
from posekit.settings import MEASURED_TOLERANCE
from posekit.skeleton import JOINT, JOINTS, PARENTS, RIGID_SEGMENTS, SEGMENTS, TREE_SEGMENTS, segment_name
from posekit.synthesis import Capture, SyntheticScene
from posekit.tree import InterpretationTree, Leaves
from posekit.tree.bits import path_of
from posekit.validators import load_ranges, make_checks

Floats = NDArray[np.float64]

CHECK_NAMES = ("rigid-parts", "joint-range", "collision")
LOOSE_METRES = 0.12
"""Metres: torsos whose distances are off by more are not looked at."""

NEAR_METRES = 0.01
"""Metres of mean joint error within which a survivor is the truth."""

N_TRUNK_JOINTS = 6
"""Joints of torso and hips: the first six, five branches."""

ELEVATION_DEGREES, RETRACTION_DEGREES = 13.0, 22.0
"""Degrees that the clavicle rises and goes back until the arm is overhead: the middles of 11 to 15 and 15 to 29
(Ludewig et al. 2004, J Orthop Sports Phys Ther 34:140, 39 people)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Torsos:
    """T torsos that some leaf of F views has, the leaves judged by all checks but the rigid parts.

    Parameters
    ----------
    view, clip : int array (T,)
    joints : array (T, 6, 3)
        Camera frame, metres.
    off : array (T, 4)
        By how much each rigid distance is longer than the figure's, metres.
    off_truth : array (T, 4)
        The same against the frame's own distances.
    count : int array (T,)
        Leaves that have this torso.
    near, true, branch : bool array (T,)
        Whether one of them is within `NEAR_METRES` of the truth; whether it takes the true branch at every joint;
        whether the torso itself does.
    """

    view: NDArray[np.intp]
    clip: NDArray[np.intp]
    joints: Floats
    off: Floats
    off_truth: Floats
    count: NDArray[np.intp]
    near: NDArray[np.bool_]
    true: NDArray[np.bool_]
    branch: NDArray[np.bool_]

    @property
    def views(self) -> int:
        """Number of views that have any."""
        return int(self.view.max()) + 1


def torsos_of(
    scenes: Sequence[SyntheticScene], ranges: str, *, own_lengths: bool = False, spine: float = 0.0
) -> Torsos:
    """Grow the trees of scenes, one a clip, with hardly any check of the rigid parts.

    Parameters
    ----------
    ranges : str
    own_lengths : bool
        Lift the torso with each frame's own lengths instead of the clip's medians.
    spine : float
        Metres by which the distance from neck to pelvis is lifted longer than it is taken to be.
    """
    table, parts, seen = load_ranges(ranges), [], 0
    for clip, scene in enumerate(scenes):
        checks = make_checks(
            scene.figure,
            CHECK_NAMES,
            ranges=table,
            rigid_tolerance=LOOSE_METRES,
            rigid_mode="distances",
            angle_tolerance=MEASURED_TOLERANCE.angle,
        )
        truth = scene.joints_cam
        ends = np.array(SEGMENTS)
        own = np.linalg.norm(truth[:, ends[:, 0]] - truth[:, ends[:, 1]], axis=-1)
        figure = np.array([scene.figure.lengths[segment_name(segment)] for segment in SEGMENTS])
        lengths = np.zeros((len(JOINTS), len(scene), 1))
        for k, (_, joint) in enumerate(TREE_SEGMENTS):
            lengths[joint, :, 0] = own[:, k] if own_lengths and joint < N_TRUNK_JOINTS else figure[k]
        lengths[JOINT["pelvis"]] += spine
        tree = InterpretationTree(joints=JOINTS, parents=PARENTS, lengths=lengths)
        leaves = tree.grow(
            scene.camera,
            truth[:, 0],
            scene.image,
            checks,
            given=scene.head_cam,
            tolerance=MEASURED_TOLERANCE.tangent,
        )
        split = len(TREE_SEGMENTS)
        parts.append(_torsos(leaves, truth, figure[split:], own[:, split:], clip, seen))
        seen += len(scene)
    names = [field.name for field in fields(Torsos)]
    return Torsos(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


def _torsos(leaves: Leaves, truth: Floats, figure: Floats, own: Floats, clip: int, first_view: int) -> Torsos:
    code = true_codes(leaves, truth)
    shift = len(TREE_SEGMENTS) - (N_TRUNK_JOINTS - 1)
    key = (leaves.frame.astype(np.intp) << (N_TRUNK_JOINTS - 1)) | (leaves.code >> shift)
    keys, first, torso = np.unique(key, return_index=True, return_inverse=True)
    frame = keys >> (N_TRUNK_JOINTS - 1)
    postures = leaves.postures()
    error = np.linalg.norm(postures - truth[leaves.frame], axis=-1).mean(axis=1)
    joints = postures[first][:, :N_TRUNK_JOINTS]
    ends = np.array(RIGID_SEGMENTS)
    away = np.linalg.norm(joints[:, ends[:, 0]] - joints[:, ends[:, 1]], axis=-1)
    return Torsos(
        view=frame + first_view,
        clip=np.full(len(keys), clip),
        joints=joints,
        off=away - figure,
        off_truth=away - own[frame],
        count=np.bincount(torso, minlength=len(keys)),
        near=np.bincount(torso, error < NEAR_METRES, len(keys)) > 0,
        true=np.bincount(torso, leaves.code == code[leaves.frame], len(keys)) > 0,
        branch=(code >> shift)[frame] == (keys & ((1 << (N_TRUNK_JOINTS - 1)) - 1)),
    )


def true_codes(leaves: Leaves, truth: Floats) -> NDArray[np.intp]:
    """Follow, from the root, the candidate that is nearer to the true joint (F,); see `real_motion.true_code`."""
    frames = np.arange(len(truth))
    bits = np.zeros((len(JOINTS), len(truth)), dtype=np.intp)
    code = np.zeros(len(truth), dtype=np.intp)
    for joint in range(1, len(JOINTS)):
        path = np.zeros(len(truth), dtype=np.intp)
        for ancestor in path_of(PARENTS[joint], PARENTS):
            path = path << 1 | bits[ancestor]
        placed = leaves.candidates.positions[joint]
        away = np.stack(
            [np.linalg.norm(placed[frames, 2 * path + bit] - truth[:, joint], axis=-1) for bit in (0, 1)]
        )
        bits[joint] = np.argmin(np.where(np.isnan(away), np.inf, away), axis=0)
        code = code << 1 | bits[joint]
    return code


def per_spine_length(joints: Floats) -> Floats:
    """Return how fast each rigid distance changes with the length from neck to pelvis (T, 4), to first order.

    The pelvis moves along its ray so that the length changes, the hips along theirs so that theirs do not. Where the
    spine is at right angles to the ray that is without bound: it is capped at 50.
    """
    ray = joints / np.linalg.norm(joints, axis=-1, keepdims=True)

    def direction(a: int, b: int) -> Floats:
        along = joints[:, b] - joints[:, a]
        return np.asarray(along / np.linalg.norm(along, axis=-1, keepdims=True))

    moved = np.zeros_like(joints)
    for parent, joint in TREE_SEGMENTS[2 : N_TRUNK_JOINTS - 1]:
        along = direction(parent, joint)
        slope = np.einsum("ni,ni->n", along, ray[:, joint])
        slope = np.where(np.abs(slope) < 0.02, np.copysign(0.02, slope), slope)
        gain = (parent == 0) + np.einsum("ni,ni->n", along, moved[:, parent])
        moved[:, joint] = (gain / slope)[:, None] * ray[:, joint]
    return np.stack(
        [np.einsum("ni,ni->n", direction(a, b), moved[:, b] - moved[:, a]) for a, b in RIGID_SEGMENTS],
        axis=1,
    )


def with_clavicles(capture: Capture) -> Capture:
    """Let the shoulders follow the arms, which recordings of skeletons without clavicles do not show.

    Clavicle and scapula turn about a point 2 cm beside the torso's midline and 6 cm before the line of the shoulders,
    in proportion to the arm's elevation; the arm goes with them.
    """
    points = np.array(capture.points)
    joints = points[:, :4].copy()
    R = torso_frame(*np.moveaxis(joints, 1, 0))
    middle = (joints[:, 1] + joints[:, 2]) / 2
    forward_axis, left_axis, up_axis = np.moveaxis(R, 2, 0)
    for sign, side in ((-1.0, "right"), (1.0, "left")):
        shoulder, elbow, wrist = (JOINT[f"{side}_{name}"] for name in ("shoulder", "elbow", "wrist"))
        arm = points[:, elbow] - points[:, shoulder]
        hanging = -np.einsum("ni,ni->n", arm, up_axis) / np.linalg.norm(arm, axis=1)
        raised = np.arccos(np.clip(hanging, -1.0, 1.0)) / np.pi
        pivot = middle + 0.02 * sign * left_axis + 0.06 * forward_axis
        forward, left, height = np.einsum("nji,nj->in", R, points[:, shoulder] - pivot)
        beside = sign * left
        back, up = np.radians(RETRACTION_DEGREES) * raised, np.radians(ELEVATION_DEGREES) * raised
        forward, beside = (
            forward * np.cos(back) - beside * np.sin(back),
            beside * np.cos(back) + forward * np.sin(back),
        )
        level = np.hypot(forward, beside)
        stretch = np.cos(up) - height / level * np.sin(up)
        height = height * np.cos(up) + level * np.sin(up)
        new = np.einsum("nij,jn->ni", R, np.stack([forward * stretch, sign * beside * stretch, height]))
        points[:, [shoulder, elbow, wrist]] += (pivot + new - points[:, shoulder])[:, None]
    return replace(capture, points=points)


def with_spine(capture: Capture, times: float) -> Capture:
    """Let the distance from neck to pelvis vary so many times as much about its median; the legs go with it."""
    points = np.array(capture.points)
    moving = [JOINT[name] for name in JOINTS if name == "pelvis" or name.split("_")[-1] in LOWER_LIMB]
    for clip in range(len(capture.names)):
        rows = np.flatnonzero(capture.clip == clip)
        spine = points[rows, JOINT["pelvis"]] - points[rows, 0]
        length = np.linalg.norm(spine, axis=1)
        more = (times - 1) * (length - np.nanmedian(length)) / length
        points[rows[:, None], moving] += (more[:, None] * spine)[:, None]
    return replace(capture, points=points)


LOWER_LIMB = ("hip", "knee", "ankle")
