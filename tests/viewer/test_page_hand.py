"""Flips by hand in the page of an uncalibrated picture: every combination, its verdict, and the file of nearer ends."""

import dataclasses
import json

import numpy as np
import pytest

import posekit
from posekit.formats.own import read_nearer
from posekit.samples import write_samples
from posekit.skeleton import JOINTS, TREE_SEGMENTS, segment_name
from posekit.viewer.page import hand_page
from posekit.viewer.page.data import page_data
from posekit.viewer.page.page import write_page
from tests.viewer.driving import wait_until

SEGMENT_NAMES_OF_TREE = [segment_name(pair) for pair in TREE_SEGMENTS]


@pytest.fixture(scope="module")
def photograph(tmp_path_factory):
    """Return the view of a photograph, and its result with all pruned branches."""
    folder = tmp_path_factory.mktemp("photograph")
    write_samples(folder)
    view = posekit.open(folder / "photo.json")
    return view, posekit.result_of(posekit.recover(view), explain=True)


@pytest.fixture
def opened(chromium, tmp_path):
    tabs, wrong = [], list[str]()

    def open_one(given, width=1280):
        path = tmp_path / "page.html"
        write_page(path, given)
        tab = chromium.new_page(viewport={"width": width, "height": 800})
        tab.on("request", lambda one: wrong.append(one.url) if one.url[:4] not in ("file", "blob") else None)
        tab.on("pageerror", lambda error: wrong.append(str(error)))
        tab.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
        tab.goto(path.as_uri())
        wait_until(tab, "page.state.drawn === true")
        tabs.append(tab)
        return tab

    yield open_one
    for tab in tabs:
        tab.close()
    assert wrong == []


def saved(tab, path):
    """Click the button that saves; return what the browser downloaded."""
    with tab.expect_download() as got:
        tab.click("#flips-save")
    assert got.value.suggested_filename == "nearer.json"
    got.value.save_as(path)
    return read_nearer(path)


def middle_of(tab, number):
    """Return where in the window the middle of a segment is drawn."""
    ends = tab.evaluate(
        f"scene.projected().filter((_, k) => DATA.flips.segments[{number}].joints.flat().includes(k))"
    )
    box = tab.locator("#picture").bounding_box()
    x, y = np.mean(ends, axis=0)
    return box["x"] + (x + 1) / 2 * box["width"], box["y"] + (1 - y) / 2 * box["height"]


def in_camera(tab):
    camera = tab.evaluate("DATA.camera")
    axes = np.array([camera["right"], camera["down"], camera["forward"]])
    return np.array(tab.evaluate("scene.drawn()"), dtype=float) @ axes.T


def test_every_combination_is_judged_as_the_result_says(opened, flat):
    tab = opened(flat)
    for number in (0, 1):
        frame = flat.frames[number]
        tab.evaluate(f"page.chooseFrame({number})")
        said = tab.evaluate(
            """Array.from({ length: 8192 }, (_, k) => {
                const code = k.toString(2).padStart(13, "0"), { survivor, reasons } = hand.judged(code);
                return [code, survivor === undefined ? -1 : pack.number(page.frame(), survivor),
                        (reasons ?? []).map(([reason]) => DATA.reasons[reason].slice(0, 2).join("/"))];
            })"""
        )
        survivors = {branch: k for k, branch in enumerate(frame.branches)}
        pruned = {one["branch"]: one["reason"] for one in frame.pruned}
        for code, survivor, reasons in said:
            assert survivor == survivors.get(code, -1)
            assert reasons == [pruned[code[:k]] for k in range(14) if code[:k] in pruned]
        assert len(frame.branches) + sum(len(one[2]) for one in said) == 8192


def test_a_turned_segment_keeps_the_image_and_all_lengths(opened, flat):
    tab = opened(flat)
    before = in_camera(tab)
    for number, (start, end) in enumerate(TREE_SEGMENTS):
        tab.evaluate(f"hand.toggle({number})")
        after = in_camera(tab)
        np.testing.assert_allclose(after[:, :2], before[:, :2], atol=2e-4)
        for a, b in TREE_SEGMENTS:
            change = (-1 if (a, b) == (start, end) else 1) * (before[b, 2] - before[a, 2])
            assert after[b, 2] - after[a, 2] == pytest.approx(change, abs=4e-4)
        before = after
    # All are turned: the mirror image of the first posture; turned again it is the first.
    tab.evaluate("DATA.flips.segments.forEach((_, k) => hand.toggle(k))")
    assert tab.evaluate("[page.state.hand, page.state.survivor]") == [None, 0]


