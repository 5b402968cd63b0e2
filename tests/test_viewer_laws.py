"""What pages, plots and pictures hold is what their source holds, number by number."""

from __future__ import annotations

import base64
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import posekit
from posekit.body import segment_lengths, with_head
from posekit.cameras import PinholeCamera, ScaledOrthographicCamera
from posekit.motion import Motion
from posekit.skeleton import DOFS, JOINT, JOINTS, TREE_SEGMENTS
from posekit.synthesis import random_views
from posekit.viewer.scene import Stage, camera_lines
from posekit.viewer.subjects import subjects_of
from tests.test_report_laws import random_report
from tests.test_report_validate import clip as gesture
from tests.test_viewer import data_of, drawn, motion, points_of, recovery, side_pixels, vars_of, view

__all__ = ["motion", "recovery", "view"]  # fixtures
FIGURE = posekit.load_figure()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("viewer-laws")


def unpacked(data: dict[str, Any], name: str) -> np.ndarray[Any, Any]:
    packed = data["packed"][name]
    return np.frombuffer(base64.b64decode(packed["base64"]), dtype=packed["type"])


# Pages


def test_a_page_of_a_result_holds_its_table(
    folder: Path, view: posekit.View, recovery: posekit.Recovery
) -> None:
    posekit.render(recovery, folder / "result.html", view=view)
    data, table, answer = data_of(folder / "result.html"), recovery.survivors, recovery.answer
    np.testing.assert_allclose(unpacked(data, "probability"), table.probability, rtol=1e-6)
    numbers = np.concatenate([np.arange(len(recovery[k])) for k in range(len(recovery))])
    np.testing.assert_array_equal(unpacked(data, "number"), numbers)
    for k, one in enumerate(data["margins"]):
        np.testing.assert_allclose(unpacked(data, f"margin{k}"), table.margins[one["name"]], rtol=1e-5)
    for k, one in enumerate(data["frames"]):
        rows = recovery.rows(k)
        assert (one["number"], one["count"], one["held"]) == (k, len(recovery[k]), len(recovery[k]))
        assert one["time"] == pytest.approx(view.time[k])
        assert one["best"] == answer.survivor[k] - rows.start
        assert [r["at"] + rows.start for r in one["representatives"]] == answer.representatives[k][
            :6
        ].tolist()
        assert sum(count for _, count in one["rejected"]) + one["rejectedMore"] == sum(
            recovery.frames.rejected[k].values()
        )
        assert one["levels"] == list(recovery.frames.levels[k])
        np.testing.assert_allclose(one["image"][:14], view.image[k], rtol=1e-5)
        assert one["image"][14:] == [None] * 5
    camera = data["camera"]
    R = np.array([camera["right"], camera["down"], camera["forward"]])
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-9)
    truth = unpacked(data, "truth").reshape(len(view), -1, 3)[:, :14] * data["step"]
    for k, body in enumerate(truth):
        cam = (body + data["frames"][k]["origin"] - camera["position"]) @ R.T
        np.testing.assert_allclose(cam, view.truth[k], atol=2e-3)


def test_a_page_counts_the_postures_that_it_leaves_out(folder: Path) -> None:
    seen = random_views(3, np.random.default_rng(3))
    found = posekit.recover(seen, checks=["collision"])
    for frame, shown in ((None, [0, 1, 2]), ((1, 2), [1, 2])):
        posekit.render(found, folder / "many.html", view=seen, frame=frame)
        data = data_of(folder / "many.html")
        assert [one["number"] for one in data["frames"]] == shown
        assert [one["count"] for one in data["frames"]] == [len(found[k]) for k in shown]
        held = sum(one["held"] for one in data["frames"])
        assert data["left"] == sum(len(found[k]) for k in shown) - held > 0
        assert len(unpacked(data, "probability")) == len(unpacked(data, "number")) == held


