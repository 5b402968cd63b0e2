"""Results into every format of motion, opened by other programs, and postures and motion from file to file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import bvh
import ezc3d
import numpy as np
import pandas
import pinocchio as pin
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import posekit
from posekit.formats import own as files
from posekit.formats.motion import read_motion
from posekit.formats.motion.urdf_folder import LINK_OF
from posekit.formats.own import OpenCVModel, View
from posekit.geometry import Array
from posekit.recovery.result import result_of
from posekit.skeleton import HEAD_POINTS, JOINT, JOINTS
from posekit.synthesis import Walker, walker_scene

FRAMES, RATE = 8, 25.0
TO_WORLD: Final = 1e-6
"""Metres: what a reader may find a joint off."""


class Recovered(NamedTuple):
    folder: Path
    joints: Array
    """Of the first survivor of every frame (F, 14, 3), camera frame."""
    answered: Array
    """Of the answer's posture."""
    probable: Array
    """Of the one that ranks first."""
    world: Array
    """The answers in the camera's world, y up."""
    counts: list[int]
    time: Array


@pytest.fixture(scope="module")
def recovered(walking: View, tmp_path_factory: pytest.TempPathFactory) -> Recovered:
    folder = tmp_path_factory.mktemp("result")
    recovery = posekit.recover(walking)
    result = result_of(recovery, unit="m")
    files.write_result(folder / "held.npz", result)
    settings = {name: value for name, value in result.settings.items() if name != "camera"}
    result = replace(result, settings=settings)  # as those of earlier versions, which hold no camera
    files.write_result(folder / "result.npz", result)
    files.write_result(folder / "result.json", result)
    files.write_view(folder / "view.json", walking)
    result = files.read_result(folder / "result.npz")
    first = np.stack(
        [frame.joints[answer.rows[0]] for frame, answer in zip(result.frames, recovery.answers, strict=True)]
    )
    order = [probability.argmax() for probability in recovery.probability]
    probable = np.stack([frame.joints[k] for frame, k in zip(result.frames, order, strict=True)])
    model = walking.camera
    assert isinstance(model, OpenCVModel)
    assert model.R is not None
    assert model.t is not None
    return Recovered(
        folder=folder,
        joints=np.stack([frame.joints[0] for frame in result.frames]),
        answered=first,
        probable=probable,
        world=(first - model.t) @ model.R,
        counts=[len(frame.joints) for frame in result.frames],
        time=walking.time,
    )


def held_level(points: Array) -> Array:
    """Turn a camera's frame about x, so that y points up and z to the camera: as z would point up, then y."""
    return np.asarray(points * [1.0, -1.0, -1.0])


def depth_ahead(points: Array) -> Array:
    """Turn a camera's frame about x, so that z points up and y away from the camera."""
    return np.stack([points[..., 0], points[..., 2], -points[..., 1]], axis=-1)


def z_up(points: Array) -> Array:
    """Turn y up to z up: x stays."""
    return np.stack([points[..., 0], -points[..., 2], points[..., 1]], axis=-1)


def read_trc(path: Path) -> tuple[Array, Array]:
    names = path.read_text().splitlines()[3].split("\t")[2::3][: len(JOINTS)]
    table = pandas.read_csv(path, sep="\t", skiprows=5, header=None)
    assert path.read_text().splitlines()[2].split("\t")[4] == "m"
    points = table.iloc[:, 2 : 2 + 3 * len(JOINTS)].to_numpy().reshape(len(table), len(JOINTS), 3)
    return points[:, [names.index(name) for name in JOINTS]], table[1].to_numpy()


def read_c3d(path: Path) -> tuple[Array, Array]:
    found = ezc3d.c3d(str(path))
    point = found["parameters"]["POINT"]
    scale = {"m": 1.0, "mm": 0.001}[point["UNITS"]["value"][0]]
    names = point["LABELS"]["value"]
    points = found["data"]["points"][:3, [names.index(name) for name in JOINTS]] * scale
    return points.transpose(2, 1, 0), np.arange(points.shape[2]) / point["RATE"]["value"][0]


