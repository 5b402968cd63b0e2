"""Taylor's human on posekit's figure: completion, the 2048 flips by brute force, and the protocol's laws."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posekit.body import Figure, load_figure
from posekit.errors import FigureError, InputError
from posekit.linkages import Linkage, load_linkage
from posekit.papers.taylor_protocol import MARKED_ANGLES, MARKED_JOINTS, accuracy, accuracy_lines
from posekit.papers.taylor_study import synthetic_study
from posekit.papers.taylor_survival import survival, survival_lines
from posekit.papers.taylor_views import exact_views, photographs
from posekit.recovery.taylor_figure.completion import COMPLETED_FROM, Completion, joint_checks, taylor_checks
from posekit.recovery.taylor_figure.human import N_FLIPS, Human, taylor_human
from posekit.recovery.taylor_figure.proportions import TABLE_1, figure_of
from posekit.settings import MEASURED_TOLERANCE, PHOTOGRAPH_TOLERANCE
from posekit.skeleton import HIPS, JOINT, JOINTS, SEGMENTS, TORSO, segment_name
from posekit.synthesis import CameraSphere, random_views
from posekit.validators import PHYSICAL_CHECKS, judge, load_ranges

HUMAN = taylor_human()
PERSON = load_figure().from_stature(1.75)
URDF = load_ranges("urdf")
SCENE = random_views(PERSON, 12, np.random.default_rng(3), CameraSphere(distance=(3, 6)))
EXACT_VIEWS = exact_views(HUMAN, [SCENE])
SEEN = EXACT_VIEWS[0]
LOOSE = replace(MEASURED_TOLERANCE, rigid=0.06, angle=10.0)


def tree_points(joints: np.ndarray) -> np.ndarray:
    """Put joints (N, 14, 3) in the order of the tree's points, middles added."""
    at = {name: joints[:, k] for k, name in enumerate(JOINTS)}
    for middle, part in (("mid_shoulders", "shoulder"), ("mid_hips", "hip")):
        at[middle] = (at[f"right_{part}"] + at[f"left_{part}"]) / 2
    return np.stack([at[name] for name in HUMAN.points], axis=1)


def straight(figure: Figure, seed: int, n: int = 5) -> np.ndarray:
    """Draw joints (n, 14, 3) of a figure whose spine is straight and square to its hips; limbs anywhere."""
    rng = np.random.default_rng(seed)
    joints = rng.normal(size=(n, 14, 3))
    neutral = figure.neutral_points
    torso = neutral[[JOINT[name] for name in TORSO]]
    hips = neutral[[JOINT[name] for name in HIPS]] - neutral[JOINT["pelvis"]]
    spine = torso[3] - (torso[1] + torso[2]) / 2
    # The hips turn about the line from right to left until their middle goes on along the spine.
    turn, _ = Rotation.align_vectors(
        [spine / np.linalg.norm(spine), [0, 1, 0]], [[0, 0, -1], [0, 1, 0]], weights=[1, 1]
    )
    hips = turn.apply(hips) + torso[3]
    for k, name in enumerate(TORSO):
        joints[:, JOINT[name]] = torso[k]
    for k, name in enumerate(HIPS[1:], 1):
        joints[:, JOINT[name]] = hips[k]
    R = Rotation.random(n, random_state=rng).as_matrix()
    return np.asarray(np.einsum("nij,npj->npi", R, joints) + rng.normal(size=(n, 1, 3)))


# --- the twelve points and the two that are missing -----------------------------------------------------


@pytest.mark.parametrize("figure", [load_figure(), PERSON, figure_of(1.7)])
def test_a_straight_body_is_completed_exactly(figure):
    joints = straight(figure, 0)
    completion = Completion(figure=figure, points=HUMAN.points)
    np.testing.assert_allclose(completion.complete(tree_points(joints)), joints, rtol=0, atol=1e-12)
    spine = tree_points(joints)[:, [HUMAN.points.index(name) for name in ("mid_shoulders", "mid_hips")]]
    np.testing.assert_allclose(
        np.linalg.norm(spine[:, 0] - spine[:, 1], axis=-1), completion.spine, rtol=1e-12
    )


