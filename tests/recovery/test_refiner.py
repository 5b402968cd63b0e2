"""Views whose noise is known: what refinement keeps, how sure it is, and what the result says of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest

import posekit
from posekit.body import LengthUncertainty, load_figure
from posekit.body.uncertainty import UNKNOWN_ADULT
from posekit.errors import InputError
from posekit.formats import own as files
from posekit.formats.own import View
from posekit.formats.own.column import columns_in
from posekit.formats.own.survivor_columns import Likelihoods
from posekit.recovery import leaf_search, recover
from posekit.recovery.certified import certified_within
from posekit.recovery.noise import Noise, contact_under_noise
from posekit.recovery.recovered import recovered_with
from posekit.recovery.recovery import Recovery
from posekit.recovery.result import result_of
from posekit.settings import MEASURED_TOLERANCE
from posekit.skeleton import JOINT, SEGMENTS, segment_name
from posekit.synthesis import SyntheticScene, random_views
from posekit.validators import Validator
from posekit.views.builtin import forget_camera, view_of

FIGURE = load_figure()
PIXELS = 2.0
FRAMES = 40


def noisy(scene: SyntheticScene, pixels: float = PIXELS) -> View:
    view = view_of(scene.with_noise(pixels, np.random.default_rng(1)))
    return replace(view, deviation=pixels, root=scene.joints_cam[:, 0])


@pytest.fixture(scope="module")
def scene() -> SyntheticScene:
    return random_views(FIGURE, FRAMES, np.random.default_rng(0))


@pytest.fixture(scope="module")
def recovery(scene: SyntheticScene) -> Recovery:
    return recover(noisy(scene), length_deviation=0.0)


def errors(recovery: Recovery, scene: SyntheticScene) -> Any:
    """Return each frame's best mean joint error, metres; infinite without a survivor."""
    return np.array(
        [
            np.linalg.norm(frame.joints - truth, axis=2).mean(axis=1).min(initial=np.inf)
            for frame, truth in zip(recovery.frames, scene.joints_cam, strict=True)
        ]
    )


def test_the_truth_is_near_a_survivor(recovery: Recovery, scene: SyntheticScene) -> None:
    found = errors(recovery, scene)
    assert (found < 0.035).mean() >= 0.95
    plain = recover(noisy(scene), refine=False)
    assert (errors(plain, scene) < 0.035).mean() < 0.7  # what noise takes where nothing is done about it
    assert {frame.judged for frame in recovery.frames} == {"refined"}
    assert {frame.judged for frame in plain.frames} == {"measured"}


def test_lengths_that_are_known_are_kept(recovery: Recovery) -> None:
    lengths = np.array([FIGURE.lengths[segment_name(pair)] for pair in SEGMENTS])
    a, b = np.array(SEGMENTS).T
    for frame in recovery.frames:
        own = np.linalg.norm(frame.joints[:, a] - frame.joints[:, b], axis=2)
        np.testing.assert_allclose(own, np.broadcast_to(lengths, own.shape), atol=1e-9)
        assert (frame.length_residual < 1e-9).all()


def test_every_leaf_is_accounted_for(scene: SyntheticScene) -> None:
    for frame in recover(noisy(scene), coverage=1.0).frames:
        assert len(frame) + sum(frame.rejected.values()) == 8192 * max(frame.hypotheses, 1)
        assert frame.refined is not None
        merged = frame.rejected.get("noise/merged", 0)
        assert int(frame.refined.merged.sum()) == merged


def test_survivors_are_what_noise_explains_and_their_chi_square_says_so(recovery: Recovery) -> None:
    view_image = np.concatenate([frame.refined.p for frame in recovery.frames if frame.refined is not None])
    assert (view_image >= 1e-3).all()
    for frame in recovery.frames:
        assert frame.refined is not None
        assert frame.tolerance is not None
        assert frame.tolerance.angle == 6.0  # three deviations of the limits
        apart = np.linalg.norm(frame.joints[:, None] - frame.joints[None], axis=3).max(axis=2)
        assert (apart + np.eye(len(frame)) > 0.005).all()  # what became one is one


