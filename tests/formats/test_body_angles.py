"""Angles of a body model: a small model of our own, SciPy's rotations as the independent calculation, and refusals."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posekit.errors import InputError
from posekit.formats.held import HeldPostures
from posekit.formats.held_postures import held_postures
from posekit.formats.motion.amass import SMPL_NAMES, read_amass
from posekit.formats.motion.body_model import BODY_JOINTS, BODY_PARENTS, read_body_model
from posekit.formats.recognising import recognise
from posekit.geometry import Array
from posekit.skeleton import JOINT

FRAMES, SHAPES, VERTICES = 12, 10, 40

REST = np.array(
    [
        *([0, -0.24, 0.03], [0.06, -0.33, 0.01], [-0.06, -0.33, 0.01], [0, -0.12, 0], [0.1, -0.72, 0.01]),
        *([-0.1, -0.72, 0.01], [0, 0.01, 0.02], [0.09, -1.12, -0.03], [-0.09, -1.12, -0.03], [0, 0.06, 0.03]),
        *([0.12, -1.18, 0.09], [-0.12, -1.18, 0.09], [0, 0.2, -0.01], [0.08, 0.18, -0.01], [-0.08, 0.18, 0]),
        *([0, 0.36, 0.03], [0.17, 0.23, -0.02], [-0.17, 0.23, -0.02], [0.43, 0.21, -0.05], [-0.43, 0.21, 0]),
        *([0.68, 0.22, -0.05], [-0.68, 0.22, -0.05]),
    ]
)


def model_arrays() -> dict[str, Any]:
    """Make a model whose regressor places the joints of `REST` in its mean shape."""
    random = np.random.default_rng(0)
    regressor = random.dirichlet(np.ones(VERTICES), BODY_JOINTS)
    return {
        "J_regressor": regressor,
        "v_template": np.linalg.lstsq(regressor, REST, rcond=None)[0],
        "shapedirs": random.normal(0, 0.01, (VERTICES, 3, SHAPES)),
        "kintree_table": np.array([[2**32 - 1, *BODY_PARENTS[1:]], range(BODY_JOINTS)], dtype=np.uint32),
    }


def clip_arrays() -> dict[str, Any]:
    random = np.random.default_rng(1)
    poses = random.normal(0, 0.2, (FRAMES, 156))
    poses[:, :3] = [np.pi / 2, 0, 0]
    return {
        "poses": poses,
        "trans": np.stack([np.linspace(0, 1, FRAMES), np.zeros(FRAMES), np.full(FRAMES, 1.2)], axis=1),
        "betas": random.normal(size=16),
        "mocap_framerate": np.array(120.0),
        "gender": np.array("neutral"),
        "labels": np.array([{}], dtype=object),
    }


@pytest.fixture
def model(tmp_path: Path) -> Path:
    np.savez(tmp_path / "model.npz", **model_arrays())
    return tmp_path / "model.npz"


def clip(path: Path, **changed: Any) -> Path:
    merged = {**clip_arrays(), **changed}
    np.savez(path, **{name: value for name, value in merged.items() if value is not None})
    return path


def held(path: Path, model: Path | None) -> HeldPostures:
    return held_postures(path, recognise(path), body_model=model)


def chained(poses: Array, trans: Array, rest: Array) -> Array:
    """Turn joint after joint with SciPy."""
    turned: list[Rotation] = []
    places = np.zeros_like(rest)
    for joint, parent in enumerate(BODY_PARENTS):
        own = Rotation.from_rotvec(poses[3 * joint : 3 * joint + 3])
        if parent < 0:
            turned.append(own)
            places[joint] = rest[joint] + trans
        else:
            turned.append(turned[parent] * own)
            places[joint] = places[parent] + turned[parent].apply(rest[joint] - rest[parent])
    return places


def test_joints_are_where_a_chain_of_rotations_has_them(tmp_path: Path, model: Path) -> None:
    path, given, arrays = clip(tmp_path / "a.npz"), clip_arrays(), model_arrays()
    shaped = arrays["v_template"] + arrays["shapedirs"] @ given["betas"][:SHAPES]
    motion = read_amass(path, model)
    for frame in range(FRAMES):
        expected = chained(given["poses"][frame], given["trans"][frame], arrays["J_regressor"] @ shaped)
        np.testing.assert_allclose(motion.points[frame], expected, atol=1e-12)
    assert motion.names == SMPL_NAMES and motion.rate == 120.0


def test_lengths_of_limbs_are_those_at_rest_and_the_feet_are_known(tmp_path: Path, model: Path) -> None:
    found = held(clip(tmp_path / "a.npz", betas=np.zeros(10)), model)
    shank = found.postures.joints[:, JOINT["left_ankle"]] - found.postures.joints[:, JOINT["left_knee"]]
    np.testing.assert_allclose(np.linalg.norm(shank, axis=1), np.linalg.norm(REST[7] - REST[4]), atol=1e-9)
    assert found.up == "+z" and found.unit == "m" and np.isfinite(found.feet[:, :2]).all()


@pytest.mark.parametrize("count", [22, 24, 52, 55])
def test_hands_and_faces_change_nothing_of_the_body(tmp_path: Path, model: Path, count: int) -> None:
    poses = np.zeros((FRAMES, 3 * count))
    poses[:, : 3 * BODY_JOINTS] = clip_arrays()["poses"][:, : 3 * BODY_JOINTS]
    found = read_amass(clip(tmp_path / "a.npz", poses=poses), model)
    np.testing.assert_allclose(found.points, read_amass(clip(tmp_path / "b.npz"), model).points, atol=1e-12)


def test_poses_in_parts_and_other_names_of_the_rate_are_read(tmp_path: Path, model: Path) -> None:
    poses = clip_arrays()["poses"]
    parts = {"root_orient": poses[:, :3], "pose_body": poses[:, 3:66], "mocap_frame_rate": np.array(60)}
    found = read_amass(clip(tmp_path / "a.npz", poses=None, mocap_framerate=None, **parts), model)
    np.testing.assert_allclose(found.points, read_amass(clip(tmp_path / "b.npz"), model).points, atol=1e-12)
    assert found.rate == 60.0


def test_a_model_of_joints_alone_is_one(tmp_path: Path, model: Path) -> None:
    arrays = model_arrays()
    directions = np.einsum("kv,vib->kib", arrays["J_regressor"], arrays["shapedirs"])
    np.savez(tmp_path / "joints.npz", J=REST, J_shapedirs=directions, parents=np.array(BODY_PARENTS))
    path = clip(tmp_path / "a.npz")
    alone = read_amass(path, tmp_path / "joints.npz").points
    np.testing.assert_allclose(alone, read_amass(path, model).points, atol=1e-9)


def test_what_the_model_lacks_of_the_shape_is_said(tmp_path: Path, model: Path) -> None:
    assert any(
        "10 of the 16 shape coefficients" in said for said in held(clip(tmp_path / "a.npz"), model).said
    )
    assert any("no shape" in said for said in held(clip(tmp_path / "b.npz", betas=None), model).said)


def test_without_a_model_the_remedy_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"a\.npz: poses: .* --body-model"):
        held(clip(tmp_path / "a.npz"), None)


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan, None])
def test_a_rate_that_is_none_is_no_time(tmp_path: Path, model: Path, rate: float | None) -> None:
    found = held(clip(tmp_path / "a.npz", mocap_framerate=rate), model)
    assert np.isnan(found.time).all() and any("--rate" in said for said in found.said)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"poses": np.zeros((FRAMES, 63))}, "expected numbers .* K of 22 or more"),
        ({"poses": np.zeros((FRAMES, 70))}, "shape"),
        ({"poses": np.full((FRAMES, 66), np.nan)}, r"poses\[0, 0\]: got nan; expected finite"),
        ({"poses": np.array([{}] * FRAMES, dtype=object)}, "pickles are not read"),
        ({"poses": np.zeros((0, 66)), "trans": np.zeros((0, 3))}, "one or more"),
        ({"trans": np.zeros((3, 3))}, "trans: got 3 frames"),
        ({"trans": np.zeros(FRAMES)}, "trans: got shape"),
        ({"betas": np.full(10, np.inf)}, "betas"),
        ({"betas": np.zeros((1, 1, 1))}, "betas"),
    ],
)
def test_a_clip_that_is_none_is_refused_in_one_line(
    tmp_path: Path, model: Path, changed: dict[str, Any], words: str
) -> None:
    with pytest.raises(InputError, match=words) as refused:
        held(clip(tmp_path / "a.npz", **changed), model)
    assert "\n" not in str(refused.value)


def without(*names: str) -> dict[str, Any]:
    return {name: value for name, value in model_arrays().items() if name not in names}


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        (
            {**model_arrays(), "J_regressor": np.array({}, dtype=object)},
            r"sparse matrix.*J_regressor\.toarray\(\)",
        ),
        ({**model_arrays(), "shapedirs": np.array([{}], dtype=object)}, "pickles are not read"),
        (without("J_regressor"), "no J_regressor with v_template, and no J"),
        (without("kintree_table"), "kintree_table"),
        ({**model_arrays(), "kintree_table": np.zeros((2, 22), dtype=int)}, "as of SMPL"),
        ({**model_arrays(), "v_template": np.full((VERTICES, 3), np.nan)}, "not finite"),
        ({**model_arrays(), "v_template": np.zeros((3, 3))}, "J_regressor: got shape"),
        ({"J": REST[:5], "parents": np.array(BODY_PARENTS)}, "5 joints"),
    ],
)
def test_a_model_that_is_none_is_refused_in_one_line(
    tmp_path: Path, arrays: dict[str, Any], words: str
) -> None:
    np.savez(tmp_path / "model.npz", **arrays)
    with pytest.raises(InputError, match=words) as refused:
        held(clip(tmp_path / "a.npz"), tmp_path / "model.npz")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("name", ["model.pkl", "model.txt", "nowhere.npz", "."])
def test_what_is_no_npz_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "model.pkl").write_bytes(b"\x80\x04cos\nsystem\n.")
    (tmp_path / "model.txt").write_text("", encoding="utf-8")
    with pytest.raises(InputError):
        read_body_model(tmp_path / name)


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "cut": lambda data: data[: len(data) // 2],
    "empty": lambda data: b"",
    "text": lambda data: b"poses" * 100,
    "header": lambda data: data.replace(b"NUMPY", b"NUMPX"),
    "shape": lambda data: data.replace(b"(12, 156)", b"(99, 999)"),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_archives_are_refused_in_one_line(tmp_path: Path, model: Path, damage: str) -> None:
    path = clip(tmp_path / "a.npz")
    path.write_bytes(DAMAGES[damage](path.read_bytes()))
    with pytest.raises(InputError) as refused:
        held(path, model)
    assert "\n" not in str(refused.value)
