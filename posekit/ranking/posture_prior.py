"""What is known of postures before the picture is looked at, and how much each kind of evidence counts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.ranking.directions import DIRECTION_NAMES, UP_INDEX, rows_of
from posekit.ranking.student import StudentMixture
from posekit.safe_io import nearest

TERM_NAMES: Final = ("image", "posture", "gravity", "balance", "contact", "foreshortening", "depth")
"""What a survivor is judged by."""

WEIGHT_NAMES: Final = (*TERM_NAMES, "chi2")
"""What has a weight: the terms, and the chi2 of a refinement where it is the image's term."""

OF_POSTURES: Final = ("posture", "gravity")
"""The terms of directions, which survivors that are far off are no draws of."""


class SmallDistancePrior(NamedTuple):
    r"""A distance that is mostly small: its log-density is :math:`-\log(1 + (d/s)^2)`, but for a constant.

    Attributes
    ----------
    scale : float
        Metres: s.
    usual : float
        The average of the logarithm over real postures.
    """

    scale: float
    usual: float

    def judge(self, distance: Array, blur: float = 0.0) -> Array:
        """Return the log-density of distances (N,) above what is usual; 0 where one is not known.

        Parameters
        ----------
        distance : array (N,)
            Metres.
        blur : float
            Metres by which the distance may be wrong.
        """
        found = self.usual - np.log1p(distance**2 / (self.scale**2 + blur**2))
        return np.where(np.isnan(found), 0.0, found)


@dataclass(frozen=True, kw_only=True, eq=False)
class DirectionBlock:
    """Directions that are judged together, apart from those of other blocks.

    Parameters
    ----------
    names : tuple of str
        Some of `DIRECTION_NAMES`, in their order.
    student : StudentMixture
        Of their components, three a direction.
    conditional : bool
        Whether only `up` is judged, given the others, which are judged in other blocks.
    """

    names: tuple[str, ...]
    student: StudentMixture
    conditional: bool = False

    def __post_init__(self) -> None:
        unknown = [name for name in self.names if name not in DIRECTION_NAMES]
        if unknown:
            raise InputError(f"{unknown[0]!r} is no direction; {nearest(unknown[0], DIRECTION_NAMES)}")
        if list(self.names) != sorted(set(self.names), key=DIRECTION_NAMES.index) or not self.names:
            raise InputError(f"directions of a block must be in the order {', '.join(DIRECTION_NAMES)}")
        size = 3 * len(self.names)
        if self.student.means.shape[1] != size or self.student.scale.shape != (size, size):
            raise InputError(
                f"a block of {len(self.names)} directions needs {size} means and {size} x {size} scales"
            )
        if self.conditional and self.without_up in (0, size):
            raise InputError("a conditional block needs up, and directions that it is given")

    @cached_property
    def without_up(self) -> int:
        """How many components are left where nobody knows which way is up."""
        return 3 * sum(name != DIRECTION_NAMES[UP_INDEX] for name in self.names)

    @cached_property
    def rows(self) -> NDArray[np.intp]:
        """Where the components stand among all."""
        return rows_of(self.names)

    @cached_property
    def marginal(self) -> StudentMixture:
        """The distribution without `up`."""
        part = slice(self.without_up)
        return replace(self.student, means=self.student.means[:, part], scale=self.student.scale[part, part])


