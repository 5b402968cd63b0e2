"""The interactive page, clicked through in a real Chromium with the network watched."""

import dataclasses
import functools
import json
import os
import re
import time

import numpy as np
import pytest

from posekit.errors import InputError, ViewerError
from posekit.formats.own import Postures
from posekit.recovery import recover
from posekit.recovery.result import result_of
from posekit.skeleton import JOINTS
from posekit.viewer.browser.find_browser import find_browser
from posekit.viewer.page.data import page_data
from posekit.viewer.page.page import page_html, write_page
from posekit.viewer.scene.world import upright_world
from posekit.views.builtin import builtin_view

FLAGS = [
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-dev-shm-usage",
]
HOSTILE = (
    "</script><script>window.hacked=1</script><img src=x onerror=window.hacked=1>\u2028${window.hacked=1}"
)


@functools.cache
def walking_result():
    checks = ("rigid-parts", "joint-range", "collision", "walking")
    return result_of(recover(builtin_view("seq1"), checks=checks, group=0.05), unit="cm")


def result_with(**changes):
    frame = dataclasses.replace(walking_result().frames[0], **changes)
    return dataclasses.replace(walking_result(), frames=[frame])


def world_of(result):
    return upright_world(np.concatenate([frame.joints for frame in result.frames]))


def wait_until(tab, condition):
    """Poll from outside: the page's policy forbids it to evaluate text itself."""
    deadline = time.monotonic() + 10
    while not tab.evaluate(condition):
        assert time.monotonic() < deadline, condition
        tab.wait_for_timeout(20)


@pytest.fixture(scope="module")
def chromium():
    sync_api = pytest.importorskip("playwright.sync_api")
    try:
        program = find_browser()
    except ViewerError as error:
        pytest.skip(str(error))
    flags = FLAGS + (["--no-sandbox"] if os.geteuid() == 0 else [])
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=flags)
        yield browser
        browser.close()


@pytest.fixture
def opened(chromium, tmp_path):
    """Open the page of a result; return the tab, what it asked the network for, and its errors."""
    tabs = []

    def open_page(given, view=None, **options):
        path = tmp_path / "page.html"
        write_page(path, given, view, **options)
        tab = chromium.new_page(viewport={"width": 1280, "height": 800})
        tabs.append(tab)
        asked, errors = [], []
        tab.on("request", lambda request: asked.append(request.url))
        tab.on("websocket", lambda socket: asked.append(socket.url))
        tab.on("pageerror", lambda error: errors.append(str(error)))
        tab.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
        tab.goto(path.as_uri())
        wait_until(tab, "page.state.drawn === true")
        return tab, asked, errors

    yield open_page
    for tab in tabs:
        tab.close()


def drawn(tab):
    return np.array(tab.evaluate("scene.drawn()"), dtype=float)


def test_choosing_a_survivor_and_a_frame_moves_the_drawn_joints(opened):
    result, view = walking_result(), builtin_view("seq1")
    tab, asked, errors = opened(result, view)
    world = world_of(result)

    def expected(frame, survivor):
        return world.place(result.frames[frame].joints[survivor])

    assert tab.locator("#survivors-body tr").count() == len(result.frames[0].joints)
    likeliest = int(result.frames[0].probability.argmax())
    np.testing.assert_allclose(drawn(tab), expected(0, likeliest), atol=1e-4)
    before = tab.screenshot()
    tab.click("#survivors-body tr:nth-child(4)")
    np.testing.assert_allclose(drawn(tab), expected(0, 3), atol=1e-4)
    assert tab.get_attribute("#survivors-body tr:nth-child(4)", "aria-selected") == "true"
    tab.keyboard.press("ArrowUp")
    np.testing.assert_allclose(drawn(tab), expected(0, 2), atol=1e-4)

    tab.locator("#frame").fill("2")
    frame, survivor = tab.evaluate("[page.state.frame, page.state.survivor]")
    assert frame == 2
    np.testing.assert_allclose(drawn(tab), expected(2, survivor), atol=1e-4)
    assert "frame 2 of 0 to 4" in tab.inner_text("#frame-text")
    assert tab.locator("#survivors-body tr").count() == len(result.frames[2].joints)
    tab.click("#play")
    wait_until(tab, "page.state.frame === 4")
    tab.click("#play")

    for look in ("side", "camera", "above"):
        tab.click(f"[data-look={look}]")
    for layer in ("others", "rays", "truth"):
        tab.check(f"[data-show={layer}]")
        assert tab.evaluate(f"scene.layers.{layer}.children.length") > 0
    tab.wait_for_timeout(200)
    assert tab.screenshot() != before
    assert [url for url in asked if not url.startswith("file://")] == []
    assert len(asked) == 1
    assert errors == []


