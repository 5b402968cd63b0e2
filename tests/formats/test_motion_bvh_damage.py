"""BVH files that are damaged: each is refused in one line that names what is wrong."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from posekit.errors import InputError
from posekit.formats.motion.bvh import read_bvh

SMALL = Path(__file__).with_name("small.bvh").read_text(encoding="utf-8")


DAMAGE = [
    (lambda text: text[: text.index("MOTION")], "no line MOTION"),
    (lambda text: text.replace("HIERARCHY", "HIERARCHIE"), "line 1.*HIERARCHY"),
    (lambda text: "MOTION\n" + text, "the end of the hierarchy"),
    (lambda text: "HIERARCHY\n" + text[text.index("MOTION") :], "no joint"),
    (lambda text: text.replace("}\n  JOINT Chest", "  JOINT Chest"), "open"),
    (lambda text: text.replace("}\nMOTION", "}\n}\nMOTION"), "closes what was not opened"),
    (lambda text: text.replace("ROOT Hips", "JOINT Hips"), "ROOT outside"),
    (lambda text: text.replace("JOINT Chest", "ROOT Chest"), "JOINT or End Site inside"),
    (lambda text: text.replace("Chest", "Hips"), '"Hips" twice'),
    (lambda text: text.replace("ROOT Hips", "ROOT"), "no name"),
    (lambda text: text.replace("JOINT Chest\n  {", "JOINT Chest\n  }"), "opens with {"),
    (lambda text: text.replace("OFFSET 0 50 0", ""), "no OFFSET in Chest"),
    (lambda text: text.replace("OFFSET 0 50 0", "OFFSET 0 50 0\nOFFSET 0 1 0"), "OFFSET twice"),
    (lambda text: text.replace("OFFSET 0 50 0", "OFFSET 0 50"), '"CHANNELS"'),
    (lambda text: text.replace("OFFSET 0 50 0", "OFFSET 0 nan 0"), 'line 17: got "nan"'),
    (lambda text: text.replace("OFFSET 0 50 0", "OFFSET 0 1e999 0"), '"1e999"'),
    (lambda text: text.replace("OFFSET 0 50 0", "OFFSET 0 5_0 0"), '"5_0"'),
    (lambda text: text.replace("CHANNELS 3", "CHANNELS 7", 1), "0 to 6 channels"),
    (lambda text: text.replace("CHANNELS 3", "CHANNELS -3", 1), "0 to 6 channels"),
    (lambda text: text.replace("CHANNELS 3", f"CHANNELS {'9' * 5000}", 1), "0 to 6 channels"),
    (lambda text: text.replace("CHANNELS 3", "CHANNELS 2", 1), '"Yrotation"'),
    (lambda text: text.replace("CHANNELS 3", "CHANNELS 4", 1), "Xposition … Zposition"),
    (lambda text: text.replace("Xrotation", "Xrotatoin", 1), "did you mean Xrotation"),
    (lambda text: text.replace("Xrotation", "Zrotation", 1), "a channel twice"),
    (
        lambda text: text.replace("OFFSET 0 30 0", "OFFSET 0 30 0\nCHANNELS 3 Xrotation Yrotation Zrotation"),
        "CHANNELS",
    ),
    (
        lambda text: text.replace("OFFSET 0 30 0", "OFFSET 0 30 0\nJOINT x { OFFSET 0 0 0 }"),
        "} after an End Site",
    ),
    (lambda text: re.sub(r"CHANNELS.*", "", text), "CHANNELS: got none"),
    (lambda text: text.replace("Frames: 2", ""), "Frames: and Frame Time:"),
    (lambda text: text.replace("Frames: 2", "Frames: 0"), '"0"'),
    (lambda text: text.replace("Frames: 2", "Frames: -2"), '"-2"'),
    (lambda text: text.replace("Frames: 2", f"Frames: {'9' * 6000}"), "positive whole number"),
    (lambda text: text.replace("Frames: 2", "Frames: 999999999999"), "correct the line to Frames: 2"),
    (lambda text: text.replace("Frames: 2", "Frames: 1"), "correct the line to Frames: 2"),
    (lambda text: text.replace(".0083333", "0"), '"0"'),
    (lambda text: text.replace(".0083333", "nan"), '"nan"'),
    (lambda text: text.replace(".0083333", "inf"), '"inf"'),
    (lambda text: text.replace(".0083333", "-0.01"), '"-0.01"'),
    (lambda text: text.replace("1 93 2 0 0 90", "1 nan 2 0 0 90"), 'line 28: got "nan"'),
    (lambda text: text.replace("1 93 2 0 0 90", "1 -1.#IND00 2 0 0 90"), "line 28.*-1.#IND00"),
    (lambda text: text.replace("1 93 2 0 0 90", "1 9,3 2 0 0 90"), "line 28.*9,3"),
    (lambda text: text.replace("1 93 2 0 0 90", "1 1e400 2 0 0 90"), "line 28.*1e400"),
    (lambda text: text.replace("1 93 2 0 0 90", "1 9.3.1 2 0 0 90"), "line 28.*9.3.1"),
    (lambda text: text.replace("1 93 2 0 0 90", "1 1e12 2 0 0 90"), "line 28.*1e12"),
    (lambda text: text.replace("1 93 2 0 0 90", "1 93 2 0 0"), "line 28: got 11 values; expected 12"),
    (lambda text: text[: text.rindex("90 0 0")], "line 29: got 7 values"),
    (lambda text: text[: text.rindex("1 93 2")], "Frames: got 2, but 1 lines"),
    (lambda text: text + "\x00", "NUL"),
    (lambda text: "", "empty"),
]


class TestDamage:
    @pytest.mark.parametrize(("change", "says"), DAMAGE, ids=[says for _, says in DAMAGE])
    def test_is_named_in_one_line(self, change: Callable[[str], str], says: str, tmp_path: Path) -> None:
        path = tmp_path / "a.bvh"
        path.write_text(change(SMALL))
        with pytest.raises(InputError, match=says) as caught:
            read_bvh(path, "cm")
        message = str(caught.value)
        assert "\n" not in message
        assert message.startswith(str(path))
        assert len(message) < 500

    def test_every_truncation_is_noticed(self, tmp_path: Path) -> None:
        """Cut anywhere but inside the last number, which then only is another number."""
        path = tmp_path / "a.bvh"
        for length in range(0, len(SMALL) - 2, 7):
            path.write_text(SMALL[:length])
            with pytest.raises(InputError):
                read_bvh(path, "cm")

    def test_random_damage_never_ends_otherwise(self, rng: np.random.Generator, tmp_path: Path) -> None:
        path, words = tmp_path / "a.bvh", SMALL.split()
        strange = [
            "{",
            "}",
            "JOINT",
            "End",
            "OFFSET",
            "CHANNELS",
            "-",
            ".",
            "e",
            "1e9",
            "MOTION",
            "Frames:",
            "é",
            "9" * 400,
        ]
        refused = 0
        for _ in range(300):
            changed = list(words)
            for _ in range(rng.integers(1, 4)):
                changed[rng.integers(len(changed))] = strange[rng.integers(len(strange))]
            # Lines matter for MOTION alone.
            path.write_text(" ".join(changed).replace(" MOTION ", "\nMOTION\n"))
            try:
                read_bvh(path, "cm")
            except InputError as error:
                refused += 1
                assert "\n" not in str(error)
        assert refused > 250

    def test_depth_and_number_of_joints_are_bounded(self, tmp_path: Path) -> None:
        path = tmp_path / "a.bvh"
        tail = "MOTION\nFrames: 1\nFrame Time: 1\n0\n"
        deep = "".join(f"JOINT j{k} {{ OFFSET 0 1 0 " for k in range(5000))
        path.write_text(f"HIERARCHY ROOT r {{ OFFSET 0 0 0 CHANNELS 1 Xrotation {deep}{'}' * 5001}\n{tail}")
        with pytest.raises(InputError, match="250 deep"):
            read_bvh(path)
        wide = "".join(f"JOINT j{k} {{ OFFSET 0 1 0 }} " for k in range(3000))
        path.write_text(f"HIERARCHY ROOT r {{ OFFSET 0 0 0 CHANNELS 1 Xrotation {wide}}}\n{tail}")
        with pytest.raises(InputError, match="2000 joints"):
            read_bvh(path)
        path.write_text("x " * 2_500_000 + "\nMOTION\n")
        with pytest.raises(InputError, match="characters before MOTION"):
            read_bvh(path)

    def test_stated_unit_and_up_are_checked(self, tmp_path: Path) -> None:
        (tmp_path / "a.bvh").write_text(SMALL)
        with pytest.raises(InputError, match="state one of them"):
            read_bvh(tmp_path / "a.bvh", "yd")
        with pytest.raises(InputError, match="state one of them"):
            read_bvh(tmp_path / "a.bvh", up="y")
