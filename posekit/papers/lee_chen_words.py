"""Figures, formulas and remarks of Lee & Chen 1985, row by row: what is said beside the tables."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import product

import numpy as np

from posekit.body import load_figure
from posekit.cameras.head import TABLE_A2
from posekit.geometry import Array, unit
from posekit.papers import lee_chen_printed as printed
from posekit.papers.lee_chen_rows import OPEN_STEPS, OPEN_WALKS, PAPER_TITLE
from posekit.papers.lee_chen_tables34 import PAPER_TOLERANCE, SAME_POSTURE_METRES, recover_sequence
from posekit.papers.lee_chen_work import LeeChenWork
from posekit.papers.rows import PaperRow, compared
from posekit.skeleton import JOINT, JOINTS, PARENTS, SIDES
from posekit.synthesis.random_postures import random_postures
from posekit.validators import Validator, joint_range, load_ranges

N_FORMULA_BODIES = 200
FORMULA_DEGREES = 1e-5
"""What the arc cosine of the formulas, written out, loses near 0 and 180 degrees is a tenth of it."""

CLASS_SIZES = (3, 4, 4, 2)
"""Joints of the classes (a) to (d) of §2.2."""

PRINTED_DECISIONS = {
    "seq1": "Rule 3 by the right shoulder and the left hip, Rule 5 by the left ankle; two right wrists are left",
    "seq2": "one of six has a twisted torso, Rule 4 rejects four by an arm or a leg",
}
"""What §4.2 says decides frame 1."""

_row = partial(compared, PAPER_TITLE)


def lee_chen_words(work: LeeChenWork) -> Iterator[PaperRow]:
    """Yield the rows."""
    yield from _figure_rows()
    yield from _formula_rows()
    yield _torso_row(work)
    yield from _level_rows(work)
    yield from _decision_rows(work)


def _figure_rows() -> Iterator[PaperRow]:
    """Count what Fig. 1 and §2.2 count, and ask the printed tables of Fig. 2's frames."""
    joints, segments = len(JOINTS), len(load_figure().lengths)
    yield _row(
        "Fig. 1: the stick figure",
        "14 joints and 17 segments",
        f"{joints} joints and {segments} segments",
        (joints, segments) == (14, 17),
        "the figure's joints, and the distances in it that are rigid",
    )
    # Both frames by the print's own digits: A.2(a), its eye corrected, carried onto Table 2(d).
    linear = np.linalg.lstsq(np.column_stack([TABLE_A2.points * 100, np.ones(6)]), printed.PRINTED_HEAD)[0][
        :3
    ]
    determinant = float(np.linalg.det(linear))
    yield _row(
        "Fig. 2: the two frames",
        "the head's right-handed, the camera's left-handed",
        f"determinant {determinant:.2f} from one to the other",
        abs(determinant + 1) < 0.01,
        "the linear map from Table A.2(a) to Table 2(d), least squares",
    )
    depth = [0] * len(JOINTS)
    for joint in range(1, len(JOINTS)):
        depth[joint] = depth[PARENTS[joint]] + 1
    sizes = tuple(depth.count(k) for k in range(1, max(depth) + 1))
    yield _row(
        "§2.2: classes (a) to (d)",
        "3, 4, 4 and 2 joints, by the length of their paths from the neck; one class after another",
        f"{', '.join(map(str, sizes))} joints, {'in' if depth == sorted(depth) else 'out of'} order",
        sizes == CLASS_SIZES and depth == sorted(depth),
        "segments between each joint and the neck, in the order of the tree",
    )


