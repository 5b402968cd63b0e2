"""What `sequences.py` looks at: walkers and motion capture from all sides, recovered with and without noise."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from benchmarks.studies.people_prior import action_of, prior_of_people
from posekit.body import Figure
from posekit.errors import PosekitError
from posekit.following import SurvivorFrame, best_paths
from posekit.formats.own import OpenCVModel, View
from posekit.ranking import Prior, RankingEvidence, Up, load_prior, rank
from posekit.recovery import recover
from posekit.refinement import (
    ObservedFrames,
    RootPrior,
    find_trunks,
    merge,
    refine,
    tolerance_of,
    under_noise,
)
from posekit.skeleton import JOINTS, PARENTS, SEGMENT_NAMES, SEGMENTS
from posekit.synthesis import CameraPlacements, Capture, SyntheticScene, Walker, mocap_scene
from posekit.synthesis.camera_sphere import CameraSphere
from posekit.synthesis.observe import observe
from posekit.synthesis.viewpoints import look_at
from posekit.tree import InterpretationTree
from posekit.validators import PHYSICAL_CHECKS, load_ranges, make_checks

CAMERA_HEIGHT_METRES = 1.4
FRAMES_PER_SECOND = 30.0
N_FRAMES = 60
CAMERA_DISTANCES_METRES = (4.0, 5.0, 6.0, 7.0, 8.0, 10.0)
STATED_EDGES = (0.5, 0.6, 0.75, 0.9, 0.99, 1.01)
OTHER_CLIPS = ("basketball_1", "basketball_signal_1", "jumping_1", "jumping_2", "soccer_1", "soccer_2")
FIRST_FRAMES = {"basketball_signal_1": 200}
"""Frame that a clip is taken from; else the second, since the first is the rest posture."""

TRUNK_LENGTHS, LIMB_LENGTHS = 0.04, 0.01
"""Relative deviations of lengths of real bodies."""

CONTACT_METRES = -0.03
HOPELESS_CHI2 = 60.0
PLACED_DEVIATION_METRES = 0.06
"""Metres that survivors are off where the neck was placed: so far apart are the places."""


def walker_scene(yaw: float, frames: int = N_FRAMES, distance: float = 5.0) -> SyntheticScene:
    """Let the walker pass a standing camera."""
    walker, sphere = Walker(), CameraSphere()
    at = np.arange(frames) / FRAMES_PER_SECOND
    q = walker.configurations(walker.phase(at, 0.1))
    q[:, :3] += walker.travel(at, 0.1)
    points = walker.figure.forward_kinematics(q)
    middle = (points.min(axis=(0, 1)) + points.max(axis=(0, 1))) / 2
    position = middle + distance * np.array([math.cos(math.radians(yaw)), 0.0, math.sin(math.radians(yaw))])
    R = look_at(position, middle, np.array([0.0, 1.0, 0.0]))
    return observe(
        walker.figure,
        sphere.camera,
        points,
        CameraPlacements(np.broadcast_to(R, (frames, 3, 3)), np.broadcast_to(position, (frames, 3))),
        time=at,
        size=sphere.size,
        labels=("synthetic walking",) * frames,
    )


def clip_scene(capture: Capture, clip: str, yaw: float) -> SyntheticScene:
    """See a clip from a side: 0 is from ahead, 90 from its right."""
    index = capture.clip_index(clip)
    first = FIRST_FRAMES.get(clip.rsplit("/", maxsplit=1)[-1], 1)
    rows = capture.frames_of(index)[first : first + N_FRAMES]
    part = replace(
        capture,
        points=capture.points[rows].copy(),
        clip=np.zeros(len(rows), dtype=np.intp),
        names=(clip,),
        actions=(capture.actions[index],),
        fps=capture.fps[index : index + 1].copy(),
    )
    way = part.points.reshape(-1, 3)
    middle = (np.nanmin(way, axis=0) + np.nanmax(way, axis=0)) / 2
    right = part.points[0, JOINTS.index("right_hip")] - part.points[0, JOINTS.index("left_hip")]
    right = right - (right @ part.up) * part.up
    right /= np.linalg.norm(right)
    ahead = np.cross(part.up, right)
    error: PosekitError | None = None
    for distance in CAMERA_DISTANCES_METRES:
        side = math.cos(math.radians(yaw)) * ahead + math.sin(math.radians(yaw)) * right
        position = middle + distance * side
        position += (CAMERA_HEIGHT_METRES - position @ part.up) * part.up
        try:
            return mocap_scene(part, clip, np.random.default_rng(0), position=position)
        except PosekitError as found:
            error = found
    assert error is not None
    raise error


def scenes(capture: Capture | None, yaws: int) -> Iterator[tuple[str, str, int, SyntheticScene]]:
    for yaw in range(0, 360, 60):
        yield "synthetic walking", "", yaw, walker_scene(yaw)
    if capture is None:
        return
    for clip, action in zip(capture.names, capture.actions, strict=True):
        if action in ("walking", "running"):
            for yaw in range(0, 360, 360 // yaws):
                yield action, clip, yaw, clip_scene(capture, clip, yaw)
        elif clip.split("/")[-1] in OTHER_CLIPS:
            for yaw in (20, 200):
                yield "other", clip, yaw, clip_scene(capture, clip, yaw)


def view_of(scene: SyntheticScene, figure: Figure, *, rooted: bool = True) -> View:
    return View(
        camera=OpenCVModel(K=scene.camera.K),
        time=scene.time,
        image=scene.image,
        root=scene.joints_cam[:, 0] if rooted else np.full((len(scene), 3), np.nan),
        lengths=dict(figure.lengths),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Recovered:
    """A sequence with its survivors, which cost nothing yet, and what ranks them."""

    frames: list[SurvivorFrame]
    evidence: Callable[[Prior], np.ndarray]

    def ranked(self, prior: Prior) -> list[SurvivorFrame]:
        """Let survivors cost minus the logarithm of their probability."""
        cost = -np.log(np.maximum(self.evidence(prior), 1e-300))
        parts = np.split(cost, np.cumsum([len(frame) for frame in self.frames])[:-1])
        return [replace(frame, cost=each) for frame, each in zip(self.frames, parts, strict=True)]


def exact(scene: SyntheticScene, *, rooted: bool = True) -> Recovered:
    """Recover exact points, with the neck given or placed."""
    found = recover(view_of(scene, scene.figure, rooted=rooted)).frames
    joints = np.concatenate([frame.joints for frame in found])
    index = np.repeat(np.arange(len(found)), [len(frame) for frame in found])

    def evidence(prior: Prior) -> np.ndarray:
        return rank(
            RankingEvidence.of(
                joints,
                scene.figure.lengths,
                frame=index,
                length_residual=np.concatenate([frame.length_residual for frame in found]),
                deviation=0.001 if rooted else 0.012,
                up=Up.level(),
            ),
            prior=prior,
        ).probability

    frames = [
        SurvivorFrame(
            time=frame.time,
            joints=frame.joints,
            deviation=np.full(frame.joints.shape[:2], 0.0 if rooted else PLACED_DEVIATION_METRES),
            branches=frame.branches,
        )
        for frame in found
    ]
    return Recovered(frames=frames, evidence=evidence)


def noisy(scene: SyntheticScene, pixels: float, *, real: bool) -> Recovered:
    """Recover noisy points: on trunks, refined, merged (docs, "Noise")."""
    figure = scene.figure
    deviation = {
        name: TRUNK_LENGTHS if max(pair) < 6 else LIMB_LENGTHS
        for name, pair in zip(SEGMENT_NAMES, SEGMENTS, strict=True)
    }
    sight = ObservedFrames(
        figure=figure,
        camera=scene.camera,
        image=scene.image,
        deviation=pixels,
        root=RootPrior.along_ray(scene.camera, scene.joints_cam[:, 0], depth=1e-3),
        length_deviation=deviation if real else 0.0,
    )
    trunks = find_trunks(sight)
    allowed = tolerance_of(
        pixels,
        scene.camera,
        figure,
        float(scene.joints_cam[..., 2].max()),
        length_deviation=LIMB_LENGTHS if real else 0.0,
        trunks=True,
    )
    rigid = 0.5 * TRUNK_LENGTHS if real else allowed.rigid
    checks = make_checks(
        figure,
        PHYSICAL_CHECKS,
        ranges=load_ranges("urdf"),
        rigid_tolerance=rigid,
        rigid_mode="distances",
        angle_tolerance=1.0,
        contact_margin=CONTACT_METRES,
    )
    tree = InterpretationTree(joints=JOINTS, parents=PARENTS, lengths=trunks.tree_lengths(figure))
    leaves = tree.grow(
        scene.camera, trunks.root, trunks.image, under_noise(checks, allowed.bound), tolerance=allowed.tangent
    )
    postures = leaves.postures()
    own = trunks.carries(leaves.frame, postures)
    refined = refine(sight, postures[own], frame=trunks.frame[leaves.frame[own]], hopeless=HOPELESS_CHI2)
    kept = merge(refined, keep=refined.explained()).refined
    spread = kept.covariance

    def evidence(prior: Prior) -> np.ndarray:
        return rank(
            RankingEvidence.of(kept.joints, frame=kept.frame, chi2=kept.chi2, up=Up.level()), prior=prior
        ).probability

    frames = [
        SurvivorFrame(time=float(at), joints=kept.joints[kept.frame == k], covariance=spread[kept.frame == k])
        for k, at in enumerate(scene.time)
    ]
    return Recovered(frames=frames, evidence=evidence)


def survivors_of(frames: list[SurvivorFrame], path: np.ndarray) -> np.ndarray:
    """Return the joints (T, 14, 3) of the survivors along a path; NaN where it is bridged."""
    return np.stack(
        [
            frame.joints[chosen] if chosen >= 0 else np.full((len(JOINTS), 3), np.nan)
            for frame, chosen in zip(frames, path.tolist(), strict=True)
        ]
    )


def odds_of_two(frames: list[SurvivorFrame], truth: np.ndarray, apart: float) -> Iterator[tuple[float, bool]]:
    """Yield how sure the first of two paths is that are so far apart (m), and whether it is the nearer; or nothing."""
    paths = best_paths(frames, k=2, apart=apart)
    if len(paths) == 2:
        # Where their survivors differ: what is expected along both is smooth, and differs less.
        one, other = (survivors_of(frames, path) for path in paths.survivor)
        differ = np.linalg.norm(one - other, axis=-1).max(axis=1) > apart
        off = [np.linalg.norm(joints - truth, axis=-1)[differ].mean() for joints in (one, other)]
        yield 1 / (1 + math.exp(paths.cost[0] - paths.cost[1])), bool(off[0] < off[1])


def odds_table(odds: Sequence[tuple[float, bool]]) -> tuple[list[str], list[list[str]]]:
    """Return the head and the rows of a table: how often the first of two paths is the nearer, by what is stated."""
    rows = []
    for low, high in pairwise(STATED_EDGES):
        part = [pair for pair in odds if low <= pair[0] < high]
        if part:
            said, came = np.mean(part, axis=0)
            rows.append([f"{low:g} to {min(high, 1):g}", str(len(part)), f"{said:.2f}", f"{came:.2f}"])
    return ["stated", "pairs", "mean", "nearer"], rows


class Priors:
    """Priors on postures that were fitted to what is not judged by them; the built-in one where there is no capture.

    Parameters
    ----------
    capture : Capture or None
        What is judged.
    beside : sequence of Capture
        Other sources that priors know too, but for the action that is held out.
    """

    def __init__(self, capture: Capture | None, beside: Sequence[Capture] = ()) -> None:
        self.capture, self.beside = capture, beside
        self.known: dict[tuple[str, str], Prior] = {}

    def without(self, kind: str, name: str) -> Prior:
        """Fit a prior without a clip, or without all clips of its action."""
        if self.capture is None or name not in self.capture.names:
            return load_prior()
        action = action_of(self.capture.actions[self.capture.clip_index(name)])
        key = (kind, action if kind == "action" else name)
        if key not in self.known:
            every = [self.capture, *self.beside]
            labels = [list(zip(one.names, map(action_of, one.actions), strict=True)) for one in every]
            known = [np.array([key[1] not in label for label in part]) for part in labels]
            self.known[key] = prior_of_people(every, known)
        return self.known[key]
