"""Recovery: what holds of every survivor, of every frame, and of every answer."""

from dataclasses import replace

import numpy as np
import pytest

import posekit
from posekit.body import lay, load_figure
from posekit.cameras import PinholeCamera, ScaledOrthographicCamera
from posekit.evaluation import evaluate
from posekit.geometry import pa_mpjpe
from posekit.ranking import representatives
from posekit.recovery import Answer, Frames, Recovery, Survivors
from posekit.recovery.answer import answers_of, joint_radius
from posekit.recovery.scales import likely_scale
from posekit.samples import samples
from posekit.settings import EXACT
from posekit.skeleton import JOINT, SEGMENT_NAMES, SEGMENTS, TREE_SEGMENTS
from posekit.synthesis import random_views
from posekit.validators import judge_postures


def recover(view, **changes):
    return posekit.recover(view, posekit.RecoverSettings(**changes))


FIGURE = load_figure()
LENGTHS = np.array([FIGURE.lengths[name] for name in SEGMENT_NAMES])


@pytest.fixture(scope="module")
def exact():
    view = posekit.builtin_view("seq2")
    return view, recover(view)


@pytest.fixture(scope="module")
def random_frames():
    """Six random legal postures of the figure, their camera, and points that are 2 px off."""
    return noisy(seed=5)


def noisy(seed, sigma=2.0, count=6):
    view = random_views(count, np.random.default_rng(seed), figure=FIGURE)
    rng = np.random.default_rng(seed + 1)
    image = view.image + sigma * rng.normal(size=view.image.shape)
    return replace(
        view,
        image=image,
        head_image=np.empty(0),
        root=view.truth[:, 0],
        deviation=sigma or None,
        lengths=dict(FIGURE.lengths),
    )


@pytest.fixture(scope="module")
def found(random_frames):
    return recover(random_frames, length_deviation=0.02)


def test_survivors_and_rejected_are_all_leaves(exact):
    _, recovery = exact
    for frame in recovery:
        assert frame.judged == "exact"
        assert len(frame) + sum(frame.rejected.values()) == 8192
        assert frame.levels[-1] == len(frame)
        assert len(set(frame.branch)) == len(frame)


def test_exact_survivors_have_image_lengths_and_configuration(exact):
    view, recovery = exact
    table = recovery.survivors
    f = recovery[0].camera["f"]
    image = table.joints[..., :2] / table.joints[..., 2:] * f
    np.testing.assert_allclose(image, view.image[table.frame], atol=1e-9)
    start, end = np.array(SEGMENTS).T
    apart = np.linalg.norm(table.joints[:, start] - table.joints[:, end], axis=2)
    np.testing.assert_allclose(apart, np.broadcast_to(LENGTHS, apart.shape), atol=1e-7)
    np.testing.assert_allclose(FIGURE.points(table.q), table.joints, atol=1e-7)
    for k, frame in enumerate(recovery):
        assert np.abs(frame.joints - view.truth[k]).max(axis=(1, 2)).min() < 1e-6


def test_survivors_pass_the_checks_again(exact):
    _, recovery = exact
    from posekit.settings import RecoverSettings
    from posekit.validators.judge import chosen_checks

    asked = RecoverSettings()
    points = np.concatenate([recovery.survivors.joints, recovery.survivors.head], axis=1)
    checks = chosen_checks(asked, of_robot=False, in_time=False)
    for name, judgement in judge_postures(points, checks, FIGURE, asked, tolerance=EXACT).items():
        assert not judgement.violated.any(), name


@pytest.mark.parametrize("case", ["exact", "found"])
def test_probabilities_sum_to_one_with_the_unlisted(case, request):
    recovery = request.getfixturevalue(case)
    recovery = recovery[1] if case == "exact" else recovery
    for frame in recovery:
        assert frame.probability.sum() + frame.unlisted_probability == pytest.approx(1.0)
        assert (np.diff(frame.probability) <= 1e-12).all()
        assert 0 <= frame.sure <= 1 and frame.sure_of == "position"
        assert frame.represented.sum() >= 0.95 - 1e-9 or frame.unlisted_probability > 0.05 - 1e-9


