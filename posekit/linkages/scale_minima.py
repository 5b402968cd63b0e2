"""The scales at which a linkage comes nearest to what is known of its shape (Taylor 2000, §2.1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.linkages.bound_angle import grid
from posekit.linkages.constraints import Constraints
from posekit.linkages.linkage_family import Flips


@dataclass(frozen=True, kw_only=True, eq=False)
class Minima:
    """All local minima of the constraints' residual over the scale and the flips, best first.

    Residuals are dimensionless: lengths count in mean segments. Each minimum stands for its mirror image in depth too
    (that of each part of the object that shares constraints), unless flips were given by hand.

    Parameters
    ----------
    constraints : Constraints
        What was minimised.
    s : array (M,)
        Scales, pixels a unit of length.
    residual : array (M,)
        The weighted sum of squares that the constraints leave there, dimensionless.
    flips : int array (M, S)
        +1 where the first end of a segment is nearer, -1 where its second is, 0 where it does not matter: the
        constraints do not read the segment, or it is foreshortened to nothing.
    at_bound : bool array (M,)
        Whether s is the least that the lengths allow.
    curve_s : array (G,)
        Scales from the bound on.
    curve_residual : array (G,)
        The least residual over all flips there: the lower envelope of all curves.
    flat : int array (K, S)
        Flips whose residual is zero at every scale, so that they fix none: opposite sides of a parallelogram.
    segments : tuple of str
        The segments that matter.
    n_flips : int
        How many assignments of them were searched.
    """

    constraints: Constraints
    s: Array
    residual: Array
    flips: Flips
    at_bound: NDArray[np.bool_]
    curve_s: Array
    curve_residual: Array
    flat: Flips
    segments: tuple[str, ...]
    n_flips: int

    def __len__(self) -> int:
        return len(self.s)

    def curve(self, number: int | np.integer[Any], s: Array | None = None) -> Array:
        """Return the residual of one minimum's own flips over the scale: Taylor's Figs. 7b and 8b.

        Parameters
        ----------
        number : int
            Which minimum; of a segment foreshortened to nothing the first flip is drawn.
        s : array (G,), optional
            Scales, at or above the bound; by default `curve_s`.
        """
        if s is None:
            psi = grid()
        else:
            family = self.constraints.family
            scales = np.asarray(s, dtype=np.float64)
            family.foreshortening(scales)  # refuses scales below the bound
            least = family.minimum_scale
            psi = np.arctan2(np.sqrt(np.maximum((scales - least) * (scales + least), 0.0)), least)
        signs = self.flips[number, self.constraints.segments].astype(np.float64)
        signs[signs == 0] = 1.0
        residual, _ = self.constraints.evaluate(signs, psi)
        return residual
