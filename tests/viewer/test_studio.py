"""A real browser draws: what is where, in which colour, and that nothing listens or is left behind."""

from __future__ import annotations

import os
import signal
import stat
import time
from pathlib import Path

import numpy as np
import pytest

from posekit.cameras import PinholeCamera, ScaledOrthographicCamera
from posekit.errors import ViewerError
from posekit.geometry import Array
from posekit.skeleton import JOINTS
from posekit.viewer.browser.browser import Browser
from posekit.viewer.browser.find_browser import find_browser
from posekit.viewer.browser.studio import Pixels, Studio, check_drawn
from posekit.viewer.scene.compose import Style, compose
from posekit.viewer.scene.drawn_posture import DrawnPosture, Look, add_posture
from posekit.viewer.scene.drawn_subject import DrawnSubject
from posekit.viewer.scene.eye import Eye, ParallelEye, ViewEye
from posekit.viewer.scene.framing import fitted_eye, view_eye
from posekit.viewer.scene.image_sight import ImageSight
from posekit.viewer.scene.scene import Scene
from posekit.viewer.scene.stage import add_stage
from posekit.viewer.scene.world import World, upright_world
from posekit.viewer.standalone import standalone_page

SIZE = (640, 480)
K = np.array([[1150.0, 0.0, 310.0], [0.0, 1100.0, 250.0], [0.0, 0.0, 1.0]])


def scene_of_joints(subject: DrawnSubject, world: World, points: Array) -> Scene:
    """Draw joints alone, each in a colour of its own that no light changes."""
    scene = Scene()
    look = Look(bodies=False, bones=False)
    add_posture(
        scene, "body", DrawnPosture(points=points[:14]), figure=subject.figure, world=world, look=look
    )
    add_stage(scene, world.place(points[:14]), ground=False)
    for k, name in enumerate(JOINTS):
        node = scene.nodes[f"/meshcat/body/joints/{name}"]
        assert node.object is not None
        material = {"type": "MeshBasicMaterial", "color": joint_colour(k)}
        node.object = {**node.object, "material": {**node.object["material"], **material}}
    return scene


