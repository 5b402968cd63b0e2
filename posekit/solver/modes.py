"""The modes of a frame's posterior: evidence, covariance, and the test whether two minima are one mode."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from posekit.geometry import Array, Flags, Ints
from posekit.solver import reference
from posekit.solver.engine import run
from posekit.solver.problem import RESIDUAL_NAMES, Problem

#: Two minima are the same mode if no joint, relative to the neck, differs by more than this.
MERGE_DISTANCE_METRES: Final = 0.01

#: Two minima are different modes if any joint, relative to the neck, differs by more than this.
MERGE_REACH_METRES: Final = 0.08

#: Two minima whose largest difference is between these distances are the same mode if the difference d of all unknowns
#: has :math:`d^T H d` below this value (three standard deviations, squared). H is the information matrix of all joints.
#: It includes correlations, so an error of depth that all joints share does not hide a difference between limbs.
MERGE_CHI2: Final = 9.0

#: Standard deviation of the weak prior of every joint position.
UNKNOWN_PLACE_METRES: Final = 10.0

#: Standard deviation of a hidden joint about its mode.
HIDDEN_METRES: Final = 0.15

#: Information on the rotation of a segment that is nearly perpendicular to its ray, times noise over length
#: (dimensionless).
#:
#: The image of such a segment depends on the depth of its end only to second order: noise :math:`\sigma` (metres) in
#: the seen length l corresponds to a rotation by :math:`\sqrt{2\sigma/l}`. With an information of
#: :math:`0.5\, l/\sigma`, predicted and measured errors agree for random postures within the limits at 0.5 to 5 pixels.
TURN_INFORMATION: Final = 0.5

KNOWN: Final = np.array([UNKNOWN_PLACE_METRES**-2, HIDDEN_METRES**-2, TURN_INFORMATION])


@dataclass(frozen=True, kw_only=True, eq=False)
class Modes:
    """The M modes of all frames of a problem, sorted by frame and then by ascending chi2.

    Parameters
    ----------
    problem : Problem
        Data of the frames.
    frame : int array (M,)
        Frame of each mode.
    x : array (M, 43)
        Unknowns: 42 joint coordinates, camera frame, metres, and the logarithm of the body's size (see `size`).
    chi2 : array (M,)
        Sum of squared residuals.
    """

    problem: Problem
    frame: Ints
    x: Array
    chi2: Array

    def __len__(self) -> int:
        """Return the number of modes."""
        return len(self.frame)

    @property
    def joints(self) -> Array:
        """Joint positions (M, 14, 3), camera frame, metres."""
        return self.x[:, :42].reshape(-1, 14, 3)

    @property
    def size(self) -> Array:
        """Logarithm (M,) of the factor that scales all given lengths to the lengths of the mode."""
        return self.x[:, 42]

    def take(self, rows: Ints | Flags | slice) -> Modes:
        """Return the selected modes."""
        return Modes(problem=self.problem, frame=self.frame[rows], x=self.x[rows], chi2=self.chi2[rows])

    @property
    def log_evidence(self) -> Array:
        r"""Laplace approximation of the logarithm of each mode's evidence (M,), up to an additive constant per frame.

        It is :math:`-\chi^2 / 2 - \ln \det H / 2`, with H the information matrix of the unknowns.
        """
        found = run("log_determinants", self.problem, self.frame, self.x, KNOWN)
        return np.asarray(-self.chi2 / 2 - found / 2)

    def covariance(self, rows: Ints | slice = slice(None)) -> Array:
        """Return the covariance of all joint positions of selected modes (K, 42, 42), square metres."""
        return np.asarray(run("covariance", self.problem, self.frame[rows], self.x[rows], KNOWN))

    def residuals(self) -> Mapping[str, Array]:
        """Return the absolute value of every residual of all modes (M,), in standard deviations, by name.

        Names are, for example, ``image right_wrist``, ``length neck-pelvis``, ``root``, ``size`` and ``limit
        right_elbow.flexion``.
        """
        x, joints, p, limits = self.x, self.joints, self.problem.records[self.frame], self.problem.limits
        root = np.einsum("nab,nb->na", p["root_weight"], joints[:, 0] - p["root"])
        single = [np.linalg.norm(root, axis=1)[:, None], np.abs(p["size_weight"] * x[:, 42])[:, None]]
        image, length = reference.image_terms(p, joints)[0], reference.length_terms(p, x)[0]
        table = np.concatenate([np.linalg.norm(image, axis=1), np.abs(length), *single], axis=1)
        out = dict(zip(RESIDUAL_NAMES, table.T, strict=True))
        if limits is not None:
            angles = np.concatenate([r[:, :4] for r, _ in reference.limit_terms(limits, joints, 31)], axis=1)
            beyond = p["limit_weight"][:, None] * np.abs(angles)
            out |= dict(zip([f"limit {name}" for name in limits.names], beyond.T, strict=True))
        return out


def distinct(
    problem: Problem,
    group: Ints,
    frame: Ints,
    x: Array,
    parts: int,
    within: float | Array,
    sure: bool = False,
) -> Flags:
    """Return a mask (N,) of the distinct bodies of each group; of bodies that are the same, keep the lowest chi2.

    The bodies `x` (N, 43) are sorted by group, then by chi2. Two bodies are the same if no joint of the body parts
    `parts`, relative to the neck, differs by more than `within` metres. With `sure`, they are also the same if their
    difference is small compared with their standard deviations (`MERGE_CHI2`).
    """
    near = np.broadcast_to(np.asarray(within, dtype=np.float64), group.shape)
    reach = MERGE_REACH_METRES if sure else 0.0
    return np.asarray(run("distinct", problem, group, frame, x, parts, near, reach, MERGE_CHI2, KNOWN))
