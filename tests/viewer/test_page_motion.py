"""The page of what moves: motion of a file with what checks find in it, and the paths of a result that was followed."""

import dataclasses
import re

import numpy as np
import pytest

import posekit
from posekit.formats.held import HeldPostures
from posekit.formats.own import Postures
from posekit.formats.own.paths import FollowedPaths, path_shapes
from posekit.formats.own.report import columns_of
from posekit.samples import write_samples
from posekit.skeleton import JOINT, JOINTS, POINTS
from posekit.validation.page_findings import page_findings
from posekit.validation.reading import StatedMotion, read_postures_of
from posekit.viewer.page.answer_page import answer_segments
from posekit.viewer.page.data import page_data
from posekit.viewer.page.findings_page import PageFinding, PageFindings
from posekit.viewer.page.page import write_page
from tests.viewer.driving import wait_until

FRAMES, BENT = 12, 4


@pytest.fixture
def opened(chromium, tmp_path):
    tabs, wrong = [], list[str]()

    def open_page(given, **options):
        path = tmp_path / "page.html"
        write_page(path, given, **options)
        tab = chromium.new_page(viewport={"width": 1280, "height": 800})
        tabs.append(tab)
        tab.on("request", lambda one: wrong.append(one.url) if one.url != path.as_uri() else None)
        tab.on("pageerror", lambda error: wrong.append(str(error)))
        tab.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
        tab.goto(path.as_uri())
        wait_until(tab, "page.state.drawn === true")
        return tab

    yield open_page
    for tab in tabs:
        tab.close()
    assert wrong == []


@pytest.fixture(scope="module")
def motion():
    """Return a standing person whose right elbow bends the wrong way in one frame."""
    joints = np.repeat(posekit.load_figure().neutral_points[None, :14], FRAMES, axis=0)
    joints += np.arange(FRAMES)[:, None, None] * [0.02, 0.0, 0.0]
    elbow, wrist = JOINT["right_elbow"], JOINT["right_wrist"]
    length = np.linalg.norm(joints[BENT, wrist] - joints[BENT, elbow])
    joints[BENT, wrist] = joints[BENT, elbow] + length * np.array([-0.8, 0.0, -0.6])
    return HeldPostures(
        postures=Postures(joints=joints),
        frame=np.arange(FRAMES),
        clip=np.zeros(FRAMES, dtype=np.intp),
        time=np.arange(FRAMES) / 20,
        up="+z",
    )


def test_findings_without_a_unit_are_numbers():
    one = PageFinding(check="drift", where="left_knee-left_ankle", unit="1", value=-0.16, bound=-0.025)
    findings = PageFindings(by_posture={0: [one]})
    assert findings.described()[0]["unit"] == ""
    assert findings.numbers()[0][0][1:] == [-0.16, -0.025]


def test_a_motion_plays_and_says_what_checks_find(opened, motion):
    findings = page_findings(motion)
    assert findings is not None
    assert list(findings.by_posture) == [BENT]
    tab = opened(motion, findings=findings)
    assert tab.inner_text("#answer").startswith("No check finds anything")
    assert f"1 of {FRAMES} frames" in tab.inner_text("#answer")
    tab.click("#findings tbody button")
    assert tab.evaluate("page.state.frame") == BENT
    said = tab.inner_text("#answer li")
    one = findings.by_posture[BENT][0]
    assert one.check.replace("_", " ") in said
    assert f"{one.value:.4g}"[:5] in said
    assert "bound" in said
    # The joint under the pointer tells it, too, and so does the table of joints.
    box = tab.locator("#picture").bounding_box()
    joint = tab.evaluate("page.findings()[0].joints[0]")
    x, y = tab.evaluate("scene.projected()")[joint]
    tab.mouse.move(box["x"] + (x + 1) / 2 * box["width"], box["y"] + (1 - y) / 2 * box["height"])
    assert JOINTS[joint].replace("_", " ") in tab.inner_text("#tip")
    assert "bound" in tab.inner_text("#tip")
    tab.click("[data-tab=joints]")
    assert "bound" in tab.inner_text("#joints tbody")
    tab.click("#play")
    wait_until(tab, f"page.state.frame === {FRAMES - 1}")
    tab.click("#play")
    assert tab.is_hidden("#survivors")


