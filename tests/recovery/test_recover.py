"""From a view to certified postures: built-in views, missing joints, rules and margins, tolerances."""

import dataclasses
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.formats.own import LeeChenModel, OpenCVModel, View, read_result, write_result
from posekit.recovery import recover
from posekit.recovery.recovery import FrameRecovery, Recovery
from posekit.recovery.result import result_of
from posekit.recovery.summary import summary_lines
from posekit.settings import EXACT_TOLERANCE, MEASURED_TOLERANCE, Tolerance
from posekit.skeleton import JOINT, JOINTS, PARENTS, TREE_SEGMENTS, segment_name
from posekit.synthesis import (
    CameraSphere,
    SyntheticScene,
    random_views,
    seq1,
    seq2,
)
from posekit.validators import load_ranges
from posekit.views.builtin import builtin_view, view_of

FIGURE = load_figure()
SEQ1 = builtin_view("seq1")
ALL = ("rigid-parts", "joint-range", "collision", "walking")
SCENES = {"seq1": seq1, "seq2": seq2}
FOUND = 1e-6
LEAVES = 8192


def change(view: View, **fields: Any) -> View:
    return dataclasses.replace(view, **fields)


def without(view: View, joint: str) -> View:
    image = view.image.copy()
    image[:, JOINT[joint]] = np.nan
    return change(view, image=image)


def counts(recovery: Recovery) -> list[int]:
    return [len(frame) for frame in recovery.frames]


def codes(recovery: Recovery) -> list[list[str]]:
    return [frame.branches for frame in recovery.frames]


def total(frame: FrameRecovery) -> int:
    return len(frame) + sum(frame.rejected.values())


def assert_same(one: Recovery, other: Recovery) -> None:
    assert codes(one) == codes(other)
    for a, b in zip(one.frames, other.frames, strict=True):
        assert np.array_equal(a.joints, b.joints, equal_nan=True)
        assert np.array_equal(a.q, b.q, equal_nan=True)
        assert np.array_equal(a.fk_distance, b.fk_distance, equal_nan=True)
        assert a.rejected == b.rejected
        assert a.pruned() == b.pruned()
        assert set(a.margins) == set(b.margins)
        for name, values in a.margins.items():
            assert np.array_equal(values, b.margins[name], equal_nan=True)
        for column, level in a.levels.items():
            assert level.tolist() == b.levels[column].tolist()


# --- the built-in views ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "position"), [("seq1", [400, 0, 0]), ("seq2", [300, 0, 300])])
def test_the_camera_of_1985_is_recovered_from_the_head(name: str, position: list[float]) -> None:
    view = builtin_view(name)
    assert view.camera.f is None  # type: ignore[union-attr]
    for frame in recover(view).frames:
        assert frame.camera["f"] * 100 == pytest.approx(5.0, abs=1e-6)
        np.testing.assert_allclose(np.array(frame.camera["position"]) * 100, position, rtol=0, atol=1e-6)
        assert np.linalg.det(frame.camera["rotation"]) == pytest.approx(1.0)
        assert frame.camera["residual"] < 1e-15


@pytest.mark.parametrize("name", ["seq1", "seq2"])
def test_the_input_is_among_the_survivors_of_the_built_in_views(name: str, truth_at) -> None:
    recovery = recover(builtin_view(name))
    assert max(truth_at(recovery, SCENES[name]().joints_cam)) < FOUND
    assert {total(frame) for frame in recovery.frames} == {LEAVES}
    assert max(frame.fk_distance.max() for frame in recovery.frames) < 1e-9
    assert all(frame.tolerance == EXACT_TOLERANCE for frame in recovery.frames)
    assert max(frame.length_residual.max() for frame in recovery.frames) == 0


def test_another_name_is_refused_with_those_that_exist() -> None:
    with pytest.raises(InputError, match=r"'seq3' is not a built-in view; expected one of seq1, seq2"):
        builtin_view("seq3")


