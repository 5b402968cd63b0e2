"""Postures: any order of joints, unknown joints, and archives that are meant to harm."""

import io
import json
import pickle
import struct
import zipfile

import numpy as np
import pytest

from posekit.errors import InputError
from posekit.formats.own import Postures, Result, ResultFrame, read_postures, write_postures, write_result
from posekit.safe_io.npz_file import open_npz
from posekit.skeleton import HEAD_POINTS, JOINTS, POINTS


def some_joints(rng, count=5, points=14):
    joints = rng.normal(size=(count, points, 3))
    joints[rng.random((count, points)) < 0.2] = np.nan
    return joints


def document_of(joints, names=JOINTS, unit="m"):
    rows = [[None if np.isnan(p).any() else p.tolist() for p in posture] for posture in joints]
    return {"schema": "posekit.postures/1", "unit": unit, "joint_names": list(names), "postures": rows}


def read(tmp_path, document):
    (tmp_path / "p.json").write_text(json.dumps(document))
    return read_postures(tmp_path / "p.json")


@pytest.mark.parametrize("suffix", ["json", "npz"])
@pytest.mark.parametrize("unit", ["m", "cm"])
@pytest.mark.parametrize(("count", "with_head"), [(0, False), (0, True), (5, False), (5, True)])
def test_postures_are_read_back(*, tmp_path, rng, suffix, unit, count, with_head):
    joints, head = some_joints(rng, count), some_joints(rng, count, 5) if with_head else None
    path = tmp_path / f"p.{suffix}"
    write_postures(path, Postures(joints=joints, head=head), unit)
    back = read_postures(path)
    rtol = 0.0 if unit == "m" or suffix == "npz" else 3e-16
    np.testing.assert_allclose(back.joints, joints, rtol=rtol)
    assert not back.joints.flags.writeable
    assert (back.head is None) == (head is None)
    if head is not None:
        assert back.head is not None
        np.testing.assert_allclose(back.head, head, rtol=rtol)


def test_an_array_alone_is_written(tmp_path, rng):
    joints = some_joints(rng)
    write_postures(tmp_path / "p.json", joints)
    assert np.array_equal(read_postures(tmp_path / "p.json").joints, joints, equal_nan=True)
    assert json.loads((tmp_path / "p.json").read_text()) == document_of(joints)


@pytest.mark.parametrize("suffix", ["json", "npz"])
def test_any_order_of_joints_is_put_right(tmp_path, rng, suffix):
    points = some_joints(rng, 3, 19)
    order = rng.permutation(19)[:12]
    names = [POINTS[index] for index in order]
    if suffix == "json":
        (tmp_path / "p.json").write_text(json.dumps(document_of(points[:, order] * 100, names, "cm")))
    else:
        np.savez(tmp_path / "p.npz", joints=points[:, order], joint_names=names)
    back = read_postures(tmp_path / f"p.{suffix}")
    expected = np.full_like(points, np.nan)
    expected[:, order] = points[:, order]
    np.testing.assert_allclose(back.joints, expected[:, :14], rtol=3e-16)
    assert back.head is not None
    np.testing.assert_allclose(back.head, expected[:, 14:], rtol=3e-16)


def test_null_coordinates_are_an_unknown_joint(tmp_path, rng):
    document = document_of(np.zeros((1, 14, 3)))
    document["postures"][0][3] = [None, None, None]
    document["postures"][0][4] = None
    assert np.isnan(read(tmp_path, document).joints[0]).all(axis=-1).nonzero()[0].tolist() == [3, 4]


@pytest.mark.parametrize("dtype", ["<f8", ">f8", "<f4", "<f2"])
def test_any_float_array_is_read(tmp_path, rng, dtype):
    joints = some_joints(rng).astype(dtype)
    np.savez_compressed(tmp_path / "p.npz", joints=np.asfortranarray(joints))
    back = read_postures(tmp_path / "p.npz").joints
    assert back.dtype == np.float64
    assert np.array_equal(back, joints.astype(np.float64), equal_nan=True)