@given(st.integers(0, 10**6))
@settings(max_examples=20)
def test_completion_moves_with_the_body_and_knows_front_from_back(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(4, len(HUMAN.points), 3))
    completion = Completion(figure=PERSON, points=HUMAN.points)
    joints = completion.complete(points)
    R, t = Rotation.random(random_state=rng).as_matrix(), rng.normal(size=3)
    np.testing.assert_allclose(completion.complete(points @ R.T + t), joints @ R.T + t, rtol=0, atol=1e-9)
    # A torso is never completed to its mirror image: the neck stays behind the shoulders.
    mirrored = completion.complete(points * [1, 1, -1])
    apart = np.linalg.norm(mirrored - joints * [1, 1, -1], axis=-1)
    np.testing.assert_allclose(apart[:, 1:], 0, atol=1e-12)
    assert (apart[:, 0] > 0.01).all()


def test_what_the_tree_has_is_left_as_it_is():
    points = np.random.default_rng(0).normal(size=(3, len(HUMAN.points), 3))
    joints = Completion(figure=PERSON, points=HUMAN.points).complete(points)
    for name in JOINTS:
        if name not in COMPLETED_FROM:
            np.testing.assert_array_equal(joints[:, JOINT[name]], points[:, HUMAN.points.index(name)])


def test_the_checks_ask_about_the_completed_joints():
    points = tree_points(SCENE.joints_cam)
    completed = Completion(figure=PERSON, points=HUMAN.points).complete(points)
    plain = joint_checks(PERSON, ranges=URDF)
    asked = taylor_checks(PERSON, HUMAN.points, ranges=URDF)
    assert len(plain) == len(asked) > 30
    for own, adapted in zip(plain, asked, strict=True):
        assert (own.name, own.where, own.unit) == (adapted.name, adapted.where, adapted.unit)
        theirs = adapted.judge(points[:, list(adapted.points)])
        ours = own.judge(completed[:, list(own.points)])
        np.testing.assert_array_equal(theirs.value, ours.value)
        np.testing.assert_array_equal(theirs.violated, ours.violated)
    names = {check.name for check in asked}
    assert names == {"rigid_parts", "joint_range", "collision"}
    rigid = {check.where[0] for check in asked if check.name == "rigid_parts"}
    trunk = {JOINT[name] for name in (*TORSO, *HIPS)}
    assert rigid == {segment_name(segment) for segment in SEGMENTS if set(segment) <= trunk}


@pytest.mark.parametrize("stature", [1.2, 1.75, 2.1])
def test_the_figure_of_table_1_has_its_proportions(stature):
    figure, unit = figure_of(stature), stature / TABLE_1["height"]
    lengths = dict(zip(HUMAN.linkage.segment_names, HUMAN.lengths_of(figure), strict=True))
    np.testing.assert_allclose(HUMAN.lengths_of(figure), HUMAN.linkage.lengths * unit, rtol=1e-12)
    assert lengths["mid_shoulders-mid_hips"] == pytest.approx(TABLE_1["spine"] * unit)
    for side in ("right", "left"):
        assert figure.lengths[f"{side}_elbow-{side}_wrist"] == pytest.approx(TABLE_1["forearm"] * unit)
        assert figure.lengths[f"{side}_knee-{side}_ankle"] == pytest.approx(TABLE_1["foreleg"] * unit)
    other = figure_of(2 * stature / 3).lengths
    for name, length in figure.lengths.items():
        assert other[name] == pytest.approx(2 * length / 3, rel=1e-9)


# --- the flips ------------------------------------------------------------------------------------------


