"""GLB: nodes named as joints stand where the joints are, at rest and in every key frame; trimesh opens the file."""

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from scipy.spatial.transform import Rotation, Slerp

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.formats.motion.bvh_tree import BODY_NODES, known_nodes
from posekit.formats.motion.glb import GLB_FORMAT, write_glb, write_postures_glb
from posekit.formats.motion.glb_capsule import RING_CORNERS, capsule_mesh
from posekit.formats.motion.glb_file import INDEX_TARGET, UINT16_TYPE, GlbFile
from posekit.formats.motion.glb_reading import read_glb
from posekit.formats.motion.motion import UP_DIRECTIONS
from posekit.formats.motion.motion_axes import up_rotation
from posekit.skeleton import POINT, POINTS
from posekit.synthesis.walker import Walker

FIGURE = load_figure()
ASKED = 1e-6
"""Metres."""


def configurations(rng: np.random.Generator, n: int, depth: float = 4.0) -> np.ndarray:
    """Draw configurations over all of the limits, turned anyhow, so far from a camera."""
    q = np.tile(pin.neutral(FIGURE.model), (n, 1))
    q[:, :3] = 0.5 * rng.normal(size=(n, 3)) + np.array([0, 0, depth])
    turn = rng.normal(size=(n, 4))
    q[:, 3:7] = turn / np.linalg.norm(turn, axis=1, keepdims=True)
    limits = FIGURE.limits
    q[:, FIGURE.angle_index] = limits.lower + rng.random((n, 22)) * (limits.upper - limits.lower)
    return q


def expected_points(q: np.ndarray, up: str = "+z") -> np.ndarray:
    return FIGURE.forward_kinematics(q) @ up_rotation(up, "+y").T


class Glb:
    """A reader of the container by the specification's §4 and §3.6, and of animations by §3.11."""

    def __init__(self, path: Path) -> None:
        data = path.read_bytes()
        magic, version, length = struct.unpack_from("<4sII", data)
        assert (magic, version, length) == (b"glTF", 2, len(data))
        size, kind = struct.unpack_from("<I4s", data, 12)
        assert kind == b"JSON"
        assert size % 4 == 0
        self.json: dict[str, Any] = json.loads(data[20 : 20 + size])
        size_bin, kind = struct.unpack_from("<I4s", data, 20 + size)
        assert kind == b"BIN\0"
        assert size_bin % 4 == 0
        assert 28 + size + size_bin == len(data)
        self.bin = data[28 + size :]
        assert self.json["buffers"] == [{"byteLength": size_bin}]
        self.nodes = self.json["nodes"]
        self.parents = {child: k for k, node in enumerate(self.nodes) for child in node.get("children", [])}
        self.index = {node["name"]: k for k, node in enumerate(self.nodes)}
        assert len(self.index) == len(self.nodes)

    def values(self, accessor: int) -> np.ndarray:
        entry = self.json["accessors"][accessor]
        view = self.json["bufferViews"][entry["bufferView"]]
        dtype = np.dtype({5126: "<f4", 5123: "<u2"}[entry["componentType"]])
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[entry["type"]]
        assert view["byteOffset"] % 4 == 0
        assert view["byteLength"] == entry["count"] * width * dtype.itemsize
        values = np.frombuffer(self.bin, dtype, entry["count"] * width, view["byteOffset"])
        values = values.reshape(-1, width)
        if "min" in entry:
            np.testing.assert_array_equal(values.min(axis=0), np.array(entry["min"], dtype=dtype))
            np.testing.assert_array_equal(values.max(axis=0), np.array(entry["max"], dtype=dtype))
        return np.asarray(values)

    def times(self) -> np.ndarray:
        samplers = self.json["animations"][0]["samplers"]
        assert len({sampler["input"] for sampler in samplers}) == 1
        assert "min" in self.json["accessors"][samplers[0]["input"]]
        return self.values(samplers[0]["input"])[:, 0]

    def at(self, time: float) -> dict[str, np.ndarray]:
        """Place all nodes at a time: linear between key frames, spherical for rotations."""
        moved = [dict(node) for node in self.nodes]
        animation = self.json["animations"][0]
        for channel in animation["channels"]:
            sampler = animation["samplers"][channel["sampler"]]
            assert sampler["interpolation"] == "LINEAR"
            keys = self.values(sampler["input"])[:, 0].astype(float)
            values = self.values(sampler["output"]).astype(float)
            assert len(values) == len(keys)
            target = channel["target"]
            if target["path"] == "rotation":
                moved[target["node"]]["rotation"] = Slerp(keys, Rotation.from_quat(values))(time).as_quat()
            else:
                place = [np.interp(time, keys, values[:, axis]) for axis in range(3)]
                moved[target["node"]]["translation"] = place
        return self.placed(moved)

    def placed(self, nodes: list[dict[str, Any]]) -> dict[str, np.ndarray]:
        world: dict[int, tuple[np.ndarray, Rotation]] = {}

        def place(k: int) -> tuple[np.ndarray, Rotation]:
            if k not in world:
                local = np.array(nodes[k].get("translation", [0, 0, 0]), dtype=float)
                turn = Rotation.from_quat(nodes[k].get("rotation", [0, 0, 0, 1]))
                if k in self.parents:
                    origin, before = place(self.parents[k])
                    local, turn = origin + before.apply(local), before * turn
                world[k] = local, turn
            return world[k]

        return {name: place(k)[0] for name, k in self.index.items()}