def test_a_frame_does_not_depend_on_its_neighbours(random_frames, found):
    for k in (0, 3):
        alone = recover(random_frames.take([k]), length_deviation=0.02)[0]
        np.testing.assert_allclose(alone.joints, found[k].joints, atol=1e-9)
        np.testing.assert_allclose(alone.probability, found[k].probability, atol=1e-9)
        np.testing.assert_allclose(alone.answer, found[k].answer, atol=1e-9)


def test_an_exact_frame_of_a_long_film_is_recovered_as_alone():
    view = random_views(600, np.random.default_rng(4))
    view = replace(view, head_image=np.empty(0), root=view.truth[:, 0])
    together = recover(view)
    for k in (0, 255, 256, 511, 512, 599):
        own, alone = together[k], recover(view.take([k]))[0]
        assert own.branch.tolist() == alone.branch.tolist() and own.rejected == alone.rejected
        assert own.levels == alone.levels and own.levels[-1] == len(own)
        assert len(own) + sum(own.rejected.values()) == 8192
        np.testing.assert_allclose(own.probability, alone.probability, atol=1e-9)
        np.testing.assert_allclose(own.answer, alone.answer, atol=1e-9)
        assert (own.representatives - together.rows(k).start).tolist() == alone.representatives.tolist()


def test_noisy_survivors_reproject_within_the_noise(random_frames, found):
    table = found.survivors
    image = random_frames.camera.project(table.joints)
    off = np.linalg.norm(image - random_frames.image[table.frame], axis=2)
    assert off.max() < 6 * 2.0
    assert np.median(off) < 2 * 2.0
    assert np.isfinite(table.q).all() and (table.radius > 0).all()


def test_the_truth_is_near_a_survivor(random_frames, found):
    near = [
        pa_mpjpe(frame.joints, truth).min() for frame, truth in zip(found, random_frames.truth, strict=True)
    ]
    assert np.median(near) < 0.025 and max(near) < 0.06
    # 95 % regions of the nearest survivor hold most joints.
    held = []
    for frame, truth in zip(found, random_frames.truth, strict=True):
        off = np.linalg.norm(frame.joints - truth, axis=2)
        one = off.mean(axis=1).argmin()
        held.append(off[one] <= frame.radius[one])
    assert np.mean(held) > 0.85


def test_a_larger_deviation_loses_no_posture(random_frames):
    view = random_frames.take([0, 1, 2])
    narrow = recover(view, length_deviation=0.02, coverage=1.0)
    wide = recover(replace(view, deviation=4.0), length_deviation=0.02, coverage=1.0)
    for k in range(3):
        for joints in narrow[k].joints[narrow[k].probability > 0.02]:
            off = np.linalg.norm(wide[k].joints - joints, axis=2).max(axis=1)
            assert off.min() < 0.25


def test_without_a_neck_the_answer_is_relative(random_frames):
    recovery = recover(replace(random_frames, root=np.empty(0)), length_deviation=0.02)
    for frame, truth in zip(recovery, random_frames.truth, strict=True):
        assert frame.sure_of == "relative to the neck"
        assert frame.root["method"] == "solver"
        assert abs(frame.root["estimate"] - truth[0, 2]) < 4 * frame.root["deviation"]
        assert pa_mpjpe(frame.joints, truth).min() < 0.07


def test_hidden_joints_are_inferred_and_what_is_beyond_them_used(random_frames):
    image = random_frames.image[:2].copy()
    image[:, JOINT["left_elbow"]] = np.nan
    image[0, JOINT["right_ankle"]] = np.nan
    recovery = recover(replace(random_frames.take([0, 1]), image=image), length_deviation=0.02)
    for k, frame in enumerate(recovery):
        assert frame.inferred[:, JOINT["left_elbow"]].all()
        assert frame.inferred.sum(axis=1).tolist() == [2 - k] * len(frame)
        assert np.isfinite(frame.joints).all() and np.isfinite(frame.q).all()
        wrist = random_frames.camera.project(frame.joints)[:, JOINT["left_wrist"]]
        assert np.linalg.norm(wrist - image[k, JOINT["left_wrist"]], axis=1).max() < 12.0