def test_a_page_of_a_tilted_camera_stands_upright(folder: Path, view: posekit.View) -> None:
    """The world of the page has z against gravity, whatever way the camera looks."""
    c, s = np.cos(0.5), np.sin(0.5)
    R = np.array(
        [[1, 0, 0], [0, -s, -c], [0, c, -s]]
    )  # of a world with z up to a camera that looks down by 0.5 rad
    camera = PinholeCamera(K=view.camera.K, R=R, t=np.zeros(3), up="+z", size=(640, 480))  # type: ignore[union-attr]
    given = posekit.View(**{**vars_of(view), "camera": camera, "image": camera.project(view.truth)})
    found = posekit.recover(given)
    posekit.render(found, folder / "tilted.html", view=given)
    data = data_of(folder / "tilted.html")
    np.testing.assert_allclose(np.array(data["camera"]["down"])[2], -c, atol=1e-6)
    body = points_of(data)[0][0, :14]
    cam = found.survivors.joints[0]
    np.testing.assert_allclose(np.diff(body[:, 2]), np.diff(cam @ R[:, 2]), atol=2e-3)


def test_a_page_of_a_motion_stands_on_its_ground_and_looks_at_the_eye(
    folder: Path, motion: posekit.Motion
) -> None:
    for name, turned in (("z", motion), ("y", motion.rotated("+y"))):
        posekit.render(turned, folder / f"{name}.html")
        data = data_of(folder / f"{name}.html")
        assert [one["number"] for one in data["frames"]] == list(range(40))
        assert [one["time"] for one in data["frames"]] == pytest.approx(motion.time, abs=1e-6)
        bodies = np.concatenate(points_of(data))[:, :14]
        assert np.quantile(np.nanmin(bodies[..., 2], axis=1), 0.05) == pytest.approx(0.03, abs=2e-3)
        for a, b in TREE_SEGMENTS:
            shown = np.linalg.norm(bodies[:, a] - bodies[:, b], axis=-1)
            true = np.linalg.norm(motion.figure_joints[:, a] - motion.figure_joints[:, b], axis=-1)
            np.testing.assert_allclose(shown, true, atol=2e-3)
        right, left = bodies[0, JOINT["right_shoulder"]], bodies[0, JOINT["left_shoulder"]]
        assert right[0] < left[0] and abs(right[1] - left[1]) < 2e-3
        assert bodies[-1, 3, 1] - bodies[0, 3, 1] == pytest.approx(-1.2, abs=5e-3)  # it comes to the eye


def test_a_page_lists_findings_with_their_numbers(folder: Path) -> None:
    motion = gesture(broken=slice(20, 26))
    report = posekit.validate(motion)
    posekit.render(report, folder / "report.html", view=motion)
    data, table = data_of(folder / "report.html"), report.to_pandas()
    assert data["valid"] == int(report.ok.sum()) and data["asked"] == len(report)
    assert data["decision"] == report.decision
    for one in data["checks"]:
        mine = table[table.check == one["name"]]
        assert one["frames"] == mine.frame.nunique() and one["clips"] == mine["clip"].nunique()
    (clip,) = data["clips"]
    assert clip["bad"] == int((~report.ok).sum()) and tuple(clip["good"]) == report.clips[0].good
    assert [span["text"] for span in clip["spans"]] == [str(span) for span in report.clips[0].spans]
    first = table[table.frame == 21].iloc[0]
    shown = data["frames"][21]["findings"]["0"]
    place = data["places"][shown[0][0]]
    assert (place["check"], place["where"]) == (first.check, first.place)
    assert float(shown[0][1].rstrip("°")) == pytest.approx(first.value, rel=5e-3)
    bound = first.lower if first.value < first.lower else first.upper
    assert float(shown[0][2].rstrip("°")) == pytest.approx(bound, rel=5e-3)


def test_a_page_of_a_report_lists_its_clips_the_worst_first(folder: Path) -> None:
    report = random_report(5)
    posekit.render(report, folder / "many.html")
    data, clips = data_of(folder / "many.html"), report.clips
    assert (data["kind"], data["frames"], data["decision"]) == ("report", [], report.decision)
    order = [one["clip"] for one in data["clips"]]
    kept = [clips[k].decision == "keep" for k in order]
    assert sorted(order) == list(range(len(clips))) and data["moreClips"] == 0
    assert kept == sorted(kept)  # clips to keep come last
    severities = [clips[k].severity for k, keep in zip(order, kept, strict=True) if not keep]
    assert severities == sorted(severities, reverse=True)
    for one in data["clips"]:
        clip, mine = clips[one["clip"]], np.asarray(report.clip) == one["clip"]
        assert (one["path"], one["frames"], one["reason"]) == (clip.title, int(mine.sum()), clip.reason)
        assert one["bad"] == int((np.array(report.verdicts)[mine] != "valid").sum())
        spans = [(span["check"], span["first"], span["last"], span["worst"]) for span in one["spans"]]
        assert spans == [
            (span.check, span.first, span.last, span.worst_frame) for span in clip.spans[: len(spans)]
        ]
        assert len(spans) + one["more"] == len(clip.spans) and len(spans) == min(40, len(clip.spans))
    counts = report.by_check()
    assert [one["name"] for one in data["checks"]] == list(counts)
    for one in data["checks"]:
        assert {name: one[name] for name in counts[one["name"]]} == counts[one["name"]]
    assert data["notes"] == list(report.notes)


