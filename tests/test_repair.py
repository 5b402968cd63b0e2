"""Repair: faults are planted into files and arrays; what comes back passes a fresh validation and keeps the rest."""

from __future__ import annotations

import pickle
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import posekit
from posekit.motion.repair import repair
from posekit.skeleton import HEAD_POINTS, JOINT, JOINTS, other_side
from posekit.validators import Validator

FRAMES, RATE = 90, 30.0
SPAN = slice(30, 50)


def waving() -> posekit.Motion:
    """A person who stands, waves the right arm and steps from foot to foot."""
    figure = posekit.load_figure()
    t = np.arange(FRAMES) / RATE
    q = np.tile(figure.neutral, (FRAMES, 1))
    names = list(figure.configuration_names)
    for name, middle, size in (
        ("right_shoulder_flexion", 0.6, 0.5),
        ("left_shoulder_flexion", 0.2, -0.2),
        ("right_elbow_flexion", 0.9, 0.4),
        ("left_elbow_flexion", 0.5, 0.1),
        ("right_knee_flexion", 0.3, 0.0),
        ("left_knee_flexion", 0.3, 0.0),
    ):
        q[:, names.index(name)] = middle + size * np.sin(4.0 * t)
    q[:, :3] = [0.3, 0.2, 1.4]
    points = figure.points(q)
    return posekit.Motion(joints=points, joint_names=JOINTS, time=t, up="+z")


@pytest.fixture(scope="module")
def clean() -> posekit.Motion:
    motion = waving()
    assert Validator().check(motion).ok.all()
    return motion


@pytest.fixture(scope="module")
def clean_bvh(clean: posekit.Motion, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bvh") / "clean.bvh"
    posekit.save(clean, path)
    assert posekit.validate(path).ok.all()
    return path


def bent(joints: np.ndarray, side: str, middle: str, degrees: float) -> np.ndarray:
    """Turn a lower segment in its own plane to an angle from the upper one, in the frames of the span."""
    parts = ("shoulder", "elbow", "wrist") if middle == "elbow" else ("hip", "knee", "ankle")
    a, b, c = (JOINT[f"{side}_{part}"] for part in parts)
    out = joints.copy()
    upper, lower = joints[SPAN, b] - joints[SPAN, a], joints[SPAN, c] - joints[SPAN, b]
    along = upper / np.linalg.norm(upper, axis=1, keepdims=True)
    across = lower - (lower * along).sum(axis=1, keepdims=True) * along
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    length = np.linalg.norm(lower, axis=1, keepdims=True)
    angle = np.radians(degrees)
    out[SPAN, c] = joints[SPAN, b] + length * (np.cos(angle) * along + np.sin(angle) * across)
    return out


def jumped(joints: np.ndarray) -> np.ndarray:
    out = joints.copy()
    out[40] += [0.3, 0.0, 0.0]
    return out


def frozen(joints: np.ndarray) -> np.ndarray:
    out = joints.copy()
    out[SPAN] = out[SPAN.start - 1]
    return out


def trembling(joints: np.ndarray) -> np.ndarray:
    out = joints.copy()
    out[SPAN] += np.random.default_rng(3).normal(0.0, 0.015, out[SPAN].shape)
    return out


def lengthened(joints: np.ndarray) -> np.ndarray:
    out = joints.copy()
    a, b = JOINT["left_elbow"], JOINT["left_wrist"]
    out[SPAN, b] += 0.12 * (out[SPAN, b] - out[SPAN, a])
    return out


def exchanged(joints: np.ndarray) -> np.ndarray:
    out = joints.copy()
    out[SPAN] = joints[SPAN][:, [JOINT[other_side(name)] for name in JOINTS]]
    return out


def lifted(joints: np.ndarray) -> np.ndarray:
    out = joints.copy()
    out[SPAN] += [0.0, 0.0, 0.06]
    return out


FAULTS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "elbow folded": lambda joints: bent(joints, "right", "elbow", 168.0),
    "elbow backward": lambda joints: bent(joints, "right", "elbow", -20.0),
    "knee folded": lambda joints: bent(joints, "left", "knee", 172.0),
    "jump": jumped,
    "frozen": frozen,
    "trembling": trembling,
    "lengthened": lengthened,
    "exchanged": exchanged,
    "lifted": lifted,
}


