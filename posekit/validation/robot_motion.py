"""A robot's configurations over time: where its joints are, and how fast they move."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.formats.held import HeldPostures
from posekit.formats.held_postures import held_configurations
from posekit.formats.own.postures_q import NamedConfigurations
from posekit.geometry import Array
from posekit.robots.configuration_space import ConfigurationSpace
from posekit.robots.joint_map import postures_of
from posekit.robots.kinematics import BodyPoint, BodySite, Kinematics
from posekit.skeleton import FEET_POINTS, POINTS, SIDES
from posekit.validators import Validator
from posekit.validators.robot.feet import find_soles


def placed(validator: Validator, configurations: NamedConfigurations) -> HeldPostures:
    """Place the joints of configurations by the model that judges them, so that ground and feet can be judged.

    Parameters
    ----------
    validator : Validator
        Of the figure or robot whose configurations they are. Of a robot without joint map no joint is known.
    configurations : NamedConfigurations
        As a file has them.

    Raises
    ------
    InputError
        Where they are not that robot's.
    """
    names = validator.configuration_names
    if validator.robot is None:
        return held_configurations(configurations, names, of_known(validator.figure.forward_kinematics))
    kinematics = validator.kinematics
    if kinematics is None:
        return held_configurations(configurations, names, _nowhere)
    whole = with_soles(kinematics, validator.robot.geometry)
    return held_configurations(configurations, names, of_known(partial(_with_feet, kinematics, whole)))


def of_known(positions: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """Return forward kinematics that place nothing where a configuration holds NaN.

    Parameters
    ----------
    positions : callable
        From q (N, nq), finite, to points (N, P, 3).
    """

    def place(q: Array) -> Array:
        known = ~np.isnan(q).any(axis=1)
        if known.all():
            return positions(q)
        some = positions(q[known])
        points = np.full((len(q), *some.shape[1:]), np.nan)
        points[known] = some
        return points

    return place


@lru_cache(maxsize=4)
def with_soles(kinematics: Kinematics, geometry: pin.GeometryModel | None) -> Kinematics:
    """Return what places a robot's points and, where it has both feet, those of its soles after them."""
    feet = soles(kinematics, geometry)
    return kinematics if feet is None else replace(kinematics, points=kinematics.points + feet.points)


def soles(kinematics: Kinematics, geometry: pin.GeometryModel | None) -> Kinematics | None:
    """Return what places toes and heels, in the order of `FEET_POINTS`: the middles of a sole's two ends.

    Parameters
    ----------
    kinematics : Kinematics
        The robot's points by its joint map.
    geometry : pinocchio.GeometryModel or None
        Its bodies; soles of a person's size are made up where there are none.

    Returns
    -------
    Kinematics or None
        None where the robot has not both feet.
    """
    model, data = kinematics.model, kinematics.model.createData()
    pin.forwardKinematics(model, data, kinematics.neutral)
    ankles = {
        side: kinematics.names.index(f"{side}_ankle") for side in SIDES if f"{side}_ankle" in kinematics.names
    }
    if len(ankles) < len(SIDES):
        return None
    at = kinematics.positions(kinematics.neutral[None])[0]
    hips = {
        side: at[kinematics.names.index(f"{side}_hip")] for side in SIDES if f"{side}_hip" in kinematics.names
    }
    if len(hips) < len(SIDES):
        return None
    forward = np.cross(hips["left"] - hips["right"], hips["left"] - at[ankles["left"]])
    corners = find_soles(kinematics, geometry)
    places = np.array([data.oMi[one.joint].act(np.asarray(one.place)) for one in corners]).reshape(-1, 3)
    ends: dict[str, list[BodySite]] = {point: [] for point in FEET_POINTS}
    for side in SIDES:
        apart = {one: np.linalg.norm(places - at[place], axis=1) for one, place in ankles.items()}
        mine = np.flatnonzero(apart[side] == np.min(list(apart.values()), axis=0))
        if len(mine) < 2:
            return None
        along = places[mine] @ forward
        for k, reach in zip(mine, along, strict=True):
            x, y, z = (float(value) for value in corners[k].place)
            site = BodySite(frame=model.names[corners[k].joint], offset=(x, y, z))
            ends[f"{side}_{'toe' if reach > along.mean() else 'heel'}"].append(site)
    if not all(ends.values()):
        return None
    points = tuple(BodyPoint(name=name, sites=tuple(sites)) for name, sites in ends.items())
    return Kinematics(model=model, points=points)


def moves_of(
    model: pin.Model | None, q: Array, time: NDArray[np.float64], names: tuple[str, ...]
) -> dict[str, Any]:
    """Return what a clip has of a robot: its configurations, velocities (T, nv) and their limits (nv,).

    A frame's velocity is that of the step to it, on the manifold of the configurations; NaN in the first, and where its
    time is not known or not after the one before, or a number of the two is not known.

    Parameters
    ----------
    model : pinocchio.Model or None
        The robot's; nothing is said where there is none.
    q : array (T, nq)
        Of one clip.
    time : array (T,)
        Seconds.
    names : tuple of str
        The names of its joints in Pinocchio's order, the free-flyer first.
    """
    if model is None or not q.size:
        return {}
    velocity = np.full((len(q), model.nv), np.nan)
    step = np.diff(time)
    known = np.asarray(np.isfinite(q).all(axis=1))
    ahead = np.flatnonzero((step > 0) & known[:-1] & known[1:])
    if len(ahead):
        moved = ConfigurationSpace(model).difference(q[ahead], q[ahead + 1])
        velocity[ahead + 1] = moved / step[ahead, None]
    called = [""] * model.nv
    for joint, name in enumerate(names, 1):
        for k in range(model.nvs[joint]):
            called[model.idx_vs[joint] + k] = name if model.nvs[joint] == 1 else f"{name}.{k}"
    limits = np.array(model.velocityLimit, dtype=np.float64)
    return {"q": q, "velocity": velocity, "velocity_limits": limits, "velocity_names": tuple(called)}


def _with_feet(kinematics: Kinematics, whole: Kinematics, q: Array) -> Array:
    points, own = whole.positions(q), len(kinematics.points)
    return np.concatenate([postures_of(points[:, :own], kinematics), points[:, own:]], axis=1)


def _nowhere(q: Array) -> Array:
    return np.full((len(q), len(POINTS), 3), np.nan)
