"""Checks of any object: loops that close, midpoints in the middle, and the ends that were said to be nearer."""

import numpy as np
import pytest

from posekit.cameras import ScaledOrthographicCamera
from posekit.errors import InputError
from posekit.linkages import Linkage, LinkageFamily, SpanningTree, load_linkage, name_nearer, span
from posekit.tree import Check
from posekit.validators.linkage import closure, nearer

CAMERA = ScaledOrthographicCamera(scale=80.0)
HUMAN = load_linkage("taylor_human")


def polygon(points: np.ndarray) -> SpanningTree:
    n = len(points)
    return span(
        Linkage.from_names(
            name="polygon",
            segments={
                (f"p{k}", f"p{(k + 1) % n}"): float(np.linalg.norm(points[k] - points[(k + 1) % n]))
                for k in range(n)
            },
        )
    )


def triangle(tolerance: float) -> Check:
    points = np.array([[0.0, 0, 0], [3, 0, 0], [0, 4, 0]])
    (check,) = closure(polygon(points), tolerance=tolerance)
    return check


def hinge_nearer(choices: dict[str, str], nothing: float = 1e-7) -> list[Check]:
    return nearer(choices, joints=("a", "b", "c"), segments=("a-b", "b-c"), nothing=nothing)


# --- loops ------------------------------------------------------------------------------------------------


def test_a_chain_needs_no_check() -> None:
    assert closure(span(load_linkage("planar_chain"))) == []


def test_each_loop_has_one_chord() -> None:
    check = triangle(0.1)
    assert (check.name, check.where, check.unit) == ("closure", ("p1-p2",), "m")


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize(("off", "passes"), [(0.0999, True), (0.1001, False)])
def test_a_chord_just_passes_and_just_fails(sign: int, off: float, passes: bool) -> None:
    found = triangle(0.1).judge(np.array([[[0.0, 0, 0], [5.0 + sign * off, 0, 0]]]))
    assert found.violated.all() == (not passes)
    np.testing.assert_allclose(found.margin, -off, rtol=0, atol=1e-12)


def test_a_chord_with_an_unknown_end_is_undecided() -> None:
    found = triangle(0.1).judge(np.array([[[0.0, 0, 0], [np.nan, 0, 0]]]))
    assert found.undecided.all()
    assert not found.violated.any()


@pytest.mark.parametrize("n", [3, 4, 6, 9])
def test_what_survives_is_closed_and_the_truth_survives(rng: np.random.Generator, n: int) -> None:
    points = rng.normal(size=(5, n, 3))
    for posture in points:
        spanned = polygon(posture)
        leaves = spanned.grow(CAMERA, CAMERA.project(posture)[None], closure(spanned, tolerance=1e-9))
        kept = spanned.points(leaves.postures())
        ends = np.array(spanned.linkage.segments)
        lengths = np.linalg.norm(kept[:, ends[:, 1]] - kept[:, ends[:, 0]], axis=-1)
        np.testing.assert_allclose(
            lengths, np.broadcast_to(spanned.linkage.lengths, lengths.shape), rtol=0, atol=2e-9
        )
        true = posture - [0, 0, posture[0, 2]]
        assert np.abs(kept - true).max(axis=(1, 2)).min() < 1e-9
        assert np.abs(kept * [1, 1, -1] - true).max(axis=(1, 2)).min() < 1e-9  # and its mirror image


def test_a_looser_tolerance_never_rejects_more(rng: np.random.Generator) -> None:
    posture = rng.normal(size=(6, 3))
    spanned = polygon(posture)
    counts = []
    for tolerance in (1e-9, 0.01, 0.1, 1.0, 100.0):
        checks = closure(spanned, tolerance=tolerance)
        counts.append(len(spanned.grow(CAMERA, CAMERA.project(posture)[None], checks).code))
    assert counts == sorted(counts)
    assert counts[0] >= 2
    assert counts[-1] == 2**5


# --- midpoints --------------------------------------------------------------------------------------------


def test_the_two_halves_of_a_girdle_are_one_line() -> None:
    checks = closure(span(HUMAN))
    assert [(check.name, check.where) for check in checks] == [
        ("midpoint", ("mid_shoulders",)),
        ("midpoint", ("mid_hips",)),
    ]
    middle, a, b = np.zeros(3), np.array([0.0, 1, 2]), np.array([0.0, -1, -2])
    found = checks[0].judge(np.array([[middle, a, b], [middle, a, -b], [np.array([0, 0, 1e-3]), a, b]]))
    assert found.violated[:, 0].tolist() == [False, True, True]
    np.testing.assert_allclose(found.value[:, 0], [0.0, np.sqrt(5), 1e-3], rtol=0, atol=1e-15)


def test_an_unknown_end_leaves_a_midpoint_undecided() -> None:
    found = closure(span(HUMAN))[0].judge(np.full((1, 3, 3), np.nan))
    assert found.undecided.all()
    assert not found.violated.any()


