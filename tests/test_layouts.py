"""Layouts: data that names joints and changes no number; habits of naming; a user's own file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import posekit
from posekit.formats.layout import by_names, layout_names, load_layout
from posekit.skeleton import JOINTS

PARTS = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
LIMBS = [f"{side}_{part}" for side in ("right", "left") for part in PARTS]

HABITS = {
    "3ds Max": ("Bip01 {S} ", ("UpperArm", "Forearm", "Hand", "Thigh", "Calf", "Foot")),
    "Rocketbox": ("Bip01_{S}_", ("UpperArm", "Forearm", "Hand", "Thigh", "Calf", "Foot")),
    "Mixamo": ("mixamorig7:{Side}", ("Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot")),
    "Maya": ("Character1_{Side}", ("Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot")),
    "Neuron": ("Robot_{Side}", ("Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot")),
    "CMU": ("{s}", ("humerus", "radius", "hand", "femur", "tibia", "foot")),
    "DAZ": ("{s}", ("Shldr", "ForeArm", "Hand", "Thigh", "Shin", "Foot")),
    "OptiTrack": ("{S}", ("UArm", "FArm", "Hand", "Thigh", "Shin", "Foot")),
    "Unity": ("{Side}", ("UpperArm", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Foot")),
    "VRM": ("J_Bip_{S}_", ("UpperArm", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Foot")),
    "SOMA": ("{Side}", ("Arm", "ForeArm", "Hand", "Leg", "Shin", "Foot")),
    "Xsens": ("{Side}", ("Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle")),
    "SMPL": ("{Side}_", ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")),
    "Unreal": ("*_{s}", ("upperarm", "lowerarm", "hand", "thigh", "calf", "foot")),
    "Rigify": ("*.{S}", ("upper_arm", "forearm", "hand", "thigh", "shin", "foot")),
    "Blender": ("*.{S}", ("Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot")),
    "MocapNET": ("{s}", ("shoulder", "elbow", "hand", "hip", "knee", "foot")),
    "gait laboratory": ("{S}", ("SJC", "EJC", "WJC", "HJC", "KJC", "AJC")),
}


def named(pattern: str, part: str, side: str) -> str:
    """Spell a part of a side in a program's habit."""
    words = {"S": side[0].upper(), "s": side[0], "Side": side.capitalize()}
    text = pattern.format(**words)
    return text.replace("*", part) if "*" in text else text + part


@pytest.mark.parametrize("habit", HABITS)
def test_each_habit_of_naming_gives_each_limb_its_own_joint(habit: str) -> None:
    pattern, parts = HABITS[habit]
    names = [named(pattern, part, side) for side in ("right", "left") for part in parts]
    names += ["Hips", "Spine", "Head"]
    numbers = np.arange(len(names), dtype=np.float64)[:, None]
    found = by_names(names, "file.bvh").gather(numbers, names)
    assert {limb: found[limb].tolist() for limb in LIMBS} == {limb: [k] for k, limb in enumerate(LIMBS)}


@pytest.mark.parametrize("name", [one for one in layout_names() if load_layout(one).kind == "points"])
def test_a_layout_moves_no_point(name: str) -> None:
    layout = load_layout(name)
    names = layout.points or tuple(dict.fromkeys(part for parts in layout.sources.values() for part in parts))
    points = np.random.default_rng(0).normal(size=(5, len(names), 3))
    ours, placed, derived = layout.place(names, points)
    for landmark, parts in layout.sources.items():
        if landmark in ours and landmark not in derived and len(parts) == 1:
            assert np.array_equal(placed[:, ours.index(landmark)], points[:, names.index(parts[0])])


def test_neck_and_pelvis_that_a_file_lacks_are_those_of_the_figure() -> None:
    body = posekit.load_figure().neutral_points[:14] * 1.1 + [3.0, -2.0, 0.5]
    keep = [k for k, name in enumerate(JOINTS) if name not in ("neck", "pelvis")]
    names = [JOINTS[k] for k in keep]
    ours, placed, derived = load_layout("posekit").place(names, np.repeat(body[None, keep], 3, axis=0))
    assert derived == ("pelvis", "neck")
    assert np.abs(placed[0, [ours.index(name) for name in JOINTS]] - body).max() < 0.02


def test_a_users_layout_is_a_toml_file(tmp_path: Path) -> None:
    own = tmp_path / "own.toml"
    lines = [f'{limb} = "p{k}"' for k, limb in enumerate(LIMBS)]
    own.write_text('source = "mine"\n[landmarks]\n' + "\n".join(lines))
    figure = posekit.load_figure().neutral_points
    cloud = np.repeat(np.stack([figure[JOINTS.index(limb)] for limb in LIMBS])[None], 4, axis=0)
    table = tmp_path / "points.csv"
    columns = [f"p{k}_{axis}" for k in range(12) for axis in "xyz"]
    rows = [",".join(map(repr, [0.1 * t, *cloud[t].ravel().tolist()])) for t in range(4)]
    table.write_text("\n".join([",".join(["time", *columns]), *rows]))
    with pytest.raises(posekit.InputError, match=r"--layout"):
        posekit.open(table)
    motion = posekit.open(table, layout=str(own))
    assert np.array_equal(motion.points(LIMBS), cloud)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[landmarks]\nleft_elbo = "a"', "did you mean left_elbow"),
        ('[landmarks]\nleft_knee = "a"\nright_knee = "a"', "points of its own"),
        ('points = ["a", "A "]\n[landmarks]\n', "letters or digits"),
        ("[landmarks", "TOML"),
        ('[landmarks]\nneck = ["a", "a"]', "a name twice"),
        ('points = ["a", "b"]\n[landmarks]\nneck = ["a", "c"]', "different names of its points"),
        ("[landmarks]\nneck = []", "a list of names"),
        ("[landmarks]\nneck = [1]", "a list of names"),
        ('source = "x"', "landmarks"),
    ],
)
def test_a_wrong_layout_is_refused_with_its_field(tmp_path: Path, text: str, message: str) -> None:
    own = tmp_path / "own.toml"
    own.write_text(text)
    with pytest.raises(posekit.InputError, match=message):
        load_layout(own)


def test_an_unknown_layout_names_the_nearest() -> None:
    with pytest.raises(posekit.InputError, match="coco_17"):
        load_layout("coco17")


def test_robot_orders_are_of_the_same_joints() -> None:
    orders = {name: load_layout(name).fields["joints"] for name in ("g1_29", "g1_29_isaac", "g1_23")}
    assert set(orders["g1_29"]) == set(orders["g1_29_isaac"]) > set(orders["g1_23"])
    robot = posekit.load_robot("g1", bodies="none")
    assert tuple(orders["g1_29"]) == tuple(robot.configuration_names[7:])


def test_isaacs_order_is_breadth_first_along_the_robots_tree() -> None:
    model = posekit.load_robot("g1", bodies="none").model
    level, order = [0], []
    depth = {0: 0}
    for joint in range(1, model.njoints):
        depth[joint] = depth[model.parents[joint]] + 1
    while level:
        level = [
            joint for parent in level for joint in range(1, model.njoints) if model.parents[joint] == parent
        ]
        order += [model.names[joint] for joint in level]
    assert [name for name in order if name.endswith("_joint") and "root" not in name] == list(
        load_layout("g1_29_isaac").fields["joints"]
    )
