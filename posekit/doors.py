"""Public functions that accept a path, an array or an object: `recover`, `convert` and `render`."""

from __future__ import annotations

from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from posekit.errors import names_checked, refusal, shown
from posekit.inputs import kind_of
from posekit.settings import RecoverSettings, number, picture_size

if TYPE_CHECKING:
    from posekit.body import Figure
    from posekit.cameras import CameraModel, PinholeCamera, View
    from posekit.recovery import Recovery

#: A path, an array, a `View`, `Detections` or a `Motion`.
Source = Any


def opened(source: Source, layout: str = "", **facts: Any) -> Any:
    """Open a path, or return an array of joints or configurations as motion; return other objects unchanged."""
    from posekit.formats import open as open_file
    from posekit.formats.options import facts_of
    from posekit.motion import Motion
    from posekit.motion.validation import Judge

    if isinstance(source, str | PathLike):
        return open_file(source, layout, **facts)
    if isinstance(source, list | tuple | np.ndarray):
        read = Judge(None, facts.get("urdf", ""), {}).motion(source, facts_of(layout=layout, **facts))
        return replace(read, frame=None) if isinstance(read, Motion) else read  # rows are frames in order
    return source


@names_checked
def recover(
    source: Source,
    settings: RecoverSettings | None = None,
    *,
    camera: str | PathLike[str] | PinholeCamera | None = None,
    stature: str | float | None = None,
    person: str = "",
    layout: str = "",
    rate: float | None = None,
    fov: str | float | None = None,
    size: str | tuple[int, int] | None = None,
    checks: Any = None,
    ranges: str | None = None,
    deviation: str | float | None = None,
    length_deviation: str | float | None = None,
    coverage: float | None = None,
    group: str | float | None = None,
    follow: int | None = None,
    figure: str | PathLike[str] | Figure | None = None,
) -> Recovery:
    """Recover every posture that fits the image points of a view and passes the checks.

    Parameters
    ----------
    source : path, View, Detections or array
        File of a view; file or folder of key points; `View`; `Detections`; or an array of key points (T, P, 2) in
        pixels, or (T, P, 3) with confidences, in the order of the `layout`.
    settings : RecoverSettings, optional
        All settings; the arguments below override single settings.
    camera : path or PinholeCamera, optional
        Calibration of the camera of the key points, as ``FILE`` or ``FILE:NAME``. Without a calibration the camera is
        scaled orthographic.
    stature : float or str, optional
        Height of the person: metres, or text with a unit such as ``"175cm"``.
    person : str
        Which of several detected people: ``largest``, ``surest`` (largest sum of confidences), ``first``, or the number
        of a track.
    layout : str
        Name of the key points' layout, or the path of a TOML layout.
    rate : float, optional
        Frames per second of key points without times.
    fov : float or str, optional
        Guess of the horizontal field of view, degrees, in place of a calibration.
    size : (int, int) or str, optional
        Width and height of the pictures, pixels, if neither the key points nor the calibration have them; also as
        ``"1280x720"``.
    checks, ranges, deviation, length_deviation, coverage, group, follow : optional
        See the fields of `RecoverSettings`.
    figure : Figure or path, optional
        Figure, or its URDF file; by default the built-in figure.

    Returns
    -------
    Recovery

    Raises
    ------
    InputError
        If the source is neither a view nor key points, or the view's data contradict each other.

    Examples
    --------
    >>> import posekit
    >>> recovery = posekit.recover(posekit.builtin_view("seq1"))
    >>> len(recovery)
    5
    """
    from posekit.body import Figure, load_figure
    from posekit.recovery.conductor import recover as recover_view

    asked = RecoverSettings.of(
        settings,
        checks=checks,
        ranges=ranges,
        deviation=deviation,
        length_deviation=length_deviation,
        coverage=coverage,
        group=group,
        follow=follow,
        stature=stature,
    )
    view = view_of(source, camera=camera, person=person, layout=layout, rate=rate, fov=fov, size=size)
    if figure is not None and not isinstance(figure, Figure):
        figure = load_figure(str(figure))
    return recover_view(view, asked, figure=figure)


