"""The interactive page, clicked through in a real Chromium with the network watched."""

import base64
import dataclasses
import functools
import json
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from posekit.answers.wording import percent
from posekit.errors import InputError, ViewerError
from posekit.formats.own import Postures
from posekit.recovery import recover
from posekit.recovery.result import result_of
from posekit.skeleton import JOINTS
from posekit.viewer.page.data import page_data
from posekit.viewer.page.packed import UNKNOWN_STEP, origins, steps
from posekit.viewer.page.page import page_html, write_page
from posekit.viewer.page.shown_survivors import most_of_each, survivors_shown
from posekit.viewer.scene.world import World
from posekit.views.builtin import builtin_view
from tests.frame_answers import bare_answer
from tests.viewer.driving import wait_until

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


def world_of(data):
    """Return the world that a page says it has."""
    camera = data["camera"]
    axes = np.array([camera["right"], camera["down"], camera["forward"]])
    return World(R_world_cam=axes.T, t_world_cam=np.array(camera["position"]))


def data_of(page):
    """Read the data of a page."""
    (text,) = re.findall(r'<script type="application/json" id="data">(.*)</script>', page)
    assert "<" not in text
    return json.loads(text)


def unpacked(data, name):
    """Read an array of a page."""
    one = data["packed"][name]
    return np.frombuffer(base64.b64decode(one["base64"]), dtype=one["type"])


def page_points(data, name="points"):
    """Return the points of a page (N, 19, 3), metres, and the frame of each posture."""
    steps = unpacked(data, name).reshape(-1, 19, 3).astype(float)
    steps[steps == UNKNOWN_STEP] = np.nan
    frame = np.repeat(np.arange(len(data["frames"])), [one["held"] for one in data["frames"]])
    origin = np.array([one["origin"] for one in data["frames"]])
    return steps * data["step"] + (origin[frame] if name == "points" else origin)[:, None], frame


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


def order_of(frame):
    """Return the answer's posture, then the others by probability."""
    first = frame.answer.representatives[0]
    return np.array([first, *(row for row in np.argsort(-frame.probability, kind="stable") if row != first)])


def test_it_opens_on_the_likeliest_posture_and_every_control_does_what_it_says(opened):
    result, view = walking_result(), builtin_view("seq1")
    tab, asked, errors = opened(result, view)
    world = world_of(page_data(result, view))

    def expected(frame, rank):
        return world.place(result.frames[frame].joints[order_of(result.frames[frame])[rank]])

    assert tab.locator("#survivors-body tr").count() == len(result.frames[0].joints)
    np.testing.assert_allclose(drawn(tab), expected(0, 0), atol=1e-4)
    sure = percent(result.frames[0].answer.probability[0])
    assert f"the likeliest, {sure} sure to 5 cm" in tab.inner_text("#caption")
    assert tab.inner_text("#answer button[aria-pressed=true]") == f"{sure} the likeliest"
    before = tab.screenshot()
    tab.click("#survivors-body tr:nth-child(4)")
    np.testing.assert_allclose(drawn(tab), expected(0, 3), atol=1e-4)
    assert tab.get_attribute("#survivors-body tr:nth-child(4)", "aria-selected") == "true"
    tab.keyboard.press("ArrowUp")
    np.testing.assert_allclose(drawn(tab), expected(0, 2), atol=1e-4)

    tab.locator("#frame").fill("2")
    np.testing.assert_allclose(drawn(tab), expected(2, 0), atol=1e-4)
    assert "frame 2 of 0 to 4" in tab.inner_text("#frame-text")
    assert tab.locator("#survivors-body tr").count() == len(result.frames[2].joints)
    tab.select_option("#speed", "4")
    tab.click("#play")
    assert tab.get_attribute("#play", "aria-label") == "pause"
    wait_until(tab, "page.state.frame === 4")
    tab.click("#play")
    assert tab.get_attribute("#play", "aria-label") == "play"
    tab.click("#strip", position={"x": 2, "y": 5})
    assert tab.evaluate("page.state.frame") == 0

    for look in ("side", "camera", "above"):
        tab.click(f"[data-look={look}]")
        assert tab.get_attribute(f"[data-look={look}]", "aria-pressed") == "true"
    for layer in ("others", "rays", "truth"):
        tab.check(f"[data-show={layer}]")
        assert tab.evaluate(f"scene.layers().{layer}") > 0
    assert tab.screenshot() != before
    assert [url for url in asked if not url.startswith("file://")] == []
    assert len(asked) == 1
    assert errors == []