def test_stated_deviations_are_those_of_the_errors(recovery: Recovery, scene: SyntheticScene) -> None:
    inside = total = 0
    for frame, truth in zip(recovery.frames, scene.joints_cam, strict=True):
        if not len(frame) or frame.refined is None:
            continue
        off = frame.joints - truth
        best = np.linalg.norm(off, axis=2).mean(axis=1).argmin()
        covariance = frame.refined.covariance[best, 6:] + 1e-10 * np.eye(3)
        square = np.einsum(
            "ji,ji->j", off[best, 6:], np.linalg.solve(covariance, off[best, 6:, :, None])[..., 0]
        )
        inside += int((square < 7.815).sum())  # the 95 % point of chi-square with three degrees of freedom
        total += 8
    assert 0.75 < inside / total <= 1.0


def test_probabilities_sum_to_one_and_know_more_than_chance(
    recovery: Recovery, scene: SyntheticScene
) -> None:
    first, middle = [], []
    for frame, probability, truth in zip(
        recovery.frames, recovery.probability, scene.joints_cam, strict=True
    ):
        assert probability.shape == (len(frame),)
        if len(frame):
            assert probability.sum() == pytest.approx(1.0)
            off = np.linalg.norm(frame.joints - truth, axis=2).mean(axis=1)
            first.append(off[probability.argmax()])
            middle.append(off.mean())
    assert np.mean(first) < np.mean(middle)


def test_bodies_overlap_no_farther_than_is_allowed() -> None:
    """Without a check after refinement some would; what it rejects is counted, and the truth stays."""
    scene = random_views(FIGURE, 20, np.random.default_rng(0))
    view = noisy(scene, 10.0)

    def overlapping(recovery: Recovery) -> int:
        deepest = Validator(checks=("collision",), contact_margin=contact_under_noise(0.0))
        joints = np.concatenate([frame.joints for frame in recovery.frames])
        return deepest.check(joints).verdicts.count("invalid")

    recovery = recover(view, length_deviation=0.0)
    with mock.patch.object(leaf_search, "contradictions", lambda *_: []):
        unchecked = recover(view, length_deviation=0.0)
    assert recovery.settings["refined"]["contact"] == -0.03
    assert overlapping(unchecked) > 0
    assert overlapping(recovery) == 0
    assert all((frame.margins["collision"] >= -1e-9).all() for frame in recovery.frames)
    for frame, other in zip(recovery.frames, unchecked.frames, strict=True):
        for each in (frame, other):
            assert len(each) + sum(each.rejected.values()) == 8192 * each.hypotheses
        assert len(frame) <= len(other)
    late = [
        branch
        for frame in recovery.frames
        for branch in frame.pruned()
        if branch.reason.startswith("collision/") and len(branch.branch) == 13 and branch.lower == -0.03
    ]
    assert late
    assert all(branch.value < -0.03 and branch.unit == "m" for branch in late)
    np.testing.assert_allclose(errors(recovery, scene), errors(unchecked, scene), atol=0.02)


@pytest.mark.parametrize("pixels", [0.5, 5.0])
@pytest.mark.parametrize("ranges", ["urdf", "table1", "anatomical"])
def test_every_survivor_is_valid_by_the_result_itself(
    ranges: str, pixels: float, scene: SyntheticScene
) -> None:
    """What `validate` asks of the result, with its settings, finds nothing."""
    view = noisy(scene.select(np.arange(16)), pixels)
    recovery = recover(view, ranges=ranges)

    def verdicts(recovery: Recovery, *, heads: bool) -> list[str]:
        said = recovered_with(result_of(recovery))
        rigid = recovery.settings["refined"]["rigid"]
        validator = Validator(said.figure, settings=said.settings, ranges=ranges, rigid_tolerance=rigid)
        points = np.concatenate(
            [frame.batch.points[frame._rows] for frame in recovery.frames if frame.batch is not None]
        )
        return validator.check(points[:, :14], points[:, 14:] if heads else None).verdicts

    assert recovered_with(result_of(recovery)).settings.angle_tolerance == 6.0
    for heads in (False, True):
        assert "invalid" not in verdicts(recovery, heads=heads)
    named = {reason for frame in recovery.frames for reason in frame.rejected}
    assert any(reason.startswith("joint_range/") for reason in named)
    for frame in recovery.frames:
        assert len(frame) + sum(frame.rejected.values()) == 8192 * max(frame.hypotheses, 1)