@pytest.mark.parametrize(("sigma", "given"), [(0.0, True), (0.0, False), (2.0, True), (2.0, False)])
def test_a_neck_may_be_hidden(sigma, given):
    view = noisy(seed=5, sigma=sigma)
    image = view.image.copy()
    image[[1, 4], 0] = np.nan
    seen = replace(view, image=image, root=view.truth[:, 0] if given else np.empty(0))
    recovery = recover(seen, length_deviation=0.02 if sigma else None)
    for k in (1, 4):
        frame, truth = recovery[k], view.truth[k]
        assert frame.inferred[:, 0].all() and not frame.inferred[:, 1:].any() and np.isfinite(frame.q).all()
        assert frame.sure_of == ("position" if given else "relative to the neck")
        assert pa_mpjpe(frame.joints, truth).min() < (0.06 if sigma else 0.01)


def test_a_photograph_is_recovered_up_to_its_scale(random_frames):
    s = 180.0
    view = posekit.View(
        camera=ScaledOrthographicCamera(scale=None),
        time=random_frames.time,
        image=random_frames.truth[..., :2] * s,
    )
    recovery = recover(view, proportions="figure")
    table = recovery.survivors
    image = table.joints[..., :2] * table.scale[:, None, None]
    off = np.linalg.norm(image - view.image[table.frame], axis=2)
    assert np.median(off) < 0.05 * s
    for frame, truth in zip(recovery, random_frames.truth, strict=True):
        assert frame.sure_of == "relative to the neck"
        assert pa_mpjpe(frame.joints, truth).min() < 0.12
        assert (np.abs(np.log(frame.scale / s)) < 0.5).all()


def test_a_photograph_of_a_stranger_has_the_proportions_of_people(tmp_path):
    """A walker with the segment lengths of Winter 2009, seen from all around, 1 px off."""
    limbs = {"shoulder-elbow": 0.186, "elbow-wrist": 0.146, "hip-knee": 0.245, "knee-ankle": 0.246}
    lengths = {"neck-pelvis": 0.40, "right_shoulder-left_shoulder": 0.34, "right_hip-left_hip": 0.19}
    for side in ("right", "left"):
        lengths |= {f"neck-{side}_shoulder": 0.18, f"pelvis-{side}_hip": 0.13}
        for name, share in limbs.items():
            lengths["-".join(f"{side}_{joint}" for joint in name.split("-"))] = 1.75 * share
    person = FIGURE.scaled(lengths)
    samples(tmp_path)
    walk = posekit.open(tmp_path / "walk.npz")
    q = FIGURE.configurations(walk.figure_joints[::8]).q
    x, y, z = np.moveaxis(person.forward_kinematics(q)[:, :14] - q[:, None, :3], -1, 0)  # y is up
    turn = np.linspace(0, 2 * np.pi, len(q))[:, None]
    truth = np.stack([x * np.cos(turn) + z * np.sin(turn), -y, 4 - z * np.cos(turn) + x * np.sin(turn)], -1)
    image = truth[..., :2] / truth[..., 2:] * 900
    image += np.random.default_rng(1).normal(size=image.shape)
    camera = ScaledOrthographicCamera(scale=None)
    view = posekit.View(camera=camera, time=np.arange(len(q)) / 4, image=image, deviation=1.0)
    error = {
        proportions: np.nanmedian(pa_mpjpe(recover(view, proportions=proportions).answer.joints, truth))
        for proportions in ("auto", "people", "figure")
    }
    assert error["auto"] == error["people"] < 0.9 * error["figure"]


