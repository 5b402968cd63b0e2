"""Head points: names and places that agree, enough of them, not in one plane."""

import numpy as np
import pytest

from posekit.cameras import PinholeCamera
from posekit.cameras.head import (
    TABLE_A2,
    HeadPoints,
    HeadWarning,
    solve_pose,
)
from posekit.errors import HeadError


def changed(**points):
    return dict(zip(TABLE_A2.names, TABLE_A2.points, strict=True)) | points


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (dict(list(changed().items())[:5]), r"^5 of 5 head points are known, at least 6 are needed$"),
        ({}, r"^0 of 0 head points are known"),
        (
            changed(nose=[0.0, np.nan, 0.0]),
            r"^head point nose is at \[0.0, nan, 0.0\]; expected three finite",
        ),
        (changed(nose=[np.inf, 0.0, 0.0]), r"^head point nose is at"),
        (changed(nose=[0.0, 0.0]), r"^head point nose has shape \(2,\); expected three numbers"),
        (changed(nose="here"), r"^head point nose is 'here'; expected three numbers"),
        (changed(nose=TABLE_A2.points[2] + 1e-6), r"^head points nose and right_eye coincide \(.* m apart\)"),
        (changed(neck=[-0.34, 0.6, 0.0], nose=[-0.34, 0.65, 0]), None),
    ],
)
def test_head_points_that_cannot_determine_a_camera(points, message):
    if message is None:
        assert HeadPoints.from_mapping(points).names == TABLE_A2.names
        return
    with pytest.raises(HeadError, match=message):
        HeadPoints.from_mapping(points)


def test_coplanar_head():
    flat = {name: point * [0, 1, 1] for name, point in changed().items()}
    with pytest.raises(HeadError, match=r"^the 6 head points lie in one plane .*; add a point off it"):
        HeadPoints.from_mapping(flat)


def test_names_and_points_must_agree():
    with pytest.raises(HeadError, match=r"6 names and points of shape \(5, 3\)"):
        HeadPoints(names=TABLE_A2.names, points=TABLE_A2.points[:5])
    with pytest.raises(HeadError, match="named twice: nose"):
        HeadPoints(
            names=("neck", "nose", "nose", "left_eye", "right_ear", "left_ear"), points=TABLE_A2.points
        )


def test_unknown_point_names_the_nearest():
    with pytest.raises(HeadError, match=r"no point 'right_eyes', only neck.*; did you mean right_eye\?"):
        TABLE_A2.index("right_eyes")


def test_the_misfit_is_left_out_as_if_it_were_not_seen(rng):
    head = TABLE_A2.with_points({"chin": [-0.302, 0.565, 0.0], "crown": [-0.33, 0.75, 0.02]})
    camera = PinholeCamera(K=np.array([[1000.0, 0.0, 320.0], [0.0, 1000.0, 240.0], [0.0, 0.0, 1.0]]))
    turn = np.array([[0.0, 0, -1], [0, -1, 0], [-1, 0, 0]])
    image = camera.project(head.points @ turn.T + [0.0, 0.5, 3.0]) + rng.normal(0, 0.2, (8, 2))
    image[2] += 30.0
    with pytest.warns(HeadWarning):
        pose = solve_pose(head, image, camera)
    image[2] = np.nan
    left = solve_pose(head, image, camera)
    assert pose.misfit == (head.names[2],)
    assert pose.rms == pytest.approx(np.sqrt((pose.residuals**2).mean()))
    assert pose.rms_without == pytest.approx(left.rms, rel=1e-4)
    assert left.rms == pytest.approx(np.sqrt(np.nanmean(left.residuals**2)))


@pytest.mark.parametrize(("share", "refused"), [(0.99, True), (1.01, False)])
@pytest.mark.parametrize("count", [6, 12])
def test_points_are_one_nearer_than_a_thousandth_of_the_heads_size(rng, share, refused, count):
    """Its size is the standard deviation along its longest axis."""
    points = rng.normal(0.0, 0.1, (count, 3))
    for _ in range(20):
        size = np.sqrt(np.linalg.eigvalsh(np.cov(points.T, bias=True)).max())
        points[1] = points[0] + share * 1e-3 * size * np.array([0.6, 0.0, 0.8])
    names = tuple(f"p{k}" for k in range(count))
    if not refused:
        assert HeadPoints(names=names, points=points).names == names
        return
    with pytest.raises(HeadError, match="head points p0 and p1 coincide"):
        HeadPoints(names=names, points=points)
