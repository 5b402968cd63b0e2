"""Placing the neck, frame by frame: given, or from the head, the torso, or a search along its ray."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike

from posekit.body import Figure
from posekit.cameras import PinholeCamera
from posekit.cameras.neck.allowance import NeckAllowance, allowances
from posekit.cameras.neck.body import NeckRays, sight
from posekit.cameras.neck.closure import RigidClosure
from posekit.cameras.neck.cover import cover, meet
from posekit.cameras.neck.given import NeckSettings, PlacementInput, with_own_head
from posekit.cameras.neck.head import head_suggestion
from posekit.cameras.neck.placement import NeckPlacement
from posekit.cameras.neck.search import NeckDepths, search
from posekit.cameras.neck.suggestion import KEPT_SIGMAS, PartSuggestion
from posekit.cameras.neck.torso import torso_suggestion
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.settings.rooting import RootMethod
from posekit.skeleton import JOINTS

DEFAULT_NECK_SETTINGS = NeckSettings()

CLOSED_METRES = 1e-8
"""Misfit (m) of a minimum at which the image points are exact, so that the depth is too."""


def place(
    camera: PinholeCamera,
    figure: Figure,
    image: ArrayLike,
    head_image: ArrayLike | None = None,
    *,
    root: ArrayLike | None = None,
    settings: NeckSettings = DEFAULT_NECK_SETTINGS,
    **changes: Any,
) -> list[NeckPlacement]:
    """Find where the neck is in F frames.

    Always within the depths that a search along the neck's ray leaves.

    Parameters
    ----------
    camera : PinholeCamera
        With one K, or one a frame.
    figure : Figure
        With the person's lengths and head.
    image : array (F, 14, 2)
        The joints, pixels; NaN where not seen.
    head_image : array (F, 5 + K, 2), optional
        Nose, eyes and ears, likewise, then points of the user's own on the head (`NeckSettings.own_head`).
    root : array (F, 3), optional
        The neck where it is known, camera frame, metres; NaN elsewhere.
    settings : NeckSettings
        How it is looked for.
    changes
        Fields of the settings that are to differ: ``place(camera, figure, image, method="head")``.

    Returns
    -------
    list of NeckPlacement
        One a frame.

    Raises
    ------
    InputError
        Where a shape or a number is impossible.
    """
    settings = replace(settings, **changes)
    given = PlacementInput.checked(camera, image, head_image, root, settings)
    method = settings.method
    if method not in get_args(RootMethod):
        raise InputError(
            f"method {method!r} places no neck; expected one of {', '.join(get_args(RootMethod))}"
        )
    allowed = allowances(camera, figure, given)
    seen = sight(camera, figure, given.image, allowed.tangent)
    upper = seen.farthest[:, 0]
    usable = np.flatnonzero((upper > seen.nearest) & np.isfinite(upper))
    closure, found = search(seen, usable, allowed.rigid[usable])
    depths = dict(zip(usable.tolist(), found, strict=True))
    parts = _suggestions(camera, figure, given, seen.rays[:, 0], method)
    placements = []
    for frame in range(len(given.image)):
        if np.isfinite(given.root[frame]).all():
            placements.append(_as_given(given, seen, closure, depths.get(frame), frame, allowed))
        elif frame in depths:
            placements.append(_choose(given, seen, closure, depths[frame], parts, method, frame, allowed))
        else:
            placements.append(NeckPlacement(method="none", reason=_why(seen, frame)))
    return placements


def _suggestions(
    camera: PinholeCamera, figure: Figure, given: PlacementInput, ray: Array, method: RootMethod
) -> list[PartSuggestion]:
    """Ask the rigid parts that the method allows, in the order in which they are believed."""
    n, parts = len(JOINTS), []
    if method in ("auto", "head"):
        own = np.asarray(given.settings.own_head, dtype=np.float64).reshape(-1, 3)
        parts.append(
            head_suggestion(
                camera,
                np.concatenate([figure.head_points[1:], own]),
                given.head_image,
                ray,
                with_own_head(given.deviation[:, n:], len(own)),
                with_own_head(given.offset[n:], len(own)),
                float(given.offset[0]),
            )
        )
    if method in ("auto", "torso"):
        of_torso = given.deviation[:, :n], given.offset[:n]
        parts.append(torso_suggestion(camera, figure, given.image, ray, *of_torso))
    return parts


def _choose(
    given: PlacementInput,
    seen: NeckRays,
    closure: RigidClosure,
    depths: NeckDepths,
    parts: list[PartSuggestion],
    method: RootMethod,
    frame: int,
    allowed: NeckAllowance,
) -> NeckPlacement:
    """Take the first part that suffices, or else the search, and choose depths from what it leaves."""
    z = float(seen.rays[frame, 0, 2])
    searched = _searched(depths, z, allowed, frame)
    if not len(depths.intervals):
        return replace(searched, reason=_does_not_close(depths, z, searched.tolerance))
    notes: list[str] = []
    for part in parts:
        if part.reasons[frame] and (method == "auto" or not part.found(frame)):
            notes.append(part.reasons[frame])
            continue
        left = meet(depths.intervals, part.intervals(frame))
        if not len(left):
            notes.append(_outside(part, depths, frame, z))
            continue
        necks = _necks(given, seen, closure, depths, left, frame)
        return replace(
            searched,
            **necks,
            method=part.part,
            estimate=float(part.distance[frame, 0]) * z,
            residual=float(part.rms[frame]),
            unit="px",
            deviation=float(np.nanmax(part.deviation[frame])) * z,
            notes=tuple(notes),
        )
    if method in ("head", "torso"):
        return replace(searched, reason=notes[-1])
    necks = _necks(given, seen, closure, depths, depths.intervals, frame)
    best = searched.minima[0] if len(searched.minima) else (np.nan, np.nan)
    return replace(
        searched,
        **necks,
        method="search",
        estimate=float(best[0]),
        residual=float(best[1]),
        notes=tuple(notes),
    )


def _necks(
    given: PlacementInput, seen: NeckRays, closure: RigidClosure, depths: NeckDepths, left: Array, frame: int
) -> dict[str, Any]:
    """Choose exact minima in what is left of the intervals, or samples that cover it."""
    ray = seen.rays[frame, 0]
    closed = depths.minima[depths.residual <= CLOSED_METRES]
    beside = np.maximum(left[:, 0] - closed[:, None], closed[:, None] - left[:, 1])
    closed = np.sort(closed[(beside <= CLOSED_METRES).any(axis=1)])
    # One distance alone closes at some depth however wrong the image is: that does not say that it is exact.
    trusted = depths.known > 1 or (given.deviation[frame] == 0).all()
    if len(closed) and trusted:
        samples, step = closed, 0.0
    else:
        samples, step = cover(left, given.settings.reach, given.settings.most)
    misfit = (
        closure.least(np.full(len(samples), frame), samples)
        if depths.known
        else np.full(len(samples), np.nan)
    )
    return {"necks": samples[:, None] * ray, "misfit": misfit, "step": step * float(ray[2])}


def _as_given(
    given: PlacementInput,
    seen: NeckRays,
    closure: RigidClosure,
    depths: NeckDepths | None,
    frame: int,
    allowed: NeckAllowance,
) -> NeckPlacement:
    """Keep a root that is given, and say where it stands to the search's depths."""
    root = given.root[frame]
    if depths is None:
        return NeckPlacement(
            method="given", necks=root[None], misfit=np.array([np.nan]), estimate=float(root[2])
        )
    z = float(seen.rays[frame, 0, 2])
    at = float(seen.rays[frame, 0] @ root)
    misfit = closure.least(np.array([frame]), np.array([at])) if depths.known else np.array([np.nan])
    beside = np.maximum(depths.intervals[:, 0] - at, at - depths.intervals[:, 1]).min(initial=np.inf)
    notes = (
        ()
        if beside <= CLOSED_METRES
        else (f"the given neck, {root[2]:.4g} m away, is {_feasible(depths, z)}",)
    )
    return replace(
        _searched(depths, z, allowed, frame),
        method="given",
        necks=root[None].copy(),
        estimate=float(root[2]),
        misfit=misfit,
        residual=float(misfit[0]),
        notes=notes,
    )


