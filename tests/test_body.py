"""The figure: kinematics against Pinocchio, closed forms there and back, lengths that close, and refusals."""

import pickle
import re

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import minimize

from posekit.body import (
    MEASURED_LENGTHS,
    UNKNOWN_ADULT,
    Figure,
    LengthUncertainty,
    load_figure,
    segment_lengths,
    shoulders_are_behind,
    stature_from_lengths,
    with_head,
)
from posekit.body.frames import hips_frame, torso_frame
from posekit.body.lengths import HIPS_LENGTHS, TORSO_LENGTHS, torso_points
from posekit.errors import InputError
from posekit.robots import Robot, load_robot
from posekit.skeleton import DOFS, JOINT, POINTS, SEGMENT_NAMES, SEGMENTS

FIGURE = load_figure()
MIDDLE = FIGURE.scaled({"right_hip-left_hip": 0.24, "pelvis-right_hip": 0.12, "pelvis-left_hip": 0.12})
FIGURES = {
    "built-in": FIGURE,
    "tall": FIGURE.scaled(stature=1.9),
    "uneven": FIGURE.scaled(
        {name: length * (1 + 0.03 * np.sin(k)) for k, (name, length) in enumerate(FIGURE.lengths.items())}
    ),
    "shoulders behind": FIGURE.scaled(behind=True),
    "pelvis between hips": MIDDLE,
}
any_figure = pytest.mark.parametrize("figure", FIGURES.values(), ids=FIGURES)


def configurations(figure, count=200, seed=0, *, outside=0.0):
    """Draw configurations; `outside` widens the limits, radians."""
    rng = np.random.default_rng(seed)
    q = np.tile(figure.neutral, (count, 1))
    q[:, :3] = rng.normal(size=(count, 3))
    turn = rng.normal(size=(count, 4))
    q[:, 3:7] = turn / np.linalg.norm(turn, axis=1, keepdims=True)
    q[:, figure.angle_index] = rng.uniform(
        figure.limits.lower - outside, figure.limits.upper + outside, (count, len(DOFS))
    )
    return q


@any_figure
def test_forward_kinematics_is_pinocchios(figure):
    q = configurations(figure, 20)
    data = figure.model.createData()
    links = {
        "neck": "torso",
        "pelvis": "hips",
        "shoulder": "upper_arm",
        "elbow": "forearm",
        "hip": "thigh",
        "knee": "shank",
    }
    points = figure.forward_kinematics(q)
    for row, one in zip(points, q, strict=True):
        pin.framesForwardKinematics(figure.model, data, one)
        for name, place in zip(POINTS, row, strict=True):
            side, _, part = name.rpartition("_")
            link = f"{side}_{links.get(part, part)}".lstrip("_") if side else links.get(name, name)
            np.testing.assert_allclose(data.oMf[figure.model.getFrameId(link)].translation, place, atol=1e-12)
    ends = np.array(SEGMENTS)
    lengths = np.linalg.norm(points[:, ends[:, 0]] - points[:, ends[:, 1]], axis=-1)
    rigid = [k for k, name in enumerate(SEGMENT_NAMES) if figure.lengths[name]]
    np.testing.assert_allclose(lengths[:, rigid], np.tile(list(figure.lengths.values()), (20, 1)), atol=1e-12)


@any_figure
@pytest.mark.parametrize("outside", [0.0, 0.5])
def test_positions_go_to_q_and_back(figure, outside):
    points = figure.forward_kinematics(configurations(figure, outside=outside))
    q, distance = figure.configurations(points)
    assert np.isfinite(q).all()
    assert (distance < 1e-9).all()
    np.testing.assert_allclose(figure.forward_kinematics(q), points, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(q[:, 3:7], axis=1), 1.0)