def test_what_checks_over_time_find_is_said_at_its_frames(opened, tmp_path):
    write_samples(tmp_path)
    jump = read_postures_of(tmp_path / "jump.bvh", StatedMotion()).postures
    findings = page_findings(jump)
    assert findings is not None
    columns = columns_of(posekit.validate(jump))
    places = [(place.check, place.where) for place in columns.places]
    wanted = {(k, *places[place]) for k, place in zip(columns.posture.tolist(), columns.place, strict=True)}
    found = {(k, one.check, one.where) for k, each in findings.by_posture.items() for one in each}
    assert found == wanted
    tab = opened(jump, findings=findings)
    tab.evaluate("page.chooseFrame(70)")
    assert "teleport, body: 293.6 mm (bound 60 mm)" in tab.inner_text("#answer")
    assert "jitter" in tab.inner_text("#findings tbody")


def test_what_is_too_much_to_be_judged_and_results_are_not(motion, walked):
    assert page_findings(walked) is None
    assert page_data(motion)["judged"] is False


@pytest.fixture(scope="module")
def followed(walked):
    """Return a result with two paths, along the next to the likeliest and along the likeliest; one frame is bridged."""
    ranks = np.array(
        [[np.argsort(-frame.probability, kind="stable")[k] for frame in walked.frames] for k in (1, 0)]
    )
    joints = np.array(
        [
            [frame.joints[row] for frame, row in zip(walked.frames, path, strict=True)]
            for path in ranks.tolist()
        ]
    )
    survivor = ranks.copy()
    survivor[0, 2] = -1
    bridged = np.zeros(joints.shape[:3], dtype=bool)
    bridged[0, 2] = True
    paths = FollowedPaths(
        survivor=survivor,
        joints=joints,
        smoothed=joints + np.array([0.0, 0.0, 0.01]),
        interpolated=bridged,
        deviation=np.full(joints.shape[:3], 0.01),
        cost=np.array([1.0, 2.0]),
        share=np.array([0.7, 0.3]),
        scale=np.full(survivor.shape, np.nan),
        lead=0.8,
        exact=True,
        apart=0.05,
    )
    return dataclasses.replace(walked, paths=paths)


def test_the_picture_of_each_frame_is_named(opened, followed):
    names = [f"{k:012d}.jpg" for k in range(len(followed.frames))]
    tab = opened(dataclasses.replace(followed, settings={**followed.settings, "pictures": names}))
    assert tab.inner_text("#seen-name") == names[0]
    tab.locator("#frame").fill("2")
    assert tab.inner_text("#seen-name") == names[2]


def test_of_a_path_that_is_alone_no_probability_is_said(opened, followed):
    one = followed.paths
    rows = {name: getattr(one, name)[:1] for name in path_shapes(*one.survivor.shape)}
    tab = opened(dataclasses.replace(followed, paths=dataclasses.replace(one, **rows)))
    assert tab.inner_text("#caption").startswith("path 0 (the only one in the result)")
    assert "%" not in tab.inner_text("#path option[value='0']")


def test_frames_in_which_a_segment_is_in_doubt_are_listed(opened, flat):
    sides = [page_data(flat)["frames"][k]["answer"] for k in range(len(flat.frames))]
    wanted = {
        (k, j)
        for k, one in enumerate(sides)
        for j, (near, far) in enumerate(zip(one["near"], one["far"], strict=True))
        if near is not None and min(near, far) >= 0.05
    }
    tab = opened(flat)
    assert tab.inner_text("[data-tab=findings]") == "In doubt"
    tab.click("[data-tab=findings]")
    listed = set()
    segments = [f"{POINTS[a]} {POINTS[b]}".replace("_", " ") for a, b in answer_segments()]
    rows = tab.locator("#findings tbody tr").all()
    for frames, segment in [row.locator("td").all_inner_texts()[:2] for row in rows]:
        first, *last = [int(number) for number in re.findall(r"\d+", frames)]
        k = segments.index(" ".join(re.findall(r"\w+", segment)))
        listed |= {(frame, k) for frame in range(first, (last or [first])[0] + 1)}
    assert listed == wanted
    assert wanted
    tab.click("#findings tbody button")
    assert tab.evaluate("page.state.frame") in {k for k, _ in wanted}


