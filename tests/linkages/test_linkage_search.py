"""The search for the scale: its minima are minima, all of them, and the truth is among them."""

from collections.abc import Mapping
from itertools import pairwise, product

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from posekit.errors import InputError
from posekit.linkages import Linkage, LinkageFamily, Minima, load_linkage, name_nearer, search
from posekit.linkages.residuals import Flatness, LoopClosure, Perpendicularity, Residual, Slice
from posekit.linkages.roots import find_roots

Edges = list[tuple[int, int]]
KINDS = ("closure", "coplanar", "perpendicular", "collinear", "closure and coplanar")


def joined(points: np.ndarray, edges: Edges, **constraints: object) -> Linkage:
    """Make the linkage of some points (P, 3) with segments between them, as long as they are."""
    return Linkage.from_names(
        name="random",
        points=[f"p{k}" for k in range(len(points))],
        segments={(f"p{a}", f"p{b}"): float(np.linalg.norm(points[a] - points[b])) for a, b in edges},
        **constraints,  # type: ignore[arg-type]
    )


def names(n: int) -> list[str]:
    return [f"p{k}" for k in range(n)]


def chain(n: int) -> Edges:
    return list(pairwise(range(n)))


def loop(n: int) -> Edges:
    return [*chain(n), (n - 1, 0)]


def flat_points(rng: np.random.Generator, n: int) -> np.ndarray:
    """Draw points (n, 3) in a random plane."""
    return np.asarray(rng.normal(size=(n, 2)) @ np.linalg.qr(rng.normal(size=(3, 3)))[0][:2])


def random_object(
    rng: np.random.Generator, kind: str, n: int
) -> tuple[Linkage, np.ndarray, dict[str, float]]:
    """Draw an object of n points that keeps a constraint, its points (P, 3), and the weights to search by."""
    if kind == "closure":
        points = rng.normal(size=(n, 3))
        return joined(points, loop(n)), points, {kind: 1.0}
    if kind == "coplanar":
        points = flat_points(rng, n)
        return joined(points, chain(n), coplanar=[names(n)]), points, {kind: 2.0}
    if kind == "perpendicular":
        points = rng.normal(size=(n, 3))
        along, across = points[1] - points[0], points[2] - points[1]
        points[2] -= along * (across @ along) / (along @ along)
        linkage = joined(points, chain(n), perpendicular=[("p0-p1", "p1-p2")])
        return linkage, points, {kind: 1.0}
    if kind == "collinear":
        points = rng.normal(size=(n, 3))
        points[-1] = points[0] + (points[-2] - points[0]) * rng.uniform(-1, 2)
        return joined(points, chain(n), collinear=[["p0", f"p{n - 2}", f"p{n - 1}"]]), points, {kind: 1.0}
    points = np.concatenate([flat_points(rng, n), rng.normal(size=(1, 3))])
    linkage = joined(points, [*loop(n), (n - 1, n)], coplanar=[names(n)])
    return linkage, points, {"closure": 1.0, "coplanar": 0.5}


def look(linkage: Linkage, points: np.ndarray, s: float) -> LinkageFamily:
    return LinkageFamily(linkage=linkage, image=points[:, :2] * s)


def holds_truth(found: Minima, points: np.ndarray, s: float, within: float = 1e-9) -> bool:
    """Tell whether the true scale with the true flips, or the mirror image's, is among the minima."""
    true = found.constraints.family.flips_of(points)
    read = found.flips != 0
    same = (~read | (found.flips == true)).all(axis=1) | (~read | (found.flips == -true)).all(axis=1)
    return bool((same & (np.abs(found.s - s) <= within * s)).any())