@dataclass(frozen=True, kw_only=True, eq=False)
class Prior:
    r"""A prior on postures, and the weights of the terms.

    Parameters
    ----------
    blocks : tuple of DirectionBlock
        Each direction at most once, but for what conditional blocks are given.
    temperature : float
        Metres: the postures' log-density is divided by 1 + deviation / temperature. A survivor that is a centimetre off
        is no draw from a distribution that is sharp to a degree.
    weights : mapping
        Of each of `WEIGHT_NAMES`, zero or more.
    refined : mapping, optional
        The same of each of `TERM_NAMES`, of refined survivors, whose image's term is their chi2; as `weights` has them
        if not given. Refined survivors are valleys of what the noise leaves, not points.
    image_temperature : float
        Metres: what is no term of `OF_POSTURES` is divided by 1 + (deviation / image_temperature)^2 where survivors
        were refined. The more noise, the less the one that fits best is the one that is nearest.
    balance, contact : SmallDistancePrior
        Of the centre of mass beside the feet's support, and of one ankle above the other.
    name, source : str
        What it is called, and what it is from.

    Raises
    ------
    InputError
        Where a number is impossible.
    """

    blocks: tuple[DirectionBlock, ...]
    temperature: float
    weights: Mapping[str, float]
    balance: SmallDistancePrior
    contact: SmallDistancePrior
    refined: Mapping[str, float] | None = None
    image_temperature: float = math.inf
    name: str = ""
    source: str = field(default="", repr=False)

    def __post_init__(self) -> None:
        names = [
            name
            for block in self.blocks
            for name in (DIRECTION_NAMES[UP_INDEX:] if block.conditional else block.names)
        ]
        if len(set(names)) != len(names):
            raise InputError(f"{self.name}: a direction is in more than one block; expected each once")
        if set(self.weights) != set(WEIGHT_NAMES):
            raise InputError(
                f"{self.name}: weights of {', '.join(self.weights)}; expected {', '.join(WEIGHT_NAMES)}"
            )
        if self.refined is not None and set(self.refined) != set(TERM_NAMES):
            raise InputError(
                f"{self.name}: refined has weights of {', '.join(self.refined)}; expected {', '.join(TERM_NAMES)}"
            )
        for what, value in (
            *((f"weights.{name}", value) for name, value in self.weights.items()),
            *((f"refined.{name}", value) for name, value in (self.refined or {}).items()),
            ("temperature", self.temperature - 1e-6),
            ("image_temperature", 0.0 if self.image_temperature > 0 else -1.0),
            ("balance.scale", self.balance.scale - 1e-6),
            ("contact.scale", self.contact.scale - 1e-6),
        ):
            if not (math.isfinite(value) and value >= 0):
                raise InputError(f"{self.name}: {what} is {value!r}; expected a finite number, not negative")
        object.__setattr__(self, "weights", MappingProxyType(dict(self.weights)))
        if self.refined is not None:
            object.__setattr__(self, "refined", MappingProxyType(dict(self.refined)))

    def weights_of(self, refined: bool) -> Mapping[str, float]:
        """Return the weight of each term, of survivors that were refined or not."""
        if not refined:
            return self.weights
        return {**self.weights, "image": self.weights["chi2"]} if self.refined is None else self.refined

    def judge(self, found: Array, sine: float = 0.0) -> tuple[Array, Array]:
        """Return the log-densities of directions (10 or 11, 3, N), each above its average.

        Parameters
        ----------
        found : array
            Of `posekit.ranking.directions.directions`, with `up` or without.
        sine : float
            Of the deviation of `up`: its variance is added.

        Returns
        -------
        posture, gravity : array (N,)
            Of the posture by itself, and of `up` given the posture; 0 where nothing is known.
        """
        flat = found.reshape(-1, found.shape[2])
        posture, gravity = np.zeros(flat.shape[1]), np.zeros(flat.shape[1])
        for block in self.blocks:
            alone = block.without_up
            if len(found) > UP_INDEX and alone < len(block.rows):
                student = block.student
                if sine > 0:
                    student = student.widened(np.where(np.arange(len(block.rows)) < alone, 0.0, sine**2))
                # log p(posture, up) - log p(posture) is the log-density of up given the posture.
                one, both = student.excess(flat[block.rows], (alone, len(block.rows)))
                if not block.conditional:
                    posture += one
                gravity += both - one
            elif alone and not block.conditional:
                posture += block.marginal.excess(flat[block.rows[:alone]], (alone,))[0]
        return posture, gravity
