"""What other programs and people read: headers, units and sentences that posekit writes."""

from __future__ import annotations

import json
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import posekit
from posekit.cameras import LeeChenCamera
from posekit.motion import Motion
from posekit.samples import samples
from posekit.synthesis import Walker, forget_camera, random_views, walker_view


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Motion:
    folder = tmp_path_factory.mktemp("samples")
    samples(folder)
    motion: Motion = posekit.open(folder / "walk.npz")
    return motion


def test_a_report_names_every_check_that_finds_nothing(walk: Motion) -> None:
    report = posekit.validate(walk)
    quiet = [name for name, one in report.by_check().items() if not one["frames"] and not one["undecided"]]
    line = next(line for line in report.summary().split("\n") if line.startswith("nothing found by "))
    assert quiet and line.removeprefix("nothing found by ").split(", ") == quiet


def test_the_scale_of_a_result_is_in_pixels_per_unit(tmp_path: Path) -> None:
    view = replace(forget_camera(random_views(1, np.random.default_rng(4))), unit="cm", deviation=2.0)
    found = posekit.recover(view)
    found.save(tmp_path / "r.json")
    postures = json.loads((tmp_path / "r.json").read_text())["frames"][0]["postures"]
    assert [one["scale"] for one in postures] == pytest.approx(found.survivors.scale / 100)
    assert posekit.open(tmp_path / "r.json").survivors.scale == pytest.approx(found.survivors.scale)


def test_the_header_of_c3d_states_floats(tmp_path: Path, walk: Motion) -> None:
    posekit.save(walk, tmp_path / "w.c3d")
    data = (tmp_path / "w.c3d").read_bytes()
    count, first, last = (struct.unpack_from("<H", data, place)[0] for place in (2, 6, 8))
    scale, rate = (struct.unpack_from("<f", data, place)[0] for place in (12, 20))
    assert (count, first, last) == (19, 1, len(walk))
    assert scale < 0 and rate == pytest.approx(30)  # a negative scale means floats


@pytest.mark.parametrize(("stated", "up"), [(None, "+y"), ("+z", "+z")])
def test_angles_of_opensim_have_y_up_unless_stated(tmp_path: Path, stated: str | None, up: str) -> None:
    text = "angles\nnRows=2\nnColumns=2\ninDegrees=yes\nendheader\ntime\tknee_angle_r\n0.0\t10\n0.1\t20\n"
    (tmp_path / "ik.mot").write_text(text)
    motion = posekit.open(tmp_path / "ik.mot", up=stated)
    assert motion.up == up and motion.q[:, 0] == pytest.approx(np.radians([10, 20]))


def test_a_small_person_may_be_near() -> None:
    view = walker_view(Walker(), camera=(4.0, 0.0, 0.0), frames=1)
    known = replace(view, camera=LeeChenCamera(f=0.05), root=view.truth[:, 0])
    lengths = posekit.load_figure().lengths
    far = posekit.recover(replace(known, lengths=dict(lengths)))
    share = 0.2
    small = {name: share * length for name, length in lengths.items()}
    near = posekit.recover(replace(known, lengths=small, root=share * known.root, truth=share * known.truth))
    assert near.survivors.joints[:, 0, 2].max() < 1.0
    assert len(near.survivors) == len(far.survivors) > 0
