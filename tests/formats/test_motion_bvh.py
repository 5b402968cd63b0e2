"""BVH: what is written is what forward kinematics says, and any file is read as its channels say."""

import itertools
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import bvh
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.spatial.transform import Rotation

from posekit.body import Figure, load_figure
from posekit.errors import InputError
from posekit.formats.motion.bvh import BVH_FORMAT, examine_bvh, read_bvh, write_bvh
from posekit.formats.motion.bvh_angles import continuous, euler_angles, euler_rotation
from posekit.formats.motion.bvh_names import ANIMATION_NAMES
from posekit.formats.motion.bvh_size import CMU_UNIT_METRES
from posekit.formats.motion.motion import UP_DIRECTIONS, Motion
from posekit.formats.motion.motion_axes import up_rotation
from posekit.formats.motion.motion_format import METRES_IN_UNIT
from posekit.formats.motion.postures import layout_of, postures_of
from posekit.formats.skeleton_maps import LANDMARK_INDEX, load_skeleton_map
from posekit.geometry import quaternion_from_rotation, rotation_from_quaternion
from posekit.skeleton import DOFS, JOINTS, POINTS
from posekit.synthesis.walker import Walker

FIGURE = load_figure()
SMALL = Path(__file__).with_name("small.bvh").read_text(encoding="utf-8")
OTHER = FIGURE.scaled(
    {
        "neck-right_shoulder": 0.19,
        "neck-left_shoulder": 0.22,
        "right_shoulder-pelvis": 0.49,
        "right_hip-right_knee": 0.41,
        "left_elbow-left_wrist": 0.21,
        "right_hip-left_hip": 0.30,
    }
)
EXACT = 1e-7
"""Metres: six decimals of a degree along four joints, ten times below what is asked for."""


def configurations(rng: np.random.Generator, n: int, figure: Figure = FIGURE) -> np.ndarray:
    """Draw configurations over all of the limits, anywhere in a room, turned anyhow."""
    q = np.tile(pin.neutral(figure.model), (n, 1))
    q[:, :3] = rng.normal(size=(n, 3)) + np.array([0, 0, 4])
    turn = rng.normal(size=(n, 4))
    q[:, 3:7] = turn / np.linalg.norm(turn, axis=1, keepdims=True)
    limits = figure.limits
    q[:, figure.angle_index] = limits.lower + rng.random((n, 22)) * (limits.upper - limits.lower)
    return q


def seconds(n: int, rate: float = 30.0) -> np.ndarray:
    return np.arange(n) / rate


def figure_points(motion: Motion) -> np.ndarray:
    """Pick the figure's 19 points out of a file that was written of it."""
    return motion.points[:, [motion.names.index(ANIMATION_NAMES[point]) for point in POINTS]]


def expected_points(figure: Figure, q: np.ndarray, up: str = "+z") -> np.ndarray:
    return figure.forward_kinematics(q) @ up_rotation(up, "+y").T


