"""Draw bodies as pictures, animations, HTML pages, overlays on photographs, and plots."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.cameras import View
from posekit.errors import refusal, shown
from posekit.motion import Motion
from posekit.recovery import Recovery
from posekit.validators import Report
from posekit.viewer.subjects import USUAL_AZIMUTH, as_motion, frame_with_postures, subjects_of

PICTURES: Final = (".png", ".gif", ".mp4")
PLOTS: Final = (".png", ".svg", ".pdf")
PLOT_NAMES: Final = ("angles", "timeline")


def draw(
    source: Any,
    target: str | PathLike[str],
    *,
    view: Any = None,
    frame: int | tuple[int, int] | None = None,
    which: str = "",
    size: tuple[int, int] = (1280, 720),
    azimuth: float | None = None,
    elevation: float | None = None,
    over: str | PathLike[str] | None = None,
    urdf: str = "",
) -> None:
    """Draw bodies as a picture, an animation or a page, over photographs, or as plots.

    Parameters
    ----------
    source : Motion, Recovery, Report, View with truth, or Robot
        Bodies to draw. A robot is drawn in its neutral configuration.
    target : path
        Output file: ``.png`` (frames or alternative postures side by side), ``.gif`` or ``.mp4`` (animation),
        ``.html`` (interactive page that works offline), ``.svg`` or ``.pdf`` (plot).
    view : View or Motion, optional
        View of a result; its image points and its camera are drawn too. For a report, its motion or
        motions; the page then shows the body in each frame.
    frame : int or (int, int), optional
        Frame, or first and last frame, numbered from 0. Default: a few frames of a motion; all frames of an animation.
    which : str
        Postures of a result: ``answer``, ``path``, ``all``, ``first`` or numbers such as ``0,4``. ``angles`` plots
        joint angles over time, ``timeline`` plots the findings of a report.
    size : (int, int)
        Width and height, pixels.
    azimuth, elevation : float, optional
        Position of the virtual camera, degrees. Azimuth 0 is the person's front, or the camera of a result; larger
        azimuths are to the person's left. The elevation is above the horizontal plane. Default: 35 and 8.
    over : path, optional
        Picture, folder of pictures or film; bodies are drawn over it with the camera of the view.
    urdf : str
        URDF, or name of a robot; default: the robot that the motion names.

    Raises
    ------
    InputError
        If there is nothing to draw, or if the target has another suffix.
    ViewerError
        If a picture needs a browser, and no browser is installed or the browser fails.

    Examples
    --------
    >>> import tempfile, posekit
    >>> standing = posekit.load_figure().neutral_points[None, :14]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     posekit.render(standing, f"{folder}/standing.html")
    """
    from posekit.files import write_bytes
    from posekit.viewer.files import encoded, stride

    path = Path(target)
    suffix = path.suffix.lower()
    if suffix not in (".html", *PICTURES, *PLOTS):
        expected = f"{', '.join((*PICTURES, '.html', '.svg', '.pdf'))}"
        raise refusal(path, "", shown(suffix), f"a suffix among {expected}", "choose one")
    if over is not None:
        from posekit.viewer.overlay import overlaid

        moving, drawn = suffix != ".png", source if isinstance(source, View) else as_motion(source)
        frames, rate = overlaid(drawn, Path(over), view=view, frame=frame, which=which, moving=moving)
        return write_bytes(path, encoded(frames, suffix, rate))
    source = as_motion(source)
    if suffix == ".html":
        from posekit.viewer.page import write_page

        return write_page(source, path, view=view, frame=frame, urdf=urdf)
    if which in PLOT_NAMES or isinstance(source, Report) or suffix not in PICTURES:
        from posekit.viewer.plots import plotted

        kind = which if which in PLOT_NAMES else "timeline" if isinstance(source, Report) else "angles"
        if suffix not in PLOTS:
            raise refusal(path, "", shown(suffix), f"a plot: {', '.join(PLOTS)}", "choose one")
        if which not in ("", *PLOT_NAMES):
            raise refusal(path, "--posture", shown(which), " or ".join(PLOT_NAMES), "choose a plot")
        return write_bytes(path, plotted(source, kind, suffix, frame=frame, view=view))
    if which and isinstance(source, Motion):
        expected = f"{' or '.join(PLOT_NAMES)}; a motion has one posture per frame"
        raise refusal(path, "--posture", shown(which), expected, "omit it, or select frames with --frame")
    from posekit.viewer.scene import camera_lines, pictures

    seen = view if isinstance(view, View) else None
    moving = suffix != ".png"
    subjects, captions, rate = subjects_of(
        source, which=which, frame=frame, urdf=urdf, view=seen, azimuth=azimuth, moving=moving
    )
    place = _place_of_eye(azimuth, of_camera=isinstance(source, Recovery))
    camera = image = None
    if isinstance(source, Recovery) and seen is not None and not moving:
        number = frame_with_postures(source, frame)
        image = None if isinstance(frame, tuple) else np.asarray(seen.image[number])
        if len(subjects) == 1:  # a camera fits one body alone: others were moved aside
            joints = subjects[0].robot.points(subjects[0].q)[0]
            camera = camera_lines(seen, number, joints, subjects[0].R_world_data, subjects[0].offset)
    step = stride(suffix, rate) if frame is None else 1
    made = pictures(
        subjects,
        captions=captions,
        size=size,
        elevation=elevation,
        camera=camera,
        image=image,
        seen_from=place,
        step=step,
    )
    write_bytes(path, encoded(made, suffix, None if rate is None else rate / step))


def _place_of_eye(azimuth: float | None, of_camera: bool) -> str:
    """Describe the viewing direction. The person's left is on the right-hand side of a camera that faces the person."""
    degrees = USUAL_AZIMUTH if azimuth is None else azimuth
    origin = "the camera" if of_camera else "the person's front"
    side = "right" if (degrees > 0) == of_camera else "left"
    return f"{abs(degrees):g} degrees {side} of {origin}" if degrees else origin