def _formula_rows() -> Iterator[PaperRow]:
    """Write the angles of §3.2.A out as printed, beside what `table1-printed` finds on random bodies."""
    figure = load_figure()
    bodies = random_postures(figure, N_FORMULA_BODIES, np.random.default_rng(32))
    points = figure.forward_kinematics(bodies)
    found: dict[str, Array] = {}
    for check in joint_range(figure, load_ranges("table1-printed")):
        values = check.judge(points[:, check.points]).value
        found |= dict(zip(check.where, values.T, strict=True))
    axes = _torso_axes(points)
    for part, says, angles in (
        ("(i): shoulder and hip", "angles of the projections on xy and yz", _ball_angles(points, axes)),
        (
            "(ii): elbow and knee",
            "the angle from v to u, by the sign of (v x u) z",
            _hinge_angles(points, axes),
        ),
        (
            "(iii): pelvis",
            "angles of the hip plane's normal, and of its middle",
            _pelvis_angles(points, axes),
        ),
        ("(iv): neck", "in the same manner, of the head's plane", _neck_angles(points, axes)),
    ):
        sided = not part.startswith(
            ("(iii)", "(iv)")
        )  # the paper counts bending and turning alike to both sides
        own = {where: found[where] if sided else np.abs(found[where]) for where in angles}
        off = [np.mod(own[where] - angle + 180, 360) - 180 for where, angle in angles.items()]
        told = np.isfinite(off)
        worst = float(np.abs(np.array(off)[told]).max())
        yield _row(
            f"§3.2.A{part}",
            says,
            f"{worst:.0e} degrees off at most, {told.mean():.1%} told",
            worst < FORMULA_DEGREES and bool(told.mean() > 0.9),
            f"written out by arc cosines, for {N_FORMULA_BODIES} random bodies; `table1-printed` tells no angle of a "
            "projection shorter than a tenth",
        )


def _torso_axes(points: Array) -> Array:
    """Return x = y x z, y from neck to pelvis and z from right to left shoulder as rows (N, 3, 3)."""
    y = unit(points[:, JOINT["pelvis"]] - points[:, JOINT["neck"]])
    z = unit(points[:, JOINT["left_shoulder"]] - points[:, JOINT["right_shoulder"]])
    return np.stack([np.cross(y, z), y, z], axis=1)


def _between(along: Array, across: Array) -> Array:
    """Return the angle (N,), degrees, from an axis to the projection with these two parts, 0 to 180."""
    return np.degrees(np.arccos(np.clip(along / np.hypot(along, across), -1.0, 1.0)))


def _part(points: Array, axes: Array, start: str, end: str) -> Array:
    """Return a segment in the torso's axes, x, y, z first (3, N)."""
    part: Array = np.einsum("nij,nj->in", axes, points[:, JOINT[end]] - points[:, JOINT[start]])
    return part


def _ball_angles(points: Array, axes: Array) -> dict[str, Array]:
    angles = {}
    for side, outward in zip(SIDES, (-1.0, 1.0), strict=True):
        for ball, end in (("shoulder", "elbow"), ("hip", "knee")):
            x, y, z = _part(points, axes, f"{side}_{ball}", f"{side}_{end}")
            angles[f"{side}_{ball}.flexion"] = np.sign(x) * _between(y, x)
            angles[f"{side}_{ball}.abduction"] = np.sign(outward * z) * _between(y, z)
    return angles


def _hinge_angles(points: Array, axes: Array) -> dict[str, Array]:
    angles = {}
    for side in SIDES:
        for joints, forward in ((("shoulder", "elbow", "wrist"), 1.0), (("hip", "knee", "ankle"), -1.0)):
            start, middle, end = (f"{side}_{joint}" for joint in joints)
            u, v = (unit(_part(points, axes, a, b).T) for a, b in ((start, middle), (middle, end)))
            bend = np.degrees(np.arccos(np.clip((u * v).sum(axis=1), -1.0, 1.0)))
            angles[f"{middle}.flexion"] = np.where(forward * np.cross(v, u)[:, 2] >= 0, bend, -bend)
    return angles


def _pelvis_angles(points: Array, axes: Array) -> dict[str, Array]:
    right, left = (_part(points, axes, "pelvis", f"{side}_hip").T for side in SIDES)
    middle = (right + left) / 2
    return _plane_angles("pelvis", np.cross(middle, left - right), middle)


def _neck_angles(points: Array, axes: Array) -> dict[str, Array]:
    """Carry the head's axes, forward and up in Table A.2, to where its points are."""
    moved = points[:, [0, *range(14, 19)]] - points[:, :1]
    linear = np.array([np.linalg.lstsq(TABLE_A2.points - TABLE_A2.points[0], each)[0] for each in moved])
    forward, up = (np.einsum("nij,nj->ni", axes, linear[:, k]) for k in (0, 1))
    return _plane_angles("neck", forward, -up)


def _plane_angles(joint: str, normal: Array, along: Array) -> dict[str, Array]:
    """Return flexion, rotation and bending without their sides, which the paper counts alike."""
    (nx, ny, nz), (_, ay, az) = normal.T, along.T
    return {
        f"{joint}.flexion": _between(nx, ny),
        f"{joint}.rotation": _between(nx, nz),
        f"{joint}.bending": _between(ay, az),
    }


