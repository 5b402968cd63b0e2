"""Bodies whose size is not known: laws of the size, and of what refinement makes of it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from posekit.body import LengthUncertainty, load_figure
from posekit.body.uncertainty import KNOWN_STATURE, MEASURED_LENGTHS, STATED_LENGTHS, UNKNOWN_ADULT
from posekit.errors import InputError
from posekit.recovery import recover
from posekit.refinement import ObservedFrames, RootPrior, find_trunks, refine
from posekit.refinement.size import size_of
from posekit.settings.recover import MAX_LENGTH_DEVIATION
from posekit.skeleton import SEGMENT_NAMES
from posekit.synthesis import SyntheticScene, random_views
from posekit.views.builtin import view_of

FIGURE = load_figure()
FRAMES = 12


@pytest.fixture(scope="module")
def scene() -> SyntheticScene:
    return random_views(FIGURE, FRAMES, np.random.default_rng(15), ranges="urdf")


def sight(scene: SyntheticScene, size: float, own: float = 0.01) -> ObservedFrames:
    return ObservedFrames(
        figure=scene.figure,
        camera=scene.camera,
        image=scene.image,
        deviation=0.5,
        root=RootPrior.along_ray(scene.camera, scene.joints_cam[:, 0], depth=0.0),
        length_deviation=own,
        size_deviation=size,
    )


def smaller(scene: SyntheticScene, factor: float) -> SyntheticScene:
    """The same pictures and necks, taken for those of a person whose lengths are those times a factor."""
    figure = FIGURE.scaled({name: length * factor for name, length in FIGURE.lengths.items()})
    return dataclasses.replace(scene, figure=figure)


@pytest.mark.parametrize("factor", [0.9, 1.0, 1.1])
def test_a_body_of_another_size_is_found_where_it_is(scene: SyntheticScene, factor: float) -> None:
    """From the truth's own branch the refined posture is the truth, whatever size it was taken for."""
    taken = smaller(scene, factor)
    necks = scene.joints_cam[:, :1]
    start = necks * factor + (scene.joints_cam - necks) * factor
    refined = refine(sight(taken, 0.05, own=0.0), start)
    assert refined.size is not None
    np.testing.assert_allclose(refined.size.factor, 1 / factor, rtol=2e-3)
    np.testing.assert_allclose(refined.joints[:, 0], scene.joints_cam[:, 0], atol=1e-3)
    assert np.linalg.norm(refined.joints - scene.joints_cam, axis=2).max() < 0.02


def test_no_uncertainty_is_the_limit_of_a_small_one(scene: SyntheticScene) -> None:
    exact = refine(sight(scene, 0.0, own=0.0), scene.joints_cam)
    for size in (1e-5, 1e-7):
        near = refine(sight(scene, size, own=0.0), scene.joints_cam)
        assert np.abs(near.joints - exact.joints).max() < 100 * size
        np.testing.assert_allclose(near.covariance, exact.covariance, rtol=1e-2, atol=1e-6)


def test_a_known_neck_has_no_share_in_the_doubt_of_the_size(scene: SyntheticScene) -> None:
    refined = refine(sight(scene, 0.1, own=0.0), scene.joints_cam)
    of_neck = np.sqrt(np.trace(refined.covariance[:, 0], axis1=1, axis2=2))
    assert of_neck.max() < 0.01
    assert refined.size is not None
    assert (refined.size.deviation < 1e-6).all()


def test_a_neck_that_the_size_placed_tells_nothing_of_it(scene: SyntheticScene) -> None:
    necks = scene.joints_cam[:, 0]
    placed = dataclasses.replace(
        RootPrior.along_ray(scene.camera, necks, depth=0.01), by_size=np.ones(FRAMES, dtype=np.bool_)
    )
    size = size_of(necks * 1.1, placed, np.arange(FRAMES), 0.05)
    np.testing.assert_array_equal(size.factor, 1.0)
    np.testing.assert_array_equal(size.deviation, 0.05)
    refined = refine(dataclasses.replace(sight(scene, 0.05), root=placed), scene.joints_cam)
    far = np.linalg.norm(necks, axis=1)
    assert (np.sqrt(np.trace(refined.covariance[:, 0], axis1=1, axis2=2)) > 0.05 * far).all()


def test_a_doubtful_neck_and_a_doubtful_size_share_what_they_differ_by(scene: SyntheticScene) -> None:
    """Two normal densities of the same width meet in the middle."""
    necks = scene.joints_cam[:, 0]
    far = np.linalg.norm(necks, axis=1)
    prior = RootPrior.along_ray(scene.camera, necks, depth=0.05 * far)
    size = size_of(necks / 1.1, prior, np.arange(FRAMES), 0.05)
    np.testing.assert_allclose(np.log(size.factor), np.log(1.1) / 2)
    np.testing.assert_allclose(size.deviation, 0.05 / np.sqrt(2))


