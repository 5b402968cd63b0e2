"""What is known of where one frame's neck is."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Literal

import numpy as np

from posekit.geometry import Array

Found = Literal["given", "head", "torso", "search", "none"]


def _nothing() -> Array:
    return np.empty((0, 2))


@dataclass(frozen=True, kw_only=True, eq=False)
class NeckPlacement:
    """Where one frame's neck can be, and the places to grow the tree from. Depths are camera z, metres.

    Parameters
    ----------
    method : {"given", "head", "torso", "search", "none"}
        What told; ``none`` where the reason says why nothing did.
    necks : array (n, 3)
        The neck, camera frame, metres: the tree's roots, nearest first.
    misfit : array (n,)
        How far the rigid parts are from closing there, metres; NaN where that is not known.
    estimate : float
        The one depth that the method would tell: of the part's best pose, of the search's best minimum, or as given.
        It is not always one of the necks'.
    residual, unit : float, str
        Of the method: the reprojection error of the part in ``px``, or the least misfit of the search in ``m``.
    deviation : float
        Standard deviation of the depth, to first order, metres (the largest of the part's plausible poses); NaN where
        the search told.
    step : float
        Every depth that is left possible is within this of one of the necks' depths, metres.
    lower, upper : float
        Between which the neck must be: the nearest depth at which the rigid parts close within the tolerance or, where
        none is seen, at which the body is not at the camera; and the farthest at which no segment is too short.
    segment : str
        The segment that is too short for its image beyond `upper`.
    intervals : array (I, 2)
        Depths at which the rigid parts close within the tolerance, whatever the method.
    minima : array (M, 2)
        Depth and misfit of the misfit's local minima, best first.
    curve : array (C, 2)
        Depth and least misfit over all branches; infinite where no branch has a solution.
    closing : int
        How many of the four distances that must close are seen: with one, some depth always closes it.
    tolerance, tangent : float
        Metres by which rigid distances may be off, and a segment too short for its image.
    reason : str
        Why there is no neck; empty where there is one.
    notes : tuple of str
        What was not used, and why.
    """

    method: Found
    necks: Array = field(default_factory=lambda: np.empty((0, 3)))
    misfit: Array = field(default_factory=lambda: np.empty(0))
    estimate: float = np.nan
    residual: float = np.nan
    unit: Literal["px", "m"] = "m"
    deviation: float = np.nan
    step: float = 0.0
    lower: float = np.nan
    upper: float = np.nan
    segment: str = ""
    intervals: Array = field(default_factory=_nothing)
    minima: Array = field(default_factory=_nothing)
    curve: Array = field(default_factory=_nothing)
    closing: int = 0
    tolerance: float = np.nan
    tangent: float = np.nan
    reason: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    @property
    def depths(self) -> Array:
        """The depths of the necks (n,), metres."""
        return self.necks[:, 2]