def brute_force(k: int) -> tuple[np.ndarray, list[tuple[bool, ...]]]:
    """Place all 2048 flips of one picture by adding up depths, and say which end of each segment is nearer."""
    xy = SEEN.image[k] / SEEN.scale[k]
    place = {name: xy[i] - xy.mean(axis=0) for i, name in enumerate(HUMAN.linkage.points)}
    place["mid_shoulders"] = (place["right_shoulder"] + place["left_shoulder"]) / 2
    place["mid_hips"] = (place["right_hip"] + place["left_hip"]) / 2
    depth = {}
    for name, length in zip(HUMAN.linkage.segment_names, SEEN.lengths[k], strict=True):
        a, b = name.split("-")
        depth[a, b] = np.sqrt(length**2 - ((place[a] - place[b]) ** 2).sum())
    bodies, flips = [], []
    for signs in product((1, -1), repeat=11):
        dz = {ends: sign * size for sign, (ends, size) in zip(signs, depth.items(), strict=True)}
        z = {"right_shoulder": 0.0, "left_shoulder": dz["right_shoulder", "left_shoulder"]}
        z["mid_shoulders"] = z["left_shoulder"] / 2
        z["mid_hips"] = z["mid_shoulders"] + dz["mid_shoulders", "mid_hips"]
        z["right_hip"] = z["mid_hips"] - dz["right_hip", "left_hip"] / 2
        z["left_hip"] = z["mid_hips"] + dz["right_hip", "left_hip"] / 2
        for side in ("right", "left"):
            for limb in (("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle")):
                a, b, c = (f"{side}_{joint}" for joint in limb)
                z[b] = z[a] + dz[a, b]
                z[c] = z[b] + dz[b, c]
        bodies.append([[*place[name], z[name]] for name in HUMAN.points])
        flips.append(tuple(sign > 0 for sign in signs))
    return np.array(bodies), flips


def complete_by_hand(points: np.ndarray) -> np.ndarray:
    """Complete neck and pelvis by sums and cross products written out."""
    neutral = {name: PERSON.neutral_points[JOINT[name]] for name in JOINTS}
    middle = (neutral["right_shoulder"] + neutral["left_shoulder"]) / 2
    below = (neutral["right_hip"] + neutral["left_hip"]) / 2
    upper, lower = (np.linalg.norm(neutral["pelvis"] - end) for end in (middle, below))
    at = {name: points[:, k] for k, name in enumerate(HUMAN.points)}
    at["pelvis"] = at["mid_shoulders"] + upper / (upper + lower) * (at["mid_hips"] - at["mid_shoulders"])

    def frame(right: np.ndarray, left: np.ndarray, middle: np.ndarray, pelvis: np.ndarray) -> np.ndarray:
        y = (left - right) / np.linalg.norm(left - right, axis=-1, keepdims=True)
        z = middle - pelvis
        z = z - (z * y).sum(axis=-1, keepdims=True) * y
        z = z / np.linalg.norm(z, axis=-1, keepdims=True)
        return np.stack([np.cross(y, z), y, z], axis=-1)

    own = frame(neutral["right_shoulder"], neutral["left_shoulder"], middle, neutral["pelvis"])
    neck = own.T @ (neutral["neck"] - middle)
    posed = frame(at["right_shoulder"], at["left_shoulder"], at["mid_shoulders"], at["pelvis"])
    at["neck"] = at["mid_shoulders"] + posed @ neck
    return np.stack([at[name] for name in JOINTS], axis=1)


def flips_of(points: np.ndarray) -> list[tuple[bool, ...]]:
    """Say of postures in the tree's order which segments go away from the camera."""
    start, end = (
        [HUMAN.points.index(HUMAN.linkage.nodes[segment[k]]) for segment in HUMAN.linkage.segments]
        for k in (0, 1)
    )
    return [tuple(row) for row in (points[:, end, 2] > points[:, start, 2]).tolist()]


@pytest.mark.parametrize("k", range(4))
def test_there_are_2048_flips_and_they_are_those_of_brute_force(k):
    leaves = HUMAN.grow(SEEN.image[k : k + 1], SEEN.lengths[k : k + 1], SEEN.scale[k : k + 1])
    points = leaves.postures()
    bodies, flips = brute_force(k)
    assert len(points) == N_FLIPS == 2048
    assert len(set(flips_of(points))) == N_FLIPS
    order = {flip: row for row, flip in enumerate(flips)}
    same = bodies[[order[flip] for flip in flips_of(points)]]
    np.testing.assert_allclose(points, same, rtol=0, atol=1e-9)