class TestMotion:
    @pytest.mark.parametrize("depth", [3.0, 6.0, 60.0, 1000.0])
    def test_every_key_frame_is_forward_kinematics(
        self, depth: float, rng: np.random.Generator, tmp_path: Path
    ) -> None:
        """Numbers are float32, whose step at 6 m is 5e-7 m and at 1000 m 6e-5 m: the way from whole metres is not."""
        q = configurations(rng, 12, depth)
        write_glb(tmp_path / "a.glb", FIGURE, q, np.arange(12) / 25)
        glb = Glb(tmp_path / "a.glb")
        np.testing.assert_array_equal(glb.times(), (np.arange(12) / 25).astype(np.float32))
        expected = expected_points(q)
        for frame, time in enumerate(glb.times()):
            placed = glb.at(float(time))
            for point, k in POINT.items():
                assert np.abs(placed[point] - expected[frame, k]).max() < ASKED, (frame, point)

    def test_between_key_frames_a_walk_goes_on(self, tmp_path: Path) -> None:
        walker = Walker(velocity=1.0)
        q = walker.configurations(np.linspace(0, 1, 31))
        write_glb(tmp_path / "walk.glb", FIGURE, q, np.arange(31) / 30, up="+y")
        glb = Glb(tmp_path / "walk.glb")
        between = FIGURE.forward_kinematics(walker.configurations([0.25 + 1 / 60]))
        placed = glb.at((7.5 + 0.5) / 30)
        assert max(np.abs(placed[point] - between[0, k]).max() for point, k in POINT.items()) < 0.01

    def test_quaternions_never_change_sign(self, tmp_path: Path) -> None:
        """Readers that mix them without looking at the sign would turn the long way round."""
        n = 200
        q = np.tile(pin.neutral(FIGURE.model), (n, 1))
        yaw = np.linspace(0, 6 * np.pi, n)
        q[:, 5], q[:, 6] = np.sin(yaw / 2), np.cos(yaw / 2)
        q[1::2, 3:7] *= -1
        write_glb(tmp_path / "a.glb", FIGURE, q, np.arange(n) / 30)
        glb = Glb(tmp_path / "a.glb")
        for channel in glb.json["animations"][0]["channels"]:
            if channel["target"]["path"] == "rotation":
                sampler = glb.json["animations"][0]["samplers"][channel["sampler"]]
                values = glb.values(sampler["output"])
                assert (np.einsum("ti,ti->t", values[1:], values[:-1]) > 0.9).all()
                np.testing.assert_allclose(np.linalg.norm(values, axis=1), 1, rtol=0, atol=1e-6)

    @pytest.mark.parametrize("up", sorted(UP_DIRECTIONS))
    def test_y_is_up(self, up: str, rng: np.random.Generator, tmp_path: Path) -> None:
        q = configurations(rng, 1)
        write_glb(tmp_path / "a.glb", FIGURE, q, np.zeros(1), up=up)
        placed = Glb(tmp_path / "a.glb")
        where = placed.placed(placed.nodes)
        expected = expected_points(q, up)[0]
        assert max(np.abs(where[point] - expected[k]).max() for point, k in POINT.items()) < ASKED
        assert "animations" not in placed.json

    def test_trimesh_opens_it(self, rng: np.random.Generator, tmp_path: Path) -> None:
        q = configurations(rng, 3)
        write_glb(tmp_path / "a.glb", FIGURE, q, np.arange(3.0))
        scene = trimesh.load_scene(tmp_path / "a.glb")
        expected = expected_points(q)[0]
        for point, k in POINT.items():
            assert np.abs(scene.graph.get(point)[0][:3, 3] - expected[k]).max() < ASKED
        assert set(scene.geometry) == {capsule.link for capsule in FIGURE.capsules}
        for capsule in FIGURE.capsules:
            mesh = scene.geometry[capsule.link]
            assert mesh.is_watertight
            node = next(node.name for node in BODY_NODES if node.link == capsule.link)
            points = trimesh.transform_points(mesh.vertices, scene.graph.get(node)[0])
            own = expected[None, list(capsule.points)]
            middle, axis = (row[0] for row in capsule.place(own))
            along = np.clip((points - middle) @ axis, -capsule.half_length, capsule.half_length)
            apart = np.linalg.norm(points - middle - along[:, None] * axis, axis=1)
            np.testing.assert_allclose(apart, capsule.radius, rtol=0, atol=1e-6)

    def test_sides_have_their_colours(self, tmp_path: Path) -> None:
        write_glb(tmp_path / "a.glb", FIGURE, pin.neutral(FIGURE.model)[None], np.zeros(1))
        glb = Glb(tmp_path / "a.glb").json
        colours = {
            mesh["name"]: glb["materials"][mesh["primitives"][0]["material"]]["name"]
            for mesh in glb["meshes"]
        }
        assert colours["right_thigh"] == "right"
        assert colours["left_forearm"] == "left"
        assert colours["torso"] == colours["hips"] == colours["head"] == "trunk"

    def test_angles_that_are_not_known(self, rng: np.random.Generator, tmp_path: Path) -> None:
        q = configurations(rng, 3)
        q[1, -1] = np.nan
        with pytest.raises(InputError, match="no value for"):
            write_glb(tmp_path / "a.glb", FIGURE, q, np.arange(3.0))
        write_glb(tmp_path / "a.glb", FIGURE, q, np.arange(3.0), unknown="hold")
        q[1, -1] = q[0, -1]
        placed = Glb(tmp_path / "a.glb").at(1.0)
        assert np.abs(placed["right_ankle"] - expected_points(q)[1, POINT["right_ankle"]]).max() < ASKED

    @pytest.mark.parametrize(
        ("change", "says"),
        [
            (lambda q, t: (q[:, 1:], t), "q: got shape"),
            (lambda q, t: (q, t[:-1]), "time: got shape"),
            (lambda q, t: (q, t * 0), r"time\[1\]"),
            (lambda q, t: (q, np.array([0.0, 1e9, 1e9 + 1])), "differ in float32"),
            (lambda q, t: (q * np.inf, t), "got -?inf|got nan"),
        ],
    )
    def test_refuses_what_is_no_motion(
        self, change: Callable, says: str, rng: np.random.Generator, tmp_path: Path
    ) -> None:
        q, time = change(configurations(rng, 3), np.arange(3.0))
        with pytest.raises(InputError, match=says) as caught:
            write_glb(tmp_path / "a.glb", FIGURE, q, time)
        assert "\n" not in str(caught.value)
        assert list(tmp_path.iterdir()) == []

    def test_registered(self) -> None:
        assert GLB_FORMAT.suffixes == (".glb",)
        assert GLB_FORMAT.read is read_glb
        assert GLB_FORMAT.write_configurations is write_glb


