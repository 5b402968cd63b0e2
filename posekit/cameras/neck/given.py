"""The input of a placement, checked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from posekit.cameras import PinholeCamera
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.skeleton import HEAD_POINTS, JOINTS, POINTS


@dataclass(frozen=True, kw_only=True, eq=False)
class Given:
    """What `posekit.cameras.neck.place` was given, shapes as there; unseen points are NaN in both coordinates."""

    image: Array
    head_image: Array
    root: Array
    deviation: Array
    offset: Array
    tolerance: float | None
    tangent: float | None
    reach: float
    most: int

    @classmethod
    def checked(
        cls,
        camera: PinholeCamera,
        image: ArrayLike,
        head_image: ArrayLike | None,
        root: ArrayLike | None,
        deviation: ArrayLike,
        offset: ArrayLike,
        tolerance: float | None,
        tangent: float | None,
        reach: float,
        most: int,
    ) -> Given:
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
        head = np.full((frames, len(HEAD_POINTS), 2), np.nan)
        if head_image is not None:
            head = _points("head_image", head_image, (len(HEAD_POINTS), 2), frames)
        roots = np.full((frames, 3), np.nan)
        if root is not None:
            roots = _points("root", root, (3,), frames)
            behind = np.flatnonzero(roots[:, 2] <= 0)
            if len(behind):
                raise InputError(
                    f"root of frame {behind[0]} is {roots[behind[0]].tolist()} m, behind the camera; expected z > 0"
                )
        numbers = (("tolerance", tolerance, 0.0), ("tangent", tangent, 0.0), ("reach", reach, 1e-6))
        for name, value, least in numbers:
            if value is not None and not (np.isfinite(value) and value >= least):
                raise InputError(f"{name} is {value!r} m; expected a finite length of at least {least:g} m")
        if most < 1:
            raise InputError(f"most is {most}; expected at least one neck a frame")
        return cls(
            image=joints,
            head_image=head,
            root=roots,
            deviation=_spread("deviation", deviation, (frames, len(POINTS)), "px"),
            offset=_spread("offset", offset, (len(POINTS),), "m"),
            tolerance=tolerance,
            tangent=tangent,
            reach=reach,
            most=int(most),
        )


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