@pytest.mark.parametrize("names", [("rigid-parts",), ("joint-range",), ("collision",), PHYSICAL_CHECKS])
def test_survivors_are_those_of_brute_force(names: Sequence[str]):
    left = 0
    for k in range(4):
        bodies, flips = brute_force(k)
        bad = np.zeros(N_FLIPS, dtype=bool)
        for judgement in judge(
            joint_checks(PERSON, names, ranges=URDF, tolerance=LOOSE), complete_by_hand(bodies)
        ):
            bad |= judgement.violated.any(axis=1)
        checks = taylor_checks(PERSON, HUMAN.points, names, ranges=URDF, tolerance=LOOSE)
        leaves = HUMAN.grow(SEEN.image[k : k + 1], SEEN.lengths[k : k + 1], SEEN.scale[k : k + 1], checks)
        expected = {flip for flip, wrong in zip(flips, bad, strict=True) if not wrong}
        assert set(flips_of(leaves.postures())) == expected
        assert len(leaves.code) == len(expected)
        left += len(expected)
    assert 0 < left < 4 * N_FLIPS


def test_counts_are_those_of_the_trees_one_by_one():
    rows = {row.checks: row for row in survival(HUMAN, EXACT_VIEWS, tolerance=LOOSE, ranges=("urdf",))}
    names = {
        "none": (),
        "rigid parts": ("rigid-parts",),
        "joint range, urdf": ("joint-range",),
        "collision": ("collision",),
        "all, urdf": PHYSICAL_CHECKS,
    }
    assert set(rows) == set(names)
    for label, checks in names.items():
        suite = taylor_checks(PERSON, HUMAN.points, checks, ranges=URDF, tolerance=LOOSE)
        for k in range(len(SEEN)):
            leaves = HUMAN.grow(SEEN.image[k : k + 1], SEEN.lengths[k : k + 1], SEEN.scale[k : k + 1], suite)
            assert rows[label].count[k] == len(leaves.code)
            true = HUMAN.code(leaves, SEEN.truth[k : k + 1])
            assert rows[label].truth[k] == np.isin(true, leaves.code)[0]
    assert (rows["none"].count == N_FLIPS).all()
    assert rows["none"].truth.all()
    assert rows["none"].pair.all()


def test_the_true_flips_give_the_truth_and_the_others_its_mirror_image():
    leaves = HUMAN.grow(SEEN.image, SEEN.lengths, SEEN.scale)
    for mirrored in (False, True):
        code = HUMAN.code(leaves, SEEN.truth, mirrored=mirrored)
        found = HUMAN.twelve(leaves.postures()[leaves.code == code[leaves.frame]])
        assert len(found) == len(SEEN)
        truth = SEEN.truth * ([1, 1, -1] if mirrored else 1)
        np.testing.assert_allclose(
            found - found.mean(axis=1, keepdims=True),
            truth - truth.mean(axis=1, keepdims=True),
            rtol=0,
            atol=1e-7,
        )


def test_distances_cannot_tell_a_posture_from_its_mirror_image():
    rows = {row.checks: row for row in survival(HUMAN, EXACT_VIEWS, tolerance=LOOSE, ranges=("urdf",))}
    np.testing.assert_array_equal(rows["rigid parts"].truth, rows["rigid parts"].mirror)
    assert (rows["rigid parts"].count % 2 == 0).all()
    # Knees bend one way: that is what does.
    assert rows["joint range, urdf"].pair.mean() < 0.5


def test_a_looser_tolerance_never_rejects_more():
    tight, loose = (
        survival(HUMAN, EXACT_VIEWS, tolerance=t, ranges=("urdf",))
        for t in (MEASURED_TOLERANCE, PHOTOGRAPH_TOLERANCE)
    )
    for few, many in zip(tight, loose, strict=True):
        assert (few.count <= many.count).all()
        assert (few.truth <= many.truth).all()


