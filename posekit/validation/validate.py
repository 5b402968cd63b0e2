"""`posekit.validate`: whatever holds postures, judged."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure
from posekit.errors import InputError
from posekit.formats.held_postures import HeldPostures, postures_of_result
from posekit.formats.own import NamedConfigurations, Postures, Result, ValidationReport
from posekit.geometry import Array
from posekit.robots import Robot
from posekit.settings import ValidateSettings
from posekit.skeleton import HEAD_POINTS, JOINTS
from posekit.validation.files import AskedValidation, validate_files
from posekit.validation.judging import ReportBuilder
from posekit.validation.reading import ReadPostures, StatedMotion, files_of

Given = HeldPostures | Postures | NamedConfigurations | Result | Array


def validate(
    given: Given | str | Path | Sequence[str | Path],
    settings: ValidateSettings | None = None,
    *,
    urdf: str | Path | Figure | Robot = "",
    unit: str = "",
    up: str = "",
    rate: float | None = None,
    body_model: str | Path | None = None,
    **changes: Any,
) -> ValidationReport:
    """Judge whatever holds postures: files, folders, patterns, or what was read or computed.

    Parameters
    ----------
    given : path, sequence of path, array, HeldPostures, Postures, NamedConfigurations or Result
        Files, folders of them and patterns, as ``clips/*.bvh``; joints (T, 14, 3), or (T, 19, 3) with the head's
        points, metres, NaN where unknown; or what was read. Motion, that is one posture a frame, is judged by the
        checks over time, too.
    settings : ValidateSettings, optional
        What decides the verdicts; the usual, or what a result was recovered with, if not given.
    urdf : str, path, Figure or Robot
        By which body: what `posekit.Validator` takes.
    unit : str
        What files are in: ``m``, ``cm``, ``mm``, ``in``; else what they say, or what is recognised.
    up : str
        The axis that points up, as ``+y``; else what files say, or what is recognised.
    rate : float, optional
        Frames a second; else what files say. An array is motion where it is given.
    body_model : path, optional
        NPZ of the body model whose angles files have, as AMASS's.
    **changes
        Single settings that are other than those, by the names of the fields of `posekit.ValidateSettings`.

    Returns
    -------
    ValidationReport
        Verdicts and what is behind them; `refused` has a line for each of several files that is broken.

    Raises
    ------
    InputError
        Where a single file is broken or none of several can be judged, or what is asked is impossible.

    Examples
    --------
    >>> import numpy as np, posekit
    >>> standing = np.repeat(posekit.load_figure().neutral_points[None, :14], 20, axis=0)
    >>> posekit.validate(standing, rate=30, up="+z").summary
    {'valid': 20, 'invalid': 0, 'undecided': 0}
    """
    model = None if body_model is None else Path(body_model)
    stated = StatedMotion(unit=unit, up=up, rate=rate, body_model=model)
    asked = AskedValidation(urdf=urdf, settings=settings, changes=changes, stated=stated)
    if isinstance(given, str | Path):
        return validate_files(files_of([Path(given)]), asked)
    if isinstance(given, list | tuple) and given and all(isinstance(one, str | Path) for one in given):
        return validate_files(files_of([Path(one) for one in given]), asked)
    read = _read(given, stated)
    built = ReportBuilder()
    built.add(asked.validator(read), read.postures, own=read.result is not None)
    return built.report({"urdf": asked.told if urdf or not built.own else "as recovered"})


def _read(given: Any, stated: StatedMotion) -> ReadPostures:
    """Lay out what was read or computed."""
    if isinstance(given, NamedConfigurations):
        return ReadPostures(given)
    if isinstance(given, Result):
        return ReadPostures(stated.applied(postures_of_result(given)), given)
    if isinstance(given, HeldPostures):
        return ReadPostures(stated.applied(given))
    postures = given if isinstance(given, Postures) else _postures(given)
    count = len(postures.joints)
    if not count:
        raise InputError("postures: there is none; nothing can be judged; expected at least one")
    none: NDArray[np.intp] = np.zeros(count, dtype=np.intp)
    held = HeldPostures(postures=postures, frame=none, clip=none, time=np.full(count, np.nan))
    return ReadPostures(stated.applied(held))


def _postures(given: Any) -> Postures:
    """Make postures of an array."""
    expected = f"(T, {len(JOINTS)}, 3), or (T, {len(JOINTS) + len(HEAD_POINTS)}, 3) with the head, metres"
    try:
        points = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"postures: no array of numbers, and no path; expected {expected}") from error
    if (
        points.ndim != 3
        or points.shape[1] not in (len(JOINTS), len(JOINTS) + len(HEAD_POINTS))
        or points.shape[2] != 3
    ):
        raise InputError(f"postures: the shape is {points.shape}; expected {expected}")
    head = points[:, len(JOINTS) :]
    return Postures(joints=points[:, : len(JOINTS)], head=head if head.size else None)
