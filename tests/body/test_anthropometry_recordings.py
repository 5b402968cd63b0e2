"""Lengths from recordings: in space, and in the pictures of one camera."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate

from posekit.body import Figure, load_figure
from posekit.body.anthropometry import lengths_from_postures, lengths_from_proportions, lengths_from_views
from posekit.body.anthropometry.body import (
    BODY_DIMENSIONS,
    LIMB_PARTS,
    TRUNK_LENGTH,
    dimensions_of,
    lengths_of,
    limb,
)
from posekit.body.anthropometry.foreshortening import OUTLIER_SHARE, cosine_variance, log_density
from posekit.body.anthropometry.independent import independent_frames, unlike_neighbours
from posekit.errors import FigureError, InputError
from posekit.skeleton import JOINT, JOINTS, SEGMENT_NAMES, SIDES
from posekit.synthesis.random_postures import random_views
from posekit.synthesis.walker import Walker

LIMB_NAMES = tuple(limb(side, part) for part in LIMB_PARTS for side in SIDES)
INSIDE = [JOINT["neck"], JOINT["pelvis"]]


def somebody(seed: int, *, alike: bool = True) -> tuple[Figure, float]:
    """Make a person of other proportions than the tables', and their stature."""
    draw = np.random.default_rng(seed)
    dimensions = dimensions_of(lengths_from_proportions("drillis-contini", 1.75).lengths)
    for part in LIMB_PARTS:
        factors = np.exp(0.06 * draw.normal(size=2))
        for side, factor in zip(SIDES, factors[[0, 0]] if alike else factors, strict=True):
            dimensions[limb(side, part)] *= factor
    stack = sum(dimensions[limb(side, part)] for side in SIDES for part in ("thigh", "shank")) / 2
    stature = (stack + dimensions[TRUNK_LENGTH]) / (0.245 + 0.246 + 0.288)
    return load_figure().scaled(lengths_of(dimensions, dict(load_figure().lengths))), stature


def seen_from_everywhere(figure: Figure, frames: int, seed: int) -> np.ndarray:
    scene = random_views(figure, frames, np.random.default_rng(seed))
    image = scene.camera.project(scene.joints_cam)
    image[:, INSIDE] = np.nan
    return np.asarray(image)


def errors(found: dict[str, float], figure: Figure) -> np.ndarray:
    return np.array([found[name] / figure.lengths[name] - 1 for name in LIMB_NAMES])


# In space


@settings(deadline=None, max_examples=10)
@given(st.integers(0, 1000))
def test_a_rigid_recording_gives_its_lengths_back(seed: int) -> None:
    figure, _ = somebody(seed, alike=False)
    walk = figure.forward_kinematics(Walker(figure=figure).configurations(np.linspace(0, 1, 12)))
    found = lengths_from_postures(walk[:, : len(JOINTS)])
    assert dict(found.lengths.lengths) == pytest.approx(dict(figure.lengths), abs=1e-9)
    assert found.lengths.measured == SEGMENT_NAMES
    assert max(found.lengths.deviation.values()) < 1e-9 and set(found.frames.values()) == {12}
    load_figure().scaled(found.lengths.lengths)


def test_noise_and_outliers_are_allowed_for(rng: np.random.Generator) -> None:
    figure, _ = somebody(3)
    scene = random_views(figure, 400, rng, ranges="urdf")
    noisy = scene.joints_cam + 0.03 * rng.normal(size=scene.joints_cam.shape)
    noisy[::25, JOINT["left_wrist"]] += 5.0
    noisy[rng.random(noisy.shape[:2]) < 0.1] = np.nan
    found = lengths_from_postures(noisy)
    off = errors(dict(found.lengths.lengths), figure)
    # Noise of 3 cm lengthens a segment of 25 cm by 3 %; the likeliest length has it taken off.
    plain = np.linalg.norm(noisy[:, JOINT["right_elbow"]] - noisy[:, JOINT["right_wrist"]], axis=-1)
    assert np.nanmean(plain) / figure.lengths["right_elbow-right_wrist"] - 1 > 0.01
    assert np.abs(off).max() < 0.025
    scores = off * [figure.lengths[name] / found.lengths.deviation[name] for name in LIMB_NAMES]
    assert np.sqrt(np.mean(scores**2)) < 3
    assert found.spread["left_elbow-left_wrist"] == pytest.approx(0.042, rel=0.2)


