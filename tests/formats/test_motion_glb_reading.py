"""GLB read: the places of its nodes as trimesh finds them, what was written comes back, and damage is one line."""

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.formats.motion import read_motion
from posekit.formats.motion.glb import write_glb
from posekit.skeleton import POINTS


def some_q(rng: np.random.Generator, count: int) -> np.ndarray:
    q = rng.uniform(-0.4, 0.4, (count, load_figure().model.nq))
    q[:, 3:7] = rng.normal(size=(count, 4))
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    return q


@pytest.mark.parametrize("count", [1, 7])
def test_what_is_written_is_read_again(tmp_path: Path, rng: np.random.Generator, count: int) -> None:
    figure, q = load_figure(), some_q(rng, count)
    write_glb(tmp_path / "a.glb", figure, q, np.arange(count) / 25, up="+y")
    motion = read_motion(tmp_path / "a.glb")
    assert motion.up == "+y" and len(motion) == count and set(POINTS) <= set(motion.names)
    columns = [motion.names.index(name) for name in POINTS]
    np.testing.assert_allclose(motion.points[:, columns], figure.forward_kinematics(q), rtol=0, atol=1e-6)
    if count > 1:
        assert motion.rate == 25


def test_a_body_that_stands_is_where_trimesh_finds_it(tmp_path: Path, rng: np.random.Generator) -> None:
    write_glb(tmp_path / "a.glb", load_figure(), some_q(rng, 1), np.zeros(1))
    motion = read_motion(tmp_path / "a.glb")
    scene: Any = trimesh.load(tmp_path / "a.glb")
    for k, name in enumerate(motion.names):
        if name in scene.graph.nodes:
            np.testing.assert_allclose(
                motion.points[0, k], scene.graph.get(name)[0][:3, 3], rtol=0, atol=1e-9
            )


def chain(**changed: Any) -> dict[str, Any]:
    """Make two nodes, the second 1 m before the first, which turns by half a turn about z in two seconds."""
    return {
        "asset": {"version": "2.0"},
        "nodes": [
            {"name": "a", "scale": [2, 2, 2], "children": [1]},
            {"name": "b", "translation": [1, 0, 0]},
        ],
        "animations": [
            {
                "samplers": [{"input": 0, "output": 1}],
                "channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}],
            }
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "SCALAR"},
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC4"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 12},
            {"buffer": 0, "byteOffset": 12, "byteLength": 48},
        ],
        "buffers": [{"byteLength": 60}],
        **changed,
    }


HALF = np.sqrt(0.5)
NUMBERS = np.array([0, 1, 2, 0, 0, 0, 1, 0, 0, HALF, HALF, 0, 0, 1, 0], dtype="<f4").tobytes()


def packed(document: object, numbers: bytes = NUMBERS) -> bytes:
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(numbers))
    return (
        head
        + struct.pack("<I4s", len(text), b"JSON")
        + text
        + struct.pack("<I4s", len(numbers), b"BIN\0")
        + numbers
    )


def test_nodes_hang_on_what_turns_and_grows(tmp_path: Path) -> None:
    (tmp_path / "a.glb").write_bytes(packed(chain()))
    motion = read_motion(tmp_path / "a.glb")
    assert motion.names == ("a", "b") and motion.time.tolist() == [0, 1, 2]
    np.testing.assert_allclose(motion.points[:, 1], [[2, 0, 0], [0, 2, 0], [-2, 0, 0]], rtol=0, atol=1e-6)
    np.testing.assert_array_equal(motion.points[:, 0], 0)


def test_between_keys_a_node_turns_evenly(tmp_path: Path) -> None:
    document = chain()
    numbers = NUMBERS + np.array([0, 0.5, 2, *[0] * 9], dtype="<f4").tobytes()
    document["accessors"] += [
        {"bufferView": 2, "componentType": 5126, "count": 3, "type": "SCALAR"},
        {"bufferView": 2, "byteOffset": 12, "componentType": 5126, "count": 3, "type": "VEC3"},
    ]
    document["bufferViews"].append({"buffer": 0, "byteOffset": 60, "byteLength": 48})
    document["animations"][0]["samplers"].append({"input": 2, "output": 3})
    document["animations"][0]["channels"].append({"sampler": 1, "target": {"node": 0, "path": "translation"}})
    (tmp_path / "a.glb").write_bytes(packed(document, numbers))
    motion = read_motion(tmp_path / "a.glb")
    assert motion.time.tolist() == [0, 0.5, 1, 2]
    angle = np.pi / 4
    np.testing.assert_allclose(
        motion.points[1, 1], [2 * np.cos(angle), 2 * np.sin(angle), 0], rtol=0, atol=1e-6
    )


def changed(name: str, value: object) -> Callable[[dict], None]:
    *path, last = name.split(".")

    def change(document: dict) -> None:
        place: Any = document
        for part in path:
            place = place[int(part)] if part.isdigit() else place[part]
        place[int(last) if last.isdigit() else last] = value

    return change


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (changed("nodes", 3), "nodes: got 3"),
        (changed("nodes", []), "0 nodes"),
        (changed("nodes.0.children", [7]), "the number of one of 2 nodes"),
        (changed("nodes.0.children", [0]), "node 0 under two nodes"),
        (changed("nodes.1.children", [0]), "in a circle"),
        (changed("nodes.1.translation", [1, 2]), "3 numbers"),
        (changed("nodes.1.translation", ["1", 2, 3]), "3 numbers"),
        (changed("nodes.1.matrix", [1] * 16), "a matrix"),
        (changed("animations", [{}, {}]), "2 animations"),
        (changed("animations.0.samplers", None), "no samplers"),
        (changed("animations.0.channels.0.sampler", 5), "no target or sampler"),
        (changed("animations.0.channels.0.target.node", -1), "one of 2 nodes"),
        (changed("animations.0.samplers.0.interpolation", "CUBICSPLINE"), "LINEAR"),
        (changed("animations.0.samplers.0.input", True), "one of 2 accessors"),
        (changed("accessors.0.count", 4), "keys"),
        (changed("accessors.1.count", 1 << 28), "bytes from 12"),
        (changed("accessors.1.componentType", 5121), "32-bit floats"),
        (changed("accessors.1.byteOffset", -4), "offsets and a count"),
        (changed("bufferViews.1.byteStride", 20), "without gaps"),
        (changed("accessors.0.bufferView", None), "bufferViews"),
    ],
)
def test_damage_is_one_line(tmp_path: Path, change: Callable[[dict], None], said: str) -> None:
    document = chain()
    change(document)
    (tmp_path / "a.glb").write_bytes(packed(document))
    with pytest.raises(InputError, match=said) as refused:
        read_motion(tmp_path / "a.glb")
    assert "\n" not in str(refused.value)


@given(st.integers(0, 700), st.integers(0, 255))
def test_a_byte_that_is_wrong_never_ends_in_anything_else(
    tmp_path_factory: pytest.TempPathFactory, place: int, value: int
) -> None:
    data = bytearray(packed(chain()))
    data[place % len(data)] = value
    path = tmp_path_factory.mktemp("glb") / "a.glb"
    for content in (data, data[: place % len(data) + 1]):
        path.write_bytes(content)
        try:
            motion = read_motion(path, "glb", unit="m")
        except InputError as error:
            assert "\n" not in str(error)
        else:
            assert np.isfinite(motion.points).all()