class TestPostures:
    def test_one_coloured_body_a_survivor(self, rng: np.random.Generator, tmp_path: Path) -> None:
        q = configurations(rng, 8)
        write_postures_glb(tmp_path / "a.glb", FIGURE, q)
        scene = trimesh.load_scene(tmp_path / "a.glb")
        expected = expected_points(q)
        for k in range(8):
            for point, column in POINT.items():
                place = scene.graph.get(f"survivor_{k}.{point}")[0][:3, 3]
                assert np.abs(place - expected[k, column]).max() < ASKED
        assert len(scene.geometry) == 8 * len(FIGURE.capsules)
        materials = Glb(tmp_path / "a.glb").json["materials"]
        colours = {tuple(material["pbrMetallicRoughness"]["baseColorFactor"]) for material in materials}
        assert len(colours) == 8
        # The triangles are there once.
        assert len(Glb(tmp_path / "a.glb").json["accessors"]) == 3 * len(FIGURE.capsules)

    def test_names_and_colours(self, rng: np.random.Generator, tmp_path: Path) -> None:
        rgb = np.array([[1.0, 0, 0], [0, 0.5, 1]])
        write_postures_glb(
            tmp_path / "a.glb", FIGURE, configurations(rng, 2), names=["first", "второй"], colours=rgb
        )
        glb = Glb(tmp_path / "a.glb")
        assert {"first", "второй", "второй.left_knee"} <= set(glb.index)
        assert glb.json["materials"][1]["pbrMetallicRoughness"]["baseColorFactor"] == [0, 0.5, 1, 1]

    def test_what_is_not_known_is_left_out(self, rng: np.random.Generator, tmp_path: Path) -> None:
        q = configurations(rng, 4)
        at = {name: k for k, name in enumerate(FIGURE.configuration_names)}
        q[0, [at["right_shoulder_rotation"], at["right_elbow_flexion"]]] = np.nan  # the wrist is not known
        q[1, [at[f"left_hip_{turn}"] for turn in ("flexion", "abduction", "rotation")]] = np.nan
        q[1, at["left_knee_flexion"]] = np.nan  # neither knee nor ankle
        q[2, [at[f"pelvis_{turn}"] for turn in ("flexion", "bending", "rotation")]] = np.nan  # no legs
        write_postures_glb(tmp_path / "a.glb", FIGURE, q)
        glb = Glb(tmp_path / "a.glb")
        placed = glb.placed(glb.nodes)
        lost = {
            0: {"right_wrist"},
            1: {"left_knee", "left_ankle"},
            2: {f"{side}_{part}" for side in ("right", "left") for part in ("hip", "knee", "ankle")},
            3: set(),
        }
        for k, names in lost.items():
            there = {point for point in POINTS if f"survivor_{k}.{point}" in placed}
            assert there == set(POINTS) - names
            whole = q[[k]].copy()
            whole[np.isnan(whole)] = 0.0
            expected = expected_points(whole)[0]
            for point in there:
                assert np.abs(placed[f"survivor_{k}.{point}"] - expected[POINT[point]]).max() < ASKED
        meshes = {node["name"] for node in glb.nodes if "mesh" in node}
        assert "survivor_0.right_shoulder" in meshes
        assert "survivor_0.right_elbow" not in meshes
        assert "survivor_2.pelvis" not in meshes
        assert "survivor_2.torso" in meshes

    def test_known_points_move_with_nothing_that_is_not_known(self, rng: np.random.Generator) -> None:
        """Whatever an unknown angle is, the points that are called known stay."""
        q = configurations(rng, 40)
        hidden = rng.random((40, 22)) < 0.15
        masked, other = q.copy(), q.copy()
        columns = FIGURE.angle_index
        masked[:, columns] = np.where(hidden, np.nan, q[:, columns])
        other[:, columns] = np.where(hidden, q[:, columns] + 0.3, q[:, columns])
        moved = np.abs(FIGURE.forward_kinematics(other) - FIGURE.forward_kinematics(q)).max(axis=-1) > 1e-9
        places = [next(k for k, node in enumerate(BODY_NODES) if node.name == point) for point in POINTS]
        known = known_nodes(FIGURE, masked)[:, places] > 0
        assert not (moved & known).any()
        assert (moved | known).mean() > 0.9  # and few are called unknown that did not move

    @pytest.mark.parametrize(
        ("given", "says"),
        [
            ({"names": ["a"]}, "names: got"),
            ({"names": ["a", "a"]}, "2 different names"),
            ({"names": ["a", ""]}, "names: got"),
            ({"names": ["a", "b\n"]}, "names: got"),
            ({"colours": np.zeros((2, 4))}, r"colours: got shape \(2, 4\)"),
            ({"colours": np.full((2, 3), np.nan)}, "numbers from 0 to 1"),
            ({"up": "z"}, "up: got"),
        ],
    )
    def test_refuses_wrong_names_and_colours(
        self, given: dict[str, Any], says: str, rng: np.random.Generator, tmp_path: Path
    ) -> None:
        with pytest.raises(InputError, match=says) as caught:
            write_postures_glb(tmp_path / "a.glb", FIGURE, configurations(rng, 2), **given)
        assert "\n" not in str(caught.value)

    def test_no_more_than_a_thousand(self, tmp_path: Path) -> None:
        with pytest.raises(InputError, match="1001 postures"):
            write_postures_glb(tmp_path / "a.glb", FIGURE, np.tile(pin.neutral(FIGURE.model), (1001, 1)))


