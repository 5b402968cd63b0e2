"""The family behind one image: the bound of the scale, foreshortenings, and postures recovered exactly."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.cameras import ScaledOrthographicCamera
from posekit.errors import CameraError, InputError
from posekit.linkages import Linkage, LinkageFamily, load_linkage, name_nearer, read_nearer, span
from posekit.validators.linkage import closure

HUMAN = load_linkage("taylor_human")


def joined(points: np.ndarray, edges: list[tuple[int, int]]) -> Linkage:
    """Make the linkage of some points (P, 3) with segments between them, as long as they are."""
    return Linkage.from_names(
        name="random",
        points=[f"p{k}" for k in range(len(points))],
        segments={(f"p{a}", f"p{b}"): float(np.linalg.norm(points[a] - points[b])) for a, b in edges},
    )


def random_object(rng: np.random.Generator, kind: str) -> tuple[Linkage, np.ndarray]:
    """Draw a chain, a tree or a loop of up to 20 segments and its points (P, 3)."""
    n = int(rng.integers(3, 21))
    points = rng.normal(size=(n if kind == "loop" else n + 1, 3)) * rng.uniform(0.01, 100)
    if kind == "chain":
        return joined(points, [(k, k + 1) for k in range(n)]), points
    if kind == "tree":
        return joined(points, [(int(rng.integers(k)), k) for k in range(1, n + 1)]), points
    return joined(points, [(k, (k + 1) % n) for k in range(n)]), points


def random_human(rng: np.random.Generator) -> np.ndarray:
    """Draw a posture of Taylor's human (12, 3) with every segment in a random direction."""

    def segment(length: float) -> np.ndarray:
        direction = rng.normal(size=3)
        return np.asarray(direction / np.linalg.norm(direction) * length)

    points = np.zeros((12, 3))
    shoulders, spine, hips = segment(18), segment(24), segment(14)
    points[:4] = -shoulders / 2, shoulders / 2, spine - hips / 2, spine + hips / 2
    for (a, b), length in zip(HUMAN.segments[3:], HUMAN.lengths[3:], strict=True):
        points[b] = points[a] + segment(float(length))
    return points


def look(linkage: Linkage, points: np.ndarray, s: float, aspect: float = 1.0) -> LinkageFamily:
    camera = ScaledOrthographicCamera(scale=s, aspect=aspect)
    return LinkageFamily(linkage=linkage, image=camera.project(points), aspect=aspect)


def hinge(**more: float) -> LinkageFamily:
    """Two segments of length 5 and 2, seen 30 and 16 pixels long: they need s of 6 and 8."""
    linkage = Linkage.from_names(
        name="hinge",
        segments={("a", "b"): 5.0, ("b", "c"): 2.0},
        height=more.get("height"),
    )
    return LinkageFamily(linkage=linkage, image=np.array([[0.0, 0.0], [30.0, 0.0], [30.0, 16.0]]))


def test_the_bound_is_the_largest_of_the_segments_and_named() -> None:
    family = hinge()
    np.testing.assert_array_equal(family.bounds, [6.0, 8.0])
    assert family.minimum_scale == 8.0
    assert family.bounding_segment == "b-c"


def test_the_foreshortening_is_equation_2() -> None:
    np.testing.assert_allclose(hinge().foreshortening(10.0), [4.0, 1.2], rtol=1e-15)
    np.testing.assert_allclose(hinge().foreshortening([8.0, 10.0])[1], [4.0, 1.2], rtol=1e-15)


def test_at_the_bound_the_segment_that_sets_it_vanishes() -> None:
    family = hinge()
    assert family.foreshortening(family.minimum_scale)[1] == 0.0
    assert family.vanished(family.minimum_scale).tolist() == [False, True]
    assert not family.vanished(8.1).any()


@pytest.mark.parametrize("s", [7.999, 1.0])
def test_a_scale_below_the_bound_names_the_segment_and_what_it_needs(s: float) -> None:
    message = rf"s = {s:g} is below the bound: b-c \(length 2\) is 16 pixels long .* needs s >= 8"
    with pytest.raises(CameraError, match=message):
        hinge().foreshortening([9.0, s])
    with pytest.raises(CameraError, match=message):
        hinge().points(s, [1, 1])


@pytest.mark.parametrize("s", [0.0, -1.0, np.nan, np.inf])
def test_an_impossible_scale_is_refused(s: float) -> None:
    with pytest.raises(CameraError, match="expected a finite number above zero"):
        hinge().foreshortening(s)