def test_all_of_it_goes_by_keyboard_alone(opened):
    tab, _, errors = opened(walking_result(), builtin_view("seq1"))
    press, state = tab.keyboard.press, lambda name: tab.evaluate(f"page.state.{name}")
    for key, frame in (
        ("ArrowRight", 1),
        ("End", 4),
        ("ArrowLeft", 3),
        ("PageUp", 0),
        ("PageDown", 4),
        ("Home", 0),
    ):
        press(key)
        assert state("frame") == frame
    press("ArrowDown")
    assert state("survivor") == 1
    press("l")
    assert state("survivor") == 0
    for key, look in (("2", "camera"), ("3", "side"), ("4", "above"), ("1", "free")):
        press(key)
        assert tab.get_attribute(f"[data-look={look}]", "aria-pressed") == "true"
    for key, layer in (("a", "others"), ("c", "rays"), ("t", "truth")):
        press(key)
        assert tab.is_checked(f"[data-show={layer}]")
    press("b")
    assert not tab.is_checked("[data-show=bodies]")
    press(",")
    assert tab.input_value("#speed") == "0.5"
    press(" ")
    assert state("playing")
    press(" ")
    assert not state("playing")
    # Tab leads to the picture first; arrows turn it then, and frames stay.
    tab.evaluate("document.activeElement.blur()")
    press("Tab")
    assert tab.evaluate("document.activeElement.id") == "picture"
    before, frame = tab.evaluate("scene.projected()"), state("frame")
    press("ArrowLeft")
    press("+")
    assert np.abs(np.subtract(tab.evaluate("scene.projected()"), before)).max() > 0.01
    assert state("frame") == frame
    press("?")
    assert tab.is_visible("#keys")
    names = tab.evaluate(
        """[...document.querySelectorAll('button, select, input, canvas[tabindex]')].map(
            (one) => one.getAttribute('aria-label') || one.textContent.trim() || one.labels?.length)"""
    )
    assert all(names)
    assert errors == []


def test_a_joint_under_the_pointer_is_told_and_the_picture_is_turned_by_hand(opened):
    tab, _, errors = opened(walking_result())
    box = tab.locator("#picture").bounding_box()
    x, y = tab.evaluate("scene.projected()")[JOINTS.index("right_knee")]
    at = box["x"] + (x + 1) / 2 * box["width"], box["y"] + (1 - y) / 2 * box["height"]
    tab.mouse.move(*at)
    assert tab.inner_text("#tip").startswith("right knee")
    assert "nearer than the right hip" in tab.inner_text("#tip")
    for button, modifier in (("left", None), ("left", "Shift"), ("right", None)):
        before = tab.evaluate("scene.projected()")
        tab.mouse.move(*at)
        if modifier:
            tab.keyboard.down(modifier)
        tab.mouse.down(button=button)
        tab.mouse.move(at[0] + 60, at[1] + 20)
        tab.mouse.up(button=button)
        if modifier:
            tab.keyboard.up(modifier)
        assert np.abs(np.subtract(tab.evaluate("scene.projected()"), before)).max() > 0.01
    before = tab.evaluate("scene.projected()")
    tab.mouse.wheel(0, 300)
    wait_until(
        tab, f"JSON.stringify(scene.projected()) !== {json.dumps(json.dumps(before, separators=(',', ':')))}"
    )
    assert errors == []


def test_in_a_narrow_window_nothing_is_cut_off(opened):
    tab, _, errors = opened(walking_result(), builtin_view("seq1"))
    tab.set_viewport_size({"width": 420, "height": 800})
    assert tab.evaluate("document.documentElement.scrollWidth") <= 420
    assert np.abs(tab.evaluate("scene.projected()")).max() < 1
    ends = """[...document.querySelectorAll('button, select, label')].filter(
        (one) => one.offsetParent && !one.closest('.scroll')).map(
        (one) => [one.getBoundingClientRect().right, one.id || one.textContent])"""
    assert [name for right, name in tab.evaluate(ends) if right > 421] == []
    assert errors == []


