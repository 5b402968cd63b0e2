"""The slider over the scale of an uncalibrated picture: the laws of the family it moves through, in a real Chromium."""

import dataclasses
import time

import numpy as np
import pytest

import posekit
from posekit.cameras import ScaledOrthographicCamera
from posekit.skeleton import JOINT, JOINTS, POINTS, TREE_SEGMENTS, segment_name
from posekit.viewer.page.data import page_data
from posekit.viewer.page.family_page import walk
from posekit.viewer.page.page import write_page
from posekit.viewer.scene.branch import lift_branch
from posekit.viewer.scene.drawn_subject import subject_of
from posekit.viewer.scene.world import World

TENTH_OF_MM = 1e-4


def open_page(chromium, folder, given, view, wrong):
    """Open the page of a result; note what goes wrong in it, and what it asks the network for."""
    path = folder / "page.html"
    write_page(path, given, view)
    tab = chromium.new_page(viewport={"width": 1280, "height": 800})
    tab.on("request", lambda one: wrong.append(one.url) if one.url != path.as_uri() else None)
    tab.on("pageerror", lambda error: wrong.append(str(error)))
    tab.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
    tab.goto(path.as_uri())
    deadline = time.monotonic() + 10
    while not tab.evaluate("page.state.drawn === true"):
        assert time.monotonic() < deadline, "the page never drew"
        tab.wait_for_timeout(20)
    return tab


@pytest.fixture
def opened(chromium, tmp_path):
    tabs, wrong = [], list[str]()

    def open_one(given, view=None):
        tabs.append(open_page(chromium, tmp_path, given, view, wrong))
        return tabs[-1]

    yield open_one
    for tab in tabs:
        tab.close()
    assert wrong == []


@pytest.fixture(scope="module")
def flat_tab(chromium, flat, tmp_path_factory):
    """Open the page of the uncalibrated result once; each test starts at a frame of its own choice."""
    wrong: list[str] = []
    tab = open_page(chromium, tmp_path_factory.mktemp("flat"), flat, None, wrong)
    yield tab
    tab.close()
    assert wrong == []


def world_of(result, view=None):
    """Return the world that the result's page says it has."""
    camera = page_data(result, view)["camera"]
    axes = np.array([camera["right"], camera["down"], camera["forward"]])
    return World(R_world_cam=axes.T, t_world_cam=np.array(camera["position"]))


def drawn(tab):
    return np.array(tab.evaluate("scene.drawn()"), dtype=float)


def lifted(tab, s):
    """Move the slider; return what is drawn in the camera's axes, metres from the middle of the image (14, 3)."""
    tab.evaluate(f"scale.choose({float(s)!r})")
    camera = tab.evaluate("DATA.camera")
    axes = np.array([camera["right"], camera["down"], camera["forward"]])
    return (drawn(tab) - tab.evaluate("page.frame().family.anchor")) @ axes.T


def choose(tab, frame, survivor):
    # The page has the likeliest first; survivors are named by their number in the result.
    order = f"Array.from({{ length: page.frame().held }}, (_, k) => pack.number(page.frame(), k)).indexOf({survivor})"
    tab.evaluate(f"page.chooseFrame({frame}); page.chooseSurvivor({order})")


def scales_to_try(family):
    return family.bound * np.array([1.0, 1.0 + 1e-9, 1.003, 1.1, 1.6, 4.0, 200.0])


def distances(points, pairs):
    start, end = np.array(pairs).T
    return np.linalg.norm(points[..., end, :] - points[..., start, :], axis=-1)


def test_at_the_recovered_scale_the_recovered_posture_is_drawn(flat_tab, flat):
    tab, world = flat_tab, world_of(flat)
    for k, frame in enumerate(flat.frames):
        for survivor in (0, len(frame.joints) - 1):
            choose(tab, k, survivor)
            expected = world.place(frame.joints[survivor])
            tab.evaluate(f"scale.choose({float(frame.scales[survivor])!r})")
            assert tab.evaluate("page.state.scale") is not None  # it is lifted, not looked up
            np.testing.assert_allclose(drawn(tab), expected, rtol=0, atol=1e-6)
            # The element's own value, as a hand leaves it.
            tab.evaluate("byId = document.getElementById('scale'), byId.oninput({ target: byId })")
            assert np.linalg.norm(drawn(tab) - expected, axis=1).max() < TENTH_OF_MM


