"""Robots that are meant to harm: each is one line of error, no crash, no hang, nothing written.

What native libraries do with these files is measured, not assumed: radii below zero are loaded, NaN drops a body
without a word, a deep chain overflows the stack, a mesh that places itself does too.
"""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.errors import FigureError, InputError, PosekitError
from posekit.robots import ProbeLimits, Robot, load_robot, loading
from posekit.robots.untrusted import probe
from posekit.robots.urdf import check_urdf

INERTIA = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
VALID = (
    '<?xml version="1.0"?>\n<robot name="r"><link name="a"><inertial><origin xyz="0 0 0"/><mass value="1"/>'
    f'{INERTIA}</inertial><collision name="c"><origin xyz="0 0 0" rpy="0 0 0"/><geometry><sphere radius="0.1"/>'
    '</geometry></collision></link><link name="b"><collision><geometry><box size="0.1 0.2 0.3"/></geometry>'
    '</collision></link><link name="c"><collision><geometry><cylinder radius="0.1" length="0.5"/></geometry>'
    '</collision></link><joint name="j" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0 0 1"/>'
    '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint><joint name="k" '
    'type="prismatic"><parent link="b"/><child link="c"/><origin xyz="0 0 1" rpy="0 0 0"/><axis xyz="1 0 0"/>'
    '<limit lower="0" upper="1" effort="1" velocity="1"/><mimic joint="j" multiplier="2" offset="0"/></joint></robot>'
)
LEFT_OUT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'


def swap(old: str, new: str) -> Callable[[str], str]:
    def change(text: str) -> str:
        assert old in text
        return text.replace(old, new, 1)

    return change


def more_links(count: int, *, chain: bool) -> str:
    return "".join(
        f'<link name="l{k}"/><joint name="x{k}" type="fixed"><parent link="{f"l{k - 1}" if chain and k else "a"}"/>'
        f'<child link="l{k}"/></joint>'
        for k in range(count)
    )


