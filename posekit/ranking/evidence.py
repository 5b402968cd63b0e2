"""The survivors that `rank` compares and the evidence on them, checked once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.ranking.depth import Depth
from posekit.ranking.image_term import rigid_lengths
from posekit.ranking.posture_prior import TERM_NAMES
from posekit.ranking.upright import Up
from posekit.skeleton import JOINTS

MAX_COORDINATE_METRES: Final = 1e6
"""Coordinates beyond this are taken for a mistake: no body is seen from there, and squares stay finite."""


DEFAULT_DEVIATION_METRES: Final = 0.012
"""Metres by which survivors are off, where nobody says: 2 px at 4 m, or a torso that gives."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RankingEvidence:
    """Survivors of F frames and the evidence on them; made by `RankingEvidence.of`.

    Parameters
    ----------
    joints : array (N, 14, 3)
        Survivors, camera frame, metres; NaN where a joint is not known.
    frame : int array (N,)
        The frame of each survivor, from 0.
    deviation : array (F,)
        How far off the joints of each frame's survivors are, metres; F is one more than the highest frame.
    lengths : array (4,), optional
        The person's distances inside torso and hips, metres, in the order of `posekit.skeleton.RIGID_SEGMENTS`.
    length_residual : array (N,), optional
        How much too short each survivor's worst segment was for its image, metres.
    chi2 : array (N,), optional
        The chi-square of each refined survivor; NaN where it has none.
    up : Up, optional
        Which way is up in the camera's frame.
    depth : Depth, optional
        Estimates of the neck's depth.
    """

    joints: Array
    frame: NDArray[np.intp]
    deviation: Array
    lengths: Array | None
    length_residual: Array | None
    chi2: Array | None
    up: Up | None
    depth: Depth | None

    @staticmethod
    def of(
        joints: ArrayLike,
        lengths: Mapping[str, float] | None = None,
        *,
        frame: ArrayLike | None = None,
        length_residual: ArrayLike | None = None,
        chi2: ArrayLike | None = None,
        deviation: ArrayLike = DEFAULT_DEVIATION_METRES,
        up: Up | None = None,
        depth: Depth | None = None,
    ) -> RankingEvidence:
        """Gather the evidence, and check each part of it against the others.

        Parameters
        ----------
        joints : array (N, 14, 3)
            Survivors, camera frame, metres; NaN where a joint is not known.
        lengths : mapping, optional
            The person's, by segment name, metres. Without them and `chi2` the image says
            nothing, nor does foreshortening.
        frame : int array (N,), optional
            The frame of each survivor, from 0, in any order; without it all are of one frame.
        length_residual : array (N,), optional
            How much too short each survivor's worst segment was for its image, metres.
        chi2 : array (N,), optional
            Of a refinement: then the image's term is minus its half. NaN counts as the largest of its frame.
        deviation : float or array (F,)
            How far off survivors' joints are, metres (`deviation_of_noise`, `deviation_of_tolerance`): the deviation of
            distances inside torso and hips, and what blurs the prior on postures.
        up : Up, optional
            Which way is up in the camera's frame. Without it gravity, balance and contact say nothing.
        depth : Depth, optional
            Estimates of the neck's depth, frame by frame. Without them depth says nothing.

        Raises
        ------
        InputError
            Where a shape is wrong, a joint is beyond `MAX_COORDINATE_METRES` or evidence is given for too few frames.
        """
        positions = numbers("joints", joints, (None, len(JOINTS), 3))
        if (np.abs(positions) > MAX_COORDINATE_METRES).any():
            raise InputError(
                f"joints: a coordinate beyond {MAX_COORDINATE_METRES:g} m; expected metres, "
                "NaN where a joint is not known"
            )
        count = len(positions)
        frames = _frames(frame, count)
        highest = int(frames.max(initial=-1)) + 1
        for what, values in (
            ("up", None if up is None or up.direction.ndim == 1 else up.direction),
            ("depth", None if depth is None else depth.estimate),
        ):
            if values is not None and len(values) < highest:
                raise InputError(
                    f"{what} is given for {len(values)} frames; expected {highest}, as survivors are of"
                )
        likelihood = None if chi2 is None else numbers("chi2", chi2, (count,))
        if likelihood is not None and (likelihood < 0).any():
            raise InputError(
                "chi2: a negative sum of squares; expected zero or more, NaN where there is none"
            )
        return RankingEvidence(
            joints=positions,
            frame=frames,
            deviation=_deviation(deviation, highest),
            lengths=None if lengths is None else rigid_lengths(lengths),
            length_residual=None
            if length_residual is None
            else numbers("length_residual", length_residual, (count,)),
            chi2=likelihood,
            up=up,
            depth=depth,
        )

    @property
    def possible(self) -> list[str]:
        """The names of the terms for which there is evidence."""
        upright, seen = self.up is not None, self.lengths is not None or self.chi2 is not None
        there = {
            "image": seen,
            "foreshortening": seen,
            "gravity": upright,
            "balance": upright,
            "contact": upright,
            "depth": self.depth is not None,
        }
        return [name for name in TERM_NAMES if there.get(name, True)]


def numbers(name: str, given: ArrayLike, shape: tuple[int | None, ...]) -> Array:
    """Return an array of a shape, None for any size.

    Raises
    ------
    InputError
        Where it has another shape or is no array of numbers.
    """
    spelled = ", ".join("N" if size is None else str(size) for size in shape) + (
        "," if len(shape) == 1 else ""
    )
    try:
        values = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name} is no array of numbers; expected shape ({spelled})") from None
    if values.ndim != len(shape) or any(
        wanted not in (None, size) for wanted, size in zip(shape, values.shape, strict=True)
    ):
        raise InputError(f"{name} has shape {values.shape}; expected ({spelled})")
    return values


def _frames(frame: ArrayLike | None, count: int) -> NDArray[np.intp]:
    if frame is None:
        return np.zeros(count, dtype=np.intp)
    given = np.array(frame)
    if given.shape != (count,) or (count and given.dtype.kind not in "iu") or (given < 0).any():
        raise InputError(
            f"frame is {given.dtype} of shape {given.shape}; expected whole numbers from 0, ({count},)"
        )
    return given.astype(np.intp)


def _deviation(given: ArrayLike, frames: int) -> Array:
    values = np.asarray(given, dtype=np.float64)
    if values.ndim > 1 or (values.ndim == 1 and len(values) < frames):
        raise InputError(
            f"deviation has shape {values.shape}; expected one number, or one a frame, ({frames},)"
        )
    if not (np.isfinite(values) & (values >= 0)).all():
        raise InputError("deviation: expected finite metres, zero or more")
    return np.broadcast_to(values, frames) if values.ndim == 0 else values[:frames]