class TestContainer:
    def test_numbers_stand_at_multiples_of_four_bytes(self, tmp_path: Path) -> None:
        file = GlbFile()
        odd = file.accessor(np.arange(3), UINT16_TYPE)
        after = file.accessor(np.array([[1.0, 2.0, 3.0]]), bounds=True)
        last = file.accessor(np.arange(5), UINT16_TYPE, target=INDEX_TARGET)
        file.append("nodes", {"name": "я"})
        file.write(tmp_path / "a.glb")
        glb = Glb(tmp_path / "a.glb")
        assert glb.values(odd).ravel().tolist() == [0, 1, 2]
        assert glb.values(after).tolist() == [[1, 2, 3]]
        assert glb.values(last).ravel().tolist() == [0, 1, 2, 3, 4]
        assert list(glb.index) == ["я"]

    def test_more_than_two_gigabytes_are_refused(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("posekit.formats.motion.glb_file.MAX_BYTES", 100)
        with pytest.raises(InputError, match="write fewer frames"):
            GlbFile().write(tmp_path / "a.glb")


class TestCapsule:
    @pytest.mark.parametrize("seed", range(4))
    def test_is_closed_outward_and_nearly_as_large(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        start, end = rng.normal(size=(2, 3))
        radius = 0.3
        mesh = capsule_mesh(start, end, radius)
        solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        assert solid.is_watertight
        assert solid.is_winding_consistent
        length = float(np.linalg.norm(end - start))
        volume = np.pi * radius**2 * (length + 4 / 3 * radius)
        assert 0.97 * volume < solid.volume < volume
        assert (np.einsum("fi,fi->f", solid.face_normals, mesh.normals[mesh.faces].mean(axis=1)) > 0.9).all()
        np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, rtol=0, atol=1e-12)
        assert 1 - np.cos(np.pi / RING_CORNERS) < 0.01