@pytest.mark.parametrize("suffix", ["json", "npz"])
def test_a_results_survivors_are_postures(tmp_path, rng, suffix):
    frames = [
        ResultFrame(
            time=0.0,
            camera={},
            levels={"joint": [], "physical": [], "motion": []},
            joints=rng.normal(size=(count, 14, 3)),
            q=np.zeros((count, 1)),
            branches=[""] * count,
            margins={},
            fk_distance=np.zeros(count),
            length_residual=np.zeros(count),
            rejected={},
        )
        for count in (2, 0, 3)
    ]
    write_result(
        tmp_path / f"r.{suffix}", Result(unit="cm", configuration_names=["x"], settings={}, frames=frames)
    )
    back = read_postures(tmp_path / f"r.{suffix}")
    np.testing.assert_allclose(back.joints, np.concatenate([frame.joints for frame in frames]), rtol=3e-16)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        (
            {"joint_names": [*JOINTS[:13], "left_ankel"]},
            'joint_names[13]: got "left_ankel"; expected the name of a joint; did you mean left_ankle',
        ),
        (
            {"joint_names": [*JOINTS[:13], "neck"]},
            'joint_names[13]: got "neck" again; expected each joint once',
        ),
        ({"joint_names": []}, "joint_names: got []; expected at least 1"),
        ({"joint_names": JOINTS[:13]}, "postures[0]: got 14 points; expected 13, as there are joint_names"),
        ({"unit": "ft"}, 'unit: got "ft"'),
        ({"unit": ...}, "unit: got nothing"),
        (
            {"postures": [[[1, 2, 3]] * 13 + [[1, None, 3]]]},
            "postures[0, 13]: got a point that is known in part",
        ),
        ({"postures": [[[1, 2, 3]] * 13 + [[1, 2]]]}, "postures[0][13]: got [1, 2]; expected at least 3"),
        ({"postures": [[[1, 2, 3]] * 13 + [[1, 2, "3"]]]}, 'postures[0][13][2]: got "3"; expected a number'),
        (
            {"postures": [[[1, 2, 3]] * 13 + [[1, 2, float("inf")]]]},
            "postures[0][13][2]: got Infinity; expected a finite",
        ),
        ({"postures": [[1, 2, 3]]}, "postures[0][0]: got 1; expected a list"),
        ({"postures": None}, "postures: got null; expected a list"),
        ({"schema": "posekit.view/1"}, "give a file of schema posekit.postures/1 instead"),
    ],
)
def test_json_that_breaks_the_schema_is_one_clear_line(tmp_path, changes, text):
    document = document_of(np.zeros((1, 14, 3))) | changes
    with pytest.raises(InputError) as caught:
        read(tmp_path, {name: value for name, value in document.items() if value is not ...})
    assert text in str(caught.value)
    assert str(caught.value).isprintable()


good = np.zeros((2, 14, 3))
infinite = good.copy()
infinite[1, 2, 0] = np.inf
partial = good.copy()
partial[1, 2, 0] = np.nan