def residual_by_hand(
    family: LinkageFamily, signs: np.ndarray, scales: np.ndarray, weights: Mapping[str, float]
) -> np.ndarray:
    """Place the points anew for each scale (G,), by least squares over the segments, and measure them."""
    linkage, unit = family.linkage, float(family.linkage.lengths.mean())
    ends = np.array(linkage.segments)
    A = np.zeros((len(ends), len(linkage.points)))
    A[np.arange(len(ends)), ends[:, 0]], A[np.arange(len(ends)), ends[:, 1]] = -1, 1
    place = family.image / scales[:, None, None]
    apart = ((place[:, ends[:, 1]] - place[:, ends[:, 0]]) ** 2).sum(axis=-1)
    dZ = signs * np.sqrt(np.maximum(linkage.lengths**2 - apart, 0))
    depth = np.linalg.lstsq(A, dZ.T, rcond=None)[0].T
    points = np.concatenate([place, depth[..., None]], axis=-1) / unit
    total = np.zeros(len(scales))
    for kind, weight in weights.items():
        if kind == "closure":
            gap = np.zeros(len(scales))  # the one loop that is tested runs through the points in order
            for k, (a, b) in enumerate(linkage.segments):
                gap += dZ[:, k] / unit if abs(a - b) == 1 or (a > 0 and b == 0) else 0.0
                if {a, b} == {len(linkage.points) - 2, len(linkage.points) - 1} and len(linkage.coplanar):
                    gap -= dZ[:, k] / unit  # the loose end of the mixed object
            total += weight * gap**2
        elif kind == "perpendicular":
            for i, j in linkage.perpendicular:
                x, y = (points[:, ends[k, 1]] - points[:, ends[k, 0]] for k in (i, j))
                cosine = (x * y).sum(axis=1) / np.linalg.norm(x, axis=1) / np.linalg.norm(y, axis=1)
                total += weight * cosine**2
        else:
            for group in linkage.coplanar if kind == "coplanar" else linkage.collinear:
                centred = points[:, group] - points[:, group].mean(axis=1, keepdims=True)
                extent = np.linalg.svd(centred, compute_uv=False)
                total += weight * (extent[:, 2 if kind == "coplanar" else 1 :] ** 2).sum(axis=1)
    return total


def minima_by_force(
    family: LinkageFamily, segments: np.ndarray, weights: Mapping[str, float]
) -> list[tuple[float, float]]:
    """Find local minima (s, residual) inside the range for every string of flips: dense in s, then scipy."""
    scales = family.minimum_scale / np.cos(np.linspace(0, np.arccos(1 / 50), 1200))
    found = []
    for choice in product((1, -1), repeat=len(segments)):
        signs = np.ones(len(family.linkage.segments))
        signs[segments] = choice
        curve = residual_by_hand(family, signs, scales, weights)
        lower = np.flatnonzero((curve[1:-1] < curve[:-2]) & (curve[1:-1] <= curve[2:])) + 1
        for k in lower:
            fine = minimize_scalar(
                lambda s, signs=signs: residual_by_hand(family, signs, np.array([s]), weights)[0],
                bounds=(scales[k - 1], scales[k + 1]),
                method="bounded",
                options={"xatol": 1e-9 * scales[k]},
            )
            found.append((float(fine.x), float(fine.fun)))
    return found


# --- all minima, and nothing else -------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_the_minima_are_those_of_brute_force(rng: np.random.Generator, kind: str, noise: float) -> None:
    for _ in range(2 if kind == "closure and coplanar" else 4):
        linkage, points, weights = random_object(rng, kind, 4)
        image = (points[:, :2] + noise * rng.normal(size=(len(points), 2))) * 100
        family = LinkageFamily(linkage=linkage, image=image)
        found = search(family, weights)
        forced = minima_by_force(family, found.constraints.segments, weights)
        inner = [
            (s, value)
            for s, value, bound in zip(found.s, found.residual, found.at_bound, strict=True)
            if not bound and 1.00001 < s / family.minimum_scale < 49
        ]
        for mine, others in ((inner, forced), (forced, list(zip(found.s, found.residual, strict=True)))):
            for s, value in mine:
                if s / family.minimum_scale > 1.00001:
                    assert any(
                        abs(s / x - 1) < 1e-5 and abs(value - y) < 1e-7 * (1 + y) for x, y in others
                    ), (s / family.minimum_scale, value)
        # Every string of flips has a mirror image, which is not counted twice.
        beyond = [s for s, _ in forced if s / family.minimum_scale > 1.00001]
        assert len(beyond) == len(inner) * 2