def test_trunks_of_other_sizes_are_found(scene: SyntheticScene) -> None:
    for factor in (0.9, 1.1):
        taken = smaller(scene, factor)
        found = find_trunks(sight(taken, 0.05))
        true = scene.joints_cam[:, :6] * factor
        near = [
            np.linalg.norm(found.joints[found.frame == k] - true[k], axis=2).max(axis=1).min(initial=np.inf)
            for k in range(FRAMES)
        ]
        assert np.median(near) < 0.05
        assert max(near) < np.inf


@pytest.mark.parametrize("factor", [0.9, 0.95, 1.05, 1.1])
@pytest.mark.parametrize("pixels", [0.0, 2.0])
def test_lengths_that_are_off_empty_no_frame(scene: SyntheticScene, factor: float, pixels: float) -> None:
    seen = scene.with_noise(pixels, np.random.default_rng(1)) if pixels else scene
    lengths = {name: length * factor for name, length in FIGURE.lengths.items()}
    view = dataclasses.replace(
        view_of(seen), root=scene.joints_cam[:, 0], lengths=lengths, deviation=pixels or None
    )
    recovery = recover(view, ranges="urdf")
    assert min(map(len, recovery.frames)) > 0
    best = [
        np.linalg.norm(frame.joints - truth, axis=2).mean(axis=1).min()
        for frame, truth in zip(recovery.frames, scene.joints_cam, strict=True)
    ]
    assert np.median(best) < 0.05
    if factor < 1 and pixels:
        held = recover(view, length_deviation=0.0, ranges="urdf")
        assert sum(not len(frame) for frame in held.frames) > FRAMES / 2


@pytest.mark.filterwarnings("ignore:frames.*root is:UserWarning", "ignore:head point neck does not fit")
@pytest.mark.parametrize("factor", [0.9, 1.0, 1.1])
@pytest.mark.parametrize("seen", [1, 5])
def test_a_head_that_nobody_measured_empties_no_frame(
    scene: SyntheticScene, factor: float, seen: int
) -> None:
    """A stranger's nose is not where the figure's is, nor is the neck on which it hangs."""
    head = scene.head_cam + np.array([0.04, -0.05, 0.04])
    points = scene.with_noise(1.0, np.random.default_rng(2))
    image = np.full((FRAMES, 5, 2), np.nan)
    image[:, :seen] = scene.camera.project(head)[:, :seen]
    lengths = {name: length * factor for name, length in FIGURE.lengths.items()}
    root = scene.joints_cam[:, 0]
    view = dataclasses.replace(view_of(points), root=root, lengths=lengths, head_image=image)
    assert min(map(len, recover(view, ranges="urdf").frames)) > 0


def test_a_view_that_says_exact_is_taken_at_its_word(scene: SyntheticScene) -> None:
    view = dataclasses.replace(view_of(scene), root=scene.joints_cam[:, 0])
    plain, said = (
        recover(view, ranges="urdf"),
        recover(dataclasses.replace(view, length_deviation=0.0), ranges="urdf"),
    )
    for a, b in zip(plain.frames, said.frames, strict=True):
        assert a.judged == b.judged == "exact"
        np.testing.assert_array_equal(a.joints, b.joints)


def test_uncertainties_are_fractions_of_segments() -> None:
    for one in (MEASURED_LENGTHS, STATED_LENGTHS, UNKNOWN_ADULT, KNOWN_STATURE):
        assert not one.exact
        assert tuple(one.own) == SEGMENT_NAMES
        assert (np.linalg.eigvalsh(one.covariance) > 0).all()
    assert LengthUncertainty().exact
    assert LengthUncertainty.uniform(0.03).total("right_hip-right_knee") == pytest.approx(0.03 * np.sqrt(2))
    assert LengthUncertainty.uniform(0.0).exact
    for said in (1e-4, 0.01, 0.05, MAX_LENGTH_DEVIATION):
        own = LengthUncertainty.uniform(said).own
        assert min(own.values()) == said and max(own.values()) <= min(4 * said, MAX_LENGTH_DEVIATION)
        assert own["right_shoulder-pelvis"] == min(np.hypot(said, min(0.027, 3 * said)), MAX_LENGTH_DEVIATION)
    with pytest.raises(InputError, match="'shin' is not a segment"):
        LengthUncertainty(own={"shin": 0.1})
    for wrong in (-0.1, 0.4, float("nan")):
        with pytest.raises(InputError, match="expected a fraction of the length"):
            LengthUncertainty(common=wrong)
