"""Views of real motion capture whose survivors are ranked, and priors that know some of the clips only.

What `benchmarks/ranking.py` measures: each frame is seen by a virtual camera of its own; image points are exact or
noisy, the root given or placed, survivors as they come from the tree or refined.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.studies.prior_fitting import DEFAULT_TEMPERATURE, fit_prior
from posekit.body import Figure
from posekit.body.uncertainty import MEASURED_LENGTHS
from posekit.errors import InputError
from posekit.formats.own import View
from posekit.ranking import Depth, Prior, deviation_of_noise, deviation_of_tolerance
from posekit.recovery import recover
from posekit.refinement import ObservedFrames, RootPrior, merge, refine
from posekit.settings import MEASURED_TOLERANCE, Rooting, Tolerance
from posekit.synthesis import Capture, SyntheticScene, mocap_scenes
from posekit.validators import load_ranges
from posekit.validators.anatomical_plausibility import plausibility
from posekit.views.builtin import view_of

CHECK_NAMES = ("rigid-parts", "joint-range", "collision")
PRIOR_SOURCE = (
    "CMU Graphics Lab Motion Capture Database, mocap.cs.cmu.edu, created with funding from NSF EIA-0196217, free to "
    "use: 16 clips of one skeleton (basketball, signals, directing traffic, jumping, running, soccer, walking), each "
    "clip counting the same, left and right exchanged; fitted by benchmarks/ranking.py"
)
BEFORE_REFINEMENT = Tolerance(rigid=0.05, tangent=0.03, placement=False, angle=5.0)
ROOT_GIVES, HOPELESS = 0.01, 60.0
"""Deviation of a given root, m, and the chi2 beyond which a survivor is given up."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Clip:
    """The survivors of one clip's views, with the truth."""

    index: int
    joints: NDArray[np.float64]
    frame: NDArray[np.intp]
    length_residual: NDArray[np.float64]
    lengths: Mapping[str, float]
    truth: NDArray[np.float64]
    up: NDArray[np.float64]
    deviation: NDArray[np.float64]
    depth: Depth | None
    chi2: NDArray[np.float64] | None
    plausibility: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Views:
    """Survivors of one kind of views, clip by clip, and what they are off."""

    name: str
    clips: tuple[Clip, ...]
    seconds: float
    error: list[NDArray[np.float64]] = field(default_factory=list)
    centred: list[NDArray[np.float64]] = field(default_factory=list)
    nearest: list[NDArray[np.intp]] = field(default_factory=list)

    def __post_init__(self) -> None:
        for clip in self.clips:
            true = clip.truth[clip.frame]
            self.error.append(np.linalg.norm(clip.joints - true, axis=-1).mean(axis=1))
            middle = (true - clip.joints).mean(axis=1, keepdims=True)
            self.centred.append(np.linalg.norm(clip.joints + middle - true, axis=-1).mean(axis=1))
            by_error = np.lexsort((self.error[-1], clip.frame))
            starts = by_error[np.diff(clip.frame[by_error], prepend=-1) != 0]
            nearest = np.full(len(clip.truth), -1)
            nearest[clip.frame[starts]] = starts
            self.nearest.append(nearest)

    def __len__(self) -> int:
        return sum(len(clip.joints) for clip in self.clips)