@any_figure
@pytest.mark.parametrize("abducted", [False, True])
def test_legal_postures_have_legal_configurations(figure, abducted):
    """Arms that are abducted by 90 degrees can be turned about their own axis by flexion and by rotation."""
    drawn = configurations(figure, 4000 if abducted else 200)
    if abducted:
        arms = [k for k, dof in enumerate(DOFS) if dof.endswith("shoulder.abduction")]
        drawn[:, figure.angle_index[arms]] = np.pi / 2
    if figure.pelvis_between_hips:
        drawn[:, figure.angle_index[3:6]] = 0.0  # the joints do not determine the flexion of this pelvis
    angles = figure.configurations(figure.forward_kinematics(drawn)).q[:, figure.angle_index]
    assert (np.maximum(figure.limits.lower - angles, angles - figure.limits.upper) < 1e-9).all()
    hinges = [k for k, dof in enumerate(DOFS) if dof.endswith(("elbow.flexion", "knee.flexion"))]
    np.testing.assert_allclose(angles[:, hinges], drawn[:, figure.angle_index[hinges]], atol=1e-7)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_an_abducted_arm_is_legal_whatever_its_limits_are(sign):
    """At an abduction of 90 degrees flexion and rotation turn the arm about one axis: their sum alone is seen."""
    rng = np.random.default_rng(0)
    arms = np.array([DOFS.index(f"{side}_shoulder.abduction") for side in ("right", "left")])
    for _ in range(150):
        lower, upper = FIGURE.limits.lower.copy(), FIGURE.limits.upper.copy()
        for k in arms:
            ends = np.sort(rng.uniform(-2.5, 2.5, (2, 2)), axis=0)
            lower[k - 1 : k + 2 : 2], upper[k - 1 : k + 2 : 2] = ends
        lower[arms], upper[arms] = sign * np.pi / 2 - 0.3, sign * np.pi / 2 + 0.3
        q = configurations(FIGURE, 10, seed=int(rng.integers(1000)))
        q[:, FIGURE.angle_index] = rng.uniform(lower, upper, (10, len(DOFS)))
        q[:, FIGURE.angle_index[arms]] = sign * np.pi / 2
        found = FIGURE.ik.with_limits(lower, upper).angles(FIGURE.forward_kinematics(q))
        assert (np.maximum(lower - found, found - upper)[:, 6:] < 1e-6).all()


def test_no_branch_violates_the_limits_less():
    """Try all Euler branches, hinge signs and full turns of every limb against the returned one."""
    angles = FIGURE.ik.angles(FIGURE.forward_kinematics(configurations(FIGURE, 500, outside=1.0)))
    lower, upper = FIGURE.limits.lower, FIGURE.limits.upper
    for first in (6, 10, 14, 18):
        a = angles[:, first : first + 4]
        branches = []
        for flip in (a, np.stack([a[:, 0] + np.pi, np.pi - a[:, 1], a[:, 2] + np.pi, a[:, 3]], axis=1)):
            branches += [flip, np.stack([flip[:, 0], flip[:, 1], flip[:, 2] + np.pi, -flip[:, 3]], axis=1)]
        low, high = lower[first : first + 4], upper[first : first + 4]
        costs = []
        for branch in branches:
            turned = branch - 2 * np.pi * np.round((branch - (low + high) / 2) / (2 * np.pi))
            outside = np.maximum(np.maximum(low - turned, turned - high), 0)
            outside[:, 2] *= abs(np.sin(turned[:, 3]))
            costs.append(outside.max(axis=1))
        assert (costs[0] <= np.min(costs, axis=0) + 1e-7).all()


def bent(figure, degrees):
    q = configurations(figure)
    hinges = [
        k
        for k, name in enumerate(figure.configuration_names)
        if name.endswith(("elbow_flexion", "knee_flexion"))
    ]
    q[:, hinges] = np.radians(degrees)
    return figure.forward_kinematics(q)


@any_figure
@pytest.mark.parametrize(
    "make",
    [lambda f: bent(f, 0.0), lambda f: bent(f, 1e-6), lambda f: bent(f, 0.01)],
    ids=["straight", "1e-6 deg", "0.01 deg"],
)
def test_nearly_straight_limbs_have_configurations(figure, make):
    points = make(figure)
    q, distance = figure.configurations(points[:, :14])
    assert np.isfinite(q).all()
    assert (distance < 1e-6).all()