def read_table(path: Path) -> tuple[Array, Array]:
    table = pandas.read_csv(path) if path.suffix == ".csv" else pandas.read_parquet(path)
    columns = [f"{name}_{axis}" for name in JOINTS for axis in "xyz"]
    return table[columns].to_numpy().reshape(len(table), len(JOINTS), 3), table["time"].to_numpy()


def read_npz(path: Path) -> tuple[Array, Array]:
    with np.load(path) as arrays:
        names = arrays["joint_names"].tolist()
        points = arrays["joints"][:, [names.index(name) for name in JOINTS]]
        return points, np.arange(len(points)) / float(arrays["clip_fps"][0])


READERS = {"trc": read_trc, "c3d": read_c3d, "csv": read_table, "parquet": read_table, "npz": read_npz}


@pytest.mark.parametrize("up", ["", "+y"])
def test_a_result_stands_in_the_world_of_the_camera_that_it_holds(
    up: str, recovered: Recovered, command: Callable[..., Any], tmp_path: Path
) -> None:
    held = files.read_result(recovered.folder / "held.npz")
    held = replace(held, settings={**held.settings, "camera": {**held.settings["camera"], "up": up or None}})
    files.write_result(tmp_path / "held.json", held)
    done = command("convert", tmp_path / "held.json", tmp_path / "out.trc")
    assert "in the camera's world, where +y is up" in done.out
    points, _ = read_trc(tmp_path / "out.trc")
    np.testing.assert_allclose(points, recovered.world, rtol=0, atol=TO_WORLD)
    with_view = ("--view", recovered.folder / "view.json")
    for words, name in (((), "without.bvh"), (with_view, "with.bvh")):
        assert command("convert", tmp_path / "held.json", tmp_path / name, *words).code == 0
    assert (tmp_path / "without.bvh").read_bytes() == (tmp_path / "with.bvh").read_bytes()
    # An axis that is stated is that of the camera's frame.
    done = command("convert", tmp_path / "held.json", tmp_path / "level.trc", "--input-up", "-y")
    np.testing.assert_allclose(
        read_trc(tmp_path / "level.trc")[0], held_level(recovered.answered), rtol=0, atol=TO_WORLD
    )


def test_a_result_whose_camera_is_none_is_refused(
    recovered: Recovered, command: Callable[..., Any], tmp_path: Path
) -> None:
    held = files.read_result(recovered.folder / "held.npz")
    wrong = replace(held, settings={**held.settings, "camera": {"model": "opencv", "K": [[1, 2, 3]]}})
    files.write_result(tmp_path / "wrong.json", wrong)
    done = command("convert", tmp_path / "wrong.json", tmp_path / "out.bvh")
    assert done.code == 2
    assert "settings.camera of the result" in done.err


@pytest.mark.parametrize("name", READERS)
def test_points_stand_in_the_camera_frame_or_its_world(
    name: str, recovered: Recovered, command: Callable[..., Any], tmp_path: Path
) -> None:
    reader = READERS[name]
    out, result = tmp_path / f"out.{name}", recovered.folder / "result.npz"
    done = command("convert", result, out, "--view", recovered.folder / "view.json")
    assert done.code == 0, done.err
    assert "in the camera's world, where +y is up" in done.out
    points, time = reader(out)
    expected = z_up(recovered.world) if name == "c3d" else recovered.world
    np.testing.assert_allclose(points, expected, rtol=0, atol=TO_WORLD)
    np.testing.assert_allclose(time - time[0], recovered.time - recovered.time[0], rtol=0, atol=1e-6)
    done = command("convert", result, out)
    assert done.code == 0, done.err
    assert "in the camera's frame, as if it were held level" in done.out
    points, _ = reader(out)
    level = {"trc": held_level(recovered.answered), "c3d": depth_ahead(recovered.answered)}
    np.testing.assert_allclose(points, level.get(name, recovered.answered), rtol=0, atol=TO_WORLD)