@pytest.mark.parametrize("fault", FAULTS)
def test_planted_faults_of_joints_come_back_valid(clean: posekit.Motion, fault: str) -> None:
    broken = replace(clean, joints=FAULTS[fault](np.asarray(clean.joints)))
    assert not Validator().check(broken).ok.all()
    done = repair(broken)
    assert done.motion is not None
    assert done.motion.joint_names == clean.joint_names
    assert Validator().check(done.motion).ok.all(), done.notes
    rounded = replace(done.motion, joints=np.round(np.asarray(done.motion.joints), 8))
    assert Validator().check(rounded).ok.all()  # as a file rounds it
    before, after = np.asarray(broken.joints), np.asarray(done.motion.joints)
    outside = np.r_[0:15, 65:FRAMES]
    np.testing.assert_array_equal(after[outside], before[outside])


def test_a_valid_motion_stays_as_it_is(clean: posekit.Motion) -> None:
    done = repair(clean)
    assert done.motion is not None
    np.testing.assert_array_equal(done.motion.joints, clean.joints)
    assert done.notes == (f"0 of {FRAMES} frames changed",)


def test_mirrored_joints_are_exchanged_and_nothing_more(clean: posekit.Motion) -> None:
    mirror = [JOINT[other_side(name)] for name in JOINTS]
    done = repair(replace(clean, joints=np.asarray(clean.joints)[:, mirror]))
    assert done.motion is not None
    np.testing.assert_array_equal(done.motion.joints, clean.joints)
    assert "right and left exchanged in all frames" in done.notes


def test_frames_in_another_order_are_put_back_by_their_times(clean: posekit.Motion) -> None:
    order = np.arange(FRAMES)
    order[SPAN] = np.random.default_rng(0).permutation(order[SPAN])
    shuffled = replace(clean, joints=np.asarray(clean.joints)[order], time=np.asarray(clean.time)[order])
    done = repair(shuffled)
    assert done.motion is not None
    np.testing.assert_array_equal(done.motion.joints, clean.joints)


def test_missing_frames_are_inserted_and_counted(clean: posekit.Motion) -> None:
    kept = np.delete(np.arange(FRAMES), slice(40, 44))
    done = repair(replace(clean.take(kept), frame=None))
    assert done.motion is not None
    assert "4 missing frames inserted" in done.notes
    np.testing.assert_allclose(np.asarray(done.motion.time), np.asarray(clean.time), atol=1e-9)
    assert done.report.ok.all()


