"""One registry of formats, and one door: every format is declared once, and loaded when it is needed."""

import json
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import posekit
from posekit.errors import InputError
from posekit.formats import registry
from posekit.formats.format import Content, Format
from posekit.formats.given_file import GivenFile
from posekit.formats.keypoints import KeyPoints, key_point_formats, read_keypoints
from posekit.formats.keypoints.key_point_format import KeyPointFormat
from posekit.formats.motion import Motion, SurvivorTable, write_motion, write_survivors
from posekit.formats.own import NamedConfigurations, Postures, View, write_configurations, write_view
from posekit.formats.own_files import OWN_FORMATS, OwnFormat
from posekit.formats.recognising import recognise
from posekit.formats.skeleton_maps import load_skeleton_map
from posekit.skeleton import JOINTS, POINTS
from posekit.views import builtin_view

COCO = load_skeleton_map("coco_17")


def motion(**changed: object) -> Motion:
    points = np.random.default_rng(0).normal(scale=0.3, size=(4, len(POINTS), 3))
    given: dict = {"names": POINTS, "points": points, "time": np.arange(4) / 30, "rate": 30.0, "up": "+z"}
    return Motion(**{**given, "source": "still", **changed})


def test_the_registry_says_of_each_format_what_the_format_says_of_itself() -> None:
    for content, group in registry.BUILT_IN.items():
        for where, suffixes in group.items():
            one = registry._load(where)
            assert one.holds is content and set(registry.suffixes_of(one)) == set(suffixes), where


def test_a_name_is_one_formats_among_those_that_hold_the_same() -> None:
    for content in Content:
        found = [one.name for one in registry.formats(content)]
        assert len(set(found)) == len(found)
    for one in registry.formats():
        assert one.title and "\n" not in one.title and all(end.startswith(".") for end in one.suffixes)


