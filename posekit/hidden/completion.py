"""The completions of survivors: the sets of positions of the joints that were not seen, and one of each."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array
from posekit.hidden.posture_rows import Index, Mask
from posekit.skeleton import JOINTS


class PositionKind(IntEnum):
    """What a joint's positions are."""

    EXACT = 0
    POINT = 1
    CIRCLE = 2
    SPHERE_REGION = 3
    DEPTH_INTERVAL = 4
    REGION = 5

    @property
    def label(self) -> str:
        """The kind in words: ``depth interval``."""
        return self.name.lower().replace("_", " ")


class CompletionOutcome(IntEnum):
    """What became of a survivor."""

    EXACT = 0  # no joint was unknown
    COMPLETED = 1  # a completion was found that passes all checks
    UNDECIDED = 2  # no sample passed: that proves nothing
    IMPOSSIBLE = 3  # proven to have no completion


@dataclass(frozen=True, kw_only=True)
class Region:
    """The positions that one joint of one survivor can have.

    Parameters
    ----------
    joint : str
        The joint's name, as in `posekit.skeleton.JOINTS`.
    kind : PositionKind
        ``POINT``: one position. ``CIRCLE``: part of a circle about two known points. ``SPHERE_REGION``: part of
        the sphere about its parent. ``DEPTH_INTERVAL``: the joint is seen, its depth is not known.
        ``REGION``: part of space, its parent's position being open itself.
    representative : array (3,)
        A feasible position in the middle of the set, camera frame, metres.
    lower, upper : array (3,)
        Bounding box of the positions found, metres.
    radius : float
        Largest distance from the representative to a position found, metres.
    fraction : float
        Part of the circle, of the sphere, or of the depths within reach, that is feasible; of the samples for a
        ``REGION``; 1 for a point.
    samples : int
        How many feasible positions the description rests on.
    spacing : float
        Distance of neighbouring samples, radians; 0 where there is a finite number of positions.
    accuracy : float
        Metres by which box and radius may fall short of the truth where the set hangs together at this spacing.
    """

    joint: str
    kind: PositionKind
    representative: Array
    lower: Array
    upper: Array
    radius: float
    fraction: float
    samples: int
    spacing: float
    accuracy: float


@dataclass(frozen=True, kw_only=True, eq=False)
class CompletedSurvivors:
    """Survivors with their unknown joints filled in; camera frame, metres, radians.

    Parameters
    ----------
    postures : array (N, 14, 3)
        Known joints are unchanged to the bit. The others are representatives that satisfy all checks together;
        NaN where the outcome is not `CompletionOutcome.COMPLETED`.
    outcome : int array (N,)
        `CompletionOutcome`.
    blamed : int array (N,)
        The joint for which no position was found; -1 where none is to blame.
    miss : array (N,)
        Where no place of the trunk was found: how far the nearest one that was looked at breaks a check, radians (a
        metre counts as 1 / 0.3); NaN where some pass but for limbs that are known. Else 0.
    kind : int array (N, 14)
        `PositionKind`, as the pattern of seen and hidden joints gives it.
    lower, upper : array (N, 14, 3)
        Bounding box of each joint's positions: see `Region`; the position itself for exact joints.
    radius, fraction, spacing, accuracy : array (N, 14)
        See `Region`; NaN where nothing was found.
    samples : int array (N, 14)
        See `Region`; NaN (or 0) where nothing was found, and for exact joints but for the box.
    """

    postures: Array
    outcome: NDArray[np.int8]
    blamed: NDArray[np.int8]
    miss: Array
    kind: NDArray[np.int8]
    lower: Array
    upper: Array
    radius: Array
    fraction: Array
    samples: Index
    spacing: Array
    accuracy: Array

    @staticmethod
    def of_exact(postures: Array) -> CompletedSurvivors:
        """Start from survivors (N, 14, 3) of which nothing is unknown yet."""
        n, joints = postures.shape[:2]
        return CompletedSurvivors(
            postures=postures.copy(),
            outcome=np.zeros(n, dtype=np.int8),
            blamed=np.full(n, -1, dtype=np.int8),
            miss=np.zeros(n),
            kind=np.zeros((n, joints), dtype=np.int8),
            lower=postures.copy(),
            upper=postures.copy(),
            radius=np.zeros((n, joints)),
            fraction=np.ones((n, joints)),
            samples=np.zeros((n, joints), dtype=np.intp),
            spacing=np.zeros((n, joints)),
            accuracy=np.zeros((n, joints)),
        )

    def __len__(self) -> int:
        """Count the survivors."""
        return len(self.outcome)

    def frozen(self) -> CompletedSurvivors:
        """Set all arrays read-only."""
        for field in fields(self):
            getattr(self, field.name).flags.writeable = False
        return self

    def take(self, rows: Index | Mask) -> CompletedSurvivors:
        """Take some survivors."""
        return CompletedSurvivors(
            **{field.name: getattr(self, field.name)[rows] for field in fields(self)}
        ).frozen()

    def among(self, postures: Array, rows: Mask) -> CompletedSurvivors:
        """Put the completions of some survivors among all of them (N, 14, 3), of which the others stay as they are."""
        whole = CompletedSurvivors.of_exact(postures)
        for field in fields(self):
            getattr(whole, field.name)[rows] = getattr(self, field.name)
        return whole.frozen()

    def scaled(self, size: Array, margin: Array) -> CompletedSurvivors:
        """Make bodies so many times larger (N,) about the camera, and regions wider by a margin (N, 14, 3), metres."""
        wide = np.where(self.inferred[..., None], margin, 0.0)
        by = size[:, None, None]
        return replace(
            self,
            postures=self.postures * by,
            lower=self.lower * by - wide,
            upper=self.upper * by + wide,
            radius=self.radius * size[:, None] + np.linalg.norm(wide, axis=2),
            accuracy=self.accuracy * size[:, None],
        ).frozen()

    @property
    def inferred(self) -> Mask:
        """Which joints (N, 14) were not placed by the image."""
        return np.asarray(self.kind != PositionKind.EXACT)

    @property
    def decided(self) -> Mask:
        """Which survivors (N,) have a place for every joint that was asked for."""
        return np.asarray(self.outcome <= CompletionOutcome.COMPLETED)

    @property
    def impossible(self) -> Mask:
        """Which survivors (N,) are proven to have no completion."""
        return np.asarray(self.outcome == CompletionOutcome.IMPOSSIBLE)

    def reason(self, k: int | np.integer) -> str:
        """Return why survivor k is not completed, ``occluded/right_elbow``; empty where it is."""
        return f"occluded/{JOINTS[self.blamed[k]]}" if self.blamed[k] >= 0 else ""

    def regions(self, k: int | np.integer) -> list[Region]:
        """Describe the inferred joints of survivor k, in tree order; empty where nothing was found."""
        if self.outcome[k] != CompletionOutcome.COMPLETED:
            return []
        return [
            Region(
                joint=JOINTS[joint],
                kind=PositionKind(int(self.kind[k, joint])),
                representative=self.postures[k, joint],
                lower=self.lower[k, joint],
                upper=self.upper[k, joint],
                radius=float(self.radius[k, joint]),
                fraction=float(self.fraction[k, joint]),
                samples=int(self.samples[k, joint]),
                spacing=float(self.spacing[k, joint]),
                accuracy=float(self.accuracy[k, joint]),
            )
            for joint in np.flatnonzero(self.inferred[k])
        ]