def test_a_flip_decides_which_end_is_nearer() -> None:
    points = hinge().points(10.0, [[1, 1], [-1, 1]])
    expected = np.array([[0, 0, 0], [3, 0, 4], [3, 1.6, 5.2]])
    np.testing.assert_allclose(points[0], expected, rtol=0, atol=1e-14)
    np.testing.assert_allclose(points[1, :, 2], [0, -4, -2.8], rtol=0, atol=1e-14)
    np.testing.assert_array_equal(hinge().flips_of(points), [[1, 1], [-1, 1]])


def test_a_flip_must_be_given_unless_there_is_none() -> None:
    family = hinge()
    with pytest.raises(InputError, match="no flip for b-c"):
        family.points(10.0, [1, 0])
    depth = family.points(8.0, [1, 0])[:, 2]
    np.testing.assert_allclose(np.diff(depth), [np.sqrt(25 - (30 / 8) ** 2), 0.0], rtol=0, atol=1e-14)
    with pytest.raises(InputError, match=r"flips of shape \(3,\); expected -1, 0 or 1 for each of its 2"):
        family.points(10.0, [1, 1, 1])
    with pytest.raises(InputError, match="expected -1, 0 or 1"):
        family.points(10.0, [1, 2])


@pytest.mark.parametrize("kind", ["chain", "tree", "loop"])
@pytest.mark.parametrize("aspect", [1.0, 1.1])
def test_exact_views_of_random_objects_are_recovered(
    rng: np.random.Generator, kind: str, aspect: float
) -> None:
    for _ in range(100):
        linkage, points = random_object(rng, kind)
        s = float(np.exp(rng.uniform(-3, 6)))
        family = look(linkage, points, s, aspect)
        assert family.minimum_scale <= s * (1 + 1e-12)
        recovered = family.points(s, family.flips_of(points))
        shifted = points - [0, 0, points[0, 2]]
        np.testing.assert_allclose(recovered, shifted, rtol=0, atol=1e-9 * float(linkage.lengths.mean()))