@pytest.mark.parametrize("up", ["+y", "+z", "-x"])
@pytest.mark.parametrize("name", ["c3d", "npz", "csv", "parquet"])
def test_any_axis_may_point_up(
    name: str, up: str, recovered: Recovered, command: Callable[..., Any], tmp_path: Path
) -> None:
    reader = READERS[name]
    out = tmp_path / f"out.{name}"
    done = command(
        "convert", recovered.folder / "result.json", out, "--view", recovered.folder / "view.json", "--up", up
    )
    assert done.code == 0, done.err
    points, _ = reader(out)
    axis = np.eye(3)["xyz".index(up[1])] * (1 if up[0] == "+" else -1)
    heights = recovered.world[..., 1]
    np.testing.assert_allclose(points @ axis, heights, rtol=0, atol=TO_WORLD)
    assert same_hand(points[0], recovered.world[0])


@pytest.mark.parametrize("name", ["trc", "bvh", "glb"])
def test_formats_whose_axes_are_fixed_say_so(
    name: str, recovered: Recovered, command: Callable[..., Any], tmp_path: Path
) -> None:
    done = command("convert", recovered.folder / "result.npz", tmp_path / f"out.{name}", "--up", "+z")
    assert done.code == 2
    assert f"--up: got +z; expected +y, as in every file of {name}" in done.err
    assert not (tmp_path / f"out.{name}").exists()
    assert (
        command("convert", recovered.folder / "result.npz", tmp_path / f"out.{name}", "--up", "+y").code == 0
    )


def same_hand(a: Array, b: Array) -> bool:
    """Tell whether two sets of points are the same body turned, and not its mirror image."""
    R, rssd = Rotation.align_vectors(a - a.mean(axis=0), b - b.mean(axis=0))
    return float(rssd) < 1e-5 and np.linalg.det(R.as_matrix()) > 0


def test_a_number_chooses_a_survivor(
    recovered: Recovered, command: Callable[..., Any], tmp_path: Path
) -> None:
    out = tmp_path / "one.csv"
    assert command("convert", recovered.folder / "result.npz", out, "--posture", 0).code == 0
    np.testing.assert_allclose(read_table(out)[0], recovered.joints, rtol=0, atol=1e-12)
    many = command("convert", recovered.folder / "result.npz", out, "--posture", 8192)
    assert many.code == 2
    assert f"a number from 0 to {recovered.counts[0] - 1}, as frame 0 has" in many.err


def placed_by_bvh(path: Path) -> tuple[list[dict[str, Array]], float]:
    """Read with the `bvh` package, and place with SciPy's rotations."""
    document = bvh.Bvh(path.read_text())
    frames = []
    for frame in range(document.nframes):
        place: dict[str, tuple[Array, Rotation]] = {}
        for joint in document.get_joints():
            offset = np.array(document.joint_offset(joint.name))
            channels = document.joint_channels(joint.name)
            values = dict(
                zip(channels, document.frame_joint_channels(frame, joint.name, channels), strict=True)
            )
            turns = [channel for channel in channels if channel.endswith("rotation")]
            own = Rotation.from_euler("".join(c[0] for c in turns), [values[c] for c in turns], degrees=True)
            moved = np.array([values.get(f"{axis}position", 0.0) for axis in "XYZ"])
            parent = document.joint_parent(joint.name)
            if parent is None:
                place[joint.name] = (offset + moved, own)
            else:
                origin, R = place[parent.name]
                place[joint.name] = (origin + R.apply(offset), R * own)
        frames.append({name: 0.01 * where for name, (where, _) in place.items()})
    return frames, document.frame_time


BVH_NAMES = {"neck": "NeckBase", "pelvis": "Hips"} | {
    f"{side}_{part}": side.capitalize() + name
    for side in ("right", "left")
    for part, name in {
        "shoulder": "Arm",
        "elbow": "ForeArm",
        "wrist": "Hand",
        "hip": "UpLeg",
        "knee": "Leg",
        "ankle": "Foot",
    }.items()
}