def test_at_every_scale_the_image_is_the_same_and_lengths_are_kept(flat_tab, flat):
    tab = flat_tab
    lengths = np.array([posekit.load_figure().lengths[segment_name(pair)] for pair in TREE_SEGMENTS])
    starts, ends = np.array(TREE_SEGMENTS).T
    for k, frame in enumerate(flat.frames):
        choose(tab, k, k % len(frame.joints))
        branch = frame.branches[k % len(frame.joints)]
        image = frame.joints[0, :, :2] * frame.scales[0]
        middle = image.mean(axis=0)
        for s in scales_to_try(frame.family):
            points = lifted(tab, s)
            np.testing.assert_allclose(points[:, :2] * s + middle, image, rtol=0, atol=1e-6)
            np.testing.assert_allclose(distances(points, TREE_SEGMENTS), lengths, rtol=0, atol=1e-7)
            deep = points[ends, 2] - points[starts, 2]
            far = np.array(list(branch)) == "1"
            assert (np.where(far, deep, -deep) > -1e-9).all()


def test_it_is_the_tree_s_own_lift(flat_tab, flat):
    tab = flat_tab
    lengths = np.array([posekit.load_figure().lengths[segment_name(pair)] for pair in TREE_SEGMENTS])
    frame = flat.frames[1]
    image = frame.joints[0, :, :2] * frame.scales[0]
    choose(tab, 1, 2)
    for s in scales_to_try(frame.family)[1:]:  # at the bound itself near and far are one
        camera = ScaledOrthographicCamera(scale=s)
        root = np.array([*(image[0] / s), 0.0])
        wanted = lift_branch(camera, root, image, lengths, frame.branches[2], tolerance=1e-9)
        wanted[:, :2] -= image.mean(axis=0) / s
        np.testing.assert_allclose(lifted(tab, s), wanted, rtol=0, atol=1e-6)


def test_at_the_bound_its_segment_lies_in_the_image_plane(flat_tab, flat):
    tab = flat_tab
    tree = {segment_name(pair): pair for pair in TREE_SEGMENTS}
    judged = 0
    for k, frame in enumerate(flat.frames):
        choose(tab, k, 0)
        tab.click("#scale-bound")
        family = frame.family
        assert tab.evaluate("page.state.scale") == pytest.approx(family.bound, rel=1e-12)
        said = tab.inner_text("#scale-note")
        assert said.startswith(family.segment.replace("_", " ").replace("-", " \N{EN DASH} "))
        if family.segment in tree:
            a, b = tree[family.segment]
            points = lifted(tab, family.bound)
            assert abs(points[a, 2] - points[b, 2]) < 1e-6
            assert "here it lies in the image plane" in said
            judged += 1
        else:
            assert "its ends are lifted from other joints" in said
    assert judged >= 4