ENTITY = '<!DOCTYPE robot [<!ENTITY a "b"><!ENTITY c "&a;&a;&a;&a;">]><robot '
NUMBERS = ("nan", "inf", "-inf", "1e999", "", "x", "1 2 3 4", "1,5", "0x10", "1_0", "\u0661", "1e", "--1")
PLACES = {
    "xyz": 'xyz="0 0 1"',
    "rpy": 'rpy="0 0 0"',
    "axis": 'xyz="1 0 0"',
    "radius": 'radius="0.1"',
    "size": 'size="0.1 0.2 0.3"',
    "length": 'length="0.5"',
    "lower": 'lower="-1"',
    "upper": 'upper="1"',
    "effort": 'effort="1"',
    "velocity": 'velocity="1"',
    "mass": 'value="1"',
    "ixx": 'ixx="1"',
    "multiplier": 'multiplier="2"',
    "offset": 'offset="0"',
}
HOSTILE: dict[str, tuple[Callable[[str], str], str]] = {
    **{
        f"{name} {number!r}": (swap(place, f'{place.partition("=")[0]}="{number}"'), "finite number")
        for name, place in PLACES.items()
        for number in NUMBERS
    },
    "doctype": (swap("<robot ", "<!DOCTYPE robot><robot "), "DOCTYPE"),
    "entities": (swap("<robot ", ENTITY), "DOCTYPE"),
    "an external entity": (swap("<robot ", '<!DOCTYPE r SYSTEM "file:///etc/passwd"><robot '), "DOCTYPE"),
    "an undeclared entity": (swap('name="j"', 'name="&j;"'), "undefined entity"),
    "another root": (swap("<robot ", "<sdf "), "not well-formed"),
    "an SDF": (lambda _: '<sdf version="1.7"><model name="a"/></sdf>', "expected <robot>"),
    "a default namespace": (swap("<robot ", '<robot xmlns="http://example.org" '), "expected <robot>"),
    "no robot name": (swap(' name="r"', ""), "no name"),
    "an unknown version": (swap('name="r"', 'name="r" version="9"'), "<robot version=…>"),
    "no links": (lambda _: '<robot name="r"/>', "0 links"),
    "nothing": (lambda _: "", "an empty file"),
    "blanks": (lambda _: "  \n", "no element found"),
    "deep elements": (swap("</robot>", "<a>" * 100 + "</a>" * 100 + "</robot>"), "nested elements"),
    "a deep chain": (swap("</robot>", more_links(300, chain=True) + "</robot>"), "a chain of more than 250"),
    "a chain of 5000": (swap("</robot>", more_links(5000, chain=True) + "</robot>"), "5,003 links"),
    "10,000 links": (swap("</robot>", more_links(10_000, chain=False) + "</robot>"), "10,003 links"),
    "200,000 elements": (swap("</robot>", "<x/>" * 200_000 + "</robot>"), "more than 100,000 elements"),
    "a cycle": (swap('<child link="b"/>', '<child link="a"/>'), "link 'a'"),
    "a cycle beside the tree": (
        swap(
            "</robot>",
            '<link name="p"/><link name="q"/><joint name="pq" type="fixed"><parent link="p"/><child link="q"/></joint>'
            '<joint name="qp" type="fixed"><parent link="q"/><child link="p"/></joint></robot>',
        ),
        "hangs on itself",
    ),
    "two trees": (swap("</robot>", '<link name="p"/></robot>'), "2 links that hang on no joint"),
    "two parents": (
        swap('<parent link="b"/><child link="c"/>', '<parent link="a"/><child link="b"/>'),
        "two joints",
    ),
    "itself as parent": (
        swap('<parent link="b"/><child link="c"/>', '<parent link="c"/><child link="c"/>'),
        "itself",
    ),
    "an unknown parent": (swap('<parent link="b"/>', '<parent link="z"/>'), "unknown: z"),
    "no parent": (swap('<parent link="b"/>', ""), "one parent and one child"),
    "two children": (
        swap('<child link="c"/>', '<child link="c"/><child link="b"/>'),
        "one parent and one child",
    ),
    "a link twice": (swap('<link name="b">', '<link name="a">'), "link 'a' 2 times"),
    "a joint twice": (swap('name="k"', 'name="j"'), "joint 'j' 2 times"),
    "a link without a name": (swap('<link name="b">', "<link>"), "link: got the name"),
    "a joint called universe": (swap('name="k"', 'name="universe"'), 'the name "universe"'),
    "a line break in a name": (swap('name="k"', 'name="a&#10;b"'), "a name that prints"),
    "an escape in a name": (swap('name="k"', 'name="&#27;[31m"'), "not well-formed"),
    "an unknown type": (swap('"prismatic"', '"ball"'), 'the type "ball"'),
    "no type": (swap(' type="revolute"', ""), 'the type ""'),
    "no limit": (swap(LEFT_OUT, ""), "no limit"),
    "two limits": (swap(LEFT_OUT, LEFT_OUT * 2), "two <limit>"),
    "no effort": (swap(' effort="1"', ""), "no effort"),
    "swapped limits": (swap('lower="-1"', 'lower="2"'), "lower limit 2 above its upper 1; swap them"),
    "an axis of zeros": (swap('axis xyz="0 0 1"', 'axis xyz="0 0 0"'), "an axis of length 0"),
    "a tiny axis": (swap('axis xyz="0 0 1"', 'axis xyz="0 0 1e-200"'), "an axis of length 1e-200"),
    "a long slide": (swap('axis xyz="1 0 0"', 'axis xyz="2 0 0"'), "an axis of length 2"),
    "a mimic of nothing": (swap('mimic joint="j"', 'mimic joint="z"'), 'a mimic of "z"'),
    "a mimic of itself": (swap('mimic joint="j"', 'mimic joint="k"'), "a mimic of itself"),
    "a quaternion": (swap('<origin xyz="0 0 1"/>', '<origin xyz="0 0 1" quat_xyzw="9 9 9 9"/>'), "quat_xyzw"),
    "a place beyond reach": (swap('xyz="0 0 1"', 'xyz="0 0 1e300"'), "at most 1,000,000"),
    "a negative mass": (swap('value="1"', 'value="-1"'), "a mass of -1 kg"),
    "an inertial without mass": (swap('<mass value="1"/>', ""), "an inertial without a mass"),
    "an inertial without inertia": (swap(INERTIA, ""), "without its six moments"),
    "five moments": (swap(' ixy="0"', ""), "without its six moments"),
    "a negative radius": (
        swap('radius="0.1"', 'radius="-1"'),
        "a sphere with radius -1; expected it positive",
    ),
    "no radius": (swap(' radius="0.1"', ""), "a sphere without radius"),
    "a radius of zero": (swap('radius="0.1"', 'radius="0"'), "expected it positive"),
    "a negative length": (swap('length="0.5"', 'length="-0.5"'), "expected both positive"),
    "a negative box": (swap('size="0.1 0.2 0.3"', 'size="0.1 -0.2 0.3"'), "expected all positive"),
    "a shape of URDF 1.1": (
        swap('<sphere radius="0.1"/>', '<capsule radius="1" length="1"/>'),
        "URDF 1.0 drop",
    ),
    "an unknown shape": (swap('<sphere radius="0.1"/>', "<torus/>"), "a collision body <torus>"),
    "no shape": (swap('<sphere radius="0.1"/>', ""), "a collision body with 0 shapes"),
    "two shapes": (swap('<sphere radius="0.1"/>', '<sphere radius="1"/>' * 2), "with 2 shapes"),
    "no geometry": (swap('<geometry><sphere radius="0.1"/></geometry>', ""), "with 0 shapes"),
    "501 bodies": (
        swap("</link>", '<collision><geometry><sphere radius="1"/></geometry></collision>' * 500 + "</link>"),
        "503 collision bodies",
    ),
    "a visual body without a shape": (
        swap('<link name="b">', '<link name="b"><visual><geometry/></visual>'),
        "a visual body with 0 shapes",
    ),
    "a material without a name": (
        swap(
            '<link name="b">',
            '<link name="b"><visual><geometry><sphere radius="1"/></geometry><material/></visual>',
        ),
        "a material without a name",
    ),
    "a colour of NaN": (
        swap(
            '<link name="b">',
            '<link name="b"><visual><geometry><sphere radius="1"/></geometry><material name="m">'
            '<color rgba="1 1 nan 1"/></material></visual>',
        ),
        "4 finite numbers",
    ),
    "a safety controller without gain": (swap("<mimic", "<safety_controller/><mimic"), "no k_velocity"),
    "a capsule of no name": (
        swap("</link>", "<collision_checking><capsule/></collision_checking></link>"),
        "<collision_checking>: got no name",
    ),
    "a mesh without a name": (swap('<sphere radius="0.1"/>', "<mesh/>"), "a mesh without a file name"),
    "a mesh of no extent": (
        swap('<sphere radius="0.1"/>', '<mesh filename="a.stl" scale="1 0 1"/>'),
        "of scale",
    ),
    "a mesh of NaN scale": (
        swap('<sphere radius="0.1"/>', '<mesh filename="a.stl" scale="1 nan 1"/>'),
        "finite",
    ),
    "a device as mesh": (swap('<sphere radius="0.1"/>', '<mesh filename="/dev/zero"/>'), "outside of them"),
    "a password file as mesh": (
        swap('<sphere radius="0.1"/>', '<mesh filename="file:///etc/passwd"/>'),
        "outside",
    ),
    "a mesh above": (
        swap('<sphere radius="0.1"/>', '<mesh filename="package://../x.stl"/>'),
        "the model's package",
    ),
    "a mesh on the net": (
        swap('<sphere radius="0.1"/>', '<mesh filename="http://a/b.stl"/>'),
        "package://, file://",
    ),
}
ENCODINGS: dict[str, tuple[bytes, str]] = {
    "UTF-16": (VALID.encode("utf-16"), "expected text in UTF-8"),
    "UTF-16 without a mark": (VALID.encode("utf-16-le"), "a NUL character"),
    "UTF-32": (VALID.encode("utf-32"), "expected text in UTF-8"),
    "Latin-1": (VALID.replace('"r"', '"ü"').encode("latin-1"), "got 0xfc; expected text in UTF-8"),
    "NUL": (VALID.encode() + b"\0", "a NUL character"),
    "a surrogate": (VALID.encode().replace(b'"r"', b'"\xed\xa0\x80"'), "expected text in UTF-8"),
    "a zip": (b"PK\x03\x04" + bytes(100), "a NUL character"),
    "10 MB": (b" " * 10_000_001, "at most 10 MB"),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder of its own for a model."""
    (tmp_path / "model").mkdir()
    return tmp_path / "model"


def refused(path: Path, **options: Any) -> str:
    """Load a model that is to be refused: one line, within a few seconds, nothing written."""
    before, start = sorted(path.parent.iterdir()), time.monotonic()
    with pytest.raises(InputError) as caught:
        load_robot(path, **options)
    assert time.monotonic() - start < 20
    assert sorted(path.parent.iterdir()) == before
    text = str(caught.value)
    assert text.isprintable()
    assert len(text) < 1000
    assert str(path.parent) in text
    return text


def test_what_the_hostile_ones_are_made_from_is_valid() -> None:
    robot = Robot(urdf=VALID)
    assert len(robot.body_names) == 3
    assert robot.collision_pairs == (("a_0", "c_0"),)


@pytest.mark.parametrize("name", HOSTILE)
def test_a_urdf_with(folder: Path, name: str) -> None:
    change, reason = HOSTILE[name]
    path = folder / "x.urdf"
    path.write_text(change(VALID), encoding="utf-8")
    text = refused(path, untrusted=False)
    assert reason in text or ("finite" in reason and "nothing" in text)


@pytest.mark.parametrize("name", ENCODINGS)
def test_a_urdf_in(folder: Path, name: str) -> None:
    data, reason = ENCODINGS[name]
    (folder / "x.urdf").write_bytes(data)
    assert reason in refused(folder / "x.urdf", untrusted=False)


def test_a_byte_order_mark_is_harmless(folder: Path) -> None:
    (folder / "x.urdf").write_bytes(b"\xef\xbb\xbf" + VALID.encode())
    assert len(load_robot(folder / "x.urdf", untrusted=False).body_names) == 3


def test_a_urdf_cut_anywhere_is_refused() -> None:
    for end in range(0, len(VALID) - 1, 7):
        with pytest.raises(InputError, match="not well-formed"):
            check_urdf(VALID[:end], "x.urdf")


def test_files_that_are_none(folder: Path) -> None:
    os.mkfifo(folder / "pipe.urdf")
    (folder / "loop.urdf").symlink_to("loop.urdf")
    (folder / "zero.urdf").symlink_to("/dev/zero")
    (folder / "dir.urdf").mkdir()
    for name, reason in [
        ("pipe.urdf", "a pipe or a device"),
        ("zero.urdf", "a pipe or a device"),
        ("dir.urdf", "a directory"),
        ("none.urdf", "No such file"),
    ]:
        assert reason in refused(folder / name)
    with pytest.raises(InputError, match="symbolic links"):
        load_robot(folder / "loop.urdf")
    with pytest.raises(InputError, match="a pipe or a device"):
        (folder / "x.urdf").write_text(VALID)
        load_robot(folder / "x.urdf", srdf=folder / "pipe.urdf")


def test_an_srdf_of_another_robot_is_refused(folder: Path) -> None:
    (folder / "x.urdf").write_text(VALID)
    for text, reason in [
        ('<robot><disable_collisions link1="a" link2="torso"/></robot>', 'the link "torso"'),
        (ENTITY + 'name="&c;"/>', "DOCTYPE"),
        ("<robot>", "not well-formed"),
        ("<robot/>\0", "a NUL character"),
        ("<robot>" + "<a>" * 200, "nested elements"),
    ]:
        (folder / "x.srdf").write_text(text)
        assert reason in refused(folder / "x.urdf", untrusted=False)


def triangle(*vertices: float) -> bytes:
    return struct.pack("<12fH", 0, 0, 1, *(vertices or (0, 0, 0, 1, 0, 0, 0, 1, 0)), 0)


def stl(count: int, *triangles: bytes) -> bytes:
    return b" " * 80 + struct.pack("<I", count) + b"".join(triangles)


OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def dae(indices: str = "0 1 2", library: str = "", node: str = '<instance_geometry url="#g"/>') -> bytes:
    return (
        '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><library_geometries>'
        '<geometry id="g"><mesh><source id="p"><float_array id="a" count="9">0 0 0 1 0 0 0 1 0</float_array>'
        '<technique_common><accessor source="#a" count="3" stride="3"><param name="X" type="float"/>'
        '<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>'
        '<vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="1"><input '
        f'semantic="VERTEX" source="#v" offset="0"/><p>{indices}</p></triangles></mesh></geometry>'
        f'</library_geometries>{library}<library_visual_scenes><visual_scene id="s"><node id="n">{node}</node>'
        '</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>'
    ).encode()


ITSELF = '<library_nodes><node id="m"><instance_node url="#m"/></node></library_nodes>'
NESTED = (
    "<library_nodes>"
    + "".join(f'<node id="n{k}">' + f'<instance_node url="#n{k + 1}"/>' * 3 + "</node>" for k in range(30))
    + '<node id="n30"><instance_geometry url="#g"/></node></library_nodes>'
)


def chain_of_nodes(count: int) -> str:
    nodes = (f'<node id="c{k}"><instance_node url="#c{k + 1}"/></node>' for k in range(count))
    return f'<library_nodes>{"".join(nodes)}<node id="c{count}"/></library_nodes>'


MESHES: dict[str, tuple[str, bytes, str]] = {
    "a huge count": ("m.stl", stl(2**32 - 1, triangle()), "4,294,967,295 triangles"),
    "a NaN vertex": ("m.stl", stl(1, triangle(0, 0, np.nan, 1, 0, 0, 0, 1, 0)), "a vertex at nan"),
    "no surface": ("m.stl", stl(1, triangle(*[0.0] * 9)), "a collision body that coal cannot load"),
    "another format": ("m.stl", b"BLENDER-v279" + bytes(500), "triangles in"),
    "a vertex beyond the list": ("m.obj", OBJ + b"f 1 2 9\n", "vertex index out of range"),
    "a normal that is none": ("m.obj", OBJ + b"f 1//x 2//2 3//3\n", ""),
    "a line beyond the list": ("m.obj", OBJ + b"f 1 2 3\nl 1 99999\n", "coal cannot load"),
    "a face of many corners": ("m.obj", OBJ + b"f " + b"1 2 3 " * 100_000, "a line that is longer"),
    "materials elsewhere": ("m.obj", b"mtllib /dev/stdin\n" + OBJ + b"f 1 2 3\n", "mtllib"),
    "entities": ("m.dae", b"<!DOCTYPE x [<!ENTITY a 'b'>]>" + dae(), "DOCTYPE"),
    "an index beyond the list": ("m.dae", dae("0 1 99"), "coal cannot load"),
    "a negative index": ("m.dae", dae("0 1 -2"), "coal cannot load"),
    "no scene": ("m.dae", b'<COLLADA version="1.4.1"/>', "coal cannot load"),
    "an infinite vertex": ("m.stl", stl(1, triangle(0, 0, np.inf, 1, 0, 0, 0, 1, 0)), ""),
    "a vertex that is no number": ("m.obj", OBJ.replace(b"1 0 0", b"1 nan 0") + b"f 1 2 3\n", ""),
    "a vertex beyond any body": (
        "m.obj",
        OBJ.replace(b"1 0 0", b"1 1e30 0") + b"f 1 2 3\n",
        "a vertex at 1e+30",
    ),
    "more numbers declared than there are": (
        "m.dae",
        dae().replace(b'count="9"', b'count="4000000000"'),
        "",
    ),
    "more faces declared than there are": ("m.dae", dae().replace(b's count="1"', b's count="4000000"'), ""),
    "nodes that place nodes, three each": (
        "m.dae",
        dae("0 1 2", NESTED, '<instance_node url="#n0"/>'),
        "many nodes that place nodes",
    ),
    "a node that places itself": (
        "m.dae",
        dae("0 1 2", ITSELF, '<instance_node url="#m"/>'),
        "a node that holds itself",
    ),
    "a node that places what it hangs on": (
        "m.dae",
        dae(node='<node id="o"><instance_node url="#n"/></node>'),
        "a node that holds itself",
    ),
    "a node that places its own name": (
        "m.dae",
        dae(node='<node name="o"><node><instance_node url="#o"/></node></node>'),
        "a node that holds itself",
    ),
    "a scene that places itself": (
        "m.dae",
        dae(node='<instance_node url="#s"/>'),
        "a node that holds itself",
    ),
    "a chain of 70 placed nodes": (
        "m.dae",
        dae("0 1 2", chain_of_nodes(70), '<instance_node url="#c0"/>'),
        "more than 64 deep",
    ),
    "70 nodes in each other": ("m.dae", dae(node="<node>" * 70 + "</node>" * 70), "nested elements"),
    "an unclosed element": ("m.dae", dae(node="<node>"), "not well-formed"),
}
WITH_MESH = swap('<sphere radius="0.1"/>', '<mesh filename="NAME"/>')


@pytest.mark.parametrize("name", MESHES)
def test_a_mesh_with(folder: Path, name: str) -> None:
    file, data, reason = MESHES[name]
    (folder / file).write_bytes(data)
    (folder / "x.urdf").write_text(WITH_MESH(VALID).replace("NAME", file))
    if reason:
        assert reason in refused(folder / "x.urdf")
    else:  # read in one way or another, or refused
        try:
            load_robot(folder / "x.urdf")
        except InputError as error:
            assert str(error).isprintable()


def test_meshes_of_one_name_in_several_folders_stay_apart(folder: Path) -> None:
    def bodies(kind: str, *names: str) -> str:
        return "".join(
            f'<{kind}><geometry><mesh filename="{name}/m.stl"/></geometry></{kind}>' for name in names
        )

    for count, name in enumerate("pqr", 1):
        (folder / name).mkdir()
        (folder / name / "m.stl").write_bytes(
            stl(count, *[triangle(k, 0, 0, k, 1, 0, 0, 1, k) for k in range(1, count + 1)])
        )
    links = bodies("visual", "p", "r", "q") + bodies("collision", "p", "q")
    (folder / "x.urdf").write_text(f'<robot name="r"><link name="a">{links}</link></robot>')
    robot = load_robot(folder / "x.urdf", visuals=True)
    assert robot.geometry is not None and robot.visuals is not None
    assert [one.geometry.num_tris for one in robot.geometry.geometryObjects] == [1, 2]
    assert [one.geometry.num_tris for one in robot.visuals.geometryObjects] == [1, 3, 2]


def test_visual_bodies_beyond_the_limit_are_refused_where_they_are_loaded(folder: Path) -> None:
    many = '<visual><geometry><sphere radius="1"/></geometry></visual>' * 501
    (folder / "x.urdf").write_text(VALID.replace("</link>", many + "</link>", 1))
    assert len(load_robot(folder / "x.urdf").body_names) == 3
    for untrusted in (False, True):
        said = refused(folder / "x.urdf", visuals=True, untrusted=untrusted)
        assert "501 visual bodies; expected at most 500" in said


@pytest.mark.parametrize("late", [False, True])
def test_what_is_loaded_is_what_the_child_saw(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, late: bool
) -> None:
    """A mesh that is exchanged beside the child's look, before it or after it, reaches nobody."""
    (folder / "m.STL").write_bytes(stl(1, triangle()))
    (folder / "x.urdf").write_text(
        WITH_MESH(VALID)
        .replace("NAME", "m.STL")
        .replace(
            '<link name="b">',
            '<link name="b"><visual><geometry><mesh filename="./m.STL"/></geometry></visual>',
        )
    )

    def exchanged(settings: dict[str, Any], **options: Any) -> None:
        if late:
            probe(settings, **options)
        (folder / "m.STL").write_bytes(stl(2, triangle(), triangle(0, 0, 5, 1, 0, 5, 0, 1, 5)))
        if not late:
            probe(settings, **options)

    monkeypatch.setattr(loading, "probe", exchanged)
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    robot = load_robot(folder / "x.urdf", visuals=True)
    assert robot.geometry is not None and robot.visuals is not None
    for bodies in (robot.geometry, robot.visuals):
        assert [
            one.geometry.num_tris for one in bodies.geometryObjects if "BVH" in str(type(one.geometry))
        ] == [1]
    assert not any((tmp_path / "temporary").iterdir())
    again = load_robot(folder / "x.urdf").geometry
    assert again is not None and again.geometryObjects[0].geometry.num_tris == 2


def test_a_giant_mesh_is_refused_by_its_size(folder: Path) -> None:
    for name in ("m.obj", "m.stl", "m.dae"):
        with (folder / name).open("wb") as file:
            file.truncate(10**10)
        (folder / "x.urdf").write_text(WITH_MESH(VALID).replace("NAME", name))
        assert "10,000.0 MB; expected at most 64 MB" in refused(folder / "x.urdf", untrusted=False)


def test_meshes_that_are_too_large_together(folder: Path) -> None:
    many = "".join(
        f'<collision><geometry><mesh filename="{k}.stl"/></geometry></collision>' for k in range(5)
    )
    for k in range(5):
        (folder / f"{k}.stl").write_bytes(stl(450_000, triangle() * 450_000))
    (folder / "x.urdf").write_text(VALID.replace("</link>", many + "</link>", 1))
    assert "meshes of 112.5 MB; expected at most 100 MB" in refused(folder / "x.urdf", untrusted=False)


def test_a_mesh_that_takes_the_memory_ends_the_child_alone(folder: Path) -> None:
    rng = np.random.default_rng(1)
    record = np.zeros(100_000, dtype=[("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    record["v"] = rng.normal(size=record["v"].shape)
    (folder / "m.stl").write_bytes(stl(len(record), record.tobytes()))
    (folder / "x.urdf").write_text(WITH_MESH(VALID).replace("NAME", "m.stl"))
    text = refused(folder / "x.urdf", limits=ProbeLimits(memory=240_000_000))
    assert "0.24 GB of memory" in text or "ended with SIG" in text


TRUSTED = """
import json, sys
from pathlib import Path
from posekit.errors import InputError
from posekit.robots import load_robot
said = {}
for path in sorted(Path(sys.argv[1]).glob("*.urdf")):
    try:
        load_robot(path, untrusted=False)
        said[path.stem] = "loaded"
    except InputError as error:
        said[path.stem] = str(error)
print(json.dumps(said))
"""


def test_no_crash_where_a_hostile_one_is_trusted_either(folder: Path) -> None:
    """Every row, in one process that must live to the end: the checks stand before the native libraries."""
    for k, (file, data, _) in enumerate(MESHES.values()):
        (folder / f"{k}{file}").write_bytes(data)
        (folder / f"m{k}.urdf").write_text(WITH_MESH(VALID).replace("NAME", f"{k}{file}"))
    for k, (change, _) in enumerate(HOSTILE.values()):
        (folder / f"u{k}.urdf").write_text(change(VALID), encoding="utf-8")
    command = [sys.executable, "-c", TRUSTED, str(folder)]
    done = subprocess.run(command, capture_output=True, check=False, timeout=60)
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert len(said) == len(HOSTILE) + len(MESHES)
    loaded = [name for name, text in said.items() if text == "loaded"]
    assert len(loaded) <= 1


class TestTheRestOfTheTable:
    """Silent or fatal inputs that are no files: each is refused before Pinocchio or coal sees it."""

    def test_nan_in_q(self) -> None:
        figure = load_figure()
        q = np.full((1, figure.model.nq), np.nan)
        with pytest.raises(FigureError, match="not finite"):
            figure.collides(q)

    def test_a_quaternion_of_another_length(self) -> None:
        figure = load_figure()
        q = np.zeros((1, figure.model.nq))
        q[0, 6] = 1.1
        with pytest.raises(FigureError, match="has length"):
            figure.forward_kinematics(q)

    def test_an_unknown_frame(self) -> None:
        with pytest.raises(InputError, match='the frame "tail"'):
            Robot(urdf=VALID).frame_id("tail")

    def test_geometry_data_after_the_pairs(self) -> None:
        geometry = Robot(urdf=VALID).geometry
        assert geometry is not None
        assert len(geometry.createData().collisionResults) == len(geometry.collisionPairs) == 1

    def test_every_error_is_posekits(self) -> None:
        assert issubclass(InputError, PosekitError)