def test_every_whole_posture_has_a_finite_configuration():
    rng = np.random.default_rng(0)
    noisy = FIGURE.points(configurations(FIGURE)) + rng.normal(0, 0.03, (200, 14, 3))
    line = np.zeros((1, 14, 3))
    line[0, :, 2] = -np.arange(14) / 14  # neither shoulders nor hips span a plane with the spine
    for joints in (noisy, line, np.zeros((1, 14, 3)), rng.normal(size=(100, 14, 3))):
        q, distance = FIGURE.configurations(joints)
        assert np.isfinite(q).all()
        assert np.isfinite(distance).all()
        pin.normalize(FIGURE.model, q[0])
    assert np.median(FIGURE.configurations(noisy).distance) < 0.12
    directions = [
        points[:, JOINT["right_knee"]] - points[:, JOINT["right_hip"]]
        for points in (noisy, FIGURE.points(FIGURE.configurations(noisy).q))
    ]
    a, b = (each / np.linalg.norm(each, axis=1, keepdims=True) for each in directions)
    np.testing.assert_allclose(a, b, atol=1e-9)  # segments keep their direction


def test_unknown_joints_leave_only_their_angles_unknown():
    points = FIGURE.forward_kinematics(configurations(FIGURE, 1))
    holes = points.copy()
    holes[0, [JOINT["left_wrist"], *range(14, 19)]] = np.nan
    q, distance = FIGURE.configurations(holes)
    unknown = {FIGURE.configuration_names[k] for k in np.flatnonzero(np.isnan(q[0]))}
    assert unknown == {"left_shoulder_rotation", "left_elbow_flexion"}
    assert q[0, list(FIGURE.configuration_names).index("neck_flexion")] == 0  # an unseen head is at neutral
    assert distance[0] < 1e-9
    holes[0, JOINT["pelvis"]] = np.nan
    assert np.isnan(FIGURE.configurations(holes).distance).all()


def test_angles_are_those_of_the_configuration_and_the_limits_choose():
    points = FIGURE.forward_kinematics(configurations(FIGURE))
    np.testing.assert_array_equal(
        FIGURE.ik.angles(with_head(points)), FIGURE.configurations(points).q[:, FIGURE.angle_index]
    )
    # Limits on the other side of a quarter turn give the other Euler branch.
    lower, upper = FIGURE.limits.lower.copy(), FIGURE.limits.upper.copy()
    k = DOFS.index("left_hip.abduction")
    lower[k], upper[k] = np.pi / 2, 3 * np.pi / 2
    lower[k - 1], upper[k - 1] = lower[k - 1] + np.pi, upper[k - 1] + np.pi
    lower[k + 1], upper[k + 1] = lower[k + 1] + np.pi, upper[k + 1] + np.pi
    other = FIGURE.ik.with_limits(lower, upper).angles(with_head(points))
    np.testing.assert_allclose(other[:, k], np.pi - FIGURE.ik.angles(with_head(points))[:, k], atol=1e-9)