@pytest.mark.parametrize("name", ["seq1", "seq2"])
def test_the_same_view_gives_the_same_bits(name: str) -> None:
    assert_same(recover(builtin_view(name)), recover(builtin_view(name)))


def test_a_batch_is_its_frames_one_at_a_time() -> None:
    scene = random_views(FIGURE, 40, np.random.default_rng(1))
    together = recover(view_of(scene))
    for k, frame in enumerate(together.frames):
        alone = recover(view_of(scene.select([k]))).frames[0]
        assert alone.branches == frame.branches
        assert alone.rejected == frame.rejected
        np.testing.assert_allclose(alone.joints, frame.joints, rtol=0, atol=1e-9)


def test_more_frames_than_are_grown_together_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    view = view_of(random_views(FIGURE, 25, np.random.default_rng(4)))
    at_once = recover(view)
    seen: list[int] = []
    monkeypatch.setattr(import_module("posekit.recovery.conductor"), "FRAMES_AT_ONCE", 10)
    in_parts = recover(view, progress=seen.append)
    assert seen == [10, 10, 5]
    assert codes(in_parts) == codes(at_once)
    assert [frame.rejected for frame in in_parts.frames] == [frame.rejected for frame in at_once.frames]


def test_the_settings_say_what_decided_the_result() -> None:
    settings = recover(
        SEQ1, checks=ALL, rules=(1, 3), ranges="table1", contact_margin=-0.01, group=0.05
    ).settings
    assert settings["checks"] == list(ALL)
    assert settings["rules"] == [1, 3]
    assert settings["ranges"] == "table1"
    assert settings["range_limits"]["elbow.flexion"] == [0.0, 160.0]
    assert settings["contact_margin"] == -0.01
    assert settings["group"] == 0.05
    assert settings["figure"] == FIGURE.scaled({}, SEQ1.head_points).hash
    assert set(settings["versions"]) == {"posekit", "pin", "coal", "numpy"}
    assert recover(SEQ1).settings["rules"] == []


# --- missing joints -------------------------------------------------------------------------------------


def beyond(joint: str) -> set[str]:
    """Return a joint and all that hang on it."""
    found = {JOINT[joint]}
    for child, parent in enumerate(PARENTS):
        if parent in found:
            found.add(child)
    return {JOINTS[k] for k in found}


@pytest.mark.parametrize("joint", ["right_wrist", "left_knee", "right_shoulder", "left_hip", "pelvis"])
def test_a_missing_joint_leaves_the_postures_of_the_others(joint: str, truth_at) -> None:
    recovery = recover(without(SEQ1, joint), infer=False)
    lost = sorted(JOINT[name] for name in beyond(joint))
    kept = sorted(set(range(14)) - set(lost))
    assert max(truth_at(recovery, SEQ1.truth)) < FOUND
    for frame, whole in zip(recovery.frames, recover(SEQ1).frames, strict=True):
        assert np.isnan(frame.joints[:, lost]).all()
        assert np.isfinite(frame.joints[:, kept]).all()
        assert total(frame) == LEAVES
        assert frame.tolerance == EXACT_TOLERANCE
        assert all(f"missing/{name}" in frame.rejected for name in beyond(joint))
        # What was possible with the joint is possible without it, the unseen branches written as 0.
        keep = [k for k in range(1, 14) if k not in lost]
        known = {"".join(code[k - 1] for k in keep) for code in frame.branches}
        assert {"".join(code[k - 1] for k in keep) for code in whole.branches} <= known
        assert len(known) == len(frame)
        assert {code[k - 1] for code in frame.branches for k in lost} == {"0"}


def test_what_hangs_on_an_unseen_torso_joint_has_no_q() -> None:
    frame = recover(without(SEQ1, "right_wrist"), infer=False).frames[0]
    assert (frame.fk_distance < 1e-9).all()
    names = FIGURE.configuration_names
    unknown = {names[k] for k in np.flatnonzero(np.isnan(frame.q).any(axis=0))}
    assert unknown == {"right_shoulder_rotation", "right_elbow_flexion"}
    shoulderless = recover(without(SEQ1, "right_shoulder"), infer=False).frames[0]
    assert np.isnan(shoulderless.q[:, 3:7]).all()
    assert np.isnan(shoulderless.fk_distance).all()