@pytest.mark.parametrize("kind", KINDS)
def test_every_minimum_is_one_of_its_own_curve(rng: np.random.Generator, kind: str) -> None:
    judged = 0
    for _ in range(10):
        linkage, points, weights = random_object(rng, kind, 5)
        image = (points[:, :2] + 0.05 * rng.normal(size=(len(points), 2))) * 100
        family = LinkageFamily(linkage=linkage, image=image)
        found = search(family, weights)
        assert (np.diff(found.residual) >= -1e-24).all()
        assert (found.s >= family.minimum_scale).all()
        for number, s in enumerate(found.s):
            around = np.array([s, max(s * (1 - 1e-6), family.minimum_scale), s * (1 + 1e-6)])
            curve = found.curve(number, around)
            np.testing.assert_allclose(curve[0], found.residual[number], rtol=1e-6, atol=1e-20)
            assert (curve[1:] >= curve[0] * (1 - 1e-9) - 1e-20).all()
            judged += 1
    assert judged > 10


def test_the_envelope_is_the_least_of_all_curves(rng: np.random.Generator) -> None:
    for kind in ("closure", "coplanar"):
        linkage, points, weights = random_object(rng, kind, 5)
        family = look(linkage, points + rng.normal(size=points.shape) * 0.05, 100.0)
        found = search(family, weights)
        curves = [
            residual_by_hand(family, np.array(signs), found.curve_s, weights)
            for signs in product((1.0, -1.0), repeat=len(linkage.segments))
        ]
        np.testing.assert_allclose(found.curve_residual, np.min(curves, axis=0), rtol=1e-6, atol=1e-12)
        assert found.curve_s[0] == pytest.approx(family.minimum_scale, rel=1e-12)
        for number in range(len(found)):
            assert (found.curve(number) >= found.curve_residual * (1 - 1e-9) - 1e-20).all()


# --- the truth is among them ------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_the_true_scale_and_flips_are_among_the_minima(rng: np.random.Generator, kind: str) -> None:
    for _ in range(30):
        n = int(rng.integers(3 if kind == "closure" else 4, 9))
        linkage, points, weights = random_object(rng, kind, n)
        s = float(np.exp(rng.uniform(-2, 6)))
        found = search(look(linkage, points, s), weights)
        assert holds_truth(found, points, s)


@pytest.mark.parametrize(("n", "by_hand"), [(12, 0), (16, 0), (20, 5)])
def test_long_loops_too(rng: np.random.Generator, n: int, by_hand: int) -> None:
    linkage, points, weights = random_object(rng, "closure", n)
    family = look(linkage, points, 100.0)
    known = list(name_nearer(linkage, family.flips_of(points)).items())[:by_hand]
    found = search(family, weights, nearer=dict(known))
    assert found.n_flips == 2 ** (n - max(1, by_hand))
    assert holds_truth(found, points, 100.0)


def test_two_loops_share_one_scale(rng: np.random.Generator) -> None:
    points = rng.normal(size=(6, 3))
    linkage = joined(points, [(0, 1), (1, 2), (2, 0), (2, 3), (3, 4), (4, 5), (5, 3)])
    found = search(look(linkage, points, 50.0), {"closure": 1.0})
    assert found.segments == tuple(name for name in linkage.segment_names if name != "p2-p3")
    assert found.n_flips == 2**4  # each triangle has a mirror image of its own
    assert found.residual[0] < 1e-24
    assert found.residual[1] > 1e-9  # one loop alone closes at many scales, both at one
    assert found.s[0] == pytest.approx(50.0, rel=1e-9)


