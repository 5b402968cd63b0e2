"""C3D: ezc3d as the independent reader and writer, all processors and number formats, and hostile files."""

import struct

import ezc3d
import numpy as np
import pytest

from posekit.errors import InputError
from posekit.formats.motion import Motion, read_motion, write_motion
from posekit.formats.motion.c3d import read_c3d, write_c3d

INTEL, DEC, MIPS = 84, 85, 86


def motion(frames=9, points=6, seed=0, up="+z", rate=120.0):
    rng = np.random.default_rng(seed)
    values = rng.uniform(-3, 3, size=(frames, points, 3))
    values[rng.random((frames, points)) < 0.2] = np.nan
    names = tuple(f"R{k}" for k in range(points))
    return Motion(names=names, points=values, time=np.arange(frames) / rate, rate=rate, up=up)


def dec_float(value):
    """Spell a VAX F float: four times an IEEE one, halves exchanged."""
    (bits,) = struct.unpack("<I", struct.pack("<f", 4 * value if value else 0.0))
    return struct.pack("<HH", bits >> 16, bits & 0xFFFF)


def numbers(processor, values, integer):
    if integer:
        return np.asarray(values).astype(">i2" if processor == MIPS else "<i2").tobytes()
    if processor == DEC:
        return b"".join(dec_float(float(value)) for value in np.ravel(values))
    return np.asarray(values).astype(">f4" if processor == MIPS else "<f4").tobytes()


