r"""How plausible each of the figure's angles is: a density that is flat inside the range and falls off with its spread.

With :math:`z` the number of spreads by which an angle is beyond the mean of the nearer end (0 inside),

.. math::

    \log p = -\tfrac12 z^2 - \log\left(u - l + \sqrt{\pi/2}\,(\sigma_l + \sigma_u)\right),

which integrates to one over the angle, in degrees, where no coupling narrows it. Under a coupling :math:`z` counts from
the coupled end, and the constant is left as it is. A sinus is a wall and no density: it is left out, and so is the
valgus of elbows and knees, since the axial rotation of a limb that is nearly straight counts next to nothing.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from posekit.errors import InputError
from posekit.geometry import Array, other_branch, turned_near
from posekit.skeleton import DOFS, SIDES
from posekit.tables.angles import SIDEWAYS_ANGLES
from posekit.validators.anatomical import Anatomy
from posekit.validators.anatomical_limb import HINGE_OF_BALL, limb_walls


def plausibility(angles: Array, anatomy: Anatomy) -> Array:
    """Return the log-density of each of the 22 angles.

    It belongs to the posture, not to the way its angles are written: of all ways to write a limb, the neck or the
    pelvis the most plausible is taken. What a coupling takes away is counted at the angle that it bounds; a shoulder's
    elevation at its flexion. The axial rotation of a limb counts by the sine of its bend: a straight limb does not
    show it.

    Parameters
    ----------
    angles : array (N, 22)
        In the order of `posekit.skeleton.DOFS`, radians; NaN where unknown.
    anatomy : Anatomy
        The table of ranges and couplings.

    Returns
    -------
    array (N, 22)
        Natural logarithms of densities per degree; NaN where an angle is.

    Raises
    ------
    InputError
        Where the angles are not (N, 22).

    Examples
    --------
    >>> import numpy as np
    >>> from posekit.validators import load_ranges
    >>> from posekit.validators.anatomical_plausibility import plausibility
    >>> q = np.zeros((2, 22))
    >>> q[1, 9] = np.radians(-40.0)  # an elbow bent backward
    >>> standing, broken = plausibility(q, load_ranges("anatomical").anatomy).sum(axis=1)
    >>> bool(standing > broken)
    True
    """
    if angles.ndim != 2 or angles.shape[1] != len(DOFS):
        raise InputError(f"angles have shape {angles.shape}; expected (N, {len(DOFS)}), one column an angle")
    degrees = np.degrees(angles)
    excess = np.empty(angles.shape)
    for joint in ("neck", "pelvis"):
        first = DOFS.index(f"{joint}.flexion")
        excess[:, first : first + 3] = _ball_excess(anatomy, joint, degrees[:, first : first + 3])
    for joint in HINGE_OF_BALL:
        for side in SIDES:
            first = DOFS.index(f"{side}_{joint}.flexion")
            excess[:, first : first + 4] = _limb_excess(anatomy, joint, degrees[:, first : first + 4])
    return np.asarray(-0.5 * excess**2 - np.log(_widths(anatomy)) + 0.0 * angles)


def _limb_excess(anatomy: Anatomy, joint: str, angles: Array) -> Array:
    couplings = tuple(one for one in anatomy.couplings if one.angle not in SIDEWAYS_ANGLES)
    excess = limb_walls(replace(anatomy, sinuses=(), couplings=couplings), joint, angles).excess()
    excess[..., 0] = np.fmax.reduce(excess[..., [0, *range(4, excess.shape[2])]], axis=-1)  # the elevation
    bend = np.abs(np.sin(np.radians(angles[:, 3])))
    excess[..., 2] *= np.where(np.isnan(bend), 1.0, bend)[:, None]
    return _most_plausible(excess[..., :4])


def _ball_excess(anatomy: Anatomy, joint: str, angles: Array) -> Array:
    """Count spreads beyond the ends of three turns, in the better of their two branches (N, 3)."""
    names = [dof for dof in anatomy.motions if dof.startswith(f"{joint}.")]
    names.sort(key=DOFS.index)
    lower, upper = (
        np.array([anatomy.motions[name].end(side) for name in names]) for side in ("lower", "upper")
    )
    both = np.stack([angles, other_branch(angles, half_turn=180.0)], axis=1)
    both = turned_near(both, (lower[:, 0] + upper[:, 0]) / 2, half_turn=180.0)
    beyond = np.fmax((lower[:, 0] - both) / lower[:, 1], (both - upper[:, 0]) / upper[:, 1])
    return _most_plausible(np.fmax(beyond, 0.0))


def _most_plausible(excess: Array) -> Array:
    """Choose the writing (N, W, K) with the least sum of squares: (N, K)."""
    best = np.argmin((excess**2).sum(axis=-1), axis=1)
    return np.asarray(np.take_along_axis(excess, best[:, None, None], axis=1)[:, 0])


def _widths(anatomy: Anatomy) -> Array:
    widths = []
    for dof in DOFS:
        (lower, below), (upper, above) = (anatomy.motion(dof).end(side) for side in ("lower", "upper"))
        widths.append(upper - lower + math.sqrt(math.pi / 2) * (below + above))
    return np.array(widths)
