"""The input of a placement, checked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from posekit.cameras import PinholeCamera
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.settings.rooting import RootMethod
from posekit.skeleton import HEAD_POINTS, JOINTS, POINTS

REACH_METRES = 0.05
"""Metres within which some neck is of any depth that is possible."""

MAX_NECKS = 12
"""The most necks a frame."""


@dataclass(frozen=True, kw_only=True, eq=False)
class NeckSettings:
    """How `posekit.cameras.neck.place` looks for the neck.

    Parameters
    ----------
    method : {"auto", "head", "torso", "search"}
        From head points, from torso and hips, or by a search along the neck's ray. ``auto`` takes the head where it
        tells the depth well enough, else the torso, else the search.
    deviation : float, array (19,) or (F, 19)
        Standard deviation of each coordinate of each image point, joints then head points, pixels; for a detector's
        `posekit.settings.rooting.DETECTED_DEVIATION`.
    offset : float or array (19,)
        Standard deviation, in metres, of what a point's image shows from the figure's own point: of a neck that is
        really the middle of the shoulders. The neck's own also stands for a head that nods. For detections of a person
        `posekit.settings.rooting.DETECTED_OFFSET`.
    tolerance, tangent : float, optional
        Metres by which the distances inside torso and hips may be off, and a segment too short for its image; by
        default what the deviations lead to (`posekit.cameras.neck.allowance`). A tree that grows from these necks wants
        the same.
    reach : float
        Metres within which some neck shall be of any depth that is possible.
    most : int
        The most necks a frame; where they do not suffice, they are wider apart (`NeckPlacement.step`).
    own_head : array (K, 3)
        Points of the user's own on the head, from its neck, the head's frame, metres; `head_image` has them last.
    """

    method: RootMethod = "auto"
    deviation: ArrayLike = 2.0
    offset: ArrayLike = 0.0
    tolerance: float | None = None
    tangent: float | None = None
    reach: float = REACH_METRES
    most: int = MAX_NECKS
    own_head: ArrayLike = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class PlacementInput:
    """What `posekit.cameras.neck.place` was given, shapes as there; unseen points are NaN in both coordinates.

    Parameters
    ----------
    image : array (F, 14, 2)
        Joints, pixels.
    head_image : array (F, 5 + K, 2)
        Head points, pixels.
    root : array (F, 3)
        Necks that are known, metres.
    deviation : array (F, 19)
        Of image points, pixels.
    offset : array (19,)
        Of what they show, metres.
    settings : NeckSettings
        What else was asked.
    """

    image: Array
    head_image: Array
    root: Array
    deviation: Array
    offset: Array
    settings: NeckSettings

    @classmethod
    def checked(
        cls,
        camera: PinholeCamera,
        image: ArrayLike,
        head_image: ArrayLike | None,
        root: ArrayLike | None,
        settings: NeckSettings,
    ) -> PlacementInput:
        """Check all of it.

        Raises
        ------
        InputError
            Naming the value, the bound and the unit.
        """
        joints = _points("image", image, (len(JOINTS), 2))
        frames = len(joints)
        if camera.K.ndim == 3 and len(camera.K) != frames:
            raise InputError(
                f"the camera has K for {len(camera.K)} frames, the image has {frames}; give one K, or one a frame"
            )
        count = len(HEAD_POINTS) + len(np.reshape(settings.own_head, (-1, 3)))
        head = np.full((frames, count, 2), np.nan)
        if head_image is not None:
            head = _points("head_image", head_image, (count, 2), frames)
        roots = np.full((frames, 3), np.nan)
        if root is not None:
            roots = _points("root", root, (3,), frames)
            behind = np.flatnonzero(roots[:, 2] <= 0)
            if len(behind):
                raise InputError(
                    f"root of frame {behind[0]} is {roots[behind[0]].tolist()} m, behind the camera; expected z > 0"
                )
        for name, least in (("tolerance", 0.0), ("tangent", 0.0), ("reach", 1e-6)):
            value = getattr(settings, name)
            if value is not None and not (np.isfinite(value) and value >= least):
                raise InputError(f"{name} is {value!r} m; expected a finite length of at least {least:g} m")
        if settings.most < 1:
            raise InputError(f"most is {settings.most}; expected at least one neck a frame")
        return cls(
            image=joints,
            head_image=head,
            root=roots,
            deviation=_spread("deviation", settings.deviation, (frames, len(POINTS)), "px"),
            offset=_spread("offset", settings.offset, (len(POINTS),), "m"),
            settings=settings,
        )


def with_own_head(deviations: Array, count: int) -> Array:
    """Append deviations of points of the user's own to those of the head's five (..., 5): their mean."""
    mean = deviations.mean(axis=-1, keepdims=True)
    return np.concatenate([deviations, np.repeat(mean, count, axis=-1)], axis=-1)


def _points(name: str, values: ArrayLike, shape: tuple[int, ...], frames: int | None = None) -> Array:
    """Check points (F, ...): NaN is not seen, half a point neither, infinite is refused."""
    points = np.array(values, dtype=np.float64)
    if points.shape[1:] != shape or (frames is not None and len(points) != frames):
        expected = ("F" if frames is None else str(frames), *map(str, shape))
        raise InputError(
            f"{name} has shape {points.shape}; expected ({', '.join(expected)}), NaN where not seen"
        )
    if np.isinf(points).any():
        where = np.argwhere(np.isinf(points))[0]
        raise InputError(
            f"{name}{where[:-1].tolist()} is infinite; expected finite numbers, or NaN where not seen"
        )
    points[np.isnan(points).any(axis=-1)] = np.nan
    return points


def _spread(name: str, values: ArrayLike, shape: tuple[int, ...], unit: str) -> Array:
    """Broadcast deviations and refuse those that are none."""
    try:
        spread = np.array(np.broadcast_to(np.asarray(values, dtype=np.float64), shape))
    except ValueError as error:
        raise InputError(
            f"{name} has shape {np.shape(values)}; expected one number, or {shape}: the joints, then the head points"
        ) from error
    wrong = np.argwhere(~(np.isfinite(spread) & (spread >= 0)))
    if len(wrong):
        point = POINTS[int(wrong[0][-1])]
        raise InputError(
            f"{name} of {point} is {spread[tuple(wrong[0])]:g} {unit}; expected zero or a positive, finite number"
        )
    return spread