def test_the_walk_of_taylors_twelve_points_keeps_his_eleven_lengths(opened, taylor):
    tab = opened(taylor)
    middles = {"mid_shoulders": ("right_shoulder", "left_shoulder"), "mid_hips": ("right_hip", "left_hip")}

    def nodes(points):
        found = {name: points[JOINT[name]] for name in JOINTS}
        return found | {name: (found[a] + found[b]) / 2 for name, (a, b) in middles.items()}

    limbs = [("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle")]
    segments = [(f"{side}_{a}", f"{side}_{b}") for side in ("right", "left") for a, b in limbs]
    segments += [*middles.values(), ("mid_shoulders", "mid_hips")]
    assert len(segments) == 11
    seen = [index for index in range(len(JOINTS)) if JOINTS[index] not in ("neck", "pelvis")]
    for k, frame in enumerate(taylor.frames[:5]):
        choose(tab, k, 0)
        before = nodes(frame.joints[0])
        image = frame.joints[0, :, :2] * frame.scales[0]
        middle = image[[bool(np.isfinite(p).all()) for p in image]][seen].mean(axis=0)
        np.testing.assert_allclose(
            lifted(tab, frame.scales[0])[:, 2] - frame.joints[0][:, 2], 0, rtol=0, atol=TENTH_OF_MM
        )
        for s in scales_to_try(frame.family):
            points = lifted(tab, s)
            now = nodes(points)
            for a, b in segments:
                length = np.linalg.norm(before[a] - before[b])
                assert np.linalg.norm(now[a] - now[b]) == pytest.approx(length, abs=1e-7)
            np.testing.assert_allclose(points[seen, :2] * s, (image - middle)[seen], rtol=0, atol=1e-6)
            spine = now["mid_hips"] - now["mid_shoulders"]
            along = np.dot(now["pelvis"] - now["mid_shoulders"], spine) / np.dot(spine, spine)
            assert along == pytest.approx(0.8, abs=1e-3)  # where it was on the spine, and on it
            off = np.linalg.norm(now["pelvis"] - now["mid_shoulders"] - along * spine)
            assert off < 2 * TENTH_OF_MM
            neck = [np.linalg.norm(one["neck"] - one["mid_shoulders"]) for one in (before, now)]
            assert neck[1] == pytest.approx(neck[0], abs=2 * TENTH_OF_MM)
        a, b = frame.family.segment.split("-")
        now = nodes(lifted(tab, frame.family.bound))
        assert abs(now[a][2] - now[b][2]) < 1e-6
        assert "here it lies in the image plane" in tab.inner_text("#scale-note")


def test_from_the_camera_nothing_moves_whatever_the_scale(opened, scales):
    tab = opened(scales)
    tab.click("[data-look=camera]")
    on_screen = "scene.projected()"
    for k in (0, 3):
        seen = []
        for survivor in (0, 2, 5):  # of three scales, one mirrored
            choose(tab, k, survivor)
            seen.append(tab.evaluate(on_screen))
            for factor in (1.0, 3.0):
                tab.evaluate(f"scale.choose({factor} * page.frame().family.bound)")
                seen.append(tab.evaluate(on_screen))
        np.testing.assert_allclose(seen[1:], [seen[0]] * 8, rtol=0, atol=2e-3)
        assert np.abs(seen[0]).max() < 1
        # It is the image, upright and of one scale in both directions.
        image = scales.frames[k].joints[0, :, :2] * scales.frames[k].scales[0]
        wide, high = tab.evaluate("[sight.size().width, sight.size().height]")
        pane = np.array([wide, -high]) / 2
        slope = [np.polyfit(image[:, axis], np.array(seen[0])[:, axis] * pane[axis], 1)[0] for axis in (0, 1)]
        assert slope[0] == pytest.approx(slope[1], rel=2e-3)
        assert slope[0] > 0
    tab.click("[data-look=side]")
    for layer in ("others", "rays"):
        tab.check(f"[data-show={layer}]")
        assert tab.evaluate(f"scene.layers().{layer}") > 0


def test_survivors_of_several_scales_are_listed_and_drawn_in_one_place(opened, scales, flat_view):
    tab, world = opened(scales, flat_view), world_of(scales)
    shown = tab.locator("#survivors-body tr td:nth-child(2)").all_inner_texts()
    assert [float(text) for text in shown] == [400.0, 400.0, 416.0, 416.0, 530.0, 530.0]
    centres = []
    for survivor, s in enumerate(scales.frames[0].scales):
        tab.click(f"#survivors-body tr:nth-child({survivor + 1})")
        assert tab.evaluate("scale.now()") == pytest.approx(s, rel=1e-12)
        assert tab.inner_text("#scale-text").startswith(f"{s:.0f} px/m")
        tab.evaluate(f"scale.choose({float(s)!r})")
        own = subject_of(scales).frames[0].aligned_points[survivor, :14]
        np.testing.assert_allclose(drawn(tab), world.place(own), rtol=0, atol=TENTH_OF_MM)
        centres.append(np.delete(drawn(tab).mean(axis=0) @ np.array(tab.evaluate("DATA.camera.right")), []))
    assert np.ptp(centres) < 1e-6
    marks = tab.locator("#scale-marks line")
    assert marks.count() == 1 + 4 + 3  # the bound, the minima, the recovered scales
    assert tab.locator("#scale-marks polyline").count() == 1
    places = tab.evaluate(
        "[...document.querySelectorAll('#scale-marks .minimum')].map((one) => Number(one.getAttribute('x1')))"
    )
    family = scales.frames[0].family
    angles = np.degrees(np.arccos(family.bound / family.minima_s))
    np.testing.assert_allclose(np.array(places) / 400 * 80, angles, atol=1e-3)
    assert "minima of closure at" in tab.get_attribute("#scale-marks", "aria-label")
    tab.click("#scale-minima button:nth-child(4)")
    assert tab.evaluate("scale.now()") == pytest.approx(family.minima_s[3])
    # The truth of an uncalibrated view is drawn where the survivors are.
    tab.check("[data-show=truth]")
    truth = np.array(tab.evaluate("pack.truth(0).slice(0, 14)"))
    expected = world.place(scales.frames[0].joints[0])
    assert np.linalg.norm((truth - expected).mean(axis=0)[1]) < 1e-3


