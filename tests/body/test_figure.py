"""The figure: kinematics there and back, other engines' kinematics, lengths, scaling, files and names."""

import itertools
import pickle
import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.body import Figure, load_figure, with_head
from posekit.body.figure import LINK_OF_POINT
from posekit.body.lengths import hips_points, torso_points
from posekit.errors import FigureError
from posekit.geometry import quaternion_from_rotation
from posekit.skeleton import DOFS, HEAD_POINTS, JOINT, JOINTS, POINTS, SEGMENT_NAMES, urdf_joint_name

FIGURE = load_figure()
TABLE_A1 = {
    "neck-right_shoulder": 20.5,
    "neck-left_shoulder": 20.5,
    "neck-pelvis": 46.3,
    "right_shoulder-pelvis": 50.2,
    "left_shoulder-pelvis": 50.2,
    "right_shoulder-right_elbow": 30,
    "left_shoulder-left_elbow": 30,
    "right_elbow-right_wrist": 26,
    "left_elbow-left_wrist": 26,
    "pelvis-right_hip": 19,
    "pelvis-left_hip": 19,
    "right_hip-right_knee": 38,
    "left_hip-left_knee": 38,
    "right_knee-right_ankle": 37,
    "left_knee-left_ankle": 37,
    "right_shoulder-left_shoulder": 40.3,
    "right_hip-left_hip": 32.2,
}
OTHER = {
    "neck-right_shoulder": 0.19,
    "neck-left_shoulder": 0.22,
    "right_shoulder-pelvis": 0.49,
    "right_hip-right_knee": 0.41,
    "left_elbow-left_wrist": 0.21,
    "right_hip-left_hip": 0.30,
}


def configuration(**angles: float) -> np.ndarray:
    """Make one configuration 4 m ahead, turned to nowhere in particular, with some joints (degrees)."""
    q = pin.neutral(FIGURE.model)[None].copy()
    q[0, :3] = [0.2, -0.1, 4.0]
    q[0, 3:7] = np.array([0.3, -0.5, 0.7, 0.2]) / np.linalg.norm([0.3, -0.5, 0.7, 0.2])
    for name, angle in angles.items():
        q[0, FIGURE.model.idx_qs[FIGURE.model.getJointId(name)]] = np.radians(angle)
    return np.asarray(q)


def random_configurations(rng: np.random.Generator, n: int, fraction: np.ndarray | None = None) -> np.ndarray:
    """Draw configurations with angles at a fraction (n, 22) of their ranges, uniform by default."""
    q = np.tile(pin.neutral(FIGURE.model), (n, 1))
    q[:, :3] = rng.normal(size=(n, 3)) * 0.3 + [0, 0, 4]
    turn = rng.normal(size=(n, 4))
    q[:, 3:7] = turn / np.linalg.norm(turn, axis=1, keepdims=True)
    limits = FIGURE.limits
    at = rng.random((n, 22)) if fraction is None else fraction
    q[:, FIGURE.angle_index] = limits.lower + at * (limits.upper - limits.lower)
    return np.asarray(q)


def assert_there_and_back(q: np.ndarray, *, inside: bool = True, figure: Figure = FIGURE) -> None:
    points = figure.forward_kinematics(q)
    found, distance = figure.configurations(points)
    assert distance.max() < 1e-9
    assert np.abs(figure.forward_kinematics(found) - points).max() < 1e-9
    if inside:
        angles = found[:, figure.angle_index]
        assert (angles >= figure.limits.lower - 1e-5).all()
        assert (angles <= figure.limits.upper + 1e-5).all()