def test_the_tables_say_what_the_result_says(opened):
    result = walking_result()
    tab, _, errors = opened(result)
    frame = result.frames[0]
    tab.click("[data-tab=levels]")
    rows = tab.locator("#levels tbody tr").all_inner_texts()
    assert len(rows) == len(JOINTS)
    for row, physical, motion in zip(rows, frame.levels["physical"], frame.levels["motion"], strict=True):
        assert [int(n) for n in re.findall(r"\d+", row)] == [physical, motion]
    choices = [row.split()[-1] for row in rows[1:]]
    likeliest = order_of(frame)[0]
    assert choices == ["farther" if choice == "1" else "nearer" for choice in frame.branches[likeliest]]
    tab.click("[data-tab=rejected]")
    counts = [
        int(text.replace(",", "")) for text in tab.locator("#rejected tbody td:last-child").all_inner_texts()
    ]
    assert counts == sorted(frame.rejected.values(), reverse=True)
    assert "8,192 possible postures" in tab.inner_text("#rejected .note")
    # Sorting by a margin puts the smallest first, then the largest.
    heading = tab.locator("#survivors-head button", has_text="joint range")
    heading.click()
    order = [int(text) for text in tab.locator("#survivors-body td:first-child").all_inner_texts()]
    margins = frame.margins["joint_range"]
    np.testing.assert_allclose(margins[order], np.sort(margins), atol=1e-5)
    # Sorting by probability puts the likeliest first.
    heading = tab.locator("#survivors-head button", has_text="probability")
    heading.click()
    order = [int(text) for text in tab.locator("#survivors-body td:first-child").all_inner_texts()]
    np.testing.assert_allclose(frame.probability[order], np.sort(frame.probability)[::-1], atol=1e-6)
    column = 1 + tab.locator("#survivors-head th").all_inner_texts().index("probability\u00a0▾")
    first = tab.inner_text(f"#survivors-body tr:first-child td:nth-child({column})")
    assert first == f"{100 * frame.probability.max():.0f} %"
    heading.click()
    again = [int(text) for text in tab.locator("#survivors-body td:first-child").all_inner_texts()]
    np.testing.assert_allclose(frame.probability[again], np.sort(frame.probability), atol=1e-6)
    assert errors == []


def test_the_answer_is_told_first_and_what_else_it_can_be_is_a_press_away(opened):
    tab, _, errors = opened(walking_result())
    first, second = tab.locator("#answer p").all_inner_texts()
    answer = page_data(walking_result())["frames"][0]["answer"]
    assert "sure of the likeliest posture, to 5 cm in every joint" in first
    assert second.startswith("what else it can be")
    buttons = tab.locator("#answer button")
    assert buttons.count() == len(answer["representatives"]) > 1
    buttons.nth(1).click()
    assert tab.evaluate("page.state.survivor") == answer["representatives"][1]["at"]
    assert buttons.nth(1).get_attribute("aria-pressed") == "true"
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
        seen.append(tab.evaluate("scene.projected()"))
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
    for name in ("rejected", "settings", "keys", "levels", "joints"):
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
    assert tab.is_hidden("[data-tab=levels]")
    tab.click("#survivors-body tr:nth-child(2)")
    np.testing.assert_allclose(drawn(tab), world_of(page_data(postures)).place(postures.joints[1]), atol=1e-4)
    assert errors == []


def test_positions_are_rounded_to_a_tenth_of_a_millimetre_and_the_head_is_the_figures():
    view = builtin_view("seq1")
    recovery = recover(view)
    data = page_data(result_of(recovery), view)
    points, of = page_points(data)
    numbers, world = unpacked(data, "number"), world_of(data)
    assert data["step"] == 1e-4
    for k, recovered in enumerate(recovery.frames):
        rows, found = numbers[of == k], points[of == k]
        assert sorted(rows) == list(range(len(recovered.joints)))
        np.testing.assert_allclose(found[:, :14], world.place(recovered.joints)[rows], atol=0.51e-4)
        head = np.broadcast_to(world.place(recovered.head), (len(recovered.joints), 5, 3))
        np.testing.assert_allclose(found[:, 14:], head[rows], atol=1e-4)