def test_frames_are_the_papers():
    p = FIGURE.neutral_points
    R = torso_frame(p[0], p[1], p[2], p[3])
    np.testing.assert_allclose(R, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(hips_frame(p[3], p[4], p[5]), np.eye(3), atol=1e-12)
    assert np.isnan(torso_frame(p[0], p[0], p[0], p[3])).any()


def test_the_pelvis_between_hips_is_flexed_no_more_than_the_thighs_need():
    q = np.tile(MIDDLE.neutral, (3, 1))
    hips = [k for k, name in enumerate(MIDDLE.configuration_names) if name.endswith("hip_flexion")]
    limit = MIDDLE.upper[hips[0]]
    for row, flexion in enumerate((0.5, limit, limit + 0.3)):
        q[row, hips] = flexion
    found = MIDDLE.configurations(MIDDLE.points(q)).q
    pelvis = abs(found[:, list(MIDDLE.configuration_names).index("pelvis_flexion")])
    np.testing.assert_allclose(pelvis, [0, 0, 0.3], atol=1e-9)


@pytest.mark.parametrize("stature", [1.5, 1.75, 1.95])
def test_stature_gives_lengths_that_give_the_stature(stature):
    figure = FIGURE.scaled(stature=stature)
    assert stature_from_lengths(figure.lengths) == pytest.approx(stature)
    assert figure.lengths["right_hip-left_hip"] == pytest.approx(0.191 * stature)
    assert not figure.moved_lengths
    longer = FIGURE.scaled({"right_hip-right_knee": 0.5}, stature=stature)
    assert longer.lengths == pytest.approx({**figure.lengths, "right_hip-right_knee": 0.5})


def test_scaled_lengths_are_met_and_measured_again():
    figure = FIGURES["uneven"]
    measured = segment_lengths(figure.forward_kinematics(configurations(figure)))
    for name, length in figure.lengths.items():
        assert measured[name] == pytest.approx(length, abs=1e-12)
    assert not figure.moved_lengths
    assert FIGURE.scaled({"right_hip-right_knee": 0.4}).side_known
    assert not figure.side_known


def test_shoulders_are_on_the_given_side():
    behind = FIGURES["shoulders behind"]
    assert (FIGURE.shoulder_side, behind.shoulder_side) == ("front", "behind")
    assert shoulders_are_behind(behind.points(configurations(behind)))
    assert shoulders_are_behind(FIGURE.points(configurations(FIGURE))) is False
    assert FIGURES["uneven"].shoulder_side == "undecided"
    assert FIGURE.with_side_within(LengthUncertainty.uniform(1e-4)).side_known
    assert not FIGURE.with_side_within(UNKNOWN_ADULT).side_known


@pytest.mark.parametrize(
    ("changed", "part"),
    [
        ({"right_shoulder-left_shoulder": 0.43}, TORSO_LENGTHS),
        ({"neck-pelvis": 0.72}, TORSO_LENGTHS),
        ({"right_hip-left_hip": 0.4}, HIPS_LENGTHS),
    ],
)
def test_lengths_that_do_not_close_become_the_nearest_that_do(changed, part):
    wanted = {**FIGURE.lengths, **changed}
    figure = FIGURE.scaled(changed)
    assert set(figure.moved_lengths) == set(part)
    weight = np.array([1 / MEASURED_LENGTHS.own[name] for name in part])

    def cost(lengths):
        return np.sum((weight * np.log(np.array(lengths) / [wanted[name] for name in part])) ** 2)

    def distances(x):
        points = x.reshape(-1, 3)
        index = {
            name: k
            for k, name in enumerate(dict.fromkeys(joint for name in part for joint in name.split("-")))
        }
        return [
            np.linalg.norm(points[index[a]] - points[index[b]]) for a, b in (name.split("-") for name in part)
        ]

    # Brute force: any places in space make lengths that close.
    rng = np.random.default_rng(0)
    count = 4 if part == TORSO_LENGTHS else 3
    found = [minimize(lambda x: cost(distances(x)), rng.normal(0, 0.3, 3 * count)).fun for _ in range(8)]
    assert cost([figure.lengths[name] for name in part]) <= min(found) * (1 + 1e-4) + 1e-9


@pytest.mark.parametrize(("share", "possible"), [(0.999, True), (1.001, False)])
def test_the_width_that_a_torso_can_have_is_said(share, possible):
    lengths = dict(FIGURES["uneven"].lengths)
    with pytest.raises(InputError) as error:
        torso_points({**lengths, "right_shoulder-left_shoulder": 0.6})
    low, high = (float(one) for one in re.findall(r"expected ([\d.]+) to ([\d.]+) m", str(error.value))[0])
    assert low < lengths["right_shoulder-left_shoulder"] < high
    lengths["right_shoulder-left_shoulder"] = share * high
    if not possible:
        with pytest.raises(InputError, match="right_shoulder-left_shoulder"):
            torso_points(lengths)
        return
    ends = dict(
        zip(("neck", "right_shoulder", "left_shoulder", "pelvis"), torso_points(lengths), strict=True)
    )
    for name in TORSO_LENGTHS:
        a, b = name.split("-")
        assert np.linalg.norm(ends[a] - ends[b]) == pytest.approx(lengths[name])


#: de Leva 1996, table 4, women and men: mass and centre (%), radii of gyration (%): sagittal, transverse, longitudinal.
DE_LEVA = {
    "upper_arm": ("shoulder-left_elbow", (2.55, 57.54, 27.8, 26.0, 14.8), (2.71, 57.72, 28.5, 26.9, 15.8)),
    "thigh": ("hip-left_knee", (14.78, 36.12, 36.9, 36.4, 16.2), (14.16, 40.95, 32.9, 32.9, 14.9)),
}


@pytest.mark.parametrize("link", DE_LEVA)
def test_limbs_have_the_inertia_of_the_literature(link):
    segment, *tables = DE_LEVA[link]
    length = FIGURE.lengths[f"left_{segment}"]
    mass, centre, *radii = np.mean(tables, axis=0) / 100
    model = FIGURE.model
    inertia = model.inertias[model.frames[model.getFrameId(f"left_{link}")].parentJoint]
    body = 22.33 * stature_from_lengths(FIGURE.lengths) ** 2
    assert inertia.mass == pytest.approx(mass * body, rel=2e-3)
    assert np.linalg.norm(inertia.lever) == pytest.approx(centre * length, rel=1e-3)
    moments = inertia.mass * (np.array(radii) * length) ** 2
    np.testing.assert_allclose(np.diag(inertia.inertia), moments, rtol=5e-3)


@any_figure
def test_a_scaled_figure_has_the_points_and_capsules_of_its_urdf(figure):
    again = Figure(urdf=figure.urdf, srdf=figure.srdf)
    np.testing.assert_allclose(figure.neutral_points, again.neutral_points, atol=1e-12)
    assert figure.capsule_pairs == again.capsule_pairs
    for one, other in zip(figure.capsules, again.capsules, strict=True):
        assert one.link == other.link
        for size in ("center", "half_length", "radius"):
            assert getattr(one, size) == pytest.approx(getattr(other, size), abs=1e-12)


def test_capsules_are_pinocchios():
    q = configurations(FIGURE, 10)
    points = FIGURE.forward_kinematics(q)
    data, geometry = FIGURE.model.createData(), FIGURE.geometry.createData()
    for row, one in enumerate(q):
        pin.updateGeometryPlacements(FIGURE.model, data, FIGURE.geometry, geometry, one)
        for capsule, body, placement in zip(
            FIGURE.capsules, FIGURE.geometry.geometryObjects, geometry.oMg, strict=True
        ):
            middle, axis = (each[0] for each in capsule.place(points[row : row + 1]))
            np.testing.assert_allclose(middle, placement.translation, atol=1e-9)
            assert abs(axis @ placement.rotation[:, 2]) == pytest.approx(1)
            assert isinstance(body.geometry, coal.Capsule)
            assert (capsule.radius, capsule.half_length) == (body.geometry.radius, body.geometry.halfLength)
    assert np.isnan(FIGURE.capsules[0].place(np.full((1, 19, 3), np.nan))[0]).all()


def test_masses_follow_the_stature():
    for figure in FIGURES.values():
        stature = stature_from_lengths(figure.lengths)
        mass = sum(inertia.mass for inertia in figure.model.inertias)
        assert mass == pytest.approx(22.33 * stature**2, rel=0.01)
        moments = [np.linalg.eigvalsh(inertia.inertia) for inertia in figure.model.inertias[2:]]
        assert all(m[0] > 0 and m[0] + m[1] >= m[2] for m in moments)


def test_a_figure_is_written_read_and_pickled(tmp_path):
    figure = FIGURES["uneven"].with_limits({"left_knee.flexion": (0.0, 1.0)})
    figure.write(tmp_path / "figure.urdf")
    for again in (load_figure(tmp_path / "figure.urdf"), pickle.loads(pickle.dumps(figure))):
        assert again.hash == figure.hash
        assert dict(again.lengths) == dict(figure.lengths)
        assert again.limits.upper[DOFS.index("left_knee.flexion")] == 1.0


def test_it_is_a_robot_with_the_same_points():
    robot = load_robot("figure")
    q = configurations(FIGURE, 20)
    assert isinstance(FIGURE, Robot)
    assert FIGURE.configuration_names == robot.configuration_names
    np.testing.assert_allclose(FIGURE.points(q), robot.points(q), atol=1e-12)
    np.testing.assert_array_equal(FIGURE.collisions(q).hit, robot.collisions(q).hit)
    np.testing.assert_array_equal(FIGURE.upper, robot.upper)


TEXT = FIGURE.urdf
BREAKS = {
    "doctype": (TEXT.replace("<robot ", "<!DOCTYPE robot><robot ", 1), "DOCTYPE"),
    "truncated": (TEXT[:2000], "well-formed"),
    "another robot": ('<robot name="a"><link name="b"/></robot>', "expected"),
    "negative radius": (TEXT.replace('radius="0.09"', 'radius="-0.1"'), "radius"),
    "no head capsule": (
        re.sub(
            r'(<link name="head">.*?)<collision name.*?</collision>', r"\1", TEXT, count=1, flags=re.DOTALL
        ),
        "head",
    ),
    "a mesh": (TEXT.replace('<cylinder radius="0.09" length="0.28"/>', '<mesh filename="a.stl"/>'), "mesh"),
    "off its line": (TEXT.replace('xyz="0 0 -0.26"', 'xyz="0 0.01 -0.26"'), "beside the line"),
    "another axis": (TEXT.replace('<axis xyz="0 1 0"/>', '<axis xyz="0 0 1"/>', 1), "neck_flexion"),
    "a turned joint": (
        TEXT.replace('<origin xyz="0 0 -0.38"/>', '<origin xyz="0 0 -0.38" rpy="0 0.3 0"/>', 1),
        "right_ankle",
    ),
}


@pytest.mark.parametrize(("text", "says"), BREAKS.values(), ids=BREAKS)
def test_other_urdfs_are_refused_in_one_line(text, says):
    with pytest.raises(InputError, match=says) as raised:
        Figure(urdf=text, srdf=FIGURE.srdf, source="mine.urdf")
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("act", "says"),
    [
        (lambda: FIGURE.scaled({"neck-knee": 0.4}), "neck-knee"),
        (lambda: FIGURE.scaled({"pelvis-neck": 0.4}), "did you mean neck-pelvis"),
        (lambda: FIGURE.scaled({"neck-pelvis": np.nan}), "positive"),
        (lambda: FIGURE.scaled({"pelvis-right_hip": 0.9}), "the nearest body differs by"),
        (lambda: FIGURE.scaled(stature=175), "check its unit"),
        (lambda: FIGURE.scaled(head_points={"chin": [0, 0, 0]}), "chin"),
        (lambda: FIGURE.configurations(np.ones((14, 3))), r"\(14, 3\)"),
        (lambda: LengthUncertainty(own={"neck-knee": 0.1}), "neck-knee"),
        (lambda: LengthUncertainty(common=np.nan), "common"),
    ],
)
def test_impossible_bodies_are_refused(act, says):
    with pytest.raises(InputError, match=says):
        act()


