"""Ranges by a robot's own joint names."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from posekit.errors import InputError
from posekit.robots import load_robot
from posekit.validators import Validator
from posekit.validators.robot import load_joint_limits

HUMAN = load_robot("human")
PANDA = load_robot("panda", geometry=False)
HEAD = 'schema = "posekit.ranges/1"\nkind = "joints"\n'


def write(folder: Path, text: str) -> str:
    path = folder / "ranges.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def test_urdf_is_the_model_itself() -> None:
    lower, upper = load_joint_limits("urdf", HUMAN.model)
    np.testing.assert_array_equal(lower[7:], HUMAN.lower[7:])
    np.testing.assert_array_equal(upper[7:], HUMAN.upper[7:])
    assert np.isinf(lower[:3]).all()


def test_a_table_takes_the_place_of_the_limits_that_it_names(tmp_path: Path) -> None:
    name = write(tmp_path, HEAD + "[limits]\nright_knee_Z = [5, 130.5]\n")
    lower, upper = load_joint_limits(name, HUMAN.model)
    k = HUMAN.configuration_names.index("right_knee_Z")
    assert np.degrees([lower[k], upper[k]]) == pytest.approx([5.0, 130.5])
    others = np.delete(np.arange(7, len(lower)), k - 7)
    np.testing.assert_array_equal(lower[others], HUMAN.lower[others])


def test_joints_that_slide_have_metres(tmp_path: Path) -> None:
    name = write(tmp_path, HEAD + "[limits]\npanda_finger_joint1 = [0.01, 0.02]\npanda_joint1 = [-10, 10]\n")
    lower, upper = load_joint_limits(name, PANDA.model)
    k = PANDA.configuration_names.index("panda_finger_joint1")
    assert (lower[k], upper[k]) == (0.01, 0.02)
    assert np.degrees(upper[PANDA.configuration_names.index("panda_joint1")]) == pytest.approx(10.0)


def test_the_validator_judges_by_the_table(tmp_path: Path) -> None:
    q = np.repeat(pin.neutral(HUMAN.model)[None], 2, axis=0)
    q[1, HUMAN.configuration_names.index("right_knee_Z")] = np.radians(100.0)
    narrow = write(tmp_path, HEAD + "[limits]\nright_knee_Z = [0, 90]\n")
    assert Validator(HUMAN, checks=("joint-range",)).check(q=q).verdicts == ["valid", "valid"]
    by_table = Validator(HUMAN, checks=("joint-range",), ranges=narrow).check(q=q)
    assert by_table.verdicts == ["valid", "invalid"]
    assert by_table.worst[1] == pytest.approx(-10.0)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("", ("an empty file",)),
        ("a = 1\n", ("schema: got nothing", "posekit.ranges/1")),
        ('schema = "posekit.ranges/1"\nkind = "configuration"\n', ('kind: got "configuration"', '"joints"')),
        (HEAD, ("limits: got nothing",)),
        (HEAD + "limits = 3\n", ("limits: got 3",)),
        (HEAD + "[limit]\na = [1, 2]\n", ("limits: got nothing",)),
        (HEAD + "[limits]\nright_knee = [0, 1]\n", ("limits.right_knee", "did you mean", "right_knee_Z")),
        (HEAD + "[limits]\nroot_joint = [0, 1]\n", ("limits.root_joint",)),
        (HEAD + "[limits]\nright_knee_Z = [1, 0]\n", ("[1, 0]", "the lower one first", "swap them")),
        (HEAD + "[limits]\nright_knee_Z = [1]\n", ("expected [lower, upper]",)),
        (HEAD + "[limits]\nright_knee_Z = [true, 2]\n", ("expected [lower, upper]",)),
        (HEAD + '[limits]\nright_knee_Z = "0..1"\n', ("expected [lower, upper]",)),
        (HEAD + "[limits]\nright_knee_Z = [0, nan]\n", ("right_knee_Z", "finite")),
        (HEAD + "[limits]\nright_knee_Z = [0, inf]\n", ("right_knee_Z", "finite")),
        ("not toml", ("not TOML",)),
    ],
)
def test_a_table_that_is_wrong_is_one_clear_line(tmp_path: Path, text: str, parts: tuple[str, ...]) -> None:
    with pytest.raises(InputError) as caught:
        load_joint_limits(write(tmp_path, text), HUMAN.model)
    message = str(caught.value)
    assert "\n" not in message
    assert "ranges.toml" in message
    for part in parts:
        assert part in message


@pytest.mark.parametrize("name", ["table1", "nowhere.toml", "", "\0", "x" * 5000])
def test_what_is_no_table_is_refused(name: str) -> None:
    with pytest.raises(InputError, match="--ranges"):
        load_joint_limits(name, HUMAN.model)