def test_what_was_not_seen_follows_from_proportions() -> None:
    figure, stature = somebody(4, alike=False)
    walk = figure.forward_kinematics(Walker(figure=figure).configurations(np.linspace(0, 1, 9)))[
        :, : len(JOINTS)
    ]
    walk[:, INSIDE] = np.nan
    found = lengths_from_postures(walk)
    assert errors(dict(found.lengths.lengths), figure) == pytest.approx(0, abs=1e-9)
    assert "neck-pelvis" not in found.lengths.measured and "from proportions" in found.lengths.source
    # The torso's shape is the figure's, and its size was seen.
    assert found.lengths.lengths["neck-pelvis"] == pytest.approx(figure.lengths["neck-pelvis"], rel=0.01)
    load_figure().scaled(found.lengths.lengths)
    walk[:, JOINT["left_wrist"]] = np.nan
    for more in ({}, {"stature": stature}):
        found = lengths_from_postures(walk, **more)  # type: ignore[arg-type]
        guess = found.lengths.lengths["left_elbow-left_wrist"]
        assert guess == pytest.approx(figure.lengths["left_elbow-left_wrist"], rel=0.2)
        assert found.lengths.deviation["left_elbow-left_wrist"] == pytest.approx(0.058 * guess, rel=0.01)


@pytest.mark.parametrize(
    ("joints", "says"),
    [
        (np.zeros((3, 12, 3)), "shape"),
        (np.full((3, 14, 3), np.nan), "no frame"),
        (np.full((3, 14, 3), np.inf), "infinite"),
        (np.zeros((3, 14, 3)), "another unit"),
        (1000 * np.random.default_rng(0).normal(size=(3, 14, 3)), "another unit"),
        (np.empty((0, 14, 3)), "no frame"),
    ],
)
def test_recordings_of_nobody_are_refused(joints: np.ndarray, says: str) -> None:
    with pytest.raises(InputError, match=says):
        lengths_from_postures(joints)


# The model of a view


@pytest.mark.parametrize("concentration", [0.0, 6.0, -1.5])
@pytest.mark.parametrize("noise", [0.02, 0.1, 0.4])
def test_the_density_is_one(concentration: float, noise: float) -> None:
    x = np.linspace(0, 4, 40_001)
    density = np.exp(log_density(x, np.full_like(x, noise), concentration))
    tail = OUTLIER_SHARE * 2 / np.pi * (np.pi / 2 - np.arctan(4.0))
    assert np.trapezoid(density, x) + tail == pytest.approx(1, abs=0.004)


@pytest.mark.parametrize("noise", [0.03, 0.2])
def test_the_density_is_that_of_isotropic_directions(noise: float, rng: np.random.Generator) -> None:
    c = rng.uniform(0, 1, 400_000)
    x = np.abs(np.sqrt(1 - c * c) + noise * rng.normal(size=len(c)))
    counts, edges = np.histogram(x, np.linspace(0, 1.6, 33))
    middles = (edges[1:] + edges[:-1]) / 2
    fine = np.stack([middles - 0.0167, middles, middles + 0.0167])
    expected = np.exp(log_density(fine, np.full_like(fine, noise))).mean(axis=0)
    expected -= OUTLIER_SHARE * 2 / np.pi / (1 + middles**2)
    observed = (1 - OUTLIER_SHARE) * counts / len(c) / 0.05
    np.testing.assert_allclose(expected, observed, atol=0.06)