def test_findings_of_several_clips_are_at_their_frames(folder: Path, tmp_path: Path) -> None:
    clips = [gesture(30, slice(5, 9)), gesture(40), gesture(20, slice(12, 20))]
    for name, clip in zip("abc", clips, strict=True):
        posekit.save(clip, tmp_path / f"{name}.npz")
    report = posekit.validate(tmp_path)
    posekit.render(report, folder / "clips.html", view=clips)
    data, table = data_of(folder / "clips.html"), report.to_pandas()
    assert [(one["clip"], one["number"]) for one in data["frames"]] == [
        (k, number) for k, clip in enumerate(clips) for number in range(len(clip))
    ]
    assert data["left"] == 0 and data["kind"] == "motion"
    for one in data["frames"]:
        mine = table[(table["clip"] == report.clips[one["clip"]].title) & (table.frame == one["number"])]
        shown = [place for place, *_ in one.get("findings", {}).get("0", [])]
        named = [(data["places"][place]["check"], data["places"][place]["where"]) for place in shown]
        assert sorted(named) == sorted(zip(mine.check, mine.place, strict=True))
    for clip in data["clips"]:
        for span in clip["spans"]:
            at = data["frames"][span["index"]]
            assert (at["clip"], at["number"]) == (clip["clip"], span["worst"])
    for at, body in enumerate(points_of(data)):
        motion = clips[data["frames"][at]["clip"]]
        joints = motion.figure_joints[data["frames"][at]["number"]]
        apart = np.linalg.norm(joints[:, None] - joints[None], axis=-1)
        shown = np.linalg.norm(body[0, :14, None] - body[0, None, :14], axis=-1)
        np.testing.assert_allclose(shown, apart, atol=2e-3)


def test_a_page_of_a_noisy_result_holds_its_answers(folder: Path) -> None:
    exact = random_views(3, np.random.default_rng(6), distance=(4.0, 5.0))
    camera = PinholeCamera(K=np.array([[900, 0, 320], [0, 900, 240], [0, 0, 1.0]]), size=(640, 480))
    noise = np.random.default_rng(7).normal(0, 3.0, (3, 14, 2))
    image = camera.project(exact.truth) + noise
    image[1, JOINT["left_wrist"]] = np.nan
    seen = posekit.View(
        camera=camera,
        image=image,
        time=exact.time,
        root=exact.truth[:, 0],
        deviation=3.0,
        lengths=dict(FIGURE.lengths),
        pictures=("a.png", "b.png", "c.png"),
    )
    found = posekit.recover(seen, length_deviation=0.03, group=0.2, follow=2)
    posekit.render(found, folder / "noisy.html", view=seen)
    data, table, answer = data_of(folder / "noisy.html"), found.survivors, found.answer
    bits = unpacked(data, "inferred")
    assert [[bool(one >> k & 1) for k in range(14)] for one in bits.tolist()] == table.inferred.tolist()
    np.testing.assert_allclose(unpacked(data, "radius").reshape(-1, 14), 1000 * table.radius, atol=1.0)
    np.testing.assert_array_equal(unpacked(data, "groups"), table.group)
    assert found.path is not None
    paths = unpacked(data, "paths").reshape(3, -1, len(data["points"]), 3)[:, :, :14] * data["step"]
    assert data["paths"]["probability"] == pytest.approx(found.path.probability.tolist(), rel=1e-3)
    for k, one in enumerate(data["frames"]):
        span = np.linalg.norm(np.diff(found.path.joints[:, k], axis=1), axis=-1)
        np.testing.assert_allclose(np.linalg.norm(np.diff(paths[k], axis=1), axis=-1), span, atol=2e-3)
        assert data["paths"]["survivor"][k] == found.path.survivor[:, k].tolist()
        assert (one["picture"], one["reason"]) == (f"{'abc'[k]}.png", found.frames.reason[k])
        assert one["sure"] == pytest.approx(answer.sure[k], rel=1e-3) and one["sureOf"] == answer.sure_of[k]
        assert one["unlisted"] == pytest.approx(found.frames.unlisted_probability[k], rel=5e-3)
        assert one["unlistedCount"] == found.frames.unlisted[k]
        assert one["nearer"] == answer.nearer[k].tolist()
        np.testing.assert_allclose(
            np.array(one["nearerSure"], dtype=float), answer.nearer_sure[k], atol=5.1e-4
        )
        rows = answer.representatives[k]
        assert one["moreRepresentatives"] == max(len(rows) - 6, 0)
        assert [each["p"] for each in one["representatives"]] == pytest.approx(
            answer.represented[k][:6].tolist(), rel=1e-3
        )
        first = table.joints[rows[0]]
        for each, row in zip(one["representatives"], rows, strict=False):
            other = table.joints[row]
            change = {
                JOINTS[b]: (other[b, 2] - other[a, 2]) - (first[b, 2] - first[a, 2]) for a, b in TREE_SEGMENTS
            }
            large = sorted(
                (name for name in change if abs(change[name]) > 0.05), key=lambda n: -abs(change[n])
            )
            words = [f"{name} {'farther' if change[name] > 0 else 'nearer'}" for name in large[:2]]
            assert each["how"] == ", ".join(words).replace("_", " ")