def test_uncertain_lengths_have_their_covariance():
    known = LengthUncertainty(common=0.03, own={"neck-pelvis": 0.04})
    assert known.total("neck-pelvis") == pytest.approx(0.05)
    np.testing.assert_allclose(
        np.sqrt(np.diag(known.covariance)), [known.total(name) for name in SEGMENT_NAMES]
    )
    assert known.covariance[0, 1] == pytest.approx(0.03**2)
    assert LengthUncertainty.uniform(0.0).exact
    assert known.widened(100).common == 0.3


def test_lengths_of_a_stature_are_those_of_the_literature():
    """Winter 2009, fig. 4.1 (Drillis & Contini 1966)."""
    figure = FIGURE.scaled(stature=1.8)
    shares = {"shoulder-elbow": 0.186, "elbow-wrist": 0.146, "hip-knee": 0.245, "knee-ankle": 0.246}
    for name, share in shares.items():
        start, end = name.split("-")
        assert figure.lengths[f"left_{start}-left_{end}"] == pytest.approx(1.8 * share), name
    for name, share in {"shoulder": 0.259, "hip": 0.191}.items():
        assert figure.lengths[f"right_{name}-left_{name}"] == pytest.approx(1.8 * share), name
    height = figure.neutral_points[:, 2]
    assert height[1] - height[4] == pytest.approx((0.818 - 0.530) * 1.8, rel=1e-3)


