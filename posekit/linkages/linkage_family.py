"""The family of solutions behind one uncalibrated image: a scale, and one sign for each segment (Taylor 2000, §2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.errors import CameraError, InputError
from posekit.geometry import Array
from posekit.linkages.incidence import Incidence, incidence
from posekit.linkages.linkage import Linkage

Flips = NDArray[np.int8]

MAX_COORDINATE_PIXELS = 1e9
"""Pixels; no picture is larger."""

AT_BOUND = 1e-12
"""Of the bound: so little below it, a scale is at it, and so near to it, a segment is foreshortened to nothing."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LinkageFamily:
    r"""All postures of a linkage that give one image under a scaled orthographic camera.

    For a scale s each segment is foreshortened by
    :math:`dZ = \sqrt{l^2 - (\Delta u^2 + \Delta v^2)/s^2}` (Taylor 2000, eq. 2), toward the camera or away from it:
    2^S flips. The root stays real for :math:`s \ge \sqrt{\Delta u^2 + \Delta v^2}/l` (his eq. 3, printed upside down);
    the bound of the object is the largest of its segments'.

    Parameters
    ----------
    linkage : Linkage
        The object.
    image : array (P, 2)
        Its points in the image, pixels; NaN where one is not seen.
    aspect : float
        Width of a pixel over its height: u is rescaled by it, and s counts in v.

    Raises
    ------
    InputError
        Where the image has another shape, a point that is not finite or half known, or no segment.
    CameraError
        Where the aspect ratio is not finite and positive.
    """

    linkage: Linkage
    image: Array
    aspect: float = 1.0

    def __post_init__(self) -> None:
        linkage = self.linkage
        where = f"linkage {linkage.name}"
        image = np.array(self.image, dtype=np.float64)
        if image.shape != (len(linkage.points), 2):
            raise InputError(
                f"{where}: image points of shape {image.shape}; expected ({len(linkage.points)}, 2), one for each point"
            )
        for point, place in zip(linkage.points, image, strict=True):
            if (np.abs(place) > MAX_COORDINATE_PIXELS).any() or np.isnan(place).sum() == 1:
                raise InputError(
                    f"{where}: image point {point} is ({place[0]:g}, {place[1]:g}); expected two finite numbers of "
                    f"at most {MAX_COORDINATE_PIXELS:g} pixels, or leave it out"
                )
        if not (np.isfinite(self.aspect) and self.aspect > 0):
            raise CameraError(f"aspect must be finite and positive; got {self.aspect:g}")
        image.flags.writeable = False
        object.__setattr__(self, "image", image)
        if not self.seen.any():
            missing = [
                point for point, place in zip(linkage.points, image, strict=True) if np.isnan(place[0])
            ]
            raise InputError(
                f"{where}: no segment is seen at both ends (not seen: {', '.join(missing[:6])}); add image points"
            )

    @cached_property
    def place(self) -> Array:
        """Where the nodes are seen (N, 2), in square pixels."""
        place: Array = self.linkage.place_nodes(self.image * np.array([self.aspect, 1.0]))
        return place

    @cached_property
    def extent(self) -> Array:
        """Length of each segment's image (S,), pixels; NaN where an end is not seen."""
        ends = np.array(self.linkage.segments)
        extent: Array = np.linalg.norm(self.place[ends[:, 1]] - self.place[ends[:, 0]], axis=1)
        return extent

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Which segments are seen at both ends (S,)."""
        seen: NDArray[np.bool_] = np.isfinite(self.extent)
        return seen

    @property
    def bounds(self) -> Array:
        """The least scale that each segment allows (S,), pixels a unit of length; NaN where it is not seen."""
        bounds: Array = self.extent / self.linkage.lengths
        return bounds

    @property
    def minimum_scale(self) -> float:
        """The least scale that all segments allow; the paper's default (§3.1)."""
        return float(np.nanmax(self.bounds))

    @property
    def bounding(self) -> int:
        """Index of the segment that sets the bound."""
        return int(np.nanargmax(self.bounds))

    @property
    def bounding_segment(self) -> str:
        """Name of the segment that sets the bound."""
        return self.linkage.segment_names[self.bounding]

    @cached_property
    def incidence(self) -> Incidence:
        """The matrices of what is seen."""
        return incidence(self.linkage, self.seen.tolist())

    def foreshortening(self, s: ArrayLike) -> Array:
        """Return dZ >= 0 of each segment at some scales (..., S), units of length (Taylor 2000, eq. 2).

        Parameters
        ----------
        s : float or array (...)
            Pixels a unit of length.

        Raises
        ------
        CameraError
            Where a scale is not finite and positive, or below the bound: names the segment and what it needs.
        """
        scale = np.asarray(s, dtype=np.float64)
        if not (np.isfinite(scale) & (scale > 0)).all():
            raise CameraError(
                f"scale s is {_first(scale, np.isfinite(scale) & (scale > 0)):g}; expected a finite "
                "number above zero"
            )
        bound = self.minimum_scale
        allowed = scale >= bound * (1 - AT_BOUND)
        if not allowed.all():
            name, length = self.bounding_segment, float(self.linkage.lengths[self.bounding])
            low = _first(scale, allowed)
            raise CameraError(
                f"scale s = {low:.9g} is below the bound: {name} (length {length:g}) is "
                f"{self.extent[self.bounding]:.6g} pixels long in the image and needs s >= {bound:.9g}"
            )
        # l^2 - e^2 as (l - e) (l + e): near the bound the difference of squares would lose half the digits.
        apart = self.extent / scale[..., None]
        lengths = self.linkage.lengths
        return np.sqrt(np.maximum((lengths - apart) * (lengths + apart), 0.0))

    def vanished(self, s: ArrayLike) -> NDArray[np.bool_]:
        """Return which segments are foreshortened to nothing (..., S): both of their flips are one."""
        scale = np.asarray(s, dtype=np.float64)
        gone: NDArray[np.bool_] = self.bounds >= scale[..., None] * (1 - AT_BOUND)
        return gone

    def depths(self, s: ArrayLike, flips: ArrayLike) -> Array:
        """Return the depth of all nodes relative to the root's (..., N); NaN where no seen segment leads to it.

        A loop that does not close is averaged: its segments then have lengths a little off.

        Parameters
        ----------
        s : float or array (...)
            Scales, pixels a unit of length, at or above the bound.
        flips : array (..., S)
            +1 where the first end of a segment is nearer, -1 where its second is; 0 only where it is
            foreshortened to nothing or not seen.

        Raises
        ------
        CameraError
            As `foreshortening` does.
        InputError
            Where a flip is none of the three, or 0 for a segment that has two.
        """
        foreshortening = self.foreshortening(s)
        sigma = np.asarray(flips, dtype=np.float64)
        if sigma.shape[-1:] != (len(self.linkage.segments),) or not np.isin(sigma, (-1, 0, 1)).all():
            raise InputError(
                f"linkage {self.linkage.name}: flips of shape {sigma.shape}; expected -1, 0 or 1 for each of its "
                f"{len(self.linkage.segments)} segments"
            )
        open_ = (sigma == 0) & ~(self.vanished(s) | ~self.seen)
        if open_.any():
            name = self.linkage.segment_names[int(np.argwhere(open_)[0][-1])]
            raise InputError(
                f"linkage {self.linkage.name}: no flip for {name}; say which end is nearer, 1 or -1"
            )
        signed = np.where(self.seen, sigma * foreshortening, 0.0)
        depth = signed @ self.incidence.depth.T
        return np.where(self.incidence.placed, depth, np.nan)

    def points(self, s: ArrayLike, flips: ArrayLike) -> Array:
        """Place the points (..., P, 3) in units of length: x, y from the image, depth relative to the root's.

        Parameters
        ----------
        s, flips
            As `depths` has them.
        """
        depth = self.depths(s, flips)
        place = self.place / np.asarray(s, dtype=np.float64)[..., None, None]
        nodes = np.concatenate([np.broadcast_to(place, (*depth.shape, 2)), depth[..., None]], axis=-1)
        return nodes[..., : len(self.linkage.points), :]

    def flips_of(self, points: ArrayLike) -> Flips:
        """Return the flips (..., S) of postures given by their points (..., P, 3): 0 where both ends are level."""
        nodes = self.linkage.place_nodes(np.asarray(points, dtype=np.float64))
        ends = np.array(self.linkage.segments)
        return np.sign(nodes[..., ends[:, 1], 2] - nodes[..., ends[:, 0], 2]).astype(np.int8)


def read_nearer(linkage: Linkage, choices: Mapping[str, str]) -> Flips:
    """Turn flips given by hand, a segment's name to its nearer end, into flips (S,); 0 where none is given.

    Raises
    ------
    InputError
        Where a segment or its end is not known.
    """
    flips = np.zeros(len(linkage.segments), dtype=np.int8)
    for name, end in choices.items():
        number = linkage.segment(name)
        a, b = (linkage.nodes[node] for node in linkage.segments[number])
        if end not in (a, b):
            raise InputError(f"linkage {linkage.name}: nearer end of {name} is {end!r}; expected {a} or {b}")
        flips[number] = 1 if end == a else -1
    return flips


def name_nearer(linkage: Linkage, flips: ArrayLike) -> dict[str, str]:
    """Turn flips (S,) into choices by name, a segment to its nearer end: what `read_nearer` reads."""
    return {
        name: linkage.nodes[ends[0] if flip > 0 else ends[1]]
        for name, ends, flip in zip(
            linkage.segment_names, linkage.segments, np.asarray(flips).tolist(), strict=True
        )
        if flip != 0
    }


def _first(values: Array, good: NDArray[np.bool_]) -> float:
    """Return the first value that is not good."""
    return float(values[~good].flat[0])
