"""Conversion of ``posekit.result/2``, the format of earlier versions, from JSON or NPZ to ``result/3``.

``result/2`` does not store the joints of the answer; the joints of the first representative replace them. Postures are
sorted by decreasing probability, and the covariance of each joint is converted to a radius.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from posekit.formats import json_file
from posekit.formats.node import Node
from posekit.geometry import PER_METRE
from posekit.recovery.answer import joint_radius
from posekit.skeleton import JOINTS

#: Entries of a symmetric matrix in a file: xx, xy, xz, yy, yz, zz.
UPPER: Final = ([0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2])
#: Arrays of the NPZ with a row per posture, by the field of a posture in JSON.
POSTURE_ARRAYS: Final = {
    **{"joints": "joints", "q": "q", "branches": "branches", "group": "groups", "scale": "scales"},
    **{"probability": "probability", "chi2": "refined/chi2", "covariance": "refined/covariance"},
}
ROOT_FIELDS: Final = ("method", "estimate", "deviation", "lower", "upper")


def document_of(root: Node) -> dict[str, Any]:
    """Convert a document of ``posekit.result/2`` to ``posekit.result/3``, in the file's unit."""
    document: Mapping[str, Any] = _unpadded(root) if "count" in root.value else root.value
    frames = [dict(frame.object()) for frame in Node(document, root.source).at("frames").list(1)]
    _add_radius([posture for frame in frames for posture in frame["postures"]])
    places = []  # by frame: the new number of each posture
    for frame in frames:
        held, why, answer = frame["postures"], frame.get("rejected") or {}, frame.get("answer") or {}
        order = np.argsort([-(one.get("probability") or 0.0) for one in held], kind="stable").tolist()
        places.append({old: new for new, old in enumerate(order)})
        chosen = [places[-1][old] for old in answer.get("representatives") or []]
        frame["postures"] = [held[old] for old in order]
        first = (chosen or [0])[0] if held else None
        frame["answer"] = {
            "joints": None if first is None else frame["postures"][first]["joints"],
            "survivor": first,
            "representatives": chosen,
            "represented": answer.get("probability") or [],
            "nearer": np.zeros(len(JOINTS) - 1),
        }
        frame["levels"] = tuple((frame.get("levels") or {}).get("motion") or ())
        frame["reason"] = "" if held or not why else max(why, key=lambda name, why=why: why[name])
        if (how := frame.get("root")) is not None:
            frame["root"] = {name: how.get(name) for name in ROOT_FIELDS}
    settings, per = document.get("settings") or {}, PER_METRE[document["unit"]]
    pictures = settings.get("pictures") or ()
    for frame, picture in zip(frames, pictures if len(pictures) == len(frames) else (), strict=False):
        frame["picture"] = str(picture)
    paths = (document.get("paths") or {}).get("paths") or []
    return {
        **{name: document[name] for name in ("unit", "configuration_names")},
        "joint_names": list(JOINTS),
        "settings": settings,
        "lengths": {name: one * per for name, one in (settings.get("lengths") or {}).items()},
        "camera": settings.get("camera"),
        "frames": frames,
        "paths": [_path(one, places) for one in paths],
    }


def _add_radius(postures: list[dict[str, Any]]) -> None:
    """Add to each posture, in place, the fields of ``result/3``: chi2, radius, branch, group and inferred."""
    refined = [one.get("refined") or one for one in postures]
    rows = [[row or [0.0] * 6 for row in one.get("covariance") or [None] * len(JOINTS)] for one in refined]
    matrices = np.zeros((len(postures), len(JOINTS), 3, 3))
    entries = np.nan_to_num(np.array(rows, dtype=np.float64).reshape(-1, len(JOINTS), 6))
    matrices[..., UPPER[0], UPPER[1]] = matrices[..., UPPER[1], UPPER[0]] = entries
    radius = joint_radius(matrices) if postures else ()
    for posture, one, own in zip(postures, refined, radius, strict=True):
        inferred = posture.get("inferred") or {}
        posture |= {"chi2": one.get("chi2") or 0.0, "radius": own, "branch": posture.get("branches", "")}
        posture |= {"group": posture.get("group", -1), "inferred": [name in inferred for name in JOINTS]}


def _path(one: Mapping[str, Any], places: list[dict[int, int]]) -> dict[str, Any]:
    smoothed, joints = (np.array(one[name], dtype=np.float64) for name in ("smoothed", "joints"))
    return {
        "probability": one["share"],
        "survivor": [place.get(int(old), -1) for old, place in zip(one["survivor"], places, strict=True)],
        "joints": np.where(np.isfinite(smoothed), smoothed, joints),
    }


def _unpadded(root: Node) -> dict[str, Any]:
    """Return the JSON document of an NPZ file, whose arrays are padded to equal numbers of postures per frame."""
    held: Mapping[str, Any] = root.value
    counts = root.at("count").array(None).astype(np.intp).tolist()

    def parsed(name: str, default: Any) -> Any:
        return json_file.parse(root.at(name).text().encode(), root.source) if name in held else default

    columns = {field: held[name] for field, name in POSTURE_ARRAYS.items() if name in held}
    margins = {name.removeprefix("margins/"): held[name] for name in held if name.startswith("margins/")}
    inferred, roots = (parsed(name, [None] * len(counts)) for name in ("inferred", "roots"))
    frames: list[dict[str, Any]] = []
    for k, count in enumerate(counts):
        postures = [
            {
                **{field: values[k, i].tolist() for field, values in columns.items()},
                "margins": {name: float(values[k, i]) for name, values in margins.items()},
                "inferred": inferred[k][i] if inferred[k] else {},
            }
            for i in range(count)
        ]
        camera = {name: held[f"camera/{name}"][k] for name in ("f", "rotation", "position", "residual")}
        rejected = zip(held["rejected/names"].tolist(), held["rejected/counts"][k].tolist(), strict=True)
        frame = {
            "time": float(held["time"][k]),
            "camera": {name: None if np.isnan(values).any() else values for name, values in camera.items()},
            "rejected": {name: number for name, number in rejected if number >= 0},
            "levels": {"motion": [number for number in held["levels/motion"][k].tolist() if number >= 0]},
            "root": roots[k],
            "postures": postures,
        }
        if "answer/representatives" in held:
            rows = [row for row in held["answer/representatives"][k].tolist() if row >= 0]
            chances = held["answer/probability"][k, : len(rows)].tolist()
            frame["answer"] = {"representatives": rows, "probability": chances}
        frames.append(
            frame | {name: held[name][k] for name in ("unlisted", "unlisted_probability") if name in held}
        )
    names = ("survivor", "share", "joints", "smoothed")
    paths = zip(*(held[f"paths/{name}"] for name in names), strict=True) if "paths/survivor" in held else ()
    return {
        "unit": root.at("unit").text(),
        "configuration_names": list(root.at("configuration_names").texts()),
        "settings": parsed("settings", {}),
        "frames": frames,
        "paths": {"paths": [dict(zip(names, one, strict=True)) for one in paths]},
    }