class TestWhatIsWritten:
    @pytest.mark.parametrize("figure", [FIGURE, OTHER], ids=["built-in", "uneven"])
    def test_reads_back_as_forward_kinematics(
        self, figure: Figure, rng: np.random.Generator, tmp_path: Path
    ) -> None:
        q = configurations(rng, 300, figure)
        write_bvh(tmp_path / "a.bvh", figure, q, seconds(300))
        motion = read_bvh(tmp_path / "a.bvh")
        assert np.abs(figure_points(motion) - expected_points(figure, q)).max() < EXACT
        np.testing.assert_allclose(motion.time, seconds(300), rtol=0, atol=1e-7)
        assert motion.rate == pytest.approx(30, abs=1e-6)
        assert motion.up == "+y"

    @pytest.mark.parametrize("velocity", [0.6, 1.2])
    def test_walker(self, velocity: float, tmp_path: Path) -> None:
        q = Walker(velocity=velocity).configurations(np.linspace(0, 3, 91))
        write_bvh(tmp_path / "walk.bvh", FIGURE, q, seconds(91), up="+y")
        motion = read_bvh(tmp_path / "walk.bvh")
        assert np.abs(figure_points(motion) - FIGURE.forward_kinematics(q)).max() < EXACT
        channels = channel_table(tmp_path / "walk.bvh")
        assert np.abs(np.diff(channels, axis=0)).max() < 30

    @pytest.mark.parametrize("up", sorted(UP_DIRECTIONS))
    def test_any_axis_of_q_may_point_up(self, up: str, rng: np.random.Generator, tmp_path: Path) -> None:
        q = configurations(rng, 5)
        write_bvh(tmp_path / "a.bvh", FIGURE, q, seconds(5), up=up)
        motion = read_bvh(tmp_path / "a.bvh", up="+y")
        assert np.abs(figure_points(motion) - expected_points(FIGURE, q, up)).max() < EXACT
        lifted = q.copy()
        lifted[:, :3] += UP_DIRECTIONS[up]
        write_bvh(tmp_path / "b.bvh", FIGURE, lifted, seconds(5), up=up)
        step = read_bvh(tmp_path / "b.bvh").points - motion.points
        assert np.abs(step - [0, 1, 0]).max() < EXACT

    @pytest.mark.parametrize("unit", sorted(METRES_IN_UNIT))
    def test_any_unit_is_told_by_the_size_of_the_body(
        self, unit: str, rng: np.random.Generator, tmp_path: Path
    ) -> None:
        q = configurations(rng, 4)
        write_bvh(tmp_path / "a.bvh", FIGURE, q, seconds(4), unit=unit)
        reading = examine_bvh(tmp_path / "a.bvh")
        assert reading.unit.name == unit
        limit = 1e-6 if unit == "m" else EXACT
        assert np.abs(figure_points(reading.motion) - expected_points(FIGURE, q)).max() < limit

    def test_channels_are_the_figures_own_angles(self, rng: np.random.Generator, tmp_path: Path) -> None:
        """One frame: the joints' channels are flexion, abduction and rotation, with the sign of the URDF's axis."""
        q = configurations(rng, 1)
        write_bvh(tmp_path / "a.bvh", FIGURE, q, seconds(1))
        document = bvh.Bvh((tmp_path / "a.bvh").read_text())
        own = dict(zip(DOFS, np.degrees(q[0, FIGURE.angle_index] * FIGURE.limits.sign), strict=True))
        for joint in ("neck", "right_shoulder", "left_hip"):
            lift = "bending" if joint == "neck" else "abduction"
            channels = document.frame_joint_channels(
                0, ANIMATION_NAMES[joint], ["Xrotation", "Zrotation", "Yrotation"]
            )
            wanted = [own[f"{joint}.{name}"] for name in ("flexion", lift, "rotation")]
            np.testing.assert_allclose(channels, wanted, rtol=0, atol=1e-6)

    def test_independent_reader_and_kinematics(self, rng: np.random.Generator, tmp_path: Path) -> None:
        """The `bvh` package parses; SciPy's rotations place."""
        q = configurations(rng, 6)
        write_bvh(tmp_path / "a.bvh", FIGURE, q, seconds(6, 25.0))
        document = bvh.Bvh((tmp_path / "a.bvh").read_text())
        assert document.nframes == 6
        assert document.frame_time == pytest.approx(0.04)
        expected = expected_points(FIGURE, q)
        for frame in range(6):
            placed = oracle(document, frame)
            for k, point in enumerate(POINTS):
                gap = np.abs(0.01 * placed[ANIMATION_NAMES[point]] - expected[frame, k]).max()
                assert gap < EXACT, point

    def test_every_joint_has_the_same_three_turns(self, tmp_path: Path) -> None:
        """Readers that know one order a file, and three channels a joint, read it too (LaFAN1's does)."""
        write_bvh(tmp_path / "a.bvh", FIGURE, pin.neutral(FIGURE.model)[None], seconds(1))
        text = (tmp_path / "a.bvh").read_text()
        lines = re.findall(r"CHANNELS (.*)", text)
        turns = "Xrotation Zrotation Yrotation"
        assert lines == [f"6 Xposition Yposition Zposition {turns}"] + [f"3 {turns}"] * 20
        assert "e-" not in text
        assert set(ANIMATION_NAMES[joint] for joint in JOINTS) <= set(bvh.Bvh(text).get_joints_names())

    def test_rest_pose_stands_upright_and_faces_z(self, tmp_path: Path) -> None:
        """Offsets alone: hanging arms, y up, the left to +x, the nose ahead in +z."""
        write_bvh(tmp_path / "a.bvh", FIGURE, pin.neutral(FIGURE.model)[None], seconds(1))
        document = bvh.Bvh((tmp_path / "a.bvh").read_text())
        document.frames = [["0"] * len(document.frames[0])]
        placed = oracle(document, 0)
        assert placed["NeckBase"][1] > placed["Hips"][1] > placed["LeftLeg"][1] > placed["LeftFoot"][1]
        assert placed["LeftArm"][0] > 0 > placed["RightArm"][0]
        assert placed["Nose"][2] > placed["NeckBase"][2]

    def test_frame_by_frame_jumps_are_small_whatever_branch_q_is_in(self, tmp_path: Path) -> None:
        """An arm raised sideways through 90 degrees, q in the other Euler branch in every second frame."""
        n = 121
        q = np.tile(pin.neutral(FIGURE.model), (n, 1))
        at = {name: k for k, name in enumerate(FIGURE.configuration_names)}
        swing = np.linspace(0, 1, n)
        triple = np.stack([0.3 * swing, np.radians(30 + 100 * swing), 0.4 - 0.5 * swing], axis=-1)
        other = np.stack([triple[:, 0] + np.pi, np.pi - triple[:, 1], triple[:, 2] - np.pi], axis=-1)
        names = [f"left_shoulder_{turn}" for turn in ("flexion", "abduction", "rotation")]
        sign = FIGURE.limits.sign[[DOFS.index(name.replace("r_", "r.")) for name in names]]
        mixed = np.where((np.arange(n) % 2 == 1)[:, None], other, triple)
        q[:, [at[name] for name in names]] = mixed * sign
        yaw = np.pi * np.linspace(-1, 5, n)  # three turns about the vertical: w changes sign on the way
        q[:, 5], q[:, 6] = np.sin(yaw / 2), np.cos(yaw / 2)
        write_bvh(tmp_path / "a.bvh", FIGURE, q, seconds(n))
        assert np.abs(figure_points(read_bvh(tmp_path / "a.bvh")) - expected_points(FIGURE, q)).max() < EXACT
        table = channel_table(tmp_path / "a.bvh")
        assert np.abs(np.diff(table, axis=0)).max() < np.degrees(yaw[1] - yaw[0]) + 1e-3
        assert np.abs(np.diff(np.degrees(mixed), axis=0)).max() > 100  # what q itself does

    def test_an_arm_held_at_ninety_degrees_keeps_its_first_angle(self) -> None:
        angles = np.zeros((5, 1, 3))
        angles[:, 0, 1] = np.pi / 2
        angles[:, 0, 0] = [0.2, 1.5, -2.0, 3.0, 0.1]
        angles[:, 0, 2] = angles[:, 0, 0] + 0.1 * np.arange(5)
        chosen = continuous(angles)
        np.testing.assert_allclose(chosen[:, 0, 0], 0.2)
        np.testing.assert_allclose(np.diff(chosen[:, 0, 2]), 0.1, rtol=0, atol=1e-12)
        assert np.abs(euler_rotation(chosen) - euler_rotation(angles)).max() < 1e-12

    def test_angles_that_are_not_known(self, rng: np.random.Generator, tmp_path: Path) -> None:
        q = configurations(rng, 5)
        elbow = FIGURE.configuration_names.index("right_elbow_flexion")
        knee = FIGURE.configuration_names.index("left_knee_flexion")
        q[[0, 2], elbow] = np.nan
        q[:, knee] = np.nan
        with pytest.raises(InputError, match=r"no value for left_knee_flexion in frame 0 \(5 such frames\)"):
            write_bvh(tmp_path / "a.bvh", FIGURE, q, seconds(5))
        assert not (tmp_path / "a.bvh").exists()
        write_bvh(tmp_path / "a.bvh", FIGURE, q, seconds(5), unknown="hold")
        q[0, elbow], q[2, elbow], q[:, knee] = q[1, elbow], q[1, elbow], 0.0
        assert np.abs(figure_points(read_bvh(tmp_path / "a.bvh")) - expected_points(FIGURE, q)).max() < EXACT

    @pytest.mark.parametrize(
        ("change", "says"),
        [
            (lambda q, t: (q[:, :28], t), r"q: got shape \(4, 28\)"),
            (lambda q, t: (q[0], t), r"q: got shape \(29,\)"),
            (lambda q, t: (q[:0], t[:0]), r"q: got shape \(0, 29\)"),
            (lambda q, t: (with_value(q, (2, 1), np.nan), t), r"q\[2\].y: got nan"),
            (lambda q, t: (with_value(q, (3, 20), np.inf), t), r"q\[3\].*: got inf"),
            (lambda q, t: (with_value(q, (1, 0), 1e9), t), r"q\[1\]: got a torso 1e\+09 m away"),
            (lambda q, t: (with_value(q, (1, slice(3, 7)), 0.0), t), "quaternion of length 0"),
            (lambda q, t: (q, t[:3]), r"time: got shape \(3,\)"),
            (lambda q, t: (q, t[::-1]), r"time\[1\]"),
            (lambda q, t: (q, t * np.nan), r"time\[0\]: got nan"),
            (lambda q, t: (q, with_value(t, 3, 1.0)), r"time\[[12]\].*evenly spaced"),
        ],
    )
    def test_refuses_what_is_no_motion(
        self, change: Callable, says: str, rng: np.random.Generator, tmp_path: Path
    ) -> None:
        q, time = change(configurations(rng, 4), seconds(4))
        with pytest.raises(InputError, match=says) as caught:
            write_bvh(tmp_path / "a.bvh", FIGURE, q, time)
        assert "\n" not in str(caught.value)
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.parametrize("wrong", [{"up": "y"}, {"unit": "furlong"}])
    def test_refuses_unknown_names(self, wrong: dict, tmp_path: Path) -> None:
        with pytest.raises(InputError, match="expected"):
            write_bvh(tmp_path / "a.bvh", FIGURE, pin.neutral(FIGURE.model)[None], seconds(1), **wrong)

    def test_uneven_times_within_a_tenth_are_taken(self, tmp_path: Path) -> None:
        q = np.tile(pin.neutral(FIGURE.model), (11, 1))
        time = seconds(11, 10.0)
        time[4] += 0.009
        write_bvh(tmp_path / "a.bvh", FIGURE, q, time)
        assert read_bvh(tmp_path / "a.bvh").rate == pytest.approx(10)

    def test_registered(self) -> None:
        assert BVH_FORMAT.suffixes == (".bvh",)
        assert BVH_FORMAT.read is read_bvh
        assert BVH_FORMAT.write_configurations is write_bvh