class TestThereAndBack:
    def test_random_configurations(self, rng: np.random.Generator) -> None:
        assert_there_and_back(random_configurations(rng, 3000))

    def test_limits_met_exactly(self, rng: np.random.Generator) -> None:
        assert_there_and_back(random_configurations(rng, 2000, rng.integers(0, 2, (2000, 22)).astype(float)))

    def test_some_limits_met_exactly(self, rng: np.random.Generator) -> None:
        fraction = rng.choice([0.0, 0.5, 1.0, np.nan], (2000, 22))
        fraction = np.where(np.isnan(fraction), rng.random((2000, 22)), fraction)
        assert_there_and_back(random_configurations(rng, 2000, fraction))

    def test_straight_elbows_and_knees(self, rng: np.random.Generator) -> None:
        q = random_configurations(rng, 1000)
        hinges = [DOFS.index(f"{s}_{j}.flexion") for s in ("right", "left") for j in ("elbow", "knee")]
        q[:, FIGURE.angle_index[hinges]] = rng.choice([0.0, 1e-15, 1e-12, 1e-9, 1e-7, 1e-6, 1e-5], (1000, 4))
        assert_there_and_back(q)

    def test_t_pose(self, rng: np.random.Generator) -> None:
        q = random_configurations(rng, 1000)
        arms = [DOFS.index(f"{s}_shoulder.abduction") for s in ("right", "left")]
        q[:, FIGURE.angle_index[arms]] = np.pi / 2
        assert_there_and_back(q)
        assert_there_and_back(configuration(right_shoulder_abduction=90, left_shoulder_abduction=90))

    def test_nearly_a_t_pose(self, rng: np.random.Generator) -> None:
        q = random_configurations(rng, 2000)
        arms = [DOFS.index(f"{s}_shoulder.abduction") for s in ("right", "left")]
        near = rng.choice([1e-15, 1e-12, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5], (2000, 2))
        q[:, FIGURE.angle_index[arms]] = np.pi / 2 + near * rng.choice([-1, 1], (2000, 2))
        assert_there_and_back(q)

    def test_abduction_beyond_90(self, rng: np.random.Generator) -> None:
        q = random_configurations(rng, 1000)
        arms = [DOFS.index(f"{s}_shoulder.abduction") for s in ("right", "left")]
        q[:, FIGURE.angle_index[arms]] = rng.uniform(np.pi / 2, FIGURE.limits.upper[arms], (1000, 2))
        assert_there_and_back(q)

    @pytest.mark.parametrize("bend", [160.0, 175.0, 179.9999999, 180.0])
    def test_folded_limbs(self, bend: float) -> None:
        q = configuration(right_elbow_flexion=bend, left_knee_flexion=bend, right_shoulder_rotation=20)
        assert_there_and_back(q, inside=False)

    @pytest.mark.parametrize("below", [0.0, 1e-13, 1e-10, 1e-7, 1e-4, -1e-10])
    @pytest.mark.parametrize("joint", ["pelvis", "neck"])
    def test_bending_by_a_right_angle(self, joint: str, below: float) -> None:
        # Far outside the limits, and singular: flexion and rotation turn about one line there.
        angles = {f"{joint}_flexion": 17.0, f"{joint}_bending": 90.0 - below, f"{joint}_rotation": 23.0}
        assert_there_and_back(configuration(**angles), inside=False)

    def test_any_angles_at_all(self, rng: np.random.Generator) -> None:
        q = random_configurations(rng, 2000)
        q[:, FIGURE.angle_index] = rng.uniform(-np.pi, np.pi, (2000, 22))
        assert_there_and_back(q, inside=False)

    def test_every_quarter_turn(self) -> None:
        quarter = [-90.0, 0.0, 90.0, 180.0]
        rows = [
            configuration(right_shoulder_flexion=a, right_shoulder_abduction=b, right_shoulder_rotation=c)
            for a, b, c in itertools.product(quarter, repeat=3)
        ]
        q = np.concatenate(rows)
        for hinge in (0.0, 90.0, 180.0):
            q[:, FIGURE.angle_index[DOFS.index("right_elbow.flexion")]] = np.radians(hinge)
            assert_there_and_back(q, inside=False)

    def test_another_persons_figure(self, rng: np.random.Generator) -> None:
        assert_there_and_back(random_configurations(rng, 500), figure=FIGURE.scaled(OTHER))

    def test_the_root_is_recovered(self, rng: np.random.Generator) -> None:
        q = random_configurations(rng, 200)
        found = FIGURE.configurations(FIGURE.forward_kinematics(q)).q
        np.testing.assert_allclose(found[:, :3], q[:, :3], rtol=0, atol=1e-12)
        same = np.abs(np.einsum("ni,ni->n", found[:, 3:7], q[:, 3:7]))
        np.testing.assert_allclose(same, 1, rtol=0, atol=1e-12)
        assert (found[:, 6] >= 0).all()

    def test_the_frame_does_not_matter_to_the_angles(self, rng: np.random.Generator) -> None:
        q = random_configurations(rng, 100)
        moved = q.copy()
        moved[:, :7] = pin.neutral(FIGURE.model)[:7]
        angles, others = (
            FIGURE.configurations(FIGURE.forward_kinematics(x)).q[:, FIGURE.angle_index] for x in (q, moved)
        )
        same = np.abs(angles - others).max(axis=1) < 1e-7
        # Two answers inside the limits can be equally good: rounding may then choose.
        assert same.mean() > 0.98


