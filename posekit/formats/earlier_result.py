"""``posekit.result/2``, the format of earlier versions: its JSON is converted to a document of ``result/3``.

``result/2`` stores no joints of the answer; the joints of the first representative are used. Postures are sorted by
decreasing probability, and the covariance of each joint becomes its radius.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from posekit.formats.node import Node
from posekit.geometry import PER_METRE
from posekit.recovery.answer import joint_radius
from posekit.skeleton import JOINTS

#: Entries of a symmetric matrix in a file: xx, xy, xz, yy, yz, zz.
UPPER: Final = ([0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2])
ROOT_FIELDS: Final = ("method", "estimate", "deviation", "lower", "upper")


def document_of(root: Node) -> dict[str, Any]:
    """Return the document of ``posekit.result/3`` for one of ``posekit.result/2``, in the file's unit."""
    document: Mapping[str, Any] = root.value
    if "frames" not in document:
        raise root.refused("its JSON", "recover the view again", "posekit.result/2 as NPZ")
    frames = [dict(frame.object()) for frame in root.at("frames").list(1)]
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
    """Add the fields of ``result/3`` to postures, in place: chi2, radius, branch, group and inferred."""
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