def test_frames_with_lengths_of_their_own_are_each_lifted_with_theirs():
    rng = np.random.default_rng(0)
    lengths = SEEN.lengths * rng.uniform(1.0, 1.3, SEEN.lengths.shape)
    together = HUMAN.grow(SEEN.image, lengths, SEEN.scale)
    offsets = together.offsets()
    for k in range(3):
        alone = HUMAN.grow(SEEN.image[k : k + 1], lengths[k], SEEN.scale[k : k + 1])
        part = slice(offsets[k], offsets[k + 1])
        np.testing.assert_array_equal(alone.code, together.code[part])
        np.testing.assert_allclose(alone.postures(), together.postures()[part], rtol=0, atol=1e-12)
        nodes = HUMAN.measure(HUMAN.twelve(alone.postures()))
        np.testing.assert_allclose(nodes, np.tile(lengths[k], (len(nodes), 1)), rtol=1e-9)


# --- photographs and the protocol -----------------------------------------------------------------------


def test_the_bound_leaves_one_segment_flat_and_less_is_said_to_be_short():
    for proportions in ("figure", "taylor"):
        (least,) = photographs(
            HUMAN, [SCENE], noise=2, rng=np.random.default_rng(0), proportions=proportions, scale="min"
        )
        (told,) = photographs(HUMAN, [SCENE], noise=2, rng=np.random.default_rng(0), proportions=proportions)
        (flat,) = photographs(
            HUMAN, [SCENE], noise=2, rng=np.random.default_rng(0), proportions=proportions, scale="flat"
        )
        np.testing.assert_allclose(least.scale, HUMAN.bound(least.image, least.lengths), rtol=1e-12)
        np.testing.assert_allclose(told.scale, np.maximum(flat.scale, least.scale), rtol=1e-12)
        np.testing.assert_array_equal(told.short, flat.scale < least.scale)
        assert not least.short.any()
        leaves = HUMAN.grow(least.image, least.lengths, least.scale)
        np.testing.assert_array_equal(np.bincount(leaves.frame), N_FLIPS // 2)
        short = HUMAN.grow(flat.image, flat.lengths, flat.scale)
        assert (np.bincount(short.frame)[flat.short] < N_FLIPS).all()


def test_from_far_away_the_protocol_finds_the_truth():
    """A perspective camera a kilometre away is a scaled orthographic one: what is left is the pixel's own size."""
    far = CameraSphere(distance=(1000, 2000), f=1500 * 300)
    scene = random_views(figure_of(1.75), 20, np.random.default_rng(0), far)
    seen = photographs(HUMAN, [scene], noise=0, rng=np.random.default_rng(0), scale="stature")
    by_hand = accuracy(HUMAN, seen, tolerance=PHOTOGRAPH_TOLERANCE)[0]
    near = photographs(
        HUMAN,
        [random_views(figure_of(1.75), 20, np.random.default_rng(0), CameraSphere(distance=(3, 6)))],
        noise=0,
        rng=np.random.default_rng(0),
    )
    assert np.median(by_hand.rms) < 0.002
    assert (
        np.median(by_hand.rms) < np.median(accuracy(HUMAN, near, tolerance=PHOTOGRAPH_TOLERANCE)[0].rms) / 5
    )


def test_exact_pictures_and_true_flips_leave_no_error():
    by_hand, best, margin, average = accuracy(HUMAN, EXACT_VIEWS, tolerance=LOOSE)
    np.testing.assert_allclose(by_hand.rms, 0, atol=1e-7)
    np.testing.assert_allclose(by_hand.angles, 0, atol=1e-4)
    assert (by_hand.n == 1).all()
    assert (by_hand.right == 1).all()
    chosen = best.chosen
    assert 0 < chosen.sum()
    assert np.isnan(best.rms[~chosen]).all()
    assert np.isfinite(best.rms[chosen]).all()
    assert (best.rms[chosen] <= margin.rms[chosen]).all()
    assert (best.rms[chosen] <= average.rms[chosen] + 1e-12).all()
    np.testing.assert_array_equal(best.n, margin.n)
    everything = survival(HUMAN, EXACT_VIEWS, tolerance=LOOSE, ranges=("urdf",))[-1]
    np.testing.assert_array_equal(best.n, everything.count)
    # Wherever the truth survived, nothing is nearer to it.
    np.testing.assert_allclose(best.rms[everything.truth], 0, atol=1e-7)
    np.testing.assert_allclose(average.right[chosen], everything.truth[chosen] / everything.count[chosen])


def test_the_six_points_are_a_chain_with_four_angles():
    assert len(MARKED_JOINTS) == 6
    assert [MARKED_JOINTS[b] for _, b, _ in MARKED_ANGLES] == [
        "right_elbow",
        "right_shoulder",
        "left_shoulder",
        "left_elbow",
    ]


def test_the_synthetic_study_is_the_same_every_time_and_its_tables_are_rectangular():
    study = synthetic_study(3, seed=1)
    lines = study.lines()
    assert lines == synthetic_study(3, seed=1).lines()
    assert "3.76" in "\n".join(lines)
    tables: list[list[str]] = [[]]
    for line in lines:
        if line.startswith("|"):
            tables[-1].append(line)
        elif tables[-1]:
            tables.append([])
    full = [table for table in tables if table]
    assert len(full) == 1 + 2 * 6
    for table in full:
        assert len({len(row) for row in table}) == 1
    assert (study.exact[0].count == N_FLIPS).all()


def test_tables_of_nothing_chosen_say_so():
    rigid = replace(MEASURED_TOLERANCE, rigid=0.0, angle=0.0)
    rows = accuracy(HUMAN, EXACT_VIEWS, tolerance=rigid)
    assert not rows[1].chosen.any()
    assert rows[1].row()[1:] == ["-", "0.0%", "100.0%", "-", "-", "-", "-"]
    assert len(accuracy_lines(rows)) == 2 + 1 + 4 + 1
    assert "100.0%" in survival_lines(survival(HUMAN, EXACT_VIEWS, tolerance=rigid))[-2]


# --- bad input ------------------------------------------------------------------------------------------


def test_checks_that_need_a_head_or_are_none_are_refused():
    with pytest.raises(InputError, match="walking needs a head"):
        taylor_checks(PERSON, HUMAN.points, ("rigid-parts", "walking"), ranges=URDF)
    with pytest.raises(InputError, match="not a check"):
        taylor_checks(PERSON, HUMAN.points, ("rigid",), ranges=URDF)


def test_another_object_is_refused():
    with pytest.raises(InputError, match="no left_ankle, mid_hips") as refused:
        Completion(
            figure=PERSON, points=tuple(n for n in HUMAN.points if n not in ("left_ankle", "mid_hips"))
        )
    assert "\n" not in str(refused.value)
    chain = Linkage.from_names(name="chain", segments={("a", "b"): 1.0, ("b", "c"): 1.0})
    with pytest.raises(InputError, match="linkage chain: not Taylor's human"):
        Human(linkage=chain)
    assert Human(linkage=load_linkage("taylor_human")).points == HUMAN.points


@pytest.mark.parametrize("stature", [np.nan, 0.0, 175.0, -1.0])
def test_statures_of_nobody_are_refused(stature):
    with pytest.raises(FigureError, match="stature is"):
        figure_of(stature)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"noise": -1.0}, "noise is -1"),
        ({"noise": np.nan}, "noise is nan"),
        ({"noise": 0.0, "proportions": "mine"}, "expected figure or taylor"),
        ({"noise": 0.0, "scale": "max"}, "expected stature, flat or min"),
    ],
)
def test_impossible_photographs_are_refused(options, said):
    with pytest.raises(InputError, match=said):
        photographs(HUMAN, [SCENE], rng=np.random.default_rng(0), **options)