def test_lengths_between_key_points_are_those_of_the_literature(tmp_path):
    """de Leva 1996, table 4 (means of women and men); ANSUR II less 2.27 % of stature on either side; neck between."""
    samples(tmp_path)
    seen = recover(posekit.open(tmp_path / "photo.json"), stature=1.8).lengths
    shares = {"shoulder-elbow": 0.16018, "elbow-wrist": 0.15339, "hip-knee": 0.22745, "knee-ankle": 0.25285}
    for name, share in shares.items():
        start, end = name.split("-")
        for side in ("right", "left"):
            assert seen[f"{side}_{start}-{side}_{end}"] == pytest.approx(1.8 * share, rel=3e-4), name
    for name, share in {"shoulder": 0.1913, "hip": 0.1103}.items():
        assert seen[f"right_{name}-left_{name}"] == pytest.approx(1.8 * share, rel=3e-4), name
    half = seen["right_shoulder-left_shoulder"] / 2
    assert seen["neck-left_shoulder"] == pytest.approx(half, rel=1e-3)
    assert np.hypot(half, seen["neck-pelvis"]) == pytest.approx(seen["left_shoulder-pelvis"], rel=1e-3)


def test_key_points_of_the_walk_are_recovered_by_its_stature(tmp_path):
    samples(tmp_path)
    seen, walk = posekit.open(tmp_path / "keypoints"), posekit.open(tmp_path / "walk.npz")
    view = seen.view(posekit.open(tmp_path / "calibration.toml")["cam_01"], rate=10, stature=1.75)
    found = evaluate(recover(view), walk).summary()
    assert found["regions"] > 0.9
    assert found["error_mm"]["answer"]["pa"]["median"] < 70


def test_an_exact_photograph_has_an_exact_tree():
    truth = random_views(2, np.random.default_rng(9), figure=FIGURE).truth
    camera = ScaledOrthographicCamera(scale=200.0)
    view = posekit.View(camera=camera, time=[0.0, 1.0], image=truth[..., :2] * 200.0)
    for frame, joints in zip(recover(view), truth, strict=True):
        assert frame.judged == "exact"
        off = (frame.joints - frame.joints[:, :1]) - (joints - joints[:1])
        assert np.abs(off).max(axis=(1, 2)).min() < 1e-6


def test_flips_by_hand_are_kept(exact):
    view, every = exact
    recovery = recover(view, nearer={"right_shoulder-right_elbow": "right_elbow"})
    shoulder, elbow = JOINT["right_shoulder"], JOINT["right_elbow"]
    for frame, all_ in zip(recovery, every, strict=True):
        ahead = all_.joints[:, elbow, 2] <= all_.joints[:, shoulder, 2]
        assert len(frame) == ahead.sum()
    with pytest.raises(posekit.InputError, match="right_elbow"):
        recover(view, nearer={"right_shoulder-right_elbow": "left_knee"})


def test_an_empty_frame_says_why(random_frames):
    image = random_frames.image[:1].copy()
    image[0, JOINT["right_wrist"]] += 400.0
    frame = recover(replace(random_frames.take([0]), image=image), length_deviation=0.0)[0]
    assert not len(frame) and np.isnan(frame.answer).all() and frame.survivor == -1
    assert "right_wrist" in frame.reason and "deviations" in frame.reason


def test_unseen_people_and_roots_are_told(random_frames):
    image = random_frames.image[:3].copy()
    image[1], image[2, 1:4] = np.nan, np.nan
    recovery = recover(replace(random_frames.take([0, 1, 2]), image=image))
    assert [bool(reason) for reason in recovery.frames.reason] == [False, True, True]
    assert "no joint of the person" in recovery.frames.reason[1] and "pelvis" in recovery.frames.reason[2]
    with pytest.raises(posekit.InputError, match="ray"):
        recover(replace(random_frames, root=random_frames.root + np.array([1.0, 0, 0])))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"scale": "min"}, "scale"),
        ({"proportions": "taylor"}, "proportions"),
        ({"nearer": [{}, {}]}, "nearer"),
    ],
)
def test_settings_that_say_nothing_are_refused(exact, changes, message):
    with pytest.raises(posekit.InputError, match=message):
        recover(exact[0], **changes)


def test_likely_scale_is_near_the_true_one():
    truth = random_views(40, np.random.default_rng(2), figure=FIGURE).truth
    scale, deviation = likely_scale(truth[..., :2] * 150.0, FIGURE)
    z = np.log(scale / 150.0) / deviation
    assert np.abs(z).mean() < 1.3 and np.abs(np.log(scale / 150.0)).mean() < 0.1
    depth, _ = likely_scale(truth[..., :2] / truth[..., 2:], FIGURE)
    assert np.median(np.abs(1 / depth / truth[:, 0, 2] - 1)) < 0.1