def view_of(
    source: Source,
    *,
    camera: str | PathLike[str] | PinholeCamera | None = None,
    person: str = "",
    layout: str = "",
    unit: str | None = None,
    rate: float | None = None,
    stature: str | float | None = None,
    size: str | tuple[int, int] | None = None,
    fov: str | float | None = None,
    min_confidence: float = 0.0,
) -> View:
    """Return the view of one person: the view of a file, or a view made from key points and a camera.

    Parameters
    ----------
    source : path, View, Detections or array
    camera : path or PinholeCamera, optional
        ``FILE``, or ``FILE:NAME`` if a calibration has several cameras.
    person, layout, unit, rate, stature
        As in `recover`; `unit` is the calibration's unit of length.
    size : (int, int) or str, optional
        Width and height of the pictures, pixels, if neither the key points nor the calibration have them; also as
        ``"1280x720"``.
    fov : float or str, optional
        Guess of the horizontal field of view, degrees, in place of a calibration.
    min_confidence : float
        Key points with a lower confidence count as unseen.

    Raises
    ------
    InputError
        If the source is neither a view nor key points, or the calibration does not fit the pictures.
    """
    from posekit.cameras import ScaledOrthographicCamera, View
    from posekit.cameras.pinhole import camera_from_fov
    from posekit.following.detections import Detections
    from posekit.formats import open as open_file
    from posekit.formats.arrays import key_points_of
    from posekit.formats.options import Options, facts_of

    rate = facts_of(rate=rate).get("rate")
    name = source if isinstance(source, str | PathLike) else getattr(source, "source", "") or "recover"
    if isinstance(source, str | PathLike):
        source = open_file(source, layout, rate=rate)
    elif isinstance(source, np.ndarray | list | tuple):
        source = key_points_of(source, Options(layout=layout, rate=rate))
    if isinstance(source, View):
        return source
    if not isinstance(source, Detections):
        remedy = (
            "judge motion and results with posekit validate; make a view of motion with posekit synth mocap"
        )
        raise refusal(name, "", kind_of(source), "a view or key points", remedy)
    known: CameraModel | None = opened_camera(camera, unit)
    seen: Detections = replace(source, size=picture_size(size) or source.size)
    if known is None and fov is not None:
        if seen.size is None:
            raise refusal("", "fov", shown(fov), "the pictures' size, too", "give a size, such as 1280x720")
        known = camera_from_fov(seen.size, number(fov, "fov", "degrees"), "horizontal")
    return seen.view(
        known or ScaledOrthographicCamera(scale=None),
        person=person,
        rate=rate,
        stature=None if stature is None else number(stature, "stature"),
        min_confidence=min_confidence,
    )


def opened_camera(camera: str | PathLike[str] | PinholeCamera | None, unit: str | None = None) -> Any:
    """Return the camera of a calibration, given as ``FILE`` or ``FILE:NAME``.

    Raises
    ------
    InputError
        If the file has no camera, or has several cameras and no name is given.
    """
    from posekit.cameras import Camera
    from posekit.formats import open as open_file

    if camera is None or isinstance(camera, Camera):
        return camera
    if not isinstance(camera, str | PathLike):
        expected = "the file of a calibration, or a PinholeCamera"
        raise refusal("", "camera", shown(type(camera).__name__), expected, "give one of these")

    path, name = str(camera), ""
    if not Path(path).exists() and ":" in path:
        path, _, name = path.rpartition(":")
    cameras = open_file(path, unit=unit)
    if not isinstance(cameras, dict) or not cameras:
        raise refusal(
            path, "", f"a {type(cameras).__name__}", "the calibration of cameras", "give another file"
        )
    if len(cameras) == 1 and not name:
        return next(iter(cameras.values()))
    if name not in cameras:
        got = f"no camera {name}" if name else f"{len(cameras)} cameras"
        raise refusal(path, "", got, f"one of {', '.join(cameras)}", f"write {path}:NAME")
    return cameras[name]


def frame_range(frame: Any) -> int | tuple[int, int] | None:
    """Convert a frame or a range of frames, such as ``"3"`` or ``"0-9"``, to integers."""
    if frame is None:
        return None
    ends = frame.split("-") if isinstance(frame, str) else list(np.ravel(frame))
    if len(ends) not in (1, 2) or not all(str(end).isdigit() for end in ends):
        expected = "a frame from 0, or the first and the last"
        raise refusal("", "frame", shown(frame), expected, "write it as 3 or 0-9")
    return int(ends[0]) if len(ends) == 1 else (int(ends[0]), int(ends[1]))