def test_a_followed_result_opens_on_its_likeliest_path_and_paths_can_be_chosen(opened, followed):
    tab = opened(followed)
    camera = tab.evaluate("DATA.camera")
    axes = np.array([camera["right"], camera["down"], camera["forward"]])

    def drawn():
        return (np.array(tab.evaluate("scene.drawn()"), dtype=float) - camera["position"]) @ axes.T

    np.testing.assert_allclose(drawn(), followed.paths.smoothed[0, 0], atol=2e-4)
    assert tab.inner_text("#caption").startswith("path 0 (70 %), posture ")
    tab.locator("#frame").fill("2")
    np.testing.assert_allclose(drawn(), followed.paths.smoothed[0, 2], atol=2e-4)
    assert "bridged" in tab.inner_text("#caption")
    assert all(tab.evaluate("DATA.points.slice(0, 14).map((_, joint) => page.unseen(joint))"))
    tab.select_option("#path", "1")
    np.testing.assert_allclose(drawn(), followed.paths.smoothed[1, 2], atol=2e-4)
    # One posture may be looked at; the next frame is the path's again.
    tab.click("#survivors-body tr:nth-child(3)")
    assert tab.evaluate("page.state.path") is None
    tab.keyboard.press("ArrowRight")
    np.testing.assert_allclose(drawn(), followed.paths.smoothed[1, 3], atol=2e-4)
    tab.select_option("#path", "")
    row = int(followed.frames[3].probability.argmax())
    np.testing.assert_allclose(drawn(), followed.frames[3].joints[row], atol=2e-4)
    tab.keyboard.press("l")
    assert tab.evaluate("page.state.path") == 0


def test_a_reason_shows_a_branch_that_it_rejected(opened, walked, walk):
    tab = opened(walked, view=walk)
    tab.click("[data-tab=rejected]")
    button = tab.locator("#rejected tbody button").first
    button.click()
    assert tab.evaluate("scene.layers().rejected") == 1
    assert button.get_attribute("aria-pressed") == "true"
    assert "a rejected branch" in tab.inner_text("#caption")
    said = tab.evaluate("page.example().text")
    assert button.inner_text() in said
    # It is a branch that the result lists with that reason.
    reasons = {
        one["reason"].replace("_", " ").replace(".", " ").replace("/", ", ")
        for one in walked.frames[0].pruned
    }
    assert said in reasons
    button.click()
    assert tab.evaluate("scene.layers().rejected") == 0


def test_each_recording_of_a_file_is_one_persons_and_is_named(opened, motion):
    joints = motion.postures.joints
    both = dataclasses.replace(
        motion,
        postures=Postures(joints=np.concatenate([joints, 0.8 * joints])),
        frame=np.arange(2 * FRAMES),
        clip=np.repeat([0, 1], FRAMES),
        clips=("tall", "small"),
        time=np.tile(motion.time, 2),
    )
    findings = page_findings(both)
    assert findings is not None
    assert list(findings.by_posture) == [BENT, FRAMES + BENT]
    tab = opened(both, findings=findings)
    assert tab.inner_text("#caption") == "tall"
    tab.keyboard.press("End")
    assert tab.inner_text("#caption") == "small"


def test_several_people_in_the_frames_of_a_file_are_all_seen(opened, motion):
    joints = motion.postures.joints
    both = dataclasses.replace(
        motion,
        postures=Postures(joints=np.concatenate([joints, joints + np.array([0.0, 1.0, 0.0])])),
        frame=np.tile(motion.frame, 2),
        clip=np.repeat([0, 1], FRAMES),
        time=np.tile(motion.time, 2),
    )
    tab = opened(both)
    assert tab.is_checked("[data-show=others]")
    assert tab.evaluate("scene.layers().others") == 1
    assert tab.locator("#survivors-body tr").count() == 2


def test_a_tilted_camera_that_says_nothing_is_told_by_the_trunks(walked):
    tilt = np.radians(50.0)
    turn = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    frames = []
    for k in range(FRAMES):
        frame = walked.frames[k % len(walked.frames)]
        frames.append(dataclasses.replace(frame, joints=frame.joints @ turn.T, pruned=None))
    level, tilted = page_data(walked), page_data(dataclasses.replace(walked, frames=frames))
    assert (level["upright"], tilted["upright"]) == ("level", "trunks")
    axes = [
        np.array([data["camera"][name] for name in ("right", "down", "forward")]) for data in (level, tilted)
    ]
    up = [one @ [0.0, 0.0, 1.0] for one in axes]  # of the world, in camera axes
    apart = np.degrees(np.arccos(up[1] @ turn @ up[0]))
    assert apart < 8  # as far as a walker's trunk leans
    np.testing.assert_allclose(axes[1] @ axes[1].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes[1]) == pytest.approx(1.0)
