"""The one door: regular files, text, XML, TOML, the directory of a zip, and the three kinds of mesh."""

import math
import os
import re
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.errors import InputError
from posekit.safe_io import (
    check_mesh,
    open_npz,
    parse_toml,
    parse_xml,
    read_bytes,
    read_text,
    read_toml,
    read_xml,
)
from posekit.safe_io.zip_directory import directory_size


def refusal_of(call, *arguments, **options) -> str:
    with pytest.raises(InputError) as caught:
        call(*arguments, **options)
    text = str(caught.value)
    assert text.isprintable()
    assert len(text) < 700
    assert "got " in text
    assert "; expected " in text
    return text


class TestRegularFiles:
    def test_whatever_is_none_is_refused_at_once(self, tmp_path: Path) -> None:
        os.mkfifo(tmp_path / "pipe")
        (tmp_path / "loop").symlink_to("loop")
        (tmp_path / "gone").symlink_to("nowhere")
        (tmp_path / "empty").touch()
        for name, reason in [
            ("", "a directory"),
            ("pipe", "a pipe or a device"),
            ("loop", "symbolic links"),
            ("gone", "No such file"),
            ("empty", "an empty file"),
            ("a\0b", "null"),
            ("x" * 300, "too long"),
        ]:
            assert reason in refusal_of(read_bytes, tmp_path / name, limit=10)
        assert "a pipe or a device" in refusal_of(read_bytes, "/dev/zero", limit=10)

    def test_a_pipe_that_takes_the_files_place_does_not_block(self, tmp_path: Path, monkeypatch) -> None:
        path = tmp_path / "a"
        path.write_text("x")
        status = path.stat()
        path.unlink()
        os.mkfifo(path)
        monkeypatch.setattr(Path, "stat", lambda _self: status)
        assert "a pipe or a device" in refusal_of(read_bytes, path, limit=10)

    def test_the_limit_is_inclusive(self, tmp_path: Path) -> None:
        path = tmp_path / "a"
        path.write_bytes(b"x" * 10)
        assert read_bytes(path, limit=10) == b"x" * 10
        assert "expected at most 0 MB; split it" in refusal_of(read_bytes, path, limit=9)


class TestText:
    @given(text=st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), min_size=1))
    def test_utf8_is_read_back(self, text: str) -> None:
        from posekit.safe_io.text_file import decode

        assert decode("x", text.encode()) == text.removeprefix("\ufeff")

    @pytest.mark.parametrize(
        ("data", "where"),
        [
            ("über".encode("latin-1"), "byte 0: got 0xfc"),
            ("<robot/>".encode("utf-16"), "byte 0: got 0xff"),
            ("<robot/>".encode("utf-16-be"), "byte 0: got a NUL"),
            ("ü\0".encode(), "byte 2: got a NUL"),
            (b"ok\xed\xa0\x80", "byte 2: got 0xed"),
        ],
    )
    def test_other_encodings_name_the_byte(self, tmp_path: Path, data: bytes, where: str) -> None:
        (tmp_path / "a").write_bytes(data)
        assert f"{where}" in refusal_of(read_text, tmp_path / "a", limit=100)


BILLION_LAUGHS = "<!DOCTYPE a [<!ENTITY b 'c'><!ENTITY d '&b;&b;&b;'>]><a>&d;</a>"


class TestXml:
    @pytest.mark.parametrize(
        ("text", "reason"),
        [
            (BILLION_LAUGHS, "DOCTYPE and entities are refused"),
            ("<!DOCTYPE a SYSTEM 'file:///etc/passwd'><a/>", "DOCTYPE and entities are refused"),
            ("<a b='&c;'/>", "not well-formed XML: undefined entity"),
            ("<a>", "not well-formed XML: no element found: line 1"),
            ("<a/><b/>", "junk after document element"),
            ("<a b='1' b='2'/>", "duplicate attribute"),
            ("", "no element found"),
            ("<a>\0</a>", "not well-formed"),
            ("<a>\ud800</a>", "half a character"),
            ("<a>" * 65, "65 nested elements; expected at most 64"),
            ("<a>" * 2_000_000, "65 nested elements"),
            ("<a>" + "<b/>" * 100_001 + "</a>", "more than 100,000 elements"),
        ],
    )
    def test_what_is_refused(self, text: str, reason: str) -> None:
        assert reason in refusal_of(parse_xml, text, "x.urdf")

    def test_what_is_read(self, tmp_path: Path) -> None:
        path = tmp_path / "a.xml"
        path.write_bytes(
            b"\xef\xbb\xbf<?xml version='1.0' encoding='latin-1'?><!-- c --><a b='\xc3\xbc&#49;'/>"
        )
        root = read_xml(path)
        assert (root.tag, root.get("b")) == ("a", "ü1")

    @given(st.text("<>/ab='\"&;!- ?", max_size=40))
    def test_any_text_is_parsed_or_refused(self, text: str) -> None:
        try:
            parse_xml(text, "x")
        except InputError as error:
            assert str(error).isprintable()