def test_margins_are_marked_and_a_button_leads_back(opened, flat):
    tab = opened(flat)
    before, room = drawn(tab), tab.inner_text("#survivors-title")
    assert "room left to each check's bound" in room
    assert tab.is_disabled("#scale-back")
    survivor = tab.evaluate("page.state.survivor")
    tab.focus("#scale")
    tab.keyboard.press("End")
    assert tab.evaluate("scale.now()") == pytest.approx(flat.frames[0].family.bound / np.cos(np.radians(80)))
    assert tab.evaluate("page.state.survivor") == survivor  # the keys are the slider's
    assert np.linalg.norm(drawn(tab) - before, axis=1).max() > 0.3
    assert "margins are those of the recovered scale, 400.0 px/m" in tab.inner_text("#survivors-title")
    assert "m, recovered " in tab.inner_text("#scale-note")
    assert "Distances inside torso and hips are off by up to" in tab.inner_text("#scale-note")
    assert tab.get_attribute("#scale", "aria-valuetext").endswith("pixels a metre")
    tab.keyboard.press("ArrowLeft")
    assert tab.evaluate("scale.now()") < flat.frames[0].family.bound / np.cos(np.radians(79.5))
    tab.click("#scale-back")
    np.testing.assert_array_equal(drawn(tab), before)
    assert tab.inner_text("#survivors-title") == room
    tab.evaluate("scale.choose(1)")  # below the bound there is nothing
    assert tab.evaluate("scale.now()") == flat.frames[0].family.bound
    tab.click("#survivors-body tr:nth-child(2)")
    assert tab.evaluate("page.state.scale") is None
    assert tab.get_attribute("label[for=scale]", "for") == "scale"


def test_inferred_joints_are_hollow_boxed_and_named(opened, hidden_elbow):
    result, view = hidden_elbow
    tab = opened(result, view)
    assert tab.inner_text("#survivors-note") == "Inferred: right elbow, right wrist."
    hollow = "DATA.points.filter((_, joint) => page.unseen(joint))"
    assert tab.evaluate(hollow) == ["right_elbow", "right_wrist"]
    found = {one["name"]: np.array(one["corners"]) for one in tab.evaluate("scene.regions()")}
    world = world_of(result, view)
    for name, one in result.frames[0].inferred[0].items():
        ends = np.sort(world.place(np.array([one.lower, one.upper])), axis=0)
        corners = np.array([found[name].min(axis=0), found[name].max(axis=0)])
        np.testing.assert_allclose(corners, ends, atol=2 * TENTH_OF_MM)
    tab.click("#unseen-tab")
    rows = tab.locator("#unseen tbody tr").all_inner_texts()
    plain = [row.replace("\N{MINUS SIGN}", "-").split() for row in rows]
    assert plain[0] == ["right", "elbow", "region,", "25", "%", "-10…5", "-20…25", "-30…15", "31"]
    assert plain[1] == ["right", "wrist", "interval", "0.0", "0.0", "-20…40", "40"]
    # At another scale the boxes, which were found at this one, are gone; the hollow limb goes along.
    tab.evaluate("scale.choose(1.2 * scale.now())")
    assert tab.evaluate("scene.regions().length") == 0
    frame = result.frames[0]
    points = lifted(tab, 480.0)
    forearm = frame.joints[0, JOINT["right_elbow"]] - frame.joints[0, JOINT["right_shoulder"]]
    moved = points[JOINT["right_elbow"]] - points[JOINT["right_shoulder"]]
    np.testing.assert_allclose(moved, forearm, atol=2 * TENTH_OF_MM)
    wrist = frame.joints[0, JOINT["right_wrist"], :2] * 400.0
    neck = frame.joints[0, 0, :2] * 400.0
    np.testing.assert_allclose(
        (points[JOINT["right_wrist"], :2] - points[0, :2]) * 480.0, wrist - neck, atol=1e-6
    )