@pytest.mark.parametrize(("stature", "possible"), [(0.39, False), (0.4, True), (2.8, True), (2.81, False)])
def test_statures_are_those_of_people_in_metres(stature, possible):
    if possible:
        assert stature_from_lengths(FIGURE.scaled(stature=stature).lengths) == pytest.approx(stature)
    else:
        with pytest.raises(InputError, match=r"stature.*check its unit"):
            FIGURE.scaled(stature=stature)


@pytest.mark.parametrize(("share", "certain"), [(0.93, True), (1.07, False)])
def test_the_side_of_the_shoulders_is_certain_within_three_deviations(share, certain):
    """The deviation of the shoulders' place in front of the line, by drawing lengths."""
    rng = np.random.default_rng(0)
    names = list(TORSO_LENGTHS)

    def forward_squared(lengths):
        a, c, b = (lengths[n] for n in ("neck-right_shoulder", "right_shoulder-pelvis", "neck-pelvis"))
        d, e = (lengths[n] for n in ("neck-left_shoulder", "left_shoulder-pelvis"))
        w, h, k = (
            lengths["right_shoulder-left_shoulder"],
            (b * b + a * a - c * c) / 2 / b,
            (b * b + d * d - e * e) / 2 / b,
        )
        across = np.sqrt(w * w - (h - k) ** 2)
        y = (across - (d * d - k * k - a * a + h * h) / across) / 2
        return a * a - h * h - y * y

    own = np.array([FIGURE.lengths[name] for name in names])
    drawn = np.exp(1e-5 * rng.normal(size=(20000, len(names)))) * own
    deviation = np.std([forward_squared(dict(zip(names, row, strict=True))) for row in drawn]) / 1e-5
    limit = 2 * forward_squared(FIGURE.lengths) / 3 / deviation
    known = LengthUncertainty(own=dict.fromkeys(names, share * limit))
    assert FIGURE.scaled(dict(FIGURE.lengths)).with_side_within(known).side_known == certain