@pytest.mark.parametrize("seen", [True, False], ids=["world", "camera"])
def test_bvh_and_glb_stand_upright(
    seen: bool, recovered: Recovered, command: Callable[..., Any], tmp_path: Path
) -> None:
    options = ["--view", recovered.folder / "view.json"] if seen else []
    expected = recovered.world if seen else held_level(recovered.answered)
    for name in ("bvh", "glb"):
        done = command("convert", recovered.folder / "result.npz", tmp_path / f"out.{name}", *options)
        assert done.code == 0, done.err
        assert "+y up" in done.out
    frames, step = placed_by_bvh(tmp_path / "out.bvh")
    assert step == pytest.approx(1 / RATE, abs=1e-6)
    placed = np.array([[frame[BVH_NAMES[name]] for name in JOINTS] for frame in frames])
    np.testing.assert_allclose(distances(placed), distances(expected), rtol=0, atol=TO_WORLD)
    np.testing.assert_allclose(placed[..., 1], expected[..., 1], rtol=0, atol=TO_WORLD)
    assert same_hand(placed.reshape(-1, 3), expected.reshape(-1, 3))
    assert (placed[:, JOINT["neck"], 1] > placed[:, JOINT["left_ankle"], 1] + 0.9).all()
    graph = trimesh.load_scene(tmp_path / "out.glb").graph
    rest = np.array([graph.get(name)[0][:3, 3] for name in JOINTS])
    np.testing.assert_allclose(rest, placed[0], rtol=0, atol=2e-6)


def distances(points: Array) -> Array:
    return np.asarray(np.linalg.norm(points[:, :, None] - points[:, None], axis=-1))


def place_by_pinocchio(urdf: Path, rows: Array) -> Array:
    model = pin.buildModelFromUrdf(str(urdf), pin.JointModelFreeFlyer())
    data = model.createData()
    found = []
    for q in rows:
        pin.framesForwardKinematics(model, data, q)
        ids = [model.getFrameId(LINK_OF[name]) for name in JOINTS]
        assert max(ids) < model.nframes
        found.append([data.oMf[k].translation.copy() for k in ids])
    return np.array(found)


def test_urdf_and_mot_are_placed_by_pinocchio(
    recovered: Recovered, command: Callable[..., Any], tmp_path: Path
) -> None:
    options = ["--view", recovered.folder / "view.json"]
    for name in ("person", "out.mot"):
        done = command("convert", recovered.folder / "result.npz", tmp_path / name, *options)
        assert done.code == 0, done.err
        assert "+z up" in done.out
    with np.load(tmp_path / "person" / "configurations.npz") as arrays:
        q, time, names = arrays["q"], arrays["time"], arrays["configuration_names"].tolist()
        assert arrays["up"] == "+z"
    expected = z_up(recovered.world)
    urdf = tmp_path / "person" / "figure.urdf"
    np.testing.assert_allclose(place_by_pinocchio(urdf, q), expected, rtol=0, atol=TO_WORLD)
    np.testing.assert_allclose(time, recovered.time, rtol=0, atol=1e-12)
    lines = (tmp_path / "out.mot").read_text().splitlines()
    table = pandas.read_csv(tmp_path / "out.mot", sep="\t", skiprows=lines.index("endheader") + 1)
    turns = Rotation.from_euler("ZYX", table[["torso_rz", "torso_ry", "torso_rx"]].to_numpy(), degrees=True)
    rows = np.concatenate(
        [table[["torso_tx", "torso_ty", "torso_tz"]], turns.as_quat(), np.radians(table[names[7:]])], axis=1
    )
    np.testing.assert_allclose(place_by_pinocchio(urdf, rows), expected, rtol=0, atol=TO_WORLD)