def test_a_click_turns_the_segment_under_it_and_says_the_verdict(opened, flat):
    tab = opened(flat)
    tab.click("[data-look=camera]")
    number = SEGMENT_NAMES_OF_TREE.index("left_knee-left_ankle")
    frame = flat.frames[0]
    branch = frame.branches[tab.evaluate("pack.number(page.frame(), 0)")]
    wanted = branch[:number] + str(1 - int(branch[number])) + branch[number + 1 :]
    tab.mouse.click(*middle_of(tab, number))
    assert tab.is_visible("#flips-verdict")
    verdict = tab.inner_text("#flips-verdict")
    if wanted in frame.branches:
        assert verdict.startswith(f"survives: posture {frame.branches.index(wanted)}")
    else:
        reason = next(one["reason"] for one in frame.pruned if wanted.startswith(one["branch"]))
        assert verdict.startswith("rejected: " + reason.split("/")[0].replace("_", " "))
    # A drag turns the picture, not a segment.
    x, y = middle_of(tab, number)
    tab.mouse.move(x, y)
    tab.mouse.down()
    tab.mouse.move(x + 40, y + 10)
    tab.mouse.up()
    assert tab.inner_text("#flips-verdict") == verdict


@pytest.mark.parametrize("width", [1280, 420])
def test_the_keyboard_alone_turns_segments(opened, flat, width):
    tab = opened(flat, width)
    tab.keyboard.press("f")
    first = tab.evaluate("document.activeElement.textContent")
    tab.keyboard.press("Enter")
    second = tab.evaluate("document.activeElement.textContent")
    assert first != second
    assert first.split(": ")[0] == second.split(": ")[0]
    assert "right shoulder" in first
    assert "rejected: rigid parts" in tab.inner_text("#flips-verdict")
    assert "rejected: rigid parts" in tab.inner_text("#caption")
    assert tab.evaluate("document.documentElement.scrollWidth") <= width
    tab.keyboard.press("l")
    assert tab.evaluate("page.state.hand") is None
    assert tab.inner_text("#flips-verdict").startswith("survives")


def test_recover_reads_the_saved_file_and_finds_that_posture_alone(opened, flat, flat_view, tmp_path):
    tab = opened(flat)
    tab.evaluate("page.chooseFrame(1); page.chooseSurvivor(3); tables.choose('flips')")
    frame, survivor = flat.frames[1], tab.evaluate("pack.number(page.frame(), 3)")
    nearer = saved(tab, tmp_path / "nearer.json")
    assert nearer == tab.evaluate("hand.file().frames")
    assert len(nearer) == len(flat.frames)
    assert set(nearer[1]) == set(SEGMENT_NAMES_OF_TREE)
    assert not any(nearer[:1] + nearer[2:])  # nothing was chosen there
    again = posekit.recover(flat_view, nearer=nearer)
    assert again.frames[1].branches == [frame.branches[survivor]]
    np.testing.assert_allclose(again.frames[1].joints[0], frame.joints[survivor], atol=1e-6)
    assert again.frames[0].branches == list(flat.frames[0].branches)


def test_what_the_page_calls_rejected_recover_rejects(opened, flat, flat_view):
    tab = opened(flat)
    tab.evaluate("tables.choose('flips')")
    judged = set()
    for number in range(13):
        tab.evaluate(f"hand.toggle({number})")
        kind = tab.evaluate("hand.verdict().kind")
        again = posekit.recover(flat_view, nearer=tab.evaluate("hand.file().frames")).frames[0]
        assert len(again.joints) == (kind == "survives")
        judged.add(kind)
        if kind == "rejected":  # back, so that the next one is judged by itself
            tab.evaluate(f"hand.toggle({number})")
    assert judged == {"survives", "rejected"}


