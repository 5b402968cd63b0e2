"""Noise on the image points: what is kept, what refinement makes of it, how sure it is, and what it costs.

    python benchmarks/refinement.py [--views 200] [--truths 4000] [--capture CAPTURE.npz --frames 300]

Random legal postures seen from 2.5 to 6 m with f = 1500 px. The neck is given, exactly or with a deviation of 10 cm
along its ray. Three ways to grow the tree: with the fixed tolerances for measured points, with tolerances derived from
the noise, and on trunks found first. Its leaves are refined, those that the noise cannot explain rejected at 1e-3, and
those that became one merged; with exact necks by `Refiner` itself, whose survivors have also passed the checks.
Those are counted for all ranges. With a capture the same is asked of real motion, whose lengths are uncertain.
Prints Markdown tables.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2 as chi2_distribution

from posekit.body import Figure, LengthUncertainty, load_figure
from posekit.body.uncertainty import MEASURED_LENGTHS
from posekit.formats.markdown import table_lines
from posekit.recovery import recover
from posekit.recovery.noise import Noise
from posekit.recovery.recovered import recovered_with
from posekit.recovery.refiner import Refiner
from posekit.recovery.result import result_of
from posekit.refinement import (
    ObservedFrames,
    RootPrior,
    Trunks,
    find_trunks,
    merge,
    refine,
    tolerance_of,
    under_noise,
)
from posekit.settings import MEASURED_TOLERANCE, RIGID_TOLERANCE, Tolerance
from posekit.skeleton import HEAD_POINTS, JOINTS, PARENTS, TREE_SEGMENTS, segment_name
from posekit.synthesis import SyntheticScene, mocap_scenes, random_views, read_capture
from posekit.tree import Check, InterpretationTree
from posekit.validators import PHYSICAL_CHECKS, Validator, load_ranges, make_checks
from posekit.views.builtin import view_of

NEAR_METRES = 0.035
"""Metres of mean joint error within which a survivor counts as near the truth."""

NOISE_PIXELS = (0.5, 1.0, 2.0, 5.0)
ROOT_DEPTH = 0.1
HOPELESS_CHI2 = 60.0
MOST_LEAVES = 350_000
VIEWS_PER_POSTURE_INSIDE = {"urdf": 1, "table1": 60, "anatomical": 10}
"""Ranges, and of how many random views about one or more are inside them."""

CONTACT_METRES = -0.03
"""Metres: what bodies may overlap under noise."""

Leaves = tuple[NDArray[np.intp], np.ndarray]
Way = Callable[[ObservedFrames, float], Leaves]


def lengths_of(figure: Figure) -> np.ndarray:
    return np.array([0.0, *(figure.lengths[segment_name(segment)] for segment in TREE_SEGMENTS)])


def checks_of(figure: Figure, tolerance: Tolerance, contact: float) -> list[Check]:
    return make_checks(
        figure,
        PHYSICAL_CHECKS,
        ranges=load_ranges("urdf"),
        rigid_tolerance=tolerance.rigid,
        rigid_mode="distances",
        angle_tolerance=tolerance.angle,
        contact_margin=contact,
    )


def depth_of(sight: ObservedFrames) -> float:
    assert sight.root is not None
    return float(sight.root.mean[:, 2].max())


def grow(sight: ObservedFrames, tolerance: Tolerance, contact: float) -> Leaves:
    """Grow trees from the noisy points."""
    assert sight.root is not None
    tree = InterpretationTree(joints=JOINTS, parents=PARENTS, lengths=lengths_of(sight.figure))
    leaves = tree.grow(
        sight.camera,
        sight.root.mean,
        sight.points(),
        checks_of(sight.figure, tolerance, contact),
        tolerance=tolerance.tangent,
    )
    return leaves.frame.astype(np.intp), leaves.postures()


def fixed(sight: ObservedFrames, _: float) -> Leaves:
    return grow(sight, MEASURED_TOLERANCE, 0.0)


def derived(sight: ObservedFrames, pixels: float) -> Leaves:
    allowed = tolerance_of(
        pixels, sight.camera, sight.figure, depth_of(sight), root_depth_deviation=root_deviation(sight)
    )
    tolerance = Tolerance(
        rigid=allowed.rigid, tangent=allowed.tangent, placement=False, angle=min(allowed.angle, 180.0)
    )
    return grow(sight, tolerance, CONTACT_METRES)


def on_trunks(sight: ObservedFrames, pixels: float, trunks: Trunks | None = None) -> Leaves:
    """Grow trees on trunks that were found first, as `Refiner` does, where the neck is known as it cannot say."""
    trunks = find_trunks(sight) if trunks is None else trunks
    allowed = tolerance_of(
        pixels,
        sight.camera,
        sight.figure,
        depth_of(sight),
        root_depth_deviation=root_deviation(sight),
        trunks=True,
    )
    tolerance = Tolerance(rigid=allowed.rigid, tangent=allowed.tangent, placement=False, angle=1.0)
    tree = InterpretationTree(joints=JOINTS, parents=PARENTS, lengths=trunks.tree_lengths(sight.figure))
    leaves = tree.grow(
        sight.camera,
        trunks.root,
        trunks.image,
        under_noise(checks_of(sight.figure, tolerance, CONTACT_METRES), allowed.bound),
        tolerance=tolerance.tangent,
    )
    postures = leaves.postures()
    own = trunks.carries(leaves.frame, postures)
    return trunks.frame[leaves.frame[own]], postures[own]


def root_deviation(sight: ObservedFrames) -> float:
    assert sight.root is not None
    return float(np.sqrt(np.linalg.eigvalsh(sight.root.covariance).max()))


@dataclass
class Outcome:
    """What became of the truth in F frames."""

    leaves: float
    leaves_near: float
    empty: float
    refined_near: float
    explained: float
    merged: float
    kept_near: float
    median_error: float

    def row(self) -> list[str]:
        return [
            f"{self.empty:.1%}",
            f"{self.leaves:.0f}",
            f"{self.leaves_near:.1%}",
            f"{self.refined_near:.1%}",
            f"{self.explained:.0f}",
            f"{self.merged:.0f}",
            f"{self.kept_near:.1%}",
            f"{self.median_error * 1000:.0f}",
        ]


TABLE_HEAD = (
    "frames without a posture",
    "leaves, median",
    "within 3.5 cm",
    "refined: within 3.5 cm",
    "explained by noise, median",
    "merged, median",
    "kept: within 3.5 cm",
    "best kept, median error, mm",
)


def best(frame: NDArray[np.intp], joints: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Return the mean joint error of each frame's best posture, metres; infinite where there is none."""
    error = np.linalg.norm(joints - truth[frame], axis=-1).mean(axis=1)
    out = np.full(len(truth), np.inf)
    np.minimum.at(out, frame, error)
    return out


