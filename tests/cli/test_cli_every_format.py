"""Every command takes every file that holds what it needs: one walk, in each format, judged and drawn alike."""

import base64
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.formats.own import write_configurations, write_view
from posekit.synthesis import Walker, walker_scene
from posekit.views import view_of

FORMATS = ("bvh", "trc", "c3d", "npz", "csv", "parquet", "mot", "glb", "urdf")
FRAMES = 4


@pytest.fixture(scope="module")
def walks(tmp_path_factory: pytest.TempPathFactory, command: Callable[..., Any]) -> dict[str, Path]:
    """Write one walk in each format of motion, as the truth of a view, as postures, and as configurations."""
    folder = tmp_path_factory.mktemp("walks")
    view = view_of(walker_scene(Walker(), frames=FRAMES))
    write_view(folder / "view.json", view)
    found = {"view": folder / "view.json"}
    for name in FORMATS:
        found[name] = folder / (f"walk.{name}" if name != "urdf" else "walk")
        done = command("convert", folder / "view.json", found[name])
        assert done.code == 0, done.err
    found["postures"] = folder / "postures.npz"
    assert command("convert", found["trc"], found["postures"], "--to", "postures").code == 0
    if (found["urdf"] / "configurations.npz").exists():
        found["configurations"] = folder / "q.npz"
        with np.load(found["urdf"] / "configurations.npz") as arrays:
            write_configurations(folder / "q.npz", arrays["q"], arrays["configuration_names"].tolist())
    return found


@pytest.mark.parametrize("name", ["view", "postures", *FORMATS])
def test_validate_judges_a_walk_alike_in_every_format(
    name: str, walks: dict[str, Path], command: Callable[..., Any], tmp_path: Path
) -> None:
    done = command("validate", walks[name], "-o", tmp_path / "report.json")
    assert done.code == 0, done.err
    assert f"{FRAMES} postures: {FRAMES} valid" in done.out
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["summary"]["valid"] == FRAMES

    assert len(report["postures"]) == FRAMES


@pytest.mark.parametrize("name", ["bvh", "glb"])
def test_a_robot_is_fitted_to_motion(name: str, walks: dict[str, Path], command: Callable[..., Any]) -> None:
    done = command("validate", walks[name], "--urdf", "human", "--checks", "reach,joint-range")
    assert done.code in (0, 1), done.err
    assert f"{FRAMES} postures" in done.out


@pytest.mark.parametrize("name", ["postures", *FORMATS])
def test_render_draws_a_page_of_every_format(
    name: str, walks: dict[str, Path], command: Callable[..., Any], tmp_path: Path
) -> None:
    done = command("render", walks[name], "-o", tmp_path / "page.html")
    assert done.code == 0, done.err
    text = (tmp_path / "page.html").read_text()
    start = text.index('id="data">') + len('id="data">')
    data, _ = json.JSONDecoder().raw_decode(text[start:])
    assert data["kind"] == ("postures" if name == "postures" else "motion")
    packed = data["packed"]["points"]
    bodies = np.frombuffer(base64.b64decode(packed["base64"]), dtype=packed["type"]).reshape(-1, 19, 3)
    assert len(bodies) == FRAMES
    assert len(data["frames"]) == (1 if name == "postures" else FRAMES)
    # They stand: in the page's world z is up, and heads are above ankles.
    for body in bodies if name != "postures" else ():  # these lie as they lay in their file
        assert (body[0, 2] - body[12:14, 2].astype(float)).min() * data["step"] > 0.8


def test_inspect_tells_a_robot_and_a_table_of_survivors(
    walks: dict[str, Path], command: Callable[..., Any], tmp_path: Path
) -> None:
    told = command("inspect", walks["urdf"] / "figure.urdf")
    assert told.out.splitlines()[0].endswith("figure.urdf: a robot")
    assert "29 numbers in a configuration, 11 collision bodies, 34 pairs of which can collide" in told.out
    (tmp_path / "one.urdf").write_text(
        '<robot name="r"><link name="a"><collision><geometry><sphere radius="1"/></geometry></collision></link></robot>'
    )
    assert ", 1 collision body, no pair of which can collide" in command("inspect", tmp_path / "one.urdf").out
    assert command("recover", walks["view"], "-o", tmp_path / "r.npz").code == 0
    assert command("convert", tmp_path / "r.npz", tmp_path / "r.csv", "--posture", "all").code == 0
    assert "a table of survivors (csv)" in command("inspect", tmp_path / "r.csv").out
    judged = command("validate", tmp_path / "r.csv")
    assert judged.code == 0 and " 0 invalid" in judged.out


def test_what_holds_no_posture_is_refused_with_what_does(
    walks: dict[str, Path], command: Callable[..., Any], tmp_path: Path
) -> None:
    (tmp_path / "people.json").write_text(json.dumps([{"image_id": 1, "keypoints": [9, 9, 1] * 17}]))
    for line in (("validate",), ("render", "-o", tmp_path / "x.html")):
        done = command(line[0], tmp_path / "people.json", *line[1:])
        assert done.code == 2
        assert "got key points (coco-results); expected postures, as they are in" in done.err
        assert done.err.count("\n") == 1
    done = command("recover", walks["trc"], "-o", tmp_path / "x.npz")
    assert done.code == 2 and "motion" in done.err and "a view or key points" in done.err
