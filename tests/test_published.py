"""Published numbers, typed from their sources again, beside those that posekit uses."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

import posekit
from posekit.body.inertias import inertias
from posekit.body.lengths import stature_from_lengths
from posekit.following.tracking import COMPARED, FALLOFF
from posekit.ranking import standing
from posekit.recovery.scales import ANNOTATION_SIGMAS, DEPTH_RELIEF, DIMENSIONS
from posekit.skeleton import JOINTS, LIMB_SHARES, POINTS
from posekit.synthesis import Walker, random_views
from posekit.validators.motion import ground, trembling

COCO = {
    **{"nose": 0.026, "eye": 0.025, "ear": 0.035, "shoulder": 0.079, "elbow": 0.072, "wrist": 0.062},
    **{"hip": 0.107, "knee": 0.087, "ankle": 0.089},
}
"""cocodataset.org/#keypoints-eval."""

DE_LEVA = {
    ("upper_arm", "shoulder", "elbow"): ((2.55, 57.54, 27.8, 26.0, 14.8), (2.71, 57.72, 28.5, 26.9, 15.8)),
    ("forearm", "elbow", "wrist"): ((1.38, 45.59, 26.1, 25.7, 9.4), (1.62, 45.74, 27.6, 26.5, 12.1)),
    ("thigh", "hip", "knee"): ((14.78, 36.12, 36.9, 36.4, 16.2), (14.16, 40.95, 32.9, 32.9, 14.9)),
    ("shank", "knee", "ankle"): ((4.81, 43.52, 26.7, 26.3, 9.2), (4.33, 43.95, 25.1, 24.6, 10.2)),
}
"""de Leva 1996, table 4, women and men: mass, centre of mass, radii of gyration (sagittal, transverse, longitudinal) in
percent; the shank to the joint of the ankle."""


def test_key_points_spread_as_coco_says() -> None:
    words = [POINTS[k].rpartition("_")[2] for k in COMPARED]
    assert len(words) == 17 and FALLOFF == pytest.approx([2 * COCO[word] for word in words])
    same = {"neck": "shoulder", "pelvis": "hip"}
    words = [same.get(name, name.rpartition("_")[2]) for name in JOINTS]
    assert ANNOTATION_SIGMAS == pytest.approx([COCO[word] for word in words])


def test_medians_of_normal_coordinates_are_those_of_scipy() -> None:
    assert trembling.MEDIAN_OF_ONE == pytest.approx(stats.chi(1).median(), abs=5e-5)
    assert trembling.MEDIAN_OF_THREE == pytest.approx(stats.chi(3).median(), abs=5e-5)


def test_shares_of_the_stature_are_those_of_winter() -> None:
    """Winter 2009, figure 4.1: foot 0.152 long, ankle 0.039 high, thigh 0.245, shank 0.246, hand 0.108."""
    shares = [ground.FOOT_SHARE, ground.ANKLE_SHARE, ground.LEG_SHARE, ground.HAND_SHARE]
    assert shares == pytest.approx([0.152, 0.039, 0.491, 0.108])
    assert list(LIMB_SHARES.values()) == pytest.approx([0.186, 0.146, 0.245, 0.246])


def test_parts_of_the_body_weigh_what_de_leva_says() -> None:
    lengths = dict(posekit.load_figure().lengths)
    parts = inertias(lengths)
    mass = sum(one[0] for one in parts.values())
    assert mass == pytest.approx(22.33 * stature_from_lengths(lengths) ** 2, rel=1e-3)
    ranked = {(start, share): centre for start, _, share, centre in standing.LIMB_MASSES}
    assert standing.TRUNK_MASS + 2 * sum(share for _, share in ranked) == pytest.approx(1, abs=1e-3)
    for (link, start, end), tables in DE_LEVA.items():
        share, centre, *radii = np.mean(tables, axis=0) / 100
        length = lengths[f"left_{start}-left_{end}"]
        own, middle, moments = parts[f"left_{link}"]
        assert own / mass == pytest.approx(share, rel=2e-3)
        assert middle[2] == pytest.approx(-centre * length, rel=1e-3)
        assert moments == pytest.approx(own * (np.array(radii) * length) ** 2, rel=5e-3)
        near = [(one, place) for (joint, one), place in ranked.items() if joint == start]
        assert min(abs(one - share) + abs(place - centre) for one, place in near) < 3e-4