def test_laying_keeps_lengths_and_moves_little():
    rng = np.random.default_rng(0)
    truth = random_views(5, rng, figure=FIGURE).truth
    blurred = truth + 0.03 * rng.normal(size=truth.shape)
    laid = lay(blurred, np.tile(LENGTHS, (5, 1)))
    start, end = np.array(SEGMENTS).T
    apart = np.linalg.norm(laid[:, start] - laid[:, end], axis=2)
    np.testing.assert_allclose(apart, np.tile(LENGTHS, (5, 1)), atol=1e-4)
    assert np.abs(laid - blurred).max() < 0.2
    np.testing.assert_allclose(lay(truth, np.tile(LENGTHS, (5, 1))), truth, atol=1e-6)
    # Segments whose mean has no direction are laid all the same.
    flat = np.zeros((1, 14, 3))
    laid = lay(flat, LENGTHS[None])[0]
    for k, (a, b) in enumerate(TREE_SEGMENTS):
        assert np.linalg.norm(laid[a] - laid[b]) == pytest.approx(LENGTHS[k], abs=1e-3)


def test_sure_is_the_probability_of_the_samples():
    truth = random_views(1, np.random.default_rng(0), figure=FIGURE).truth
    sigma = 0.03
    covariance = np.broadcast_to(sigma**2 * np.eye(42), (1, 42, 42))

    def answered(covariance, relative=False):
        frame, none = np.zeros(1, dtype=int), np.zeros(1)
        found = answers_of(truth, frame, np.ones(1), covariance, LENGTHS, np.array([relative]), none)
        return {name: values[0] for name, values in found.items()}

    from scipy.stats import chi, chi2, norm, t

    # A t distribution of 4 degrees of freedom is a normal one whose deviation varies with the root of 4 / chi2.
    deviation = (
        sigma * norm.ppf(0.975) / t(4).ppf(0.975) * np.sqrt(4 / chi2(4).ppf((np.arange(1000) + 0.5) / 1000))
    )
    answer = answered(covariance)
    assert answer["sure"] == pytest.approx(np.mean(chi(3).cdf(0.05 / deviation) ** 14), abs=0.1)
    assert answer["survivor"] == 0 and answer["representatives"].tolist() == [0]
    shared = np.tile(np.eye(3), (14, 14)) * 0.2**2 + 1e-6 * np.eye(42)
    assert answered(shared[None], relative=True)["sure"] == pytest.approx(1.0)
    assert answered(shared[None])["sure"] < 0.2


def test_radius_holds_95_percent():
    rng = np.random.default_rng(0)
    for shape in ([1, 1, 1], [1, 0.1, 0.1], [1, 1, 0.01]):
        A, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        covariance = A @ np.diag(np.square(shape)) @ A.T
        draws = rng.multivariate_normal(np.zeros(3), covariance, 20_000)
        inside = np.linalg.norm(draws, axis=1) <= joint_radius(covariance)
        assert inside.mean() == pytest.approx(0.95, abs=0.012)


@pytest.mark.parametrize("count", [1, 7, 60])
@pytest.mark.parametrize("spread", [0.006, 0.012, 0.06])
def test_representatives_cover_what_they_must(spread, count):
    rng = np.random.default_rng(1)
    shape = spread * rng.normal(size=(count, 14, 3))
    weight = np.sort(rng.exponential(size=count))[::-1]
    weight = weight / weight.sum()
    rows, held = representatives(shape, np.zeros(count, dtype=int), weight, np.array([0.9]))
    assert held.sum() >= 0.9 - 1e-9 and (np.diff(held) <= 0).all() and len(set(rows.tolist())) == len(rows)
    apart = np.linalg.norm(shape[rows][:, None] - shape, axis=3).max(axis=2)
    assert weight[apart.min(axis=0) <= 0.05].sum() == pytest.approx(held.sum())
    assert held[0] == pytest.approx(max(weight[near <= 0.05].sum() for near in apart))


