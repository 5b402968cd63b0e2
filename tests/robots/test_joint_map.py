"""Joint maps: the built-in ones lie as bodies do on the real models, and files are refused clearly."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.robots import load_robot
from posekit.robots.joint_map import (
    BUILT_IN,
    find_joint_map,
    joint_map_of,
    load_joint_map,
    postures_of,
    targets_of,
)
from posekit.robots.scaling import model_lengths
from posekit.skeleton import JOINTS, POINTS, SIDES
from posekit.tables.file_model import validated
from posekit.tables.joint_map import JointMapTable

SUBJECT: dict[
    str, tuple[str, str, tuple[float, float, float], str]
] = {  # lengths as of a person; only the names are those of human-gazebo
    "jL5S1": ("Pelvis", "L5", (0, 0, 0.1), "xy"),
    "jL4L3": ("L5", "L3", (0, 0, 0.1), "xy"),
    "jL1T12": ("L3", "T12", (0, 0, 0.09), "xy"),
    "jT9T8": ("T12", "T8", (0, 0, 0.09), "xyz"),
    "jT1C7": ("T8", "Neck", (0, 0, 0.12), "xyz"),
    "jC1Head": ("Neck", "Head", (0, 0, 0.09), "xy"),
}
for side, sign in (("Right", -1), ("Left", 1)):
    SUBJECT |= {
        f"j{side}C7Shoulder": ("T8", f"{side}Shoulder", (0, 0.03 * sign, 0.07), "x"),
        f"j{side}Shoulder": (f"{side}Shoulder", f"{side}UpperArm", (0, 0.14 * sign, 0), "xyz"),
        f"j{side}Elbow": (f"{side}UpperArm", f"{side}ForeArm", (0, 0.28 * sign, 0), "yz"),
        f"j{side}Wrist": (f"{side}ForeArm", f"{side}Hand", (0, 0.24 * sign, 0), "xz"),
        f"j{side}Hip": ("Pelvis", f"{side}UpperLeg", (0, 0.08 * sign, 0), "xyz"),
        f"j{side}Knee": (f"{side}UpperLeg", f"{side}LowerLeg", (0, 0, -0.43), "yz"),
        f"j{side}Ankle": (f"{side}LowerLeg", f"{side}Foot", (0, 0, -0.41), "xyz"),
    }
AXES = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}


def subject() -> pin.Model:
    """Build a small person with the names of human-gazebo: links of several joints are called Link_f1, Link_f2."""
    links, joints = ["Pelvis"], []
    for name, (parent, child, origin, axes) in SUBJECT.items():
        steps = [f"{child}_f{k + 1}" for k in range(len(axes) - 1)] + [child]
        for k, (axis, link) in enumerate(zip(axes, steps, strict=True)):
            before, xyz = (parent, origin) if k == 0 else (steps[k - 1], (0, 0, 0))
            joints.append(
                f'<joint name="{name}_rot{axis}" type="revolute"><parent link="{before}"/><child link="{link}"/>'
                f'<origin xyz="{xyz[0]} {xyz[1]} {xyz[2]}"/><axis xyz="{AXES[axis]}"/>'
                '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
            )
        links += steps
    text = "".join(f'<link name="{link}"/>' for link in links) + "".join(joints)
    return pin.buildModelFromXML(f'<robot name="subject">{text}</robot>', pin.JointModelFreeFlyer())


@cache
def model_of(name: str) -> pin.Model:
    if name == "human_gazebo":
        return subject()
    return load_figure().model if name == "stick_figure" else load_robot(name, geometry=False).model


@pytest.mark.parametrize("name", BUILT_IN)
def test_a_model_finds_its_map(name: str) -> None:
    assert find_joint_map(model_of(name)).name == name


@pytest.mark.parametrize("name", ["g1_with_hands", "talos_reduced", "talos_box"])
def test_variants_find_it_too(name: str) -> None:
    assert find_joint_map(model_of(name)).name == name.split("_", maxsplit=1)[0]


@pytest.mark.parametrize("name", BUILT_IN)
def test_a_map_lies_as_a_body_does(name: str) -> None:
    joint_map = load_joint_map(name)
    assert joint_map.absent == ()
    kinematics = joint_map.kinematics(model_of(name))
    assert kinematics.names[: len(JOINTS)] == JOINTS
    place = dict(zip(kinematics.names, kinematics.positions(kinematics.neutral[None])[0], strict=True))
    up = place["neck"] - place["pelvis"]
    up /= np.linalg.norm(up)
    left = place["left_shoulder"] - place["right_shoulder"]
    left /= np.linalg.norm(left)
    assert abs(up @ left) < 0.05
    middle = (place["left_hip"] + place["right_hip"]) / 2
    for part in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle"):
        right_side, left_side = place[f"right_{part}"] - middle, place[f"left_{part}"] - middle
        assert left_side @ left > 0.05 > -0.05 > right_side @ left
        # The two sides are each other's mirror image.
        np.testing.assert_allclose(left_side @ up, right_side @ up, atol=2e-3)
        np.testing.assert_allclose(left_side @ left, -right_side @ left, atol=2e-3)
    lengths = model_lengths(kinematics)
    for side in SIDES:
        height = {part: float((place[f"{side}_{part}"] - middle) @ up) for part in ("hip", "knee", "ankle")}
        assert height["hip"] > height["knee"] > height["ankle"]
        knee = (height["hip"] - height["knee"]) / (height["hip"] - height["ankle"])
        assert 0.4 < knee < 0.6
        assert 0.7 < lengths[f"{side}_shoulder-{side}_elbow"] / lengths[f"{side}_elbow-{side}_wrist"] < 1.4
        arm = lengths[f"{side}_shoulder-{side}_elbow"] + lengths[f"{side}_elbow-{side}_wrist"]
        leg = lengths[f"{side}_hip-{side}_knee"] + lengths[f"{side}_knee-{side}_ankle"]
        assert 0.45 < arm / leg < 0.95
        assert lengths[f"pelvis-{side}_hip"] < lengths["neck-pelvis"]


def test_a_posture_goes_into_targets_and_back(rng: np.random.Generator) -> None:
    kinematics = load_joint_map("human").kinematics(model_of("human"))
    postures = rng.normal(size=(3, len(POINTS), 3))
    targets = targets_of(postures, kinematics)
    np.testing.assert_array_equal(targets, targets_of(postures[:, : len(JOINTS)], kinematics))
    back = postures_of(targets, kinematics)
    np.testing.assert_array_equal(back[:, : len(JOINTS)], postures[:, : len(JOINTS)])
    assert np.isnan(back[:, len(JOINTS) :]).all()  # the model has no face
    with pytest.raises(InputError, match="postures have shape"):
        targets_of(postures[:, :5], kinematics)


def test_the_head_of_the_stick_figure_is_mapped() -> None:
    kinematics = load_joint_map("stick_figure").kinematics(model_of("stick_figure"))
    np.testing.assert_allclose(
        kinematics.positions(kinematics.neutral[None])[0], load_figure().neutral_points, atol=1e-12
    )


def test_a_map_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(
        'schema = "posekit.joint_map/1"\n[points]\nneck = "middle_head"\n'
        'right_wrist = { frame = "right_hand", offset = [0.0, -0.1, 0] }\n'
        'pelvis = { mean = ["right_upperleg", { frame = "left_upperleg", weight = 3 }] }\n'
        '[optional]\nnose = "no_such_frame"\nleft_wrist = "left_hand"\n'
    )
    joint_map = load_joint_map(path)
    assert "right_knee" in joint_map.absent and "nose" not in joint_map.absent
    kinematics = joint_map.kinematics(model_of("human"))
    assert kinematics.names == ("neck", "pelvis", "right_wrist", "left_wrist")
    plain = load_joint_map("human").kinematics(model_of("human"))
    place = dict(zip(plain.names, plain.positions(plain.neutral[None])[0], strict=True))
    mine = dict(zip(kinematics.names, kinematics.positions(plain.neutral[None])[0], strict=True))
    np.testing.assert_allclose(mine["pelvis"], 0.25 * place["right_hip"] + 0.75 * place["left_hip"])
    np.testing.assert_allclose(mine["right_wrist"], place["right_wrist"] + [0, -0.1, 0])


def test_a_model_without_a_map_is_told_what_is_missing() -> None:
    with pytest.raises(InputError) as refused:
        find_joint_map(load_robot("ur5", geometry=False).model)
    text = str(refused.value)
    assert "no built-in joint map fits" in text and "posekit.joint_map/1" in text and "\n" not in text
    with pytest.raises(
        InputError, match="'human': neck: the model has no frame 'right_clavicle'; the nearest are"
    ):
        load_joint_map("human").kinematics(model_of("g1"))


GOOD = {"schema": "posekit.joint_map/1", "points": {"neck": "a", "pelvis": "b", "right_hip": "c"}}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"schema": "posekit.view/1"}, "schema: got"),
        ({"schema": None}, "schema: got null"),
        ({"extra": 1}, "extra: got 1; expected no field of this name"),
        ({"points": []}, "points: got"),
        ({"points": {"neck": "a"}}, "points: got 1 points; expected at least 3"),
        ({"points": {"neck": "a", "pelvis": "b", "rigth_hip": "c"}}, "did you mean right_hip"),
        ({"optional": {"neck": "a"}}, "optional.neck: got a point that is in \\[points\\] too"),
        ({"optional": {"nose": 3}}, "optional.nose: got 3"),
        ({"optional": {"nose": ""}}, "optional.nose.frame: got"),
        (
            {"optional": {"nose": {"frame": "a", "ofset": [0, 0, 0]}}},
            "optional.nose.ofset: got .* did you mean offset",
        ),
        ({"optional": {"nose": {"frame": "a", "offset": [0, 0]}}}, "optional.nose.offset: got"),
        ({"optional": {"nose": {"frame": "a", "offset": [0, 0, "1"]}}}, "optional.nose.offset\\[2\\]: got"),
        (
            {"optional": {"nose": {"frame": "a", "offset": [0, 0, float("nan")]}}},
            "optional.nose.offset\\[2\\]: got",
        ),
        ({"optional": {"nose": {"frame": "a", "weight": 0}}}, "optional.nose.weight: got 0"),
        ({"optional": {"nose": {"frame": "a", "weight": True}}}, "optional.nose.weight: got true"),
        ({"optional": {"nose": {"mean": []}}}, "optional.nose.mean: got"),
        ({"optional": {"nose": {"mean": ["a", 1]}}}, "optional.nose.mean\\[1\\]: got 1"),
        ({"optional": {"nose": {"mean": ["a"], "frame": "b"}}}, "optional.nose.frame: got"),
        (
            {"optional": {"nose": {"mean": ["a"] * 17}}},
            "optional.nose.mean: got a list of 17 entries; expected at most 16",
        ),
    ],
)
def test_a_wrong_map_is_refused(change: dict[str, object], message: str) -> None:
    joint_map_of(validated(JointMapTable, GOOD, "good"), "good")
    with pytest.raises(InputError, match=message) as refused:
        joint_map_of(validated(JointMapTable, {**GOOD, **change}, "bad.toml"), "bad.toml")
    assert str(refused.value).startswith("bad.toml: ") and "\n" not in str(refused.value)


def test_a_file_that_is_no_map_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="joint map: got"):
        load_joint_map("humann")
    with pytest.raises(InputError):
        load_joint_map(tmp_path / "missing.toml")
    broken = tmp_path / "broken.toml"
    broken.write_text("[points\n")
    with pytest.raises(InputError, match="not TOML"):
        load_joint_map(broken)
    large = tmp_path / "large.toml"
    large.write_text("#" * 200_000)
    with pytest.raises(InputError):
        load_joint_map(large)