def test_missing_lengths_are_missing() -> None:
    assert np.isnan(log_density(np.array([0.5, np.nan]), np.full(2, 0.1))).tolist() == [False, True]


@pytest.mark.parametrize("concentration", [0.0, 4.0, -1.5])
def test_the_variance_of_a_squared_cosine(concentration: float) -> None:
    def weight(c: float) -> float:
        return float(np.exp(-concentration * c * c))

    total = integrate.quad(weight, 0, 1)[0]
    mean = integrate.quad(lambda c: c**2 * weight(c), 0, 1)[0] / total
    variance = integrate.quad(lambda c: (c**2 - mean) ** 2 * weight(c), 0, 1)[0] / total
    assert cosine_variance(concentration) == pytest.approx(variance, rel=1e-6)
    if concentration == 0:
        assert cosine_variance(0.0) == pytest.approx(4 / 45)


def test_frames_that_repeat_count_once(rng: np.random.Generator) -> None:
    isotropic = np.full(8, 4 / 45)
    still = np.full((400, 8), 0.3)
    fresh = rng.uniform(0, 1, (400, 8)) ** 2
    slow = np.repeat(fresh[:40], 10, axis=0)
    steps = np.tile(fresh[:40], (10, 1))
    # Noise makes frames differ that show the same direction, and so does a little turning.
    shaken = still + 0.02 * rng.normal(size=still.shape)
    swaying = still + 0.05 * np.sin(np.arange(400))[:, None]

    def count(squared_cosine: np.ndarray, noise: float = 0.0) -> float:
        found = independent_frames(squared_cosine, np.full_like(squared_cosine, noise), isotropic)
        return float(np.median(found))

    assert count(fresh) > 200
    assert count(still) == 1
    assert count(shaken, 4e-4) < 1.5
    assert count(swaying) < 1.5
    assert 15 < count(slow) <= 40
    assert 25 < count(steps) <= 40
    half = fresh.copy()
    half[:, 0] = 0.5
    found = independent_frames(half, np.zeros_like(half), isotropic)
    assert found[0] == 1 and found[1:].min() > 100
    assert independent_frames(np.full((5, 8), np.nan), np.zeros((5, 8)), isotropic).tolist() == [0] * 8


def test_the_order_of_frames_matters_to_neighbours_alone(rng: np.random.Generator) -> None:
    walk = np.cumsum(rng.normal(size=(500, 1)), axis=0)
    in_order, _ = unlike_neighbours(walk, np.zeros(1))
    shuffled, _ = unlike_neighbours(rng.permutation(walk), np.zeros(1))
    assert in_order[0] < 20 and shuffled[0] > 300


# Views


def test_views_beat_the_proportions() -> None:
    found, prior, scores = [], [], []
    for seed in range(3):
        figure, stature = somebody(seed)
        image = seen_from_everywhere(figure, 60, seed) + 2 * np.random.default_rng(seed).normal(
            size=(60, 14, 2)
        )
        views = lengths_from_views(image, stature=stature, proportions="drillis-contini", upright=False)
        table = lengths_from_proportions("drillis-contini", stature)
        found.append(errors(dict(views.lengths.lengths), figure))
        prior.append(errors(dict(table.lengths), figure))
        scores.append(
            [
                found[-1][k] * figure.lengths[name] / views.lengths.deviation[name]
                for k, name in enumerate(LIMB_NAMES)
            ]
        )
    assert np.median(np.abs(found)) < 0.6 * np.median(np.abs(prior))
    assert np.quantile(np.abs(found), 0.95) < 0.7 * np.quantile(np.abs(prior), 0.95)
    assert np.sqrt(np.mean(np.square(scores))) < 1.8


