"""Comparison with Lee & Chen 1985: stick figure, camera from head points (§2.1, Table 2), lengths (Table A.1)."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from functools import cache
from typing import Final

import numpy as np

from posekit.body import load_figure
from posekit.cameras import LeeChenCamera
from posekit.cameras.head import TABLE_A2, HeadPoints, solve_pose
from posekit.cameras.lee_chen import (
    camera_position,
    image_from_paper,
    points_to_paper,
    rotation_to_paper,
    transformation_matrix,
)
from posekit.geometry import Array, best_rotation
from posekit.papers.rows import Row, printed, row
from posekit.skeleton import JOINT, JOINTS, PARENTS
from posekit.synthesis import random_postures

#: Distance of the paper's image plane, metres (Table 2).
F: Final = 0.05

#: Camera position of SEQ1 in the head-centred frame, metres.
CAMERA: Final = np.array([4.0, 0.0, 0.0])

#: Rotation from the head-centred frame to the camera of SEQ1 in OpenCV's axes.
R_CAM_HEAD: Final = np.array([[0.0, 0.0, -1.0], [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0]])

#: Two additional head points, head-centred frame, metres.
CHIN_AND_CROWN: Final = {"chin": (-0.292, 0.55, 0.0), "crown": (-0.34, 0.74, 0.0)}

N_PICTURES: Final = 200
#: Standard deviation on the image plane, metres: a tenth of a unit of the fourth digit in Table A.2(b).
IMAGE_NOISE: Final = 1e-6

#: Parts of Table 2, and the largest difference (cm) that counts as agreement, because printed values are computed from
#: rounded data.
TABLE_2_PARTS: Final = (
    ("(a), transformation matrix", "T", 0.03),
    ("(b), rotation matrix", "R", 1e-4),
    ("(c), camera position, cm", "position", 0.03),
    ("(d), head in the camera frame, cm", "head", 0.03),
)

N_BODIES: Final = 20


def camera_rows() -> Iterator[Row]:
    """Yield a `Row` for each comparison: stick figure, camera, and lengths of Table A.1."""
    yield from _figure_rows()
    yield from _null_space_rows()
    six, eight = (_noisy_error(head) for head in (TABLE_A2, TABLE_A2.with_points(CHIN_AND_CROWN)))
    here = f"median error {eight:.1f} cm with eight points, {six:.1f} cm with six"
    yield row("more-points", here, eight < six, n=N_PICTURES)
    yield from _table_2_rows()
    yield from _body_rows()


def exact_image(head: HeadPoints = TABLE_A2) -> Array:
    """Return exact projections (H, 2) of head points by the camera of sequence SEQ1: metres, y down."""
    points = head.points @ R_CAM_HEAD.T + [0.0, 0.0, CAMERA[0] + F]
    return np.asarray(LeeChenCamera(f=F).project(points[None])[0])


@cache
def table_2() -> dict[str, Array]:
    """Compute the four parts of Table 2 from exact projections, in Lee & Chen's coordinate frames, centimetres."""
    pose = solve_pose(TABLE_A2, exact_image(), LeeChenCamera(f=None))
    R, t, f = pose.R_cam_head[0], pose.t_cam_head[0], float(pose.f[0])
    return {
        "T": transformation_matrix(R, 100 * t, 100 * f),
        "R": rotation_to_paper(R),
        "position": 100 * camera_position(R, t, f),
        "head": 100 * points_to_paper(pose.points_cam[0], f),
    }


def _figure_rows() -> Iterator[Row]:
    joints, segments = len(JOINTS), len(load_figure().lengths)
    yield row("stick-figure", f"{joints} joints and {segments} segments", (joints, segments) == (14, 17))
    depth = [0] * joints
    for joint in range(1, joints):
        depth[joint] = depth[PARENTS[joint]] + 1
    sizes = [depth.count(k) for k in range(1, max(depth) + 1)]
    ordered = depth == sorted(depth)
    here = f"{', '.join(map(str, sizes))} joints, {'in' if ordered else 'out of'} order"
    yield row("classes", here, sizes == [3, 4, 4, 2] and ordered)
    # Both frames follow from the printed digits: Table A.2(a), with the corrected eye, is mapped to Table 2(d).
    affine = np.linalg.lstsq(np.column_stack([100 * TABLE_A2.points, np.ones(6)]), _tables()["head"])[0]
    determinant = float(np.linalg.det(affine[:3]))
    yield row("frames", f"determinant {determinant:.2f} from one to the other", abs(determinant + 1) < 0.01)


def _null_space_rows() -> Iterator[Row]:
    singular, S = _null_space(100 * TABLE_A2.points, exact_image() * [100.0, -100.0])
    S *= np.sign(S[3, 2]) / np.linalg.norm(S[:3, 0])  # the sign of a camera that has the head in front of it
    f = 1 / float(np.linalg.norm(S[:3, 2]))
    R = np.stack([S[:3, 0], S[:3, 1], -f * S[:3, 2]], axis=1)
    x, y, z = R @ [-S[3, 0], -S[3, 1], (S[3, 2] - 1) * f]
    rank = int((singular > 1e-9 * singular[0]).sum())
    yield row("rank", f"rank {rank} of 12 unknowns", rank == 11)
    here = f"{f:.6f} and ({x:.6f}, {abs(y):.6f}, {abs(z):.6f}) cm"
    yield row("null-space", here, bool(np.abs([f - 5, x - 400, y, z]).max() < 1e-6))
    off = float(np.abs(R.T @ R - np.eye(3)).max())
    yield row("rotation", f"{off:.0e} off", off < 1e-6)