class TestAngles:
    @given(hnp.arrays(float, (7, 2, 3), elements=st.floats(-10, 10)))
    def test_continuous_keeps_every_rotation_and_steps_least(self, angles: np.ndarray) -> None:
        chosen = continuous(angles)
        assert np.abs(euler_rotation(chosen) - euler_rotation(angles)).max() < 1e-9
        np.testing.assert_array_equal(chosen[0], angles[0])
        step = np.diff(chosen, axis=0)
        assert (np.abs(step) <= np.pi + 1e-9).all()
        other = np.stack(
            [chosen[1:, :, 0] + np.pi, np.pi - chosen[1:, :, 1], chosen[1:, :, 2] + np.pi], axis=-1
        )
        jump = np.mod(other - chosen[:-1] + np.pi, 2 * np.pi) - np.pi
        assert ((step**2).sum(axis=-1) <= (jump**2).sum(axis=-1) + 1e-6).all()

    @given(
        st.floats(-4, 4),
        st.one_of(
            st.floats(-2, 2), st.sampled_from([np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9, 1e-12 - np.pi / 2])
        ),
        st.floats(-4, 4),
    )
    def test_angles_of_a_rotation(self, a: float, b: float, c: float) -> None:
        R = Rotation.from_euler("XZY", [a, b, c]).as_matrix()
        np.testing.assert_allclose(euler_rotation(np.array([a, b, c])), R, rtol=0, atol=1e-14)
        np.testing.assert_allclose(euler_rotation(euler_angles(R)), R, rtol=0, atol=1e-13)

    def test_quaternions(self, rng: np.random.Generator) -> None:

        R = Rotation.random(20, random_state=3).as_matrix()
        np.testing.assert_allclose(
            rotation_from_quaternion(quaternion_from_rotation(R)), R, rtol=0, atol=1e-14
        )