def test_a_figure_can_be_made_of_what_is_found() -> None:
    figure, stature = somebody(1)
    views = lengths_from_views(seen_from_everywhere(figure, 30, 1), stature=stature)
    assert set(views.lengths.lengths) == set(SEGMENT_NAMES)
    assert views.frames == 30 and 1 <= views.independent <= 30
    assert views.scale.shape == (30,) and (views.scale > 0).all()
    assert all(0 <= share <= 1 for share in views.learned.values())
    made = load_figure().scaled(views.lengths.lengths)
    assert dict(made.lengths) == pytest.approx(dict(views.lengths.lengths), abs=1e-9)
    for part in LIMB_PARTS:  # left and right are equal unless told otherwise
        assert views.lengths.lengths[limb("left", part)] == views.lengths.lengths[limb("right", part)]


def test_the_unit_of_the_picture_does_not_matter() -> None:
    figure, stature = somebody(2)
    image = seen_from_everywhere(figure, 30, 2)
    once = lengths_from_views(image, stature=stature)
    twice = lengths_from_views(2 * image + 100, stature=stature)
    assert dict(twice.lengths.lengths) == pytest.approx(dict(once.lengths.lengths), rel=1e-6)
    np.testing.assert_allclose(twice.scale, 2 * once.scale, rtol=1e-6)


def test_twelve_points_are_fourteen_without_neck_and_pelvis() -> None:
    figure, stature = somebody(2)
    image = seen_from_everywhere(figure, 20, 2)
    twelve = np.delete(image, INSIDE, axis=1)
    a = lengths_from_views(image, stature=stature).lengths.lengths
    assert dict(lengths_from_views(twelve, stature=stature).lengths.lengths) == dict(a)


def test_a_known_length_fixes_the_size() -> None:
    figure, stature = somebody(5)
    image = seen_from_everywhere(figure, 60, 5)
    known = {"right_hip-right_knee": figure.lengths["right_hip-right_knee"]}
    views = lengths_from_views(image, known=known, upright=False)
    assert views.lengths.lengths["right_hip-right_knee"] == pytest.approx(
        known["right_hip-right_knee"], rel=0.005
    )
    large = lengths_from_views(
        image, known={"right_hip-right_knee": 1.5 * known["right_hip-right_knee"]}, upright=False
    )
    ratio = large.lengths.lengths["left_elbow-left_wrist"] / views.lengths.lengths["left_elbow-left_wrist"]
    assert 1.3 < ratio < 1.55
    unsure = lengths_from_views(image, stature=stature, upright=False)
    assert views.lengths.deviation["left_hip-left_knee"] < unsure.lengths.deviation["left_hip-left_knee"]


def test_known_scales_need_no_stature() -> None:
    figure, _ = somebody(6)
    scene = random_views(figure, 80, np.random.default_rng(6))
    image = scene.camera.project(scene.joints_cam)
    f = float(scene.camera.K[0, 0])
    depth = scene.joints_cam[:, :, 2].mean(axis=1)
    scale = f / depth
    scale[3] = np.nan
    views = lengths_from_views(image, scale=scale, focal=f, upright=False)
    assert np.abs(errors(dict(views.lengths.lengths), figure)).max() < 0.09
    assert np.median(np.abs(errors(dict(views.lengths.lengths), figure))) < 0.045
    assert views.frames == 79 and np.isnan(views.scale[3])


def test_sides_can_be_told_apart() -> None:
    figure, stature = somebody(7)
    other = figure.scaled({"left_elbow-left_wrist": 0.85 * figure.lengths["left_elbow-left_wrist"]})
    image = seen_from_everywhere(other, 200, 7)
    lengths = lengths_from_views(image, stature=stature, both_sides=False, upright=False).lengths.lengths
    assert lengths["left_elbow-left_wrist"] < 0.97 * lengths["right_elbow-right_wrist"]


def test_a_still_person_is_left_to_the_proportions() -> None:
    figure, stature = somebody(8)
    still = np.repeat(seen_from_everywhere(figure, 1, 8), 200, axis=0)
    one = lengths_from_views(still, stature=stature)
    few = lengths_from_views(still[:2], stature=stature)
    assert one.independent < 2
    for name in LIMB_NAMES:
        assert one.lengths.lengths[name] == pytest.approx(few.lengths.lengths[name], rel=0.05)
        assert one.lengths.deviation[name] > 0.02 * one.lengths.lengths[name]


