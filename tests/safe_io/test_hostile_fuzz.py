"""Valid files with bytes changed, cut out, doubled or exchanged: what comes out is a value or a PosekitError.

Hypothesis mutates texts in this process up to where native libraries start; a handful of mutated robots go on
to them through the child process, whose death would be an error too, but would be told from a refusal.
"""

from __future__ import annotations

import io
import json
import random
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.fuzz.damage import damaged
from posekit.body import load_figure
from posekit.body.urdf import parse
from posekit.errors import FigureError, InputError, PosekitError
from posekit.formats.own import Postures, read_postures, read_view, write_postures, write_view
from posekit.robots import Robot, load_robot
from posekit.robots.find import find
from posekit.robots.srdf import check_srdf
from posekit.robots.urdf import check_urdf
from posekit.safe_io import check_mesh, open_npz, parse_json, parse_toml
from posekit.safe_io.text_file import decode
from posekit.validators import load_ranges
from posekit.views.builtin import builtin_view

FIGURE = load_figure()
LINKS = [frame.name for frame in FIGURE.model.frames]
URDF, SRDF = FIGURE.urdf.encode(), FIGURE.srdf.encode()
TABLE = (Path(find("stick_figure").urdf).parent / "ranges" / "table1.toml").read_bytes()


@st.composite
def mutated(draw: st.DrawFn, whole: bytes) -> bytes:
    """Change a text in one to four places, as `make fuzz` does."""
    return damaged(whole, random.Random(draw(st.integers(0, 2**32))))


def one_line(error: PosekitError) -> None:
    text = str(error)
    assert text.isprintable(), text
    assert 10 < len(text) < 1500


@settings(max_examples=300)
@given(mutated(URDF))
def test_urdf(data: bytes) -> None:
    try:
        check_urdf(decode("x.urdf", data), "x.urdf")
    except InputError as error:
        one_line(error)
        return
    # What passes the check is what Pinocchio reads: it must not raise anything of its own, nor drop a body.
    try:
        Robot(urdf=decode("x.urdf", data))
    except InputError as error:
        one_line(error)


@settings(max_examples=100)
@given(mutated(URDF))
def test_the_figures_urdf(data: bytes) -> None:
    try:
        parse(decode("x.urdf", data), "x.urdf")
    except (FigureError, InputError) as error:
        one_line(error)


@settings(max_examples=200)
@given(mutated(SRDF))
def test_srdf(data: bytes) -> None:
    try:
        check_srdf(decode("x.srdf", data), "x.srdf", LINKS)
    except InputError as error:
        one_line(error)


@settings(max_examples=300)
@given(data=mutated(TABLE))
def test_toml(data: bytes, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.getbasetemp() / "ranges.toml"
    path.write_bytes(data)
    try:
        load_ranges(str(path))
    except InputError as error:
        one_line(error)
    try:
        parse_toml(decode("x", data), "x")
    except InputError as error:
        one_line(error)


@pytest.fixture(scope="module")
def view(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("view") / "view.json"
    write_view(path, builtin_view("seq1"))
    return path.read_bytes()


@settings(max_examples=150)
@given(data=st.data())
def test_json(data: st.DataObject, view: bytes, tmp_path_factory: pytest.TempPathFactory) -> None:
    document = data.draw(mutated(view))
    path = tmp_path_factory.getbasetemp() / "view.json"
    path.write_bytes(document)
    try:
        read_view(path)
    except PosekitError as error:
        one_line(error)
    try:
        json.dumps(parse_json("x", document), allow_nan=False)
    except InputError as error:
        one_line(error)


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("npz") / "p.npz"
    joints = np.random.default_rng(1).normal(size=(3, 14, 3))
    write_postures(path, Postures(joints=joints))
    stored = io.BytesIO()
    with open_npz(path) as packed:
        np.savez(
            stored, joints=packed.array("joints", "f", (None, 14, 3))
        )  # not packed: mutations reach headers
    return stored.getvalue()


@settings(max_examples=300)
@given(data=st.data())
def test_npz(data: st.DataObject, archive: bytes, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.getbasetemp() / "p.npz"
    path.write_bytes(data.draw(mutated(archive)))
    try:
        assert read_postures(path).joints.shape[1:] == (14, 3)
    except InputError as error:
        one_line(error)


MESHES = [
    path
    for path in sorted(find("human").package_dirs[1].rglob("*"))
    if path.suffix.lower() in (".stl", ".obj", ".dae") and path.stat().st_size < 30_000
]


@settings(max_examples=150)
@given(data=st.data(), which=st.integers(0, 10**6))
def test_meshes(data: st.DataObject, which: int, tmp_path_factory: pytest.TempPathFactory) -> None:
    source = MESHES[which % len(MESHES)]
    path = tmp_path_factory.getbasetemp() / f"mesh{source.suffix}"
    path.write_bytes(data.draw(mutated(source.read_bytes())))
    try:
        assert check_mesh(path)
    except InputError as error:
        one_line(error)


@pytest.mark.parametrize("seed", range(8))
def test_a_handful_through_the_child(tmp_path: Path, seed: int) -> None:
    """Small damage to a mesh, which a text check lets through as often as not, given to coal in the child."""
    rng = np.random.default_rng(seed)
    source = MESHES[int(rng.integers(len(MESHES)))]
    data = bytearray(source.read_bytes())
    for place in rng.integers(0, len(data), 3):
        data[place] = rng.integers(256)
    (tmp_path / f"m{source.suffix}").write_bytes(data)
    (tmp_path / "x.urdf").write_text(
        f'<robot name="r"><link name="a"><collision><geometry><mesh filename="m{source.suffix}"/></geometry>'
        "</collision></link></robot>"
    )
    try:
        load_robot(tmp_path / "x.urdf")
    except InputError as error:
        one_line(error)
    assert len(list(tmp_path.iterdir())) == 2