@pytest.mark.parametrize("aspect", [1.0, 1.5])
def test_the_image_of_a_page_has_square_pixels(folder: Path, aspect: float) -> None:
    joints = random_views(1, np.random.default_rng(6)).truth
    camera = ScaledOrthographicCamera(scale=200.0, aspect=aspect)
    seen = posekit.View(camera=camera, image=camera.project(joints), time=np.zeros(1), truth=joints)
    found = posekit.recover(seen)
    posekit.render(found, folder / "flat.html", view=seen)
    data = data_of(folder / "flat.html")
    shown = np.array(data["frames"][0]["image"][:14])
    np.testing.assert_allclose(shown, 200.0 * joints[0, :, :2], rtol=1e-5, atol=1e-3)
    assert data["camera"]["parallel"] is True
    truth = unpacked(data, "truth").reshape(1, -1, 3)[:, :14] * data["step"]
    up = np.array([data["camera"][name] for name in ("right", "down", "forward")])
    turned = truth[0] @ up.T - joints[0]
    np.testing.assert_allclose(turned, np.broadcast_to(turned[0], (14, 3)), atol=2e-3)


def test_bodies_of_a_page_are_those_of_the_figure(folder: Path, motion: posekit.Motion) -> None:
    posekit.render(motion, folder / "bodies.html")
    data = data_of(folder / "bodies.html")
    neutral = FIGURE.neutral_points
    for one, capsule in zip(data["capsules"], FIGURE.capsules, strict=True):
        start, end = (neutral[list(ends)].mean(axis=0) for ends in (one["start"], one["end"]))
        length = float(np.linalg.norm(end - start))
        assert one["radius"] == pytest.approx(capsule.radius)
        assert one["center"] * length == pytest.approx(capsule.center, abs=1e-5)
        assert one["half"] * length == pytest.approx(capsule.half_length, abs=1e-5)
        assert one["side"] == next(
            (side for side in ("right", "left") if capsule.link.startswith(side)), "middle"
        )
    sides = [one.partition("_")[0] for one in data["points"]]
    assert data["pointSides"] == [one if one in ("right", "left") else "middle" for one in sides]