def outcome(sight: ObservedFrames, leaves: Leaves, truth: np.ndarray) -> Outcome:
    frame, postures = leaves
    n = len(truth)
    refined = refine(sight, postures, frame=frame, hopeless=HOPELESS_CHI2)
    explained = refined.explained()
    merged = merge(refined, keep=explained).refined
    kept = best(merged.frame, merged.joints, truth)
    return Outcome(
        leaves=float(np.median(np.bincount(frame, minlength=n))),
        leaves_near=float((best(frame, postures, truth) < NEAR_METRES).mean()),
        empty=float((np.bincount(merged.frame, minlength=n) == 0).mean()),
        refined_near=float((best(frame, refined.joints, truth) < NEAR_METRES).mean()),
        explained=float(np.median(np.bincount(frame[explained], minlength=n))),
        merged=float(np.median(np.bincount(merged.frame, minlength=n))),
        kept_near=float((kept < NEAR_METRES).mean()),
        median_error=float(np.median(kept[np.isfinite(kept)])) if np.isfinite(kept).any() else np.inf,
    )


def by_refiner(scene: SyntheticScene, image: np.ndarray, pixels: float, lengths: float | None) -> Outcome:
    """Do what `posekit.recover` does with exact necks, and look at each stage; survivors have passed all checks."""
    view = replace(
        view_of(replace(scene, image=image)),
        deviation=pixels,
        root=scene.joints_cam[:, 0],
        head_image=np.full((len(scene), len(HEAD_POINTS), 2), np.nan),
    )
    grower = recover(view, figure=scene.figure, length_deviation=lengths).grower
    assert grower is not None
    known = MEASURED_LENGTHS if lengths is None else LengthUncertainty.uniform(lengths)
    refiner = Refiner(grower=grower, noise=Noise(deviation=pixels, lengths=known))
    lifted = refiner.lift(np.arange(len(view)))
    frame, postures, truth = lifted.frame[lifted.hypothesis], lifted.leaves.postures(), scene.joints_cam
    refined = refine(lifted.seen.sight, postures, frame=lifted.hypothesis, hopeless=HOPELESS_CHI2)
    sifted = refiner.refine(lifted)
    kept = frame[sifted.kept], sifted.survivors.joints
    n, near = len(view), best(*kept, truth)
    return Outcome(
        leaves=float(np.median(np.bincount(frame, minlength=n))),
        leaves_near=float((best(frame, postures, truth) < NEAR_METRES).mean()),
        empty=float((np.bincount(kept[0], minlength=n) == 0).mean()),
        refined_near=float((best(frame, refined.joints, truth) < NEAR_METRES).mean()),
        explained=float(np.median(np.bincount(frame[sifted.explained], minlength=n))),
        merged=float(np.median(np.bincount(kept[0], minlength=n))),
        kept_near=float((near < NEAR_METRES).mean()),
        median_error=float(np.median(near[np.isfinite(near)])),
    )