def test_trunks_turn_as_stiffly_as_uniform_cylinders() -> None:
    """Radii of gyration of a uniform cylinder as long and wide as the part, within a half."""
    lengths = dict(posekit.load_figure().lengths)
    parts = inertias(lengths)
    for link, long, wide, deep in (
        ("torso", 0.36, 0.30, 0.21),
        ("hips", 0.20, 0.33, 0.22),
        ("head", 0.24, 0.16, 0.18),
    ):
        mass, _, moments = parts[link]
        x, y, z = long**2 / 12, wide**2 / 16, deep**2 / 16
        assert moments / mass == pytest.approx([x + y, x + z, y + z], rel=0.5)


@pytest.mark.parametrize("velocity", [0.55, 0.9, 1.3])
def test_the_pelvis_moves_as_boulic_says(velocity: float) -> None:
    """Boulic et al. 1990, leg lengths: a cycle is 1.346 sqrt(v) long, its support lasts 0.752 of it less 0.143 s."""
    walker = Walker(velocity=velocity)
    cycle = 1.346 * np.sqrt(velocity) / velocity
    assert walker.cycle_duration == pytest.approx(cycle)
    time = np.linspace(0, cycle, 33)
    t = time / cycle
    q = walker.configurations(walker.phase(time))
    q[:, :3] += walker.travel(time)
    pelvis = walker.figure.points(q)[:, JOINTS.index("pelvis")] / walker.leg_length

    def wave(phase: np.ndarray) -> np.ndarray:
        return np.asarray(np.sin(2 * np.pi * phase))

    early = 0.625 - (0.752 * cycle - 0.143) / cycle
    forward = velocity * time - 0.021 * wave(2 * (t + early))
    up, left = 0.015 * velocity * wave(2 * t - 0.35), -0.032 * wave(t - 0.1)
    expected = np.stack([forward, up, -left], axis=1)
    np.testing.assert_allclose(pelvis - pelvis[0], expected - expected[0], atol=1e-9)


@pytest.mark.parametrize("velocity", [0.55, 1.3])
def test_limbs_swing_as_boulic_says(velocity: float) -> None:
    u, walker = (velocity - 0.5) / 0.8, Walker(velocity=velocity)
    swing = {
        name: np.degrees(values) for name, values in walker.flexion(np.array([0.05, 0.25, 0.5, 0.9])).items()
    }
    shoulder = 3 - 4.94 * velocity - 9.88 * velocity * np.cos(2 * np.pi * np.array([0.05, 0.25, 0.5, 0.9]))
    assert swing["shoulder"][:, 0] == pytest.approx(shoulder)
    assert swing["elbow"][[0, 3], 0] == pytest.approx([6 + 8 * u, 8 + 9 * u])
    assert np.degrees(walker.flexion(np.array([0.5 + 0.01 * u]))["elbow"][0, 0]) == pytest.approx(20 + 24 * u)
    q = walker.configurations(np.array([0.0, 0.5]))
    joints = walker.figure.points(q)
    across = joints[:, JOINTS.index("right_hip")] - joints[:, JOINTS.index("left_hip")]
    turned = np.degrees(np.arctan2(across[:, 0], across[:, 2]))  # the hip of the leading leg leads
    assert turned == pytest.approx([4 * velocity, -4 * velocity], abs=1e-6)


def test_parts_of_the_body_are_nearer_and_farther_by_less_than_in_random_postures() -> None:
    joints = random_views(400, np.random.default_rng(0), distance=(4.0, 5.0)).truth
    depth = joints[..., 2] - joints[..., 2].mean(axis=1, keepdims=True)
    middles = [(depth[:, list(a)].mean(axis=1) + depth[:, list(b)].mean(axis=1)) / 2 for a, b in DIMENSIONS]
    share = DEPTH_RELIEF / np.std(middles, axis=1)
    assert (share > 0.5).all() and (share < 0.9).all()