CHAIN = """<robot name="chain"><link name="base"/><link name="right_arm"/><link name="right_hand"/>
<link name="left_arm"/>
<joint name="a" type="revolute"><parent link="base"/><child link="right_arm"/><origin xyz="0 -0.2 0.4"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
<joint name="b" type="fixed"><parent link="right_arm"/><child link="right_hand"/><origin xyz="0 0 0.3"/></joint>
<joint name="c" type="revolute"><parent link="base"/><child link="left_arm"/><origin xyz="0 0.01 0"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""


def test_a_urdf_is_drawn_at_its_neutral_configuration(folder: Path) -> None:
    path = folder / "figure.urdf"
    path.write_text(FIGURE.urdf, encoding="utf-8")
    robot = posekit.load_robot(path)
    posekit.render(path, folder / "urdf.html")
    posekit.render(robot, folder / "robot.html")
    neutral = Motion(q=robot.neutral[None], q_names=robot.configuration_names, robot=str(path))
    posekit.render(neutral, folder / "neutral.html")
    pages = [data_of(folder / f"{name}.html") for name in ("urdf", "robot", "neutral")]
    assert pages[0]["packed"] == pages[1]["packed"] == pages[2]["packed"]


def test_a_page_of_a_robot_joins_each_link_to_its_parent(folder: Path) -> None:
    (folder / "chain.urdf").write_text(CHAIN, encoding="utf-8")
    q = np.array([[0, 0, 0, 0, 0, 0, 1, 0.5, 0.0]])
    posekit.render(posekit.Motion(q=q, robot=str(folder / "chain.urdf")), folder / "chain.html")
    data = data_of(folder / "chain.html")
    names = data["points"]
    joined = {(names[a], names[b], side) for a, b, side in data["segments"]}
    assert joined == {
        ("base", "right_arm", "right"),
        ("right_arm", "right_hand", "right"),
        ("base", "left_arm", "left"),
    }
    # Links that lie in each other have no body between them.
    bodies = {(names[one["start"][0]], names[one["end"][0]]) for one in data["capsules"]}
    assert bodies == {("base", "right_arm"), ("right_arm", "right_hand")}
    points = dict(zip(names, points_of(data)[0][0], strict=True))
    assert np.linalg.norm(points["right_hand"] - points["right_arm"]) == pytest.approx(0.3, abs=1e-3)
    assert points["right_hand"][2] - points["right_arm"][2] == pytest.approx(0.3 * np.cos(0.5), abs=1e-3)


# Plots


def paths_of(text: str, name: str) -> list[np.ndarray[Any, Any]]:
    """Return the corners (N, 2) of the first path of each group with an id, pixels."""
    found = re.findall(
        rf'<g id="{re.escape(name)}">\s*(?:<defs>.*?</defs>\s*)?<path d="([^"]*)"', text, re.DOTALL
    )
    return [np.array(re.findall(r"[ML] ([-\d.]+) ([-\d.]+)", one), dtype=float) for one in found]


def test_plots_of_angles_are_to_scale(folder: Path, motion: posekit.Motion) -> None:
    """The grey edges are the limits of the URDF: by them the drawn line is read in degrees."""
    posekit.render(motion, folder / "angles.svg", which="angles")
    text = (folder / "angles.svg").read_text(encoding="utf-8")
    lines, outside = paths_of(text, "angle"), paths_of(text, "outside")
    q = FIGURE.configurations(motion.figure_joints).q[:, FIGURE.angle_index]
    assert len(lines) == len(DOFS) and len(outside) == 2 * len(DOFS)
    lower, upper = np.degrees(FIGURE.limits.lower), np.degrees(FIGURE.limits.upper)
    for k, line in enumerate(lines):
        low, high = outside[2 * k][:, 1].min(), outside[2 * k + 1][:, 1].max()
        degrees = lower[k] + (line[:, 1] - low) / (high - low) * (upper[k] - lower[k])
        drawn_angles = np.interp(line[:, 0], np.linspace(line[0, 0], line[-1, 0], 40), np.degrees(q[:, k]))
        np.testing.assert_allclose(degrees, drawn_angles, atol=0.5, err_msg=DOFS[k])


def test_plots_of_a_robots_joints_are_to_scale(folder: Path) -> None:
    """A joint has a panel; the root of a robot has none, and limits of more than a turn end at a turn."""
    (folder / "chain.urdf").write_text(CHAIN, encoding="utf-8")
    robot = posekit.load_robot(folder / "chain.urdf")
    names = list(robot.configuration_names)
    q = np.tile(robot.neutral, (12, 1))
    q[:, 7:] += np.random.default_rng(2).uniform(-0.3, 0.3, (12, len(names) - 7))
    columns = [*names[:7], *names[:6:-1]]
    shuffled = posekit.Motion(
        q=q[:, [names.index(name) for name in columns]],
        q_names=columns,
        robot=str(folder / "chain.urdf"),
        time=np.arange(12) / 10,
    )
    posekit.render(shuffled, folder / "robot.svg", which="angles")
    text = (folder / "robot.svg").read_text(encoding="utf-8")
    lines, outside = paths_of(text, "angle"), paths_of(text, "outside")
    assert len(lines) == len(names) - 7
    assert all(f"<!-- {name.replace('_', ' ')} -->" in text for name in names[7:])
    lower, upper = np.degrees([robot.lower[7:], robot.upper[7:]]).clip(-360, 360)
    for k, line in enumerate(lines):
        low, high = outside[2 * k][:, 1].min(), outside[2 * k + 1][:, 1].max()
        degrees = lower[k] + (line[:, 1] - low) / (high - low) * (upper[k] - lower[k])
        drawn_angles = np.interp(
            line[:, 0], np.linspace(line[0, 0], line[-1, 0], 12), np.degrees(q[:, 7 + k])
        )
        np.testing.assert_allclose(degrees, drawn_angles, atol=0.5, err_msg=names[7 + k])


def test_timelines_are_to_scale(folder: Path) -> None:
    report = posekit.validate(gesture(broken=slice(20, 26)))
    posekit.render(report, folder / "timeline.svg")
    text = (folder / "timeline.svg").read_text(encoding="utf-8")
    good = report.clips[0].good
    assert good is not None
    (bar,) = paths_of(text, "good")
    step = np.ptp(bar[:, 0]) / (good[1] + 1 - good[0])
    origin = bar[:, 0].min() - good[0] * step
    for span in report.spans:
        (bar,) = paths_of(text, f"{span.check}/{span.place}:{span.first}-{span.last}")
        assert ((bar[:, 0].min() - origin) / step, (bar[:, 0].max() - origin) / step) == pytest.approx(
            (span.first, span.last + 1), abs=0.05
        )


@pytest.mark.parametrize("seed", [3, 4])
def test_timelines_count_the_frames_of_their_clips(folder: Path, seed: int) -> None:
    report = random_report(seed)
    posekit.render(report, folder / "counts.svg")
    text = (folder / "counts.svg").read_text(encoding="utf-8")
    of_clip, verdict = np.asarray(report.clip), np.array(report.verdicts)
    assert {"invalid", "undecided"} <= set(verdict)
    for number, one in enumerate(report.clips):
        mine = verdict[of_clip == number]
        frames = f"{len(mine)} frame{'s' * (len(mine) != 1)}"
        assert f"{one.title}: {one.decision}; {int((mine != 'valid').sum())} of {frames} not valid" in text


# Scenes


@pytest.mark.parametrize("parallel", [False, True])
def test_rays_of_a_camera_end_at_the_joints_and_cross_its_image(view: posekit.View, parallel: bool) -> None:
    joints = view.truth[0]
    camera = ScaledOrthographicCamera(scale=100.0) if parallel else view.camera
    fields = {**vars_of(view), "camera": camera}
    if parallel:
        del fields["root"]
    seen = posekit.View(**fields)
    R = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    lines, colours = camera_lines(seen, 0, joints, R, np.array([0.0, 2.0, 1.0]))
    assert lines.shape[1:] == (2, 3) and len(colours) == len(lines)
    cam = (lines - [0.0, 2.0, 1.0]) @ R
    rays, rest = cam[:14], cam[14:]
    np.testing.assert_allclose(rays[:, 1], joints, atol=1e-9)
    (depth,) = set(np.round(rest[-1 - 4 * (not parallel), :, 2], 9))
    assert depth < joints[:, 2].min()
    assert rest[: len(TREE_SEGMENTS), :, 2] == pytest.approx(depth)
    image = joints[:, :2] if parallel else joints[:, :2] / joints[:, 2:] * depth
    drawn_points = rest[np.isclose(rest[..., 2], depth).all(axis=1)].reshape(-1, 3)[:, :2]
    for point in image:
        assert np.linalg.norm(drawn_points - point, axis=1).min() < 1e-9
    assert (drawn_points.min(axis=0) < image.min(axis=0)).all() and (
        drawn_points.max(axis=0) > image.max(axis=0)
    ).all()
    starts = rays[:, 0]
    np.testing.assert_allclose(
        starts, np.column_stack([image, np.full(14, depth)]) if parallel else 0.0, atol=1e-9
    )


@pytest.mark.parametrize("size", [(300, 300), (900, 300), (300, 900)])
@pytest.mark.parametrize("elevation", [None, 60.0])
def test_the_eye_sees_all_of_the_bodies_and_little_else(
    motion: posekit.Motion, size: tuple[int, int], elevation: float | None
) -> None:
    subjects, _, _ = subjects_of(motion)
    worlds, clip = Stage(subjects).eyes(size, elevation)
    points = np.concatenate([one.points[0] for one in subjects])
    at = np.column_stack([points, np.ones(len(points))]) @ (clip @ np.linalg.inv(worlds[0])).T
    seen = at[:, :2] / at[:, 3:]
    assert np.abs(seen).max() < 1
    assert max(np.ptp(seen[:, 0]), np.ptp(seen[:, 1])) > 1.5
    assert np.abs(seen.min(axis=0) + seen.max(axis=0)).max() < 0.25  # in the middle of the picture
    tilt = np.degrees(np.arcsin(worlds[0][2, 2]))
    assert tilt == pytest.approx(8.0 if elevation is None else elevation)


def test_the_eye_sees_the_camera_of_the_bodies_too(motion: posekit.Motion) -> None:
    subjects, _, _ = subjects_of(motion)
    lines = np.array([[[0.0, 0.0, 0.0], [0.5, -1.0, 3.5]], [[1.0, 0.5, 1.0], [3.0, 0.0, 1.0]]])
    worlds, clip = Stage(subjects, (lines, np.zeros((2, 3)))).eyes((640, 480), None)
    points = np.concatenate([*(one.points[0] for one in subjects), lines.reshape(-1, 3)])
    at = np.column_stack([points, np.ones(len(points))]) @ (clip @ np.linalg.inv(worlds[0])).T
    seen = at[:, :2] / at[:, 3:]
    assert np.abs(seen).max() < 1 and max(np.ptp(seen[:, 0]), np.ptp(seen[:, 1])) > 1.3
    assert np.abs(seen.min(axis=0) + seen.max(axis=0)).max() < 0.3


@pytest.mark.parametrize("frames", [1, 3, 12])
def test_bodies_stand_side_by_side_in_order(motion: posekit.Motion, frames: int) -> None:
    subjects, _, _ = subjects_of(motion, frame=(0, frames - 1))
    assert len(subjects) == frames
    spans = [(one.points[0, :, 0].min(), one.points[0, :, 0].max()) for one in subjects]
    gaps = [after[0] - before[1] for before, after in pairwise(spans)]
    assert all(0.19 < gap < 0.4 for gap in gaps)
    assert spans[0][0] + spans[-1][1] == pytest.approx(0.0, abs=0.05)
    for one in subjects:
        assert one.points[0, :, 1].min() + one.points[0, :, 1].max() == pytest.approx(0.0, abs=1e-9)
    assert [one.label for one in subjects] == ([f"frame {k}, {k / 30:.2f} s" for k in range(frames)])


@drawn
def test_the_camera_of_one_posture_is_drawn_and_makes_room(
    folder: Path, view: posekit.View, recovery: posekit.Recovery
) -> None:
    sizes = []
    for seen in (None, view):
        posekit.render(
            recovery, folder / "one.png", view=seen, frame=1, which="answer", size=(320, 240), azimuth=60
        )
        picture = np.asarray(Image.open(folder / "one.png"))
        rows = np.nonzero(sum(side_pixels(picture))[:, 110:])[0]  # beside the image of the view
        sizes.append(np.ptp(rows))
    assert sizes[1] < 0.7 * sizes[0]  # the camera stands farther away than the body is high


@drawn
def test_pictures_turn_with_their_eye(folder: Path, motion: posekit.Motion) -> None:
    """From the person's left the left side hides the right one, and from above a body is flat."""
    posekit.render(motion, folder / "left.png", frame=0, size=(200, 240), azimuth=90)
    right, left = side_pixels(np.asarray(Image.open(folder / "left.png"))[:196])
    assert left.sum() > 2 * right.sum()
    posekit.render(motion, folder / "above.png", frame=0, size=(200, 240), azimuth=0, elevation=90)
    right, left = side_pixels(np.asarray(Image.open(folder / "above.png"))[:196])
    rows, columns = np.nonzero(right | left)
    assert np.ptp(rows) < np.ptp(columns)