def _searched(depths: NeckDepths, z: float, allowed: NeckAllowance, frame: int) -> NeckPlacement:
    """Say what the search found of a frame, as depths; z is the ray's."""
    return NeckPlacement(
        method="none",
        lower=(float(depths.intervals[0, 0]) if len(depths.intervals) else depths.lower) * z,
        upper=depths.upper * z,
        segment=depths.segment,
        intervals=depths.intervals * z,
        minima=np.stack([depths.minima * z, depths.residual], axis=-1),
        curve=np.stack([depths.curve * z, depths.curve_residual], axis=-1),
        closing=depths.known,
        tolerance=float(allowed.rigid[frame]),
        tangent=float(allowed.tangent[frame]),
    )


def _outside(part: PartSuggestion, depths: NeckDepths, frame: int, z: float) -> str:
    """Say that a part's depth is none that the search leaves."""
    at, deviation = float(part.distance[frame, 0]) * z, float(part.deviation[frame, 0]) * z
    return (
        f"the {part.part} is not used: it puts the neck at {at:.4g} m, {KEPT_SIGMAS:g} standard deviations of "
        f"{deviation:.2g} m and more {_feasible(depths, z)}"
    )


def _feasible(depths: NeckDepths, z: float) -> str:
    ranges = ", ".join(f"{low:.4g} to {high:.4g}" for low, high in depths.intervals * z) or "none"
    return f"outside of the depths at which the rigid parts close ({ranges} m)"


def _does_not_close(depths: NeckDepths, z: float, tolerance: float) -> str:
    """Say by how much the rigid parts do not close at any depth."""
    if not len(depths.minima):
        return (
            f"at no depth up to {depths.upper * z:.4g} m have shoulders, pelvis and hips a solution together; check "
            "the image points and the lengths"
        )
    return (
        f"the rigid parts close at no depth within {tolerance:.3g} m: they miss by {depths.residual[0]:.3g} m at best, "
        f"{depths.minima[0] * z:.4g} m away; check shoulders, pelvis, hips and their lengths, or allow more tolerance"
    )


def _why(seen: NeckRays, frame: int) -> str:
    """Say why a frame cannot be searched."""
    upper = seen.farthest[frame, 0]
    if np.isnan(upper):
        return "the neck, from which the tree grows, is not seen"
    if np.isinf(upper):
        return (
            "nothing bounds how far away the neck is: no other joint is seen elsewhere in the image; add shoulders and "
            "pelvis"
        )
    return (
        f"{seen.segment(frame)} is too short for its image at any distance: the neck would be within {upper:.3g} m of "
        "the camera; check the image points, K and the unit of the lengths"
    )