@pytest.mark.parametrize("infer", [True, False])
@pytest.mark.parametrize("beside", [(), ("right_wrist",), ("right_hip", "left_hip", "right_knee")])
def test_a_frame_without_a_trunk_has_no_posture_and_says_why(beside: tuple[str, ...], infer: bool) -> None:
    """Only the neck would be known of it: that is no posture."""
    bare = SEQ1.image[1].copy()
    bare[[k for k, name in enumerate(JOINTS) if name not in ("neck", *beside)]] = np.nan
    image = SEQ1.image.copy()
    image[1] = bare
    recovery, whole = recover(change(SEQ1, image=image), infer=infer), recover(SEQ1)
    assert [len(frame) > 0 for frame in recovery.frames] == [True, False, True, True, True]
    frame = recovery.frames[1]
    assert frame.reason.startswith("frames[1]: none of right_shoulder, left_shoulder, pelvis is seen")
    assert total(frame) == LEAVES
    assert set(frame.rejected) == {"trunk/not_seen"}
    assert list(recovery.unrecovered.values()) == [[1]]
    for k in (0, 2, 3, 4):
        np.testing.assert_array_equal(recovery.frames[k].joints, whole.frames[k].joints)
    result = result_of(recovery)
    assert list(result.settings["unrecovered"].values()) == [[1]]
    assert "unrecovered" not in result_of(whole).settings


@pytest.mark.parametrize("joint", ["right_shoulder", "left_shoulder", "pelvis"])
def test_one_joint_of_the_trunk_makes_a_posture(joint: str) -> None:
    image = np.full_like(SEQ1.image, np.nan)
    image[:, [0, JOINT[joint]]] = SEQ1.image[:, [0, JOINT[joint]]]
    assert counts(recover(change(SEQ1, image=image))) == [2] * 5


@pytest.mark.parametrize(
    "hidden", [("right_wrist",), ("left_elbow",), ("right_knee", "right_ankle"), ("pelvis",)]
)
def test_a_hidden_joint_is_inferred_and_the_truth_is_in_its_set(hidden: tuple[str, ...]) -> None:
    view = SEQ1
    for joint in hidden:
        view = without(view, joint)
    plain, recovery = recover(view, infer=False), recover(view)
    for frame, bare, truth in zip(recovery.frames, plain.frames, SEQ1.truth, strict=True):
        assert frame.inferred is not None
        assert np.isfinite(frame.joints).all()
        assert np.isfinite(frame.q).all()
        assert total(frame) == LEAVES
        inferred = set().union(*frame.inferred)
        assert set(hidden) <= inferred
        exact = [k for k in range(14) if JOINTS[k] not in inferred]
        known = {joints[exact].tobytes() for joints in bare.joints}
        assert {joints[exact].tobytes() for joints in frame.joints} <= known  # exact joints to the bit
        true = np.abs(frame.joints[:, exact] - truth[exact]).max(axis=(1, 2)) < FOUND
        holds = [
            all(
                (truth[JOINT[name]] >= one.lower - 0.03).all()
                and (truth[JOINT[name]] <= one.upper + 0.03).all()
                for name, one in joints.items()
            )
            for joints in frame.inferred
        ]
        assert (true & np.array(holds)).any()


def test_what_was_inferred_is_written_and_nothing_where_all_was_seen(tmp_path: Path) -> None:
    result = result_of(recover(without(SEQ1, "right_wrist")), unit="cm")
    assert all(frame.inferred is None for frame in recover(SEQ1).frames)
    for suffix in ("json", "npz"):
        write_result(tmp_path / f"r.{suffix}", result)
        back = read_result(tmp_path / f"r.{suffix}")
        for one, other in zip(result.frames, back.frames, strict=True):
            for mine, theirs in zip(one.inferred or [], other.inferred or [], strict=True):
                assert mine["right_wrist"].kind == theirs["right_wrist"].kind == "sphere region"
                np.testing.assert_allclose(mine["right_wrist"].upper, theirs["right_wrist"].upper, rtol=1e-14)