@given(seed=st.integers(0, 2**31), stretch=st.floats(1.0, 10.0))
def test_every_flip_at_every_scale_keeps_the_lengths_and_the_image(seed: int, stretch: float) -> None:
    rng = np.random.default_rng(seed)
    linkage, points = random_object(rng, "tree")
    family = look(linkage, points, 30.0)
    s = family.minimum_scale * stretch
    flips = rng.choice((-1, 1), (20, len(linkage.segments)))
    postures = family.points(s, flips)
    ends = np.array(linkage.segments)
    kept = np.linalg.norm(postures[:, ends[:, 1]] - postures[:, ends[:, 0]], axis=-1)
    np.testing.assert_allclose(kept, np.broadcast_to(linkage.lengths, kept.shape), rtol=1e-12)
    seen = ScaledOrthographicCamera(scale=s).project(postures)
    np.testing.assert_allclose(seen, np.broadcast_to(family.image, seen.shape), rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(family.points(s, -flips)[..., 2], -postures[..., 2], rtol=0, atol=1e-12)


@pytest.mark.parametrize("offset", [0.0, 5000.0])
def test_the_human_has_2048_leaves_and_the_truth_is_one(rng: np.random.Generator, offset: float) -> None:
    spanned = span(HUMAN)
    points = np.stack([random_human(rng) for _ in range(20)])
    camera = ScaledOrthographicCamera(scale=rng.uniform(5, 20, 20))
    leaves = spanned.grow(camera, camera.project(points) + offset, closure(spanned))
    assert np.diff(leaves.offsets()).tolist() == [2048] * 20
    assert all(
        row == {"midpoint/mid_shoulders": 4096, "midpoint/mid_hips": 2048} for row in leaves.rejected()
    )
    postures = spanned.points(leaves.postures())
    off = (postures - postures[:, :1]) - (points - points[:, :1])[leaves.frame]
    nearest = np.minimum.reduceat(np.abs(off).max(axis=(1, 2)), leaves.offsets()[:-1])
    assert nearest.max() < 1e-9 * 70


@pytest.mark.parametrize("kind", ["chain", "tree", "loop"])
def test_the_tree_enumerates_the_family(rng: np.random.Generator, kind: str) -> None:
    # Two ways to the same postures: lifts joint by joint, and the sums of signed foreshortenings.
    for _ in range(20):
        linkage, points = random_object(rng, kind)
        if len(linkage.segments) > 10:
            continue
        family, spanned = look(linkage, points, 40.0), span(linkage)
        checks = closure(spanned, tolerance=1e-9 * float(linkage.lengths.sum()))
        leaves = spanned.grow(ScaledOrthographicCamera(scale=40.0), family.image[None], checks)
        postures = spanned.points(leaves.postures())
        again = family.points(40.0, family.flips_of(postures))
        np.testing.assert_allclose(again, postures, rtol=0, atol=1e-9 * float(linkage.lengths.mean()))
        assert len(leaves.code) == 2 ** len(linkage.segments) or kind == "loop"
        true = points - [0, 0, points[0, 2]]
        gap = np.abs(postures - true).max(axis=(1, 2)).min()
        assert gap < 1e-9 * linkage.lengths.mean()


def test_the_tree_of_a_twenty_segment_loop_holds_the_truth(rng: np.random.Generator) -> None:
    points = rng.normal(size=(20, 3))
    linkage = joined(points, [(k, (k + 1) % 20) for k in range(20)])
    spanned = span(linkage)
    camera = ScaledOrthographicCamera(scale=100.0)
    leaves = spanned.grow(camera, camera.project(points)[None], closure(spanned, tolerance=1e-9))
    postures = spanned.points(leaves.postures())
    assert np.abs(postures - (points - [0, 0, points[0, 2]])).max(axis=(1, 2)).min() < 1e-9


def test_a_point_that_is_not_seen_takes_only_its_own_segments(rng: np.random.Generator) -> None:
    points = random_human(rng)
    image = ScaledOrthographicCamera(scale=8.0).project(points)
    image[HUMAN.points.index("right_elbow")] = np.nan
    family = LinkageFamily(linkage=HUMAN, image=image)
    assert [HUMAN.segment_names[k] for k in np.flatnonzero(~family.seen)] == [
        "right_shoulder-right_elbow",
        "right_elbow-right_wrist",
    ]
    recovered = family.points(8.0, family.flips_of(points))
    unknown = np.isnan(recovered[:, 2])
    assert [HUMAN.points[k] for k in np.flatnonzero(unknown)] == ["right_elbow", "right_wrist"]
    true = points - [0, 0, points[0, 2]]
    np.testing.assert_allclose(recovered[~unknown], true[~unknown], rtol=0, atol=1e-9)


def test_a_hidden_hip_cuts_the_human_in_two(rng: np.random.Generator) -> None:
    points = random_human(rng)
    image = ScaledOrthographicCamera(scale=8.0).project(points)
    image[HUMAN.points.index("left_hip")] = np.nan  # and with it the middle of the hips
    family = LinkageFamily(linkage=HUMAN, image=image)
    known = ~np.isnan(family.points(8.0, family.flips_of(points))[:, 2])
    arms = [name for name in HUMAN.points if name.split("_")[1] in ("shoulder", "elbow", "wrist")]
    assert [HUMAN.points[k] for k in np.flatnonzero(known)] == arms


@pytest.mark.parametrize(
    ("place", "message"),
    [
        ([np.inf, 0.0], r"image point b is \(inf, 0\); expected two finite numbers"),
        ([np.nan, 0.0], r"image point b is \(nan, 0\)"),
        ([1e300, 0.0], r"image point b is \(1e\+300, 0\); .* at most 1e\+09 pixels"),
        ([np.nan, np.nan], r"no segment is seen at both ends \(not seen: b\)"),
    ],
)
def test_image_points_that_are_not_finite_are_refused(place: list[float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        LinkageFamily(linkage=hinge().linkage, image=np.array([[0.0, 0.0], place, [1.0, 1.0]]))


def test_an_image_of_another_shape_is_refused() -> None:
    with pytest.raises(InputError, match=r"shape \(2, 2\); expected \(3, 2\)"):
        LinkageFamily(linkage=hinge().linkage, image=np.zeros((2, 2)))


@pytest.mark.parametrize("aspect", [0.0, -1.0, np.nan, np.inf])
def test_an_impossible_aspect_ratio_is_refused(aspect: float) -> None:
    with pytest.raises(CameraError, match="aspect must be finite and positive"):
        LinkageFamily(linkage=hinge().linkage, image=np.zeros((3, 2)), aspect=aspect)


def test_flips_given_by_hand() -> None:
    linkage = hinge().linkage
    assert read_nearer(linkage, {"a-b": "b", "c-b": "b"}).tolist() == [-1, 1]
    assert read_nearer(linkage, {}).tolist() == [0, 0]
    assert name_nearer(linkage, [-1, 1]) == {"a-b": "b", "b-c": "b"}
    assert name_nearer(linkage, [0, 1]) == {"b-c": "b"}
    with pytest.raises(InputError, match="nearer end of a-b is 'c'; expected a or b"):
        read_nearer(linkage, {"a-b": "c"})
    with pytest.raises(InputError, match="a-c is not one of its segments; they are a-b, b-c"):
        read_nearer(linkage, {"a-c": "a"})
    with pytest.raises(InputError, match="no point x"):
        read_nearer(linkage, {"a-x": "a"})