def test_a_midpoint_closes_a_loop(rng: np.random.Generator) -> None:
    points = rng.normal(size=(4, 3))
    middle = points[:2].mean(axis=0)
    segments = {("a", "b"): (0, 1), ("c", "d"): (2, 3), ("d", "a"): (3, 0)}
    linkage = Linkage.from_names(
        name="yoke",
        points=["a", "b", "c", "d"],
        midpoints={"m": ("a", "b")},
        segments={
            **{name: float(np.linalg.norm(points[i] - points[j])) for name, (i, j) in segments.items()},
            ("m", "c"): float(np.linalg.norm(middle - points[2])),
        },
    )
    found = search(look(linkage, points, 70.0), {"closure": 1.0})
    assert holds_truth(found, points, 70.0)


# --- what counts once, and what does not count ------------------------------------------------------------


def test_a_loop_in_the_image_plane_is_found_once_at_the_bound() -> None:
    points = np.array([[0.0, 0, 0], [3, 0, 0], [3, 2, 0], [1, 3, 0]])
    family = look(joined(points, loop(4)), points, 40.0)
    found = search(family, {"closure": 1.0})
    best = found.residual < 1e-24
    assert best.sum() == 1
    assert found.s[best] == 40.0
    assert found.at_bound[best]
    assert (found.flips[best] == 0).all()


def test_one_segment_in_the_image_plane_counts_once() -> None:
    points = np.array([[0.0, 0, 0], [3, 0, 0], [3.2, 2, 1.5], [1, 1.5, 1.1]])
    found = search(look(joined(points, loop(4)), points, 40.0), {"closure": 1.0})
    true = np.flatnonzero((found.residual < 1e-24) & found.at_bound)
    assert len(true) == 1
    assert found.s[true] == 40.0
    assert found.flips[true[0], 0] == 0
    assert (found.flips[true[0], 1:] != 0).all()


def test_the_bound_is_no_minimum_where_the_other_flip_goes_on_falling(rng: np.random.Generator) -> None:
    for _ in range(20):
        linkage, points, weights = random_object(rng, "closure", 5)
        found = search(look(linkage, points, 1.0), weights)
        # The segment that sets the bound is in the loop: one of its flips always lowers the residual.
        assert not found.at_bound.any()


def test_the_bound_is_a_minimum_where_the_residual_grows_from_it() -> None:
    # The scale is bound by a segment that the right angle does not read, and the angle is right below the bound.
    points = np.array([[0.0, 0, 0], [1, 0, 0.5], [1.3, 1, 0.2], [4.0, 1, 0]])
    linkage = joined(points, chain(4), perpendicular=[("p0-p1", "p1-p2")])
    found = search(look(linkage, points, 10.0), {"perpendicular": 1.0})
    assert found.at_bound.any()
    for number in np.flatnonzero(found.at_bound):
        assert found.s[number] == found.constraints.family.minimum_scale
        assert (np.diff(found.curve(number)[:20]) > 0).all()


def test_the_open_end_is_no_minimum(rng: np.random.Generator) -> None:
    # Far from the bound all points lie on one line of sight, which is flat.
    for _ in range(10):
        linkage, points, weights = random_object(rng, "coplanar", 5)
        found = search(look(linkage, points, 1.0), weights)
        assert found.curve_residual[-1] < 1e-5
        assert (found.s < 900 * found.constraints.family.minimum_scale).all()


def test_a_parallelogram_closes_at_every_scale_and_fixes_none() -> None:
    across, along = np.array([3.0, 1, 1.5]), np.array([0.5, 2, -1.0])
    points = np.array([np.zeros(3), across, across + along, along])
    found = search(look(joined(points, loop(4)), points, 40.0), {"closure": 1.0})
    assert found.flat[:, [0, 2]].sum() == 0  # opposite sides point opposite ways round the loop
    assert found.flat[:, [1, 3]].sum() == 0
    assert len(found.flat) == 2  # a rhomboid, and the one with two of its sides flipped
    assert (found.flat[:, 0] == -found.flat[:, 2]).all()


