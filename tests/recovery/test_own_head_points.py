"""Heads of more than six points, under names of the user's own (Lee & Chen 1985, §2.1)."""

from dataclasses import replace

import numpy as np
import pytest

import posekit
from posekit.batch import run_batch
from posekit.batch.image_rows import ImageRows, head_text
from posekit.batch.view_table import open_view_table, read_rows, write_view_table
from posekit.cameras import PinholeCamera
from posekit.cameras.head import TABLE_A2, HeadPose
from posekit.cameras.neck import place
from posekit.errors import HeadError
from posekit.formats.own import LeeChenModel, OpenCVModel, View, read_view, write_view
from posekit.recovery.fit_camera import fit_camera
from posekit.skeleton import DOFS

OWN = {
    "chin": (-0.302, 0.565, 0.0),
    "forehead": (-0.310, 0.700, 0.010),
    "left_temple": (-0.345, 0.655, -0.070),
    "right_temple": (-0.345, 0.655, 0.070),
    "back of the head": (-0.450, 0.620, 0.005),
    "crown": (-0.380, 0.740, 0.0),
    "jaw": (-0.330, 0.580, 0.050),
    "left lobe": (-0.355, 0.580, -0.080),
}


K = np.array([[1000.0, 0, 500], [0, 1000, 500], [0, 0, 1]])


@pytest.fixture(scope="module")
def walk() -> View:
    return posekit.builtin_view("seq1")


def in_camera(view: View) -> np.ndarray:
    """Place the own points (8, 3) where the walker's head is, which faces the camera."""
    turned = np.array([[0, 0, -1], [0, -1, 0], [-1, 0, 0]])
    placed: np.ndarray = (np.array(list(OWN.values())) - TABLE_A2.points[0]) @ turned.T + view.truth[0, 0]
    return placed


def pose_of(view: View) -> HeadPose:
    pose = fit_camera(view, posekit.load_figure()).pose
    assert pose is not None
    return pose


def with_own(view: View, *, only: bool = False, f: float = 0.05) -> View:
    """Add points of its own to the head of SEQ1, where the true head is; with `only`, the neck alone stays besides."""
    cam = in_camera(view)
    seen = f * cam[:, :2] / cam[:, 2:]
    heads = {"neck": TABLE_A2.points[0]} if only else dict(zip(TABLE_A2.names, TABLE_A2.points, strict=True))
    return replace(
        view,
        head_points=heads | {name: np.array(at) for name, at in OWN.items()},
        head_image=view.head_image * (np.nan if only else 1.0),
        own_head_image=np.repeat(seen[None], len(view), axis=0),
    )


@pytest.mark.parametrize("only", [False, True])
def test_a_head_of_own_points_gives_the_certified_postures_of_the_usual_six(walk, only, tmp_path):
    write_view(tmp_path / "view.json", with_own(walk, only=only))
    view = read_view(tmp_path / "view.json")
    assert view.own_head_names == tuple(OWN)
    own, usual = posekit.recover(view), posekit.recover(walk)
    for mine, theirs in zip(own.frames, usual.frames, strict=True):
        np.testing.assert_allclose(mine.joints, theirs.joints, atol=1e-6)
    np.testing.assert_allclose(pose_of(view).f, 0.05, rtol=1e-6)


def test_more_points_tell_a_noisy_camera_better(walk, rng):
    """What the paper recommends them for."""
    full = with_own(walk).take([0] * 100)
    noisy = replace(
        full,
        head_image=full.head_image + 2e-6 * rng.standard_normal(full.head_image.shape),
        own_head_image=full.own_head_image + 2e-6 * rng.standard_normal(full.own_head_image.shape),
    )
    fewer = replace(noisy, own_head_image=np.nan * noisy.own_head_image)
    off = []
    for view in (fewer, noisy):
        pose = pose_of(view)
        off.append(np.median(np.abs(pose.f[pose.found] / 0.05 - 1)))
    assert off[1] < 0.8 * off[0]


def test_points_that_are_hidden_in_a_frame_are_left_out_of_it(walk):
    view = with_own(walk)
    head, own = view.head_image.copy(), view.own_head_image.copy()
    head[0] = np.nan
    own[1, :3] = np.nan
    own[2] = np.nan
    head[2, 1:] = np.nan
    recovery = posekit.recover(
        replace(view, head_image=head, own_head_image=own, camera=LeeChenModel(f=None))
    )
    assert [len(frame) > 0 for frame in recovery.frames] == [True, True, False, True, True]
    assert "2 of 14 head points are known, at least 6 are needed" in recovery.frames[2].reason