class TestUnknownJoints:
    def test_a_head_that_was_not_seen_is_neutral(self, rng: np.random.Generator) -> None:
        points = FIGURE.forward_kinematics(random_configurations(rng, 20))
        q, distance = FIGURE.configurations(points[:, : len(JOINTS)])
        assert (q[:, FIGURE.angle_index[:3]] == 0).all()
        assert distance.max() < 1e-9

    @pytest.mark.parametrize("missing", ["right_wrist", "left_ankle", "left_elbow", "right_hip"])
    def test_unknown_joints_give_unknown_angles_only_where_they_matter(self, missing: str) -> None:
        points = FIGURE.forward_kinematics(configuration(right_shoulder_flexion=30, left_knee_flexion=40))
        complete = FIGURE.configurations(points).q
        points[:, JOINT[missing]] = np.nan
        q, distance = FIGURE.configurations(points)
        known = np.isfinite(q)
        assert 0 < (~known).sum() <= 11
        np.testing.assert_allclose(q[known], complete[known], rtol=0, atol=1e-12)
        assert distance[0] < 1e-9

    def test_an_unknown_torso_gives_nothing(self) -> None:
        points = FIGURE.forward_kinematics(configuration())
        points[:, JOINT["pelvis"]] = np.nan
        q, distance = FIGURE.configurations(points)
        assert np.isnan(q[:, 3:7]).all()
        assert np.isnan(distance).all()

    def test_no_postures(self) -> None:
        q, distance = FIGURE.configurations(np.empty((0, 14, 3)))
        assert q.shape == (0, FIGURE.model.nq)
        assert distance.shape == (0,)

    def test_a_posture_of_other_lengths_reports_its_distance(self) -> None:
        points = FIGURE.forward_kinematics(configuration())
        direction = points[0, JOINT["right_wrist"]] - points[0, JOINT["right_elbow"]]
        points[0, JOINT["right_wrist"]] += 0.02 * direction / np.linalg.norm(direction)
        np.testing.assert_allclose(FIGURE.configurations(points).distance, 0.02, rtol=0, atol=1e-9)

    @pytest.mark.parametrize("shape", [(14, 3), (2, 13, 3), (2, 14, 2), (2, 15, 3), (1, 2, 14, 3)])
    def test_postures_of_another_shape_are_refused(self, shape: tuple[int, ...]) -> None:
        with pytest.raises(FigureError, match="postures have shape"):
            with_head(np.zeros(shape))