def _null_space(points: Array, image: Array) -> tuple[Array, Array]:
    """Solve Lee & Chen's eqs. (2)-(5) by SVD; return all singular values, and the null vector as a matrix (4, 3)."""
    rows = []
    for (x, y, z), (u, v) in zip(points, image, strict=True):
        rows.append([x, 0, -u * x, y, 0, -u * y, z, 0, -u * z, 1, 0, -u])
        rows.append([0, x, -v * x, 0, y, -v * y, 0, z, -v * z, 0, 1, -v])
    _, singular, axes = np.linalg.svd(np.array(rows))
    return singular, axes[-1].reshape(4, 3)


def _noisy_error(head: HeadPoints) -> float:
    """Return the median error, centimetres, of camera positions computed from noisy image points of the head."""
    noise = IMAGE_NOISE * np.random.default_rng(0).normal(size=(N_PICTURES, 8, 2))[:, : len(head.points)]
    pose = solve_pose(head, exact_image(head) + noise, LeeChenCamera(f=None))
    position = camera_position(pose.R_cam_head, pose.t_cam_head, pose.f)
    return float(100 * np.median(np.linalg.norm(position - CAMERA, axis=1)))


def _table_2_rows() -> Iterator[Row]:
    tables, image = _tables(), exact_image()
    gap = float(np.abs(image * [100, -100] - tables["image"]).max())
    yield row("image", f"{gap:.0e} cm off at most", gap < 1e-3)
    rounded = image_from_paper(tables["image"] / 100)
    eye = [tables["misprinted_eye_x"] / 100, *TABLE_A2.points[TABLE_A2.names.index("right_eye"), 1:]]
    misprinted = TABLE_A2.with_points({"right_eye": eye})
    _, misfit = _refined(misprinted, rounded)
    yield row("eye", "-31.168 cm", False, off=_linear(misprinted, rounded), misfit=misfit.replace("_", " "))
    for part, key, within in TABLE_2_PARTS:
        off = float(np.abs(table_2()[key] - tables[key]).max())
        yield row("table2", f"{off:.5f} off at most", off < within, part=part)
    refined, _ = _refined(TABLE_A2, rounded)
    here = f"{_linear(TABLE_A2, rounded):.1f} cm off; with the reprojection error minimised {refined:.1f} cm"
    yield row("linear", here, False)


def _refined(head: HeadPoints, image: Array) -> tuple[float, str]:
    """Return the camera position's error (cm) after least squares, and the head point that is an outlier."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the misfit is returned
        pose = solve_pose(head, image, LeeChenCamera(f=None))
    position = camera_position(pose.R_cam_head[0], pose.t_cam_head[0], float(pose.f[0]))
    return 100 * float(np.linalg.norm(position - CAMERA)), pose.misfit[0] or "no point"


def _linear(head: HeadPoints, image: Array) -> float:
    """Return the error (cm) of the camera position by the linear solution, with normalised data (Hartley 1997)."""
    centre, middle = head.points.mean(axis=0), image.mean(axis=0)
    sizes = [np.sqrt(((at - at.mean(axis=0)) ** 2).sum(axis=1).mean()) for at in (head.points, image)]
    P = _null_space((head.points - centre) / sizes[0], (image - middle) / sizes[1])[1].T
    P[:2] = sizes[1] * P[:2] + middle[:, None] * P[2]
    P *= np.sign(np.linalg.det(P[:, :3])) / np.linalg.norm(P[2, :3])
    f = float(np.sqrt((P[:2, :3] ** 2).sum() / 2))
    P[:2] /= f
    R = best_rotation(P[:, :3])[0]
    return 100 * float(np.linalg.norm(camera_position(R, sizes[0] * P[:, 3] - R @ centre, f) - CAMERA))


def _body_rows() -> Iterator[Row]:
    lengths = printed()["lee_chen"]["lengths"]
    figure = load_figure()
    points = figure.forward_kinematics(random_postures(figure, N_BODIES, np.random.default_rng(0), "urdf"))
    worst = 0.0
    for name, length in lengths.items():
        a, b = (JOINT[joint] for joint in name.split("-"))
        apart = 100 * np.linalg.norm(points[:, a] - points[:, b], axis=-1)
        worst = max(worst, float(np.abs(apart - length).max()))
    yield row("tableA1", f"{worst:.0e} cm off at most", worst < 1e-6, n=len(lengths), postures=N_BODIES)
    neck, spine = lengths["neck-right_shoulder"], lengths["neck-pelvis"]
    half = lengths["right_shoulder-left_shoulder"] / 2
    below = (neck**2 - lengths["right_shoulder-pelvis"] ** 2 + spine**2) / (2 * spine)
    ahead = float(np.sqrt(neck**2 - half**2 - below**2))
    here = f"not flat: the middle of the shoulders is {ahead:.3f} cm in front of the line from neck to pelvis"
    yield row("torso", here, None)


@cache
def _tables() -> dict[str, Array]:
    """Return the arrays that Lee & Chen print in Tables 2 and A.2, centimetres."""
    given = printed()["lee_chen"]
    names = ("image", "T", "R", "position", "head", "misprinted_eye_x")
    return {name: np.array(given[name]) for name in names}