def many_postures(frames, count):
    """Return a result of many frames with many postures each, all equally likely but for the last."""
    frame = walking_result().frames[0]
    pick = np.resize(np.arange(len(frame.joints)), count)
    rng = np.random.default_rng(7)
    probability = np.full(count, 0.5 / (count - 1))
    probability[-1] = 0.5
    many = dataclasses.replace(
        frame,
        joints=frame.joints[pick] + rng.normal(size=(count, 1, 3)),
        q=frame.q[pick],
        branches=[frame.branches[k] for k in pick],
        groups=frame.groups[pick],
        margins={name: values[pick] for name, values in frame.margins.items()},
        fk_distance=frame.fk_distance[pick],
        length_residual=frame.length_residual[pick],
        probability=probability,
        answer=None,
        posture_set=None,
    )
    return dataclasses.replace(walking_result(), frames=[many] * frames)


def with_answer(frame, rows):
    """Return a frame that says which postures stand for all."""
    return dataclasses.replace(frame, answer=bare_answer(rows))


def test_any_number_of_postures_makes_a_page_below_ten_megabytes():
    result = many_postures(60, 900)
    result = dataclasses.replace(result, frames=[with_answer(result.frames[0], [899])] * 60)
    page = page_html(result)
    assert len(page.encode()) < 10e6
    data = data_of(page)
    held = [one["held"] for one in data["frames"]]
    assert min(held) > 500
    assert data["left"] == 60 * 900 - sum(held)
    # The likeliest of each frame, the last of the file, comes first.
    numbers = unpacked(data, "number")
    assert {numbers[one["first"]] for one in data["frames"]} == {899}


def test_the_rest_is_shown_when_it_is_asked_for_and_it_is_said_how_to_see_all(opened, monkeypatch):
    monkeypatch.setattr("posekit.viewer.page.shown_survivors.PAGE_BYTES", 5 * 2600 + 5 * 206 * 80)
    tab, _, errors = opened(many_postures(5, 90))
    assert tab.locator("#survivors-body tr").count() == 50
    held = tab.evaluate("page.frame().held")
    tab.click("#rest button")
    assert tab.locator("#survivors-body tr").count() == held < 90
    assert f"the {held} likeliest of the 90 postures" in tab.inner_text("#rest")
    assert "posekit render RESULT --frame 0 -o" in tab.inner_text("#rest code")
    assert errors == []


def test_what_stands_for_all_is_in_the_page_however_unlikely():
    result = many_postures(1, 90)
    rows = [89, 40, 77, 3]
    result = dataclasses.replace(result, frames=[with_answer(result.frames[0], rows)])
    shown = survivors_shown(result, [0], 5)
    assert set(rows) <= set(shown.rows[0].tolist())
    assert shown.rows[0][0] == 89


@given(counts=st.lists(st.integers(0, 50), min_size=1, max_size=8), most=st.integers(0, 200))
def test_frames_share_the_room_and_none_that_has_a_posture_is_left_empty(counts, most):
    each = most_of_each(counts, most)
    held = np.minimum(counts, each)
    assert each >= 1
    assert held.sum() <= max(most, sum(count > 0 for count in counts))
    more = np.minimum(counts, each + 1)
    assert more.sum() > most or (more == counts).all()


@given(points=hnp.arrays(float, (3, 19, 3), elements=st.floats(-40, 40)))
def test_packed_points_are_those_within_half_a_step(points):
    points[0, 3] = np.nan
    (origin,), step = origins([points])
    counted = steps(points, origin, step)
    found = np.where(counted == UNKNOWN_STEP, np.nan, counted * step + origin)
    np.testing.assert_allclose(found, points, atol=0.501 * step, rtol=0)


def test_nothing_in_the_page_refers_to_another_place():
    page = page_html(walking_result())
    own = re.sub(r"<script.*?</script>|<!--.*?-->", "", page, flags=re.DOTALL)
    assert not re.search(r"\b(src|href|action|url)\s*[=(]", own)
    assert "default-src 'none'" in page


def test_the_page_holds_json_that_no_text_can_leave():
    page = page_html(walking_result(), title=HOSTILE)
    assert data_of(page)["title"] == HOSTILE


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: page_data(Postures(joints=np.empty((0, 14, 3)))), "no posture"),
        (lambda: page_data(Postures(joints=np.full((1, 14, 3), np.nan))), "no joint"),
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