class TestToml:
    def test_what_is_read(self, tmp_path: Path) -> None:
        (tmp_path / "a.toml").write_bytes(b"\xef\xbb\xbfa.b = [1, 2.5]\n[[c]]\nd = 'x.y.z'\n")
        assert read_toml(tmp_path / "a.toml") == {"a": {"b": [1, 2.5]}, "c": [{"d": "x.y.z"}]}

    @pytest.mark.parametrize(
        ("text", "reason"),
        [
            ("a = nan", "a: got nan; expected a finite number"),
            ("[a]\nb = [1, {c = -inf}]", "a.b[1].c: got -inf"),
            ("a = 1e400", "a: got inf"),
            ("a = 1" + "0" * 400, "a: got an integer that no float64 holds"),
            ("a = 1" + "0" * 5000, "not TOML"),
            ("a = [1,", "not TOML"),
            ("a = 1\na = 2", "not TOML: Cannot overwrite"),
            ("a = \x07", "not TOML"),
            ("a." * 20 + "b = 1", "line 1: got a key of 21 parts; expected at most 16"),
            ("\n" + "'a'.\"b\" . " * 250_000 + "c = 1", "line 2: got a key of 500001 parts"),
            ("a = " + "[" * 100_000, "expected at most 16 levels"),
            ("a = " + "[" * 17 + "]" * 17, "17 nested levels"),
            ("[a.a.a.a.a.a.a.a.a]\nb.b.b.b.b.b.b.b.b = 1", "nested levels"),
        ],
    )
    def test_what_is_refused(self, text: str, reason: str) -> None:
        assert reason in refusal_of(parse_toml, text, "x.toml")

    def test_numbers_that_are_not_finite_can_be_let_through(self) -> None:
        assert math.isnan(parse_toml("a = nan", "x", finite=False)["a"])

    @given(st.text("[]{}=.,\"'#ab1-_\n infa", max_size=60))
    def test_any_text_is_parsed_or_refused(self, text: str) -> None:
        try:
            parse_toml(text, "x")
        except InputError as error:
            assert str(error).isprintable()


class TestZipDirectory:
    @pytest.mark.parametrize("comment", [b"", b"a comment"])
    @pytest.mark.parametrize("count", [1, 7, 300])
    def test_its_size_is_what_zipfile_reads(self, tmp_path: Path, count: int, comment: bytes) -> None:
        path = tmp_path / "a.npz"
        np.savez(path, *[np.zeros(3)] * count)
        with zipfile.ZipFile(path, "a") as archive:
            archive.comment = comment
        end = path.stat().st_size - 22 - len(comment)
        with path.open("rb") as file:
            assert directory_size(file) == end - archive.start_dir > 46 * count
            assert file.tell() == 0

    def test_where_there_is_none_it_is_zero(self, tmp_path: Path) -> None:
        (tmp_path / "a").write_bytes(b"PK\x05\x06 cut")
        with (tmp_path / "a").open("rb") as file:
            assert directory_size(file) == 0

    def test_a_64_bit_record_counts(self, tmp_path: Path) -> None:
        record = struct.pack("<4sQ2H2L4Q", b"PK\x06\x06", 44, 45, 45, 0, 0, 1, 1, 123_456_789_012, 0)
        locator = struct.pack("<4sLQL", b"PK\x06\x07", 0, 0, 1)
        end = struct.pack("<4s4H2LH", b"PK\x05\x06", 0, 0, 0xFFFF, 0xFFFF, 0xFFFFFFFF, 0xFFFFFFFF, 0)
        (tmp_path / "a").write_bytes(record + locator + end)
        with (tmp_path / "a").open("rb") as file:
            assert directory_size(file) == 123_456_789_012

    def test_a_directory_that_would_fill_the_memory_is_not_read(self, tmp_path: Path) -> None:
        path, entry = tmp_path / "a.npz", b"PK\x01\x02" + bytes(42)
        count = 300_000
        end = struct.pack("<4s4H2LH", b"PK\x05\x06", 0, 0, 0xFFFF, 0xFFFF, count * len(entry), 0, 0)
        path.write_bytes(entry * count + end)
        with pytest.raises(InputError, match="a directory of 14 MB; expected at most 10 MB"), open_npz(path):
            pass


def triangle(*numbers: float) -> bytes:
    return struct.pack("<12fH", *(numbers or (0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0)), 0)