@pytest.mark.parametrize(
    ("arrays", "text"),
    [
        ({"points": good}, "joints: got nothing; expected the array joints; add it; there is points"),
        ({"joints": np.zeros((14, 3))}, r"joints: got shape \(14, 3\); expected shape \(any, 14, 3\)"),
        ({"joints": np.zeros((2, 17, 3))}, r"joints: got shape \(2, 17, 3\)"),
        ({"joints": good.astype(np.int32)}, "joints: got dtype int32; expected floating-point numbers"),
        ({"joints": good.astype(np.complex128)}, "joints: got dtype complex128"),
        ({"joints": infinite}, r"joints\[1, 2, 0\]: got an infinite number"),
        ({"joints": partial}, r"joints\[1, 2\]: got a point that is known in part"),
        ({"joints": good, "joint_names": [*JOINTS[:13], "x"]}, r'joint_names\[13\]: got "x"'),
        ({"joints": good, "joint_names": [*JOINTS[:13], "neck"]}, "joint_names: got a name twice"),
        ({"joints": good, "joint_names": np.arange(14)}, "joint_names: got dtype int64; expected text"),
        ({"joints": good, "head": np.zeros((3, 5, 3))}, "head: got 3 postures; expected 2"),
        ({"joints": good, "head": np.zeros((2, 4, 3))}, r"head: got shape \(2, 4, 3\)"),
        (
            {"joints": np.zeros((2, 1, 3)), "joint_names": ["nose"], "head": np.zeros((2, 5, 3))},
            "the head twice",
        ),
        ({"joints": good, "schema": np.array("posekit.view/1")}, 'schema: got "posekit.view/1"'),
    ],
)
def test_npz_that_breaks_the_schema_is_one_clear_line(tmp_path, arrays, text):
    np.savez(tmp_path / "p.npz", **arrays)
    with pytest.raises(InputError, match=text) as caught:
        read_postures(tmp_path / "p.npz")
    assert str(caught.value).isprintable()


def npy(header: str, data: bytes = b"", version: bytes = b"\x01\x00") -> bytes:
    padded = (header + "\n").encode("latin1")
    size = struct.pack("<H", len(padded)) if version[0] == 1 else struct.pack("<I", len(padded))
    return b"\x93NUMPY" + version + size + padded + data


def described(shape: str, dtype: str = "<f8") -> str:
    return f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}}}"


class Harmful:
    def __reduce__(self):
        return (exec, ("raise AssertionError('a pickle was executed')",))


@pytest.mark.parametrize(
    ("member", "text"),
    [
        (npy(described("(1000000000000, 14, 3)")), "got 0 bytes; expected 336,000,000,000,000 for shape"),
        (npy(described("(-1, -14, 3)"), bytes(42 * 8)), "joints: got"),
        (npy(described("(1, 14, 3)"), bytes(8)), "got 8 bytes; expected 336"),
        (npy(described("(1, 14, 3)"), bytes(337)), "got 337 bytes; expected 336"),
        (npy(described("(1, 14, 3)", "|V8"), bytes(336)), "dtype"),
        (npy(described("(1, 14, 3)", "|O"), pickle.dumps(Harmful())), "joints: got dtype object"),
        (npy(described("(1, 14, 3)", "<U0")), "joints: got dtype <U0"),
        (npy("{'descr': __import__('os').system('false')}"), "joints: got"),
        (npy("(" * 8000), "joints: got"),
        (npy("{" + "'a':1," * 1000 + "}"), "joints: got"),
        (npy("x" * 50_000), "joints: got"),
        (npy(described("(1, 14, 3)"), bytes(336), b"\x03\x00"), "joints: got npy format"),
        (b"\x93NUMPY\x01\x00\xff\xff", "joints: got"),
        (b"", "joints: got"),
        (b"no array at all", "joints: got"),
    ],
)
def test_an_array_that_lies_is_refused_before_memory_is_taken(tmp_path, member, text):
    with zipfile.ZipFile(tmp_path / "p.npz", "w") as archive:
        archive.writestr("joints.npy", member)
    with pytest.raises(InputError, match=text) as caught:
        read_postures(tmp_path / "p.npz")
    assert str(caught.value).isprintable()


def zeros_npz(path, megabytes):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("joints.npy", "w") as out:
        out.write(npy(described(f"({megabytes * 1_000_000 // 336}, 14, 3)")))
        for _ in range(megabytes):
            out.write(bytes(1_000_000))


def test_a_zip_bomb_is_refused_by_its_declared_size(tmp_path):
    zeros_npz(tmp_path / "p.npz", 1001)
    assert (tmp_path / "p.npz").stat().st_size < 2e6
    with pytest.raises(InputError, match=r"got 1,001 MB of arrays when unpacked; expected at most 1,000 MB"):
        read_postures(tmp_path / "p.npz")


