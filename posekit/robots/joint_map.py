"""Joint maps: the frames of a model that stand for the 14 joints, from a file or from the model's own names."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import pinocchio as pin

from posekit.errors import nearest, refusal, shown
from posekit.files import DATA
from posekit.geometry import Array
from posekit.robots.kinematics import Site
from posekit.robots.urdf import need
from posekit.skeleton import POINTS, SIDES

SCHEMA: Final = "posekit.joint_map/1"
#: Maps of the package, in the order in which they are tried.
BUILT_IN: Final = ("stick_figure", "human", "human_gazebo", "simple_humanoid", "g1", "talos")

#: Words in names of joints, by part.
_PARTS: Final = {
    "shoulder": r"shoulder|upper_?arm|sho_|arm.?[12]_|shy|shx|shz",
    "elbow": r"elbow|el(b|y|x)?_|forearm|lower_?arm|elb",
    "wrist": r"wrist|hand|wr(y|x)",
    "hip": r"hip|thigh|upper_?leg|leg.?1_|hp(y|x|z)",
    "knee": r"knee|shank|calf|lower_?leg|kn(y|x)?_",
    "ankle": r"ankle|foot|ak(y|x)",
}
_SIDE_WORDS: Final = {
    "right": r"(^|_)(right|Right|RIGHT|r|R)(_|$)|^r(?=[A-Z])|^Right|^R(?!oot|oll|otor)(?=[A-Za-z])",
    "left": r"(^|_)(left|Left|LEFT|l|L)(_|$)|^l(?=[A-Z])|^Left|^L(?!ower|eg|umbar|ink)(?=[A-Za-z])",
}


#: Places of a model that stand for points of `posekit.skeleton.POINTS`, in that order.
JointMap = Mapping[str, Site]


def load_joint_map(name: str | Path, model: pin.Model) -> JointMap:
    """Load a joint map by name (one of `BUILT_IN`) or from a TOML file, for a model.

    Raises
    ------
    InputError
        If there is no such map, it is not as ``posekit.joint_map/1`` requires, or the model lacks one of its frames.
    """
    frames, found = _frames(model), dict[str, Site]()
    for point, (frame, offset) in _places(str(name)).items():
        remedy = nearest(str(frame), list(frames)[:1000])
        need(name, frame in frames, f"points.{point}", shown(frame), "a frame of the model", remedy)
        at = model.frames[frames[frame]]
        found[point] = _site(int(at.parentJoint), at.placement.act(np.array(offset, dtype=np.float64)))
    return {point: found[point] for point in POINTS if point in found}


def find_joint_map(model: pin.Model, source: str = "") -> JointMap:
    """Choose the built-in map whose frames a model has, or derive one from the names of its joints.

    Raises
    ------
    InputError
        If neither is possible.
    """
    frames = _frames(model)
    for name in BUILT_IN:
        if all(frame in frames for frame, _ in _places(name).values()):
            return load_joint_map(name, model)
    if (derived := _derived(model)) is not None:
        return derived
    got = "no joints whose names stand for shoulders, elbows, hips and knees of both sides"
    remedy = f"write a joint map ({SCHEMA}) that names the model's frames"
    raise refusal(source or model.name, "", got, "a humanoid", remedy)


def _derived(model: pin.Model) -> JointMap | None:
    """Derive a map from the names of the moving joints; None if an elbow, a knee, a shoulder or a hip is missing.

    If a shoulder or a hip has several joints, the middle one is used, near which all axes pass; elsewhere the first
    joint with such a name is used. The neck is the middle between the shoulders on the body that carries the arms, the
    pelvis the body that carries the legs.
    """
    chains: dict[str, list[int]] = {}
    for joint in range(1, model.njoints):
        name = str(model.names[joint])
        side = next((side for side in SIDES if re.search(_SIDE_WORDS[side], name)), None)
        lower = f"{name.lower()}_"
        part = next((part for part, words in _PARTS.items() if re.search(words, lower)), None)
        if side and part and model.nvs[joint] == 1:
            chains.setdefault(f"{side}_{part}", []).append(joint)
    needed = [f"{side}_{part}" for side in SIDES for part in ("shoulder", "elbow", "hip", "knee")]
    if not chains.keys() >= set(needed):
        return None
    joint_of = {
        name: joints[len(joints) // 2 if name.endswith(("shoulder", "hip")) else 0]
        for name, joints in chains.items()
    }
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    points = {name: _site(joint, np.zeros(3)) for name, joint in joint_of.items()}
    for name, part in (("neck", "shoulder"), ("pelvis", "hip")):
        right, left = (joint_of[f"{side}_{part}"] for side in SIDES)
        carriers = (set(model.supports[chains[f"{side}_{part}"][0]]) for side in SIDES)
        carrier = max(set.intersection(*carriers))
        middle = (data.oMi[right].translation + data.oMi[left].translation) / 2
        points[name] = _site(carrier, data.oMi[carrier].actInv(middle) if name == "neck" else np.zeros(3))
    return {point: points[point] for point in POINTS if point in points}


def _frames(model: pin.Model) -> dict[str, int]:
    """Return the frames by name; a link goes before a joint of the same name."""
    frames = sorted(enumerate(model.frames), key=lambda one: one[1].type == pin.FrameType.BODY)
    return {str(frame.name): index for index, frame in frames}


def _site(joint: int, offset: Array) -> Site:
    return Site(joint, (float(offset[0]), float(offset[1]), float(offset[2])))


@lru_cache(maxsize=16)
def _places(name: str) -> dict[str, tuple[Any, Any]]:
    """Read a joint map: the frame of each point, and the offset in that frame."""
    path = DATA / "joint_maps" / f"{name}.toml" if name in BUILT_IN else Path(name)
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError:
        remedy = f"built-in maps are {', '.join(BUILT_IN)}"
        raise refusal(name, "", "no such joint map", "a name or a TOML file", remedy) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise refusal(name, "", str(error), "TOML", "correct it") from None
    if table.get("schema") != SCHEMA or not isinstance(table.get("points"), dict):
        raise refusal(name, "schema", shown(table.get("schema")), SCHEMA, "write schema and [points]")
    places = {}
    for point, place in table["points"].items():
        need(name, point in POINTS, "points", shown(point), "a joint's name", nearest(point, POINTS))
        entry = place if isinstance(place, dict) else {"frame": place}
        frame, offset = entry.get("frame"), entry.get("offset", [0.0, 0.0, 0.0])
        ok = isinstance(offset, list) and len(offset) == 3
        ok = ok and all(isinstance(value, int | float) and np.isfinite(value) for value in offset)
        expected = "a frame, or a frame and three finite offsets in metres"
        need(name, ok and isinstance(frame, str), f"points.{point}", shown(place), expected, "correct it")
        places[point] = frame, offset
    return places