def legal(ranges: str, views: int) -> SyntheticScene:
    """Return random views whose true postures are inside some ranges, heads too."""
    scene = random_views(load_figure(), views * VIEWS_PER_POSTURE_INSIDE[ranges], np.random.default_rng(0))
    validator = Validator(ranges=ranges, checks=("joint-range",), strict=True)
    verdicts = np.array(validator.check(scene.joints_cam, scene.head_cam).verdicts)
    return scene.select(np.flatnonzero(verdicts == "valid")[:views])


def certificates(views: int) -> None:
    print("\nCertificates: what `validate` says of `recover`'s survivors, exact necks and lengths\n")
    rows = []
    for ranges in VIEWS_PER_POSTURE_INSIDE:
        scene = legal(ranges, views)
        for pixels in NOISE_PIXELS:
            view = view_of(scene.with_noise(pixels, np.random.default_rng(1)))
            view = replace(view, deviation=pixels, root=scene.joints_cam[:, 0])
            start = time.process_time()
            recovery = recover(view, ranges=ranges, length_deviation=0.0)
            spent = time.process_time() - start
            judged = recovered_with(result_of(recovery)).settings
            validator = Validator(settings=judged, ranges=ranges, rigid_tolerance=RIGID_TOLERANCE)
            counts = [len(frame) for frame in recovery.frames]
            joints = np.concatenate([frame.joints for frame in recovery.frames])
            near = best(np.repeat(np.arange(len(scene)), counts), joints, scene.joints_cam)
            rows.append(
                [
                    ranges,
                    f"{pixels:g}",
                    f"{len(scene)}",
                    f"{(near < NEAR_METRES).mean():.1%}",
                    f"{(np.array(counts) == 0).mean():.1%}",
                    f"{len(joints)}",
                    f"{validator.check(joints).verdicts.count('invalid')}",
                    f"{spent / len(scene) * 1000:.1f}",
                ]
            )
    head = (
        "ranges",
        "noise, px",
        "views",
        "within 3.5 cm",
        "frames without a posture",
        "survivors",
        "invalid by `validate`",
        "CPU, ms a frame",
    )
    print("\n".join(table_lines(head, rows)))


def root_prior(scene: SyntheticScene, depth: float, rng: np.random.Generator) -> RootPrior:
    neck = scene.joints_cam[:, 0]
    ray = neck / np.linalg.norm(neck, axis=1, keepdims=True)
    mean = neck + depth * rng.standard_normal(len(neck))[:, None] * ray
    return RootPrior.along_ray(scene.camera, mean, depth=depth)