class TestForwardKinematics:
    def test_agrees_with_yourdfpy(self, rng: np.random.Generator, tmp_path: Path) -> None:
        yourdfpy = pytest.importorskip("yourdfpy")
        path = tmp_path / "figure.urdf"
        FIGURE.write(path)
        robot = yourdfpy.URDF.load(str(path), load_meshes=False)
        q = random_configurations(rng, 30)
        points = FIGURE.forward_kinematics(q)
        for row, expected in zip(q, points, strict=True):
            angles = row[FIGURE.angle_index]
            robot.update_cfg({urdf_joint_name(dof): a for dof, a in zip(DOFS, angles, strict=True)})
            links = [LINK_OF_POINT.get(name, name) for name in POINTS]
            local = np.array([robot.get_transform(link, "torso")[:3, 3] for link in links])
            R = pin.Quaternion(row[3:7]).toRotationMatrix()
            np.testing.assert_allclose(local @ R.T + row[:3], expected, rtol=0, atol=1e-12)

    def test_agrees_with_mujoco(self, rng: np.random.Generator) -> None:
        mujoco = pytest.importorskip("mujoco")
        options = (
            '<mujoco><compiler fusestatic="false"/></mujoco>'  # else wrists and ankles are no bodies there
        )
        text = FIGURE.urdf.replace('<robot name="stick_figure">', f'<robot name="stick_figure">{options}')
        model = mujoco.MjModel.from_xml_string(text)
        assert model.njnt == len(DOFS)
        assert model.ngeom == len(FIGURE.capsules)
        data = mujoco.MjData(model)
        q = random_configurations(rng, 20)
        q[:, :7] = pin.neutral(FIGURE.model)[:7]
        for row, expected in zip(q, FIGURE.forward_kinematics(q), strict=True):
            for dof, angle in zip(DOFS, row[FIGURE.angle_index], strict=True):
                data.qpos[model.joint(urdf_joint_name(dof)).qposadr[0]] = angle
            mujoco.mj_kinematics(model, data)
            for k, name in enumerate(POINTS[1:], start=1):
                place = data.body(LINK_OF_POINT.get(name, name)).xpos
                np.testing.assert_allclose(place, expected[k], rtol=0, atol=1e-12)

    def test_every_posture_has_the_figures_lengths(self, rng: np.random.Generator) -> None:
        points = FIGURE.forward_kinematics(random_configurations(rng, 100))
        for name, length in FIGURE.lengths.items():
            a, b = (JOINT[joint] for joint in name.split("-"))
            seen = np.linalg.norm(points[:, a] - points[:, b], axis=1)
            np.testing.assert_allclose(seen, length, rtol=0, atol=1e-12)

    @pytest.mark.parametrize("shape", [(29,), (2, 28), (2, 30), (1, 2, 29)])
    def test_another_shape_is_refused(self, shape: tuple[int, ...]) -> None:
        with pytest.raises(FigureError, match=re.escape(f"q has shape {shape}; expected (N, 29)")):
            FIGURE.forward_kinematics(np.zeros(shape))

    @pytest.mark.parametrize("norm", [0.0, 0.5, 1 + 2e-6, 1 - 2e-6, 7.0, np.inf])
    def test_a_quaternion_that_is_not_of_unit_length_is_refused(self, norm: float) -> None:
        q = np.concatenate([configuration(), configuration()])
        q[1, 3:7] = [0, 0, 0, norm]
        with pytest.raises(FigureError, match=r"configuration 1 has length .*; expected 1") as error:
            FIGURE.forward_kinematics(q)
        assert "\n" not in str(error.value)

    @pytest.mark.parametrize("norm", [1 - 9e-7, 1 + 9e-7])
    def test_a_quaternion_of_nearly_unit_length_is_taken(self, norm: float) -> None:
        q = configuration()
        q[:, 3:7] *= norm
        gap = FIGURE.forward_kinematics(q) - FIGURE.forward_kinematics(configuration())
        assert np.abs(gap).max() < 5e-6

    def test_nan_gives_nan(self) -> None:
        q = np.concatenate([configuration(), configuration(), configuration()])
        q[0, 3] = np.nan
        q[1, FIGURE.angle_index[DOFS.index("right_elbow.flexion")]] = np.nan
        points = FIGURE.forward_kinematics(q)
        assert np.isnan(points[0, 1:]).all()
        assert np.isnan(points[1, JOINT["right_wrist"]]).all()
        assert np.isfinite(points[1, JOINT["left_wrist"]]).all()
        assert np.isfinite(points[2]).all()


class TestQuaternions:
    @given(
        st.tuples(*[st.floats(-1, 1, allow_subnormal=False)] * 4).filter(lambda q: np.linalg.norm(q) > 1e-3)
    )
    def test_a_rotation_is_recovered(self, components: tuple[float, ...]) -> None:
        q = np.array(components) / np.linalg.norm(components)
        R = pin.Quaternion(q).toRotationMatrix()
        found = quaternion_from_rotation(R[None])[0]
        assert found[3] >= 0
        np.testing.assert_allclose(abs(found @ q), 1, rtol=0, atol=1e-14)

    @pytest.mark.parametrize("axis", [*np.eye(3), np.ones(3) / np.sqrt(3), np.array([0.6, -0.8, 0])])
    @pytest.mark.parametrize("angle", [0.0, 1e-9, np.pi - 1e-9, np.pi, np.pi + 1e-9, 2 * np.pi])
    def test_half_turns_lose_no_digits(self, axis: np.ndarray, angle: float) -> None:
        R = pin.AngleAxis(angle, axis).toRotationMatrix()
        q = quaternion_from_rotation(R[None])[0]
        np.testing.assert_allclose(np.linalg.norm(q), 1, rtol=0, atol=1e-15)
        np.testing.assert_allclose(pin.Quaternion(q).toRotationMatrix(), R, rtol=0, atol=1e-14)