def test_the_tables_say_what_the_result_says(opened):
    result = walking_result()
    tab, _, errors = opened(result)
    frame = result.frames[0]
    rows = tab.locator("#levels tbody tr").all_inner_texts()
    assert len(rows) == len(JOINTS)
    for row, physical, motion in zip(rows, frame.levels["physical"], frame.levels["motion"], strict=True):
        assert [int(n) for n in re.findall(r"\d+", row)] == [physical, motion]
    choices = [row.split()[-1] for row in rows[1:]]
    likeliest = int(frame.probability.argmax())
    assert choices == ["farther" if choice == "1" else "nearer" for choice in frame.branches[likeliest]]
    tab.click("[data-tab=rejected]")
    counts = [
        int(text.replace(",", "")) for text in tab.locator("#rejected tbody td:last-child").all_inner_texts()
    ]
    assert counts == sorted(frame.rejected.values(), reverse=True)
    assert "8,192 possible postures" in tab.inner_text("#rejected .note")
    # Sorting by a margin puts the smallest first, then the largest.
    heading = tab.locator("#survivors-head th", has_text="joint range")
    heading.click()
    order = [int(text) for text in tab.locator("#survivors-body td:first-child").all_inner_texts()]
    margins = frame.margins["joint_range"]
    np.testing.assert_allclose(margins[order], np.sort(margins), atol=1e-5)
    # Sorting by probability puts the likeliest first.
    heading = tab.locator("#survivors-head th", has_text="probability")
    heading.click()
    order = [int(text) for text in tab.locator("#survivors-body td:first-child").all_inner_texts()]
    np.testing.assert_allclose(frame.probability[order], np.sort(frame.probability)[::-1], atol=1e-6)
    column = 1 + tab.locator("#survivors-head th").all_inner_texts().index("probability\u00a0▾")
    first = tab.inner_text(f"#survivors-body tr:first-child td:nth-child({column})")
    assert first == f"{100 * frame.probability.max():.1f} %"
    heading.click()
    again = [int(text) for text in tab.locator("#survivors-body td:first-child").all_inner_texts()]
    np.testing.assert_allclose(frame.probability[again], np.sort(frame.probability), atol=1e-6)
    assert errors == []


def test_the_answer_is_told_beside_the_table(opened):
    tab, _, errors = opened(walking_result())
    told = tab.locator("#answer p").all_inner_texts()
    assert [line.partition(":")[0] for line in told] == ["likeliest", "what else it can be"]
    assert errors == []


def test_results_without_probabilities_have_no_such_column(opened):
    result = dataclasses.replace(
        walking_result(),
        frames=[dataclasses.replace(one, probability=None) for one in walking_result().frames],
    )
    tab, _, errors = opened(result)
    assert tab.locator("#survivors-head th", has_text="probability").count() == 0
    assert tab.locator("#survivors-body tr").count() == len(result.frames[0].joints)
    assert errors == []


def test_from_the_camera_all_survivors_are_one_image(opened):
    """The page's own camera, put where the view's was, sees every survivor's joints at the same pixels."""
    tab, _, _ = opened(walking_result())
    tab.click("[data-look=camera]")
    seen = []
    for survivor in range(3):
        tab.evaluate(f"page.chooseSurvivor({survivor})")
        seen.append(
            tab.evaluate(
                """() => {
                viewer.render();
                const place = (mesh) => mesh.getWorldPosition(new MeshCat.THREE.Vector3());
                const joints = scene.layers.joints.children.slice(0, 14);
                return joints.map((mesh) => place(mesh).project(viewer.camera).toArray().slice(0, 2));
                }"""
            )
        )
    np.testing.assert_allclose(seen[1:], [seen[0]] * 2, atol=1e-3)
    assert np.abs(seen[0]).max() < 1  # and all of it is in the picture


def test_hostile_text_is_shown_and_not_run(opened):
    frame = walking_result().frames[0]
    result = result_with(
        rejected={f"{HOSTILE}/{HOSTILE}": 5},
        margins={HOSTILE: frame.margins["joint_range"]},
        levels={**frame.levels, "joint": [HOSTILE] * 14},
        branches=[HOSTILE] * len(frame.branches),
    )
    result = dataclasses.replace(result, settings={HOSTILE: [HOSTILE]})
    tab, asked, errors = opened(result, title=HOSTILE)
    for name in ("rejected", "settings", "levels"):
        tab.click(f"[data-tab={name}]")
    tab.click("#survivors-body tr:nth-child(2)")
    assert tab.evaluate("window.hacked") is None
    assert tab.inner_text("#title").startswith("</script><script>window.hacked")
    assert tab.locator("img").count() == 0
    assert len(asked) == 1
    assert errors == []