def joint_colour(k: int) -> int:
    """Return a colour that differs from all others by 60 in some channel."""
    return (20 + 60 * (k % 4)) << 16 | (20 + 60 * (k // 4)) << 8 | 120


def drawn_joints(pixels: Pixels) -> Array:
    """Return the middle of each joint's ball (14, 2), pixels."""
    middles = np.full((len(JOINTS), 2), np.nan)
    for k in range(len(JOINTS)):
        colour = [joint_colour(k) >> shift & 255 for shift in (16, 8, 0)]
        rows, columns = np.nonzero((np.abs(pixels[..., :3].astype(int) - colour) < 12).all(axis=-1))
        if len(rows) > 4:  # the middle of its extent: a part may be hidden behind another ball
            middles[k] = (columns.min() + columns.max()) / 2, (rows.min() + rows.max()) / 2
    return middles


def spread(points: Array) -> Array:
    """Return a posture of which no joint hides another: the survivor, its limbs pulled apart."""
    moved = points.copy()
    moved[:14, 0] += 0.05 * np.arange(14) * np.where(np.arange(14) % 2, 1, -1)
    return moved


def test_joints_are_drawn_where_the_camera_projects_them(studio: Studio, subject: DrawnSubject) -> None:
    points = spread(subject.frames[0].points[0])
    world = upright_world(points)
    pixels = studio.draw(scene_of_joints(subject, world, points), ViewEye(K=K, world=world), size=SIZE)
    wanted = PinholeCamera(K=K).project(points[:14])
    error = np.linalg.norm(drawn_joints(pixels) - wanted, axis=1)
    assert np.isfinite(error).all()
    assert error.max() < 1.5


def test_joints_are_drawn_where_a_tilted_camera_and_a_free_eye_see_them(
    studio: Studio, subject: DrawnSubject
) -> None:
    points = spread(subject.frames[1].points[0])
    roll = np.radians(20)
    R = np.array([[np.cos(roll), np.sin(roll), 0], [0, 0, -1], [-np.sin(roll), np.cos(roll), 0]])
    world = upright_world(points, R)
    scene = scene_of_joints(subject, world, points)
    pixels = studio.draw(scene, ViewEye(K=K, world=world), size=SIZE)
    error = np.linalg.norm(drawn_joints(pixels) - PinholeCamera(K=K).project(points[:14]), axis=1)
    assert np.nanmax(error) < 1.5
    assert np.isfinite(error).sum() >= 12
    eye = fitted_eye(world.place(points[:14]), world, azimuth=20, elevation=10, aspect=4 / 3)
    pose, clip = eye.matrices(*SIZE)
    placed = np.concatenate([world.place(points[:14]), np.ones((14, 1))], axis=1)
    seen = placed @ np.linalg.inv(pose).T @ clip.T
    wanted = (seen[:, :2] / seen[:, 3:] * [1, -1] + 1) / 2 * SIZE - 0.5
    error = np.linalg.norm(drawn_joints(studio.draw(scene, eye, size=SIZE)) - wanted, axis=1)
    assert np.nanmax(error) < 2.5  # of a ball away from the axis a little more than half is seen on one side
    assert np.isfinite(error).sum() >= 12


def test_view_eye_fits_the_views_image(subject: DrawnSubject) -> None:
    sight = ImageSight(camera=PinholeCamera(K=K), image=np.zeros((14, 2)), size=(640, 480))
    eye = view_eye(sight, upright_world(subject.points()), (1280, 960))
    assert isinstance(eye, ViewEye)
    point = np.array([[0.3, -0.2, 4.0]])
    small, large = (PinholeCamera(K=each).project(point)[0] for each in (K, eye.K))
    np.testing.assert_allclose(large + 0.5, 2 * (small + 0.5), atol=1e-9)


@pytest.mark.parametrize("aspect", [1.0, 1.25])
def test_joints_are_drawn_where_an_uncalibrated_camera_projects_them(
    studio: Studio, subject: DrawnSubject, aspect: float
) -> None:
    points = spread(subject.frames[0].points[0])
    points += [1.5, 1.4, 0.0] - points[0]
    assert (points[:14, 2] < 0).any()  # depth is relative: some of it is behind the origin
    world = upright_world(points)
    camera = ScaledOrthographicCamera(scale=190.0, aspect=aspect)
    image = camera.project(points[:14])
    sight = ImageSight(camera=camera, image=image, size=(640, 480))
    scene = scene_of_joints(subject, world, points)
    for size in (SIZE, (1280, 960)):  # the view's own size, and twice as large
        eye = view_eye(sight, world, size)
        assert isinstance(eye, ParallelEye)
        seen = (drawn_joints(studio.draw(scene, eye, size=size)) + 0.5) * SIZE[0] / size[0] - 0.5
        error = np.linalg.norm(seen - image, axis=1)
        assert (error < 1.0).sum() >= 12  # one ball is hidden behind another, and a part of one
        # The same without the pixels' raster: where the clip matrix puts them, from the corner of the picture.
        pose, clip = eye.matrices(*size)
        placed = np.concatenate([world.place(points[:14]), np.ones((14, 1))], axis=1)
        clipped = placed @ np.linalg.inv(pose).T @ clip.T
        np.testing.assert_array_equal(clipped[:, 3], 1.0)  # nothing is divided by the depth
        exact = (clipped[:, :2] * [1, -1] + 1) / 2 * SIZE - 0.5
        np.testing.assert_allclose(exact, image, rtol=0, atol=1e-9)
        assert np.abs(clipped[:, 2]).max() < 1


def eye_at(position: list[float], target: list[float]) -> Eye:
    return Eye(position=np.array(position), target=np.array(target))


def orange_blue_grey(pixels: Pixels) -> tuple[int, int, int]:
    r, g, b = (pixels[..., k].astype(int) for k in range(3))
    grey = (abs(r - g) < 8) & (abs(g - b) < 8) & (r < 225)
    return int((r - b > 70).sum()), int((b - r > 70).sum()), int(grey.sum())


def test_limbs_have_their_colours_and_two_postures_differ(studio: Studio, subject: DrawnSubject) -> None:
    pictures = []
    for frame in (0, 2):
        shown = subject.frames[frame].chosen([0])
        world = upright_world(shown.points)
        made = compose(shown, figure=subject.figure, world=world, style=Style(camera=False))
        eye = fitted_eye(made.points, world, azimuth=30, elevation=14, aspect=4 / 3)
        pictures.append(studio.draw(made.scene, eye, size=SIZE))
        right, left, middle = orange_blue_grey(pictures[-1])
        assert min(right, left, middle) > 1500
        assert (pictures[-1][:20, :20] == 255).all()
    assert (np.abs(pictures[0].astype(int) - pictures[1]).max(axis=-1) > 40).mean() > 0.01


def test_right_is_on_the_left_of_a_picture_from_the_front(studio: Studio, subject: DrawnSubject) -> None:
    shown = subject.frames[0].chosen([0])
    world = upright_world(shown.points)
    made = compose(shown, figure=subject.figure, world=world, style=Style(camera=False))
    pixels = studio.draw(made.scene, view_eye(shown.sight, world, SIZE), size=SIZE)
    r, b = pixels[..., 0].astype(int), pixels[..., 2].astype(int)
    assert np.nonzero(r - b > 70)[1].mean() < np.nonzero(b - r > 70)[1].mean()


def test_camera_with_its_image_is_drawn(studio: Studio, subject: DrawnSubject) -> None:
    shown = subject.frames[0].chosen([0])
    world = upright_world(shown.points)
    eyes: list[Eye] = []
    for camera in (True, False):
        made = compose(shown, figure=subject.figure, world=world, style=Style(camera=camera))
        eye = fitted_eye(made.points, world, azimuth=55, elevation=14) if camera else eyes[0]
        eyes.append(eye)
        picture = studio.draw(made.scene, eye, size=SIZE)
        dark = int((picture[..., :3].max(axis=-1) < 90).sum())
        assert dark > 300 if camera else dark < 100
    T = made.scene.nodes.get("/meshcat/camera/eye")
    assert T is None


def test_background_and_supersampling(studio: Studio, subject: DrawnSubject) -> None:
    shown = subject.frames[0].chosen([0])
    world = upright_world(shown.points)
    eye = eye_at([-3, -2, 1.5], [0, 0, 0.8])
    shades = {}
    for background, corner in (("#336699", (51, 102, 153, 255)), ("transparent", (0, 0, 0, 0))):
        style = Style(background=background, camera=False, ground=False)
        made = compose(shown, figure=subject.figure, world=world, style=style)
        for supersample in (1, 3):
            picture = studio.draw(made.scene, eye, size=(200, 150), supersample=supersample)
            assert np.abs(picture[0, 0].astype(int) - corner).max() <= 1
            shades[supersample] = len(np.unique(picture.reshape(-1, 4), axis=0))
        assert shades[3] > shades[1]  # edges are smooth


def test_flat_pictures_are_detected(studio: Studio, subject: DrawnSubject) -> None:
    shown = subject.frames[0].chosen([0])
    world = upright_world(shown.points)
    made = compose(shown, figure=subject.figure, world=world, style=Style(camera=False, ground=False))
    away = eye_at([-3, 0, 1], [-6, 0, 1])
    with pytest.raises(ViewerError, match="picture is flat"):
        studio.draw(made.scene, away, size=SIZE)
    grey = np.full((100, 100, 4), 200, dtype=np.uint8)
    grey[::7, ::5] += 3  # a gradient, or noise of a failing driver, is no picture
    with pytest.raises(ViewerError, match="picture is flat"):
        check_drawn(grey)
    grey[40:50, 40:50, 0] = 20
    check_drawn(grey)


def test_impossible_sizes_are_refused(studio: Studio) -> None:
    eye = eye_at([-3, 0, 1], [0, 0, 1])
    for size, supersample in (((0, 100), 1), ((5000, 100), 2)):
        with pytest.raises(ViewerError, match="supersampling included"):
            studio.draw(Scene(), eye, size=size, supersample=supersample)


# --- the process ----------------------------------------------------------------------------------------


def group(pid: int) -> list[int]:
    """Return the living processes of a process group."""
    found = []
    for folder in Path("/proc").iterdir():
        try:
            fields = (folder / "stat").read_text().rpartition(")")[2].split() if folder.name.isdigit() else []
        except OSError:
            continue
        if fields and int(fields[2]) == pid and fields[0] not in "ZX":
            found.append(int(folder.name))
    return found


def listening_sockets() -> set[str]:
    """Return the inodes of all sockets that listen on this machine, TCP of both kinds."""
    found = set()
    for name in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{name}").read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == "0A":
                found.add(fields[9])
    return found


def sockets(pid: int) -> set[str]:
    found = set()
    for entry in Path(f"/proc/{pid}/fd").iterdir():
        try:
            link = str(entry.readlink())
        except OSError:
            continue
        if link.startswith("socket:["):
            found.add(link[8:-1])
    return found


def wait_until_gone(pid: int) -> list[int]:
    deadline = time.monotonic() + 5
    while group(pid) and time.monotonic() < deadline:
        time.sleep(0.05)
    return group(pid)


def test_nothing_listens_while_drawing(studio: Studio, subject: DrawnSubject) -> None:
    shown = subject.frames[0].chosen([0])
    world = upright_world(shown.points)
    made = compose(shown, figure=subject.figure, world=world, style=Style())
    studio.draw(made.scene, fitted_eye(made.points, world, azimuth=30, elevation=10), size=(160, 120))
    processes = group(studio.pid)
    assert len(processes) > 2
    own = set().union(*(sockets(pid) for pid in [*processes, os.getpid()]))
    assert own
    assert not own & listening_sockets()


def test_browser_that_hangs_is_ended() -> None:
    browser = Browser(timeout=2)
    start = time.monotonic()
    with pytest.raises(ViewerError, match=r"no answer to Runtime\.evaluate within 2 s"):
        browser.evaluate("for (;;) {}")
    assert time.monotonic() - start < 8
    assert wait_until_gone(browser.pid) == []
    with pytest.raises(ViewerError, match="was closed"):
        browser.evaluate("1")
    browser.close()


def test_browser_that_is_killed_is_reported() -> None:
    with Browser() as browser:
        os.kill(browser.pid, signal.SIGKILL)
        with pytest.raises(ViewerError, match="it ended during"):
            browser.evaluate("1")
        assert wait_until_gone(browser.pid) == []


def test_page_that_crashes_is_reported() -> None:
    with Browser(timeout=10) as browser:
        for pid in group(browser.pid):
            if b"--type=renderer" in Path(f"/proc/{pid}/cmdline").read_bytes():
                os.kill(pid, signal.SIGKILL)
        with pytest.raises(ViewerError, match="crashed"):
            browser.evaluate("new Promise(done => setTimeout(done, 5000))")
        assert wait_until_gone(browser.pid) == []


def test_nothing_is_left_after_closing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with Browser() as browser:
        assert len(list(tmp_path.iterdir())) == 1
        assert browser.evaluate("6 * 7") == 42
        with pytest.raises(ViewerError, match="the page failed: Error: so it is"):
            browser.evaluate("throw new Error('so it is')")
    assert wait_until_gone(browser.pid) == []
    assert list(tmp_path.iterdir()) == []


def test_program_that_is_no_browser(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake = tmp_path / "fake"
    fake.write_text("#!/bin/sh\necho cannot open the display >&2\nexit 3\n")
    monkeypatch.setenv("POSEKIT_BROWSER", str(fake))
    with pytest.raises(ViewerError, match="is no program that can be run"):
        find_browser()
    fake.chmod(fake.stat().st_mode | stat.S_IXUSR)
    with pytest.raises(ViewerError, match=r"it ended during .*cannot open the display"):
        Browser()
    monkeypatch.delenv("POSEKIT_BROWSER")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ViewerError, match=r"apt-get install chromium.*POSEKIT_BROWSER"):
        find_browser()
    fake.rename(tmp_path / "google-chrome")
    assert find_browser() == str(tmp_path / "google-chrome")


def test_page_draws_and_loads_nothing_from_outside(subject: DrawnSubject, tmp_path: Path) -> None:
    shown = subject.frames[0].chosen([0, 1])
    world = upright_world(shown.points)
    made = compose(shown, figure=subject.figure, world=world, style=Style())
    eye = fitted_eye(made.points, world, azimuth=30, elevation=10)
    page = tmp_path / "page.html"
    page.write_text(standalone_page(made.scene, eye=eye, title="</title><b>&"), encoding="utf-8")
    with Browser(size=(320, 240)) as browser:
        browser.open(page)
        assert browser.evaluate("document.title") == "</title><b>&"
        count = browser.evaluate("let n = 0; viewer.scene.traverse(o => { n += o.isMesh ? 1 : 0 }); n")
        assert count >= 2 * (11 + 19)
        url = browser.evaluate("viewer.render(); viewer.renderer.domElement.toDataURL()")
        assert len(url) > 5000
        blocked = browser.evaluate("fetch('http://127.0.0.1:9/').then(() => 'loaded', () => 'refused')")
        assert blocked == "refused"
        assert browser.requests()[0] == page.as_uri()
        outside = [url for url in browser.requests() if not url.startswith(("file:", "data:", "blob:"))]
        assert [url for url in outside if "127.0.0.1:9" not in url] == []