def test_a_rejection_after_refinement_says_what_and_by_how_much(recovery: Recovery) -> None:
    late = [
        branch
        for frame in recovery.frames
        for branch in frame.pruned()
        if branch.reason.startswith("joint_range/") and len(branch.branch) == 13
    ]
    assert late
    assert all(branch.unit == "deg" for branch in late)
    assert all(not branch.lower <= branch.value <= branch.upper for branch in late)


@pytest.mark.parametrize("lengths", [0.0, 0.02, 0.06])
def test_lengths_are_allowed_what_bodies_are_or_what_is_said(lengths: float) -> None:
    noise = Noise(deviation=2.0, lengths=LengthUncertainty.uniform(lengths))
    allowed = certified_within(noise, FIGURE)
    assert allowed.angle == 6.0
    bends = min(0.027, 3 * lengths)
    most = np.sqrt(2 * lengths**2 + bends**2) * max(FIGURE.lengths.values())
    assert allowed.rigid == pytest.approx(max(0.03, 3 * most))
    assert certified_within(Noise(deviation=2.0), FIGURE).rigid == 0.03


def test_exact_points_stay_exact_whatever_noise_is_said(scene: SyntheticScene) -> None:
    view = replace(view_of(scene), deviation=PIXELS)
    told, plain = recover(view), recover(view_of(scene))
    for a, b in zip(told.frames, plain.frames, strict=True):
        assert a.judged == b.judged == "exact"
        np.testing.assert_array_equal(a.joints, b.joints)


def test_a_neck_that_is_not_given_is_placed_with_the_noise(scene: SyntheticScene) -> None:
    view = replace(noisy(scene), root=np.full((FRAMES, 3), np.nan))
    recovery = recover(view, length_deviation=0.0)
    assert (errors(recovery, scene) < 0.1).mean() >= 0.9
    assert all(frame.root is not None for frame in recovery.frames)


def test_bodies_that_give_need_room_for_it(scene: SyntheticScene) -> None:
    """With a shoulder that is 2 cm off its place, held lengths lose the truth and uncertain ones keep it."""
    joints = scene.joints_cam.copy()
    shift = joints[:, JOINT["neck"]] - joints[:, JOINT["pelvis"]]
    shift /= np.linalg.norm(shift, axis=1, keepdims=True)
    for name in ("right_shoulder", "right_elbow", "right_wrist"):
        joints[:, JOINT[name]] += 0.02 * shift
    shrugged = replace(scene, joints_cam=joints, image=scene.camera.project(joints))
    view = noisy(shrugged, 1.0)
    given = errors(recover(view), shrugged)
    held = errors(recover(view, length_deviation=0.0), shrugged)
    assert (given < 0.05).mean() >= 0.85
    assert (held < 0.05).mean() <= 0.6


def test_flips_that_are_given_by_hand_hold(scene: SyntheticScene, recovery: Recovery) -> None:
    segment = "right_elbow-right_wrist"
    given = recover(noisy(scene), length_deviation=0.0, nearer=[{segment: "right_wrist"}])
    wrist, elbow = JOINT["right_wrist"], JOINT["right_elbow"]
    beyond = 0
    for free, held in zip(recovery.frames, given.frames, strict=True):
        # Lifted, the wrist was nearer; what refinement does afterwards is a few centimetres.
        assert (held.joints[:, wrist, 2] < held.joints[:, elbow, 2] + 0.06).all()
        beyond += bool((free.joints[:, wrist, 2] > free.joints[:, elbow, 2] + 0.06).any())
    assert beyond > FRAMES / 3


def test_less_confident_points_are_less_certain(scene: SyntheticScene) -> None:
    view = noisy(scene)
    confidence = np.ones((FRAMES, 19))
    confidence[:, JOINT["right_wrist"]] = 0.3
    noise = Noise.of(replace(view, confidence=confidence), None, LengthUncertainty(), asked=False)
    assert noise is not None
    deviation = noise.of_points(
        replace(view, confidence=confidence), np.arange(FRAMES), np.full(FRAMES, 4.0), np.full(FRAMES, 1500.0)
    )
    np.testing.assert_allclose(deviation[:, JOINT["right_wrist"]], PIXELS / np.sqrt(0.3))
    np.testing.assert_allclose(deviation[:, JOINT["left_wrist"]], PIXELS)