def test_unknown_joints_and_empty_frames_are_left_out(opened):
    frames = list(walking_result().frames)
    joints = frames[0].joints.copy()
    joints[:, JOINTS.index("left_wrist")] = np.nan
    empty = {"joints": np.empty((0, 14, 3)), "q": frames[1].q[:0], "branches": [], "groups": np.empty(0, int)}
    empty |= {"margins": {name: np.empty(0) for name in frames[1].margins}}
    empty |= {"fk_distance": np.empty(0), "length_residual": np.empty(0), "probability": np.empty(0)}
    empty |= {"answer": None, "posture_set": None}
    frames[0] = dataclasses.replace(frames[0], joints=joints)
    frames[1] = dataclasses.replace(frames[1], **empty)
    tab, _, errors = opened(dataclasses.replace(walking_result(), frames=frames))
    shown = tab.evaluate("scene.drawn().map((point) => point !== null)")
    assert shown == [name != "left_wrist" for name in JOINTS]
    tab.locator("#frame").fill("1")
    assert not any(tab.evaluate("scene.drawn().map((point) => point !== null)"))
    assert "No posture survived" in tab.inner_text("#survivors-title")
    for layer in ("others", "rays"):
        tab.check(f"[data-show={layer}]")
    assert errors == []


def test_postures_alone_are_shown_without_a_tree(opened):
    postures = Postures(joints=walking_result().frames[0].joints)
    tab, _, errors = opened(postures)
    assert tab.locator("#survivors-body tr").count() == len(postures.joints)
    assert tab.is_hidden("#tabs")
    tab.click("#survivors-body tr:nth-child(2)")
    np.testing.assert_allclose(
        drawn(tab), upright_world(postures.joints).place(postures.joints[1]), atol=1e-4
    )
    assert errors == []


def test_without_webgl_the_page_says_so_and_its_tables_work(chromium, tmp_path):
    path = tmp_path / "page.html"
    write_page(path, walking_result())
    tab = chromium.new_page()
    tab.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    tab.goto(path.as_uri())
    assert "no WebGL" in tab.inner_text("#meshcat-pane")
    tab.click("#survivors-body tr:nth-child(2)")
    assert tab.get_attribute("#survivors-body tr:nth-child(2)", "aria-selected") == "true"
    tab.close()


def test_positions_are_rounded_to_a_tenth_of_a_millimetre_and_the_head_is_the_figures():
    view = builtin_view("seq1")
    recovery = recover(view)
    data = page_data(result_of(recovery), view)
    world = world_of(result_of(recovery))
    for frame, recovered in zip(data["frames"], recovery.frames, strict=True):
        points = np.array(frame["points"]).reshape(-1, 19, 3) / data["steps"]
        np.testing.assert_allclose(points[:, :14], world.place(recovered.joints), atol=0.51e-4)
        np.testing.assert_allclose(
            points[:, 14:], np.broadcast_to(world.place(recovered.head), points[:, 14:].shape), atol=1e-4
        )


def test_a_hundred_frames_of_fifty_survivors_stay_below_ten_megabytes():
    frame = walking_result().frames[0]
    pick = np.resize(np.arange(len(frame.joints)), 50)
    many = dataclasses.replace(
        frame,
        joints=frame.joints[pick] + np.random.default_rng(7).normal(size=(50, 1, 3)),
        q=frame.q[pick],
        branches=[frame.branches[k] for k in pick],
        groups=frame.groups[pick],
        margins={name: values[pick] for name, values in frame.margins.items()},
        fk_distance=frame.fk_distance[pick],
        length_residual=frame.length_residual[pick],
        probability=np.full(50, 1 / 50),
    )
    page = page_html(dataclasses.replace(walking_result(), frames=[many] * 100))
    assert len(page.encode()) < 10e6


def test_nothing_in_the_page_refers_to_another_place():
    page = page_html(walking_result())
    own = re.sub(r"<script>.*?</script>|<!--.*?-->", "", page, flags=re.DOTALL)
    assert not re.search(r"\b(src|href|action|url)\s*[=(]", own)
    assert "default-src 'none'" in page


def test_the_page_holds_json_that_no_text_can_leave():
    page = page_html(walking_result(), title=HOSTILE)
    (text,) = re.findall(r"const DATA = (.*);\n", page)
    assert "<" not in text
    assert json.loads(text)["title"] == HOSTILE


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: page_data(Postures(joints=np.empty((0, 14, 3)))), "no posture"),
        (lambda: page_data(Postures(joints=np.full((1, 14, 3), np.nan))), "no joint"),
        (lambda: page_data(Postures(joints=np.zeros((25_001, 14, 3)))), "25,001"),
        (lambda: page_data(walking_result(), frames=[5]), "there are 5"),
        (lambda: page_data(walking_result(), frames=[]), "there are 5"),
        (lambda: page_data(walking_result(), frames=range(10**9)), "there are 5"),
        (lambda: page_data(result_with(), builtin_view("seq1")), "5 frames, the result 1"),
    ],
)
def test_what_cannot_be_shown_is_refused_in_one_line(make, match):
    with pytest.raises(ViewerError, match=match) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_a_page_that_cannot_be_written_leaves_nothing(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        write_page(tmp_path / "no" / "page.html", walking_result())
    assert not list(tmp_path.iterdir())