@drawn
def test_robots_are_drawn_by_what_is_seen_of_them(folder: Path) -> None:
    """Visual bodies are drawn, and collision bodies where there are none."""
    dark = {}
    for name, shapes in (
        ("both", "<visual>{small}</visual><collision>{large}</collision>"),
        ("none", "<collision>{large}</collision>"),
    ):
        boxes = {
            k: f'<geometry><box size="{s} {s} 0.5"/></geometry>' for k, s in (("small", 0.02), ("large", 0.2))
        }
        (folder / f"{name}.urdf").write_text(
            f"""<robot name="arm"><link name="base"/><link name="tip">{shapes.format(**boxes)}</link>
            <joint name="turn" type="revolute"><parent link="base"/><child link="tip"/><origin xyz="0 0 0.4"/>
            <axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>""",
            encoding="utf-8",
        )
        arm = posekit.Motion(q=np.array([[0, 0, 0, 0, 0, 0, 1, 0.0]]), robot=str(folder / f"{name}.urdf"))
        posekit.render(arm, folder / f"{name}.png", size=(200, 240))
        dark[name] = int((np.asarray(Image.open(folder / f"{name}.png"))[:196].min(axis=2) < 150).sum())
    assert dark["none"] > 3 * dark["both"]


@pytest.mark.parametrize("parallel", [False, True])
def test_an_overlay_paints_the_rays_that_meet_a_capsule(folder: Path, parallel: bool) -> None:
    joints = random_views(1, np.random.default_rng(8)).truth
    joints = joints - joints.mean(axis=1, keepdims=True) + [0.0, 0.0, 1.0]
    camera: Any = PinholeCamera(K=np.array([[240, 0, 160], [0, 240, 120], [0, 0, 1.0]]), size=(320, 240))
    if parallel:
        camera, joints = ScaledOrthographicCamera(scale=200.0), joints + np.array([0.8, 0.6, 0.0])
    seen = posekit.View(camera=camera, image=camera.project(joints), truth=joints, time=np.zeros(1))
    Image.new("RGB", (320, 240), (80, 90, 90)).save(folder / "grey.png")
    posekit.render(seen, folder / "painted.png", view=seen, over=folder / "grey.png")
    painted = (
        np.abs(np.asarray(Image.open(folder / "painted.png")).astype(int) - [80, 90, 90]).max(axis=2) > 8
    )

    pixels = np.stack(np.meshgrid(np.arange(320.0), np.arange(240.0)), axis=-1).reshape(1, -1, 2)
    origin, direction = (one[0] for one in camera.rays(pixels))
    met = np.zeros(pixels.shape[1], dtype=bool)
    for capsule in FIGURE.scaled(segment_lengths(joints)).capsules:
        middle, axis = capsule.place(with_head(joints))
        if np.isfinite(middle).all():
            for along in np.linspace(-capsule.half_length, capsule.half_length, 9):
                centre = middle[0] + along * axis[0] - origin
                across = centre - (centre * direction).sum(axis=1, keepdims=True) * direction
                met |= np.linalg.norm(across, axis=1) < capsule.radius
    both = (met & painted.ravel()).sum()
    assert met.mean() > 0.1 and both > 0.98 * met.sum() and both > 0.9 * (met | painted.ravel()).sum()