def test_configurations_and_margins_are_found_when_they_are_read(exact):
    import pickle

    from posekit.settings import RecoverSettings
    from posekit.validators.judge import chosen_checks

    recovery = recover(exact[0])
    copy = pickle.loads(pickle.dumps(recovery))
    table = recovery.survivors
    np.testing.assert_array_equal(copy.survivors.q, table.q)
    np.testing.assert_array_equal(recovery[1].q, table.q[recovery.rows(1)])
    checks = chosen_checks(RecoverSettings(), of_robot=False, in_time=False)
    points = np.concatenate([table.joints, table.head], axis=1)
    found = judge_postures(points, checks, FIGURE, RecoverSettings(), tolerance=EXACT)
    assert list(table.margins) == list(found)
    for name, one in found.items():
        np.testing.assert_allclose(table.margins[name], np.nanmin(one.margin, axis=1), atol=1e-9)


def test_tables_are_read_only_and_become_motion_and_pandas(exact):
    recovery = exact[1]
    with pytest.raises(ValueError, match="read-only"):
        recovery.survivors.joints[0] = 0
    for which, count in (("answer", 5), ("first", 5), ("all", len(recovery.survivors))):
        motion = recovery.motion(which)
        assert len(motion) == count and motion.robot == "figure"
        np.testing.assert_allclose(FIGURE.points(motion.q), motion.figure_joints, atol=1e-7)
    table = recovery.to_pandas()
    assert len(table) == len(recovery.survivors)
    np.testing.assert_array_equal(table["left_wrist_z"], recovery.survivors.joints[:, JOINT["left_wrist"], 2])
    assert repr(recovery).startswith("Recovery(5 frames") and repr(recovery[-1]).startswith("Frame(frame 4")
    with pytest.raises(posekit.InputError, match="no followed path"):
        recovery.motion("path")
    with pytest.raises(posekit.InputError, match="shape"):
        Recovery(
            survivors=Survivors(frame=[0], joints=np.zeros((2, 14, 3)), q=np.zeros((1, 29))),
            frames=Frames(time=[0.0]),
            answer=Answer(joints=np.zeros((1, 14, 3)), sure=[1.0]),
        )


def test_groups_hold_what_is_near(exact):
    recovery = recover(exact[0].take([0]), group=0.2)
    frame = recovery[0]
    assert len(set(frame.group)) < len(frame)
    for group in set(frame.group.tolist()):
        leader = frame.joints[frame.group == group][0]
        assert np.linalg.norm(frame.joints[frame.group == group] - leader, axis=2).max() <= 0.2


def test_a_detectors_points_are_recovered():
    camera = PinholeCamera(K=np.array([[1000.0, 0, 640], [0, 1000, 360], [0, 0, 1]]), size=(1280, 720))
    truth = random_views(2, np.random.default_rng(4), figure=FIGURE).truth
    image = camera.project(truth) + np.random.default_rng(0).normal(size=(2, 14, 2))
    image[:, 0] = image[:, 1:3].mean(axis=1)
    view = posekit.View(camera=camera, time=[0.0, 1.0], image=image, derived=("neck", "pelvis"), stature=1.75)
    recovery = recover(view)
    assert recovery.lengths["right_hip-left_hip"] == pytest.approx(0.193, abs=0.002)
    assert all(len(frame) for frame in recovery)


def test_exact_survivors_are_the_limit_of_small_noise():
    view = random_views(3, np.random.default_rng(6), figure=FIGURE)
    view = replace(view, root=view.truth[:, 0], head_image=np.empty(0))
    exact = recover(view)
    near = recover(replace(view, deviation=0.05), length_deviation=0.0, coverage=1.0)
    for one, other in zip(exact, near, strict=True):
        assert one.judged == "exact" and other.judged == "noisy"
        off = np.linalg.norm(one.joints[:, None] - other.joints, axis=3).max(axis=2)
        # Near-tangent twins are one mode: they differ by centimetres. Noise also tolerates more than exact checks do.
        assert (off.min(axis=1) < 0.05).mean() > 0.95
