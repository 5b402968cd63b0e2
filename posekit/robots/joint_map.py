"""Joint maps: which frames of a model stand for the 14 joints and the head's points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

import numpy as np
import pinocchio as pin

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.robots.kinematics import BodyPoint, BodySite, Kinematics, find_frame, frame_index
from posekit.safe_io import nearest, one_line
from posekit.skeleton import JOINTS, POINT, POINTS

if TYPE_CHECKING:
    from posekit.tables.joint_map import JointMapTable, MeanTable, SiteTable

JOINT_MAP_SCHEMA: Final = "posekit.joint_map/1"

BUILT_IN: Final = ("stick_figure", "human", "human_gazebo", "simple_humanoid", "g1", "talos")
"""The maps that come with the package, in the order in which they are tried."""


@dataclass(frozen=True, kw_only=True)
class JointMap:
    """Which places of a model stand for which points of a posture.

    Parameters
    ----------
    name : str
        What to call it in reports and errors.
    points : mapping
        Points of `posekit.skeleton.POINTS` that every such model has; joints that are in neither mapping are absent.
    optional : mapping
        Points that are left out where a model has not their frames.
    """

    name: str
    points: Mapping[str, BodyPoint]
    optional: Mapping[str, BodyPoint]

    @property
    def absent(self) -> tuple[str, ...]:
        """The joints that no such model has."""
        return tuple(joint for joint in JOINTS if joint not in self.points and joint not in self.optional)

    def missing(self, model: pin.Model) -> tuple[str, ...]:
        """List the frames that the map needs and a model has not."""
        frames = frame_index(model)
        needed = [site.frame for point in self.points.values() for site in point.sites]
        return tuple(dict.fromkeys(frame for frame in needed if frame not in frames))

    def kinematics(self, model: pin.Model) -> Kinematics:
        """Make the kinematics of the points that a model has, in the order of `posekit.skeleton.POINTS`.

        Raises
        ------
        InputError
            Where the model has not a frame that the map needs (the nearest names are given).
        """
        frames = frame_index(model)
        for name, point in self.points.items():
            for site in point.sites:
                find_frame(frames, site.frame, f"joint map {self.name!r}: {name}")
        chosen = dict(self.points)
        for name, point in self.optional.items():
            if all(site.frame in frames for site in point.sites):
                chosen[name] = point
        return Kinematics(model=model, points=tuple(chosen[name] for name in POINTS if name in chosen))


def targets_of(postures: Array, kinematics: Kinematics) -> Array:
    """Pick a model's points out of postures.

    Parameters
    ----------
    postures : array (N, 14, 3) or (N, 19, 3)
        Joints, and the head's points, metres; NaN is unknown.
    kinematics : Kinematics
        Its points are named after `posekit.skeleton.POINTS`: see `JointMap.kinematics`.

    Returns
    -------
    array (N, P, 3)
        In the order of the kinematics' points.

    Raises
    ------
    InputError
        Where postures have another shape, or a point is not of the skeleton.
    """
    if postures.ndim != 3 or postures.shape[1:] not in ((len(JOINTS), 3), (len(POINTS), 3)):
        raise InputError(
            f"postures have shape {postures.shape}; expected (N, {len(JOINTS)}, 3) or (N, {len(POINTS)}, 3)"
        )
    columns = [_point_index(name) for name in kinematics.names]
    padded = np.full((len(postures), len(POINTS), 3), np.nan)
    padded[:, : postures.shape[1]] = postures
    return padded[:, columns]


def postures_of(positions: Array, kinematics: Kinematics) -> Array:
    """Put a model's points (N, P, 3) into postures (N, 19, 3), NaN where it has none: `targets_of` backwards."""
    postures = np.full((len(positions), len(POINTS), 3), np.nan)
    postures[:, [_point_index(name) for name in kinematics.names]] = positions
    return postures


def load_joint_map(name: str | Path) -> JointMap:
    """Load a joint map by name (one of `BUILT_IN`) or from a TOML file.

    Raises
    ------
    InputError
        Where there is no such map, or it is not what `posekit.joint_map/1` says.
    """
    from posekit.tables.joint_map import JointMapTable
    from posekit.tables.reading import named_table

    return named_table(name, JointMapTable, joint_map_of, folder="joint_maps", what="joint map")


def find_joint_map(model: pin.Model) -> JointMap:
    """Choose the built-in map whose frames a model has.

    Raises
    ------
    InputError
        Where none fits: the one that comes nearest is named, with the frames that it misses.
    """
    maps = [load_joint_map(name) for name in BUILT_IN]
    missing = [joint_map.missing(model) for joint_map in maps]
    for joint_map, frames in zip(maps, missing, strict=True):
        if not frames:
            return joint_map
    share = [len(lost) / len(known.points) for lost, known in zip(missing, maps, strict=True)]
    best = int(np.argmin(share))
    lost = missing[best]
    tail = ", …" if len(lost) > 4 else ""
    raise InputError(
        one_line(
            f"model {model.name!r}: no built-in joint map fits; the nearest, {maps[best].name}, needs frames that it "
            f"has not: {', '.join(lost[:4])}{tail}; {nearest(lost[0], list(frame_index(model))[:1000])[:200]}; "
            f"write a joint map ({JOINT_MAP_SCHEMA}) that names the model's frames"
        )
    )


def joint_map_of(table: JointMapTable, name: str) -> JointMap:
    """Make a joint map of its table.

    Parameters
    ----------
    table : JointMapTable
        What a file says.
    name : str
        What reports and errors call the map.
    """
    points, optional = (
        MappingProxyType({point: _point(point, place) for point, place in places.items()})
        for places in (table.points, table.optional)
    )
    return JointMap(name=name, points=points, optional=optional)


def _point(name: str, place: SiteTable | MeanTable) -> BodyPoint:
    sites = (
        BodySite(
            frame=site.frame, offset=(site.offset[0], site.offset[1], site.offset[2]), weight=site.weight
        )
        for site in getattr(place, "mean", [place])
    )
    return BodyPoint(name=name, sites=tuple(sites))


def _point_index(name: str) -> int:
    if name not in POINT:
        raise InputError(f"point {name!r} is not of the skeleton; {nearest(name, POINTS)}")
    return POINT[name]