def test_inferred_joints_of_a_calibrated_view_need_no_family(opened, walked, walk):
    frames = []
    for frame in walked.frames:
        wrist = frame.joints[:, JOINT["left_wrist"]]
        boxes = [
            posekit.formats.own.Inferred(
                kind="circle", lower=at - 0.1, upper=at + 0.1, radius=0.1, fraction=0.5
            )
            for at in wrist
        ]
        frames.append(dataclasses.replace(frame, inferred=[{"left_wrist": box} for box in boxes]))
    tab = opened(dataclasses.replace(walked, frames=frames), walk)
    assert tab.is_hidden("#family")
    assert tab.inner_text("#survivors-note") == "Inferred: left wrist."
    assert tab.evaluate("scene.regions().length") == 1


def test_calibrated_results_have_no_slider(opened, walked, walk):
    tab = opened(walked, walk)
    assert tab.is_hidden("#family")
    assert tab.is_hidden("#unseen-tab")
    data = page_data(walked, walk)
    assert not any("family" in frame or "inferred" in frame for frame in data["frames"])
    assert data["camera"]["parallel"] is False


def test_frames_without_survivors_have_no_family(opened, flat):
    frames = list(flat.frames)
    frame = frames[1]
    empty = {
        name: getattr(frame, name)[:0]
        for name in ("joints", "q", "fk_distance", "length_residual", "scales", "probability")
    } | {"answer": None, "posture_set": None}
    margins = {name: values[:0] for name, values in frame.margins.items()}
    frames[1] = dataclasses.replace(frame, branches=[], groups=np.empty(0, int), margins=margins, **empty)
    tab = opened(dataclasses.replace(flat, frames=frames))
    tab.click("[data-look=camera]")
    tab.locator("#frame").fill("1")
    assert tab.is_hidden("#family")
    tab.evaluate("scale.choose(500)")
    tab.locator("#frame").fill("2")
    assert tab.is_visible("#family")
    assert tab.evaluate("page.state.scale") is None


def test_walks_reach_every_joint_once():
    figure = walk(JOINTS)
    assert [(parent, child) for child, parent, _ in figure] == list(TREE_SEGMENTS)
    twelve = [name for name in JOINTS if name not in ("neck", "pelvis")]
    for root in twelve:
        names = [root, *(name for name in twelve if name != root), "mid_shoulders", "mid_hips"]
        steps = walk(names)
        reached = [child for child, _, _ in steps]
        assert sorted(reached) == sorted(
            {*(JOINT[name] for name in names[1:-2]), len(POINTS), len(POINTS) + 1}
        )
        placed = {JOINT[root]}
        for child, parent, other in steps:
            assert parent in placed
            assert other == -1 or (other in placed and {other, child} in ({1, 2}, {4, 5}))
            placed.add(child)
        # Both ends of a girdle hang on its middle: one is lifted, the other mirrors it.
        assert sum(other >= 0 for _, _, other in steps) == 2


def test_the_curve_is_thinned_but_keeps_its_lowest_points(scales):
    family = page_data(scales)["frames"][0]["family"]
    residual = np.array(family["curve"])[:, 1]
    assert 100 < len(residual) <= 240
    assert residual.min() == pytest.approx(scales.frames[0].family.curve_residual.min(), rel=1e-3)
    assert [minimum[0] for minimum in family["minima"]] == scales.frames[0].family.minima_s.tolist()