@pytest.mark.parametrize(
    ("move", "text"),
    [
        ({"crown": OWN["chin"]}, "chin and crown coincide"),
        ({name: (-0.34, y, z) for name, (_, y, z) in OWN.items()}, "lie in one plane"),
    ],
)
def test_points_that_tell_no_camera_are_refused(walk, move, text):
    view = with_own(walk, only=True)
    points = dict(view.head_points or {}) | {name: np.array(at) for name, at in move.items()}
    if len(move) > 1:
        points["neck"] = np.array([-0.34, *points["neck"][1:]])
    with pytest.raises(HeadError, match=text):
        posekit.recover(replace(view, head_points=points))


def before_a_known_camera(walk: View, turn: float = 0.0) -> View:
    """See the walker's first frame and its own head points alone, the head turned by some degrees."""
    angle, neck = np.radians(turn), walk.truth[0, 0]
    about = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    cam = (in_camera(walk) - neck) @ about.T + neck
    image = PinholeCamera(K=K).project(np.concatenate([walk.truth[0], cam]))
    return View(
        camera=OpenCVModel(K=K),
        time=np.zeros(1),
        image=image[None, :14],
        own_head_image=image[None, 14:],
        head_points={"neck": TABLE_A2.points[0]} | OWN,
        lengths=walk.lengths,
        shoulders=walk.shoulders,
    )


def test_own_points_alone_place_the_neck_before_a_known_camera(walk):
    view = before_a_known_camera(walk)
    head = np.concatenate([view.head_image, view.own_head_image], axis=1)
    [placed] = place(
        PinholeCamera(K=K),
        posekit.load_figure(),
        view.image,
        head,
        method="head",
        own_head=view.own_head(),
        deviation=0.1,
    )
    assert placed.method == "head"
    assert abs(placed.estimate - walk.truth[0, 0, 2]) < 0.01
    [frame] = posekit.recover(view).frames
    assert np.abs(frame.joints - walk.truth[0]).max(axis=(1, 2)).min() < 1e-4


def test_tables_of_views_keep_own_points(walk, tmp_path):
    view = with_own(walk)
    write_view_table(tmp_path / "walk.parquet", view)
    assert {"chin_u", "back of the head_v"} <= set(open_view_table(tmp_path / "walk.parquet").names)
    [rows] = read_rows(tmp_path / "walk.parquet", 0, len(view))
    np.testing.assert_array_equal(rows.view(view).own_head_image, view.own_head_image)
    laid = ImageRows.of_view(view).laid_out(np.arange(7), np.arange(7.0))
    np.testing.assert_array_equal(laid.points[:5, 19:], view.own_head_image)
    assert np.isnan(laid.points[5:]).all()


def test_batches_recover_views_tables_and_arrays_alike(walk, tmp_path):
    view = with_own(walk, only=True)
    write_view(tmp_path / "a.json", view)
    write_view_table(tmp_path / "b.parquet", view)
    np.savez(tmp_path / "c.npz", image=view.image, own_head_image=view.own_head_image, view=head_text(view))
    wanted = sum(len(frame.joints) for frame in posekit.recover(view).frames)
    for name in ("a.json", "b.parquet", "c.npz"):
        assert run_batch([tmp_path / name], tmp_path / f"{name}.out").survivors == wanted


def test_own_points_alone_turn_the_head_of_noisy_views(walk, rng):
    """What is refined under noise has the turn of the head that the points of its own show."""
    at = posekit.load_figure().angle_index[DOFS.index("neck.rotation")]
    turned = []
    for degrees in (0.0, 30.0):
        exact = before_a_known_camera(walk, degrees)
        noisy = replace(
            exact,
            image=exact.image + 0.5 * rng.standard_normal(exact.image.shape),
            own_head_image=exact.own_head_image + 0.5 * rng.standard_normal(exact.own_head_image.shape),
            deviation=0.5,
            length_deviation=0.0,
        )
        [frame] = posekit.recover(noisy).frames
        off = np.linalg.norm(frame.joints - walk.truth[0], axis=-1).max(axis=1)
        turned.append(np.degrees(frame.q[off.argmin(), at]))
    assert abs(abs(turned[1] - turned[0]) - 30) < 8