class TestLengths:
    def test_are_those_of_table_a1(self) -> None:
        assert set(FIGURE.lengths) == set(SEGMENT_NAMES) == set(TABLE_A1)
        for name, centimetres in TABLE_A1.items():
            assert FIGURE.lengths[name] * 100 == pytest.approx(centimetres, abs=1e-10)

    def test_of_the_torso_put_the_shoulders_in_front_of_the_spine(self) -> None:
        neck, right, left, pelvis = torso_points(FIGURE.lengths)
        middle = (right + left) / 2
        assert middle[2] * 100 == pytest.approx(-0.474, abs=5e-4)
        assert middle[0] * 100 == pytest.approx(3.742, abs=5e-4)
        assert middle[1] == pytest.approx(0, abs=1e-12)
        np.testing.assert_allclose(neck, np.zeros(3), rtol=0, atol=1e-12)
        np.testing.assert_allclose(pelvis, np.array([0, 0, -0.463]), rtol=0, atol=1e-12)
        np.testing.assert_allclose(FIGURE.neutral_points[:4], [neck, right, left, pelvis], rtol=0, atol=1e-12)

    def test_of_the_hips_put_the_pelvis_above_them(self) -> None:
        pelvis, right, left = hips_points(FIGURE.lengths)
        assert -(right + left)[2] / 2 * 100 == pytest.approx(10.09, abs=5e-3)
        np.testing.assert_allclose(pelvis, 0, rtol=0, atol=0)
        assert right[1] < 0 < left[1]

    def test_of_the_head_are_those_of_table_a2(self) -> None:
        expected = [[0, 0, 0], [5, 9.5, 0], [3, 13, 5.5], [3, 13, -5.5], [-1, 8, 8.5], [-1, 8, -8.5]]
        np.testing.assert_allclose(FIGURE.head_points * 100, np.array(expected), rtol=0, atol=1e-12)

    @given(factors=st.lists(st.floats(0.995, 1.005), min_size=9, max_size=9))
    def test_any_torso_and_hips_have_the_lengths_they_were_made_from(self, factors: list[float]) -> None:
        names = [n for n in SEGMENT_NAMES if set(n.split("-")) <= {*JOINTS[:6]}]
        lengths = {name: FIGURE.lengths[name] * f for name, f in zip(names, factors, strict=True)}
        torso, hips = torso_points(lengths), hips_points(lengths)
        place = dict(zip(JOINTS[:4], torso, strict=True))
        place |= dict(zip(JOINTS[4:6], hips[1:] + torso[3], strict=True))
        for name, length in lengths.items():
            a, b = name.split("-")
            assert np.linalg.norm(place[a] - place[b]) == pytest.approx(length, abs=1e-12)