def retention(views: int) -> None:
    print("\nWhat is kept: random legal postures, exact lengths\n")
    scene = random_views(load_figure(), views, np.random.default_rng(0))
    rows = []
    for pixels in NOISE_PIXELS:
        image = scene.with_noise(pixels, np.random.default_rng(1)).image
        for name, depth in (("exact", 0.0), ("10 cm", ROOT_DEPTH)):
            root = root_prior(scene, depth, np.random.default_rng(2))
            sight = ObservedFrames(
                figure=scene.figure, camera=scene.camera, image=image, deviation=pixels, root=root
            )
            for label, way in (("fixed", fixed), ("derived", derived), ("on trunks", on_trunks)):
                if way is on_trunks and not depth:
                    row = by_refiner(scene, image, pixels, 0.0).row()
                    rows.append([f"{pixels:g}", name, label, *row])
                    continue
                leaves = way(sight, pixels)
                if len(leaves[0]) > MOST_LEAVES:
                    near = (best(*leaves, scene.joints_cam) < NEAR_METRES).mean()
                    count = np.median(np.bincount(leaves[0], minlength=views))
                    rows.append([f"{pixels:g}", name, label, "-", f"{count:.0f}", f"{near:.1%}", *["-"] * 5])
                    continue
                rows.append([f"{pixels:g}", name, label, *outcome(sight, leaves, scene.joints_cam).row()])
            truth = refine(sight, scene.joints_cam)
            error = np.linalg.norm(truth.joints - scene.joints_cam, axis=-1).mean(axis=1)
            cells = ["-", "1", "100.0%", f"{(error < NEAR_METRES).mean():.1%}", "1", "1", "-"]
            rows.append([f"{pixels:g}", name, "from the truth", *cells, f"{np.median(error) * 1000:.0f}"])
    print("\n".join(table_lines(["noise, px", "neck", "tree", *TABLE_HEAD], rows)))


def calibration(truths: int) -> None:
    print("\nHow sure: true postures refined from themselves\n")
    scene = random_views(load_figure(), truths, np.random.default_rng(3))
    rows = []
    for pixels in NOISE_PIXELS:
        seen = scene.with_noise(pixels, np.random.default_rng(4))
        root = root_prior(scene, 0.0, np.random.default_rng(5))
        sight = ObservedFrames(
            figure=scene.figure, camera=scene.camera, image=seen.image, deviation=pixels, root=root
        )
        refined = refine(sight, scene.joints_cam)
        off = refined.joints - scene.joints_cam
        covariance = refined.covariance[:, 6:]
        square = np.linalg.solve(covariance + 1e-12 * np.eye(3), off[:, 6:, :, None])[..., 0]
        inside = (np.einsum("nji,nji->nj", square, off[:, 6:]) < chi2_distribution.ppf(0.95, 3)).mean()
        rows.append(
            [
                f"{pixels:g}",
                *(f"{(refined.p < level).mean():.2%}" for level in (1e-3, 1e-2, 1e-1, 0.5)),
                f"{np.sqrt((off**2).sum(axis=-1).mean()) * 1000:.1f}",
                f"{np.sqrt((refined.deviation**2).mean()) * 1000:.1f}",
                f"{inside:.1%}",
                f"{refined.converged.mean():.1%}",
                f"{refined.steps.mean():.1f}",
            ]
        )
    head = [
        "noise, px",
        "p < 0.001",
        "p < 0.01",
        "p < 0.1",
        "p < 0.5",
        "joint error, rms, mm",
        "stated, rms, mm",
        "limb joints in their 95 % ellipsoid",
        "converged",
        "steps, mean",
    ]
    print("\n".join(table_lines(head, rows)))


def timed(run: Callable[[], object], repeats: int = 3) -> float:
    run()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        run()
        times.append(time.process_time() - start)
    return min(times)


