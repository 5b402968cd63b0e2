"""Symmetries of recovery: what is seen in a mirror, turned, larger, or alone is recovered so."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

import posekit
from posekit.cameras import PinholeCamera, ScaledOrthographicCamera
from posekit.doors import view_of
from posekit.robots import load_robot
from posekit.settings import EXACT, MEASURED
from posekit.skeleton import HEAD_POINTS, JOINTS, SEGMENT_NAMES, other_side
from posekit.synthesis import forget_camera, random_views
from tests.test_cli import folder, run

__all__ = ["folder", "run"]  # fixtures
EXCHANGED = [JOINTS.index(other_side(name)) for name in JOINTS]
CAMERA = PinholeCamera(K=np.array([[900, 0, 320], [0, 900, 240], [0, 0, 1.0]]), size=(640, 480))


@pytest.fixture(scope="module")
def view() -> posekit.View:
    """Three random legal postures, 2 px off, in front of a camera without a pose."""
    seen = random_views(3, np.random.default_rng(11), distance=(4.0, 5.0))
    truth = seen.truth
    image = CAMERA.project(truth) + np.random.default_rng(12).normal(0, 2.0, (3, 14, 2))
    return posekit.View(
        camera=CAMERA,
        image=image,
        time=np.arange(3) / 10,
        root=truth[:, 0],
        truth=truth,
        deviation=2.0,
        lengths=dict(posekit.load_figure().lengths),
    )


@pytest.fixture(scope="module")
def found(view: posekit.View) -> posekit.Recovery:
    return posekit.recover(view, length_deviation=0.02)


def alike(one: posekit.Recovery, other: posekit.Recovery, moved: Any) -> None:
    """Assert that likely survivors of both are the same after a motion, with the same chi2 and regions.

    Probabilities are sampled, and the samples do not move with the person.
    """
    for k in range(len(one)):
        mine, others = (found.survivors.frame == k for found in (one, other))
        joints = moved(one[k].joints)
        apart = np.linalg.norm(joints[:, None] - other[k].joints[None], axis=-1).max(axis=-1)
        likely, nearest = one[k].probability > 0.03, apart.argmin(axis=1)
        assert likely.any() and (apart.min(axis=1)[likely] < 1e-4).all()
        for column in ("radius", "chi2"):
            first = getattr(one.survivors, column)[mine][likely]
            second = getattr(other.survivors, column)[others][nearest[likely]]
            if column == "radius":  # sides may be exchanged
                first, second = np.sort(first, axis=1), np.sort(second, axis=1)
            np.testing.assert_allclose(second, first, rtol=1e-2)


def test_a_mirrored_picture_shows_the_mirrored_person(view: posekit.View, found: posekit.Recovery) -> None:
    def mirrored(joints: np.ndarray) -> np.ndarray:
        return np.asarray(joints[..., EXCHANGED, :] * [-1.0, 1.0, 1.0])

    seen = replace(
        view,
        image=(view.image * [-1, 1] + [640, 0])[:, EXCHANGED],
        truth=mirrored(view.truth),
        root=view.root * [-1, 1, 1],
    )
    alike(found, posekit.recover(seen, length_deviation=0.02), mirrored)


def test_a_picture_on_its_side_shows_the_same_person(view: posekit.View, found: posekit.Recovery) -> None:
    turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    camera = PinholeCamera(K=np.array([[900, 0, 240], [0, 900, 320], [0, 0, 1.0]]), size=(480, 640))
    image = (view.image - [320, 240]) @ turn[:2, :2].T + [240, 320]
    seen = replace(view, camera=camera, image=image, truth=view.truth @ turn.T, root=view.root @ turn.T)
    alike(found, posekit.recover(seen, length_deviation=0.02), lambda joints: joints @ turn.T)


def test_a_frame_alone_has_the_answer_that_it_has_among_others(
    view: posekit.View, found: posekit.Recovery
) -> None:
    for k in range(len(view)):
        alone, start = posekit.recover(view.take([k]), length_deviation=0.02), found.rows(k).start
        assert alone.answer.survivor[0] == found.answer.survivor[k] - start
        np.testing.assert_array_equal(
            alone.answer.representatives[0], found.answer.representatives[k] - start
        )
        np.testing.assert_allclose(alone.answer.represented[0], found.answer.represented[k])
        np.testing.assert_allclose(alone.answer.nearer_sure[0], found.answer.nearer_sure[k])
        assert alone.frames.reason[0] == found.frames.reason[k]
        assert alone.frames.unlisted_probability[0] == pytest.approx(found.frames.unlisted_probability[k])


def test_the_answer_is_near_its_survivor_and_its_signs_are_its_depths(found: posekit.Recovery) -> None:
    for k in range(len(found)):
        row, rows = int(found.answer.survivor[k]), found.rows(k)
        assert rows.start <= row < rows.stop
        away = np.linalg.norm(found.survivors.joints[rows] - found.answer.joints[k], axis=-1).mean(axis=1)
        assert away.argmin() + rows.start == row
        representatives = found.answer.representatives[k]
        assert (rows.start <= representatives).all() and (representatives < rows.stop).all()
        assert (np.diff(found.answer.represented[k]) <= 1e-9).all()


def test_exact_postures_alone_are_listed_if_points_are_not_to_be_refined(view: posekit.View) -> None:
    exact = posekit.builtin_view("seq1")
    as_usual = posekit.recover(exact)
    alone = posekit.recover(exact, posekit.RecoverSettings(refine=False))
    np.testing.assert_allclose(alone.survivors.joints, as_usual.survivors.joints)
    image = exact.image.copy()
    image[:, 6:] += np.random.default_rng(0).normal(
        0, 1e-3, image[:, 6:].shape
    )  # limbs are too long for it, or short
    for refine, empty in ((False, True), (None, False)):
        found = posekit.recover(replace(exact, image=image), posekit.RecoverSettings(refine=refine))
        assert (len(found.survivors) == 0) is empty
        assert not empty or set(found.frames.reason) == {"no posture is exact"}


@pytest.mark.parametrize("within", [0.1, 0.25, 0.6])
def test_a_posture_joins_the_first_leader_that_is_near(within: float) -> None:
    """The likeliest posture without a group leads the next one."""
    found = posekit.recover(posekit.builtin_view("seq2"), group=within)
    for k in range(len(found)):
        joints, leaders = found[k].joints, list[int]()
        for row, one in enumerate(joints):
            near = [n for n in leaders if np.linalg.norm(one - joints[n], axis=1).max() <= within]
            leaders += [] if near else [row]
            assert found[k].group[row] == (leaders.index(near[0]) if near else len(leaders) - 1)


@pytest.mark.parametrize("photograph", [True, False])
def test_regions_are_as_wide_as_errors_are(photograph: bool) -> None:
    """Squares of 95 % radii are 2.6 times those of errors if errors are normal and alike in all directions."""
    seen = random_views(12, np.random.default_rng(2), distance=(3.0, 6.0))
    noise = np.random.default_rng(3).normal(0, 4.0, (*seen.truth.shape[:2], 2))
    calibrated = posekit.View(
        camera=CAMERA,
        image=CAMERA.project(seen.truth) + noise,
        time=seen.time,
        root=seen.truth[:, 0],
        deviation=4.0,
        lengths=dict(posekit.load_figure().lengths),
    )
    given, known = (forget_camera(seen), {"stature": 1.75}) if photograph else (calibrated, {})
    found = posekit.recover(given, **known)
    radii, errors = [], []
    for one, truth in zip(found, seen.truth, strict=True):
        away = one.joints - one.joints.mean(axis=1, keepdims=True) - (truth - truth.mean(axis=0))
        off = np.linalg.norm(away, axis=2)
        radii.append(one.radius[off.mean(axis=1).argmin()])
        errors.append(off[off.mean(axis=1).argmin()])
    assert 1.0 < np.mean(np.square(radii)) / np.mean(np.square(errors)) < 7.0
    assert np.mean(np.less_equal(errors, radii)) > 0.85


@pytest.mark.parametrize(("place", "seen"), [(-1.0, False), (0.0, True), (639.0, True), (640.0, False)])
@pytest.mark.parametrize("confidence", [0.1, 0.9])
def test_unsure_points_outside_the_picture_are_not_seen(place: float, seen: bool, confidence: float) -> None:
    """The centres of the first and the last column of a picture of 640 are 0 and 639."""
    points = np.full((1, 17, 3), 0.9)
    points[0, :, :2] = np.random.default_rng(0).uniform(100, 400, (17, 2))
    points[0, 9] = [place, 200.0, confidence]  # the left wrist
    image = view_of(points, layout="coco_17", camera=CAMERA).image
    assert bool(np.isfinite(image[0, JOINTS.index("left_wrist")]).all()) is (seen or confidence > 0.5)
    assert np.isfinite(image[0, JOINTS.index("right_wrist")]).all()


def test_a_photograph_that_does_not_fit_leaves_the_others() -> None:
    truth = random_views(3, np.random.default_rng(2), distance=(4.0, 5.0)).truth
    image = truth[..., :2] * 200.0
    image[1] *= 5  # every segment is too long for its scale
    lengths = dict(posekit.load_figure().lengths)
    seen = posekit.View(
        camera=ScaledOrthographicCamera(scale=200.0), image=image, time=np.arange(3.0), lengths=lengths
    )
    found = posekit.recover(seen)
    assert [len(found[k]) > 0 for k in range(3)] == [True, False, True]
    assert found.frames.reason[1].startswith("scale: got 200; expected at least ")
    assert (found.frames.reason[0], found.frames.reason[2]) == ("", "")
    for k in (0, 2):
        alone = posekit.recover(seen.take([k]))
        np.testing.assert_allclose(alone.survivors.joints, found[k].joints, atol=1e-9)
    with pytest.raises(posekit.InputError, match="expected at least"):
        posekit.recover(seen.take([1]))


# Objects


def test_a_written_object_projects_onto_its_image_and_has_its_configurations(
    run: Any, tmp_path: Path
) -> None:
    view, target = tmp_path / "panda.json", tmp_path / "found.json"
    run("synth", "object", "panda", "-o", str(view), "--seed", "4")
    seen = json.loads(view.read_text(encoding="utf-8"))
    code, out, err = run("recover", str(view), "-o", str(target), "--linkage", "panda", "--scale", "500")
    assert code == 0, err
    document = json.loads(target.read_text(encoding="utf-8"))
    (frame,) = document["frames"]
    assert f"{len(frame['postures'])} postures of panda in 1 frame" in out
    robot = load_robot("panda", bodies="none")
    data, places = robot.model.createData(), document["points"]
    image = np.array([seen["frames"][0]["image"][name] for name in places])
    starts, ends = ([places.index(name.split("-")[k]) for name in document["segments"]] for k in range(2))
    for one in frame["postures"]:
        points = np.array(one["points"])
        assert np.linalg.norm(points[starts] - points[ends], axis=1) == pytest.approx(
            document["lengths"], abs=1e-6
        )
        flat = image / one["scale"]
        np.testing.assert_allclose(np.diff(points[:, :2], axis=0), np.diff(flat, axis=0), atol=1e-9)
        pin.framesForwardKinematics(robot.model, data, np.array(one["q"]))
        placed = np.array([data.oMf[robot.model.getFrameId(name)].translation for name in places])
        R, _ = Rotation.align_vectors(placed - placed.mean(axis=0), points - points.mean(axis=0))
        off = R.apply(points - points.mean(axis=0)) - (placed - placed.mean(axis=0))
        assert one["fk_distance"] == pytest.approx(np.linalg.norm(off, axis=1).max(), abs=1e-6)
        assert one["certified"] is (one["fk_distance"] < 1e-3)
    assert f"{sum(one['certified'] for one in frame['postures'])} have a configuration" in out


@pytest.mark.parametrize("given", [1, 3])
def test_flips_of_an_object_that_are_given_by_hand_are_kept(given: int, run: Any, tmp_path: Path) -> None:
    view, target, settings = (tmp_path / name for name in ("panda.json", "found.json", "hand.toml"))
    run("synth", "object", "panda", "-o", str(view), "--seed", "4")
    words = ("recover", str(view), "-o", str(target), "--linkage", "panda", "--scale", "500")

    def postures(*more: str) -> list[dict[str, Any]]:
        code, _, err = run(*words, *more)
        assert code == 0, err
        (frame,) = json.loads(target.read_text(encoding="utf-8"))["frames"]
        found: list[dict[str, Any]] = frame["postures"]
        return found

    every = postures()
    hand = dict(list(every[-1]["flips"].items())[:given])
    lines = [f'"{segment}" = "{nearer}"' for segment, nearer in hand.items()]
    settings.write_text("\n".join(["[nearer]", *lines]), encoding="utf-8")
    kept = [one["points"] for one in every if hand.items() <= one["flips"].items()]
    assert 0 < len(kept) < len(every)
    assert [one["points"] for one in postures("--settings", str(settings))] == kept


@pytest.mark.parametrize("proportions", ["auto", "figure", "people", "taylor"])
def test_lengths_grow_with_the_stature_whoever_states_it(view: posekit.View, proportions: str) -> None:
    """Without lengths a calibrated view shows the figure, scaled to the stature."""
    one = replace(view.take([0]), lengths={})
    one = forget_camera(one) if proportions == "taylor" else one
    settings = posekit.RecoverSettings(proportions=proportions)
    tall, small = (posekit.recover(one, settings, stature=size).lengths for size in (1.95, 1.3))
    by_view = posekit.recover(replace(one, stature=1.95), settings).lengths
    assert by_view == tall and set(tall) == set(small) == set(SEGMENT_NAMES)
    for name in SEGMENT_NAMES:
        assert tall[name] / small[name] == pytest.approx(1.95 / 1.3, rel=1e-6)
    if proportions in ("auto", "figure"):
        assert tall == pytest.approx(posekit.load_figure().scaled(stature=1.95).lengths)
    else:
        assert tall != pytest.approx(posekit.load_figure().scaled(stature=1.95).lengths, rel=0.01)


def test_looser_tolerances_keep_every_stricter_survivor_and_have_a_reason_where_none_is() -> None:
    """Parts of a tolerance that are not given are those for measured people."""
    seen = posekit.builtin_view("seq1")
    image = np.array(seen.image)
    image[2, JOINTS.index("left_knee")] = np.nan
    seen = replace(seen, image=image)
    settings = [posekit.RecoverSettings(rigid_tolerance=size) for size in (0.001, 0.01)]
    strict, loose = (posekit.recover(seen, one) for one in settings)
    assert set(loose.frames.judged) == {"tolerated"} and len(loose.survivors) > len(strict.survivors)
    for k in (0, 1, 3, 4):
        assert len(strict[k]) and {*strict[k].branch} <= {*loose[k].branch}
    assert not len(loose[2]) and loose.frames.reason[2] == "its neck is not known, or a joint is not seen"
    whole = posekit.RecoverSettings(
        rigid_tolerance=0.01, tangent_tolerance=MEASURED.tangent, angle_tolerance=MEASURED.angle
    )
    np.testing.assert_array_equal(posekit.recover(seen, whole).survivors.joints, loose.survivors.joints)
    other = posekit.RecoverSettings(rigid_tolerance=0.01, tangent_tolerance=0.001, angle_tolerance=0.1)
    assert len(posekit.recover(seen, other).survivors) < len(loose.survivors)


def test_a_search_of_depths_is_the_default_rules_are_numbers_and_rounding_is_exact() -> None:
    assert posekit.RecoverSettings(root="search") == posekit.RecoverSettings()
    assert EXACT.exact and not replace(EXACT, rigid=1.01 * EXACT.rigid).exact
    assert posekit.RecoverSettings(rules="1, 3,5").rules == (1, 3, 5)
    with pytest.raises(posekit.InputError, match="expected some of 1, 2, 3, 4, 5"):
        posekit.RecoverSettings(rules=(0, 1))


def test_a_head_is_as_large_as_the_head_points_that_a_view_gives() -> None:
    seen = random_views(1, np.random.default_rng(1), distance=(4.0, 5.0))
    usual = posekit.recover(seen)
    head = usual.survivors.head[0] - usual.survivors.joints[0, 0]
    figure = posekit.load_figure().head_points
    large = replace(
        seen,
        head_points={name: (1.3 * figure[1 + k]).tolist() for k, name in enumerate(HEAD_POINTS)},
        head_image=seen.camera.project((seen.truth[0, 0] + 1.3 * head)[None]),
    )
    found = posekit.recover(large).survivors
    assert len(found)
    away = np.linalg.norm(found.head - found.joints[:, :1], axis=-1)
    np.testing.assert_allclose(away, np.tile(1.3 * np.linalg.norm(figure[1:], axis=1), (len(found), 1)))