# --- ranges, rules, margins -----------------------------------------------------------------------------


def assert_fewer(strict: Recovery, loose: Recovery) -> None:
    for a, b in zip(strict.frames, loose.frames, strict=True):
        assert set(a.branches) <= set(b.branches)


def test_table1_keeps_the_walker_and_says_its_name(truth_at) -> None:
    recovery = recover(SEQ1, ranges="table1")
    assert max(truth_at(recovery, SEQ1.truth)) < FOUND
    assert recovery.settings["ranges"] == "table1"
    assert codes(recovery) == codes(recover(SEQ1, ranges=load_ranges("table1")))
    others = view_of(random_views(FIGURE, 20, np.random.default_rng(5)))
    assert codes(recover(others, ranges="table1")) != codes(recover(others))


def test_ranges_from_a_file_narrow_the_limits(tmp_path: Any) -> None:
    path = tmp_path / "stiff.toml"
    path.write_text(
        'schema = "posekit.ranges/1"\nkind = "configuration"\n[right_elbow]\nflexion = [0.0, 20.0]\n',
        encoding="utf-8",
    )
    view = view_of(random_views(FIGURE, 20, np.random.default_rng(5)))
    stiff, free = recover(view, ranges=str(path)), recover(view, ranges="urdf")
    assert_fewer(stiff, free)
    assert 0 < sum(counts(stiff)) < sum(counts(free))
    column = FIGURE.configuration_names.index("right_elbow_flexion")
    angles = np.concatenate([frame.q[:, column] for frame in stiff.frames])
    assert np.degrees(angles).max() <= 20.001
    assert any("joint_range/right_elbow.flexion" in frame.rejected for frame in stiff.frames)


def test_unknown_ranges_checks_and_rules_are_refused() -> None:
    with pytest.raises(InputError, match=r"--ranges tabel1: no such table or file; expected urdf, table1"):
        recover(SEQ1, ranges="tabel1")
    with pytest.raises(
        InputError, match=r"--checks: 'colision' is not a check; expected some of rigid-parts"
    ):
        recover(SEQ1, checks=("colision",))
    for checks in (ALL, ALL[:3]):
        with pytest.raises(InputError, match=r"--rules: 9 is not a rule; expected some of 1, 2, 3, 4, 5"):
            recover(SEQ1, checks=checks, rules=(1, 9))


def test_every_rule_only_takes_away() -> None:
    view = change(SEQ1, camera=LeeChenModel(f=0.05))
    free = recover(view)
    both = recover(view, checks=ALL, rules=(1, 2))
    for rule in range(1, 6):
        one = recover(view, checks=ALL, rules=(rule,))
        assert_fewer(one, free)
        for frame in one.frames:
            assert total(frame) == LEAVES
            assert {reason.split(".")[0] for reason in frame.rejected if "walking" in reason} <= {
                f"walking/rule{rule}"
            }
        if rule <= 2:
            assert_fewer(both, one)
    assert sum(counts(both)) < sum(counts(free))
    for before, after in zip(free.frames, both.frames, strict=True):
        assert after.levels["physical"].tolist() == before.levels["physical"].tolist()
        assert after.levels["motion"][-1] == len(after)
        assert (after.levels["motion"] <= after.levels["physical"]).all()
    assert codes(recover(view, checks=ALL, rules=())) == codes(free)