class TestAnyHierarchy:
    """Random trees, channels in any order and number: an independent reader and SciPy's rotations place them alike."""

    @pytest.mark.parametrize("seed", range(12))
    @pytest.mark.parametrize("absolute", [False, True])
    def test_reads_as_the_channels_say(self, seed: int, absolute: bool, tmp_path: Path) -> None:
        rng = np.random.default_rng(seed)
        text = random_file(rng, absolute=absolute)
        path = tmp_path / "a.bvh"
        path.write_text(text)
        document = bvh.Bvh(text)
        motion = read_bvh(path, "m", absolute=absolute)
        for frame in range(len(motion)):
            for name, place in oracle(document, frame, absolute=absolute).items():
                np.testing.assert_allclose(
                    motion.points[frame, motion.names.index(name)], place, rtol=0, atol=1e-12, err_msg=name
                )

    @pytest.mark.parametrize("seed", range(6))
    @pytest.mark.parametrize("absolute", [False, True])
    def test_tells_whether_positions_replace_the_offsets(
        self, seed: int, absolute: bool, tmp_path: Path
    ) -> None:
        (tmp_path / "a.bvh").write_text(
            random_file(np.random.default_rng(seed), absolute=absolute, all_move=True)
        )
        assert examine_bvh(tmp_path / "a.bvh", "m").absolute is absolute

    def test_position_channels_of_a_root_alone(self, tmp_path: Path) -> None:
        """An exporter's offset of the first frame beside absolute places, and notes' zero offset, are one thing."""
        path = tmp_path / "a.bvh"
        path.write_text(SMALL.replace("OFFSET 0 0 0", "OFFSET 3 90 -5", 1))
        assert examine_bvh(path, "cm").absolute
        np.testing.assert_allclose(read_bvh(path, "cm").points[0, 0], [0.01, 0.93, 0.02])
        path.write_text(SMALL.replace("OFFSET 0 0 0", "OFFSET 0 -90 0", 1))
        np.testing.assert_allclose(read_bvh(path, "cm").points[0, 0], [0.01, 0.03, 0.02])

    def test_joints_decide_and_not_the_root(self, tmp_path: Path) -> None:
        """Bandai-Namco's root keeps at the origin, metres from its offset; its joints keep at theirs."""
        moves = "6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
        text = SMALL.replace("OFFSET 0 0 0", "OFFSET 7 800 -452", 1)
        text = text.replace("CHANNELS 3 Zrotation Xrotation Yrotation", f"CHANNELS {moves}")
        text = text.replace("90 0 0 0 0 0 0\n1", "90 10 -40 0 0 0 0 0 50 0 0 0 0\n1")
        text = text.replace("0 0 0 0 90 0 0 0 0\n", "0 0 0 10 -40 0 0 90 0 0 50 0 0 0 0\n")
        (tmp_path / "a.bvh").write_text(text)
        reading = examine_bvh(tmp_path / "a.bvh", "cm")
        assert reading.absolute
        np.testing.assert_allclose(reading.motion.points[1, 1], [0.11, 0.53, 0.02], atol=1e-15)

    def test_frames_in_pieces_are_those_of_one(
        self, rng: np.random.Generator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        q = configurations(rng, 23)
        write_bvh(tmp_path / "a.bvh", FIGURE, q, seconds(23))
        whole = read_bvh(tmp_path / "a.bvh").points
        monkeypatch.setattr("posekit.formats.motion.bvh_kinematics._CHUNK", 1500)
        monkeypatch.setattr("posekit.formats.motion.bvh_file._CHUNK", 700)
        np.testing.assert_array_equal(read_bvh(tmp_path / "a.bvh").points, whole)


class TestWhatIsRead:
    def test_small_file(self, tmp_path: Path) -> None:
        (tmp_path / "a.bvh").write_text(SMALL)
        motion = read_bvh(tmp_path / "a.bvh", "cm")
        assert motion.names == ("Hips", "Left Leg", "Left Leg_end", "Chest", "Chest_end")
        np.testing.assert_allclose(motion.points[0, 1], [0.01, 0.53, -0.08], atol=1e-15)
        np.testing.assert_allclose(motion.points[1, 2], [0.11, 0.53, -0.43], atol=1e-15)
        assert motion.rate == pytest.approx(120.0005, abs=1e-3)

    @pytest.mark.parametrize(
        "change",
        [
            lambda text: text.replace("\n", "\r\n"),
            lambda text: "\ufeff" + text,
            lambda text: text.replace("\n{", " {"),
            lambda text: text.replace("  ", "\t").replace("ROOT", "root").replace("End Site", "End site"),
            lambda text: text.replace("Xposition", "XPOSITION").replace("Frames: 2", "Frames:\t2"),
            lambda text: text.replace("90 0 0 0 0 0 0\n1", "90\n0 0 0 0 0 0\n1"),
            lambda text: text.replace(" 0 0 0\n", " +0.0 0E0 -0e-3\n"),
            lambda text: text + "\n\n  \n",
            lambda text: text.replace("MOTION", "  MOTION "),
            lambda text: text.replace(
                "Zposition Zrotation Xrotation Yrotation", "Zposition\n Zrotation Xrotation Yrotation"
            ),
        ],
    )
    def test_spellings_that_files_have(self, change: Callable[[str], str], tmp_path: Path) -> None:
        (tmp_path / "a.bvh").write_text(SMALL)
        (tmp_path / "b.bvh").write_bytes(change(SMALL).encode())
        one, other = (read_bvh(tmp_path / name, "cm") for name in ("a.bvh", "b.bvh"))
        assert one.names == other.names
        np.testing.assert_array_equal(one.points, other.points)

    def test_several_roots(self, tmp_path: Path) -> None:
        head, _, tail = SMALL.partition("MOTION")
        second = head.partition("\n")[2]
        for name in ("Hips", "Left Leg", "Chest"):
            second = second.replace(name, f"B {name}")
        rows = [line for line in tail.splitlines() if line.startswith("1 ")]
        tail = tail.replace(rows[0], f"{rows[0]} {rows[0]}").replace(rows[1], f"{rows[1]} {rows[1]}")
        (tmp_path / "a.bvh").write_text(f"{head}{second}MOTION{tail}")
        motion = read_bvh(tmp_path / "a.bvh", "cm")
        assert len(motion.names) == 10
        np.testing.assert_array_equal(motion.points[:, :5], motion.points[:, 5:])

    def test_end_sites_of_no_length_are_no_points(self, tmp_path: Path) -> None:
        (tmp_path / "a.bvh").write_text(SMALL.replace("OFFSET 0 -45 0", "OFFSET 0 0 0"))
        assert read_bvh(tmp_path / "a.bvh", "cm").names == ("Hips", "Left Leg", "Chest", "Chest_end")

    @pytest.mark.parametrize(
        ("scale", "name"),
        [(1, "cm"), (10, "mm"), (0.01, "m"), (1 / 2.54, "in"), (0.01 / CMU_UNIT_METRES, "0.45 in")],
    )
    def test_unit_by_size(self, scale: float, name: str, tmp_path: Path) -> None:
        (tmp_path / "a.bvh").write_text(body_file(scale))
        reading = examine_bvh(tmp_path / "a.bvh")
        assert reading.unit.name == name
        reach = np.linalg.norm(reading.motion.points[0, -1] - reading.motion.points[0, 0])
        assert reach == pytest.approx(np.hypot(0.20, 0.89), rel=1e-5)

    def test_a_body_of_no_size_is_refused(self, tmp_path: Path) -> None:
        (tmp_path / "a.bvh").write_text(body_file(1e-5))
        with pytest.raises(InputError, match="state the unit"):
            read_bvh(tmp_path / "a.bvh")
        assert read_bvh(tmp_path / "a.bvh", "m").points.shape == (1, 20, 3)

    def test_a_root_in_the_world_is_no_bone(self, tmp_path: Path) -> None:
        """Bandai-Namco's joint_Root lies metres away from the hips."""
        far = body_file(1.0).replace(
            "ROOT Hips\n{\nOFFSET 0 0 0",
            "ROOT Away\n{\nOFFSET 0 0 0\nCHANNELS 0\nJOINT Hips\n{\nOFFSET 0 0 -4000",
            1,
        )
        (tmp_path / "a.bvh").write_text(far.replace("}\nMOTION", "}\n}\nMOTION"))
        assert examine_bvh(tmp_path / "a.bvh").unit.name == "cm"

    @pytest.mark.parametrize(
        ("up", "turn"),
        [
            ("+y", (0, 0, 0)),
            ("-y", (180, 0, 0)),
            ("+x", (-90, 0, 0)),
            ("-x", (90, 0, 0)),
            ("+z", (0, 90, 0)),
            ("-z", (0, -90, 0)),
        ],
    )
    def test_up_by_the_way_the_body_stands(self, up: str, turn: tuple, tmp_path: Path) -> None:
        (tmp_path / "a.bvh").write_text(body_file(1.0, turn))
        motion = read_bvh(tmp_path / "a.bvh")
        assert motion.up == up
        assert read_bvh(tmp_path / "a.bvh", up="-x").up == "-x"

    def test_y_is_up_where_the_body_leans_or_its_names_are_unknown(self, tmp_path: Path) -> None:
        (tmp_path / "a.bvh").write_text(body_file(1.0, [0, 60, 0]))
        assert read_bvh(tmp_path / "a.bvh").up == "+y"
        (tmp_path / "a.bvh").write_text(body_file(1.0, [0, 90, 0]).replace("Leg", "Bone"))
        assert read_bvh(tmp_path / "a.bvh").up == "+y"

    @pytest.mark.parametrize(
        ("names", "prefix", "expected"),
        [
            (["LowerBack", "Spine", "Spine1", "Neck", "Neck1", "Head"], "", "bvh_cmu"),
            (["Spine", "Spine1", "Spine2", "Neck", "Head"], "mixamorig:", "motionbuilder"),
            (["Spine", "Spine1", "Spine2", "Neck", "Head"], "", "motionbuilder"),
        ],
        ids=["CMU", "Mixamo", "LaFAN1"],
    )
    def test_maps_of_motionbuilders_names(self, names: list, prefix: str, expected: str) -> None:
        parts = ("Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot", "Shoulder")
        names = ["Hips", *names, *(f"{side}{part}" for side in ("Left", "Right") for part in parts)]
        names = [f"{prefix}{name}" for name in names]
        found = layout_of(names)
        assert found.name == expected
        values = np.arange(3.0 * len(names)).reshape(len(names), 3)
        marks = found.gather(values, names)
        np.testing.assert_array_equal(
            marks[LANDMARK_INDEX["left_shoulder"]], values[names.index(f"{prefix}LeftArm")]
        )
        if expected == "bvh_cmu":
            np.testing.assert_array_equal(marks[LANDMARK_INDEX["neck"]], values[names.index("Neck1")])
            np.testing.assert_array_equal(marks[LANDMARK_INDEX["pelvis"]], values[names.index("LowerBack")])

    @pytest.mark.parametrize("name", ["bvh_bandai_namco", "bvh_100style", "bvh_biovision", "bvh_posekit"])
    def test_other_maps_know_their_own_names(self, name: str) -> None:
        own = load_skeleton_map(name)
        assert layout_of(own.needed).name == name
        assert set(JOINTS) <= set(own.landmarks)

    def test_our_own_files_have_all_points(self, rng: np.random.Generator, tmp_path: Path) -> None:
        q = configurations(rng, 3)
        write_bvh(tmp_path / "a.bvh", FIGURE, q, seconds(3))
        motion = read_bvh(tmp_path / "a.bvh")
        found = postures_of(motion)
        assert found.layout.name == "bvh_posekit"
        assert found.derived == ()
        points = np.concatenate([found.joints, found.head], axis=1)
        assert np.abs(points - expected_points(FIGURE, q)).max() < EXACT


def test_a_file_of_posekit_is_y_up_however_the_body_lies(tmp_path: Path) -> None:
    q = np.zeros((12, FIGURE.model.nq))
    q[:, 4] = q[:, 6] = np.sqrt(0.5)  # a quarter turn about y: the body lies along x
    write_bvh(tmp_path / "lies.bvh", FIGURE, q, np.arange(12) / 30, up="+z")
    assert read_bvh(tmp_path / "lies.bvh").up == "+y"


def with_value(array: np.ndarray, at: Any, value: float) -> np.ndarray:
    changed = np.array(array)
    changed[at] = value
    return changed


def channel_table(path: Path) -> np.ndarray:
    """Return the turning channels of a file, degrees, as the `bvh` package reads it."""
    return np.array(bvh.Bvh(path.read_text()).frames, dtype=float)[:, 3:]


def oracle(document: bvh.Bvh, frame: int, *, absolute: bool = False) -> dict[str, np.ndarray]:
    """Place a frame's joints by SciPy's rotations, from what the `bvh` package parsed; the file's unit."""
    placed: dict[str, np.ndarray] = {}
    turned: dict[str, Rotation] = {}
    for joint in document.get_joints():
        name = joint.value[1]
        place = np.array(document.joint_offset(name))
        turn = Rotation.identity()
        for channel in joint["CHANNELS"][1:]:
            value = document.frame_joint_channel(frame, name, channel)
            axis = "XYZ".index(channel[0])
            if channel.endswith("rotation"):
                turn = turn * Rotation.from_euler(channel[0].lower(), value, degrees=True)
            else:
                place[axis] = value if absolute else place[axis] + value
        parent = document.joint_parent(name)
        if parent is not None:
            before = turned[parent.value[1]]
            place, turn = placed[parent.value[1]] + before.apply(place), before * turn
        placed[name], turned[name] = place, turn
    return placed


def random_file(rng: np.random.Generator, *, absolute: bool, all_move: bool = False, frames: int = 3) -> str:
    """Spell a random tree with channels of any number and order."""
    count = int(rng.integers(3, 9))
    parents = [-1] + [int(rng.integers(0, k)) for k in range(1, count)]
    names = [*(f"{axis}position" for axis in "XYZ"), *(f"{axis}rotation" for axis in "XYZ")]
    columns: list[np.ndarray] = []

    def spell(k: int) -> str:
        offset = rng.uniform(0.2, 1.0, size=3) * rng.choice([-1, 1], size=3)
        chosen = list(rng.permutation(names if all_move else names[: rng.integers(1, 7)] + names[3:]))
        chosen = list(dict.fromkeys(chosen))
        for channel in chosen:
            if channel.endswith("rotation"):
                columns.append(rng.uniform(-400, 400, size=frames))
            else:
                middle = offset["XYZ".index(channel[0])] if absolute else 0.0
                columns.append(middle + rng.normal(size=frames) * 0.01)
        text = f"{'JOINT' if k else 'ROOT'} joint{k}\n{{\nOFFSET {' '.join(map(repr, offset.tolist()))}\n"
        text += f"CHANNELS {len(chosen)} {' '.join(chosen)}\n"
        children = [child for child in range(count) if parents[child] == k]
        text += "".join(map(spell, children)) or "End Site\n{\nOFFSET 0 0.1 0\n}\n"
        return f"{text}}}\n"

    text = f"HIERARCHY\n{spell(0)}MOTION\nFrames: {frames}\nFrame Time: 0.05\n"
    return text + "".join(" ".join(map(repr, row)) + "\n" for row in np.stack(columns, axis=-1).tolist())


def body_file(scale: float, turn: Sequence[float] = (0.0, 0.0, 0.0)) -> str:
    """Spell a standing body of 1.7 m in one frame, centimetres times a scale, turned as a whole (Z, X, Y)."""

    def joint(name: str, offset: tuple, *children: str) -> str:
        numbers = " ".join(repr(scale * value) for value in offset)
        turns = "Zrotation Xrotation Yrotation"
        kind, channels = (
            ("JOINT", f"3 {turns}")
            if name != "Hips"
            else ("ROOT", f"6 Xposition Yposition Zposition {turns}")
        )
        inside = "".join(children) or "End Site\n{\nOFFSET 0 0 0\n}\n"
        return f"{kind} {name}\n{{\nOFFSET {numbers if any(offset) else '0 0 0'}\nCHANNELS {channels}\n{inside}}}\n"

    def limbs(upper: str, parts: tuple, offsets: tuple) -> list[str]:
        found = []
        for side, sign in (("Left", 1), ("Right", -1)):
            text = ""
            for part, (x, y, z) in reversed(list(zip(parts, offsets, strict=True))):
                text = joint(f"{side}{part}", (sign * x, y, z), *([text] if text else []))
            found.append(text)
        return found

    arms = limbs(
        "Spine2", ("Shoulder", "Arm", "ForeArm", "Hand"), ((3, 18, 0), (14, 2, 0), (0, -29, 0), (0, -25, 0))
    )
    legs = limbs("Hips", ("UpLeg", "Leg", "Foot"), ((10, -5, 0), (5, -42, 0), (5, -42, 0)))
    head = joint("Neck", (0, 24, 0), joint("Head", (0, 10, 2)))
    trunk = joint("Spine", (0, 8, 0), joint("Spine1", (0, 12, 0), joint("Spine2", (0, 10, 0), head, *arms)))
    text = "HIERARCHY\n" + joint("Hips", (0, 0, 0), trunk, *legs)
    frame = [
        scale * 10,
        scale * 92,
        scale * -7,
        *map(float, turn),
        *itertools.repeat(0.0, 3 * (text.count("CHANNELS") - 1)),
    ]
    return f"{text}MOTION\nFrames: 1\nFrame Time: 0.01\n{' '.join(map(repr, frame))}\n"
