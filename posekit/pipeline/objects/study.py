"""How many flips of a robot survive, and how many survivors have a configuration: random postures, exact views."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.errors import InputError
from posekit.files import ScaledOrthographicModel
from posekit.files.object_view import ObjectView
from posekit.pipeline.objects.articulated import ArticulatedObject
from posekit.pipeline.objects.recover import recover_object
from posekit.pipeline.scale import Scale
from posekit.robot import Robot
from posekit.robot.configuration_space import ConfigurationSpace
from posekit.robot.kinematics import Kinematics, body_points

PIXELS = 500.0
"""Pixels a metre in the views."""

FOUND = 1e-5
"""Metres, of the object's longest segment, within which a survivor is the truth."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ObjectStudy:
    """What became of N views.

    Parameters
    ----------
    flips : int
        Leaves of the tree before pruning, at one scale.
    survivors, certified, mirrored : int array (N,)
        Postures, those with a configuration, and those whose mirror image is among them.
    found, sure : bool array (N,)
        Whether the truth is among the survivors, and among the certified.
    """

    flips: int
    survivors: NDArray[np.int64]
    certified: NDArray[np.int64]
    mirrored: NDArray[np.int64]
    found: NDArray[np.bool_]
    sure: NDArray[np.bool_]


def study_object(
    thing: ArticulatedObject, *, count: int = 200, seed: int = 0, scale: Scale | None = None
) -> ObjectStudy:
    """Recover random configurations within the limits of a robot, seen from random directions.

    Parameters
    ----------
    thing : ArticulatedObject
        With a robot.
    count, seed : int
    scale : Scale, optional
        How the scale is found; known unless told otherwise.

    Raises
    ------
    InputError
        Where the object has no robot.
    """
    if thing.robot is None:
        raise InputError(
            f"linkage {thing.linkage.name} has no robot to draw configurations of; give one with urdf"
        )
    q = draw_configurations(thing.robot, count, np.random.default_rng(seed))
    kinematics = Kinematics(model=thing.robot.model, points=body_points(thing.linkage.points))
    truth = kinematics.positions(q)
    view = ObjectView(
        points=thing.linkage.points,
        camera=ScaledOrthographicModel(scale=PIXELS),
        time=np.arange(count, dtype=np.float64),
        image=truth[..., :2] * PIXELS,
        truth=truth,
    )
    result = recover_object(view, thing, scale=scale)
    depth = truth[:, :1] * np.array([0.0, 0.0, 1.0])
    near = FOUND * float(thing.working.lengths.max())
    right = [
        np.linalg.norm(frame.points - goal, axis=-1).max(axis=1, initial=0.0) <= near
        for frame, goal in zip(result.frames, truth - depth, strict=True)
    ]
    sure = [np.array(frame.certified, dtype=bool) for frame in result.frames]
    return ObjectStudy(
        flips=1 << (len(thing.linkage.points) - 1),
        survivors=np.array([len(frame) for frame in result.frames]),
        certified=np.array([verdicts.sum() for verdicts in sure]),
        mirrored=np.array([frame.family.mirrored if frame.family else 0 for frame in result.frames]),
        found=np.array([hits.any() for hits in right]),
        sure=np.array([(hits & verdicts).any() for hits, verdicts in zip(right, sure, strict=True)]),
    )


def draw_configurations(robot: Robot, count: int, rng: np.random.Generator) -> Array:
    """Draw configurations (N, nq): joints evenly within their limits, within one turn at most; the base any way round.

    Parameters
    ----------
    robot : Robot
        Free-flying.
    count : int
    rng : numpy.random.Generator
    """
    space = ConfigurationSpace(robot.model)
    q = np.tile(pin.neutral(robot.model), (count, 1))
    for at in space.bounded_q:
        lower, upper = max(space.lower[at], -math.pi), min(space.upper[at], math.pi)
        q[:, at] = rng.uniform(min(lower, upper), upper, count)
    for at in space.turn_q:
        angle = rng.uniform(-np.pi, np.pi, count)
        q[:, at], q[:, at + 1] = np.cos(angle), np.sin(angle)
    for at in space.free_q:
        turned = rng.standard_normal((count, 4))
        q[:, at + 3 : at + 7] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
    return q


def study_lines(name: str, study: ObjectStudy) -> list[str]:
    """Write a study as rows of a Markdown table: name, flips, survivors, truth, certified, mirror pairs."""
    N = len(study.survivors)
    share = study.certified.sum() / max(study.survivors.sum(), 1)
    return [
        f"| {name} | {study.flips:,} | {np.median(study.survivors):g} | {np.percentile(study.survivors, 95):g} "
        f"| {study.survivors.max()} | {study.found.sum()} of {N} | {study.sure.sum()} of {N} | {100 * share:.1f} % "
        f"| {(study.mirrored > 0).sum()} of {N} |"
    ]