@pytest.mark.parametrize("name", ["seq1", "seq2"])
def test_more_clearance_never_keeps_more(name: str) -> None:
    view = builtin_view(name)
    margins = (-0.05, -0.01, 0.0, 0.01, 0.03, 0.06)
    found = [recover(view, contact_margin=margin) for margin in margins]
    for loose, strict in pairwise(found):
        assert_fewer(strict, loose)
    assert sum(counts(found[-1])) < sum(counts(found[0]))
    for margin, recovery in zip(margins, found, strict=True):
        for frame in recovery.frames:
            assert (frame.margins["collision"] >= -1e-9).all()
            assert total(frame) == LEAVES
        assert recovery.settings["contact_margin"] == margin


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_margin_that_is_no_number_is_refused(value: float) -> None:
    """Nothing compares with NaN: every posture would pass."""
    with pytest.raises(InputError, match="contact margin is"):
        recover(SEQ1, contact_margin=value)
    with pytest.raises(InputError, match="--group"):
        recover(SEQ1, group=value)
    with pytest.raises(InputError, match="--rigid-tolerance"):
        Tolerance(rigid=value, tangent=0.0, placement=False)
    with pytest.raises(InputError, match="--tangent-tolerance"):
        Tolerance(rigid=0.0, tangent=value, placement=False)
    with pytest.raises(InputError, match="angle"):
        Tolerance(rigid=0.0, tangent=0.0, placement=False, angle=value)


# --- tolerances -----------------------------------------------------------------------------------------


def noisy(pixels: float, count: int = 40) -> SyntheticScene:
    """See random postures with noise on all but the head, which keeps its place in depth."""
    scene = random_views(FIGURE, count, np.random.default_rng(6), CameraSphere(distance=(2.5, 3.5)))
    image = scene.with_noise(pixels, np.random.default_rng(7)).image.copy()
    image[:, 0] = scene.image[:, 0]
    return dataclasses.replace(scene, image=image)


def test_a_noisy_torso_is_judged_as_measured(truth_at) -> None:
    scene = noisy(0.5)
    recovery = recover(view_of(scene), length_deviation=0.0)
    assert {frame.judged for frame in recovery.frames} == {"measured"}
    strict = [frame.tolerance == MEASURED_TOLERANCE for frame in recovery.frames]
    assert any(strict)
    assert {total(frame) for frame in recovery.frames} == {LEAVES}
    assert np.median(truth_at(recovery, scene.joints_cam)) < 0.05
    kept = np.concatenate([frame.joints for frame in recovery.frames])
    assert len(kept) > 100
    text = "\n".join(summary_lines(recovery))
    assert "measured" in text
    assert "exact" not in text
    given = recover(view_of(scene), tolerance=MEASURED_TOLERANCE)
    for own, frame, kept_so in zip(codes(given), recovery.frames, strict, strict=True):
        # Where nothing is left with less for the hips, they are given as much as the rest.
        assert (len(own) > 0) == kept_so
        assert not kept_so or own == frame.branches


def test_only_the_noisy_frame_is_judged_as_measured(truth_at) -> None:
    image = SEQ1.image.copy()
    image[3, 1:] += np.random.default_rng(2).normal(size=(13, 2)) * 5e-6
    recovery = recover(change(SEQ1, image=image))
    assert [frame.tolerance == EXACT_TOLERANCE for frame in recovery.frames] == [
        True,
        True,
        True,
        False,
        True,
    ]
    assert recovery.frames[3].tolerance == MEASURED_TOLERANCE
    assert len(recovery.frames[3]) > 0
    assert truth_at(recovery, SEQ1.truth)[3] < 0.05
    for k in (0, 1, 2, 4):
        assert recovery.frames[k].branches == recover(SEQ1).frames[k].branches


