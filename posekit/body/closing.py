r"""Lengths that miss closing, laid onto the nearest body that closes.

Six distances make a torso, and three make hips, only where triangles close and the four points of the torso fit into
space. Medians over frames, tapes and rounded numbers miss that by a little. The nearest lengths that close lie at the
edge of what closes, where the torso's points are in one plane, or the hips' on one line:

.. math:: \min_p \sum_i \left(\frac{\log d_i(p) - \log l_i}{\sigma_i}\right)^2

over places p of the points in that plane or on that line, for lengths l of relative standard deviations
:math:`\sigma`. A size that is common to all lengths and not known changes nothing: what closes, closes in every size.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from posekit.body.lengths import hips_points, torso_points
from posekit.body.uncertainty import MEASURED_LENGTHS, LengthUncertainty
from posekit.errors import FigureError
from posekit.geometry import Array
from posekit.least_squares import (
    Damping,
    Rows,
    State,
    Stopping,
    minimise,
    normal_equations,
    solve_each,
)

TORSO_LENGTHS: Final = (
    "neck-right_shoulder",
    "neck-left_shoulder",
    "neck-pelvis",
    "right_shoulder-left_shoulder",
    "right_shoulder-pelvis",
    "left_shoulder-pelvis",
)
"""The six distances inside the torso."""

HIPS_LENGTHS: Final = ("pelvis-right_hip", "pelvis-left_hip", "right_hip-left_hip")
"""The three distances inside the hips."""

MAX_MOVED: Final = 0.2
"""The most by which a length is moved, as a fraction of it.

What adults differ in a segment beside their size has a standard deviation of 5 %
(`posekit.body.uncertainty.UNKNOWN_ADULT`): four of them from what was given is nobody it was measured of.
"""

LEAST_WIDTH_PART: Final = 0.25
"""Of a breadth: how far beside the middle a point starts at least, since on the line itself no distance pulls it."""

CLOSING_DAMPING: Final = Damping(
    initial=1e-6, smallest=1e-12, largest=1e8, growth=10.0, decay=0.1, light=1e-3
)
CLOSING_STOPPING: Final = Stopping(steps=200, precision=1e-20, smallest=1e-28)


@dataclass(frozen=True, kw_only=True)
class ClosedLengths:
    """Lengths that close.

    Parameters
    ----------
    lengths : mapping
        Metres, by segment name.
    moved : mapping
        By how much those were changed that had to be, metres; empty where all closed.
    """

    lengths: Mapping[str, float]
    moved: Mapping[str, float]


def closed_lengths(lengths: Mapping[str, float], known: LengthUncertainty | None = None) -> ClosedLengths:
    """Return the nearest lengths that make a torso and hips; those that make them already stay as they are.

    Parameters
    ----------
    lengths : mapping
        All 17, metres, by segment name.
    known : LengthUncertainty, optional
        How well each is known beside their common size; as a measured body's if not given. Where some of the lengths
        of a part are exact, all of them count alike.

    Raises
    ------
    FigureError
        Where a length would have to change by more than `MAX_MOVED` of it: then they are no body's.
    """
    out = dict(lengths)
    moved: dict[str, float] = {}
    for names, points, axes in ((TORSO_LENGTHS, torso_points, 2), (HIPS_LENGTHS, hips_points, 1)):
        try:
            points(lengths)
        except FigureError as error:
            new = _nearest(names, lengths, known or MEASURED_LENGTHS, axes)
            worst = max(abs(new[name] / lengths[name] - 1) for name in names)
            if not worst <= MAX_MOVED:
                raise FigureError(
                    f"{error}; the nearest body has a length that is {worst:.0%} other"
                ) from None
            points(new)
            out |= new
            moved |= {name: new[name] - lengths[name] for name in names}
    return ClosedLengths(lengths=MappingProxyType(out), moved=MappingProxyType(moved))


def closing_line(moved: Mapping[str, float]) -> str:
    """Say in a line which lengths were changed to close, and by how much; nothing where none was."""
    if not moved:
        return ""
    parts = []
    for part, names in (("torso", TORSO_LENGTHS), ("hips", HIPS_LENGTHS)):
        own = {name: moved[name] for name in names if name in moved}
        if own:
            most = max(own, key=lambda name: abs(own[name]))
            parts.append(f"of the {part} {most} most, by {own[most] * 1000:+.3g} mm")
    return f"lengths do not close and were changed to the nearest body's: {', '.join(parts)}"


def _nearest(
    names: tuple[str, ...], lengths: Mapping[str, float], known: LengthUncertainty, axes: int
) -> dict[str, float]:
    """Return the lengths of a part's points, in a plane or on a line, that are nearest to those given."""
    own = np.array([known.own[name] for name in names])
    wanted = np.log([lengths[name] for name in names])
    flat = _FlatPart(
        places=_PLACES[axes],
        ends=_ENDS[axes],
        wanted=wanted,
        weight=1.0 / own if own.all() else np.ones(len(own)),
    )
    start = _torso_start(lengths) if axes == 2 else _hips_start(lengths)
    found = minimise(flat, (start[None],), CLOSING_DAMPING, CLOSING_STOPPING)
    return dict(zip(names, flat.distances(found.state[0])[0].tolist(), strict=True))


