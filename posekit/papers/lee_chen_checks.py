"""What Lee & Chen 1985 claim of their method, row by row: equations, the tree, the rules, and §4.1's remarks."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
import pinocchio as pin

from posekit.body import load_figure
from posekit.cameras import lee_chen
from posekit.cameras.head import TABLE_A2, calibrate
from posekit.geometry import Array
from posekit.papers import lee_chen_printed as printed
from posekit.papers.lee_chen_rows import PAPER_TITLE
from posekit.papers.lee_chen_table2 import F, exact_image
from posekit.papers.lee_chen_tables34 import PAPER_CHECKS, PAPER_TOLERANCE, recover_sequence
from posekit.papers.lee_chen_work import LeeChenWork
from posekit.papers.posed import keeps, posed
from posekit.papers.rows import PaperRow, compared
from posekit.skeleton import DOFS, JOINT, JOINTS, PARENTS, TREE_SEGMENTS, segment_name
from posekit.tree import enumerate_leaves
from posekit.validators import Validator, judge, load_ranges, make_checks

FAR_METRES = 1e5
N_BODIES = 300
N_HEADS = 200
IMAGE_NOISE = 1e-6
"""Metres on the image plane, standard deviation: a tenth of a unit of Table A.2(b)'s fourth digit."""

CHIN_AND_CROWN = {"chin": (-0.292, 0.55, 0.0), "crown": (-0.34, 0.74, 0.0)}
"""Two more points of the head, metres, head-centred frame."""

RULE_POSTURES = {
    1: ({"right_shoulder.flexion": 30, "left_shoulder.flexion": 30}, {"left_shoulder.flexion": -30}),
    2: ({"right_shoulder.flexion": 30, "right_hip.flexion": 30}, {"right_hip.flexion": -30}),
    # Turned by -20 degrees, the right hip is in front and the left behind.
    3: (
        {"pelvis.rotation": -20, "right_hip.flexion": -30, "left_hip.flexion": 30},
        {"right_hip.flexion": 30, "left_hip.flexion": -30},
    ),
    4: ({"right_shoulder.abduction": 40}, {"right_shoulder.abduction": 0, "right_shoulder.flexion": 40}),
    5: ({"right_knee.flexion": 60, "left_knee.flexion": 60}, {"left_knee.flexion": 0}),
}
"""By rule of §3.3: angles (degrees) of a posture that its words forbid, and what is changed so that they allow it."""

_row = partial(compared, PAPER_TITLE)


def lee_chen_checks(work: LeeChenWork) -> Iterator[PaperRow]:
    """Yield the rows."""
    yield from _camera_rows()
    yield from _whole_tree_rows(work)
    yield from _body_rows()
    yield from _rule_rows()
    yield from _remark_rows(work)


def _camera_rows() -> Iterator[PaperRow]:
    """Solve eqs. (2)-(5), written out here, and look at noise with more than six points."""
    rows = []
    for (x, y, z), (u, v) in zip(TABLE_A2.points * 100, exact_image() * [100.0, -100.0], strict=True):
        rows.append([x, 0, -u * x, y, 0, -u * y, z, 0, -u * z, 1, 0, -u])
        rows.append([0, x, -v * x, 0, y, -v * y, 0, z, -v * z, 0, 1, -v])
    singular, axes = np.linalg.svd(np.array(rows))[1:]
    S = axes[-1].reshape(4, 3)
    # The sign is that of a camera which has the head before it.
    S *= np.sign(S[3, 2]) / np.linalg.norm(S[:3, 0])
    f = 1 / np.linalg.norm(S[:3, 2])
    R = np.stack([S[:3, 0], S[:3, 1], -f * S[:3, 2]], axis=1)
    x, y, z = R @ [-S[3, 0], -S[3, 1], (S[3, 2] - 1) * f] + 0.0
    rank = int((singular > 1e-9 * singular[0]).sum())
    own = "null space of [A], written out without posekit's cameras"
    yield _row(
        "§2.1, eqs. (2)-(3): twelve unknowns up to a factor",
        "six points suffice",
        f"rank {rank} of 12 unknowns",
        rank == len(singular) - 1,
        own,
    )
    yield _row(
        "§2.1, eqs. (4)-(5): f and the camera position",
        "5 and (400, 0, 0) cm",
        f"{f:.6f} and ({x:.6f}, {abs(y):.6f}, {abs(z):.6f}) cm",
        bool(np.abs([f - 5, x - 400, y, z]).max() < 1e-6),
        f"{own}, exact projections of Table A.2(a)",
    )
    off = float(np.abs(R.T @ R - np.eye(3)).max())
    yield _row("§2.1, eq. (1): [R] is a rotation", "orthonormal", f"{off:.0e} off", off < 1e-6, own)
    more = TABLE_A2.with_points(CHIN_AND_CROWN)
    six, eight = (_camera_error(head.points, head.names) for head in (TABLE_A2, more))
    yield _row(
        "§2.1: more than six points of the head",
        "a more reliable result",
        f"median error {eight:.1f} cm with eight points, {six:.1f} with six",
        eight < six,
        f"{N_HEADS} pictures with the same noise, chin and crown besides",
    )


