"""The page of a recovered object: its configurations frame by frame, to be turned by hand."""

from __future__ import annotations

import html
from collections.abc import Sequence
from importlib import resources
from typing import Final

import numpy as np

from posekit.display.plural import plural
from posekit.errors import ViewerError
from posekit.formats.own.object_result import ObjectResult
from posekit.geometry import Array
from posekit.viewer.page.shown_survivors import most_of_each
from posekit.viewer.scene.drawn_object import JOINT_SHARE, SEGMENT_SHARE, DrawnObject, add_slot
from posekit.viewer.scene.framing import fitted_eye
from posekit.viewer.scene.scene import Scene
from posekit.viewer.scene.stage import add_stage
from posekit.viewer.scene.world import upright_world
from posekit.viewer.standalone import script_json, standalone_page

PAGE_OBJECT_BYTES: Final = 8_000_000
"""Bytes of the postures in a page, which is below 10 MB then."""

POINT_BYTES, SAID_BYTES = 30, 160
"""Bytes of one point of a posture, and of what is said of it."""

OBJECTS_AT_ONCE: Final = 12
"""Postures that are drawn in each other."""

PAGE_AZIMUTH, PAGE_ELEVATION, PAGE_FOV = 35.0, 14.0, 25.0
"""Degrees: from where the page looks at first."""

PAGE_BODY: Final = """
<div id="object">
<h1>{title}</h1>
<p>{said}</p>
<label id="frame-row">frame <input id="frame" type="range" min="0" max="{last}" value="0">
<output id="frame-said"></output></label>
<label id="posture-row">posture <input id="posture" type="range" min="0" value="0">
<output id="number"></output></label>
<button id="all" type="button"></button>
<p id="posture-said" role="status"></p>
</div>
"""


def object_page(result: ObjectResult, *, title: str = "posekit", frames: Sequence[int] | None = None) -> str:
    """Make the page, as text: it loads nothing.

    Parameters
    ----------
    result : ObjectResult
        What was recovered.
    title : str
        Shown on top.
    frames : sequence of int, optional
        Which frames, from 0; all by default.

    Raises
    ------
    ViewerError
        Where there is no posture, or no such frame.
    """
    subject = DrawnObject.of(result)
    chosen = range(len(subject.frames)) if frames is None else frames
    if not len(chosen) or chosen[-1] >= len(subject.frames):
        raise ViewerError(
            f"--frames: {chosen[0]}-{chosen[-1]}; expected numbers from 0 to {len(subject.frames) - 1}"
        )
    counts = [len(subject.frames[k]) for k in chosen]
    each = most_of_each(counts, PAGE_OBJECT_BYTES // (SAID_BYTES + POINT_BYTES * len(result.points)))
    held = [world_points[:each] for world_points in (subject.frames[k].points for k in chosen)]
    world = upright_world(np.concatenate([one.reshape(-1, 3) for one in held]))
    placed = [world.place(one) for one in held]
    data = {
        "segments": subject.segments.tolist(),
        "joint": JOINT_SHARE * subject.extent,
        "segment": SEGMENT_SHARE * subject.extent,
        "slots": OBJECTS_AT_ONCE,
        "frames": [
            {
                "number": k,
                "time": result.frames[k].time,
                "count": len(subject.frames[k]),
                "none": result.frames[k].reason or "no posture is left",
                "postures": [
                    {"number": row, "said": _said(result, k, row), "points": _points(points)}
                    for row, points in zip(subject.rows[k].tolist(), bodies, strict=False)
                ],
            }
            for k, bodies in zip(chosen, placed, strict=True)
        ],
    }
    scene = Scene()
    for slot in range(min(OBJECTS_AT_ONCE, max(counts))):
        add_slot(scene, f"slot-{slot}", subject)
    points = np.concatenate([one.reshape(-1, 3) for one in placed])
    add_stage(scene, points, ground=subject.to_scale)
    count = sum(counts)
    eye = fitted_eye(points, world, azimuth=PAGE_AZIMUTH, elevation=PAGE_ELEVATION, fov=PAGE_FOV, aspect=1.0)
    told = f"{plural(count, 'posture')} of {result.linkage} in {plural(len(chosen), 'frame')}"
    return standalone_page(
        scene,
        eye=eye,
        title=title,
        body=PAGE_BODY.format(title=html.escape(title), said=html.escape(told), last=len(chosen) - 1),
        style=_file("object_page.css"),
        script=f"const OBJECT = {script_json(data)};\n{_file('object_page.js')}",
    )


def _said(result: ObjectResult, frame: int, row: int) -> str:
    """Say of one posture whether its robot reaches it, and at which scale it is."""
    one = result.frames[frame]
    verdict = {True: "its robot reaches it", False: "no configuration within limits was found", None: ""}
    unit = "a metre" if result.unit is not None else "a unit"
    said = [one.reasons[row] or verdict[one.certified[row]], f"{one.scales[row]:.5g} pixels {unit}"]
    return "; ".join(part for part in said if part)


def _points(points: Array) -> list[list[float] | None]:
    return [np.round(point, 4).tolist() if np.isfinite(point).all() else None for point in points]


def _file(name: str) -> str:
    return (resources.files("posekit.viewer") / name).read_text(encoding="utf-8")