class TestScaling:
    def test_by_nothing_changes_nothing(self) -> None:
        same = FIGURE.scaled({})
        np.testing.assert_allclose(same.neutral_points, FIGURE.neutral_points, rtol=0, atol=1e-14)
        for ours, theirs in zip(same.capsules, FIGURE.capsules, strict=True):
            assert ours.radius == pytest.approx(theirs.radius, abs=1e-14)
            assert ours.half_length == pytest.approx(theirs.half_length, abs=1e-14)
            assert ours.center == pytest.approx(theirs.center, abs=1e-14)
        assert same.collision_pairs == FIGURE.collision_pairs

    def test_gives_the_lengths_asked_for_and_keeps_the_others(self) -> None:
        figure = FIGURE.scaled(OTHER)
        for name in SEGMENT_NAMES:
            assert figure.lengths[name] == pytest.approx(OTHER.get(name, FIGURE.lengths[name]), abs=1e-12)
        np.testing.assert_allclose(figure.head_points, FIGURE.head_points, rtol=0, atol=1e-14)

    def test_twice_is_once(self) -> None:
        twice = FIGURE.scaled(OTHER).scaled(FIGURE.lengths)
        np.testing.assert_allclose(twice.neutral_points, FIGURE.neutral_points, rtol=0, atol=1e-12)
        for ours, theirs in zip(twice.capsules, FIGURE.capsules, strict=True):
            assert ours.radius == pytest.approx(theirs.radius, abs=1e-12)

    @pytest.mark.parametrize("factor", [0.5, 1.7])
    def test_of_every_length_scales_every_capsule(self, factor: float) -> None:
        head = {name: FIGURE.head_points[k + 1] * factor for k, name in enumerate(HEAD_POINTS)}
        figure = FIGURE.scaled({name: factor * length for name, length in FIGURE.lengths.items()}, head)
        np.testing.assert_allclose(figure.neutral_points, factor * FIGURE.neutral_points, rtol=0, atol=1e-12)
        for big, small in zip(figure.capsules, FIGURE.capsules, strict=True):
            assert big.link == small.link
            assert big.radius == pytest.approx(factor * small.radius, abs=1e-12)
            assert big.half_length == pytest.approx(factor * small.half_length, abs=1e-12)
            assert big.center == pytest.approx(factor * small.center, abs=1e-12)

    def test_of_one_limb_scales_its_capsule_alone(self) -> None:
        figure = FIGURE.scaled({"left_hip-left_knee": 2 * FIGURE.lengths["left_hip-left_knee"]})
        for ours, theirs in zip(figure.capsules, FIGURE.capsules, strict=True):
            factor = 2 if ours.link == "left_thigh" else 1
            assert ours.radius == pytest.approx(factor * theirs.radius, abs=1e-12)
            assert ours.half_length == pytest.approx(factor * theirs.half_length, abs=1e-12)

    def test_the_torsos_capsule_grows_with_the_shoulders_and_the_spine(self) -> None:
        names = ("neck-pelvis", "right_shoulder-pelvis", "left_shoulder-pelvis")
        longer = FIGURE.scaled(dict(zip(names, (0.5, 0.536, 0.536), strict=True)))
        narrower = FIGURE.scaled({"right_shoulder-left_shoulder": 0.9 * 0.403})
        ours, tall, narrow = (figure.capsules[self.torso(figure)] for figure in (FIGURE, longer, narrower))
        assert tall.radius == pytest.approx(ours.radius, abs=1e-12)
        assert tall.half_length == pytest.approx(ours.half_length * 0.5 / 0.463, abs=1e-12)
        assert narrow.radius == pytest.approx(0.9 * ours.radius, abs=1e-12)
        assert narrow.half_length == pytest.approx(ours.half_length, abs=1e-12)

    @staticmethod
    def torso(figure: Figure) -> int:
        return [capsule.link for capsule in figure.capsules].index("torso")

    def test_takes_other_head_points(self) -> None:
        figure = FIGURE.scaled({}, {"neck": [1, 2, 3], "nose": [1.06, 2.1, 3.0]})
        np.testing.assert_allclose(figure.head_points[1], [0.06, 0.1, 0], rtol=0, atol=1e-12)
        np.testing.assert_allclose(figure.head_points[2:], FIGURE.head_points[2:], rtol=0, atol=1e-12)

    @pytest.mark.parametrize("stature", [0.4, 1.0, 1.75, 2.8])
    def test_from_stature_gives_the_fractions(self, stature: float) -> None:
        figure = FIGURE.from_stature(stature)
        lengths = figure.lengths
        fractions = {"shoulder-right_elbow": 0.186, "elbow-right_wrist": 0.146, "hip-right_knee": 0.245}
        for name, fraction in (fractions | {"knee-right_ankle": 0.246}).items():
            assert lengths[f"right_{name}"] == pytest.approx(fraction * stature, abs=1e-12)
        assert lengths["right_shoulder-left_shoulder"] == pytest.approx(0.259 * stature, abs=1e-12)
        assert lengths["right_hip-left_hip"] == pytest.approx(0.191 * stature, abs=1e-12)
        joints = figure.neutral_points
        above = (joints[1] + joints[2] - joints[4] - joints[5])[2] / 2
        assert above == pytest.approx(0.288 * stature, abs=1e-12)

    def test_from_stature_is_proportional(self) -> None:
        one, two = FIGURE.from_stature(1.2), FIGURE.from_stature(2.4)
        np.testing.assert_allclose(two.neutral_points, 2 * one.neutral_points, rtol=0, atol=1e-12)

    @pytest.mark.parametrize("stature", [0.0, -1.7, 0.39, 2.9, 175.0, np.nan, np.inf])
    def test_from_an_impossible_stature_is_refused(self, stature: float) -> None:
        with pytest.raises(FigureError, match=r"stature is .* expected 0\.4 to 2\.8 m"):
            FIGURE.from_stature(stature)