def test_a_zip_bomb_that_hides_its_size_is_refused(tmp_path):
    zeros_npz(tmp_path / "p.npz", 30)
    data = (tmp_path / "p.npz").read_bytes()
    with zipfile.ZipFile(tmp_path / "p.npz") as archive:
        size = archive.infolist()[0].file_size
    (tmp_path / "p.npz").write_bytes(data.replace(struct.pack("<I", size), struct.pack("<I", 400)))
    with pytest.raises(InputError):
        read_postures(tmp_path / "p.npz")


def test_archives_that_are_none_are_refused(tmp_path):
    path = tmp_path / "p.npz"
    np.savez(path, joints=good)
    whole = path.read_bytes()
    for content, text in [
        (b"", "an empty file"),
        (b"PK\x03\x04", "not a zip file"),
        (whole[:-30], "not a zip file"),
        (json.dumps(document_of(good)).encode(), "not a zip file"),
    ]:
        path.write_bytes(content)
        with pytest.raises(InputError, match=text):
            read_postures(path)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("readme.txt", "x")
    path.write_bytes(buffer.getvalue())
    with pytest.raises(InputError, match=r'a member "readme\.txt"; expected arrays'):
        read_postures(path)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_BZIP2) as archive:
        archive.writestr("a.npy", "x")
    with pytest.raises(InputError, match="compression method 12"):
        read_postures(path)
    path.write_bytes(whole.replace(b"joints", b"j\n\x1bnts"))
    with pytest.raises(InputError, match="joints: got nothing") as caught:
        read_postures(path)
    assert str(caught.value).isprintable()
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.npy", "x")
        with pytest.warns(UserWarning, match="Duplicate"):
            archive.writestr("a.npy", "x")
    with pytest.raises(InputError, match="two arrays of one name"):
        read_postures(path)
    with zipfile.ZipFile(path, "w") as archive:
        for index in range(10_001):
            archive.writestr(f"{index}.npy", b"")
    with pytest.raises(InputError, match="10,001 members"):
        read_postures(path)


def test_damage_anywhere_is_refused_or_harmless(tmp_path, rng):
    path = tmp_path / "p.npz"
    np.savez_compressed(path, joints=some_joints(rng, 3), joint_names=JOINTS, head=some_joints(rng, 3, 5))
    whole = path.read_bytes()
    for _ in range(500):
        data = bytearray(whole)
        for place in rng.integers(0, len(data), rng.integers(1, 5)):
            data[place] = rng.integers(256)
        path.write_bytes(data)
        try:
            read_postures(path)
        except InputError as error:
            assert str(error).isprintable()


def test_an_archive_larger_than_its_limit_is_not_opened(tmp_path):
    np.savez(tmp_path / "p.npz", joints=good)
    with pytest.raises(InputError, match="expected at most 0 MB"), open_npz(tmp_path / "p.npz", limit=100):
        pass


@pytest.mark.parametrize("name", ["p.txt", "p"])
def test_other_suffixes_are_refused(tmp_path, name):
    with pytest.raises(InputError, match=r"expected \.json or \.npz"):
        read_postures(tmp_path / name)
    with pytest.raises(InputError, match=r"expected \.json or \.npz"):
        write_postures(tmp_path / name, good)


@pytest.mark.parametrize(
    ("given", "text"),
    [(np.zeros((14, 3)), "joints: got shape"), (infinite, "an infinite number"), (partial, "known in part")],
)
def test_postures_that_cannot_be_are_refused(tmp_path, given, text):
    with pytest.raises(InputError, match=text):
        write_postures(tmp_path / "p.json", given)
    assert not list(tmp_path.iterdir())


def test_a_head_of_another_number_is_refused():
    with pytest.raises(InputError, match="head: got shape"):
        Postures(joints=good, head=np.zeros((3, len(HEAD_POINTS), 3)))