def test_a_refined_photograph(opened, photograph):
    view, result = photograph
    tab = opened(result)
    tab.evaluate("tables.choose('flips')")
    frame = result.frames[0]
    held = len(frame.joints)
    # Flips as a survivor has them are its own, or those of a likelier one that lies as it does.
    assert tab.evaluate("page.frame().family.signs.every((one, k) => hand.judged(one).survivor <= k)")
    for k in range(held):
        tab.evaluate(f"page.chooseSurvivor({k})")
        mine = frame.joints[tab.evaluate(f"pack.number(page.frame(), {k})")]
        again = posekit.recover(view, nearer=tab.evaluate("hand.file().frames")).frames[0]
        away = np.linalg.norm(np.asarray(again.joints) - mine, axis=-1)
        assert len(away) and away[:, : len(JOINTS)].max(axis=1).min() < 0.05
    kinds = set()
    for number in range(13):
        tab.evaluate(f"hand.toggle({number})")
        kinds.add(tab.evaluate("hand.verdict().kind"))
    assert "rejected" in kinds
    assert "unknown" not in kinds


def test_a_girdle_of_taylor_s_tree_turns_as_a_whole(opened, taylor, tmp_path):
    tab = opened(taylor)
    tab.evaluate("tables.choose('flips')")
    names = tab.evaluate("DATA.flips.segments.map((one) => one.name)")
    assert len(names) == 11
    before = saved(tab, tmp_path / "before.json")[0]
    tab.evaluate(f"hand.toggle({names.index('right_hip-left_hip')})")
    after = saved(tab, tmp_path / "after.json")[0]
    assert {name for name in before if before[name] != after[name]} == {"right_hip-left_hip"}
    points = np.array(tab.evaluate("scene.drawn()"), dtype=float)
    assert np.isfinite(points).all()


def test_without_pruned_branches_the_page_says_what_it_does_not_know(opened, flat):
    bare = [dataclasses.replace(frame, pruned=None) for frame in flat.frames]
    tab = opened(dataclasses.replace(flat, frames=bare))
    tab.evaluate("tables.choose('flips'); hand.toggle(0)")
    assert "--explain" in tab.inner_text("#flips-verdict")
    open_set = [dataclasses.replace(frame, unlisted=3, unlisted_probability=0.01) for frame in bare]
    tab = opened(dataclasses.replace(flat, frames=open_set))
    tab.evaluate("tables.choose('flips'); hand.toggle(0)")
    assert tab.evaluate("hand.verdict().kind") == "unknown"
    assert "--nearer nearer.json" in tab.inner_text("#flips-note")


def test_too_many_branches_are_left_out(monkeypatch, flat):
    whole = page_data(flat)
    assert whole["frames"][1]["pruned"] == len(flat.frames[1].pruned)
    monkeypatch.setattr(hand_page, "MOST_BRANCHES", 10)
    least = page_data(flat)
    assert "prunedBranch" not in least["packed"]
    assert not any(frame["pruned"] for frame in least["frames"])
    assert len(json.dumps(least)) < len(json.dumps(whole))


def test_calibrated_frames_have_no_flips_by_hand(opened, walked):
    tab = opened(walked)
    assert tab.is_hidden("#flips-tab")
    tab.keyboard.press("f")
    assert tab.is_hidden("#flips")


def test_segments_whose_ends_were_not_seen_are_not_turned(opened, hidden_elbow):
    tab = opened(hidden_elbow[0])
    tab.evaluate("tables.choose('flips')")
    hidden = {k for k, name in enumerate(SEGMENT_NAMES_OF_TREE) if "right_elbow" in name}
    before = tab.evaluate("scene.drawn()")
    for number in hidden:
        assert tab.is_disabled(f"#flips-list button >> nth={number}")
        tab.evaluate(f"hand.toggle({number})")
    assert tab.evaluate("scene.drawn()") == before
    assert not {SEGMENT_NAMES_OF_TREE[k] for k in hidden} & set(tab.evaluate("hand.file().frames[0]"))
    tab.evaluate("hand.toggle(0)")
    assert tab.evaluate("scene.drawn()") != before


def test_what_is_not_listed_is_not_among_what_was_rejected(opened, photograph):
    _, result = photograph
    frame, tab = result.frames[0], opened(result)
    assert frame.unlisted
    tab.click("[data-tab=rejected]")
    note = tab.inner_text("#rejected .note").replace(",", "")
    lost = sum(frame.rejected.values()) - frame.unlisted
    assert f"{lost} were rejected {len(frame.joints)} survived {frame.unlisted} more are possible" in note
    assert "unlisted" not in tab.inner_text("#rejected")
