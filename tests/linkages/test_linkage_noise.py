"""The objects of Taylor's Figs. 7 and 8, drawn 600 pixels large with a noise of one pixel: how far angles are off."""

import numpy as np
import pytest

from posekit.linkages import Linkage, LinkageFamily, load_linkage, name_nearer, search

SEEDS = 200
SIZE = 600.0

FOUR_BAR = load_linkage("four_bar")
CHAIN = load_linkage("planar_chain")


def four_bar(diagonal: float) -> np.ndarray:
    """Lay the four bars into a plane (4, 3), folded over their diagonal a-c."""
    ab, bc, cd, da = FOUR_BAR.lengths
    b = (ab**2 - bc**2 + diagonal**2) / (2 * diagonal)
    d = (da**2 - cd**2 + diagonal**2) / (2 * diagonal)
    return np.array(
        [[0, 0, 0], [b, np.sqrt(ab**2 - b**2), 0], [diagonal, 0, 0], [d, np.sqrt(da**2 - d**2), 0]]
    )


def chain(turns: tuple[float, ...]) -> np.ndarray:
    """Lay the chain into a plane (6, 3), turning at each point of articulation by some degrees."""
    heading = np.radians(np.concatenate([[0.0], np.cumsum(turns)]))
    steps = CHAIN.lengths[:, None] * np.stack([np.cos(heading), np.sin(heading), 0 * heading], axis=1)
    return np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])


def seen(points: np.ndarray, tilt: float, spin: float) -> np.ndarray:
    """Spin an object in its plane and tilt the plane away from the image's, by degrees."""
    x, z = np.radians([tilt, spin])
    tilted = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    spun = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
    return np.asarray(points @ (tilted @ spun).T)


def joint_angles(points: np.ndarray, *, closed: bool) -> np.ndarray:
    """Return the angle at each point (degrees) between the segments to the one before and the one after."""
    before, after = np.roll(points, 1, axis=0) - points, np.roll(points, -1, axis=0) - points
    sizes = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    angles = np.degrees(np.arccos((before * after).sum(axis=1) / sizes))
    return np.asarray(angles if closed else angles[1:-1])


def worst_angles(linkage: Linkage, points: np.ndarray, kind: str) -> np.ndarray:
    """Recover an object from noisy views, flips given by hand as Taylor did: the worst angle of each (degrees)."""
    s = SIZE / float(np.linalg.norm(np.ptp(points[:, :2], axis=0)))
    flips = LinkageFamily(linkage=linkage, image=points[:, :2] * s).flips_of(points)
    nearer = name_nearer(linkage, flips)
    rng = np.random.default_rng(2000)
    closed = kind == "closure"
    worst = np.full(SEEDS, np.inf)
    for seed in range(SEEDS):
        image = points[:, :2] * s + rng.normal(size=(len(points), 2))
        family = LinkageFamily(linkage=linkage, image=image)
        found = search(family, {kind: 1.0}, nearer=nearer)
        if len(found):
            recovered = family.points(found.s[0], flips * ~family.vanished(found.s[0]))
            off = joint_angles(recovered, closed=closed) - joint_angles(points, closed=closed)
            worst[seed] = np.abs(off).max()
    return worst


@pytest.mark.parametrize(
    ("view", "linkage", "points", "kind", "within", "median", "share"),
    [
        ("Fig. 7", FOUR_BAR, seen(four_bar(140), 50, 220), "closure", 1.0, 0.3, 0.99),
        ("Fig. 8", CHAIN, seen(chain((50, 110, 110, 80)), 45, 60), "coplanar", 2.0, 1.0, 0.9),
    ],
)
def test_angles_come_out_as_in_the_paper(
    view: str, linkage: Linkage, points: np.ndarray, kind: str, within: float, median: float, share: float
) -> None:
    worst = worst_angles(linkage, points, kind)
    assert np.median(worst) <= median, view
    assert (worst <= within).mean() >= share, view


def test_without_noise_they_are_exact() -> None:
    for linkage, points, kind in (
        (FOUR_BAR, seen(four_bar(140), 50, 220), "closure"),
        (CHAIN, seen(chain((50, 110, 110, 80)), 45, 60), "coplanar"),
    ):
        family = LinkageFamily(linkage=linkage, image=points[:, :2] * 3.0)
        found = search(family, {kind: 1.0})
        assert np.abs(found.s[found.residual < 1e-20] / 3.0 - 1).min() < 1e-9
        assert found.residual[0] < 1e-20


def test_where_opposite_bars_are_nearly_parallel_a_pixel_costs_more() -> None:
    # The same bars, open and not folded: its loop nearly closes at every scale.
    points = four_bar(140)
    points[3, 1] *= -1
    worst = worst_angles(FOUR_BAR, seen(points, 50, 220), "closure")
    assert np.median(worst) > 2 * np.median(worst_angles(FOUR_BAR, seen(four_bar(140), 50, 220), "closure"))