@pytest.mark.parametrize("name", ["csv", "npz", "parquet"])
def test_all_survivors_in_a_table(
    name: str, recovered: Recovered, command: Callable[..., Any], tmp_path: Path
) -> None:
    out = tmp_path / f"all.{name}"
    done = command("convert", recovered.folder / "result.npz", out, "--posture", "all")
    assert done.code == 0, done.err
    assert f"{sum(recovered.counts)} survivors of {FRAMES} frames, -y up" in done.out
    result = files.read_result(recovered.folder / "result.npz")
    if name == "npz":
        with np.load(out) as arrays:
            points, frame, rank = arrays["joints"], arrays["frame"], arrays["values/rank"]
            survivor = arrays["survivor"]
    else:
        points, _ = read_table(out)
        table = pandas.read_csv(out) if name == "csv" else pandas.read_parquet(out)
        frame, rank, survivor = (table[one].to_numpy() for one in ("frame", "rank", "survivor"))
        assert table["branches"].astype(str).str.len().max() <= 13
    expected = [result.frames[k].joints[row] for k, row in zip(frame, survivor, strict=True)]
    np.testing.assert_allclose(points, expected, rtol=0, atol=1e-12)
    assert np.bincount(frame).tolist() == recovered.counts
    np.testing.assert_allclose(points[rank == 1], recovered.probable, rtol=0, atol=1e-12)
    assert all(rank[frame == k].tolist() == list(range(1, n + 1)) for k, n in enumerate(recovered.counts))
    described = command("inspect", out)
    assert described.code == 0, described.err
    assert "a table of survivors" in described.out


def test_all_survivors_of_one_frame_in_glb(
    recovered: Recovered, command: Callable[..., Any], tmp_path: Path
) -> None:
    done = command("convert", recovered.folder / "result.npz", tmp_path / "all.glb", "--posture", "all")
    assert done.code == 0, done.err
    count = recovered.counts[0]
    assert f"the {count} survivors, of frame 0" in done.out
    graph = trimesh.load_scene(tmp_path / "all.glb").graph
    result = files.read_result(recovered.folder / "result.npz")
    for k, joints in enumerate(held_level(result.frames[0].joints)):
        placed = np.array([graph.get(f"survivor_{k}.{name}")[0][:3, 3] for name in JOINTS])
        np.testing.assert_allclose(distances(placed[None]), distances(joints[None]), rtol=0, atol=2e-6)
        np.testing.assert_allclose(placed[:, 1], joints[:, 1], rtol=0, atol=2e-6)


def test_postures_and_motion_go_on_from_file_to_file(
    recovered: Recovered, command: Callable[..., Any], tmp_path: Path
) -> None:
    """result → postures → trc → csv → npz → parquet → c3d: points stay what they are."""
    steps = ["postures.json", "a.trc", "b.csv", "c.npz", "d.parquet", "e.c3d"]
    options: list[object] = ["--view", recovered.folder / "view.json"]
    before = recovered.folder / "result.npz"
    for step in steps:
        done = command("convert", before, tmp_path / step, *options)
        assert done.code == 0, done.err
        before, options = tmp_path / step, []
    assert command("convert", tmp_path / "d.parquet", tmp_path / "f.bvh").code == 0
    for name in ("a.trc", "b.csv", "c.npz", "d.parquet"):
        points, _ = READERS[name.partition(".")[2]](tmp_path / name)
        np.testing.assert_allclose(points, recovered.world, rtol=0, atol=TO_WORLD)
    np.testing.assert_allclose(read_c3d(tmp_path / "e.c3d")[0], z_up(recovered.world), rtol=0, atol=TO_WORLD)
    postures = files.read_postures(tmp_path / "postures.json").joints
    np.testing.assert_allclose(postures, recovered.world, rtol=0, atol=1e-9)


