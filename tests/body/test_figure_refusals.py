"""What the figure refuses: bodies that are not its own, files that are damaged, lengths that no body has."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from posekit.body import Figure, load_figure
from posekit.errors import FigureError
from posekit.skeleton import HEAD, HEAD_POINTS

FIGURE = load_figure()


def without_the_head_capsule(text: str) -> str:
    head = text.index('<link name="head">')
    return text[:head] + re.sub(r"<collision name.*?</collision>", "", text[head:], count=1, flags=re.DOTALL)


ENTITY = '<!DOCTYPE robot [<!ENTITY a "b">]>'
BREAKS: dict[str, tuple[Callable[[str], str], str]] = {
    "doctype": (
        lambda t: t.replace("<robot ", "<!DOCTYPE robot><robot ", 1),
        "DOCTYPE and entities are refused",
    ),
    "entity": (lambda t: t.replace("<robot ", f"{ENTITY}<robot ", 1), "DOCTYPE and entities are refused"),
    "truncated": (lambda t: t[:2000], "not well-formed"),
    "empty": (lambda t: "", "not well-formed"),
    "another root": (lambda t: "<html/>", "expected <robot>"),
    "another robot": (lambda t: '<robot name="a"><link name="b"/></robot>', "not a stick figure"),
    "NaN radius": (lambda t: t.replace('radius="0.09"', 'radius="nan"'), "'nan'; expected 1 finite number"),
    "infinite length": (lambda t: t.replace('length="0.28"', 'length="inf"'), "expected 1 finite number"),
    "negative radius": (lambda t: t.replace('radius="0.09"', 'radius="-0.1"'), "expected both positive"),
    "no number": (lambda t: t.replace('radius="0.09"', 'radius="wide"'), "is not a number"),
    "two numbers": (lambda t: t.replace('lower="0.0"', 'lower="0 1"', 1), "expected 1 finite number"),
    "two coordinates": (lambda t: t.replace('xyz="0 0 -0.26"', 'xyz="0 0"', 1), "expected 3 finite numbers"),
    "swapped limits": (
        lambda t: t.replace('lower="0.0" upper="2.792526803190927"', 'lower="2.79" upper="0.0"', 1),
        "'right_elbow_flexion' has lower limit 2.79 above its upper 0.0; swap them",
    ),
    "no head capsule": (without_the_head_capsule, "missing: head"),
    "a cylinder": (
        lambda t: t.replace('<collision_checking><capsule name="torso_capsule"/></collision_checking>', ""),
        "'torso': its collision body is a Cylinder; expected a capsule",
    ),
    "a mesh": (
        lambda t: t.replace(
            '<cylinder radius="0.09" length="0.28"/>', '<mesh filename="file:///etc/hostname"/>'
        ),
        "a collision body is a mesh",
    ),
    "a capsule off its line": (
        lambda t: t.replace('xyz="0 0 -0.26"', 'xyz="0 0.01 -0.26"'),
        "beside the line",
    ),
    "an axis of another kind": (
        lambda t: t.replace('<axis xyz="0 1 0"/>', '<axis xyz="0 0 1"/>', 1),
        "'neck_flexion' turns about",
    ),
    "a slanted axis": (lambda t: t.replace('<axis xyz="0 1 0"/>', '<axis xyz="0 1 0.1"/>', 1), "turns about"),
    "a sliding joint": (lambda t: t.replace('type="revolute"', 'type="prismatic"', 1), "turns about"),
    "an endless joint": (
        lambda t: t.replace('type="revolute"', 'type="continuous"', 1),
        "not a stick figure",
    ),
    "another name": (
        lambda t: t.replace('"right_wrist_fixed"', '"x"').replace('"right_wrist"', '"y"'),
        "right_wrist",
    ),
    "a turned joint": (
        lambda t: t.replace('<origin xyz="0 0 -0.38"/>', '<origin xyz="0 0 -0.38" rpy="0 0.3 0"/>', 1),
        "'right_ankle' does not lie as the stick figure's",
    ),
    "another parent": (
        lambda t: t.replace(
            '<parent link="torso"/><child link="right_shoulder_flexed"/>',
            '<parent link="hips"/><child link="right_shoulder_flexed"/>',
        ),
        "does not lie as the stick figure's",
    ),
    "5000 links": (
        lambda t: t.replace(
            "</robot>",
            "".join(
                f'<link name="l{k}"/><joint name="x{k}" type="fixed"><parent link="{f"l{k - 1}" if k else "torso"}"/>'
                f'<child link="l{k}"/></joint>'
                for k in range(5000)
            )
            + "</robot>",
        ),
        "expected at most 1000",
    ),
}


class TestRefusals:
    @pytest.mark.parametrize("name", BREAKS)
    def test_a_urdf_with(self, name: str) -> None:
        change, match = BREAKS[name]
        text = change(FIGURE.urdf)
        assert text != FIGURE.urdf
        with pytest.raises(FigureError, match=re.escape(match)) as error:
            Figure(urdf=text, srdf=FIGURE.srdf)
        assert "\n" not in str(error.value)

    @pytest.mark.parametrize("srdf", ["", "<robot", "<x/>", f"{ENTITY}<robot name='&a;'/>"])
    def test_an_srdf_that_is_none(self, srdf: str) -> None:
        with pytest.raises(FigureError, match="SRDF") as error:
            Figure(urdf=FIGURE.urdf, srdf=srdf)
        assert "\n" not in str(error.value)

    @pytest.mark.parametrize(
        ("lengths", "match"),
        [
            (
                {"right_hip-right_knee": 0.0},
                "right_hip-right_knee is 0 m; expected a positive, finite length",
            ),
            ({"right_hip-right_knee": -0.4}, "is -0.4 m"),
            ({"right_hip-right_knee": float("nan")}, "is nan m"),
            ({"right_hip-right_knee": float("inf")}, "is inf m"),
            ({"right_knee-right_hip": 0.4}, "'right_knee-right_hip' is not a segment; expected one of neck-"),
            ({"neck-tail": 0.4}, "'neck-tail' is not a segment"),
            ({"neck-pelvis": 0.9}, "the triangle neck, right_shoulder, pelvis does not close with 0.9"),
            ({"right_shoulder-pelvis": 0.1}, "the triangle neck, right_shoulder, pelvis does not close"),
            ({"neck-left_shoulder": 1.0}, "the triangle neck, left_shoulder, pelvis does not close"),
            (
                {"right_shoulder-left_shoulder": 0.6},
                "right_shoulder-left_shoulder is 0.6 m, but with the other",
            ),
            (
                {
                    "neck-right_shoulder": 0.1,
                    "right_shoulder-pelvis": 0.4,
                    "right_shoulder-left_shoulder": 0.01,
                },
                "the shoulders' heights differ",
            ),
            ({"pelvis-right_hip": 0.9}, "the triangle right_hip, pelvis, left_hip does not close"),
            ({"right_hip-left_hip": 0.7}, "the triangle right_hip, pelvis, left_hip does not close"),
        ],
    )
    def test_lengths_of_no_body(self, lengths: dict[str, float], match: str) -> None:
        with pytest.raises(FigureError, match=re.escape(match)) as error:
            FIGURE.scaled(lengths)
        assert "\n" not in str(error.value)

    @pytest.mark.parametrize(
        ("head", "match"),
        [
            ({"nose": [np.nan, 0, 0]}, "finite"),
            ({"noes": [0, 0, 0]}, "'noes' is not a head point; expected neck, nose"),
            ({"nose": [0, 0]}, "nose has shape (2,)"),
            ({name: [0, 0, 0] for name in HEAD_POINTS}, "not centred on the neck"),
        ],
    )
    def test_head_points_of_no_head(self, head: dict[str, list[float]], match: str) -> None:
        with pytest.raises(FigureError, match=re.escape(match)):
            FIGURE.scaled({}, head)

    @pytest.mark.parametrize("bounds", [(1.0, 0.0), (float("nan"), 1.0), (0.0, float("inf"))])
    def test_limits_of_no_joint(self, bounds: tuple[float, float]) -> None:
        with pytest.raises(FigureError):
            FIGURE.with_limits({"right_elbow.flexion": bounds})

    def test_limits_of_an_unknown_joint(self) -> None:
        with pytest.raises(FigureError, match="tail_flexion"):
            FIGURE.with_limits({"tail.flexion": (0.0, 1.0)})

    def test_files_that_cannot_be_read(self, tmp_path: Path) -> None:
        binary, huge = tmp_path / "binary.urdf", tmp_path / "huge.urdf"
        binary.write_bytes(b"\xff\xfe\x00")
        huge.write_bytes(b" " * 10_000_001)
        for path, match in (
            (tmp_path / "none.urdf", "No such file"),
            (tmp_path, "a directory; expected a file"),
            (binary, "byte 0: got 0xff; expected text in UTF-8"),
            (huge, "10.0 MB; expected at most 10 MB"),
        ):
            with pytest.raises(FigureError, match=match) as error:
                load_figure(path)
            assert "\n" not in str(error.value)
            assert str(path) in str(error.value)

    def test_the_neutral_points_are_read_only(self) -> None:
        with pytest.raises(ValueError, match="read-only"):
            FIGURE.neutral_points[0, 0] = 1.0
        assert FIGURE.neutral_points[list(HEAD)].shape == (5, 3)