def test_joints_that_are_hidden_stay_unknown_or_are_completed(scene: SyntheticScene) -> None:
    view = noisy(scene)
    image = view.image[:4].copy()
    image[:, JOINT["right_wrist"]] = np.nan
    part = replace(
        view,
        image=image,
        **{name: getattr(view, name)[:4] for name in ("time", "head_image", "confidence", "root", "truth")},
    )
    without = recover(part, infer=False)
    completed = recover(part)
    for frame in without.frames:
        assert np.isnan(frame.joints[:, JOINT["right_wrist"]]).all()
        assert frame.refined is not None
        assert np.isnan(frame.refined.covariance[:, JOINT["right_wrist"]]).all()
    told = 0
    for frame in completed.frames:
        known = np.isfinite(frame.joints[:, JOINT["right_wrist"]]).all(axis=1)
        assert frame.inferred is not None
        assert [("right_wrist" in joints) for joints in frame.inferred] == known.tolist()
        told += int(known.sum())
    assert told >= 0.9 * sum(len(frame) for frame in completed.frames) > 0


@pytest.mark.parametrize("name", ["r.json", "r.npz"])
@pytest.mark.parametrize("unit", ["m", "cm"])
def test_a_file_keeps_what_refinement_says(name: str, unit: Any, recovery: Recovery, tmp_path: Path) -> None:
    some = replace(recovery, frames=recovery.frames[:3])
    result = result_of(some, unit=unit)
    files.write_result(tmp_path / name, result)
    read = files.read_result(tmp_path / name)
    assert read.settings == result.settings
    for a, b in zip(read.frames, result.frames, strict=True):
        assert a.probability is not None
        assert b.probability is not None
        assert a.refined is not None
        assert b.refined is not None
        half = {name: 0.5 * 10.0 ** (1 - one.digits) for name, one in columns_in(Likelihoods).items()}
        np.testing.assert_allclose(a.probability, b.probability, rtol=0.5e-4)
        for field in ("chi2", "p"):
            np.testing.assert_allclose(getattr(a.refined, field), getattr(b.refined, field), rtol=half[field])
        for field in ("dof", "merged"):
            np.testing.assert_array_equal(getattr(a.refined, field), getattr(b.refined, field))
        told = np.isfinite(b.refined.covariance)
        np.testing.assert_array_equal(np.isfinite(a.refined.covariance), told)
        eigenvalues = np.linalg.eigvalsh(np.where(told, b.refined.covariance, 0.0))
        least, singular = eigenvalues[..., :1, None], 1e-7 * eigenvalues[..., -1:, None]
        off = np.where(told, a.refined.covariance - b.refined.covariance, 0.0)
        assert (np.abs(off) <= 0.065 * least + singular + 1e-15).all()


def test_what_cannot_be_refined_is_refused(scene: SyntheticScene) -> None:
    view = noisy(scene)
    with pytest.raises(InputError, match="--refine: only views of an opencv camera, or of none"):
        recover(forget_camera(view), refine=True, scale="closure")
    with pytest.raises(InputError, match="--refine: the noise says what is tolerated"):
        recover(replace(view, root=np.full((FRAMES, 3), np.nan)), refine=True, tolerance=MEASURED_TOLERANCE)
    with pytest.raises(InputError, match=r"--length-deviation: 0\.5; expected a fraction"):
        recover(view, length_deviation=0.5)


def test_the_command_line_refines(
    scene: SyntheticScene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Callable[..., Any]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert command("synth", "random", "-o", "view.json", "--frames", "3", "--noise", "2").code == 0
    assert files.read_view("view.json").deviation == 2.0
    assert command("recover", "view.json", "-o", "r.json").code == 0
    result = files.read_result("r.json")
    told = dict(result.settings["noise"])
    assert told.pop("by_segment") == UNKNOWN_ADULT.own
    assert told == {
        "deviation": 2.0,
        "offset": 0.0,
        "size": UNKNOWN_ADULT.common,
        "overlap": pytest.approx(0.066),
    }
    assert set(result.settings["judged"]) == {"refined"}
    assert command("recover", "view.json", "-o", "n.json", "--no-refine").code == 0
    assert files.read_result("n.json").settings["noise"] is None
    refused = command("recover", "view.json", "-o", "x.json", "--length-deviation", "2")
    assert refused.code == 2
    assert "--length-deviation" in refused.err
    assert not Path("x.json").exists()
    assert posekit.read_result("r.json").frames[0].probability is not None
