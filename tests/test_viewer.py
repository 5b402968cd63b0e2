"""Pictures, pages, overlays and plots: what is drawn lies where the data says."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import posekit
from posekit.cameras import PinholeCamera
from posekit.errors import InputError, ViewerError
from posekit.skeleton import JOINTS, TREE_SEGMENTS
from posekit.viewer.browser import Browser, find_browser

ARM = """<robot name="arm"><link name="base"/>
<link name="right_arm"><visual><geometry><box size="0.1 0.1 0.5"/></geometry></visual></link>
<joint name="right_turn" type="revolute"><parent link="base"/><child link="right_arm"/><origin xyz="0 0 0.4"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""


def has_browser() -> bool:
    """Return whether pictures can be drawn here."""
    try:
        find_browser()
    except ViewerError:
        return False
    return True


drawn = pytest.mark.skipif(not has_browser(), reason="no browser")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("viewer")


@pytest.fixture(scope="module")
def view() -> posekit.View:
    """A calibrated view of the walker, with lens distortion."""
    camera = PinholeCamera(
        K=np.array([[900, 0, 320], [0, 900, 240], [0, 0, 1.0]]),
        size=(640, 480),
        distortion=np.array([0.1, -0.05, 0, 0]),
    )
    given = posekit.builtin_view("seq2")
    truth = given.truth - np.nanmean(given.truth, axis=(0, 1)) + [0.2, 0, 4.2]
    return posekit.View(
        camera=camera, time=given.time, image=camera.project(truth), truth=truth, root=truth[:, 0]
    )


@pytest.fixture(scope="module")
def recovery(view: posekit.View) -> posekit.Recovery:
    return posekit.recover(view)


@pytest.fixture(scope="module")
def motion(view: posekit.View) -> posekit.Motion:
    """Forty frames of a walk in which the right elbow is bent backward in frames 20 to 22."""
    figure = posekit.load_figure()
    q = np.tile(figure.neutral, (40, 1))
    q[:, 0] = np.linspace(0, 1.2, 40)
    elbow = figure.configuration_names.index("right_elbow_flexion")
    q[:, elbow] = 0.4
    q[20:23, elbow] = -0.8
    return posekit.Motion(joints=figure.points(q), time=np.arange(40) / 30, up="+z", source="walk.bvh")


def data_of(page: Path) -> dict[str, Any]:
    """Return the data of a page."""
    text = page.read_text(encoding="utf-8")
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    data: dict[str, Any] = json.loads(found.group(1))
    return data


def points_of(data: dict[str, Any], name: str = "points") -> list[np.ndarray[Any, Any]]:
    """Return the points (H, P, 3) of each frame of a page, metres, NaN where unknown."""
    packed = data["packed"][name]
    whole = np.frombuffer(base64.b64decode(packed["base64"]), dtype=packed["type"])
    steps = whole.reshape(-1, len(data["points"]), 3).astype(float)
    steps[steps == -32768] = np.nan
    return [
        steps[one["first"] : one["first"] + one["held"]] * data["step"] + one["origin"]
        for one in data["frames"]
    ]


def test_every_posture_of_a_page_projects_onto_the_image(
    folder: Path, view: posekit.View, recovery: posekit.Recovery
) -> None:
    posekit.render(recovery, folder / "page.html", view=view)
    data = data_of(folder / "page.html")
    camera = data["camera"]
    axes = np.array([camera["right"], camera["down"], camera["forward"]])
    for number, bodies in enumerate(points_of(data)):
        cam = (bodies[:, :14] - camera["position"]) @ axes.T
        assert len(cam) == len(recovery[number]) > 0
        assert np.abs(view.camera.project(cam) - view.image[number]).max() < 0.1
    assert sum(one["count"] for one in data["frames"]) == len(recovery.survivors)
    floor = [float(np.nanmin(bodies[..., 2])) for bodies in points_of(data)]
    assert min(floor) == pytest.approx(0.03, abs=0.1)


def test_a_motion_page_has_the_findings_of_its_report(folder: Path, motion: posekit.Motion) -> None:
    report = posekit.validate(motion)
    assert not report.ok[21]
    posekit.render(motion, folder / "motion.html")
    posekit.render(report, folder / "both.html", view=motion)
    posekit.render(report, folder / "table.html")
    data, both, table = (data_of(folder / f"{name}.html") for name in ("motion", "both", "table"))
    assert data["frames"] == both["frames"]
    assert not table["frames"] and table["clips"] and "packed" not in table
    for k, one in enumerate(data["frames"]):
        count = int((report.findings["row"] == k).sum())
        assert len(one.get("findings", {}).get("0", [])) == count
    elbow = next(one for one in data["places"] if one["where"] == "right_elbow.flexion")
    assert elbow["joints"] == [JOINTS.index("right_elbow")]
    spans = data["clips"][0]["spans"]
    assert all(data["frames"][span["index"]]["number"] == span["worst"] for span in spans)