def test_a_girdle_seen_full_length_counts_once() -> None:
    # At the bound that the shoulders set they are level: half of the flips are left.
    points = np.zeros((12, 3))
    points[:4] = [[-9, 0, 0], [9, 0, 0], [-6, 20, 3], [6, 20, 3 + np.sqrt(14**2 - 12**2)]]
    points[2:4, 2] += np.sqrt(24**2 - 20**2) - points[2:4, 2].mean()
    for (a, b), length in zip(HUMAN.segments[3:], HUMAN.lengths[3:], strict=True):
        points[b] = points[a] + np.array([0.0, 0.6, 0.8]) * length
    camera = ScaledOrthographicCamera(scale=10.0)
    family = LinkageFamily(linkage=HUMAN, image=camera.project(points))
    assert family.bounding_segment == "right_shoulder-left_shoulder"
    spanned = span(HUMAN)
    leaves = spanned.grow(camera, family.image[None], closure(spanned))
    assert len(leaves.code) == 1024


# --- nearer ends ------------------------------------------------------------------------------------------


def test_every_check_of_a_linkage_says_its_name_and_unit() -> None:
    girdle = closure(span(HUMAN))
    assert {(check.name, check.unit) for check in girdle} == {("midpoint", "m")}
    (one,) = hinge_nearer({"b-a": "b"})
    assert (one.name, one.unit, one.where, one.points) == ("nearer", "m", ("b-a",), (1, 0))
    found = one.judge(np.array([[[0.0, 0, 1.0], [0, 0, 3.0]], [[0.0, 0, 3.0], [0, 0, 1.0]]]))
    np.testing.assert_allclose(found.value, [[2.0], [-2.0]])
    assert found.violated.tolist() == [[False], [True]] and np.isinf(found.upper).all()


@pytest.mark.parametrize(("depth", "passes"), [(0.001, True), (-0.001, False)])
def test_the_end_that_was_said_to_be_nearer_is(depth: float, passes: bool) -> None:
    for choices in ({"a-b": "a"}, {"b-a": "a"}):
        (check,) = hinge_nearer(choices)
        points = np.array([[[0.0, 0, 5], [1, 0, 5], [0, 0, 0]]])
        points[0, 1, 2] += depth
        found = check.judge(points[:, check.points])
        assert found.violated.all() == (not passes)
        np.testing.assert_allclose(found.value, depth, rtol=0, atol=1e-12)


@pytest.mark.parametrize("depth", [0.0, 9e-8, -9e-8, np.nan])
def test_where_neither_end_is_nearer_nothing_is_decided(depth: float) -> None:
    (check,) = hinge_nearer({"b-c": "c"})
    found = check.judge(np.array([[[0.0, 0, depth], [1, 0, 0]]]))
    assert found.undecided.all()
    assert not found.violated.any()


def test_what_counts_as_nothing_can_be_said() -> None:
    (check,) = hinge_nearer({"a-b": "a"}, nothing=0.1)
    found = check.judge(np.array([[[0.0, 0, 0.09], [1, 0, 0]], [[0.0, 0, 0.11], [1, 0, 0]]]))
    assert found.violated[:, 0].tolist() == [False, True]


@pytest.mark.parametrize(
    ("choices", "message"),
    [
        ({"a-b": "c"}, 'nearer a-b: "c" is not one of its ends; expected a or b'),
        ({"a-c": "a"}, 'nearer "a-c": there is no such segment; did you mean'),
        ({"ab": "a"}, 'nearer "ab": there is no such segment'),
    ],
)
def test_choices_of_unknown_segments_and_ends_are_refused(choices: dict[str, str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        hinge_nearer(choices)


def test_a_segment_whose_end_is_not_in_the_tree_is_refused() -> None:
    with pytest.raises(InputError, match='"c" is no joint of the tree'):
        nearer({"b-c": "b"}, joints=("a", "b"), segments=("a-b", "b-c"))


def test_all_flips_given_by_hand_leave_the_true_posture_alone(rng: np.random.Generator) -> None:
    for n in (3, 5, 8):
        posture = rng.normal(size=(n, 3))
        spanned = polygon(posture)
        flips = LinkageFamily(linkage=spanned.linkage, image=CAMERA.project(posture)).flips_of(posture)
        checks = nearer(
            name_nearer(spanned.linkage, flips),
            joints=spanned.tree.joints,
            segments=spanned.linkage.segment_names,
        )
        leaves = spanned.grow(CAMERA, CAMERA.project(posture)[None], checks)
        assert len(leaves.code) == 1
        kept = spanned.points(leaves.postures())[0]
        np.testing.assert_allclose(kept, posture - [0, 0, posture[0, 2]], rtol=0, atol=1e-9)