class TestFiles:
    @pytest.mark.parametrize("figure", [FIGURE, FIGURE.scaled(OTHER), FIGURE.from_stature(1.6)])
    def test_writing_and_loading_gives_the_same_figure(self, tmp_path: Path, figure: Figure) -> None:
        path = tmp_path / "someone.urdf"
        figure.write(path)
        again = load_figure(path)
        assert again.urdf == figure.urdf
        assert again.hash == figure.hash
        assert again.capsules == figure.capsules
        assert again.collision_pairs == figure.collision_pairs
        np.testing.assert_array_equal(again.neutral_points, figure.neutral_points)

    def test_without_an_srdf_the_built_in_one_is_taken(self, tmp_path: Path) -> None:
        path = tmp_path / "someone.urdf"
        path.write_text(FIGURE.urdf, encoding="utf-8")
        assert load_figure(str(path)).collision_pairs == FIGURE.collision_pairs

    def test_the_hash_tells_figures_apart(self) -> None:
        assert (
            len({FIGURE.hash, FIGURE.scaled(OTHER).hash, FIGURE.with_limits({"neck.flexion": (0, 1)}).hash})
            == 3
        )

    def test_a_figure_can_be_pickled(self) -> None:
        again = pickle.loads(pickle.dumps(FIGURE))
        np.testing.assert_array_equal(again.neutral_points, FIGURE.neutral_points)

    def test_other_limits(self) -> None:
        figure = FIGURE.with_limits({"right_elbow.flexion": (0.1, 0.2)})
        row = DOFS.index("right_elbow.flexion")
        assert (figure.limits.lower[row], figure.limits.upper[row]) == (0.1, 0.2)
        others = np.arange(22) != row
        np.testing.assert_array_equal(figure.limits.upper[others], FIGURE.limits.upper[others])


class TestNames:
    def test_of_configurations_are_pinocchios_order(self) -> None:
        assert FIGURE.configuration_names[:7] == ("x", "y", "z", "qx", "qy", "qz", "qw")
        assert list(FIGURE.configuration_names[7:]) == list(FIGURE.model.names)[2:]

    def test_a_positive_angle_is_what_it_is_called(self) -> None:
        def moved(point: str, **angles: float) -> np.ndarray:
            q = configuration(**angles)
            q[:, :7] = pin.neutral(FIGURE.model)[:7]
            k = POINTS.index(point)
            return np.asarray(FIGURE.forward_kinematics(q)[0, k] - FIGURE.neutral_points[k])

        x, y = 0, 1
        assert moved("right_elbow", right_shoulder_flexion=30)[x] > 0.1
        assert moved("left_elbow", left_shoulder_flexion=30)[x] > 0.1
        assert moved("right_elbow", right_shoulder_abduction=30)[y] < -0.1
        assert moved("left_elbow", left_shoulder_abduction=30)[y] > 0.1
        assert moved("right_wrist", right_elbow_flexion=90)[x] > 0.2
        # Internal rotation brings a forearm held forward in front of the body.
        assert moved("right_wrist", right_elbow_flexion=90, right_shoulder_rotation=60)[y] > 0.1
        assert moved("left_wrist", left_elbow_flexion=90, left_shoulder_rotation=60)[y] < -0.1
        assert moved("right_knee", right_hip_flexion=30)[x] > 0.1
        assert moved("right_knee", right_hip_abduction=30)[y] < -0.1
        assert moved("left_knee", left_hip_abduction=30)[y] > 0.1
        assert moved("right_ankle", right_knee_flexion=30)[x] < -0.1
        assert moved("nose", neck_flexion=30)[2] < 0
        assert moved("nose", neck_rotation=30)[y] > 0
        assert moved("nose", neck_bending=30)[y] > 0
        # The trunk bends forward over the hips: in the torso's frame, the hips come forward.
        assert moved("right_hip", pelvis_flexion=30)[x] > 0
        assert moved("right_hip", pelvis_bending=30)[y] > 0
        assert moved("left_hip", pelvis_rotation=30)[x] > 0