def _camera_error(points: Array, names: tuple[str, ...]) -> float:
    """Return the median error of the camera's place, centimetres, from noisy points of the head (H, 3)."""
    head = TABLE_A2.with_points(dict(zip(names, points, strict=True)))
    camera = lee_chen.pinhole(F)
    R = np.array([[0.0, 0.0, -1.0], [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0]])
    image = camera.project((head.points @ R.T + [0.0, 0.0, 4.0 + F])[None])[0]
    noise = IMAGE_NOISE * np.random.default_rng(0).normal(size=(N_HEADS, 8, 2))[:, : len(image)]
    pose = calibrate(head, image + noise)
    place = lee_chen.camera_position(pose.R_cam_head, pose.t_cam_head, pose.f) * 100
    return float(np.median(np.linalg.norm(place - [400.0, 0.0, 0.0], axis=1)))


def _whole_tree_rows(work: LeeChenWork) -> Iterator[PaperRow]:
    """Count all leaves, and judge every one of them beside what the tree's pruning left."""
    figure, camera = load_figure(), lee_chen.pinhole(F)
    lengths = np.array([0.0, *(figure.lengths[segment_name(segment)] for segment in TREE_SEGMENTS)])
    points = figure.forward_kinematics(_inside_limits(1))[0] + [0.0, 0.0, FAR_METRES]
    image = camera.project(points[None, :14])[0]
    leaves, _ = enumerate_leaves(camera, points[0], image, parents=PARENTS, lengths=lengths)
    yield _row(
        "§3.1, Fig. 4: paths of the tree",
        "2^i nodes at level i",
        f"{len(leaves)} leaves at level 13",
        len(leaves) == 2**13,
        f"a random posture {FAR_METRES / 1000:g} km away, each leaf lifted on its own: nearer, a wrong start can leave "
        "its segment out of reach",
    )
    view, recovery = recover_sequence("seq1", work.setting)
    tangent = PAPER_TOLERANCE.tangent
    root, head = recovery.fit.root[0], recovery.fit.head[0]
    leaves, codes = enumerate_leaves(
        camera, root, view.image[0], parents=PARENTS, lengths=lengths, tolerance=tangent
    )
    checks = make_checks(
        figure,
        [check for check in PAPER_CHECKS if check.name != "walking"],
        ranges=load_ranges("table1-printed"),
        rigid_tolerance=PAPER_TOLERANCE.rigid,
    )
    whole = np.concatenate([leaves, np.broadcast_to(head, (len(leaves), 5, 3))], axis=1)
    violated = np.any([one.violated.any(axis=1) for one in judge(checks, whole)], axis=0)
    counts = [len(np.unique(codes[~violated] >> (len(JOINTS) - 1 - k))) for k in range(len(JOINTS))]
    ours = recovery.frames[0].levels["physical"].tolist()
    yield _row(
        "§3.1, §4.1.B: pruned at each level, with preceding nodes removed",
        "what all constraints leave of the whole tree",
        f"{' '.join(map(str, ours))} nodes a level",
        counts == ours,
        f"{len(leaves)} leaves of frame 1 of SEQ1, each judged as a whole: {' '.join(map(str, counts))}",
    )


def _inside_limits(count: int) -> Array:
    """Draw configurations (count, nq) inside all limits."""
    figure, rng = load_figure(), np.random.default_rng(1985)
    q: Array = np.tile(pin.neutral(figure.model), (count, 1))
    q[:, figure.angle_index] = rng.uniform(figure.limits.lower, figure.limits.upper, (count, len(DOFS)))
    return q