def _torso_start(lengths: Mapping[str, float]) -> Array:
    """Place the pelvis below the neck, and each shoulder on its side, as far as its triangle closes."""
    down, width = lengths["neck-pelvis"], lengths["right_shoulder-left_shoulder"]
    start = [down]
    for side, sign in (("right", -1.0), ("left", 1.0)):
        near, far = lengths[f"neck-{side}_shoulder"], lengths[f"{side}_shoulder-pelvis"]
        along = (down**2 + near**2 - far**2) / (2 * down)
        beside = math.sqrt(max(near**2 - along**2, 0.0))
        start += [sign * max(beside, LEAST_WIDTH_PART * width), -along]
    return np.array(start)


def _hips_start(lengths: Mapping[str, float]) -> Array:
    """Place the hips on both sides of the pelvis, or on one where that is nearer."""
    right, left, width = (lengths[name] for name in HIPS_LENGTHS)
    if width >= max(right, left):
        return np.array([-right, left])
    return np.array([-right, -left]) if right > left else np.array([right, left])


@dataclass(frozen=True, kw_only=True, eq=False)
class _FlatPart:
    """Points of a part in a plane, or on a line, and the logarithms of distances that they should have."""

    places: Array
    ends: Array
    wanted: Array
    weight: Array

    def distances(self, unknowns: Array) -> Array:
        """Return the distances (N, K)."""
        return np.asarray(np.linalg.norm(self._gaps(unknowns), axis=-1))

    def _gaps(self, unknowns: Array) -> Array:
        points = np.einsum("pam,nm->npa", self.places, unknowns)
        return np.asarray(points[:, self.ends[:, 1]] - points[:, self.ends[:, 0]])

    def linearise(self, rows: Rows, state: State) -> State:
        """Return cost, residuals and derivatives; see `posekit.least_squares`."""
        del rows
        gap = self._gaps(state[0])
        square = np.einsum("nka,nka->nk", gap, gap)
        with np.errstate(divide="ignore", invalid="ignore"):
            residual = self.weight * (0.5 * np.log(square) - self.wanted)
            along = self.places[self.ends[:, 1]] - self.places[self.ends[:, 0]]
            jacobian = np.einsum("nka,kam->nkm", gap, along) * (self.weight / square)[..., None]
        return np.einsum("nk,nk->n", residual, residual), residual, jacobian

    def step(self, rows: Rows, state: State, here: State, damping: Array) -> tuple[Array, Array]:
        """Return damped steps and what they promise."""
        del rows, state
        normal, gradient = normal_equations(here[1], here[2])
        damped = normal + damping[:, None, None] * np.einsum("nii->ni", normal)[:, None] * np.eye(
            normal.shape[1]
        )
        step = -solve_each(damped, gradient)
        return step, -np.einsum("ni,ni->n", step, gradient)

    def moved(self, rows: Rows, state: State, step: Array) -> State:
        """Return the unknowns after steps."""
        del rows
        return (state[0] + step,)


def _places(*rows: tuple[int, int, int, float], points: int, axes: int, unknowns: int) -> Array:
    """Return how unknowns place points (P, A, M); each row says point, axis, unknown and factor."""
    places = np.zeros((points, axes, unknowns))
    for point, axis, unknown, factor in rows:
        places[point, axis, unknown] = factor
    return places


_PLACES: Final = {
    # Neck, right shoulder, left shoulder, pelvis, by the pelvis's depth and the place of each shoulder.
    2: _places(
        (1, 0, 1, 1.0),
        (1, 1, 2, 1.0),
        (2, 0, 3, 1.0),
        (2, 1, 4, 1.0),
        (3, 1, 0, -1.0),
        points=4,
        axes=2,
        unknowns=5,
    ),
    # Pelvis, right hip, left hip.
    1: _places((1, 0, 0, 1.0), (2, 0, 1, 1.0), points=3, axes=1, unknowns=2),
}
_ENDS: Final = {
    2: np.array([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]),
    1: np.array([(0, 1), (0, 2), (1, 2)]),
}
