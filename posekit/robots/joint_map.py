"""Joint maps: the frames of a model that stand for the 14 joints, from a file or from the model's own names."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import pinocchio as pin

from posekit.errors import nearest, refusal, shown
from posekit.files import DATA
from posekit.geometry import Array
from posekit.robots.kinematics import Kinematics, Site
from posekit.robots.urdf import need
from posekit.skeleton import POINTS, SIDES

SCHEMA: Final = "posekit.joint_map/1"
#: Maps of the package, in the order in which they are tried.
BUILT_IN: Final = ("stick_figure", "human", "human_gazebo", "simple_humanoid", "g1", "talos")
#: Name of a map that was derived from the model.
DERIVED: Final = "names of its joints"

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


class JointMap(NamedTuple):
    """Places of a model that stand for points of a posture.

    Attributes
    ----------
    name : str
        Name in reports and errors.
    points : dict
        Places of each point of `posekit.skeleton.POINTS` that the model has.
    """

    name: str
    points: Mapping[str, tuple[Site, ...]]

    def kinematics(self, model: pin.Model) -> Kinematics:
        """Return the kinematics of the mapped points, in the order of `posekit.skeleton.POINTS`."""
        return Kinematics(model, [self.points[name] for name in POINTS if name in self.points])

    @property
    def columns(self) -> tuple[int, ...]:
        """Indices into `posekit.skeleton.POINTS` of the mapped points."""
        return tuple(k for k, name in enumerate(POINTS) if name in self.points)


def load_joint_map(name: str | Path, model: pin.Model) -> JointMap:
    """Load a joint map by name (one of `BUILT_IN`) or from a TOML file, for a model.

    Raises
    ------
    InputError
        If there is no such map, it is not as ``posekit.joint_map/1`` requires, or the model lacks one of its frames.
    """
    frames, points = _frames(model), dict[str, tuple[Site, ...]]()
    for group in ("points", "optional"):
        for point, place in _table(str(name)).get(group, {}).items():
            need(name, point in POINTS, group, shown(point), "a joint's name", nearest(point, POINTS))
            sites = place["mean"] if isinstance(place, dict) and "mean" in place else [place]
            absent = [_frame(site) for site in sites if _frame(site) not in frames]
            if absent and group == "points":
                near = nearest(str(absent[0]), list(frames)[:1000])
                raise refusal(name, f"{group}.{point}", shown(absent[0]), "a frame of the model", near)
            if not absent:
                read = [_site(site, model, frames, f"{name}: {group}.{point}") for site in sites]
                total = sum(site.share for site in read)
                points[point] = tuple(site._replace(share=site.share / total) for site in read)
    return JointMap(Path(name).stem, points)


def find_joint_map(model: pin.Model, source: str = "") -> JointMap:
    """Choose the built-in map whose frames a model has, or derive one from the names of its joints.

    Raises
    ------
    InputError
        If neither is possible.
    """
    frames = _frames(model)
    for name in BUILT_IN:
        places = _table(name)["points"].values()
        if all(_frame(place) in frames for place in places):
            return load_joint_map(name, model)
    if (derived := _derived(model)) is not None:
        return derived
    got = "no joints whose names stand for shoulders, elbows, hips and knees of both sides"
    remedy = f"write a joint map ({SCHEMA}) that names the model's frames"
    raise refusal(source or model.name, "", got, "a humanoid", remedy)


def _derived(model: pin.Model) -> JointMap | None:
    """Derive a map from the names of the moving joints; None if an elbow, a knee, a shoulder or a hip is missing.

    Of several joints at a shoulder or a hip the middle one is taken, near which all axes pass; elsewhere the first one
    with such a name. The neck is the middle between the shoulders on the body that carries the arms, the pelvis the
    body that carries the legs.
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
    points = {name: (Site(joint, (0.0, 0.0, 0.0), 1.0),) for name, joint in joint_of.items()}
    for name, part in (("neck", "shoulder"), ("pelvis", "hip")):
        right, left = (joint_of[f"{side}_{part}"] for side in SIDES)
        carrier = _common(model, chains[f"right_{part}"][0], chains[f"left_{part}"][0])
        middle = (data.oMi[right].translation + data.oMi[left].translation) / 2
        local = data.oMi[carrier].actInv(middle) if name == "neck" else np.zeros(3)
        points[name] = (Site(carrier, _triple(local), 1.0),)
    return JointMap(DERIVED, points)


def _common(model: pin.Model, one: int, other: int) -> int:
    """Return the joint that carries both."""
    above = {one}
    while one:
        one = int(model.parents[one])
        above.add(one)
    while other not in above:
        other = int(model.parents[other])
    return other


def _frames(model: pin.Model) -> dict[str, int]:
    """Return the frames by name; a link goes before a joint of the same name."""
    found: dict[str, int] = {}
    for index, frame in enumerate(model.frames):
        if index and (frame.name not in found or frame.type == pin.FrameType.BODY):
            found[str(frame.name)] = index
    return found


def _site(place: Any, model: pin.Model, frames: Mapping[str, int], where: str) -> Site:
    """Read a place of a table: a frame's name, or a frame with an offset and a weight."""
    entry = place if isinstance(place, dict) else {}
    values = [*entry.get("offset", (0.0, 0.0, 0.0)), entry.get("weight", 1.0)]
    ok = len(values) == 4 and all(isinstance(value, int | float) and np.isfinite(value) for value in values)
    expected = "a frame, three finite offsets in metres and a positive weight"
    need(where, ok and values[3] > 0, "", shown(values), expected, "correct the joint map")
    frame = model.frames[frames[_frame(place)]]
    offset = frame.placement.act(np.array(values[:3], float))
    return Site(int(frame.parentJoint), _triple(offset), float(values[3]))


def _frame(place: Any) -> Any:
    return place.get("frame") if isinstance(place, dict) else place


def _triple(values: Array) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])


@lru_cache(maxsize=16)
def _table(name: str) -> dict[str, Any]:
    built_in = name in BUILT_IN
    place = DATA / "joint_maps" / f"{name}.toml" if built_in else Path(name)
    try:
        table = tomllib.loads(place.read_text(encoding="utf-8"))
    except OSError:
        remedy = f"built-in maps are {', '.join(BUILT_IN)}"
        raise refusal(name, "", "no such joint map", "a name or a TOML file", remedy) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise refusal(name, "", str(error), "TOML", "correct it") from None
    if table.get("schema") != SCHEMA or not isinstance(table.get("points"), dict):
        raise refusal(name, "schema", shown(table.get("schema")), SCHEMA, "write schema and [points]")
    return table