class Builder:
    """A C3D file by hand, as the user guide lays it out."""

    def __init__(self, points, processor=INTEL, integer=False, analogue=0, unit="mm", scale=0.1, **other):
        self.order = ">" if processor == MIPS else "<"
        self.processor, self.integer = processor, integer
        frames, count, _ = points.shape
        self.scale = scale if integer else -scale
        told = {
            "used": count,
            "frames": frames,
            "labels": [f"P{k}" for k in range(count)],
            "rate": 50.0,
        } | other
        parameters = self.parameters(told, unit)
        blocks = -(-len(parameters) // 512)
        first = other.get("first", 1)
        header = bytes([2, 0x50]) + struct.pack(
            f"{self.order}5H",
            told.get("points", count),
            analogue,
            first,
            other.get("last", first + frames - 1),
            10,
        )
        header += self.float(self.scale) + struct.pack(f"{self.order}2H", 2 + blocks, 1 if analogue else 0)
        header += self.float(50.0)
        rows = np.zeros((frames, 4 * count + analogue))
        missing = np.isnan(points).any(axis=-1)
        four = np.concatenate([np.nan_to_num(points), np.where(missing, -1.0, 0.0)[..., None]], axis=-1)
        if integer:
            four[..., :3] = np.round(four[..., :3] / scale)
        rows[:, : 4 * count] = four.reshape(frames, -1)
        rows[:, 4 * count :] = 7
        self.data = header.ljust(512, b"\0") + parameters.ljust(512 * blocks, b"\0")
        self.data += numbers(processor, rows, integer)
        self.data += b"\0" * (-len(self.data) % 512)

    def float(self, value):
        return numbers(self.processor, [value], False)

    def parameters(self, told, unit):
        word = self.order + "H"
        items = [
            (-1, "POINT", None),
            (1, "USED", (2, [], struct.pack(word, told["used"] & 0xFFFF))),
            (1, "SCALE", (4, [], self.float(self.scale))),
            (1, "RATE", (4, [], self.float(told["rate"]))),
            (1, "FRAMES", (2, [], struct.pack(word, told["frames"] & 0xFFFF))),
            (1, "DATA_START", (2, [], struct.pack(word, 3))),
            (1, "UNITS", (-1, [len(unit), 1], unit.encode())),
            (1, "LABELS", self.texts(told["labels"][:255])),
            (1, "LABELS2", self.texts(told["labels"][255:])),
            (1, "DESCRIPTIONS", (-1, [0, 0], b"")),
            *told.get("more", []),
            (-2, "ANALOG", None),
            (2, "USED", (2, [], struct.pack(word, told.get("channels", 0)))),
        ]
        if "up" in told:
            items.insert(4, (1, "Y_SCREEN", (-1, [2], told["up"].encode())))
        section = bytes([1, 0x50, 2, self.processor])
        for group, name, parameter in items:
            body = b"\0"
            if parameter is not None:
                kind, dimensions, data = parameter
                body = struct.pack("bB", kind, len(dimensions)) + bytes(dimensions) + data + b"\0"
            offset = struct.pack(word, 2 + len(body))
            section += struct.pack("bb", len(name), group) + name.encode() + offset + body
        return section + b"\0\0"

    def texts(self, names):
        length = max(map(len, names), default=0)
        return -1, [length, len(names)], b"".join(name.ljust(length).encode() for name in names)


def save(tmp_path, data):
    path = tmp_path / "trial.c3d"
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("count", [1, 20, 254, 255, 256, 600])
def test_ezc3d_reads_what_is_written(tmp_path, count):
    given = motion(points=count, frames=5)
    write_motion(tmp_path / "a.c3d", given)
    content = ezc3d.c3d(str(tmp_path / "a.c3d"))
    points = np.moveaxis(content["data"]["points"][:3], 0, -1).swapaxes(0, 1)
    unseen = content["data"]["meta_points"]["residuals"][0].T < 0
    group = content["parameters"]["POINT"]
    np.testing.assert_array_equal(unseen, np.isnan(given.points).any(axis=-1))
    np.testing.assert_allclose(points[~unseen], given.points[~unseen], rtol=0, atol=1e-6)
    names = [name for key in ("LABELS", "LABELS2", "LABELS3") if key in group for name in group[key]["value"]]
    assert tuple(names) == given.names
    assert group["UNITS"]["value"] == ["m"]
    assert group["Y_SCREEN"]["value"] == ["+Z"]
    assert content["header"]["points"]["frame_rate"] == given.rate
    back = read_motion(tmp_path / "a.c3d")
    assert (back.names, back.up, back.rate) == (given.names, "+z", given.rate)
    np.testing.assert_allclose(back.points, given.points, rtol=0, atol=1e-6)


@pytest.mark.parametrize("up", ["", "+x", "-x", "+y", "-y", "+z", "-z"])
def test_up_and_missing_points_are_kept(tmp_path, up):
    given = motion(up=up)
    write_c3d(tmp_path / "a.c3d", given)
    back = read_c3d(tmp_path / "a.c3d")
    assert back.up == up
    np.testing.assert_array_equal(np.isnan(back.points), np.isnan(given.points))


@pytest.mark.parametrize("processor", [INTEL, DEC, MIPS])
@pytest.mark.parametrize("integer", [False, True])
@pytest.mark.parametrize("analogue", [0, 3])
def test_every_kind_of_file_is_read_as_by_hand_and_by_ezc3d(tmp_path, processor, integer, analogue):
    points = np.round(1000 * motion(frames=4, points=3).points, 1)
    path = save(tmp_path, Builder(points, processor, integer, analogue, up="+Y", channels=analogue).data)
    found = read_c3d(path)
    np.testing.assert_allclose(found.points, points / 1000, rtol=0, atol=1e-6)
    assert (found.names, found.rate, found.up) == (("P0", "P1", "P2"), 50.0, "+y")
    if not analogue and processor != MIPS:  # ezc3d 1.7 has no MIPS
        other = ezc3d.c3d(str(path))
        seen = ~np.isnan(points).any(axis=-1)
        theirs = np.moveaxis(other["data"]["points"][:3], 0, -1).swapaxes(0, 1)
        np.testing.assert_allclose(found.points[seen], theirs[seen] / 1000, rtol=0, atol=1e-6)


def test_a_long_trial_is_read_whole_and_one_that_hides_its_length_is_refused(tmp_path):
    frames = 66_000
    points = np.ones((frames, 1, 3))
    long: tuple = ("LONG_FRAMES", (4, [], struct.pack("<f", frames)))
    ends = [
        ("ACTUAL_START_FIELD", (2, [2], struct.pack("<2H", 1, 0))),
        ("ACTUAL_END_FIELD", (2, [2], struct.pack("<2H", frames & 0xFFFF, 1))),
    ]
    for more in ([(1, *long)], [(-3, "TRIAL", None), *((3, *end) for end in ends)]):
        path = save(tmp_path, Builder(points, frames=65535, last=65535, more=more).data)
        assert len(read_c3d(path)) == frames
    hidden = save(tmp_path, Builder(points, frames=65535, last=65535).data)
    with pytest.raises(InputError, match=r"POINT:FRAMES: got frames up to 65,535, and 1,056,\d+ bytes"):
        read_c3d(hidden)
    with pytest.raises(InputError, match="66,000 frames"):
        write_c3d(
            tmp_path / "b.c3d", Motion(names=("a",), points=points, time=np.arange(float(frames)), rate=1)
        )


def test_points_without_a_name_get_one(tmp_path):
    points = np.ones((2, 3, 3))
    assert read_c3d(save(tmp_path, Builder(points, labels=["a"]).data)).names == (
        "a",
        "unnamed_2",
        "unnamed_3",
    )
    with pytest.raises(InputError, match='LABELS: got "a" twice'):
        read_c3d(save(tmp_path, Builder(points, labels=["a", "b", "a"]).data))


def test_the_unit_is_the_files_or_stated(tmp_path):
    points = np.array([[[0.0, 0, 0], [0, 0, 1700]]])
    assert read_motion(save(tmp_path, Builder(points).data)).points[0, 1, 2] == pytest.approx(1.7)
    wrong = save(tmp_path, Builder(points, unit="m").data)
    with pytest.raises(InputError, match="span 1700 m"):
        read_motion(wrong)
    assert read_motion(wrong, unit="mm").points[0, 1, 2] == pytest.approx(1.7)
    strange = save(tmp_path, Builder(points, unit="ell").data)
    with pytest.raises(
        InputError, match='POINT:UNITS: got "ell"; expected one of m, cm, mm, in; state the unit'
    ):
        read_motion(strange)
    assert read_motion(strange, unit="mm").points[0, 1, 2] == pytest.approx(1.7)


def cut(size):
    return lambda data: data[:size]


def put(place, value):
    return lambda data: data[:place] + value + data[place + len(value) :]


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (cut(100), "second byte is 50"),
        (cut(1024), "frames from byte|bytes of frames"),
        (cut(-600), "bytes of frames; expected"),
        (put(0, b"PK"), "second byte is 50"),
        (put(0, b"\xff"), "section of parameters"),
        (put(2, b"\0\0"), "analogue channels alone"),
        (put(2, b"\xff\xff"), "bytes of frames"),
        (put(6, b"\x09\x00\x01\x00"), "frames 9 to 1"),
        (put(8, b"\xff\x7f"), "bytes of frames"),
        (put(16, b"\xff\xff"), "frames after the parameters"),
        (put(16, b"\0\0"), "frames after the parameters"),
        (put(515, b"\x10"), "known processor"),
        (put(516, b"\x7f"), "parameters, byte"),
    ],
)
def test_damaged_files_are_refused_in_one_line(tmp_path, damage, words):
    path = save(tmp_path, damage(Builder(motion(frames=50, points=3).points).data))
    with pytest.raises(InputError, match=words) as refused:
        read_c3d(path)
    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)