@pytest.mark.parametrize("start", [20, 50])
@pytest.mark.parametrize("way", [(0.0, 0.3), (-0.25, 0.1)])
def test_standing_feet_that_slide_are_held(
    clean: posekit.Motion, start: int, way: tuple[float, float]
) -> None:
    """The frames before or after the slide stay, whichever are more."""
    slid = np.clip((np.arange(FRAMES) - start) / 20, 0, 1)[:, None, None] * [*way, 0.0]
    joints = np.asarray(clean.joints)
    broken = replace(clean, joints=joints + slid)
    assert set(Validator().check(broken).table()["check"]) == {"sliding"}
    done = repair(broken)
    assert done.motion is not None and done.report.ok.all()
    assert done.notes[1] == "standing feet held"
    stay = joints + (slid[-1] if start < FRAMES // 2 - 10 else 0.0)
    np.testing.assert_allclose(done.motion.joints, stay, atol=0.03)
    kept = slice(start + 20, None) if start < FRAMES // 2 - 10 else slice(0, start + 1)
    np.testing.assert_array_equal(np.asarray(done.motion.joints)[kept], np.asarray(broken.joints)[kept])


@pytest.mark.parametrize("start", [10, 60])
def test_a_standing_robot_that_slides_comes_back(start: int) -> None:
    robot = posekit.load_robot("g1")
    names, t = list(robot.configuration_names), np.arange(FRAMES)
    q = np.tile(robot.neutral, (FRAMES, 1))
    q[:, 2] = 0.8
    q[:, names.index("right_elbow_joint")] += 0.3 * np.sin(t / 8)
    q[:, names.index("left_shoulder_pitch_joint")] += 0.3 * np.sin(t / 7)
    slid = np.clip((t - start) / 20, 0, 1)[:, None] * [0.25, -0.1, 0.0]
    broken = posekit.Motion(q=q, q_names=names, robot="g1", time=t / RATE, up="+z")
    broken = replace(broken, q=np.c_[q[:, :3] + slid, q[:, 3:]])
    settings = posekit.ValidateSettings(bodies="none")
    assert set(posekit.validate(broken, settings).table()["check"]) == {"sliding"}
    done = repair(broken, settings=settings)
    assert done.motion is not None and done.report.ok.all() and "standing feet held" in done.notes
    stay = slid[-1] if start < FRAMES // 2 else 0.0
    np.testing.assert_allclose(np.asarray(done.motion.q)[:, :3], q[:, :3] + stay, atol=0.02)
    np.testing.assert_array_equal(np.asarray(done.motion.q)[:, 3:], q[:, 3:])


def test_several_recordings_are_repaired_each_by_itself(clean: posekit.Motion) -> None:
    joints = np.asarray(clean.joints)
    broken = {name: FAULTS[name](joints) for name in ("jump", "lengthened")}
    both = posekit.Motion(
        joints=np.concatenate(list(broken.values())),
        joint_names=JOINTS,
        time=np.tile(np.asarray(clean.time), 2),
        clip=np.repeat([0, 1], FRAMES),
        clips=tuple(broken),
        up="+z",
    )
    done = repair(both)
    assert done.motion is not None and done.report.ok.all()
    assert done.motion.clips == tuple(broken) and done.motion.clip.tolist() == [0] * FRAMES + [1] * FRAMES
    for number, one in enumerate(broken.values()):
        alone = repair(replace(clean, joints=one)).motion
        assert alone is not None
        np.testing.assert_array_equal(
            np.asarray(done.motion.joints)[done.motion.clip == number], alone.joints
        )


def test_single_postures_are_repaired_by_themselves() -> None:
    standing = posekit.load_figure().neutral_points[:14].copy()
    standing[[10, 12]] += [[0.35, 0, 0.1], [0.2, 0, 0.5]]
    done = repair(standing)
    assert not done.before.ok.any()
    assert done.report.ok.all()
    assert done.motion is not None
    unmoved = [JOINT[name] for name in JOINTS if not name.startswith("right") or "shoulder" in name]
    np.testing.assert_allclose(np.asarray(done.motion.joints)[0, unmoved], standing[unmoved], atol=1e-9)


def motion_lines(path: Path) -> list[str]:
    return path.read_text().split("MOTION")[1].splitlines()[3:]


def hierarchy(path: Path) -> str:
    return path.read_text().split("MOTION")[0]


@pytest.mark.parametrize("fault", ["elbow", "jump", "frozen"])
def test_a_bvh_file_keeps_every_line_that_needs_no_change(
    clean_bvh: Path, tmp_path: Path, fault: str
) -> None:
    lines = [line.split() for line in motion_lines(clean_bvh)]
    frames = range(40, 41) if fault == "jump" else range(SPAN.start, SPAN.stop)
    channels = re.findall(r"JOINT (\w+)|ROOT (\w+)", hierarchy(clean_bvh))
    names = [a or b for a, b in channels]
    elbow = 3 + 3 * names.index("RightForeArm")
    for frame in frames:
        if fault == "elbow":
            lines[frame][elbow] = "-168.0"
        elif fault == "jump":
            lines[frame][0] = str(float(lines[frame][0]) + 40.0)
        else:
            lines[frame] = lines[SPAN.start - 1]
    head = clean_bvh.read_text().split("MOTION")[1].splitlines()[:3]
    broken, target = tmp_path / "broken.bvh", tmp_path / "repaired.bvh"
    broken.write_text(hierarchy(clean_bvh) + "MOTION" + "\n".join([*head, *map(" ".join, lines)]) + "\n")
    assert not posekit.validate(broken).ok.all()
    done = repair(broken, target)
    assert posekit.validate(target).ok.all(), done.notes
    assert hierarchy(target) == hierarchy(broken)
    changed = [
        k for k, (a, b) in enumerate(zip(motion_lines(broken), motion_lines(target), strict=True)) if a != b
    ]
    assert set(changed) <= set(frames)
    if fault == "elbow":  # and of those lines only the arm
        for frame in changed:
            old, new = motion_lines(broken)[frame].split(), motion_lines(target)[frame].split()
            moved = {names[(k - 3) // 3] for k, (a, b) in enumerate(zip(old, new, strict=True)) if a != b}
            assert moved <= {"RightArm", "RightForeArm"}
    if fault == "frozen":
        assert f"{len(frames)} frames interpolated" in done.notes


def test_a_lifted_span_is_put_back_and_all_other_lines_stay(clean_bvh: Path, tmp_path: Path) -> None:
    lines = [line.split() for line in motion_lines(clean_bvh)]
    for frame in range(SPAN.start, SPAN.stop):
        lines[frame][1] = f"{float(lines[frame][1]) + 10:.6f}"
    broken, target = tmp_path / "broken.bvh", tmp_path / "repaired.bvh"
    head = clean_bvh.read_text().split("MOTION")[1].splitlines()[:3]
    broken.write_text(hierarchy(clean_bvh) + "MOTION" + "\n".join([*head, *map(" ".join, lines)]) + "\n")
    done = posekit.repair(broken, target)
    assert posekit.validate(target).ok.all(), done.notes
    pairs = zip(motion_lines(broken), motion_lines(target), strict=True)
    assert {k for k, (a, b) in enumerate(pairs) if a != b} == set(range(SPAN.start, SPAN.stop))


def saved(motion: posekit.Motion, path: Path) -> None:
    """Save a motion; arrays and pickles, which posekit only reads, as people write them."""
    if path.suffix == ".npy":
        np.save(path, np.asarray(motion.joints, dtype=np.float32))
    elif path.suffix == ".pkl":
        held = {"joints": np.asarray(motion.joints), "joint_names": list(JOINTS), "fps": RATE, "up": "z"}
        path.write_bytes(pickle.dumps(held))
    else:
        posekit.save(motion, path)


@pytest.mark.parametrize(
    "ending", ["json", "npz", "npy", "pkl", "csv", "tsv", "trc", "bvh", "c3d", "parquet"]
)
@pytest.mark.parametrize("fault", ["jump", "lifted"])
def test_a_repaired_file_passes_from_its_file_and_a_second_repair_copies_it(
    clean: posekit.Motion, tmp_path: Path, ending: str, fault: str
) -> None:
    paths = [tmp_path / f"{name}.{ending}" for name in ("clean", "broken", "copied", "repaired", "again")]
    given, broken, copied, repaired, again = paths
    facts = {"rate": RATE, "up": "+z"} if ending == "npy" else {}
    saved(clean, given)
    saved(replace(clean, joints=FAULTS[fault](np.asarray(clean.joints))), broken)
    assert posekit.validate(given, **facts).ok.all()
    assert not posekit.validate(broken, **facts).ok.all()
    repair(given, copied, **facts)
    assert copied.read_bytes() == given.read_bytes()
    done = repair(broken, repaired, **facts)
    assert posekit.validate(repaired, **facts).ok.all(), done.notes
    assert not any("left: " in note for note in done.notes)
    repair(repaired, again, **facts)
    assert again.read_bytes() == repaired.read_bytes()


def test_a_first_frame_at_rest_becomes_part_of_the_motion(clean: posekit.Motion) -> None:
    joints = np.asarray(clean.joints).copy()
    rest = np.asarray(posekit.load_figure().neutral_points[:14])
    joints[0] = rest @ np.diag([-1.0, -1.0, 1.0]) + [0.3, 0.2, 1.4 - rest[0, 2]]  # faces the other way
    broken = replace(clean, joints=joints)
    assert not Validator().check(broken).ok[0]
    done = repair(broken)
    assert done.report.ok.all(), done.notes
    assert "1 frame continued to an end of the clip" in done.notes
    assert done.motion is not None
    np.testing.assert_array_equal(np.asarray(done.motion.joints)[1:], joints[1:])


@pytest.mark.parametrize("ending", ["trc", "csv", "npz"])
def test_points_that_are_no_joints_keep_their_columns(
    clean: posekit.Motion, tmp_path: Path, ending: str
) -> None:
    """In a file in millimetres with a sword only the joints move, and only where they jumped."""
    path, target = tmp_path / f"given.{ending}", tmp_path / f"repaired.{ending}"
    names = [*JOINTS, "sword"]
    joints = jumped(np.asarray(clean.joints))
    points = 1000 * np.concatenate([joints, np.full((FRAMES, 1, 3), 0.125)], axis=1)
    if ending == "npz":
        np.savez(path, joints=points, joint_names=np.array(names), fps=RATE, unit="mm", up="z", mine=[1, 2])
    elif ending == "trc":
        head = [
            "PathFileType\t4\t(X/Y/Z)\tgiven.trc",
            "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits",
            f"{RATE}\t{RATE}\t{FRAMES}\t{len(names)}\tmm",
            "Frame#\tTime\t" + "\t\t\t".join(names),
            "\t\t" + "\t".join(f"{axis}{k + 1}" for k in range(len(names)) for axis in "XYZ"),
        ]
        rows = [
            "\t".join([str(k + 1), f"{k / RATE:.6f}", *(f"{v:.4f}" for v in row.ravel())])
            for k, row in enumerate(points)
        ]
        path.write_text("\r\n".join([*head, "", *rows]) + "\r\n", newline="")
    else:
        head = ["time", *(f"{name}_{axis}" for name in names for axis in "xyz"), "remark"]
        rows = [
            ",".join([f"{k / RATE:.6f}", *(f"{v:.4f}" for v in row.ravel()), "so"])
            for k, row in enumerate(points)
        ]
        path.write_text("\n".join([",".join(head), *rows]) + "\n")
    facts = {"unit": "mm", "up": "+z"}
    assert not posekit.validate(path, **facts).ok.all()
    done = repair(path, target, **facts)
    assert posekit.validate(target, **facts).ok.all(), done.notes
    if ending == "npz":
        old, new = np.load(path), np.load(target)
        assert new.files == old.files
        np.testing.assert_array_equal(new["mine"], old["mine"])
        changed = np.argwhere((new["joints"] != old["joints"]).any(axis=2))
        assert set(changed[:, 0].tolist()) == {40}
        assert len(names) - 1 not in changed[:, 1]
    else:
        pairs = list(zip(path.read_bytes().splitlines(), target.read_bytes().splitlines(), strict=True))
        [(before, after)] = [pair for pair in pairs if pair[0] != pair[1]]
        assert b"125.0000" in after
        assert len(after.split(b".")) == len(before.split(b"."))


@pytest.mark.parametrize("gap", ["", "NaN", "-"])
def test_gaps_of_a_table_are_filled_in_place(clean: posekit.Motion, tmp_path: Path, gap: str) -> None:
    path, target = tmp_path / "given.csv", tmp_path / "repaired.csv"
    head = ["time", *(f"{name}_{axis}" for name in JOINTS for axis in "xyz")]
    joints = np.asarray(clean.joints).reshape(FRAMES, -1)
    cells = [[f"{k / RATE:.6f}", *(f"{v:.6f}" for v in row)] for k, row in enumerate(joints)]
    column = head.index("right_wrist_x")
    for row in cells[40:43]:
        row[column : column + 3] = [gap] * 3
    path.write_text("\n".join([",".join(head), *map(",".join, cells)]) + "\n")
    assert posekit.validate(path, up="+z").ok.sum() == FRAMES - 3
    done = repair(path, target, up="+z")
    assert posekit.validate(target, up="+z").ok.all(), done.notes
    assert done.notes[:2] == ("3 of 90 frames changed", "3 frames interpolated")
    old, new = path.read_text().splitlines(), target.read_text().splitlines()
    assert [k for k, (a, b) in enumerate(zip(old, new, strict=True)) if a != b] == [41, 42, 43]
    for k in (41, 42, 43):
        row = new[k].split(",")
        assert (
            row[:column] + row[column + 3 :] == old[k].split(",")[:column] + old[k].split(",")[column + 3 :]
        )
        given = joints[k - 1, 3 * JOINT["right_wrist"] :][:3]
        np.testing.assert_allclose([float(one) for one in row[column : column + 3]], given, atol=0.01)


def test_a_robots_pickle_keeps_its_keys_and_says_what_does_not_follow(tmp_path: Path) -> None:
    robot = posekit.load_figure()
    count = len(robot.configuration_names) - 7
    angles = np.zeros((FRAMES, count), dtype=np.float32)
    names = list(robot.configuration_names)[7:]
    t = np.arange(FRAMES) / RATE
    angles[:, names.index("right_elbow_flexion")] = 0.7 + 0.3 * np.sin(3 * t)
    angles[:, names.index("left_knee_flexion")] = 0.35
    angles[SPAN, names.index("right_elbow_flexion")] = 3.05
    held = {
        "fps": RATE,
        "root_pos": np.tile(np.float32([0, 0, 1.3]), (FRAMES, 1)),
        "root_rot": np.tile(np.float32([0, 0, 0, 1]), (FRAMES, 1)),
        "dof_pos": angles,
        "local_body_pos": np.random.default_rng(0).normal(size=(FRAMES, 5, 3)).astype(np.float32),
        "link_body_list": ["a", "b", "c", "d", "e"],
    }
    path, target = tmp_path / "walk.pkl", tmp_path / "repaired.pkl"
    path.write_bytes(pickle.dumps(held))
    assert not posekit.validate(path, urdf=robot).ok.all()
    done = repair(path, target, urdf=robot)
    assert posekit.validate(target, urdf=robot).ok.all(), done.notes
    found = pickle.loads(target.read_bytes())
    assert list(found) == list(held)
    for name in ("root_pos", "root_rot", "local_body_pos"):
        np.testing.assert_array_equal(found[name], held[name])
    assert found["dof_pos"].dtype == np.float32
    assert any("local_body_pos" in note for note in done.notes)


def test_a_mirrored_bvh_file_gets_its_names_exchanged(clean_bvh: Path, tmp_path: Path) -> None:
    swapped = re.sub(
        r"(?<=JOINT )(Right|Left)(\w+)",
        lambda match: {"Right": "Left", "Left": "Right"}[match[1]] + match[2],
        hierarchy(clean_bvh),
    )
    broken, target = tmp_path / "mirrored.bvh", tmp_path / "repaired.bvh"
    broken.write_text(swapped + "MOTION" + clean_bvh.read_text().split("MOTION")[1])
    assert not posekit.validate(broken).ok.all()
    repair(broken, target)
    assert posekit.validate(target).ok.all()
    assert motion_lines(target) == motion_lines(broken)


ARM = """<robot name="arm"><link name="base"/>{links}{joints}</robot>"""


def two_links(tmp_path: Path) -> Path:
    """Write a chain of capsules: its last link can reach the first."""
    body = (
        '<link name="{0}"><collision><origin xyz="0 0 0.15"/><geometry><cylinder radius="0.03" length="0.24"/>'
        "</geometry></collision></link>"
    )
    links = "".join(body.format(name) for name in ("one", "two", "three"))
    chain = (("a", "base", "one", 0.0), ("b", "one", "two", 0.3), ("c", "two", "three", 0.3))
    joints = "".join(
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0 0 {z}"/><axis xyz="0 1 0"/><limit lower="-2.9" upper="2.9" effort="1" velocity="9"/></joint>'
        for name, parent, child, z in chain
    )
    path = tmp_path / "arm.urdf"
    path.write_text(ARM.format(links=links, joints=joints))
    return path


def test_configurations_come_back_inside_limits_and_apart(tmp_path: Path) -> None:
    robot = posekit.load_robot(two_links(tmp_path), fixed_base=True)
    q = np.array([[0.2, 0.5, -0.5], [3.1, 0.0, 0.0], [0.0, 2.6, 2.4]])
    judge = Validator(robot)
    assert judge.check(q).ok.tolist() == [True, False, False]
    done = repair(q, urdf=robot)
    assert done.report.ok.all()
    assert done.motion is not None
    after = np.asarray(done.motion.q)
    np.testing.assert_array_equal(after[0], q[0])
    assert 2.9 - 1e-5 < after[1, 0] < 2.9
    np.testing.assert_allclose(after[1, 1:], 0.0, atol=1e-6)
    assert not robot.collisions(after).hit.any()
    assert np.linalg.norm(after[2] - q[2]) < 0.8


def test_a_table_of_an_arm_is_judged_and_repaired_like_its_configurations(tmp_path: Path) -> None:
    urdf, path, target = two_links(tmp_path), tmp_path / "arm.csv", tmp_path / "repaired.csv"
    robot = posekit.load_robot(urdf, fixed_base=True)
    q = np.column_stack([0.5 * np.sin(np.arange(FRAMES) / RATE), np.full(FRAMES, 0.3), np.full(FRAMES, -0.2)])
    q[SPAN, 0] = 3.0
    rows = [f"{k / RATE:.6f},{a:.6f},{b:.6f},{c:.6f}" for k, (a, b, c) in enumerate(q)]
    path.write_text("\n".join(["time,a,b,c", *rows]) + "\n")
    by_array, by_file = (posekit.validate(one, urdf=robot, rate=RATE) for one in (q, path))
    assert by_array.invalid[SPAN].all()
    np.testing.assert_array_equal(by_file.invalid, by_array.invalid)
    assert "teleport" in by_file.not_asked
    done = repair(path, target, urdf=robot, rate=RATE)
    assert posekit.validate(target, urdf=robot, rate=RATE).ok.all(), done.notes


def test_a_robots_table_keeps_its_columns_and_its_other_rows(tmp_path: Path) -> None:
    """Degrees, centimetres and Euler angles of the table stay what they are."""
    robot = posekit.load_figure()
    names = [
        name for name in robot.configuration_names if name not in ("x", "y", "z", "qx", "qy", "qz", "qw")
    ]
    t = np.arange(FRAMES) / RATE
    angles = np.zeros((FRAMES, len(names)))
    elbow, knee = names.index("right_elbow_flexion"), names.index("left_knee_flexion")
    angles[:, elbow] = 40 + 20 * np.sin(3 * t)
    angles[:, knee] = 20.0
    angles[SPAN, elbow] = 175.0
    head = ["Frame", *(f"root_translate{axis}" for axis in "XYZ"), *(f"root_rotate{axis}" for axis in "XYZ")]
    head += [f"{name}_dof" for name in names]
    root = np.tile([0.0, 0.0, 130.0, 0.0, 0.0, 25.0], (FRAMES, 1))
    table = np.column_stack([np.arange(FRAMES), root, angles])
    path, target = tmp_path / "walk.csv", tmp_path / "repaired.csv"
    path.write_text("\n".join([",".join(head), *(",".join(f"{v:.6f}" for v in row) for row in table)]) + "\n")
    broken = posekit.validate(path, urdf=robot, rate=RATE)
    assert set(np.flatnonzero(broken.invalid)) >= set(range(SPAN.start, SPAN.stop))
    done = repair(path, target, urdf=robot, rate=RATE)
    assert posekit.validate(target, urdf=robot, rate=RATE).ok.all(), done.notes
    old, new = path.read_text().splitlines(), target.read_text().splitlines()
    assert new[0] == old[0]
    changed = {k for k, (a, b) in enumerate(zip(old, new, strict=True)) if a != b}
    assert changed
    assert changed <= set(range(SPAN.start - 10, SPAN.stop + 12))
    row = [float(cell) for cell in new[40].split(",")]
    np.testing.assert_allclose(row[1:7], root[0], atol=1e-6)
    assert 100.0 < row[7 + elbow] < 175.0


def test_a_robot_below_the_ground_is_lifted(tmp_path: Path) -> None:
    figure = posekit.load_figure()
    motion = waving()
    q = np.array(
        figure.configurations(np.asarray(motion.joints), np.full((FRAMES, len(HEAD_POINTS), 3), np.nan)).q
    )
    q = np.nan_to_num(q)
    low = float(np.asarray(motion.joints)[:, [12, 13], 2].min())
    q[:, 2] -= low + 0.2
    given = posekit.Motion(q=q, robot="figure", time=motion.time, up="+z")
    done = repair(given, ground=0.0, checks="penetration")
    assert not done.before.ok.all()
    assert done.report.ok.all()
    assert done.motion is not None
    np.testing.assert_array_equal(np.asarray(done.motion.q)[:, 3:], q[:, 3:])


def test_a_folder_comes_back_with_the_same_names(
    clean: posekit.Motion, clean_bvh: Path, tmp_path: Path
) -> None:
    folder, target = tmp_path / "in", tmp_path / "out"
    (folder / "sub").mkdir(parents=True)
    (folder / "good.bvh").write_bytes(clean_bvh.read_bytes())
    posekit.save(replace(clean, joints=jumped(np.asarray(clean.joints))), folder / "sub" / "bad.npz")
    (folder / "broken.bvh").write_text("HIERARCHY\n")
    done = repair(folder, target)
    assert (target / "good.bvh").read_bytes() == clean_bvh.read_bytes()
    assert posekit.validate(target / "sub" / "bad.npz").ok.all()
    assert not (target / "broken.bvh").exists()
    assert done.notes[0] == "2 of 2 files valid: 1 unchanged, 1 repaired"
    assert any("broken.bvh" in note for note in done.notes)
    assert any(Path("sub/bad.npz").as_posix() in note for note in done.notes)
    assert not any("good.bvh" in note for note in done.notes)
    with pytest.raises(posekit.InputError, match="new or empty folder"):
        repair(folder, target)


def test_a_target_that_cannot_hold_the_motion_is_refused(clean: posekit.Motion, tmp_path: Path) -> None:
    with pytest.raises(posekit.InputError, match="expected"):
        repair(clean, tmp_path / "motion.xyz")