def stl(declared: int, *triangles: bytes) -> bytes:
    return b" " * 80 + struct.pack("<I", declared) + b"".join(triangles)


ASCII = (
    b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
    b"endloop\nendfacet\nendsolid a\n"
)
OBJ = b"# a\nmtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 -1//1\n"
DAE = (
    '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><library_geometries>'
    '<geometry id="g"><mesh><source id="p"><float_array id="a" count="9">0 0 0 1 0 0 0 1 0</float_array>'
    '<technique_common><accessor source="#a" count="3" stride="3"/></technique_common></source>'
    '<triangles count="1"><input semantic="VERTEX" source="#p" offset="0"/><p>0 1 2</p></triangles>'
    "</mesh></geometry></library_geometries></COLLADA>"
)


class TestMeshes:
    @pytest.mark.parametrize(
        ("name", "data"),
        [
            ("a.stl", stl(2, triangle(), triangle())),
            ("a.STL", stl(1, triangle()) + b"trailing"),
            ("a.stl", b"solid" + stl(1, triangle())[5:]),
            ("a.stl", ASCII),
            ("a.OBJ", OBJ),
            ("a.dae", DAE.encode()),
            ("a.DAE", DAE.encode()),
        ],
    )
    def test_what_is_taken(self, tmp_path: Path, name: str, data: bytes) -> None:
        (tmp_path / name).write_bytes(data)
        assert check_mesh(tmp_path / name) == data

    @pytest.mark.parametrize(
        ("name", "data", "reason"),
        [
            ("a.ply", b"ply", 'the suffix ".ply"'),
            ("a", b"x", 'the suffix ""'),
            ("a.stl", stl(2**32 - 1), "got 4,294,967,295 triangles in 84 bytes"),
            ("a.stl", stl(0), "got 0 triangles"),
            ("a.stl", stl(2, triangle()), "got 2 triangles in 134 bytes"),
            ("a.stl", b"short", "got 0 triangles in 5 bytes"),
            ("a.stl", DAE.encode(), "triangles in"),
            ("a.stl", b"solid\nmtllib /etc/passwd\n", 'got mtllib "/etc/passwd"'),
            ("a.obj", OBJ + b"f " + b"1 " * 40_000, "a line that is longer"),
            ("a.obj", OBJ.replace(b"a.mtl", b"/etc/passwd"), 'got mtllib "/etc/passwd"'),
            ("a.obj", OBJ.replace(b"a.mtl", b"../a.mtl"), 'got mtllib "../a.mtl"'),
            ("a.obj", OBJ.replace(b"a.mtl", b""), 'got mtllib ""'),
            ("a.dae", b"<html/>", "no COLLADA"),
            ("a.dae", b"<!DOCTYPE x [<!ENTITY a 'b'>]>" + DAE.encode(), "DOCTYPE"),
            ("a.dae", DAE.encode("utf-16"), "no COLLADA"),
        ],
    )
    def test_what_is_refused(self, tmp_path: Path, name: str, data: bytes, reason: str) -> None:
        (tmp_path / name).write_bytes(data)
        assert reason in refusal_of(check_mesh, tmp_path / name)

    def test_a_material_beside_that_is_a_pipe_or_a_link_is_refused(self, tmp_path: Path) -> None:
        (tmp_path / "a.obj").write_bytes(OBJ)
        os.mkfifo(tmp_path / "a.mtl")
        assert "mtllib" in refusal_of(check_mesh, tmp_path / "a.obj")
        (tmp_path / "a.mtl").unlink()
        (tmp_path / "a.mtl").symlink_to("/dev/zero")
        assert "mtllib" in refusal_of(check_mesh, tmp_path / "a.obj")

    def test_a_giant_is_refused_by_its_size(self, tmp_path: Path) -> None:
        with (tmp_path / "a.obj").open("wb") as file:
            file.truncate(64_000_001)
        assert "64.0 MB; expected at most 64 MB; simplify" in refusal_of(check_mesh, tmp_path / "a.obj")

    @given(place=st.integers(0, 10_000), byte=st.integers(0, 255), which=st.sampled_from([0, 1, 2, 3]))
    def test_a_changed_byte_is_read_or_refused(self, tmp_path_factory, place, byte, which) -> None:
        name, whole = [
            ("a.stl", stl(2, triangle(), triangle())),
            ("b.stl", ASCII),
            ("a.obj", OBJ),
            ("a.dae", DAE.encode()),
        ][which]
        data = bytearray(whole)
        data[place % len(data)] = byte
        path = tmp_path_factory.getbasetemp() / name
        path.write_bytes(data)
        try:
            check_mesh(path)
        except InputError as error:
            assert re.match(re.escape(str(path)), str(error))
            assert str(error).isprintable()