def views_of(
    capture: Capture,
    ranges: str,
    noise: float,
    views: int,
    seed: int,
    *,
    placed: bool = False,
    refined: bool = False,
) -> Views:
    rng = np.random.default_rng(seed)
    scenes = mocap_scenes(capture, views, rng)
    table = load_ranges("anatomical")
    clips, seconds = [], 0.0
    for index, scene in enumerate(scenes):
        view = view_of(scene.with_noise(noise, rng) if noise else scene)
        tolerance: Tolerance | None = MEASURED_TOLERANCE
        if placed:
            view, tolerance = replace(view, root=np.full_like(view.root, np.nan)), None
        elif refined:
            tolerance = BEFORE_REFINEMENT
        start = time.perf_counter()
        rooting = Rooting(deviation=noise) if placed else None
        try:
            recovery = recover(view, checks=CHECK_NAMES, ranges=ranges, tolerance=tolerance, rooting=rooting)
        except InputError as error:  # noise may show a segment longer than it is
            print(f"clip {index} is left out: {error}")
            continue
        seconds += time.perf_counter() - start
        placements = [frame.placement for frame in recovery.frames]
        pixel = scene.joints_cam[:, 0, 2] / float(scene.camera.K[0, 0])
        deviation = deviation_of_noise(noise, pixel)
        depth = None
        if placed:
            found = [(p.tolerance, p.estimate, p.deviation) for p in placements if p is not None]
            deviation, estimate, spread = np.array(found).T
            deviation, depth = deviation_of_tolerance(deviation), Depth(estimate=estimate, deviation=spread)
        joints = np.concatenate([frame.joints for frame in recovery.frames])
        frames = np.repeat(np.arange(len(scene)), [len(frame) for frame in recovery.frames])
        residual = np.concatenate([frame.length_residual for frame in recovery.frames])
        chi2 = None
        if refined:
            joints, chi2 = _refined(recovery.figure, scene, view, joints, frames, noise)
            known = np.isfinite(joints).all(axis=(1, 2)) & np.isfinite(chi2)
            joints, chi2, frames, residual = joints[known], chi2[known], frames[known], residual[known]
        angles = recovery.figure.configurations(joints).q[:, recovery.figure.angle_index]
        assert table.anatomy is not None
        clips.append(
            Clip(
                index=index,
                joints=joints,
                frame=frames,
                length_residual=residual,
                lengths=recovery.figure.lengths,
                truth=scene.joints_cam,
                up=scene.R_cam_world @ capture.up,
                deviation=deviation,
                depth=depth,
                chi2=chi2,
                plausibility=plausibility(angles, table.anatomy).sum(axis=1),
            )
        )
    name = f"{ranges}, {f'{noise:g} px' if noise else 'exact'}{', placed root' if placed else ''}"
    name += ", refined" if refined else ""
    return Views(name=name, clips=tuple(clips), seconds=seconds)


def _refined(
    figure: Figure,
    scene: SyntheticScene,
    view: View,
    joints: NDArray[np.float64],
    frame: NDArray[np.intp],
    noise: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Refine survivors: their joints, and chi2; NaN for those that noise cannot explain or that became another."""
    root = RootPrior.along_ray(scene.camera, view.root, depth=ROOT_GIVES, lateral=ROOT_GIVES)
    sight = ObservedFrames(
        figure=figure,
        camera=scene.camera,
        image=view.image,
        deviation=noise,
        root=root,
        length_deviation=MEASURED_LENGTHS.own,
    )
    found = refine(sight, joints, frame=frame, hopeless=HOPELESS)
    kept = np.zeros(len(found), dtype=np.bool_)
    kept[merge(found, keep=found.explained()).rows] = True
    return np.where(kept[:, None, None], found.joints, np.nan), found.chi2


class Priors:
    """Priors that do not know some groups of clips; a group is an action, or a clip."""

    def __init__(
        self, capture: Capture, groups: Sequence[str], temperature: float = DEFAULT_TEMPERATURE
    ) -> None:
        known = np.isfinite(capture.points[:, :14]).all(axis=(1, 2))
        self.points, self.clip = capture.points[known, :14], capture.clip[known]
        self.share = 1.0 / np.bincount(self.clip)[self.clip]
        self.up, self.groups = capture.up, np.array(groups)
        self.temperature = temperature
        self.made: dict[frozenset[str], Prior] = {}

    def without(self, *groups: str) -> Prior:
        key = frozenset(groups)
        if key not in self.made:
            rows = ~np.isin(self.groups[self.clip], groups)
            self.made[key] = fit_prior(
                self.points[rows],
                self.up,
                self.share[rows],
                temperature=self.temperature,
                source=PRIOR_SOURCE,
            )
        return self.made[key]