def test_a_table_without_an_up_is_set_upright_or_as_it_is_told(
    recovered: Recovered, command: Callable[..., Any], tmp_path: Path
) -> None:
    given_file = tmp_path / "z.csv"
    view = recovered.folder / "view.json"
    assert (
        command("convert", recovered.folder / "result.npz", given_file, "--view", view, "--up", "+z").code
        == 0
    )
    done = command("convert", given_file, tmp_path / "z.trc")
    assert "+z is taken as up, along which heads are above ankles" in done.out
    np.testing.assert_allclose(read_trc(tmp_path / "z.trc")[0], recovered.world, rtol=0, atol=TO_WORLD)
    told = command("convert", given_file, tmp_path / "y.trc", "--input-up", "+y")
    assert told.code == 0
    np.testing.assert_allclose(read_trc(tmp_path / "y.trc")[0], z_up(recovered.world), rtol=0, atol=TO_WORLD)


def test_somebody_who_lies_needs_to_be_told_what_is_up(
    recovered: Recovered, command: Callable[..., Any], tmp_path: Path
) -> None:
    R = Rotation.align_vectors([[1.0, 1.0, 1.0]], [[0.0, 1.0, 0.0]])[0].as_matrix()
    files.write_postures(tmp_path / "lying.json", recovered.world @ R.T)
    refused = command("convert", tmp_path / "lying.json", tmp_path / "lying.bvh")
    assert refused.code == 2
    assert refused.err.strip().endswith("--input-up")
    for name in ("lying.bvh", "lying.csv"):
        done = command("convert", tmp_path / "lying.json", tmp_path / name, "--input-up", "+y", "--up", "+y")
        assert done.code == 0, done.err
    np.testing.assert_allclose(
        read_table(tmp_path / "lying.csv")[0], recovered.world @ R.T, rtol=0, atol=TO_WORLD
    )
    tilted = command(
        "convert", recovered.folder / "result.npz", tmp_path / "tilted.csv", "--input-up", "+x", "--up", "+y"
    )
    assert "in the camera's frame, +x up" in tilted.out
    np.testing.assert_allclose(
        read_table(tmp_path / "tilted.csv")[0][..., 1], recovered.answered[..., 0], rtol=0, atol=TO_WORLD
    )


def test_head_points_are_kept_where_a_file_has_them(command: Callable[..., Any], tmp_path: Path) -> None:
    scene = walker_scene(Walker(), frames=4, dt=0.1)
    up = np.array([1.0, -1.0, -1.0])
    postures = files.Postures(joints=scene.joints_cam * up, head=scene.head_cam * up)
    files.write_postures(tmp_path / "p.json", postures)
    assert command("convert", tmp_path / "p.json", tmp_path / "p.csv").code == 0
    table = pandas.read_csv(tmp_path / "p.csv")
    for k, name in enumerate(HEAD_POINTS):
        found = table[[f"{name}_{axis}" for axis in "xyz"]].to_numpy()
        assert postures.head is not None
        np.testing.assert_allclose(found, postures.head[:, k], rtol=0, atol=1e-12)


