"""What refinement returns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.body import Figure
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.refinement.covariance import covariances
from posekit.refinement.problem import RefinementProblem
from posekit.refinement.size import BodySize
from posekit.refinement.start import measured_state
from posekit.refinement.survival import chi2_survival
from posekit.skeleton import SEGMENTS

REJECTION_PROBABILITY = 1e-3
"""Probability with which noise alone gives a posture that is rejected."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Refined:
    """The most likely postures of N survivors.

    Parameters
    ----------
    figure : Figure
        The person, whose lengths were held or varied.
    frame : int array (N,)
        The frame of each survivor.
    joints : array (N, 14, 3)
        Camera frame, metres; a joint that was not seen stands where its prior left it, and its covariance says so.
        NaN where a survivor could not be placed.
    head : array (N, 5, 3)
        The head's points, likewise; NaN where the head was not seen.
    chi2 : array (N,)
        Sum of squares of all residuals over their standard deviations; infinite where a joint is behind the camera.
    dof : int array (N,)
        Residuals less what they determine, plus one for every limit that is felt and every segment that is held at a
        right angle to its ray by an image beyond its reach.
    start_chi2 : array (N,)
        The same before refinement; never less.
    steps : int array (N,)
        How many steps of the search each survivor took.
    converged : bool array (N,)
        Whether a minimum was reached.
    problem : RefinementProblem
        What was minimised.
    size : BodySize, optional
        How much larger than the figure each body is, where that was not known.
    """

    figure: Figure
    frame: NDArray[np.intp]
    joints: Array
    head: Array
    chi2: Array
    dof: NDArray[np.intp]
    start_chi2: Array
    steps: NDArray[np.intp]
    converged: NDArray[np.bool_]
    problem: RefinementProblem
    size: BodySize | None = None

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    def __len__(self) -> int:
        """Count the survivors."""
        return len(self.frame)

    @staticmethod
    def joined(parts: Sequence[Refined], problem: RefinementProblem) -> Refined:
        """Put the survivors of one part behind those of the last; `problem` is that of all."""
        arrays: dict[str, Any] = {
            item.name: np.concatenate([getattr(part, item.name) for part in parts])
            for item in fields(parts[0])
            if isinstance(getattr(parts[0], item.name), np.ndarray)
        }
        sizes = [part.size for part in parts if part.size is not None]
        size = BodySize(*map(np.concatenate, zip(*sizes, strict=True))) if sizes else None
        out = replace(parts[0], problem=problem, size=size, **arrays)
        if any(
            "covariance" in vars(part) for part in parts
        ):  # found by now of some, and as much work as anything
            vars(out)["covariance"] = np.concatenate([part.covariance for part in parts])
        return out

    def select(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Refined:
        """Return some survivors, by index or mask."""
        chosen = np.arange(len(self))[np.asarray(rows)]
        arrays = {
            item.name: getattr(self, item.name)[chosen]
            for item in fields(self)
            if isinstance(getattr(self, item.name), np.ndarray)
        }
        size = None if self.size is None else self.size.take(chosen)
        return replace(self, problem=self.problem.take(chosen), size=size, **arrays)

    @cached_property
    def p(self) -> Array:
        """The probability that noise alone gives a chi2 as large (N,); zero where it is infinite or NaN."""
        known = np.isfinite(self.chi2)
        return np.where(known, chi2_survival(np.where(known, self.chi2, 0.0), self.dof), 0.0)

    def explained(self, level: float = REJECTION_PROBABILITY) -> NDArray[np.bool_]:
        """Return which survivors (N,) the noise can explain: those with p of at least `level`."""
        if not 0 <= level < 1:
            raise InputError(f"level is {level!r}; expected a probability, zero or more and less than one")
        return np.asarray(self.p >= level)

    @cached_property
    def lengths(self) -> Array:
        """The 17 lengths (N, 17), metres, in the order of `posekit.skeleton.SEGMENT_NAMES`."""
        start, end = np.array(SEGMENTS).T
        return np.asarray(np.linalg.norm(self.joints[:, start] - self.joints[:, end], axis=-1))

    @cached_property
    def q(self) -> Array:
        """Configurations (N, nq) in Pinocchio's order, in closed form."""
        return self.figure.inverse_kinematics(np.concatenate([self.joints, self.head], axis=1))

    @cached_property
    def covariance(self) -> Array:
        """The covariance of every joint (N, 14, 3, 3), square metres, to first order: see `covariances`."""
        factor = np.ones(len(self)) if self.size is None else self.size.factor
        joints = self.joints / factor[:, None, None]
        state = measured_state(self.problem.anatomy, joints, self.head / factor[:, None, None])
        if self.size is None:
            return covariances(self.problem, state)
        inner = covariances(self.problem, state, self.size.gain)
        outer = self.joints[..., None] * self.joints[..., None, :]
        return np.asarray(
            inner * (factor**2)[:, None, None, None] + outer * (self.size.deviation**2)[:, None, None, None]
        )

    @property
    def deviation(self) -> Array:
        """The standard deviation of every joint (N, 14), metres: the root of its covariance's trace."""
        return np.asarray(np.sqrt(np.trace(self.covariance, axis1=2, axis2=3)))
