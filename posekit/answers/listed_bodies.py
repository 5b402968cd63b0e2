"""All that a frame can be: the bodies that it lists, how sure each is, and how probable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from posekit.display.short_repr import ShortRepr
from posekit.errors import InputError
from posekit.formats.own import Inferred
from posekit.geometry import Array
from posekit.skeleton import JOINT

FLOOR_METRES: Final = 1e-3
"""Metres, added to every covariance: what is given, as a neck is, is not known better."""


class UncertainSurvivors(Protocol):
    """Survivors that were refined."""

    @property
    def covariance(self) -> Array:
        """Of every joint (N, 14, 3, 3), square metres; NaN where it is not known."""
        ...


class ListedFrame(Protocol):
    """What a frame lists: of a recovery, or of a result."""

    @property
    def joints(self) -> Array:
        """Camera frame (N, 14, 3), metres."""
        ...

    @property
    def refined(self) -> UncertainSurvivors | None:
        """How sure each survivor is, where the frame was refined."""
        ...

    @property
    def inferred(self) -> Sequence[Mapping[str, Inferred]] | None:
        """Joints that were not seen, by survivor."""
        ...

    @property
    def unlisted_probability(self) -> float:
        """What the bodies hold that are not listed."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class ListedBodies(ShortRepr):
    """The N bodies of a frame.

    Parameters
    ----------
    joints : array (N, 14, 3)
        Camera frame, metres; NaN where a joint is not known.
    probability : array (N,)
        Of each, if it is one of these: they sum to one.
    uncertainty : array (N, 14, 3, 3) or float
        The covariance of every joint, square metres, NaN where it is not known; or the metres that all joints are off
        in each direction.
    unlisted : float
        The probability that it is none of these.

    Raises
    ------
    InputError
        Where there are not as many probabilities, or covariances, as bodies, or what is unlisted is no probability.
    """

    joints: Array
    probability: Array
    uncertainty: Array | float = 0.0
    unlisted: float = 0.0

    def __post_init__(self) -> None:
        joints = np.asarray(self.joints, dtype=np.float64)
        shapes = {"joints": (len(joints), 14, 3), "probability": (len(joints),)}
        if not isinstance(self.uncertainty, float | int):
            shapes["uncertainty"] = (len(joints), 14, 3, 3)
        for name, shape in shapes.items():
            values = np.asarray(getattr(self, name), dtype=np.float64).view()
            if values.shape != shape:
                raise InputError(f"{name} has shape {values.shape}; expected {shape}, one a body")
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        if not 0.0 <= self.unlisted <= 1.0:
            raise InputError(f"unlisted is {self.unlisted:g}; expected a probability, 0 to 1")

    def __len__(self) -> int:
        """Count the bodies."""
        return len(self.joints)

    @staticmethod
    def of(frame: ListedFrame, probability: Array, deviation: float) -> ListedBodies:
        """Take what a frame lists; of what was not refined joints are off by `deviation` metres, if they were seen."""
        if frame.refined is not None:
            uncertainty: Array | float = frame.refined.covariance
        elif frame.inferred is None:
            uncertainty = deviation
        else:
            uncertainty = np.tile(np.eye(3) * deviation**2, (len(frame.joints), 14, 1, 1))
            for row, joints in enumerate(frame.inferred):
                uncertainty[row, [JOINT[name] for name in joints]] = np.nan
        return ListedBodies(
            joints=frame.joints,
            probability=probability,
            uncertainty=uncertainty,
            unlisted=frame.unlisted_probability,
        )

    @property
    def covariance(self) -> Array:
        """The covariance of every joint (N, 14, 3, 3), square metres, of full rank; NaN where it is not known."""
        given = self.uncertainty
        if isinstance(given, float | int):
            given = np.broadcast_to(np.eye(3) * given**2, (len(self), 14, 3, 3))
        return np.asarray(given + np.eye(3) * FLOOR_METRES**2)

    @property
    def unseen(self) -> int:
        """How many joints were not seen: where they are, nothing tells how sure it is."""
        return int(np.isnan(self.depth_variance).all(axis=0).sum()) if len(self) else 0

    @property
    def depth_variance(self) -> Array:
        """The variance of every joint's depth (N, 14), square metres; NaN where it is not known."""
        given = self.uncertainty
        own = np.full((len(self), 14), given**2) if isinstance(given, float | int) else given[..., 2, 2]
        return np.asarray(own + FLOOR_METRES**2)