@pytest.fixture(scope="module")
def broken(walking: View, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write the result of noisy points: in one frame a wrist is where no arm reaches, in another it was not walking."""
    image = walking.image.copy()
    image[:, 1:] += np.random.default_rng(4).normal(scale=0.5, size=image[:, 1:].shape)  # the head stays
    image[3, JOINT["left_wrist"]] += 600.0
    image[5, JOINT["left_wrist"]] = np.nan
    path = tmp_path_factory.mktemp("broken") / "result.npz"
    recovery = posekit.recover(replace(walking, image=image), infer=False)
    assert [len(frame) > 0 for frame in recovery.frames] == [k != 3 for k in range(FRAMES)]
    files.write_result(path, result_of(recovery, unit="m"))
    return path


@pytest.mark.parametrize("name", ["trc", "csv", "npz", "parquet"])
def test_frames_without_a_posture_are_left_out_and_missing_joints_stay_missing(
    name: str, broken: Path, command: Callable[..., Any], tmp_path: Path
) -> None:
    done = command("convert", broken, tmp_path / f"out.{name}")
    assert done.code == 0, done.err
    assert f"1 of {FRAMES} frames without a posture are left out" in done.out
    if name == "npz":
        with np.load(tmp_path / "out.npz") as arrays:
            points = arrays["joints"][:, [arrays["joint_names"].tolist().index(one) for one in JOINTS]]
            time = arrays["time"]
    else:
        points, time = READERS[name](tmp_path / f"out.{name}")
    np.testing.assert_allclose(time, np.delete(np.arange(FRAMES), 3) / RATE, rtol=0, atol=1e-6)
    missing = np.argwhere(np.isnan(points[..., 0])).tolist()
    assert missing == [[4, JOINT["left_wrist"]]]


@pytest.mark.parametrize("name", ["bvh", "c3d"])
def test_formats_with_one_time_from_frame_to_frame_have_every_frame(
    name: str, broken: Path, command: Callable[..., Any], tmp_path: Path
) -> None:
    done = command("convert", broken, tmp_path / f"out.{name}")
    assert done.code == 0, done.err
    assert f"1 of {FRAMES} frames had no posture: interpolated" in done.out
    assert "1 unseen joint interpolated" in done.out
    written = read_motion(tmp_path / f"out.{name}")
    np.testing.assert_allclose(written.time, np.arange(FRAMES) / RATE, rtol=0, atol=1e-6)
    assert np.isfinite(written.points).all()


def test_gaps_are_filled_as_asked(broken: Path, command: Callable[..., Any], tmp_path: Path) -> None:
    points = {}
    for how in ("interpolate", "hold", "leave-out"):
        done = command("convert", broken, tmp_path / f"{how}.trc", "--gaps", how)
        assert done.code == 0, done.err
        points[how], _ = READERS["trc"](tmp_path / f"{how}.trc")
    assert [len(one) for one in points.values()] == [FRAMES, FRAMES, FRAMES - 1]
    np.testing.assert_allclose(points["hold"][3], points["hold"][2], rtol=0, atol=1e-9)
    between = np.sort([points["interpolate"][2, 0], points["interpolate"][4, 0]], axis=0)
    assert (between[0] - 1e-9 <= points["interpolate"][3, 0]).all()
    assert (points["interpolate"][3, 0] <= between[1] + 1e-9).all()
    refused = command("convert", broken, tmp_path / "no.trc", "--gaps", "linear")
    assert refused.code == 2 and "interpolate, hold, leave-out" in refused.err


def test_angles_that_are_not_known_are_held_by_bodies_that_move_and_that_is_said(
    broken: Path, command: Callable[..., Any], tmp_path: Path
) -> None:
    done = command("convert", broken, tmp_path / "out.glb")
    assert done.code == 0, done.err
    assert f"not known in 1 of {FRAMES - 1} frames is held as in the nearest frame" in done.out
    assert command("convert", broken, tmp_path / "out.mot").code == 0
    assert "nan" in (tmp_path / "out.mot").read_text()


def test_how_far_a_body_is_from_the_postures_is_said(
    broken: Path, command: Callable[..., Any], tmp_path: Path
) -> None:
    """Rigid parts are the figure's own: where lengths do not fit, the body is not where the posture is."""
    done = command("convert", broken, tmp_path / "person")
    assert done.code == 0, done.err
    assert command("convert", broken, tmp_path / "out.npz", "--up", "+z").code == 0
    said = float(done.out.partition("within ")[2].partition(" cm")[0]) / 100
    with np.load(tmp_path / "person" / "configurations.npz") as arrays:
        q = np.delete(arrays["q"], 4, axis=0)  # the one with an arm whose angles are not known
    placed = place_by_pinocchio(tmp_path / "person" / "figure.urdf", q)
    with np.load(tmp_path / "out.npz") as arrays:
        postures = np.delete(arrays["joints"], 4, axis=0)
    off = np.linalg.norm(placed - postures, axis=-1).max()
    assert 0.001 < off <= said * 1.05
