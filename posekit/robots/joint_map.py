"""Joint maps: the frames of a model that represent the 14 joints, from a file or from the model's joint names."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import pinocchio as pin

from posekit.errors import nearest, shown
from posekit.files import read_table
from posekit.robots.kinematics import Site
from posekit.robots.urdf import need
from posekit.skeleton import POINTS, SIDES

SCHEMA: Final = "posekit.joint_map/1"
#: Joint maps that come with posekit, in the order in which `find_joint_map` tries them.
BUILT_IN: Final = ("stick_figure", "human", "human_gazebo", "simple_humanoid", "g1", "talos")

#: Site of each mapped point on a robot, by the point's name, in the order of `posekit.skeleton.POINTS`.
JointMap = Mapping[str, Site]


def load_joint_map(name: str | Path, model: pin.Model) -> JointMap:
    """Load the joint map of a model by name (one of `BUILT_IN`) or from a TOML file.

    Raises
    ------
    InputError
        If there is no such map, the map does not follow ``posekit.joint_map/1``, or the model lacks one of its frames.
    """
    found = dict[str, Site]()
    # If a joint and a link have the same name, the link is used.
    links_last = sorted(enumerate(model.frames), key=lambda one: one[1].type == pin.FrameType.BODY)
    frames = {frame.name: frame for _, frame in links_last}
    for point, (frame, offset) in _places(str(name)).items():
        remedy = nearest(str(frame), list(frames)[:1000])
        need(name, frame in frames, f"points.{point}", shown(frame), "a frame of the model", remedy)
        at = frames[frame]
        found[point] = Site(at.parentJoint, at.placement.act(np.array(offset, dtype=np.float64)))
    return {point: found[point] for point in POINTS if point in found}


def find_joint_map(model: pin.Model) -> JointMap:
    """Return the first built-in map whose frames the model has, or else a map derived from the names of its joints.

    The map is empty if the model is not a humanoid.
    """
    for name in BUILT_IN:
        if all(model.existFrame(frame) for frame, _ in _places(name).values()):
            return load_joint_map(name, model)
    return _derived(model)


def _derived(model: pin.Model) -> JointMap:
    """Derive a map from the names of the moving joints; empty if an elbow, a knee, a shoulder or a hip is missing.

    If several robot joints form a shoulder or a hip, the middle one is used, because all their axes pass near it.
    Elbows, wrists, knees and ankles use the joint nearest to the root. The neck is the midpoint of the shoulders, fixed
    to the body that carries both arms. The pelvis is the origin of the body that carries both legs.
    """
    words = read_table("names", "joint_maps", ("names",), "posekit.joint_names/1", "joint map")
    chains: dict[str, list[int]] = {}
    for joint in range(1, model.njoints):
        name = str(model.names[joint])
        side = next((side for side in SIDES if re.search(words["sides"][side], name)), None)
        lower = f"{name.lower()}_"
        part = next((part for part, some in words["parts"].items() if re.search(some, lower)), None)
        if side and part and model.nvs[joint] == 1:
            chains.setdefault(f"{side}_{part}", []).append(joint)
    if not all(f"{side}_{part}" in chains for side in SIDES for part in ("shoulder", "elbow", "hip", "knee")):
        return {}
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    points = {
        name: Site(joints[len(joints) // 2 if name.endswith(("shoulder", "hip")) else 0], np.zeros(3))
        for name, joints in chains.items()
    }
    for name, part in (("neck", "shoulder"), ("pelvis", "hip")):
        carriers = (set(model.supports[chains[f"{side}_{part}"][0]]) for side in SIDES)
        carrier = max(set.intersection(*carriers))
        middle = sum(data.oMi[points[f"{side}_{part}"].joint].translation for side in SIDES) / 2
        points[name] = Site(carrier, data.oMi[carrier].actInv(middle) if name == "neck" else np.zeros(3))
    return {point: points[point] for point in POINTS if point in points}


@lru_cache(maxsize=16)
def _places(name: str) -> dict[str, tuple[Any, Any]]:
    """Read the frame of each point of a joint map, and the point's offset in that frame, metres."""
    places, given = {}, read_table(name, "joint_maps", BUILT_IN, SCHEMA, "joint map").get("points")
    for point, place in (given if isinstance(given, dict) else {"points": given}).items():
        need(name, point in POINTS, "points", shown(point), "a joint's name", nearest(point, POINTS))
        entry: dict[str, Any] = place if isinstance(place, dict) else {"frame": place}
        frame, offset = entry.get("frame"), entry.get("offset", [0.0, 0.0, 0.0])
        ok = isinstance(offset, list) and len(offset) == 3
        ok = ok and all(isinstance(value, int | float) and np.isfinite(value) for value in offset)
        expected = "a frame, or a frame and three finite offsets in metres"
        need(name, ok and isinstance(frame, str), f"points.{point}", shown(place), expected, "correct it")
        places[point] = frame, offset
    return places