def test_bytes_at_random_are_read_or_refused(tmp_path):
    rng = np.random.default_rng(3)
    good = Builder(motion(frames=5, points=3).points).data
    refused = 0
    for _ in range(400):
        data = bytearray(good)
        for place in rng.integers(0, 900, size=rng.integers(1, 4)):
            data[place] = rng.integers(0, 256)
        path = save(tmp_path, bytes(data[: rng.integers(0, len(data))] if rng.random() < 0.1 else data))
        try:
            read_c3d(path)
        except InputError as error:
            assert "\n" not in str(error)
            refused += 1
    assert 80 < refused < 380


def test_what_c3d_cannot_hold_is_not_written(tmp_path, monkeypatch):
    ones = np.ones((3, 1, 3))
    uneven = Motion(names=("a",), points=ones, time=np.array([0.0, 1, 3]), rate=1)
    odd = Motion(names=("coude droit é",), points=ones, time=np.arange(3.0), rate=1)
    clips = Motion(
        names=("a",),
        points=ones,
        time=np.array([0.0, 1, 0]),
        rate=1,
        clip=np.array([0, 0, 1]),
        clips=("x", "y"),
    )
    for one, words in ((uneven, "evenly spaced"), (odd, "printable ASCII"), (clips, "2 clips")):
        with pytest.raises(InputError, match=words):
            write_c3d(tmp_path / "a.c3d", one)
    assert list(tmp_path.iterdir()) == []

    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr("posekit.safe_io.extras.import_module", missing)
    with pytest.raises(InputError, match=r"writing C3D needs ezc3d.*pip install 'posekit\[c3d\]'"):
        write_c3d(tmp_path / "a.c3d", motion())