def test_a_page_holds_a_person_and_a_robot(folder: Path, motion: posekit.Motion) -> None:
    """Bodies of several kinds are shown by the 14 joints that they have in common."""
    robot = posekit.load_robot("g1")
    walk = posekit.Motion(q=np.tile(robot.neutral, (4, 1)), robot="g1", q_names=robot.configuration_names)
    posekit.save(walk, folder / "g1.npz")
    posekit.save(motion, folder / "person.npz")
    files = [folder / "g1.npz", folder / "person.npz"]
    report = posekit.validate(files)
    posekit.render(report, folder / "mixed.html", view=[posekit.open(file) for file in files])
    data = data_of(folder / "mixed.html")
    assert data["points"][: len(JOINTS)] == list(JOINTS) and len(data["frames"]) == len(report)
    standing, points = robot.points(robot.neutral[None])[0], points_of(data)[0][0, : len(JOINTS)]
    for a, b in TREE_SEGMENTS:
        shown, true = (np.linalg.norm(one[a] - one[b]) for one in (points, standing))
        assert shown == pytest.approx(true, abs=2e-3, nan_ok=True)


def test_texts_of_files_stay_texts(folder: Path, motion: posekit.Motion) -> None:
    evil = posekit.Motion(joints=motion.joints, source="</script><script>evil()</script>", notes=("<!--",))
    posekit.render(evil, folder / "<b>.html")
    text = (folder / "<b>.html").read_text(encoding="utf-8")
    assert "evil()</script>" not in text and "<!--" not in text.replace("<!DOCTYPE", "")
    assert "<title>&lt;b&gt;" in text
    posekit.render(evil, folder / "{data}.html")
    assert data_of(folder / "{data}.html")["title"] == "{data}"
    assert not re.search(r'(src|href)="', text)


@drawn
def test_pages_in_a_browser(
    folder: Path, view: posekit.View, recovery: posekit.Recovery, motion: posekit.Motion
) -> None:
    posekit.render(recovery, folder / "result.html", view=view)
    posekit.render(motion, folder / "walk.html")
    key = "document.dispatchEvent(new KeyboardEvent('keydown', {key: '%s', bubbles: true}))"
    with Browser(size=(1280, 800)) as browser:
        browser.open(folder / "result.html")
        assert browser.evaluate("page.state.drawn")
        browser.evaluate(key % "2")
        places = np.array(browser.evaluate("scene.places()"))
        # The look from the camera is its image but for the lens, scaled and moved.
        plain = PinholeCamera(K=view.camera.K)  # type: ignore[union-attr]
        body = recovery.survivors.joints[np.asarray(recovery.answer.survivor)[0]]
        image = plain.project(body)
        spread = [one - one.mean(axis=0) for one in (places, image)]
        scale = (spread[0] * spread[1]).sum() / (spread[1] ** 2).sum()
        assert np.abs(spread[0] - scale * spread[1]).max() < 1.0
        browser.evaluate(key % "ArrowRight")
        assert browser.evaluate("page.state.frame") == 1
        browser.evaluate(key % "ArrowDown")
        assert browser.evaluate("page.state.survivor") != browser.evaluate("page.frame().best")
        for width in (420, 1920):
            browser.resize((width, 900))
            assert browser.evaluate("document.documentElement.scrollWidth") <= width
        assert [Path(one).name for one in browser.requests] == ["result.html"]
        browser.open(folder / "walk.html")
        browser.evaluate("document.querySelector('.spans button').click()")
        frame = browser.evaluate("page.frame().number")
        assert browser.evaluate("page.findings().length") > 0
        assert frame in {span.worst_frame for span in posekit.validate(motion).spans}


def side_pixels(pixels: Any) -> tuple[Any, Any]:
    """Return masks of the orange and the blue pixels."""
    red, green, blue = np.moveaxis(np.asarray(pixels, dtype=int), -1, 0)
    return (red - blue > 60) & (red > green), (blue - red > 60) & (blue > green)


@drawn
def test_a_picture_shows_right_orange_and_left_blue_and_every_frame_of_a_range(
    folder: Path, motion: posekit.Motion
) -> None:
    posekit.render(motion, folder / "front.png", frame=0, azimuth=0, size=(320, 320))
    picture = np.asarray(Image.open(folder / "front.png"))
    assert picture.shape == (320, 320, 3)
    right, left = (np.nonzero(one)[1].mean() for one in side_pixels(picture))
    assert right < 160 < left  # seen from the front
    assert (picture[0] == 255).all()  # the body is inside the picture
    posekit.render(motion, folder / "some.gif", frame=(3, 7), size=(160, 160))
    with Image.open(folder / "some.gif") as film:
        assert getattr(film, "n_frames", 0) == 5


@drawn
def test_a_robot_and_the_postures_of_a_result_are_drawn(
    folder: Path, view: posekit.View, recovery: posekit.Recovery
) -> None:
    (folder / "arm.urdf").write_text(ARM, encoding="utf-8")
    arm = str(folder / "arm.urdf")
    turned = posekit.Motion(q=np.array([[0, 0, 0, 0, 0, 0, 1, 0.0], [0, 0, 0, 0, 0, 0, 1, 0.9]]), robot=arm)
    posekit.render(turned, folder / "arm.png", size=(240, 240))
    posekit.render(turned, folder / "arm.html")
    assert data_of(folder / "arm.html")["points"] == ["base", "right_arm"]
    assert (np.asarray(Image.open(folder / "arm.png")) < 200).any()
    posekit.render(recovery, folder / "camera.png", view=view, frame=1, which="answer", size=(400, 300))
    picture = np.asarray(Image.open(folder / "camera.png"))
    orange, _ = side_pixels(picture)
    inset, body = orange[:, :75].sum(), orange[:, 75:].sum()
    assert inset > 20 and body > 20  # the image beside the body, not over it