def test_the_mirror_image_counts_once(rng: np.random.Generator) -> None:
    linkage, points, weights = random_object(rng, "closure", 6)
    found = search(look(linkage, points, 10.0), weights)
    assert found.n_flips == 2**5
    everything = {tuple(row) for row in found.flips}
    assert not any(tuple(-flip for flip in row) in everything for row in everything)


# --- choices ----------------------------------------------------------------------------------------------


def test_flips_given_by_hand_are_kept(rng: np.random.Generator) -> None:
    for kind in ("closure", "coplanar"):
        linkage, points, weights = random_object(rng, kind, 6)
        family = look(linkage, points, 10.0)
        flips = family.flips_of(points)
        nearer = name_nearer(linkage, flips)
        two = dict(list(nearer.items())[:2])
        found = search(family, weights, nearer=two)
        assert found.n_flips == 2 ** (len(flips) - 2)  # no mirror image is left
        assert ((found.flips[:, :2] == flips[:2]) | (found.flips[:, :2] == 0)).all()
        assert (found.flips[~found.at_bound, :2] == flips[:2]).all()
        only = search(family, weights, nearer=nearer)
        assert only.n_flips == 1
        assert only.s[0] == pytest.approx(10.0, rel=1e-9)


def test_weights_scale_the_residual_and_leave_the_minima(rng: np.random.Generator) -> None:
    linkage, points, _ = random_object(rng, "closure and coplanar", 4)
    family = look(linkage, points + rng.normal(size=points.shape) * 0.02, 10.0)
    one = search(family, {"closure": 1.0, "coplanar": 0.5})
    ten = search(family, {"closure": 10.0, "coplanar": 5.0})
    np.testing.assert_allclose(ten.residual, 10 * one.residual, rtol=1e-9, atol=1e-20)
    np.testing.assert_allclose(ten.s, one.s, rtol=1e-9)


def test_the_unit_of_length_does_not_matter(rng: np.random.Generator) -> None:
    for kind in KINDS:
        linkage, points, weights = random_object(rng, kind, 5)
        large = random_object(np.random.default_rng(0), kind, 5)[0]
        large = Linkage(
            name="large",
            points=linkage.points,
            segments=linkage.segments,
            lengths=linkage.lengths * 1000,
            coplanar=linkage.coplanar,
            perpendicular=linkage.perpendicular,
            collinear=linkage.collinear,
        )
        small, big = (search(look(thing, points, 10.0), weights) for thing in (linkage, large))
        exact = small.residual < 1e-20
        np.testing.assert_allclose(big.s[~exact], small.s[~exact] / 1000, rtol=1e-9)
        np.testing.assert_allclose(big.residual, small.residual, rtol=1e-9, atol=1e-20)


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        ({}, "no constraint to search by; expected some of closure, coplanar, perpendicular, collinear"),
        ({"closed": 1.0}, "constraint 'closed' is not known"),
        ({"closure": 0.0}, "weight of closure is 0; expected a finite number above zero"),
        ({"closure": np.nan}, "weight of closure is nan"),
        ({"coplanar": -1.0}, "weight of coplanar is -1"),
        ({"perpendicular": 1.0}, "it has no perpendicular pair to search by perpendicular"),
        ({"closure": 1.0, "collinear": 1.0}, "it has no collinear triple to search by collinear"),
    ],
)
def test_nothing_to_search_by_is_refused(weights: dict[str, float], message: str) -> None:
    family = LinkageFamily(
        linkage=load_linkage("four_bar"), image=np.array([[0.0, 0], [50, 10], [90, 90], [10, 110]])
    )
    with pytest.raises(InputError, match=message):
        search(family, weights)


def test_an_open_chain_has_no_loop() -> None:
    family = LinkageFamily(linkage=load_linkage("planar_chain"), image=np.arange(12.0).reshape(6, 2) ** 2)
    with pytest.raises(InputError, match="it has no loop to search by closure"):
        search(family, {"closure": 1.0})