def test_missing_points_and_outliers_are_allowed_for(rng: np.random.Generator) -> None:
    figure, stature = somebody(9)
    image = seen_from_everywhere(figure, 80, 9)
    image[rng.random(image.shape[:2]) < 0.25] = np.nan
    image[::16, JOINT["left_ankle"]] += 900.0
    image[5] = np.nan
    views = lengths_from_views(image, stature=stature, proportions="drillis-contini", upright=False)
    assert np.isnan(views.scale[5]) and 70 <= views.frames <= 79
    assert np.abs(errors(dict(views.lengths.lengths), figure)).max() < 0.12
    image[:, [JOINT["left_wrist"], JOINT["right_wrist"]]] = np.nan
    views = lengths_from_views(image, stature=stature, proportions="drillis-contini", upright=False)
    forearm = "left_elbow-left_wrist"
    assert forearm not in views.lengths.measured and views.learned[forearm] < 0.05
    table = lengths_from_proportions("drillis-contini", stature).lengths[forearm]
    assert views.lengths.lengths[forearm] == pytest.approx(table, rel=0.02)


@pytest.mark.parametrize(
    ("image", "more", "says"),
    [
        (np.zeros((3, 13, 2)), {"stature": 1.8}, "shape"),
        (np.zeros((0, 14, 2)), {"stature": 1.8}, "shape"),
        (np.full((3, 14, 2), np.nan), {"stature": 1.8}, "no frame"),
        (np.full((3, 14, 2), np.inf), {"stature": 1.8}, "infinite"),
        (np.random.default_rng(0).random((3, 14, 2)), {"stature": 1.8}, "pixels"),
        (300 * np.random.default_rng(0).random((3, 14, 2)), {}, "fixes the size"),
        (300 * np.random.default_rng(0).random((3, 14, 2)), {"scale": np.ones(2)}, "one a frame"),
        (300 * np.random.default_rng(0).random((3, 14, 2)), {"scale": -np.ones(3)}, "positive"),
        (300 * np.random.default_rng(0).random((3, 14, 2)), {"stature": 1.8, "noise": -1.0}, "noise"),
        (300 * np.random.default_rng(0).random((3, 14, 2)), {"stature": 1.8, "noise": np.nan}, "noise"),
        (300 * np.random.default_rng(0).random((3, 14, 2)), {"stature": 1.8, "focal": 0.0}, "focal"),
        (
            300 * np.random.default_rng(0).random((3, 14, 2)),
            {"known": {"neck-pelvis": 0.5}},
            "limb or a width",
        ),
        (
            300 * np.random.default_rng(0).random((3, 14, 2)),
            {"known": {"right_hip-left_hip": -1.0}},
            "positive",
        ),
        (
            300 * np.random.default_rng(0).random((3, 14, 2)),
            {"stature": 1.8, "proportions": "x"},
            "known source",
        ),
    ],
)
def test_views_of_nothing_are_refused(image: np.ndarray, more: dict[str, object], says: str) -> None:
    with pytest.raises(InputError, match=says):
        lengths_from_views(image, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize("stature", [0.0, 180.0, np.nan])
def test_statures_of_nobody_are_refused(stature: float) -> None:
    with pytest.raises(FigureError, match="stature"):
        lengths_from_views(300 * np.random.default_rng(0).random((3, 14, 2)), stature=stature)


def test_random_points_do_no_harm() -> None:
    views = lengths_from_views(800 * np.random.default_rng(1).random((40, 14, 2)), stature=1.8)
    assert all(0.02 < length < 2 for length in views.lengths.lengths.values())


def test_dimensions_are_named_after_segments() -> None:
    assert set(BODY_DIMENSIONS) - {TRUNK_LENGTH} < set(SEGMENT_NAMES)