def test_uncertainties_of_lengths_add_up():
    known = LengthUncertainty.uniform(0.01)
    bends = {"neck-pelvis": 0.017, "right_shoulder-pelvis": 0.027, "left_shoulder-pelvis": 0.027}
    for name in SEGMENT_NAMES:
        own = np.hypot(0.01, bends.get(name, 0.0))
        assert known.own[name] == pytest.approx(own) and known.total(name) == pytest.approx(
            np.hypot(0.01, own)
        )
    assert LengthUncertainty.uniform(1e-4).own["neck-pelvis"] == pytest.approx(np.sqrt(10) * 1e-4)
    covariance = known.covariance
    assert covariance[0, 1] == pytest.approx(1e-4) and covariance[1, 0] == covariance[0, 1]
    np.testing.assert_allclose(np.diag(covariance), [known.total(name) ** 2 for name in SEGMENT_NAMES])
    wide = known.widened(3.0)
    assert wide.common == pytest.approx(0.03) and wide.own["neck-pelvis"] == pytest.approx(
        3 * np.hypot(0.01, 0.017)
    )
    assert known.widened(1e3).common == LengthUncertainty.uniform(known.widened(1e3).common).common
    assert LengthUncertainty().exact and not known.exact and not LengthUncertainty(common=0.01).exact
    assert not LengthUncertainty(own={"neck-pelvis": 0.01}).exact
    assert hash(known) == hash(pickle.loads(pickle.dumps(known))) != hash(wide)
    for wrong in ({"common": -0.01}, {"own": {"neck": 0.1}}, {"common": 1.0}):
        with pytest.raises(InputError, match="length_deviation"):
            LengthUncertainty(**wrong)
