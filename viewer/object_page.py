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
from posekit.viewer.scene.drawn_object import DrawnObject, add_object
from posekit.viewer.scene.framing import fitted_eye
from posekit.viewer.scene.scene import Scene
from posekit.viewer.scene.stage import add_stage
from posekit.viewer.scene.world import upright_world
from posekit.viewer.standalone import script_json, standalone_page

MOST_PAGE_OBJECTS: Final = 1500
"""Postures in one page: 10 MB at most."""

PAGE_AZIMUTH, PAGE_ELEVATION, PAGE_FOV = 35.0, 14.0, 25.0
"""Degrees: from where the page looks at first."""

PAGE_BODY: Final = """
<div id="object">
<h1>{title}</h1>
<p>{said}</p>
<label id="frame-row">frame <input id="frame" type="range" min="0" max="{last}" value="0">
<output id="frame-said"></output></label>
<div id="postures" role="group" aria-label="postures of the frame"></div>
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
        Where there is no posture, or more than fit a page.
    """
    subject = DrawnObject.of(result)
    chosen = range(len(subject.frames)) if frames is None else frames
    if not len(chosen) or chosen[-1] >= len(subject.frames):
        raise ViewerError(
            f"--frames: {chosen[0]}-{chosen[-1]}; expected numbers from 0 to {len(subject.frames) - 1}"
        )
    count = sum(len(subject.frames[k]) for k in chosen)
    if count > MOST_PAGE_OBJECTS:
        raise ViewerError(
            f"{plural(count, 'posture')} in one page; expected at most {MOST_PAGE_OBJECTS:,}; choose frames, as "
            "--frames 0-9"
        )
    world = upright_world(np.concatenate([subject.frames[k].points.reshape(-1, 3) for k in chosen]))
    scene, data, drawn = Scene(), [], []
    for place, k in enumerate(chosen):
        postures = []
        for number, points in zip(
            subject.rows[k].tolist(), world.place(subject.frames[k].points), strict=True
        ):
            add_object(scene, f"frame-{place}/posture-{number}", points, subject)
            drawn.append(points)
            postures.append([number, _said(result, k, number)])
        scene.show(f"/meshcat/frame-{place}", place == 0)
        data.append(
            {"number": k, "time": result.frames[k].time, "postures": postures, "none": _none(result, k)}
        )
    points = np.concatenate(drawn)
    add_stage(scene, points, ground=subject.to_scale)
    eye = fitted_eye(points, world, azimuth=PAGE_AZIMUTH, elevation=PAGE_ELEVATION, fov=PAGE_FOV)
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
    said = [verdict[one.certified[row]], one.reasons[row], f"{one.scales[row]:.5g} pixels {unit}"]
    return "; ".join(part for part in said if part)


def _none(result: ObjectResult, frame: int) -> str:
    return result.frames[frame].reason or "no posture is left"


def _file(name: str) -> str:
    return (resources.files("posekit.viewer") / name).read_text(encoding="utf-8")