def _body_rows() -> Iterator[PaperRow]:
    """Ask which way a bent knee turns, and coal about collisions."""
    validator = Validator(strict=True, checks=("collision",))
    figure = validator.figure
    signs = []
    for limb in (("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle")):
        joints = posed(figure, {f"right_{limb[1]}.flexion": 60.0})[0][0]
        a, b, c = (joints[JOINT[f"right_{name}"]] for name in limb)
        left = joints[JOINT["left_shoulder"]] - joints[JOINT["right_shoulder"]]
        signs.append("non-negative" if np.cross(c - b, b - a) @ left >= 0 else "negative")
    yield _row(
        "§3.2.A(ii): flexion of the knee",
        "w = v x u has a non-negative z, 'similarly' to the elbow's",
        f"{signs[0]} at the elbow, {signs[1]} at the knee",
        signs == ["non-negative"] * 2,
        "elbow and knee bent by 60 degrees through Pinocchio",
        "a shank goes backward: the sign is the opposite",
    )
    q = _inside_limits(N_BODIES)
    points = figure.forward_kinematics(q)
    verdicts = validator.check(points[:, :14], points[:, 14:], configured=False).verdicts
    data, geometry_data = figure.model.createData(), figure.geometry.createData()
    hit = [pin.computeCollisions(figure.model, data, figure.geometry, geometry_data, one, True) for one in q]
    alike = sum((one == "invalid") == other for one, other in zip(verdicts, hit, strict=True))
    yield _row(
        "§3.2.C: collisions",
        "arms, legs and torso may not penetrate",
        f"{alike} of {N_BODIES} verdicts alike, {sum(hit)} collide",
        alike == N_BODIES,
        "closed form on the joints against coal on the URDF's bodies, random postures inside all limits",
    )


def _rule_rows() -> Iterator[PaperRow]:
    """Ask each rule about a posture that its words forbid, and one that they allow."""
    for rule, (forbidden, change) in RULE_POSTURES.items():
        validator = Validator(strict=True, checks=("walking",), rules=(rule,), walkers="paper-printed")
        kept = keeps(validator, [forbidden, forbidden | change])
        yield _row(
            f"§3.3, Rule {rule}",
            "forbids and allows by its words",
            " / ".join("kept" if one else "rejected" for one in kept),
            kept == [False, True],
            f"a body with {_named(forbidden)} degrees, then with {_named(change)}",
        )
    validator = Validator(strict=True, checks=("walking",), rules=(2,), walkers="paper-printed")
    (kept_standing,) = keeps(validator, [{"neck.rotation": 15.0}])
    yield _row(
        "§3.3: the body plane by the normal of the head",
        "without swing, no rule applies",
        f"Rule 2 {'keeps' if kept_standing else 'rejects'} who stands and turns the head by 15 degrees",
        kept_standing,
        "`--walkers paper-printed`",
        "the plane turns with the head, and what hangs lies before or behind it; `--walkers paper` asks the trunk",
    )


def _named(angles: dict[str, int]) -> str:
    return ", ".join(
        f"{dof.replace('_', ' ').replace('.', ' ')} {degrees}" for dof, degrees in angles.items()
    )


def _remark_rows(work: LeeChenWork) -> Iterator[PaperRow]:
    """Ask of all settings what §4.1.B says of both tables, and of the print itself."""
    pelvis, left = JOINT["pelvis"], JOINT["left_shoulder"]
    for name, counts in work.counts.items():
        share = float((counts.physical[:, :, pelvis] == counts.physical[:, :, left]).mean())
        theirs = np.array(printed.PRINTED_PHYSICAL[name])
        yield _row(
            f"§4.1.B(i), {name.upper()}: the pelvis",
            "one solution, square to its ray: in all frames",
            f"in {share:.0%} of the settings' frames",
            share == 1.0,
            f"levels 2 and 3; the print has it in {(theirs[:, pelvis] == theirs[:, left]).mean():.0%}",
            "the gait's torso leans, and is seldom square to its ray",
        )
    means = [float(counts.physical[:, :, pelvis].mean()) for counts in work.counts.values()]
    yield _row(
        "§4.1.B(iii): distances inside the torso",
        "decide more in SEQ2 than in SEQ1",
        f"{means[1]:.2f} torsos are left in SEQ2, {means[0]:.2f} in SEQ1",
        means[1] < means[0],
        "mean over all settings and frames",
    )
    beyond = work.shoulders.beyond
    doubled = (work.shoulders.loose.physical[:, 0, 2] == 4).mean()
    single = work.counts["seq1"].physical[:, 0, 2]
    yield _row(
        "Table 3, frame 1: the shoulders",
        "2 and 4 nodes",
        f"4 nodes in {(single == 4).mean():.0%} of the settings with 1 mm allowed, in {doubled:.0%} with 1 cm",
        bool((single == 4).all()),
        f"from an untrue shoulder the elbow's ray passes up to {1000 * beyond.max():.1f} mm out of reach, in "
        f"{(beyond > PAPER_TOLERANCE.tangent).mean():.0%} of the arms by more than is allowed",
        "the paper allows more than 1 mm, and does not say how much",
    )
    for name, counts in work.counts.items():
        share = float(counts.truth.mean())
        yield _row(
            f"§4.2, {name.upper()}: the input is left by Rules 1-5",
            "yes",
            f"{'yes' if counts.truth[work.chosen] else 'no'} at the closest setting",
            bool(counts.truth[work.chosen]),
            f"its joints among the survivors; in {share:.0%} of all settings",
            "the rules reject the gait itself in parts of its cycle",
        )