def test_a_segment_a_little_too_short_becomes_a_tangent_with_its_residual() -> None:
    segment, short = "right_elbow-right_wrist", 0.004
    elbow, wrist = SEQ1.truth[0, JOINT["right_elbow"]], SEQ1.truth[0, JOINT["right_wrist"]]
    ray = wrist / np.linalg.norm(wrist)
    length = float(np.linalg.norm(elbow - (elbow @ ray) * ray)) - short
    arrays = {
        name: getattr(SEQ1, name)[:1]
        for name in ("time", "image", "head_image", "confidence", "root", "truth")
    }
    view = change(SEQ1, lengths={segment: length}, **arrays)
    with pytest.raises(InputError, match=f"the segment {segment} is at least .* too short"):
        recover(view, tolerance=EXACT_TOLERANCE, checks=())
    tolerance = Tolerance(rigid=0.0, tangent=short + 1e-6, placement=False)
    recovery = recover(view, tolerance=tolerance, checks=())
    frame = recovery.frames[0]
    assert "coincident/right_wrist" in frame.rejected
    drawn_out = np.array(
        [
            np.linalg.norm(frame.joints[:, b] - frame.joints[:, a], axis=-1)
            - recovery.figure.lengths[segment_name((a, b))]
            for a, b in TREE_SEGMENTS
        ]
    )
    assert drawn_out[JOINT["right_wrist"] - 1].max() == pytest.approx(short, abs=1e-9)
    np.testing.assert_allclose(drawn_out.max(axis=0).clip(0.0), frame.length_residual, rtol=0, atol=1e-12)


def test_a_looser_tolerance_never_keeps_less() -> None:
    view = view_of(noisy(1.0, count=15))
    found = [
        recover(view, tolerance=Tolerance(rigid=rigid, tangent=0.01, placement=False, angle=2.0))
        for rigid in (0.005, 0.01, 0.02, 0.04)
    ]
    for strict, loose in pairwise(found):
        assert_fewer(strict, loose)
    assert sum(counts(found[0])) < sum(counts(found[-1]))


def test_exact_views_are_kept_by_a_given_tolerance_too(truth_at) -> None:
    recovery = recover(SEQ1, tolerance=MEASURED_TOLERANCE)
    assert max(truth_at(recovery, SEQ1.truth)) < FOUND
    assert {frame.tolerance for frame in recovery.frames} == {MEASURED_TOLERANCE}
    assert_fewer(recover(SEQ1), recovery)


# --- what counts as exact, and a root that does not fit -------------------------------------------------


def right_arm_alone(image: np.ndarray) -> View:
    """Return a view of neck, shoulder, elbow and wrist: no distance that would show whether it is exact."""
    seen = np.full((1, 14, 2), np.nan)
    seen[0, [0, 1, 6, 8]] = image
    K = np.array([[1100.0, 0, 640], [0, 1090, 360], [0, 0, 1]])
    return View(
        camera=OpenCVModel(K=K, distortion=None, R=None, t=None, size=None),
        time=np.zeros(1),
        image=seen,
        root=np.array([[0.0, -0.5, 3.5]]),
    )


def test_without_a_rigid_distance_nothing_is_judged_as_exact() -> None:
    """Half a pixel of noise: judged as exact, the nearest survivor would be 38 cm off."""
    image = np.array([[640.09, 204.02], [575.78, 202.87], [510.04, 211.92], [510.48, 289.7]])
    frame = recover(right_arm_alone(image), length_deviation=0.0).frames[0]
    assert frame.judged == "measured"
    truth = np.array([[-0.431, -0.495, 3.655], [-0.433, -0.236, 3.672]])
    assert np.linalg.norm(frame.joints[:, [6, 8]] - truth, axis=-1).max(axis=1).min() < 0.02


def test_exact_frames_say_so_in_the_settings() -> None:
    recovery = recover(SEQ1)
    assert recovery.settings["judged"] == ["exact"] * 5


def test_a_root_beside_its_ray_is_warned_of_and_a_wrong_one_refused() -> None:
    image = np.array([[640.0, 204.286], [575.8, 202.9], [510.0, 211.9], [510.5, 289.7]])
    view = right_arm_alone(image)
    with pytest.warns(UserWarning, match=r"frames\[0\].root is 1 cm beside"):
        recover(change(view, root=view.root + np.array([0.01, 0, 0])))
    with pytest.raises(InputError, match=r"frames\[0\].root: .* beside the ray"):
        recover(change(view, root=view.root + np.array([0.3, 0, 0])))
    with pytest.raises(InputError, match=r"frames\[0\].root: .* behind the camera"):
        recover(change(view, root=-view.root))