def test_a_loop_that_is_not_seen_is_named() -> None:
    image = np.array([[0.0, 0], [50, 10], [90, 90], [np.nan, np.nan]])
    family = LinkageFamily(linkage=load_linkage("four_bar"), image=image)
    with pytest.raises(
        InputError, match="too little is seen of any loop to search by closure: d is not seen"
    ):
        search(family, {"closure": 1.0})


def test_too_many_flips_are_refused_with_the_remedy(rng: np.random.Generator) -> None:
    linkage, points, weights = random_object(rng, "coplanar", 18)
    with pytest.raises(
        InputError, match=r"17 segments|16 segments matter .* 2\^16 .* say which end is nearer"
    ):
        search(look(linkage, points, 10.0), weights)
    linkage, points, weights = random_object(rng, "closure", 6)
    with pytest.raises(InputError, match="at most 16 are tried"):
        search(look(linkage, points, 10.0), weights, limit=16)


def test_an_unknown_nearer_end_is_refused(rng: np.random.Generator) -> None:
    linkage, points, weights = random_object(rng, "closure", 4)
    with pytest.raises(InputError, match="nearer end of p0-p1 is 'p2'; expected p0 or p1"):
        search(look(linkage, points, 10.0), weights, nearer={"p0-p1": "p2"})


def test_an_object_seen_end_on_fixes_no_scale() -> None:
    with pytest.raises(InputError, match="seen end on"):
        search(LinkageFamily(linkage=load_linkage("four_bar"), image=np.ones((4, 2))), {"closure": 1.0})


# --- the parts --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "term",
    [
        LoopClosure(loop=np.array([1.0, -0.5, 1.0, -1.0])),
        Flatness(
            spread=np.random.default_rng(0).normal(size=(5, 4)),
            place=np.random.default_rng(1).normal(size=(5, 2)),
            rank=2,
        ),
        Flatness(
            spread=np.random.default_rng(2).normal(size=(3, 4)),
            place=np.random.default_rng(3).normal(size=(3, 2)),
            rank=1,
        ),
        Perpendicularity(pair=(0, 2), product=0.3, lengths=2.0),
    ],
    ids=["closure", "plane", "line", "right angle"],
)
def test_the_derivative_of_a_residual_is_that_of_finite_differences(
    rng: np.random.Generator, term: Residual
) -> None:
    start, slope = rng.normal(size=(2, 30, 4))
    angle = rng.uniform(0.1, 1.4, 30)

    def at(step: float) -> tuple[np.ndarray, np.ndarray]:
        turned = angle + step
        return term.evaluate(Slice(start + step * slope, slope, np.cos(turned), -np.sin(turned)))

    difference = (at(1e-6)[0] - at(-1e-6)[0]) / 2e-6
    np.testing.assert_allclose(at(0.0)[1], difference, rtol=1e-6, atol=1e-7)


def test_roots_are_found_to_the_last_digits(rng: np.random.Generator) -> None:
    target = rng.uniform(0.1, 10, 500)
    power = rng.uniform(0.3, 9, 500)

    def function(x: np.ndarray, rows: np.ndarray) -> np.ndarray:
        return np.asarray(np.sign(x - target[rows]) * np.abs(x - target[rows]) ** power[rows])

    roots = find_roots(function, np.zeros(500), np.full(500, 20.0))
    np.testing.assert_allclose(roots, target, rtol=2e-15)


def test_a_root_at_an_end_is_found_and_no_bracket_is_no_failure() -> None:
    assert find_roots(lambda x, _: x, np.zeros(1), np.ones(1)) == 0.0
    assert find_roots(lambda x, _: x - 1, np.zeros(1), np.ones(1)) == 1.0
    assert find_roots(lambda x, _: x + 1, np.zeros(1), np.ones(1)) == 0.0
    assert len(find_roots(lambda x, _: x, np.zeros(0), np.zeros(0))) == 0