@names_checked
def convert(
    source: Source,
    target: str | PathLike[str],
    *,
    layout: str = "",
    which: str = "",
    unit: str | None = None,
    up: str | None = None,
    rate: float | None = None,
    urdf: str = "",
) -> None:
    """Convert a file, or save an object, to the format that the suffix of the target names.

    Parameters
    ----------
    source : path, array or object
    target : path
    layout : str
        Layout of the source; an array (T, J, 3) has its joints in this order.
    which : {"", "answer", "path", "all", "first"}
        Postures of a result that are written to motion files; by default the followed path if it exists, otherwise the
        answer.
    unit, up, rate, urdf
        Facts that the source does not state; see `posekit.open`.

    Raises
    ------
    InputError
        If the source cannot be read, or the target's format cannot store it.

    Examples
    --------
    >>> import posekit
    >>> posekit.convert(posekit.recover(posekit.builtin_view("seq1")), "walk.bvh")
    """
    from posekit.formats import save

    source = opened(source, layout, unit=unit, up=up, rate=rate, urdf=urdf)
    save(source, target, **({"which": which} if which else {}))


@names_checked
def render(
    source: Source,
    target: str | PathLike[str],
    *,
    layout: str = "",
    urdf: str = "",
    rate: float | None = None,
    unit: str | None = None,
    up: str | None = None,
    view: Source = None,
    frame: int | str | tuple[int, int] | None = None,
    which: str = "",
    size: str | tuple[int, int] = (1280, 720),
    azimuth: float | None = None,
    elevation: float | None = None,
    over: str | PathLike[str] | None = None,
) -> None:
    """Draw a file or an object: a picture (.png), an animation (.gif, .mp4) or a page (.html).

    Parameters
    ----------
    source : path, Motion, Recovery, View, Detections, Report, Robot or array
        A robot is drawn at its neutral configuration. Key points, and views without true joints, are first recovered,
        and the recovered postures are drawn. An array has joints (T, 14, 3), or (T, J, 3) in the order of the `layout`.
    target : path
    layout, urdf, rate, unit, up
        As in `posekit.open`.
    view : path or View, optional
        View from which a result was recovered; its image points are drawn as well.
    frame : int, (int, int) or str, optional
        Frame, or first and last frame, from 0; also as ``"3"`` or ``"0-9"``.
    which : {"", "answer", "path", "all", "first"} or str
        Postures of a result, or numbers of postures such as ``0,4``.
    size : (int, int) or str
        Width and height, pixels; also as ``"1280x720"``.
    azimuth, elevation : float, optional
        Direction from which the body is drawn, degrees; by default from the front and slightly above.
    over : path, optional
        Picture, folder of pictures or film over which the source is drawn, through the view's camera.

    Raises
    ------
    InputError
        If there is nothing to draw, or if the target has another suffix.

    Examples
    --------
    >>> import posekit
    >>> posekit.render(posekit.recover(posekit.builtin_view("seq1")), "walk.html")
    """
    from posekit.cameras import View
    from posekit.following.detections import Detections
    from posekit.motion import Motion
    from posekit.recovery import Recovery
    from posekit.robots import Robot
    from posekit.validators import Report
    from posekit.viewer import draw

    name = source if isinstance(source, str | PathLike) else "render"
    source = opened(source, layout, rate=rate, urdf=urdf, unit=unit, up=up)
    if isinstance(source, Detections):
        source = view_of(source)
    if isinstance(view, str | PathLike):
        view = opened(view)
    if not isinstance(source, Motion | Recovery | View | Report | Robot):
        expected = "postures, motion, key points, a view, a result or a report"
        raise refusal(name, "", kind_of(source), expected, "give one of these")
    if isinstance(source, View) and not np.isfinite(source.truth).any():
        view, source = source, recover(source)
    draw(
        source,
        target,
        view=view,
        frame=frame_range(frame),
        which=which,
        size=picture_size(size) or (1280, 720),
        azimuth=None if azimuth is None else number(azimuth, "azimuth"),
        elevation=None if elevation is None else number(elevation, "elevation"),
        over=over,
        urdf=urdf,
    )