@pytest.mark.parametrize("shift", [None, (0.3, -0.2, 2.0)])
def test_a_motion_in_the_world_is_painted_as_its_camera_sees_it(folder: Path, shift: Any) -> None:
    joints = random_views(2, np.random.default_rng(8)).truth
    joints = joints - joints.mean(axis=1, keepdims=True) + [0.0, 0.0, 1.5]
    R = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    t = np.zeros(3) if shift is None else np.array(shift)
    K = np.array([[240, 0, 160], [0, 240, 120], [0, 0, 1.0]])
    camera = PinholeCamera(K=K, size=(320, 240), R=R, t=None if shift is None else t, up="+z")
    seen = posekit.View(camera=camera, image=camera.project(joints), truth=joints, time=np.arange(2) / 10)
    world = Motion(joints=(joints - t) @ R, time=seen.time, up="+z")
    Image.new("RGB", (320, 240), (80, 90, 90)).save(folder / "grey.png")
    for name, source in (("truth", seen), ("world", world)):
        for frame in (0, 1):
            posekit.render(
                source, folder / f"{name}{frame}.png", view=seen, over=folder / "grey.png", frame=frame
            )
    truth, moved = ([(folder / f"{name}{k}.png").read_bytes() for k in (0, 1)] for name in ("truth", "world"))
    assert truth == moved and truth[0] != truth[1]
