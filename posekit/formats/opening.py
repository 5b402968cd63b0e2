"""The one door to every file: `posekit.open`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from posekit.formats.format import Content
from posekit.formats.own_files import OwnFormat
from posekit.formats.recognising import Recognised, recognise
from posekit.formats.registry import names
from posekit.formats.skeleton_maps import SkeletonMap
from posekit.safe_io import nearest, refusal, shown

CONTENT_WORDS: Final[Mapping[str, Content]] = {
    "camera": Content.CAMERAS,
    **{one.word: one for one in Content if one is not Content.OTHER},
}
"""What can be asked for, by the word that asks for it."""


def open(
    path: str | Path,
    as_: str = "",
    *,
    format: str = "",
    layout: SkeletonMap | None = None,
    unit: str | float | None = None,
    up: str | None = None,
) -> Any:
    """Open a file or folder of any format, and return the object that it holds.

    ================  ==================================================================================
    the file holds    what is returned
    ================  ==================================================================================
    a view            `posekit.View`
    a result          `posekit.formats.own.Result`
    postures          `posekit.formats.own.Postures`
    configurations    `posekit.formats.own.NamedConfigurations`
    survivors         `posekit.formats.motion.SurvivorTable`
    key points        `posekit.formats.keypoints.KeyPoints`
    motion            `posekit.formats.motion.Motion`
    cameras           a mapping of names to `posekit.cameras.calibrated.CalibratedCamera`
    a robot           `posekit.robots.Robot`
    objects           `posekit.formats.own.ObjectResult`
    a report          `posekit.formats.own.ValidationReport`
    an evaluation     a mapping, as ``posekit.evaluation/1`` has it
    ================  ==================================================================================

    Parameters
    ----------
    path : path
        The file or folder, in any of the formats of `posekit.formats.registry`.
    as_ : str
        What is wanted of it: ``view``, ``result``, ``postures``, ``configurations``, ``survivors``, ``key-points``,
        ``motion``, ``cameras``, ``camera`` (the only one of a file), ``robot``, ``objects``, ``report``,
        ``evaluation``; whatever the file holds if empty. ``postures`` takes every file that has some: motion, a
        result, a table of survivors, a view with truth.
    format : str
        The name of the format, where it is said; recognised by the file's name and structure if empty.
    layout : SkeletonMap, optional
        What the points are, of key points and motion; the format's own, or told by their names, if not given.
    unit : str or float, optional
        What lengths are in, of motion and cameras, instead of what the file says: ``m``, ``cm``, ``mm``, ``in``; of
        cameras also metres as a number.
    up : str, optional
        The axis that points up, of motion, instead of what the file says: ``+y``.

    Raises
    ------
    InputError
        Where the file cannot be read, is of no known format or of several, or does not hold what is wanted: the text
        names what the file holds and which formats hold what is wanted.

    Examples
    --------
    >>> import posekit
    >>> view = posekit.open("walk.json")  # doctest: +SKIP
    >>> postures = posekit.open("trial.trc", "postures")  # doctest: +SKIP
    """
    path = Path(path)
    if as_ and as_ not in CONTENT_WORDS:
        raise refusal("as_", "", shown(as_), "what a file can hold", nearest(as_, CONTENT_WORDS))
    found = recognise(path, format)
    wanted = CONTENT_WORDS[as_] if as_ else found.holds
    if wanted is Content.POSTURES:
        from posekit.formats.held_postures import held_postures

        return held_postures(path, found, layout=layout, unit=unit, up=up).postures
    require(path, found, wanted)
    if wanted is Content.KEY_POINTS:
        from posekit.formats.keypoints import read_keypoints

        return read_keypoints(path, format or None, layout)
    if wanted is Content.MOTION:
        from posekit.formats.motion import read_motion

        return read_motion(path, found.only(path).name, unit=None if unit is None else str(unit), up=up)
    if wanted is Content.CAMERAS:
        from posekit.cameras.calibrated import choose_camera
        from posekit.formats.cameras import read_cameras

        cameras = read_cameras(path, found.only(path).name, unit=unit)
        return choose_camera(cameras) if as_ == "camera" else cameras
    own = found.only(path)
    if wanted is Content.CONFIGURATIONS:
        from posekit.formats.held_postures import configurations_of

        return configurations_of(path, found)
    if isinstance(own, OwnFormat) and own.reads:
        return own.read(path)
    raise refusal(
        path,
        "",
        f"{found.title}, which is not opened by itself",
        ", ".join(CONTENT_WORDS),
        "see its documentation",
    )


def require(path: str | Path, found: Recognised, *wanted: Content) -> None:
    """Refuse a file that does not hold what is wanted.

    Parameters
    ----------
    path : path
        The file, for the message.
    found : Recognised
        What it is.
    *wanted : Content
        What it may hold.

    Raises
    ------
    InputError
        Where it holds something else; the formats that hold what is wanted are named.
    """
    if found.holds in wanted:
        return
    expected = " or ".join(f"{one.value} ({', '.join(names(one))})" for one in wanted)
    raise refusal(path, "", found.title, expected, "give another file")