@pytest.mark.parametrize("names", ["in order", "by name"])
def test_an_overlay_covers_the_person_and_nothing_else(
    folder: Path, view: posekit.View, recovery: posekit.Recovery, names: str
) -> None:
    pictures = folder / names
    pictures.mkdir()
    for k in range(len(view)):
        Image.new("RGB", (640, 480), (40 * k, 90, 90)).save(
            pictures / f"{9 - k if names == 'by name' else k}.png"
        )
    if names == "by name":
        named = tuple(f"{9 - k}.png" for k in range(len(view)))
        view = posekit.View(**{**vars_of(view), "pictures": named})
    posekit.render(recovery, folder / "over.png", view=view, over=pictures, frame=2)
    picture = np.asarray(Image.open(folder / "over.png")).astype(int)
    changed = np.abs(picture - [80, 90, 90]).max(axis=-1) > 12
    rows, columns = np.nonzero(changed)
    body = recovery.survivors.joints[np.asarray(recovery.answer.survivor)[2]]
    image, room = view.camera.project(body), 0.15 * 900 / 4
    low, high = image.min(axis=0) - room, image.max(axis=0) + room
    assert (
        low[0] < columns.min() <= image[:, 0].min() + 5 and image[:, 0].max() - 5 <= columns.max() < high[0]
    )
    assert low[1] < rows.min() <= image[:, 1].min() + 5 and image[:, 1].max() - 5 <= rows.max() < high[1]
    for x, y in image:
        assert changed[round(y) - 4 : round(y) + 5, round(x) - 4 : round(x) + 5].any()


def vars_of(view: posekit.View) -> dict[str, Any]:
    """Return the fields of a view."""
    return {name: getattr(view, name) for name in view.__dataclass_fields__}


def test_a_film_is_drawn_over(folder: Path, view: posekit.View) -> None:
    av = pytest.importorskip("av")
    pictures = folder / "film"
    pictures.mkdir()
    for k in range(len(view)):
        Image.new("RGB", (640, 480), (200, 200, 200)).save(pictures / f"{k}.png")
    posekit.render(view, folder / "one.mp4", over=pictures)
    posekit.render(view, folder / "two.mp4", over=folder / "one.mp4")
    with av.open(str(folder / "two.mp4")) as film:
        frames = [one.to_ndarray(format="rgb24") for one in film.decode(video=0)]
    assert len(frames) == len(view) and frames[0].shape == (480, 640, 3)
    assert side_pixels(frames[0])[0].sum() > 100


def test_plots_name_what_they_draw(folder: Path, motion: posekit.Motion, recovery: posekit.Recovery) -> None:
    report = posekit.validate(motion)
    for name in ("timeline", "again"):
        posekit.render(report, folder / f"{name}.svg")
    text = (folder / "timeline.svg").read_text(encoding="utf-8")
    assert text == (folder / "again.svg").read_text(encoding="utf-8")
    for span in report.spans:
        assert f'id="{span.check}/{span.place}:{span.first}-{span.last}"' in text
    posekit.render(recovery, folder / "angles.svg", which="angles", frame=(1, 3))
    angles = (folder / "angles.svg").read_text(encoding="utf-8")
    assert angles.count('id="angle') == angles.count('id="survivors') == 22


@pytest.mark.parametrize(
    ("target", "options"),
    [
        ("a.bmp", {}),
        ("a", {}),
        ("none/a.html", {}),
        ("a.png", {"frame": 40}),
        ("a.html", {"frame": (3, 2)}),
        ("a.gif", {"which": "angles"}),
        ("a.png", {"over": "nowhere"}),
        ("a.png", {"over": "nowhere", "view": "view"}),
    ],
)
def test_mistakes_are_one_line_and_leave_no_file(
    folder: Path, motion: posekit.Motion, view: posekit.View, target: str, options: dict[str, Any]
) -> None:
    if options.get("view"):
        motion, options = motion.take(slice(0, len(view))), {**options, "view": view}
    with pytest.raises(InputError) as caught:
        posekit.render(motion, folder / "mistakes" / target if "/" in target else folder / target, **options)
    assert "\n" not in str(caught.value)
    assert not (folder / target).exists()


def test_views_and_motions_must_fit(folder: Path, motion: posekit.Motion, view: posekit.View) -> None:
    recovery = posekit.recover(view.take([0, 1]))
    with pytest.raises(InputError, match="5 frames; expected 2"):
        posekit.render(recovery, folder / "x.html", view=view)
    with pytest.raises(InputError, match="10 frames; expected 40"):
        posekit.render(posekit.validate(motion), folder / "x.html", view=motion.take(slice(0, 10)))