def test_every_reader_of_posekits_own_files_is_there() -> None:
    from importlib import import_module

    for one in OWN_FORMATS:
        if one.reads:
            module, _, function = one.reader.partition(":")
            assert callable(getattr(import_module(module), function))


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("view.json", '{"schema": "posekit.view/1"}'),
        ("coco.json", '[{"image_id": 1, "category_id": 1, "keypoints": [1, 2, 2]}]'),
        ("walk.trc", "PathFileType\t4\n"),
        ("cameras.toml", "[a]\nmatrix = 1\n"),
    ],
)
def test_recognising_a_file_loads_no_heavy_library(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text)
    code = (
        "import sys; from posekit.formats.recognising import recognise; "
        f"recognise({str(tmp_path / name)!r}); print(*sys.modules)"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    heavy = {"ezc3d", "trimesh", "pyarrow", "cv2", "numba", "PIL"}
    if name == "view.json":
        heavy |= {"pinocchio", "pydantic", "posekit.formats.motion", "posekit.formats.keypoints"}
    assert not heavy & set(out.split())


def test_what_is_opened_is_what_the_file_holds(tmp_path: Path) -> None:
    view = builtin_view("seq1")
    write_view(tmp_path / "view.json", view)
    write_motion(tmp_path / "walk.trc", motion())
    write_configurations(tmp_path / "q.npz", np.zeros((2, 3)), ("a", "b", "c"))
    np.savez(tmp_path / "lifted.npz", joints=np.zeros((5, 14, 3)))
    np.savez(tmp_path / "bare.npz", q=np.zeros((5, 3)))
    np.savez(tmp_path / "camera.npz", K=np.diag([1000.0, 1000.0, 1.0]))
    table = SurvivorTable(
        frame=np.zeros(2, int), time=np.zeros(2), survivor=np.arange(2), joints=np.ones((2, 14, 3))
    )
    write_survivors(tmp_path / "survivors.csv", table)
    write_survivors(tmp_path / "survivors.npz", table)
    (tmp_path / "people.json").write_text(json.dumps([{"image_id": 1, "keypoints": [9, 9, 1] * 17}]))
    for name, kind in (
        ("view.json", View),
        ("walk.trc", Motion),
        ("q.npz", NamedConfigurations),
        ("lifted.npz", Postures),
        ("bare.npz", NamedConfigurations),
        ("survivors.csv", SurvivorTable),
        ("survivors.npz", SurvivorTable),
        ("people.json", KeyPoints),
        ("camera.npz", dict),
    ):
        assert isinstance(posekit.open(tmp_path / name), kind), name
    assert posekit.open(tmp_path / "camera.npz", "camera").K[0, 0] == 1000
    np.testing.assert_allclose(posekit.open(tmp_path / "view.json").image, view.image, rtol=0, atol=1e-12)


def test_postures_are_had_of_every_file_that_holds_some(tmp_path: Path) -> None:
    view = builtin_view("seq1")
    write_view(tmp_path / "view.json", view)
    write_motion(tmp_path / "walk.csv", motion())
    table = SurvivorTable(
        frame=np.zeros(2, int), time=np.zeros(2), survivor=np.arange(2), joints=np.ones((2, 14, 3))
    )
    write_survivors(tmp_path / "survivors.csv", table)
    of_motion = posekit.open(tmp_path / "walk.csv", "postures")
    np.testing.assert_allclose(of_motion.joints, motion().points[:, : len(JOINTS)], atol=1e-9)
    np.testing.assert_allclose(
        posekit.open(tmp_path / "view.json", "postures").joints, view.truth, rtol=0, atol=1e-12
    )
    np.testing.assert_array_equal(posekit.open(tmp_path / "survivors.csv", "postures").joints, table.joints)
    (tmp_path / "people.json").write_text(json.dumps([{"image_id": 1, "keypoints": [9, 9, 1] * 17}]))
    with pytest.raises(InputError, match=r"people\.json: got key points \(coco-results\); expected postures"):
        posekit.open(tmp_path / "people.json", "postures")


def test_what_is_not_wanted_is_refused_with_the_formats_that_hold_it(tmp_path: Path) -> None:
    write_motion(tmp_path / "walk.trc", motion())
    with pytest.raises(
        InputError, match=r"got motion \(trc\); expected key points \(openpose, coco"
    ) as refused:
        posekit.open(tmp_path / "walk.trc", "key-points")
    assert "\n" not in str(refused.value)
    with pytest.raises(InputError, match=r"as_: got \"postuers\"; .*postures"):
        posekit.open(tmp_path / "walk.trc", "postuers")
    (tmp_path / "x.xyz").write_text("1 2 3")
    with pytest.raises(InputError, match="a file of no known format"):
        posekit.open(tmp_path / "x.xyz")


def _read_dots(given: object, layout: object) -> KeyPoints:
    points = np.loadtxt(given.path).reshape(1, 17, 2)  # type: ignore[attr-defined]
    return KeyPoints(
        format="dots",
        source=str(given.path),  # type: ignore[attr-defined]
        layout=COCO,
        pictures=("0",),
        frame=np.zeros(1, dtype=np.intp),
        points=points,
    )


DOTS = KeyPointFormat(
    name="dots",
    title="a row a point",
    suffixes=(".dots",),
    looks_like=lambda given: given.suffix == ".dots",
    read=_read_dots,
)


@pytest.fixture
def joined(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Pretend that three packages are installed: one with a format, one that cannot be loaded, one that gives none."""
    package = ModuleType("acme_formats")
    package.DOTS = DOTS  # type: ignore[attr-defined]
    package.NOTHING = 3  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "acme_formats", package)
    points = [
        EntryPoint(name=name, value=value, group=registry.ENTRY_POINTS)
        for name, value in (
            ("dots", "acme_formats:DOTS"),
            ("a", "no_such_module:X"),
            ("b", "acme_formats:NOTHING"),
        )
    ]
    monkeypatch.setattr(registry, "entry_points", lambda group: [one for one in points if one.group == group])
    registry._third_party.cache_clear()
    yield
    registry._third_party.cache_clear()


@pytest.mark.usefixtures("joined")
@pytest.mark.filterwarnings("ignore:the format")
def test_a_format_of_another_package_is_read_like_any_other(tmp_path: Path, command) -> None:
    np.savetxt(tmp_path / "a.dots", np.arange(34.0).reshape(17, 2) + 100)
    assert recognise(tmp_path / "a.dots").holds is Content.KEY_POINTS
    assert posekit.open(tmp_path / "a.dots").points[0, 3].tolist() == [106, 107]
    assert read_keypoints(tmp_path / "a.dots", "dots").format == "dots"
    assert "dots" in key_point_formats()
    outcome = command("inspect", tmp_path / "a.dots")
    assert outcome.code == 0 and "key points (dots)" in outcome.out, outcome.err


@pytest.mark.usefixtures("joined")
def test_what_another_package_gives_and_is_no_format_costs_itself_and_a_warning() -> None:
    with pytest.warns(UserWarning) as told:
        found = registry.formats(Content.KEY_POINTS)
    assert DOTS in found
    said = [str(one.message) for one in told]
    assert any("a (no_such_module:X) is left out: No module named" in one for one in said)
    assert any("b (acme_formats:NOTHING) is left out: got int; expected" in one for one in said)


def test_own_formats_are_formats() -> None:
    assert all(isinstance(one, Format) and isinstance(one, OwnFormat) for one in OWN_FORMATS)


def test_the_format_of_the_page_that_says_how_to_add_one(tmp_path: Path) -> None:
    page = Path(__file__).parents[2] / "docs" / "formats" / "add-a-format.md"
    code = textwrap.dedent(page.read_text(encoding="utf-8").partition("```python\n")[2].partition("```")[0])
    said: dict = {}
    exec(compile(code, str(page), "exec"), said)
    rows = np.arange(68.0).reshape(2, 34)
    np.savetxt(tmp_path / "a.dots", rows, delimiter=",")
    given = GivenFile(tmp_path / "a.dots")
    assert said["DOTS_FORMAT"].looks_like(given)
    found = said["DOTS_FORMAT"].read(given, None)
    np.testing.assert_array_equal(found.points.reshape(2, -1), rows)