def _torso_row(work: LeeChenWork) -> PaperRow:
    """Measure the distance between all pairs of shoulders of SEQ2's frame 1."""
    truth = recover_sequence("seq2", work.setting)[0].truth[0]
    places = []
    for joint in (1, 2):
        ray, length = truth[joint] / truth[joint, 2], printed.TABLE_A1["neck", JOINTS[joint]] / 100
        roots = np.roots([ray @ ray, -2 * ray @ truth[0], truth[0] @ truth[0] - length**2]).real
        places.append([root * ray for root in roots])
    pairs = np.array(list(product(*places)))
    wanted = printed.TABLE_A1["right_shoulder", "left_shoulder"] / 100
    kept = pairs[np.abs(np.linalg.norm(pairs[:, 0] - pairs[:, 1], axis=1) - wanted) < PAPER_TOLERANCE.rigid]
    true = bool((np.abs(kept - truth[1:3]).max(axis=(1, 2), initial=0) < SAME_POSTURE_METRES).any())
    return _row(
        "§3.2.B, Fig. 5: the shoulders of four combinations",
        "their distance decides",
        f"{len(kept)} of {len(pairs)} have it, {'the input' if true else 'not the input'} among them",
        true and len(kept) < len(pairs),
        "frame 1 of SEQ2: roots of both quadratic equations, each pair measured, within "
        f"{100 * PAPER_TOLERANCE.rigid:g} cm",
    )


def _level_rows(work: LeeChenWork) -> Iterator[PaperRow]:
    """Ask of all settings how many nodes §4.1.B says that levels have beside others."""
    wrist, elbows, knees = JOINT["right_wrist"], JOINT["right_elbow"], JOINT["right_knee"]
    counts = work.counts["seq1"].physical[:, 0]
    part = counts[:, wrist] / np.maximum(counts[:, wrist - 1], 1)
    yield PaperRow(
        paper=PAPER_TITLE,
        place="§4.1.B(ii), SEQ1, frame 1: the right wrist",
        printed="one and a half times the nodes of the level before",
        here=f"between one and two times in {((part > 1) & (part < 2)).mean():.0%} of the settings",
        verdict="open",
        check="one of the two flexions may be an illegal extension; counts of all settings",
        why=OPEN_WALKS,
    )
    for name, joint in (("elbows", elbows), ("knees", knees)):
        same = [
            (one.motion[:, :, joint] == one.motion[:, :, joint + 1]).mean(axis=0)
            for one in work.counts.values()
        ]
        theirs = [
            "/".join("yes" if row[joint] == row[joint + 1] else "no" for row in printed.PRINTED_MOTION[each])
            for each in work.counts
        ]
        yield PaperRow(
            paper=PAPER_TITLE,
            place=f"§4.1.B: with Rule 1 the two {name} have as many nodes",
            printed=f"frames 1/3/5: {', '.join(theirs)}",
            here=", ".join("/".join(f"{share:.0%}" for share in each) for each in same) + " of the settings",
            verdict="open",
            check="SEQ1, SEQ2: Tables 3 and 4, and the counts of all settings",
            why=OPEN_WALKS,
        )


def _decision_rows(work: LeeChenWork) -> Iterator[PaperRow]:
    """Ask Rules 3 to 5, one by one, of what Rules 1 and 2 left of frame 1 at the closest setting."""
    for name, says in PRINTED_DECISIONS.items():
        recovery = recover_sequence(name, work.setting)[1]
        joints, head = recovery.frames[0].joints, recovery.fit.head[0]
        rejected = []
        for rule in (3, 4, 5):
            asked = Validator(strict=True, checks=("walking",), rules=(rule,), walkers="paper-printed")
            report = asked.check(joints, np.broadcast_to(head, (len(joints), *head.shape)), configured=False)
            rejected.append(report.verdicts.count("invalid"))
        yield PaperRow(
            paper=PAPER_TITLE,
            place=f"§4.2, {name.upper()}: what decides",
            printed=says,
            here=f"of {len(joints)} survivors Rules 3, 4 and 5 reject {', '.join(map(str, rejected))}",
            verdict="open",
            check="each rule alone, at the walker's setting that is closest to all cells",
            why=OPEN_STEPS,
        )