def cost(views: int) -> None:
    print("\nWhat it costs: CPU time, ratios to growing the tree on noisy points with fixed tolerances\n")
    scene = random_views(load_figure(), views, np.random.default_rng(6))
    rows = []
    for pixels in NOISE_PIXELS:
        image = scene.with_noise(pixels, np.random.default_rng(7)).image
        root = root_prior(scene, 0.0, np.random.default_rng(8))
        sight = ObservedFrames(
            figure=scene.figure, camera=scene.camera, image=image, deviation=pixels, root=root
        )
        base = timed(lambda sight=sight: fixed(sight, 0.0))  # type: ignore[misc]
        wide = timed(lambda sight=sight, pixels=pixels: derived(sight, pixels))  # type: ignore[misc]
        trunks = find_trunks(sight)
        frame, postures = on_trunks(sight, pixels, trunks)
        refined = refine(sight, postures, frame=frame, hopeless=HOPELESS_CHI2)
        explained = refined.explained()
        kept = merge(refined, keep=explained).refined
        parts = (
            timed(lambda sight=sight: find_trunks(sight)),  # type: ignore[misc]
            timed(lambda sight=sight, pixels=pixels, trunks=trunks: on_trunks(sight, pixels, trunks)),  # type: ignore[misc]
            timed(lambda s=sight, p=postures, f=frame: refine(s, p, frame=f, hopeless=HOPELESS_CHI2)),  # type: ignore[misc]
            timed(lambda r=refined, k=explained: merge(r, keep=k)),  # type: ignore[misc]
            timed(lambda r=kept: replace(r).covariance),  # type: ignore[misc]
        )
        each = parts[2] / max(len(frame), 1)
        rows.append(
            [
                f"{pixels:g}",
                f"{len(frame) / views:.0f}",
                f"{wide / base:.2f}",
                *(f"{part / base:.2f}" for part in parts),
                f"{(sum(parts[:4])) / base:.2f}",
                f"{base / views * 1e6:.0f}",
                f"{each * 1e6:.0f}",
            ]
        )
    head = [
        "noise, px",
        "leaves a frame",
        "derived tree",
        "trunks",
        "tree on trunks",
        "refine",
        "merge",
        "covariances of the kept",
        "all but covariances",
        "fixed tree, us a frame",
        "refine, us a leaf",
    ]
    print("\n".join(table_lines(head, rows)))


def beside_exact(views: int) -> None:
    print("\nA noisy frame beside an exact one: CPU time of `recover`, necks given, ratios in one run\n")
    rows = []
    for ranges in VIEWS_PER_POSTURE_INSIDE:
        scene = legal(ranges, views)

        def spent(seen: SyntheticScene, ranges: str = ranges, **known: float) -> float:
            view = view_of(seen)
            unseen = np.full_like(view.head_image, np.nan)
            view = replace(view, root=seen.joints_cam[:, 0], head_image=unseen, **known)  # type: ignore[arg-type]
            return timed(lambda: recover(view, ranges=ranges)) / len(seen)

        base = spent(scene)
        for pixels in NOISE_PIXELS:
            noisy = scene.with_noise(pixels, np.random.default_rng(7))
            each, alone = (
                spent(part, deviation=pixels, length_deviation=0.02) / base
                for part in (noisy, noisy.select(np.arange(1)))
            )
            rows.append([ranges, f"{pixels:g}", f"{base * 1e6:.0f}", f"{each:.0f}", f"{alone:.0f}"])
    head = [
        "ranges",
        "noise, px",
        "exact frame, us",
        "noisy frame, times that",
        "one frame a call, times that",
    ]
    print("\n".join(table_lines(head, rows)))


def real(capture: Path, frames: int) -> None:
    print("\nReal motion: lengths are each clip's medians, with deviations\n")
    scenes = mocap_scenes(read_capture(capture), frames, np.random.default_rng(0))
    rows = []
    for pixels in NOISE_PIXELS:
        for label in ("fixed", "on trunks"):
            total = []
            for k, scene in enumerate(scenes):
                image = scene.with_noise(pixels, np.random.default_rng(10 + k)).image
                if label == "on trunks":
                    total.append((len(scene), by_refiner(scene, image, pixels, None)))
                    continue
                sight = ObservedFrames(
                    figure=scene.figure,
                    camera=scene.camera,
                    image=image,
                    deviation=pixels,
                    root=root_prior(scene, 0.0, np.random.default_rng(2)),
                    length_deviation=MEASURED_LENGTHS.own,
                )
                total.append((len(scene), outcome(sight, fixed(sight, pixels), scene.joints_cam)))
            weight = np.array([count for count, _ in total]) / sum(count for count, _ in total)
            fields = [[*vars(result).values()] for _, result in total]
            rows.append([f"{pixels:g}", label, *Outcome(*(weight @ np.array(fields)).tolist()).row()])
    print("\n".join(table_lines(["noise, px", "tree", *TABLE_HEAD], rows)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--views", type=int, default=200)
    parser.add_argument("--truths", type=int, default=4000)
    parser.add_argument("--capture", type=Path)
    parser.add_argument("--frames", type=int, default=300)
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    retention(given.views)
    certificates(given.views)
    calibration(given.truths)
    cost(given.views)
    beside_exact(given.views)
    if given.capture is not None:
        real(given.capture, given.frames)


if __name__ == "__main__":
    main()
