"""C3D, GLB and BVH against their specifications: bytes that were written here, and what they mean."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import posekit
from posekit.motion import Motion
from posekit.skeleton import JOINTS, POINTS

FIGURE = posekit.load_figure()
ORDER = {84: "<", 85: "<", 86: ">"}


def standing(frames: int = 3) -> Any:
    """Return places (T, 14, 3) of a figure that stands and moves, y up, metres."""
    joints = FIGURE.neutral_points[:14, [1, 2, 0]] + [0.0, 1.5, 0.0]
    return joints + np.linspace(0, 0.25, frames)[:, None, None] * [0.0, 0.0, 1.0]


def floats(values: Any, processor: int) -> bytes:
    """Write 32-bit floats; a DEC float has four times the value and its 16-bit halves exchanged."""
    data = np.asarray(values, dtype="<f4")
    if processor == 85:
        return (data * np.float32(4)).view("<u2").reshape(-1, 2)[:, ::-1].tobytes()
    return data.astype(f"{ORDER[processor]}f4").tobytes()


def parameter(group: int, name: str, value: Any, processor: int, *, locked: bool = False) -> bytes:
    """Write a parameter: texts, 16-bit integers, or floats."""
    order = ORDER[processor]
    if isinstance(value, list) and value and isinstance(value[0], str):
        width = max(map(len, value))
        kind, size, body = -1, (width, len(value)), "".join(one.ljust(width) for one in value).encode()
    elif np.asarray(value).dtype.kind == "i":
        kind, size, body = 2, np.shape(value), np.asarray(value).astype(f"{order}u2").tobytes()
    else:
        kind, size, body = 4, np.shape(value), floats(np.ravel(value), processor)
    rest = struct.pack("bB", kind, len(size)) + bytes(size) + body + b"\0"
    length = -len(name) if locked else len(name)
    return struct.pack("bb", length, group) + name.encode() + struct.pack(f"{order}H", 2 + len(rest)) + rest


def c3d(
    points: Any,
    names: list[str],
    *,
    processor: int = 84,
    scale: float = -1.0,
    analogues: int = 0,
    header_rate: float = 0.0,
    last: int | None = None,
    point: dict[str, Any] | None = None,
    trial: dict[str, Any] | None = None,
) -> bytes:
    """Write points (T, P, 3), NaN where not seen, as The C3D File Format User Guide has it."""
    order = ORDER[processor]
    half = len(names) // 2
    about = {"USED": len(names), "SCALE": scale, "LABELS": names[:half], "LABELS2": names[half:]}
    groups = {"TRIAL": (7, trial or {}), "POINT": (3, {**about, **(point or {})})}
    section = bytearray(b"\0\0\0" + bytes([processor]))
    for name, (number, held) in groups.items():
        section += struct.pack("bb", len(name), -number) + name.encode()
        section += struct.pack(f"{order}HB", 3, 0)
        for k, (key, value) in enumerate(held.items()):
            section += parameter(number, key, value, processor, locked=k % 2 == 1)
    section += b"\0\0"
    blocks = -(-len(section) // 512)
    head = struct.pack(f"{order}5H", len(names), analogues, 1, last or len(points), 10)
    head = bytes([2, 0x50]) + head + floats([scale], processor)
    head += struct.pack(f"{order}2H", 2 + blocks, 1) + floats([header_rate], processor)
    missing = np.isnan(points).any(axis=2)
    four = np.concatenate([np.where(missing[..., None], 7.0, points), missing[..., None] * -1.0], axis=2)
    four[..., :3] /= scale if scale > 0 else 1.0
    rows = np.hstack([four.reshape(len(points), -1), np.full((len(points), analogues), 123.0)])
    body = floats(rows.ravel(), processor) if scale < 0 else rows.round().astype(f"{order}i2").tobytes()
    return head.ljust(512, b"\0") + bytes(section).ljust(512 * blocks, b"\0") + body


@pytest.mark.parametrize("analogues", [0, 5])
@pytest.mark.parametrize(("scale", "error"), [(-1.0, 2e-4), (0.25, 0.126)])
@pytest.mark.parametrize("processor", ORDER)
def test_c3d_of_every_processor_is_read(
    tmp_path: Path, processor: int, scale: float, error: float, analogues: int
) -> None:
    points = 1000.0 * standing(4)
    points[2, 5] = np.nan
    about = {"RATE": 120.0, "UNITS": ["mm"], "X_SCREEN": ["+Z"], "Y_SCREEN": ["+Y"], "SHAPE": [[1.0, 2.0]]}
    data = c3d(
        points,
        list(JOINTS),
        processor=processor,
        scale=scale,
        analogues=analogues,
        header_rate=60.0,
        point=about,
    )
    (tmp_path / "lab.c3d").write_bytes(data)
    found = posekit.open(tmp_path / "lab.c3d")
    assert found.joint_names == JOINTS and (found.unit, found.up) == ("mm", "+y")
    np.testing.assert_allclose(1000 * found.joints, points, atol=error)
    assert found.rate == pytest.approx(120.0) and found.time[0] == 0


@pytest.mark.parametrize(
    ("header", "own", "rate"),
    [(50.0, [], 50.0), (50.0, [100.0], 100.0), (50.0, [0.0], 50.0), (0.0, [], None)],
)
def test_the_rate_of_c3d_is_its_parameters_or_the_headers(
    tmp_path: Path, header: float, own: list[float], rate: float | None
) -> None:
    point = {"RATE": own[0]} if own else {}
    (tmp_path / "a.c3d").write_bytes(c3d(standing(), list(JOINTS), header_rate=header, point=point))
    found = posekit.open(tmp_path / "a.c3d").rate
    assert found == (None if rate is None else pytest.approx(rate))


@pytest.mark.parametrize(
    ("point", "trial"),
    [
        ({"LONG_FRAMES": 65540.0}, {}),
        ({"FRAMES": 65540.0}, {}),
        ({}, {"ACTUAL_START_FIELD": [3, 0], "ACTUAL_END_FIELD": [6, 1]}),
        ({}, {"ACTUAL_START_FIELD": [65534, 0], "ACTUAL_END_FIELD": [1, 2]}),
    ],
)
def test_c3d_of_more_frames_than_its_header_counts(
    tmp_path: Path, point: dict[str, Any], trial: dict[str, Any]
) -> None:
    points = np.ones((65540, 2, 3)) * np.arange(65540)[:, None, None] / 4
    points[:, 1] += 1
    data = c3d(points, ["M1", "M2"], scale=0.5, last=65535, point=point, trial=trial)
    (tmp_path / "long.c3d").write_bytes(data)
    assert len(posekit.open(tmp_path / "long.c3d", unit="mm")) == 65540
    (tmp_path / "long.c3d").write_bytes(c3d(points, ["M1", "M2"], scale=0.5, last=65535))
    if not trial:
        return
    with pytest.raises(posekit.InputError, match="the number in POINT:LONG_FRAMES") as error:
        big = np.ones((65700, 2, 3))
        (tmp_path / "long.c3d").write_bytes(c3d(big, ["M1", "M2"], scale=0.5, last=65535))
        posekit.open(tmp_path / "long.c3d")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("place", "value", "says"),
    [
        (slice(0, 1), b"\1", "C3D, whose second byte is 50"),
        (slice(1, 2), b"\x51", "expected"),
        (slice(0, 1), b"\x70", "a section of parameters"),
        (slice(515, 516), b"\x53", "a section of parameters"),
        (slice(515, 516), b"\x57", "a section of parameters"),
        (slice(2, 4), b"\0\0", "points in space"),
        (slice(16, 18), b"\1\0", "frames after the parameters"),
        (slice(16, 18), b"\2\0", "frames after the parameters"),
        (slice(16, 18), b"\x60\0", "frames after the parameters"),
        (slice(6, 8), b"\4\0", "the last not before the first"),
        (slice(8, 10), b"\x09\0", "for 9 frames of 14 points"),
    ],
)
def test_damaged_c3d_is_refused_by_its_field(tmp_path: Path, place: slice, value: bytes, says: str) -> None:
    data = bytearray(c3d(standing(), list(JOINTS)))
    data[place] = value
    (tmp_path / "bad.c3d").write_bytes(data)
    with pytest.raises(posekit.InputError, match=says) as error:
        posekit.open(tmp_path / "bad.c3d")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("kept", [511, 600, 1023, -1])
def test_c3d_that_is_cut_off_is_refused(tmp_path: Path, kept: int) -> None:
    whole = c3d(standing(), list(JOINTS))
    (tmp_path / "cut.c3d").write_bytes(whole[:kept])
    with pytest.raises(posekit.InputError, match="export it again"):
        posekit.open(tmp_path / "cut.c3d")
    (tmp_path / "cut.c3d").write_bytes(whole)
    assert len(posekit.open(tmp_path / "cut.c3d")) == 3


def gltf(path: Path) -> tuple[dict[str, Any], list[Any]]:
    """Read a GLB file: its document, and the numbers of its accessors."""
    data = path.read_bytes()
    magic, version, size, length, kind = struct.unpack_from("<4sIII4s", data)
    assert (magic, version, size, kind) == (b"glTF", 2, len(data), b"JSON")
    document = json.loads(data[20 : 20 + length])
    rest, binary = struct.unpack_from("<I4s", data, 20 + length)
    body = data[28 + length :]
    assert binary == b"BIN\0" and rest == len(body) == document["buffers"][0]["byteLength"]
    numbers = []
    for one in document["accessors"]:
        view = document["bufferViews"][one["bufferView"]]
        own = body[view["byteOffset"] :][: view["byteLength"]]
        assert view["byteOffset"] % 4 == 0
        values = np.frombuffer(own, {5126: "<f4", 5123: "<u2"}[one["componentType"]]).astype(float)
        values = values.reshape(one["count"], {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[one["type"]])
        for name, end in (("min", values.min(axis=0)), ("max", values.max(axis=0))):
            if name in one:
                np.testing.assert_allclose(one[name], end, rtol=1e-6, atol=1e-7)
        numbers.append(values)
    return document, numbers


def nodes_in_world(document: dict[str, Any], numbers: list[Any], frame: int) -> dict[str, tuple[Any, Any]]:
    """Return rotation and place of each node in a frame of the animation."""
    moved: dict[int, dict[str, Any]] = {}
    for one in document.get("animations", [{"channels": []}])[0]["channels"]:
        sampler = document["animations"][0]["samplers"][one["sampler"]]
        target = one["target"]
        moved.setdefault(target["node"], {})[target["path"]] = numbers[sampler["output"]][frame]
    found = {}

    def visit(k: int, R: Any, t: Any) -> None:
        node = {**document["nodes"][k], **moved.get(k, {})}
        t = t + R @ np.asarray(node.get("translation", [0.0, 0.0, 0.0]))
        R = R @ Rotation.from_quat(node.get("rotation", [0.0, 0.0, 0.0, 1.0])).as_matrix()
        found[node["name"]] = R, t
        for child in node.get("children", []):
            visit(child, R, t)

    for root in document["scenes"][document["scene"]]["nodes"]:
        visit(root, np.eye(3), np.zeros(3))
    return found


def turning(frames: int, up: str = "+z") -> Any:
    """Return a figure far from the origin whose angles all change."""
    rng = np.random.default_rng(4)
    q = np.tile(FIGURE.neutral, (frames, 1))
    ends = rng.uniform(FIGURE.limits.lower, FIGURE.limits.upper, (2, len(FIGURE.limits.lower)))
    share = np.linspace(0, 1, frames)[:, None]
    q[:, FIGURE.angle_index] = (1 - share) * ends[0] + share * ends[1]
    q[:, :3] = [120.3, -45.2, 1.4] + share * [0.5, 1.0, 0.2]
    turn = Rotation.from_rotvec(share * [0.5, -0.3, 3.0])
    q[:, 3:7] = turn.as_quat()
    return Motion(
        joints=FIGURE.forward_kinematics(q), joint_names=POINTS, q=q, q_names=FIGURE.configuration_names,
        robot="figure", time=1.0 + np.arange(frames) / 25, up="+z",
    ).rotated(up)  # fmt: skip


@pytest.mark.parametrize("up", ["+z", "+y", "-x"])
def test_nodes_of_glb_move_as_the_joints_do(tmp_path: Path, up: str) -> None:
    motion = turning(9, up)
    posekit.save(motion, tmp_path / "walk.glb")
    document, numbers = gltf(tmp_path / "walk.glb")
    animation = document["animations"][0]
    time = numbers[animation["samplers"][0]["input"]][:, 0]
    np.testing.assert_allclose(time, np.arange(9) / 25, atol=1e-7)
    expected = motion.rotated("+y")
    quaternions = [
        numbers[one["output"]] for one in animation["samplers"] if numbers[one["output"]].shape[1] == 4
    ]
    for turns in quaternions:
        assert (np.einsum("ti,ti->t", turns[1:], turns[:-1]) >= 0).all()
    assert len(quaternions) > 8
    for frame in range(9):
        found = nodes_in_world(document, numbers, frame)
        for name, place in zip(expected.joint_names, expected.joints[frame], strict=True):
            np.testing.assert_allclose(found[name][1], place, atol=2e-5, err_msg=name)


def test_bodies_of_glb_are_closed_capsules_on_the_links(tmp_path: Path) -> None:
    motion = turning(1)
    posekit.save(motion, tmp_path / "one.glb")
    document, numbers = gltf(tmp_path / "one.glb")
    found = nodes_in_world(document, numbers, 0)
    points = motion.rotated("+y").joints
    capsules = {one.link: one for one in FIGURE.capsules}
    meshes = [node for node in document["nodes"] if "mesh" in node]
    assert len(meshes) == len(capsules)
    ends = []
    for node in meshes:
        part = document["meshes"][node["mesh"]]["primitives"][0]
        vertices, normals = (numbers[part["attributes"][name]] for name in ("POSITION", "NORMAL"))
        faces = numbers[part["indices"]].astype(int).reshape(-1, 3)
        edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        assert {tuple(one) for one in edges} == {tuple(one) for one in edges[:, ::-1]}
        assert len({tuple(one) for one in edges}) == len(edges)
        corners = vertices[faces]
        outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert (np.einsum("fi,fi->f", outward, normals[faces].mean(axis=1)) > 0).all()
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)
        volume = np.einsum("fi,fi->f", corners[:, 0], outward).sum() / 6
        R, t = found[node["name"]]
        world = vertices @ R.T + t
        gap, nearest = np.inf, None
        for one in capsules.values():
            middle, axis = (each[0] for each in one.place(points))
            along = np.clip((world - middle) @ axis, -one.half_length, one.half_length)
            off = np.linalg.norm(world - middle - along[:, None] * axis, axis=1)
            if np.abs(off - one.radius).max() < gap:
                gap, nearest = np.abs(off - one.radius).max(), one
        assert gap < 1e-4 and nearest is not None
        r, h = nearest.radius, 2 * nearest.half_length
        assert 0.94 < volume / (np.pi * r**2 * (h + 4 * r / 3)) < 1.0
        ends.append(nearest.link)
    assert sorted(ends) == sorted(capsules)


@pytest.mark.parametrize(("processor", "scale"), [(84, -1.0), (86, -1.0), (84, 0.1), (85, 0.1), (86, 0.1)])
def test_a_repaired_c3d_keeps_its_other_points_and_its_analogue_values(
    tmp_path: Path, processor: int, scale: float
) -> None:
    """Only the points of the body move, only where the whole body jumped; every other byte stays."""
    names, count = list(FIGURE.configuration_names), 60
    q = np.tile(FIGURE.neutral, (count, 1))
    for name, middle, size in (("right_shoulder_flexion", 0.6, 0.5), ("left_elbow_flexion", 0.9, 0.4)):
        q[:, names.index(name)] = middle + size * np.sin(np.arange(count) / 8)
    q[:, 2] = 1.4
    joints = FIGURE.points(q)
    joints[40] += [0.3, 0.0, 0.0]
    sword = np.full((count, 1, 3), 0.12)
    points = 1000 * np.concatenate([joints[:, :7], sword, joints[:, 7:]], axis=1)
    labels = [*JOINTS[:7], "sword", *JOINTS[7:]]
    about = {"RATE": 30.0, "UNITS": ["mm"], "X_SCREEN": ["+Y"], "Y_SCREEN": ["+Z"]}
    given = c3d(points, labels, processor=processor, scale=scale, analogues=5, point=about)
    (tmp_path / "given.c3d").write_bytes(given)
    assert not posekit.validate(tmp_path / "given.c3d").ok.all()
    posekit.repair(tmp_path / "given.c3d", tmp_path / "repaired.c3d")
    assert posekit.validate(tmp_path / "repaired.c3d").ok.all()
    made = (tmp_path / "repaired.c3d").read_bytes()
    row = (4 * len(labels) + 5) * (4 if scale < 0 else 2)
    start = len(given) - count * row
    changed = np.flatnonzero(np.frombuffer(given, np.uint8) != np.frombuffer(made, np.uint8))
    number = (changed - start) % row // (4 if scale < 0 else 2)
    assert len(made) == len(given) and set((changed - start) // row) == {40}
    assert set(number // 4) == set(range(15)) - {7}


@pytest.mark.parametrize("ending", [".glb", ".bvh", ".trc", ".c3d"])
def test_alternative_postures_are_refused_by_formats_of_one_recording(tmp_path: Path, ending: str) -> None:
    alternatives = posekit.recover(posekit.builtin_view("seq1")).motion("all")
    with pytest.raises(posekit.InputError, match="several postures per frame"):
        posekit.save(alternatives, tmp_path / f"every{ending}")


def bvh_places(text: str) -> tuple[dict[str, Any], float]:
    """Place the joints of a BVH file by its own definition: translate by offset, then turn by the channels in order."""
    head, _, rows = text.partition("MOTION\n")
    values = np.array([row.split() for row in rows.strip().split("\n")[2:]], dtype=float)
    step = float(rows.split("Frame Time:")[1].split()[0])
    places: dict[str, Any] = {}
    stack: list[Any] = []
    column, name = 0, ""
    for line in head.split("\n"):
        words = line.split()
        if not words:
            continue
        if words[0] in ("ROOT", "JOINT", "End"):
            name = words[1] if words[0] != "End" else ""
        elif words[0] == "OFFSET":
            R, t = stack[-1] if stack else (np.eye(3)[None], np.zeros((1, 3)))
            t = t + R @ np.array(words[1:], dtype=float)
            stack.append((R, t))
        elif words[0] == "CHANNELS":
            R, t = stack.pop()
            for word in words[2:]:
                own, axis = values[:, column], "XYZ".index(word[0])
                column += 1
                if word.endswith("position"):
                    t = t + own[:, None] * np.eye(3)[axis]
                else:
                    R = R @ Rotation.from_euler(word[0].lower(), own[:, None], degrees=True).as_matrix()
            stack.append((R, t))
            places[name] = t
        elif words[0] == "}":
            stack.pop()
    return places, step


@pytest.mark.parametrize("unit", ["cm", "m", "in"])
def test_bvh_places_the_joints_by_its_own_definition(tmp_path: Path, unit: str) -> None:
    motion = turning(12)
    posekit.save(motion, tmp_path / "walk.bvh", unit=unit)
    places, step = bvh_places((tmp_path / "walk.bvh").read_text())
    assert step == pytest.approx(1 / 25)
    expected = motion.rotated("+y").figure_joints
    names = {
        "Hips": "pelvis",
        "RightArm": "right_shoulder",
        "LeftForeArm": "left_elbow",
        "LeftHand": "left_wrist",
    }
    names |= {"RightUpLeg": "right_hip", "RightLeg": "right_knee", "LeftFoot": "left_ankle"}
    metres = {"cm": 0.01, "m": 1.0, "in": 0.0254}[unit]
    for theirs, ours in names.items():
        np.testing.assert_allclose(metres * places[theirs], expected[:, JOINTS.index(ours)], atol=2e-6)
