"""Where a model's feet touch the ground: the corners of what it has below its ankles, or a rectangle of their size."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
import pinocchio as pin

from posekit.geometry import Array, cross
from posekit.robots.body_point import frame_index
from posekit.robots.kinematics import Kinematics
from posekit.skeleton import SIDES

LEG_SHARE: Final = 0.491
"""Hip to ankle as a share of stature (Drillis & Contini 1966, in Winter 2009, fig. 4.1: 0.245 + 0.246)."""

FOOT_LENGTH: Final = 0.152
FOOT_BREADTH: Final = 0.055
ANKLE_HEIGHT: Final = 0.039
"""The foot as shares of stature (the same source)."""

HEEL_SHARE: Final = 0.25
"""Share of the foot's length that lies behind the ankle: ours."""


class Corner(NamedTuple):
    """A corner of a sole: the joint of the body that carries it, and its place in that joint's frame, metres."""

    joint: int
    place: Array


def find_soles(kinematics: Kinematics, geometry: pin.GeometryModel | None) -> tuple[Corner, ...]:
    """Return the corners of both feet.

    With bodies below the ankles they are the corners of those bodies' boxes; else a rectangle under each ankle as
    long and broad as a person's with such legs, forward being across hips and shanks. None where the model has
    not both hips, knees and ankles.
    """
    needed = [f"{side}_{joint}" for side in SIDES for joint in ("hip", "knee", "ankle")]
    if any(name not in kinematics.names for name in needed):
        return ()
    below = [_below(kinematics, f"{side}_ankle") for side in SIDES]
    corners = [corner for joints in below for corner in _corners(geometry, joints)]
    if all(_corners(geometry, joints) for joints in below):
        return tuple(corners)
    return tuple(_made_up(kinematics))


def _below(kinematics: Kinematics, name: str) -> list[int]:
    """List the joint that carries a point, and all beyond it."""
    model = kinematics.model
    joint = _joint_of(kinematics, name)
    return [k for k in range(model.njoints) if joint in _chain(model, k)]


def _joint_of(kinematics: Kinematics, name: str) -> int:
    point = next(point for point in kinematics.points if point.name == name)
    return int(kinematics.model.frames[frame_index(kinematics.model)[point.sites[0].frame]].parentJoint)


def _chain(model: pin.Model, joint: int) -> list[int]:
    chain = [joint]
    while chain[-1] > 0:
        chain.append(int(model.parents[chain[-1]]))
    return chain


def _corners(geometry: pin.GeometryModel | None, joints: Sequence[int]) -> list[Corner]:
    corners = []
    for body in [] if geometry is None else geometry.geometryObjects:
        if body.parentJoint in joints:
            body.geometry.computeLocalAABB()
            box = body.geometry.aabb_local
            low, high = np.asarray(box.min_).ravel(), np.asarray(box.max_).ravel()
            grid = np.stack(np.meshgrid(*np.stack([low, high], axis=1), indexing="ij"), axis=-1).reshape(
                -1, 3
            )
            corners += [Corner(int(body.parentJoint), body.placement.act(place)) for place in grid]
    return corners


def _made_up(kinematics: Kinematics) -> list[Corner]:
    model = kinematics.model
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    at = dict(zip(kinematics.names, kinematics.positions(kinematics.neutral[None])[0], strict=True))
    corners = []
    for side in SIDES:
        hip, knee, ankle = (at[f"{side}_{joint}"] for joint in ("hip", "knee", "ankle"))
        stature = (np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee)) / LEG_SHARE
        up = (knee - ankle) / np.linalg.norm(knee - ankle)
        left = at["left_hip"] - at["right_hip"]
        forward = cross(left, up)
        forward /= np.linalg.norm(forward)
        aside = cross(up, forward)
        joint = _joint_of(kinematics, f"{side}_ankle")
        for along in (-HEEL_SHARE, 1.0 - HEEL_SHARE):
            for across in (-0.5, 0.5):
                place = ankle + stature * (
                    along * FOOT_LENGTH * forward + across * FOOT_BREADTH * aside - ANKLE_HEIGHT * up
                )
                corners.append(Corner(joint, data.oMi[joint].actInv(place)))
    return corners
